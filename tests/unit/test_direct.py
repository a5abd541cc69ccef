"""The sparse direct solvers: every one that is installed gives the same answers and finds the same faults."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest
import scipy.sparse as sp

from stridor import direct
from stridor.direct import factor, inertia
from stridor.direct.bordered import MOST, WithoutRows
from stridor.errors import AnalysisError, CaseError

solvers = pytest.mark.parametrize("solver", direct.available())
rng = np.random.default_rng(3)


def plate(rows=12, columns=9, held=True):
    """Laplacian of a grid of springs of very different stiffness, held at one corner or free."""
    along = lambda n: sp.diags_array([-np.ones(n - 1), 1.0 * np.ones(n)], offsets=[-1, 0], shape=(n, n)).tocsr()[1:]  # noqa: E731
    steps = sp.vstack(
        [sp.kron(along(rows), sp.eye_array(columns)), sp.kron(sp.eye_array(rows), along(columns))], format="csr"
    )
    springs = sp.diags_array(np.logspace(0, 6, steps.shape[0]))
    matrix = sp.csr_array(steps.T @ springs @ steps)
    if held:
        matrix = matrix + sp.csr_array(([1e3], ([0], [0])), shape=matrix.shape)
    return sp.csr_array(matrix)


def unsymmetric(size=100):
    entries = sp.random_array((size, size), density=0.05, rng=rng)
    return sp.csr_array(entries + sp.diags_array(rng.uniform(1, 2, size)) - 0.3 * sp.eye_array(size, k=3))


def saddle(mu=0.0):
    """The plate tied in four places; with friction what ties is not what pulls."""
    stiffness = plate(held=False)
    places = np.array([5, 40, 41, 100])
    ties = sp.csr_array((np.ones(4), (np.arange(4), places)), shape=(4, stiffness.shape[0]))
    pushes = ties + mu * sp.csr_array((np.ones(4), (np.arange(4), places + 1)), shape=ties.shape)
    return sp.csr_array(sp.block_array([[stiffness, -1e4 * pushes.T], [-1e4 * ties, None]]))


def backward_error(matrix, answer, right):
    return float(np.max(abs(matrix @ answer - right) / (abs(matrix) @ abs(answer) + abs(right))))


def cases():
    damped = sp.csr_array(plate().astype(complex) + 10j * sp.eye_array(108))
    return {
        "symmetric": (plate(), True, False),
        "symmetric as general": (plate(), False, False),
        "unsymmetric": (unsymmetric(), False, False),
        "complex symmetric": (damped, True, False),
        "complex unsymmetric": (sp.csr_array(unsymmetric() * (1 + 0.5j) + 1j * sp.eye_array(100, k=1)), False, False),
        "saddle": (saddle(), True, True),
        "saddle with friction": (saddle(0.4), False, True),
        "one freedom": (sp.csr_array([[2.0]]), True, False),
    }


@solvers
@pytest.mark.parametrize("name", cases())
@pytest.mark.parametrize("transpose", [False, True])
@pytest.mark.parametrize("shape", [None, 1, 5, 70])
def test_answers_are_exact_to_rounding(solver, name, transpose, shape):
    matrix, symmetric, is_saddle = cases()[name]
    n = matrix.shape[0]
    right = rng.standard_normal(n if shape is None else (n, shape))
    target = matrix.T if transpose else matrix
    with direct.factorise(matrix, symmetric=symmetric, saddle=is_saddle, solver=solver) as factor:
        for b in (right, right * (1 - 2j)):
            kept = b.copy()
            answer = factor.solve(b, transpose=transpose)
            assert answer.shape == b.shape
            assert np.iscomplexobj(answer) == (np.iscomplexobj(b) or np.iscomplexobj(matrix))
            assert np.array_equal(b, kept)  # nothing that is given is overwritten
            assert backward_error(target, answer, b) < 1e-13
            assert np.allclose(answer, np.linalg.solve(target.toarray(), b), rtol=1e-6)


@solvers
def test_a_factor_says_what_it_is(solver):
    with direct.factorise(plate(), symmetric=True, solver=solver) as factor:
        assert factor.solver == solver
        assert factor.seconds > 0
        assert factor.memory_bytes > 8 * 108
        assert factor.solve(np.zeros((108, 0))).shape == (108, 0)
    with pytest.raises(ValueError, match="freed"):
        factor.solve(np.zeros(108))


@solvers
def test_inertia_counts_the_eigenvalues_below_a_shift(solver):
    stiffness = plate()
    values = np.linalg.eigvalsh(stiffness.toarray())
    for below in (0, 7, 60):
        shift = 0.0 if below == 0 else 0.5 * (values[below - 1] + values[below])
        matrix = sp.csr_array(stiffness - shift * sp.eye_array(108))
        counted = direct.factorise(matrix, symmetric=True, solver=solver).inertia
        # SuperLU tells it where all pivots are from the diagonal.
        assert counted == below or (solver == "superlu" and below and counted is None)
    assert direct.factorise(stiffness, solver=solver).inertia is None


@solvers
@pytest.mark.parametrize("symmetric", [True, False])
def test_singular_matrices_are_found(solver, symmetric):
    """A free structure, one of two bodies free, a constraint given twice, a row of zeros."""
    free = plate(held=False)
    both = sp.csr_array(sp.block_diag([plate(), free]))
    twice = sp.csr_array(
        sp.block_array([[plate(), sp.csr_array(np.eye(108)[:, [3, 3]])], [sp.csr_array(np.eye(108)[[3, 3]]), None]])
    )
    for matrix in (free, both, twice, sp.csr_array(np.diag([1.0, 0.0, 2.0])), sp.csr_array((4, 4))):
        with pytest.raises(direct.SingularMatrix, match="the matrix is singular"):
            direct.factorise(matrix, symmetric=symmetric, solver=solver)


@solvers
@pytest.mark.parametrize("symmetric", [True, False])
def test_the_free_motion_is_told(solver, symmetric):
    both = sp.csr_array(sp.block_diag([plate(), plate(held=False)]))
    with pytest.raises(direct.SingularMatrix) as caught:
        direct.factorise(both, symmetric=symmetric, solver=solver)
    motion = caught.value.motion
    assert np.abs(motion[:108]).max() < 1e-6 * np.abs(motion[108:]).min()


@solvers
def test_constraints_that_are_given_twice_are_told_from_free_motion(solver):
    tie = np.eye(108)[[3, 3]]
    twice = sp.csr_array(sp.block_array([[plate(), sp.csr_array(tie.T)], [sp.csr_array(tie), None]]))
    with pytest.raises(direct.SingularMatrix) as caught:
        direct.factorise(twice, symmetric=True, saddle=True, solver=solver)
    motion = caught.value.motion
    assert np.abs(motion[:108]).max() < 1e-6
    assert motion[108] == pytest.approx(-motion[109])


@solvers
def test_a_badly_conditioned_matrix_is_not_singular(solver):
    """Slender structures have condition numbers of 10¹² and answers to them."""
    matrix = sp.csr_array(np.diag(np.logspace(0, 12, 50)) + 0.1 * np.eye(50, k=1) + 0.1 * np.eye(50, k=-1))
    right = rng.standard_normal(50)
    answer = direct.factorise(matrix, symmetric=True, solver=solver).solve(right)
    assert np.allclose(answer, np.linalg.solve(matrix.toarray(), right), rtol=1e-12)


@solvers
def test_wrong_symmetry_and_shapes_are_refused(solver):
    with pytest.raises(ValueError, match="not symmetric"):
        direct.factorise(unsymmetric(), symmetric=True, solver=solver)
    with pytest.raises(ValueError, match="expected a square one"):
        direct.factorise(sp.csr_array((3, 4)), solver=solver)
    with pytest.raises(ValueError, match=r"shape \(7,\); expected \(108,\)"):
        direct.factorise(plate(), solver=solver).solve(np.zeros(7))
    with pytest.raises(AnalysisError, match="not finite"):
        direct.factorise(sp.csr_array([[np.nan]]), solver=solver)


def test_the_solver_is_chosen_by_argument_then_variable(monkeypatch):
    monkeypatch.delenv("STRIDOR_SOLVER", raising=False)
    assert direct.factorise(plate()).solver == direct.available()[0]
    monkeypatch.setenv("STRIDOR_SOLVER", "superlu")
    assert direct.factorise(plate()).solver == "superlu"
    monkeypatch.setenv("STRIDOR_SOLVER", "umfpack")
    with pytest.raises(
        CaseError, match=r"environment variable STRIDOR_SOLVER: 'umfpack' – no such solver; installed: .*superlu"
    ):
        direct.factorise(plate())
    assert direct.factorise(plate(), solver="superlu").solver == "superlu"


def test_a_missing_package_says_how_to_install_it(monkeypatch):
    found = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *a: None if name in ("mumps", "pypardiso") else found(name, *a)
    )
    monkeypatch.delenv("STRIDOR_SOLVER", raising=False)
    assert direct.available() == ("superlu",)
    assert direct.factorise(plate()).solver == "superlu"
    with pytest.raises(CaseError, match=r"is not installed; pip install \"python-mumps.*libmumps-seq-dev"):
        direct.factorise(plate(), solver="mumps")
    with pytest.raises(CaseError, match=r"pip install \"pypardiso>="):
        direct.factorise(plate(), solver="pardiso")


@pytest.mark.parametrize(
    ("machine", "said_of_it"),
    [
        ("x86_64", 'PARDISO takes about a third: pip install "pypardiso>=0.4.6"'),
        ("arm64", 'MUMPS takes about a third: pip install "python-mumps>=0.0.4"'),
    ],
)
def test_what_is_faster_than_superlu_is_said_once_where_it_is_slow(machine, said_of_it, monkeypatch, caplog):
    monkeypatch.setattr(factor.sys, "platform", "linux")
    monkeypatch.setattr(factor.platform, "machine", lambda: machine)
    matrix = sp.csr_array(sp.diags_array(np.arange(1.0, 9.0)))
    factor._say_what_is_faster.cache_clear()
    direct.factorise(matrix, solver="superlu")
    assert not caplog.records
    monkeypatch.setattr(factor, "SLOW", -1.0)
    monkeypatch.setattr(factor, "installed", lambda _: False)
    for _ in range(2):
        direct.factorise(matrix, solver="superlu")
    (said,) = caplog.records
    assert said.levelname == "WARNING"
    assert said_of_it in said.getMessage()
    factor._say_what_is_faster.cache_clear()


@solvers
@pytest.mark.parametrize("ties", ["none", "rigid", "springs"])
def test_negative_eigenvalues_are_counted_whichever_solver_there_is(solver, ties):
    stiffness = plate()
    values = np.linalg.eigvalsh(stiffness.toarray())
    shift = 0.5 * (values[6] + values[7])
    matrix, more = sp.csr_array(stiffness - shift * sp.eye_array(108)), 0
    if ties != "none":
        rows = sp.csr_array((np.ones(2), (np.arange(2), [5, 40])), shape=(2, 108))
        corner = None if ties == "rigid" else -1e-6 * sp.eye_array(2)
        matrix = sp.csr_array(sp.block_array([[matrix, rows.T], [rows, corner]]))
        more = 2
    exact = int(np.count_nonzero(np.linalg.eigvalsh(matrix.toarray()) < 0))
    told = direct.negative_eigenvalues(matrix, saddle=bool(more), solver=solver)
    # Pivots of zero on the diagonal: only a solver that counts for itself tells.
    assert told == exact or (solver in ("superlu", "slepc") and ties == "rigid" and told is None)
    with pytest.raises(direct.SingularMatrix):
        direct.negative_eigenvalues(plate(held=False), solver=solver)


def test_pivots_without_exchanges_are_believed_only_where_they_answer_exactly(monkeypatch):
    """A tiny pivot on the diagonal loses every digit: its sign counts for nothing."""
    monkeypatch.setattr(inertia.SuperluFactor, "inertia", property(lambda self: None if self._checked else 1))
    honest = inertia.SuperluFactor.__init__

    def start(self, *given, pivots=None, **named):
        honest(self, *given, pivots=pivots, **named)
        self._checked = pivots is None

    monkeypatch.setattr(inertia.SuperluFactor, "__init__", start)
    matrix = sp.csr_array(plate() + 0.0)
    assert direct.negative_eigenvalues(matrix, solver="superlu") == 1
    lossy = inertia.SuperluFactor.solve
    monkeypatch.setattr(inertia.SuperluFactor, "solve", lambda self, b, t: lossy(self, b, t) * (1 if self._checked else 1.01))
    assert direct.negative_eigenvalues(matrix, solver="superlu") is None


@solvers
@pytest.mark.parametrize("shift", [0.0, 3e3])
def test_rows_are_left_out_by_the_factors_of_all_of_them(solver, shift):
    """Contacts that open: rows of multipliers, and of freedoms, of a definite matrix and of an indefinite one."""
    held = sp.csr_array(plate() - shift * sp.eye_array(108))
    ties = sp.csr_array((np.ones(4), (np.arange(4), [5, 40, 41, 100])), shape=(4, 108))
    matrix = sp.csr_array(sp.block_array([[held, -1e2 * ties.T], [-1e2 * ties, -1.0 * sp.eye_array(4)]]))
    factors = direct.counting_factor(matrix, saddle=True, solver=solver)
    right = rng.standard_normal((112, 3))
    for left_out in ([109], [108, 111], [3, 50, 110]):
        stay = np.setdiff1d(np.arange(112), left_out)
        less = matrix[stay][:, stay]
        found = WithoutRows.of(factors, 112, np.array(left_out))
        assert backward_error(less, found.solve(right[stay]), right[stay]) < 1e-12
        assert found.inertia == int(np.count_nonzero(np.linalg.eigvalsh(less.toarray()) < 0))
    assert WithoutRows.of(factors, 112, np.arange(MOST + 1)) is None


def test_a_matrix_that_is_singular_without_the_rows_is_not_taken_on():
    one = sp.csr_array([[2.0, 1.0, 0.0], [1.0, 1.0, 1.0], [0.0, 1.0, 1.0]])  # without the last: [[2, 1], [1, 1/2 + ...]]
    held = sp.csr_array(one - sp.csr_array(([0.5], ([1], [1])), shape=(3, 3)))
    factors = direct.factorise(held, symmetric=True)
    assert WithoutRows.of(factors, 3, np.array([2])) is None
    assert WithoutRows.of(factors, 3, np.array([0])) is not None


def test_answers_of_a_symmetric_matrix_need_no_transposed_solve(monkeypatch):
    asked = []
    solve = factor.start("superlu").solve
    monkeypatch.setattr(
        factor.start("superlu"), "solve", lambda self, right, transpose: asked.append(transpose) or solve(self, right, transpose)
    )
    right = rng.standard_normal((108, 2))
    for symmetric in (True, False):
        found = direct.factorise(plate(), symmetric=symmetric, solver="superlu").solve(right, transpose=True)
        assert backward_error(plate(), found, right) < 1e-13
        assert (True in asked) is not symmetric
