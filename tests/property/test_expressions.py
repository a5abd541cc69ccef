"""Factors of matrices: any text is either arithmetic with the value and the slopes it should have, or told of."""

from __future__ import annotations

import math
import warnings

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as some

from stridor.case.expression import DEEPEST, LONGEST, parse_expression
from stridor.errors import CaseError

pytestmark = pytest.mark.property
NAMES = ("Omega", "mu", "a")
VALUES = {"Omega": 1.7, "mu": 0.3, "a": -2.5}
PIECES = ("Omega", "mu", "a", "b", "1", "0", "2.5", "1e3", ".5", "1e308", "+", "-", "*", "/", "**", "(", ")", " ", "^", ",",
          "sqrt", "sin", "cos", "tan", "exp", "log", "abs", "pi", "sqrt(", "exp(", "log(", "__import__", "%", "j", "=")  # fmt: skip


TEXTS = some.one_of(some.text(max_size=60), some.lists(some.sampled_from(PIECES), max_size=25).map("".join))


@settings(max_examples=300, deadline=None)
@given(TEXTS)
@example("(" * 5000)
@example("-" * 400 + "1")
@example("2**" * 150 + "1")
@example("9**9**9**9")
@example("1" * 400)
@example("10**400")
@example("(-1)**0.5")
@example("1e308*10-1e308*10")
@example("0**0*a**mu")
@example("__import__('os').system('true')")
@example("\x00")
@example("٣")
def test_no_text_does_anything_but_arithmetic(text: str):
    nothing_but_arithmetic(text)


@pytest.mark.slow
@settings(max_examples=3000, deadline=None)
@given(TEXTS)
def test_no_text_of_many_does_anything_but_arithmetic(text: str):
    nothing_but_arithmetic(text)


def nothing_but_arithmetic(text: str) -> None:
    for call in ("value", "slopes"):
        try:
            found = getattr(parse_expression(text, NAMES, "here"), call)(VALUES, "here")
        except CaseError as error:
            told = error.problems
            numbers: list[float] = []
        else:
            told = ()
            numbers = [found] if call == "value" else list(found.values())
        assert all(problem.where == "here" and "\n" not in problem.accepted for problem in told)
        assert len(told) <= 1
        assert all(isinstance(x, float) and math.isfinite(x) for x in numbers)


def _unary(inner: some.SearchStrategy[str]) -> some.SearchStrategy[str]:
    function = some.sampled_from(("sqrt", "sin", "cos", "tan", "exp", "log", "abs", "-", "+", ""))
    return some.tuples(function, inner).map(lambda t: f"{t[0]}({t[1]})")


def _binary(inner: some.SearchStrategy[str]) -> some.SearchStrategy[str]:
    sign = some.sampled_from((" + ", "-", "*", " / ", "**"))
    return some.tuples(inner, sign, inner).map("".join)


EXPRESSIONS = some.recursive(
    some.sampled_from(("Omega", "mu", "a", "2", "0.75", "1e-1", "pi", "3.")), lambda e: _unary(e) | _binary(e), max_leaves=12
)


@settings(max_examples=300, deadline=None)
@given(EXPRESSIONS)
def test_values_are_python_s_own_and_slopes_those_of_differences(text: str):
    expression = parse_expression(text, NAMES)
    functions = {name: getattr(math, name) for name in ("sqrt", "sin", "cos", "tan", "exp", "log", "pi")}

    def true(values: dict[str, float]) -> float:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return eval(text, {"__builtins__": {}}, {**functions, "abs": abs, **values})

    try:
        wanted = true(VALUES)
        if isinstance(wanted, complex) or not math.isfinite(wanted):
            raise ValueError
    except (ArithmeticError, ValueError, TypeError):
        with pytest.raises(CaseError):
            expression.value(VALUES)
        return
    try:
        value = expression.value(VALUES)
    except CaseError:
        return  # something on the way is not finite or not real, if the result is
    assert value == pytest.approx(wanted, rel=1e-12, abs=1e-300)
    try:
        slopes = expression.slopes(VALUES)
    except CaseError:
        return
    assert list(slopes) == list(expression.names)
    for name, slope in slopes.items():
        differences: list[float] = []
        for step in (1e-4, 5e-5):
            sides = [{**VALUES, name: VALUES[name] + sign * step} for sign in (1, -1)]
            try:
                upper, lower = (expression.value(side) for side in sides)
            except CaseError:
                return
            differences.append((upper - lower) / (2 * step))
        better = (4 * differences[1] - differences[0]) / 3
        uncertain = abs(differences[1] - differences[0])
        scale = 1e-6 * abs(better) + 1e-9 * max(1.0, abs(value))
        if uncertain < 1e-3 * max(abs(better), abs(value), 1.0):
            assert abs(better - slope) <= 0.2 * uncertain + scale


@pytest.mark.parametrize(
    ("text", "value", "slope"),
    [
        ("Omega**2 - 1", 3.0, 4.0),
        ("1/Omega", 0.5, -0.25),
        ("-Omega**2", -4.0, -4.0),
        ("2**-Omega", 0.25, -0.25 * math.log(2)),
        ("2**Omega**2", 16.0, 64.0 * math.log(2)),
        ("Omega - 1 - 1", 0.0, 1.0),
        ("8/Omega/2", 2.0, -1.0),
        ("abs(-Omega)*sin(pi*Omega)", 0.0, 2 * math.pi),
        ("3", 3.0, None),
        ("Omega*0 + sqrt(Omega*2)", 2.0, 0.5),
    ],
)
def test_precedence_and_slopes(text: str, value: float, slope: float | None):
    found = parse_expression(text, ("Omega",))
    assert found.value({"Omega": 2.0}) == pytest.approx(value, abs=1e-15)
    assert found.slopes({"Omega": 2.0}) == ({} if slope is None else {"Omega": pytest.approx(slope, rel=1e-13)})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Omgea + 1", "no such parameter as 'Omgea'; did you mean 'Omega'? there are: Omega, mu, pi"),
        ("sine(1)", "no such function as 'sine'; did you mean 'sin'? there are: sqrt, sin, cos, tan, exp, log, abs"),
        ("Omega(2)", "Omega is no function; write * between factors; functions: sqrt, sin, cos, tan, exp, log, abs"),
        ("sqrt", "sqrt is a function; write sqrt(…)"),
        ("2 Omega", "'Omega' stands where an operator (+ - * / **) or the end should be"),
        ("(1 + 2", 'breaks off where ")" should follow'),
        ("1 +", "breaks off where a number, a name or a bracket should follow"),
        ("1 + )", "')' stands where a number, a name or a bracket should be"),
        ("Omega^2", "'^' is not understood; write ** for powers; accepted: numbers, names, + - * / **, brackets and the functions sqrt, sin, cos, tan, exp, log, abs"),
        ("  ", 'is empty; write a number or an expression such as "Omega**2 - 1"'),
        ("1e999", "the number 1e999 is too large"),
        ("1/(Omega - 2)", "division by zero at Omega = 2"),
        ("log(mu - 1)", "the logarithm of zero or a negative number is not real at mu = 0.5"),
        ("sqrt(-Omega)", "the square root of a negative number is not real at Omega = 2"),
        ("(-8)**(1/3)", "a fractional power of a negative number is not real"),
        ("exp(Omega*1000)", "the result is too large at Omega = 2"),
        ("+".join(["1"] * LONGEST), f"has {2 * LONGEST - 1} characters; at most {LONGEST} are read"),
        ("(" * (DEEPEST + 1), f"is nested more than {DEEPEST} deep"),
    ],
)  # fmt: skip
def test_messages(text: str, message: str):
    with pytest.raises(CaseError) as caught:
        parse_expression(text, ("Omega", "mu"), "factor").value({"Omega": 2.0, "mu": 0.5}, "factor")
    assert caught.value.problems[0].accepted == message
