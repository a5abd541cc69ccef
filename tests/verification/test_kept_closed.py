"""Contacts kept closed: like others while these would not open, and pulling, with friction μ|N|, where they would."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st_
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import stridor as st
from stridor.case import loads
from stridor.contact.multipliers import SLIP, STICK, solve_kept
from stridor.laws import Coulomb
from stridor.modal.krylov.refine import TOLERANCE  # to which modes are found
from stridor.sliding import solution
from stridor.temporal.energy import energy_balance
from stridor.view.temporal_tables import contact_table

pytestmark = pytest.mark.verification

# A mass of 2 kg on a spring of 800 N/m along a belt, pressed on it or drawn off by a force.
BLOCK = """
[bodies.block]
type = "mass"
mass = 2.0
position = [0.0, 0.0]
[bodies.belt]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [0.0, 1.0]
sliding = {{ velocity = [0.3, 0.0] }}
[springs.k]
between = ["block", "ground"]
stiffness = 800.0
direction = [1.0, 0.0]
[loads.press]
at = "block"
force = [0.0, {force}]
[contacts.rub]
slave = "block"
master = "belt"
stiffness = {stiffness}
closed = {closed}
friction = {friction}
[modal]
max_frequency_hz = 2000.0
[temporal]
initial = "{initial}"
step = 2e-5
watch = ["block"]
[[phases]]
name = "run"
duration = 0.1
"""


def block(force, *, closed="true", stiffness='"rigid"', initial="rest", law='law = "coulomb", coefficient = 0.4'):
    friction = f"{{ {law} }}"
    return loads(
        BLOCK.format(force=force, closed=closed, stiffness=stiffness, initial=initial, friction=friction)
    )


@pytest.mark.parametrize("stiffness", ['"rigid"', "1e6"])
def test_statics_of_a_mass_that_is_drawn_off(stiffness):
    """N = −10 N, and friction μ|N| along the belt all the same: x = 0.4 · 10/800 either way."""
    for force in (-10.0, 10.0):
        steady = st.steady_sliding(block(force, stiffness=stiffness))
        assert steady.normal_force == pytest.approx([-force], rel=1e-12)
        assert steady.friction_force[0, 0] == pytest.approx(4.0 if force else 0.0, rel=1e-12)
        assert steady.displacement[0] == pytest.approx(4.0 / 800.0, rel=1e-12)
    with pytest.raises(st.AnalysisError, match="no equilibrium: body block can move freely"):
        st.steady_sliding(block(10.0, stiffness="1e6", closed="false"))


@pytest.mark.parametrize("stiffness", ['"rigid"', "1e6"])
def test_signs_that_never_settle_are_told_with_what_may_help(stiffness, monkeypatch):
    """Rigid contact may be given a stiffness; what has one already is not told to."""
    signs = [1.0]

    def alternating(equilibrium, guess, **told):
        signs.append(-signs[-1])
        state, tried = plain(equilibrium, guess, **told)
        return replace(state, normal_force=signs[-1] * np.abs(state.normal_force)), tried

    plain = solution.find_touching
    monkeypatch.setattr(solution, "find_touching", alternating)
    # Of few nodes every sign is tried.
    assert st.steady_sliding(block(10.0, stiffness=stiffness)).normal_force == pytest.approx([-10.0], rel=1e-12)
    monkeypatch.setattr(solution, "of_every_set", lambda equations: iter(()))
    signs.clear()
    signs.append(1.0)
    with pytest.raises(st.AnalysisError, match=f"pull does not settle in {solution.SIGN_CHANGES} steps") as caught:
        st.steady_sliding(block(10.0, stiffness=stiffness))
    assert len(signs) == 1 + solution.SIGN_CHANGES
    help_ = "lower the friction coefficient" + (" or give them a finite stiffness" if "rigid" in stiffness else "")
    assert str(caught.value).endswith(help_)


def test_frequencies_do_not_depend_on_the_sign_of_the_load():
    """And friction that falls with speed drives both: its slope counts with |N|."""
    falling = 'law = "hyperbolic", coefficient = 0.2, static_coefficient = 0.5, delta = 4.0'
    pressed, drawn = (
        st.modes(block(force, stiffness="1e6", law=falling), mu=0.3).eigenvalues[0] for force in (-10.0, 10.0)
    )
    assert drawn == pytest.approx(pressed, rel=TOLERANCE)
    assert pressed.real.max() > 0.0


@pytest.mark.parametrize("stiffness", ['"rigid"', "1e6"])
def test_run_of_a_mass_that_is_drawn_off(stiffness):
    """m x'' + k x = μ|N| from rest: x = (1 − cos ωt) μ|N|/k, drawn off as pressed on; the contact never opens.

    On a spring the sudden load makes N swing about its value, which x feels a little.
    """
    pressed, drawn = (st.simulate(block(force, stiffness=stiffness)) for force in (-10.0, 10.0))
    for result, force in ((pressed, -10.0), (drawn, 10.0)):
        t, x = result.time, result.displacement[:, 0, 0]
        close = 1e-3 if stiffness == '"rigid"' else 4e-3
        assert x == pytest.approx((1 - np.cos(20.0 * t)) * 4.0 / 800.0, abs=close * 4.0 / 800.0)
        assert result.normal_force[t > 0.01, 0].mean() == pytest.approx(-force, rel=2e-2)
        statistics = result.phases[0].contacts["rub"]
        assert statistics.separation_fraction == 0.0
        assert statistics.kept_closed
        assert statistics.max_normal_force == pytest.approx(np.abs(result.normal_force).max(), rel=1e-2)
    assert drawn.displacement[:, 0, 0] == pytest.approx(pressed.displacement[:, 0, 0], abs=1e-12)
    assert drawn.normal_force == pytest.approx(-pressed.normal_force, abs=1e-9)


def test_runs_like_others_while_these_stay_closed():
    """The same trajectory to rounding, step by step."""
    kept, free = (st.simulate(block(-10.0, closed=c)) for c in ("true", "false"))
    assert not free.phases[0].contacts["rub"].kept_closed
    assert np.array_equal(kept.normal_force[1:], free.normal_force[1:])
    assert np.array_equal(kept.displacement, free.displacement)


size = st_.floats(-3, 3).map(lambda e: 10.0**e)


@given(
    gap=st_.floats(-10, 10), slip=st_.floats(-10, 10), a=size, c=size, r=st_.floats(-0.9, 0.9), mu=st_.floats(0, 0.5)
)
def test_local_law(gap, slip, a, c, r, mu):
    """The gap closes with N of either sign, |T| ≤ μ|N|, and friction opposes slip."""
    w_nt = r * np.sqrt(a * c)
    normal, tangential, status = solve_kept(gap, slip, a, w_nt, c, Coulomb(mu).numbers, False, 1.0)
    scale = abs(gap) + a * abs(normal) + abs(w_nt * tangential)
    assert status in (STICK, SLIP)
    assert abs(gap + a * normal + w_nt * tangential) <= 1e-9 * scale
    moved = slip + w_nt * normal + c * tangential
    whole = abs(slip) + abs(w_nt * normal) + c * abs(tangential)
    assert abs(tangential) <= mu * abs(normal) * (1 + 1e-9)
    if status == STICK and gap != 0.0:
        assert abs(moved) <= 1e-9 * whole
    elif tangential != 0.0:
        assert tangential * moved <= 1e-9 * whole * abs(tangential)


BEAMS = """
materials.steel = {{ young_modulus = 200e9, density = 7800.0 }}
[bodies.pin]
type = "beam"
material = "steel"
start = [0.1, 0.0]
angle_deg = 80.0
length = 0.05
width = 0.01
thickness = 0.0015
elements = 3
points = {{ tip = 0.0, top = 0.05 }}
[bodies.rail]
type = "beam"
material = "steel"
start = [0.0, 0.0]
end = [0.15, 0.0]
width = 0.015
thickness = 0.003
elements = 6
[supports.clamp]
at = "rail.start"
fixed = ["x", "y", "rotation"]
velocity = {{ x = 0.02 }}
[supports.guide]
at = "pin.top"
fixed = ["x", "rotation"]
[loads.press]
at = "pin.top"
force = [0.0, {force}]
[contacts.A]
slave = "pin.tip"
master = "rail"
side = "left"
stiffness = "rigid"
closed = true
friction = {{ law = "coulomb", coefficient = {mu} }}
[modal]
max_frequency_hz = 10e3
[temporal]
initial = "steady-sliding"
[[phases]]
name = "run"
duration = 2e-3
"""


def test_point_contact_on_beams():
    """Without friction force and modes turn round with the load; a run from the statics stays there, pulling."""
    pushed, pulled = (loads(BEAMS.format(force=f, mu=0.0)) for f in (-20.0, 20.0))
    assert st.steady_sliding(pushed).normal_force == pytest.approx(-st.steady_sliding(pulled).normal_force)
    assert st.steady_sliding(pulled).normal_force[0] < -19.0
    a, b = (st.modes(case, mu=0.0).eigenvalues for case in (pushed, pulled))
    assert a == pytest.approx(b, rel=1e-12)
    rubbing = loads(BEAMS.format(force=20.0, mu=0.1))
    steady = st.steady_sliding(rubbing).normal_force
    run = st.simulate(rubbing)
    assert run.normal_force[:, 0] == pytest.approx(steady[0], rel=1e-6)
    assert abs(run.tangential_force[-1, 0]) == pytest.approx(0.1 * abs(steady[0]), rel=1e-6)


def test_statistics_say_that_it_is_kept_closed(tmp_path):
    """In the table of the report, in its words and in the file; there also after reading it again."""
    run = st.simulate(block(10.0))
    table = contact_table(run)
    assert table.rows[0].cells[table.heads.index("separation [%]")] == "0.0, kept closed"
    assert "cannot separate" in table.caption
    again = st.open(st.save(run, tmp_path / "run.nc"))
    assert again.phases[0].contacts["rub"].kept_closed


def hardening(force, *, mu=0.0, start=0.0, initial="rest"):
    """A layer N = 1e4 δ + 1e9 δ³; start [m]: height of the mass at first."""
    return block(force, stiffness="1e4", initial=initial).with_(
        {
            "contacts.rub.cubic": 1e9,
            "contacts.rub.friction.coefficient": mu,
            "bodies.block.initial_displacement": [0.0, start],
            "temporal.record_every": 1,
        }
    )


def test_a_layer_that_hardens_pulls_as_it_pushes():
    """Statics and modes of the mass drawn off are those of the mass pressed on, turned round."""
    pressed, drawn = (hardening(force, mu=0.2) for force in (-100.0, 100.0))
    depth = brentq(lambda d: 1e4 * d + 1e9 * d**3 - 100.0, 0.0, 1.0, xtol=1e-16)
    found = st.steady_sliding(drawn)
    assert found.normal_force == pytest.approx([-100.0], rel=1e-12)
    assert found.displacement[1] == pytest.approx(depth, rel=1e-12)
    assert found.friction_force[0, 0] == pytest.approx(20.0, rel=1e-12)
    a, b = (st.modes(case, np.linspace(0.0, 1.0, 6)) for case in (pressed, drawn))
    assert b.frequency_hz == pytest.approx(a.frequency_hz, rel=TOLERANCE)
    assert b.frequency_hz.max() == pytest.approx(np.sqrt((1e4 + 3e9 * depth**2) / 2.0) / (2 * np.pi), rel=1e-12)


def test_a_mass_swings_through_a_layer_kept_closed():
    """m y'' = −k y − k₃ y³ − P from a height: through both signs of N, by an ODE solver."""
    height = 8e-3
    run = st.simulate(hardening(-100.0, start=height))
    exact = solve_ivp(
        lambda _, z: [z[1], (-1e4 * z[0] - 1e9 * z[0] ** 3 - 100.0) / 2.0],
        (0, 0.1),
        [height, 0.0],
        rtol=1e-11,
        atol=1e-15,
        dense_output=True,
    )
    # The first step is that of a run from rest, half a step early.
    late = run.time + 0.5 * run.step
    y = run.displacement[:, 0, 1]
    assert run.normal_force.min() < -100.0
    assert run.normal_force.max() > 100.0
    assert y == pytest.approx(exact.sol(np.minimum(late, 0.1))[0], abs=2e-2 * height)
    assert energy_balance(run).error < 1e-10


def test_load_steps_and_reduced_models_refuse_it():
    with pytest.raises(st.CaseError, match="load steps take contacts that may open only; leave out closed = true"):
        block(10.0).with_({"steady.friction": "stick-slip"})
    with pytest.raises(st.AnalysisError, match="reduced models over parameters do not take contacts that are kept"):
        st.reduced_model(block(10.0), {"mu": (0.1, 0.5)})


PAD = """
materials.lining = { young_modulus = 5e9, density = 2500.0, poisson_ratio = 0.3 }
[bodies.pad]
type = "solid"
material = "lining"
MESH
damping = { mass = 10.0, stiffness = 1e-8 }
[bodies.belt]
type = "obstacle"
shape = "flat"
POINT
sliding = { velocity = SLIDING }
[supports.back]
at = "pad.top"
fixed = HELD
[loads.press]
at = "pad.top"
force = FORCE
[contacts.rub]
slave = "pad.bottom"
master = "belt"
stiffness = 1e11
closed = true
friction = { law = "coulomb", coefficient = 0.3 }
[modal]
max_frequency_hz = 30e3
[temporal]
initial = "steady-sliding"
[[phases]]
name = "run"
duration = 2e-5
"""
PLANE = {
    "MESH": 'model = "plane strain"\nthickness = 0.05\n'
    'mesh = { shape = "rectangle", corner = [0.0, 0.0], size = [0.06, 0.03], divisions = [4, 2], cells = "quad" }',
    "POINT": "point = [0.0, 0.0]\nnormal = [0.0, 1.0]",
    "SLIDING": "[2.0, 0.0]",
    "HELD": '["x"]',
    "FORCE": "[0.0, 300.0]",
}
SPACE = {
    "MESH": 'model = "3d"\nmesh = { shape = "block", corner = [0.0, 0.0, 0.0], size = [0.06, 0.02, 0.03], '
    'divisions = [3, 2, 2], cells = "hexahedron" }',
    "POINT": "point = [0.0, 0.0, 0.0]\nnormal = [0.0, 0.0, 1.0]",
    "SLIDING": "[2.0, 0.3, 0.0]",
    "HELD": '["x", "y"]',
    "FORCE": "[0.0, 0.0, 300.0]",
}


@pytest.mark.parametrize("words", [PLANE, SPACE])
def test_a_pad_that_is_drawn_off_stays_in_its_steady_sliding(words):
    """Friction tilts it, so that nodes pull by different forces; each rubs by μ|N|, and a run from there moves nothing."""
    text = PAD
    for name, word in words.items():
        text = text.replace(name, word)
    case = loads(text)
    steady = st.steady_sliding(case)
    rubbing = np.linalg.norm(steady.friction_force, axis=1)
    assert steady.normal_force.sum() == pytest.approx(-300.0, rel=1e-9)
    assert rubbing == pytest.approx(0.3 * np.abs(steady.normal_force), rel=1e-12)
    assert np.all(np.sum(steady.friction_force * steady.slip_velocity, axis=1) <= 0.0)
    run = st.simulate(case)
    assert run.normal_force[:, 0] == pytest.approx(-300.0, rel=1e-7)
    assert run.slip_speed[:, 0] == pytest.approx(run.slip_speed[0, 0], rel=1e-6)
    assert run.phases[0].contacts["rub"].max_normal_force == pytest.approx(300.0, rel=1e-7)
