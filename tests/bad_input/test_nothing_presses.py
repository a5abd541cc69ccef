"""Cases in which nothing presses the bodies together: refused in time and told by `check`, and never others."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import stridor as st
from solid_cases import BELT
from stridor.case import template_text
from stridor.sliding import nothing_presses
from stridor.study.pressed import unpressed

pytestmark = pytest.mark.bad_input

def belt(**changes: Any) -> st.Case:
    """A mass on a belt for a hundredth of a second."""
    text = BELT.replace("duration = 40.0", "duration = 0.01")
    return st.loads(text).with_({key.replace("__", "."): value for key, value in changes.items()})


def told(case: st.Case) -> list[str]:
    return [w for w in st.describe(case).warnings if w.startswith("nothing presses")]


@pytest.mark.parametrize(
    ("case", "why"),
    [
        (belt(loads__weight={"at": "m", "force": [0.0, 0.0]}), "loads that are 0 or cancel (weight)"),
        (
            belt(phases=[{"name": "run", "duration": 0.01, "loads": {"weight": 0.0}}]),
            "loads that are 0 or cancel (weight)",
        ),
        (
            belt(loads__lift={"at": "m", "force": [0.0, 0.7]}, loads__more={"at": "m", "force": [0.0, 0.3]}),
            "loads that are 0 or cancel (weight, lift, more)",
        ),
        (belt(loads={}), "no load acts"),
    ],
)
def test_a_run_without_normal_force_is_refused(case: st.Case, why: str) -> None:
    words = f"nothing presses the bodies together ({why}), so that nothing rubs"
    for call in (st.simulate, st.compare):
        with pytest.raises(st.AnalysisError) as error:
            call(case)
        assert words in str(error.value)
        assert "\n" not in str(error.value)
    assert len(told(case)) == 1


def test_the_shipped_bench_without_its_load_is_refused() -> None:
    case = st.loads(template_text("two-beams"), ["loads.press.force=[0.0, 0.0]"])
    with pytest.raises(st.AnalysisError, match=r"^simulate: nothing presses the bodies together"):
        st.simulate(case)
    with pytest.raises(st.AnalysisError, match=r"^compare: nothing presses the bodies together"):
        st.compare(case)


@pytest.mark.parametrize(
    "case",
    [
        belt(),
        # A later phase that presses is enough.
        belt(
            phases=[
                {"name": "wait", "duration": 0.005, "loads": {"weight": 0.0}},
                {"name": "press", "duration": 0.005, "loads": {"weight": 1.0}},
            ]
        ),
        belt(loads={}, bodies__m__initial_velocity=[0.0, -0.1]),
    ],
)
def test_what_presses_is_not_told_off(case: st.Case) -> None:
    assert not told(case)
    assert st.simulate(case).steps == 10


@pytest.mark.parametrize(("speed", "presses"), [(-0.01, True), (0.01, False), (0.0, False)])
def test_a_support_that_moves_one_body_towards_the_other_presses(speed: float, presses: bool) -> None:
    case = st.loads(template_text("two-beams")).with_(
        {
            "loads.press.force": [0.0, 0.0],
            "supports.guide.fixed": ["x", "y", "rotation"],
            "supports.guide.velocity": {"y": speed},
        }
    )
    system = st.build_system(case)
    assert (not unpressed(case, system)) is presses
    assert unpressed(case, system, steady=True)


def test_modes_and_onsets_without_any_load_say_that_contacts_are_taken_as_closed() -> None:
    coarse = {"bodies.beam1.elements": 6, "bodies.beam2.elements": 12, "modal.max_frequency_hz": 5e3}
    loaded = st.loads(template_text("two-beams")).with_(coarse)
    free = loaded.with_({"loads": {}, "phases": [{"name": "slide", "duration": 0.01}]})
    for call in (st.modes, st.onsets):
        assert any("taken as closed" in note for note in call(free).notes)
        assert not any("taken as closed" in note for note in call(loaded).notes)


def test_one_decision_for_what_loads_leave_as_rounding() -> None:
    """Loads that all but cancel: what modes refuse, runs refuse."""
    for rest, presses in ((1e-6, True), (1e-10, False)):
        case = belt(loads__lift={"at": "m", "force": [0.0, 1.0 - rest]})
        system = st.build_system(case)
        assert (not unpressed(case, system)) is presses
        forces = np.array([rest])
        assert (not nothing_presses(system, forces)) is presses
