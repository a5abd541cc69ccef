"""Normals where curved surfaces of linear facets end, against those of the surfaces through their nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from stridor.contact.facets import FacetSurface
from stridor.typing import Array

Shape = Callable[[Array, Array], tuple[Array, Array]]  # points and normals (k, 3) over u and v in [0, 1]


def cylinder(u: Array, v: Array) -> tuple[Array, Array]:
    t = u - 0.5
    radial = np.column_stack([np.sin(t), 0 * t, np.cos(t)])
    return radial + np.column_stack([0 * t, 0.3 * v, 0 * t]), radial


def sphere(u: Array, v: Array) -> tuple[Array, Array]:
    a, b = 0.9 * (u - 0.5), 0.9 * (v - 0.5)
    radial = np.column_stack([np.tan(a), np.tan(b), np.ones_like(a)])
    radial /= np.linalg.norm(radial, axis=1, keepdims=True)
    return radial, radial


def saddle(u: Array, v: Array) -> tuple[Array, Array]:
    x, y = u - 0.5, v - 0.5
    normal = np.column_stack([-0.8 * x, 0.8 * y, np.ones_like(x)])
    return np.column_stack([x, y, 0.4 * (x**2 - y**2)]), normal / np.linalg.norm(normal, axis=1, keepdims=True)


def flat(u: Array, v: Array) -> tuple[Array, Array]:
    return np.column_stack([u, v, 0 * u]), np.tile([0.0, 0.0, 1.0], (len(u), 1))


def angles(shape: Shape, nu: int, nv: int, *, triangles: bool, shift: float = 0.0) -> tuple[Array, Array]:
    """By how many degrees normals at nodes are off: averaged ones and those that are continued where it ends."""
    u, v = np.meshgrid(np.linspace(0, 1, nu + 1), np.linspace(0, 1, nv + 1), indexing="ij")
    rng = np.random.default_rng(0)
    u, v = (x + shift / n * rng.uniform(-1, 1, x.shape) * ((x > 0) & (x < 1)) for x, n in ((u, nu), (v, nv)))
    at = np.arange((nu + 1) * (nv + 1)).reshape(nu + 1, nv + 1)
    facets = np.column_stack([a.ravel() for a in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:])])
    points, normals = shape(u.ravel(), v.ravel())
    blocks = {"triangle": np.concatenate([facets[:, [0, 1, 2]], facets[:, [0, 2, 3]]])} if triangles else {"quad": facets}
    surface = FacetSurface.from_facets(points, blocks, where="w")
    averaged = replace(surface, rim=sp.csr_array(surface.rim.shape))
    nodes, valid = surface.facets, surface.facets >= 0

    def off(one: FacetSurface) -> Array:
        found = one.corner_normals(one.positions)[valid]
        return np.degrees(np.linalg.norm(np.cross(found, normals[nodes[valid]]), axis=1))

    return off(averaged), off(surface)


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize(("nu", "nv"), [(6, 1), (6, 4), (3, 2)])
def test_a_piece_of_a_cylinder_has_its_own_normals_at_its_ends(nu: int, nv: int, triangles: bool) -> None:
    averaged, found = angles(cylinder, nu, nv, triangles=triangles)
    assert averaged.max() == pytest.approx(np.degrees(0.5 / nu), rel=1e-2)
    assert found.max() < 1e-9


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("shape", [sphere, saddle])
def test_ends_of_surfaces_that_turn_both_ways(shape: Shape, triangles: bool) -> None:
    averaged, found = angles(shape, 12, 8, triangles=triangles)
    assert found.max() < 0.2 * averaged.max()
    assert found.mean() < 0.2 * averaged.mean()
    # Finer ones are better, as those that are averaged are.
    finer = angles(shape, 24, 16, triangles=triangles)
    assert finer[0].max() > 0.45 * averaged.max()
    assert finer[1].max() < 0.55 * found.max()


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("shape", [cylinder, sphere, saddle])
def test_uneven_facets_are_not_made_worse(shape: Shape, triangles: bool) -> None:
    averaged, found = angles(shape, 12, 8, triangles=triangles, shift=0.25)
    assert found.max() <= averaged.max() * (1 + 1e-12)
    assert found.mean() <= averaged.mean() * (1 + 1e-12)


@pytest.mark.parametrize("sectors", [6, 12, 24])
def test_a_round_end_of_a_sphere_turns_out_by_half_a_ring(sectors: int) -> None:
    """Along it averages are right, so that only what lies across is continued."""
    t, r = 2 * np.pi * np.arange(sectors) / sectors, np.linspace(0.1, 0.5, 5)
    flat_ = np.array([[a * np.cos(b), a * np.sin(b)] for a in r for b in t])
    points = np.column_stack([flat_, np.sqrt(1 - np.sum(flat_**2, axis=1))])
    k, j = np.divmod(np.arange(4 * sectors), sectors)
    following = (j + 1) % sectors
    facets = np.column_stack([k * sectors + j, (k + 1) * sectors + j, (k + 1) * sectors + following, k * sectors + following])
    surface = FacetSurface.from_facets(points, {"quad": facets}, where="w")
    averaged = replace(surface, rim=sp.csr_array(surface.rim.shape))
    off = [
        np.degrees(np.linalg.norm(np.cross(s.corner_normals(points)[-sectors:, 1], points[-sectors:]), axis=1)).max()
        for s in (averaged, surface)
    ]
    assert off[1] < 0.35 * off[0]


def test_a_flat_that_ends_beside_a_fillet_stays_flat_there() -> None:
    t = np.radians(15.0) * np.arange(7)
    edge = np.array([[-1.0, 0.0], *np.column_stack([0.2 * np.sin(t), 0.2 * (np.cos(t) - 1)])])
    points = np.array([[x, y, z] for x, z in edge for y in (0.0, 0.3)])
    facets = np.array([[2 * k + 1, 2 * k, 2 * k + 2, 2 * k + 3] for k in range(7)])
    surface = FacetSurface.from_facets(points, {"quad": facets}, where="w")
    found = surface.corner_normals(points)
    assert found[0, :2] == pytest.approx(np.tile([0.0, 0.0, 1.0], (2, 1)), abs=1e-12)


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize(("nu", "nv"), [(1, 1), (6, 1), (6, 4)])
def test_flat_surfaces_stay_as_they_are(nu: int, nv: int, triangles: bool) -> None:
    _, found = angles(flat, nu, nv, triangles=triangles, shift=0.25)
    assert found.max() < 1e-13


def test_a_sharp_edge_ends_both_surfaces() -> None:
    """A quarter of a cylinder that a plane goes on from at a right angle: neither takes part in the other's normals."""
    t = np.linspace(0, 0.5 * np.pi, 7)
    points = np.array([[np.sin(a), y, np.cos(a)] for a in t for y in (0.0, 0.3)] + [[2.0, 0.0, 0.0], [2.0, 0.3, 0.0]])
    facets = np.array([[2 * k + 1, 2 * k, 2 * k + 2, 2 * k + 3] for k in range(7)])
    surface = FacetSurface.from_facets(points, {"quad": facets}, where="w")
    found = surface.corner_normals(points)
    for f, own in enumerate(facets[:6]):
        for k, node in enumerate(own):
            assert found[f, k] == pytest.approx(points[node] * [1, 0, 1], abs=1e-12)
    assert found[6] == pytest.approx(np.tile([0.0, 0.0, 1.0], (4, 1)), abs=1e-12)
