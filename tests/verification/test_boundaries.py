"""Stability boundaries: closed forms, benches against fine grids, and random problems against dense eigenvalues."""

from __future__ import annotations

import csv
import json
import shlex
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stridor as st
from benches import paper_case
from matrix_cases import matrix_case
from program import stridor
from random_boundaries import (
    CONSTANT,
    X,
    Y,
    disagreement,
    distance,
    eigenvalues,
    growing,
    off_the_curves,
    plane,
    random_islands,
    random_plane,
)
from stridor.io.seals import seal
from stridor.modal.boundary import Found, Plane, boundaries, march, search
from stridor.study.boundary_result import Boundary

pytestmark = pytest.mark.verification

EYE = np.eye(2)
FINE = 1001  # points along both numbers of the grid that a boundary is held against: 0.1 % of the ranges
LINES = 5
MESH = 1.0 / (LINES - 1)
C = 0.2
PARAMETER = "[parameters]\nx = {{ value = {0}, range = [{0}, {1}] }}"
OSCILLATOR = [(EYE, "mass", ""), (np.diag([1.0, 4.0]), "stiffness", ""), (np.diag([0.0, 0.3]), "damping", "")]
FIRST = np.diag([1.0, 0.0])


def flutter(folder: Path, damping: float = C) -> st.Case:
    """M = I, C = c I, K = [2, 1 − μ; 1, 2 + x]: λ² + cλ + κ = 0 with κ = 2 + x/2 ± √(x²/4 + 1 − μ). On the axis
    ω² = Re κ and (Im κ)² = c² Re κ, so that growth begins at μ = 1 + x²/4 + c² (2 + x/2); for c = 0 modes meet there."""
    terms = [
        (EYE, "mass", ""), (np.array([[2.0, 1.0], [1.0, 2.0]]), "stiffness", ""), (np.diag([0.0, 1.0]), "stiffness", "x"),
        (np.array([[0.0, -1.0], [0.0, 0.0]]), "stiffness", "mu"),
    ]  # fmt: skip
    if damping:
        terms.append((damping * EYE, "damping", ""))
    return matrix_case(folder, terms, 0.6, more=PARAMETER.format(-1.0, 2.0))


def damped_by(folder: Path, factor: str) -> st.Case:
    """Two oscillators at 1 and 2 1/s, of which the first is damped by a formula in x and mu."""
    return matrix_case(folder, [*OSCILLATOR, (FIRST, "damping", factor)], 0.6, more=PARAMETER.format(0.0, 1.0))


def crossing_branches(folder: Path) -> st.Case:
    """Two pairs of modes, weakly coupled: that of the lower frequency flutters the later the larger x is, the other one
    the earlier."""
    blocks = np.zeros((4, 4))
    blocks[:2, :2], blocks[2:, 2:] = [[2.0, 1.0], [1.0, 2.0]], [[7.0, 1.0], [1.0, 7.0]]
    blocks[1, 2] = blocks[2, 1] = 0.1
    rubbing = np.zeros((4, 4))
    rubbing[0, 1] = rubbing[2, 3] = -1.0
    terms = [
        (np.eye(4), "mass", ""), (blocks, "stiffness", ""), (rubbing, "stiffness", "mu"), (C * np.eye(4), "damping", ""),
        (np.diag([0.0, 1.0, 0.0, 0.0]), "stiffness", "x"), (np.diag([0.0, 0.0, 0.0, 1.0]), "stiffness", "2 - x"),
    ]  # fmt: skip
    return matrix_case(folder, terms, 0.8, more=PARAMETER.format(0.0, 2.0))


def traced(case: st.Case, x: str, ends: tuple[float, float], high: float) -> tuple[Boundary, Plane, Found]:
    """`stability_boundary` over x and mu, and what it traced, before it was put into the units of the case."""
    kept: list[Found] = []

    def keeping(*given: Any) -> Found:
        kept.append(boundaries(*given))
        return kept[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(import_module("stridor.study.boundary"), "boundaries", keeping)
        boundary = st.stability_boundary(case, x, "mu", x_range=ends, y_range=(0.0, high), lines=LINES)
    (found,) = kept
    return boundary, found.plane, found


def against_a_grid(plane: Plane, found: Found, columns: int = 9) -> None:
    """Some columns of a grid of 1001 × 1001 points: where the number of growing roots changes from one to the next there
    is a curve within 0.1 % of the ranges, and curves have that many on their sides; at less than 2 % of its solves."""
    assert found.agree
    assert plane.solves + plane.steps <= 0.02 * FINE**2
    assert not off_the_curves(plane, found, 1e-3, every=3)
    grid = np.linspace(0.0, 1.0, FINE)
    changes = 0
    for x in np.linspace(0.0, 1.0, columns).tolist():
        values = eigenvalues(plane, np.stack([np.full(FINE, x), grid], axis=1))
        counts = growing(values, plane.top)
        passed = np.flatnonzero(np.diff(counts))
        places = np.stack([np.full(len(passed), x), 0.5 * (grid[passed] + grid[passed + 1])], axis=1)
        assert np.all(distance(found, places) <= 1e-3)
        changes += len(passed)
    assert changes


@pytest.fixture(scope="module")
def fluttering(tmp_path_factory: pytest.TempPathFactory) -> tuple[st.Case, Boundary, Plane, Found]:
    """The boundary of `flutter`, for what changes nothing of it, and what was traced."""
    case = flutter(tmp_path_factory.mktemp("flutter"))
    return case, *traced(case, "x", (-1.0, 2.0), 3.0)


@pytest.mark.parametrize(("lean", "gap"), [
    (0.0, 0.01), pytest.param(0.5, 0.02, marks=pytest.mark.slow), pytest.param(0.5, 3e-3, marks=pytest.mark.slow),
    (-0.3, 1e-3),
])  # fmt: skip
def test_curves_that_all_but_cross_at_one_frequency_are_each_there_once(lean: float, gap: float) -> None:
    """M = K = I and C symmetric, its determinant (mu − 0.57)(x + l mu − 0.62 − 0.3 l) − gap², in shares of 0.2: growth
    begins and ends on both branches of that hyperbola, each at ω = 1."""
    s, x0, y0 = 0.2, 0.62 + 0.3 * lean, 0.57
    damping = s * np.array([[y0, gap], [gap, x0]])
    terms = [
        (EYE, "mass", CONSTANT), (EYE, "stiffness", CONSTANT), (damping, "damping", CONSTANT),
        (np.diag([-s, -s * lean]), "damping", Y), (np.diag([0.0, -s]), "damping", X),
    ]  # fmt: skip
    problem = plane(terms, [(0.0, 1.0), (0.0, 1.0)], 3.0)
    found = boundaries(problem)
    first, second = found.curves
    assert found.agree
    for curve in (first, second):
        x, y = curve.points.T
        np.testing.assert_allclose((y - y0) * (x + lean * y - x0), gap**2, rtol=0.0, atol=1e-12)
    branches = [np.sign(curve.points[:, 1] - y0) for curve in (first, second)]
    assert sorted(float(b[0]) for b in branches) == [-1.0, 1.0]
    assert all(np.all(b == b[0]) for b in branches)


def test_growth_begins_where_the_closed_form_says(fluttering: tuple[st.Case, Boundary, Plane, Found]) -> None:
    _, found, plane, curves = fluttering
    (curve,) = found.curves
    assert found.agree
    assert curve.y == pytest.approx(1 + curve.x**2 / 4 + C**2 * (2 + curve.x / 2), rel=1e-10)
    assert curve.frequency_hz == pytest.approx(np.sqrt(2 + curve.x / 2) / (2 * np.pi), rel=1e-10)
    assert curve.tangent_y / curve.tangent_x == pytest.approx(curve.x / 2 + C**2 / 2, rel=1e-8, abs=1e-10)
    (x, y, _), = found.polylines()
    assert np.abs(y - (1 + x**2 / 4 + C**2 * (2 + x / 2))).max() <= 1e-3 * 3.0
    assert set(np.hypot(curve.tangent_x / 3, curve.tangent_y / 3).round(9)) == {1.0}
    # Growth is above the curve, and its direction says so.
    assert np.array_equal(curve.growth_side, np.sign(curve.tangent_x))
    assert curve.outer.all()
    assert (curve.ends, curve.closed, curve.kind) == (("edge", "edge"), False, "flutter")
    assert (found.unstable_modes(0.0, 1.0), found.unstable_modes(0.0, 1.2)) == (0, 1)
    assert found.unstable_modes_over(np.array([0.0, 2.0]), np.array([0.5, 1.5, 2.5])).tolist() == [[0, 1, 1], [0, 0, 1]]
    assert max(c.difference for c in found.confirmed) <= 1e-9
    assert max(c.residual for c in found.confirmed) <= 1e-14
    against_a_grid(plane, curves)


def test_without_damping_the_place_where_modes_meet_is_followed(tmp_path: Path) -> None:
    found = st.stability_boundary(flutter(tmp_path, 0.0), "x", "mu", x_range=(-1.0, 2.0), y_range=(0.0, 3.0), lines=3)
    (curve,) = found.curves
    assert curve.y == pytest.approx(1 + curve.x**2 / 4, rel=1e-9)
    assert curve.tangent_y / curve.tangent_x == pytest.approx(curve.x / 2, rel=1e-6, abs=1e-8)
    assert np.isnan(curve.error).all()
    assert found.agree
    assert any("nothing is damped" in note for note in found.notes)


def test_divergence(tmp_path: Path) -> None:
    """K = [2, 1; 1, x] − μ I is singular for (2 − μ)(x − μ) = 1."""
    terms = [(EYE, "mass", ""), (np.array([[2.0, 1.0], [1.0, 0.0]]), "stiffness", ""), (0.1 * EYE, "damping", ""),
             (np.diag([0.0, 1.0]), "stiffness", "x"), (-EYE, "stiffness", "mu")]  # fmt: skip
    case = matrix_case(tmp_path, terms, 0.6, more=PARAMETER.format(1.0, 3.0))
    found = st.stability_boundary(case, "x", "mu", x_range=(1.0, 3.0), y_range=(0.0, 4.0), lines=3)
    assert [c.kind for c in found.curves] == ["divergence"] * 2
    assert found.agree
    for curve in found.curves:
        assert (2 - curve.y) * (curve.x - curve.y) == pytest.approx(np.ones(len(curve.x)), rel=1e-9)
        assert not curve.frequency_hz.any()
    assert [found.unstable_modes(2.0, mu) for mu in (0.5, 2.0, 3.5)] == [0, 1, 2]
    assert sorted(int(c.modes_beside.max()) for c in found.curves) == [0, 1]


@pytest.mark.parametrize(
    ("centre", "axes"),
    [((0.46, 0.55), (0.2, 0.15)), pytest.param((0.62, 0.61), (0.09, 0.06), marks=pytest.mark.slow)],
)
def test_an_island(tmp_path: Path, centre: tuple[float, float], axes: tuple[float, float]) -> None:
    """Growth inside an ellipse alone; the smaller one cuts no line, and is betrayed by what is counted between them."""
    (x, y), (a, b) = centre, axes
    case = damped_by(tmp_path, f"0.1*(((x - {x})/{a})**2 + ((mu - {y})/{b})**2 - 1)")
    found, *curves = traced(case, "x", (0.0, 1.0), 1.0)
    (curve,) = found.curves
    assert (curve.closed, curve.ends) == (True, ("closed", "closed"))
    assert (curve.x[0], curve.y[0]) == (curve.x[-1], curve.y[-1])
    assert ((curve.x - x) / a) ** 2 + ((curve.y - y) / b) ** 2 == pytest.approx(np.ones(len(curve.x)), rel=1e-9)
    assert (found.unstable_modes(x, y), found.unstable_modes(x + 1.05 * a, y), found.unstable_modes(0, 0)) == (1, 0, 0)
    assert found.agree
    assert "Not excluded: closed curves that lie between the lines" in found.sentence
    against_a_grid(*curves)


@pytest.mark.parametrize("tolerance", [pytest.param(1e-3, marks=pytest.mark.slow), 1e-5])
def test_pieces_between_points_are_as_near_as_asked_for(tmp_path: Path, tolerance: float) -> None:
    case = damped_by(tmp_path, "0.1*(((x - 0.46)/0.2)**2 + ((mu - 0.55)/0.15)**2 - 1)")
    found = st.stability_boundary(case, "x", "mu", x_range=(0.0, 1.0), y_range=(0.0, 1.0), tolerance=tolerance, lines=3)
    (curve,), ((x, y, _),) = found.curves, found.polylines()
    assert found.agree
    assert curve.deviation <= tolerance
    # Relative to the ellipse, whose half axes are 0.15 and 0.2; straight pieces of the drawing add some 1e-5.
    assert np.abs(np.hypot((x - 0.46) / 0.2, (y - 0.55) / 0.15) - 1).max() <= tolerance / 0.15
    assert len(curve.x) > (50 if tolerance < 1e-4 else 30)


def test_an_island_that_cuts_no_line_and_is_nowhere_counted_is_not_excluded(tmp_path: Path) -> None:
    """The growth falls off so steeply that nothing betrays it from outside: missed, and the result says that it may."""
    case = damped_by(tmp_path, "0.1 - exp(-((x - 0.2)/0.01)**2 - ((mu - 0.2)/0.01)**2)")
    found = st.stability_boundary(case, "x", "mu", x_range=(0.0, 1.0), y_range=(0.0, 1.0))
    assert not found.curves
    assert "at most 25 % of a range apart" in found.sentence
    assert "Not excluded" in found.sentence
    finer = st.stability_boundary(case, "x", "mu", x_range=(0.0, 0.4), y_range=(0.0, 0.4), lines=3)
    assert len(finer.curves) == 1  # at 0.2 there is a line now


def missed_islands(seed: int, folder: Path) -> tuple[int, int]:
    """How many islands of growth no curve goes round, of how many."""
    formula, islands = random_islands(seed)
    _, _, found = traced(damped_by(folder, formula), "x", (0.0, 1.0), 1.0)
    points = np.vstack([np.zeros((0, 2)), *(curve.points for curve in found.curves)])
    near = [np.abs(points[:, None] - island[None]).max(axis=2).min(initial=1.0) for island in islands]
    assert found.agree
    return sum(off > 0.01 for off in near), len(islands)


@pytest.mark.parametrize("seed", [pytest.param(13, marks=pytest.mark.slow), 142])
def test_small_islands_are_found_up_the_growth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """They cut no line and are betrayed by no count, but by how the damping falls off around them."""
    assert missed_islands(seed, tmp_path)[0] == 0
    monkeypatch.setattr(search, "CLIMBING", 0)
    assert missed_islands(seed, tmp_path)[0] > 0


@pytest.mark.slow
def test_of_many_small_islands_next_to_none_is_missed(tmp_path: Path) -> None:
    told = np.array([missed_islands(seed, tmp_path) for seed in range(150)])
    assert told[:, 1].sum() > 150
    assert told[:, 0].sum() <= 0.02 * told[:, 1].sum()


def test_shading_is_true_where_growing_modes_pass_the_highest_frequency(tmp_path: Path) -> None:
    """Against the eigenvalues of a dense grid. The curve ends in the band; from there on growing modes leave it where no
    curve is: what is not known there is a narrow strip, and all else is true."""
    top = np.sqrt(2.265) / (2 * np.pi)  # ω on the curve at x = 0.53
    found = st.stability_boundary(
        flutter(tmp_path), "x", "mu", x_range=(-1.0, 2.0), y_range=(0.0, 3.0), max_frequency_hz=top, lines=3
    )
    assert found.agree
    assert any("growing modes pass the highest frequency" in note for note in found.notes)
    assert any("band" in curve.ends for curve in found.curves)
    middles = (np.arange(90) + 0.5) / 90
    xs, ys = 3 * middles - 1, 3 * middles
    table, known = found.shading(xs, ys)
    x, mu = np.meshgrid(xs, ys, indexing="ij")
    kappa = 2 + x / 2 + np.array([[[1]], [[-1]]]) * np.sqrt((x**2 / 4 + 1 - mu).astype(complex))
    values = -C / 2 + np.array([1, -1])[:, None, None, None] * np.sqrt(C**2 / 4 - kappa)
    grows = (values.real > 0) & (np.abs(values) <= 2 * np.pi * top)
    true = np.count_nonzero(grows & (values.imag > 0), axis=(0, 1))
    assert set(np.unique(true)) == {0, 1}
    assert np.array_equal(table[known], true[known])
    assert np.array_equal(found.unstable_modes_over(xs, ys), table)
    strip = np.count_nonzero(~known, axis=0)
    assert np.all(strip[60:] <= 2)
    assert np.mean(strip[60:]) >= 0.5
    assert not known.all()
    assert np.mean(known) >= 0.99
    clear = known[::7, ::7]
    said = np.array([[found.unstable_modes(a, b) for b in ys[::7].tolist()] for a in xs[::7].tolist()])
    assert np.array_equal(said[clear], true[::7, ::7][clear])


def test_branches_that_all_but_meet_are_not_taken_for_one_another(tmp_path: Path) -> None:
    """(x − 1/2)(μ − 1/2) = 1e-4: two branches 1 % of the ranges from the saddle between them."""
    found, *curves = traced(damped_by(tmp_path, "(x - 0.5)*(mu - 0.5) - 1e-4"), "x", (0.0, 1.0), 1.0)
    assert found.agree
    assert len(found.curves) == 2
    for curve in found.curves:
        assert (curve.x - 0.5) * (curve.y - 0.5) == pytest.approx(np.full(len(curve.x), 1e-4), abs=1e-10)
        assert len(set(np.sign(curve.x - 0.5))) == 1
    against_a_grid(*curves)


def test_a_corner_on_an_edge_is_no_curve_of_its_own(tmp_path: Path) -> None:
    """|x − 1/2| = μ/10: two straight lines from a point on μ = 0, which is an onset of that line."""
    case = damped_by(tmp_path, "abs(x - 0.5) - mu*0.1")
    found = st.stability_boundary(case, "x", "mu", x_range=(0.0, 1.0), y_range=(0.0, 1.0), lines=3)
    assert found.agree
    assert len(found.curves) == 2
    for curve in found.curves:
        assert np.abs(curve.x - 0.5) == pytest.approx(0.1 * curve.y, abs=1e-9)


def test_a_factor_that_is_not_real_within_the_ranges_is_named_by_its_path(tmp_path: Path) -> None:
    case = damped_by(tmp_path, "mu*1e-3 + 0.1*sqrt((x - 0.31)*(x - 0.41))")
    with pytest.raises(st.CaseError, match=r"^bodies\.matrices\.terms\.3\.factor: .*not real at mu = 0, x = 0\.375$"):
        st.stability_boundary(case, "x", "mu", x_range=(0.0, 1.0), y_range=(0.0, 1.0))


def test_branches_that_cross(tmp_path: Path) -> None:
    """Each keeps its frequency through the crossing, and the lower of both is the outer boundary."""
    found, *curves = traced(crossing_branches(tmp_path), "x", (0.0, 2.0), 3.0)
    assert found.agree
    assert len(found.curves) == 2
    low, high = sorted(found.curves, key=lambda c: c.frequency_hz.min())
    assert low.frequency_hz.max() < 0.3 < high.frequency_hz.min()
    for curve, other in ((low, high), (high, low)):
        order, of_other = np.argsort(curve.x), np.argsort(other.x)
        beyond = curve.y[order] > np.interp(curve.x[order], other.x[of_other], other.y[of_other])
        clear = np.abs(curve.x[order] - 1.0) > 0.1
        assert np.array_equal(curve.modes_beside[order][clear], beyond[clear].astype(int))
    against_a_grid(*curves)


@pytest.mark.parametrize(
    ("top", "lines", "values"),
    [(15e3, 2, (1234.0,)), pytest.param(40e3, LINES, (0.0, 1234.0, 2000.0), marks=pytest.mark.slow)],
    ids=["low band", "whole band"],
)
def test_two_beams_against_onsets_of_the_full_problem(top: float, lines: int, values: tuple[float, ...]) -> None:
    """Curves over a damping, some of which cross, at values of it at which all onsets are sought anew along μ."""
    case, path, high = paper_case(), "bodies.beam2.damping.mass", 2000.0
    asked = {"x_range": (0.0, high), "y_range": (0.0, 0.5), "max_frequency_hz": top, "lines": lines}
    found = st.stability_boundary(case, path, "mu", **asked)
    assert len(found.curves) > 1
    assert found.agree
    assert found.method == "reduced"
    assert found.solves + found.steps <= 0.02 * FINE**2
    assert max(c.difference for c in found.confirmed) <= 1e-6
    error = np.concatenate([c.error for c in found.curves])
    assert np.nanmax(error) <= 1e-4
    for value in values:
        onsets = [o for o in st.onsets(case.with_({path: value}), (0.0, 0.5)).onsets if o.frequency_hz <= top]
        at = sorted(
            (float(np.interp(value, x, y)), float(np.interp(value, x, f))) for x, y, f in map(ascending, found.polylines())
            if x.min() <= value <= x.max()
        )  # fmt: skip
        assert len(at) == len(onsets)
        assert [mu for mu, _ in at] == pytest.approx([o.mu for o in onsets], abs=1e-3 * 0.5)
        assert [f for _, f in at] == pytest.approx([o.frequency_hz for o in onsets], rel=1e-3)


@pytest.mark.slow
def test_tongues_of_two_beams_against_onsets_of_the_full_problem() -> None:
    """Thirteen curves over a thickness that fold, cross and end in a tip, on columns at which all onsets are sought anew."""
    case, path, ends = paper_case(), "bodies.beam1.thickness", (0.001, 0.002)
    found = st.stability_boundary(case, path, "mu", x_range=ends, y_range=(0.0, 0.5))
    assert found.agree
    assert found.solves + found.steps <= 0.02 * FINE**2
    for value in (0.00111, 0.001475, 0.00183):
        at = sorted(
            (float(y[k] + (value - x[k]) / (x[k + 1] - x[k]) * (y[k + 1] - y[k])), float(f[k]))
            for x, y, f in found.polylines() for k in np.flatnonzero(np.diff(x > value)).tolist()
        )  # fmt: skip
        onsets = [o for o in st.onsets(case.with_({path: value}), (0.0, 0.5)).onsets if o.frequency_hz <= 40e3]
        assert len(onsets) >= 3
        assert [mu for mu, _ in at] == pytest.approx([o.mu for o in onsets], abs=1e-3 * 0.5)
        assert [f for _, f in at] == pytest.approx([o.frequency_hz for o in onsets], rel=1e-3)
        grows = [o.mu for o in onsets if not o.stabilising], [o.mu for o in onsets if o.stabilising]
        for mu in (0.05, 0.1501, 0.3001, 0.4801):
            said = sum(m < mu for m in grows[0]) - sum(m < mu for m in grows[1])
            assert found.unstable_modes(value, mu) == said


def ascending(line: tuple[np.ndarray, np.ndarray, np.ndarray]) -> tuple[np.ndarray, ...]:
    order = np.argsort(line[0], kind="stable")
    return tuple(v[order] for v in line)


def test_neither_number_may_be_friction() -> None:
    """At a point of a curve over two other numbers the case's own friction is an onset."""
    case = paper_case(bodies__beam1__elements=6, bodies__beam2__elements=18)
    paths = "materials.steel.density", "bodies.beam1.damping.mass"
    found = st.stability_boundary(case, *paths, x_range=(7000.0, 8000.0), y_range=(0.0, 2000.0), max_frequency_hz=20e3, lines=2)
    assert found.curves
    curve = found.curves[0]
    k = len(curve.x) // 2
    onsets = st.onsets(case.with_({paths[0]: float(curve.x[k]), paths[1]: float(curve.y[k])}), max_frequency_hz=20e3)
    near = min(onsets, key=lambda o: abs(o.mu - 0.1))
    assert near.mu == pytest.approx(0.1, rel=1e-6)
    assert near.frequency_hz == pytest.approx(curve.frequency_hz[k], rel=1e-6)


def test_an_end_without_any_damping_is_left_out(tmp_path: Path) -> None:
    """K = [2, 1 − μ; 1, 3], damping x c₁ and x c₂: for x → 0 growth begins at μ = 1 + c₁c₂/(c₁ + c₂)², and without any
    damping at 5/4, where modes meet: that is the limit for equal damping alone (Hoffmann and Gaul, ZAMM 83, 2003)."""
    terms = [(EYE, "mass", ""), (np.array([[2.0, 1.0], [1.0, 3.0]]), "stiffness", ""),
             (np.array([[0.0, -1.0], [0.0, 0.0]]), "stiffness", "mu"), (np.diag([1.0, 0.05]), "damping", "x")]  # fmt: skip
    case = matrix_case(tmp_path, terms, 0.6, more=PARAMETER.format(0.0, 0.2))
    found = st.stability_boundary(case, "x", "mu", x_range=(0.0, 0.2), y_range=(0.0, 3.0), lines=3)
    (curve,) = found.curves
    assert curve.x.min() == pytest.approx(0.2e-4)
    assert curve.y[np.argmin(curve.x)] == pytest.approx(1 + 0.05 / 1.05**2, rel=1e-6)
    assert any("nothing is damped at x = 0" in note for note in found.notes)


# -- random problems ---------------------------------------------------------------------------------------------------
def test_growth_that_begins_on_the_edges_leaves_no_curve(tmp_path: Path) -> None:
    """A damping −x y/10 of one mass: it grows wherever x y > 0, and curves lie on x = 0 and y = 0, which are left out.
    Lines find the onset at their end, whose point on the curve lies outside of the rectangle."""
    terms = [(np.eye(1), "mass", ""), (np.eye(1), "stiffness", ""), (np.array([[-0.1]]), "damping", "x*mu")]
    case = matrix_case(tmp_path, terms, 1.0, more=PARAMETER.format(0.0, 1.5))
    found = st.stability_boundary(case, "x", "mu", x_range=(0.0, 1.5), y_range=(0.0, 1.0), lines=3)
    assert not found.curves
    assert {at.unstable_modes for at in found.counted} == {1}


def wrong(seed: int, every: int = 1) -> tuple[bool, str]:
    """Whether all fits together by its own word, and where it does not although it says so; of the curves every so
    many-th piece is looked at."""
    plane = random_plane(seed)
    found = boundaries(plane, 1e-3, LINES)
    if not found.agree:
        return False, ""
    if said := disagreement(plane, found, MESH):
        return True, f"seed {seed}: {said}"
    off = [] if plane.reversible else off_the_curves(plane, found, 1e-3, every)
    return True, f"seed {seed}: no boundary at {off[0].round(4)}" if off else ""


FEW = range(1)
MORE = [pytest.param(seeds, marks=pytest.mark.slow) for seeds in ((1, 2), (3, 4), (7, 10), (13, 100), (140, 278))]


@pytest.mark.parametrize("seeds", [FEW, *MORE], ids=str)
def test_random_problems(seeds) -> None:
    every = 3 if seeds == FEW else 1
    assert [wrong(seed, every) for seed in seeds] == [(True, "")] * len(seeds)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 500, 50))
def test_many_random_problems(first: int) -> None:
    told = [wrong(seed) for seed in range(first, first + 50)]
    assert not any(words for _, words in told), "\n".join(words for _, words in told if words)
    assert sum(fits for fits, _ in told) >= 44


# -- what the checks are worth -----------------------------------------------------------------------------------------
def test_a_curve_that_is_lost_is_not_called_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A march that ends in the middle, a seed that leads to nothing, and a search that finds no onset are all told."""
    case = flutter(tmp_path)

    def boundary(lines: int = 2) -> Boundary:
        return st.stability_boundary(case, "x", "mu", x_range=(-1.0, 2.0), y_range=(0.0, 3.0), lines=lines)

    with monkeypatch.context() as patch:
        patch.setattr(march, "MOST", 3)
        found = boundary()
        assert not found.agree
        assert {end for curve in found.curves for end in curve.ends} >= {"lost"}
    with monkeypatch.context() as patch:
        patch.setattr(search._CurveSearch, "_seed", lambda *_: None)
        found = boundary()
        assert not found.agree
        assert not found.curves
        assert "growth begins or ends where no curve is" in found.sentence
    with monkeypatch.context() as patch:

        def refused(*_: object) -> None:
            raise st.AnalysisError("not today")

        patch.setattr(Plane, "onsets", refused)
        with pytest.raises(st.AnalysisError, match="not today"):
            boundary()
    with monkeypatch.context() as patch:
        lay = search._CurveSearch._lay
        patch.setattr(search._CurveSearch, "_lay", lambda self, axis, value: None if value > 0.6 else lay(self, axis, value))
        assert boundary(3).agree  # the curve is found on other lines


@pytest.mark.parametrize("factor", ["x - mu", "mu - x", "x**2 - mu**2 + 0.1 * (x - mu)"])
def test_a_boundary_through_the_points_at_which_is_counted(tmp_path: Path, factor: str) -> None:
    """μ = x passes through the middle of every cell, where rounding would decide what grows."""
    found = st.stability_boundary(damped_by(tmp_path, factor), "x", "mu", x_range=(0.0, 1.0), y_range=(0.0, 1.0), lines=3)
    assert found.agree
    (curve,) = found.curves
    assert curve.y == pytest.approx(curve.x, abs=1e-9)
    assert (found.unstable_modes(0.3, 0.6), found.unstable_modes(0.6, 0.3)) == ((0, 1) if factor == "mu - x" else (1, 0))


def test_a_number_that_nothing_depends_on(tmp_path: Path) -> None:
    with pytest.raises(st.CaseError, match=r"^y: 'mu' – the case has no contacts and no factor that names it"):
        st.stability_boundary(damped_by(tmp_path, "x"), "x", "mu", x_range=(0.0, 1.0), y_range=(0.0, 1.0))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"x": "bodies.beam1.lenght"}, "bodies.beam1.lenght"),
        ({"x": "mu"}, "y: 'mu' – the same number as x; give another one"),
        ({"x_range": (2.0, 1.0)}, "x_range: [2.0, 1.0] – two finite numbers low < high"),
        ({"y_range": (0.0, float("nan"))}, "y_range"),
        ({"y_range": (-0.1, 0.5)}, "friction coefficients are ≥ 0"),
        ({"method": "grid"}, "method: 'grid' – one of auto, reduced, full"),
        ({"tolerance": 0.0}, "tolerance: 0.0 – a share of the ranges from 1e-6 to 0.05"),
        ({"lines": 1}, "lines: 1 – from 2 to 100"),
        ({"max_frequency_hz": -1.0}, "max_frequency_hz: -1.0 – a highest frequency is a finite number > 0 [Hz]"),
        ({"method": "full", "elements": 120}, "for up to 400 freedoms"),
    ],
)
def test_what_is_refused(words: dict, said: str) -> None:
    given = {"x": "materials.steel.density", "y": "mu", "x_range": (6000.0, 9000.0), "y_range": (0.0, 0.5), **words}
    case = paper_case(bodies__beam1__elements=given.pop("elements", 6))
    with pytest.raises(st.CaseError) as error:
        st.stability_boundary(case, given.pop("x"), given.pop("y"), **given)
    assert said in str(error.value)


def test_the_verb(tmp_path: Path) -> None:
    flutter(tmp_path)
    words = ("boundary", "case.toml", "--x", "x", "--x-range", "-1:2", "--y", "mu", "--y-range", "0:3", "--lines", "2")
    done = stridor(*words, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert (document["y"], document["agree"]) == ("mu", True)
    rows = list(csv.DictReader((tmp_path / "case.out" / "boundary.csv").open(encoding="utf-8")))
    (curve,) = document["curves"]
    assert [float(r["mu"]) for r in rows] == curve["y"]
    assert {r["curve"] for r in rows} == {"1"}
    assert (tmp_path / "case.out" / "boundary.png").stat().st_size > 10_000
    said = stridor(*words, cwd=tmp_path).stdout
    assert "one curve bounds where nothing grows, down to x = " in " ".join(said.split())
    following = shlex.split(said.partition("Next: stridor ")[2].replace("\\\n", " "))
    assert stridor(*following, cwd=tmp_path).returncode == 0
    called = st.stability_boundary(st.load(tmp_path / "case.toml"), "x", "mu", x_range=(-1, 2), y_range=(0, 3), lines=2)
    assert called.to_json() == {k: v for k, v in document.items() if k != "files"}
    data = called.to_xarray()
    assert data["x"].values.tolist() == curve["x"]
    assert called.to_dataframe()["frequency_hz"].tolist() == curve["frequency_hz"]
    assert "Stability boundary over x and mu" in called._repr_html_()
    assert st.open(tmp_path / "case.out" / "boundary.nc").to_json() == called.to_json()


@pytest.mark.parametrize("empty", [False, True])
def test_a_boundary_comes_back_from_its_file(
    tmp_path: Path, empty: bool, fluttering: tuple[st.Case, Boundary, Plane, Found]
) -> None:
    high = 1e-3 if empty else 3.0
    case, found, _, _ = fluttering
    if empty:
        found = st.stability_boundary(case, "x", "mu", x_range=(-1.0, 2.0), y_range=(0.0, high))
    assert (len(found.curves) == 0) == empty
    back = st.open(st.save(found, tmp_path / "boundary.nc"))
    assert isinstance(back, Boundary)
    assert back.to_json() == found.to_json()
    assert back.provenance == json.loads(json.dumps(found.provenance))
    xs, ys = np.linspace(-1.0, 2.0, 9), np.linspace(0.0, high, 11)
    assert np.array_equal(back.unstable_modes_over(xs, ys), found.unstable_modes_over(xs, ys))
    for one, other in zip(back.curves, found.curves, strict=True):
        for name, values in vars(other).items():
            assert np.array_equal(getattr(one, name), values, equal_nan=isinstance(values, np.ndarray)), name


@pytest.mark.bad_input
@pytest.mark.parametrize(
    ("name", "value"),
    [("x_range", []), ("y_range", [1.0, 0.0]), ("method", 7), ("counted", [{}]), ("curves", None), ("lines_x", ["a"])],
)
def test_a_boundary_that_is_none_is_refused_in_one_message(
    tmp_path: Path, name: str, value: object, fluttering: tuple[st.Case, Boundary, Plane, Found]
) -> None:
    data = fluttering[1].to_xarray()
    document = json.loads(data.attrs["boundary"]) | {name: value}
    for text in (json.dumps(document), "null"):
        seal(data.assign_attrs({"boundary": text})).to_netcdf(tmp_path / "boundary.nc", engine="h5netcdf")
        with pytest.raises(st.CaseError, match="damaged or changed") as refused:
            st.open(tmp_path / "boundary.nc")
        assert "\n" not in str(refused.value)
