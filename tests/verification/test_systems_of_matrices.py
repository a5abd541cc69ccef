"""Systems of arrays are those that cases of the same matrices give, and pencils have the eigenvalues that are reported."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp

import stridor as st
from benches import Slave, bench, paper_case
from matrix_cases import TURN, matrix_case
from rubbing_block import rubbing_block
from stridor.modal.complex_modes import complex_modes
from stridor.modal.onsets import onsets
from stridor.modal.quadratic import Quadratic
from stridor.study.settings import phases_of, settings_of
from stridor.system import System
from stridor.temporal.simulate import simulate, step_of

pytestmark = pytest.mark.verification
LAW = {"law": "coulomb", "coefficient": 0.1}
HOFFMANN = np.array([[20.0, 4.0], [4.0, 15.0]])  # slave presses along y, belt along x


def minimal(**changes: object) -> System:
    contact = {"normal": {1: 1.0}, "tangent": [1.0, 0.0], "stiffness": 10.0, "friction": LAW}
    return System.from_matrices(np.eye(2), None, HOFFMANN, contacts={"belt": contact | changes})


def again(system: System) -> System:
    """The system made anew of its matrices and rows."""
    contacts = {
        c.name: {
            "normal": c.normal_row, "tangent": sp.csr_array(c.tangent_row[None]), "slip": float(c.tangent_lift.sum()),
            "stiffness": "rigid" if np.isinf(c.stiffness) else c.stiffness, "friction": LAW, "gap": c.gap,
        }
        for c in system.contacts
    }  # fmt: skip
    points = {name: rows.free[:2] for name, rows in system.points.items()}
    return System.from_matrices(
        system.mass.toarray(), system.damping, system.stiffness, contacts=contacts, loads=system.loads, points=points
    )


def by_scipy(problem: Quadratic) -> np.ndarray:
    """Finite eigenvalues of λ²M + λD + K, time in units of a middle period."""
    mass, damping, stiffness = (m.toarray() for m in problem.matrices())
    n = len(mass)
    tau = np.sqrt(np.linalg.norm(mass) / np.linalg.norm(stiffness))
    scale = 1 / np.linalg.norm(stiffness)
    left = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness * scale, -damping * scale / tau]])
    right = sl.block_diag(np.eye(n), mass * scale / tau**2)
    values = sl.eigvals(left, right)
    return values[np.isfinite(values)] / tau


def sharpened(problem: Quadratic, lam: complex) -> complex:
    """An eigenvalue by Newton's method on the smallest singular value: QZ is right to rounding of the largest one only,
    which processors do differently."""
    mass, damping, stiffness = (m.toarray() for m in problem.matrices())
    for _ in range(3):
        u, _, vh = sl.svd(lam**2 * mass + lam * damping + stiffness)
        y, x = u[:, -1].conj(), vh[-1].conj()
        lam = lam - y @ (lam**2 * mass + lam * damping + stiffness) @ x / (y @ (2 * lam * mass + damping) @ x)
    return lam


def assert_those_of(problem: Quadratic, found: np.ndarray, tolerance: float = 1e-9) -> None:
    reference = by_scipy(problem)
    nearest = reference[np.abs(found[:, None] - reference).argmin(axis=1)]
    assert np.abs(found / nearest - 1).max() < 1e-6
    sharp = np.array([sharpened(problem, complex(lam)) for lam in nearest])
    assert np.abs(found / sharp - 1).max() < tolerance


# -- the minimal model: K + k (n + μ s t) nᵀ = [[20, 4 − 10 μ], [4, 25]] ------------------------------------------


def test_flutter_of_the_minimal_model_by_hand():
    # ω² of [[20, 4 − 10μ], [4, 25]] meet where (25 − 20)² + 4·4·(4 − 10μ) = 0, at μ = 0.4 + 25/160.
    found = onsets(minimal(), (0.0, 1.0), max_frequency_hz=10.0)
    assert [o.mu for o in found.onsets] == pytest.approx([0.4 + 25 / 160], rel=1e-12)
    assert found.onsets[0].frequency_hz == pytest.approx(np.sqrt(22.5) / 2 / np.pi, rel=1e-9)
    assert not onsets(minimal(slip=-1.0), (0.0, 1.0), max_frequency_hz=10.0).onsets  # friction the other way
    matrices = st.pencil(minimal(), 0.7).matrices()
    assert [m.toarray().tolist() for m in matrices] == [np.eye(2).tolist(), [[0, 0], [0, 0]], [[20, -3], [4, 25]]]


def test_opposite_slip_turns_friction():
    assert st.pencil(minimal(slip=-2.0), 0.7).matrices()[2].toarray().tolist() == [[20, 11], [4, 25]]
    assert st.pencil(minimal(), 0.0).matrices()[2].toarray().tolist() == [[20, 4], [4, 25]]


@pytest.mark.parametrize("stiffness", [1e9, "rigid"])
def test_two_beams_made_of_their_matrices(stiffness: object):
    system = bench(Slave(stiffness=stiffness), Slave(place=0.5, length=0.04, stiffness=stiffness, force=10.0))  # pyright: ignore
    made = again(system)
    one, two = (complex_modes(s, [0.1, 0.3], count=6) for s in (system, made))
    assert np.abs(one.eigenvalues / two.eigenvalues - 1).max() < 1e-12
    first, second = (onsets(s, (0.0, 0.5), max_frequency_hz=30e3) for s in (system, made))
    assert [o.mu for o in first.onsets] == pytest.approx([o.mu for o in second.onsets], rel=1e-12)
    assert len(first.onsets) > 1


def test_a_run_of_matrices_is_that_of_the_case():
    # Damping by mass would work on the velocity of the carried beam as well, which matrices at rest know nothing of.
    case = paper_case(bodies__beam1__elements=6, bodies__beam2__elements=18, contacts__A__stiffness="rigid").with_(
        {
            "phases": [{"name": "slide", "duration": 1e-3}], "temporal.step": None, "temporal.perturbation": 0.01,
            "bodies.beam1.damping.mass": 0.0, "bodies.beam2.damping.mass": 0.0, "temporal.initial": "steady-sliding",
            "temporal.watch": ["beam1.start"],
        }
    )  # fmt: skip
    system = st.build_system(case)
    phases = [replace(phase, velocities={}) for phase in phases_of(case)]
    # Matrices alone take a step by what is looked at, a mesh one by its limit: both take that of the mesh.
    settings = settings_of(case)
    settings = replace(settings, step=step_of(system, settings, phases))
    one, two = (simulate(s, phases, settings) for s in (system, again(system)))
    assert np.ptp(one.normal_force) > 0.1
    assert np.abs(one.normal_force - two.normal_force).max() < 1e-8 * np.abs(one.normal_force).max()
    # The watched point is carried by the clamp in one frame and not in the other: along y it is not.
    assert np.ptp(one.displacement[:, 0, 1]) > 0
    assert two.displacement[:, 0, 1] == pytest.approx(one.displacement[:, 0, 1], rel=1e-6, abs=1e-12)


# -- the pencil has the eigenvalues -----------------------------------------------------------------------------


def test_pencil_of_two_beams():
    case = paper_case(bodies__beam1__elements=6, bodies__beam2__elements=18, contacts__A__stiffness=1e8)
    found = st.modes(case, 0.3, max_frequency_hz=20e3)
    assert found.unstable.any()
    assert_those_of(st.pencil(case, 0.3), found.eigenvalues[0])
    assert_those_of(st.pencil(case, 0.3, damped=False), st.modes(case, 0.3, damped=False).eigenvalues[0])


def test_pencil_with_rigid_contact():
    case = paper_case(bodies__beam1__elements=6, bodies__beam2__elements=18, contacts__A__stiffness="rigid")
    problem, found = st.pencil(case), st.modes(case)  # at the case's own friction
    assert problem.size == st.build_system(case).size + 1
    assert_those_of(problem, found.eigenvalues[0], 1e-6)  # an infinite eigenvalue of index three beside them


def test_pencil_of_a_block():
    case = st.loads(rubbing_block("max_frequency_hz = 40e3\nmodes = 8"))
    assert_those_of(st.pencil(case, 0.4), st.modes(case, 0.4).eigenvalues[0])


def test_pencil_of_imported_matrices_with_factors_of_mu(tmp_path: Path):
    terms = [(np.eye(2), "mass", ""), (0.1 * TURN + 0.01 * np.eye(2), "damping", ""), (HOFFMANN, "stiffness", ""), (TURN, "stiffness", "mu**2")]
    case = matrix_case(tmp_path, terms, 10.0)
    assert_those_of(st.pencil(case, 0.8), st.modes(case, 0.8).eigenvalues[0])
    assert st.pencil(case, 0.5).matrices()[2].toarray() == pytest.approx(HOFFMANN + 0.25 * TURN)
    still = st.pencil(case, 0.5, damped=False).matrices()[1].toarray()
    assert still == pytest.approx(0.1 * TURN)


# -- unsymmetric, in words ----------------------------------------------------------------------------------------


def test_matrices_of_any_structure():
    system = System.from_matrices(np.eye(2), 0.1 * TURN, sp.coo_array(HOFFMANN + 2 * TURN))
    assert system.not_symmetric_definite == "the damping matrix is not symmetric"
    found = complex_modes(system, 0.0, max_frequency_hz=10.0)
    assert_those_of(st.pencil(system, 0.0), found.eigenvalues[0])
    assert (found.source, minimal().not_symmetric_definite) == ("full", "")


MISSING = "missing – give numbers, one for each freedom, or a table of weights by freedom, from 0: the relative displacement "


@pytest.mark.bad_input
@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"mass": np.eye(3)}, "stiffness: must be of shape (3, 3), as the first, not (2, 2)"),
        ({"mass": 1j * np.eye(2)}, "mass: must be real numbers, not of type complex128"),
        ({"mass": np.zeros((2, 2))}, "mass: the mass is zero; without a mass nothing vibrates"),
        ({"stiffness": [[1, np.nan], [1, 1]]}, "stiffness: must be finite; 1 number is not"),
        ({"stiffness": [[1], [1, 2]]}, "stiffness: is no matrix of numbers; its rows must be equally long"),
        ({"damping": [1.0, 2.0]}, "damping: must have two dimensions, not shape (2,)"),
        ({"loads": {"f": [1.0]}}, "loads.f: must be a row of 2 numbers, not of shape (1, 1)"),
        ({"loads": 3}, "loads: 3 – must be a dictionary, with a NAME for each"),
        ({"points": {"p": np.eye(3)}}, "points.p: must be rows of shape (2, 2), not (3, 3): the displacements along x and y"),
        ({"normal": None}, f"contacts.A.normal: {MISSING}slave − master along the normal, which opens"),
        ({"normal": {2: 1.0}}, "contacts.A.normal: the keys of its weights must be freedoms from 0 to 1"),
        ({"tangent": [0, 0]}, "contacts.A.tangent: must not be zero throughout"),
        ({"slip": 0}, "contacts.A.slip: 0.0 – must not be 0: positive where the slave slides along tangent, negative where against it"),
        ({"stiffness ": 1.0}, "contacts.A.\"stiffness \": unknown key; did you mean 'stiffness'? accepted: normal, tangent, slip, gap, stiffness, cubic, closed, friction"),
        ({"friction": {"law": "coulomb", "coefficient": -1.0}}, "contacts.A.friction.coefficient: -1.0 – must be a number >= 0, the friction coefficient while sliding"),
        ({"friction": {"law": "static-kinetic", "coefficient": 0.3, "static_coefficient": 0.1}}, "contacts.A.friction.static_coefficient: 0.1 – must be at least the coefficient, 0.3"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told(given: dict, told: str):
    whole = {"mass": np.eye(2), "damping": None, "stiffness": HOFFMANN}
    contact = {"normal": [0, 1], "tangent": [1, 0], "stiffness": 10.0, "friction": LAW}
    for key, value in given.items():
        (whole if key in ("mass", "damping", "stiffness", "loads", "points") else contact)[key] = value
    with pytest.raises(st.CaseError) as error:
        System.from_matrices(**whole, contacts={"A": contact})
    assert str(error.value) == told


def test_freedoms_that_nothing_holds_or_moves():
    with pytest.raises(st.CaseError, match=r"^stiffness: freedoms without an entry in any matrix \(from 0: 1\);"):
        System.from_matrices(np.diag([1.0, 0.0]), None, np.diag([1.0, 0.0]))


def test_the_pencil_takes_the_friction_of_the_contacts_where_they_have_one():
    own, given = (st.pencil(minimal(), *mu).matrices()[2].toarray() for mu in ((), (LAW["coefficient"],)))
    assert np.array_equal(own, given)
    contact = {"normal": [0, 1], "tangent": [1, 0], "stiffness": 10.0, "friction": LAW}
    other = contact | {"friction": {"law": "coulomb", "coefficient": 0.9 * LAW["coefficient"]}}
    two = System.from_matrices(np.eye(2), None, HOFFMANN, contacts={"A": contact, "B": other | {"normal": [1, 0], "tangent": [0, 1]}})
    with pytest.raises(st.CaseError, match=r"^mu: one friction coefficient for all contacts, since the case gives them different ones: name it"):
        st.pencil(two)


def test_a_band_holds_all_its_modes_whatever_the_matrices():
    """Forty of them, and as many as are asked for, where the stiffness is not symmetric as where it is."""
    stiffness = np.diag((2 * np.pi * np.linspace(10.0, 400.0, 40)) ** 2)
    for skew in (0.0, 500.0):
        stiffness[0, 1] = skew
        system = st.System.from_matrices(np.eye(40), None, stiffness)
        found = st.modes(system, 0.1, max_frequency_hz=500.0)
        np.testing.assert_allclose(found.frequency_hz[0], np.linspace(10.0, 400.0, 40), rtol=1e-9)
        assert st.modes(system, 0.1, count=30).eigenvalues.shape == (1, 30)


@pytest.mark.parametrize("free", [2, 3])
def test_damped_motions_without_stiffness_are_modes_like_others(free: int) -> None:
    rng = np.random.default_rng(free)
    for _ in range(4):
        n = int(rng.integers(5, 9))
        turn = np.linalg.qr(rng.standard_normal((n, n)))[0]
        omega = np.concatenate([np.zeros(free), rng.uniform(0.5, 3.0, n - free)])
        mass, damping = np.diag(rng.uniform(0.5, 2.0, n)), 0.02 * np.diag(rng.uniform(0.0, 1.0, n))
        stiffness = (turn * omega**2) @ turn.T
        rows = rng.standard_normal((2, free, n))
        law = {"law": "coulomb", "coefficient": 0.3}
        contacts = {
            f"c{i}": {"normal": rows[0, i], "tangent": rows[1, i], "stiffness": 10.0, "friction": law} for i in range(free)
        }
        system = System.from_matrices(mass, damping, (stiffness + stiffness.T) / 2, contacts=contacts)
        found = st.modes(system, [0.3], max_frequency_hz=7.0 / (2 * np.pi))
        rubbed = stiffness + 10.0 * (rows[0] - 0.3 * rows[1]).T @ rows[0]
        states = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(mass, a) for a in (rubbed, damping)]])
        every = np.linalg.eigvals(states)
        truth = every[(every.imag > 1e-3) & (np.abs(every) < 6.9)]
        apart = np.abs(every[:, None] - found.eigenvalues[0])
        assert apart[np.isin(every, truth)].min(axis=1).max() < 1e-9  # none is left out
        assert apart[:, found.unstable[0]].min(axis=0, initial=1.0).max(initial=0.0) < 1e-9  # none is invented
        assert found.residual[0].max() < 1e-11


def test_a_motion_that_nothing_holds_leaves_no_basis_and_is_answered_all_the_same() -> None:
    # The first two are free and undamped along (1, 1), whose double root at 0 has one shape; damping couples the others.
    stiffness = np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 4.0]])
    damping = np.array([[0.1, -0.1, 0.05], [-0.1, 0.1, -0.05], [0.05, -0.05, 0.2]])
    contact = {"normal": [1.0, 0.0, 0.5], "tangent": [0.0, 1.0, 1.0], "stiffness": 2.0, "friction": LAW}
    system = System.from_matrices(np.eye(3), damping, stiffness, contacts={"rub": contact})
    found = st.modes(system, [0.2], max_frequency_hz=1.0)
    rubbed = stiffness + 2.0 * np.outer(np.array([1.0, 0.0, 0.5]) - 0.2 * np.array([0.0, 1.0, 1.0]), [1.0, 0.0, 0.5])
    truth = np.linalg.eigvals(np.block([[np.zeros((3, 3)), np.eye(3)], [-rubbed, -damping]]))
    truth = np.sort_complex(truth[truth.imag > 1e-9])
    assert np.allclose(np.sort_complex(found.eigenvalues[0]), truth, rtol=1e-9)
