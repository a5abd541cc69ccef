"""The compiled product in symmetric blocks, of every width, against SciPy."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from stridor.temporal.aligned import LINE, aligned_zeros
from stridor.temporal.steppers.sparse.lanes import LANES
from stridor.temporal.steppers.sparse.products import add_rows
from stridor.temporal.steppers.sparse.storage import Layout, upper_blocks


def _symmetric(blocks: int, width: int, seed: int) -> sp.csr_array:
    """A random symmetric matrix of full blocks, rows of very different lengths, some diagonals empty."""
    rng = np.random.default_rng(seed)
    pattern = sp.random_array((blocks, blocks), density=0.15, rng=rng, data_sampler=lambda size: np.ones(size))
    whole = sp.csr_array(sp.kron(pattern, np.ones((width, width))))
    whole.data = rng.standard_normal(whole.nnz)
    return sp.csr_array(whole + whole.T)


@pytest.mark.parametrize("width", [1, 2, 3])
@pytest.mark.parametrize("blocks", [1, 2, 37])
def test_products_in_blocks_are_those_of_scipy(width: int, blocks: int) -> None:
    matrix = _symmetric(blocks, width, seed=blocks)
    rng = np.random.default_rng(1)
    order = rng.permutation(blocks)
    place = (order[:, None] * LANES[width] + np.arange(width)).ravel()
    layout = Layout(width, blocks, place)
    stored = upper_blocks(matrix, layout)
    x = rng.standard_normal(matrix.shape[0])
    result = aligned_zeros((layout.size,))
    half = blocks // 2
    add_rows(stored, layout.spread(x), result, 0, half)
    add_rows(stored, layout.spread(x), result, half, blocks)
    assert result[place] == pytest.approx(matrix @ x, rel=1e-13, abs=1e-13)


def test_arrays_begin_where_cache_lines_do() -> None:
    for size in range(1, 20):
        zeros = aligned_zeros((2, 4 * size))
        assert zeros.shape == (2, 4 * size)
        assert not zeros.any()
        assert zeros.ctypes.data % (8 * LINE) == 0
