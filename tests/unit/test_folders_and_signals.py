"""Folders for results, full disks, signals: one message each, nothing half written, nothing of others touched."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import stridor as st
from program import stridor
from stridor.case import template_text
from stridor.errors import AnalysisError, CaseError
from stridor.io import claims
from stridor.io.atomic import remove_remains, replacing, write_text
from stridor.io.processes import Process, this_process
from stridor.temporal.trajectory import PhaseResult
from stridor.view.style import new_figure, styled

COARSE = [
    "bodies.beam1.elements=6",
    "bodies.beam2.elements=18",
    "temporal.step=4e-7",
    "temporal.record_every=5",
    "phases.press.duration=0.0004",
    "phases.slide.duration=0.0004",
]
HOLD = "import sys, time; from stridor.io.claims import claimed; from pathlib import Path\n" + (
    "with claimed(Path(sys.argv[1])):\n    print('held', flush=True); time.sleep(60)\n"
)


def holder(folder: Path) -> subprocess.Popen[str]:
    """A process that holds a folder."""
    process = subprocess.Popen([sys.executable, "-c", HOLD, str(folder)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    return process


def test_a_folder_is_for_one_process_until_it_ends(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    process = holder(folder)
    try:
        with pytest.raises(CaseError, match=rf"process {process.pid} on .* since \d{{4}}-"), claims.claimed(folder):
            pass
    finally:
        process.kill()
        process.wait()
    # Killed without a word, it holds nothing, although its file is there.
    assert (folder / claims.NAME).exists()
    with claims.claimed(folder), claims.claimed(folder):
        assert json.loads((folder / claims.NAME).read_text())["process"] == os.getpid()
    assert not (folder / claims.NAME).exists()


def test_without_locks_the_process_counts_with_its_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(claims, "fcntl", None)
    process = holder(tmp_path)
    path = tmp_path / claims.NAME
    try:
        with pytest.raises(CaseError, match=f"process {process.pid}"), claims.claimed(tmp_path):
            pass
        # Another process that was given the number since.
        told = json.loads(path.read_text())
        path.write_text(json.dumps(told | {"started": str(int(told["started"]) - 1)}))
        with claims.claimed(tmp_path):
            pass
        # Of another computer nothing is known.
        path.write_text(json.dumps(told | {"host": "elsewhere"}))
        with pytest.raises(CaseError, match="on elsewhere"), claims.claimed(tmp_path):
            pass
    finally:
        process.kill()
        process.wait()


def test_places_that_cannot_be_folders(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to("nowhere")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "figures").touch()
    for path, parts, words in (
        ("file", (), "is a file"),
        ("file/in", (), "is a file"),
        ("link", (), "is a link to nothing"),
        ("out", ("figures",), "is a file"),
    ):
        with pytest.raises(CaseError, match=words), claims.claimed(tmp_path / path, parts):
            pass
    with claims.claimed(tmp_path / "a" / "b"):
        assert (tmp_path / "a" / "b").is_dir()
    assert not (tmp_path / "a").exists()


def test_remains_of_dead_processes_go_and_those_of_the_living_stay(tmp_path: Path) -> None:
    own = this_process()
    dead = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, check=True)
    ended = Process(own.host, int(dead.stdout), "1")
    living = Process(own.host, os.getppid(), "")
    other = Process("elsewhere", int(dead.stdout), "1")
    names = {p: tmp_path / f".simulate.nc.stridor-{p.mark}.abc123.nc" for p in (own, ended, living, other)}
    reused = Process(own.host, os.getpid(), "1")
    names[reused] = tmp_path / f".simulate.nc.stridor-{reused.mark}.x.nc"
    for path in [*names.values(), tmp_path / ".mine", tmp_path / "simulate.nc"]:
        path.touch()
    remove_remains(tmp_path)
    assert {p for p, path in names.items() if path.exists()} == {own, living, other}
    assert (tmp_path / ".mine").exists()
    with replacing(tmp_path / "new.nc") as temporary:
        assert this_process().mark in temporary.name
    assert ended.dead
    assert not own.dead
    assert not other.dead


def in_child(code: str, *words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Python code in a process of its own."""
    return subprocess.run([sys.executable, "-c", code, *words], cwd=cwd, capture_output=True, text=True, timeout=300)


SAVE = """
import os, resource, sys
import stridor as st
from stridor.errors import AnalysisError
run = st.open(sys.argv[1])
for limit in map(int, sys.argv[2:]):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    try:
        st.save(run, "out/simulate.nc")
    except AnalysisError as error:
        print(error, os.listdir("out"))
"""


@pytest.fixture(scope="module")
def run_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    case = st.loads(template_text("two-beams"), COARSE)
    return st.save(st.simulate(case), tmp_path_factory.mktemp("run") / "simulate.nc")


def test_a_limit_on_file_sizes_is_a_message_and_no_crash(run_file: Path, tmp_path: Path) -> None:
    assert run_file.stat().st_size > 60_000
    done = in_child(SAVE, str(run_file), "1", "3000", "60000", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == 3 * "cannot write out/simulate.nc: File too large []\n"
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize("words", [("modes", "--mu", "0.1"), ("steady",)])
def test_a_result_that_finds_no_room_anywhere_is_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    (tmp_path / "case.toml").write_text(st.loads(template_text("two-beams"), COARSE).text, encoding="utf-8")

    def no_room(self: Path, target: Path) -> Path:
        raise OSError(28, "No space left on device")

    verb, *options = words
    wanted = stridor(verb, "case.toml", *options, "--quiet", cwd=tmp_path)
    monkeypatch.setattr(Path, "replace", no_room)
    done = stridor(verb, "case.toml", *options, "--quiet", "--out", "x", cwd=tmp_path)
    as_json = stridor(verb, "case.toml", *options, "--json", "--out", "x", cwd=tmp_path)
    assert wanted.stdout
    assert done.stdout == wanted.stdout
    for told in (done, as_json):
        assert told.returncode == 1
        assert "stridor: cannot write x/" in told.stderr
        assert told.stderr.endswith(": No space left on device\n")
    document = json.loads(as_json.stdout)
    assert document.get("files", []) == []
    assert "No space left on device" in document["warnings"][-1]


def test_a_reduced_model_that_finds_no_room_keeps_no_results_from_being_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "case.toml").write_text(st.loads(template_text("two-beams"), COARSE).text, encoding="utf-8")
    own = Path.replace
    full = ["full"]

    def no_room(self: Path, target: Path) -> Path:
        if any(name in Path(target).parts for name in full):
            raise OSError(28, "No space left on device")
        return own(self, target)

    monkeypatch.setattr(Path, "replace", no_room)
    words = ("reduce", "case.toml", "--box", "mu=0:0.3", "--at", "mu=0.1", "--save", "full/m.npz", "--out", "x")
    done = stridor(*words, cwd=tmp_path)
    assert done.returncode == 1
    assert "Modes of the reduced model" in done.stdout
    assert sorted(p.name for p in (tmp_path / "x").iterdir()) == ["reduced.csv", "reduced.nc", "reduced.png"]
    (model,) = tmp_path.glob("case-*-m.npz")
    # As one line on a terminal of any width.
    told = " ".join(done.stderr.split())
    assert f"cannot write full/m.npz: No space left on device; the model is in {model}" in told
    assert stridor("reduce", model.name, "--at", "mu=0.1", "--out", "y", cwd=tmp_path).returncode == 0
    model.unlink()
    # Where there is no room for results either, both are told.
    full += ["x", *tmp_path.parts]
    as_json = stridor(*words, "--json", cwd=tmp_path)
    assert as_json.returncode == 1
    document = json.loads(as_json.stdout)
    assert (document["files"], len(document["modes"])) == ([], 1)
    assert "cannot write full/m.npz: No space left on device" in document["warnings"][-2]
    assert "cannot write x/reduced.nc: No space left on device" in document["warnings"][-1]
    assert "cannot write full/m.npz" in as_json.stderr
    assert "cannot write x/reduced.nc" in as_json.stderr


def test_what_is_written_through_a_stream_is_what_was_given(run_file: Path, tmp_path: Path) -> None:
    run = st.open(run_file)
    again = st.open(st.save(run, tmp_path / "again.nc"))
    assert np.array_equal(again.normal_force, run.normal_force)
    assert again.phases == run.phases


def test_a_run_without_records_in_its_last_phase_is_summed_up(run_file: Path) -> None:
    run = st.open(run_file)
    from dataclasses import replace

    last = run.phases[-1]
    beyond = PhaseResult("late", last.end, last.end + run.step, last.contacts)
    case = st.loads(template_text("two-beams"), COARSE)
    for cut in (replace(run, phases=(*run.phases, beyond)), replace(run, phases=())):
        assert st.summarise(case, cut).dominant_frequency_hz is None


@pytest.mark.parametrize(("slow", "told"), [(3.0, True), (0.1, False)])
def test_what_is_stronger_than_the_dominant_line_and_slower_than_the_window_resolves_is_told(
    run_file: Path, slow: float, told: bool
) -> None:
    """A swing of one period in the phase, beside a line of many: the line is named, and what is stronger is said."""
    from dataclasses import replace

    from stridor.app.conclusions import of_run

    run = st.open(run_file)
    time = run.time - run.time[0]
    length = time[-1]
    line, swing = (np.sin(2 * np.pi * periods * time / length) for periods in (40.0, 1.0))
    velocity = np.broadcast_to((line + slow * swing)[:, None, None], run.velocity.shape)
    phase = replace(run.phases[-1], start=run.time[0], end=run.time[-1])
    case = st.loads(template_text("two-beams"), COARSE)
    summary = st.summarise(case, replace(run, velocity=velocity, phases=(phase,)))
    assert summary.dominant_frequency_hz == pytest.approx(40.0 / length, rel=0.02)
    assert (summary.stronger_below_hz is not None) is told
    if summary.stronger_below_hz is not None:  # the third bin of Hann's window over half of what the filter leaves
        assert 6 / length <= summary.stronger_below_hz <= 9.01 / length
    sentence = of_run(summary.to_json()).sentence
    assert ("is stronger, and the second half of the phase is too short" in sentence) is told
    assert ("Hz dominates" in sentence) is not told


@pytest.mark.parametrize("saturated", [True, False])
def test_a_run_without_exponential_growth_is_said_to_have_saturated_where_it_has(saturated: bool) -> None:
    from stridor.app.conclusions import of_run

    summary = {"dominant_frequency_hz": 100.0, "stronger_below_hz": None, "growth_rate": None, "growth_fit": None}
    said = of_run({**summary, "saturated": saturated}).sentence
    assert said == f"last phase: 100.0 Hz dominates, nowhere exponential growth, {'' if saturated else 'not '}saturated"


def test_dollars_in_names_begin_no_formula(tmp_path: Path) -> None:
    """What is written is shown, on figures as in tables."""

    @styled
    def drawing():
        figure = new_figure()
        ax = figure.subplots()
        ax.plot([0, 1], [1, 100], label=r"$\frac{1}{$ %_^&<b>")
        ax.set_yscale("log")
        ax.set_title("cost $5, $\\undefined$")
        ax.set_xlabel("$x_{$")
        ax.text(0.5, 10, "$_$^")
        ax.annotate("$a$ \\", (0, 1))
        ax.legend()
        return figure

    drawing().savefig(tmp_path / "figure.png")
    drawing().savefig(tmp_path / "figure.svg")


PROGRAM = [sys.executable, "-m", "stridor"]


def test_sigterm_ends_a_run_like_ctrl_c(tmp_path: Path) -> None:
    """What was computed is in the file, the exit code is that of an interruption, and no lock stays."""
    (tmp_path / "case.toml").write_text(st.loads(template_text("two-beams"), COARSE).text)
    long = ["--set", "phases.slide.duration=4000.0", "--set", "temporal.record_every=20000000"]
    command = [*PROGRAM, "simulate", "case.toml", *long]

    def heed() -> None:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_DFL)

    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, preexec_fn=heed
    ) as process:
        lock = tmp_path / "case.out" / claims.NAME
        for _ in range(600):
            if lock.exists():
                break
            time.sleep(0.1)
        second = stridor("modes", "case.toml", cwd=tmp_path)
        assert second.returncode == 2
        assert f"process {process.pid}" in second.stderr
        time.sleep(1.0)
        process.send_signal(signal.SIGTERM)
        _, log = process.communicate(timeout=120)
    assert process.returncode == 130, log
    assert "Traceback" not in log
    assert not lock.exists()
    if (tmp_path / "case.out" / "simulate.nc").exists():
        assert st.open(tmp_path / "case.out" / "simulate.nc").interrupted


SWALLOWED = """
import ctypes, os, signal, sys, time
from stridor import interrupts
interrupts.AGAIN_SECONDS = 0.1
signal.signal(signal.SIGINT, signal.default_int_handler)
interrupts.install()
@ctypes.CFUNCTYPE(None)
def callback():
    os.kill(os.getpid(), signal.SIGINT)
    for _ in range(1000):
        pass
try:
    callback()
    print("dropped", flush=True)
    for _ in range(100):
        time.sleep(0.05)
    print("lost")
except KeyboardInterrupt:
    interrupts.heard()
    print("heard")
time.sleep(0.3)
"""


def test_an_interrupt_dropped_by_a_callback_comes_again(tmp_path: Path) -> None:
    done = in_child(SWALLOWED, cwd=tmp_path)
    assert done.stdout.split() in (["dropped", "heard"], ["heard"]), done
    assert done.returncode == 0, done.stderr


def test_writing_ends_before_it_is_interrupted(tmp_path: Path) -> None:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)

    def written() -> None:
        with replacing(tmp_path / "a.txt") as temporary:
            os.kill(os.getpid(), signal.SIGINT)
            temporary.write_text("whole")

    try:
        with pytest.raises(KeyboardInterrupt):
            written()
    finally:
        signal.signal(signal.SIGINT, before)
    assert (tmp_path / "a.txt").read_text() == "whole"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_a_folder_that_is_a_file_is_an_analysis_error_of_the_writer(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(AnalysisError, match="cannot write"):
        write_text(tmp_path / "file" / "a.txt", "")


LEAVES = """
import os, signal, sys
import stridor.app.cli as cli

number, own, kill = getattr(signal, sys.argv.pop(1)), os.getpid(), os.kill


class Last:
    def __del__(self):  # called when modules are taken down, after signals have been given back to the system
        kill(own, number)


last = Last()
cli.main()
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize(("words", "code"), [(("--version",), 0), (("check", "missing.toml"), 2)])
def test_a_signal_at_the_very_end_leaves_the_exit_code(
    tmp_path: Path, name: str, words: tuple[str, ...], code: int
) -> None:
    done = in_child(LEAVES, name, *words, cwd=tmp_path)
    assert done.returncode == code


BEGINS = """
import os, signal, sys

signal.signal(signal.SIGINT, signal.default_int_handler)  # tests in the background of a shell inherit none


class Early:
    def find_spec(self, name, path=None, target=None):  # a signal while the command line is imported
        if name == "typer":
            os.kill(os.getpid(), getattr(signal, sys.argv[1]))


sys.meta_path.insert(0, Early())
from stridor.app.entry import main
main()
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_signal_while_the_program_is_imported_is_a_word(tmp_path: Path, name: str) -> None:
    done = in_child(BEGINS, name, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (130, "stridor: interrupted\n")
