"""Who looks on while a run goes: progress, checkpoints and observers are called when they should, and only then."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from marching import one_phase, points_of, simulate_assembled
from stridor.system import System
from stridor.temporal.settings import Settings
from stridor.temporal.simulate import simulate

STEPS, STEP = 157, 0.01


def oscillator() -> System:
    """ω = 1, let go at rest from one."""
    return System(np.eye(1), np.zeros((1, 1)), np.eye(1), points=points_of(1, mass=0))


def march(act, **given):
    start = (np.ones(1), np.zeros(1), -np.ones(1))
    return act(oscillator(), one_phase(STEPS * STEP), Settings(step=STEP, watch=("mass",)), disturbance=start, **given)


@pytest.mark.parametrize("act", [simulate, simulate_assembled])
def test_progress_ends_at_all_steps_and_checkpoints_go_on_from_where_they_are(act) -> None:
    told: list[tuple[int, int]] = []
    kept = []
    run = march(act, progress=lambda *done: told.append(done), checkpoint=kept.append, checkpoint_seconds=-1.0)
    assert told[-1] == (STEPS, STEPS)
    assert [done for done, _ in told] == sorted({done for done, _ in told})
    assert kept
    assert all(part.interrupted for part in kept)
    assert [part.steps for part in kept] == sorted({part.steps for part in kept})
    assert not run.interrupted
    part = kept[0]
    assert np.array_equal(part.displacement, run.displacement[: len(part.time)])


@pytest.mark.parametrize("act", [simulate, simulate_assembled])
def test_no_checkpoint_before_its_time_and_none_without(act) -> None:
    kept = []
    march(act, checkpoint=kept.append, checkpoint_seconds=1e6)
    assert not kept
    march(act, checkpoint_seconds=-1.0)


@pytest.mark.parametrize("act", [simulate, simulate_assembled])
@pytest.mark.parametrize("which", ["progress", "checkpoint"])
def test_an_interrupt_out_of_a_callback_keeps_the_run(act, which: str) -> None:
    def stop(*given: object) -> None:
        raise KeyboardInterrupt

    run = march(act, checkpoint_seconds=-1.0, **{which: stop})
    assert run.interrupted
    assert 0 < run.steps <= STEPS
    assert len(run.time) == len(run.displacement)


@dataclass
class Watcher:
    every: int
    seen: list[tuple[float, float]] = field(default_factory=list)

    def see(self, time: float, velocity) -> None:
        self.seen.append((time, float(velocity[0])))


@pytest.mark.parametrize("every", [1, 7, 157, 200])
def test_an_observer_sees_every_so_many_steps_from_the_first(every: int) -> None:
    watcher = Watcher(every)
    march(simulate_assembled, observe=watcher)
    times, velocities = np.array(watcher.seen).T
    assert times == pytest.approx(STEP * np.arange(0, STEPS, every))
    # Half a step before the time: what the loop carries (β2 = 1/2).
    assert velocities == pytest.approx(-np.sin(times - STEP / 2), abs=2e-5)
    assert march(simulate_assembled).steps == STEPS
