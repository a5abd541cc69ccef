"""Chamfers of pads as masters in space are edges, facets of curves are none, and what cannot be told is said."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from stridor.contact.creases import creases
from stridor.contact.facet_edges import corners_of, edges_of
from stridor.contact.facets import CORNER_DEG, FacetSurface
from stridor.mesh.facets import reference_nodes, shape_functions
from stridor.study.description import edge_warnings

KINDS = ("triangle", "quad", "triangle6", "quad8", "quad9")


def extruded(profile, ys, kind, rng=None) -> FacetSurface:
    """Facets of a kind over a profile (n, 2) in x and z, from y to y; quadratic ones straight."""
    points, cells = np.array([[x, y, z] for y in ys for x, z in profile], dtype=float), []
    n = len(profile)
    for j, i in itertools.product(range(len(ys) - 1), range(n - 1)):
        a, b, c, d = j * n + i, j * n + i + 1, (j + 1) * n + i + 1, (j + 1) * n + i
        flipped = rng is not None and rng.random() < 0.5
        split = [[a, b, d], [b, c, d]] if flipped else [[a, b, c], [a, c, d]]
        cells += split if kind.startswith("triangle") else [[a, b, c, d]]
    return surface_of(points, np.array(cells), kind)


def surface_of(points, cells, kind, middles=lambda x: x) -> FacetSurface:
    """With corners of linear cells, and nodes of a kind between them, moved to where they belong."""
    linear = "triangle" if kind.startswith("triangle") else "quad"
    at = np.einsum("rc,fcd->frd", shape_functions(linear, reference_nodes(kind))[0], points[cells])
    whole, first, number = np.unique(np.round(at.reshape(-1, 3), 9), axis=0, return_index=True, return_inverse=True)
    del whole
    return FacetSurface.from_facets(
        middles(at.reshape(-1, 3)[first]), {kind: number.reshape(at.shape[:2])}, where="w"
    )  # fmt: skip


def pad(rng, kind):
    """A pad with one chamfer or two of 5° to 45°, somewhere in space: its surface, points over it and their gaps."""
    length, sides = rng.uniform(20, 60), rng.integers(1, 3)
    angle, wide, rows = np.radians(rng.uniform(5, 45, 2)), rng.uniform(1, 8, 2), rng.integers(1, 4, 2)
    down = [[(-t * w, -t * w * np.tan(a)) for t in np.linspace(1, 0, k + 1)[:-1]]
            for w, a, k in zip(wide, angle, rows, strict=True)]  # fmt: skip
    right = [(length - x, z) for x, z in down[1][::-1]] if sides == 2 else []
    top = [(x, 0.0) for x in np.linspace(0, length, rng.integers(3, 30))]
    ys = np.linspace(0, rng.uniform(10, 40), rng.integers(2, 9))
    surface = extruded([*down[0], *top, *right], ys, kind, rng)
    which, y, gap = rng.integers(0, sides + 1, 40), rng.uniform(0.1, ys[-1] - 0.1, 40), rng.uniform(0, 0.5, 40)
    over = []
    for side, t, g in zip(which, rng.random(40), gap, strict=True):
        if side == 0:
            over.append((t * length, g))
        else:
            a, x = angle[side - 1], t * wide[side - 1]
            place = np.array([-x, -x * np.tan(a)]) + g * np.array([-np.sin(a), np.cos(a)])
            over.append((place[0] if side == 1 else length - place[0], place[1]))
    points = np.column_stack([[x for x, _ in over], y, [z for _, z in over]])
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    turn = turn * np.sign(np.linalg.det(turn))
    blocks = {k: surface.nodes[b] for k, b in surface.blocks.items()}
    return FacetSurface.from_facets(surface.positions @ turn.T, blocks, where="w"), points @ turn.T, gap


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(6))
def test_gaps_over_a_chamfered_pad_are_those_of_its_planes(kind, seed):
    surface, points, gap = pad(np.random.default_rng(seed), kind)
    np.testing.assert_allclose(surface.locate(points).gap, gap, atol=1e-12)
    assert not len(surface.doubtful)


@pytest.mark.parametrize("kind", ["triangle", "quad"])
@pytest.mark.parametrize("rows", [1, 2, 3])
def test_chamfers_all_round_a_pad_meet_in_edges_too(kind, rows):
    """A pyramid's flanks, in meshes whose diagonals follow where two meet."""
    angle, wide, size = np.radians(20.0), 3.0, 12.0
    way = np.concatenate([np.linspace(-wide, 0, rows + 1)[:-1], np.linspace(0, size, 5), size + np.linspace(0, wide, rows + 1)[1:]])
    n = len(way)
    xy = np.array([[x, y] for y in way for x in way])
    off = np.max([-xy[:, 0], xy[:, 0] - size, -xy[:, 1], xy[:, 1] - size, 0 * xy[:, 0]], axis=0)
    points = np.column_stack([xy, -np.tan(angle) * off])
    blocks: dict[str, list[list[int]]] = {"triangle": [], "quad": []}
    for j, i in itertools.product(range(n - 1), repeat=2):
        a, b, c, d = j * n + i, j * n + i + 1, (j + 1) * n + i + 1, (j + 1) * n + i
        falling = (i < rows) != (j < rows)  # the diagonal that goes out of this corner of the pad
        if kind == "quad" and abs(points[[a, c], 2].sum() - points[[b, d], 2].sum()) < 1e-12:
            blocks["quad"].append([a, b, c, d])
        else:
            blocks["triangle"] += [[a, b, d], [b, c, d]] if falling else [[a, b, c], [a, c, d]]
    surface = FacetSurface.from_facets(points, {k: np.array(b) for k, b in blocks.items() if b}, where="w")
    # Along each side of the flat, and out of its corners to those of the surface.
    assert surface.sharp.sum() == 2 * 4 * (4 + rows)
    assert not len(surface.doubtful)


def one_row(kind, across, along, rows, wide, size=(32.0, 22.0)):
    """A pad with chamfers of 30° by as much on all sides of a flat of so many facets, in meshes whose diagonals go out
    of its corners: the surface."""
    slope = np.tan(np.radians(30.0))
    x, y = (
        np.concatenate([np.linspace(-wide, 0, rows + 1)[:-1], np.linspace(0, s, n + 1),
                        s + np.linspace(0, wide, rows + 1)[1:]])
        for s, n in zip(size, (across, along), strict=True)
    )  # fmt: skip
    xy = np.array([[u, v] for v in y for u in x])
    off = np.max([-xy[:, 0], xy[:, 0] - size[0], -xy[:, 1], xy[:, 1] - size[1], 0 * xy[:, 0]], axis=0)
    points, n, cells = np.column_stack([xy, -slope * off]), len(x), []
    for j, i in itertools.product(range(len(y) - 1), range(n - 1)):
        a, b, c, d = j * n + i, j * n + i + 1, (j + 1) * n + i + 1, (j + 1) * n + i
        cells += [[a, b, d], [b, c, d]] if (i < rows) != (j < rows) else [[a, b, c], [a, c, d]]
    return surface_of(points, np.array(cells), kind)


@pytest.mark.parametrize("kind", ["triangle", "triangle6"])
@pytest.mark.parametrize("rows", [1, 2])
@pytest.mark.parametrize(("across", "along"), [(1, 1), (3, 1), (1, 3), (5, 1)])
def test_a_flat_of_one_row_between_chamfers_is_told_by_its_width_or_said(kind, rows, across, along):
    over = np.array([[x, y, 0.1] for x in (0.1, 7.0, 16.0, 31.9) for y in (0.1, 9.0, 21.9)])
    narrow = one_row(kind, across, along, rows, 5.0)
    np.testing.assert_allclose(narrow.locate(over).normal, np.tile([0.0, 0.0, 1.0], (12, 1)), atol=1e-12)
    assert not len(narrow.doubtful)
    # Three facets of like widths may be an arc: every edge that is not taken as one is said.
    like = one_row(kind, across, along, rows, 9.0)
    edges = edges_of(like.positions, like.blocks)
    found = creases(edges, corners_of(like.blocks), like.positions, np.radians(CORNER_DEG))
    turns = np.abs(edges.turn) > np.radians(1.0)
    assert turns.sum() == 2 * (across + along) + 4 * rows
    np.testing.assert_array_equal(found.edge | found.doubtful, turns)


def bent(kind, around, along, place, *, uneven=0.0, closed=True) -> FacetSurface:
    rng = np.random.default_rng(around)
    u = (np.arange(around + 1) + uneven * rng.uniform(-1, 1, around + 1)) / around
    if closed:
        u[-1] = u[0] + 1.0
    flat = np.array([[x, y, 0.0] for y in np.linspace(0, 1, along + 1) for x in u])
    n = around + 1
    cells = []
    for j, i in itertools.product(range(along), range(around)):
        a, b, c, d = j * n + i, j * n + i + 1, (j + 1) * n + i + 1, (j + 1) * n + i
        cells += [[a, b, c], [a, c, d]] if kind.startswith("triangle") else [[a, b, c, d]]
    sheet = surface_of(flat, np.array(cells), kind, lambda x: x)
    points = place(sheet.positions[:, 0], sheet.positions[:, 1])
    whole, number = np.unique(np.round(points, 9), axis=0, return_inverse=True)
    return FacetSurface.from_facets(whole, {k: number.ravel()[b] for k, b in sheet.blocks.items()}, where="w")


def cylinder(u, v):
    return np.column_stack([np.cos(2 * np.pi * u), np.sin(2 * np.pi * u), v])


def ball(u, v):
    up = 1.6 * (v - 0.5)
    return np.column_stack([np.cos(2 * np.pi * u) * np.cos(up), np.sin(2 * np.pi * u) * np.cos(up), np.sin(up)])


def torus(u, v):
    r, w = 3 + np.cos(5.8 * v), 5.8 * v
    return np.column_stack([np.cos(2 * np.pi * u) * r, np.sin(2 * np.pi * u) * r, np.sin(w)])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("place", "around"), [*itertools.product([cylinder, ball, torus], [12, 30]), (cylinder, 200)])
def test_facets_of_curves_are_no_edges(kind, place, around):
    surface = bent(kind, around, around if place is torus else 6, place, uneven=0.3 if around > 12 else 0.0)
    assert not surface.sharp.any()
    assert not len(surface.doubtful)


@pytest.mark.parametrize("around", [4, 8])
def test_few_quadratic_faces_are_a_curve_and_few_linear_ones_edges_that_may_be_one(around):
    assert not bent("quad8", around, 2, cylinder).sharp.any()
    linear = bent("quad", around, 2, cylinder)
    assert linear.sharp.sum() == 2 * 2 * around
    # A square tube has edges. Of an octagon that cannot be told.
    assert len(linear.doubtful) == (0 if around == 4 else 2 * around)


def fillet(facets, *, tangent: bool):
    """Flats on both sides of an arc of 45°: through points of the arc, or with all turns alike."""
    step = np.radians(45.0) / (facets if tangent else facets + 1)
    slopes = step * (np.arange(facets) + (0.5 if tangent else 1.0))
    arc = np.cumsum(np.column_stack([np.cos(slopes), -np.sin(slopes)]), axis=0)
    flat = [(x, 0.0) for x in np.linspace(-8, 0, 5)]
    out = np.array([np.cos(np.radians(45.0)), -np.sin(np.radians(45.0))])
    return [*flat, *map(tuple, arc), *(tuple(arc[-1] + t * out) for t in (2.0, 4.0, 6.0))]


@pytest.mark.parametrize("kind", ["triangle", "quad", "quad8"])
@pytest.mark.parametrize(("middle", "said"), [(11.0, 4), (15.0, 4), (16.0, 0)])
def test_three_facets_between_ends_are_edges_where_the_one_amid_is_far_wider(kind, middle, said):
    slope = 5.0 * np.tan(np.radians(20.0))
    profile = [(-5.0, -slope), (0.0, 0.0), (middle, 0.0), (middle + 5.0, -slope)]
    surface = extruded(profile, [0.0, 4.0, 9.0], kind)
    # Far from the others: three times their width along the slope.
    assert len(surface.doubtful) == said
    assert surface.sharp.any() == (not said)


@pytest.mark.parametrize("kind", ["triangle", "quad", "quad8"])
@pytest.mark.parametrize("facets", [2, 3, 4, 8])
@pytest.mark.parametrize("tangent", [True, False])
def test_fillets_are_curves(kind, facets, tangent):
    surface = extruded(fillet(facets, tangent=tangent), np.linspace(0, 10, 4), kind)
    assert not surface.sharp.any()
    assert not len(surface.doubtful)


@pytest.mark.parametrize("kind", ["triangle", "quad", "quad8"])
def test_two_edges_with_one_facet_between_them_cannot_be_told_and_are_said(kind):
    surface = extruded(fillet(1, tangent=False), np.linspace(0, 10, 4), kind)
    assert not surface.sharp.any()
    assert len(surface.doubtful) == 2 * 3
    np.testing.assert_allclose(np.degrees(surface.doubtful[:, 3]), 22.5)
    seen = SimpleNamespace(name="c", master=surface, location=surface.locate(surface.positions))
    (said,) = edge_warnings(SimpleNamespace(surfaces=[seen]))
    assert said == (
        "contact c: edges of the master turn by 22.5° amid what is flat, the first at (0, 1.66667, 0) m: a chamfer or flat of one "
        "row of facets or a curve, it is taken as a curve; mesh it with two rows if it has edges there"
    )
    apart = SimpleNamespace(name="c", master=surface, location=surface.locate(surface.positions[:1] * [0.99, 0, 0]))
    assert not edge_warnings(SimpleNamespace(surfaces=[apart]))


def test_coarse_linear_curves_are_said():
    surface = bent("quad", 8, 2, cylinder)
    seen = SimpleNamespace(name="c", master=surface, location=surface.locate(surface.positions))
    (said,) = edge_warnings(SimpleNamespace(surfaces=[seen]))
    assert "turn by 45° one after the other" in said
    assert "taken as edges; divide it into more facets if it is a curve" in said


def chamfered():
    return extruded([*[(x, 0.0) for x in (0.0, 1.0, 2.0, 3.0, 4.0)], (5.0, -np.tan(np.radians(20.0)))], [0, 1, 2], "quad")


@pytest.mark.parametrize(("own_deg", "seen_deg"), [(0.0, 0.0), (7.0, 7.0), (-12.0, 0.0), (35.0, 20.0)])
def test_a_slave_on_an_edge_looks_its_own_way_between_those_of_the_sides(own_deg, seen_deg):
    def at(deg):
        return np.array([np.sin(np.radians(deg)), 0.0, np.cos(np.radians(deg))])

    surface = chamfered()
    for x, y in ((4.0, 0.3), (4.0, 1.0), (4.0 + 1e-9, 0.5), (4.0 - 1e-9, 0.5)):
        there = np.array([[x, y, 0.0]])
        found = surface.at_corners(surface.locate(there), there, -at(own_deg)[None])
        assert found.normal[0] == pytest.approx(at(seen_deg), abs=1e-9)
        assert abs(found.gap[0]) < 2e-9
    beside = np.array([[3.99, 0.5, 0.0]])
    assert surface.at_corners(surface.locate(beside), beside, -at(7.0)[None]).normal[0] == pytest.approx(at(0.0))


@pytest.mark.parametrize(("own_deg", "seen_deg"), [(0.0, 0.0), (-7.0, -7.0), (12.0, 0.0), (-35.0, -20.0)])
def test_a_slave_on_an_inward_edge_looks_its_own_way_too(own_deg, seen_deg):
    def at(deg):
        return np.array([np.sin(np.radians(deg)), 0.0, np.cos(np.radians(deg))])

    rising = [*[(x, 0.0) for x in (0.0, 1.0, 2.0, 3.0, 4.0)], (5.0, np.tan(np.radians(20.0)))]
    surface = extruded(rising, [0, 1, 2], "quad")
    for x, y in ((4.0, 0.3), (4.0, 1.0), (4.0 + 1e-9, 0.5), (4.0 - 1e-9, 0.5)):
        there = np.array([[x, y, 0.0]])
        found = surface.at_corners(surface.locate(there), there, -at(own_deg)[None])
        assert found.normal[0] == pytest.approx(at(seen_deg), abs=1e-9)
        assert abs(found.gap[0]) < 2e-9
    beside = np.array([[3.99, 0.5, 0.0]])
    assert surface.at_corners(surface.locate(beside), beside, -at(-7.0)[None]).normal[0] == pytest.approx(at(0.0))
    unknown = surface.at_corners(surface.locate(beside), beside, np.zeros((1, 3)))
    assert unknown.normal == pytest.approx(surface.locate(beside).normal)


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_where_edges_meet_a_slave_looks_its_own_way_amid_all_sides(up):
    """At the top of a pyramid and at the ground of a pit of three sides, none of which lets the middle way out."""
    azimuths = np.radians([0.0, 120.0, 240.0])
    tips = np.column_stack([np.cos(azimuths), np.sin(azimuths), np.full(3, -0.6 * up)])
    cells = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1]])
    surface = surface_of(np.concatenate([np.zeros((1, 3)), tips]), cells, "triangle")
    assert surface.sharp.sum() == 6
    slave = np.zeros((1, 3))
    for own in ([0.0, 0.0, 1.0], [0.1, 0.05, 1.0], [-0.05, 0.1, 1.0]):
        own = np.array(own) / np.linalg.norm(own)
        found = surface.at_corners(surface.locate(slave), slave, -own[None])
        assert found.normal[0] == pytest.approx(own, abs=1e-12)
