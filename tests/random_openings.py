"""Random problems whose growth opens at the low end, and what is true of them: dense eigenvalues with error bounds.

Modes that nothing damps at μ = 0, some of them equal or nearly so, under circulatory and gyroscopic forces that grow with
μ; sometimes with damping of either sign that is next to none, with one mode that is damped, or with forces that come as
a higher power of μ; ranges that begin at 0 and elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.linalg as sl

import stridor as st
from matrix_cases import Term, matrix_case

GRID = 40
ROUNDING = 1e-9  # of |λ|: growth that is none
BESIDE = 0.1  # of that: so near it either may be said
ON_ONE = 2e-6  # of the range: values so near an onset are not judged


@dataclass(frozen=True)
class Opening:
    """Terms of M, D and K with their powers of μ, and the range."""

    terms: tuple[tuple[np.ndarray, str, int], ...]
    low: float
    high: float

    def matrices(self, mu: float) -> list[np.ndarray]:
        n = len(self.terms[0][0])
        total = {role: np.zeros((n, n)) for role in ("mass", "damping", "stiffness")}
        for matrix, role, power in self.terms:
            total[role] += mu**power * matrix
        return list(total.values())

    def eigenvalues(self, mu: float) -> tuple[np.ndarray, np.ndarray]:
        """All λ (2n,), and how far each may be off."""
        mass, damping, stiffness = self.matrices(mu)
        root = sl.cholesky(mass, lower=True)
        half = [sl.solve_triangular(root, sl.solve_triangular(root, m, lower=True).T, lower=True).T for m in (damping, stiffness)]
        n = len(mass)
        state = np.block([[np.zeros((n, n)), np.eye(n)], [-half[1], -half[0]]])
        values, left, right = sl.eig(state, left=True, right=True)
        size = np.linalg.norm(left, axis=0) * np.linalg.norm(right, axis=0)
        with np.errstate(all="ignore"):
            condition = size / np.abs(np.einsum("ij,ij->j", left.conj(), right))
        return values, 4 * np.finfo(float).eps * np.linalg.norm(state) * condition

    @property
    def top(self) -> float:
        """Beyond all modes [1/s]."""
        return 3 * max(float(np.abs(self.eigenvalues(mu)[0]).max()) for mu in (self.low, self.high))

    def case(self, folder: Path) -> st.Case:
        factors = {0: "", 1: "mu"}
        terms: list[Term] = [(m, role, factors.get(power, f"mu**{power}")) for m, role, power in self.terms]
        return matrix_case(folder, terms, self.top / (2 * np.pi), (self.low, self.high))


def random_opening(seed: int, most: int = 8) -> Opening:
    """One of 2 to 8 modes, or fewer."""
    rng = np.random.default_rng([seed, 11])
    n = int(rng.integers(2, most + 1))
    squares = rng.uniform(0.5, 3.0, n) ** 2
    alike = rng.random()
    if alike < 0.4:
        # Equal, or nearly: as rounding, and as something that is none.
        squares[1] = squares[0] * (1 + float(rng.choice([0.0, 0.0, 1e-13, 1e-9, 1e-6, 1e-4])))
        if n > 3 and rng.random() < 0.3:
            squares[2] = squares[0]
    turn = np.linalg.qr(rng.standard_normal((n, n)))[0] if rng.random() < 0.6 else np.eye(n)
    scale = 10 ** rng.uniform(-1.0, 0.0) / np.sqrt(n)

    def skew(size: float) -> np.ndarray:
        a = size * rng.standard_normal((n, n))
        if rng.random() < 0.4:
            a *= rng.random((n, n)) < 0.4
        return turn @ (a - a.T) @ turn.T

    def isotropic(size: float, symmetric: bool = False) -> np.ndarray:
        part = np.eye(n) if rng.random() < 0.5 else np.diag((rng.random(n) < 0.5) * rng.uniform(0.5, 1.5, n))
        return size * (turn @ part @ turn.T)

    mass = np.eye(n) if rng.random() < 0.5 else np.diag(rng.uniform(0.5, 2.0, n))
    root = np.sqrt(np.diag(mass))
    stiffness = root[:, None] * (turn @ np.diag(squares) @ turn.T) * root
    terms: list[tuple[np.ndarray, str, int]] = [(mass, "mass", 0), (stiffness, "stiffness", 0)]
    load, power = skew(scale), int(rng.choice([1, 1, 1, 2]))
    terms.append((load, "stiffness", power))
    faint = float(rng.choice([1.0, 1.0, 10 ** rng.uniform(-9.0, -1.0)]))
    kind = rng.random()
    if kind < 0.4:
        terms.append((faint * load, "damping", power))  # in proportion: nothing at first order
    elif kind < 0.8:
        terms.append((faint * skew(scale), "damping", int(rng.choice([0, 1, 1, 2]))))
    else:
        terms.append((faint * scale * rng.standard_normal((n, n)), "damping", int(rng.choice([1, 2, 3]))))
    if rng.random() < 0.5:
        size = float(rng.choice([-1.0, 1.0])) * 10 ** rng.uniform(-12.0, -5.0)
        terms.append((isotropic(size), "damping", int(rng.choice([0, 0, 1, 2]))))
        if rng.random() < 0.4:
            terms.append((-size * 10 ** rng.uniform(-1.0, 3.0) * np.eye(n), "damping", int(rng.choice([1, 2, 3]))))
    if rng.random() < 0.15:
        one = turn[:, :1]
        terms.append((0.1 * one @ one.T, "damping", 0))
    high = float(rng.uniform(0.2, 3.0))
    return Opening(tuple(terms), float(rng.choice([0.0, 0.0, 0.0, rng.uniform(0.01, 0.5) * high])), high)


def wrong(problem: Opening, found: st.Onsets) -> str:
    """What a list of onsets that is said to be complete says otherwise than the eigenvalues; "" for nothing."""
    if not found.complete:
        return ""
    low, high = problem.low, problem.high
    width = high - low
    told = [(o.mu, o.kind, "-" if o.stabilising else "+", 2 * np.pi * o.frequency_hz, o.growth_slope) for o in found.onsets]
    for onset in found.onsets:
        if not low <= onset.mu <= high:
            return f"outside of {low} to {high}: {told}"
        values, off = problem.eigenvalues(onset.mu)
        distance = np.abs(values - 2j * np.pi * onset.frequency_hz)
        size = np.maximum(np.abs(values), 1e-3 * problem.top)
        # Where modes meet rounding is the root of what it is elsewhere; growth that begins all but at the low end is told there.
        near = np.maximum(10 * off, 1e-5 * size if onset.growth_slope is None else abs(onset.growth_slope) * 1e-6 * width)
        if np.all(distance > 2 * ROUNDING * size + near):
            return f"no mode is on the axis there: {onset.mu}: {told}"
    start = growing(problem, low)
    grid = np.linspace(low, high, GRID + 1)[1:] - 1.234e-5 * width
    early = low + width * np.array([1e-5, 1e-4, 1e-3, 3e-3])
    for mu in [*early, *grid]:
        if any(abs(o.mu - mu) <= ON_ONE * width for o in found.onsets):
            continue
        least, most = growing(problem, mu)
        said = sum(o.roots for o in found.onsets if o.mu < mu)
        if not least - start[1] <= said <= most - start[0]:
            return f"{least} to {most} roots grow at {mu:.6g}, {start} at {low:g}: {told} {found.completeness}"
    return ""


def growing(problem: Opening, mu: float) -> tuple[int, int]:
    """How many roots grow at least: beyond rounding; and at most: those included that may, or whose growth is rounding."""
    values, off = problem.eigenvalues(mu)
    rate, least = values.real, ROUNDING * np.abs(values)
    surely = rate > (1 + BESIDE) * least + off
    if not any(role == "damping" for _, role, _ in problem.terms):
        surely &= rate > 1e-6 * np.abs(values)  # rounding of modes that meet
    return int(surely.sum()), int(np.sum(rate > -(1 + BESIDE) * least - off))


def _linear(problem: Opening, mu: float) -> tuple[np.ndarray, np.ndarray]:
    mass, damping, stiffness = problem.matrices(mu)
    n = len(mass)
    first = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
    return first, sl.block_diag(np.eye(n), mass)


def rate(problem: Opening, mu: float, omega: float) -> float:
    """Re λ of the mode nearest to jω, in extended precision throughout."""
    values, vectors = sl.eig(*_linear(problem, mu))
    k = int(np.argmin(np.abs(values - 1j * omega)))
    n = len(vectors) // 2
    total = {role: np.zeros((n, n), dtype=np.longdouble) for role in ("mass", "damping", "stiffness")}
    for matrix, role, power in problem.terms:
        total[role] += np.longdouble(mu) ** power * matrix
    mass, damping, stiffness = total.values()
    lam, x = np.clongdouble(values[k]), vectors[:n, k].astype(np.clongdouble)
    x /= x[np.argmax(np.abs(x))]
    for _ in range(6):
        # Inverse iteration with the shift that moves along, quadratic, from beside the eigenvalue.
        shift = lam * (1 + 1e-9j) + 1e-10 * abs(lam)
        moved = _solved(shift**2 * mass + shift * damping + stiffness, (2 * shift * mass + damping) @ x)
        x = moved / moved[np.argmax(np.abs(moved))]
        # λ of the vector, by its left one: a step of Newton's method.
        left = _solved((shift**2 * mass + shift * damping + stiffness).T, x.conj())
        lam -= left @ (lam**2 * mass @ x + lam * damping @ x + stiffness @ x) / (left @ (2 * lam * mass @ x + damping @ x))
    return float(lam.real)


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Gauss's elimination with pivots, which needs no LAPACK and so keeps all digits."""
    whole = np.column_stack([matrix, right]).astype(np.clongdouble)
    n = len(matrix)
    for k in range(n):
        pivot = k + int(np.argmax(np.abs(whole[k:, k])))
        whole[[k, pivot]] = whole[[pivot, k]]
        whole[k] /= whole[k, k]
        others = np.arange(n) != k
        whole[others] -= whole[others, k : k + 1] * whole[k]
    return whole[:, n]
