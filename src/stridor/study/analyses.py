"""A case in, a result out: the calls behind `import stridor as st` and behind every verb."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..agreement import Agreement, dominant_response, linear_part
from ..agreement import compare as compare_system
from ..case import Case
from ..errors import CaseError, Problem
from ..modal.complex_modes import ComplexModes, complex_modes
from ..modal.onsets import Onsets
from ..modal.onsets import onsets as solve_onsets
from ..sliding import full_motion, slip_speeds, steady_sliding
from ..system import System, build_system
from ..system.uncoupled import uncoupled_modes
from ..temporal.beta2 import step_limit
from ..temporal.energy import EnergyBalance, energy_balance
from ..temporal.schedule import PhaseSpec
from ..temporal.settings import SAFE_FRACTION, Settings
from ..temporal.signals import Growth, components
from ..temporal.simulate import Checkpoint, Progress
from ..temporal.simulate import simulate as march
from ..temporal.trajectory import Trajectory
from ..typing import Array
from .provenance import provenance

EXPONENTIAL = 0.5  # rms of ln amplitude about the fitted line, above which nothing is called exponential
MOST_BYTES = 8e9  # of records kept in memory


def phases_of(case: Case) -> list[PhaseSpec]:
    """The load phases of a case as the temporal approach takes them."""
    return [PhaseSpec(p.name, p.duration, p.loads, p.velocities, p.ramp) for p in case.phases]


def settings_of(case: Case) -> Settings:
    """The temporal settings of a case."""
    t = case.temporal
    return Settings(t.step, t.beta2, t.record_every, t.path, t.initial, t.perturbation, tuple(t.watch))


def modes(
    case: Case,
    mu: float | Sequence[float] | Array | None = None,
    *,
    count: int | None = None,
    max_frequency_hz: float | None = None,
    damped: bool | None = None,
    vectors: bool = False,
) -> ComplexModes:
    """Complex modes at one or many friction coefficients (default: the case's own).

    count: how many branches (default modal.modes); max_frequency_hz takes all that start below it instead.
    Raises CaseError for a bad μ, AnalysisError where the steady sliding state does not exist.
    """
    started = time.perf_counter()
    system = build_system(case)
    values = _own_friction(case) if mu is None else mu
    damped = case.modal.damped if damped is None else damped
    result = complex_modes(
        system,
        values,
        count=case.modal.modes if count is None else count,
        max_frequency_hz=max_frequency_hz,
        damped=damped,
        vectors=vectors,
    )
    seconds = time.perf_counter() - started
    return replace(result, provenance=provenance(case, "modes", seconds, damped=damped))


def own_friction(case: Case) -> float | None:
    """The coefficient of all contacts at their slip speeds in steady sliding; None where they differ."""
    system = build_system(case)
    speeds = np.abs(slip_speeds(system, full_motion(system)))
    found = system.friction_coefficients(speeds)
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
) -> Onsets:
    """Every critical friction coefficient in range (defaults from the case's [modal])."""
    started = time.perf_counter()
    system = build_system(case)
    result = solve_onsets(
        system,
        case.modal.friction_range if friction_range is None else friction_range,
        max_frequency_hz=max_frequency_hz or case.modal.max_frequency_hz,
        damped=case.modal.damped if damped is None else damped,
    )
    return replace(result, provenance=provenance(case, "onsets", time.perf_counter() - started))


def simulate(
    case: Case,
    mu: float | None = None,
    *,
    progress: Progress | None = None,
    checkpoint: Checkpoint | None = None,
    restart: Trajectory | None = None,
) -> Trajectory:
    """The temporal approach through the phases of the case; mu scales every contact's friction law."""
    started = time.perf_counter()
    system = build_system(case)
    _check_extent(case, system)
    result = march(
        system,
        phases_of(case),
        settings_of(case),
        mu=mu,
        progress=progress,
        checkpoint=checkpoint,
        restart=restart,
    )
    return replace(result, provenance=provenance(case, "simulate", time.perf_counter() - started, mu=mu))


def _check_extent(case: Case, system: System) -> None:
    """Refuse runs that start inside one another or that no memory holds."""
    problems = [
        Problem(
            f"contacts.{c.name}",
            f"overlap {-c.gap:g} m",
            "bodies that touch or are apart at the start; an overlap would be thrown open in one step: move a body",
        )
        for c in system.contacts
        if c.gap < -1e-9 and case.temporal.initial == "rest"
    ]
    step = case.temporal.step or SAFE_FRACTION * step_limit(system, case.temporal.beta2).step
    steps = sum(p.duration for p in case.phases) / step
    size = 8.0 * (6 * len(system.contacts) + 6 * len(case.temporal.watch) + 8)
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
) -> Agreement:
    """Both approaches at each μ (default comparison.mu, else the case's own) and by their critical μ."""
    started = time.perf_counter()
    settings = case.comparison
    chosen = list(mus if mus is not None else settings.mu) or [_own_friction(case)]
    system = build_system(case)
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
    )
    return replace(result, provenance=provenance(case, "compare", time.perf_counter() - started, mu=chosen))


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
            "phases": [
                {
                    "name": p.name,
                    "start": p.start,
                    "end": p.end,
                    "contacts": {name: vars(c).copy() for name, c in p.contacts.items()},
                }
                for p in run.phases
            ],
            "energy": self.energy.to_json(),
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
            "max_normal_force": float(force.max()),
            "max_slip_speed": float(np.abs(run.slip_speed[part][inside, k]).max()),
            "stick_fraction": float(np.mean(tail == 1)),
        }
    return found


def summarise(case: Case, run: Trajectory) -> RunSummary:
    """Dominant frequency, growth, energy balance of a run."""
    dominant, fitted = dominant_response(run, case.modal.max_frequency_hz)
    linear: complex | None = None
    perturbed = case.temporal.initial == "steady-sliding" and case.temporal.perturbation > 0
    if perturbed and run.contact_names and case.contacts:
        system = build_system(case)
        found = linear_part(run, slip_speeds(system, full_motion(system)), skip=16)
        band = components(found, run.sampling, max_frequency_hz=case.modal.max_frequency_hz)
        linear = band.fastest or None
    return RunSummary(dominant, fitted, energy_balance(run), run, linear)


@dataclass(frozen=True)
class BodyModes:
    """Undamped modes of one body alone, supports included: frequency_hz (k,) and what they are
    ("rigid", "F1" bending, "T1" traction, "FT3" mixed), by frequency."""

    frequency_hz: Array
    labels: tuple[str, ...]


def body_modes(case: Case, *, max_frequency_hz: float | None = None) -> Mapping[str, BodyModes]:
    """Modes of every body by itself (the first columns of the paper's Table II)."""
    limit = max_frequency_hz or case.modal.max_frequency_hz
    system = build_system(case)
    modes_ = uncoupled_modes(replace(system, damping=0 * system.damping))
    result: dict[str, BodyModes] = {}
    for line in system.lines:
        axis = np.array(case.bodies[line.name].direction)
        entries: list[tuple[float, float]] = []
        for block in modes_.real:
            if not np.isin(block.freedoms[0], line.freedoms):
                continue
            shapes = np.zeros((system.size, len(block.stiffness)))
            shapes[block.freedoms] = block.vectors
            motion = (line.rows.free @ shapes).reshape(-1, 2, len(block.stiffness))
            along = (np.einsum("kdm,d->km", motion, axis) ** 2).sum(axis=0)
            share = along / np.maximum((motion**2).sum(axis=(0, 1)), 1e-300)
            frequency = np.sqrt(np.maximum(block.stiffness, 0.0)) / (2 * np.pi)
            entries += [(float(f), float(a)) for f, a in zip(frequency, share, strict=True) if f <= limit]
        result[line.name] = _labelled(sorted(entries))
    return result


def _labelled(entries: list[tuple[float, float]]) -> BodyModes:
    """Count bending and traction modes separately, from the share of motion along the axis."""
    counts = {"F": 0, "T": 0, "FT": 0}
    labels: list[str] = []
    for frequency, along in entries:
        if frequency == 0.0:
            labels.append("rigid")
            continue
        kind = "T" if along > 0.7 else "F" if along < 0.3 else "FT"
        counts[kind] += 1
        labels.append(f"{kind}{counts[kind]}")
    return BodyModes(np.array([f for f, _ in entries]), tuple(labels))


def friction_curve(case: Case, frequency_hz: Array) -> Array:
    """Undamped μ(ω) (k,) of a single contact with constant μ, at frequencies (k,) [Hz].

    μ(ω) = −s (1/K_c + G_nn)/G_nt: its level sets are the branches and its maxima the onsets of flutter
    (docs/theory-modal.md). Raises CaseError for a case with another number of contacts.
    """
    system = build_system(case)
    if len(system.contacts) != 1:
        raise CaseError("contacts", len(system.contacts), "one contact: μ(ω) is a single curve only then")
    bare = replace(system, damping=0 * system.damping)
    from ..modal.complex_modes import prepare

    spectrum, coupling, _ = prepare(bare)
    h, _ = spectrum.receptance(2j * np.pi * np.asarray(frequency_hz, dtype=float))
    with np.errstate(divide="ignore", invalid="ignore"):
        curve = -coupling.sense[0] * (coupling.compliance[0] + h[:, 0, 0].real) / h[:, 0, 1].real
    return np.asarray(curve)


@dataclass(frozen=True)
class Description:
    """The model in words and numbers, as `stridor check` prints it."""

    lines: tuple[str, ...]
    data: dict[str, Any]
    warnings: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {**self.data, "text": list(self.lines), "warnings": list(self.warnings)}


def describe(case: Case) -> Description:
    """Build the model, find its steady sliding and its step limit, and say it in words."""
    from ..temporal.settings import choose_path, choose_step

    system = build_system(case)
    settings = settings_of(case)
    limit = step_limit(system, settings.beta2)
    step = choose_step(limit, settings)
    _, reason = choose_path(system, settings)
    path = "modal" if reason.startswith("complete") else "nodal"
    lines = [f"{case.title or 'case'}: {len(case.bodies)} bodies, {system.size} free degrees of freedom"]
    for name, body in case.bodies.items():
        count = next(len(line.freedoms) for line in system.lines if line.name == name)
        lines.append(
            f"  {name}: beam of {body.elements} elements, {body.length_m:g} m × {body.width:g} m × "
            f"{body.thickness:g} m, {body.material}, {body.mass} mass, {count} free"
        )
    for name, support in case.supports.items():
        moving = (
            ", moves at " + ", ".join(f"{d} {v:g}" for d, v in support.velocity.items()) if support.velocity else ""
        )
        lines.append(f"  support {name} at {support.at} holds {', '.join(support.fixed)}{moving}")
    for name, load in case.loads.items():
        lines.append(f"  load {name} at {load.at}: ({load.force[0]:g}, {load.force[1]:g}) N, {load.moment:g} N m")
    data: dict[str, Any] = {
        "title": case.title,
        "bodies": {line.name: len(line.freedoms) for line in system.lines},
        "degrees_of_freedom": system.size,
        "contacts": {},
        "step": step,
        "step_limit": limit.step,
        "limiting_body": limit.body,
        "path": path,
        "steps": sum(round(p.duration / step) for p in case.phases),
    }
    if system.contacts and system.loads:
        steady = steady_sliding(system)
        for k, contact in enumerate(system.contacts):
            stiffness = "rigid" if np.isinf(contact.stiffness) else f"{contact.stiffness:g} N/m"
            state = f"{steady.normal_force[k]:.6g} N" if steady.active[k] else "open"
            table = case.contacts[contact.name]
            lines.append(
                f"  contact {contact.name}: {table.slave} on {table.master}, μ = "
                f"{steady.friction_coefficient[k]:g}, {stiffness}, {contact.sliding} sliding, normal force {state}, "
                f"slip speed {abs(steady.slip_speed[k]):g} m/s in steady sliding"
            )
            data["contacts"][contact.name] = {
                "normal_force": float(steady.normal_force[k]),
                "slip_speed": float(steady.slip_speed[k]),
                "touches": bool(steady.active[k]),
                "gap": contact.gap,
            }
    lines.append(
        f"time step {step:.4g} s, {100 * step / limit.step:.0f} % of the stability limit {limit.step:.4g} s "
        f"(set by {limit.body}); {data['steps']} steps"
    )
    lines.append(f"time loop: {path} path ({reason})")
    warnings = list(case.warnings)
    for contact in system.contacts:
        if contact.gap < -1e-9:
            warnings.append(f"contact {contact.name}: the bodies overlap by {-contact.gap:g} m; simulate refuses that")
        elif contact.gap > 1e-9:
            lines.append(f"contact {contact.name} is open by {contact.gap:g} m at the start")
    if system.contacts and not any(np.any(v) for v in system.loads.values()):
        warnings.append(
            "no load presses the bodies together: modes take the contacts as closed, a run would not keep them so"
        )
    return Description(tuple(lines), data, tuple(warnings))
