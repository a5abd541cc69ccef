"""Factors of imported matrices in reduced models: exact, few terms, and the sums that `build_system` makes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import scipy.io as sio
import scipy.sparse as sp
from test_matrix_bodies import MESHED, Export
from typer.testing import CliRunner

import stridor as st
from stridor.app.cli import app
from stridor.modal.parametric.factors import Formula, Product
from stridor.study.reduced import parametric_problem, reduced_model
from stridor.system import build_system
from stridor.system.bodies import build_bodies
from stridor.system.shares import system_shares

TURNING = """
[parameters]
Omega = { value = 20.0, range = [10.0, 100.0] }
mass = { value = 3.0, range = [1.0, 4.0] }
[modal]
max_frequency_hz = 0.3
[matrices]
terms = [
  { file = "M.mtx", role = "mass", factor = "mass/3" },
  { file = "K.mtx", role = "stiffness" },
  { file = "G.mtx", role = "damping", factor = "1e-3*Omega" },
  { file = "M.mtx", role = "damping", factor = "0.1/Omega" },
  { file = "M.mtx", role = "stiffness", factor = "1 - 1/Omega**2" },
  { file = "M.mtx", role = "stiffness", factor = 0.25 },
  { file = "F.mtx", role = "stiffness", factor = "mu*(2 - mass)" },
]
"""


@pytest.fixture
def turning(tmp_path: Path) -> st.Case:
    """Two nets of springs that turn and rub, in matrices alone."""
    n = 5
    rng = np.random.default_rng(2)
    line = sp.diags_array([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1])
    net = sp.kron(line, sp.eye_array(n)) + sp.kron(sp.eye_array(n), line)
    turn = sp.kron(np.array([[0.0, -1.0], [1.0, 0.0]]), sp.diags_array(rng.random(n * n)))
    follow = sp.kron(np.array([[0.0, 0.2], [0.0, 0.0]]), sp.diags_array(rng.random(n * n)))
    mass = sp.diags_array(1 + 0.2 * rng.random(2 * n * n))
    for name, matrix in (("M", mass), ("K", sp.block_diag([net, 1.1 * net])), ("G", turn), ("F", follow)):
        sio.mmwrite(tmp_path / f"{name}.mtx", sp.coo_array(matrix), precision=17)
    (tmp_path / "rotor.toml").write_text(TURNING, encoding="utf-8")
    return st.load(tmp_path / "rotor.toml")


def random_points(problem, count: int) -> list[dict[str, float]]:
    rng = np.random.default_rng(3)
    return [{p.name: rng.uniform(p.low, p.high) for p in problem.parameters} for _ in range(count)]


def assert_same_matrices(one, other, rel: float = 1e-14) -> None:
    for role in ("mass", "damping", "stiffness"):
        first, second = getattr(one, role), getattr(other, role)
        assert abs(first - second).max() <= rel * max(abs(second).max(), 1e-300)


def named(point: dict[str, float]) -> dict[str, float]:
    return {f"parameters.{k}.value": v for k, v in point.items() if k != "mu"}


def test_negative_values_of_parameters_on_the_command_line(turning: st.Case, tmp_path: Path) -> None:
    text = TURNING.replace("[modal]", "offset = { value = 0.0, range = [-0.2, 0.2] }\n[modal]")
    text = text.replace("factor = 0.25 }", 'factor = "0.25 + offset" }')
    (tmp_path / "rotor.toml").write_text(text, encoding="utf-8")
    words = ["reduce", str(tmp_path / "rotor.toml"), "--box", "offset=-0.2:0.2", "--at", "offset=-0.2:0.1:4"]
    shown = CliRunner().invoke(app, [*words, "--json", "--quiet"])
    assert shown.exit_code == 0, shown.output
    points = json.loads(shown.stdout)["modes"]
    assert [p["point"]["offset"] for p in points] == pytest.approx([-0.2, -0.1, 0.0, 0.1])
    lowest = [p["frequency_hz"][0] for p in points]
    assert lowest == sorted(lowest)
    assert lowest[0] < lowest[3]


def test_factors_are_those_of_the_case(turning: st.Case) -> None:
    """1/Ω over a decade, products of parameters, and μ without a contact."""
    box = {"Omega": (10.0, 100.0), "mass": (1.0, 4.0), "mu": (0.0, 0.6)}
    problem = parametric_problem(turning, box)
    assert len(problem.terms) == 6
    assert sum(isinstance(t.factor, Formula) for t in problem.terms) == 5
    for point in random_points(problem, 5):
        assert_same_matrices(problem.at(point), build_system(turning.with_(named(point)), point["mu"]))
        for name in box:
            (own,) = (p for p in problem.parameters if p.name == name)
            step = 1e-5 * (own.high - own.low)
            ends = [problem.factors({**point, name: point[name] + s * step}) for s in (-1, 1)]
            assert problem.factor_slopes(point, name) == pytest.approx((ends[1] - ends[0]) / (2 * step), rel=1e-6, abs=1e-9)
    alone = parametric_problem(turning, {"Omega": (10.0, 100.0)})
    for point in random_points(alone, 3):
        assert_same_matrices(alone.at(point), build_system(turning.with_(named(point))))
    assert all(isinstance(t.factor, Formula | Product) for t in alone.terms)


def test_the_modes_over_a_decade(turning: st.Case) -> None:
    model = reduced_model(turning, {"Omega": (10.0, 100.0), "mu": (0.0, 0.6)})
    for point in random_points(model.problem, 3):
        full = st.modes(turning.with_(named(point)), point["mu"], max_frequency_hz=0.3).eigenvalues[0]
        found = model.modes(point).values
        assert len(full) > 10
        assert (np.abs(full[:, None] - found).min(axis=1) / np.abs(full)).max() < 1e-8


def test_imported_bodies_in_contact(tmp_path: Path) -> None:
    """Factors of friction and of a parameter, in units of their own, beside a meshed body with a modulus that varies:
    one μ for the contact and for the factors."""
    export = Export(tmp_path, scale=0.001)
    n = len(export.freedoms)
    skew = sp.coo_array((np.array([2e3, -1e3]), ([0, 1], [1, 0])), shape=(n, n))
    sio.mmwrite(tmp_path / "S.mtx", skew, precision=17)
    more = '{ file = "S.mtx", role = "stiffness", factor = "mu" }, { file = "K.mtx", role = "stiffness", factor = "1/s" },'
    case = st.loads("parameters.s = { value = 5.0, range = [1.0, 20.0] }\n" + export.text.replace("MORE", more), folder=tmp_path)
    # Little friction, so that all nodes touch everywhere in the box.
    case = case.with_({"bodies.block.scale": 0.001, "contacts.face.friction.coefficient": 0.1})
    assert st.steady_sliding(case).active.all()
    box = {"mu": (0.05, 0.15), "s": (1.0, 20.0), "materials.steel.young_modulus": (1.9e11, 2.1e11)}
    for stiffness in (1e12, "rigid"):
        changed = case.with_({"contacts.face.stiffness": stiffness})
        model = reduced_model(changed, box, max_frequency_hz=30e3)
        for point in random_points(model.problem, 2):
            other = {k: v for k, v in named(point).items() if not k.startswith("parameters.materials")}
            other["materials.steel.young_modulus"] = point["materials.steel.young_modulus"]
            full = st.modes(changed.with_(other), point["mu"], max_frequency_hz=30e3).eigenvalues[0]
            full = full[np.abs(full) < 0.98 * model.frequency]
            found = model.modes(point).values
            assert len(full) > 3
            assert (np.abs(full[:, None] - found).min(axis=1) / np.abs(full)).max() < 1e-8


def test_shares_add_up_with_ties_links_and_freedoms_held(tmp_path: Path) -> None:
    body = build_bodies(st.loads(MESHED))["block"]
    top = body.mesh.boundary_nodes("top")
    export = Export(tmp_path, keep=np.setdiff1d(np.arange(2 * len(body.points)), 2 * top))
    # A little off symmetric, as rounded files are.
    rough = sp.coo_array(sio.mmread(tmp_path / "K.mtx"))
    rough.data *= 1 + 1e-13 * np.random.default_rng(1).standard_normal(rough.nnz)
    sio.mmwrite(tmp_path / "K.mtx", rough, precision=17)
    case = export.case('{ file = "K.mtx", role = "damping", factor = "1e-8*(1 + mu)" },')
    assert "mu" in case.factor_names
    tied = case.with_({
        "bodies.lid": {
            "type": "solid", "model": "plane strain", "material": "pad",
            "mesh": {
                "shape": "rectangle", "corner": [-0.01, 0.02], "size": [0.02, 0.01], "divisions": [7, 2], "cells": "quad",
            },
        },
        "ties.lid": {"slave": "lid.bottom", "master": "block.top"},
        "supports.holder": None,
        "springs.s": {"between": ["block.crown", "ground"], "direction": [0.0, 1.0], "stiffness": 1e7, "damping": 3.0},
    })  # fmt: skip
    for built in (case, tied):
        system = build_system(built, 0.7)
        sums = {role: sp.csr_array(system.mass.shape) for role in ("mass", "damping", "stiffness")}
        for share in system_shares(built, 0.7):
            factor = {"1e-8*(1 + mu)": 1.7e-8}.get(share.factor, share.factor)
            sums[share.role] = sums[share.role] + factor * share.matrix
        for role, total in sums.items():
            assert abs(total - getattr(system, role)).max() < 1e-14 * abs(total).max()


def test_what_boxes_of_imported_matrices_refuse(turning: st.Case) -> None:
    for box, message in (
        ({"parameters.Omega.value": (10.0, 20.0)}, r"box\.parameters\.Omega\.value.*call it Omega"),
        ({"Omega": (5.0, 20.0)}, r"parameters\.Omega\.value: 5\.0 – must be in its range, 10 to 100"),
        ({"contact_stiffness": (0.5, 2.0)}, "the case has no contacts"),
    ):
        with pytest.raises(st.CaseError, match=message):
            parametric_problem(turning, box)
    with pytest.raises(st.CaseError, match=r"^along: .*parameters\.Omega\.value.* call it Omega$"):
        st.onsets(turning, (10.0, 20.0), along="parameters.Omega.value")
    # At its own value a factor is zero, and freedoms that nothing else has are left out: they cannot come back.
    folder = Path(turning.imported["matrices"].terms[0].file).parent
    wide = sp.coo_array((np.ones(1), ([50], [50])), shape=(51, 51))
    for name in ("M", "K", "G", "F"):
        old = sp.coo_array(sio.mmread(folder / f"{name}.mtx"))
        sio.mmwrite(folder / f"{name}.mtx", sp.coo_array((old.data, (old.row, old.col)), shape=(51, 51)), precision=17)
    sio.mmwrite(folder / "W.mtx", wide)
    terms = [t.model_dump(exclude_none=True) for t in turning.imported["matrices"].terms]
    more = [*terms, {"file": str(folder / "W.mtx"), "role": "stiffness", "factor": "mass - 3"}]
    with pytest.raises(st.CaseError, match="1 freedoms have entries only in terms whose factor is zero"):
        parametric_problem(turning.with_({"bodies.matrices.terms": more}), {"mass": (1.0, 4.0)})
