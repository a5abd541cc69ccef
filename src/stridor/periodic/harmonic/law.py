"""Contact and friction at every time of a period, set-valued, with their derivatives.

A rigid contact is P = max(0, p − ε g), which at p = P says g ≥ 0, P ≥ 0, P g = 0; dry friction is the point of the disc
of radius μ N that is nearest to q = p − ρ v, which at p = P says that v ≠ 0 only where |p| = μ N, against it (Alart and
Curnier 1991; the dual formulation of Nacivet, Pierre, Thouverez and Jezequel 2003, with the velocity where theirs has
the increment of the displacement). Contacts with stiffness give P of the gap alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...typing import Array, BoolArray, IntArray
from ..cycle import OPEN, SLIP, STICK
from .friction import slips_at


@dataclass(frozen=True)
class Applied:
    """Forces that the law gives at n times, and what they change by.

    normal (m, n) with by_force, by_gap (m, n) of p_N and g; tangential (m, d, n) with by_pull (m, d, d, n) of q_T,
    by_normal (m, d, n) of the normal force and by_mu (m, d, n); springs (q, n) with by_stretch (q, n). status (m, n):
    open, stick or slip. margin: least of what keeps the answer unique, above 0. touch, beyond (m, n): numbers that
    change sign where a node parts and where it begins to slip.
    """

    normal: Array
    by_force: Array
    by_gap: Array
    tangential: Array
    by_pull: Array
    by_normal: Array
    by_mu: Array
    springs: Array
    by_stretch: Array
    status: IntArray
    margin: float
    touch: Array
    beyond: Array


@dataclass(frozen=True)
class ContactLaw:
    """m contact nodes with d tangents: stiffness (m,) [N/m], inf where rigid, cubic (m,) [N/m³], kept (m,) closed;
    owner (m,) rows of ``table``, friction laws that give one at the slip of steady sliding; spring (q,) [N/m³] and
    stretch (q,) [m] of cubic springs of the structure."""

    stiffness: Array
    cubic: Array
    kept: BoolArray
    owner: IntArray
    table: Array
    constant: BoolArray
    spring: Array
    stretch: Array

    def __call__(
        self, mu: float, force: Array, gap: Array, pull: Array, elongation: Array, push: Array, rub: Array
    ) -> Applied:
        """The law at normal forces p_N and gaps g (m, n), q_T = p_T − ρ v (m, d, n) and elongations (q, n); push ε, rub
        ρ (m,)."""
        normal, by_force, by_gap, touch = self._normal(force, gap, push)
        tangential, by_pull, by_normal, by_mu, beyond, margin = self._friction(mu, np.abs(normal), pull, rub)
        by_normal = by_normal * np.where(normal < 0.0, -1.0, 1.0)[:, None]
        touching = (normal != 0.0) if not np.any(self.kept) else (normal > 0.0) | self.kept[:, None]
        status = np.where(touching, np.where(beyond <= 0.0, STICK, SLIP), OPEN)
        stretched = elongation + self.stretch[:, None]
        return Applied(
            normal, by_force, by_gap, tangential, by_pull, by_normal, by_mu, -self.spring[:, None] * stretched**3,
            -3.0 * self.spring[:, None] * stretched**2, status, margin, touch, beyond,
        )  # fmt: skip

    def _normal(self, force: Array, gap: Array, push: Array) -> tuple[Array, Array, Array, Array]:
        rigid, kept = np.isinf(self.stiffness)[:, None], self.kept[:, None]
        held = force - push[:, None] * gap
        touch = np.where(rigid, held, -gap)
        closed = kept | (touch > 0.0)
        stiffness = np.where(rigid, 0.0, self.stiffness[:, None])
        given = np.where(rigid, held, -(stiffness * gap + self.cubic[:, None] * gap**3))
        by_gap = np.where(rigid, -push[:, None], -(stiffness + 3.0 * self.cubic[:, None] * gap**2))
        by_force = np.where(closed & rigid, 1.0, 0.0)
        return np.where(closed, given, 0.0), by_force, np.where(closed, by_gap, 0.0), np.where(kept, 1.0, touch)

    def _friction(
        self, mu: float, normal: Array, pull: Array, rub: Array
    ) -> tuple[Array, Array, Array, Array, Array, float]:
        m, d, n = pull.shape
        size = np.sqrt(np.einsum("mdn,mdn->mn", pull, pull))
        found = np.empty((m, n, 3))
        slips_at(size, normal, mu, self.table, self.owner, rub, found)
        shape, slope = found[..., 1], found[..., 2]
        limit = mu * shape * normal
        sticks = (size <= limit) & (limit > 0.0)  # where there is no friction nothing sticks, at no slip either
        way = pull / np.where(size > 0.0, size, 1.0)[:, None]
        # Of the limit by |q|, N and μ, the speed going along.
        moving = np.where(self.constant[:, None], 0.0, slope * mu * normal)
        firm = rub[:, None] + moving
        by_size = np.where(sticks, 1.0, moving / firm)
        by_normal = np.where(sticks, 0.0, rub[:, None] * mu * shape / firm)
        by_mu = np.where(sticks, 0.0, rub[:, None] * shape * normal / firm)
        share = np.where(sticks, 1.0, limit / np.where(size > 0.0, size, 1.0))
        along = np.einsum("man,mbn->mabn", way, way)
        by_pull = (by_size - share)[:, None, None] * along + share[:, None, None] * np.eye(d)[None, :, :, None]
        slipping = ~sticks
        margin = float((firm / rub[:, None])[slipping].min(initial=1.0))
        return share[:, None] * pull, by_pull, by_normal[:, None] * way, by_mu[:, None] * way, size - limit, margin
