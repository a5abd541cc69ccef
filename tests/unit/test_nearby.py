"""Equations that change a little from one to the next: what the factors of an earlier one answer is as good."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from stridor.direct import Factor, Nearby, SingularMatrix, factorise, nearby
from stridor.direct.updated import Updated

COUNT = 400


@pytest.fixture(autouse=True)
def any_size(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nearby, "LEAST", 0)


def chain(rubbing: float = 0.0, opened: int = 0) -> sp.csr_array:
    """Masses on springs over a surface: friction makes it unsymmetric, and open nodes lose their spring."""
    stiffness = sp.diags_array(
        [-np.ones(COUNT - 1), np.full(COUNT, 2.0), -np.ones(COUNT - 1)], offsets=[-1, 0, 1], shape=(COUNT, COUNT)
    )
    contact = np.where(np.arange(COUNT) % 10 == 0, 5.0, 0.0)
    contact[: 10 * opened] = 0.0
    friction = sp.diags_array([rubbing * contact[1:]], offsets=[-1], shape=(COUNT, COUNT))
    return sp.csr_array(stiffness + sp.diags_array(contact) + friction)


def error(matrix: sp.csr_array, answer: np.ndarray, right: np.ndarray) -> float:
    return float(np.max(abs(matrix @ answer - right) / (abs(matrix) @ abs(answer) + abs(right))))


def test_one_factorisation_serves_what_follows_to_rounding() -> None:
    solved, right = Nearby(), np.linspace(-1.0, 2.0, COUNT)
    for rubbing in np.linspace(0.0, 0.3, 13):
        for opened in (0, 2):
            matrix = chain(float(rubbing), opened)
            found = solved.solve(matrix, right)
            assert error(matrix, found, right) <= 1e-14
            assert found == pytest.approx(np.linalg.solve(matrix.toarray(), right), rel=1e-11, abs=1e-13)
    assert solved.factorisations == 1


def test_a_matrix_that_is_far_from_the_last_is_factorised() -> None:
    solved, right = Nearby(), np.ones(COUNT)
    solved.solve(chain(), right)
    other = sp.csr_array(chain(0.4) * np.linspace(1.0, 1e4, COUNT)[:, None] ** 2)
    assert error(other, solved.solve(other, right), right) <= 1e-14
    smaller = chain()[:100][:, :100]
    assert error(smaller, solved.solve(smaller, right[:100]), right[:100]) <= 1e-14
    assert solved.factorisations == 3
    solved.free()
    solved.solve(smaller, right[:100])
    assert solved.factorisations == 4


def test_what_nothing_holds_is_found_behind_a_matrix_that_holds() -> None:
    solved = Nearby()
    right = np.sin(np.arange(COUNT))
    held = sp.csr_array(sp.diags_array([-np.ones(COUNT - 1), np.full(COUNT, 2.0), -np.ones(COUNT - 1)], offsets=[-1, 0, 1]))
    free = held.tolil()
    free[0, 0] = free[COUNT - 1, COUNT - 1] = 1.0
    solved.solve(held, right, kind="held")
    with pytest.raises(SingularMatrix):
        solved.solve(sp.csr_array(free), right, kind="free")
    # A right side that the free motion does not feel has answers, but no single one.
    solved.solve(held, right, kind="held")
    with pytest.raises(SingularMatrix):
        solved.solve(sp.csr_array(free), right - right.mean(), kind="free")


@pytest.mark.parametrize(("opened", "rubbing"), [(2, 0.3), (20, 0.0), (0, 0.0)])
def test_what_differs_in_few_rows_takes_a_solution_for_each_and_two(opened: int, rubbing: float, monkeypatch: pytest.MonkeyPatch) -> None:
    solved, right = Nearby(), np.linspace(-1.0, 2.0, COUNT)
    solved.solve(chain(rubbing), right)
    monkeypatch.setattr(nearby.Nearby, "_by_steps", None)  # is not called
    columns: list[int] = []
    solve = Factor.solve
    monkeypatch.setattr(Factor, "solve", lambda self, right, **how: (columns.append(right.shape[1]), solve(self, right, **how))[1])
    matrix = chain(rubbing, opened)
    found = solved.solve(matrix, right, kind=opened)
    # Of a matrix of this condition answers agree to so much of the largest, the small ones among them, too.
    exact = np.linalg.solve(matrix.toarray(), right)
    assert found == pytest.approx(exact, rel=0, abs=1e-12 * float(np.abs(exact).max()))
    assert error(matrix, found, right) <= 1e-14
    assert columns[:2] == [opened, 2]
    assert solved.factorisations == 1


def test_a_random_change_of_few_rows_is_exact_and_of_many_is_none() -> None:
    random = np.random.default_rng(8)
    before = chain()
    with factorise(before) as factor:
        for rank in (1, 5, 24):
            left, right = random.standard_normal((30, rank)), random.standard_normal((rank, 40))
            change = sp.lil_array((COUNT, COUNT))
            change[np.ix_(random.choice(COUNT, 30, replace=False), random.choice(COUNT, 40, replace=False))] = left @ right
            matrix = sp.csr_array(before + change)
            updated = Updated.of(factor, before, matrix)
            assert updated is not None
            assert updated.right.shape[1] == rank
            sought = random.standard_normal((COUNT, 3))
            answer, first = updated.solve(matrix @ sought)
            assert answer == pytest.approx(sought, rel=1e-6, abs=1e-8)
            assert before @ first == pytest.approx(matrix @ sought, rel=1e-10, abs=1e-10)
        assert Updated.of(factor, before, sp.csr_array(before + sp.diags_array(np.r_[np.ones(25), np.zeros(COUNT - 25)]))) is None
        assert Updated.of(factor, before, chain(0.1)) is None
