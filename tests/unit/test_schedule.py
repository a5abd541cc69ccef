"""Distances in the schedule of a run: how far they have gone after each step, with a ramp, without, and from phase to phase."""

from __future__ import annotations

import numpy as np
import pytest

from stridor.temporal.schedule import PhaseSpec, lay_out

STEP = 0.5


def gone(*phases: PhaseSpec) -> np.ndarray:
    """Factor of the distance of a support after every step; beside it runs one with a velocity."""
    schedule = lay_out(phases, STEP, [], ["jaw", "belt"], np.array([1.0, 0.0]))
    increments = schedule.motion_increments(0, schedule.steps)
    # Asked for bit by bit they are the same.
    parts = [schedule.motion_increments(k, 3) for k in range(0, schedule.steps - 2, 3)]
    assert np.concatenate(parts) == pytest.approx(increments[: 3 * len(parts)], abs=1e-15)
    return np.cumsum(increments[:, 0])


def quintic(x: np.ndarray) -> np.ndarray:
    x = np.clip(x, 0.0, 1.0)
    return 10 * x**3 - 15 * x**4 + 6 * x**5


@pytest.mark.parametrize("ramp", [2.0, 2.2, 4.5])
def test_a_ramp_takes_a_distance_to_its_place_by_a_quintic(ramp: float) -> None:
    found = gone(PhaseSpec("press", 4.5, {}, {}, ramp))
    after = STEP * np.arange(1, 10)
    assert found == pytest.approx(quintic(after / ramp), abs=1e-14)


def test_without_a_ramp_the_whole_way_is_gone_in_the_first_step() -> None:
    assert gone(PhaseSpec("press", 3.0, {}, {})) == pytest.approx(np.ones(6), abs=1e-15)


def test_the_next_phase_goes_on_from_where_the_distance_is() -> None:
    phases = (
        PhaseSpec("press", 2.0, {}, {}), PhaseSpec("hold", 1.0, {}, {}, 1.0),
        PhaseSpec("more", 2.0, {}, {}, 2.0, displacements={"jaw": 3.0}), PhaseSpec("back", 1.0, {}, {}, displacements={"jaw": 0.0}),
    )  # fmt: skip
    more = 1 + 2 * quintic(np.arange(1, 5) / 4)
    assert gone(*phases) == pytest.approx([1, 1, 1, 1, 1, 1, *more, 0, 0], abs=1e-14)
