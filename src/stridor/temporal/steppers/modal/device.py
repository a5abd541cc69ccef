"""Members of an ensemble on a GPU: what `MemberBatch` makes ready, kept and stepped there by `device_kernel`.

Imported only where there is a device.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from ....reading import memory
from ....system import System
from ....system.uncoupled import UncoupledModes
from ....typing import Array
from ...columns import CONTACT_RECORD
from ...legs import Acting
from .batch import MemberBatch
from .batch_kernel import BatchRecord
from .device_kernel import DeviceMembers, DeviceModel, cuda, places_of, run_members, shared_numbers
from .machine import Machine

LONGEST = 50_000  # steps of one launch, between which it is asked whether to go on
LAUNCH_BYTES = 2**28  # of records and of what acts, that one launch may take on the device
THREADS = 32  # of a block: those that the GPU steps together
HOST_BYTES = 2**31  # of records that are kept until the members of a block are finished, at least
HOST_SHARE = 0.25  # of this computer's memory, where that is more


def most_members(system: System, watched: int, records: float, free: float) -> int:
    """How many members go into one block, with ``free`` bytes on the device and so many records of a leg each."""
    contacts, points = len(system.contacts), 2 * watched
    recorded = 8 * records * (CONTACT_RECORD * contacts + 3 * points)
    states = 8 * (5 * system.size + 60 * (contacts + 2))
    host = max(HOST_BYTES, HOST_SHARE * memory())
    return max(1, int(min(host / max(recorded, 1.0), (0.8 * free - LAUNCH_BYTES) / states, 2**16)))


class DeviceBatch(MemberBatch):
    """Any number of members on a device: a thread block for each, and one launch for each call of `advance`.

    States stay on the device; of `states` only the counters and the statistics come back, of everything else records
    and which members are lost.
    """

    def __init__(self, machines: Sequence[Machine], modes: UncoupledModes, watch: Sequence[str]) -> None:
        super().__init__(machines, modes, watch)
        self._model: Any = DeviceModel(*_sent(*self._shared_by_all(machines[0])))
        self._members: Any = DeviceMembers(*_sent(*self._of_each(machines[0].scratch.shape.shape)))
        self._record: Any = _sent(self._watch_lift, np.zeros((self.members, 2, self.table.motions)))

    def _shared_by_all(self, machine: Machine) -> DeviceModel:
        """Operators as the kernel reads them."""
        contacts, rows, path, scheme = self.table.contacts, self.table.force_rows, machine.modal, self.scheme
        return DeviceModel(
            contacts=np.stack([contacts.kind, contacts.base, contacts.kept]),
            numbers=np.stack([contacts.gap, contacts.compliance]),
            compliance=self.compliance,
            lift=self._lift,
            heads=np.stack([path.forward * scheme.gain, -path.restore, path.forward * scheme.memory]),
            driven=_filled(self.modal.driven[:rows]),
            plain=_filled(self.modal.plain[:rows]),
            auxiliary=self.modal.auxiliary,
            watch=self.modal.watch,
            whole=np.zeros(0, dtype=np.int64),
            flat=np.zeros(0),
            table=np.zeros((0, 0)),
        )

    def _of_each(self, weights: tuple[int, ...]) -> DeviceMembers:
        """States as the kernel keeps them, member after member."""
        k, states = self.members, self.states
        ud, q = self.fields.ud[:, :k], self.fields.q[:, :k]
        fields = np.stack([ud[0::2].T, ud[1::2].T, q.T, np.zeros_like(q.T)], axis=1)
        predicted = self.fields.pull[:, :k].T
        coefficients = self.fields.coefficients[:, :k].T
        places = places_of(
            self.table.force_rows + 1, weights[0], self.table.motions, coefficients.shape[1], len(self.system.loads)
        )
        numbers = np.zeros((k, places.end))
        at = places.statistics
        self._numbers, self._statistics = numbers, numbers[:, at : at + states.statistics[0].size]
        for at, part in (
            (0, np.concatenate([predicted, states.value, states.rate], axis=1)),
            (places.motion, states.motion.reshape(k, -1)), (places.coefficients, coefficients),
        ):  # fmt: skip
            numbers[:, at : at + part.shape[1]] = part
        self._whole = np.concatenate([states.status, states.counters], axis=1)
        self._sizes = self._whole.shape[1], fields.shape[2]
        return DeviceMembers(self.friction, fields, numbers, self._whole, self.lost)

    def longest(self, every: int) -> int:
        """How many steps one launch takes: what fits into ``LAUNCH_BYTES``."""
        contacts, watched = len(self.system.contacts), self.modal.watch.shape[0]
        recorded = 8 * self.members * (CONTACT_RECORD * contacts + 3 * watched) / every
        acting = 8 * 4 * (len(self.system.loads) + self.table.motions)
        return max(1, min(LONGEST, int(LAUNCH_BYTES / (recorded + acting))))

    def advance(self, steps: int, acting: Acting, record: BatchRecord) -> None:
        """So many steps of all members by one launch."""
        model, members = self._model, self._members._replace(friction=_sent(self.friction)[0])
        kept, every = int(record.kept[0]), record.every
        count = -(-(self.done + steps) // every) - -(-self.done // every)
        self._statistics[:] = self.states.statistics.reshape(self.members, -1)
        members.numbers.copy_to_device(self._numbers)
        contacts = cuda.device_array((count, *record.contacts.shape[1:]))
        watched = cuda.device_array((count, *record.watch.shape[1:]))
        lift, before = self._record
        own = BatchRecord(every, contacts, watched, model.whole, model.table, before, lift)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", ".*Grid size")  # of few blocks: members are as many as they are
            size, inside = shared_numbers(THREADS, self._numbers.shape[1], *self._sizes)
            run_members[self.members, THREADS, 0, 8 * size](
                steps, self.done, 0, inside, self.scheme, model, members, Acting(*_sent(*acting)), own
            )
        for sent, ours in (
            (members.numbers, self._numbers), (members.whole, self._whole), (members.lost, self.lost),
            (contacts, record.contacts[kept : kept + count]), (watched, record.watch[kept : kept + count]),
        ):  # fmt: skip
            if ours.size:
                sent.copy_to_host(ours)
        self.states.statistics[:] = self._statistics.reshape(self.states.statistics.shape)
        self.states.counters[:] = self._whole[:, -self.states.counters.shape[1] :]
        record.kept[0] += count
        self.done += steps


def _sent(*arrays: Any) -> list[Any]:
    """The same arrays on the device."""
    return [cuda.to_device(np.ascontiguousarray(array)) for array in arrays]


def _filled(rows: Array) -> Array:
    """Rows filled up with zero to pairs, at least one."""
    return np.pad(rows, ((0, len(rows) % 2 if len(rows) else 2), (0, 0)))
