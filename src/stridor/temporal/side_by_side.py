"""Members that march side by side: one block of them from its start to its end, on one core or one device."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..errors import StridorError
from ..system import System
from ..typing import Array
from .legs import Legs, Member, leg_phases
from .phase_results import PhaseResults, fresh_statistics
from .schedule import lay_out
from .settings import Settings, not_finite
from .steppers.modal import ModalStepper
from .steppers.modal.batch import MemberBatch, friction_of, member_machine
from .steppers.modal.batch_kernel import BatchRecord
from .steppers.modal.machine import Machine, modal_machine
from .trajectory import Trajectory

# Called with the number of a track, of a member in it, and its run or why there is none.
Seen = Callable[[int, int, Trajectory | str], None]
Track = Sequence[Member]


@dataclass(frozen=True)
class Block:
    """Tracks by their numbers that are marched together; all of one system, whose operators are those of stepper.

    batch: what steps them."""

    stepper: ModalStepper
    settings: Settings
    legs: Legs
    tracks: Sequence[Track]
    numbers: Sequence[int]
    seen: Seen
    batch: type[MemberBatch] = MemberBatch

    @property
    def system(self) -> System:
        """The system without the members' friction."""
        return self.stepper.system

    def cut(self, at: Sequence[int]) -> list[Block]:
        """The same in parts that end at these of its tracks; at begins with 0."""
        return [replace(self, tracks=self.tracks[a:b], numbers=self.numbers[a:b]) for a, b in pairwise(at)]

    def run(self, asked: Callable[[], bool], count: Callable[[int], None]) -> None:
        """To the end, or to where an end is asked for; count is told the steps of all members done. Members that cannot
        begin are seen at once, with why."""
        machines: list[Machine] = []
        present: list[int] = []
        for k, track in enumerate(self.tracks):
            try:
                machines.append(self._begun(track[0]))
                present.append(k)
            except StridorError as error:
                self._failed(k, 0, str(error))
                count(self.legs.steps)
        if machines:
            self._march(self.batch(machines, self.stepper.modes, self.settings.watch), present, asked, count)

    def warm(self) -> None:
        """Compile the loop, or load it."""
        member = self.tracks[0][0]
        machine = modal_machine(self.system, self.stepper.scheme, self.stepper.modes)
        machine.repack()
        batch = self.batch([machine], self.stepper.modes, self.settings.watch)
        acting = self.legs.forcing(0, 1, [[member]], self.system.motion.full_distance)
        batch.advance(0, acting, batch.room(0, self.settings.record_every))

    def _begun(self, member: Member) -> Machine:
        stepper, system = self.stepper, self.system
        phases, motion = leg_phases(self.legs, 0, member, system), system.motion
        schedule = lay_out(phases, stepper.scheme.step, list(system.loads), list(motion.names), motion.full_distance)
        settings = member.settings(self.settings)
        if settings.initial == "steady-sliding":
            schedule = schedule.from_steady()
        return member_machine(member.system(system), stepper.scheme, stepper.modes, schedule, settings)

    def _march(
        self, batch: MemberBatch, present: Sequence[int], asked: Callable[[], bool], count: Callable[[int], None]
    ) -> None:
        """Leg by leg; what is finished is seen at the end of each."""
        tracks = [self.tracks[k] for k in present]
        told: set[int] = set()
        for leg, schedule in enumerate(self.legs.schedules):
            if leg:
                batch.friction = friction_of([track[leg].system(self.system) for track in tracks])
            first, every = batch.done, self.settings.record_every
            records = -(-schedule.steps // every) - -(-first // every)
            record = batch.room(records, every)
            results = [self._results(batch, lane, leg) for lane in range(len(tracks))]
            while batch.done < schedule.steps:
                if asked():
                    return
                for one in results:
                    one.begin(batch.done)
                size = min(batch.longest(every), schedule.stretch_at(batch.done).last - batch.done)
                acting = self.legs.forcing(batch.done, size + 1, tracks, self.system.motion.full_distance)
                batch.advance(size, acting, record)
                count(size * len(tracks))
            for lane, k in enumerate(present):
                if lane in told:
                    continue
                if batch.lost[lane] >= 0:
                    told.add(lane)
                    self._failed(k, leg, self._lost(int(batch.lost[lane]), leg))
                    continue
                run = self._trajectory(batch, record, lane, leg, results[lane])
                self.seen(self.numbers[k], leg, run)

    def _results(self, batch: MemberBatch, lane: int, leg: int) -> PhaseResults:
        """Statistics of one member, cleared where a leg begins."""
        statistics: Array = batch.states.statistics[lane]
        statistics[:] = fresh_statistics(*statistics.shape)
        stepper = self.stepper
        return PhaseResults(self.legs.schedules[leg], stepper.contact_names, statistics, stepper.closed)

    def _failed(self, track: int, leg: int, why: str) -> None:
        """See a member that has failed, and all that would have followed it."""
        self.seen(self.numbers[track], leg, why)
        for later in range(leg + 1, len(self.legs.schedules)):
            self.seen(self.numbers[track], later, f"not reached: {why}")

    def _lost(self, step: int, leg: int) -> str:
        dt = self.stepper.scheme.step
        return not_finite(step * dt, self.legs.schedules[leg].stretch_at(step).name, dt)

    def _trajectory(
        self, batch: MemberBatch, record: BatchRecord, lane: int, leg: int, results: PhaseResults
    ) -> Trajectory:
        """The run of one member through one leg, without energies and without a state to go on from."""
        stepper, settings, scheme = self.stepper, self.settings, self.stepper.scheme
        kept, every = int(record.kept[0]), settings.record_every
        start = -(-self.legs.first(leg) // every)
        contacts, watched = record.contacts[:kept, lane], record.watch[:kept, lane]
        watched = watched.reshape(kept, len(settings.watch), self.system.dimension, 3)
        counters, unknown = batch.states.counters[lane], np.full(kept, np.nan)
        return Trajectory(
            time=(start + np.arange(kept)) * every * scheme.step,
            contact_names=stepper.contact_names,
            normal_force=contacts[:, :, 0].copy(),
            tangential_force=contacts[:, :, 1].copy(),
            slip_speed=contacts[:, :, 2].copy(),
            gap=contacts[:, :, 3].copy(),
            status=contacts[:, :, 4].astype(np.int8),  # as files have it
            watch_names=settings.watch,
            displacement=watched[..., 0].copy(),
            velocity=watched[..., 1].copy(),
            acceleration=watched[..., 2].copy(),
            kinetic=unknown,
            elastic=unknown,
            works={},
            phases=results.all(batch.done),
            step=scheme.step,
            beta2=scheme.beta2,
            record_every=every,
            steps=batch.done,
            planned_steps=self.legs.schedules[leg].steps,
            path=stepper.path,
            path_reason=stepper.reason,
            step_limit=stepper.limit.step,
            limiting_body=stepper.limit.body,
            most_sweeps=int(counters[1]),
            unconverged_steps=int(counters[2]),
            interrupted=False,
            wall_seconds=0.0,
        )
