"""Which way a contact slides, in pictures of it: the edge of the slave that material of the master meets first."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ..sliding.motions import mean_direction
from ..typing import Array
from .colours import GREY, INK
from .interface_columns import seen_from_normal

ROOM = 0.09  # of the height, for the names of the edges


def mark_on_patch(ax: Axes, position: Array, tangents: Array, slip: Array, unit: float) -> None:
    """Mark both edges of a contact in space, as `seen_from_normal` shows it in a ``unit`` [m], with an arrow for the
    material of the master that comes in. slip (m, 2): of the slave against the master along the tangents (m, 2, 3)."""
    direction = mean_direction(np.einsum("mq,mqd->md", slip, tangents))
    if direction is None:
        return
    points = np.column_stack(seen_from_normal(position, tangents)) / unit
    # The same plane, one step further along the slip.
    moved = np.vstack([position, position + 1e-3 * direction])
    ahead = np.column_stack(seen_from_normal(moved, np.vstack([tangents, tangents])))
    shift = (ahead[len(position) :] - ahead[: len(position)]).mean(axis=0)
    flat = shift / (np.linalg.norm(shift) or 1.0)
    middle = points.mean(axis=0)
    along = (points - middle) @ flat
    room = 0.06 * float(np.ptp(points, axis=0).max())
    rotation = 90.0 if abs(flat[0]) > abs(flat[1]) else 0.0
    for reach, sign, name in ((along.max(), 1.0, "leading edge"), (-along.min(), -1.0, "trailing edge")):
        tip = middle + sign * (reach + room) * flat
        tail = tip + sign * 2.2 * room * flat
        inward = sign > 0  # material comes in at the leading edge and goes out at the trailing one
        ends = (tip, tail) if inward else (tail, tip)
        ax.annotate("", tuple(ends[0]), tuple(ends[1]), arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.4})
        at = tail + sign * 0.7 * room * flat
        ax.text(float(at[0]), float(at[1]), name, rotation=rotation, ha="center", va="center", color=GREY, fontsize=8.5)
        ax.update_datalim([tuple(at + sign * 0.5 * room * flat)])
    ax.autoscale_view()


def mark_on_line(ax: Axes, tangents: Array, slip: Array) -> None:
    """Mark both edges of a contact in the plane, drawn over its length, which grows along the tangents (m, 1, 2)."""
    direction = mean_direction(slip[:, :1])
    if direction is None or not len(tangents):
        return
    names = ("trailing edge", "leading edge") if direction[0] > 0 else ("leading edge", "trailing edge")
    for x, name, side in ((0.01, names[0], "left"), (0.99, names[1], "right")):
        arrow = "→" if direction[0] < 0 else "←"
        ax.text(x, 0.98, f"{arrow} {name}" if side == "left" else f"{name} {arrow}", transform=ax.transAxes, ha=side,
                va="top", color=GREY, fontsize=8.5)  # fmt: skip
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + ROOM * (high - low))  # an even pressure would run through them
