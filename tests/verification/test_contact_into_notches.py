"""Slave nodes in inward edges and corners of a master: an even pressure comes through, whatever rounding, order and side.

The truth are the consistent forces of an even pressure on both bodies. Where meshes match, forces along the normals of
the nodes must be able to be these; at a node in a notch the normal is then that of the sum of its shares of both sides.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from stridor.contact.curve import Curve
from stridor.contact.facets import FacetSurface
from stridor.mesh.facets import reference_nodes, shape_functions
from verification.test_contact_patch import both, contact_of, rotation

pytestmark = pytest.mark.verification

SPACE = ("triangle", "triangle6", "quad", "quad8", "quad9")
# Of facets seen from the other side.
REVERSED = {
    "line": [1, 0], "line3": [1, 0, 2], "triangle": [0, 2, 1], "triangle6": [0, 2, 1, 5, 4, 3], "quad": [0, 3, 2, 1],
    "quad8": [0, 3, 2, 1, 7, 6, 5, 4], "quad9": [0, 3, 2, 1, 7, 6, 5, 4, 8],
}  # fmt: skip


def meshed(kind, cells):
    """Points and facets of a kind on linear cells (f, r, d)."""
    linear = "line" if cells.shape[2] == 2 else "triangle" if cells.shape[1] == 3 else "quad"
    points = np.einsum("rc,fcd->frd", shape_functions(linear, reference_nodes(kind))[0], cells)
    whole = points.reshape(-1, cells.shape[2])
    _, first, number = np.unique(np.round(whole, 9), axis=0, return_index=True, return_inverse=True)
    return whole[first], {kind: number.reshape(points.shape[:2])}


def line(kind, left, right, *, slopes=(30.0, 30.0)):
    """A groove in the plane, open upwards, with its ground at the origin: flanks at angles [°] to the level, divided at
    distances from the ground. Outward is up."""
    sides = [np.radians(180.0 - slopes[0]), np.radians(slopes[1])]
    before, after = (
        np.array(at)[:, None] * [np.cos(angle), np.sin(angle)] for at, angle in zip((left, right), sides, strict=True)
    )
    nodes = np.concatenate([before[::-1], [[0.0, 0.0]], after])[::-1]
    return meshed(kind, np.stack([nodes[:-1], nodes[1:]], axis=1))


def split(cells, kind, seed):
    """Quadrilaterals (f, 4, 3), for triangles cut across either diagonal, without a seed all across the first."""
    if not kind.startswith("triangle"):
        return cells
    ways = np.zeros(len(cells), dtype=int) if seed is None else np.random.default_rng(seed).integers(0, 2, len(cells))
    pairs = ([[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]])
    return np.concatenate([cell[pairs[way]] for cell, way in zip(cells, ways, strict=True)])


def patches(first, second):
    """Parallelograms (f, 4, 3) between multiples (·, 3) of two directions out of the origin, normal first × second."""
    a = np.concatenate([np.zeros((1, 3)), first])
    b = np.concatenate([np.zeros((1, 3)), second])
    return np.array([
        [a[i] + b[j], a[i + 1] + b[j], a[i + 1] + b[j + 1], a[i] + b[j + 1]]
        for i, j in itertools.product(range(len(a) - 1), range(len(b) - 1))
    ])  # fmt: skip


def groove(kind, left, right, along, *, slopes=(30.0, 30.0), seed=0):
    """A groove along y in space, open upwards, its ground on the y axis."""
    angles = np.radians([180.0 - slopes[0], slopes[1]])
    out = [np.array(at)[:, None] * [np.cos(a), 0.0, np.sin(a)] for at, a in zip((left, right), angles, strict=True)]
    ground = np.array(along)[:, None] * [0.0, 1.0, 0.0]
    cells = np.concatenate([patches(ground, out[0]), patches(out[1], ground)])
    return meshed(kind, split(cells, kind, seed))


def pit(kind, steps, *, rise=0.6, seed=0):
    """A pit of three flanks that meet at the origin, open upwards: edges at azimuths of 0°, 130° and 235°, divided at
    distances from the origin."""
    azimuths = np.radians([0.0, 130.0, 235.0])
    edges = np.column_stack([np.cos(azimuths), np.sin(azimuths), np.full(3, rise)])
    out = [np.array(step)[:, None] * edge for step, edge in zip(steps, edges, strict=True)]
    cells = np.concatenate([patches(out[i], out[(i + 1) % 3]) for i in range(3)])
    return meshed(kind, split(cells, kind, seed))


def turned(surface):
    """The same facets seen from the other side."""
    points, blocks = surface
    return points, {kind: block[:, REVERSED[kind]] for kind, block in blocks.items()}


def mirrored(surface):
    """What a mirror across x shows."""
    points, blocks = turned(surface)
    return points * np.where(np.arange(points.shape[1]) == 0, -1.0, 1.0), blocks


def renumbered(surface, seed):
    """Nodes and facets in another order."""
    rng = np.random.default_rng(seed)
    points, blocks = surface
    order = rng.permutation(len(points))
    number = np.argsort(order)
    return points[order], {kind: number[block[rng.permutation(len(block))]] for kind, block in blocks.items()}


def looks(part, of):
    """A surface as it is, mirrored, renumbered, and somewhere else."""
    return {
        "as it is": lambda: part,
        "mirrored": lambda: mirrored(part),
        "renumbered": lambda: renumbered(part, 5),
        "moved": lambda: placed(part),
    }[of]()


def placed(part):
    """Turned and moved, so that every coordinate is rounded."""
    points, blocks = part
    turn = rotation(3)
    turn = turn if np.linalg.det(turn) > 0 else -turn
    angle = 0.7
    plane = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return points @ (turn if points.shape[1] == 3 else plane).T + 0.377, blocks


def shares(slave, master):
    """The contact, the pressures (m,) by which its nodes come nearest to the consistent forces of an even pressure of
    one, and by how much of the largest force they miss them."""
    contact = contact_of(slave, master)
    _, loads = both(slave, master, contact)
    push = (contact.nodes.normal.T.toarray()) * contact.nodes.area
    pressure = np.linalg.lstsq(push, loads)[0]
    return contact, pressure, np.abs(push @ pressure - loads).max() / np.abs(loads).max()


@pytest.mark.parametrize("seen", ["as it is", "mirrored", "renumbered", "moved"])
@pytest.mark.parametrize("groove_is", ["master", "slave"])
@pytest.mark.parametrize("slopes", [(30.0, 30.0), (12.0, 30.0), (65.0, 40.0)])
@pytest.mark.parametrize("kind", ["line", "line3"])
def test_an_even_pressure_into_a_groove_in_the_plane(kind, slopes, groove_is, seen):
    low = looks(line(kind, [1.0, 1.6, 2.1, 3.0], [0.5, 1.0, 2.0, 2.5], slopes=slopes), seen)
    slave, master = (turned(low), low) if groove_is == "master" else (low, turned(low))
    assert len(Curve.from_facets(*master, where="w").corners) == 1
    contact, pressure, missed = shares(slave, master)
    assert len(pressure) == len(low[0])
    assert missed < 1e-9
    ground = int(np.argmin(pressure))
    # What the shares of both sides, 1 and 0.5 long, come to as vectors.
    turn = np.radians(sum(slopes))
    assert pressure[ground] == pytest.approx(np.hypot(1.0 + 0.5 * np.cos(turn), 0.5 * np.sin(turn)) / 1.5, rel=1e-9)
    np.testing.assert_allclose(np.delete(pressure, ground), 1.0, rtol=1e-9)
    assert abs(contact.location.gap).max() < 1e-12


@pytest.mark.parametrize("seen", ["as it is", "mirrored", "renumbered", "moved"])
@pytest.mark.parametrize("groove_is", ["master", "slave"])
@pytest.mark.parametrize("shape", ["groove", "steep groove", "pit"])
@pytest.mark.parametrize("kind", SPACE)
def test_an_even_pressure_into_a_groove_and_a_pit_in_space(kind, shape, groove_is, seen):
    if shape == "pit":
        low = pit(kind, ([0.8, 1.7, 2.5], [1.0, 2.0, 3.0], [0.6, 1.5, 2.4]))
    else:
        slopes = (12.0, 17.0) if shape == "groove" else (60.0, 35.0)
        low = groove(kind, [1.0, 2.0, 3.0], [0.6, 1.4, 2.3, 3.0], [0.7, 1.5, 2.0], slopes=slopes)
    low = looks(low, seen)
    slave, master = (turned(low), low) if groove_is == "master" else (low, turned(low))
    assert FacetSurface.from_facets(*master, where="w").sharp.any()
    contact, pressure, missed = shares(slave, master)
    assert len(pressure) == len(low[0])
    assert missed < 1e-9
    assert 0.5 < pressure.min() < 0.995
    assert pressure.max() < 1.0 + 1e-9
    assert abs(contact.location.gap).max() < 1e-12


@pytest.mark.parametrize("groove_is", ["master", "slave"])
@pytest.mark.parametrize("kinds", [("line", "line"), ("line3", "line"), ("quad", "triangle"), ("quad8", "quad9")])
def test_what_is_symmetric_has_no_force_to_one_side_on_meshes_that_do_not_match(kinds, groove_is):
    def shape(kind, steps, along):
        return line(kind, steps, steps) if kind.startswith("line") else groove(kind, steps, steps, along, seed=None)

    low = shape(kinds[0], [1.0, 2.0, 3.0], [1.0, 2.0])
    top = turned(shape(kinds[1], [0.7, 1.4, 2.2, 3.0], [0.5, 1.1, 2.0]))
    for mirror, order in itertools.product((False, True), range(3)):
        parts = [mirrored(part) if mirror else part for part in (low, top)]
        one, two = (renumbered(part, order) if order else part for part in parts)
        slave, master = (two, one) if groove_is == "master" else (one, two)
        contact = contact_of(slave, master)
        force = (contact.nodes.area[:, None] * contact.nodes.normals).sum(axis=0)
        assert abs(force[:-1]).max() < 1e-12 * abs(force[-1])


def test_a_ridge_in_a_steep_lopsided_groove_takes_part_whichever_flank_is_nearer():
    for seen, groove_is in itertools.product(("as it is", "mirrored", "renumbered", "moved"), ("master", "slave")):
        low = looks(line("line", [1.0, 2.0, 3.0], [0.05, 0.1, 0.2, 1.0, 2.0], slopes=(75.0, 60.0)), seen)
        slave, master = (turned(low), low) if groove_is == "master" else (low, turned(low))
        _, pressure, missed = shares(slave, master)
        assert len(pressure) == len(low[0])
        assert missed < 1e-9


def test_places_on_a_hollow_that_is_smooth_stay_as_they_are():
    angles = np.radians(np.linspace(-150.0, -30.0, 13))
    ring = np.column_stack([np.cos(angles), np.sin(angles)])[::-1]
    flat = Curve.from_facets(*meshed("line", np.stack([ring[:-1], ring[1:]], axis=1)), where="w")
    found = flat.locate(flat.positions)
    assert flat.at_corners(found, flat.positions, np.full_like(flat.positions, 0.6)) is found
    wide = np.array([[[*a, 0.0], [*b, 0.0], [*b, 1.0], [*a, 1.0]] for a, b in itertools.pairwise(ring)])
    hollow = FacetSurface.from_facets(*meshed("quad", wide), where="w")
    found = hollow.locate(hollow.positions)
    assert hollow.at_corners(found, hollow.positions, np.full_like(hollow.positions, 0.6)) is found
