"""How many eigenvalues a rectangle holds, by the argument principle; and a hint from the signs of pivots."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from ...direct import factorise
from ...direct.dense import lu_factors
from ...errors import AnalysisError
from ...typing import Array, ComplexArray, IntArray
from .problem import Quadratic
from .region import Region

DENSE = 150  # freedoms up to which determinants are taken of full matrices
MOST = 600  # determinants at most
BEND = 4.0  # by which the slope of log det, freed of what is known, may change the phase of one piece of contour [rad]
AGREED = 0.4  # and by how much the change may differ from what the slopes at both ends expect
CANDIDATES = 9  # candidates for each side of the contour


def unknown(problem: Quadratic, inner: Region, outer: Region, known: ComplexArray) -> int | None:
    """Eigenvalues around which a contour between two rectangles runs, less the ``known`` (k,) it encloses.

    The winding number of det P(z) / Π(z − λ) over all known λ, those outside included: each takes its own quick turn
    of the phase out, and what is left turns slowly as long as none near the contour is missing. Negative where known
    ones are no eigenvalues or counted twice. None where the phase does not settle.
    """
    contour = between(inner, outer, known)
    left, right, low, high = contour.re_min, contour.re_max, contour.im_min, contour.im_max
    corners = [complex(left, low), complex(right, low), complex(right, high), complex(left, high), complex(left, low)]
    held: dict[complex, tuple[complex, complex]] = {}
    small = 1e-4 * max(contour.width, contour.height)

    def one(z: complex) -> complex:
        # Lengths in units of the contour: only differences of the logarithm matter.
        return log_det(problem, z) - complex(np.log((z - known) / contour.scale).sum())

    def log(z: complex) -> tuple[complex, complex]:
        if z not in held:
            if 2 * len(held) >= MOST:
                raise _Unsettled
            here = one(z)
            held[z] = here, _step(here, one(z + small)) / small
        return held[z]

    turns = 0.0
    try:
        for a, b in pairwise(corners):
            points = [a + (b - a) * k / 4 for k in range(5)]
            turns += sum(_turn(log, p, q, 0) for p, q in pairwise(points))
    except _Unsettled:
        return None
    return round(turns / (2 * math.pi))


def between(inner: Region, outer: Region, known: ComplexArray) -> Region:
    """A rectangle between the two that keeps away from the ``known``."""
    share = np.linspace(0.15, 0.95, CANDIDATES)

    def best(name: str, parts: Array) -> float:
        candidates = getattr(inner, name) + share * (getattr(outer, name) - getattr(inner, name))
        distance = np.abs(candidates[:, None] - parts).min(axis=1, initial=np.inf)
        return float(candidates[int(np.argmax(np.minimum(distance, abs(candidates[1] - candidates[0]))))])

    return replace(
        inner, re_min=best("re_min", known.real), re_max=best("re_max", known.real),
        im_min=best("im_min", known.imag), im_max=best("im_max", known.imag),
    )  # fmt: skip


def log_det(problem: Quadratic, z: complex) -> complex:
    """Logarithm of det P(z), its imaginary part up to multiples of 2π."""
    matrix = problem.at(complex(z))
    if matrix.shape[0] <= DENSE:
        factors, pivots = lu_factors(matrix.toarray(), check_finite=False)
        diagonal, odd = np.diag(factors), int((pivots != np.arange(len(pivots))).sum()) % 2
    else:
        given = sp.csc_array(matrix)
        try:
            held = spl.splu(given, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options={"SymmetricMode": True})
        except RuntimeError as error:
            raise _Unsettled from error
        diagonal, odd = held.U.diagonal(), (_odd(held.perm_r) + _odd(held.perm_c)) % 2
    if not (np.abs(diagonal) > 0).all():
        raise _Unsettled
    return complex(np.log(diagonal.astype(complex)).sum() + 1j * math.pi * odd)


def undamped_count(problem: Quadratic, region: Region, *, solver: str | None = None) -> int | None:
    """Undamped frequencies of the symmetric parts of K and M in the region's band, by Sylvester's law of inertia.

    A hint of how many modes to expect where damping, gyroscopic and circulatory forces are small, no more. None where
    the solver tells no signs or a matrix is singular. Takes two factorisations.
    """
    mass, stiffness = (sp.csr_array((m + m.T) / 2) for m in (problem.mass, problem.stiffness))
    counts: list[int] = []
    for end in (region.bounded().im_min, region.im_max):
        square = end**2 if end > 0 else -1e-8 * region.im_max**2
        try:
            with factorise(sp.csr_array(stiffness - square * mass), symmetric=True, solver=solver) as factor:
                if factor.inertia is None:
                    return None
                counts.append(factor.inertia)
        except AnalysisError:
            return None
    return counts[1] - counts[0]


class _Unsettled(Exception):
    """The contour runs into a zero, or takes too many determinants."""


def _turn(log: Callable[[complex], tuple[complex, complex]], a: complex, b: complex, depth: int) -> float:
    """Change of phase from a to b [rad], from log g and its slope at both.

    The slopes tell how many full turns there are between; the way is halved until they agree with each other, and the
    change with them.
    """
    (first, slope), (last, other) = log(a), log(b)
    expected = (slope + other) / 2 * (b - a)
    change = expected + _step(expected, last - first)
    if abs(slope - other) * abs(b - a) < BEND and abs(change - expected) < AGREED:
        return change.imag
    if depth > 24:
        raise _Unsettled
    middle = (a + b) / 2
    return _turn(log, a, middle, depth + 1) + _turn(log, middle, b, depth + 1)


def _step(a: complex, b: complex) -> complex:
    change = b - a
    return complex(change.real, math.remainder(change.imag, 2 * math.pi))


def _odd(order: IntArray) -> int:
    """Parity of a permutation, by its cycles."""
    seen, cycles = np.zeros(len(order), dtype=bool), 0
    for first in range(len(order)):
        if not seen[first]:
            cycles += 1
            index = first
            while not seen[index]:
                seen[index] = True
                index = int(order[index])
    return (len(order) - cycles) % 2
