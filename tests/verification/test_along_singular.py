"""Onsets along a parameter of matrices that are singular: no mass somewhere, multipliers, motions as a whole, no mode in
the band. The truth is QZ of the companion pencil on a grid."""

from __future__ import annotations

import json
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import stridor as st
from matrix_cases import matrix_case
from program import stridor
from random_singular import KINDS, disagreement, singular
from stridor.modal.full import ParametricOnsets, onsets_along

pytestmark = pytest.mark.verification

Q = "[parameters]\nq = { value = 0.5, range = [0.0, 3.0] }"
TURN = np.array([[0.0, -4.0], [4.0, 0.0]])


def circulatory(n: int) -> np.ndarray:
    """The first two freedoms driving one another."""
    matrix = np.zeros((n, n))
    matrix[:2, :2] = TURN
    return matrix


def case_of(folder: Path, mass: object, stiffness: object, friction: object, hz: float = 3.0) -> st.Case:
    terms = [(mass, "mass", ""), (stiffness, "stiffness", ""), (friction, "stiffness", "q")]
    return matrix_case(folder, terms, hz, more=Q)


def both_ways(case: st.Case, high: float = 3.0) -> list[ParametricOnsets]:
    """By the analysis of its own, and on the model that `reduce` makes; nothing is warned of by the libraries."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        return [st.onsets(case, along="q"), onsets_along(st.reduced_model(case, {"q": (0.0, high)}), "q")]


def meeting(squares: np.ndarray, slope: float) -> float:
    """q at which −λ² of [a, b; b, c] + q[0, −s; s, 0] meet: (a − c)²/4 + b² = s²q²."""
    return float(np.sqrt((squares[0, 0] - squares[1, 1]) ** 2 / 4 + squares[0, 1] ** 2) / slope)


def test_a_freedom_without_mass(tmp_path: Path) -> None:
    """It follows the others, and leaves them their stiffness less what it takes."""
    stiffness = np.array([[20.0, 4.0, -3.0], [4.0, 15.0, -2.0], [-3.0, -2.0, 10.0]])
    left = stiffness[:2, :2] - np.outer(stiffness[:2, 2], stiffness[2, :2]) / 10.0
    for found in both_ways(case_of(tmp_path, np.diag([1.0, 1.0, 0.0]), stiffness, circulatory(3))):
        (onset,) = found
        assert onset.value == pytest.approx(meeting(left, 4.0), rel=1e-9)
        assert onset.frequency_hz == pytest.approx(np.sqrt(np.trace(left) / 2) / (2 * np.pi), rel=1e-9)
        assert found.complete


def test_a_multiplier(tmp_path: Path) -> None:
    """Of u₀ = u₂, which makes one body of two masses."""
    stiffness = np.zeros((4, 4))
    stiffness[:3, :3] = [[20.0, 4.0, 0.0], [4.0, 15.0, 0.0], [0.0, 0.0, 3.0]]
    stiffness[3, [0, 2]] = stiffness[[0, 2], 3] = 1.0, -1.0
    case = case_of(tmp_path, np.diag([1.0, 1.0, 1.0, 0.0]), stiffness, circulatory(4))
    # M = diag(2, 1), K = [23, 4; 4, 15]: scaled by the root of the mass.
    left = np.array([[23.0 / 2, 4.0 / np.sqrt(2)], [4.0 / np.sqrt(2), 15.0]])
    own, reduced = both_ways(case)
    for found in (own, reduced):
        assert [o.value for o in found] == pytest.approx([meeting(left, 4.0 / np.sqrt(2))], rel=1e-9)
        assert found.complete
        assert "in the reduced model" not in found.sentence
    assert not own.notes
    assert reduced.notes == (
        "all is solved in the full problem, there is no reduced model: some freedoms have neither stiffness nor mass of "
        "their own, as multipliers have it",
    )
    model = st.reduced_model(case, {"q": (0.0, 3.0)})
    assert model.modes({"q": 1.0}).passed.all()
    assert [bool(model.modes({"q": q}).unstable.any()) for q in (0.0, 1.17, 1.18, 3.0)] == [False, False, True, True]


def test_no_mode_in_the_band(tmp_path: Path) -> None:
    case = case_of(tmp_path, np.eye(3), 1e4 * np.diag([20.0, 15.0, 10.0]), circulatory(3))
    for found in both_ways(case):
        assert (len(found), found.complete) == (0, True)
    assert not len(st.reduced_model(case, {"q": (0.0, 3.0)}).modes({"q": 2.0}).values)


@pytest.mark.parametrize("damping", [0.0, 3.0])
def test_no_mode_in_the_band_of_many_freedoms(tmp_path: Path, damping: float) -> None:
    """What has to be reduced, with dashpots or without."""
    n = 80
    chain = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    case = case_of(tmp_path, np.eye(n), 1e6 * np.eye(n) + 1e4 * chain, circulatory(n))
    if damping:
        terms = [(np.eye(n), "mass", ""), (1e6 * np.eye(n) + 1e4 * chain, "stiffness", ""),
                 (damping * chain, "damping", ""), (circulatory(n), "stiffness", "q")]  # fmt: skip
        case = matrix_case(tmp_path, terms, 3.0, more=Q)
    for found in both_ways(case):
        assert (len(found), found.complete) == (0, True)


def free_chain(n: int) -> tuple[np.ndarray, np.ndarray]:
    """K of n masses held nowhere, and what drives the ends and changes no motion as a whole."""
    stiffness = 20.0 * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    stiffness[0, 0] = stiffness[-1, -1] = 20.0
    stiffness[-1, -1] = 30.0
    stiffness[-2, -2] += 10.0
    stiffness[-1, -2] = stiffness[-2, -1] = -30.0
    one, other = np.zeros(n), np.zeros(n)
    one[:2], other[-2:] = (1.0, -1.0), (1.0, -1.0)
    return stiffness, 6.0 * (np.outer(one, other) - np.outer(other, one))


@pytest.mark.parametrize("n", [4, 64])  # all freedoms kept, and a reduced model
def test_motions_as_a_whole_do_not_grow(tmp_path: Path, n: int) -> None:
    stiffness, friction = free_chain(n)
    case = case_of(tmp_path, np.eye(n), stiffness, friction, 3.0)
    model = st.reduced_model(case, {"q": (0.0, 3.0)})
    for q in (0.0, 1.0, 2.0, 3.0):
        dense = np.linalg.eigvals(-stiffness - q * friction)
        grows = bool(np.any(np.abs(np.sqrt(dense[np.abs(dense) > 1e-6] + 0j).real) > 1e-4))
        assert bool(model.modes({"q": q}).unstable.any()) == grows, q
    own, reduced = both_ways(case)
    assert own.complete
    assert reduced.complete
    assert [o.value for o in own] == pytest.approx([o.value for o in reduced], rel=1e-8)


def test_a_free_chain_keeps_a_small_model(tmp_path: Path) -> None:
    """The motion as a whole has a λ of rounding alone, which no cut of the basis can keep."""
    stiffness, friction = free_chain(300)
    model = st.reduced_model(case_of(tmp_path, np.eye(300), stiffness, friction, 0.1), {"q": (0.0, 3.0)})
    assert model.size < 30
    assert model.modes({"q": 1.3}).passed.all()


@pytest.mark.slow
def test_motions_as_a_whole_in_any_basis(tmp_path: Path) -> None:
    """Of them a reduced model's matrices have nothing but rounding, more than a share of their entries."""
    n = 90
    stiffness, friction = free_chain(n)
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((n, n)))[0]
    case = case_of(tmp_path, np.eye(n), turn @ stiffness @ turn.T, turn @ friction @ turn.T, 3.0)
    plain = st.onsets(case_of(tmp_path, np.eye(n), stiffness, friction, 3.0), along="q")
    found = st.onsets(case, along="q")
    assert found.complete
    assert [o.value for o in found] == pytest.approx([o.value for o in plain], rel=1e-7)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seeds", [range(1), pytest.param(range(1, 60), marks=pytest.mark.slow)], ids=str)
def test_random_matrices(kind: str, seeds: Sequence[int], tmp_path: Path) -> None:
    wrong: list[str] = []
    for seed in seeds:
        made = singular(kind, seed)
        folder = tmp_path / str(seed)
        folder.mkdir()
        for found in both_ways(made.case(folder), made.high):
            wrong += [] if found.complete else [f"{made.name}: {found.sentence}"]
            wrong += [words] if (words := disagreement(made, changes(found))) else []
    assert not wrong, "\n".join(wrong)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_random_matrices_that_are_reduced(kind: str, tmp_path: Path) -> None:
    made = singular(kind, 0, freedoms=70)
    for found in both_ways(made.case(tmp_path), made.high):
        assert found.complete, found.sentence
        assert not disagreement(made, changes(found))


@pytest.mark.parametrize(("kind", "seed", "leaves"), [("multipliers", 6, []), ("massless", 2, []), ("rigid", 4, [0.5374])])
def test_the_only_modes_of_a_band_leave_it(kind: str, seed: int, leaves: list[float], tmp_path: Path) -> None:
    """Nothing is left to be followed; what grows is counted. leaves: where a growing mode passes the end of the band."""
    made = singular(kind, seed, band=0.3)
    found = st.onsets(made.case(tmp_path), along="q")
    assert found.complete, found.sentence
    assert not disagreement(made, [*changes(found), *((q, -2) for q in leaves)])
    assert all(f"Of the growing modes 1 leaves the band at q ≈ {q:g}" in found.sentence for q in leaves)


def changes(found: ParametricOnsets) -> list[tuple[float, int]]:
    """Of each onset its value, and by how many more roots grow beyond."""
    return [(o.value, (-1 if o.stabilising else 1) * (1 if o.kind == "divergence" else 2)) for o in found]


def test_the_program_says_what_it_keeps(tmp_path: Path) -> None:
    stiffness = np.zeros((4, 4))
    stiffness[:3, :3] = np.diag([20.0, 15.0, 3.0])
    stiffness[3, [0, 2]] = stiffness[[0, 2], 3] = 1.0, -1.0
    case_of(tmp_path, np.diag([1.0, 1.0, 1.0, 0.0]), stiffness, circulatory(4))
    done = stridor("reduce", "case.toml", "--at", "q=0:3:4", "--onsets", "q", cwd=tmp_path)
    assert (done.returncode, done.stderr.count("RuntimeWarning")) == (0, 0), done.stderr
    assert "4 freedoms, all of them kept" in done.stdout + done.stderr
    assert "Modes of the full model" in done.stdout
    done = stridor("onsets", "case.toml", "--along", "q", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["complete"]
