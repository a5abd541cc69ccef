"""Room for records, and the histories of nodes that they become."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ...columns import ENERGY_RECORD
from ...node_history import NodeHistory
from ...schedule import Schedule
from ...settings import Settings
from .forcing import NODES_KEPT
from .machine import Machine, csr_arrays
from .recording import Record

NODE_HISTORY_BYTES = 500e6
CONTACT_COLUMNS = 5
SKEW_COLUMNS = {"circulatory": ENERGY_RECORD - 2, "gyroscopic": ENERGY_RECORD - 1}


def buffers(machine: Machine, schedule: Schedule, settings: Settings, *, each_node: bool = True) -> Record:
    """Room for all records from the present step on; each_node: for those of single nodes too."""
    every = settings.record_every
    count = max((schedule.steps - 1) // every - (machine.done - 1) // every, 0)
    system, nodes = machine.system, machine.nodes
    d, p = system.dimension, len(system.motion.names)
    per_record = nodes.count * (16 * (nodes.directions + 1) + 1)
    nodes_every = max(1, int(np.ceil(count * per_record / NODE_HISTORY_BYTES))) if nodes.count and each_node else 0
    kept = count // nodes_every + 1 if nodes_every else 0
    rows = [sp.csr_array(system.points[name].free[:d]) for name in settings.watch]
    lift = [np.asarray(system.points[name].lift)[:d].reshape(d, p) for name in settings.watch]
    watch = sp.vstack([sp.csr_array((0, system.size)), *rows])
    watch_ptr, watch_col, watch_val = csr_arrays(machine.layout.rows(watch))
    return Record(
        every=every,
        nodes_every=nodes_every,
        contacts=np.zeros((count, len(nodes.names), CONTACT_COLUMNS)),
        watch=np.zeros((count, watch.shape[0], 3)),
        energies=np.zeros((count, ENERGY_RECORD + (len(SKEW_COLUMNS) if len(machine.unsymmetric.force) else 0))),
        nodes=np.zeros((kept, nodes.count, 2 * (nodes.directions + 1))),
        node_status=np.zeros((kept, nodes.count), dtype=np.int8),
        watch_ptr=watch_ptr,
        watch_col=watch_col,
        watch_val=watch_val,
        watch_lift=np.vstack([np.zeros((0, p)), *lift]),
    )


def node_history(machine: Machine, record: Record, start: int, kept: int) -> NodeHistory | None:
    """Histories of the nodes, where there are any; start: number of the first record, kept: of them."""
    nodes = machine.nodes
    if not record.nodes_every:
        return None
    number = np.arange(start, start + kept)
    number = number[number % record.nodes_every == 0]
    values = record.nodes[: len(number)]
    t = nodes.directions
    assert len(number) == int(machine.state.counters[NODES_KEPT]), "every node record has its time"
    return NodeHistory(
        names=nodes.names,
        owner=nodes.owner,
        position=nodes.position,
        area=nodes.area,
        tangents=nodes.tangents,
        time=number * record.every * machine.scheme.step,
        normal_force=values[:, :, 0],
        tangential_force=values[:, :, 1 : 1 + t],
        slip_velocity=values[:, :, 1 + t : 1 + 2 * t],
        gap=values[:, :, 1 + 2 * t],
        status=record.node_status[: len(number)],
    )
