"""How high modes of a run can lie at all, whoever touches: what no mode reaches need not be resolved."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sl

from ..system import System
from ..typing import Array
from .beta2 import is_bare

MOST = 300  # freedoms up to which norms of full matrices cost next to nothing


def highest_hz(system: System) -> float:
    """A frequency [Hz] that |λ|/2π of no mode exceeds, with any of the contact nodes closed, slipping or sticking;
    infinite where none is known so cheaply.

    From λ²x + λĈx + K̂x = 0 with Ĉ, K̂ of M^-1/2: |λ|² ≤ |λ| ‖Ĉ‖ + ‖K̂‖. Of contact springs Σ (n + μ s·t) d nᵀ it is
    ‖Σ n d nᵀ‖^1/2 ‖Σ (n + μ s·t) d (n + μ s·t)ᵀ‖^1/2, which grows with every node that closes, and what holds a node
    without friction only takes motions away. Friction of rigid contact, or that changes with speed, has no such bound;
    what a mesh has is far above all that anybody looks at, and is not sought.
    """
    nodes = system.contact_nodes()
    most = np.array([max(law.sticking, law.sliding(0.0)) for law in nodes.laws])[nodes.owner]
    rigid, rubs = nodes.compliance == 0.0, most > 0.0
    unknown = (
        not is_bare(system) or system.size > MOST or bool(system.not_symmetric_definite)
        or system.cubic is not None or bool(system.contact_cubic) or bool(np.any(rigid & rubs))
        or any(contact.sliding == "finite" for contact in (*system.contacts, *system.surfaces))
        or not all(law.constant for law in nodes.laws) or (nodes.directions > 1 and bool(rubs.any()))
    )  # fmt: skip
    if unknown:
        return np.inf
    try:
        root = sl.cholesky(system.mass.toarray(), lower=True)
    except sl.LinAlgError:
        return np.inf
    normal, tangent, soft = nodes.normal.toarray(), nodes.tangent.toarray(), ~rigid
    springs = np.sqrt(1.0 / nodes.compliance[soft])[:, None]

    def scaled(rows: Array) -> Array:
        """Rows L⁻¹aᵀ of rows aᵀ (k, n)."""
        return np.asarray(sl.solve_triangular(root, rows.T, lower=True)).T

    def size(matrix: Array) -> float:
        return float(np.linalg.norm(matrix, 2)) if matrix.size else 0.0

    pressed = size(scaled(springs * normal[soft]))
    # Either sense of slip; tangential parts are bounded by themselves.
    pushed = pressed + size(scaled(springs * most[soft, None] * tangent[soft]))
    stiffness = size(scaled(scaled(system.stiffness.toarray()).T)) + pressed * pushed
    damping = size(scaled(scaled(system.damping.toarray()).T))
    return float(damping / 2 + np.sqrt(damping**2 / 4 + stiffness)) / (2 * np.pi)
