"""Every analysis of a case in one go: what the report shows and what the files keep."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeVar

import numpy as np

from ..agreement import Agreement, PartStore, mode_shape
from ..agreement.kept import Plain
from ..case import Case
from ..case.matrix_checks import MU
from ..errors import AnalysisError
from ..modal.complex_modes import ComplexModes
from ..modal.onsets import Onsets
from ..sliding import anything_acts
from ..sliding.result import SteadySliding
from ..system import System
from ..temporal.ended import ended
from ..temporal.shapes import operating_shape
from ..temporal.simulate import Progress
from ..temporal.trajectory import Trajectory
from ..typing import Array, ComplexArray
from . import analyses
from .analyses import BodyModes, Description, RunSummary
from .clock import Clock, Log, Shelf
from .measures import Countermeasures
from .modal_parts import ModalParts
from .parts import RunParts, chosen_parts
from .saturation import Unsaturated, unsaturated
from .sensitivities import Sensitivities
from .workspace import Workspace

T = TypeVar("T")
STEADY = "steady sliding"


@dataclass(frozen=True)
class Everything:
    """Results of all analyses of one case; None where an analysis was not asked for or not possible (see notes).

    sweeps run over the whole friction range, zooms around the first onset. curve: frequency_hz and μ(ω) of the
    undamped receptance. operating: velocity shape of the run at its dominant frequency by body (k, 2);
    shape: that of the mode to compare with, and shape_mode its λ. seconds by analysis. Where modes are not cheap (any
    source but receptance) there are no undamped sweeps, no curve and no operating shape. steady is the equilibrium,
    vector (n,) the mode that grows fastest (or decays slowest) and energy (m,) what friction feeds into it at each
    node. mu is the friction of the case and own the modes there, None where contacts have different coefficients.
    taken: names under which something came from an earlier call on the same case, taken_parts what it was: the rest was
    computed, or not asked for. unsaturated: of a run that still grows, whose loudest
    line is that of its start: it has no dominant frequency, and nothing of it is compared.
    """

    case: Case
    system: System
    description: Description
    bodies: Mapping[str, BodyModes]
    coupled: ComplexModes | None
    sweep_undamped: ComplexModes | None
    sweep_damped: ComplexModes | None
    zoom_undamped: ComplexModes | None
    zoom_damped: ComplexModes | None
    onsets_undamped: Onsets | None
    onsets_damped: Onsets | None
    curve: tuple[Array, Array] | None
    run: Trajectory | None
    summary: RunSummary | None
    operating: Mapping[str, ComplexArray] | None
    shape: Mapping[str, ComplexArray] | None
    shape_mode: complex | None
    agreement: Agreement | None
    seconds: Mapping[str, float]
    notes: tuple[str, ...] = field(default=())
    mu: float | None = None
    own: ComplexModes | None = None
    steady: SteadySliding | None = None
    vector: ComplexArray | None = None
    energy: Array | None = None
    sensitivities: Sensitivities | None = None
    measures: Countermeasures | None = None
    unsaturated: Unsaturated | None = None
    taken: tuple[str, ...] = ()
    taken_parts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass
class _Temporal:
    """What the temporal approach does for a report."""

    work: Workspace
    parts: RunParts
    clock: Clock
    progress: Progress | None
    keep: Callable[[str, object], None]
    before: Trajectory | None
    kept: PartStore | None
    notes: list[str]

    def run(self) -> Trajectory | None:
        """The full run; the one before if it is whole, else gone on from where it was cut."""
        before = self.before
        if before is not None and not before.interrupted:
            self.clock.took("simulate", "the full run")
            return before
        if "simulate" not in self.parts:
            return None
        if before is not None:
            self.notes.append("the full run was gone on from an earlier call on the same case")
            self.clock.log(self.notes[-1])
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

    def compare(self, run: Trajectory | None, *, growing: bool) -> Agreement | None:
        """The comparison, the run of the case's own friction handed in; of what is not asked for, what is there.
        growing: that run still grows, so that it answers with no mode."""
        wanted, own = "compare" in self.parts, self.work.own_friction
        alone = set(self.work.comparison.mu) <= {own}
        answers = not (growing and alone) and (run is not None or not wanted)
        parts = self.parts.comparison(critical=self.work.comparison.critical, run=answers)
        kept = self.kept if wanted or self.kept is None else _Finished(self.kept)
        if not parts or (kept is None and not wanted):
            return None
        runs = {} if own is None or run is None else {own: run}
        try:
            say = self.clock.log if wanted else _silent
            call = partial(analyses.compare, self.work, runs=runs, progress=say, only=parts, kept=kept)
            result = self.clock("compare", call) if wanted else call()
        except (_MissingError, AnalysisError):
            if wanted:
                raise
            return None
        if not wanted:
            self.clock.took("compare")
        self.keep("compare", result)
        return result


class _MissingError(Exception):
    """A part of the comparison is not there."""


@dataclass
class _Finished:
    """Parts that are there, and nothing else."""

    kept: PartStore

    def get(self, part: str, mu: float | None) -> Plain:
        """The part. Raises _MissingError where it would have to be computed."""
        found = self.kept.get(part, mu)
        if found is None:
            raise _MissingError
        return found

    def put(self, part: str, mu: float | None, data: Plain) -> None:
        """Nothing is computed."""


def compute_everything(
    problem: Case | Workspace,
    *,
    parts: RunParts | None = None,
    mu: float | None = None,
    progress: Progress | None = None,
    log: Log | None = None,
    keep: Callable[[str, object], None] | None = None,
    before: Trajectory | None = None,
    kept: PartStore | None = None,
    shelf: Shelf | None = None,
) -> Everything:
    """Modes, onsets, the full run, the comparison, or the parts of them that are asked for. keep(name, result) is
    called as soon as each is there, so that nothing computed is lost by what comes after it.

    What is there from an earlier call on the same case is taken, asked for or not: before, a full run, whole or cut;
    kept, parts of the comparison; shelf, those of the modal approach. mu: of the modes at one friction coefficient
    instead of the case's own, to which the run in time belongs, which is then left out. Raises what the analyses raise.
    """
    parts = parts or chosen_parts()
    clock, keep = Clock(log or _silent, shelf), keep or _keep_nothing
    work, notes = Workspace.of(problem), list[str]()
    case = work.case("run")
    timed = "simulate" in parts or "compare" in parts
    system = work.structured("run") if timed else work.system(mu)
    own = mu if mu is not None else _own_friction(work)
    description = clock("check", lambda: analyses.describe(work))
    loaded = system.contact_nodes().count and anything_acts(system)
    steady = None
    if loaded:
        steady = clock("check", lambda: _or_note(lambda: work.steady(mu), notes, "no steady sliding"), STEADY)
    modal = ModalParts(work, own, parts, clock, keep, notes)
    temporal = _Temporal(work, parts, clock, progress, keep, before, kept, notes)
    run = None if mu is not None else temporal.run()
    summary = None if run is None else analyses.summarise(work, run)
    answering = None if run is None else _answering(work, run, modal.own, notes)
    still = None if run is None else unsaturated(work, run, answering)
    if still is not None and summary is not None:
        summary = replace(summary, dominant_frequency_hz=None, stronger_below_hz=None)
    shape, mode, operating, agreement = _shape(system, modal), _eigenvalue(modal), None, None
    if mu is None and (run is None or not run.interrupted):
        agreement = _or_note(lambda: temporal.compare(run, growing=still is not None), notes, "no comparison")
        through = modal.cheap and (agreement is None or not agreement.interrupted)
        if through and run is not None and summary is not None and still is None:
            shapes = lambda: _shapes(work, answering, run, summary)  # noqa: E731
            found = clock.part("compare", "shapes", shapes, "shapes", wanted="compare" in parts)
            operating, shape, mode = found or (None, shape, mode)
    return Everything(
        case=case,
        system=system,
        description=description,
        bodies=modal.bodies,
        coupled=modal.coupled,
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
        notes=(*_taken(clock.taken), *notes, *_undrawn(system, modal), *(() if steady is None else steady.warnings)),
        mu=own,
        own=modal.own,
        steady=steady,
        vector=None if modal.squealing is None else modal.squealing.vector,
        energy=None if modal.squealing is None else modal.squealing.energy,
        sensitivities=modal.sensitivities,
        measures=modal.measures,
        unsaturated=still,
        taken=tuple(clock.taken),
        taken_parts={name: tuple(w for w in what if w) for name, what in clock.taken.items()},
    )


def _answering(work: Workspace, run: Trajectory, own: ComplexModes | None, notes: list[str]) -> ComplexModes | None:
    """The modes that a run is held against: those at the friction of the case, of the steady sliding that the run ends
    with; None where that is none, or still changes."""
    state = ended(work.system(), analyses.phases_of(work))
    if own is None or run.interrupted or not (state.words or state.moving):
        return own
    if moving := state.still_moving():
        notes.append(f"the run is held against no mode: {moving}")
        return None
    if not state.words:
        return own
    notes.append(f"beside the run, {state.note}")
    mu = work.own_friction
    return _or_note(lambda: analyses.modes(work.ending(), mu, vectors="right"), notes, "no modes beside the run")


def _own_friction(work: Workspace) -> float | None:
    """The friction coefficient of the case; None where contacts have different ones, or where matrices depend on one
    that nothing gives."""
    if work.varies and not work.has_contacts and MU not in work.case("run").parameters:
        return None
    return work.own_friction


def _taken(taken: Mapping[str, list[str]]) -> list[str]:
    """What came from an earlier call, in one sentence."""
    if not taken:
        return []
    named = ", ".join(f"{name} ({'; '.join(w for w in what if w)})" for name, what in taken.items())
    return [f"Taken from an earlier call on the same case, not computed again: {named}.".replace(" ()", "")]


def _undrawn(system: System, modal: ModalParts) -> list[str]:
    """What is said where there are shapes, and nothing tells where the nodes are."""
    drawn = {body.name for body in (*system.lines, *system.solids)}
    missing = [name for name in modal.work.case("run").imported if name not in drawn]
    if modal.own is None or not missing:
        return []
    return [f"no shapes of {', '.join(missing)}: it has no coordinates of nodes, which a mesh and labels give"]


def _shape(system: System, modal: ModalParts) -> Mapping[str, ComplexArray] | None:
    return None if modal.squealing is None else mode_shape(system, modal.squealing.vector)


def _eigenvalue(modal: ModalParts) -> complex | None:
    return None if modal.squealing is None else modal.squealing.eigenvalue


def _or_note(call: Callable[[], T], notes: list[str], what: str) -> T | None:
    """The result, or None and a note why there is none."""
    try:
        return call()
    except AnalysisError as error:
        notes.append(f"{what}: {error}")
        return None


def _silent(text: str) -> None:
    """Say nothing."""
    del text


def _keep_nothing(name: str, result: object) -> None:
    """Leave results in memory alone."""
    del name, result


def _shapes(
    work: Workspace, own: ComplexModes | None, run: Trajectory, summary: RunSummary
) -> tuple[Mapping[str, ComplexArray] | None, Mapping[str, ComplexArray] | None, complex | None]:
    """Velocity shape of the run at its dominant frequency, and the mode to hold it against."""
    frequency = summary.dominant_frequency_hz
    if frequency is None or frequency <= 0 or own is None or own.right is None:
        return None, None, None
    system = work.system()
    operating = operating_shape(system, analyses.phases_of(work), analyses.settings_of(work), run, frequency)
    candidates = np.flatnonzero(own.unstable[0])
    if not len(candidates):
        candidates = np.arange(len(own.branch))
    nearest = candidates[int(np.argmin(np.abs(own.frequency_hz[0][candidates] - frequency)))]
    return operating, mode_shape(system, own.right[0, nearest]), complex(own.eigenvalues[0, nearest])
