"""Surfaces as contact sees them: areas and loads of facets, places and gaps on masters, pairing and its operators."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from stridor.contact.curve import Curve, weights_at
from stridor.contact.facets import FacetSurface
from stridor.contact.interface import Rows
from stridor.contact.obstacles import Cylinder, Flat
from stridor.contact.pairing import overlap_tolerance, pair_surface, repair
from stridor.errors import CaseError
from stridor.laws import Coulomb
from stridor.mesh.facets import (
    chain_of,
    facet_areas,
    nodal_areas,
    nodal_normals,
    pressure_load,
    quadrature,
    reference_nodes,
    shape_functions,
    traction_load,
)
from stridor.mesh.model import FACET_KINDS

pytestmark = pytest.mark.verification

SPACE_KINDS = ("triangle", "triangle6", "quad", "quad8", "quad9")
LINEAR, QUADRATIC = ("triangle", "quad"), ("triangle6", "quad8", "quad9")


# -- meshes ------------------------------------------------------------------------------------------------------------


def circle(count, radius=1.0, kind="line", hole=False):
    """A closed circle; of a hole the body is outside."""
    angle = 2 * np.pi * np.arange(count) / count * (-1 if hole else 1)
    points = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    if kind == "line":
        return points, {"line": np.column_stack([np.arange(count), (np.arange(count) + 1) % count])}
    corner = np.arange(0, count, 2)
    return points, {"line3": np.column_stack([corner, (corner + 2) % count, corner + 1])}


def rectangle(length=4.0, height=1.0, across=8, up=2):
    """The whole boundary of a rectangle, its lower left corner at the origin."""
    x, y = np.linspace(0, length, across + 1), np.linspace(0, height, up + 1)
    low = np.column_stack([x[:-1], 0 * x[:-1]])
    right = np.column_stack([0 * y[:-1] + length, y[:-1]])
    points = np.concatenate([low, right, [length, height] - low, [length, height] - right])
    count = len(points)
    return points, {"line": np.column_stack([np.arange(count), (np.arange(count) + 1) % count])}


def patch(kind, places, across, up, wrap=False):
    """Facets of a kind over a grid of (u, v) in [0, 1]², mapped by ``places``, normal along ∂u × ∂v."""
    fine = 2 if kind in ("triangle6", "quad8", "quad9") else 1
    columns = across * fine + (0 if wrap else 1)
    u, v = np.meshgrid(np.arange(columns) / (across * fine), np.linspace(0, 1, up * fine + 1))
    points = places(u.ravel(), v.ravel())

    def at(i, j):
        return j * columns + (i % columns if wrap else i)

    cells = []
    for j in range(0, up * fine, fine):
        for i in range(0, across * fine, fine):
            a, b, c, d = at(i, j), at(i + fine, j), at(i + fine, j + fine), at(i, j + fine)
            if fine == 2:
                ab, bc, cd, da, mid = at(i + 1, j), at(i + 2, j + 1), at(i + 1, j + 2), at(i, j + 1), at(i + 1, j + 1)
            if kind == "triangle":
                cells += [[a, b, c], [a, c, d]]
            elif kind == "triangle6":
                cells += [[a, b, c, ab, bc, mid], [a, c, d, mid, cd, da]]
            elif kind == "quad":
                cells += [[a, b, c, d]]
            else:
                cells += [[a, b, c, d, ab, bc, cd, da, mid][: 8 if kind == "quad8" else 9]]
    cells = np.array(cells)
    used, numbers = np.unique(cells, return_inverse=True)
    return points[used], {kind: numbers.reshape(cells.shape)}


def cylinder(kind="quad", around=32, along=6, radius=1.0, length=1.0):
    return patch(
        kind,
        lambda u, v: np.column_stack([radius * np.cos(2 * np.pi * u), radius * np.sin(2 * np.pi * u), length * v]),
        around,
        along,
        wrap=True,
    )


def closed_body(kind, cells=3, bulge=0.3):
    """The surface of a cube, bulged and bent so that no facet is flat."""
    faces = [
        lambda u, v: np.column_stack([0 * u + 1, u, v]),
        lambda u, v: np.column_stack([0 * u, v, u]),
        lambda u, v: np.column_stack([v, 0 * u + 1, u]),
        lambda u, v: np.column_stack([u, 0 * u, v]),
        lambda u, v: np.column_stack([u, v, 0 * u + 1]),
        lambda u, v: np.column_stack([v, u, 0 * u]),
    ]
    parts = [patch(kind, face, cells, cells) for face in faces]
    starts = np.cumsum([0] + [len(p) for p, _ in parts])
    points = np.concatenate([p for p, _ in parts])
    facets = np.concatenate([f[kind] + s for (_, f), s in zip(parts, starts[:-1], strict=True)])
    merged, numbers = np.unique(np.round(points, 9), axis=0, return_inverse=True)
    x, y, z = merged.T
    bent = merged + bulge * np.column_stack([0.3 * np.sin(2 * y), 0.2 * x * z, 0.5 * np.sin(x + 2 * y)])
    return bent, {kind: numbers.ravel()[facets]}


def closed_line(kind):
    points, facets = circle(12, kind=kind)
    rng = np.random.default_rng(2)
    return points * [2.0, 1.0] + 0.05 * rng.standard_normal(points.shape), facets


def boundary(kind):
    return closed_line(kind) if kind.startswith("line") else closed_body(kind)


def grid(count, kind="quad", size=1.0):
    return patch(kind, lambda u, v: size * np.column_stack([u, v, 0 * u]), count, count)


def moment(places, forces):
    """About the origin (3,), of forces in the plane as well."""
    lift = np.zeros((len(places), 3 - places.shape[1]))
    return np.cross(np.hstack([places, lift]), np.hstack([forces, lift])).sum(axis=0)


def rows_of(count, dimension, start, total, motions=0):
    free = sp.csr_array(
        (np.ones(count * dimension), (np.arange(count * dimension), start + np.arange(count * dimension))),
        shape=(count * dimension, total),
    )
    return Rows(free, np.zeros((count * dimension, motions)))


def contact(position, normals, master, area=None, drift=None, **options):
    """Slave nodes and master nodes as the freedoms of one system, slaves first."""
    count, d = position.shape
    total = (count + master.node_count) * d
    motions = 0 if drift is None else drift.shape[2]
    return pair_surface(
        "touch",
        where="contacts.touch",
        slave=rows_of(count, d, 0, total, motions),
        slave_position=position,
        slave_normals=normals,
        area=np.ones(count) if area is None else area,
        master=master,
        master_rows=rows_of(master.node_count, d, count * d, total, motions),
        drift=np.zeros((count, d, 0)) if drift is None else drift,
        stiffness_per_area=math.inf,
        law=Coulomb(0.3),
        **options,
    )


# -- facets: shape functions, areas, loads -----------------------------------------------------------------------------


@pytest.mark.parametrize("kind", FACET_KINDS)
def test_shape_functions_are_one_at_their_node_and_sum_to_one(kind):
    nodes = reference_nodes(kind)
    np.testing.assert_allclose(shape_functions(kind, nodes)[0], np.eye(len(nodes)), atol=1e-15)
    places, weights = quadrature(kind)
    values, slopes = shape_functions(kind, places)
    np.testing.assert_allclose(values.sum(axis=1), 1, atol=1e-14)
    assert weights.sum() == pytest.approx(0.5 if kind.startswith("tri") else 1.0, abs=1e-14)
    for axis, slope in enumerate(slopes):
        step = 1e-6 * np.eye(nodes.shape[1])[axis]
        change = shape_functions(kind, places + step)[0] - shape_functions(kind, places - step)[0]
        np.testing.assert_allclose(slope, change / 2e-6, atol=1e-8)


@pytest.mark.parametrize("kind", FACET_KINDS)
def test_pressure_all_round_has_no_resultant_and_works_on_the_volume(kind):
    points, facets = boundary(kind)
    force = pressure_load(points, facets, thickness=0.5 if kind.startswith("line") else 1.0, pressure=3.0)
    scale = np.abs(force).sum()
    assert np.abs(force.sum(axis=0)).max() < 1e-14 * scale
    assert np.abs(moment(points, force)).max() < 1e-13 * scale
    # Pushed inwards, pressure works −p ΔV: with the displacement u = x, ΔV = d V > 0.
    work = float(np.sum(force * points))
    assert work < 0
    if kind == "line":
        x, y = points.T
        assert work == pytest.approx(-3.0 * 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y), rel=1e-13)


@pytest.mark.parametrize("kind", FACET_KINDS)
def test_nodal_areas_are_positive_and_share_out_the_whole_area(kind):
    points, facets = boundary(kind)
    thickness = 0.25 if kind.startswith("line") else 1.0
    areas = nodal_areas(points, facets, thickness=thickness)
    total = facet_areas(points, facets, thickness=thickness)[kind].sum()
    assert areas.min() > 0.02 * areas.max()
    assert areas.sum() == pytest.approx(total, rel=1e-13)
    force = traction_load(points, facets, np.arange(1.0, 1 + points.shape[1]), thickness=thickness)
    np.testing.assert_allclose(force.sum(axis=0), total * np.arange(1.0, 1 + points.shape[1]), rtol=1e-12)


def test_areas_of_flat_quadratic_facets_are_those_of_the_positive_basis():
    points, facets = grid(1, "quad8")
    areas = nodal_areas(points, facets)
    corner = np.isin(points, [0.0, 1.0]).sum(axis=1) == 3
    np.testing.assert_allclose(areas[corner], 1 / 20, rtol=1e-12)
    np.testing.assert_allclose(areas[~corner], 1 / 5, rtol=1e-12)
    triangle = reference_nodes("triangle6")
    areas = nodal_areas(np.column_stack([triangle, np.zeros(6)]), {"triangle6": np.arange(6)[None]})
    np.testing.assert_allclose(areas / 0.5, np.repeat([2 / 15, 1 / 5], 3), rtol=1e-12)


def test_a_quadratic_circle_converges_with_the_fourth_power():
    lengths = []
    for count in (16, 32, 64):
        points, facets = circle(count, kind="line3")
        lengths.append(facet_areas(points, facets)["line3"].sum() / (2 * np.pi) - 1)
        # The resultant on a quarter hangs on its ends alone: p R along both axes.
        quarter = {"line3": facets["line3"][: count // 8]}
        np.testing.assert_allclose(pressure_load(points, quarter).sum(axis=0), [-1, -1], rtol=1e-13)
        np.testing.assert_allclose(nodal_normals(points, facets), points, atol=1e-12)
    orders = np.log2(np.abs(np.array(lengths[:-1]) / lengths[1:]))
    assert orders.min() > 3.9


def test_nodal_normals_point_outwards_in_space():
    points, facets = cylinder("quad9", around=16)
    normals = nodal_normals(points, facets)
    radial = np.column_stack([points[:, :2], 0 * points[:, 2]])
    np.testing.assert_allclose(normals, radial, atol=1e-12)


def test_a_body_s_corner_node_has_the_mean_normal_and_others_none():
    points, facets = rectangle(length=2.0, height=1.0, across=2, up=1)
    normals = nodal_normals(np.vstack([points, [9.0, 9.0]]), facets)
    np.testing.assert_allclose(normals[0], [-1 / math.sqrt(2)] * 2)
    np.testing.assert_allclose(normals[-1], 0)


# -- the curve ---------------------------------------------------------------------------------------------------------


def test_a_chain_is_ordered_whatever_the_order_of_its_facets():
    points = np.column_stack([np.arange(5.0), np.zeros(5)])
    chain = chain_of(points, {"line": np.array([[2, 1], [4, 3]]), "line3": np.array([[3, 2, 0]])}, where="w")
    assert chain.nodes.tolist() == [4, 3, 0, 2, 1]
    assert chain.facets.tolist() == [[0, 1, -1], [1, 3, 2], [3, 4, -1]]
    assert not chain.closed


@pytest.mark.parametrize(
    ("facets", "message"),
    [
        ([], "w: has no facets; a line of them is needed"),
        ([[0, 1], [2, 3], [4, 5]], "w: lies in 3 pieces that do not join; give each a boundary and contact of its own"),
        (
            [[0, 1], [1, 2], [2, 0], [3, 4]],
            "w: lies in 2 pieces that do not join; give each a boundary and contact of its own",
        ),
        ([[0, 1], [1, 2], [1, 3]], "w: branches or turns its side over at (1, 1) m; a single line is needed"),
        ([[0, 1], [2, 1]], "w: branches or turns its side over at (1, 1) m; a single line is needed"),
        ([[0, 1], [1, 6]], "w: has two neighbouring nodes in the same place, at (1, 1) m; merge them"),
    ],
)
def test_lines_that_are_no_single_chain_are_refused(facets, message):
    points = np.array([[k, k * k] for k in range(6)] + [[1, 1]], dtype=float)
    with pytest.raises(CaseError) as caught:
        Curve.from_facets(points, {"line": np.array(facets, dtype=int).reshape(-1, 2)}, where="w")
    assert str(caught.value) == message


def ring_of_points(count, low, high, seed=0):
    rng = np.random.default_rng(seed)
    angle, radius = rng.uniform(0, 2 * np.pi, count), rng.uniform(low, high, count)
    return radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]), radius


@pytest.mark.parametrize("hole", [False, True])
def test_gap_and_normal_of_a_circle_converge(hole):
    slaves, radius = ring_of_points(300, *((0.7, 0.999) if hole else (0.9, 5.0)))
    errors = []
    for count in (16, 32, 64):
        curve = Curve.from_facets(*circle(count, hole=hole), where="w")
        found = curve.locate(slaves)
        assert found.inside.all()
        sign = -1 if hole else 1
        errors.append(
            [
                np.abs(found.gap - sign * (radius - 1)).max(),
                np.abs(found.normal - sign * slaves / radius[:, None]).max(),
            ]
        )
        assert curve.chord_height == pytest.approx((2 * math.pi / count) ** 2 / 8, rel=0.05)
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders[:, 0].min() > 3.9
    assert orders[:, 1].min() > 2.8
    assert errors[-1][0] < 3e-6


def test_straight_boundaries_are_exact_up_to_the_corners_of_a_closed_one():
    curve = Curve.from_facets(*rectangle(), where="w")
    assert curve.closed
    assert sorted(map(tuple, curve.positions[curve.corners])) == [(0, 0), (0, 1), (4, 0), (4, 1)]
    slaves = np.array([[0.01, 1.2], [3.99, 0.9], [2.0, -0.3], [4.5, 0.999], [1.0, 1.0], [4.0, 0.5]])
    found = curve.locate(slaves)
    np.testing.assert_allclose(found.gap, [0.2, -0.01, 0.3, 0.5, 0.0, 0.0], atol=1e-14)
    np.testing.assert_allclose(found.normal, [[0, 1], [1, 0], [0, -1], [1, 0], [0, 1], [1, 0]], atol=1e-14)
    # Off a corner the gap is the distance from it.
    found = curve.locate(np.array([[4.3, 1.4], [4.0, 1.0]]))
    np.testing.assert_allclose(found.point, [[4, 1], [4, 1]], atol=1e-15)
    assert found.gap[0] == pytest.approx(0.5)
    np.testing.assert_allclose(found.normal[0], [0.6, 0.8])
    assert found.gap[1] == pytest.approx(0, abs=1e-15)
    assert found.inside.all()


def test_an_open_curve_is_left_over_its_ends_only():
    points = np.column_stack([np.linspace(1, 0, 6), np.zeros(6)])  # body below, normal up
    curve = Curve.from_facets(points, {"line": np.column_stack([np.arange(5), np.arange(1, 6)])}, where="w")
    found = curve.locate(np.array([[-0.1, 0.2], [0.0, 0.2], [1.0, -0.1], [1.0 + 1e-8, 0.1], [1.001, 0.1]]))
    assert found.inside.tolist() == [False, True, True, True, False]
    np.testing.assert_allclose(found.gap, [0.2, 0.2, -0.1, 0.1, 0.1], atol=1e-15)
    assert np.count_nonzero(found.weights[1]) == 1


def test_slaves_on_nodes_belong_to_the_node_alone():
    points, facets = circle(24)
    curve = Curve.from_facets(points, facets, where="w")
    found = curve.locate(curve.positions * 1.1)
    np.testing.assert_array_equal(np.count_nonzero(found.weights, axis=1), 1)
    np.testing.assert_array_equal(found.nodes[found.weights == 1], np.arange(24))


def second_differences(values):
    return np.abs(np.diff(values, 2, axis=0)).max()


def test_gap_and_normal_have_no_kink_where_a_slave_slides_over_nodes():
    """Second differences over a step shrink with its square where the slope is continuous, with itself at a kink."""
    points, facets = circle(16)
    curve = Curve.from_facets(points * [1.5, 1.0], facets, where="w")
    found = {}
    for step in (1e-3, 1e-4):
        node = curve.locate(curve.positions[3:4])
        along = step * np.arange(-20, 21)[:, None] * [-node.normal[0, 1], node.normal[0, 0]]
        at = curve.locate(curve.positions[3] + 0.05 * node.normal + along)
        assert len(np.unique(at.facet)) == 2
        found[step] = second_differences(at.gap), np.abs(np.diff(at.normal, axis=0)).max()
    assert found[1e-4][0] < 2e-2 * found[1e-3][0]
    assert found[1e-4][1] < 0.11 * found[1e-3][1]


def test_the_search_from_a_guess_finds_the_same():
    curve = Curve.from_facets(*circle(40), where="w")
    slaves, _ = ring_of_points(200, 0.95, 1.3)
    first = curve.locate(slaves)
    turned = slaves @ np.array([[math.cos(0.3), math.sin(0.3)], [-math.sin(0.3), math.cos(0.3)]])
    again, anew = curve.locate(turned, guess=first.facet), curve.locate(turned)
    np.testing.assert_allclose(again.gap, anew.gap, atol=1e-14)
    np.testing.assert_array_equal(again.facet, anew.facet)
    # Over a corner the walk ends and the search begins anew.
    box = Curve.from_facets(*rectangle(), where="w")
    top = box.locate(np.array([[3.9, 1.1]]))
    side = box.locate(np.array([[4.1, 0.5]]), guess=top.facet)
    np.testing.assert_allclose(side.normal, [[1, 0]], atol=1e-14)


# -- the facets --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", SPACE_KINDS)
def test_flat_surfaces_are_exact_inside_and_beyond_their_edges(kind):
    points, facets = grid(4, kind)
    surface = FacetSurface.from_facets(points, facets, where="w")
    rng = np.random.default_rng(1)
    slaves = np.column_stack([rng.uniform(-0.2, 1.2, (400, 2)), rng.uniform(-0.1, 0.3, 400)])
    found = surface.locate(slaves)
    within = np.all((slaves[:, :2] >= 0) & (slaves[:, :2] <= 1), axis=1)
    np.testing.assert_array_equal(found.inside, within)
    np.testing.assert_allclose(found.gap, slaves[:, 2], atol=1e-15)
    np.testing.assert_allclose(found.point[:, :2], np.clip(slaves[:, :2], 0, 1), atol=1e-14)
    np.testing.assert_allclose(found.normal, np.tile([0, 0, 1.0], (400, 1)), atol=1e-15)
    np.testing.assert_allclose(found.weights.sum(axis=1), 1, atol=1e-14)
    carried = np.einsum("mr,mrd->md", found.weights, surface.positions[found.nodes])
    np.testing.assert_allclose(carried, found.point, atol=1e-15)


@pytest.mark.parametrize("kind", SPACE_KINDS)
def test_nodes_edges_and_vertices_of_the_surface_are_inside(kind):
    points, facets = grid(3, kind)
    surface = FacetSurface.from_facets(points, facets, where="w")
    at_nodes = surface.locate(surface.positions)
    assert at_nodes.inside.all()
    np.testing.assert_array_equal(np.count_nonzero(at_nodes.weights, axis=1), 1)
    middles = 0.5 * (surface.positions[surface.facets[:, 0]] + surface.positions[surface.facets[:, 1]])
    assert surface.locate(middles + np.array([0, 0, 0.01])).inside.all()
    edge = np.array([[1 + 1e-8, 0.5, 0.0], [1 + 1e-5, 0.5, 0.0]])
    assert surface.locate(edge).inside.tolist() == [True, False]


def around_a_cylinder() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Radii (300,), directions and places (300, 3) of points around a cylinder of radius one."""
    rng = np.random.default_rng(5)
    angle, radius, z = rng.uniform(0, 7, 300), rng.uniform(0.9, 1.5, 300), rng.uniform(0, 1, 300)
    radial = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    slaves = radius[:, None] * radial + z[:, None] * [0, 0, 1]
    return radius, radial, slaves


@pytest.mark.parametrize("kind", QUADRATIC)
def test_gap_of_a_cylinder_of_quadratic_faces_is_wrong_to_fourth_order_and_its_normal_exact(kind):
    """As the faces interpolate the circle: R(1 − |Σ φ n|), of the order of the fourth power of their angle."""
    errors = []
    radius, radial, slaves = around_a_cylinder()
    for around in (8, 16):
        surface = FacetSurface.from_facets(*cylinder(kind, around, around // 4), where="w")
        found = surface.locate(slaves)
        assert found.inside.all()
        errors.append([np.abs(found.gap - (radius - 1)).max(), np.abs(found.normal - radial).max()])
        carried = np.einsum("mr,mrd->md", found.weights, surface.positions[found.nodes])
        np.testing.assert_allclose(carried, found.point, atol=1e-15)
    # Faces of 45°: parabolas are off the circle by 7.3e-4 of its radius at most, linear parts were by 2e-2 to 4e-2.
    assert errors[0][0] < 7.3e-4
    assert math.log2(errors[0][0] / errors[1][0]) == pytest.approx(4, abs=0.2)
    assert errors[1][1] < 1e-14


@pytest.mark.parametrize("kind", LINEAR)
def test_gap_of_a_cylinder_is_wrong_by_the_chord_height_and_its_normal_exact(kind):
    errors = []
    radius, radial, slaves = around_a_cylinder()
    for around in (16, 32):
        surface = FacetSurface.from_facets(*cylinder(kind, around, around // 4), where="w")
        found = surface.locate(slaves)
        assert found.inside.all()
        error = found.gap - (radius - 1)
        # Facets lie below a convex surface: gaps are never too small, and too large by h²/8R at most.
        assert error.min() > -1e-12
        assert error.max() < 1.02 * surface.chord_height
        errors.append([error.max(), np.abs(found.normal - radial).max()])
    assert math.log2(errors[0][0] / errors[1][0]) == pytest.approx(2, abs=0.1)
    assert errors[1][1] < 1e-14


def test_gap_and_normal_are_continuous_over_edges_and_nodes():
    surface = FacetSurface.from_facets(*cylinder("triangle", 24, 6), where="w")
    for step in (1e-3, 1e-5):
        along = step * np.arange(-15, 16)
        angle = 2 * math.pi * 5 / 24 + along  # diagonally over the node at z = 3/6
        slaves = np.column_stack([1.02 * np.cos(angle), 1.02 * np.sin(angle), 0.5 + 0.3 * along])
        found = surface.locate(slaves)
        assert len(np.unique(found.facet)) > 1
        assert np.abs(np.diff(found.gap)).max() < 0.3 * step
        assert np.abs(np.diff(found.normal, axis=0)).max() < 1.5 * step
        # Not over one edge either does the normal turn by steps: its own slope changes, no more.
        assert second_differences(found.normal) < 0.5 * step


@pytest.mark.parametrize("kind", SPACE_KINDS)
def test_nodes_over_the_rim_of_a_cylinder_stay_in_contact(kind):
    """Facets of an irregular mesh tilt the normals at the rim; farther out is outside all the same."""
    points, facets = cylinder(kind, 24, 6)
    inner = (points[:, 2] > 0) & (points[:, 2] < 1)
    jitter = inner[:, None] * np.random.default_rng(0).uniform(-0.02, 0.02, (len(points), 2))
    angle = np.arctan2(points[:, 1], points[:, 0]) + jitter[:, 0]
    points = np.column_stack([np.cos(angle), np.sin(angle), points[:, 2] + jitter[:, 1]])
    surface = FacetSurface.from_facets(points, facets, where="w")
    angle = np.linspace(0, 6.2, 60)
    rim = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    for gap in (0.0, 0.01):
        assert surface.locate(rim * (1 + gap)).inside.all()
        assert not surface.locate(rim * (1 + gap) - [0, 0, 0.01]).inside.any()


def box_surface(kind="quad", cells=3):
    points, facets = closed_body(kind, cells, bulge=0.0)
    return FacetSurface.from_facets(points, facets, where="w")


def test_sharp_edges_keep_their_own_normals():
    box = box_surface()
    slaves = np.array(
        [[0.5, 0.99, 1.1], [0.5, 0.98, 0.99], [1.3, 1.4, 0.5], [1.0, 1.0, 0.5], [1.2, 1.2, 1.1], [0.4, -0.2, 0.7]]
    )
    found = box.locate(slaves)
    assert found.inside.all()
    np.testing.assert_allclose(found.gap, [0.1, -0.01, 0.5, 0, 0.3, 0.2], atol=1e-14)
    np.testing.assert_allclose(found.normal[:3], [[0, 0, 1], [0, 0, 1], [0.6, 0.8, 0]], atol=1e-14)
    np.testing.assert_allclose(found.normal[4], np.array([2, 2, 1]) / 3, atol=1e-14)
    again = box.locate(slaves, guess=np.zeros(6, dtype=int))
    np.testing.assert_allclose(again.gap[2:], found.gap[2:], atol=1e-14)


def test_a_displaced_surface_is_found_where_it_is():
    surface = FacetSurface.from_facets(*cylinder("quad", 24, 4), where="w")
    turn = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0.0]])
    moved = surface.positions @ turn.T + [3, 4, 5]
    rng = np.random.default_rng(0)
    slaves = np.column_stack([rng.uniform(-1, 1, (50, 2)) + np.array([1.2, 0]), rng.uniform(0.1, 0.9, 50)])
    before = surface.locate(slaves)
    after = surface.locate(slaves @ turn.T + [3, 4, 5], moved - surface.positions, guess=before.facet)
    np.testing.assert_allclose(after.gap, before.gap, atol=1e-13)
    np.testing.assert_allclose(after.normal, before.normal @ turn.T, atol=1e-12)


def test_surfaces_that_are_none_are_refused():
    points, facets = grid(2)
    flipped = facets["quad"].copy()
    flipped[0] = flipped[0, ::-1]
    for bad, message in (
        (
            {"quad": flipped},
            "w: two facets pass the edge at (0.25, 0.5, 0) m in the same direction: they overlap, "
            "branch or disagree about the outside; repair the mesh there",
        ),
        (
            {"triangle": np.array([[0, 1, 2]])},
            "w: the facet at (0.5, 0, 0) m has no area; merge its nodes or leave it out",
        ),
        ({}, "w: has no facets; triangles or quadrilaterals are needed"),
    ):
        with pytest.raises(CaseError) as caught:
            FacetSurface.from_facets(points, bad, where="w")
        assert str(caught.value) == message


def test_ten_thousand_slaves_on_ten_thousand_facets_take_less_than_half_a_second():
    surface = FacetSurface.from_facets(*grid(100), where="w")
    surface.locate(np.full((1, 3), 0.5))  # compiles
    slaves = np.random.default_rng(0).uniform(-0.02, 1.02, (10_000, 3))
    took = []
    for _ in range(3):
        start = time.perf_counter()
        surface.locate(slaves)
        took.append(time.perf_counter() - start)
    assert min(took) < 0.5


# -- obstacles ---------------------------------------------------------------------------------------------------------


def test_obstacles_give_gaps_of_either_sign():
    flat = Flat(np.array([0.0, 1.0]), np.array([0.0, 2.0]))
    np.testing.assert_allclose(flat.locate(np.array([[3.0, 1.5], [0.0, 0.0]])).gap, [0.5, -1.0])
    shaft = Cylinder(np.zeros(3), 1.0, axis=np.array([0, 0, 2.0]))
    found = shaft.locate(np.array([[2.0, 0, 5.0], [0.0, 0.5, -1.0], [0, 0, 0.0]]))
    np.testing.assert_allclose(found.gap, [1, -0.5, -1])
    np.testing.assert_allclose(found.point[:2], [[1, 0, 5], [0, 1, -1]])
    assert np.linalg.norm(found.normal, axis=1) == pytest.approx(1)
    bore = Cylinder(np.array([1.0, 0]), 2.0, inside=True)
    found = bore.locate(np.array([[2.0, 0.0], [1.0, 2.5]]))
    np.testing.assert_allclose(found.gap, [1, -0.5])
    np.testing.assert_allclose(found.normal, [[-1, 0], [0, -1]])
    assert (flat.dimension, shaft.dimension, bore.node_count) == (2, 3, 0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Flat(np.zeros(2), np.zeros(2)), "obstacle.normal: [0.0, 0.0] – expected a direction; zero has none"),
        (lambda: Flat(np.zeros(2), np.ones(3)), "obstacle.normal: [1.0, 1.0, 1.0] – expected 2 finite numbers"),
        (lambda: Cylinder(np.zeros(2), -1.0), "obstacle.radius: -1.0 – a cylinder needs a radius above 0 m"),
        (
            lambda: Cylinder(np.zeros(3), 1.0),
            "obstacle.axis: a cylinder in space needs the direction of its axis, such as [0, 0, 1]",
        ),
    ],
)
def test_obstacles_that_are_none_are_refused(make, message):
    with pytest.raises(CaseError) as caught:
        make()
    assert str(caught.value) == message


# -- pairing and its operators -----------------------------------------------------------------------------------------


def current_gap(pair, u):
    """The gap at freedoms u, by a new search."""
    count, d = pair.slave_position.shape
    displaced = (pair.slave.free @ u).reshape(count, d)
    master = (pair.master_rows.free @ u).reshape(-1, d) if pair.master.node_count else np.zeros((0, d))
    return pair.master.locate(pair.slave_position + displaced, master, guess=pair.location.facet).gap


def plane_pair(gap=0.05):
    """Slave points around a circle, the master."""
    curve = Curve.from_facets(*circle(20), where="w")
    angle = np.linspace(0.1, 6.0, 15)
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    return contact((1 + gap) * out, -out, curve)


def flat_pair(gap=0.05, kind="quad"):
    surface = FacetSurface.from_facets(*grid(4, kind), where="w")
    rng = np.random.default_rng(3)
    position = np.column_stack([rng.uniform(0.1, 0.9, (12, 2)), np.full(12, gap)])
    return contact(position, np.tile([0, 0, -1.0], (12, 1)), surface)


def round_pair(gap=0.02, around=24, kind="quad"):
    surface = FacetSurface.from_facets(*cylinder(kind, around, 4), where="w")
    rng = np.random.default_rng(3)
    angle = rng.uniform(0, 6, 12)
    out = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    return contact((1 + gap) * out + rng.uniform(0.2, 0.8, (12, 1)) * [0, 0, 1], -out, surface)


@pytest.mark.parametrize("kind", QUADRATIC)
def test_nodes_over_quadratic_faces_follow_these_at_the_start_and_as_they_slide(kind):
    """Rows applied to places give the gap: they know the very point of the face that the gap is measured to."""
    pair = round_pair(0.02, 8, kind)
    assert pair.nodes.gap == pytest.approx(np.full(12, 0.02), abs=7.3e-4)
    places = np.concatenate([pair.slave_position.ravel(), pair.master.positions.ravel()])
    np.testing.assert_allclose(pair.nodes.normal @ places, pair.nodes.gap, atol=1e-14)
    turn = np.array([[np.cos(0.3), -np.sin(0.3), 0], [np.sin(0.3), np.cos(0.3), 0], [0, 0, 1]])
    slid, left = repair(
        pair, pair.slave_position @ (turn - np.eye(3)).T, pair.master.positions @ (turn - np.eye(3)).T
    )  # fmt: skip
    assert not len(left)
    np.testing.assert_allclose(slid.location.gap, pair.nodes.gap, atol=1e-14)
    np.testing.assert_allclose(slid.location.weights, pair.location.weights, atol=1e-9)
    turns = np.linspace(0, 0.9, 12)  # over a face, and past its edges
    gaps = [
        repair(pair, np.column_stack([*(pair.slave_position[:, :2] @ [[c, s], [-s, c]]).T, pair.slave_position[:, 2]])
               - pair.slave_position, np.zeros_like(pair.master.positions))[0].location.gap
        for c, s in zip(np.cos(turns), np.sin(turns), strict=True)
    ]  # fmt: skip
    assert np.abs(np.array(gaps) - 0.02).max() < 7.3e-4


@pytest.mark.parametrize("gap", [0.0, 0.2])
def test_the_normal_row_on_a_curve_is_the_derivative_of_the_gap(gap):
    pair = plane_pair(gap)
    rng = np.random.default_rng(7)
    for _ in range(4):
        u = rng.standard_normal(pair.nodes.normal.shape[1])
        step = 1e-6
        slope = (current_gap(pair, step * u) - current_gap(pair, -step * u)) / (2 * step)
        np.testing.assert_allclose(pair.nodes.normal @ u, slope, atol=2e-8)


def test_the_normal_row_on_a_flat_surface_is_the_derivative_of_the_gap():
    pair = flat_pair(gap=0.0)
    rng = np.random.default_rng(7)
    for _ in range(4):
        u = rng.standard_normal(pair.nodes.normal.shape[1])
        slope = (current_gap(pair, 1e-6 * u) - current_gap(pair, -1e-6 * u)) / 2e-6
        np.testing.assert_allclose(pair.nodes.normal @ u, slope, atol=1e-8)
    slave_only = np.zeros(pair.nodes.normal.shape[1])
    slave_only[: pair.slave_position.size] = rng.standard_normal(pair.slave_position.size)
    np.testing.assert_allclose(pair.nodes.normal @ slave_only, current_gap(pair, slave_only * 0.01) * 100, atol=1e-12)


def test_the_normal_row_on_a_faceted_cylinder_misses_what_facets_turn():
    """The neglected part n·X_ξ dξ is of first order in the angle between facet and normal: halved with the facets."""
    missing = []
    for around in (16, 32, 64):
        pair = round_pair(0.0, around)
        rng = np.random.default_rng(7)
        slave = rng.standard_normal(pair.slave_position.size)
        u = np.zeros(pair.nodes.normal.shape[1])
        u[: len(slave)] = slave
        slope = (current_gap(pair, 1e-7 * u) - current_gap(pair, -1e-7 * u)) / 2e-7
        missing.append(np.abs(pair.nodes.normal @ u - slope).max())
        assert missing[-1] < 1.1 * np.pi / around * np.linalg.norm(slave.reshape(-1, 3), axis=1).max()
    assert missing[2] < 0.5 * missing[0]


@pytest.mark.parametrize("make", [plane_pair, flat_pair, round_pair])
def test_moving_both_bodies_together_moves_neither_against_the_other(make):
    pair = make()
    d = pair.slave_position.shape[1]
    for axis in range(d):
        together = np.tile(np.eye(d)[axis], pair.nodes.normal.shape[1] // d)
        assert np.abs(pair.nodes.normal @ together).max() < 1e-14
        assert np.abs(pair.nodes.tangent @ together).max() < 1e-14


@pytest.mark.parametrize("make", [plane_pair, flat_pair, round_pair])
def test_contact_forces_balance_and_without_a_gap_their_moments_too(make):
    for gap in (0.0, 0.05):
        pair = make(gap)
        rng = np.random.default_rng(0)
        m, d = pair.slave_position.shape
        pressure = rng.uniform(1, 2, m)
        force = pair.nodes.normal.T @ pressure + pair.nodes.tangent.T @ rng.standard_normal((d - 1) * m)
        force = force.reshape(-1, d)
        assert np.abs(force.sum(axis=0)).max() < 1e-13 * np.abs(force).sum()
        # Moments about the places where the forces act: where the gap is closed these are one and the same.
        force = (pair.nodes.normal.T @ pressure).reshape(-1, d)
        where = np.concatenate([pair.slave_position, pair.master.positions])
        assert np.abs(moment(where, force)).max() < 1e-13 * np.abs(force).sum()


def test_friction_moments_balance_where_the_gap_is_closed():
    flat = flat_pair(0.0)
    rng = np.random.default_rng(0)
    force = (flat.nodes.tangent.T @ rng.standard_normal(24)).reshape(-1, 3)
    where = np.concatenate([flat.slave_position, flat.master.positions])
    assert np.abs(moment(where, force)).max() < 1e-13 * np.abs(force).sum()


def test_areas_of_a_contact_sum_to_the_boundary():
    points, facets = rectangle(length=2.0, height=1.0, across=6, up=2)
    low = {"line": facets["line"][:6]}
    nodes = np.arange(7)
    area = nodal_areas(points, low, thickness=0.02)[nodes]
    pair = contact(points[nodes], nodal_normals(points, low)[nodes], Flat(np.zeros(2), np.array([0, 1.0])), area)
    assert pair.nodes.area.sum() == pytest.approx(2.0 * 0.02, rel=1e-14)
    assert pair.nodes.gap == pytest.approx(0, abs=1e-15)


def test_only_nodes_that_face_the_master_take_part():
    """A cylinder over a plane (Hertz): the lower half, whatever its gap; with a reach only what is near."""
    points, facets = circle(40)
    normals = nodal_normals(points, facets)
    position = points + np.array([0.0, 1.0])
    plane = Curve.from_facets(
        np.column_stack([np.linspace(3, -3, 31), np.zeros(31)]),
        {"line": np.column_stack([np.arange(30), np.arange(1, 31)])},
        where="w",
    )
    pair = contact(position, normals, plane)
    assert pair.nodes.count == 19  # not the two that look sideways
    assert pair.slave_position[:, 1].max() < 1.0
    np.testing.assert_allclose(pair.nodes.gap, pair.slave_position[:, 1], atol=1e-14)
    near = contact(position, normals, plane, reach=0.1)
    assert near.nodes.gap.max() <= 0.1
    assert 0 < near.nodes.count < 19
    short = Curve.from_facets(np.array([[0.5, 0], [-0.5, 0]]), {"line": np.array([[0, 1]])}, where="w")
    assert np.abs(contact(position, normals, short).slave_position[:, 0]).max() <= 0.5


def flat_line():
    return Curve.from_facets(np.array([[1.0, 0], [0, 0]]), {"line": np.array([[0, 1]])}, where="w")


@pytest.mark.parametrize(
    ("position", "normal", "options", "message"),
    [
        ([0.5, 0.3], [0, -1.0], {"reach": 0.1},
         "contacts.touch: the bodies do not face each other: the nearest node of the slave is 0.3 m from the master, at (0.5, 0.3) m, beyond the reach of 0.1 m; move a body or set a longer reach"),
        ([0.5, 0.3], [0, 1.0], {},
         "contacts.touch: the bodies do not face each other: the nearest node of the slave is 0.3 m from the master, at (0.5, 0.3) m, and their outward normals do not oppose each other; check which boundaries are meant"),
        ([1.3, 0.4], [0, -1.0], {},
         "contacts.touch: the bodies do not face each other: the nearest node of the slave is 0.5 m from the master, at (1.3, 0.4) m, and none lies over the master; all are beyond its edges. Move a body or take a longer boundary"),
        ([0.5, -0.01], [0, -1.0], {"allowed_overlap": 1e-4},
         "contacts.touch: the bodies overlap: 1 node of the slave lies inside the master, the deepest by 0.01 m at (0.5, -0.01) m; up to 0.0001 m is allowed. Move the slave's body by 0.01 m along (0, 1), or the master's the opposite way"),
    ],
)  # fmt: skip
def test_bodies_that_do_not_meet_or_overlap_are_refused(position, normal, options, message):
    with pytest.raises(CaseError) as caught:
        contact(np.array([position]), np.array([normal]), flat_line(), **options)
    assert str(caught.value) == message


def test_a_ring_that_fits_its_bore_touches_however_it_is_meshed():
    """Facets of a bore cut into the shaft by h²/8R; that counts as touching, and with adjust as nothing at all."""
    surface = FacetSurface.from_facets(*cylinder("quad", 24, 4), where="w")
    bore = FacetSurface.from_facets(surface.positions, {"quad": surface.facets[:, ::-1]}, where="w")
    angle = np.linspace(0, 2 * np.pi, 49)[:-1]
    out = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    position = out + np.array([0, 0, 0.4])
    pair = contact(position, out, bore)
    height = 1 - math.cos(math.pi / 24)
    assert -1.01 * height < pair.nodes.gap.min() < -0.9 * height
    settled = contact(position, out, bore, adjust=True)
    np.testing.assert_allclose(settled.nodes.gap, 0, atol=1e-15)
    again, left = repair(settled, np.zeros_like(position), np.zeros_like(bore.positions))
    np.testing.assert_allclose(again.nodes.gap, 0, atol=1e-14)
    assert not len(left)
    with pytest.raises(CaseError, match="overlap"):
        contact(position * [1.1, 1.1, 1], out, bore)


@pytest.mark.parametrize("make", [plane_pair, flat_pair, round_pair])
def test_repaired_operators_give_the_present_gap_and_its_slope(make):
    pair = make()
    m, d = pair.slave_position.shape
    rng = np.random.default_rng(4)
    u = 0.03 * rng.standard_normal(pair.nodes.normal.shape[1])
    slave, master = u[: m * d].reshape(m, d), u[m * d :].reshape(-1, d)
    again, left = repair(pair, slave, master)
    assert not len(left)
    np.testing.assert_allclose(again.nodes.gap + again.nodes.normal @ u, current_gap(pair, u), atol=1e-14)
    assert np.abs(again.nodes.gap - pair.nodes.gap).max() > 1e-4
    if make is plane_pair:
        du = rng.standard_normal(len(u))
        slope = (current_gap(pair, u + 1e-6 * du) - current_gap(pair, u - 1e-6 * du)) / 2e-6
        np.testing.assert_allclose(again.nodes.normal @ du, slope, atol=1e-7)


def test_nodes_that_leave_the_master_are_named():
    position = np.array([[0.1, 0.0], [0.5, 0.0], [0.9, 0.0]])
    pair = contact(position, np.tile([0, -1.0], (3, 1)), flat_line())
    again, left = repair(pair, np.tile([0.2, 0.0], (3, 1)), np.zeros((2, 2)))
    assert left.tolist() == [2]
    assert again.nodes.count == 3
    # On an obstacle nothing is left.
    pair = contact(position, np.tile([0, -1.0], (3, 1)), Flat(np.zeros(2), np.array([0, 1.0])))
    again, left = repair(pair, np.tile([0.2, 0.1], (3, 1)), np.zeros((0, 2)))
    assert not len(left)
    np.testing.assert_allclose(again.nodes.gap + 0.1, 0.1, atol=1e-15)


def test_a_turning_shaft_slips_along_itself_at_the_nodes_that_take_part():
    """Drift belongs to nodes: it must stay with its own when others drop out, and after the contact is paired anew."""
    shaft = Cylinder(np.zeros(2), 0.5)
    angle = np.linspace(0, np.pi, 7)
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    normals = np.where(np.arange(7)[:, None] % 2, out, -out)  # every other node looks away
    drift = (2.0 * np.arange(7)[:, None] * np.column_stack([out[:, 1], -out[:, 0]]))[:, :, None]
    pair = contact(0.5 * out, normals, shaft, drift=drift)
    for again in (pair, repair(pair, 0.01 * pair.slave_position, np.zeros((0, 2)))[0]):
        np.testing.assert_allclose(again.nodes.slip_velocity(np.ones(1))[:, 0], [0, 4, 8, 12], atol=1e-14)
        assert np.abs(again.nodes.normal_lift).max() == 0


# -- whatever the shape ------------------------------------------------------------------------------------------------


@settings(max_examples=15)
@given(st.integers(0, 10_000), st.integers(12, 30))
def test_the_gap_of_any_smooth_curve_is_the_distance_from_it(seed, count):
    """Against a dense sampling of the curve itself."""
    rng = np.random.default_rng(seed)
    points, facets = circle(count)
    angle = np.arctan2(points[:, 1], points[:, 0])
    radius = 1 + 0.15 * rng.uniform(-1, 1) * np.cos(2 * angle + rng.uniform(0, 6))
    curve = Curve.from_facets(points * radius[:, None], facets, where="w")
    slaves, _ = ring_of_points(20, 0.9, 2.0, seed)
    found = curve.locate(slaves)
    dense = []
    for xi in np.linspace(0, 1, 60):
        weights, _ = weights_at(np.arange(count), np.full(count, xi), curve.stencils, curve.chords)
        dense.append(np.einsum("cr,crd->cd", weights, curve.positions[curve.stencils]))
    sampled = np.linalg.norm(slaves[:, None] - np.concatenate(dense), axis=2).min(axis=1)
    assert found.inside.all()
    assert np.all(np.abs(found.gap) <= sampled + 1e-12)
    np.testing.assert_allclose(np.abs(found.gap), sampled, atol=2e-3)
    np.testing.assert_allclose(found.weights.sum(axis=1), 1, atol=1e-13)


@settings(max_examples=15)
@given(st.integers(0, 10_000), st.sampled_from(SPACE_KINDS))
def test_places_on_any_bent_sheet_are_found_along_its_normals(seed, kind):
    """Points put over known places come back to them with their gap."""
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(-0.2, 0.2, 2)
    points, facets = patch(kind, lambda u, v: np.column_stack([u, v, a * u * u + b * u * v]), 4, 3)
    surface = FacetSurface.from_facets(points, facets, where="w")
    normals = surface.corner_normals(surface.positions)
    if kind in LINEAR:
        facet = rng.integers(0, len(surface.facets), 20)
        weights = rng.dirichlet([1, 1, 1], 20)
        corners = surface.facets[facet][:, :3]
        three = surface.facets[facet, 3] < 0
        place = np.einsum("mr,mrd->md", weights, surface.positions[corners])
        normal = np.einsum("mr,mrd->md", weights, normals[facet][:, :3])
    else:
        block = surface.blocks[kind]
        nodes = block[rng.integers(0, len(block), 20)]
        local = rng.dirichlet([1, 1, 1], 20)[:, :2]
        weights, three = shape_functions(kind, local)[0], np.ones(20, dtype=bool)
        at_nodes = np.zeros((surface.node_count, 3))
        at_nodes[surface.facets[surface.facets >= 0]] = normals[surface.facets >= 0]
        place = np.einsum("mr,mrd->md", weights, surface.positions[nodes])
        normal = np.einsum("mr,mrd->md", weights, at_nodes[nodes])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    gap = rng.uniform(-0.1, 0.2, 20)
    found = surface.locate(place + gap[:, None] * normal)
    assert found.inside[three].all()
    np.testing.assert_allclose(found.gap[three], gap[three], atol=1e-12)
    np.testing.assert_allclose(found.point[three], place[three], atol=1e-11)
    residual = found.point + found.gap[:, None] * found.normal - (place + gap[:, None] * normal)
    assert np.abs(residual[found.inside]).max(initial=0) < 1e-11


@pytest.mark.parametrize("kind", SPACE_KINDS)
def test_chords_lie_below_a_cylinder_by_their_sagitta(kind):
    """R (1 − cos(π/n)) with n chords around, and one and a half times that may a slave seem to overlap by."""
    radius, around = 0.7, 40
    parts = 1 if kind in ("triangle", "quad") else 2
    points, facets = cylinder(kind, around // parts, 6 // parts, radius, 0.6)
    surface = FacetSurface.from_facets(points, facets, where="m")
    sagitta = radius * (1 - math.cos(math.pi / around))
    # The middle of a quad8 lies on the chord between its middles, over twice the angle, and on that along the axis.
    deepest = 2 * sagitta if kind == "quad8" else sagitta
    assert surface.chord_height == pytest.approx(deepest, rel=0.01)
    if kind == "quad8":
        return
    normals = points * [1, 1, 0] / radius
    flat = Flat(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    assert overlap_tolerance(points, normals, flat) == pytest.approx(1.5 * sagitta, rel=0.01)
    assert overlap_tolerance(points, normals, surface) == pytest.approx(3.0 * sagitta, rel=0.01)


def test_a_polygon_lies_below_a_circle_by_its_sagitta():
    points, facets = circle(40, 0.7)
    normals = points / 0.7
    sagitta = 0.7 * (1 - math.cos(math.pi / 40))
    flat = Flat(np.zeros(2), np.array([0.0, 1.0]))
    assert overlap_tolerance(points, normals, flat) == pytest.approx(1.5 * sagitta, rel=0.01)
    assert Curve.from_facets(points, facets, where="m").chord_height == pytest.approx(sagitta, rel=0.01)
