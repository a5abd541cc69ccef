"""Exact steps on modes up to a frequency and static answers: what the basis keeps, and the first regime of the bench
over the cut-off frequency against explicit steps on all modes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.linalg as sl

import stridor as st
from mode_coupling import mode_coupling
from stridor.case import template_text
from stridor.study.settings import settings_of
from stridor.study.without_effect import without_effect
from stridor.system import System
from stridor.temporal.energy import energy_balance
from stridor.temporal.simulate import plan
from stridor.temporal.steppers import coordinates as of_steppers
from stridor.temporal.steppers.coordinates import left_out, truncated

pytestmark = pytest.mark.verification

COARSE = {"bodies.beam1.elements": 10, "bodies.beam2.elements": 30, "contacts.A.stiffness": "rigid"}
IN_TIME = {
    "temporal.step": 1e-6, "temporal.record_every": 5, "temporal.stepper": "exact", "phases.press.duration": 0.01,
    "phases.slide.duration": 0.012, "bodies.beam1.damping.stiffness": 1e-7, "bodies.beam2.damping.stiffness": 1e-7,
}  # fmt: skip


def bench(**more: Any) -> st.Case:
    return st.loads(template_text("two-beams")).with_(COARSE | {k.replace("__", "."): v for k, v in more.items()})


def receptance(system: System, vectors: np.ndarray, squares: np.ndarray, hz: float) -> np.ndarray:
    """Undamped, of the gap and the slip of the contact and of the load at the guide."""
    nodes = system.contact_nodes()
    rows = np.vstack([nodes.normal.toarray(), nodes.tangent.toarray(), *(v[None] for v in system.loads.values())]) @ vectors
    return rows / (squares - (2 * np.pi * hz) ** 2) @ rows.T


@pytest.mark.parametrize("sparse", [False, True])
def test_low_modes_and_statics_are_those_of_the_whole(sparse: bool, monkeypatch: pytest.MonkeyPatch):
    if sparse:
        monkeypatch.setattr(of_steppers, "COMPLETE", 0)  # as of systems too large for all their modes
    system = st.build_system(bench())
    squares, vectors = sl.eigh(system.stiffness.toarray(), system.mass.toarray())
    found = truncated(system, 60e3)
    low = squares <= (2 * np.pi * 60e3) ** 2
    assert found.modes == low.sum()
    assert found.modes < found.basis.size < 40
    own = np.sqrt(np.abs(np.sort(found.basis.stiffness)[: found.modes]))
    assert own == pytest.approx(np.sqrt(np.abs(squares[low])), rel=1e-6, abs=1.0)
    kept = found.basis.vectors
    assert kept.T @ (system.mass @ kept) == pytest.approx(np.eye(kept.shape[1]), abs=1e-8)
    # To second order in frequency over that of the modes left out: exact where that is small.
    off = []
    for hz in (50.0, 5e3, 30e3):
        whole = receptance(system, vectors, squares, hz)
        off.append(np.linalg.norm(receptance(system, kept, found.basis.stiffness, hz) - whole) / np.linalg.norm(whole))
    assert off[0] < 1e-7
    assert off[1] < 1e-5
    assert off[2] < 0.02
    lacking = left_out(system, found)
    assert lacking.at_hz == 30e3
    assert 1e-5 < lacking.receptance_off < 0.05
    # A frequency that is asked for beyond it counts: at half of a low one statics alone are right.
    assert left_out(system, truncated(system, 5e3)).receptance_off < 0.05
    assert left_out(system, truncated(system, 5e3), 40e3).receptance_off > 0.5
    nodes = system.contact_nodes()
    row = nodes.normal.toarray()[0]
    light, heavy = row @ np.linalg.solve(system.mass.toarray(), row), np.sum((row @ kept) ** 2)
    assert lacking.heavier == pytest.approx(light / heavy, rel=1e-6)


def test_a_cutoff_above_all_modes_changes_nothing():
    case = mode_coupling(0.1, 0.1)
    one, other = (st.simulate(c, 0.9) for c in (case, case.with_({"temporal.cutoff_hz": 1e6})))
    assert np.array_equal(one.displacement, other.displacement)
    assert "all modes" not in other.path_reason
    assert "static" not in other.path_reason
    found = st.cycles(case.with_({"temporal.cutoff_hz": 1e6}), mu=0.9)
    assert not any("static" in note for note in found.notes)


def test_the_first_regime_of_the_bench_over_the_cutoff():
    """Squeal that sticks and slips, before contacts part: normal force against explicit steps on all modes."""
    whole = st.simulate(bench().with_(IN_TIME).with_({"temporal.stepper": "explicit", "temporal.step": 1e-7, "temporal.record_every": 50}))
    runs = {hz: st.simulate(bench().with_(IN_TIME).with_({"temporal.cutoff_hz": hz})) for hz in (15e3, 40e3, 100e3)}
    window = (whole.time > 0.014) & (whole.time < 0.022)
    assert np.mean(whole.status[window, 0] == 1) > 0.1  # it does stick
    assert np.mean(whole.status[window, 0] == 2) > 0.1  # and slip
    assert not np.any(whole.status[window, 0] == 0)
    size = whole.normal_force[window, 0].std()
    off = {hz: abs(run.normal_force[window, 0].std() / size - 1) for hz, run in runs.items()}
    assert off[100e3] < 0.003
    assert off[40e3] < 0.03
    assert off[15e3] > 0.05  # a basis too small is told from one that is not
    for run in runs.values():
        assert energy_balance(run).error < 1e-9
    reason = runs[100e3].path_reason
    assert "modes up to 100000 Hz and " in reason
    assert "receptance at the contacts is off by " in reason
    assert "times as heavy as on all modes" in reason


def test_cycles_say_what_they_are_of():
    found = st.cycles(bench(temporal__cutoff_hz=30e3), mu=0.1, push=[0.01], seconds=0.5)
    assert any(note.startswith("cycles of ") and "30000 Hz" in note for note in found.notes)


def test_where_it_has_no_effect_is_said():
    case = bench(temporal__cutoff_hz=30e3)
    assert any(line.startswith("temporal.cutoff_hz has no effect") for line in without_effect(case, "simulate"))
    lines = without_effect(case.with_({"temporal.stepper": "exact"}), "simulate")
    assert not any("cutoff" in line for line in lines)
    auto = case.with_({"temporal.stepper": "auto"})
    assert not any("cutoff" in line for line in without_effect(auto, "simulate"))
    assert plan(st.build_system(auto), settings_of(auto))[:2] == (
        "exact", "temporal.cutoff_hz gives modes up to 30000 Hz, which it takes"
    )  # fmt: skip
    falling = {"law": "weakening", "coefficient": 0.1, "static_coefficient": 0.12, "decay_speed": 0.05}
    lines = without_effect(auto.with_({"contacts.A.friction": falling}), "simulate")
    assert 'temporal.cutoff_hz has no effect: temporal.stepper = "auto" comes to explicit steps here' in lines


def test_a_cutoff_below_all_modes_is_refused():
    block = mode_coupling(0.1, 0.1).with_({"temporal.cutoff_hz": 1e-3})
    with pytest.raises(st.CaseError, match=r"temporal\.cutoff_hz: 0\.001 – a frequency with modes of the structure below it"):
        st.simulate(block, 0.9)
    with pytest.raises(st.CaseError, match="a frequency with modes"):
        st.cycles(block, mu=0.9)


def test_a_large_system_is_taken_with_one():
    fine = {"bodies.beam1.elements": 60, "bodies.beam2.elements": 480, "temporal.stepper": "exact", "temporal.step": 1e-6}
    case = bench().with_(fine | {"temporal.initial": "steady-sliding", "temporal.perturbation": 1e-3, "phases.press.duration": 1e-4, "phases.slide.duration": 1e-4})
    case = case.with_({"phases.press.velocities": {"clamp": 1.0}})
    with pytest.raises(st.CaseError, match=r"1621 freedoms are too many.*temporal\.cutoff_hz takes those up to a frequency"):
        st.simulate(case)
    run = st.simulate(case.with_({"temporal.cutoff_hz": 40e3}))
    assert run.path == "exact"
    assert np.all(np.isfinite(run.displacement))
