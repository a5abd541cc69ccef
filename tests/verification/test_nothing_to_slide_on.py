"""A block on a rail that nothing presses, or that nothing moves along: every command says the same, and none an answer."""

from __future__ import annotations

from pathlib import Path

import pytest

from program import stridor

pytestmark = pytest.mark.verification

CASE = """
[materials.steel]
young_modulus = 200e9
density = 7800.0
poisson_ratio = 0.3
[bodies.up]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.01
mass = "lumped"
mesh = { divisions = [3, 2], shape = "rectangle", corner = [0.02, 0.01], size = [0.03, 0.02], cells = "quad" }
damping = { mass = 20.0, stiffness = 1e-8 }
[bodies.rail]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.01
mass = "lumped"
mesh = { divisions = [7, 2], shape = "rectangle", corner = [0.0, 0.0], size = [0.08, 0.01], cells = "quad" }
damping = { mass = 20.0, stiffness = 1e-8 }
[supports.base]
at = "rail.bottom"
fixed = ["x", "y"]
VELOCITY
[supports.guide]
at = "up.left"
fixed = ["x"]
[loads.press]
at = "up.top"
PRESSURE
[contacts.c]
slave = "up.bottom"
master = "rail.top"
stiffness = 1e13
friction = { law = "coulomb", coefficient = 0.3 }
[modal]
friction_range = [0.0, 1.0]
max_frequency_hz = 60e3
"""


def written(folder: Path, *, velocity: str = "", pressure: str = "") -> None:
    (folder / "case.toml").write_text(CASE.replace("VELOCITY", velocity).replace("PRESSURE", pressure))


@pytest.mark.parametrize("command", ["steady", "modes"])
def test_a_load_of_nothing_presses_nothing(tmp_path: Path, command: str) -> None:
    """Damping drags at the moving rail, and rounding of that left 4e-19 N at one node."""
    written(tmp_path, velocity="velocity = { x = 0.5 }")
    said = stridor(command, "case.toml", cwd=tmp_path)
    assert said.returncode == 1
    assert "no contact carries load" in " ".join(said.stderr.split())


@pytest.mark.parametrize("pressure", [1e-6, 1e6])
def test_a_small_load_presses_as_a_large_one_does(tmp_path: Path, pressure: float) -> None:
    """A force of 3e-10 N is no rounding of a drag of a newton: it holds up the block, on however few nodes."""
    written(tmp_path, velocity="velocity = { x = 0.5 }", pressure=f"pressure = {pressure}")
    said = stridor("steady", "case.toml", cwd=tmp_path)
    assert said.returncode == 0
    assert f", {pressure * 0.03 * 0.01:.3g} " in " ".join(said.stdout.split())


@pytest.mark.parametrize("command", ["steady", "modes", "onsets"])
def test_a_support_without_velocity_is_what_is_named(tmp_path: Path, command: str) -> None:
    written(tmp_path, pressure="pressure = 1e6")
    said = stridor(command, "case.toml", cwd=tmp_path)
    assert said.returncode == 1
    told = " ".join(said.stderr.split())
    assert told.endswith("give a support a velocity")
    assert "contact c does not slide" in told
    assert "that is at" not in told
    assert "--range" not in told
