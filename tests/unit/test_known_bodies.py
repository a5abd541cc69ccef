"""What like cases have in common is built once; what differs is built anew."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import meshio
import numpy as np
import pytest
import scipy.sparse as sp

from solid_cases import bench_as_solids, case
from stridor.system import System, build_system, pairs, supports
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
    """Matrices and all that is known of contact nodes, to the last digit."""
    pairs = [(getattr(one, kind), getattr(other, kind)) for kind in ("mass", "damping", "stiffness")]
    alike = all(a.shape == b.shape and not (a - b).count_nonzero() for a, b in pairs)
    return alike and all(_alike(one.contact_nodes(), other.contact_nodes()))


def _alike(one: object, other: object) -> Iterator[bool]:
    for field in fields(one):  # type: ignore[arg-type]
        a, b = getattr(one, field.name), getattr(other, field.name)
        if sp.issparse(a):
            yield a.shape == b.shape and not (a - b).count_nonzero()
        elif isinstance(a, np.ndarray):
            yield np.array_equal(a, b, equal_nan=a.dtype.kind == "f")


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


@pytest.mark.parametrize(
    ("changes", "again"),
    [
        ({"materials.stiff.young_modulus": 1e13}, 0),
        ({"bodies.guide.damping.mass": 3.0}, 0),
        ({"loads.press.force": [0.0, -30.0]}, 0),
        ({"contacts.A.stiffness": 2e10}, 1),
        ({"contacts.A.friction.coefficient": 0.21}, 1),
        ({"contacts.A.interference": 1e-6}, 1),
        ({"supports.side1.fixed": ["x", "y"]}, 1),
        ({"bodies.pin.thickness": 0.02}, 1),
        ({"bodies.pin.mesh.divisions": [5, 1]}, 1),
        ({"bodies.guide.mesh.divisions": [1, 1]}, 1),
    ],
)
def test_surfaces_are_paired_anew_where_something_of_theirs_differs(
    changes: dict, again: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = case(BENCH)
    paired: list[str] = []
    pair = pairs.pair_surface
    monkeypatch.setattr(pairs, "pair_surface", lambda name, **more: paired.append(name) or pair(name, **more))
    known = KnownBodies()
    first = build_system(plain, known=known)
    assert paired
    del paired[:]
    varied = build_system(plain.with_(changes), known=known)
    assert len(paired) == again
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
