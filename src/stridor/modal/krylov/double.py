"""Where modes of the projected problem that nothing damps meet, or come to rest: double roots."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...typing import ComplexArray
from ..dense_problem import DenseProblem
from ..newton import exceptional
from ..newton import meeting as double_root
from ..tolerances import UNSTABLE_RELATIVE
from .crossing import Solved, root_between
from .follow import halves
from .passages import Passage
from .undamped import squares_of


def meeting(reduced: DenseProblem, passage: Passage) -> Solved | None:
    """Where two undamped modes meet: their squared half difference passes through zero, with a finite slope."""
    quick = _quick_meeting(reduced, passage)
    if quick is not None:
        return quick
    closed = _closed_meeting(reduced, passage)
    if closed is None:
        return None
    mu, mean, slope = closed
    omega = float(np.sqrt(-mean))
    return Solved(mu, 1j * omega, float(np.sqrt(abs(slope)) / (2 * omega)))


def double(reduced: DenseProblem, passage: Passage) -> Solved | None:
    """The same in a problem that is damped, of modes that are not: by Newton for a double root on the axis, from the
    middle of the passage, else from where their squared half difference passes through zero. None where the two do not
    meet on the axis."""
    between = passage.low, passage.high

    def solved(mu: float, mean: float) -> Solved | None:
        lam = 1j * np.sqrt(max(-mean, 0.0))
        root = None if not lam else double_root(reduced, mu, lam, *reduced.null_vectors(lam, mu), between)
        if root is None or root.square is None or (root.square < 0) != passage.stabilising:
            return None
        slack = 1e-6 * (passage.high - passage.low)
        if not between[0] - slack <= root.mu <= between[1] + slack or not _between_means(passage, root.lam):
            return None
        return Solved(root.mu, root.lam, float(np.sqrt(abs(root.square))))

    quick = solved(sum(between) / 2, float(sum(passage.means).real) / 2)
    if quick is not None:
        return quick
    closed = _closed_meeting(reduced, passage)
    return None if closed is None else solved(*closed[:2])


def _between_means(passage: Passage, lam: complex) -> bool:
    """Whether λ is where the pair can be, which its frequencies at both ends bound: elsewhere it is another one's
    meeting."""
    squares = sorted(m.real for m in passage.means)
    margin = 1e-3 * abs(sum(passage.means) / 2) + 2 * (squares[1] - squares[0])
    return squares[0] - margin <= (lam**2).real <= squares[1] + margin


def _closed_meeting(reduced: DenseProblem, passage: Passage) -> tuple[float, float, float] | None:
    """μ, mean λ² < 0 and slope of the squared half difference of the pair's λ² where that passes through zero, by
    bisection; None where it does not."""
    width = passage.high - passage.low

    def pair(mu: float) -> tuple[complex, complex]:
        part = (mu - passage.low) / width
        guess = (1 - part) * passage.means[0] + part * passage.means[1]
        return pair_near(squares_of(reduced, reduced.eigenpairs(mu))[0], guess)

    def square(mu: float) -> float:
        return float(pair(mu)[1].real)

    mu = root_between(square, passage.low, passage.high)
    if mu is None:
        return None
    mean, _ = pair(mu)
    if not mean.real < 0:
        return None
    return mu, float(mean.real), _slope(square, mu, passage)


def _quick_meeting(reduced: DenseProblem, passage: Passage) -> Solved | None:
    """The same by Newton from the middle of the passage; None where that does not settle inside it."""
    mean = (passage.means[0] + passage.means[1]) / 2
    if not mean.real < 0:
        return None
    lam, mu = 1j * np.sqrt(-mean.real), (passage.low + passage.high) / 2
    found = exceptional(reduced, mu, lam, *reduced.null_vectors(lam, mu), reach=passage.high - passage.low)
    if found is None:
        return None
    mu, lam, square = found
    slack = 1e-6 * (passage.high - passage.low)
    inside = passage.low - slack <= mu.real <= passage.high + slack
    near = _between_means(passage, lam)
    on_axis = abs(mu.imag) <= 1e-9 * abs(mu) and abs(lam.real) <= 1e-9 * abs(lam)
    opens = -square.real if passage.stabilising else square.real
    if not (inside and near and on_axis and opens > 0):
        return None
    return Solved(float(mu.real), 1j * abs(lam.imag), float(np.sqrt(opens)))


def _slope(square: Callable[[float], float], mu: float, passage: Passage) -> float:
    """The slope at ``mu`` of what passes through zero there, from values in the passage alone: there may be none
    beyond."""
    step = min(1e-4 * max(mu, 1e-3), 0.25 * (passage.high - passage.low))
    low, high = max(mu - step, passage.low), min(mu + step, passage.high)
    return (square(high) - square(low)) / (high - low)


def divergence(reduced: DenseProblem, passage: Passage) -> Solved | None:
    """Where λ² of an undamped mode passes through zero."""

    def square(mu: float) -> float:
        coordinate, _ = squares_of(reduced, reduced.eigenpairs(mu))
        still = coordinate[np.abs(coordinate.imag) <= UNSTABLE_RELATIVE * reduced.frequency**2]
        return float(still[np.argmin(np.abs(still))].real) if len(still) else float("nan")

    mu = root_between(square, passage.low, passage.high)
    if mu is None:
        return None
    return Solved(mu, 0j, float(np.sqrt(abs(_slope(square, mu, passage)))))


def pair_near(coordinate: ComplexArray, target: complex) -> tuple[complex, complex]:
    """Mean and squared half difference of the two eigenvalues nearest to a place."""
    near = np.argsort(np.abs(coordinate - target))[:2]
    return halves(*coordinate[near])
