"""Exported matrices: every format gives the model back, to the last bit, and a case on them has the same onsets."""

from __future__ import annotations

import contextlib
import csv
import functools
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io as sio
import scipy.sparse as sp

import stridor as st
from matrix_cases import matrix_case
from program import stridor
from rubbing_block import RUBBING_MASS, rubbing_block
from stridor.case import template_text
from stridor.io import matrix_files
from stridor.io.matrix_files import FORMATS, Format, write_matrices
from stridor.matrices import read_matrix
from stridor.typing import Sparse

FEW = ["bodies.beam1.elements=3", "bodies.beam2.elements=9"]
SET_FEW = [word for item in FEW for word in ("--set", item)]
SLOWING = 'contacts.A.friction={law="weakening", coefficient=0.1, static_coefficient=0.2, decay_speed=0.05}'


def beams(*sets: str) -> st.Case:
    return st.loads(template_text("two-beams"), [*FEW, *sets])


def read(folder: Path, name: str, form: Format) -> Sparse:
    named = name if form in matrix_files.HOLDS_ALL else None
    return read_matrix(folder / matrix_files.file_of(name, form), named).matrix


def onsets(case: st.Case) -> np.ndarray:
    found = st.onsets(case).onsets
    return np.array([(o.mu, o.frequency_hz) for o in found])


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


@functools.cache
def onsets_of_bench() -> np.ndarray:
    return onsets(beams())


# Of other formats the matrices are compared to the last bit, below.
@pytest.mark.parametrize("form", [f if f in ("mtx", "npz") else pytest.param(f, marks=pytest.mark.slow) for f in FORMATS])
def test_the_bench_as_exported_matrices_has_the_same_onsets(form: Format, tmp_path: Path) -> None:
    assert stridor("new", "two-beams", "--quiet", *SET_FEW, cwd=tmp_path).returncode == 0
    done = stridor("export", "two-beams.toml", "--format", form, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["format"] == form
    assert document["mu"] is None
    assert document["loads"] == ["press"]
    own = onsets_of_bench()
    assert len(own) == 4
    assert onsets(st.load(tmp_path / document["case"])) == pytest.approx(own, rel=1e-10)


@pytest.mark.parametrize("form", FORMATS)
def test_matrices_at_one_friction_come_back_to_the_last_bit(form: Format, tmp_path: Path) -> None:
    case = beams()
    written = st.export(case, tmp_path, format=form, mu=0.3)
    for name, matrix in zip("MCK", st.pencil(case, 0.3).matrices(), strict=True):
        assert np.array_equal(read(tmp_path, name, form).toarray(), matrix.toarray()), name
    assert written.case is not None
    own, imported = (st.modes(c, mu).frequency_hz[0] for c, mu in ((case, 0.3), (st.load(written.case), None)))
    assert np.sort(imported)[:10] == pytest.approx(np.sort(own)[:10], rel=1e-9)


def test_rigid_contact_brings_its_force_as_an_unknown(tmp_path: Path) -> None:
    case = beams('contacts.A.stiffness="rigid"', "bodies.beam1.elements=3", "bodies.beam2.elements=9")
    written = st.export(case, tmp_path)
    assert written.case is not None
    last = rows(tmp_path / "freedoms.csv")[-1]
    assert (last["body"], last["direction"], last["number"]) == ("A", "normal force", str(written.freedoms))
    assert rows(tmp_path / "contacts.csv")[0]["stiffness_n_m"] == "rigid"
    own = onsets(case)
    assert len(own) >= 3
    assert onsets(st.load(written.case)) == pytest.approx(own, rel=1e-10)


def test_contact_over_a_surface_and_its_tables(tmp_path: Path) -> None:
    case = st.loads(rubbing_block("max_frequency_hz = 60e3\nsweep_points = 7")).with_(
        {"bodies.block.mesh.divisions": [3, 3], "bodies.slider.mesh.divisions": [10, 1]}
    )
    case = case.with_({"loads": None})  # so that all nodes touch
    system = st.build_system(case)
    written = st.export(case, tmp_path, format="npz")
    assert written.case is not None
    own = onsets(case)
    assert len(own)
    assert onsets(st.load(written.case)) == pytest.approx(own, rel=1e-10)
    sought = ("friction_range", "max_frequency_hz", "modes", "sweep_points")
    assert [getattr(st.load(written.case).modal, name) for name in sought] == [
        getattr(case.modal, name) for name in sought
    ]
    table = rows(tmp_path / "freedoms.csv")
    assert [f"{r['body']} node {r['node']} {r['direction']}" for r in table] == list(system.dof_names)
    block = next(s for s in system.solids if s.name == "block")
    for row in table:
        if row["body"] == "block":
            assert (float(row["x_m"]), float(row["y_m"])) == tuple(block.points[int(row["node"])])
    # What the contact adds is what its rows say.
    normal, tangent = (sp.load_npz(tmp_path / f"{name}.npz") for name in ("normal", "tangent"))
    springs = sp.diags_array([float(r["stiffness_n_m"]) for r in rows(tmp_path / "contacts.csv")])
    closed, rubbing = (sp.load_npz(tmp_path / f"{name}.npz") for name in ("Kc", "Kf"))
    assert abs(normal.T @ springs @ normal - closed).max() <= 1e-12 * abs(closed).max()
    assert abs(tangent.T @ springs @ normal + rubbing).max() <= 1e-12 * abs(rubbing).max()


def test_rows_of_contacts_make_a_system(tmp_path: Path) -> None:
    """Friction opposes slip along +tangent, as `System.from_matrices` takes it."""
    case = beams()
    st.export(case, tmp_path)
    mass, damping, stiffness = (read(tmp_path, name, "mtx") for name in "MCK")
    contact = rows(tmp_path / "contacts.csv")[0]
    normal, tangent = (_row(tmp_path / f"{name}.mtx") for name in ("normal", "tangent"))
    friction = {"law": "coulomb", "coefficient": float(contact["friction_coefficient"])}
    table = {"normal": normal, "tangent": tangent, "stiffness": float(contact["stiffness_n_m"]), "friction": friction}
    system = st.System.from_matrices(mass, damping, stiffness, contacts={"A": table})
    found = st.onsets(st.Workspace(system, modal={"max_frequency_hz": 40e3})).onsets
    assert [o.mu for o in found] == pytest.approx(onsets(case)[:, 0], rel=1e-9)


@pytest.mark.parametrize("mu", [None, 0.3])
def test_rows_of_a_contact_that_pulls_are_along_the_slip(mu: float | None, tmp_path: Path) -> None:
    """A block pulled off at its left: the friction of nodes that pull is told by the sign of their force, not of rows."""
    tilted = {"loads.tilt": {"at": "block.left", "force": [0.0, 4e3]}, "contacts.face.closed": True}
    case = st.loads(rubbing_block("max_frequency_hz = 60e3")).with_(tilted)
    st.export(case, tmp_path, format="npz", mu=mu)
    table = rows(tmp_path / "contacts.csv")
    force = st.steady_sliding(case, mu).normal_force
    sign = np.array([float(r["force_sign"]) for r in table])
    assert np.array_equal(sign, np.where(force < 0.0, -1.0, 1.0))
    assert 0 < np.sum(sign < 0.0) < len(sign)
    normal, tangent = (sp.load_npz(tmp_path / f"{name}.npz") for name in ("normal", "tangent"))
    # The belt moves to the right, the block slips to the left on it at every node.
    along = np.array([1.0 if (r["body"], r["direction"]) == ("block", "x") else 0.0 for r in rows(tmp_path / "freedoms.csv")])
    assert tangent @ along == pytest.approx(-np.ones(len(sign)))
    springs = sp.diags_array([float(r["stiffness_n_m"]) for r in table])
    rubbing = -tangent.T @ sp.diags_array(sign) @ springs @ normal
    if mu is None:
        found = sp.load_npz(tmp_path / "Kf.npz")
    else:
        system = st.build_system(case)
        found = (sp.load_npz(tmp_path / "K.npz") - system.stiffness - normal.T @ springs @ normal) / mu
    assert abs(rubbing - found).max() <= 1e-11 * springs.diagonal().max()
    if mu is not None:
        return
    # A system of these rows finds the sign itself.
    contacts = {
        f"n{k}": {"normal": n, "tangent": t, "stiffness": float(r["stiffness_n_m"]), "closed": True, "gap": float(r["gap_m"]),
                 "friction": {"law": "coulomb", "coefficient": float(r["friction_coefficient"])}}
        for k, (n, t, r) in enumerate(zip(normal.toarray(), tangent.toarray(), table, strict=True))
    }  # fmt: skip
    mass, damping, stiffness = (sp.load_npz(tmp_path / f"{name}.npz") for name in "MCK")
    loads = {"all": sp.load_npz(tmp_path / "loads.npz").sum(axis=1)}
    system = st.System.from_matrices(mass, damping, stiffness, contacts=contacts, loads=loads)
    assert st.steady_sliding(system).normal_force == pytest.approx(force, rel=1e-9)


def _row(path: Path) -> np.ndarray:
    return sio.mmread(path).toarray()[0]


def test_what_is_no_straight_line_over_friction_is_exported_at_one_friction_only(tmp_path: Path) -> None:
    case = beams(SLOWING)
    over, at = st.export(case, tmp_path / "over"), st.export(case, tmp_path / "at", mu=0.2)
    assert over.case is None
    assert "friction that changes with speed" in over.notes[0]
    assert set(over.matrices) == {"M", "C", "K", "normal", "tangent", "loads"}
    assert at.case is not None
    own = np.sort(st.modes(case, 0.2).growth_rate[0])[-3:]
    found = np.sort(st.modes(st.load(at.case)).growth_rate[0])[-3:]
    assert found == pytest.approx(own, rel=1e-8)


def test_what_is_no_straight_line_is_named(tmp_path: Path) -> None:
    law = '{ law = "coulomb", coefficient = 0.3 }\ncontacts.rub.cubic = 2.0'
    case = st.loads(re.sub(r"(rub\.friction = ).*", rf"\1{law}", RUBBING_MASS))
    (note,) = st.export(case, tmp_path).notes
    assert "what steady sliding adds (contact stiffness with a cubic term) is no straight line over mu" in note


def test_a_note_where_other_nodes_touch_at_another_friction(tmp_path: Path) -> None:
    case = st.loads(rubbing_block("max_frequency_hz = 30e3")).with_(
        {"bodies.block.mesh.divisions": [3, 5], "bodies.slider.mesh.divisions": [6, 1]}
    )
    assert any(o.kind == "contact" for o in st.onsets(case).onsets)
    written = st.export(case, tmp_path)
    assert len(written.notes) == 1
    assert written.notes[0].startswith("other contact nodes touch at mu = ")
    assert written.load_names == ("press",)
    load = sio.mmread(tmp_path / "loads.mtx").toarray()[:, 0]
    assert np.array_equal(load, st.build_system(case).loads["press"])


@pytest.mark.parametrize("held", [1, 2])
def test_a_note_where_other_nodes_stick_at_another_friction(held: int, tmp_path: Path) -> None:
    """A mass that slides on a belt, and one or two beside it that their walls hold by sticking."""
    names = ["n", "o"][:held]
    tables: dict[str, Any] = {
        "units": "nondimensional", "steady": {"friction": "stick-slip"}, "modal": {"max_frequency_hz": 1.0},
        "bodies": {"belt": {"type": "obstacle", "shape": "flat", "point": [0, 0], "normal": [0, 1],
                            "sliding": {"velocity": [-1.0, 0.0]}}},
        "loads": {}, "contacts": {}, "springs": {},
    }  # fmt: skip
    for k, name in enumerate(["m", *names]):
        tables["bodies"][name] = {"type": "mass", "mass": 1.0, "position": [3.0 * k, 0.0]}
        tables["loads"][f"press_{name}"] = {"at": name, "force": [0.1 * k, -1.0]}
        tables["springs"][f"k_{name}"] = {"between": [name, "ground"], "stiffness": 2.0, "direction": [1.0, 0.3]}
        master = "belt" if name == "m" else f"wall_{name}"
        if name != "m":
            tables["bodies"][master] = {"type": "obstacle", "shape": "flat", "point": [3.0 * k, 0], "normal": [0, 1]}
        tables["contacts"][f"rub_{name}"] = {
            "slave": name, "master": master, "stiffness": 1.3, "friction": {"law": "coulomb", "coefficient": 0.5}
        }  # fmt: skip
    written = st.export(st.Case.model_validate(tables), tmp_path)
    assert f"other contact nodes stick at mu = 1 ({held}) than at the case's own (0), which Kc and Kf are made of" in written.notes


def test_a_note_where_contacts_kept_closed_pull_at_another_friction(tmp_path: Path) -> None:
    case = st.loads(rubbing_block("max_frequency_hz = 30e3\nfriction_range = [0.0, 0.3]")).with_({
        "bodies.block.mesh.divisions": [3, 5], "bodies.slider.mesh.divisions": [6, 1], "contacts.face.closed": True,
        "contacts.face.friction.coefficient": 0.1,
    })  # fmt: skip
    (note,) = st.export(case, tmp_path).notes
    assert "kept closed has turned from pushing to pulling or back" in note


def test_a_second_export_replaces_the_first_only_if_asked(tmp_path: Path) -> None:
    assert stridor("new", "two-beams", "--quiet", cwd=tmp_path).returncode == 0
    words = ("export", "two-beams.toml", "--quiet", *SET_FEW)
    assert stridor(*words, cwd=tmp_path).returncode == 0
    folder = tmp_path / "two-beams.out"
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert "Kf.mtx" in before
    again = stridor(*words, "--mu", "0.2", cwd=tmp_path)
    assert again.returncode == 2
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    assert stridor(*words, "--mu", "0.2", "--force", cwd=tmp_path).returncode == 0
    after = {path.name for path in folder.iterdir()}
    assert before.keys() - after == {"Kc.mtx", "Kf.mtx"}
    assert "mu = 0.2" in (folder / "matrices.toml").read_text(encoding="utf-8")


def test_a_full_disk_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_matrices(tmp_path, {"M": sp.eye_array(3)}, "mtx")
    before = (tmp_path / "M.mtx").read_bytes()

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(matrix_files.sio, "mmwrite", full)
    with pytest.raises(st.AnalysisError, match=r"cannot write .*M\.mtx: No space left on device"):
        write_matrices(tmp_path, {"M": 2 * sp.eye_array(3)}, "mtx")
    assert [path.name for path in tmp_path.iterdir()] == ["M.mtx"]
    assert (tmp_path / "M.mtx").read_bytes() == before


@pytest.mark.parametrize("form", FORMATS)
def test_matrices_of_any_kind_come_back(form: Format, tmp_path: Path) -> None:
    size = 70_000  # more rows than a short word counts
    random = np.random.default_rng(5)
    at = random.integers(0, size, (2, 500))
    given = {
        "A": sp.csr_array(sp.coo_array((random.standard_normal(500) * 10.0 ** random.integers(-300, 300, 500), at),
                                       shape=(size, size))),
        "B": sp.csr_array((3, 3)),
        "C": sp.csr_array([[1.0 / 3.0, 2.0, 0.0], [2.0, 0.0, -5e-300], [0.0, -5e-300, 1e300]]),
        "D": sp.csr_array([[0.0, 1.0, 2.0], [3.0, 0.0, 4.0], [5.0, 6.0, 7.0]]),
        "E": sp.csr_array([[1.0, 2.0]]),
    }  # fmt: skip
    write_matrices(tmp_path, given, form)
    for name in "ABCD":
        assert not (read(tmp_path, name, form) - given[name]).count_nonzero(), name


def test_an_imported_body_keeps_its_numbers(tmp_path: Path) -> None:
    named = [(7, 1), (7, 6), (1201, 1), (1201, 2), (-3, 0)]
    (tmp_path / "dof.txt").write_text("".join(f"{n} {d}\n" for n, d in named), encoding="utf-8")
    matrix_case(tmp_path, [(np.eye(5), "mass", ""), (1e6 * np.diag(np.arange(1.0, 6.0)), "stiffness", "")], 1e4)
    terms = [{"file": "A0.npz", "role": "mass"}, {"file": "A1.npz", "role": "stiffness"}]
    body = {"type": "matrices", "dimension": 2, "terms": terms, "labels": "dof.txt"}
    with contextlib.chdir(tmp_path):
        case = st.Case(bodies={"brake": body}, modal={"max_frequency_hz": 1e4})
    st.export(case, tmp_path / "out")
    lines = (tmp_path / "out" / "labels.txt").read_text(encoding="utf-8").splitlines()
    labels = [tuple(map(int, line.split())) for line in lines]
    assert sorted(labels) == sorted([*named[:4], (-1, 0)])
    stiffness = read(tmp_path / "out", "K", "mtx").diagonal()
    assert stiffness[labels.index((1201, 2))] == 4e6
    assert stiffness[labels.index((7, 6))] == 2e6


def test_a_system_alone_can_be_exported(tmp_path: Path) -> None:
    friction = {"law": "coulomb", "coefficient": 0.3}
    table = {"normal": [0, 1], "tangent": [1, 0], "stiffness": 10.0, "friction": friction}
    block = st.System.from_matrices(np.eye(2), None, [[20.0, 4.0], [4.0, 15.0]], contacts={"belt": table})
    work = st.Workspace(block, modal={"max_frequency_hz": 10.0})
    written = st.export(work, tmp_path)
    assert written.case is not None
    assert [r["direction"] for r in rows(tmp_path / "freedoms.csv")] == ["freedom 0", "freedom 1"]
    assert st.onsets(st.load(written.case)).onsets[0].mu == pytest.approx(0.55625, rel=1e-12)
