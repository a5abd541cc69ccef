"""What can be known of M, C and K before anything is computed with them: and what looks wrong.

Definiteness, the share that is not symmetric, how many friction couplings there are, bounds of frequencies, and a guess
of the units.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as sl
from scipy.sparse.csgraph import connected_components, structural_rank

from ..direct import factorise
from ..direct.backends import choose
from ..errors import AnalysisError, CaseError
from ..typing import Array, BoolArray, IntArray, Sparse
from .abaqus import HELD
from .model import Labels, StoredMatrix
from .source import counted

Definiteness = Literal["zero", "positive definite", "positive semidefinite", "indefinite", "not known"]

# Differences of mirrored entries below this, relative to the smaller of their rows' largest entries, are rounding.
ROUNDING = 1e-12
DENSE = 2000
# What warnings of friction that a stiffness does not hold begin with.
LOST, NO_FRICTION = "friction terms seem lost", "no friction is in K"
_SHIFT = 1e-10
# Young's modulus times speed of sound of steel, in Pa·m/s and in MPa·mm/s: what K ω of an element is about.
_STEEL_SI, _STEEL_MM = 1e15, 1e12
_NAMES = {"mass": "M", "damping": "C", "stiffness": "K"}


@dataclass(frozen=True)
class MatrixReport:
    """What was found; counts leave out the ``held`` freedoms, which Abaqus marks with 1e36 in the stiffness.

    size: freedoms. entries, defect: by role "mass", "damping", "stiffness": number of entries other than 0, and
    ‖A − Aᵀ‖/‖A‖ (Frobenius), 0 for a matrix that is 0. mass, damping: definiteness of the symmetric part; _negative:
    number of its negative eigenvalues, None if not known; massless: freedoms without an entry in the mass.
    coupling: rank of K − Kᵀ, at most that if not coupling_exact; coupled: rows that it has entries in. multipliers:
    freedoms without mass and without stiffness of their own, but coupled. loose: freedoms with neither.
    frequencies [Hz]: lowest and highest of single freedoms with all others held, None where none has mass and
    stiffness; for symmetric matrices without massless freedoms the model's own reach further down and up. units: a
    guess and its reason. free: directions 1 to 3 in which K lets the whole model move.
    """

    size: int
    held: int
    entries: dict[str, int]
    defect: dict[str, float]
    mass: Definiteness
    mass_negative: int | None
    massless: int
    damping: Definiteness
    damping_negative: int | None
    coupling: int
    coupling_exact: bool
    coupled: int
    multipliers: int
    loose: int
    frequencies: tuple[float, float] | None
    units: str | None
    free: tuple[int, ...]
    warnings: tuple[str, ...]

    def lines(self) -> list[str]:
        """The report for a reader, a statement a line; warnings last."""
        held = f", {self.held} of them held (1e36 in K, Abaqus' supports)" if self.held else ""
        found = [f"{counted(self.size, 'freedom', 'freedoms')}{held}"]
        for role, count in self.entries.items():
            defect = self.defect[role]
            kind = "symmetric" if defect < ROUNDING else f"‖A − Aᵀ‖/‖A‖ = {defect:.1e}"
            filled = f"{counted(count, 'entry', 'entries')}, {kind}"
            found.append(f"{_NAMES[role]} ({role}): {filled if count else 'zero'}")
        without = f", {counted(self.massless, 'freedom', 'freedoms')} without mass" if self.massless else ""
        found.append(f"M is {_shown(self.mass, self.mass_negative)}{without}")
        if self.damping != "zero":
            found.append(f"the symmetric part of C is {_shown(self.damping, self.damping_negative)}")
        if self.coupling:
            most = "" if self.coupling_exact else "at most "
            found.append(f"K − Kᵀ has rank {most}{self.coupling}, in {counted(self.coupled, 'row', 'rows')}")
        if self.frequencies:
            low, high = self.frequencies
            found.append(f"single freedoms, all others held, vibrate at {low:.4g} to {high:.4g} Hz")
        if self.units:
            found.append(f"units, by guess: {self.units}")
        return found + [f"warning: {w}" for w in self.warnings]


def report(
    mass: Sparse,
    damping: Sparse | None,
    stiffness: Sparse,
    *,
    labels: Labels | None = None,
    stored: Sequence[StoredMatrix] = (),
    stiffness_terms: Sequence[Sparse] = (),
    contacts: Sequence[str] = (),
    supports: Sequence[str] = (),
    doubts: Sequence[str] = (),
) -> MatrixReport:
    """Looks through mass, damping and stiffness, each (n, n); no damping is zero damping.

    labels: of the n freedoms. stored: the files the matrices are from, for what these say of themselves.
    stiffness_terms: (n, n) each, what adds up to the stiffness, where that is known. contacts: names of those that are
    made beside the matrices, whose friction these need not hold; supports: of what holds the body beside them.
    doubts: what was found doubtful in reading, said first among the warnings. Raises CaseError at "matrices.ROLE" for a
    matrix that is not square, of another size, or has entries that are not finite.
    """
    size = int(stiffness.shape[0])
    parts = {"mass": mass, "damping": damping, "stiffness": stiffness}
    whole = {
        role: sp.csr_array((size, size)) if given is None else sp.csr_array(given, dtype=np.float64, copy=True)
        for role, given in parts.items()
    }
    for role, matrix in whole.items():
        if matrix.shape != (size, size):
            raise CaseError(f"matrices.{role}", None, f"has the shape {matrix.shape}; K has {(size, size)}")
        if bad := int(np.sum(~np.isfinite(matrix.data))):
            many = counted(bad, "entry is no finite number", "entries are no finite numbers")
            raise CaseError(f"matrices.{role}", None, f"{many}; all must be")
        matrix.sum_duplicates()
        matrix.eliminate_zeros()
    held = held_freedoms(whole["stiffness"])
    keep = np.setdiff1d(np.arange(size), held)
    if len(held):
        whole = {role: sp.csr_array(a[keep][:, keep]) for role, a in whole.items()}
    m, c, k = whole["mass"], whole["damping"], whole["stiffness"]
    defect = {role: _defect(a) for role, a in whole.items()}
    empty = {role: _empty(a) for role, a in whole.items()}
    mass_kind, mass_negative = definiteness(m)
    damping_kind, damping_negative = definiteness(c)
    if mass_kind == "positive definite" and empty["mass"].any():
        mass_kind = "positive semidefinite"
    terms = [sp.csr_array(part[keep][:, keep]) if len(held) else part for part in stiffness_terms]
    rank, exact, coupled = _coupling(terms or [k])
    own_m, own_k = m.diagonal(), k.diagonal()
    multipliers = int(np.sum(empty["mass"] & (own_k == 0) & ~empty["stiffness"]))
    frequencies = _frequencies(own_m, own_k)
    kept = None if labels is None else Labels(np.asarray(labels.node)[keep], np.asarray(labels.direction)[keep])
    found = MatrixReport(
        size=size,
        held=len(held),
        entries={role: int(a.nnz) for role, a in whole.items()},
        defect=defect,
        mass=mass_kind,
        mass_negative=mass_negative,
        massless=int(empty["mass"].sum()),
        damping=damping_kind,
        damping_negative=damping_negative,
        coupling=rank,
        coupling_exact=exact,
        coupled=coupled,
        multipliers=multipliers,
        loose=int(np.sum(empty["mass"] & empty["stiffness"])),
        frequencies=frequencies,
        units=guessed_units(own_m, own_k, kept),
        free=_free(k, kept),
        warnings=(),
    )
    internal = 0 if kept is None else int(np.sum(kept.node < 0))
    said = _warnings(found, internal, stored, whole, contacts, supports)
    return replace(found, warnings=(*doubts, *said))


def single_lines(stored: StoredMatrix) -> list[str]:
    """What one matrix is like by itself, whatever its role, for a reader, a statement a line."""
    held = held_freedoms(stored.matrix)
    keep = np.setdiff1d(np.arange(stored.matrix.shape[0]), held)
    matrix = sp.csr_array(stored.matrix[keep][:, keep]) if len(held) else stored.matrix
    defect = _defect(matrix)
    said = f", {stored.role} by what the file says" if stored.role else ""
    kind = "symmetric" if defect < ROUNDING else f"‖A − Aᵀ‖/‖A‖ = {defect:.1e}"
    lines = [
        f"{counted(stored.matrix.shape[0], 'freedom', 'freedoms')}{_named(stored)}{said}"
        + (f", {len(held)} of them held (1e36)" if len(held) else ""),
        f"{counted(int(matrix.nnz), 'entry', 'entries')}, {kind}" if matrix.nnz else "zero",
        f"the symmetric part is {_shown(*definiteness(matrix))}",
    ]
    rank, exact, coupled = _coupling([matrix])
    if rank:
        lines.append(f"A − Aᵀ has rank {'' if exact else 'at most '}{rank}, in {counted(coupled, 'row', 'rows')}")
    if stored.lone is not None:
        below, above = stored.lone
        many = f"{below} entries below the diagonal, {above} above, and none has a counterpart across it"
        lines.append(f"{many}: is it one half of a matrix?")
    return [*lines, *(f"read: {note}" for note in stored.notes)]


def _named(stored: StoredMatrix) -> str:
    return f", {stored.name}" if stored.name else ""


def held_freedoms(stiffness: Sparse) -> IntArray:
    """Freedoms with 1e36 on the diagonal of K, as Abaqus writes what *BOUNDARY holds: leave them out everywhere."""
    return np.flatnonzero(stiffness.diagonal() >= HELD)


def negative_mass(mass: Sparse) -> str:
    """How many freedoms have a negative entry on the diagonal of M (n, n), in words; "" where none has."""
    negative = int(np.count_nonzero(mass.diagonal() < 0))
    return f"{counted(negative, 'freedom has', 'freedoms have')} a negative mass" if negative else ""


def no_mass(mass: Sparse) -> str:
    """How many freedoms have no entry on the diagonal of M (n, n), in words; "" where none is without."""
    without = int(np.count_nonzero(mass.diagonal() == 0))
    return f"{counted(without, 'freedom has', 'freedoms have')} no mass" if without else ""


def definiteness(matrix: Sparse) -> tuple[Definiteness, int | None]:
    """Of the symmetric part of A (n, n), without its empty rows; and how many eigenvalues are negative, if known.

    Scaled to a diagonal of 1. Beyond a size of 2000 Lanczos looks for the lowest eigenvalue, which it finds fast for
    masses; otherwise the inertia of a factorisation tells, or all eigenvalues where the solver does not tell that.
    """
    filled = np.flatnonzero(~_empty(matrix))
    if not len(filled):
        return "zero", 0
    part = sp.csr_array(matrix[filled][:, filled])
    part = sp.csr_array(0.5 * (part + part.T))
    part.eliminate_zeros()
    diagonal = part.diagonal()
    if part.nnz == np.count_nonzero(diagonal):
        negative = int(np.sum(diagonal < 0))
        kind = "indefinite" if negative else "positive definite" if np.all(diagonal > 0) else "positive semidefinite"
        return ("zero" if not part.nnz else kind), negative
    # Rows of a pure antisymmetric part have gone; a diagonal of 0 below others makes it indefinite, too.
    filled = np.flatnonzero(~_empty(part))
    part = sp.csr_array(part[filled][:, filled])
    diagonal = part.diagonal()
    sizes = np.where(diagonal != 0, np.abs(diagonal), abs(part).max(axis=1).toarray().ravel())
    scale = sp.diags_array(1 / np.sqrt(sizes))
    part = sp.csr_array(scale @ part @ scale)
    part = sp.csr_array(0.5 * (part + part.T))
    lowest = _by_lowest(part) if part.shape[0] > DENSE else "not known"
    if lowest == "positive definite" or _negative(part, -_SHIFT) == 0:
        return "positive definite", 0
    # Zero eigenvalues are on the other side now.
    negative = _negative(part, _SHIFT)
    if negative is None:
        return ("indefinite" if np.any(diagonal <= 0) else lowest), None
    return ("indefinite" if negative else "positive semidefinite"), negative


def _negative(part: Sparse, shift: float) -> int | None:
    """Number of eigenvalues of A + shift 1 below 0, None where nobody tells."""
    shifted = sp.csr_array(part + shift * sp.eye_array(part.shape[0]))
    told = None
    # SuperLU is slow on what is large, and does not tell either.
    if choose(None) != "superlu":
        with suppress(AnalysisError), factorise(shifted, symmetric=True) as factor:
            told = factor.inertia
    if told is None and part.shape[0] <= DENSE:
        told = int(np.sum(la.eigvalsh(shifted.toarray()) < 0))
    return told


def _by_lowest(part: Sparse) -> Definiteness:
    begin = np.random.default_rng(3).standard_normal(part.shape[0])
    try:
        lowest = float(sl.eigsh(part, k=1, which="SA", tol=1e-3, maxiter=300, v0=begin, return_eigenvectors=False)[0])
    except sl.ArpackError:
        return "not known"
    if abs(lowest) < 1e-6:
        return "not known"
    return "positive definite" if lowest > 0 else "indefinite"


def _empty(matrix: Sparse) -> BoolArray:
    """Freedoms without an entry in their row and column."""
    rows = np.diff(matrix.indptr) > 0
    columns = np.zeros(matrix.shape[0], dtype=bool)
    columns[matrix.indices] = True
    return ~(rows | columns)


def _defect(matrix: Sparse) -> float:
    largest = float(np.max(np.abs(matrix.data), initial=0.0))
    if largest == 0.0:
        return 0.0
    skew = matrix - matrix.T
    return float(np.linalg.norm(skew.data / largest) / np.linalg.norm(matrix.data / largest))


def _coupling(parts: Sequence[Sparse]) -> tuple[int, bool, int]:
    """Rank of K − Kᵀ without what is rounding, whether that is exact, and the number of its rows with entries.

    K (n, n) is the sum of the parts, each a term with its factor: what is rounding is judged within each, so that
    friction terms count the same by themselves as beside a stiffness a million times larger. Rows that hold nothing but
    rounding are left out. Among the others single entries are not: without its smallest entries a matrix of rank 2 is
    one of a higher rank. They are scaled by the largest entries l of their rows, S_ij/√(l_i l_j): each is known to
    ROUNDING then, and all of them, as a norm, to ROUNDING √(number of entries).
    """
    total = sp.csr_array(parts[0].shape)
    largest: Array = np.zeros(total.shape[0])
    is_held = np.zeros(total.shape[0], dtype=bool)
    for part in parts:
        skew = sp.coo_array(part - part.T)
        if not skew.nnz:
            continue
        sizes = abs(part)
        own: Array = np.maximum(sizes.max(axis=1).toarray().ravel(), sizes.max(axis=0).toarray().ravel())
        true = np.abs(skew.data) > ROUNDING * np.minimum(own[skew.row], own[skew.col])
        if np.any(true):
            is_held[skew.row[true]] = True
            largest = np.maximum(largest, own)
            total = sp.csr_array(total + skew)
    held = np.flatnonzero(is_held)
    if not len(held):
        return 0, True, 0
    scale = sp.diags_array(1.0 / np.sqrt(largest[held]))
    small = sp.csr_array(scale @ total[held][:, held] @ scale)
    small.data[np.abs(small.data) <= np.finfo(float).eps] = 0.0
    small.eliminate_zeros()
    count, part_of = connected_components(small, directed=False)
    members = np.bincount(part_of, minlength=count)
    order = np.argsort(part_of, kind="stable")
    small = sp.csr_array(small[order][:, order])
    rank, exact, start, work = 0, True, 0, 0.0
    for length in members:
        block = small[start : start + length, start : start + length]
        start += int(length)
        work += float(length) ** 3
        if work <= 1.1 * DENSE**3:
            rank += int(np.sum(la.svdvals(block.toarray()) > ROUNDING * np.sqrt(max(block.nnz, 1))))
        else:
            exact = False
            rank += int(structural_rank(sp.csr_matrix(block)))
    return rank, exact, len(held)


def _frequencies(own_m: Array, own_k: Array) -> tuple[float, float] | None:
    """√(K/M) of single freedoms [Hz], the lowest and the highest: Rayleigh's quotients of their motions."""
    good = (own_m > 0) & (own_k > 0)
    if not good.any():
        return None
    quotient = np.sqrt(own_k[good]) / np.sqrt(own_m[good]) / (2 * np.pi)
    return float(quotient.min()), float(quotient.max())


def guessed_units(own_m: Array, own_k: Array, labels: Labels | None) -> str | None:
    """The units that diagonals of M and K (n,) are probably in, None where nothing tells.

    For elements of steel of any size K ω is about E times the speed of sound, which tells m from mm.
    """
    good = (own_m > 0) & (own_k > 0)
    if labels is not None:
        good &= (labels.node > 0) & (labels.direction <= 3)
    if not good.any():
        return None
    k = float(np.median(own_k[good]))
    omega = float(np.median(np.sqrt(own_k[good]) / np.sqrt(own_m[good])))
    decades = float(np.log10(k) + np.log10(omega))
    reason = f"typical entries {k:.1e} in K, {k / omega / omega:.1e} in M, √(K/M) = {omega / (2 * np.pi):.3g} Hz"
    for name, steel in (("SI (kg, m, s, N)", _STEEL_SI), ("tonne, mm, s, N, as usual in Abaqus", _STEEL_MM)):
        if abs(decades - np.log10(steel)) <= 1.5:
            return f"{name}, if it is steel or the like; {reason}"
    return f"not clear; {reason}"


def _free(stiffness: Sparse, labels: Labels | None) -> tuple[int, ...]:
    """Directions in which the whole model can be moved without force."""
    if labels is None:
        return ()
    sizes = abs(stiffness)
    found: list[int] = []
    for direction in (1, 2, 3):
        motion = ((labels.direction == direction) & (labels.node > 0)).astype(float)
        terms = float(np.linalg.norm(sizes @ motion))
        if terms > 0 and float(np.linalg.norm(stiffness @ motion)) < 1e-8 * terms:
            found.append(direction)
    return tuple(found)


def _shown(kind: str, negative: int | None) -> str:
    return f"{kind}{_eigenvalues(negative)}" if kind == "indefinite" else kind


def _eigenvalues(negative: int | None) -> str:
    return f" ({counted(negative, 'negative eigenvalue', 'negative eigenvalues')})" if negative else ""


def _warnings(
    found: MatrixReport,
    internal: int,
    stored: Sequence[StoredMatrix],
    whole: Mapping[str, Sparse],
    contacts: Sequence[str],
    supports: Sequence[str],
) -> list[str]:
    mass, damping, stiffness = whole["mass"], whole["damping"], whole["stiffness"]
    said: list[str] = []
    if found.held == found.size:
        return [*said, "all freedoms are held: nothing is left that can vibrate"]
    if found.loose:
        many = counted(found.loose, "freedom has", "freedoms have")
        said.append(f"{many} neither mass nor stiffness; K has no inverse")
    if found.free and not supports:
        axes = ", ".join("xyz"[d - 1] for d in found.free)
        said.append(f"nothing in K resists moving the whole model along {axes}; are supports missing?")
    if found.mass == "zero":
        said.append("the mass is zero; without a mass nothing vibrates")
    elif found.mass == "indefinite":
        said.append("M is indefinite, and energies can be negative; is it the mass?")
    if negative := negative_mass(mass):
        said.append(f"{negative}; is the sign of every factor right?")
    if found.defect["mass"] > ROUNDING:
        said.append(f"M is not symmetric ({found.defect['mass']:.1e}); is it the mass?")
    if drawn := int(np.sum(stiffness.diagonal() < 0)):
        many = counted(drawn, "freedom has", "freedoms have")
        said.append(f"{many} a negative entry on the diagonal of K; is the sign of every factor right?")
    if found.entries["stiffness"]:
        said += _friction(found, internal, stored, contacts)
    else:
        said.append("the stiffness is zero; is a term missing, or its factor zero?")
    if found.damping == "indefinite":
        count = _eigenvalues(found.damping_negative)
        said.append(f"the symmetric part of C is indefinite{count}: it drives some motions, as falling friction does")
    if found.defect["damping"] > ROUNDING:
        skew = float(np.linalg.norm(0.5 * (damping - damping.T).data))
        share = skew / float(np.linalg.norm(damping.data))
        said.append(f"C has a gyroscopic (antisymmetric) part, {share:.0%} of its norm; right for rotating bodies only")
    return said


def _friction(
    found: MatrixReport, internal: int, stored: Sequence[StoredMatrix], contacts: Sequence[str]
) -> list[str]:
    """Where friction was to be expected in K and is not there."""
    made = found.multipliers or internal  # as a program makes them that has contacts of its own
    if found.coupling or (contacts and not made):
        return []
    of_k = [s for s in stored if s.role == "stiffness"]
    mend = "in Abaqus, ask for *STEP, UNSYMM=YES and a sliding contact with friction before *MATRIX GENERATE"
    if any(s.program == "CalculiX" or s.source.lower().endswith(".sti") for s in of_k):
        mend = "CalculiX stores one half only, whatever friction does; take the matrix from another program"
    elif of_k and not any(s.program == "Abaqus" for s in of_k):
        mend = "ask the program that wrote it for the matrix of sliding contact with friction, not symmetric"
        if not made and any(s.form for s in of_k):  # by hand, or by a program that knows nothing of contacts
            by = "its file says so" if any(s.form == "symmetric" for s in of_k) else "up to rounding"
            return [f"{NO_FRICTION}: K is symmetric, {by}, and without friction terms no modes can couple to flutter"]
    if any(s.form == "symmetric" for s in of_k):
        return [f"{LOST}: the file holds K as one half of a symmetric matrix; {mend}"]
    if any(s.form == "general" for s in of_k):
        return [f"{LOST}: K is stored as not symmetric, yet is, up to rounding; {mend}"]
    if found.multipliers:
        signs = f"{counted(found.multipliers, 'freedom looks', 'freedoms look')} like multipliers of a contact"
        return [f"{LOST}: {signs}, yet K is symmetric; {mend}"]
    if internal:
        signs = f"{counted(internal, 'freedom is internal', 'freedoms are internal')}, as contact makes them"
        return [f"{LOST}: {signs}, yet K is symmetric; {mend}"]
    return ["K is symmetric: without friction terms in it, no modes can couple to flutter"]
