"""Processes by number and start: a number alone is given again to others, a number with its start is not."""

from __future__ import annotations

import os
import platform
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Process:
    """A process: the computer it runs on, its number there, and when it was started (ticks since boot; "" unknown)."""

    host: str
    number: int
    started: str

    @property
    def mark(self) -> str:
        """As part of a file's name."""
        return f"{''.join(c if c.isalnum() else '-' for c in self.host)[:40]}.{self.number}.{self.started or 0}"

    @property
    def dead(self) -> bool:
        """Whether it is known to have ended; never so of a process of another computer, or on Windows."""
        if self.host != platform.node() or not hasattr(os, "fork"):  # on Windows os.kill(…, 0) is Ctrl-C
            return False
        try:
            os.kill(self.number, 0)
        except ProcessLookupError:
            return True
        except (OSError, OverflowError):
            pass
        now = _started(self.number)
        return bool(now and self.started and now != self.started)


def this_process() -> Process:
    """The process that asks."""
    return Process(platform.node(), os.getpid(), _started(os.getpid()))


def left_behind(mark: str) -> bool:
    """Whether what has this `Process.mark` in its name is of a process that is known to be dead; never so of those of
    other computers, of which nothing is known."""
    host, number, started = mark.split(".")
    own = this_process()
    if not own.mark.startswith(f"{host}."):
        return False
    left = Process(own.host, int(number), "" if started == "0" else started)
    return left != own and left.dead


def _started(number: int) -> str:
    """Start of a process, "" where the system does not tell."""
    try:
        # The name before it may hold anything, brackets and spaces too.
        return Path(f"/proc/{number}/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()[19]
    except (OSError, IndexError):
        return ""
