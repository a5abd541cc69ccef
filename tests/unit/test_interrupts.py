"""An interrupt that a callback drops is raised again until somebody has heard it."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

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
