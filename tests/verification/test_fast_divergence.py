"""Motions that diverge faster than anything oscillates in the band, against dense eigenvalues and closed forms."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.optimize as so
import scipy.sparse as sp

import stridor as st
from stridor.case import template_text
from stridor.modal.quadratic import Quadratic, band_modes, is_stiff

pytestmark = pytest.mark.verification

SPRING = '''
[springs.drive]
between = ["beam1.tip", "ground"]
stiffness = {}
direction = [1.0, 0.0]
'''


def bench(stiffness: float, *, across: bool = False) -> st.Case:
    """The two beams, coarse, with a spring that drives (or holds) a tip."""
    text = template_text("two-beams") + SPRING.format(stiffness)
    if across:
        text = text.replace("beam1.tip\", \"ground", "beam2.end\", \"ground")
    return st.loads(text).with_({"bodies.beam1.elements": 6, "bodies.beam2.elements": 14})


def dense_divergence(system: st.System) -> np.ndarray:
    """Positive real eigenvalues at μ = 0, where the contact is a spring along its normal."""
    mass, damping, stiffness = (m.toarray() for m in (system.mass, system.damping, system.stiffness))
    row = system.contact_rows()[0]
    stiffness = stiffness + np.outer(row, row) / system.contacts[0].compliance
    n, unit = len(mass), 1e5
    inverse = np.linalg.inv(mass)
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness / unit**2, -inverse @ damping / unit]])
    values = sl.eigvals(state) * unit
    return np.sort(values[(values.real > 1.0) & (np.abs(values.imag) < 1e-6 * np.abs(values))].real)


# At -1e7 growth passes the end of the band (2π 40 kHz = 2.5e5 1/s) on the way to μ = 1; at -1e8 it is beyond at once.
@pytest.mark.parametrize("stiffness", [-1e7, pytest.param(-1e8, marks=pytest.mark.slow)])
def test_divergence_beyond_the_band_is_told_and_the_onsets_are_complete(stiffness: float):
    case = bench(stiffness)
    dense = dense_divergence(st.build_system(case))
    found = st.onsets(case)
    told = [lam.real for lam in found.at_start if lam.imag == 0.0]
    assert told == pytest.approx(dense, rel=1e-6)
    assert found.completeness.startswith("Complete"), found.completeness
    begun = sum(-1 if o.stabilising else 1 for o in found.onsets)
    assert len(found.at_end) == len(found.at_start) + begun
    assert any(lam.real > 2 * np.pi * 40e3 for lam in found.at_end)


@pytest.mark.parametrize("stiffness", [1e6, pytest.param(-1e7, marks=pytest.mark.slow)])
def test_a_spring_along_a_beam_leaves_motions_that_no_contact_presses(stiffness: float):
    """Its damping is not proportional, and what moves along the beam alone has its own poles at every μ."""
    case = bench(stiffness, across=True)
    found = st.onsets(case)
    assert found.completeness.startswith(("Complete", "Checked")), found.completeness
    modes = st.modes(case, [0.0, 0.2])
    # A rod with one end held and a spring at the other: q cos q + (k L / EA) sin q = 0.
    area, length, speed = 0.015 * 0.003, 0.15, np.sqrt(200e9 / 7800.0)
    part = stiffness * length / (200e9 * area)
    q = lowest_of_rod(part)
    assert np.abs(modes.frequency_hz[0] - q * speed / (2 * np.pi * length)).min() < 3e-3 * q * speed / length


def lowest_of_rod(part: float) -> float:
    """The lowest q with q cos q + part sin q = 0."""
    return float(so.brentq(lambda q: q * np.cos(q) + part * np.sin(q), 1e-3, np.pi - 1e-9))


def chain(drive: float, n: int = 64) -> Quadratic:
    """Unit masses in a row of unit springs, the last one driven by a negative one."""
    stiffness = sp.lil_array(sp.diags_array([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1]))
    stiffness[n - 1, n - 1] -= drive
    return Quadratic(sp.csr_array(sp.eye_array(n)), sp.csr_array((n, n)), sp.csr_array(stiffness))


@pytest.mark.parametrize("drive", [0.5, 300.0, 5000.0])
def test_the_band_holds_what_diverges_at_any_rate(drive: float):
    problem = chain(drive)
    hz = 1.3 / (2 * np.pi)
    dense = np.linalg.eigvalsh(problem.stiffness.toarray())
    exact = np.sqrt(-dense[dense < 0])
    found = band_modes(problem, hz, above=-0.1, stands=partial(is_stiff, problem))
    growing = found.values[(found.values.imag == 0) & (found.values.real > 1e-6)].real
    assert growing == pytest.approx(np.sort(exact), rel=1e-8)
    assert len(found.values) == np.count_nonzero((dense > 0) & (dense < 1.3**2)) + len(exact)
    assert is_stiff(problem, 1.01 * exact.max(initial=0.1))
    assert not len(exact) or not is_stiff(problem, 0.99 * exact.max())


# -- what the other verbs say of it ------------------------------------------------------------------------------------
FAST = {"bodies.beam1.elements": 6, "bodies.beam2.elements": 18, "temporal.step": 2e-7, "modal.max_frequency_hz": 20e3}
FAST["modal.friction_range"] = [0.0, 0.3]


@pytest.fixture(scope="module")
def diverging() -> st.Case:
    shorter = {"phases.press.duration": 6e-3, "phases.slide.duration": 2e-4, "temporal.record_every": 5}
    return bench(-1e7).with_(FAST | shorter)


@pytest.mark.filterwarnings("error")
def test_a_comparison_says_that_nothing_vibrates_about_what_diverges(diverging: st.Case):
    rate = dense_divergence(st.build_system(diverging))[0]
    result = st.compare(diverging, [0.0], critical=False)
    (found,) = result.comparisons
    assert found.modal_eigenvalue == pytest.approx(rate, rel=1e-5)
    assert (found.agrees, result.agree) == (None, None)
    assert "the motion diverges without oscillating, at " in result.verdict
    assert "no full run: the motion is no longer finite" in result.verdict
    assert "a negative stiffness drives it" in result.verdict
    critical = st.compare(diverging, only=["critical"])
    assert critical.agree is None
    assert any(note.startswith("diverges already at μ = 0: λ = +1") for note in critical.notes), critical.notes


@pytest.mark.filterwarnings("error")
def test_sensitivities_of_divergence_are_its_slopes(diverging: st.Case):
    path = "springs.drive.stiffness"
    found = st.sensitivities(diverging, [path, "mu"], mu=0.1)
    assert found.frequency_hz.tolist() == [0.0]
    values = [st.modes(diverging.with_({path: -1e7 + d}), 0.1).eigenvalues for d in (-1e3, 1e3)]
    far, near = (float(v.real[v.imag == 0].max()) for v in values)
    assert found.of(path)[0].real == pytest.approx((near - far) / 2e3, rel=1e-4)
