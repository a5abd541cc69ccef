"""A run as sound: the acceleration of a point at its own pitch, or slowed down."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
from scipy import signal
from scipy.io import wavfile

from ..asking import NUMBER, TEXT, WHOLE, takes
from ..case.points import choice
from ..errors import AnalysisError, CaseError
from ..notebook import Shown
from ..study.ensemble_numbers import Observable, named_observable
from ..temporal.trajectory import RUN, Trajectory
from ..typing import Array

RATE = 44100  # samples a second
LOUD = 0.9  # of full scale
FADE = 2e-3  # s of sound at both ends, so that nothing clicks
SLOWEST = 1000.0
LONGEST = 600.0  # s of sound
SHORTEST = 16  # records
FAINT = 1e-3  # of the loudest: what is left in the range of hearing then is no more than the ends' own spectrum


@dataclass(frozen=True, repr=False)
class Sound(Shown):
    """Samples (k,) from −1 to 1 at ``rate`` a second, of an observable [unit] that is ``loudest`` at most.

    slow: how many times slower, and lower, than it was. unheard: the share of its power above half the rate, which is
    left out; of a sound slowed down less than of one at its own pitch.
    """

    samples: Array
    rate: int
    observable: str
    unit: str
    loudest: float
    slow: float
    unheard: float

    @property
    def _line(self) -> str:
        return self.sentence

    @property
    def seconds(self) -> float:
        """How long it lasts [s]."""
        return len(self.samples) / self.rate

    @property
    def sentence(self) -> str:
        """What is heard."""
        pitch = "at its own pitch" if self.slow == 1.0 else f"{self.slow:g} times slower and lower"
        lost = f"; {self.unheard:.1%} of its power lies above hearing" if self.unheard >= 5e-4 else ""
        loudest = f"{self.loudest:.4g} {self.unit}"
        return f"{self.seconds:.3g} s of {self.observable}, {pitch}, up to {loudest}{lost}"

    def wav(self) -> bytes:
        """A WAV file, 16 bits, one channel."""
        buffer = io.BytesIO()
        wavfile.write(buffer, self.rate, np.round(32767 * self.samples).astype(np.int16))
        return buffer.getvalue()


@takes(run=RUN, observable=TEXT.or_none(), slow=NUMBER, phase=TEXT.or_none(), repeat=WHOLE)
def sound(
    run: Trajectory, observable: str | None = None, *, slow: float = 1.0, phase: str | None = None, repeat: int = 1
) -> Sound:
    """What a run sounds like.

    observable: POINT.acceleration_x, POINT.velocity_y, CONTACT.normal_force and so on (default: the acceleration of the
    first watched point, in the direction in which it is largest). slow: how many times slower, 0.001 to 1000. phase: of
    the run (default: the last). repeat: how many times it is heard. The mean is taken off, the loudest sample is 0.9 of
    full scale. Raises CaseError for what the run does not have, AnalysisError where there is nothing to hear.
    """
    if not (np.isfinite(slow) and 1 / SLOWEST <= slow <= SLOWEST):
        raise CaseError("slow", slow, f"how many times slower, {1 / SLOWEST:g} to {SLOWEST:g}")
    if not 1 <= repeat <= 1000:
        raise CaseError("repeat", repeat, "a number of times from 1 to 1000")
    name, unit, values = _chosen(run, observable, _records(run, phase))
    if len(values) < SHORTEST:
        raise AnalysisError(f"{len(values)} records are too few for a sound; record more often (temporal.record_every)")
    if not np.isfinite(values).all():
        raise AnalysisError(f"{name} is not finite: the run did not stay stable")
    values = values - values.mean()
    loudest = float(np.abs(values).max())
    if loudest == 0.0:
        raise AnalysisError(f"{name} does not change: there is nothing to hear")
    count = round(len(values) * run.sampling * slow * RATE)
    if not 1 <= count * repeat <= LONGEST * RATE:
        lasts = len(values) * run.sampling
        raise CaseError("slow", slow, f"slow × repeat such that the {lasts:.3g} s of the run last up to {LONGEST:g} s")
    faded = values * signal.windows.tukey(len(values), min(1.0, 2 * FADE * RATE / count))
    heard = np.asarray(signal.resample(faded, count), dtype=float) if count != len(faded) else faded
    power = float(np.sum(heard**2) / count), float(np.sum(faded**2) / len(faded))
    peak = float(np.abs(heard).max())
    if peak <= FAINT * loudest:
        above = f"all but a trace of {name} lies above {RATE / 2e3:g} kHz"
        raise AnalysisError(f"{above}; slow it down to hear it (slow = 10)")
    unheard = max(0.0, 1.0 - power[0] / power[1])
    return Sound(np.tile(LOUD / peak * heard, repeat), RATE, name, unit, peak, slow, unheard)


def _records(run: Trajectory, phase: str | None) -> slice:
    names = [p.name for p in run.phases]
    if phase is None:
        return run.phase_slice() if names else slice(None)
    if phase not in names:
        raise CaseError("phase", phase, f"a phase of the run{choice(str(phase), names, 'there are')}")
    return run.phase_slice(names.index(phase))


def _chosen(run: Trajectory, name: str | None, records: slice) -> tuple[str, str, Array]:
    """Name, unit and history (r,) of what is listened to."""
    directions = "xyz"[: run.acceleration.shape[2]] if run.acceleration.ndim == 3 else "xy"
    if name is None:
        if not run.watch_names:
            raise CaseError("observable", None, "a point of the run; it watches none (temporal.watch): name a contact")
        name = f"{run.watch_names[0]}.acceleration"
    found: Observable = named_observable(name, run.watch_names, run.contact_names, directions)
    histories = found.signals(run)[records]
    if histories.shape[1] == 1:
        return found.name, found.unit, histories[:, 0]
    # Two directions are not added: their sum has neither's pitch.
    largest = int(np.argmax(histories.std(axis=0)))
    return f"{found.name}_{directions[largest]}", found.unit, histories[:, largest]
