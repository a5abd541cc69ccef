"""What is drawn on meshed bodies beside facets: which nodes are held, where loads push, which way contacts slide."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ...sliding.motions import full_motion, mean_direction
from ...system import System
from ...typing import Array, IntArray, Sparse

MOST_HELD = 60  # marks of each body


@dataclass(frozen=True)
class Pointer:
    """An arrow of the model: where (d,) [m], its direction (d,), and the words beside it."""

    name: str
    at: Array
    direction: Array
    words: str


def held_nodes(system: System) -> Array:
    """Some of the nodes (k, d) [m] that a support holds in some direction."""
    parts: list[Array] = [np.zeros((0, system.dimension))]
    for solid in system.solids:
        free = np.diff(solid.rows.free.tocsr().indptr).reshape(len(solid.points), -1)
        held = np.flatnonzero((free == 0).any(axis=1))
        parts.append(solid.points[held[:: max(1, -(-len(held) // MOST_HELD))]])
    return np.vstack(parts)


def pushes(system: System) -> Iterator[Pointer]:
    """Where and which way each load pushes the free nodes of meshed bodies; none of one without a resultant."""
    solids = [(s.points, *_own_freedoms(s.rows.free)) for s in system.solids]
    for name, load in system.loads.items():
        total, middle, whole = np.zeros(system.dimension), np.zeros(system.dimension), 0.0
        seen = np.zeros(system.size, dtype=bool)
        for points, places, freedoms in solids:
            new = ~seen[freedoms]  # nodes that follow another one alone have its freedoms
            seen[freedoms] = True
            forces = np.zeros(points.size)
            forces[places[new]] = load[freedoms[new]]
            forces = forces.reshape(points.shape)
            sizes = np.linalg.norm(forces, axis=1)
            total, middle, whole = total + forces.sum(axis=0), middle + sizes @ points, whole + float(sizes.sum())
        resultant = float(np.linalg.norm(total))
        if resultant > 1e-6 * whole > 0.0:
            yield Pointer(name, middle / whole, total / resultant, name)


def _own_freedoms(rows: Sparse) -> tuple[IntArray, IntArray]:
    """Displacements (q,) that are a freedom themselves, and that freedom (q,): neither held nor weighed of others."""
    rows = sp.csr_array(rows)
    alone = np.flatnonzero(np.diff(rows.indptr) == 1)
    entry = rows.indptr[alone]
    same = rows.data[entry] == 1.0
    return alone[same], rows.indices[entry[same]]


def slides(system: System) -> Iterator[Pointer]:
    """Of each contact over a surface, how its master moves against the slave, where it comes out under it."""
    nodes = system.contact_nodes()
    if not nodes.count:
        return
    slip = np.einsum("mq,mqd->md", nodes.slip_velocity(full_motion(system)), nodes.tangents)
    for _, own in system.nodes_of_surfaces():
        direction = mean_direction(slip[own])
        if direction is None:
            continue
        speeds = np.linalg.norm(slip[own], axis=1)
        low, high = f"{speeds.min():.3g}", f"{speeds.max():.3g}"
        words = f"{high} m/s" if low == high else f"{low} to {high} m/s"
        along, middle = -(nodes.position[own] @ direction), nodes.position[own].mean(axis=0)
        out = middle - direction * float(along.max() - along.mean())
        yield Pointer(nodes.names[int(nodes.owner[own][0])], out, -direction, words)
