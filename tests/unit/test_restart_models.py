"""Going on from a run of another model: noticed, told, refused; or, where it is meant, recorded in the result."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import stridor as st
from marching import in_chunks
from rubbing_block import rubbing_block
from stridor.app.cli import app
from stridor.case import template_text
from stridor.errors import CaseError
from stridor.io.result_files import open_results
from stridor.temporal.changes import changes_of
from stridor.temporal.trajectory import Trajectory
from stridor.view.words import _run_sentence

COARSE = [
    "bodies.beam1.elements=6",
    "bodies.beam2.elements=18",
    "temporal.step=4e-7",
    "temporal.record_every=5",
    "phases.press.duration=0.0004",
    "phases.slide.duration=0.0006",
]
TIMES = (("press", 0.0004), ("slide", 0.0006))


def stop(done: int, planned: int) -> None:
    raise KeyboardInterrupt


@pytest.fixture(scope="module")
def case() -> st.Case:
    return st.loads(template_text("two-beams"), COARSE)


@pytest.fixture(scope="module")
def part(case: st.Case, tmp_path_factory: pytest.TempPathFactory) -> Trajectory:
    """Stopped in the second phase, and read from its file."""
    with pytest.MonkeyPatch.context() as patch:
        in_chunks(patch, 1200)

        def late(done: int, planned: int) -> None:
            if done > 1000:
                raise KeyboardInterrupt

        run = st.simulate(case, progress=late)
    assert 1000 < run.steps < run.planned_steps
    return st.open(st.save(run, tmp_path_factory.mktemp("part") / "simulate.nc"))


OTHERS = {
    "contacts.A.friction.coefficient": 0.4,
    "contacts.A.stiffness": 2e10,
    "contacts.A.side": "left",
    "supports.clamp.velocity.x": 0.05,
    "loads.press.force": [0.0, -21.0],
    "bodies.beam2.angle_deg": 1.0,
    "bodies.beam2.thickness": 0.0031,
    "bodies.beam1.damping.mass": 51.0,
    "materials.steel.young_modulus": 2.1e11,
    "phases.0.ramp": 1e-4,
    "phases.0.duration": 0.0003,
    "phases.1.loads": {"press": 2.0},
    "phases.1.velocities": {"clamp": 0.5},
    "phases.1.name": "glide",
    "temporal.beta2": 0.6,
    "temporal.step": 3.9e-7,
    "temporal.path": "nodal",
    "temporal.initial": "steady-sliding",
}


@pytest.mark.parametrize("path", OTHERS)
def test_another_model_is_refused_with_what_differs(case: st.Case, part: Trajectory, path: str) -> None:
    other = case.with_({path: OTHERS[path]})
    with pytest.raises(CaseError) as refused:
        st.simulate(other, restart=part)
    message = str(refused.value)
    assert path in message
    assert "--changed" in message
    was = part.provenance["fingerprint"]["values"].get(path)
    assert was is None or f"was {json.dumps(was) if not isinstance(was, str) else repr(was)}" in message.replace("'", "'")


def test_another_friction_coefficient_asked_for_is_refused(case: st.Case, part: Trajectory) -> None:
    with pytest.raises(CaseError, match=r"restart: mu: 0\.3 – was not given"):
        st.simulate(case, 0.3, restart=part)


def test_what_may_change(case: st.Case, part: Trajectory) -> None:
    """Words, what only the modal approach reads, and how long the phases last that are not over."""
    other = case.with_({"title": "again", "modal.modes": 3, "comparison.tolerance": 0.1, "phases.1.duration": 0.0005})
    on = st.simulate(other, restart=part)
    whole = st.simulate(other)
    assert np.array_equal(on.normal_force, whole.normal_force)
    assert on.phases == whole.phases
    assert changes_of(on) == []
    record = on.provenance["restarts"]
    assert [d["path"] for d in record[0]["settings"]] == ["phases.1.duration"]
    assert record[0]["step"] == part.steps


def test_a_phase_cannot_end_before_the_run_has_come_there(case: st.Case, part: Trajectory) -> None:
    for duration in (1e-5, part.steps * part.step - 0.0004):
        with pytest.raises(CaseError, match=r"phases\.1\.duration.*make it longer"):
            st.simulate(case.with_({"phases.1.duration": duration}), restart=part)


def test_other_records_give_the_new_part_alone(case: st.Case, part: Trajectory) -> None:
    on = st.simulate(case.with_({"temporal.record_every": 7, "temporal.watch": ["beam2.end"]}), restart=part)
    whole = st.simulate(case.with_({"temporal.record_every": 7, "temporal.watch": ["beam2.end"]}))
    assert on.watch_names == ("beam2.end",)
    assert np.array_equal(on.velocity, whole.velocity[-len(on.time) :])
    assert on.time[0] >= part.steps * part.step
    assert on.phases == whole.phases[1:]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"contacts.A.friction.coefficient": 0.4}, "contacts.A.friction.coefficient: 0.1 → 0.4"),
        pytest.param(
            {"supports.clamp.velocity.x": 0.04}, "supports.clamp.velocity.x: 0.02 → 0.04", marks=pytest.mark.slow
        ),
        pytest.param(
            {"loads.press.force": [0.0, -30.0]}, "loads.press.force: [0.0, -20.0] → [0.0, -30.0]", marks=pytest.mark.slow
        ),
        ({"phases.1.velocities": {"clamp": 0.5}}, "phases.1.velocities.clamp: 1.0 → 0.5"),
    ],
)
def test_changed_is_recorded_everywhere(case, part, change, words, tmp_path) -> None:
    other = case.with_(change)
    on = st.simulate(other, restart=part, changed=True)
    assert changes_of(on) == [f"at t = {part.steps * part.step:.6g} s {words}"]
    assert st.summarise(other, on).to_json()["changed"] == changes_of(on)
    data = open_results(st.save(on, tmp_path / "on.nc"))
    assert json.loads(data.attrs["changed"]) == changes_of(on)
    # Read again and gone on with, it is still told.
    again = st.open(tmp_path / "on.nc")
    assert changes_of(st.simulate(other, restart=again)) == changes_of(on)
    plain = st.simulate(case, restart=part)
    assert np.array_equal(on.normal_force[: len(part.time)], part.normal_force)
    assert not np.array_equal(on.displacement, plain.displacement)


def test_a_support_that_turns_faster_starts_from_where_it_is(case: st.Case, part: Trajectory) -> None:
    """Twice the speed at half the factor is the same motion: the way gone so far stays."""
    other = case.with_({"supports.clamp.velocity.x": 0.04, "phases.1.velocities": {"clamp": 0.5}})
    on, plain = st.simulate(other, restart=part, changed=True), st.simulate(case, restart=part)
    scale = np.abs(plain.displacement).max()
    assert np.allclose(on.displacement, plain.displacement, rtol=0, atol=1e-6 * scale)


def test_a_run_that_was_changed_says_so_in_its_report(case: st.Case, part: Trajectory) -> None:
    on = st.simulate(case.with_({"contacts.A.friction.coefficient": 0.4}), restart=part, changed=True)

    class Inputs:
        trajectory = on
        dominant_hz = None
        unsaturated = None

    assert "it is no run of one model" in _run_sentence(Inputs())  # type: ignore[arg-type]


def test_a_file_without_fingerprint_needs_the_word(case: st.Case, part: Trajectory) -> None:
    older = replace(part, provenance={k: v for k, v in part.provenance.items() if k != "fingerprint"})
    with pytest.raises(CaseError, match="written by an older stridor"):
        st.simulate(case, restart=older)
    on = st.simulate(case, restart=older, changed=True)
    assert changes_of(on) == [f"at t = {part.steps * part.step:.6g} s gone on from a file that does not tell its model"]


def test_changed_goes_with_restart(case: st.Case) -> None:
    with pytest.raises(CaseError, match="goes with restart"):
        st.simulate(case, changed=True)


NODES = [[-0.01, 0.0], [0.01, 0.0], [0.01, 0.02], [-0.01, 0.02]]


def mesh(path: Path, top: float) -> None:
    """One square in an Abaqus deck whose nodes are in a file of their own."""
    lines = [f"{k + 1}, {x}, {y if y == 0 else top}" for k, (x, y) in enumerate(NODES)]
    (path.parent / "nodes.inp").write_text("\n".join(lines) + "\n")
    path.write_text(
        "*NODE, INPUT=nodes.inp\n*ELEMENT, TYPE=CPE4, ELSET=all\n1, 1, 2, 3, 4\n"
        "*SURFACE, NAME=bottom\nall, S1\n*SURFACE, NAME=top\nall, S3\n"
    )


def test_a_file_that_changed_on_disk_is_noticed(tmp_path: Path) -> None:
    """The same case text, another mesh behind it, and that in a file that only the mesh file names."""
    mesh(tmp_path / "block.inp", 0.02)
    block = 'type = "solid"\nmodel = "plane strain"\nmaterial = "pad"\nfile = "block.inp"\nmass = "lumped"\n'
    slider = 'cells = "quad" }\ndamping'
    text = rubbing_block("max_frequency_hz = 1e4", block).replace(slider, 'cells = "quad" }\nmass = "lumped"\ndamping')
    text += '[temporal]\nrecord_every = 2\n[[phases]]\nname = "slide"\nduration = 2e-5\n'
    (tmp_path / "case.toml").write_text(text)
    case = st.load(tmp_path / "case.toml")
    run = st.simulate(case)
    assert st.simulate(case, restart=run).steps == run.steps
    mesh(tmp_path / "block.inp", 0.0201)
    with pytest.raises(CaseError, match=r"bodies\.block\.file \(contents of the file\)"):
        st.simulate(st.load(tmp_path / "case.toml"), restart=run)
    # In another folder it is the same run.
    mesh(tmp_path / "block.inp", 0.02)
    (tmp_path / "moved").mkdir()
    for name in ("case.toml", "block.inp", "nodes.inp"):
        (tmp_path / name).rename(tmp_path / "moved" / name)
    assert st.simulate(st.load(tmp_path / "moved" / "case.toml"), restart=run).steps == run.steps


def test_the_program(case: st.Case, part: Trajectory, tmp_path: Path) -> None:
    file, kept = tmp_path / "case.toml", tmp_path / "simulate.nc"
    file.write_text(case.text)
    st.save(part, kept)

    def call(*words: str):
        return CliRunner().invoke(app, ["simulate", str(file), "--quiet", "--json", "--out", str(tmp_path), *words])

    more = ("--restart", str(kept))
    for words, told in (
        ((*more, "--mu", "0.3"), "restart: mu"),
        ((*more, "--set", "loads.press.force=[0, -5]"), "restart: loads.press.force"),
        (("--changed",), "--changed: goes with --restart FILE"),
        ((*more, "--set", "temporal.record_every=9"), "cannot be joined to those in this file"),
    ):
        done = call(*words)
        assert isinstance(done.exception, CaseError), words
        assert told in str(done.exception)
    assert st.open(kept).steps == part.steps
    done = call(*more, "--mu", "0.3", "--changed")
    assert done.exit_code == 0, done.output
    assert "mu: not given → 0.3" in json.loads(done.stdout)["changed"][0]
