"""What an ensemble says of one member: regimes by the halves of the window, observables by their names."""

from __future__ import annotations

import numpy as np
import pytest

import stridor as st
from benches import paper_case
from stridor.io.result_checks import check_results
from stridor.study.ensemble_numbers import numbers_of, observable_of
from stridor.study.settings import settings_of
from stridor.system import build_system
from stridor.temporal.trajectory import ContactStatistics, PhaseResult, Trajectory

SLIPS = ContactStatistics(0.0, 1.0, 0.0, 1.0, 1.0, 1.0, None, None)
STICKS = ContactStatistics(1.0, 0.0, 0.0, 1.0, 1.0, 1.0, None, None)
CHANGES = ContactStatistics(0.3, 0.6, 0.1, 1.0, 1.0, 1.0, None, None)
STEP, COUNT, LINE = 1e-5, 4000, 500.0


def member(velocity: np.ndarray, contact: ContactStatistics) -> Trajectory:
    """A run of a phase and a window, whose one point moves along x."""
    time = STEP * np.arange(COUNT)
    nothing, moved = np.zeros((COUNT, 1)), np.zeros((COUNT, 1, 2))
    moved[:, 0, 0] = velocity
    half, end = STEP * COUNT / 2, STEP * COUNT
    phases = tuple(PhaseResult(n, a, b, {"A": contact}) for n, a, b in (("slide", 0.0, half), ("window", half, end)))
    return Trajectory(
        time=time, contact_names=("A",), normal_force=nothing, tangential_force=nothing, slip_speed=nothing, gap=nothing,
        status=nothing.astype(int), watch_names=("P",), displacement=moved, velocity=moved, acceleration=moved,
        kinetic=time, elastic=time, works={}, phases=phases, step=STEP, beta2=0.5, record_every=1, steps=COUNT,
        planned_steps=COUNT, path="modal", path_reason="", step_limit=STEP, limiting_body="", most_sweeps=1,
        unconverged_steps=0, interrupted=False, wall_seconds=0.0,
    )  # fmt: skip


def observed(velocity: np.ndarray, contact: ContactStatistics):
    case = paper_case()
    found = observable_of("beam1.tip.velocity", build_system(case), settings_of(case))
    from dataclasses import replace

    return numbers_of(member(velocity, contact), replace(found, owner="P"), 5000.0)


@pytest.mark.parametrize(
    ("rate", "contact", "regime"),
    [
        (0.0, CHANGES, "steady"), (30.0, CHANGES, "transient"), (-30.0, CHANGES, "transient"),
        (0.0, SLIPS, "linear"), (30.0, SLIPS, "grows"), (-30.0, SLIPS, "decays"), (0.0, STICKS, "sticks"),
        (30.0, STICKS, "sticks"), (None, SLIPS, "still"),
    ],
)  # fmt: skip
def test_regimes(rate, contact, regime):
    time = STEP * np.arange(COUNT)
    signal = np.zeros(COUNT) if rate is None else 2.0 * np.exp(rate * (time - time[-1])) * np.sin(2 * np.pi * LINE * time)
    found = observed(signal + 0.7, contact)
    assert found.regime == regime
    if rate is not None:
        assert found.growth_rate == pytest.approx(rate, abs=0.5)
        assert found.frequency_hz == pytest.approx(LINE, rel=3e-3)  # an eighth of a bin


def test_amplitudes_are_of_the_window_about_its_mean():
    time = STEP * np.arange(COUNT)
    signal = np.where(time < STEP * COUNT / 2, 50.0, 3.0 * np.sin(2 * np.pi * LINE * time) + 1.0)
    found = observed(signal, CHANGES)
    assert found.rms == pytest.approx(3.0 / np.sqrt(2.0), rel=1e-3)
    assert found.peak == pytest.approx(3.0, rel=1e-3)


@pytest.mark.parametrize(("slow", "told"), [(3.0, True), (0.1, False)])
def test_what_is_stronger_than_the_line_and_slower_than_the_window_resolves_is_told(slow, told):
    """A swing of one period in the window, beside a line of ten."""
    time = STEP * np.arange(COUNT)
    swing = slow * np.sin(2 * np.pi * 2 / (STEP * COUNT) * time)
    found = observed(np.sin(2 * np.pi * LINE * time) + swing, CHANGES)
    assert found.frequency_hz == pytest.approx(LINE, rel=1e-2)
    assert np.isfinite(found.stronger_below_hz) == told
    if told:  # the third bin of Hann's window over half of what the filter leaves
        assert 6 / (STEP * COUNT) <= found.stronger_below_hz <= 9.01 / (STEP * COUNT)


SHORT = {
    "bodies.beam1.elements": 6, "bodies.beam2.elements": 18, "temporal.step": 2e-7, "temporal.record_every": 5,
    "phases.press.duration": 1e-3, "phases.slide.duration": 2e-3, "modal.max_frequency_hz": 12e3,
}  # fmt: skip


@pytest.fixture(scope="module")
def short() -> st.Ensemble:
    """Of two members with a line beside a mode that grows, 8.6 kHz, the one whose line dominates the window last."""
    return st.ensemble(paper_case().with_(SHORT), mu=0.1, speed=[1.0, 2.0])


def test_no_mode_is_named_where_something_slower_is_stronger(short):
    case = paper_case().with_(SHORT)
    summary = st.summarise(case, st.simulate(case, 0.1))
    assert summary.stronger_below_hz is not None
    # Its window begins a record later.
    assert short.frequency_hz[0] == pytest.approx(summary.dominant_frequency_hz, rel=1e-3)
    assert short.stronger_below_hz[0] == pytest.approx(summary.stronger_below_hz, rel=2e-3)
    assert abs(short.frequency_hz[0] / short.mode_hz[1] - 1.0) < 0.05, "a mode would be named by its frequency"
    assert np.isnan(short.stronger_below_hz[1])
    assert short.mode.tolist() == [0, 8]
    assert np.isnan([short.mode_hz[0], short.mode_deviation[0]]).all()
    said = (
        "the line of 1 member does not dominate, and no mode is named for it: what swings or drifts below 4497.8 Hz is "
        "stronger, and the window is too short to tell its frequency: give the phase a longer duration to see it"
    )
    assert said in short.notes


@pytest.mark.parametrize("how", [{"separately": True}, {"sweep": "both", "swept": "speed"}])
def test_every_way_to_run_members_tells_what_is_stronger(short, how):
    other = st.ensemble(paper_case().with_(SHORT), mu=0.1, speed=[1.0, 2.0], **how)
    assert other.stronger_below_hz[0] == short.stronger_below_hz[0]
    assert other.mode[0] == 0
    named = other.mode > 0
    assert not np.any(named & np.isfinite(other.stronger_below_hz))


def test_files_tell_what_is_stronger_and_those_of_earlier_versions_open(short, tmp_path):
    heads, rows = short.table()
    column = [row[heads.index("stronger_below_hz")] for row in rows]
    assert column == [m["stronger_below_hz"] for m in short.to_json()["members"]] == [short.stronger_below_hz[0], None]
    data = st.open(st.save(short, tmp_path / "now.nc"))
    np.testing.assert_array_equal(data.stronger_below_hz.values.ravel(), short.stronger_below_hz)
    assert data.stronger_below_hz.attrs["units"] == "Hz"
    check_results(short.to_xarray().drop_vars("stronger_below_hz"))
    assert "stronger below [Hz]" in short._repr_html_()


@pytest.mark.parametrize(
    ("name", "unit", "columns"),
    [
        (None, "m/s", 2), ("beam1.tip.velocity", "m/s", 2), ("beam1.tip.acceleration_y", "m/s2", 1),
        ("beam2.end.displacement_x", "m", 1), ("A.normal_force", "N", 1), ("A.slip_speed", "m/s", 1),
    ],
)  # fmt: skip
def test_observables_by_name(name, unit, columns):
    case = paper_case().with_({"phases.press.duration": 1e-5, "phases.slide.duration": 1e-5})
    found = observable_of(name, build_system(case), settings_of(case))
    assert found.unit == unit
    run = st.simulate(case.with_({"temporal.watch": ["beam1.tip", "beam2.end"]}))
    assert found.signals(run).shape == (len(run.time), columns)


COARSE = {
    "bodies.beam1.elements": 5, "bodies.beam2.elements": 12, "temporal.step": None, "temporal.record_every": 5,
    "phases.press.duration": 2e-4, "phases.slide.duration": 2e-3,
}  # fmt: skip


@pytest.mark.parametrize(
    ("given", "panels", "marks"),
    [
        ({"mu": [0.3, 0.05]}, 6, 0), ({"mu": [0.05, 0.3], "sweep": "both"}, 6, 0),
        ({"mu": [0.05, 0.3], "speed": [2.0, 1.0]}, 6, 4), ({"mu": [0.05, 0.3], "load": [1.0, 2.0], "sweep": "both"}, 10, 8),
        ({"mu": [0.05, 0.3], "load": [1.0, 8e307], "modes": False}, 4, 4), ({"mu": [0.05, 0.3], "grid": False}, 6, 0),
    ],
)  # fmt: skip
def test_the_map_shows_every_member_where_it_is(given, panels, marks, monkeypatch):
    monkeypatch.setattr("stridor.study.ensemble.MOST", np.inf)  # a load that nobody may give makes a member fail
    found = st.ensemble(paper_case().with_(COARSE), **given)
    figure = st.plot.ensemble_map(found)
    axes = [ax for ax in figure.axes if ax.get_label() != "<colorbar>"]
    assert len(axes) == panels
    meshes = [c for ax in axes for c in ax.collections if type(c).__name__ == "QuadMesh"]
    if marks:
        shown = [m.get_array() for m in meshes[:: 4]]
        assert sum(m.size for m in shown) == len(found) == marks
        first = dict(found.axes)
        across, down = np.argsort(first["mu"]), np.argsort(first["speed" if "speed" in given else "load"])
        expected = found.rms.reshape(-1, len(across), len(down))[0][np.ix_(across, down)].T
        np.testing.assert_array_equal(np.ma.filled(shown[0], np.nan), expected)
    else:
        first = found.rms[: len(found) // max(1, len(set(found.sweep)))]
        drawn = axes[0].lines[0].get_ydata()
        order = np.argsort(found.mu[: len(first)]) if found.axes else np.arange(len(first))
        assert drawn.tolist() == first[order].tolist()
    rings = [line for ax in axes for line in ax.lines if line.get_markerfacecolor() == "none"]
    assert len(rings) == found.regimes.get("steady", 0)


def test_a_file_of_an_ensemble_is_its_dataset(tmp_path, monkeypatch):
    monkeypatch.setattr("stridor.study.ensemble.MOST", np.inf)  # a load that nobody may give makes a member fail
    found = st.ensemble(paper_case().with_(COARSE), mu=[0.05, 0.3], load=[1.0, 8e307])
    data = st.open(st.save(found, tmp_path / "ensemble.nc"))
    assert data.attrs["analysis"] == "ensemble"
    np.testing.assert_array_equal(data.rms.values.ravel(), found.rms)
    assert data.rms.attrs["units"] == "m/s"
    assert data.regime.values.ravel().tolist() == list(found.regime)
    assert "no longer finite" in data.error.sel(mu=0.3, load=8e307).item()
    listed = st.ensemble(paper_case().with_(COARSE), mu=[0.05, 0.3], grid=False)
    held = st.open(st.save(listed, tmp_path / "listed.nc"))
    assert held.mu.values.tolist() == [0.05, 0.3]
    assert held.mode.values.tolist() == listed.mode.tolist()
    frame = found.to_dataframe()
    assert frame["A.stick"].tolist()[0] == found.stick[0, 0]
    assert frame["regime"].tolist()[1::2] == ["failed", "failed"]


ACCEPTED = "observable: {!r} – POINT.QUANTITY with a point among"


@pytest.mark.bad_input
@pytest.mark.parametrize("name", ["tip", "beam1.velocity", "A.velocity", "beam1.tip.slip_speed", "beam1.tip.velocity_z", "A.", "A.normal_force_x"])
def test_observables_that_are_none_say_what_is_accepted(name):
    case = paper_case()
    with pytest.raises(st.CaseError) as raised:
        observable_of(name, build_system(case), settings_of(case))
    assert str(raised.value).startswith(ACCEPTED.format(name))


@pytest.mark.bad_input
@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"mu": [0.1, -0.2]}, "mu: [0.1, -0.2] – finite numbers ≥ 0, at least one"),
        ({"mu": []}, "mu: [] – finite numbers ≥ 0, at least one"),
        ({"load": 0.0}, "load: 0.0 – finite numbers above 0, at least one"),
        ({"speed": [1.0, float("nan")]}, "speed: [1.0, nan] – finite numbers above 0, at least one"),
        ({"load": [1.0, 1e300]}, "load: 1e+300 – numbers up to 1e+100"),
        ({"speed": 1e101}, "speed: 1e+101 – numbers up to 1e+100"),
        ({"mu": [0.1, 1e101]}, "mu: 1e+101 – numbers up to 1e+100"),
        ({"perturbation": 1e-6}, 'perturbation: goes with initial = "steady-sliding"; from rest runs are disturbed anyway'),
        ({"mu": [0.1, 0.2], "load": [1.0, 2.0, 3.0], "grid": False}, "mu: '2 values' – one value or 3, as many as others have"),
        ({"mu": 0.1, "sweep": "up"}, "sweep: 'up' – goes over mu, of which two or more values are needed"),
        ({"mu": [0.1, 0.2], "sweep": "sideways"}, "sweep: 'sideways' – up, down or both"),
        ({"mu": [0.1, 0.2], "swept": "load"}, "swept: 'load' – goes with sweep: up, down or both"),
        ({"mu": [0.1, 0.2], "sweep": "up", "swept": "time"}, "swept: 'time' – mu, load or speed"),
        ({"mu": [0.1, 0.2], "sweep": "up", "grid": False}, "sweep: 'up' – goes over all combinations of values: grid=True"),
        ({"window": 0.0}, "window: 0.0 – the share of the last phase that is looked at, above 0 and at most 1"),
        ({"window": float("nan")}, "window: nan – the share of the last phase that is looked at, above 0 and at most 1"),
        ({"window": float("inf")}, "window: inf – the share of the last phase that is looked at, above 0 and at most 1"),
        ({"mu": [0.1, 0.2], "sweep": "up", "window": 0.95}, "window: 0.95 – at most 0.9: before it loads and speeds still change by a ramp"),
        ({"window": 1e-5}, "window: 1e-05 – a share of the last phase with 64 records at least, here it has 0: let that phase last longer, or record more often (temporal.record_every)"),
    ],
)  # fmt: skip
def test_values_that_are_none_are_refused(given, said):
    with pytest.raises(st.CaseError) as raised:
        st.ensemble(paper_case(), **given)
    assert str(raised.value) == said


@pytest.mark.bad_input
def test_a_case_in_which_nothing_moves_has_no_speed_to_scale():
    case = paper_case().with_({"supports.clamp.velocity": {}, "phases.slide.velocities": {}, "phases.press.velocities": {}})
    with pytest.raises(st.CaseError, match="no support of the case moves with a prescribed velocity"):
        st.ensemble(case, speed=2.0)
