"""What public calls take, by the name of each argument: refused by name where it is of another kind altogether.

Ranges of numbers and what else depends on the case are looked at where they are used, by `study.asked` and others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import wraps
from inspect import signature
from numbers import Real
from os import PathLike
from typing import Any, ParamSpec, TypeVar, cast

from .errors import CaseError, kind_of

P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True)
class Accepted:
    """What an argument may be: whether a value is, and in words."""

    test: Callable[[Any], bool]
    words: str

    def or_none(self) -> Accepted:
        """The same, or None."""
        return Accepted(lambda value: value is None or self.test(value), f"{self.words}, or None")

    def require(self, value: Any, where: str) -> None:
        """Refuse a value that is none of it. Raises CaseError."""
        if not self.test(value):
            given = value if isinstance(value, str | float | int | list | tuple | dict) else kind_of(value)
            if value is None:
                raise CaseError(where, None, f"missing – {self.words}")
            raise CaseError(where, given, self.words)


def takes(**accepted: Accepted) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """A call that refuses arguments of these names where they are of another kind, by CaseError with the name."""

    def made(call: Callable[P, R]) -> Callable[P, R]:
        own = signature(call)
        assert accepted.keys() <= own.parameters.keys(), "arguments of the call"

        @wraps(call)
        def checked(*args: P.args, **kwargs: P.kwargs) -> R:
            try:
                given = own.bind(*args, **kwargs).arguments
            except TypeError:
                return call(*args, **kwargs)  # which says what is missing or too much
            for name, kind in accepted.items():
                if name in given:
                    kind.require(given[name], name)
            return call(*args, **kwargs)

        return checked

    return made


def is_number(value: Any) -> bool:
    """Whether it is a real number; true and false are none."""
    return not isinstance(value, bool) and isinstance(value, Real)


def instance(kind: type, words: str) -> Accepted:
    """One of a class, in words."""
    return Accepted(lambda value: isinstance(value, kind), words)


def _is_switch(value: Any) -> bool:
    return isinstance(value, bool) or (_is_single(value) and getattr(value.dtype, "kind", "") == "b")


def _all(test: Callable[[Any], bool]) -> Callable[[Any], bool]:
    """Whether something is one of what a test takes, or a list of them."""

    def tested(value: Any) -> bool:
        if isinstance(value, str | Mapping | Iterator) or not isinstance(value, Iterable) or _is_single(value):
            return test(value)
        return all(test(v) for v in cast("Iterable[Any]", value))

    return tested


def _is_single(value: Any) -> bool:
    """Whether it is an array of numpy without an axis, which says of itself that it may be gone through."""
    return getattr(value, "ndim", None) == 0


def _one(value: Any) -> Any:
    return value.item() if _is_single(value) and hasattr(value, "item") else value


def _is_whole(value: Any) -> bool:
    return hasattr(value, "__index__") and not isinstance(value, bool) and getattr(value, "ndim", 0) == 0


SWITCH = Accepted(_is_switch, "True or False")
FUNCTION = Accepted(callable, "a function").or_none()
SWITCH_OR_NONE = SWITCH.or_none()
PATH = Accepted(lambda value: isinstance(value, str | PathLike), "a path")
TEXT = Accepted(lambda value: isinstance(value, str), "a text")
NUMBER = Accepted(is_number, "a number")
WHOLE = Accepted(_is_whole, "a whole number")
NUMBERS = Accepted(_all(lambda value: is_number(_one(value))), "a number, or a list of numbers")
PAIR = Accepted(
    lambda value: not isinstance(value, str | Mapping | Iterator)
    and isinstance(value, Iterable)
    and [is_number(v) for v in cast("Iterable[Any]", value)] == [True, True],
    "two numbers",
)
TABLE = Accepted(lambda value: isinstance(value, Mapping), "a table")
SEED = Accepted(lambda value: _is_whole(value) and value >= 0, "a whole number ≥ 0")
STORE = Accepted(
    lambda value: all(callable(getattr(value, name, None)) for name in ("get", "put")),
    "a store of finished parts, of io.kept_parts",
).or_none()
OVERRIDES = Accepted(
    lambda value: not isinstance(value, str | Mapping) and isinstance(value, Iterable)
    and all(isinstance(text, str) for text in cast("Iterable[Any]", value)),
    'a list of texts path=value, such as ["contacts.A.friction.coefficient=0.3"]; [] for none',
)
