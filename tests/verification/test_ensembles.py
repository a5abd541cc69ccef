"""Members of an ensemble are the runs that they would be alone.

Side by side the sums over modes are taken in another order than in a single run: displacements agree to rounding until
impacts make it grow, and contact forces, which are differences of displacements over Δt², to seven digits less. So short
runs are compared step by step, and by what holds whatever the rounding.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import stridor as st
from benches import Slave, bench, paper_case
from marching import block_on_belt
from stridor.errors import AnalysisError
from stridor.laws import Hyperbolic, StaticKinetic, Tabulated, Weakening
from stridor.sliding import steady_sliding
from stridor.system import System, build_system
from stridor.temporal import ensembles
from stridor.temporal.ensembles import march_all
from stridor.temporal.legs import Member
from stridor.temporal.schedule import PhaseSpec
from stridor.temporal.settings import Settings
from stridor.temporal.simulate import simulate
from stridor.temporal.steppers import starting
from stridor.temporal.steppers.modal import batch
from stridor.temporal.trajectory import Trajectory

pytestmark = pytest.mark.verification

COARSE = {
    "bodies.beam1.elements": 5, "bodies.beam2.elements": 12, "temporal.step": None, "temporal.record_every": 10
}  # fmt: skip
PHASES = (PhaseSpec("press", 2e-4, {}, {"clamp": 0.0}, 1e-4), PhaseSpec("slide", 6e-4, {}, {"clamp": 1.0}))
MEMBERS = [Member(mu, load, speed) for mu in (0.05, 0.4) for load, speed in ((1.0, 1.0), (0.7, 3.0), (0.01, 0.2))]


def coarse(**changes: object) -> System:
    return build_system(paper_case().with_(COARSE).with_({k.replace("__", "."): v for k, v in changes.items()}))


def all_of(system, phases, settings, tracks, *, window=0.5, **options) -> dict[tuple[int, int], Trajectory | str]:
    """What is seen of each member."""
    found: dict[tuple[int, int], Trajectory | str] = {}
    march_all(
        system, phases, settings, tracks, lambda track, leg, run: found.__setitem__((track, leg), run), window=window,
        **options,
    )  # fmt: skip
    return found


def alone(system: System, phases, settings: Settings, member: Member) -> Trajectory:
    return simulate(system, member.phases(phases, system), member.settings(settings), mu=member.mu)


def assert_same(ours: Trajectory, theirs: Trajectory, *, close: float = 1e-10, steps: int | None = None) -> None:
    """Records up to so many steps: displacements to rounding, the rest by what Δt makes of it."""
    until = len(theirs.time) if steps is None else steps // theirs.record_every
    assert ours.time.tolist() == theirs.time.tolist()
    assert ours.status[:until].tolist() == theirs.status[:until].tolist()
    for name, loss in (
        ("displacement", 1.0), ("velocity", 1e2), ("slip_speed", 1e2), ("acceleration", 1e4), ("normal_force", 1e4),
        ("tangential_force", 1e4),
    ):  # fmt: skip
        mine, other = getattr(ours, name)[:until], getattr(theirs, name)[:until]
        # What slips while it sticks is rounding.
        size = np.abs(other).max()
        if name in ("velocity", "slip_speed"):
            size = max(np.abs(theirs.velocity).max(), np.abs(theirs.slip_speed).max())
        assert np.abs(mine - other).max() <= loss * close * size, name


def test_what_nothing_disturbs_stays_at_rest() -> None:
    """Its velocities are 1e-12 m/s, of which a half is larger than the other."""
    case = paper_case().with_(COARSE).with_({"phases": [{"name": "go", "duration": 2e-3}], "temporal.watch": ["beam1.tip"]})
    for observable in (None, "A.normal_force"):
        found = st.ensemble(
            case, mu=[0.05], perturbation=[0.0, 1e-4], initial="steady-sliding", observable=observable, modes=False
        )
        assert found.regime[0] == "still"
        assert found.regime[1] in ("grows", "decays", "linear")
        assert np.isnan(found.growth_rate[0])
        assert np.isnan(found.frequency_hz[0])
        assert np.isfinite(found.growth_rate[1])
        assert any(note.startswith("1 member without a perturbation stayed in steady sliding") for note in found.notes)


@pytest.mark.parametrize(("beta2", "contact", "every"), [(0.5, "rigid", 7), (0.5, "as given", 50), (0.75, "rigid", 3)])
def test_each_member_is_the_run_that_it_would_be_alone(beta2, contact, every):
    system = coarse(contacts__A__stiffness=1e7)
    settings = Settings(beta2=beta2, contact=contact, record_every=every, watch=("beam1.tip", "beam2.end"))
    found = all_of(system, PHASES, settings, [[m] for m in MEMBERS])
    statuses = set()
    for number, member in enumerate(MEMBERS):
        theirs, ours = alone(system, PHASES, settings, member), found[number, 0]
        assert_same(ours, theirs)
        statuses |= set(theirs.status.ravel().tolist())
        whole = theirs.phases[-1].contacts["A"]
        parts = [p.contacts["A"] for p in ours.phases[1:]]  # the last phase is in two parts, the window and before
        assert [p.name for p in ours.phases] == ["press", "slide", "window"]
        # A stick that is on the edge may take a step more or less.
        assert np.mean([p.stick_fraction for p in parts]) == pytest.approx(whole.stick_fraction, abs=2e-3)
        assert np.mean([p.separation_fraction for p in parts]) == pytest.approx(whole.separation_fraction, abs=2e-3)
        assert max(p.max_normal_force for p in parts) == pytest.approx(whole.max_normal_force, rel=1e-5)
    assert statuses == {0, 1, 2}  # all that contacts do was met


@pytest.mark.parametrize(
    "law",
    [
        StaticKinetic(0.2, 0.3), Weakening(0.2, 0.3, 0.05), Hyperbolic(0.2, 0.3, 20.0),
        Tabulated((0.0, 0.02, 0.1), (0.3, 0.25, 0.2)), Tabulated((0.0, 0.02, 0.1), (0.3, 0.25, 0.2), "monotone-cubic"),
    ],
    ids=lambda law: type(law).__name__,
)  # fmt: skip
def test_members_follow_their_own_law_of_friction(law):
    system = coarse()
    system = replace(system, contacts=tuple(replace(c, law=law) for c in system.contacts))
    members = [Member(None), Member(0.1, 1.0, 2.0), Member(0.35, 0.5, 0.5)]
    settings = Settings(watch=("beam1.tip",), record_every=20)
    found = all_of(system, PHASES, settings, [[m] for m in members])
    for number, member in enumerate(members):
        assert_same(found[number, 0], alone(system, PHASES, settings, member))


def test_members_start_from_their_own_steady_sliding():
    system = coarse()
    settings = Settings(initial="steady-sliding", record_every=20, watch=("beam1.tip",))
    members = [Member(0.05, 1.0, 1.0, 1e-4), Member(0.3, 2.0, 1.5, 1e-3), Member(0.3, 1.0, 1.0, 1e-3)]
    phases = [PhaseSpec("slide", 2e-4, {}, {})]  # longer, and impacts let rounding grow
    found = all_of(system, phases, settings, [[m] for m in members])
    for number, member in enumerate(members):
        assert_same(found[number, 0], alone(system, phases, settings, member))


# A mass on oblique springs that rubs on a belt; friction that depends on speed, whatever its law.
RUBBING = """
units = "nondimensional"
bodies.belt = {type = "obstacle", shape = "flat", point = [0, 0], normal = [0, 1], sliding = {velocity = [0.4, 0]}}
bodies.m = {type = "mass", mass = 1.0, position = [0, 0]}
springs.a = {between = ["m", "ground"], direction = [1, 0.6], stiffness = 1.3, damping = 0.3}
springs.b = {between = ["m", "ground"], direction = [-0.7, 1], stiffness = 1.0, damping = 0.3}
loads.p = {at = "m", force = [0, -1]}
contacts.c = {slave = "m", master = "belt", stiffness = 2.0, friction = {LAW}}
phases = [{name = "slide", duration = 1.0}]
modal = {friction_range = [0, 1.5], max_frequency_hz = 1.0}
temporal = {initial = "steady-sliding", watch = ["m"], step = 0.01, record_every = 1}
"""


@pytest.mark.parametrize("stepper", ["explicit", "implicit"])
def test_separate_runs_start_from_their_own_steady_sliding_at_every_speed(stepper):
    law = 'law = "weakening", coefficient = 0.4, static_coefficient = 0.6, decay_speed = 0.5'
    case = st.loads(RUBBING.replace("LAW", law)).with_({"temporal.stepper": stepper})
    found = st.ensemble(case, mu=0.4, speed=[0.5, 1.0, 2.0], window=1.0, records=True, separately=True)
    stiffness = sum(k * np.outer(d, d) / (d @ d) for k, d in ((1.3, np.array([1, 0.6])), (1.0, np.array([-0.7, 1]))))
    for factor, run in zip(found.speed, found.runs, strict=True):
        assert run is not None
        scale = 0.4 / (0.4 + 0.2 * np.exp(-0.4 / 0.5))  # μ is asked for at the belt's own speed
        mu = scale * (0.4 + 0.2 * np.exp(-0.4 * factor / 0.5))
        u = np.linalg.solve(stiffness + 2.0 * np.outer([mu, 1.0], [0.0, 1.0]), [0.0, -1.0])
        # The force of the contact over the whole run: steady sliding stays.
        np.testing.assert_allclose(run.normal_force, -2.0 * u[1], rtol=1e-9)
        np.testing.assert_allclose(np.abs(run.slip_speed), 0.4 * factor, rtol=1e-9)


@pytest.mark.parametrize("sweep", [None, "up"])
def test_separate_runs_keep_interferences_and_distances_of_supports(sweep):
    text = RUBBING.replace("LAW", 'law = "coulomb", coefficient = 0.4').replace("stiffness = 2.0", "STIFF", 1)
    text = text.replace("STIFF", "stiffness = 2.0, interference = 0.01")
    text += """
[bodies.w]
type = "mass"
mass = 1.0
position = [-1.0, 0.0]
[springs.w]
between = ["m", "w"]
direction = [0.0, 1.0]
stiffness = 0.5
[supports.w]
at = "w"
fixed = ["x", "y"]
displacement = {y = -0.02}
"""
    case = st.loads(text).with_({"temporal.stepper": "explicit", "phases.slide.duration": 2.0})
    found = st.ensemble(case, mu=[0.2, 0.3], speed=2.0, window=0.5, records=True, separately=True, sweep=sweep)
    assert found.error == ("", "")
    alone = st.simulate(case.with_({"phases.slide.velocities.belt": 2.0}), mu=0.2)
    assert found.runs[0] is not None
    assert found.runs[1] is not None
    np.testing.assert_allclose(found.runs[0].normal_force, alone.normal_force, rtol=1e-9)
    if sweep:
        # What is pressed in stays so from one member to the next.
        assert found.runs[1].normal_force[0] == pytest.approx(found.runs[0].normal_force[-1], rel=1e-3)
    else:
        steady = steady_sliding(build_system(case), mu=0.3)
        np.testing.assert_allclose(found.runs[1].normal_force[:, 0], steady.normal_force[0], rtol=1e-9)


def test_several_contacts_of_one_body_are_solved_together_as_in_a_single_run():
    # Six rows act on the base: more than one pass over its modes takes.
    slaves = [Slave(place=place, stiffness="rigid", elements=4) for place in (0.35, 0.6, 0.8)]
    system = bench(*slaves, elements=10)
    settings = Settings(record_every=10, watch=("base.end", "s1.start"))
    phases = [PhaseSpec("press", 1e-4, {}, {"clamp": 0.0}), PhaseSpec("slide", 2e-4, {}, {"clamp": 1.0}, 1e-4)]
    members = [Member(0.05), Member(0.3, 0.5, 4.0)]
    found = all_of(system, phases, settings, [[m] for m in members])
    for number, member in enumerate(members):
        assert_same(found[number, 0], alone(system, phases, settings, member), close=1e-9)


def test_a_member_is_the_same_to_the_last_bit_whoever_is_beside_it():
    system, settings = coarse(), Settings(record_every=20, watch=("beam1.tip",))
    members = [Member(mu, load) for mu in np.linspace(0.0, 0.5, 9) for load in (1.0, 0.3)]  # more than one block
    together = all_of(system, PHASES, settings, [[m] for m in members], cores=1)
    for cores in (2, 3):
        spread = all_of(system, PHASES, settings, [[m] for m in members], cores=cores)
        for k in range(len(members)):
            assert together[k, 0].velocity.tobytes() == spread[k, 0].velocity.tobytes()
            assert together[k, 0].normal_force.tobytes() == spread[k, 0].normal_force.tobytes()
    single = all_of(system, PHASES, settings, [[members[11]]])[0, 0]
    assert single.acceleration.tobytes() == together[11, 0].acceleration.tobytes()


def test_it_does_not_matter_in_which_chunks_members_march(monkeypatch):
    system, settings = coarse(), Settings(record_every=7, watch=("beam1.tip",))
    tracks = [[Member(0.1), Member(0.3)], [Member(0.2), Member(0.4, 0.5)]]
    whole = all_of(system, PHASES, settings, tracks)
    monkeypatch.setattr(batch, "CHUNK", 101)
    cut = all_of(system, PHASES, settings, tracks)
    for key, run in whole.items():
        assert run.velocity.tobytes() == cut[key].velocity.tobytes()
        assert run.phases == cut[key].phases


@pytest.mark.parametrize(
    "track",
    [
        (Member(0.05), Member(0.2), Member(0.4)), (Member(0.2, 1.0, 1.0), Member(0.2, 1.0, 3.0)),
        (Member(0.2, 1.0), Member(0.2, 0.4)),
    ],
    ids=["mu", "speed", "load"],
)  # fmt: skip
def test_members_one_after_the_other_are_restarts(track):
    system, settings = coarse(), Settings(record_every=20, watch=("beam1.tip",))
    ours = all_of(system, PHASES, settings, [track, track[::-1]])
    theirs = all_of(system, PHASES, settings, [track, track[::-1]], separately=True)
    for key, run in theirs.items():
        # How far impacts have let rounding grow by the last leg.
        assert_same(ours[key], run, close=1e-9 * 10 ** key[1])
        assert [p.name for p in ours[key].phases] == [p.name for p in run.phases]


def test_systems_made_by_hand_march_side_by_side_too():
    system = block_on_belt(speed=1.0, law=Weakening(0.2, 0.4, 0.5), damping=0.01, stiffness=100.0)
    settings = Settings(record_every=5, watch=("block",), step=1e-3)
    phases = [PhaseSpec("slide", 20.0, {}, {})]
    members = [Member(None, 1.0, speed) for speed in (0.1, 0.5, 2.0)]
    found = all_of(system, phases, settings, [[m] for m in members])
    for number, member in enumerate(members):
        theirs = alone(system, phases, settings, member)
        assert found[number, 0].displacement == pytest.approx(theirs.displacement, abs=1e-9)
        assert found[number, 0].phases[-1].contacts["A"].stick_fraction == pytest.approx(
            theirs.phases[-1].contacts["A"].stick_fraction, abs=0.2
        )


def test_a_member_that_fails_leaves_the_others_alone():
    system, settings = coarse(), Settings(record_every=20, watch=("beam1.tip",))
    members = [Member(0.1), Member(0.1, 1e308), Member(0.2)]
    found = all_of(system, PHASES, settings, [[m, m] for m in members])
    good = all_of(system, PHASES, settings, [[m, m] for m in (members[0], members[2])])
    assert "no longer finite" in found[1, 0]
    assert found[1, 1].startswith("not reached: the motion is no longer finite")
    for ours, theirs in ((0, 0), (2, 1)):
        for leg in (0, 1):
            assert found[ours, leg].velocity.tobytes() == good[theirs, leg].velocity.tobytes()


def test_a_member_that_cannot_begin_says_why(monkeypatch):
    def steady(system, **options):
        if system.contacts[0].law.coefficient > 0.5:
            raise AnalysisError("no equilibrium")
        return steady_sliding(system, **options)

    monkeypatch.setattr(starting, "steady_sliding", steady)
    case = paper_case().with_(COARSE).with_({"temporal.initial": "steady-sliding", "phases.slide.duration": 2e-3})
    found = st.ensemble(case.with_({"phases.press.velocities": {"clamp": 1.0}}), mu=[0.1, 0.9], modes=False)
    assert found.error == ("", "no equilibrium")
    assert found.regime[1] == "failed"
    assert np.isfinite(found.rms[0])
    assert np.isnan(found.rms[1])


@pytest.mark.parametrize("settings", [{"stepper": "exact"}, {"stepper": "implicit", "max_frequency_hz": 2e4}, {"path": "nodal"}])
def test_what_the_case_asks_for_is_named_as_the_reason_for_separate_runs(settings: dict[str, Any]):
    system = coarse()
    key, value = next(iter(settings.items()))
    assert ensembles._shared(system, Settings(**settings), PHASES) == (None, f'temporal.{key} is "{value}"')


def test_contacts_that_slide_far_take_separate_runs_and_a_note_says_so():
    case = paper_case().with_(COARSE).with_({"contacts.A.sliding": "finite", "phases.press.duration": 2e-4})
    case = case.with_({"phases.slide.duration": 3e-3})
    found = st.ensemble(case, mu=[0.05, 0.3], modes=False)
    assert found.method == "separate runs"
    assert found.notes == (
        'separate runs, not side by side: sliding = "finite" at A',
        "the line of 2 members does not dominate, and no mode is named for it: what swings or drifts below 2001.1 Hz is "
        "stronger, and the window is too short to tell its frequency: give the phase a longer duration to see it",
    )
    run = st.simulate(case, 0.3)
    half = len(run.velocity[run.phase_slice()]) // 2
    tail = run.velocity[run.phase_slice(), 0][half:]
    assert found.rms[1] == pytest.approx(np.sqrt(tail.var(axis=0).sum()), rel=1e-3)


def test_numbers_are_those_of_the_summary_of_a_run():
    # Long enough for three periods of what dominates, 102 Hz, in the half that is looked at.
    case = paper_case().with_(COARSE).with_({"phases.press.duration": 2e-3, "phases.slide.duration": 72e-3})
    found = st.ensemble(case, mu=[0.02, 0.3], records=True)
    run = st.simulate(case, 0.02)
    assert found.frequency_hz[0] == pytest.approx(st.modes(case, 0.02).frequency_hz[0, 0], rel=0.01)
    # The second half of an odd number of records is one record more or less.
    assert found.frequency_hz[0] == pytest.approx(st.summarise(case, run).dominant_frequency_hz, rel=1e-3)
    kept = found.runs[0]
    assert kept.time.tolist() == run.time[run.phase_slice()].tolist()
    assert kept.watch_names == run.watch_names
    assert kept.velocity == pytest.approx(run.velocity[run.phase_slice()], abs=1e-8)
    assert st.ensemble(case, mu=[0.02], modes=False).runs == ()


def test_ctrl_c_keeps_what_is_finished(monkeypatch):
    case = paper_case().with_(COARSE).with_({"phases.press.duration": 2e-4, "phases.slide.duration": 3e-3})
    monkeypatch.setattr(ensembles, "TOLD_SECONDS", 0.001)
    monkeypatch.setattr(batch, "CHUNK", 50)
    monkeypatch.setattr(ensembles, "LANES", 2)
    whole = st.ensemble(case, mu=[0.1, 0.1, 0.2, 0.2, 0.3, 0.3], grid=False, modes=False, cores=1)

    def stop(done: int, planned: int) -> None:
        if done > 0.5 * planned:
            raise KeyboardInterrupt

    found = st.ensemble(case, mu=[0.1, 0.1, 0.2, 0.2, 0.3, 0.3], grid=False, modes=False, cores=1, progress=stop)
    assert found.interrupted
    assert found.regime[-1] == "interrupted"
    finished = [k for k, regime in enumerate(found.regime) if regime != "interrupted"]
    assert 2 <= len(finished) <= 4
    assert found.rms[finished].tolist() == whole.rms[finished].tolist()


def test_progress_counts_the_steps_of_all_members():
    seen: list[tuple[int, int]] = []
    found = st.ensemble(
        paper_case().with_(COARSE).with_({"phases.press.duration": 2e-4, "phases.slide.duration": 3e-3}),
        mu=[0.1, 0.3], speed=[1.0, 2.0], modes=False, progress=lambda done, planned: seen.append((done, planned)),
    )  # fmt: skip
    assert seen[-1][0] == seen[-1][1] == 4 * round(3.2e-3 / found.step)
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)


def test_a_row_for_each_combination_in_the_order_of_the_axes():
    case = paper_case().with_(COARSE).with_({"phases.press.duration": 2e-4, "phases.slide.duration": 2e-3})
    found = st.ensemble(case, mu=[0.3, 0.1], speed=[1.0, 2.0], load=0.5, modes=False)
    assert found.shape == (1, 2, 1, 2, 1)
    assert found.mu.tolist() == [0.3, 0.3, 0.1, 0.1]
    assert found.speed.tolist() == [1.0, 2.0, 1.0, 2.0]
    assert found.slip_speed == pytest.approx([0.02, 0.04, 0.02, 0.04])
    data = found.to_xarray()
    for k in range(4):
        at = data.sel(mu=found.mu[k], speed=found.speed[k])
        assert float(at.rms.squeeze()) == found.rms[k]
        lone = st.ensemble(case, mu=found.mu[k], speed=found.speed[k], load=0.5, modes=False)
        assert lone.rms[0] == found.rms[k]
    listed = st.ensemble(case, mu=[0.3, 0.1], speed=[2.0, 1.0], load=0.5, grid=False, modes=False)
    assert listed.rms.tolist() == [found.rms[1], found.rms[2]]
    assert listed.to_xarray().sizes["member"] == 2


@pytest.mark.parametrize("along", ["mu", "speed"])
def test_a_sweep_goes_up_and_down_through_each_column(along):
    case = paper_case().with_(COARSE).with_({"phases.press.duration": 2e-4, "phases.slide.duration": 2e-3})
    other = "speed" if along == "mu" else "mu"
    given = {along: [0.3, 0.1], other: [0.5, 0.4]}
    found = st.ensemble(case, sweep="both", swept=along, modes=False, **given)
    data = found.to_xarray()
    assert data.sweep.values.tolist() == ["up", "down"]
    up, down = data.rms.sel(sweep="up").squeeze(), data.rms.sel(sweep="down").squeeze()
    starts = st.ensemble(case, modes=False, **(given | {along: 0.1}))
    # The first of each column starts from rest, and no other.
    assert up.sel({along: 0.1}).values.tolist() == starts.rms.tolist()
    assert np.all(up.sel({along: 0.3}) != st.ensemble(case, modes=False, **(given | {along: 0.3})).rms)
    assert np.all(up != down)
    upwards = st.ensemble(case, sweep="up", swept=along, modes=False, **given)
    assert upwards.rms.tolist() == found.rms[: len(upwards)].tolist()
    falling = st.ensemble(case, sweep="down", swept=along, modes=False, **given).to_xarray().rms.squeeze()
    starts = st.ensemble(case, modes=False, **(given | {along: 0.3}))
    assert falling.sel({along: 0.3}).values.tolist() == starts.rms.tolist()


def test_which_mode_responds_is_named_only_near_its_frequency():
    from stridor.study.ensemble_modes import UnstableModes

    growing = UnstableModes(np.array([8, 12]), np.array([8641.0, 16700.0]), np.array([300.0, 20.0]))
    number, frequency, deviation = growing.nearest(8700.0)
    assert (number, frequency) == (8, 8641.0)
    assert deviation == pytest.approx(59 / 8641)
    assert growing.nearest(16700.0 * 1.049)[0] == 12
    assert growing.nearest(16700.0 * 1.051)[0] == 0
    assert growing.nearest(1780.0)[:2] == (0, 8641.0)
    assert growing.nearest(np.nan)[0] == 0
    assert UnstableModes(np.array([], dtype=int), np.array([]), np.array([])).nearest(8700.0)[0] == 0


def test_the_modal_map_is_that_of_the_modes_at_each_friction_and_speed():
    law = {"law": "weakening", "coefficient": 0.1, "static_coefficient": 0.2, "decay_speed": 0.05}
    case = paper_case().with_(COARSE).with_({"contacts.A.friction": law, "phases.slide.duration": 2e-3})
    found = st.ensemble(case, mu=[0.05, 0.3], speed=[1.0, 4.0])
    fast = case.with_({"supports.clamp.velocity.x": 0.08})
    assert found.modal.unstable.shape == (2, 2)
    for i, mu in enumerate([0.05, 0.3]):
        scaled = Weakening(0.1, 0.2, 0.05).scaled(mu, 0.02)
        for j, modes in enumerate((st.modes(case, mu=mu), st.modes(fast, mu=scaled.sliding(0.08)))):
            growing = modes.unstable[0] & (modes.frequency_hz[0] > 0)
            assert found.modal.unstable[i, j] == growing.sum()
            if growing.any():
                assert found.modal.growth_rate[i, j] == pytest.approx(modes.growth_rate[0][growing].max())
    constant = st.ensemble(case.with_({"contacts.A.friction": {"law": "coulomb", "coefficient": 0.1}}), mu=[0.05, 0.3], speed=[1.0, 4.0])
    assert constant.modal.speed.tolist() == [1.0]


def test_members_under_other_loads_have_the_modes_of_their_own_load():
    law = 'law = "weakening", coefficient = 0.2, static_coefficient = 0.8, decay_speed = 0.5'
    changes = {"temporal.stepper": "explicit", "springs.a.damping": 0.1, "springs.b.damping": 0.1}
    changes |= {"temporal.perturbation": 1e-4, "phases.slide.duration": 100.0}  # nine periods in the window
    case = st.loads(RUBBING.replace("LAW", law)).with_(changes)
    found = st.ensemble(case, mu=0.4, load=[0.1, 1.0, 4.0], separately=True)
    counts = []
    for factor, mode_hz in zip([0.1, 1.0, 4.0], found.mode_hz, strict=True):
        own = st.modes(case.with_({"loads.p.force": [0.0, -factor]}), mu=0.4)
        growing = own.frequency_hz[0][own.unstable[0] & (own.frequency_hz[0] > 0)]
        counts.append(len(growing))
        if np.isfinite(mode_hz):
            assert np.abs(growing - mode_hz).min() <= 1e-9 * mode_hz
    assert counts[0] < counts[-1]  # N·dμ/dv makes more of them grow
    assert found.modal.load == 1.0
    assert found.modal.unstable.tolist() == [[counts[1]]]
    assert not np.isfinite(found.mode_hz[0])
    assert np.isfinite(found.mode_hz[1:]).all()
    assert any("modes depend on the loads" in note for note in found.notes)
