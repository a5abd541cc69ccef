"""What is said of imported matrices that have friction in their factors: judged over its range, not at zero alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stridor as st
from matrix_cases import TURN, Term, matrix_case, rubbing
from program import stridor
from stridor.study.matrix_reports import matrix_reports

ONE = np.eye(2)
OBLIQUE = np.array([[2.0, 1.0], [1.0, 2.0]])
BELT = np.array([[0.0, -4 / 3], [0.0, 0.0]])
LOST = "K is symmetric: without friction terms in it, no modes can couple to flutter"


def terms(factor: str, belt: np.ndarray = BELT) -> list[Term]:
    return [(ONE, "mass", ""), (OBLIQUE, "stiffness", ""), (belt, "stiffness", factor)]


def test_friction_is_sought_where_it_is(tmp_path: Path) -> None:
    case = matrix_case(tmp_path, terms("mu"), 1.0, (0.0, 0.5))
    (report,) = matrix_reports(case).values()
    assert (report.mu, dict(report.ranks)) == (0.5, {0.0: 0, 0.5: 2})
    assert LOST not in report.matrices.warnings
    assert report.lines()[0] == "mu is in factors: looked at mu = 0.5; rank of K − Kᵀ at mu = 0: 0, mu = 0.5: 2"
    done = stridor("matrices", "case.toml", cwd=tmp_path)
    assert done.returncode == 0
    assert "K − Kᵀ has rank 2" in done.stdout
    assert "warning" not in done.stdout
    # Asked for one μ it is that.
    (still,) = matrix_reports(case, 0.0).values()
    assert (still.mu, still.matrices.coupling, LOST in still.matrices.warnings) == (None, 0, True)


def test_friction_that_is_lost_at_every_friction_is_told(tmp_path: Path) -> None:
    (report,) = matrix_reports(matrix_case(tmp_path, terms("mu", BELT + BELT.T), 1.0)).values()
    assert dict(report.ranks) == {0.0: 0, 1.0: 0}
    assert LOST in report.matrices.warnings


def test_friction_of_contacts_that_the_case_makes_is_not_missed_in_the_matrices(tmp_path: Path) -> None:
    case = rubbing(tmp_path, 0.0)
    (report,) = matrix_reports(case, 0.3).values()
    assert report.contacts == tuple(case.contacts)
    assert not any("friction" in warning for warning in report.matrices.warnings)
    assert f"K is symmetric: friction is that of contacts.{report.contacts[0]}, which the case makes" in report.lines()
    (report,) = matrix_reports(rubbing(tmp_path, 1.0), 0.3).values()
    assert not any("K is symmetric" in line for line in report.lines())


def test_factors_without_a_value_at_an_end(tmp_path: Path) -> None:
    (report,) = matrix_reports(matrix_case(tmp_path, terms("1/mu"), 1.0)).values()
    assert (report.mu, dict(report.ranks)) == (1.0, {1.0: 2})


def test_matrices_without_mu_say_nothing_of_it(tmp_path: Path) -> None:
    (report,) = matrix_reports(matrix_case(tmp_path, terms(""), 1.0)).values()
    assert report.mu is None
    assert report.lines() == report.matrices.lines()


@pytest.mark.parametrize(
    ("made", "more", "purpose", "in_time"),
    [
        (terms("mu"), "", "mu is in factors of matrices: for `stridor onsets` (mu from 0 to 1, modal.friction_range), ",
         "time loops do not: factors of imported matrices depend on mu"),
        (terms(""), "", "no contact, and mu in no factor: for `stridor modes`, `stridor sensitivities` and "
         "`stridor countermeasures`; there is no critical mu to solve for", "time step "),
        ([*terms("")[:2], (TURN, "damping", "2*Omega")], "parameters.Omega = { value = 1.0 }", "no contact, and mu in no "
         "factor: for `stridor modes`, `stridor sensitivities` and `stridor countermeasures`, and `stridor onsets --along "
         "Omega`; there is no critical mu to solve for", "time step "),
    ],
)  # fmt: skip
def test_check_says_what_they_are_for(tmp_path: Path, made: list[Term], more: str, purpose: str, in_time: str) -> None:
    lines = st.describe(matrix_case(tmp_path, made, 1.0, more=more)).lines
    assert any(line.startswith(purpose) for line in lines), lines
    assert any(in_time in line for line in lines), lines
