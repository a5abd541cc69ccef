"""Random imported matrices along a number q whose problem is singular somewhere: freedoms without mass, multipliers,
motions as a whole. And what is true of them: all finite eigenvalues by QZ of the companion pencil, on a grid of q."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.linalg as sl

import stridor as st
from matrix_cases import matrix_case
from stridor.typing import Array, ComplexArray

KINDS = ("massless", "multipliers", "rigid")
GRID = 160
FAINT = 1e-6  # of |λ|: growth that either side may take for rounding
STILL = 1e-4  # of the band: what is slower is a motion as a whole, or may be one
FAR = 1e3  # of the band: what rounding makes of infinite eigenvalues lies beyond


@dataclass(frozen=True)
class Singular:
    """λ²M + λD + K + qF, q in [0, high], the band up to top [1/s], which holds all that is finite."""

    name: str
    mass: Array
    damping: Array
    stiffness: Array
    circulatory: Array
    high: float
    top: float

    def case(self, folder: Path) -> st.Case:
        """The same as a case of matrices with a parameter q."""
        terms = [(self.mass, "mass", ""), (self.stiffness, "stiffness", ""), (self.circulatory, "stiffness", "q")]
        if self.damping.any():
            terms.append((self.damping, "damping", ""))
        more = f"[parameters]\nq = {{ value = {0.3 * self.high!r}, range = [0.0, {self.high!r}] }}"
        return matrix_case(folder, terms, self.top / (2 * np.pi), more=more)

    def eigenvalues(self, q: float) -> ComplexArray:
        """All finite λ, motions as a whole left out."""
        n = len(self.mass)
        one, none = np.eye(n), np.zeros((n, n))
        stiffness = self.stiffness + q * self.circulatory
        a = np.block([[none, one], [-stiffness, -self.damping]])
        found = sl.eig(a, np.block([[one, none], [none, self.mass]]), right=False)
        found = found[np.isfinite(found)]
        size = np.abs(found)
        return found[(size > STILL * self.top) & (size < FAR * self.top)]

    def growing(self, q: float) -> int | None:
        """How many roots grow at q up to the highest frequency; None where that is within what rounding may be, or where
        one is near that frequency."""
        values = self.eigenvalues(q)
        grows = values[values.real > FAINT * np.abs(values)]
        if np.any(np.abs(np.abs(grows) / self.top - 1.0) < 0.1):
            return None
        values = values[np.abs(values) <= self.top]
        share = values.real / np.abs(values)
        # Of what nothing damps rounding of 1e-16 is 1e-8 where two meet; of these they may be near.
        if np.any((share > 1e-9) & (share < 30 * FAINT)):
            return None
        return int(np.count_nonzero(share > FAINT))


def singular(kind: str, seed: int, *, freedoms: int | None = None, band: float = 1.3) -> Singular:
    """One of the kinds, of 4 to 13 unknowns or of somewhat more than ``freedoms``, damped or not; its highest frequency
    is ``band`` times that of the fastest mode."""
    rng = np.random.default_rng([KINDS.index(kind), seed])
    n = int(rng.integers(3, 9)) if freedoms is None else freedoms
    mass = np.diag(rng.uniform(0.5, 2.0, n))
    squares = rng.uniform(0.5, 3.0, n) ** 2
    turn = np.linalg.qr(rng.standard_normal((n, n)))[0]
    if kind == "rigid":
        squares[: int(rng.integers(1, min(n - 2, 3) + 1))] = 0.0
    stiffness = turn @ np.diag(squares) @ turn.T
    odd = rng.standard_normal((n, n)) * 2.0 / np.sqrt(n)
    circulatory = odd - odd.T
    damping = float(rng.choice([0.0, 0.003, 0.05])) * (turn @ np.diag(rng.uniform(0.2, 1.0, n) * squares) @ turn.T)
    if kind == "rigid":
        moving = turn[:, squares > 0.0] @ turn[:, squares > 0.0].T
        circulatory = moving @ circulatory @ moving
    if kind == "massless":
        empty = int(rng.integers(1, 4))
        half = rng.standard_normal((n, empty)) * 0.5
        stiffness = np.block([[stiffness + half @ half.T, half], [half.T, np.eye(empty)]])
        mass, damping = (sl.block_diag(part, np.zeros((empty, empty))) for part in (mass, damping))
        across = rng.standard_normal((n, empty)) * rng.choice([0.0, 0.5])
        circulatory = np.block([[circulatory, across], [-across.T, np.zeros((empty, empty))]])
    if kind == "multipliers":
        number = int(rng.integers(1, max(n - 2, 1) + 1))
        number = min(number, 2)
        rows = np.zeros((number, n))
        for row in rows:  # rigid links between two freedoms
            row[rng.permutation(n)[:2]] = 1.0, -1.0
        if number == 2 and np.linalg.matrix_rank(rows) < 2:
            rows = rows[:1]
        empty = len(rows)
        stiffness = np.block([[stiffness, rows.T], [rows, np.zeros((empty, empty))]])
        mass, damping, circulatory = (
            sl.block_diag(part, np.zeros((empty, empty))) for part in (mass, damping, circulatory)
        )
    made = Singular(f"{kind} {seed}", mass, damping, stiffness, circulatory, 1.5, 1.0)
    fastest = max(float(np.abs(_physical(made, q)).max()) for q in np.linspace(0.0, made.high, 9))
    return Singular(made.name, mass, damping, stiffness, circulatory, made.high, band * fastest)


def _physical(made: Singular, q: float) -> ComplexArray:
    values = np.asarray(sl.eig(
        np.block([[np.zeros_like(made.mass), np.eye(len(made.mass))], [-made.stiffness - q * made.circulatory, -made.damping]]),
        sl.block_diag(np.eye(len(made.mass)), made.mass), right=False,
    ))  # fmt: skip
    return values[np.isfinite(values) & (np.abs(values) < 50.0)]


def disagreement(made: Singular, found: list[tuple[float, int]]) -> str:
    """Where on a grid of q more or fewer roots grow than onsets (q, change of the number of growing roots) say."""
    for q in np.linspace(0.0, made.high, GRID) + 1.234e-5:
        number = made.growing(float(q))
        said = sum(change for value, change in found if value < q)
        if number is not None and number != said:
            return f"{made.name}: {number} roots grow at q = {q:.5f}, onsets say {said}: {found}"
    return ""
