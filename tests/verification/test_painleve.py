"""Up to which μ rigid contact with friction determines the motion: judged by masses, whatever band is asked for.

The truth is that of springs in the contacts which become stiffer and stiffer: where an eigenvalue grows without bounds
with them, rigid contact has no motion.
"""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp

import stridor as st
from stridor.errors import AnalysisError
from stridor.modal.complex_modes import complex_modes
from stridor.modal.full import full_modes, full_onsets
from stridor.modal.onsets import onsets
from stridor.modal.options import Options
from stridor.modal.painleve import singular_from, undetermined_from
from stridor.system import System

pytestmark = pytest.mark.verification

COULOMB = {"law": "coulomb", "coefficient": 0.3}
GRID = np.linspace(0.02, 3.0, 60)
SOFT = 1e-12  # compliance over that of the structure: rates of what springs throw apart are a million times its own


def two_freedoms(slip: float = -1.0) -> System:
    """Painlevé's paradox at nᵀM⁻¹n/(nᵀM⁻¹t) = 1/0.6 for a slip of −1, at none for +1."""
    contact = {"normal": [1.0, 0.0], "tangent": [0.0, 1.0], "stiffness": "rigid", "slip": slip, "friction": COULOMB}
    return System.from_matrices(
        [[1.0, 0.6], [0.6, 1.0]], 0.02 * np.eye(2), [[4.0, 1.0], [1.0, 3.0]], contacts={"c": contact}
    )


@pytest.mark.parametrize("source", [None, "receptance", "krylov", "full"])
@pytest.mark.parametrize("band_hz", [0.2, pytest.param(1.0, marks=pytest.mark.slow), 10.0])
def test_it_is_refused_whatever_the_band_and_the_source(band_hz, source):
    system = two_freedoms()
    says = r"at μ = 1\.66666667: .*Painlevé"
    with pytest.raises(AnalysisError, match=says):
        complex_modes(system, 2.5, max_frequency_hz=band_hz, source=source)
    with pytest.raises(AnalysisError, match=says):
        complex_modes(system, [0.1, 1.7], max_frequency_hz=band_hz, source=source)
    with pytest.raises(AnalysisError, match=says):
        onsets(system, (0.0, 3.0), max_frequency_hz=band_hz, source=source)
    # Below it, and where the contact slips the other way, there is nothing to refuse.
    for well, high in ((system, 1.6), (two_freedoms(1.0), 3.0)):
        assert np.all(complex_modes(well, high, max_frequency_hz=band_hz, source=source).residual < 1e-10)
        onsets(well, (0.0, high), max_frequency_hz=band_hz, source=source)


def test_verbs_and_matrices_that_depend_on_friction_say_the_same():
    system = two_freedoms()
    calls = (
        lambda: st.modes(system, 2.5, max_frequency_hz=0.2),
        lambda: st.onsets(system, (0.0, 3.0), max_frequency_hz=0.2),
        lambda: full_modes(lambda _: system, 2.5, max_frequency_hz=0.2),
        lambda: full_onsets(lambda _: system, (0.0, 3.0), max_frequency_hz=0.2),
    )
    for call in calls:
        with pytest.raises(AnalysisError, match="Painlevé"):
            call()


def random_system(seed: int) -> tuple[System, np.ndarray, np.ndarray, np.ndarray]:
    """One to three rigid contacts, some without friction, elastic ones beside them, lumped and consistent masses.

    With it N and S (m, n) of the rigid ones, and N M⁻¹ Nᵀ."""
    rng = np.random.default_rng([seed, 11])
    n = int(rng.integers(4, 12))
    half = np.diag(np.exp(rng.uniform(-1, 1, n)))
    if seed % 3:
        half = half @ (np.eye(n) + 0.4 * np.tril(rng.standard_normal((n, n)), -1) / np.sqrt(n))
    basis = np.linalg.qr(rng.standard_normal((n, n)))[0]
    stiffness = half @ basis @ np.diag(rng.uniform(0.5, 4.0, n) ** 2) @ basis.T @ half.T
    mass, damping = half @ half.T, 0.01 * stiffness
    contacts, normal, slide = {}, [], []
    for k in range(int(rng.integers(1, 4)) + 1):
        rows = rng.standard_normal((2, n)) if rng.random() < 0.6 else np.eye(n)[rng.integers(n, size=2)]
        rigid, slip = k > 0, float(rng.choice([-1.0, 1.0]))
        rubs = bool(k == 1 or rng.random() < 0.8)
        friction = COULOMB if rubs else {"law": "coulomb", "coefficient": 0.0}
        contacts[f"c{k}"] = {
            "normal": rows[0], "tangent": rows[1], "stiffness": "rigid" if rigid else 5.0, "slip": slip,
            "friction": friction,
        }  # fmt: skip
        if rigid:
            normal.append(rows[0])
            slide.append(-slip * rows[1] * rubs)
    system = System.from_matrices(mass, damping, (stiffness + stiffness.T) / 2, contacts=contacts)
    found = np.array(normal), np.array(slide)
    return system, *found, found[0] @ np.linalg.solve(mass, found[0].T)


def thrown_apart(system: System, normal: np.ndarray, slide: np.ndarray, own: np.ndarray, mu: float) -> bool:
    """Whether something grows without oscillating at rates far beyond the structure's, with all but rigid springs."""
    springs = (normal + mu * slide).T @ np.linalg.solve(SOFT * own, normal)
    mass, stiffness = system.mass.toarray(), system.stiffness.toarray()
    squares = sl.eigvals(stiffness + springs, -mass)
    fast = np.abs(squares) > 1e-4 / SOFT
    return bool(np.any(fast & (squares.real > 0) & (np.abs(squares.imag) < 1e-3 * np.abs(squares))))


def against_ever_stiffer_springs(seed: int) -> tuple[int, int]:
    """How many of the μ are refused and how many not; each as the springs say."""
    system, normal, slide, own = random_system(seed)
    limit = undetermined_from(system, Options())
    strengths = np.linalg.svd(own, compute_uv=False)
    if strengths[-1] < 1e-9 * strengths[0]:
        return 0, 0  # given twice
    refused = kept = 0
    for mu in GRID[np.abs(GRID - limit) > 0.01 * GRID]:
        bad = thrown_apart(system, normal, slide, own, mu)
        assert bad == (mu > limit), (seed, mu, limit)
        refused, kept = refused + bad, kept + (not bad)
    if 0.05 < limit < 3.0:
        with pytest.raises(AnalysisError, match=f"{limit:.9g}"):
            complex_modes(system, 1.001 * limit, max_frequency_hz=0.05)
        with pytest.raises(AnalysisError, match=f"{limit:.9g}"):
            onsets(system, (0.0, 1.001 * limit), max_frequency_hz=0.05)
    return refused, kept


def test_it_is_refused_where_ever_stiffer_springs_throw_apart_and_nowhere_else():
    counts = np.sum([against_ever_stiffer_springs(seed) for seed in range(24)], axis=0)
    assert np.all(counts > 100), counts


@pytest.mark.slow
@pytest.mark.parametrize("start", range(24, 624, 100))
def test_it_is_so_of_many_more(start):
    counts = np.sum([against_ever_stiffer_springs(seed) for seed in range(start, start + 100)], axis=0)
    assert np.all(counts > 500), counts


def test_what_has_no_mass_does_not_count_and_contact_on_it_is_not_judged():
    system = two_freedoms()
    normal, slide = (sp.csr_array(np.array([row])) for row in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    mass = np.zeros((3, 3))
    mass[:2, :2] = system.mass.toarray()
    assert singular_from(sp.csr_array(mass), normal, slide) == pytest.approx(1 / 0.6, rel=1e-14)
    on_it = sp.csr_array(np.array([[0.0, 0.0, 1.0]]))
    assert singular_from(sp.csr_array(mass), normal, on_it) == np.inf
    assert singular_from(sp.csr_array(mass), on_it, slide) == np.inf


def test_of_many_nodes_consistent_masses_are_solved_with():
    rng = np.random.default_rng(5)
    n, m = 400, 70
    mass = sp.csr_array(sp.diags_array([np.full(n - 1, 1.0), np.full(n, 4.0), np.full(n - 1, 1.0)], offsets=[-1, 0, 1]))
    normal = sp.csr_array(np.eye(n)[::5][:m])
    slide = sp.csr_array(sp.random_array((m, n), density=0.02, rng=rng) - sp.random_array((m, n), density=0.02, rng=rng))
    whole = np.linalg.inv(mass.toarray())
    still, moved = normal @ whole @ normal.T, normal @ whole @ slide.T.toarray()
    limit = singular_from(mass, normal, slide)
    signs = [np.linalg.slogdet(still + mu * moved)[0] for mu in (0.999 * limit, 1.001 * limit)]
    assert signs == [1.0, -1.0]
    assert all(np.linalg.slogdet(still + mu * moved)[0] == 1.0 for mu in np.linspace(0, 0.999 * limit, 50))


def test_elastic_contact_is_never_judged():
    system = two_freedoms()
    soft = {
        "normal": [1.0, 0.0], "tangent": [0.0, 1.0], "stiffness": 50.0, "slip": -1.0, "friction": COULOMB,
    }  # fmt: skip
    elastic = System.from_matrices(system.mass, system.damping, system.stiffness, contacts={"c": soft})
    assert undetermined_from(elastic, Options()) == np.inf
    assert np.all(complex_modes(elastic, 2.5, max_frequency_hz=10.0).residual < 1e-10)
