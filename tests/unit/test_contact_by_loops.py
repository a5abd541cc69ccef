"""Contact of meshes on random input against what it stands for, worked out another way: nearest points by trying many,
integrals by their closed form, bases by what they have to do; and the words of what is refused."""

from __future__ import annotations

import inspect
import math
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.spatial import cKDTree

from stridor.contact import facets as facets_module
from stridor.contact import pairing, pieces, ties
from stridor.contact.clipping import common_triangles
from stridor.contact.coupling import (
    SlaveFacets,
    _areas,
    _dual,
    _shares,
    _values_of_basis,
    collocated,
    coupled,
    point_weights,
)
from stridor.contact.curve import Curve
from stridor.contact.facet_search import edge_coordinates, nearest_edges, shape_of
from stridor.contact.facets import FacetSurface
from stridor.contact.interface import Rows, pair
from stridor.contact.interpolation import _refined, _segments, element_weights
from stridor.contact.master import Location, MasterSurface
from stridor.contact.nodes import ContactNodes, approach, stack
from stridor.contact.obstacles import Cylinder, Flat
from stridor.contact.surfaces import _along, frames, operators
from stridor.errors import CaseError
from stridor.laws import Coulomb, StaticKinetic, Tabulated, Weakening
from stridor.laws.friction import Shared
from stridor.mesh.facets import quadrature, reference_nodes, shape_functions

# What NumPy warns of is a fault here, whatever comes of it.
pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")

KINDS = ("triangle", "quad", "triangle6", "quad8", "quad9")


def bent(kind: str, rng, *, by: float = 0.05) -> np.ndarray:
    """Nodes (r, 3) of a facet, its places turned and sheared and each moved a little."""
    places = reference_nodes(kind)
    return places @ np.array([[1.2, 0.2, 0.1], [-0.3, 0.9, 0.2]]) + by * rng.normal(size=(len(places), 3))


# -- lists of nodes ----------------------------------------------------------------------------------------------------


def listed(rng, names: tuple[str, ...], m: int, n: int, d: int, *, closed=()) -> ContactNodes:
    owner = np.sort(rng.integers(0, len(names), size=m))
    laws = tuple([Coulomb(0.1), Weakening(0.2, 0.6, 0.5), StaticKinetic(0.3, 0.4)][: len(names)])
    return ContactNodes(
        names, owner, laws, sp.csr_array(rng.normal(size=(m, n))), sp.csr_array(rng.normal(size=((d - 1) * m, n))),
        rng.normal(size=(m, 2)), rng.normal(size=((d - 1) * m, 2)), rng.normal(size=m), rng.random(m),
        np.where(np.arange(m) % 3 == 0, 0.0, rng.random(m)), rng.normal(size=(m, d)), rng.normal(size=(m, d)),
        rng.normal(size=(m, d - 1, d)), rng.random(m) * (np.arange(m) % 3 == 1), closed,
    )  # fmt: skip


@pytest.mark.parametrize("d", [2, 3])
def test_several_contacts_are_one_list(d: int) -> None:
    rng = np.random.default_rng(1)
    parts = [listed(rng, ("a", "b"), 5, 7, d), listed(rng, ("c",), 3, 7, d, closed=(True,)), listed(rng, ("d",), 2, 7, d)]
    whole = stack(parts, 7, 2, d)
    assert whole.names == ("a", "b", "c", "d")
    assert whole.laws == tuple(law for part in parts for law in part.laws)
    assert whole.closed == (False, False, True, False)
    assert list(whole.owner) == [*parts[0].owner, 2, 2, 2, 3, 3]
    assert list(whole.kept) == [False] * 5 + [True] * 3 + [False] * 2
    assert (whole.count, whole.directions) == (10, d - 1)
    for name in ("gap", "area", "compliance", "cubic", "position", "normals", "tangents", "normal_lift", "tangent_lift"):
        assert np.array_equal(getattr(whole, name), np.concatenate([getattr(p, name) for p in parts])), name
    for name in ("normal", "tangent"):
        assert np.array_equal(getattr(whole, name).toarray(), np.concatenate([getattr(p, name).toarray() for p in parts]))
    chosen = np.array([7, 2, 9])
    for pick in (chosen, np.isin(np.arange(10), chosen)):
        some, index = whole.select(pick), chosen if pick is chosen else np.sort(chosen)
        rows = [(d - 1) * i + k for i in index for k in range(d - 1)]
        for name in ("gap", "area", "compliance", "cubic", "position", "normals", "tangents", "normal_lift", "owner"):
            assert np.array_equal(getattr(some, name), getattr(whole, name)[index]), name
        assert np.array_equal(some.normal.toarray(), whole.normal.toarray()[index])
        assert np.array_equal(some.tangent.toarray(), whole.tangent.toarray()[rows])
        assert np.array_equal(some.tangent_lift, whole.tangent_lift[rows])
        assert (some.names, some.closed) == (whole.names, whole.closed)
    direction = rng.normal(size=(10, d - 1))
    found = whole.along(direction).toarray()
    for i in range(10):
        rows = whole.tangent.toarray()[(d - 1) * i : (d - 1) * (i + 1)]
        assert found[i] == pytest.approx(direction[i] @ rows)
    factors = rng.normal(size=2)
    slip = whole.slip_velocity(factors)
    assert slip.shape == (10, d - 1)
    assert slip.ravel() == pytest.approx(whole.tangent_lift @ factors)


@pytest.mark.parametrize("d", [2, 3])
def test_no_contact_at_all_is_a_list_of_none(d: int) -> None:
    none = stack([], 7, 2, d)
    assert (none.count, none.directions, none.names, none.laws, none.closed) == (0, d - 1, (), (), ())
    assert (none.normal.shape, none.tangent.shape) == ((0, 7), (0, 7))
    assert (none.normal_lift.shape, none.tangent_lift.shape) == ((0, 2), (0, 2))
    assert (none.position.shape, none.normals.shape, none.tangents.shape) == ((0, d), (0, d), (0, d - 1, d))
    assert none.gap.shape == none.area.shape == none.compliance.shape == none.cubic.shape == none.owner.shape == (0,)
    assert none.kept.shape == (0,)


def test_friction_of_nodes_is_that_of_their_contacts_at_their_speeds() -> None:
    rng = np.random.default_rng(2)
    nodes = listed(rng, ("a", "b", "c"), 30, 4, 3)
    speeds = 2 * rng.random(30)
    laws = [nodes.laws[k] for k in nodes.owner]
    assert nodes.friction_coefficients(speeds) == pytest.approx([w.sliding(v) for w, v in zip(laws, speeds, strict=True)])
    own = nodes.friction_coefficients(speeds)
    slopes = np.array([w.slope(v) for w, v in zip(laws, speeds, strict=True)])
    assert nodes.friction_slopes(speeds, own) == pytest.approx(slopes)
    # A law scaled to another coefficient has its slope in proportion, whichever share of a common one that is.
    factor = 0.5 + rng.random(30)
    shares = replace(nodes, laws=tuple(Shared(law, 0.3) for law in nodes.laws))
    assert np.abs(slopes).max() > 0.01
    for given in (nodes, shares):
        assert given.friction_slopes(speeds, factor * own) == pytest.approx(factor * slopes)
    table = replace(nodes, laws=(Tabulated((0.0, 1.0), (0.3, 0.3)), *nodes.laws[1:]))
    assert table.friction_coefficients(speeds)[nodes.owner == 0] == pytest.approx(0.3)


def test_layers_that_harden_have_the_approach_of_their_force_and_its_tangent() -> None:
    rng = np.random.default_rng(3)
    force, stiffness, cubic = rng.random((3, 20)) * np.array([[5.0], [100], [1e7]])
    cubic[:4] = 0.0
    found = approach(force, stiffness, cubic)
    assert not found[:4].any()
    assert (stiffness * found + cubic * found**3)[4:] == pytest.approx(force[4:], rel=1e-12)
    nodes = listed(rng, ("a", "b"), 12, 4, 2, closed=(False, True))
    normal = 10.0 * rng.normal(size=12)
    at = nodes.at_force(normal)
    for i in range(12):
        k3, compliance, p = nodes.cubic[i], nodes.compliance[i], normal[i]
        p = abs(p) if nodes.kept[i] else max(p, 0.0)
        if k3 == 0.0:
            assert at.compliance[i] == compliance
            continue
        step = 1e-6
        ways = approach(np.array([p + step, p]), np.full(2, 1 / compliance), np.full(2, k3))
        assert at.compliance[i] == pytest.approx((ways[0] - ways[1]) / step, rel=1e-5)
    plain = replace(nodes, cubic=np.zeros(12))
    assert plain.at_force(normal) is plain


# -- frames and rows ---------------------------------------------------------------------------------------------------


def test_frames_are_right_handed_and_follow_the_direction_of_sliding() -> None:
    rng = np.random.default_rng(4)
    normal = rng.normal(size=(20, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal[0] = [0, 0, 1]
    sliding = rng.normal(size=(20, 3))
    sliding[0], sliding[1], sliding[2] = [0, 0, 5.0], 0.9e-9 * sliding[1], 0.0
    largest = max(np.linalg.norm(s - (s @ n) * n) for s, n in zip(sliding, normal, strict=True))
    sliding[3] = 3e-9 * largest * np.cross(normal[3], [1.0, 0, 0]) / np.linalg.norm(np.cross(normal[3], [1.0, 0, 0]))
    for preferred in (None, sliding, np.zeros((20, 3))):
        found = frames(normal, preferred)
        for i in range(20):
            both = np.concatenate([found[i], normal[i : i + 1]])
            assert both @ both.T == pytest.approx(np.eye(3), abs=1e-12)
            assert np.cross(found[i, 0], found[i, 1]) == pytest.approx(normal[i])
            axis = np.eye(3)[np.argmin(np.abs(normal[i]))]
            if preferred is sliding and i not in (0, 1, 2):
                axis = sliding[i]
            flat = axis - (axis @ normal[i]) * normal[i]
            assert found[i, 0] == pytest.approx(flat / np.linalg.norm(flat), abs=1e-9), i
    plane = frames(np.array([[0.6, 0.8]]))
    assert plane.shape == (1, 1, 2)
    assert plane[0, 0] == pytest.approx([0.8, -0.6])


@pytest.mark.parametrize("d", [2, 3])
def test_rows_of_nodes_are_sums_over_what_they_hang_on(d: int) -> None:
    rng = np.random.default_rng(5)
    weights = rng.normal(size=(4, 6)) * (rng.random((4, 6)) < 0.6)
    directions = rng.normal(size=(4, 2, d))
    found = _along(sp.csr_array(weights), directions).toarray()
    u = rng.normal(size=(6, d))
    for i in range(4):
        for q in range(2):
            assert found[2 * i + q] @ u.ravel() == pytest.approx(sum(weights[i, j] * directions[i, q] @ u[j] for j in range(6)))
    # Slave minus master, prescribed motions and the drift of material through its mesh.
    n, k, p = 5, 3, 2
    slave = Rows(sp.csr_array(rng.normal(size=(4 * d, n))), rng.normal(size=(4 * d, p)))
    master = Rows(sp.csr_array(rng.normal(size=(k * d, n))), rng.normal(size=(k * d, p)))
    normal = np.array([np.linalg.qr(rng.normal(size=(d, d)))[0][0] for _ in range(4)])
    on = np.stack([np.zeros(4, dtype=int), np.full(4, 2)], axis=1)
    location = Location(on, np.tile([0.25, 0.75], (4, 1)), np.zeros((4, d)), normal, rng.normal(size=4), on[:, 0], np.ones(4, bool))
    drift, area = rng.normal(size=(4, d, p)), 0.5 + rng.random(4)
    for stiffness in (2e3, np.inf):
        nodes = operators(
            "c", slave=slave, slave_position=rng.normal(size=(4, d)), area=area, master_rows=master, drift=drift,
            stiffness_per_area=stiffness, law=Coulomb(0.2), location=location,
        )  # fmt: skip
        assert nodes.compliance == pytest.approx(1 / (stiffness * area))
        assert nodes.tangents == pytest.approx(frames(normal, drift.sum(axis=2)))
        for i in range(4):
            own = slice(d * i, d * (i + 1))
            below = 0.25 * master.free.toarray()[:d] + 0.75 * master.free.toarray()[2 * d :]
            lifted = slave.lift[own] - 0.25 * master.lift[:d] - 0.75 * master.lift[2 * d :]
            relative = slave.free.toarray()[own] - below
            assert nodes.normal.toarray()[i] == pytest.approx(normal[i] @ relative)
            assert nodes.normal_lift[i] == pytest.approx(normal[i] @ lifted)
            for q in range(d - 1):
                assert nodes.tangent.toarray()[(d - 1) * i + q] == pytest.approx(nodes.tangents[i, q] @ relative)
                assert nodes.tangent_lift[(d - 1) * i + q] == pytest.approx(nodes.tangents[i, q] @ (lifted + drift[i]))
    assert (nodes.gap == location.gap).all()
    assert list(nodes.owner) == [0] * 4


# -- obstacles ---------------------------------------------------------------------------------------------------------


def test_gaps_to_flats_and_cylinders() -> None:
    rng = np.random.default_rng(6)
    for d in (2, 3):
        at, point, normal = rng.normal(size=(8, d)), rng.normal(size=d), 3.0 * rng.normal(size=d)
        found = Flat(point, normal).locate(at)
        unit = normal / np.linalg.norm(normal)
        assert found.gap == pytest.approx([(x - point) @ unit for x in at])
        assert found.normal == pytest.approx(np.tile(unit, (8, 1)))
        assert found.point == pytest.approx(at - found.gap[:, None] * unit)
        axis = None if d == 2 else np.array([1.0, 2.0, 2.0])
        for inside in (False, True):
            cylinder = Cylinder(point, 0.7, axis=axis, inside=inside)
            found = cylinder.locate(at)
            for i, x in enumerate(at):
                offset = x - point
                if axis is not None:
                    offset = offset - (offset @ axis / 9.0) * axis
                distance, out = math.sqrt(offset @ offset), offset / math.sqrt(offset @ offset)
                assert found.gap[i] == pytest.approx(0.7 - distance if inside else distance - 0.7)
                assert found.normal[i] == pytest.approx(-out if inside else out)
                assert found.point[i] == pytest.approx(x - offset + 0.7 * out)
            # On the axis any normal to it will do; within rounding of the radius a point is on it.
            for off, on in ((0.6e-12, True), (0.8e-12, False)):
                beside = np.zeros(d)
                beside[0] = off
                origin = Cylinder(np.zeros(d), 0.7, axis=None if d == 2 else np.array([0.0, 0, 1]), inside=inside)
                middle = origin.locate(beside[None] * (-1.0 if d == 2 else 1.0))
                assert np.linalg.norm(middle.normal[0]) == pytest.approx(1.0)
                if d == 2:
                    assert middle.normal[0] == pytest.approx((1.0 if on else -1.0) * np.array([-1.0 if inside else 1.0, 0]))
                else:
                    assert middle.normal[0, 2] == 0.0
        assert (found.nodes.shape, found.weights.shape, found.local.shape) == ((8, 0), (8, 0), (8, 0))
        assert found.inside.all()
        assert (cylinder.node_count, cylinder.dimension, Flat(point, normal).node_count) == (0, d, 0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Flat(np.zeros(2), np.zeros(2), "wall"), "wall.normal: [0.0, 0.0] – expected a direction; zero has none"),
        (lambda: Flat(np.zeros(2), np.ones(3), "wall"), "wall.normal: [1.0, 1.0, 1.0] – expected 2 finite numbers"),
        (lambda: Flat(np.zeros(4), np.ones(4), "wall"), "expected 2 or 3 finite numbers"),
        (lambda: Cylinder(np.zeros(2), 0.0, name="shaft"), "shaft.radius: 0.0 – a cylinder needs a radius above 0 m"),
        (lambda: Cylinder(np.zeros(2), math.inf), "a cylinder needs a radius above 0 m"),
        (lambda: Cylinder(np.zeros(3), 1.0), "a cylinder in space needs the direction of its axis, such as [0, 0, 1]"),
        (lambda: Cylinder(np.zeros(2), 1.0, axis=np.ones(2)), "a circle in the plane has no axis; leave it out"),
        (lambda: Cylinder(np.zeros(3), 1.0, axis=np.ones(2)), "expected 3 finite numbers"),
    ],
)
def test_obstacles_that_cannot_be_are_refused(make, message: str) -> None:
    with pytest.raises(CaseError) as caught:
        make()
    assert message in str(caught.value)


# -- places on facets --------------------------------------------------------------------------------------------------


def test_weights_of_corners_and_places_on_edges() -> None:
    rng = np.random.default_rng(7)
    local = rng.random((10, 2)) * 0.5
    for triangle, kind in ((True, "triangle"), (False, "quad")):
        shape = shape_of(np.full(10, triangle), local)
        expected, _ = shape_functions(kind, local)
        assert shape[:, : expected.shape[1]] == pytest.approx(expected, rel=1e-14)
        assert not shape[:, expected.shape[1] :].any()
        corners = reference_nodes(kind)
        for edge in range(len(corners)):
            along = rng.random(3)
            expected = corners[edge] + along[:, None] * (corners[(edge + 1) % len(corners)] - corners[edge])
            assert edge_coordinates(np.full(3, triangle), np.full(3, edge), along) == pytest.approx(expected)
    # Within rounding of a corner it is that corner, and what is left still sums to one.
    near = shape_of(np.array([True, True]), np.array([[0.9e-9, 0.5], [1.1e-9, 0.5]]))
    assert near[0] == pytest.approx([0.5, 0, 0.5, 0], rel=1e-8)
    assert (near[0, 1], near[1, 1]) == (0.0, pytest.approx(1.1e-9, rel=1e-6))
    assert near.sum(axis=1) == pytest.approx([1, 1], rel=1e-15)


def test_nearest_edges_are_found_by_trying_all_their_points() -> None:
    rng = np.random.default_rng(8)
    begin, end, slaves = rng.normal(size=(3, 7, 3))
    _, straight, _ = nearest_edges(slaves, begin, end, np.zeros((7, 3)))
    assert {0.0, 1.0} & set(straight.tolist())  # off an end as well
    for bend in (np.zeros((7, 3)), 0.5 * rng.normal(size=(7, 3))):
        _edges_are_nearest(begin, end, bend, slaves)


def _edges_are_nearest(begin, end, bend, slaves) -> None:
    which, along, distance = nearest_edges(slaves, begin, end, bend)
    t = np.linspace(0, 1, 20001)
    curves = begin[:, None] + t[:, None] * (end - begin)[:, None] + (t * (1 - t))[:, None] * bend[:, None]
    for i in range(7):
        away = np.linalg.norm(slaves[i] - curves, axis=2)
        edge, local = np.unravel_index(np.argmin(away), away.shape)
        assert which[i] == edge
        assert along[i] == pytest.approx(t[local], abs=1e-4)
        assert distance[i] == pytest.approx(away.min(), rel=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_elements_have_the_weights_of_the_place_below(kind: str) -> None:
    """A point over a place of a facet that is bent, along the normal that the search found, is given that place."""
    rng = np.random.default_rng(9)
    nodes = bent(kind, rng, by=0.04)
    surface = FacetSurface.from_facets(nodes, {kind: np.arange(len(nodes))[None]}, where="facet")
    local = 0.1 + 0.4 * rng.random((12, 2)) if kind.startswith("triangle") else 0.1 + 0.8 * rng.random((12, 2))
    expected, _ = shape_functions(kind, local)
    foot = expected @ nodes
    rough = surface.locate(foot)
    points = foot + 0.01 * rng.normal(size=(12, 1)) * rough.normal
    location = replace(rough, weights=surface.locate(points).weights, facet=surface.locate(points).facet)
    element, weights = element_weights(surface, location, points, nodes)
    full = np.zeros((12, len(nodes)))
    for i in range(12):
        np.add.at(full[i], element[i], weights[i])
    if kind in ("triangle6", "quad8", "quad9"):
        assert full == pytest.approx(expected, abs=1e-9)
    else:
        assert full.sum(axis=1) == pytest.approx(np.ones(12))
    assert (element[weights == 0.0] == 0).all()


def test_a_place_that_does_not_settle_near_its_start_stays() -> None:
    nodes = np.column_stack([2.0 * reference_nodes("quad9"), np.zeros(9)])
    normal = np.tile([0.0, 0, 1], (6, 1))
    start = np.tile([0.5, 0.5], (6, 1))
    # 0.19 of the facet away from its start along either side, 0.21; and where the normal lies in the facet.
    to = np.array([[0.69, 0.5], [0.71, 0.5], [0.5, 0.31], [0.5, 0.29], [0.5, 1.4], [0.6, 0.5]])
    points = np.column_stack([2 * to, np.full(6, 0.3)])
    normal[5] = [1, 0, 0]
    found = _refined("quad9", start, np.tile(nodes, (6, 1, 1)), points, normal)
    assert found[[0, 2]] == pytest.approx(to[[0, 2]], abs=1e-12)
    assert found[[1, 3, 4, 5]] == pytest.approx(start[[1, 3, 4, 5]], abs=1e-15)


def test_segments_of_a_mixed_curve_know_their_facet_and_half() -> None:
    x = np.arange(6.0)[::-1]
    points = np.column_stack([x, np.zeros(6)])
    facets = {"line": np.array([[0, 1], [4, 5]]), "line3": np.array([[1, 3, 2]])}
    curve = Curve.from_facets(points, {"line": facets["line"][:1], "line3": np.array([[1, 3, 2]])}, where="w")
    owner, half = _segments(curve)
    for segment, (node, following) in enumerate(curve.stencils[:, 1:3]):
        first, last, middle = curve.facets[owner[segment]]
        ends = {(first, last): -1, (first, middle): 0, (middle, last): 1}
        assert half[segment] == ends[node, following]
    # Weights along the curve interpolate x² over the quadratic facet, x over the straight one.
    at = np.column_stack([np.linspace(2.1, 4.9, 13), np.full(13, 0.2)])
    location = curve.locate(at)
    element, weights = element_weights(curve, location, at, curve.positions)
    local = curve.positions[:, 0]
    assert np.sum(weights * local[element], axis=1) == pytest.approx(at[:, 0])
    over = at[:, 0] < 4
    assert np.sum(weights * local[element] ** 2, axis=1)[over] == pytest.approx(at[over, 0] ** 2)
    assert np.sum(weights * local[element] ** 2, axis=1)[~over] == pytest.approx(9 * at[~over, 0] - 20)


# -- bases and integrals -----------------------------------------------------------------------------------------------


def test_points_of_a_master_weigh_its_nodes() -> None:
    location = Location(
        np.array([[0, 2, 0], [1, 1, 0]]), np.array([[0.25, 0.75, 0.0], [0.5, 0.5, 0.0]]), np.zeros((2, 3)), np.zeros((2, 3)),
        np.array([0.1, 0.2]), np.zeros(2, dtype=int), np.ones(2, dtype=bool),
    )  # fmt: skip
    assert point_weights(location, 4).toarray() == pytest.approx(np.array([[0.25, 0, 0.75, 0], [0, 1, 0, 0]]))
    single = collocated(location, np.array([3.0, 4.0]), 4)
    assert single.slave.toarray() == pytest.approx(np.eye(2))
    assert (single.area.tolist(), single.gap.tolist()) == ([3.0, 4.0], [0.1, 0.2])


@pytest.mark.parametrize("kind", ["triangle6", "quad8", "quad9", "quad"])
def test_the_changed_basis_spans_the_same_and_has_positive_integrals(kind: str) -> None:
    """Two facets side by side, of which a node does not take part: values ũ = T u of the basis φ̃ = S φ give back what
    the facets interpolate, and areas are sums of ∫φ̃ over the facets around a node."""
    rng = np.random.default_rng(10)
    r = len(reference_nodes(kind))
    positions = np.concatenate([bent(kind, rng), bent(kind, rng) + np.array([3.0, 0, 0])])
    block = np.arange(2 * r).reshape(2, r)
    # Node 1 of the second facet is node 1 of the first.
    positions[r + 1] = positions[1]
    block[1, 1] = 1
    for left_out in (None, 0, r - 1):
        taking = np.array([k for k in range(2 * r) if k not in (r + 1, left_out)])
        facets = SlaveFacets.of(positions, {kind: block}, taking)
        count = len(taking)
        mixture = _values_of_basis(facets, count).toarray()
        own, change, share = _shares(facets, kind)
        assert np.array_equal(own, facets.own[block])
        total, partly = np.zeros(count), np.zeros(count)
        local, weight = quadrature(kind)
        values, slopes = shape_functions(kind, local)
        for f in range(2):
            tangents = np.einsum("eqr,rd->eqd", slopes, positions[block[f]])
            dA = weight * np.linalg.norm(np.cross(tangents[0], tangents[1]), axis=1)
            u = rng.normal(size=count)
            held = np.where(own[f] >= 0, u[own[f]], 0.0)
            new = np.where(own[f] >= 0, (mixture @ u)[own[f]], 0.0)
            inside = own[f] >= 0
            if inside.all():
                assert values @ change[f].T @ new == pytest.approx(values @ held, rel=1e-12)
            np.add.at(total, own[f][inside], (dA @ values @ change[f].T)[inside])
            if not inside.all():
                np.add.at(partly, own[f][inside], (dA @ values @ change[f].T)[inside])
            assert share[f] == pytest.approx(dA @ values @ change[f].T, rel=1e-3)
        assert _areas(facets, count) == pytest.approx(total, rel=1e-3)
        assert _areas(facets, count, whole=False) == pytest.approx(partly, rel=1e-3, abs=1e-15)
        if left_out is None:
            assert (_areas(facets, count) > 0).all()
    half = SlaveFacets.of(positions, {kind: block}, taking, thickness=0.5)
    assert _areas(half, count) == pytest.approx(0.5 * _areas(facets, count))
    assert half.nodal_gaps == (kind == "quad")
    assert SlaveFacets.of(positions, {kind: block}, taking, nodal_gaps=True).nodal_gaps


@pytest.mark.parametrize("kind", ["triangle6", "quad8"])
def test_the_dual_basis_is_biorthogonal_in_its_quadrature(kind: str) -> None:
    rng = np.random.default_rng(11)
    r = len(reference_nodes(kind))
    facets = SlaveFacets.of(np.concatenate([bent(kind, rng), bent(kind, rng)]), {kind: np.arange(2 * r).reshape(2, r)}, np.arange(2 * r))  # fmt: skip
    _, change, share = _shares(facets, kind)
    local = 0.1 + 0.4 * rng.random((40, 2))
    owner, weight = np.arange(40) % 2, rng.random(40)
    values, _ = shape_functions(kind, local)
    dual = _dual(change, share, values, weight, owner)
    for f in range(2):
        mine = owner == f
        products = dual[mine].T @ (values[mine] @ change[f].T)
        assert products == pytest.approx(np.diag(share[f]), abs=1e-8)


@pytest.mark.parametrize("kind", ["quad", "quad8", "quad9", "triangle6"])
def test_places_in_the_plane_are_inverted_where_there_are_any(kind: str) -> None:
    rng = np.random.default_rng(12)
    flat = np.stack([bent(kind, rng, by=0.03)[:, :2] for _ in range(5)])
    owner = np.repeat(np.arange(5), 4)
    local = 0.05 + 0.4 * rng.random((20, 2))
    values, slopes = shape_functions(kind, local)
    target = np.einsum("qr,qre->qe", values, flat[owner])
    tangents = np.einsum("aqr,qre->qea", slopes, flat[owner])
    found, slope, good = pieces._inverted(kind, flat, owner, target)
    assert found == pytest.approx(local, abs=1e-11)
    assert slope == pytest.approx(np.abs(np.linalg.det(tangents)), rel=1e-9)
    assert good.all()
    # Beyond the facet by more than a millionth of it, in any direction, there is no place on it; its facet says so.
    for off, fine in ((0.5e-6, True), (2e-6, False)):
        for edge in ([-off, 0.3], [0.3, -off], [1 + off, 0.3], [0.3, 1 + off])[: 2 if kind.startswith("tri") else 4]:
            values, _ = shape_functions(kind, np.array([edge]))
            away = target.copy()
            away[9] = values[0] @ flat[owner[9]]
            good = pieces._inverted(kind, flat, owner, away)[2]
            assert list(good) == [True, True, fine, True, True]
    # Nor is there one for what no place has as its image, however near it may be.
    folded = flat.copy()
    folded[3] = flat[3] * [1.0, 0.0]
    good = pieces._inverted(kind, folded, owner, target)[2]
    assert list(good) == [True, True, True, False, True]


@pytest.mark.parametrize("kind", ["quad", "quad8", "triangle6"])
def test_whatever_is_called_found_is_the_place_of_its_target(kind: str) -> None:
    """On facets bent and folded at random, and targets anywhere: a place on the facet, whose image is the target."""
    rng = np.random.default_rng(24)
    flat = np.stack([bent(kind, rng, by=0.25)[:, :2] for _ in range(400)])
    target = rng.random((400, 2)) @ np.array([[1.2, 0.2], [-0.3, 0.9]])
    local, slope, good = pieces._inverted(kind, flat, np.arange(400), target)
    assert 20 < good.sum() < 380
    values, slopes = shape_functions(kind, local[good])
    assert np.einsum("qr,qre->qe", values, flat[good]) == pytest.approx(target[good], abs=1e-8)
    assert local[good].min() > -1e-6
    assert local[good].max() < 1 + 1e-6
    tangents = np.einsum("aqr,qre->qea", slopes, flat[good])
    assert slope[good] == pytest.approx(np.abs(np.linalg.det(tangents)), rel=1e-6)


def hat(nodes: np.ndarray, k: int, x: np.ndarray) -> np.ndarray:
    return np.interp(x, nodes, np.arange(len(nodes)) == k)


@pytest.mark.parametrize("kind", ["line", "line3"])
def test_pieces_of_a_line_integrate_what_has_kinks_at_the_masters_nodes(kind: str) -> None:
    rng = np.random.default_rng(13)
    ends = np.sort(rng.random(5))
    facets = np.zeros((4, 3 if kind == "line3" else 2, 2))
    facets[:, 0, 0], facets[:, 1, 0] = ends[:-1], ends[1:]
    if kind == "line3":
        facets[:, 2, 0] = 0.45 * ends[:-1] + 0.55 * ends[1:]
    master = np.sort(rng.random(9))
    master[0], master[-1] = -0.1, 1.1
    nodes = np.column_stack([master, np.full(9, -0.01)])
    below = pieces.NodeLine(nodes, cKDTree(nodes))
    under = np.column_stack([facets[:, :2, 0].mean(axis=1), np.full(4, -0.01)])
    found = pieces.pieces(kind, facets, under, below)
    values, slopes = shape_functions(kind, found.local)
    at = np.einsum("qr,qr->q", values, facets[found.owner][:, :, 0])
    weight = found.weight * np.einsum("qr,qr->q", slopes[0], facets[found.owner][:, :, 0])
    fine = np.unique(np.concatenate([ends, master, np.linspace(0, 1, 20001)]))
    for f, (a, b) in enumerate(pairwise(ends)):
        mine = found.owner == f
        assert weight[mine].sum() == pytest.approx(b - a, rel=1e-12)
        inside = fine[(fine >= a) & (fine <= b)]
        for k in range(9):
            exact = np.trapezoid(hat(master, k, inside), inside)
            assert weight[mine] @ hat(master, k, at[mine]) == pytest.approx(exact, rel=1e-9, abs=1e-13)


def flat_grid(n: int, *, up: bool, shift=(0.0, 0.0), size: float = 1.0, height: float = 0.0):
    x, y = np.meshgrid(np.linspace(0, size, n + 1), np.linspace(0, size, n + 1), indexing="ij")
    points = np.column_stack([x.ravel() + shift[0], y.ravel() + shift[1], np.full(x.size, height)])
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    quads = np.column_stack([corner, corner + n + 1, corner + n + 2, corner + 1])
    return points, quads if up else quads[:, ::-1]


@pytest.mark.parametrize("kind", ["quad", "triangle", "quad9", "triangle6"])
def test_pieces_in_space_integrate_what_has_kinks_at_the_masters_edges(kind: str) -> None:
    """∫ of each of the master's functions over the whole slave is that over their common square, whatever the facets."""
    points, quads = flat_grid(5, up=True, shift=(-0.13, -0.07), size=1.4)
    master = FacetSurface.from_facets(points, {"quad": quads}, where="m")
    rng = np.random.default_rng(14)
    corners = np.array([[0, 0], [0.6, 0], [1, 0], [1, 1], [0.3, 1], [0, 1.0]])
    split = [[0, 1, 4, 5], [1, 2, 3, 4]] if "quad" in kind else [[0, 1, 4], [0, 4, 5], [1, 2, 3], [1, 3, 4]]
    facets = []
    for cell in split:
        places = reference_nodes(kind)
        values, _ = shape_functions("quad" if "quad" in kind else "triangle", places)
        nodes = values @ corners[cell]
        if kind == "quad9":
            nodes[8] += 0.02 * rng.normal(size=2)  # a place off the middle: a polynomial of the place, not of x and y
        facets.append(np.column_stack([nodes, np.zeros(len(nodes))])[::1])
    # Seen from the master's side they are counter-clockwise the other way round: turn them over.
    facets = np.array(facets) * [1, -1, 1] + [0, 1, 0]
    under = facets[:, : (3 if kind.startswith("tri") else 4)].mean(axis=1)
    found = pieces.pieces(kind, facets, under, pieces.outlines(master, master.positions))
    values, slopes = shape_functions(kind, found.local)
    at = np.einsum("qr,qrd->qd", values, facets[found.owner])
    tangents = np.einsum("eqr,qrd->eqd", slopes, facets[found.owner])
    weight = found.weight * np.linalg.norm(np.cross(tangents[0], tangents[1]), axis=1)
    assert weight.sum() == pytest.approx(1.0, rel=1e-10)
    lines = np.linspace(0, 1.4, 6)
    fine = np.linspace(0, 1, 28001)
    parts = [[np.trapezoid(hat(lines + s, k, fine), fine) for k in range(6)] for s in (-0.13, -0.07)]
    for i in range(6):
        for j in range(6):
            integral = weight @ (hat(lines - 0.13, i, at[:, 0]) * hat(lines - 0.07, j, at[:, 1]))
            assert integral == pytest.approx(parts[0][i] * parts[1][j], rel=1e-6, abs=1e-9)


def test_facets_that_the_master_does_not_cover_get_points_that_know_nothing_of_it() -> None:
    points, quads = flat_grid(4, up=True)
    master = FacetSurface.from_facets(points, {"quad": quads}, where="m")
    below = pieces.outlines(master, master.positions)
    plain = pieces._composite("quad")
    square = np.array([[0, 0, 0.01], [0, 0.4, 0.01], [0.4, 0.4, 0.01], [0.4, 0, 0.01]])
    for out, known in ((0.035, True), (0.045, False)):  # 0.9 of it has to be covered
        moved = square - [out, 0, 0]
        found = pieces.pieces("quad", moved[None], moved.mean(axis=0)[None] * [1, 1, 0], below)
        assert (len(found.weight) != len(plain[1])) is known
        if not known:
            assert found.local == pytest.approx(plain[0])
            assert found.weight == pytest.approx(plain[1])
    # Turned round it does not face the master, and is left to itself as well.
    found = pieces.pieces("quad", square[None, ::-1], square.mean(axis=0)[None] * [1, 1, 0], below)
    assert found.local == pytest.approx(plain[0])


def test_pairs_are_all_that_lie_over_each_other_and_face_each_other() -> None:
    """On a sphere within a sphere: every pair whose outlines come near enough is looked at, whatever their size."""
    rng = np.random.default_rng(15)
    count = 60
    centre = rng.random((count, 3)) * [1, 1, 0.3]
    size = 0.02 * 8.0 ** rng.random(count)
    normal = rng.normal(size=(count, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    outline = pieces._frames
    corners = []
    for c, s, n in zip(centre, size, normal, strict=True):
        first = np.cross(n, [0.3, 0.5, 0.7])
        first /= np.linalg.norm(first)
        second = np.cross(n, first)
        corners.append(c + s * np.array([first, second, -first, -second]))
    assert outline(np.array(corners))[:, 2] == pytest.approx(normal)
    surface: Any = SimpleNamespace(blocks={"quad": np.arange(4 * count).reshape(count, 4)})
    below = pieces.outlines(surface, np.concatenate(corners))
    assert below.normal == pytest.approx(normal)
    assert below.radius == pytest.approx([np.linalg.norm(c - c[:3].mean(axis=0), axis=1).max() for c in corners])
    assert sorted(np.concatenate([lot for lot, _, _ in below.lots])) == list(range(count))
    for lot, _, largest in below.lots:
        assert largest == below.radius[lot].max() <= 2 * below.radius[lot].min()
    slaves = rng.random((20, 3)) * [1, 1, 0.3]
    own = np.array([0.05 * np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0.0]]) for _ in range(20)]) + slaves[:, None]
    up = np.tile([0.0, 0, 1], (20, 1))
    facet, other = pieces._neighbours(own, slaves, up, below)
    found = set(zip(facet.tolist(), other.tolist(), strict=True))
    assert len(found) == len(facet)
    for f in range(20):
        for o in range(count):
            reach, apart = 0.05 + below.radius[o], below.centre[o] - slaves[f]
            if np.linalg.norm(apart) <= reach and normal[o, 2] < -0.1:
                assert (f, o) in found
            if normal[o, 2] >= -0.1 or abs(apart[2]) > reach:
                assert (f, o) not in found


def test_common_parts_of_convex_polygons_have_their_area_and_middle() -> None:
    """Against a fine grid of points, inside both or not."""
    rng = np.random.default_rng(16)
    grid = (np.stack(np.meshgrid(np.arange(400), np.arange(400)), axis=-1).reshape(-1, 2) + 0.5) / 400

    def convex(n):
        angle = np.sort(rng.random(n) * 0.8 + np.arange(n)) * 2 * np.pi / n
        return 0.5 + 0.3 * rng.random() * np.column_stack([np.cos(angle), np.sin(angle)]) + 0.15 * rng.random(2)

    def inside(polygon):
        after = np.roll(polygon, -1, axis=0) - polygon
        offset = grid[:, None] - polygon
        cross = after[:, 0] * offset[..., 1] - after[:, 1] * offset[..., 0]
        return np.all(cross >= 0, axis=1) | np.all(cross <= 0, axis=1)

    for _ in range(12):
        sizes = rng.integers(3, 5, size=2)
        one, two = (convex(n) for n in sizes)
        padded = [np.concatenate([p, p[: 4 - len(p)]]) for p in (one, two[:: rng.choice([-1, 1])])]
        which, triangles = common_triangles(
            padded[0][None], sizes[:1], np.zeros(1, dtype=np.int64), np.ascontiguousarray(padded[1][None]), sizes[1:]
        )
        assert not which.any()
        first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
        areas = 0.5 * np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
        both = inside(one) & inside(two)
        assert areas.sum() == pytest.approx(both.mean(), abs=2e-3)
        if both.any():
            assert areas @ triangles.mean(axis=1) == pytest.approx(grid[both].sum(axis=0) / len(grid), abs=2e-3)


# -- surfaces ----------------------------------------------------------------------------------------------------------


def sphere(n: int, kind: str = "quad") -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The six sides of a cube drawn out to a sphere of radius one."""
    points, quads = flat_grid(n, up=True)
    points = 2 * points - [1, 1, -1]
    sides = []
    for axis in range(3):
        for sign in (1, -1):
            side = np.roll(points, axis + 1, axis=1)
            sides.append(side if sign > 0 else side * np.where(np.arange(3) == axis, -1, 1))
    every = np.concatenate(sides)
    cells = np.concatenate([
        (quads if k % 2 == 0 else quads[:, ::-1]) + k * len(points) for k in range(6)
    ])  # fmt: skip
    unique, inverse = np.unique(np.round(every, 9), axis=0, return_inverse=True)
    cells = inverse.ravel()[cells]
    unique = np.tan(unique * np.pi / 4)
    unique /= np.linalg.norm(unique, axis=1, keepdims=True)
    middle = unique[cells].mean(axis=1)
    outward = np.cross(unique[cells[:, 2]] - unique[cells[:, 0]], unique[cells[:, 3]] - unique[cells[:, 1]])
    wrong = np.sum(outward * middle, axis=1) < 0
    cells[wrong] = cells[wrong][:, ::-1]
    if kind == "triangle":
        return unique, {"triangle": np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])}
    return unique, {"quad": cells}


@pytest.mark.parametrize("kind", ["quad", "triangle"])
def test_a_sphere_is_closed_smooth_and_as_high_as_its_chords(kind: str) -> None:
    points, cells = sphere(6, kind)
    surface = FacetSurface.from_facets(points, cells, where="ball")
    corners = 3 if kind == "triangle" else 4
    ends: dict[tuple[int, int], tuple[int, int]] = {}
    for f, facet in enumerate(surface.facets):
        for e in range(corners):
            ends[int(facet[e]), int(facet[(e + 1) % corners])] = (f, e)
    for (a, b), (f, e) in ends.items():
        assert surface.neighbours[f, e] == ends[b, a][0]
    assert not surface.sharp.any()
    assert len(np.unique(surface.groups[surface.facets >= 0])) == len(points)
    normals = surface.corner_normals(surface.positions)
    for f, facet in enumerate(surface.facets):
        for e in range(corners):
            assert normals[f, e] == pytest.approx(surface.positions[facet[e]], abs=5e-3)
    assert surface.corner_normals(2.5 * surface.positions) == pytest.approx(normals, abs=1e-12)
    # Heights of chords of length h over the sphere: 1 − √(1 − h²/4); over the middle of a quadrilateral that of its
    # diagonals, half each.
    def height(a: int, b: int) -> float:
        return 1 - math.sqrt(1 - float(np.sum((surface.positions[a] - surface.positions[b]) ** 2)) / 4)

    heights = [height(a, b) for a, b in ends]
    if kind == "quad":
        heights += [0.5 * (height(c[0], c[2]) + height(c[1], c[3])) for c in surface.facets]
    assert surface.chord_height == pytest.approx(max(heights), rel=0.03)
    # Slaves over it are found at their distance, wherever the search begins.
    rng = np.random.default_rng(17)
    out = rng.normal(size=(200, 3))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    found = surface.locate(1.3 * out)
    assert found.inside.all()
    assert found.gap == pytest.approx(np.full(200, 0.3), abs=0.025)
    assert (found.gap > 0.3 - 1e-3).all()
    assert found.normal == pytest.approx(out, abs=0.02)
    assert found.point + found.gap[:, None] * found.normal == pytest.approx(1.3 * out, abs=1e-9)
    again = surface.locate(1.3 * out, guess=surface.neighbours[found.facet, 1])
    assert again.inside.all()
    assert again.gap == pytest.approx(found.gap, abs=1e-9)
    moved = surface.locate(2.6 * out, surface.positions)  # twice as large
    assert moved.gap == pytest.approx(2 * found.gap, abs=1e-9)
    assert moved.facet.tolist() == found.facet.tolist()


def test_beyond_the_edge_of_a_sheet_the_nearest_point_of_its_edge_is_given() -> None:
    points, quads = flat_grid(3, up=True)
    sheet = FacetSurface.from_facets(points, {"quad": quads}, where="sheet")
    rng = np.random.default_rng(18)
    slaves = rng.random((60, 3)) * [2, 2, 0.2] - [0.5, 0.5, 0.0]
    found = sheet.locate(slaves)
    nearest = np.clip(slaves, 0, 1) * [1, 1, 0]
    over = np.all((slaves[:, :2] > 0) & (slaves[:, :2] < 1), axis=1)
    assert found.inside.tolist() == over.tolist()
    assert found.point == pytest.approx(nearest, abs=1e-12)
    assert found.gap == pytest.approx(slaves[:, 2])
    for off, inside in ((0.9e-6, True), (1.5e-6, False)):  # of a facet, a third of the sheet
        assert sheet.locate(np.array([[1 + off / 3, 0.4, 0.1]])).inside[0] == inside


def box(size, parts) -> tuple[np.ndarray, np.ndarray]:
    """A box about the origin whose sides are cut into parts along each axis."""
    every: list[np.ndarray] = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for sign in (-1.0, 1.0):
            x, y = (np.linspace(-0.5, 0.5, parts[k] + 1) * size[k] for k in (u, v))
            for i in range(parts[u]):
                for j in range(parts[v]):
                    quad = np.zeros((4, 3))
                    quad[:, axis] = 0.5 * sign * size[axis]
                    quad[:, u], quad[:, v] = x[[i, i + 1, i + 1, i]], y[[j, j, j + 1, j + 1]]
                    every.append(quad if sign > 0 else quad[::-1])
    nodes, inverse = np.unique(np.round(np.concatenate(every), 9), axis=0, return_inverse=True)
    return nodes, inverse.reshape(-1, 4)


@pytest.mark.parametrize(
    ("size", "parts"), [((5.0, 3.0, 0.2), (1, 1, 1)), ((5.0, 5.5, 0.1), (1, 1, 2)), ((4.0, 4.0, 0.1), (3, 5, 1))]
)
def test_over_a_large_facet_beside_narrow_ones_a_slave_is_over_the_large_one(size, parts) -> None:
    """The distance from a plate is known everywhere, from its faces, edges and corners, and right at its faces."""
    nodes, quads = box(size, parts)
    plate = FacetSurface.from_facets(nodes, {"quad": quads}, where="plate")
    rng = np.random.default_rng(25)
    half = 0.5 * np.array(size)
    slaves = (rng.random((4000, 3)) - 0.5) * (np.array(size) + 0.6)
    rim = np.abs(slaves[:400, :2]) / half[:2]
    slaves[:400, :2] *= ((1 - 1e-3 * rng.random((400, 1))) / rim.max(axis=1, keepdims=True))  # near the rim of a face
    slaves[:400, 2] = half[2] * np.sign(slaves[:400, 2]) + 1e-5 * (rng.random(400) - 0.5)
    found = plate.locate(slaves)
    beyond = np.abs(slaves) - half
    outside = beyond.max(axis=1) > 0
    distance = np.where(outside, np.linalg.norm(np.maximum(beyond, 0.0), axis=1), beyond.max(axis=1))
    assert found.gap == pytest.approx(distance, abs=1e-9)
    assert found.inside.all()
    assert found.normal[:400] == pytest.approx(np.outer(np.sign(slaves[:400, 2]), [0, 0, 1.0]), abs=1e-9)


def test_all_masters_are_asked_in_the_same_way() -> None:
    asked = [p.replace(annotation=p.empty) for p in inspect.signature(MasterSurface.locate).parameters.values()]
    for kind in (Flat, Cylinder, Curve, FacetSurface):
        own = inspect.signature(kind.locate).parameters.values()
        assert [p.replace(annotation=p.empty) for p in own] == asked


@pytest.mark.parametrize("turn", [39.0, 41.0])
def test_edges_are_sharp_beyond_forty_degrees(turn: float) -> None:
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    points = np.array([[-1, 0, 0], [0, 0, 0], [c, 0, -s], [-1, 1, 0], [0, 1, 0], [c, 1, -s]])
    roof = FacetSurface.from_facets(points, {"quad": np.array([[0, 1, 4, 3], [1, 2, 5, 4]])}, where="roof")
    assert roof.sharp.any() == (turn > 40)
    assert len(np.unique(roof.groups)) == (8 if turn > 40 else 6)
    at = roof.corner_normals(points)[0, 1]
    assert at == pytest.approx([0, 0, 1] if turn > 40 else [s / math.hypot(s, 1 + c), 0, (1 + c) / math.hypot(s, 1 + c)])


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        ({"quad": [[0, 1, 4, 3], [1, 2, 5, 4], [0, 1, 4, 3]]}, "w: two facets pass the edge at (0.5, 0, 0) m in the same "
         "direction: they overlap, branch or disagree about the outside; repair the mesh there"),
        ({"quad": [[0, 1, 4, 3], [1, 4, 5, 2]]}, "w: two facets pass the edge at (1, 0.5, 0) m in the same direction"),
        ({"triangle": [[0, 1, 4], [0, 1, 2]]}, "w: the facet at (1, 0, 0) m has no area; merge its nodes or leave it out"),
        ({"quad": np.zeros((0, 4), dtype=int)}, "w: has no facets; triangles or quadrilaterals are needed"),
    ],
)  # fmt: skip
def test_surfaces_that_are_none_are_refused(cells, message: str) -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0]], dtype=float)
    with pytest.raises(CaseError) as caught:
        FacetSurface.from_facets(points, {k: np.array(v) for k, v in cells.items()}, where="w")
    assert str(caught.value).startswith(message)
    with pytest.raises(ValueError, match=r"^'line' is no facet of a solid; there are: triangle, quad, triangle6, quad8, quad9$"):
        FacetSurface.from_facets(points, {"line": np.array([[0, 1]])}, where="w")


@pytest.mark.parametrize("kind", ["triangle6", "quad8", "quad9"])
def test_parts_of_quadratic_facets_tile_them_the_same_way_round(kind: str) -> None:
    places = reference_nodes(kind)
    parts = facets_module.SPLITS[kind]
    area = 0.0
    for part in parts:
        corners = places[[c for c in part if c >= 0]]
        following = np.roll(corners, -1, axis=0)
        size = 0.5 * np.sum(corners[:, 0] * following[:, 1] - following[:, 0] * corners[:, 1])
        assert size > 0.05
        area += size
    assert area == pytest.approx(0.5 if kind == "triangle6" else 1.0)
    # Normals of a bulging one at its corners and middles are those of the facet itself, not of its parts.
    nodes = np.column_stack([places, 0.3 * places[:, 0] ** 2 - 0.2 * places[:, 0] * places[:, 1] + 0.1 * places[:, 1] ** 2])
    surface = FacetSurface.from_facets(nodes, {kind: np.arange(len(nodes))[None]}, where="w")
    normals = surface.corner_normals(surface.positions)
    for f, facet in enumerate(surface.facets):
        for e in range(4 if facet[3] >= 0 else 3):
            x, y = places[facet[e]]
            exact = np.array([-0.6 * x + 0.2 * y, 0.2 * x - 0.2 * y, 1.0])
            assert normals[f, e] == pytest.approx(exact / np.linalg.norm(exact), abs=1e-12)


# -- curves ------------------------------------------------------------------------------------------------------------


def test_nearest_points_of_a_wavy_ring_are_found_by_trying_all() -> None:
    rng = np.random.default_rng(19)
    angle = 2 * np.pi * (np.arange(40) + 0.3 * rng.random(40)) / 40
    radius = 1 + 0.1 * np.sin(3 * angle)
    points = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    curve = Curve.from_facets(points, {"line": np.column_stack([np.arange(40), (np.arange(40) + 1) % 40])}, where="ring")
    assert curve.closed
    assert not len(curve.corners)
    slaves = 1.25 * points + 0.05 * rng.normal(size=(40, 2))
    found = curve.locate(slaves)
    # The spline by SciPy: cubic Hermite pieces with slopes from the neighbours' chords.
    samples = []
    xi = np.linspace(0, 1, 2001)[:, None]
    for k in range(40):
        p0, p1, p2, p3 = points[[k - 1, k, (k + 1) % 40, (k + 2) % 40]]
        h0, h1, h2 = (np.linalg.norm(b - a) for a, b in ((p0, p1), (p1, p2), (p2, p3)))
        m1, m2 = h1 * (p2 - p0) / (h0 + h1), h1 * (p3 - p1) / (h1 + h2)
        samples.append(
            p1 * (1 + 2 * xi) * (1 - xi) ** 2 + m1 * xi * (1 - xi) ** 2 + p2 * xi**2 * (3 - 2 * xi) + m2 * xi**2 * (xi - 1)
        )
    every = np.concatenate(samples)
    for i in range(40):
        away = np.linalg.norm(slaves[i] - every, axis=1)
        assert found.gap[i] == pytest.approx(away.min(), rel=1e-6)
        assert found.point[i] == pytest.approx(every[np.argmin(away)], abs=2e-4)
    assert found.inside.all()
    assert curve.chord_height == pytest.approx(
        max(np.linalg.norm(s[1000] - 0.5 * (s[0] + s[-1])) for s in samples), rel=1e-12
    )
    again = curve.locate(slaves, guess=np.roll(found.facet, 2))
    assert again.gap == pytest.approx(found.gap, rel=1e-9)
    double = curve.locate(2 * slaves, curve.positions)
    assert double.gap == pytest.approx(2 * found.gap, rel=1e-9)


def test_an_open_curve_ends_and_says_so() -> None:
    points = np.column_stack([np.array([3.0, 2.0, 0.5, 0.0]), np.zeros(4)])
    curve = Curve.from_facets(points, {"line": np.array([[0, 1], [1, 2], [2, 3]])}, where="w")
    assert not curve.closed
    slaves = np.array([[-0.5, 0.1], [1.0, 0.1], [3.4, 0.1], [-0.9e-6 * 0.5, 0.1], [-1.1e-6 * 0.5, 0.1]])
    found = curve.locate(slaves)
    assert found.inside.tolist() == [False, True, False, True, False]
    assert found.point[:, 0] == pytest.approx(np.clip(slaves[:, 0], 0, 3), abs=1e-12)
    assert found.gap == pytest.approx(np.full(5, 0.1))
    guessed = curve.locate(slaves, guess=np.array([0, 2, 2, 0, 0]))
    assert guessed.inside.tolist() == found.inside.tolist()
    assert guessed.point == pytest.approx(found.point, abs=1e-12)


# -- ties --------------------------------------------------------------------------------------------------------------


def test_nearest_points_on_bent_line_facets_are_found_by_trying_all() -> None:
    rng = np.random.default_rng(20)
    angle = np.linspace(0, 1.5 * np.pi, 21)
    points = (1 + 0.05 * rng.random(21))[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    quadratic = np.column_stack([np.arange(0, 16, 2), np.arange(2, 18, 2), np.arange(1, 17, 2)])
    straight = np.column_stack([np.arange(16, 20), np.arange(17, 21)])
    curve = Curve.from_facets(points, {"line3": quadratic, "line": straight}, where="w")
    slaves = np.concatenate([1.1 * points[::2], 0.93 * points[1::3], points + 0.05 * rng.normal(size=points.shape)])
    found = ties.tie(slaves, curve, where="w", tolerance=1.0)
    xi = np.linspace(0, 1, 4001)
    shape3, shape2 = shape_functions("line3", xi[:, None])[0], shape_functions("line", xi[:, None])[0]
    images = [shape3 @ points[f] for f in quadratic] + [shape2 @ points[f] for f in straight]
    every = np.concatenate(images)
    for i, x in enumerate(slaves):
        away = np.linalg.norm(x - every, axis=1)
        assert found.distance[i] == pytest.approx(away.min(), abs=1e-6)
        assert found.point[i] == pytest.approx(every[np.argmin(away)], abs=1e-3)
    # As the facet interpolates: sums of one, and the point itself; in portions as all at once.
    assert found.weights.sum(axis=1) == pytest.approx(np.ones(len(slaves)))
    assert np.einsum("sr,srd->sd", found.weights, curve.positions[found.nodes]) == pytest.approx(found.point)
    assert [len(p) for p in ties._portions(slaves, 1)] == [len(slaves)]
    assert [len(p) for p in ties._portions(np.zeros((10, 2)), 250_000)] == [5, 5]
    assert [len(p) for p in ties._portions(np.zeros((10, 2)), 199_999)] == [10]


def test_masses_of_slaves_are_shared_without_loss() -> None:
    rng = np.random.default_rng(21)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    weights = np.array([[0.5, 0.75, -0.25], [0.25, 0.75, 0.0], [0.0, 0.0, 0.0]])
    held = ties.NodeTies(np.zeros((3, 3), dtype=int), weights, np.zeros((3, 3)), np.zeros(3))
    bond = ties.Bond("w", held, np.zeros((3, 3), dtype=int), np.zeros((1, 3), dtype=int), turn)
    shared = bond.shares
    assert shared.tie.weights == pytest.approx(np.array([[1 / 3, 1 / 2, 1 / 6], [0.25, 0.75, 0], [0, 0, 0]]))
    assert shared.rotation == pytest.approx(turn**2)
    assert shared.rotation.sum(axis=0) == pytest.approx(np.ones(3))
    assert replace(bond, rotation=None).shares.rotation is None


def test_bonds_turn_what_their_leaders_do() -> None:
    """u_s = R Σ w u_m, also over a second bond that leads the leaders."""
    rng = np.random.default_rng(22)
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    # Nodes 0 and 1 free, 2 led by both, 3 led by 2 and 1.
    freedoms = np.arange(8).reshape(4, 2)
    first = ties.NodeTies(np.array([[0, 1]]), np.array([[0.3, 0.7]]), np.zeros((1, 2)), np.zeros(1))
    second = ties.NodeTies(np.array([[1, 0]]), np.array([[0.4, 0.6]]), np.zeros((1, 2)), np.zeros(1))
    bonds = [
        ties.Bond("a", first, freedoms[[2]], freedoms[[0, 1]], turn),
        ties.Bond("b", second, freedoms[[3]], freedoms[[1, 2]]),
    ]
    T = ties.tie_transformation(8, bonds).toarray()
    u = rng.normal(size=8)
    u[4:] = 99.0  # of no effect
    moved = (T @ u).reshape(4, 2)
    assert moved[:2] == pytest.approx(u[:4].reshape(2, 2))
    led = turn @ (0.3 * moved[0] + 0.7 * moved[1])
    assert moved[2] == pytest.approx(led)
    assert moved[3] == pytest.approx(0.4 * led + 0.6 * moved[1])
    assert not T[:, 4:].any()


def check(points, normals, limit: float = 0.1, distance=None) -> None:
    points, normals = np.array(points, dtype=float), np.array(normals, dtype=float)
    found = ties.NodeTies(
        np.zeros((len(points), 1), dtype=int), np.ones((len(points), 1)), points,
        np.abs(points[:, 1]) if distance is None else np.array(distance),
    )  # fmt: skip
    master = Flat(np.zeros(2), np.array([0.0, 1.0]))
    ties.check_facing(points, normals, master, found, where="ties.a", limit=limit)


def test_surfaces_that_are_tied_touch_and_face_each_other() -> None:
    down, beside = [0.0, -1.0], [math.cos(math.radians(29)), math.sin(math.radians(29))]
    check([[0, 0.1], [1, 0]], [down, beside])
    check([[0, 0.0]], [[np.nan, np.nan]])
    with pytest.raises(CaseError) as caught:
        check([[0, 0.05], [1, 0.15], [2, 0.1001]], [down] * 3)
    assert str(caught.value).startswith(
        "ties.a: the slave node at (1, 0.15) m is 0.15 m from the master, more than an element (0.1 m); a tie bonds"
    )
    up = [math.cos(math.radians(31)), math.sin(math.radians(31))]
    with pytest.raises(CaseError) as caught:
        check([[0, 0.05], [1, 0.02], [2, 0.0]], [down, up, up])
    assert str(caught.value).startswith(
        "ties.a: at 2 of 3 slave nodes both surfaces face the same way, first at (1, 0.02) m; a tie bonds surfaces that"
    )


# -- pairing -----------------------------------------------------------------------------------------------------------


def seen(gap, inside=None, normal=None) -> Location:
    m = len(gap)
    normal = np.tile([0.0, 1.0], (m, 1)) if normal is None else np.array(normal, dtype=float)
    return Location(
        np.zeros((m, 1), dtype=int), np.ones((m, 1)), np.column_stack([np.arange(m), np.zeros(m)]), normal,
        np.array(gap, dtype=float), np.zeros(m, dtype=int), np.ones(m, dtype=bool) if inside is None else np.array(inside),
    )  # fmt: skip


class Shown:
    """A master that shows what is given."""

    def __init__(self, location: Location) -> None:
        self.location = location

    def locate(self, slaves, displacement=None, *, guess=None) -> Location:
        return self.location


def test_nodes_that_take_part_lie_over_the_master_face_it_and_are_within_reach() -> None:
    down, along = [0.0, -1.0], [1.0, -0.9e-9]
    normals = np.array([down, [0.0, 1.0], along, [0.0, 0.0], down, down, [1.0, -1.1e-9]])
    location = seen([0.1, 0.1, 0.1, 0.1, 0.5, 0.1, 0.2], inside=[True] * 5 + [False, True])
    at = np.column_stack([np.arange(7), location.gap])
    for reach, expected in ((None, [0, 3, 4, 6]), (0.2, [0, 3, 6]), (0.15, [0, 3])):
        facing, found = pairing._facing("w", at, normals, Shown(location), reach)
        assert list(facing) == expected
        assert list(found.gap) == [location.gap[k] for k in expected]
    lead = "w: the bodies do not face each other: the nearest node of the slave is {} m from the master, at {}"
    for places, where, reach, words in (
        ([4, 6], location, 0.1, lead.format("0.2", "(6, 0.2) m") + ", beyond the reach of 0.1 m; move a body or set"),
        ([1, 2], location, None, lead.format("0.1", "(1, 0.1) m") + ", and their outward normals do not oppose each other;"),
        ([5], location, None, lead.format("0.1", "(5, 0.1) m") + ", and none lies over the master; all are beyond its edges."),
        ([], location, None, "w: the slave has no nodes"),
    ):
        picked = np.array(places, dtype=int)
        with pytest.raises(CaseError) as caught:
            pairing._facing("w", at[picked], normals[picked], Shown(where.only(picked)), reach)
        assert str(caught.value).startswith(words)


def test_overlaps_are_told_with_the_way_out() -> None:
    location = seen([0.1, -0.02, -0.03, -0.0005], normal=[[0, 1], [0, 1], [0.6, -0.8], [0, 1]])
    at = np.column_stack([np.arange(4.0), location.gap])
    said = pairing._overlapping(at, location, 2, 1e-3)
    assert said == (
        "the bodies overlap: 2 nodes of the slave lie inside the master, the deepest by 0.03 m at (2, -0.03) m; up to 0.001 "
        "m is allowed. Move the slave's body by 0.03 m along (0.6, -0.8), or the master's the opposite way"
    )
    assert "1 node of the slave lies inside" in pairing._overlapping(at, location, 2, 0.025)


def test_facets_round_the_edge_of_a_boundary_take_no_part() -> None:
    """A block on a flat: facets below face it, those at its sides do not, nor do nodes that these alone have."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1, 0, 1], [1, 1, 1.0]])
    block = np.array([[0, 3, 2, 1], [1, 2, 5, 4]])  # below and beside
    flat = Flat(np.zeros(3), np.array([0.0, 0, 1]))
    location = flat.locate(points)
    kept, facing, found = pairing._opposed({"quad": block}, points, np.arange(6), location)
    assert kept["quad"].tolist() == [[0, 3, 2, 1]]
    assert list(facing) == [0, 1, 2, 3]
    assert found.gap == pytest.approx(np.zeros(4))
    # Where none faces it, all stay as they are.
    kept, facing, _ = pairing._opposed({"quad": block[1:]}, points, np.arange(6), location)
    assert kept["quad"].tolist() == [[1, 2, 5, 4]]
    assert len(facing) == 6
    # A facet that leans by less than six degrees from upright still faces it.
    for lean, faces in ((5.0, False), (7.0, True)):
        tilted = points.copy()
        tilted[4:, 0] += math.tan(math.radians(lean))
        kept, _, _ = pairing._opposed({"quad": block}, tilted, np.arange(6), flat.locate(tilted))
        assert len(kept["quad"]) == 1 + faces


# -- edges, tolerances and lines ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("turn", [12.0, 30.0])
@pytest.mark.parametrize("height", [0.4, -0.4])
def test_over_the_rim_of_a_curved_surface_twice_the_angle_of_its_facets_is_forgiven(turn: float, height: float) -> None:
    """Two facets that turn by an angle: the normal of the first turns by half of it to their common edge and as much the
    other way to the rim, over which a slave may be beyond by 2 |n − n₀| = 4 sin(angle/4) of its height."""
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    points = np.array([[-1, 0, 0], [0, 0, 0], [c, 0, -s], [-1, 1, 0], [0, 1, 0], [c, 1, -s]])
    roof = FacetSurface.from_facets(points, {"quad": np.array([[0, 1, 4, 3], [1, 2, 5, 4]])}, where="roof")
    allowed = 4 * math.sin(math.radians(turn) / 4) * abs(height)
    half = math.radians(turn) / 2
    normal, out = np.array([-math.sin(half), 0, math.cos(half)]), np.array([-math.cos(half), 0, -math.sin(half)])
    for part, inside in ((0.0, True), (0.97, True), (1.03, False)):
        found = roof.locate(np.array([[-1, 0.5, 0]]) + height * normal + part * allowed * out)
        assert found.inside[0] == inside, part
        assert found.point[0] == pytest.approx([-1, 0.5, 0], abs=1e-9)
        assert found.gap[0] == pytest.approx(height)
    # A flat one forgives nothing.
    sheet = FacetSurface.from_facets(points[[0, 1, 3, 4]], {"quad": np.array([[0, 1, 3, 2]])}, where="sheet")
    assert not sheet.locate(np.array([[-1 - 1e-5, 0.5, height]])).inside[0]


def test_curved_slaves_may_seem_to_overlap_by_their_chords_and_corners_by_rounding() -> None:
    flat = Flat(np.zeros(2), np.array([0.0, 1.0]))
    at = np.array([[100.0, 0.0], [103.0, 4.0]])
    rounding = 1e-9 * 5 + 1e-12 * 103
    for turn, height in ((39.0, None), (41.0, 0.0), (0.0, 0.0)):
        c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
        normals = np.array([[0.0, 1.0], [s, c]])
        expected = abs((normals[1] - normals[0]) @ (at[1] - at[0])) / 8 if height is None else height
        assert pairing.overlap_tolerance(at, normals, flat) == pytest.approx(1.5 * expected + rounding, rel=1e-12)
    assert pairing.overlap_tolerance(at[:1], np.array([[0.0, 1.0]]), flat) == pytest.approx(1e-10)
    bowl: Any = SimpleNamespace(chord_height=2e-3)
    assert pairing.overlap_tolerance(at[:1], np.array([[0.0, 1.0]]), bowl) == pytest.approx(3e-3 + 1e-10)


@pytest.mark.parametrize("kind", ["triangle6", "quad", "quad8", "quad9"])
def test_meshes_that_match_are_coupled_node_to_node(kind: str) -> None:
    points, quads = flat_grid(3, up=True)
    places = reference_nodes(kind)
    cells, nodes = [], np.zeros((0, 3))
    corners = [q[c] for q in quads for c in ([[0, 1, 2], [0, 2, 3]] if kind == "triangle6" else [[0, 1, 2, 3]])]
    for cell in corners:
        values, _ = shape_functions("triangle" if kind == "triangle6" else "quad", places)
        nodes = np.concatenate([nodes, values @ points[cell]])
        cells.append(np.arange(len(nodes) - len(places), len(nodes)))
    nodes, inverse = np.unique(np.round(nodes, 12), axis=0, return_inverse=True)
    block = inverse.ravel()[np.array(cells)]
    master = FacetSurface.from_facets(nodes, {kind: block}, where="m")
    turned = {"triangle6": [0, 2, 1, 5, 4, 3], "quad": [0, 3, 2, 1], "quad8": [0, 3, 2, 1, 7, 6, 5, 4], "quad9": [0, 3, 2, 1, 7, 6, 5, 4, 8]}
    facets = SlaveFacets.of(nodes, {kind: block[:, turned[kind]]}, np.arange(len(nodes)))
    found = coupled(facets, nodes, np.ones(len(nodes)), master.locate(nodes), master)
    assert found.master.toarray() == pytest.approx(found.slave.toarray(), abs=1e-9)
    assert np.abs(found.master.data).min() > 1e-11
    assert found.area.sum() == pytest.approx(1.0)
    assert found.gap == pytest.approx(np.zeros(len(nodes)), abs=1e-12)


@pytest.mark.parametrize("side", [1, -1])
def test_a_point_is_paired_with_the_line_below_it(side: int) -> None:
    """A line of five nodes on a parabola: gap, normal and rows are those of the nearest point of its spline."""
    rng = np.random.default_rng(23)
    x = np.array([0.0, 0.3, 0.7, 1.0, 1.4])
    line = np.column_stack([x, 0.1 * x**2])
    n, p = 14, 2
    slave = Rows(sp.csr_array(rng.normal(size=(2, n))), rng.normal(size=(2, p)))
    master = Rows(sp.csr_array(rng.normal(size=(10, n))), rng.normal(size=(10, p)))

    def paired(at):
        return pair("c", slave=slave, slave_position=np.array(at), master=master, master_positions=line, side=side,
                    stiffness=4e3, law=Coulomb(0.2))  # fmt: skip

    for at in ([0.1, 0.2], [0.5, 0.1], [0.85, -0.2], [1.3, 0.4]):
        found = paired(at)
        assert found is not None
        k, xi = found.segment, found.xi
        # Hermite with slopes from the neighbours, one-sided at the ends.
        chord = np.linalg.norm(np.diff(line, axis=0), axis=1)

        def slope(j, k=k, chord=chord):
            if j == 0 or j == 4:
                return line[k + 1] - line[k]
            return chord[k] * (line[j + 1] - line[j - 1]) / (chord[j - 1] + chord[j])

        def spline(t, k=k, slope=slope):
            return (line[k] * (1 + 2 * t) * (1 - t) ** 2 + slope(k) * t * (1 - t) ** 2 + line[k + 1] * t**2 * (3 - 2 * t)
                    + slope(k + 1) * t**2 * (t - 1))  # fmt: skip

        point, along = spline(xi), (spline(xi + 1e-6) - spline(xi - 1e-6)) / 2e-6
        along /= np.linalg.norm(along)
        assert abs((np.array(at) - point) @ along) < 1e-8
        assert found.tangent == pytest.approx(side * along, abs=1e-8)
        assert found.normal == pytest.approx(side * np.array([-along[1], along[0]]), abs=1e-8)
        assert found.gap == pytest.approx(found.normal @ (np.array(at) - point))
        # Weights by moving one node at a time; the rows are slave minus master.
        weights, basis = np.zeros(5), np.eye(5)
        for j in range(5):
            saved = line.copy()
            line[:] = np.column_stack([basis[j], np.zeros(5)])
            weights[j] = (line[k] * (1 + 2 * xi) * (1 - xi) ** 2 + slope(k) * xi * (1 - xi) ** 2
                          + line[k + 1] * xi**2 * (3 - 2 * xi) + slope(k + 1) * xi**2 * (xi - 1))[0]  # fmt: skip
            line[:] = saved
        for direction, row, lift in (
            (found.normal, found.normal_row, found.normal_lift), (found.tangent, found.tangent_row, found.tangent_lift),
        ):  # fmt: skip
            below = np.kron(weights, direction)
            assert row == pytest.approx(slave.free.T @ direction - master.free.T @ below)
            assert lift == pytest.approx(slave.lift.T @ direction - master.lift.T @ below)
        assert found.compliance == pytest.approx(1 / 4e3)
        assert (found.side, found.name, found.sliding, found.closed) == (side, "c", "small", False)
    # Within rounding of a node it is that node; beyond an end there is nothing.
    for off in (0.4e-9, -0.4e-9):
        flat = line * [1, 0]
        found = pair("c", slave=slave, slave_position=np.array([0.7 + 0.3 * off, 0.2]), master=master, master_positions=flat,
                     side=side, stiffness=np.inf, law=Coulomb(0.2))  # fmt: skip
        assert found is not None
        assert found.xi in (0.0, 1.0)
        assert found.normal_row == pytest.approx(slave.free.T @ found.normal - master.free.toarray()[4:6].T @ found.normal)
        assert found.compliance == 0.0
    assert paired([-0.01, 0.0]) is None
    assert paired([1.45, 0.2]) is None


@pytest.mark.parametrize("inside", [False, True])
def test_a_point_on_a_circle_overlaps_by_rounding_only(inside: bool) -> None:
    """A lone point at the origin has neither extent nor coordinates; the centre and the radius round all the same."""
    origin, rng = np.zeros((1, 2)), np.random.default_rng(4)
    overlaps = 0
    for _ in range(50):
        radius, angle = 10.0 ** rng.uniform(-3, 3), rng.uniform(0, 2 * np.pi)
        obstacle = Cylinder(radius * np.array([np.cos(angle), np.sin(angle)]), radius, inside=inside)
        location = obstacle.locate(origin)
        allowed = pairing.overlap_tolerance(origin, -location.normal, obstacle)
        overlaps += bool(location.gap[0] < 0.0)
        assert location.gap[0] >= -allowed
        assert allowed <= 1e-11 * radius
    assert overlaps > 0
