"""Bonded surfaces of different meshes: what is linear must pass unstrained, what cannot be tied is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from stridor.contact.curve import Curve
from stridor.contact.facets import FacetSurface
from stridor.contact.obstacles import Flat
from stridor.contact.ties import Bond, tie, tie_transformation
from stridor.errors import CaseError
from stridor.mesh.facets import shape_functions
from stridor.system.supports import Tied


def line(places, kind="line"):
    """A curve along the x axis, body below (its nodes run from the greatest x to the least)."""
    points = np.column_stack([np.sort(places)[::-1], np.zeros(len(places))])
    first = np.arange(0, len(points) - 1, 2 if kind == "line3" else 1)
    facets = [first, first + 2, first + 1] if kind == "line3" else [first, first + 1]
    return Curve.from_facets(points, {kind: np.column_stack(facets)}, where="w")


def sheet(count=4):
    """A flat surface over [0, 1]² in a plane that is oblique to the axes."""
    s, t = np.meshgrid(np.linspace(0, 1, count + 1), np.linspace(0, 1, count + 1))
    points = s.ravel()[:, None] * [1.0, 0.2, 0.1] + t.ravel()[:, None] * [-0.1, 1.0, 0.3]
    corner = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).ravel()
    quad = np.column_stack([corner, corner + 1, corner + count + 2, corner + count + 1])
    mixed = {"quad": quad[::2], "triangle": np.concatenate([quad[1::2][:, [0, 1, 2]], quad[1::2][:, [0, 2, 3]]])}
    return FacetSurface.from_facets(points, mixed, where="w")


def test_linear_facets_share_a_node_between_their_ends():
    found = tie(np.array([[0.25, 0.0], [1.0, 0.0]]), line([0, 1, 3]), where="w", tolerance=1e-9)
    weights = np.zeros((2, 3))
    for k in range(2):
        np.add.at(weights[k], found.nodes[k], found.weights[k])
    np.testing.assert_allclose(weights, [[0, 0.25, 0.75], [0, 1, 0]], atol=1e-15)
    np.testing.assert_allclose(found.point, [[0.25, 0], [1, 0]], atol=1e-15)


def test_quadratic_facets_pass_quadratic_fields():
    curve = line(np.linspace(0, 2, 7), "line3")
    x = np.linspace(0, 2, 23)
    found = tie(np.column_stack([x, 0 * x]), curve, where="w", tolerance=1e-9)
    field = curve.positions[:, 0] ** 2 - curve.positions[:, 0]
    middle = np.sum(found.weights * field[found.nodes], axis=1)
    # Each facet passes its own parabola: x² is one and the same on all of them.
    np.testing.assert_allclose(middle, x**2 - x, atol=1e-14)


def test_curved_quadratic_facets_are_met_on_the_facet_itself():
    angle = np.radians([0, 15, 30, 45, 60])
    points = np.column_stack([np.cos(angle), np.sin(angle)])
    curve = Curve.from_facets(points, {"line3": np.array([[0, 2, 1], [2, 4, 3]])}, where="w")
    xi = 0.3
    shape = np.array([(1 - xi) * (1 - 2 * xi), xi * (2 * xi - 1), 4 * xi * (1 - xi)])
    found = tie((shape @ points[[2, 4, 3]])[None], curve, where="w", tolerance=1e-12)
    np.testing.assert_array_equal(found.nodes, [[2, 4, 3]])
    np.testing.assert_allclose(found.weights, [shape], atol=1e-12)


def barrel(kind, bent=0.0):
    """Faces of a kind on a cylinder of radius one over two radians, their nodes off it by ``bent`` [m]."""
    angle, height = np.meshgrid(np.linspace(0.0, 2.0, 7), np.linspace(0.0, 1.0, 5), indexing="ij")
    points = np.stack([np.cos(angle), np.sin(angle), height], axis=-1).reshape(-1, 3)
    points += bent * np.random.default_rng(4).standard_normal(points.shape)
    number = np.arange(len(points)).reshape(7, 5)
    faces = []
    for i, j in np.ndindex(3, 2):
        of = number[2 * i : 2 * i + 3, 2 * j : 2 * j + 3]
        corners, middles, centre = of[[0, 2, 2, 0], [0, 0, 2, 2]], of[[1, 2, 1, 0], [0, 1, 2, 1]], of[1, 1]
        if kind == "triangle6":
            faces.append([*corners[[0, 1, 2]], middles[0], middles[1], centre])
            faces.append([*corners[[0, 2, 3]], centre, middles[2], middles[3]])
        else:
            faces.append([*corners, *middles, *([centre] if kind == "quad9" else [])])
    return FacetSurface.from_facets(points, {kind: np.array(faces)}, where="w"), np.array(faces), points


@pytest.mark.parametrize("bent", [0.0, 0.01])
@pytest.mark.parametrize("kind", ["triangle6", "quad8", "quad9"])
def test_curved_quadratic_faces_are_met_on_the_face_itself(kind, bent):
    surface, faces, points = barrel(kind, bent)
    rng = np.random.default_rng(2)
    local = rng.uniform(0.0, 1.0, (len(faces) * 5, 2))
    if kind == "triangle6":
        local = np.where(local.sum(axis=1, keepdims=True) > 1.0, 1.0 - local, local)
    faces = np.repeat(faces, 5, axis=0)
    on_it = np.einsum("qr,qrd->qd", shape_functions(kind, local)[0], points[faces])
    found = tie(on_it, surface, where="w", tolerance=1e-12)
    # A field that each face interpolates by its own functions is passed as they say.
    field = rng.standard_normal(len(points))
    own = np.einsum("qr,qr->q", shape_functions(kind, local)[0], field[faces])
    np.testing.assert_allclose(np.sum(found.weights * field[surface.nodes][found.nodes], axis=1), own, atol=1e-11)


@pytest.mark.parametrize("kind", ["triangle6", "quad8", "quad9"])
def test_no_place_on_quadratic_faces_is_nearer_than_the_one_found(kind):
    surface, faces, points = barrel(kind, 0.01)
    steps = np.linspace(0.0, 1.0, 41)
    local = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    if kind == "triangle6":
        local = local[local.sum(axis=1) < 1.0 + 1e-12]
    places = np.einsum("qr,frd->fqd", shape_functions(kind, local)[0], points[faces]).reshape(-1, 3)
    beside = places[::37] + 0.1 * np.random.default_rng(3).standard_normal(places[::37].shape)
    found = tie(beside, surface, where="w", tolerance=1.0)
    nearest = np.linalg.norm(beside[:, None, :] - places, axis=2).min(axis=1)
    assert np.all(found.distance < nearest + 1e-12)
    assert np.all(found.distance > nearest - 0.01)


@settings(max_examples=20)
@given(st.integers(0, 10_000))
def test_rotations_and_constant_strains_pass_a_surface_unchanged(seed):
    rng = np.random.default_rng(seed)
    surface = sheet()
    slaves = rng.uniform(0, 1, (20, 2)) @ np.array([[1.0, 0.2, 0.1], [-0.1, 1.0, 0.3]])
    found = tie(slaves, surface, where="w", tolerance=1e-9)
    gradient, shift = rng.standard_normal((3, 3)), rng.standard_normal(3)
    field = surface.positions @ gradient.T + shift
    passed = np.einsum("sr,srd->sd", found.weights, field[found.nodes])
    np.testing.assert_allclose(passed, slaves @ gradient.T + shift, atol=1e-13)
    assert found.distance.max() < 1e-13


@pytest.mark.parametrize(
    ("make", "slaves", "message"),
    [
        (
            lambda: line([0, 1]),
            [[0.5, 0.0], [0.5, 0.02], [0.2, -0.03]],
            "ties.a: 2 of 3 slave nodes are farther than 0.001 m from the master, the farthest by 0.03 m at (0.2, -0.03) m; "
            "tie only nodes that lie on it, or set a larger tolerance",
        ),
        (
            lambda: line([0, 1]),
            [[1.5, 0.0]],
            "ties.a: 1 of 1 slave nodes are farther than 0.001 m from the master, the farthest by 0.5 m at (1.5, 0) m; "
            "tie only nodes that lie on it, or set a larger tolerance",
        ),
        (
            lambda: Flat(np.zeros(2), np.array([0.0, 1.0])),
            [[0.0, 0.0]],
            "ties.a: nothing can be tied to an obstacle; fix those nodes by a support instead",
        ),
    ],
)
def test_what_cannot_be_tied_is_refused(make, slaves, message):
    with pytest.raises(CaseError) as caught:
        tie(np.array(slaves), make(), where="ties.a", tolerance=1e-3)
    assert str(caught.value) == message


# -- two plane bodies of different meshes ------------------------------------------------------------------------------


def rectangle_mesh(across, up, low, high):
    """Points and triangles of [0, 1] × [low, high]."""
    x, y = np.meshgrid(np.linspace(0, 1, across + 1), np.linspace(low, high, up + 1))
    a = (np.arange(up)[:, None] * (across + 1) + np.arange(across)).ravel()
    cells = np.concatenate(
        [np.column_stack([a, a + 1, a + across + 2]), np.column_stack([a, a + across + 2, a + across + 1])]
    )
    return np.column_stack([x.ravel(), y.ravel()]), cells


def stiffness_of(points, cells, young_modulus=1.0, poisson_ratio=0.3):
    """Plane stress with linear triangles of unit thickness, dense."""
    law = (
        young_modulus
        / (1 - poisson_ratio**2)
        * np.array([[1, poisson_ratio, 0], [poisson_ratio, 1, 0], [0, 0, (1 - poisson_ratio) / 2]])
    )
    matrix = np.zeros((2 * len(points), 2 * len(points)))
    for cell in cells:
        corners = np.column_stack([np.ones(3), points[cell]])
        slopes = np.linalg.inv(corners)[1:]
        strain = np.zeros((3, 6))
        strain[0, ::2], strain[1, 1::2] = slopes
        strain[2, ::2], strain[2, 1::2] = slopes[1], slopes[0]
        freedoms = (2 * cell[:, None] + [0, 1]).ravel()
        matrix[np.ix_(freedoms, freedoms)] += 0.5 * abs(np.linalg.det(corners)) * strain.T @ law @ strain
    return matrix


def two_bodies():
    """A finely meshed block on a coarse one: points, stiffness and the transformation of their bond."""
    below, cells_below = rectangle_mesh(3, 2, 0.0, 0.5)
    above, cells_above = rectangle_mesh(5, 2, 0.5, 1.0)
    top = np.flatnonzero(below[:, 1] == 0.5)
    curve = Curve.from_facets(below, {"line": np.column_stack([top[1:], top[:-1]])}, where="w")
    slave = np.flatnonzero(above[:, 1] == 0.5)
    bond = Bond(
        "ties.a",
        tie(above[slave], curve, where="ties.a", tolerance=1e-9),
        2 * (slave + len(below))[:, None] + [0, 1],
        2 * curve.nodes[:, None] + [0, 1],
    )
    points = np.concatenate([below, above])
    stiffness = np.zeros((2 * len(points),) * 2)
    split = 2 * len(below)
    stiffness[:split, :split] = stiffness_of(below, cells_below)
    stiffness[split:, split:] = stiffness_of(above, cells_above)
    return points, stiffness, bond


def test_tied_bodies_move_rigidly_without_strain_and_have_no_other_free_motion():
    points, stiffness, bond = two_bodies()
    transformation = tie_transformation(2 * len(points), [bond])
    tied = bond.slave.ravel()
    assert np.abs(transformation[:, tied]).sum() == 0
    rest = np.setdiff1d(np.arange(2 * len(points)), tied)
    reduced = (transformation.T @ stiffness @ transformation)[np.ix_(rest, rest)]
    x, y = points.T
    for motion in ([1 + 0 * x, 0 * y], [0 * x, 1 + 0 * y], [-y, x]):
        rigid = np.column_stack(motion).ravel()
        np.testing.assert_allclose(
            transformation @ np.where(np.isin(np.arange(len(rigid)), rest), rigid, 0), rigid, atol=1e-14
        )
        assert np.abs(reduced @ rigid[rest]).max() < 1e-14
    values = np.linalg.eigvalsh(reduced)
    assert np.sum(values < 1e-12) == 3
    assert values[3] > 1e-3


def test_a_constant_stress_passes_from_body_to_body():
    """Pulled by σ = 1 at the top, ε_y = 1/E and ε_x = −ν/E everywhere, at the tied nodes too."""
    points, stiffness, bond = two_bodies()
    transformation = tie_transformation(2 * len(points), [bond])
    x, y = points.T
    exact = np.column_stack([-0.3 * x, y]).ravel()
    force = np.zeros((len(points), 2))
    top, foot = np.flatnonzero(y == 1.0), np.flatnonzero(y == 0.0)
    force[top, 1] = np.where(np.isin(x[top], [0, 1]), 0.5, 1.0) / 5
    held = np.concatenate([2 * foot + 1, [2 * foot[0]]])
    free = np.setdiff1d(np.arange(2 * len(points)), np.concatenate([bond.slave.ravel(), held]))
    reduced = (transformation.T @ stiffness @ transformation)[np.ix_(free, free)]
    answer = np.zeros(2 * len(points))
    answer[free] = np.linalg.solve(reduced, (transformation.T @ force.ravel())[free])
    got = transformation @ answer
    # Node to facet is no mortar: the shares of force are not exact, the resultant is.
    np.testing.assert_allclose(got[2 * top + 1], exact[2 * top + 1], rtol=0.02)
    assert (stiffness @ got)[2 * foot + 1].sum() == pytest.approx(-1, rel=1e-12)


def test_forces_on_tied_nodes_go_to_the_master_with_resultant_and_moment():
    points, _, bond = two_bodies()
    transformation = tie_transformation(2 * len(points), [bond])
    rng = np.random.default_rng(0)
    force = rng.standard_normal((len(points), 2))
    moved = (transformation.T @ force.ravel()).reshape(-1, 2)
    np.testing.assert_allclose(moved.sum(axis=0), force.sum(axis=0), rtol=1e-13)

    def moment(f):
        return np.sum(points[:, 0] * f[:, 1] - points[:, 1] * f[:, 0])

    assert moment(moved) == pytest.approx(moment(force), rel=1e-12)


# -- ties on ties ------------------------------------------------------------------------------------------------------


def bond(where, slaves, masters, places, dimension=2):
    """Slave nodes at places on a line between two master nodes, all given by their numbers."""
    found = tie(np.array([[p, 0.0] for p in places]), line([0, 1]), where=where, tolerance=1.0)
    freedoms = [np.array(n)[:, None] * dimension + np.arange(dimension) for n in (slaves, masters)]
    return Bond(where, found, *freedoms)


def test_a_master_that_is_tied_itself_is_followed():
    # node 4 hangs half way between 2 and 3, node 2 on a quarter between 0 and 1 (masters in order of falling x)
    first, second = bond("ties.a", [4], [2, 3], [0.5]), bond("ties.b", [2], [0, 1], [0.25])
    for order in ([first, second], [second, first]):
        transformation = tie_transformation(10, order).toarray()
        np.testing.assert_allclose(transformation[8, [0, 2, 4, 6]], [0.125, 0.375, 0, 0.5], atol=1e-15)
        assert not transformation[:, [4, 5, 8, 9]].any()


def test_without_bonds_nothing_changes():
    assert abs(tie_transformation(4, []) - sp.eye_array(4)).sum() == 0


def test_a_node_that_two_ties_lead_to_the_same_follows_once():
    """Nodes 4 and 5 lie half way between 0 and 1, the one tied to them at once, and to the other as well."""
    first, second = bond("ties.a", [4, 5], [0, 1], [0.5, 0.5]), bond("ties.b", [6, 4], [5, 3], [0.0, 1.0])
    for order in ([first, second], [second, first]):
        transformation = tie_transformation(14, order).toarray()
        np.testing.assert_allclose(transformation[[8, 10]][:, [0, 2]], 0.5, atol=1e-15)
        assert not transformation[:, [8, 9, 10, 11, 12, 13]].any()


SLAVE = "a node may be slave of two ties only if both say the same of it, leave it out of one of them"


@pytest.mark.parametrize(
    ("bonds", "message"),
    [
        (
            lambda: [bond("ties.a", [4], [0, 1], [0.5]), bond("ties.b", [4], [0, 1], [0.5])],
            "ties.b: says nothing that ties.a does not say already; leave it out",
        ),
        (
            lambda: [bond("ties.a", [4], [0, 1], [0.5]), bond("ties.b", [4], [2, 3], [0.25])],
            f"ties.b: the node at (0.25, 0) m is tied also by ties.a, to something else; {SLAVE}",
        ),
        (
            lambda: [bond("ties.a", [4, 4], [0, 1], [0.5, 0.75])],
            f"ties.a: the node at (0.75, 0) m is tied twice, to different places; {SLAVE}",
        ),
        (
            lambda: [bond("ties.a", [4], [0, 1], [1.0]), bond("ties.b", [0], [4, 3], [1.0])],
            "ties.a: nodes hang on nothing but each other in a circle of ties: ties.a, ties.b; exchange slave and master",
        ),
    ],
)
def test_ties_that_contradict_each_other_are_refused(bonds, message):
    with pytest.raises(CaseError) as caught:
        tie_transformation(10, bonds())
    assert str(caught.value) == message


def test_a_node_beside_the_master_says_how_far_and_where_to_move_it():
    found = tie(np.array([[0.5, 0.003]]), line([0, 1]), where="w", tolerance=0.01)
    assert found.distance[0] == pytest.approx(0.003)
    np.testing.assert_allclose(found.point, [[0.5, 0]], atol=1e-15)
    assert math.isclose(found.weights.sum(), 1.0)


@pytest.mark.parametrize("symmetric", [True, False])
def test_rows_that_know_of_no_tie_stay_and_the_others_are_those_of_the_product(symmetric):
    rng = np.random.default_rng(3)
    n = 30
    matrix = sp.random_array((n, n), density=0.1, format="csr", rng=rng) + sp.eye_array(n)
    matrix = sp.csr_array(matrix + matrix.T if symmetric else matrix)
    shares = sp.eye_array(n).tolil()
    for follower, leaders in ((3, [7, 8]), (20, [1, 7, 29])):
        shares[follower] = 0.0
        shares[follower, leaders] = rng.random(len(leaders))
    transformation = sp.csr_array(shares)
    found = Tied(transformation, np.array([3, 20])).within(matrix)
    assert found.toarray() == pytest.approx((transformation.T @ matrix @ transformation).toarray(), rel=1e-14)
    assert found.has_sorted_indices
    apart = np.setdiff1d(np.arange(n), [3, 20, 1, 7, 8, 29, *np.flatnonzero(matrix[:, [3, 20]].sum(axis=1))])
    assert len(apart) > 5
    assert np.array_equal(found[apart].toarray(), matrix[apart].toarray())
