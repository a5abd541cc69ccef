"""How stridor's figures look: one style, colours that colour-blind readers can tell apart, light background."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from io import BytesIO
from typing import ParamSpec, TypeVar

import matplotlib as mpl
import numpy as np
from cycler import cycler
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from ..typing import Array
from .colours import BLUE, COLOURS, FAINT, GREY, INK

SCREEN_DPI = 110  # in notebooks
WIDTH = 7.6  # inches: the text width of a report
DRAWN_COLUMNS = 1400  # pieces that a long history is drawn in
DRAWN_POINTS = 20 * DRAWN_COLUMNS  # histories shorter than this are drawn as they are

STYLE: dict[str, object] = {
    "figure.dpi": 100,
    "figure.autolayout": False,
    "figure.constrained_layout.use": False,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.5,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.5,
    "axes.labelcolor": INK,
    "axes.edgecolor": GREY,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.prop_cycle": cycler(color=COLOURS),
    "axes.formatter.limits": (-4, 5),
    "grid.color": FAINT,
    "grid.linewidth": 0.6,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "text.color": INK,
    "lines.linewidth": 1.4,
    "legend.fontsize": 8.5,
    "legend.frameon": True,
    "legend.framealpha": 0.92,
    "legend.edgecolor": "none",
    "svg.fonttype": "path",  # letters as outlines: looks the same without the font
    "savefig.dpi": 160,
    "svg.hashsalt": "stridor",  # equal results give equal files
    "agg.path.chunksize": 20000,
}

P = ParamSpec("P")
R = TypeVar("R")


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """The function, drawing in stridor's style without changing anybody else's."""

    @wraps(draw)
    def drawing(*args: P.args, **kwargs: P.kwargs) -> R:
        with mpl.rc_context(STYLE):  # pyright: ignore[reportArgumentType, reportUnknownMemberType]
            drawn = draw(*args, **kwargs)
        if isinstance(drawn, Figure):
            _as_written(drawn)
        return drawn

    return drawing


def _as_written(figure: Figure) -> None:
    """Show titles, labels and legends as they are written: in names of a case $ begins no formula."""
    texts = list(figure.texts)
    for ax in figure.axes:
        texts += [ax.title, ax.xaxis.label, ax.yaxis.label, *ax.texts]
        legend = ax.get_legend()
        texts += [] if legend is None else [*legend.get_texts(), legend.get_title()]
        for side in ("left", "right"):
            texts.append(getattr(ax, f"_{side}_title", ax.title))
    for legend in figure.legends:
        texts += legend.get_texts()
    for text in texts:
        text.set_parse_math(False)


@styled
def lay_out(figure: Figure) -> None:
    """Place what is in a figure once for all its files: savefig draws it all in vain to do so, for each of them."""
    engine, canvas, dpi = figure.get_layout_engine(), figure.canvas, figure.dpi
    if engine is not None:
        FigureCanvasSVG(figure)  # letters have the widths of their outlines, at every resolution
        engine.execute(figure)
        figure.set_canvas(canvas)
        figure.set_dpi(dpi)
    figure.set_layout_engine(None)


class ShownFigure(Figure):
    """A figure that notebooks show by itself, without pyplot and without a word to the kernel before."""

    def _repr_png_(self) -> bytes:
        held = BytesIO()
        self.savefig(held, format="png", dpi=SCREEN_DPI)
        return held.getvalue()


def new_figure(height: float = 3.6, width: float = WIDTH) -> Figure:
    """An empty figure [inches] that belongs to no window and needs no display."""
    return ShownFigure(figsize=(width, height), layout="constrained")


def panel(ax: Axes | None, height: float = 3.6, width: float = WIDTH) -> tuple[Figure, Axes]:
    """The given axes and their figure, or new ones."""
    if ax is None:
        figure = new_figure(height, width)
        return figure, figure.subplots()
    return root_figure(ax), ax


def stacked(
    axes: Sequence[Axes] | None, count: int, height: float, ratios: Sequence[float] | None = None
) -> tuple[Figure, list[Axes]]:
    """The given panels and their figure, or ``count`` new ones above each other with one x axis."""
    if axes is not None:
        if len(axes) != count:
            raise ValueError(f"axes: {len(axes)} given, this figure has {count} panels")
        return root_figure(axes[0]), list(axes)
    figure = new_figure(height)
    made = figure.subplots(count, 1, sharex=True, squeeze=False, height_ratios=ratios)
    return figure, list(made[:, 0])


def root_figure(ax: Axes) -> Figure:
    """The figure that axes belong to, whatever lies between."""
    figure = ax.get_figure(root=True)
    assert figure is not None, "axes that were removed from their figure"
    return figure


def legend_above(
    ax: Axes, handles: Sequence[Artist] | None = None, *, columns: int = 4, height: float | None = None
) -> None:
    """A legend above the frame, where it hides nothing; height: of its patches, in letters, where hatches must show."""
    shown = ax.get_legend_handles_labels()[0] if handles is None else list(handles)
    if shown:
        more = {} if height is None else {"handleheight": height, "handlelength": 2.2 * height}
        ax.legend(handles=shown, loc="lower left", bbox_to_anchor=(0, 1.0), ncols=columns, borderaxespad=0.2, **more)
        # A common factor of the axis, as 1e5, has its place where the legend begins, which would hide it.
        ax.yaxis.get_offset_text().set_horizontalalignment("right")


def zero_line(ax: Axes) -> None:
    """A thin line at y = 0."""
    ax.axhline(0.0, color=INK, linewidth=0.8, zorder=1.5)


def draw_history(
    ax: Axes, time: Array, values: Array, *, colour: str = BLUE, label: str | None = None, width: float = 0.9
) -> None:
    """A signal over time; a long one as the band between the extrema of short pieces, none lost."""
    if len(time) <= DRAWN_POINTS:
        ax.plot(time, values, color=colour, linewidth=width, label=label)
        return
    middle, low, high = extrema(time, values)
    ax.fill_between(middle, low, high, color=colour, linewidth=0.5, label=label)


def extrema(time: Array, values: Array, columns: int = DRAWN_COLUMNS) -> tuple[Array, Array, Array]:
    """Time, smallest and largest value (columns,) of equal pieces of a history."""
    size = max(1, len(time) // columns)
    count = len(time) // size
    pieces = values[: count * size].reshape(count, size)
    return time[: count * size : size] + 0.0, pieces.min(axis=1), pieces.max(axis=1)


def thinned(count: int, columns: int = DRAWN_COLUMNS) -> slice:
    """Every so many records, for curves that are smooth between them."""
    return slice(None, None, max(1, count // columns))


def largest(values: Array) -> float:
    """Largest absolute value, 1 where there is none that is finite and not zero."""
    finite = np.abs(values[np.isfinite(values)])
    size = float(finite.max(initial=0.0))
    return size if size > 0 else 1.0
