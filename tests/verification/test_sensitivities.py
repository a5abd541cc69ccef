"""Derivatives of eigenvalues against solving again, closed forms, and what is said where there are none."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sl

import stridor as st
from benches import paper_case
from solid_cases import case, slider
from stridor.case import Case, loads
from stridor.case.source import template_text
from stridor.direct import nearby
from stridor.errors import CaseError
from stridor.modal.complex_modes import complex_modes
from stridor.modal.derivatives import by_release, pencil_of, solve_mode, solve_mode_released
from stridor.study.analyses import modes
from stridor.study.damping_map import damping_map
from stridor.study.sensitivities import Linearised, number_at, sensitivities
from stridor.study.workspace import Workspace
from stridor.system import build_system

pytestmark = pytest.mark.verification

# One mass, two springs, a belt: the minimal model of Hoffmann, Fischer, Allgaier and Gaul (2002) with the dashpots of
# Hoffmann and Gaul (2003). K = [[k_x + 20, −20], [−20 + μ k_c, k_c + 20]], the sign of μ that of the belt.
MINIMAL = """
[bodies.m]
type = "mass"
mass = 1.0
position = [0.0, 0.0]
[bodies.belt]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [0.0, 1.0]
sliding = { velocity = [1.0, 0.0] }
[springs.oblique]
between = ["m", "ground"]
direction = [-0.7071067811865476, 0.7071067811865476]
stiffness = 40.0
[springs.x]
between = ["m", "ground"]
direction = [1.0, 0.0]
stiffness = 60.0
[dashpots.x]
between = ["m", "ground"]
direction = [1.0, 0.0]
damping = 0.1
[dashpots.y]
between = ["m", "ground"]
direction = [0.0, 1.0]
damping = 0.1
[loads.weight]
at = "m"
force = [0.0, -10.0]
[contacts.rub]
slave = "m"
master = "belt"
stiffness = 100.0
friction = { law = "coulomb", coefficient = 0.1 }
[modal]
friction_range = [0.0, 2.0]
max_frequency_hz = 5.0
"""


def minimal_matrices(mu, kx=60.0, kc=100.0, cx=0.1, cy=0.1):
    stiffness = np.array([[kx + 20.0, -20.0 + mu * kc], [-20.0, 20.0 + kc]])
    # The belt drags the mass to +x with μ times the normal force −k_c y.
    return np.diag([cx, cy]), stiffness


def minimal_growth(mu, **values):
    """Of one μ or of many (k,)."""
    states = []
    for one in np.atleast_1d(mu):
        damping, stiffness = minimal_matrices(one, **values)
        states.append(np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -damping]]))
    growth = np.linalg.eigvals(np.array(states)).real.max(axis=1)
    return growth if np.ndim(mu) else float(growth[0])


def bisected(cx, cy, kx=60.0, top=2.0):
    """The lowest μ with growth, by dense eigenvalues alone."""
    grid = np.linspace(0.0, top, 4001)
    for part in np.array_split(np.arange(len(grid)), 20):
        grows = minimal_growth(grid[part], cx=cx, cy=cy, kx=kx) > 1e-12
        if grows.any():
            first = int(part[np.argmax(grows)])
            break
    else:
        return np.nan
    low, high = grid[first - 1], grid[first]
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (low, middle) if minimal_growth(middle, cx=cx, cy=cy, kx=kx) > 1e-13 else (middle, high)
    return (low + high) / 2


def differences(model: Case, path: str, value: float, mu: float, found, count: int, damped: bool, step=3e-4):
    """dλ/dp (b,) of fourth order, every eigenvalue solved again."""

    def at(x: float) -> np.ndarray:
        friction = path in ("mu", "contacts.rub.friction.coefficient", "contacts.A.friction.coefficient")
        varied, there = (model, x) if friction else (model.with_({path: x}), mu)
        again = complex_modes(build_system(varied), there, count=count, damped=damped).eigenvalues[0]
        return np.array([again[np.argmin(np.abs(again - lam))] for lam in found])

    h = step * abs(value)
    return (8 * (at(value + h) - at(value - h)) - (at(value + 2 * h) - at(value - 2 * h))) / (12 * h)


def assert_derivatives(model, paths, mu, *, count, damped, tolerance, modes="unstable", step=3e-4):
    result = sensitivities(model, paths, mu=mu, count=count, damped=damped, modes=modes)
    assert len(result.branch)
    assert result.residual.max() < 1e-12
    # What grows is there whatever the count: modes beyond it, too.
    enough = max(count + 2, int(result.branch.max()) + 4)
    for k, path in enumerate(paths):
        numeric = differences(model, path, result.values[k], mu, result.eigenvalues, enough, damped, step)
        # What a number hardly does cannot be seen in differences of rounded eigenvalues.
        least = 1e-5 * np.abs(result.eigenvalues / result.values[k])
        error = np.abs(result.derivative[k] - numeric) / np.maximum(np.abs(result.derivative[k]), least)
        assert error.max() < tolerance, (path, error)
    return result


# -- against solving again --------------------------------------------------------------------------------------------
BEAMS = ["mu", "contacts.A.friction.coefficient", "materials.steel.young_modulus", "materials.steel.density"]
BEAMS += ["bodies.beam1.thickness", "bodies.beam1.width"]


@pytest.mark.parametrize(
    ("stiffness", "damped"),
    [
        (1e9, True),
        *(pytest.param(*p, marks=pytest.mark.slow) for p in ((1e9, False), ("rigid", True), ("rigid", False))),
    ],
)
def test_two_beams(stiffness, damped):
    model = paper_case(
        contacts__A__stiffness=stiffness, bodies__beam1__elements=6, bodies__beam2__elements=18,
        bodies__beam1__damping__stiffness=1e-7, bodies__beam1__damping__mass=300.0,
    )  # fmt: skip
    paths = BEAMS + ([] if stiffness == "rigid" else ["contacts.A.stiffness"])
    paths += ["bodies.beam1.damping.mass", "bodies.beam1.damping.stiffness"] if damped else []
    assert_derivatives(model, paths, 0.45, count=14, damped=damped, tolerance=2e-6)


SOLIDS = ["mu", "materials.steel.density", "materials.steel.poisson_ratio"]


@pytest.mark.parametrize(
    ("stiffness", "damped"), [*(pytest.param(k, True, marks=pytest.mark.slow) for k in ("rigid", 1e13)), ("rigid", False)]
)
def test_solids(stiffness, damped):
    model = case(slider(space=False, stiffness=stiffness)).with_(
        {
            "bodies.block.damping": {"mass": 100.0, "stiffness": 1e-8},
            "bodies.slider.damping": {"mass": 50.0, "stiffness": 3e-8},
        }
    )
    paths = ["mu", "bodies.block.thickness"] if damped else [*SOLIDS, "bodies.block.thickness"]
    paths += [] if stiffness == "rigid" else ["contacts.rub.stiffness"]
    paths += ["bodies.slider.damping.stiffness"] if damped else []
    # Eigenvalues of meshes are refined to 2e-9 of their size: steps that leave of it less than the tolerance. Undamped,
    # a second mode grows just beyond where it met another: differences over ν are off by 7.2e-3, 3.0e-4, 1.7e-5, 2.2e-6 at
    # steps of 2e-3, 1e-3, 5e-4, 3e-4, the fourth order they have.
    assert_derivatives(model, paths, 0.6, count=4, damped=damped, tolerance=1e-6, step=2e-3 if damped else 1.5e-4)


def test_compliance_of_rigid_contact_is_the_limit_of_stiff_contact():
    soft = sensitivities(case(slider(space=False, stiffness=1e18)), ["contacts.rub.stiffness"], mu=0.6, count=8)
    rigid = sensitivities(case(slider(space=False)), ["contacts.rub.compliance"], mu=0.6, count=8)
    # d/d(1/K) = −K² d/dK
    np.testing.assert_allclose(rigid.derivative[0, :2], -1e36 * soft.derivative[0, :2], rtol=1e-3)


def test_each_contact_by_itself_adds_up_to_all():
    model = case(slider(space=False, stiffness=1e13))
    both = sensitivities(model, ["mu", "contacts.rub.friction.coefficient"], mu=0.6, count=8, modes="all")
    np.testing.assert_allclose(both.derivative[0], both.derivative[1], rtol=1e-12)


# -- closed form ------------------------------------------------------------------------------------------------------
def test_minimal_model_in_closed_form():
    model = loads(MINIMAL)
    mu, kx, kc = 0.42, 60.0, 100.0
    found = sensitivities(model, ["mu", "springs.x.stiffness", "contacts.rub.stiffness"], mu=mu, damped=False)
    assert found.eigenvalues[0].real > 0
    lam = found.eigenvalues[0]
    # Λ = −λ²: Λ² − (a + b) Λ + a b − 20 (20 − μ k_c) = 0 with a = k_x + 20, b = k_c + 20.
    a, b, big = kx + 20, kc + 20, -(lam**2)
    assert abs(big**2 - (a + b) * big + a * b - 20 * (20 - mu * kc)) < 1e-9 * abs(big) ** 2
    by_big = 2 * big - (a + b)
    for place, by_number in enumerate((20 * kc, -big + b, -big + a + 20 * mu)):
        np.testing.assert_allclose(found.derivative[place, 0], -by_number / by_big / (-2 * lam), rtol=1e-9)
    # The exceptional point is where the discriminant vanishes, (a − b)² = 80 (μ k_c − 20): μ = 0.4, linear in μ.
    np.testing.assert_allclose(found.exceptional[0, 0], 0.4, rtol=1e-2)


def test_close_to_an_onset_it_says_that_derivatives_diverge():
    model = loads(MINIMAL)
    near = sensitivities(model, ["mu"], mu=0.404, damped=False)
    assert near.condition[0] > 5 * sensitivities(model, ["mu"], mu=0.6, damped=False).condition[0] / 3
    np.testing.assert_allclose(near.exceptional[0, 0], 0.4, rtol=1e-4)
    np.testing.assert_allclose(near.exceptional_distance[0, 0], 0.004 / 0.404, rtol=2e-2)
    assert len(near.warnings) == 1
    assert "near an exceptional point, estimated at mu = 0.4 (0.99 % away)" in near.warnings[0]
    # λ ~ √(μ − 0.4): ten times nearer, √10 times steeper.
    nearer = sensitivities(model, ["mu"], mu=0.4004, damped=False)
    ratio = nearer.derivative[0, 0].real / near.derivative[0, 0].real
    np.testing.assert_allclose(ratio, np.sqrt(10), rtol=1e-2)


def test_right_vectors_in_place_of_left_ones_give_other_numbers():
    """The mutation that a symmetric mind makes: it must not pass."""
    linear = Linearised.of(case(slider(space=False, stiffness=1e13)), 0.6, count=8)
    column = linear.columns("unstable")[0]
    mode, change = linear.known(column), linear.change("bodies.block.thickness")
    slope = mode.right.motion @ (2 * mode.eigenvalue * (linear.pencil.mass @ mode.right.motion))
    wrong = -change.form(mode.eigenvalue, mode.right, mode.right) / slope
    right = mode.derivative(change)
    assert abs(wrong - right) > 0.05 * abs(right)


@pytest.mark.parametrize("stiffness", [1e13, "rigid"])
def test_contact_taken_away_where_it_matters_little(stiffness):
    linear = Linearised.of(case(slider(space=False, stiffness=stiffness)), 0.6, count=8, damped=False)
    terms, place = linear.pencil, len(linear.pencil.compliance) - 1
    kept = np.arange(place)
    mass, stiff = terms.mass.toarray(), terms.stiffness.toarray()
    normal, push = terms.normal.toarray()[kept], terms.push.toarray()[kept]
    if stiffness == "rigid":
        trial, test = sl.null_space(normal), sl.null_space(push)
        square = sl.eigvals(test.T @ stiff @ trial, test.T @ mass @ trial)
    else:
        square = sl.eigvals(stiff + push.T @ (normal / terms.compliance[kept][:, None]), mass)
    lam = np.sqrt(-square + 0j)
    lam = np.concatenate([lam, -lam])
    checked = 0
    for column in linear.columns("all"):
        mode = linear.known(column)
        moved = by_release(terms, mode, [np.array([place])], linear.gap(column))[0]
        # With the factors that the mode itself is found with.
        again, at_once = solve_mode_released(terms, mode.eigenvalue, linear.gap(column), [np.array([place])])
        assert again.eigenvalue == pytest.approx(mode.eigenvalue, rel=1e-11)
        assert again.right.force * again.left.force == pytest.approx(mode.right.force * mode.left.force, rel=1e-6)
        assert at_once[0] == pytest.approx(moved, rel=1e-5)
        if abs(moved) < 2e-3 * abs(mode.eigenvalue) and abs(moved) > 1e-7 * abs(mode.eigenvalue):
            actual = lam[np.argmin(np.abs(lam - mode.eigenvalue - moved))] - mode.eigenvalue
            assert abs(moved - actual) < 0.03 * abs(actual)
            checked += 1
    assert checked


# -- the map of damping -----------------------------------------------------------------------------------------------
def test_map_of_damping_is_that_of_dense_bisection():
    model = loads(MINIMAL)
    found = damping_map(
        model, "dashpots.x.damping", "dashpots.y.damping", x_range=[0.05, 0.3, 2.0], y_range=[0.05, 0.6, 1.5]
    )
    assert found.undamped_mu == pytest.approx(0.4, rel=1e-9)
    for i, j in np.ndindex(found.onset_mu.shape):
        cx, cy = found.x_values[i], found.y_values[j]
        assert found.onset_mu[i, j] == pytest.approx(bisected(cx, cy), rel=1e-7)
        for slope, dx, dy in ((found.slope_x, 1e-5, 0.0), (found.slope_y, 0.0, 1e-5)):
            numeric = (bisected(cx + dx, cy + dy) - bisected(cx - dx, cy - dy)) / 2e-5
            assert slope[i, j] == pytest.approx(numeric, rel=1e-4, abs=1e-6)
    # Hoffmann and Gaul (2003): damping of one of the two modes alone lowers the onset, below that without damping.
    assert found.more_x_lowers[1, 0]
    assert not found.more_x_lowers[0, 2]
    assert found.below_undamped[2, 0]
    assert not found.below_undamped[2, 2]


def test_map_has_no_slopes_where_nothing_is_damped():
    found = damping_map(
        loads(MINIMAL), "dashpots.x.damping", "dashpots.y.damping", x_range=[0.0, 0.1, 0.2], y_range=[0.0, 0.1, 0.2]
    )
    assert found.onset_mu[0, 0] == pytest.approx(0.4)
    assert np.isnan(found.slope_x[0, 0])
    assert np.isfinite(found.slope_x[1, 1])


# -- what is said -----------------------------------------------------------------------------------------------------
def test_paths_that_lead_to_no_number():
    model = loads(MINIMAL)
    for path in ("springs.x.between", "springs.z.stiffness", "title", "contacts.rub.friction.law"):
        with pytest.raises(CaseError, match=r"number of the case|no such number"):
            sensitivities(model, [path], mu=0.5)
    assert number_at(model, "bodies.m.mass") == 1.0
    with pytest.raises(CaseError, match="branches from 1 to 2"):
        sensitivities(model, ["mu"], mu=0.5, modes=[7])


def test_nothing_unstable_is_said():
    quiet = sensitivities(loads(MINIMAL), ["mu"], mu=0.1)
    assert len(quiet.branch) == 0
    assert quiet.warnings == ("no mode is unstable at μ = 0.1: name branches to see what stable ones do",)
    assert quiet.to_json()["modes"] == []


def test_documents_and_datasets():
    found = sensitivities(loads(MINIMAL), ["mu", "dashpots.x.damping"], mu=0.6)
    data = found.to_xarray()
    assert data["growth_derivative"].shape == (2, 1)
    part = found.to_json()["modes"][0]["parameters"][0]
    assert part["growth_per_percent"] == pytest.approx(0.006 * found.of("mu")[0].real)


def test_a_number_that_starts_from_zero():
    model = loads(MINIMAL).with_({"dashpots.x.damping": 0.0})
    found = sensitivities(model, ["dashpots.x.damping"], mu=0.6)
    again = [modes(model.with_({"dashpots.x.damping": d}), 0.6).eigenvalues[0] for d in (0.0, 1e-5)]
    place = int(np.argmax(again[0].real))
    np.testing.assert_allclose(found.derivative[0, 0], (again[1] - again[0])[place] / 1e-5, rtol=1e-4)
    assert np.isnan(found.growth_per_percent[0, 0])


def test_solving_for_a_mode_from_a_rough_guess():
    linear = Linearised.of(case(slider(space=False)), 0.6, count=8, damped=False)
    column = linear.columns("unstable")[0]
    lam = complex(linear.eigenvalues[column])
    again = solve_mode(linear.pencil, lam * (1 + 1e-8), linear.gap(column))
    assert abs(again.eigenvalue - lam) < 1e-9 * abs(lam)


def test_systems_with_another_number_are_those_built_and_balanced_anew(monkeypatch):
    """What they have in common (bodies, meshes, factors of steady sliding) makes none of them another one."""
    monkeypatch.setattr(nearby, "LEAST", 0)
    model = case(slider(space=False, stiffness=1e13)).with_(
        {
            "materials.iron": {"young_modulus": 110e9, "density": 7100.0, "poisson_ratio": 0.27},
            "bodies.slider.material": "iron",
            "bodies.block.damping": {"mass": 100.0, "stiffness": 1e-8},
            "bodies.slider.damping": {"mass": 50.0, "stiffness": 3e-8},
            "modal.prestress": True,  # so that steady sliding of each counts
        }
    )
    linear = Linearised(Workspace(model), 0.3, complex_modes(build_system(model), 0.3, count=3), damped=True)
    tried = [
        ("materials.steel.young_modulus", 180e9), ("materials.iron.density", 7400.0), ("materials.steel.density", 7900.0),
        ("bodies.slider.damping.stiffness", 4e-8), ("contacts.rub.stiffness", 1.2e13),
        ("materials.steel.young_modulus", 200e9), ("materials.iron.poisson_ratio", 0.31),
    ]  # fmt: skip
    for path, value in tried:
        mine, fresh = linear.varied(path, value), build_system(model.with_({path: value}))
        for name in ("mass", "damping", "stiffness"):
            assert abs(getattr(mine, name) - getattr(fresh, name)).nnz == 0, (path, name)
        assert mine.dof_names == fresh.dof_names
        one, other = (pencil_of(s, 0.3, linear.held, linear.options) for s in (mine, fresh))
        for name in ("damping", "stiffness", "push"):
            difference = abs(getattr(one, name) - getattr(other, name)).max()
            assert difference <= 1e-13 * abs(getattr(other, name)).max(), (path, name)
    assert 0 < linear._factors.factorisations < len(tried)


@pytest.mark.parametrize("elements", [90, 12])
def test_what_says_where_a_body_lies_has_no_origin(elements: int):
    """Beams moved together answer as before, one moved along answers as the other moved back, and both as modes solved
    anew; the contact is on a node, where the curve through nodes has another second derivative on either side."""
    paths = ["bodies.beam1.start.0", "bodies.beam2.start.0", "bodies.beam2.length"]
    base = st.loads(template_text("two-beams")).with_({"bodies.beam2.elements": elements})
    first, *others = (
        st.sensitivities(
            base.with_({"bodies.beam1.start.0": 0.1 + offset, "bodies.beam2.start.0": offset}), paths, mu=0.3
        ).derivative
        for offset in (0.0, 10.0)
    )  # fmt: skip
    np.testing.assert_allclose(others[0], first, rtol=1e-4)
    np.testing.assert_allclose(first[1], -first[0], rtol=1e-5)
    lam = st.sensitivities(base, paths[:1], mu=0.3).eigenvalues
    step = 1e-6
    for path, at, told in ((paths[0], 0.1, first[0]), (paths[2], 0.15, first[2])):
        low, high = (st.modes(base.with_({path: at + side}), 0.3, damped=True).eigenvalues[0] for side in (-step, step))
        nearest = [[values[np.argmin(np.abs(values - one))] for one in lam] for values in (low, high)]
        np.testing.assert_allclose(told, np.subtract(nearest[1], nearest[0]) / (2 * step), rtol=2e-4)


def test_a_position_of_masses_is_measured_by_how_far_they_are_apart():
    """A spring between two masses, one at the origin: what it does sideways is the square of its slope."""
    text = """
    units = "nondimensional"
    [bodies]
    a = {{ type = "mass", mass = 1.0, position = [{0}, {0}] }}
    b = {{ type = "mass", mass = 1.0, position = [{1}, {2}] }}
    [supports.a]
    at = "a"
    fixed = ["x", "y"]
    [springs]
    along = {{ between = ["a", "b"], stiffness = 4.0 }}
    held = {{ between = ["b", "ground"], stiffness = 1.0, direction = [1.0, 0.0] }}
    up = {{ between = ["b", "ground"], stiffness = 3.0, direction = [0.0, 1.0] }}
    [modal]
    max_frequency_hz = 10.0
    """
    found = [
        st.sensitivities(st.loads(text.format(at, at + 3e-3, at + 4e-3)), ["bodies.b.position.0"], modes="all").derivative
        for at in (0.0, 1.0)
    ]
    np.testing.assert_allclose(found[1], found[0], rtol=1e-6)
    # K = 4 n nᵀ + diag(1, 3) with n = (3, 4)/5, of which dn/dx = (16, −12)/25 over 5 mm.
    n, turn = np.array([0.6, 0.8]), np.array([0.64, -0.48]) / 5e-3
    stiffness = 4.0 * np.outer(n, n) + np.diag([1.0, 3.0])
    squares, shapes = np.linalg.eigh(stiffness)
    change = 4.0 * (np.outer(n, turn) + np.outer(turn, n))
    rates = np.einsum("ik,ij,jk->k", shapes, change, shapes) / (2.0 * np.sqrt(squares))
    assert sorted(found[0][0].imag) == pytest.approx(sorted(rates), rel=1e-6)


LEANING = """
materials.a = { young_modulus = 3e9, density = 2500.0, poisson_ratio = 0.3 }
springs.lean = { between = ["pad.tip", "ground"], direction = [-0.7, 0.7], stiffness = 2e7 }
springs.hold = { between = ["pad.tail", "ground"], direction = [1.0, 0.1], stiffness = 1e7 }
loads.p = { at = "pad.top", pressure = 1e6 }
supports.end = { at = "pad.left", fixed = ["x"], displacement = { x = 0.0 } }
contacts.A = { slave = "pad.bottom", master = "belt", stiffness = 5e12, friction = { law = "coulomb", coefficient = 0.3 } }
modal = { max_frequency_hz = 40e3, friction_range = [0.0, 0.8] }
[bodies.belt]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [0.0, 1.0]
sliding.velocity = [2.0, 0.0]
[bodies.pad]
type = "solid"
model = "plane strain"
material = "a"
thickness = 0.02
mesh = { shape = "rectangle", corner = [0.0, 0.0], size = [0.04, 0.012], divisions = [3, 2], cells = "quad" }
damping = { mass = 20.0, stiffness = 1e-7 }
points = { tip = [0.04, 0.012], tail = [0.0, 0.012] }
"""


@pytest.mark.parametrize("changes", [{"contacts.A.cubic": 1e24}, {"modal.prestress": True}])
@pytest.mark.parametrize("path", ["contacts.A.interference", "supports.end.displacement.x"])
def test_lengths_that_press_have_derivatives_at_zero(changes, path):
    """A step of a thousandth of a metre is no small one for them; the truth are new solutions at nanometres."""
    model = loads(LEANING).with_(changes)
    found = sensitivities(model, [path], mu=0.15, modes="all")
    ends = [modes(model.with_({path: h}), 0.15).eigenvalues[0] for h in (-1e-8, 1e-8)]
    assert len(ends[0]) == len(ends[1])
    true = np.array([(b - a) / 2e-8 for a, b in zip(*ends, strict=True)])
    size = np.abs(true).max()
    assert size > 1e3
    assert np.abs(found.derivative[0] - true[: found.derivative.shape[1]]).max() < 1e-2 * size


@pytest.mark.parametrize(("path", "small"), [("contacts.A.cubic", 1e20), ("springs.lean.cubic", 1e12)])
def test_cubic_terms_of_zero_have_an_effect(path, small):
    """A thousandth of a unit of them is rounding beside the stiffness; the truth is the derivative a little off zero."""
    model = loads(LEANING)
    found = sensitivities(model, [path], mu=0.15, modes="all")
    beside = sensitivities(model.with_({path: small}), [path], mu=0.15, modes="all")
    size = np.abs(beside.derivative[0]).max()
    assert size * small > 1e-6
    assert np.abs(found.derivative[0] - beside.derivative[0]).max() < 1e-3 * size
    assert not any("no effect" in line for line in found.warnings)
