"""What a saved state must hold before any compiled loop sees it: looked through once, for both marches."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NoReturn

import numpy as np

from ..errors import CaseError
from ..typing import Array

_MEND = "the saved state is damaged; start the run anew"
INFINITY = float("inf")
# Lowest and highest value of what is saved, by the last part of its name; either may be an array (per contact).
Bounds = Mapping[str, tuple[Any, Any]]
STATUS_RANGE = (0, 2)


def check_arrays(state: Mapping[str, Any], wanted: Mapping[str, Array], bounds: Bounds) -> None:
    """Raise CaseError at "restart" unless the state holds every array wanted: of its shape, whole numbers where it has
    whole numbers, finite, and within the bounds given for its name."""
    for name, target in wanted.items():
        if name not in state:
            raise CaseError("restart", name, f"missing – {_MEND}")
        held = np.asarray(state[name])
        if held.shape != target.shape:
            raise CaseError("restart", name, "a state of the same model: this one has other freedoms or contacts")
        if held.dtype.kind not in ("iu" if target.dtype.kind == "i" else "f"):
            kind = "whole numbers" if target.dtype.kind == "i" else "floating-point numbers"
            _refuse(name, f"holds {held.dtype}; must hold {kind}")
        if not np.all(np.isfinite(held)):
            _refuse(name, "holds values that are not finite")
        low, high = bounds.get(name, (-INFINITY, INFINITY))
        if np.any((held < low) | (held > high)):
            _refuse(name, f"holds values from {held.min():g} to {held.max():g}, which is out of range")


def agrees(state: Mapping[str, Any], name: str, own: Array, *, first: int | None = None, relative: float = 0.0) -> bool:
    """Whether what a state holds under a name, or the first numbers of it, are a system's own."""
    held = np.asarray(state.get(name, ()))
    if held.ndim != 1 or held.dtype.kind not in "iuf" or held[:first].shape != own.shape:
        return False
    return bool(np.allclose(held[:first], own, rtol=relative, atol=0.0))


def check_done(state: Mapping[str, Any], name: str, index: int, steps: int) -> None:
    """Raise CaseError unless the counter of steps is what the trajectory says of itself; a checked state is given."""
    counted = int(state[name][index])
    if counted != steps:
        _refuse(name, f"counts {counted} steps where the run has {steps}")


def _refuse(name: str, what: str) -> NoReturn:
    raise CaseError("restart", name, f"{what}: {_MEND}")
