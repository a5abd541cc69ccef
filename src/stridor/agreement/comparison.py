"""Modal against temporal: do both approaches tell the same story?

Small perturbations about steady sliding obey the equations that the complex modes solve, so frequency
and growth must be equal to the accuracy of the time scheme. The full run, with stick, slip and
separation, shows which of the unstable modes responds and how it settles (paper 2.4).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from ..case.repeating import ALIKE
from ..digits import readable
from ..errors import AnalysisError, CaseError
from ..modal.complex_modes import ComplexModes
from ..modal.growing import doubt
from ..modal.options import Options
from ..sliding import nothing_presses
from ..sliding.solution import steady_nodes
from ..system import System
from ..temporal.ended import EndState, ended
from ..temporal.growth import Growth, growth
from ..temporal.schedule import PhaseSpec
from ..temporal.shapes import operating_shape
from ..temporal.signals import Components, Spectrum, low_passed, spectrum
from ..temporal.simulate import Settings, simulate
from ..temporal.trajectory import Trajectory
from ..threads import one_thread
from ..typing import Array, BoolArray, ComplexArray, IntArray
from .critical import compare_critical
from .kept import PartStore, Plain, float_of, growth_data, growth_of, pair_of, perturbation_data, perturbation_of
from .pairs import TOGETHER
from .partner import Partner, partner_of
from .perturbation import modes_as_in_time, perturb, perturbation_step
from .result import NEAR, Agreement, Comparison, Critical, decays_as_none, judge, likeness, overall
from .settled import SettledVelocity, last_rate, settled_of, settled_velocity
from .shapes import by_body, mode_shape, span_assurance
from .small_motion import Perturbation, whole

T = TypeVar("T")
PARTS = ("growth", "run", "critical")
LEAST_PERIODS = 4.0  # of the dominant line, over which growth is fitted
HALVINGS = 3  # of the step, where both disagree
SETTLED = 0.25  # of the difference of both: what a halving may change in time where it does not come of the step
ENOUGH = 40  # steps to the period that a difference must hold with


def _silent(text: str) -> None:
    """Say nothing."""
    del text


def chosen_parts(only: Collection[str] | None, *, critical: bool) -> set[str]:
    """What to compare: growth of small perturbations at each μ, the full run at each μ (which takes the growth to
    be held against), critical friction. Raises CaseError for other names and for nothing."""
    if only is None or not len(only):
        return {"growth", "run"} | ({"critical"} if critical else set())
    for name in only:
        if name not in PARTS:
            raise CaseError("only", name, f"of what is compared: {', '.join(PARTS)}")
    return set(only) | ({"growth"} if "run" in only else set())


@one_thread
def compare(
    system: System,
    phases: Sequence[PhaseSpec],
    settings: Settings,
    mus: Sequence[float],
    *,
    friction_range: tuple[float, float] = (0.0, 1.0),
    max_frequency_hz: float = 40e3,
    critical: bool = True,
    bracket: tuple[float, float] | None = None,
    tolerance: float = 5e-4,
    runs: dict[float, Trajectory] | None = None,
    progress: Callable[[str], None] | None = None,
    only: Collection[str] | None = None,
    kept: PartStore | None = None,
    finished: Callable[[Comparison], None] | None = None,
    options: Options | None = None,
) -> Agreement:
    """Compare both approaches at each μ and, if asked, by their critical friction coefficients.

    runs may hand in full trajectories already computed at some of the μ. only: parts of PARTS instead of all (critical
    False leaves out that one, and with it the solution of the onsets). kept: where finished parts are put, and sought
    before they are computed. finished is called with each μ when it is done. Ctrl-C ends it early, and what is finished
    is returned (``interrupted``). options: of the modes, whose solver and source count here. Raises what the analyses
    raise.
    """
    say = progress or _silent
    parts = chosen_parts(only, critical=critical)
    state = ended(system, phases)
    about, unlike = _about(system, state, mus)
    if kept is not None and about is not system:
        kept = _OfState(kept, state.words)
    at = _At(system, about, unlike, phases, settings, max_frequency_hz, runs or {}, kept, say, options)
    comparisons: list[Comparison] = []
    of_critical = Critical()
    interrupted = False
    try:
        for mu in mus if "growth" in parts else ():
            comparisons.append(at.compare(mu, full="run" in parts))
            if finished is not None:
                finished(comparisons[-1])
        if "critical" in parts:
            of_critical = compare_critical(
                about,
                friction_range=friction_range,
                max_frequency_hz=max_frequency_hz,
                settings=settings,
                bracket=bracket,
                tolerance=tolerance,
                progress=say,
                kept=kept,
                options=options,
            )
    except KeyboardInterrupt:
        interrupted = True
    notes = [
        *([state.note] if about is not system else []),
        *([f"full runs are held against no mode: {unlike}"] if unlike and "run" in parts else []),
        *_notes(system, parts, at.taken),
        *_doubts({f"modes at μ = {c.mu:g}": c.completeness for c in comparisons}),
        *_doubts({"onsets": of_critical.completeness}),
    ]
    if of_critical.why:
        notes.append(of_critical.why)
    return Agreement(
        tuple(comparisons),
        of_critical.modal,
        of_critical.temporal,
        of_critical.bracket,
        overall(comparisons, of_critical, interrupted=interrupted),
        tuple(notes),
        interrupted=interrupted,
    )


def _notes(system: System, parts: Collection[str], taken: Sequence[str]) -> list[str]:
    notes: list[str] = []
    if system.repeating:
        notes.append(f"all of it is of {ALIKE} alone ({', '.join(system.repeating)})")
    if finite := system.finitely_sliding:
        full = "in the full run" if "run" in parts else "in `stridor simulate`"
        notes.append(
            f"contact {', '.join(finite)} slides finitely {full}; modes and perturbations are those of "
            "its reference configuration"
        )
    if taken:
        notes.append(f"taken from an earlier call on the same case, not computed again: {', '.join(taken)}")
    return notes


def _doubts(told: Mapping[str, str]) -> list[str]:
    """What keeps a list of modes or onsets from being known to be whole."""
    return [f"{what}: {said}" for what, said in told.items() if doubt(said)]


def _about(system: System, state: EndState, mus: Sequence[float]) -> tuple[System, str]:
    """The system whose steady sliding runs are held against, and why that is not where they end: they still move, or
    there is none. Where there is none it is that at full loads and speeds."""
    try:
        about = state.of(system)
        if about is not system and len(mus):
            steady = steady_nodes(about, mus[0])
            if nothing_presses(about, steady.normal_force):
                raise AnalysisError("nothing presses the bodies together")
    except AnalysisError as error:
        return system, (
            f"phase {state.phase}, with which they end ({state.words}), has no steady sliding, and modes are those at "
            f"full loads and speeds ({error})"
        )
    return about, state.still_moving()


@dataclass
class _OfState:
    """Parts of a comparison with modes at other loads or speeds than full ones, kept under names of their own."""

    kept: PartStore
    words: str

    def get(self, part: str, mu: float | None) -> Plain | None:
        """What was put there, None if nothing was."""
        return self.kept.get(f"{part} at {self.words}", mu)

    def put(self, part: str, mu: float | None, data: Plain) -> None:
        """Keep a part."""
        self.kept.put(f"{part} at {self.words}", mu, data)


@dataclass
class _At:
    """Both approaches at one μ after the other. about: the system in the state that the run ends with, whose steady
    sliding modes and small perturbations are of; unlike: why it ends in none, "" where it does. taken: what came from
    an earlier call, in words."""

    system: System
    about: System
    unlike: str
    phases: Sequence[PhaseSpec]
    settings: Settings
    limit: float
    runs: dict[float, Trajectory]
    kept: PartStore | None
    say: Callable[[str], None]
    options: Options | None = None

    def __post_init__(self) -> None:
        self.taken: list[str] = []

    def compare(self, mu: float, *, full: bool) -> Comparison:
        """Growth of a small perturbation at μ, and what the full run answers."""
        modes: ComplexModes | None = None
        found = self._recall("growth", mu, _growth_of)
        if found is None:
            self.say(f"both approaches at μ = {mu:g}")
            modes = self._modes(mu)
            found = self._growth(mu, modes)
            self._keep("growth", mu, _growth_data(found))
        if not full:
            return found
        answered = self._recall("run", mu, _run_of)
        if answered is None:
            self.say(f"full run at μ = {mu:g}")
            run = self.runs.get(mu)
            if run is None:
                try:
                    run = whole(simulate(self.system, self.phases, self.settings, mu=mu))
                except AnalysisError as error:
                    if found.modal_eigenvalue.imag != 0.0 or found.modal_eigenvalue.real <= 0.0:
                        raise
                    return replace(found, verdict=f"{found.verdict}; no full run: {error}")
            answered = self._answer(mu, run, self._modes(mu) if modes is None else modes)
            self._keep("run", mu, _run_data(answered))
        near = None if answered.responding is None else found.unstable_hz[answered.responding]
        verdict = likeness(
            found.verdict, answered.dominant, answered.mac, unstable=bool(found.unstable_hz), mode_hz=near,
            below_hz=answered.stronger_below,
        )  # fmt: skip
        if self.unlike:
            verdict = f"{found.verdict}; the full run is held against no mode: {self.unlike}"
        return replace(
            found,
            dominant_frequency_hz=answered.dominant,
            run_growth=answered.fitted,
            mac=None if self.unlike else answered.mac,
            responding=None if self.unlike else answered.responding,
            agrees=None if self.unlike and found.agrees else found.agrees,
            verdict=verdict,
            settled=answered.settled,
            unsettled=answered.unsettled,
            stronger_below_hz=answered.stronger_below,
        )

    def _modes(self, mu: float) -> ComplexModes:
        return modes_as_in_time(self.about, mu, 1.02 * self.limit, self.options)

    def _growth(self, mu: float, modes: ComplexModes) -> Comparison:
        unstable = _unstable(modes, self.limit)
        own = modes if self.settings.system(self.about) is self.about else None
        diverges = bool(np.any(modes.eigenvalues[0][unstable].imag == 0.0))
        if diverges:
            # Nothing vibrates about what runs away: a march tells no rate to hold against the mode's.
            perturbation = Perturbation(mu, 0j, np.zeros(0), 1.0, Components(np.zeros(0, dtype=complex), np.zeros(0)))
        else:
            perturbation = perturb(
                self.about, mu, settings=self.settings, max_frequency_hz=self.limit, modes=own, shape=True
            )
        lam = modes.eigenvalues[0]
        if not len(lam):
            raise AnalysisError(f"no mode below {self.limit:g} Hz, so there is nothing to compare")
        if diverges:
            partner = Partner(int(unstable[lam[unstable].imag == 0.0][0]), unstable=True)
        else:
            partner = partner_of(lam, unstable, perturbation)
        fastest = complex(lam[unstable[0]]) if diverges else 0j
        one = self._judged(mu, modes, unstable, perturbation, partner, fastest if fastest.imag else None)
        verdict, agrees = one.verdict, one.agrees
        if one.open_to_steps and not diverges:
            verdict, agrees = self._resolved(mu, modes, unstable, perturbation, one, own)
        return Comparison(
            mu=mu,
            modal_eigenvalue=one.here,
            unstable_hz=tuple(float(f) for f in modes.frequency_hz[0][unstable]),
            unstable_growth=tuple(float(g) for g in modes.growth_rate[0][unstable]),
            perturbation=perturbation,
            dominant_frequency_hz=None,
            run_growth=None,
            frequency_error=float(one.frequency),
            growth_rate_error=float(one.rate),
            mac=None,
            responding=None,
            agrees=agrees,
            verdict=verdict,
            growth_mac=one.shape,
            completeness=modes.completeness[0],
        )

    def _judged(
        self, mu: float, modes: ComplexModes, unstable: IntArray, perturbation: Perturbation, partner: Partner,
        faster: complex | None = None,
    ) -> _Judged:  # fmt: skip
        """What a perturbation in time is held against, how far both are apart, and the verdict (`judge`)."""
        lam = modes.eigenvalues[0]
        here = complex(lam[partner.column])
        frequency = abs(perturbation.eigenvalue.imag - here.imag) / max(abs(here.imag), 1e-300)
        rate = abs(perturbation.eigenvalue.real - here.real) / max(abs(here.real), 1e-300)
        assert modes.right is not None, "asked for with vectors"
        alike = np.flatnonzero(_alike(lam, here))
        shape = None if perturbation.shape is None else perturbation.shape.likeness(modes.right[0, alike])
        agrees, verdict = judge(
            mu, partner.unstable, here, perturbation, frequency, rate, modes.completeness[0], shape,
            shape_asked=bool(self.about.lines or self.about.solids),
            last=None if len(unstable) else _last(modes, self.limit), rival=partner.rival, hidden=partner.hidden,
            faster=faster,
        )  # fmt: skip
        # Beside a double root a step moves the roots of what it marches by the root of its error.
        foreign = agrees is None and decays_as_none(perturbation, frequency, rate) and not partner.unstable
        return _Judged(here, frequency, rate, shape, agrees, verdict, agrees is False or foreign)

    def _resolved(
        self, mu: float, modes: ComplexModes, unstable: IntArray, coarse: Perturbation, first: _Judged,
        own: ComplexModes | None,
    ) -> tuple[str, bool | None]:  # fmt: skip
        """A verdict that both disagree, or that what decays in time is no mode, with shorter steps. It stands where the
        motion in time no longer changes with the step, of enough steps to the period, and differs all the same; else
        the step parts both, and nothing is decided."""
        step = perturbation_step(self.about, self.settings)
        before, one, told = coarse, first, ""
        for halvings in range(1, HALVINGS + 1):
            finer = replace(self.settings, step=step / 2**halvings)
            try:
                fine = perturb(self.about, mu, settings=finer, max_frequency_hz=self.limit, modes=own, shape=True)
            except AnalysisError as error:
                told = f"with steps of {step / 2**halvings:.3g} s nothing is told ({error})"
                break
            if not fine.shows or fine.untold:
                told = f"with steps of {step / 2**halvings:.3g} s growth in time is not told"
                break
            one = self._judged(mu, modes, unstable, fine, partner_of(modes.eigenvalues[0], unstable, fine))
            told = (
                f"with steps of {step / 2**halvings:.3g} s growth in time is {readable(fine.growth_rate, 4)} 1/s of "
                f"{readable(one.here.real, 4)}"
            )
            if not one.open_to_steps:
                break
            apart = abs(fine.eigenvalue - one.here)
            turns = 2 * np.pi / (step / 2**halvings * max(abs(fine.eigenvalue), abs(one.here), 1e-300))
            if abs(fine.eigenvalue - before.eigenvalue) <= SETTLED * apart and turns >= ENOUGH:
                return first.verdict, first.agrees
            before = fine
        last = max(abs(before.eigenvalue), abs(one.here), 1e-300)
        least = min(step / 8, 2 * np.pi / (2 * ENOUGH * last))
        return f"{first.verdict}; {told}: the step parts them, take temporal.step = {least:.2g} or less", None

    def _answer(self, mu: float, run: Trajectory, modes: ComplexModes) -> _Answer:
        dominant, fitted = dominant_response(run, self.limit)
        found, why = settled_velocity(run, dominant, fitted, last_rate(modes))
        unstable = _unstable(modes, self.limit)
        below = None if dominant is None else stronger_below(run, self.limit)
        if below is not None:  # the line is not what it answers with
            return _Answer(dominant, fitted, None, None, found, why, below)
        responding = _responding(modes, unstable, dominant) if dominant else None
        if dominant is None or responding is None or not (self.system.lines or self.system.solids):
            # Without a mode that responds, or without bodies, there is no shape to hold against another.
            return _Answer(dominant, fitted, responding, None, found, why)
        assert modes.right is not None, "asked for with vectors"
        shape = operating_shape(self.system, self.phases, self.settings, run, dominant, mu=mu)
        lam = modes.eigenvalues[0]
        here = lam[unstable[responding]]
        alike = [mode_shape(self.system, modes.right[0, k]) for k in np.flatnonzero(_alike(lam, here))]
        spanned = np.stack([by_body({name: one[name] for name in shape}) for one in alike], axis=1)
        mac = span_assurance(by_body(shape), spanned)
        return _Answer(dominant, fitted, responding, mac, found, why)

    def _recall(self, part: str, mu: float, read: Callable[[float, Plain], T]) -> T | None:
        data = None if self.kept is None else self.kept.get(part, mu)
        if data is None:
            return None
        try:
            found = read(mu, data)
        except (KeyError, TypeError, ValueError):
            return None  # damaged, or of another version: computed again
        self.taken.append(f"{part} at μ = {mu:g}")
        self.say(self.taken[-1] + " is there from an earlier call on the same case")
        return found

    def _keep(self, part: str, mu: float, data: Plain) -> None:
        if self.kept is not None:
            self.kept.put(part, mu, data)


@dataclass(frozen=True)
class _Judged:
    """A perturbation in time beside the mode it is held against: λ of that, by which shares frequency and rate are
    apart, likeness, agreement, verdict; open_to_steps: whether shorter steps may say otherwise."""

    here: complex
    frequency: float
    rate: float
    shape: float | None
    agrees: bool | None
    verdict: str
    open_to_steps: bool


@dataclass(frozen=True)
class _Answer:
    """What the full run answers with: dominant frequency [Hz], fit of its growth, the unstable mode, its likeness; what
    it has settled to, else why not; below which frequency [Hz] something is stronger that it is too short to tell."""

    dominant: float | None
    fitted: Growth | None
    responding: int | None
    mac: float | None
    settled: SettledVelocity | None
    unsettled: str
    stronger_below: float | None = None


def _alike(lam: ComplexArray, here: complex) -> BoolArray:
    """Which modes are one to the digits of a signal in time: any combination of them may grow."""
    return np.abs(lam - here) <= TOGETHER * abs(here)


def _unstable(modes: ComplexModes, limit: float) -> IntArray:
    """Columns of the unstable modes up to the limit [Hz], the fastest first."""
    columns = np.flatnonzero(modes.unstable[0] & (modes.frequency_hz[0] <= limit))
    return columns[np.argsort(modes.eigenvalues[0][columns].real)[::-1]]


def _last(modes: ComplexModes, limit: float) -> complex | None:
    """λ of the mode up to the limit [Hz] that vibrates and dies out last."""
    lam = modes.eigenvalues[0][(modes.frequency_hz[0] > 0.0) & (modes.frequency_hz[0] <= limit)]
    return complex(lam[np.argmax(lam.real)]) if len(lam) else None


def _growth_data(c: Comparison) -> Plain:
    return {
        "modal": pair_of(c.modal_eigenvalue),
        "unstable_hz": list(c.unstable_hz),
        "unstable_growth": list(c.unstable_growth),
        "perturbation": perturbation_data(c.perturbation),
        "frequency_error": c.frequency_error,
        "growth_rate_error": c.growth_rate_error,
        "growth_mac": c.growth_mac,
        "completeness": c.completeness,
        "agrees": c.agrees,
        "verdict": c.verdict,
    }


def _growth_of(mu: float, data: Plain) -> Comparison:
    here, perturbation = complex(*data["modal"]), perturbation_of(mu, data["perturbation"])
    frequency, rate = float(data["frequency_error"]), float(data["growth_rate_error"])
    unstable = tuple(float(f) for f in data["unstable_hz"])
    told, agrees, verdict = str(data["completeness"]), data["agrees"], str(data["verdict"])
    return Comparison(
        mu, here, unstable, tuple(float(g) for g in data["unstable_growth"]), perturbation, None, None, frequency, rate,
        None, None, agrees, verdict, float_of(data, "growth_mac"), told,
    )  # fmt: skip


def _run_data(a: _Answer) -> Plain:
    return {
        "dominant_frequency_hz": a.dominant,
        "growth": growth_data(a.fitted),
        "responding": a.responding,
        "mac": a.mac,
        "settled": None if a.settled is None else a.settled.data,
        "unsettled": a.unsettled,
        "stronger_below_hz": a.stronger_below,
    }


def _run_of(mu: float, data: Plain) -> _Answer:
    del mu
    responding = data["responding"]
    return _Answer(
        float_of(data, "dominant_frequency_hz"),
        growth_of(data["growth"]),
        None if responding is None else int(responding),
        float_of(data, "mac"),
        settled_of(data["settled"]),
        str(data["unsettled"]),
        float_of(data, "stronger_below_hz"),
    )


def _responding(modes: ComplexModes, unstable: IntArray, dominant: float) -> int | None:
    """Unstable mode whose frequency is nearest to the run's dominant one, within 5 %."""
    if not len(unstable):
        return None
    distance = np.abs(modes.frequency_hz[0][unstable] - dominant) / dominant
    nearest = int(np.argmin(distance))
    return nearest if distance[nearest] < NEAR else None


def dominant_response(run: Trajectory, max_frequency_hz: float) -> tuple[float | None, Growth | None]:
    """Dominant frequency [Hz] of the last phase and the growth of that line.

    Taken from the velocity of the first watched point (what a body radiates follows velocity); without a
    watched point from the slip speed of the first contact. The spectrum is that of the second half. No growth is
    given where it could be fitted over less than LEAST_PERIODS of that line.
    """
    signal = _response(run)
    if signal is None:
        return None, None
    filtered = low_passed(signal, run.sampling, max_frequency_hz)
    frequency, amplitude = spectrum_of_end(filtered, run.sampling, 0.5).line()
    if amplitude == 0.0:
        return None, None
    fitted = growth(filtered, run.sampling, frequency)
    # A rate from part of a period is the start of the motion, not its growth.
    return frequency, fitted if (fitted.end - fitted.start) * frequency >= LEAST_PERIODS else None


def _response(run: Trajectory) -> Array | None:
    """The signal (k,) of the last phase in which `dominant_response` looks; None where there is too little of it."""
    if not run.phases or not len(run.time):
        return None
    part = run.phase_slice()
    if len(run.time[part]) < 64:
        return None
    if run.watch_names:
        return run.velocity[part, 0, int(np.argmax(np.ptp(run.velocity[part, 0], axis=0)))]
    return run.slip_speed[part, 0] if run.contact_names else None


def stronger_below(run: Trajectory, max_frequency_hz: float) -> float | None:
    """Frequency [Hz] below which something swings or drifts that is stronger than the dominant line and that the second
    half of the last phase is too short to resolve; None where there is no such thing, or no dominant line."""
    signal = _response(run)
    if signal is None:
        return None
    return spectrum_of_end(low_passed(signal, run.sampling, max_frequency_hz), run.sampling, 0.5).stronger_below()


def spectrum_of_end(filtered: Array, sampling: float, share: float) -> Spectrum:
    """Spectrum of the last share of a signal (k,) sampled every ``sampling`` [s] that has been low-passed."""
    return spectrum(filtered[int(len(filtered) * (1.0 - share)) :], sampling)
