"""Pieces of slave facets over the facets of a master: how many pairs are looked at, and that nothing is lost."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stridor.contact import pieces as module
from stridor.contact.coupling import SlaveFacets, coupled
from stridor.contact.facets import FacetSurface
from stridor.mesh.facets import reference_nodes, triangle_rule
from stridor.mesh.kinds import FACET_REVERSED


def _grid(x, y, *, up):
    """Points (k, 3) at height 0 and quads (f, 4) that look up or down."""
    first, second = np.meshgrid(x, y, indexing="ij")
    points = np.column_stack([first.ravel(), second.ravel(), np.zeros(first.size)])
    n = len(y)
    corner = (np.arange(len(x) - 1)[:, None] * n + np.arange(n - 1)).ravel()
    quads = np.column_stack([corner, corner + n, corner + n + 1, corner + 1])
    return points, quads if up else quads[:, ::-1]


@pytest.mark.parametrize("large", [1.0, 100.0])
def test_one_large_facet_of_the_master_makes_no_neighbours_of_the_small_ones(monkeypatch, large):
    count = 16
    pairs = []
    plain = module._neighbours

    def counted(*given):
        found = plain(*given)
        pairs.append(len(found[0]))
        return found

    monkeypatch.setattr(module, "_neighbours", counted)
    slave, facets = _grid(np.linspace(0, 1, count + 1), np.linspace(0, 1, count + 1), up=False)
    x = np.concatenate([np.linspace(0, 1, count + 1) + 0.3 / count, [1 + large]])
    below, others = _grid(x - 0.6 / count, np.linspace(-0.01, 1.02, count + 1), up=True)
    master = FacetSurface.from_facets(below, {"quad": others}, where="master")
    location = master.locate(slave)
    around = SlaveFacets.of(slave, {"quad": facets}, np.arange(len(slave)))
    found = coupled(around, slave, np.ones(len(slave)), location, master)
    assert sum(pairs) < 40 * count**2
    # Rows of one for a uniform motion, of x and y for a linear one: what patch tests rest on.
    assert found.master.sum(axis=1) == pytest.approx(np.ones(len(slave)), abs=1e-12)
    even = np.full(len(slave), 1.0) * found.area
    assert found.area.sum() == pytest.approx(1.0, rel=1e-12)
    moment = even @ (found.master @ below[:, :2])
    assert moment == pytest.approx([0.5, 0.5], rel=1e-12)


def _sheet(kind, across, up, *, turned):
    """Affine facets of a kind over a parallelogram at height 0, that look up, or down if ``turned``."""
    nodes, triangles = reference_nodes(kind), kind.startswith("triangle")
    cells = []
    for i in range(across):
        for j in range(up):
            cells.append(np.array([i, j]) + nodes)
            if triangles:
                cells.append(np.array([i + 1, j + 1]) - nodes)
    places = np.concatenate(cells) @ [[1.0 / across, 0.0], [0.2 / up, 1.0 / up]]
    points, index = np.unique(np.round(places, 12), axis=0, return_inverse=True)
    block = index.reshape(len(cells), -1)
    return np.column_stack([points, np.zeros(len(points))]), block[:, FACET_REVERSED[kind]] if turned else block


@pytest.mark.parametrize("other", ["triangle", "triangle6", "quad", "quad8", "quad9"])
@pytest.mark.parametrize("own", ["triangle", "triangle6", "quad", "quad8", "quad9"])
def test_integrals_over_affine_facets_are_exact_for_every_pair_of_kinds(monkeypatch, own, other):
    slave, facets = _sheet(own, 2, 3, turned=True)
    below, others = _sheet(other, 3, 2, turned=False)
    slave = slave + [0.0, 0.0, 0.01] * (1.0 + slave[:, :1])
    master = FacetSurface.from_facets(below, {other: others}, where="master")
    around = SlaveFacets.of(slave, {own: facets}, np.arange(len(slave)))

    def found():
        return coupled(around, slave, np.ones(len(slave)), master.locate(slave), master)

    plain, rule = found(), module.triangle_rule
    monkeypatch.setattr(module, "triangle_rule", lambda degree: rule(10))
    finer = found()
    assert abs(plain.master - finer.master).max() < 1e-12
    assert np.abs(plain.gap - finer.gap).max() < 1e-14


@pytest.mark.parametrize("degree", range(1, 9))
def test_rules_of_triangles_are_exact_of_their_degree_and_positive(degree):
    points, weights = triangle_rule(degree)
    assert weights.min() > 0.0
    for a in range(degree + 1):
        for b in range(degree + 1 - a):
            exact = math.factorial(a) * math.factorial(b) / math.factorial(a + b + 2)
            assert weights @ (points[:, 0] ** a * points[:, 1] ** b) == pytest.approx(exact, rel=1e-13)
