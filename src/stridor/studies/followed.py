"""Numbers of branches for the rows of a reduced model.

Branches have the numbers that `modes` gives them, by frequency at μ = 0. At some friction coefficients, all else as the
model has it in the middle of its ranges, they are followed in the full problem; from the nearest of those a row's modes
are followed straight to its parameters, on the model.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..case import Case
from ..errors import StridorError
from ..io.atomic import replacing
from ..modal.parametric import ReducedModel
from ..modal.parametric.line import Numbered, matched_numbers, numbers_at
from ..modal.parametric.model import ReducedModes
from ..stages import stage
from ..study.analyses import modes
from ..typing import IntArray
from .checks import FRICTION

STEP = 0.05  # of μ, from one anchor to the next
MOST = 21
ASIDE = 0.02  # of the range
NEAR = 1e-5  # of |λ|: how near the model's modes are to those of the full problem


def anchors_noted(model: ReducedModel, case: Case, names: Mapping[str, str], path: Path) -> None:
    """Follow the branches of the full problem and write their numbers beside the model; none where that fails.

    names: of parameters of the study, those of the model.
    """
    point = model.problem.reference
    low, high = next(((p.low, p.high) for p in model.problem.parameters if p.name == FRICTION), (None, None))
    changes = {path: point[own] for path, own in names.items() if own in point and path != FRICTION}
    own = None
    if low is not None and high is not None:
        # Not at the ends themselves, where other nodes may be about to touch.
        shares = np.linspace(ASIDE, 1 - ASIDE, min(MOST, 2 + int((high - low) / STEP)))
        own = low + (high - low) * shares
    stage("numbers of the branches, followed in the full problem")
    try:
        found = modes(case.with_(changes), own, max_frequency_hz=case.modal.max_frequency_hz, check=False)
    except StridorError:
        return
    told = [
        {"mu": mu, "real": lam.real.tolist(), "imag": lam.imag.tolist(), "number": found.branch.tolist()}
        for mu, lam in zip(found.mu.tolist(), found.eigenvalues, strict=True)
    ]
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(told), encoding="utf-8")


def anchors_read(model: ReducedModel, path: Path) -> tuple[Numbered, ...]:
    """What `anchors_noted` wrote, at the model's own modes; nothing where there is no file or it is damaged."""
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        known = [
            (float(t["mu"]), np.array(t["real"]) + 1j * np.array(t["imag"]), np.array(t["number"], dtype=np.int64))
            for t in told
        ]
    except (OSError, ValueError, KeyError, TypeError):
        return ()
    anchors: list[Numbered] = []
    for mu, values, numbers in known:
        point = model.problem.reference
        found = model.modes({**point, FRICTION: mu} if FRICTION in point else point)
        upper = found.values.imag >= 0
        if upper.all():
            anchors.append(Numbered(model, found, matched_numbers(values, numbers, found.values, NEAR)))
    return tuple(anchors)


def numbered(anchors: tuple[Numbered, ...], found: ReducedModes) -> IntArray:
    """Numbers (k,) of the modes of a row, 0 where they are not known."""
    if not anchors:
        return np.zeros(len(found.values), dtype=np.int64)
    mu = found.point.get(FRICTION, 0.0)
    nearest = min(anchors, key=lambda a: abs(a.modes.point.get(FRICTION, 0.0) - mu))
    return numbers_at(nearest, found)
