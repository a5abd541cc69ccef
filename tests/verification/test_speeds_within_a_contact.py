"""Laws of speed where the nodes of one contact slip at several speeds: one μ, of modes as of the time loop.

μ is the coefficient of the contact at the mean slip speed of its nodes, and each rubs with μ·μ(v)/μ(v̄). The truth is put
together here, on dense matrices, from the formula of the law.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import scipy.linalg as sl

import stridor as st
from stridor.case import Case
from stridor.errors import CaseError
from stridor.sliding import full_motion
from stridor.study.workspace import Workspace

MU = 0.55
LOW, STILL, DELTA = 0.1, 0.8, 1.8
SPIN = "bodies.disc.sliding.spin"

BLOCK = f"""
[materials.m]
young_modulus = 2e9
density = 2000.0
poisson_ratio = 0.3

[bodies.pad]
type = "solid"
model = "3d"
material = "m"
damping = {{ mass = 4.0, stiffness = 1e-8 }}

[bodies.pad.mesh]
shape = "block"
corner = [0.0145, -0.0042, 0.0]
size = [0.04, 0.03, 0.02]
divisions = [1, 1, 1]
cells = "hexahedron"

[bodies.pad.points]
p1 = [0.0145, -0.0042, 0.02]
p2 = [0.0545, -0.0042, 0.02]
p3 = [0.0145, 0.0258, 0.02]

[bodies.disc]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0, 0.0]
normal = [0.0, 0.0, 1.0]
sliding = {{ velocity = [0.0, 0.0, 0.0], spin = 16.0, axis = [0.0, 0.0, 1.0], centre = [0.036, -0.037, 0.0] }}

[springs.a]
between = ["pad.p1", "ground"]
stiffness = 3e6
direction = [1.0, 0.3, 0.2]

[springs.b]
between = ["pad.p2", "ground"]
stiffness = 2e6
direction = [0.2, 1.0, 0.4]

[springs.c]
between = ["pad.p3", "ground"]
stiffness = 2e6
direction = [1.0, -0.5, 0.1]

[springs.d]
between = ["pad.p1", "ground"]
stiffness = 1e6
direction = [-0.3, 1.0, 0.1]

[loads.press]
at = "pad.top"
force = [0.0, 0.0, -3.0]

[contacts.A]
slave = "pad.bottom"
master = "disc"
stiffness = 1e11
friction = {{ law = "hyperbolic", coefficient = {LOW}, static_coefficient = {STILL}, delta = {DELTA} }}

[modal]
max_frequency_hz = 5500.0
friction_damping = true

[temporal]
initial = "steady-sliding"

[[phases]]
name = "run"
duration = 0.01
"""


@dataclass(frozen=True)
class Truth:
    """Small motions about steady sliding in which each node has ``mu`` (m,): eigenvalues and normal forces."""

    mu: np.ndarray
    force: np.ndarray
    values: np.ndarray


def law(v: np.ndarray) -> np.ndarray:
    return LOW + (STILL - LOW) / (1.0 + DELTA * v)


def slope(v: np.ndarray) -> np.ndarray:
    return -(STILL - LOW) * DELTA / (1.0 + DELTA * v) ** 2


def truth(case: Case, mu: float | None, *, speed: float = 1.0) -> Truth:
    """speed: of the disc, in which μ stays that at its full one."""
    system = st.build_system(case)
    nodes = system.contact_nodes()
    mass, damping, stiffness = (m.toarray() for m in (system.mass, system.damping, system.stiffness))
    n, m = len(mass), nodes.count
    normal, tangents = nodes.normal.toarray(), nodes.tangent.toarray().reshape(m, 2, n)
    slip = speed * nodes.slip_velocity(full_motion(system))
    v = np.linalg.norm(slip, axis=1)
    factor = 1.0 if mu is None else mu / float(law(np.array((v / speed).mean())))
    own, sense = factor * law(v), -slip / v[:, None]
    along = np.einsum("ma,man->mn", sense, tangents)
    across = np.einsum("ma,man->mn", np.column_stack([-sense[:, 1], sense[:, 0]]), tangents)
    push, spring = normal + own[:, None] * along, 1.0 / nodes.compliance
    whole = stiffness + push.T @ (spring[:, None] * normal)
    u = np.linalg.solve(whole, sum(system.loads.values()) - push.T @ (spring * nodes.gap))
    force = -spring * (nodes.gap + normal @ u)
    assert np.all(force > 0.0), "all nodes are pressed"
    rubbed = damping + along.T @ ((force * factor * slope(v))[:, None] * along)
    rubbed += across.T @ ((own * force / v)[:, None] * across)
    turned = -np.linalg.solve(mass, np.hstack([whole, rubbed]))
    lam = sl.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [turned[:, :n], turned[:, n:]]]))
    lam = lam[(lam.imag > 0.0) & (lam.imag < 2 * np.pi * 5500.0)]
    return Truth(own, force, lam[np.argsort(lam.imag)])


@pytest.fixture(scope="module")
def block() -> Case:
    return st.loads(BLOCK)


def modes(case: Case, mu: float | None = None, source: str | None = None) -> np.ndarray:
    chosen = case if source is None else case.with_({"modal.source": source})
    return st.modes(chosen, mu, max_frequency_hz=5500.0).eigenvalues[0]


@pytest.mark.parametrize("mu", [MU, None])
@pytest.mark.parametrize("source", ["krylov", "reduced", "full"])
def test_modes_have_what_the_law_gives_each_node(block: Case, source: str, mu: float | None) -> None:
    expected = truth(block, mu)
    assert np.ptp(expected.mu) > 0.05
    steady = st.steady_sliding(block, mu)
    assert steady.friction_coefficient == pytest.approx(expected.mu, rel=1e-12)
    assert steady.normal_force == pytest.approx(expected.force, rel=1e-9)
    found = modes(block, mu, source)
    assert len(found) == len(expected.values)
    assert np.abs(found - expected.values).max() < 1e-8 * np.abs(expected.values).max()


def test_own_friction_is_that_at_the_mean_speed(block: Case) -> None:
    own = Workspace.of(block).one_friction()
    v = st.build_system(block).contact_nodes().speed
    assert own == pytest.approx(float(law(np.array(v.mean()))), rel=1e-12)
    assert modes(block, own) == pytest.approx(modes(block), rel=1e-12)


def test_a_run_starts_and_grows_as_the_modes_say(block: Case) -> None:
    expected = truth(block, MU)
    fastest = expected.values[np.argmax(expected.values.real)]
    assert fastest.real > 10.0
    short = block.with_({"temporal.step": 2e-7, "modal.max_frequency_hz": 5500.0})
    found = st.compare(short, MU, only={"growth"}, critical=False).comparisons[0]
    assert found.modal_eigenvalue == pytest.approx(fastest, rel=1e-8)
    assert found.perturbation.growth_rate == pytest.approx(fastest.real, rel=1e-3)


def test_modes_of_a_run_that_ends_slower_keep_its_friction(block: Case) -> None:
    slower = Workspace.of(block.with_({"phases.run.velocities": {"disc": 0.9}})).ending()
    for mu in (MU, None):
        expected = truth(block, mu, speed=0.9)
        assert slower.steady(mu).friction_coefficient == pytest.approx(expected.mu, rel=1e-12)
        assert modes(slower, mu) == pytest.approx(expected.values, rel=1e-8)


@pytest.mark.parametrize("mu", [MU, None])
def test_derivatives_follow_what_each_node_has(block: Case, mu: float | None) -> None:
    numbers = (SPIN, "contacts.A.friction.delta")
    found = st.sensitivities(block, numbers, mu=mu, modes="all", max_frequency_hz=5500.0)
    for number, derivative, value in zip(numbers, found.derivative, found.values, strict=True):
        up, down = (truth_at(block, mu, number, value * (1 + h)) for h in (1e-4, -1e-4))
        expected = (up - down) / (2e-4 * value)
        assert derivative == pytest.approx(expected, rel=1e-5)


def truth_at(block: Case, mu: float | None, number: str, value: float) -> np.ndarray:
    """Eigenvalues of the truth with another spin, or as of another delta."""
    if number == SPIN:
        return truth(block.with_({number: value}), mu).values
    return modes(block.with_({number: value}), mu)


def test_a_boundary_over_mu_and_spin_is_where_modes_begin_to_grow(block: Case) -> None:
    found = st.stability_boundary(block, "mu", SPIN, x_range=(0.3, 0.6), y_range=(15.8, 16.2), max_frequency_hz=5500.0)
    assert found.curves
    for curve in found.curves:
        middle = len(curve.x) // 2
        lam = truth(block.with_({SPIN: float(curve.y[middle])}), float(curve.x[middle])).values
        assert np.abs(lam.real).min() < 1e-5 * np.abs(lam).max()


def test_a_law_that_is_zero_at_the_mean_speed_alone_has_no_mu_of_its_own() -> None:
    """No factor makes another coefficient of it; 0 for all of its nodes would leave out what some of them rub with."""
    speeds = st.build_system(st.loads(BLOCK)).contact_nodes().speed
    mean = float(speeds.mean())
    table = {"law": "table", "speeds": [0.0, 0.5 * (speeds.min() + mean), mean], "coefficients": [0.6, 0.4, 0.0]}
    model = st.loads(BLOCK).with_({"contacts.A.friction": table})
    assert st.steady_sliding(model).friction_coefficient.max() > 0.1
    for ask in (st.modes, st.compare):
        with pytest.raises(CaseError, match=r"the law of A gives no friction at the mean slip speed .* name it"):
            ask(model)
    assert st.modes(model, 0.3).solved.all()
