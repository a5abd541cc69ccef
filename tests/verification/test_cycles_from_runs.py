"""Cycles that harmonic balance takes from a run in time, where no branch from an onset leads to what motions settle in."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.signal

import stridor as st
from marching import block_on_belt
from stridor.laws import Hyperbolic
from stridor.periodic import Cycle
from stridor.periodic.recurrence import ContactPart, recurrences
from stridor.study.cycle_methods import Harmonic

pytestmark = pytest.mark.verification

RUN = "a run in time"


def bench(seed: int) -> tuple[dict[str, Any], float]:
    """A random system of 2 to 4 freedoms with one or two elastic contacts whose friction falls with the slip speed, as
    `System.from_matrices` takes it, and a friction coefficient."""
    r = np.random.default_rng(seed)
    n = int(r.integers(2, 5))
    q = np.linalg.qr(r.standard_normal((n, n)))[0]
    w = np.sort(r.uniform(0.7, 3, n))
    mass = np.diag(np.exp(r.uniform(-0.5, 0.5, n)))
    root = np.sqrt(mass) @ q
    stiffness = root @ np.diag(w**2) @ root.T
    if r.random() < 0.5:
        damping = root @ np.diag(2 * w * r.uniform(0.002, 0.05, n)) @ root.T
    else:
        damping = r.uniform(0.005, 0.05) * mass + r.uniform(0, 0.03) * stiffness
    contacts: dict[str, Any] = {}
    load = np.zeros(n)
    for c in range(int(r.choice([1, 1, 2]))):
        i, j = r.permutation(n)[:2]
        normal, tangent = np.eye(n)[i], np.eye(n)[j]
        if r.random() < 0.5:
            normal = normal + 0.4 * r.standard_normal(n)
            tangent = tangent + 0.4 * r.standard_normal(n)
        one: dict[str, Any] = {
            "normal": normal, "tangent": tangent, "stiffness": float(r.uniform(1, 20)),
            "slip": float(r.choice([-1, 1]) * r.uniform(0.05, 0.6)),
        }  # fmt: skip
        law, kinetic = str(r.choice(("weakening", "hyperbolic"))), float(r.uniform(0.1, 0.7))
        how = {"decay_speed": float(r.uniform(0.1, 1))} if law == "weakening" else {"delta": float(r.uniform(1, 5))}
        one["friction"] = {"law": law, "coefficient": kinetic, "static_coefficient": kinetic * 1.3, **how}
        if r.random() < 0.3:
            one["cubic"] = float(r.uniform(1, 20))
        if r.random() < 0.3:
            r.uniform(0, 0.2)
        contacts[f"c{c}"] = one
        load -= normal * r.uniform(0.3, 1.5)
    symmetric = 0.5 * (stiffness + stiffness.T), 0.2 * (damping + damping.T)
    given = {
        "mass": mass, "damping": symmetric[1], "stiffness": symmetric[0], "contacts": contacts, "loads": {"f": load},
    }  # fmt: skip
    return given, float(np.random.default_rng(seed).choice([0.6, 0.9, 1.3]))


def work_of(seed: int, **temporal: Any) -> tuple[st.Workspace, float]:
    given, mu = bench(seed)
    system = st.System.from_matrices(
        given["mass"], given["damping"], given["stiffness"], contacts=given["contacts"], loads=given["loads"]
    )
    modal = {"max_frequency_hz": 2.0, "friction_range": [0.0, 1.6]}
    return st.Workspace(system, modal=modal, **temporal), mu


def long_run(seed: int, *, step: float = 2e-3, lasting: float = 1500.0) -> ContactPart:
    """The last fifth of a run from a push of its own, in steps of its own."""
    work, mu = work_of(
        seed, phases=[{"name": "run", "duration": lasting}],
        temporal={
            "stepper": "explicit", "step": step, "record_every": 4, "initial": "steady-sliding", "perturbation": 0.01,
        },
    )  # fmt: skip
    run = st.simulate(work, mu)
    late = run.time > 0.8 * lasting
    return ContactPart(
        run.time[late], run.normal_force[late], run.tangential_force[late][..., None], run.gap[late],
        run.slip_speed[late][..., None],
    )  # fmt: skip


def mean_period(part: ContactPart, about: float) -> float:
    """Of the whole part, by the crossings of the slip of the first contact through a level that it passes once upwards in
    each period."""
    slip = part.slip[:, 0, 0]
    level = slip.min() + 0.9 * np.ptp(slip)
    up = np.flatnonzero((slip[:-1] < level) & (slip[1:] >= level))
    times = part.time[up] + (level - slip[up]) / (slip[up + 1] - slip[up]) * part.spacing
    lasting = times[-1] - times[0]
    return float(lasting / round(lasting / about))


def check_is_run(cycle: Cycle, part: ContactPart) -> None:
    for k, own in enumerate(part.amplitudes):
        mine = cycle.slip_amplitudes[k]
        assert mine == pytest.approx(own, rel=0.02)
    assert cycle.period == pytest.approx(mean_period(part, cycle.period), rel=1e-3)


@pytest.mark.parametrize("seed", [pytest.param(35, marks=pytest.mark.slow), 36, 38])
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
