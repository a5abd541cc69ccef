"""MUMPS on all processes of an MPI run through PETSc, for matrices whose factors one machine cannot hold.

One process, the first, runs the program and calls `SlepcFactor` as it would any other backend. All others wait in
`Team.serve` for its orders, each with its rows of the matrices and its share of their factors.
"""

from __future__ import annotations

import atexit
import itertools
import threading
from collections import deque
from collections.abc import Generator
from contextlib import contextmanager
from importlib import import_module
from typing import Any, NoReturn

import numpy as np
import scipy.sparse as sp

from ..errors import AnalysisError, CaseError
from ..heap import give_back
from ..typing import Sparse
from .interface import SLEPC_BUILD, Breakdown
from .ranks import Ranks, all_processes, deaf_to_interrupts, only_this, undisturbed

STOP, FACTORISE, SOLVE, FREE = range(4)

SINGULAR = (-6, -10)
TOO_LITTLE_SPACE = (-8, -9, -17, -20)
OUT_OF_MEMORY = (-5, -7, -13, -19)
# Per cent of working space above MUMPS's estimate: at first, and when it is given up.
SPACE, MOST_SPACE = 30, 20_000


class ProcessShare:
    """What one process holds of a factorised matrix of PETSc. All processes make theirs, solve and free together.

    fault: MUMPS's INFOG(1:2), the same in all processes; where the first is negative there are no factors.
    """

    def __init__(self, petsc: Any, ranks: Any, matrix: Any, symmetric: bool) -> None:
        self._petsc, self._ranks = petsc, ranks
        self._layout = matrix.getSizes()[0]
        counts = symmetric and np.dtype(petsc.ScalarType).kind == "f"
        space = SPACE
        while True:
            self._factor = _eliminate(petsc, ranks, matrix, symmetric, {14: space} | ({13: 1} if counts else {}))
            self.fault = int(self._factor.getMumpsInfog(1)), int(self._factor.getMumpsInfog(2))
            if self.fault[0] not in TOO_LITTLE_SPACE or space >= MOST_SPACE:
                break
            self._factor.destroy()
            space *= 2
        matrix.destroy()
        self.memory_bytes = max(int(self._factor.getMumpsInfog(22)), 1) * 1_000_000
        self.inertia = int(self._factor.getMumpsInfog(12)) if counts else None

    def solve(self, right: Any, transpose: bool) -> Any:
        """This process's rows of A⁻¹ right or A⁻ᵀ right, given those of right (rows, r)."""
        petsc, wide = self._petsc, right.shape[1]
        layout = (self._layout, (None, wide))
        given = petsc.Mat().createDense(layout, array=np.asfortranarray(right), comm=self._ranks)
        found = petsc.Mat().createDense(layout, comm=self._ranks)
        found.setUp()
        for block in (given, found):
            block.assemble()
        self._factor.setMumpsIcntl(9, 0 if transpose else 1)
        self._factor.matSolve(given, found)
        answer = np.array(found.getDenseArray(), order="C")
        for block in (given, found):
            block.destroy()
        return answer

    def free(self) -> None:
        """Give this process's memory back, also to the system, as others need it: PETSc sets malloc to keep it."""
        self._factor.destroy()
        give_back()


def _distributed(petsc: Any, ranks: Any, size: int, rows: tuple[Any, Any, Any], symmetric: bool) -> Any:
    """PETSc's matrix (size, size) of the rows that each process gives; of symmetric ones the upper triangle."""
    here = len(rows[0]) - 1
    layout = ((here, size), (here, size))
    starts, columns, values = rows
    entries = (starts.astype(petsc.IntType), columns.astype(petsc.IntType), values.astype(petsc.ScalarType))
    if symmetric:
        matrix = petsc.Mat().createSBAIJ(layout, 1, csr=entries, comm=ranks)
        matrix.setOption(petsc.Mat.Option.SYMMETRIC, True)
    else:
        matrix = petsc.Mat().createAIJ(layout, csr=entries, comm=ranks)
    matrix.assemble()
    return matrix


def _eliminate(petsc: Any, ranks: Any, matrix: Any, symmetric: bool, controls: dict[int, int]) -> Any:
    """PETSc's factor of the matrix; MUMPS's INFOG(1) tells whether it is one."""
    conditioner = petsc.PC().create(ranks)
    conditioner.setOperators(matrix)
    conditioner.setType("cholesky" if symmetric else "lu")
    conditioner.setFactorSolverType("mumps")
    conditioner.setFactorSetUpSolverType()
    factor = conditioner.getFactorMatrix()
    for number, value in controls.items():
        factor.setMumpsIcntl(number, value)
    conditioner.setUp()
    conditioner.destroy()
    return factor


class Team:
    """All processes and what they hold for each other. Made once, by `join`, in every process."""

    def __init__(self, words: object) -> None:
        self.petsc = _petsc()
        self.ranks = Ranks(all_processes())
        self._all: Any = self.petsc.COMM_WORLD
        if self.ranks.size != self._all.getSize():
            raise ImportError("mpi4py and petsc4py use different MPI libraries")
        # Different command lines are different computations, started together to run side by side.
        self.apart = self.ranks.size > 1 and words is not None and not self.ranks.alike(words)
        if self.apart:
            self.ranks, self._all = Ranks(only_this()), self.petsc.COMM_SELF
        self._shares: dict[int, ProcessShare] = {}
        self._numbers = itertools.count(1)
        self._lock = threading.RLock()
        self._forgotten: deque[int] = deque()
        self._dismissed = False
        if self.ranks.number == 0:
            # Registered after MPI's and PETSc's own ends, hence done before them.
            atexit.register(self._dismiss)

    # -- in the first process ------------------------------------------------------------------------------------------
    def factorise(self, matrix: Sparse, symmetric: bool) -> tuple[int, ProcessShare]:
        """A number for the factors of a matrix (csr), and this process's share of them."""
        self._require_counts(matrix)
        held = sp.csr_array(sp.triu(matrix, format="csr")) if symmetric else matrix
        held.sort_indices()
        number = next(self._numbers)
        with self._together():
            while self._forgotten:
                self._free(self._forgotten.popleft())
            given = self._handed_out(number, held, symmetric)
            del held  # where there are factors, there is no memory to spare
            self._shares[number] = share = ProcessShare(self.petsc, self._all, given, symmetric)
        return number, share

    def _require_counts(self, matrix: Sparse) -> None:
        whole = np.dtype(self.petsc.IntType)
        most = int(np.diff(matrix.indptr[self.ranks.bounds(matrix.shape[0])].astype(np.int64)).max())
        if max(most, matrix.shape[0]) > np.iinfo(whole).max:  # ty: ignore[no-matching-overload]
            raise AnalysisError(
                f"PETSc cannot count {most} entries of one process's {matrix.shape[0]} columns with "
                f"{8 * whole.itemsize}-bit numbers; start more processes, or build PETSc --with-64-bit-indices"
            )

    def _handed_out(self, number: int, matrix: Sparse, symmetric: bool) -> Any:
        """Order a factorisation, give all others their rows, and make PETSc's matrix."""
        n = matrix.shape[0]
        bounds = self.ranks.bounds(n)
        self.ranks.order(FACTORISE, number, n, int(symmetric), int(matrix.dtype.kind == "c"))
        for other in range(1, self.ranks.size):
            starts, columns, values = _rows(matrix, bounds[other], bounds[other + 1])
            self.ranks.send(starts.astype(self.petsc.IntType), other)
            self.ranks.send(columns.astype(self.petsc.IntType), other)
            self.ranks.send(values, other)
        return _distributed(self.petsc, self._all, n, _rows(matrix, bounds[0], bounds[1]), symmetric)

    def solve(self, number: int, right: Any, transpose: bool) -> Any:
        """A⁻¹ right or A⁻ᵀ right of a factor; right (n, r) of PETSc's own numbers."""
        bounds = self.ranks.bounds(right.shape[0])
        answer = np.empty(right.shape, dtype=right.dtype)
        with self._together():
            self.ranks.order(SOLVE, number, *right.shape, int(transpose))
            for other in range(1, self.ranks.size):
                self.ranks.send(right[bounds[other] : bounds[other + 1]], other)
            answer[: bounds[1]] = self._shares[number].solve(right[: bounds[1]], transpose)
            for other in range(1, self.ranks.size):
                rows = slice(bounds[other], bounds[other + 1])
                answer[rows] = self.ranks.receive(answer[rows].shape, answer.dtype, other)
        return answer

    def free(self, number: int) -> None:
        """Give the memory of a factor back, in all processes."""
        if not self._dismissed:
            with self._together():
                self._free(number)

    def forget(self, number: int) -> None:
        """Have a factor freed when there is the next thing to do: Python may collect it amid another."""
        self._forgotten.append(number)

    def _free(self, number: int) -> None:
        share = self._shares.pop(number, None)
        if share is not None:
            self.ranks.order(FREE, number)
            share.free()

    def _dismiss(self) -> None:
        """Let the other processes end, whatever became of the program."""
        with self._together():
            for number in list(self._shares):
                self._free(number)
            self.ranks.order(STOP)
            self._dismissed = True

    @contextmanager
    def _together(self) -> Generator[None, None, None]:
        """One order at a time, from its beginning to its end in all processes."""
        with self._lock, undisturbed():
            try:
                yield
            except BaseException as error:
                if self.ranks.size > 1:
                    self.ranks.abort(error)
                raise AnalysisError(f"the sparse solver failed: {error or type(error).__name__}") from error

    # -- in all others -------------------------------------------------------------------------------------------------
    def serve(self) -> NoReturn:
        """Do what the first process orders until it ends, then end, too."""
        deaf_to_interrupts()
        try:
            while self._obey(self.ranks.next_order()):
                pass
        except BaseException as error:
            self.ranks.abort(error)
        raise SystemExit(0)

    def _obey(self, order: list[int]) -> bool:
        what, number = order[:2]
        if what == FACTORISE:
            self._shares[number] = ProcessShare(self.petsc, self._all, self._received(*order[2:5]), bool(order[3]))
        elif what == SOLVE:
            n, wide, transpose = order[2:5]
            first, end = self.ranks.bounds(n)[self.ranks.number :][:2]
            right = self.ranks.receive((int(end - first), wide), self.petsc.ScalarType)
            self.ranks.send(self._shares[number].solve(right, bool(transpose)), 0)
        elif what == FREE:
            self._shares.pop(number).free()
        return what != STOP

    def _received(self, n: int, symmetric: int, is_complex: int) -> Any:
        """PETSc's matrix, of the rows that the first process sends and its own."""
        first, end = self.ranks.bounds(n)[self.ranks.number :][:2]
        starts = self.ranks.receive((int(end - first) + 1,), self.petsc.IntType)
        columns = self.ranks.receive((int(starts[-1]),), self.petsc.IntType)
        values = self.ranks.receive((int(starts[-1]),), np.complex128 if is_complex else np.float64)
        return _distributed(self.petsc, self._all, n, (starts, columns, values), bool(symmetric))


def _rows(matrix: Sparse, first: int, end: int) -> tuple[Any, Any, Any]:
    """Rows [first, end) of a csr matrix: where each begins, columns, values."""
    starts = matrix.indptr[first : end + 1].astype(np.int64)
    entries = slice(int(starts[0]), int(starts[-1]))
    return starts - starts[0], matrix.indices[entries], matrix.data[entries]


def _petsc() -> Any:
    # Its own handlers would turn a closed pipe into an abort of all processes.
    import_module("petsc4py").init(["stridor", "-no_signal_handler"])
    petsc: Any = import_module("petsc4py.PETSc")
    if np.dtype(petsc.RealType) != np.float64:
        raise CaseError("solver", "slepc", f"PETSc calculates with {petsc.RealType.__name__} here; {SLEPC_BUILD}")
    if not petsc.Sys.hasExternalPackage("mumps"):
        raise CaseError("solver", "slepc", f"PETSc has been built without MUMPS here; {SLEPC_BUILD}")
    return petsc


_team: Team | None = None


def join(words: object = None) -> Team:
    """Meet the other processes: returns in the first one; all others serve it and end with it (SystemExit).

    words: with it every process goes on alone unless all have the same ones. Raises ImportError or CaseError where
    PETSc or MPI cannot be used.
    """
    global _team
    if _team is None:
        _team = Team(words)
    if _team.ranks.number > 0:
        _team.serve()
    return _team


class SlepcFactor:
    """Factors shared by all processes. PETSc for complex numbers keeps real matrices as complex ones, too.

    inertia is the count of negative pivots where PETSc is built for real numbers and the matrix is symmetric.
    """

    def __init__(self, matrix: Sparse, symmetric: bool, saddle: bool) -> None:
        self._number: int | None = None
        self._team = join()
        self._kind: Any = self._team.petsc.ScalarType
        if matrix.dtype.kind == "c" and np.dtype(self._kind).kind == "f":
            raise CaseError(
                "solver", "slepc", f"PETSc is built for real numbers here and the matrix is complex; {SLEPC_BUILD}"
            )
        self._number, share = self._team.factorise(matrix, symmetric)
        self.memory_bytes, self.inertia = share.memory_bytes, share.inertia
        fault = share.fault[0]
        if fault < 0:
            self.free()
            if fault in SINGULAR:
                raise Breakdown(f"MUMPS finds a pivot of zero (INFOG(1:2) = {share.fault})")
            if fault in (*TOO_LITTLE_SPACE, *OUT_OF_MEMORY):
                raise AnalysisError(
                    f"the sparse solver ran out of memory on {matrix.shape[0]} freedoms with "
                    f"{self._team.ranks.size} processes; start more of them on more machines, or use a coarser mesh"
                )
            raise AnalysisError(f"the sparse solver failed: MUMPS says INFOG(1:2) = {share.fault}")

    def solve(self, right: Any, transpose: bool) -> Any:
        """One unrefined solve, all columns at once."""
        assert self._number is not None
        if right.dtype.kind == "c" or np.dtype(self._kind).kind == "f":
            return self._team.solve(self._number, right, transpose)
        # Two real columns make a complex one; the factors are real, so nothing of one gets into the other.
        wide = right.shape[1]
        pairs = (wide + 1) // 2
        block = np.zeros((right.shape[0], pairs), dtype=self._kind)
        block.real = right[:, :pairs]
        block.imag[:, : wide - pairs] = right[:, pairs:]
        answer = self._team.solve(self._number, block, transpose)
        return np.hstack([answer.real, answer.imag[:, : wide - pairs]])

    def free(self) -> None:
        """All processes give their memory back."""
        if self._number is not None:
            self._team.free(self._number)
            self._number = None

    def __del__(self) -> None:
        number = getattr(self, "_number", None)
        if number is not None:
            self._team.forget(number)
