"""Stability boundaries where growing pairs part on the real axis, which is on no curve: against a closed form, and random
problems against dense eigenvalues."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import stridor as st
from matrix_cases import matrix_case
from stridor.io.seals import seal
from stridor.modal.boundary import carried
from stridor.modal.boundary.curve import Crossing
from stridor.study.boundary_result import Boundary

pytestmark = pytest.mark.verification

RASTER = 120
MIDDLES = (np.arange(RASTER) + 0.5) / RASTER
XS, MUS = 0.5 + 1.5 * MIDDLES, MIDDLES
X = "[parameters]\nx = { value = 1.0, range = [0.5, 2.0] }"
A = 0.5  # growth of the pair
Numbers = tuple[int, int]


def boundary(case: st.Case) -> Boundary:
    return st.stability_boundary(case, "x", "mu", x_range=(0.5, 2.0), y_range=(0.0, 1.0))


def parting(folder: Path) -> st.Case:
    """λ² − 2aλ + k with k = 1 − 1.1 x μ, beside an oscillator that decays: a pair grows where k > a², two roots where
    0 < k < a², one beyond."""
    terms = [
        (np.eye(2), "mass", ""), (np.diag([-2 * A, 0.1]), "damping", ""), (np.diag([1.0, 4.0]), "stiffness", ""),
        (np.diag([-1.1, 0.0]), "stiffness", "mu*x"),
    ]  # fmt: skip
    return matrix_case(folder, terms, 2.0, more=X)


def random_parting(seed: int, folder: Path) -> tuple[st.Case, Callable[[float, float], Numbers]]:
    """Two to four freedoms, some damped and some driven, coupled so strongly that flutter turns into divergence; and how
    many modes and roots grow at x and μ."""
    rng, n = np.random.default_rng([seed, 11]), 2 + seed % 3
    stiffness, damping = np.diag(rng.uniform(300.0, 900.0, n)), np.diag(rng.uniform(-20.0, 30.0, n))
    rubbing = 2000.0 * rng.standard_normal((n, n))
    terms = [(np.eye(n), "mass", ""), (damping, "damping", ""), (stiffness, "stiffness", ""), (rubbing, "stiffness", "mu*x")]

    def grow(x: float, mu: float) -> Numbers:
        state = np.block([[np.zeros((n, n)), np.eye(n)], [-(stiffness + x * mu * rubbing), -damping]])
        values = np.linalg.eigvals(state)
        return int(np.sum((values.real > 1e-9) & (values.imag >= 0))), int(np.sum(values.real > 1e-9))

    return matrix_case(folder, terms, 20.0, more=X), grow


def wrong(seed: int, folder: Path) -> str:
    """What a boundary says otherwise than dense eigenvalues do; "" for nothing.

    Points of curves: how many modes grow on the calm side, and whether none does. Anywhere: a number that so many roots
    can be. Where the number is said to be known it is that of the eigenvalues, but for points nearer to where modes or
    roots change than the finest mesh on which is counted is fine, which are few.
    """
    case, grow = random_parting(seed, folder)
    found, wide = boundary(case), np.array([1.5, 1.0])
    if not found.agree:
        return f"seed {seed}: {found.sentence}"
    for curve in found.curves:
        ways = curve.growth_side[:, None] * np.stack([-curve.tangent_y / wide[1], curve.tangent_x / wide[0]], axis=1)
        ways *= wide / np.hypot(*ways.T)[:, None]
        for x, mu, way, beside in zip(curve.x, curve.y, ways, curve.modes_beside.tolist(), strict=True):
            calm, grown = (grow(x + step * way[0], mu + step * way[1]) for step in (-2e-4, 2e-4))
            alone = grown[1] - calm[1] == (2 if curve.kind == "flutter" else 1)
            if alone and beside != calm[0]:
                return f"seed {seed}: {beside} modes beside x = {x}, mu = {mu}, where {calm[0]} grow"
    for x, mu in np.random.default_rng(seed).uniform((0.5, 0.0), (2.0, 1.0), (150, 2)).tolist():
        said, (_, roots) = found.unstable_modes(x, mu), grow(x, mu)
        if not (roots + 1) // 2 <= said <= roots:
            return f"seed {seed}: {said} modes at x = {x}, mu = {mu}, where {roots} roots grow"
    table, known = found.shading(XS, MUS)
    true = np.array([[grow(x, mu) for mu in MUS.tolist()] for x in XS.tolist()])
    off = np.argwhere(known & (table != true[..., 0])).tolist()
    far = [(i, j) for i, j in off if not np.ptp(true[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2], axis=(0, 1)).any()]
    if far or len(off) > 1e-3 * table.size or np.mean(known) < 0.96:
        return f"seed {seed}: shading is off at {len(off)} points, first {off[:1]}, and known at {np.mean(known):.2%}"
    return ""


@pytest.fixture(scope="module")
def parted(tmp_path_factory: pytest.TempPathFactory) -> Boundary:
    """The boundary of `parting`."""
    return boundary(parting(tmp_path_factory.mktemp("parting")))


def test_one_root_of_a_pair_that_parted_bounds_nothing_calm(parted: Boundary) -> None:
    """Beyond the divergence curve the other root grows on: no point of it is outer."""
    found = parted
    assert found.agree
    assert [curve.kind for curve in found.curves] == ["divergence"]
    (curve,) = found.curves
    assert curve.x * curve.y == pytest.approx(np.full(len(curve.x), 1 / 1.1), rel=1e-9)
    assert curve.modes_beside.tolist() == [1] * len(curve.x)
    assert not curve.outer.any()
    k = 1 - 1.1 * XS[:, None] * MUS
    true = np.where((k > 0) & (k < A**2), 2, 1)
    table, known = found.shading(XS, MUS)
    assert np.array_equal(table[known], true[known])
    assert np.mean(known) >= 0.97
    assert known[k < 0].all()  # one root is one mode
    assert [found.unstable_modes(x, mu) for x, mu in ((1.0, 0.3), (1.5, 0.55), (1.9, 0.9))] == [1, 2, 1]
    assert {c.roots for c in found.counted} == {1, 2}


@pytest.mark.parametrize("seed", [42])  # weekly with 119 others
def test_random_problems_whose_flutter_turns_into_divergence(tmp_path: Path, seed: int) -> None:
    assert not wrong(seed, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 120, 20))
def test_many_random_problems_whose_flutter_turns_into_divergence(tmp_path: Path, first: int) -> None:
    told = [wrong(seed, tmp_path) for seed in range(first, first + 20)]
    assert not any(told), "\n".join(filter(None, told))


@pytest.mark.parametrize(
    ("modes", "roots", "steps", "beyond"),
    [
        (1, 2, [-1], (1, 1, True)),  # a pair parts, one of its roots ceases to grow
        (1, 2, [-1, 1], (2, 2, True)),  # and grows again
        (2, 2, [-2], (0, 0, True)),  # two roots meet, and decay as a pair
        (2, 3, [-1], (1, 2, False)),
        (3, 3, [-2], (1, 1, True)),
        (3, 3, [-2, 2], (2, 3, True)),
        (0, 0, [2, 1, -1, -2], (0, 0, False)),
        (0, 0, [-2, 2], (0, 0, False)),  # growth left the band before it came to the curve
    ],
)
def test_roots_are_conserved_over_curves_and_modes_are_not(
    modes: int, roots: int, steps: list[int], beyond: tuple[int, int, bool]
) -> None:
    assert carried(modes, roots, [Crossing(0.1 * k, 0.0, 0, 1.0, step) for k, step in enumerate(steps)]) == beyond


def without_roots(found: Boundary, file: Path, **changed: object) -> Path:
    """The file of a boundary whose counted points do not say how many roots their modes are, or something else."""
    data = found.to_xarray()
    document = json.loads(data.attrs["boundary"])
    for place in document["counted"]:
        del place["roots"]
        place |= changed
    seal(data.assign_attrs({"boundary": json.dumps(document)})).to_netcdf(file, engine="h5netcdf")
    return file


def test_files_whose_counts_do_not_tell_roots_are_read_as_they_were(tmp_path: Path) -> None:
    terms = [
        (np.eye(2), "mass", ""), (np.array([[2.0, 1.0], [1.0, 2.5]]), "stiffness", ""), (0.2 * np.eye(2), "damping", ""),
        (np.array([[0.0, -1.0], [0.0, 0.0]]), "stiffness", "2*mu*x"),
    ]  # fmt: skip
    found = boundary(matrix_case(tmp_path, terms, 1.0, more=X))
    assert found.curves
    assert st.open(st.save(found, tmp_path / "now.nc")).counted == found.counted
    before = st.open(without_roots(found, tmp_path / "boundary.nc"))
    assert isinstance(before, Boundary)
    assert {c.roots for c in before.counted} == {None}
    for one, other in zip(before.shading(XS, MUS), found.shading(XS, MUS), strict=True):
        assert np.array_equal(one, other)
    assert [before.unstable_modes(1.9, mu) for mu in (0.1, 0.9)] == [found.unstable_modes(1.9, mu) for mu in (0.1, 0.9)] == [0, 1]


@pytest.mark.bad_input
@pytest.mark.parametrize("roots", [0, 3, 1.5, "two"])
def test_roots_that_cannot_be_so_many_modes_are_refused(tmp_path: Path, roots: object, parted: Boundary) -> None:
    file = without_roots(parted, tmp_path / "boundary.nc", roots=roots, unstable_modes=1)
    with pytest.raises(st.CaseError, match="damaged or changed"):
        st.open(file)
