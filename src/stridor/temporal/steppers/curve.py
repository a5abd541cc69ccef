"""A point that slides finitely: its foot on the C1 curve through the master's nodes as they are now.

Every loop that takes such contacts carries the positions of five points, the slave's and those of the four nodes around
its segment, as ten rows; normal and tangent are mixtures of them, found anew in each step.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from ...contact import surface
from ...contact.interface import Contact
from ...errors import AnalysisError, CaseError
from ...kernels import njit
from ...system import System
from ...typing import Array, IntArray

ROWS = 10  # x and y of the slave and of four nodes of its master

_spline_weights = njit(cache=True)(surface.spline_weights)


class Foot(NamedTuple):
    """Work space: weights, slopes (4,) of the curve at the foot, nodes (4, 2) as they are now."""

    weights: Array
    slopes: Array
    nodes: Array


def foot() -> Foot:
    """Room for one."""
    return Foot(np.zeros(4), np.zeros(4), np.zeros((4, 2)))


@njit(cache=True, inline="always")
def project_in(
    segment: int, x: float, y: float, xi: float, chords: Array, at: Foot
) -> tuple[float, bool]:  # pragma: no cover - compiled
    """Nearest point to (x, y) within one segment, and whether it is on the line; xi may pass 0 or 1, the rows follow at
    the next step."""
    nodes, weights, slopes = at.nodes, at.weights, at.slopes
    for _ in range(surface.MAX_PROJECTION_STEPS):
        _spline_weights(segment, xi, chords, weights, slopes)
        px = py = sx = sy = 0.0
        for k in range(4):
            if weights[k] != 0.0 or slopes[k] != 0.0:
                px += weights[k] * nodes[k, 0]
                py += weights[k] * nodes[k, 1]
                sx += slopes[k] * nodes[k, 0]
                sy += slopes[k] * nodes[k, 1]
        step = ((x - px) * sx + (y - py) * sy) / (sx * sx + sy * sy)
        xi = min(max(xi + step, -0.5), 1.5)
        if abs(step) < 1e-13:
            break
    on_line = not ((segment == 0 and xi < -1e-9) or (segment == chords.shape[0] - 1 and xi > 1.0 + 1e-9))
    _spline_weights(segment, xi, chords, weights, slopes)
    return xi, on_line


@njit(cache=True, inline="always")
def turn(side: float, at: Foot, normal: Array, tangent: Array) -> None:  # pragma: no cover - compiled
    """Weights (10,) of the ten rows in the relative motion along normal and tangent at the foot."""
    sx = sy = 0.0
    for k in range(4):
        if at.slopes[k] != 0.0:
            sx += at.slopes[k] * at.nodes[k, 0]
            sy += at.slopes[k] * at.nodes[k, 1]
    length = math.sqrt(sx * sx + sy * sy) * side
    tx, ty = sx / length, sy / length
    tangent[0], tangent[1] = tx, ty
    normal[0], normal[1] = -ty, tx
    for k in range(4):
        w = at.weights[k]
        tangent[2 + 2 * k], tangent[3 + 2 * k] = -w * tx, -w * ty
        normal[2 + 2 * k], normal[3 + 2 * k] = w * ty, -w * tx


@njit(cache=True, inline="always")
def leaves(segment: int, xi: float, chords: int) -> bool:  # pragma: no cover - compiled
    """Whether the foot has come to another segment of a line of so many chords."""
    return (xi < -1e-12 and segment > 0) or (xi > 1.0 + 1e-12 and segment < chords - 1)


def follow(segment: int, xi: float, chords: Array) -> tuple[int, float]:
    """Segment that a foot has entered, and where it is in it."""
    if xi < 0.0 and segment > 0:
        return segment - 1, 1.0 + xi * float(chords[segment] / chords[segment - 1])
    if xi > 1.0 and segment < len(chords) - 1:
        return segment + 1, (xi - 1.0) * float(chords[segment] / chords[segment + 1])
    return segment, xi


def nodes_of(segment: int, count: int) -> IntArray:
    """The four nodes (4,) around a segment of a line of ``count``; −1 beyond its ends."""
    nodes = segment - 1 + np.arange(4)
    return np.where((nodes >= 0) & (nodes < count), nodes, -1)


def found_at(contact: Contact, u: Array, x: Array) -> Contact:
    """A contact with foot, rows and gap as they are where the structure is at u (n,) and the supports at x (p,), for
    displacements that count from the same place. Raises AnalysisError where its slave is beyond an end there."""
    place = contact.slave_position + contact.slave.free @ u + contact.slave.lift @ x
    line = contact.master_positions + (contact.master.free @ u + contact.master.lift @ x).reshape(-1, 2)
    at, normal, tangent = foot(), np.zeros(ROWS), np.zeros(ROWS)
    segment, xi, nodes = contact.segment, contact.xi, nodes_of(contact.segment, len(line))
    for _ in range(len(line)):
        nodes = nodes_of(segment, len(line))
        at.nodes[:] = np.where(nodes[:, None] >= 0, line[nodes], 0.0)
        xi, on_line = project_in(segment, float(place[0]), float(place[1]), xi, contact.chords, at)
        if not on_line:
            raise AnalysisError(
                f"contact {contact.name}: in steady sliding the slave point is beyond an end of the master line; move "
                "the slave inwards or lengthen the master"
            )
        if not leaves(segment, xi, len(contact.chords)):
            break
        segment, xi = follow(segment, xi, contact.chords)
    turn(float(contact.side), at, normal, tangent)
    gap = float(normal @ np.concatenate([place, at.nodes.ravel()]))
    found: dict[str, Array] = {}
    for name, weights in (("normal", normal), ("tangent", tangent)):
        row, lift = contact.slave.free.T @ weights[:2], contact.slave.lift.T @ weights[:2]
        for k in np.flatnonzero(nodes >= 0).tolist():
            mine, part = slice(2 * int(nodes[k]), 2 * int(nodes[k]) + 2), weights[2 + 2 * k : 4 + 2 * k]
            row, lift = row + contact.master.free[mine].T @ part, lift + contact.master.lift[mine].T @ part
        found |= {f"{name}_row": np.asarray(row), f"{name}_lift": np.asarray(lift)}
    gap -= float(found["normal_row"] @ u)
    return replace(
        contact, segment=segment, xi=xi, gap=gap, normal_row=found["normal_row"], normal_lift=found["normal_lift"],
        tangent_row=found["tangent_row"], tangent_lift=found["tangent_lift"],
    )  # fmt: skip


def left_the_line(name: str, time: float, phase: str) -> str:
    """What to say of a slave that is beyond an end of its master."""
    return (
        f"contact {name}: the slave point left the master line over an end at t = {time:.6g} s "
        f"(phase {phase}); shorten the phase, slow the support down, move the slave inwards or lengthen the master"
    )


def check_stiffness(system: System, step: float) -> None:
    """Refuse springs of contacts that slide finitely and swing faster than the step can follow: what the turning of
    their normals stirs up would ring on for ever, with forces beyond all measure."""
    for contact in system.contacts:
        if contact.sliding == "small" or contact.compliance == 0.0:
            continue
        moved = step**2 * float(contact.normal_row @ spl.splu(sp.csc_array(system.mass)).solve(contact.normal_row))
        if contact.compliance < moved:
            raise CaseError(
                f"contacts.{contact.name}.stiffness",
                contact.stiffness,
                f'with sliding = "finite" at most {1.0 / moved:.3g} N/m at a step of {step:.3g} s, which a stiffer '
                'spring outruns; take it as rigid in time ([temporal] contact = "rigid"), or a smaller step',
            )
