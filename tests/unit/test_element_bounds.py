"""Bounds of what elements are made from: nodes at the ends of a beam, materials and cells that cannot be."""

from __future__ import annotations

import numpy as np
import pytest

from stridor.errors import CaseError
from stridor.fe.beam import BeamElement, BeamMesh
from stridor.fe.elements import _order
from stridor.fe.solid import assemble_solid
from stridor.laws.elasticity import Material
from stridor.mesh.model import Mesh


def test_a_beam_has_nodes_from_its_start_to_its_end_and_none_beyond() -> None:
    mesh = BeamMesh((0.0, 0.0), 4, BeamElement(0.25, 1.0, 1.0, 1.0, (1.0, 0.0)))
    assert [mesh.node_at(0.25 * k) for k in range(-1, 6)] == [None, 0, 1, 2, 3, 4, None]
    assert mesh.node_at(0.3) is None
    assert mesh.node_at(0.25 * (1 + 9e-7)) == 1
    assert mesh.node_at(0.25 * (1 + 2e-6)) is None


def test_between_its_nodes_a_beam_bends_as_a_cubic_and_beyond_its_ends_it_has_no_more() -> None:
    """u = 1 + x/2 along the axis and w = x³ − 2x² + 3x across it, of a beam that leans by 3:4, are met everywhere."""
    mesh = BeamMesh((5.0, -1.0), 4, BeamElement(0.25, 1.0, 1.0, 1.0, (0.8, 0.6)))
    assert mesh.length == 1.0
    x = 0.25 * np.arange(5)

    def motion(x):
        u, w, turn = 1 + x / 2, x**3 - 2 * x**2 + 3 * x, 3 * x**2 - 4 * x + 3
        return np.array([0.8 * u - 0.6 * w, 0.6 * u + 0.8 * w, turn])

    nodal = np.array([motion(at) for at in x])
    assert mesh.coordinates() == pytest.approx(np.array([5.0, -1.0]) + x[:, None] * [0.8, 0.6])
    for at in (0.0, 0.1, 0.25, 0.49, 0.5 + 1e-11, 0.75 - 1e-11, 0.9, 1.0, -0.1, 1.1):
        freedoms, rows = mesh.interpolation(at)
        inside = min(max(at, 0.0), 1.0)
        element = int(freedoms[0]) // 3
        assert freedoms.tolist() == list(range(3 * element, 3 * element + 6))
        assert 0.25 * element <= inside + 1e-9 <= 0.25 * (element + 1) + 2e-9
        assert rows @ nodal.ravel()[freedoms] == pytest.approx(motion(inside), rel=1e-9)
    # Within rounding of a node it is that node alone.
    for at in (0.5 + 1e-11, 0.5 - 1e-11):
        freedoms, rows = mesh.interpolation(at)
        assert sorted(freedoms[np.abs(rows).sum(axis=0) > 0]) == [6, 7, 8]


@pytest.mark.parametrize(
    ("changes", "model", "said"),
    [
        ({}, "3d", "2 coordinates a point' – model '3d' needs 3"),
        ({"cells": {}}, "plane stress", "no cells' – model 'plane stress' needs some of: "),
        ({"cells": {"tetra": np.zeros((1, 4), dtype=int)}}, "plane strain", "cells tetra' – model 'plane strain' takes: "),
        ({"cells": {"quad": np.zeros((1, 3), dtype=int)}}, "plane stress", "an array of shape (1, 3)' – cells quad have 4 nodes each"),
        ({"cells": {"quad": np.array([[0, 1, 2, 4]])}}, "plane stress", "cells quad with nodes 0 to 4' – the mesh has nodes 0 to 3"),
        ({"cells": {"quad": np.array([[-1, 1, 2, 3]])}}, "plane stress", "cells quad with nodes -1 to 3' – the mesh has nodes 0 to 3"),
        ({"points": np.array([[0.0, 0], [1, 0], [1, np.nan], [0, 1]])}, "plane stress", "every coordinate must be a finite number"),
        ({}, "shell", "no such model; there are: "),
    ],
)
def test_meshes_that_do_not_fit_are_refused_with_what_does(changes, model: str, said: str) -> None:
    plain = square(1.0)
    mesh = Mesh(**({"points": plain.points, "cells": plain.cells} | changes))
    with pytest.raises(CaseError) as caught:
        assemble_solid(mesh, Material(1.0, 1.0), model=model)  # type: ignore[arg-type]
    assert said in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_nodes_are_found_among_those_of_the_library_or_it_is_said() -> None:
    own = np.array([[0.0, 0], [1, 0], [0, 1]])
    assert list(_order(own, own[[2, 0, 1]] + 0.9e-9)) == [1, 2, 0]
    moved, twice = own + np.array([[0.0, 0], [0, 1.1e-9], [0, 0]]), own[[0, 1, 1]]
    for given, library in ((own, moved), (own, np.concatenate([own, own[:1] + 5])), (own, own[:2]), (twice, own), (own, twice)):
        with pytest.raises(RuntimeError, match="the finite element library has moved the nodes of its reference element"):
            _order(given, library)


@pytest.mark.parametrize("value", [0.0, -1.0, np.inf, np.nan])
def test_materials_are_positive_numbers(value: float) -> None:
    with pytest.raises(CaseError) as caught:
        assemble_solid(square(1.0), Material(value, value), model="plane stress")
    lines = str(caught.value).splitlines()
    assert sum("must be a positive number" in line for line in lines) == 2
    assert any("material.young_modulus" in line for line in lines)
    assert any("material.density" in line for line in lines)


def square(size: float, **moved: tuple[float, float]) -> Mesh:
    points = size * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    for number, place in moved.items():
        points[int(number[1:])] = size * np.array(place)
    return Mesh(points, {"quad": np.array([[0, 1, 2, 3]])})


@pytest.mark.parametrize(
    ("model", "ratio", "exists"),
    [
        ("plane stress", -1.0, False), ("plane stress", -0.99, True), ("plane stress", -1.5, False),
        ("plane stress", 0.5, True), ("plane stress", 0.51, False), ("plane stress", 1.2, False),
        ("plane strain", -1.0, False), ("plane strain", -0.99, True), ("plane strain", -1.5, False),
        ("plane strain", 0.5, False), ("plane strain", 0.49, True), ("plane strain", 1.2, False),
    ],
)  # fmt: skip
def test_poisson_ratios_that_exist(model, ratio: float, exists: bool) -> None:
    material = Material(young_modulus=1.0, density=1.0, poisson_ratio=ratio)
    if exists:
        values = np.linalg.eigvalsh(assemble_solid(square(1.0), material, model=model).stiffness.toarray())
        assert values.min() > -1e-12 * values.max()
    else:
        with pytest.raises(CaseError, match=r"material\.poisson_ratio"):
            assemble_solid(square(1.0), material, model=model)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize(
    ("corner", "folded"), [((1.0, 1.0), False), ((0.55, 0.55), False), ((0.3, 0.3), True), ((-0.5, 0.5), True)]
)
def test_folded_cells_are_refused_whatever_their_size(size: float, corner: tuple[float, float], folded: bool) -> None:
    material = Material(young_modulus=1.0, density=1.0, poisson_ratio=0.3)
    mesh = square(size, n2=corner)
    if folded:
        with pytest.raises(CaseError, match="is flat or folds over itself"):
            assemble_solid(mesh, material, model="plane stress")
    else:
        assemble_solid(mesh, material, model="plane stress")
