"""Steady sliding against closed forms and force balances."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stridor as st
from benches import Slave, bench, by_hand, paper_case
from stridor.errors import AnalysisError
from stridor.sliding import steady_sliding
from stridor.system import build_system

pytestmark = pytest.mark.verification


def residual_force(system, answer):
    """K u − Σ N (n + μ s t) − f, with the loads at factor one."""
    force = sum(system.loads.values()) - system.motion.damping @ np.ones(len(system.motion.names))
    for k, c in enumerate(system.contacts):
        push = c.normal_row + answer.friction_coefficient[k] * answer.sense[k, 0] * c.tangent_row
        force = force + answer.normal_force[k] * push
    return system.stiffness @ answer.displacement - force


@pytest.mark.parametrize("mu", [0.0, 0.1, 0.7])
@pytest.mark.parametrize("lean", [5.0, -20.0])
@pytest.mark.parametrize("velocity", [0.02, -0.02])
def test_guided_beam_carries_its_load_whatever_it_leans(mu, lean, velocity):
    """The guide holds x and rotation only: the load reaches the contact in full, whatever friction does."""
    system = bench(Slave(lean_deg=lean), velocity=velocity)
    answer = steady_sliding(system, mu=mu)
    assert answer.normal_force[0] == pytest.approx(20.0, rel=1e-9)
    assert answer.sense[0, 0] == np.sign(velocity)  # friction drags the slave along with the master
    # C_L v pushes the moving body: beam damping acts on a rigid translation through the mass part.
    assert answer.slip_velocity[0, 0] == pytest.approx(-velocity)


@pytest.mark.parametrize("mu", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("lean", [0.0, 10.0, -25.0])
@pytest.mark.parametrize("velocity", [0.02, -0.02])
def test_clamped_leaning_slave_digs_in_or_lifts_off(mu, lean, velocity):
    """A clamped straight slave pressed at its tip by P on a cantilever master of compliance c_m.

    Tip compliances of the slave, leaning by θ off the normal: c_nn = cos²θ L/EA + sin²θ L³/3EI and
    c_nt = sinθ cosθ (L/EA − L³/3EI). The gap (N − P) c_nn + s μ N c_nt + N c_m is −N/K_c.
    """
    slave = Slave(lean_deg=lean, end="clamped", stiffness=2e6, force=5.0, damping=(0.0, 0.0))
    system = bench(slave, velocity=velocity, damping=(0.0, 0.0), length=0.15)
    answer = steady_sliding(system, mu=mu)
    theta = math.radians(lean)
    area, second = 0.01 * 1.5e-3, 0.01 * 1.5e-3**3 / 12
    axial, lateral = 0.05 / (200e9 * area), 0.05**3 / (3 * 200e9 * second)
    # Axis of the slave: (sinθ, cosθ) in (t, n); lateral direction (cosθ, −sinθ).
    c_nn = math.cos(theta) ** 2 * axial + math.sin(theta) ** 2 * lateral
    c_nt = math.sin(theta) * math.cos(theta) * (axial - lateral)
    distance = 0.1
    master = distance**3 / (3 * 200e9 * 0.015 * 3e-3**3 / 12)
    s = np.sign(velocity)
    # slave normal motion (N − P) c_nn + s μ N c_nt; master −N·master; gap + N/K = 0.
    expected = 5.0 * c_nn / (c_nn + s * mu * c_nt + master + 1 / 2e6)
    assert expected > 0
    assert answer.normal_force[0] == pytest.approx(expected, rel=1e-7)
    np.testing.assert_allclose(residual_force(system, answer), 0.0, atol=1e-9 * 5.0 * 1e3)


def test_forces_balance_and_the_gap_obeys_the_contact_stiffness():
    system = build_system(paper_case())
    answer = steady_sliding(system, mu=0.4)
    contact = system.contacts[0]
    scale = np.abs(system.stiffness).max() * np.abs(answer.displacement).max()
    assert np.abs(residual_force(system, answer)).max() < 1e-12 * scale
    gap = contact.gap + contact.normal_row @ answer.displacement
    assert gap == pytest.approx(-answer.normal_force[0] / contact.stiffness, rel=1e-5)
    assert answer.residual < 1e-12


def test_rigid_is_the_limit_of_stiff():
    soft, stiff, rigid = (
        steady_sliding(bench(Slave(end="clamped", lean_deg=20, stiffness=k)), mu=0.3).normal_force[0]
        for k in (1e8, 1e13, "rigid")
    )
    assert stiff == pytest.approx(rigid, rel=1e-6)
    assert soft != pytest.approx(rigid, rel=1e-6)


def test_a_pulled_contact_is_reported():
    with pytest.raises(AnalysisError, match="no contact carries load"):
        steady_sliding(bench(Slave(end="clamped", force=-5.0)))


def test_a_body_that_nothing_holds_is_reported():
    with pytest.raises(AnalysisError, match="can move freely"):
        steady_sliding(bench(Slave(force=-5.0)))


@pytest.mark.parametrize("force", [1e11, 1e20, 1e100])
def test_loads_beyond_what_the_stiffness_takes_are_told_as_such(force: float):
    """What holds the beam is there: it is its load that no small displacement answers."""
    case = paper_case().with_({"loads.press.force": (0.0, -force)})
    with pytest.raises(AnalysisError, match=r"would move body beam\d by .* m under forces .* check their units"):
        st.steady_sliding(case)


def test_no_sliding_velocity_is_reported():
    with pytest.raises(AnalysisError, match="C0 does not slide"):
        steady_sliding(bench(Slave(), velocity=0.0), mu=0.1)


def test_a_velocity_across_the_master_is_reported():
    case = paper_case().with_({"supports.clamp.velocity": {"x": 0.02, "y": 0.001}})
    with pytest.raises(AnalysisError, match="change its gap"):
        steady_sliding(build_system(case))


def test_the_active_set_opens_what_would_pull():
    """A seesaw on two springs-contacts: pressed beyond the right one, the left one opens."""
    # Rigid bar, freedoms (height y, rotation r); contacts at x = ∓1; weak springs keep it well posed.
    stiffness = np.diag([10.0, 10.0])
    normal = np.array([[1.0, -1.0], [1.0, 1.0]])
    load = {"push": np.array([-100.0, -300.0])}
    system = by_hand(np.eye(2), np.zeros((2, 2)), stiffness, normal, np.zeros((2, 2)), 1e4, loads=load)
    answer = steady_sliding(system, mu=0.3)
    assert list(answer.active) == [False, True]
    y, r = np.linalg.solve(stiffness + 1e4 * np.outer(normal[1], normal[1]), load["push"])
    np.testing.assert_allclose(answer.displacement, [y, r], rtol=1e-10)
    assert answer.normal_force[0] == 0.0
    assert answer.normal_force[1] == pytest.approx(-1e4 * (y + r))
    both = steady_sliding(by_hand(np.eye(2), np.zeros((2, 2)), stiffness, normal, np.zeros((2, 2)), 1e4,
                                  loads={"push": np.array([-100.0, -50.0])}), mu=0.3)  # fmt: skip
    assert list(both.active) == [True, True]


def test_the_static_lift_of_a_moving_clamp_is_a_rigid_translation():
    system = build_system(paper_case())
    answer = system.motion.lift[:, 0]
    assert np.abs(system.stiffness @ answer).max() > 0  # reaction of the clamp
    assert system.motion.stiffness_own[0, 0] == 0.0
    tip = system.points["beam2.end"]
    assert tip.free @ answer * 0 + tip.lift[:, 0] == pytest.approx([0.02, 0.0, 0.0], abs=1e-12)


def test_a_stop_that_stays_open_needs_no_motion_of_its_own():
    """A mass on a belt that carries it to x = μN/k = 0.15 m, with a stop behind that and before it; what slides is
    answered by every path."""

    def case(stop: float) -> st.Case:
        return st.Case(
            units="nondimensional",
            bodies={
                "m": {"type": "mass", "mass": 2.0, "position": (0, 0)},
                "belt": {
                    "type": "obstacle", "shape": "flat", "point": (0, 0), "normal": (0, 1), "sliding": {"velocity": (1, 0)}
                },
                "wall": {"type": "obstacle", "shape": "flat", "point": (stop, 0), "normal": (-1, 0)},
            },
            springs={"k": {"between": ("m", "ground"), "direction": (1, 0), "stiffness": 5.0}},
            loads={"press": {"at": "m", "force": (0, -3)}},
            contacts={
                "rub": {
                    "slave": "m", "master": "belt", "stiffness": "rigid", "friction": {"law": "coulomb", "coefficient": 0.25}
                },
                "stop": {
                    "slave": "m", "master": "wall", "stiffness": "rigid", "friction": {"law": "coulomb", "coefficient": 0.2}
                },
            },
            modal={"max_frequency_hz": 2.0},
        )  # fmt: skip

    behind = case(0.2)
    assert st.steady_sliding(behind).active.tolist() == [True, False]
    for source in ("krylov", "reduced", "full"):
        found = st.modes(behind.with_({"modal.source": source}))
        assert found.frequency_hz[0] == pytest.approx([np.sqrt(2.5) / (2 * np.pi)], rel=1e-9)
    with pytest.raises(AnalysisError, match="contact stop does not slide: no support moves"):
        st.modes(case(0.1))


def grazing(at_rest: str = "") -> st.Case:
    """A mass pressed on a belt, and one beside it that nothing presses on its own: springs (1, ½), half of one more
    along each axis between them, contact of ½, so that the two modes it has when it touches part with any friction."""
    flat = {"type": "obstacle", "shape": "flat", "normal": (0, 1), "sliding": {"velocity": (1, 0)}}
    spring = {"between": ("grazes", "ground")}
    friction = {"law": "coulomb", "coefficient": 0.3}
    return st.Case(
        units="nondimensional",
        bodies={
            "pressed": {"type": "mass", "mass": 1.0, "position": (5, 0)}, "under": flat | {"point": (5, 0)},
            "grazes": {"type": "mass", "mass": 1.0, "position": (0, 0)}, "beside": flat | {"point": (0, 0)},
        },
        springs={
            "x": spring | {"direction": (1, 0), "stiffness": 1.0}, "y": spring | {"direction": (0, 1), "stiffness": 0.5},
            "across": spring | {"direction": (1, -1), "stiffness": 0.1},
            "own": {"between": ("pressed", "ground"), "direction": (1, 0), "stiffness": 9.0},
            "up": {"between": ("pressed", "ground"), "direction": (0, 1), "stiffness": 9.0},
        },
        loads={"press": {"at": "pressed", "force": (0, -3)}} | ({at_rest: {"at": "grazes", "force": (0, -0.1)}} if at_rest else {}),
        contacts={
            "rub": {"slave": "pressed", "master": "under", "stiffness": 1.0, "friction": friction},
            "graze": {"slave": "grazes", "master": "beside", "stiffness": 0.5, "friction": friction},
        },
        modal={"max_frequency_hz": 2.0, "friction_range": (0.0, 1.0)},
    )  # fmt: skip


@pytest.mark.parametrize("source", ["krylov", "full", "reduced"])
def test_a_contact_that_carries_nothing_feeds_no_motion(source):
    open_, closed = (st.modes(case.with_({"modal.source": source}), mu=0.3) for case in (grazing(), grazing("more")))
    assert open_.open_contacts == ("graze",)
    assert not open_.unstable.any()
    assert closed.open_contacts == ()
    assert closed.unstable.sum() == 1
    stiffness = np.array([[1.05, -0.05], [-0.05, 0.55]])
    free = np.sqrt(np.linalg.eigvalsh(stiffness)) / (2 * np.pi)
    for frequency in free:
        assert np.abs(open_.frequency_hz[0] - frequency).min() < 1e-9
    assert not st.onsets(grazing().with_({"modal.source": source})).onsets


def test_a_contact_that_carries_nothing_hides_no_other_equilibrium():
    """A mass whose springs and contact have two equilibria with much friction, alone and beside one that only grazes."""
    rng = np.random.default_rng(4)
    several = 0
    for _ in range(40):
        half, rows = rng.normal(size=(4, 4)), rng.normal(size=(2, 3, 4))
        stiffness = np.zeros((5, 5))
        stiffness[:4, :4], stiffness[4, 4] = half @ half.T + np.eye(4), 1.0
        normal, tangent = np.zeros((2, 4, 5))
        normal[:3, :4], tangent[:3, :4] = rows
        normal[3, 4] = 1.0
        force = np.append(rng.normal(size=4), 0.0)
        given = np.eye(5), np.zeros((5, 5)), stiffness
        alone, beside = (
            by_hand(*given, normal[:count], tangent[:count], 2.0, loads={"f": force}, slip=-1.0) for count in (3, 4)
        )
        try:
            found = [st.steady_sliding(system, mu=1.5) for system in (alone, beside)]
        except AnalysisError:
            continue
        forces = [sorted(o.normal_force[:3].round(9).tolist() for o in (f, *f.others)) for f in found]
        assert forces[0] == forces[1]
        several += len(forces[0]) > 1
    assert several > 3
