"""Equilibria of few unknowns take another way than those of many: the equations hold on both, and what cannot be solved
is told by the same words."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp

from stridor.direct import SingularMatrix
from stridor.direct.dense import solved
from stridor.errors import CaseError
from stridor.sliding import small
from stridor.sliding.equilibrium import ContactRows, Equilibrium
from stridor.system.model import AnswerCache, CubicSprings, Rows


def problem(seed: int, n: int = 7, m: int = 4) -> tuple[Equilibrium, np.ndarray]:
    """A structure with rigid, elastic and hardening contact under friction, every other one with cubic springs, and
    which nodes touch."""
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(n, n))
    stiffness = sp.csr_array(1e7 * (half @ half.T + np.eye(n)))
    normal, tangent = rng.normal(size=(2, m, n))
    compliance = np.array([0.0, 1e-8, 1e-9, 2e-8])
    rows = ContactRows(
        sp.csr_array(normal), 1e-6 * rng.normal(size=m), compliance, np.array([0.0, 0.0, 1e21, 0.0]), np.zeros(m, bool)
    )
    cubic = None
    if seed % 2:
        springs = Rows(sp.csr_array(rng.normal(size=(2, n))), np.zeros((2, 0)))
        cubic = CubicSprings(springs, 1e18 * rng.uniform(size=2), 1e-6 * rng.normal(size=2))
    system = SimpleNamespace(size=n, stiffness=stiffness, cubic=cubic, of_matrices=AnswerCache())
    push = sp.csr_array(normal + 0.4 * tangent)
    found = Equilibrium(system, rows, push, 10.0 * rng.normal(size=n), symmetric=False, solver=None)
    return found, rng.random(m) < 0.7


@pytest.mark.parametrize("most", [small.SMALL, -1])
@pytest.mark.parametrize("seed", range(8))
def test_the_equations_hold(seed: int, most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(small, "SMALL", most)
    equilibrium, active = problem(seed)
    state = equilibrium.solve(active)
    nodes, system = equilibrium.nodes, equilibrium.system
    u, p = state.displacement, state.normal_force
    internal = system.stiffness @ u
    if system.cubic is not None:
        rows = system.cubic.rows.free
        internal = internal + rows.T @ (system.cubic.coefficient * (rows @ u + system.cubic.stretch) ** 3)
    assert np.abs(internal - equilibrium.push.T @ p - equilibrium.force).max() < 1e-11 * np.abs(equilibrium.force).max()
    approach = -(nodes.gap + nodes.normal @ u)
    elastic = nodes.compliance > 0
    touches = active & elastic
    law = approach[touches] / nodes.compliance[touches] + nodes.cubic[touches] * np.maximum(approach[touches], 0) ** 3
    assert p[touches] == pytest.approx(law, rel=1e-9)
    assert np.abs(approach[active & ~elastic]).max(initial=0.0) < 1e-9 * np.abs(u).max()
    assert not p[~active].any()


def test_both_ways_meet_and_only_many_unknowns_are_factorised(monkeypatch: pytest.MonkeyPatch) -> None:
    equilibrium, active = problem(3)
    few = equilibrium.solve(active)
    assert equilibrium.system.of_matrices.known("factors nearby") is None
    monkeypatch.setattr(small, "SMALL", -1)
    other, _ = problem(3)
    many = other.solve(active)
    assert other.system.of_matrices.known("factors nearby") is not None
    assert few.displacement == pytest.approx(many.displacement, rel=1e-11)
    assert few.normal_force == pytest.approx(many.normal_force, rel=1e-10)


def test_a_solver_that_is_none_is_refused_also_where_none_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    equilibrium, active = problem(2)
    equilibrium.solver = "nonsense"
    with pytest.raises(CaseError, match=r"^solver: 'nonsense' – no such solver"):
        equilibrium.solve(active)
    other, _ = problem(2)
    monkeypatch.setenv("STRIDOR_SOLVER", "nonsense")
    with pytest.raises(CaseError, match=r"^environment variable STRIDOR_SOLVER: 'nonsense'"):
        other.solve(active)


@pytest.mark.parametrize("most", [small.SMALL, -1])
def test_what_nothing_resists_is_told(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(small, "SMALL", most)
    equilibrium, _ = problem(2)
    free = equilibrium.system.stiffness.toarray()
    free[:, 5] = free[5] = 0.0
    equilibrium.system.stiffness = sp.csr_array(free)
    with pytest.raises(SingularMatrix, match="row 5 is empty"):
        equilibrium.solve(np.zeros(4, dtype=bool))
    soft = np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    soft[5, 5] = soft[5, 6] = soft[6, 5] = 1.0
    equilibrium.system.stiffness = sp.csr_array(soft)
    del equilibrium._small  # of the stiffness before
    with pytest.raises(SingularMatrix, match="the matrix is singular to working precision"):
        equilibrium.solve(np.zeros(4, dtype=bool))


@pytest.mark.parametrize(
    ("matrix", "right"),
    [
        ([[1.0, 1.0], [1.0, 1.0]], [1.0, 2.0]),  # singular
        ([[1.0, 1.0], [1.0, 1.0 + 1e-13]], [1.0, 2.0]),  # as good as that
        ([[np.nan, 0.0], [0.0, 1.0]], [1.0, 2.0]),
        ([[1.0, 0.0], [0.0, 1.0]], [np.inf, 2.0]),
    ],
)
def test_a_doubtful_answer_is_none(matrix: list[list[float]], right: list[float]) -> None:
    assert solved(np.array(matrix), np.array(right)) is None


def test_rows_of_very_different_size_and_unknowns_that_stay_zero() -> None:
    matrix = np.diag([1e-20, 1e20, 1.0]) + np.diag([0.5e-20, 0.3e20], 1)
    answer = solved(matrix, np.array([1e-20, 1e20, 0.0]))
    assert answer == pytest.approx([0.5, 1.0, 0.0])


def test_where_none_touches_each_load_has_its_own_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(small, "SMALL", -1)
    equilibrium, active = problem(4)
    none = np.zeros(len(active), dtype=bool)
    equilibrium.nodes = replace(equilibrium.nodes, cubic=np.zeros(len(active)))
    loads = np.random.default_rng(5).normal(size=(3, len(equilibrium.force)))
    for force, twice in ((loads[0], False), (loads[1], False), (loads[1], True), (loads[2], False), (loads[0], False)):
        equilibrium.force = force
        before = equilibrium.solved
        state = equilibrium.solve(none)
        assert state.displacement == pytest.approx(np.linalg.solve(equilibrium.system.stiffness.toarray(), force))
        assert not state.normal_force.any()
        assert equilibrium.solved == before + (not twice)


def test_a_structure_loose_where_none_touches_is_so_every_time() -> None:
    system = SimpleNamespace(
        of_matrices=AnswerCache(), size=2, stiffness=sp.csr_array(np.diag([100.0, 0.0])), cubic=None,
    )  # fmt: skip
    rows = ContactRows(sp.csr_array(np.eye(2)), np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2, dtype=bool))
    equilibrium = Equilibrium(system, rows, rows.normal, np.array([-1.0, -2.0]), symmetric=False, solver=None)
    for _ in range(2):
        with pytest.raises(SingularMatrix) as told:
            equilibrium.solve(np.zeros(2, dtype=bool))
        assert int(np.argmax(np.abs(told.value.motion))) == 1
    assert equilibrium.solved == 1
    assert equilibrium.solve(np.ones(2, dtype=bool)).normal_force == pytest.approx([1.0, 2.0])
