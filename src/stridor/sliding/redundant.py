"""Rigid contacts that press on the same freedoms more often than these can answer: their forces are not unique."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from ..contact.nodes import ContactNodes
from ..errors import AnalysisError
from ..system import System
from ..system.holders import words
from ..typing import Array, BoolArray, IntArray, Sparse

MOST = 3000  # rows that are compared with one another, at most; beyond it nothing is said
SAME = 1e-10  # of the largest eigenvalue of the rows' products: dependent
FAINT = 1e-9  # of a row's largest weight: rounding


def redundant(system: System, nodes: ContactNodes, rigid: BoolArray) -> str:
    """Which contacts make the rows of normal displacement of the nodes ``rigid`` (m,) dependent, in words; "" where
    they are not.

    With y N = 0 for a y ≠ 0 of these rows N, forces along y do no work on anything, and no equation tells their size: a
    solver finds the matrix singular, or an answer that rounding made. y names the contacts; what holds their nodes
    besides, supports and ties, took the freedoms that would tell.
    """
    chosen = np.flatnonzero(rigid)
    if len(chosen) < 2:
        return ""
    rows = sp.csr_array(nodes.normal[chosen])
    size = np.sqrt(np.asarray(rows.multiply(rows).sum(axis=1)).ravel())
    count = int(np.count_nonzero(size > FAINT))
    left = _entangled(rows, size)
    if not 1 < len(left) <= MOST:
        return ""
    some = rows[left]
    products = (some @ some.T).toarray() / np.outer(size[left], size[left])
    values, vectors = sl.eigh(products)
    null = vectors[:, values < SAME * values[-1]]
    more = null.shape[1]
    if not more:
        return ""
    involved = chosen[left[np.linalg.norm(null, axis=1) > 1e-6]]
    names = [nodes.names[k] for k in dict.fromkeys(nodes.owner[involved].tolist())]
    who = ", ".join(words(system.holders, names))
    return (
        f"steady sliding: rigid contact presses on the same freedoms twice: {more} of the {count} conditions of rigid "
        f"contact {'follows' if more == 1 else 'follow'} from the others ({who}), so that their forces cannot be told "
        "apart; give one of these contacts a stiffness, or remove it or a support"
    )


def refuse_redundant(system: System) -> None:
    """Raise AnalysisError for rigid contacts whose rows of normal displacement are dependent, where all touch: without
    a load there is no steady sliding that would say so."""
    nodes = system.contact_nodes()
    if twice := system.once(("redundant",), lambda: redundant(system, nodes, nodes.compliance == 0.0)):
        raise AnalysisError(twice)


def nearly_one(system: System, touches: BoolArray, rigid: BoolArray) -> str:
    """Which rigid contact, of those with a node that touches (m,), has slave nodes that a repeating tie makes nearly
    one, as its meshes do not match, in words; "" for none.

    Such a node follows several of the others. Their rows differ by what the meshes do, so that no rank tells of them,
    and the forces are as good as not unique: one of them takes all, the other one opens.
    """
    for surface, mine in system.nodes_of_surfaces():
        one = surface.joined
        if one is None or not len(one.doubtful) or not (touches[mine] & rigid[mine]).any():
            continue
        who = ", ".join(words(system.holders, [surface.name]))
        at = ", ".join(f"{x:.6g}" for x in surface.nodes.position[one.doubtful[0]])
        return (
            "steady sliding: rigid contact presses on the same freedoms twice: of the slave nodes on the cut through a "
            f"body that repeats {len(one.doubtful)} {'follows' if len(one.doubtful) == 1 else 'follow'} several "
            f"others, as the meshes of both sides do not match there, first at ({at}) m ({who}); let them match, or "
            "give the contact a stiffness"
        )
    return ""


def closed(active: BoolArray, gap: Array, displacement: Array, rounding: float = 0.0) -> BoolArray:
    """Nodes (m,) that touch, with a force or without: where another one took the whole force, both could have it.
    rounding [m]: of gaps."""
    scale = max(float(np.abs(displacement).max(initial=0.0)), float(np.abs(gap).max(initial=0.0)))
    return active | (np.abs(gap) <= max(FAINT * scale, rounding))


def _entangled(rows: Sparse, size: Array) -> IntArray:
    """Rows that are left when all that move a freedom which no other row moves are taken away, again and again.

    Such a row takes part in no dependence. Slave nodes have freedoms of their own as a rule, so that nothing is left.
    """
    table = abs(sp.coo_array(rows))
    strong = table.data > FAINT * np.maximum(size[table.row], 1e-300)
    row, column = table.row[strong], table.col[strong]
    left = size > FAINT
    while True:
        here = left[row]
        counts = np.bincount(column[here], minlength=rows.shape[1])
        private = np.unique(row[here][counts[column[here]] == 1])
        if not len(private):
            return np.flatnonzero(left)
        left[private] = False
