"""Large models on the page: a certified reduced model, whose answers are those of the full one as far as it says."""

from __future__ import annotations

import json
import math
import queue
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stridor as st
from stridor.app.page import bench as bench_module
from stridor.app.page.bench import Bench
from stridor.app.page.mode_data import tornado_at
from stridor.app.page.model_reduced import Reduced
from stridor.app.page.runs import ENDS, Queue, Run, Wish
from stridor.app.page.state import PageState, Source, first_state
from stridor.case import template_text
from stridor.modal.parametric import ReducedModes, restricted
from stridor.study.workspace import Workspace

FINE = template_text("two-beams").replace("elements = 90", "elements = 180").replace("stiffness = 1e-8", "stiffness = 1e-9")
STATE = replace(first_state(Source("fine.toml", FINE)), mu=0.3)
STIFF = "contacts.A.stiffness"


@pytest.fixture(scope="module")
def answered() -> Callable[[PageState], list[tuple[str, Any]]]:
    bench = Bench()

    def answer(state: PageState) -> list[tuple[str, Any]]:
        found: list[tuple[str, Any]] = []
        bench(state, lambda part, content: found.append((part, json.loads(json.dumps(content, allow_nan=False)))))
        return found

    return answer


def test_what_it_answers_is_the_full_model_and_it_says_how_near(answered: Callable[[PageState], list[tuple[str, Any]]]):
    first = answered(STATE)
    case = STATE.case()
    assert st.build_system(case).size > bench_module.LARGE
    assert any("reduced model is made, once" in content["what"] for part, content in first if part == "progress")
    at = [content for part, content in first if part == "at"][-1]
    modes = st.modes(case, mu=0.3, max_frequency_hz=40e3, check=False)
    order = modes.order(0)
    own, wanted_numbers = ([m["branch"] for m in at["modes"]], [int(modes.branch[b]) for b in order])
    assert sorted(own) == sorted(wanted_numbers)
    # Of two modes that all but met on the way, which is which depends on the steps that were taken.
    assert all(abs(a - b) <= 2 for a, b in zip(own, wanted_numbers, strict=True))
    assert sum(a != b for a, b in zip(own, wanted_numbers, strict=True)) <= 2 * len(st.onsets(case))
    assert [m["frequency_hz"] for m in at["modes"]] == pytest.approx([float(modes.frequency_hz[0, b]) for b in order], rel=1e-7)
    said = at["said"]
    assert said.startswith("Reduced model over μ and contact stiffness: ")
    assert float(said.partition("≤ ")[2].partition(",")[0]) <= 1e-8
    onsets = next(content for part, content in first if part == "onsets")
    wanted = st.onsets(case)
    assert [o["mu"] for o in onsets["onsets"]] == pytest.approx([o.mu for o in wanted], rel=1e-7)
    assert all(o["residual"] < 1e-9 for o in onsets["onsets"])  # solved in the full problem


def test_it_is_made_once_and_the_stiffness_moves_on_it(answered: Callable[[PageState], list[tuple[str, Any]]]):
    answered(STATE)
    moved = STATE.with_change(STIFF, 3e9)
    again = answered(replace(moved, mu=0.25))
    assert not any(part == "progress" for part, _ in again)
    # A few points of the curves come first, with the modes as they have them; all points when nothing moves.
    drawn = [part for part, _ in again if part in ("locus", "at", "idle")]
    assert drawn == ["locus", "at", "idle", "at", "at", "locus", "at"]
    quick, exact, *_ = ([m["frequency_hz"] for m in c["modes"]] for p, c in again if p == "at")
    assert quick == pytest.approx(exact, rel=1e-4)
    assert "being estimated" in again[0][1]["said"]
    assert all("estimated error of λ ≤" in [c for p, c in again if p == part][-1]["said"] for part in ("locus", "at"))
    case = moved.case()
    at = [content for part, content in again if part == "at"][-1]
    modes = st.modes(case, mu=0.25, max_frequency_hz=40e3, check=False)
    assert [m["growth_rate"] for m in at["modes"]] == pytest.approx([float(modes.growth_rate[0, b]) for b in modes.order(0)], rel=1e-4, abs=1e-3)


def test_moves_of_friction_take_what_the_curves_span_and_nothing_else_does(monkeypatch: pytest.MonkeyPatch):
    made = Reduced.made(STATE, lambda _: None)
    for _ in made.sweep(STATE):
        pass
    states = [replace(STATE, mu=mu) for mu in (0.017, 0.2, 0.3, 0.433)]
    whole = [made.here(state) for state in states]
    made.prepare()
    assert made._line is None  # of so small a model the curves need all but a few unknowns
    monkeypatch.setattr(restricted, "WORTH", 1.0)
    made.prepare()
    line = made._line
    assert line is not None
    assert line.restricted.model.size < made.model.size
    for state, (wanted, error) in zip(states, whole, strict=True):
        assert line.modes(made._point(state)) is not None
        found, estimated = made.here(state)
        assert found.branch.tolist() == wanted.branch.tolist()
        assert np.abs(found.eigenvalues - wanted.eigenvalues).max() <= 1e-10 * np.abs(wanted.eigenvalues).max()
        assert 1 / 3 <= estimated() / error() <= 3  # what is left out is in it: half as much again as on the whole basis
    off = replace(STATE.with_change(STIFF, 3e9), mu=0.25)
    assert line.modes(made._point(off)) is None  # the curves were those of another stiffness
    assert line.modes({**made._point(STATE), "mu": 1e3}) is None  # beyond them
    fewer = replace(line, numbered=[replace(one, modes=_without_last(one.modes)) for one in line.numbered])
    assert fewer.modes(made._point(STATE)) is None  # a mode that none of them has


def _without_last(modes: ReducedModes) -> ReducedModes:
    return replace(modes, values=modes.values[:-1], right=modes.right[:, :-1], left=modes.left[:, :-1])


def test_a_mode_of_it_moves_all_of_the_model(answered: Callable[[PageState], list[tuple[str, Any]]]):
    found = answered(replace(STATE, branch=8))
    shapes = [content for part, content in found if part == "shape"]
    assert shapes[0]["contacts"]["why"] == "being computed"
    shape = shapes[-1]
    assert sum(b["share"] for b in shape["bodies"]) == pytest.approx(1.0)
    fed = shape["contacts"]["each"][0]["per_cycle"] + shape["contacts"]["damping"]
    assert fed == pytest.approx(2 * shape["growth_rate"] / shape["frequency_hz"], rel=1e-3)


def test_curves_come_coarse_first_and_then_whole(answered: Callable[[PageState], list[tuple[str, Any]]]):
    answered(STATE)
    drawn = [content for part, content in answered(STATE.with_change(STIFF, 7e9)) if part == "locus"]
    few, all_ = (len(content["mu"]) for content in drawn)
    assert 2 * few < all_
    assert set(drawn[0]["mu"]) < set(drawn[1]["mu"])
    assert STATE.mu in drawn[0]["mu"]


def test_the_first_curves_are_quick_and_say_how_near_they_are():
    made = Reduced.made(STATE, lambda _: None)
    assert made.quick is not None
    assert made.quick.model.size <= 0.8 * made.model.size
    for state in (STATE, STATE.with_change(STIFF, 4e9)):
        (few, told), (every, exact) = made.sweep(state)
        rows = [every.mu.tolist().index(mu) for mu in few.mu.tolist()]
        assert few.branch.tolist() == every.branch.tolist()
        wanted = every.eigenvalues[rows]
        off = np.nanmax(np.abs(few.eigenvalues - wanted) / np.abs(wanted))
        assert exact() < 1e-7 < off < 1e-4  # another model, not seen in a picture
        assert off <= 3 * told()


def test_sensitivities_are_those_of_the_full_model_once_they_are_asked_for(
    answered: Callable[[PageState], list[tuple[str, Any]]], tmp_path: Path
):
    state = replace(STATE, branch=8)
    found = answered(state)
    offered = [content for part, content in found if part == "tornado"]
    assert [(o["branch"], o["mu"], o["bars"]) for o in offered] == [(8, 0.3, [])]  # nothing is computed silently
    assert 0.1 < offered[0]["seconds"] < 600
    shape = next(content for part, content in found if part == "shape")
    value = (shape["growth_rate"], 2 * math.pi * shape["frequency_hz"])
    options = {"mu": 0.3, "branch": 8, "eigenvalue": value}
    heard: queue.Queue[tuple[str, Any]] = queue.Queue()
    run = Run(Wish(state.case().to_toml(), 0.3, str(tmp_path), "sensitivities", options=options), lambda *said: heard.put(said), Queue(1))
    said = [heard.get(timeout=120)]
    while said[-1][0] not in ENDS:
        said.append(heard.get(timeout=120))
    run.end()
    assert said[-1][0] == "done"
    assert any(part == "log" for part, _ in said)
    tornado = next(content for part, content in said if part == "tornado")
    modes = st.modes(state.case(), mu=0.3, max_frequency_hz=40e3)
    own = int(modes.branch[np.nanargmin(np.abs(modes.eigenvalues[0] - complex(*value)))])
    wanted = st.sensitivities(state.case(), ["mu"], mu=0.3, modes=[own], max_frequency_hz=40e3)
    bars = {bar["path"]: bar["growth"] for bar in tornado["bars"]}
    assert bars["mu"] == pytest.approx(float(wanted.growth_per_percent[0, 0]), rel=1e-6)
    assert tornado["branch"] == 8  # as the page numbers it


def test_a_mode_that_is_not_there_has_no_sensitivities():
    work = Workspace(STATE.case())
    assert tornado_at(work, 0.3, 4, complex(0.0, 2 * math.pi * 1000.0))["warnings"] == [
        "no mode of the full problem lies at 1000.0 Hz: choose it again"
    ]


def test_where_there_is_none_that_is_said(monkeypatch: pytest.MonkeyPatch):
    def none(*_: object) -> None:
        raise st.AnalysisError("friction jams")

    monkeypatch.setattr(bench_module.Reduced, "made", none)
    found: dict[str, Any] = {}
    Bench()(replace(STATE, branch=8), lambda part, content: found.__setitem__(part, content))
    assert found["tornado"]["bars"] == []
    assert found["tornado"]["seconds"] > 0  # here, too, they wait to be asked for
    assert found["model"]["why"] == "No reduced model (friction jams): every answer takes its time."
    assert found["at"]["checked"]
