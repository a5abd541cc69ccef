"""What the program does where there is no POSIX: calls taken away as Windows lacks them, its lock put in their place."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest

WITHOUT_POSIX = """
import os, signal, sys, types

held = set()
def locking(handle, mode, count):
    found = os.fstat(handle).st_ino
    if os.environ.get("ELSEWHERE") or found in held:
        raise OSError(36, "Resource deadlock avoided")
    held.add(found)

def kill(number, what):
    raise AssertionError("Ctrl-C for the whole console")

import asyncio, multiprocessing, subprocess, tempfile  # what Python itself has of POSIX comes in before it goes
from stridor.app.entry import main
for module, names in (
    (os, "fork getuid geteuid getgid pread pwrite preadv fchmod fchown sysconf statvfs mkfifo setsid killpg "
         "sched_getaffinity getloadavg O_NOFOLLOW O_NONBLOCK O_DIRECTORY posix_fallocate"),
    (signal, "SIGALRM SIGHUP setitimer alarm SIGUSR1 SIGKILL pthread_sigmask"),
):
    for name in names.split():
        if hasattr(module, name):
            delattr(module, name)
os.kill = kill
sys.modules["fcntl"] = sys.modules["resource"] = sys.modules["termios"] = None
sys.modules["msvcrt"] = types.SimpleNamespace(locking=locking, LK_NBLCK=2)
main()
"""


def program(*words: str, cwd: Path, **environment: str) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-c", WITHOUT_POSIX, *words]
    return subprocess.run(command, cwd=cwd, env={**os.environ, **environment}, capture_output=True, check=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("windows")
    assert program("new", "two-beams", cwd=folder).returncode == 0
    return folder


@pytest.mark.slow
def test_verbs_work_without_calls_of_posix(folder: Path):
    for _ in range(2):  # what the first one left does not stop the second
        done = program("onsets", "two-beams.toml", cwd=folder)
        assert done.returncode == 0, done.stderr.decode()
    written = sorted(path.name for path in (folder / "two-beams.out").iterdir())
    assert written == ["onsets.csv", "onsets.nc", "onsets.png"]


def test_a_folder_that_is_locked_is_refused_without_them(folder: Path):
    out = folder / "held"
    out.mkdir()
    (out / ".stridor-run").write_text(json.dumps({"host": "here", "process": 7, "since": "noon"}))
    done = program("onsets", "two-beams.toml", "--out", "held", cwd=folder, ELSEWHERE="1")
    assert done.returncode == 2
    assert b"process 7 on here has been writing there since noon" in done.stderr
    assert b"Traceback" not in done.stderr


def test_what_a_dead_process_said_holds_no_folder_and_pipes_may_know_no_greek(folder: Path):
    out = folder / "left"
    out.mkdir()
    (out / ".stridor-run").write_text(json.dumps({"host": platform.node(), "process": 2**22 + 1, "since": "noon"}))
    done = program("onsets", "two-beams.toml", "--out", "left", cwd=folder, PYTHONIOENCODING="cp1252")
    assert done.returncode == 0, done.stderr.decode("cp1252")
    assert b"growth begins at ? = 0.076725" in done.stdout


@pytest.mark.parametrize("words", [("-h",), ("modes", "-h"), ("--version",)])
def test_the_package_is_the_program(words: tuple[str, ...], tmp_path: Path):
    done = subprocess.run(
        [sys.executable, "-m", "stridor", *words], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith(("Usage: python -m stridor", "stridor "))


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_are_told_the_verbs(shell: str, tmp_path: Path):
    asked = {
        "_STRIDOR_COMPLETE": f"complete_{shell}", "COMP_WORDS": "stridor mod", "COMP_CWORD": "1",
        "_TYPER_COMPLETE_ARGS": "stridor mod", "_TYPER_COMPLETE_FISH_ACTION": "get-args",
    }  # fmt: skip
    code = "import sys; sys.argv = ['stridor']; from stridor.app.entry import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env={**os.environ, **asked}, capture_output=True, text=True, check=False
    )
    assert "modes" in done.stdout
    assert "onsets" not in done.stdout
