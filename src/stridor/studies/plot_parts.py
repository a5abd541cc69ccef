"""What figures of a study have in common: which parameters vary, their axes, rows solved in full as well."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..errors import AnalysisError
from ..typing import Array
from ..view.colours import INK
from .result import StudyResult, numbers

LEAST_LISTED = 3  # values whose steps say whether they are logarithmic
SAME_RATIO = 0.02  # by how much the steps of a list may differ, of one: lists are written with few digits
MOST_NAMED = 2  # parameters that a map has no axis for


def varied(result: StudyResult) -> list[str]:
    """Parameters with more than one value among the samples."""
    return [name for name in result.parameters if len(np.unique(result.data[name].values)) > 1]


def logarithmic(result: StudyResult, name: str) -> bool:
    """Whether the samples of a parameter lie on a logarithmic scale: of a range so spaced, of a log-normal
    distribution, or of listed values each of which is as many times the one before."""
    one, values = result.study.parameters[name], np.asarray(result.data[name].values, dtype=float)
    if not np.all(values > 0):
        return False
    if one.values is None:
        return one.spacing == "logarithmic" if one.range is not None else one.distribution == "log-normal"
    steps = np.diff(np.log(np.unique(one.values)))
    return len(steps) + 1 >= LEAST_LISTED and bool(np.ptp(steps) <= SAME_RATIO * steps.mean())


def named(result: StudyResult, name: str) -> str:
    """The label of a parameter, with its unit."""
    unit = result.data[name].attrs.get("units", "")
    return f"{name} [{unit}]" if unit not in ("", "1") else "friction coefficient μ" if name == "mu" else name


def file_name(name: str) -> str:
    """A parameter in the name of a file."""
    return "".join(c if c.isalnum() else "-" for c in name)


def along(result: StudyResult, ax: Axes, name: str, which: str = "x") -> None:
    """An axis ("x" or "y") over a parameter, with its label and on the scale on which its samples lie."""
    ax.set(**{f"{which}label": named(result, name)})
    if logarithmic(result, name):
        ax.set(**{f"{which}scale": "log"})


def over_two(result: StudyResult, ax: Axes, x: str, y: str) -> None:
    """Both axes of a map, and below them what varies beside."""
    along(result, ax, x, "x")
    along(result, ax, y, "y")
    if others := beside(result, x, y):
        ax.set_xlabel(f"{ax.get_xlabel()}\n{others}")


def beside(result: StudyResult, x: str, y: str) -> str:
    """What varies but for the parameters of a map, in words: marks that lie near each other may differ in it."""
    others = [name for name in varied(result) if name not in (x, y)]
    more = f" and {len(others) - MOST_NAMED} more" if len(others) > MOST_NAMED else ""
    return f"varied beside: {', '.join(others[:MOST_NAMED])}{more}" if others else ""


def two(result: StudyResult, x: str | None, y: str | None) -> tuple[str, str]:
    """The parameters of a map, by default the first that vary. Raises AnalysisError where there are none."""
    for name in (x, y):
        if name is not None and name not in result.parameters:
            raise AnalysisError(f"{name} is no parameter of the study; there are {', '.join(result.parameters)}")
    left = [name for name in varied(result) if name not in (x, y)]
    first = x or (left.pop(0) if left else "")
    second = y or (left.pop(0) if left else "")
    if not first or not second:
        raise AnalysisError("a map needs two parameters that vary")
    return first, second


def friction_range(result: StudyResult) -> tuple[float, float]:
    """Where onsets were sought."""
    low, high = result.study.base().modal.friction_range
    return float(low), float(high)


def key(marker: str, label: str, colour: str = INK, *, filled: bool = True) -> Line2D:
    """A mark in a legend."""
    return Line2D([], [], color=colour, marker=marker, mfc=colour if filled else "none", linestyle="none", label=label)


def rings(result: StudyResult, ax: Axes, at: Sequence[Array]) -> list[Artist]:
    """Rings about the rows at (x, y) that were solved in the full problem as well."""
    if "confirmed" not in result.data:
        return []
    confirmed = numbers(result, "confirmed") > 0
    if not confirmed.any():
        return []
    ax.plot(at[0][confirmed], at[1][confirmed], "o", mfc="none", mec=INK, ms=5, mew=0.7)
    return [key("o", "solved in full as well", filled=False)]
