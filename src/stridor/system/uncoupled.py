"""Modes of the structure without contacts: the complete basis in which the heart of stridor works.

Each component that the structure leaves uncoupled is solved by itself. Where its damping is
proportional its real modes serve (pole pairs); where it is not, its complex modes do (single poles).
Both give the same sum, the receptance D(λ)⁻¹ with D = λ²M + λC + K.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from ..errors import AnalysisError
from ..typing import Array, ComplexArray, IntArray
from .model import System

PROPORTIONAL_TOLERANCE = 1e-9
DENSE_LIMIT = 6000
FEW = 2500  # freedoms for which a complete basis pays
NEGATIVE = 10.0  # times rounding: a negative stiffness that is meant
KEPT = 400  # freedoms of a component that is not solved again where its matrices come back
MOST_KEPT = 8  # of them: at most 5 MB each
ONE_POLE = 1e-10  # of |λ|: poles nearer to each other are one, and which shapes the solver gives is chance
SUMS_UP = 1e-6  # of the modal mass, which the sum over modes gives back

_Entries = tuple[bytes, bytes, bytes]  # of a sparse matrix: where rows begin, columns, values


@dataclass(frozen=True)
class RealBlock:
    """Proportionally damped component: freedoms (k,), vectors (k, k) with ΦᵀMΦ = 1,
    stiffness ω² (k,) [rad²/s²] and damping c = φᵀCφ (k,) [1/s]."""

    freedoms: IntArray
    vectors: Array
    stiffness: Array
    damping: Array


@dataclass(frozen=True)
class ComplexBlock:
    """Generally damped component: freedoms (k,), vectors X (k, 2k) scaled so that
    D⁻¹ = Σ x xᵀ/(λ − λ_j), poles (2k,) [1/s]. complete: whether that sum is D⁻¹, which it cannot be where a pole of
    two modes has one shape (a motion that neither springs nor dampers hold)."""

    freedoms: IntArray
    vectors: ComplexArray
    poles: ComplexArray
    complete: bool = True


@dataclass(frozen=True)
class UncoupledModes:
    """Complete set of modes of the structure without contacts, block by block.

    frequencies_hz (n_real,) are the undamped ones of all real blocks, sorted by block. indefinite: whether some motion
    has a negative stiffness (springs that drive their ends apart), for which neither of these blocks stands.
    """

    size: int
    real: tuple[RealBlock, ...]
    general: tuple[ComplexBlock, ...]
    indefinite: bool = False

    @property
    def proportional(self) -> bool:
        """Whether every component has proportional damping, so that real modes are complete."""
        return not self.general

    @property
    def no_receptance(self) -> str:
        """Why the sum over modes is not the receptance; "" where it is."""
        if self.indefinite:
            return "a motion of the structure has a stiffness that is not positive"
        if not all(block.complete for block in self.general):
            return "modes of the damped structure coincide, and leave no basis"
        return ""

    @property
    def stiffness(self) -> Array:
        """ω² of all real blocks in turn [rad²/s²]."""
        return np.concatenate([b.stiffness for b in self.real] or [np.zeros(0)])

    @property
    def damping(self) -> Array:
        """Modal damping c of all real blocks in turn [1/s]."""
        return np.concatenate([b.damping for b in self.real] or [np.zeros(0)])

    def project(self, rows: Array) -> tuple[Array, ComplexArray]:
        """Rows (r, n) on the modes: (r, n_real) and (r, n_poles)."""
        real = [rows[:, b.freedoms] @ b.vectors for b in self.real]
        general = [rows[:, b.freedoms] @ b.vectors for b in self.general]
        empty = np.zeros((len(rows), 0))
        return np.hstack([empty, *real]), np.hstack([empty.astype(complex), *general])

    @cached_property
    def poles(self) -> ComplexArray:
        """Poles of the general blocks in turn [1/s]."""
        return np.concatenate([b.poles for b in self.general] or [np.zeros(0, dtype=complex)])


def no_complete_basis(system: System, *, nodes: bool = False) -> str:
    """Why it is no structure with a few point contacts on a complete basis of modes; "" where it is. nodes: whether
    those of contact over surfaces will do as well."""
    if system.not_symmetric_definite:
        return system.not_symmetric_definite
    if system.surfaces and not nodes:
        if all(s.nodes.count == 1 for s in system.surfaces):  # a mass on an obstacle is solved as a surface of one node
            return f"contact {system.surfaces[0].name} is that of a node on a surface, not of a point on a beam"
        return "there is contact over surfaces"
    if system.load_steps:
        return "contacts may stick"
    if system.contact_cubic:
        return f"contact {next(iter(system.contact_cubic))} has a cubic part of its stiffness"
    if system.cubic is not None:
        return "there are cubic springs"
    if system.size > FEW:
        return f"{system.size} freedoms are too many for a complete basis, which has up to {FEW}"
    return ""


def uncoupled_modes(system: System) -> UncoupledModes:
    """Each uncoupled component solved densely, once for the same matrices. Raises AnalysisError where mass is not
    positive."""
    return system.of_matrices.once("uncoupled modes", lambda: _solved(system))


def _solved(system: System) -> UncoupledModes:
    mass, damping, stiffness = (m.tocsr() for m in (system.mass, system.damping, system.stiffness))
    real: list[RealBlock] = []
    general: list[ComplexBlock] = []
    indefinite = False
    for part in system.components:
        if len(part) > DENSE_LIMIT:
            raise AnalysisError(
                f"a component of {len(part)} freedoms is too large for a complete modal basis (limit {DENSE_LIMIT})"
            )
        block, negative = _block_of(part, *(a[part][:, part] for a in (mass, damping, stiffness)))
        indefinite |= negative
        if isinstance(block, RealBlock):
            real.append(block)
        else:
            general.append(block)
    return UncoupledModes(system.size, tuple(real), tuple(general), indefinite)


def _block_of(part: IntArray, m: Any, c: Any, k: Any) -> tuple[RealBlock | ComplexBlock, bool]:
    """The block of a component with matrices m, c, k (CSR), and whether some motion has a negative stiffness.

    A body that stays as it is while another one is turned, or a contact moved, is solved once.
    """
    if len(part) > KEPT:
        return _solve_block(part, m.toarray(), c.toarray(), k.toarray())
    block, negative = _solved_once(len(part), _entries(m), _entries(c), _entries(k))
    return replace(block, freedoms=part), negative


@lru_cache(MOST_KEPT)
def _solved_once(size: int, *matrices: _Entries) -> tuple[RealBlock | ComplexBlock, bool]:
    return _solve_block(np.arange(size), *(_dense(size, entries) for entries in matrices))


def _entries(matrix: Any) -> _Entries:
    return (
        matrix.indptr.astype(np.int64).tobytes(), matrix.indices.astype(np.int64).tobytes(),
        matrix.data.astype(float).tobytes(),
    )  # fmt: skip


def _dense(size: int, entries: _Entries) -> Array:
    starts, columns = (np.frombuffer(part, dtype=np.int64) for part in entries[:2])
    values = np.frombuffer(entries[2], dtype=float)
    return sp.csr_array((values, columns, starts), shape=(size, size)).toarray()


def _solve_block(part: IntArray, m: Array, c: Array, k: Array) -> tuple[RealBlock | ComplexBlock, bool]:
    """The block, and whether some motion has a negative stiffness."""
    try:
        _, vectors = sl.eigh(k, m)
    except sl.LinAlgError as error:
        raise AnalysisError("the mass matrix is not positive definite: a freedom has stiffness but no mass") from error
    # Rayleigh quotients carry the small eigenvalues to more digits than the dense solver does:
    # its error is relative to the largest one (docs/theory-modal.md).
    masses = np.einsum("ij,ij->j", vectors, m @ vectors)
    quotients = np.einsum("ij,ij->j", vectors, k @ vectors) / masses
    rounding = np.einsum("ij,ij->j", np.abs(vectors), np.abs(k) @ np.abs(vectors)) / masses
    smallest = 100 * np.finfo(float).eps * rounding
    stiffness = np.where(np.abs(quotients) < smallest, 0.0, quotients)
    negative = bool(np.any(quotients < -NEGATIVE * smallest))
    product = vectors.T @ (c @ vectors)
    diagonal = np.diag(product).copy()
    coupling = np.abs(product - np.diag(diagonal)).max()
    if coupling <= PROPORTIONAL_TOLERANCE * max(np.abs(product).max(), 1e-300):
        return RealBlock(part, vectors, stiffness, diagonal), negative
    return _complex_block(part, vectors / np.sqrt(masses), np.maximum(stiffness, 0.0), c), negative


def _complex_block(part: IntArray, vectors: Array, squares: Array, c: Array) -> ComplexBlock:
    """Poles and shapes from undamped modes (n, n) of unit modal mass and their ω² (n,).

    Matrices of beams span so many decades that the QZ algorithm loses poles to infinity. In modal coordinates the
    states ωq and q̇ make a matrix that is skew but for damping; what rounding in its largest entries does to the low
    poles is taken out again by their Rayleigh functional.
    """
    size = len(part)
    damping = vectors.T @ (c @ vectors)
    omega = np.sqrt(squares)
    scale = np.maximum(omega, 1e-3 * float(np.median(omega)) + 1e-300)  # rigid motions have ω = 0
    states = np.zeros((2 * size, 2 * size))
    states[:size, size:] = np.diag(scale)
    states[size:, :size] = -np.diag(squares / scale)
    states[size:, size:] = -damping
    poles, right = sl.eig(states)
    q = right[:size] / scale[:, None]
    with np.errstate(all="ignore"):
        for _ in range(3):
            # qᵀP(λ)q = 0 of a symmetric problem.
            mass, drag = np.einsum("ij,ij->j", q, q), np.einsum("ij,ij->j", q, damping @ q)
            stiff = np.einsum("ij,i,ij->j", q, squares, q)
            change = (poles**2 * mass + poles * drag + stiff) / (2 * poles * mass + drag)
            # A double root has no simple functional: leave it as it is.
            sound = np.isfinite(change) & (np.abs(change) <= 1e-3 * np.abs(poles))
            poles = np.where(sound, poles - change, poles)
    # Symmetric pencil: the left vector is the right one; xᵀ(2λM + C)x = 1 makes residues of D⁻¹.
    with np.errstate(all="ignore"):
        q = q / np.sqrt(np.einsum("ij,ij->j", q, 2 * poles * q + damping @ q))
    for same in _coincident(poles, float(np.abs(states).max())):
        q[:, same], poles[same] = _apart(q[:, same], complex(poles[same].mean()), damping)
    return ComplexBlock(part, vectors @ q, poles, _sums_up(q, poles))


def _coincident(poles: ComplexArray, largest: float) -> list[IntArray]:
    """Groups of poles that are one but for rounding, of matrices with entries up to ``largest`` [1/s]."""
    order = np.argsort(np.abs(poles), kind="stable")
    pairs: list[tuple[int, int]] = []
    for step in (1, 2, 3):  # conjugates lie between
        a, b = order[:-step], order[step:]
        near = np.abs(poles[a] - poles[b]) <= ONE_POLE * np.abs(poles[b]) + 1e3 * np.finfo(float).eps * largest
        pairs += zip(a[near].tolist(), b[near].tolist(), strict=True)
    if not pairs:
        return []
    rows, columns = zip(*pairs, strict=True)
    links = sp.coo_array((np.ones(len(pairs)), (rows, columns)), shape=(len(poles), len(poles)))
    _, group = connected_components(links, directed=False)
    return [np.flatnonzero(group == g) for g in np.flatnonzero(np.bincount(group) > 1)]


def _apart(q: ComplexArray, pole: complex, damping: Array) -> tuple[ComplexArray, complex]:
    """Shapes (n, k) of one pole with qᵀ(2λM + C)q = 1, and the pole.

    The eigenvalue solver gives any k of that plane; the sum over modes holds of those that this form keeps apart.
    """
    if not np.all(np.isfinite(q)) or q.shape[1] > len(q):  # more than there are freedoms: rounding joins them
        return q, pole
    shapes = np.linalg.svd(q, full_matrices=False)[0]
    form = shapes.T @ (2 * pole * shapes + damping @ shapes)
    values, turn = sl.eig((form + form.T) / 2)
    with np.errstate(all="ignore"):
        turn = turn / np.sqrt(np.einsum("ij,ij->j", turn, turn) * values)
    return shapes @ turn, pole


def _sums_up(q: ComplexArray, poles: ComplexArray) -> bool:
    """Whether Σ q qᵀ = 0 and Σ λ q qᵀ = 1 in modal coordinates: D⁻¹ is M⁻¹/λ² at large λ."""
    if not np.all(np.isfinite(q)):
        return False
    weighted = q * np.sqrt(poles)
    one = bool(np.abs(weighted @ weighted.T - np.eye(len(q))).max() <= SUMS_UP)
    return one and bool(np.abs(q @ q.T).max() <= SUMS_UP * float(np.abs(q).max()) ** 2)
