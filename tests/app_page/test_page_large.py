"""Large models on the page: a certified reduced model, whose answers are those of the full one as far as it says."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

import stridor as st
from stridor.app.page import bench as bench_module
from stridor.app.page.bench import Bench
from stridor.app.page.state import Source, State, first_state
from stridor.case import template_text

FINE = template_text("two-beams").replace("elements = 90", "elements = 180").replace("stiffness = 1e-8", "stiffness = 1e-9")
STATE = replace(first_state(Source("fine.toml", FINE)), mu=0.3)
STIFF = "contacts.A.stiffness"


@pytest.fixture(scope="module")
def answered() -> Callable[[State], list[tuple[str, Any]]]:
    bench = Bench()

    def answer(state: State) -> list[tuple[str, Any]]:
        found: list[tuple[str, Any]] = []
        bench(state, lambda part, content: found.append((part, json.loads(json.dumps(content, allow_nan=False)))))
        return found

    return answer


def test_what_it_answers_is_the_full_model_and_it_says_how_near(answered: Callable[[State], list[tuple[str, Any]]]):
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


def test_it_is_made_once_and_the_stiffness_moves_on_it(answered: Callable[[State], list[tuple[str, Any]]]):
    answered(STATE)
    moved = STATE.with_change(STIFF, 3e9)
    again = answered(replace(moved, mu=0.25))
    assert not any(part == "progress" for part, _ in again)
    assert again[0][0] == "at"  # the modes come first, the curves when nothing moves
    case = moved.case()
    at = [content for part, content in again if part == "at"][-1]
    modes = st.modes(case, mu=0.25, max_frequency_hz=40e3, check=False)
    assert [m["growth_rate"] for m in at["modes"]] == pytest.approx([float(modes.growth_rate[0, b]) for b in modes.order(0)], rel=1e-4, abs=1e-3)


def test_a_mode_of_it_moves_all_of_the_model(answered: Callable[[State], list[tuple[str, Any]]]):
    found = answered(replace(STATE, branch=8))
    shapes = [content for part, content in found if part == "shape"]
    assert shapes[0]["contacts"]["why"] == "being computed"
    shape = shapes[-1]
    assert sum(b["share"] for b in shape["bodies"]) == pytest.approx(1.0)
    fed = shape["contacts"]["each"][0]["per_cycle"] + shape["contacts"]["damping"]
    assert fed == pytest.approx(2 * shape["growth_rate"] / shape["frequency_hz"], rel=1e-3)


def test_where_there_is_none_that_is_said(monkeypatch: pytest.MonkeyPatch):
    def none(*_: object) -> None:
        raise st.AnalysisError("friction jams")

    monkeypatch.setattr(bench_module.Reduced, "made", none)
    found: dict[str, Any] = {}
    Bench()(STATE, lambda part, content: found.__setitem__(part, content))
    assert found["model"]["why"] == "No reduced model (friction jams): every answer takes its time."
    assert found["at"]["checked"]
