"""Equilibria of few unknowns in dense arrays: to put sparse ones together takes twenty times as long as to solve."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from ..direct.dense import solved
from ..system import System
from ..typing import Array, IntArray, Sparse

SMALL = 200  # unknowns, displacements and normal forces together


@dataclass(frozen=True)
class Small:
    """Stiffness (n, n), rows of contact (m, n) along the normal and along the force, and rows (q, n) of the springs
    beyond the linear."""

    stiffness: Array
    normal: Array
    push: Array
    springs: Array

    @classmethod
    def of(cls, system: System, normal: Sparse, push: Sparse) -> Small | None:
        """Of a system with few unknowns; None of others."""
        if system.size + normal.shape[0] > SMALL:
            return None
        rows = np.zeros((0, system.size)) if system.cubic is None else _dense(system.cubic.rows.free)
        dense = _dense(normal)
        return cls(_dense(system.stiffness), dense, dense if push is normal else _dense(push), rows)

    @np.errstate(all="ignore")  # of friction beyond all bounds: what is not finite has no answer here
    def answer(
        self, tangent: Any, right: Array, springs: tuple[IntArray, Array], rigid: tuple[IntArray, Array, Array],
        scale: float, gap: Array,
    ) -> Array | None:  # fmt: skip
        """Displacements (n,) and multipliers (r,) over ``scale``, as `Equilibrium` asks for them: springs are the nodes
        of finite stiffness that touch and their stiffness, rigid the others, whether each is held (1 or 0), and their
        softness; tangent (n, n), dense, is that of the springs beyond the linear. None where the matrix is too near to
        a singular one to be solved like this."""
        n, (at, stiffness), (bordering, held, softness) = len(right), springs, rigid
        size = n + len(bordering)
        matrix, given = np.zeros((size, size)), np.zeros(size)
        inner = matrix[:n, :n]
        inner += self.stiffness
        if tangent is not None:
            inner += tangent
        given[:n] = right
        if len(at):
            pushing = self.push[at].T * stiffness
            inner += pushing @ self.normal[at]
            given[:n] -= pushing @ gap[at]
        if len(bordering):
            matrix[:n, n:] = -(held[:, None] * self.push[bordering]).T * scale
            matrix[n:, :n] = -held[:, None] * self.normal[bordering] * scale
            matrix[range(n, size), range(n, size)] = softness
            given[n:] = held * scale * gap[bordering]
        return solved(matrix, given)


def _dense(matrix: Any) -> Array:
    return np.asarray(matrix.toarray() if sp.issparse(matrix) else matrix)
