"""What a report is made of: results, any of which may be missing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ..agreement import Agreement
from ..case import Case
from ..modal.complex_modes import ComplexModes
from ..modal.onsets import Onsets
from ..periodic import Cycles
from ..sliding.result import SteadySliding
from ..study.measures import Countermeasures
from ..study.saturation import Unsaturated
from ..study.sensitivities import Sensitivities
from ..system import System
from ..temporal.energy import EnergyBalance
from ..temporal.signals import Spectrogram, Spectrum
from ..temporal.trajectory import Trajectory
from ..typing import Array, ComplexArray


@dataclass(frozen=True)
class NamedFrequencies:
    """Natural frequencies (k,) [Hz] of a body alone, ascending, and a name of each: rigid, F1, T1, …"""

    frequency_hz: Array
    labels: tuple[str, ...] = ()


@dataclass(frozen=True)
class FrictionCurve:
    """μ (k,) at which the undamped system has the frequency (k,) [Hz], frequencies ascending."""

    mu: Array
    frequency_hz: Array


@dataclass(frozen=True)
class NamedShape:
    """A complex shape by line, (k, 2) at its nodes, at a frequency; velocities [m/s] or a mode of any scale."""

    frequency_hz: float
    shape: Mapping[str, ComplexArray]
    growth_rate: float | None = None


@dataclass(frozen=True)
class ReportInputs:
    """Everything a report may show; what is None or empty is left out.

    mu: friction coefficient of the case, at which modes, the run and both shapes are taken.
    modes: at mu alone. undamped_sweep, damped_sweep: over the whole range of friction; undamped_pair,
    damped_pair: finer, around the first onset (default: the sweeps). coupled_hz (k,): frequencies in contact
    without friction. spectra: by watched point, what of is said in spectra_of, in spectra_unit; likewise the
    spectrogram, whose signal begins at spectrogram_start [s]. operating_shape: velocities at the dominant
    frequency of the run; unstable_shape: the mode that grows fastest. mac_by_body: assurance of these two.
    values: computed values by the names used in case.reference.values, in front of those that the results
    give; value_notes: what each of them is. source_places: where in the source of case.reference something is
    found, by the name of the figure or table here ("frequency-pair": "figure 3").
    steady: equilibrium of every contact node; shape_vector (n,): the mode that grows fastest, friction_energy (m,):
    what friction feeds into it at each slave node. sensitivities, measures: what changes of the case do;
    unsaturated: that the run still grows. cycles: limit cycles of this case that were found before;
    beside_cycles: why the run is not held against them. timings [s]
    by analysis; versions by program; case_text: the case file as written; created: date and time; warnings and notes in
    words.
    """

    case: Case
    system: System | None = None
    mu: float | None = None
    steady: SteadySliding | None = None
    modes: ComplexModes | None = None
    undamped_sweep: ComplexModes | None = None
    damped_sweep: ComplexModes | None = None
    undamped_pair: ComplexModes | None = None
    damped_pair: ComplexModes | None = None
    body_modes: Mapping[str, NamedFrequencies] = field(default_factory=dict[str, NamedFrequencies])
    coupled_hz: Array | None = None
    undamped_onsets: Onsets | None = None
    damped_onsets: Onsets | None = None
    curve: FrictionCurve | None = None
    trajectory: Trajectory | None = None
    energy: EnergyBalance | None = None
    spectra: Mapping[str, Spectrum] = field(default_factory=dict[str, Spectrum])
    spectra_of: str = "acceleration along x over the second half of the last phase"
    spectra_unit: str = "m/s²"
    spectrogram: Spectrogram | None = None
    spectrogram_of: str = "velocity along x of the first watched point in the last phase"
    spectrogram_unit: str = "m/s"
    spectrogram_start: float = 0.0
    operating_shape: NamedShape | None = None
    unstable_shape: NamedShape | None = None
    mac_by_body: Mapping[str, float] = field(default_factory=dict[str, float])
    agreement: Agreement | None = None
    values: Mapping[str, float] = field(default_factory=dict[str, float])
    value_notes: Mapping[str, str] = field(default_factory=dict[str, str])
    source_places: Mapping[str, str] = field(default_factory=dict[str, str])
    timings: Mapping[str, float] = field(default_factory=dict[str, float])
    versions: Mapping[str, str] = field(default_factory=dict[str, str])
    case_text: str = ""
    created: str = ""
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    shape_vector: ComplexArray | None = None
    friction_energy: Array | None = None
    sensitivities: Sensitivities | None = None
    measures: Countermeasures | None = None
    unsaturated: Unsaturated | None = None
    cycles: Cycles | None = None
    beside_cycles: str = ""

    @property
    def max_frequency_hz(self) -> float:
        """Highest frequency looked at [Hz]."""
        return self.case.modal.max_frequency_hz

    @property
    def onsets(self) -> Onsets | None:
        """The damped onsets, else the undamped ones."""
        return self.undamped_onsets if self.damped_onsets is None else self.damped_onsets

    @property
    def nothing_damps(self) -> bool:
        """Whether the onsets that were asked for with damping had none: the case has none, or leaves it out."""
        return self.damped_onsets is not None and not self.damped_onsets.damped

    @property
    def told_onsets(self) -> tuple[Onsets, ...]:
        """Onsets without damping and with it; those of a case without any once."""
        both = () if self.nothing_damps and self.undamped_onsets is not None else (self.damped_onsets,)
        return tuple(onsets for onsets in (self.undamped_onsets, *both) if onsets is not None)

    def damping_of(self, modes: ComplexModes) -> str:
        """Whether modes are with damping, in words. They know what was asked for, onsets what there is."""
        return "with structural damping" if modes.damped and not self.nothing_damps else "without damping"

    @property
    def dominant_hz(self) -> float | None:
        """Dominant frequency of the run at mu, from the comparison or the operating shape [Hz]; of a run that still
        grows there is none."""
        if self.unsaturated is not None:
            return None
        for comparison in self.agreement.comparisons if self.agreement is not None else ():
            same = self.mu is None or abs(comparison.mu - self.mu) <= 1e-12
            if same and comparison.dominant_frequency_hz is not None:
                return comparison.dominant_frequency_hz
        if "dominant_frequency_hz" in self.values:
            return self.values["dominant_frequency_hz"]
        return None if self.operating_shape is None else self.operating_shape.frequency_hz
