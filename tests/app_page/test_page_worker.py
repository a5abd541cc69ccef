"""The process of a page: the newest question wins, nothing queues, and it ends with whoever has it."""

from __future__ import annotations

import ctypes
import os
import queue
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from stridor.app.page.session import Session
from stridor.app.page.state import Source
from stridor.app.page.worker import PATIENCE, Program, Worker

HERE = Path(__file__).parent
PATIENT = 60.0  # seconds for what takes one, on a busy machine


@contextmanager
def working(function: str) -> Generator[tuple[Worker, queue.Queue[tuple[int, str, Any]]]]:
    """A worker and what is heard of it."""
    heard: queue.Queue[tuple[int, str, Any]] = queue.Queue()
    worker = Worker(lambda *said: heard.put(said), Program("page_programs", function))
    try:
        yield worker, heard
    finally:
        worker.close()


def until(heard: queue.Queue[tuple[int, str, Any]], part: str, number: int) -> list[tuple[int, str, Any]]:
    """What is heard up to a part of the answer to a question."""
    found: list[tuple[int, str, Any]] = []
    while not found or found[-1][:2] != (number, part):
        found.append(heard.get(timeout=PATIENT))
    return found


def gone(pid: int) -> bool:
    for _ in range(200):
        try:
            os.kill(pid, 0)
            stat = Path(f"/proc/{pid}/stat")
            if stat.exists() and stat.read_text().split(")")[1].split()[0] == "Z":
                return True  # dead, and only not taken note of
        except (ProcessLookupError, FileNotFoundError):  # it may go between two looks
            return True
        time.sleep(0.05)
    return False


def test_two_hundred_questions_in_a_row_make_no_queue():
    with working("counting") as (worker, heard):
        number = worker.ask(0.01)
        until(heard, "done", number)
        for _ in range(200):
            number = worker.ask(0.05)
            time.sleep(0.005)
        found = until(heard, "done", number)
        begun = [n for n, part, _ in found if part == "begun"]
        assert number == 201
        assert begun[-1] == 201  # the newest is answered
        assert len(begun) < 60  # in 1 s of questions, 0.05 s each
        time.sleep(0.2)
        assert heard.empty()


def test_what_takes_long_is_given_up_for_a_newer_question():
    with working("counting") as (worker, heard):
        first = worker.ask(100.0)
        until(heard, "begun", first)
        started = time.monotonic()
        second = worker.ask(0.0)
        found = until(heard, "done", second)
        assert time.monotonic() - started < PATIENCE + 5.0
        assert (first, "answer", 100.0) not in found


def test_what_is_being_sent_is_sent_whole():
    with working("careful") as (worker, heard):
        first = worker.ask("much")
        until(heard, "block", first)
        time.sleep(PATIENCE + 0.1)
        last = worker.ask("last")
        found = until(heard, "done", last)
        assert all(len(content) == 300_000 for _, part, content in found if part == "block")


def test_a_process_that_dies_is_told_of_and_replaced():
    with working("counting") as (worker, heard):
        number = worker.ask("die")
        said = until(heard, "failed", number)[-1][2]
        assert said == "the process that computes for this page has died; the next change starts another one"
        until(heard, "done", worker.ask(0.0))


def test_it_has_one_thread_and_ends_when_it_is_closed():
    with working("threads") as (worker, heard):
        number = worker.ask(None)
        threads, pid = until(heard, "answer", number)[-1][2]
        assert threads == "1"
        assert pid != os.getpid()
        time.sleep(0.3)  # nothing more to be heard: the page's end of the pipe is being read while it is closed
        worker.close()
        assert gone(pid)


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_it_ends_with_whoever_has_it_whatever_it_is_at(number: signal.Signals):
    script = f"""
        import sys, time
        sys.path.insert(0, {str(HERE)!r})
        from stridor.app.page.worker import Program, Worker
        worker = Worker(lambda *said: print(worker.process.pid, flush=True), Program("page_programs", "counting"))
        worker.ask(1000.0)
        time.sleep(1000)
    """
    parent = subprocess.Popen([sys.executable, "-c", textwrap.dedent(script)], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    pid = int(parent.stdout.readline())
    parent.send_signal(number)
    parent.wait(PATIENT)
    parent.stdout.close()
    assert gone(pid)


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_ctrl_c_is_none_of_its_business():
    with working("counting") as (worker, heard):
        number = worker.ask(0.5)
        until(heard, "begun", number)
        os.kill(worker.process.pid, signal.SIGINT)
        assert until(heard, "done", number)


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None) if os.name == "posix" else None, "malloc_trim"), reason="no glibc")
def test_what_an_answer_used_is_given_back():
    with working("spending") as (worker, heard):
        before, after = (
            next(c for _, part, c in until(heard, "done", worker.ask(200.0)) if part == "resident") for _ in range(2)
        )
    assert after - before < 50.0  # of 200 MB


def test_an_import_is_not_left_halfway():
    with working("importing") as (worker, heard):
        first = worker.ask(None)
        until(heard, "begun", first)
        time.sleep(0.2)
        second = worker.ask(None)
        assert until(heard, "answer", second)[-1][2] == 1  # begun once, and not again


def test_numbers_that_are_put_together_are_one_step_for_undo():
    session = Session(Source.template("two-beams"), {}, lambda call, *given: call(*given), program=Program("page_programs", "threads"))
    first, both = session.state, {"mu": 0.3, "contacts.A.stiffness": 2e10}
    try:
        session.put(both)
        assert (session.state.mu, session.state.changes) == (0.3, {"contacts.A.stiffness": 2e10})
        session.put({"mu": 0.4, "contacts.A.stiffness": 3e10})  # another click: another step
        session.undo()
        assert (session.state.mu, session.state.changes) == (0.3, {"contacts.A.stiffness": 2e10})
        session.undo()
        assert session.state == first
        assert not session.history.can_undo
        for mu in (0.5, 0.6, 0.7):  # arrows in a row
            session.put(both | {"mu": mu}, moving="map")
        session.undo()
        assert session.state == first
    finally:
        session.close()
        session.end()


def test_the_folder_of_a_page_goes_when_nobody_writes_into_it_any_more(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("stridor.app.page.worker.END", 0.3)
    session = Session(Source.template("two-beams"), {}, lambda call, *given: call(*given), program=Program("page_programs", "lingering"))
    inside = session.folder / "inside"
    session._worker.ask(inside)
    for _ in range(int(PATIENT / 0.05)):
        if (inside / "part").exists():
            break
        time.sleep(0.05)
    session.close()
    session.end()
    assert session._worker.process.exitcode is not None
    assert not session.folder.exists()
