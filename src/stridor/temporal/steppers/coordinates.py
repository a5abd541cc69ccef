"""Coordinates of the exact and the implicit stepper: all modes of the structure without its contacts, or those up to a
frequency and the static answers to what contacts and loads push at (S. Rubin 1975: residual flexibility and mass)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from ...contact.nodes import ContactNodes
from ...direct import Factor, SingularMatrix, factorise
from ...direct.lowest import modes_below
from ...system import System
from ...typing import Array, Sparse
from .basis import Basis, complete_basis

COMPLETE = 1000  # freedoms up to which all modes are taken
SHIFT = 1e-3  # of the highest frequency: what keeps a body regular that nothing holds
DEPENDENT = 1e-10  # of a unit vector, squared: what a static answer must add to the others to count
SEPARATE = 1e-3  # the same, from which on they are orthogonal but for rounding at once
MOST_MODES = 1500
TOLERANCE = 1e-7  # of the squares of their frequencies
FEW_MORE = 4
HEAVIER = 1.01  # times the mass at a contact: said from there on


@dataclass(frozen=True)
class Coordinates:
    """basis of unit mass; modes: how many of its vectors are modes up to highest_hz, which is infinite where it is
    complete."""

    basis: Basis
    modes: int
    highest_hz: float

    @property
    def complete(self) -> bool:
        """Whether it has all modes."""
        return np.isinf(self.highest_hz)

    @property
    def words(self) -> str:
        """What it is made of."""
        if self.complete:
            return f"all {self.basis.size} modes of the structure"
        statics = self.basis.size - self.modes
        return f"{self.modes} modes up to {self.highest_hz:.6g} Hz and {statics} static answers at contacts and loads"


def rows_of(nodes: ContactNodes) -> tuple[Sparse, Array]:
    """Rows (m d, n) of the nodes, normal, then tangents of each, and their lift (m d, p)."""
    m, t = nodes.count, nodes.directions
    each = np.arange(m * t)
    order = np.argsort(np.concatenate([np.arange(m) * (t + 1), each // t * (t + 1) + each % t + 1]))
    rows = sp.csr_array(sp.vstack([sp.csr_array(nodes.normal), sp.csr_array(nodes.tangent)]))[order]
    return sp.csr_array(rows), np.concatenate([nodes.normal_lift, nodes.tangent_lift])[order]


def pushed_at(system: System, rows: Sparse) -> Sparse:
    """Forces (n, k) that act on the structure: of contacts, loads and supports."""
    motion = system.motion
    loads = [sp.csr_array(np.reshape(load, (1, -1))) for load in system.loads.values()]
    carried = [sp.csr_array(np.asarray(m).T) for m in (motion.mass, motion.damping)]
    return sp.csc_array(sp.vstack([rows, *loads, *carried]).T)


def all_modes(system: System) -> Coordinates:
    """The complete basis. Raises AnalysisError where the mass is not positive definite."""
    found = complete_basis(system)
    return Coordinates(found, found.size, np.inf)


def coordinates(system: System, pushed: Sparse, highest_hz: float | None, small: int | None = None) -> Coordinates:
    """All modes of a system of up to ``small`` freedoms (`COMPLETE`), or where no frequency is given; else those up to
    ``highest_hz`` and the static answers to the forces ``pushed`` (n, k). Raises AnalysisError where the mass is not
    positive definite."""
    if system.size <= (COMPLETE if small is None else small) or highest_hz is None:
        return all_modes(system)
    omega = 2 * np.pi * highest_hz
    mass, stiffness = sp.csr_array(system.mass), sp.csr_array(system.stiffness)
    factor, shift = _held(stiffness, mass, omega)
    with factor:
        # What Ritz's method makes of them is as good as their error squared.
        modes = modes_below(
            stiffness, mass, partial(factor.solve, refine=False), shift, omega, MOST_MODES,
            expected=_how_many(stiffness, mass, omega), tolerance=TOLERANCE,
        )  # fmt: skip
        static = factor.solve(pushed.toarray(), refine=False)
    modes = modes / np.sqrt(np.einsum("ij,ij->j", modes, mass @ modes))
    for _ in range(2):
        static -= modes @ ((mass @ modes).T @ static)
    static, turned = _independent(static, mass)  # of unit mass, and orthogonal to the modes
    vectors, squares = _ritz(modes, static, turned, stiffness)
    rounding = 1e-12 * float(squares.max(initial=0.0))
    squares = np.where(np.abs(squares) < min(rounding, 1e-8 * omega**2), 0.0, squares)
    return Coordinates(Basis(vectors, squares, vectors.T @ (system.damping @ vectors)), modes.shape[1], highest_hz)


def _ritz(modes: Array, static: Array, turned: Array, stiffness: Sparse) -> tuple[Array, Array]:
    """Vectors (n, k) that modes (n, a) and statics (n, b) @ turned (b, c) span, all of unit mass, along which K is
    diagonal, and its diagonal (k,) [rad²/s²]."""
    own, own_static = stiffness @ modes, stiffness @ static
    across = turned.T @ (static.T @ own)
    beyond = turned.T @ (static.T @ own_static) @ turned
    squares, turn = sl.eigh(np.block([[modes.T @ own, across.T], [across, beyond]]))
    count = modes.shape[1]
    return static @ (turned @ turn[count:]) + modes @ turn[:count], squares


def _how_many(stiffness: Sparse, mass: Sparse, omega: float) -> int:
    """Modes up to a frequency [1/s] by the pivots of K − ω²M, and a few more; a guess where pivots are not told."""
    try:
        with factorise(sp.csr_array(stiffness - omega**2 * mass), symmetric=True) as factor:
            return 40 if factor.inertia is None else factor.inertia + FEW_MORE
    except SingularMatrix:
        return 40


def _held(stiffness: Sparse, mass: Sparse, omega: float) -> tuple[Factor, float]:
    """Factors of K, or of K + σM where nothing holds the structure, and σ [rad²/s²]."""
    try:
        return factorise(stiffness, symmetric=True), 0.0
    except SingularMatrix:
        shift = (SHIFT * omega) ** 2
        return factorise(sp.csr_array(stiffness + shift * mass), symmetric=True), shift


def _independent(static: Array, mass: Sparse) -> tuple[Array, Array]:
    """Vectors (n, b) and how they are combined (b, c) to c of unit mass that span what the columns (n, k) do. Products
    with these long columns are what it costs: a second one is made only where rounding needs it."""
    while True:
        square = static.T @ (mass @ static)
        length = np.sqrt(np.diag(square))
        some = length > 0.0
        squares, turn = sl.eigh(square[np.ix_(some, some)] / np.outer(length[some], length[some]))
        keep = squares > DEPENDENT
        turned = np.zeros((len(length), int(keep.sum())))
        turned[some] = turn[:, keep] / np.sqrt(squares[keep]) / length[some, None]
        if squares[keep].min(initial=1.0) > SEPARATE:
            return static, turned
        static = static @ turned


def truncated(system: System, cutoff_hz: float) -> Coordinates:
    """Modes up to a frequency and the static answers to forces of contacts, loads and supports, whatever the size; the
    complete basis where no mode is beyond. Raises AnalysisError where the mass is not positive definite."""
    pushed = pushed_at(system, rows_of(system.contact_nodes())[0])
    if system.size > COMPLETE:
        return coordinates(system, pushed, cutoff_hz, small=0)
    found = all_modes(system)
    whole = found.basis
    low = whole.stiffness <= (2 * np.pi * cutoff_hz) ** 2
    if np.all(low):
        return found
    static = (pushed.T @ whole.vectors[:, ~low]).T / whole.stiffness[~low, None]
    length = np.linalg.norm(static, axis=0)
    spanned, sizes, _ = np.linalg.svd(static[:, length > 0.0] / length[length > 0.0], full_matrices=False)
    spanned = spanned[:, sizes**2 > DEPENDENT]
    squares, turn = sl.eigh(spanned.T @ (whole.stiffness[~low, None] * spanned))
    count = int(low.sum())
    chosen = np.zeros((whole.size, count + len(squares)))
    chosen[np.flatnonzero(low), np.arange(count)] = 1.0
    chosen[~low, count:] = spanned @ turn
    stiffness = np.concatenate([whole.stiffness[low], squares])
    return Coordinates(Basis(whole.vectors @ chosen, stiffness, chosen.T @ whole.damping @ chosen), count, cutoff_hz)


@dataclass(frozen=True)
class Left:
    """What a truncated basis lacks at the contacts: receptance_off, how far their undamped receptance is off at
    ``at_hz``, as a share of its norm; heavier: how many times the mass of the whole the basis has there at most, along
    a normal, and so what an inelastic impact takes (1: as much)."""

    receptance_off: float
    at_hz: float
    heavier: float

    @property
    def words(self) -> str:
        """What a reader must know of it."""
        said = f"receptance at the contacts is off by {100 * self.receptance_off:.3g} % at {self.at_hz:.6g} Hz"
        if self.heavier > HEAVIER:
            said += f", and what strikes there is up to {self.heavier:.3g} times as heavy as on all modes"
        return said


def left_out(system: System, found: Coordinates, asked_hz: float | None = None) -> Left:
    """What a truncated basis lacks, by one factorisation at half of its highest frequency, or at the highest that is
    asked for where that is above it: statics alone are right at any frequency low enough."""
    nodes, basis = system.contact_nodes(), found.basis
    at_hz = max(0.5 * found.highest_hz, asked_hz or 0.0)
    if not nodes.count:
        return Left(0.0, at_hz, 1.0)
    rows = sp.csc_array(sp.vstack([sp.csr_array(nodes.normal), sp.csr_array(nodes.tangent)]).T).toarray()
    shift = (2 * np.pi * at_hz) ** 2
    dynamic = sp.csr_array(sp.csr_array(system.stiffness) - shift * sp.csr_array(system.mass))
    with factorise(dynamic, symmetric=True) as factor:
        whole = rows.T @ factor.solve(rows)
    kept = rows.T @ basis.vectors
    off = float(np.linalg.norm(kept / (basis.stiffness - shift) @ kept.T - whole) / np.linalg.norm(whole))
    with factorise(sp.csr_array(system.mass), symmetric=True) as factor:
        light = np.einsum("ij,ij->j", rows, factor.solve(rows))[: nodes.count]
    own = np.einsum("ij,ij->i", kept, kept)[: nodes.count]
    return Left(off, at_hz, float((light / own).max(initial=1.0)))
