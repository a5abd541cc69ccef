"""Paths in time differ in cost, never in meaning: the same force histories, the stiffness of contacts included."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stridor as st
from benches import Slave, bench, paper_case
from marching import simulate_assembled
from rubbing_block import rubbing_block
from stridor.agreement.perturbation import perturb
from stridor.modal.over_friction import modes_of_band
from stridor.sliding import steady_sliding
from stridor.system import System, build_system
from stridor.temporal.schedule import PhaseSpec
from stridor.temporal.settings import Settings
from stridor.temporal.simulate import simulate
from stridor.temporal.trajectory import Trajectory

pytestmark = pytest.mark.verification

STEP = 2e-8
MU = 0.3
SOFT = 1e6  # [N/m], comparable with the beams: a case in which contact stiffness decides
PHASES = (PhaseSpec("press", 4e-5, {"press": 1.0}, {"clamp": 0.0}, 2e-5), PhaseSpec("slide", 8e-5, {"press": 1.0}, {"clamp": 1.0}))


def two_beams(stiffness: float | str, sliding: str = "small") -> System:
    """Lumped and damped by mass alone, which every path takes with the same scheme."""
    changes = {f"bodies.{name}.{key}": value for name in ("beam1", "beam2")
               for key, value in (("mass", "lumped"), ("damping", {"mass": 50.0, "stiffness": 0.0}))}  # fmt: skip
    case = paper_case(contacts__A__stiffness=stiffness, contacts__A__sliding=sliding).with_(changes)
    return build_system(case)


def marched(system: System, path: str, **options: object) -> Trajectory:
    settings = replace(Settings(step=STEP, record_every=10), **options)  # type: ignore[arg-type]
    if path == "assembled":
        return simulate_assembled(settings.system(system), PHASES, settings, mu=MU)
    return simulate(system, PHASES, replace(settings, path=path), mu=MU)


@pytest.mark.parametrize("stiffness", ["rigid", 1e10, SOFT])
def test_force_histories_are_those_of_one_scheme_on_every_path(stiffness):
    system = two_beams(stiffness)
    runs = [marched(system, path) for path in ("modal", "nodal", "assembled")]
    for run in runs[1:]:
        for name in ("normal_force", "tangential_force"):
            ours, theirs = getattr(run, name), getattr(runs[0], name)
            assert np.abs(theirs).max() > 1.0
            assert ours == pytest.approx(theirs, rel=0, abs=1e-8 * np.abs(theirs).max())


def test_contacts_with_springs_that_feel_each_other_are_solved_together_alike():
    damping = (50.0, 0.0)
    slaves = [
        Slave(place=place, stiffness=stiffness, damping=damping)
        for place, stiffness in ((0.3, SOFT), (0.55, "rigid"), (0.8, 3.0 * SOFT))
    ]
    system = bench(*slaves, mass="lumped", damping=damping)
    phases = [PhaseSpec("slide", 1e-4, {}, {})]
    modal, nodal = (
        simulate(system, phases, Settings(step=5e-8, record_every=5, path=path), mu=MU) for path in ("modal", "nodal")
    )
    assembled = simulate_assembled(system, phases, Settings(step=5e-8, record_every=5), mu=MU)
    for run in (nodal, assembled):
        assert np.abs(run.normal_force).max(axis=0).min() > 1.0
        assert run.normal_force == pytest.approx(modal.normal_force, rel=0, abs=1e-7 * modal.normal_force.max())


def test_finite_sliding_on_a_contact_spring_is_the_same_in_modes_and_on_freedoms():
    modal, nodal, assembled = (marched(two_beams(SOFT, "finite"), path) for path in ("modal", "nodal", "assembled"))
    for run in (nodal, assembled):
        assert run.normal_force == pytest.approx(modal.normal_force, rel=0, abs=1e-8 * modal.normal_force.max())
        # The gap along the normal of now, whatever the place on the master.
        assert run.gap == pytest.approx(modal.gap, rel=0, abs=1e-9 * np.abs(modal.gap).max())
    small = marched(two_beams(SOFT), "modal")
    # Within the hundredth of a millimetre that it slides here, finite sliding is next to small sliding.
    assert modal.normal_force == pytest.approx(small.normal_force, rel=0, abs=1e-3 * small.normal_force.max())


@pytest.mark.parametrize("path", ["modal", "nodal", "assembled"])
def test_contact_taken_as_rigid_in_time_is_contact_without_a_stiffness(path):
    said = marched(two_beams(SOFT), path, contact="rigid")
    rigid, soft = marched(two_beams("rigid"), path), marched(two_beams(SOFT), path)
    assert np.array_equal(said.normal_force, rigid.normal_force)
    assert np.abs(soft.normal_force - rigid.normal_force).max() > 0.1 * rigid.normal_force.max()


@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_steady_sliding_rests_on_the_contact_spring(sliding):
    """What starts in it stays in it, with N/K_c of approach: a rigid start would ring."""
    whole = two_beams(SOFT, sliding).with_friction(0.05, np.array([0.02]))
    # So light a load that the turned normals of finite sliding change nothing.
    system = replace(whole, loads={name: 1e-4 * load for name, load in whole.loads.items()})
    phases = [PhaseSpec("slide", 5e-6, {}, {})]
    run = simulate(system, phases, Settings(step=STEP, record_every=1, initial="steady-sliding"), mu=0.05)
    held = float(steady_sliding(system).normal_force[0])
    assert run.normal_force[:, 0] == pytest.approx(np.full(len(run.time), held), rel=1e-4)
    assert run.gap[:, 0] == pytest.approx(np.full(len(run.time), -held / SOFT), rel=1e-4)


def test_growth_in_time_is_that_of_the_modes_with_the_same_contact_stiffness():
    """A contact spring moves the rates: rigid in time, the two approaches part."""
    system = build_system(paper_case(contacts__A__stiffness=3.0 * SOFT))
    settings = Settings(step=STEP, record_every=50)
    mu, band = 0.3, 20e3

    def fastest(of: System) -> complex:
        modes = modes_of_band(of, mu, band)
        return complex(modes.eigenvalues[0, np.argmax(modes.growth_rate[0])])

    soft, rigid = fastest(system), fastest(system.with_rigid_contacts())
    given, said = (
        perturb(system, mu, settings=replace(settings, contact=contact), max_frequency_hz=band, duration=0.008)
        for contact in ("as given", "rigid")
    )
    assert abs(soft - rigid) > 0.02 * abs(soft)
    assert given.eigenvalue == pytest.approx(soft, rel=2e-4)
    assert said.eigenvalue == pytest.approx(rigid, rel=2e-4)


def test_surfaces_are_rigid_in_time_where_the_case_says_so():
    case = st.loads(rubbing_block("max_frequency_hz = 3e4"))
    phases, settings = [PhaseSpec("slide", 5e-5, {}, {})], Settings(record_every=1)
    soft, stiff = (build_system(case.with_({"contacts.face.stiffness": k})) for k in (1e11, "rigid"))
    said = simulate(soft, phases, replace(settings, contact="rigid"))
    assert np.array_equal(said.normal_force, simulate(stiff, phases, settings).normal_force)
    assert not np.array_equal(said.normal_force, simulate(soft, phases, settings).normal_force)


def test_a_case_says_which_contact_the_time_loop_takes():
    assert paper_case().temporal.contact == "rigid"
    with pytest.raises(st.CaseError, match="as given"):
        paper_case(temporal__contact="elastic")
