"""Parts of a run one after the other: told, timed, taken from an earlier call where they are there."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Protocol, TypeVar

T = TypeVar("T")
Log = Callable[[str], None]


class Shelf(Protocol):
    """Where finished parts are put, and sought before they are computed. stale: names of parts that are there, but not
    of this case and these versions, or damaged."""

    stale: list[str]

    def get(self, name: str) -> Any:
        """The part that was put there for the same case, None where there is none."""
        ...

    def put(self, name: str, part: Any) -> None:
        """Keep a part from now on."""
        ...


class Clock:
    """Times of the parts [s], by name; taken: what came from an earlier call, by name the parts of it."""

    def __init__(self, log: Log, shelf: Shelf | None = None) -> None:
        self.log, self.shelf = log, shelf
        self.seconds: dict[str, float] = {}
        self.taken: dict[str, list[str]] = {}

    def __call__(self, name: str, call: Callable[[], T], what: str = "") -> T:
        """The result of the call, its time kept under ``name``; ``what`` of that it is, said with the name."""
        self.log(_said(name, what))
        started = time.perf_counter()
        try:
            return call()
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - started

    def part(self, name: str, label: str, call: Callable[[], T], what: str = "", *, wanted: bool = True) -> T | None:
        """The part that is on the shelf under ``label``; else that of the call, which is put there unless it was cut
        short, or None where it is not wanted."""
        found: T | None = None if self.shelf is None else self.shelf.get(label)
        if found is not None:
            self.took(name, what)
            return found
        if not wanted:
            return None
        if self.shelf is not None and label in self.shelf.stale:
            self.log(f"{_said(name, what)}: what is there is of another case or version, or damaged; computed anew")
        result = self(name, call, what)
        if self.shelf is not None and result is not None and not getattr(result, "interrupted", False):
            self.shelf.put(label, result)
        return result

    def took(self, name: str, what: str = "") -> None:
        """Say and note that a part is there from an earlier call on the same case."""
        self.log(f"{_said(name, what)}: taken from an earlier call on the same case")
        self.taken.setdefault(name, []).append(what)


def _said(name: str, what: str) -> str:
    return f"{name}: {what}" if what else name
