"""Masses that nothing holds but a contact between them: λ²(λ² + k (1/m₁ + (1 − μ)/m₂)) = 0, four zero roots at once."""

from __future__ import annotations

import numpy as np
import pytest

import stridor as st
from stridor.modal.options import Options
from stridor.modal.over_friction import modes_of_band, onsets_of_band
from stridor.system import System

pytestmark = pytest.mark.verification
TOP = 10.0  # Hz


def free(first: float, second: float) -> System:
    """Masses of one freedom each; the gap is u₁ − u₂, and friction works on the second one."""
    contact = {
        "normal": [1, -1], "tangent": [0, 1], "stiffness": 1.0, "friction": {"law": "coulomb", "coefficient": 0.5},
        "slip": -1.0,
    }  # fmt: skip
    return st.System.from_matrices(np.diag([first, second]), None, np.zeros((2, 2)), contacts={"c": contact})


@pytest.mark.parametrize("masses", [(2.0, 1.0), (1.0, 1.0), (3.0, 2.0)])
@pytest.mark.parametrize("beyond", [0.5, 1.0, 1.3])
def test_divergence_beside_zero_roots(masses: tuple[float, float], beyond: float) -> None:
    limit = 1.0 + masses[1] / masses[0]
    found = onsets_of_band(free(*masses), (0.0, limit + beyond), TOP)
    assert (found.source, found.complete) == ("receptance", True)
    [onset] = found.onsets
    assert (onset.kind, onset.frequency_hz, onset.stabilising) == ("divergence", 0.0, False)
    assert onset.mu == pytest.approx(limit, rel=1e-12)
    # λ = √((μ − μ_c)/m₂)
    assert onset.square_root_coefficient == pytest.approx(masses[1] ** -0.5, rel=1e-6)
    assert onset.residual < 1e-12


def test_modes_at_and_beyond_the_place_where_all_are_zero() -> None:
    found = modes_of_band(free(2.0, 1.0), [0.0, 1.5, 2.0], TOP)
    assert np.nanmax(found.eigenvalues.real, axis=1) == pytest.approx([0.0, 0.0, np.sqrt(0.5)], abs=1e-4)


def test_what_rounding_makes_of_four_zero_roots_did_not_begin_above_the_band() -> None:
    """A range that ends there, in the full problem: a pair grows by rounding, where the onset says one root."""
    found = onsets_of_band(free(1.0, 1.0), (0.0, 2.0), TOP, options=Options(source="full"))
    assert not found.complete
    assert "began above" not in found.completeness
