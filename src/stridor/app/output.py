"""What the program prints: one JSON document on stdout or readable tables; everything else on stderr."""

from __future__ import annotations

import json
import logging
import math
import os
import re
import textwrap
import time
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from .heartbeat import hush, silent

BETWEEN_LINES = 10.0  # seconds
_TOGETHER = re.compile(r"(?<=\d) (?=(?:Hz|1/s|%|[smNJ])(?:\W|$))|(?<=μ) (?==)|(?<=μ =) ")  # a number and its unit
PAGE = 80  # columns of a line where no terminal says how many


class _Screen(Console):
    """A console that takes back the line that says what is being computed before it prints, and prints sentences in
    lines no longer than the page, no word broken: a path stays whole, however long."""

    def print(self, *objects: Any, **options: Any) -> None:
        hush()
        if all(isinstance(thing, str) for thing in objects):
            options.setdefault("markup", False)
            objects = (_filled(" ".join(objects), self.page),)
        super().print(*objects, **options)

    @property
    def page(self) -> int:
        """Columns of a line: those of the terminal; elsewhere COLUMNS, or 80."""
        if self.is_terminal:
            return self.width
        columns = os.environ.get("COLUMNS", "")
        return int(columns) if columns.isdigit() and int(columns) else PAGE


def _filled(text: str, width: int) -> str:
    """Lines of text no longer than the page, what goes on indented."""
    lines: list[str] = []
    for line in _TOGETHER.sub("\N{NO-BREAK SPACE}", text).splitlines():
        indent = line[: len(line) - len(line.lstrip())]
        lines += textwrap.wrap(
            line, width, subsequent_indent=indent + "  ", break_long_words=False, break_on_hyphens=False
        ) or [""]
    return "\n".join(lines).replace("\N{NO-BREAK SPACE}", " ")


stdout = _Screen(highlight=False, soft_wrap=True)
stderr = _Screen(stderr=True, highlight=False, soft_wrap=True)


def literal(text: str) -> None:
    """A text on stdout as it is, to be copied: a command."""
    hush()
    print(text)


def plain(value: Any) -> Any:
    """JSON has no NaN or infinity: they become null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    return value


def print_json(document: dict[str, Any]) -> None:
    """One document, nothing else."""
    hush()
    print(json.dumps(plain(document), indent=2, allow_nan=False, ensure_ascii=False), flush=True)


def say(text: str, *, quiet: bool) -> None:
    """A line of log."""
    if not quiet:
        stderr.print(text)


class Log(logging.Handler):
    """The log of the package as lines on stderr; of stages that differ in their numbers alone, the first."""

    _before = ""

    def emit(self, record: logging.LogRecord) -> None:
        """One record."""
        text = record.getMessage()
        words = text[: next((k for k, c in enumerate(text) if c.isdigit()), len(text))]
        if record.levelno > logging.DEBUG or words != self._before:
            kind = "" if record.levelno == logging.DEBUG else f"{record.levelname.lower()}: "
            stderr.print(kind + text)
        self._before = words


@contextmanager
def progress_bar(text: str, *, quiet: bool) -> Generator[Any, None, None]:
    """Yields progress(done, planned) drawn on stderr with the time left, while it is under way."""
    if quiet or not stderr.is_terminal:
        # A bar in a log file is noise.
        yield None
        return
    with ExitStack() as drawn:
        yield _Bar(text, drawn)


class _Bar:
    """A bar that is there from the first word of progress to the last: what is refused before has drawn none, and what
    comes after is told of in its turn."""

    def __init__(self, text: str, drawn: ExitStack) -> None:
        self.text, self.drawn = text, drawn
        self.bar: Progress | None = None

    def __call__(self, done: int, planned: int) -> None:
        if done >= planned:
            self.drawn.close()
            self.bar = None
            return
        if self.bar is None:
            self.bar = self._begun(planned)
        self.bar.update(self.bar.task_ids[0], total=planned, completed=done)

    def _begun(self, planned: int) -> Progress:
        what, left = TextColumn("{task.description}"), TextColumn("time left")
        columns = what, BarColumn(), TaskProgressColumn(), left, TimeRemainingColumn()
        self.drawn.enter_context(silent())
        bar = self.drawn.enter_context(Progress(*columns, console=stderr, transient=True))
        bar.add_task(self.text, total=planned)
        return bar


@contextmanager
def counting(text: str, *, quiet: bool, worth: bool = True) -> Generator[Any, None, None]:
    """Yields progress(done, planned): a bar on a terminal, elsewhere a line every ten seconds with the time left.

    worth: whether there is enough to count for any of it.
    """
    if quiet or not worth:
        yield None
    elif stderr.is_terminal:
        with progress_bar(text, quiet=quiet) as progress:
            yield progress
    else:
        with silent():
            yield _Lines(text)


class _Lines:
    """Progress as lines of a log."""

    def __init__(self, text: str) -> None:
        self.text, self.last = text, 0.0
        self.first: int | None = None
        self.before: tuple[float, int] | None = None

    def __call__(self, done: int, planned: int) -> None:
        now = time.monotonic()
        if self.first is None:
            self.first = done
        if self.before is None and done > self.first:
            # What came before, a model, factors or workers that start, and with the first of them what is made once
            # for all, is no measure of what comes now.
            self.before, self.last = (now, done), now
        if self.before is None:
            return
        started, first = self.before
        if now - self.last < BETWEEN_LINES or not first < done < planned:
            return
        self.last = now
        left = (now - started) / (done - first) * (planned - done)
        stderr.print(f"{self.text}: {done} of {planned}, about {duration(left)} left")


def duration(seconds: float) -> str:
    """A time in words: "40 s", "12 min", "3.5 h", "2.1 days"."""
    for limit, unit, name in ((100.0, 1.0, "s"), (6000.0, 60.0, "min"), (172800.0, 3600.0, "h")):
        if seconds < limit:
            return f"{seconds / unit:.2g} {name}" if seconds / unit < 10 else f"{seconds / unit:.0f} {name}"
    return f"{seconds / 86400:.3g} days"
