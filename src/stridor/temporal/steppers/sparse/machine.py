"""A system of assembled matrices made ready to march: arrays of the compiled loop, and the state that it moves on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ....contact.nodes import ContactNodes
from ....contact.surfaces import SurfaceContact
from ....errors import AnalysisError, CaseError
from ....kernels import denormals_flushed
from ....system import System
from ....typing import Array, IntArray, Sparse
from ...aligned import aligned_zeros
from ...beta2 import Scheme
from ...columns import FIRST_OPEN, FIRST_STICK, STATISTICS
from ...inputs import DIAGONAL
from ...schedule import Schedule
from ..curve import ROWS, follow, foot
from .bends import Turning
from .damping import SplitDamping, no_damping, split_damping
from .forcing import COUNTERS, CUBIC, LOOP_WORKS, SKEW_WORKS, STEPS_DONE, Forcing, LoopState, StepWork
from .loop import run_steps
from .node_stage import NodeScratch, NodeState
from .node_table import Answers, NodeTable, node_table
from .products import DASHPOTS, WITH_STIFFNESS, Fields, Structure, stored_energies
from .recording import Record
from .step_matrix import StepMatrix, is_diagonal, no_step_matrix, step_matrix
from .storage import Layout, lay_out_freedoms, parts, upper_blocks
from .unsymmetric import Unsymmetric, halves, unsymmetric

FEW_WIDTH = 2  # of blocks in a model that stays in the first cache: whole registers, and none of them padded
OFFSET_STEPS = 100  # in which the gap that a renewal of the rows made fades


@dataclass
class Machine:
    """Arrays and state. surfaces follow the sliding; nodes are the contacts as they are paired now, turning how their
    normals turn from there; answers gives what unit forces along rows move over one step."""

    system: System
    scheme: Scheme
    layout: Layout
    structure: Structure
    fields: Fields
    unsymmetric: Unsymmetric
    whole: StepMatrix
    answers: Answers
    constant: Forcing  # without loads and increments by step
    state: LoopState
    nodes: ContactNodes
    surfaces: tuple[SurfaceContact, ...]
    table: NodeTable
    contacts: NodeState
    scratch: NodeScratch
    turning: Turning

    @property
    def done(self) -> int:
        """Steps done."""
        return int(self.state.counters[STEPS_DONE])

    @property
    def displacement(self) -> Array:
        """u (n,) [m] of the freedoms."""
        return self.fields.u[self.layout.index]

    @property
    def threaded(self) -> bool:
        """Whether the structure is large enough for two threads."""
        return int(self.structure.parts[0]) < self.layout.blocks

    def use_threads(self, *, two: bool) -> None:
        """Run the two parts of the structure at once or one after the other, which changes no number."""
        self.structure.flags[3] = two

    def set_nodes(self, nodes: ContactNodes, turning: Turning | None = None) -> None:
        """Take contact nodes as they are paired now, and how their normals turn as they slide; forces, status and
        offsets are kept."""
        self.nodes, self.turning = nodes, Turning.none(nodes) if turning is None else turning
        self.table = packed_nodes(
            self.system, nodes, self.layout, (self.whole, self.answers), self.contacts.segment, self.turning
        )
        self.scratch = _scratch(self.table)
        self.contacts = self.contacts._replace(q=self.fields.q[self.table.indices])

    def follow_curves(self) -> None:
        """Take the rows of the segments that points which slide finitely have come to."""
        segment, xi = self.contacts.segment, self.contacts.xi
        for i, contact in enumerate(self.system.contacts):
            if contact.sliding == "finite":
                segment[i], xi[i] = follow(int(segment[i]), float(xi[i]), contact.chords)
        self.set_nodes(self.nodes, self.turning)

    def show(self) -> None:
        """Bring what the stiffness and the damping see up to u and q."""
        if len(self.whole.drag):
            self.whole.drag[self.layout.index] = self.system.damping @ self.fields.q[self.layout.index]
        if self.structure.flags[0]:
            self.fields.shown[:] = self.fields.u + self.structure.factor * self.fields.q
        self.contacts.q[:] = self.fields.q[self.table.indices]

    def mark_start(self) -> None:
        """Take the energies stored at the start as those that works are counted from."""
        self.state.reference[0] = stored_energies(self.structure, self.fields)[1]
        cubic = self.system.cubic
        if cubic is not None:
            length = cubic.rows.free @ self.displacement + cubic.rows.lift @ self.state.motion[0]
            self.state.works[CUBIC] = 0.25 * float(np.sum(cubic.coefficient * length**4))

    def run(self, steps: int, schedule: Schedule, record: Record) -> tuple[int, int]:
        """March up to ``steps`` steps; what was done and why it ended (codes of the loop)."""
        forcing = self.constant._replace(
            loads=schedule.load_factors(self.done, steps), increments=schedule.motion_increments(self.done, steps)
        )
        work = _step_work(forcing, self.table, self.state, record)
        structure, fields, table, nodes = self.structure, self.fields, self.table, self.contacts
        with denormals_flushed():
            return run_steps(
                steps, structure, fields, self.unsymmetric, self.whole, forcing, table, nodes, self.scratch, self.state,
                work, record,
            )  # fmt: skip


def assembled_machine(system: System, scheme: Scheme, nodes: ContactNodes, *, lagged: bool = True) -> Machine:
    """Pack a system with the given contact nodes. lagged: damping that is not diagonal acts on the older velocity; else
    steps solve with it and with the mass, which need not be diagonal either. Raises CaseError for a mass that must be
    diagonal and is not, AnalysisError for a freedom without mass or a friction law without a compiled form."""
    whole = not (lagged or (is_diagonal(system.mass, DIAGONAL) and is_diagonal(system.damping)))
    layout = lay_out_freedoms(system, width=0 if lagged else FEW_WIDTH)
    skew = unsymmetric(halves(system), layout)
    if whole:
        matrix, answers = step_matrix(system, scheme, layout)
        structure = _structure(system, scheme, layout, system.mass.diagonal(), no_damping(system.size))
    else:
        structure = _structure(system, scheme, layout, diagonal_mass(system), split_damping(system))
        matrix, answers = no_step_matrix(layout, structure.numbers[2] * structure.kick)
    u = aligned_zeros((layout.size,))
    fields = Fields(
        u=u,
        q=aligned_zeros((layout.size,)),
        shown=aligned_zeros((layout.size,)) if structure.flags[0] else u,
        push=aligned_zeros((layout.size,)),
        y=aligned_zeros((2, layout.size)),
    )
    motions, loads = len(system.motion.names), len(system.loads)
    statistics = np.zeros((len(nodes.names), STATISTICS))
    statistics[:, [FIRST_STICK, FIRST_OPEN]] = -1.0
    state = LoopState(
        works=np.zeros(SKEW_WORKS if len(skew.force) else LOOP_WORKS),
        statistics=statistics,
        counters=np.zeros(COUNTERS, dtype=np.int64),
        motion=np.zeros((2, motions)),
        coefficients=np.zeros(loads + 2 * motions),
        base=aligned_zeros((layout.size,)),
        reference=np.array([0.0, 1.0 - 1.0 / OFFSET_STEPS]),
    )
    segments = np.array([c.segment for c in system.contacts] + [0] * (nodes.count - len(system.contacts)))
    table = packed_nodes(system, nodes, layout, (matrix, answers), segments)
    contacts = NodeState(
        force=np.zeros((nodes.count, nodes.directions + 1)),
        status=np.zeros(nodes.count, dtype=np.int64),
        offset=np.zeros(nodes.count),
        q=np.zeros(len(table.indices)),
        segment=segments.astype(np.int64),
        xi=np.array([c.xi for c in system.contacts] + [0.0] * (nodes.count - len(system.contacts))),
    )
    forcing = _forcing(system, layout)
    return Machine(
        system, scheme, layout, structure, fields, skew, matrix, answers, forcing, state, nodes, system.surfaces,
        table, contacts, _scratch(table), Turning.none(nodes),
    )  # fmt: skip


def packed_nodes(
    system: System, nodes: ContactNodes, layout: Layout, matrix: tuple[StepMatrix, Answers], segments: IntArray,
    turning: Turning | None = None,
) -> NodeTable:  # fmt: skip
    """Contact nodes on the entries of a layout; segments (m,) that points which slide finitely are in."""
    return node_table(
        nodes, layout, matrix[1], system.motion.full, whole=len(matrix[0].before) > 0, contacts=system.contacts,
        segments=segments, turning=turning,
    )  # fmt: skip


def diagonal_mass(system: System) -> Array:
    """The diagonal (n,) [kg] of a lumped mass. Raises CaseError where it is not lumped, AnalysisError where one is
    zero."""
    mass = system.mass.diagonal()
    if not is_diagonal(system.mass, DIAGONAL):
        raise CaseError(
            "bodies",
            None,
            "the temporal approach on assembled matrices needs a diagonal mass in every body; "
            'write mass = "lumped" for beams and solids, and import lumped mass matrices',
        )
    if not np.all(mass > 0.0):
        raise AnalysisError("the mass matrix is not positive definite: a freedom has stiffness but no mass")
    return mass


def _structure(system: System, scheme: Scheme, layout: Layout, mass: Array, damping: SplitDamping) -> Structure:
    step, beta2 = scheme.step, scheme.beta2
    effective = mass + beta2 * step * damping.diagonal
    stiffness = upper_blocks(halves(system).stiffness, layout)
    folded = damping.lagged and damping.factor is not None
    second = damping.lagged and not folded
    rest = upper_blocks(damping.rest if second else sp.csr_array(damping.rest.shape), layout)
    wanted = WITH_STIFFNESS if damping.lagged else DASHPOTS if np.any(damping.diagonal) else 0
    return Structure(
        stiffness=stiffness,
        rest=rest,
        keep=layout.spread(1.0 - step * damping.diagonal / effective),
        kick=layout.spread(step / effective),
        factor=layout.spread(damping.factor) if folded and damping.factor is not None else np.zeros(0),
        mass=layout.spread(mass),
        damping=layout.spread(damping.diagonal),
        parts=parts([stiffness, rest] if second else [stiffness], layout.size),
        flags=np.array([folded, second, wanted, True], dtype=np.int64),
        numbers=np.array([step, beta2, step * (0.5 + beta2), step * (beta2 - 0.5)]),
    )


def csr_arrays(matrix: Sparse) -> tuple[IntArray, IntArray, Array]:
    """Pointers, columns and values of csr rows, as compiled code takes them."""
    rows = sp.csr_array(matrix)
    return rows.indptr.astype(np.int64), rows.indices.astype(np.int64), rows.data.astype(float)


def _forcing(system: System, layout: Layout) -> Forcing:
    motion, p = system.motion, len(system.motion.names)
    vectors = np.array(list(system.loads.values())).reshape(-1, system.size)
    damping = np.array(motion.damping, dtype=float)
    # A rigid motion is not resisted by damping within a body: what is left of that is rounding.
    scale = float(np.abs(system.damping).max() or 0.0) * float(np.abs(motion.lift).max(initial=0.0))
    damping[np.abs(damping) <= 1e-13 * scale] = 0.0
    # Few freedoms next to a support: a whole vector at each step would cost as much as the structure.
    near = np.flatnonzero(np.any(motion.mass != 0.0, axis=1) | np.any(damping != 0.0, axis=1))
    cubic = system.cubic
    rows = sp.csr_array((0, system.size)) if cubic is None else cubic.rows.free
    load_ptr, load_col, load_val = csr_arrays(layout.rows(sp.csr_array(vectors)))
    cubic_ptr, cubic_col, cubic_val = csr_arrays(layout.rows(rows))
    return Forcing(
        loads=np.zeros((0, len(vectors))),
        increments=np.zeros((0, p)),
        load_ptr=load_ptr,
        load_col=load_col,
        load_val=load_val,
        load_lift=vectors @ motion.lift,
        near=layout.index[near],
        mass=np.ascontiguousarray(motion.mass[near].T, dtype=float),
        damping=np.ascontiguousarray(damping[near].T),
        mass_own=np.ascontiguousarray(motion.mass_own, dtype=float),
        damping_own=np.ascontiguousarray(motion.damping_own, dtype=float),
        stiffness_own=np.ascontiguousarray(motion.stiffness_own, dtype=float),
        cubic_ptr=cubic_ptr,
        cubic_col=cubic_col,
        cubic_val=cubic_val,
        cubic_lift=np.zeros((0, p)) if cubic is None else np.ascontiguousarray(cubic.rows.lift, dtype=float),
        cubic=np.zeros(0) if cubic is None else np.array(cubic.coefficient, dtype=float),
    )


def _scratch(table: NodeTable) -> NodeScratch:
    count, nodes, t = len(table.indices), len(table.gap), table.along.shape[1]
    w = table.bends.row.shape[1]
    return NodeScratch(
        u=np.zeros(count),
        q=np.zeros(count),
        correction=np.zeros(count),
        gap=np.zeros(nodes),
        earlier=np.zeros(nodes),
        slip=np.zeros((nodes, t)),
        chosen=np.zeros(nodes, dtype=np.int64),
        marked=np.zeros(nodes, dtype=np.int64),
        speed=np.zeros((nodes, t)),
        force=np.zeros((2, t + 1)),
        foot=foot(),
        normal=np.zeros(ROWS),
        tangent=np.zeros(ROWS),
        angle=np.zeros(t),
        way=np.zeros(t),
        turn=np.zeros((t + 1, w)),
        away=np.zeros(w),
    )


def _step_work(forcing: Forcing, table: NodeTable, state: LoopState, record: Record) -> StepWork:
    p, springs = forcing.increments.shape[1], len(forcing.cubic)
    return StepWork(
        after=np.zeros(p),
        displacement=np.zeros(p),
        velocity=np.zeros(p),
        sent=np.zeros(p),
        coupling=np.zeros((2, p)),
        spring=np.zeros(springs),
        spring_rate=np.zeros(springs),
        load_rate=np.zeros(forcing.loads.shape[1]),
        sums=np.zeros((len(state.statistics), 6)),
        status=np.zeros(len(table.gap), dtype=np.int64),
        watched=np.zeros((len(record.watch_lift), 2)),
        power=np.zeros(16),
    )
