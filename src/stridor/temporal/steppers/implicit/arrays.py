"""What the compiled loop of the implicit stepper works on: r coordinates, m nodes of d directions, p motions, l
loads."""

from __future__ import annotations

from typing import NamedTuple

from ....typing import Array, IntArray

DONE, MOST_SWEEPS, UNCONVERGED, KEPT, NODES_KEPT, BY_NEWTON = range(6)
COUNTERS = 6


class Structure(NamedTuple):
    """mass, damping, stiffness, inverse (r,) of M̃, C̃, K and M̂ = M̃ + hC̃/2 + h²K/4; where damping couples coordinates,
    coupled and solved (r, r) are C̃ and M̂⁻¹ and damping is not looked at. loads (l, r), inertia and drag (p, r): forces
    of loads at factor one and of supports' acceleration and velocity; load_lift (l, p); own parts (p, p) of the
    supports."""

    step: float
    mass: Array
    damping: Array
    stiffness: Array
    inverse: Array
    coupled: Array
    solved: Array
    loads: Array
    inertia: Array
    drag: Array
    load_lift: Array
    mass_own: Array
    damping_own: Array
    stiffness_own: Array


class Nodes(NamedTuple):
    """row (m d, r): normal, then tangents of each node; answer (m d, r): of M̂ to an impulse along them; delassus
    (m d, m d) [1/kg] = row M̂⁻¹ rowᵀ; lift (m d, p), gap (m,) [m]; stiffness (m,) [N/m], 0 where contact is rigid. owner
    (m,), friction (c, k) numbers of the laws, along (m, d − 1) and weight (m,) as in `sparse.node_table`; kept (m,) 1
    where a node is kept closed."""

    row: Array
    answer: Array
    delassus: Array
    lift: Array
    gap: Array
    stiffness: Array
    owner: IntArray
    friction: Array
    along: Array
    weight: Array
    kept: IntArray


class StepState(NamedTuple):
    """What moves on. q, v (r,): displacement and velocity; before (r,): v a step before. place (m,) [m], speed (m d,)
    [m/s]: gap and velocities of the nodes by the structure; impulse, earlier (m d,) [N s]: of the last step and the one
    before it; status (m,). works (5,) [J], statistics (c, 8), counters (6,), motion (2, p): way and rate of the
    supports; rate_before (p,): the rate a step before."""

    q: Array
    v: Array
    before: Array
    place: Array
    speed: Array
    impulse: Array
    earlier: Array
    status: IntArray
    works: Array
    statistics: Array
    counters: IntArray
    motion: Array
    rate_before: Array


class Work(NamedTuple):
    """Work space of a step: change (r,) of v without contact, force (r,); free (m d,): what the law of each node sees
    without impulses (`node_law`); total (m d,): with them; slip (m d,): velocity at the start of the step; start (m,)
    [m]: gap then; apart (m d,): what free has beside the velocity of the structure behind the step; impulse (m d,);
    status (m,); sums (c, 6); local (5, d) of one node; rate (p,). Of the nodes that are swept: chosen (m,), marked
    (m,). Of those that have a place in packed (m d, m d), the part of the Delassus operator that is theirs: near (m d,)
    totals, place_of (m,) the place of a node, −1 without one, holder (m,) whose a place is, used (1,) how many."""

    change: Array
    force: Array
    free: Array
    total: Array
    slip: Array
    start: Array
    apart: Array
    impulse: Array
    status: IntArray
    sums: Array
    local: Array
    rate: Array
    chosen: IntArray
    marked: IntArray
    near: Array
    packed: Array
    place_of: IntArray
    holder: IntArray
    used: IntArray


class Record(NamedTuple):
    """Decimated output as in `sparse.recording.Record`; watch_row (w, r) dense, watch_lift (w, p)."""

    every: int
    nodes_every: int
    contacts: Array
    watch: Array
    energies: Array
    nodes: Array
    node_status: IntArray
    watch_row: Array
    watch_lift: Array
