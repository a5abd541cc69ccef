"""A few numbers of everything a system is made of, by which a restart tells another model from its own.

They are projections on fixed vectors, so that any single entry shows, and they are compared to far more than rounding:
another machine's last digits are not another model.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..contact.nodes import ContactNodes
from ..system import System
from ..typing import Array

SAME = 1e-9  # of matrices, loads and contacts: sums of what is assembled alike everywhere
SOLVED = 1e-6  # of what a solve has gone into, whose rounding grows with its condition
SPEEDS = (1e-3, 3e-2, 0.3, 1.0, 7.0)  # slip speeds [m/s] at which friction laws are asked
MOTION = "moving support"
BODIES = ("mass", "damping", "stiffness")


@dataclass(frozen=True)
class SketchPart:
    """One part of a system in numbers: its name in words, the numbers, how large what was summed is, how close another
    machine comes."""

    name: str
    numbers: Array
    scale: float
    close: float = SAME

    @property
    def row(self) -> Array:
        """Numbers and scale in one array."""
        return np.append(self.numbers, self.scale)

    def same(self, row: Array) -> bool:
        """Whether another row of the same part is that of the same model."""
        return bool(np.all(np.abs(self.row - row) <= self.close * max(self.scale, float(row[-1]))))


def sketch(system: System, nodes: ContactNodes) -> tuple[SketchPart, ...]:
    """All parts of a system with its contact nodes in the reference configuration."""
    return tuple(_parts(system, nodes))


def packed(parts: Sequence[SketchPart]) -> Array:
    """The sketch as one array, as saved."""
    return np.concatenate([part.row for part in parts])


def differing(parts: Sequence[SketchPart], saved: Array) -> list[SketchPart] | None:
    """The parts that a saved sketch has otherwise; None where it has other parts."""
    rows = [part.row for part in parts]
    if saved.dtype.kind != "f" or saved.shape != (sum(len(row) for row in rows),) or not np.all(np.isfinite(saved)):
        return None
    bounds = np.cumsum([len(row) for row in rows])[:-1]
    return [part for part, row in zip(parts, np.split(saved, bounds), strict=True) if not part.same(row)]


def saved_row(parts: Sequence[SketchPart], saved: Array, name: str) -> Array:
    """The saved numbers of one part, without their scale."""
    at = 0
    for part in parts:
        if part.name == name:
            return saved[at : at + len(part.numbers)]
        at += len(part.row)
    raise KeyError(name)


def _parts(system: System, nodes: ContactNodes) -> Iterator[SketchPart]:
    n = system.size
    one, two = _probes(n)
    yield SketchPart("number of freedoms", np.array([float(n)]), 0.0)
    for name in BODIES:
        matrix = getattr(system, name)
        across = matrix @ two
        numbers = np.array([matrix.trace(), one @ across, one @ (matrix @ one), two @ across])
        yield SketchPart(name, numbers, float(np.abs(matrix).sum()))
    for name, load in system.loads.items():
        yield _projected(f"load {name}", load, (one, two))
    yield from _motions(system, nodes)
    if system.cubic is not None:
        rows, coefficient = system.cubic.rows, np.asarray(system.cubic.coefficient, dtype=float)
        first, _ = _probes(len(coefficient))
        yield _projected("cubic springs", rows.free.T @ (coefficient * first), (one, two))
    for number, name in enumerate(nodes.names):
        mine = nodes.select(nodes.owner == number)
        law = nodes.laws[number]
        friction = np.array([law.sticking, *(law.sliding(v) for v in SPEEDS)])
        yield SketchPart(f"contact {name}: friction", friction, float(np.abs(friction).max()))
        yield _projected(f"contact {name}: normals", mine.normal.T @ _probes(mine.count)[0], (one, two))
        along = mine.tangent.T @ _probes(mine.tangent.shape[0])[0]
        yield _projected(f"contact {name}: tangents", along, (one, two))
        for what in ("gap", "compliance"):
            values = np.asarray(getattr(mine, what), dtype=float)
            # A gap is a difference of places.
            size = float(np.abs(mine.position).sum()) if what == "gap" else 0.0
            part = _projected(f"contact {name}: {what}", values, _probes(mine.count))
            yield SketchPart(part.name, part.numbers, part.scale + size)


def _motions(system: System, nodes: ContactNodes) -> Iterator[SketchPart]:
    """What is in proportion to the velocity of each moving support."""
    motion = system.motion
    one, two = _probes(system.size)
    first, second = _probes(nodes.normal_lift.shape[0]), _probes(nodes.tangent_lift.shape[0])
    for p, name in enumerate(motion.names):
        columns = (
            *((v[:, p], (one, two)) for v in (motion.lift, motion.mass, motion.damping)),
            (nodes.normal_lift[:, p], first),
            (nodes.tangent_lift[:, p], second),
        )
        numbers = np.array([float(probe @ column) for column, probes in columns for probe in probes])
        yield SketchPart(f"{MOTION} {name}", numbers, sum(float(np.abs(c).sum()) for c, _ in columns), SOLVED)


def _projected(name: str, values: Array, probes: Sequence[Array]) -> SketchPart:
    return SketchPart(name, np.array([float(probe @ values) for probe in probes]), float(np.abs(values).sum()))


def _probes(size: int) -> tuple[Array, Array]:
    """Two fixed vectors (size,) whose entries are all different and none small."""
    number = np.arange(size, dtype=float)
    return 1.5 + np.cos(number), 1.5 + np.sin(1.7 * number + 0.3)
