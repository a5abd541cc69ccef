"""Tables of the run in time and of the comparison of both approaches."""

from __future__ import annotations

import numpy as np

from ..agreement import GOOD_CRITICAL, GOOD_FREQUENCY, GOOD_GROWTH, GOOD_MAC, SAME_DECAY, Agreement, Comparison
from ..modal.complex_modes import ComplexModes
from ..temporal.attractor import settled_contacts
from ..temporal.energy import EnergyBalance
from ..temporal.trajectory import Trajectory
from .inputs import ReportInputs
from .tables import (
    Table,
    TableRow,
    assigned,
    difference,
    drop_empty,
    is_far,
    number,
    percent,
    quantity,
    same_as_printed,
    significant,
)
from .units import energy_unit
from .windows import Window

SAME_MODE = 0.02  # |Δλ|/|λ| within which an identified component is that mode


def contact_table(trajectory: Trajectory) -> Table:
    """Statistics of every contact in every phase, from every step."""
    rows = tuple(
        TableRow(
            (
                phase.name,
                name,
                number(100 * s.stick_fraction, 1),
                number(100 * s.slip_fraction, 1),
                number(100 * s.separation_fraction, 1) + (", kept closed" if s.kept_closed else ""),
                quantity(s.max_normal_force, 1),
                quantity(s.max_tangential_force, 2),
                quantity(s.max_slip_speed, 4),
                significant(s.first_stick, 5),
                significant(s.first_separation, 5),
            )
        )
        for phase in trajectory.phases
        for name, s in phase.contacts.items()
    )
    heads = (
        "phase",
        "contact",
        "stick [%]",
        "slip [%]",
        "separation [%]",
        "largest normal force [N]",
        "largest friction force [N]",
        "largest slip speed [m/s]",
        "first stick [s]",
        "first separation [s]",
    )
    caption = "Counted in every step of the run, not only in the recorded ones; extrema include single impacts."
    if settled_contacts(trajectory):
        caption += (
            " Contacts separate in the last phase, and such motion is as a rule chaotic: its largest values are those "
            "of this one trajectory and come out different on another machine, unlike the averages of the next table."
        )
    if any(s.kept_closed for phase in trajectory.phases for s in phase.contacts.values()):
        caption += (
            " Contacts kept closed on request cannot separate: their 0 % says nothing of the loads, and their largest "
            "normal force may be one that pulls."
        )
    return drop_empty(Table("contacts", "What the contacts did", heads, rows, frozenset({0, 1}), caption))


def settled_table(trajectory: Trajectory) -> Table | None:
    """Averages from the first separation of the last phase on, None where no contact separates in it."""
    found = settled_contacts(trajectory)
    if not found:
        return None
    rows = tuple(
        TableRow(
            (
                name,
                significant(part.since, 5),
                str(part.peaks),
                quantity(part.averages.mean_peak_normal_force, 1),
                quantity(part.averages.quantile_05_normal_force, 1),
                quantity(part.averages.quantile_50_normal_force, 1),
                quantity(part.averages.quantile_95_normal_force, 1),
                number(100 * part.averages.stick_fraction, 1),
                number(100 * part.averages.slip_fraction, 1),
                number(100 * part.averages.separation_fraction, 1),
            )
        )
        for name, part in found.items()
    )
    heads = (
        "contact",
        "from [s]",
        "peaks",
        "mean peak [N]",
        "5 % quantile [N]",
        "median [N]",
        "95 % quantile [N]",
        "stick [%]",
        "slip [%]",
        "separation [%]",
    )
    caption = (
        "Normal force from the first separation of the last phase to its end, from the records; a peak is the largest "
        "force of each stretch above the mean. These belong to the motion that the run settles to rather than to the "
        "one trajectory; how far they scatter, stridor simulate --copies 4 tells."
    )
    return Table("settled", "What another run would share", heads, rows, frozenset({0}), caption)


def energy_table(balance: EnergyBalance) -> Table:
    """Where the energy came from and where it went."""
    entries = (
        ("at the start", balance.initial, 1),
        ("put in by loads", balance.external, 1),
        ("put in by moving supports", balance.support, 1),
        ("taken out by damping", balance.damping, -1),
        ("taken out by friction", balance.friction, -1),
        ("into impacts and springs of contacts", balance.contact, -1),
        ("stored at the end as motion", balance.kinetic, -1),
        ("stored at the end as deformation", balance.elastic, -1),
    )
    unit, its_name = energy_unit(max(abs(value) for _, value, _ in entries))
    rows = [TableRow((name, quantity(value / unit, 4))) for name, value, _ in entries]
    missing = sum(sign * value for _, value, sign in entries)
    rows.append(TableRow(("missing at the end", significant(missing / unit, 2)), "good" if balance.closes else "bad"))
    caption = (
        f"Largest imbalance at any time: {significant(balance.error, 2)} of the largest energy that changed hands"
        if balance.checked
        else "Not checked: fewer than two records"
    )
    if balance.checked and balance.vibration_error is not None and (balance.told or not balance.closes):
        caption += f", {significant(balance.vibration_error, 2)} of that of the vibration"
    elif balance.checked and balance.vibration_error is not None:
        caption += ", rounding, beside which the vibration has too little energy to be checked"
    caption += "."
    return Table("energy", "Energy balance", ("", f"energy [{its_name}]"), tuple(rows), frozenset({0}), caption)


def agreement_table(comparison: Comparison) -> Table:
    """Both approaches at one μ."""
    modal, temporal = comparison.modal_eigenvalue, comparison.perturbation
    unstable = len(comparison.unstable_hz) > 0
    names = {True: "unstable", False: "stable"}
    undecided = comparison.agrees is None
    # Growth that is less than what a signal tells by itself may still be told by the mode it is equal to.
    grows = unstable if comparison.agrees else temporal.grows
    same = unstable == grows and not undecided
    seen = names[grows] if temporal.shows else "not seen"
    judged = "not decided" if undecided else _judged(same)
    rows = [TableRow(("steady sliding is", names[unstable], seen, "", judged), _kind(same))]
    rows += [] if not comparison.marched else [
        agreed("frequency [Hz]", modal.imag / (2 * np.pi), temporal.frequency_hz, GOOD_FREQUENCY),
        agreed("growth rate [1/s]", modal.real, temporal.growth_rate, GOOD_GROWTH if unstable else SAME_DECAY),
    ]
    if comparison.growth_mac is not None:
        mac = comparison.growth_mac
        name = "likeness of shapes (MAC), small perturbation against mode"
        rows.append(TableRow((name, "", number(mac, 3), "", _likeness(mac))))
    if comparison.dominant_frequency_hz is not None:
        heard = comparison.dominant_frequency_hz
        mode = None if comparison.responding is None else comparison.unstable_hz[comparison.responding]
        error = None if mode is None else heard / mode - 1
        rows.append(
            TableRow(
                (
                    "dominant frequency of the full run [Hz]",
                    quantity(mode, 1),
                    quantity(heard, 1),
                    percent(error),
                    _responds(comparison.stronger_below_hz, mode),
                )
            )
        )
    if comparison.run_growth is not None:
        fitted = comparison.run_growth
        rate = quantity(fitted.rate, 1) if fitted.exponential else "nowhere exponential"
        rows.append(TableRow(("growth fitted in the full run [1/s]", "", rate, "", fitted.state)))
    if comparison.mac is not None and comparison.responding is not None:
        rows.append(
            TableRow(
                (
                    "likeness of shapes (MAC), full run against mode",
                    "",
                    number(comparison.mac, 3),
                    "",
                    _likeness(comparison.mac),
                )
            )
        )
    title = f"Both approaches at μ = {comparison.mu:g}"
    caption = (
        "Small perturbations of steady sliding obey the equations that the modes solve: frequency and growth rate must "
        "be equal up to the accuracy of the time step. The full run sticks, slips and separates; it may only be "
        "similar, and the growth fitted there, from a sudden start and with sticking, is no measure of Re λ."
    )
    heads = ("", "modal", "temporal", "difference", "")
    return Table(f"agreement-{comparison.mu:g}", title, heads, tuple(rows), frozenset({0, 4}), caption)


def _responds(below_hz: float | None, mode_hz: float | None) -> str:
    if below_hz is not None:
        return f"what is slower than {quantity(below_hz, 1)} Hz is stronger"
    return "an unstable mode responds" if mode_hz is not None else "no unstable mode within 5 %"


def _likeness(mac: float) -> str:
    if mac >= GOOD_MAC:
        return "alike"
    return "alike in part" if mac >= 0.5 * GOOD_MAC else "not alike"


def mac_row(comparison: Comparison) -> TableRow | None:
    """Likeness of the shapes of run and mode as a line of the summary."""
    # Without an unstable mode that answers there is no shape to hold the run against.
    if comparison.mac is None or comparison.responding is None:
        return None
    name = f"likeness of run and mode (MAC) at μ = {comparison.mu:g}"
    return TableRow((name, "", number(comparison.mac, 3), "", _likeness(comparison.mac)))


def agreed(name: str, modal: float, temporal: float, limit: float) -> TableRow:
    """One quantity by both approaches, judged by a relative limit."""
    error = (temporal - modal) / abs(modal) if modal else None
    good = error is not None and abs(error) <= limit
    return TableRow((name, quantity(modal, 1), quantity(temporal, 1), percent(error, 3), _judged(good)), _kind(good))


def _judged(good: bool) -> str:
    return "✓ agree" if good else "✗ differ"


def _kind(good: bool) -> str:
    return "good" if good else "bad"


def critical_row(agreement: Agreement) -> TableRow | None:
    """Critical friction of both approaches as a line of the summary."""
    modal, temporal = agreement.critical_mu_modal, agreement.critical_mu_temporal
    if modal is None and temporal is None:
        return None
    if modal is None or temporal is None:
        return TableRow(("critical friction coefficient", quantity(modal, 5), quantity(temporal, 5), "", ""))
    width = agreement.bracket[1] - agreement.bracket[0] if agreement.bracket else 0.0
    good = abs(modal - temporal) <= max(width, GOOD_CRITICAL * modal)
    cells = ("critical friction coefficient", quantity(modal, 5), quantity(temporal, 5), percent(temporal / modal - 1))
    return TableRow((*cells, _judged(good)), _kind(good))


def identified_table(comparison: Comparison, modes: ComplexModes, max_frequency_hz: float) -> Table:
    """Every component found in the time signal beside the complex mode it is."""
    lam = modes.eigenvalues[modes.at(comparison.mu)]
    lam = lam[(lam.imag > 0) & (lam.imag <= 2 * np.pi * max_frequency_hz)]
    lam = lam[np.argsort(lam.imag)]
    found = comparison.perturbation.components.eigenvalues
    partners = assigned(np.abs(lam[:, None] - found) / np.abs(lam)[:, None], SAME_MODE) if len(found) else {}
    rows: list[TableRow] = []
    for i, mode in enumerate(lam):
        j = partners.get(i)
        seen = complex(found[j]) if j is not None else None
        rows.append(
            TableRow(
                (
                    quantity(mode.imag / (2 * np.pi), 1),
                    quantity(seen.imag / (2 * np.pi), 1) if seen is not None else "",
                    percent(seen.imag / mode.imag - 1, 3) if seen is not None else "",
                    quantity(mode.real, 1),
                    quantity(seen.real, 1) if seen is not None else "",
                    "" if seen is not None else "not seen in the signal",
                ),
                "unstable" if mode.real > 0 else "",
            )
        )
    heads = ("modal [Hz]", "in time [Hz]", "difference", "Re λ modal [1/s]", "Re λ in time [1/s]", "")
    spare = len(found) - len(partners)
    caption = (
        f"Components of the perturbed slip speed at μ = {comparison.mu:g}, taken apart by the matrix pencil, and the "
        "complex modes nearest to them. A mode that barely slides leaves no trace in the slip speed."
    )
    if spare:
        belong = "components of the signal belong" if spare > 1 else "component of the signal belongs"
        caption += f" {spare} weak {belong} to no mode."
    return drop_empty(Table("identified", "Modes found in time", heads, tuple(rows), frozenset({5}), caption))


def computed_values(inputs: ReportInputs, window: Window | None) -> dict[str, tuple[float, str]]:
    """Values of this run by the names a reference may use, each with what it is."""
    values: dict[str, tuple[float, str]] = {}
    if inputs.dominant_hz is not None:
        values["dominant_frequency_hz"] = (inputs.dominant_hz, "second half of the last phase")
    if window is not None:
        origin = f"in the window of the contact figure ({window.reason})"
        values["max_normal_force"] = (window.max_normal_force, origin)
        values["max_slip_speed"] = (window.max_slip_speed, origin)
        values["stick_fraction"] = (window.stick_fraction, origin)
    agreement = inputs.agreement
    if agreement is not None and agreement.comparisons:
        values["growth_rate"] = (agreement.comparisons[0].modal_eigenvalue.real, "modal")
    if agreement is not None and agreement.critical_mu_temporal is not None:
        values["critical_mu_temporal"] = (agreement.critical_mu_temporal, "bisection in time")
    first = None if inputs.damped_onsets is None else inputs.damped_onsets.first
    if first is not None:
        values["critical_mu_modal"] = (first.mu, "first damped onset")
    elif agreement is not None and agreement.critical_mu_modal is not None:
        values["critical_mu_modal"] = (agreement.critical_mu_modal, "first onset")
    values.update({name: (value, inputs.value_notes.get(name, "")) for name, value in inputs.values.items()})
    return values


def values_table(inputs: ReportInputs, window: Window | None) -> Table | None:
    """Other printed values beside those computed here."""
    reference = inputs.case.reference
    if reference is None or not reference.values:
        return None
    known = computed_values(inputs, window)
    rows: list[TableRow] = []
    for printed in reference.values:
        computed, what = known.get(printed.name, (None, ""))
        fraction = difference(computed, printed.value) if computed is not None else None
        rounded = computed is not None and same_as_printed(computed, printed.value)
        mark = " ▲" if is_far(fraction) and not rounded else ""
        rows.append(
            TableRow(
                (
                    printed.name.removesuffix("_hz").replace("_mu", " μ").replace("_", " "),
                    significant(computed, 5) if computed is not None else "not computed",
                    significant(printed.value, 8),
                    printed.unit,
                    percent(fraction, 1) + mark + (" ≙" if rounded else ""),
                    "; ".join(filter(None, [what, printed.note])),
                ),
                "far" if mark else "",
            )
        )
    heads = ("value", "computed", "printed", "unit", "difference", "note")
    return drop_empty(
        Table(
            "values",
            "Other values of the source",
            heads,
            tuple(rows),
            frozenset({0, 3, 5}),
            "Differences beyond 0.5 % are marked with ▲; ≙: equal when rounded to the digits printed.",
        )
    )
