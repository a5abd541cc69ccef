"""The compiled step of the structure: product with the stiffness and update of u and q in one pass.

In upper storage row i takes from the columns from i on and gives to the rows after it. Once the rows up to i are done,
y_i is complete and u_i is not read again: both are brought to t_{n+1} at once, while they are in the cache. With two
threads the second one keeps back the rows that the first one reaches into; they are completed when both are done.
Each thread adds in an order that does not depend on the other, so runs repeat to the last digit.
"""

from __future__ import annotations

from typing import NamedTuple

from numba import get_num_threads, prange

from ....kernels import flush_denormals, njit
from ....typing import Array, IntArray
from ...arithmetic import FAST
from .lanes import rows2, rows3
from .storage import Blocks

DASHPOTS, WITH_STIFFNESS = 1, 2  # works wanted: of C_d alone, or of all that the structure resists with
CHUNK = 48  # block rows whose products and vectors stay in the first cache together

# A cached parallel function that another cached one calls is loaded without numba's threads, and jumps to nowhere;
# asking for their number starts them.
get_num_threads()



class Fields(NamedTuple):
    """Vectors on entries: u, q; shown = u + b∘q, which the stiffness sees (u itself where b = 0); push f: loads and
    supports; y (2, size): sums under way, zero between steps."""

    u: Array
    q: Array
    shown: Array
    push: Array
    y: Array


class Structure(NamedTuple):
    """The scheme on entries: K, what else of C is not proportional (empty: none), keep = 1 − Δt C_d/(M + β2ΔtC_d) of q,
    kick = Δt/(M + β2ΔtC_d), factor b, mass, damping C_d; parts for the threads; flags (4,): b used, second product
    used, works wanted (0, DASHPOTS, WITH_STIFFNESS), two threads; numbers (4,): Δt, β2, Δt(1/2 + β2), Δt(β2 − 1/2)."""

    stiffness: Blocks
    rest: Blocks
    keep: Array
    kick: Array
    factor: Array
    mass: Array
    damping: Array
    parts: IntArray
    flags: IntArray
    numbers: Array


@njit(cache=True, allocates=False, fastmath=FAST)
def _rows1(m: Blocks, x: Array, y: Array, lo: int, hi: int) -> None:  # pragma: no cover - compiled
    ptr, col, val = m.ptr, m.col, m.val
    for i in range(lo, hi):
        xi = x[i]
        total = val[ptr[i], 0] * xi
        for p in range(ptr[i] + 1, ptr[i + 1]):
            c = col[p]
            v = val[p, 0]
            total += v * x[c]
            y[c] += v * xi
        y[i] += total


@njit(cache=True, allocates=False)
def add_rows(m: Blocks, x: Array, y: Array, lo: int, hi: int) -> None:  # pragma: no cover - compiled
    """Add to y what the block rows lo … hi − 1 give in the product of a symmetric matrix with x."""
    width = m.val.shape[1]
    if width == 9:
        rows3(m.ptr, m.col, m.val, x, y, lo, hi)
    elif width == 4:
        rows2(m.ptr, m.col, m.val, x, y, lo, hi)
    else:
        _rows1(m, x, y, lo, hi)


@njit(cache=True, allocates=False, fastmath=FAST)
def _complete(a: Structure, f: Fields, y: Array, lo: int, hi: int) -> float:  # pragma: no cover - compiled
    """Places lo … hi − 1 to t_{n+1}; the power of works wanted, v·C_d v or v·(y + C_d v)."""
    beta2, forth, back = a.numbers[1], a.numbers[2], a.numbers[3]
    # Slices, so that indices are known not to be negative and the loops run in vector registers.
    u, q, y, push = f.u[lo:hi], f.q[lo:hi], y[lo:hi], f.push[lo:hi]
    keep, kick = a.keep[lo:hi], a.kick[lo:hi]
    power = 0.0
    if a.flags[2]:
        c = a.damping[lo:hi]
        inner = 1.0 if a.flags[2] == WITH_STIFFNESS else 0.0
        for i in range(hi - lo):
            v = q[i] + beta2 * (keep[i] * q[i] + kick[i] * (push[i] - y[i]) - q[i])
            power += v * (inner * y[i] + c[i] * v)
    for i in range(hi - lo):
        y[i] = keep[i] * q[i] + kick[i] * (push[i] - y[i])
    for i in range(hi - lo):
        u[i] += forth * y[i] - back * q[i]
        q[i] = y[i]
        y[i] = 0.0
    if a.flags[0]:
        shown, b = f.shown[lo:hi], a.factor[lo:hi]
        for i in range(hi - lo):
            shown[i] = u[i] + b[i] * q[i]
    return power


@njit(cache=True, allocates=False)
def _part(a: Structure, f: Fields, y: Array, lo: int, hi: int, free: int) -> float:  # pragma: no cover - compiled
    """Block rows lo … hi − 1, completed from the row ``free`` on."""
    width = f.u.shape[0] // (a.stiffness.ptr.shape[0] - 1)
    power = 0.0
    first = lo
    while first < hi:
        last = min(first + CHUNK, hi)
        if first < free < last:
            last = free
        add_rows(a.stiffness, f.shown, y, first, last)
        if a.flags[1]:
            add_rows(a.rest, f.q, y, first, last)
        if first >= free:
            power += _complete(a, f, y, first * width, last * width)
        first = last
    return power


@njit(cache=True, allocates=False, parallel=True)
def _two_parts(
    k_ptr: IntArray, k_col: IntArray, k_val: Array, c_ptr: IntArray, c_col: IntArray, c_val: Array, keep: Array,
    kick: Array, factor: Array, mass: Array, damping: Array, parts: IntArray, flags: IntArray, numbers: Array,
    u: Array, q: Array, shown: Array, push: Array, y: Array, power: Array,
) -> None:  # pragma: no cover - compiled
    """Both parts at once. Array by array, as threads do not take nested tuples."""
    blocks = k_ptr.shape[0] - 1
    for t in prange(2):
        flush_denormals()  # this thread may be one of numba's own
        a = Structure(
            Blocks(k_ptr, k_col, k_val), Blocks(c_ptr, c_col, c_val), keep, kick, factor, mass, damping, parts, flags,
            numbers,
        )  # fmt: skip
        f = Fields(u, q, shown, push, y)
        if t == 0:
            power[0] = _part(a, f, y[0], 0, parts[0], 0)
        else:
            power[8] = _part(a, f, y[1], parts[0], blocks, parts[1])


@njit(cache=True, allocates=False)
def advance(a: Structure, f: Fields, power: Array) -> float:  # pragma: no cover - compiled
    """One step without contact forces: u and q to t_{n+1}; the power wanted. power (16,) is work space."""
    blocks = a.stiffness.ptr.shape[0] - 1
    cut, reach = a.parts[0], a.parts[1]
    if cut == blocks:
        return _part(a, f, f.y[0], 0, blocks, 0)
    if a.flags[3]:
        _two_parts(
            a.stiffness.ptr, a.stiffness.col, a.stiffness.val, a.rest.ptr, a.rest.col, a.rest.val, a.keep, a.kick,
            a.factor, a.mass, a.damping, a.parts, a.flags, a.numbers, f.u, f.q, f.shown, f.push, f.y, power,
        )  # fmt: skip
    else:
        power[0] = _part(a, f, f.y[0], 0, cut, 0)
        power[8] = _part(a, f, f.y[1], cut, blocks, reach)
    width = f.u.shape[0] // blocks
    first, second = f.y[0], f.y[1]
    for i in range(cut * width, reach * width):
        second[i] += first[i]
        first[i] = 0.0
    return power[0] + power[8] + _complete(a, f, second, cut * width, reach * width)


@njit(cache=True, allocates=False, fastmath=FAST)
def stored_energies(a: Structure, f: Fields) -> tuple[float, float]:  # pragma: no cover - compiled
    """½ qᵀMq and ½ u_nᵀK u_{n−1} at t_{n−1/2} [J]; costs one product."""
    blocks = a.stiffness.ptr.shape[0] - 1
    y, u, q, mass = f.y[0], f.u, f.q, a.mass
    add_rows(a.stiffness, u, y, 0, blocks)
    kinetic = elastic = 0.0
    step = a.numbers[0]
    for i in range(u.shape[0]):
        kinetic += mass[i] * q[i] * q[i]
        elastic += y[i] * (u[i] - step * q[i])
        y[i] = 0.0
    return 0.5 * kinetic, 0.5 * elastic
