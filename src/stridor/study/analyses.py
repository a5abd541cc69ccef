"""A case in, a result out: the calls behind `import stridor as st` and behind every verb.

Each takes a Case, the path of its file, a System alone (with the settings that a case has by default), or a Workspace,
which keeps what was computed on the way for the next call.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import Any, Literal, overload

import numpy as np

from ..agreement import Agreement, Comparison, PartStore
from ..agreement import compare as compare_system
from ..asking import FUNCTION, NUMBER, NUMBERS, SWITCH, SWITCH_OR_NONE, takes
from ..case.matrix_checks import MU
from ..errors import AnalysisError, CaseError
from ..errors import Problem as Wrong
from ..interrupts import at_once
from ..modal.complex_modes import ComplexModes
from ..modal.full import ParametricOnsets, full_modes, full_onsets
from ..modal.onsets import Onsets
from ..modal.over_friction import modes_of_band, onsets_of_band
from ..modal.painleve import steps_undetermined
from ..modal.receptance_modes import prepare
from ..modal.source import by_receptance, require_full
from ..sliding import taken_as_closed
from ..sliding.result import SteadySliding
from ..sliding.solution import other_equilibria
from ..system import System
from ..temporal.settings import Settings
from ..temporal.simulate import Checkpoint, Progress, plan
from ..temporal.simulate import simulate as march
from ..temporal.trajectory import Trajectory
from ..typing import Array
from .along import onsets_along
from .asked import require_band, require_choice, require_count, require_frequency, require_friction, require_range
from .body_modes import BodyModes, body_modes
from .description import Description, describe
from .fingerprint import check_restart, fingerprint
from .pressed import require_pressed_in_time
from .provenance import provenance
from .run_summary import RunSummary, first_regime, summarise
from .settings import phases_of, settings_of
from .touching import decided_by_meshes
from .workspace import Problem, Workspace, frictions_by_contact, in_proportion

__all__ = [
    "BodyModes",
    "Description",
    "RunSummary",
    "body_modes",
    "compare",
    "describe",
    "first_regime",
    "friction_curve",
    "modes",
    "onsets",
    "phases_of",
    "settings_of",
    "simulate",
    "steady_sliding",
    "summarise",
]

MOST_BYTES = 8e9  # of records kept in memory


@takes(damped=SWITCH_OR_NONE, check=SWITCH, residuals=SWITCH, progress=FUNCTION)
def modes(
    problem: Problem,
    mu: float | Sequence[float] | Array | None = None,
    *,
    count: int | None = None,
    max_frequency_hz: float | None = None,
    band_hz: tuple[float, float] | None = None,
    damped: bool | None = None,
    vectors: bool | Literal["right"] = False,
    check: bool = True,
    residuals: bool = True,
    progress: Progress | None = None,
) -> ComplexModes:
    """Complex modes at one or many friction coefficients (default: the problem's own, of each contact its own).

    All modes with frequencies up to modal.max_frequency_hz are found; kept are the ``count`` lowest (default
    modal.modes) and every unstable one, with max_frequency_hz all up to that. band_hz: of all found, those between two
    frequencies, under the same numbers; without ``count`` every one of them. check: whether what grows in the band is
    sought anew in the full problem (`checked_modes`), which decides nothing else: with it and without, each of several
    μ has the nodes that touch there, and NaN where there is no steady sliding (`ComplexModes.solved`). residuals=False,
    where nothing is checked, leaves backward errors out where they cost something: for pictures
    (`ComplexModes.residual`). progress is called with the number of friction coefficients done and of all. A workspace
    keeps the modes, with vectors those at one μ. Raises CaseError for a bad μ, AnalysisError where the steady sliding
    state exists at none of them.
    """
    mu = require_friction(mu)
    require_frequency(max_frequency_hz)
    if count is not None:
        require_count(count, "count")
    require_choice(vectors, "vectors", (False, True, "right"))
    work = Workspace.of(problem)
    values, system = (_own(work) if mu is None else (mu, None))
    damped = work.modal.damped if damped is None else damped
    band = max_frequency_hz or work.modal.max_frequency_hz
    require_band(band_hz, band)
    what = "modes" if system is None else "modes of own"
    asked = (what, *np.shape(values), *np.ravel(values).tolist(), band, damped, check)
    # What has vectors serves who wants none.
    more = {False: (False, "right", True), "right": ("right", True), True: (True,)}[vectors]
    judged = residuals or check
    served = [(*asked, v, j) for v in more for j in ((True,) if judged else (False, True))]
    result = next((r for key in served if (r := work.answers.known(key)) is not None), None)
    if result is None:
        result = _modes(
            work, values, band, damped=damped, vectors=vectors, check=check, residuals=judged, progress=progress,
            in_proportion=system,
        )  # fmt: skip
        # What was cut short is not for others, nor are vectors of a sweep, which are large.
        if not result.interrupted and (not vectors or len(result.mu) == 1):
            work.answers.keep((*asked, vectors, judged), result)
    result = replace(result, right=result.right if vectors else None, left=result.left if vectors is True else None)
    if band_hz is not None:
        result = result.between(*band_hz)
    if count is None:
        count = work.modal.modes if band_hz is None else len(result.branch)
    return result if max_frequency_hz is not None else result.lowest(count)


def _modes(
    work: Workspace,
    values: float | Sequence[float] | Array,
    band: float,
    *,
    damped: bool,
    vectors: bool | Literal["right"],
    check: bool,
    residuals: bool,
    progress: Progress | None,
    in_proportion: System | None,
) -> ComplexModes:
    """Every mode of the band: followed from μ = 0 and checked, or where matrices depend on μ sought at each."""
    started, options = time.perf_counter(), work.options
    if work.varies:
        require_full(options.source)
        own = work.own_friction if work.has_contacts else None
        result = full_modes(
            work.system, values, count=None, max_frequency_hz=band, damped=damped, vectors=vectors, options=options,
            own=own, progress=progress,
        )  # fmt: skip
        notes = _held_by_factors(work, own)
    else:
        system = work.system() if in_proportion is None else in_proportion
        own = work.own_friction if work.has_contacts and in_proportion is None else None
        result = modes_of_band(
            system, values, band, damped=damped, vectors=vectors, own=own, options=options, progress=progress,
            check=check, residuals=residuals, carried=work.handed,
        )  # fmt: skip
        notes = taken_as_closed(system)
        if check:
            single = float(result.mu[0]) if len(result.mu) == 1 else None
            notes = (*notes, *decided_by_meshes(system, single, options.solver))
        notes = (*notes, *system.tie_words)
    notes = (*notes, *(work.one_for_all if in_proportion is None else _said_of_own(work)))
    made = provenance(work, "modes", time.perf_counter() - started, damped=damped)
    return replace(result, notes=(*result.notes, *notes), provenance=made)


def _own(work: Workspace) -> tuple[float, System | None]:
    """The friction coefficient of all contacts, or where the case gives them different ones the largest, and the system
    in which each has its own at it."""
    found = None
    if work.own_friction is None and not work.varies:
        found = work.system().once("in proportion", lambda: in_proportion(work.system()))
    return (work.one_friction(), None) if found is None else (found[1], found[0])


def _said_of_own(work: Workspace) -> tuple[str, ...]:
    own = frictions_by_contact(work.system())
    given = ", ".join(f"{name} {value:g}" for name, value in own.items())
    return (f"each contact has its own friction coefficient ({given}); the μ that is named is the largest",)


def _held_by_factors(work: Workspace, own: float | None) -> tuple[str, ...]:
    """What is said where factors of matrices depend on μ and there are contacts beside them."""
    if not work.has_contacts:
        return ()
    at = "at the lowest μ" if own is None else f"at μ = {own:g}"
    return (
        f"Factors of imported matrices depend on mu: the contact nodes that touch in steady sliding {at} are held at "
        "every μ where several are asked for.",
    )


def steady_sliding(problem: Problem, mu: float | None = None) -> SteadySliding:
    """The equilibrium under load and friction that both approaches start from, node by node of every contact.

    mu replaces the friction coefficient of every contact that has friction. Where more than one set of a few contact
    nodes is in equilibrium, ``others`` has them and a warning names them: how many nodes of which contacts touch, and
    the sum of their normal forces. Raises AnalysisError where there is none.
    """
    require_friction(mu, several=False)
    work = Workspace.of(problem)
    found, system = work.steady(mu), work.system(mu)
    others = other_equilibria(system, found, mu)
    if mu is not None and work.one_for_all:
        found = replace(found, warnings=(*found.warnings, *work.one_for_all))
    if not others:
        return found
    as_well = "; with ".join(other.words for other in others)
    said = (
        f"there is more than one equilibrium at this friction: as well with {as_well}; which it is depends on how load "
        "and friction came about"
    )
    return replace(found, warnings=(*found.warnings, said), others=tuple(others))


@overload
def onsets(
    problem: Problem,
    friction_range: tuple[float, float] | None = None,
    *,
    along: None = None,
    max_frequency_hz: float | None = None,
    band_hz: tuple[float, float] | None = None,
    damped: bool | None = None,
    check: bool = True,
) -> Onsets: ...
@overload
def onsets(
    problem: Problem,
    friction_range: tuple[float, float] | None = None,
    *,
    along: str,
    max_frequency_hz: float | None = None,
) -> ParametricOnsets: ...
@takes(damped=SWITCH_OR_NONE, check=SWITCH)
def onsets(
    problem: Problem,
    friction_range: tuple[float, float] | None = None,
    *,
    along: str | None = None,
    max_frequency_hz: float | None = None,
    band_hz: tuple[float, float] | None = None,
    damped: bool | None = None,
    check: bool = True,
) -> Onsets | ParametricOnsets:
    """Every critical friction coefficient in range (defaults from [modal]), or every critical value of another number.

    along: a number of the case by its path ("bodies.beam1.length") or a parameter of its matrices; the range is then
    that of this number. band_hz: of all found, those with a frequency between these. check: whether what grows at both
    ends of the range is sought anew in the full problem (`checked_onsets`). Raises CaseError for a range or a number
    that is none.
    """
    if along is not None:
        if not isinstance(along, str):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise CaseError("along", along, "the path of a number of the case, or a parameter of its matrices")
        case = Workspace.of(problem).case("along")
        if along != MU or MU in case.parameters:
            return onsets_along(case, along, friction_range, max_frequency_hz=max_frequency_hz)
    started = time.perf_counter()
    require_frequency(max_frequency_hz)
    work = Workspace.of(problem)
    given = work.modal.friction_range if friction_range is None else friction_range
    between = require_range(given, "friction_range", least=0.0)
    require_friction(between[1], "friction_range")
    limit = max_frequency_hz or work.modal.max_frequency_hz
    require_band(band_hz, limit)
    damped = work.modal.damped if damped is None else damped
    result = found_onsets(work, between, limit, damped=damped, check=check)
    made = provenance(work, "onsets", time.perf_counter() - started)
    result = replace(result, provenance=made)
    return result if band_hz is None else result.between(*band_hz)


def found_onsets(
    work: Workspace, between: tuple[float, float], max_frequency_hz: float, *, damped: bool, check: bool
) -> Onsets:
    """Onsets in a range of μ, by whatever way the case takes: with matrices that depend on μ, they are those at each.

    What every analysis asks that wants the onsets of a case with other numbers. Raises as `onsets` does.
    """
    options = work.options
    if work.varies:
        require_full(options.source)
        own = work.own_friction if work.has_contacts else None
        result = full_onsets(
            work.system, between, max_frequency_hz=max_frequency_hz, damped=damped, options=options, own=own
        )
        notes = _held_by_factors(work, own)
    else:
        result = onsets_of_band(work.system(), between, max_frequency_hz, damped=damped, options=options, check=check)
        notes = taken_as_closed(work.system())
        if check:
            notes = (*notes, *decided_by_meshes(work.system(), solver=options.solver))
    notes = notes if work.varies else (*notes, *work.system().tie_words)
    return replace(result, notes=(*result.notes, *notes, *work.one_for_all))


@takes(progress=FUNCTION, checkpoint=FUNCTION, checkpoint_seconds=NUMBER, changed=SWITCH)
def simulate(
    problem: Problem,
    mu: float | None = None,
    *,
    progress: Progress | None = None,
    checkpoint: Checkpoint | None = None,
    checkpoint_seconds: float = 20.0,
    restart: Trajectory | None = None,
    changed: bool = False,
) -> Trajectory:
    """The temporal approach through the load phases; mu scales every contact's friction law.

    checkpoint is called with the trajectory so far at most every ``checkpoint_seconds``. restart goes on from an
    earlier run of the same case, μ and files; durations of phases that are not over may differ, and what is recorded,
    which then gives the new part alone. Raises CaseError for each thing that differs otherwise; with ``changed`` it
    goes on all the same, and `provenance` tells in "restarts" what was changed when. A system alone goes through the
    phases of its workspace, and without one for 0.01 s under all its loads.
    """
    started = time.perf_counter()
    with at_once():  # nothing is computed yet
        require_friction(mu, several=False)
        work = Workspace.of(problem)
        marks: dict[str, Any] = {"restarts": []}
        if restart is not None:
            given: Any = restart
            if not isinstance(given, Trajectory):
                raise CaseError("restart", given, "a run, of st.simulate or st.open(path)")
            now = check_restart(work.case("restart"), mu, restart, changed=changed)
            marks["restarts"] = [*restart.provenance.get("restarts", []), now]
        elif changed:
            raise CaseError("changed", True, "goes with restart")
        if work.given is not None:
            marks["fingerprint"] = fingerprint(work.given, mu)
        system, phases, settings = work.structured("simulate", mu), phases_of(work), settings_of(work)
        require_pressed_in_time(work, system, "simulate")
        beyond = steps_undetermined(settings.system(system), mu, work.options)
        if notes := [*(() if mu is None else work.one_for_all), *system.tie_words, *([beyond] if beyond else [])]:
            marks["notes"] = notes
        check_extent(work, system)

    def told(run: Trajectory) -> Trajectory:
        made = provenance(work, "simulate", time.perf_counter() - started, mu=mu)
        return replace(run, provenance=made | marks)

    try:
        result = march(
            system,
            phases,
            settings,
            mu=mu,
            progress=progress,
            checkpoint=None if checkpoint is None else lambda part: checkpoint(told(part)),
            checkpoint_seconds=checkpoint_seconds,
            restart=restart,
            join=restart is None or same_records(settings, restart),
            changed=changed,
        )
    except AnalysisError as error:
        part = error.trajectory
        if part is not None:
            error.trajectory = told(part)
        if beyond:
            error.args = (f"{error}; {beyond}",)
        raise
    return told(result)


def same_records(settings: Settings, restart: Trajectory) -> bool:
    """Whether records go on behind those of another run: kept as often, of the same points."""
    return settings.record_every == restart.record_every and settings.watch == restart.watch_names


def check_extent(work: Workspace, system: System) -> None:
    """Refuse runs that start inside one another or that no memory holds."""
    problems = [
        Wrong(
            f"contacts.{c.name}",
            f"overlap {-c.gap:g} m",
            "bodies that touch or are apart at the start; an overlap would be thrown open in one step: move a body",
        )
        for c in system.contacts
        if c.gap < -1e-9 and work.temporal.initial == "rest"
    ]
    _, _, limit = plan(system, settings_of(work), phases_of(work))
    step = work.temporal.step or limit.usual(settings_of(work).max_frequency_hz)
    steps = sum(p.duration for p in work.phases) / step
    size = 8.0 * (6 * len(system.contact_nodes().names) + 6 * len(work.temporal.watch) + 8)
    needed = steps / work.temporal.record_every * size
    if steps > 1e12 or needed > MOST_BYTES:
        problems.append(
            Wrong(
                "temporal",
                f"{steps:.3g} steps, records of {needed / 1e9:.3g} GB",
                f"at most 1e12 steps and {MOST_BYTES / 1e9:g} GB of records: shorten the phases, take a larger "
                "step or record less often",
            )
        )
    if problems:
        raise CaseError.many(problems)


def compare(
    problem: Problem,
    mus: float | Sequence[float] | None = None,
    *,
    critical: bool | None = None,
    runs: dict[float, Trajectory] | None = None,
    progress: Callable[[str], None] | None = None,
    only: Collection[str] | None = None,
    kept: PartStore | None = None,
    finished: Callable[[Comparison], None] | None = None,
) -> Agreement:
    """Both approaches at each μ (default comparison.mu, else the problem's own) and by their critical μ.

    critical False (default comparison.critical) solves neither; only: parts of "growth" (small perturbations at each
    μ), "run" (the full run at each μ as well) and "critical" instead of all. kept: where finished parts are put and
    sought (`io.kept_parts`); finished is called with each μ when it is done. Ctrl-C returns what is finished.
    """
    started = time.perf_counter()
    mus = require_friction(mus)
    work = Workspace.of(problem)
    settings, system = work.comparison, work.structured("compare")
    require_pressed_in_time(work, system, "compare", steady=True)
    chosen = np.atleast_1d(mus if mus is not None else settings.mu).tolist() or [work.one_friction()]
    result = compare_system(
        system,
        phases_of(work),
        settings_of(work),
        chosen,
        friction_range=work.modal.friction_range,
        max_frequency_hz=work.modal.max_frequency_hz,
        critical=settings.critical if critical is None else critical,
        bracket=settings.bracket,
        tolerance=settings.tolerance,
        runs=runs,
        progress=progress,
        only=only,
        kept=kept,
        finished=finished,
        options=work.options,
    )
    by_meshes = (said for mu in chosen for said in decided_by_meshes(system, mu))
    notes = dict.fromkeys((*result.notes, *work.one_for_all, *system.tie_words, *by_meshes))
    seconds = time.perf_counter() - started
    return replace(result, notes=tuple(notes), provenance=provenance(work, "compare", seconds, mu=chosen))


@takes(frequency_hz=NUMBERS)
def friction_curve(problem: Problem, frequency_hz: Array) -> Array:
    """Undamped μ(ω) (k,) of a single contact with constant μ, at frequencies (k,) [Hz].

    μ(ω) = −s (1/K_c + G_nn)/G_nt: its level sets are the branches and its maxima the onsets of flutter
    (docs/theory-modal.md). Raises CaseError for another number of contacts.
    """
    work = Workspace.of(problem)
    system = work.system()
    if len(system.contacts) != 1 or not by_receptance(system, work.options):
        raise CaseError("contacts", len(system.contacts), "one contact: μ(ω) is a single curve only then")
    spectrum, coupling, _ = prepare(system.undamped())
    h, _ = spectrum.receptance(2j * np.pi * np.asarray(frequency_hz, dtype=float))
    with np.errstate(divide="ignore", invalid="ignore"):
        curve = -coupling.sense[0] * (coupling.compliance[0] + h[:, 0, 0].real) / h[:, 0, 1].real
    return np.asarray(curve)
