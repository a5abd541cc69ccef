"""The published bench in time: all of its five million steps, and what friction or velocity decide."""

from __future__ import annotations

import numpy as np
import pytest

from benches import paper_case
from stridor.system import build_system
from stridor.temporal.energy import energy_balance
from stridor.temporal.schedule import PhaseSpec
from stridor.temporal.simulate import Settings, simulate

pytestmark = pytest.mark.validation

PRESS = PhaseSpec("press", 0.05, {"press": 1.0}, {"clamp": 0.0})
WATCH = ("beam1.tip", "beam1@0.025", "beam2@0.1", "beam2.end")


def march(sliding=0.05, **changes):
    system = build_system(paper_case(**changes))
    settings = Settings(step=2e-8, record_every=25, watch=WATCH, contact="rigid")
    return simulate(system, [PRESS, PhaseSpec("slide", sliding, {}, {"clamp": 1.0})], settings)


@pytest.fixture(scope="module")
def standard():
    """Table III: 0.05 s of loading, 0.05 s of sliding, 2e-8 s a step."""
    return march()


def slide(result):
    return result.phase_slice(1)


def amplitude(result, first, last):
    """Largest deviation of the normal force from the load [N] over part of the sliding phase [s]."""
    t = result.time - 0.05
    chosen = (t >= first) & (t < last)
    return float(np.abs(result.normal_force[chosen, 0] - 20.0).max())


def test_five_million_steps_in_the_complete_basis(standard):
    assert standard.steps == 5_000_000
    assert standard.path == "modal"
    assert standard.limiting_body == "beam2"
    assert not standard.interrupted


def test_loading_settles(standard):
    """Phase I: the bodies meet, bounce, and come to rest under 20 N."""
    loading = standard.phases[0].contacts["A"]
    assert loading.max_normal_force > 40.0
    assert 0 < loading.separation_fraction < 0.01
    settled = (standard.time > 0.045) & (standard.time < 0.05)
    assert np.abs(standard.normal_force[settled, 0] - 20.0).max() < 2.5


def test_it_grows_into_stick_slip_before_it_separates(standard):
    """Phase II: exponential growth, then stick and slip with force peaks of 33–45 N (the paper: about 37
    N)."""
    start = amplitude(standard, 0.0005, 0.0015)
    assert start < 10.0
    separation = standard.phases[1].contacts["A"].first_separation
    assert separation is not None
    assert 0.01 < separation - 0.05 < 0.03  # "some 20 ms"
    first = (standard.time > 0.06) & (standard.time < separation)
    force = standard.normal_force[first, 0]
    assert 33.0 < force.max() < 45.0
    status = standard.status[first, 0]
    assert set(np.unique(status)) == {1, 2}
    assert 0.3 < np.mean(status == 1) < 0.7  # about half of the time
    speed = np.abs(standard.slip_speed[first, 0]).max()
    assert 0.05 < speed < 0.2  # the paper: 0.09 m/s


def test_spectrum_peaks_near_the_published_frequency(standard):
    """The slave's motion along x (figure 9 has its acceleration): fundamental within 3 % of 8700 Hz."""
    separation = standard.phases[1].contacts["A"].first_separation
    for first, last in ((0.06, separation), (0.08, 0.1)):
        chosen = (standard.time > first) & (standard.time < last)
        signal = standard.velocity[chosen, 0, 0]
        signal = (signal - signal.mean()) * np.hanning(chosen.sum())
        spectrum = np.abs(np.fft.rfft(signal, 8 * len(signal)))
        frequency = np.fft.rfftfreq(8 * len(signal), standard.sampling)
        above = frequency > 2e3
        peak = frequency[above][np.argmax(spectrum[above])]
        assert peak == pytest.approx(8700.0, rel=0.03), (first, last)


def test_energy_balance_closes(standard):
    balance = energy_balance(standard)
    assert balance.error < 1e-9  # asked for: 1e-3
    assert balance.friction > 0
    assert balance.support > balance.friction - balance.external  # what grows comes from the moving clamp


def growth(result):
    """Late over early vibration of the sliding phase."""
    early = np.std(result.normal_force[slide(result), 0][:4000])
    late = np.std(result.normal_force[slide(result), 0][-4000:])
    return late / early


# In each run: `verification/test_agreement.py::test_critical_friction_by_bisection_encloses_the_modal_onset`.
@pytest.mark.slow
def test_friction_below_the_onset_decays():
    assert growth(march(contacts__A__friction__coefficient=0.07, sliding=0.03)) < 0.7


@pytest.mark.slow
def test_friction_just_above_the_onset_grows():
    assert growth(march(contacts__A__friction__coefficient=0.085, sliding=0.03)) > 2.0


def test_reversed_velocity_decays():
    result = march(supports__clamp__velocity__x=-0.02, sliding=0.03)
    assert growth(result) < 0.7
    assert result.phases[1].contacts["A"].separation_fraction == 0.0


@pytest.mark.slow
def test_lean_and_velocity_reversed_together_grow_again():
    """Only the sign of V sin β matters."""
    changes = {"bodies__beam1__angle_deg": 95.0, "supports__clamp__velocity__x": -0.02}
    assert growth(march(sliding=0.03, **changes)) > 2.0
