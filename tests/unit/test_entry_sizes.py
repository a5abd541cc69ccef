"""What residuals are measured against, in single precision where that will do."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from stridor.modal.quadratic.problem import Quadratic, entry_sizes, measured


@pytest.mark.parametrize("size", [1e-300, 1e-40, 1e-12, 1.0, 1e12, 1e40, 1e300])
@pytest.mark.parametrize("length", [1e-250, 1e-8, 1.0, 1e8, 1e30])
def test_sizes_are_those_of_double_precision(size: float, length: float) -> None:
    if size * length > 1e300:
        pytest.skip("beyond double precision, too")
    random = np.random.default_rng(1)
    matrix = sp.csr_array(
        sp.random_array((60, 60), density=0.2, rng=random, data_sampler=random.standard_normal) * size
    )
    block = np.abs(random.standard_normal((60, 3))) * length
    exact = abs(matrix) @ block
    assert measured(entry_sizes(matrix), block) == pytest.approx(exact, rel=1e-5, abs=1e-30 * float(exact.max()))


def test_entries_of_very_different_sizes_keep_theirs() -> None:
    matrix = sp.csr_array(np.array([[1e12, 0.0], [0.0, 1e-9]]))
    assert measured(entry_sizes(matrix), np.ones((2, 1)))[:, 0] == pytest.approx([1e12, 1e-9], rel=1e-6)


def test_backward_errors_are_as_before_to_some_digits() -> None:
    random = np.random.default_rng(2)
    mass, damping, stiffness = (sp.random_array((80, 80), density=0.1, rng=random).tocsr() for _ in range(3))
    problem = Quadratic(sp.csr_array(mass), sp.csr_array(damping), sp.csr_array(1e9 * stiffness))
    lam = random.standard_normal(4) + 3e4j
    x = random.standard_normal((80, 4)) + 1j * random.standard_normal((80, 4))
    rest = np.abs(problem.residual(lam, x)).max(axis=0)
    parts = [abs(lam) ** k * (abs(m) @ np.abs(x)) for k, m in zip((2, 1, 0), problem.matrices(), strict=True)]
    assert problem.backward_error(lam, x) == pytest.approx(rest / sum(parts).max(axis=0), rel=1e-5)
