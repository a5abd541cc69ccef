"""Operating shapes: how often the run is looked at, for how long, and what becomes of a motion that is known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp

from stridor.temporal import shapes
from stridor.temporal.settings import Settings

STEP, FREQUENCY = 1e-6, 500.0


@pytest.mark.parametrize("interrupted", [False, True])
def test_a_known_motion_on_assembled_matrices_is_given_back(monkeypatch, interrupted: bool) -> None:
    rows = sp.csr_array(np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 2], [0, 0, 0]]))
    body = SimpleNamespace(name="block", rows=SimpleNamespace(free=rows))
    system = SimpleNamespace(lines=(body,), solids=(), dimension=2)
    amplitude = np.array([1.0, 2j, 0.5 - 0.5j])
    asked = {}

    def simulate(system, phases, settings, *, mu, restart, join, observe):
        asked.update(every=observe.every, duration=phases[-1].duration, settings=settings, mu=mu, join=join)
        for k in range(round(phases[-1].duration / STEP) // observe.every):
            time = 0.25 + k * observe.every * STEP
            turned = (amplitude * np.exp(2j * np.pi * FREQUENCY * time)).real
            observe.see(time, turned + 3.0 + np.cos(2 * np.pi * 4.1 * FREQUENCY * time))
        return SimpleNamespace(interrupted=interrupted)

    monkeypatch.setattr(shapes, "simulate", simulate)
    run = SimpleNamespace(step=STEP)
    given = (system, (), Settings(step=None, watch=("block",)), run, FREQUENCY)
    if interrupted:
        with pytest.raises(KeyboardInterrupt):
            shapes.operating_shape(*given, mu=0.4)
        return
    found = shapes.operating_shape(*given, mu=0.4)
    # 24 looks at a period of 2000 steps, over 60 periods.
    assert asked["every"] == 83
    assert asked["duration"] == pytest.approx(60 / FREQUENCY)
    assert (asked["mu"], asked["join"]) == (0.4, False)
    assert asked["settings"] == replace(given[2], step=STEP, record_every=120_000, watch=())
    assert found["block"] == pytest.approx(np.array([[1.0, 2j], [1 - 1j, 0]]), abs=2e-4)
