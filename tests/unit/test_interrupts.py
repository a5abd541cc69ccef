"""An interrupt that a callback drops is raised again until somebody has heard it."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from stridor import interrupts
from stridor.app import cli

DROPPED = """
import ctypes, sys, time
from stridor import interrupts

interrupts.insist()
dropped = ctypes.CFUNCTYPE(None)(interrupts.interrupt)
try:
    dropped()  # its exception is printed and lost, as amid the compiling of a kernel
    print("dropped", flush=True)
    time.sleep(20)
    print("never raised again")
except KeyboardInterrupt:
    interrupts.heard()
    print("raised again", flush=True)
time.sleep(1.5)
print("and no more")
"""


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="needs a timer of the system")
def test_what_a_callback_drops_is_raised_again_and_once_heard_no_more() -> None:
    done = subprocess.run([sys.executable, "-c", DROPPED], capture_output=True, text=True, check=False, timeout=60)
    assert done.stdout.splitlines() == ["dropped", "raised again", "and no more"], done.stderr
    assert not done.stderr


def test_other_things_that_nobody_can_catch_are_told() -> None:
    told = DROPPED.replace("(interrupts.interrupt)", "(lambda: 1 / 0)").replace("time.sleep(20)", "raise KeyboardInterrupt")
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=False, timeout=60)
    assert "ZeroDivisionError" in done.stderr


EARLY = """
import os, signal
from stridor import interrupts

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job has it ignored
interrupts.install()
try:
    with interrupts.held():
        os.kill(os.getpid(), signal.SIGINT)  # asked for before the block that looks at it has begun
        with interrupts.{inner}() as block:
            print("asked" if block.asked else "not asked", flush=True)
            block.met = True
        print("on it goes", flush=True)
except KeyboardInterrupt:
    interrupts.heard()
    print("interrupted", flush=True)
"""


@pytest.mark.parametrize(
    ("inner", "told"), [("held", ["asked", "on it goes", "interrupted"]), ("at_once", ["interrupted"])]
)
def test_what_was_asked_for_before_a_block_reaches_it(inner: str, told: list[str]) -> None:
    words = [sys.executable, "-c", EARLY.format(inner=inner)]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=60)
    assert done.stdout.splitlines() == told, done.stderr


def test_a_run_asked_to_end_while_it_is_prepared_does_not_begin() -> None:
    """Ctrl-C between the start of the program and the first step once waited for the last one."""
    done = subprocess.run([sys.executable, "-c", PREPARED], capture_output=True, text=True, check=False, timeout=120)
    assert done.stdout.splitlines() == ["interrupted"], done.stderr


PREPARED = """
import os, signal
import stridor as st
from stridor import interrupts
from stridor.case import Case, loads, template_text
from stridor.temporal import simulate

signal.signal(signal.SIGINT, signal.default_int_handler)
interrupts.install()
def prepared(*_, **__):
    os.kill(os.getpid(), signal.SIGINT)
    raise RuntimeError("not interrupted where it is prepared")

simulate.settings_of_restart = prepared
try:
    with interrupts.held():
        st.simulate(st.loads(template_text("two-beams")))
        print("a run")
except KeyboardInterrupt:
    interrupts.heard()
    print("interrupted")
"""


def test_an_interrupt_amid_what_python_makes_of_text_is_no_death_by_a_signal(tmp_path: Path) -> None:
    """Data classes are made of text: where Ctrl-C falls into one, `python -m` ended by the signal, though it was told."""
    (tmp_path / "program.py").write_text(
        "import sys\nfrom stridor import interrupts\ninterrupts.install()\n"
        "try:\n    exec('raise KeyboardInterrupt')\nexcept KeyboardInterrupt:\n    interrupts.heard()\n"
        "interrupts.leave()\ninterrupts.gone()\nsys.exit(interrupts.INTERRUPTED)\n",
        encoding="utf-8",
    )
    done = subprocess.run([sys.executable, "-m", "program"], cwd=tmp_path, capture_output=True, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (130, b"")


@pytest.mark.parametrize("asked", [True, False])
def test_what_a_library_makes_of_an_interrupt_ends_the_program_as_one(monkeypatch, capsys, asked: bool) -> None:
    def called() -> int:
        if asked:
            interrupts._program.pending = True
        raise SystemError("returned a result with an exception set")

    monkeypatch.setattr(interrupts, "_program", interrupts._Program([]))
    if asked:
        assert cli._guarded(called) == interrupts.INTERRUPTED
        assert capsys.readouterr().err == "stridor: interrupted\n"
        assert not interrupts.pending()
    else:
        with pytest.raises(SystemError):
            cli._guarded(called)
