"""Complex modes against dense eigenvalues of the full unsymmetric pencil; vectors, residuals, branches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.optimize import linear_sum_assignment

from benches import Slave, bench, by_hand, distance_to, full_eigenvalues, paper_case
from stridor import build_system
from stridor.laws import Weakening
from stridor.modal.backward_error import BackwardError
from stridor.modal.complex_modes import complex_modes
from stridor.modal.coupling import couple
from stridor.modal.krylov import krylov_modes
from stridor.modal.receptance_modes import prepare
from stridor.sliding import steady_sliding
from stridor.system import System

pytestmark = pytest.mark.verification

TWIN = Slave(place=0.45, end="clamped", lean_deg=15, elements=4)
BENCHES = {
    "paper": lambda: bench(Slave(elements=8), elements=18),
    "leaning the other way": lambda: bench(Slave(lean_deg=-12)),
    "between two nodes": lambda: bench(Slave(place=0.63)),
    "two contacts": lambda: bench(
        Slave(place=0.4), Slave(place=0.9, lean_deg=-8, length=0.04, stiffness=1e6)
    ),
    "three contacts on both sides": lambda: bench(
        Slave(place=0.35), Slave(place=0.6, side=-1, length=0.03), Slave(place=0.85, lean_deg=20)
    ),
    "rigid": lambda: bench(Slave(stiffness="rigid")),
    "rigid and soft": lambda: bench(Slave(place=0.5, stiffness="rigid"), Slave(place=0.8, stiffness=2e4)),
    "two dampings": lambda: bench(Slave(damping=(300.0, 3e-7))),
    "lumped": lambda: bench(Slave(), mass="lumped"),
    "identical slaves": lambda: bench(TWIN, replace(TWIN, place=0.75), elements=10),
    "identical and mirrored": lambda: bench(TWIN, replace(TWIN, side=-1)),
    "upright master": lambda: bench(Slave(), angle_deg=90.0),
    "any angle": lambda: bench(Slave(end="clamped", lean_deg=25), angle_deg=37.0),
    "soft contact": lambda: bench(Slave(stiffness=1e3)),
    "symmetric slave": lambda: bench(Slave(lean_deg=0.0)),
    "contact at the free end": lambda: bench(Slave(place=1.0)),
    "overdamped": lambda: bench(Slave(damping=(5e3, 3e-5)), damping=(2e3, 1e-5), elements=9),
    "overdamped everywhere": lambda: bench(Slave(damping=(3e4, 2e-4)), damping=(3e4, 2e-4), elements=8),
}


@pytest.fixture(scope="module", params=BENCHES)
def system(request) -> System:
    """Without loads every contact counts as touching: the eigenproblem alone."""
    return replace(BENCHES[request.param](), loads={})


@pytest.mark.parametrize("damped", [False, True])
def test_eigenvalues_match_the_full_pencil(system, damped):
    mu = np.array([0.0, 0.1, 0.45])
    modes = complex_modes(system, mu, max_frequency_hz=30e3, damped=damped)
    # Of two real branches that have become a pair, one is NaN.
    known = np.isfinite(modes.eigenvalues)
    assert modes.residual[known].max() < 1e-9
    assert np.array_equal(known, np.isfinite(modes.residual))
    assert np.all(modes.eigenvalues[known].imag >= 0)
    reference = system if damped else system.undamped()
    for row, m in enumerate(mu):
        dense = full_eigenvalues(reference, m)
        # The dense answer's error is relative to the largest eigenvalue (undamped: to its square).
        found = modes.eigenvalues[row, known[row]]
        loss = 1e-14 * np.abs(dense).max() ** 2 / np.abs(found) ** 2
        assert np.all(distance_to(found, dense) < 1e-7 + loss)
        assert len(modes.branch) > 5
    # None is missing at μ = 0, none is there twice.
    dense = full_eigenvalues(reference, 0.0)
    band = dense[(dense.imag > 100.0) & (dense.imag < 2 * np.pi * 29.9e3)]
    got = modes.eigenvalues[0]
    got = got[(got.imag > 100.0) & (got.imag < 2 * np.pi * 29.9e3)]
    assert len(got) == len(band)
    rows, columns = linear_sum_assignment(np.abs(got[:, None] - band))
    assert np.all(np.abs(got[rows] - band[columns]) < 1e-4 * np.abs(band[columns]))


def test_every_growing_mode_is_among_the_branches(system):
    modes = complex_modes(system, [0.3, 0.8], max_frequency_hz=40e3)
    for row, m in enumerate(modes.mu):
        dense = full_eigenvalues(system, m)
        growing = dense[
            (dense.imag > 0) & (dense.imag < 2 * np.pi * 28e3) & (dense.real > 1e-5 * np.abs(dense))
        ]
        for value in growing:
            assert np.abs(modes.eigenvalues[row] - value).min() < 1e-4 * abs(value)


def assembled(system: System, lam: complex, mu: float) -> np.ndarray:
    """P(λ) of the whole system; soft contacts only."""
    sense = [-np.sign(c.tangent_lift.sum()) for c in system.contacts]
    stiffness = system.stiffness.toarray()
    for c, s in zip(system.contacts, sense, strict=True):
        stiffness = stiffness + c.stiffness * np.outer(c.normal_row + mu * s * c.tangent_row, c.normal_row)
    return lam**2 * system.mass.toarray() + lam * system.damping.toarray() + stiffness


@pytest.mark.parametrize("name", ["paper", "two contacts", "two dampings", "identical slaves", "any angle"])
def test_right_and_left_vectors(name):
    system = replace(BENCHES[name](), loads={})
    mu = 0.3
    modes = complex_modes(system, mu, count=12, vectors=True)
    lam, right, left = modes.eigenvalues[0], modes.right[0], modes.left[0]
    for k in range(12):
        matrix = assembled(system, lam[k], mu)
        size = np.abs(matrix) @ np.abs(right[k])
        assert np.abs(matrix @ right[k]).max() < 1e-11 * size.max()
        size = np.abs(matrix.T) @ np.abs(left[k])
        assert np.abs(left[k] @ matrix).max() < 1e-11 * size.max()
        assert np.linalg.norm(right[k]) == pytest.approx(1)
        assert np.linalg.norm(left[k]) == pytest.approx(1)
    # Bi-orthogonality of a quadratic problem: yᵀ((λi + λj) M + C) x = 0 for i ≠ j.
    mass, damping = system.mass.toarray(), system.damping.toarray()
    product = (left @ mass @ right.T) * (lam[:, None] + lam) + left @ damping @ right.T
    own = np.abs(np.diag(product))
    product = np.abs(product) / np.sqrt(np.outer(own, own))
    np.fill_diagonal(product, 0.0)
    separate = np.abs(lam[:, None] - lam) > 1e-6 * np.abs(lam)
    assert product[separate].max() < 1e-6


def test_quantities_follow_their_definitions():
    modes = complex_modes(bench(), [0.0, 0.5], count=8)
    lam = modes.eigenvalues
    np.testing.assert_allclose(modes.frequency_hz, lam.imag / (2 * np.pi))
    np.testing.assert_allclose(modes.growth_rate, lam.real)
    np.testing.assert_allclose(modes.damping_ratio, -lam.real / np.abs(lam))
    # Proportional damping, no friction: the ratio of eq. 13 of the paper.
    omega = np.abs(lam[0])
    np.testing.assert_allclose(modes.damping_ratio[0], 0.5 * (50.0 / omega + 1e-8 * omega), rtol=1e-4)
    assert np.all(np.diff(modes.frequency_hz[0]) >= 0)
    document = modes.to_json()
    assert [r["frequency_hz"] for r in document["modes"][1]] == sorted(modes.frequency_hz[1])


def test_the_residual_is_honest():
    """It is the relative change of λ that a wrong eigenvalue shows, and does not fall below the truth."""
    system = bench(Slave(stiffness=1e7))
    mu = 0.2
    modes = complex_modes(system, mu, count=10, vectors=True)
    _, coupling, _ = prepare(system)
    judge = BackwardError(coupling)
    lam, right = modes.eigenvalues[0], modes.right[0].T
    clean = judge(lam, right, mu)
    np.testing.assert_allclose(clean, modes.residual[0], rtol=1.0)
    assert clean.max() < 1e-12
    for wrong in (1e-6, 1e-4):
        spoiled = judge(lam * (1 + wrong), right, mu)
        assert np.all(spoiled > 1e3 * clean)
        assert np.all(spoiled < 4 * wrong)
    assert judge(lam, right, mu + 0.05).max() > 1e-6
    rng = np.random.default_rng(0)
    assert judge(lam, rng.standard_normal(right.shape) + 0j, mu).min() > 1e-3
    left = modes.left[0].T
    assert judge(lam, left, mu, left=True).max() < 1e-12
    assert judge(lam, left, mu).max() > 1e-8


def mac_order(system, mu) -> np.ndarray:
    """Branches by bi-orthogonal MAC from dense vectors on a fine sweep: independent of the tracker."""
    import scipy.linalg as sl

    mass = system.mass.toarray()
    values, previous = [], None
    for m in mu:
        contact = system.contacts[0]
        push = contact.normal_row - m * np.sign(contact.tangent_lift.sum()) * contact.tangent_row
        stiffness = system.stiffness.toarray() + contact.stiffness * np.outer(push, contact.normal_row)
        square, left, right = sl.eig(stiffness, mass, left=True)
        order = np.argsort(square.real)[:14]
        square, left, right = square[order], left[:, order], right[:, order]
        scale = np.sqrt(np.einsum("ij,ij->j", left.conj(), mass @ right))
        left, right = left / scale.conj(), right / scale
        if previous is not None:
            mac = np.abs(previous[0].conj().T @ mass @ right) * np.abs(left.conj().T @ mass @ previous[1]).T
            _, pick = linear_sum_assignment(-mac)
            square, left, right = square[pick], left[:, pick], right[:, pick]
        previous = (left, right)
        values.append(np.sqrt(-square + 0j))
    return np.array(values)


def test_branches_do_not_swap():
    system = bench(Slave(lean_deg=8.0)).undamped()
    mu = np.linspace(0, 0.05, 201)
    modes = complex_modes(system, mu, count=12, damped=False)
    crossing = np.argsort(modes.frequency_hz[-1])
    reference = np.abs(mac_order(system, mu).imag)[:, :12]
    np.testing.assert_allclose(np.abs(modes.eigenvalues.imag), reference, rtol=1e-6)
    assert len(np.unique(crossing)) == 12


def test_a_true_crossing_is_crossed():
    """One mode that friction moves and one that it does not: sorted order would swap them."""
    mass, stiffness = np.eye(3), np.diag([1.0, 4.0, 0.0])
    stiffness[2, 2] = 1.2**2
    # Contact along freedom 0; friction through the pair (0, 1); freedom 2 stands apart at ω = 1.2.
    system = by_hand(mass, np.zeros((3, 3)), stiffness, [[1, 0, 0]], [[-0.5, 0, 0]], 1.0, slip=-1.0)
    mu = np.linspace(0, 1.9, 39)
    modes = complex_modes(system, mu, count=3, damped=False)
    moving = np.sqrt(2 - 0.5 * mu)
    own = np.argmin(np.abs(modes.eigenvalues[0].imag - np.sqrt(2)))
    np.testing.assert_allclose(modes.eigenvalues[:, own].imag, moving, rtol=1e-9)
    assert moving[0] > 1.2 > moving[-1]
    apart = np.argmin(np.abs(modes.eigenvalues[0].imag - 1.2))
    np.testing.assert_allclose(modes.eigenvalues[:, apart].imag, 1.2, rtol=1e-12)


def test_results_do_not_depend_on_the_sweep():
    system = bench(Slave(end="clamped", lean_deg=30))
    fine = complex_modes(system, np.linspace(0, 1, 101), count=10)
    shuffled = complex_modes(system, [1.0, 0.0, 0.37], count=10)
    for row, same in ((0, 100), (1, 0), (2, 37)):
        # Which of two modes that have met is which beyond the meeting is a convention: compare as sets.
        got, expected = (np.sort_complex(m) for m in (shuffled.eigenvalues[row], fine.eigenvalues[same]))
        np.testing.assert_allclose(got, expected, rtol=1e-8)


def test_friction_that_weakens_damps_negatively():
    law = {"law": "weakening", "coefficient": 0.1, "static_coefficient": 0.4, "decay_speed": 0.02}
    system = bench(Slave(friction=law, end="clamped", lean_deg=20))
    for mu in (0.15, 0.4):
        modes = complex_modes(system, [mu], max_frequency_hz=30e3)
        steady = steady_sliding(system, mu=mu)
        slope = Weakening(0.1, 0.4, 0.02).scaled(mu, 0.02).slope(0.02) * steady.normal_force
        assert slope[0] < 0
        dense = full_eigenvalues(system, mu, slopes=slope)
        assert distance_to(modes.eigenvalues[0], dense).max() < 1e-7
        assert modes.residual.max() < 1e-10
        # The traction modes of the master feel the slip only through that slope: they are there, too.
        band = dense[(dense.imag > 0) & (dense.imag < 2 * np.pi * 25e3)]
        assert distance_to(band, modes.eigenvalues[0]).max() < 1e-6
        without = full_eigenvalues(system, mu)
        assert distance_to(modes.eigenvalues[0], without).max() > 1e-5


def test_a_slope_counts_for_nothing_without_friction():
    law = {"law": "weakening", "coefficient": 0.1, "static_coefficient": 0.4, "decay_speed": 0.02}
    sloped, plain = (
        complex_modes(bench(Slave(friction=f)), [0.0, 1e-9], count=12) for f in (law, Slave().friction)
    )
    np.testing.assert_allclose(sloped.eigenvalues, plain.eigenvalues, rtol=1e-7)
    assert sloped.residual[0].max() < 1e-11


def test_an_open_contact_takes_no_part():
    lifted = Slave(place=0.9, end="clamped", force=-3.0)
    system = bench(Slave(place=0.5), lifted)
    modes = complex_modes(system, 0.2, count=10)
    assert modes.open_contacts == ("C1",)
    alone = full_eigenvalues(replace(system, contacts=system.contacts[:1]), 0.2)
    assert distance_to(modes.eigenvalues[0], alone).max() < 1e-6


def test_a_point_mass_on_a_beam_whose_damping_is_then_not_proportional():
    """361 freedoms from 100 Hz to above 100 MHz: no pole is lost, and low ones are as sharp as with sparse matrices."""
    system = build_system(paper_case())
    rows = system.points["beam1.end"].free
    rows = sp.csr_array(rows)[:2]
    heavier = replace(system, mass=sp.csr_array(system.mass + 2.93e-4 * (rows.T @ rows)))
    ours = complex_modes(heavier, [0.0, 0.1], max_frequency_hz=40e3)
    sparse = krylov_modes(heavier, [0.0, 0.1], max_frequency_hz=40e3)
    np.testing.assert_allclose(ours.eigenvalues, sparse.eigenvalues, rtol=1e-7)
    assert ours.residual.max() < 1e-11


def test_slopes_of_the_contact_problem_with_weakening_friction():
    """∂T/∂λ and ∂T/∂μ of T(λ, μ) against central differences, with receptances of a structure written down."""
    system = bench(Slave(), Slave(place=0.3, side=-1), velocity=0.7)
    system = replace(system, contacts=tuple(replace(c, law=Weakening(0.1, 0.5, 0.4)) for c in system.contacts))
    coupling, _ = couple(system)
    assert coupling.sloped
    rng = np.random.default_rng(3)
    q = 2 * coupling.contacts
    mass, damping, stiffness = (b @ b.T + np.eye(q) for b in rng.standard_normal((3, q, q)))

    def receptance(at):
        flexibility = np.linalg.inv(at**2 * mass + at * damping + 40 * stiffness)
        return flexibility, -flexibility @ (2 * at * mass + damping) @ flexibility

    def matrices(at, mu):
        value, slope = receptance(at)
        return [part[0] for part in coupling.matrices(np.array([at]), mu, value[None], slope[None])]

    lam, mu, step = -0.3 + 5.0j, 0.24, 1e-5
    _, by_lambda, by_mu = matrices(lam, mu)
    for direction in (1.0, 1j):
        change = (matrices(lam + step * direction, mu)[0] - matrices(lam - step * direction, mu)[0]) / (2 * step)
        np.testing.assert_allclose(change / direction, by_lambda, rtol=1e-7, atol=1e-8 * np.abs(by_lambda).max())
    change = (matrices(lam, mu + step)[0] - matrices(lam, mu - step)[0]) / (2 * step)
    np.testing.assert_allclose(change, by_mu, rtol=1e-6, atol=1e-7 * np.abs(by_mu).max())
