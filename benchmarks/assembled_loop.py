"""Time per step on assembled matrices: against the memory's speed, and against the loop one writes first with SciPy.

A block of regular hexahedra (one element matrix, lumped mass) is marched by central differences, free and then resting
with friction on a plane that moves. The plain loop is `K @ u` with SciPy's csr and three NumPy updates, no damping, no
energies, no contact. What streaming alone takes is measured by a compiled pass over the step's own arrays, with as
many threads, that adds the matrix's numbers up and updates the vectors. Also shown: products of the forms of storage
that were considered, with two threads where they can be shared out.
"""

from __future__ import annotations

import time
from itertools import product

import numpy as np
import scipy.sparse as sp
from numba import njit, prange

from _common import best, machine, options
from stridor.contact.nodes import ContactNodes
from stridor.laws import Coulomb
from stridor.system import System
from stridor.system.model import PrescribedMotion
from stridor.temporal.beta2 import scheme
from stridor.temporal.schedule import PhaseSpec, lay_out
from stridor.temporal.settings import Settings
from stridor.temporal.steppers.sparse.machine import Machine, assembled_machine
from stridor.temporal.steppers.sparse.products import add_rows, advance
from stridor.temporal.steppers.sparse.records import buffers
from stridor.temporal.steppers.sparse.storage import lay_out_freedoms, upper_blocks

YOUNG, POISSON, DENSITY, EDGE = 200e9, 0.3, 7800.0, 1e-3
BATCH = 4


def element_stiffness() -> np.ndarray:
    """K (24, 24) of a cube of trilinear shape functions, 2 × 2 × 2 points, nodes with x fastest."""
    corner = np.array([[i, j, k] for k, j, i in product((-1, 1), repeat=3)])
    lam, mu = YOUNG * POISSON / (1 + POISSON) / (1 - 2 * POISSON), YOUNG / 2 / (1 + POISSON)
    law = np.diag([2 * mu] * 3 + [mu] * 3)
    law[:3, :3] += lam
    stiffness = np.zeros((24, 24))
    for point in product((-1 / np.sqrt(3), 1 / np.sqrt(3)), repeat=3):
        factors = 1 + corner * np.array(point)
        slope = np.stack([corner[:, d] * np.prod(np.delete(factors, d, axis=1), axis=1) / 8 for d in range(3)], axis=1)
        slope *= 2 / EDGE
        strain = np.zeros((6, 24))
        for n, (x, y, z) in enumerate(slope):
            strain[:, 3 * n : 3 * n + 3] = [[x, 0, 0], [0, y, 0], [0, 0, z], [y, x, 0], [0, z, y], [z, 0, x]]
        stiffness += strain.T @ law @ strain * (EDGE / 2) ** 3
    return stiffness


def block(cells: int) -> tuple[System, np.ndarray]:
    """A free cube of cells³ elements, and the numbers of its nodes (cells + 1, …) as [z, y, x]."""
    count = cells + 1
    node = np.arange(count**3).reshape(count, count, count)
    corners = [node[k : k + cells, j : j + cells, i : i + cells].ravel() for k, j, i in product((0, 1), repeat=3)]
    freedom = (3 * np.stack(corners, axis=1)[:, :, None] + np.arange(3)).reshape(-1, 24)
    values = np.tile(element_stiffness().ravel(), len(freedom))
    place = (np.repeat(freedom, 24, axis=1).ravel(), np.tile(freedom, (1, 24)).ravel())
    stiffness = sp.coo_array((values, place)).tocsr()
    mass = np.bincount(np.stack(corners).ravel(), minlength=count**3) * DENSITY * EDGE**3 / 8
    size = 3 * count**3
    return System(sp.diags_array(np.repeat(mass, 3)), sp.csr_array((size, size)), stiffness, dimension=3), node


def resting(system: System, node: np.ndarray) -> System:
    """The block pressed on a plane that moves along x at 1 m/s: every node of its lowest layer is a slave."""
    feet = node[0].ravel()
    m, n = len(feet), system.size
    normal = sp.csr_array((np.ones(m), (np.arange(m), 3 * feet + 2)), shape=(m, n))
    columns = (3 * feet[:, None] + np.arange(2)).ravel()
    tangent = sp.csr_array((np.ones(2 * m), (np.arange(2 * m), columns)), shape=(2 * m, n))
    nodes = ContactNodes(
        names=("floor",), owner=np.zeros(m, dtype=np.int64), laws=(Coulomb(0.3),), normal=normal, tangent=tangent,
        normal_lift=np.zeros((m, 1)), tangent_lift=np.tile([[-1.0], [0.0]], (m, 1)), gap=np.zeros(m),
        area=np.full(m, EDGE**2), compliance=np.zeros(m), position=np.zeros((m, 3)),
        normals=np.tile([0.0, 0.0, 1.0], (m, 1)), tangents=np.tile(np.eye(3)[:2], (m, 1, 1)),
    )  # fmt: skip
    empty, own = np.zeros((n, 1)), np.zeros((1, 1))
    press = np.zeros(n)
    press[3 * node[-1].ravel() + 2] = -1.0

    class Resting(System):
        def contact_nodes(self) -> ContactNodes:
            return nodes

    return Resting(
        system.mass, system.damping, system.stiffness, (), {"press": press},
        PrescribedMotion(("floor",), empty, empty, empty, own, own, own), dimension=3,
    )  # fmt: skip


@njit(fastmath=True)
def add_up(values: np.ndarray) -> float:
    total = 0.0 * values[0]
    for i in range(values.size):
        total += values[i]
    return float(total)


@njit(fastmath=True)
def update(u: np.ndarray, q: np.ndarray, y: np.ndarray, push: np.ndarray, keep: np.ndarray, kick: np.ndarray) -> None:
    for i in range(u.size):
        q[i] = keep[i] * q[i] + kick[i] * (push[i] - y[i])
        u[i] += q[i]
        y[i] = 0.0


@njit(parallel=True)
def stream(
    val: np.ndarray, col: np.ndarray, u: np.ndarray, q: np.ndarray, y: np.ndarray, push: np.ndarray, keep: np.ndarray,
    kick: np.ndarray, threads: int, out: np.ndarray,
) -> None:
    """As little as can be done with what a step reads and writes: sums of the matrix, one update of the vectors."""
    for t in prange(threads):
        a, b = t * val.size // threads, (t + 1) * val.size // threads
        c, d = t * col.size // threads, (t + 1) * col.size // threads
        e, f = t * u.size // threads, (t + 1) * u.size // threads
        out[8 * t] = add_up(val[a:b]) + add_up(col[c:d])
        update(u[e:f], q[e:f], y[e:f], push[e:f], keep[e:f], kick[e:f])


@njit
def scalar_upper(ptr, col, val, x, y):
    for i in range(x.size):
        total = 0.0
        for p in range(ptr[i], ptr[i + 1]):
            total += val[p] * x[col[p]]
            y[col[p]] += val[p] * x[i]
        y[i] += total


@njit(parallel=True)
def scalar_rows(ptr, col, val, x, y):
    for t in prange(2):
        for i in range(t * x.size // 2, (t + 1) * x.size // 2):
            total = 0.0
            for p in range(ptr[i], ptr[i + 1]):
                total += val[p] * x[col[p]]
            y[i] = total


def plain_loop(system: System, dt: float, steps: int) -> float:
    """Seconds per step of central differences as first written."""
    stiffness, factor = system.stiffness, dt**2 / system.mass.diagonal()
    u, before = np.random.default_rng(0).standard_normal(system.size), np.zeros(system.size)
    started = time.perf_counter()
    for _ in range(steps):
        u, before = 2 * u - before - factor * (stiffness @ u), u
    return (time.perf_counter() - started) / steps


def step_bytes(ready: Machine) -> int:
    """What a step has to stream: the matrix once, and of the vectors push, keep, kick once, u, q, y to and fro."""
    stiffness = ready.structure.stiffness
    return sum(x.nbytes for x in stiffness) + 9 * 8 * ready.layout.size


def forms(system: System) -> None:
    """Products with the forms of storage considered."""
    x, y = np.random.default_rng(0).standard_normal(system.size), np.zeros(system.size)
    full, half = system.stiffness, sp.triu(system.stiffness, format="csr")
    arrays = [(m.indptr.astype(np.int64), m.indices, m.data) for m in (full, half)]
    layout = lay_out_freedoms(system)
    blocks = upper_blocks(full, layout)
    z = layout.spread(x)
    w = np.zeros_like(z)
    print(f"  product, full csr, SciPy         {best(lambda: full @ x)[0] * 1e3:7.3f} ms")
    print(f"  product, full csr, 2 threads     {best(lambda: scalar_rows(*arrays[0], x, y))[0] * 1e3:7.3f} ms")
    print(f"  product, upper csr               {best(lambda: scalar_upper(*arrays[1], x, y))[0] * 1e3:7.3f} ms")
    in_blocks = best(lambda: add_rows(blocks, z, w, 0, layout.blocks))[0]
    print(f"  product, upper {layout.width}×{layout.width} blocks        {in_blocks * 1e3:7.3f} ms")


def measure(cells: int, short: bool) -> None:
    system, node = block(cells)
    dt = 0.5 * EDGE / np.sqrt(YOUNG * (1 - POISSON) / (1 + POISSON) / (1 - 2 * POISSON) / DENSITY)
    ready = assembled_machine(system, scheme(dt, 0.5), system.contact_nodes())
    fields, power = ready.fields, np.zeros(16)
    fields.u[:] = 1e-9 * np.random.default_rng(0).standard_normal(ready.layout.size)
    # Shortest of many batches of a few steps: other work on the machine takes away whole milliseconds.
    repeats = 2 if short else 60

    def march() -> None:
        for _ in range(BATCH):
            advance(ready.structure, fields, power)

    threads = 2 if ready.threaded else 1
    streamed = step_bytes(ready)
    k, work = ready.structure, [v.copy() for v in (fields.u, fields.q, fields.y[0], fields.push)]
    flat, out = k.stiffness.val.ravel(), np.zeros(16)

    def pass_by() -> None:
        for _ in range(BATCH):
            stream(flat, k.stiffness.col, *work, k.keep, k.kick, threads, out)

    # In turns, as the memory's speed itself changes with what else uses it; both in their best and in the median turn.
    march(), pass_by()
    turns = np.array([[best(march, 1)[0], best(pass_by, 1)[0]] for _ in range(2 * repeats)]) / BATCH
    ours, least = turns.min(axis=0)
    part = np.median(turns[:, 1] / turns[:, 0])
    plain = min(plain_loop(system, dt, BATCH) for _ in range(repeats // 2))
    print(f"{system.size} freedoms, hex8, {threads} threads ({machine()})")
    forms(system)
    rate = system.size / ours / 1e6
    print(f"  step of the structure            {ours * 1e3:7.3f} ms, {rate:.0f} million DOF-steps/s")
    print(f"  streamed                         {streamed / 1e6:7.1f} MB, {streamed / ours / 1e9:.1f} GB/s")
    print(f"  streaming alone                  {least * 1e3:7.3f} ms, {least / ours:.2f} of the step; median of "
          f"{len(turns)} turns {part:.2f}")  # fmt: skip
    print(f"  plain SciPy loop                 {plain * 1e3:7.3f} ms, ratio {plain / ours:.1f}")
    each, touching = with_contact(resting(system, node), dt, repeats)
    print(f"  on a moving floor, all included  {each * 1e3:7.3f} ms, {touching} nodes touch, ratio {plain / each:.1f}")


def with_contact(system: System, dt: float, repeats: int) -> tuple[float, int]:
    """Seconds per step with contacts, works, statistics and a record every 50 steps; how many nodes touch."""
    ready = assembled_machine(system, scheme(dt, 0.5), system.contact_nodes())
    steps = 50 * (repeats + 1)
    schedule = lay_out([PhaseSpec("press", steps * dt, {}, {})], dt, ["press"], ["floor"])
    record = buffers(ready, schedule, Settings(step=dt, record_every=50))
    seconds = best(lambda: ready.run(50, schedule, record), repeats)[0] / 50
    return seconds, int((ready.contacts.status > 0).sum())


def main() -> None:
    args = options(__doc__ or "")
    for cells in (8,) if args.short else (26, 32, 46):
        measure(cells, args.short)


if __name__ == "__main__":
    main()
