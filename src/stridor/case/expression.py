"""Factors as a user writes them, "Omega**2 - 1": arithmetic with named numbers and nothing else, and its slopes.

Read by a parser of its own into a list of steps for a stack machine, so that no text can do more than arithmetic.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NoReturn

from ..errors import CaseError
from .points import choice

LONGEST = 500  # characters
DEEPEST = 50  # brackets, signs and powers within each other
CONSTANTS = {"pi": math.pi}
FUNCTIONS = ("sqrt", "sin", "cos", "tan", "exp", "log", "abs")
RESERVED = (*FUNCTIONS, *CONSTANTS)
_TOKEN = re.compile(
    r"[ \t]*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*)|(?P<sign>\*\*|[-+*/()]))",
    re.ASCII,
)
_ACCEPTED = "numbers, names, + - * / **, brackets and the functions " + ", ".join(FUNCTIONS)
_CLOSING = "the bracket that closes this one"

Slopes = dict[str, float]
_Dual = tuple[float, Slopes]


class _Undefined(Exception):
    """Arithmetic without a finite real result."""


@dataclass(frozen=True)
class Expression:
    """A text and what it means. names: the parameters in it, in the order in which they come."""

    text: str
    names: tuple[str, ...]
    _steps: tuple[tuple[str, float | str], ...]

    def value(self, values: Mapping[str, float], where: str = "expression") -> float:
        """The number for values of its parameters. Raises CaseError at `where` where there is no finite real one."""
        return self._evaluated(values, where, slopes=False)[0]

    def slopes(self, values: Mapping[str, float], where: str = "expression") -> dict[str, float]:
        """Its exact derivative over each of its parameters. Raises CaseError where one is not finite."""
        found = self._evaluated(values, where, slopes=True)[1]
        return {name: found.get(name, 0.0) for name in self.names}

    def _evaluated(self, values: Mapping[str, float], where: str, *, slopes: bool) -> _Dual:
        stack: list[_Dual] = []
        try:
            for kind, what in self._steps:
                if kind == "number":
                    stack.append((float(what), {}))
                elif kind == "name":
                    stack.append((float(values[str(what)]), {str(what): 1.0} if slopes else {}))
                elif kind == "call":
                    stack.append(_applied(str(what), stack.pop()))
                else:
                    right = stack.pop()
                    stack.append(_combined(str(what), stack.pop(), right))
                _require_finite(stack[-1])
        except _Undefined as reason:
            at = ", ".join(f"{name} = {values[name]:g}" for name in self.names)
            raise CaseError(where, self.text, f"{reason}{f' at {at}' if at else ''}") from None
        return stack[0]


def parse_expression(text: str, known: tuple[str, ...] | list[str], where: str = "expression") -> Expression:
    """The expression that a text is, of the parameters ``known``. Raises CaseError at `where` if it is none."""
    return _Parser(text, known, where).parsed()


class _Parser:
    """Precedence climbing as in Python: ** binds tighter than a sign before it and from the right."""

    def __init__(self, text: str, known: tuple[str, ...] | list[str], where: str) -> None:
        self.text, self.known, self.where = text, known, where
        self.tokens = self._tokens()
        self.at = 0
        self.depth = 0
        self.steps: list[tuple[str, float | str]] = []
        self.names: dict[str, None] = {}

    def parsed(self) -> Expression:
        if not self.tokens:
            self._refuse('is empty; write a number or an expression such as "Omega**2 - 1"')
        self._sum()
        if self.at < len(self.tokens):
            self._unexpected("an operator (+ - * / **) or the end")
        return Expression(self.text, tuple(self.names), tuple(self.steps))

    def _tokens(self) -> list[tuple[str, str]]:
        if len(self.text) > LONGEST:
            self._refuse(f"has {len(self.text)} characters; at most {LONGEST} are read")
        found: list[tuple[str, str]] = []
        position, end = 0, len(self.text.rstrip(" \t"))
        while position < end:
            match = _TOKEN.match(self.text, position)
            if match is None:
                odd = self.text[position:].lstrip(" \t")[0]
                hint = "; write ** for powers" if odd == "^" else ""
                self._refuse(f"{odd!r} is not understood{hint}; accepted: {_ACCEPTED}")
            found.append((str(match.lastgroup), str(match[match.lastgroup or 0])))
            position = match.end()
        return found

    def _sum(self) -> None:
        self._chain(("+", "-"), self._product)

    def _product(self) -> None:
        self._chain(("*", "/"), self._signed)

    def _chain(self, signs: tuple[str, ...], part: Callable[[], None]) -> None:
        part()
        while (sign := self._sign()) in signs:
            self.at += 1
            part()
            self.steps.append(("operator", sign))

    def _signed(self) -> None:
        sign = self._sign()
        if sign not in ("+", "-"):
            self._power()
            return
        self.at += 1
        self._deeper(self._signed)
        if sign == "-":
            self.steps.append(("call", "-"))

    def _power(self) -> None:
        self._single()
        if self._sign() == "**":
            self.at += 1
            self._deeper(self._signed)
            self.steps.append(("operator", "**"))

    def _single(self) -> None:
        if self.at >= len(self.tokens):
            self._unexpected("a number, a name or a bracket")
        kind, text = self.tokens[self.at]
        if kind == "number":
            self.at += 1
            value = float(text)
            if not math.isfinite(value):
                self._refuse(f"the number {text} is too large")
            self.steps.append(("number", value))
        elif kind == "name":
            self.at += 1
            self._named(text)
        elif text == "(":
            self._bracket()
        else:
            self._unexpected("a number, a name or a bracket")

    def _named(self, name: str) -> None:
        called = self._sign() == "("
        if name in FUNCTIONS:
            if not called:
                self._refuse(f"{name} is a function; write {name}(…)")
            self._bracket()
            self.steps.append(("call", name))
        elif name in CONSTANTS or name in self.known:
            if called:
                self._refuse(f"{name} is no function; write * between factors; functions: {', '.join(FUNCTIONS)}")
            if name in CONSTANTS:
                self.steps.append(("number", CONSTANTS[name]))
                return
            self.names[name] = None
            self.steps.append(("name", name))
        else:
            kind = "function" if called else "parameter"
            names = FUNCTIONS if called else (*self.known, *CONSTANTS)
            self._refuse(f"no such {kind} as {name!r}{choice(name, names, 'there are')}")

    def _bracket(self) -> None:
        self.at += 1
        self._deeper(self._sum)
        if self._sign() != ")":
            self._unexpected(_CLOSING)
        self.at += 1

    def _deeper(self, part: Callable[[], None]) -> None:
        self.depth += 1
        if self.depth > DEEPEST:
            self._refuse(f"is nested more than {DEEPEST} deep")
        part()
        self.depth -= 1

    def _sign(self) -> str:
        kind, text = self.tokens[self.at] if self.at < len(self.tokens) else ("", "")
        return text if kind == "sign" else ""

    def _unexpected(self, wanted: str) -> NoReturn:
        wanted = '")"' if wanted == _CLOSING else wanted
        if self.at >= len(self.tokens):
            self._refuse(f"breaks off where {wanted} should follow")
        self._refuse(f"{self.tokens[self.at][1]!r} stands where {wanted} should be")

    def _refuse(self, accepted: str) -> NoReturn:
        raise CaseError(self.where, self.text, accepted)


def _applied(name: str, inner: _Dual) -> _Dual:
    """A function, or the minus sign, of a number with slopes."""
    x, slopes = inner
    if name == "sqrt" and x < 0:
        raise _Undefined("the square root of a negative number is not real")
    if name == "log" and x <= 0:
        raise _Undefined("the logarithm of zero or a negative number is not real")
    try:
        value = -x if name == "-" else abs(x) if name == "abs" else getattr(math, name)(x)
        if not slopes:
            return value, {}
        slope = {
            "-": lambda: -1.0,
            "sqrt": lambda: 0.5 / value,
            "sin": lambda: math.cos(x),
            "cos": lambda: -math.sin(x),
            "tan": lambda: 1.0 + value * value,
            "exp": lambda: value,
            "log": lambda: 1.0 / x,
            "abs": lambda: float(x > 0) - float(x < 0),
        }[name]()
    except OverflowError:
        raise _Undefined("the result is too large") from None
    except ZeroDivisionError:
        raise _Undefined(f"the slope of {name} is infinite") from None
    return value, {key: slope * d for key, d in slopes.items()}


def _combined(sign: str, left: _Dual, right: _Dual) -> _Dual:
    """Two numbers with slopes joined by an operator."""
    (a, da), (b, db) = left, right
    if sign == "/" and b == 0.0:
        raise _Undefined("division by zero")
    try:
        if sign == "+":
            return a + b, _mixed(da, 1.0, db, 1.0)
        if sign == "-":
            return a - b, _mixed(da, 1.0, db, -1.0)
        if sign == "*":
            return a * b, _mixed(da, b, db, a)
        if sign == "/":
            return a / b, _mixed(da, 1.0 / b, db, -(a / b) / b)
        return _raised(left, right)
    except OverflowError:
        raise _Undefined("the result is too large") from None
    except ZeroDivisionError:  # 1/b of a number that is almost zero
        raise _Undefined("division by zero") from None


def _raised(left: _Dual, right: _Dual) -> _Dual:
    (a, da), (b, db) = left, right
    if a == 0.0 and b < 0:
        raise _Undefined("division by zero (a negative power of zero)")
    if a < 0 and not b.is_integer():  # ty: ignore[missing-union-attribute]  # all are floats
        raise _Undefined("a fractional power of a negative number is not real")
    value = a**b
    by_base = by_power = 0.0
    if da and b != 0.0:
        if a == 0.0 and b < 1:
            raise _Undefined("the slope of a power below 1 is infinite at zero")
        by_base = b * a ** (b - 1)
    if db:
        if a < 0:
            raise _Undefined("a power of a negative number has no slope over its exponent")
        by_power = value * math.log(a) if a > 0 else 0.0
    return value, _mixed(da, by_base, db, by_power)


def _mixed(left: Slopes, by_left: float, right: Slopes, by_right: float) -> Slopes:
    if not left and not right:
        return {}
    return {
        key: by_left * left.get(key, 0.0) + by_right * right.get(key, 0.0) for key in dict.fromkeys((*left, *right))
    }


def _require_finite(number: _Dual) -> None:
    value, slopes = number
    if not math.isfinite(value):
        raise _Undefined("the result is too large")
    if slopes and not all(math.isfinite(d) for d in slopes.values()):
        raise _Undefined("the slope is too large")
