"""What following sees is plain values, which documents are made of."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any

import numpy as np

from stridor.modal.krylov.passages import crossings


def state(mu: float, rate: float, slope: float) -> Any:
    return SimpleNamespace(mu=mu, values=np.array([rate + 1j]), tangents=np.array([slope + 0j]), index=np.arange(1))


def test_growth_that_begins_on_the_axis() -> None:
    (found,) = crossings(state(0.0, 0.0, 0.01), state(1.0, 0.01, 0.01))
    assert (found.low, found.high) == (0.0, 1.0)
    assert json.dumps(found.stabilising) == "false"
