"""Factorise and solve with any of the sparse direct solvers, to a backward error that all of them share."""

from __future__ import annotations

import logging
import platform
import sys
import time
from dataclasses import dataclass
from functools import cache
from types import TracebackType
from typing import Any

import numpy as np
import scipy.sparse as sp

from ..errors import AnalysisError
from ..typing import Array, ComplexArray, Sparse
from .backends import PACKAGES, choose, installed, start
from .interface import Backend, Breakdown

_log = logging.getLogger("stridor")

# Solvers keep a copy of the block they work on; wider blocks win nothing more.
BLOCK = 64
SLOW = 10.0  # seconds for one factorisation by SuperLU, from which on it is said what would be faster
TOLD = 5000  # unknowns from which on the log speaks of factors
BACKWARD_ERROR = 1e-14
REFINEMENTS = 5
# A matrix that a relative change of its entries of this size makes singular is singular for us.
SINGULAR = 1e-13
# Pivots that a program makes up are not larger than this, relative to the matrix.
PERTURBED = 1e-5


class SingularMatrix(AnalysisError):
    """The matrix has no inverse to working precision; motion (n,) is what it does not resist, None if unknown."""

    def __init__(self, message: str, motion: Any = None) -> None:
        super().__init__(message)
        self.motion = motion


@dataclass(frozen=True)
class Sizes:
    """What backward errors are measured against: |A| (n, n), and its largest entries by rows and by columns (n,)."""

    entries: Sparse
    rows: Array
    columns: Array

    @staticmethod
    def of(matrix: Sparse, largest: tuple[Array, Array] | None = None) -> Sizes:
        """Those of a matrix in csr form, whose largest entries may be known."""
        entries = sp.csr_array((np.abs(matrix.data), matrix.indices, matrix.indptr), shape=matrix.shape)
        return Sizes(entries, *(largest or largest_entries(matrix)))

    @property
    def transposed(self) -> Sizes:
        """Those of Aᵀ."""
        return Sizes(self.entries.T, self.columns, self.rows)

    def residual(self, matrix: Sparse, right: Any, answer: Any) -> tuple[Any, float]:
        """b − A x (n, r) and max |b − A x| / (|A| |x| + |b|) over all rows (Arioli, Demmel and Duff 1989)."""
        with np.errstate(all="ignore"):
            residual = right - matrix @ answer
            length = np.abs(answer)
            terms = self.entries @ length + np.abs(right)
            # Rows whose terms are nothing but rounding are measured against the largest that they could be.
            largest = self.rows[:, None] * length.max(axis=0, initial=0.0)
            terms = np.where(terms < 1e3 * np.finfo(float).eps * largest, terms + largest, terms)
            ratio = np.abs(residual) / np.where(terms > 0, terms, 1.0)
        return residual, float(np.max(ratio, initial=0.0)) if np.isfinite(ratio).all() else np.inf


class Factor:
    """A factorised matrix (n, n). Use it in a `with` block, or call `free`, where memory is short.

    solver: name of the program. seconds spent on factorising. memory_bytes: its own estimate for the factors.
    inertia: number of negative pivots, hence eigenvalues, of a real symmetric matrix; None where it is not told.
    """

    solver: str
    seconds: float
    memory_bytes: int

    def __init__(
        self, matrix: Sparse, backend: Backend, solver: str, started: float, largest: tuple[Array, Array],
        symmetric: bool,
    ) -> None:  # fmt: skip
        self._matrix = matrix
        self._symmetric = symmetric
        self._sizes = Sizes.of(matrix, largest)
        self._backend: Backend | None = backend
        self.solver = solver
        self.memory_bytes = backend.memory_bytes
        self.seconds = time.perf_counter() - started

    def solve(self, right: Array | ComplexArray, *, transpose: bool = False, refine: bool = True) -> Any:
        """A⁻¹ right, or A⁻ᵀ right (never conjugated), refined to a componentwise backward error of about 10⁻¹⁴.

        right (n,) or (n, r); the answer has its shape and is complex where right or the matrix is. Many columns at
        once cost far less than one after the other. refine=False takes the answer as elimination gives it, unjudged,
        in about half the time: enough where it spans a space and is judged otherwise. Raises SingularMatrix where
        refinement does not converge.
        """
        if self._backend is None:
            raise ValueError("this factor has been freed")
        given: Any = np.asarray(right)
        n = self._matrix.shape[0]
        if given.ndim not in (1, 2) or given.shape[0] != n:
            raise ValueError(f"the right side has shape {given.shape}; expected ({n},) or ({n}, r)")
        block = given[:, None] if given.ndim == 1 else given
        # Of A = Aᵀ the answers are the same, and SuperLU takes three times as long for the transposed ones.
        transpose = transpose and not self._symmetric
        if self._matrix.dtype.kind == "f" and block.dtype.kind == "c":
            r = block.shape[1]
            parts = self._solve_block(np.concatenate([block.real, block.imag], axis=1), transpose, refine)
            answer = parts[:, :r] + 1j * parts[:, r:]
        else:
            answer = self._solve_block(block.astype(self._matrix.dtype), transpose, refine)
        return answer[:, 0] if given.ndim == 1 else answer

    @property
    def span(self) -> tuple[float, float] | None:
        """The largest and the smallest of the rows' largest entries, where they are so far apart that rounding of one
        is more than the other, and no motion can be said to be resisted or not; else None."""
        if not len(self._sizes.rows):
            return None
        high, low = float(np.max(self._sizes.rows)), float(np.min(self._sizes.rows))
        return (high, low) if low < SINGULAR * high else None

    @property
    def inertia(self) -> int | None:
        """See the class. Raises ValueError once the factors are freed."""
        if self._backend is None:
            raise ValueError("this factor has been freed")
        return self._backend.inertia

    def free(self) -> None:
        """Give the memory of the factors back; solving is over then."""
        if self._backend is not None:
            self._backend.free()
            self._backend = None

    def __enter__(self) -> Factor:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.free()

    def _solve_block(self, right: Any, transpose: bool, refine: bool) -> Any:
        answer = np.empty(right.shape, dtype=self._matrix.dtype)
        for first in range(0, right.shape[1], BLOCK):
            columns = slice(first, first + BLOCK)
            part = np.ascontiguousarray(right[:, columns])
            answer[:, columns] = self._refined(part, transpose) if refine else self._once(part, transpose)
        return answer

    def _once(self, right: Any, transpose: bool) -> Any:
        assert self._backend is not None
        answer = self._backend.solve(right.copy(), transpose)
        if not np.isfinite(answer).all():
            raise SingularMatrix("the matrix is singular or badly scaled: solving overflows")
        return answer

    def _refined(self, right: Any, transpose: bool) -> Any:
        assert self._backend is not None
        answer = self._backend.solve(right.copy(), transpose)
        residual, error = self._residual(right, answer, transpose)
        for _ in range(REFINEMENTS):
            if not error > BACKWARD_ERROR:
                break
            better = answer + self._backend.solve(residual.copy(), transpose)
            residual, improved = self._residual(right, better, transpose)
            if not improved < error:
                break
            stalled = improved > 0.5 * error
            answer, error = better, improved
            if stalled:
                break
        if not error < 1e-8:
            raise SingularMatrix(
                f"the matrix is singular or badly scaled: solving leaves a backward error of {error:.1e}"
            )
        return answer

    def _residual(self, right: Any, answer: Any, transpose: bool) -> tuple[Any, float]:
        """See `Sizes.residual`."""
        matrix, sizes = (self._matrix.T, self._sizes.transposed) if transpose else (self._matrix, self._sizes)
        return sizes.residual(matrix, right, answer)

    def unresisted(self) -> tuple[float, Any]:
        """How near the matrix is to a singular one, ‖A x‖ / ‖|A| |x|‖ row by row scaled, and that motion x (n,).

        One step of inverse iteration from an arbitrary force finds x: a singular matrix answers with its null vector.
        Raises Breakdown where elimination overflowed.
        """
        if self._backend is None:
            raise ValueError("this factor has been freed")
        n = self._matrix.shape[0]
        sign = np.where(np.random.default_rng(1).random(n) < 0.5, -1.0, 1.0)
        with np.errstate(all="ignore"):
            motion = self._backend.solve((sign * self._sizes.rows).astype(self._matrix.dtype)[:, None], False)[:, 0]
            motion = motion / np.abs(motion).max(initial=0.0)
            if not np.isfinite(motion).all():
                raise Breakdown("elimination overflows")
            ratio = self._resistance(motion)
            # Some programs perturb small pivots, and what is found then is the null vector of the perturbed matrix.
            # Refining it towards A x = 0 leaves what is in the null space of the matrix itself, and nothing else.
            for _ in range(4):
                if not SINGULAR <= ratio < PERTURBED:
                    break
                cleaned = motion - self._backend.solve((self._matrix @ motion)[:, None], False)[:, 0]
                cleaned = cleaned / np.abs(cleaned).max()
                if not np.isfinite(cleaned).all():
                    break
                motion, ratio = cleaned, min(ratio, self._resistance(cleaned))
            return ratio, motion

    def _resistance(self, motion: Any) -> float:
        rows = self._sizes.rows
        left = np.abs(self._matrix @ motion) / rows
        return float(left.max() / ((self._sizes.entries @ np.abs(motion)) / rows).max())


def factorise(
    matrix: Sparse, *, symmetric: bool = False, saddle: bool = False, solver: str | None = None, tried: bool = True
) -> Factor:
    """Factorise a sparse matrix (n, n), real or complex.

    symmetric: A = Aᵀ (not conjugated), which halves the work. saddle: [[K, Bᵀ], [B, −C]] with K positive
    (semi)definite and rows of zeros allowed on the diagonal of C, as multipliers make them; with friction Bᵀ may be
    another matrix. solver: "mumps", "pardiso", "superlu" or, over all processes of an MPI run, "slepc"; by default the
    environment variable STRIDOR_SOLVER, else the first of the others that is installed. tried: whether the factors are
    tried for a singular matrix at once, which costs two solutions; without it solving alone tells, by its error.

    Raises SingularMatrix (an AnalysisError) for a matrix without inverse to working precision, CaseError for an
    unknown or missing solver.
    """
    name = choose(solver)
    begin = start(name)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise ValueError(f"the matrix has shape {matrix.shape}; expected a square one")
    kind = np.complex128 if matrix.dtype.kind == "c" else np.float64
    held = sp.csr_array(matrix, dtype=kind)
    held.sum_duplicates()
    if not np.isfinite(held.data).all():
        raise AnalysisError("the matrix has entries that are not finite numbers")
    # What other programs take of the machine is not the solver's.
    started, worked = time.perf_counter(), time.process_time()
    largest = largest_entries(held)
    empty = np.flatnonzero((largest[0] == 0) | (largest[1] == 0))
    if len(empty):
        motion = np.zeros(held.shape[0])
        motion[empty[0]] = 1.0
        raise SingularMatrix(f"the matrix is singular: row {empty[0]} is empty{_of(len(empty))}", motion)
    if symmetric:
        _require_symmetry(held)
    try:
        factor = Factor(held, begin(held, symmetric, saddle), name, started, largest, symmetric)
        ratio, motion = factor.unresisted() if held.shape[0] and tried else (1.0, None)
    except Breakdown:
        # Enough on the diagonal to get through: solved with that, the matrix still shows what it does not resist.
        stiffened = sp.csr_array(held + sp.diags_array(1e-3 * PERTURBED * largest[0]))
        try:
            factor = Factor(held, begin(stiffened, symmetric, saddle), name, started, largest, symmetric)
            ratio, motion = 0.0, factor.unresisted()[1]
        except Breakdown as error:
            raise SingularMatrix("the matrix is singular: elimination meets a pivot of zero") from error
    if held.shape[0] >= TOLD:
        _log.info("%s: %d unknowns in %.1f s, %.0f MB", name, held.shape[0], factor.seconds, factor.memory_bytes / 1e6)
    if name == "superlu" and time.process_time() - worked > SLOW and not (installed("mumps") or installed("pardiso")):
        _say_what_is_faster()
    require_regular(factor, ratio, motion)
    return factor


def require_regular(factor: Factor, ratio: float, motion: Any) -> None:
    """Free the factors and raise SingularMatrix where `Factor.unresisted` found a motion that nothing resists."""
    if ratio < SINGULAR:
        factor.free()
        at = "" if motion is None else f"; nothing resists a motion of freedom {int(np.argmax(np.abs(motion)))}"
        if (span := factor.span) is not None:
            at = f"; rows have entries up to {span[0]:.3g} and up to {span[1]:.3g}, too far apart for its digits"
        raise SingularMatrix(f"the matrix is singular to working precision{at}", motion)


@cache
def _say_what_is_faster() -> None:
    """Once in a process: 98 000 freedoms of a block take PARDISO and MUMPS 10 s, SuperLU 35 s (docs/validation.md).
    PARDISO has wheels for Linux and Windows on processors of one kind."""
    wheels = sys.platform != "darwin" and platform.machine() in ("x86_64", "AMD64")
    name, program = ("pardiso", "PARDISO") if wheels else ("mumps", "MUMPS")
    words = "SuperLU is slow on matrices as large as these; %s takes about a third: %s"
    _log.warning(words, program, PACKAGES[name][1])



def largest_entries(matrix: Sparse) -> tuple[Array, Array]:
    """The largest entries of the rows and of the columns (n,); SciPy's own way takes ten times longer."""
    size = np.abs(matrix.data)
    rows, columns = np.zeros(matrix.shape[0]), np.zeros(matrix.shape[1])
    filled = np.flatnonzero(np.diff(matrix.indptr))
    rows[filled] = np.maximum.reduceat(size, matrix.indptr[filled]) if len(filled) else 0.0
    np.maximum.at(columns, matrix.indices, size)
    return rows, columns


def _of(count: int) -> str:
    return "" if count == 1 else f" (and {count - 1} more)"


def _require_symmetry(matrix: Sparse) -> None:
    """Two arbitrary vectors tell: xᵀ A y = yᵀ A x."""
    x, y = np.random.default_rng(2).standard_normal((2, matrix.shape[0]))
    terms = float(np.abs(x) @ (abs(matrix) @ np.abs(y)))
    if abs(x @ (matrix @ y) - y @ (matrix @ x)) > 1e-11 * terms:
        raise ValueError("the matrix is not symmetric; factorise it with symmetric=False")
