"""How much growth a change of a case removes, to first order, from derivatives of the modes watched."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..modal.derivatives import Mode, PencilChange, by_mass_at_node
from ..modal.tolerances import UNSTABLE_RELATIVE
from ..system import System
from ..system.bodies import build_bodies
from ..system.model import Line, Solid
from ..typing import Array, BoolArray, ComplexArray, IntArray
from .contact_edges import edge_rows
from .measures import Kind, Measure, Target, growing, growth, per_cent_of
from .sensitivities import BENT, Linearised


class Ranking:
    """The modes watched of a linearised case, and the changes tried on them."""

    def __init__(
        self, linear: Linearised, columns: list[int], target: Target, percent: float, margin: float
    ) -> None:
        self.linear, self.columns, self.target = linear, columns, target
        self.percent, self.margin = percent, margin
        self.modes = [linear.known(b) for b in columns]
        self.eigenvalues = np.array([m.eigenvalue for m in self.modes], dtype=complex)
        self.condition = np.array([m.condition for m in self.modes])
        self.unstable = growing(self.eigenvalues)
        numbers = linear.modes.branch[columns]
        self.aimed: BoolArray = self.unstable if target == "sum" else numbers == target

    @property
    def rounding(self) -> float:
        """Growth rate [1/s] per per cent that may be rounding: see `Sensitivities.beyond_rounding`."""
        return 0.01 * UNSTABLE_RELATIVE * float(np.abs(self.eigenvalues[self.aimed]).sum())

    def numbers(self, paths: Sequence[str]) -> list[Measure]:
        found: list[Measure] = []
        for path in paths:
            value, change = self.linear.value(path), self.linear.change(path)
            per_unit = _derivatives(self.modes, change)
            slopes = per_cent_of(value) * per_unit
            direction = -1 if slopes[self.aimed].real.sum() > 0 else 1
            if value:
                moved = direction * slopes * self.percent
                found.append(replace(self._measure("number", path, direction, self.percent, moved), value=value))
        return found

    def masses(self) -> list[Measure]:
        """A point mass at the node of each body where it removes most."""
        linear = self.linear
        built = build_bodies(linear.case)
        found: list[Measure] = []
        for body, points, d in drawn_bodies(linear.system):
            translation = np.zeros(built[body.name].size)
            translation[:: built[body.name].stride] = 1.0
            whole = float(translation @ (built[body.name].mass @ translation))
            slopes = np.array([by_mass_at_node(m, body.rows.free, d) for m in self.modes])
            best = int(np.argmin(slopes[self.aimed].real.sum(axis=0)))
            mass = 0.01 * self.percent * whole
            measure = self._measure("added mass", body.name, 1, self.percent, mass * slopes[:, best])
            at = tuple(float(x) for x in points[best])
            found.append(replace(measure, position=at, mass=mass))
        return found

    def chamfers(self, edges: Sequence[Edge]) -> list[Measure]:
        """Rows of contact nodes taken away at edges of contacts over a surface, those that the modes were asked for
        with."""
        moved = np.array([self.linear.released(b) for b in self.columns])
        return [self._measure("chamfer", edge.name, 1, edge.percent, moved[:, k]) for k, edge in enumerate(edges)]

    def _measure(self, kind: Kind, name: str, direction: int, percent: float, moved: ComplexArray) -> Measure:
        after: ComplexArray = self.predicted(moved)
        before = self.eigenvalues
        grows = growing(after)
        close = ~grows & _near_axis(after, self.margin)
        was_close = ~self.unstable & _near_axis(before, self.margin)
        branch = self.linear.modes.branch[self.columns]
        worse = branch[grows & ~self.unstable]
        closer = branch[close & ~was_close & ~self.unstable]
        return Measure(
            kind=kind,
            name=name,
            direction=direction,
            percent=percent,
            removed_per_percent=float(-moved[self.aimed].real.sum() / percent),
            removed_sum_per_percent=float(-moved[self.unstable].real.sum() / percent),
            removed=growth(before[self.aimed]) - growth(after[self.aimed]),
            predicted=after,
            makes_unstable=tuple(int(b) for b in worse),
            brings_close=tuple(int(b) for b in closer),
        )

    def predicted(self, moved: ComplexArray) -> ComplexArray:
        """Eigenvalues (b,) after changes of first order (b,); pairs near an exceptional point through it."""
        lam = self.eigenvalues
        after: ComplexArray = lam + moved
        apart = np.abs(lam[:, None] - lam[None, :]) + np.diag(np.full(len(lam), np.inf))
        for i in range(len(lam)):
            j = int(np.argmin(apart[i])) if len(lam) > 1 else i
            if j == i or int(np.argmin(apart[j])) != i or min(self.condition[i], self.condition[j]) < BENT:
                continue
            half, closing = (lam[i] - lam[j]) / 2, (moved[i] - moved[j]) / 2
            root = np.sqrt(half**2 + 2 * half * closing)
            # The sign that goes on from where the pair is.
            root = root if abs(root - half) <= abs(root + half) else -root
            after[i] = (lam[i] + lam[j] + moved[i] + moved[j]) / 2 + root
        return after


@dataclass(frozen=True)
class Edge:
    """Rows of touching nodes (r,) at an edge of a contact, of the m, and which part of it [%]."""

    name: str
    nodes: IntArray
    percent: float


def edges_of(linear: Linearised, rows: int) -> list[Edge]:
    """Both edges of every contact over a surface, of one to ``rows`` rows."""
    nodes = linear.system.contact_nodes()
    found: list[Edge] = []
    for contact in range(len(nodes.names)):
        for edge in ("leading", "trailing"):
            for cut in edge_rows(nodes, linear.held.touching, linear.held.sense, contact, edge, rows):
                many = "row" if cut.rows == 1 else "rows"
                name = f"{nodes.names[contact]}, {edge} edge, {cut.rows} {many}"
                found.append(Edge(name, cut.released, 100 * cut.share))
    return found


def drawn_bodies(system: System) -> list[tuple[Line | Solid, Array, int]]:
    """Bodies with rows of all their nodes' displacements, the places (k, d) of these, and d."""
    lines: list[tuple[Line | Solid, Array, int]] = [(line, line.coordinates, 2) for line in system.lines]
    return lines + [(solid, solid.points, solid.points.shape[1]) for solid in system.solids]


def _derivatives(modes: Sequence[Mode], change: PencilChange) -> ComplexArray:
    """dλ/dp (b,)."""
    return np.array([m.derivative(change) for m in modes], dtype=complex)


def _near_axis(lam: ComplexArray, margin: float) -> BoolArray:
    """Whether (b,) the damping ratio is below the margin."""
    return -lam.real < margin * np.abs(lam)
