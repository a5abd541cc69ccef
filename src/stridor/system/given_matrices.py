"""Matrices, contacts, loads and points given as arrays, checked as imported matrices and contacts of cases are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, cast

import numpy as np
import scipy.sparse as sp
from pydantic import Field, ValidationError

from ..case.checks import law_problems
from ..case.fields import Name, NotNegative, Number, Positive, Table, Truth
from ..case.given import plain
from ..case.messages import problems_of
from ..case.schema import Contact as ContactCase
from ..case.schema import Friction
from ..contact.interface import Contact, Rows, pair
from ..errors import CaseError, Problem
from ..matrices.report import definiteness, negative_mass, no_mass
from ..matrices.source import counted
from ..typing import Array, Sparse
from .imported import cleaned, is_symmetric

_ROLES = ("mass", "damping", "stiffness")
_ROWS = ("normal", "tangent")
_MOST_NAMED = 5


_AS_IN_CASES = ContactCase.model_fields
_ROW = "numbers, one for each freedom, or a table of weights by freedom, from 0: the relative displacement "


class GivenContact(Table):
    """A contact; what it shares with [contacts.NAME] is as there."""

    normal: Any = Field(description=f"{_ROW}slave − master along the normal, which opens")
    tangent: Any = Field(description=f"{_ROW}slave − master along the tangent")
    slip: Number = Field(
        default=1.0, description="a number other than 0 [m/s], the velocity of slave against master along tangent"
    )
    gap: Number = Field(default=0.0, description="a number [m], the gap of the structure at rest, positive when open")
    stiffness: Positive | Literal["rigid"] = Field(description=_AS_IN_CASES["stiffness"].description)
    cubic: NotNegative = Field(default=0.0, description=_AS_IN_CASES["cubic"].description)
    closed: Truth = Field(default=False, description=_AS_IN_CASES["closed"].description)
    friction: Friction = Field(description=_AS_IN_CASES["friction"].description)


class _Given(Table):
    contacts: Mapping[Name, GivenContact] = Field(description="tables by NAME")


def square_matrices(mass: object, damping: object, stiffness: object) -> tuple[Sparse, Sparse, Sparse]:
    """M, C (None: zero) and K (n, n) csr, those that are symmetric but for rounding exactly so. Raises CaseError."""
    problems: list[Problem] = []
    found: list[Sparse] = []
    for name, given in zip(_ROLES, (mass, damping, stiffness), strict=True):
        if given is None and name == "damping":
            continue
        matrix, wrong = _numbers(given, 2)
        if not wrong and (matrix.shape[0] != matrix.shape[1] or not matrix.shape[0]):
            wrong = f"must be square, not of shape {matrix.shape}"
        elif not wrong and found and matrix.shape != found[0].shape:
            wrong = f"must be of shape {found[0].shape}, as the first, not {matrix.shape}"
        if wrong:
            problems.append(Problem(name, None, wrong))
        else:
            found.append(cleaned(matrix))
    if problems:
        raise CaseError.many(problems)
    if damping is None:
        found.insert(1, sp.csr_array(found[0].shape))
    if not found[0].nnz:
        raise CaseError("mass", None, "the mass is zero; without a mass nothing vibrates")
    empty = np.flatnonzero(sum(abs(m).sum(axis=0) + abs(m).sum(axis=1) for m in found) == 0)
    if len(empty):
        named = ", ".join(map(str, empty[:_MOST_NAMED])) + (", …" if len(empty) > _MOST_NAMED else "")
        accepted = f"freedoms without an entry in any matrix (from 0: {named}); leave their rows and columns out"
        raise CaseError("stiffness", None, accepted)
    return found[0], found[1], found[2]


def not_symmetric_definite(mass: Sparse, damping: Sparse, stiffness: Sparse) -> str:
    """Why matrices are not all symmetric with a positive definite mass, "" where they are."""
    for matrix, what in zip((mass, damping, stiffness), _ROLES, strict=True):
        if not is_symmetric(matrix):
            return f"the {what} matrix is not symmetric"
    if odd := negative_mass(mass) or no_mass(mass):
        return odd
    return "" if definiteness(mass)[0] == "positive definite" else "the mass matrix is not positive definite"


def contacts_given(contacts: object, size: int) -> tuple[tuple[Contact, ...], dict[str, float]]:
    """Contacts on ``size`` freedoms, the slip of each by one motion, and the factors of their cubes by name.

    Each lies in a frame of its own, x along the tangent and y along the normal, its master the line y = 0. Raises
    CaseError with every problem found.
    """
    tables = _tables("contacts", contacts)
    data = {"contacts": {name: _plain_table(table, f"contacts.{name}") for name, table in tables.items()}}
    try:
        checked = _Given.model_validate(data).contacts
    except ValidationError as error:
        raise CaseError.many(problems_of(error, data, _Given)) from None
    problems: list[Problem] = []
    built: list[Contact] = []
    for name, table in checked.items():
        where = f"contacts.{name}"
        problems.extend(law_problems(where, table.friction, table.stiffness, table.cubic))
        if table.slip == 0:
            accepted = "must not be 0: positive where the slave slides along tangent, negative where against it"
            problems.append(Problem(f"{where}.slip", table.slip, accepted))
        rows: list[Sparse] = []
        for key in _ROWS:
            row, wrong = _row(getattr(table, key), size)
            if not wrong and not row.nnz:
                wrong = "must not be zero throughout"
            if wrong:
                problems.append(Problem(f"{where}.{key}", None, wrong))
            rows.append(row)
        if not problems:
            built.append(_contact(name, table, *rows))
    if problems:
        raise CaseError.many(problems)
    return tuple(built), {name: table.cubic for name, table in checked.items() if table.cubic}


def vectors_given(where: str, given: Mapping[str, object] | None, size: int) -> dict[str, Array]:
    """Force vectors (n,) by name. Raises CaseError."""
    found = {name: _row(value, size) for name, value in _tables(where, given).items()}
    if problems := [Problem(f"{where}.{name}", None, wrong) for name, (_, wrong) in found.items() if wrong]:
        raise CaseError.many(problems)
    return {name: np.asarray(row.toarray())[0] for name, (row, _) in found.items()}


def points_given(given: Mapping[str, object] | None, size: int, motions: int) -> dict[str, Rows]:
    """Rows (2, n) by name of the points' displacements along x and y. Raises CaseError."""
    found: dict[str, Rows] = {}
    for name, value in _tables("points", given).items():
        rows, wrong = _numbers(value, 2)
        if not wrong and rows.shape != (2, size):
            wrong = f"must be rows of shape (2, {size}), not {rows.shape}: the displacements along x and y"
        if wrong:
            raise CaseError(f"points.{name}", None, wrong)
        found[name] = Rows(rows, np.zeros((2, motions)))
    return found


def _contact(name: str, table: GivenContact, normal: Sparse, tangent: Sparse) -> Contact:
    size = normal.shape[1]
    built = pair(
        name,
        slave=Rows(sp.csr_array(sp.vstack([tangent, normal])), np.array([[table.slip], [0.0]])),
        slave_position=np.array([0.0, table.gap]),
        master=Rows(sp.csr_array((4, size)), np.zeros((4, 1))),
        master_positions=np.array([[-1.0, 0.0], [1.0, 0.0]]),
        side=1,
        stiffness=np.inf if table.stiffness == "rigid" else float(table.stiffness),
        law=table.friction.law_object(),
        closed=table.closed,
    )
    assert built is not None, "the slave is above the middle of the line"
    return built


def _tables(where: str, given: object) -> dict[str, Any]:
    if given is not None and not isinstance(given, Mapping):
        raise CaseError(where, given, "must be a dictionary, with a NAME for each")
    return dict(cast("Mapping[str, Any]", given or {}))


def _plain_table(table: object, where: str) -> object:
    """A contact's table with plain values beside its rows, which stay as they are."""
    if not isinstance(table, Mapping):
        return table
    given = cast("Mapping[str, object]", table)
    rows = {key: given[key] for key in _ROWS if given.get(key) is not None}
    return cast("dict[str, object]", plain({k: v for k, v in given.items() if k not in _ROWS}, where)) | rows


def _row(given: object, size: int) -> tuple[Sparse, str]:
    """A row (1, n) csr of numbers, or weights by freedom; and what is wrong with it, "" if nothing."""
    nothing = sp.csr_array((1, size))
    if isinstance(given, Mapping):
        weights = cast("Mapping[Any, Any]", given)
        if not all(isinstance(k, int | np.integer) and 0 <= k < size for k in weights):
            return nothing, f"the keys of its weights must be freedoms from 0 to {size - 1}"
        dense = np.zeros(size, dtype=object)
        dense[list(weights)] = list(weights.values())
        given = dense.tolist()
    row, wrong = _numbers(given, 1)
    if wrong:
        return nothing, wrong
    if row.shape != (1, size):
        return nothing, f"must be a row of {size} numbers, not of shape {row.shape}"
    return row, ""


def _numbers(given: object, least: int) -> tuple[Sparse, str]:
    """Real finite numbers as csr, a vector as one row where ``least`` is 1; and what is wrong with them."""
    empty = sp.csr_array((0, 0))
    if given is None:
        return empty, "missing – give a matrix of real numbers"
    try:
        held: Any = given if sp.issparse(given) else np.asarray(given)
        if held.dtype.kind not in "iuf":
            return empty, f"must be real numbers, not of type {held.dtype}"
        if held.ndim != 2 and not (least == 1 == held.ndim):
            return empty, f"must have two dimensions, not shape {held.shape}"
        matrix = sp.csr_array(held.reshape(1, -1) if held.ndim == 1 else held, dtype=np.float64, copy=True)
    except (ValueError, TypeError):
        return empty, "is no matrix of numbers; its rows must be equally long"
    if not np.all(np.isfinite(matrix.data)):
        many = counted(int(np.count_nonzero(~np.isfinite(matrix.data))), "number is not", "numbers are not")
        return empty, f"must be finite; {many}"
    matrix.sum_duplicates()
    matrix.eliminate_zeros()
    return matrix, ""
