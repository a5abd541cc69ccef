"""What check_mesh refuses, turning over of mirrored cells, and how fine a mesh is."""

from dataclasses import replace

import numpy as np
import pytest

from stridor.errors import CaseError
from stridor.mesh import shapes
from stridor.mesh.boundary import cell_facets, facets_within, match_facets
from stridor.mesh.facets import facet_areas
from stridor.mesh.hanging import hanging, on_two_triangles
from stridor.mesh.model import Mesh
from stridor.mesh.quality import check_mesh, edge_lengths, pieces, turned_over


def problems(mesh) -> list[str]:
    with pytest.raises(CaseError) as caught:
        check_mesh(mesh, "bodies.pad")
    return [str(p) for p in caught.value.problems]


def unit_squares(**options) -> Mesh:
    return shapes.rectangle((0, 0), (3, 1), (3, 1), **options)


def moved(mesh, node, place) -> Mesh:
    points = mesh.points.copy()
    points[node] = place
    return replace(mesh, points=points)


def node_at(mesh, *place) -> int:
    return int(np.argmin(np.linalg.norm(mesh.points - place, axis=1)))


def test_an_inverted_cell_is_told_with_its_number_and_place():
    mesh = unit_squares()
    folded = moved(mesh, node_at(mesh, 1, 0), (1, 1.5))
    assert problems(folded) == [
        "bodies.pad: 2 of 3 cells are inverted (negative Jacobian); the first is quad cell number 1 about (0.5, 0.875)"
    ]
    solid = shapes.block((0, 0, 0), (2, 1, 1), (2, 1, 1), kind="tetra")
    swapped = solid.cells["tetra"].copy()
    swapped[7] = swapped[7][[1, 0, 2, 3]]
    assert problems(replace(solid, cells={"tetra": swapped}, boundaries={})) == [
        "bodies.pad: 1 of 12 cells are inverted (negative Jacobian); the first is tetra cell number 8 about "
        f"({', '.join(f'{v:.6g}' for v in solid.points[swapped[7]].mean(axis=0))})"
    ]


def test_a_midside_node_too_far_from_the_middle_inverts_a_corner():
    mesh = shapes.rectangle((0, 0), (1, 1), (1, 1), order=2)
    node = node_at(mesh, 0.5, 0)
    # The tangent at the corner is 4 m − 3 p − q: it vanishes at a quarter of the edge, and turns round beyond.
    check_mesh(moved(mesh, node, (0.26, 0)), "mesh")
    assert "degenerate (zero Jacobian" in problems(moved(mesh, node, (0.25, 0)))[0]
    assert "inverted (negative Jacobian)" in problems(moved(mesh, node, (0.24, 0)))[0]


def test_a_cell_that_names_a_node_twice():
    mesh = unit_squares()
    cells = mesh.cells["quad"].copy()
    cells[1, 3] = cells[1, 2]  # drawn together to a triangle
    text = "bodies.pad: 1 of 3 cells name a node twice; the first is quad cell number 2 about "
    place = ", ".join(f"{x:.6g}" for x in mesh.points[cells[1]].mean(axis=0))
    node = ", ".join(f"{x:.6g}" for x in mesh.points[cells[1, 3]])
    wrong = replace(mesh, cells={"quad": cells}, boundaries={})
    end = f"at ({node}); every node of a cell is one of its own"
    assert problems(wrong) == [f"{text}({place}), with the node {end}"]
    numbers = 10 * np.arange(len(mesh.points))
    assert problems(replace(wrong, numbers=numbers)) == [f"{text}({place}), with node {numbers[cells[1, 3]]}, {end}"]
    # A middle in the place of another one leaves all corners right.
    mesh = unit_squares(kind="quad", order=2)
    cells = mesh.cells["quad8"].copy()
    cells[0, 5] = cells[0, 4]
    assert "name a node twice" in problems(replace(mesh, cells={"quad8": cells}, boundaries={}))[0]


def test_degenerate_cells_and_facets_without_area():
    mesh = unit_squares()
    collapsed = moved(mesh, node_at(mesh, 3, 1), (3, 0))
    assert problems(collapsed) == [
        "bodies.pad: 1 of 3 cells are degenerate (zero Jacobian: flat, or nodes at one place); the first is quad cell "
        "number 3 about (2.5, 0.25)",
        "bodies.pad: boundary right: 1 of 1 facets have no area; the first is at (3, 0)",
    ]
    flat = shapes.block((0, 0, 0), (1, 1, 1), (1, 1, 1))
    flat = replace(flat, points=flat.points * [1, 1, 0])
    assert len(problems(flat)) == 5  # the cell and four sides


def test_a_mesh_all_of_whose_cells_are_mirrored_says_so():
    mesh = shapes.block((0, 0, 0), (1, 1, 1), (2, 2, 2))
    mirrored = replace(mesh, points=mesh.points * [1, 1, -1], boundaries={})
    assert problems(mirrored) == [
        "bodies.pad: all 8 cells are inverted: the order of their nodes is mirrored; number them the other way"
    ]


def test_points_and_indices_are_checked_before_anything_is_computed():
    mesh = unit_squares()
    assert problems(moved(mesh, 2, (np.nan, 0))) == [
        "bodies.pad: 1 of 8 points have no finite place; the first is point 3 at (nan, 0)"
    ]
    assert problems(replace(mesh, points=mesh.points[:-1])) == [
        "bodies.pad: 1 quad cells use points that do not exist; the first is number 3",
        "bodies.pad: 1 facets of boundary right use points that do not exist; the first is number 1",
        "bodies.pad: 1 facets of boundary top use points that do not exist; the first is number 3",
    ]
    assert problems(replace(mesh, points=np.vstack([mesh.points, [[9, 9]]]))) == [
        "bodies.pad: 1 points belong to no cell; the first is point 9 at (9, 9)"
    ]
    assert problems(Mesh(points=np.zeros((0, 2)), cells={})) == ["bodies.pad: no cells; a body needs some"]
    assert problems(Mesh(points=np.zeros((3, 3)), cells={"triangle": np.array([[0, 1, 2]])})) == [
        "bodies.pad: cells of kind triangle; in 3D accepted: tetra, tetra10, hexahedron, hexahedron20, hexahedron27"
    ]
    stray = replace(mesh, boundaries={"odd": {"line": np.array([[0, 7]])}})
    assert problems(stray) == ["bodies.pad: boundary odd: 1 facets are a side of no cell"]


def with_turned_cells(mesh):
    """As the readers of files and the built-in shapes leave a mesh."""
    cells = turned_over(mesh.cells, mesh.points)
    every = cell_facets(cells, mesh.points)
    return replace(mesh, cells=cells, boundaries={n: match_facets(every, f).outer for n, f in mesh.boundaries.items()})


@pytest.mark.parametrize(("kind", "order"), [("quad", 1), ("quad", 2), ("quad9", 1), ("triangle", 1), ("triangle", 2)])
def test_mirrored_plane_meshes_are_turned_over_with_their_facets(kind, order):
    mesh = shapes.annulus((0, 0), 0.5, 1.0, (2, 12), kind=kind, order=order)
    mirrored = replace(mesh, points=mesh.points * [1, -1])
    assert "all" in problems(mirrored)[0]
    turned = with_turned_cells(mirrored)
    check_mesh(turned, "mesh")
    for name, outward in (("outer", 1), ("inner", -1)):
        (facets,) = turned.boundaries[name].values()
        start, end = turned.points[facets[:, 0]], turned.points[facets[:, 1]]
        normal = np.stack([(end - start)[:, 1], -(end - start)[:, 0]], axis=1)
        assert np.all(outward * np.sum(normal * (start + end), axis=1) > 0)
        if facets.shape[1] == 3:
            assert np.all(np.linalg.norm(turned.points[facets[:, 2]] - (start + end) / 2, axis=1) < 0.05)
    assert turned_over(mesh.cells, mesh.points) is mesh.cells


def test_a_patch_numbered_the_other_way_is_turned_but_a_fold_is_not():
    mesh = unit_squares()
    cells = mesh.cells["quad"].copy()
    cells[1] = cells[1][::-1]  # clockwise, as its neighbours see too
    check_mesh(with_turned_cells(replace(mesh, cells={"quad": cells})), "mesh")
    # A node dragged across its neighbours' edge: the triangle beyond is inverted, and in the same sense as the rest.
    triangles = shapes.rectangle((0, 0), (2, 1), (2, 1), kind="triangle")
    folded = moved(triangles, node_at(triangles, 0, 1), (1.5, 0.1))
    assert turned_over(folded.cells, folded.points) is folded.cells
    assert "1 of 4 cells are inverted" in problems(folded)[0]


def test_solid_cells_are_never_turned():
    mesh = shapes.block((0, 0, 0), (1, 1, 1), (1, 1, 1))
    mirrored = replace(mesh, points=mesh.points * [1, 1, -1])
    assert turned_over(mirrored.cells, mirrored.points) is mirrored.cells


def test_pieces_count_what_shares_no_node():
    one = unit_squares()
    assert pieces(one) == 1
    twice = Mesh(
        points=np.vstack([one.points, one.points]),  # at the same places, and yet apart
        cells={"quad": np.vstack([one.cells["quad"], one.cells["quad"] + len(one.points)])},
    )
    assert pieces(twice) == 2
    check_mesh(twice, "mesh")


LOW, HIGH = ((0, 0, 0), (2, 1, 1), (2, 1, 1)), ((0, 0, 1), (2, 1, 1), (2, 1, 1))


def together(lower: Mesh, upper: Mesh) -> Mesh:
    """Two meshes with what lies at one place as one node."""
    points, number = np.unique(np.round(np.vstack([lower.points, upper.points]), 9), axis=0, return_inverse=True)
    shift = len(lower.points)
    cells = {kind: number[block] for kind, block in lower.cells.items()}
    for kind, block in upper.cells.items():
        cells[kind] = np.vstack([*([cells[kind]] if kind in cells else []), number[block + shift]])
    return Mesh(points, cells)


@pytest.mark.parametrize(
    ("below", "above", "count"),
    [
        ("hexahedron", "hexahedron", 0), ("hexahedron20", "hexahedron20", 0), ("hexahedron", "tetra", 0),
        ("hexahedron", "hexahedron20", 7), ("hexahedron20", "hexahedron27", 2), ("hexahedron20", "tetra10", 2),
    ],
)  # fmt: skip
def test_midside_nodes_that_belong_to_the_cells_on_one_side_only(below: str, above: str, count: int):
    """Of two squares 7 edges, of hexahedra of 27 nodes and of tetrahedra what lies in the middle of both squares."""
    mesh = together(shapes.block(*LOW, kind=below), shapes.block(*HIGH, kind=above))
    check_mesh(mesh, "mesh")
    found = hanging(mesh)
    assert len(found) == count
    assert np.all(mesh.points[found][:, 2] == 1.0)


@pytest.mark.parametrize(
    ("below", "above", "count"),
    [
        ("hexahedron", "tetra", 2), ("tetra", "hexahedron", 2), ("hexahedron27", "tetra10", 2),
        ("hexahedron20", "tetra10", 0), ("hexahedron", "tetra10", 0), ("hexahedron", "hexahedron", 0),
        ("tetra", "tetra", 0), ("hexahedron", "hexahedron20", 0),
    ],
)  # fmt: skip
@pytest.mark.parametrize("seed", [None, 1])
def test_faces_that_share_their_nodes_with_two_triangles(below, above, count, seed):
    """And bend where these are flat. Nodes too few or too many are another matter."""
    mesh = together(shapes.block(*LOW, kind=below), shapes.block(*HIGH, kind=above))
    if seed is not None:
        rng = np.random.default_rng(seed)
        order = rng.permutation(len(mesh.points))
        number = np.argsort(order)
        mesh = Mesh(mesh.points[order], {kind: number[rng.permutation(block)] for kind, block in mesh.cells.items()})
    check_mesh(mesh, "mesh")
    found = on_two_triangles(mesh)
    assert len(found) == count
    assert np.all(found[:, 2] == 1.0)


@pytest.mark.parametrize(("below", "above"), [("hexahedron", "tetra"), ("hexahedron27", "tetra10"), ("tetra", "tetra")])
def test_what_lies_between_two_kinds_of_cells_is_no_surface(below, above):
    """The surface of the whole is that of one box, 2 by 1 by 2."""
    mesh = together(shapes.block(*LOW, kind=below), shapes.block(*HIGH, kind=above))
    outside = facets_within(mesh.cells, mesh.points, np.arange(len(mesh.points)))
    area = sum(float(of_kind.sum()) for of_kind in facet_areas(mesh.points, outside).values())
    assert area == pytest.approx(16.0)
    amid = np.flatnonzero(mesh.points[:, 2] == 1.0)
    assert not facets_within(mesh.cells, mesh.points, amid)


def test_linear_and_quadratic_cells_in_the_plane():
    linear, quadratic = shapes.rectangle((0, 0), (2, 1), (2, 1)), shapes.rectangle((0, 1), (2, 1), (2, 1), order=2)
    mesh = together(linear, quadratic)
    assert mesh.points[hanging(mesh)].tolist() == [[0.5, 1.0], [1.5, 1.0]]
    assert not len(hanging(together(linear, shapes.rectangle((0, 1), (2, 1), (2, 1)))))


def test_edge_lengths_and_elements_per_wavelength():
    mesh = shapes.block((0, 0, 0), (1, 2, 3), (10, 10, 10), order=2)
    least, largest = edge_lengths(mesh)
    assert least == pytest.approx(0.1)
    assert largest == pytest.approx(0.3)
    # 3000 m/s at 1 kHz: 3 m long, ten elements of 0.3 m.


@pytest.mark.parametrize(("height", "flat"), [(0.25e-10, True), (0.4e-10, True), (0.6e-10, False), (2.5e-10, False)])
def test_a_cell_is_flat_below_a_corner_sine_of_1e_10(height, flat):
    """The least sine of a triangle of height h over the middle of its side 1 is 2 h."""
    mesh = Mesh(np.array([[0.0, 0.0], [1.0, 0.0], [0.5, height]]), {"triangle": np.array([[0, 1, 2]])})
    if not flat:
        check_mesh(mesh, "m")
        return
    with pytest.raises(CaseError, match="1 of 1 cells are degenerate"):
        check_mesh(mesh, "m")
