"""A case in, a result out: the calls behind `import stridor as st` and behind every verb."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

from ..agreement import Agreement, Comparison, Store, dominant_response, linear_part
from ..agreement import compare as compare_system
from ..case import Case
from ..case.matrix_checks import MU
from ..errors import AnalysisError, CaseError, Problem
from ..modal.complex_modes import ComplexModes, complex_modes
from ..modal.general import general_modes, general_onsets
from ..modal.onsets import Onsets
from ..modal.onsets import onsets as solve_onsets
from ..modal.over_friction import modes_of_band, onsets_of_band
from ..modal.receptance_modes import prepare
from ..modal.source import require_full
from ..sliding import full_motion, slip_speeds, taken_as_closed
from ..sliding.surfaces import SurfaceSliding, steady_sliding_nodes
from ..system import System, build_system
from ..temporal.attractor import settled
from ..temporal.energy import EnergyBalance, energy_balance
from ..temporal.inputs import unfit_in_time
from ..temporal.settings import Settings
from ..temporal.signals import Growth, components
from ..temporal.simulate import Checkpoint, Progress, plan
from ..temporal.simulate import simulate as march
from ..temporal.trajectory import Trajectory
from ..typing import Array
from .asked import require_frequency, require_friction
from .body_modes import BodyModes, body_modes
from .description import Description, describe
from .fingerprint import changes_of, check_restart, fingerprint
from .options import options_of
from .pressed import require_pressed_in_time
from .provenance import provenance
from .settings import phases_of, settings_of
from .touching import decided_by_meshes

__all__ = [
    "BodyModes",
    "Description",
    "RunSummary",
    "body_modes",
    "compare",
    "describe",
    "first_regime",
    "friction_curve",
    "initial_state",
    "modes",
    "onsets",
    "own_friction",
    "phases_of",
    "settings_of",
    "simulate",
    "steady_sliding",
    "structured",
    "summarise",
]

EXPONENTIAL = 0.5  # rms of ln amplitude about the fitted line, above which nothing is called exponential
LEAST_RECORDS = 128  # from which on components are sought in a run
MOST_BYTES = 8e9  # of records kept in memory


def modes(
    case: Case,
    mu: float | Sequence[float] | Array | None = None,
    *,
    count: int | None = None,
    max_frequency_hz: float | None = None,
    damped: bool | None = None,
    vectors: bool | Literal["right"] = False,
    check: bool = True,
    progress: Progress | None = None,
) -> ComplexModes:
    """Complex modes at one or many friction coefficients (default: the case's own).

    All modes with frequencies up to modal.max_frequency_hz are found; kept are the ``count`` lowest (default
    modal.modes) and every unstable one, with max_frequency_hz all up to that. check: whether what grows in the band is
    sought anew in the full problem (`checked_modes`). progress is called with the number of friction coefficients done
    and of all. Raises CaseError for a bad μ, AnalysisError where the steady sliding state does not exist.
    """
    started = time.perf_counter()
    require_frequency(max_frequency_hz)
    values = _own_friction(case) if mu is None else mu
    damped = case.modal.damped if damped is None else damped
    band = max_frequency_hz or case.modal.max_frequency_hz
    system = None if _varies_with_friction(case) else build_system(case)
    own = own_friction(case) if case.contacts else None
    if system is None:
        require_full(options_of(case).source)
        result = general_modes(
            lambda mu: build_system(case, mu),
            values,
            count=None,
            max_frequency_hz=band,
            damped=damped,
            vectors=vectors,
            options=options_of(case),
            own=own,
            progress=progress,
        )
    else:
        result = _followed_modes(
            case, system, values, band, damped=damped, vectors=vectors, check=check, own=own, progress=progress
        )
    if max_frequency_hz is None:
        result = result.lowest(case.modal.modes if count is None else count)
    notes = (*result.notes, *(held_by_factors(case, own) if system is None else taken_as_closed(system)))
    if check and system is not None:
        single = float(result.mu[0]) if len(result.mu) == 1 else None
        notes = (*notes, *decided_by_meshes(system, single, options_of(case).solver))
    seconds = time.perf_counter() - started
    return replace(result, notes=notes, provenance=provenance(case, "modes", seconds, damped=damped))


def _followed_modes(
    case: Case,
    system: System,
    values: float | Sequence[float] | Array,
    band: float,
    *,
    damped: bool,
    vectors: bool | Literal["right"],
    check: bool,
    own: float | None,
    progress: Progress | None,
) -> ComplexModes:
    """Modes followed from μ = 0, and checked."""
    options = options_of(case)
    if not check:
        return complex_modes(
            system, values, max_frequency_hz=band, damped=damped, vectors=vectors, progress=progress, **asdict(options)
        )
    return modes_of_band(
        system, values, band, damped=damped, vectors=vectors, own=own, options=options, progress=progress
    )


def _varies_with_friction(case: Case) -> bool:
    """Whether factors of imported matrices depend on the friction coefficient."""
    return MU in case.factor_names


def held_by_factors(case: Case, own: float | None) -> tuple[str, ...]:
    """What is said where factors of matrices depend on μ and there are contacts beside them."""
    if not case.contacts:
        return ()
    at = "at the lowest μ" if own is None else f"at μ = {own:g}"
    return (
        f"Factors of imported matrices depend on mu: the contact nodes that touch in steady sliding {at} are held at "
        "every μ where several are asked for.",
    )


def structured(case: Case, what: str, mu: float | None = None) -> System:
    """The system of a case whose matrices are as ``what`` needs them: constant, with a mass that the time loop takes.
    Raises AnalysisError for others."""
    works = "what works for these is `stridor modes`, `stridor onsets` and `stridor steady`"
    if _varies_with_friction(case):
        # Nothing gives μ: at 0 the matrices may be symmetric where they are not at any other.
        unsaid = mu is None and MU not in case.parameters and not case.contacts
        beyond = build_system(case, case.modal.friction_range[1]).general if unsaid else ""
        if what in ("compare", "run") or beyond:
            why = f", and beyond mu = 0 {beyond}" if beyond else ""
            raise AnalysisError(
                f"{what}: factors of imported matrices depend on mu{why}; the time loop takes constant matrices only; "
                f"{works}"
            )
    system = build_system(case, mu)
    if system.general and (why := unfit_in_time(system)):
        raise AnalysisError(f"{what}: {why}; {works}")
    if system.general and what == "run" and not case.contacts:
        raise AnalysisError(
            "run: there are no contacts and no factor of a matrix has mu in it, so there is no onset to solve for; "
            "what works here is `stridor modes`, `stridor simulate` and `stridor onsets --along NAME`"
        )
    return system


def steady_sliding(case: Case, mu: float | None = None) -> SurfaceSliding:
    """The equilibrium under load and friction that both approaches start from, node by node of every contact.

    mu replaces the friction coefficient of every contact. Raises AnalysisError where there is none.
    """
    require_friction(mu)
    return steady_sliding_nodes(build_system(case, mu), mu=mu)


def own_friction(case: Case) -> float | None:
    """The coefficient of all contacts at their slip speeds in steady sliding; None where they differ.

    Where the case has a parameter mu, and so no contacts, it is that.
    """
    if MU in case.parameters:
        return case.parameters[MU].value
    if not case.contacts:
        return 0.0
    system = build_system(case)
    nodes = system.contact_nodes()
    speeds = np.linalg.norm(nodes.slip_velocity(full_motion(system)), axis=1)
    # The centre of a turning surface slides at no speed and has no say.
    moving = speeds > 1e-9 * speeds.max(initial=0.0)
    found = nodes.friction_coefficients(speeds)[moving] if moving.any() else nodes.friction_coefficients(speeds)
    if not len(found):
        return 0.0
    return float(found[0]) if np.ptp(found) <= 1e-12 * np.max(np.abs(found)) else None


def _own_friction(case: Case) -> float:
    """The same; raises CaseError where contacts differ."""
    found = own_friction(case)
    if found is None:
        raise CaseError(
            "mu",
            None,
            "one friction coefficient for all contacts, since the case gives them different ones: name it "
            "(--mu 0.3), it scales every contact's law",
        )
    return found


def onsets(
    case: Case,
    friction_range: tuple[float, float] | None = None,
    *,
    max_frequency_hz: float | None = None,
    damped: bool | None = None,
    check: bool = True,
) -> Onsets:
    """Every critical friction coefficient in range (defaults from the case's [modal]).

    check: whether what grows at both ends of the range is sought anew in the full problem (`checked_onsets`).
    """
    started = time.perf_counter()
    require_frequency(max_frequency_hz)
    between = case.modal.friction_range if friction_range is None else friction_range
    limit = max_frequency_hz or case.modal.max_frequency_hz
    damped = case.modal.damped if damped is None else damped
    system = None if _varies_with_friction(case) else build_system(case)
    if system is None:
        require_full(options_of(case).source)
        result = general_onsets(
            lambda mu: build_system(case, mu),
            between,
            max_frequency_hz=limit,
            damped=damped,
            options=options_of(case),
            own=own_friction(case) if case.contacts else None,
        )
    else:
        options = options_of(case)
        if check:
            result = onsets_of_band(system, between, limit, damped=damped, options=options)
        else:
            result = solve_onsets(system, between, max_frequency_hz=limit, damped=damped, **asdict(options))
    own = own_friction(case) if system is None and case.contacts else None
    notes = (*result.notes, *(held_by_factors(case, own) if system is None else taken_as_closed(system)))
    if check and system is not None:
        notes = (*notes, *decided_by_meshes(system, solver=options_of(case).solver))
    return replace(result, notes=notes, provenance=provenance(case, "onsets", time.perf_counter() - started))


def simulate(
    case: Case,
    mu: float | None = None,
    *,
    progress: Progress | None = None,
    checkpoint: Checkpoint | None = None,
    restart: Trajectory | None = None,
    changed: bool = False,
) -> Trajectory:
    """The temporal approach through the phases of the case; mu scales every contact's friction law.

    checkpoint is called with the trajectory so far about every 20 seconds. restart goes on from an earlier run of the
    same case, μ and files; durations of phases that are not over may differ, and what is recorded, which then gives
    the new part alone. Raises CaseError for each thing that differs otherwise; with ``changed`` it goes on all the
    same, and `provenance` tells in "restarts" what was changed when.
    """
    started = time.perf_counter()
    require_friction(mu)
    restarts: list[dict[str, Any]] = []
    if restart is not None:
        restarts = [*restart.provenance.get("restarts", []), check_restart(case, mu, restart, changed=changed)]
    elif changed:
        raise CaseError("changed", True, "goes with restart")
    marks = {"fingerprint": fingerprint(case, mu), "restarts": restarts}
    system = structured(case, "simulate", mu)
    require_pressed_in_time(case, system, "simulate")
    _check_extent(case, system)

    def told(run: Trajectory) -> Trajectory:
        made = provenance(case, "simulate", time.perf_counter() - started, mu=mu)
        return replace(run, provenance=made | marks)

    settings = settings_of(case)
    try:
        result = march(
            system,
            phases_of(case),
            settings,
            mu=mu,
            progress=progress,
            checkpoint=None if checkpoint is None else lambda part: checkpoint(told(part)),
            restart=restart,
            join=restart is None or same_records(settings, restart),
            changed=changed,
            disturbance=None if system.assembled else initial_state(case, system),
        )
    except AnalysisError as error:
        part = getattr(error, "trajectory", None)
        if part is not None:
            error.trajectory = told(part)  # type: ignore[attr-defined]
        raise
    return told(result)


def same_records(settings: Settings, restart: Trajectory) -> bool:
    """Whether records go on behind those of another run: kept as often, of the same points."""
    return settings.record_every == restart.record_every and settings.watch == restart.watch_names


def initial_state(case: Case, system: System) -> tuple[Array, Array, Array] | None:
    """Displacement, velocity and acceleration (n,) that bodies start with, None at rest."""
    if system.initial_displacement is None and system.initial_velocity is None:
        return None
    zero = np.zeros(system.size)
    displacement = zero if system.initial_displacement is None else system.initial_displacement
    velocity = zero if system.initial_velocity is None else system.initial_velocity
    force = -(system.stiffness @ displacement) - system.damping @ velocity
    factors = {**dict.fromkeys(system.loads, 1.0), **case.phases[0].loads}
    if case.phases[0].ramp == 0:
        for name, vector in system.loads.items():
            force = force + factors[name] * vector
    mass = system.mass
    diagonal = mass.diagonal()
    # The scheme starts from the acceleration that the forces give; a consistent mass only delays it by half a step.
    acceleration = force / diagonal if mass.nnz == np.count_nonzero(diagonal) else zero
    return displacement, velocity, acceleration


def _check_extent(case: Case, system: System) -> None:
    """Refuse runs that start inside one another or that no memory holds."""
    problems = [
        Problem(
            f"contacts.{c.name}",
            f"overlap {-c.gap:g} m",
            "bodies that touch or are apart at the start; an overlap would be thrown open in one step: move a body",
        )
        for c in system.contacts
        if c.gap < -1e-9 and case.temporal.initial == "rest" and not system.assembled
    ]
    _, _, limit = plan(system, settings_of(case))
    step = case.temporal.step or limit.share * limit.step
    steps = sum(p.duration for p in case.phases) / step
    size = 8.0 * (6 * len(system.contacts) + 6 * len(system.surfaces) + 6 * len(case.temporal.watch) + 8)
    needed = steps / case.temporal.record_every * size
    if steps > 1e12 or needed > MOST_BYTES:
        problems.append(
            Problem(
                "temporal",
                f"{steps:.3g} steps, records of {needed / 1e9:.3g} GB",
                f"at most 1e12 steps and {MOST_BYTES / 1e9:g} GB of records: shorten the phases, take a larger "
                "step or record less often",
            )
        )
    if problems:
        raise CaseError.many(problems)


def compare(
    case: Case,
    mus: Sequence[float] | None = None,
    *,
    critical: bool | None = None,
    runs: dict[float, Trajectory] | None = None,
    progress: Callable[[str], None] | None = None,
    only: Collection[str] | None = None,
    kept: Store | None = None,
    finished: Callable[[Comparison], None] | None = None,
) -> Agreement:
    """Both approaches at each μ (default comparison.mu, else the case's own) and by their critical μ.

    critical False (default comparison.critical) solves neither; only: parts of "growth" (small perturbations at each
    μ), "run" (the full run at each μ as well) and "critical" instead of all. kept: where finished parts are put and
    sought (`io.kept_parts`); finished is called with each μ when it is done. Ctrl-C returns what is finished.
    """
    started = time.perf_counter()
    require_friction(mus)
    settings = case.comparison
    system = structured(case, "compare")
    require_pressed_in_time(case, system, "compare", steady=True)
    chosen = list(mus if mus is not None else settings.mu) or [_own_friction(case)]
    result = compare_system(
        system,
        phases_of(case),
        settings_of(case),
        chosen,
        friction_range=case.modal.friction_range,
        max_frequency_hz=case.modal.max_frequency_hz,
        critical=settings.critical if critical is None else critical,
        bracket=settings.bracket,
        tolerance=settings.tolerance,
        runs=runs,
        progress=progress,
        only=only,
        kept=kept,
        finished=finished,
    )
    notes = dict.fromkeys((*result.notes, *(said for mu in chosen for said in decided_by_meshes(system, mu))))
    seconds = time.perf_counter() - started
    return replace(result, notes=tuple(notes), provenance=provenance(case, "compare", seconds, mu=chosen))


@dataclass(frozen=True)
class RunSummary:
    """What `stridor simulate` prints: the last phase in numbers, the energies, the cost."""

    dominant_frequency_hz: float | None
    growth: Growth | None
    energy: EnergyBalance
    trajectory: Trajectory
    linear: complex | None = None

    @property
    def growth_rate(self) -> float | None:
        """Growth [1/s]: of the fastest component of a small perturbation, where the run starts from steady
        sliding; else of the dominant line where it grows exponentially, None where it does not."""
        if self.linear is not None:
            return self.linear.real
        if self.growth is None or self.growth.spread > EXPONENTIAL:
            return None
        return self.growth.rate

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        run = self.trajectory
        last = run.phases[-1] if run.phases else None
        return {
            "dominant_frequency_hz": self.dominant_frequency_hz,
            "growth_rate": self.growth_rate,
            "growth_fit": None
            if self.growth is None
            else {"start": self.growth.start, "end": self.growth.end, "spread": self.growth.spread},
            "saturated": None if self.growth is None else self.growth.saturated,
            "contacts": {} if last is None else {name: vars(c).copy() for name, c in last.contacts.items()},
            "first_regime": first_regime(run),
            "settled": {name: asdict(part) for name, part in settled(run).items()},
            "phases": [
                {
                    "name": p.name,
                    "start": p.start,
                    "end": p.end,
                    "contacts": {name: vars(c).copy() for name, c in p.contacts.items()},
                }
                for p in run.phases
            ],
            "energy": self.energy.to_json() | {"words": self.energy.words(run.beta2)},
            "steps": run.steps,
            "planned_steps": run.planned_steps,
            "interrupted": run.interrupted,
            "dt": run.step,
            "step_limit": run.step_limit,
            "limiting_body": run.limiting_body,
            "path": run.path,
            "path_reason": run.path_reason,
            "most_sweeps": run.most_sweeps,
            "unconverged_steps": run.unconverged_steps,
            "wall_seconds": run.wall_seconds,
            "changed": changes_of(run),
            "restarts": run.provenance.get("restarts", []),
        }


def first_regime(run: Trajectory) -> dict[str, dict[str, float | None]]:
    """The stretch of the last phase before a contact first separates, by contact: end [s], largest normal
    force [N] and slip speed [m/s], share of its last quarter spent in stick (all of the records)."""
    found: dict[str, dict[str, float | None]] = {}
    if not run.phases or not len(run.time):
        return found
    part = run.phase_slice()
    phase = run.phases[-1]
    for k, name in enumerate(run.contact_names):
        opened = phase.contacts[name].first_separation
        end = phase.end if opened is None else opened
        inside = np.flatnonzero(run.time[part] < end)
        if not len(inside):
            found[name] = {
                "end": end,
                "max_normal_force": None,
                "max_slip_speed": None,
                "stick_fraction": None,
            }
            continue
        force = run.normal_force[part][inside, k]
        status = run.status[part][inside, k]
        tail = status[-max(1, len(status) // 4) :]
        found[name] = {
            "end": float(end),
            "max_normal_force": float(np.abs(force).max()),
            "max_slip_speed": float(np.abs(run.slip_speed[part][inside, k]).max()),
            "stick_fraction": float(np.mean(tail == 1)),
        }
    return found


def summarise(case: Case, run: Trajectory) -> RunSummary:
    """Dominant frequency, growth, energy balance of a run."""
    dominant, fitted = dominant_response(run, case.modal.max_frequency_hz)
    linear: complex | None = None
    perturbed = case.temporal.initial == "steady-sliding" and case.temporal.perturbation > 0
    enough = len(run.time) >= LEAST_RECORDS
    system = build_system(case) if perturbed and enough and run.contact_names and case.contacts else None
    if system is not None and not system.assembled:
        found = linear_part(run, slip_speeds(system, full_motion(system)), skip=16)
        band = components(found, run.sampling, max_frequency_hz=case.modal.max_frequency_hz)
        linear = band.fastest or None
    return RunSummary(dominant, fitted, energy_balance(run), run, linear)


def friction_curve(case: Case, frequency_hz: Array) -> Array:
    """Undamped μ(ω) (k,) of a single contact with constant μ, at frequencies (k,) [Hz].

    μ(ω) = −s (1/K_c + G_nn)/G_nt: its level sets are the branches and its maxima the onsets of flutter
    (docs/theory-modal.md). Raises CaseError for a case with another number of contacts.
    """
    system = build_system(case)
    if len(system.contacts) != 1 or system.assembled:
        raise CaseError("contacts", len(system.contacts), "one contact: μ(ω) is a single curve only then")
    bare = replace(system, damping=0 * system.damping)

    spectrum, coupling, _ = prepare(bare)
    h, _ = spectrum.receptance(2j * np.pi * np.asarray(frequency_hz, dtype=float))
    with np.errstate(divide="ignore", invalid="ignore"):
        curve = -coupling.sense[0] * (coupling.compliance[0] + h[:, 0, 0].real) / h[:, 0, 1].real
    return np.asarray(curve)
