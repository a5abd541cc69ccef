"""Samples of studies: where they lie, against what distributions and known functions say."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

import stridor as st
from stridor.case import template_text
from stridor.studies import summary
from stridor.studies.sampling import saltelli, samples
from stridor.studies.uncertainty import missing_samples, probability, sobol_indices

ONE, OTHER = "bodies.beam1.damping.mass", "materials.steel.density"


def study(parameters: dict, **tables: object) -> st.Study:
    return st.Study(case=st.loads(template_text("two-beams")), parameters=parameters, **tables)


def test_a_grid_is_every_combination() -> None:
    found = samples(study({"mu": {"range": (0.0, 0.4), "points": 3}, ONE: {"values": (1.0, 5.0)}}))
    assert found.tolist() == [[0.0, 1.0], [0.0, 5.0], [0.2, 1.0], [0.2, 5.0], [0.4, 1.0], [0.4, 5.0]]
    decades = samples(study({ONE: {"range": (1.0, 100.0), "points": 3, "spacing": "logarithmic"}}))
    assert decades[:, 0] == pytest.approx([1.0, 10.0, 100.0])


@pytest.mark.parametrize(
    ("given", "shape"),
    [
        ({"distribution": "uniform", "range": (2.0, 3.0)}, stats.uniform(2.0, 1.0)),
        ({"range": (2.0, 3.0)}, stats.uniform(2.0, 1.0)),
        ({"distribution": "normal", "mean": 5.0, "deviation": 2.0}, stats.norm(5.0, 2.0)),
        ({"distribution": "normal", "mean": 5.0, "deviation": 2.0, "low": 4.0}, stats.truncnorm(-0.5, np.inf, 5.0, 2.0)),
        (
            {"distribution": "normal", "mean": 5.0, "deviation": 2.0, "low": 4.0, "high": 9.0},
            stats.truncnorm(-0.5, 2.0, 5.0, 2.0),
        ),
    ],
    ids=["uniform", "range", "normal", "truncated below", "truncated on both sides"],
)
@pytest.mark.parametrize("method", ["random", "latin-hypercube", "sobol"])
def test_samples_have_the_distribution(given: dict, shape: object, method: str) -> None:
    found = samples(study({ONE: given, "mu": {"range": (0, 1)}}, sampling={"method": method, "samples": 4096, "seed": 3}))
    assert stats.kstest(found[:, 0], shape.cdf).pvalue > 1e-3  # type: ignore[attr-defined]
    assert abs(np.corrcoef(found.T)[0, 1]) < 0.05


def test_mean_and_deviation_of_a_log_normal_are_those_of_the_number() -> None:
    given = {"distribution": "log-normal", "mean": 4.0, "deviation": 3.0}
    found = samples(study({ONE: given}, sampling={"method": "sobol", "samples": 2**15}))[:, 0]
    assert found.min() > 0
    assert found.mean() == pytest.approx(4.0, rel=2e-3)
    assert found.std() == pytest.approx(3.0, rel=2e-2)


def test_correlation_is_that_of_the_matrix() -> None:
    names = {name: {"distribution": "normal", "mean": 5.0, "deviation": 0.5} for name in (ONE, OTHER, "mu")}
    matrix = ((1.0, 0.7, -0.3), (0.7, 1.0, 0.0), (-0.3, 0.0, 1.0))
    found = samples(
        study(names, sampling={"method": "sobol", "samples": 2**13}, correlation={"of": tuple(names), "matrix": matrix})
    )
    assert np.corrcoef(found.T) == pytest.approx(np.array(matrix), abs=0.02)
    assert found.std(axis=0) == pytest.approx([0.5] * 3, rel=0.02)


@pytest.mark.parametrize("method", ["random", "sobol"])
def test_more_samples_begin_with_those_before(method: str) -> None:
    made = study({ONE: {"range": (1, 2)}, "mu": {"range": (0, 1)}}, sampling={"method": method, "samples": 100, "seed": 5})
    assert np.array_equal(samples(made, 1000)[:100], samples(made))
    other = study({ONE: {"range": (1, 2)}, "mu": {"range": (0, 1)}}, sampling={"method": method, "samples": 100, "seed": 6})
    assert not np.array_equal(samples(other), samples(made))


def test_sobol_indices_of_a_function_that_is_known() -> None:
    """Ishigami and Homma (1990): f = sin x₁ + 7 sin² x₂ + 0.1 x₃⁴ sin x₁ over [−π, π]³."""
    x = np.pi * (2 * saltelli(3, 4096, 2) - 1)
    values = np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
    found = sobol_indices("f", ("x1", "x2", "x3"), values)
    assert found.first == pytest.approx([0.3139, 0.4424, 0.0], abs=0.01)
    assert found.total == pytest.approx([0.5576, 0.4424, 0.2437], abs=0.01)


def test_intervals_of_sobol_indices_are_told_for_what_they_are() -> None:
    """g = Π (|4 uₖ − 2| + aₖ) / (1 + aₖ): variances 1 / 3 (1 + aₖ)² of each factor. By resampling 95 % of the intervals
    would hold the truth; that at least 80 % do is what is said."""
    a = np.array([0.0, 1.0, 4.5, 9.0])
    own = 1.0 / 3.0 / (1.0 + a) ** 2
    whole = np.prod(1.0 + own) - 1.0
    truth = np.array([own / whole, own * np.prod(1.0 + own) / (1.0 + own) / whole])
    hits = []
    for seed in range(1, 41):
        values = np.prod((np.abs(4.0 * saltelli(4, 128, seed) - 2.0) + a) / (1.0 + a), axis=1)
        found = sobol_indices("g", tuple("abcd"), values)
        off = np.abs(np.array([found.first, found.total]) - truth)
        hits.append(off <= np.array([found.first_half_width, found.total_half_width]))
    held = np.mean(hits, axis=0)
    assert 0.8 <= held.min() < 0.95
    ((title, *_),) = summary._indices(SimpleNamespace(indices=lambda: found))  # type: ignore[arg-type]
    assert "± by resampling, too narrow at times" in title


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    rng = np.random.default_rng(1)
    for truth in (0.02, 0.3):
        hits = [p.low <= truth <= p.high for p in (probability(rng.random(200) < truth) for _ in range(4000))]
        assert 0.93 < np.mean(hits) < 0.975
    none = probability(np.zeros(100, dtype=bool))
    assert none.value == 0.0
    assert none.low == pytest.approx(0.0, abs=1e-15)
    assert none.high == pytest.approx(0.0370, abs=1e-4)  # z²/(n + z²)


def test_the_number_of_samples_asked_for_gives_the_interval() -> None:
    before = probability(np.arange(100) < 30)
    wanted = missing_samples(before, 0.01)
    assert wanted == pytest.approx(0.3 * 0.7 * (1.96 / 0.01) ** 2, rel=0.01)
    after = probability(np.arange(wanted) < 0.3 * wanted)
    assert after.half_width == pytest.approx(0.01, rel=0.01)
