"""What must hold of the bodies that are matrices of other programs, and of the parameters in their factors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ..errors import CaseError, Problem
from .bodies import AnyBody, MatrixBody
from .expression import RESERVED, parse_expression
from .schema import Contact, Parameter

MU = "mu"


def matrix_problems(
    bodies: Mapping[str, AnyBody],
    parameters: Mapping[str, Parameter],
    names: list[str],
    contacts: Mapping[str, Contact],
) -> Iterator[Problem]:
    """Ranges without their value, factors that are no arithmetic or have no value, roles that are not there.

    names: of all parameters, those whose tables are broken as well; "*" where nobody knows which there are.
    """
    for name, parameter in parameters.items():
        yield from _parameter_problems(name, parameter, contacts)
    imported = {name: body for name, body in bodies.items() if isinstance(body, MatrixBody)}
    for name, body in imported.items():
        where = f"bodies.{name}"
        for number, term in enumerate(body.terms):
            if isinstance(term.factor, str) and "*" not in names:
                yield from _factor_problems(f"{where}.terms.{number}.factor", term.factor, parameters, names, contacts)
        roles = {term.role for term in body.terms}
        if None not in roles and "mass" not in roles:
            yield Problem(f"{where}.terms", None, 'none has the role "mass"; without a mass nothing vibrates')
        if body.mesh is None:
            yield from _without_mesh(where, body)


def _parameter_problems(name: str, parameter: Parameter, contacts: Mapping[str, Contact]) -> Iterator[Problem]:
    where = f"parameters.{name}"
    if name in RESERVED:
        yield Problem(where, None, f"{name} means something else in a factor; choose another name")
    elif not name.isidentifier():
        yield Problem(where, None, "a factor would read - as minus; take letters, digits and _")
    elif name == MU and contacts:
        accepted = f"the contacts have friction coefficients; set contacts.{next(iter(contacts))}.friction.coefficient"
        yield Problem(where, None, f"{accepted}, or give --mu")
    if parameter.range is None:
        return
    low, high = parameter.range
    if low >= high:
        yield Problem(f"{where}.range", parameter.range, "the first number must be below the second")
    elif not low <= parameter.value <= high:
        yield Problem(f"{where}.value", parameter.value, f"must be in its range, {low:g} to {high:g}")


def _factor_problems(
    where: str,
    text: str,
    parameters: Mapping[str, Parameter],
    names: list[str],
    contacts: Mapping[str, Contact],
) -> Iterator[Problem]:
    try:
        expression = parse_expression(text, tuple(dict.fromkeys((*names, MU))), where)
        values = {name: parameter.value for name, parameter in parameters.items()}
        own = {contact.friction.coefficient for contact in contacts.values()}
        if len(own) == 1:
            values.setdefault(MU, own.pop())
        if all(name in values for name in expression.names):
            expression.value(values, where)
    except CaseError as error:
        yield from error.problems


def _without_mesh(where: str, body: MatrixBody) -> Iterator[Problem]:
    for key in ("group", "translation"):
        if (value := getattr(body, key)) is not None:
            yield Problem(f"{where}.{key}", value, "only used with a mesh")
    for point, at in body.points.items():
        if not isinstance(at, int):
            accepted = "coordinates need a mesh; give the number of a node, or a mesh"
            yield Problem(f"{where}.points.{point}", at, accepted)
