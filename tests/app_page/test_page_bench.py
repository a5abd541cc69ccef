"""What a page's process answers is what the calls of the package give."""

from __future__ import annotations

import gc
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stridor as st
from matrix_cases import matrix_case
from stridor.app.page.bench import Bench
from stridor.app.page.drawing import drawing
from stridor.app.page.mesh_marks import held_nodes, pushes, slides
from stridor.app.page.mode_data import shape_of
from stridor.app.page.state import PageState, Source, first_state
from stridor.case import Case, template_text
from stridor.study.workspace import Workspace
from stridor.system import System, build_system

BEAMS = Source.template("two-beams")


def answered(bench: Bench, state: PageState) -> dict[str, Any]:
    """The newest content of every part, as the browser has it: through JSON."""
    found: dict[str, Any] = {}
    bench(state, lambda part, content: found.__setitem__(part, json.loads(json.dumps(content, allow_nan=False))))
    return found


@pytest.fixture(scope="module")
def bench() -> Bench:
    return Bench()


@pytest.fixture(scope="module")
def state() -> PageState:
    return replace(first_state(BEAMS).with_change("bodies.beam1.angle_deg", 83.0), mu=0.3)


@pytest.fixture(scope="module")
def unstable(state: PageState) -> Any:
    modes = st.modes(state.case(), mu=0.3, max_frequency_hz=40e3, vectors="right")
    return modes, int(modes.branch[np.argmax(modes.growth_rate[0])])


@pytest.fixture(scope="module")
def found(bench: Bench, state: PageState, unstable: Any) -> dict[str, Any]:
    return answered(bench, replace(state, branch=unstable[1]))


def test_onsets_are_those_of_the_package_to_all_digits(found: dict[str, Any], state: PageState):
    wanted = st.onsets(state.case())
    assert found["onsets"]["onsets"] == [json.loads(json.dumps(o.to_json())) for o in wanted]
    assert found["onsets"]["complete"] is wanted.complete is True
    assert found["onsets"]["first"] == {"mu": wanted.first.mu, "frequency_hz": wanted.first.frequency_hz}


def test_modes_at_the_friction_of_the_page_are_checked_ones(found: dict[str, Any], unstable: Any):
    modes, _ = unstable
    assert found["at"]["checked"]
    assert [m["frequency_hz"] for m in found["at"]["modes"]] == pytest.approx([modes.frequency_hz[0, b] for b in modes.order(0)], rel=1e-9)
    assert [m["unstable"] for m in found["at"]["modes"]] == [bool(modes.unstable[0, b]) for b in modes.order(0)]
    assert "Checked" in found["at"]["completeness"]


def test_branches_over_friction_are_those_of_a_sweep(found: dict[str, Any], state: PageState):
    modes = st.modes(state.case(), found["locus"]["mu"], max_frequency_hz=40e3, check=False)
    assert 0.3 in found["locus"]["mu"]
    for column, branch in enumerate(found["locus"]["branches"]):
        assert branch["branch"] == modes.branch[column]
        assert branch["growth_rate"] == pytest.approx(modes.growth_rate[:, column], rel=1e-5)
        assert branch["unstable"] == modes.unstable[:, column].tolist()


def test_the_energy_of_a_mode_is_balanced(found: dict[str, Any], unstable: Any):
    _, branch = unstable
    shape = found["shape"]
    assert shape["branch"] == branch
    assert sum(b["share"] for b in shape["bodies"]) == pytest.approx(1.0)
    fed = sum(c["per_cycle"] for c in shape["contacts"]["each"]) + shape["contacts"]["damping"]
    assert fed == pytest.approx(2 * shape["growth_rate"] / shape["frequency_hz"], rel=1e-3)
    assert shape["contacts"]["each"][0]["per_cycle"] > 0 > shape["contacts"]["damping"]


def test_the_tornado_is_that_of_sensitivities(found: dict[str, Any], state: PageState, unstable: Any):
    _, branch = unstable
    wanted = st.sensitivities(state.case(), ["mu", "materials.steel.density"], mu=0.3, modes=[branch], max_frequency_hz=40e3)
    bars = {bar["path"]: bar for bar in found["tornado"]["bars"]}
    assert bars["mu"]["growth"] == pytest.approx(float(wanted.growth_per_percent[0, 0]))
    assert bars["materials.steel.density"]["frequency_hz"] == pytest.approx(float(wanted.frequency_per_percent_hz[1, 0]))
    sizes = [abs(bar["growth"]) for bar in found["tornado"]["bars"]]
    assert sizes == sorted(sizes, reverse=True)


def test_the_geometry_is_sent_once(bench: Bench, state: PageState, unstable: Any, found: dict[str, Any]):
    assert "geometry" in found["shape"]
    again = answered(bench, replace(state, mu=0.31, branch=unstable[1]))
    assert "geometry" not in again["shape"]
    assert set(again["shape"]["motion"]) == {"real", "imag", "scale", "bent"}
    assert "locus" not in again  # nothing of it has changed
    moved = answered(bench, replace(state, branch=unstable[1]).with_change("bodies.beam1.angle_deg", 82.0))
    assert "geometry" in moved["shape"]


@pytest.mark.slow
def test_twenty_moves_leave_nothing_behind():
    case = st.loads(template_text("two-beams")).with_({
        "bodies.beam1.elements": 6, "bodies.beam2.elements": 12, "modal.max_frequency_hz": 8e3,
    })  # fmt: skip
    first, bench = first_state(Source("coarse", case.to_toml())), Bench()

    def moved(count: int) -> int:
        for k in range(count):
            answered(bench, replace(first, mu=0.01 * k, branch=1 + k % 5).with_change("bodies.beam1.angle_deg", 80.0 + 0.1 * k))
        gc.collect()
        return sum(isinstance(o, Workspace | System | Case) for o in gc.get_objects())

    few = moved(3)
    assert moved(20) <= few


def test_what_the_case_refuses_is_said_and_the_next_is_answered():
    bench = Bench()
    state = first_state(BEAMS)
    refused = answered(bench, state.with_change("bodies.beam1.length", 0.04))
    with pytest.raises(st.CaseError) as caught:
        st.onsets(state.with_change("bodies.beam1.length", 0.04).case())
    assert refused["refused"] == str(caught.value)
    assert "onsets" in answered(bench, state)


def test_where_there_is_no_steady_sliding_that_is_said():
    state = first_state(BEAMS).with_change("loads.press.force.1", 20.0)
    found = answered(Bench(), state)
    with pytest.raises(st.AnalysisError) as caught:
        st.modes(state.case(), check=False)
    assert found["unanswered"] == str(caught.value)


def test_the_drawing_names_what_it_shows():
    case = first_state(BEAMS).case()
    svg = drawing(case, build_system(case))
    for words in ("beam1", "beam2", "20 N", "0.02 m/s", "holds x, y, φ", "50 mm", 'role="img"', "contact A: beam1.tip on beam2"):
        assert words in svg


def test_the_drawing_of_a_model_in_space_shows_what_holds_loads_and_moves_it():
    """Disc and pad: 5e5 Pa on the plate, the disc turns under the lining from 4.5 m/s inside to 6.75 outside."""
    meshes = {"disc": [2, 24, 1], "lining": [2, 6, 1], "plate": [2, 6, 1]}
    case = st.loads(template_text("pad-on-disc"))
    case = case.with_({f"bodies.{name}.mesh.divisions": value for name, value in meshes.items()})
    system = build_system(case)
    (push,) = pushes(system)
    assert push.direction == pytest.approx([0.0, 0.0, -1.0], abs=1e-9)
    (slide,) = slides(system)
    # The disc turns about z: what comes out of the pad moves across the radius.
    assert abs(slide.direction @ slide.at) < 0.5 * np.linalg.norm(slide.at[:2])
    assert slide.words == "4.5 to 6.75 m/s"
    held = held_nodes(system)
    radius = np.hypot(held[:, 0], held[:, 1])
    assert np.any(np.isclose(radius, radius.min()))
    assert len(held) > 20
    svg = drawing(case, system)
    assert svg.count('class="support"') == len(held)
    assert "slides with 4.5 to 6.75 m/s" in svg
    assert ">500000 Pa<" in svg


def test_a_point_mass_beside_a_mesh_is_drawn():
    """Before it no drawing was made of such a model, and no mode of it."""
    mesh = {"shape": "rectangle", "corner": [0, 0], "size": [0.02, 0.01], "divisions": [4, 2]}
    block = {"type": "solid", "model": "plane stress", "material": "s", "thickness": 0.01, "mesh": mesh, "points": {"tip": [0.02, 0.01]}}
    data = {"title": "block", "materials": {"s": {"young_modulus": 2e11, "poisson_ratio": 0.3, "density": 7800.0}},
            "bodies": {"b": block, "w": {"type": "mass", "mass": 0.1, "position": [0.02, 0.03]}},
            "springs": {"s": {"between": ["w", "b.tip"], "stiffness": 1e6},
                        "t": {"between": ["w", "ground"], "stiffness": 1e6, "direction": [1, 0]}},
            "supports": {"wall": {"at": "b.left", "fixed": ["x", "y"]}}}  # fmt: skip
    case = st.Case(**data)
    system = build_system(case)
    svg = drawing(case, system)
    assert svg.count("<circle ") == 1
    assert ">w</text>" in svg
    shape, _ = shape_of(system, st.modes(case, vectors="right"), 0, known="")
    assert "undrawn" not in shape
    assert shape["geometry"]["names"] == ["b", "w"]


def test_a_load_is_drawn_once_with_its_own_number():
    """At a point or on a boundary of a mesh that is held elsewhere; a load on a tied boundary keeps its direction."""
    mesh = {"shape": "rectangle", "corner": [0, 0], "size": [0.02, 0.01], "divisions": [4, 2]}
    block = {"type": "solid", "model": "plane stress", "material": "s", "thickness": 0.01, "mesh": mesh, "points": {"tip": [0.02, 0.01]}}
    data = {"title": "block", "materials": {"s": {"young_modulus": 2e11, "poisson_ratio": 0.3, "density": 7800.0}},
            "bodies": {"b": block}, "supports": {"wall": {"at": "b.left", "fixed": ["x", "y"]}},
            "loads": {"p": {"at": "b.tip", "force": [0, -20]}, "q": {"at": "b.bottom", "force": [0, 60]}}}  # fmt: skip
    case = st.Case(**data)
    svg = drawing(case, build_system(case))
    assert [svg.count(f">{words}<") for words in ("20 N", "60 N")] == [1, 1]


def test_negative_masses_are_told_beside_what_they_make_grow(tmp_path: Path):
    springs, belt = np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([[0.0, -4 / 3], [0.0, 0.0]])
    for mass, words in ((-1.0, "bodies.matrices: 1 freedom has a negative mass"), (1.0, "")):
        terms = [(np.diag([1.0, mass]), "mass", ""), (springs, "stiffness", ""), (belt, "stiffness", "mu")]
        text = matrix_case(tmp_path, terms, 1.0).to_toml()
        told = answered(Bench(), first_state(Source("case", text, str(tmp_path))))["model"]["warnings"]
        assert any(said.startswith(words) for said in told) if words else not any("mass" in said for said in told)
