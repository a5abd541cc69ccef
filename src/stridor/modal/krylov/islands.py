"""Growth that begins and ends again between two neighbouring states, of two damped modes that pass each other.

The mean m and the squared half difference s of two eigenvalues are smooth in μ where the two are not. The complex
cubics through both and their slopes at both ends of a step say how near the two come, and whether the one, m + √s,
would grow there. Where they do, it is looked at, and again closer by, as the cubics of a shorter step know better.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...typing import Array, BoolArray, ComplexArray, IntArray
from ..dense_problem import Eigenpairs, OverNumber
from ..tolerances import UNSTABLE_RELATIVE
from .follow import BranchState, halves
from .passages import Passage

LOOKED = np.linspace(0.0, 1.0, 17)  # of a step, where the cubics of all pairs are formed
NEARER = 0.5  # of the smaller end: squared half differences that come down to it within the step
PROBES = 8
KNOWN = 0.1  # of the square of the mean decay: squared half differences foretold to that are known
REAL = 1e-6  # imaginary part of a root that counts as real
WIDER = 4.0  # by which a place beside growth is moved away until nothing grows there
FIRST = 1e-4  # of the way to the end of the step: the nearest such place


@dataclass(frozen=True)
class _Pair:
    """Two eigenvalues at one μ by their mean and squared half difference, with slopes over μ."""

    mu: float
    mean: complex
    mean_slope: complex
    square: complex
    square_slope: complex


def islands(source: OverNumber, old: BranchState, new: BranchState) -> list[Passage]:
    """Beginnings and ends of growth of pairs of which neither grows at both states. One that growth rates by themselves
    tell as well is found twice."""
    found: list[Passage] = []
    for i, j in _candidates(old, new) if source.damped else ():
        first, last = (_pair(s.mu, s.values[[i, j]], s.tangents[[i, j]]) for s in (old, new))
        seen = _growing_between(source, first, last)
        if seen is None:
            continue
        mu, low, high = seen
        before = _outside(source, mu, old.mu, low, high)
        after = _outside(source, mu, new.mu, low, high)
        starts = [_state(source, old, new, at, (i, j), low, high) for at in (before, mu)]
        found.append(Passage("crossing", before, mu, i, j, False, (0j, 0j), starts[0]))
        found.append(Passage("crossing", mu, after, i, j, True, (0j, 0j), starts[1]))
    return found


def _candidates(old: BranchState, new: BranchState) -> list[tuple[int, int]]:
    """Pairs of branches that do not grow at both ends and that the cubics bring together, or let grow, in between."""
    step = new.mu - old.mu
    x, y = old.values, new.values
    slopes = step * old.tangents, step * new.tangents
    still = (x.real <= UNSTABLE_RELATIVE * np.abs(x)) & (y.real <= UNSTABLE_RELATIVE * np.abs(y))
    own = np.flatnonzero(still & (x.imag > 0) & (y.imag > 0) & np.isfinite(slopes[0]) & np.isfinite(slopes[1]))
    i, j = (own[k] for k in np.triu_indices(len(own), 1))
    if not len(i):
        return []
    h, k = ((v[i] - v[j]) / 2 for v in (x, y))
    turn, turn_to = h * (slopes[0][i] - slopes[0][j]), k * (slopes[1][i] - slopes[1][j])
    square = _cubic(h * h, k * k, turn, turn_to, LOOKED[:, None])
    mean, mean_to, rate, rate_to = ((v[i] + v[j]) / 2 for v in (x, y, *slopes))
    grows = _cubic(mean, mean_to, rate, rate_to, LOOKED[:, None]).real + np.abs(np.sqrt(square).real) > 0.0
    near = np.abs(square).min(axis=0) < NEARER * np.minimum(np.abs(h), np.abs(k)) ** 2
    # Where they pass each other right beside an end its own slope says so.
    near |= _comes_near(h * h, turn) | _comes_near(k * k, -turn_to)
    # What is far apart all along is no pair, whatever a cubic makes of the slopes of others.
    chosen = np.flatnonzero(near | (grows[1:-1].any(axis=0) & (np.abs(square).min(axis=0) < np.abs(h) ** 2)))
    order = np.argsort(np.abs(square).min(axis=0)[chosen], kind="stable")
    return [(int(i[k]), int(j[k])) for k in chosen[order]]


def _comes_near(square: ComplexArray, change: ComplexArray) -> BoolArray:
    """Whether squared half differences (k,) come within NEARER of zero in a step that changes them so, if straight."""
    with np.errstate(all="ignore"):
        part = -np.real(square * change.conj()) / np.abs(change) ** 2
        near: BoolArray = (part > 0.0) & (part < 1.0) & (np.abs(square + part * change) < NEARER * np.abs(square))
    return near


def _growing_between(source: OverNumber, low: _Pair, high: _Pair) -> tuple[float, _Pair, _Pair] | None:
    """A μ at which one of the two grows, with the ends of the part of the step that it is known by; None where none is
    found: where nothing grows by cubics that foretold the last place looked at well enough to say so."""
    known, sure = [low, high], False
    for _ in range(PROBES):
        parts = [(one, other, at, fast) for one, other in pairwise(known) for at, fast in _worth(one, other, sure=sure)]
        if not parts:
            return None
        one, other, at, _ = max(parts, key=lambda part: part[3])
        mu = one.mu + at * (other.mu - one.mu)
        if not one.mu < mu < other.mu:
            return None
        mean, square = _between(one, other, at)
        found = source.eigenpairs(mu)
        places = _places(found, mean, square)
        values = found.values[places]
        if np.any(values.real > UNSTABLE_RELATIVE * np.abs(values)):
            return mu, one, other
        here = _pair(mu, values, found.tangents[places])
        if not np.isfinite(here.square_slope):
            return None
        # Growth is where Re √s is more than the mean decay.
        sure = abs(here.square - square) <= KNOWN * mean.real**2
        known = sorted([*known, here], key=lambda pair: pair.mu)
    return None


def _worth(low: _Pair, high: _Pair, *, sure: bool) -> list[tuple[float, float]]:
    """Places in (0, 1) of a part of a step that are worth a look, each with what grows there by the cubics [1/s]: where
    that is most and more than nothing, else, unless the cubics are ``sure``, where the two are nearest."""
    step = high.mu - low.mu
    a = _coefficients(low.square, high.square, step * low.square_slope, step * high.square_slope)
    turns = [t for t in (*_turns(np.polyder(a[::-1].real)), *_nearest(a)) if 0.0 < t < 1.0]
    if not turns:
        return []
    ahead = [_between(low, high, t) for t in turns]
    growth = [mean.real + abs(np.sqrt(square).real) for mean, square in ahead]
    best = int(np.argmax(growth))
    if growth[best] > 0.0:
        return [(turns[best], growth[best])]
    near = int(np.argmin([abs(square) for _, square in ahead]))
    apart = min(abs(low.square), abs(high.square))
    return [] if sure or abs(ahead[near][1]) >= apart else [(turns[near], growth[near])]


def _outside(source: OverNumber, mu: float, end: float, low: _Pair, high: _Pair) -> float:
    """A μ from one at which a pair grows towards an end of the step, at which neither does."""
    part = FIRST
    while part < 1.0:
        at = mu + part * (end - mu)
        found = source.eigenpairs(at)
        inside = min(max((at - low.mu) / (high.mu - low.mu), 0.0), 1.0)
        values = found.values[_places(found, *_between(low, high, inside))]
        if not np.any(values.real > 0.0):
            return float(at)
        part *= WIDER
    return end


def _state(
    source: OverNumber, old: BranchState, new: BranchState, mu: float, pair: tuple[int, int], low: _Pair, high: _Pair
) -> BranchState:
    """All branches at a μ within the step, the first of the pair the one of both that grows faster."""
    if mu == old.mu:
        return old
    found = source.eigenpairs(mu)
    part = (mu - old.mu) / (new.mu - old.mu)
    guess = (1 - part) * old.coordinate + part * new.coordinate
    index = np.argmin(np.abs(guess[:, None] - found.coordinate), axis=1)
    inside = min(max((mu - low.mu) / (high.mu - low.mu), 0.0), 1.0)
    places = _places(found, *_between(low, high, inside))
    index[list(pair)] = places[np.argsort(-found.values[places].real)]
    return BranchState(found, index)


def _places(found: Eigenpairs, mean: complex, square: complex) -> IntArray:
    """Where two eigenvalues are among those found, by what the cubics make of them."""
    root = np.sqrt(complex(square))
    distance = np.abs(np.array([[mean + root], [mean - root]]) - found.values)
    places = np.argmin(distance, axis=1)
    return places if places[0] != places[1] else np.argsort(distance.min(axis=0))[:2]


def _pair(mu: float, values: ComplexArray, slopes: ComplexArray) -> _Pair:
    mean, square = halves(*values.tolist())
    turn = complex(values[0] - values[1]) / 2 * complex(slopes[0] - slopes[1])
    return _Pair(mu, mean, complex(slopes.mean()), square, turn)


def _nearest(a: ComplexArray) -> list[float]:
    """Where a complex cubic, lowest coefficient first, comes nearest to zero: d|s|²/dt = 2 Re(s̄ s′) = 0."""
    return _turns(np.polymul(np.conj(a[::-1]), np.polyder(a[::-1])).real)


def _turns(coefficients: Array) -> list[float]:
    """The real roots of a polynomial."""
    if not np.all(np.isfinite(coefficients)):
        return []
    roots = np.roots(coefficients)
    return roots.real[np.abs(roots.imag) <= REAL * (1.0 + np.abs(roots))].tolist()


def _between(low: _Pair, high: _Pair, at: float) -> tuple[complex, complex]:
    """Mean and squared half difference within the step."""
    step = high.mu - low.mu
    mean = _cubic(low.mean, high.mean, step * low.mean_slope, step * high.mean_slope, at)
    square = _cubic(low.square, high.square, step * low.square_slope, step * high.square_slope, at)
    return complex(mean), complex(square)


def _coefficients(start: complex, end: complex, first: complex, second: complex) -> ComplexArray:
    return np.array([start, first, -3 * start + 3 * end - 2 * first - second, 2 * start - 2 * end + first + second])


def _cubic(start: Any, end: Any, first: Any, second: Any, at: float | Array) -> Any:
    """The cubic through values and slopes at both ends, over the step from 0 to 1."""
    c3 = 2 * start - 2 * end + first + second
    c2 = -3 * start + 3 * end - 2 * first - second
    return start + at * (first + at * (c2 + at * c3))
