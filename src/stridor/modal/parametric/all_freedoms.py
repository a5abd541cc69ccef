"""A model that keeps every freedom, for problems so small that reducing them saves nothing, and those of some hundred
freedoms that no reduced model can be made of, such as matrices with multipliers."""

from __future__ import annotations

import numpy as np

from ..quadratic.reach import searched_in
from .model import ReducedModel
from .offline import static_operator
from .problem import ParametricProblem


def all_freedoms(problem: ParametricProblem, max_frequency_hz: float, *, bound: float = 1e-8) -> ReducedModel:
    """The problem as a model of itself, without any error but rounding: its basis is the unit matrix, and its residuals
    are those of the full problem."""
    frequency = 2 * np.pi * max_frequency_hz
    middle = problem.at(problem.reference)
    searched = searched_in([problem.at(point) for point in problem.sampled], frequency)
    _, scale = static_operator(middle.mass, middle.stiffness, searched)
    terms = np.array([term.matrix.toarray() for term in problem.terms])
    rows = scale[:, None]
    right, left = rows * terms, rows * terms.transpose(0, 2, 1)
    return ReducedModel(problem, np.eye(problem.size), terms, right, left, frequency, 1.0, bound, {}, 0)
