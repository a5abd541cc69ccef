"""What the implicit stepper is made ready with: independent statics, uncoupled damping, the operator of some nodes."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp

from stridor.temporal.steppers.coordinates import DEPENDENT, _independent
from stridor.temporal.steppers.implicit.build import coupling


@pytest.mark.parametrize("apart", [1.0, 1e-2, 1e-4])
def test_statics_span_what_they_did_and_have_unit_mass(apart: float):
    """Columns that are all but one, one of zeros and one twice: as good as those that are well apart."""
    rng = np.random.default_rng(5)
    mass = sp.diags_array(rng.uniform(0.1, 10.0, 40)).tocsr()
    first = rng.standard_normal((40, 6))
    columns = np.hstack([first, first[:, :3] + apart * rng.standard_normal((40, 3)), np.zeros((40, 1)), first[:, :1]])
    columns *= 10.0 ** rng.uniform(-6, 6, columns.shape[1])
    vectors, turned = _independent(columns, mass)
    found = vectors @ turned
    assert found.shape == (40, 9)
    assert np.abs(found.T @ (mass @ found) - np.eye(9)).max() < 1e-11
    whole = columns[:, np.linalg.norm(columns, axis=0) > 0]
    angles = sl.subspace_angles(found, whole[:, :9])
    assert angles.max() < 10 * np.finfo(float).eps / min(apart, 1.0) ** 2 + np.sqrt(DEPENDENT) * 1e-3


def test_coupling_bounds_what_it_makes_of_the_power_that_any_motion_loses():
    rng = np.random.default_rng(6)
    root = rng.standard_normal((7, 7))
    damping = np.diag(rng.uniform(1.0, 100.0, 7)) + 0.1 * root @ root.T
    diagonal = np.diag(np.diag(damping))
    rates = rng.standard_normal((7, 5000))
    shares = np.einsum("ij,ij->j", rates, (damping - diagonal) @ rates) / np.einsum(
        "ij,ij->j", rates, diagonal @ rates
    )
    bound = coupling(damping)
    assert np.abs(shares).max() <= bound <= 3 * np.abs(shares).max()
    assert coupling(diagonal) == 0.0


def test_coupling_where_a_coordinate_has_no_damping_of_its_own():
    """None for one that takes nothing from others, without bound for one that does."""
    assert coupling(np.array([[0.0, 0.0, 0.0], [0.0, 2.0, 0.1], [0.0, 0.1, 2.0]])) == pytest.approx(0.05)
    assert coupling(np.array([[0.0, 0.1], [0.1, 2.0]])) == np.inf
