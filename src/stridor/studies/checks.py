"""What is wrong with a study though each of its values is right by itself."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from ..case import Case
from ..errors import CaseError, Problem
from ..study.sensitivities import number_at
from .distributions import inside, quantile
from .tables import MOST_SAMPLES, Varied, problem

if TYPE_CHECKING:
    from .schema import Study

FRICTION = "mu"
RARE = 1e-6  # share of a distribution that lies below zero and is let pass
_NORMAL = ("mean", "deviation")


def problems_within(study: Study) -> list[Problem]:
    """Problems of a study. Raises CaseError where its case is none."""
    found: list[Problem] = []
    case = study.base()
    for path, varied in study.parameters.items():
        found += _of_path(study, case, path)
        found += _of_values(path, varied)
        found += _of_sampling(study, path, varied)
    found += _of_samples(study)
    found += _of_compared(study, case)
    found += _of_correlation(study)
    return found


def negative_friction(study: Study) -> list[Problem]:
    """Where friction coefficients of a study may be negative, which no row of it has an answer to. Not a problem of the
    study as such: stores of studies in which single rows failed for that are still opened."""
    return [item for path, varied in study.parameters.items() for item in _of_friction(path, varied)]


def _of_path(study: Study, case: Case, path: str) -> Iterator[Problem]:
    if path == FRICTION and study.compute == "onsets":
        accepted = "onsets are solved for mu over modal.friction_range; leave it out, or compute modes"
        yield problem(path, "", None, accepted)
    elif path == FRICTION:
        if not case.contacts and FRICTION not in case.factor_names:
            yield problem(path, "", None, "nothing depends on it: no contact and no factor of a matrix has mu in it")
    else:
        try:
            number_at(case, path)
        except CaseError as error:
            for item in error.problems:
                yield Problem(f"parameters: {item.where}", item.given, item.accepted)


def _of_values(path: str, varied: Varied) -> Iterator[Problem]:
    ways = [name for name in ("values", "range", "distribution") if getattr(varied, name) is not None]
    if varied.distribution is None and any(getattr(varied, name) is not None for name in _NORMAL):
        yield problem(path, "distribution", None, 'missing – "normal" or "log-normal" goes with mean and deviation')
        return
    if len(ways) != 1 and ways != ["range", "distribution"]:
        accepted = "one of values = […], range = […], distribution = …"
        yield problem(path, "", ", ".join(ways) or None, accepted)
        return
    if varied.values is not None and len(set(varied.values)) < len(varied.values):
        yield problem(path, "values", list(varied.values), "each value once")
    if varied.range is not None and not varied.range[0] < varied.range[1]:
        yield problem(path, "range", list(varied.range), "[low, high] with low < high")
    if varied.points is not None and varied.range is None:
        yield problem(path, "points", varied.points, "goes with range = [low, high]")
    if varied.spacing == "logarithmic" and not (varied.range and varied.range[0] > 0):
        yield problem(path, "spacing", varied.spacing, "goes with a range above 0")
    if varied.distribution is not None:
        yield from _of_distribution(path, varied)
    elif varied.low is not None or varied.high is not None:
        yield problem(path, "low" if varied.low is not None else "high", None, "goes with a distribution")


def _of_friction(path: str, varied: Varied) -> Iterator[Problem]:
    if path != FRICTION and not path.endswith((".friction.coefficient", ".friction.static_coefficient")):
        return
    accepted = "a friction coefficient is a finite number ≥ 0"
    if varied.values is not None:
        if min(varied.values) < 0:
            yield problem(path, "values", list(varied.values), accepted)
    elif varied.range is not None:
        if varied.range[0] < 0:
            yield problem(path, "range", list(varied.range), accepted)
    elif varied.low is not None:
        # The distribution is cut there; a log-normal one is positive by itself.
        if varied.low < 0 and varied.distribution == "normal":
            yield problem(path, "low", varied.low, accepted)
    elif float(quantile(varied, np.full(1, RARE))[0]) < 0:
        yield problem(path, "low", None, f"missing – {accepted}, and a normal distribution is cut there by low = 0.0")


def _of_distribution(path: str, varied: Varied) -> Iterator[Problem]:
    if varied.distribution == "uniform":
        if varied.range is None:
            yield problem(path, "range", None, "missing – a uniform distribution is that of range = [low, high]")
        for key in (*_NORMAL, "low", "high"):
            if getattr(varied, key) is not None:
                yield problem(path, key, getattr(varied, key), "a uniform distribution has a range alone")
        return
    if varied.range is not None:
        yield problem(path, "range", list(varied.range), "goes with a uniform distribution; truncate by low and high")
    for key in _NORMAL:
        if getattr(varied, key) is None:
            yield problem(path, key, None, f"missing – a {varied.distribution} distribution has mean and deviation")
    if varied.distribution == "log-normal" and varied.mean is not None and varied.mean <= 0:
        yield problem(path, "mean", varied.mean, "above 0 for a log-normal distribution")
    if varied.low is not None and varied.high is not None and not varied.low < varied.high:
        yield problem(path, "high", varied.high, f"above low = {varied.low:g}")
        return
    if varied.mean is not None and varied.deviation is not None:
        share = inside(varied)
        if not share > 1e-6:
            accepted = f"limits that leave something of the distribution: between them lie {share:.1g} of it"
            yield problem(path, "low" if varied.low is not None else "high", None, accepted)


def _of_sampling(study: Study, path: str, varied: Varied) -> Iterator[Problem]:
    method = study.sampling.method
    if method == "grid":
        if varied.distribution is not None:
            accepted = 'values, or range and points, with sampling.method = "grid"; or another method, such as "sobol"'
            yield problem(path, "distribution", varied.distribution, accepted)
        elif varied.range is not None and varied.points is None:
            yield problem(path, "points", None, "missing – how many points of the grid the range has")
        return
    if varied.points is not None:
        yield problem(path, "points", varied.points, f'goes with sampling.method = "grid", not "{method}"')
    if varied.values is not None and method == "saltelli":
        yield problem(path, "values", list(varied.values), "a range or a distribution with the method \"saltelli\"")


def _of_samples(study: Study) -> Iterator[Problem]:
    method, samples = study.sampling.method, study.sampling.samples
    if method == "grid":
        if samples is not None:
            accepted = "goes with another method than \"grid\", whose samples are the points of the parameters"
            yield Problem("sampling.samples", samples, accepted)
        sizes = [len(v.values) if v.values is not None else v.points or 1 for v in study.parameters.values()]
        if (total := int(np.prod([float(s) for s in sizes]))) > MOST_SAMPLES:
            yield Problem("parameters", f"{total:.3g} points", f"a grid of at most {MOST_SAMPLES:,} points")
    elif samples is None and study.goal is None:
        yield Problem("sampling.samples", None, "missing – how many samples, or a table [goal]")
    if method == "saltelli" and samples is not None and samples & (samples - 1):
        accepted = "a power of two (64, 128, 256 …), of which a study has as many rows times two plus its parameters"
        yield Problem("sampling.samples", samples, accepted)
    if method == "saltelli" and study.correlation is not None:
        yield Problem("correlation", None, "none with \"saltelli\": Sobol indices are those of independent numbers")
    if study.goal is not None:
        if method not in ("random", "sobol"):
            accepted = 'goes with the methods "random" and "sobol", to which samples can be added'
            yield Problem("goal", method, accepted)
        if study.compute != "modes":
            yield Problem("goal", study.compute, 'goes with compute = "modes": how likely a mode grows is its subject')


def _of_compared(study: Study, case: Case) -> Iterator[Problem]:
    mu = case.comparison.mu
    if study.compute == "compare" and FRICTION not in study.parameters and len(mu) > 1:
        accepted = "one friction coefficient, since a row is one comparison; or mu as a parameter of the study"
        yield Problem("comparison.mu", list(mu), accepted)


def _of_correlation(study: Study) -> Iterator[Problem]:
    given = study.correlation
    if given is None:
        return
    if study.sampling.method == "grid":
        yield Problem("correlation", None, "goes with another method than \"grid\"")
    for name in given.of:
        if name not in study.parameters:
            yield Problem("correlation.of", name, f"parameters of the study: {', '.join(study.parameters)}")
    if len(set(given.of)) < len(given.of):
        yield Problem("correlation.of", list(given.of), "each parameter once")
    n = len(given.of)
    if len(given.matrix) != n or any(len(row) != n for row in given.matrix):
        yield Problem("correlation.matrix", None, f"{n} rows of {n} coefficients")
        return
    matrix = np.array(given.matrix)
    if len(off := np.argwhere(np.diag(matrix) != 1.0)):
        k = int(off[0, 0])
        accepted = f"must be 1, as all of the diagonal: row {k + 1}, column {k + 1} is of a number with itself"
        yield Problem("correlation.matrix", matrix[k, k].item(), accepted)
    elif len(off := np.argwhere(matrix != matrix.T)):
        i, j = (int(k) for k in off[0])
        accepted = f"must be symmetric: row {i + 1}, column {j + 1} and row {j + 1}, column {i + 1} have one value"
        yield Problem("correlation.matrix", f"{matrix[i, j]:g} and {matrix[j, i]:g}", accepted)
    elif (least := float(np.linalg.eigvalsh(matrix)[0])) <= 1e-12:
        accepted = f"must be positive definite; its least eigenvalue is {least:.3g}: no numbers have these correlations"
        yield Problem("correlation.matrix", [list(row) for row in given.matrix], accepted)
