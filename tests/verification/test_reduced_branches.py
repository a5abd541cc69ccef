"""Branches of a reduced model followed straight through its box, against branches of the full problem from μ = 0."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stridor as st
from stridor.case import template_text
from stridor.io.reduced_models import save_reduced
from stridor.modal.parametric import line
from stridor.studies import reduced_rows
from stridor.studies.rows import full_row

pytestmark = pytest.mark.verification

DAMPING = "bodies.beam1.damping.mass"
BOX = {
    "mu": (0.0, 0.6), DAMPING: (1.0, 20.0), "materials.steel.density": (7000.0, 8500.0),
    "materials.steel.young_modulus": (1.9e11, 2.1e11),
}  # fmt: skip


@pytest.fixture(scope="module")
def bench() -> st.Case:
    return st.loads(template_text("two-beams"))


@pytest.fixture(scope="module")
def answered(bench: st.Case, tmp_path_factory: pytest.TempPathFactory) -> tuple[st.Study, reduced_rows.FrictionModels]:
    parameters = {name: {"range": ends} for name, ends in BOX.items()}
    study = st.Study(case=bench, parameters=parameters, sampling={"method": "sobol", "samples": 64})
    return study, reduced_rows.made(study, bench, np.array(list(BOX.values())).T, tmp_path_factory.mktemp("box") / "m-modes")


@pytest.mark.parametrize("count", [3, pytest.param(300, marks=pytest.mark.slow)])
def test_numbers_are_those_of_the_full_problem(bench: st.Case, answered, count: int) -> None:
    study, reduced = answered
    random, known, modes = np.random.default_rng(count), 0, 0
    for _ in range(count):
        values = {name: float(random.uniform(*ends)) for name, ends in BOX.items()}
        row, full = reduced.row(values, study.keep), full_row(bench, "modes", values, study.keep)
        assert row is not None
        numbers = row["branch"]
        assert len(numbers) == len(full["branch"])
        assert np.all((numbers == full["branch"]) | (numbers == 0)), values
        known, modes = known + np.count_nonzero(numbers), modes + len(numbers)
    assert known >= 0.95 * modes


def test_what_is_not_known_has_no_number(answered, monkeypatch: pytest.MonkeyPatch) -> None:
    study, reduced = answered
    values = {name: float(np.mean(ends)) for name, ends in BOX.items()}
    bare = reduced_rows.FrictionModels(reduced.models, reduced.compute, reduced.names)
    assert not bare.row(values, study.keep)["branch"].any()
    # A way that would take more points than there may be.
    monkeypatch.setattr(line, "TRIES", 0)
    monkeypatch.setattr("stridor.modal.krylov.follow.CLEAR", 0.0)
    assert not reduced.row(values, study.keep)["branch"].any()


def test_damaged_numbers_are_none(bench: st.Case, answered, tmp_path: Path) -> None:
    study, reduced = answered
    path = tmp_path / "box-modes"
    path.mkdir()
    save_reduced(reduced.models[0], path / "00.npz", case=bench)
    (path / "00-branches.json").write_text('[{"mu": 0.1, "real": ')
    again = reduced_rows.FrictionModels.read(str(path), bench)
    assert again.anchors == ((),)
    assert not again.row({name: float(np.mean(ends)) for name, ends in BOX.items()}, study.keep)["branch"].any()
