"""Normals at the ends of open curved masters in the plane, and what must not bend there."""

from __future__ import annotations

import numpy as np
import pytest

from stridor.contact.curve import Curve
from stridor.contact.surface import spline_weights


def along(positions: np.ndarray, **more) -> Curve:
    first = np.arange(len(positions) - 1)
    return Curve.from_facets(positions, {"line": np.column_stack([first, first + 1])}, where="w", **more)


def arc(count: int, rng: np.random.Generator, uneven: float) -> tuple[np.ndarray, np.ndarray]:
    """Nodes on a circle of radius 2 about a point, and that point."""
    part = np.linspace(0.0, 1.0, count + 1)
    part[1:-1] += uneven / count * rng.uniform(-0.5, 0.5, count - 1)
    angle, centre = 0.4 - 1.1 * part, rng.uniform(-1, 1, 2)
    return centre + 2.0 * np.column_stack([np.cos(angle), np.sin(angle)]), centre


def end_error(count: int, seed: int, uneven: float) -> float:
    """Largest angle between the normal at either end and the radius."""
    points, centre = arc(count, np.random.default_rng(seed), uneven)
    curve = along(points)
    found = curve.locate(points[[0, -1]])
    radius = points[[0, -1]] - centre
    radius /= np.linalg.norm(radius, axis=1, keepdims=True)
    sine = radius[:, 0] * found.normal[:, 1] - radius[:, 1] * found.normal[:, 0]
    return float(np.abs(np.arcsin(sine)).max())


@pytest.mark.parametrize("seed", range(6))
def test_normals_at_the_ends_of_an_arc_are_of_second_order(seed: int) -> None:
    coarse, fine = end_error(6, seed, 0.0), end_error(24, seed, 0.0)
    assert coarse < 0.02 * 1.1 / 6
    assert fine < coarse / 16
    assert end_error(24, seed, 0.6) < 0.1 * 1.1 / 24


@pytest.mark.parametrize("seed", range(6))
def test_straight_masters_stay_straight(seed: int) -> None:
    rng = np.random.default_rng(seed)
    step = rng.uniform(0.05, 1.0, 6)
    place = np.concatenate([[0.0], np.cumsum(step)])
    direction = rng.standard_normal(2)
    direction /= np.linalg.norm(direction)
    curve = along(place[:, None] * direction + rng.standard_normal(2))
    normal = np.array([direction[1], -direction[0]])
    at = curve.positions[0] + rng.uniform(0, place[-1], 40)[:, None] * direction + 0.02 * normal
    found = curve.locate(at)
    assert found.normal == pytest.approx(np.tile(normal, (40, 1)), abs=1e-13)
    assert found.gap == pytest.approx(0.02, abs=1e-13)
    assert curve.chord_height < 1e-14


def test_the_normal_row_is_the_derivative_of_the_gap_at_the_ends() -> None:
    rng = np.random.default_rng(3)
    points, _ = arc(5, rng, 0.4)
    curve = along(points)
    # Above the first and the last segment.
    slaves = np.array([0.8 * points[0] + 0.2 * points[1], 0.3 * points[-2] + 0.7 * points[-1]]) + 0.01
    found = curve.locate(slaves)
    assert found.inside.all()
    step = 1e-6
    for _ in range(5):
        change = rng.standard_normal(points.shape)
        gaps = [curve.locate(slaves, s * step * change).gap for s in (1.0, -1.0)]
        row = -np.sum(found.normal * np.einsum("mr,mrd->md", found.weights, change[found.nodes]), axis=1)
        assert (gaps[0] - gaps[1]) / (2 * step) == pytest.approx(row, rel=1e-6, abs=1e-8)


def test_the_line_of_a_beam_begins_along_its_chord() -> None:
    points, _ = arc(5, np.random.default_rng(1), 0.4)
    curve = along(points, follows_spline=True)
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    found = curve.locate(points[[0, -1]])
    for k, (segment, xi) in enumerate(((0, 0.0), (4, 1.0))):
        weights, slopes = np.zeros(4), np.zeros(4)
        spline_weights(segment, xi, chords, weights, slopes)
        padded = np.concatenate([points[:1], points, points[-1:]])
        tangent = slopes @ padded[segment : segment + 4]
        assert found.normal[k] @ tangent == pytest.approx(0.0, abs=1e-14)


def test_a_long_side_beside_a_fillet_is_bent_no_more_than_by_its_neighbour() -> None:
    """A flat of length 1 into a fillet of steps of 0.05 that turn by 15° each: the free end of the flat stays level."""
    angle = np.radians(15.0) * np.arange(1, 5)
    fillet = np.cumsum(0.05 * np.column_stack([np.cos(angle), np.sin(angle)]), axis=0)
    points = np.concatenate([[[0.0, 0.0], [1.0, 0.0]], fillet + np.array([1.0, 0.0])])
    curve = along(points)
    found = curve.locate(points[:1])
    assert np.degrees(np.arcsin(abs(found.normal[0, 0]))) < 0.2
