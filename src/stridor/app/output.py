"""What the program prints: one JSON document on stdout or readable tables; everything else on stderr."""

from __future__ import annotations

import json
import math
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

stdout = Console(highlight=False, soft_wrap=True)
stderr = Console(stderr=True, highlight=False, soft_wrap=True)


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
    print(json.dumps(plain(document), indent=2, allow_nan=False, ensure_ascii=False), flush=True)


def say(text: str, *, quiet: bool) -> None:
    """A line of log."""
    if not quiet:
        stderr.print(text, markup=False)


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A table on stdout, right-aligned, never cut: it may go into a file as well as to a screen."""
    widths = [max(len(line[k]) for line in (columns, *rows)) for k in range(len(columns))]
    print(title)
    for line in (columns, *rows):
        print("  " + "  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)).rstrip())


@contextmanager
def progress_bar(text: str, *, quiet: bool) -> Generator[Any, None, None]:
    """Yields progress(done, planned) drawn on stderr with the time left."""
    if quiet or not stderr.is_terminal:
        # A bar in a log file is noise.
        yield None
        return
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("time left"),
        TimeRemainingColumn(),
        console=stderr,
        transient=True,
    )
    with bar:
        task = bar.add_task(text, total=None)

        def advance(done: int, planned: int) -> None:
            bar.update(task, total=planned, completed=done)

        yield advance
