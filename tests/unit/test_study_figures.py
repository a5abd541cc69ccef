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
from stridor.studies.maps import critical_map, growth_map, stability_map
from stridor.studies.plots import growth_over, onset_cloud, root_locus
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


# -- growth over two parameters ----------------------------------------------------------------------------------------
@pytest.mark.parametrize("method", ["grid", "latin-hypercube", "sobol"])
def test_growth_tells_what_grows_from_what_does_not(method: str) -> None:
    given: dict = {"mu": {"range": (0.0, 0.6)}, MASS: {"range": (1.0, 1e4), "spacing": "logarithmic"}}
    if method == "grid":
        given = {"mu": FRICTION, MASS: DECADES}
    sampling = {"method": method} | ({} if method == "grid" else {"samples": 64})
    result = result_of(study_of(given, sampling=sampling), growing)
    drawn = st.study_figures(result)
    assert {"stability-map", "growth-map"} <= drawn.keys()
    ax, bar = drawn["growth-map"].axes
    stable, unstable = (c for c in ax.collections if isinstance(c, PathCollection))
    rates = result.data["largest_growth_rate"].values
    assert np.sort(np.asarray(stable.get_array())).tolist() == np.sort(rates[rates <= 0]).tolist()
    assert np.sort(np.asarray(unstable.get_array())).tolist() == np.sort(rates[rates > 0]).tolist()
    assert len(stable.get_paths()[0]) != len(unstable.get_paths()[0])  # marks of two shapes, seen without colours
    norm = unstable.norm
    assert (float(norm(0.0)), float(norm(rates.min())), float(norm(rates.max()))) == (0.5, 0.0, 1.0)
    ticks = np.asarray(bar.get_yticks())
    assert ticks.min() < 0 < ticks.max()
    assert bar.get_ylabel() == "largest growth rate [1/s]"
    lines = [text for text in words(drawn["growth-map"]) if "interpolated" in text]
    assert (len(lines), len(ax.get_lines())) == ((1, 1) if method == "grid" else (0, 0))


@pytest.mark.parametrize("rate", [-5.0, 0.0, 5.0])
def test_growth_of_one_sign_has_a_map(rate: float) -> None:
    def even(at: dict) -> dict:
        return {"largest_growth_rate": np.full(len(at["mu"]), rate), "unstable_modes": np.full(len(at["mu"]), int(rate > 0))}

    figure = growth_map(result_of(study_of({"mu": FRICTION, MASS: DECADES}), even))
    assert words(figure) == ["a mode grows" if rate > 0 else "nothing grows"]
    assert len(marks(figure.axes[0])) == 20
    figure.draw_without_rendering()


# -- onsets ------------------------------------------------------------------------------------------------------------
ONSETS = {MASS: {"range": (1.0, 1e4), "points": 5, "spacing": "logarithmic"}, THICK: {"range": (1e-3, 2e-3), "points": 2}}


def onset_study(**tables: Any) -> st.Study:
    case = st.loads(template_text("two-beams"), ["modal.friction_range=[0.1, 0.5]"])
    return st.Study(case=case, compute="onsets", parameters=ONSETS, **tables)


def ladder(at: dict) -> dict:
    """Critical at 0.1 (growing already), 0.2, 0.3, 0.4 and nowhere over the decades of the damping; the search of the
    third is not complete. A second onset, of another mode, ends growth at 0.45."""
    decade = np.round(np.log10(at[MASS])).astype(int)
    critical = np.array([0.1, 0.2, 0.3, 0.4, np.nan])[decade]
    first = np.where(decade == 0, np.nan, critical)
    second = np.where(decade == 4, np.nan, 0.45)
    return {
        "critical_mu": critical, "critical_frequency_hz": np.where(np.isnan(first), np.nan, 1e3 * (1 + decade)),
        "growing_at_start": (decade == 0).astype(int), "complete": (decade != 2).astype(int),
        "onset_mu": np.stack([first, second], axis=1),
        "onset_frequency_hz": np.stack([np.where(np.isnan(first), np.nan, 1e3 * (1 + decade)), 0 * second + 7e3], axis=1),
        "onset_ends_growth": np.stack([np.where(np.isnan(first), np.nan, 0.0), 0 * second + 1.0], axis=1),
    }  # fmt: skip


def test_a_map_of_critical_friction_shows_what_was_solved_for_alone() -> None:
    figure = critical_map(result_of(onset_study(), ladder))
    ax, bar = figure.axes
    none, late, early = (c for c in ax.collections if isinstance(c, PathCollection))
    assert np.asarray(none.get_offsets())[:, 0] == pytest.approx(1e4)
    assert sorted(np.asarray(late.get_array())) == pytest.approx([0.2, 0.2, 0.3, 0.3, 0.4, 0.4])
    assert np.asarray(early.get_array()).tolist() == [0.1, 0.1]
    assert late.get_clim() == early.get_clim() == (0.1, 0.4)  # one colour bar for both
    assert bar.get_ylabel() == "critical friction coefficient"
    assert words(figure) == ["no onset up to μ = 0.5", "grows at μ = 0.1 already", "onsets may be missing"]
    (crosses,) = ax.get_lines()  # and no line between samples
    assert (crosses.get_marker(), crosses.get_linestyle()) == ("x", "None")
    assert np.asarray(crosses.get_xdata()) == pytest.approx(1e2)
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "linear")
    assert (ax.get_xlabel(), ax.get_ylabel()) == (f"{MASS} [1/s]", f"{THICK} [m]")


def test_a_study_of_onsets_has_its_figures() -> None:
    drawn = st.study_figures(result_of(onset_study(), ladder))
    assert set(drawn) == {"critical-map", "onsets", "over-bodies-beam1-damping-mass", "over-bodies-beam1-thickness"}


@pytest.mark.parametrize("onset", [0.3, np.nan])
def test_onsets_that_are_all_alike_have_their_figures(onset: float) -> None:
    def alike(at: dict) -> dict:
        return {"critical_mu": np.full(len(at[MASS]), onset), "complete": np.ones(len(at[MASS]), dtype=int)}

    for figure in st.study_figures(result_of(onset_study(), alike)).values():
        figure.draw_without_rendering()
    expected = ["no onset up to μ = 0.5"] if np.isnan(onset) else []
    assert words(critical_map(result_of(onset_study(), alike))) == expected


def test_onsets_of_all_samples_are_told_apart() -> None:
    figure = onset_cloud(result_of(onset_study(), ladder))
    begin, end, critical = figure.axes[0].get_lines()
    assert sorted(np.asarray(begin.get_xdata())) == pytest.approx([0.2, 0.2, 0.3, 0.3, 0.4, 0.4])
    assert set(np.asarray(end.get_xdata())) == {0.45}
    assert set(np.asarray(end.get_ydata())) == {7e3}
    assert np.nanmax(np.asarray(critical.get_ydata())) == 4e3
    assert words(figure) == ["growth begins", "growth ends", "the critical one of its sample"]
    assert figure.axes[0].get_xlim() == (0.1, 0.5)


def test_samples_without_onset_are_seen_over_a_parameter() -> None:
    figure = growth_over(result_of(onset_study(), ladder), MASS)
    _, beyond, early = figure.axes[0].get_lines()
    assert np.asarray(beyond.get_xdata()) == pytest.approx([1e4, 1e4])
    assert np.asarray(beyond.get_ydata()).tolist() == [0.5, 0.5]
    assert np.asarray(early.get_ydata()).tolist() == [0.1, 0.1]
    assert words(figure) == ["no onset up to μ = 0.5", "grows at μ = 0.1 already"]


def test_maps_are_of_what_was_computed() -> None:
    modes, onsets = result_of(study_of({"mu": FRICTION, MASS: DECADES}), growing), result_of(onset_study(), ladder)
    for draw, result in ((critical_map, modes), (stability_map, onsets), (growth_map, onsets)):
        with pytest.raises(st.AnalysisError, match=r"this map is of (onsets|modes), and the study computed"):
            draw(result)
    with pytest.raises(st.AnalysisError, match="a map needs two parameters that vary"):
        stability_map(result_of(study_of({"mu": FRICTION}), growing))
