"""The case: what a user wrote, checked as a whole and frozen."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, Literal, cast

from pydantic import Field, TypeAdapter, ValidationError, model_validator

from ..errors import CaseError, Problem, kind_of
from ..notebook import Shown, counted, html_table
from .bodies import BeamBody, MatrixBody
from .checks import SoundTables, problems_between, slave_side
from .expression import parse_expression
from .fields import Name
from .given import as_written, plain
from .matrix_checks import MU
from .messages import problems_of
from .oddities import oddities
from .overrides import apply, split_path
from .points import Location, PointRef, nearest, parse_location, parse_point
from .schema import (
    DEFAULT_PHASES,
    ENTRIES,
    Body,
    Comparison,
    Contact,
    Dashpot,
    Load,
    MaterialTable,
    Modal,
    Parameter,
    Phase,
    Phases,
    Reference,
    Spring,
    Steady,
    Support,
    Table,
    Temporal,
    Tie,
)


class Case(Shown, Table):
    """Bodies, what holds and loads them, where they slide, and the settings of the analyses. SI units.

    Case(bodies={…}, contacts={…}, …) takes the tables of a case file (docs/case-file.md) as dictionaries and lists,
    with NumPy numbers and arrays and paths where they are handy; None is as left out, and relative paths of meshes and
    matrices start at the working directory. Frozen; varied by copy with `with_`, written with `to_toml`. Raises
    CaseError with every problem found, in the words and with the places that `load` and `loads` give.
    """

    title: str = Field(default="", description="a text")
    units: Literal["SI", "nondimensional"] = Field(
        default="SI", description='"SI" or "nondimensional", which keeps warnings of unusual sizes away'
    )
    parameters: Mapping[Name, Parameter] = Field(
        default_factory=dict[str, Parameter], description="tables [parameters.NAME]"
    )
    materials: Mapping[Name, MaterialTable] = Field(
        default_factory=dict[str, MaterialTable], description="tables [materials.NAME]"
    )
    bodies: Annotated[Mapping[Name, Body], Field(min_length=1)] = Field(
        description="tables [bodies.NAME], at least one"
    )
    supports: Mapping[Name, Support] = Field(default_factory=dict[str, Support], description="tables [supports.NAME]")
    loads: Mapping[Name, Load] = Field(default_factory=dict[str, Load], description="tables [loads.NAME]")
    contacts: Mapping[Name, Contact] = Field(default_factory=dict[str, Contact], description="tables [contacts.NAME]")
    ties: Mapping[Name, Tie] = Field(default_factory=dict[str, Tie], description="tables [ties.NAME]")
    springs: Mapping[Name, Spring] = Field(default_factory=dict[str, Spring], description="tables [springs.NAME]")
    dashpots: Mapping[Name, Dashpot] = Field(default_factory=dict[str, Dashpot], description="tables [dashpots.NAME]")
    phases: Phases = Field(default=DEFAULT_PHASES, description="a list of tables [[phases]]")
    steady: Steady = Field(default=Steady(), description="a table [steady]")
    modal: Modal = Field(default=Modal(), description="a table [modal]")
    temporal: Temporal = Field(default=Temporal(), description="a table [temporal]")
    comparison: Comparison = Field(default=Comparison(), description="a table [comparison]")
    reference: Reference | None = Field(default=None, description="a table [reference]")

    def __init__(self, /, *unnamed: object, **tables: Any) -> None:
        if unnamed:
            accepted = "tables are given by name, Case(bodies={…}, contacts={…}); stridor.load takes the path of a file"
            raise CaseError("case", kind_of(unnamed[0]), accepted)
        data = as_written(tables)
        try:
            super().__init__(**data)
        except ValidationError as error:
            found = problems_of(error, data, type(self))
            told = {problem.where for problem in found}
            between = [problem for problem in problems_between(_sound(data, error)) if problem.where not in told]
            raise CaseError.many(_in_file_order([*found, *between])) from None

    def _with(self, name: str) -> str:
        return f'"{name}": …'

    @classmethod
    def checked(cls, data: Mapping[str, Any]) -> Case:
        """The case that data, as read from TOML, describe. Raises CaseError with every problem found."""
        return cls(**data)

    @model_validator(mode="after")
    def _fits_together(self) -> Case:
        # A CaseError is no ValueError: it passes through pydantic as it is.
        tables = {name: getattr(self, name) for name in type(self).model_fields if name not in ("title", "units")}
        if problems := problems_between(SoundTables(**tables)):
            raise CaseError.many(problems)
        return self

    @property
    def warnings(self) -> list[str]:
        """One line for each value that is allowed but probably not meant (units, digits), or for what is left out."""
        return list(oddities(self))

    @property
    def _line(self) -> str:
        bodies = "1 body" if len(self.bodies) == 1 else f"{len(self.bodies)} bodies"
        return f"{f'{self.title}, ' if self.title else ''}{bodies}, {counted(len(self.contacts), 'contact')}"

    def __str__(self) -> str:
        return repr(self)

    def _repr_html_(self) -> str:
        rows = [(name, f"{body.type} {getattr(body, 'material', None) or ''}") for name, body in self.bodies.items()]
        rows += [
            (name, f"{c.slave} on {c.master}, {stiffness}, {c.friction.law} μ = {c.friction.coefficient:g}")
            for name, c in self.contacts.items()
            for stiffness in (c.stiffness if isinstance(c.stiffness, str) else f"stiffness {c.stiffness:g}",)
        ]
        others = ("supports", "loads", "ties", "springs", "dashpots")
        rest = [(table, ", ".join(getattr(self, table))) for table in others]
        rest.append(("phases", ", ".join(f"{phase.name} {phase.duration:g} s" for phase in self.phases)))
        return html_table(f"Case {self.title}", ("", "what it is"), rows, (f"{name}: {of}" for name, of in rest if of))

    @property
    def text(self) -> str:
        """The case as TOML: only what was given, without comments; `loads` makes an equal case of it."""
        return self.to_toml()

    def to_toml(self, *, defaults: bool = False) -> str:
        """The case as TOML, defaults written out if so chosen; `loads` makes an equal case of it."""
        import tomlkit

        return tomlkit.dumps(self._data(defaults=defaults))  # pyright: ignore[reportUnknownMemberType]

    def with_(self, changes: Mapping[str, object] | None = None, /, **more: object) -> Case:
        """A copy with other values at dotted paths, checked again; None removes a key.

        case.with_({"contacts.A.friction.coefficient": 0.3}), case.with_(title="lower friction"). An item of a
        list is reached by its number from 0 or its name ("phases.slide.duration"). Raises CaseError.
        """
        given: Any = changes
        if given is not None and not isinstance(given, Mapping):
            how = 'a table of values by their paths, such as {"contacts.A.friction.coefficient": 0.3}'
            raise CaseError("changes", given if isinstance(given, str | float | int) else kind_of(given), how)
        data = self._data()
        problems: list[Problem] = []
        for path, value in {**(changes or {}), **more}.items():
            problems.extend(apply(data, split_path(path), plain(value, path)))
        if problems:
            raise CaseError.many(problems)
        return Case.checked(data)

    def point(self, reference: str, *, where: str = "point") -> PointRef:
        """The point that "body.point" or "body@distance" names. Raises CaseError at `where` if none."""
        return parse_point(reference, self.bodies, where)

    def location(self, reference: str, *, where: str = "at") -> Location:
        """The point or the boundary that a reference names. Raises CaseError at `where` if none."""
        return parse_location(reference, self.bodies, where)

    @property
    def dimension(self) -> int:
        """2 in the plane, 3 in space."""
        return next(iter(self.bodies.values())).dimension

    @property
    def moving(self) -> list[str]:
        """Names of what moves with a prescribed velocity: supports, then bodies that slide through their mesh."""
        supports = [name for name, support in self.supports.items() if support.velocity]
        return supports + [name for name, body in self.bodies.items() if getattr(body, "sliding", None) is not None]

    @property
    def placed(self) -> list[str]:
        """Names of what is pressed away by a prescribed distance: supports, then contacts with an interference."""
        supports = [name for name, support in self.supports.items() if any(support.displacement.values())]
        return supports + [name for name, contact in self.contacts.items() if contact.interference]

    @property
    def imported(self) -> dict[str, MatrixBody]:
        """The bodies that are matrices of other programs."""
        return {name: body for name, body in self.bodies.items() if isinstance(body, MatrixBody)}

    @property
    def factor_names(self) -> set[str]:
        """Names that the factors of matrices use: of parameters, and mu."""
        names = tuple((*self.parameters, MU))
        texts = [t.factor for b in self.imported.values() for t in b.terms if isinstance(t.factor, str)]
        return {name for text in texts for name in parse_expression(text, names).names}

    def factor_values(self, mu: float | None = None) -> dict[str, float]:
        """Values of the names in factors of matrices: the parameters', and mu, the friction coefficient.

        mu is that given, else the parameter of that name, else that of all contacts. Raises CaseError where mu is used
        and contacts differ.
        """
        values = {name: parameter.value for name, parameter in self.parameters.items()}
        own = {contact.friction.coefficient for contact in self.contacts.values()} or {0.0}
        if mu is not None:
            values[MU] = float(mu)
        elif MU not in values and len(own) == 1:
            values[MU] = own.pop()
        elif MU not in values and MU in self.factor_names:
            accepted = "factors of matrices use it, and the contacts have different ones: name it (--mu 0.3)"
            raise CaseError(MU, None, accepted)
        return values

    @property
    def beams(self) -> dict[str, BeamBody]:
        """The bodies that are beams."""
        return {name: body for name, body in self.bodies.items() if isinstance(body, BeamBody)}

    def side(self, contact: str) -> int:
        """+1 where the slave of a contact lies left of its master's direction, start to end, -1 right."""
        table = self.contacts[contact]
        if table.side is not None:
            return 1 if table.side == "left" else -1
        slave, master = self.bodies[self.location(table.slave).body], self.bodies[table.master]
        assert isinstance(slave, BeamBody), "checked: others name their side"
        assert isinstance(master, BeamBody), "checked: only beams have sides"
        return slave_side(slave, master)

    def load_factors(self) -> tuple[dict[str, float], ...]:
        """For each phase, the factor of every load at its end."""
        return tuple(_carried(self.phases, self.loads, lambda phase: phase.loads))

    def velocity_factors(self) -> tuple[dict[str, float], ...]:
        """For each phase, the factor of every moving support's velocity at its end."""
        return tuple(_carried(self.phases, self.moving, lambda phase: phase.velocities))

    def _data(self, *, defaults: bool = False) -> dict[str, Any]:
        return self.model_dump(mode="json", exclude_unset=not defaults, exclude_none=True)


def _carried(
    phases: tuple[Phase, ...],
    names: Mapping[str, Any] | list[str],
    factors: Callable[[Phase], Mapping[str, float]],
) -> Iterator[dict[str, float]]:
    present = dict.fromkeys(names, 1.0)
    for phase in phases:
        present = {**present, **factors(phase)}
        yield present


def _sound(data: Mapping[str, Any], error: ValidationError) -> SoundTables:
    """What of the data is sound although the whole is not."""
    parts = SoundTables()
    errors = error.errors(include_url=False, include_input=False)
    faults = {item["loc"][:2] for item in errors}
    unknown = [str(item["loc"][0]) for item in errors if item["type"] == "extra_forbidden" and len(item["loc"]) == 1]
    misspelt = {nearest(key, Case.model_fields) for key in unknown}
    unclear = "" in misspelt  # any table that is not there may be the one
    for table, kind in ENTRIES.items():
        entries = data.get(table, {})
        if not isinstance(entries, dict) or (
            table not in data and (unclear or table in misspelt or table == "bodies")
        ):
            parts.broken.add((table, "*"))
            continue
        sound: dict[str, Any] = {}
        for name, entry in cast("dict[str, Any]", entries).items():
            if (table, name) in faults:
                parts.broken.add((table, name))
            else:
                sound[name] = TypeAdapter(kind).validate_python(entry)
        setattr(parts, table, sound)
    sections: dict[str, Any] = {
        "phases": Phases,
        "steady": Steady,
        "modal": Modal,
        "temporal": Temporal,
        "comparison": Comparison,
        "reference": Reference,
    }
    for section, kind in sections.items():
        if section in data and not any(fault[:1] == (section,) for fault in faults):
            setattr(parts, section, TypeAdapter(kind).validate_python(data[section]))
    return parts


def _in_file_order(problems: list[Problem]) -> list[Problem]:
    order = list(Case.model_fields)

    def rank(problem: Problem) -> int:
        head = problem.where.split(".")[0]
        return order.index(head) if head in order else -1

    return sorted(problems, key=rank)
