"""A study file: which case, which of its numbers vary and how, what is computed, where the samples lie."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from ..case import Case, load, loads
from ..case.fields import Number, Positive, Table, Truth
from ..case.messages import problems_of
from ..case.overrides import override
from ..errors import CaseError, Problem
from ..notebook import Shown, counted
from ..reading import irregular

LARGEST = 2**22  # bytes of a study file
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
    points: Samples | None = Field(default=None, description="how many points of a grid the range has, a whole number")
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
    samples: Samples | None = Field(default=None, description="how many, a whole number; a grid has its own")
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

    modes: Few = Field(default=40, description="how many modes of a row are kept: unstable ones first, then the lowest")
    onsets: Few = Field(default=8, description="how many onsets of a row are kept, the lowest")


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


class Study(Shown, Table):
    """A case, the numbers of it that vary, and what is computed of each sample.

    st.Study(case="two-beams.toml", compute="modes", parameters={"mu": {"range": (0.0, 0.5), "points": 21}}), or
    `Study.load` of a TOML file with the same tables. parameters: by the dotted paths of ``--set``; "mu" is the friction
    coefficient of every contact. set: changes of the case that hold for all samples. Raises CaseError.
    """

    title: str = Field(default="", description="a text")
    case: str | Case = Field(description="the path of a case file, beside the study file or from there")
    compute: Compute = Field(default="modes", description='"modes", "onsets", "steady", "simulate" or "compare"')
    set: Mapping[str, Any] = Field(
        default_factory=dict[str, Any], description="a table of other values of the case, paths as in --set"
    )
    parameters: Annotated[Mapping[str, Varied], Field(min_length=1)] = Field(
        description='tables [parameters."PATH"], at least one, PATH as in --set'
    )
    sampling: Sampling = Field(default=Sampling(), description="a table [sampling]")
    correlation: Correlation | None = Field(default=None, description="a table [correlation]")
    keep: Keep = Field(default=Keep(), description="a table [keep]")
    answers: Answers = Field(default=Answers(), description="a table [answers]")
    goal: Goal | None = Field(default=None, description="a table [goal]")
    restart_failed: Truth = Field(
        default=False, description="true or false: whether rows that failed are computed again on a restart"
    )

    def __init__(self, /, **tables: Any) -> None:
        if isinstance(tables.get("case"), PathLike):
            tables["case"] = os.fspath(tables["case"])
        try:
            super().__init__(**tables)
        except ValidationError as error:
            raise CaseError.many(problems_of(error, tables, type(self))) from None
        from .checks import problems_within  # knows this class

        if problems := problems_within(self):
            raise CaseError.many(problems)

    @property
    def _line(self) -> str:
        title = f"{self.title}, " if self.title else ""
        varied = counted(len(self.parameters), "parameter")
        return f"{title}{self.compute} over {varied} ({', '.join(self.parameters)}), {self.sampling.method}"

    def __str__(self) -> str:
        return repr(self)

    @staticmethod
    def load(path: str | PathLike[str], overrides: Sequence[str] = ()) -> Study:
        """The study in a TOML file, with overrides such as "sampling.samples=100" applied; its case is sought beside
        it. Raises CaseError."""
        source = os.fspath(path)
        try:
            if reason := irregular(Path(path), LARGEST):
                raise CaseError(source, None, reason)
            text = Path(path).read_bytes().decode("utf-8-sig")
        except FileNotFoundError:
            raise CaseError(source, None, "no such file") from None
        except UnicodeDecodeError as error:
            raise CaseError(source, None, f"not UTF-8 text (byte {error.start}); save the file as UTF-8") from None
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            raise CaseError(source, None, f"cannot be read: {reason}") from None
        return Study.loads(text, overrides, folder=Path(path).resolve().parent, source=source)

    @staticmethod
    def loads(
        text: str, overrides: Sequence[str] = (), *, folder: Path | None = None, source: str = "<text>"
    ) -> Study:
        """The study in a TOML text; its case is sought from ``folder``. Raises CaseError."""
        try:
            data = tomllib.loads(text)
        except (ValueError, RecursionError) as error:  # TOMLDecodeError is one
            raise CaseError(source, None, f"not valid TOML: {error}") from None
        if not data:
            raise CaseError(source, None, 'empty; a study needs case = "…" and a table [parameters."PATH"]')
        if "bodies" in data:
            raise CaseError(source, None, 'is a case file, not a study; a study names it: case = "FILE.toml"')
        if problems := override(data, overrides):
            raise CaseError.many(problems)
        if isinstance(data.get("case"), str) and folder is not None:
            data["case"] = str(folder / data["case"])
        return Study(**data)

    def base(self) -> Case:
        """The case with what is set for all samples. Raises CaseError."""
        case = self.case if isinstance(self.case, Case) else load(self.case)
        return case.with_(dict(self.set)) if self.set else case

    def document(self) -> dict[str, Any]:
        """What the study is, as data for JSON; the case as its TOML text."""
        data = self.model_dump(mode="json", exclude={"case"}, exclude_none=True)
        return {**data, "case": self.base().to_toml()}

    @staticmethod
    def from_document(document: Mapping[str, Any]) -> Study:
        """The study of `document`: its case is text. Raises CaseError."""
        return Study(**{**document, "case": loads(str(document["case"]))})


def where(path: str, key: str = "") -> str:
    """Where a parameter stands in a study file, in messages."""
    quoted = path if path.replace("_", "").replace("-", "").isalnum() else f'"{path}"'
    return f"parameters.{quoted}{f'.{key}' if key else ''}"


def problem(path: str, key: str, given: object, accepted: str) -> Problem:
    """What is wrong with a parameter."""
    return Problem(where(path, key), given, accepted)
