"""Master line: a C1 cubic spline through the nodes of a body (paper 1.4).

The functions are plain arithmetic on preallocated arrays so that the time loop compiles the very
same code that the modelling side calls.
"""

from __future__ import annotations

import math

from ..typing import Array

# Gauss–Newton: quadratic on the line, a factor of (distance × curvature) per step away from it.
MAX_PROJECTION_STEPS = 100


def spline_weights(segment: int, xi: float, chords: Array, weights: Array, slopes: Array) -> None:
    """Weights of the nodes segment−1 … segment+2 in the spline point at ``xi`` in [0, 1].

    ``chords`` (k−1,) [m] are the reference distances between the k nodes. The spline is cubic Hermite
    with the slope at a node taken from its two neighbours (one-sided at the ends), hence C1 and
    linear in the node positions: ``weights`` (4,) gives the point, ``slopes`` (4,) its derivative with
    respect to ``xi``. Both are overwritten.
    """
    h00 = (1.0 + 2.0 * xi) * (1.0 - xi) * (1.0 - xi)
    h10 = xi * (1.0 - xi) * (1.0 - xi)
    h01 = xi * xi * (3.0 - 2.0 * xi)
    h11 = xi * xi * (xi - 1.0)
    d00 = 6.0 * xi * (xi - 1.0)
    d10 = (1.0 - xi) * (1.0 - 3.0 * xi)
    d11 = xi * (3.0 * xi - 2.0)
    last = chords.shape[0] - 1
    chord = chords[segment]

    weights[0], weights[1], weights[2], weights[3] = 0.0, h00, h01, 0.0
    slopes[0], slopes[1], slopes[2], slopes[3] = 0.0, d00, -d00, 0.0
    if segment > 0:
        ratio = chord / (chords[segment - 1] + chord)
        weights[0] -= ratio * h10
        weights[2] += ratio * h10
        slopes[0] -= ratio * d10
        slopes[2] += ratio * d10
    else:
        weights[1] -= h10
        weights[2] += h10
        slopes[1] -= d10
        slopes[2] += d10
    if segment < last:
        ratio = chord / (chord + chords[segment + 1])
        weights[1] -= ratio * h11
        weights[3] += ratio * h11
        slopes[1] -= ratio * d11
        slopes[3] += ratio * d11
    else:
        weights[1] -= h11
        weights[2] += h11
        slopes[1] -= d11
        slopes[2] += d11


def spline_point(segment: int, nodes: Array, weights: Array) -> tuple[float, float]:
    """Sum of the four node positions around ``segment`` of ``nodes`` (k, 2) times ``weights`` (4,)."""
    x = 0.0
    y = 0.0
    for k in range(4):
        if weights[k] != 0.0:
            x += weights[k] * nodes[segment - 1 + k, 0]
            y += weights[k] * nodes[segment - 1 + k, 1]
    return x, y


def project(
    x: float, y: float, nodes: Array, chords: Array, segment: int, xi: float, weights: Array, slopes: Array
) -> tuple[int, float, bool]:
    """Nearest point of the spline to (x, y), searched from ``segment`` and ``xi`` on.

    Returns the segment, xi in [0, 1] and whether the point lies on the line (False when it has left
    over an end; the end is returned then). ``weights`` and ``slopes`` (4,) hold those of the answer.
    """
    last = chords.shape[0] - 1
    on_line = True
    for _ in range(MAX_PROJECTION_STEPS):
        spline_weights(segment, xi, chords, weights, slopes)
        px, py = spline_point(segment, nodes, weights)
        sx, sy = spline_point(segment, nodes, slopes)
        step = ((x - px) * sx + (y - py) * sy) / (sx * sx + sy * sy)
        new = xi + step
        on_line = True
        if new < 0.0:
            if segment > 0:
                segment -= 1
                xi = max(new * chords[segment + 1] / chords[segment] + 1.0, 0.0)
                continue
            on_line = new > -1e-9
            new = 0.0
        elif new > 1.0:
            if segment < last:
                segment += 1
                xi = min((new - 1.0) * chords[segment - 1] / chords[segment], 1.0)
                continue
            on_line = new < 1.0 + 1e-9
            new = 1.0
        moved = abs(new - xi)
        xi = new
        if moved < 1e-13:
            break
    spline_weights(segment, xi, chords, weights, slopes)
    return segment, xi, on_line


def unit_tangent(segment: int, nodes: Array, slopes: Array) -> tuple[float, float]:
    """Unit tangent of the spline, from the first node towards the last."""
    sx, sy = spline_point(segment, nodes, slopes)
    length = math.sqrt(sx * sx + sy * sy)
    return sx / length, sy / length
