"""A reduced model on what its own modes at some points span: for what moves along a line through a wide box, of whose
basis a line needs a part. Points cost a third of what they do on all of it, and their errors are estimated as ever."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as sl

from ...typing import Array
from .model import ReducedModel, ReducedModes

SHARE = 1e-6  # of the largest: smaller directions are left out on both sides, whose product is the error of λ
WORTH = 0.8  # of the unknowns of the model: more than that are not worth a model of their own


@dataclass(frozen=True)
class Restricted:
    """Span Q (r, s) of right and left modes of a model at some points, QᵀQ = 1, and the model on it: its vectors are
    what it takes to the basis of the other."""

    span: Array
    model: ReducedModel

    @staticmethod
    def of(model: ReducedModel, known: Sequence[ReducedModes], *, share: float = SHARE) -> Restricted | None:
        """On the span of modes of the model, but for directions that are ``share`` of the largest; None where that has
        not much fewer unknowns, or points of the model do not take a problem of its size anyway."""
        if model.states is not None or model.whole:
            return None
        sides = [side for modes in known for side in (modes.right, modes.left)]
        directions, size, _ = sl.svd(np.hstack([part for z in sides for part in (z.real, z.imag)]), full_matrices=False)
        span: Array = np.ascontiguousarray(directions[:, size > share * size[0]])
        if span.shape[1] > WORTH * model.size:
            return None
        projected = np.array([span.T @ (term @ span) for term in model.projected])
        sketches = {side: getattr(model, side) @ span for side in ("right_sketch", "left_sketch")}
        return Restricted(span, replace(model, vectors=span, projected=projected, **sketches))

    def modes(self, point: Mapping[str, float]) -> ReducedModes:
        """Modes at a point, not judged, with vectors (s, k)."""
        return self.model.modes(point, judged=False)

    def inside(self, modes: ReducedModes) -> ReducedModes:
        """Modes of the whole model as the span has them."""
        return replace(modes, right=self.span.T @ modes.right, left=self.span.T @ modes.left)

    def outside(self, modes: ReducedModes) -> ReducedModes:
        """Modes on the span as the whole model has them, whose residuals they are judged by."""
        return replace(modes, right=self.span @ modes.right, left=self.span @ modes.left)
