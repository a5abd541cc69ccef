"""What harmonic balance is made of: a system under constant loads, slid steadily, condensed to its contact nodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from ...errors import AnalysisError, CaseError
from ...laws.friction import FrictionLaw, friction_rows
from ...modal.options import Options
from ...modal.painleve import refuse_undetermined
from ...sliding import full_motion, steady_nodes
from ...system import System
from ...typing import Array, IntArray
from .condensed import Condensed, condensed
from .law import ContactLaw

WIDE = 8.0  # times the highest frequency asked for: modes of larger systems
BETWEEN = 3.5  # times that: where a free mass swings on a spring κ
MOST_ROWS = 600


def why_not_harmonic(system: System) -> str:
    """Why harmonic balance does not take a system; "" where it does."""
    nodes = system.contact_nodes()
    if not nodes.count:
        return "it has no contact"
    if system.not_symmetric_definite:
        return system.not_symmetric_definite
    if system.load_steps:
        return "it has load steps, so that what drives it does not stay the same"
    if system.finitely_sliding:
        return f"contact {system.finitely_sliding[0]} slides finitely, so that its rows move"
    factors = full_motion(system)
    if not np.any(factors):
        return "nothing slides: no support has a velocity"
    if nodes.count * (1 + nodes.directions) > MOST_ROWS:
        return f"{nodes.count} contact nodes are too many: up to {MOST_ROWS // (1 + nodes.directions)}"
    cubic = system.cubic
    if cubic is not None and np.any(np.abs(cubic.rows.lift @ factors) > 0.0):
        return "a cubic spring is stretched without end by what moves"
    for name, one in zip(nodes.names, nodes.laws_at(1.0), strict=True):
        if one.sticking > (1.0 + 1e-12) * one.sliding(0.0):
            return (
                f"contact {name} sticks up to a larger coefficient than it slides with at rest, so that its force "
                "jumps as it lets go, which no series follows, and sticks as soon as its slip stops, so that no branch "
                "from an onset leads there"
            )
    return ""


@dataclass(frozen=True)
class SteadyContact:
    """Steady sliding at ``mu``: normal force (m,), friction (m, d) [N] on the slave and gap (m,) [m]."""

    mu: float
    normal: Array
    friction: Array
    gap: Array


class HarmonicFamily:
    """The balance of one system at any μ, with receptances that hold to ``highest_hz``.

    m nodes, d tangents: rows (r,) are m normals, m d tangents node by node, then cubic springs. spring (m,): κ; slip
    (m, d) [m/s]: in steady sliding; gap (m,) [m]: reference. own: whether μ is a factor of the laws' own coefficients,
    and not the coefficient of all at their slip speeds. Raises CaseError for what it does not take.
    """

    def __init__(self, system: System, highest_hz: float, *, own: bool = False) -> None:
        self.own = own
        if not own and (why := why_not_harmonic(system)):
            raise CaseError("case", "no cycles can be balanced of it", f"what harmonic balance takes; {why}")
        self.system, self.highest_hz = system, highest_hz
        self.placed = system.in_place()
        nodes = self.placed.contact_nodes()
        self.nodes, self.motion = nodes, full_motion(system)
        m, d = nodes.count, nodes.directions
        self.count, self.directions = m, d
        self.slip = nodes.slip_velocity(self.motion)
        self.speed = np.linalg.norm(self.slip, axis=1)
        cubic = self.placed.cubic
        springs = sp.csr_array((0, system.size)) if cubic is None else sp.csr_array(cubic.rows.free)
        self.springs = springs.shape[0]
        rows = sp.csr_array(sp.vstack([nodes.normal, nodes.tangent, springs]))
        stiffness = np.divide(1.0, nodes.compliance, out=np.full(m, np.inf), where=nodes.compliance > 0.0)
        self.spring = self._along_normals(stiffness)
        force = sum(self.placed.loads.values(), np.zeros(system.size)) - system.motion.damping @ self.motion
        force = force - nodes.normal.T @ (self.spring * nodes.gap)
        press = sp.csr_array(nodes.normal.T @ sp.diags_array(self.spring) @ nodes.normal)
        self.condensed: Condensed = condensed(self.placed, rows, press, force, 2 * np.pi * WIDE * highest_hz)
        self.still = self.condensed.still
        laws = self.laws(1.0)
        constant = np.array([law.constant for law in laws], dtype=bool)
        self.law = ContactLaw(
            stiffness, np.where(np.isinf(stiffness), 0.0, nodes.cubic), nodes.kept, nodes.owner.astype(np.int64),
            friction_rows(laws), constant[nodes.owner], np.zeros(0) if cubic is None else cubic.coefficient,
            np.zeros(0) if cubic is None else np.zeros(self.springs) + cubic.stretch,
        )  # fmt: skip
        self.piecewise_linear = bool(np.all(constant) and not np.any(nodes.cubic) and not self.springs)
        self._steady: dict[float, SteadyContact] = {}

    def _along_normals(self, stiffness: Array) -> Array:
        """κ (m,): that of the contact, of a rigid one that of the structure at the node; what only contact holds would
        swing with it between two harmonics."""
        nodes, system = self.nodes, self.placed
        normal = nodes.normal
        squares = np.asarray((normal * normal).sum(axis=1)).ravel()
        own = np.asarray((normal * (normal @ system.stiffness)).sum(axis=1)).ravel()
        inert = np.asarray((normal * (normal @ system.mass)).sum(axis=1)).ravel()
        local = np.maximum(own, (BETWEEN * 2 * np.pi * self.highest_hz) ** 2 * inert) / np.maximum(squares, 1e-300) ** 2
        return np.where(np.isinf(stiffness), local, stiffness)

    def steady(self, mu: float) -> SteadyContact:
        """Steady sliding. Raises AnalysisError where there is none, and where rigid contact does not determine it."""
        if not mu >= 0.0:
            raise AnalysisError(f"μ = {mu:g} is no friction coefficient")
        if mu not in self._steady:
            while len(self._steady) > 8:
                self._steady.pop(next(iter(self._steady)))
            if not self.own:
                refuse_undetermined(self.system, mu, Options(), touching_at=mu)
            found = steady_nodes(self.system, mu)
            self._steady[mu] = SteadyContact(mu, found.normal_force, found.friction_force, found.gap)
        return self._steady[mu]

    def split(self, rows: Any) -> tuple[Any, Any, Any]:
        """Rows (r, …) as those of normals (m, …), tangents (m, d, …) and cubic springs (q, …)."""
        m, d = self.count, self.directions
        return rows[:m], rows[m : m * (1 + d)].reshape(m, d, *rows.shape[1:]), rows[m * (1 + d) :]

    def joined(self, normal: Array, tangential: Array, springs: Array) -> Array:
        """The same together."""
        return np.concatenate([normal, tangential.reshape(self.count * self.directions, *normal.shape[1:]), springs])

    @property
    def owners(self) -> IntArray:
        """The node (r,) that each row belongs to; −1 of cubic springs."""
        m, d = self.count, self.directions
        return np.concatenate([np.arange(m), np.repeat(np.arange(m), d), np.full(self.springs, -1)])

    @property
    def names(self) -> tuple[str, ...]:
        """A name for each node (m,): its contact's, with a number from 1 where that has several."""
        nodes = self.nodes
        many = np.bincount(nodes.owner, minlength=len(nodes.names))
        met = np.zeros(len(nodes.names), dtype=int)
        found: list[str] = []
        for k in nodes.owner:
            met[k] += 1
            found.append(nodes.names[k] if many[k] == 1 else f"{nodes.names[k]} {met[k]}")
        return tuple(found)

    def laws(self, mu: float) -> list[FrictionLaw]:
        """The laws at a coefficient."""
        nodes = self.nodes
        if self.own:
            return [law.scaled(mu * law.sliding(1.0), 1.0) for law in nodes.laws]
        return list(nodes.laws_at(mu))
