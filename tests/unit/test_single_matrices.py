"""One matrix file by itself, and models that cannot oscillate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from stridor.app.cli import app
from stridor.case import load
from stridor.errors import AnalysisError
from stridor.modal.complex_modes import complex_modes
from stridor.system import build_system


def test_a_file_tells_what_it_holds(tmp_path: Path):
    file = tmp_path / "both.npz"
    follow = np.diag([4.0, 5.0, 6.0])
    follow[0, 1] = 1.0
    np.savez(file, K=follow, M=np.eye(3))
    done = CliRunner().invoke(app, ["matrices", str(file), "--name", "K"])
    assert done.exit_code == 0, done.output
    assert "3 freedoms, K" in done.output
    assert "4 entries, ‖A − Aᵀ‖/‖A‖ = " in done.output
    assert "the symmetric part is positive definite" in done.output
    assert "A − Aᵀ has rank 2, in 2 rows" in done.output
    assert "symmetric\n" in CliRunner().invoke(app, ["matrices", str(file), "--name", "M"]).output


def test_without_any_stiffness_nothing_oscillates(tmp_path: Path):
    np.savez(tmp_path / "both.npz", K=np.zeros((6, 6)), M=np.eye(6))
    terms = '[{ file = "both.npz", name = "M", role = "mass" }, { file = "both.npz", name = "K", role = "stiffness" }]'
    case = tmp_path / "case.toml"
    case.write_text(f'[bodies.loose]\ntype = "matrices"\ndimension = 2\nterms = {terms}\n')
    with pytest.raises(AnalysisError, match="no stiffness at all"):
        complex_modes(build_system(load(case)), 0.1)
