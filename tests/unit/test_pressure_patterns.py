"""Patterns of pressure: what a contact without any force brings about."""

from __future__ import annotations

import warnings
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from stridor.contact.coupling import SlaveFacets
from stridor.contact.obstacles import Flat
from stridor.sliding.pattern import unexplained_patterns


@pytest.mark.parametrize("force", [0.0, 1.0])
def test_a_contact_that_touches_without_force_has_no_pattern_and_no_warning(force):
    positions = np.column_stack([np.arange(4.0), np.zeros(4)])
    lines = np.column_stack([np.arange(3), np.arange(1, 4)])
    facets = SlaveFacets.of(positions, {"line": lines}, np.arange(4))
    nodes: Any = SimpleNamespace(count=4, area=np.ones(4), gap=np.zeros(4), closed=np.zeros(4, dtype=bool))
    surface = SimpleNamespace(
        name="rub", nodes=nodes, facets=facets, slave_position=positions, master=Flat(np.zeros(2), np.array([0.0, 1.0])),
        location=SimpleNamespace(normal=np.tile([0.0, 1.0], (4, 1)), gap=np.zeros(4)),
    )  # fmt: skip
    system: Any = SimpleNamespace(contacts=(), surfaces=(surface,), contact_nodes=lambda: nodes)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        told = list(unexplained_patterns(system, np.full(4, force), np.zeros(4), np.ones(4, dtype=bool)))
    assert told == []
