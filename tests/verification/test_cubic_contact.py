"""Contact whose stiffness grows with the approach, p = kδ + k₃δ³: static, in modes and in time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import stridor as st
from stridor.case import loads
from stridor.errors import AnalysisError, CaseError
from stridor.sliding import steady_sliding
from stridor.temporal.energy import energy_balance

pytestmark = pytest.mark.verification

MASS, STIFFNESS, CUBIC, LOAD = 2.0, 1e4, 1e9, 100.0


def pressed(**changes: object) -> st.Case:
    """A mass on a layer, pressed with 100 N; a soft spring holds it sideways."""
    return loads(f"""
[bodies.block]
type = "mass"
mass = {MASS}
position = [0.0, 0.0]
[bodies.belt]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [0.0, 1.0]
sliding = {{ velocity = [1.0, 0.0] }}
[springs.side]
between = ["block", "ground"]
stiffness = 1000.0
direction = [1.0, 0.0]
[loads.press]
at = "block"
force = [0.0, -{LOAD}]
[contacts.layer]
slave = "block"
master = "belt"
stiffness = {STIFFNESS}
cubic = {CUBIC}
friction = {{ law = "coulomb", coefficient = 0.2 }}
[[phases]]
name = "swing"
duration = 0.1
[temporal]
record_every = 1
watch = ["block"]
[modal]
max_frequency_hz = 100.0
""").with_(changes)


def approach(force: float) -> float:
    return float(brentq(lambda d: STIFFNESS * d + CUBIC * d**3 - force, 0.0, 1.0, xtol=1e-16))


def test_a_mass_on_a_layer_that_hardens():
    case, depth = pressed(), approach(LOAD)
    found = st.steady_sliding(case)
    assert found.displacement[1] == pytest.approx(-depth, rel=1e-12)
    assert found.normal_force == pytest.approx([LOAD], rel=1e-12)
    assert found.friction_force[0, 0] == pytest.approx(0.2 * LOAD, rel=1e-12)
    assert found.residual < 1e-14
    tangent = math.sqrt((STIFFNESS + 3 * CUBIC * depth**2) / MASS) / (2 * math.pi)
    mus = np.linspace(0.0, 1.0, 6)
    assert st.modes(case, mus).frequency_hz.max() == pytest.approx(tangent, rel=1e-12)
    # Under another load it has another frequency; without a load nothing tells it.
    heavier = pressed(**{"loads.press.force": [0.0, -1000.0]})
    harder = math.sqrt((STIFFNESS + 3 * CUBIC * approach(1000.0) ** 2) / MASS) / (2 * math.pi)
    assert st.modes(heavier, mus).frequency_hz.max() == pytest.approx(harder, rel=1e-12)
    with pytest.raises(AnalysisError, match="contact stiffness with a cubic term needs the normal force"):
        st.modes(pressed(loads=None))


@pytest.mark.parametrize("throw", [1.02, 2.5])  # within the layer, and off it
def test_it_swings_as_the_equation_of_motion_says(throw):
    depth = approach(LOAD)
    case = pressed(
        **{"bodies.block.initial_displacement": [0.0, -throw * depth], "temporal.step": 2e-5},
        **{"contacts.layer.friction.coefficient": 0.0},
    )
    run = st.simulate(case)

    def motion(_: float, z: np.ndarray) -> list[float]:
        d = max(-z[0], 0.0)
        return [z[1], (STIFFNESS * d + CUBIC * d**3 - LOAD) / MASS]

    def middle(_: float, z: np.ndarray) -> float:
        return z[0] + depth

    middle.direction = 1.0  # type: ignore[attr-defined]
    exact = solve_ivp(motion, (0, 0.1), [-throw * depth, 0.0], rtol=1e-11, atol=1e-15, events=middle).t_events[0]
    y, t = run.displacement[:, 0, 1] + depth, run.time
    k = np.flatnonzero((y[:-1] < 0) & (y[1:] >= 0))
    found = t[k] - y[k] * (t[k + 1] - t[k]) / (y[k + 1] - y[k])
    assert len(found) == len(exact) >= 2
    # The first step is that of a run from rest, half a step early; periods do not feel it.
    assert np.diff(found) == pytest.approx(np.diff(exact), rel=2e-5)
    assert energy_balance(run).error < 1e-10


PAD = """
materials.lining = { young_modulus = 5e9, density = 2500.0, poisson_ratio = 0.3 }
[bodies.pad]
type = "solid"
material = "lining"
model = "plane strain"
thickness = 0.05
mesh = { shape = "rectangle", corner = [0.0, 0.0], size = [0.06, 0.03], divisions = [6, 3], cells = "quad" }
damping = { mass = 10.0, stiffness = 1e-8 }
[bodies.belt]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [0.0, 1.0]
sliding = { velocity = [2.0, 0.0] }
[supports.back]
at = "pad.top"
fixed = ["x"]
[loads.press]
at = "pad.top"
pressure = 1e6
[contacts.rub]
slave = "pad.bottom"
master = "belt"
stiffness = 1e11
cubic = 1e22
friction = { law = "coulomb", coefficient = 0.4 }
[modal]
max_frequency_hz = 30e3
"""


def dense(case: st.Case, mu: float) -> np.ndarray:
    """Eigenvalues with springs of the tangent stiffness at each node's force, from full matrices."""
    system = st.build_system(case)
    found, nodes = steady_sliding(system, mu=mu), system.contact_nodes()
    depth = np.maximum(-found.gap, 0.0)
    assert found.normal_force == pytest.approx(nodes.area * (1e11 * depth + 1e22 * depth**3), rel=1e-9)
    tangent = nodes.area * (1e11 + 3e22 * depth**2)
    assert np.max(tangent[found.active]) > 1.5e11 * nodes.area.min()
    push = (nodes.normal + nodes.along(mu * found.sense)).toarray()
    act = found.active
    stiffness = system.stiffness.toarray() + push[act].T * tangent[act] @ nodes.normal.toarray()[act]
    n = system.size
    inverse = np.linalg.inv(system.mass.toarray())
    lower = np.hstack([-inverse @ stiffness, -inverse @ system.damping.toarray()])
    values = np.linalg.eigvals(np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), lower]))
    values = values[(values.imag > 1.0) & (values.imag < 2 * np.pi * 30e3)]
    return values[np.argsort(values.imag)]


@pytest.mark.slow
def test_modes_of_a_pad_have_the_stiffness_that_its_pressure_gives():
    case = loads(PAD)
    for values in ([0.4], [0.1, 0.3]):  # alone, and along branches with the nodes of 0.4, which all touch
        found = st.modes(case, values, max_frequency_hz=30e3)
        for row, mu in enumerate(values):
            exact = dense(case, mu)
            own = found.eigenvalues[row]
            own = own[np.argsort(own.imag)]
            assert own[: len(exact)] == pytest.approx(exact[: len(own)], rel=1e-7)
            assert np.nanmax(found.residual) < 1e-9


@pytest.mark.slow
def test_slopes_follow_the_stiffness_that_changes_with_the_load():
    case, path, step = loads(PAD), "loads.press.pressure", 1e3
    found = st.sensitivities(case, [path], mu=0.4, modes="all", count=2)
    ahead, behind = (st.modes(case.with_({path: 1e6 + s}), 0.4, count=2).eigenvalues[0] for s in (step, -step))
    ahead, behind = (np.array([v[np.argmin(np.abs(v - lam))] for lam in found.eigenvalues]) for v in (ahead, behind))
    assert found.derivative[0] == pytest.approx((ahead - behind) / (2 * step), rel=1e-4)


def test_what_takes_no_cubic_term_says_so():
    with pytest.raises(CaseError, match="rigid contact has no approach to take the cube of"):
        pressed(**{"contacts.layer.stiffness": "rigid"})
    with pytest.raises(AnalysisError, match=r"contacts.NAME.cubic makes it depend on the force"):
        st.reduced_model(loads(PAD), {"mu": (0.1, 0.5)})
    assert any("times the cube of the approach" in line for line in st.describe(pressed()).lines)


SOFT, HARD = 2 / 3 * (2 - math.sqrt(3)), 2 / 3 * (2 + math.sqrt(3))
ALONG = np.array([[-math.sqrt(3) / 2, 0.5], [math.sqrt(3) / 2, 0.5]])
LAYER, DRAG = 4 / 3, 0.02


def sprung(cubic: float, load: float) -> st.Case:
    """The mass of two oblique springs on a belt, which are cubic, too."""
    springs = {
        name: {"between": ("m", "ground"), "direction": tuple(along), "stiffness": k, "cubic": k3}
        for name, along, k, k3 in zip("ab", ALONG, (SOFT, HARD), (cubic, cubic / 2), strict=True)
    }
    return st.Case(
        units="nondimensional",
        bodies={
            "m": {"type": "mass", "mass": 1.0, "position": (0, 0)},
            "belt": {
                "type": "obstacle", "shape": "flat", "point": (0, 0), "normal": (0, 1), "sliding": {"velocity": (-5, 0)}
            },
        },
        springs=springs,
        dashpots={
            n: {"between": ("m", "ground"), "direction": d, "damping": DRAG} for n, d in (("x", (1, 0)), ("y", (0, 1)))
        },
        loads={"press": {"at": "m", "force": (0, -load)}},
        contacts={
            "rub": {
                "slave": "m", "master": "belt", "stiffness": LAYER, "friction": {"law": "coulomb", "coefficient": 0.3}
            }
        },
        modal={"max_frequency_hz": 1.0, "friction_range": (0, 2)},
    )  # fmt: skip


def by_hand(cubic: float, load: float, mu: float) -> np.ndarray:
    """Eigenvalues about the equilibrium, Im λ > 0: springs have the stiffness k + 3 k₃ s² of small motions about it."""
    factor, stiffness = np.array([cubic, cubic / 2]), np.array([SOFT, HARD])
    rub = LAYER * np.outer([-mu, 1.0], [0.0, 1.0])  # forces on the mass: N upwards and −μN along x, N = −k y
    u = np.zeros(2)
    for _ in range(60):
        s = ALONG @ u
        tangent = ALONG.T @ np.diag(stiffness + 3 * factor * s**2) @ ALONG + rub
        u = u - np.linalg.solve(tangent, ALONG.T @ (stiffness * s + factor * s**3) + rub @ u + [0.0, load])
    values = np.linalg.eigvals(np.block([[np.zeros((2, 2)), np.eye(2)], [-tangent, -DRAG * np.eye(2)]]))
    return values[values.imag > 0]


@pytest.mark.parametrize(
    ("cubic", "load"),
    [(0.0, 1.0), (0.5, 1.0), *(pytest.param(*of, marks=pytest.mark.slow) for of in ((0.1, 2.0), (50.0, 1.0), (5.0, 1.0)))],
)
def test_springs_that_steady_sliding_stretches_are_stiffer(cubic: float, load: float):
    case = sprung(cubic, load)
    for source in (None, "full") if cubic == 5.0 else (None,):
        modal = {} if source is None else {"modal.source": source}
        for mu in (0.0, 0.4, 1.0):
            found, truth = st.modes(case.with_(modal), mu).eigenvalues[0], by_hand(cubic, load, mu)
            assert len(found) == len(truth) == 2
            assert np.abs(truth[:, None] - found).min(axis=1).max() < 1e-9
    grid = np.linspace(0.0, 2.0, 201)
    grows = [by_hand(cubic, load, mu).real.max() > 0 for mu in grid]
    begins = [
        brentq(lambda mu: by_hand(cubic, load, mu).real.max(), *grid[k : k + 2], xtol=1e-14)
        for k in range(200) if grows[k] != grows[k + 1]
    ]  # fmt: skip
    assert [o.mu for o in st.onsets(case).onsets] == pytest.approx(begins, rel=1e-9)


def test_growth_in_time_is_that_of_stretched_springs():
    compared = st.compare(sprung(5.0, 1.0).with_({"temporal.step": 0.005}), [1.0], only=["growth"])
    assert [one.agrees for one in compared.comparisons] == [True]
