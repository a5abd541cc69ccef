"""Products that the rows of reduced models are made of, against the plain ones."""

from __future__ import annotations

import numpy as np
import pytest

from stridor.modal.parametric.dense import assembled, assembled_each
from stridor.modal.parametric.mostly_real import MostlyReal
from stridor.modal.shift_inverted import lu_factors, transposed_solve


def drawn(*shape: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def with_imaginary_parts(vectors: np.ndarray, at: list[int]) -> np.ndarray:
    """The vectors (n, k) with imaginary parts in these columns alone."""
    kept = vectors.real + 0j
    kept[:, at] = vectors[:, at]
    return kept


@pytest.mark.parametrize("at", [[], [1, 4], list(range(7))])
def test_products_with_vectors_of_which_few_are_complex(at: list[int]) -> None:
    vectors = with_imaginary_parts(drawn(9, 7), at)
    few, weights, others, matrix = MostlyReal(vectors), drawn(7, 3, seed=1), drawn(9, 3, seed=2), drawn(5, 9, seed=3).real
    assert few.combined(weights) == pytest.approx(vectors @ weights, rel=1e-13)
    assert few.weighed(others) == pytest.approx(vectors.T @ others, rel=1e-13)
    assert few.weighed(others[:, ::2]) == pytest.approx(vectors.T @ others[:, ::2], rel=1e-13)
    assert few.images(matrix) == pytest.approx(matrix @ vectors, rel=1e-13)


@pytest.mark.parametrize("powers", [[2, 1, 1, 0, 0, 1, 1], [0], [0, 2, 0, 1], [1, 1]])
def test_terms_are_summed_by_their_power(powers: list[int]) -> None:
    terms, factors = drawn(len(powers), 4, 3).real, drawn(2, len(powers), seed=1).real
    order = np.array(powers)
    wanted = [[np.tensordot(f[order == p], terms[order == p], 1) for p in (2, 1, 0)] for f in factors]
    for found, one in zip(assembled_each(terms, factors, order), wanted, strict=True):
        for matrix, plain in zip(found, one, strict=True):
            assert matrix == pytest.approx(plain, rel=1e-13, abs=1e-15)
    for matrix, plain in zip(assembled(terms, factors[0], order), wanted[0], strict=True):
        assert matrix == pytest.approx(plain, rel=1e-13, abs=1e-15)


@pytest.mark.parametrize("at", [[], [2], [0, 1, 2, 3]])
def test_transposed_systems_with_few_complex_right_sides(at: list[int]) -> None:
    matrix, right = drawn(6, 6, seed=4).real, with_imaginary_parts(drawn(6, 4, seed=5), at)
    assert transposed_solve(lu_factors(matrix), right) == pytest.approx(np.linalg.solve(matrix.T, right), rel=1e-10)
    alone = right[:, 0]
    assert transposed_solve(lu_factors(matrix), alone) == pytest.approx(np.linalg.solve(matrix.T, alone), rel=1e-10)
