"""Flagship: a small perturbation about steady sliding grows in time as the complex modes say.

Nothing is shared between the two but the assembled system: eigenvalues of the coupled pencil on one side,
the marched
multipliers on the other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benches import Slave, bench, paper_case
from marching import band, exponents, one_phase
from stridor.laws import Weakening
from stridor.modal.complex_modes import complex_modes
from stridor.system import build_system
from stridor.temporal.simulate import Settings, simulate

pytestmark = pytest.mark.verification


def marched_exponents(
    system, mu, duration, perturbation, low, high, *, order=20, step=None, every=100, watch=()
):
    """Exponents (k,) of what lies between two frequencies [Hz] (0: of all), from the watched velocities
    along x."""
    result = simulate(
        system,
        one_phase(duration),
        Settings(
            step=step, record_every=every, initial="steady-sliding", perturbation=perturbation, watch=watch,
        ),
        mu=mu,
    )  # fmt: skip
    # Small: nothing but slip all along.
    statistics = next(iter(result.phases[0].contacts.values()))
    assert statistics.slip_fraction == 1.0
    signals = result.velocity[:, :, 0].T
    signals = signals - signals.mean(axis=1, keepdims=True)
    stride = max(1, int(1 / (5 * high * result.sampling)))
    passed = band(signals, result.sampling, low, high) if low else signals[:, signals.shape[1] // 2 :]
    passed = passed[:, passed.shape[1] // 6 :: stride]
    return exponents(passed, result.sampling * stride, order)


def nearest(values, target):
    return values[np.argmin(np.abs(values - target))]


WATCH = ("beam1.tip", "beam2@0.1")


@pytest.mark.parametrize(
    ("mu", "duration", "perturbation"), [(0.1, 6e-3, 1e-9), (0.12, 4e-3, 1e-10), (0.07, 5e-3, 1e-9)]
)
def test_growth_rate_of_the_two_beam_bench(mu, duration, perturbation):
    """8.6 kHz: growth rate within 0.5 %, frequency within 0.01 %, of rigid contact in time and of modes at rigid contact
    and at the case's own K_c."""
    system = build_system(paper_case())
    rigid = system.with_rigid_contacts()
    found = marched_exponents(rigid, mu, duration, perturbation, 6e3, 14e3, step=2e-8, watch=WATCH, order=24)
    for model, tolerance in ((rigid, 0.005), (system, 0.005)):
        modes = complex_modes(model, mu, max_frequency_hz=40e3)
        if mu > 0.08:
            unstable = modes.eigenvalues[modes.unstable & (modes.frequency_hz < 20e3)]
            assert len(unstable) == 1
            target = unstable[0]
            assert target.real > 600
        else:
            # The pair before it meets: the one of the two that the friction weakens.
            near = modes.eigenvalues[np.abs(modes.frequency_hz - 8600) < 120]
            target = near[np.argmax(near.imag * (near.imag < 2 * np.pi * 8650))]
            assert target.real < 0
        answer = nearest(found, target)
        assert answer.real == pytest.approx(target.real, rel=tolerance if mu > 0.08 else 0.02)
        assert answer.imag == pytest.approx(target.imag, rel=1e-4)


@pytest.mark.parametrize(("stiffness", "rate"), [("rigid", 2670.5), (1e10, 3077.8)])
def test_fastest_mode_of_the_two_beam_bench(stiffness, rate):
    """At μ = 0.1 a mode near 78 kHz grows four times as fast as the one of the paper: seen in time as
    well, with the contact spring of the case as without."""
    system = build_system(paper_case(contacts__A__stiffness=stiffness))
    modes = complex_modes(system, 0.1, count=40)
    fast = modes.eigenvalues[np.unravel_index(np.argmax(modes.growth_rate), modes.growth_rate.shape)]
    assert fast.real == pytest.approx(rate, rel=1e-3)
    assert fast.imag / (2 * np.pi) == pytest.approx(77.9e3, rel=0.01)
    found = marched_exponents(system, 0.1, 4e-3, 1e-9, 70e3, 85e3, step=2e-8, every=40, watch=WATCH, order=6)
    answer = nearest(found, fast)
    assert answer.real == pytest.approx(fast.real, rel=0.005)
    assert answer.imag == pytest.approx(fast.imag, rel=1e-4)


def test_growth_rate_of_another_bench():
    """Other beams, a clamped slave below a tilted master, many unstable modes: the fastest shows first in
    time."""
    slave = Slave(
        place=0.75,
        lean_deg=12.0,
        length=0.07,
        thickness=2.5e-3,
        elements=8,
        end="clamped",
        side=-1,
        stiffness="rigid",
    )
    system = bench(
        slave, angle_deg=20.0, velocity=0.3, length=0.2, thickness=4e-3, elements=10, damping=(80.0, 2e-8)
    )
    mu = 0.35
    modes = complex_modes(system, mu, count=50)
    assert modes.unstable.sum() >= 5
    fast = modes.eigenvalues[np.unravel_index(np.argmax(modes.growth_rate), modes.growth_rate.shape)]
    # Δt small enough that the scheme itself shifts the frequency, (ωΔt)²/24, by less than 1e-5.
    found = marched_exponents(
        system, mu, 15 / fast.real, 1e-9, 0, fast.imag / 6, step=5e-8, every=10, order=16,
        watch=("s0.start", "base.end"),
    )  # fmt: skip
    answer = nearest(found, fast)
    assert answer.real == pytest.approx(fast.real, rel=0.005)
    assert answer.imag == pytest.approx(fast.imag, rel=1e-4)


def test_growth_rate_under_weakening_friction():
    """The slope of μ(v) acts as negative damping in both approaches."""
    law = Weakening(0.05, 0.055, 0.05)
    system = build_system(paper_case()).with_rigid_contacts()
    flat = complex_modes(system, law.sliding(0.02), max_frequency_hz=40e3)
    # Without the slope nothing near it is unstable.
    assert not np.any(flat.unstable & (np.abs(flat.frequency_hz - 8600) < 200))
    system = replace(system, contacts=tuple(replace(c, law=law) for c in system.contacts))
    mu = law.sliding(0.02)
    modes = complex_modes(system, mu, max_frequency_hz=40e3)
    choice = modes.unstable & (np.abs(modes.frequency_hz - 8600) < 200)
    target = max(modes.eigenvalues[choice], key=lambda value: value.real)
    found = marched_exponents(system, None, 2e-2, 1e-8, 6e3, 14e3, step=2e-8, watch=WATCH, order=24)
    answer = nearest(found, target)
    assert answer.real == pytest.approx(target.real, rel=0.01)
    assert answer.imag == pytest.approx(target.imag, rel=1e-4)
