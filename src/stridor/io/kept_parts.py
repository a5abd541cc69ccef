"""Finished parts of a comparison in a text file that a crash cannot spoil: one line each, written when it is there.

    {"case": SHA-256, "part": "growth", "mu": 0.1, "data": {…}, "check": SHA-256}

Lines are only ever added. Those of other cases stay and are passed over, and so is a line that is cut or changed.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import AnalysisError

NAME = "compare.jsonl"
LONGEST = 1 << 28  # characters of a line; no part is as long


class KeptParts:
    """Parts of one case, ``key`` (`study.case_key`), in a file. Reads it once, with ``fresh`` not at all; ``others``
    counts lines of other cases, ``damaged`` those that are cut or changed."""

    def __init__(self, path: Path, key: str, *, fresh: bool = False) -> None:
        self.path, self.key = path, key
        self.others = self.damaged = 0
        self._parts: dict[tuple[str, float | None], Mapping[str, Any]] = {}
        if not fresh:
            self._read()

    def get(self, part: str, mu: float | None) -> Mapping[str, Any] | None:
        """What was put there for this case, None if nothing was."""
        return self._parts.get((part, mu))

    def put(self, part: str, mu: float | None, data: Mapping[str, Any]) -> None:
        """Add a line at the end of the file. Raises AnalysisError where it cannot be written."""
        try:
            text = json.dumps(data, allow_nan=False)
        except ValueError:
            return  # not a number: nothing to build on
        self._parts[part, mu] = data
        line = json.dumps({"case": self.key, "part": part, "mu": mu, "data": data, "check": _check(text)})
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("a+b") as stream:
                if stream.seek(0, os.SEEK_END):
                    stream.seek(-1, os.SEEK_END)
                    # Behind a line that was cut, begin a new one.
                    line = line if stream.read(1) == b"\n" else "\n" + line
                stream.write(line.encode() + b"\n")
                stream.flush()
                os.fsync(stream.fileno())
        except OSError as error:
            raise AnalysisError(f"cannot write {self.path}: {error.strerror or error}") from error

    def _read(self) -> None:
        if not self.path.is_file():
            return
        try:
            with self.path.open(encoding="utf-8", errors="replace") as stream:
                while line := stream.readline(LONGEST):
                    self._take(line)
        except OSError as error:
            raise AnalysisError(f"cannot read {self.path}: {error.strerror or error}") from error

    def _take(self, line: str) -> None:
        if not line.strip():
            return
        try:
            entry: dict[str, Any] = json.loads(line)
            case, part, mu, data = (entry[name] for name in ("case", "part", "mu", "data"))
            if entry["check"] != _check(json.dumps(data, allow_nan=False)):
                raise ValueError("changed")
            if not isinstance(data, dict) or not isinstance(part, str) or not isinstance(mu, int | float | None):
                raise TypeError("not a part")
        except (ValueError, KeyError, TypeError, RecursionError):
            self.damaged += 1
            return
        if case == self.key:
            self._parts[part, mu] = data
        else:
            self.others += 1


def _check(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
