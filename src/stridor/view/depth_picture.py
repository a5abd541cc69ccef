"""Pictures of surfaces in space: parallel projection and a depth buffer, so that what is behind is hidden exactly.

Sorting facets by distance, as plotting libraries do, fails just where two bodies touch and one mesh is finer than the
other. A buffer of depths compares them pixel by pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..typing import Array, BoolArray, IntArray
from .skin import distinct, facet_edges, normals

LAMP = np.array([-0.35, 0.45, 0.82]) / np.linalg.norm([-0.35, 0.45, 0.82])  # right, up, towards the eye
SAMPLES = 2  # per pixel and direction, averaged in the end
CANDIDATES = 2_000_000  # pixels looked at in one go
LINE_SHADE = 0.55  # of the colour under it


@dataclass(frozen=True)
class Camera:
    """A line of sight. right, up and toward (3,) are unit vectors; toward points from the model to the eye."""

    right: Array
    up: Array
    toward: Array

    @classmethod
    def at(cls, elevation_deg: float, azimuth_deg: float) -> Camera:
        """From above the x–y plane by the elevation, turned about z by the azimuth from x."""
        rise, turn = np.radians([elevation_deg, azimuth_deg])
        toward = np.array([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)])
        right = np.array([-np.sin(turn), np.cos(turn), 0.0])
        return cls(right, np.cross(toward, right), toward)

    def project(self, points: Array) -> Array:
        """Coordinates (k, 3) of points (k, 3): to the right, upwards, towards the eye, in the same unit."""
        return points @ np.column_stack([self.right, self.up, self.toward])


def surface_picture(
    seen: Array, facets: IntArray, colours: Array, low: Array, high: Array, *, pixels: int, lines: bool = True
) -> Array:
    """Image (h, w, 4) of facets (f, 4) between low and high (2,); 0 to 1, first row at the top, transparent outside.

    ``seen`` (k, 3) are projected points, ``colours`` (k, 3) at the points or (f, 4, 3) at the corners of the facets.
    ``pixels`` along the longer side. ``lines`` draws the edges of the facets, darker.
    """
    fine = pixels * SAMPLES
    factor = fine / max(float((high - low).max()), 1e-300)
    width, height = (max(SAMPLES, int(np.ceil(s * factor / SAMPLES)) * SAMPLES) for s in high - low)
    drawn = np.column_stack([(seen[:, :2] - low) * factor, seen[:, 2] * factor])
    corner = colours[facets] if colours.ndim == 2 else colours
    corner = corner * _brightness(seen, facets)[:, None, None]
    depth = np.full(width * height, -np.inf)
    image = np.zeros((width * height, 4))
    quads = np.flatnonzero(facets[:, 3] != facets[:, 2])
    for chosen, which in ((np.arange(len(facets)), [0, 1, 2]), (quads, [0, 2, 3])):
        triangles = drawn[facets[chosen][:, which]]
        _fill(image, depth, width, height, triangles, corner[chosen][:, which])
    if lines:
        _edges(image, depth, width, height, drawn, facets)
    whole = image.reshape(height // SAMPLES, SAMPLES, width // SAMPLES, SAMPLES, 4)
    cover = whole[..., 3].mean(axis=(1, 3))
    colour = (whole[..., :3] * whole[..., 3:]).mean(axis=(1, 3)) / np.where(cover > 0, cover, 1.0)[..., None]
    return np.clip(np.concatenate([colour, cover[..., None]], axis=2), 0.0, 1.0)[::-1]


def _brightness(seen: Array, facets: IntArray) -> Array:
    """Lamp light (f,) on facets, both sides alike: 1 where they face the lamp."""
    outward = normals(seen, facets)
    outward = outward * np.where(outward[:, 2] < 0, -1.0, 1.0)[:, None]
    return 0.6 + 0.4 * np.clip(outward @ LAMP, 0.0, 1.0)


def _fill(image: Array, depth: Array, width: int, height: int, triangles: Array, colours: Array) -> None:
    """Draw triangles (t, 3, 3) with colours (t, 3, 3) at their corners into image and depth buffer."""
    (ax, ay), (bx, by), (cx, cy) = (triangles[:, k, :2].T for k in range(3))
    twice = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    triangle, row, first, count = _spans(triangles, np.abs(twice) > 1e-9, width, height)
    part = np.cumsum(count) // CANDIDATES
    for piece in np.split(np.arange(len(count)), np.flatnonzero(np.diff(part)) + 1):
        span, within = _counted(count[piece])
        span = piece[span]
        owner, column = triangle[span], first[span] + within
        x, y, pixel = column + 0.5, row[span] + 0.5, row[span] * width + column
        # Barycentric weights are linear over the plane, so each is three numbers per triangle.
        u = ((bx * cy - by * cx)[owner] + (by - cy)[owner] * x + (cx - bx)[owner] * y) / twice[owner]
        v = ((cx * ay - cy * ax)[owner] + (cy - ay)[owner] * x + (ax - cx)[owner] * y) / twice[owner]
        weight = np.stack([u, v, 1.0 - u - v])
        near = sum(weight[k] * triangles[owner, k, 2] for k in range(3))
        np.maximum.at(depth, pixel, near)
        wins = np.flatnonzero(near == depth[pixel])
        pixel, owner = pixel[wins], owner[wins]
        image[pixel, :3] = sum(weight[k, wins, None] * colours[owner, k] for k in range(3))
        image[pixel, 3] = 1.0


def _spans(
    triangles: Array, drawn: BoolArray, width: int, height: int
) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Rows of pixels inside triangles (t, 3, 3): the triangle, the row, its first column and how many, each (s,).

    Samples lie in the middle of pixels: column c is at c + 1/2.
    """
    low = np.maximum(np.ceil(triangles[:, :, 1].min(axis=1) - 0.5), 0).astype(int)
    high = np.minimum(np.floor(triangles[:, :, 1].max(axis=1) - 0.5), height - 1).astype(int)
    owner, within = _counted(np.where(drawn, np.maximum(high - low + 1, 0), 0))
    row = low[owner] + within
    left, right = np.full(len(row), np.inf), np.full(len(row), -np.inf)
    for k in range(3):
        px, py = triangles[owner, k, :2].T
        qx, qy = triangles[owner, (k + 1) % 3, :2].T
        rise = qy - py
        along = (row + 0.5 - py) / np.where(rise == 0, 1.0, rise)
        met = (rise != 0) & (along >= 0) & (along <= 1)
        at = px + along * (qx - px)
        left, right = np.where(met, np.minimum(left, at), left), np.where(met, np.maximum(right, at), right)
    first = np.ceil(np.clip(left, 0, width) - 0.5 - 1e-9).astype(int)
    first = np.maximum(first, 0)
    last = np.floor(np.clip(right, -1, width) - 0.5 + 1e-9).astype(int)
    count = np.minimum(last, width - 1) - first + 1
    some = np.flatnonzero(count > 0)
    return owner[some], row[some], first[some], count[some]


def _counted(counts: IntArray) -> tuple[IntArray, IntArray]:
    """0 repeated counts[0] times, 1 counts[1] times and so on, and the number of each among its likes."""
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)


def _edges(image: Array, depth: Array, width: int, height: int, drawn: Array, facets: IntArray) -> None:
    """Darken what is under the edges of facets that can be seen."""
    pairs = distinct(facet_edges(facets))[0]
    start, along = drawn[pairs[:, 0]], drawn[pairs[:, 1]] - drawn[pairs[:, 0]]
    steps = np.ceil(np.abs(along[:, :2]).max(axis=1, initial=0.0)).astype(int) + 1
    owner, within = _counted(steps)
    at = start[owner] + along[owner] * (within / np.maximum(steps[owner] - 1, 1))[:, None]
    column, row = np.floor(at[:, 0]).astype(int), np.floor(at[:, 1]).astype(int)
    held = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    pixel = row[held] * width + column[held]
    # An edge lies in its facets; half a pixel beside, a facet seen at a slant is already a little nearer.
    seen = at[held, 2] > depth[pixel] - 2.0
    chosen = np.unique(pixel[seen & (image[pixel, 3] > 0)])
    image[chosen, :3] *= LINE_SHADE


def sharp_edges(points: Array, facets: IntArray, angle_deg: float = 40.0) -> IntArray:
    """Edges (e, 2) where the surface has a border or bends by more than an angle: how a body is sketched."""
    pairs, index, count = distinct(facet_edges(facets))
    sides = np.where(facets[:, 3] == facets[:, 2], 3, 4)
    outward = np.repeat(normals(points, facets), sides, axis=0)
    total = np.column_stack([np.bincount(index, weights=outward[:, k], minlength=len(pairs)) for k in range(3)])
    # Two unit normals at an angle α add up to a length of 2 cos(α/2).
    bent = np.linalg.norm(total, axis=1) < 2 * np.cos(np.radians(angle_deg) / 2)
    return pairs[(count == 1) | ((count == 2) & bent)]
