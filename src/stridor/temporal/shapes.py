"""Operating shape: how every node moves at one frequency of a run (the paper's figure 11)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy.signal as ss

from ..contact.interface import Rows
from ..system import System
from ..typing import ComplexArray
from .schedule import PhaseSpec
from .simulate import Settings, simulate
from .trajectory import Trajectory


def operating_shape(
    system: System,
    phases: Sequence[PhaseSpec],
    settings: Settings,
    trajectory: Trajectory,
    frequency_hz: float,
    *,
    mu: float | None = None,
    periods: float = 120.0,
) -> Mapping[str, ComplexArray]:
    """Complex velocity amplitudes (k, 2) [m/s] of the nodes of each line at ``frequency_hz``.

    The run is carried on from its last state for some periods with every node watched, and the line is
    taken out with a Hann window; the motion that the supports prescribe drops out with the mean.
    """
    points = dict(system.points)
    names: dict[str, list[str]] = {}
    for line in system.lines:
        names[line.name] = []
        for node in range(len(line.coordinates)):
            name = f"{line.name}[{node}]"
            rows = slice(2 * node, 2 * node + 2)
            points[name] = Rows(line.rows.free[rows], line.rows.lift[rows])
            names[line.name].append(name)
    duration = periods / frequency_hz
    every = max(1, int(1.0 / (frequency_hz * 24 * trajectory.step)))
    watched = replace(
        settings,
        step=trajectory.step,
        record_every=every,
        watch=tuple(n for group in names.values() for n in group),
    )
    more = [*phases, PhaseSpec("shape", duration, {}, {})]
    part = simulate(replace(system, points=points), more, watched, mu=mu, restart=trajectory, join=False)
    velocity = part.velocity - part.velocity.mean(axis=0)
    weights = ss.get_window("hann", len(part.time))
    turned = weights * np.exp(-2j * np.pi * frequency_hz * part.time)
    shape = np.einsum("t,twd->wd", turned, velocity) * 2 / weights.sum()
    where = {name: k for k, name in enumerate(part.watch_names)}
    return {line: shape[[where[n] for n in group]] for line, group in names.items()}
