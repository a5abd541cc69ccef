"""Finite sliding: the contact point travels along the spline, the normal follows it, the end of the line is
noticed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from benches import Slave, bench
from marching import belt_motion, run
from stridor.contact.interface import Rows, pair
from stridor.errors import AnalysisError, CaseError
from stridor.laws import Coulomb
from stridor.system import System

pytestmark = pytest.mark.verification

PATHS = ("modal", "nodal")


def mass_on_track(
    track, start, *, mu=0.0, press=0.0, push=0.0, mass=1.0, side=1, velocity=0.0, sliding="finite"
):
    """A free point mass on a rigid curve through nodes (k, 2); the curve moves along x with ``velocity``."""
    nodes = np.asarray(track, dtype=float)
    motion = belt_motion(2)
    lift = np.zeros((2 * len(nodes), 1))
    lift[0::2] = velocity
    contact = pair(
        "A", slave=Rows(sp.csr_array(np.eye(2)), np.zeros((2, 1))),
        slave_position=np.asarray(start, dtype=float),
        master=Rows(sp.csr_array((2 * len(nodes), 2)), lift), master_positions=nodes, side=side,
        stiffness=np.inf,
        law=Coulomb(mu), sliding=sliding,
    )  # fmt: skip
    assert contact is not None
    loads = {"press": np.array([0.0, -press]), "push": np.array([push, 0.0])}
    points = {"mass": Rows(sp.csr_array(np.eye(2)), np.zeros((2, 1)))}
    return System(mass * np.eye(2), np.zeros((2, 2)), np.zeros((2, 2)), (contact,), loads, motion, points)


def straight(angle_deg, count=11, length=1.0):
    angle = math.radians(angle_deg)
    return np.linspace(0.0, length, count)[:, None] * np.array([math.cos(angle), math.sin(angle)])


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("mu", [0.0, 0.2])
def test_sledge_on_an_inclined_line(mu, path):
    """Down a slope of 30° under gravity: a = g (sin − μ cos), N = m g cos, over several segments."""
    track = straight(-30.0)
    system = mass_on_track(track, track[1], mu=mu, press=2.0)
    result = run(system, 0.7, step=1e-3, path=path, watch=("mass",))
    angle = math.radians(30.0)
    acceleration = 2.0 * (math.sin(angle) - mu * math.cos(angle))
    way = np.linalg.norm(result.displacement[:, 0], axis=1)
    assert np.abs(way - acceleration * result.time**2 / 2).max() < 2e-3 * way[-1] + 1e-3 * acceleration * 1.0
    assert way[-1] > 0.15  # beyond the second node
    assert np.allclose(result.normal_force[1:], 2.0 * math.cos(angle), rtol=1e-9)
    assert np.allclose(np.abs(result.tangential_force[1:]), mu * 2.0 * math.cos(angle), atol=1e-12)
    # It stays on the line.
    assert np.abs(result.gap[:-1]).max() < 1e-12


@pytest.mark.parametrize("path", PATHS)
def test_line_under_the_slave_moves(path):
    """A belt travels 0.55 m below a held slave: friction drags for all of it and the slave follows no
    node."""
    track = straight(0.0)
    system = mass_on_track(track, [0.75, 0.0], mu=0.3, press=1.0, velocity=0.5)
    # Hold the mass along x by a stiff spring.
    system = replace(system, stiffness=sp.csr_array(np.diag([1e4, 0.0])))
    result = run(system, 1.1, step=1e-3, path=path, watch=("mass",))
    assert np.allclose(result.displacement[500:, 0, 0].mean(), 0.3 / 1e4, rtol=0.05)
    assert np.abs(result.displacement[:, 0, 1]).max() < 1e-12
    assert result.works["friction"][-1] == pytest.approx(0.3 * 0.55, rel=0.01)


@pytest.mark.parametrize("path", PATHS)
def test_normal_turns_on_a_curved_line(path):
    """A bead inside a circular track, pushed along: N = m v²/R towards the centre, the speed stays, the
    normal turns.

    The spline through 41 nodes of a quarter circle is the circle to 1e-4 of its radius.
    """
    radius, speed = 0.5, 1.0
    angles = np.linspace(-math.pi / 2, 0.0, 41)
    track = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    system = mass_on_track(track, track[4])
    at = angles[4]
    start = (0.0, speed * np.array([-math.sin(at), math.cos(at)]), speed**2 / radius * -track[4] / radius)
    result = run(system, 0.5, step=2e-4, path=path, start=start, watch=("mass",))
    place = track[4] + result.displacement[:, 0]
    turned = np.unwrap(np.arctan2(place[:, 1], place[:, 0]))
    assert turned[-1] - turned[0] == pytest.approx(speed * result.time[-1] / radius, rel=2e-3)
    assert turned[-1] - turned[0] > math.radians(50.0)
    assert np.abs(np.linalg.norm(place, axis=1) / radius - 1).max() < 1e-4
    force = result.normal_force[50:, 0]
    assert force.mean() == pytest.approx(speed**2 / radius, rel=5e-3)
    # The force on the bead points to the centre: a = −N place/R.
    inward = -(result.acceleration[50:, 0] * place[50:]).sum(axis=1) / radius
    assert np.allclose(inward, force, rtol=2e-2)
    along = np.linalg.norm(result.velocity[50:, 0], axis=1)
    assert np.abs(along / speed - 1).max() < 5e-3


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("sense", [1, -1])
def test_leaving_the_line_is_a_clear_error(path, sense):
    track = straight(0.0)
    system = mass_on_track(track, [0.5, 0.0], press=1.0)
    with pytest.raises(
        AnalysisError, match=r"contact A: the slave point left the master line over an end at t = 0\.5"
    ) as error:
        run(system, 2.0, step=1e-3, path=path, start=(0.0, [sense, 0.0], 0.0), watch=("mass",))
    kept = error.value.trajectory
    assert kept.interrupted
    assert len(kept.time) == kept.steps
    assert kept.displacement[-1, 0, 0] == pytest.approx(0.5 * sense, abs=3e-3)
    assert kept.time[-1] == pytest.approx(0.5, abs=3e-3)


def test_slave_on_the_last_node_may_only_go_inwards():
    track = straight(0.0)
    inwards = mass_on_track(track, [1.0, 0.0], press=1.0)
    result = run(inwards, 0.3, step=1e-3, start=(0.0, [-1.0, 0.0], 0.0), watch=("mass",))
    assert result.displacement[-1, 0, 0] == pytest.approx(-0.3, abs=2e-3)
    assert np.allclose(result.normal_force[1:], 1.0)
    with pytest.raises(AnalysisError, match="over an end at t = 0 s"):
        run(inwards, 0.3, step=1e-3, start=(0.0, [1.0, 0.0], 0.0))


@pytest.mark.parametrize("path", PATHS)
def test_small_and_finite_sliding_agree_for_small_motion(path):
    """On the bench, whose slip is micrometres in this time: forces agree to the order of slip over element
    length."""
    small = bench(Slave(place=0.62, stiffness=1e8), velocity=0.02)
    finite = replace(small, contacts=tuple(replace(c, sliding="finite") for c in small.contacts))
    runs = [run(system, 3e-4, path=path, record_every=5, ramp=1e-4) for system in (small, finite)]
    forces = [r.normal_force[:, 0] for r in runs]
    assert np.abs(forces[0] - forces[1]).max() < 0.01 * np.abs(forces[0]).max()
    assert np.abs(forces[0] - forces[1]).max() > 0.0


@pytest.mark.parametrize(("elements", "stiffness"), [(3, "rigid"), (12, 1e8)])
def test_beam_slides_over_several_elements(elements, stiffness):
    """The bench with the clamp moving 20 mm, little friction: nodes pass by, the load stays, both paths
    agree."""
    slave = Slave(place=0.5, damping=(3e3, 0.0), stiffness=stiffness)
    system = bench(slave, elements=elements, velocity=1.0, damping=(3e3, 0.0))
    system = replace(
        system, contacts=tuple(replace(c, sliding="finite", law=Coulomb(0.02)) for c in system.contacts)
    )
    both = [
        run(system, 2e-2, record_every=10, initial="steady-sliding", watch=("base.start",), path=path)
        for path in PATHS
    ]
    result = both[0]
    assert result.displacement[-1, 0, 0] == pytest.approx(result.time[-1], rel=1e-9)
    # The start was an equilibrium of the undeformed line; what that stirs up is damped away.
    late = result.time > 5e-3
    assert np.all(result.status[late] == 2)
    assert np.abs(result.normal_force[late] - 20.0).max() < 2.0
    assert np.abs(both[0].normal_force - both[1].normal_force).max() < 1e-5
    assert np.abs(np.diff(result.normal_force[late, 0])).max() < 0.5  # no blow where a node passes


def test_a_spring_that_the_step_cannot_follow_is_refused_where_normals_turn():
    """A period of 2π √(m/K) below some seven steps: it would ring on, and with any small sliding it does not."""
    system = bench(Slave(stiffness=1e10), velocity=1.0)
    finite = replace(system, contacts=tuple(replace(c, sliding="finite") for c in system.contacts))
    with pytest.raises(CaseError, match=r"contacts.C0.stiffness: 10000000000.0 – with sliding = \"finite\" at most .* N/m"):
        run(finite, 1e-4)
    assert run(finite, 1e-4, contact="rigid").steps == run(system, 1e-4).steps

