"""A mode as the script of its page reads it, and its growth in words. Loads nothing that draws."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from ..typing import Array
from .depth_picture import sharp_edges
from .mode_page import COLOURS
from .skin import (
    EDGES_UP_TO,
    VIEW,
    Skin,
    at_largest,
    body_colour,
    concentrated,
    distinct,
    drawn_scale,
    facet_edges,
)
from .units import later_words

QUANTA = 32767  # steps of a displacement in the page, from none to the largest amplitude


def growth_in_words(growth_rate: float) -> str:
    """Whether a mode grows and how soon it is ten times as large, or a tenth."""
    if growth_rate == 0:
        return "neither grows nor decays"
    time = np.log(10.0) / abs(growth_rate)
    kind, change = ("unstable", "ten times as large") if growth_rate > 0 else ("stable", "a tenth")
    return f"{kind}: growth rate {growth_rate:+.4g} 1/s, {change} after {later_words(float(time), 3)}"


def page_data(skin: Skin, *, scale: float | None) -> dict[str, Any]:
    """What the page's script reads: the skin about its middle, arrays as base64 in the machine's usual byte order.

    points (k, 3) float32 [m]; real and imag (k, 3) int16, QUANTA being the largest amplitude; facets (f, 4), edges
    (e, 2), segments (s, 2) as uint16, or uint32 where ``wide``. ``scale`` [m] is the largest amplitude as drawn;
    bent: whether colours go with the root of the amplitude (`skin.concentrated`).
    """
    rotated, largest = at_largest(skin.motion)
    drawn = drawn_scale(skin, largest, scale) * largest
    unit = rotated / (largest or 1.0)
    low, high = skin.points.min(axis=0), skin.points.max(axis=0)
    half = (high - low) / 2 + abs(drawn)
    wide = len(skin.points) > 65535
    index = "<u4" if wide else "<u2"
    if len(skin.facets) <= EDGES_UP_TO:
        edges = distinct(facet_edges(skin.facets))[0]
    else:
        edges = sharp_edges(skin.points, skin.facets) if skin.dimension == 3 else skin.edges
    colours = np.array([_parts(body_colour(k)) for k in range(len(skin.names))]) / 255
    return {
        "names": list(skin.names),
        "meshed": len(skin.names) - len(np.unique(skin.segment_body)),
        "dimension": skin.dimension,
        "closed": skin.closed,
        "wide": wide,
        "elevation": VIEW[0],
        "azimuth": VIEW[1],
        "scale": drawn,
        "bent": concentrated(skin),
        "half": [float(h) for h in _padded(half[None])[0]],
        "colours": _bytes(colours),
        "pale": _bytes(0.65 * colours + 0.35),
        "ramp": [_parts(colour) for colour in COLOURS],
        "points": _packed(_padded(skin.points - (low + high) / 2), "<f4"),
        "real": _packed(np.round(QUANTA * _padded(unit.real)), "<i2"),
        "imag": _packed(np.round(QUANTA * _padded(unit.imag)), "<i2"),
        "facets": _packed(skin.facets, index),
        "edges": _packed(edges, index),
        "body": _packed(skin.body % 256, "u1"),
        "segments": _packed(skin.segments, index),
        "segment_body": _packed(skin.segment_body % 256, "u1"),
    }


def _packed(values: Any, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values).astype(kind).tobytes()).decode("ascii")


def _padded(values: Array) -> Array:
    """Vectors (k, d) in space (k, 3)."""
    return np.pad(values, ((0, 0), (0, 3 - values.shape[1])))


def _bytes(colours: Array) -> list[list[int]]:
    return [[round(255 * float(v)) for v in row] for row in colours]


def _parts(colour: str) -> list[int]:
    """Red, green and blue of "#rrggbb"."""
    return [int(colour[at : at + 2], 16) for at in (1, 3, 5)]
