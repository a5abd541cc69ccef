"""Parts of a run: those asked for, those taken from an earlier call on the same case, and never any of another."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Generator
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import stridor as st
from program import stridor
from rubbing_block import rubbing_block
from stridor.errors import AnalysisError, CaseError
from stridor.io.finished import FinishedParts
from stridor.io.plain_values import of_plain, to_plain
from stridor.study import analyses, cycles, modal_parts
from stridor.study.case_key import case_key
from stridor.study.parts import OF_REPORT, chosen_parts
from undrawn import nothing_drawn

STIFFNESS = np.array([[2.0, 0.0], [0.0, 2.2]])
TEXT = """
parameters.mu = { value = 0.3 }
[modal]
max_frequency_hz = 2.0
sweep_points = 3
[[matrices]]
file = "M.npz"
role = "mass"
[[matrices]]
file = "C.npz"
role = "damping"
[[matrices]]
file = "K.npz"
role = "stiffness"
[[matrices]]
file = "F.npz"
role = "stiffness"
factor = "mu"
"""


def written(folder: Path, stiffness: np.ndarray = STIFFNESS, text: str = TEXT) -> Path:
    """Two masses that friction couples, as matrices of another program, which the time loop does not take."""
    skew = np.array([[0.0, 1.0], [-1.0, 0.0]])
    for name, matrix in {"M": np.eye(2), "C": 0.01 * np.eye(2), "K": stiffness, "F": skew}.items():
        sp.save_npz(folder / f"{name}.npz", sp.csr_array(matrix))
    (folder / "case.toml").write_text(text, encoding="utf-8")
    return folder / "case.toml"


def refuse(*args: Any, **kwargs: Any) -> Any:
    raise AssertionError("this was computed")


@pytest.fixture(scope="module", autouse=True)
def no_pictures() -> Generator[None]:
    with nothing_drawn():
        yield


@pytest.fixture
def nothing_computed(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Whoever computes a part of the modal approach fails."""
    made = pytest.MonkeyPatch()
    made.setattr(cycles, "onsets", refuse)  # and so it is imported before others are: it would keep what they are now
    for name in ("modes", "onsets", "body_modes", "simulate", "friction_curve"):
        made.setattr(analyses, name, refuse)
    for name in ("sensitivities", "rank_countermeasures"):
        made.setattr(modal_parts, name, refuse)
    yield made
    made.undo()


def page_of(outcome: Any) -> str:
    assert outcome.report is not None
    return outcome.report.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("only", "skip", "names", "inner"),
    [
        (None, None, {"modes", "onsets", "simulate", "compare", "report"}, {"growth", "run", "critical"}),
        (["modes,onsets"], None, {"modes", "onsets", "report"}, {"growth", "run", "critical"}),
        (["modes", "onsets"], ["report"], {"modes", "onsets"}, {"growth", "run", "critical"}),
        (None, ["simulate"], {"modes", "onsets", "compare", "report"}, {"growth", "run", "critical"}),
        (["growth"], None, {"compare", "report"}, {"growth"}),
        (["run"], None, {"compare", "simulate", "report"}, {"run"}),
        (["compare"], ["critical"], {"compare", "report"}, {"growth", "run"}),
        (None, ["growth", "run", "critical"], {"modes", "onsets", "simulate", "report"}, set()),
        (["sensitivities"], None, {"sensitivities", "report"}, {"growth", "run", "critical"}),
    ],
)
def test_parts_are_those_named(only: Any, skip: Any, names: set[str], inner: set[str]) -> None:
    found = chosen_parts(only, skip)
    assert found.names == names
    assert found.of_comparison == inner


def test_the_comparison_has_what_the_case_and_the_run_allow() -> None:
    assert chosen_parts().comparison(critical=False, run=True) == {"growth", "run"}
    assert chosen_parts(None, ["simulate"]).comparison(critical=True, run=False) == {"growth", "critical"}
    # Named, it is solved whatever the case says.
    assert chosen_parts(["critical"]).comparison(critical=False, run=False) == {"critical"}


@pytest.mark.bad_input
@pytest.mark.parametrize(
    ("only", "skip", "said"),
    [
        (["mode"], None, "only: 'mode' – modes, onsets, sensitivities, countermeasures, simulate, compare, report; of"),
        (["modes"], ["modes"], "skip: 'modes' – is among those to be computed alone, too"),
        (None, [*OF_REPORT, "simulate", "compare"], "leaves nothing to do"),
    ],
)
def test_parts_that_there_are_none_of_are_told(only: Any, skip: Any, said: str) -> None:
    with pytest.raises(CaseError, match=said.replace(".", r"\.")):
        chosen_parts(only, skip)


def same(one: Any, other: Any) -> bool:
    """Whether two results are the same to the last bit, NaN included."""
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()
    if hasattr(one, "__dataclass_fields__"):
        return type(one) is type(other) and all(same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(v, other[k]) for k, v in one.items())
    if isinstance(one, list | tuple):
        return type(one) is type(other) and len(one) == len(other) and all(map(same, one, other))
    return one == other or (one != one and other != other)


def test_results_come_back_as_they_were(tmp_path: Path) -> None:
    case = st.load(written(tmp_path))
    results = [
        st.modes(case, [0.0, 0.3]),
        st.modes(case, 0.3, vectors=True),
        st.onsets(case),
        dict(st.body_modes(st.loads(rubbing_block("max_frequency_hz = 30e3")))),
        st.sensitivities(case, ["mu", "bodies.matrices.terms.0.factor"]),
        st.rank_countermeasures(case, verify=1),
        (None, True, 1.5, float("nan"), 1 - 2j, np.array([], dtype=np.int64), "μ"),
    ]
    for result in results:
        assert same(of_plain(json.loads(json.dumps(to_plain(result)))), result), type(result)
    with pytest.raises(TypeError, match="no result"):
        to_plain(object())
    for wrong in ({"array": "", "type": "|O", "shape": [0]}, {"kind": "Path", "fields": {}}):
        with pytest.raises((ValueError, KeyError)):
            of_plain(wrong)


def test_a_page_of_matrices_that_no_time_loop_takes(tmp_path: Path, nothing_computed: Any) -> None:
    path = written(tmp_path)
    with pytest.raises(AssertionError, match="this was computed"):
        st.report(path)
    nothing_computed.undo()
    outcome = st.report(path)
    page = page_of(outcome)
    for part in ("table-mechanisms", "figure-root-locus", "table-sensitivities", "figure-countermeasures"):
        assert f'id="{part}"' in page, part
    assert "It may squeal at μ\u00a0=\u00a00.3" in page
    assert "simulation in time" not in page
    assert any(note.startswith("no shapes of matrices: ") for note in outcome.everything.notes)
    with pytest.raises(AnalysisError, match=r"run: .*stridor report"):
        st.run(st.load(path), tmp_path / "case.out")


def test_an_onset_that_was_sought_with_damping_alone_is_not_set_beside_itself(tmp_path: Path) -> None:
    """Of matrices nothing is sought without damping: the captions say nothing of what it would be."""
    path = written(tmp_path)
    page = page_of(st.report(path, mu=0.3, skip=["sensitivities", "countermeasures"])).replace("\u00a0", " ")
    assert "Growth begins at μ = 0.10" in page
    assert "without damping" not in page.partition('id="figure-damped-growth-pair"')[2].partition("</figcaption>")[0]
    said = " ".join(stridor("report", path.name, "--mu", "0.3", "--skip", "countermeasures", cwd=tmp_path).stdout.split())
    assert said.endswith("Next: stridor countermeasures case.toml --mu 0.3")
    said = " ".join(stridor("report", path.name, "--mu", "0.05", "--skip", "countermeasures", cwd=tmp_path).stdout.split())
    assert said.endswith("Next: stridor modes case.toml --mu 0.05")


@pytest.mark.parametrize(
    ("verb", "said"),
    [
        ("shapes", "bodies: no places of nodes, so there is nothing to draw; "),
        ("steady", "contacts: none, and no places of nodes, so there is no contact force to tell and nothing to draw; "),
    ],
)
def test_what_has_no_places_is_refused_before_anything_is_computed(
    tmp_path: Path, verb: str, said: str, nothing_computed: Any
) -> None:
    done = stridor(verb, written(tmp_path).name, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.replace("\n", " ").startswith(f"stridor: {said}")


def test_matrices_that_follow_friction_are_swept_once(tmp_path: Path) -> None:
    """Each friction coefficient costs a search in the full problem: no second sweep without damping, no zooms."""
    path, said = written(tmp_path, text=TEXT.replace("parameters.mu = { value = 0.3 }", "")), list[str]()
    st.report(path, mu=0.3, log=said.append, skip=["sensitivities", "countermeasures"])
    assert [line for line in said if line.startswith(("modes: ", "onsets: "))] == [
        "modes: of the bodies alone",
        "modes: in contact without friction",
        "modes: 3 friction coefficients from 0 to 1, damped",
        "onsets: damped",
        "modes: at μ = 0.3",
    ]


def test_a_second_call_computes_nothing_and_says_the_same(tmp_path: Path, nothing_computed: pytest.MonkeyPatch) -> None:
    path = written(tmp_path)
    nothing_computed.undo()
    first = st.report(path)
    for name in ("modes", "onsets", "body_modes"):
        nothing_computed.setattr(analyses, name, refuse)
    for name in ("sensitivities", "rank_countermeasures"):
        nothing_computed.setattr(modal_parts, name, refuse)
    said: list[str] = []
    again = st.report(path, log=said.append)
    assert set(again.everything.taken) == {"modes", "onsets", "sensitivities", "countermeasures"}
    assert "onsets: damped: taken from an earlier call on the same case" in said
    assert any(note.startswith("Taken from an earlier call on the same case") for note in again.everything.notes)
    for name in ("own", "sweep_damped", "onsets_damped", "sensitivities", "measures"):
        assert same(getattr(first.everything, name), getattr(again.everything, name)), name
    with pytest.raises(AssertionError, match="this was computed"):
        st.report(path, fresh=True)


def test_nothing_of_another_case_is_taken(tmp_path: Path) -> None:
    path = written(tmp_path)
    ask = {"only": ["modes", "onsets"], "skip": ["report"]}
    before = st.run(st.load(path), tmp_path / "out", **ask).everything
    assert st.run(st.load(path), tmp_path / "out", **ask).everything.taken == ("modes", "onsets")

    # Of a name of which only some parts are there, the document says which.
    (gone,) = (tmp_path / "out" / "parts").glob("modes-at-*")
    gone.unlink()
    document = st.run(st.load(path), tmp_path / "out", **ask).to_json()
    assert document["taken"] == ["modes", "onsets"]
    assert "at μ = 0.3" not in document["taken_parts"]["modes"]
    assert len(document["taken_parts"]["modes"]) == 3
    assert document["taken_parts"]["onsets"] == ["damped"]
    assert list(document["seconds"]) == ["check", "modes"]

    # Another number of the case.
    other = written(tmp_path, text=TEXT.replace("0.3", "0.31"))
    said: list[str] = []
    after = st.run(st.load(other), tmp_path / "out", **ask, log=said.append).everything
    assert "onsets: damped: what is there is of another case or version, or damaged; computed anew" in said
    assert after.taken == ()
    assert after.own.mu[0] == 0.31

    # The same case as before, and a number in one of its files.
    changed = STIFFNESS.copy()
    changed[1, 1] = 2.3
    again = st.run(st.load(written(tmp_path, changed)), tmp_path / "out", **ask).everything
    assert again.taken == ()
    assert again.onsets_damped.first.mu != pytest.approx(before.onsets_damped.first.mu, rel=1e-3)
    fresh = st.run(st.load(path), tmp_path / "elsewhere", **ask).everything
    assert again.onsets_damped.first.mu == fresh.onsets_damped.first.mu


def test_a_part_that_was_changed_moved_or_is_of_other_versions_is_not_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shelf = FinishedParts(tmp_path, "key")
    shelf.put("modes", (1.5, 2.5))
    path = tmp_path / "modes.jsonl"
    whole = path.read_bytes()
    assert shelf.get("modes") == (1.5, 2.5)
    (tmp_path / "onsets.jsonl").write_bytes(whole)
    assert shelf.get("onsets") is None
    for spoilt in (whole.replace(b"2.5", b"2.6"), whole[:-3], b"", b"[]\n", whole.replace(b"stridor part 1", b"x")):
        path.write_bytes(spoilt)
        assert shelf.get("modes") is None
    path.write_bytes(whole)
    assert FinishedParts(tmp_path, "another").get("modes") is None
    assert FinishedParts(tmp_path, "key", fresh=True).get("modes") is None
    monkeypatch.setattr("stridor.io.finished.versions", lambda: {"numpy": "another"})
    assert shelf.get("modes") is None
    assert set(shelf.stale) == {"modes", "onsets"}


def test_a_deck_that_is_included_counts_whatever_it_is_called(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    inner, outer = tmp_path / "sub" / "nodes.txt", tmp_path / "sub" / "more.inc"
    (tmp_path / "block.inp").write_text("*INCLUDE,\n INPUT=sub/more.inc\n", encoding="utf-8")
    outer.write_text("*NODE, INPUT=nodes.txt\n", encoding="utf-8")
    inner.write_text("1, 0.0, 0.0\n", encoding="utf-8")
    text = '[bodies.block]\ntype = "solid"\nmodel = "plane strain"\nfile = "block.inp"\nmaterial = "steel"\n'
    text += "materials.steel = { young_modulus = 2e11, density = 7800.0 }\n"
    text = "\n".join([text.splitlines()[-1], *text.splitlines()[:-1]])
    keys = [case_key(st.loads(text, folder=tmp_path))]
    inner.write_text("1, 0.0, 0.1\n", encoding="utf-8")
    keys.append(case_key(st.loads(text, folder=tmp_path)))
    outer.write_text("*NODE, INPUT=nodes.txt\n** changed\n", encoding="utf-8")
    keys.append(case_key(st.loads(text, folder=tmp_path)))
    assert len(set(keys)) == 3


def test_what_a_killed_run_has_finished_is_taken(tmp_path: Path) -> None:
    written(tmp_path)
    words = [sys.executable, "-m", "stridor", "report", "case.toml", "--quiet", "--skip", "countermeasures"]
    slow = {"STRIDOR_CACHE_DIR": str(tmp_path / "cache")}
    process = subprocess.Popen(words, cwd=tmp_path, env={**os.environ, **slow}, stdout=subprocess.DEVNULL)
    first = tmp_path / "case.out" / "parts" / "modes-damped.jsonl"
    until = time.monotonic() + 60
    while not first.exists() and time.monotonic() < until and process.poll() is None:
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    assert process.wait(timeout=60) == -signal.SIGKILL, "it was over before it could be killed"
    assert first.exists()
    assert not (tmp_path / "case.out" / "report.html").exists()
    done = stridor("report", "case.toml", "--json", "--skip", "countermeasures,report", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert "modes" in document["taken"]
    assert document["report"] is None
    fresh = stridor("report", "case.toml", "--json", "--skip", "countermeasures,report", "--fresh", cwd=tmp_path)
    again = json.loads(fresh.stdout)
    assert again["taken"] == []
    for name in ("modes", "onsets", "sensitivities"):
        assert again[name] == document[name], name


def test_a_run_of_modes_alone_marches_nothing_and_shows_what_is_there(
    tmp_path: Path, nothing_computed: pytest.MonkeyPatch
) -> None:
    nothing_computed.undo()
    text = rubbing_block(
        "friction_range = [0.0, 0.6]\nmax_frequency_hz = 15e3\nsweep_points = 3",
        more="""
[[phases]]
name = "slide"
duration = 1e-4
[temporal]
initial = "steady-sliding"
perturbation = 1e-3
[comparison]
critical = false
""",
    )
    case = st.loads(text).with_({"bodies.block.mesh.divisions": [2, 2], "bodies.slider.mesh.divisions": [6, 1]})
    nothing_computed.setattr(analyses, "simulate", refuse)
    alone = st.run(case, tmp_path, only=["modes", "onsets"], skip=["report"])
    assert alone.report is None
    assert alone.everything.run is alone.everything.agreement is None
    assert not (tmp_path / "simulate.nc").exists()
    with pytest.raises(AssertionError, match="this was computed"):
        st.run(case, tmp_path, only=["simulate"], skip=["report"])
    nothing_computed.undo()
    grown = st.run(case, tmp_path, only=["growth"], skip=["report"])
    assert grown.everything.run is None
    assert grown.everything.agreement.comparisons[0].dominant_frequency_hz is None
    assert grown.everything.taken == ("modes", "onsets")
    st.run(case, tmp_path, only=["simulate", "compare"], skip=["report"])
    for name in ("simulate", "modes", "onsets"):
        nothing_computed.setattr(analyses, name, refuse)
    shown = st.report(case, tmp_path, skip=["sensitivities", "countermeasures"])
    assert shown.everything.run is not None
    assert shown.everything.agreement is not None
    assert 'id="figure-pressure-face"' in page_of(shown)
    nothing_computed.undo()
    nothing_computed.setattr(analyses, "simulate", refuse)
    with pytest.raises(AssertionError, match="this was computed"):
        st.run(case.with_({"contacts.face.friction.coefficient": 0.41}), tmp_path)


@pytest.mark.bad_input
def test_the_program_names_parts_that_are_none(tmp_path: Path) -> None:
    written(tmp_path)
    done = stridor("run", "case.toml", "--only", "modes,onset", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("stridor: --only: 'onset' – modes, onsets, ")
    assert len(done.stderr.splitlines()) == 1
