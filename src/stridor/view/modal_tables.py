"""Tables of frequencies, onsets and modes, computed beside printed where the case has a reference."""

from __future__ import annotations

from collections.abc import Sequence

from ..case.schema import ReferenceFrequency, ReferenceOnset
from ..digits import measured, readable
from ..modal.complex_modes import UNSTABLE_RELATIVE, ComplexModes
from ..modal.onsets import Onset, Onsets
from ..typing import Array
from .inputs import NamedFrequencies, ReportInputs
from .tables import (
    Table,
    TableRow,
    difference,
    drop_empty,
    is_far,
    number,
    paired,
    percent,
    powers,
    quantity,
    same_as_printed,
    significant,
)
from .units import frequency_words

SAME_ONSET = 0.05  # relative distance of frequencies within which a printed onset is the computed one
PRINTED = "Differences beyond 0.5 % are marked with ▲."


def frequency_tables(inputs: ReportInputs) -> list[Table]:
    """Frequencies of each body alone and of all in contact without friction."""
    reference = inputs.case.reference
    tables = [
        body_table(name, modes, reference.bodies.get(name, ()) if reference else ())
        for name, modes in inputs.body_modes.items()
    ]
    # A stiff body has none in the band.
    tables = [table for table in tables if table.rows]
    if inputs.coupled_hz is not None:
        printed = reference.coupled if reference else ()
        tables.append(coupled_table(inputs.coupled_hz, printed, inputs.undamped_onsets))
    return tables


def body_table(name: str, modes: NamedFrequencies, printed: tuple[ReferenceFrequency, ...]) -> Table:
    """Natural frequencies of one body, beside the printed ones."""
    rows: list[TableRow] = []
    for i, j in paired(modes.frequency_hz, [p.frequency_hz for p in printed]):
        label = modes.labels[i] if i is not None and i < len(modes.labels) else ""
        other = printed[j] if j is not None else None
        if other is not None and other.label and label and other.label != label:
            label = f"{label} (printed {other.label})"
        elif not label and other is not None:
            label = other.label
        computed = float(modes.frequency_hz[i]) if i is not None else None
        rows.append(_frequency_row((label,), computed, other, bool(printed)))
    heads = ("mode", "computed [Hz]", "printed [Hz]", "difference", "note")
    caption = " ".join(filter(None, [_label_words(modes.labels), PRINTED if printed else ""]))
    return drop_empty(Table(f"frequencies-{name}", f"{name} alone", heads, tuple(rows), frozenset({0, 4}), caption))


def _label_words(labels: Sequence[str]) -> str:
    """What the letters of these labels are."""
    letters = {label.rstrip("0123456789") for label in labels}
    words = {"F": "F: bending", "T": "T: traction", "FT": "FT: both", "E": "E: elastic"}
    said = ", ".join(word for letter, word in words.items() if letter in letters)
    return f"{said}." if said else ""


def coupled_table(frequencies: Array, printed: tuple[ReferenceFrequency, ...], onsets: Onsets | None) -> Table:
    """Frequencies in contact without friction; which of them meet where."""
    meets: dict[int, str] = {}
    for onset in reversed(onsets.onsets if onsets is not None else ()):
        # What diverges, or grows because other nodes touch, meets none.
        for branch in set(onset.branches) if onset.kind == "flutter" and len(set(onset.branches)) > 1 else ():
            meets[branch] = f"μ = {measured(onset.mu, 4)}, {measured(onset.frequency_hz, 0)} Hz"
    rows: list[TableRow] = []
    for i, j in paired(frequencies, [p.frequency_hz for p in printed]):
        first = (str(i + 1) if i is not None else "", meets.get(i + 1, "") if i is not None else "")
        computed = float(frequencies[i]) if i is not None else None
        rows.append(_frequency_row(first, computed, printed[j] if j is not None else None, bool(printed)))
    # The place of a mode first, the meeting point after the numbers.
    moved = tuple(TableRow((r.cells[0], *r.cells[2:5], r.cells[1], r.cells[5]), r.kind) for r in rows)
    heads = ("mode", "computed [Hz]", "printed [Hz]", "difference", "meets another at", "note")
    caption = f"Undamped, friction coefficient zero. {PRINTED if printed else ''}".strip()
    return drop_empty(
        Table("frequencies-coupled", "In contact, without friction", heads, moved, frozenset({4, 5}), caption)
    )


def _frequency_row(
    first: tuple[str, ...], computed: float | None, printed: ReferenceFrequency | None, compared: bool
) -> TableRow:
    if printed is None:
        note = "not printed in the source" if compared else ""
        return TableRow((*first, quantity(computed, 1), "", "", note), "new" if compared else "")
    fraction = difference(computed, printed.frequency_hz) if computed is not None else None
    mark = " ▲" if is_far(fraction) else ""
    note = printed.note if computed is not None else "; ".join(filter(None, [printed.note, "not computed"]))
    cells = (quantity(computed, 1), significant(printed.frequency_hz, 8), percent(fraction) + mark, note)
    return TableRow((*first, *cells), "far" if mark or computed is None else "")


def onset_tables(inputs: ReportInputs) -> list[Table]:
    """Onsets beside printed ones, and how well each is solved."""
    tables: list[Table] = []
    printed = inputs.case.reference.onsets if inputs.case.reference else ()
    for onsets in inputs.told_onsets:
        if not onsets.onsets:
            continue
        tables.append(_onsets(onsets, "damped" if onsets.damped else "undamped", printed))
        printed = ()  # compared once
    solved = [onset for o in inputs.told_onsets for onset in o.onsets]
    if solved:
        tables.append(_solutions(solved))
    return tables


def _onsets(onsets: Onsets, name: str, printed: tuple[ReferenceOnset, ...]) -> Table:
    rows: list[TableRow] = []
    partners = _onset_partners(onsets.onsets, printed)
    for number_, onset in enumerate(onsets.onsets):
        other = partners.get(number_)
        f_diff = difference(onset.frequency_hz, other.frequency_hz) if other else None
        mu_diff = difference(onset.mu, other.mu) if other else None
        rounded = other is not None and same_as_printed(onset.mu, other.mu)
        mark = " ▲" if is_far(mu_diff) and not rounded else ""
        remark = percent(mu_diff, 1) + mark + (" ≙" if rounded else "")
        rows.append(
            TableRow(
                (
                    quantity(onset.mu, 5),
                    significant(other.mu, 8) if other else "",
                    remark,
                    quantity(onset.frequency_hz, 1),
                    significant(other.frequency_hz, 8) if other else "",
                    percent(f_diff),
                    onset.branch_words(" and "),
                    "" if onset.kind == "flutter" else onset.kind,
                    _remark(onset),
                    other.note if other else "",
                ),
                "far" if mark or is_far(f_diff) else "",
            )
        )
    lost = [p for p in printed if p not in partners.values()]
    inside = [p for p in lost if onsets.friction_range[0] <= p.mu <= onsets.friction_range[1]]
    for p in inside:
        cells = ("", significant(p.mu, 8), "", "", significant(p.frequency_hz, 8), "", "", "", "not found here", p.note)
        rows.append(TableRow(cells, "far"))
    heads = (
        "critical μ",
        "printed μ",
        "difference",
        "frequency [Hz]",
        "printed [Hz]",
        "difference",
        "modes",
        "kind",
        "remark",
        "note",
    )
    low, high = onsets.friction_range
    caption = (
        f"All onsets with {low:g} ≤ μ ≤ {high:g} and frequencies up to {frequency_words(onsets.max_frequency_hz)}, "
        f"{'with structural damping' if onsets.damped else 'without damping'}. Modes are numbered by frequency "
        "at μ = 0."
    )
    if all(o.kind == "flutter" for o in onsets.onsets):
        caption += " All are flutter: growth begins or ends at a frequency."
    if printed:
        caption += " Differences beyond 0.5 % are marked with ▲; ≙: equal when rounded to the digits printed."
    return drop_empty(Table(f"onsets-{name}", f"Onsets, {name}", heads, tuple(rows), frozenset({6, 7, 8, 9}), caption))


def _remark(onset: Onset) -> str:
    if onset.enters_at is not None:
        return f"above the band, comes into it at μ ≈ {onset.enters_at:.3g}"
    return "growth ends here" if onset.stabilising else ""


def _onset_partners(found: tuple[Onset, ...], printed: tuple[ReferenceOnset, ...]) -> dict[int, ReferenceOnset]:
    pairs = paired([o.frequency_hz for o in found], [p.frequency_hz for p in printed])
    partners: dict[int, ReferenceOnset] = {}
    for i, j in pairs:
        if i is None or j is None:
            continue
        if abs(found[i].frequency_hz - printed[j].frequency_hz) <= SAME_ONSET * printed[j].frequency_hz:
            partners[i] = printed[j]
    return partners


def _solutions(found: list[Onset]) -> Table:
    """How each onset was solved and how growth opens beyond it."""
    rows: list[TableRow] = []
    for onset in found:
        point = onset.exceptional_mu
        exceptional = ""
        if point is not None:
            sign = "+" if point.imag >= 0 else "−"
            exceptional = f"{quantity(point.real, 7)} {sign} {significant(abs(point.imag), 2)} j"
        rows.append(
            TableRow(
                (
                    "damped" if onset.damped else "undamped",
                    quantity(onset.mu, 10),
                    quantity(onset.frequency_hz, 4),
                    significant(onset.residual, 2),
                    significant(onset.square_root_coefficient, 5),
                    significant(onset.growth_slope, 4),
                    exceptional,
                )
            )
        )
    heads = ("", "critical μ", "frequency [Hz]", "residual", "κ [1/s]", "d Re λ/dμ [1/s]", "exceptional point μ")
    caption = (
        "Residual: componentwise backward error of the eigenpair in the assembled matrices. Beyond an undamped onset "
        "the growth rate opens as κ √(μ − μc); with damping, two eigenvalues are equal at the exceptional point, a "
        "complex μ close by, and growth crosses zero with the slope given."
    )
    return drop_empty(
        Table("onset-solutions", "How the onsets are solved", heads, tuple(rows), frozenset({0}), caption)
    )


def modes_table(modes: ComplexModes, mu: float, max_frequency_hz: float, damping: str) -> Table:
    """Complex modes at one μ, by frequency; damping: whether they are with it, in words."""
    row = modes.at(mu)
    order = [int(b) for b in modes.order(row) if modes.frequency_hz[row, b] <= max_frequency_hz]
    rows = tuple(
        TableRow(
            (
                str(int(modes.branch[b])),
                powers(readable(float(modes.frequency_hz[row, b]))),
                powers(
                    readable(
                        float(modes.growth_rate[row, b]),
                        zero=UNSTABLE_RELATIVE * abs(complex(modes.eigenvalues[row, b])),
                    )
                ),
                number(100 * float(modes.damping_ratio[row, b]), 4),
                "unstable" if modes.unstable[row, b] else "stable",
                significant(float(modes.residual[row, b]), 2),
            ),
            "unstable" if modes.unstable[row, b] else "",
        )
        for b in order
    )
    heads = ("mode", "frequency [Hz]", "growth rate [1/s]", "damping ratio [%]", "", "residual")
    caption = f"Up to {frequency_words(max_frequency_hz)}, {damping}. Growth rate is Re λ: positive grows."
    if modes.completeness:
        caption += f" {modes.completeness[row]}"
    return Table("modes", f"Complex modes at μ = {modes.mu[row]:g}", heads, rows, frozenset({4}), caption)
