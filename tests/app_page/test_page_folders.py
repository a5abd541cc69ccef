"""Temporary folders of pages: what a killed server leaves is removed by the next one, and nothing else."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import urllib.request
from pathlib import Path

import pytest
from browsing import serving

from stridor.app.page.folders import PREFIX, new_folder, remove_left
from stridor.io.processes import Process, this_process

pytest.importorskip("nicegui", reason="the extra app is not installed")


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    return tmp_path


def of_pages(folder: Path) -> set[Path]:
    return set(folder.glob(f"{PREFIX}*"))


@pytest.mark.skipif(sys.platform == "win32", reason="whether a process is dead is not known there")
def test_a_server_that_starts_takes_away_what_a_dead_one_left(temporary: Path):
    with subprocess.Popen([sys.executable, "-c", ""]) as gone:
        gone.wait()
    left = temporary / f"{PREFIX}{Process(this_process().host, gone.pid, '1').mark}.x"
    (left / "both").mkdir(parents=True)
    alive = new_folder()
    with serving() as (_, address):
        urllib.request.urlopen(address).close()
        assert not left.exists()
        assert alive in of_pages(temporary)
        assert len(of_pages(temporary)) == 2


@pytest.mark.slow  # starts three servers
@pytest.mark.skipif(sys.platform == "win32", reason="nobody is killed there")
def test_the_folder_of_a_killed_server_goes_with_the_start_of_the_next(temporary: Path):
    with serving() as (alive, address):
        urllib.request.urlopen(address).close()
        (kept,) = of_pages(temporary)
        with serving() as (killed, other):
            urllib.request.urlopen(other).close()
            (left,) = of_pages(temporary) - {kept}
            (left / "simulate.nc").touch()
            killed.kill()
            killed.wait(20)
        assert left.exists()
        with serving():
            assert of_pages(temporary) == {kept}
        assert alive.poll() is None


@pytest.mark.skipif(sys.platform == "win32", reason="whether a process is dead is not known there")
def test_only_folders_of_dead_processes_of_this_user_go(temporary: Path):
    own = this_process()
    with subprocess.Popen([sys.executable, "-c", ""]) as gone:
        gone.wait()
    dead = Process(own.host, gone.pid, "1").mark
    given_again = Process(own.host, own.number, "1").mark  # our number, of a process that began before us
    elsewhere = Process("elsewhere", gone.pid, "1").mark
    target = temporary / "target"
    target.mkdir()
    (target / "kept").touch()
    mine = new_folder()
    stay = [mine, target] + [temporary / f"{PREFIX}{name}" for name in (f"{elsewhere}.x", "notes", f"{dead}.file", f"{dead}.link")]
    for path in stay[2:4]:
        path.mkdir()
    stay[4].touch()
    stay[5].symlink_to(target, target_is_directory=True)
    go = [temporary / f"{PREFIX}{mark}.x" for mark in (dead, given_again)]
    for path in go:
        (path / "both").mkdir(parents=True)
    remove_left()
    assert [path.exists() for path in go] == [False, False]
    assert all(path.exists() for path in stay)
    assert (target / "kept").exists()


def test_a_folder_of_another_user_stays(temporary: Path, monkeypatch: pytest.MonkeyPatch):
    folder = temporary / f"{PREFIX}{Process(this_process().host, 2**22 + 1, '1').mark}.x"
    folder.mkdir()
    monkeypatch.setattr("os.getuid", lambda: folder.stat().st_uid + 1, raising=False)
    remove_left()
    assert folder.exists()
    monkeypatch.undo()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    if sys.platform != "win32":
        remove_left()
        assert not folder.exists()
