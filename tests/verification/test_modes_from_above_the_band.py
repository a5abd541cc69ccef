"""Modes that friction, circulation or gyroscopic terms bring down from above the band, of which a reduced model's basis
knows nothing at first: the model must have them, and what counts on a model without them must not vouch for it."""

from __future__ import annotations

import re

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.random import Generator

import stridor as st
from rubbing_block import rubbing_block
from stridor.modal.full import held_in_full, onsets_along
from stridor.modal.parametric import Parameter, ParametricProblem, Term, offline, reduce
from stridor.modal.parametric.factors import CONSTANT, Product
from stridor.study.along import onsets_along as case_onsets
from stridor.study.reduced import reduced_model
from stridor.typing import Array, ComplexArray

pytestmark = pytest.mark.verification

BLOCK = """
type = "solid"
model = "plane strain"
material = "pad"
mesh = { shape = "rectangle", corner = [-0.01, 0.0], size = [0.02, 0.02], divisions = [8, 7], cells = "quad" }
damping = { mass = 5.32, stiffness = 6.93e-9 }
points = { crown = [0.0, 0.02], low = [-0.01, 0.0] }
"""
DASHPOTS = """
[dashpots.low]
between = ["block.low", "ground"]
damping = 37.46
direction = [-0.582, 0.287]
[dashpots.crown]
between = ["block.crown", "ground"]
damping = 1.062e4
direction = [0.878, 1.404]
"""
DENSITY, DAMPING = "materials.pad.density", "bodies.block.damping.mass"
ROLES = ("mass", "damping", "stiffness")


def block() -> st.Case:
    """Without friction nothing of it vibrates below 6 kHz; with it one mode grows at 2.04 kHz."""
    text = rubbing_block("max_frequency_hz = 6000.0", BLOCK, more=DASHPOTS)
    changes = {
        "bodies.slider.mesh.divisions": [4, 1], "contacts.face.stiffness": 9.61e12,
        "contacts.face.friction.coefficient": 0.374,
    }  # fmt: skip
    return st.loads(text).with_(changes)


def dense(problem: ParametricProblem, point: dict[str, float], top: float) -> ComplexArray:
    """All λ up to top [1/s] with Im λ ≥ 0."""
    whole = problem.at(point)
    mass, damping, stiffness = (getattr(whole, role).toarray() for role in ROLES)
    n, one = len(mass), top**2 * mass
    first = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(one, stiffness), -np.linalg.solve(one, top * damping)]])
    values = top * np.linalg.eigvals(first)
    return values[(values.imag >= 0) & (np.abs(values) <= top)]


def is_among(values: ComplexArray, others: ComplexArray) -> bool:
    return all(np.abs(others - value).min(initial=np.inf) <= 1e-5 * abs(value) for value in values)


def without_asking(monkeypatch: pytest.MonkeyPatch) -> None:
    """A model as the residuals of its own modes make it."""
    monkeypatch.setattr(offline, "complete", lambda *_, **__: None)


def test_the_model_has_the_one_mode_of_the_band():
    case = block()
    model = reduced_model(case, {DENSITY: (1800.0, 2200.0)})
    for density in (1800.0, 2000.0, 2200.0):
        modes = model.modes({DENSITY: density})
        truth = dense(model.problem, {DENSITY: density}, model.frequency)
        growing = truth[truth.real > 0]
        assert modes.values[modes.unstable] == pytest.approx(growing, rel=1e-7)
        assert len(growing) == 1
        assert modes.passed.all()


def test_its_growth_ends_along_a_number():
    found = case_onsets(block(), DAMPING, (0.0, 2000.0))
    assert [o.stabilising for o in found] == [True]
    assert 580.0 < found[0].value < 620.0
    assert found.complete
    assert found.sentence.endswith("In the full problem the same modes grow at both ends, sought anew there.")


def test_its_growth_has_a_boundary():
    found = st.stability_boundary(
        block(), DENSITY, DAMPING, x_range=(1800.0, 2200.0), y_range=(0.0, 2000.0), lines=2
    )
    assert len(found.curves) == 1
    assert found.agree
    assert "At the corners the full problem has the same growing modes, sought anew there." in found.sentence


def test_onsets_on_a_model_without_it_are_not_complete(monkeypatch: pytest.MonkeyPatch):
    without_asking(monkeypatch)
    found = case_onsets(block(), DAMPING, (0.0, 2000.0))
    assert (len(found), found.complete) == (0, False)
    # A motion without oscillation grows on that model alone.
    lacking = "in the full problem 1 mode grows and in the reduced model 1, which lacks 2"
    assert found.sentence.startswith(f"Not complete: {lacking}")
    assert f"at {DAMPING} = 0; in the full problem no mode grows and in the reduced model 1" in found.sentence
    assert f"at {DAMPING} = 2000. On the model: in the reduced model 1 mode grows" in found.sentence
    assert "Complete" not in found.sentence


def test_a_boundary_on_a_model_without_it_is_not_complete(monkeypatch: pytest.MonkeyPatch):
    without_asking(monkeypatch)
    found = st.stability_boundary(
        block(), DENSITY, DAMPING, x_range=(1800.0, 2200.0), y_range=(0.0, 2000.0), lines=2
    )
    assert (len(found.curves), found.agree) == (0, False)
    assert "Not all of that fits together: in the full problem 1 mode grows and in the reduced model" in found.sentence


def test_nothing_is_vouched_for_where_the_full_problem_is_too_large(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(held_in_full, "AFFORDABLE", 1)
    found = case_onsets(block(), DAMPING, (0.0, 2000.0))
    assert (len(found), found.complete) == (1, False)
    assert found.sentence.startswith("Not checked: with ")
    assert "Complete" not in found.sentence
    again = st.stability_boundary(
        block(), DENSITY, DAMPING, x_range=(1800.0, 2200.0), y_range=(0.0, 2000.0), lines=2
    )
    assert not again.agree
    assert again.sentence.startswith("Not checked: with ")


def unlike_itself(seed: int) -> tuple[ParametricProblem, float]:
    """62 to 110 freedoms, 64 frequencies from 1 to 33 1/s, and terms of low rank as strong as the stiffness or far
    stronger: circulation, gyroscopy, or a stiffness of which friction takes most away again; the top of the band
    [1/s]."""
    rng = np.random.default_rng([seed, 5])
    n = int(rng.integers(62, 110))
    mass = np.diag(rng.uniform(0.5, 2.0, n))
    turn = np.sqrt(mass) @ np.linalg.qr(rng.standard_normal((n, n)))[0]
    omega = np.sort(np.exp(rng.uniform(0.0, 3.5, n)))
    terms = [(mass, "mass", CONSTANT), (turn @ np.diag(omega**2) @ turn.T, "stiffness", CONSTANT)]
    terms += [(0.02 * mass, "damping", CONSTANT), *_strong(rng, n)]
    high, low = float(rng.choice([1.0, 1.2])), float(rng.choice([0.0, 0.9]))
    top = float(omega[int(rng.integers(0, 8))] * rng.uniform(0.5, 1.3))
    made = tuple(Term(sp.csr_array(m), role, f, symmetric=bool(np.allclose(m, m.T))) for m, role, f in terms)
    return ParametricProblem(made, (Parameter("p", low, high, (low + high) / 2),)), top


def _strong(rng: Generator, n: int) -> list[tuple[Array, str, object]]:
    rank, kind, size = int(rng.integers(1, 4)), int(rng.integers(4)), 10 ** rng.uniform(0.0, 3.5)
    a, b = (part / np.linalg.norm(part, axis=0) for part in (rng.standard_normal((n, rank)) for _ in range(2)))
    p = Product((("p", 1.0),))
    if kind == 0:
        return [(size * (a @ b.T), "stiffness", p)]
    if kind == 1:
        return [(size * (a @ b.T - b @ a.T), "stiffness", p)]
    if kind == 2:
        return [(3 * np.sqrt(size) * (a @ b.T - b @ a.T), "damping", p)]
    return [(0.8 * size * (a @ b.T), "stiffness", CONSTANT), (size * (a @ a.T), "stiffness", p)]


# At 9 of the first 400 the band was empty on the model and is not.
@pytest.mark.parametrize("seeds", [(13, 58, 145, 148, 154, 267), pytest.param(range(400), marks=pytest.mark.slow)])
def test_random_models_have_what_the_full_problem_has(seeds):
    for seed in seeds:
        problem, top = unlike_itself(seed)
        model = reduce(problem, top / (2 * np.pi))
        (own,) = problem.parameters
        for share in (0.0, 0.37, 1.0):
            point = {"p": own.low + share * (own.high - own.low)}
            modes, truth = model.modes(point), dense(problem, point, top)
            inside = truth[np.abs(truth) <= 0.999 * top]
            # An estimate above the bound is said; a mode that is missing is not.
            assert is_among(inside, modes.values) or not modes.passed.all(), (seed, point)
            assert is_among(modes.values[modes.passed & (np.abs(modes.values) <= 0.998 * top)], truth), (seed, point)


@pytest.mark.parametrize("seeds", [(154, 159, 172, 267), pytest.param(range(150, 300), marks=pytest.mark.slow)])
def test_onsets_of_random_models_count_what_grows_at_both_ends_or_are_not_complete(seeds):
    for seed in seeds:
        problem, top = unlike_itself(seed)
        found = onsets_along(reduce(problem, top / (2 * np.pi)), "p")
        if not found.complete:
            continue
        told = re.search(r"in the reduced model (\d+) modes? grows? at p = \S+ and (\d+) at p", found.sentence)
        assert told is not None, seed
        (own,) = problem.parameters
        for value, count in zip((own.low, own.high), told.groups(), strict=True):
            grows = dense(problem, {"p": value}, 20 * top)
            grows = grows[grows.real > 1e-8 * top]
            # What is at the end of the band, or diverges faster than it, may count or not.
            least, most = np.sum(np.abs(grows) <= 0.99 * top), np.sum(grows.imag <= 1.01 * top)
            assert least <= int(count) <= most, (seed, value)
