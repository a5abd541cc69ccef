"""A case and its results in words and input tables: what a reader wants to know before any figure."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..agreement import GOOD_FREQUENCY, GOOD_GROWTH, stronger_below
from ..case import Case
from ..case.matrix_checks import MU
from ..case.repeating import in_alike, of_alike, repeating
from ..case.schema import Load
from ..digits import measured
from ..study.run_summary import slower_is_stronger
from ..study.saturation import Unsaturated
from ..temporal.changes import changes_of
from .body_words import body_words, contact_words
from .inputs import ReportInputs
from .tables import Table, TableRow, drop_empty, significant
from .temporal_tables import agreed, critical_row, mac_row
from .units import frequency_words, time_unit


@dataclass(frozen=True)
class Verdict:
    """The answer: a headline, one paragraph, whether it squeals and whether both approaches agree (None where
    that was not asked)."""

    headline: str
    paragraph: str
    squeals: bool | None
    agrees: bool | None


def verdict(inputs: ReportInputs) -> Verdict:
    """Will it squeal, at which frequency, from which friction on, and do both approaches say so? Where bodies repeat,
    what is said is of the motions that are computed, and the denials say so themselves."""
    alike = repeating(inputs.case.ties)
    growing = _growing(inputs)
    at = f" at μ = {inputs.mu:g}" if inputs.mu is not None and _rubs(inputs.case) else ""
    agreement = inputs.agreement
    agrees = None if agreement is None else agreement.agree
    state = f"Steady sliding{at}" if inputs.case.contacts else f"The structure{at}"
    parts = [
        _modal_sentence(growing, state), in_alike(_onset_sentence(inputs), alike), _run_sentence(inputs),
        _agreement_sentence(inputs),
    ]  # fmt: skip
    paragraph = of_alike(" ".join(part for part in parts if part), alike)
    squeals = None if growing is None else bool(growing)
    if growing is None:
        return Verdict(_undecided(inputs), paragraph, None, agrees)
    if not growing:
        calm = in_alike(f"It does not squeal{at} up to {_top(inputs)}", alike)
        return Verdict(calm, paragraph, squeals, agrees)
    if inputs.unsaturated is not None:
        still = inputs.unsaturated
        hz = measured(still.frequency_hz, 0)
        headline = f"Steady sliding is unstable{at}, and a vibration of {hz} Hz grows for longer than the run lasts"
        return Verdict(headline, paragraph, squeals, agrees)
    answering = _answering(inputs)
    frequency = max(growing, key=_growth_of)[0] if answering is None else answering
    may = "squeals" if answering is not None or agrees else "may squeal"
    return Verdict(f"It {may}{at}, at {measured(frequency, 0)} Hz", paragraph, squeals, agrees)


def _undecided(inputs: ReportInputs) -> str:
    """The headline where there are no modes at one friction coefficient."""
    onsets = inputs.onsets
    first = None if onsets is None else onsets.first
    if first is not None:
        sentence = f"It may squeal from μ = {measured(first.mu, 4)} on, at {measured(first.frequency_hz, 0)} Hz"
        return in_alike(sentence, repeating(inputs.case.ties))
    return "Not decided: no modes at the friction of the case"


def _growth_of(pair: tuple[float, float]) -> float:
    return pair[1]


def _answering(inputs: ReportInputs) -> float | None:
    """Dominant frequency of the full run at the friction of the case where an unstable mode answers [Hz]."""
    for c in inputs.agreement.comparisons if inputs.agreement is not None else ():
        if (inputs.mu is None or abs(c.mu - inputs.mu) < 1e-12) and c.responding is not None:
            return c.dominant_frequency_hz
    return None


def _growing(inputs: ReportInputs) -> list[tuple[float, float]] | None:
    """Frequency [Hz] and growth rate [1/s] of every unstable mode in range at the friction of the case."""
    modes = inputs.modes
    if modes is None and inputs.mu is not None and inputs.damped_sweep is not None:
        near = inputs.damped_sweep
        modes = near if abs(near.mu[near.at(inputs.mu)] - inputs.mu) < 1e-9 else None
    if modes is not None:
        row = 0 if inputs.mu is None else modes.at(inputs.mu)
        if not modes.solved[row]:
            return None
        chosen = modes.unstable[row] & (modes.frequency_hz[row] <= inputs.max_frequency_hz)
        pairs = zip(modes.frequency_hz[row][chosen], modes.growth_rate[row][chosen], strict=True)
        return [(float(f), float(g)) for f, g in pairs]
    for comparison in inputs.agreement.comparisons if inputs.agreement is not None else ():
        if inputs.mu is None or abs(comparison.mu - inputs.mu) < 1e-12:
            return list(zip(comparison.unstable_hz, comparison.unstable_growth, strict=True))
    return None


def _rubs(case: Case) -> bool:
    """Whether anything depends on friction."""
    return bool(case.contacts) or MU in case.factor_names


def _modal_sentence(growing: list[tuple[float, float]] | None, state: str) -> str:
    if growing is None:
        return ""
    if not growing:
        return f"{state} is stable: no mode in the range of frequencies grows."
    named = [
        f"{measured(f, 0)} Hz (growth {measured(g, 0)} 1/s)" for f, g in sorted(growing, key=_growth_of, reverse=True)
    ]
    modes = "one mode grows" if len(named) == 1 else f"{len(named)} modes grow"
    return f"{state} is unstable: {modes}, {_listed(named)}."


def _onset_sentence(inputs: ReportInputs) -> str:
    onsets = inputs.onsets
    if onsets is None:
        return ""
    low, high = onsets.friction_range
    first = onsets.first
    if onsets.at_start:
        return f"It {' and '.join(onsets.at_start_words)}, before any onset."
    if first is None:
        if _grows_somewhere(inputs):
            return (
                f"No onset lies between {low:g} and {high:g} up to {_top(inputs)}, and yet modes grow there: they do "
                "so from the lower end on."
            )
        return f"No friction coefficient between {low:g} and {high:g} makes it unstable up to {_top(inputs)}."
    damping = "" if onsets.damped else " (without damping)"
    more = sum(1 for o in onsets.onsets if not o.stabilising) - 1
    text = f"It becomes unstable from μ = {measured(first.mu, 4)} on, at {measured(first.frequency_hz, 0)} Hz{damping}"
    if more:
        text += f"; {more} more onset{'s follow' if more > 1 else ' follows'} up to μ = {high:g}"
    return text + "."


def _grows_somewhere(inputs: ReportInputs) -> bool:
    """Whether any mode in the range of frequencies grows at any friction coefficient looked at."""
    return any(
        bool(np.any(found.unstable & (found.frequency_hz <= inputs.max_frequency_hz)))
        for found in (inputs.damped_sweep, inputs.modes)
        if found is not None
    )


def _run_sentence(inputs: ReportInputs) -> str:
    run = inputs.trajectory
    if run is None:
        return ""
    if not run.phases or not run.contact_names:
        return "The run in time has no contact to report on."
    last = run.phases[-1]
    text = f"In the run over {run.time[-1]:.3g} s the contact"
    shares: list[str] = []
    for name in run.contact_names:
        s = last.contacts[name]
        of, opens = f"of the phase “{last.name}”", f"{100 * s.separation_fraction:.0f} %"
        shares.append(
            f"{name} sticks {100 * s.stick_fraction:.0f} %, slips {100 * s.slip_fraction:.0f} % "
            + (f"{of} and is kept closed on request" if s.kept_closed else f"and is open {opens} {of}")
        )
    text += f"{'s' if len(shares) > 1 else ''} {_listed(shares)}"
    if inputs.dominant_hz is not None:
        below = stronger_below(run, inputs.max_frequency_hz)
        name = "dominant frequency" if below is None else "strongest line"
        text += f"; the {name} is {'' if below is None else 'at '}{measured(inputs.dominant_hz, 0)} Hz"
        text += "" if below is None else f", but {slower_is_stronger(below)}"
    if inputs.unsaturated is not None:
        text += f". {_growing_words(inputs.unsaturated)}"
    changed = changes_of(run)
    if changed:
        text += f". In its middle the model was changed ({'; '.join(changed)}): it is no run of one model"
    return text + (". It was interrupted before its planned end." if run.interrupted else ".")


def _growing_words(still: Unsaturated) -> str:
    """That a run is too short, and how to go on with it."""
    text = (
        "It is too short to show what the vibration settles to: in its last quarter hardly a node of the contacts "
        "changes between stick, slip and separation, so that it still grows as the modes say and what is loudest is a "
        "rest of the start"
    )
    if still.seconds_left is None:
        return f"{text}. Make the phase “{still.phase}” longer"
    unit, its_name = time_unit(still.seconds_left)
    return (
        f"{text}. Growing by {measured(still.growth_rate, 0)} 1/s, it takes about another "
        f"{significant(still.seconds_left / unit, 2)} {its_name} until the contact forces or the slip vibrate as much "
        f"as they are large. To go on from there: "
        f"phases.{still.phase}.duration = {still.duration:g} in the case, then stridor simulate CASE --restart "
        "CASE.out/simulate.nc, and stridor run CASE"
    )


def _agreement_sentence(inputs: ReportInputs) -> str:
    agreement = inputs.agreement
    if agreement is None:
        return ""
    texts: list[str] = []
    for c in agreement.comparisons:
        if len(c.unstable_hz) and c.perturbation.grows and not c.agrees:
            modal, seen = c.modal_eigenvalue, c.perturbation
            said = (
                f"at μ = {c.mu:g} both find growth, but at {measured(modal.imag / (2 * np.pi), 0)} Hz with "
                f"{measured(modal.real, 0)} 1/s by the modes and at {measured(seen.frequency_hz, 0)} Hz with "
                f"{measured(seen.growth_rate, 0)} 1/s in time"
            )
        elif len(c.unstable_hz) and c.perturbation.grows:
            said = (
                f"at μ = {c.mu:g} both find growth at {measured(c.perturbation.frequency_hz, 0)} Hz, with rates of "
                f"{measured(c.modal_eigenvalue.real, 0)} and {measured(c.perturbation.growth_rate, 0)} 1/s"
            )
        elif c.agrees:
            said = f"at μ = {c.mu:g} both find steady sliding stable"
        elif c.agrees is None and c.perturbation.shows:
            said = (
                f"at μ = {c.mu:g} the modes are {'unstable' if len(c.unstable_hz) else 'stable'} and the vibration "
                f"{'grows' if c.perturbation.grows else 'decays'} in time, but these are not known to be one motion"
            )
        elif c.agrees is None:
            said = f"at μ = {c.mu:g} the signal in time shows nothing to compare"
        else:
            said = f"at μ = {c.mu:g} they contradict each other"
        texts.append(said)
    row = critical_row(agreement)
    if row is not None and row.cells[1] and row.cells[2]:
        texts.append(f"the critical friction coefficient is {row.cells[1]} by the modes and {row.cells[2]} in time")
    opening = {
        True: "The modal and the temporal approach agree",
        False: "The modal and the temporal approach do not agree",
        None: "Whether the modal and the temporal approach agree is not decided",
    }[agreement.agree]
    return f"{opening}{': ' if texts else ''}{'; '.join(texts)}."


def _top(inputs: ReportInputs) -> str:
    return frequency_words(inputs.max_frequency_hz)


def _listed(items: list[str]) -> str:
    return items[0] if len(items) == 1 else ", ".join(items[:-1]) + " and " + items[-1]


def model_in_words(inputs: ReportInputs) -> list[str]:
    """Bodies, supports, loads, contacts and phases, a sentence each."""
    case = inputs.case
    lines: list[str] = []
    lines += [body_words(case, name, body) for name, body in case.bodies.items()]
    for name, support in case.supports.items():
        moving = [f"{v:g} {'rad/s' if d == 'rotation' else 'm/s'} ({d})" for d, v in support.velocity.items()]
        text = f"{name}: holds {_listed(list(support.fixed))} of {support.at}"
        text += f" and moves it with {_listed(moving)}" if moving else ""
        displaced = [f"{v:g} {'rad' if d == 'rotation' else 'm'} ({d})" for d, v in support.displacement.items()]
        lines.append(text + (f" and presses it away by {_listed(displaced)}." if displaced else "."))
    for name, load in case.loads.items():
        components = ", ".join(significant(f) for f in load.force)
        parts = [f"{np.linalg.norm(load.force):g} N, ({components}) N"] if any(load.force) else []
        parts += [f"a pressure of {load.pressure:g} Pa"] if load.pressure else []
        parts += [f"a moment of {load.moment:g} N m"] if load.moment else []
        if load.acts_on_bodies:
            lines.append(f"{name}: {_body_load(load)} on {_listed(list(load.bodies or ['all bodies']))}.")
        else:
            lines.append(f"{name}: pushes {load.at} with {_listed(parts or ['nothing'])}.")
    lines += [
        contact_words(name, contact, area=_has_area(inputs, name), timed=case.temporal.contact != "rigid")
        for name, contact in case.contacts.items()
    ]
    if inputs.system is not None:
        lines.append(f"In all {inputs.system.size} freedoms that are not held.")
    for name, tie in case.ties.items():
        lines.append(f"{name}: {tie.slave} is bonded to {tie.master}.")
    for name, spring in case.springs.items():
        cubic = f" and {spring.cubic:g} N/m³ times the cube" if spring.cubic else ""
        lines.append(f"{name}: a spring of {spring.stiffness:g} N/m{cubic} between {_listed(list(spring.between))}.")
    for name, dashpot in case.dashpots.items():
        lines.append(f"{name}: a dashpot of {dashpot.damping:g} N s/m between {_listed(list(dashpot.between))}.")
    if inputs.steady is not None and inputs.system is not None:
        nodes = inputs.system.contact_nodes()
        for k, name in enumerate(nodes.names):
            mine = nodes.owner == k
            force, speeds = inputs.steady.normal_force[mine].sum(), inputs.steady.slip_speed[mine]
            most = "" if len(speeds) == 1 else "up to "
            lines.append(
                f"In steady sliding contact {name} carries {force:.4g} N and slips at {most}{speeds.max():.4g} m/s."
            )
    return lines


def _has_area(inputs: ReportInputs, name: str) -> bool | None:
    """Whether the nodes of a contact have areas, None where there is no system to tell."""
    if inputs.system is None or name not in inputs.system.contact_nodes().names:
        return None
    nodes = inputs.system.contact_nodes()
    return not bool(np.isnan(nodes.area[nodes.owner == nodes.names.index(name)]).any())


def _body_load(load: Load) -> str:
    """Weight and centrifugal load in words."""
    parts: list[str] = []
    if load.gravity is not None:
        parts.append(f"gravity of ({', '.join(significant(g) for g in load.gravity)}) m/s²")
    if load.centrifugal is not None:
        parts.append(f"the centrifugal load of {significant(load.centrifugal.speed)} rad/s")
    return _listed(parts)


def simulation_table(inputs: ReportInputs) -> Table:
    """How the run in time was made."""
    case, run = inputs.case, inputs.trajectory
    lines: list[tuple[str, str]] = []
    for name, load in case.loads.items():
        if load.acts_on_bodies:
            lines.append((f"load {name}", _body_load(load)))
        elif any(load.force) or not load.pressure:
            lines.append((f"force {name}", f"{np.linalg.norm(load.force):g} N"))
        if load.pressure:
            lines.append((f"pressure {name}", f"{load.pressure:g} Pa"))
    for name, support in case.supports.items():
        lines += [
            (f"velocity {name}, {d}", f"{v:g} {'rad/s' if d == 'rotation' else 'm/s'}")
            for d, v in support.velocity.items()
        ]
    if inputs.mu is not None:
        lines.append(("friction coefficient μ", f"{inputs.mu:g}"))
    if run is not None:
        limit = f"stability limit of {'explicit steps' if run.path == 'exact' else 'the time step'}"
        bound = f"{significant(run.step_limit)} s, set by {run.limiting_body}"
        lines += [
            ("time step Δt", f"{significant(run.step)} s"),
            (limit, bound if math.isfinite(run.step_limit) else "none"),
            ("numerical damping β₂", f"{run.beta2:g}"),
            ("steps", f"{run.steps} of {run.planned_steps}" if run.interrupted else str(run.steps)),
            ("recorded", f"every {run.record_every} steps, {significant(run.sampling)} s"),
            ("unknowns of the time loop", f"{run.path} ({run.path_reason})"),
            ("wall time", f"{run.wall_seconds:.2f} s, {1e6 * run.wall_seconds / max(run.steps, 1):.2f} µs per step"),
        ]
    else:
        lines += [
            ("time step Δt", f"{significant(case.temporal.step)} s" if case.temporal.step else ""),
            ("numerical damping β₂", f"{case.temporal.beta2:g}"),
        ]
    for phase in case.phases:
        named = {**phase.loads, **phase.velocities, **phase.displacements}
        factors = [f"{n} × {v:g}" for n, v in named.items()]
        ramp = f", ramp {phase.ramp:g} s" if phase.ramp else ""
        lines.append(
            (f"phase “{phase.name}”", f"{phase.duration:g} s{ramp}" + (f": {', '.join(factors)}" if factors else ""))
        )
    rows = tuple(TableRow(line) for line in lines)
    return drop_empty(Table("simulation", "Simulation", ("", "value"), rows, frozenset({0, 1})))


def summary_table(inputs: ReportInputs) -> Table | None:
    """The verdict in numbers: modal against temporal."""
    agreement = inputs.agreement
    rows: list[TableRow] = []
    if agreement is not None:
        for c in agreement.comparisons:
            both = len(c.unstable_hz) > 0, c.perturbation.grows
            names = ("stable", "unstable")
            good = {True: "✓ agree", False: "✗ differ", None: "not decided"}[c.agrees]
            at = f"at μ = {c.mu:g}"
            seen = names[both[1]] if c.perturbation.shows else "not seen"
            cells = f"steady sliding {at}", names[both[0]], seen, "", good
            rows.append(TableRow(cells, "good" if c.agrees else "bad"))
            if any(both):
                modal = c.modal_eigenvalue
                here = c.perturbation
                rows.append(agreed(f"frequency {at} [Hz]", modal.imag / 2 / np.pi, here.frequency_hz, GOOD_FREQUENCY))
                rows.append(agreed(f"growth rate {at} [1/s]", modal.real, here.growth_rate, GOOD_GROWTH))
            alike = mac_row(c)
            if alike is not None:
                rows.append(alike)
        row = critical_row(agreement)
        if row is not None:
            rows.append(row)
    if not rows:
        return None
    return drop_empty(
        Table(
            "summary-table",
            "Modal against temporal",
            ("", "modal", "temporal", "difference", "verdict"),
            tuple(rows),
            frozenset({0, 4}),
        )
    )
