"""What like cases have in common is built once; what differs is built anew."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest

from solid_cases import bench_as_solids, case
from stridor.system import System, build_system, supports
from stridor.system.bodies import KnownBodies

BENCH = bench_as_solids(across=(1, 1), along=(6, 12))  # a pin tied to its guide, on a beam


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
        ({"materials.stiff.young_modulus": 1e13}, 0),
        ({"bodies.guide.damping.mass": 3.0}, 0),
        ({"loads.press.force": [0.0, -30.0]}, 0),
        ({"contacts.A.stiffness": 2e10}, 0),
        ({"ties.top.tolerance": 1e-4}, 1),
        ({"supports.side1.fixed": ["x", "y"]}, 1),
        ({"bodies.pin.mesh.divisions": [5, 1]}, 1),
        ({"bodies.guide.mesh.divisions": [1, 1]}, 1),
    ],
)
def test_ties_are_made_anew_where_something_of_theirs_differs(changes: dict, again: int, made: list[str]) -> None:
    known, plain = KnownBodies(), case(BENCH)
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
