"""What a page draws of a run: nothing of it is lost but detail."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import stridor as st
from benches import paper_case
from stridor.temporal.trajectory import Trajectory
from stridor.view.run_so_far import COLUMNS, STRETCHES, run_so_far


@pytest.fixture(scope="module")
def parts() -> list[Trajectory]:
    changes = {
        "bodies.beam1.elements": 4, "bodies.beam2.elements": 8, "temporal.step": 2e-7, "temporal.record_every": 5,
        "phases.press.duration": 1e-3, "phases.slide.duration": 8e-3, "contacts.A.friction.coefficient": 0.5,
    }  # fmt: skip
    seen: list[Trajectory] = []
    run = st.simulate(paper_case().with_(changes), checkpoint=seen.append, checkpoint_seconds=0.0)
    return [*seen, run]


def test_a_run_under_way_grows(parts: list[Trajectory]) -> None:
    found = [run_so_far(p) for p in parts]
    assert len(found) > 1
    assert [f.done for f in found] == sorted(f.done for f in found)
    assert found[-1].done == found[-1].planned
    assert {f.planned for f in found} == {found[-1].planned}


def test_bands_hold_every_peak(parts: list[Trajectory]) -> None:
    run = parts[-1]
    found = run_so_far(run)
    assert found.acceleration is not None
    assert len(found.time) == STRETCHES
    axis = "xyz".index(found.acceleration.label[-1])
    history = run.acceleration[:, 0, axis]
    assert max(found.acceleration.high) == history.max()
    assert min(found.acceleration.low) == history.min()
    assert history.std() == max(run.acceleration[:, 0, k].std() for k in range(2))
    assert max(found.normal_force[0].high) == run.normal_force[:, 0].max()
    # Each stretch holds what lies in it.
    for k, (low, high) in enumerate(zip(found.acceleration.low, found.acceleration.high, strict=True)):
        edges = np.linspace(0, len(history), STRETCHES + 1).astype(int)
        assert (low, high) == (history[edges[k] : edges[k + 1]].min(), history[edges[k] : edges[k + 1]].max())


def test_shares_of_status(parts: list[Trajectory]) -> None:
    run = parts[-1]
    shares = np.array(run_so_far(run).status["A"])
    assert np.allclose(shares.sum(axis=0), 1.0)
    sizes = np.diff(np.linspace(0, len(run.time), STRETCHES + 1).astype(int))
    for kind in range(3):
        assert shares[kind] @ sizes / sizes.sum() == pytest.approx(np.mean(run.status[:, 0] == kind))


def test_the_spectra_show_the_pitch_when_it_was(parts: list[Trajectory]) -> None:
    run = parts[-1]
    pitch = np.where(run.time < 5e-3, 5e3, 15e3)
    acceleration = np.zeros_like(run.acceleration)
    acceleration[:, 0, 1] = np.sin(2 * np.pi * np.cumsum(pitch) * run.sampling)
    found = run_so_far(replace(run, acceleration=acceleration), max_frequency_hz=20e3).sonogram
    assert found is not None
    assert len(found.time) <= COLUMNS
    level = np.array(found.level)
    loudest = np.array(found.frequency_hz)[level.argmax(axis=1)]
    spacing = found.frequency_hz[1]
    early, late = np.array(found.time) < 4e-3, np.array(found.time) > 6e-3
    assert np.all(np.abs(loudest[early] - 5e3) <= spacing)
    assert np.all(np.abs(loudest[late] - 15e3) <= spacing)
    assert level.max() == 0.0


def test_it_is_plain_data_whatever_the_run_holds(parts: list[Trajectory]) -> None:
    run = parts[-1]
    wild = run.acceleration.copy()
    wild[-3:] = np.inf
    for one in (run, replace(run, acceleration=wild), parts[0], replace(run, watch_names=()), _first(run, 0), _first(run, 3)):
        text = json.dumps(run_so_far(one).to_json(), allow_nan=False)
        assert len(text) < 500_000


def _first(run: Trajectory, count: int) -> Trajectory:
    names = ("time", "normal_force", "tangential_force", "slip_speed", "gap", "status", "displacement", "velocity", "acceleration")
    return replace(run, **{name: getattr(run, name)[:count] for name in names})
