"""Filter and fit of signals: lengths, stop band and fitted span by their own rules."""

import numpy as np
import pytest
from scipy.signal import windows

from stridor.temporal import signals
from stridor.temporal.growth import growth
from stridor.temporal.signals import STOP_DECIBELS, components, low_passed

SAMPLING, BAND = 2e-6, 20e3


@pytest.mark.parametrize(("band", "sampling"), [(20e3, 2e-6), (5e3, 2e-6), (8e3, 5e-6)])
def test_the_filter_is_as_long_as_its_transition_asks_for(band: float, sampling: float) -> None:
    # Kaiser (1974): N ≥ (A − 8)/(2.285 Δω) with Δω = 2π (1.25 − 1) f Δt; what the filter is filled with is cut off.
    signal = np.cos(np.arange(20_000.0))
    taps = len(signal) - len(low_passed(signal, sampling, band)) + 1
    wanted = (STOP_DECIBELS - 8) / (2.285 * 2 * np.pi * 0.25 * band * sampling)
    assert taps % 2 == 1
    assert wanted - 1 <= taps <= wanted + 1


def test_the_filter_keeps_the_band_and_nothing_beyond_a_quarter_more() -> None:
    time = np.arange(20_000) * SAMPLING
    inside = low_passed(np.cos(2 * np.pi * BAND * time), SAMPLING, BAND)
    outside = low_passed(np.cos(2 * np.pi * 1.25 * BAND * time), SAMPLING, BAND)
    assert np.abs(inside).max() == pytest.approx(1.0, abs=1e-6)
    assert np.abs(outside).max() < 1e-7


def test_a_short_signal_gets_a_filter_of_a_third_of_it() -> None:
    signal = np.cos(0.1 * np.arange(300.0))
    assert len(low_passed(signal, SAMPLING, BAND)) == 300 - 101 + 1


def test_a_signal_without_anything_above_the_band_is_left_alone() -> None:
    signal = np.cos(0.1 * np.arange(300.0))
    assert low_passed(signal, SAMPLING, 0.36 / SAMPLING) is signal
    assert low_passed(signal[:63], SAMPLING, BAND) is not None
    assert len(low_passed(signal[:63], SAMPLING, BAND)) == 63


@pytest.mark.parametrize("rate", [300.0, -300.0])
def test_growth_that_goes_on_is_fitted_over_the_whole_signal(rate: float) -> None:
    time = np.arange(20_000) * 1e-6
    fitted = growth(np.exp(rate * time) * np.cos(2 * np.pi * 5e3 * time), 1e-6, 5e3)
    assert not fitted.saturated
    # Twenty periods (4 ms) make one value, at their middle; the plateau is the median of the last quarter.
    assert fitted.start == pytest.approx(2e-3, abs=5e-4)
    last_quarter = 2e-3 + 16e-3 * 7 / 8
    late = last_quarter + np.log(0.95) / rate if rate > 0 else 18e-3
    assert fitted.end == pytest.approx(late, abs=6e-4)


def test_growth_into_a_plateau_is_fitted_up_to_half_of_it() -> None:
    time = np.arange(60_000) * 1e-6
    size = np.minimum(1e-3 * np.exp(400.0 * time), 1.0)
    fitted = growth(size * np.cos(2 * np.pi * 5e3 * time), 1e-6, 5e3)
    assert fitted.saturated
    assert fitted.end == pytest.approx(np.log(500.0) / 400.0, abs=1e-3)
    assert fitted.rate == pytest.approx(400.0, rel=5e-3)
    assert fitted.amplitude == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize(("last", "saturated"), [(0.9, True), (1.2, True), (1.3, False), (2.0, False)])
def test_what_still_rises_by_a_quarter_has_not_saturated(last: float, saturated: bool) -> None:
    time = np.arange(60_000) * 1e-6
    size = np.select([time < 0.015, time < 0.03, time < 0.045], [0.01, 0.3, 1.0], last)
    fitted = growth(size * np.cos(2 * np.pi * 5e3 * time), 1e-6, 5e3)
    assert fitted.amplitude == pytest.approx(last, rel=1e-3)
    assert fitted.saturated is saturated


def test_two_lines_of_one_frequency_apart_in_decay_are_both_found() -> None:
    time = np.arange(8000) * SAMPLING
    signal = np.exp(-40.0 * time) * np.cos(2 * np.pi * 3e3 * time)
    signal += 0.3 * np.exp(25.0 * time) * np.cos(2 * np.pi * 3.4e3 * time + 0.4)
    found = components(signal, SAMPLING, max_frequency_hz=BAND)
    assert found.eigenvalues == pytest.approx([-40 + 6e3j * np.pi, 25 + 6.8e3j * np.pi], abs=0.05)
    assert found.fastest == pytest.approx(25 + 6.8e3j * np.pi, abs=0.05)


@pytest.mark.parametrize("window", ["hann", "boxcar", "blackmanharris", "flattop"])
def test_lines_are_as_wide_as_the_window_makes_them(window: str) -> None:
    """The width at half the amplitude, in bins, of the window's own transform, found by padding it with zeros."""
    n, padding = 512, 256
    size = np.abs(np.fft.fft(windows.get_window(window, n), n * padding))
    half = int(np.argmax(size < 0.5 * size[0]))
    at = half - 1 + (size[half - 1] - 0.5 * size[0]) / (size[half - 1] - size[half])
    assert signals._WIDTH[window] == pytest.approx(2 * at / padding, rel=0.01)


def test_a_peak_beside_the_edge_of_what_is_looked_at_stays_between_its_bins() -> None:
    # A strong line just below the edge: its slope is the largest value above, and no peak of a parabola.
    frequency = np.arange(10.0)
    amplitude = np.array([0.0, 1.0, 50.0, 49.0, 45.0, 1.0, 0.5, 0.2, 0.1, 0.1])
    found = signals.Spectrum(frequency, amplitude, "hann", 1.0, 2.0)
    assert found.peak(above_hz=2.5)[0] == pytest.approx(2.5)
    lone = np.exp(-((frequency - 6.3) ** 2))
    assert signals.Spectrum(frequency, lone, "hann", 1.0, 2.0).peak()[0] == pytest.approx(6.3)


@pytest.mark.parametrize("periods", [3.2, 4.8, 7.5, 40.3])
def test_a_slow_line_is_found_where_it_is_and_not_on_its_flank(periods: float) -> None:
    """Of less than four periods the largest bin beyond the fourth lies on the flank of the line."""
    time = np.linspace(0.0, 1.0, 4096, endpoint=False)
    swing = np.sin(2 * np.pi * periods * time) + 0.01 * np.sin(2 * np.pi * 300.0 * time)
    frequency, amplitude = signals.spectrum(swing, float(time[1])).line()
    assert frequency == pytest.approx(periods, abs=0.15)
    assert amplitude == pytest.approx(1.0, abs=0.2)


def test_what_is_slower_than_that_is_no_line() -> None:
    time = np.linspace(0.0, 1.0, 4096, endpoint=False)
    drift = time**2
    assert signals.spectrum(drift, float(time[1])).line() == (0.0, 0.0)
    squeal = 1e-3 * np.sin(2 * np.pi * 300.0 * time)
    assert signals.spectrum(drift + squeal, float(time[1])).line()[0] == pytest.approx(300.0, abs=0.1)


@pytest.mark.parametrize("grown", [0.3, 0.5, 0.6, 0.8, 0.9, 1.5])
@pytest.mark.parametrize("dip", [0.0, 0.6])
def test_growth_is_never_called_saturated_however_slow(grown: float, dip: float) -> None:
    # e^0.6 over the whole: half as large again as at the beginning, and a quarter larger than a quarter before.
    time = np.arange(60_000) * 1e-6
    size = np.exp(grown * time / time[-1]) * (1.0 - dip * np.exp(-(((time - 0.01) / 3e-3) ** 2)))
    fitted = growth(size * np.cos(2 * np.pi * 5e3 * time), 1e-6, 5e3)
    assert not fitted.saturated


def limited(rate: float, time: np.ndarray, cycle: np.ndarray | float = 1.0) -> np.ndarray:
    """Exponential growth from 1e-3 into an amplitude of 1 (times cycle), in a run of many times its rise."""
    return ((1e3 * np.exp(-rate * time)) ** 4 + (1.0 / cycle) ** 4) ** -0.25


@pytest.mark.parametrize("length", [150.0, 300.0, 900.0])
@pytest.mark.parametrize("wobble", [0.0, 0.25])
def test_a_fast_rise_at_the_start_of_a_long_run_is_the_growth(length: float, wobble: float) -> None:
    """20 periods of 0.25 Hz are eleven times as long as it takes to grow by e: over them nothing of it is seen."""
    time = np.arange(0.0, length, 0.1)
    size = limited(0.14, time, 1.0 + wobble * np.sin(2 * np.pi * time / 40.0))
    fitted = growth(size * np.cos(2 * np.pi * 0.25 * time), 0.1, 0.25)
    assert fitted.exponential
    assert fitted.saturated
    assert fitted.rate == pytest.approx(0.14, rel=0.05)
    assert fitted.end < 50.0


def test_what_grows_within_the_shortest_window_is_not_called_exponential() -> None:
    time = np.arange(0.0, 300.0, 0.1)
    fitted = growth(limited(0.5, time) * np.cos(2 * np.pi * 0.25 * time), 0.1, 0.25)
    assert not (fitted.exponential and fitted.rate > 0.02)
    bent = growth((1e-3 + (time / 300.0) ** 2) * np.cos(2 * np.pi * 2.0 * time), 0.1, 2.0)  # no exponential, and never flat
    assert not bent.exponential


def test_a_decay_among_other_lines_is_fitted_as_before() -> None:
    time = np.arange(0.0, 400.0, 0.01)
    signal = np.exp(-0.01 * time) * np.cos(2 * np.pi * 0.25 * time) + 0.3 * np.exp(-0.02 * time) * np.cos(2 * np.pi * 0.4 * time)
    fitted = growth(signal, 0.01, 0.25)
    assert fitted.exponential
    assert fitted.rate == pytest.approx(-0.01, rel=1e-2)
