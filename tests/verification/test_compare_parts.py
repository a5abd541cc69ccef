"""Parts of a comparison: only those asked for, kept when they are there, shapes in time against modes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stridor as st
from rubbing_block import rubbing_block
from stridor.agreement import comparison as comparing
from stridor.agreement import critical as bisecting
from stridor.agreement import perturbation as perturbing
from stridor.agreement.result import Critical, judge, overall
from stridor.case import template_text
from stridor.io.kept_parts import KeptParts
from stridor.modal.complex_modes import complex_modes
from stridor.study.case_key import case_key
from stridor.study.settings import settings_of

pytestmark = pytest.mark.verification


@pytest.fixture(scope="module")
def case() -> st.Case:
    """The bench on coarse meshes and for a short time."""
    return st.loads(template_text("two-beams")).with_(
        {
            "bodies.beam1.elements": 8,
            "bodies.beam2.elements": 24,
            "contacts.A.stiffness": "rigid",
            "temporal.step": 2e-7,
            "temporal.record_every": 5,
            "phases.press.duration": 1e-3,
            "phases.slide.duration": 1e-3,
            "modal.max_frequency_hz": 20e3,
        }
    )


def refuse(*args: Any, **kwargs: Any) -> Any:
    raise AssertionError("this was not asked for")


class Memory:
    """Parts as a file keeps them: as text."""

    def __init__(self) -> None:
        self.texts: dict[tuple[str, float | None], str] = {}

    def get(self, part: str, mu: float | None) -> Mapping[str, Any] | None:
        text = self.texts.get((part, mu))
        return None if text is None else json.loads(text)

    def put(self, part: str, mu: float | None, data: Mapping[str, Any]) -> None:
        self.texts[part, mu] = json.dumps(data, allow_nan=False)


def test_without_critical_friction_no_onset_is_solved(case: st.Case, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bisecting, "onsets_of_band", refuse)
    result = st.compare(case, [0.05], critical=False, only=["growth"])
    assert result.critical_mu_modal is None
    assert result.agree is True
    assert st.compare(case, [0.05], critical=False).comparisons[0].agrees
    with pytest.raises(AssertionError, match="not asked for"):
        st.compare(case, [0.05], only=["critical"])


def test_finished_parts_are_not_computed_again(case: st.Case, monkeypatch: pytest.MonkeyPatch) -> None:
    memory = Memory()
    first = st.compare(case, [0.05, 0.1], critical=False, kept=memory)
    for name in ("perturb", "simulate", "operating_shape"):
        monkeypatch.setattr(comparing, name, refuse)
    again = st.compare(case, [0.05, 0.1], critical=False, kept=memory)
    assert again.verdict == first.verdict
    assert any(note.startswith("taken from an earlier call on the same case") for note in again.notes)
    for old, new in zip(first.comparisons, again.comparisons, strict=True):
        assert old.to_json() == new.to_json()
        assert np.array_equal(old.perturbation.signal, new.perturbation.signal)
        assert np.array_equal(old.perturbation.components.eigenvalues, new.perturbation.components.eigenvalues)
    with pytest.raises(AssertionError, match="not asked for"):
        st.compare(case, [0.12], critical=False, kept=memory)


def test_steps_of_the_bisection_are_kept_one_by_one(case: st.Case, monkeypatch: pytest.MonkeyPatch) -> None:
    memory, steps = Memory(), 0
    plain = bisecting.perturb

    def stopped(*args: Any, **kwargs: Any) -> Any:
        nonlocal steps
        steps += 1
        if steps > 3:
            raise KeyboardInterrupt
        return plain(*args, **kwargs)

    loose = case.with_({"comparison.tolerance": 0.01})
    monkeypatch.setattr(bisecting, "perturb", stopped)
    cut = st.compare(loose, only=["critical"], kept=memory)
    assert cut.interrupted
    assert cut.agree is None
    assert len([part for part, _ in memory.texts if part == "critical step"]) == 3
    steps = 0
    done = st.compare(loose, only=["critical"], kept=memory)
    assert steps <= 3
    assert done.agree
    assert done.verdict == st.compare(loose, only=["critical"], kept=memory).verdict


def test_an_interrupt_leaves_the_rows_that_are_finished(case: st.Case, monkeypatch: pytest.MonkeyPatch) -> None:
    memory = Memory()
    plain = perturbing.simulate
    calls = 0

    def cut_second(*args: Any, **kwargs: Any) -> Any:
        # As Ctrl-C does: the march ends early and says so.
        nonlocal calls
        calls += 1
        return replace(plain(*args, **kwargs), interrupted=calls == 2)

    monkeypatch.setattr(perturbing, "simulate", cut_second)
    seen: list[float] = []
    result = st.compare(
        case, [0.05, 0.1, 0.12], only=["growth"], kept=memory, finished=lambda c: seen.append(c.mu)
    )
    assert result.interrupted
    assert [c.mu for c in result.comparisons] == seen == [0.05]
    assert list(memory.texts) == [("growth", 0.05)]
    assert result.verdict.startswith("not decided: ")
    assert result.verdict.endswith("interrupted before all was compared")


def test_a_file_of_parts_survives_cuts_and_other_cases(case: st.Case, tmp_path: Path) -> None:
    path = tmp_path / "out" / "compare.jsonl"
    ours = KeptParts(path, case_key(case))
    ours.put("growth", 0.1, {"a": 1.5})
    ours.put("growth", 0.2, {"a": 2.5})
    ours.put("run", 0.2, {"a": float("nan")})  # nothing to build on
    KeptParts(path, case_key(case.with_({"contacts.A.stiffness": 1e9}))).put("growth", 0.1, {"a": 9.0})
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("2.5", "2.6") + text.splitlines()[0][:40], encoding="utf-8")
    again = KeptParts(path, case_key(case))
    assert again.get("growth", 0.1) == {"a": 1.5}
    assert again.get("growth", 0.2) is None
    assert (again.others, again.damaged) == (1, 2)
    again.put("growth", 0.3, {"a": 3.5})
    assert KeptParts(path, case_key(case)).get("growth", 0.3) == {"a": 3.5}


@pytest.mark.parametrize(
    ("change", "same"),
    [
        ({"title": "another"}, True),
        ({"comparison.mu": [0.3]}, True),
        ({"contacts.A.friction.coefficient": 0.11}, False),
        ({"modal.max_frequency_hz": 21e3}, False),
        ({"temporal.beta2": 0.6}, False),
        ({"phases.slide.duration": 2e-3}, False),
    ],
)
def test_parts_are_never_taken_from_another_case(case: st.Case, change: dict[str, Any], same: bool) -> None:
    assert (case_key(case.with_(change)) == case_key(case)) is same


def test_a_mesh_file_that_changes_is_another_case(tmp_path: Path) -> None:
    (tmp_path / "m.mtx").write_text("%%MatrixMarket matrix coordinate real symmetric\n1 1 1\n1 1 1.0\n", encoding="utf-8")
    text = '[[matrices]]\nfile = "m.mtx"\nrole = "mass"\n[[matrices]]\nfile = "m.mtx"\nrole = "stiffness"\n'
    before = case_key(st.loads(text, folder=tmp_path))
    (tmp_path / "m.mtx").write_text("%%MatrixMarket matrix coordinate real symmetric\n1 1 1\n1 1 2.0\n", encoding="utf-8")
    assert case_key(st.loads(text, folder=tmp_path)) != before


def test_what_grows_in_time_has_the_shape_of_its_mode_and_of_no_other(case: st.Case) -> None:
    system = st.build_system(case)
    seen = perturbing.perturb(system, 0.1, settings=settings_of(case), max_frequency_hz=20e3, shape=True)
    modes = complex_modes(system, 0.1, max_frequency_hz=20.4e3, vectors=True)
    assert seen.shape is not None
    assert modes.right is not None
    alike = np.array([seen.shape.likeness(vector) for vector in modes.right[0]])
    own = int(np.argmin(np.abs(modes.eigenvalues[0] - seen.eigenvalue)))
    assert alike[own] > 0.999
    assert np.delete(alike, own).max() < 0.5


def test_shapes_of_solids_in_time_are_those_of_their_modes() -> None:
    model = st.loads(rubbing_block("max_frequency_hz = 30e3"))
    system = st.build_system(model)
    limit = model.modal.max_frequency_hz
    result = st.compare(model, [0.3], only=["growth"])
    alike = result.comparisons[0].growth_mac
    assert alike is not None
    assert alike > 0.99
    seen = perturbing.perturb(system, 0.3, settings=settings_of(model), max_frequency_hz=limit, shape=True)
    modes = complex_modes(system, 0.3, max_frequency_hz=1.02 * limit, vectors="right")
    assert seen.shape is not None
    assert modes.right is not None
    others = [seen.shape.likeness(vector) for vector in modes.right[0]]
    assert sorted(others)[-2] < 0.6


def test_nothing_compared_is_no_agreement() -> None:
    assert overall([], Critical(), interrupted=False) == "not decided: nothing was compared"
    assert overall([], Critical(why="no bracket"), interrupted=False) == "not decided: no bracket"
    assert overall([], Critical(0.2, 0.2, agrees=True), interrupted=False).startswith("agree: ")
    assert overall([], Critical(0.2, 0.2, agrees=True), interrupted=True).startswith("not decided: ")
    assert overall([], Critical(0.2, agrees=False, why="w"), interrupted=True) == (
        "disagree: critical μ: w; interrupted before all was compared"
    )


def test_a_signal_that_shows_nothing_is_not_called_stable(case: st.Case) -> None:
    system = st.build_system(case)
    seen = perturbing.perturb(system, 0.05, settings=settings_of(case), max_frequency_hz=20e3, duration=2e-5)
    assert seen.eigenvalue == 0
    agrees, verdict = judge(0.05, False, -25 + 600j, seen, 1.0, 1.0)
    assert agrees is None
    assert verdict == "μ = 0.05: modal says stable, but the signal in time shows no vibration to compare with"
    nan = replace(seen, eigenvalue=10 + 600j, signal=np.zeros(0))
    assert judge(0.05, True, 10 + 600j, nan, float("nan"), 0.0)[0] is False
