"""Rigid contacts whose forces no equation tells: named, with whatever else holds their nodes."""

from __future__ import annotations

import numpy as np
import pytest

import stridor as st
from stridor.case import Case, loads, template_text
from stridor.errors import AnalysisError, CaseError
from stridor.sliding import solution

MASS = """
[bodies.m]
type = "mass"
mass = 1.0
position = [0.0, 0.0]
[springs.k]
between = ["m", "ground"]
direction = [1.0, 0.0]
stiffness = 10.0
[loads.w]
at = "m"
force = [0.0, -1.0]
"""


def flats(*normals: tuple[float, float], stiffness: str = '"rigid"') -> str:
    """A mass on several rigid flats through the same point, each moving along itself."""
    text = MASS
    for k, (x, y) in enumerate(normals):
        text += f"""
[bodies.flat{k}]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [{x}, {y}]
sliding = {{ velocity = [{y}, {-x}] }}
[contacts.c{k}]
slave = "m"
master = "flat{k}"
stiffness = {stiffness if k == 0 else '"rigid"'}
friction = {{ law = "coulomb", coefficient = 0.1 }}
"""
    return text


TWICE = "steady sliding: rigid contact presses on the same freedoms twice: "
TAIL = (
    ", so that their forces cannot be told apart; give one of these contacts a stiffness, or remove it or a support"
)


@pytest.mark.parametrize(
    ("normals", "said"),
    [
        ([(0.0, 1.0), (0.0, 1.0)], "1 of the 2 conditions of rigid contact follows from the others (contacts.c0, contacts.c1)"),
        (
            [(0.0, 1.0)] * 3,
            "2 of the 3 conditions of rigid contact follow from the others (contacts.c0, contacts.c1, contacts.c2)",
        ),
        # Three directions in the plane: no two are alike, and still one of them follows.
        (
            [(0.0, 1.0), (0.6, 0.8), (-0.6, 0.8)],
            "1 of the 3 conditions of rigid contact follows from the others (contacts.c0, contacts.c1, contacts.c2)",
        ),
    ],
)  # fmt: skip
def test_a_mass_on_more_flats_than_it_has_freedoms(normals: list[tuple[float, float]], said: str) -> None:
    case = loads(flats(*normals))
    calls = ((st.steady_sliding, ""), (lambda c: st.modes(c, 0.1), "; that is at μ = 0.1"))
    for call, where in calls:
        with pytest.raises(AnalysisError) as caught:
            call(case)
        assert str(caught.value) == TWICE + said + TAIL + where


def test_without_a_load() -> None:
    """All contacts count as touching then, and no steady sliding is solved that would tell."""
    friction = {"law": "coulomb", "coefficient": 0.5}
    normal = [-1.0, 1.0, 0.0]
    contacts = {
        "A": {"normal": normal, "tangent": [0, 1, 0], "stiffness": "rigid", "friction": friction, "slip": -1.0},
        "B": {"normal": normal, "tangent": [0, 0, 1], "stiffness": "rigid", "friction": friction, "slip": 1.0},
    }
    system = st.System.from_matrices(np.eye(3), None, 4 * np.eye(3), contacts=contacts)
    said = TWICE + "1 of the 2 conditions of rigid contact follows from the others (contacts.A, contacts.B)" + TAIL
    for source in ("receptance", "krylov", "full"):
        bench = st.Workspace(system, modal={"source": source, "max_frequency_hz": 10.0})
        for call in (
            lambda w: st.modes(w, 0.5, max_frequency_hz=10.0),
            lambda w: st.modes(w, [0.0, 0.5], max_frequency_hz=10.0),
            lambda w: st.onsets(w, (0.0, 0.5), max_frequency_hz=10.0),
        ):
            with pytest.raises(AnalysisError) as caught:
                call(bench)
            assert str(caught.value) == said


def test_as_many_as_it_has_freedoms_are_told_apart() -> None:
    """In a corner, forces follow from equilibrium: two of (±0.6, 0.8) hold 1 N with 1/1.6 N each."""
    found = st.steady_sliding(loads(flats((0.6, 0.8), (-0.6, 0.8))), mu=0.0)
    assert found.normal_force == pytest.approx([0.625, 0.625], rel=1e-12)
    soft = st.steady_sliding(loads(flats((0.0, 1.0), (0.0, 1.0), stiffness="1e6")), mu=0.0)
    assert soft.normal_force.sum() == pytest.approx(1.0, rel=1e-9)


def bench() -> Case:
    """The published bench with rigid contact and the lower beam held under it."""
    return loads(template_text("two-beams")).with_(
        {
            "contacts.A.stiffness": "rigid",
            "supports.under": {"at": "beam2@0.1", "fixed": ["y"]},
            "bodies.beam2.elements": 9,
            "bodies.beam1.elements": 5,
            "reference": None,
            "temporal.watch": [],
        }
    )


def test_supports_that_take_the_freedoms_are_named() -> None:
    third = {
        "bodies.beam3": {
            "type": "beam", "material": "steel", "start": [0.0, 0.0], "angle_deg": 0.0, "length": 0.15, "width": 0.015,
            "thickness": 0.003, "elements": 9,
        },
        "supports.third": {"at": "beam3.start", "fixed": ["x", "y", "rotation"], "velocity": {"x": 0.02}},
        "supports.below": {"at": "beam3@0.1", "fixed": ["y"]},
        "contacts.B": {
            "slave": "beam1.tip", "master": "beam3", "stiffness": "rigid", "side": "left",
            "friction": {"law": "coulomb", "coefficient": 0.1},
        },
    }  # fmt: skip
    case = bench().with_(third)
    for call in (st.steady_sliding, lambda c: st.modes(c, 0.1)):
        with pytest.raises(AnalysisError) as caught:
            call(case)
        who = "contacts.A, contacts.B, supports.under, supports.below"
        assert str(caught.value) == f"{TWICE}1 of the 2 conditions of rigid contact follows from the others ({who}){TAIL}"


def test_they_are_named_where_rounding_keeps_the_touching_nodes_from_settling(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a solver makes of a singular matrix is rounding, which differs between libraries."""

    def unsettled(*_: object, **__: object) -> None:
        raise AnalysisError("steady sliding: the set of touching nodes does not settle")

    monkeypatch.setattr(solution, "find_touching", unsettled)
    monkeypatch.setattr(solution, "of_every_set", lambda equations: iter(()))
    for normals, said in (([(0.0, 1.0)] * 2, TWICE), ([(0.0, 1.0)], "steady sliding: the set of touching nodes")):
        with pytest.raises(AnalysisError, match=f"^{said}"):
            st.steady_sliding(loads(flats(*normals)))


def test_a_contact_that_cannot_move_along_its_normal_is_refused() -> None:
    """Held on both sides, its force would be rounding over rounding: 6e17 N on this bench."""
    held = bench().with_({"supports.over": {"at": "beam1.tip", "fixed": ["y"]}})
    for call in (st.steady_sliding, st.describe, st.simulate):
        with pytest.raises(CaseError) as caught:
            call(held)
        assert str(caught.value) == (
            "contacts.A: rigid, and its bodies are held along its normal (supports.under, supports.over), so that it can "
            "neither open nor press; free one of them along the normal, or remove the contact"
        )
    # With a stiffness it has no force, and no effect.
    assert st.build_system(held.with_({"contacts.A.stiffness": 1e10})).size > 0


def test_ties_that_lead_the_nodes_are_named() -> None:
    layer = """
[materials.s]
young_modulus = 2e11
density = 7800.0
"""
    for name, y in (("low", 0.0), ("high", 0.01)):
        layer += f"""
[bodies.{name}]
type = "solid"
model = "plane stress"
material = "s"
thickness = 0.01
mesh = {{ shape = "rectangle", corner = [0.0, {y}], size = [0.02, 0.01], divisions = [2, 1], cells = "quad" }}
points = {{ p = [0.01, 0.01] }}
"""
    layer += """
[ties.glue]
slave = "high.bottom"
master = "low.top"
[supports.ground]
at = "low.bottom"
fixed = ["x", "y"]
velocity = { x = 0.1 }
"""
    for k in range(2):
        layer += f"""
[bodies.flat{k}]
type = "obstacle"
shape = "flat"
point = [0.0, 0.01]
normal = [0.0, 1.0]
sliding = {{ velocity = [0.2, 0.0] }}
[contacts.c{k}]
slave = "{("high.p", "low.p")[k]}"
master = "flat{k}"
stiffness = "rigid"
friction = {{ law = "coulomb", coefficient = 0.1 }}
"""
    layer = layer.replace('[ties.glue]', '[loads.press]\nat = "high.top"\npressure = 1e6\n[ties.glue]')
    with pytest.raises(AnalysisError, match=r"1 of the 2 .* \(contacts\.c0, contacts\.c1, ties\.glue\)"):
        st.steady_sliding(loads(layer))
