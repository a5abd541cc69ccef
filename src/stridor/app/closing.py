"""How a verb ends: a sentence, and the command that comes next as a shell takes it."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Conclusion:
    """A sentence, the verb that comes next ("" for none) and options of its own, beside those that the user gave."""

    sentence: str
    verb: str = ""
    options: tuple[str, ...] = ()


def command(words: Sequence[str], width: int) -> str:
    """A command line for a shell, on several lines joined by a backslash where it is wider than the page; an option
    stays with its value."""
    parts: list[str] = []
    for word in words:
        quoted = shlex.quote(word)
        if parts and parts[-1].startswith("--") and " " not in parts[-1] and not word.startswith("--"):
            parts[-1] += f" {quoted}"
        else:
            parts.append(quoted)
    lines = [""]
    for part in parts:
        if lines[-1].strip() and len(lines[-1]) + len(part) + 3 > width:
            lines.append("   ")
        lines[-1] += f" {part}" if lines[-1] else part
    return " \\\n".join(lines)
