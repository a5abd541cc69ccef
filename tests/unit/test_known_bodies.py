"""What like cases have in common is built once; what differs is built anew."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest

from solid_cases import case
from stridor.system import System, build_system, supports
from stridor.system.bodies import KnownBodies

STACK = """
[bodies.block]
type = "solid"
material = "steel"
model = "plane stress"
mesh = { shape = "rectangle", corner = [0.0, 0.0], size = [0.1, 0.02], divisions = [6, 2] }
[bodies.layer]
type = "solid"
material = "rubber"
model = "plane stress"
mesh = { shape = "rectangle", corner = [0.0, 0.02], size = [0.1, 0.01], divisions = [9, 1] }
[materials.steel]
young_modulus = 2.1e11
poisson_ratio = 0.3
density = 7800.0
[materials.rubber]
young_modulus = 1.0e9
poisson_ratio = 0.3
density = 1200.0
[ties.glued]
slave = "layer.bottom"
master = "block.top"
[supports.ground]
at = "block.bottom"
fixed = ["x", "y"]
[loads.push]
at = "layer.top"
pressure = 1e5
"""


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Grows with each tie made."""
    calls: list[str] = []
    plain = supports.tie_weights

    def counted(*args, **more):
        calls.append(more["where"])
        return plain(*args, **more)

    monkeypatch.setattr(supports, "tie_weights", counted)
    return calls


def same(one: System, other: System) -> bool:
    pairs = [(getattr(one, kind), getattr(other, kind)) for kind in ("mass", "damping", "stiffness")]
    return all(a.shape == b.shape and not (a - b).count_nonzero() for a, b in pairs)


@pytest.mark.parametrize(
    ("changes", "again"),
    [
        ({"materials.rubber.young_modulus": 2e9}, 0),
        ({"bodies.layer.damping.mass": 3.0}, 0),
        ({"loads.push.pressure": 2e5}, 0),
        ({"ties.glued.tolerance": 1e-3}, 1),
        ({"supports.ground.fixed": ["y"]}, 1),
        ({"bodies.layer.mesh.divisions": [7, 1]}, 1),
        ({"bodies.block.mesh.divisions": [5, 2]}, 1),
    ],
)
def test_ties_are_made_anew_where_something_of_theirs_differs(changes: dict, again: int, made: list[str]) -> None:
    known, plain = KnownBodies(), case(STACK)
    first = build_system(plain, known=known)
    del made[:]
    varied = build_system(plain.with_(changes), known=known)
    assert len(made) == again
    assert same(varied, build_system(plain.with_(changes)))
    assert same(build_system(plain, known=known), first)


def test_a_mesh_of_a_file_is_known_until_the_file_changes(tmp_path: Path) -> None:
    def write(length: float) -> None:
        points = np.array([[0, 0], [length, 0], [length, 0.02], [0, 0.02]], dtype=float)
        meshio.write(tmp_path / "block.vtk", meshio.Mesh(points, {"quad": np.array([[0, 1, 2, 3]])}), binary=False)

    write(0.1)
    text = f"""
[bodies.block]
type = "solid"
material = "steel"
model = "plane stress"
file = "{tmp_path / "block.vtk"}"
[materials.steel]
young_modulus = 2.1e11
poisson_ratio = 0.3
density = 7800.0
"""
    known, plain = KnownBodies(), case(text)
    softer = plain.with_({"materials.steel.young_modulus": 1e11})
    first = build_system(plain, known=known)
    body = plain.bodies["block"]
    mesh = known.mesh("block", body)
    assert mesh is not None
    assert known.mesh("block", softer.bodies["block"]) is mesh
    assert same(build_system(softer, known=known), build_system(softer))
    write(0.2)
    assert known.mesh("block", body) is None
    assert not same(build_system(plain, known=known), first)
    assert same(build_system(plain, known=known), build_system(plain))
