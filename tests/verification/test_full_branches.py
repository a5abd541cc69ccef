"""Modes of imported matrices over several μ: numbers follow branches, as those of meshed models do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as sl

import stridor as st
from benches import paper_case
from matrix_cases import TURN, export, exported, matrix_case
from solid_cases import case, slider
from stridor.errors import AnalysisError
from stridor.modal import full
from stridor.modal.complex_modes import complex_modes
from stridor.modal.full.basis import Projected, Whole, along
from stridor.modal.full.family import SystemFamily
from stridor.modal.full.follow import followed
from stridor.modal.krylov import Options
from stridor.system import build_system

pytestmark = pytest.mark.verification

FOLLOWED = "Numbers are those by frequency at μ = 0, from where branches were followed."


def assert_same_branches(structured: st.Case, imported: st.Case, mus: list[float], rel: float, **options) -> None:
    ours, theirs = (st.modes(c, mus, **options) for c in (structured, imported))
    assert_same(ours, theirs, rel)


def assert_same(ours: st.ComplexModes, theirs: st.ComplexModes, rel: float) -> None:
    width = ours.eigenvalues.shape[1]
    assert theirs.branch[:width].tolist() == ours.branch.tolist()
    inside = np.isfinite(theirs.eigenvalues[:, :width])
    assert inside.mean() > 0.9  # the others have left the band
    away = np.abs(theirs.eigenvalues[:, :width] - ours.eigenvalues) / np.abs(ours.eigenvalues)
    assert away[inside].max() < rel
    assert np.nanmax(theirs.residual) < 1e-10
    assert all(s.endswith(FOLLOWED) for s in theirs.completeness)


@pytest.mark.parametrize("damped", [pytest.param(True, marks=pytest.mark.slow), False])
def test_branches_of_the_bench_pass_through_flutter(tmp_path: Path, damped: bool):
    """Modes 8 and 10 meet beside 9, which they cross; the growing one keeps its number."""
    bench = paper_case()
    mus = [0.5, 0.0, 0.0768, 0.15]
    # The mode at 102 Hz carries the rounding of K_c = 1e10 N/m: 1.0e-8 of it between two solvers, all others 1e-10.
    assert_same_branches(bench, export(tmp_path, bench), mus, 2e-8, max_frequency_hz=30e3, damped=damped)


def test_branches_that_meet_part_and_meet_others(tmp_path: Path):
    block = case(slider(space=False, stiffness=1e12))
    mus, band = [0.0, 0.3, 0.42, 0.9], 20e3
    # The nodes that touch at the case's own friction at every μ, as what was exported has them.
    ours = complex_modes(build_system(block), np.array(mus), max_frequency_hz=band)
    assert_same(ours, st.modes(export(tmp_path, block), mus, max_frequency_hz=band, check=False), 1e-8)


def test_one_friction_coefficient_alone_has_the_numbers_of_many(tmp_path: Path):
    """Two crossing modes: what is highest at μ = 1 was lowest at 0."""
    terms = [
        (np.eye(3), "mass", ""),
        (np.diag([1.0, 4.0, 9.0]), "stiffness", ""),
        (np.diag([12.0, 1.0, 0.0]), "stiffness", "mu"),
        (0.01 * sl.block_diag(TURN, 0.0), "stiffness", ""),
    ]
    model = matrix_case(tmp_path, terms, 1.0)
    alone, many = st.modes(model, 1.0), st.modes(model, [0.0, 0.25, 0.5, 1.0])
    assert alone.eigenvalues[0] == pytest.approx(many.eigenvalues[-1], rel=1e-12)
    omega = many.eigenvalues.imag
    assert np.argsort(omega[0]).tolist() == [0, 1, 2]
    assert np.argsort(omega[-1]).tolist() == [1, 2, 0]
    assert omega[-1] == pytest.approx(np.sqrt([13.0, 5.0, 9.0]), rel=1e-4)
    assert all(s.endswith(FOLLOWED) for s in (*alone.completeness, *many.completeness))
    # At μ = 0 nothing needs to be followed.
    assert not st.modes(model, 0.0).completeness[0].endswith(FOLLOWED)
    few = st.modes(model, [0.0, 1.0], count=2)
    assert few.branch.tolist() == [1, 2]
    assert few.eigenvalues[1] == pytest.approx(many.eigenvalues[-1, :2], rel=1e-12)


def test_a_branch_beyond_the_band_is_not_there_and_one_that_comes_gets_a_number(tmp_path: Path):
    terms = [
        (np.eye(3), "mass", ""),
        (np.diag([1.0, 4.0, 9.0]), "stiffness", ""),
        (np.diag([0.0, 10.0, -8.0]), "stiffness", "mu"),
        (0.01 * sl.block_diag(TURN, 0.0), "stiffness", ""),
    ]
    found = st.modes(matrix_case(tmp_path, terms, 2.5 / (2 * np.pi)), [0.0, 0.5, 1.0])
    there = [[True, True, False], [True, False, True], [True, False, True]]
    assert np.isfinite(found.eigenvalues).tolist() == there
    assert found.eigenvalues.imag[2, 2] == pytest.approx(1.0, rel=1e-3)
    assert [len(row) for row in found.to_json()["modes"]] == [2, 2, 2]
    assert [m["branch"] for m in found.to_json()["modes"][2]] in ([1, 3], [3, 1])
    assert st.to_dataset(found)["frequency"].shape == (3, 3)


def test_vectors_and_motions_as_a_whole(tmp_path: Path):
    """A free body beside the others: its motion as a whole is the first mode, and vectors go with their branch."""
    pair = 0.7 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    oblique, belt = np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([[0.0, -4 / 3], [0.0, 0.0]])
    terms = [
        (np.eye(4), "mass", ""),
        (sl.block_diag(0.02 * np.eye(2), 0.01 * pair), "damping", ""),
        (sl.block_diag(oblique, pair), "stiffness", ""),
        (sl.block_diag(belt, np.zeros((2, 2))), "stiffness", "mu"),
    ]
    found = st.modes(matrix_case(tmp_path, terms, 1.0), [0.0, 0.5, 1.0], vectors=True)
    assert found.branch.tolist() == [1, 2, 3, 4]
    assert np.abs(found.eigenvalues[:, 0]).max() < 1e-6
    assert found.right is not None
    assert found.left is not None
    for row, mu in enumerate(found.mu):
        stiffness = sl.block_diag(oblique + mu * belt, pair)
        damping = sl.block_diag(0.02 * np.eye(2), 0.01 * pair)
        for k in (1, 2, 3):
            lam = found.eigenvalues[row, k]
            whole = lam**2 * np.eye(4) + lam * damping + stiffness
            assert np.abs(whole @ found.right[row, k]).max() < 1e-12
            assert np.abs(found.left[row, k] @ whole).max() < 1e-12
    # Its other mode, across which friction does nothing, keeps its number where the others have met.
    assert found.eigenvalues[:, 2].imag == pytest.approx(np.sqrt(1.4), rel=1e-4)
    assert found.unstable.tolist() == [[False] * 4, [False] * 4, [False, True, False, False]]


def test_growth_that_is_rounding_is_none(tmp_path: Path):
    """The undamped bench before its first onset: stiff matrices leave real parts of 1e-9 of λ."""
    bench = export(tmp_path, paper_case())
    found = st.modes(bench, [0.0, 0.07], damped=False, count=12)
    assert not found.unstable.any()
    assert np.all(found.growth_rate == 0.0)


def test_numbers_where_branches_cannot_be_followed_are_said_to_count_by_frequency(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    terms = [(np.eye(2), "mass", ""), (np.diag([1.0, 4.0]), "stiffness", ""), (TURN, "stiffness", "mu")]
    model = matrix_case(tmp_path, terms, 1.0)

    def refuse(*_: object) -> None:
        raise AnalysisError("no way")

    with monkeypatch.context() as patch:
        patch.setattr(full.numbers, "along", refuse)
        found = st.modes(model, [0.2, 0.4])
    sentence = "Numbers count by frequency at each μ, since branches were not followed: no way."
    assert all(s.endswith(sentence) for s in found.completeness)
    inverse = matrix_case(tmp_path, [*terms[:2], (TURN, "stiffness", "0.1/mu")], 1.0)
    assert st.modes(inverse, 0.5).completeness[0].endswith("Numbers count by frequency: factors have no value at μ = 0.")
    assert st.modes(inverse, [0.5, 1.0]).completeness[0].endswith(FOLLOWED.replace("μ = 0,", "μ = 0.5,"))


def test_both_ways_to_eigenpairs_lead_along_the_same_branches(tmp_path: Path):
    """On a reduced model and by full solves, with rigid contact taken out of the one and kept in the other."""
    block = case(slider(space=False, stiffness="rigid"))
    system = build_system(block)
    family = SystemFamily(lambda _: system, (0.0, 0.6), Options(), damped=True, own=0.2)
    assert family.eliminated is not None
    frequency = 2 * np.pi * 9e3
    source = along(family, frequency)
    assert isinstance(source, Projected)
    assert source.model is not None
    states = [followed(s, 0.0, 0.6, frequency).high for s in (source, Whole(family, frequency))]
    assert len(states[0].index) == len(states[1].index)
    inside = np.abs(states[1].values) < frequency
    assert states[0].values[inside] == pytest.approx(states[1].values[inside], rel=1e-7)


def test_exported_matrices_are_those_of_the_case():
    """What the other tests rest on: K + μF with contact springs, from one side only."""
    bench = paper_case()
    mass, _, stiffness, friction = (t[0] for t in exported(bench))
    assert abs(stiffness - stiffness.T).max() <= 1e-12 * abs(stiffness).max()
    assert abs(friction - friction.T).max() > 0.1 * abs(friction).max()
    assert np.linalg.matrix_rank(friction.toarray() / abs(friction).max(), tol=1e-9) == 1
    assert mass.shape == (361, 361)


def test_a_sweep_of_large_matrices_takes_few_friction_coefficients(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each is a search of its own there; the case says otherwise where it says how many."""
    case = matrix_case(tmp_path, [(np.eye(2), "mass", ""), (np.eye(2), "stiffness", "1 + mu")], 1.0)

    def swept(case: st.Case) -> int:
        written = st.report(case, tmp_path / "out", mu=0.5, skip=["onsets", "sensitivities", "countermeasures"], fresh=True)
        assert written.everything.sweep_damped is not None
        return len(written.everything.sweep_damped.mu)

    assert swept(case) == 201
    monkeypatch.setattr("stridor.study.modal_parts.SMALL", 1)
    assert swept(case.with_({"title": "large"})) == 21
    assert swept(case.with_({"modal.sweep_points": 5})) == 5
