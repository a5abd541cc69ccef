"""Reduced models in files: the same to the last bit, whole or not at all, and one clear line for everything else."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
import pickle
import subprocess
import sys
import zipfile
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

import stridor as st
from program import stridor
from stridor.app.cli import main
from stridor.case import template_text
from stridor.io import reduced_models
from stridor.io.left_out import kept_in
from stridor.io.reduced_models import provenance_of
from stridor.io.seals import digest, text_digest
from stridor.modal.full import onsets_along
from stridor.modal.parametric import Parameter, ParametricProblem, Term, reduce, verified
from stridor.modal.parametric.factors import CONSTANT, Formula, Product

COARSE = {"bodies.beam1.elements": 6, "bodies.beam2.elements": 18}
BOX = {"mu": (0.0, 0.3), "contact_stiffness": (0.5, 2.0), "bodies.beam1.damping.mass": (20.0, 80.0)}
POINTS = ({"mu": 0.05}, {"mu": 0.21, "contact_stiffness": 1.7}, {"mu": 0.3, "bodies.beam1.damping.mass": 20.0})
MODES = ("values", "residual", "error", "passed", "right", "left")


@pytest.fixture(scope="module")
def case() -> st.Case:
    return st.loads(template_text("two-beams")).with_(COARSE)


@pytest.fixture(scope="module")
def model(case):
    return st.reduced_model(case, BOX, max_frequency_hz=20e3)


@pytest.fixture(scope="module")
def content(model, case, tmp_path_factory) -> bytes:
    return st.save(model, tmp_path_factory.mktemp("saved") / "model.npz", case=case).read_bytes()


def alike(one, other) -> None:
    for point in POINTS:
        for name in MODES:
            assert np.array_equal(getattr(one.modes(point), name), getattr(other.modes(point), name)), (point, name)


def rewritten(content: bytes, path: Path, change, *, seal: bool = False) -> Path:
    """The archive with ``change`` made to its members, name → bytes; with seal, hashes are made to fit the change."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    change(members)
    with contextlib.suppress(ValueError, KeyError, RecursionError):
        header = json.loads(members["header.json"])
        if seal and isinstance(header, dict) and header.pop("sha256", None):
            arrays = {n.removesuffix(".npy"): data for n, data in members.items() if n.endswith(".npy")}
            for name, data in arrays.items():
                with contextlib.suppress(ValueError):
                    header["contents"][name] = digest(np.lib.format.read_array(io.BytesIO(data)))
            members["header.json"] = json.dumps(header | {"sha256": text_digest(header)}).encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return path


def header_with(**changes):
    def change(members: dict[str, bytes]) -> None:
        header = json.loads(members["header.json"])
        header.update(changes)
        members["header.json"] = json.dumps(header).encode()

    return change


def array_with(name: str, array, **how):
    def change(members: dict[str, bytes]) -> None:
        stream = io.BytesIO()
        np.lib.format.write_array(stream, array, **how)
        members[f"{name}.npy"] = stream.getvalue()

    return change


# -- round trips ------------------------------------------------------------------------------------------------------
def test_a_model_comes_back_to_the_last_bit(model, case, tmp_path):
    path = st.save(model, tmp_path / "model.npz", case=case)
    back = st.open(path)
    alike(model, back)
    # Every field there is, those of problem and terms included: a new one must be saved too.
    for one in fields(model):
        mine, theirs = getattr(model, one.name), getattr(back, one.name)
        if isinstance(mine, np.ndarray):
            assert np.array_equal(mine, theirs), one.name
        elif one.name != "problem":
            assert mine == theirs, one.name
    assert type(back.problem) is type(model.problem)
    known = {"terms", "parameters", "elimination", "notes", "elsewhere", "touching"}
    asks = {"looked"}  # builds systems of the case, which a file has not: its model says that it does not know
    assert {f.name for f in fields(model.problem)} <= known | asks  # a new one must be saved, and looked at below
    outside = {"contact_stiffness": 3.0}
    assert model.problem.looked is not None
    assert back.problem.looked is None
    assert model.unlike([{}, outside]) == ("", "")
    assert back.unlike([{}, outside]) == ("", "outside the box, and the model does not know which nodes touch there")
    assert back.problem.parameters == model.problem.parameters
    for name in ("notes", "elsewhere"):
        assert getattr(back.problem, name, ()) == getattr(model.problem, name, ())
    assert np.array_equal(getattr(back.problem, "touching", None), getattr(model.problem, "touching", None))
    for mine, theirs in zip(model.problem.terms, back.problem.terms, strict=True):
        assert (mine.role, mine.factor, mine.symmetric) == (theirs.role, theirs.factor, theirs.symmetric)
        assert (mine.matrix != theirs.matrix).nnz == 0
    modes = back.modes(POINTS[1])
    assert np.array_equal(back.expand(modes, left=True), model.expand(modes, left=True))
    assert np.array_equal(verified(back, POINTS[1]).values, verified(model, POINTS[1]).values)
    assert onsets_along(back, "mu") == onsets_along(model, "mu")


def test_the_file_says_where_it_comes_from(model, case, tmp_path):
    found = provenance_of(st.save(model, tmp_path / "model.npz", case=case))
    assert found["title"] == case.title
    assert st.loads(found["case"]) == case
    assert len(found["case_sha256"]) == 64
    assert found["versions"]["stridor"]
    assert provenance_of(st.save(model, tmp_path / "plain.npz"))["case"] is None
    again = st.save(model, tmp_path / "again.npz", case=found)
    assert provenance_of(again) == found


def test_rigid_contact_comes_back(case, tmp_path):
    """Rigid contact is eliminated: what gives the system's freedoms back goes into the file, and what there is to say."""
    rigid = case.with_({"contacts.A.stiffness": "rigid"})
    made = st.reduced_model(rigid, {"mu": (0.0, 0.3)}, max_frequency_hz=20e3)
    made = replace(made, problem=replace(made.problem, notes=("two nodes would open",)))
    modes = made.modes([0.2])
    for keep in ("all", "shapes"):
        back = st.open(st.save(made, tmp_path / "model.npz", keep=keep))
        assert back.problem.notes == made.problem.notes
        for side in (False, True):
            one, other = (m.expand(m.modes([0.2]), left=side) for m in (made, back))
            if side:
                one, other = (m.problem.left_displacements(v, [0.2]) for m, v in ((made, one), (back, other)))
            else:
                one, other = (m.problem.displacements(v) for m, v in ((made, one), (back, other)))
            assert np.array_equal(one, other)
            assert len(one) == st.build_system(rigid).size == made.problem.size + 1
    back = st.open(st.save(made, tmp_path / "model.npz", keep="eigenvalues"))
    assert np.array_equal(back.modes([0.2]).values, modes.values)


def test_formulas_and_integers_come_back(tmp_path):
    """Terms as imported matrices have them: formulas of parameters, whole numbers, one pattern for several."""
    n = 30
    stiffness = sp.csr_array(sp.diags_array([-1, 2, -1], offsets=[-1, 0, 1], shape=(n, n), dtype=np.int64))
    turn = sp.csr_array(sp.diags_array([0.1, -0.1], offsets=[-1, 1], shape=(n, n)))
    terms = (
        Term(sp.csr_array(sp.eye_array(n)), "mass", CONSTANT, symmetric=True),
        Term(stiffness, "stiffness", Product((("k", 1.0),)), symmetric=True),
        Term(turn, "stiffness", Formula("a * k**2 + 0.3", ("k",), (("a", 0.2),))),
    )
    problem = ParametricProblem(terms, (Parameter("k", 1.0, 2.0, 1.5),))
    made = reduce(problem, 0.1)
    path = st.save(made, tmp_path / "model.npz")
    back = st.open(path)
    for k in (1.0, 1.31):
        assert np.array_equal(back.modes([k]).values, made.modes([k]).values)
        assert (back.problem.at([k]).stiffness != made.problem.at([k]).stiffness).nnz == 0


@pytest.mark.parametrize("keep", ["all", "eigenvalues"])
def test_states_of_overdamped_modes_come_back(tmp_path, keep):
    n = 60
    stiffness = sp.csr_array(sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n)))
    dampers = sp.csr_array(sp.diags_array(np.where(np.arange(n) % 9 == 4, 40.0, 0.0)))
    terms = (
        Term(sp.csr_array(sp.eye_array(n)), "mass", CONSTANT, symmetric=True),
        Term(stiffness, "stiffness", Product((("k", 1.0),)), symmetric=True),
        Term(dampers, "damping", CONSTANT, symmetric=True),
    )
    made = reduce(ParametricProblem(terms, (Parameter("k", 1.0, 2.0, 1.5),)), 0.1)
    assert made.states is not None
    back = st.open(st.save(made, tmp_path / "model.npz", keep=keep))
    assert np.array_equal(back.states.right, made.states.right)
    assert np.array_equal(back.modes([1.31]).values, made.modes([1.31]).values)


def test_patterns_in_common_are_written_once(model, content):
    damping = [t.matrix for t in model.problem.terms if t.role == "damping"]
    assert len(damping) > 1
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        names = archive.namelist()
    assert sum(name.endswith("_data.npy") for name in names) == len(model.problem.terms)
    assert sum(name.endswith("_indices.npy") for name in names) < len(model.problem.terms)


# -- smaller files ----------------------------------------------------------------------------------------------------
def test_what_is_left_out_is_said_when_it_is_missed(model, content, tmp_path):
    small, smallest = (
        st.open(st.save(model, tmp_path / f"{keep}.npz", keep=keep)) for keep in ("shapes", "eigenvalues")
    )
    sizes = [len(content), *((tmp_path / f"{keep}.npz").stat().st_size for keep in ("shapes", "eigenvalues"))]
    assert sizes == sorted(sizes, reverse=True)
    for found in (small, smallest):
        alike(model, found)
        assert found.problem.size == model.problem.size
        assert found.problem.damped
        loose = onsets_along(found, "mu", confirm=False)
        assert loose == onsets_along(model, "mu", confirm=False)
        modes = found.modes(POINTS[1])
        for call in (
            lambda found=found: verified(found, POINTS[1]),
            lambda found=found: onsets_along(found, "mu"),
            lambda found=found, modes=modes: found.backward_error(modes),
        ):
            with pytest.raises(st.AnalysisError, match=r"left out when this reduced model was saved; .* keep=\"all\""):
                call()
    modes = small.modes(POINTS[1])
    assert np.array_equal(small.expand(modes), model.expand(modes))
    with pytest.raises(st.AnalysisError, match="the full matrices were left out"):
        small.problem.at(POINTS[1])
    with pytest.raises(st.AnalysisError, match="its basis was left out"):
        smallest.expand(modes)
    assert [kept_in(m) for m in (model, small, smallest)] == ["all", "shapes", "eigenvalues"]
    with pytest.raises(st.CaseError, match=r"keep: 'all' – the model holds no more than 'eigenvalues' itself"):
        st.save(smallest, tmp_path / "more.npz")
    with pytest.raises(st.CaseError, match="keep: 'some' – one of all, shapes, eigenvalues"):
        st.save(model, tmp_path / "more.npz", keep="some")
    assert not (tmp_path / "more.npz").exists()
    alike(model, st.open(st.save(small, tmp_path / "less.npz", keep="eigenvalues")))


# -- what cannot be saved ---------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Own:
    """A factor of one's own that nothing can read again."""

    def __call__(self, values, /):
        return 1.0

    def slope(self, values, name):
        return 0.0

    def to_json(self):
        return {"kind": "own"}


def mine(values) -> float:
    return 1.0


@pytest.mark.parametrize(("factor", "name"), [(mine, "mine"), (lambda _: 1.0, "<lambda>"), (Own(), "Own")])
def test_functions_of_ones_own_are_refused(model, tmp_path, factor, name):
    terms = (*model.problem.terms[:-1], replace(model.problem.terms[-1], factor=factor))
    other = replace(model, problem=replace(model.problem, terms=terms))
    with pytest.raises(st.CaseError, match=rf"terms\[{len(terms) - 1}\]\.factor: .*{name}.*only factors that are data"):
        st.save(other, tmp_path / "model.npz")
    assert list(tmp_path.iterdir()) == []


def test_a_field_that_the_format_does_not_know_is_not_dropped(model, tmp_path):
    @dataclass(frozen=True)
    class Wider(type(model)):
        more: float = 0.0

    wider = Wider(**{f.name: getattr(model, f.name) for f in fields(model)})
    st.save(wider, tmp_path / "model.npz")
    with pytest.raises(st.CaseError, match=r"model\.more: files of format 2 cannot hold it"):
        st.save(replace(wider, more=1.0), tmp_path / "model.npz")


# -- files that are none ----------------------------------------------------------------------------------------------
def refused(path: Path, words: str) -> None:
    with pytest.raises(st.CaseError) as caught:
        st.open(path)
    message = str(caught.value)
    assert words in message
    assert message.startswith(f"file: {str(path)!r}"[:20])
    assert "\n" not in message


def test_foreign_files(tmp_path, content):
    path = tmp_path / "model.npz"
    refused(tmp_path / "missing.npz", "no such file")
    refused(tmp_path, "is a folder; must be a file")
    np.savez(path, a=np.zeros(3))
    refused(path, "no reduced model; give a file of st.save")
    for data in (b"", b"title = 'a case'\n", pickle.dumps({"a": 1}), b"PK\x03\x04" + bytes(300)):
        path.write_bytes(data)
        refused(path, "no reduced model")
    refused(rewritten(content, path, header_with(format="another program's")), "no reduced model")


def test_newer_files(tmp_path, content):
    header = {"version": 3, "provenance": {"versions": {"stridor": "9.1"}}, "terms": "of another kind"}
    path = rewritten(content, tmp_path / "model.npz", header_with(**header))
    refused(path, "written in format 3 by stridor 9.1; this one reads formats up to 2: bring stridor up to date")


def test_models_without_hashes(tmp_path, content):
    """Nothing tells whether they are what was written: they are not believed."""
    path = rewritten(content, tmp_path / "model.npz", header_with(version=1))
    refused(path, "written in format 1, without the hashes by which a changed model is told; make it again")


def test_a_changed_model_is_told_whatever_was_changed(tmp_path, content, model):
    """A zeroed sketch estimates errors of 0: every array and every number of the header counts."""
    path = tmp_path / "model.npz"
    n, r = model.vectors.shape
    s = model.right_sketch.shape[1]
    for name, shape in (("vectors", (n, r)), ("right_sketch", None), ("left_sketch", None), ("projected", None)):
        zeros = np.zeros(shape or getattr(model, name).shape)
        refused(rewritten(content, path, array_with(name, zeros)), f"({name} changed)")
    swapped = np.random.default_rng(1).permuted(model.right_sketch, axis=1)
    refused(rewritten(content, path, array_with("right_sketch", swapped)), "(right_sketch changed)")
    held = json.loads(zipfile.ZipFile(io.BytesIO(content)).read("header.json"))
    numbers = held["model"]
    for change in (
        {"model": numbers | {"constant": 2.0 * numbers["constant"]}},
        {"model": numbers | {"bound": 1e9}},
        {"model": numbers | {"solves": 0}},
        {"parameters": held["parameters"][::-1]},
        {"contents": {}},
        {"sketch": s + 1},
    ):
        refused(rewritten(content, path, header_with(**change)), "(its header changed)")
    not_finite = np.full((n, r), np.nan)
    refused(rewritten(content, path, array_with("vectors", not_finite), seal=True), "vectors holds values that are not")
    alike(model, st.open(rewritten(content, path, lambda members: None)))


class Bomb:
    """Would run something where it is unpickled."""

    def __reduce__(self):
        return (os.mkdir, ("it-ran",))


def test_damaged_files(tmp_path, content, model, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "model.npz"
    n, r = model.vectors.shape
    bad = json.loads(zipfile.ZipFile(io.BytesIO(content)).read("header.json"))
    first = bad["terms"][0]
    objects = np.empty((len(model.problem.terms), r, r), dtype=object)
    objects[...] = Bomb()
    indices = first["matrix"]["indices"]
    for change in (
        header_with(version=0),
        header_with(version="1"),
        header_with(keep="most"),
        header_with(freedoms=-3),
        header_with(freedoms=10**12),
        header_with(unknowns=r + 1),
        header_with(terms=[]),
        header_with(terms={"a": 1}),
        header_with(terms=[first]),
        header_with(parameters=[]),
        header_with(parameters=[{"name": "mu", "low": 1.0, "high": 0.0, "value": 2.0}]),
        header_with(model={}),
        header_with(model=bad["model"] | {"frequency": float("nan")}),
        header_with(model=bad["model"] | {"bound": -1.0}),
        header_with(terms=[first | {"role": "spin"}, *bad["terms"][1:]]),
        header_with(terms=[first | {"factor": {"kind": "call", "name": "os.mkdir"}}, *bad["terms"][1:]]),
        header_with(
            terms=[
                first | {"factor": {"kind": "formula", "text": "__import__('os')", "names": [], "fixed": []}},
                *bad["terms"][1:],
            ]
        ),
        header_with(terms=[first | {"matrix": first["matrix"] | {"data": "../vectors"}}, *bad["terms"][1:]]),
        header_with(contacts={"notes": [], "elimination": {"displacements": 3}}),
        array_with("vectors", np.zeros((n, r + 1))),
        array_with("vectors", np.zeros((n, r), dtype=complex)),
        array_with("projected", objects, allow_pickle=True),
        array_with(indices, np.full(first["matrix"]["nonzeros"], n + 5, dtype=np.int32)),
        array_with(indices, np.full(first["matrix"]["nonzeros"], -1, dtype=np.int32)),
        lambda members: members.pop("right_sketch.npy"),
        lambda members: members.update({"left_sketch.npy": members["left_sketch.npy"] + b"more"}),
        lambda members: members.update({"header.json": b"{"}),
        lambda members: members.update({"header.json": b"[" * 100_000}),
        lambda members: members.update({"header.json": b"\xff\xfe"}),
    ):
        for seal in (False, True):  # by its hash, and without
            refused(rewritten(content, path, change, seal=seal), "a reduced model, but cut short or damaged")
    assert [p.name for p in tmp_path.iterdir()] == ["model.npz"]


def test_a_file_that_does_not_say_where_it_comes_from(tmp_path, content):
    for origin in ({"title": None}, [], None):
        path = rewritten(content, tmp_path / "model.npz", header_with(provenance=origin), seal=True)
        with pytest.raises(st.CaseError, match="cut short or damaged"):
            provenance_of(path)


@pytest.mark.parametrize("share", [0.001, 0.01, 0.3, 0.9, 0.9999])
def test_files_cut_short(tmp_path, content, share):
    path = tmp_path / "model.npz"
    path.write_bytes(content[: max(int(share * len(content)), 100)])
    refused(path, "cut short or damaged")


def test_flipped_bytes_are_found_or_harmless(tmp_path, content, model):
    path = tmp_path / "model.npz"
    rng = np.random.default_rng(5)
    found = 0
    for place in [*rng.integers(0, len(content), 40), *(len(content) - 1 - np.arange(0, 400, 9))]:
        data = bytearray(content)
        data[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(bytes(data))
        try:
            back = st.open(path)
        except st.CaseError:
            found += 1
        else:  # a date or an attribute of the archive's own
            alike(model, back)
    assert found > 40


# -- writing ----------------------------------------------------------------------------------------------------------
KILLED = """
import os, pickle, signal, sys
import numpy as np
from stridor.io import reduced_models
write = np.lib.format.write_array
count = 0
def deadly(*arguments, **options):
    global count
    count += 1
    if count == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    write(*arguments, **options)
np.lib.format.write_array = deadly
reduced_models.save_reduced(reduced_models.load_reduced(sys.argv[1]), sys.argv[2])
"""


@pytest.mark.skipif(sys.platform == "win32", reason="kills a process")
def test_a_kill_in_the_middle_leaves_the_old_file(tmp_path, content):
    source, target = tmp_path / "source.npz", tmp_path / "model.npz"
    source.write_bytes(content)
    target.write_bytes(b"the old one")
    done = subprocess.run([sys.executable, "-c", KILLED, str(source), str(target)], capture_output=True, check=False)
    assert done.returncode == -9, done.stderr
    assert target.read_bytes() == b"the old one"
    half = [p for p in tmp_path.iterdir() if p.name.startswith(".model")]
    assert len(half) == 1  # what was being written lies beside it, under another name
    refused(half[0], "cut short or damaged")


def test_a_folder_that_cannot_be(model, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(st.AnalysisError, match="cannot write"):
        st.save(model, tmp_path / "file" / "model.npz")


def test_arrays_are_compressed_where_it_pays(content):
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        kinds = {i.filename: i.compress_type for i in archive.infolist()}
    assert kinds["vectors.npy"] == zipfile.ZIP_STORED
    assert kinds["term0_data.npy"] == zipfile.ZIP_DEFLATED
    assert reduced_models.VERSION == 2


# -- the command line -------------------------------------------------------------------------------------------------
def test_from_the_command_line_and_back(case, tmp_path):
    (tmp_path / "bench.toml").write_text(case.text)
    box = ("--box", "mu=0:0.3", "--box", "contact_stiffness=0.5:2", "--max-frequency", "20e3")
    asked = ("--at", "mu=0.05:0.15:3", "--at", "contact_stiffness=0.8", "--onsets", "mu", "--json")
    made = stridor("reduce", "bench.toml", *box, "--save", "model.npz", *asked, "--out", "made", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    assert "written: model.npz" in made.stderr
    (tmp_path / "bench.toml").unlink()
    read = stridor("reduce", "model.npz", *asked, "--out", "read", cwd=tmp_path)
    assert read.returncode == 0, read.stderr
    assert case.title in " ".join(read.stderr.split())
    first, second = json.loads(made.stdout), json.loads(read.stdout)
    written = [f"{name}.{ending}" for name in ("reduced", "reduced-onsets") for ending in ("nc", "csv", "png")]
    assert first.pop("files") == ["model.npz", *(f"made/{name}" for name in written)]
    assert second.pop("files") == [f"read/{name}" for name in written]
    modes = st.open(tmp_path / "read" / "reduced.nc")
    assert modes["frequency_hz"].values[0].tolist() == first["modes"][0]["frequency_hz"]
    assert [o.value for o in st.open(tmp_path / "read" / "reduced-onsets.nc")] == [o["value"] for o in first["onsets"]]
    assert first == second
    assert {"freedoms", "size", "max_frequency_hz", "bound", "parameters", "seconds", "solves"} <= set(first)
    assert [p["point"] for p in first["modes"]] == [{"mu": m, "contact_stiffness": 0.8} for m in (0.05, 0.1, 0.15)]
    keys = {"point", "inside", "corrections", "frequency_hz", "growth_rate", "unstable", "error", "passed", "residual"}
    assert set(first["modes"][0]) == keys
    onset = first["onsets"][0]
    assert onset["parameter"] == "mu"
    assert onset["point"]["contact_stiffness"] == 0.8
    assert onset["residual"] < 1e-13
    # The table of all modes has heads with units, and all digits.
    text = (tmp_path / "made" / "reduced.csv").read_text()
    assert text == (tmp_path / "read" / "reduced.csv").read_text()
    rows = list(csv.DictReader(io.StringIO(text)))
    assert list(rows[0]) == [
        "mu", "contact_stiffness", "frequency_hz", "growth_1_s", "damping_percent", "unstable", "error", "residual",
        "inside", "corrections",
    ]  # fmt: skip
    assert len(rows) == sum(len(p["frequency_hz"]) for p in first["modes"])
    assert float(rows[0]["frequency_hz"]) == first["modes"][0]["frequency_hz"][0]
    assert sum(int(r["unstable"]) for r in rows) == sum(sum(p["unstable"]) for p in first["modes"]) > 0


def test_a_small_file_on_the_command_line(model, content, tmp_path):
    (tmp_path / "model.npz").write_bytes(content)
    small = stridor("reduce", "model.npz", "--save", "small.npz", "--keep", "eigenvalues", cwd=tmp_path)
    assert small.returncode == 0, small.stderr
    assert provenance_of(tmp_path / "small.npz") == provenance_of(tmp_path / "model.npz")
    done = stridor("reduce", "small.npz", "--onsets", "mu", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("Onsets along mu, of the reduced model alone: its file has no full matrices\n")
    assert f"{onsets_along(model, 'mu', confirm=False)[0].value:.9g}" in done.stdout


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("model.npz", "--box", "mu=0:1"), "--box: is for making a model, and model.npz holds one that is made; give its case file instead"),
        (("model.npz", "--set", "title='a'"), "--set: is for making a model"),
        (("model.npz", "--bound", "1e-9"), "--bound: is for making a model"),
        (("model.npz", "--save", "model.toml"), "--save: 'model.toml' – a name that ends in .npz"),
        (("model.npz", "--keep", "shapes"), "--keep: 'shapes' – goes with --save FILE.npz"),
        (("model.npz", "--save", "a.npz", "--keep", "most"), "--keep: 'most' – one of all, shapes, eigenvalues"),
        (("model.npz", "--at", "nu=0.1"), "--at: 'nu' – no number of the model; there are: mu, contact_stiffness"),
        (("model.npz", "--onsets", "nu"), "--onsets: 'nu' – no number of the model; there are: mu, contact_stiffness"),
        (("half.npz",), "file: 'half.npz' – a reduced model, but cut short or damaged"),
        (("text.npz",), "file: 'text.npz' – no reduced model"),
        (("none.npz",), "file: 'none.npz' – no such file"),
    ],
)  # fmt: skip
def test_what_the_command_line_refuses(content, tmp_path, words, message, monkeypatch, capsys):
    (tmp_path / "model.npz").write_bytes(content)
    (tmp_path / "half.npz").write_bytes(content[: len(content) // 2])
    (tmp_path / "text.npz").write_text("title = 'a case'")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["stridor", "reduce", *words])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    said = capsys.readouterr()
    assert said.out == ""
    lines = [line for line in said.err.splitlines() if line.startswith("stridor:")]
    assert len(lines) == 1, said.err
    assert lines[0].startswith(f"stridor: {message}")
    assert "Traceback" not in said.err
