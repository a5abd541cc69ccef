"""One period of a limit cycle in plain numbers, for a page to draw."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..periodic import Cycle
from ..typing import Array, IntArray
from .run_so_far import Portrait, loudest_direction

STRIPS = ("separation", "stick", "slip")  # by status


@dataclass(frozen=True)
class ContactPeriod:
    """A contact over one period: normal_force, tangential_force (t,) [N], slip_velocity (t,) [m/s]; strips: what it
    does from where to where in shares of the period; shares of separation, stick and slip."""

    name: str
    normal_force: list[float]
    tangential_force: list[float]
    slip_velocity: list[float]
    strips: list[tuple[float, float, str]]
    shares: list[float]


@dataclass(frozen=True)
class CycleShown:
    """What is drawn and told of a cycle. period [s]; stable: None where the largest multiplier decides nothing;
    slip_amplitude [m/s]; share (t,): time over the period; portrait: of the first watched point, in the direction with
    the larger acceleration."""

    mu: float
    period: float
    frequency_hz: float
    stable: bool | None
    largest_multiplier: float
    slip_amplitude: float
    kinds: list[str]
    landed: int
    reached_from: str
    share: list[float]
    contacts: list[ContactPeriod]
    portrait: Portrait | None

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


def cycle_shown(cycle: Cycle) -> CycleShown:
    """A cycle in plain numbers."""
    share = cycle.time / cycle.period
    contacts = [
        ContactPeriod(
            name, cycle.normal_force[:, k].tolist(), cycle.tangential_force[:, k].tolist(),
            cycle.slip_velocity[:, k].tolist(), strips(share, cycle.status[:, k]), cycle.shares[k].tolist(),
        )
        for k, name in enumerate(cycle.contact_names)
    ]  # fmt: skip
    return CycleShown(
        cycle.mu, cycle.period, cycle.frequency_hz, cycle.stable, cycle.largest_multiplier, cycle.slip_amplitude,
        list(cycle.kinds), cycle.landed, cycle.reached_from, share.tolist(), contacts, _portrait(cycle),
    )  # fmt: skip


def _portrait(cycle: Cycle) -> Portrait | None:
    if not cycle.watch_names:
        return None
    k = loudest_direction(cycle.acceleration[:, 0])
    u, v = cycle.displacement[:, 0, k], cycle.velocity[:, 0, k]
    return Portrait(f"{cycle.watch_names[0]} {'xy'[k]}", (u - u[:-1].mean()).tolist(), v.tolist(), cycle.period)


def strips(share: Array, status: IntArray) -> list[tuple[float, float, str]]:
    """What a contact does by its status (t,) at times ``share`` (t,) of a period: from halfway between two samples to
    the next such place."""
    edges = np.flatnonzero(np.diff(status)) + 1
    places = [0.0, *(0.5 * (share[edges] + share[edges - 1])).tolist(), 1.0]
    return [
        (first, last, STRIPS[int(status[begin])])
        for first, last, begin in zip(places[:-1], places[1:], [0, *edges.tolist()], strict=True)
    ]
