"""What of a run that separates belongs to the trajectory, and what to the motion it settles to."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import stridor as st
from stridor.app.cli import app
from stridor.errors import AnalysisError, CaseError
from stridor.temporal.attractor import _peaks, settled_contacts, spread
from stridor.temporal.trajectory import ContactStatistics, PhaseResult, Trajectory
from stridor.view.temporal_tables import contact_table, settled_table

pytestmark = pytest.mark.verification

TEMPLATE = Path(st.__file__).parent / "case" / "templates" / "two-beams.toml"


def made(force, status, *, separated: float | None, step: float = 1e-3) -> Trajectory:
    """A run of one contact whose histories are given, one phase."""
    r = len(force)
    column = np.zeros((r, 1))
    statistics = ContactStatistics(0.0, 0.0, 0.0, float(np.max(force)), 0.0, 1.0, None, separated)
    return Trajectory(
        time=np.arange(r) * step, contact_names=("A",), normal_force=np.asarray(force, dtype=float)[:, None],
        tangential_force=column, slip_speed=column, gap=column, status=np.asarray(status)[:, None], watch_names=(),
        displacement=np.zeros((r, 0, 2)), velocity=np.zeros((r, 0, 2)), acceleration=np.zeros((r, 0, 2)),
        kinetic=np.zeros(r), elastic=np.zeros(r), works={}, phases=(PhaseResult("all", 0.0, r * step, {"A": statistics}),),
        step=step, beta2=0.5, record_every=1, steps=r, planned_steps=r, path="modal", path_reason="", step_limit=1.0,
        limiting_body="", most_sweeps=1, unconverged_steps=0, interrupted=False, wall_seconds=0.0,
    )  # fmt: skip


def pulses(peaks, factor=1.0):
    """Before the first separation a spike of 1000 N; then for each peak p: open twice, stick at p/2, slip at p, slip at
    0.9 p, open."""
    force, status = [1000.0, 5.0], [1, 1]
    for p in peaks:
        force += [0.0, 0.0, 0.5 * factor * p, factor * p, 0.9 * factor * p, 0.0]
        status += [0, 0, 1, 2, 2, 0]
    return force, status


def test_averages_of_known_pulses_begin_with_the_first_separation():
    peaks = np.linspace(10.0, 20.0, 12)
    part = settled_contacts(made(*pulses(peaks), separated=2e-3))["A"]
    assert (part.since, part.peaks, part.largest_normal_force) == (2e-3, 12, 20.0)
    averages = part.averages
    assert averages.mean_peak_normal_force == pytest.approx(15.0, rel=1e-15)
    assert (averages.separation_fraction, averages.stick_fraction, averages.slip_fraction) == pytest.approx(
        (1 / 2, 1 / 6, 1 / 3)
    )
    assert averages.quantile_05_normal_force == 0.0
    # Of 72 sorted values the 36th and 37th are 0 and 5; the fifth and fourth from above are a peak, 190/11, and 0.9 × 20.
    assert averages.quantile_50_normal_force == pytest.approx(2.5)
    assert averages.quantile_95_normal_force == pytest.approx(190 / 11 + 0.45 * (18.0 - 190 / 11))


def test_peaks_cut_off_at_the_ends_of_the_record_are_none():
    """A stretch above the mean whose beginning or end was not recorded may have had a larger force there."""
    force = np.array([4.0, 0.0, 9.0, 8.0, 0.0, 0.0, 7.0, 0.0, 0.0, 5.0])
    assert _peaks(force).tolist() == [9.0, 7.0]
    assert _peaks(force[1:]).tolist() == [9.0, 7.0]
    assert _peaks(force[:-1]).tolist() == [9.0, 7.0]
    assert not len(_peaks(np.ones(5)))


def test_few_peaks_have_no_mean_and_runs_that_stay_closed_nothing():
    few = settled_contacts(made(*pulses(np.linspace(10.0, 20.0, 9)), separated=2e-3))["A"]
    assert few.peaks == 9
    assert few.averages.mean_peak_normal_force is None
    closed = made([5.0] * 50, [1] * 50, separated=None)
    assert settled_contacts(closed) == {}
    assert settled_table(closed) is None
    assert "chaotic" not in (contact_table(closed).caption or "")


def test_the_spread_is_that_of_the_runs():
    peaks = np.linspace(10.0, 20.0, 12)
    found = spread([made(*pulses(peaks, f), separated=2e-3) for f in (1.0, 1.1, 1.3)], 1e-12, 7).to_json()
    of = found["contacts"]["A"]
    values = 15.0 * np.array([1.0, 1.1, 1.3])
    assert (found["runs"], found["seed"], found["perturbation"]) == (3, 7, 1e-12)
    assert of["mean"]["mean_peak_normal_force"] == pytest.approx(values.mean())
    assert of["standard_deviation"]["mean_peak_normal_force"] == pytest.approx(values.std(ddof=1))
    assert of["standard_deviation"]["slip_fraction"] == 0.0
    assert of["largest_normal_force"] == pytest.approx([20.0, 26.0])


def test_the_report_tells_both_kinds_of_numbers_apart():
    run = made(*pulses(np.linspace(10.0, 20.0, 12)), separated=2e-3)
    assert "its largest values are those of this one trajectory" in contact_table(run).caption
    table = settled_table(run)
    assert [row.cells[0] for row in table.rows] == ["A"]
    assert table.rows[0].cells[3] == "15.0"


SHORT = "phases=[{name='press', duration=5e-4}]"  # the slave bounces at the very start


def test_copies_of_a_run_that_separates_part_and_share_their_averages():
    """The bench of two beams at μ = 0.12: it separates 1.7 ms after it begins to slide, and what differs in the twelfth
    digit then grows to the size of the forces."""
    phases = "phases=[{name='press', duration=1e-3}, {name='slide', duration=2e-2, velocities={clamp=1.0}}]"
    case = st.load(TEMPLATE, ["contacts.A.friction.coefficient=0.12", "temporal.record_every=20", phases])
    run = st.simulate(case)
    found = st.perturbed_copies(case, run, count=1, seed=3)
    low, high = found.largest["A"]
    assert high > low * 1.001  # extrema belong to the trajectory
    mean, deviation = found.mean["A"], found.deviation["A"]
    assert deviation["mean_peak_normal_force"] < 0.1 * mean["mean_peak_normal_force"]
    assert deviation["slip_fraction"] < 0.03
    shown = st.summarise(case, run).to_json()["settled"]["A"]["averages"]
    assert shown["slip_fraction"] == pytest.approx(mean["slip_fraction"], abs=0.03)


def test_the_same_seed_gives_the_same_copies():
    case = st.load(TEMPLATE, [SHORT])
    run = st.simulate(case)
    first, again, other = (st.perturbed_copies(case, run, count=1, seed=seed) for seed in (1, 1, 2))
    assert first == again
    # Of peaks: the first separation may fall into another record on another processor, and quantiles begin with it.
    assert first.deviation["A"]["mean_peak_normal_force"] != other.deviation["A"]["mean_peak_normal_force"]
    assert 0.0 < first.deviation["A"]["mean_peak_normal_force"] < 1e-6  # of some 40 N


def test_copies_on_the_command_line(tmp_path):
    words = ["simulate", str(TEMPLATE), "--set", SHORT, "--out", str(tmp_path), "--copies", "2"]
    document = json.loads(CliRunner().invoke(app, [*words, "--json", "--quiet"], catch_exceptions=False).stdout)
    assert document["copies"]["runs"] == 3
    assert document["copies"]["contacts"]["A"]["mean"].keys() == document["settled"]["A"]["averages"].keys()
    printed = CliRunner().invoke(app, [*words, "--quiet"], catch_exceptions=False).stdout
    printed = " ".join(printed.split())
    for line in ("mean of 3 ± one run", "contact A: largest recorded N from ", "largest values are of this one trajectory"):
        assert line in printed
    with pytest.raises(CaseError, match="--copies: 2 – a run from its start; not with --restart"):
        CliRunner().invoke(app, [*words, "--restart", str(tmp_path / "simulate.nc")], catch_exceptions=False)


def test_copies_that_cannot_be_are_refused():
    run = made(*pulses(np.linspace(10.0, 20.0, 12)), separated=2e-3)
    case = st.load(TEMPLATE)
    with pytest.raises(CaseError, match="copies: 0 – at least 1"):
        st.perturbed_copies(case, run, count=0)
    with pytest.raises(AnalysisError, match="this one was interrupted"):
        st.perturbed_copies(case, replace(run, interrupted=True))




