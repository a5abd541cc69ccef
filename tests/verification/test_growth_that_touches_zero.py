"""A damping ratio that touches zero and stays positive: no onset, by any source, and none of two that belong together."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.optimize as so
import scipy.sparse as sp

import stridor as st
from stridor.modal.full import onsets_along
from stridor.modal.histories import StabilityChange, beyond_rounding, within_rounding
from stridor.modal.onset import Onset
from stridor.modal.options import Options
from stridor.modal.over_friction import onsets_of_band
from stridor.modal.parametric import Parameter, ParametricProblem, Term, reduce
from stridor.modal.parametric.factors import CONSTANT, Product
from stridor.modal.source import SOURCES
from stridor.system import System

pytestmark = pytest.mark.verification
P = Product((("p", 1.0),))


def passive(seed: int) -> list[tuple[str, np.ndarray]]:
    """M, one dashpot, K and A of a structure with K ≥ 1 and K + A > 0: no mode can grow, and one whose node passes the
    dashpot is undamped there."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 8))
    turned = np.linalg.qr(rng.standard_normal((n, n)))[0]
    stiffness = (turned * rng.uniform(1, 3, n) ** 2) @ turned.T
    change = rng.standard_normal((n, n))
    change = change + change.T
    change *= 0.8 / np.abs(np.linalg.eigvalsh(change)).max()
    damping = np.zeros((n, n))
    damping[0, 0] = rng.uniform(0.01, 0.5)
    return list(zip("MCKA", (np.eye(n), damping, stiffness, change), strict=True))


def case_of(matrices: list[tuple[str, np.ndarray]], folder: Path, factor: str) -> st.Case:
    terms = []
    for name, matrix in matrices:
        sp.save_npz(folder / f"{name}.npz", sp.csr_array(matrix))
        role = {"M": "mass", "C": "damping"}.get(name, "stiffness")
        terms.append({"file": str(folder / f"{name}.npz"), "role": role, **({"factor": factor} if name == "A" else {})})
    parameters = {"parameters": {"p": {"value": 0.3, "range": [0.0, 1.0]}}} if factor == "p" else {}
    return st.Case(bodies={"b": {"type": "matrices", "terms": terms}}, modal={"max_frequency_hz": 1.0}, **parameters)


@pytest.mark.parametrize("seed", [2, 3, 7, 8, 16])
def test_a_node_that_passes_the_dashpot_is_no_onset(seed: int, tmp_path: Path) -> None:
    found = st.onsets(case_of(passive(seed), tmp_path, "mu"))
    assert (found.onsets, found.complete) == ((), True)
    along = st.onsets(case_of(passive(seed), tmp_path, "p"), along="p")
    assert (tuple(along), along.complete) == ((), True)
    roles = {"M": "mass", "C": "damping", "K": "stiffness", "A": "stiffness"}
    terms = tuple(
        Term(sp.csr_array(m), roles[k], P if k == "A" else CONSTANT, symmetric=True) for k, m in passive(seed)
    )
    model = reduce(ParametricProblem(terms, (Parameter("p", 0.0, 1.0, 0.3),)), 1.0, bound=1e-9)
    of_model = onsets_along(model, "p")
    assert (tuple(of_model), of_model.complete) == ((), True)


N, T, OWN = np.array([1.0, 1.0]), np.array([1.0, 2.0]), np.diag([3.0, 3.2])


def bench(rate: float) -> System:
    """Two freedoms on a contact that grow together from μ = 0.53 to 0.85 without damping, and with D = rate M."""
    friction = {"law": "coulomb", "coefficient": 0.5}
    contact = {"normal": N.tolist(), "tangent": T.tolist(), "stiffness": 1.0, "friction": friction}
    return st.System.from_matrices(np.eye(2), rate * np.eye(2), OWN, contacts={"c": contact})


def growth(mu: float, rate: float) -> float:
    """The largest growth rate: λ² + rate λ + ω² = 0 with the undamped ω²."""
    squares = np.linalg.eigvals(OWN + np.outer(N - mu * T, N)).astype(complex)
    return float((-rate / 2 + np.sqrt(rate**2 / 4 - squares)).real.max())


def touching() -> tuple[float, float]:
    """The rate with which the largest growth over μ is zero, and the μ where it is."""

    def summit(rate: float) -> tuple[float, float]:
        found = so.minimize_scalar(lambda mu: -growth(mu, rate), bounds=(0.6, 0.8), method="bounded",
                                   options={"xatol": 1e-12})  # fmt: skip
        return -float(found.fun), float(found.x)

    rate = float(so.brentq(lambda rate: summit(rate)[0], 0.05, 0.5, xtol=1e-16, rtol=1e-15))
    return rate, summit(rate)[1]


@pytest.mark.parametrize("source", [source.name for source in SOURCES])
def test_nor_is_growth_that_damping_just_prevents(source: str) -> None:
    """By every source; with a ten-thousandth less damping it begins and ends beside the place where it touched."""
    rate, at = touching()
    assert abs(growth(at, rate)) < 1e-14
    options = Options(source=source)
    for less in (0.0, 1e-9):  # that leaves growth of 3e-11 |λ|
        found = onsets_of_band(bench((1 - less) * rate), (0.0, 1.0), 1.0, options=options)
        assert (found.source, found.onsets, found.complete) == (source, (), True)
    grows = onsets_of_band(bench((1 - 1e-4) * rate), (0.0, 1.0), 1.0, options=options)
    assert [o.stabilising for o in grows.onsets] == [False, True]
    assert grows.complete
    assert grows.onsets[0].mu < at < grows.onsets[1].mu < grows.onsets[0].mu + 0.01


def onset(mu: float, slope: float) -> Onset:
    return Onset(
        mu, 1 / (2 * np.pi), "flutter", damped=True, stabilising=slope < 0, branches=(2, 3), residual=1e-16,
        square_root_coefficient=None, growth_slope=slope,
    )  # fmt: skip


def quiet(mu: float) -> np.ndarray:
    """λ between beginnings and ends: nothing grows, but for a mode of another frequency."""
    return np.array([-1e-12 + 1j, 0.1 + 2j])


def test_what_counts_is_the_growth_between() -> None:
    """That of the parabola with slopes ±s and width w is s w / 4: 1e-9 of |λ| = 1 is where `modes` begins to count."""
    for width, faint in ((1e-6, True), (3e-3, True), (1e-2, False)):
        begins, ends = onset(0.4, 1e-6), onset(0.4 + width, -1e-6)
        assert within_rounding([begins, ends], quiet) == ({0, 1} if faint else set())
    begins, ends = onset(0.4, 1e-6), onset(0.4 + 1e-6, -1e-6)
    assert not within_rounding([replace(begins, mu=0.5), ends], quiet)  # growth that ends and begins again
    assert not within_rounding([replace(begins, branches=(4, 5)), ends], quiet)
    assert within_rounding([replace(begins, branches=(0, 0)), replace(ends, branches=(0, 0))], quiet) == {0, 1}
    assert not within_rounding([replace(begins, frequency_hz=0.3), ends], quiet)
    # Of two beginnings that is left which is no such growth.
    assert within_rounding([onset(0.2, 1e-3), begins, ends], quiet) == {1, 2}
    changes = [StabilityChange(o.mu, (1,), o) for o in (onset(0.2, 1e-3), begins, ends)]
    assert beyond_rounding(changes, quiet) == [0]


def test_growth_between_that_slopes_do_not_tell_is_growth() -> None:
    """Slopes of 1e-6 over a width of 1e-6, and yet more than that in between."""
    begins, ends = onset(0.4, 1e-6), onset(0.4 + 1e-6, -1e-6)
    assert within_rounding([begins, ends], lambda mu: np.array([1e-3 + 1j])) == set()


@pytest.mark.parametrize("source", [source.name for source in SOURCES])
def test_two_modes_that_meet_and_part_with_next_to_no_damping(source: str) -> None:
    """They grow by 2 % of |λ| in between; where growth begins and ends, far from where they meet, its slope is 5e-9."""
    normal, tangent, own = np.array([1.0, 0.05]), np.array([1.0, 1.0]), np.diag([2.0, 2.5])
    damping = 3e-10 * np.diag([1.0, 0.5])
    friction = {"law": "coulomb", "coefficient": 0.5}
    contact = {"normal": normal.tolist(), "tangent": tangent.tolist(), "stiffness": 1.0, "friction": friction}
    system = st.System.from_matrices(np.eye(2), damping, own, contacts={"c": contact})
    found = onsets_of_band(system, (0.0, 1.0), 1 / np.pi, options=Options(source=source))
    if found.complete:
        assert [o.stabilising for o in found.onsets] == [False, True]
        assert found.onsets[0].mu < 0.3217 < 0.7262 < found.onsets[1].mu
    assert found.complete or source == "krylov"
