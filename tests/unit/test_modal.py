"""Small promises of the modal side: arguments, documents, messages."""

from __future__ import annotations

import json
import warnings
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp

from benches import Slave, bench, by_hand, full_eigenvalues
from stridor.errors import AnalysisError, CaseError
from stridor.laws import Coulomb, StaticKinetic, Weakening
from stridor.modal import checked_modes
from stridor.modal.complex_modes import complex_modes
from stridor.modal.growing import Growing
from stridor.modal.onsets import onsets
from stridor.modal.quadratic import Quadratic


@pytest.mark.parametrize("mu", [-0.1, float("nan"), float("inf"), []])
def test_friction_coefficients_are_checked(mu):
    with pytest.raises(CaseError, match="friction coefficients are numbers ≥ 0"):
        complex_modes(bench(), mu)


@pytest.mark.parametrize("bounds", [(0.5, 0.5), (0.5, 0.1), (-0.1, 0.3), (0.0, float("inf"))])
def test_the_friction_range_is_checked(bounds):
    with pytest.raises(CaseError, match="two numbers 0 ≤ a < b"):
        onsets(bench(), bounds)


def test_documents_are_json():
    answer = onsets(bench(), (0.0, 0.3), max_frequency_hz=20e3)
    document = json.loads(json.dumps(answer.to_json()))
    assert {"mu", "frequency_hz", "kind", "damped", "branches", "residual"} <= document["onsets"][0].keys()
    assert answer.first is answer.onsets[0]
    modes = json.loads(json.dumps(complex_modes(bench(), [0.0, 0.2], count=3).to_json()))
    assert [len(row) for row in modes["modes"]] == [3, 3]
    assert {"frequency_hz", "growth_rate", "damping_ratio", "unstable", "residual", "branch"} == modes[
        "modes"
    ][0][0].keys()


def test_no_contact_gives_the_modes_of_the_bodies():
    system = by_hand(
        np.eye(2), np.zeros((2, 2)), np.diag([4.0, 9.0]), np.zeros((0, 2)), np.zeros((0, 2)), 1.0
    )
    modes = complex_modes(system, [0.0, 1.0], count=2)
    np.testing.assert_allclose(modes.eigenvalues, [[2j, 3j]] * 2, atol=1e-12)
    assert onsets(system, (0.0, 1.0), max_frequency_hz=1.0).onsets == ()


def test_a_count_larger_than_the_system_gives_them_all():
    system = bench(Slave(elements=1), elements=3)
    modes = complex_modes(system, 0.1, count=500)
    assert len(modes.branch) == system.size


def test_a_freedom_without_mass_is_reported():
    system = by_hand(np.diag([1.0, 0.0]), np.zeros((2, 2)), np.eye(2), [[1.0, 0.0]], [[0.0, 1.0]], 1.0)
    with pytest.raises(AnalysisError, match="stiffness but no mass"):
        complex_modes(system, 0.1)


def test_damping_that_is_not_proportional_within_a_body():
    rng = np.random.default_rng(4)
    roots = rng.standard_normal((2, 5, 5))
    stiffness = roots[0] @ roots[0].T + np.diag(np.arange(1.0, 6.0))
    damping = 0.05 * roots[1] @ roots[1].T
    system = by_hand(
        np.eye(5), damping, stiffness, rng.standard_normal((1, 5)), rng.standard_normal((1, 5)), 3.0
    )
    modes = complex_modes(system, [0.0, 0.4, 1.0], count=5)
    assert modes.residual.max() < 1e-12
    for row, mu in enumerate(modes.mu):
        dense = full_eigenvalues(system, mu)
        dense = np.sort_complex(dense[dense.imag > 0])
        got = modes.eigenvalues[row]
        np.testing.assert_allclose(np.sort_complex(got[got.imag > 0]), dense, rtol=1e-9)


def test_rigid_contact_says_where_it_ceases_to_determine_the_motion():
    """Painlevé: nᵀM⁻¹(n + μ s t) = 0 at μ = 2 for a contact whose tangent works against its normal."""
    system = by_hand(
        np.eye(2), np.zeros((2, 2)), np.diag([1.0, 3.0]), [[1.0, 0.5]], [[0.625, 0.0]], np.inf, slip=1.0
    )
    assert np.all(np.isfinite(complex_modes(system, 1.5, count=2).eigenvalues))
    with pytest.raises(AnalysisError, match="Painlevé"):
        complex_modes(system, 2.5, count=2)


@pytest.mark.parametrize("law", [Coulomb(0.2), StaticKinetic(0.2, 0.3), Weakening(0.1, 0.3, 0.05)])
def test_laws_scale_to_a_coefficient_and_their_slopes_are_derivatives(law):
    scaled = law.scaled(0.45, 0.03)
    assert scaled.sliding(0.03) == pytest.approx(0.45)
    assert scaled.sticking / scaled.sliding(0.03) == pytest.approx(law.sticking / law.sliding(0.03))
    h = 1e-7
    assert law.slope(0.03) == pytest.approx(
        (law.sliding(0.03 + h) - law.sliding(0.03 - h)) / (2 * h), abs=1e-6
    )
    assert law.sliding(-0.03) == law.sliding(0.03)


def test_a_mode_sharpened_beside_real_ones_keeps_its_imaginary_part(monkeypatch):
    """Motions that only diverge are real; what one more step of inverse iteration gives has a phase of its own."""
    problem = Quadratic(*(sp.csr_array(m) for m in (np.eye(2), np.zeros((2, 2)), np.diag([-4.0, 1.0]))))
    phase = np.exp(1.2j)
    monkeypatch.setattr(
        checked_modes, "solved_beside",
        lambda *_, **__: SimpleNamespace(lam=2.0 + 0j, right=phase * np.array([1.0, 0.0])),
    )  # fmt: skip
    rough = np.array([[1.0], [1e-5]])
    found = Growing(0.0, np.array([2.0 + 0j]), rough, np.array([1e-4]), np.zeros(0), True, "", 10.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sharp = checked_modes._sharpened(problem, found, np.array([0]), None)
    assert sharp.residual[0] < 1e-15
    np.testing.assert_allclose(sharp.right[:, 0], phase * np.array([1.0, 0.0]), atol=1e-15)
