"""Friction coefficients at which there is no steady sliding, among others at which there is: nothing is known of what
grows there, and nothing may say that nothing does."""

from __future__ import annotations

import json

import numpy as np
import pytest

import stridor as st
from stridor.agreement.critical import NoChangeError, _without_change
from stridor.app.conclusions import of_modes
from stridor.app.page.mapping import UNKNOWN, _counts
from stridor.app.show_modes import show_modes
from stridor.modal import over_friction
from stridor.modal.options import Options
from stridor.sliding.stretches import Stretch
from stridor.study.ensemble_modes import unstable_modes
from stridor.study.workspace import Workspace
from stridor.system import build_system

WHY = "it tips over"
END = 1.2  # the μ from which on there is none, taken as given


def coupled() -> st.Case:
    """The minimal model of mode coupling, undamped onset at μ = 3/4."""
    root = 3**0.5
    springs = {
        f"k{k}": {"between": ("m", "ground"), "direction": (c, 0.5), "stiffness": 2 / 3 * (2 + s * root)}
        for k, c, s in ((1, -root / 2, -1), (2, root / 2, 1))
    }
    return st.Case(
        units="nondimensional", springs=springs, loads={"press": {"at": "m", "force": (0, -1)}},
        bodies={
            "m": {"type": "mass", "mass": 1.0, "position": (0, 0)},
            "belt": {
                "type": "obstacle", "shape": "flat", "point": (0, 0), "normal": (0, 1), "sliding": {"velocity": (-1, 0)},
            },
        },
        contacts={
            "rub": {
                "slave": "m", "master": "belt", "stiffness": 4 / 3,
                "friction": {"law": "coulomb", "coefficient": 0.3},
            },
        },
        modal={"max_frequency_hz": 1.0, "friction_range": [0.0, 2.0], "source": "krylov"},
    )  # fmt: skip


@pytest.fixture(autouse=True)
def _ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Steady sliding ends at END, without the search for where."""

    def given(system: object, low: float, high: float, **_: object) -> tuple[Stretch, ...]:
        if high <= END:
            return (Stretch(low, high, None, 1, 1),)
        return (Stretch(low, END, None, 1, 1), Stretch(END, high, None, 0, 1, WHY))

    monkeypatch.setattr(over_friction, "stretches", given)


@pytest.mark.parametrize("check", [True, False])
def test_nothing_is_counted_where_nothing_was_solved(check: bool) -> None:
    found = st.modes(coupled(), [1.5, 0.5, 1.0], check=check)
    assert found.solved.tolist() == [False, True, True]
    assert np.isnan(found.eigenvalues[0]).all()
    assert np.isnan(found.damping_ratio[0]).all()
    document = found.to_json()
    assert document["unstable_modes"] == [None, 0, 1]
    assert document["modes_in_band"] == [None, 2, 2]
    assert any("nothing was solved: it tips over" in note for note in found.notes)
    assert "nothing solved at 1 of them" in repr(found)
    assert "not solved" in found._repr_html_()
    data = found.to_xarray()
    assert data["solved"].values.tolist() == [0, 1, 1]
    assert json.loads(data.attrs["modes_in_band"]) == [None, 2, 2]
    said = of_modes(found, None).sentence
    assert said.startswith("unstable modes at 1 of 2 friction coefficients, the lowest 1; ")
    assert "; at μ = 1.5 nothing was solved" in said
    band = st.modes(coupled(), [1.5, 0.5, 1.0], band_hz=(0.3, 1.0), check=check).to_json()
    assert [band[name][0] for name in ("unstable_modes", "modes_in_band", "unstable_outside_band")] == [None] * 3


def test_a_single_friction_without_steady_sliding_is_refused_either_way(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    case = coupled().with_({"loads.press.force": (0.0, 1.0)})  # pulls the mass off
    for check in (True, False):
        with pytest.raises(st.AnalysisError):
            st.modes(case, 1.5, check=check)


def test_each_friction_has_its_own_nodes_whether_checked_or_not(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[float, float]] = []

    def noted(system: object, low: float, high: float, **_: object) -> tuple[Stretch, ...]:
        asked.append((low, high))
        return (Stretch(low, 0.7, None, 1, 1), Stretch(0.7, high, None, 1, 1))

    monkeypatch.setattr(over_friction, "stretches", noted)
    one, other = (st.modes(coupled(), [0.5, 1.0], check=check) for check in (True, False))
    assert asked == [(0.5, 1.0)] * 2
    np.testing.assert_allclose(one.eigenvalues, other.eigenvalues, rtol=1e-9)
    assert one.solved.all()
    assert "solved" not in one.to_xarray()


def test_the_table_says_that_nothing_was_solved(capsys: pytest.CaptureFixture[str]) -> None:
    show_modes(st.modes(coupled(), [0.5, 1.5]), sort="frequency", unstable=False, say=lambda _: None)
    out = capsys.readouterr().out
    assert "nothing solved: there is no steady sliding at this μ" in out
    assert "all 0 modes" not in out


def test_a_map_has_no_count_there() -> None:
    work = Workspace(coupled())
    options = {"x": "mu", "y": "bodies.m.mass"}
    told = list(_counts(work, options, np.array([0.5, 1.0, 1.5]), np.array([1.0]), {}))
    assert [n for _, n, _ in told] == [0, 1, UNKNOWN]
    assert [bool(why) for _, _, why in told] == [False, False, True]


def test_the_map_of_an_ensemble_has_no_count_there() -> None:
    found = unstable_modes(Workspace(coupled()), [0.5, 1.0, 1.5], [1.0], [1.0])
    assert found.map is not None
    assert found.map.to_json()["unstable"] == [[0], [1], [None]]
    assert found.at(1.5, 1.0, 1.0) is None
    assert found.at(0.5, 1.0, 1.0) is not None
    assert any(WHY in note for note in found.notes)


def test_growth_does_not_begin_between_a_friction_without_modes_and_one_with(monkeypatch: pytest.MonkeyPatch) -> None:
    def upside_down(system: object, low: float, high: float, **_: object) -> tuple[Stretch, ...]:
        return (Stretch(low, 0.9, None, 0, 1, WHY), Stretch(0.9, high, None, 1, 1))

    monkeypatch.setattr(over_friction, "stretches", upside_down)
    found = _without_change(build_system(coupled()), (0.5, 1.0), 1.0, 0.75, NoChangeError("the same", grow=True), Options())
    assert found.why == "the same"


def test_a_figure_shows_where_there_is_none() -> None:
    found = st.modes(coupled(), [0.5, 1.0, 1.5, 2.0], check=False)
    (ax,) = st.plot.growth_branches(found).axes
    assert "nothing solved" in [text.get_text() for text in ax.texts]
    (ax,) = st.plot.growth_branches(st.modes(coupled(), [0.5, 1.0], check=False)).axes
    assert not ax.texts
