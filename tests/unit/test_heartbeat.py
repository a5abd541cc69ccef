"""What a verb is at is told while it is silent, and never where something else is printed."""

from __future__ import annotations

import json
import logging
import time
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import stridor
import stridor as st
from mode_coupling import mode_coupling
from stridor.app import heartbeat, output
from stridor.app.cli import app
from stridor.app.heartbeat import ERASED, Heartbeat, beating, hush, silent
from stridor.errors import CaseError
from stridor.modal import dense_problem
from stridor.stages import Stage, _listeners, heard, passing, stage

TEMPLATE = Path(stridor.__file__).parent / "case" / "templates" / "two-beams.toml"


@pytest.fixture(autouse=True)
def fast(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, seconds in (("PATIENCE", 0.02), ("BETWEEN_LINES", 0.05), ("REDRAWN", 0.01)):
        monkeypatch.setattr(heartbeat, name, seconds)


def test_lines_in_a_log_say_stage_and_time(capsys: pytest.CaptureFixture[str]) -> None:
    with beating(quiet=False, terminal=False, width=80):
        time.sleep(0.1)  # nothing has begun: nothing is said
        stage("steady sliding at μ = 0.3")
        began = time.monotonic()
        time.sleep(0.2)
    told_for = time.monotonic() - began  # longer than 0.2 s where others keep the machine busy
    said = capsys.readouterr()
    assert said.out == ""
    lines = said.err.splitlines()
    assert 2 <= len(lines) <= 1 + told_for / heartbeat.BETWEEN_LINES
    assert all(line.endswith("s: steady sliding at μ = 0.3, for 0 s") for line in lines)
    assert not _listeners


def test_a_terminal_has_one_line_that_is_taken_back(capsys: pytest.CaptureFixture[str]) -> None:
    before, until = "", time.monotonic() + 30.0
    with beating(quiet=False, terminal=True, width=30):
        stage("modes without friction of a structure")
        while ERASED not in before and time.monotonic() < until:  # however busy the machine is
            time.sleep(0.01)
            before += capsys.readouterr().err
        output.stdout.print("result")
        time.sleep(0.1)  # printed: no word until the next stage
    said = capsys.readouterr()
    assert said.out == "result\n"
    drawn = (before + said.err).split(ERASED)
    assert said.err.endswith(ERASED)
    assert set(drawn[1:-1]) == {"0 s: modes without friction o"}  # never beyond the edge


@pytest.mark.parametrize("inner", ["quiet", "bar", "hushed"])
def test_nothing_where_it_would_disturb(inner: str, capsys: pytest.CaptureFixture[str]) -> None:
    with beating(quiet=inner == "quiet", terminal=False, width=80):
        if inner == "bar":
            with silent():
                stage("time loop")
                time.sleep(0.15)
        else:
            stage("time loop")
            hush()
            time.sleep(0.15)
    assert capsys.readouterr().err == ""


def test_an_error_ends_it_and_a_closed_stderr_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails() -> None:
        with beating(quiet=False, terminal=True, width=80):
            stage("assembling")
            raise ValueError("model")

    with pytest.raises(ValueError, match="model"):
        fails()
    assert not _listeners
    assert not heartbeat._beating

    class Closed:
        def write(self, text: str) -> None:
            raise BrokenPipeError

    monkeypatch.setattr("sys.stderr", Closed())
    beat = Heartbeat(terminal=False)
    beat.at(Stage("assembling", time.monotonic()))
    beat._thread.join(timeout=5)
    assert not beat._thread.is_alive()
    beat.end()


def test_stages_go_to_listeners_and_to_the_log(caplog: pytest.LogCaptureFixture) -> None:
    found: list[str] = []
    with caplog.at_level(logging.DEBUG, logger="stridor"):
        with heard(lambda now: found.append("" if now is None else now.what)):
            stage("one")
            stage("often", logged=False)
        stage("two")
    assert found == ["one", "often"]
    assert [r.getMessage() for r in caplog.records] == ["one", "two"]


def test_a_stage_ends_with_the_function_that_named_it(caplog: pytest.LogCaptureFixture) -> None:
    heard_of: list[Stage | None] = []

    @passing()
    def sliding() -> float:
        stage("steady sliding")
        stage("steady sliding once more")
        return 1.0

    @passing()
    def fails() -> None:
        stage("modes")
        sliding()
        raise ValueError("model")

    with caplog.at_level(logging.DEBUG, logger="stridor"), heard(heard_of.append):
        assert sliding() == 1.0
        with pytest.raises(ValueError, match="model"):
            fails()
    told = ["" if now is None else now.what for now in heard_of]
    both = ["steady sliding", "steady sliding once more"]
    assert told == [*both, "", "modes", *both, "modes", ""]
    assert heard_of[6] is heard_of[3]  # it goes on: since when it has been under way, too
    assert [r.getMessage() for r in caplog.records] == [*both, "modes", *both]  # the end of one is no line of a log


def test_between_stages_the_verb_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    with beating(quiet=False, terminal=False, width=80, verb="modes"):
        with passing():
            stage("steady sliding")
            time.sleep(0.08)
        time.sleep(0.12)
    lines = [line.partition(": ")[2] for line in capsys.readouterr().err.splitlines()]
    assert lines[0] == "steady sliding, for 0 s"
    assert lines[-1] == "modes, for 0 s"


def test_dense_problems_are_named_when_they_take_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[str] = []
    monkeypatch.setattr(dense_problem, "LONG", 20)
    with heard(lambda now: found.append("" if now is None else now.what)):
        for size in (5, 12):
            dense_problem.eigenvalues(np.eye(size), 0.1 * np.eye(size), np.diag(np.arange(1.0, size + 1)), 1.0)
    assert found == ["all eigenvalues of a dense matrix of 24 rows", ""]


def test_verbose_says_what_was_chosen_and_stages_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    log = logging.getLogger("stridor")
    monkeypatch.setattr(log, "handlers", [])
    monkeypatch.setattr(log, "level", log.level)
    monkeypatch.setattr(output, "stderr", output._Screen(stderr=True, soft_wrap=True, highlight=False))
    words = ["modes", str(TEMPLATE), "--mu", "0.2", "--json", "--verbose", "--out", str(tmp_path)]
    found = CliRunner().invoke(app, words, catch_exceptions=False)
    assert json.loads(found.stdout)["mu"] == [0.2]
    assert "info: source receptance, the fastest that takes " in found.stderr
    # Not those of the heartbeat, which say since when.
    assert sum(line.startswith("growing modes sought anew") for line in found.stderr.splitlines()) == 1
    handler = output.Log()
    for text in ("branches at 0.1", "branches at 0.2", "modes"):
        handler.emit(logging.LogRecord("stridor", logging.DEBUG, "", 0, text, None, None))
    assert capsys.readouterr().err.splitlines()[-2:] == ["branches at 0.1", "modes"]
    with pytest.raises(CaseError, match="--verbose: says what --quiet leaves out; take one of them"):
        CliRunner().invoke(app, [*words, "--quiet"], catch_exceptions=False)


def test_a_time_loop_says_how_far_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stridor.temporal.march.TOLD_SECONDS", 0.0)
    told: list[Stage] = []
    with heard(lambda now: told.append(now) if now is not None else None):
        st.simulate(mode_coupling(0.02, 0.1).with_({"phases.0.duration": 5.0, "temporal.stepper": "explicit"}))
    said = [now for now in told if now.what.startswith("time loop, ")]
    assert said[-1].what == "time loop, 100 of 100 steps"
    assert {now.began for now in said} == {next(n.began for n in told if n.what.startswith("time loop; "))}


def test_the_time_left_is_that_of_rows_without_what_comes_before_the_first(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Workers start and make the model for 90 s; then a row takes 0.5 s."""
    now = 1000.0
    monkeypatch.setattr(output.time, "monotonic", lambda: now)
    with output.counting("study", quiet=False) as progress:
        progress(200, 1000)  # those of an earlier run
        now += 90.0
        for done in range(201, 1001):
            progress(done, 1000)
            now += 0.5
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "study: 221 of 1000, about 6.5 min left"
    assert len(lines) == 39  # one every 10 s
    assert lines[-1] == "study: 981 of 1000, about 9.5 s left"
