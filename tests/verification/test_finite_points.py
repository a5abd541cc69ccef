"""Points that slide finitely: where they start in steady sliding, and several of them at once."""

from __future__ import annotations

import numpy as np
import pytest

import stridor as st
from stridor.case.source import template_text
from stridor.errors import AnalysisError

pytestmark = pytest.mark.verification


@pytest.mark.parametrize(("path", "mass"), [("modal", "consistent"), ("nodal", "lumped"), ("assembled", "lumped")])
@pytest.mark.parametrize("mu", [0.05, 0.3])
def test_a_start_in_steady_sliding_rests_on_the_bent_line(path: str, mass: str, mu: float):
    """The load is 20 N, and the contact sinks by 1 mm. On the rows of the undeformed line the first force was
    1e5 N with these steps, and sixteen times that with a quarter of them."""
    case = st.loads(template_text("two-beams")).with_(
        {"contacts.A.sliding": "finite", "temporal.initial": "steady-sliding", "temporal.path": path,
         "temporal.record_every": 1, "phases.press.velocities.clamp": 1.0}
        | {f"bodies.{name}.mass": mass for name in ("beam1", "beam2")}
        | {f"phases.{name}.duration": 2.5e-5 for name in ("press", "slide")}
    )  # fmt: skip
    force = [
        st.simulate(case.with_({"temporal.step": step}), mu).normal_force[:, 0] for step in (2e-8, 5e-9)
    ]
    for found in force:
        assert found == pytest.approx(20.0, abs=0.3)
    assert force[1].max() == pytest.approx(force[0].max(), rel=1e-4)
    assert force[1][0] == pytest.approx(force[0][0], rel=5e-4)
    before = st.simulate(case.with_({"temporal.step": 2e-8, "contacts.A.sliding": "small"}), mu).normal_force[:, 0]
    assert force[0][0] == pytest.approx(before[0], rel=0.01)


@pytest.mark.parametrize("path", ["modal", "nodal"])
def test_a_start_far_from_the_undeformed_line_settles(path: str):
    """The tip is moved down by 10 mm, and friction turns the line far: the solutions, each on the line of the one
    before, come nearer by less than half at first. What starts at rest in equilibrium stays there."""
    case = st.loads(template_text("two-beams")).with_(
        {"contacts.A.sliding": "finite", "temporal.initial": "steady-sliding", "temporal.path": path,
         "temporal.record_every": 1, "phases.press.velocities.clamp": 1.0, "supports.clamp.velocity.x": 1e-7,
         "supports.guide": {"at": "beam1.top", "fixed": ["x", "y", "rotation"], "displacement": {"y": -0.01}}}
        | {f"bodies.{name}.mass": "lumped" for name in ("beam1", "beam2")}
        | {f"phases.{name}.duration": 2e-6 for name in ("press", "slide")}
    )  # fmt: skip
    for step in (2e-8, 5e-9):
        force = st.simulate(case.with_({"temporal.step": step}), 0.8).normal_force[:, 0]
        assert force == pytest.approx(183.80998, abs=1e-3)


@pytest.mark.parametrize("path", ["modal", "nodal"])
def test_a_push_along_the_bent_line_presses_nothing(path: str):
    """Its part along the normal was one force of the first step, which grew as that became smaller."""
    case = st.loads(template_text("two-beams")).with_(
        {"contacts.A.sliding": "finite", "temporal.initial": "steady-sliding", "temporal.path": path,
         "temporal.record_every": 1, "temporal.perturbation": 1e-2, "phases.press.velocities.clamp": 1.0}
        | {f"bodies.{name}.mass": "lumped" for name in ("beam1", "beam2")}
        | {f"phases.{name}.duration": 2e-6 for name in ("press", "slide")}
    )  # fmt: skip
    first = [st.simulate(case.with_({"temporal.step": step}), 0.3).normal_force[0, 0] for step in (2e-8, 2.5e-9)]
    assert first == pytest.approx([20.0, 20.0], abs=0.3)


def test_a_start_beyond_the_end_of_the_line_is_told():
    case = st.loads(template_text("two-beams")).with_(
        {"contacts.A.sliding": "finite", "temporal.initial": "steady-sliding",
         "phases.press.velocities.clamp": 1.0, "supports.clamp.displacement": {"x": -0.0505}}
    )  # fmt: skip
    with pytest.raises(AnalysisError, match="in steady sliding the slave point is beyond an end of the master line; move"):
        st.simulate(case, 0.1)


TWO = """
[materials.al]
young_modulus = 70e9
density = 2700.0
[bodies]
b1 = { type = "beam", material = "al", start = [0.0, 0.0], end = [0.5, 0.0], width = 0.02, thickness = 0.004, elements = 12 }
b2 = { type = "beam", material = "al", start = [0.0, 0.1], end = [0.5, 0.1], width = 0.02, thickness = 0.004, elements = 12 }
m1 = { type = "mass", mass = 0.1, position = [0.1, 0.0], initial_velocity = [3.0, 0.0] }
m2 = { type = "mass", mass = 0.1, position = [0.1, 0.1], initial_velocity = [3.0, 0.0] }
[supports]
c1 = { at = "b1.start", fixed = ["x", "y", "rotation"] }
c2 = { at = "b2.start", fixed = ["x", "y", "rotation"] }
[loads]
w1 = { at = "m1", force = [0.0, -10.0] }
w2 = { at = "m2", force = [0.0, -20.0] }
[contacts.A]
slave = "m1"
master = "b1"
side = "left"
stiffness = "rigid"
sliding = "finite"
friction = { law = "coulomb", coefficient = 0.2 }
[contacts.B]
slave = "m2"
master = "b2"
side = "left"
stiffness = "rigid"
sliding = "finite"
friction = { law = "coulomb", coefficient = 0.2 }
[[phases]]
name = "go"
duration = 0.02
[modal]
max_frequency_hz = 2000.0
"""


def test_two_points_on_beams_of_their_own_take_a_sweep_or_two():
    """What the rounding of coordinates makes of forces is no change of these: every step took 500 sweeps."""
    case = st.loads(TWO)
    found = st.simulate(case)
    assert found.path == "modal"
    assert found.unconverged_steps == 0
    assert found.most_sweeps <= 3
    nodal = st.simulate(case.with_({"temporal.path": "nodal"}))
    assert found.normal_force == pytest.approx(nodal.normal_force, abs=1e-6 * np.abs(nodal.normal_force).max())
    tables = case.model_dump(mode="json", exclude_none=True)
    for kind, names in {"bodies": ("b2", "m2"), "supports": ("c2",), "loads": ("w2",), "contacts": ("B",)}.items():
        for name in names:
            del tables[kind][name]
    alone = st.simulate(st.Case.model_validate(tables))
    assert found.normal_force[:, 0] == pytest.approx(alone.normal_force[:, 0], abs=1e-6 * alone.normal_force.max())
