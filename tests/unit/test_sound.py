"""Runs as sound: pitch, length and level of what is written, and what is said of the rest."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

import stridor as st
from benches import paper_case
from program import stridor
from stridor.errors import AnalysisError, CaseError
from stridor.temporal.trajectory import Trajectory

PITCH = 8641.5
HISTORIES = (
    "normal_force", "tangential_force", "slip_speed", "gap", "status", "displacement", "velocity", "kinetic", "elastic",
)  # fmt: skip


@pytest.fixture(scope="module")
def run() -> Trajectory:
    changes = {
        "bodies.beam1.elements": 4, "bodies.beam2.elements": 8, "temporal.step": 2e-7, "temporal.record_every": 5,
        "phases.press.duration": 2e-4, "phases.slide.duration": 2e-3,
    }  # fmt: skip
    return st.simulate(paper_case().with_(changes))


def ringing(run: Trajectory, seconds: float = 0.05, above: float = 0.0) -> Trajectory:
    """A run whose first point rings at PITCH along y, and less along x; above: amplitude of what nobody hears."""
    time = np.arange(0.0, seconds, run.sampling)
    rings = 3e3 * np.sin(2 * np.pi * PITCH * time) + above * np.sin(2 * np.pi * 78e3 * time)
    acceleration = np.zeros((len(time), len(run.watch_names), 2))
    acceleration[:, 0] = np.stack([0.1 * rings, 7.0 + rings], axis=1)
    phase = replace(run.phases[-1], start=0.0, end=seconds)
    kept = {name: _as_long(getattr(run, name), len(time)) for name in HISTORIES}
    works = {name: _as_long(values, len(time)) for name, values in run.works.items()}
    return replace(run, **kept, time=time, acceleration=acceleration, phases=(phase,), works=works)


def _as_long(values: np.ndarray, count: int) -> np.ndarray:
    return np.resize(values, (count, *values.shape[1:]))


def heard(found) -> tuple[int, np.ndarray, float]:
    """Rate, samples and pitch [Hz] of the file."""
    rate, samples = wavfile.read(io.BytesIO(found.wav()))
    lines = np.abs(np.fft.rfft(samples * np.hanning(len(samples)), 8 * len(samples)))
    return rate, samples, float(np.argmax(lines) * rate / (8 * len(samples)))


@pytest.mark.parametrize("slow", [0.5, 1.0, 10.0])
def test_pitch_length_and_level(run: Trajectory, slow: float) -> None:
    found = st.sound(ringing(run), slow=slow)
    rate, samples, pitch = heard(found)
    assert samples.dtype == np.int16
    assert len(samples) / rate == pytest.approx(0.05 * slow, rel=1e-3)
    assert pitch == pytest.approx(PITCH / slow, rel=2e-3)
    assert np.abs(samples).max() == pytest.approx(0.9 * 32767, abs=1)
    assert found.observable == f"{run.watch_names[0]}.acceleration_y"
    assert found.loudest == pytest.approx(3e3, rel=0.02)
    # Neither a click at the ends nor the mean.
    assert np.abs(samples[[0, -1]]).max() < 400
    assert abs(samples.mean()) < 30


def test_it_is_shown_in_a_line(run: Trajectory) -> None:
    found = st.sound(ringing(run), slow=10)
    assert repr(found) == f"<Sound: {found.sentence}>"
    assert "10 times slower and lower" in repr(found)
    assert found._repr_html_() == f"<div><strong>Sound: {found.sentence}</strong></div>"


def test_what_nobody_hears_is_said_and_left_out(run: Trajectory) -> None:
    found = st.sound(ringing(run, above=3e3))
    assert heard(found)[2] == pytest.approx(PITCH, rel=2e-3)
    assert found.unheard == pytest.approx(0.5, abs=0.01)
    assert "50.0% of its power lies above hearing" in found.sentence
    slower = st.sound(ringing(run, above=3e3), slow=10)
    assert slower.unheard < 1e-3
    assert slower.loudest == pytest.approx(6e3, rel=0.02)
    only = ringing(run)
    sharp = np.sin(2 * np.pi * 100e3 * only.time)[:, None, None] * np.ones_like(only.acceleration)
    with pytest.raises(AnalysisError, match=r"lies above 22.05 kHz; slow it down to hear it \(slow = 10\)"):
        st.sound(replace(only, acceleration=sharp))


def test_repeated(run: Trajectory) -> None:
    once, often = st.sound(ringing(run)), st.sound(ringing(run), repeat=3)
    assert np.array_equal(often.samples, np.tile(once.samples, 3))


def test_any_observable_and_phase(run: Trajectory) -> None:
    assert st.sound(run, "A.normal_force").unit == "N"
    assert st.sound(run, f"{run.watch_names[0]}.velocity_x", phase="press").seconds < st.sound(run).seconds


@pytest.mark.bad_input
@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"slow": 0.0}, r"slow: 0.0 – how many times slower, 0.001 to 1000"),
        ({"slow": float("nan")}, r"slow: nan – how many times slower"),
        ({"slow": 1000.0, "repeat": 1000}, r"slow: 1000.0 – slow × repeat such that the .* s of the run last up to 600 s"),
        ({"repeat": 0}, r"repeat: 0 – a number of times from 1 to 1000"),
        ({"observable": "nowhere.velocity_x"}, r"observable: 'nowhere.velocity_x' – POINT.QUANTITY with a point among"),
        ({"phase": "slip"}, r"phase: 'slip' – a phase of the run; did you mean 'slide'\?"),
    ],
)
def test_bad_wishes(run: Trajectory, given: dict, message: str) -> None:
    with pytest.raises(CaseError, match=message):
        st.sound(run, **given)


@pytest.mark.bad_input
def test_runs_without_a_sound(run: Trajectory) -> None:
    still = replace(run, acceleration=np.full_like(run.acceleration, 9.81))
    with pytest.raises(AnalysisError, match="does not change: there is nothing to hear"):
        st.sound(still)
    with pytest.raises(AnalysisError, match="is not finite: the run did not stay stable"):
        st.sound(replace(run, acceleration=run.acceleration * np.nan))
    with pytest.raises(CaseError, match=r"watches none \(temporal.watch\): name a contact"):
        st.sound(replace(run, watch_names=(), acceleration=run.acceleration[:, :0]))


def test_the_verb_writes_a_file_beside_the_run(run: Trajectory, tmp_path: Path) -> None:
    (tmp_path / "case.out").mkdir()
    st.save(run, tmp_path / "case.out" / "simulate.nc")
    told = stridor("sound", "case.out", cwd=tmp_path)
    assert told.returncode == 0
    found = st.sound(run)
    name = found.observable
    assert f"0.002 s of {name}, at its own pitch" in told.stdout
    assert ("Next: stridor sound case.out --slow 10" in told.stdout) is (found.unheard > 0.5)
    rate, samples = wavfile.read(tmp_path / "case.out" / f"{name}.wav")
    assert (rate, len(samples)) == (44100, len(found.samples))
    other = stridor("sound", "case.out/simulate.nc", "--slow", "10", "--out", "there", cwd=tmp_path)
    assert other.returncode == 0
    assert (tmp_path / "there" / f"{name}-10-times-slower.wav").exists()
    missing = stridor("sound", "nothing.nc", cwd=tmp_path)
    assert missing.returncode == 2
    assert "Traceback" not in missing.stderr
