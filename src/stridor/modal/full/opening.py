"""What becomes of modes that are on the axis at the low end of a family: their power series there.

Where what μ brings is circulatory and gyroscopic, xᵀ(λG + N)x of the real shapes x of modes that nothing damps is
zero: growth opens as μ², and Newton's method, which takes a root of Re λ for a simple one, ends anywhere beside it. Of

    λ(s) = λ₀ + a₁ s + a₂ s² + …,    s = (μ − low)/(high − low),

all orders come from one factorisation of P(λ₀) with a border. With xⱼ = 1, yᵀP(λ₀) = 0 and what lower orders leave of
the k-th power of s in P(λ(s), s) x(s), rₖ,

    aₖ = −yᵀrₖ / yᵀP_λ x₀,    P xₖ = −rₖ − aₖ P_λ x₀.

The same with rounding put in by hand says how good each aₖ is. A mode is told where Re λ(s) becomes more than rounding,
either way, while the series is still good for that: it grows, and began to where Re λ passed zero last, or it decays.
Of all others nothing is said: of modes that are one at the low end or all but that, of those that stay within rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from ...errors import AnalysisError
from ...typing import Array, ComplexArray, Sparse
from ..newton import ON_AXIS, STEPS, Border, BorderedFactor, NewtonPoint, Root, crossing
from ..quadratic.problem import times
from ..tolerances import CONFIRMED, UNSTABLE_RELATIVE
from .family import ROLES, Family

ORDERS = 24  # of s: what grows so slowly that it is seen late must still be led to
SIMPLE = 1e-6  # of |λ|: modes that are no further apart are not told
CLEARLY = 1.2  # times rounding: growth that is counted whoever counts
TAIL, LAST = 0.01, 10  # of rounding: what the last orders may be, and how many these are
NOISE = 1e-15  # of what sums are made of: rounding put in by hand
DEGREE = 5.0  # and how many times that for each further power of μ in the matrices, which divided differences spoil
RUNS, SPREAD = 2, 5.0  # how often that is done, and how many times what it changes a coefficient may be off
AT_ONCE = 1e-6  # of the range: what decays no further than that first begins to grow at the low end
UNSURE = 1e-3  # of where growth is seen: and up to where rounding may hide which of both it does
FINE = np.logspace(-10.0, 0.0, 4001)  # of how far the series is good: where its real part is looked at


@dataclass(frozen=True)
class Opening:
    """A simple mode of the low end that is told.

    root: where it begins to grow, in the full problem, with the slope 0 where Re λ opens as μ² or a higher power; None
    where it decays. series: λ [1/s] over s of the problem that is searched. until: the t = μ − low at which its growth,
    or decay, is more than rounding; width: t at the high end.
    """

    root: Root | None
    series: ComplexArray
    until: float
    width: float

    def at(self, t: float) -> complex:
        """λ [1/s] at t up to ``until``."""
        return complex(np.polyval(self.series[::-1], t / self.width))

    def among(self, values: ComplexArray, t: float) -> int | None:
        """The place of the mode among all eigenvalues λ (k,) [1/s] at t, whose real parts may have been taken for
        rounding; None where that is not beyond doubt."""
        lam = self.at(t)
        rounding = UNSTABLE_RELATIVE * abs(lam)
        near = np.flatnonzero(np.abs(values - lam) <= 10 * rounding)
        return int(near[0]) if len(near) == 1 and abs(values[near[0]] - lam) <= 1.5 * rounding else None


def told(family: Family, lam: complex, x: ComplexArray, y: ComplexArray) -> Opening | None:
    """What becomes of the simple mode near λ [1/s] with vectors x and y (n,) that is on the axis at the low end; None
    where that cannot be told."""
    if family.reversible or family.form is None or not family.exact:
        return None
    border = Border(family, x, y)
    try:
        settled = _on_axis(family, border, lam)
        if settled is None:
            return None
        lam, here = settled
        series, doubt = _series(family, border, lam, here)
    except AnalysisError:
        return None
    residual = family.backward_error(family.low, lam, here.x)
    if not (np.all(np.isfinite(series)) and np.all(np.isfinite(doubt)) and residual <= CONFIRMED):
        return None
    seen = _seen(series, doubt)
    if seen is None:
        return None
    width, (until, grows, first, last) = family.high - family.low, seen
    opening = Opening(None, series, until * width, width)
    if not grows:
        return opening
    if first <= AT_ONCE and last <= UNSURE * until:
        rate = float(series[1].real)
        # What is rounding all over the range is the matrices' own, as on a basis.
        slope = rate / width if rate > max(float(doubt[1]), TAIL * UNSTABLE_RELATIVE * abs(lam)) else 0.0
        return replace(opening, root=Root(family.low, 1j * lam.imag, here.x, slope, None, residual, here.y))
    if last - first > AT_ONCE:
        return None
    start = 0.5 * (first + last) * width
    between = family.low + first * width, family.low + until * width
    root = crossing(family, family.low + start, opening.at(start), here.x, here.y, between)
    near = root is not None and abs(root.mu - family.low - start) <= AT_ONCE * width and (root.slope or 0.0) > 0
    return replace(opening, root=root) if near else None


def _on_axis(family: Family, border: Border, lam: complex) -> tuple[complex, NewtonPoint] | None:
    """The eigenvalue at the low end near λ and what is known there; None where that does not settle on the axis."""
    lam = 1j * lam.imag
    for _ in range(STEPS):
        here = border.at(lam, family.low)
        if here.by_lam == 0:
            return None
        step = -here.g / here.by_lam
        lam += 1j * step.imag if family.neutral else step
        if abs(step) <= ON_AXIS * abs(lam):
            return (lam, here) if abs(lam.real) <= UNSTABLE_RELATIVE * abs(lam) else None
    return None


def _seen(series: ComplexArray, doubt: Array) -> tuple[float, bool, float, float] | None:
    """The s at which Re λ is clearly more than rounding, whether it grows there, and between which two s Re λ passes
    zero last before that; None where the series does not lead so far."""
    least = UNSTABLE_RELATIVE * float(abs(series[0]))
    orders = np.arange(len(series) - LAST, len(series))  # more than four: every other one may be zero
    with np.errstate(all="ignore"):
        reach = float(np.min((TAIL * least / np.abs(series[orders])) ** (1.0 / orders)))
    s = min(reach, 1.0) * FINE
    rate, off = np.polyval(series.real[::-1], s), np.polyval(doubt[::-1], s)
    clear = np.flatnonzero(np.abs(rate) >= CLEARLY * least)
    if not len(clear) or off[clear[0]] > 0.05 * least:
        return None
    end = int(clear[0])
    first, last = (_passed(series.real + way * doubt, s[: end + 1]) for way in (1, -1))
    return float(s[end]), bool(rate[end] > 0), first, last


def _passed(coefficients: Array, s: Array) -> float:
    """Where a polynomial is last not positive on the way to the last of values s (k,), 0 where nowhere."""
    below = np.flatnonzero(np.polyval(coefficients[::-1], s) <= 0)
    if not len(below) or below[-1] + 1 == len(s):
        return float(s[below[-1]]) if len(below) else 0.0
    low, high = s[below[-1]], s[below[-1] + 1]
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if np.polyval(coefficients[::-1], middle) <= 0 else (low, middle)
    return float(low)


def _series(family: Family, border: Border, lam: complex, here: NewtonPoint) -> tuple[ComplexArray, Array]:
    """Coefficients (ORDERS + 1,) [1/s] of λ over s, and how far the real part of each may be off."""
    terms, problem = _powers(family), family.at(family.low)
    noise = NOISE * DEGREE ** max(max(len(matrices) for matrices in terms) - 2, 0)
    factor = family.bordered(problem, lam, border)
    sizes = [_sizes(matrices) for matrices in terms]
    try:
        made = _Made(terms, sizes, factor, lam, problem.slope(lam, here.x))
        series = made.run(here.x, here.y)
        doubt = np.zeros(ORDERS + 1)
        # Where nothing is seen it does not matter how good it is.
        for seed in range(RUNS if _seen(series, doubt) else 0):
            rng = np.random.default_rng(seed)
            x, y = (
                v + made.solved(noise * _signs(rng, len(v)) * made.size(v, transposed), transposed)
                for v, transposed in ((here.x, False), (here.y, True))
            )
            doubt = np.maximum(doubt, SPREAD * np.abs((made.run(x, y, noise, rng) - series).real))
    finally:
        factor.free()
    doubt[0] = 0.0 if family.neutral else NOISE * abs(lam)
    return series, doubt


def _signs(rng: np.random.Generator, count: int) -> Array:
    return rng.choice([-1.0, 1.0], count)


def _sizes(matrices: Sequence[Sparse]) -> list[Sparse]:
    """What the entries of the matrices of each power of s are made of: those that vary, of what they are at any s."""
    varying = sum((abs(m) for m in matrices[1:]), sp.csr_array(matrices[0].shape))
    size = sp.csr_array((abs(matrices[0]) + varying).multiply(varying != 0))
    return [abs(matrices[0]), *(size for _ in matrices[1:])]


@dataclass(frozen=True)
class _Made:
    """A series in the making: of M, D and K the matrices of each power of s and what these are made of, factors of
    P(λ₀) with its border, λ₀ and P_λ x₀ (n,)."""

    terms: Sequence[Sequence[Sparse]]
    sizes: Sequence[Sequence[Sparse]]
    factor: BorderedFactor
    lam: complex
    along: ComplexArray

    def size(self, v: ComplexArray, transposed: bool) -> Array:
        """What P(λ₀)v, or P(λ₀)ᵀv, (n,) is made of."""
        first = [sizes[0].T if transposed else sizes[0] for sizes in self.sizes]
        parts = [abs(self.lam) ** (2 - k) * (matrix @ np.abs(v)) for k, matrix in enumerate(first)]
        total: Array = np.sum(parts, axis=0)
        return total

    def solved(self, right: ComplexArray | Array, transposed: bool = False) -> ComplexArray:
        """What P(λ₀) with its border takes to a right side (n,) and 0."""
        return self.factor.solve(np.append(right.astype(complex), 0.0), transpose=transposed)[:-1]

    def run(
        self, x: ComplexArray, y: ComplexArray, noise: float = 0.0, rng: np.random.Generator | None = None
    ) -> ComplexArray:
        """Coefficients (ORDERS + 1,) from vectors x and y (n,), with noise in every sum."""
        values = np.zeros(ORDERS + 1, dtype=complex)
        vectors = np.zeros((len(x), ORDERS + 1), dtype=complex)
        values[0], vectors[:, 0] = self.lam, x
        for k in range(1, ORDERS + 1):
            rest, size = self._rest(values, vectors, k)
            if rng is not None:
                rest = rest + noise * size * (_signs(rng, len(x)) + 1j * _signs(rng, len(x)))
            values[k] = -(y @ rest) / (y @ self.along)
            vectors[:, k] = self.solved(-rest - values[k] * self.along)
        return values

    def _rest(self, values: ComplexArray, vectors: ComplexArray, order: int) -> tuple[ComplexArray, Array]:
        """The coefficient (n,) of s^order in P(λ(s), s) x(s), where those of that order in λ and x are still zero, and
        what it is made of."""
        powers: tuple[Array | ComplexArray, ...] = np.convolve(values, values), values, np.array([1.0])
        rest, size = np.zeros(len(vectors), dtype=complex), np.zeros(len(vectors))
        for matrices, sizes, power in zip(self.terms, self.sizes, powers, strict=True):
            for m in range(min(order + 1, len(matrices))):
                count = min(order + 1 - m, len(power))
                these = vectors[:, order - m - np.arange(count)]
                rest += times(matrices[m], these @ power[:count])
                size += sizes[m] @ (np.abs(these) @ np.abs(power[:count]))
        return rest, size


def _powers(family: Family) -> list[list[Sparse]]:
    """Of M, D and K the matrices of each power of s."""
    assert family.form is not None, "asked for families that have one"
    width, result = family.high - family.low, list[list[Sparse]]()
    for role in ROLES:
        form = family.form[role]
        degree = len(form.matrices)
        weights, product = np.zeros((degree, degree)), np.ones(1)
        for k in range(degree):
            weights[k, : k + 1] = product[::-1]
            if k + 1 < degree:
                product = np.convolve(product, [width, family.low - form.nodes[k]])
        result.append([form.sum(weights[:, power]) for power in range(degree)])
    return result
