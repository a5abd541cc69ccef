"""Steady sliding of many contact nodes: against point contacts, closed forms and balances of forces."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import scipy.sparse as sp
import skfem
from skfem.models.elasticity import lame_parameters, linear_elasticity

from benches import Slave, bench, by_hand, equilibria_by_hand, paper_case
from stridor import direct
from stridor.contact.interface import Rows
from stridor.contact.master import Location
from stridor.contact.surfaces import SurfaceContact, operators
from stridor.errors import AnalysisError
from stridor.laws import Coulomb, Weakening
from stridor.laws.friction import Shared
from stridor.sliding import force_rates, friction_damping_matrix, steady_sliding, touching
from stridor.sliding.equilibrium import NodeEquilibrium, offenders
from stridor.sliding.resultants import resultants
from stridor.system import System, build_system
from stridor.system.model import CubicSprings, PrescribedMotion, Solid

pytestmark = pytest.mark.verification

solvers = pytest.mark.parametrize("solver", direct.available())
YOUNG = 2e9


def on_a_flat(slave, position, area, drift, *, gap=0.0, stiffness=math.inf, law=None, name="flat"):
    """Slave nodes over the rigid plane y = 0 (z = 0 in space); drift (m, d): velocity of the slave over it."""
    count, d = position.shape
    normal = np.zeros((count, d))
    normal[:, -1] = 1.0
    location = Location(
        nodes=np.zeros((count, 0), dtype=np.int64), weights=np.zeros((count, 0)), point=position * (1 - normal),
        normal=normal, gap=np.broadcast_to(np.asarray(gap, dtype=float), count).copy(),
        facet=np.zeros(count, dtype=np.int64), inside=np.ones(count, dtype=bool),
    )  # fmt: skip
    rows = Rows(sp.csr_array(slave), np.zeros((count * d, 1)))
    empty = Rows(sp.csr_array((0, slave.shape[1])), np.zeros((0, 1)))
    law, drift = law or Coulomb(0.3), np.asarray(drift)[:, :, None]
    nodes = operators(
        name, slave=rows, slave_position=position, area=area, master_rows=empty, drift=drift,
        stiffness_per_area=stiffness, law=law, location=location,
    )  # fmt: skip
    return SurfaceContact(
        name,
        rows,
        position,
        area,
        None,
        empty,
        drift,
        stiffness,
        law,
        "small",
        location,
        nodes,  # type: ignore[arg-type]
    )


def moving(size):
    column, one = np.zeros((size, 1)), np.zeros((1, 1))
    return PrescribedMotion(("belt",), column, column, column, one, one, one)


@cache
def elastic(counts, lengths, poisson):
    """Mesh, basis, stiffness, load of a unit pull at the top and areas at the bottom of a block."""
    d = len(counts)
    axes = [np.linspace(-a / 2, a / 2, c + 1) for c, a in zip(counts[:-1], lengths[:-1], strict=True)]
    axes.append(np.linspace(0.0, lengths[-1], counts[-1] + 1))
    mesh = (skfem.MeshQuad if d == 2 else skfem.MeshHex).init_tensor(*axes)
    element = skfem.ElementVector(skfem.ElementQuad1() if d == 2 else skfem.ElementHex1())
    basis = skfem.Basis(mesh, element)
    stiffness = sp.csr_array(linear_elasticity(*lame_parameters(YOUNG, poisson)).assemble(basis))

    @skfem.LinearForm
    def one(v, w):
        return v[d - 1]

    top = mesh.facets_satisfying(lambda x: np.isclose(x[-1], lengths[-1]))
    bottom = mesh.facets_satisfying(lambda x: np.isclose(x[-1], 0.0))
    pull, areas = (one.assemble(skfem.FacetBasis(mesh, element, facets=f)) for f in (top, bottom))
    return mesh, basis, stiffness, pull, areas


def block(counts, lengths, *, drift, held=(0, 1), pressure=1e5, poisson=0.3, gap=None, **contact):
    """An elastic block centred over the origin, its top pressed and held in the directions `held`."""
    d = len(counts)
    mesh, basis, stiffness, pull, areas = elastic(counts, lengths, poisson)
    load, place = -pressure * pull, basis.doflocs
    component = np.zeros(basis.N, dtype=int)
    for k in range(d):
        component[basis.nodal_dofs[k]] = k
    fixed = np.isclose(place[-1], lengths[-1]) & np.isin(component, [k for k in held if k < d - 1])
    free = np.flatnonzero(~fixed)
    pick = sp.csr_array(sp.eye_array(basis.N).tocsr()[:, free])
    touched = np.flatnonzero(np.isclose(mesh.p[-1], 0.0))
    position = mesh.p[:, touched].T
    slave = pick[basis.nodal_dofs[:, touched].T.ravel()]
    velocity = drift(position) if callable(drift) else np.tile(drift, (len(position), 1))
    start = 0.0 if gap is None else gap(position)
    surface = on_a_flat(slave, position, areas[basis.nodal_dofs[d - 1, touched]], velocity, gap=start, **contact)
    n = len(free)
    rows = Rows(sp.csr_array(pick[basis.nodal_dofs.T.ravel()]), np.zeros((basis.N, 1)))
    body = Solid("block", mesh.p.T, {}, rows, np.arange(n))
    stiffness = sp.csr_array(stiffness[free][:, free])
    return System(
        sp.csr_array(sp.eye_array(n)), sp.csr_array((n, n)), stiffness, (), {"press": load[free]}, moving(n),
        surfaces=(surface,), dimension=d, solids=(body,),
    )  # fmt: skip


@solvers
@pytest.mark.parametrize("mu", [None, 0.0, 0.3, 0.8])
def test_point_contacts_agree_with_a_dense_solution_of_every_set(mu, solver):
    for system, tolerance in (
        (bench(Slave(end="clamped", stiffness=2e6, force=5.0)), 1e-10),
        (bench(Slave(stiffness="rigid")), 1e-10),
        # Free to move against 10¹⁰ N/m: both solutions hold 9 digits of the displacement.
        (bench(Slave(0.3), Slave(0.6, lean_deg=-10, stiffness="rigid"), Slave(0.8, side=-1)), 1e-8),
        (build_system(paper_case()), 1e-8),
    ):
        ((displacement, force, active),) = equilibria_by_hand(system, mu)
        nodal = steady_sliding(system, mu=mu, solver=solver)
        size = np.abs(displacement).max()
        assert np.allclose(nodal.displacement, displacement, rtol=0, atol=tolerance * size)
        assert np.allclose(nodal.normal_force, force, rtol=tolerance)
        assert np.array_equal(nodal.active, active)
        assert nodal.residual < 1e-13


@solvers
def test_contacts_that_lift_off_are_the_same_ones(solver):
    """A slave that friction lifts off, another that carries on."""
    rng = np.random.default_rng(5)
    opened = 0
    for _ in range(20):
        factor = rng.standard_normal((6, 6))
        loads = {"f": rng.standard_normal(6)}
        normal, tangent = rng.standard_normal((2, 4, 6))
        system = by_hand(np.eye(6), np.zeros((6, 6)), factor @ factor.T + np.eye(6), normal, tangent, 30.0, loads=loads)
        right = [found for found in equilibria_by_hand(system, 0.1) if found[2].any()]
        if not right:
            with pytest.raises(AnalysisError):
                steady_sliding(system, mu=0.1, solver=solver)
            continue
        ((displacement, _, active),) = right
        nodal = steady_sliding(system, mu=0.1, solver=solver)
        opened += int(np.sum(~active))
        assert np.array_equal(nodal.active, active)
        assert np.allclose(nodal.displacement, displacement, rtol=1e-10, atol=1e-12)
    assert opened > 10


@pytest.mark.parametrize("first", [0, pytest.param(100, marks=pytest.mark.slow)])
def test_an_equilibrium_is_found_where_there_is_one_and_is_one_of_those(first):
    """Random structures on contacts open and kept closed, rigid, stiff and soft, with gaps and with much friction."""
    several = refused = pulled = 0
    for seed in range(first, first + (60 if not first else 3000)):
        rng = np.random.default_rng(seed)
        n, m = rng.integers(2, 9), int(rng.integers(1, 5))
        half, scale = rng.normal(size=(n, n)), 10.0 ** rng.integers(-3, 9)
        stiffness = [float(rng.choice([np.inf, scale, scale * 1e5, scale * 1e-2])) for _ in range(m)]
        system = by_hand(
            np.eye(n), np.zeros((n, n)), scale * (half @ half.T + np.eye(n)), *rng.normal(size=(2, m, n)), stiffness,
            slip=rng.choice([-1, 1]), loads={"f": scale * rng.normal(size=n)},
        )  # fmt: skip
        contacts = [
            replace(c, gap=float(rng.choice([0, abs(rng.normal())])), closed=bool(rng.random() < 0.3))
            for c in system.contacts
        ]
        system, mu = replace(system, contacts=tuple(contacts)), float(rng.choice([0, 0.1, 0.5, 1.5]))
        right = [found for found in equilibria_by_hand(system, mu) if found[2].any()]
        several += len(right) > 1
        try:
            found = steady_sliding(system, mu=mu)
        except AnalysisError:
            assert not right or len(right) < len(equilibria_by_hand(system, mu))  # it found that in which none touches
            refused += not right
            continue
        pulled += bool((found.normal_force < 0).any())
        assert any(
            np.array_equal(found.active, active)
            and np.allclose(found.normal_force, force, rtol=1e-6, atol=1e-9 * np.abs(force).max())
            and np.allclose(found.displacement, displacement, rtol=1e-6, atol=1e-9 * np.abs(force).max() / scale)
            for displacement, force, active in right
        ), seed
    assert min(several, refused, pulled) > 1


def test_normal_forces_change_with_friction_as_differences_say():
    rng = np.random.default_rng(11)
    for _ in range(8):
        half, rows = rng.normal(size=(6, 6)), rng.normal(size=(2, 3, 6))
        stiffness = half @ half.T + np.eye(6)
        system = by_hand(np.eye(6), 0 * half, stiffness, *rows, [np.inf, 3.0, 1e4], slip=-1.0, loads={"f": rng.normal(size=6)})
        contacts = [replace(c, closed=True) for c in system.contacts]
        contacts[1] = replace(contacts[1], law=Shared(Coulomb(0.2), 0.4))
        system, mu, step = replace(system, contacts=tuple(contacts)), 0.15, 1e-5
        before, here, after = (steady_sliding(system, mu=m) for m in (mu - step, mu, mu + step))
        change = (after.normal_force - before.normal_force) / (2 * step)
        assert np.allclose(force_rates(system, here), change, rtol=1e-6, atol=1e-7 * np.abs(change).max())


@solvers
@pytest.mark.parametrize("stiffness", [math.inf, 1e13, 1e20])
def test_a_block_pressed_evenly_presses_evenly(stiffness, solver):
    """The patch test of contact: no friction, no Poisson effect against the held top, the same pressure everywhere."""
    for counts, lengths in (((7, 4), (0.1, 0.05)), ((4, 3, 3), (0.1, 0.08, 0.05))):
        d = len(counts)
        system = block(counts, lengths, drift=np.eye(d)[0] * 0.1, stiffness=stiffness, poisson=0.0)
        answer = steady_sliding(system, mu=0.0, solver=solver)
        nodes = system.contact_nodes()
        assert np.allclose(answer.normal_force / nodes.area, 1e5, rtol=1e-9)
        total = answer.resultants["flat"]
        face = float(np.prod(lengths[:-1]))
        assert total.force[-1] == pytest.approx(1e5 * face, rel=1e-10)
        assert total.area == pytest.approx(face)
        assert total.largest_pressure == pytest.approx(1e5, rel=1e-9)
        assert np.allclose(total.moment, 0.0, atol=1e-9 * 1e5 * face * 0.1)
        assert answer.balance.force_error < 1e-10
        # Touching nodes lie in the flat, or in it by N over the stiffness.
        assert np.allclose(answer.gap, -1e5 / stiffness, rtol=1e-8, atol=1e-16)
        assert answer.iterations == 1


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_friction_on_a_block_shifts_its_pressure_to_the_leading_edge(direction):
    """Held at the height h of its top: friction μN at the bottom turns it, and pressure moves by μ h to balance."""
    mu, height = 0.2, 0.05
    system = block((20, 10), (0.1, height), drift=np.array([0.1 * direction, 0.0]))
    answer = steady_sliding(system, mu=mu)
    total = answer.resultants["flat"]
    load = 1e5 * 0.1
    assert answer.active.all()
    assert total.force[1] == pytest.approx(load, rel=1e-10)
    assert total.force[0] == pytest.approx(-direction * mu * load, rel=1e-10)
    # About the middle of the base: the reaction μN at the top turns by −(μ N direction) h, the pressure turns back.
    assert total.moment == pytest.approx(direction * mu * load * height, rel=1e-9)
    assert answer.balance.force_error < 1e-10
    assert answer.residual < 1e-13


@pytest.mark.parametrize("d", [2, 3])
def test_moments_are_about_the_origin(d):
    """A force moved by a has the moment a × F more."""
    system = block(
        (4, 3) if d == 2 else (4, 3, 2), (0.1, 0.06, 0.05)[3 - d :], drift=np.array([0.1, -0.05, 0.0])[3 - d :]
    )
    answer = steady_sliding(system)
    nodes, shift = system.contact_nodes(), np.array([0.3, -0.2, 0.7])[:d]
    moved = replace(nodes, position=nodes.position + shift)
    total, elsewhere = (
        resultants(n, answer.normal_force, answer.friction_force, answer.active)["flat"] for n in (nodes, moved)
    )
    padded = [np.append(v, np.zeros(3 - d)) for v in (shift, total.force)]
    extra = np.cross(*padded)
    assert np.allclose(elsewhere.moment - total.moment, extra[2] if d == 2 else extra, rtol=1e-10)


@solvers
def test_friction_in_space_opposes_the_slip_of_every_node(solver):
    direction = np.array([0.6, -0.8, 0.0])
    system = block((4, 5, 3), (0.1, 0.08, 0.03), drift=0.02 * direction)
    answer = steady_sliding(system, solver=solver)
    nodes = system.contact_nodes()
    total = answer.resultants["flat"]
    assert np.allclose(total.force, 1e5 * 0.1 * 0.08 * np.array([-0.3 * 0.6, 0.3 * 0.8, 1.0]), rtol=1e-9)
    forces = np.einsum("mq,mqd->md", answer.friction_force, nodes.tangents)
    assert np.allclose(forces, -0.3 * answer.normal_force[:, None] * direction, atol=1e-9 * answer.normal_force.max())


def test_a_spinning_block_is_held_back_by_mu_times_pressure_times_radius():
    """Torque μ p ∫ r dA = μ p a³ (√2 + ln(1 + √2))/6 of a square a × a turning about its middle."""
    side, mu, spin = 0.1, 0.01, 3.0

    def drift(x):
        # The middle is off by rounding: its direction of slip is noise, and no friction may come of it.
        return spin * np.stack([-x[:, 1], x[:, 0] + 1e-14, 0 * x[:, 0]], axis=1)

    system = block((10, 10, 2), (side, side, 0.05), drift=drift, poisson=0.0)
    answer = steady_sliding(system, mu=mu)
    nodes = system.contact_nodes()
    centre = int(np.argmin(np.linalg.norm(nodes.position, axis=1)))
    assert np.array_equal(answer.sense[centre], [0.0, 0.0])
    assert np.array_equal(answer.friction_force[centre], [0.0, 0.0])
    total = answer.resultants["flat"]
    radius = np.linalg.norm(nodes.position, axis=1)
    assert total.moment[2] == pytest.approx(-mu * float(answer.normal_force @ radius), rel=1e-10)
    even = mu * 1e5 * side**3 * (math.sqrt(2) + math.log(1 + math.sqrt(2))) / 6
    assert total.moment[2] == pytest.approx(-even, rel=1e-2)  # 10 × 10 cells, error of order h²
    assert np.allclose(total.force[:2], 0.0, atol=1e-9 * total.force[2])


def rigid_block(offset, *, length=0.2, modulus=4e9, load=1e3, count=4000):
    """A rigid block of two freedoms (down, turn) on springs in between, loaded `offset` beside its middle."""
    width = length / count
    x = (np.arange(count) + 0.5) * width - length / 2
    slave = np.zeros((2 * count, 2))
    slave[1::2, 0], slave[1::2, 1] = 1.0, x
    contact = on_a_flat(
        slave, np.stack([x, 0 * x], axis=1), np.full(count, width), np.tile([0.1, 0.0], (count, 1)), stiffness=modulus
    )
    return System(
        np.eye(2), np.zeros((2, 2)), np.zeros((2, 2)), (), {"P": np.array([-load, -load * offset])}, moving(2),
        surfaces=(contact,),
    )  # fmt: skip


@pytest.mark.parametrize("part", [0.0, 0.1, 0.2, -0.3, *(pytest.param(p, marks=pytest.mark.slow) for p in (0.35, 0.45))])
def test_an_overturned_block_lifts_off_on_one_side(part):
    """Rigid on a Winkler foundation: within L/6 p = P/L (1 ± 6e/L); beyond, 3 (L/2 − e) stays pressed."""
    length, load = 0.2, 1e3
    offset = part * length
    answer = steady_sliding(rigid_block(offset), mu=0.0)
    total = answer.resultants["flat"]
    e = abs(offset)
    if e <= length / 6:
        pressed, largest = length, load / length * (1 + 6 * e / length)
    else:
        pressed = 3 * (length / 2 - e)
        largest = 2 * load / pressed
    assert total.force[1] == pytest.approx(load, rel=1e-9)
    assert total.moment == pytest.approx(load * offset, rel=1e-8, abs=1e-8 * load * length)
    assert total.area == pytest.approx(pressed, abs=2 * length / 4000)
    assert total.largest_pressure == pytest.approx(largest, rel=2e-3)
    assert answer.iterations < 15


def test_a_block_loaded_beyond_its_edge_tips_over():
    with pytest.raises(AnalysisError, match=r"has no equilibrium|no contact carries load"):
        steady_sliding(rigid_block(0.11), mu=0.0)


@solvers
def test_a_cylinder_on_a_half_plane_presses_as_hertz_says(solver):
    """p = p₀ √(1 − x²/a²), a = √(4PR/πE*), p₀ = 2P/πa, with the half-plane's own compliance −2/(πE*) ln|x − s|."""
    modulus, radius, load, count, reach = 1e9, 0.1, 2e4, 301, 2.5
    half = math.sqrt(4 * load * radius / (math.pi * modulus))
    x = np.linspace(-reach * half, reach * half, count)
    width = x[1] - x[0]

    def integral(s):  # ∫ ln|s| ds
        return s * np.log(np.abs(s)) - s

    distance = x[:, None] - x
    compliance = integral(distance + width / 2) - integral(distance - width / 2)
    compliance = -2 / (math.pi * modulus) * compliance / width + 20 / modulus
    stiffness = np.zeros((count + 1, count + 1))
    stiffness[:count, :count] = np.linalg.inv(compliance)
    stiffness = 0.5 * (stiffness + stiffness.T)
    slave = np.zeros((2 * count, count + 1))
    slave[1::2, count] = 1.0  # the cylinder comes down on
    slave[1::2, :count] = -np.eye(count)  # the surface
    contact = on_a_flat(
        slave, np.stack([x, 0 * x], axis=1), np.full(count, width), np.tile([0.1, 0.0], (count, 1)),
        gap=x**2 / (2 * radius),
    )  # fmt: skip
    force = np.zeros(count + 1)
    force[count] = -load
    n = count + 1
    system = System(np.eye(n), np.zeros((n, n)), stiffness, (), {"P": force}, moving(n), surfaces=(contact,))
    answer = steady_sliding(system, mu=0.3, solver=solver)
    peak = 2 * load / (math.pi * half)
    pressure = answer.normal_force / width
    expected = peak * np.sqrt(np.maximum(1 - (x / half) ** 2, 0))
    assert answer.resultants["flat"].area == pytest.approx(2 * half, rel=0.02)
    assert answer.resultants["flat"].largest_pressure == pytest.approx(peak, rel=2e-3)
    inner = np.abs(x) < 0.9 * half
    assert np.allclose(pressure[inner], expected[inner], rtol=0.01)
    assert np.all(answer.normal_force >= 0)
    assert np.all(answer.gap > -1e-12)
    assert answer.iterations < 15


@solvers
@pytest.mark.parametrize("stiffness", [math.inf, 3e12])
def test_a_convex_block_settles_with_friction(stiffness, solver):
    """Gaps that grow outward in space: complementarity at every node, and forces that balance the load."""
    system = block(
        (10, 10, 3), (0.1, 0.1, 0.04), drift=np.array([0.05, 0.02, 0.0]), stiffness=stiffness,
        gap=lambda x: (x[:, 0] ** 2 + x[:, 1] ** 2) / 2 / 100.0, pressure=1e6,
    )  # fmt: skip
    answer = steady_sliding(system, solver=solver)
    nodes = system.contact_nodes()
    assert 10 < answer.active.sum() < nodes.count - 10
    assert np.all(answer.normal_force[answer.active] > 0)
    assert np.all(answer.normal_force[~answer.active] == 0)
    assert np.all(answer.gap[~answer.active] > 0)
    law = answer.gap + answer.normal_force * nodes.compliance
    assert np.allclose(law[answer.active], 0.0, atol=1e-12 * 0.1)
    assert answer.resultants["flat"].force[2] == pytest.approx(1e6 * 0.01, rel=1e-9)
    assert answer.balance.force_error < 1e-9
    assert answer.iterations < 12
    assert touching(system, answer).count == answer.active.sum()
    # Begun from its own answer it is settled; begun from nothing, which does not hold the block, it gets there too.
    again = steady_sliding(system, guess=answer.active, solver=solver)
    assert again.iterations == 1
    assert np.array_equal(again.normal_force, answer.normal_force)
    anew = steady_sliding(system, guess=np.zeros(nodes.count, dtype=bool), solver=solver)
    assert np.array_equal(anew.active, answer.active)


def test_sets_that_would_go_in_circles_settle_all_the_same():
    """Newton's method on gap = M N − 1 with this M (Murty's) returns to its start for ever; N = 1/3 is the answer."""
    coupling = np.array([[1.0, 0.0, 2.0], [2.0, 1.0, 0.0], [0.0, 2.0, 1.0]])
    one = np.eye(3)
    system = by_hand(one, 0 * one, one, one, coupling.T - one, math.inf, slip=-1.0, loads={"f": -np.ones(3)})
    for guess in ([1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, 0, 0]):
        answer = steady_sliding(system, mu=1.0, guess=np.array(guess, dtype=bool))
        assert np.allclose(answer.normal_force, 1 / 3)


def test_springs_beyond_the_linear_carry_their_share():
    """k u + c u³ = P − N with a stop at the gap g: closed form of one freedom."""
    stiffness, cubic, load, gap = 100.0, 4e6, 50.0, 0.015
    slave = np.array([[0.0], [1.0]])
    contact = on_a_flat(slave, np.zeros((1, 2)), np.ones(1), np.array([[0.1, 0.0]]), gap=gap)
    spring = CubicSprings(Rows(sp.csr_array([[1.0]]), np.zeros((1, 1))), np.array([cubic]))
    system = System(
        np.eye(1), np.zeros((1, 1)), np.array([[stiffness]]), (), {"P": np.array([-load])}, moving(1),
        surfaces=(contact,), cubic=spring,
    )  # fmt: skip
    answer = steady_sliding(system)
    assert answer.displacement[0] == pytest.approx(-gap, rel=1e-12)
    assert answer.normal_force[0] == pytest.approx(load - stiffness * gap - cubic * gap**3, rel=1e-10)
    assert answer.residual < 1e-12
    with pytest.raises(AnalysisError, match="no contact carries load"):
        steady_sliding(system, load_factors={"P": 0.1})


def test_damping_of_friction_is_the_derivative_of_the_friction_force():
    """−∂F/∂ẇ by finite differences of −μ(|w|) N w/|w| at every node, in space, with a weakening law."""
    law = Weakening(0.2, 0.5, 0.03)
    system = block(
        (3, 3, 2),
        (0.1, 0.1, 0.04),
        drift=lambda x: np.stack([0.05 + x[:, 1], 0.02 - x[:, 0], 0 * x[:, 0]], axis=1),
        law=law,
    )
    for mu in (None, 0.4):
        steady = steady_sliding(system, mu=mu)
        matrix = friction_damping_matrix(system, steady)
        nodes = system.contact_nodes()
        motion = np.random.default_rng(1).standard_normal(system.size)

        def force(velocity, nodes=nodes, steady=steady, mu=mu):
            w = steady.slip_velocity + (nodes.tangent @ velocity).reshape(-1, 2)
            speed = np.linalg.norm(w, axis=1)
            scaled = law if mu is None else law.scaled(mu, float(steady.slip_speed.mean()))
            coefficient = np.array([scaled.sliding(v) for v in speed])
            return nodes.tangent.T @ (-(coefficient * steady.normal_force / speed)[:, None] * w).ravel()

        step = 1e-6
        slope = (force(step * motion) - force(-step * motion)) / (2 * step)
        assert np.allclose(matrix @ motion, -slope, rtol=1e-6, atol=1e-6 * np.abs(slope).max())
        assert abs(matrix - matrix.T).max() < 1e-12 * abs(matrix).max()


def test_a_structure_without_contacts_only_deforms():
    system = System(np.eye(2), np.zeros((2, 2)), 2 * np.eye(2), (), {"P": np.array([1.0, -3.0])})
    answer = steady_sliding(system)
    assert np.allclose(answer.displacement, [0.5, -1.5])
    assert answer.normal_force.shape == (0,)
    assert touching(system, answer).count == 0
    assert friction_damping_matrix(system, answer).nnz == 0


def test_what_has_no_answer_says_why():
    still = block((3, 2), (0.1, 0.05), drift=np.zeros(2))
    with pytest.raises(AnalysisError, match="contact flat does not slide"):
        steady_sliding(still)
    assert steady_sliding(still, mu=0.0).active.all()
    system = block((3, 2), (0.1, 0.05), drift=np.array([0.1, 0.0]))
    with pytest.raises(AnalysisError, match=r"the loads pull the bodies apart|body block can move freely"):
        steady_sliding(system, load_factors={"press": -1.0})
    loose = block((3, 2), (0.1, 0.05), drift=np.array([0.1, 0.0]), held=())
    with pytest.raises(AnalysisError, match="body block can move freely"):
        steady_sliding(loose, mu=0.0)
    surface = system.surfaces[0]
    lifted = replace(surface, nodes=replace(surface.nodes, normal_lift=np.full((4, 1), 1e-3)))
    with pytest.raises(AnalysisError, match=r"contact flat: the prescribed velocities change its gap at 0\.001 m/s"):
        steady_sliding(replace(system, surfaces=(lifted,)))
    twice = replace(system, surfaces=(surface, replace(surface, nodes=replace(surface.nodes, names=("again",)))))
    with pytest.raises(AnalysisError, match="presses on the same freedoms twice"):
        steady_sliding(twice)


def test_only_what_is_beyond_rounding_pulls_or_penetrates():
    """Forces are told apart to 1e-12 of the largest force or load, gaps to 1e-12 of the largest gap."""
    force = np.array([1.0, -0.3e-12, -3e-12, 0.0, 0.0, 0.0])
    gap = np.array([0.0, 0.0, 0.0, 2.0, -0.6e-12, -6e-12])
    active = np.array([True, True, True, False, False, False])
    state = NodeEquilibrium(active, np.zeros(1), force, gap)
    pulled, closing = offenders(state, np.ones(6, dtype=bool), 0.5)
    assert list(pulled) == [2]
    assert list(closing) == [5]
    # Against a load ten times as large as any force the same pull is rounding.
    assert not len(offenders(state, np.ones(6, dtype=bool), 10.0)[0])
    # A node that cannot move closes no gap.
    assert not len(offenders(state, np.arange(6) != 5, 0.5)[1])
    # The worst first.
    worse = NodeEquilibrium(np.ones(3, dtype=bool), np.zeros(1), np.array([1.0, -1e-6, -1e-3]), np.zeros(3))
    assert list(offenders(worse, np.ones(3, dtype=bool), 0.5)[0]) == [2, 1]
