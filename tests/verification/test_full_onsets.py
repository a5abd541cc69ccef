"""Onsets of imported matrices: closed forms, and meshed models sent on a way round through files."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp

import stridor as st
from benches import bench, paper_case
from matrix_cases import MESHED, TURN, export, exported, matrix_case, rubbing
from solid_cases import bench_as_solids, case, slider
from stridor.modal import full
from stridor.modal.checked_onsets import checked_onsets
from stridor.modal.complex_modes import complex_modes
from stridor.modal.full import words
from stridor.modal.full.counted import Counted, Passing
from stridor.modal.full.family import Family, Smooth, family_of
from stridor.modal.full.search import Answer
from stridor.modal.newton import Border, standstill
from stridor.modal.onsets import onsets
from stridor.modal.options import Options
from stridor.modal.quadratic import Quadratic
from stridor.system import build_system

pytestmark = pytest.mark.verification

ONE = np.eye(2)
# Hoffmann, Fischer, Allgaier and Gaul, Mech. Res. Comm. 29 (2002): a mass, two springs and a third under a belt.
K3 = 4 / 3
OBLIQUE = np.array([[2.0, 1.0], [1.0, 2.0]])
BELT = np.array([[0.0, -K3], [0.0, 0.0]])


def minimal(damping: np.ndarray | None = None, factor: str = "mu", belt: np.ndarray = BELT) -> list:
    terms = [(ONE, "mass", ""), (OBLIQUE, "stiffness", ""), (belt, "stiffness", factor)]
    return terms if damping is None else [*terms, (damping, "damping", "")]


def eigenvalues(terms: list, mu: float) -> np.ndarray:
    """All λ with Im λ ≥ 0 of dense matrices with factors 1 and mu."""
    n = terms[0][0].shape[0]
    total = {"mass": np.zeros((n, n)), "damping": np.zeros((n, n)), "stiffness": np.zeros((n, n))}
    for matrix, role, factor in terms:
        total[role] += (mu if factor else 1.0) * np.asarray(matrix)
    mass, damping, stiffness = (total[role] for role in ("mass", "damping", "stiffness"))
    first = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
    found = sl.eigvals(first, sl.block_diag(np.eye(n), mass))
    return found[np.isfinite(found) & (found.imag >= -1e-9)]


# -- closed forms ------------------------------------------------------------------------------------------------------
def test_two_modes_that_meet(tmp_path: Path):
    """λ² = −2 ± √(1 − 4μ/3) at the critical μ = 3/4, where growth opens as √(4/3)/(2√2) √(μ − μ_c)."""
    found = st.onsets(matrix_case(tmp_path, minimal(), 1.0))
    (onset,) = found.onsets
    assert (onset.kind, onset.stabilising, onset.branches, onset.damped) == ("flutter", False, (1, 2), False)
    assert onset.mu == pytest.approx(0.75, rel=1e-12)
    assert 2 * np.pi * onset.frequency_hz == pytest.approx(math.sqrt(2), rel=1e-12)
    assert onset.square_root_coefficient == pytest.approx(math.sqrt(4 / 3) / (2 * math.sqrt(2)), rel=1e-9)
    assert onset.growth_slope is None
    assert onset.residual < 1e-14
    assert found.first is onset
    assert found.completeness.startswith("Complete as far as both ends tell: 0 modes grow at μ = 0 and 1 at μ = 1,")
    # The other way round friction drives them apart.
    assert not st.onsets(matrix_case(tmp_path, minimal(belt=-BELT), 1.0)).onsets


@pytest.mark.parametrize(("c1", "c2"), [(0.02, 0.02), (0.02, 0.01), (0.1, 0.02), (0.02, 0.002), (0.1, 0.002)])
def test_damping_moves_it_as_hurwitz_says(tmp_path: Path, c1: float, c2: float):
    """λ⁴ + a₃λ³ + a₂λ² + a₁λ + a₀ has a root jω with ω² = a₁/a₃ where a₁a₂a₃ = a₁² + a₃²a₀, a quadratic in μ."""
    axes = np.array([[1.0, 1.0], [1.0, -1.0]]) / math.sqrt(2)
    d = c1 * np.outer(axes[0], axes[0]) + c2 * np.outer(axes[1], axes[1])
    mu = np.polynomial.Polynomial([0.0, 1.0])
    k12 = OBLIQUE[0, 1] - K3 * mu
    a3, a2 = np.trace(d), np.trace(OBLIQUE) + np.linalg.det(d)
    a1 = d[0, 0] * OBLIQUE[1, 1] + d[1, 1] * OBLIQUE[0, 0] - d[0, 1] * (k12 + OBLIQUE[1, 0])
    a0 = OBLIQUE[0, 0] * OBLIQUE[1, 1] - k12 * OBLIQUE[1, 0]
    critical = (a1 * a2 * a3 - a1 * a1 - a3 * a3 * a0).roots()
    expected = sorted(float(r.real) for r in critical if abs(r.imag) < 1e-12 and 0 < r.real < 1 and a1(r.real) > 0)
    terms = minimal(d)
    found = st.onsets(matrix_case(tmp_path, terms, 1.0)).onsets
    assert [o.mu for o in found] == pytest.approx(expected, rel=1e-11)
    for onset in found:
        omega = 2 * np.pi * onset.frequency_hz
        assert omega**2 == pytest.approx(a1(onset.mu) / a3, rel=1e-11)
        assert onset.damped
        rates = [
            (e := eigenvalues(terms, onset.mu + step))[np.argmin(np.abs(e - 1j * omega))].real for step in (-1e-6, 1e-6)
        ]
        assert onset.growth_slope == pytest.approx((rates[1] - rates[0]) / 2e-6, rel=1e-5)


SPRING, SPIN, DAMP = 4.0, 0.7, 0.05


def whirl() -> float:
    """Faster whirl of a mass on springs k with gyroscopic forces g."""
    return (SPIN + math.sqrt(SPIN**2 + 4 * SPRING)) / 2


def turning(damping: float, spin: float) -> list:
    """z̈ + (d + jg) ż + (k + jμ) z = 0 for z = u + jv."""
    return [
        (ONE, "mass", ""),
        (damping * ONE + spin * TURN, "damping", ""),
        (SPRING * ONE, "stiffness", ""),
        (TURN, "stiffness", "mu"),
    ]


def test_gyroscopic_damped_and_circulatory_forces(tmp_path: Path):
    """The whirl ω of z̈ + (d + jg)ż + (k + jμ)z = 0 turns unstable at μ = dω."""
    (onset,) = st.onsets(matrix_case(tmp_path, turning(DAMP, SPIN), 1.0)).onsets
    assert onset.mu == pytest.approx(DAMP * whirl(), rel=1e-12)
    assert 2 * np.pi * onset.frequency_hz == pytest.approx(whirl(), rel=1e-12)
    # λ = −jω there; dλ/dμ = −j/(2λ + d + jg).
    assert onset.growth_slope == pytest.approx((-1j / (-2j * whirl() + DAMP + 1j * SPIN)).real, rel=1e-10)
    assert (onset.damped, onset.stabilising) == (True, False)


@pytest.mark.parametrize(("spin", "slope"), [(SPIN, 1 / math.sqrt(SPIN**2 + 4 * SPRING)), (0.0, 0.25)])
def test_what_nothing_damps_grows_from_the_first_friction_on(tmp_path: Path, spin: float, slope: float):
    """With gyroscopic forces Re λ opens as μ/√(g² + 4k), and so it does of two equal modes that friction splits."""
    for damped in (True, False):
        found = st.onsets(matrix_case(tmp_path, turning(0.0, spin), 1.0), damped=damped)
        (onset,) = found.onsets
        # The faster whirl leaves the axis by itself, of two equal modes both do.
        branches, words = ((2, 2), "flutter of mode 2") if spin else ((1, 2), "flutter of modes 1 and 2")
        assert (onset.mu, onset.branches, onset.stabilising, onset.damped) == (0.0, branches, False, False)
        assert onset.words.endswith(words)
        assert onset.growth_slope == pytest.approx(slope, rel=1e-12)
        omega = (spin + math.sqrt(spin**2 + 4 * SPRING)) / 2
        assert 2 * np.pi * onset.frequency_hz == pytest.approx(omega, rel=1e-12)
        assert found.completeness.startswith("Complete")


def test_gyroscopic_forces_hold_what_a_potential_lets_fall(tmp_path: Path):
    """Springs 1 − μ, 1.5 − μ and spin 1.5: one mode diverges at 1, at 1.5 spin holds both again, and at 16.5625/9 they
    meet: λ⁴ + (4.75 − 2μ)λ² + (1 − μ)(1.5 − μ) = 0."""
    terms = [(ONE, "mass", ""), (1.5 * TURN, "damping", ""), (np.diag([1.0, 1.5]), "stiffness", ""), (-ONE, "stiffness", "mu")]
    found = st.onsets(matrix_case(tmp_path, terms, 1.0, (0.0, 2.0)))
    critical = 16.5625 / 9
    assert [(o.kind, o.stabilising, o.branches) for o in found.onsets] == [
        ("divergence", False, (1, 1)), ("divergence", True, (1, 1)), ("flutter", False, (1, 2))
    ]  # fmt: skip
    assert [o.mu for o in found.onsets] == pytest.approx([1.0, 1.5, critical], rel=1e-12)
    omega = math.sqrt((4.75 - 2 * critical) / 2)
    assert [2 * np.pi * o.frequency_hz for o in found.onsets] == pytest.approx([0.0, 0.0, omega], rel=1e-11)
    # λ² = −P/S beside a divergence; half the root of S² − 4P = 16.5625 − 9μ beside the meeting.
    expected = [math.sqrt(0.5 / 2.75), math.sqrt(0.5 / 1.75), math.sqrt(9) / (4 * omega)]
    assert [o.square_root_coefficient for o in found.onsets] == pytest.approx(expected, rel=1e-8)
    assert found.completeness.startswith("Complete")


def test_a_mode_that_starts_unstable_is_no_onset_but_is_counted(tmp_path: Path):
    terms = [
        (np.eye(3), "mass", ""),
        (sl.block_diag(OBLIQUE, -0.01), "stiffness", ""),
        (sl.block_diag(BELT, 0.0), "stiffness", "mu"),
    ]
    found = st.onsets(matrix_case(tmp_path, terms, 1.0))
    assert [o.mu for o in found.onsets] == pytest.approx([0.75], rel=1e-12)
    assert found.onsets[0].branches == (2, 3)
    assert "1 mode grows at μ = 0 and 2 at μ = 1" in found.completeness
    inside = st.onsets(matrix_case(tmp_path, terms, 1.0), (0.8, 0.9))
    assert not inside.onsets
    assert "2 modes grow at μ = 0.8 and 2 at μ = 0.9" in inside.completeness


def test_divergence_with_and_without_damping(tmp_path: Path):
    """det K = 3 − 2μ = 0; with damping d the growth rate passes zero with slope −(det K)'/(d tr K)."""
    terms = [(ONE, "mass", ""), (OBLIQUE, "stiffness", ""), (np.diag([0.0, -1.0]), "stiffness", "mu")]
    (onset,) = st.onsets(matrix_case(tmp_path, terms, 1.0, (0.0, 2.0))).onsets
    assert (onset.kind, onset.mu, onset.frequency_hz) == ("divergence", pytest.approx(1.5, rel=1e-12), 0.0)
    assert onset.square_root_coefficient == pytest.approx(math.sqrt(2 / 2.5), rel=1e-9)
    damped = [*terms, (0.1 * ONE, "damping", "")]
    (onset,) = st.onsets(matrix_case(tmp_path, damped, 1.0, (0.0, 2.0))).onsets
    assert (onset.kind, onset.mu, onset.frequency_hz) == ("divergence", pytest.approx(1.5, rel=1e-12), 0.0)
    assert onset.growth_slope == pytest.approx(2 / (0.1 * 2.5), rel=1e-9)


@pytest.mark.parametrize("middle", [0.23, *(pytest.param(m, marks=pytest.mark.slow) for m in (0.41, 0.47, 0.62, 0.79))])
def test_growth_that_begins_and_ends_within_a_step(tmp_path: Path, middle: float):
    # Growth that begins and ends again within less than a twentieth of the range, far from everything else.
    terms = [
        (np.eye(2), "mass", ""), (np.diag([1.0, 4.0]), "stiffness", ""), (0.02 * np.eye(2), "damping", ""),
        (np.diag([-0.05, 0.0]), "damping", f"exp(-((mu - {middle})/0.02)**2)"), (0.01 * TURN, "stiffness", "sqrt(mu)"),
    ]  # fmt: skip
    found = st.onsets(matrix_case(tmp_path, terms, 1.0))
    half = 0.02 * math.sqrt(math.log(0.05 / 0.02))
    assert [o.mu for o in found.onsets] == pytest.approx([middle - half, middle + half], abs=1e-4)
    assert [o.stabilising for o in found.onsets] == [False, True]


def test_factors_of_any_kind(tmp_path: Path):
    for factor, between, mu in (
        ("exp(mu)-1", (0.0, 1.0), math.log(1.75)),
        ("mu**3", (0.0, 1.0), 0.75 ** (1 / 3)),
        # No polynomial, so by full solves: no slope at 0; no value at 0, so that following begins at 0.1.
        ("sqrt(mu)", (0.0, 1.0), 0.5625),
        ("0.3/mu", (0.1, 1.0), 0.4),
    ):
        found = st.onsets(matrix_case(tmp_path, minimal(factor=factor), 1.0, between))
        assert [o.mu for o in found.onsets] == pytest.approx([mu], rel=1e-11), factor
        assert found.onsets[0].stabilising == (factor == "0.3/mu")
        assert found.completeness.startswith("Complete")
        assert ("solved in full at every step" in found.completeness) == (factor in ("sqrt(mu)", "0.3/mu"))


def test_a_mass_that_friction_changes(tmp_path: Path):
    """(2 − s)² = 1 − 4μs/3 for s = ω² has a double root where (4 − 4μ/3)² = 12."""
    terms = [(ONE, "mass", ""), (-BELT, "mass", "mu"), (OBLIQUE, "stiffness", "")]
    (onset,) = st.onsets(matrix_case(tmp_path, terms, 1.0)).onsets
    assert onset.mu == pytest.approx(0.75 * (4 - math.sqrt(12)), rel=1e-11)
    assert (2 * np.pi * onset.frequency_hz) ** 2 == pytest.approx(math.sqrt(3), rel=1e-11)


def test_modes_that_nothing_damps_beside_one_that_is_damped(tmp_path: Path):
    terms = [
        (np.eye(3), "mass", ""),
        (np.diag([0.0, 0.0, 0.1]), "damping", ""),
        (sl.block_diag(OBLIQUE, 9.0), "stiffness", ""),
        (sl.block_diag(BELT, 0.0), "stiffness", "mu"),
    ]
    (onset,) = st.onsets(matrix_case(tmp_path, terms, 1.0)).onsets
    assert onset.mu == pytest.approx(0.75, rel=1e-11)
    assert onset.square_root_coefficient == pytest.approx(math.sqrt(4 / 3) / (2 * math.sqrt(2)), rel=1e-8)


@pytest.mark.parametrize("damping", [0.0, 0.02])
def test_freedoms_without_mass_multipliers_and_free_bodies(tmp_path: Path, damping: float):
    """None of them changes the onset: a spring through a massless freedom, half of the mass behind a multiplier, and a
    free body of two masses, whose motion as a whole is the first mode."""
    expected = st.onsets(matrix_case(tmp_path, minimal(damping * ONE), 1.0)).onsets[0]
    massless = np.array([[2.0, 1.0, 0.0], [1.0, 4.0, -2.0], [0.0, -2.0, 2.0]])
    multiplied = np.zeros((4, 4))
    multiplied[:2, :2] = OBLIQUE
    multiplied[3, 1:3] = multiplied[1:3, 3] = 1.0, -1.0
    pair = 0.7 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    zoo = {
        "massless": (np.diag([1.0, 1.0, 0.0]), np.diag([1.0, 1.0, 0.0]), massless, 1),
        "multiplier": (np.diag([1.0, 0.5, 0.5, 0.0]), np.diag([1.0, 0.5, 0.5, 0.0]), multiplied, 1),
        "free": (np.eye(4), sl.block_diag(ONE, pair), sl.block_diag(OBLIQUE, pair), 2),
    }
    for mass, dashpots, stiffness, first in zoo.values():
        friction = np.zeros_like(mass)
        friction[:2, :2] = BELT
        terms = [
            (mass, "mass", ""), (damping * dashpots, "damping", ""), (stiffness, "stiffness", ""), (friction, "stiffness", "mu")
        ]  # fmt: skip
        found = st.onsets(matrix_case(tmp_path, terms, 1.0))
        (onset,) = found.onsets
        assert onset.mu == pytest.approx(expected.mu, rel=1e-11)
        assert onset.frequency_hz == pytest.approx(expected.frequency_hz, rel=1e-11)
        assert onset.branches[0] == first
        assert found.completeness.startswith("Complete")


def test_an_eigenvalue_that_passes_through_infinity(tmp_path: Path):
    """A freedom without mass whose stiffness 120 − 100 μ passes zero at 1.2: from there on the other has the negative
    stiffness 40 − 54 (54 − 50 μ)/(120 − 100 μ), without bounds at first and until 13 μ = 18.84. Of a low band nothing
    is left before."""
    mass, stiffness = np.diag([0.0, 1.0]), np.array([[120.0, 54.0], [54.0, 40.0]])
    friction = np.array([[-100.0, -50.0], [0.0, 0.0]])
    terms = [(mass, "mass", ""), (stiffness, "stiffness", ""), (friction, "stiffness", "mu")]
    for top in (10.0, 100.0):
        found = st.onsets(matrix_case(tmp_path, terms, top), (0.0, 1.5))
        (onset,) = found.onsets
        assert onset.stabilising
        assert onset.mu == pytest.approx(18.84 / 13, rel=1e-11)
        assert found.completeness.startswith("Not complete")


def test_libraries_have_nothing_to_warn_of(tmp_path: Path):
    """Real eigenvalues alone, of which some are sharpened one by one in complex arithmetic."""
    stiffness = np.zeros((3, 3))
    stiffness[0, 1] = -2e4
    terms = [(np.diag([2.0, 3.0, 2.0]), "mass", ""), (0.1 * np.eye(3), "damping", ""), (stiffness, "stiffness", "mu")]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = st.modes(matrix_case(tmp_path, terms, 100.0), 0.3)
        assert not st.onsets(matrix_case(tmp_path, terms, 100.0)).onsets
    rates = np.sort(found.eigenvalues[0].real)
    assert rates[:3] == pytest.approx([-0.05, -0.05, -0.1 / 3], rel=1e-9)


# -- meshed models on a way round ----------------------------------------------------------------------------------------
def assert_same_onsets(structured: st.Onsets, imported: st.Onsets) -> None:
    assert structured.onsets
    assert len(imported.onsets) == len(structured.onsets)
    for one, other in zip(structured.onsets, imported.onsets, strict=True):
        assert other.mu == pytest.approx(one.mu, abs=1e-9)
        assert other.frequency_hz == pytest.approx(one.frequency_hz, rel=1e-9)
        assert (other.kind, other.stabilising, other.branches) == (one.kind, one.stabilising, one.branches)
        assert other.residual < 1e-10
        assert (other.growth_slope is None) == (one.growth_slope is None) or one.damped
        if one.growth_slope is not None:
            assert other.growth_slope == pytest.approx(one.growth_slope, rel=1e-7)
        if one.square_root_coefficient is not None:
            assert other.square_root_coefficient == pytest.approx(one.square_root_coefficient, rel=1e-5)
        if one.exceptional_mu is not None:
            assert other.exceptional_mu == pytest.approx(one.exceptional_mu, abs=1e-7)
    assert imported.completeness.startswith("Complete as far as both ends tell")
    # `onsets` of a system says nothing; that of a case has looked at both ends.
    assert structured.completeness == "" or structured.completeness.startswith("Checked at both ends: ")


@pytest.mark.slow  # in each run: `test_the_bench_as_solids` and, undamped, `test_undamped_meetings_beside_damping_elsewhere`
@pytest.mark.parametrize("damped", [True, False])
def test_the_published_bench(tmp_path: Path, damped: bool):
    bench = paper_case(bodies__beam1__elements=10, bodies__beam2__elements=30)
    assert_same_onsets(st.onsets(bench, damped=damped), st.onsets(export(tmp_path, bench), damped=damped))


@pytest.mark.parametrize("damped", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_the_bench_as_solids(tmp_path: Path, damped: bool, monkeypatch: pytest.MonkeyPatch):
    """A stiff guide leaves 1e-10 of λ to rounding; with g summed more precisely Newton is there in a few steps of the
    full problem all the same."""
    steps = []
    once = Border.at

    def counted(self: Border, lam: complex, mu: float):
        if isinstance(self.problem, Family):
            steps.append(mu)
        return once(self, lam, mu)

    monkeypatch.setattr(Border, "at", counted)
    bench = case(bench_as_solids(across=(1, 1), along=(6, 12)))
    found = st.onsets(export(tmp_path, bench), damped=damped)
    assert_same_onsets(st.onsets(bench, damped=damped), found)
    # Two or three to where rounding begins, and one or two more until it shows that it is that.
    assert len(steps) <= 5 * len(found.onsets)


def held(block: st.Case, damped: bool = True) -> st.Onsets:
    """Onsets with the nodes that touch at the case's own friction, as matrices that were exported have them."""
    found = onsets(
        build_system(block), block.modal.friction_range, max_frequency_hz=block.modal.max_frequency_hz, damped=damped
    )
    return checked_onsets(build_system(block), found, damped=damped)


def test_a_surface_with_contact_springs(tmp_path: Path):
    block = case(slider(space=False, stiffness=1e12)).with_(
        {"bodies.block.mesh.divisions": [6, 3], "bodies.slider.mesh.divisions": [9, 2]}
    )
    assert_same_onsets(held(block), st.onsets(export(tmp_path, block)))


def test_friction_the_other_way_is_another_problem(tmp_path: Path):
    """The pin leans: dragged along it squeals at other μ than pushed against. Nothing here is symmetric by accident."""
    bench = case(bench_as_solids(across=(1, 1), along=(6, 12)))
    terms = exported(bench)
    wrong = [*terms[:3], (-terms[3][0], "stiffness", "mu")]
    right, other = st.onsets(bench), st.onsets(matrix_case(tmp_path, wrong, bench.modal.max_frequency_hz))
    assert other.completeness.startswith("Complete")
    assert all(abs(o.mu - r.mu) > 1e-2 for o in other.onsets for r in right.onsets)


@pytest.mark.parametrize(
    ("stiffness", "damped"),
    [
        (1e12, False),
        *(pytest.param(*p, marks=pytest.mark.slow) for p in ((1e12, True), ("rigid", True), ("rigid", False))),
    ],
)
def test_contact_that_stridor_makes_of_imported_surfaces(tmp_path: Path, stiffness: float | str, damped: bool):
    """Friction of the contact and a factor with mu in one: that is too small to matter. Where damping is the same all
    over and contact rigid, modes meet exactly, and which is which beyond is a matter of taste that both share."""
    change = {"contacts.face.stiffness": stiffness, "bodies.slider.mesh.divisions": [10, 1]}
    meshed, imported = st.loads(MESHED).with_(change), rubbing(tmp_path, 0.1).with_(change)
    assert not build_system(imported, 0.4).symmetric_definite
    assert_same_onsets(held(meshed, damped), st.onsets(imported, damped=damped))


def test_undamped_meetings_beside_damping_elsewhere(tmp_path: Path):
    """The undamped bench and a damped oscillator that does not touch it are one damped problem."""
    bench = paper_case(bodies__beam1__elements=6, bodies__beam2__elements=18)
    n = build_system(bench).size
    mass, _, stiffness, friction = (t[0] for t in exported(bench))
    terms = [
        (sp.block_diag([mass, [[1e-3]]]), "mass", ""),
        (sp.block_diag([sp.csr_array((n, n)), [[1.0]]]), "damping", ""),
        (sp.block_diag([stiffness, [[1e6]]]), "stiffness", ""),
        (sp.block_diag([friction, [[0.0]]]), "stiffness", "mu"),
    ]
    found = st.onsets(matrix_case(tmp_path, terms, bench.modal.max_frequency_hz))
    expected = st.onsets(bench, damped=False)
    assert expected.onsets
    assert [o.mu for o in found.onsets] == pytest.approx([o.mu for o in expected.onsets], abs=1e-9)
    assert [o.frequency_hz for o in found.onsets] == pytest.approx([o.frequency_hz for o in expected.onsets], rel=1e-9)
    assert found.completeness.startswith("Complete")


def test_full_solves_where_no_reduced_model_can_be_made(tmp_path: Path):
    """Two freedoms of the bench tied to two others, by multipliers and by leaving them out."""
    terms = exported(case(bench_as_solids(across=(1, 1), along=(6, 12))))
    n, ties = terms[0][0].shape[0], ((40, 60), (41, 61))
    rows = sp.lil_array((2, n))
    for k, (i, j) in enumerate(ties):
        rows[k, i], rows[k, j] = 1.0, -1.0
    unit, empty = abs(terms[2][0]).max(), sp.csr_array((2, 2))
    held = [(sp.block_diag([m, empty]), role, factor) for m, role, factor in terms]
    held[2] = (sp.block_array([[terms[2][0], unit * rows.T], [unit * rows, None]]), "stiffness", "")
    kept = np.setdiff1d(np.arange(n), [j for _, j in ties])
    follow = sp.lil_array((n, len(kept)))
    follow[kept, np.arange(len(kept))] = 1.0
    for i, j in ties:
        follow[j, int(np.searchsorted(kept, i))] = 1.0
    follow = sp.csr_array(follow)
    fewer = [(follow.T @ m @ follow, role, factor) for m, role, factor in terms]
    one, other = (st.onsets(matrix_case(tmp_path, t, 8e3), damped=False) for t in (fewer, held))
    assert "on a reduced model of" in one.completeness
    assert "solved in full at every step" in other.completeness
    assert_same_onsets(replace(one, completeness=""), other)


# -- what is behind the calls ----------------------------------------------------------------------------------------------
def test_systems_by_hand_take_the_same_way(tmp_path: Path):
    """`onsets` and `complex_modes` of a system whose matrices are general: contact springs give it its μ."""
    block = case(slider(space=False, stiffness=1e12)).with_({"modal.max_frequency_hz": 12e3})
    system = build_system(block)
    marked = replace(system, not_symmetric_definite="taken for such")
    expected, found = (onsets(s, (0.0, 1.0), max_frequency_hz=12e3) for s in (system, marked))
    assert_same_onsets(expected, found)
    assert not expected.completeness
    mus = [0.2, 0.5]
    ours = complex_modes(system, mus, max_frequency_hz=12e3)
    theirs = complex_modes(marked, mus, max_frequency_hz=12e3)
    assert theirs.eigenvalues == pytest.approx(ours.eigenvalues, rel=1e-8)
    with pytest.raises(st.CaseError, match=r"max_frequency_hz: missing – taken for such: modes are sought in a band"):
        complex_modes(marked, mus)


def test_an_onset_that_gets_lost_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """What branches lose is enclosed by counting; what Newton does not find then is told, with where it is."""
    model = matrix_case(tmp_path, minimal(), 1.0)
    with monkeypatch.context() as patch:
        patch.setattr(full.branches, "located", lambda *_: None)
        found = st.onsets(model)
        assert [o.mu for o in found.onsets] == pytest.approx([0.75], rel=1e-12)
        assert found.onsets[0].branches == (0, 0)
        assert found.completeness.startswith("As many roots grow at each of 97 values of μ as the onsets say: 0 modes grow")
        patch.setattr(full.counted._Search, "_solved", lambda *_: None)
        found = st.onsets(model)
    assert not found.onsets
    assert not found.complete
    assert found.completeness == (
        "Not complete: 0 modes grow at μ = 0 and 1 at μ = 1, found in the full problem, but between μ = 0.75 and 0.760417 "
        "the number of growing roots changes by +2, and by the onsets by 0."
    )
    assert st.onsets(model).completeness.startswith("Complete")
    document = st.onsets(model).to_json()
    assert document["completeness"].startswith("Complete")
    assert document["onsets"][0]["mu"] == pytest.approx(0.75)


def test_many_modes_that_begin_to_grow_at_the_low_end_by_a_factor_that_is_no_polynomial(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """λ² − 2d sin(3μ) λ + ω² = 0: every mode grows from μ = 0 on with the slope 3d, and ends to at μ = π/3. Modes that are
    equally damped are seen to grow at one value, a little above 0, and some slower ones later."""
    squares, d = np.array([1.0, 2.2, 3.7, 5.1, 6.4]), np.array([0.1, 0.1, 0.1, 0.1, 0.001])
    driven = -2 * np.diag(d * np.sqrt(squares))
    terms = [(np.eye(5), "mass", ""), (np.diag(squares), "stiffness", ""), (driven, "damping", "sin(3*mu)")]

    def refused(*_):
        raise st.AnalysisError("branches are not followed here")

    monkeypatch.setattr(full.search, "solved", refused)
    found = st.onsets(matrix_case(tmp_path, terms, 1.0, (0.0, 1.2)))
    begins = [o for o in found.onsets if not o.stabilising]
    assert [o.mu for o in begins] == [0.0] * 5
    assert [o.frequency_hz for o in begins] == pytest.approx(np.sqrt(squares) / (2 * np.pi), rel=1e-9)
    assert [o.growth_slope for o in begins] == pytest.approx(3 * d * np.sqrt(squares), rel=1e-6)
    assert [o.mu for o in found.onsets if o.stabilising] == pytest.approx([np.pi / 3] * 5, rel=1e-9)
    assert found.complete, found.completeness


def test_growth_that_passes_the_end_of_the_band_and_comes_back_is_not_said_to_go_on_above_it():
    """A growing pair leaves the band, and one real root comes into it: what was counted there accounts for the ends."""
    family = Smooth((0.0, 1.0), lambda mu: Quadratic(*(sp.csr_array(a * ONE) for a in (1, -0.1, 1))))
    first, last = (SimpleNamespace(values=np.array(v)) for v in ([0.1 + 0.9j], [0.7 + 0j]))
    passing = Passing(0.4, 0.1 + 1j, -2), Passing(0.6, 1 + 0j, 1)
    seen = Counted(((0.0, 2), (1.0, 1)), (), passing)
    answer = Answer((), True, None, seen)
    assert words._across(family, answer, (first, last), 1.0) == " with those that pass 0.159155 Hz while they grow"
    unseen = words._across(family, Answer((), True), (first, last), 1.0)
    assert unseen == " but for 1 that went on growing above 0.159155 Hz"


@pytest.mark.parametrize("followed", [True, False])
@pytest.mark.parametrize("works_on", ["every motion", "vibration", "nothing"])
def test_divergence_beside_the_zero_of_a_free_body(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, works_on: str, followed: bool
):
    """Two masses that move as a whole, K(μ)(1, 1)ᵀ = 0, and of whose difference z'' + cz' + (2 − 2μ)z = 0: it diverges
    from μ = 1 on, where λ = 0 is a root of the body at every μ."""
    c = {"every motion": 0.03, "vibration": 0.08, "nothing": 0.0}[works_on]
    pair = np.array([[1.0, -1.0], [-1.0, 1.0]])
    damping = {"every motion": c * ONE, "vibration": 0.5 * c * pair, "nothing": None}[works_on]
    terms = [(ONE, "mass", ""), (pair, "stiffness", ""), (np.array([[0.0, 0.0], [2.0, -2.0]]), "stiffness", "mu")]
    if damping is not None:
        terms.append((damping, "damping", ""))

    def refused(*_):
        raise st.AnalysisError("branches are not followed here")

    if not followed:
        monkeypatch.setattr(full.search, "solved", refused)
    found = st.onsets(matrix_case(tmp_path, terms, 1.0, (0.0, 1.7)))
    assert [(o.kind, o.stabilising) for o in found.onsets] == [("divergence", False)]
    (onset,) = found.onsets
    assert onset.mu == pytest.approx(1.0, rel=1e-11)
    if c:
        assert onset.growth_slope == pytest.approx(2 / c, rel=1e-6)
    else:
        assert onset.square_root_coefficient == pytest.approx(np.sqrt(2), rel=1e-6)
    assert found.complete, found.completeness


@pytest.mark.parametrize("off", [1e-6, 1e-9, 1e-12])
def test_the_slope_of_divergence_beside_a_free_body_from_a_guess_close_by(off: float):
    """The same two masses: λ = (2μ − 2)/c to first order, however near to μ = 1 the guess is."""
    c, pair, drive = 0.03, np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array([[0.0, 0.0], [2.0, -2.0]])

    def at(mu: float) -> Quadratic:
        return Quadratic(*(sp.csr_array(m) for m in (ONE, c * ONE, pair + mu * drive)))

    x, y = np.array([1.0, 1.0 + 1e-9], dtype=complex), np.array([1.0, -1.0], dtype=complex)
    between = 1 - 3 * off, 1 + 3 * off
    root = standstill(Family((0.0, 1.7), at, Options()), 1 + off, x, y, between)
    assert root is not None
    assert root.mu == pytest.approx(1.0, rel=1e-12)
    assert root.slope == pytest.approx(2 / c, rel=1e-6)


@pytest.mark.parametrize("damping", [0.0, 4e-4])
def test_growth_between_two_values_that_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, damping: float):
    """λ² + cλ = −2 ± √(d² − q²) with d = μ − 0.5052: two modes meet and part within 2q, or growth of the one that c
    leaves lasts as long as q² − d² is more than 2c². The nearest values that are counted lie 1/96 apart, beside it."""
    apart, middle = 2e-3, 48.5 / 96
    terms = [
        (ONE, "mass", ""), (np.array([[2.0 - middle, apart], [-apart, 2.0 + middle]]), "stiffness", ""),
        (np.diag([1.0, -1.0]), "stiffness", "mu"), *([(damping * ONE, "damping", "")] if damping else []),
    ]  # fmt: skip

    def refused(*_):
        raise st.AnalysisError("branches are not followed here")

    monkeypatch.setattr(full.search, "solved", refused)
    found = st.onsets(matrix_case(tmp_path, terms, 1.0))
    assert "branches are not followed here" in found.completeness
    half = math.sqrt(apart**2 - 2 * damping**2)
    assert half < 0.5 / 96
    np.testing.assert_allclose([o.mu for o in found.onsets], [middle - half, middle + half], rtol=0, atol=1e-11)
    assert [o.roots for o in found.onsets] == [2, -2]


def test_what_turning_beams_leaves_of_symmetry_is_not_gyroscopic():
    """Without damping onsets are where modes meet, whatever rounding has put into D; what is gyroscopic stays."""
    system = bench()
    turning = sp.csr_array(([1.0, -1.0], ([0, 1], [1, 0])), shape=system.damping.shape)

    def family(skew: float):
        turned = replace(system, damping=sp.csr_array(system.damping + skew * turning))
        return family_of(lambda _: turned, (0.0, 1.0), Options(), damped=False, own=0.0)

    rounding = family(1e-17 * float(np.abs(system.damping[:2, :2].data).max()))
    assert rounding.still
    assert rounding.reversible
    assert abs(family(1e-3).built(0.5).damping - 1e-3 * turning)[:2, :2].max() < 1e-15


def test_growth_that_comes_into_the_band_from_above_is_told(tmp_path: Path):
    """Two modes meet at 23 213 Hz, and the one that grows has sunk to 23 096 Hz at μ = 0.6."""
    case_ = rubbing(tmp_path, 0.1)
    found = st.onsets(case_, (0.0, 0.6), max_frequency_hz=23.15e3)
    (onset,) = found.onsets
    assert onset.frequency_hz == pytest.approx(23213, abs=1)
    assert onset.enters_at is not None
    assert onset.mu < onset.enters_at < 0.6
    # The same touching nodes: those of several μ are found at the laws' own.
    near = st.modes(case_, [onset.enters_at - 0.02, onset.enters_at + 0.02], max_frequency_hz=23.15e3)
    assert np.sum(near.unstable & near.in_band, axis=1).tolist() == [0, 1]
    (line,) = found.from_above_words
    assert "Hz, above the band up to 23150 Hz, and enters it at μ ≈ 0.23" in line
    assert "1 at μ = 0.6, as the onsets say." in found.completeness


def test_terms_that_cancel_are_summed_in_extended_precision():
    """yᵀ(λ²M + λD + K + μF)x against fractions, where it is 1e-13 of its terms."""
    if not np.finfo(np.longdouble).eps < 1e-18:
        pytest.skip("this processor knows double precision only")
    rng = np.random.default_rng(2)
    mass, damping, stiffness, friction = rng.standard_normal((4, 3, 3))
    x, y = rng.standard_normal((2, 3)) + 1j * rng.standard_normal((2, 3))
    lam, mu = 0.3 + 0.7j, 0.37
    rest = y @ (lam**2 * mass + lam * damping + stiffness + mu * friction) @ x
    stiffness[0, 0] -= (rest / (y[0] * x[0])).real  # what is left is the imaginary part
    family = Smooth((0.0, 1.0), lambda m: Quadratic(*(sp.csr_array(a) for a in (mass, damping, stiffness + m * friction))))
    assert family.exact

    def exact(value: complex) -> tuple[Fraction, Fraction]:
        return Fraction(value.real), Fraction(value.imag)

    def times(a: tuple[Fraction, Fraction], b: tuple[Fraction, Fraction]) -> tuple[Fraction, Fraction]:
        return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]

    total = [Fraction(0), Fraction(0)]
    form = family.form
    assert form is not None
    for role, power in (("mass", 2), ("damping", 1), ("stiffness", 0)):
        for k, matrix in enumerate(form[role].matrices):
            factor = Fraction(1)
            for node in form[role].nodes[:k]:
                factor *= Fraction(mu) - Fraction(node)
            for i, j in np.ndindex(3, 3):
                part = times(times(exact(y[i]), exact(x[j])), (factor * Fraction(float(matrix[i, j])), Fraction(0)))
                for _ in range(power):
                    part = times(part, exact(lam))
                total = [t + p for t, p in zip(total, part, strict=True)]
    found = family.functional(lam, mu, y, x)
    assert abs(found - complex(float(total[0]), float(total[1]))) < 1e-18 * 50
