"""Figures of studies: what they show of results that are known beforehand."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure

import stridor as st
from stridor.case import template_text
from stridor.case.units import unit_at
from stridor.studies.plots import growth_over, root_locus, stability_map
from stridor.studies.result import StudyResult
from stridor.studies.rows import variables
from stridor.studies.sampling import samples

MASS, THICK = "bodies.beam1.damping.mass", "bodies.beam1.thickness"
DECADES = {"range": (1.0, 1e4), "points": 5, "spacing": "logarithmic"}
FRICTION = {"range": (0.0, 0.6), "points": 4}
FILL = {"f8": np.nan, "i8": 0, "i1": 0, "str": ""}


def study_of(parameters: dict, **tables: Any) -> st.Study:
    return st.Study(case=st.loads(template_text("two-beams")), parameters=parameters, **tables)


def result_of(study: st.Study, columns: Any) -> StudyResult:
    """A result as the store gives it: samples of the study, and the columns that a function of them gives; what it
    does not give is as in a row that has none."""
    values = samples(study)
    at = dict(zip(study.parameters, values.T, strict=True))
    given = {"status": np.ones(len(values), dtype=np.int8), **columns(at)}
    data: dict[str, Any] = {}
    for v in variables(study.compute):
        shape = (len(values), 1) if v.inner else (len(values),)
        column = given.pop(v.name, np.full(shape, FILL[v.dtype], dtype=object if v.dtype == "str" else v.dtype))
        data[v.name] = (("row", v.inner)[: np.ndim(column)], column)
    assert not given, "no such columns"
    units = {name: unit_at(study.base(), name) for name in study.parameters}
    coordinates = {name: ("row", value, {"units": units[name]}) for name, value in at.items()}
    attributes = {"parameters": json.dumps(units), "study": json.dumps(study.document())}
    return StudyResult(Path("study.zarr"), xr.Dataset(data, coordinates, attributes))


def growing(at: dict) -> dict:
    """Growth that begins at μ = 0.1 · the decade of the damping + 0.05, linear in both."""
    growth = 1e3 * (at["mu"] - 0.05 - 0.1 * np.log10(np.maximum(at.get(MASS, 1.0), 1.0)))
    return {"largest_growth_rate": growth, "unstable_modes": (growth > 0).astype(int), "largest_growth_frequency_hz": 5e3 + 1e4 * at["mu"]}


def words(figure: Figure) -> list[str]:
    """What its legends say."""
    legends = [ax.get_legend() for ax in figure.axes]
    return [text.get_text() for legend in legends if legend is not None for text in legend.get_texts()]


def marks(ax: Axes) -> list[list[float]]:
    """Places of all marks of scatters."""
    return [row for c in ax.collections if isinstance(c, PathCollection) for row in np.asarray(c.get_offsets()).tolist()]


# -- scales ------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("given", "scale"),
    [
        ({"range": (1.0, 1e4), "spacing": "logarithmic"}, "log"),
        ({"range": (1.0, 1e4)}, "linear"),
        ({"distribution": "log-normal", "mean": 50.0, "deviation": 200.0}, "log"),
        ({"distribution": "normal", "mean": 50.0, "deviation": 2.0}, "linear"),
        ({"distribution": "uniform", "range": (1.0, 2.0)}, "linear"),
        ({"values": (0.5, 5.0, 50.0)}, "log"),
        ({"values": (1.0, 2.15, 4.64, 10.0)}, "log"),
        ({"values": (1.0, 2.0, 3.0)}, "linear"),
        ({"values": (1.0, 100.0)}, "linear"),  # two values are even on either scale
        ({"values": (0.0, 1.0, 10.0)}, "linear"),
    ],
)
def test_axes_have_the_scale_on_which_samples_lie(given: dict, scale: str) -> None:
    result = result_of(study_of({"mu": {"range": (0.0, 0.6)}, MASS: given}, sampling={"method": "sobol", "samples": 32}), growing)
    drawn = st.study_figures(result)
    assert {"stability-map", "over-bodies-beam1-damping-mass"} <= drawn.keys()
    for name, figure in drawn.items():
        ax = figure.axes[0]
        if name.endswith("-map"):
            assert (ax.get_xscale(), ax.get_yscale()) == ("linear", scale), name
            assert ax.get_ylabel() == f"{MASS} [1/s]"
        elif name.startswith("over-bodies"):
            assert (ax.get_xscale(), ax.get_yscale()) == (scale, "linear"), name
            assert ax.get_xlabel() == f"{MASS} [1/s]"
    assert growth_over(result, "mu").axes[0].get_xscale() == "linear"
    assert stability_map(result, MASS, "mu").axes[0].get_xscale() == scale


def test_the_line_of_no_growth_is_straight_on_the_scale_of_the_grid() -> None:
    """The growth is linear in the decades of the damping, so the interpolation between points is exact there alone."""
    figure = stability_map(result_of(study_of({"mu": FRICTION, MASS: DECADES}), growing))
    (line,) = figure.axes[0].get_lines()
    mu, mass = (np.asarray(v, dtype=float) for v in line.get_data())
    assert len(mu) > 4
    assert mu == pytest.approx(0.05 + 0.1 * np.log10(mass), abs=1e-9)
    assert any("interpolated" in text for text in words(figure))


def test_no_mark_of_a_map_is_cut_off() -> None:
    ax = stability_map(result_of(study_of({"mu": FRICTION, MASS: DECADES}), growing)).axes[0]
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    assert left < 0.0 < 0.6 < right
    assert low < 1.0 < 1e4 < high
    assert len(marks(ax)) == 20


@pytest.mark.parametrize("method", ["random", "latin-hypercube", "sobol"])
def test_samples_have_no_line_that_nobody_computed(method: str) -> None:
    given = {"mu": {"range": (0.0, 0.6)}, MASS: {"range": (1.0, 1e4), "spacing": "logarithmic"}}
    figure = stability_map(result_of(study_of(given, sampling={"method": method, "samples": 64}), growing))
    assert not figure.axes[0].get_lines()
    assert words(figure) == ["nothing grows"]


def test_what_does_not_grow_but_for_rounding_has_no_line_among_it() -> None:
    """Of an undamped problem the largest rate below the onset is ± rounding."""
    def undamped(at: dict) -> dict:
        noise = 1e-9 * np.random.default_rng(1).standard_normal(len(at["mu"]))
        return {"largest_growth_rate": np.where(at["mu"] > 0.3, 100.0, noise), "unstable_modes": (at["mu"] > 0.3).astype(int)}

    figure = stability_map(result_of(study_of({"mu": FRICTION, MASS: DECADES}), undamped))
    assert np.asarray(figure.axes[0].get_lines()[0].get_xdata()) == pytest.approx(0.2, abs=1e-6)  # the last that is stable


def test_what_varies_beside_a_map_is_named() -> None:
    given = {"mu": {"range": (0.0, 0.6)}, MASS: {"range": (1.0, 5.0)}, THICK: {"range": (1e-3, 2e-3)}}
    figure = stability_map(result_of(study_of(given, sampling={"method": "sobol", "samples": 8}), growing))
    assert figure.axes[0].get_xlabel() == f"friction coefficient μ\nvaried beside: {THICK}"


def test_a_root_locus_shows_the_mode_that_decays_fastest() -> None:
    def modes(at: dict) -> dict:
        rows = len(at["mu"])
        growth = np.tile([-9e3, -1.0, -1.0, -1.0, 2e3], (rows, 1))
        return {"frequency_hz": np.tile([1e2, 1e3, 2e3, 3e3, 4e3], (rows, 1)), "growth_rate": growth, "branch": np.tile(np.arange(1, 6), (rows, 1)), "modes_of_band": np.full(rows, 5)}

    ax = root_locus(result_of(study_of({"mu": FRICTION}), modes)).axes[0]
    low, high = ax.get_ylim()
    assert ax.get_yscale() == "symlog"
    assert low < 1.3 * -9e3
    assert high > 1.3 * 2e3
