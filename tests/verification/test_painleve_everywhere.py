"""Whoever asks for motions of rigid contact beyond Painlevé's μ is told so: along numbers, in boxes, of cycles, in time.

The truth is the closed form for a rod on a belt, and determinants of N M⁻¹ (N + μS)ᵀ on fine grids.
"""

from __future__ import annotations

import numpy as np
import pytest
import scipy.optimize as so
import scipy.sparse as sp

import stridor as st
from leaning_rod import leaning_rod, limit_of
from stridor.errors import AnalysisError, CaseError
from stridor.modal.options import Options
from stridor.modal.painleve import steps_undetermined
from stridor.modal.parametric import Parameter, Term
from stridor.modal.parametric.contacts_determined import refuse_undetermined_in
from stridor.modal.parametric.factors import CONSTANT, Product
from stridor.system import System

pytestmark = pytest.mark.verification

SPRING, ANGLE = "springs.endx.stiffness", "bodies.rod.angle_deg"
LIMIT = limit_of(60.0)
SAYS = rf"grows beyond all bounds at μ = {LIMIT:.9g}: .*Painlevé.*; stay below, or give the contact a stiffness"


def along(case: st.Case, name: str, low: float, high: float):
    return st.onsets(case, (low, high), along=name)


def boundary(case: st.Case, top: float):
    return st.stability_boundary(
        case, "mu", SPRING, x_range=(0.1, top), y_range=(3e4, 9e4), lines=2, max_frequency_hz=5e3
    )


ASKED = {
    "along mu": lambda mu: along(leaning_rod(), "mu", 0.0, mu),
    "along a stiffness": lambda mu: along(leaning_rod(mu), SPRING, 3e4, 9e4),
    "along a density": lambda mu: along(leaning_rod(mu), "materials.steel.density", 7e3, 8e3),
    "boundary over mu": lambda mu: boundary(leaning_rod(), mu),
    "reduced over mu": lambda mu: st.reduced_model(leaning_rod(), {"mu": (0.1, mu)}),
    "reduced over a stiffness": lambda mu: st.reduced_model(leaning_rod(mu), {SPRING: (3e4, 9e4)}),
    "a cycle by shooting": lambda mu: st.cycles(leaning_rod(), mu=mu, method="shooting", seconds=1.0),
    "cycles over mu": lambda mu: st.cycles(leaning_rod(), between=(0.0, mu), seconds=1.0),
    "cycles by balance": lambda mu: st.cycles(leaning_rod(), between=(0.0, mu), method="harmonic", seconds=1.0),
}


@pytest.mark.parametrize("asked", ASKED)
def test_beyond_it_is_refused_with_the_value(asked):
    with pytest.raises(AnalysisError, match=SAYS):
        ASKED[asked](LIMIT * (1 + 1e-9))


@pytest.mark.parametrize(
    "asked",
    [pytest.param(name, marks=[pytest.mark.slow] * ("boundary" in name)) for name in ASKED if "cycle" not in name],
)
def test_a_hair_below_it_is_answered(asked):
    ASKED[asked](LIMIT * (1 - 1e-9))


def test_cycles_below_it_are_found_and_a_balance_beyond_says_why_there_is_none():
    assert st.cycles(leaning_rod(), mu=1.3, method="shooting").cycles
    found = st.cycles(leaning_rod(), mu=[1.4], method="harmonic", seconds=2.0)
    assert any("Painlevé" in said for said in found.missing)


def test_along_the_geometry_it_is_told_from_which_value_on():
    low, high, mu = 59.5, 60.5, 1.347
    at = so.brentq(lambda angle: limit_of(angle) - mu, low, high)
    words = rf"{ANGLE} = (\d+\.\d+) with μ = 1\.347.* from \1 to 60\.5; take a range outside"
    with pytest.raises(AnalysisError, match=words) as told:
        along(leaning_rod(mu), ANGLE, low, high)
    assert float(str(told.value).split(" = ")[1].split()[0]) == pytest.approx(at, abs=1e-4)
    along(leaning_rod(mu), ANGLE, low, at - 1e-3)
    # The other way round: beyond up to a value.
    with pytest.raises(AnalysisError, match=r"from 60\.019\d* to 60\.2;"):
        along(leaning_rod(mu), ANGLE, 59.8, 60.2)
    with pytest.raises(AnalysisError, match=rf"at μ = {limit_of(60.5):.9g} \(at {ANGLE} = 60\.5\)"):
        st.reduced_model(leaning_rod(), {"mu": (0.1, 1.4), ANGLE: (59.5, 60.5)})


def test_a_contact_with_a_stiffness_is_answered():
    along(leaning_rod(1.4, stiffness=1e8), SPRING, 3e4, 9e4)
    assert st.simulate(leaning_rod(1.4, stiffness=1e8).with_({"temporal.stepper": "implicit"})).notes == ()


def test_what_moves_rigid_contact_is_refused_with_what_to_do():
    with pytest.raises(CaseError, match="take mu, or give the contact a stiffness"):
        along(leaning_rod(), "contacts.rub.friction.coefficient", 0.1, 0.5)
    with pytest.raises(CaseError, match=r"moves where rigid contact touches.*or give the contact a stiffness"):
        along(leaning_rod().with_({"bodies.belt.normal": (0.1, 1.0)}), "bodies.belt.normal.0", 0.05, 0.2)


@pytest.mark.parametrize(("given", "own"), [(None, 1.4), (1.4, 0.3)])
def test_runs_in_time_say_it(given, own):
    implicit = {"temporal.stepper": "implicit"}
    note = rf"Painlevé's paradox\) from μ = {LIMIT:.6g} on, and it has μ = 1\.4 here"
    (said,) = st.simulate(leaning_rod(own).with_(implicit), given).notes
    assert note.replace("\\", "") in said
    # The exact stepper comes to a state that no forces go with, and says what that is.
    with pytest.raises(AnalysisError, match=rf"friction jams.*{note}"):
        st.simulate(leaning_rod(own).with_({"temporal.stepper": "exact"}), given)
    assert st.simulate(leaning_rod(1.3).with_(implicit)).notes == ()
    many = st.ensemble(
        leaning_rod().with_({**implicit, "phases.slide.duration": 0.004}), mu=[0.3, 1.4], modes=False
    )
    assert note.replace("\\", "") in many.notes[-1]


def test_the_force_of_the_impulse_that_the_note_speaks_of_grows_as_the_step_gets_smaller():
    case = leaning_rod(1.8).with_({"temporal.stepper": "implicit", "temporal.record_every": 1})
    force = [st.simulate(case.with_({"temporal.step": step})).normal_force.max() for step in (1e-6, 2.5e-7)]
    assert force[1] == pytest.approx(4 * force[0], rel=0.1)


def singular(mass: np.ndarray, normal: np.ndarray, slide: np.ndarray, mu: np.ndarray) -> bool:
    """Whether N M⁻¹ (N + μS)ᵀ turns singular on a grid of μ from 0 on: its least |det| changes sign."""
    inverse = np.linalg.inv(mass)
    signs = np.linalg.slogdet(normal @ inverse @ (normal + mu[:, None, None] * slide).transpose(0, 2, 1))[0]
    return bool(np.any(signs != signs[0]))


def test_contacts_with_friction_of_their_own_are_judged_by_a_factor_of_all():
    met = [0, 0]
    for seed in range(40):
        rng = np.random.default_rng([seed, 23])
        n = 6
        half = 0.4 * np.eye(n) + np.tril(rng.standard_normal((n, n)), -1)
        mass, own = half @ half.T, rng.uniform(0.2, 2.5, 2)
        contacts = {
            f"c{k}": {
                "normal": np.eye(n)[2 * k], "tangent": np.eye(n)[2 * k + 1], "stiffness": "rigid", "slip": -1.0,
                "friction": {"law": "coulomb", "coefficient": float(own[k])},
            }
            for k in range(2)
        }  # fmt: skip
        system = System.from_matrices(mass, np.zeros((n, n)), np.eye(n), contacts=contacts)
        slide = own[:, None] * np.eye(n)[1:4:2]
        said = steps_undetermined(system, None, Options())
        assert bool(said) == singular(mass, np.eye(n)[0:3:2], slide, np.linspace(0.0, 1.0, 400)), (seed, said)
        if said:
            factor = float(said.split(" times")[0].split()[-1])
            near = np.array([0.999, 1.001]) * factor
            assert singular(mass, np.eye(n)[0:3:2], slide, near)
        met[bool(said)] += 1
    assert min(met) >= 5, met


@pytest.mark.parametrize(
    ("seeds", "least"), [(range(16), 2), pytest.param(range(60), 10, marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_boxes_are_refused_where_some_mass_in_them_is_beyond_and_nowhere_else(seeds: range, least: int):
    met = [0, 0]
    for seed in seeds:
        rng = np.random.default_rng([seed, 29])
        n, m, over_mu = 6, int(rng.integers(1, 3)), seed % 2 == 0
        halves = [0.4 * np.eye(n) + np.tril(rng.standard_normal((n, n)), -1) for _ in range(2)]
        masses = [h @ h.T for h in halves]
        normal, slide = np.eye(n)[:m], np.eye(n)[m : 2 * m] * rng.choice([-1.0, 1.0], (m, 1))
        number = Parameter("p", 0.0, 2.0, 1.0)
        mu = Parameter("mu", 0.0, 1.5, 0.5)
        terms = (
            Term(sp.csr_array(masses[0]), "mass", CONSTANT), Term(sp.csr_array(masses[1]), "mass", Product((("p", 1.0),)))
        )  # fmt: skip
        rows = sp.csr_array(normal), sp.csr_array(slide if over_mu else 1.5 * slide)
        grid, top = np.linspace(0.0, 2.0, 33), np.linspace(0.0, 1.5, 200)
        bad = np.array([singular(masses[0] + p * masses[1], normal, slide, top) for p in grid])
        if not bad[::4].any() and bad.any():
            continue  # between what is looked at
        given = ((number, mu), mu, None) if over_mu else ((number,), None, 1.5)
        try:
            refuse_undetermined_in(terms, given[0], rows, given[1], given[2], None)
            refused = ""
        except AnalysisError as error:
            refused = str(error)
        assert bool(refused) == bool(bad.any()), (seed, refused, bad)
        met[bool(refused)] += 1
        if " from " in refused and " to " in refused:
            low, high = (float(w) for w in refused.split(" for p from ")[1].split(";")[0].split(" to "))
            inside = (grid > low) & (grid < high)
            edges = np.abs(grid[:, None] - np.array([low, high])).min(axis=1) > 0.02
            if len(np.flatnonzero(np.diff(bad.astype(int)))) == 1:
                assert np.array_equal(bad[edges], inside[edges]), (seed, refused, bad)
    assert min(met) >= least, met
