"""Growth that begins and ends again within one step of following: two modes whose squares pass each other while friction
couples them with different signs grow in an island as narrow as the coupling is weak. The truth is dense eigenvalues."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as sl
from scipy.optimize import brentq

import stridor as st
from benches import full_eigenvalues
from stridor.modal.full import search
from stridor.modal.options import Options
from stridor.modal.over_friction import onsets_of_band
from stridor.system import System

pytestmark = pytest.mark.verification

RUN = range(0, 4)
MORE = [pytest.param(range(k, k + 40), marks=pytest.mark.slow) for k in (4, *range(14, 414, 40))]
HZ = 3000.0  # above everything there is
NOTHING = 1e-9  # of |λ|


def island(seed: int) -> tuple[tuple[np.ndarray, ...], float, float]:
    """M, D, K and F, and where an island lies and how wide about it is."""
    rng = np.random.default_rng([seed, 365])
    n, squares = int(rng.integers(4, 13)), None
    squares = (2 * np.pi * np.sort(rng.uniform(20, 800, n))) ** 2
    first, place, width = int(rng.integers(n - 1)), float(rng.uniform(0.05, 0.95)), float(10 ** rng.uniform(-3, -1.3))
    pair, slope, share = [first, first + 1], (squares[first + 1] - squares[first]) / place, float(rng.uniform(0, 1))
    friction = np.zeros((n, n))
    # Growth where |difference − slope μ| < 2 c μ.
    c = slope * width / (4 * place)
    friction[np.ix_(pair, pair)] = [[share * slope, c], [-c, -(1 - share) * slope]]
    if rng.random() < 0.5:
        friction += rng.normal(size=(n, n)) * 0.02 * np.median(squares)
    shape = np.eye(n) + 0.3 * rng.normal(size=(n, n)) / np.sqrt(n)
    damping = 10 ** rng.uniform(-2, 0.3) * np.eye(n) * (rng.random() > 0.2)
    return tuple(shape.T @ a @ shape for a in (np.eye(n), damping, np.diag(squares), friction)), place, width


def case_of(matrices: tuple[np.ndarray, ...], folder: Path) -> st.Case:
    terms = []
    for name, matrix in zip("MDKF", matrices, strict=True):
        np.save(folder / f"{name}.npy", matrix)
        role = {"M": "mass", "D": "damping"}.get(name, "stiffness")
        factor = {"factor": "mu"} if name == "F" else {}
        if np.any(matrix):
            terms.append({"file": str(folder / f"{name}.npy"), "role": role, **factor})
    return st.Case(bodies={"b": {"type": "matrices", "terms": terms}}, modal={"max_frequency_hz": HZ})


def growing(matrices: tuple[np.ndarray, ...], mu: float) -> int:
    mass, damping, stiffness, friction = matrices
    n, unit = len(mass), 2 * np.pi * 300
    k, d = (np.linalg.solve(mass, a) for a in (stiffness + mu * friction, damping))
    values = sl.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-k / unit**2, -d / unit]]))
    return int(np.sum(values.real > (NOTHING if np.any(damping) else 1e-6) * np.abs(values)))


def differences(matrices: tuple[np.ndarray, ...], found: st.Onsets, values: np.ndarray) -> list[float]:
    """Values at which another number of roots grows than the onsets say."""
    start = growing(matrices, 0.0)
    return [
        float(mu) for mu in values
        if not any(abs(o.mu - mu) < 1e-6 for o in found)
        and growing(matrices, mu) != start + sum(o.roots for o in found if o.mu < mu)
    ]  # fmt: skip


@pytest.mark.parametrize("seeds", [RUN, *MORE], ids=lambda seeds: f"from {seeds[0]}")
def test_islands_are_seen(seeds: range, tmp_path: Path) -> None:
    there, wrong = 0, list[str]()
    for seed in seeds:
        matrices, place, width = island(seed)
        found = st.onsets(case_of(matrices, tmp_path))
        assert found.complete
        values = np.clip(place + width * np.linspace(-3, 3, 61), 0.0, 1.0)
        there += len({growing(matrices, mu) for mu in values}) > 1
        even = (np.arange(240) + 0.5) / 240
        other = differences(matrices, found, np.unique(np.concatenate([values, even])))
        wrong += [f"{seed}: at {other[0]} to {other[-1]}"] if other else []
    assert there >= len(seeds) // 3, "islands are what this is about"
    assert not wrong, "\n".join(wrong)


def test_one_that_begins_beside_another_that_grows(tmp_path: Path) -> None:
    """The squares 1e4 μ − 6e3 ± √(1e6 − (1200 μ)²) pass zero one after the other; from μ = 0.83 on they are a pair."""
    friction = np.array([[-1e4, 1200.0], [-1200.0, -1e4]])
    found = st.onsets(case_of((np.eye(2), 0.01 * np.eye(2), np.diag([5e3, 7e3]), friction), tmp_path))
    assert [(o.kind, o.roots) for o in found] == [("divergence", 1)] * 2
    first, second = (o.mu for o in found)
    said = f" Of the growing motions without oscillation, at μ = {second:.6g} one begins and another grows already."
    assert said in found.completeness
    assert f"{first:.6g}" not in found.completeness


def test_how_closely_that_was_looked_at_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A symmetric pair that never meets: nothing is foretold, and the even values are counted."""
    plain = (np.eye(2), 0.1 * np.eye(2), np.diag([1e4, 9e4]), np.diag([1e3, 2e3]))
    said = st.onsets(case_of(plain, tmp_path)).completeness
    assert said.startswith("Complete as far as both ends tell: 0 modes grow at μ = 0 and 0 at μ = 1")
    assert said.endswith(
        "As many roots grow at each of 97 values of μ as the onsets say; growth that begins and ends again, or ends and "
        "begins, between two of these values may be missing."
    )

    def uncounted(*_: object) -> None:
        return None

    monkeypatch.setattr(search, "_borne_out", uncounted)
    said = st.onsets(case_of(plain, tmp_path)).completeness
    assert said.endswith(
        "Between the ends nothing was counted: growth that begins and ends again, or ends and begins, within one of the "
        "steps may be missing."
    )


def passing_pair(seed: int) -> tuple[System, float, float]:
    """A contact whose friction takes a mode past another, lightly damped, and where they pass and how far about they are
    one: K + k_c n nᵀ − μ k_c t nᵀ with n = (1, e, …), t = (τ, δ, …), squares equal at μ₀, growth where
    |μ − μ₀| < 2 √(e (1 − μ₀τ) (μ₀δ − e)) / τ without damping."""
    rng = np.random.default_rng([seed, 71])
    n, weak, turn, side = int(rng.integers(2, 7)), float(10 ** rng.uniform(-6, -2.5)), float(rng.uniform(0.5, 0.9)), 1.0
    squares = np.concatenate([[4.0, 0.0], rng.uniform(9.0, 30.0, n - 2)])
    place = float(rng.uniform(0.15, 0.85))
    squares[1] = 4.0 + 1.0 - place * turn
    normal, tangent = weak * rng.standard_normal((2, n))
    normal[:2], tangent[:2] = (1.0, weak), (turn, side)
    width = 2 * np.sqrt(weak * (1 - place * turn) * place * side) / turn
    growth = np.sqrt(weak * (1 - place * turn) * place * side) / (2 * np.sqrt(squares[1]))
    damping = 2 * growth * float(10 ** rng.uniform(-4, -0.3)) * np.diag(rng.uniform(0.5, 1.0, n))
    contact = {"normal": normal, "tangent": tangent, "stiffness": 1.0, "slip": 1.0, "friction": {"law": "coulomb", "coefficient": 0.3}}
    return System.from_matrices(np.eye(n), damping, np.diag(squares), contacts={"c": contact}), place, width


def ends_of_growth(system: System, place: float, width: float) -> list[float]:
    """Where growth begins and ends about a place, by dense eigenvalues."""

    def growth(mu: float) -> float:
        return float(full_eigenvalues(system, mu).real.max())

    grid = np.linspace(place - 3 * width, place + 3 * width, 241)
    rates = [growth(mu) for mu in grid]
    return [brentq(growth, a, b, xtol=1e-14) for (a, b), (r, s) in zip(pairwise(grid), pairwise(rates), strict=True) if r * s < 0]


@pytest.mark.parametrize("source", ["krylov", "reduced", "receptance"])
@pytest.mark.parametrize("seeds", [range(8), pytest.param(range(8, 300), marks=pytest.mark.slow)], ids=["few", "many"])
def test_damped_modes_that_pass_each_other_grow_in_between(seeds: range, source: str) -> None:
    whole = 0
    for seed in seeds:
        system, place, width = passing_pair(seed)
        expected = ends_of_growth(system, place, width)
        assert len(expected) == 2, f"seed {seed}: {expected} about {place}"
        found = onsets_of_band(system, (0.0, 1.0), 1.0, options=Options(source=source))
        if not found.complete:
            continue
        whole += 1
        said = [o.mu for o in found]
        assert said == pytest.approx(expected, abs=1e-3 * width + 1e-9), f"seed {seed}, about {width:.1e} wide"
        assert [o.stabilising for o in found] == [False, True]
    assert whole >= 0.9 * len(seeds)


@pytest.mark.parametrize("weak", [1e-8, 1e-9, 1e-11])
@pytest.mark.parametrize("decay", [0.3, 0.9])
def test_one_beside_modes_that_are_one(weak: float, decay: float) -> None:
    """Two more contacts see modes of one frequency, which the receptance does not tell apart: the full problem is
    followed, as a count at some values misses an island."""
    place, turn = 0.45, 0.8
    squares, slip = np.array([4.0, 5.0 - place * turn, 9.0, 9.0, 9.0]), {"slip": 1.0, "stiffness": 1.0}
    law = {"friction": {"law": "coulomb", "coefficient": 0.3}}
    rows = {"c": ([1.0, weak, 0.0, 0.0, 0.0], [turn, 1.0, 0.0, 0.0, 0.0])}
    rows |= {f"d{k}": (np.eye(5)[2 + k], 0.1 * np.eye(5)[2 + k]) for k in range(2)}
    contacts = {name: {"normal": n, "tangent": t, **slip, **law} for name, (n, t) in rows.items()}
    root = np.sqrt(weak * (1 - place * turn) * place)
    damping = decay * root / (2 * np.sqrt(squares[1])) * np.eye(5)
    system = System.from_matrices(np.eye(5), damping, np.diag(squares), contacts=contacts)
    expected = ends_of_growth(system, place, 2 * root / turn)
    found = onsets_of_band(system, (0.0, 1.0), 1.0)
    assert found.source == "full"
    assert found.complete, found.completeness
    assert [o.mu for o in found] == pytest.approx(expected, abs=1e-3 * root + 2e-9)
