"""Finished parts of a comparison as plain data, to be kept between calls and taken up again."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from ..temporal.growth import Growth
from ..temporal.signals import Components
from .small_motion import Perturbation

Plain = Mapping[str, Any]


class PartStore(Protocol):
    """Where finished parts are put and sought, by name and friction coefficient."""

    def get(self, part: str, mu: float | None) -> Plain | None:
        """What was put there for the same case by an earlier call, None if nothing was."""
        ...

    def put(self, part: str, mu: float | None, data: Plain) -> None:
        """Keep finished data from now on."""
        ...


def float_of(data: Plain | None, name: str) -> float | None:
    """A number of kept data, None where it is none."""
    value = None if data is None else data.get(name)
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def bool_of(data: Plain | None, name: str) -> bool | None:
    """A truth value of kept data, None where it is none."""
    value = None if data is None else data.get(name)
    return value if isinstance(value, bool) else None


def pair_of(value: complex) -> list[float]:
    """A complex number as [re, im]."""
    return [float(value.real), float(value.imag)]


def perturbation_data(p: Perturbation) -> dict[str, Any]:
    """A perturbation without its shape, which is compared at once and not kept."""
    return {
        "eigenvalue": pair_of(p.eigenvalue),
        "signal": [float(v) for v in p.signal],
        "sampling": float(p.sampling),
        "components": [pair_of(complex(v)) for v in p.components.eigenvalues],
        "amplitudes": [float(v) for v in p.components.amplitudes],
        "untold": p.untold,
        "left": p.left,
        "grown": p.grown,
    }


def perturbation_of(mu: float, data: Plain) -> Perturbation:
    """The perturbation that `perturbation_data` made data of."""
    found = np.array([complex(*pair) for pair in data["components"]], dtype=complex)
    components = Components(found, np.array(data["amplitudes"], dtype=float))
    signal = np.array(data["signal"], dtype=float)
    return Perturbation(
        mu, complex(*data["eigenvalue"]), signal, float(data["sampling"]), components,
        untold=str(data["untold"]), left=bool(data["left"]), grown=bool(data["grown"]),
    )  # fmt: skip


def growth_data(fitted: Growth | None) -> dict[str, Any] | None:
    """A fit of growth as plain data."""
    return None if fitted is None else vars(fitted).copy()


def growth_of(data: Plain | None) -> Growth | None:
    """The fit that `growth_data` made data of."""
    return None if data is None else Growth(**data)
