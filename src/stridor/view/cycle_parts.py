"""The chapter of a report on limit cycles: branches over friction, one period of the loudest, a table."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from ..digits import hertz, readable
from ..periodic import Cycle, CycleBranch, Cycles
from .cycle_plots import cycle_branches, cycle_period, loudest_contact
from .inputs import ReportInputs
from .page_parts import ReportFigure
from .tables import Table, TableRow

STABLE = {True: "yes", False: "no", None: "undecided"}
WORTH = 6  # cycles between the ends of a branch


def loudest(result: Cycles) -> Cycle:
    """The cycle with the largest slip amplitude, of those that are stable if there are any."""
    stable = [c for c in result.cycles if c.stable] or list(result.cycles)
    return max(stable, key=lambda c: c.slip_amplitude)


def worth_a_row(result: Cycles) -> list[int]:
    """Numbers of the cycles that a short table shows: single ones, and of a branch its ends, its folds and about six
    between."""
    followed = {k for branch in result.branches for k in branch.cycles}
    found = set(range(len(result.cycles))) - followed
    for own in result.branches:
        found |= {own.cycles[0], own.cycles[-1], *own.folds, *own.cycles[:: max(len(own.cycles) // WORTH, 1)]}
    return sorted(found)


def branch_words(result: Cycles) -> list[str]:
    """Each branch in a line: how many cycles, what it was followed from where that is no onset, from where to where,
    what happens between."""
    return [
        f"branch {k}, {len(branch.cycles)} cycles{_followed_from(branch)}: "
        + "; ".join((branch.begins, *(b.sentence for b in branch.bifurcations), branch.ends))
        for k, branch in enumerate(result.branches, start=1)
    ]


def _followed_from(branch: CycleBranch) -> str:
    told = branch.reached_from
    return f", followed from {told}" if told and not told.startswith("the onset") else ""


def cycle_words(result: Cycles) -> tuple[str, ...]:
    """What was found and how, what it means, what a reader must know."""
    methods = {c.method for c in result.cycles}
    ways = {"shooting": "shooting on the exact motion", "harmonic": "harmonic balance"}
    by = " and ".join(way for name, way in ways.items() if name in methods)
    made = str(result.provenance.get("created", ""))[:10]
    said = [
        f"Limit cycles{f', by {by}' if by else ''}{f', computed on {made}' if made else ''}: "
        f"{result.sentence}. Motions end in stable cycles; an unstable one is the border between two states."
    ]
    return (*said, *(f"{line[0].upper()}{line[1:]}." for line in result.warnings))


def cycle_table(result: Cycles) -> Table | None:
    """A row for each cycle that `worth_a_row` names."""
    rows: list[TableRow] = []
    for k in worth_a_row(result):
        c, branch = result.cycles[k], result.branch_of(k)
        force, shares = float(c.force_range[:, 1].max()), c.shares.max(axis=0)
        cells = (
            "" if branch is None else f"{branch + 1}", f"{c.mu:.6g}", hertz(c.frequency_hz).removesuffix(" Hz"),
            STABLE[c.stable] if c.multiplied else "unknown",
            f"{c.largest_multiplier:.4g}" if c.multiplied else "", readable(c.slip_amplitude, 4), readable(force, 4),
            f"{100 * shares[1]:.1f} %", f"{100 * shares[0]:.1f} %", ", ".join(c.kinds),
        )  # fmt: skip
        rows.append(TableRow(cells, "unstable" if c.stable is False else ""))
    if not rows:
        return None
    heads = (
        "branch", "μ", "frequency [Hz]", "stable", "largest multiplier", "slip amplitude [m/s]", "largest force [N]",
        "stick", "open", "with",
    )  # fmt: skip
    left = len(result.cycles) - len(rows)
    caption = (
        "Largest Floquet multiplier: below one disturbances die out. Stick and open: the largest shares of the period "
        f"of a contact.{f' {left} more cycles are in cycles.csv.' if left else ''}"
    )
    return Table("cycles", "Limit cycles", heads, tuple(rows), frozenset({3, 9}), caption)


def cycle_figures(inputs: ReportInputs) -> Iterator[ReportFigure]:
    """Branches with the run, where it has settled, and the loudest cycle over a period."""
    result, run = inputs.cycles, inputs.trajectory
    if result is None or not (result.cycles or result.onsets):
        return
    shown = run is not None and inputs.mu is not None and not inputs.beside_cycles
    runs = [(inputs.mu, run)] if shown and inputs.mu is not None and run is not None and len(run.time) else []
    yield ReportFigure(
        "cycle-branches",
        "Limit cycles over friction",
        "Half the range of the slip velocity, of the contact where it is largest of those that touch, and the "
        "frequency. Drawn through: stable; dashed: unstable; dotted: undecided or unknown. Diamonds: folds. "
        "Triangles: onsets of growth of steady sliding."
        + (" Lines are broken where there are more harmonics." if len({c.harmonics for c in result.cycles}) > 1 else "")
        + (" Cross: the run in time, over the last quarter of its last phase." if runs else "")
        + (f" The run in time is not drawn beside them: {inputs.beside_cycles}." if inputs.beside_cycles else ""),
        "Slip amplitude and frequency of limit cycles over the friction coefficient.",
        partial(cycle_branches, result, runs),
    )
    if not result.cycles:
        return
    cycle = loudest(result)
    contact = cycle.contact_names[loudest_contact(cycle)]
    yield ReportFigure(
        "cycle-period",
        f"One period at μ = {cycle.mu:.6g}",
        f"The loudest {'stable ' if cycle.stable else ''}cycle, {hertz(cycle.frequency_hz)}: forces and slip velocity "
        f"of contact {contact}, on the colour of what it does.",
        f"Normal and friction force and slip velocity of contact {contact} over one period, with stick, slip and "
        "separation shaded.",
        partial(cycle_period, cycle, contact),
    )
