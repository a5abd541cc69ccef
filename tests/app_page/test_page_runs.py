"""Runs in processes of their own, as the page starts them."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from scipy.io import wavfile

import stridor as st
from benches import paper_case
from stridor.app.page.running import sound_of_file
from stridor.app.page.runs import Queue, Run, Wish
from stridor.studies.processes import forked

SHORT = {
    "bodies.beam1.elements": 4, "bodies.beam2.elements": 8, "temporal.step": 2e-7, "temporal.record_every": 5,
    "phases.press.duration": 2e-4, "phases.slide.duration": 2e-3,
}  # fmt: skip
ENDLESS = SHORT | {"phases.slide.duration": 500.0, "temporal.record_every": 5000}
PATIENCE = 240.0  # kernels may have to be compiled first, beside others


class Told:
    """What a run has said, and waiting for more of it."""

    def __init__(self) -> None:
        self.parts: list[tuple[str, Any]] = []
        self._news = threading.Condition()

    def __call__(self, part: str, content: Any) -> None:
        with self._news:
            self.parts.append((part, content))
            self._news.notify_all()

    def wait(self, *names: str, after: int = 0) -> Any:
        """Content of the first such part."""
        until = time.monotonic() + PATIENCE
        with self._news:
            while True:
                for part, content in self.parts[after:]:
                    if part in names:
                        return content
                assert self._news.wait(until - time.monotonic()), f"never heard {names}: {[p for p, _ in self.parts]}"

    @property
    def names(self) -> list[str]:
        return [part for part, _ in self.parts]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., tuple[Run, Told]]]:
    runs: list[Run] = []

    def started(changes: dict[str, Any], queue: Queue | None = None, text: str | None = None) -> tuple[Run, Told]:
        told = Told()
        folder = tmp_path / str(len(runs))
        folder.mkdir()
        case = text or paper_case().with_(changes).to_toml()
        runs.append(Run(Wish(case, None, str(folder)), told, queue or Queue(1)))
        return runs[-1], told

    yield started
    for run in runs:
        run.close()


def gone(process: Any) -> bool:
    """Whether a process ends within a few seconds."""
    until = time.monotonic() + 10
    while process.is_alive() and time.monotonic() < until:
        time.sleep(0.02)
    return not process.is_alive()



def test_what_has_not_begun_to_listen_is_stopped_at_once(start: Callable[..., tuple[Run, Told]]) -> None:
    """A process that is being made takes seconds, on a busy computer many."""
    run, told = start(ENDLESS)
    told.wait("begun")
    asked = time.monotonic()
    run.stop()
    assert told.wait("stopped") == {"sentence": "stopped before anything was computed", "file": None}
    assert time.monotonic() - asked < 0.5
    assert run.over
    assert gone(run.process)
    assert told.names == ["begun", "stopped"]

def test_a_run_from_its_wish_to_its_end(start) -> None:
    run, told = start(SHORT)
    end = told.wait("done")
    assert "dominates" in end["sentence"] or "last phase" in end["sentence"]
    same = st.simulate(paper_case().with_(SHORT))
    found = st.open(end["file"])
    assert found.steps == same.steps
    assert (found.normal_force == same.normal_force).all()
    picture = [content for part, content in told.parts if part == "picture"][-1]
    assert picture["done"] == picture["planned"] == same.steps
    json.dumps(picture, allow_nan=False)
    assert told.names[0] == "begun"
    assert told.names[-1] == "done"
    assert gone(run.process)
    kind, sound = sound_of_file(end["file"], 2.0)
    assert kind == "sound"
    rate, samples = wavfile.read(io.BytesIO(sound["wav"]))
    assert len(samples) / rate == pytest.approx(2 * 2e-3, rel=0.05)


def test_stopped_runs_keep_what_they_have(start) -> None:
    run, told = start(ENDLESS)
    first = told.wait("picture")
    assert 0 < first["done"] < first["planned"]
    before = len(told.parts)
    run.listen(1.0)
    assert told.wait("sound", "silent", after=before)
    run.stop()
    end = told.wait("stopped")
    assert st.open(end["file"]).interrupted
    assert "stopped after" in end["sentence"]
    assert gone(run.process)


def test_a_closed_page_ends_its_run(start) -> None:
    run, told = start(ENDLESS)
    told.wait("progress")
    heard = len(told.parts)
    run.close()
    assert gone(run.process)
    assert len(told.parts) <= heard + 1


def test_a_run_that_is_on_its_way_when_its_page_closes_is_waited_for(monkeypatch, tmp_path: Path) -> None:
    begun, go_on = threading.Event(), threading.Event()

    def slowly(*given: Any, loaded: str) -> Any:
        begun.set()
        assert go_on.wait(PATIENCE)
        return forked(*given, loaded=loaded)

    monkeypatch.setattr("stridor.app.page.runs.forked", slowly)
    wish = Wish(paper_case().with_(ENDLESS).to_toml(), None, str(tmp_path))
    run = Run(wish, lambda *_: None, Queue(0))
    beginning = threading.Thread(target=run.begin)
    beginning.start()
    assert begun.wait(PATIENCE)
    run.close()
    ending = threading.Thread(target=run.end)
    ending.start()
    ending.join(0.3)
    assert ending.is_alive()  # the process is not there yet
    go_on.set()
    ending.join(PATIENCE)
    beginning.join(PATIENCE)
    assert run.process is not None
    assert not run.process.is_alive()


def test_no_more_at_once_than_there_may_be(start) -> None:
    queue = Queue(1)
    one, first = start(ENDLESS, queue)
    first.wait("begun")
    _, second = start(SHORT, queue)
    three, third = start(ENDLESS, queue)
    assert second.wait("waiting") == 1
    assert third.wait("waiting") == 2
    three.stop()
    assert third.wait("stopped")["file"] is None
    assert second.names == ["waiting"] * len(second.names)
    one.close()
    second.wait("done")


def test_what_cannot_run_is_told_in_the_words_of_the_program(start) -> None:
    _, told = start(SHORT | {"temporal.step": 1.0})
    words = told.wait("refused")
    with pytest.raises(st.CaseError) as error:
        st.simulate(paper_case().with_(SHORT | {"temporal.step": 1.0}))
    assert words == str(error.value)


def test_a_run_that_is_killed_is_told_of_and_gives_its_place_away(start) -> None:
    queue = Queue(1)
    run, told = start(ENDLESS, queue)
    told.wait("progress")
    _, other = start(SHORT, queue)
    os.kill(run.process.pid, signal.SIGKILL)
    assert "has died" in told.wait("failed")
    other.wait("done")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are looked up as Unix has them")
def test_a_killed_server_leaves_no_run_behind(tmp_path: Path) -> None:
    script = f"""
import sys, time
sys.path[:0] = {sys.path!r}
from stridor.app.page.runs import Run, Wish
if __name__ == "__main__":
    run = Run(Wish({paper_case().with_(ENDLESS).to_toml()!r}, None, {str(tmp_path)!r}), lambda part, content: print(part, run.process.pid if "run" in globals() and run.process else "", flush=True))
    time.sleep(600)
"""
    server = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    pid = 0
    while not pid:
        words = server.stdout.readline().split()
        pid = int(words[1]) if len(words) == 2 and words[0] in ("progress", "picture") else 0
    server.kill()
    server.wait()
    until = time.monotonic() + 10
    while time.monotonic() < until:
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return
        time.sleep(0.05)
    os.kill(pid, signal.SIGKILL)
    pytest.fail("the run goes on without its server")
