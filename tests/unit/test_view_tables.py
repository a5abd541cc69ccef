"""Printed beside computed: who is whose partner, how numbers read, which part of a run is shown."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from test_view_plots import agreement, balance, found_onsets, trajectory

import stridor as st
from benches import paper_case
from rubbing_block import rubbing_block
from stridor.app import pipeline
from stridor.study.saturation import Unsaturated
from stridor.view import report as report_module
from stridor.view.figures import temporal_figures
from stridor.view.inputs import NamedFrequencies, ReportInputs
from stridor.view.modal_tables import body_table, coupled_table, frequency_tables, onset_tables
from stridor.view.surface_figures import surface_table
from stridor.view.tables import number, paired, percent, quantity, same_as_printed, significant
from stridor.view.temporal_tables import contact_table, energy_table, values_table
from stridor.view.windows import regime_window, shown_motion, status_spans

PRINTED = paper_case().reference


def test_frequencies_find_their_partners_though_one_is_not_printed_and_one_misprinted():
    computed = [109.1, 6199.6, 8439.6, 9261.1, 12934.9, 33753.6]
    pairs = paired(computed, [109.0, 6200.0, 8840.0, 9261.0, 12935.0])
    assert pairs == [(0, 0), (1, 1), (2, 2), (3, 3), (4, 4), (5, None)]


def test_a_printed_frequency_that_nothing_comes_near_stays_alone():
    assert paired([100.0, 500.0], [100.0, 250.0, 501.0]) == [(0, 0), (None, 1), (1, 2)]
    assert paired([], [5.0]) == [(None, 0)]
    assert paired([5.0], []) == [(0, None)]


def test_rigid_motion_has_a_partner_without_a_percentage():
    table = body_table("beam1", NamedFrequencies(np.array([0.0, 491.94])), PRINTED.bodies["beam1"][:2])
    assert [row.cells[:3] for row in table.rows] == [("rigid", "0.0", "0"), ("F1", "491.9", "492")]
    assert table.rows[0].cells[3] == ""
    assert table.rows[1].cells[3] == "−0.01 %"


def test_misprints_are_marked_and_their_note_is_shown():
    modes = NamedFrequencies(np.array([6199.6, 8439.6, 9261.1]), ("F5", "T1", "F6"))
    table = body_table("beam2", modes, PRINTED.bodies["beam2"][4:7])
    misprint = table.rows[1]
    assert misprint.kind == "far"
    assert misprint.cells[3] == "−4.53 % ▲"
    assert misprint.cells[4].startswith("misprint")


def test_the_coupled_mode_that_is_not_printed_is_shown_and_marked():
    computed = np.array([25321.4, 27205.0, 27760.7, 30572.4, 35367.3])
    table = coupled_table(computed, PRINTED.coupled[-4:], found_onsets(damped=False))
    assert [row.kind for row in table.rows] == ["", "new", "", "", ""]
    assert "not printed in the source" in table.rows[1].cells


def test_without_a_reference_only_computed_columns_remain():
    case = paper_case().with_({"reference": None})
    inputs = ReportInputs(case, body_modes={"beam1": NamedFrequencies(np.array([491.9]), ("F1",))})
    assert frequency_tables(inputs)[0].heads == ("mode", "computed [Hz]")
    solved = ReportInputs(case, undamped_onsets=found_onsets(damped=False))
    assert "printed μ" not in onset_tables(solved)[0].heads


def test_onsets_meet_their_printed_values_by_frequency():
    table = onset_tables(ReportInputs(paper_case(), undamped_onsets=found_onsets(damped=False)))[0]
    first, second = table.rows[0].cells, table.rows[1].cells
    assert first[:3] == ("0.07664", "0.08", "−4.2 % ≙")
    assert second[:3] == ("0.13761", "0.23", "−40.2 % ▲")
    assert [row.kind for row in table.rows[:2]] == ["", "far"]
    missing = [row.cells[4] for row in table.rows if row.cells[0] == ""]
    assert missing == ["3621", "28820"]  # printed, in range, but not among those found


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (number(-0.04, 1), "0.0"),
        (number(-1.25, 2), "−1.25"),
        (number(None), ""),
        (number(float("nan")), ""),
        (significant(2e-8), "2 · 10⁻⁸"),
        (significant(1e10), "10¹⁰"),
        (significant(-3.25e-7, 3), "−3.25 · 10⁻⁷"),
        (quantity(5.02e-12), "5.02 · 10⁻¹²"),
        (quantity(-2e13), "−2.00 · 10¹³"),
        (percent(0.000001), "0.00 %"),
        (percent(-0.0453), "−4.53 %"),
    ],
)
def test_numbers_read_well(text, expected):
    assert text == expected


def test_equal_when_rounded_needs_decimals_in_print():
    assert same_as_printed(0.0766, 0.08)
    assert not same_as_printed(0.138, 0.23)
    assert not same_as_printed(8642.0, 8700.0)


def test_values_say_what_they_are_and_others_may_replace_them():
    run = trajectory()
    inputs = ReportInputs(
        paper_case(),
        mu=0.1,
        trajectory=run,
        agreement=agreement(),
        values={"max_normal_force": 36.0},
        value_notes={"max_normal_force": "by hand"},
    )
    table = values_table(inputs, regime_window(run, 1000.0))
    rows = {row.cells[0]: row.cells for row in table.rows}
    assert rows["max normal force"][1] == "36"
    assert rows["max normal force"][5].startswith("by hand")
    assert rows["critical μ modal"][1] == "0.0767"


def test_the_window_is_stick_and_slip_before_the_first_separation():
    run = trajectory()
    window = regime_window(run, 1000.0)
    opened = run.time[np.flatnonzero(run.status[:, 0] == 0)[0]]
    assert window.end < opened
    assert window.end - window.start == pytest.approx(3e-3, rel=0.02)
    assert 0.2 < window.stick_fraction < 0.8
    assert window.separation_fraction == 0.0
    assert "before the first separation" in window.reason
    assert window.length == "three periods of 1000 Hz"


def test_how_long_a_window_is_is_said_as_it_is():
    """Without a frequency it was called three periods: of a run that still grows it was a quarter of one."""
    run = trajectory(count=12_000)
    unknown = regime_window(run, None)
    assert unknown.length == "0.4 ms (40 records)"
    assert unknown.end - unknown.start + run.sampling == pytest.approx(0.4e-3)
    assert regime_window(replace(run, record_every=4), 5000.0).length == "three periods of 5000 Hz (15 records)"
    inputs = ReportInputs(paper_case(), trajectory=run)
    assert "over 0.4 ms (40 records), stick" in _window_caption(inputs)
    growing = replace(inputs, unsaturated=Unsaturated(50.0, 1000.0, None, "slide", None))
    assert "over three periods of 1000 Hz, stick" in _window_caption(growing)


def _window_caption(inputs):
    figures = temporal_figures(inputs, report_module._window(inputs))
    return next(figure.caption for figure in figures if figure.name == "contact-window")


def test_a_run_shorter_than_the_window_has_none():
    assert regime_window(trajectory(), 10.0) is None


def test_status_spans_cover_a_part_without_gaps():
    run = trajectory()
    spans = status_spans(run, slice(11_000, 11_300))
    assert spans[0][1] == run.time[11_000]
    assert all(a[2] == b[1] and a[0] != b[0] for a, b in pairwise(spans))
    assert {name for name, _, _ in spans} == {"stick", "slip"}


def test_tables_of_a_run_hold_every_phase_and_close_their_sum():
    run = trajectory()
    assert [row.cells[0] for row in contact_table(run).rows] == ["press", "slide"]
    last = energy_table(balance(run)).rows[-1]
    assert last.cells[0] == "missing at the end"
    assert last.kind == "good"


def test_a_point_in_contact_has_no_columns_of_surfaces() -> None:
    point = surface_table(ReportInputs(paper_case(), steady=st.steady_sliding(paper_case())))
    assert point is not None
    assert point.heads == ("contact", "force on the slave [N]", "moment about the origin [N m]")
    face = st.loads(rubbing_block("max_frequency_hz = 15e3"))
    assert surface_table(ReportInputs(face, steady=st.steady_sliding(face))).heads[3:] == ("area [m²]", "largest pressure [MPa]")


def test_of_points_that_are_held_there_is_no_spectrum():
    """Of a point that is held along x there was one at −6000 dB."""
    run = trajectory()
    turned = run.acceleration[:, :, ::-1].copy()
    turned[:, 1] = 0.0
    held = replace(run, acceleration=turned, velocity=run.velocity[:, :, ::-1])
    assert shown_motion(held) == (0, "y")
    asked = SimpleNamespace(run=held, case=paper_case())
    signals, said = pipeline._signals(asked)
    assert list(signals["spectra"]) == ["beam1.tip"]
    assert signals["spectra"]["beam1.tip"].peak()[0] == pytest.approx(1000.0, rel=0.01)
    assert signals["spectrogram"].amplitude.any()
    assert "along y" in signals["spectra_of"]
    assert "velocity along y of beam1.tip" in signals["spectrogram_of"]
    assert said == (
        "beam1.tip is held along x: its motion is shown along y.", "beam2.end: no motion along y, and no spectrum of it.",
    )  # fmt: skip
    drawn = {figure.name: figure for figure in temporal_figures(ReportInputs(paper_case(), trajectory=held, **signals), None)}
    assert drawn["acceleration"].caption.startswith("Along y")
    assert drawn["acceleration"].figure.axes[0].get_ylabel() == "acceleration y [m/s²]"

    nothing = replace(run, acceleration=0.0 * run.acceleration)
    assert shown_motion(nothing) is None
    asked.run = nothing
    assert pipeline._signals(asked) == (
        {}, ("beam1.tip, beam2.end: held, without any motion in the run; no spectrum is drawn.",)
    )  # fmt: skip
    names = [figure.name for figure in temporal_figures(ReportInputs(paper_case(), trajectory=nothing), None)]
    assert "acceleration" not in names
