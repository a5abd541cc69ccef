"""The report: one HTML file that needs nothing else, and every figure as PNG and SVG beside it."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from ..case.repeating import in_alike, repeating
from ..mesh.paths import in_one_line
from ..stages import passing, stage
from .body_words import bodies_table
from .change_parts import change_figures, change_tables, change_words, mechanism_table
from .cycle_parts import branch_words, cycle_figures, cycle_table, cycle_words
from .figures import agreement_figures, modal_figures, model_figures, temporal_figures
from .inputs import ReportInputs
from .modal_tables import frequency_tables, modes_table, onset_tables
from .page_parts import ReportFigure, data_url, filled, rendered
from .style import lay_out
from .surface_figures import contact_figures, shape_figures, surface_table
from .tables import Table, TableRow, number
from .temporal_tables import (
    agreement_table,
    contact_table,
    energy_table,
    identified_table,
    settled_table,
    values_table,
)
from .windows import Window, regime_window
from .words import model_in_words, simulation_table, summary_table, verdict


@dataclass(frozen=True)
class Chapter:
    """A chapter: anchor, title, opening paragraphs, a list of short lines, then tables and figures in turn."""

    name: str
    title: str
    paragraphs: tuple[str, ...] = ()
    lines: tuple[str, ...] = ()
    parts: tuple[Table | ReportFigure, ...] = ()

    @property
    def empty(self) -> bool:
        """Whether there is nothing to show."""
        return not (self.paragraphs or self.lines or self.parts)


@passing()
def write_report(inputs: ReportInputs, folder: Path) -> Path:
    """Write folder/report.html and folder/figures/NAME.png and .svg; the path of the page.

    Each file appears whole or not at all, and what cannot be drawn is named in its chapter. Raises OSError where the
    folder cannot be written.
    """
    folder = Path(folder)
    figures = folder / "figures"
    figures.mkdir(parents=True, exist_ok=True)
    stage("tables and figures of the page")
    chapters: list[Chapter] = []
    drawings: dict[str, str] = {}
    for chapter in sections(inputs):
        undrawn: dict[str, str] = {}
        for part in chapter.parts:
            if not isinstance(part, ReportFigure):
                continue
            stage(f"figure {part.name}, as SVG and PNG", logged=False)
            try:
                lay_out(part.figure)
                vector, points = rendered(part.figure, "svg"), rendered(part.figure, "png")
            except Exception as error:  # whatever one figure fails of, the others and the tables are there
                undrawn[part.name] = f"Not drawn: {part.title}, {type(error).__name__}: {in_one_line(error)}"
                continue
            _write(figures / f"{part.name}.svg", vector)
            _write(figures / f"{part.name}.png", points)
            drawings[part.name] = data_url(vector, "svg")
        drawn = tuple(part for part in chapter.parts if part.name not in undrawn or isinstance(part, Table))
        chapters.append(replace(chapter, lines=(*chapter.lines, *undrawn.values()), parts=drawn))
    page = folder / "report.html"
    _write(page, render(inputs, chapters, drawings).encode("utf-8"))
    return page


def render(inputs: ReportInputs, chapters: list[Chapter], drawings: dict[str, str]) -> str:
    """The page as HTML; drawings holds each figure's picture as a data URL."""
    reference = inputs.case.reference
    places = inputs.source_places
    numbers = {
        part.name: count
        for count, part in enumerate(
            (p for chapter in chapters for p in chapter.parts if isinstance(p, ReportFigure)), start=1
        )
    }
    return filled(
        "report.html.j2",
        inputs=inputs,
        title=inputs.case.title or "Friction-induced instabilities",
        verdict=verdict(inputs),
        summary=summary_table(inputs),
        sections=chapters,
        drawings=drawings,
        numbers=numbers,
        places={name: place for name, place in places.items() if reference is not None},
        reference=reference,
        settings=inputs.case.to_toml(defaults=True),
        is_table=_is_table,
        about_tables=about_tables(inputs),
    )


def _is_table(part: Table | ReportFigure) -> bool:
    return isinstance(part, Table)


def sections(inputs: ReportInputs) -> list[Chapter]:
    """All chapters that have something to show."""
    window = _window(inputs)
    chapters = [
        Chapter(
            "model",
            "The model",
            lines=tuple(model_in_words(inputs)),
            parts=(*model_figures(inputs), bodies_table(inputs.case), *_surfaces(inputs)),
        ),
        Chapter("frequencies", "Natural frequencies", parts=tuple(frequency_tables(inputs))),
        _modal(inputs),
        _changes(inputs),
        _temporal(inputs, window),
        _cycles(inputs),
        _agreement(inputs),
        _reference(inputs, window),
    ]
    return [chapter for chapter in chapters if not chapter.empty]


def _surfaces(inputs: ReportInputs) -> tuple[Table, ...]:
    table = surface_table(inputs)
    return () if table is None else (table,)


def _window(inputs: ReportInputs) -> Window | None:
    run = inputs.trajectory
    if run is None or not run.contact_names or not run.phases or len(run.time) < 3:
        return None
    still = inputs.unsaturated
    return regime_window(run, inputs.dominant_hz if still is None else still.frequency_hz)


def _modal(inputs: ReportInputs) -> Chapter:
    parts: list[Table | ReportFigure] = [*onset_tables(inputs), *modal_figures(inputs)]
    parts.extend(shape_figures(inputs))
    mechanisms = mechanism_table(inputs)
    parts.extend(() if mechanisms is None else (mechanisms,))
    if inputs.modes is not None:
        mu = float(inputs.modes.mu[0]) if inputs.mu is None else inputs.mu
        parts.append(modes_table(inputs.modes, mu, inputs.max_frequency_hz, inputs.damping_of(inputs.modes)))
    said: list[str] = []
    for onsets in inputs.told_onsets:
        damping = "With damping" if onsets.damped else "Without damping"
        said.extend(f"{damping} it {line}." for line in onsets.at_start_words)
        said.extend(f"{damping}: {line[2:]}." for line in onsets.from_above_words)
        if onsets.completeness:
            said.append(f"{damping}: {onsets.completeness}")
        said.extend(f"{damping}: {note}" for note in onsets.notes)
        if not onsets.onsets:
            low, high = onsets.friction_range
            none = f"{damping} there is no onset of instability for {low:g} ≤ μ ≤ {high:g}."
            said.append(in_alike(none, repeating(inputs.case.ties)))
    if parts or said:
        said.insert(
            0,
            "Eigenvalues λ of the system coupled by friction, linear about steady sliding: the growth rate is Re λ, "
            "the frequency Im λ/2π. A mode with positive growth rate is potentially unstable.",
        )
    return Chapter("modal", "Modal approach", tuple(said), parts=tuple(parts))


def _changes(inputs: ReportInputs) -> Chapter:
    """What a change of the case would do: derivatives, and counter-measures ranked by them."""
    parts = (*change_tables(inputs), *change_figures(inputs))
    return Chapter("changes", "What a change would do", change_words(inputs), parts=parts)


def _temporal(inputs: ReportInputs, window: Window | None) -> Chapter:
    parts: list[Table | ReportFigure] = []
    if inputs.trajectory is not None:
        parts = [simulation_table(inputs)]
        if inputs.trajectory.contact_names:
            parts.append(contact_table(inputs.trajectory))
            shared = settled_table(inputs.trajectory)
            parts += [] if shared is None else [shared]
    parts.extend(temporal_figures(inputs, window))
    parts.extend(contact_figures(inputs))
    if inputs.energy is not None:
        parts.append(energy_table(inputs.energy))
    said = ()
    if parts:
        said = (
            "The equations of motion marched in time with unilateral contact and Coulomb friction: the contact sticks, "
            "slips or separates as it must.",
        )
    return Chapter("temporal", "Temporal approach", said, parts=tuple(parts))


def _cycles(inputs: ReportInputs) -> Chapter:
    """Limit cycles, where they were sought."""
    result = inputs.cycles
    if result is None:
        return Chapter("limit-cycles", "Limit cycles")
    table = cycle_table(result)
    parts = (*cycle_figures(inputs), *(() if table is None else (table,)))
    # Ends of branches are told with these.
    missing = [line for line in result.missing if not line.startswith("branch ")]
    lines = (*branch_words(result), *missing, *result.notes, result.reach)
    return Chapter("limit-cycles", "Limit cycles", cycle_words(result), lines, parts)


def _agreement(inputs: ReportInputs) -> Chapter:
    parts: list[Table | ReportFigure] = []
    said: tuple[str, ...] = ()
    if inputs.agreement is not None:
        said = (f"Verdict: {inputs.agreement.verdict}.", *inputs.agreement.notes)
        for comparison in inputs.agreement.comparisons:
            parts.append(agreement_table(comparison))
            same = inputs.mu is None or abs(comparison.mu - inputs.mu) < 1e-12
            if inputs.modes is not None and same:
                parts.append(identified_table(comparison, inputs.modes, inputs.max_frequency_hz))
    parts.extend(agreement_figures(inputs))
    return Chapter("agreement", "Do both approaches agree?", said, parts=tuple(parts))


def _reference(inputs: ReportInputs, window: Window | None) -> Chapter:
    reference = inputs.case.reference
    if reference is None:
        return Chapter("reference", "The source")
    table = values_table(inputs, window)
    said = (f"Printed values are from: {reference.source}",) if reference.source else ()
    if reference.notes:
        said += ("What to know about the source:",)
    return Chapter("reference", "The source", said, reference.notes, () if table is None else (table,))


def about_tables(inputs: ReportInputs) -> list[Table]:
    """Versions and times taken."""
    tables: list[Table] = []
    if inputs.versions:
        rows = tuple(TableRow((name, version)) for name, version in inputs.versions.items())
        tables.append(Table("versions", "Versions", ("program", "version"), rows, frozenset({0, 1})))
    if inputs.timings:
        rows = [TableRow((name, number(seconds, 2))) for name, seconds in inputs.timings.items()]
        rows.append(TableRow(("in all", number(sum(inputs.timings.values()), 2))))
        tables.append(Table("timings", "Time taken", ("analysis", "wall time [s]"), tuple(rows), frozenset({0})))
    return tables


def _write(path: Path, content: bytes) -> None:
    """The file with that content, or the one that was there before: never a part of it."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        # mkstemp lets only the owner read; a report is for others, too.
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


@cache
def _umask() -> int:
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
