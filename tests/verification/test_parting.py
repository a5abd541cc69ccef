"""Lyapunov exponents of motions that close after no period, against what is known of tori, cycles and two runs."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import stridor as st
from marching import block_on_belt
from stridor.laws import StaticKinetic
from stridor.periodic import Family, NoReturn, SlidingProblem, Unclosed, cycles_reached, pushed, returns
from stridor.periodic.parting import next_change, parting

QUIET = 1e3


def blocks(second: float, coupling: float, load: float, speed: float, static: float) -> st.Case:
    """Two masses on a belt, each on its spring (1 and ``second``), with one between them where ``coupling`` is not 0;
    kinetic friction 0.3."""
    rubbing = {"law": "static-kinetic", "coefficient": 0.3, "static_coefficient": static}
    springs = {f"n{k}": {"between": (f"m{k}", "ground"), "direction": (0, 1), "stiffness": 1e-3} for k in (1, 2)}
    for k, stiffness in ((1, 1.0), (2, second)):
        springs[f"s{k}"] = {"between": (f"m{k}", "ground"), "direction": (1, 0), "stiffness": stiffness}
    if coupling:
        springs["c"] = {"between": ("m1", "m2"), "direction": (1, 0), "stiffness": coupling}
    flat = {"type": "obstacle", "shape": "flat", "point": (0, 0), "normal": (0, 1)}
    return st.Case(
        units="nondimensional",
        bodies={
            "m1": {"type": "mass", "mass": 1.0, "position": (0, 0)}, "m2": {"type": "mass", "mass": 1.0, "position": (1, 0)},
            "belt": {**flat, "sliding": {"velocity": (-speed, 0)}},
        },
        springs=springs,
        loads={"a": {"at": "m1", "force": (0, -1)}, "b": {"at": "m2", "force": (0, -load)}},
        contacts={f"r{k}": {"slave": f"m{k}", "master": "belt", "stiffness": "rigid", "friction": rubbing} for k in (1, 2)},
        modal={"max_frequency_hz": 1.0},
        temporal={"stepper": "exact"},
    )  # fmt: skip


def of(case: st.Case) -> SlidingProblem:
    return Family(st.Workspace(case).system()).at(0.3)


def test_two_masses_that_do_not_feel_each_other_move_on_a_torus():
    """Each has its own cycle, of another period: nothing parts and nothing closes, so both exponents are zero."""
    problem = of(blocks(2.3, 0.0, 1.0, 0.1, 0.4))
    motion = pushed(problem, 0.3)
    for _ in range(40):
        next_change(motion, motion.time + QUIET)
    found = parting(problem, motion, 200, QUIET, 60.0)
    assert found is not None
    # As they scatter over a few cycles: of the motions' rates, which are of the order of one, little.
    assert np.all(np.abs(found.exponents) <= found.margins)
    assert np.max(found.margins) < 0.03
    assert found.kind == "undecided"
    assert "not told" in found.words


def test_beside_a_cycle_with_stick_everything_closes():
    """A mass on a belt lets go at the same state again and again: along the motion zero, across it all is lost."""
    problem = Family(block_on_belt(law=StaticKinetic(0.3, 0.4), speed=0.2)).at(0.3)
    motion = pushed(problem, 0.3)
    for _ in range(6):
        next_change(motion, motion.time + QUIET)
    found = parting(problem, motion, 200, QUIET, 60.0)
    assert found is not None
    assert found.exponents[0] == pytest.approx(0.0, abs=1e-9)
    assert found.exponents[1] == -np.inf
    assert found.kind == "closing"
    again = Unclosed.from_json(json.loads(json.dumps(found.to_json(), allow_nan=False)))
    assert again == found


def test_what_parts_as_a_power_of_time_is_not_chaotic():
    torus = Unclosed(0.3, (2e-2, 0.0), (1e-3, 1e-3), efolds=2.0, duration=300.0, changes=800)
    assert torus.kind == "undecided"
    assert Unclosed(0.3, (2e-2, 0.0), (3e-2, 1e-3), efolds=40.0, duration=4e3, changes=800).kind == "undecided"
    assert Unclosed(0.3, (2e-2, 0.0), (1e-3, 1e-3), efolds=40.0, duration=4e3, changes=800).kind == "chaotic"


def test_what_is_known_of_such_a_motion_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """In the sentence of what is missing, in the document and in the file."""
    monkeypatch.setattr(returns, "CHANGES", 150)
    found = st.cycles(blocks(2.3, 0.0, 1.0, 0.1, 0.4), 0.3, push=0.3)
    (unclosed,) = found.unclosed
    assert (unclosed.mu, unclosed.kind, unclosed.reached_from) == (0.3, "undecided", "a push of 0.3 m/s")
    assert unclosed.words in found.missing[0]
    assert found.to_json()["unclosed"] == [unclosed.to_json()]
    st.save(found, tmp_path / "cycles.nc")
    assert st.open(tmp_path / "cycles.nc").unclosed == (unclosed,)


@pytest.mark.slow
def test_two_masses_that_feel_each_other_move_chaotically(monkeypatch: pytest.MonkeyPatch):
    """As J. Huang and D. L. Turcotte found of two coupled blocks that are not alike (Nature 348, 1990). Two runs from
    states beside one another part at the same rate."""
    problem = of(blocks(0.7441696, 2.5444421, 1.3442513, 0.2, 0.9))
    monkeypatch.setattr(returns, "CHANGES", 3000)
    with pytest.raises(NoReturn, match="the motion is chaotic") as none:
        cycles_reached(problem, pushed(problem, 0.3), 900.0)
    found = none.value.unclosed
    assert found is not None
    assert found.efolds > 10.0

    def states(aside: float, times: np.ndarray) -> np.ndarray:
        motion, seen = pushed(problem, 0.3 + aside), []
        for time in times.tolist():
            while motion.reach(time) < time:
                motion.passed()
            assert motion.anchor is not None
            seen.append(np.concatenate(motion.anchor.state(time)))
        return np.array(seen)

    times = np.arange(200.0, 1200.0, 5.0)
    apart = np.linalg.norm(states(1e-11, times) - states(0.0, times), axis=1)
    growing = (apart > 1e-10) & (apart < 1e-2)
    slope = np.polyfit(times[growing], np.log(apart[growing]), 1)[0]
    assert slope == pytest.approx(found.exponents[0], rel=0.5)
