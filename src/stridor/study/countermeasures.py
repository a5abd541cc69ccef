"""Which change quietens a squeal best: mass, damping, stiffness, contact, ranked by growth removed, then verified."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from ..case import Case
from ..case.bodies import BeamBody, SolidBody
from ..contact.nodes import ContactNodes
from ..contact.surfaces import SurfaceContact
from ..errors import CaseError
from ..modal.assembled import complex_modes_assembled
from ..modal.complex_modes import UNSTABLE_RELATIVE
from ..modal.derivatives import Mode, Terms, by_mass_at_node, by_release
from ..system import System
from ..system.bodies import build_bodies
from ..system.model import Line, Solid
from ..typing import Array, BoolArray, ComplexArray, IntArray
from .provenance import provenance
from .sensitivities import BENT, Linearised, number_at

Kind = Literal["number", "added mass", "chamfer"]
STRIPS = 20  # into which the contact of an irregular mesh is cut
SAME_ROW = 1e-3  # of the length of a contact: nodes nearer to each other along the slip are one row


@dataclass(frozen=True)
class Verified:
    """The modes solved again with the change made: growth_rate and frequency_hz of the target mode (of the fastest
    growing one where the target is the sum), removed [1/s] from the target, how many modes are unstable, their
    frequencies."""

    growth_rate: float
    frequency_hz: float
    removed: float
    removed_sum: float
    unstable_hz: tuple[float, ...]


@dataclass(frozen=True)
class Measure:
    """One change of a case.

    name: path of a number, body that gets mass, or contact that is chamfered and where. direction: +1 raise, −1 lower.
    percent: the size of change that predictions are made for, of the number, of the body's mass, of the contact's area
    (nodes where they have none). removed_per_percent [1/s]: growth rate of the target taken away per per cent of
    change, removed_sum_per_percent of all unstable modes together. predicted (b,) [1/s]: eigenvalues after the change.
    makes_unstable: branches that were stable and are predicted not to be; brings_close: those predicted to come within
    the margin. position [m] and mass [kg] of an added mass. verified: solved again, None where it was not.
    """

    kind: Kind
    name: str
    direction: int
    percent: float
    removed_per_percent: float
    removed_sum_per_percent: float
    removed: float
    predicted: ComplexArray
    makes_unstable: tuple[int, ...]
    brings_close: tuple[int, ...]
    position: tuple[float, ...] | None = None
    mass: float | None = None
    verified: Verified | None = None

    @property
    def words(self) -> str:
        """The change in words."""
        if self.kind == "added mass":
            at = ", ".join(f"{x:.4g}" for x in self.position or ())
            return f"add {self.mass:.3g} kg to {self.name} at ({at}) m"
        if self.kind == "chamfer":
            return f"take {self.percent:.3g} % of the contact away: {self.name}"
        return f"{'raise' if self.direction > 0 else 'lower'} {self.name} by {self.percent:g} %"


@dataclass(frozen=True)
class Countermeasures:
    """Changes by growth removed per per cent, best first. target: number of a branch, or "sum" of all unstable ones.

    branch (b,) and eigenvalues (b,) [1/s] of the modes watched, as the case is; margin: damping ratio below which a
    stable mode is called close.
    """

    mu: float
    target: int | Literal["sum"]
    branch: IntArray
    eigenvalues: ComplexArray
    measures: tuple[Measure, ...]
    margin: float
    warnings: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """The document that `stridor countermeasures --json` prints."""
        return {
            "mu": self.mu,
            "target": self.target,
            "margin": self.margin,
            "measures": [
                {
                    "kind": m.kind,
                    "name": m.name,
                    "words": m.words,
                    "direction": m.direction,
                    "percent": m.percent,
                    "removed_per_percent": m.removed_per_percent,
                    "removed_sum_per_percent": m.removed_sum_per_percent,
                    "removed": m.removed,
                    "makes_unstable": list(m.makes_unstable),
                    "brings_close": list(m.brings_close),
                    "position": None if m.position is None else list(m.position),
                    "mass": m.mass,
                    "verified": None if m.verified is None else vars(m.verified).copy(),
                }
                for m in self.measures
            ],
            "warnings": list(self.warnings),
        }


def rank_countermeasures(
    case: Case,
    *,
    mu: float | None = None,
    target: int | Literal["sum"] = "sum",
    numbers: Sequence[str] | None = None,
    added_mass: bool = True,
    chamfers: int = 2,
    percent: float = 5.0,
    margin: float = 1e-3,
    verify: int = 3,
    count: int | None = None,
    max_frequency_hz: float | None = None,
    damped: bool | None = None,
    watch: Literal["all", "unstable"] = "all",
) -> Countermeasures:
    """Rank changes of a case by the growth rate that they take away per per cent of change.

    target: the number of an unstable branch, or "sum" of all unstable ones. numbers: paths to try (default: moduli and
    densities of all materials, the damping that bodies have, contact stiffnesses). added_mass: a point mass at the best
    node of each body. chamfers: how many rows of contact nodes are taken away at most, at the leading edge (which
    meets the other body's material first) and at the trailing one. percent: change that consequences are predicted
    for; margin: damping ratio. The best ``verify`` are solved again with that change made. watch: "unstable" does not
    look after the stable modes, which saves a factorisation for each.

    Predictions are of first order; a pair of modes near its exceptional point is predicted by its mean and squared
    half difference, which go through it smoothly. Touching nodes are held in predictions, solved for anew in
    verifications. Raises CaseError for a target that is not unstable.
    """
    started = time.perf_counter()
    linear = Linearised.of(case, mu, count=count, max_frequency_hz=max_frequency_hz, damped=damped)
    unstable = linear.columns("unstable")
    if not unstable:
        told = (f"no mode is unstable at μ = {linear.mu:g}: there is nothing to remove",)
        empty = np.zeros(0)
        return Countermeasures(linear.mu, target, empty.astype(np.int64), empty + 0j, (), margin, told)
    if target != "sum" and target not in linear.modes.branch[unstable]:
        accepted = f'"sum", or an unstable branch: {", ".join(str(b) for b in linear.modes.branch[unstable])}'
        raise CaseError("target", target, accepted)
    band = linear.columns("all") if watch == "all" else unstable
    ranking = _Ranking(linear, [b for b in band if linear.mode(b) is not None], target, percent, margin)
    found = ranking.numbers(_default_numbers(case) if numbers is None else list(numbers))
    if added_mass:
        found += ranking.masses()
    if chamfers > 0:
        found += ranking.chamfers(chamfers)
    helping = sorted((m for m in found if m.removed_per_percent > 0), key=lambda m: -m.removed_per_percent)
    checked = [ranking.verified(m, count, max_frequency_hz) for m in helping[:verify]]
    return Countermeasures(
        linear.mu,
        target,
        linear.modes.branch[ranking.columns],
        ranking.eigenvalues,
        tuple(checked + helping[verify:]),
        margin,
        tuple(linear.warnings),
        provenance(case, "countermeasures", time.perf_counter() - started, mu=linear.mu),
    )


def _default_numbers(case: Case) -> list[str]:
    used = dict.fromkeys(getattr(body, "material", None) for body in case.bodies.values())
    paths = [f"materials.{m}.{n}" for m in used if m in case.materials for n in ("young_modulus", "density")]
    for name, body in case.bodies.items():
        if isinstance(body, BeamBody | SolidBody):
            paths += [f"bodies.{name}.damping.{n}" for n in ("mass", "stiffness") if getattr(body.damping, n) > 0]
    return paths + [f"contacts.{name}.stiffness" for name, c in case.contacts.items() if c.stiffness != "rigid"]


class _Ranking:
    """The modes watched of a linearised case, and the changes tried on them."""

    def __init__(
        self, linear: Linearised, columns: list[int], target: int | Literal["sum"], percent: float, margin: float
    ) -> None:
        self.linear, self.columns, self.target = linear, columns, target
        self.percent, self.margin = percent, margin
        self.modes = [linear.known(b) for b in columns]
        self.eigenvalues = np.array([m.eigenvalue for m in self.modes], dtype=complex)
        self.condition = np.array([m.condition for m in self.modes])
        self.unstable = _grows(self.eigenvalues)
        numbers = linear.modes.branch[columns]
        self.aimed: BoolArray = self.unstable if target == "sum" else numbers == target

    def numbers(self, paths: Sequence[str]) -> list[Measure]:
        found: list[Measure] = []
        for path in paths:
            value, change = self.linear.value(path), self.linear.change(path)
            per_unit = _derivatives(self.modes, change)
            slopes = 0.01 * abs(value) * per_unit
            direction = -1 if slopes[self.aimed].real.sum() > 0 else 1
            if value:
                found.append(self._measure("number", path, direction, self.percent, direction * slopes * self.percent))
        return found

    def masses(self) -> list[Measure]:
        """A point mass at the node of each body where it removes most."""
        linear = self.linear
        built = build_bodies(linear.case)
        found: list[Measure] = []
        for body, places, d in drawn_bodies(linear.system):
            translation = np.zeros(built[body.name].size)
            translation[:: built[body.name].stride] = 1.0
            whole = float(translation @ (built[body.name].mass @ translation))
            slopes = np.array([by_mass_at_node(m, body.rows.free, d) for m in self.modes])
            best = int(np.argmin(slopes[self.aimed].real.sum(axis=0)))
            mass = 0.01 * self.percent * whole
            measure = self._measure("added mass", body.name, 1, self.percent, mass * slopes[:, best])
            at = tuple(float(x) for x in places[best])
            found.append(replace(measure, position=at, mass=mass))
        return found

    def chamfers(self, rows: int) -> list[Measure]:
        """Rows of contact nodes taken away at both edges of every contact over a surface."""
        linear = self.linear
        nodes = linear.system.contact_nodes()
        names: list[str] = []
        groups: list[IntArray] = []
        shares: list[float] = []
        for contact in range(len(nodes.names)):
            for edge in ("leading", "trailing"):
                for cut in edge_rows(nodes, linear.held.touching, linear.held.sense, contact, edge, rows):
                    many = "row" if cut.rows == 1 else "rows"
                    names.append(f"{nodes.names[contact]}, {edge} edge, {cut.rows} {many}")
                    groups.append(cut.released)
                    shares.append(100 * cut.share)
        if not groups:
            return []
        moved = np.array(
            [
                by_release(linear.terms, m, groups, linear.gap(b), solver=linear.options.solver)
                for m, b in zip(self.modes, self.columns, strict=True)
            ]
        )
        return [
            self._measure("chamfer", name, 1, share, moved[:, k])
            for k, (name, share) in enumerate(zip(names, shares, strict=True))
        ]

    def _measure(self, kind: Kind, name: str, direction: int, percent: float, moved: ComplexArray) -> Measure:
        after: ComplexArray = self.predicted(moved)
        before = self.eigenvalues
        grows = _grows(after)
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
            removed=_growth(before[self.aimed]) - _growth(after[self.aimed]),
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

    def verified(self, measure: Measure, count: int | None, max_frequency_hz: float | None) -> Measure:
        """The measure with its modes solved again, steady sliding too."""
        linear = self.linear
        if measure.kind == "number":
            value = number_at(linear.case, measure.name) if measure.name != "mu" else linear.mu
            factor = 1 + 0.01 * measure.direction * measure.percent
            system = linear.built(linear.case.with_({measure.name: factor * value}))
        elif measure.kind == "added mass":
            system = self._heavier(measure)
        else:
            system = self._chamfered(measure)
        # The sparse path for small systems too: a mass at one node leaves their complete basis no proportional damping.
        modes = complex_modes_assembled(
            system,
            linear.mu,
            count=linear.case.modal.modes if count is None else count,
            max_frequency_hz=max_frequency_hz,
            damped=linear.modes.damped,
            options=linear.options,
        )
        actual: ComplexArray = modes.eigenvalues[0]
        grows = modes.unstable[0]
        aimed = np.flatnonzero(self.aimed)
        nearest = [int(np.argmin(np.abs(actual - measure.predicted[k]))) for k in aimed]
        if self.target == "sum":
            after = _growth(actual)
            shown = int(np.argmax(actual.real))
        else:
            after, shown = _growth(actual[nearest]), nearest[0]
        result = Verified(
            growth_rate=float(actual[shown].real),
            frequency_hz=float(actual[shown].imag / (2 * np.pi)),
            removed=_growth(self.eigenvalues[self.aimed]) - after,
            removed_sum=_growth(self.eigenvalues) - _growth(actual),
            unstable_hz=tuple(float(v) for v in np.sort(actual[grows].imag) / (2 * np.pi)),
        )
        return replace(measure, verified=result)

    def _heavier(self, measure: Measure) -> System:
        assert measure.mass is not None, "made so"
        system = self.linear.system
        for body, places, d in drawn_bodies(system):
            if body.name == measure.name:
                node = int(np.argmin(np.linalg.norm(places - np.array(measure.position), axis=1)))
                rows = body.rows.free[node * d : node * d + d]
                return replace(system, mass=system.mass + measure.mass * (rows.T @ rows))
        raise AssertionError("a body that was there")

    def _chamfered(self, measure: Measure) -> System:
        linear = self.linear
        system, nodes = linear.system, linear.system.contact_nodes()
        name, edge, rows = (part.strip() for part in measure.name.split(","))
        contact = nodes.names.index(name)
        wanted = int(rows.split()[0])
        cuts = edge_rows(nodes, linear.held.touching, linear.held.sense, contact, edge.split()[0], wanted)
        gone = np.zeros(nodes.count, dtype=bool)
        gone[cuts[-1].gone] = True
        start = len(system.contacts)
        surfaces: list[SurfaceContact] = []
        for surface in system.surfaces:
            stop = start + surface.nodes.count
            # The modal approach reads a surface's nodes alone; what it was paired from stays.
            surfaces.append(replace(surface, nodes=surface.nodes.select(~gone[start:stop])))
            start = stop
        return replace(system, surfaces=tuple(surfaces))


@dataclass(frozen=True)
class Cut:
    """Rows of contact nodes at an edge: how many, their places among the touching nodes, their share of the touching
    area, and the places among all contact nodes of everything out to the edge, open nodes too."""

    rows: int
    released: IntArray
    share: float
    gone: IntArray


def drawn_bodies(system: System) -> list[tuple[Line | Solid, Array, int]]:
    """Bodies with rows of all their nodes' displacements, the places (k, d) of these, and d."""
    lines: list[tuple[Line | Solid, Array, int]] = [(line, line.coordinates, 2) for line in system.lines]
    return lines + [(solid, solid.points, solid.points.shape[1]) for solid in system.solids]


def edge_rows(
    nodes: ContactNodes, touching: IntArray, sense: Array, contact: int, edge: str, most: int
) -> list[Cut]:
    """1, 2, … rows of touching nodes at an edge of a contact, none where fewer than three nodes touch.

    The leading edge of the slave is where it meets material of the master first, the one ahead in the direction of its
    slip. Rows lie across the slip, on a turning disc along radii; an irregular mesh is cut into strips.
    """
    mine = np.flatnonzero(nodes.owner[touching] == contact)
    if len(mine) < 3:
        return []
    every = np.flatnonzero(nodes.owner == contact)
    whole = _along_slip(nodes, every, sense[every]) * (1 if edge == "trailing" else -1)
    at = touching[mine]
    along = whole[np.searchsorted(every, at)]
    order = np.argsort(along, kind="stable")
    length = float(np.ptp(along)) or 1.0
    row = np.zeros(len(along), dtype=np.int64)
    row[order] = np.concatenate([[0], np.cumsum(np.diff(along[order]) > SAME_ROW * length)])
    if nodes.position.shape[1] == 3 and row.max() + 1 > len(along) / 2:
        row = np.minimum((STRIPS * (along - along.min()) / length).astype(np.int64), STRIPS - 1)
    levels = np.unique(row)
    area = np.where(np.isnan(nodes.area[at]), 1.0, nodes.area[at])
    found: list[Cut] = []
    for taken in range(1, min(most, len(levels) - 1) + 1):
        chosen = np.isin(row, levels[:taken])
        edge_at = float(along[chosen].max()) + 0.5 * SAME_ROW * length
        share = float(area[chosen].sum() / area.sum())
        found.append(Cut(taken, mine[chosen], share, every[whole <= edge_at]))
    return found


def _along_slip(nodes: ContactNodes, at: IntArray, sense: Array) -> Array:
    """A coordinate (k,) that grows in the direction of each node's slip: a length, on a turning surface an angle."""
    slip = -np.einsum("kq,kqd->kd", sense, nodes.tangents[at])
    position = nodes.position[at]
    position = position - position.mean(axis=0)
    mean = slip.mean(axis=0)
    mean = mean / (np.linalg.norm(mean) or 1.0)
    straight = position @ mean
    across = slip - np.outer(slip @ mean, mean)
    # Slip that turns from node to node is that of a spin: its direction is the angle about the axis.
    if np.abs(across).max() < 1e-3:
        return straight
    other = across[int(np.argmax(np.linalg.norm(across, axis=1)))]
    other = other / np.linalg.norm(other)
    angle = np.unwrap(np.arctan2(slip @ other, slip @ mean))
    return angle if float(angle @ straight) >= 0 else -angle


def _derivatives(modes: Sequence[Mode], change: Terms) -> ComplexArray:
    """dλ/dp (b,)."""
    return np.array([m.derivative(change) for m in modes], dtype=complex)


def _grows(lam: ComplexArray) -> BoolArray:
    return lam.real > UNSTABLE_RELATIVE * np.maximum(np.abs(lam), 1.0)


def _near_axis(lam: ComplexArray, margin: float) -> BoolArray:
    """Whether (b,) the damping ratio is below the margin."""
    return -lam.real < margin * np.abs(lam)


def _growth(lam: ComplexArray) -> float:
    """Σ Re λ of what grows."""
    return float(np.maximum(lam.real, 0.0).sum())
