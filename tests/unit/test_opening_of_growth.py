"""Growth that opens at the low end of the range, of modes that nothing damps there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp

import stridor as st
from matrix_cases import Term, matrix_case
from stridor.errors import AnalysisError
from stridor.modal.full import basis, counted, search
from stridor.modal.full.family import Family
from stridor.modal.full.opening import ORDERS, Opening, _seen, told
from stridor.modal.newton import Root
from stridor.modal.options import Options
from stridor.modal.quadratic import Quadratic
from stridor.study.damping_full import onset_slopes
from stridor.study.workspace import Workspace

UNIT, STIFFNESS = np.eye(2), np.diag([1.0, 4.0])
TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])


def damped(size: float, factor: str = "") -> Term:
    return size * UNIT, "damping", factor


def circulatory(g: float, size: int = 2) -> list[Term]:
    """ω = 1, 2 and so on; μ (1 + gλ) turns the first two: the second grows as g μ²/6·2, the first decays so, or the other
    way round."""
    turn = sl.block_diag(TURN, np.zeros((size - 2, size - 2)))
    return [
        (np.eye(size), "mass", ""), (np.diag(np.arange(1.0, size + 1) ** 2), "stiffness", ""),
        (turn, "stiffness", "mu"), (g * turn, "damping", "mu"),
    ]  # fmt: skip


def onsets_of(folder: Path, terms: list[Term], low: float = 0.0) -> list[tuple[float, float, float | None]]:
    """μ, ω and slope of each up to μ = 0.5 and ω = 2π, where the list is said to be complete and nothing ends."""
    found = st.onsets(matrix_case(folder, terms, 1.0, (low, 0.5)))
    assert found.complete, found.completeness
    assert not any(o.stabilising for o in found.onsets)
    return [(o.mu, 2 * np.pi * o.frequency_hz, o.growth_slope) for o in found.onsets]


def alone(*terms: Term) -> list[Term]:
    return [(UNIT, "mass", ""), (STIFFNESS, "stiffness", ""), *terms]


@pytest.fixture(params=[True, False], ids=["followed", "counted"])
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """By branches alone, and where these lead to nothing."""
    if request.param:
        monkeypatch.setattr(search, "counted", None)
        monkeypatch.setattr(search, "_borne_out", lambda *_: None)  # which would turn to it
    else:
        without_branches(monkeypatch)


def without_branches(monkeypatch: pytest.MonkeyPatch) -> None:
    solved = search.solved
    monkeypatch.setattr(search, "solved", lambda *given: ([], solved(*given)[1], False))


# -- that grow from the start on ---------------------------------------------------------------------------------------
# The slowest is more than rounding from μ = 0.36 on.
@pytest.mark.usefixtures("way")
@pytest.mark.parametrize("g", [0.3, -0.3, *(pytest.param(g, marks=pytest.mark.slow) for g in (1e-3, -1e-6, 1e-6)), 5e-8])
def test_the_mode_that_grows_as_a_square_begins_where_the_range_does(g: float, tmp_path: Path) -> None:
    ((mu, omega, slope),) = onsets_of(tmp_path, circulatory(g))
    assert (mu, slope) == (0.0, 0.0)
    np.testing.assert_allclose(omega, 2.0 if g > 0 else 1.0, rtol=1e-12)


def test_a_mode_whose_growth_has_no_slope_where_another_is_damped(tmp_path: Path) -> None:
    """Its growth rate is zero at μ = 0, and the slope of that exactly."""
    ((mu, omega, slope),) = onsets_of(tmp_path, [*circulatory(0.3, 3), (np.diag([0.0, 0.0, 0.1]), "damping", "")])
    assert (mu, slope) == (0.0, 0.0)
    assert omega == pytest.approx(2.0, rel=1e-12)


@pytest.mark.usefixtures("way")
def test_growth_of_a_higher_order(tmp_path: Path) -> None:
    assert [(mu, slope) for mu, _, slope in onsets_of(tmp_path, alone(damped(-2e-3, "mu**3")))] == [(0.0, 0.0)] * 2
    assert onsets_of(tmp_path, alone(damped(2e-3, "mu**3"))) == []


def test_growth_with_a_slope(tmp_path: Path) -> None:
    found = onsets_of(tmp_path, alone(damped(-2e-3, "mu")))
    assert [mu for mu, _, _ in found] == [0.0] * 2
    np.testing.assert_allclose([slope or 0.0 for _, _, slope in found], 1e-3, rtol=1e-9)


@pytest.mark.usefixtures("way")
def test_growth_that_opens_and_ends_again(tmp_path: Path) -> None:
    """Re λ = 1e-3 μ² − 1e-2 μ³ is zero again at μ = 0.1, which is a value that branches are followed to."""
    stiff = np.diag([1.0, 1e4])  # one mode in the band
    terms = [(UNIT, "mass", ""), (stiff, "stiffness", ""), damped(-2e-3, "mu**2"), damped(2e-2, "mu**3")]
    found = st.onsets(matrix_case(tmp_path, terms, 1.0, (0.0, 0.5)))
    assert found.complete
    assert [(round(o.mu, 9), o.stabilising) for o in found.onsets] == [(0.0, False), (0.1, True)]


def test_on_a_reduced_basis_and_by_full_solves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """64 freedoms, four of them in the band; a constraint beside them leaves full solves alone. What the reduced model
    says is held against the full problem."""
    rng = np.random.default_rng(5)
    n, squares = 64, np.concatenate([np.array([1.0, 2.0, 3.0, 4.5]) ** 2, np.linspace(20.0, 200.0, 60) ** 2])
    turn, load = np.linalg.qr(rng.standard_normal((n, n)))[0], 0.05 * rng.standard_normal((n, n))
    stiffness, load = turn @ np.diag(squares) @ turn.T, turn @ (load - load.T) @ turn.T
    tie = np.zeros((n, 1))
    tie[[0, -1], 0] = 1.0, -1.0

    def terms(bound: bool) -> list[Term]:
        def whole(matrix: np.ndarray, tied: float = 0.0) -> np.ndarray:
            return np.block([[matrix, tied * tie], [tied * tie.T, np.zeros((1, 1))]]) if bound else matrix

        return [
            (whole(np.eye(n)), "mass", ""), (whole(stiffness, 1.0), "stiffness", ""), (whole(load), "stiffness", "mu"),
            (whole(0.3 * load), "damping", "mu"),
        ]  # fmt: skip

    for bound, said in ((False, "on a reduced model"), (True, "solved in full at every step")):
        found = st.onsets(matrix_case(tmp_path, terms(bound), 1.0, (0.0, 0.5)))
        assert found.complete
        assert said in found.completeness
        matrices = [sum((0.5 if factor else 1.0) * m for m, r, factor in terms(bound) if r == role)
                    for role in ("mass", "damping", "stiffness")]  # fmt: skip
        size = len(matrices[0])
        first = np.block([[np.zeros((size, size)), np.eye(size)], [-matrices[2], -matrices[1]]])
        values = sl.eigvals(first, sl.block_diag(np.eye(size), matrices[0]))
        values = values[np.isfinite(values) & (values.imag > 0) & (np.abs(values) <= 2 * np.pi)]
        grown = np.sort(values[values.real > 1e-9 * np.abs(values)].imag)
        assert [(o.mu, o.growth_slope) for o in found.onsets] == [(0.0, 0.0)] * len(grown)
        np.testing.assert_allclose([2 * np.pi * o.frequency_hz for o in found.onsets], grown, rtol=1e-2)
        assert all(o.residual < 1e-12 for o in found.onsets)
    monkeypatch.setattr(basis, "told", lambda family, *given: told(family, *given) if family.size < n else None)
    found = st.onsets(matrix_case(tmp_path, terms(bound=False), 1.0, (0.0, 0.5)))
    assert not any(o.growth_slope == 0.0 for o in found.onsets)


# -- that do not -------------------------------------------------------------------------------------------------------
NONE_BEGIN = {
    "unturned": circulatory(0.0),
    "rounding throughout": circulatory(1e-9),
    "grows by 2.5e-11 at most": alone(damped(-2e-8, "mu"), damped(2e-6, "mu**2")),
    "by that, and is seen to decay in the first step": alone(damped(-2e-6, "mu"), damped(2e-2, "mu**2")),
    "of a higher order": alone(damped(-2e-8, "mu**2"), damped(2e-6, "mu**3")),
    "grew before": alone(damped(-5e-8), damped(-2e-7, "mu")),
}
COUNTED_WEEKLY = ("rounding throughout", "by that, and is seen to decay in the first step", "of a higher order")


@pytest.mark.usefixtures("way")
@pytest.mark.parametrize(
    ("way", "terms"),
    [
        pytest.param(
            followed, terms, id=f"{'followed' if followed else 'counted'}-{name}",
            marks=[pytest.mark.slow] if name in COUNTED_WEEKLY and not followed else [],
        )
        for followed in (True, False) for name, terms in NONE_BEGIN.items()
    ],
    indirect=["way"],
)  # fmt: skip
def test_nothing_begins(terms: list[Term], tmp_path: Path) -> None:
    assert onsets_of(tmp_path, terms) == []


def test_a_mode_that_grew_before_is_told_to_grow_at_the_start(tmp_path: Path) -> None:
    found = st.onsets(matrix_case(tmp_path, alone(damped(-5e-8), damped(-2e-7, "mu")), 1.0, (0.0, 0.5)))
    assert (len(found.at_start), len(found.at_end), found.onsets) == (2, 2, ())


# -- that begin to a little later --------------------------------------------------------------------------------------
@pytest.mark.usefixtures("way")
@pytest.mark.parametrize(("d", "begins"), [(1e-5, 0.1), (1e-8, 0.1**2.5)])
def test_growth_that_a_slope_puts_off(d: float, begins: float, tmp_path: Path) -> None:
    """Re λ = 1e-3 μ³ − d μ; with the less of it both are rounding until after it has begun."""
    stiff = np.diag([1.0, 1e4])
    terms = [(UNIT, "mass", ""), (stiff, "stiffness", ""), damped(-2e-3, "mu**3"), damped(2 * d, "mu")]
    ((mu, _, slope),) = onsets_of(tmp_path, terms)
    np.testing.assert_allclose([mu, slope or 0.0], [begins, 2 * d], rtol=1e-6)


@pytest.mark.usefixtures("way")
@pytest.mark.parametrize("d", [1e-10, pytest.param(1e-8, marks=pytest.mark.slow), 1e-5])
def test_damping_that_is_next_to_none_puts_growth_off(d: float, tmp_path: Path) -> None:
    """Growth of 0.1 μ² against d/2."""
    ((mu, _, slope),) = onsets_of(tmp_path, [*circulatory(0.3), damped(d)])
    np.testing.assert_allclose([mu, slope or 0.0], [np.sqrt(5 * d), 0.2 * np.sqrt(5 * d)], rtol=1e-3)


def test_damping_that_is_rounding_and_feeds_puts_nothing_off(tmp_path: Path) -> None:
    """Both are counted as stable at μ = 0; one decays from there on."""
    ((mu, omega, slope),) = onsets_of(tmp_path, [*circulatory(0.3), damped(-1e-10)])
    assert (mu, slope) == (0.0, 0.0)
    assert omega == pytest.approx(2.0, rel=1e-9)


# -- that cannot be told -----------------------------------------------------------------------------------------------
def family_of(stiffness: np.ndarray, g: float = 0.3) -> Family:
    def at(mu: float) -> Quadratic:
        return Quadratic(*(sp.csr_array(m) for m in (UNIT, g * mu * TURN, stiffness + mu * TURN)))

    return Family((0.0, 0.5), at, Options())


def test_the_series_is_that_of_the_eigenvalue() -> None:
    x = np.array([0.0, 1.0 + 0j])
    found = told(family_of(STIFFNESS), 2.0001j, x, x)
    assert found is not None
    assert found.root is not None
    np.testing.assert_allclose(found.series[2].real, 0.3 / 3 * 0.5**2, rtol=1e-12)
    for mu in (0.0, 0.02, 0.05):
        state = np.block([[np.zeros((2, 2)), UNIT], [-STIFFNESS - mu * TURN, -0.3 * mu * TURN]])
        values = np.linalg.eigvals(state)
        np.testing.assert_allclose(found.at(mu), values[np.argmin(np.abs(values - 2j))], rtol=1e-12)
    other = told(family_of(STIFFNESS), 1.0001j, x[::-1], x[::-1])
    assert other is not None
    assert other.root is None


def test_modes_that_are_one_are_not_told(tmp_path: Path) -> None:
    x = np.array([0.0, 1.0 + 0j])
    assert told(family_of(np.eye(2)), 1j, x, x) is None
    assert told(family_of(np.diag([1.0, 1.0 + 1e-12])), 1j, x, x) is None
    for apart, number in ((1e-7, 0), (1e-3, 2)):
        stiffness = np.diag([1.0, 1.0 + apart])

        def at(mu: float, stiffness: np.ndarray = stiffness) -> Quadratic:
            return Quadratic(*(sp.csr_array(m) for m in (UNIT, -2e-3 * mu**2 * UNIT, stiffness)))

        assert len(basis.along(Family((0.0, 0.5), at, Options()), 3.0).opened) == number
    # Two that are one are turned, and grow together with a third as μ²: that is none of their slopes.
    n = np.zeros((3, 3))
    n[:2, 2], n[2, :2] = (1.0, 0.5), (-1.0, -0.5)
    terms = [
        (np.eye(3), "mass", ""), (np.diag([1.0, 1.0, 4.0]), "stiffness", ""), (n, "stiffness", "mu"),
        (-0.3 * n, "damping", "mu"),
    ]  # fmt: skip
    found = st.onsets(matrix_case(tmp_path, terms, 1.0, (0.0, 0.5)))
    assert not found.complete or [o.mu for o in found.onsets] == [0.0]


def test_a_series_is_not_believed_where_its_last_terms_count() -> None:
    series, doubt = np.zeros(ORDERS + 1, dtype=complex), np.zeros(ORDERS + 1)
    series[[0, 2]] = 1j, 1e-8
    until, grows, first, last = _seen(series, doubt) or (0.0, False, 0.0, 0.0)
    assert until == pytest.approx(0.12**0.5, rel=0.01)
    assert (grows, first, last) == (True, 0.0, 0.0)
    doubt[1] = 1e-12
    assert (_seen(series, doubt) or (0.0,))[-1] == pytest.approx(1e-4, rel=0.01)
    doubt[1] = 1e-9
    assert _seen(series, doubt) is None
    series[3] = -1e-7  # ends at 0.1, with 1.5e-11 at most, and decays
    assert (_seen(series, 0 * doubt) or (0.0, True))[1] is False
    series[3], series[-1] = 0.0, 1e6j  # beyond 0.3 it leads nowhere
    assert _seen(series, 0 * doubt) is None


def test_a_mode_is_known_again_where_no_other_may_be_it() -> None:
    series = np.zeros(ORDERS + 1, dtype=complex)
    series[[0, 2]] = 1j, 1e-8
    one = Opening(None, series, 0.3, 1.0)
    assert one.among(np.array([2j, 1j, 0.5j]), 0.1) == 1
    assert one.among(np.array([2j, 1j + 3e-9, 0.5j]), 0.1) is None
    assert one.among(np.array([2j, 1j, 1j + 5e-9j]), 0.1) is None
    assert one.among(np.array([2j]), 0.1) is None


# -- the count ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("g", [0.3, 1e-7])
def test_an_opening_that_is_lost_is_missed(g: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(basis.Along, "_seen", lambda *_: False)
    found = st.onsets(matrix_case(tmp_path, circulatory(g), 1.0, (0.0, 0.5)))
    assert not found.complete or [o.mu < 1e-3 for o in found.onsets] == [True]


@pytest.mark.parametrize("seen", [True, False])
def test_an_opening_that_is_none_is_noticed(seen: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A mode that decays, said to grow: the count finds the one that does, and what was said is left out."""

    def lying(family: Family, lam: complex, *vectors: np.ndarray) -> Opening | None:
        one = told(family, lam, *vectors)
        if one is None or one.root is not None:
            return one
        grown = told(family_of(STIFFNESS), 2j, np.array([0j, 1.0]), np.array([0j, 1.0]))
        assert grown is not None
        assert grown.root is not None
        return replace(one, root=replace(grown.root, lam=lam))

    monkeypatch.setattr(basis, "told", lying)
    if seen:
        monkeypatch.setattr(basis.Along, "_seen", lambda *_: True)
    found = st.onsets(matrix_case(tmp_path, circulatory(0.3), 1.0, (0.0, 0.5)))
    assert found.complete
    assert [(o.mu, o.frequency_hz) for o in found.onsets] == [(0.0, pytest.approx(1 / np.pi, rel=1e-9))]
    assert ("branches not followed" in found.completeness) is seen


def test_a_range_that_begins_where_growth_is_still_rounding(tmp_path: Path) -> None:
    """It has opened before, and is seen from 0.34 on."""
    found = st.onsets(matrix_case(tmp_path, circulatory(1e-7), 1.0, (0.1, 0.5)))
    assert not found.complete
    assert all(0.1 <= o.mu <= 0.5 for o in found.onsets)
    assert onsets_of(tmp_path, circulatory(0.3), low=0.1) == []


@pytest.mark.parametrize(("mu", "omega"), [(-1e-5, 2.0), (1e-5, 5.0)])
def test_a_root_outside_of_the_range_or_of_another_mode_is_none(
    mu: float, omega: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where growth that opens cannot be told it is counted, and Newton's method may end anywhere."""

    def astray(_: object, __: float, lam: complex, x: np.ndarray, y: np.ndarray, ___: object) -> Root:
        return Root(mu, 1j * omega, x, 1.0, None, 0.0, y)

    without_branches(monkeypatch)
    monkeypatch.setattr(basis.Along, "_seen", lambda *_: False)
    monkeypatch.setattr(counted, "crossing", astray)
    found = st.onsets(matrix_case(tmp_path, circulatory(0.3), 1.0, (0.0, 0.5)))
    assert not found.complete
    assert found.onsets == ()


def test_such_an_onset_has_no_slope_over_other_numbers(tmp_path: Path) -> None:
    turn = np.array([[0.8, 0.6], [-0.6, 0.8]])
    terms = [
        (UNIT, "mass", ""), (turn @ STIFFNESS @ turn.T, "stiffness", ""), (TURN, "stiffness", "mu"),
        (0.3 * TURN, "damping", "mu"),
    ]  # fmt: skip
    case = matrix_case(tmp_path, terms, 1.0, (0.0, 0.5))
    (onset,) = st.onsets(case)
    assert (onset.mu, onset.growth_slope) == (0.0, 0.0)
    with pytest.raises(AnalysisError, match="growth does not change with friction there"):
        onset_slopes(Workspace(case), onset, ("modal.max_frequency_hz",), (0.0, 0.5))


@pytest.mark.parametrize(
    ("size", "ends", "again", "high", "one"),
    [(1e-2, 0.002, 0.006, 0.2, False), (1e-2, 0.002, 0.006, 0.2, True), (0.1, 0.001, 0.0019, 0.06, False),
     *(pytest.param(*of, marks=pytest.mark.slow) for of in ((1.0, 5e-4, 0.0025, 0.1, True), (0.1, 1e-3, 3e-3, 0.1, False)))],
)  # fmt: skip
def test_growth_that_opens_ends_and_begins_again_in_the_first_step_is_solved_or_missed_aloud(
    size: float, ends: float, again: float, high: float, one: bool, tmp_path: Path
) -> None:
    """D = size (−μ² + (1/a + 1/b) μ³ − μ⁴/ab): growth from 0 to a and from b on, both before a thirtieth of the range."""
    who = np.diag([1.0, 0.0]) if one else UNIT
    terms = [
        (UNIT, "mass", ""), (np.diag([1.0, 2.7]), "stiffness", ""), (0.05 * (UNIT - who), "damping", ""),
        (-size * who, "damping", "mu**2"), (size * (1 / ends + 1 / again) * who, "damping", "mu**3"),
        (-size / (ends * again) * who, "damping", "mu**4"),
    ]  # fmt: skip
    found = st.onsets(matrix_case(tmp_path, terms, 1.0, (0.0, high)))
    wanted = sorted([0.0, ends, again] * int(np.trace(who)))
    assert not found.complete or [o.mu for o in found.onsets] == pytest.approx(wanted, abs=1e-9)
    assert found.complete == (size > 0.05 and again > 2 * ends)  # others are nowhere seen to grow before they end
