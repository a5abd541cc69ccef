"""Rigid contact taken out of a problem exactly: fewer freedoms, and friction in every matrix.

Rigid nodes keep their gaps closed, N u = 0, by forces that work through the rows N + μS. Motions are u = Z q with
N Z = 0, and the equations are tested with what the forces do not work on, (N + μS) W = 0:

    Wᵀ(λ²M + λD + K)Z q = 0 .

With any R that has N R = 1 and S R = 0 (motions of the slave nodes along their normals)

    W(μ) = Z − μ R S Z

is such a W, of full rank at every μ: the matrices are affine in μ, the mass included, since the contact force answers
to inertia and friction follows it. Where a node cannot move along its normal without moving along the slip (it is held
in a wedge), S R = Φ ≠ 0 and

    W(μ) = Z − μ R (1 + μΦ)⁻¹ S Z ,

which ends where friction jams, det(1 + μΦ) = 0.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp
import scipy.sparse.linalg as ssl
from scipy.sparse.csgraph import min_weight_full_bipartite_matching

from ...errors import AnalysisError
from ...typing import Array, IntArray, Sparse
from .contacts_sampling import sampled
from .factors import CONSTANT, ParameterFactor, Product, product_of
from .family import merged, term_of
from .problem import Parameter, Term

NO_PIVOT = 7.0  # −ln of the size that an entry of the slip must have to be of use
SHARED = 1.0  # −ln of how much less an entry is worth in a column that other nodes have entries in
LARGE = 1e3  # entries of an inverse, in units of its rows, above which pivots are sought with more care
SMALL = 1e-13  # of the largest entry: rounding
DENSE = 3000  # rows that are still worked on densely
TWICE = (
    "rigid contact presses on the same freedoms twice, so that its forces cannot be told apart; give the contact a "
    "stiffness"
)


@dataclass(frozen=True)
class Elimination:
    """Motions u = Z q, Z (n, r), and tests W(μ) = Z + Σ f_k V_k with factors f_k of the friction coefficient and
    V_k (n, r)."""

    motion: Sparse
    changes: tuple[tuple[ParameterFactor, Sparse], ...]

    def applied(self, terms: Iterable[Term]) -> tuple[Term, ...]:
        """The terms WᵀAZ (r, r) of terms A (n, n)."""
        found: list[Term] = []
        for term in terms:
            moved = sp.csr_array(term.matrix @ self.motion)
            whole = sp.csr_array(self.motion.T @ moved)
            whole = sp.csr_array((whole + whole.T) / 2) if term.symmetric else whole
            found.append(Term(whole, term.role, term.factor, term.symmetric))
            for factor, change in self.changes:
                found += term_of(change.T @ moved, term.role, _times(factor, term.factor))
        return merged(found)

    def tests(self, values: Mapping[str, float]) -> Sparse:
        """W (n, r) at values of the parameters."""
        return sp.csr_array(sum((f(values) * v for f, v in self.changes), start=self.motion))


def _times(one: ParameterFactor, other: Any) -> ParameterFactor:
    assert isinstance(other, ParameterFactor), "terms of cases have factors that are data"
    return product_of(one, other)


def eliminate(normal: Sparse, slide: Sparse, friction: Parameter | float) -> Elimination:
    """Motions and tests of rigid contacts with rows N, S (m, n) of gap and slip; friction: μ, or its range.

    Raises AnalysisError where contacts press on the same freedoms twice, and where friction jams.
    """
    # A node that no freedom moves along its normal (held, over an obstacle) can neither press nor give way.
    movable = np.flatnonzero(abs(normal).max(axis=1).toarray().ravel() > 0)
    normal, slide = sp.csr_array(normal[movable]), sp.csr_array(slide[movable])
    if not len(movable):
        return Elimination(sp.csr_array(sp.eye_array(normal.shape[1])), ())
    pivots, paired = _pivots(normal, slide)
    motion = _closed(normal, pivots)
    lift = _lift(normal, slide, pivots, paired)
    slip = sp.csr_array(slide @ motion)
    largest = float(abs(slide).max() * abs(lift).max())
    coupling = _rounded(slide @ lift, largest)
    if not coupling.nnz:
        change = _rounded(-(lift @ slip))
        if isinstance(friction, Parameter):
            own = Product(((friction.name, 1.0),))
            return Elimination(motion, ((own, change),) if change.nnz else ())
        return Elimination(motion, ((CONSTANT, sp.csr_array(friction * change)),) if friction and change.nnz else ())
    return Elimination(motion, _wedged(lift, slip, coupling, friction))


def _wedged(
    lift: Sparse, slip: Sparse, coupling: Sparse, friction: Parameter | float
) -> tuple[tuple[ParameterFactor, Sparse], ...]:
    """The changes −μ R (1 + μΦ)⁻¹ S Z where Φ is not zero, on the few nodes that it has entries of."""
    coo = sp.coo_array(coupling)
    rows = np.unique(np.concatenate([coo.row, coo.col]))
    block = coupling[rows][:, rows].toarray()
    jams = _jams(block)
    low, high = (friction.low, friction.high) if isinstance(friction, Parameter) else (friction, friction)
    within = jams[(jams >= low * (1 - 1e-9)) & (jams <= high * (1 + 1e-9))]
    if len(within):
        raise AnalysisError(
            f"friction jams at μ = {within.min():.6g}: rigid contact cannot slide where the slave is held along the "
            "slip; take lower friction, or give the contact a stiffness"
        )

    def inverse(mu: float) -> Sparse:
        whole = sp.lil_array(sp.eye_array(coupling.shape[0]))
        whole[np.ix_(rows, rows)] = np.linalg.inv(np.eye(len(rows)) + mu * block)
        return sp.csr_array(whole)

    if not isinstance(friction, Parameter):
        return ((CONSTANT, _rounded(-friction * (lift @ inverse(friction) @ slip))),) if friction else ()

    def at(values: Mapping[str, float]) -> Array:
        return np.linalg.inv(np.eye(len(rows)) + values[friction.name] * block).ravel()

    grid = sampled((friction,), at, "friction of nodes held along their normal")
    own = Product(((friction.name, 1.0),))
    pieces: list[tuple[ParameterFactor, Sparse]] = []
    for factor, entries in grid.compressed():
        whole = sp.lil_array(coupling.shape)
        whole[np.ix_(rows, rows)] = entries.reshape(block.shape)
        pieces.append((product_of(own, factor), _rounded(-(lift @ sp.csr_array(whole) @ slip))))
    others = sp.csr_array(sp.diags_array((~np.isin(np.arange(coupling.shape[0]), rows)).astype(float)))
    pieces.append((own, _rounded(-(lift @ others @ slip))))
    return tuple((f, v) for f, v in pieces if v.nnz)


def _jams(block: Array) -> Array:
    """Friction coefficients (k,) > 0 at which 1 + μΦ is singular."""
    values = sl.eigvals(block)
    real = values[np.abs(values.imag) <= 1e-9 * np.abs(values).max(initial=0.0)].real
    return np.sort(-1.0 / real[real < 0])


def _pivots(normal: Sparse, slide: Sparse) -> tuple[IntArray, IntArray]:
    """For each node a freedom (m,) to be expressed by the others, and one (m,) for its slip, −1 where there is none.

    Those of all rows of N and S together with the largest product of entries, freedoms of one node alone preferred.
    """
    m, n = normal.shape
    if n < m:
        raise AnalysisError(TWICE)
    both = sp.coo_array(sp.vstack([_unit_rows(normal), _unit_rows(slide)]))
    large = np.abs(both.data) > 1e-8
    row, column, size = both.row[large], both.col[large], np.abs(both.data[large])
    users = np.zeros(n, dtype=np.int64)
    for own in (normal, slide):
        users = np.maximum(users, np.bincount(sp.coo_array(own).col, minlength=n))
    cost = 1.0 - np.log(np.minimum(size, 1.0)) + np.where(users[column] > 1, SHARED, 0.0)
    # A slip may go without: each row of S has a column of its own beyond the freedoms.
    row = np.concatenate([row, m + np.arange(m)])
    column = np.concatenate([column, n + np.arange(m)])
    cost = np.concatenate([cost, np.full(m, 1.0 + NO_PIVOT)])
    try:
        at, chosen = min_weight_full_bipartite_matching(sp.csr_array((cost, (row, column)), shape=(2 * m, n + m)))
    except ValueError as error:
        raise AnalysisError(TWICE) from error
    matched = np.empty(2 * m, dtype=np.int64)
    matched[at] = chosen
    return matched[:m], np.where(matched[m:] < n, matched[m:], -1)


def _unit_rows(rows: Sparse) -> Sparse:
    largest = abs(rows).max(axis=1).toarray().ravel() if rows.shape[0] else np.zeros(0)
    return sp.csr_array(sp.diags_array(1.0 / np.where(largest > 0, largest, 1.0)) @ rows)


def _closed(normal: Sparse, pivots: IntArray) -> Sparse:
    """Z (n, n − m) with N Z = 0: every freedom but the pivots by itself, these as the others have it."""
    m, n = normal.shape
    others = np.setdiff1d(np.arange(n), pivots)
    scaled = _unit_rows(normal)
    answer = _solved(sp.csr_array(scaled[:, pivots]), sp.csr_array(scaled[:, others]))
    if answer is None:
        pivots = _by_elimination(scaled)
        others = np.setdiff1d(np.arange(n), pivots)
        answer = _solved(sp.csr_array(scaled[:, pivots]), sp.csr_array(scaled[:, others]), limit=1.0 / SMALL)
        if answer is None:
            raise AnalysisError(TWICE)
    coo = sp.coo_array(answer)
    row = np.concatenate([others, pivots[coo.row]])
    column = np.concatenate([np.arange(n - m), coo.col])
    value = np.concatenate([np.ones(n - m), -coo.data])
    return sp.csr_array((value, (row, column)), shape=(n, n - m))


def _lift(normal: Sparse, slide: Sparse, pivots: IntArray, paired: IntArray) -> Sparse:
    """R (n, m) with N R = 1, and S R = 0 as far as there is such."""
    m, n = normal.shape
    slips = _involved(slide, pivots, paired)
    rows = sp.csr_array(sp.vstack([normal, slide[slips]]))
    columns = np.concatenate([pivots, paired[slips]])
    unit = sp.csr_array((np.ones(m), (np.arange(m), np.arange(m))), shape=(len(columns), m))
    answer = _solved(sp.csr_array(rows[:, columns]), unit)
    if answer is None:
        return _dense_lift(normal, slide)
    coo = sp.coo_array(answer)
    return sp.csr_array((coo.data, (columns[coo.row], coo.col)), shape=(n, m))


def _involved(slide: Sparse, pivots: IntArray, paired: IntArray) -> IntArray:
    """Nodes whose slip the freedoms chosen so far move, and which have one of their own to undo that."""
    used = np.zeros(slide.shape[1])
    used[pivots] = 1.0
    slips = np.zeros(0, dtype=np.int64)
    while True:
        more = np.flatnonzero((abs(slide) @ used > SMALL) & (paired >= 0))
        if len(more) == len(slips):
            return slips
        slips = more
        used[paired[slips]] = 1.0


def _dense_lift(normal: Sparse, slide: Sparse) -> Sparse:
    """The same by singular values: of all with N R = 1 one for which S R is smallest."""
    m, n = normal.shape
    _require_few(m)
    used = np.unique(np.concatenate([sp.coo_array(normal).col, sp.coo_array(slide).col]))
    rows, slips = normal[:, used].toarray(), slide[:, used].toarray()
    right, size, left = sl.svd(rows)
    if size[-1] <= SMALL * size[0] * max(rows.shape):
        raise AnalysisError(TWICE)
    lift = left[:m].T @ ((1.0 / size)[:, None] * right.T)
    closed = left[m:].T
    lift = lift - closed @ (np.linalg.pinv(slips @ closed, rcond=1e-10) @ (slips @ lift))
    whole = np.zeros((n, m))
    whole[used] = lift
    return _rounded(sp.csr_array(whole))


def _by_elimination(rows: Sparse) -> IntArray:
    """Pivots (m,) by a factorisation with columns exchanged, for rows (m, n) that are nearly alike somewhere."""
    m = rows.shape[0]
    _require_few(m)
    used = np.unique(sp.coo_array(rows).col)
    _, size, order = sl.qr(rows[:, used].toarray(), mode="economic", pivoting=True)
    if len(used) < m or abs(size[m - 1, m - 1]) <= SMALL * m * abs(size[0, 0]):
        raise AnalysisError(TWICE)
    return used[order[:m]]


def _require_few(count: int) -> None:
    if count > DENSE:
        raise AnalysisError(f"{TWICE}, or pair fewer nodes ({count}) twice")


def _solved(matrix: Sparse, right: Sparse, limit: float = LARGE) -> Sparse | None:
    """matrix⁻¹ right, sparse; None where entries of it are above a limit or the matrix is singular."""
    if not matrix.shape[0]:
        return sp.csr_array(right)
    columns = np.unique(sp.coo_array(right).col)
    try:
        factor = ssl.splu(sp.csc_array(matrix))
        dense = factor.solve(right[:, columns].toarray())
    except RuntimeError:
        return None
    if not np.all(np.isfinite(dense)) or np.abs(dense).max(initial=0.0) > limit:
        return None
    coo = sp.coo_array(np.where(np.abs(dense) > SMALL * 1e-2, dense, 0.0))
    return sp.csr_array((coo.data, (coo.row, columns[coo.col])), shape=right.shape)


def _rounded(matrix: Any, largest: float | None = None) -> Sparse:
    """The matrix without entries that are rounding of its largest, or of the largest of what it was summed from."""
    coo = sp.coo_array(sp.csr_array(matrix))
    keep = np.abs(coo.data) > SMALL * (float(np.abs(coo.data).max(initial=0.0)) if largest is None else largest)
    return sp.csr_array((coo.data[keep], (coo.row[keep], coo.col[keep])), shape=coo.shape)
