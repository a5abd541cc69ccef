"""Both approaches against each other, and the tools that compare them against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stridor as st
from mode_coupling import mode_coupling
from stridor.agreement import Perturbation, critical_friction, linear_part, modal_assurance, perturb
from stridor.agreement.result import judge
from stridor.case import template_text
from stridor.modal.complex_modes import complex_modes
from stridor.modal.onsets import onsets
from stridor.study.analyses import settings_of
from stridor.temporal.growth import growth
from stridor.temporal.signals import Components, components, envelope, spectrogram, spectrum
from stridor.view.temporal_tables import agreement_table

pytestmark = pytest.mark.verification


@pytest.fixture(scope="module")
def case() -> st.Case:
    """The bench on coarse meshes: half a second where the shipped one takes five."""
    return st.loads(template_text("two-beams")).with_(
        {
            "bodies.beam1.elements": 10,
            "bodies.beam2.elements": 30,
            "contacts.A.stiffness": "rigid",
            "temporal.step": 1.5e-7,
        }
    )


@pytest.mark.parametrize("mu", [0.05, 0.1, 0.14])
def test_every_mode_seen_in_time_is_a_complex_mode(case: st.Case, mu: float) -> None:
    system = st.build_system(case)
    seen = perturb(system, mu, settings=settings_of(case), max_frequency_hz=20e3)
    lam = complex_modes(system, mu, max_frequency_hz=22e3).eigenvalues[0]
    strong = seen.components.amplitudes > 0.05 * seen.components.amplitudes[0]
    assert strong.sum() >= 4
    for found in seen.components.eigenvalues[strong]:
        nearest = lam[np.argmin(np.abs(lam - found))]
        # To the accuracy of the scheme, (ωΔt)²/24, and to what a signal of some 30 ms tells of a weak component,
        # whose last digits also depend on the processor's rounding.
        assert abs(found.imag - nearest.imag) < 8.0 + 3e-4 * abs(nearest)
        assert abs(found.real - nearest.real) < 5.0 + 5e-4 * abs(nearest)
    fastest = lam[np.argmax(lam.real)]
    assert seen.grows == (fastest.real > 0)
    if seen.grows:
        assert seen.growth_rate == pytest.approx(fastest.real, rel=0.01)


@pytest.mark.parametrize("stepper", ["exact", "implicit"])
@pytest.mark.parametrize("damping", [pytest.param(0.0, marks=pytest.mark.slow), 0.1, pytest.param(0.5, marks=pytest.mark.slow)])
def test_decay_in_time_is_that_of_a_mode(damping: float, stepper: str) -> None:
    """Motion dies away to rounding, or to what implicit contact is solved to, long before the march ends: what is left
    is no vibration. Dashpots c at 45° both ways damp the minimal model by c in all directions: Re λ = −c/2."""
    steps = {"temporal.stepper": "implicit", "temporal.step": 5e-3, "temporal.record_every": 2}
    case = mode_coupling(damping, 0.1).with_(steps if stepper == "implicit" else {})
    (compared,) = st.compare(case, [0.6], critical=False, only=["growth"]).comparisons
    assert compared.agrees is True
    assert compared.perturbation.growth_rate == pytest.approx(-damping / 2, rel=1e-3, abs=1e-7)
    assert compared.frequency_error < 1e-4


def test_the_table_of_a_report_holds_decay_to_what_the_verdict_does() -> None:
    case = mode_coupling(0.1, 0.1)
    (found,) = st.compare(case, [0.6], critical=False, only=["growth"]).comparisons
    for share, kind in ((0.9, "good"), (0.7, "bad")):
        seen = replace(found.perturbation, eigenvalue=complex(share * found.modal_eigenvalue.real, found.modal_eigenvalue.imag))
        assert agreement_table(replace(found, perturbation=seen)).rows[2].kind == kind


def test_what_is_left_of_a_signal_that_died_is_cut_and_growth_from_nothing_is_not() -> None:
    time = np.linspace(0.0, 100.0, 4001)
    noise = 1e-8 * np.cos(0.7 * time)
    decays = np.exp(-time) * np.cos(9.0 * time) + noise
    steady = np.array([1e3])
    assert time[len(linear_part(decays[:, None], steady))] == pytest.approx(np.log(1e5), abs=0.4)
    grows = decays + 1e-6 * np.exp(0.1 * time) * np.cos(5.0 * time)
    assert len(linear_part(grows[:, None], steady)) == len(time)


def test_a_decay_that_is_no_mode_s_is_not_agreed() -> None:
    nothing = Components(np.zeros(0, dtype=complex), np.zeros(0))

    def said(seen: complex, mode: complex) -> tuple[bool | None, str]:
        rate = abs(seen.real - mode.real) / max(abs(mode.real), 1e-300)
        perturbation = Perturbation(0.6, seen, np.zeros(0), 1.0, nothing)
        return judge(0.6, unstable=mode.real > 0, here=mode, perturbation=perturbation,
                     frequency=abs(seen.imag / mode.imag - 1.0), rate=rate)  # fmt: skip

    agrees, why = said(-0.002 + 1.8j, -0.05 + 1.56j)
    assert agrees is None
    assert "none of the modes" in why
    # A mode beyond the band may grow where those of the band are stable.
    assert judge(0.6, False, 2.0 + 30.0j, Perturbation(0.6, 2.0 + 30.0j, np.zeros(0), 1.0, nothing), 0.0, 0.0)[0] is False
    assert said(0.024 + 0.29j, -0.05 + 1.1j)[0] is False
    assert said(-0.045 + 1.1j, -0.05 + 1.1j)[0] is True
    assert said(-0.035 + 1.1j, -0.05 + 1.1j)[0] is None
    assert said(0.045 + 1.1j, 0.05 + 1.1j)[0] is False
    assert said(1e-9 + 1.1j, 1.1j) == (True, "μ = 0.6: both stable (in time it neither grows nor decays)")


def test_critical_friction_by_bisection_encloses_the_modal_onset(case: st.Case) -> None:
    system = st.build_system(case)
    first = onsets(system, (0.0, 0.3), max_frequency_hz=20e3).first
    assert first is not None
    bracket = (0.8 * first.mu, 1.2 * first.mu)
    middle, (low, high) = critical_friction(
        system, bracket, settings=settings_of(case), tolerance=1e-3, max_frequency_hz=20e3
    )
    assert high - low <= 1e-3
    assert middle == pytest.approx(first.mu, abs=1.5e-3)


def test_a_bracket_without_a_change_is_refused(case: st.Case) -> None:
    system = st.build_system(case)
    with pytest.raises(st.AnalysisError, match=r"perturbations decay at both ends of the bracket 0\.01 … 0\.02"):
        critical_friction(system, (0.01, 0.02), settings=settings_of(case), max_frequency_hz=20e3)


def test_compare_names_a_finite_sliding_contact(case: st.Case) -> None:
    finite = case.with_(
        {
            "contacts.A.sliding": "finite",
            "phases.press.duration": 1e-3,
            "phases.slide.duration": 1e-3,
            "temporal.record_every": 5,
        }
    )
    result = st.compare(finite, [0.05], critical=False)
    assert any("slides finitely" in note for note in result.notes)


def test_mac_is_one_up_to_a_factor_and_zero_when_orthogonal() -> None:
    shape = np.array([1.0, 2j, -0.5])
    assert modal_assurance(shape, 3j * shape) == pytest.approx(1.0)
    assert modal_assurance(np.array([1.0, 0]), np.array([0, 1j])) == 0.0


def test_components_of_a_known_signal() -> None:
    t = np.arange(6000) * 2e-6
    parts = {(8641.0, 640.0): 1e-3, (8441.0, -39.0): 2e-3, (8640.0, -150.0): 1e-3, (490.0, -25.0): 1e-3}
    signal = sum(a * np.exp(g * t) * np.cos(2 * np.pi * f * t + 0.3) for (f, g), a in parts.items())
    found = components(np.asarray(signal), 2e-6, max_frequency_hz=20e3)
    for f, g in parts:
        lam = found.eigenvalues[np.argmin(np.abs(found.eigenvalues - (g + 2j * np.pi * f)))]
        assert lam.imag / (2 * np.pi) == pytest.approx(f, abs=0.05)
        assert lam.real == pytest.approx(g, abs=0.5)
    assert found.fastest.real == pytest.approx(640.0, abs=0.5)


def test_components_see_through_a_larger_line_out_of_range() -> None:
    t = np.arange(4000) * 2e-6
    signal = 1e-3 * np.exp(300 * t) * np.cos(2 * np.pi * 5e3 * t) + 1e2 * np.exp(900 * t) * np.cos(2 * np.pi * 9e4 * t)
    found = components(signal, 2e-6, max_frequency_hz=20e3)
    assert found.fastest.real == pytest.approx(300, rel=0.02)
    assert found.fastest.imag / (2 * np.pi) == pytest.approx(5e3, rel=1e-4)


def test_spectrum_reads_amplitude_and_frequency_of_a_sine() -> None:
    t = np.arange(20000) * 1e-6
    spec = spectrum(2.5 * np.sin(2 * np.pi * 8700.0 * t) + 7.0, 1e-6)
    frequency, amplitude = spec.peak(above_hz=100)
    assert frequency == pytest.approx(8700, abs=1.0)
    assert amplitude == pytest.approx(2.5, rel=0.01)
    assert spec.resolution_hz == pytest.approx(50.0)
    assert spec.window == "hann"


def test_spectrogram_follows_a_change_of_frequency() -> None:
    t = np.arange(40000) * 1e-6
    signal = np.where(t < 0.02, np.sin(2 * np.pi * 2e3 * t), np.sin(2 * np.pi * 6e3 * t))
    image = spectrogram(signal, 1e-6, resolution_hz=500)
    top = image.frequency_hz[np.argmax(image.amplitude, axis=0)]
    assert top[0] == pytest.approx(2e3, abs=500)
    assert top[-1] == pytest.approx(6e3, abs=500)


@pytest.mark.parametrize("rate", [250.0, -80.0])
def test_growth_of_an_exponential(rate: float) -> None:
    t = np.arange(50000) * 1e-6
    fitted = growth(np.exp(rate * t) * np.cos(2 * np.pi * 5e3 * t), 1e-6, 5e3)
    assert fitted.rate == pytest.approx(rate, rel=0.01)
    assert not fitted.saturated


def test_growth_into_a_plateau_is_called_saturated() -> None:
    t = np.arange(100000) * 1e-6
    size = np.minimum(1e-3 * np.exp(300 * t), 1.0)
    fitted = growth(size * np.cos(2 * np.pi * 5e3 * t), 1e-6, 5e3)
    assert fitted.saturated
    assert fitted.rate == pytest.approx(300, rel=0.05)
    assert fitted.amplitude == pytest.approx(1.0, rel=0.02)


def test_envelope_has_the_amplitude() -> None:
    t = np.arange(20000) * 1e-6
    _, size = envelope(3.0 * np.cos(2 * np.pi * 4e3 * t), 1e-6, 4e3)
    assert np.allclose(size, 3.0, rtol=5e-3)


def test_penalty_tends_to_rigid(case: st.Case) -> None:
    rigid = st.modes(case, 0.1, count=12).eigenvalues[0]
    gaps = []
    for stiffness in (1e9, 1e10, 1e11):
        soft = st.modes(case.with_({"contacts.A.stiffness": stiffness}), 0.1, count=12).eigenvalues[0]
        nearest = np.abs(soft[:, None] - rigid).min(axis=1)
        gaps.append(float(np.max(nearest / np.abs(soft))))
    # First order in 1/K_c.
    assert gaps[1] < 0.2 * gaps[0]
    assert gaps[2] < 0.2 * gaps[1]


def test_runs_handed_in_are_used(case: st.Case) -> None:
    short = case.with_({"phases.press.duration": 1e-3, "phases.slide.duration": 1e-3, "temporal.record_every": 5})
    run = st.simulate(short, 0.1)
    marked = replace(run, velocity=np.zeros_like(run.velocity))
    result = st.compare(short, [0.1], critical=False, runs={0.1: marked})
    assert result.comparisons[0].dominant_frequency_hz is None
