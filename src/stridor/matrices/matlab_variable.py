"""What a variable in a MATLAB file is, as far as matrices need it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..typing import Sparse
from .source import MatrixFile

INTEGERS = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")
NUMERIC = ("double", "single", "sparse", *INTEGERS)
DEEPEST = 4  # structs within structs

Loaded = tuple[Sparse, tuple[str, ...]]


@dataclass(frozen=True)
class Variable:
    """A variable that is not yet read: its kind in MATLAB's words, rows and columns; load: reads its matrix with notes,
    given the source to refuse at; fields: of a struct."""

    kind: str
    shape: tuple[int, ...]
    load: Callable[[MatrixFile], Loaded] | None = None
    fields: Callable[[], dict[str, Variable]] = dict

    @property
    def is_matrix(self) -> bool:
        return self.kind in NUMERIC and len(self.shape) == 2
