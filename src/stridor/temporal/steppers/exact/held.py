"""Slip that others hold: whether a row is theirs, and when a polynomial of the supports turns."""

from __future__ import annotations

import itertools

import numpy as np
import scipy.linalg as sl
import scipy.optimize as so

from ....typing import Array

HELD = 1e-9  # of a row: what is left of it where contacts leave it no motion
ROUNDING = 1e-12  # of the terms of a number
NEAR = 1e-8  # of a ramp: what turns there has turned


def spans(rows: Array, row: Array) -> bool:
    """Whether a row (k,) is a combination of others (r, k), which are independent."""
    base = sl.qr(rows.T, mode="economic")[0] if len(rows) else np.zeros((len(row), 0))
    return bool(np.linalg.norm(row - base @ (base.T @ row)) <= HELD * np.linalg.norm(row))


def turns(polynomial: Array, amounts: Array) -> tuple[float, list[float]]:
    """The sign of a polynomial (T,) right behind 0, which is 0 where all of it is rounding of its ``amounts`` (T,), and
    where between 0 and 1 it changes."""
    kept = np.where(np.abs(polynomial) > ROUNDING * amounts, polynomial, 0.0)
    if not np.any(kept):
        return 0.0, []
    order = np.arange(len(kept))

    def value(x: float) -> float:
        return float(kept @ x**order)

    # What a root of several is split into is as close to zero between them as rounding.
    inside = np.roots(kept[::-1]).real
    edges = np.concatenate([[0.0], np.sort(inside[(inside > 0.0) & (inside < 1.0)]), [1.0]])
    signs: list[tuple[float, float]] = []
    for low, high in itertools.pairwise(edges):
        middle = 0.5 * (low + high)
        there = value(middle)
        if high - low > NEAR and abs(there) > ROUNDING * float(amounts @ middle**order):
            signs.append((middle, float(np.sign(there))))
    if not signs:
        return 0.0, []
    found = [
        float(so.brentq(value, here, there, xtol=1e-15))
        for (here, now), (there, then) in itertools.pairwise(signs)
        if now != then
    ]
    return signs[0][1], found
