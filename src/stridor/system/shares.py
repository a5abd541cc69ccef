"""The matrices of a system taken apart: what imported matrices with factors make of them, and all the rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from ..case import Case
from ..fe.assembly import beside
from ..typing import Sparse
from .bodies import BuiltBody, build_bodies
from .imported import ROLES, ImportedTerm, load_shares
from .links import links_of
from .supports import Tied, constraints_of, tie_matrix


def system_shares(case: Case, mu: float | None = None) -> tuple[ImportedTerm, ...]:
    """Matrices (n, n) on the freedoms of `build_system` that with their factors add up to its mass, damping and
    stiffness: one for each term of imported bodies, then one of each role for everything else, with factor one.

    mu: that in the factors, as `build_system` takes it. Raises CaseError as `build_system` and `load_shares`.
    """
    bodies = build_bodies(case, mu)
    total = sum(body.size for body in bodies.values())
    links = links_of(case, bodies, total)
    constraints = constraints_of(case, bodies)
    held = {f for c in constraints for f in c.freedoms}
    tied = tie_matrix(case, bodies, total, constraints)
    followers = np.zeros(0, dtype=np.int64) if tied is None else tied.followers
    free = np.setdiff1d(np.arange(total), np.concatenate([np.array(sorted(held), dtype=np.int64), followers]))
    shares: list[ImportedTerm] = []
    for name, body in case.imported.items():
        mine = load_shares(case, name, body, mu)
        shares += [replace(share, matrix=_placed(share.matrix, bodies[name], total)) for share in mine]
    others = [_emptied(b) if b.name in case.imported else b for b in bodies.values()]
    for role in ROLES:
        rest = beside([getattr(b, role) for b in others])
        if links.rows.shape[0] and role != "mass":
            factor = links.damping if role == "damping" else links.stiffness
            rest = sp.csr_array(rest + links.rows.T @ sp.diags_array(factor) @ links.rows)
        shares.append(ImportedTerm(role, rest, 1.0))
    if tied is not None:
        masses = [b.mass for b in bodies.values()]
        lumped = all(np.all(sp.coo_array(m).row == sp.coo_array(m).col) for m in masses)
        shares = [replace(s, matrix=_tied(s, tied, lumped=lumped)) for s in shares]
    return tuple(replace(s, matrix=sp.csr_array(s.matrix[free][:, free])) for s in shares)


def _placed(matrix: Sparse, body: BuiltBody, total: int) -> Sparse:
    coo = sp.coo_array(matrix)
    return sp.csr_array((coo.data, (coo.row + body.offset, coo.col + body.offset)), shape=(total, total))


def _emptied(body: BuiltBody) -> BuiltBody:
    nothing = sp.csr_array((body.size, body.size))
    return replace(body, mass=nothing, damping=nothing, stiffness=nothing)


def _tied(share: ImportedTerm, tied: Tied, *, lumped: bool) -> Sparse:
    """TᵀAT, as a diagonal mass of all bodies together has it where that is diagonal."""
    if share.role == "mass" and lumped:
        return tied.mass(share.matrix)
    return tied.within(share.matrix)
