"""Figures of studies: what they show of results that are known beforehand."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure

import stridor as st
from drawn_words import clashes, cut_off
from stridor.case import template_text
from stridor.case.units import unit_at
from stridor.studies.analysis_plots import agreement, agreement_map, maps, results_over
from stridor.studies.maps import critical_map, growth_map, stability_map
from stridor.studies.plots import growth_over, onset_cloud, root_locus
from stridor.studies.result import StudyResult
from stridor.studies.rows import variables
from stridor.studies.sampling import samples
from stridor.studies.summary import tables
from undrawn import nothing_drawn

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


# -- steady sliding, runs, comparisons ---------------------------------------------------------------------------------
ONE = {"mu": {"range": (0.0, 0.3), "points": 4}}
TWO = {**ONE, MASS: {"range": (1.0, 1e4), "points": 3, "spacing": "logarithmic"}}


def pressed(at: dict) -> dict:
    """Ten nodes, of which one more opens at each step of friction."""
    opened = np.round(at["mu"] * 10).astype(int)
    return {
        "normal_force": 20.0 + 10.0 * at["mu"], "largest_node_force": 3.0 + at["mu"], "open_nodes": opened,
        "sticking_nodes": np.full(len(opened), 2), "slipping_nodes": 8 - opened,
    }  # fmt: skip


def in_time(at: dict) -> dict:
    """A run that has not stopped growing at the first friction coefficient."""
    return {
        "velocity_rms": 0.02 + at["mu"], "dominant_frequency_hz": 8e3 + at["mu"], "saturated": np.where(at["mu"] > 0, 1, -1),
        "stick_fraction": at["mu"], "slip_fraction": 0.5 - at["mu"], "separation_fraction": np.full(len(at["mu"]), 0.5),
    }  # fmt: skip


def compared(at: dict) -> dict:
    """Both approaches agree, do not, and it is not decided, in turn; where it is not there is no rate in time."""
    agree = np.resize([1, 0, -1], len(at["mu"]))
    off = np.select([agree == 1, agree == 0], [1.0, 1.5], np.nan)
    growth, frequency = 100.0 * (at["mu"] - 0.1), 8e3 + at["mu"]
    return {
        "modal_growth_rate": growth, "growth_rate_in_time": growth * off, "modal_frequency_hz": frequency,
        "frequency_in_time_hz": frequency * off, "agree": agree,
    }  # fmt: skip


RESULTS = {"steady": pressed, "simulate": in_time, "compare": compared}


def ordinates(ax: Axes, label: str) -> list[float]:
    """Finite ordinates of the marks with the look that a legend has for these words, by the parameter."""
    legend = ax.get_legend()
    shown = dict(zip([t.get_text() for t in legend.get_texts()], legend.legend_handles, strict=True)) if legend else {}
    handle = shown.get(label)
    points: list[tuple[float, float]] = []
    for line in ax.get_lines():
        same = handle is None or (line.get_marker(), line.get_markeredgecolor(), line.get_markerfacecolor() == "none") == (
            handle.get_marker(), handle.get_markeredgecolor(), handle.get_markerfacecolor() == "none"
        )  # fmt: skip
        if same and line.get_marker() != "None":
            points += [(x, y) for x, y in line.get_xydata().tolist() if np.isfinite(y)]
    return [y for _, y in sorted(points)]


def test_a_study_of_steady_sliding_shows_forces_and_what_nodes_do() -> None:
    figure = st.study_figures(result_of(study_of(ONE, compute="steady"), pressed))["over-mu"]
    force, largest, share = figure.axes
    assert [ax.get_ylabel() for ax in figure.axes] == ["normal force [N]", "largest of a node [N]", "share of 10 contact nodes"]
    assert ordinates(force, "sum of all contacts") == pytest.approx([20.0, 21.0, 22.0, 23.0])
    assert ordinates(largest, "") == pytest.approx([3.0, 3.1, 3.2, 3.3])
    assert ordinates(share, "open") == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert ordinates(share, "stick") == pytest.approx([0.2] * 4)
    assert ordinates(share, "slip") == pytest.approx([0.8, 0.7, 0.6, 0.5])
    assert share.get_xlabel() == "friction coefficient μ"


def test_of_one_contact_node_the_largest_force_is_not_drawn_twice() -> None:
    def point(at: dict) -> dict:
        rows = len(at["mu"])
        return {"normal_force": np.full(rows, 20.0), "largest_node_force": np.full(rows, 20.0), "slipping_nodes": np.ones(rows, dtype=int)}

    result = result_of(study_of(TWO, compute="steady"), point)
    assert [ax.get_ylabel() for ax in results_over(result, "mu").axes] == ["normal force [N]", "share of contact nodes"]
    even = maps(result)
    titles = [ax.get_title(loc="left") for ax in even.axes if ax.get_visible() and ax.get_label() != "<colorbar>"]
    assert titles == ["normal force of all contacts [N]", "share of contact nodes open", "share of contact nodes in stick"]
    # Whatever has nothing below it has the numbers of the axis, and its label.
    panels = even.axes[:3]
    assert [ax.get_xlabel() != "" for ax in panels] == [ax.xaxis.get_tick_params()["labelbottom"] for ax in panels] == [False, True, True]
    # Forces that are even but for rounding have no colours of 1e-9 N.
    drawn = even.axes[0].collections[0]
    assert drawn.get_clim() == pytest.approx((19.8, 20.2))
    assert drawn.get_cmap().N == 1
    assert [text.get_text() for text in drawn.colorbar.ax.get_yticklabels() if text.get_text()] == ["20"]


def test_a_study_of_runs_shows_how_strong_how_high_and_what_contacts_do() -> None:
    figure = st.study_figures(result_of(study_of(ONE, compute="simulate"), in_time))["over-mu"]
    strength, frequency, share = figure.axes
    assert [ax.get_ylabel() for ax in figure.axes] == ["velocity, rms [m/s]", "dominant frequency [Hz]", "share of time"]
    assert ordinates(strength, "growth has ended, or none") == pytest.approx([0.12, 0.22, 0.32])
    assert ordinates(strength, "not ended, or not known") == pytest.approx([0.02])
    assert ordinates(frequency, "") == pytest.approx([8e3, 8000.1, 8000.2, 8000.3])
    assert ordinates(share, "stick") == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert ordinates(share, "slip") == pytest.approx([0.5, 0.4, 0.3, 0.2])
    assert ordinates(share, "separation") == pytest.approx([0.5] * 4)


def slow(at: dict) -> dict:
    """Runs of which those under little friction have something slower that is stronger than their line."""
    return in_time(at) | {"stronger_below_hz": np.where(at["mu"] < 0.15, 4e3, np.nan)}


def test_a_study_of_runs_tells_lines_that_do_not_dominate() -> None:
    frequency = results_over(result_of(study_of(ONE, compute="simulate"), slow), "mu").axes[1]
    assert ordinates(frequency, "nothing slower told") == pytest.approx([8000.2, 8000.3])
    assert ordinates(frequency, "something slower is stronger") == pytest.approx([8e3, 8000.1])
    result = result_of(study_of(TWO, compute="simulate"), slow)
    panel = next(ax for ax in maps(result).axes if ax.get_title(loc="left") == "dominant frequency [Hz]; ×: slower is stronger")
    coloured, crossed = panel.collections
    assert len(coloured.get_offsets()) == 12
    assert sorted(set(crossed.get_offsets()[:, 0].tolist())) == pytest.approx([0.0, 0.1])
    assert [row[-1] for title, _, rows in tables(result) for row in rows if row[0] == "stronger_below_hz"] == ["6"]
    older = StudyResult(result.path, result.data.drop_vars("stronger_below_hz"))
    assert len(maps(older).axes[1].collections) == 1
    assert ordinates(results_over(older, "mu").axes[1], "") == pytest.approx(sorted(older.data["dominant_frequency_hz"].values))


def test_runs_of_a_store_without_their_strength_are_drawn_without_it() -> None:
    result = result_of(study_of(TWO, compute="simulate"), in_time)
    older = StudyResult(result.path, result.data.drop_vars("velocity_rms"))
    assert [ax.get_ylabel() for ax in results_over(older, "mu").axes] == ["dominant frequency [Hz]", "share of time"]
    assert len([ax for ax in maps(older).axes if ax.get_visible() and ax.get_label() != "<colorbar>"]) == 3


def test_a_study_of_comparisons_shows_where_both_agree() -> None:
    figure = st.study_figures(result_of(study_of(ONE, compute="compare"), compared))["agreement"]
    growth, frequency = figure.axes
    assert (growth.get_title(loc="left"), frequency.get_title(loc="left")) == ("growth rate [1/s]", "frequency [Hz]")
    told = [text.get_text() for text in figure.legends[0].get_texts()]
    assert told == ["agree (2)", "do not agree (1)", "not decided (1)", "equal", "1 without a rate in time"]
    agree, differ, undecided, equal = growth.get_lines()
    assert agree.get_xydata().tolist() == [pytest.approx([-10.0, -10.0]), pytest.approx([20.0, 20.0])]
    assert differ.get_xydata()[0] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert not np.isfinite(undecided.get_ydata()).any()
    assert equal.get_xdata().tolist() == equal.get_ydata().tolist()
    assert len({agree.get_marker() + str(agree.get_markerfacecolor()), differ.get_marker(), "o" + str(undecided.get_markerfacecolor())}) == 3


def test_comparisons_over_a_parameter_have_both_approaches() -> None:
    figure = results_over(result_of(study_of(ONE, compute="compare"), compared), "mu")
    growth, frequency = figure.axes
    assert (growth.get_ylabel(), frequency.get_ylabel()) == ("growth rate [1/s]", "frequency [Hz]")
    assert ordinates(growth, "mode") == pytest.approx([-10.0, 0.0, 10.0, 20.0], abs=1e-9)
    assert ordinates(growth, "in time: agree") == pytest.approx([-10.0, 20.0])
    assert ordinates(frequency, "in time: do not agree") == pytest.approx([1.5 * 8000.1])
    assert "in time: not decided" not in words(figure)  # none of them has a rate


def test_a_map_of_comparisons_marks_their_verdicts() -> None:
    figure = agreement_map(result_of(study_of(TWO, compute="compare"), compared))
    ax = figure.axes[0]
    assert words(figure) == ["agree", "do not agree", "not decided"]
    assert [len(c.get_offsets()) for c in ax.collections] == [4, 4, 4]
    assert (ax.get_xscale(), ax.get_yscale(), ax.get_ylabel()) == ("linear", "log", f"{MASS} [1/s]")


@pytest.mark.parametrize(
    ("compute", "titles"),
    [
        (
            "steady",
            ["normal force of all contacts [N]", "largest force of a node [N]", "share of 10 contact nodes open", "share of 10 contact nodes in stick"],
        ),
        ("simulate", ["velocity, rms [m/s]", "dominant frequency [Hz]", "share of time in stick", "share of time in separation"]),
    ],
)
def test_maps_have_a_panel_for_each_result(compute: str, titles: list[str]) -> None:
    result = result_of(study_of(TWO, compute=compute), RESULTS[compute])
    figure = maps(result)
    panels = [ax for ax in figure.axes if ax.get_label() != "<colorbar>"]
    assert [ax.get_title(loc="left") for ax in panels] == titles
    column = {"steady": "normal_force", "simulate": "velocity_rms"}[compute]
    assert np.asarray(panels[0].collections[0].get_array()) == pytest.approx(result.data[column].values)
    # Shares begin at zero and end where they do: of many nodes few open.
    shares = [np.asarray(ax.collections[0].get_array()) for ax in panels[2:]]
    assert [ax.collections[0].get_clim() for ax in panels[2:] if np.ptp(ax.collections[0].get_array())] == [
        (0.0, share.max()) for share in shares if np.ptp(share)
    ]
    assert all(ax.get_yscale() == "log" for ax in panels)


@pytest.mark.parametrize("compute", list(RESULTS))
def test_each_analysis_has_its_figures(compute: str) -> None:
    one = st.study_figures(result_of(study_of(ONE, compute=compute), RESULTS[compute]))
    two = st.study_figures(result_of(study_of(TWO, compute=compute), RESULTS[compute]))
    over = {"over-mu", "over-bodies-beam1-damping-mass"}
    assert set(one) == {"over-mu"} | ({"agreement"} if compute == "compare" else set())
    assert set(two) == over | ({"agreement", "agreement-map"} if compute == "compare" else {"maps"})


def test_figures_of_an_analysis_are_of_it_alone() -> None:
    result = result_of(study_of(TWO), growing)
    for draw in (agreement, agreement_map, maps):
        with pytest.raises(st.AnalysisError, match="and the study computed modes"):
            draw(result)


WHOLE = {
    "modes": (TWO, growing), "onsets": (ONSETS, ladder), "steady": (TWO, pressed), "simulate": (TWO, in_time),
    "compare": (TWO, compared),
}  # fmt: skip


# Figures of runs are those of comparisons, and more of steady sliding.
@pytest.mark.parametrize("compute", [pytest.param(c, marks=pytest.mark.slow) if c == "simulate" else c for c in WHOLE])
@pytest.mark.parametrize(
    "beside", [pytest.param(False, id="two vary"), pytest.param(True, id="three vary", marks=pytest.mark.slow)]
)
def test_no_words_of_a_figure_lie_on_others(compute: str, beside: bool) -> None:
    parameters, columns = WHOLE[compute]
    if beside:
        parameters = parameters | {"bodies.beam2.damping.stiffness": {"values": (1e-8, 2e-8)}, "materials.steel.young_modulus": {"values": (2e11, 2.1e11)}}
    study = onset_study() if compute == "onsets" and not beside else study_of(parameters, compute=compute)
    for name, figure in st.study_figures(result_of(study, columns)).items():
        assert clashes(figure) == [], name
        assert cut_off(figure) == [], name


def test_a_page_has_every_figure_with_its_words(tmp_path: Path) -> None:
    from stridor.studies.page import write_page

    for compute, (parameters, columns) in WHOLE.items():
        result = result_of(onset_study() if compute == "onsets" else study_of(parameters, compute=compute), columns)
        drawn = st.study_figures(result)
        with nothing_drawn():
            page = write_page(result, drawn, tmp_path / f"{compute}.html").read_text(encoding="utf-8")
        assert page.count("<img ") == page.count("<figcaption>") == len(drawn)
        for name in drawn:
            assert f'id="figure-{name}"' in page
            title = "Over friction coefficient μ" if name == "over-mu" else ""
            assert re.search(rf'<li><a href="#figure-{name}">{title}', page)
            assert f'<a href="#figure-{name}">{name}<' not in page  # a title in words, not the name of the file
