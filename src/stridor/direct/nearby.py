"""Equations whose matrices change a little from one to the next, with one factorisation for many of them.

Where little differs from the matrix whose factors are there, as where a few contacts open, its inverse is known
(`updated`). Else these factors precondition GMRES on the present one, which begins with the combination of the last
answers that leaves least: where contacts rub a little more a handful of solutions does for a factorisation. The answer
is as good as a factorisation's, or it is not taken.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Hashable, Sequence
from functools import partial
from typing import Any

import numpy as np
import scipy.sparse.linalg as sla

from ..typing import Array, Sparse
from .backends import VARIABLE
from .factor import BACKWARD_ERROR, Factor, SingularMatrix, Sizes, factorise
from .updated import Updated

LEAST = 3000  # unknowns from which on solving is so much cheaper than factorising that it pays
SMALL = 1000  # unknowns up to which SuperLU answers, unless another is named: others spend more on the call than on it
LARGEST = 600e6  # bytes of factors that are kept from one matrix to the next
STEPS = 15  # of GMRES; where more are needed, factors of the matrix itself cost no more
ENOUGH = 1e-13  # of the right side, by their estimate: what is left after a round of them
ROUNDS = 3
REMEMBERED = 10  # answers
GROWN = 1e3  # times the first answer: what is that much larger may come from a matrix that is all but singular


class Nearby:
    """Solves one system after the other, real and square, with the factors of one of them as long as they serve.

    It holds the memory of these factors until `free`. factorisations counts them.
    """

    def __init__(self) -> None:
        self.factorisations = 0
        self._factor: Factor | None = None
        self._matrix: Sparse | None = None
        self._asked: tuple[int, str | None] = (0, None)
        self._length = 0.0
        self._answers: deque[Array] = deque(maxlen=REMEMBERED)
        self._regular: set[Hashable] = set()

    def solve(
        self,
        matrix: Sparse,
        right: Array,
        *,
        kind: Hashable = None,
        symmetric: bool = False,
        saddle: bool = False,
        solver: str | None = None,
    ) -> Array:
        """A⁻¹ b (n,), to the backward error of `Factor.solve`. symmetric, saddle and solver are those of `factorise`.

        kind: what matrices that are regular or singular together have in common; the first of a kind is tried with
        another right side as well, which a singular one cannot answer. Raises SingularMatrix where A has no inverse.
        """
        asked = len(right), solver
        if asked != self._asked:
            self._answers.clear()
            self._regular.clear()
            self.free()
        found = None if self._factor is None else self._by_earlier(matrix, right, probed=kind not in self._regular)
        if found is not None:
            self._answers.append(found)
            self._regular.add(kind)
            return found
        self.free()
        self.factorisations += 1
        free = solver is None and not os.environ.get(VARIABLE)
        chosen = "superlu" if free and len(right) <= SMALL else solver
        factor = factorise(matrix, symmetric=symmetric, saddle=saddle, solver=chosen)
        found = np.asarray(factor.solve(right))
        if len(right) < LEAST or factor.memory_bytes > LARGEST:
            factor.free()
        else:
            self._factor, self._asked, self._length = factor, asked, float(np.linalg.norm(found))
            self._matrix = matrix
            self._answers.append(found)
            self._regular.add(kind)
        return found

    def free(self) -> None:
        """Give the memory of the factors back; the next matrix is factorised again."""
        if self._factor is not None:
            self._factor.free()
            self._factor = self._matrix = None

    def _by_earlier(self, matrix: Sparse, right: Array, *, probed: bool) -> Array | None:
        """The answer (n,) by the factors at hand; None where they do not lead to it, or, probed, not to that of another
        right side."""
        assert self._factor is not None, "asked for where there is one"
        assert self._matrix is not None
        probes = [float(np.linalg.norm(right)) * _start(len(right))] if probed else []
        try:
            updated = Updated.of(self._factor, self._matrix, matrix)
            if updated is not None:
                return self._by_update(updated, matrix, np.stack([right, *probes], axis=1))
        except (SingularMatrix, np.linalg.LinAlgError):
            return None
        found = self._by_steps(matrix, right, self._answers)
        if found is None or any(self._by_steps(matrix, probe, ()) is None for probe in probes):
            return None
        return found

    def _by_update(self, updated: Updated, matrix: Sparse, rights: Array) -> Array | None:
        """The answer (n,) to the first of the right sides (n, k), all of which have one that is not too large."""
        sizes = Sizes.of(matrix)
        answer, first = updated.solve(rights)
        longest = GROWN * np.maximum(self._length, np.linalg.norm(first, axis=0))
        for _ in range(ROUNDS):
            rest, error = sizes.residual(matrix, rights, answer)
            if not np.all(np.linalg.norm(answer, axis=0) <= longest):
                return None
            if error <= BACKWARD_ERROR:
                return answer[:, 0]
            answer = answer + updated.solve(rest)[0]
        return None

    def _by_steps(self, matrix: Sparse, right: Array, known: Sequence[Array]) -> Array | None:
        """The answer by GMRES with the factors at hand, from known ones (n,) on; None where they do not lead to it."""
        factor, n = self._factor, len(right)
        assert factor is not None
        before: Any = sla.LinearOperator((n, n), matvec=partial(factor.solve, refine=False), dtype=float)  # type: ignore[call-arg]
        sizes = Sizes.of(matrix)
        longest = GROWN * max(self._length, float(np.linalg.norm(before @ right)))
        answer = _nearest(matrix, right, known)
        for _ in range(ROUNDS):
            rest, error = sizes.residual(matrix, right[:, None], answer[:, None])
            if error <= BACKWARD_ERROR:
                return answer
            left = float(np.linalg.norm(rest))
            enough = min(max(ENOUGH * float(np.linalg.norm(right)) / left, 1e-13), 1e-3)
            step: Any = sla.gmres(matrix, rest[:, 0], M=before, rtol=enough, atol=0.0, restart=STEPS, maxiter=1)[0]
            answer = answer + step
            if not float(np.linalg.norm(answer)) <= longest:
                return None
        error = sizes.residual(matrix, right[:, None], answer[:, None])[1]
        return answer if error <= BACKWARD_ERROR else None


def _nearest(matrix: Sparse, right: Array, known: Sequence[Array]) -> Array:
    """The combination (n,) of known answers that leaves least of the right side."""
    if not known:
        return np.zeros(len(right))
    answers = np.stack(known, axis=1)
    weights: Any = np.linalg.lstsq(matrix @ answers, right, rcond=1e-14)[0]
    return answers @ weights


def _start(n: int) -> Array:
    """An arbitrary right side (n,) of unit length."""
    block = np.random.default_rng(5).standard_normal(n)
    return block / float(np.linalg.norm(block))
