"""Modes that are one at every friction coefficient: a contact as stiff as the spring along it, where friction couples
two modes one way only. The motion grows with time, not exponentially: no onset, nothing unstable, and an answer soon."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sl

import stridor as st
from stridor.errors import FollowingError
from stridor.modal.dense_problem import Eigenpairs
from stridor.modal.krylov.follow import Follower


def mass_on_belt(stiffness: float, contact: float, damping: float, *, masses: int = 1, source: str = "auto") -> st.Case:
    """Masses on a belt, each on a spring along it and a contact across: K = [[k, μ K_c], [0, K_c]] of each."""
    names = [f"m{i}" for i in range(masses)]
    dashpots = {
        f"{name}{axis}": {"between": (name, "ground"), "direction": direction, "damping": damping}
        for name in names
        for axis, direction in (("x", (1, 0)), ("y", (0, 1)))
    }
    return st.Case(
        units="nondimensional",
        bodies={
            **{name: {"type": "mass", "mass": 1.0 + i, "position": (i, 0)} for i, name in enumerate(names)},
            "belt": {
                "type": "obstacle", "shape": "flat", "point": (0, 0), "normal": (0, 1), "sliding": {"velocity": (-1, 0)}
            },
        },
        springs={name: {"between": (name, "ground"), "direction": (1, 0), "stiffness": stiffness} for name in names},
        dashpots=dashpots if damping else {},
        loads={f"press-{name}": {"at": name, "force": (0, -1)} for name in names},
        contacts={
            f"on-{name}": {
                "slave": name, "master": "belt", "stiffness": contact, "friction": {"law": "coulomb", "coefficient": 0.3}
            }
            for name in names
        },
        modal={"max_frequency_hz": 1.0, "source": source},
    )  # fmt: skip


@pytest.mark.parametrize("source", ["krylov", "full", "reduced"])
@pytest.mark.parametrize("damping", [0.0, 0.02])
@pytest.mark.parametrize("masses", [1, *(pytest.param(n, marks=pytest.mark.slow) for n in (2, 3))])
def test_a_contact_as_stiff_as_its_spring_has_no_onset(source: str, damping: float, masses: int) -> None:
    case = mass_on_belt(1.0, 1.0, damping, masses=masses, source=source)
    mu = [0.0, 0.1, 0.3, 0.9]
    modes = st.modes(case, mu)
    # λ of each mass is that of its spring alone, whatever μ: the matrix is triangular.
    own = 1.0 + np.arange(masses)
    exact = np.repeat((-damping + np.sqrt(damping**2 - 4 * own + 0j)) / (2 * own), 2)
    for row in modes.eigenvalues:
        distance = np.abs(row[:, None] - exact)
        assert distance.min(axis=0).max() < 1e-7  # a double root: the root of rounding
        assert distance.min(axis=1).max() < 1e-7
    assert not modes.unstable.any()
    if damping == 0.0:
        assert np.all(modes.growth_rate == 0.0)
    onsets = st.onsets(case, (0.0, 1.0))
    assert list(onsets) == []
    assert onsets.complete
    assert not onsets.at_end


@pytest.mark.parametrize("apart", [1e-9, 1e-7, 1e-5, 1e-3])
def test_modes_that_are_nearly_one_are_told(apart: float) -> None:
    modes = st.modes(mass_on_belt(1.0 - apart, 1.0, 0.0), [0.0, 0.5])
    found = np.sort(modes.eigenvalues.imag, axis=1)
    truth = np.sqrt(np.sort(sl.eigvals([[1.0 - apart, 0.0], [0.0, 1.0]]).real))
    assert np.abs(found - truth).max() < 1e-7
    assert not modes.unstable.any()


def test_modes_that_meet_and_were_one_without_friction_still_do() -> None:
    """Equal frequencies at μ = 0 that friction takes apart at once: flutter from there on is flutter, not rounding."""
    case = mass_on_belt(1.0, 1.0, 0.0)
    coupled = case.with_({"springs.m0.direction": [0.8, 0.6], "springs.m0.stiffness": 1.0})
    onsets = st.onsets(coupled, (0.0, 1.5))
    # K = k d dᵀ + K_c (n nᵀ + μ t nᵀ), as a dense problem on a fine grid.
    d, grid = np.array([0.8, 0.6]), np.linspace(0.0, 1.5, 3001)[1:]
    grows = [
        np.abs(sl.eigvals(np.outer(d, d) + np.array([[0.0, sign * mu], [0.0, 1.0]])).imag).max() > 1e-6
        for sign in (-1,) for mu in grid
    ]  # fmt: skip
    changes = grid[1:][np.diff(np.array(grows).astype(int)) != 0]
    assert len(changes) == len(onsets) > 0
    assert np.abs(np.array([o.mu for o in onsets]) - changes).max() < 1e-3


def test_branches_that_nothing_tells_apart_are_given_up_soon() -> None:
    class Erratic:
        """Eigenvalues that jump about from one μ to the next, however near."""

        frequency, damped = 1.0, True
        asked = 0

        def eigenpairs(self, mu: float) -> Eigenpairs:
            self.asked += 1
            x = np.array([0.3j, 0.6j]) + 0.2 * np.random.default_rng(self.asked).random(2)
            return Eigenpairs(mu, x, x, np.eye(2, dtype=complex), np.eye(2, dtype=complex), np.zeros(2, complex), 2)

    source = Erratic()
    with pytest.raises(FollowingError, match="cannot be told apart near μ = "):
        Follower(source, longest=0.1).advance(1.0)  # type: ignore[arg-type]
    assert source.asked < 2000
