"""What can go wrong, said in one line each: where, what was given, what is accepted."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

_LONGEST_SHOWN = 60
_LONGEST_PLACE = 400
_LONG_WORD = re.compile(r"\S{400,}")
_LONGEST_NUMBER = 10_000  # bits of a whole number that is written out
_MOST_SHOWN = 100  # problems of one error that are printed


class StridorError(Exception):
    """Anything stridor refuses to do or cannot do, with a message meant for its user."""


class AnalysisError(StridorError):
    """The case is valid, but the analysis has no answer (a contact that would pull, a singular system).

    trajectory: of a run in time that broke off, what there is of it (`temporal.Trajectory`); None of all others.
    """

    trajectory: Any = None


@dataclass(frozen=True)
class Problem:
    """One thing wrong with what was given.

    where: dotted path of the value, as in an override; given: the value as written, None where nothing was;
    accepted: what is wrong with it and what would be accepted.
    """

    where: str
    given: object
    accepted: str

    def __str__(self) -> str:
        where = self.where
        if len(where) > _LONGEST_PLACE:  # a key may be as long as its file
            where = f"{where[: _LONGEST_PLACE // 4]}…{where[-_LONGEST_PLACE // 4 :]}"
        # A name read from a file may be as long as its line.
        accepted = _LONG_WORD.sub(lambda word: f"{word[0][:100]}…{word[0][-100:]}", self.accepted)
        if self.given is None:
            return f"{where}: {accepted}"
        return f"{where}: {shown(self.given)} – {accepted}"


class NotSlidingError(AnalysisError):
    """Nothing slides along any contact, whatever the friction coefficient: no support was given a velocity."""


class NotReducibleError(AnalysisError):
    """No model reduced over parameters takes the case; lacks: what of it, and why."""

    def __init__(self, message: str, lacks: str) -> None:
        super().__init__(message)
        self.lacks = lacks


class FollowingError(AnalysisError):
    """Branches of modes cannot be followed from μ = 0, or the basis that they are followed on does not settle: the
    eigenvalues at a μ do not depend on it."""


class CaseError(StridorError):
    """Bad input. `problems` holds everything found wrong, and str() is one line for each.

    CaseError("contacts.A.slave", "beam1.tipp", "no such point; beam1 has: start, tip, end")
    """

    problems: tuple[Problem, ...]

    def __init__(self, where: str, given: object, accepted: str) -> None:
        super().__init__(where, given, accepted)
        self.problems = (Problem(where, given, accepted),)

    @classmethod
    def many(cls, problems: Iterable[Problem]) -> CaseError:
        """One error for several problems, in the order given. Raises ValueError if there are none."""
        held = tuple(problems)
        if not held:
            raise ValueError("a CaseError needs at least one problem")
        error = cls(held[0].where, held[0].given, held[0].accepted)
        error.problems = held
        return error

    def __str__(self) -> str:
        lines = [str(problem) for problem in self.problems[:_MOST_SHOWN]]
        more = len(self.problems) - len(lines)
        return "\n".join([*lines, *([f"and {more} more problems"] if more else [])])

    def __reduce__(self) -> tuple[object, ...]:
        # Between processes exceptions are rebuilt from their arguments; that would keep one problem only.
        return CaseError.many, (self.problems,)


def kind_of(value: object) -> str:
    """What a value is, in words: "an int", "a list"."""
    name = type(value).__name__
    return f"{'an' if name[0] in 'aeiouAEIO' else 'a'} {name}"


def shown(value: object) -> str:
    """The value as it reads in a case file, on one line, shortened to about 60 characters."""
    text = _written(value)
    return text if len(text) <= _LONGEST_SHOWN else text[: _LONGEST_SHOWN - 1] + "…"


def _written(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int) and value.bit_length() > _LONGEST_NUMBER:  # Python refuses to write thousands of digits
        return f"a whole number of {int(value.bit_length() * 0.30103) + 1} digits"
    if isinstance(value, Mapping):
        table = cast("Mapping[object, object]", value)
        inner = ", ".join(f"{key} = {_written(item)}" for key, item in table.items())
        return f"{{ {inner} }}" if inner else "{}"
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        return "[" + ", ".join(_written(item) for item in cast("Sequence[object]", value)) + "]"
    return repr(value) if isinstance(value, str) else str(value)
