"""Products that the rows of reduced models are made of, against the plain ones."""

from __future__ import annotations

import numpy as np
import pytest

from stridor.modal.parametric.among_modes import AmongModes, RealSpan
from stridor.modal.parametric.dense import assembled, assembled_each
from stridor.modal.shift_inverted import lu_factors, transposed_solve


def drawn(*shape: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def with_imaginary_parts(vectors: np.ndarray, at: list[int]) -> np.ndarray:
    """The vectors (n, k) with imaginary parts in these columns alone."""
    kept = vectors.real + 0j
    kept[:, at] = vectors[:, at]
    return kept


@pytest.mark.parametrize("first", [[], [1, 4], [0, 2, 4]])
def test_products_with_vectors_of_which_few_are_complex(first: list[int]) -> None:
    vectors = with_imaginary_parts(drawn(9, 7), first)
    for k in first:
        vectors[:, k + 1] = vectors[:, k].conj()
    weights, others, at = drawn(7, 3, seed=1), drawn(9, 3, seed=2), np.array(first, dtype=int)
    few = RealSpan.of(vectors, at)
    assert not np.iscomplexobj(few.vectors)
    assert few.combined(weights) == pytest.approx(vectors @ weights, rel=1e-13)
    assert few.combined(weights.real + 0j) == pytest.approx(vectors @ weights.real, rel=1e-13)
    assert few.inner(others) == pytest.approx(vectors.T @ others, rel=1e-13)
    assert few.inner(others[:, ::2]) == pytest.approx(vectors.T @ others[:, ::2], rel=1e-13)
    # Of the real vectors to eigenvectors and back, also for some of them alone.
    some = np.sort(np.append(at, at + 1)) if first else np.array([0, 3])
    real_ones = drawn(len(some), 2, seed=3)
    assert few.combined(few.weights(real_ones, some)) == pytest.approx(few.vectors[:, some] @ real_ones, rel=1e-13)


@pytest.mark.parametrize("skew", [0.0, 3.0, 40.0])
def test_among_undamped_modes_mass_and_stiffness_are_numbers_and_damping_couples(skew: float) -> None:
    mass, damping, stiffness = np.diag(np.arange(1.0, 9)), drawn(8, 8, seed=1).real, np.diag(np.arange(1.0, 9) ** 3)
    stiffness[:2, :2] += [[0, skew], [-skew, 0]]
    among = AmongModes.of(mass, damping, stiffness, 3.0)
    assert np.any(among.squares.imag != 0) == (skew > 0)
    right, left = among.right.combined(np.eye(8) + 0j), among.left.combined(np.eye(8) + 0j)
    assert np.linalg.norm(right, axis=0) == pytest.approx(np.ones(8))
    assert np.linalg.norm(left, axis=0) == pytest.approx(np.ones(8))
    assert left.T @ mass @ right == pytest.approx(np.diag(among.weight), abs=1e-12)
    assert left.T @ stiffness @ right == pytest.approx(np.diag(-among.weight * among.squares), abs=1e-10)
    a = drawn(8, 3, seed=2)
    assert among.damped(a) == pytest.approx(left.T @ damping @ right @ a, rel=1e-11, abs=1e-12)
    assert among.damped_left(a) == pytest.approx(right.T @ damping.T @ left @ a, rel=1e-11, abs=1e-12)


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
