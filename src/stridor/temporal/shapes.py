"""Operating shape: how every node moves at one frequency of a run (the paper's figure 11)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..system import System
from ..typing import ComplexArray
from .observe import LineShape
from .schedule import PhaseSpec
from .simulate import Settings, simulate
from .trajectory import Trajectory

SAMPLES = 24  # per period


def operating_shape(
    system: System,
    phases: Sequence[PhaseSpec],
    settings: Settings,
    trajectory: Trajectory,
    frequency_hz: float,
    *,
    mu: float | None = None,
    periods: float = 60.0,
) -> Mapping[str, ComplexArray]:
    """Complex velocity amplitudes (k, d) [m/s] of the nodes of each body at ``frequency_hz``.

    The run is carried on from its last state for some periods. The line is taken out with a Hann window, summed up as
    the run goes on; the motion that the supports prescribe drops out with the mean. Raises KeyboardInterrupt where
    Ctrl-C cuts the run.
    """
    system = settings.system(system)
    every = max(1, int(1.0 / (frequency_hz * SAMPLES * trajectory.step)))
    steps = round(periods / frequency_hz / trajectory.step)
    seen = LineShape(frequency_hz, every, max(2, steps // every))
    quiet = replace(settings, step=trajectory.step, record_every=max(1, steps), watch=())
    more = [*phases, PhaseSpec("shape", steps * trajectory.step, {}, {})]
    part = simulate(system, more, quiet, mu=mu, restart=trajectory, join=False, observe=seen)
    if part.interrupted:
        raise KeyboardInterrupt
    return {
        body.name: np.asarray(body.rows.free @ seen.amplitude).reshape(-1, system.dimension)
        for body in (*system.lines, *system.solids)
    }
