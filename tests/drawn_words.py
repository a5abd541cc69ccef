"""Where the words of a figure lie once it is drawn, and which of them lie on one another or off the paper."""

from __future__ import annotations

from itertools import combinations

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

TOUCH = 1.0  # pixel that boxes may share: letters do not fill theirs


def boxes(figure: Figure) -> list[tuple[str, Bbox]]:
    """Every text that is drawn with what it covers [pixels]."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    texts = [*figure.texts, *([figure._suptitle] if figure._suptitle is not None else [])]
    for ax in figure.axes:
        texts += [*ax.texts, ax.title, ax.xaxis.label, ax.yaxis.label]
        texts += [text for text in ax.findobj(Text) if ax.get_legend() is not None and text in ax.get_legend().get_texts()]
        for axis, low, high in ((ax.xaxis, *sorted(ax.get_xlim())), (ax.yaxis, *sorted(ax.get_ylim()))):
            for which in (False, True):
                ticks = zip(axis.get_ticklocs(minor=which), axis.get_ticklabels(minor=which), strict=False)
                texts += [label for place, label in ticks if low <= place <= high]
    shown = {id(text): text for text in texts if text.get_text().strip() and text.get_visible()}
    return [(text.get_text(), text.get_window_extent(renderer)) for text in shown.values()]


def clashes(figure: Figure) -> list[tuple[str, str]]:
    """Pairs of texts that lie on one another."""
    found = boxes(figure)
    return [
        (one, other)
        for (one, a), (other, b) in combinations(found, 2)
        if min(a.x1, b.x1) - max(a.x0, b.x0) > TOUCH and min(a.y1, b.y1) - max(a.y0, b.y0) > TOUCH
    ]


def cut_off(figure: Figure) -> list[str]:
    """Texts that do not lie on the paper with all they are."""
    width, height = figure.canvas.get_width_height()
    return [
        text for text, box in boxes(figure)
        if box.x0 < -TOUCH or box.y0 < -TOUCH or box.x1 > width + TOUCH or box.y1 > height + TOUCH
    ]  # fmt: skip
