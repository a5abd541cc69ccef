"""Settings that change no number on the path taken are told, and those that do are not."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stridor as st
from program import stridor
from rubbing_block import rubbing_block
from solid_cases import BELT
from stridor.app.reduce import _ranges
from stridor.case import template_text
from stridor.study import workspace
from stridor.study.without_effect import without_effect

MU = 0.3


def beams() -> st.Case:
    return st.loads(template_text("two-beams")).with_(
        {
            "bodies.beam1.elements": 6,
            "bodies.beam2.elements": 18,
            "contacts.A.stiffness": "rigid",
            "temporal.contact": "as given",
            "temporal.step": 4e-7,
            "phases.press.duration": 1e-4,
            "phases.slide.duration": 1e-4,
        }
    )


def block() -> st.Case:
    """As coarse as a block with an onset can be: what is compared are bits."""
    return st.loads(rubbing_block("max_frequency_hz = 30e3")).with_(
        {"bodies.block.mesh.divisions": [2, 2], "bodies.slider.mesh.divisions": [6, 1]}
    )


CASES = {"beams": beams, "block": block}


def modal(case: st.Case) -> np.ndarray:
    return st.modes(case, MU, count=6).eigenvalues


# What an analysis answers before anything is changed is computed once.
@functools.cache
def modal_before(which: str) -> np.ndarray:
    return modal(CASES[which]())


@pytest.mark.parametrize(
    ("which", "change"),
    [
        ("beams", {"modal.solver": "superlu"}),
        ("beams", {"modal.friction_damping": True}),
        ("beams", {"modal.prestress": True}),
        ("beams", {"modal.damped": False}),
        ("beams", {"materials.steel.poisson_ratio": 0.2}),
        ("beams", {"contacts.A.stiffness": 1e7}),
        ("beams", {"bodies.beam1.damping.mass": 60.0}),
        ("block", {"modal.friction_damping": True}),
        ("block", {"modal.prestress": True}),
        ("block", {"modal.damped": False}),
        ("block", {"materials.pad.poisson_ratio": 0.2}),
        ("block", {"contacts.face.stiffness": 1e11}),
    ],
)
def test_what_changes_no_mode_is_told_and_nothing_else(which: str, change: dict[str, Any]) -> None:
    case = CASES[which]()
    changed = case.with_(change)
    (setting,) = change
    same = bool(np.array_equal(modal_before(which), modal(changed)))
    told = any(line.startswith(setting) for line in without_effect(changed, "modes"))
    assert told is same
    assert without_effect(case, "modes") == []


@pytest.mark.parametrize(
    ("change", "verbs"),
    [
        ({"contacts.A.stiffness": 1e7}, set[str]()),
        ({"temporal.contact": "rigid"}, {"simulate"}),
        ({"modal.damped": False}, {"simulate"}),
        ({"modal.prestress": True}, {"simulate"}),
        ({"temporal.beta2": 0.6}, set[str]()),
    ],
)
def test_what_changes_no_motion_is_told(change: dict[str, Any], verbs: set[str]) -> None:
    case = beams()
    changed = case.with_(change)
    one, two = st.simulate(case), st.simulate(changed)
    same = np.array_equal(one.normal_force, two.normal_force) and np.array_equal(one.elastic, two.elastic)
    (setting,) = change
    told = {verb for verb in ("simulate",) if any(x.startswith(setting) for x in without_effect(changed, verb))}
    assert told == verbs
    assert bool(told) is bool(same)


@pytest.mark.parametrize("stepper", ["exact", "implicit"])
@pytest.mark.parametrize("change", [{"temporal.beta2": 0.6}, {"temporal.path": "nodal"}])
def test_what_explicit_steps_need_has_no_effect_on_others(change: dict[str, Any], stepper: str) -> None:
    case = beams().with_({"temporal.stepper": stepper})
    one, two = st.simulate(case), st.simulate(case.with_(change))
    assert np.array_equal(one.normal_force, two.normal_force)
    (setting,) = change
    assert without_effect(case, "simulate") == []
    assert [x.partition(" ")[0] for x in without_effect(case.with_(change), "simulate")] == [setting]


def test_stiffness_acts_on_the_modes_of_a_comparison_alone_where_time_is_to_be_rigid() -> None:
    case = beams().with_({"temporal.contact": "rigid"})
    changed = case.with_({"contacts.A.stiffness": 1e7})
    one, two = (st.compare(c, [MU], only=["growth"]).comparisons[0] for c in (case, changed))
    assert one.perturbation.eigenvalue == two.perturbation.eigenvalue
    assert one.modal_eigenvalue != two.modal_eigenvalue
    for verb in ("compare", "run"):
        assert without_effect(changed, verb) == []
        assert without_effect(case, verb) == ['temporal.contact = "rigid" has no effect: no contact has a stiffness']
    started = {
        "temporal.initial": "steady-sliding",
        "temporal.perturbation": 1e-6,
        "phases": [{"name": "slide", "duration": 1e-4}],
    }
    runs = [st.simulate(c.with_(started)) for c in (case, changed)]
    assert np.array_equal(runs[0].elastic, runs[1].elastic)
    assert without_effect(changed.with_(started), "simulate") == [
        'contacts.A.stiffness has no effect in time: temporal.contact = "rigid"'
    ]


CHANGES: list[tuple[str, dict[str, Any]]] = [
    ("beams", {"modal.friction_damping": True}),
    ("beams", {"modal.prestress": True}),
    ("beams", {"modal.damped": False}),
    ("block", {"modal.friction_damping": True}),
    ("block", {"modal.prestress": True}),
    ("block", {"modal.damped": False}),
    ("block", {"contacts.face.stiffness": 1e11}),
    ("block", {"temporal.path": "nodal"}),
    ("block", {"materials.pad.poisson_ratio": 0.2}),
]


def told(change: dict[str, Any], case: st.Case, verb: str) -> bool:
    (setting,) = change
    return any(line.startswith(setting) for line in without_effect(case.with_(change), verb))


def onsets(which: str, change: dict[str, Any]) -> list[dict[str, Any]]:
    ends = (0.0, 0.3) if which == "beams" else (0.0, 0.45)
    return [o.to_json() for o in st.onsets(CASES[which]().with_(change), ends, check=False).onsets]


@functools.cache
def onsets_before(which: str) -> list[dict[str, Any]]:
    return onsets(which, {})


@pytest.mark.parametrize(("which", "change"), CHANGES)
def test_what_changes_no_onset_is_told_and_nothing_else(which: str, change: dict[str, Any]) -> None:
    if "temporal.path" in change:
        pytest.skip("not of the modal approach")
    before = onsets_before(which)
    assert before  # else nothing is compared
    assert told(change, CASES[which](), "onsets") is (before == onsets(which, change))


def growth(which: str, change: dict[str, Any]) -> tuple[complex | None, complex]:
    row = st.compare(CASES[which]().with_(change), [MU], only=["growth"]).comparisons[0]
    return row.modal_eigenvalue, row.perturbation.eigenvalue


@functools.cache
def growth_before(which: str) -> tuple[complex | None, complex]:
    return growth(which, {})


@pytest.mark.parametrize(("which", "change"), CHANGES)
def test_what_changes_nothing_in_a_comparison_is_told_and_nothing_else(which: str, change: dict[str, Any]) -> None:
    assert told(change, CASES[which](), "compare") is (growth_before(which) == growth(which, change))


@pytest.mark.parametrize("change", [c for which, c in CHANGES if which == "block"])
def test_what_changes_no_motion_of_a_solid_is_told_and_nothing_else(change: dict[str, Any]) -> None:
    if "modal.friction_damping" in change:
        pytest.skip("said of modes alone")
    short = block().with_({"phases": [{"name": "slide", "duration": 2e-4}], "temporal.record_every": 1})
    one, two = st.simulate(short), st.simulate(short.with_(change))
    same = len(one.time) == len(two.time) and np.array_equal(one.normal_force, two.normal_force)
    assert told(change, short, "simulate") is same


def test_contact_over_a_surface_tells_the_path_without_another_model(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("built once more")

    monkeypatch.setattr(workspace, "build_system", refuse)
    case = block().with_({"modal.prestress": True, "temporal.path": "nodal"})
    assert [line.split(" ")[0] for line in without_effect(case, "simulate")] == ["modal.prestress", "temporal.path"]
    with pytest.raises(AssertionError, match="built once more"):
        without_effect(beams().with_({"modal.prestress": True}), "simulate")


def test_settings_of_the_other_paths() -> None:
    belt = st.loads(BELT).with_({"temporal.path": "nodal"})
    assert without_effect(belt, "simulate") == [
        "temporal.path = 'nodal' has no effect: assembled matrices have one path"
    ]
    assert without_effect(belt, "modes") == []
    assert without_effect(beams(), "onsets", solver="mumps") == [
        "--solver has no effect: beams in point contacts are solved by dense methods"
    ]
    loose = beams().with_({"comparison.critical": False, "comparison.tolerance": 1e-3})
    assert any(line.startswith("comparison.tolerance has no effect") for line in without_effect(loose, "compare"))
    assert without_effect(beams().with_({"modal.prestress": True}), "check") == []


POISSON = "materials.steel.poisson_ratio"
FLAT = f"{POISSON} has no effect: no matrix of the problem depends on it"


def few() -> st.Case:
    """Beams of few elements with one damping and few modes: nothing but paths of numbers matters here."""
    return beams().with_({"contacts.A.stiffness": 1e9, "modal.max_frequency_hz": 4e3, "modal.friction_range": [0.0, 0.2]})


def test_a_boundary_over_a_number_that_changes_nothing_says_so() -> None:
    ranges = {"x_range": (0.2, 0.4), "y_range": (0.0, 0.2)}
    found = st.stability_boundary(few(), POISSON, "mu", lines=2, **ranges)
    assert found.warnings[0] == FLAT
    moved = st.stability_boundary(few(), "materials.steel.density", "mu", lines=2, x_range=(7e3, 8e3), y_range=(0.0, 0.2))
    assert not any("no effect" in line for line in moved.warnings)


def test_onsets_along_a_number_that_changes_nothing_say_so() -> None:
    assert st.onsets(few(), (0.2, 0.4), along=POISSON).warnings == (FLAT,)
    assert st.onsets(few(), (7e3, 8e3), along="materials.steel.density").warnings == ()


def test_a_reduced_model_says_which_of_its_numbers_change_nothing(tmp_path: Path) -> None:
    model = st.reduced_model(few(), {"mu": (0.0, 0.2), POISSON: (0.2, 0.4)}, bound=1e-4)
    assert model.problem.idle == (POISSON,)
    assert FLAT in model._repr_html_()
    (tmp_path / "case.toml").write_text(few().text, encoding="utf-8")
    done = stridor("reduce", "case.toml", "--box", f"{POISSON}=0.2:0.4", "--bound", "1e-4", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert FLAT in json.loads(done.stdout)["warnings"]


def test_a_box_with_two_ranges_of_one_parameter_is_refused() -> None:
    with pytest.raises(st.CaseError) as error:
        _ranges(beams(), ["mu=0:0.1", "mu=0:0.2"])
    assert str(error.value) == "--box: 'mu=0:0.2' – mu has a range already, (0.0, 0.1); give each once"


def test_check_tells_cubic_springs() -> None:
    case = st.loads(BELT).with_({"springs.k.cubic": 2e5, "springs.k.damping": 3.0})
    (line,) = [x for x in st.describe(case).lines if x.startswith("  spring k")]
    assert line == "  spring k: m to ground, 1 N/m and 200000 N/m³ times the cube, with a dashpot of 3 N s/m"


def test_matrices_that_follow_friction_are_solved_by_the_solver_named(tmp_path: Path) -> None:
    exported = st.export(beams().with_({"contacts.A.stiffness": 1e7}), tmp_path)
    assert exported.case is not None
    assert without_effect(st.load(exported.case), "modes", solver="superlu") == []
