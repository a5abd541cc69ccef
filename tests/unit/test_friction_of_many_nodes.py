"""Coefficients at which sticking ends, of many nodes that each slide at a speed of their own."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from stridor.laws import Coulomb
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
    laws = (Coulomb(0.3), Coulomb(0.5))
    nodes = SimpleNamespace(
        count=len(speed), owner=owner, laws=laws, share=np.ones(len(speed)),
        friction_coefficients=lambda v: np.array([0.3, 0.5])[owner] + 0 * v
    )
    Counted.comparisons = 0
    sliding, sticking = _coefficients(cast("Any", nodes), speed.view(Speeds), mu)
    for k, v in enumerate(speed):
        law = laws[owner[k]] if mu is None else laws[owner[k]].scaled(mu, float(v))
        assert sticking[k] == max(law.sticking, law.sliding(float(v)))
    assert sliding.shape == sticking.shape
    assert Counted.comparisons <= 10 * len(speed)
