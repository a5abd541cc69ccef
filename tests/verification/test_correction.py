"""Correction steps of reduced models against the dense full problem."""

from __future__ import annotations

import json

import numpy as np
import pytest
from test_reduction import FREQUENCY_HZ, eigenvalues, rotor
from typer.testing import CliRunner

from stridor.app.cli import app
from stridor.case import load, template_text
from stridor.errors import CaseError
from stridor.modal.complex_modes import complex_modes
from stridor.modal.parametric import Corrector, Parameter, ParametricProblem, reduce
from stridor.system import build_system

pytestmark = pytest.mark.verification

OUTSIDE = {"Omega": 5.0, "mu": 0.9}


@pytest.fixture(scope="module")
def corrector():
    whole = rotor()
    narrow = (Parameter("Omega", 0.8, 1.2, 1.0), Parameter("mu", 0.2, 0.4, 0.3))
    with Corrector(reduce(ParametricProblem(whole.terms, narrow), FREQUENCY_HZ, bound=1e-6)) as made:
        yield made


def away(corrector: Corrector, steps: int) -> tuple[np.ndarray, object]:
    found = corrector.modes(OUTSIDE, steps=steps)
    exact = eigenvalues(corrector.model.problem, OUTSIDE)
    return np.abs(found.values[:, None] - exact).min(axis=1) / np.abs(found.values), found


def test_each_step_takes_most_of_the_error_away(corrector):
    (none, _), (one, _), (two, _) = (away(corrector, steps) for steps in (0, 1, 2))
    assert none.max() > 1e-6
    assert one.max() < 0.2 * none.max()
    assert two.max() < 0.2 * one.max()


def test_corrected_until_the_bound_is_passed(corrector):
    error, found = away(corrector, 10)
    assert found.passed.all()
    assert not found.inside
    assert 1 < found.steps < 10
    assert error.max() < corrector.model.bound
    assert np.all(error <= found.error)


def test_vectors_and_residuals_are_those_of_the_full_problem(corrector):
    found = corrector.modes(OUTSIDE, steps=3)
    full = corrector.model.problem.at(OUTSIDE)
    mass, damping, stiffness = (m.toarray() for m in (full.mass, full.damping, full.stiffness))
    for k, lam in enumerate(found.values):
        matrix = lam**2 * mass + lam * damping + stiffness
        size = abs(lam) ** 2 * np.abs(mass) + abs(lam) * np.abs(damping) + np.abs(stiffness)
        errors = [
            np.abs(m @ v).max() / (s @ np.abs(v)).max()
            for m, s, v in ((matrix, size, found.right[:, k]), (matrix.T, size.T, found.left[:, k]))
        ]
        assert found.residual[k] == pytest.approx(max(errors), rel=1e-3)
        assert np.linalg.norm(found.right[:, k]) == pytest.approx(1.0)
    assert found.residual.max() < 0.1 * corrector.modes(OUTSIDE, steps=0).residual.max()


def test_where_all_pass_no_step_is_made(corrector):
    found = corrector.modes({}, steps=5)
    assert found.steps == 0
    assert found.passed.all()
    assert found.values == pytest.approx(corrector.model.modes({}).values, rel=1e-12)


def test_what_is_refused(corrector):
    with pytest.raises(CaseError, match="steps"):
        corrector.modes({}, steps=-1)
    with pytest.raises(CaseError, match="no such parameter"):
        corrector.modes({"speed": 1.0})


def test_the_program_corrects_where_errors_are_above_the_bound(tmp_path):
    case = tmp_path / "bench.toml"
    case.write_text(template_text("two-beams"))
    words = ["reduce", str(case), "--box", "mu=0:0.3", "--at", "mu=0.2,0.9", "--json", "--quiet"]
    inside, outside = json.loads(CliRunner().invoke(app, words).stdout)["modes"]
    assert inside["corrections"] == 0
    assert outside["corrections"] > 0
    assert all(inside["passed"] + outside["passed"])
    assert not outside["inside"]
    (_, alone) = json.loads(CliRunner().invoke(app, [*words, "--corrections", "0"]).stdout)["modes"]
    assert alone["corrections"] == 0
    assert not all(alone["passed"])
    exact = complex_modes(build_system(load(case)), 0.9, max_frequency_hz=20e3).frequency_hz[0]
    found = np.array(outside["frequency_hz"])
    assert np.abs(exact[:, None] - found).min(axis=1) == pytest.approx(0, abs=1e-6 * 20e3)


def test_a_small_problem_whose_basis_holds_all_there_is_is_corrected_too(tmp_path):
    case = tmp_path / "bench.toml"
    case.write_text(template_text("two-beams"))
    small = {"bodies.beam1.elements": 6, "bodies.beam2.elements": 9, "temporal.watch": '["beam1.tip"]'}
    words = [w for key, value in small.items() for w in ("--set", f"{key}={value}")]
    words = ["reduce", str(case), *words, "--box", "mu=0:0.5", "--at", "mu=0.2", "--json", "--quiet"]
    found = CliRunner().invoke(app, words)
    assert found.exit_code == 0, found.output
    (modes,) = json.loads(found.stdout)["modes"]
    system = build_system(load(case).with_({"bodies.beam1.elements": 6, "bodies.beam2.elements": 9}))
    exact = complex_modes(system, 0.2, max_frequency_hz=40e3).frequency_hz[0]
    near = np.abs(exact[:, None] - np.array(modes["frequency_hz"])).min(axis=0)
    assert near == pytest.approx(0.0, abs=1e-5 * 40e3)
