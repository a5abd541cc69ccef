"""The β2 scheme without contacts: against the equations as printed, closed forms, its order and its limit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp

from benches import Slave, bench, paper_case
from marching import one_phase, paper_scheme, points_of, rod, run
from stridor.errors import AnalysisError, CaseError
from stridor.system import System, build_system
from stridor.system.motion import Constraint, FreeStructure, constrain
from stridor.temporal.beta2 import step_limit
from stridor.temporal.schedule import PhaseSpec, lay_out
from stridor.temporal.simulate import Settings, simulate
from stridor.temporal.steppers.modal import stepper as in_modes
from stridor.temporal.steppers.sparse import stepper as on_freedoms

pytestmark = pytest.mark.verification

PATHS = ("modal", "nodal")


@contextmanager
def any_step() -> Iterator[None]:
    """Steps beyond the limit, which are refused."""
    with ExitStack() as patches:
        for engine in (in_modes, on_freedoms):
            patches.enter_context(mock.patch.object(engine, "choose_step", lambda limit, settings: settings.step))
        yield


def oscillator(omega=1.0, damping=0.0, load=None) -> System:
    return System(
        np.eye(1),
        np.full((1, 1), damping),
        np.full((1, 1), omega**2),
        (),
        load or {},
        points=points_of(1, mass=0),
    )


def chain(damping=(0.3, 0.02), size=4) -> System:
    """A rod of a few elements, free at both ends, Rayleigh damped, pushed at its first node."""
    mass, stiffness = rod(1.0, 1.0, 1.0, 1.0, size)
    push = np.zeros(size + 1)
    push[0] = 1.0
    nodes = {f"n{i}": i for i in range(size + 1)}
    return System(
        mass, damping[0] * mass + damping[1] * stiffness, stiffness, (), {"push": push},
        points=points_of(size + 1, **nodes),
    )  # fmt: skip


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("beta2", [0.5, 0.6, 0.75, 1.0])
def test_loop_is_the_scheme_as_printed(beta2, path):
    """u, v and a of eqs 9–10, solved as three unknowns a step, for a load that comes by a ramp and leaves
    suddenly."""
    system = chain()
    step = 0.4 * step_limit(system, beta2).step
    phases = [
        PhaseSpec("on", 30 * step, {"push": 1.5}, {}, 12 * step),
        PhaseSpec("off", 30 * step, {"push": 0.0}, {}),
    ]
    settings = Settings(step=step, beta2=beta2, record_every=1, path=path, watch=tuple(system.points))
    result = simulate(system, phases, settings)
    factors = lay_out(phases, step, ["push"], []).load_factors(0, 60)
    u, v, a = paper_scheme(system, step, beta2, factors * system.loads["push"], 60)
    for found, expected in ((result.displacement, u[:-1]), (result.velocity, v), (result.acceleration, a)):
        assert np.abs(found[:, :, 0] - expected).max() < 1e-11 * np.abs(expected).max()
    assert np.abs(u).max() > 0.1  # it did move


@pytest.mark.parametrize("beta2", [0.5, 0.8])
@pytest.mark.parametrize("path", PATHS)
def test_moving_support_is_the_scheme_as_printed(beta2, path):
    """Node 0 of a rod is moved: eq. 9 for all freedoms with the support's u, v, a known must hold at the
    others."""
    mass, stiffness = rod(1.0, 1.0, 1.0, 1.0, 4)
    damping = 0.3 * mass + 0.02 * stiffness
    structure = FreeStructure(*(sp.csr_array(x) for x in (mass, damping, stiffness)))
    free, motion = constrain(structure, [Constraint("end", (0,), (2.0,))])
    system = System(
        mass[np.ix_(free, free)], damping[np.ix_(free, free)], stiffness[np.ix_(free, free)], motion=motion,
        points=points_of(4, a=0, b=1, c=2, d=3),
    )  # fmt: skip
    # Absolute motion of the points: rows act on w, the lift adds the support's.
    lifted = {
        name: replace(rows, lift=np.asarray(rows.free @ motion.lift)) for name, rows in system.points.items()
    }
    system = replace(system, points=lifted)
    step = 0.4 * step_limit(system, beta2).step
    phases = [PhaseSpec("go", 50 * step, {}, {"end": 1.0}, 20 * step)]
    settings = Settings(step=step, beta2=beta2, record_every=1, path=path, watch=tuple(lifted))
    result = simulate(system, phases, settings)
    # The support by itself: positions from the schedule, v and a by eq. 10.
    increments = 2.0 * lay_out(phases, step, [], ["end"]).motion_increments(0, 50)[:, 0]
    before_v = before_a = 0.0
    at = np.zeros(50)
    speed, acceleration = np.zeros(50), np.zeros(50)
    place = 0.0
    for n, d in enumerate(increments):
        at[n] = place
        before_v = (before_v + step * (1 - beta2) * before_a + 2 * beta2 * d / step) / (1 + 2 * beta2)
        before_a = 2 / step**2 * (d - step * before_v)
        speed[n], acceleration[n] = before_v, before_a
        place += d
    forces = -sum(np.outer(x, m[1:, 0]) for x, m in ((acceleration, mass), (speed, damping), (at, stiffness)))
    u, v, a = paper_scheme(system, step, beta2, forces, 50)
    for found, expected in ((result.displacement, u[:-1]), (result.velocity, v), (result.acceleration, a)):
        assert np.abs(found[:, :, 0] - expected).max() < 1e-11 * np.abs(expected).max()


@pytest.mark.parametrize("path", PATHS)
def test_central_differences_by_their_own_recursion(path):
    """β2 = 1/2: M (u₊ − 2u + u₋)/Δt² + C (u₊ − u₋)/2Δt + K u = f, on a leaning beam with consistent mass."""
    system = bench(Slave(lean_deg=20.0, elements=4), elements=4, velocity=0.0)
    system = replace(system, contacts=())
    step, steps = 0.8 * step_limit(system, 0.5).step, 400
    result = run(system, steps * step, step=step, path=path, watch=("s0.start", "s0.end"))
    m, c, k = (x.toarray() for x in (system.mass, system.damping, system.stiffness))
    left = sl.lu_factor(m / step**2 + c / (2 * step))
    f = system.loads["press0"]
    u = np.zeros((steps + 1, system.size))
    before = np.zeros(system.size)
    for n in range(steps):
        right = f - k @ u[n] + m @ (2 * u[n] - before) / step**2 + c @ before / (2 * step)
        u[n + 1], before = sl.lu_solve(left, right), u[n]
    for w, name in enumerate(("s0.start", "s0.end")):
        expected = (system.points[name].free[:2] @ u[:-1].T).T
        assert np.abs(result.displacement[:, w] - expected).max() < 1e-8 * np.abs(expected).max()


def slope(errors, steps) -> float:
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


@pytest.mark.parametrize("damping", [0.0, 0.2])
@pytest.mark.parametrize("path", PATHS)
def test_order_two_in_free_vibration(damping, path):
    """u(2) of ü + c u̇ + u = 0 from u = 1, v = 1/2."""
    system = oscillator(damping=damping)
    wd = math.sqrt(1 - damping**2 / 4)
    exact = math.exp(-damping) * (math.cos(2 * wd) + (0.5 + damping / 2) / wd * math.sin(2 * wd))
    errors, steps = [], [0.1, 0.05, 0.025, 0.0125]
    for step in steps:
        start = (1.0, 0.5, -1.0 - 0.5 * damping)
        result = run(system, 2.5, start=start, step=step, path=path, watch=("mass",))
        errors.append(abs(result.displacement[round(2 / step), 0, 0] - exact))
    assert slope(errors, steps) == pytest.approx(2.0, abs=0.05)
    assert errors[-1] < 1e-4


def test_order_two_under_a_smooth_load():
    """A load by ramp, through simulate alone: against the scheme's own limit by Richardson, and the static
    end."""
    system = oscillator(damping=0.5, load={"push": np.ones(1)})
    ends = []
    for step in (0.1, 0.05, 0.025):
        result = run(system, 3.0 + step, ramp=2.0, step=step, watch=("mass",))
        ends.append(result.displacement[round(3 / step), 0, 0])
    assert (ends[0] - ends[1]) / (ends[1] - ends[2]) == pytest.approx(4.0, rel=0.05)
    long = run(system, 80.0, ramp=2.0, step=0.05, watch=("mass",))
    assert long.displacement[-1, 0, 0] == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize("damping", [0.0, 0.3])
@pytest.mark.parametrize("beta2", [0.5, 0.7, 1.0])
@pytest.mark.parametrize("path", PATHS)
def test_amplification_matrix(beta2, damping, path):
    """Trace and determinant of the step in closed form, with e = 1 + β2 Δt c, s = 1 + 2β2 and Ω = ωΔt:

    trace = 1 + (2β2−1)/s + 2 (1 − cΔt/2)/(s e) − s Ω²/(2e),
    determinant = (2β2−1)/s (1 − s Ω²/(2e)) + 2 (1 − cΔt/2)/(s e).
    """
    step = 0.9
    system = oscillator(damping=damping)
    result = run(system, 60 * step, start=(1.0, 0.3, 0.0), step=step, beta2=beta2, path=path, watch=("mass",))
    u = result.displacement[:, 0, 0]
    s, e = 1 + 2 * beta2, 1 + beta2 * step * damping
    memory = (2 * beta2 - 1) / s
    slow = 2 * (1 - damping * step / 2) / (s * e)
    stiff = s * step**2 / (2 * e)
    trace, determinant = 1 + memory + slow - stiff, memory * (1 - stiff) + slow
    assert np.abs(u[2:] - trace * u[1:-1] + determinant * u[:-2]).max() < 1e-13
    if damping == 0.0:
        # Numerical damping: |z|² = 1 − (β2 − 1/2) Ω², none for β2 = 1/2.
        assert determinant == pytest.approx(1 - (beta2 - 0.5) * step**2, rel=1e-12)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("beta2", [0.75, *(pytest.param(b, marks=pytest.mark.slow) for b in (0.5, 1.0))])
def test_stable_just_below_the_limit_and_not_just_above(beta2, path):
    """The undamped limit √(2/β2)/ω_max: bounded at 0.999 of it, gone at 1.001."""
    system = chain(damping=(0.0, 0.0))
    limit = step_limit(system, beta2)
    omega = math.sqrt(sl.eigh(system.stiffness.toarray(), system.mass.toarray(), eigvals_only=True)[-1])
    assert limit.step == pytest.approx(math.sqrt(2 / beta2) / omega, rel=1e-12)
    start = np.array([1.0, -1.0, 1.0, -1.0, 1.0])
    steps = 800_000
    common = {
        "loads": {"push": 0.0},
        "start": (start, 0.0, 0.0),
        "beta2": beta2,
        "path": path,
        "record_every": 97,
    }
    step = 0.999 * limit.step
    below = run(system, steps * step, step=step, watch=("n0", "n2"), **common)
    assert np.abs(below.displacement).max() < 200.0
    # The limit is refused beforehand, so let it pass to see what it guards against.
    step = 1.001 * limit.step
    with (
        any_step(),
        pytest.raises(AnalysisError, match=r"no longer finite.*phase run.*too large for this model") as error,
    ):
        run(system, steps * step, step=step, watch=("n0",), **common)
    kept = error.value.trajectory.displacement[:, 0, 0]
    # What was computed is kept, and it grew by many orders.
    assert np.isfinite(kept).all()
    assert np.abs(kept).max() > 1e100


@pytest.mark.parametrize("path", PATHS)
def test_blow_up_is_noticed_between_records(path):
    """No record is due after the first, and no row sees the motion."""
    mass, stiffness = rod(1.0, 1.0, 1.0, 1.0, 4)
    system = System(mass, 0 * mass, stiffness)
    step = 1.1 * step_limit(system, 0.5).step
    start = (np.array([1.0, -1.0, 1.0, -1.0, 1.0]), 0.0, 0.0)
    with (
        any_step(),
        pytest.raises(AnalysisError, match="no longer finite"),
    ):
        run(system, 5000 * step, step=step, start=start, path=path, record_every=10**6)


@pytest.mark.parametrize("beta2", [0.5, 0.75, 1.0])
def test_damping_moves_the_limit_as_derived(beta2):
    """Δt²ω² = (2/β2)(1 + (β2 − 1/2) cΔt), where an eigenvalue passes −1."""
    c = 0.4
    # Positive root of Ω² − (2/β2)(β2 − 1/2) c Ω − 2/β2 = 0 for ω = 1.
    half = (2 / beta2) * (beta2 - 0.5) * c / 2
    critical = half + math.sqrt(half**2 + 2 / beta2)
    system = oscillator(damping=c)
    ends = []
    for factor in (0.999, 1.001):
        step = factor * critical
        with any_step():
            u = run(system, 3000 * step, start=(1.0, 0.0, 0.0), step=step, beta2=beta2, watch=("mass",))
        ends.append(np.abs(u.displacement[-20:]).max())
    assert ends[0] < 1e-1
    assert ends[1] > 1e1
    assert critical >= math.sqrt(2 / beta2)  # damping never lowers it


@pytest.mark.parametrize("beta2", [0.5, 0.75, 1.0])
def test_step_beyond_the_limit_is_refused_with_the_body_that_sets_it(beta2):
    for coarse, fine, body in ((4, 20, "base"), (20, 4, "s0")):
        system = bench(Slave(elements=coarse), elements=fine)
        limit = step_limit(system, beta2)
        assert limit.body == body
        with pytest.raises(CaseError, match=rf"unstable beyond {limit.step:.4g} s, set by {body}") as error:
            simulate(system, one_phase(1e-5), Settings(step=1.0001 * limit.step, beta2=beta2))
        assert error.value.problems[0].where == "temporal.step"
        simulate(system, one_phase(1e-5), Settings(step=0.9999 * limit.step, beta2=beta2))


def test_paper_step_lies_just_under_the_limit_of_the_bench():
    limit = step_limit(build_system(paper_case()), 0.5)
    assert limit.step == pytest.approx(2.116e-8, rel=5e-4)
    assert limit.step > 2e-8
    assert limit.body == "beam2"
    # Any more numerical damping would have forbidden the paper's step.
    assert step_limit(build_system(paper_case()), 0.6).step < 2e-8


def test_lumped_mass_allows_larger_steps():
    lumped = build_system(paper_case(bodies__beam1__mass="lumped", bodies__beam2__mass="lumped"))
    # All nodes turning alike: 12 EI/h against two rotary inertias m h²/78, far above every other mode.
    h, bending = 0.15 / 90, 200e9 * 0.015 * 3e-3**3 / 12
    omega = math.sqrt(12 * 78 / 2 * bending / (7800 * 0.015 * 3e-3 * h * h**3))
    assert step_limit(lumped, 0.5).step == pytest.approx(2 / omega, rel=0.01)


@pytest.mark.parametrize("beta2", [0.5, 0.7])
@pytest.mark.parametrize("mass", ["consistent", "lumped"])
@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize("slaves", [1, 3])
def test_modal_and_nodal_path_are_one_scheme(beta2, mass, sliding, slaves):
    """Several contacts, stick, slip and separation, a ramp of the support: the same to rounding."""
    all_slaves = (
        Slave(place=0.4, lean_deg=10.0),
        Slave(place=0.66, side=-1, lean_deg=-5.0, force=10.0),
        Slave(place=0.9),
    )
    system = bench(*all_slaves[:slaves], elements=10, mass=mass, velocity=0.5)
    system = replace(system, contacts=tuple(replace(c, sliding=sliding, stiffness=1e10 if sliding == "small" else np.inf) for c in system.contacts))
    phases = [
        PhaseSpec("press", 1e-4, {}, {"clamp": 0.0}, 5e-5),
        PhaseSpec("slide", 2e-4, {}, {"clamp": 1.0}, 1e-4),
    ]
    both = [
        simulate(
            system, phases, Settings(beta2=beta2, record_every=3, path=path, watch=("base.end", "s0.start"))
        )
        for path in PATHS
    ]
    assert [r.path for r in both] == list(PATHS)
    for name in (
        "normal_force",
        "tangential_force",
        "slip_speed",
        "displacement",
        "velocity",
        "kinetic",
        "elastic",
    ):
        a, b = (getattr(r, name) for r in both)
        assert np.abs(a - b).max() < 1e-8 * np.abs(a).max(), name
    assert np.array_equal(both[0].status, both[1].status)
    assert both[0].normal_force.max() > 1.0
    for name, work in both[0].works.items():
        scale = max(np.abs(w).max() for w in both[0].works.values())
        assert np.abs(work - both[1].works[name]).max() < 1e-9 * scale, name


def test_path_is_chosen_and_said():
    modal = run(bench(), 1e-5)
    assert modal.path == "modal"
    assert "proportional in every component" in modal.path_reason
    mass, stiffness = rod(1.0, 1.0, 1.0, 1.0, 3)
    odd = np.zeros_like(mass)
    odd[0, 0] = 1.0
    nodal = run(System(mass, odd, stiffness), 1.0)
    assert nodal.path == "nodal"
    assert "not proportional" in nodal.path_reason
    with pytest.raises(CaseError, match="damping is not proportional"):
        run(System(mass, odd, stiffness), 1.0, path="modal")
