"""Runs that still grow are told from those that have settled, and nothing of them is called the response."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stridor as st
from rubbing_block import rubbing_block
from stridor.study.saturation import unsaturated
from stridor.view.words import verdict
from undrawn import nothing_drawn

TEXT = rubbing_block(
    "friction_range = [0.0, 0.6]\nmax_frequency_hz = 30e3\nsweep_points = 3",
    more="""
[[phases]]
name = "slide"
duration = 5e-4
[temporal]
initial = "steady-sliding"
perturbation = 1e-3
watch = ["block.crown"]
record_every = 2
[comparison]
critical = false
""",
)


@pytest.fixture(scope="module")
def case() -> st.Case:
    """As coarse as a block can be of which a mode grows."""
    return st.loads(TEXT).with_({"bodies.block.mesh.divisions": [2, 2], "bodies.slider.mesh.divisions": [6, 1]})


@pytest.fixture(scope="module")
def outcome(case: st.Case, tmp_path_factory: pytest.TempPathFactory):
    with nothing_drawn():
        return st.run(case, tmp_path_factory.mktemp("run"))


def test_a_run_that_still_grows_says_how_long_it_takes(case: st.Case, outcome) -> None:
    still, modes, run = outcome.everything.unsaturated, outcome.everything.own, outcome.everything.run
    assert still is not None
    fastest = int(np.argmax(np.where(modes.frequency_hz[0] > 0, modes.growth_rate[0], -np.inf)))
    assert still.growth_rate == modes.growth_rate[0, fastest] > 0
    assert still.duration == pytest.approx(5e-4 + 1.5 * still.seconds_left, rel=0.1)
    # Marched as long as that the nodes begin to stick or open, and not before.
    longer = case.with_({"phases.slide.duration": still.duration})
    gone_on = st.simulate(longer, restart=run)
    assert unsaturated(st.Workspace(longer), gone_on, modes) is None
    # The first node to change does so before nearly all have, and not at once.
    changed = np.any(gone_on.nodes.status != run.nodes.status[-1], axis=1)
    first = gone_on.nodes.time[np.argmax(changed)] - run.time[-1]
    assert 0.3 * still.seconds_left < first < 2.0 * still.seconds_left


def test_nothing_of_it_is_called_the_response(outcome) -> None:
    page = outcome.report.read_text(encoding="utf-8")
    frequency = outcome.everything.unsaturated.frequency_hz
    assert f"a vibration of {frequency:.0f}\u00a0Hz grows for longer than the run lasts." in page
    assert "stridor simulate CASE --restart CASE.out/simulate.nc" in page
    assert "It squeals" not in page
    assert "dominant frequency" not in page.split("<details>")[0]
    document = outcome.to_json()
    assert document["simulate"]["dominant_frequency_hz"] is None
    assert document["unsaturated"]["phase"] == "slide"
    comparison = outcome.everything.agreement.comparisons[0]
    assert comparison.dominant_frequency_hz is None
    assert comparison.agrees


def test_what_settles_or_does_not_grow_is_not_told_so(case: st.Case, outcome) -> None:
    run, modes = outcome.everything.run, outcome.everything.own
    work = st.Workspace(case)
    assert unsaturated(work, run, modes) is not None
    # One node of many that hardly presses says nothing.
    lightly = run.nodes.status.copy()
    assert run.nodes.normal_force[-1, -1] == 0.0
    lightly[-1, -1] = 2
    assert unsaturated(work, replace(run, nodes=replace(run.nodes, status=lightly)), modes) is not None
    changing = run.nodes.status.copy()
    changing[-1, 0] = 1 - changing[-1, 0]
    assert unsaturated(work, replace(run, nodes=replace(run.nodes, status=changing)), modes) is None
    decaying = replace(modes, eigenvalues=-np.abs(modes.eigenvalues.real) + 1j * modes.eigenvalues.imag)
    assert unsaturated(work, run, decaying) is None
    assert unsaturated(work, run, None) is None
    assert unsaturated(work, replace(run, interrupted=True), modes) is None


def test_a_settled_run_squeals_as_before(outcome) -> None:
    from stridor.app.pipeline import report_inputs

    inputs = report_inputs(replace(outcome.everything, unsaturated=None))
    assert verdict(inputs).headline.startswith("It squeals at μ = 0.4, at ")


