"""Small rules of contact on shapes whose answers are plain: which segment is found, and what quadrature rules integrate."""

from __future__ import annotations

from math import factorial

import numpy as np
import pytest

from stridor.contact.curve import Curve
from stridor.contact.facet_search import _solve as place_on_facet
from stridor.contact.facets import FacetSurface
from stridor.contact.pieces import _affine, _composite, _fine_triangle, _frames
from stridor.mesh.facets import reference_nodes


def rectangle(length: float, height: float) -> Curve:
    """Its sides in order 0 (below), 1 (right), 2, 3, one facet each, all corners sharp."""
    points = np.array([[0.0, 0.0], [length, 0.0], [length, height], [0.0, height]])
    return Curve.from_facets(points, {"line": np.array([[0, 1], [1, 2], [2, 3], [3, 0]])}, where="rectangle")


def side_of(curve: Curve, found: int) -> int:
    """The side by the middle of the segment found: 0 below, 1 right, 2 above, 3 left."""
    middle = curve.positions[curve.stencils[found, 1:3]].mean(axis=0)
    size = curve.positions.max(axis=0)
    return int(np.argmin([middle[1], size[0] - middle[0], size[1] - middle[1], middle[0]]))


@pytest.mark.parametrize("tall", [False, True])
def test_a_long_side_is_found_though_the_middle_of_a_short_one_is_nearer(tall: bool) -> None:
    size = np.array([4.0, 1.0])
    off = np.array([[0.2, -0.3], [3.8, -0.3], [0.2, 1.3], [3.8, 1.3]])
    sides = [0, 0, 2, 2]
    if tall:
        size, off, sides = size[::-1], off[:, ::-1], [3, 3, 1, 1]
    curve = rectangle(*size)
    found = curve.locate(off)
    assert found.gap == pytest.approx(np.full(4, 0.3), rel=1e-12)
    assert [side_of(curve, k) for k in found.facet] == sides
    assert found.inside.all()


def test_a_point_right_off_the_end_of_a_side_belongs_to_that_side_and_not_to_the_corner() -> None:
    # Nearest to all of these is a corner, of one side on the line and of the other beyond its end.
    curve = rectangle(2.0, 1.0)
    off = np.array([[2.0, -0.2], [2.2, 0.0], [2.2, 1.0], [2.0, 1.2], [0.0, 1.2], [-0.2, 1.0], [-0.2, 0.0], [0.0, -0.2]])
    found = curve.locate(off)
    assert [side_of(curve, k) for k in found.facet] == [0, 1, 1, 2, 2, 3, 3, 0]
    assert found.gap == pytest.approx(np.full(8, 0.2))
    assert found.normal == pytest.approx((off - found.point) / 0.2)


def test_off_a_corner_the_gap_is_the_distance_from_it() -> None:
    curve = rectangle(2.0, 1.0)
    off = np.array([[2.3, -0.4], [-0.3, 1.4]])
    found = curve.locate(off)
    assert found.gap == pytest.approx([0.5, 0.5])
    assert found.normal == pytest.approx(np.array([[0.6, -0.8], [-0.6, 0.8]]))
    assert found.inside.all()


@pytest.mark.parametrize("turn", range(5))
def test_every_corner_is_broken_and_wherever_the_numbering_begins(turn: int) -> None:
    angle = 2 * np.pi * (np.arange(5) + turn) / 5
    points = np.column_stack([np.cos(angle), np.sin(angle)])
    cells = np.stack([np.arange(5), (np.arange(5) + 1) % 5], axis=1)
    curve = Curve.from_facets(points, {"line": cells}, where="pentagon")
    assert sorted(curve.nodes[curve.corners]) == [0, 1, 2, 3, 4]
    out = 1.5 * points
    found = curve.locate(out)
    assert found.gap == pytest.approx(np.full(5, 0.5))
    assert found.normal == pytest.approx(points)
    # At a corner itself it is that of one of its sides.
    at = curve.locate(points)
    assert np.sum(at.normal * points, axis=1) == pytest.approx(np.full(5, np.cos(np.pi / 5)))
    assert at.gap == pytest.approx(np.zeros(5), abs=1e-15)


def on_facet(corners, normals, slave):
    """Whether equations were solved, and ξ, η and the gap."""
    corners, normals = np.array(corners, dtype=float), np.array(normals, dtype=float)
    facet = np.arange(4)
    if len(corners) == 3:
        facet[3] = -1
    place = np.zeros(3)
    space = np.zeros((3, 4)), np.zeros((6, 3))
    found = place_on_facet(np.array(slave, dtype=float), corners, facet, normals, False, np.zeros((11, 6)), place, *space)
    return bool(found), place


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
@pytest.mark.parametrize(("tilt", "regular"), [(1.0, True), (1e-9, True), (1e-12, False), (0.0, False)])
def test_a_facet_whose_normals_lie_in_it_has_no_place(order, tilt: float, regular: bool) -> None:
    # Along N from the middle; whichever way sides and normal point, N counts against the sizes of both tangents.
    turn = np.eye(3)[list(order)]
    for sides in (np.array([[2.0, 0, 0], [0, 3, 0]]), np.array([[0.0, 3, 0], [2, 0, 0]])):
        corners = np.array([[0, 0, 0], sides[0], sides[0] + sides[1], sides[1]]) @ turn
        normals = np.tile(np.array([1.0, 1.0, tilt]) @ turn, (4, 1))
        found, place = on_facet(corners, normals, corners.mean(axis=0))
        assert found is regular
        if regular:
            assert place == pytest.approx([0.5, 0.5, 0], abs=1e-6)


def test_places_on_a_triangle_and_a_square() -> None:
    up = [[0, 0, 2.0]] * 4
    found, place = on_facet([[0, 0, 0], [4, 0, 0], [0, 2, 0]], up[:3], [1, 0.5, 0.25])
    assert found
    assert place == pytest.approx([0.25, 0.25, 0.25])
    found, place = on_facet([[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0]], up, [3, 0.5, -0.25])
    assert found
    assert place == pytest.approx([0.75, 0.25, -0.25])


CUBE = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
FACES = np.array([[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]])
OUT = np.repeat(np.eye(3), 2, axis=0) * np.tile([[-1.0], [1.0]], (3, 1))


@pytest.mark.parametrize("off", [0.0, 1e-15, -1e-3, 0.2])
def test_within_a_face_the_normal_is_that_of_the_face_whatever_edges_it_has(off: float) -> None:
    box = FacetSurface.from_facets(CUBE, {"quad": FACES}, where="box")
    for aside in (0.0, 0.3):
        slaves = 0.5 + OUT * (0.5 + off) + aside * np.roll(OUT, 1, axis=1)
        found = box.locate(slaves)
        assert found.inside.all()
        assert found.normal == pytest.approx(OUT, abs=1e-12)
        assert found.gap == pytest.approx(np.full(6, off), abs=1e-12)


def test_off_sharp_edges_the_normal_leads_away_from_them() -> None:
    box = FacetSurface.from_facets(CUBE, {"quad": FACES}, where="box")
    slaves = np.array([[1.3, 0.5, 1.4], [-0.3, -0.4, 0.25], [0.5, 1.3, -0.4]])
    found = box.locate(slaves)
    assert found.inside.all()
    assert found.gap == pytest.approx(np.full(3, 0.5))
    assert found.normal == pytest.approx(np.array([[0.6, 0, 0.8], [-0.6, -0.8, 0], [0, 0.6, -0.8]]))


# -- rules of quadrature -----------------------------------------------------------------------------------------------


def moments(place, weight, degree: int) -> dict[tuple[int, ...], float]:
    dimension = place.shape[1]
    return {
        power: float(weight @ np.prod(place ** np.array(power), axis=1))
        for power in np.ndindex(*[degree + 1] * dimension) if sum(power) <= degree
    }  # fmt: skip


@pytest.mark.parametrize(("kind", "degree"), [("line", 1), ("line3", 3), ("quad", 2), ("quad8", 3)])
def test_the_fine_rule_of_lines_and_squares_is_exact(kind: str, degree: int) -> None:
    place, weight = _composite(kind)
    for power, value in moments(place, weight, degree).items():
        assert value == pytest.approx(np.prod([1 / (p + 1) for p in power]), rel=1e-13), power
    assert place.min() > 0
    assert place.max() < 1
    # In sixteenths of a square and quarters of a line equally many points.
    cell = np.floor(4 * place).astype(int) @ [1, 4][: place.shape[1]]
    assert len(set(np.bincount(cell))) == 1
    assert len(np.bincount(cell)) == 4 ** place.shape[1]


@pytest.mark.parametrize("rule", ["triangle", "triangle6", 2, 4])
def test_the_fine_rule_of_triangles_is_exact(rule) -> None:
    place, weight = _fine_triangle(rule) if isinstance(rule, int) else _composite(rule)
    degree = {"triangle": 2, "triangle6": 4}.get(rule, 2 * rule - 2 if isinstance(rule, int) else 0)
    for (a, b), value in moments(place, weight, degree).items():
        assert value == pytest.approx(factorial(a) * factorial(b) / factorial(a + b + 2), rel=1e-12), (a, b)
    assert place.min() > 0
    assert place.sum(axis=1).max() < 1


def test_frames_lie_in_their_facets_with_the_normal_outward() -> None:
    triangle = np.array([[[0, 0, 1], [2, 0, 1], [0, 3, 1]]], dtype=float)
    square = np.array([[[0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1]]], dtype=float)
    # Of a warped one the normal is that of both diagonals.
    warped = np.array([[[0, 0, 0], [1, 0, 0.4], [1, 1, 0], [0, 1, 0.4]]], dtype=float)
    for corners, normal in ((triangle, [0, 0, 1]), (square, [1, 0, 0]), (warped, [0, 0, 1])):
        frame = _frames(corners)[0]
        assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-14)
        assert np.cross(frame[0], frame[1]) == pytest.approx(frame[2])
        assert frame[2] == pytest.approx(normal)


@pytest.mark.parametrize("kind", ["triangle6", "quad", "quad8", "quad9"])
def test_facets_are_even_where_they_are_images_without_distortion(kind: str) -> None:
    places = reference_nodes(kind)
    flat = 0.5 + places @ np.array([[2.0, 0.5, 0.0], [0.3, 1.0, 1.0]])
    bent = flat.copy()
    bent[-1 if kind != "quad" else 2] += [0, 0, 1e-6]
    assert _affine(kind, np.stack([flat, bent, 1e-6 * flat])).tolist() == [True, False, True]
