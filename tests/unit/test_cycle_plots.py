"""Figures of limit cycles say what is stable, what is not and what is not known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stridor as st
from mode_coupling import mode_coupling
from program import stridor
from stridor.periodic import Cycle, CycleBranch, Cycles
from stridor.view.cycle_plots import cycle_branches, cycle_period


@pytest.fixture(scope="module")
def found() -> Cycles:
    return st.cycles(mode_coupling(0.02, 0.1), 1.0, push=0.2)


def branch(found: Cycles, *told: tuple[float, int]) -> Cycles:
    """A branch of cycles with a multiplier and so many harmonics each."""
    cycle = found.cycles[0]
    cycles = [
        replace(cycle, mu=1.0 + 0.1 * k, multipliers=np.array([size], dtype=complex), harmonics=harmonics)
        for k, (size, harmonics) in enumerate(told)
    ]
    one = CycleBranch(tuple(range(len(cycles))), "", "", None, (), ())
    return replace(found, cycles=tuple(cycles), branches=(one,), onsets=())


def test_each_stability_has_its_line(found: Cycles):
    axes = cycle_branches(branch(found, (0.5, 0), (0.6, 0), (1.0, 0), (1.0, 0), (1.2, 0), (1.3, 0))).axes
    lines = [line for line in axes[0].lines if len(line.get_xdata()) > 0]
    assert len({str(line.get_linestyle()) + str(line._unscaled_dash_pattern) for line in lines}) == 3
    ends = [(np.min(line.get_xdata()), np.max(line.get_xdata())) for line in lines]
    assert ends == [pytest.approx(pair) for pair in ((1.0, 1.2), (1.2, 1.4), (1.4, 1.5))]
    legend = axes[0].get_legend()
    assert legend is not None
    assert [t.get_text() for t in legend.get_texts()] == ["stable", "unstable", "undecided or unknown"]


def test_lines_are_broken_where_there_are_more_harmonics(found: Cycles):
    axes = cycle_branches(branch(found, (0.5, 7), (0.5, 7), (0.5, 11), (0.5, 11), (0.5, 17))).axes
    for ax in axes:
        lines = [line for line in ax.lines if len(line.get_xdata()) > 0]
        assert [len(line.get_xdata()) for line in lines] == [2, 2, 1]
        assert lines[-1].get_marker() == "."


def test_one_period_says_of_what_it_is(found: Cycles):
    cycle = found.cycles[0]

    def twice(name: str) -> np.ndarray:
        return np.hstack([getattr(cycle, name)] * 2)

    idle = np.array([[1.0, 0.0, 0.0]])  # open all the time, however fast it moves
    two = replace(
        cycle, contact_names=("far", "rub"), normal_force=twice("normal_force"), status=twice("status"),
        tangential_force=twice("tangential_force"), slip_velocity=twice("slip_velocity"),
        shares=np.vstack([idle, cycle.shares]), slip_range=np.vstack([9.0 * cycle.slip_range, cycle.slip_range]),
    )  # fmt: skip

    def title(of: Cycle, contact: str | None = None) -> str:
        ax = cycle_period(of, contact).axes[0]
        return ax.get_title(loc="left") or ax.get_title()

    assert title(two).startswith("μ = 1, ")
    assert title(two).endswith("Hz, stable; contact rub")
    assert title(two, "far").endswith("contact far")
    assert "undecided" in title(replace(two, multipliers=np.array([1.0 + 0j])))
    assert "of unknown stability" in title(replace(two, multiplied=False))


def test_figures_of_an_earlier_result_go(tmp_path: Path):
    (tmp_path / "case.toml").write_text(mode_coupling(0.02, 0.1).to_toml(), encoding="utf-8")
    assert stridor("cycles", "case.toml", "--mu", "1.0", "--push", "0.2", cwd=tmp_path).returncode == 0
    figures = [tmp_path / "case.out" / name for name in ("cycles.png", "cycle_period.png")]
    assert all(figure.exists() for figure in figures)
    ended = stridor("cycles", "case.toml", "--mu", "0", cwd=tmp_path)
    assert not any(figure.exists() for figure in figures)
    assert ended.stderr.count("of an earlier result") == 2
    # Neither what was found nor that nothing was: whatever a search finds, there may be more.
    assert "such as loud ones apart from every onset, are not among them" in " ".join(ended.stdout.split())
