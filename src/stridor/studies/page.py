"""A study as a page: what came out, what of it was confirmed, its figures, and what was asked."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import tomlkit
from matplotlib.figure import Figure

from ..io.atomic import write_text
from ..notebook import counted
from ..view.page_parts import ReportFigure, data_url, filled, rendered
from ..view.tables import Table, TableRow
from .result import StudyResult
from .summary import Line, answer, failures, tables
from .tables import Varied
from .uncertainty import COVERS

# Titles of figures, and what is to be seen in them.
_FIGURES = {
    "stability-map": (
        "Where it squeals",
        "A mark for each sample; rings: solved in the full problem as well. The line of no growth, of a grid alone, is "
        "interpolated between its points.",
    ),
    "growth-map": (
        "How fast it grows",
        "The largest growth rate of each sample. Decay and growth have a half of the colours each, up to their own "
        "ends. The line of no growth, of a grid alone, is interpolated between its points.",
    ),
    "critical-map": (
        "From which friction on it squeals",
        "The critical friction coefficient of each sample, solved for; nothing is interpolated between samples.",
    ),
    "onsets": (
        "Onsets of all samples", "Friction coefficient and frequency at which a mode begins or ceases to grow."
    ),
    "agreement": (
        "Modes against runs in time",
        "Growth rate and frequency of the mode compared, and of the perturbation in time: on the line both are equal.",
    ),
    "agreement-map": ("Where both approaches agree", "A mark for each sample: whether its comparison agrees."),
    "maps": ("Over two parameters", "A mark for each sample; nothing is interpolated between samples."),
    "root-locus": ("Modes of all samples", "Growth rate over frequency: above the line a mode grows."),
    "bands": ("How likely a mode grows, by frequency", "With intervals of 95 %."),
    "sobol-indices": (
        "What decides it", f"Shares of the variance: of a number alone, and together with others; {COVERS}.",
    ),
}
_OVER = "over-"


def write_page(result: StudyResult, figures: Mapping[str, Figure], path: Path) -> Path:
    """Write the page with its figures in it. Raises AnalysisError where it cannot be written."""
    study = result.study
    drawn = [_figure(name, figure) for name, figure in figures.items()]
    listed = list(tables(result))
    if bad := failures(result):
        listed.append(("Rows that failed", ("error", "rows"), bad))
    varied = [(name, *_words(one)) for name, one in study.parameters.items()]
    said = answer(result)
    asked = study.model_dump(mode="json", exclude={"case"}, exclude_none=True, exclude_defaults=True)
    title = study.title or f"Study of {result.compute}"
    text = filled(
        "study.html.j2",
        title=title,
        subtitle=f"{result.compute} of {counted(len(result.status), 'sample')} over "
        f"{counted(len(varied), 'parameter')}, {result.method}",
        answer=said[:1].upper() + said[1:],
        notes=result.notes,
        results=[_table(f"results-{k}", *listing) for k, listing in enumerate(listed)],
        figures=drawn,
        numbers={figure.name: k for k, figure in enumerate(drawn, start=1)},
        drawings={figure.name: data_url(rendered(figure.figure, "png"), "png") for figure in drawn},
        places={},
        parameters=_table("parameters", "Parameters", ("parameter", "values", "between"), varied),
        asked=tomlkit.dumps(asked),  # pyright: ignore[reportUnknownMemberType]
        case=study.base().to_toml(),
    )
    write_text(path, text)
    return path


def _figure(name: str, figure: Figure) -> ReportFigure:
    title, caption = _FIGURES.get(name, ("", ""))
    if name.startswith(_OVER):
        label = next(label for ax in figure.axes if (label := ax.get_xlabel()))
        title, caption = f"Over {label}", f"The results of all samples over {label}."
    return ReportFigure(name, title or name, caption, caption or title or name, figure)


def _table(name: str, title: str, heads: Sequence[str], rows: Iterable[Line]) -> Table:
    lines = tuple(TableRow(tuple(map(str, row))) for row in rows)
    return Table(name, title, tuple(heads), lines, frozenset({0}))


def _words(varied: Varied) -> tuple[str, str]:
    """How a number varies, and between what."""
    if varied.values is not None:
        return counted(len(varied.values), "value"), _between(min(varied.values), max(varied.values))
    if varied.range is not None:
        of = f"{counted(varied.points, 'point')}, " if varied.points else ""
        return f"{of}{varied.spacing}", _between(*varied.range)
    assert varied.mean is not None, "the study was checked"
    assert varied.deviation is not None, "the study was checked"
    shape = f"{varied.distribution}, mean {varied.mean:g}, deviation {varied.deviation:g}"
    return shape, _between(varied.low, varied.high)


def _between(low: float | None, high: float | None) -> str:
    ends = ("no limit" if end is None else f"{end:g}" for end in (low, high))
    return "" if low is None and high is None else " and ".join(ends)
