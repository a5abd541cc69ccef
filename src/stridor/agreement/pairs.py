"""Two modes that have become one: how a motion starts that shows both.

Where two modes meet in one root that is exactly double their vectors meet too, and what else moves at that root is
(w + t v) e^{λt}, with P(λ) v = 0 and P(λ) w = −P'(λ) v. In the minimal model of mode coupling whose two diagonal
stiffnesses are equal v moves along the normal alone: no contact slips in it, and a march that started with v would
show nothing. It slips in w.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..contact.nodes import ContactNodes
from ..direct import factorise
from ..modal.derivatives import hold, pencil_of
from ..modal.options import Options
from ..system import System
from ..typing import Array, ComplexArray

TOGETHER = 1e-4  # of |λ|: modes that no signal in time tells apart
NEARLY = 1e-2  # of a vector, the root of that: how far vectors are apart beside a root that is double


def silent_pairs(nodes: ContactNodes, lam: ComplexArray, vectors: ComplexArray) -> list[tuple[int, int]]:
    """Of modes (k,) with unit vectors (k, n) pairs that are one to the digits of a signal, roots and vectors, and in
    which contacts hardly slip beside what else moves; a mode is in one of them at most."""
    found: list[tuple[int, int]] = []
    taken: set[int] = set()
    for one, value in enumerate(lam):
        for other in range(one + 1, len(lam)):
            if {one, other} & taken or abs(lam[other] - value) > TOGETHER * abs(value):
                continue
            mine, its = vectors[one], vectors[other]
            apart = np.linalg.norm(its - mine * np.vdot(mine, its) / np.vdot(mine, mine).real)
            if apart <= NEARLY * np.linalg.norm(its) and slip_of(nodes, mine).max() <= NEARLY * np.abs(mine).max():
                found.append((one, other))
                taken |= {one, other}
    return found


def slip_of(nodes: ContactNodes, vector: ComplexArray) -> Array:
    """How far each contact node (m,) slips at most in a motion (n,)."""
    return np.linalg.norm(np.abs(nodes.tangent @ vector).reshape(nodes.count, -1), axis=1)


def second_of(system: System, mu: float, lam: complex, vector: ComplexArray, options: Options) -> ComplexArray:
    """w (n,) of P(λ) w = −P'(λ) v for a double root λ with vector v (n,), orthogonal to v. Raises what steady sliding
    raises."""
    mass, damping, stiffness = pencil_of(system, mu, hold(system, mu, options), options).whole.matrices()
    size, motions = mass.shape[0], len(vector)
    # P is singular at its root: a border takes v out of w, and what the right side has of what P does not reach, which
    # at a double root is nothing. Of what P does not reach any column holds a part.
    v = np.zeros(size, dtype=complex)
    v[:motions] = vector
    column = np.random.default_rng(0).standard_normal(size) * float(np.abs(stiffness.data).max(initial=0.0))
    whole = sp.block_array(
        [[lam**2 * mass + lam * damping + stiffness, column[:, None]], [v.conj()[None, :], np.zeros((1, 1))]],
        format="csr",
    )
    right = np.append(-(2 * lam * (mass @ v) + damping @ v), 0.0)
    with factorise(sp.csr_array(whole), saddle=True, solver=options.solver) as factor:
        return np.asarray(factor.solve(right))[:motions]
