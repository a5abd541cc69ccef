"""Modes and onsets of systems with many contact nodes: against dense elimination, the complete-basis path, closed forms."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp

import stridor as st
from benches import Slave, bench, distance_to, full_eigenvalues, paper_case
from stridor.case import template_text
from stridor.contact.nodes import ContactNodes
from stridor.errors import AnalysisError, CaseError, FollowingError
from stridor.laws import Coulomb, Weakening
from stridor.laws.friction import FrictionLaw
from stridor.modal.complex_modes import complex_modes
from stridor.modal.krylov import (
    Options,
    direct_modes,
    friction_energy,
    krylov_modes,
    krylov_onsets,
    refine,
)
from stridor.modal.krylov import modes as modes_over_friction
from stridor.modal.krylov.follow import BranchState
from stridor.modal.krylov.passages import crossings
from stridor.modal.krylov.problem import Varying, problem_of
from stridor.modal.krylov.reduced import Eigenpairs
from stridor.modal.onsets import onsets
from stridor.sliding import SteadySliding, friction_damping_matrix, steady_sliding
from stridor.system import System, build_system
from stridor.system.model import PrescribedMotion

pytestmark = pytest.mark.verification


@dataclass(frozen=True)
class HandMade:
    """As much of a surface contact as is read here."""

    nodes: ContactNodes
    name: str = "pad"
    sliding: str = "small"
    facets: None = None
    joined: None = None


def assembled(mass, damping, stiffness, normal, tangent, compliance, slip, *, law=None, loads=None, prestress=None):
    """A System with one contact of m nodes: normal (m, n), tangent ((d−1) m, n), slip (m, d−1) [m/s]."""
    (m, n), slip = normal.shape, np.asarray(slip, dtype=float)
    d = slip.shape[1] + 1
    nodes = ContactNodes(
        names=("pad",), owner=np.zeros(m, dtype=int), laws=(law or Coulomb(0.3),), normal=sp.csr_array(normal),
        tangent=sp.csr_array(tangent), normal_lift=np.zeros((m, 1)), tangent_lift=slip.reshape(-1, 1), gap=np.zeros(m),
        area=np.ones(m), compliance=np.broadcast_to(np.asarray(compliance, dtype=float), m).copy(),
        position=np.zeros((m, d)), normals=np.zeros((m, d)), tangents=np.zeros((m, d - 1, d)),
    )  # fmt: skip
    none, one = np.zeros((n, 1)), np.zeros((1, 1))
    return System(
        *(sp.csr_array(a) for a in (mass, damping, stiffness)), loads=loads or {},
        motion=PrescribedMotion(("belt",), none, none, none, one, one, one),
        surfaces=(HandMade(nodes),), dimension=d, stress_stiffness=prestress,
    )  # fmt: skip


def scattered(dimension=2, compliance=0.0, damping=0.0, *, size=90, nodes=7, seed=3, **more) -> System:
    """A random net of springs and masses with contact between random pairs of its points."""
    rng = np.random.default_rng(seed)
    stiffness = 0.05 * np.eye(size)
    for _ in range(3 * size):
        row = np.zeros(size)
        row[rng.integers(size)] += 1
        row[rng.integers(size)] -= rng.random()
        stiffness += rng.random() * np.outer(row, row)
    mass = np.diag(0.5 + rng.random(size))
    rate = damping * (0.3 * mass + 0.05 * stiffness + np.diag(0.1 * rng.random(size)))
    places = rng.permutation(size)[: 2 * nodes * dimension].reshape(nodes, 2, dimension)
    rows = np.zeros((nodes, dimension, size))
    for node, axis in np.ndindex(nodes, dimension):
        rows[node, axis, places[node, :, axis]] = 1.0, -1.0
    slip = np.ones((nodes, 1)) if dimension == 2 else rng.standard_normal((nodes, 2))
    tangent = rows[:, 1:].reshape(-1, size)
    return assembled(mass, rate, stiffness, rows[:, 0], tangent, compliance, slip, **more)


def eliminated(system: System, mu: float | np.ndarray, damping=0.0, stiffness=0.0) -> np.ndarray:
    """Eigenvalues with Im λ ≥ 0 by dense elimination: contact springs put into K, rigid contact eliminated, which puts
    friction into M, C and K. mu: of all nodes, or of each (m,)."""
    nodes = system.contact_nodes()
    slip = nodes.slip_velocity(np.ones(1))
    normal = nodes.normal.toarray()
    push = normal - np.reshape(mu, (-1, 1)) * nodes.along(slip / np.linalg.norm(slip, axis=1, keepdims=True)).toarray()
    mass, rate, spring = (a.toarray() for a in (system.mass, system.damping, system.stiffness))
    rate, spring = rate + damping, spring + stiffness
    soft = nodes.compliance > 0
    spring = spring + push[soft].T @ (normal[soft] / nodes.compliance[soft, None])
    if not soft.all():
        # The trial motions keep the gaps shut; the tests are those that contact and friction forces do no work on.
        trial, test = sl.null_space(normal[~soft]), sl.null_space(push[~soft])
        mass, rate, spring = (test.T @ a @ trial for a in (mass, rate, spring))
    n = len(mass)
    nothing, one = np.zeros((n, n)), np.eye(n)
    values = sl.eig(np.block([[nothing, one], [-spring, -rate]]), sl.block_diag(one, mass), right=False)
    return values[values.imag >= -1e-9 * np.abs(values)]


# -- eigenvalues -------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("damping", [0.0, 1.0])
@pytest.mark.parametrize(
    "compliance",
    [
        *(pytest.param(c, marks=pytest.mark.slow) for c in (0.0, 0.1)),
        *(1e-3, np.array([0.0, 0.02, 0.0, 0.1, 0.0, 0.0, 0.05])),
    ],
)
def test_random_contacts_have_the_eigenvalues_of_the_eliminated_problem(dimension, damping, compliance):
    system = scattered(dimension, compliance, damping)
    modes = krylov_modes(system, [0.0, 0.3, 1.0], count=15, damped=damping > 0)
    assert modes.residual.max() < 1e-8
    for row, mu in enumerate(modes.mu):
        exact = eliminated(system, mu)
        assert distance_to(modes.eigenvalues[row], exact).max() < 1e-9
        # None is missed: those of the band at μ = 0 are counted.
        if row == 0:
            np.testing.assert_allclose(np.sort(exact.imag)[:15], modes.eigenvalues[0].imag, rtol=1e-9)
    assert modes.growth_rate[2].max() > 1e-3 or damping


def test_friction_enters_the_mass_where_rigid_contact_is_eliminated():
    """Two freedoms, mass coupled: with x alone left, (M_xx − μ M_yx) λ² + K_xx − μ K_yx = 0."""
    mass, stiffness = np.array([[2.0, 0.3], [0.3, 1.0]]), np.array([[5.0, 1.0], [1.0, 4.0]])
    system = assembled(mass, np.zeros((2, 2)), stiffness, np.array([[0.0, 1.0]]), np.array([[1.0, 0.0]]), 0.0, [[1.0]])
    modes = krylov_modes(system, [0.0, 0.5, 2.0], count=1, damped=False)
    # Slip along +x: friction on the slave is −μ p, p = (K_yx + λ² M_yx) x.
    exact = [math.sqrt((5 + mu * 1.0) / (2 + mu * 0.3)) for mu in modes.mu]
    np.testing.assert_allclose(modes.eigenvalues[:, 0], 1j * np.array(exact), rtol=1e-12)


def test_contact_springs_converge_to_rigid_contact_with_their_compliance():
    mu = [0.4]
    rigid = krylov_modes(scattered(3), mu, count=8, damped=False).eigenvalues
    errors = [
        np.abs(krylov_modes(scattered(3, c), mu, count=8, damped=False).eigenvalues - rigid).max()
        for c in (1e-4, 1e-5, 1e-6)
    ]
    np.testing.assert_allclose(np.array(errors[:-1]) / errors[1:], 10.0, rtol=0.02)


@pytest.mark.parametrize("damped", [False, True])
def test_published_bench_as_the_complete_basis_has_it(damped):
    system = build_system(paper_case())
    mu = [0.0, 0.07, 0.0768, 0.2, 0.5]
    small = complex_modes(system, mu, count=20, damped=damped, vectors=True)
    large = krylov_modes(system, mu, count=20, damped=damped, vectors=True)
    assert (np.abs(large.eigenvalues - small.eigenvalues) / np.abs(small.eigenvalues)).max() < 1e-8
    assert large.residual.max() < 1e-8
    assert large.branch.tolist() == small.branch.tolist()
    for ours, theirs in ((large.right, small.right), (large.left, small.left)):
        assert np.abs(np.einsum("kbn,kbn->kb", ours.conj(), theirs)).min() > 1 - 1e-6


@pytest.mark.parametrize("damped", [False, True])
def test_three_slaves_rigid_and_elastic(damped):
    system = bench(
        Slave(place=0.3),
        Slave(place=0.5, lean_deg=12, stiffness="rigid"),
        Slave(place=0.8, stiffness="rigid", lean_deg=-7),
    )
    modes = krylov_modes(system, [0.05, 0.3, 0.6], max_frequency_hz=6e3, damped=damped)
    bare = system if damped else replace(system, damping=0.0 * system.damping)
    for row, mu in enumerate(modes.mu):
        assert distance_to(modes.eigenvalues[row], full_eigenvalues(bare, mu)).max() < 1e-7


@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.parametrize("compliance", [0.0, 0.05])
def test_direct_solution_agrees(damped, compliance):
    system = scattered(3, compliance, 0.4)
    modes = krylov_modes(system, [0.7], count=25, damped=damped)
    middle = float(modes.frequency_hz[0, 11:13].mean())
    direct = direct_modes(system, 0.7, shift_hz=middle, count=6, damped=damped)
    assert direct.residual.max() < 1e-12
    assert distance_to(direct.eigenvalues, modes.eigenvalues[0]).max() < 1e-8


def test_a_body_that_floats_keeps_its_rigid_motions():
    """Two masses on a rail, joined by contact alone: they move together at no frequency."""
    chain = np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    stiffness = sl.block_diag(chain, chain + np.diag([0.0, 0.0, 1.0]), 1.0)
    normal, tangent = np.zeros((2, 1, 7))
    normal[0, [0, 3]] = 1.0, -1.0
    tangent[0, 6] = 1.0
    system = assembled(np.eye(7), np.zeros((7, 7)), stiffness, normal, tangent, 0.0, [[1.0]])
    free = replace(system, stiffness=sp.csr_array(sl.block_diag(chain, chain, 1.0)))
    found = krylov_modes(free, 0.0, count=3, damped=False)
    assert abs(found.eigenvalues[0, 0]) < 1e-6
    exact = eliminated(free, 0.0)
    assert distance_to(found.eigenvalues[0, 1:], exact).max() < 1e-9


# -- onsets ------------------------------------------------------------------------------------------------------------
def hoffmann(c1=0.0, c2=0.0) -> System:
    """Hoffmann, Fischer, Allgaier, Gaul 2002; the spring k3 = 4/3 is the contact."""
    first, second = np.array([1.0, 1.0]) / math.sqrt(2), np.array([1.0, -1.0]) / math.sqrt(2)
    damping = c1 * np.outer(first, first) + c2 * np.outer(second, second)
    stiffness = np.array([[2.0, 1.0], [1.0, 2.0 - 4 / 3]])
    return assembled(np.eye(2), damping, stiffness, np.array([[0.0, 1.0]]), np.array([[1.0, 0.0]]), 3 / 4, [[1.0]])


def test_mode_coupling_of_two_freedoms():
    found = krylov_onsets(hoffmann(), (0.0, 2.0), max_frequency_hz=1.0, damped=False).onsets
    assert [(o.kind, o.stabilising, o.branches) for o in found] == [("flutter", False, (1, 2))]
    assert found[0].mu == pytest.approx(0.75, rel=1e-11)
    assert 2 * np.pi * found[0].frequency_hz == pytest.approx(math.sqrt(2), rel=1e-11)
    assert found[0].square_root_coefficient == pytest.approx(math.sqrt(4 / 3) / (2 * math.sqrt(2)), rel=1e-8)
    assert found[0].residual < 1e-12
    modes = krylov_modes(hoffmann(), [0.5, 1.0], count=2, damped=False)
    np.testing.assert_allclose(modes.eigenvalues[0], [1.192749j, 1.605413j], atol=5e-7)
    np.testing.assert_allclose(modes.eigenvalues[1], [0.202072 + 1.428577j, -0.202072 + 1.428577j], atol=1e-6)


@pytest.mark.parametrize(
    ("c1", "c2", "mu"),
    [
        (0.02, 0.02, 0.750600),
        (0.02, 0.01, 0.728213),
        (0.1, 0.02, 0.643834),
        (0.02, 0.002, 0.547672),
        (0.1, 0.002, 0.326320),
    ],
)
def test_uneven_damping_destabilises(c1, c2, mu):
    found = krylov_onsets(hoffmann(c1, c2), (0.0, 1.0), max_frequency_hz=1.0).onsets
    assert [(o.kind, o.stabilising, o.damped) for o in found] == [("flutter", False, True)]
    assert found[0].mu == pytest.approx(mu, abs=6e-7)
    step = 1e-5
    around = krylov_modes(hoffmann(c1, c2), [found[0].mu - step, found[0].mu + step], count=2)
    slope = np.diff(around.growth_rate.max(axis=1))[0] / (2 * step)
    assert found[0].growth_slope == pytest.approx(slope, rel=1e-3)


@pytest.mark.parametrize("damped", [False, True])
def test_onsets_of_the_published_bench(damped):
    system = build_system(paper_case())
    small = onsets(system, (0.0, 0.9), max_frequency_hz=30e3, damped=damped)
    large = krylov_onsets(system, (0.0, 0.9), max_frequency_hz=30e3, damped=damped)
    if not damped:
        assert large.onsets[0].mu == pytest.approx(0.0766441, abs=5e-8)
        assert large.onsets[0].frequency_hz == pytest.approx(8635.41, abs=5e-3)
    assert len(large.onsets) == len(small.onsets) == 4
    for ours, theirs in zip(large.onsets, small.onsets, strict=True):
        assert ours.mu == pytest.approx(theirs.mu, rel=1e-9)
        assert ours.frequency_hz == pytest.approx(theirs.frequency_hz, rel=1e-9)
        assert (ours.kind, ours.branches, ours.stabilising, ours.damped) == (
            theirs.kind, theirs.branches, theirs.stabilising, theirs.damped,
        )  # fmt: skip
        assert ours.square_root_coefficient == pytest.approx(theirs.square_root_coefficient, rel=1e-5)
        assert ours.residual < 1e-8
        if damped:
            assert ours.growth_slope == pytest.approx(theirs.growth_slope, rel=1e-7)
            assert ours.exceptional_mu == pytest.approx(theirs.exceptional_mu, rel=1e-9)


def test_divergence_of_a_known_system():
    """One freedom against friction: k + (1 − μ a)/c = 0."""
    k, contact, a = 3.0, 5.0, 2.0
    system = assembled(
        np.eye(2), np.zeros((2, 2)), np.diag([k, 40.0]), np.array([[1.0, 0.0]]), np.array([[-a, 0.0]]), 1 / contact,
        [[-1.0]],
    )  # fmt: skip
    mu = (1 + k / contact) / a
    for damped in (False, True):
        case = system if not damped else replace(system, damping=system.damping + 0.1 * system.mass)
        found = krylov_onsets(case, (0.0, 2.0), max_frequency_hz=2.0, damped=damped).onsets
        assert [o.kind for o in found] == ["divergence"]
        assert found[0].mu == pytest.approx(mu, rel=1e-9)
        if not damped:
            assert found[0].square_root_coefficient == pytest.approx(math.sqrt(contact * a), rel=1e-6)


@pytest.mark.parametrize("damping", [0.0, 0.02])
def test_growth_changes_sign_at_the_onsets_of_many_contacts(damping):
    system = scattered(3, 0.05, damping, size=60)
    found = krylov_onsets(system, (0.0, 0.6), max_frequency_hz=0.2, damped=damping > 0)
    assert len(found.onsets) > 1
    growing = []
    for onset in found.onsets:
        assert onset.residual < 1e-8
        for side in (-1e-5, 1e-5):
            values = eliminated(system, onset.mu + side)
            near = np.abs(np.abs(values.imag) / (2 * np.pi) - onset.frequency_hz) < 2e-3
            growing.append(int(np.sum(values.real[near] > 1e-7)))
        assert np.sign(growing[-1] - growing[-2]) == (-1 if onset.stabilising else 1)
    for mu in np.linspace(0.05, 0.6, 12):
        # Every growing mode has begun at an onset: none is missed.
        values = eliminated(system, mu)
        seen = sum(-1 if o.stabilising else 1 for o in found.onsets if o.mu < mu)
        assert seen == np.sum((values.real > 1e-6) & (values.imag < 2 * np.pi * 0.2))


# -- left vectors that no basis holds ----------------------------------------------------------------------------------
@pytest.mark.parametrize("compliance", [0.0, 0.05])
def test_left_vectors_are_solved_for_where_they_do_not_settle_on_a_basis(compliance, monkeypatch):
    system = scattered(3, compliance, 0.02)
    usual = krylov_modes(system, [0.2, 0.8], count=12, vectors=True)
    converge_over = refine.converge_over

    def unsettled(*given, left, **more):
        if left:
            raise FollowingError("they do not settle")
        converge_over(*given, left=left, **more)

    monkeypatch.setattr(modes_over_friction, "converge_over", unsettled)
    alone = krylov_modes(system, [0.2, 0.8], count=12, vectors=True)
    assert np.abs(alone.eigenvalues - usual.eigenvalues).max() < 1e-9 * np.abs(usual.eigenvalues).max()
    assert np.abs(np.einsum("kbn,kbn->kb", alone.left.conj(), usual.left)).min() > 1 - 1e-9
    # Right ones are others.
    assert np.abs(np.einsum("kbn,kbn->kb", alone.left.conj(), usual.right)).min() < 0.999


def test_a_basis_that_takes_rounding_in_is_given_up(monkeypatch):
    left_over = iter([1e-3, 1e-6, 1e-9, *(1e-9 * 10.0**k for k in range(60))])
    seen = []

    def worse(reduced, mu, tolerance, **_):
        seen.append(next(left_over))
        force = np.random.default_rng(len(seen)).standard_normal((reduced.problem.size, 1))
        return refine.Unbalanced(seen[-1], np.zeros(0, dtype=complex), force, np.zeros((reduced.problem.nodes, 0)))

    monkeypatch.setattr(refine, "unbalanced", worse)
    with pytest.raises(FollowingError, match="do not settle: a backward error of"):
        krylov_modes(scattered(3, 0.05, 0.02, size=200), 0.0, count=2)
    assert len(seen) < 12


STRICT = 1e-15  # a backward error that no basis reaches


@pytest.mark.parametrize("left", [False, True])
def test_pairs_that_were_exact_are_looked_at_again_in_the_end(left):
    """Whatever was said of them on a smaller basis: here that all of them were."""
    problem = problem_of(scattered(3, 0.05, 0.02, size=120), None, Options(), frictions=np.array([0.0, 0.6]))
    reduced = refine.projected(problem, refine.Band(6, None), 0.6)
    found = reduced.untracked(0.6)
    asked = refine.unbalanced(reduced, 0.6, STRICT, left=left)
    again = refine.unbalanced(reduced, 0.6, STRICT, left=left, exact=found.values)
    assert asked.error > STRICT
    assert again.error == asked.error
    assert again.forces.shape == asked.forces.shape
    assert np.array_equal(np.sort_complex(again.exact), np.sort_complex(asked.exact))


@pytest.mark.slow
def test_left_vectors_beside_stiff_contact():
    """A coarse mesh of the shipped pad: a basis that opens gaps against 2e12 N/m³ takes rounding in."""
    meshes = {"disc": [4, 44, 1], "lining": [4, 9, 2], "plate": [4, 9, 1]}
    case = st.loads(template_text("pad-on-disc")).with_(
        {f"bodies.{name}.mesh.divisions": divisions for name, divisions in meshes.items()}
    )
    modes = st.modes(case, mu=0.3, vectors=True, count=12)
    pencil = problem_of(build_system(case), 0.3, Options()).pencil(0.3).condensed()
    right = pencil.backward_error(modes.eigenvalues[0], modes.right[0].T)
    left = pencil.transposed.backward_error(modes.eigenvalues[0], modes.left[0].T)
    assert left.max() < 3 * right.max()


# -- energy, steady state, refusals ------------------------------------------------------------------------------------
@pytest.mark.parametrize("compliance", [0.0, 0.05])
def test_power_of_friction_less_damping_is_twice_the_growth_rate(compliance):
    system = scattered(3, compliance, 0.02)
    modes = krylov_modes(system, [0.2, 0.8], count=12, vectors=True)
    assert modes.growth_rate.max() > 1e-3
    for row, mode in np.ndindex(modes.eigenvalues.shape):
        energy = friction_energy(system, modes, row, mode)
        assert energy.power.shape == (7,)
        balance = energy.power.sum() - energy.damping - 2 * modes.growth_rate[row, mode]
        assert abs(balance) < 1e-7 * abs(modes.eigenvalues[row, mode])


def pressed(**more) -> System:
    """Three nodes in space pressed together, each on a spring of its own."""
    size, nodes = 40, 3
    system = scattered(3, 0.02, 0.3, size=size, nodes=nodes, **more)
    normal = system.contact_nodes().normal
    return replace(system, loads={"press": -(normal.T @ np.array([3.0, 2.0, 4.0]))})


def scaled_law(steady: SteadySliding, mu: float) -> FrictionLaw:
    """That of the pad with μ at its mean slip speed."""
    return Weakening(0.2, 0.4, 1.0).scaled(mu, float(steady.slip_speed.mean()))


def test_falling_friction_and_turning_friction_are_in_the_equations():
    system = pressed(law=Weakening(0.2, 0.4, 1.0))
    mu = 0.3
    steady = steady_sliding(system, mu=mu)
    assert steady.active.all()
    whole = friction_damping_matrix(system, steady).toarray()
    law = scaled_law(steady, mu)
    slopes, own = (np.array([of(float(v)) for v in steady.slip_speed]) for of in (law.slope, law.sliding))
    along = system.contact_nodes().along(steady.sense).toarray()
    weakening = along.T @ ((steady.normal_force * slopes)[:, None] * along)
    for options, added in ((Options(), weakening), (Options(friction_damping=True), whole)):
        modes = krylov_modes(system, mu, count=8, options=options)
        assert modes.residual.max() < 1e-8
        assert distance_to(modes.eigenvalues[0], eliminated(system, own, damping=added)).max() < 1e-8
        assert distance_to(modes.eigenvalues[0], eliminated(system, own)).max() > 1e-5


def test_power_of_the_slope_of_a_law_is_that_of_its_node_whether_friction_turns_or_not():
    system, mu = pressed(law=Weakening(0.2, 0.4, 1.0)), 0.3
    steady = steady_sliding(system, mu=mu)
    law = scaled_law(steady, mu)
    slopes, own = (np.array([of(float(v)) for v in steady.slip_speed]) for of in (law.slope, law.sliding))
    nodes = system.contact_nodes()
    for options in (Options(), Options(friction_damping=True)):
        modes = krylov_modes(system, mu, count=8, vectors=True, options=options)
        for mode in range(8):
            energy, lam, u = (
                friction_energy(system, modes, 0, mode, options=options),
                modes.eigenvalues[0, mode],
                modes.right[0, mode],
            )
            slip, gap = nodes.along(steady.sense) @ u, nodes.normal @ u
            power = np.conj(lam * slip) * (-own * gap / nodes.compliance - steady.normal_force * slopes * lam * slip)
            assert energy.power / energy.power[0] == pytest.approx(power.real / power.real[0], rel=1e-6)
            assert energy.power.sum() - energy.damping == pytest.approx(2 * lam.real, abs=1e-7 * abs(lam))
            without = np.conj(lam * slip) * (-own * gap / nodes.compliance)
            assert np.abs(power.real / power.real[0] - without.real / without.real[0]).max() > 1e-4


def test_nodes_that_pull_open_and_take_no_part():
    system = scattered(3, 0.02, 0.1, size=40, nodes=3)
    nodes = system.surfaces[0].nodes
    system = replace(system, loads={"press": nodes.normal.T @ np.array([-3.0, 9.0, -4.0])})
    modes = krylov_modes(system, 0.3, count=8, vectors=True)
    touching = replace(system, surfaces=(HandMade(nodes.select(np.array([0, 2]))),))
    assert distance_to(modes.eigenvalues[0], eliminated(touching, 0.3)).max() < 1e-9
    power = friction_energy(system, modes, 0, 3).power
    assert power[1] == 0.0
    assert np.all(power[[0, 2]] != 0.0)
    nothing = krylov_modes(replace(system, surfaces=()), [0.0, 0.5], count=8)
    assert np.abs(nothing.eigenvalues[0] - nothing.eigenvalues[1]).max() < 1e-9


def test_prestress_is_added_on_demand():
    stress = sp.csr_array(np.diag(np.linspace(0.0, 0.3, 40)))
    system = replace(pressed(), stress_stiffness=lambda u: sp.csr_array(stress * (1 + np.abs(u).max())))
    mu = [0.0, 0.4]
    modes = krylov_modes(system, mu, count=8, options=Options(prestress=True))
    for row, m in enumerate(mu):
        added = system.stress_stiffness(steady_sliding(system, mu=m).displacement).toarray()
        assert distance_to(modes.eigenvalues[row], eliminated(system, m, stiffness=added)).max() < 1e-8


def test_what_is_refused():
    system = scattered()
    with pytest.raises(CaseError, match="friction coefficients are numbers ≥ 0"):
        krylov_modes(system, -0.1)
    with pytest.raises(CaseError, match="at least one mode"):
        krylov_modes(system, 0.1, count=0)
    with pytest.raises(CaseError, match="0 ≤ a < b"):
        krylov_onsets(system, (0.5, 0.5))
    with pytest.raises(AnalysisError, match="needs the normal force"):
        krylov_modes(scattered(law=Weakening(0.2, 0.4, 1.0)), 0.1)
    nodes = system.surfaces[0].nodes
    still = replace(system, surfaces=(HandMade(replace(nodes, tangent_lift=0.0 * nodes.tangent_lift)),))
    with pytest.raises(AnalysisError, match="pad does not slide"):
        krylov_modes(still, 0.1)
    with pytest.raises(CaseError, match="vectors=True"):
        friction_energy(system, krylov_modes(system, 0.1, count=2), 0, 0)


def test_a_branch_that_starts_undamped_is_stable_until_it_grows():
    """At μ = 0 its rate is rounding of either sign: no onset where friction damps it, one where friction drives it."""

    def passages(start: float, slope: float):
        def state(mu: float) -> BranchState:
            values = np.array([start + slope * mu + 1000j, -5.0 + 2000j])
            zero = np.zeros((2, 2), dtype=complex)
            found = Eigenpairs(mu, values, values, zero, zero, np.array([slope, 0.0], dtype=complex), 2)
            return BranchState(found, np.arange(2))

        return crossings(state(0.0), state(0.1))

    for rounding in (-1e-12, 0.0, 1e-12):
        assert passages(rounding, -30.0) == []
        (found,) = passages(rounding, 30.0)
        assert (found.kind, found.stabilising) == ("crossing", False)


def test_terms_between_equilibria_are_interpolated_with_their_slopes():
    varying = Varying(None, 0.6 * (1 - np.cos(np.linspace(0, np.pi, 6))) / 2)
    for mu in (0.0, 0.2, 0.6, 0.31 + 0.02j):
        for power in range(6):
            assert varying.weights(mu) @ varying.grid**power == pytest.approx(mu**power, rel=1e-12, abs=1e-14)
            if isinstance(mu, float):
                slope = power * mu ** max(power - 1, 0)
                assert varying.slopes(mu) @ varying.grid**power == pytest.approx(slope, rel=1e-11, abs=1e-13)
