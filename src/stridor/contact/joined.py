"""Slave nodes that a repeating tie makes one: on both sides of the cut through a body that repeats.

The nodes of a contact at the end of a sector do what those at its start do, turned. On the whole ring each such pair is
one node with the facets of both sides around it: its area is the sum, its row the mean of both rows by their areas.
Two rows in their place would hold one freedom twice: of rigid contact the forces would be whatever rounding, or the
slightest difference of the rows, makes them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from ..typing import Array, IntArray, Sparse
from .master import Location
from .nodes import ContactNodes
from .ties import SAME, Bond

OPPOSED = 0.5  # cosine between the normals of one node, turned to one side: beyond it they are two faces


@dataclass(frozen=True)
class Joined:
    """m slave nodes of which some are one. into (m,): the node that each is part of, counted from 0 in the order of the
    first of each; turns (m, d, d): what the first of its node does times this is what the node does.
    doubtful (q,): those joined nodes that ties of meshes that do not match lead by others of the contact, so that
    they are nearly but not quite one.
    """

    into: IntArray
    turns: Array
    doubtful: IntArray

    @property
    def first(self) -> IntArray:
        """The first slave node of each joined one."""
        return np.unique(self.into, return_index=True)[1]

    def even(self, location: Location, area: Array) -> Location:
        """The location with one normal for the parts (m,) of a node, turned to each: the mean by area."""
        normal = self.mean(area) @ np.einsum("mji,mj->mi", self.turns, location.normal)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = np.einsum("mij,mj->mi", self.turns, (normal / length)[self.into])
        # Those that are alone stay as they are to the last digit.
        several = np.bincount(self.into)[self.into] > 1
        return replace(location, normal=np.where(several[:, None], normal, location.normal))

    def tangents(self, tangents: Array) -> Array:
        """Tangents (m, d−1, d) of the first of each node, turned to all its parts."""
        return np.einsum("mij,mkj->mki", self.turns, tangents[self.first][self.into])

    def mean(self, area: Array) -> Sparse:
        """Means (q, m) csr of the parts (m,) of each node by area, evenly where none of them has any."""
        total = np.bincount(self.into, weights=area)[self.into]
        even = 1.0 / np.bincount(self.into)[self.into]
        part = np.where(total > 0.0, area / np.where(total > 0.0, total, 1.0), even)
        return sp.csr_array((part, (self.into, np.arange(len(area)))))

    def nodes(self, apart: ContactNodes) -> ContactNodes:
        """One node in place of its parts."""
        first, total = self.first, np.bincount(self.into, weights=apart.area)
        mean = self.mean(apart.area)
        by_direction = sp.csr_array(sp.kron(mean, sp.eye_array(apart.directions)))
        # One over the sum of the stiffnesses, and rigid where they are.
        with np.errstate(divide="ignore"):
            soft = 1.0 / np.bincount(self.into, weights=1.0 / apart.compliance)
        return replace(
            apart,
            owner=apart.owner[first],
            normal=_csr(mean @ apart.normal),
            tangent=_csr(by_direction @ apart.tangent),
            normal_lift=mean @ apart.normal_lift,
            tangent_lift=by_direction @ apart.tangent_lift,
            gap=mean @ apart.gap,
            area=total,
            compliance=soft,
            position=apart.position[first],
            normals=apart.normals[first],
            tangents=apart.tangents[first],
            cubic=np.bincount(self.into, weights=apart.cubic),
        )


def joined(freedoms: IntArray, normals: Array, bonds: Sequence[Bond]) -> Joined | None:
    """Which of slave nodes with displacements ``freedoms`` (m, d) and normals (m, d) out of the master the bonds of
    bodies that repeat make one; None where there are none."""
    leader: dict[int, tuple[int, Array | None]] = {}
    vague: dict[int, IntArray] = {}
    for bond in bonds:
        weights = bond.tie.weights
        alone = np.flatnonzero(np.sum(np.abs(weights) > SAME, axis=1) == 1)
        place = np.argmax(np.abs(weights), axis=1)
        to = bond.master[bond.tie.nodes[np.arange(len(place)), place], 0]
        for node in alone.tolist():
            leader.setdefault(int(bond.slave[node, 0]), (int(to[node]), bond.rotation))
        for node in np.setdiff1d(np.arange(len(weights)), alone).tolist():
            vague[int(bond.slave[node, 0])] = bond.master[bond.tie.nodes[node][np.abs(weights[node]) > SAME], 0]
    names = freedoms[:, 0]
    if not np.isin(names, [*leader, *vague]).any():
        return None
    m, d = normals.shape
    into, turns = np.arange(m), np.repeat(np.eye(d)[None], m, axis=0)
    whole, seen = turns.copy(), {}
    for node in range(m):
        at = int(names[node])
        for _ in range(len(bonds)):  # corners follow several ties
            if at not in leader:
                break
            at, rotation = leader[at]
            if rotation is not None:
                whole[node] = whole[node] @ rotation
        for other in seen.setdefault(at, []):
            turn = whole[node] @ whole[other].T
            if normals[node] @ turn @ normals[other] > OPPOSED:
                into[node], turns[node] = other, turn
                break
        else:
            seen[at].append(node)
    own = set(names.tolist())
    doubtful = [k for k, name in enumerate(names.tolist()) if name in vague and own.intersection(vague[name].tolist())]
    if not doubtful and np.array_equal(into, np.arange(m)):
        return None
    into = np.unique(into, return_inverse=True)[1]
    return Joined(into, turns, np.unique(into[doubtful]).astype(np.int64))


def _csr(matrix: Sparse) -> Sparse:
    found = sp.csr_array(matrix)
    found.eliminate_zeros()
    return found
