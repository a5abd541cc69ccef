"""What temporal.stepper = "auto" comes to where exact steps refuse the start or the phases, and in what goes on from it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import stridor as st
from marching import block_on_belt
from mode_coupling import mode_coupling
from stridor.laws import StaticKinetic
from stridor.study.without_effect import without_effect
from stridor.system import System
from stridor.temporal.schedule import PhaseSpec
from stridor.temporal.simulate import Settings, plan, simulate

pytestmark = pytest.mark.verification

AUTO = Settings(stepper="auto", step=1e-2, record_every=1, watch=("block",))


def block(gap: float = 0.0) -> System:
    system = block_on_belt(law=StaticKinetic(0.3, 0.4), speed=0.2)
    return replace(system, contacts=(replace(system.contacts[0], gap=gap),))


def phases(*lengths: float) -> list[PhaseSpec]:
    return [PhaseSpec(f"p{k}", length, {"press": 1.0}, {"belt": 1.0}) for k, length in enumerate(lengths)]


@pytest.mark.parametrize(
    ("gap", "lengths", "said"),
    [
        (-0.1, (1.0,), "a rigid contact starts with overlap"),
        (0.0, (1.0, 0.016), "phases are no multiples of the step 0.01 s: p1 of 0.016 s would take 0.02 s"),
        (0.0, (1.0, 0.02), ""),
    ],
)
def test_what_exact_steps_do_not_begin_is_left_to_explicit_ones(gap: float, lengths: tuple[float, ...], said: str):
    system = block(gap)
    result = simulate(system, phases(*lengths), AUTO)
    assert (result.path == "exact") == (not said)
    assert said in result.path_reason
    assert ("exact steps do not begin so" in result.path_reason) == bool(said)
    path, why, _ = plan(system, AUTO, phases(*lengths))
    assert path == result.path
    assert result.path_reason.startswith(why)


@pytest.mark.parametrize("gap", [-0.1, 0.0])
def test_what_goes_on_keeps_the_stepper_that_it_came_to(gap: float):
    system = block(gap)
    whole = simulate(system, phases(0.5, 0.5), AUTO)
    part = simulate(system, phases(0.5), AUTO)
    again = simulate(system, phases(0.5, 0.5), AUTO, restart=part)
    assert again.path == part.path == whole.path
    assert again.displacement == pytest.approx(whole.displacement, abs=1e-12)


def test_a_step_of_records_too_long_for_explicit_ones_is_refused_with_why_it_came_to_them():
    with pytest.raises(st.CaseError, match=r"explicit scheme is unstable .*comes to explicit steps: exact .* overlap"):
        simulate(block(-0.1), phases(5.0), replace(AUTO, step=5.0))
    assert simulate(block(), phases(10.0), replace(AUTO, step=5.0)).path == "exact"
    uneven = case(**{"temporal.step": 5.0, "phases": [{"name": "slide", "duration": 12.0}]})
    with pytest.raises(st.CaseError, match="comes to explicit steps: exact steps do not begin so: phases are no multiples"):
        st.describe(uneven)


def test_steps_beyond_all_number_are_told_in_a_few_digits():
    (line,) = [line for line in st.describe(case(**{"temporal.step": 1e-300})).lines if line.startswith("time step")]
    assert line.endswith("; 6e+301 steps")


def case(**changes: Any) -> st.Case:
    return mode_coupling(0.1, 0.1).with_({"temporal.stepper": "auto", "temporal.record_every": 1} | changes)


def test_records_further_apart_than_explicit_steps_may_be_are_checked_and_made_an_ensemble_of():
    rare = case(**{"temporal.step": 5.0, "phases": [{"name": "slide", "duration": 1000.0}]})
    assert "which is that of the records alone" in " ".join(st.describe(rare).lines)
    found = st.ensemble(rare, mu=[0.1, 0.2], modes=False)
    assert np.isfinite(found.to_dataframe()["rms"]).all()


def test_a_cutoff_that_the_phases_keep_from_acting_is_told():
    uneven = case(**{"temporal.cutoff_hz": 1e3, "temporal.step": 1e-2, "phases": [{"name": "slide", "duration": 0.015}]})
    lines = without_effect(uneven, "simulate")
    assert any("comes to explicit steps here (exact steps do not begin so: phases are no multiples" in line for line in lines)
    assert st.simulate(uneven).path != "exact"


@pytest.mark.parametrize("stepper", ["explicit", "exact", "implicit", "auto"])
def test_no_stepper_makes_a_phase_longer(stepper: Any):
    """A phase of 0.4 steps was lengthened to one by explicit ones."""
    settings = replace(AUTO, stepper=stepper)
    with pytest.raises(st.CaseError, match=r"temporal.step: 0.01 – .*p0 of 0.004 s would take 0.01 s; give another") as met:
        simulate(block(), phases(0.004, 1.0), settings)
    assert ("no longer than any phase" in str(met.value)) == (stepper in ("explicit", "auto"))
    assert simulate(block(), phases(0.01, 0.02), settings).steps == 3


def test_a_system_alone_is_not_run_longer_than_its_phase():
    """Its 0.01 s are less than one of its own steps; that is said, and a run of phases given takes their time."""
    slow = block()
    with pytest.raises(st.CaseError, match=r"a step no longer than any phase: run of 0.01 s would take 0.0786 s"):
        st.simulate(slow)
    result = st.simulate(st.Workspace(slow, phases=[{"name": "run", "duration": 0.786}]))
    assert result.phases[0].end == pytest.approx(0.786, rel=1e-3)
    phases = [{"name": "press", "duration": 0.01}, {"name": "run", "duration": 80.0}]
    brief = st.Workspace(slow, phases=phases, temporal={"record_every": 1})
    with pytest.raises(st.CaseError, match=r"no longer than any phase: press of 0.01 s"):
        st.ensemble(brief, mu=[0.1, 0.2])


def test_check_says_which_phases_a_run_refuses():
    case = mode_coupling(0.1, 0.1)
    assert not [line for line in st.describe(case).lines if "refuses these phases" in line]
    step = st.describe(case).data["step"]
    short = case.with_({"phases": [{"name": "brief", "duration": 0.3 * step}]})
    assert any("refuses these phases" in line and "brief of" in line for line in st.describe(short).lines)
