"""Built-in meshes: sizes by closed forms, boundaries that close the body, nodes where they should be."""

import itertools
import math

import numpy as np
import pytest

from stridor.errors import CaseError
from stridor.mesh import shapes
from stridor.mesh.boundary import outer_facets
from stridor.mesh.kinds import FACET_CORNERS, KINDS, corner_jacobians
from stridor.mesh.quality import check_mesh, edge_lengths, pieces

PLANE = [("quad", 1), ("quad", 2), ("quad9", 1), ("triangle", 1), ("triangle", 2)]
SPACE = [("hexahedron", 1), ("hexahedron", 2), ("hexahedron27", 1), ("tetra", 1), ("tetra", 2)]

# VTK's parametric coordinates, written down from its classes.
_VTK = {
    "tetra10": [
        (0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1),
        (0.5, 0, 0), (0.5, 0.5, 0), (0, 0.5, 0), (0, 0, 0.5), (0.5, 0, 0.5), (0, 0.5, 0.5),
    ],
    "hexahedron27": [
        (0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1),
        (0.5, 0, 0), (1, 0.5, 0), (0.5, 1, 0), (0, 0.5, 0), (0.5, 0, 1), (1, 0.5, 1), (0.5, 1, 1), (0, 0.5, 1),
        (0, 0, 0.5), (1, 0, 0.5), (1, 1, 0.5), (0, 1, 0.5),
        (0, 0.5, 0.5), (1, 0.5, 0.5), (0.5, 0, 0.5), (0.5, 1, 0.5), (0.5, 0.5, 0), (0.5, 0.5, 1), (0.5, 0.5, 0.5),
    ],
    "quad9": [(0, 0), (1, 0), (1, 1), (0, 1), (0.5, 0), (1, 0.5), (0.5, 1), (0, 0.5), (0.5, 0.5)],
    "triangle6": [(0, 0), (1, 0), (0, 1), (0.5, 0), (0.5, 0.5), (0, 0.5)],
}


def reference(kind: str) -> np.ndarray:
    largest = {"tet": "tetra10", "hex": "hexahedron27", "qua": "quad9", "tri": "triangle6"}[kind[:3]]
    return np.array(_VTK[largest], dtype=float)[: KINDS[kind].nodes]


def enclosed(points, facets) -> float:
    """Area or volume within facets by their flux of x, straight between corners."""
    total = 0.0
    for kind, block in facets.items():
        p = points[block[:, : FACET_CORNERS[kind]]]
        if points.shape[1] == 2:
            along = p[:, 1] - p[:, 0]
            total += np.sum(p[:, 0] * np.stack([along[:, 1], -along[:, 0]], axis=1)) / 2
        else:
            fans = [(0, 1, 2)] if p.shape[1] == 3 else [(0, 1, 2), (0, 2, 3)]
            for i, j, k in fans:
                total += np.sum(p[:, i] * np.cross(p[:, j], p[:, k])) / 6
    return float(total)


def joined(mesh):
    """Facets of all boundaries by kind."""
    kinds = {k for b in mesh.boundaries.values() for k in b}
    return {k: np.concatenate([b[k] for b in mesh.boundaries.values() if k in b]) for k in kinds}


def same_facets(a, b) -> bool:
    def rows(blocks):
        return sorted((k, tuple(sorted(r))) for k, f in blocks.items() for r in f.tolist())

    return rows(a) == rows(b)


@pytest.mark.parametrize("kind", list(KINDS))
def test_facets_close_the_reference_cell_and_have_their_midside_nodes_between_corners(kind):
    points = reference(kind)
    cells = {kind: np.arange(len(points))[None]}
    volume = {"tri": 0.5, "qua": 1.0, "tet": 1 / 6, "hex": 1.0}[kind[:3]]
    assert enclosed(points, outer_facets(cells, points)) == pytest.approx(volume, rel=1e-14)
    for facet in KINDS[kind].facets:
        corners = FACET_CORNERS[KINDS[kind].facet_kind]
        places = points[list(facet)]
        sides = 1 if corners == 2 else corners
        for k in range(sides if len(facet) > corners else 0):
            middle = (places[k] + places[(k + 1) % corners]) / 2
            np.testing.assert_allclose(places[corners + k], middle, atol=1e-15)
        if len(facet) == 9:
            np.testing.assert_allclose(places[8], places[:4].mean(axis=0), atol=1e-15)


@pytest.mark.parametrize("kind", list(KINDS))
def test_jacobian_at_corners_of_the_reference_cell_is_one_and_of_its_mirror_image_minus_one(kind):
    points = reference(kind)
    cell = np.arange(len(points))[None]
    assert np.allclose(corner_jacobians(kind, cell, points)[0], 1.0)
    mirrored = cell[:, KINDS[kind].mirrored]
    assert np.allclose(corner_jacobians(kind, mirrored, points)[0], -1.0)
    # The mirror order moves midside nodes along with their edges: mirrored points in that order are a cell again.
    flipped = points * ([1.0] * (points.shape[1] - 1) + [-1.0])
    jacobians = corner_jacobians(kind, mirrored, flipped)[0]
    assert np.allclose(jacobians, 1.0)


def test_jacobian_of_a_curved_cell_is_that_of_its_mapping():
    # x = ξ + a ξ η, y = η + b ξ²: quadratic, so quad9 holds it exactly; its determinant at (ξ, η) by hand.
    a, b = 0.2, 0.3
    xi, eta = reference("quad9").T
    points = np.stack([xi + a * xi * eta, eta + b * xi**2], axis=1)
    found = corner_jacobians("quad9", np.arange(9)[None], points)[0][0]
    np.testing.assert_allclose(found, ((1 + a * eta) - a * xi * 2 * b * xi)[:4], rtol=1e-13)


@pytest.mark.parametrize(("kind", "order"), PLANE)
def test_plane_shapes_are_closed_by_their_boundaries_and_have_the_right_area(kind, order):
    options = {"kind": kind, "order": order}
    n, sweep = 24, math.radians(90)
    meshes = {
        2.0: shapes.rectangle((1, -1), (2, 1), (5, 3), angle_deg=30, **options),
        48 * (44 + 16) / 2: shapes.quadrilateral([(0, 0), (48, 44), (48, 60), (0, 44)], (4, 3), **options),
        n / 2 * math.sin(2 * math.pi / n) * (1 - 0.25): shapes.annulus((3, 1), 0.5, 1, (3, n), **options),
        6 / 2 * math.sin(sweep / 6) * (1 - 0.25): shapes.annulus(
            (3, 1), 0.5, 1, (3, 6), start_deg=20, sweep_deg=90, **options
        ),
        16 / 2 * math.sin(2 * math.pi / 16): shapes.annulus((3, 1), 0, 1, (2, 16), start_deg=10, **options),
    }
    for area, mesh in meshes.items():
        check_mesh(mesh, "mesh")
        assert pieces(mesh) == 1
        # The circle's corners make a polygon: that is the area between corners also of curved cells.
        assert enclosed(mesh.points, joined(mesh)) == pytest.approx(area)
        assert same_facets(joined(mesh), outer_facets(mesh.cells, mesh.points))


@pytest.mark.parametrize(("kind", "order"), SPACE)
def test_solid_shapes_are_closed_by_their_boundaries_and_have_the_right_volume(kind, order):
    options = {"kind": kind, "order": order}
    ring = (0.2**2 - 0.1**2) * 0.02 / 2
    for volume, mesh in (
        (6.0, shapes.block((1, 2, 3), (1, 2, 3), (2, 3, 4), **options)),
        (12 * math.sin(math.pi / 6) * ring, shapes.disc((1, 0, 0), 0.1, 0.2, 0.02, (2, 12, 1), **options)),
        (3 * math.sin(math.pi / 9) * ring, shapes.pad((0, 0, 1), 0.1, 0.2, -30, 60, 0.02, (2, 3, 2), **options)),
    ):
        check_mesh(mesh, "mesh")
        assert pieces(mesh) == 1
        assert enclosed(mesh.points, joined(mesh)) == pytest.approx(volume, rel=1e-12)
        assert same_facets(joined(mesh), outer_facets(mesh.cells, mesh.points))


def test_every_node_of_curved_cells_on_the_rim_lies_on_its_circle():
    mesh = shapes.annulus((0, 0), 0.5, 1, (2, 7), kind="quad", order=2)
    for name, radius in (("inner", 0.5), ("outer", 1.0)):
        nodes = mesh.boundary_nodes(name)
        assert len(nodes) == 14
        assert np.abs(np.linalg.norm(mesh.points[nodes], axis=1) - radius).max() < 1e-15
    disc = shapes.disc((0, 0, 0), 0.1, 0.2, 0.02, (2, 7, 1), kind="tetra", order=2)
    on_rim = disc.points[disc.boundary_nodes("outer")]
    assert np.abs(np.linalg.norm(on_rim[:, :2], axis=1) - 0.2).max() < 1e-15


def test_boundaries_are_where_their_names_say():
    mesh = shapes.block((1, 2, 3), (1, 2, 3), (2, 2, 2))
    for name, (axis, value) in {
        "left": (0, 1), "right": (0, 2), "front": (1, 2), "back": (1, 4), "bottom": (2, 3), "top": (2, 6),
    }.items():  # fmt: skip
        assert np.all(mesh.points[mesh.boundary_nodes(name), axis] == value)
    pad = shapes.pad((0, 0, 1), 0.1, 0.2, 30, 60, 0.02, (2, 3, 2))
    assert np.allclose(pad.points[pad.boundary_nodes("bottom"), 2], 1.0)
    assert np.allclose(pad.points[pad.boundary_nodes("top"), 2], 1.02)
    for name, angle in (("start", 30), ("end", 90)):
        x, y, _ = pad.points[pad.boundary_nodes(name)].T
        assert np.allclose(np.degrees(np.arctan2(y, x)), angle)
    turned = shapes.rectangle((1, 1), (2, 1), (2, 1), angle_deg=90)
    assert np.allclose(turned.points[turned.boundary_nodes("bottom"), 0], 1)
    assert np.allclose(turned.points[turned.boundary_nodes("top"), 0], 0)
    assert list(shapes.annulus((0, 0), 0.5, 1, (1, 8)).boundaries) == ["inner", "outer"]
    assert list(shapes.annulus((0, 0), 0, 1, (1, 8)).boundaries) == ["outer"]


def test_numbers_of_points_and_cells():
    assert len(shapes.annulus((0, 0), 0.5, 1, (3, 24)).points) == 4 * 24
    assert len(shapes.annulus((0, 0), 0.5, 1, (3, 24), order=2).points) == 4 * 24 * 2 + 3 * 24
    disc = shapes.annulus((0, 0), 0, 1, (3, 24))
    assert disc.cell_count == 6 * 6 + 3 * 24
    assert len(disc.points) == 7 * 7 + 3 * 24
    assert shapes.block((0, 0, 0), (1, 1, 1), (2, 2, 2), kind="tetra").cell_count == 48
    assert len(shapes.block((0, 0, 0), (1, 1, 1), (2, 2, 2), kind="hexahedron27").points) == 5**3


@pytest.mark.parametrize("order", [1, 2])
def test_points_are_numbered_so_that_matrices_are_narrow(order):
    # Over the length of a closed ring of 200 cells the numbers of a cell's nodes differ by about two cross-sections.
    mesh = shapes.disc((0, 0, 0), 0.1, 0.2, 0.02, (3, 200, 2), order=order)
    cells = next(iter(mesh.cells.values()))
    section = len(mesh.points) / (200 * order)
    assert (cells.max(axis=1) - cells.min(axis=1)).max() < (2 * order + 1) * 2 * section


def test_element_size_bounds_edges():
    mesh = shapes.rectangle((0, 0), (1, 0.3), element_size=0.1)
    assert mesh.cell_count == 30
    assert edge_lengths(mesh)[1] <= 0.1 + 1e-12
    for inner in (0.0, 0.05):
        assert edge_lengths(shapes.annulus((0, 0), inner, 0.2, element_size=0.03))[1] <= 0.03 + 1e-12
    assert edge_lengths(shapes.pad((0, 0, 0), 0.1, 0.2, 0, 45, 0.02, element_size=0.01))[1] <= 0.01 + 1e-12
    assert shapes.divisions_for((1.0, 0.25), 0.1) == (10, 3)


def test_refusals_say_what_is_accepted():
    cases = [
        (lambda: shapes.rectangle((0, 0), (1, 0), (2, 2)), "rectangle.size: [1, 0] – must be greater than 0"),
        (lambda: shapes.rectangle((0, 0), (1, 1)), "rectangle: needs either divisions or element_size, not both"),
        (
            lambda: shapes.rectangle((0, 0), (1, 1), (2, 0)),
            "rectangle.divisions: [2, 0] – must be 2 whole numbers from 1: along the bottom, along the sides",
        ),
        (
            lambda: shapes.rectangle((0, 0), (1, 1), element_size=1e-9),
            "rectangle.element_size: 1e-09 – makes more than 10,000,000 cells",
        ),
        (
            lambda: shapes.rectangle((0, 0), (1, 1), (1, 1), kind="hexahedron"),
            "rectangle.kind: 'hexahedron' – must be one of: triangle, triangle6, quad, quad8, quad9",
        ),
        (lambda: shapes.rectangle((0, math.nan), (1, 1), (1, 1)), "rectangle.corner: nan – must be a finite number"),
        (
            lambda: shapes.quadrilateral([(0, 0), (0, 1), (1, 1), (1, 0)], (1, 1)),
            "quadrilateral.corners: [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]] – the corners must be convex and "
            "go round counter-clockwise: bottom left, bottom right, top right, top left",
        ),
        (
            lambda: shapes.annulus((0, 0), 1, 0.5, (1, 8)),
            "annulus.outer_radius: 0.5 – must be greater than the inner radius, 1",
        ),
        (
            lambda: shapes.annulus((0, 0), 0.5, 1, (1, 2)),
            "annulus.divisions: 2 – needs at least 3 divisions around for 360°",
        ),
        (
            lambda: shapes.annulus((0, 0), 0, 1, (1, 6)),
            "annulus.divisions: [1, 6] – a solid disc needs a multiple of 4 around",
        ),
        (
            lambda: shapes.annulus((0, 0), 0, 1, (1, 8), sweep_deg=90),
            "annulus.inner_radius: 0 – a sector needs an inner radius above 0; a solid disc goes round",
        ),
        (
            lambda: shapes.disc((0, 0, 0), 0, 1, 0.1, (1, 8, 1), where="bodies.disc.mesh"),
            "bodies.disc.mesh.inner_radius: 0 – must be greater than 0",
        ),
        (
            lambda: shapes.pad((0, 0, 0), 0.1, 1, 0, 360, 0.1, (1, 8, 1)),
            "pad.sweep_deg: 360 – must be less than 360; a whole disc is of shape disc",
        ),
    ]
    for make, message in cases:
        with pytest.raises(CaseError) as caught:
            make()
        assert str(caught.value) == message


def test_cells_side_by_side_share_whole_facets():
    # Every facet of the surface is on a named boundary: were two cells to split a common face differently, its halves
    # would be on the surface too. (Tetrahedra in a closed ring are the hard case.)
    for count in itertools.product((1, 2), (3, 4), (1, 2)):
        mesh = shapes.disc((0, 0, 0), 0.1, 0.2, 0.02, count, kind="tetra")
        assert same_facets(joined(mesh), outer_facets(mesh.cells, mesh.points))
