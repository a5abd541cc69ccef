"""Stability maps as the page makes them: curves that get finer, or a grid that says it is one."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

import stridor as st
from benches import paper_case
from stridor.app.page import mapping

STIFFNESS = "contacts.A.stiffness"
SMALL = {"bodies.beam1.elements": 6, "bodies.beam2.elements": 12, "modal.max_frequency_hz": 20e3}


def maps(x: str, y: str, x_range: tuple[float, float], y_range: tuple[float, float], **changes: Any) -> tuple[list[Any], str]:
    told: list[Any] = []

    def tell(part: str, content: Any) -> None:
        json.dumps(content, allow_nan=False)
        if part == "map":
            told.append(content)

    options = {"x": x, "y": y, "x_range": x_range, "y_range": y_range}
    said = mapping.mapped(tell, st.Workspace(paper_case().with_(SMALL | changes)), options)
    return told, said


@pytest.mark.slow
def test_curves_of_a_map_are_those_of_the_boundary() -> None:
    told, said = maps("mu", STIFFNESS, (0.0, 0.6), (5e9, 2e10))
    assert len(told) == len(mapping.LINES)
    found = st.stability_boundary(
        paper_case().with_(SMALL), "mu", STIFFNESS, x_range=(0.0, 0.6), y_range=(5e9, 2e10), lines=mapping.LINES[-1]
    )
    assert len(told[-1]["curves"]) == len(found.curves) > 0
    assert said.startswith(found.sentence)
    case = paper_case().with_(SMALL)
    last = told[-1]
    for i, j in ((8, 25), (75, 75), (140, 125)):
        mu, stiffness = last["xs"][i], last["ys"][j]
        grows = st.modes(case.with_({STIFFNESS: stiffness}), mu)
        assert last["counts"][i][j] == np.count_nonzero(grows.unstable & grows.in_band)


@pytest.mark.parametrize("turned", [False, True])
def test_a_grid_where_no_curves_can_be_traced(monkeypatch: pytest.MonkeyPatch, turned: bool) -> None:
    monkeypatch.setattr(mapping, "GRIDS", (2, 3))
    numbers = [("mu", (0.0, 0.6)), ("bodies.beam1.angle_deg", (60.0, 100.0))]
    (x, xs), (y, ys) = numbers[::-1] if turned else numbers
    told, said = maps(x, y, xs, ys)
    assert [len(m["xs"]) for m in told] == [2, 3]
    assert said.startswith("A grid of 3 × 3 solves, not checked against anything; what lies between its points is not known. No curves: ")
    assert all(not m["curves"] for m in told)
    case = paper_case().with_(SMALL)
    for i, a in enumerate(told[-1]["xs"]):
        for j, b in enumerate(told[-1]["ys"]):
            mu, angle = (b, a) if turned else (a, b)
            grows = st.modes(case.with_({"bodies.beam1.angle_deg": angle}), mu)
            assert told[-1]["counts"][i][j] == np.count_nonzero(grows.unstable & grows.in_band)


def test_points_without_modes_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mapping, "GRIDS", (2,))

    def none(*_: object, **__: object) -> None:
        raise st.AnalysisError("nothing slides")

    monkeypatch.setattr(mapping, "stability_boundary", none)
    monkeypatch.setattr(mapping, "modes", none)
    told, said = maps("mu", STIFFNESS, (0.0, 0.6), (5e9, 2e10))
    assert told[-1]["counts"] == [[-1, -1], [-1, -1]]
    assert "4 points have no modes: nothing slides." in said
