"""Equations that change a little from one to the next: what the factors of an earlier one answer is as good."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from stridor.direct import Nearby, SingularMatrix, nearby

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
