"""Study files that are wrong, and stores that are none: one message for each problem, before anything is computed."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

import stridor as st
from program import stridor
from stridor.case import template_text
from stridor.errors import CaseError
from stridor.io.claims import claimed
from stridor.studies.checks import negative_friction

pytestmark = pytest.mark.bad_input
FEW = ["bodies.beam1.elements=3", "bodies.beam2.elements=6", "modal.max_frequency_hz=3e3"]
GOOD = {"mu": {"range": (0.0, 0.3), "points": 3}}
NORMAL = {"distribution": "normal", "mean": 5.0, "deviation": 1.0}
RANDOM = {"method": "random", "samples": 10}
DENSITY = "materials.steel.density"


@pytest.fixture(scope="module")
def case() -> st.Case:
    return st.loads(template_text("two-beams"), FEW)


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({"parameters": {"mu": {"range": (0.3, 0.0), "points": 3}}}, "parameters.mu.range: [0.3, 0.0]"),
        ({"parameters": {"mu": {"range": (0.0, 0.3)}}}, "parameters.mu.points: missing"),
        ({"parameters": {"mu": {"values": (0.1, 0.1)}}}, "each value once"),
        ({"parameters": {"mu": {"points": 3}}}, "one of values"),
        ({"parameters": {"mu": {"rnage": (0.0, 0.3), "points": 3}}}, "rnage"),
        ({"parameters": {"materials.stel.density": {"values": (1.0,)}}}, "did you mean"),
        ({"parameters": {"bodies.beam1": {"values": (1.0,)}}}, "path of a number"),
        ({"parameters": {DENSITY: NORMAL}}, 'another method, such as "sobol"'),
        ({"parameters": {DENSITY: {"mean": 1.0}}, "sampling": RANDOM}, "goes with mean and deviation"),
        ({"parameters": {DENSITY: {"distribution": "normal", "mean": 1.0}}, "sampling": RANDOM}, "deviation: missing"),
        ({"parameters": {DENSITY: {**NORMAL, "low": 90.0}}, "sampling": RANDOM}, "leave something of the distribution"),
        ({"parameters": {DENSITY: {**NORMAL, "low": 6.0, "high": 5.0}}, "sampling": RANDOM}, "above low = 6"),
        ({"parameters": {DENSITY: {**NORMAL, "range": (1.0, 2.0)}}, "sampling": RANDOM}, "truncate by low and high"),
        ({"parameters": {DENSITY: NORMAL}, "sampling": {"method": "random"}}, "sampling.samples: missing"),
        ({"parameters": GOOD, "sampling": {"samples": 5}}, 'another method than "grid"'),
        ({"parameters": {"mu": {"range": (0.0, 0.3), "points": 9_999_999}, DENSITY: {"range": (1, 2), "points": 9}}}, "at most"),
        ({"parameters": GOOD, "compute": "onsets"}, "onsets are solved for mu"),
        ({"parameters": GOOD, "compute": "mode"}, "compute"),
        ({"parameters": {DENSITY: NORMAL}, "sampling": {"method": "saltelli", "samples": 100}}, "a power of two"),
        ({"parameters": {DENSITY: NORMAL}, "sampling": RANDOM, "goal": {"half_width": 2.0}}, "between 0 and 1"),
        (
            {"parameters": {DENSITY: NORMAL}, "sampling": {"method": "latin-hypercube", "samples": 9}, "goal": {"half_width": 0.1}},
            "to which samples can be added",
        ),
        (
            {"parameters": {DENSITY: NORMAL}, "sampling": RANDOM, "correlation": {"of": (DENSITY, "mu"), "matrix": ((1, 0), (0, 1))}},
            "parameters of the study",
        ),
        (
            {
                "parameters": {DENSITY: NORMAL, "mu": {**NORMAL, "mean": 0.3, "deviation": 0.1}}, "sampling": RANDOM,
                "correlation": {"of": (DENSITY, "mu"), "matrix": ((1.0, 1.0), (1.0, 1.0))},
            },
            "positive definite",
        ),
        ({"parameters": {}}, "at least one"),
    ],
)  # fmt: skip
def test_one_message_says_what_is_wrong(case: st.Case, tables: dict, words: str) -> None:
    with pytest.raises(CaseError) as told:
        st.Study(case=case, **tables)
    assert words in str(told.value)
    assert len(told.value.problems) == 1
    assert "pydantic" not in str(told.value)


@pytest.mark.parametrize(
    ("matrix", "said"),
    [
        (((1.0, 0.7), (0.6, 1.0)), "0.7 and 0.6' – must be symmetric: row 1, column 2 and row 2, column 1"),
        (((1.0, 0.7), (0.7, 0.9)), "0.9 – must be 1, as all of the diagonal: row 2, column 2 is of a number with itself"),
        (((1.0, 1.5), (1.5, 1.0)), "[[1.0, 1.5], [1.5, 1.0]] – must be positive definite; its least eigenvalue is -0.5:"),
    ],
)
def test_correlations_tell_what_is_wrong_with_them(case: st.Case, matrix: tuple, said: str) -> None:
    parameters = {DENSITY: NORMAL, "bodies.beam1.thickness": {**NORMAL, "low": 1.0}}
    with pytest.raises(CaseError) as told:
        st.Study(
            case=case, parameters=parameters, sampling=RANDOM,
            correlation={"of": tuple(parameters), "matrix": matrix},
        )  # fmt: skip
    assert str(told.value).startswith("correlation.matrix: ")
    assert said in str(told.value)


@pytest.mark.parametrize(
    ("path", "varied", "said"),
    [
        ("mu", {"range": (-0.3, 0.1)}, "parameters.mu.range: [-0.3, 0.1] – a friction coefficient is a finite number ≥ 0"),
        ("mu", {"values": (0.1, -0.1)}, "parameters.mu.values: [0.1, -0.1] – a friction"),
        ("mu", {**NORMAL, "low": -1.0}, "parameters.mu.low: -1.0 – a friction"),
        ("mu", {"distribution": "normal", "mean": 0.3, "deviation": 0.1}, "parameters.mu.low: missing – a friction"),
        ("contacts.A.friction.coefficient", {"distribution": "uniform", "range": (-0.1, 0.1)}, "[-0.1, 0.1] – a friction"),
    ],
)  # fmt: skip
def test_friction_that_may_be_negative_is_refused_before_any_row(
    tmp_path: Path, case: st.Case, path: str, varied: dict, said: str
) -> None:
    study = st.Study(case=case, parameters={path: varied}, sampling=RANDOM)
    with pytest.raises(CaseError) as told:
        st.run_study(study, tmp_path / "out", workers=1)
    assert said in str(told.value)
    assert not (tmp_path / "out" / "study.zarr").exists()


def test_what_keeps_a_model_away_is_said_of_the_parameter(tmp_path: Path, case: st.Case) -> None:
    path = "contacts.A.friction.coefficient"
    parameters = {"mu": {"range": (0.0, 0.3)}, path: {"range": (0.0, 0.3)}}
    study = st.Study(case=case, parameters=parameters, sampling=RANDOM, answers={"source": "reduced"})
    with pytest.raises(CaseError) as told:
        st.run_study(study, tmp_path / "out", workers=1)
    assert str(told.value).startswith(f"parameters.{path}: give a range of mu")


@pytest.mark.parametrize(
    "varied",
    [
        {"range": (0.0, 0.1)}, {"values": (0.0, 0.1)}, {**NORMAL, "low": 0.0}, {**NORMAL, "deviation": 0.1},
        {"distribution": "normal", "mean": 0.35, "deviation": 0.05}, {**NORMAL, "distribution": "log-normal"},
        {**NORMAL, "distribution": "log-normal", "low": -1.0},
    ],
)  # fmt: skip
def test_friction_that_is_nowhere_negative_is_taken(case: st.Case, varied: dict) -> None:
    assert not negative_friction(st.Study(case=case, parameters={"mu": varied}, sampling=RANDOM))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty"),
        ("case = ", "not valid TOML"),
        ("[bodies.a]\n", "is a case file, not a study"),
        ('case = "gone.toml"\nparameters.mu.values = [0.1]\n', "no such file"),
        ("parameters.mu.values = [0.1]\n", "case"),
    ],
)
def test_files_that_are_no_study(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    done = stridor("study", "study.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "study.out").exists()


def test_a_study_that_is_not_there(tmp_path: Path) -> None:
    done = stridor("study", "study.toml", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (2, "stridor: study.toml: no such file\n")


@pytest.mark.parametrize("part", ["0/3", "4/3", "3", "a/b", "1/1000000"])
def test_parts_that_are_none(tmp_path: Path, case: st.Case, part: str) -> None:
    (tmp_path / "study.toml").write_text("", encoding="utf-8")
    done = stridor("study", "study.toml", "--part", part, cwd=tmp_path)
    assert done.returncode == 2
    assert ", such as 3/40" in done.stderr
    assert "K/N" in done.stderr


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory, case: st.Case) -> Path:
    folder = tmp_path_factory.mktemp("finished")
    st.run_study(st.Study(case=case, parameters=GOOD), folder, workers=1)
    return folder


@pytest.fixture
def store(finished: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished, tmp_path / "there"))


def test_a_store_of_another_study(store: Path, case: st.Case) -> None:
    other = st.Study(case=case, parameters={"mu": {"range": (0.0, 0.3), "points": 4}})
    with pytest.raises(CaseError, match=r"is of another study: parameters differs"):
        st.run_study(other, store)
    with pytest.raises(CaseError, match=r"is of another study: case differs"):
        st.run_study(st.Study(case=case.with_({"materials.steel.density": 7000.0}), parameters=GOOD), store)


def _changed(store: Path, **attributes: object) -> None:
    head = store / "study.zarr" / "zarr.json"
    data = json.loads(head.read_text(encoding="utf-8"))
    data["attributes"].update(attributes)
    head.write_text(json.dumps(data), encoding="utf-8")


def test_a_store_of_a_newer_version(store: Path, case: st.Case) -> None:
    _changed(store, format=99)
    with pytest.raises(CaseError, match="was written by a newer stridor"):
        st.open_study(store)


def test_a_store_that_another_version_has_begun(store: Path, case: st.Case) -> None:
    made = json.loads(json.loads((store / "study.zarr" / "zarr.json").read_text())["attributes"]["provenance"])
    _changed(store, provenance=json.dumps(made | {"programs": ["0.0.9 abc"]}))
    study = st.Study(case=case, parameters=GOOD)
    with pytest.raises(CaseError, match=r"was begun by another stridor \(0\.0\.9 abc; this is .*--go-on"):
        st.run_study(study, store)
    assert st.run_study(study, store, go_on=True).done.all()


def test_a_damaged_chunk_is_named(store: Path) -> None:
    chunk = next(path for path in (store / "study.zarr" / "growth_rate" / "c").rglob("*") if path.is_file())
    content = bytearray(chunk.read_bytes())
    content[len(content) // 2] ^= 0xFF
    chunk.write_bytes(bytes(content))
    with pytest.raises(CaseError, match="a chunk of growth_rate is damaged"):
        st.open_study(store)


def test_a_folder_without_a_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(CaseError, match=r"^\.: not the store of a study: give study.zarr, or the folder that it is in$"):
        st.open_study(".")


@pytest.mark.parametrize("content", ["", "{", '{"zarr_format": 3, "node_type": "group", "attributes": {}}'])
def test_folders_that_are_no_store(tmp_path: Path, content: str) -> None:
    (tmp_path / "study.zarr").mkdir()
    (tmp_path / "study.zarr" / "zarr.json").write_text(content, encoding="utf-8")
    with pytest.raises(CaseError, match="not the store of a study"):
        st.open_study(tmp_path)
    with pytest.raises(CaseError, match="no such store"):
        st.open_study(tmp_path / "nothing")


def test_two_processes_on_one_store_refuse_each_other(store: Path, case: st.Case) -> None:
    import subprocess
    import sys

    hold = f"from stridor.io.claims import claimed\nfrom pathlib import Path\nwith claimed(Path({str(store)!r})):\n    print('held', flush=True)\n    input()\n"
    with subprocess.Popen([sys.executable, "-c", hold], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        with pytest.raises(CaseError, match=rf"process {other.pid} on .* has been writing there since"):
            st.run_study(st.Study(case=case, parameters=GOOD), store)
        other.communicate("\n")
    with claimed(store):
        pass


def test_a_scheduler_that_does_not_answer(case: st.Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cluster = pytest.importorskip("stridor.studies.cluster")
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    monkeypatch.setattr(cluster, "PATIENCE", 0.5)
    with pytest.raises(st.AnalysisError, match=r"tcp://127\.0\.0\.1:9 does not answer within 0\.5 s"):
        st.run_study(st.Study(case=case, parameters=GOOD), tmp_path, scheduler="tcp://127.0.0.1:9")


def test_names_of_the_parameters_of_the_case_stand_for_their_values(case: st.Case) -> None:
    named = case.with_({"parameters": {"a": {"value": 1.0}, "mu2": {"value": 2.0}}})
    study = st.Study(
        case=named, sampling=RANDOM, parameters={"mu2": NORMAL, "mu": {**NORMAL, "low": 0.0}, "a": NORMAL},
        correlation={"of": ("a", "mu"), "matrix": ((1.0, 0.2), (0.2, 1.0))},
    )  # fmt: skip
    assert list(study.parameters) == ["parameters.mu2.value", "mu", "parameters.a.value"]
    assert study.correlation is not None
    assert study.correlation.of == ("parameters.a.value", "mu")
    assert st.Study.from_document(study.document()).parameters == study.parameters
    path = "parameters.a.value"
    with pytest.raises(CaseError, match=r"^parameters\.a: is parameters\.a\.value, which is given too; give it once$"):
        st.Study(case=named, sampling=RANDOM, parameters={"a": NORMAL, path: NORMAL})
    with pytest.raises(CaseError, match=r"^b: no such number|^parameters: b: no such number"):
        st.Study(case=named, sampling=RANDOM, parameters={"b": NORMAL})
    assert st.sensitivities(named, ["a"]).parameters == (path,)


def test_a_parameter_that_is_set_but_is_none_of_the_study_is_refused_with_those_of_the_study() -> None:
    text = 'case = "case.toml"\nparameters.k1.values = [1.0, 2.0]\nparameters.mu.values = [0.1]\n'
    with pytest.raises(CaseError, match=r"^parameters\.zeta: no such parameter; the study has: k1, mu$"):
        st.Study.loads(text, ["parameters.zeta.range=[0,1]"])
