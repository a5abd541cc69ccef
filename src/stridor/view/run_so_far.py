"""A run in time, finished or under way, in so few numbers that a page can draw it several times a second.

Histories of many records become bands: the least and the largest value of each stretch, so that no peak is lost.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..temporal.signals import spectrogram
from ..temporal.trajectory import Trajectory
from ..typing import Array
from .temporal_plots import largest_of

STRETCHES = 600  # of time, at most
PORTRAIT = 1500  # points of the phase portrait, at most
COLUMNS, LINES = 160, 80  # of the spectrogram, at most
LEAST = 64  # records from which on there are spectra
FLOOR = -60.0  # dB below the largest line, as in the report


@dataclass(frozen=True)
class ValueRanges:
    """Least and largest value (b,) of a history in each stretch of time; label, unit."""

    label: str
    unit: str
    low: list[float]
    high: list[float]


@dataclass(frozen=True)
class Portrait:
    """Velocity [m/s] over displacement [m] about its mean, of the last records."""

    label: str
    displacement: list[float]
    velocity: list[float]
    seconds: float


@dataclass(frozen=True)
class Sonogram:
    """Level (t, f) in dB below ``largest`` [unit] at time (t,) [s] and frequency (f,) [Hz]."""

    time: list[float]
    frequency_hz: list[float]
    level: list[list[float]]
    largest: float
    unit: str


@dataclass(frozen=True)
class RunSoFar:
    """What is drawn of a run. done of ``planned`` steps; time (b,) [s], middles of the stretches; status by contact:
    shares (3, b) of separation, stick and slip among the records of each stretch; phases: name, start and end [s]."""

    done: int
    planned: int
    end: float
    records: int
    time: list[float]
    phases: list[tuple[str, float, float]]
    acceleration: ValueRanges | None
    normal_force: list[ValueRanges]
    tangential_force: list[ValueRanges]
    status: dict[str, list[list[float]]]
    portrait: Portrait | None
    sonogram: Sonogram | None

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


def run_so_far(run: Trajectory, *, point: str | None = None, max_frequency_hz: float = 40e3) -> RunSoFar:
    """A run in few numbers. point: a watched one (default: the first), of which the direction with the larger
    acceleration is shown; max_frequency_hz: of the spectra."""
    count = len(run.time)
    edges = np.unique(np.linspace(0, count, min(STRETCHES, max(count, 1)) + 1).astype(int))
    starts, sizes = edges[:-1], np.diff(edges)
    time = 0.5 * (run.time[starts] + run.time[edges[1:] - 1]) if count else np.zeros(0)

    def band(label: str, unit: str, values: Array) -> ValueRanges:
        return ValueRanges(label, unit, *(_plain(at.reduceat(values, starts)) for at in (np.minimum, np.maximum)))

    acceleration, portrait, sonogram = None, None, None
    if run.watch_names and count:
        index = run.watch_names.index(point) if point in run.watch_names else 0
        name = run.watch_names[index]
        with np.errstate(all="ignore"):  # a run that does not stay stable
            direction = loudest_direction(run.acceleration[:, index])
        axis = "xyz"[direction]
        histories = (h[:, index, direction] for h in (run.displacement, run.velocity, run.acceleration))
        displacement, velocity, history = histories
        acceleration = band(f"{name} {axis}", "m/s²", history)
        portrait = _portrait(f"{name} {axis}", displacement, velocity, run.sampling)
        sonogram = _sonogram(history, float(run.time[0]), run.sampling, max_frequency_hz)
    def forces(values: Array) -> list[ValueRanges]:
        return [band(name, "N", values[:, c]) for c, name in enumerate(run.contact_names)] if count else []

    status = {
        name: [_plain(np.add.reduceat((run.status[:, c] == kind).astype(float), starts) / sizes) for kind in range(3)]
        for c, name in enumerate(run.contact_names)
        if count
    }
    phases = [(p.name, p.start, p.end) for p in run.phases]
    end, middles = float(run.time[-1]) if count else 0.0, _plain(time)
    return RunSoFar(
        run.steps, run.planned_steps, end, count, middles, phases, acceleration, forces(run.normal_force),
        forces(run.tangential_force), status, portrait, sonogram,
    )  # fmt: skip


def loudest_direction(acceleration: Array) -> int:
    """Number of the direction in which accelerations (t, d) vary most."""
    return int(np.argmax(np.nan_to_num(acceleration.std(axis=0))))


def _plain(values: Array) -> list[float]:
    return [float(v) for v in np.nan_to_num(values, posinf=0.0, neginf=0.0)]


def _portrait(label: str, displacement: Array, velocity: Array, sampling: float) -> Portrait:
    last = slice(max(0, len(velocity) - PORTRAIT), None)
    u, v = displacement[last], velocity[last]
    return Portrait(label, _plain(u - u.mean()), _plain(v), len(v) * sampling)


def _sonogram(history: Array, start: float, sampling: float, top: float) -> Sonogram | None:
    """Short-time spectra up to ``top`` [Hz], the largest line of each cell."""
    if len(history) < LEAST or not np.isfinite(history).all():
        return None
    # About as many pieces as columns, with lines no finer than they are drawn unless that leaves a piece too short.
    resolution = max(top / LINES, 4.0 / (len(history) * sampling))
    found = spectrogram(history, sampling, resolution_hz=resolution)
    inside = found.frequency_hz <= top
    amplitude, time = found.amplitude[inside], found.time
    largest = largest_of(amplitude)
    step = -(-len(time) // COLUMNS)
    starts = np.arange(0, len(time), step)
    amplitude = np.maximum.reduceat(amplitude, starts, axis=1)
    middle = np.array([time[k : k + step].mean() for k in starts])
    level = np.clip(20 * np.log10(np.maximum(amplitude / largest, 1e-300)), FLOOR, 0.0)
    frequency = _plain(found.frequency_hz[inside])
    return Sonogram(_plain(start + middle), frequency, np.round(level.T, 1).tolist(), largest, "m/s²")
