"""Certified reduction against dense eigenproblems of the full matrices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp
from scipy.io import mmwrite
from scipy.optimize import linear_sum_assignment

from benches import paper_case
from solid_cases import bench_as_solids, case
from stridor.case import load
from stridor.errors import AnalysisError, CaseError
from stridor.modal.complex_modes import complex_modes
from stridor.modal.full import onsets_along
from stridor.modal.onsets import onsets
from stridor.modal.parametric import Parameter, ParametricProblem, Term, contact_parameters, craig_bampton, reduce
from stridor.modal.parametric.basis import residual
from stridor.modal.parametric.dense import dense_modes
from stridor.modal.parametric.factors import Product
from stridor.modal.parametric.full import verified
from stridor.modal.parametric.states import States
from stridor.modal.shift_inverted import damped_pairs
from stridor.study.reduced import parametric_problem, reduced_model
from stridor.system import build_system

pytestmark = pytest.mark.verification


def grid(n: int) -> sp.csr_array:
    """Stiffness of an n × n net of unit springs, held at its rim."""
    line = sp.diags_array([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1])
    return sp.csr_array(sp.kron(line, sp.eye_array(n)) + sp.kron(sp.eye_array(n), line))


def rotor(n: int = 10) -> ParametricProblem:
    """Two nets side by side in u and v, with gyroscopic, circulatory and low-rank damping terms in Ω, μ."""
    rng = np.random.default_rng(3)
    size = n * n
    net = grid(n)
    mass = sp.csr_array(sp.kron(sp.eye_array(2), sp.diags_array(1 + 0.3 * rng.random(size))))
    stiffness = sp.csr_array(sp.block_diag([net, 1.07 * net]))
    turn = sp.csr_array(sp.kron(np.array([[0.0, -1.0], [1.0, 0.0]]), sp.diags_array(rng.random(size))))
    few = sp.csr_array(sp.random_array((2 * size, 3), density=0.1, rng=rng))
    patch = np.zeros(size)
    patch[: 2 * n] = 0.05
    follow = sp.csr_array(sp.kron(np.array([[0.0, 1.0], [0.0, 0.0]]), sp.diags_array(patch)))

    def omega(p: Mapping[str, float]) -> float:
        return p["Omega"]

    def inverse(p: Mapping[str, float]) -> float:
        return 1.0 / p["Omega"]

    return ParametricProblem(
        (
            Term(mass, "mass", lambda _: 1.0, symmetric=True),
            Term(stiffness, "stiffness", lambda _: 1.0, symmetric=True),
            Term(0.002 * stiffness, "damping", lambda _: 1.0, symmetric=True),
            Term(0.05 * turn, "damping", omega),
            Term(sp.csr_array(0.02 * few @ few.T), "damping", inverse, symmetric=True),
            Term(-0.001 * mass, "stiffness", lambda p: p["Omega"] ** 2, symmetric=True),
            Term(follow, "stiffness", lambda p: p["mu"]),
        ),
        (Parameter("Omega", 0.5, 3.0, 1.0), Parameter("mu", 0.0, 0.6, 0.3)),
    )


def eigenvalues(problem: ParametricProblem, values: Mapping[str, float]) -> np.ndarray:
    """All λ of the full problem with Im λ ≥ 0, dense."""
    full = problem.at(values)
    mass, damping, stiffness = (m.toarray() for m in (full.mass, full.damping, full.stiffness))
    # Inverted, so that rounding is relative to the low frequencies; in units in which they are of the order of one.
    unit = np.sqrt(np.median(np.diag(stiffness)) / np.median(np.diag(mass)))
    zero, one = np.zeros_like(mass), np.eye(len(mass))
    companion = np.block([[-unit * damping, -(unit**2) * mass], [one, zero]])
    companion[: len(mass)] = np.linalg.solve(stiffness, companion[: len(mass)])
    found = unit / sl.eigvals(companion)
    return found[found.imag >= 0]


FREQUENCY_HZ = 0.17


@pytest.fixture(scope="module")
def model():
    return reduce(rotor(), FREQUENCY_HZ, bound=1e-8)


def random_points(problem: ParametricProblem, count: int, seed: int) -> list[dict[str, float]]:
    rng = np.random.default_rng(seed)
    return [{p.name: rng.uniform(p.low, p.high) for p in problem.parameters} for _ in range(count)]


def test_every_mode_in_the_band_everywhere_in_the_box(model):
    problem = model.problem
    corners = problem.corners([2, 2])
    for point in [*corners, *random_points(problem, 1, 1)]:
        whole = eigenvalues(problem, point)
        exact = whole[np.abs(whole) < 0.999 * model.frequency]
        found = model.modes(point)
        away = np.abs(exact[:, None] - found.values).min(axis=1) / np.abs(exact)
        assert len(found.values) >= len(exact) > 15
        assert away.max() < 1e-8
        # and nothing that is none
        assert np.abs(found.values[:, None] - whole).min(axis=1).max() < 1e-7 * model.frequency
        assert found.inside
    assert model.size < 100


def test_estimates_cover_errors_without_being_empty(model):
    ratios = []
    for point in random_points(model.problem, 3, 2):
        found = model.modes(point)
        exact = eigenvalues(model.problem, point)
        away = np.abs(found.values[:, None] - exact).min(axis=1) / np.abs(found.values)
        assert np.all(away <= found.error + 1e-12)
        ratios.append(np.median(found.error / np.maximum(away, 1e-14)))
    assert np.median(ratios) < 1e4


def test_sketched_residuals_are_those_of_the_full_problem(model):
    problem, (point,) = model.problem, random_points(model.problem, 1, 3)
    found = model.modes(point)
    full = problem.at(point)
    reference = problem.at(problem.reference)
    symmetric = (reference.stiffness + reference.stiffness.T) / 2
    scale = 1 / np.sqrt((symmetric + (0.3 * model.frequency) ** 2 * reference.mass).diagonal())
    lengths = []
    for side, vectors in ((full, found.right), (full.transposed, found.left)):
        lengths.append(np.linalg.norm(scale[:, None] * side.residual(found.values, model.vectors @ vectors), axis=0))
    assert found.residual == pytest.approx(np.maximum(*lengths), rel=0.35)


def test_the_full_problem_confirms_what_the_reduced_one_says(model):
    point = {"Omega": 2.2, "mu": 0.55}
    confirmed = verified(model, point, which="all")
    assert confirmed.residual.max() < 1e-12
    assert confirmed.shift.max() < 1e-8
    exact = eigenvalues(model.problem, point)
    assert np.abs(confirmed.values[:, None] - exact).min(axis=1).max() < 1e-11 * model.frequency
    full = model.problem.at(point)
    left = full.transposed.residual(confirmed.values, confirmed.left)
    assert np.abs(left).max() < 1e-10


def test_contact_stiffness_and_friction_of_a_meshed_case():
    # Not symmetric about its middle, so that the sign of friction matters.
    system = build_system(case(bench_as_solids(across=(1, 1), along=(6, 12))))
    problem = contact_parameters(system, (0.0, 0.6), (0.5, 2.0), touching_at=0.3)
    limit = 9000.0
    model = reduce(problem, limit)
    modes = complex_modes(system, 0.3, max_frequency_hz=limit)
    found = model.modes({"mu": 0.3, "contact_stiffness": 1.0})
    away = np.abs(modes.eigenvalues[0][:, None] - found.values).min(axis=1) / np.abs(modes.eigenvalues[0])
    assert away[np.abs(modes.eigenvalues[0]) < 0.99 * model.frequency].max() < 1e-7
    for point in ([0.55, 0.6], [0.05, 1.9]):
        exact = eigenvalues(problem, problem.point(point))
        exact = exact[(np.abs(exact) < 0.99 * model.frequency)]
        values = model.modes(point).values
        assert np.abs(exact[:, None] - values).min(axis=1).max() < 1e-8 * model.frequency


@pytest.mark.parametrize("damping", [0.0, 1e-3, 0.1, 3.0])
def test_dense_modes_with_any_damping(damping):
    rng = np.random.default_rng(5)
    n = 40
    a = rng.standard_normal((3, n, n))
    mass = np.eye(n) + 0.1 * a[0] @ a[0].T / n
    stiffness = np.diag(np.linspace(1, 60, n) ** 2) + 2.0 * a[1]
    matrices = mass, damping * (a[2] @ a[2].T / n + 0.3 * a[0]), stiffness
    found, (reference, *_) = dense_modes(*matrices, 30.0, 1.0), damped_pairs(*matrices, 30.0, 1.0)
    assert len(found.values) == len(reference)
    assert np.abs(found.values[:, None] - reference).min(axis=1).max() < 1e-10 * 30
    for lam, z, y in zip(found.values, found.right.T, found.left.T, strict=True):
        whole = lam**2 * matrices[0] + lam * matrices[1] + matrices[2]
        assert max(np.linalg.norm(whole @ z), np.linalg.norm(y @ whole)) < 1e-5 * np.linalg.norm(whole)


def test_dense_modes_that_are_about_to_meet_do_not_take_the_companion_matrix(monkeypatch):
    n = 150
    stiffness = np.diag(np.arange(1.0, n + 1) ** 2)
    # Friction between two modes that meet at a coupling of (20.02² - 20²) / 2, and a dashpot that joins all others.
    stiffness[20, 20] = 20.02**2
    coupling = 0.499 * (20.02**2 - 20.0**2)
    stiffness[19, 20], stiffness[20, 19] = coupling, -coupling
    joined = np.random.default_rng(3).standard_normal((n, 2))
    joined[19:21] = 0.0
    matrices = np.eye(n), 1e-3 * joined @ joined.T, stiffness
    found, reference = dense_modes(*matrices, 30.0, 1.0), dense_modes(*matrices, 30.0, 1.0, whole=True)
    assert not found.whole
    assert len(found.values) == len(reference.values)
    # The companion matrix itself has no more digits where two modes are that close.
    away = np.abs(found.values[:, None] - reference.values).min(axis=1) / np.abs(found.values)
    assert away.max() < 1e-12
    # λ is off by what is left on one side times what is left on the other.
    for lam, z, y in zip(found.values, found.right.T, found.left.T, strict=True):
        whole = lam**2 * matrices[0] + lam * matrices[1] + matrices[2]
        assert max(np.linalg.norm(whole @ z), np.linalg.norm(y @ whole)) < 1e-7 * np.linalg.norm(whole)
    # What others' answers leave unsettled takes the inverse itself; where that is too much, the companion matrix.
    unsettled, top = close_pairs(5)
    assert not dense_modes(*unsettled, top, 1.0).whole
    monkeypatch.setattr("stridor.modal.parametric.from_undamped.FEW", 0)
    assert dense_modes(*unsettled, top, 1.0).whole


@pytest.mark.parametrize("first", [0, pytest.param(150, marks=pytest.mark.slow)])
def test_strong_dashpots_far_from_the_band_bring_modes_into_it(first):
    """What is solved through the undamped modes has every mode that the whole companion matrix has: of 3000 such problems
    222 lacked some, growing ones among them, before the damping of modes far away was looked at."""
    cheap = 0
    for seed in range(first, first + 150):
        random = np.random.default_rng(seed)
        r = int(random.integers(10, 40))
        omega = np.sort(random.uniform(0.2, 1.0, r) * np.geomspace(1, 10 ** random.uniform(0.5, 2.5), r))
        top = float(np.quantile(omega, random.uniform(0.1, 0.6)))
        shapes = np.linalg.qr(random.standard_normal((r, r)))[0]
        far = shapes[:, -max(1, r // 3) :]  # most between modes above the band, or anywhere
        dashpots = (far @ far.T if seed % 2 else np.eye(r)) @ random.standard_normal((r, int(random.integers(1, 4))))
        sign = random.choice([1.0, 1.0, 1.0, -1.0], dashpots.shape[1])
        strength = omega[-1] * 10 ** random.uniform(-4, 2.5) / (dashpots**2).sum()
        damping = strength * (dashpots * sign) @ dashpots.T + 10 ** random.uniform(-5, -2) * np.eye(r)
        matrices = np.eye(r), damping, shapes @ (omega[:, None] ** 2 * shapes.T)
        found, reference = dense_modes(*matrices, top, 1.0), dense_modes(*matrices, top, 1.0, whole=True)
        cheap += not found.whole
        for lam in reference.values[np.abs(reference.values) < 0.999 * top]:
            assert np.abs(found.values - lam).min(initial=np.inf) < 1e-7 * abs(lam), (seed, lam)
    assert cheap > 30


def close_pairs(seed: int) -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray], float]:
    """M, D, K and a band: modes that nearly coincide, some joined by friction before or beyond their meeting, with
    dashpots, proportional damping and now and then gyroscopic forces that couple all, or a load that buckles some."""
    random = np.random.default_rng(seed)
    r = int(random.integers(10, 60))
    omega = np.sort(random.uniform(0.2, 1.0, r) * np.geomspace(1, 10 ** random.uniform(0.5, 2.5), r))
    for j in random.choice(r - 1, int(random.integers(0, 6))):
        omega[j + 1] = omega[j] * (1 + 10 ** random.uniform(-7, -2))
    shapes = np.linalg.qr(random.standard_normal((r, r)))[0]
    stiffness = np.diag(omega**2)
    if seed % 4 == 2:  # buckled, about to, or not held
        stiffness -= omega[int(random.integers(0, r))] ** 2 * (1 + random.choice([0, -1, 1]) * 1e-5) * np.eye(r)
    for j in random.integers(0, r - 1, int(random.integers(0, 4))):
        coupling = random.uniform(0, 1.5) * abs(omega[j + 1] ** 2 - omega[j] ** 2) / 2
        stiffness[j, j + 1] += coupling
        stiffness[j + 1, j] -= coupling
    dashpots = random.standard_normal((r, int(random.integers(1, 4))))
    damping = np.diag(10 ** random.uniform(-7, -2) * omega * (random.uniform(0, 1, r) if seed % 3 == 1 else 1.0))
    damping += dashpots @ dashpots.T * omega.mean() * 10 ** random.uniform(-8, -1)
    if seed % 5 == 0:
        turn = random.standard_normal((r, r))
        damping += (turn - turn.T) * 10 ** random.uniform(-6, -2) * omega[0]
    matrices = np.eye(r), shapes @ damping @ shapes.T, shapes @ stiffness @ shapes.T
    return matrices, float(np.quantile(omega, random.uniform(0.2, 0.8)))


@pytest.mark.parametrize("seeds", [[*range(150), 2171, 2600], pytest.param(range(5000), marks=pytest.mark.slow)])
def test_modes_that_damping_mixes_are_all_there_and_none_is_there_twice(seeds):
    cheap = 0
    for seed in seeds:
        matrices, top = close_pairs(seed)
        found, reference = dense_modes(*matrices, top, 1.0), dense_modes(*matrices, top, 1.0, whole=True)
        cheap += not found.whole
        mine, theirs = (m.values[np.abs(m.values) < 0.999 * top] for m in (found, reference))
        assert len(mine) == len(theirs), seed
        away = np.abs(mine[:, None] - theirs) / np.abs(theirs)
        one_to_one = linear_sum_assignment(away)
        # Of two that all but coincide the companion matrix has no more digits.
        assert away[one_to_one].max(initial=0.0) < 1e-6, seed
    assert cheap > 0.6 * len(seeds)


@pytest.mark.parametrize("seeds", [range(100), pytest.param(range(3000), marks=pytest.mark.slow)])
def test_modes_that_gyroscopic_forces_bring_into_the_band_are_there(seeds):
    """Beside the end of the band damping of modes far away moves others across it, either way."""
    cheap = crossed = 0
    for seed in seeds:
        random = np.random.default_rng(seed)
        r = int(random.integers(3, 12))
        omega = np.sort(np.concatenate([random.uniform(0.3, 0.95, r // 3), random.uniform(0.9, 2.0, r - r // 3)]))
        turn = random.standard_normal((r, r)) * 10 ** random.uniform(-1.2, 0.1) / np.sqrt(r)
        shapes = np.linalg.qr(random.standard_normal((r, r)))[0]
        damping = shapes @ (turn - turn.T + 0.01 * np.diag(omega)) @ shapes.T
        matrices = np.eye(r), damping, shapes @ np.diag(omega**2) @ shapes.T
        found, reference = dense_modes(*matrices, 1.0, 1.0), dense_modes(*matrices, 1.0, 1.0, whole=True)
        cheap += not found.whole
        mine, theirs = (m.values[np.abs(np.abs(m.values) - 1.0) > 1e-6] for m in (found, reference))
        assert len(mine) == len(theirs), seed
        assert np.abs(np.sort_complex(mine) - np.sort_complex(theirs)).max(initial=0.0) < 1e-8, seed
        crossed += int(np.sum(omega < 1)) != len(theirs)
    assert min(cheap, crossed) > 0.1 * len(seeds)


@pytest.mark.parametrize(("near", "far"), [(1.02, 1.3), (1.01, 1.22)])
def test_one_mode_that_gyroscopic_forces_bring_into_the_band(near: float, far: float):
    damping = np.diag([0.005, 0.01, 0.01])
    damping[1, 2], damping[2, 1] = -0.3, 0.3
    matrices = np.eye(3), damping, np.diag([0.25, near**2, far**2])
    found = dense_modes(*matrices, 1.0, 1 + 1e-9)
    assert found.values == pytest.approx(dense_modes(*matrices, 1.0, 1 + 1e-9, whole=True).values, abs=1e-10)
    assert len(found.values) == 2


def strongly_damped(n: int = 10) -> ParametricProblem:
    """The rotor with dampers far beyond critical at places of their own."""
    problem = rotor(n)
    rng = np.random.default_rng(5)
    strength = np.zeros(problem.size)
    strength[rng.choice(problem.size, 12, replace=False)] = 10 ** rng.uniform(1.0, 2.0, 12)
    dampers = Term(sp.csr_array(sp.diags_array(strength)), "damping", lambda _: 1.0, symmetric=True)
    return ParametricProblem((*problem.terms, dampers), problem.parameters)


@pytest.fixture(scope="module", params=[7, pytest.param(10, marks=pytest.mark.slow)])
def damped(request):
    return reduce(strongly_damped(request.param), FREQUENCY_HZ, bound=1e-8)


@pytest.mark.parametrize("points", [0, pytest.param(6, marks=pytest.mark.slow)])
def test_overdamped_modes_are_found_among_states(damped, points):
    problem = damped.problem
    assert damped.whole
    assert damped.states is not None
    assert damped.states.count < 1.4 * damped.size
    for point in [*problem.corners([2, 2]), *random_points(problem, points, 4)]:
        whole = eigenvalues(problem, point)
        exact = whole[np.abs(whole) < 0.999 * damped.frequency]
        found = damped.modes(point)
        away = np.abs(exact[:, None] - found.values).min(axis=1) / np.abs(exact)
        assert np.count_nonzero(exact.imag == 0) >= 5
        assert away.max() < 1e-8
        assert np.all(found.passed)
        nearest = np.abs(found.values[:, None] - whole).min(axis=1) / np.abs(found.values)
        assert np.all(nearest <= found.error + 1e-12)
        assert np.unique(np.abs(found.values[:, None] - whole).argmin(axis=1)).size == len(found.values)
        # in the order, and of the length, that the companion matrix gives them
        reference = replace(damped, states=None).modes(point)
        assert found.values == pytest.approx(reference.values, rel=1e-7)
        for one, other in ((found.right, reference.right), (found.left, reference.left)):
            assert np.abs(np.einsum("ij,ij->j", one.conj(), other)) == pytest.approx(1.0, abs=1e-4)


def test_outside_the_box_states_are_not_trusted(damped):
    point = {"Omega": 6.0, "mu": 0.9}
    found, reference = damped.modes(point), replace(damped, states=None).modes(point)
    assert not found.inside
    assert np.array_equal(found.values, reference.values)


def test_states_that_are_none_give_way_to_the_companion_matrix(damped):
    nothing = np.zeros_like(damped.states.right)
    found = replace(damped, states=States(nothing, nothing)).modes({"Omega": 1.0})
    assert np.array_equal(found.values, replace(damped, states=None).modes({"Omega": 1.0}).values)


def test_left_residuals_are_those_of_the_transposed_problem():
    problem = rotor(4)
    point = problem.point({"Omega": 2.0, "mu": 0.5})
    lam, x = np.array([0.3 + 0.7j]), np.random.default_rng(1).standard_normal((32, 1)) + 0j
    full = problem.at(point)
    for left, side in ((False, full), (True, full.transposed)):
        found = residual(problem, problem.factors(point), lam, x, left=left)
        assert found == pytest.approx(side.residual(lam, x), rel=1e-12)


@pytest.mark.parametrize("given", [("mu", {"Omega": 0.8}), pytest.param(("Omega", {"mu": 0.5}), marks=pytest.mark.slow)])
def test_onsets_along_any_parameter_are_those_of_the_full_problem(model, given):
    for name, fixed in (given,):
        found = onsets_along(model, name, fixed)
        assert found
        (own,) = (p for p in model.problem.parameters if p.name == name)
        growing = []
        points = np.linspace(own.low, own.high, 21)
        for value in points:
            exact = eigenvalues(model.problem, {**fixed, name: value})
            growing.append(int(np.sum((exact.real > 1e-9) & (np.abs(exact) < model.frequency))))
        # Between two points of the grid as many modes turn unstable as onsets say.
        for low, high, before, after in zip(
            points[:-1], points[1:], growing[:-1], growing[1:], strict=True
        ):
            inside = [o for o in found if low < o.value <= high]
            assert sum(-1 if o.stabilising else 1 for o in inside) == after - before
        for onset in found:
            assert onset.residual < 1e-12
            assert onset.value == pytest.approx(onset.reduced_value, rel=1e-6)
            exact = eigenvalues(model.problem, onset.point)
            k = int(np.argmin(np.abs(exact - 2j * np.pi * onset.frequency_hz)))
            assert abs(exact[k].real) < 1e-9
            step = 1e-5 * (own.high - own.low)
            ends = [eigenvalues(model.problem, {**onset.point, name: onset.value + s * step}) for s in (-1, 1)]
            rates = [e[np.argmin(np.abs(e - exact[k]))].real for e in ends]
            assert onset.growth_slope == pytest.approx((rates[1] - rates[0]) / (2 * step), rel=1e-4)
    with pytest.raises(CaseError, match=r"parameter: 'speed' – no such parameter; there are: Omega, mu"):
        onsets_along(model, "speed")


def test_an_onset_just_beside_where_two_modes_meet_is_found():
    changes = {"bodies.beam1.damping.mass": 0.0, "bodies.beam2.damping.mass": 50.0}
    bench = paper_case().with_(changes)
    model = reduced_model(bench, {"mu": (0.0, 0.0958)}, max_frequency_hz=20e3)
    found = onsets_along(model, "mu")
    direct = onsets(build_system(bench), (0.0, 0.0958), max_frequency_hz=20e3)
    assert len(found) == 2
    # Growth of the second rises by 1.2 1/s per unit of friction: rounding of 1e-13 of λ moves it by 3e-9 of itself.
    assert [o.value for o in found] == pytest.approx([o.mu for o in direct.onsets], rel=1e-8)


@pytest.mark.slow
def test_onsets_along_a_number_that_changes_the_mass():
    whole = rotor()
    mass, *others = whole.terms
    terms = (Term(mass.matrix, "mass", Product((("density", 1.0),)), symmetric=True), *others)
    box = (Parameter("density", 0.7, 1.4, 1.0), Parameter("mu", 0.0, 0.6, 0.3), Parameter("Omega", 0.9, 1.1, 1.0))
    model = reduce(ParametricProblem(terms, box), FREQUENCY_HZ, bound=1e-7)
    found = 0
    for mu in (0.3, 0.4, 0.5):
        alone = onsets_along(model, "density", {"mu": mu}, confirm=False)
        confirmed = onsets_along(model, "density", {"mu": mu})
        assert [o.value for o in alone] == pytest.approx([o.value for o in confirmed], rel=1e-5)
        assert [o.growth_slope for o in alone] == pytest.approx([o.growth_slope for o in confirmed], rel=1e-3)
        found += len(confirmed)
    assert found > 1


def test_what_is_refused(model):
    problem = model.problem
    with pytest.raises(CaseError, match=r"values: 'speed' – no such parameter; there are: Omega, mu$"):
        model.modes({"speed": 1.0})
    with pytest.raises(CaseError, match=r"values\.mu: nan – a finite number"):
        model.modes({"mu": float("nan")})
    with pytest.raises(CaseError, match="max_frequency_hz"):
        reduce(problem, 0.0)
    with pytest.raises(CaseError, match="bound"):
        reduce(problem, 0.1, bound=0.0)
    with pytest.raises(CaseError, match=r"box\.Omega: '3 … 1, 2' – a range"):
        Parameter("Omega", 3.0, 1.0, 2.0)
    empty = ParametricProblem((Term(grid(3), "stiffness", lambda _: 1.0, symmetric=True),), problem.parameters)
    with pytest.raises(AnalysisError, match="no symmetric mass"):
        reduce(empty, 0.1)
    assert not model.modes({"Omega": 4.0}).inside


def test_numbers_of_a_case_span_a_box():
    """Contact, moduli (linear), thickness out of the plane (linear) and damping (a product) of a case, at random."""
    bench = case(bench_as_solids(across=(1, 1), along=(6, 12)))
    body, material = next((n, b.material) for n, b in bench.bodies.items() if getattr(b, "thickness", None))
    low = bench.materials[material].young_modulus
    box = {
        "mu": (0.0, 0.3),
        f"materials.{material}.young_modulus": (0.9 * low, 1.1 * low),
        f"bodies.{body}.damping.stiffness": (0.0, 2e-8),
    }
    problem = parametric_problem(bench, box)
    rng = np.random.default_rng(4)
    for _ in range(2):
        point = {p.name: rng.uniform(p.low, p.high) for p in problem.parameters}
        varied = build_system(bench.with_({k: v for k, v in point.items() if k != "mu"}))
        full = problem.at(point)
        assert abs(full.mass - varied.mass).max() < 1e-12 * abs(varied.mass).max()
        assert abs(full.damping - varied.damping).max() < 1e-10 * abs(varied.damping).max()
        modes = complex_modes(varied, point["mu"], max_frequency_hz=9e3)
        exact = eigenvalues(problem, point)
        found = modes.eigenvalues[0]
        assert np.all(np.abs(found[:, None] - exact).min(axis=1) < 1e-6 * np.abs(found))
    reduced = reduced_model(bench, {"mu": (0.0, 0.3)}, max_frequency_hz=9e3)
    exact = eigenvalues(reduced.problem, {"mu": 0.21})
    found = reduced.modes({"mu": 0.21}).values
    assert np.abs(found[:, None] - exact).min(axis=1).max() < 1e-7 * reduced.frequency


def test_what_a_case_refuses():
    bench = case(bench_as_solids(across=(1, 1), along=(6, 12)))
    name = next(iter(bench.contacts))
    rigid = bench.with_({f"contacts.{name}.stiffness": "rigid"})
    for given, box, message in (
        (bench, {}, "box: missing – give at least one range"),
        (bench, {"mu": (0.3, 0.1)}, r"box.mu: .* – a range of two numbers low < high"),
        (bench, {"mu": (-0.1, 0.1)}, r"box.mu: .* – friction coefficients are ≥ 0"),
        (bench, {"contact_stiffness": (0.0, 1.0)}, r"factors of the contact stiffness are > 0"),
        (bench, {"materials.stel.density": (1.0, 2.0)}, r"materials.stel"),
        (rigid, {"contact_stiffness": (0.5, 2.0)}, r"rigid contact has no stiffness to vary"),
    ):
        with pytest.raises(CaseError, match=message):
            reduced_model(given, box)


def test_onsets_of_the_published_bench_from_the_reduced_model():
    """Where modes meet, growth opens like a root: all three crossings are found, as the solved ones have them."""
    bench = paper_case()
    reduced = reduced_model(bench, {"mu": (0.0, 0.3), "contact_stiffness": (0.5, 2.0)}, max_frequency_hz=40e3)
    found = onsets_along(reduced, "mu")
    solved = onsets(build_system(bench), (0.0, 0.3), max_frequency_hz=40e3).onsets
    assert [o.value for o in found] == pytest.approx([o.mu for o in solved], rel=1e-10)
    assert [o.frequency_hz for o in found] == pytest.approx([o.frequency_hz for o in solved], rel=1e-10)
    assert [o.growth_slope for o in found] == pytest.approx([o.growth_slope for o in solved], rel=1e-4)
    assert max(o.residual for o in found) < 1e-14
    assert len(found) == 3


def rounding(model, found) -> np.ndarray:
    """What a change of every stiffness by its last digit does to λ (k,), relative: no double precision is better."""
    full = model.problem.at(found.point)
    x, y = model.expand(found), model.expand(found, left=True)
    slope = np.einsum("ij,ij->j", y, 2 * found.values * (full.mass @ x) + full.damping @ x)
    terms = np.einsum("ij,ij->j", np.abs(y), abs(full.stiffness) @ np.abs(x))
    return np.finfo(float).eps * terms / np.abs(found.values * slope)


def test_craig_bampton_says_how_wrong_it_is():
    bench = case(bench_as_solids(across=(1, 1), along=(6, 12)))
    problem = contact_parameters(build_system(bench), (0.0, 0.3))
    point = problem.point({"mu": 0.2, "contact_stiffness": 1.3})
    exact = eigenvalues(problem, point)
    errors = []
    for beyond in (1.5, 8.0, 30.0):
        model = craig_bampton(problem, 9e3, beyond=beyond)
        found = model.modes(point)
        inner = np.abs(found.values) < 0.95 * model.frequency
        away = (np.abs(found.values[:, None] - exact).min(axis=1) / np.abs(found.values))[inner]
        assert np.all(away <= (found.error + rounding(model, found))[inner])
        errors.append(away.max())
    assert errors[0] > 5 * errors[1] > 25 * errors[2]
    assert errors[2] < 1e-5
    with pytest.raises(CaseError, match=r"interface: 0 – 1 to 1500 freedoms"):
        craig_bampton(problem, 9e3, interface=np.zeros(0, dtype=int))


def test_matrices_in_a_turning_frame(tmp_path):
    """m·1, 2Ωm·[[0, −1], [1, 0]] and K − Ω²m whirl at ω₀ ± Ω, whatever K."""
    net = sp.block_diag([grid(4), grid(4)])
    turn = sp.kron(np.array([[0.0, -1.0], [1.0, 0.0]]), sp.eye_array(16))
    for name, matrix in (("M", sp.eye_array(32)), ("G", turn), ("K", net)):
        mmwrite(tmp_path / f"{name}.mtx", sp.coo_matrix(matrix))
    path = tmp_path / "rotor.toml"
    path.write_text(
        "[parameters]\nOmega = { value = 0.2, range = [0.1, 0.5] }\n[modal]\nmax_frequency_hz = 0.3\n"
        '[matrices]\nterms = [{ file = "M.mtx", role = "mass" }, { file = "K.mtx", role = "stiffness" },\n'
        '{ file = "G.mtx", role = "damping", factor = "2*Omega" },\n'
        '{ file = "M.mtx", role = "stiffness", factor = "-Omega**2" }]\n'
    )
    model = reduced_model(load(path), {"Omega": (0.1, 0.5)})
    own = np.sqrt(np.linalg.eigvalsh(grid(4).toarray()))
    for omega in (0.1, 0.23, 0.5):
        whirl = np.sort(np.concatenate([own - omega, own + omega]))
        found = np.sort(model.modes({"Omega": omega}).values.imag)
        assert found == pytest.approx(whirl[(whirl > 0) & (whirl < model.frequency)], rel=1e-8)
        assert len(found) > 10
