"""What of a damping matrix stands beside the mass and what acts on the older velocity: against matrices put together."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from stridor.fe.assembly import beside, plus
from stridor.system import System
from stridor.temporal.steppers.sparse.damping import split_damping

ROW = np.array([[2.0, -1, 0], [-1, 3, -2], [0, -2, 2]]) * 1e6


def split(damping, stiffness=ROW):
    found = split_damping(System(np.eye(len(stiffness)), np.asarray(damping, dtype=float), stiffness))
    assert np.diag(found.diagonal) + found.rest.toarray() == pytest.approx(np.asarray(damping, dtype=float), rel=1e-12)
    return found


@pytest.mark.parametrize("ground", [0.0, 40.0])
@pytest.mark.parametrize("factor", [1.1e-6, 3e-7])
def test_the_share_of_the_stiffness_is_found_and_what_is_over_is_to_the_ground(ground: float, factor: float) -> None:
    found = split(factor * ROW + ground * np.diag([1.0, 0.0, 2.0]))
    assert found.lagged
    assert found.factor == pytest.approx(np.full(3, factor), rel=1e-12)
    # Exactly nothing where nothing is over: a rest of rounding would be a dashpot.
    assert found.diagonal[1] == 0.0
    assert found.diagonal == pytest.approx([ground, 0.0, 2 * ground], rel=1e-9)
    assert found.rest.toarray() == pytest.approx(factor * ROW, rel=1e-12)


def test_each_uncoupled_part_has_its_own_share() -> None:
    none = np.zeros((3, 3))
    stiffness = np.block([[ROW, none], [none, 2 * ROW]])
    found = split(np.block([[1e-6 * ROW, none], [none, 8e-6 * ROW]]), stiffness)
    assert found.factor == pytest.approx([1e-6] * 3 + [4e-6] * 3)
    assert not found.diagonal.any()


def test_dashpots_to_the_ground_alone_need_no_older_velocity() -> None:
    found = split(np.diag([1.0, 0.0, 3.0]))
    assert not found.lagged
    assert list(found.diagonal) == [1.0, 0.0, 3.0]
    assert found.factor is not None
    assert not found.factor.any()
    assert found.rest.nnz == 0


def test_dashpots_between_freedoms_in_no_share_of_the_stiffness() -> None:
    between = np.array([[5.0, -5, 0], [-5, 5, 0], [0, 0, 0]])
    found = split(between + np.diag([0.0, 2.0, 7.0]))
    assert found.factor is None
    assert found.diagonal == pytest.approx([0.0, 2.0, 7.0])
    assert found.diagonal[0] == 0.0
    assert found.rest.toarray() == pytest.approx(between)


def test_rows_without_an_excess_keep_their_diagonal_unless_they_stand_alone() -> None:
    # Row 0 couples to more than its own dashpot, so nothing of coupled rows is certain to be to the ground.
    found = split([[4.0, -5, 0], [-5, 9, 0], [0, 0, 6]])
    assert found.factor is None
    assert list(found.diagonal) == [0.0, 0.0, 6.0]


def test_sums_and_blocks_are_those_of_scipy_whether_places_are_shared_or_not() -> None:
    rng = np.random.default_rng(1)
    matrix = sp.csr_array(sp.random_array((12, 12), density=0.3, rng=rng))
    other = sp.csr_array(sp.random_array((12, 12), density=0.3, rng=rng))
    same = sp.csr_array((matrix.data**2, matrix.indices, matrix.indptr), shape=matrix.shape)
    for second in (same, other):
        assert np.array_equal(plus(matrix, second).toarray(), (matrix + second).toarray())
    wide = sp.csr_array((other.data, other.indices.astype(np.int64), other.indptr.astype(np.int64)), shape=(12, 12))
    found = beside([matrix, sp.csr_array((0, 0)), sp.csr_array((3, 3)), wide])
    assert np.array_equal(found.toarray(), sp.block_diag([matrix, sp.csr_array((3, 3)), other]).toarray())
    assert found.indices.dtype == found.indptr.dtype == np.int32
    assert found.has_canonical_format
