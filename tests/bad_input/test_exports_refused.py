"""Exports that will not do, each with the exact message."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stridor as st
from matrix_cases import matrix_case
from program import stridor
from stridor.case import template_text

pytestmark = pytest.mark.bad_input


@pytest.fixture(scope="module")
def bench() -> st.Case:
    return st.loads(template_text("two-beams"), ["bodies.beam1.elements=4", "bodies.beam2.elements=9"])


def refused(call: object, message: str) -> None:
    with pytest.raises(st.CaseError) as error:
        call()  # type: ignore[operator]
    assert str(error.value) == message


def test_formats(bench: st.Case, tmp_path: Path) -> None:
    refused(lambda: st.export(bench, tmp_path, format="csv"), "format: 'csv' – one of mtx, npz, mat, op4")
    (tmp_path / "case.toml").write_text(bench.text, encoding="utf-8")
    done = stridor("export", "case.toml", "--format", "csv", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.splitlines()[-1] == "stridor: --format: 'csv' – mtx or npz or mat or op4"


def test_frictions(bench: st.Case, tmp_path: Path) -> None:
    accepted = "a friction coefficient is a finite number ≥ 0"
    refused(lambda: st.export(bench, tmp_path, mu=-0.1), f"mu: -0.1 – {accepted}")
    refused(lambda: st.export(bench, tmp_path, mu=float("nan")), f"mu: nan – {accepted}")


def test_matrices_that_depend_on_friction_already(tmp_path: Path) -> None:
    terms = [(np.eye(2), "mass", ""), (np.diag([1.0, 2.0]), "stiffness", "1 + mu")]
    case = matrix_case(tmp_path, terms, 1.0)
    message = "mu: missing – factors of the case's matrices depend on it already; give the one to export at (--mu)"
    refused(lambda: st.export(case, tmp_path / "out"), message)
    assert not (tmp_path / "out").exists()
    assert st.export(case, tmp_path / "out", mu=0.5).case


def test_files_that_are_there(bench: st.Case, tmp_path: Path) -> None:
    (tmp_path / "K.mtx").write_text("mine", encoding="utf-8")
    refused(
        lambda: st.export(bench, tmp_path),
        f"folder: {tmp_path} holds K.mtx of an earlier export; take another folder, or replace them (--force)",
    )
    assert (tmp_path / "K.mtx").read_text(encoding="utf-8") == "mine"
    st.export(bench, tmp_path, format="npz")
