"""Figures from small made-up results: each is drawn, shows what it should, and leaves others' style alone."""

from __future__ import annotations

import io
import subprocess
import sys
from dataclasses import replace
from functools import cache

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from benches import paper_case
from stridor.agreement import Agreement, Comparison, Perturbation
from stridor.modal.complex_modes import ComplexModes
from stridor.modal.onsets import Onset, Onsets
from stridor.system import System, build_system
from stridor.temporal.energy import EnergyBalance, energy_balance
from stridor.temporal.growth import Growth
from stridor.temporal.signals import Components, spectrogram, spectrum
from stridor.temporal.trajectory import ContactStatistics, PhaseResult, Trajectory
from stridor.view import plots, units
from stridor.view.interface_columns import columns_along
from stridor.view.shape_plots import at_best_phase
from stridor.view.temporal_tables import energy_table
from stridor.view.windows import regime_window

HZ = 2 * np.pi
CRITICAL = 0.0766


@cache
def small_system() -> System:
    """The two beams with few elements."""
    return build_system(paper_case(bodies__beam1__elements=4, bodies__beam2__elements=6))


def sweep(*, damped: bool = True, top: float = 0.2) -> ComplexModes:
    """Three branches; the last two meet at CRITICAL."""
    mu = np.linspace(0.0, top, 61)
    half = HZ * 200 * np.emath.sqrt(1 - mu / CRITICAL)
    shift = -30.0 if damped else 0.0
    pair = [shift + 1j * (HZ * 8635 + half), shift + 1j * (HZ * 8635 - half)]
    lam = np.column_stack([np.full(len(mu), shift + 1j * HZ * 500), pair[1], pair[0]])
    return ComplexModes(mu, lam, np.arange(1, 4), np.full(lam.shape, 1e-15), damped)


def found_onsets(*, damped: bool = True) -> Onsets:
    """Two onsets of flutter."""

    def one(mu: float, frequency: float, branches: tuple[int, int]) -> Onset:
        slope, point = (2.4e5, complex(mu - 1e-4, 1e-8)) if damped else (None, None)
        return Onset(mu, frequency, "flutter", damped, False, branches, 1e-16, 4410.0, slope, point)

    return Onsets((one(0.07664, 8635.4, (2, 3)), one(0.13761, 16683.6, (4, 5))), (0.0, 1.0), 40e3, damped)


def trajectory(*, step: float = 1e-5, count: int = 20_000) -> Trajectory:
    """0.2 s of 1 kHz: sticks for half of each period while sliding, opens now and then near the end."""
    time = np.arange(count) * step
    wave = np.sin(HZ * 1000 * time)
    sliding = time >= 0.1
    status = np.where(sliding & (wave < 0), 2, 1)
    status[(time > 0.18) & (wave < -0.9)] = 0
    slip = np.where(status == 1, 0.0, -0.02 + 0.05 * wave)
    force = 20 + np.where(sliding, 15 * wave, 0.0)
    motion = np.zeros((count, 2, 2))
    motion[:, 0, 0] = np.where(sliding, 1e-6 * wave, 0.0)
    motion[:, 1] = 0.5 * motion[:, 0]
    ramp = time[-1] - time
    statistics = {"A": ContactStatistics(0.5, 0.45, 0.05, 35.0, 3.5, 0.07, 0.1, 0.18)}
    works = {"external": 2 - ramp, "support": 0 * time, "damping": 1 - ramp, "friction": 0 * time, "contact": 0 * time}
    return Trajectory(
        time=time,
        contact_names=("A",),
        normal_force=force[:, None],
        tangential_force=0.1 * force[:, None],
        slip_speed=slip[:, None],
        gap=np.zeros((count, 1)),
        status=status[:, None].astype(np.int64),
        watch_names=("beam1.tip", "beam2.end"),
        displacement=motion,
        velocity=HZ * 1000 * motion,
        acceleration=(HZ * 1000) ** 2 * motion,
        kinetic=0.5 + 0 * time,
        elastic=0.5 + 0 * time,
        works=works,
        phases=(PhaseResult("press", 0.0, 0.1, statistics), PhaseResult("slide", 0.1, 0.2, statistics)),
        step=step,
        beta2=0.5,
        record_every=1,
        steps=count,
        planned_steps=count,
        path="modal",
        path_reason="made up",
        step_limit=2e-5,
        limiting_body="beam2",
        most_sweeps=1,
        unconverged_steps=0,
        interrupted=False,
        wall_seconds=0.1,
    )


def balance(run: Trajectory) -> EnergyBalance:
    return energy_balance(run)


def perturbation() -> Perturbation:
    time = np.arange(4000) * 2e-6
    signal = 1e-7 * np.exp(637 * time) * np.sin(HZ * 8641 * time)
    found = Components(np.array([636.0 + 1j * HZ * 8641.3, -30 + 1j * HZ * 500.1]), np.array([1e-7, 1e-8]))
    return Perturbation(0.1, complex(found.eigenvalues[0]), signal, 2e-6, found)


def comparison(*, mu: float = 0.1, mac: float | None = 0.9) -> Comparison:
    seen = perturbation()
    return Comparison(
        mu=mu,
        modal_eigenvalue=637.0 + 1j * HZ * 8641.0,
        unstable_hz=(8641.0,),
        unstable_growth=(637.0,),
        perturbation=seen,
        dominant_frequency_hz=1000.0,
        run_growth=Growth(200.0, 0.1, 0.15, 0.1, True, 1.0),
        frequency_error=3e-5,
        growth_rate_error=1.5e-3,
        mac=mac,
        responding=0,
        agrees=True,
        verdict=f"μ = {mu:g}: both unstable",
    )


def agreement(*more: Comparison) -> Agreement:
    return Agreement((comparison(), *more), 0.0767, 0.0766, (0.0764, 0.0768), "agree: as it should", ("a note",))


def shape(turn: complex = 1.0) -> dict[str, np.ndarray]:
    return {
        line.name: turn * np.outer(np.sin(np.linspace(0, 3, len(line.coordinates))), [0.3, 1.0 + 0.2j])
        for line in small_system().lines
    }


def spectra() -> dict:
    run = trajectory()
    return {name: spectrum(run.acceleration[10_000:, k, 0], run.sampling) for k, name in enumerate(run.watch_names)}


def everything_drawn() -> dict[str, Figure]:
    run, system = trajectory(), small_system()
    window = regime_window(run, 1000.0)
    content = spectrogram(run.velocity[:, 0, 0], run.sampling, resolution_hz=200.0)
    return {
        "root_locus": plots.root_locus(sweep()),
        "frequency_branches": plots.frequency_branches(sweep(), onsets=found_onsets()),
        "growth_branches": plots.growth_branches(sweep(), (2, 3)),
        "damping_branches": plots.damping_branches(sweep()),
        "friction_curve": plots.friction_curve(
            np.array([0.5, 0.2, np.inf, -3.0, 0.4, 0.1]), np.linspace(1e3, 6e3, 6), onsets=found_onsets(), case_mu=0.1
        ),
        "acceleration_history": plots.acceleration_history(run, "beam2.end", direction="y", max_frequency_hz=5e3),
        "contact_history": plots.contact_history(run),
        "spectrum_plot": plots.spectrum_plot(spectra(), marked_hz=1000.0),
        "spectrogram_plot": plots.spectrogram_plot(content, max_frequency_hz=5e3),
        "contact_force_and_velocity": plots.contact_force_and_velocity(
            run, window, slave="beam1.tip", steady_force=20.0
        ),
        "phase_portrait": plots.phase_portrait(run, (0.11, 0.113)),
        "energy_plot": plots.energy_plot(run, balance(run)),
        "spectrum_map": plots.spectrum_map(sweep(), perturbation().components, mu=0.1),
        "perturbation_growth": plots.perturbation_growth(
            perturbation(), modal_growth_rate=637.0, max_frequency_hz=40e3
        ),
        "growth_comparison": plots.growth_comparison((comparison(), comparison(mu=0.12))),
        "model_plot": plots.model_plot(system, paper_case()),
        "mode_shape": plots.mode_shape(system, shape(), velocity=True, title="a mode"),
        "shapes_side_by_side": plots.shapes_side_by_side(system, [("a", shape(), True), ("b", shape(-1j), False)]),
    }


def test_every_public_figure_can_be_drawn_and_saved():
    drawn = everything_drawn()
    of_solids = {"contact_map", "contact_snapshot", "interface_energy", "mesh", "solid_mode_shape"}  # test_view_solids
    of_problems = {"Animation", "animate", "mode", "model"}  # test_view_problem
    assert set(drawn) == set(plots.__all__) - of_solids - of_problems
    for name, figure in drawn.items():
        target = io.BytesIO()
        figure.savefig(target, format="png", dpi=40)
        assert target.getvalue().startswith(b"\x89PNG"), name
        assert all(ax.get_xlabel() or ax.get_ylabel() or ax.get_title("left") for ax in figure.axes), name


def test_axes_of_the_user_are_drawn_into_and_no_style_is_left_behind():
    before = dict(mpl.rcParams)
    own = Figure()
    ax = own.subplots()
    assert plots.growth_branches(sweep(), (2, 3), ax=ax) is own
    assert len(ax.lines) >= 2
    assert dict(mpl.rcParams) == before


def test_only_unstable_stretches_are_marked():
    def circles(figure: Figure) -> list[float]:
        marked = [line for line in figure.axes[0].lines if line.get_marker() == "o" and len(line.get_xdata())]
        return [float(x) for line in marked for x in line.get_xdata()]

    assert circles(plots.frequency_branches(sweep(top=0.07))) == []
    beyond = circles(plots.frequency_branches(sweep()))
    assert beyond
    assert min(beyond) > CRITICAL


def test_imaginary_frequencies_have_the_sign_of_the_paper():
    modes = sweep(damped=False)
    figure = plots.growth_branches(modes, (2, 3), imaginary_frequency=True)
    ends = {str(line.get_label()): float(line.get_ydata()[-1]) for line in figure.axes[0].lines}
    growing = int(np.argmax(modes.growth_rate[-1]))
    # exp(jωt): what grows has a negative imaginary part.
    assert ends[f"mode {modes.branch[growing]}"] == pytest.approx(-modes.growth_rate[-1, growing] / HZ)
    assert ends[f"mode {modes.branch[growing]}"] < 0


def test_the_friction_curve_is_not_joined_across_a_pole():
    # Falls through the frame, jumps from −∞ to +∞ and falls through it again: two lines, not one.
    mu, frequency = np.array([2.0, 0.8, 0.4, -2.0, 3.0, 0.6, 0.3, -1.0]), np.linspace(1e3, 8e3, 8)
    figure = plots.friction_curve(mu, frequency)
    drawn = [line.get_ydata().tolist() for line in figure.axes[0].lines]
    assert drawn == [[2.0, 0.8, 0.4, -2.0], [3.0, 0.6, 0.3, -1.0]]


def test_long_histories_lose_no_peak():
    run = trajectory(step=5e-7, count=200_000)
    run.acceleration[123_456, 0, 0] = 1e9
    figure = plots.acceleration_history(run, whole=True)
    assert figure.axes[0].dataLim.y1 == 1e9


def test_a_real_shape_has_nothing_a_quarter_of_a_period_later():
    real = {"beam": np.outer([0.0, 1.0, 2.0], [0.0, 1.0]).astype(complex)}
    turned = {"beam": real["beam"] * np.exp(0.7j)}
    best = at_best_phase(turned)["beam"]
    assert np.abs(best.imag).max() < 1e-12
    assert np.abs(best.real).max() == pytest.approx(1.0)
    assert not at_best_phase({"beam": np.zeros((3, 2), dtype=complex)})["beam"].any()


def test_shapes_beside_each_other_agree_in_sign():
    figure = plots.shapes_side_by_side(small_system(), [("a", shape(), False), ("b", shape(-1.0), False)])
    tips = [next(line.get_ydata()[-1] for line in ax.lines if line.get_label() == "beam2") for ax in figure.axes]
    assert tips[0] == pytest.approx(tips[1])


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("mu", [[0.1, 0.1], [0.0, 0.0, 0.0], [0.1]])
def test_one_coefficient_several_times(mu):
    found = sweep()
    some = np.full(len(mu), 3)
    modes = ComplexModes(np.array(mu), found.eigenvalues[some], found.branch, found.residual[some], found.damped)
    for draw in (plots.frequency_branches, plots.growth_branches, plots.damping_branches, plots.root_locus):
        draw(modes).savefig(io.BytesIO(), format="png", dpi=40)


def test_unknown_branches_are_named():
    with pytest.raises(ValueError, match=r"branches \[7\]: not among those followed, 1 to 3"):
        plots.growth_branches(sweep(), (2, 7))


def test_figures_are_loaded_only_when_asked_for():
    code = "import sys, stridor, stridor.view; print('matplotlib' in sys.modules, 'jinja2' in sys.modules)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.split() == ["False", "False"]


def test_sweeps_are_drawn_where_some_friction_has_no_modes() -> None:
    """Beyond the last μ with steady sliding, and beside a mode that is listed at one μ alone, there is NaN."""
    whole = sweep()
    eigenvalues = whole.eigenvalues.copy()
    eigenvalues[-1] = complex(np.nan, np.nan)
    eigenvalues[1:, 0] = complex(np.nan, np.nan)
    holes = replace(whole, eigenvalues=eigenvalues)
    for draw in (plots.root_locus, plots.frequency_branches, plots.growth_branches):
        figure = draw(holes)
        assert np.all(np.isfinite([ax.get_ylim() for ax in figure.axes]))
    assert not holes.unstable[-1].any()
    assert len(holes.order(len(holes.mu) - 1)) == 0


def test_all_branches_of_a_root_locus_have_the_colours_of_its_bar() -> None:
    """A branch that is listed at some μ alone, as where other nodes touch, had colours of its own range."""
    whole = sweep()
    eigenvalues = whole.eigenvalues.copy()
    eigenvalues[:40, 2] = complex(np.nan, np.nan)
    eigenvalues[20:, 0] = complex(np.nan, np.nan)
    figure = plots.root_locus(replace(whole, eigenvalues=eigenvalues))
    dots = figure.axes[0].collections
    assert len(dots) == 3
    assert {(d.norm.vmin, d.norm.vmax) for d in dots} == {(0.0, 0.2)}
    assert figure.axes[1].get_ylim() == pytest.approx((0.0, 0.2))


def test_energies_have_a_unit_of_their_size() -> None:
    """1e5 mJ had a common factor, which lay below the legend."""
    run = trajectory()
    for factor, unit in ((100.0, "J"), (1e-3, "mJ"), (1e-7, "nJ")):
        works = {name: factor * work for name, work in run.works.items()}
        grown = replace(run, works=works, kinetic=factor * run.kinetic, elastic=factor * run.elastic)
        above = plots.energy_plot(grown, balance(grown)).axes[0]
        assert above.get_ylabel() == f"energy [{unit}]"
        loads = next(line for line in above.lines if line.get_label() == "put in by loads")
        in_joules = {"J": 1.0, "mJ": 1e-3, "nJ": 1e-9}[unit] * np.asarray(loads.get_ydata())
        assert in_joules == pytest.approx(np.interp(loads.get_xdata(), run.time, works["external"]))


def test_a_common_factor_of_an_axis_is_beside_the_legend_above_it() -> None:
    run = trajectory()
    figure = plots.contact_force_and_velocity(replace(run, normal_force=1e7 * run.normal_force), (0.1, 0.11))
    figure.savefig(io.BytesIO(), format="png", dpi=100)
    above = figure.axes[0]
    factor = above.yaxis.get_offset_text()
    assert factor.get_text() == "1e8"
    assert not factor.get_window_extent().overlaps(above.get_legend().get_window_extent())


def test_only_peaks_that_leave_the_frame_are_said_to() -> None:
    """The largest value may lie inside while a smaller one, below, leaves."""
    time = np.arange(20_000)
    force = 20 + 15 * np.sin(HZ * time / 100)
    for peak, value in ((-30.0, "30"), (90.0, "90")):
        values = force.copy()
        values[1234] = peak
        values[4321] = 38.0 if peak < 0 else 36.0  # inside, or hardly more than what is usual
        run = replace(trajectory(), normal_force=values[:, None])
        above = plots.contact_history(run).axes[0]
        notes = [text.get_text() for text in above.texts if "leave" in text.get_text()]
        assert notes == [f"single peaks leave the frame, the largest {value}"]
        low, high = above.get_ylim()
        assert all(low <= x <= high for x in values if x != peak)
        assert not low <= peak <= high
    # Zero is no value of a force that stays about 20 N.
    values = 20 + 1e-3 * np.sin(HZ * time / 100)
    run = replace(trajectory(), normal_force=values[:, None], slip_speed=-values[:, None])
    for ax, (low, high) in zip(plots.contact_history(run).axes, ((19.999, 20.001), (-20.001, -19.999)), strict=True):
        assert not [text for text in ax.texts if "leave" in text.get_text()]
        assert low - 0.001 < ax.get_ylim()[0] < low < high < ax.get_ylim()[1] < high + 0.001


def test_what_does_not_move_has_no_decibels() -> None:
    said = "does not move: zero throughout"
    still = spectrum(np.zeros(256), 1e-5)
    moving = spectrum(np.sin(np.arange(256.0)), 1e-5)
    two = plots.spectrum_plot({"held": still, "free": moving})
    assert [text.get_text() for text in two.axes[0].texts] == [said]
    assert not two.axes[0].lines
    assert two.axes[1].lines
    empty = spectrogram(np.zeros(4000), 1e-5, resolution_hz=500.0)
    run = trajectory()
    for figure in (
        plots.spectrum_plot({"held": still}),
        plots.spectrogram_plot(empty),
        plots.acceleration_history(replace(run, acceleration=0 * run.acceleration)),
    ):
        assert said in [text.get_text() for text in figure.axes[0].texts]
        assert not figure.axes[0].images


@pytest.mark.parametrize(("count", "unnamed"), [(6, 0), (36, 1)])
def test_labels_of_onsets_cover_neither_each_other_nor_an_onset(count: int, unnamed: int) -> None:
    """At the μ from which on other nodes touch several modes begin to grow and others end."""
    whole, first = sweep(top=1.0), found_onsets().onsets[0]
    several = ComplexModes(
        whole.mu, np.tile(whole.eigenvalues, 3), np.arange(1, 10), np.tile(whole.residual, 3), whole.damped
    )
    found = tuple(replace(first, mu=0.3 + 0.1 * (k % 3), frequency_hz=3000.0 + 300 * k) for k in range(count))
    figure = plots.frequency_branches(several, onsets=Onsets(found, (0.0, 1.0), 40e3, True), max_frequency_hz=15e3)
    figure.savefig(io.BytesIO(), format="png", dpi=figure.dpi)
    ax = figure.axes[0]
    boxes = [Text.get_window_extent(text) for text in ax.texts]  # without the lines to the onsets
    assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])
    at = ax.transData.transform([(onset.mu, onset.frequency_hz / 1e3) for onset in found])
    assert not any(box.contains(x, y) for box in boxes for x, y in at)
    words = [text.get_text() for text in ax.get_legend().get_texts()]
    left = count - len(boxes)
    assert (left > 0) is bool(unnamed)
    assert ("onset, solved" + (f" ({left} without room for their values)" if left else "")) in words


@pytest.mark.parametrize(("slower", "frequency", "time"), [(1.0, "kHz", "ms"), (1e4, "Hz", "s")])
def test_axes_of_a_model_of_order_one_have_no_thousands(slower: float, frequency: str, time: str) -> None:
    """The same run ten thousand times slower, as without units: 0.1 Hz for 2000 s instead of 1 kHz for 0.2 s."""
    run = trajectory()
    run = replace(run, time=slower * run.time, step=slower * run.step)
    top = 5e3 / slower
    signal = run.acceleration[:, 0, 0]
    window = 0.16 * slower, 0.163 * slower
    seen = perturbation()
    seen = replace(seen, eigenvalue=seen.eigenvalue / slower, sampling=seen.sampling * slower)
    modes = replace(sweep(), eigenvalues=sweep().eigenvalues / slower)
    reach = 40e3 / slower
    curve = np.linspace(1e3, 20e3, 50) / slower
    of_frequency = (
        (plots.spectrum_plot({"a": spectrum(signal, run.sampling)}, max_frequency_hz=top), "x", 5.0),
        (plots.spectrogram_plot(spectrogram(signal, run.sampling, resolution_hz=100 / slower), max_frequency_hz=top),
         "y", 5.0),
        (plots.friction_curve(np.linspace(0.1, 0.5, 50), curve), "x", 20.0),
        (plots.spectrum_map(modes, seen.components, max_frequency_hz=reach), "x", 40.0),
        (plots.root_locus(modes, max_frequency_hz=reach), "y", 40.0),
    )  # fmt: skip
    factor = 1.0 if slower == 1.0 else 1e3 / slower  # numbers in Hz of what was in kHz
    for figure, axis, end in of_frequency:
        ax = figure.axes[0] if len(figure.axes) == 1 or figure.axes[0].get_xlabel() else figure.axes[-1]
        label, limits = (ax.get_xlabel(), ax.get_xlim()) if axis == "x" else (ax.get_ylabel(), ax.get_ylim())
        assert label == f"frequency [{frequency}]"
        assert limits[1] == pytest.approx(end * factor, rel=0.02)
    for figure, width in ((plots.contact_force_and_velocity(run, window), 3.0), (plots.perturbation_growth(seen), 8.0)):
        low, high = figure.axes[-1].get_xlim()
        assert figure.axes[-1].get_xlabel() == f"time [{time}]"
        assert high - low == pytest.approx(width if time == "ms" else 1e-3 * slower * width, rel=0.02)
    legend = plots.acceleration_history(run, max_frequency_hz=top).axes[0].get_legend()
    assert legend is not None
    assert [t.get_text() for t in legend.get_texts()] == ["all frequencies", f"up to {5 * factor:g} {frequency}"]


@pytest.mark.parametrize(
    ("unit", "usual", "large"),
    [
        (units.frequency_unit, (40e3, 1e3, "kHz"), (0.5, 1.0, "Hz")),
        (units.time_unit, (0.2, 1e-3, "ms"), (157.0, 1.0, "s")),
        (units.length_unit, (0.3, 1e-3, "mm"), (2.0, 1.0, "m")),
        (units.gap_unit, (3e-6, 1e-6, "µm"), (0.7, 1e-3, "mm")),
        (units.gap_unit, (0.0, 1e-6, "µm"), (3.0, 1.0, "m")),
        (units.energy_unit, (5e-3, 1e-3, "mJ"), (15.0, 1.0, "J")),
        (units.pressure_unit, (2e6, 1e6, "MPa"), (0.5, 1.0, "Pa")),
        (units.modulus_unit, (2e11, 1e9, "GPa"), (1.0, 1.0, "Pa")),
        (units.frequency_unit, (float("nan"), 1e3, "kHz"), (999.0, 1.0, "Hz")),
    ],
)
def test_units_are_chosen_by_size(unit, usual, large) -> None:
    for size, *named in (usual, large):
        assert unit(size) == tuple(named)


def test_a_time_late_in_a_run_has_no_more_digits_than_it_needs() -> None:
    assert units.time_unit(1e-3, 3.0) == (1e-3, "ms")
    assert units.time_unit(0.5, 2000.0) == (1.0, "s")
    assert (units.later_words(0.0123, 3), units.later_words(12.3, 3)) == ("12.3 ms", "12.3 s")


@pytest.mark.parametrize(("larger", "energy", "length"), [(1.0, "mJ", "mm"), (1e3, "J", "m")])
def test_energies_and_lengths_of_a_large_model_are_in_whole_units(larger: float, energy: str, length: str) -> None:
    run = trajectory()
    scale = 0.01 * larger
    works = {name: scale * work for name, work in run.works.items()}
    table = energy_table(balance(replace(run, works=works, kinetic=scale * run.kinetic, elastic=scale * run.elastic)))
    assert table.heads == ("", f"energy [{energy}]")
    put_in = next(row.cells[1] for row in table.rows if row.cells[0] == "put in by loads")
    assert float(put_in) == pytest.approx(20.0)
    line = np.column_stack([larger * np.linspace(0.0, 0.02, 5), np.zeros(5)])
    columns = columns_along(line, np.tile([[[1.0, 0.0]]], (5, 1, 1)))
    assert columns.label == f"position along the contact [{length}]"
    assert columns.value.max() == pytest.approx(20.0)
    friction = plots.interface_energy(line, np.ones(5))
    assert friction.axes[0].get_xlabel() == columns.label
    assert friction.axes[0].get_title(loc="left") == "friction energy per cycle: +5 J in total"
    system = small_system()
    lines = tuple(replace(one, coordinates=larger * one.coordinates) for one in system.lines)
    drawn = plots.model_plot(replace(system, lines=lines))
    assert (drawn.axes[0].get_xlabel(), drawn.axes[0].get_ylabel()) == (f"x [{length}]", f"y [{length}]")
