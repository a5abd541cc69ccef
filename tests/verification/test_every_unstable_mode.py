"""Every mode that grows in the band at a μ is listed there, wherever it began: random problems against dense eigenvalues
of the full matrices."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as sl

import stridor as st
from benches import Slave, bench, by_hand, full_eigenvalues, paper_case
from hidden_modes import HZ_OF_POINTS, MU_OF_BLOCK, MU_OF_POINTS, entering_points, hidden_block
from matrix_cases import matrix_case
from rubbing_block import rubbing_block
from stridor.modal.checked_modes import checked_modes
from stridor.modal.checked_onsets import checked_onsets
from stridor.modal.complex_modes import ComplexModes, complex_modes
from stridor.modal.krylov import Options
from stridor.modal.krylov.problem import problem_of
from stridor.modal.onsets import Onsets, onsets
from stridor.modal.over_friction import modes_of_band
from stridor.sliding.stretches import stretches
from stridor.system import System

pytestmark = pytest.mark.verification

FEW = (1, 5)  # in the first of them branches from below the band do not lead to all that grows
MANY = [pytest.param(k, marks=pytest.mark.slow) for k in range(120) if k not in FEW]
FAINT = 1e-6  # of |λ|: growth that either side may take for rounding
BORDER = 1e-6  # of the band


def must_be_there(values: np.ndarray, top: float) -> np.ndarray:
    """Eigenvalues (k,) that grow clearly, in the band and not on its border."""
    values = values[values.imag >= 0]
    faint = np.abs(values) <= 1e-4 * top
    return values[(values.real > FAINT * np.abs(values)) & (values.imag <= top * (1 - BORDER)) & ~faint]


def check_rows(found: ComplexModes, dense: list[np.ndarray], top: float, accuracy: float = 1e-6) -> int:
    """Every growing eigenvalue is among the unstable ones of its μ and each of those is one; how many there are."""
    total = 0
    for row, values in enumerate(dense):
        mine = found.eigenvalues[row][found.unstable[row] & found.in_band[row]]
        for lam in must_be_there(values, top):
            total += 1
            assert np.abs(mine - lam).min(initial=np.inf) <= accuracy * abs(lam), (row, lam, mine, found.completeness)
        for lam in mine[mine.real > FAINT * np.abs(mine)]:
            assert np.abs(values - lam).min(initial=np.inf) <= accuracy * abs(lam), (row, lam, found.completeness)
        clear = must_be_there(mine, top)
        assert len(clear) == len(must_be_there(values, top)), (row, found.completeness[row])
    return total


def check_onsets(found: Onsets, ends: list[np.ndarray], top: float) -> None:
    """What is said of both ends is so; an onset comes before whatever grows at the end alone."""
    for said, values in zip((found.at_start, found.at_end), ends, strict=True):
        mine = must_be_there(np.array(said, dtype=complex), top)
        assert len(mine) == len(must_be_there(values, top)), found.completeness
    if found.completeness.startswith(("Checked", "Complete")):
        born = sum(1 if not o.stabilising else 0 for o in found.onsets)
        assert len(must_be_there(ends[1], top)) <= len(found.at_start) + born, found.completeness


# -- modes that begin above the band and enter it growing --------------------------------------------------------------
@pytest.mark.parametrize(("hz", "told"), [(HZ_OF_POINTS, "starts above it"), (0.55, "no branch from μ = 0 was seen")])
def test_a_mode_of_point_contacts_that_enters_the_band_is_found(hz: float, told: str):
    system = entering_points()
    dense = full_eigenvalues(system, MU_OF_POINTS)
    grown = must_be_there(dense, 2 * np.pi * hz)
    assert len(grown) == 1
    followed = complex_modes(system, MU_OF_POINTS, max_frequency_hz=hz)
    assert not followed.unstable.any()  # else this tests nothing
    found = modes_of_band(system, MU_OF_POINTS, hz)
    assert found.eigenvalues[found.unstable] == pytest.approx(grown, rel=1e-9)
    assert found.completeness[0].startswith("Checked: 1 mode grows")
    assert told in found.completeness[0]


def test_a_mode_of_a_meshed_body_that_enters_the_band_is_found():
    case = hidden_block()
    dense = dense_of_meshed(case, MU_OF_BLOCK, touching_at=MU_OF_BLOCK)
    grown = must_be_there(dense, 2 * np.pi * case.modal.max_frequency_hz)
    assert len(grown) == 1
    assert not st.modes(case, MU_OF_BLOCK, check=False).unstable.any()  # else this tests nothing
    found = st.modes(case, MU_OF_BLOCK)
    assert found.eigenvalues[found.unstable] == pytest.approx(grown, rel=1e-7)
    assert "1 of which starts above it" in found.completeness[0]


# -- point contacts ----------------------------------------------------------------------------------------------------
def random_bench(rng: np.random.Generator) -> System:
    """Masses under a belt: stiffness of either sign, damping light, heavy, or negative."""
    n, m = int(rng.integers(4, 10)), int(rng.integers(1, 4))
    shapes = rng.standard_normal((n, n))
    squares = np.exp(rng.uniform(-1.5, 2.5, n))
    if rng.random() < 0.4:
        squares[: rng.integers(1, 3)] *= -1
    stiffness = shapes.T @ np.diag(squares) @ shapes
    mass = np.diag(rng.uniform(0.5, 2.0, n))
    damping = np.zeros((n, n))
    kind = rng.integers(4)
    if kind == 1:
        damping = 0.02 * mass + 1e-3 * stiffness
    elif kind == 2:
        rows = rng.standard_normal((n, n))
        damping = rng.uniform(0.01, 4.0) * rows.T @ rows
    elif kind == 3:
        damping = 0.02 * mass
        damping[0, 0] -= rng.uniform(0.0, 0.4)
    normal, tangent = rng.standard_normal((2, m, n))
    contact = np.exp(rng.uniform(0, 4, m))
    contact[rng.random(m) < 0.2] = np.inf
    return by_hand(mass, damping, stiffness, normal, tangent, contact)


def answer(call):
    """The result, or None where the program says that it has none."""
    try:
        return call()
    except st.AnalysisError:
        return None


@pytest.mark.parametrize("seed", [*FEW, *MANY])
def test_of_point_contacts(seed: int):
    rng = np.random.default_rng([seed, 1])
    counted = answered = 0
    for _ in range(4):
        system = random_bench(rng)
        mus = np.sort(rng.uniform(0.0, 1.2, 3))
        dense = [full_eigenvalues(system, float(mu)) for mu in (0.0, *mus)]
        frequency = np.sort(dense[0].imag[dense[0].imag > 1e-6])
        if not len(frequency):
            continue
        top = float(frequency[len(frequency) // 2] * 1.07)
        hz = top / (2 * np.pi)
        found = answer(lambda s=system, m=mus, f=hz: checked_modes(s, complex_modes(s, m, max_frequency_hz=f), f))
        if found is not None:
            answered += 1
            counted += check_rows(found, dense[1:], top)
        solved = answer(lambda s=system, m=mus, f=hz: checked_onsets(
            s, onsets(s, (0.0, float(m[-1])), max_frequency_hz=f), damped=True))  # fmt: skip
        if solved is not None:
            check_onsets(solved, [dense[0], dense[-1]], top)
    assert answered >= 1


# -- imported matrices -------------------------------------------------------------------------------------------------
def random_terms(rng: np.random.Generator) -> list:
    """Mass, damping, gyroscopic, circulatory parts and friction, of sizes at which the lowest are overdamped."""
    n = int(rng.integers(3, 12))
    shapes = rng.standard_normal((n, n))
    squares = np.exp(rng.uniform(-1.0, 3.0, n))
    if rng.random() < 0.3:
        squares[0] *= -1
    stiffness = shapes.T @ np.diag(squares) @ shapes
    rows = rng.standard_normal((n, n))
    skew = rng.standard_normal((n, n))
    terms = [(np.diag(rng.uniform(0.5, 2.0, n)), "mass", ""), (stiffness, "stiffness", "")]
    damping = rng.choice([0.0, 0.01, 0.3, 3.0]) * rows.T @ rows
    if rng.random() < 0.5:
        damping = damping + rng.uniform(0, 2) * (skew - skew.T)
    if np.any(damping):
        terms.append((damping, "damping", ""))
    if rng.random() < 0.3:
        circulatory = rng.standard_normal((n, n))
        terms.append((0.5 * (circulatory - circulatory.T), "stiffness", ""))
    terms.append((rng.uniform(0.3, 3.0) * rng.standard_normal((n, n)), "stiffness", "mu"))
    return terms


def dense_of(terms: list, mu: float) -> np.ndarray:
    n = len(terms[0][0])
    total = {role: np.zeros((n, n)) for role in ("mass", "damping", "stiffness")}
    for matrix, role, factor in terms:
        total[role] += (mu if factor else 1.0) * matrix
    inverse = np.linalg.inv(total["mass"])
    return sl.eigvals(
        np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ total["stiffness"], -inverse @ total["damping"]]])
    )


@pytest.mark.parametrize("seed", [*FEW, *MANY])
def test_of_imported_matrices_whatever_is_counted(seed: int, tmp_path: Path):
    rng = np.random.default_rng([seed, 2])
    terms = random_terms(rng)
    mus = np.sort(rng.uniform(0.0, 1.0, 2))
    dense = [dense_of(terms, float(mu)) for mu in mus]
    frequency = np.sort(dense[0].imag[dense[0].imag > 1e-6])
    if not len(frequency):
        pytest.skip("nothing oscillates")
    top = float(frequency[len(frequency) // 2] * 1.03)
    case = matrix_case(tmp_path, terms, top / (2 * np.pi), (float(mus[0]), float(mus[1])))
    check_rows(st.modes(case, mus, count=1), dense, top)
    solved = answer(lambda: st.onsets(case))
    if solved is not None:
        check_onsets(solved, dense, top)


def test_overdamped_modes_do_not_push_unstable_ones_off_the_list(tmp_path: Path):
    """Ten oscillators of negative damping beside thirty that creep: the twenty of lowest frequency all creep."""
    n = 40
    damping = np.full(n, 40.0)
    damping[30:] = -0.2
    stiffness = np.linspace(1.0, 9.0, n)
    terms = [(np.eye(n), "mass", ""), (np.diag(stiffness), "stiffness", ""), (np.diag(damping), "damping", "")]
    coupling = np.zeros((n, n))
    coupling[0, 1], coupling[1, 0] = 1e-3, -1e-3
    found = st.modes(matrix_case(tmp_path, [*terms, (coupling, "stiffness", "")], 1.0), 0.0, count=20)
    assert np.count_nonzero(found.unstable[0]) == 10
    document = found.to_json(sort="growth", unstable=True)
    assert [row["unstable"] for row in document["modes"][0]] == [True] * 10
    assert document["unstable_modes"] == [10]
    assert document["modes_in_band"][0] > 20


def dense_of_meshed(case: st.Case, mu: float, touching_at: float | None = None) -> np.ndarray:
    """All eigenvalues of a small meshed model with compliant contact."""
    problem = problem_of(st.build_system(case), touching_at, Options())
    q = problem.pencil(mu).condensed()
    mass, damping, stiffness = (a.toarray() for a in (q.mass, q.damping, q.stiffness))
    inverse, unit = np.linalg.inv(mass), 2 * np.pi * case.modal.max_frequency_hz
    state = np.block(
        [[np.zeros_like(mass), np.eye(len(mass))], [-inverse @ stiffness / unit**2, -inverse @ damping / unit]]
    )
    return sl.eigvals(state) * unit


# -- meshed bodies -----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("seed", [1, *[pytest.param(k, marks=pytest.mark.slow) for k in (0, *range(2, 12))]])
def test_of_meshed_bodies(seed: int):
    """A rubbing block, with springs that hold it or drive it, against the dense eigenvalues of its matrices."""
    rng = np.random.default_rng([seed, 3])
    spring = float(rng.choice([0.0, -1e7, -3e8, 1e8]))
    more = (
        f'[springs.s]\nbetween = ["block.crown", "ground"]\nstiffness = {spring}\ndirection = [1.0, 0.0]\n'
        if spring else ""
    )  # fmt: skip
    hz = float(rng.uniform(10e3, 30e3))
    case = st.loads(rubbing_block(f"max_frequency_hz = {hz}\nmodes = 2", more=more)).with_(
        {
            "contacts.face.stiffness": float(10 ** rng.uniform(11, 13)),
            "bodies.block.damping.mass": float(rng.uniform(0, 200)),
            "bodies.block.mesh.divisions": [int(rng.integers(2, 4)), int(rng.integers(2, 4))],
            "bodies.slider.mesh.divisions": [6, 1],
        }
    )
    # Friction tips the block over where no spring holds it.
    highest = [s for s in stretches(st.build_system(case), 0.0, 1.5) if not s.reason][-1].high
    mus = np.sort(rng.uniform(0.1, 1.0, 2)) * highest
    dense = [dense_of_meshed(case, float(mu), float(mu)) for mu in (0.0, *mus)]
    check_rows(st.modes(case, mus), dense[1:], 2 * np.pi * hz, accuracy=1e-5)
    solved = st.onsets(case, (0.0, float(mus[-1])))
    check_onsets(solved, [dense[0], dense[-1]], 2 * np.pi * hz)


@pytest.mark.parametrize("source", ["auto", "krylov"])
def test_the_last_digits_of_a_slow_mode_do_not_grow(source: str) -> None:
    """Undamped beams whose slowest mode is 644 1/s beside 1e7 1/s of the mesh: its λ has few digits, and is stable."""
    none = {f"bodies__{name}__damping": {"mass": 0.0, "stiffness": 0.0} for name in ("beam1", "beam2")}
    case = paper_case(contacts__A__stiffness=1e10, bodies__beam1__elements=10, bodies__beam2__elements=30, **none)
    found = st.modes(case.with_({"modal.source": source}), 1.0, max_frequency_hz=20e3)
    truth = st.modes(case.with_({"modal.source": "full"}), 1.0, max_frequency_hz=20e3)
    grow = [np.sort(m.eigenvalues[m.unstable & m.in_band].imag) for m in (found, truth)]
    assert grow[0] == pytest.approx(grow[1], rel=1e-9)
    assert "no branch from" not in found.completeness[0]


def test_a_mode_that_no_branch_leads_to_is_as_good_as_the_others() -> None:
    """A slow motion that diverges, the other half of one that fell apart on the real axis: the search that finds it ends
    at a backward error of 1e-10, which is 1e-8 of it."""
    system = bench(
        Slave(place=0.55223, lean_deg=4.7387, length=0.0318, thickness=1.3105e-3, stiffness=1e7, end="clamped"),
        Slave(place=0.85552, lean_deg=9.8097, length=0.04616, thickness=1.3117e-3, stiffness=1e9, end="clamped"),
    )
    found = modes_of_band(system, [0.2, 0.8], 20e3)
    assert "of which no branch from μ = 0 was seen to lead to" in found.completeness[1]
    lam = found.eigenvalues[1, -1]
    assert lam.imag == 0.0
    assert found.residual[1, -1] < 1e-14
    whole = problem_of(system, None, Options()).pencil(0.8).condensed()
    mass, damping, stiffness = (a.toarray() for a in (whole.mass, whole.damping, whole.stiffness))
    wide = [a.astype(np.longdouble) for a in (mass, damping, stiffness)]
    exact, x, y = float(lam.real), np.ones(len(mass)), np.ones(len(mass))
    for _ in range(6):
        near = exact * (1 + 1e-8)
        matrix = near**2 * mass + near * damping + stiffness
        x, y = np.linalg.solve(matrix, x), np.linalg.solve(matrix.T, y)
        x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
        rest = y @ (exact**2 * (wide[0] @ x) + exact * (wide[1] @ x) + wide[2] @ x)
        exact -= float(rest / (y @ (2 * exact * mass + damping) @ x))
    assert abs(lam.real - exact) < 1e-10 * exact
