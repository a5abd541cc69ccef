"""Kinds of values that tables of a case file hold."""

from __future__ import annotations

from typing import Annotated, Any, Literal, NoReturn

from pydantic import BaseModel, ConfigDict, Field

NAME_RULE = "a letter, then letters, digits, _ or -"

Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]*$")]
Label = Annotated[str, Field(min_length=1)]
# Beyond it, squares and products of values of a case leave the range of numbers.
MOST = 1e100
Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-MOST, le=MOST)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=MOST)]
NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=MOST)]
Truth = Annotated[bool, Field(strict=True)]
Vector = tuple[Number, Number]
PlaneOrSpace = Annotated[tuple[Number, ...], Field(min_length=2, max_length=3)]
Space = tuple[Number, Number, Number]
NodeNumber = Annotated[int, Field(strict=True, ge=1)]
Count = Annotated[int, Field(strict=True, ge=1, le=100_000)]
Counts = Annotated[tuple[Count, ...], Field(min_length=1, max_length=3)]
Direction = Literal["x", "y", "z", "rotation"]

EXAMPLE = '"contacts.A.friction.coefficient": 0.3'  # of a change
POINT = 'a point, "body.point" or "body@distance"'
PLACE = 'a point, "body.point" or "body@distance", or a boundary, "body.boundary"'


def is_zero(vector: tuple[float, ...]) -> bool:
    """Whether a vector is too short to give a direction: squares of its components would underflow."""
    return max(map(abs, vector)) < 1.0 / MOST


class FrozenError(TypeError, ValueError):
    """A case is not changed but varied by copy: what frozen tables and dictionaries raise, of both their kinds."""

    def __init__(self, change: str = EXAMPLE) -> None:
        super().__init__(f"a case is frozen; vary it by copy: case.with_({{{change}}})")


class FrozenTable(dict[str, Any]):
    """A table by names that does not change: a dict that refuses, pickled and copied as one."""

    def _refused(self, *_: object, **__: object) -> NoReturn:
        raise FrozenError

    __setitem__ = __delitem__ = __ior__ = clear = pop = popitem = setdefault = update = _refused  # pyright: ignore

    def __reduce__(self) -> tuple[type[FrozenTable], tuple[dict[str, Any]]]:
        return FrozenTable, (dict(self),)  # item by item, as dicts are, would be refused


class Table(BaseModel):
    """A table of the case file: frozen, with what it holds, and without keys it does not know."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def model_post_init(self, context: Any, /) -> None:
        """Freeze tables by names, of which defaults pass no validator."""
        values = vars(self)
        values.update({name: FrozenTable(value) for name, value in values.items() if isinstance(value, dict)})

    def __setattr__(self, name: str, value: Any) -> None:
        if not name.startswith("_"):
            raise FrozenError(self._with(name))
        super().__setattr__(name, value)

    def __delattr__(self, name: str) -> None:
        if not name.startswith("_"):
            raise FrozenError(self._with(name))
        super().__delattr__(name)

    def _with(self, name: str) -> str:
        """How a change of a key is written, of a table by an example: it does not know where in a case it stands."""
        return EXAMPLE
