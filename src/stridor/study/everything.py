"""Every analysis of a case in one go: what the report shows and what the files keep."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TypeVar

import numpy as np

from ..agreement import Agreement, Store, mode_shape
from ..case import Case
from ..errors import AnalysisError
from ..modal.complex_modes import ComplexModes
from ..modal.krylov import friction_energy
from ..modal.onsets import Onsets
from ..modal.source import by_receptance
from ..sliding.surfaces import SurfaceSliding
from ..system import System
from ..temporal.shapes import operating_shape
from ..temporal.simulate import Progress
from ..temporal.trajectory import Trajectory
from ..typing import Array, ComplexArray
from . import analyses
from .analyses import BodyModes, Description, RunSummary
from .workspace import Workspace

T = TypeVar("T")
Log = Callable[[str], None]
CURVE_POINTS = 8001
STEADY, COUPLED = "steady sliding", "in contact without friction"
ZOOM = 2.5  # the sweep around the first onset reaches this many times its μ


@dataclass(frozen=True)
class Everything:
    """Results of all analyses of one case; None where an analysis was not possible (see notes).

    sweeps run over the whole friction range, zooms around the first onset. curve: frequency_hz and μ(ω) of the
    undamped receptance. operating: velocity shape of the run at its dominant frequency by body (k, 2);
    shape: that of the mode to compare with, and shape_mode its λ. seconds by analysis. Where modes are not cheap (any
    source but receptance) there are no undamped sweeps, no curve and no operating shape. steady is the equilibrium,
    vector (n,) the mode that grows fastest (or decays slowest) and energy (m,) what friction feeds into it at each
    node. mu is the friction of the case and own the modes there, None where contacts have different coefficients.
    """

    case: Case
    system: System
    description: Description
    bodies: Mapping[str, BodyModes]
    coupled: ComplexModes
    sweep_undamped: ComplexModes | None
    sweep_damped: ComplexModes
    zoom_undamped: ComplexModes | None
    zoom_damped: ComplexModes | None
    onsets_undamped: Onsets | None
    onsets_damped: Onsets
    curve: tuple[Array, Array] | None
    run: Trajectory
    summary: RunSummary
    operating: Mapping[str, ComplexArray] | None
    shape: Mapping[str, ComplexArray] | None
    shape_mode: complex | None
    agreement: Agreement | None
    seconds: Mapping[str, float]
    notes: tuple[str, ...] = field(default=())
    mu: float | None = None
    own: ComplexModes | None = None
    steady: SurfaceSliding | None = None
    vector: ComplexArray | None = None
    energy: Array | None = None


class _Clock:
    """Times of the parts."""

    def __init__(self, log: Log) -> None:
        self.log = log
        self.seconds: dict[str, float] = {}

    def __call__(self, name: str, call: Callable[[], T], what: str = "") -> T:
        """The result of the call, its time kept under ``name``; ``what`` of that it is, said with the name."""
        self.log(f"{name}: {what}" if what else name)
        started = time.perf_counter()
        try:
            return call()
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - started


@dataclass
class _Temporal:
    """What the temporal approach does for a report. notes: what was taken from an earlier call."""

    work: Workspace
    clock: _Clock
    progress: Progress | None
    keep: Callable[[str, object], None]
    before: Trajectory | None
    only: Collection[str] | None
    kept: Store | None
    notes: list[str] = field(default_factory=list[str])

    def run(self) -> Trajectory:
        """The full run; the one before if it is whole, else gone on from where it was cut."""
        before = self.before
        if before is not None:
            how = "gone on from" if before.interrupted else "taken from"
            self.notes.append(f"the full run was {how} an earlier call on the same case")
            self.clock.log(self.notes[-1])
        if before is not None and not before.interrupted:
            return before
        run = self.clock(
            "simulate",
            lambda: analyses.simulate(
                self.work,
                progress=self.progress,
                restart=before,
                checkpoint=lambda part: self.keep("simulate", part),
            ),
        )
        self.keep("simulate", run)
        return run

    def compare(self, run: Trajectory) -> Agreement:
        """The comparison, the run of the case's own friction handed in."""
        own = self.work.own_friction
        result = self.clock(
            "compare",
            lambda: analyses.compare(
                self.work,
                runs={} if own is None else {own: run},
                progress=self.clock.log,
                only=self.only,
                kept=self.kept,
            ),
        )
        self.keep("compare", result)
        return result


def compute_everything(
    problem: Case | Workspace,
    *,
    progress: Progress | None = None,
    log: Log | None = None,
    keep: Callable[[str, object], None] | None = None,
    before: Trajectory | None = None,
    only: Collection[str] | None = None,
    kept: Store | None = None,
) -> Everything:
    """Modes, onsets, the full run, the comparison. keep(name, result) is called as soon as each is there, so
    that nothing computed is lost by what comes after it. before: a full run of the same case, whole or cut, from an
    earlier call; only and kept as `analyses.compare` takes them. Raises what the analyses raise."""
    clock = _Clock(log or _silent)
    keep = keep or _keep_nothing
    work = Workspace.of(problem)
    temporal = _Temporal(work, clock, progress, keep, before, only, kept)
    case, system = work.case("run"), work.structured("run")
    notes: list[str] = []
    description = clock("check", lambda: analyses.describe(work))
    loaded = system.contact_nodes().count and system.in_place().loads
    steady = clock("check", lambda: _or_note(work.steady, notes, "no steady sliding"), STEADY) if loaded else None
    bodies = clock("modes", lambda: analyses.body_modes(work), "of the bodies alone")
    coupled = clock("modes", lambda: _coupled(work), COUPLED)
    modal = _Modal(work, clock, keep)
    own = _own(work, clock)
    vector, mode, energy = (None, None, None) if own is None else _squealing(system, own)
    shape = None if vector is None else mode_shape(system, vector)
    run = temporal.run()
    summary = analyses.summarise(work, run)
    agreement = operating = None
    if not run.interrupted:
        agreement = _or_note(lambda: temporal.compare(run), notes, "no comparison")
        if modal.cheap and (agreement is None or not agreement.interrupted):
            operating, shape, mode = clock("compare", lambda: _shapes(work, own, run, summary), "shapes")
    return Everything(
        case=case,
        system=system,
        description=description,
        bodies=bodies,
        coupled=coupled,
        sweep_undamped=modal.bare,
        sweep_damped=modal.damped,
        zoom_undamped=modal.zooms[0],
        zoom_damped=modal.zooms[1],
        onsets_undamped=modal.onsets_bare,
        onsets_damped=modal.onsets_damped,
        curve=modal.curve,
        run=run,
        summary=summary,
        operating=operating,
        shape=shape,
        shape_mode=mode,
        agreement=agreement,
        seconds=clock.seconds,
        notes=(*temporal.notes, *notes, *(() if steady is None else steady.warnings)),
        mu=work.own_friction,
        own=own,
        steady=steady,
        vector=vector,
        energy=energy,
    )


class _Modal:
    """Sweeps and onsets over friction. cheap: whether the source gives modes at any μ for next to nothing, so that the
    undamped problem, zooms and μ(ω) are there as well; else what tells most for its time."""

    def __init__(self, work: Workspace, clock: _Clock, keep: Callable[[str, object], None]) -> None:
        settings = work.modal
        mus = np.linspace(*settings.friction_range, settings.sweep_points)
        self.cheap = by_receptance(work.system())
        ways = (False, True) if self.cheap else (settings.damped,)

        def each(name: str, call: Callable[[bool], T], what: str = "") -> dict[bool, T]:
            said = {d: what + ("damped" if d else "undamped") for d in ways}
            return {d: clock(name, partial(call, d), said[d]) for d in ways}

        sweeps = each(
            "modes",
            lambda d: analyses.modes(work, mus, max_frequency_hz=settings.max_frequency_hz, damped=d),
            f"{len(mus)} friction coefficients from {mus[0]:g} to {mus[-1]:g}, ",
        )
        # Of an undamped problem the one sweep is both.
        self.bare, self.damped = sweeps.get(False), sweeps[ways[-1]]
        keep("modes", self.damped)
        onsets = each("onsets", lambda d: analyses.onsets(work, damped=d))
        self.onsets_bare, self.onsets_damped = onsets.get(False), onsets[ways[-1]]
        keep("onsets", self.onsets_damped)
        self.zooms: tuple[ComplexModes | None, ComplexModes | None] = (None, None)
        self.curve: tuple[Array, Array] | None = None
        if self.cheap:
            self.zooms = clock("modes", lambda: _zooms(work, onsets[False]), "around the first onset")
            self.curve = clock("onsets", lambda: _curve(work), "friction over frequency")


def _coupled(work: Workspace) -> ComplexModes:
    """In contact without friction, which nothing drives: there is no growth to check."""
    return analyses.modes(work, 0.0, max_frequency_hz=work.modal.max_frequency_hz, damped=False, check=False)


def _own(work: Workspace, clock: _Clock) -> ComplexModes | None:
    """Modes at the friction of the case, None where contacts have different coefficients: no one μ has those modes."""
    mu, limit = work.own_friction, work.modal.max_frequency_hz
    if mu is None:
        return None
    return clock("modes", lambda: analyses.modes(work, mu, max_frequency_hz=limit, vectors="right"), f"at μ = {mu:g}")


def _or_note(call: Callable[[], T], notes: list[str], what: str) -> T | None:
    """The result, or None and a note why there is none."""
    try:
        return call()
    except AnalysisError as error:
        notes.append(f"{what}: {error}")
        return None


def _squealing(
    system: System, modes: ComplexModes
) -> tuple[ComplexArray | None, complex | None, Array | None]:
    """The mode that grows fastest or decays slowest, its λ, and the energy friction feeds in at each node."""
    vibrating = np.flatnonzero(modes.frequency_hz[0] > 0)
    if modes.right is None or not len(vibrating):
        return None, None, None
    fastest = int(vibrating[np.argmax(modes.growth_rate[0][vibrating])])
    energy = friction_energy(system, modes, 0, fastest).per_cycle if system.contact_nodes().count else None
    return modes.right[0, fastest], complex(modes.eigenvalues[0, fastest]), energy


def _silent(text: str) -> None:
    """Say nothing."""
    del text


def _keep_nothing(name: str, result: object) -> None:
    """Leave results in memory alone."""
    del name, result


def _zooms(work: Workspace, found: Onsets) -> tuple[ComplexModes | None, ComplexModes | None]:
    """Fine sweeps from 0 past the first onset, without and with damping: for pictures of branches, as they are."""
    if found.first is None:
        return None, None
    mus = np.linspace(0.0, ZOOM * found.first.mu, 251)
    limit = work.modal.max_frequency_hz
    bare, damped = (analyses.modes(work, mus, max_frequency_hz=limit, damped=d, check=False) for d in (False, True))
    return bare, damped


def _curve(work: Workspace) -> tuple[Array, Array] | None:
    if len(work.system().contacts) != 1:
        return None
    frequency = np.linspace(0.0, work.modal.max_frequency_hz, CURVE_POINTS)[1:]
    return frequency, analyses.friction_curve(work, frequency)


def _shapes(
    work: Workspace, own: ComplexModes | None, run: Trajectory, summary: RunSummary
) -> tuple[Mapping[str, ComplexArray] | None, Mapping[str, ComplexArray] | None, complex | None]:
    """Velocity shape of the run at its dominant frequency, and the mode to hold it against."""
    frequency = summary.dominant_frequency_hz
    if frequency is None or frequency <= 0 or own is None:
        return None, None, None
    assert own.right is not None, "asked for with vectors"
    system = work.system()
    operating = operating_shape(system, analyses.phases_of(work), analyses.settings_of(work), run, frequency)
    candidates = np.flatnonzero(own.unstable[0])
    if not len(candidates):
        candidates = np.arange(len(own.branch))
    nearest = candidates[int(np.argmin(np.abs(own.frequency_hz[0][candidates] - frequency)))]
    return operating, mode_shape(system, own.right[0, nearest]), complex(own.eigenvalues[0, nearest])
