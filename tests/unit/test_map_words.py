"""Words on maps: counts of a stability boundary and marks of an ensemble, where there is room for them."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest

import stridor as st
from drawn_words import boxes, clashes, cut_off
from stridor.case import template_text
from stridor.study.boundary_result import Boundary, BoundaryCurve, CountedAt, SolvedAgain
from stridor.study.ensemble_result import Ensemble, ModalMap

PATH = "bodies.beam1.damping.mass"


def boundary(heights: list[float], *, confirmed: tuple[SolvedAgain, ...] = (), case: str = "") -> Boundary:
    """Level curves at these shares of the height, above each of which one mode more grows."""
    one, none = np.ones(2), np.zeros(2)
    curves = tuple(
        BoundaryCurve(
            x=np.array([0.0, 1.0]), y=y * one, frequency_hz=1e3 * (1 + k) * one, tangent_x=one, tangent_y=none,
            growth_side=np.ones(2, dtype=int), modes_beside=np.full(2, k), kind="flutter", closed=False,
            ends=("edge", "edge"), residual=none, error=none, deviation=0.0,
        )
        for k, y in enumerate(heights)
    )  # fmt: skip
    return Boundary(
        x=PATH, y="mu", x_range=(0.0, 1.0), y_range=(0.0, 1.0), max_frequency_hz=1e4, curves=curves, lines_x=(0.5,),
        lines_y=(0.5,), counted=(CountedAt(0.5, 0.001, 0),), agree=True, sentence="", method="full", size=2, solves=1,
        steps=1, full_solves=1, confirmed=confirmed, provenance={"case": case},
    )  # fmt: skip


def counts(figure: Any) -> list[str]:
    return [text.get_text() for text in figure.axes[0].texts]


def keys(figure: Any) -> list[str]:
    return [text.get_text() for text in figure.axes[0].get_legend().get_texts()]


def test_regions_bear_their_count():
    figure = st.plot.stability_boundary(boundary([0.3, 0.6]))
    assert counts(figure) == ["0", "1", "2"]
    assert [text.get_position()[1] for text in figure.axes[0].texts] == pytest.approx([0.15, 0.45, 0.8], abs=0.05)
    assert not any("grow" in words and words[0].isdigit() for words in keys(figure))


def test_a_count_that_has_no_room_is_in_the_legend():
    """Strips of a hundredth of the height: numbers in them lay on curves and on one another."""
    figure = st.plot.stability_boundary(boundary([0.5, 0.51, 0.52, 0.53]))
    assert counts(figure) == ["0", "4"]
    assert [words for words in keys(figure) if words[0].isdigit()] == ["1 grows", "2 grow", "3 grow"]
    shades = [h.get_facecolor() for h in figure.axes[0].get_legend().legend_handles if hasattr(h, "get_hatch")]
    assert len(set(shades)) == 3
    assert not clashes(figure)
    assert not cut_off(figure)


@pytest.mark.parametrize("heights", [[0.98], [0.02], [0.05, 0.12, 0.2, 0.9]])
def test_counts_lie_clear_of_curves_axes_and_one_another(heights: list[float]):
    figure = st.plot.stability_boundary(boundary(heights))
    ax = figure.axes[0]
    assert not clashes(figure)
    frame = ax.get_window_extent()
    assert len(ax.texts) >= 1
    for text in ax.texts:
        box = text.get_window_extent()
        assert frame.y0 <= box.y0
        assert box.y1 <= frame.y1
        for height in heights:
            level = ax.transData.transform((0.5, height))[1]
            assert not box.y0 + 1 < level < box.y1 - 1


def test_counts_lie_clear_of_rings():
    there = st.plot.stability_boundary(boundary([0.5])).axes[0].texts[1].get_position()
    ring = SolvedAgain(0, *there, 0.0, 0.0)
    figure = st.plot.stability_boundary(boundary([0.5], confirmed=(ring,)))
    boxes(figure)
    box = figure.axes[0].texts[1].get_window_extent()
    x, y = figure.axes[0].transData.transform(there)
    assert not (box.x0 - 2 < x < box.x1 + 2 and box.y0 - 2 < y < box.y1 + 2)


def test_what_is_not_known_is_hatched():
    """Of two modes that grow one leaves the band between x = 0.55 and 0.65; no curve tells where."""
    columns = [(0.001, 1), (0.25, 1), (0.55, 1), (0.65, 0), (0.999, 0)]
    counts_at = tuple(CountedAt(x, y, n + (y > 0.5)) for x, n in columns for y in (0.001, 0.25, 0.75, 0.999))
    known = replace(boundary([0.5]), counted=counts_at)
    middles = (np.arange(40) + 0.5) / 40
    table, sure = known.shading(middles, middles)
    inside = np.abs(middles - 0.6) < 0.05
    assert np.array_equal(sure, np.repeat(~inside[:, None], 40, axis=1))
    true = 1 * (middles < 0.6)[:, None] + (middles > 0.5)
    assert np.array_equal(table[sure], true[sure])
    figure = st.plot.stability_boundary(known)
    assert counts(figure) == ["0", "1", "1", "2"]
    assert keys(figure)[-1] == "how many grow is not known"
    assert not clashes(figure)
    assert "how many grow is not known" not in keys(st.plot.stability_boundary(boundary([0.5])))


def test_numbers_of_a_boundary_have_their_units():
    ax = st.plot.stability_boundary(boundary([0.5], case=template_text("two-beams"))).axes[0]
    assert (ax.get_xlabel(), ax.get_ylabel()) == (f"{PATH} [1/s]", "friction coefficient μ")
    for text in ("", "no case"):
        assert st.plot.stability_boundary(boundary([0.5], case=text)).axes[0].get_xlabel() == PATH


# -- ensembles ---------------------------------------------------------------------------------------------------------
def ensemble(mu: int, speed: int = 1, *, contacts: tuple[str, ...] = ("A",), sweep: bool = False) -> Ensemble:
    """Members over friction and speed, each steady, each with a mode that responds."""
    size = mu * speed
    rows = size * (1 + sweep)
    mus, speeds = np.linspace(0.05, 0.4, mu), np.linspace(0.5, 4.0, speed)
    tall = np.linspace(1e3, 3e4, rows)
    share = np.tile(np.linspace(0.0, 1.0, rows)[:, None], (1, len(contacts)))
    grid = np.repeat(mus, speed), np.tile(speeds, mu)
    branches = ("up", "down") if sweep else ("",)
    modal = ModalMap(mus, np.ones(1), np.ones((mu, 1), dtype=int), np.full((mu, 1), 1e4), np.ones((mu, 1)))
    return Ensemble(
        mu=np.tile(grid[0], 1 + sweep), load=np.ones(rows), speed=np.tile(grid[1], 1 + sweep),
        perturbation=np.zeros(rows), sweep=tuple(b for b in branches for _ in range(size)), slip_speed=np.ones(rows),
        observable="beam1.tip.velocity", unit="m/s", rms=1e-3 * tall, peak=tall, frequency_hz=tall,
        stronger_below_hz=np.full(rows, np.nan), stick=share, slip=1 - share, separation=share, contact_names=contacts, growth_rate=np.zeros(rows), regime=("steady",) * rows,
        mode=np.arange(rows) % 30 + 1, mode_hz=tall, mode_deviation=np.zeros(rows), error=("",) * rows,
        window=(0.005, 0.01), step=1e-8, method="", modal=modal,
        axes=(("mu", mus), ("load", np.ones(1)), ("speed", speeds), ("perturbation", np.zeros(1))),
    )  # fmt: skip


SIZES = [
    (1, 1, False), (6, 1, True), (6, 4, True), (32, 32, False),
    *(
        pytest.param(*size, marks=pytest.mark.slow)
        for size in ((6, 1, False), (40, 1, True), (6, 4, False), (12, 10, False), (20, 8, False))
    ),
]  # fmt: skip


@pytest.mark.parametrize(("mu", "speed", "sweep"), SIZES)
def test_nothing_on_an_ensemble_lies_on_something_else(mu: int, speed: int, sweep: bool):
    figure = st.plot.ensemble_map(ensemble(mu, speed, contacts=("A", "B"), sweep=sweep))
    assert clashes(figure) == []
    assert cut_off(figure) == []


@pytest.mark.parametrize(("mu", "speed", "sweep"), SIZES)
def test_rings_of_an_ensemble_fit_their_cells(mu: int, speed: int, sweep: bool):
    figure = st.plot.ensemble_map(ensemble(mu, speed, sweep=sweep))
    boxes(figure)
    rings = [line for line in figure.axes[0].lines if line.get_markerfacecolor() == "none"]
    assert len(rings) == mu * speed * (2 if sweep and speed == 1 else 1)
    if speed > 1:
        places = np.array([figure.axes[0].transData.transform(line.get_xydata()[0]) for line in rings])
        apart = min(np.hypot(*(a - b)) for a, b in combinations(places[: 2 * speed], 2)) * 72 / figure.dpi
        assert rings[0].get_markersize() < apart


def test_an_ensemble_says_what_its_marks_mean():
    head = st.plot.ensemble_map(ensemble(6, 4))._suptitle.get_text()
    assert head == "beam1.tip.velocity, 5 … 10 ms\nring: steady; number: unstable mode within 5 % of the frequency"
    many = st.plot.ensemble_map(ensemble(32, 32, contacts=("A", "B")))
    told = many._suptitle.get_text().replace("\n", " ")
    assert "no room for the numbers of the modes that respond: see the table" in told
    assert "shares: the largest of all contacts" in told
    assert not many.axes[1].texts


@pytest.mark.parametrize(("mu", "speed", "sweep"), [(6, 4, False), (6, 1, True)])
def test_members_whose_line_does_not_dominate_have_a_cross_and_no_number(mu: int, speed: int, sweep: bool):
    whole = ensemble(mu, speed, sweep=sweep)
    chosen = np.arange(len(whole)) % 3 == 0
    told = replace(whole, stronger_below_hz=np.where(chosen, 500.0, np.nan), mode=np.where(chosen, 0, whole.mode))
    figure = st.plot.ensemble_map(told)
    crosses = [line.get_xydata()[0].tolist() for line in figure.axes[1].lines if line.get_marker() == "x"]
    height = whole.speed if speed > 1 else whole.frequency_hz / 1e3
    assert crosses == np.column_stack([whole.mu, height])[chosen].tolist()
    assert len(figure.axes[1].texts) == np.count_nonzero(~chosen)
    head = figure._suptitle.get_text().replace("\n", " ")
    assert "cross: something too slow for the window is stronger" in head
    assert clashes(figure) == []


def test_panels_of_an_ensemble_have_their_units():
    figure = st.plot.ensemble_map(ensemble(6, 4))
    titles = [ax.get_title(loc="left") for ax in figure.axes if ax.get_label() != "<colorbar>"]
    assert titles == [
        "rms [m/s]", "dominant frequency [kHz]", "share of time in stick", "share of time in separation",
        "modes that grow", "frequency of the fastest of them [kHz]",
    ]  # fmt: skip
