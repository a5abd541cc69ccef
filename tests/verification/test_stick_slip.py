"""Static equilibrium with stick and partial slip, and what small motions make of it: against closed forms."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
import skfem
from skfem.models.elasticity import lame_parameters, linear_elasticity
from test_steady_surfaces import moving, on_a_flat
from typer.testing import CliRunner

import stridor as st
from stridor.agreement.perturbation import modes_as_in_time, perturb
from stridor.app.cli import app
from stridor.case import loads
from stridor.contact.multipliers import OPEN, SLIP, STICK
from stridor.errors import AnalysisError, CaseError
from stridor.laws import Coulomb
from stridor.sliding import steady_sliding
from stridor.sliding.result import SteadySliding
from stridor.system import System
from stridor.system.load_steps import LoadStep
from stridor.temporal.settings import Settings

pytestmark = pytest.mark.verification

# A massless thing on springs of 1000 N/m, pressed on a floor with 10 N at μ = 0.3: friction carries 3 N.
BLOCK = """
[bodies.block]
type = "mass"
mass = 2.0
position = {at}
[bodies.floor]
type = "obstacle"
shape = "flat"
point = {at}
normal = {up}
[springs.x]
between = ["block", "ground"]
stiffness = 1000.0
direction = {x}
[loads.press]
at = "block"
force = {down}
[loads.x]
at = "block"
force = {x}
[contacts.A]
slave = "block"
master = "floor"
stiffness = {stiffness}
friction = {{ {friction} }}
[steady]
friction = "stick-slip"
steps = [{{ loads = {{ x = 0.0 }}, increments = 1 }}, {steps}]
"""
COULOMB = 'law = "coulomb", coefficient = 0.3'


def block(steps: str, *, stiffness: str = '"rigid"', friction: str = COULOMB) -> st.Case:
    place = {"at": "[0.0, 0.0]", "up": "[0.0, 1.0]", "down": "[0.0, -10.0]", "x": "[1.0, 0.0]"}
    return loads(BLOCK.format(**place, stiffness=stiffness, friction=friction, steps=steps))


def pulled(*forces: float, increments: int = 3) -> str:
    return ", ".join(f"{{ loads = {{ x = {f} }}, increments = {increments} }}" for f in forces)


@pytest.mark.parametrize("stiffness", ['"rigid"', "1e4"])
@pytest.mark.parametrize(
    ("forces", "moved", "status"),
    [
        ((2.9,), 0.0, STICK),
        ((5.0,), 0.002, SLIP),
        ((5.0, 0.0), 0.002, STICK),  # 2 N are left in the spring, which friction holds
        ((8.0, 0.0), 0.003, SLIP),  # 5 N are more than it holds: it slips back to where 3 N are left
        ((8.0, 0.0, -8.0), -0.005, SLIP),
        ((8.0, -8.0, 8.0), 0.005, SLIP),  # the loop closes
        ((8.0, -8.0, -2.0), -0.005, STICK),
    ],
)
def test_a_spring_and_a_slider_follow_their_loop(forces, moved, status, stiffness):
    found = st.steady_sliding(block(pulled(*forces), stiffness=stiffness))
    assert found.displacement[0] == pytest.approx(moved, abs=1e-12)
    assert found.friction_force[0, 0] == pytest.approx(-(forces[-1] - 1000 * moved), abs=1e-9)
    assert found.status.tolist() == [status]
    assert found.normal_force == pytest.approx([10.0], rel=1e-12)


def test_static_friction_holds_longer_than_kinetic():
    law = 'law = "static-kinetic", coefficient = 0.2, static_coefficient = 0.5'
    for force, moved in ((4.9, 0.0), (5.1, 0.0031)):
        found = st.steady_sliding(block(pulled(force, increments=1), friction=law))
        assert found.displacement[0] == pytest.approx(moved, abs=1e-12)
    # Another coefficient scales both.
    assert st.steady_sliding(block(pulled(4.9, increments=1), friction=law), 0.1).status.tolist() == [SLIP]


@pytest.mark.parametrize("stiffness", ['"rigid"', "1e4"])
@pytest.mark.parametrize("force", [2.0, 5.0])
def test_what_is_lifted_off_lands_where_its_spring_holds_it(force, stiffness):
    """Lifted by 10 N against a spring across, the block moves to where the spring along carries all of the force;
    pressed again, it sticks there without friction."""
    across = '[springs.y]\nbetween = ["block", "ground"]\nstiffness = 1000.0\ndirection = [0.0, 1.0]\n'
    steps = ", ".join(f"{{ loads = {{ x = {force}, press = {press} }}, increments = 1 }}" for press in (1.0, -1.0, 1.0))
    place = {"at": "[0.0, 0.0]", "up": "[0.0, 1.0]", "down": "[0.0, -10.0]", "x": "[1.0, 0.0]"}
    case = loads(BLOCK.format(**place, stiffness=stiffness, friction=COULOMB, steps=steps) + across)
    found = st.steady_sliding(case)
    assert found.status.tolist() == [STICK]
    assert found.displacement[0] == pytest.approx(force / 1000.0, rel=1e-9)
    assert found.friction_force[0, 0] == pytest.approx(0.0, abs=1e-9)


TRACTRIX = """
[springs.y]
between = ["block", "ground"]
stiffness = 1000.0
direction = [0.0, 1.0, 0.0]
[loads.y]
at = "block"
force = [0.0, 1.0, 0.0]
"""


def test_in_space_a_slider_is_drawn_along_a_tractrix():
    # Equal springs of free ends X: the block follows X at the distance ℓ = μN/k, always towards it.
    place = {"at": "[0.0, 0.0, 0.0]", "up": "[0.0, 0.0, 1.0]", "down": "[0.0, 0.0, -10.0]", "x": "[1.0, 0.0, 0.0]"}
    length, way = 0.003, 0.006
    angle = 2 * math.atan(math.exp(-way / length))
    exact = np.array([0.005 - length * math.sin(angle), way - length * math.cos(angle)])
    errors = []
    for increments in (20, 40):
        steps = f"{{ loads = {{ x = 5.0, y = 0.0 }} }}, {{ loads = {{ y = 6.0 }}, increments = {increments} }}"
        text = BLOCK.format(**place, stiffness='"rigid"', friction=COULOMB, steps=steps)
        text = text.replace("x = 0.0 }", "x = 0.0, y = 0.0 }")
        found = st.steady_sliding(loads(text + TRACTRIX))
        assert np.linalg.norm(found.friction_force) == pytest.approx(3.0, rel=1e-9)
        errors.append(found.displacement[:2] - exact)
    assert np.abs(errors[0]).max() < 0.02 * length
    # Backward steps are of first order; extrapolated, the curve itself.
    assert 2 * errors[1] - errors[0] == pytest.approx([0.0, 0.0], abs=5e-4 * length)


def test_a_support_that_moves_a_little_drags_and_then_slips():
    # A floor under the block: 2 mm at 0.5 m/s stretch the spring by 2 N, 10 mm by no more than 3 N.
    place = {"at": "[0.0, 0.0]", "down": "[0.0, -10.0]", "x": "[1.0, 0.0]"}
    up = "[0.0, 1.0]\nsliding = { velocity = [0.5, 0.0] }"
    still = "steps = [{ loads = { x = 0.0 }, velocities = { floor = 0.0 }, increments = 1 }"
    for run, moved, status, seconds in (
        ("duration = 0.004, increments = 2", 0.002, STICK, 0.004),
        ("duration = 0.02, increments = 2", 0.003, SLIP, 0.02),
        ("increments = 1", 0.003, SLIP, 0.0),  # until it slides
    ):
        text = BLOCK.format(
            **place, up=up, stiffness='"rigid"', friction=COULOMB, steps=f"{{ velocities = {{ floor = 1.0 }}, {run} }}"
        )
        found = st.steady_sliding(loads(text.replace("steps = [{ loads = { x = 0.0 }, increments = 1 }", still)))
        assert found.displacement[0] == pytest.approx(moved, rel=1e-9)
        assert found.status.tolist() == [status]
        assert found.travel == pytest.approx([seconds], rel=1e-12)
        assert found.slip_velocity[0, 0] == (0.0 if seconds else -0.5)


def graded(near: float, far: float, size: float) -> np.ndarray:
    """Coordinates from 0, even up to near, then wider and wider to far."""
    x = [0.0]
    while x[-1] < far:
        size *= 1.0 if x[-1] < near - 1e-9 else 1.35
        x.append(x[-1] + size)
    return np.array(x)


def cylinder_on_a_flat(elements: int, mu: float, *steps: tuple[dict[str, float], int]) -> tuple[System, np.ndarray, float]:
    """Two equal elastic half planes pressed to a contact of half width 1 m, elements of 1/elements there.

    The upper one moves as a whole at its far side, where it is pressed with P and pulled with μP. Returns the system,
    the places x of its contact nodes, and P. (Equal materials: pressing slides nothing.)
    """
    young, poisson, radius = 2e11, 0.3, 1e3
    near = graded(1.25, 15.0, 1.0 / elements)
    mesh = skfem.MeshQuad.init_tensor(np.concatenate([-near[:0:-1], near]), graded(0.5, 15.0, 1.0 / elements))
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementQuad1()))
    stiffness = sp.csr_array(linear_elasticity(*lame_parameters(young, poisson)).assemble(basis))
    far = np.isclose(basis.doflocs[1], mesh.p[1].max())
    component = np.zeros(basis.N, dtype=int)
    component[basis.nodal_dofs[1]] = 1
    inner = int(np.count_nonzero(~far))
    column = np.where(far, inner + component, np.cumsum(~far) - 1)
    upper = sp.csr_array((np.ones(basis.N), (np.arange(basis.N), column)))
    lower = sp.csr_array(upper[:, :inner])  # a mirror image, held at its far side
    touched = np.flatnonzero(np.isclose(mesh.p[1], 0.0))
    touched = touched[np.argsort(mesh.p[0, touched])]
    x, rows = mesh.p[0, touched], basis.nodal_dofs[:, touched].T.ravel()
    mirror = sp.diags_array(np.tile([1.0, -1.0], len(x)))
    n = 2 * inner + 2
    slave = sp.csr_array(sp.hstack([upper[rows], -mirror @ lower[rows]]))
    area = (np.diff(x, prepend=x[0]) + np.diff(x, append=x[-1])) / 2
    surface = on_a_flat(
        slave, np.stack([x, 0 * x], axis=1), area, np.zeros((len(x), 2)), gap=x**2 / (2 * radius), law=Coulomb(mu)
    )
    force = math.pi * young / (2 * (1 - poisson**2)) / (4 * radius)  # a² = 4 P R/π E*
    press, pull = np.zeros(n), np.zeros(n)
    press[inner + 1], pull[inner] = -force, mu * force
    whole = sp.csr_array(sp.block_diag([upper.T @ stiffness @ upper, lower.T @ stiffness @ lower]))
    history = tuple(LoadStep(factors, np.zeros(1), None, increments) for factors, increments in steps)
    return (
        System(
            sp.csr_array(sp.eye_array(n)), sp.csr_array((n, n)), whole, (), {"press": press, "pull": pull}, moving(n),
            surfaces=(surface,), load_steps=history,
        ),
        x,
        force,
    )  # fmt: skip


def ellipse(x: np.ndarray, half: float) -> np.ndarray:
    return np.sqrt(np.clip(1 - (x / half) ** 2, 0.0, None)) * half


def traction(found: SteadySliding, system: System) -> np.ndarray:
    return -found.friction_force[:, 0] / system.contact_nodes().area


PRESS = ({"press": 1.0, "pull": 0.0}, 2)


@pytest.mark.parametrize("part", [pytest.param(0.3, marks=pytest.mark.slow), 0.7])
def test_a_cylinder_pulled_sideways_slips_as_cattaneo_and_mindlin_say(part):
    mu, elements = 0.4, 20
    system, x, force = cylinder_on_a_flat(elements, mu, PRESS, ({"press": 1.0, "pull": part}, 3))
    found = steady_sliding(system)
    stick = math.sqrt(1 - part)
    largest = 2 * force / math.pi
    assert np.abs(x[found.status == STICK]).max() == pytest.approx(stick, abs=1.0 / elements)
    assert np.abs(x[found.active]).max() == pytest.approx(1.0, abs=1.0 / elements)
    exact = mu * largest * (ellipse(x, 1.0) - ellipse(x, stick))
    away = np.abs(np.abs(x) - 1.0) > 1.5 / elements  # the pressure's root at the edge is beyond linear elements
    assert np.abs(traction(found, system) - exact)[away].max() < 0.02 * mu * largest
    assert found.friction_force.sum() == pytest.approx(-part * mu * force, rel=1e-9)


def test_unloading_slips_back_in_an_annulus_of_its_own():
    # Mindlin and Deresiewicz: from Q₁ back to Q₂ the new annulus ends at √(1 − (Q₁ − Q₂)/2μP), and q = q₁ − 2 q_new.
    mu, elements, high, low = 0.4, 20, 0.7, 0.1
    system, x, force = cylinder_on_a_flat(
        elements, mu, PRESS, ({"press": 1.0, "pull": high}, 3), ({"press": 1.0, "pull": low}, 3)
    )
    found = steady_sliding(system)
    first, second = math.sqrt(1 - high), math.sqrt(1 - (high - low) / 2)
    exact = ellipse(x, 1.0) - ellipse(x, first) - 2 * (ellipse(x, 1.0) - ellipse(x, second))
    largest = 2 * force / math.pi
    back = x[(found.status == SLIP)]
    assert np.abs(back).min() == pytest.approx(second, abs=1.0 / elements)
    away = np.abs(np.abs(x) - 1.0) > 1.5 / elements
    assert np.abs(traction(found, system) / (mu * largest) - exact)[away].max() < 0.03


PAD = Path(__file__).parent / "pad_at_an_abutment.toml"


def dense_modes(system: System, found: SteadySliding, mu: float | np.ndarray) -> np.ndarray:
    """Eigenvalues by elimination of everything that contact holds, friction on the sliding nodes alone; mu: of all
    nodes, or of each (m, 1)."""
    nodes = system.contact_nodes()
    touch, stick, rigid = found.status != OPEN, found.status == STICK, nodes.compliance == 0.0
    normal, tangent = nodes.normal.toarray(), nodes.tangent.toarray()
    push = normal + mu * found.sense * tangent
    springs = touch & ~rigid
    stiffness = system.stiffness.toarray() + push[springs].T / nodes.compliance[springs] @ normal[springs]

    def free_of(rows: np.ndarray) -> np.ndarray:
        _, size, vectors = np.linalg.svd(rows)
        return vectors[np.count_nonzero(size > 1e-9) :].T

    motion = free_of(np.vstack([normal[touch & rigid], tangent[stick]]))
    test = free_of(np.vstack([push[touch & rigid], tangent[stick]]))
    mass, damping, stiffness = (
        test.T @ m @ motion for m in (system.mass.toarray(), system.damping.toarray(), stiffness)
    )
    n = len(mass)
    lower = np.linalg.solve(mass, np.hstack([-stiffness, -damping]))
    values = np.linalg.eigvals(np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), lower]))
    values = values[values.imag > 1.0]
    return values[np.argsort(values.imag)]


@pytest.mark.parametrize("stiffness", [pytest.param("rigid", marks=pytest.mark.slow), 1e13])
def test_modes_hold_the_nodes_that_stick(stiffness):
    case = st.load(PAD).with_({"contacts.rub.stiffness": stiffness})
    found, system = st.steady_sliding(case, 0.4), st.build_system(case)
    assert set(found.status.tolist()) >= {STICK, SLIP}
    modes = st.modes(case, 0.4, count=6)
    assert modes.eigenvalues[0] == pytest.approx(dense_modes(system, found, 0.4)[:6], rel=1e-7)
    assert f"{np.count_nonzero(found.status == STICK)} contact nodes stick" in modes.contact_state
    assert "at μ = 0.4" in modes.contact_state


def test_modes_without_a_coefficient_have_that_of_a_contact_that_no_support_moves():
    """The abutment sticks or slips by what the pad does, and has a coefficient of its own all the same."""
    case = st.load(PAD).with_({"contacts.rub.stiffness": 1e13})
    found, system = st.steady_sliding(case), st.build_system(case)
    own = found.friction_coefficient[:, None]
    assert set(own.ravel().tolist()) == {0.4, 0.6}
    modes, together = st.modes(case, count=6), st.modes(case, 0.4, count=6)
    assert modes.eigenvalues[0] == pytest.approx(dense_modes(system, found, own)[:6], rel=1e-7)
    assert np.abs(modes.eigenvalues[0] / together.eigenvalues[0] - 1.0).max() > 1e-3
    assert f"{np.count_nonzero(found.status == STICK)} contact nodes stick" in modes.contact_state


def test_the_time_loop_rests_on_what_sticks_and_grows_as_the_modes_say():
    case = st.load(PAD).with_(
        {
            "bodies.pad.points": {"side": [0.06, 0.015]},
            "contacts.abutment.slave": "pad.side",
            "temporal.initial": "steady-sliding",
            "phases": [{"name": "slide", "duration": 2e-5}],
        }
    )
    system, mu = st.build_system(case), 0.3
    run = st.simulate(case, mu)
    assert run.nodes is not None
    assert run.nodes.status[:, -1].tolist() == [STICK] * len(run.nodes.time)
    force = run.nodes.tangential_force
    assert np.abs(force - force[0]).max() < 1e-10 * run.nodes.normal_force.max()
    modes = modes_as_in_time(system, mu, 15e3)
    fastest = modes.eigenvalues[0][np.argmax(modes.growth_rate[0])]
    errors = []
    for step in (2e-6, 1e-6):
        settings = Settings(step=step)
        found = perturb(system, mu, settings=settings, max_frequency_hz=15e3, modes=modes).eigenvalue
        errors.append((abs(found.real / fastest.real - 1), abs(found.imag / fastest.imag - 1)))
    assert errors[1][0] < 5e-3
    assert errors[1][1] < 0.3 * errors[0][1]
    assert errors[1][1] < 5e-4


def test_the_abutment_carries_what_friction_brings():
    found = st.steady_sliding(st.load(PAD))
    rub, wall = (found.resultants[name].force for name in ("rub", "abutment"))
    assert rub[0] == pytest.approx(0.4 * rub[1], rel=1e-9)
    assert rub + wall == pytest.approx([0.0, 3000.0], rel=1e-9, abs=1e-6)
    assert found.balance.force_error < 1e-12
    assert found.balance.moment_error < 1e-12
    limit = np.array([0.4, 0.6])[st.build_system(st.load(PAD)).contact_nodes().owner] * found.normal_force
    assert np.all(np.abs(found.friction_force[:, 0]) <= limit * (1 + 1e-9) + 1e-9)


def test_what_friction_cannot_hold_is_said():
    free = block("{ loads = { x = 2.0 } }, { loads = { x = 4.0 }, increments = 4 }").with_({"springs": None})
    with pytest.raises(AnalysisError, match=r"step 3, increment 3 of 4: friction at its limit does not hold the loads"):
        st.steady_sliding(free)


def test_what_does_not_know_stick_refuses():
    case = st.load(PAD)
    with pytest.raises(AnalysisError, match="ranking of countermeasures: knows contacts that slide"):
        st.rank_countermeasures(case)
    with pytest.raises(AnalysisError, match="reduced models over parameters: knows contacts that slide"):
        st.reduced_model(case, {"mu": (0.1, 0.5)})
    half = {"name": "run", "duration": 1e-5, "loads": {"press": 0.5}}
    ended = case.with_({"phases": [half], "temporal.initial": "steady-sliding"})
    with pytest.raises(AnalysisError, match=r"ends with 1 times load press, and 0.5 times is asked for"):
        st.simulate(ended)


@pytest.mark.bad_input
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"steady.friction": "sliding", "steady.steps": [{}]}, "load steps have no effect where every contact slides"),
        ({"steady.steps": [{"loads": {"pres": 1.0}}]}, "pres"),
        ({"steady.steps": [{"velocities": {"press": 1.0}}]}, "support with a velocity"),
        ({"steady.steps": [{"increments": 0}]}, "a whole number >= 1"),
        ({"steady.friction": "stick"}, "stick-slip"),
    ],
)
def test_settings_of_load_steps_are_checked(change, message):
    with pytest.raises(CaseError, match=message):
        st.load(PAD).with_(change)


def test_the_program_counts_and_writes_what_sticks(tmp_path):
    result = CliRunner().invoke(app, ["steady", str(PAD), "--out", str(tmp_path), "--json"])
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    found = st.steady_sliding(st.load(PAD))
    codes = {"open": OPEN, "stick": STICK, "slip": SLIP}
    assert document["status"] == {name: int(np.count_nonzero(found.status == code)) for name, code in codes.items()}
    assert any(name.endswith("steady.vtu") for name in document["files"])


def test_onsets_where_a_contact_with_friction_is_moved_by_nothing():
    """It slides at no friction alone, which is no range."""
    tables = st.load(PAD).model_dump(mode="json", exclude_none=True)
    tables["steady"] = {}
    with pytest.raises(AnalysisError, match="contact abutment does not slide: no support moves"):
        st.onsets(st.Case.model_validate(tables), (0.0, 0.5))
