"""What processes of pages run in tests, in place of the bench."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

# Of good numbers, but with more freedoms than can be computed with.
HUGE_CASE = """
materials.a = { young_modulus = 2e9, density = 2000.0, poisson_ratio = 0.3 }
bodies.b = { type = "solid", model = "plane strain", material = "a", thickness = 0.01, mesh = { shape = "rectangle", corner = [0.0, 0.0], size = [0.1, 0.02], divisions = [100000, 100000] } }
supports.s = { at = "b.bottom", fixed = ["x", "y"] }
"""


def counting() -> Callable[[Any, Callable[[str, Any], None]], None]:
    """Answers a number of seconds after as long, which a newer question may interrupt; "die" ends the process."""

    def answer(question: Any, send: Callable[[str, Any], None]) -> None:
        if question == "die":
            os._exit(1)
        send("begun", question)
        until = time.monotonic() + float(question)
        while time.monotonic() < until:
            time.sleep(0.001)
        send("answer", question)

    return answer


def careful() -> Callable[[Any, Callable[[str, Any], None]], None]:
    """Sends much at once for as long as it is let, so that it is interrupted while it sends."""

    def answer(question: Any, send: Callable[[str, Any], None]) -> None:
        if question == "last":
            send("answer", "last")
            return
        for _ in range(2000):
            send("block", b"x" * 300_000)

    return answer


def threads() -> Callable[[Any, Callable[[str, Any], None]], None]:
    """Answers what the environment says about threads."""

    def answer(question: Any, send: Callable[[str, Any], None]) -> None:
        send("answer", (os.environ.get("OPENBLAS_NUM_THREADS"), os.getpid()))

    return answer


def importing() -> Callable[[Any, Callable[[str, Any], None]], None]:
    """Imports a module that takes a while, as engines do when they are first needed; "again" says what it has."""

    def answer(question: Any, send: Callable[[str, Any], None]) -> None:
        send("idle", None)
        send("begun", None)
        import page_slow_module

        send("answer", page_slow_module.WHOLE)

    return answer


def lingering() -> Callable[[Any, Callable[[str, Any], None]], None]:
    """Goes on writing into a folder, which it makes, and does not end with its pipe."""
    os._exit = lambda _: None  # pyright: ignore[reportAttributeAccessIssue]

    def answer(question: Any, send: Callable[[str, Any], None]) -> None:
        folder = Path(question)
        while True:
            folder.mkdir(parents=True, exist_ok=True)
            (folder / "part").touch()
            time.sleep(0.001)

    return answer


def spending() -> Callable[[Any, Callable[[str, Any], None]], None]:
    """Tells how much memory [MB] the process has, and then uses a question's worth of it, in pieces among which one
    stays: what the C library keeps by itself."""
    kept: list[bytes] = []

    def answer(question: Any, send: Callable[[str, Any], None]) -> None:
        send("resident", int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6)
        pieces = [bytes(60_000) + b"x" for _ in range(int(question / 0.06))]
        kept.append(pieces[-1])

    return answer
