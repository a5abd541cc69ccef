"""How many modes lie below a frequency is told beside modes that are exactly of one frequency, as rings have them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp

import stridor as st
from stridor.modal.krylov.kept_factors import KeptFactors
from stridor.modal.krylov.problem import ContactProblem, problem_of
from stridor.modal.krylov.refine import Band, _counted, projected
from stridor.modal.krylov.shifted import Shifted, frictionless_modes, shift_for
from stridor.modal.options import Options

RING = """
[materials.steel]
young_modulus = 5e10
density = 7000.0
poisson_ratio = 0.3
[bodies.a]
type = "solid"
model = "plane strain"
material = "steel"
thickness = 0.02
mesh = { shape = "annulus", inner_radius = 0.03, outer_radius = 0.05, divisions = [1, 5], cells = "quad", sweep_deg = 120.0 }
mass = "consistent"
damping = { mass = 0.0, stiffness = 1e-8 }
sliding = { spin = 20.0 }
[bodies.b]
type = "solid"
model = "plane strain"
material = "steel"
thickness = 0.02
mesh = { shape = "annulus", inner_radius = 0.05, outer_radius = 0.07, divisions = [1, 5], cells = "quad", sweep_deg = 120.0 }
mass = "consistent"
damping = { mass = 0.0, stiffness = 1e-8 }
[supports.o]
at = "b.outer"
fixed = ["x", "y"]
[supports.i]
at = "a.inner"
fixed = ["x", "y"]
[contacts.c]
slave = "a.outer"
master = "b.inner"
stiffness = 1e11
interference = 2e-5
adjust = 1e-4
friction = { law = "coulomb", coefficient = 0.3 }
[modal]
max_frequency_hz = 120e3
[ties.a]
slave = "a.end"
master = "a.start"
rotation = { angle_deg = 120.0 }
[ties.b]
slave = "b.end"
master = "b.start"
rotation = { angle_deg = 120.0 }
"""


def doublets(seed: int) -> tuple[ContactProblem, np.ndarray]:
    """A problem of two springs of contact whose frictionless ω² (n,), the second answer, are in ones, twos and threes."""
    random = np.random.default_rng(seed)
    squares = np.sort(np.repeat(random.uniform(1.0, 100.0, 6), random.integers(1, 4, 6)))
    n = len(squares)
    root = np.eye(n) + 0.3 * random.standard_normal((n, n)) / np.sqrt(n)
    turn, _ = np.linalg.qr(random.standard_normal((n, n)))
    normal, compliance = random.standard_normal((2, n)), random.uniform(0.2, 2.0, 2)
    whole = root.T @ turn @ np.diag(squares) @ turn.T @ root
    stiffness = whole - normal.T @ (normal / compliance[:, None])
    mass, whole = root.T @ root, (whole + whole.T) / 2
    assert np.allclose(sl.eigvalsh(whole, mass), squares, rtol=1e-9)
    return ContactProblem(
        sp.csr_array(mass), sp.csr_array((n, n)), sp.csr_array((stiffness + stiffness.T) / 2), sp.csr_array(normal),
        sp.csr_array(normal), np.ones(2), compliance, np.arange(2), (), False,
    ), squares  # fmt: skip


def tops(squares: np.ndarray) -> np.ndarray:
    """Ends of bands [1/s] between all neighbours, and beside each, below the lowest and above the highest."""
    apart = np.unique(squares.round(9))
    return np.sqrt(np.concatenate([[0.5], (apart[:-1] + apart[1:]) / 2, apart * (1 - 1e-4), apart * (1 + 1e-4), [150.0]]))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("keep", [False, True])
def test_the_count_is_that_of_dense_eigenvalues_wherever_the_band_ends(seed: int, keep: bool) -> None:
    problem, squares = doublets(seed)
    kept = KeptFactors() if keep else None
    for top in tops(squares):
        told = _counted(problem, squares, top, kept)
        assert told is not None
        below = np.count_nonzero(squares < (2 * np.pi * told.below_hz) ** 2)
        assert told.number == told.found == below >= np.count_nonzero(squares <= top**2)


@pytest.mark.parametrize("seed", range(4))
def test_a_mode_of_the_band_that_was_missed_is_noticed(seed: int) -> None:
    problem, squares = doublets(seed)
    for top in tops(squares):
        for k in np.flatnonzero(squares <= top**2):
            told = _counted(problem, np.delete(squares, k), top)
            assert told is not None
            assert told.number == told.found + 1


def test_a_missed_mode_in_the_middle_of_the_widest_gap_is_noticed_in_the_next() -> None:
    """Counting on the mode itself meets a singular matrix, which is no motion that nothing resists."""
    problem, squares = doublets(0)
    top, lowest = 1.001 * np.sqrt(squares[0]), squares[squares < 1.001 * squares[0]]
    missed = (top**2 + 1e4) / 2
    mass, damping, stiffness = (
        sp.csr_array(sp.block_diag([matrix, [[value]]]))
        for matrix, value in ((problem.mass, 1.0), (problem.damping, 0.0), (problem.stiffness, missed))
    )
    rows = sp.csr_array(sp.hstack([problem.normal, sp.csr_array((2, 1))]))
    wider = replace(problem, mass=mass, damping=damping, stiffness=stiffness, normal=rows, slip=rows)
    told = _counted(wider, np.array([*lowest, 1e4, 1.5e4]), top)
    assert told is not None
    assert told.number == wider.size > told.found
    assert _counted(wider, np.array([*lowest, 1e4]), top) is None  # there is no other gap


@pytest.mark.parametrize("seed", range(4))
def test_modes_of_doublets_are_those_of_dense_eigenvalues(seed: int) -> None:
    problem, squares = doublets(seed)
    for top in tops(squares)[::3]:
        reduced = projected(problem, Band(1, float(top)), 0.1)
        found = np.sort(np.abs(reduced.untracked(0.0).values) ** 2)
        inside = squares[squares <= top**2]
        assert np.allclose(found[: len(inside)], inside, rtol=1e-9)


def test_a_ring_whose_modes_above_the_band_are_one_pair_has_modes() -> None:
    ring = st.loads(RING)
    problem = problem_of(st.build_system(ring), 0.0, Options())
    squares = frictionless_modes(Shifted(problem, shift_for(problem, None)), lambda *_: False)[0]
    above = np.sqrt(squares[-2:]) / (2 * np.pi)
    assert np.ptp(above) < 1e-9 * above[0]
    band = 0.5 * float(above[0] + np.sqrt(squares[-3]) / (2 * np.pi))
    reduced = projected(problem, Band(1, 2 * np.pi * band), 0.3)
    assert np.allclose(np.sort(np.abs(reduced.untracked(0.0).values) ** 2)[: len(squares) - 2], squares[:-2], rtol=1e-6)
