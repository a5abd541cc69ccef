"""A workspace: what is computed for a case once, and the same analyses of a case, a system and a workspace."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stridor as st
from counted import Counts, count
from matrix_cases import rubbing
from stridor.case import template_text
from stridor.errors import CaseError
from stridor.modal import complex_modes, over_friction, receptance_modes
from stridor.system import build, uncoupled
from stridor.system.model import MOST_ANSWERS, AnswerCache
from stridor.system.uncoupled import uncoupled_modes
from stridor.view import report

COARSE = {
    "bodies.beam1.elements": 6,
    "bodies.beam2.elements": 12,
    "phases.press.duration": 1e-3,
    "phases.slide.duration": 1e-3,
    "temporal.step": None,
    "temporal.watch": ["beam1.tip"],
    "modal.max_frequency_hz": 12e3,
    "modal.sweep_points": 5,
    "comparison.critical": False,
    "reference": None,
}


@pytest.fixture(scope="module")
def case() -> st.Case:
    return st.loads(template_text("two-beams")).with_(COARSE)


def test_a_body_that_stays_as_it_is_is_solved_once(case: st.Case, monkeypatch: pytest.MonkeyPatch) -> None:
    uncoupled._solved_once.cache_clear()
    solved = count(monkeypatch, uncoupled._solve_block)
    angles = (84.0, 85.0, 86.0)
    found = [uncoupled_modes(build.build_system(case.with_({"bodies.beam1.angle_deg": angle}))) for angle in angles]
    assert len(solved) == 5  # the beam that is turned each time, and the other once, along its axis and across it
    moved = uncoupled_modes(build.build_system(case.with_({"bodies.beam1.start": [0.09, 0.0]})))
    assert len(solved) == 5
    for one, other in zip(moved.real, found[1].real, strict=True):  # at 85 degrees, as the case has it
        assert np.array_equal(one.freedoms, other.freedoms)
        assert one.vectors is other.vectors
    uncoupled._solved_once.cache_clear()
    anew = uncoupled_modes(build.build_system(case.with_({"bodies.beam1.angle_deg": 86.0})))
    for one, other in zip(found[2].real, anew.real, strict=True):  # to the last digit, whatever was solved before
        assert np.array_equal(one.vectors, other.vectors)
        assert np.array_equal(one.stiffness, other.stiffness)


def test_a_run_computes_each_thing_once_and_its_document_nothing(
    case: st.Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    counts = Counts(monkeypatch)
    # The report's figures are made, which may compute; files of them compute nothing.
    monkeypatch.setattr(report, "rendered", lambda *_: b"")
    monkeypatch.setattr(report, "lay_out", lambda _: None)
    outcome = st.run(case, tmp_path)
    counts.check()
    assert outcome.everything.agreement is not None
    searched = count(monkeypatch, receptance_modes.modes_by_receptance)
    document = outcome.to_json()
    assert not searched
    counts.check()
    # The document is the one that the verb prints.
    assert document["modes"] == st.modes(case).to_json()
    assert len(counts.built) == 2
    assert len(searched) == 1


def test_another_system_is_not_the_same_question(case: st.Case, monkeypatch: pytest.MonkeyPatch) -> None:
    system = st.build_system(case)
    solved = Counts(monkeypatch).bases
    held = uncoupled_modes(system)
    # Contacts are no part of these modes, whatever becomes of them; damping is.
    assert uncoupled_modes(replace(system, contacts=())) is held
    assert uncoupled_modes(system.with_friction(0.3, np.array([0.02]))) is held
    assert len(solved) == 1
    assert uncoupled_modes(system.undamped()) is not held
    assert uncoupled_modes(replace(system, stiffness=2 * system.stiffness)) is not held
    assert len(solved) == 3
    assert system.undamped() is system.undamped()
    assert system.touching(0.2) is system.touching(0.2)
    assert system.touching(0.2) is not system.touching(0.3)
    # What was known of one system is unknown to one made of it.
    assert replace(system).answers is not system.answers


def test_what_was_asked_is_not_computed_again(case: st.Case, monkeypatch: pytest.MonkeyPatch) -> None:
    work = st.Workspace(case)
    followed = count(monkeypatch, complex_modes.complex_modes)
    first = st.modes(work, 0.1, vectors=True)
    assert st.modes(work, 0.1).right is None
    right = st.modes(work, 0.1, vectors="right")
    assert right.left is None
    assert np.array_equal(right.right, first.right)
    assert np.array_equal(st.modes(work, 0.1, count=3).eigenvalues[0, :3], first.eigenvalues[0, :3])
    assert len(followed) == 1
    st.modes(work, 0.1, damped=False)
    st.modes(work, [0.1])
    st.modes(work, 0.2)
    st.modes(work, 0.1, max_frequency_hz=9e3)
    assert len(followed) == 5
    before = len(followed)
    st.onsets(work)
    searched = count(monkeypatch, over_friction._solved_onsets)
    st.onsets(work)
    assert not searched
    st.onsets(work, (0.0, 0.5))
    assert len(searched) == 1
    assert len(followed) == before


def test_modes_that_were_cut_short_are_not_kept(case: st.Case) -> None:
    work = st.Workspace(case)

    def stop(done: int, planned: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    assert len(st.modes(work, [0.0, 0.1, 0.2], progress=stop).mu) < 3
    assert len(st.modes(work, [0.0, 0.1, 0.2]).mu) == 3


def test_matrices_that_depend_on_friction_are_built_once_for_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    work = st.Workspace(rubbing(tmp_path, 1e5))
    built = count(monkeypatch, build.build_system)
    work = st.Workspace(work.case("this"))
    assert work.varies
    assert work.system(0.2) is work.system(0.2)
    assert work.system(0.2) is not work.system(0.3)
    st.steady_sliding(work, 0.2)
    assert [call[1] for call in built] == [0.2, 0.3]
    assert abs(work.system(0.3).stiffness - work.system(0.2).stiffness).max() == pytest.approx(1e4)


def test_a_case_a_system_and_a_workspace_give_the_same(case: st.Case) -> None:
    work = st.Workspace(case)
    tables = case.model_dump(mode="json", include={"modal", "temporal", "comparison", "phases"})
    alone = st.Workspace(st.build_system(case), **tables)
    one = st.modes(case, [0.0, 0.1])
    for other in (work, alone):
        assert np.array_equal(st.modes(other, [0.0, 0.1]).eigenvalues, one.eigenvalues)
        assert [o.mu for o in st.onsets(other).onsets] == [o.mu for o in st.onsets(case).onsets]
        assert np.array_equal(st.steady_sliding(other, 0.2).normal_force, st.steady_sliding(case, 0.2).normal_force)
        assert {n: b.labels for n, b in st.body_modes(other).items()} == {
            n: b.labels for n, b in st.body_modes(case).items()
        }
        hz = np.array([1e3, 2e3])
        assert np.array_equal(st.friction_curve(other, hz), st.friction_curve(case, hz))
        run = st.simulate(other)
        assert np.array_equal(run.normal_force, st.simulate(case).normal_force)
        assert st.summarise(other, run).to_json()["energy"] == st.summarise(case, run).to_json()["energy"]
        seen = st.compare(other, only=["growth"])
        assert seen.comparisons[0].perturbation.eigenvalue == pytest.approx(
            st.compare(case, only=["growth"]).comparisons[0].perturbation.eigenvalue, rel=1e-12
        )
        assert (st.pencil(other).stiffness != st.pencil(case).stiffness).nnz == 0
    assert alone.own_friction == work.own_friction == 0.1
    assert one.provenance["case"] == case.text
    assert st.modes(alone, 0.1).provenance["case"] == ""


def test_a_system_alone_has_the_settings_of_an_empty_case(case: st.Case) -> None:
    system = st.build_system(case)
    assert len(st.modes(system, 0.1).branch) <= 20
    assert st.onsets(system).friction_range == (0.0, 1.0)
    assert st.onsets(system).max_frequency_hz == 40e3
    run = st.simulate(st.Workspace(system, phases=[{"name": "press", "duration": 1e-4, "loads": {"press": 0.5}}]))
    assert [p.name for p in run.phases] == ["press"]
    assert run.provenance["case"] == ""


@pytest.mark.parametrize(
    ("call", "what"),
    [
        (st.describe, "describe"),
        (lambda system: st.sensitivities(system), "a sensitivity"),
        (lambda system: st.rank_countermeasures(system), "the ranking of countermeasures"),
        (lambda system: st.run(system, "nowhere"), "run"),
    ],
)
def test_what_cannot_do_without_a_case_says_so(case: st.Case, call, what: str) -> None:
    with pytest.raises(CaseError) as said:
        call(st.build_system(case))
    takes = "takes a Case, the path of its file or a Workspace of one, not a System alone"
    assert str(said.value) == f"case: missing – {what} {takes}"
    assert not Path("nowhere").exists()


def test_a_restart_needs_a_case(case: st.Case) -> None:
    with pytest.raises(CaseError, match="restart takes a Case"):
        st.simulate(st.build_system(case), restart=st.simulate(case))


def test_settings_of_a_system_are_checked_as_those_of_a_case(case: st.Case) -> None:
    system = st.build_system(case)
    with pytest.raises(CaseError, match=r"modal\.max_frequency_hz.*a number > 0"):
        st.Workspace(system, modal={"max_frequency_hz": -1.0})
    with pytest.raises(CaseError, match=r"modal\.max_frequency"):
        st.Workspace(system, modal={"max_frequency": 1.0})
    with pytest.raises(CaseError, match="modal: a table of the case"):
        st.Workspace(case, modal={})


def test_the_oldest_of_very_many_answers_is_forgotten() -> None:
    answers = AnswerCache()
    for asked in range(MOST_ANSWERS + 1):
        assert answers.once(asked, lambda asked=asked: -asked) == -asked
    assert answers.known(0) is None
    assert answers.known(1) == -1
    assert answers.once(1, lambda: 7) == -1


def test_components_of_whole_numbers_are_those_of_the_same_matrices() -> None:
    whole = st.System(np.eye(2, dtype=int), np.zeros((2, 2), dtype=int), np.array([[20, 4], [4, 15]]))
    same = st.System(np.eye(2), np.zeros((2, 2)), np.array([[20.0, 4.0], [4.0, 15.0]]))
    (mine,), (theirs,) = uncoupled_modes(whole).real, uncoupled_modes(same).real
    assert np.array_equal(mine.stiffness, theirs.stiffness)
    assert np.array_equal(mine.vectors, theirs.vectors)
