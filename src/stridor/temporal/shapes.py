"""Operating shape: how every node moves at one frequency of a run (the paper's figure 11)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy  # its module signal takes half a second, and is loaded when it is used

from ..contact.interface import Rows
from ..system import System
from ..typing import ComplexArray
from .observe import LineShape
from .schedule import PhaseSpec
from .simulate import Settings, simulate
from .trajectory import Trajectory

SAMPLES = 24  # per period


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
    """Complex velocity amplitudes (k, d) [m/s] of the nodes of each body at ``frequency_hz``.

    The run is carried on from its last state for some periods with every node watched, and the line is
    taken out with a Hann window; the motion that the supports prescribe drops out with the mean. On assembled matrices
    the line is summed up while the run goes on, over a third of the periods, and meshed bodies have shapes too. Raises
    KeyboardInterrupt where Ctrl-C cuts the run.
    """
    system = settings.system(system)
    if system.assembled:
        return _assembled_shape(system, phases, settings, trajectory, frequency_hz, mu, periods / 3)
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
    every = max(1, int(1.0 / (frequency_hz * SAMPLES * trajectory.step)))
    watched = replace(
        settings,
        step=trajectory.step,
        record_every=every,
        watch=tuple(n for group in names.values() for n in group),
    )
    more = [*phases, PhaseSpec("shape", duration, {}, {})]
    part = simulate(replace(system, points=points), more, watched, mu=mu, restart=trajectory, join=False)
    if part.interrupted:
        raise KeyboardInterrupt
    velocity = part.velocity - part.velocity.mean(axis=0)
    weights = scipy.signal.get_window("hann", len(part.time))
    turned = weights * np.exp(-2j * np.pi * frequency_hz * part.time)
    shape = np.einsum("t,twd->wd", turned, velocity) * 2 / weights.sum()
    where = {name: k for k, name in enumerate(part.watch_names)}
    return {line: shape[[where[n] for n in group]] for line, group in names.items()}


def _assembled_shape(
    system: System,
    phases: Sequence[PhaseSpec],
    settings: Settings,
    trajectory: Trajectory,
    frequency_hz: float,
    mu: float | None,
    periods: float,
) -> Mapping[str, ComplexArray]:
    """The same where a record of every node would fill the memory."""
    every = max(1, int(1.0 / (frequency_hz * SAMPLES * trajectory.step)))
    steps = round(periods / frequency_hz / trajectory.step)
    seen = LineShape(frequency_hz, every, max(2, steps // every))
    quiet = replace(settings, step=trajectory.step, record_every=max(1, steps), watch=())
    more = [*phases, PhaseSpec("shape", steps * trajectory.step, {}, {})]
    part = simulate(system, more, quiet, mu=mu, restart=trajectory, join=False, observe=seen)
    if part.interrupted:
        raise KeyboardInterrupt
    return {
        body.name: np.asarray(body.rows.free @ seen.amplitude).reshape(-1, system.dimension)
        for body in (*system.lines, *system.solids)
    }
