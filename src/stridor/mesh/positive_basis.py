"""A basis of quadratic facets whose functions all have positive integrals, which contact pressure needs.

The corner functions of a six-node triangle integrate to nothing and those of an eight-node quadrilateral to −1/12 of
its area: no pressure at a corner balances the consistent force there, and a contact that takes nodes one by one opens
every corner under uniform pressure. With a share α of each middle function added to the corners of its edge,

    φ̃_corner = φ_corner + α Σ φ_middle,   φ̃_middle = (1 − 2α) φ_middle,

the same functions are spanned, sum to one and have positive integrals; the values that belong to them are ũ = u at
corners and ũ = (u_middle − α (u_a + u_b)) / (1 − 2α) at middles (A. Popp, B. I. Wohlmuth, M. W. Gee and W. A. Wall,
SIAM J. Sci. Comput. 34, 2012, B421–B446, who take α = 1/5). nine-node quadrilaterals and three-node lines are as they
should be.
"""

from __future__ import annotations

import numpy as np

from ..typing import Array, BoolArray

SHARE = 0.2
# Middle node of a facet → the corners of its edge, where corner functions have no positive integral.
MIDDLES: dict[str, dict[int, tuple[int, int]]] = {
    "triangle6": {3: (0, 1), 4: (1, 2), 5: (2, 0)},
    "quad8": {4: (0, 1), 5: (1, 2), 6: (2, 3), 7: (3, 0)},
}


def changed_basis(kind: str, taking: BoolArray) -> Array:
    """S (f, r, r) of φ̃ = S φ on facets of a kind, for the nodes (f, r) that take part.

    A corner that does not take part gets no share, as no row is left to belong to it. The identity for kinds that need
    no change.
    """
    count, r = taking.shape
    change = np.broadcast_to(np.eye(r), (count, r, r)).copy()
    for middle, corners in MIDDLES.get(kind, {}).items():
        for corner in corners:
            share = np.where(taking[:, corner], SHARE, 0.0)
            change[:, corner, middle] = share
            change[:, middle, middle] -= share
    return change
