"""Pieces of slave facets over the facets of a master: how many pairs are looked at, and that nothing is lost."""

from __future__ import annotations

import numpy as np
import pytest

from stridor.contact import pieces as module
from stridor.contact.coupling import SlaveFacets, coupled
from stridor.contact.facets import FacetSurface


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
