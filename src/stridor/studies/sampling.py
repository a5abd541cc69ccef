"""The samples of a study: a row of values for each."""

from __future__ import annotations

import warnings
from importlib import import_module
from typing import Any

import numpy as np

from ..errors import AnalysisError
from ..typing import Array
from .distributions import grid_values, quantile
from .schema import Study

FIRST = 256  # samples that a study with a goal begins with


def names(study: Study) -> tuple[str, ...]:
    """The parameters, in their order."""
    return tuple(study.parameters)


def count(study: Study) -> int:
    """How many samples the study begins with."""
    if study.sampling.method == "grid":
        return int(np.prod([len(grid_values(v)) for v in study.parameters.values()]))
    base = study.sampling.samples or FIRST
    return base * (len(study.parameters) + 2) if study.sampling.method == "saltelli" else base


def samples(study: Study, number: int | None = None) -> Array:
    """Values (n, p) of the parameters; the first n where a number is given, which more samples do not change but for a
    Latin hypercube. Raises AnalysisError where SALib is needed and missing."""
    number = count(study) if number is None else number
    varied = tuple(study.parameters.values())
    if study.sampling.method == "grid":
        axes = np.meshgrid(*(grid_values(v) for v in varied), indexing="ij")
        return np.stack([axis.ravel() for axis in axes], axis=1)
    shares = _correlated(study, _shares(study, number))
    return np.stack([quantile(v, shares[:, k]) for k, v in enumerate(varied)], axis=1)


def _shares(study: Study, number: int) -> Array:
    """Points (n, p) of the unit cube."""
    from scipy.stats import qmc

    dimensions, seed = len(study.parameters), study.sampling.seed
    method = study.sampling.method
    if method == "random":
        return np.random.default_rng(seed).random((number, dimensions))
    if method == "latin-hypercube":
        return np.asarray(qmc.LatinHypercube(dimensions, rng=seed).random(number))
    if method == "sobol":
        power = max(int(np.ceil(np.log2(max(number, 1)))), 0)
        return np.asarray(qmc.Sobol(dimensions, rng=seed).random_base2(power))[:number]
    return saltelli(dimensions, study.sampling.samples or 1, seed)


def saltelli(dimensions: int, base: int, seed: int) -> Array:
    """Points (base · (p + 2), p) from which first-order and total Sobol indices are estimated, in SALib's order. Raises
    AnalysisError where SALib is not installed."""
    sample = salib("sample.sobol").sample
    problem = {"num_vars": dimensions, "names": [str(k) for k in range(dimensions)], "bounds": [[0, 1]] * dimensions}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a base that is no power of two, which the checks of a study refuse
        return np.asarray(sample(problem, base, calc_second_order=False, seed=seed))


def salib(module: str) -> Any:
    """A part of SALib. Raises AnalysisError where it is not installed."""
    try:
        return import_module(f"SALib.{module}")
    except ImportError as error:
        raise AnalysisError("Sobol indices need SALib, which is not installed: pip install SALib") from error


def _correlated(study: Study, shares: Array) -> Array:
    """Shares with the correlation of their normal scores that is asked for."""
    given = study.correlation
    if given is None:
        return shares
    from scipy.stats import norm

    order = names(study)
    columns = [order.index(name) for name in given.of]
    scores = norm.ppf(np.clip(shares[:, columns], 1e-15, 1 - 1e-15)) @ np.linalg.cholesky(np.array(given.matrix)).T
    found = shares.copy()
    found[:, columns] = norm.cdf(scores)
    return found
