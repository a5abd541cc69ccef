"""A study in parts, for arrays of jobs without a scheduler, and its parts put together."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import CaseError
from ..typing import IntArray

MOST = 100_000
_WRITTEN = re.compile(r"(\d{1,6})/(\d{1,6})")
FOLDERS = "part-*-of-*"


@dataclass(frozen=True)
class Part:
    """The ``number``-th of ``count`` parts, from 1."""

    number: int
    count: int

    def __post_init__(self) -> None:
        if not 1 <= self.number <= self.count <= MOST:
            raise CaseError("part", str(self), f"K/N with 1 ≤ K ≤ N ≤ {MOST}, such as 3/40")

    @staticmethod
    def read(text: str, where: str = "--part") -> Part:
        """From "3/40". Raises CaseError."""
        found = _WRITTEN.fullmatch(text.strip())
        if found is None:
            raise CaseError(where, text, "K/N, such as 3/40")
        return Part(int(found[1]), int(found[2]))

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"

    @property
    def folder(self) -> Path:
        """Where its store lies, in the folder of the study."""
        width = len(str(self.count))
        return Path(f"part-{self.number:0{width}}-of-{self.count}")

    def numbers(self, samples: int) -> IntArray:
        """Samples (k,) of the study that are its own. Raises CaseError where there are none."""
        found = np.array_split(np.arange(samples), self.count)[self.number - 1]
        if not len(found):
            raise CaseError("part", str(self), f"no more parts than samples ({samples})")
        return found

