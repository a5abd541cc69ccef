"""The chapter on limit cycles of a report: there where the folder has those of the same model."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stridor as st
from mode_coupling import mode_coupling
from stridor.periodic import Cycles
from stridor.study.fingerprint import fingerprint, same_model
from stridor.view.cycle_parts import cycle_table, cycle_words, loudest, worth_a_row
from stridor.view.cycle_plots import cycle_branches
from undrawn import drawn_alone, nothing_drawn

PARTS = ["sensitivities", "countermeasures"]


@pytest.fixture(scope="module")
def found() -> Cycles:
    return st.cycles(mode_coupling(0.02, 0.1), between=(0.7, 1.25), push=0.2, points=40)


def page(case: st.Case, folder: Path, skip: list[str] = PARTS, **asked: bool) -> str:
    outcome = st.report(case, folder, skip=skip, **asked)
    assert outcome.report is not None
    return re.sub(r"[\s\u00a0]+", " ", outcome.report.read_text(encoding="utf-8"))


def test_cycles_of_the_same_model_are_shown(found: Cycles, tmp_path: Path):
    """Whatever its phases, steps and range of modes are."""
    case = mode_coupling(0.02, 0.1)
    st.save(found, tmp_path / "cycles.nc")
    moved = case.with_({"temporal.step": 0.01, "phases": [{"name": "long", "duration": 99.0}], "modal.friction_range": [0, 1]})
    with drawn_alone("cycle-branches", "cycle-period"):
        text = page(moved, tmp_path)
    assert '<section id="limit-cycles"' in text
    assert found.sentence in text
    assert "it begins at the onset at μ = 0.7506; reversal of slip begins between" in text
    for name in ("cycle-branches", "cycle-period"):
        assert f'<figure id="figure-{name}">' in text
        assert (tmp_path / "figures" / f"{name}.png").stat().st_size > 10_000
    (table,) = re.findall(r'<div class="table" id="table-cycles">.*?</table>', text)
    assert table.count("<tr") == 1 + len(worth_a_row(found))
    assert f'<td data-head="μ">{found.cycles[-1].mu:.6g}</td>' in table
    assert f"One period at μ = {loudest(found).mu:.6g}" in text
    with nothing_drawn():
        assert "limit-cycles" not in page(moved, tmp_path, fresh=True)


def test_cycles_of_another_model_are_not(found: Cycles, tmp_path: Path):
    def bare(case: st.Case) -> str:
        """Of the page nothing else is looked at."""
        with nothing_drawn():
            return page(case, tmp_path, [*PARTS, "modes", "onsets"])

    st.save(found, tmp_path / "cycles.nc")
    text = bare(mode_coupling(0.02, 0.2))  # another belt
    assert '<section id="limit-cycles"' not in text
    assert "cycles.nc is of another case: its limit cycles are not shown." in text
    st.save(st.onsets(mode_coupling(0.02, 0.1)), tmp_path / "cycles.nc")
    assert "cycles.nc holds no cycles: " in bare(mode_coupling(0.02, 0.1))
    st.save(replace(found, provenance={}), tmp_path / "cycles.nc")
    assert "cycles.nc does not tell its case: " in bare(mode_coupling(0.02, 0.1))
    (tmp_path / "cycles.nc").write_bytes(b"no file of results")
    assert "cycles.nc cannot be read: " in bare(mode_coupling(0.02, 0.1))
    (tmp_path / "cycles.nc").unlink()
    text = bare(mode_coupling(0.02, 0.1))
    assert "cycles.nc" not in text


@pytest.mark.slow
def test_a_run_of_another_system_or_that_has_not_settled_is_not_drawn(found: Cycles, tmp_path: Path):
    st.save(found, tmp_path / "cycles.nc")
    case = mode_coupling(0.02, 0.1).with_({"temporal.record_every": 2, "temporal.perturbation": 0.05, "modal.sweep_points": 3})

    def caption(duration: float, **phase: dict[str, float]) -> str:
        asked = case.with_({"phases": [{"name": "slide", "duration": duration, **phase}]})
        outcome = st.run(asked, tmp_path, only=["modes", "simulate", "report"])
        assert outcome.report is not None
        text = re.sub(r"[\s\u00a0]+", " ", outcome.report.read_text(encoding="utf-8"))
        (told,) = re.findall(r"(?:The run in time is not drawn|Cross: )[^<]*", text)
        return told

    assert caption(400.0).startswith("Cross: the run in time")
    assert "the run is too short" in caption(60.0)
    assert "they go with full loads and speeds, and the run ends with others (press)." in caption(400.0, loads={"press": 0.5})


def test_the_loudest_and_the_rows(found: Cycles):
    assert loudest(found).slip_amplitude == max(c.slip_amplitude for c in found.cycles if c.stable)
    rows = worth_a_row(found)
    assert rows == sorted(set(rows))
    for branch in found.branches:
        assert {branch.cycles[0], branch.cycles[-1], *branch.folds} <= set(rows)
    table = cycle_table(found)
    assert table is not None
    assert f"{len(found.cycles) - len(rows)} more cycles are in cycles.csv." in table.caption
    assert cycle_words(found)[0].startswith("Limit cycles, by shooting on the exact motion, computed on ")


def test_a_run_is_drawn_where_it_has_come_to():
    """Its last quarter, behind the overshoot with which its growth ends."""
    case = mode_coupling(0.02, 1.0).with_(
        {"phases": [{"name": "slide", "duration": 700.0}], "temporal.perturbation": 0.05, "temporal.record_every": 2}
    )
    run = st.simulate(case, mu=1.1)
    cycle = next(c for c in st.cycles(case, 1.1).cycles if c.stable and c.slip_amplitude < 0.5)
    figure = cycle_branches(st.cycles(case, 1.1), [(1.1, run)])
    (cross,) = (line for line in figure.axes[0].lines if line.get_marker() == "x")
    assert float(np.asarray(cross.get_ydata())[0]) == pytest.approx(cycle.slip_amplitude, rel=0.01)
    assert 0.5 * np.ptp(run.slip_speed) > 1.5 * cycle.slip_amplitude


def test_a_key_that_the_program_has_learned_since_makes_no_other_model_at_its_default():
    case = mode_coupling(0.02, 0.1)
    before = json.loads(json.dumps(fingerprint(case, None)))
    assert same_model(case, before)
    del before["values"]["contacts.rub.sliding"]  # "small" by default
    assert same_model(case, before)
    before["values"]["contacts.rub.sliding"] = "finite"
    assert not same_model(case, before)
    del before["values"]["contacts.rub.sliding"], before["values"]["contacts.rub.stiffness"]  # which the case gives
    assert not same_model(case, before)
