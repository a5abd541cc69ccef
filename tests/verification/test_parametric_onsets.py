"""Onsets along a parameter: closed forms, and random problems against dense eigenvalues on a grid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
import scipy.sparse as sp

from stridor.errors import AnalysisError
from stridor.modal.full import counted, onsets_along, parametric_onsets, search, words
from stridor.modal.parametric import Parameter, ParametricProblem, Term, all_freedoms, reduce
from stridor.modal.parametric.factors import CONSTANT, Formula, Product
from stridor.typing import Array, ComplexArray

pytestmark = pytest.mark.verification

P = Product((("p", 1.0),))
KINDS = ("circulatory", "gyroscopic", "both", "column", "overdamped")


def problem(terms: list[tuple[Array, str, object]], high: float) -> ParametricProblem:
    made = (Term(sp.csr_array(m), role, f, symmetric=bool(np.allclose(m, m.T))) for m, role, f in terms)
    return ParametricProblem(tuple(made), (Parameter("p", 0.0, high, 0.1),))


def along(terms: list[tuple[Array, str, object]], high: float, frequency: float):
    return onsets_along(reduce(problem(terms, high), frequency / (2 * np.pi), bound=1e-9), "p")


def eigenvalues(whole: ParametricProblem, p: float) -> ComplexArray:
    full = whole.at({"p": p})
    mass, damping, stiffness = (m.toarray() for m in (full.mass, full.damping, full.stiffness))
    n = len(mass)
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)]])
    values = np.linalg.eigvals(state)
    return values


def test_two_undamped_modes_meet():
    """Hoffmann's minimal model: K = [2, 1 − 4p/3; 1, 2], λ² = −2 ± √(1 − 4p/3), so that flutter begins at p = 3/4."""
    friction = np.array([[0.0, -4 / 3], [0.0, 0.0]])
    found = along([(np.eye(2), "mass", CONSTANT), (np.array([[2.0, 1.0], [1.0, 2.0]]), "stiffness", CONSTANT),
                   (friction, "stiffness", P)], 1.5, 6.0)  # fmt: skip
    (onset,) = found
    assert onset.value == pytest.approx(0.75, rel=1e-12)
    assert onset.frequency_hz == pytest.approx(np.sqrt(2) / (2 * np.pi), rel=1e-12)
    assert (onset.kind, onset.stabilising, onset.growth_slope) == ("flutter", False, None)
    # λ² ≈ −2 ± j √(4/3 (p − p_c)), so Re λ opens as √(4/3) / (2√2).
    assert onset.square_root_coefficient == pytest.approx(np.sqrt(4 / 3) / (2 * np.sqrt(2)), rel=1e-9)
    assert found.complete
    assert found.sentence.startswith("Complete as far as both ends tell: in the reduced model 0 modes grow at p = 0 and 1 at")


@pytest.mark.parametrize("damping", [0.0, 0.05])
def test_a_column_that_buckles(damping: float):
    """k − p < 0 diverges from p = k on, with damping or without."""
    terms = [(np.eye(2), "mass", CONSTANT), (np.diag([1.0, 4.0]), "stiffness", CONSTANT), (-np.eye(2), "stiffness", P)]
    if damping:
        terms.append((damping * np.eye(2), "damping", CONSTANT))
    found = along(terms, 5.0, 6.0)
    assert [(o.kind, o.stabilising) for o in found] == [("divergence", False)] * 2
    assert [o.value for o in found] == pytest.approx([1.0, 4.0], rel=1e-10)
    assert [o.frequency_hz for o in found] == [0.0, 0.0]


@pytest.mark.parametrize("seeds", [range(2), pytest.param(range(1000), marks=pytest.mark.slow)])
def test_columns_that_buckle_in_any_basis(seeds):
    """Where k − p is zero only rounding is left of that mode's entries: their size is that of k and p."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        n = int(rng.integers(2, 8))
        k = np.cumsum(rng.integers(1, 4, n) if seed % 2 else rng.uniform(0.3, 1.5, n)).astype(float)
        turn = np.linalg.qr(rng.standard_normal((n, n)))[0]
        terms = [(turn @ turn.T, "mass", CONSTANT), (turn @ np.diag(k) @ turn.T, "stiffness", CONSTANT),
                 (-turn @ turn.T, "stiffness", P)]  # fmt: skip
        if seed % 3:
            terms.append((rng.choice([1e-4, 0.05, 1.0]) * turn @ turn.T, "damping", CONSTANT))
        found = along(terms, float(k[-1] + 1), 3 * float(np.sqrt(k[-1])))
        assert [o.value for o in found] == pytest.approx(k, rel=1e-9), seed
        assert {(o.kind, o.stabilising) for o in found} == {("divergence", False)}, seed
        assert found.complete, seed


def test_divergence_that_ends_and_flutter_that_begins():
    """(λ² + cλ)² + (4 − 2p)(λ² + cλ) + (1 − p)(3 − p) + s² p² = 0 with K = diag(1, 3) − p and circulatory s p: the constant
    vanishes at 1 and 3 for s = 0; flutter follows the closed form of two modes with equal damping."""
    c, s = 0.2, 0.6
    terms = [(np.eye(2), "mass", CONSTANT), (c * np.eye(2), "damping", CONSTANT), (np.diag([1.0, 3.0]), "stiffness", CONSTANT),
             (np.array([[-0.25, s], [-s, -0.25]]), "stiffness", P)]  # fmt: skip
    found = along(terms, 6.0, 9.0)
    # λ² + cλ + κ = 0 with κ = 2 − p/4 ± √(1 − s²p²): on the axis where Im κ² = c² Re κ, at rest where κ = 0.
    p = np.linspace(0.0, 6.0, 2_000_001)
    inside = np.sqrt((1 - (s * p) ** 2).astype(complex))
    growth = [np.where(abs(k.imag) > 0, k.imag**2 - c**2 * k.real, -k.real) for k in (2 - p / 4 - inside,)]
    expected = p[1:][np.diff(np.sign(growth[0])) != 0]
    assert [o.value for o in found] == pytest.approx(expected, abs=1e-5)
    assert found.complete


@pytest.mark.parametrize(("damping", "begins"), [(0.0, 0.0), (1e-10, np.sqrt(5e-10))])
def test_growth_that_opens_as_a_square_is_confirmed_where_it_opens(damping: float, begins: float):
    """Circulatory and gyroscopic forces in proportion to p, P₁₂ = −P₂₁ = p (1 + 0.3 λ): of ω = 1 and 2 the second grows as
    0.1 p² from p = 0 on, or from where that is more than damping takes; in the full problem too."""
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
    terms = [
        (np.eye(2), "mass", CONSTANT), (np.diag([1.0, 4.0]), "stiffness", CONSTANT), (turn, "stiffness", P),
        (0.3 * turn, "damping", P),
    ]  # fmt: skip
    (onset,) = found = along([*terms, (damping * np.eye(2), "damping", CONSTANT)] if damping else terms, 0.5, 6.0)
    assert [onset.value, onset.reduced_value, onset.growth_slope] == pytest.approx([begins, begins, 0.2 * begins], rel=1e-6)
    assert onset.frequency_hz == pytest.approx(1 / np.pi, rel=1e-9)
    assert onset.residual is not None
    assert not onset.stabilising
    assert found.complete


def random_problem(seed: int) -> tuple[ParametricProblem, float]:
    rng = np.random.default_rng(seed)
    n, kind = int(rng.integers(6, 24)), KINDS[seed % len(KINDS)]
    scale = (3.0 if kind == "overdamped" else 0.3) / np.sqrt(n)  # strong enough for growth against such damping

    def skew() -> Array:
        a = scale * rng.standard_normal((n, n))
        return a - a.T

    mass = np.diag(rng.uniform(0.5, 2.0, n))
    turn, root = np.linalg.qr(rng.standard_normal((n, n)))[0], np.sqrt(np.diag(mass))
    stiffness = root[:, None] * (turn @ np.diag(rng.uniform(0.3, 3.0, n) ** 2) @ turn.T) * root
    terms = [(mass, "mass", CONSTANT), (stiffness, "stiffness", CONSTANT)]
    damping = 3.0 if kind == "overdamped" else rng.choice([0.0, 1e-3, 0.02, 0.3])
    if damping:
        alone = np.diag(rng.uniform(0.0, 1.0, n))
        terms.append((damping * (alone if rng.random() < 0.5 else 0.3 * (mass + stiffness)), "damping", CONSTANT))
    if kind in ("circulatory", "both", "overdamped"):
        terms.append((skew() if rng.random() < 0.5 else scale * rng.standard_normal((n, n)), "stiffness", P))
    if kind in ("gyroscopic", "both"):
        terms.append((skew(), "damping", P if rng.random() < 0.5 else CONSTANT))
    if kind == "column":
        half = scale * rng.standard_normal((n, n))
        load = half @ half.T
        load *= rng.uniform(0.5, 3.0) / np.linalg.eigvalsh(load)[-1]
        terms.append((-load + rng.choice([0, 1]) * scale * rng.standard_normal((n, n)), "stiffness", P))
    return problem(terms, float(rng.uniform(0.5, 2.0))), float(rng.uniform(2.2, 4.0))


def disagreement(seed: int) -> str:
    """Where on a grid more or fewer roots grow than the onsets say; "" for nowhere. Not judged: values so near an onset
    that growth may be rounding, and problems in which growing modes pass the highest frequency."""
    whole, frequency = random_problem(seed)
    model = reduce(whole, frequency / (2 * np.pi), bound=1e-9)
    found = onsets_along(model, "p")
    top, high, base = model.frequency, whole.parameters[0].high, None
    for p in np.linspace(0.0, high, 81)[1:-1] + 1.234e-5:
        values = eigenvalues(whole, float(p))
        grows = values.real > 1e-6 * np.maximum(np.abs(values), 1e-3)
        if np.any(grows & (np.abs(np.abs(values) / top - 1.0) < 0.1)):
            return ""
        count = int(np.sum(grows & (np.abs(values) <= top)))
        said = sum((-1 if o.stabilising else 1) * (1 if o.kind == "divergence" else 2) for o in found if o.value < p)
        if np.any((np.abs(values.real) <= 3e-5 * np.abs(values)) & (values.real > 1e-9 * np.abs(values))):
            continue
        base = count - said if base is None else base
        if count - said != base:
            return f"seed {seed}, {KINDS[seed % len(KINDS)]}: {count} grow at {p:.5f}, onsets say {said + base}: {found}"
    return ""


@pytest.mark.parametrize(
    "seeds", [range(2), *(pytest.param(k, marks=pytest.mark.slow) for k in (range(2, 10), range(10, 15)))], ids=str
)
def test_random_problems(seeds: Sequence[int]):
    wrong = [words for seed in seeds if (words := disagreement(seed))]
    assert not wrong, "\n".join(wrong)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(15, 2015, 100))
def test_many_random_problems(first: int):
    wrong = [words for seed in range(first, first + 100) if (words := disagreement(seed))]
    assert not wrong, "\n".join(wrong)


def refuse(*_):
    raise AnalysisError("not today")


@pytest.mark.parametrize("seed", [4, 9])
def test_counting_gives_what_following_gives(seed: int, monkeypatch: pytest.MonkeyPatch):
    """Where branches are told apart both ways lead to the same onsets."""
    whole, frequency = random_problem(seed - 4)
    model = reduce(whole, frequency / (2 * np.pi), bound=1e-9)
    followed = onsets_along(model, "p")
    monkeypatch.setattr(search, "solved", refuse)
    alone = onsets_along(model, "p")
    assert [o.value for o in alone] == pytest.approx([o.value for o in followed], rel=1e-9)
    assert "branches not followed: not today" in alone.sentence


def test_counting_that_loses_an_onset_is_not_called_whole(monkeypatch: pytest.MonkeyPatch):
    whole, frequency = random_problem(9)
    model = reduce(whole, frequency / (2 * np.pi), bound=1e-9)
    monkeypatch.setattr(search, "solved", refuse)
    found = onsets_along(model, "p")
    assert found.complete
    assert "branches not followed: not today" in found.sentence
    solve, seen = counted._Search._root, []

    def forgetful(*given):
        root = solve(*given)
        if root is None:
            return None
        seen.append(root.mu)
        # The second is lost however closely it is looked for.
        return None if len(seen) > 1 and root.mu == pytest.approx(seen[1]) else root

    monkeypatch.setattr(counted._Search, "_root", forgetful)
    fewer = onsets_along(model, "p")
    assert len(fewer) < len(found)
    assert not fewer.complete
    assert fewer.sentence.startswith("Not complete")


def test_growth_that_has_begun_by_less_than_rounding_is_confirmed_at_the_low_end():
    """λ² − 1.5e-5 p λ + 1 = 0 from p = 1e-4 on grows all along, at the low end by less than rounding."""
    made = [(np.eye(1), "mass", CONSTANT), (np.eye(1), "stiffness", CONSTANT), (np.array([[-1.5e-5]]), "damping", P)]
    terms = tuple(Term(sp.csr_array(m), role, f, symmetric=True) for m, role, f in made)
    whole = ParametricProblem(terms, (Parameter("p", 1e-4, 1.0, 0.5),))
    found = onsets_along(all_freedoms(whole, 1.0), "p")
    assert [(o.value, o.stabilising) for o in found] == [(1e-4, False)]
    assert found[0].growth_slope == pytest.approx(0.75e-5)
    assert found.complete


@pytest.mark.parametrize("seed", [20, 21, 27])
def test_two_equal_modes_that_part_slowly_at_the_low_end(seed: int):
    """Circulation (p − 100)² N parts two equal modes: an onset at p = 100 whose growth is rounding for some values."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 7))
    part = 0.2 * rng.standard_normal((n, n))
    mass = np.diag(rng.uniform(0.5, 2.0, n)) + part @ part.T
    squares = rng.uniform(0.5, 3.0, n)
    squares[1] = squares[0]
    turn = np.linalg.cholesky(mass) @ np.linalg.qr(rng.standard_normal((n, n)))[0]
    skew = 0.7 / np.sqrt(n) * rng.standard_normal((n, n))
    factor = Formula("(p-100)**2", ("p",))
    made = [(mass, "mass", CONSTANT), (turn @ np.diag(squares) @ turn.T, "stiffness", CONSTANT)]
    made.append((skew - skew.T, "stiffness", factor))
    terms = tuple(Term(sp.csr_array(m), role, f, symmetric=f is CONSTANT) for m, role, f in made)
    whole = ParametricProblem(terms, (Parameter("p", 100.0, 103.0, 101.0),))
    found = onsets_along(all_freedoms(whole, 0.6), "p")
    assert found.complete
    assert found[0].value == pytest.approx(100.0, abs=1e-6)


def test_ends_of_an_interval_are_told_apart():
    assert words._apart(100.0, 100.000390625) == ("100", "100.0004")
    assert words._apart(0.25, 0.5) == ("0.25", "0.5")
    assert (words._signed(0), words._signed(2), words._signed(-1)) == ("0", "+2", "-1")


def test_what_is_left_out_unconfirmed_is_not_called_complete(monkeypatch: pytest.MonkeyPatch):
    def unconfirmed(*_: object) -> None:
        """Newton's method leads nowhere."""

    monkeypatch.setattr(parametric_onsets, "_confirmed", unconfirmed)
    friction = np.array([[0.0, -4 / 3], [0.0, 0.0]])
    found = along([(np.eye(2), "mass", CONSTANT), (np.array([[2.0, 1.0], [1.0, 2.0]]), "stiffness", CONSTANT),
                   (friction, "stiffness", P)], 1.5, 6.0)  # fmt: skip
    assert (len(found), found.complete) == (0, False)
    assert found.sentence.startswith("Not confirmed in the full problem and left out: p = 0.75 ")
    assert "With these: in the reduced model 0 modes grow at p = 0 and 1 at" in found.sentence
    assert "Complete" not in found.sentence
