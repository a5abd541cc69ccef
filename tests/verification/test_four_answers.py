"""Onset, growth, limit cycle and run at one μ: what two of them say is held against one another, and no more."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stridor as st
from marching import block_on_belt
from mode_coupling import mode_coupling
from program import stridor
from stridor.agreement import GOOD_AMPLITUDE, Agreement, SettledVelocity
from stridor.agreement.four_answers import FourAnswers, four_answers, with_answers
from stridor.laws import StaticKinetic
from stridor.temporal.signals import line_frequency

pytestmark = pytest.mark.verification

MU = 1.4  # stick, reversal and separation
IMPLICIT: dict[str, Any] = {"temporal.stepper": "implicit", "temporal.step": 5e-3, "temporal.record_every": 2}


def stick_slip(**changes: Any) -> st.Case:
    """Hoffmann's minimal model on a slow belt, from a touch beside steady sliding to long behind its growth."""
    made = {
        "phases": [{"name": "slide", "duration": 420.0}], "temporal.perturbation": 0.01,
        "modal.friction_range": [0.1, 1.8],
    }  # fmt: skip
    return mode_coupling(0.02, 0.1).with_(made | changes)


@pytest.fixture(scope="module")
def compared() -> Agreement:
    return st.compare(stick_slip(**IMPLICIT), [0.5, MU], critical=False, cycles=True)


@pytest.fixture(scope="module")
def answer(compared: Agreement) -> FourAnswers:
    return compared.answers[1]


def test_cycle_and_run_agree(compared: Agreement, answer: FourAnswers):
    """Steps of 5e-3 are 1e-4 off in frequency; where nothing swings nothing is said to agree."""
    assert answer.onset is not None
    assert answer.onset.mu == pytest.approx(0.7506, abs=1e-6)
    assert answer.comparison.modal_eigenvalue.real == pytest.approx(0.311, abs=1e-3)
    assert answer.agrees is True
    assert abs(answer.frequency_error or 1.0) < 3e-4
    assert abs(answer.amplitude_error or 1.0) < 2e-3
    assert answer.verdict.startswith("agree: μ = 1.4: the run swings at 0.2007")
    still = compared.answers[0]
    assert still.silent
    assert (still.cycles, still.run, still.agrees) == ((), None, None)
    assert still.verdict == "not decided: μ = 0.5: no cycle was found, and the run has not saturated"
    assert compared.agree
    assert "μ = 0.5: no cycle" not in compared.verdict


@pytest.mark.parametrize("mu", [0.3, 0.9])
def test_a_run_that_comes_to_rest_is_compared_like_any_other(mu: float):
    """Stable, until the last of the motion is rounding; and beyond the onset on a belt that stops."""
    phases: list[dict[str, Any]] = [{"name": "slide", "duration": 1500.0 if mu == 0.3 else 60.0}]
    phases += [] if mu == 0.3 else [{"name": "stop", "duration": 520.0, "velocities": {"belt": 0.0}}]
    changes = {"temporal.stepper": "explicit", "temporal.step": 0.05, "temporal.perturbation": 0.01}
    case = mode_coupling(0.1 if mu == 0.3 else 0.3, 0.1).with_(changes | {"phases": phases})
    (row,) = st.compare(case, [mu], critical=False).comparisons
    assert row.settled is None
    assert row.unsettled in ("the run has come to rest", "the run is too short to tell whether it has saturated")


def test_what_was_compared_is_kept_where_cycles_cannot_be_sought(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    case = stick_slip(**IMPLICIT | {"phases": [{"name": "slide", "duration": 20.0}]})

    def fails(*_: object, **__: object) -> None:
        raise st.AnalysisError("no such luck")

    def stops(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("stridor.study.comparison.find_cycles", fails)
    found = st.compare(case, [0.5], critical=False, cycles=True)
    assert len(found.comparisons) == len(found.answers) == 1
    assert not found.agree
    assert "cycles were not sought to the end: no such luck" in found.verdict
    data = st.open(st.save(found, tmp_path / "compare.nc"))
    assert json.loads(data.attrs["answers"]) == [answer.to_json() for answer in found.answers]
    monkeypatch.setattr("stridor.study.comparison._onset", stops)
    again = st.compare(case, [0.5], critical=False, cycles=True)
    assert (len(again.comparisons), again.answers, again.interrupted) == (1, (), True)


@pytest.mark.slow
def test_an_explicit_run_comes_to_the_cycle():
    """Period 1e-5, amplitude 1e-4."""
    steps = {"temporal.stepper": "explicit", "temporal.step": 4e-4, "temporal.record_every": 20}
    (answer,) = st.compare(stick_slip(**steps), [MU], critical=False, cycles=True).answers
    assert abs(answer.frequency_error or 1.0) < 1e-5
    assert abs(answer.amplitude_error or 1.0) < 1e-4


def test_the_frequency_of_a_line_is_found_beside_others():
    """Of three harmonics, the second the strongest, from a guess half a bin off."""
    sampling = 0.01
    time = np.arange(20000) * sampling
    signal = sum(a * np.cos(2 * np.pi * k * 0.7123 * time + k) for k, a in ((1, 0.6), (2, 1.0), (3, 0.3))) + 5.0
    assert line_frequency(signal, sampling, 2 * 0.7123 + 0.0025) == pytest.approx(2 * 0.7123, rel=1e-7)


def test_what_differs_is_not_said_to_agree(answer: FourAnswers):
    """Another cycle, another amplitude, and all that is missing."""
    case = stick_slip()
    here, onset = answer.comparison, answer.onset
    (cycle,) = (c for c in st.cycles(case, MU).cycles if c.stable)
    assert four_answers(here, onset, [cycle], 1.0).agrees is True
    other = st.cycles(case, 1.2).cycles
    assert four_answers(here, onset, other, 1.0).verdict.startswith("disagree: μ = 1.4: the run swings at ")
    run = here.settled
    assert isinstance(run, SettledVelocity)

    def said(cycles: Any = (cycle,), why: str = "", **changed: Any) -> tuple[bool | None, str]:
        found = four_answers(replace(here, **changed), onset, cycles, 1.0, why)
        assert found.verdict.startswith({True: "agree: ", False: "disagree: ", None: "not decided: "}[found.agrees])
        return found.agrees, found.verdict.split(": μ = 1.4: ")[1]

    louder = replace(run, amplitude=(1 + 1.1 * GOOD_AMPLITUDE) * run.amplitude)
    assert said(settled=louder)[0] is False
    assert said(settled=replace(run, amplitude=(1 + 0.9 * GOOD_AMPLITUDE) * run.amplitude))[0] is True
    assert said(settled=replace(run, frequency_hz=1.012 * run.frequency_hz))[0] is False
    uneven = said(settled=replace(run, spread=0.1))
    assert uneven == (None, "the amplitude of the run differs by 10 % within its last quarter, so that it is on no cycle")
    assert said(settled=None, unsettled="the run has not saturated") == (None, "the run has not saturated")
    assert said(settled=None) == (None, "there is no full run")
    assert said(()) == (None, "no cycle was found")
    assert said((), "cycles were not sought: it has no contact") == (None, "cycles were not sought: it has no contact")
    unstable = replace(cycle, multipliers=2.0 + 0.0 * cycle.multipliers)
    assert said((unstable,)) == (None, "the cycles found are unstable")
    # Of two that a run may come to it is the nearer one.
    assert said((replace(cycle, period=2.0 * cycle.period), cycle))[0] is True
    elsewhere = replace(cycle, watch_names=("n",))
    assert said((elsewhere,)) == (None, "the cycle has no such point")
    unsure = replace(cycle, multipliers=1.0 + 0.0 * cycle.multipliers)
    assert "whose stability is not decided" in said((unsure,))[1]


def test_all_agree_only_where_each_does(compared: Agreement, answer: FourAnswers):
    before = replace(compared, answers=(), verdict="agree: all of it")
    off, open_ = replace(answer, agrees=False), replace(answer, agrees=None)
    for answers, word in (([answer], "agree"), ([answer, open_], "not decided"), ([open_, off], "disagree")):
        assert with_answers(before, answers).verdict.startswith(f"{word}: all of it; cycle and run, agree: μ = 1.4: ")
    assert with_answers(replace(before, verdict="disagree: here"), [answer]).agree is False
    assert with_answers(replace(before, verdict="not decided: here"), [answer]).agree is None
    stopped = with_answers(replace(before, interrupted=True), [])
    assert stopped.agree is None
    assert stopped.verdict.endswith("interrupted before all was compared")


def test_a_contact_or_speeds_that_are_others_in_time_are_told():
    """A contact that is rigid in the run alone, and a run that ends on another speed."""
    for changed, why in (
        ({"temporal.contact": "rigid"}, "contact in time is another than theirs (temporal.contact)"),
        ({"phases": [{"name": "slow", "duration": 20.0, "loads": {"press": 0.5}}]}, "the run ends with others (press)"),
    ):
        found = st.compare(stick_slip(**(IMPLICIT | changed)), [MU], critical=False, cycles=True)
        assert why in found.answers[0].verdict
        assert found.agree is not True


def test_cycles_need_a_run():
    with pytest.raises(st.CaseError, match="cycles are held against full runs"):
        st.compare(stick_slip(), [MU], only=["growth"], cycles=True)


def test_table_rows_and_document(compared: Agreement, tmp_path: Path):
    """On a page of 80 columns, as a CSV row, in the document; without the option there is nothing of it."""
    short = IMPLICIT | {"phases": [{"name": "slide", "duration": 30.0}]}
    (tmp_path / "case.toml").write_text(st.Case.to_toml(stick_slip(**short)), encoding="utf-8")
    done = stridor("compare", "case.toml", "--mu", "1.4", "--no-critical", "--cycles", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "onset, growth, cycle, run" in done.stdout
    assert max(len(line) for line in done.stdout.splitlines()) <= 80
    assert "0.200759" in done.stdout
    (written,) = tmp_path.rglob("compare.csv")
    with written.open(encoding="utf-8") as stream:
        (row,) = csv.DictReader(stream)
    assert float(row["cycle_frequency_hz"]) == pytest.approx(0.200759, abs=1e-6)
    assert row["run_line_hz"] == ""
    assert row["cycle_agrees"] == ""
    heads, rows = compared.table()
    assert len(heads) == len(set(heads)) == len(rows[1])
    document = compared.to_json()
    assert document["answers"][1]["cycle"]["method"] == "shooting"
    assert document["answers"][1]["run"]["point"] == "m"
    without = replace(compared, answers=())
    assert "answers" not in without.to_json()
    assert without.table()[0][-1] == "verdict"


def test_a_run_beside_stable_sliding_has_settled_to_its_cycle():
    """Stick–slip from a start far off, where every mode decays: two states at one friction."""
    system = block_on_belt(law=StaticKinetic(0.25, 0.45), speed=0.3, stiffness=5.0, mass=2.0, damping=0.15, press=3.0)
    case = st.Case(
        units="nondimensional",
        bodies={
            "m": {"type": "mass", "mass": 2.0, "position": (0, 0), "initial_velocity": (0.5, 0.0)},
            "belt": {
                "type": "obstacle", "shape": "flat", "point": (0, 0), "normal": (0, 1), "sliding": {"velocity": (0.3, 0)}
            },
        },
        springs={"k": {"between": ("m", "ground"), "direction": (1, 0), "stiffness": 5.0}},
        dashpots={"c": {"between": ("m", "ground"), "direction": (1, 0), "damping": 0.15}},
        loads={"press": {"at": "m", "force": (0, -3)}},
        contacts={
            "rub": {
                "slave": "m", "master": "belt", "stiffness": "rigid",
                "friction": {"law": "static-kinetic", "coefficient": 0.25, "static_coefficient": 0.45},
            }
        },
        modal={"max_frequency_hz": 2.0},
        phases=[{"name": "slide", "duration": 400.0}],
        temporal={"stepper": "exact", "step": 0.01, "record_every": 5, "watch": ["m"]},
    )  # fmt: skip
    (answer,) = st.compare(case, 0.25, critical=False, cycles=True).answers
    (cycle,) = st.cycles(system, 0.25, push=0.5).cycles
    assert answer.comparison.modal_eigenvalue.real < 0.0
    assert answer.comparison.settled is not None
    assert answer.comparison.settled.frequency_hz == pytest.approx(cycle.frequency_hz, rel=1e-6)
    assert answer.agrees is True
