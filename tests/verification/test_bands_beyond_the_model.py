"""Bands that reach far beyond a model's fastest motion: its eigenvalues keep their digits, and growth in it is seen."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp

import stridor as st
from benches import paper_case
from stridor.modal.krylov import refine
from stridor.modal.quadratic import Quadratic
from stridor.modal.quadratic.reach import fastest, searched

pytestmark = pytest.mark.verification

# A unit mass on a moving floor, two springs across each other and a contact spring, all of order one.
DIRECTIONS = np.array([[1.0, 1.0], [1.0, -0.6]])
SPRINGS = (2.0, 3.0)
CONTACT = 1.5
CASE = """
units = "nondimensional"
[bodies.m]
type = "mass"
mass = {mass}
position = [0.0, 0.0]
[bodies.floor]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [0.0, 1.0]
sliding = {{ velocity = [1.0, 0.0] }}
[springs.a]
between = ["m", "ground"]
stiffness = 2.0
direction = [1.0, 1.0]
damping = {damping}
[springs.b]
between = ["m", "ground"]
stiffness = 3.0
direction = [1.0, -0.6]
[loads.press]
at = "m"
force = [0.0, -10.0]
[contacts.A]
slave = "m"
master = "floor"
stiffness = {stiffness}
friction = {{ law = "coulomb", coefficient = 0.9 }}
[modal]
friction_range = [0.0, 2.0]
{band}
"""


def floor(band: str, *, mass: float = 1.0, stiffness: object = CONTACT, damping: float = 0.0) -> st.Case:
    """The case with a line for the band."""
    return st.loads(CASE.format(band=band, mass=mass, stiffness=stiffness, damping=damping))


def stiffness_at(mu: float) -> np.ndarray:
    """K (2, 2): springs, contact, and the friction force μN on the mass along the floor's motion."""
    unit = DIRECTIONS / np.linalg.norm(DIRECTIONS, axis=1)[:, None]
    springs = sum(k * np.outer(d, d) for k, d in zip(SPRINGS, unit, strict=True))
    return springs + CONTACT * np.array([[0.0, mu], [0.0, 1.0]])


def flutter_at() -> float:
    """μ at which both frequencies meet: (K₁₁ − K₂₂)² + 4 K₁₂ K₂₁ = 0."""
    k = stiffness_at(0.0)
    return float(-((k[0, 0] - k[1, 1]) ** 2 / (4 * k[0, 1]) + k[0, 1]) / CONTACT)


BANDS = pytest.mark.parametrize("band", ["", "max_frequency_hz = 1.0", "max_frequency_hz = 1e9"])


@BANDS
@pytest.mark.parametrize("mu", [0.1, 0.9])
def test_modes_of_order_one_are_those_of_the_matrix(band: str, mu: float) -> None:
    found = st.modes(floor(band), mu)
    exact = np.emath.sqrt(-sl.eigvals(stiffness_at(mu)))
    exact = np.where(exact.imag < 0, -exact, exact)
    assert found.eigenvalues.shape == (1, 2)
    assert np.abs(found.eigenvalues[0][:, None] - exact).min(axis=0) == pytest.approx(0.0, abs=1e-12)
    assert found.residual.max() < 1e-12
    grow = "1 mode grows" if mu > flutter_at() else "no mode grows"
    assert found.completeness[0].startswith(f"Checked: {grow}")


@BANDS
def test_flutter_of_order_one_is_found(band: str) -> None:
    found = st.onsets(floor(band))
    assert [o.mu for o in found.onsets] == pytest.approx([flutter_at()], rel=1e-10)
    assert found.completeness.startswith("Checked at both ends: no mode grows at μ = 0 and 1 mode grows at μ = 2")


@pytest.mark.parametrize("band", [1.0, 100.0, 1e6])
def test_a_heavy_mass_on_a_rigid_floor(band: float) -> None:
    """It moves along the floor alone: ω² = k t·(dd)(1, 0) − with friction the forces across count μ-fold."""
    found = st.modes(floor(f"max_frequency_hz = {band}", mass=1e4, stiffness='"rigid"', damping=0.01), 0.5)
    k = stiffness_at(0.0)
    # N = press + K₂₁ x pushes down on the floor, which moves in +x and drags by μN.
    omega = np.sqrt((k[0, 0] - 0.5 * k[1, 0]) / 1e4)
    assert found.frequency_hz[0] == pytest.approx([omega / (2 * np.pi)], rel=1e-6)


def test_a_band_of_many_decades_has_the_onsets_of_one_that_ends_with_the_model() -> None:
    """By receptance: its dense problems are scaled by the band, where they would lose the digits of what is slow."""
    case = paper_case(bodies__beam1__elements=4, bodies__beam2__elements=12)
    found, wide = (st.onsets(case, max_frequency_hz=band) for band in (1e8, 1e12))
    assert len(found) == len(wide) > 2
    assert [o.mu for o in wide.onsets] == pytest.approx([o.mu for o in found.onsets], rel=1e-10)


def test_what_does_not_settle_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stridor.modal.krylov.modes.searched", lambda _, top: top)
    monkeypatch.setattr("stridor.modal.source.WHOLE", 0)  # too large for the answer in full
    with pytest.raises(st.AnalysisError, match=r"do not settle: a backward error of .* lower modal.max_frequency_hz"):
        st.modes(floor("max_frequency_hz = 1e6"), 0.1)
    assert refine.BELIEVED < 1e-6


@pytest.mark.parametrize("seed", range(20))
def test_nothing_is_faster_than_the_bound(seed: int) -> None:
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 9))
    root = random.standard_normal((n, n))
    mass = root @ root.T + 0.3 * np.eye(n) if seed % 2 else np.diag(random.uniform(0.1, 9.0, n))
    damping, stiffness = random.standard_normal((2, n, n)) * 10.0 ** random.uniform(-3, 3, (2, 1, 1))
    problem = Quadratic(*(sp.csr_array(m) for m in (mass, damping, stiffness)))
    companion = np.block([[np.zeros((n, n)), np.eye(n)], [-sl.solve(mass, stiffness), -sl.solve(mass, damping)]])
    largest = np.abs(sl.eigvals(companion)).max()
    assert largest <= fastest(problem) * (1 + 1e-9)
    assert searched(problem, 0.5 * largest) == 0.5 * largest
