"""How long a phase is does not enter the digits of a motion in exact steps: one made longer goes on to the last bit."""

from __future__ import annotations

import numpy as np
import pytest

import stridor as st
from mode_coupling import mode_coupling
from stridor.temporal.schedule import PhaseSpec, lay_out
from stridor.temporal.steppers.exact.drive import pieces

pytestmark = pytest.mark.verification


@pytest.mark.parametrize("ramp", [0.0, 2.0])
def test_a_phase_that_is_made_longer_goes_on_to_the_last_bit(ramp: float) -> None:
    def case(length: float) -> st.Case:
        changed = {"name": "b", "duration": length, "loads": {"press": 1.3}, "velocities": {"belt": 1.1}, "ramp": ramp}
        return mode_coupling(0.1, 5.0).with_(
            {"phases": [{"name": "a", "duration": 4.0}, changed], "temporal.initial": "rest",
             "temporal.perturbation": 0.0}
        )

    whole = st.simulate(case(10.0), mu=0.4)
    short = st.simulate(case(5.0), mu=0.4)
    longer = st.simulate(case(10.0), mu=0.4, restart=short)
    for name in ("displacement", "velocity", "normal_force", "kinetic"):
        values = getattr(whole, name)
        assert np.array_equal(getattr(short, name), values[: len(short.time)]), name
        assert np.array_equal(getattr(longer, name), values[-len(longer.time) :]), name


def test_what_drives_a_motion_does_not_tell_how_long_its_phase_is() -> None:
    def driven(length: float) -> list[np.ndarray]:
        phases = [PhaseSpec("a", 4.0, {}, {}), PhaseSpec("b", length, {"press": 1.3}, {"belt": 0.7}, 2.0)]
        found = pieces(lay_out(phases, 2e-3, ["press"], ["belt"]))
        seen = zip(found, ((1.1, 3.3), (4.1, 5.7), np.linspace(6.0, 7.1, 50)), strict=True)
        at = [(piece, time) for piece, times in seen for time in times]
        return [x @ p.powers(t) for p, t in at for x in (p.loads, p.displacements, p.displacements @ p.derivative)]

    for one, other in zip(driven(3.1), driven(11.7), strict=True):
        assert np.array_equal(one, other)
