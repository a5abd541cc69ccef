"""The tables of a study file, but for the study itself."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from ..case.fields import Number, Positive, Table
from ..errors import Problem

# When the full problem confirms a row of a reduced model: eigenvalues no further off than so many times the estimate,
# or this relative difference; onsets no further than that, as μ is further off than λ where growth begins slowly.
SAME, ROUNDING, OF_ONSETS = 10.0, 1e-9, 1e-6
EMPTY = 1.0  # estimated error, relative, above which nothing is said of a row
MOST_SAMPLES = 10_000_000

Compute = Literal["modes", "onsets", "steady", "simulate", "compare"]
Method = Literal["grid", "random", "latin-hypercube", "sobol", "saltelli"]
Samples = Annotated[int, Field(strict=True, ge=1, le=MOST_SAMPLES)]
Few = Annotated[int, Field(strict=True, ge=1, le=1000)]
Share = Annotated[float, Field(strict=True, ge=0, le=1)]
Level = Annotated[float, Field(strict=True, gt=0, lt=1)]


class Varied(Table):
    """How one number of the case varies: values, a range, or a distribution."""

    values: Annotated[tuple[Number, ...], Field(min_length=1)] | None = Field(
        default=None, description="a list of numbers, each of them a point of the grid"
    )
    range: tuple[Number, Number] | None = Field(default=None, description="[low, high] with low < high")
    points: Samples | None = Field(
        default=None, description="how many points of a grid the range has, a whole number from 1 on"
    )
    spacing: Literal["linear", "logarithmic"] = Field(
        default="linear", description='"linear" or "logarithmic", of the points of a range'
    )
    distribution: Literal["uniform", "normal", "log-normal"] | None = Field(
        default=None, description='"uniform", "normal" or "log-normal"'
    )
    mean: Number | None = Field(default=None, description="the mean of a normal distribution; of a log-normal one, too")
    deviation: Positive | None = Field(default=None, description="the standard deviation of the number itself, > 0")
    low: Number | None = Field(default=None, description="the least value: the distribution is truncated there")
    high: Number | None = Field(default=None, description="the largest value: the distribution is truncated there")


class Sampling(Table):
    """Where the samples lie."""

    method: Method = Field(
        default="grid", description='"grid", "random", "latin-hypercube", "sobol" or "saltelli"'
    )
    samples: Samples | None = Field(
        default=None, description="how many, a whole number from 1 to 10 million; a grid has its own"
    )
    seed: Annotated[int, Field(strict=True, ge=0, lt=2**32)] = Field(
        default=0, description="a whole number ≥ 0: the same seed gives the same samples"
    )


class Correlation(Table):
    """Correlation between numbers with a distribution: of their normal scores (Gaussian copula)."""

    of: Annotated[tuple[str, ...], Field(min_length=2)] = Field(description="a list of parameters of the study")
    matrix: Annotated[tuple[tuple[Number, ...], ...], Field(min_length=2)] = Field(
        description="rows of correlation coefficients, 1 on the diagonal, symmetric, positive definite"
    )


class Keep(Table):
    """How much of a row is kept."""

    modes: Few = Field(
        default=40, description="how many modes of a row are kept, 1 to 1000: unstable ones first, then the lowest"
    )
    onsets: Few = Field(default=8, description="how many onsets of a row are kept, 1 to 1000: the lowest")


class Answers(Table):
    """Who answers the samples, and which of them are solved in full as well."""

    source: Literal["auto", "full", "reduced"] = Field(
        default="auto",
        description='"full" (each sample a model of its own), "reduced" (one certified model for all) or "auto"',
    )
    bound: Positive = Field(default=1e-8, description="relative error of eigenvalues of the reduced model, > 0")
    confirm: Share = Field(default=0.01, description="share of rows, at random, solved in full as well, 0 to 1")


class Goal(Table):
    """How sure the probability of instability is to be: samples are added until its interval is that narrow."""

    half_width: Level = Field(description="half the width of the confidence interval, between 0 and 1")
    confidence: Level = Field(default=0.95, description="the level of confidence, between 0 and 1")
    most: Samples = Field(default=100_000, description="how many samples there may be at most")


def where(path: str, key: str = "") -> str:
    """Where a parameter stands in a study file, in messages."""
    quoted = path if path.replace("_", "").replace("-", "").isalnum() else f'"{path}"'
    return f"parameters.{quoted}{f'.{key}' if key else ''}"


def problem(path: str, key: str, given: object, accepted: str) -> Problem:
    """What is wrong with a parameter."""
    return Problem(where(path, key), given, accepted)
