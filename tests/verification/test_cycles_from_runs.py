"""Cycles that harmonic balance takes from a run in time, where no branch from an onset leads to what motions settle in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.signal

import stridor as st
from falling_benches import check_is_run, long_run, work_of
from marching import block_on_belt
from stridor.laws import Hyperbolic
from stridor.periodic.recurrence import ContactPart, recurrences
from stridor.study.cycle_methods import Harmonic

pytestmark = pytest.mark.verification

RUN = "a run in time"


@pytest.mark.parametrize("seed", [*(pytest.param(k, marks=pytest.mark.slow) for k in (35, 36)), 38])
def test_what_a_run_settles_in_is_found(seed: int):
    """Branches turn back or end before this friction coefficient."""
    work, mu = work_of(seed)
    found = st.cycles(work, mu)
    (cycle,) = found.cycles
    assert cycle.method == "harmonic"
    assert cycle.reached_from.startswith(RUN)
    assert "passes near" not in cycle.reached_from
    assert cycle.residual < 1e-6
    assert cycle.defect < 2e-3
    check_is_run(cycle, long_run(seed))


def test_a_motion_that_does_not_repeat_itself_is_no_cycle():
    seed = 11
    work, mu = work_of(seed)
    found = st.cycles(work, mu, seconds=4.0)
    assert not [c for c in found.cycles if c.reached_from.startswith(RUN) and "passes near" not in c.reached_from]
    said = [words for words in found.missing if f"from {RUN}" in words]
    assert len(said) == 2  # of a small and of a large push
    assert all("came back to" in words for words in said)
    if not found.cycles:
        assert found.sentence == "no limit cycle was found; what was looked for and not reached is named below"
    assert not [one for one in recurrences(long_run(seed), 0.005) if one.off < 0.005]


@pytest.mark.parametrize("told", [pytest.param(True, marks=pytest.mark.slow), False])
def test_a_cycle_that_a_branch_has_is_there_once(monkeypatch: pytest.MonkeyPatch, told: bool):
    """Of a block on a belt: a run is made only where the stability of the branch's cycle is not told."""
    system = block_on_belt(law=Hyperbolic(0.0, 1.0, 3.0), damping=0.1, speed=1.0)
    runs: list[str] = []
    if not told:
        monkeypatch.setattr(Harmonic, "_stable", lambda *_: None)
    found = st.cycles(system, 0.3, method="harmonic", progress=lambda _, doing: runs.append(doing))
    (cycle,) = found.cycles
    assert cycle.reached_from.startswith("along the branch")
    assert any(RUN[2:] in words for words in runs) is not told
    assert not [words for words in found.missing if RUN in words]


def test_ctrl_c_ends_the_run_and_keeps_what_was_found():
    work, mu = work_of(38)

    def stop(_: int, doing: str) -> None:
        if "part 2" in doing or "part 1" in doing:
            raise KeyboardInterrupt

    found = st.cycles(work, mu, progress=stop)
    assert found.interrupted
    assert not found.cycles
    assert found.sentence.startswith("the search was stopped before any limit cycle was found")
    assert found.warnings[0] == found.sentence


def test_a_return_is_that_of_all_contacts():
    """Two swings of 1 s and 1.5 s come back after 3 s, and neither by itself counts."""
    time = np.arange(0.0, 30.0, 0.004)
    one, other = np.sin(2 * np.pi * time), scipy.signal.sawtooth(2 * np.pi * time / 1.5)
    both = np.stack([one, other], axis=1)
    part = ContactPart(time, both, both[..., None], both, both[..., None])
    (met,) = recurrences(part, 0.02)
    assert met.period == pytest.approx(3.0, rel=1e-3)
    alone = ContactPart(time, both[:, :1], both[:, :1, None], both[:, :1], both[:, :1, None])
    assert recurrences(alone, 0.02)[0].period == pytest.approx(1.0, rel=1e-4)
    still = ContactPart(time, 0 * both, 0 * both[..., None], 0 * both, 0 * both[..., None])
    assert recurrences(still, 0.02) == []


@pytest.mark.slow
def test_most_small_benches_have_the_motion_of_their_run():
    """Of those whose long run repeats itself."""
    counted, met = 0, 0
    for seed in range(1, 46):
        work, mu = work_of(seed)
        modes = st.modes(work, mu)
        if not (modes.growth_rate[0] > 1e-3).any():
            continue
        part = long_run(seed)
        again = recurrences(part, 0.005)
        if not again or again[-1].off > 0.005:
            continue
        counted += 1
        hits: list[bool] = []
        for cycle in st.cycles(work, mu, seconds=8.0).cycles:
            ratio = max(again[-1].period / cycle.period, cycle.period / again[-1].period)
            alike = abs(cycle.slip_amplitudes[0] / part.amplitudes[0] - 1.0) < 0.02
            hits.append(alike and abs(ratio / round(ratio) - 1.0) < 2e-3)
        met += any(hits)
    assert counted >= 15
    assert met >= 0.6 * counted


PRESSED = """
units = "nondimensional"
[bodies]
m = { type = "mass", mass = 1.0, position = [0, 0] }
jaw = { type = "mass", mass = 1.0, position = [0, 1] }
belt = { type = "obstacle", shape = "flat", point = [0, 0], normal = [0, 1], sliding = { velocity = [0.2, 0] } }
[supports.jaw]
at = "jaw"
fixed = ["x", "y"]
displacement = { y = -0.01 }
[springs]
k = { between = ["m", "ground"], direction = [1, 0], stiffness = 1.0 }
s = { between = ["m", "jaw"], direction = [0, 1], stiffness = 100.0 }
[contacts.rub]
slave = "m"
master = "belt"
stiffness = 1e4
friction = { law = "hyperbolic", coefficient = 0.3, static_coefficient = 0.4, delta = 3.0 }
[modal]
max_frequency_hz = 1.0
[[phases]]
name = "go"
duration = 1.0
"""


def test_a_run_in_time_keeps_what_presses_by_a_distance(tmp_path: Path):
    """One mass whose friction falls, pressed by a jaw that has moved. Period by its own integration, with a contact
    that does not give: 6.44173."""
    path = tmp_path / "pressed.toml"
    path.write_text(PRESSED)
    found = st.cycles(path, 0.3)
    (cycle,) = found.cycles
    assert cycle.reached_from.startswith(RUN)
    assert cycle.period == pytest.approx(6.44173, rel=2e-3)
    assert set(cycle.kinds) == {"slip", "stick"}
    assert not [words for words in found.missing if RUN in words]
