"""Small random systems whose friction falls with the slip speed, and what runs of them settle in."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import stridor as st
from stridor.periodic import Cycle
from stridor.periodic.recurrence import ContactPart


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


def long_run(
    seed: int, *, mu: float | None = None, push: float = 0.01, step: float = 2e-3, lasting: float = 1500.0
) -> ContactPart:
    """The last fifth of a run from a push of its own, in steps of its own, at the bench's μ or another."""
    work, own = work_of(
        seed, phases=[{"name": "run", "duration": lasting}],
        temporal={
            "stepper": "explicit", "step": step, "record_every": 4, "initial": "steady-sliding", "perturbation": push,
        },
    )  # fmt: skip
    run = st.simulate(work, own if mu is None else mu)
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


def check_is_run(cycle: Cycle, part: ContactPart, amplitude: float = 0.02) -> None:
    for k, own in enumerate(part.amplitudes):
        mine = cycle.slip_amplitudes[k]
        assert mine == pytest.approx(own, rel=amplitude)
    assert cycle.period == pytest.approx(mean_period(part, cycle.period), rel=1e-3)
