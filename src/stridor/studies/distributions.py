"""From a number between 0 and 1 to a value of a parameter."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..typing import Array
from .tables import Varied

LEAST = 1e-15  # of a share: normal scores of 0 and 1 are infinite


def grid_values(varied: Varied) -> Array:
    """The points (k,) that a parameter has in a grid."""
    if varied.values is not None:
        return np.array(varied.values)
    assert varied.range is not None, "the study was checked"
    low, high = varied.range
    count = varied.points or 1
    if count == 1:
        return np.array([(low + high) / 2])
    return np.geomspace(low, high, count) if varied.spacing == "logarithmic" else np.linspace(low, high, count)


def quantile(varied: Varied, share: Array) -> Array:
    """Values (n,) below which lie shares (n,) of the distribution."""
    share = np.clip(share, LEAST, 1.0 - 1e-15)
    if varied.values is not None:
        listed = np.array(varied.values)
        return listed[np.minimum((share * len(listed)).astype(int), len(listed) - 1)]
    if varied.range is not None:
        low, high = varied.range
        if varied.spacing == "logarithmic":
            return np.exp(np.log(low) + share * (np.log(high) - np.log(low)))
        return low + share * (high - low)
    # A share of what lies between the limits.
    below, above = _limits(varied)
    found = np.asarray(_shape(varied).ppf(below + share * (above - below)))
    # Rounding in the tails leaves the limits by a hair.
    return np.clip(found, -np.inf if varied.low is None else varied.low, np.inf if varied.high is None else varied.high)


def inside(varied: Varied) -> float:
    """Share of a distribution that lies between its limits."""
    below, above = _limits(varied)
    return above - below


def _limits(varied: Varied) -> tuple[float, float]:
    shape = _shape(varied)
    below = 0.0 if varied.low is None else float(shape.cdf(varied.low))
    above = 1.0 if varied.high is None else float(shape.cdf(varied.high))
    return below, above


def _shape(varied: Varied) -> Any:
    """The distribution without its limits; mean and deviation are those of the number itself."""
    from scipy import stats

    assert varied.mean is not None, "the study was checked"
    assert varied.deviation is not None, "the study was checked"
    if varied.distribution == "normal":
        return stats.norm(varied.mean, varied.deviation)
    spread = np.sqrt(np.log1p((varied.deviation / varied.mean) ** 2))
    return stats.lognorm(spread, scale=varied.mean * np.exp(-(spread**2) / 2))
