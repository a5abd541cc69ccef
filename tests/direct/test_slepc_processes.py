"""The solver "slepc": one program over the processes of mpiexec, with the results of a single one.

Everything that needs MPI runs in processes of its own with a limit of time, as a fault there is one that never ends.
"""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.io as sio
import scipy.sparse as sp

import program
import stridor as st
from rubbing_block import rubbing_block
from stridor import direct
from stridor.app import launch
from stridor.direct import backends
from stridor.modal.parametric import contact_parameters

MPIEXEC = shutil.which("mpiexec")
MISSING = [name for name in ("petsc4py", "mpi4py") if importlib.util.find_spec(name) is None]
MISSING += [] if MPIEXEC else ["mpiexec"]
needs_mpi = pytest.mark.skipif(bool(MISSING), reason=f"slepc over processes needs {', '.join(MISSING)}")
needs_slepc = pytest.mark.skipif(
    bool(MISSING) or importlib.util.find_spec("slepc4py") is None, reason="the reference needs slepc4py and all of slepc"
)
ENVIRONMENT = {
    **{name: value for name, value in os.environ.items() if name != "STRIDOR_SOLVER"},
    "COLUMNS": "1000",  # a sentence is a line
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    # More processes than cores, or others that use them, are no fault.
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "OMPI_MCA_hwloc_base_binding_policy": "none",
    "OMPI_MCA_mpi_yield_when_idle": "1",
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}
# The program as the shell has it, saying at its end how often it was slepc that solved.
COUNTED = """
import atexit, sys
from stridor.app.cli import main
from stridor.direct import slepc_backend
solve, solves = slepc_backend.Team.solve, []
slepc_backend.Team.solve = lambda *given: solves.append(1) or solve(*given)
atexit.register(lambda: print("solves of slepc:", len(solves), file=sys.stderr) if solves else None)
main()
"""


def limited(command: list[str], cwd: Path, seconds: float = 240) -> subprocess.CompletedProcess[str]:
    """A command's end and output. Told to end when the time is over: mpiexec ends its processes then."""
    started = subprocess.Popen(
        command, cwd=cwd, env=ENVIRONMENT, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        out, err = started.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        started.send_signal(signal.SIGTERM)
        try:
            out, err = started.communicate(timeout=20)
        except subprocess.TimeoutExpired:
            started.kill()
            out, err = started.communicate()
        pytest.fail(f"{command} hangs\n{out}\n{err}")
    return subprocess.CompletedProcess(command, started.returncode, out, err)


def python(*words: str, cwd: Path, processes: int | None = 2) -> subprocess.CompletedProcess[str]:
    """Python in so many processes of mpiexec, None: without it."""
    command = [sys.executable, *words]
    return limited(command if processes is None else [str(MPIEXEC), "-n", str(processes), *command], cwd)


def stridor(*words: str, cwd: Path, processes: int | None = 2) -> subprocess.CompletedProcess[str]:
    return python("-c", COUNTED, *words, cwd=cwd, processes=processes)


AT_WORK = re.compile(r"\d+ s: .+, for \d+ s")


def ours(err: str) -> list[str]:
    """Lines of stderr without what mpiexec adds about processes that ended with an error, and without what the program is
    at, which a slow machine is told."""
    lines, inside = [], False
    for line in err.splitlines():
        if set(line) == {"-"}:
            inside = not inside
        elif line and not inside and not AT_WORK.fullmatch(line):
            lines.append(line)
    return lines


def eigenvalues(done: subprocess.CompletedProcess[str]) -> np.ndarray:
    """λ of all modes of the one JSON document that was printed."""
    assert done.returncode == 0, done.stderr
    (modes,) = json.loads(done.stdout)["modes"]
    return np.array([m["growth_rate"] + 2j * np.pi * m["frequency_hz"] for m in modes])


def assert_same(found: np.ndarray, reference: np.ndarray, tolerance: float) -> None:
    assert len(found) == len(reference) > 3
    assert (np.abs(found - reference) / np.abs(reference)).max() < tolerance


# Reads M, C, K. Finds the eigenvalue nearest to each of those given, by TOAR (PEP).
REFERENCE = """
import sys
import petsc4py, slepc4py
slepc4py.init(["reference"])
import numpy as np, scipy.sparse as sp
from petsc4py import PETSc
from slepc4py import SLEPc
rank, size = PETSc.COMM_WORLD.getRank(), PETSc.COMM_WORLD.getSize()
def spread(matrix):
    n = matrix.shape[0]
    first, end = n * rank // size, n * (rank + 1) // size
    rows = sp.csr_array(matrix[first:end])
    made = PETSc.Mat().createAIJ(
        ((end - first, n), (end - first, n)),
        csr=(rows.indptr.astype(PETSc.IntType), rows.indices.astype(PETSc.IntType), rows.data.astype(PETSc.ScalarType)),
    )
    made.assemble()
    return made
matrices = [spread(sp.csr_array(sp.load_npz(f"{name}.npz"))) for name in "KCM"]
found = []
for near in np.load("near.npy"):
    problem = SLEPc.PEP().create()
    problem.setOperators(matrices)
    problem.setType(SLEPc.PEP.Type.TOAR)
    problem.setProblemType(SLEPc.PEP.ProblemType.GENERAL)
    problem.setScale(SLEPc.PEP.Scale.SCALAR)
    problem.setDimensions(1)
    problem.setTolerances(1e-13, 200)
    problem.setTarget(near * (1 + 1e-3))
    problem.setWhichEigenpairs(SLEPc.PEP.Which.TARGET_MAGNITUDE)
    transform = problem.getST()
    transform.setType(SLEPc.ST.Type.SINVERT)
    solver = transform.getKSP()
    solver.setType("preonly")
    solver.getPC().setType("lu")
    solver.getPC().setFactorSolverType("mumps")
    problem.solve()
    assert problem.getConverged() >= 1
    values = np.array([problem.getEigenpair(k) for k in range(problem.getConverged())])
    found.append(values[np.abs(values - near).argmin()])
if rank == 0:
    np.save("reference.npy", np.array(found))
"""


def by_slepc(mass, damping, stiffness, near: np.ndarray, folder: Path) -> np.ndarray:
    """Eigenvalues of λ²M + λC + K nearest to given ones, found by SLEPc itself, in one process: it is the reference."""
    for name, matrix in (("M", mass), ("C", damping), ("K", stiffness)):
        sp.save_npz(folder / f"{name}.npz", sp.csr_matrix(matrix))
    np.save(folder / "near.npy", near)
    done = python("-c", REFERENCE, cwd=folder, processes=None)
    assert done.returncode == 0, done.stderr
    return np.load(folder / "reference.npy")


# -- the same results --------------------------------------------------------------------------------------------------
BENCH = rubbing_block("max_frequency_hz = 40e3\nmodes = 6")


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bench")
    (folder / "bench.toml").write_text(BENCH, encoding="utf-8")
    (folder / "asks.toml").write_text(BENCH + 'solver = "slepc"\n', encoding="utf-8")
    return folder / "bench.toml"


@pytest.fixture(scope="module")
def alone(bench: Path) -> np.ndarray:
    return eigenvalues(program.stridor("modes", "bench.toml", "--mu", "0.4", "--json", cwd=bench.parent))


@needs_mpi
@pytest.mark.parametrize(
    ("words", "processes"),
    [
        pytest.param("bench.toml --solver slepc", 2, marks=pytest.mark.slow),  # the next test starts it so, too
        ("asks.toml", 2),
        pytest.param("bench.toml --solver slepc", None, marks=pytest.mark.slow),
    ],
)
def test_a_bench_with_contact_has_the_modes_of_the_default_solver(bench: Path, alone, words: str, processes: int | None):
    done = stridor("modes", *words.split(), "--mu", "0.4", "--json", cwd=bench.parent, processes=processes)
    assert_same(eigenvalues(done), alone, 1e-10)
    coarse, *written, solves = ours(done.stderr)  # nothing is said twice
    assert coarse.startswith("warning: bodies.block: 0.02 m in extent")
    assert written == [f"written: {words.partition('.')[0]}.out/modes.{kind}" for kind in ("nc", "csv", "png")]
    assert int(solves.removeprefix("solves of slepc: ")) > 5


@needs_slepc
@pytest.mark.slow
def test_a_bench_with_contact_has_the_modes_that_slepc_finds(bench: Path):
    found = eigenvalues(stridor("modes", "bench.toml", "--mu", "0.4", "--json", "--solver", "slepc", cwd=bench.parent))
    problem = contact_parameters(st.build_system(st.load(bench)), (0.0, 0.6)).at({"mu": 0.4})
    reference = by_slepc(problem.mass, problem.damping, problem.stiffness, found, bench.parent)
    assert_same(found, reference, 1e-9)


def circulatory(folder: Path, n: int = 400) -> tuple[sp.csr_array, ...]:
    """M, C, K of a chain with gyroscopic and circulatory forces between its neighbours, and a case on them."""
    rng = np.random.default_rng(5)
    chain = sp.diags_array([-np.ones(n - 1), 2.0 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1])
    skew = sp.diags_array([np.ones(n - 1), -np.ones(n - 1)], offsets=[1, -1])
    mass = sp.csr_array(sp.diags_array(rng.uniform(0.8, 1.2, n)))
    damping = sp.csr_array(1e-3 * chain + 2.0 * mass + 0.5 * skew)
    springs = sp.diags_array(rng.uniform(0.5, 1.5, n))
    stiffness = sp.csr_array(1e6 * (springs @ chain @ springs) + 1e4 * skew)
    for name, matrix in (("M", mass), ("C", damping), ("K", stiffness)):
        sio.mmwrite(folder / f"{name}.mtx", sp.coo_array(matrix), precision=17, symmetry="general")
    terms = ", ".join(
        f'{{ file = "{name}.mtx", role = "{role}" }}' for name, role in zip("MCK", ("mass", "damping", "stiffness"), strict=True)
    )
    text = f"[matrices]\nterms = [{terms}]\n[modal]\nmax_frequency_hz = 25.0\n"
    (folder / "chain.toml").write_text(text, encoding="utf-8")
    return mass, damping, stiffness


@needs_slepc
def test_unsymmetric_matrices_have_the_modes_of_the_default_solver_and_of_slepc(tmp_path: Path):
    matrices = circulatory(tmp_path)
    alone = eigenvalues(program.stridor("modes", "chain.toml", "--json", cwd=tmp_path))
    done = stridor("modes", "chain.toml", "--json", "--solver", "slepc", cwd=tmp_path)
    found = eigenvalues(done)
    assert_same(found, alone, 1e-10)
    assert any(line.startswith("solves of slepc") for line in ours(done.stderr))
    assert_same(found, by_slepc(*matrices, found, tmp_path), 1e-9)


# -- the solver itself -------------------------------------------------------------------------------------------------
DIRECT = """
import sys
import pytest
from stridor import direct
direct.available = lambda: ("slepc",)
direct.join()
sys.exit(pytest.main(["-q", "-p", "no:cacheprovider", "--color=no", "-k", sys.argv[2], sys.argv[1]]))
"""
EVERY = "slepc and not inertia"
FIVE = f"{EVERY} and not None- and not 1- and not 70-"  # five right sides at once


@needs_mpi
@pytest.mark.parametrize(
    ("processes", "which", "least"),
    [(None, EVERY, 70), (2, FIVE, 20), pytest.param(2, EVERY, 70, marks=pytest.mark.slow)],
)
def test_every_test_of_the_direct_solvers_passes(tmp_path: Path, processes: int | None, which: str, least: int):
    """Real, complex, symmetric, unsymmetric, saddle and singular matrices; transposed; one right side and many."""
    tests = Path(__file__).parents[1] / "unit" / "test_direct.py"
    done = python("-c", DIRECT, str(tests), which, cwd=tmp_path, processes=processes)
    assert done.returncode == 0, done.stdout
    assert int(done.stdout.rpartition(" passed")[0].split()[-1]) > least


RANDOM = """
import gc
import numpy as np, scipy.sparse as sp, scipy.sparse.linalg as spl
from stridor import direct
from stridor.direct import slepc_backend
direct.join()
rng = np.random.default_rng(4)
def matrix(n, kind):
    a = sp.random_array((n, n), density=min(1, 8 / n), rng=rng) + 3 * sp.eye_array(n)
    return sp.csr_array(a + (1j * sp.random_array((n, n), density=min(1, 8 / n), rng=rng) if kind == "complex" else 0))
kept = []
for n in (2, 5, 500):
    for kind in ("real", "complex"):
        a = matrix(n, kind)
        both = sp.csr_array(a + a.T)
        ties = sp.csr_array((np.ones(2), ([0, 1], [0, n - 1])), shape=(2, n))
        saddle = sp.csr_array(sp.block_array([[both, ties.T], [ties, None]]))
        for given, symmetric in ((a, False), (both, True), (both, False), (saddle, True), (saddle, False)):
            if given is saddle and n == 2:
                continue  # as many ties as freedoms
            rows = given.shape[0]
            exact = spl.splu(sp.csc_array(given))
            factor = direct.factorise(given, symmetric=symmetric, saddle=given is saddle, solver="slepc")
            assert factor.inertia is None or (symmetric and kind == "real")
            right = rng.standard_normal((rows, 3)) + 1j * rng.standard_normal((rows, 3))
            for transpose, letter in ((False, "N"), (True, "T")):
                for refine in (True, False):
                    answer = factor.solve(right, transpose=transpose, refine=refine)
                    wanted = exact.solve(right.real, letter) + 1j * exact.solve(right.imag, letter) if kind == "real" \
                        else exact.solve(right, letter)
                    error = np.abs(answer - wanted).max() / np.abs(wanted).max()
                    assert error < 1e-8, (n, kind, symmetric, transpose, refine, error)
            kept.append(factor)
# Collected ones are freed with the next order, in all processes.
held = len(slepc_backend.join()._shares)
del kept, factor
gc.collect()
direct.factorise(a, solver="slepc").free()
print("freed", held, "left", len(slepc_backend.join()._shares))
"""


@needs_mpi
@pytest.mark.parametrize("processes", [None, 2, pytest.param(3, marks=pytest.mark.slow)])
def test_answers_are_those_of_scipy_and_collected_factors_are_freed(tmp_path: Path, processes: int | None):
    done = python("-c", RANDOM, cwd=tmp_path, processes=processes)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "freed 26 left 0\n"


def test_real_matrices_go_through_complex_factors_two_columns_at_a_time(monkeypatch: pytest.MonkeyPatch):
    from stridor.direct import slepc_backend

    class Team(SimpleNamespace):
        def solve(self, number, right, transpose):
            assert right.dtype == complex
            return self.matrix @ right

    rng = np.random.default_rng(1)
    factor = object.__new__(slepc_backend.SlepcFactor)
    factor._team, factor._number, factor._kind = Team(matrix=rng.standard_normal((5, 5))), 1, np.complex128
    factor._team.forget = lambda number: None
    for wide in (1, 2, 3, 8):
        right = rng.standard_normal((5, wide))
        assert np.allclose(factor.solve(right.copy(), False), factor._team.matrix @ right, atol=1e-14)


# -- one program -------------------------------------------------------------------------------------------------------
@needs_mpi
@pytest.mark.slow
def test_an_error_of_the_case_is_said_once_and_ends_all(bench: Path):
    for words, said in (
        (["nowhere.toml"], "stridor: nowhere.toml: no such file"),
        (["bench.toml", "--set", "contacts.face.slave=block.left"], "stridor: contacts.face: the bodies do not face"),
    ):
        done = stridor("modes", *words, "--solver", "slepc", cwd=bench.parent)
        assert done.returncode in (1, 2)
        *warned, line = ours(done.stderr)
        assert line.startswith(said)
        assert len(warned) == words[0].startswith("bench")  # of the mesh
        assert done.stdout == ""


@needs_mpi
def test_an_exception_in_a_script_ends_all(tmp_path: Path):
    """Here of a singular matrix; only one process gets beyond the first factorisation."""
    script = """
import numpy as np, scipy.sparse as sp
from stridor import direct
direct.factorise(sp.csr_array(np.eye(4)), solver="slepc")
print("alone", flush=True)
direct.factorise(sp.csr_array(np.ones((4, 4))), solver="slepc")
"""
    done = python("-c", script, cwd=tmp_path)
    assert done.returncode == 1
    assert done.stdout == "alone\n"
    assert ours(done.stderr)[-1].startswith("stridor.direct.factor.SingularMatrix: the matrix is singular to working")


@needs_mpi
def test_a_fault_in_another_process_is_told_and_ends_all(tmp_path: Path):
    script = """
import numpy as np, scipy.sparse as sp
from stridor import direct
from stridor.direct import slepc_backend
solve = slepc_backend.ProcessShare.solve
def broken(self, right, transpose):
    if slepc_backend._team.ranks.number == 1:
        raise MemoryError("no more of it")
    return solve(self, right, transpose)
slepc_backend.ProcessShare.solve = broken
direct.factorise(sp.csr_array(np.eye(4)), solver="slepc")
"""
    done = python("-c", script, cwd=tmp_path)
    assert done.returncode != 0
    assert "stridor: the sparse solver failed in process 1 of 2: no more of it" in done.stderr


@needs_mpi
def test_what_is_started_twice_is_done_once_also_by_other_solvers(tmp_path: Path):
    done = stridor("new", "two-beams", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr  # a second one would find the file there
    assert json.loads(done.stdout) == {"case": "two-beams.toml"}


@needs_mpi
def test_different_commands_started_together_are_all_done(tmp_path: Path):
    one, other = ([sys.executable, "-c", COUNTED, "new", name, "--quiet"] for name in ("two-beams", "pad-on-disc"))
    done = limited([str(MPIEXEC), "-n", "1", *one, ":", "-n", "1", *other], tmp_path)
    assert done.returncode == 0, done.stderr
    assert {path.name for path in tmp_path.glob("*.toml")} == {"two-beams.toml", "pad-on-disc.toml"}


# -- without MPI -------------------------------------------------------------------------------------------------------
def test_it_is_never_the_default():
    assert "slepc" not in direct.available()
    assert backends.choose(None) != "slepc" or os.environ.get("STRIDOR_SOLVER") == "slepc"


def test_asked_for_where_it_is_missing_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch):
    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *a: None if name == "petsc4py" else found(name, *a))
    with pytest.raises(st.CaseError, match=r"solver: 'slepc' – is not installed; pip install \"stridor\[slepc\]\"; PETSc "
                       r"must be built with complex numbers.*libpetsc-complex-dev.*or use one that is: .*superlu"):  # fmt: skip
        direct.factorise(sp.csr_array(np.eye(2)), solver="slepc")
    with pytest.raises(st.CaseError, match="is not installed"):
        direct.join()


def test_a_petsc_that_cannot_do_it_says_so(monkeypatch: pytest.MonkeyPatch):
    from stridor.direct import slepc_backend

    def petsc(real: type, scalar: type, mumps: bool) -> SimpleNamespace:
        system = SimpleNamespace(hasExternalPackage=lambda name: mumps and name == "mumps")
        return SimpleNamespace(RealType=real, ScalarType=scalar, Sys=system, init=lambda words: None)

    for real, mumps, said in ((np.float64, False, "built without MUMPS"), (np.float32, True, "calculates with float32")):
        module = petsc(real, np.complex128, mumps)
        monkeypatch.setattr(slepc_backend, "import_module", lambda name, module=module: module)
        with pytest.raises(st.CaseError, match=f"solver: 'slepc' – PETSc .*{said}.*PETSc must be built with complex"):
            slepc_backend._petsc()
    of_reals = SimpleNamespace(petsc=petsc(np.float64, np.float64, True))
    monkeypatch.setattr(slepc_backend, "join", lambda: of_reals)
    with pytest.raises(st.CaseError, match="PETSc is built for real numbers here and the matrix is complex"):
        slepc_backend.SlepcFactor(sp.csr_array(1j * np.eye(2)), False, False)


@pytest.mark.parametrize(
    ("words", "environment", "asked"),
    [
        ("modes a.toml --solver slepc", {}, True),
        ("modes a.toml --solver=slepc", {}, True),
        ("modes a.toml --set modal.solver=slepc", {}, True),
        ("modes a.toml --set modal.solver='slepc'", {}, True),
        ("modes a.toml", {"STRIDOR_SOLVER": "slepc"}, True),
        ("modes asks.toml", {}, True),
        ("modes a.toml --solver mumps", {"STRIDOR_SOLVER": "superlu"}, False),
        ("modes missing.toml --out slepc/b", {}, False),
    ],
)
def test_who_asks_for_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: str, environment, asked: bool):
    monkeypatch.chdir(tmp_path)
    Path("a.toml").write_text("[modal]\nmodes = 3\n")
    Path("asks.toml").write_text('[modal]\nsolver = "slepc"\n')
    assert launch.asks(words.split(), environment) == asked


def test_the_environment_of_launchers_is_read():
    openmpi = {"OMPI_COMM_WORLD_RANK": "1", "OMPI_COMM_WORLD_SIZE": "2"}
    mpich = {"PMI_RANK": "3", "PMI_SIZE": "4"}
    slurm = {"SLURM_PROCID": "3", "SLURM_STEP_NUM_TASKS": "4"}
    assert launch._process({}) is None
    assert launch._process(openmpi) == (1, 2, False)
    assert launch._process(mpich) == (3, 4, False)
    assert launch._process(slurm) == launch._process({**mpich, **slurm}) == (3, 4, True)
    assert launch._process({**openmpi, **slurm}) == (1, 2, False)
    assert launch._process({"SLURM_PROCID": "0", "SLURM_STEP_NUM_TASKS": "1"}) is None
    assert launch._process({"OMPI_COMM_WORLD_RANK": "0", "OMPI_COMM_WORLD_SIZE": "1"}) is None


def test_other_processes_end_silently_where_it_is_missing(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(backends, "installed", lambda name: False)
    first, second = ({"OMPI_COMM_WORLD_RANK": str(k), "OMPI_COMM_WORLD_SIZE": "2"} for k in (0, 1))
    launch.meet(["modes", "--solver", "slepc"], first)  # says so when it comes to that
    with pytest.raises(SystemExit) as end:
        launch.meet(["modes", "--solver", "slepc"], second)
    assert end.value.code == 0
    launch.meet(["modes"], second)
    launch.meet(["modes", "--solver", "slepc"], {})
