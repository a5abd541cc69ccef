"""Many slave nodes in contact as sparse operators: what both approaches need of them.

Signs are those of `interface`: the normal points from the master to the slave, gaps are positive when open, normal
forces positive in compression, slip is the motion of the slave relative to the master.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from ..laws.friction import FrictionLaw, relative_coefficients, share_of, slope_at
from ..typing import Array, BoolArray, IntArray, Sparse


@dataclass(frozen=True)
class ContactNodes:
    """m nodes in contact, d = 2 or 3, on n freedoms and p prescribed motions.

    names: the contacts, owner (m,) which of them a node belongs to, laws one friction law for each contact.
    normal (m, n) csr and tangent ((d−1) m, n) csr give the relative displacement slave − master along the normal and
    the d − 1 tangents; rows i (d−1) + k of tangent belong to node i. normal_lift (m, p) and tangent_lift ((d−1) m, p)
    do so for the prescribed motions. gap (m,) [m] in the reference configuration. area (m,) [m²] is the part of the
    slave surface a node stands for, NaN for a point contact. compliance (m,) [m/N] is one over contact stiffness
    (stiffness per area times area), 0 for rigid contact. cubic (m,) [N/m³] is the factor of the cube of the approach in
    the normal force, p = δ/compliance + cubic δ³, zero where left out and where contact is rigid. position (m, d) [m],
    normals (m, d), tangents (m, d−1, d). closed: for each contact whether it is kept closed; () where none is. Where
    it pulls, p has the sign of δ.

    A friction coefficient μ that is asked for of all contacts is that of each contact at its mean slip speed v̄ in
    steady sliding, to which its law is scaled as a whole: a node that slips at v has μ·μ(v)/μ(v̄). speed (m,) [m/s]: of
    the nodes in steady sliding, mean_speed: v̄ of each contact; () where nobody asks for such a μ.
    """

    names: tuple[str, ...]
    owner: IntArray
    laws: tuple[FrictionLaw, ...]
    normal: Sparse
    tangent: Sparse
    normal_lift: Array
    tangent_lift: Array
    gap: Array
    area: Array
    compliance: Array
    position: Array
    normals: Array
    tangents: Array
    cubic: Array = None  # type: ignore[assignment]  # ty: ignore[invalid-assignment]  # filled in __post_init__
    closed: tuple[bool, ...] = ()
    speed: Array = None  # type: ignore[assignment]  # ty: ignore[invalid-assignment]  # filled in __post_init__
    mean_speed: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.cubic is None:  # pyright: ignore[reportUnnecessaryComparison]
            object.__setattr__(self, "cubic", np.zeros(len(self.gap)))
        if self.speed is None:  # pyright: ignore[reportUnnecessaryComparison]
            object.__setattr__(self, "speed", np.zeros(len(self.gap)))

    @property
    def kept(self) -> BoolArray:
        """Nodes (m,) of contacts that are kept closed, whether they push or pull."""
        return np.array(self.closed)[self.owner] if self.closed else np.zeros(self.count, dtype=bool)

    @property
    def share(self) -> Array:
        """The part (m,) of a friction coefficient asked for of all contacts that each node gets in steady sliding, 0
        without friction."""
        return self.coefficients(1.0, self.speed)

    @cached_property
    def relative(self) -> Array:
        """The part (m,) of its contact's coefficient that each node has in steady sliding, μ(v)/μ(v̄)."""
        return self._relative(self.speed)

    @property
    def rubs(self) -> BoolArray:
        """Nodes (m,) of contacts that get a part of a friction coefficient asked for of all contacts."""
        return self._common > 0.0

    @property
    def _common(self) -> Array:
        return np.array([share_of(law) for law in self.laws], dtype=float)[self.owner]

    def _relative(self, speeds: Array) -> Array:
        found = np.ones(self.count)
        for k, (law, mean) in enumerate(zip(self.laws, self.mean_speed, strict=False)):
            mine = np.flatnonzero(self.owner == k)
            found[mine] = relative_coefficients(law, speeds[mine], mean)
        return found

    def coefficients(self, mu: float, speeds: Array) -> Array:
        """Friction coefficients (m,) at slip speeds (m,) [m/s] where ``mu`` is asked for of all contacts."""
        steady = np.array_equal(speeds, self.speed)
        return float(mu) * self._common * (self.relative if steady else self._relative(speeds))

    def laws_at(self, mu: float) -> tuple[FrictionLaw, ...]:
        """The law of each contact, scaled to ``mu`` at its mean slip speed in steady sliding."""
        return tuple(law.scaled(float(mu), v) for law, v in zip(self.laws, self.mean_speed, strict=True))

    @property
    def count(self) -> int:
        """Number of nodes m."""
        return len(self.gap)

    @property
    def directions(self) -> int:
        """Tangential directions per node, d − 1."""
        return int(self.tangents.shape[1]) if self.tangents.ndim == 3 else 1

    def slip_velocity(self, motion_factors: Array) -> Array:
        """Slip velocity (m, d−1) [m/s] along the tangents where the structure is at rest in the moving frame."""
        return (self.tangent_lift @ motion_factors).reshape(self.count, self.directions)

    def friction_coefficients(self, speeds: Array) -> Array:
        """μ (m,) at slip speeds (m,) [m/s], each by the law of its contact."""
        found = np.zeros(self.count)
        for k, law in enumerate(self.laws):
            mine = np.flatnonzero(self.owner == k)
            found[mine] = law.sliding(1.0) if law.constant else [law.sliding(float(v)) for v in speeds[mine]]
        return found

    def friction_slopes(self, speeds: Array, coefficients: Array) -> Array:
        """dμ/d|v| (m,) [s/m] at slip speeds (m,) [m/s] of the laws scaled to the coefficients (m,) of the nodes there:
        each node's own, not a common one of which it gets a share."""
        found = np.zeros(self.count)
        for k, law in enumerate(self.laws):
            if not law.constant:
                mine = np.flatnonzero(self.owner == k)
                pairs = zip(coefficients[mine], speeds[mine], strict=True)
                found[mine] = [slope_at(law, float(mu), float(v)) for mu, v in pairs]
        return found

    def along(self, direction: Array) -> Sparse:
        """Rows (m, n) csr of the relative tangential displacement along one direction (m, d−1) per node."""
        count, d = self.count, self.directions
        rows = np.repeat(np.arange(count), d)
        pick = sp.csr_array((direction.ravel(), (rows, np.arange(count * d))), shape=(count, count * d))
        return sp.csr_array(pick @ self.tangent)

    def at_force(self, normal_force: Array) -> ContactNodes:
        """The same contacts with the compliance (m,) of small motions about normal forces (m,) [N]."""
        if not np.any(self.cubic):
            return self
        stiffness = np.divide(1.0, self.compliance, out=np.zeros(self.count), where=self.compliance > 0)
        force = np.where(self.kept, np.abs(normal_force), np.maximum(normal_force, 0.0))
        tangent = stiffness + 3 * self.cubic * approach(force, stiffness, self.cubic) ** 2
        soft = np.divide(1.0, tangent, out=np.zeros(self.count), where=tangent > 0)
        return replace(self, compliance=np.where(self.cubic > 0, soft, self.compliance))

    def select(self, chosen: BoolArray | IntArray) -> ContactNodes:
        """The same contacts with only some of their nodes."""
        index = np.flatnonzero(chosen) if np.asarray(chosen).dtype == bool else np.asarray(chosen)
        d = self.directions
        rows = (index[:, None] * d + np.arange(d)).ravel()
        return replace(
            self,
            owner=self.owner[index],
            normal=self.normal[index],
            tangent=self.tangent[rows],
            normal_lift=self.normal_lift[index],
            tangent_lift=self.tangent_lift[rows],
            gap=self.gap[index],
            area=self.area[index],
            compliance=self.compliance[index],
            position=self.position[index],
            normals=self.normals[index],
            tangents=self.tangents[index],
            cubic=self.cubic[index],
            speed=self.speed[index],
        )


def stack(parts: Sequence[ContactNodes], freedoms: int, motions: int, dimension: int) -> ContactNodes:
    """Several contacts as one list of nodes; an empty list is one without nodes."""
    d = dimension - 1
    if not parts:
        return ContactNodes(
            names=(),
            owner=np.zeros(0, dtype=np.int64),
            laws=(),
            normal=sp.csr_array((0, freedoms)),
            tangent=sp.csr_array((0, freedoms)),
            normal_lift=np.zeros((0, motions)),
            tangent_lift=np.zeros((0, motions)),
            gap=np.zeros(0),
            area=np.zeros(0),
            compliance=np.zeros(0),
            position=np.zeros((0, dimension)),
            normals=np.zeros((0, dimension)),
            tangents=np.zeros((0, d, dimension)),
        )
    starts = np.cumsum([0, *(len(p.names) for p in parts)])

    def joined(name: str) -> Array:
        return np.concatenate([getattr(p, name) for p in parts])

    return ContactNodes(
        names=tuple(name for p in parts for name in p.names),
        owner=np.concatenate([p.owner + start for p, start in zip(parts, starts[:-1], strict=True)]),
        laws=tuple(law for p in parts for law in p.laws),
        closed=tuple(c for p in parts for c in (p.closed or (False,) * len(p.names))),
        normal=sp.csr_array(sp.vstack([p.normal for p in parts])),
        tangent=sp.csr_array(sp.vstack([p.tangent for p in parts])),
        normal_lift=joined("normal_lift"),
        tangent_lift=joined("tangent_lift"),
        gap=joined("gap"),
        area=joined("area"),
        compliance=joined("compliance"),
        position=joined("position"),
        normals=joined("normals"),
        tangents=joined("tangents"),
        cubic=joined("cubic"),
    )


def approach(force: Array, stiffness: Array, cubic: Array) -> Array:
    """δ (m,) [m] ≥ 0 with k δ + k₃ δ³ = p for forces p (m,) ≥ 0 [N], zero where there is no cubic term.

    The one real root in hyperbolic functions: δ = 2a sinh(⅓ asinh(3p/2ka)), a = √(k/3k₃).
    """
    found = np.zeros(len(force))
    chosen = cubic > 0
    scale = np.sqrt(stiffness[chosen] / (3 * cubic[chosen]))
    found[chosen] = 2 * scale * np.sinh(np.arcsinh(1.5 * force[chosen] / (stiffness[chosen] * scale)) / 3)
    return found
