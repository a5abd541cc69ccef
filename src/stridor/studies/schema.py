"""A study file: which case, which of its numbers vary and how, what is computed, where the samples lie."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError

from ..case import Case, load, loads
from ..case.fields import Table, Truth
from ..case.messages import problems_of
from ..case.overrides import override
from ..errors import CaseError
from ..notebook import Shown, counted
from ..reading import irregular
from .checks import FRICTION, problems_within
from .tables import Answers, Compute, Correlation, Goal, Keep, Sampling, Varied

LARGEST = 2**22  # bytes of a study file


class Study(Shown, Table):
    """A case, the numbers of it that vary, and what is computed of each sample.

    st.Study(case="two-beams.toml", compute="modes", parameters={"mu": {"range": (0.0, 0.5), "points": 21}}), or
    `Study.load` of a TOML file with the same tables. parameters: by the dotted paths of ``--set``; "mu" is the friction
    coefficient of every contact, and the name of an entry of the case's [parameters] stands for the path of its value,
    by which the study has it then. set: changes of the case that hold for all samples. Raises CaseError.
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
        self._name_in_full()
        if problems := problems_within(self):
            raise CaseError.many(problems)

    def _name_in_full(self) -> None:
        """Paths in place of bare names of the case's [parameters]: every other part of a study goes by paths. Raises
        CaseError where one is given both ways."""
        bare = [path for path in self.parameters if "." not in path and path != FRICTION]
        entries = self.base().parameters if bare else {}
        full = {name: f"parameters.{name}.value" for name in bare if name in entries}
        if twice := [name for name, path in full.items() if path in self.parameters]:
            raise CaseError(f"parameters.{twice[0]}", None, f"is {full[twice[0]]}, which is given too; give it once")
        if not full:
            return
        renamed = {full.get(path, path): varied for path, varied in self.parameters.items()}
        object.__setattr__(self, "parameters", renamed)
        if self.correlation is not None:
            of = tuple(full.get(name, name) for name in self.correlation.of)
            object.__setattr__(self, "correlation", self.correlation.model_copy(update={"of": of}))

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
        if problems := override(data, overrides, of="study"):
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
