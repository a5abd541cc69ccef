"""Coefficients at which sticking ends, of many nodes that each slide at a speed of their own."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from stridor.contact.nodes import ContactNodes
from stridor.laws import Coulomb, Weakening
from stridor.sliding.history import _coefficients


class Counted:
    """Speeds whose comparisons are counted, as a search through all of them for each would make."""

    comparisons = 0


class Speeds(np.ndarray):
    def __eq__(self, other: Any) -> Any:
        Counted.comparisons += np.size(self)
        return np.asarray(self) == other


@pytest.mark.parametrize("mu", [None, 0.2])
def test_each_node_has_its_own_limit_and_none_is_sought_among_all(mu: float | None) -> None:
    speed = np.random.default_rng(1).permutation(np.repeat(np.linspace(0.0, 2.0, 60), 3))
    owner = np.arange(len(speed)) % 2
    m, laws = len(speed), (Coulomb(0.3), Weakening(0.2, 0.5, 0.7))
    nodes = ContactNodes(
        ("plain", "weak"), owner, laws, sp.csr_array((m, 0)), sp.csr_array((m, 0)), np.zeros((m, 1)), np.zeros((m, 1)),
        np.zeros(m), np.ones(m), np.zeros(m), np.zeros((m, 2)), np.zeros((m, 2)), np.zeros((m, 1, 2)), speed=2.0 * speed,
        mean_speed=(2.0, 2.0),
    )  # fmt: skip
    Counted.comparisons = 0
    sliding, sticking = _coefficients(nodes, speed.view(Speeds), mu)
    for k, v in enumerate(speed):
        law = laws[owner[k]] if mu is None else laws[owner[k]].scaled(mu, 2.0)
        assert sliding[k] == pytest.approx(law.sliding(float(v)), rel=1e-14)
        assert sticking[k] == pytest.approx(max(law.sticking, law.sliding(float(v))), rel=1e-14)
    assert sliding.shape == sticking.shape
    assert Counted.comparisons <= 10 * len(speed)
