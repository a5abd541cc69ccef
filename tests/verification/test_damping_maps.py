"""Maps of the onset over two dampings from one reduced model, against searches in the full problem at every point."""

from __future__ import annotations

import csv
import functools
import json

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.io import mmwrite

import stridor as st
from program import stridor
from solid_cases import case, slider
from stridor.case import template_text
from stridor.study import damping_full, damping_map, damping_reduced
from stridor.study.damping_full import FullSearch
from stridor.study.damping_map import damping_map as solve
from stridor.study.damping_reduced import ReducedSearch
from stridor.view import sensitivity_plots

X, Y = "bodies.block.damping.stiffness", "bodies.slider.damping.stiffness"
DAMPED = {"bodies.block.damping": {"mass": 5.0, "stiffness": 1e-8}, "bodies.slider.damping": {"mass": 5.0}}
RANGES = {"x_range": (1e-9, 5e-8), "y_range": (1e-9, 5e-8), "mu_range": (0.0, 0.3), "max_frequency_hz": 20e3}
ONE, OTHER = "bodies.beam1.damping.mass", "bodies.beam2.damping.mass"


@pytest.fixture(scope="module")
def block() -> st.Case:
    """218 freedoms, contact over a surface."""
    return case(slider(space=False, stiffness=1e13)).with_(DAMPED)


@pytest.fixture(scope="module")
def maps(block) -> dict[str, damping_map.DampingMap]:
    return {method: solve(block, X, Y, grid=(2, 3), method=method, **RANGES) for method in ("full", "reduced")}


@pytest.fixture(scope="module")
def search(block) -> ReducedSearch:
    """Over the ranges of the maps."""
    full = FullSearch(block, (X, Y), RANGES["mu_range"], RANGES["max_frequency_hz"])
    return ReducedSearch.of(full, (RANGES["x_range"], RANGES["y_range"]), 1e-8)


@pytest.fixture(scope="module")
def beams() -> st.Case:
    return st.loads(template_text("two-beams")).with_({"modal.max_frequency_hz": 20e3})


@pytest.mark.slow
def test_a_reduced_map_is_the_full_one(maps):
    full, reduced = maps["full"], maps["reduced"]
    assert (full.method, reduced.method) == ("full", "reduced")
    assert np.all(np.isfinite(full.onset_mu))
    assert np.abs(reduced.onset_mu - full.onset_mu).max() < 1e-8
    assert reduced.frequency_hz == pytest.approx(full.frequency_hz, rel=1e-8)
    for name in ("slope_x", "slope_y"):
        assert getattr(reduced, name) == pytest.approx(getattr(full, name), rel=1e-4)
    assert reduced.undamped_mu == pytest.approx(full.undamped_mu, abs=1e-10)
    assert reduced.warnings == full.warnings == ()


def test_what_a_reduced_map_says_of_its_onsets(maps):
    full, reduced = maps["full"], maps["reduced"]
    assert (full.error, full.confirmed, full.notes) == (None, (), (damping_map.FOLLOWED,))
    # Every onset has an estimate, and those confirmed a residual and by how much they were off: less than estimated.
    assert np.all(reduced.error > 0)
    assert 4 <= len(reduced.confirmed) <= 6
    for one in reduced.confirmed:
        i, j = (int(np.flatnonzero(v == w)[0]) for v, w in ((reduced.x_values, one.x), (reduced.y_values, one.y)))
        assert reduced.residual[i, j] == one.residual < 1e-13
        assert reduced.onset_mu[i, j] == one.onset_mu
        assert one.onset_mu == pytest.approx(full.onset_mu[i, j], abs=1e-12)
        assert one.difference == abs(one.reduced_mu - one.onset_mu) < reduced.error[i, j]
    places = {(c.x, c.y) for c in reduced.confirmed}
    corners = {(x, y) for x in reduced.x_values[[0, -1]] for y in reduced.y_values[[0, -1]]}
    lowest = np.unravel_index(np.argmin(full.onset_mu), full.onset_mu.shape)
    assert corners | {(full.x_values[lowest[0]], full.y_values[lowest[1]])} <= places
    assert int(np.isfinite(reduced.residual).sum()) == len(reduced.confirmed)
    (note,) = reduced.notes
    assert note.startswith(f"6 onsets from a reduced model of {note.split()[7]} unknowns, estimated within ")
    assert f"{len(reduced.confirmed)} of them solved again in the full problem: off by " in note
    document = json.loads(json.dumps(reduced.to_json()))
    assert document["method"] == "reduced"
    assert document["confirmed"][0]["difference"] == reduced.confirmed[0].difference
    assert np.array(document["error"]) == pytest.approx(reduced.error)
    assert "error" in reduced.to_xarray()
    assert "error" not in full.to_xarray()
    words = [t.get_text() for t in sensitivity_plots.damping_map(reduced).axes[0].get_legend().get_texts()]
    assert "solved again in the full problem" in words


def test_slopes_of_the_model_are_those_of_its_onsets(search):
    """Central differences of the lowest onset."""
    at = np.array([2e-8, 3e-8])
    found, told = search.lowest(*at)
    assert told == ()
    for k in range(2):
        step = 1e-10 * np.eye(2)[k]
        high, low = (search.lowest(*(at + sign * step))[0].mu for sign in (1, -1))
        assert found.slopes[k] == pytest.approx((high - low) / 2e-10, rel=1e-4)


def test_slopes_hold_the_nodes_that_the_search_holds():
    """At the laws' own friction one node has lifted that touches at the onset: the mode there is another one."""
    lifted = case(slider(space=False, stiffness=1e13, mu=0.6)).with_(DAMPED)
    assert st.steady_sliding(lifted, 0.6).active.sum() < st.steady_sliding(lifted, 0.25).active.sum()
    search = FullSearch(lifted, (X, Y), (0.0, 0.4), 16e3)
    found, told = search.lowest(2e-8, 2e-8)
    assert told == ()
    step = 5e-10
    high, low = (search.lowest(2e-8 + sign * step, 2e-8)[0].mu for sign in (1, -1))
    assert found.slopes[0] == pytest.approx((high - low) / (2 * step), rel=1e-3)


def test_rigid_contact_too(block):
    rigid = block.with_({"contacts.rub.stiffness": "rigid"})
    ends = ((1e-9, 5e-8), (1e-9, 5e-8))
    full = FullSearch(rigid, (X, Y), (0.0, 0.2), 20e3)
    search = ReducedSearch.of(full, ends, 1e-8)
    one, other = (s.lowest(5e-8, 1e-9)[0] for s in (search, full))
    assert one.mu == pytest.approx(other.mu, abs=1e-8)
    assert one.slopes == pytest.approx(other.slopes, rel=1e-4)
    assert search.confirmed(5e-8, 1e-9, one).mu == pytest.approx(other.mu, abs=1e-12)
    # Friction is in the mass, too: the undamped onset follows that.
    bare = search.undamped()
    assert bare.mu == pytest.approx(full.undamped().mu, abs=1e-12)
    assert bare.residual < 1e-12


def test_no_damping_at_all_is_an_undamped_onset(block):
    bare = block.with_({"bodies.block.damping.mass": 0.0, "bodies.slider.damping.mass": 0.0})
    search = ReducedSearch.of(FullSearch(bare, (X, Y), (0.0, 0.3), 20e3), ((0.0, 5e-8), (0.0, 5e-8)), 1e-8)
    found, _ = search.lowest(0.0, 0.0)
    assert found == search.undamped()
    assert found.mu == pytest.approx(search.full.lowest(0.0, 0.0)[0].mu, abs=1e-12)
    assert np.all(np.isnan(found.slopes))
    assert search.confirmed(0.0, 0.0, found) is found


def test_an_onset_that_is_passed_over_is_found(beams, monkeypatch):
    """More modes grow than the onsets found account for: looked for again."""
    full = FullSearch(beams, (ONE, OTHER), (0.0, 0.3), 20e3)
    search = ReducedSearch.of(full, ((0.0, 400.0), (0.0, 400.0)), 1e-8)
    truth = {y: full.lowest(0.0, y)[0] for y in (50.0, 100.0)}
    found = damping_reduced.onsets_along

    def forgetful(*arguments, **options):
        return found(*arguments, **options)[1:]

    def blind(*arguments, **options):
        return ()

    for follow in (found, forgetful, blind):
        monkeypatch.setattr(damping_reduced, "onsets_along", follow)
        for y, expected in truth.items():
            search._near = None
            lowest, told = search.lowest(0.0, y)
            assert told == ()
            assert lowest.mu == pytest.approx(expected.mu, abs=1e-8)
            assert lowest.frequency_hz == pytest.approx(expected.frequency_hz, rel=1e-7)


def test_where_nothing_grows(block):
    quiet = solve(block, X, Y, grid=(2, 2), method="reduced", **{**RANGES, "mu_range": (0.0, 0.03)})
    assert np.all(np.isnan(quiet.onset_mu))
    assert quiet.undamped_mu is None
    assert quiet.confirmed == ()
    assert quiet.notes == (f"0 onsets from a reduced model of {quiet.notes[0].split()[7]} unknowns",)


# -- which way is taken -----------------------------------------------------------------------------------------------
def test_only_dampings_are_mapped_on_a_reduced_model(block, monkeypatch):
    for path, ends in (
        ("materials.steel.young_modulus", (190e9, 210e9)),
        ("materials.steel.density", (7000.0, 8000.0)),
        ("contacts.rub.stiffness", (1e13, 2e13)),
    ):
        with pytest.raises(st.CaseError, match=f"method: 'reduced' – for dampings only, and {path} is none"):
            solve(block, path, Y, grid=(2, 2), method="reduced", **{**RANGES, "x_range": ends})
    with pytest.raises(st.CaseError, match="method: 'half' – one of auto, full, reduced"):
        solve(block, X, Y, method="half", **RANGES)
    # Where it is not asked for by name, the full problem serves, and that is said.
    monkeypatch.setattr(damping_map, "LARGE", 0)
    monkeypatch.setattr(damping_map, "MANY", 0)
    monkeypatch.setattr(damping_full, "lowest_onset", lambda *_, **__: None)
    found = solve(block, "materials.steel.density", Y, grid=(2, 2), **{**RANGES, "x_range": (7000.0, 8000.0)})
    assert found.method == "full"
    assert found.notes == (
        "every point is searched in the full problem, there is no reduced model: method: 'reduced' – for dampings "
        "only, and materials.steel.density is none",
        damping_map.FOLLOWED,
    )


def test_a_number_against_itself_is_refused(block):
    with pytest.raises(st.CaseError, match=r"^y: '.*' – the same number as x; give another one$"):
        solve(block, Y, Y, grid=(2, 2), **RANGES)


def test_small_systems_are_searched_in_full(block, monkeypatch):
    monkeypatch.setattr(damping_full, "lowest_onset", lambda *_, **__: None)
    seen = []
    found = solve(block, X, Y, grid=(2, 3), progress=lambda *counts: seen.append(counts), **RANGES)
    assert (found.method, found.notes) == ("full", (damping_map.FOLLOWED,))
    assert seen == [(k, 6) for k in range(1, 7)]


def test_a_model_that_is_off_is_told_of(block, search, monkeypatch):
    """Estimates that are too small, and onsets that the full problem does not confirm, are warnings."""
    monkeypatch.setattr(ReducedSearch, "of", lambda *_: search)
    honest = functools.cache(search.lowest)

    def boastful(_, x, y):
        found, told = honest(x, y)
        return damping_full.LowestOnset(found.mu + 1e-6, found.frequency_hz, found.slopes, error=1e-12), told

    monkeypatch.setattr(ReducedSearch, "lowest", boastful)
    found = solve(block, X, Y, grid=(2, 2), method="reduced", **RANGES)
    assert len(found.warnings) == len(found.confirmed) == 4
    assert "the reduced model's onset is 1.0e-06 off, where 1.0e-12 was estimated" in found.warnings[0]

    def refuse(*_):
        raise st.AnalysisError("on purpose")

    monkeypatch.setattr(ReducedSearch, "confirmed", refuse)
    found = solve(block, X, Y, grid=(2, 2), method="reduced", **RANGES)
    assert len(found.warnings) == 4
    assert found.warnings[0].endswith("not confirmed in the full problem: on purpose")
    assert np.all(np.isnan(found.residual))


# -- the command line -------------------------------------------------------------------------------------------------
def test_the_command_prints_a_table_and_writes_one(block, tmp_path):
    (tmp_path / "block.toml").write_text(block.text)
    words = [
        "damping-map", "block.toml", "--x", X, "--y", Y, "--x-range", "1e-9:5e-8", "--y-range", "1e-9:5e-8",
        "--points", "2", "--method", "reduced", "--set", "modal.friction_range=[0,0.3]", "--set",
        "modal.max_frequency_hz=20e3",
    ]  # fmt: skip
    done = stridor(*words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[:3] == ["Lowest onset μ", f"  x: {X}", f"  y: {Y}"]
    assert lines[3].split() == ["x", "\\", "y", "1e-09", "5e-08"]
    assert lines[4].split()[0] == "1e-09"
    assert any(line.startswith("lowest: μ = 0.0") for line in lines)
    assert any(line.startswith("without damping: μ = 0.0") for line in lines)
    assert any(line.startswith("4 onsets from a reduced model of ") for line in lines)
    assert "written: block.out/damping_map.csv" in done.stderr
    assert (tmp_path / "block.out" / "damping_map.png").stat().st_size > 10_000
    rows = list(csv.DictReader((tmp_path / "block.out" / "damping_map.csv").open(encoding="utf-8")))
    assert list(rows[0])[:4] == [X, Y, "mu", "frequency_hz"]
    assert len(rows) == 4
    assert f"{float(rows[0]['mu']):.6f}" == lines[4].split()[1]
    assert float(rows[0]["mu_error"]) < 1e-7


def test_a_map_of_matrices_with_friction_in_a_factor_has_the_onsets_of_each_point(tmp_path):
    """Two modes that meet by a follower force: without μ in its own place no point would have an onset."""
    matrices = {
        "m": np.eye(2),
        "k": np.array([[2.0, -0.5], [-0.5, 1.5]]),
        "f": np.array([[0.0, 1.0], [0.0, 0.0]]),
        "c": np.diag([1.0, 2.0]),
    }
    for name, matrix in matrices.items():
        mmwrite(tmp_path / f"{name}.mtx", sp.coo_array(matrix))
    terms = [("m", "mass", "1.0"), ("k", "stiffness", "1.0"), ("f", "stiffness", '"mu"'), ("c", "damping", "0.01")]
    lines = ",\n".join(f'  {{ file = "{n}.mtx", role = "{role}", factor = {value} }}' for n, role, value in terms)
    text = f'title = "Two modes"\n[bodies.two]\ntype = "matrices"\nterms = [\n{lines}\n]\n'
    path = tmp_path / "two.toml"
    path.write_text(f"{text}[modal]\nfriction_range = [0.0, 2.0]\nmax_frequency_hz = 1.0\n", encoding="utf-8")
    two = st.load(path)
    damping, mass = "bodies.two.terms.3.factor", "bodies.two.terms.0.factor"
    found = st.damping_map(two, damping, mass, x_range=(0.005, 0.02), y_range=(1.0, 1.2), grid=(2, 2))

    def onset(x: float, y: float) -> float:
        first = st.onsets(two.with_({damping: x, mass: y})).first
        assert first is not None
        return first.mu

    for i, x in enumerate(found.x_values):
        for j, y in enumerate(found.y_values):
            assert found.onset_mu[i, j] == pytest.approx(onset(x, y), abs=1e-12)
            by_x = (onset(x * 1.001, y) - onset(x * 0.999, y)) / (0.002 * x)
            by_y = (onset(x, y * 1.001) - onset(x, y * 0.999)) / (0.002 * y)
            assert found.slope_x[i, j] == pytest.approx(by_x, rel=1e-5)
            assert found.slope_y[i, j] == pytest.approx(by_y, rel=1e-5)
    # Without damping K has the eigenvalues 7/4 ± √(1/16 + (½ − μ)/2), which meet at μ = 5/8.
    assert found.undamped_mu == pytest.approx(0.625, abs=1e-12)
