"""Arrays of the implicit loop from a system, its coordinates and a step."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sl

from ....contact.nodes import ContactNodes
from ....laws.friction import friction_rows
from ....system import System
from ....typing import Array, Sparse
from ...columns import STATISTICS
from ...phase_results import fresh_statistics
from ..basis import Basis
from ..sparse.node_table import sliding_directions
from .arrays import COUNTERS, Nodes, StepState, Structure, Work
from .warp import warped

COUPLED = 1e-4  # of the power that a motion loses: up to there what coordinates take from one another is left out


def structure_of(system: System, basis: Basis, step: float) -> Structure:
    """Masses, damping and stiffness of the scheme, and what drives the structure."""
    motion, r = system.motion, basis.size
    found = warped(basis.stiffness, basis.damping, step)
    diagonal = np.diag(found.damping).copy()
    coupled = coupling(found.damping) > COUPLED
    effective = found.mass + 0.25 * step**2 * found.stiffness
    solved = sl.inv(np.diag(effective) + 0.5 * step * found.damping) if coupled else np.zeros((0, 0))
    loads = np.array(list(system.loads.values()), dtype=float).reshape(len(system.loads), system.size)
    return Structure(
        step=step,
        mass=found.mass,
        damping=diagonal,
        stiffness=np.array(found.stiffness, dtype=float),
        inverse=1.0 / (effective + 0.5 * step * diagonal),
        coupled=np.ascontiguousarray(found.damping) if coupled else np.zeros((0, 0)),
        solved=np.ascontiguousarray(solved),
        loads=np.ascontiguousarray(loads @ basis.vectors),
        inertia=np.ascontiguousarray(np.asarray(motion.mass, dtype=float).T @ basis.vectors).reshape(-1, r),
        drag=np.ascontiguousarray(np.asarray(motion.damping, dtype=float).T @ basis.vectors).reshape(-1, r),
        load_lift=np.ascontiguousarray(loads @ motion.lift),
        mass_own=np.array(motion.mass_own, dtype=float),
        damping_own=np.array(motion.damping_own, dtype=float),
        stiffness_own=np.array(motion.stiffness_own, dtype=float),
    )


def coupling(damping: Array) -> float:
    """What the coupling of coordinates by damping (r, r) makes of the power vᵀCv that a motion loses, of what the
    diagonal D makes of it, for any motion: at most |D^−½ (C − D) D^−½|. Infinite where D has a zero and C more."""
    diagonal = np.diag(damping)
    beside = damping - np.diag(diagonal)
    some = np.any(beside, axis=0)
    if not np.any(some):
        return 0.0
    if np.any(diagonal[some] <= 0.0):
        return np.inf
    size = np.sqrt(diagonal[some])
    return float(np.linalg.norm(beside[np.ix_(some, some)] / np.outer(size, size), 2))


def nodes_of(
    system: System, nodes: ContactNodes, rows: Sparse, lift: Array, basis: Basis, structure: Structure
) -> Nodes:
    """The contact nodes in coordinates, with the Delassus operator."""
    row = np.ascontiguousarray(rows @ basis.vectors)
    answer = row * structure.inverse if not structure.solved.size else row @ structure.solved
    return Nodes(
        row=row,
        answer=np.ascontiguousarray(answer),
        delassus=np.ascontiguousarray(row @ answer.T),
        lift=np.ascontiguousarray(lift, dtype=float),
        gap=np.array(nodes.gap, dtype=float),
        stiffness=np.divide(1.0, nodes.compliance, out=np.zeros(nodes.count), where=nodes.compliance > 0.0),
        owner=np.array(nodes.owner, dtype=np.int64),
        friction=friction_rows(nodes.laws),
        along=sliding_directions(nodes, system.motion.full),
        weight=np.where(np.isnan(nodes.area), 1.0, nodes.area),
        kept=nodes.kept.astype(np.int64),
    )


def fresh_state(nodes: Nodes, structure: Structure, contacts: int) -> StepState:
    """Nothing moves yet."""
    m, total, r, p = len(nodes.gap), len(nodes.row), len(structure.mass), len(structure.inertia)
    return StepState(
        q=np.zeros(r), v=np.zeros(r), before=np.zeros(r), place=np.zeros(m), speed=np.zeros(total),
        impulse=np.zeros(total), earlier=np.zeros(total), status=np.zeros(m, dtype=np.int64), works=np.zeros(5),
        statistics=fresh_statistics(contacts, STATISTICS), counters=np.zeros(COUNTERS, dtype=np.int64),
        motion=np.zeros((2, p)), rate_before=np.zeros(p),
    )  # fmt: skip


def work_space(nodes: Nodes, structure: Structure, contacts: int, directions: int) -> Work:
    """Room for one step."""
    total, r, m = len(nodes.row), len(structure.mass), len(nodes.gap)
    return Work(
        change=np.zeros(r), force=np.zeros(r), free=np.zeros(total), total=np.zeros(total), slip=np.zeros(total),
        start=np.zeros(m), apart=np.zeros(total), impulse=np.zeros(total), status=np.zeros(m, dtype=np.int64),
        sums=np.zeros((contacts, 6)), local=np.zeros((5, directions + 1)), rate=np.zeros(len(structure.inertia)),
        chosen=np.zeros(m, dtype=np.int64), marked=np.zeros(m, dtype=np.int64), near=np.zeros(total),
        packed=np.zeros((total, total)), place_of=np.full(m, -1, dtype=np.int64), holder=np.zeros(m, dtype=np.int64),
        used=np.zeros(1, dtype=np.int64),
    )  # fmt: skip
