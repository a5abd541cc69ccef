"""Bounds of what elements are made from: nodes at the ends of a beam, materials and cells that cannot be."""

from __future__ import annotations

import numpy as np
import pytest

from stridor.errors import CaseError
from stridor.fe.beam import BeamElement, BeamMesh
from stridor.fe.solid import assemble_solid
from stridor.laws.elasticity import Material
from stridor.mesh.model import Mesh


def test_a_beam_has_nodes_from_its_start_to_its_end_and_none_beyond() -> None:
    mesh = BeamMesh((0.0, 0.0), 4, BeamElement(0.25, 1.0, 1.0, 1.0, (1.0, 0.0)))
    assert [mesh.node_at(0.25 * k) for k in range(-1, 6)] == [None, 0, 1, 2, 3, 4, None]
    assert mesh.node_at(0.3) is None
    assert mesh.node_at(0.25 * (1 + 9e-7)) == 1
    assert mesh.node_at(0.25 * (1 + 2e-6)) is None


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
