"""Eigenvalues of quadratic problems in a region: against QZ, closed forms and ARPACK, and whether misses are noticed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from scipy.optimize import linear_sum_assignment

from stridor.errors import AnalysisError
from stridor.modal.full import basis
from stridor.modal.full.family import Family
from stridor.modal.options import Options
from stridor.modal.quadratic import Quadratic, Region, dense, find_modes, polish, undamped_count
from stridor.modal.quadratic import count as counting
from stridor.modal.quadratic import find as finding
from stridor.modal.quadratic import search as searching
from stridor.modal.quadratic.problem import times
from stridor.modal.quadratic.region import Disc, cells, uncovered

pytestmark = pytest.mark.verification


def quadratic(mass, damping, stiffness) -> Quadratic:
    return Quadratic(
        *(sp.csr_array(np.asarray(a, dtype=float) if not sp.issparse(a) else a) for a in (mass, damping, stiffness))
    )


def chain(n: int):
    """Springs of one between n points and both ends held, (n, n)."""
    return sp.diags_array([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1], format="csr")


def companion(problem: Quadratic) -> np.ndarray:
    """All finite eigenvalues by plain QZ, n at most 300."""
    m, d, k = (a.toarray() for a in (problem.mass, problem.damping, problem.stiffness))
    n = problem.size
    one, none = np.eye(n), np.zeros((n, n))
    a, b = np.block([[-d, -k], [one, none]]), np.block([[m, none], [none, one]])
    alpha, beta = sl.eig(a, b, right=False, homogeneous_eigvals=True)
    finite = np.abs(beta) > 1e-12 * np.abs(alpha)
    return alpha[finite] / beta[finite]


def scattered(n: int, seed: int, *, singular: bool = False) -> Quadratic:
    """Gyroscopic, circulatory, with dashpots at few places, and massless freedoms if asked for."""
    rng = np.random.default_rng(seed)
    mass = 0.5 + rng.random(n)
    if singular:
        mass[::9] = 0.0
    couple = sp.random_array((n, n), density=2 / n, rng=rng)
    turn = sp.random_array((n, n), density=2 / n, rng=rng)
    dashpots = sp.csr_array(rng.standard_normal((n, 3)) * (rng.random((n, 1)) < 0.1))
    stiffness = 1e4 * (chain(n) + 0.3 * couple)
    damping = 3.0 * (turn - turn.T) + 0.2 * sp.eye_array(n) + 8.0 * dashpots @ dashpots.T
    return quadratic(sp.diags_array(mass, format="csr"), sp.csr_array(damping), sp.csr_array(stiffness))


def check(problem, spectrum, reference, region, *, close=1e-9):
    """Same eigenvalues one to one, exact pairs, biorthogonal vectors."""
    bounded = region.bounded()
    wanted = reference[bounded.contains(reference) & (reference.imag >= -1e-9 * bounded.scale)]
    assert len(spectrum.values) == len(wanted)
    away = np.abs(spectrum.values[:, None] - wanted)
    rows, columns = linear_sum_assignment(away)
    assert away[rows, columns].max(initial=0.0) <= close * bounded.scale
    assert spectrum.residual.max(initial=0.0) <= 1e-10
    assert np.allclose(np.linalg.norm(spectrum.right, axis=0), 1.0)
    assert spectrum.completeness.complete, spectrum.completeness.sentence
    order = np.lexsort((spectrum.values.real, spectrum.values.imag))
    assert (order == np.arange(len(order))).all()
    # Independently of the package's own residual, and of which of P and its transpose it took.
    for lam, x in zip(spectrum.values, spectrum.right.T, strict=True):
        assert np.abs(problem.at(lam) @ x).max() <= 1e-10 * (terms(problem, lam) @ np.abs(x)).max()
    if spectrum.left is not None:
        for lam, y in zip(spectrum.values, spectrum.left.T, strict=True):
            assert np.abs(y @ problem.at(lam)).max() <= 1e-10 * (np.abs(y) @ terms(problem, lam)).max()


def terms(problem: Quadratic, lam: complex):
    """|λ|²|M| + |λ||D| + |K|."""
    return abs(lam) ** 2 * abs(problem.mass) + abs(lam) * abs(problem.damping) + abs(problem.stiffness)


def crossed(problem, spectrum) -> np.ndarray:
    """yᵢᵀ((λᵢ+λⱼ)M + D)xⱼ over the size of its terms (k, k)."""
    lam, x, y = spectrum.values, spectrum.right, spectrum.left
    gram = (lam[:, None] + lam) * (y.T @ (problem.mass @ x)) + y.T @ (problem.damping @ x)
    size = np.sqrt(np.abs(np.outer(np.diag(gram), np.diag(gram))))
    return np.abs(gram) / size


@pytest.mark.parametrize("singular", [False, True])
@pytest.mark.parametrize(("n", "seed"), [(30, 1), (90, 2), pytest.param(160, 3, marks=pytest.mark.slow)])
def test_same_as_qz_of_the_companion_form(n, seed, singular):
    problem = scattered(n, seed, singular=singular)
    region = Region.band(1.0, 10.0, above=-40.0)
    spectrum = find_modes(problem, region, left=True)
    check(problem, spectrum, companion(problem), region)
    gram = crossed(problem, spectrum)
    np.fill_diagonal(gram, 0.0)
    assert gram.max(initial=0.0) < 1e-6
    assert len(spectrum.values) > 5
    # One for each disc: a search for left vectors that went wrong would be made good by more.
    assert spectrum.factorisations == len(spectrum.completeness.discs)


@pytest.mark.slow  # in each run: `test_same_as_qz_of_the_companion_form`
def test_large_dense_reference_without_left_vectors():
    problem = scattered(300, 5)
    region = Region.box(-3.0, 60.0, 20.0, 60.0)
    spectrum = find_modes(problem, region)
    check(problem, spectrum, companion(problem), region)
    assert spectrum.left is None
    assert spectrum.left_residual is None
    assert spectrum.factorisations <= 2


def test_a_chain_with_proportional_damping_has_known_eigenvalues():
    n, alpha, beta = 400, 2e-3, 0.05
    k = chain(n)
    problem = quadratic(sp.eye_array(n, format="csr"), alpha * sp.eye_array(n) + beta * k, k)
    squares = 4 * np.sin(np.arange(1, n + 1) * math.pi / (2 * (n + 1))) ** 2
    rate = (alpha + beta * squares) / 2
    exact = -rate + 1j * np.sqrt(squares - rate**2)
    region = Region.box(-0.05, 0.01, 0.0, 0.3)
    spectrum = find_modes(problem, region, left=True)
    check(problem, spectrum, np.concatenate([exact, exact.conj()]), region, close=1e-10)
    assert spectrum.factorisations == 1
    assert spectrum.completeness.missing == 0
    assert "argument principle" in spectrum.completeness.sentence


def test_double_eigenvalues_come_twice_with_independent_biorthogonal_vectors():
    n = 60
    one = quadratic(sp.eye_array(n, format="csr"), 0.01 * chain(n), chain(n))
    turned = np.linalg.qr(np.random.default_rng(4).standard_normal((3, 3)))[0]
    mix = sp.kron(sp.eye_array(n), turned)
    three = [sp.csr_array(mix @ sp.kron(a, sp.eye_array(3)) @ mix.T) for a in (one.mass, one.damping, one.stiffness)]
    problem = quadratic(*three)
    region = Region.box(-0.1, 0.1, 0.2, 0.6)
    spectrum = find_modes(problem, region, left=True)
    reference = np.repeat(companion(one), 3)
    check(problem, spectrum, reference, region, close=1e-10)
    assert np.linalg.matrix_rank(spectrum.right, tol=1e-6) == len(spectrum.values)
    gram = crossed(problem, spectrum)
    np.fill_diagonal(gram, 0.0)
    assert gram.max() < 1e-7


def test_more_copies_than_a_block_has_columns_are_all_found():
    copies, n = 6, 25
    problem = quadratic(
        sp.eye_array(n * copies, format="csr"),
        sp.csr_array((n * copies,) * 2),
        sp.kron(sp.eye_array(copies), chain(n), format="csr"),
    )
    region = Region.box(-0.1, 0.1, 0.05, 0.5)
    spectrum = find_modes(problem, region)
    exact = 2j * np.sin(np.arange(1, n + 1) * math.pi / (2 * (n + 1)))
    check(problem, spectrum, np.repeat(exact, copies), region)
    assert np.linalg.matrix_rank(spectrum.right, tol=1e-6) == len(spectrum.values)


def test_close_pairs_stay_two():
    n = 120
    stiffness = sp.diags_array(np.linspace(1.0, 9.0, n) ** 2, format="lil")
    stiffness[1, 1] = (1.0 + 1e-6) ** 2
    rotation = spl.expm(sp.csc_array(0.3 * (sp.eye_array(n, k=1) - sp.eye_array(n, k=-1))))
    problem = quadratic(sp.eye_array(n, format="csr"), 1e-3 * sp.eye_array(n), rotation.T @ stiffness @ rotation)
    spectrum = find_modes(problem, Region.box(-0.1, 0.1, 0.9, 1.5), left=True)
    squares = np.append(np.delete(np.linspace(1.0, 9.0, n), 1), 1.0 + 1e-6) ** 2
    exact = -5e-4 + 1j * np.sqrt(squares - 2.5e-7)
    check(problem, spectrum, exact, Region.box(-0.1, 0.1, 0.9, 1.5), close=1e-11)
    assert abs(spectrum.values[1] - spectrum.values[0]) == pytest.approx(1e-6, rel=1e-3)


@pytest.mark.parametrize("n", [2, 100])
def test_exceptional_point_of_a_circulatory_pair(n):
    # [[a, b], [−b, c]] with |a − c| = 2b is defective: λ² = −(a + c)/2 twice, with one vector.
    stiffness = np.diag(np.linspace(20.0, 90.0, n))
    stiffness[:2, :2] = [[4.0, 1.0], [-1.0, 6.0]]
    problem = quadratic(np.eye(n), np.zeros((n, n)), stiffness)
    spectrum = find_modes(problem, Region.box(-1.0, 1.0, 1.0, 3.0), left=True)
    assert len(spectrum.values) == 2
    assert spectrum.values == pytest.approx(1j * math.sqrt(5.0), abs=1e-6)
    assert spectrum.residual.max() <= 1e-10
    assert spectrum.completeness.complete


@pytest.mark.parametrize("n", [40, pytest.param(150, marks=pytest.mark.slow)])
def test_rigid_body_motion_and_overdamped_real_pairs(n):
    free = chain(n).tolil()
    free[0, 0] = free[n - 1, n - 1] = 1.0
    damping = sp.csr_array((n, n)).tolil()
    damping[0, 0] = 30.0
    problem = quadratic(sp.eye_array(n, format="csr"), damping.tocsr(), free.tocsr())
    region = Region.box(-40.0, 1.0, 0.0, 0.1)
    spectrum = find_modes(problem, region)
    reference = companion(problem)
    wanted = reference[region.contains(reference) & (reference.imag >= -1e-9)]
    assert len(spectrum.values) == len(wanted)
    assert spectrum.completeness.complete
    real = spectrum.values[spectrum.values.imag == 0].real
    assert np.abs(real).min() < 1e-9
    assert real.min() == pytest.approx(reference.real.min(), rel=1e-9)
    assert spectrum.residual.max() <= 1e-10


def test_free_undamped_structures_have_a_defective_zero():
    n = 150
    free = chain(n).tolil()
    free[0, 0] = free[n - 1, n - 1] = 1.0
    problem = quadratic(sp.eye_array(n, format="csr"), sp.csr_array((n, n)), free.tocsr())
    spectrum = find_modes(problem, Region.box(-0.05, 0.05, 0.0, 0.2), hint=True)
    exact = 2 * np.sin(np.arange(n) * math.pi / (2 * n))
    exact = exact[exact <= 0.2]
    moving = spectrum.values[np.abs(spectrum.values) > 1e-4]
    assert moving == pytest.approx(1j * exact[1:], abs=1e-9)
    # Two copies of zero: both, or one of a pair ±ε.
    assert len(spectrum.values) - len(moving) in (1, 2)
    assert spectrum.residual.max() <= 1e-10
    assert spectrum.completeness.complete
    assert spectrum.completeness.undamped in (len(exact), None)


@pytest.mark.parametrize("n", [1, 2, 61])
def test_tiny_problems(n):
    problem = quadratic(np.eye(n), 0.1 * np.eye(n), np.diag(np.arange(1.0, n + 1)))
    region = Region.box(-1.0, 1.0, 0.0, 20.0)
    spectrum = find_modes(problem, region, left=True)
    check(problem, spectrum, companion(problem), region)
    assert len(spectrum.values) == n


def test_a_region_without_eigenvalues():
    for n in (20, 200):
        problem = scattered(n, 6)
        spectrum = find_modes(problem, Region.box(200.0, 300.0, 0.0, 100.0), left=True)
        assert spectrum.values.shape == (0,)
        assert spectrum.right.shape == (n, 0)
        assert spectrum.completeness.complete


def test_a_shift_that_hits_an_eigenvalue_is_moved():
    squares = np.linspace(1.0, 12.0, 100) ** 2
    squares[10] = 2.0**2
    problem = quadratic(np.eye(100), np.zeros((100, 100)), np.diag(squares))
    region = Region.box(-0.5, 0.5, 1.5, 2.5)
    assert region.grown(0.02).shift() == 2j
    spectrum = find_modes(problem, region)
    check(problem, spectrum, 1j * np.sqrt(squares), region)
    assert spectrum.factorisations == 2


def test_eigenvalues_on_the_border_are_inside():
    squares = np.arange(1.0, 101.0) ** 2
    problem = quadratic(np.eye(100), np.zeros((100, 100)), np.diag(squares))
    spectrum = find_modes(problem, Region.box(0.0, 1.0, 3.0, 9.0))
    assert spectrum.values == pytest.approx(1j * np.arange(3.0, 10.0), abs=1e-9)
    assert spectrum.completeness.complete


def test_an_inner_basis_bound_leads_to_more_shifts_not_to_missing_modes(monkeypatch):
    monkeypatch.setattr(finding, "FEWEST", 48)
    monkeypatch.setattr(finding, "LARGEST", 48)
    n = 200
    problem = quadratic(sp.eye_array(n, format="csr"), 1e-3 * sp.eye_array(n), chain(n))
    region = Region.box(-0.1, 0.1, 0.0, 0.6)
    spectrum = find_modes(problem, region)
    check(problem, spectrum, companion(problem), region)
    assert spectrum.factorisations > 1


def test_a_guess_changes_nothing_but_the_cost():
    problem = scattered(160, 3)
    region = Region.box(-3.0, 60.0, 20.0, 40.0)
    plain = find_modes(problem, region)
    nearby = plain.right * (1 + 1e-3 * np.random.default_rng(1).standard_normal(plain.right.shape))
    guessed = find_modes(problem, region, guess=nearby)
    assert guessed.values == pytest.approx(plain.values, abs=1e-8)
    assert guessed.completeness.complete
    wrong = find_modes(problem, region, guess=np.eye(160)[:, :1])
    assert wrong.values == pytest.approx(plain.values, abs=1e-8)


# -- completeness -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("left", [False, True])
def test_a_mode_dropped_again_and_again_is_reported_missing(monkeypatch, left):
    whole = finding._collected

    def dropping(search):
        found = whole(search)
        keep = np.arange(len(found.values)) != np.argmin(np.abs(found.values - 30j))
        return searching.DiscModes(found.values[keep], found.shapes[:, keep], found.error[keep])

    monkeypatch.setattr(finding, "_collected", dropping)
    monkeypatch.setattr(finding, "WHOLE", 0)  # else QZ would find it
    spectrum = find_modes(scattered(160, 3), Region.box(-3.0, 60.0, 20.0, 40.0), left=left)
    assert not spectrum.completeness.complete
    assert spectrum.completeness.missing == 1
    assert "INCOMPLETE" in spectrum.completeness.sentence


def test_a_mode_dropped_once_is_found_again(monkeypatch):
    whole, calls = finding._collected, []

    def dropping(search):
        found = whole(search)
        calls.append(search)
        if len(calls) > 1:
            return found
        return searching.DiscModes(found.values[1:], found.shapes[:, 1:], found.error[1:])

    monkeypatch.setattr(finding, "_collected", dropping)
    problem, region = scattered(160, 3), Region.box(-3.0, 3.0, 20.0, 40.0)
    spectrum = find_modes(problem, region)
    check(problem, spectrum, companion(problem), region)
    assert len(calls) > 1


def test_a_start_blind_to_half_of_the_structure_is_seen_through_without_a_count(monkeypatch):
    half = scattered(80, 8)
    other = replace(half, stiffness=sp.csr_array(1.1 * half.stiffness))
    parts = zip((half.mass, half.damping, half.stiffness), (other.mass, other.damping, other.stiffness), strict=True)
    problem = quadratic(*(sp.block_diag(pair, format="csr") for pair in parts))
    whole = searching.start

    def blind(rows, columns, seed):
        block = whole(rows, columns, seed)
        if seed == searching.SEED:
            block[80:] = 0.0
        return block

    monkeypatch.setattr(searching, "start", blind)
    monkeypatch.setattr(finding, "COUNTED", 0)
    region = Region.box(-5.0, 5.0, 20.0, 60.0)
    spectrum = find_modes(problem, region)
    check(problem, spectrum, companion(problem), region)
    assert spectrum.completeness.later > 0
    assert spectrum.completeness.counted is None
    both = find_modes(problem, region, left=True)
    check(problem, both, companion(problem), region)


def test_the_argument_principle_counts_what_is_not_known():
    problem = scattered(120, 9)
    lam = companion(problem)
    inner, outer = Region.box(-5.0, 5.0, 20.0, 50.0), Region.box(-6.0, 6.0, 19.0, 51.0)
    contour = counting.between(inner, outer, lam)
    inside = lam[contour.contains(lam, slack=0.0)]
    assert len(inside) > 5
    for gone in (0, 1, 2, len(inside)):
        known = np.concatenate([inside[gone:], lam[~contour.contains(lam, slack=0.0)]])
        box = contour
        assert counting.unknown(problem, box, box, known) == gone
    assert counting.unknown(problem, contour, contour, np.append(lam, 0.1 + 30j)) == -1


def test_discs_that_leave_a_corner_do_not_cover():
    region = Region.box(0.0, 1.0, 0.0, 1.0)
    assert uncovered(region, [Disc(0.5 + 0.5j, 0.70, 0, 1.0)])
    assert not uncovered(region, [Disc(0.5 + 0.5j, 0.71, 0, 1.0)])
    assert not uncovered(region, [Disc(0.5 + 0.2j, 0.65, 0, 1.0), Disc(0.5 + 0.8j, 0.65, 0, 1.0)])
    assert uncovered(region, [Disc(0.5 + 0.2j, 0.55, 0, 1.0), Disc(0.5 + 0.8j, 0.55, 0, 1.0)])


def test_regions():
    band = Region.band(10.0, 100.0, above=-5.0)
    assert band.re_max == math.inf
    assert band.bounded().re_max == pytest.approx(200 * math.pi)
    assert len(cells(band.bounded())) == 1
    assert len(cells(Region.box(-400.0, 900.0, 0.0, 600.0))) == 3
    assert len(cells(Region.box(-5.0, 900.0, 0.0, 500.0))) == 2
    assert len(cells(Region.band(10.0, 100.0, above=-5.0, below=5.0))) == 1
    for wrong in ((1, 0, 0, 1), (0, 1, 1, 0), (0, 1, 0, math.inf), (0, 0, 1, 1), (-math.inf, 0, 0, 1)):
        with pytest.raises(ValueError, match="region"):
            Region(*wrong)
    with pytest.raises(ValueError, match="band"):
        Region.band(3.0, 2.0, above=0.0)


@pytest.mark.parametrize("n", [10, 90])
def test_a_motion_with_neither_mass_nor_stiffness_is_an_error(n):
    flat = np.ones(n)
    flat[3] = 0.0
    with pytest.raises(AnalysisError, match="singular"):
        find_modes(quadratic(np.diag(flat), np.zeros((n, n)), np.diag(flat)), Region.box(-1, 1, 0, 2))


@pytest.mark.slow  # in each run: `test_same_as_qz_of_the_companion_form`
def test_a_grid_of_five_thousand_freedoms_as_arpack_has_it():
    a, b = 71, 70
    plate = sp.csr_array(sp.kron(chain(a), sp.eye_array(b)) + 1.7 * sp.kron(sp.eye_array(a), chain(b)))
    n = a * b
    rng = np.random.default_rng(11)
    follow = sp.diags_array(rng.random(n) * 2e-3, format="csr") @ sp.eye_array(n, k=1)
    spin = sp.diags_array(1e-2 * rng.random(n - 1), offsets=1)
    rim = sp.diags_array((rng.random(n) < 0.05) * 0.02)
    damping = spin - spin.T + rim + 1e-3 * plate
    mass = sp.csr_array(sp.eye_array(n) + sp.diags_array(0.1 * rng.random(n)))
    problem = quadratic(mass, sp.csr_array(damping), sp.csr_array(plate + follow))
    region = Region.band(0.0, 0.35 / (2 * math.pi), above=-0.02, below=0.02)
    spectrum = find_modes(problem, region, left=True)
    one = sp.eye_array(n)
    upper = sp.block_array([[-problem.damping, -problem.stiffness], [one, None]], format="csc").astype(complex)
    lower = sp.block_diag([mass, one], format="csc")
    reference = spl.eigs(upper, k=60, M=lower, sigma=0.175j, return_eigenvectors=False)
    assert np.abs(reference - 0.175j).max() > 0.19
    check(problem, spectrum, reference, region, close=1e-9)
    gram = crossed(problem, spectrum)
    np.fill_diagonal(gram, 0.0)
    assert gram.max() < 1e-6
    assert spectrum.factorisations == 1
    assert spectrum.memory_bytes > 0
    assert "without a count" in spectrum.completeness.sentence


def test_undamped_count_is_the_number_of_modes_in_the_band():
    n = 50
    problem = quadratic(sp.eye_array(n, format="csr"), sp.csr_array((n, n)), chain(n))
    number = undamped_count(problem, Region.box(-1, 1, 0.1, 0.5))
    exact = 2 * np.sin(np.arange(1, n + 1) * math.pi / (2 * (n + 1)))
    assert number in (None, int(((exact > 0.1) & (exact < 0.5)).sum()))


@pytest.mark.parametrize("columns", [None, 0, 1, 2, 5])
@pytest.mark.parametrize("given", [float, complex])
def test_products_with_complex_columns(columns, given):
    rng = np.random.default_rng(6)
    shape = (30,) if columns is None else (30, columns)
    matrix = sp.random_array((20, 30), density=0.2, rng=rng).tocsr().astype(given)
    matrix = matrix * (1 + 2j) if given is complex else matrix
    block = np.asarray(rng.standard_normal(shape) + 1j * rng.standard_normal(shape), order="F")
    np.testing.assert_allclose(times(matrix, block), matrix.toarray() @ block, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(times(matrix.T, block[:20]), matrix.toarray().T @ block[:20], rtol=1e-13, atol=1e-13)


def held(seed: int) -> tuple[Quadratic, np.ndarray]:
    """Contacts that hold rigidly while friction pushes, and all finite eigenvalues, with the contacts eliminated."""
    rng = np.random.default_rng([seed, 11])
    n, m = int(rng.integers(8, 41)), int(rng.integers(1, 4))
    mass, stiffness = np.diag(10.0 ** rng.uniform(-3, 0, n)), 10.0 ** rng.uniform(0, 8) * chain(n).toarray()
    normals, pushes = rng.standard_normal((m, n)), rng.standard_normal((m, n))
    pushes = normals + rng.uniform(0, 1) * pushes
    none = np.zeros((m, m))
    whole = np.block([[stiffness, pushes.T], [normals, none]])
    right, left = sl.null_space(normals), sl.null_space(pushes)
    truth = 1j * np.sqrt(sl.eigvals(left.T @ stiffness @ right, left.T @ mass @ right).astype(complex))
    padded = sl.block_diag(mass, none)
    return quadratic(padded, np.zeros_like(padded), whole), np.concatenate([truth, -truth])


@pytest.mark.parametrize("seeds", [range(60), pytest.param(range(60, 2000), marks=pytest.mark.slow)], ids=len)
def test_infinite_eigenvalues_of_rigid_contacts_are_told_from_fast_ones(seeds) -> None:
    for seed in seeds:
        problem, truth = held(seed)
        values, _, _ = dense.all_modes(problem)
        assert len(values) == len(truth), seed
        np.testing.assert_allclose(np.sort(np.abs(values)), np.sort(np.abs(truth)), rtol=1e-4, err_msg=str(seed))


@pytest.mark.parametrize("coupling", [0.3, 1e-3, 0.0])
def test_a_defective_eigenvalue_is_not_taken_for_an_infinite_one(coupling: float) -> None:
    values, _, _ = dense.all_modes(quadratic(np.eye(2), np.zeros((2, 2)), np.array([[1.0, coupling], [0.0, 1.0]])))
    assert np.sort_complex(values) == pytest.approx(np.array([-1j, -1j, 1j, 1j]), abs=1e-7)


def test_fast_eigenvalues_are_not_taken_for_infinite_ones() -> None:
    """Masses over eight decades and springs over ten have all of theirs."""
    for seed in range(40):
        rng = np.random.default_rng([seed, 12])
        n = int(rng.integers(3, 40))
        mass, spring = (np.diag(10.0 ** (most * rng.uniform() * rng.uniform(size=n))) for most in (-8, 10))
        rows = rng.standard_normal((n, n))
        damping = 10.0 ** rng.uniform(-4, 3) * np.diag(rng.uniform(0, 1, n))
        values, _, _ = dense.all_modes(quadratic(mass, damping, rows @ rows.T + 0.5 * rows + spring))
        assert len(values) == 2 * n, seed


@pytest.mark.parametrize("left", [False, True])
@pytest.mark.parametrize(("n", "seed"), [(160, 3), *(pytest.param(*of, marks=pytest.mark.slow) for of in ((200, 11), (250, 4)))])
def test_a_region_on_the_real_axis_is_searched_in_real_arithmetic(n, seed, left, monkeypatch):
    problem = scattered(n, seed, singular=seed == 4)
    region = Region.band(0.0, 8.0, above=-2.0)
    kinds = []

    def seen(matrix, **options):
        kinds.append(matrix.dtype.kind)
        return factorise(matrix, **options)

    factorise = finding.factorise
    monkeypatch.setattr(finding, "factorise", seen)
    spectrum = find_modes(problem, region, left=left, count=False)
    assert kinds == ["f"]
    check(problem, spectrum, companion(problem), region)
    assert len(spectrum.values) > 5
    assert np.any(spectrum.values.imag > 0)
    assert spectrum.completeness.later == 0
    # The same by complex arithmetic, about the middle of the region.
    monkeypatch.setattr(Region, "real_shift", lambda self: None)
    other = find_modes(problem, region, left=left, count=False)
    assert set(kinds[1:]) == {"c"}
    assert other.values == pytest.approx(spectrum.values, rel=1e-9)


def test_a_mode_that_the_first_real_block_lacks_is_brought_by_the_second_once():
    """A block that is blind to one structure of two: the look from another sees it, as one mode and not with its
    conjugate as two."""
    n = 120
    one = scattered(n, 3)
    parts = [sp.block_diag([a, a], format="csr") for a in one.matrices()]
    problem = quadratic(parts[0], parts[1], sp.block_diag([one.stiffness, 1.37 * one.stiffness], format="csr"))
    region = Region.band(0.0, 4.0, above=-2.0)
    reference = find_modes(problem, region, count=False)

    class Blind(searching.Search):
        def run(self, guess=None):
            block = searching.start(problem.size, 3, 5)
            block[n:] = 0.0
            self._waiting = self.krylov.add(self.krylov.smooth(block))
            self._grow(24)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(finding, "Search", Blind)
        found = find_modes(problem, region, count=False)
    assert found.values == pytest.approx(reference.values, rel=1e-9)
    disc = found.completeness.discs[0]
    lam = companion(quadratic(one.mass, one.damping, 1.37 * one.stiffness))
    hidden = lam[(np.abs(lam - disc.centre) <= disc.radius) & (lam.imag >= 0)]
    assert found.completeness.later == len(hidden) > 2
    assert f"brought {len(hidden)} more and then no other" in found.completeness.sentence


@pytest.mark.parametrize("given", [True, False])
@pytest.mark.parametrize("copies", [1, 2, 3])
def test_a_poor_pair_is_polished_even_where_it_is_defective(copies: int, given: bool) -> None:
    n, rng = 120, np.random.default_rng(0)
    squares = np.diag(1e4 * np.arange(1.0, n + 1) ** 2)
    for k in range(1, copies):
        squares[k, k], squares[k - 1, k] = squares[0, 0], 0.3 * squares[0, 0]
    rows, columns = (np.eye(n) + 0.3 * sp.random_array((n, n), density=0.02, rng=rng).toarray() for _ in range(2))
    problem = quadratic(rows @ columns, np.zeros((n, n)), rows @ squares @ columns)
    lam, x = 100j * (1 + 1e-6), np.linalg.solve(columns, np.eye(n)[:, 0]) + 1e-6 * rng.standard_normal(n)
    for side, start in ((problem, x + 0j if given else None), (problem.transposed, None)):
        found = polish.polished(side, lam, start, solver=None)
        assert found is not None
        assert found[2] < 1e-10
        assert found[2] == side.backward_error(np.array([found[0]]), found[1][:, None])[0]
        # Copies k times over are known to the k-th root of that.
        assert abs(found[0] - 100j) < 100 * (1e-12, 1e-5, 1e-3)[copies - 1]


def test_a_mode_that_passes_zero_beside_a_free_motion_is_not_refused(monkeypatch):
    """Two eigenvalues that are all but one, 0 and ε, may leave left vectors no better than 1e-10: what QZ gives of small
    problems is taken to 1e-8 where it does not get closer, as that of larger ones is, and told with what it leaves."""
    turn = np.linalg.qr(np.random.default_rng(5).standard_normal((3, 3)))[0]
    parts = ([1.0, 1.0, 2.0], [-1e-7, 0.02, 0.02], [0.0, 1.0, 3.0])
    problem = Quadratic(*(sp.csr_array(turn @ np.diag(d) @ turn.T) for d in parts))
    region = Region.band(0.0, 3.0, above=-1.0)
    found = find_modes(problem, region, left=True, tolerance=1e-30)
    assert len(found.values) == 4
    assert max(found.residual.max(), found.left_residual.max()) < finding.CROWDED
    monkeypatch.setattr(finding, "CROWDED", 1e-30)
    with pytest.raises(AnalysisError, match="do not reach a backward error"):
        find_modes(problem, region, left=True, tolerance=1e-30)
    # What may be a motion as a whole need not reach it.
    assert len(find_modes(problem, region, left=True, tolerance=1e-30, still=10.0).values) == 4


def test_full_solves_over_friction_ask_nothing_of_motions_as_a_whole(monkeypatch):
    asked = []
    free = np.array([[1.0, -1.0], [-1.0, 1.0]])
    monkeypatch.setattr(basis, "find_modes", lambda *a, **k: asked.append(k["still"]) or find_modes(*a, **k))
    for held in (0.0, 1.0):

        def at(mu, held=held):
            parts = np.eye(2), 0.1 * np.eye(2), (1 + 0.1 * mu) * free + held * np.eye(2)
            return Quadratic(*(sp.csr_array(part) for part in parts))

        basis.Whole(Family((0.0, 1.0), at, Options()), 2.0).eigenpairs(0.5)
    assert asked[0] > 0.0
    assert asked[1] == 0.0
