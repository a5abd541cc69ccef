"""From the cards of an Abaqus file to its bodies: nodes, elements, and sets and surfaces as they are written."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np

from ..typing import Array
from .abaqus_deck import Card, DeckLine

Point = tuple[float, float, float]

ACCEPTED_TYPES = "CPS3, CPE3, CPS4, CPE4, CPS6, CPE6, CPS8, CPE8, C3D4, C3D8, C3D10, C3D20"
# What may follow the number of nodes says how the element integrates, not what it looks like.
_TYPE = re.compile(r"(CP[SE][3468]|C3D(?:4|8|10|20))[RIHM]{0,3}")
# Abaqus orders the nodes of all of these as VTK does, midside nodes too.
_KIND = {
    **{"CPS3": "triangle", "CPS4": "quad", "CPS6": "triangle6", "CPS8": "quad8"},
    **{"C3D4": "tetra", "C3D8": "hexahedron", "C3D10": "tetra10", "C3D20": "hexahedron20"},
}
# These make or move nodes and elements: passed over, they would silently leave another body.
_REFUSED = ("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM")


@dataclass(frozen=True)
class ElementRecord:
    """An element: kind of cell, or its type where it is not one of ours; nodes by their numbers in the file."""

    kind: str
    nodes: tuple[int, ...]
    line: DeckLine


@dataclass(frozen=True)
class Members:
    """Data lines that list members of a set, as first, last, step where generate; of an instance, if one is named."""

    card: Card
    generate: bool
    instance: str


@dataclass
class NamedSet:
    """A set as written: numbers known from *NODE or *ELEMENT themselves, and lists of members."""

    name: str
    internal: bool
    line: DeckLine
    numbers: list[int] = field(default_factory=list)
    members: list[Members] = field(default_factory=list)


@dataclass(frozen=True)
class SurfaceCard:
    """A surface as written, of nodes or of faces of elements."""

    name: str
    of_nodes: bool
    internal: bool
    card: Card


@dataclass(frozen=True)
class SectionCard:
    """A solid section as written."""

    elset: str
    material: str
    thickness: float | None
    line: DeckLine


@dataclass
class Scope:
    """Nodes, elements, sets and surfaces (by name in capitals) that are numbered and named together."""

    name: str = ""
    nodes: dict[int, Point] = field(default_factory=dict)
    elements: dict[int, ElementRecord] = field(default_factory=dict)
    nsets: dict[str, NamedSet] = field(default_factory=dict)
    elsets: dict[str, NamedSet] = field(default_factory=dict)
    surfaces: dict[str, SurfaceCard] = field(default_factory=dict)
    sections: list[SectionCard] = field(default_factory=list)
    transforms: list[Card] = field(default_factory=list)


class PartsReader:
    """Takes cards in turn. bodies: what the whole file numbers itself, then its instances."""

    def __init__(self) -> None:
        self.top = Scope()
        self.instances: list[Scope] = []
        self.types: dict[str, int] = {}
        self._parts: dict[str, Scope] = {}
        self._scope = self.top
        self._instance: tuple[Card, Scope | None] | None = None
        self._actions: dict[str, Callable[[Card], None]] = {
            "NODE": self._node,
            "ELEMENT": self._element,
            "NSET": self._set,
            "ELSET": self._set,
            "SURFACE": self._surface,
            "SOLID SECTION": self._section,
            "TRANSFORM": self._transform,
            "PART": self._part,
            "END PART": self._end_part,
            "INSTANCE": self._begin_instance,
            "END INSTANCE": self._end_instance,
        }

    @property
    def bodies(self) -> list[Scope]:
        """All scopes that hold nodes and elements of the model."""
        return [self.top, *self.instances]

    def take(self, card: Card) -> None:
        """Reads a card; those that say nothing of the body are passed over. Raises CaseError with its line."""
        if card.keyword in _REFUSED:
            card.line.refuse(f"*{card.keyword} is not read; write the nodes and elements that it makes to the file")
        action = self._actions.get(card.keyword)
        if action is not None:
            action(card)

    def close(self, last: Card | None) -> None:
        """Says what is missing once all cards are read."""
        if self._scope is not self.top and last is not None:
            kind = "INSTANCE" if self._instance else "PART"
            last.line.refuse(f"the file ends before *END {kind}")
        if last is not None and self._parts and not self.instances and not self.top.elements:
            last.line.refuse("the file has parts, but no *INSTANCE of one")

    def _node(self, card: Card) -> None:
        if card.options.get("SYSTEM", "R").upper() not in ("R", ""):
            card.line.refuse("only rectangular coordinates are read (SYSTEM=R)")
        numbers: list[int] = []
        for line in card.data:
            fields = line.fields
            if len(fields) > 7 or not fields:
                line.refuse("a node is: number, x, y, z")
            number = line.whole(fields[0], "the number of a node")
            x, y, z = (line.number_of(f, "a coordinate") for f in [*fields[1:4], "", "", ""][:3])
            if self._scope.nodes.setdefault(number, (x, y, z)) != (x, y, z):
                line.refuse(f"node {number} is already defined, at another place")
            numbers.append(number)
        if card.options.get("NSET"):
            self._named(self._scope.nsets, card, card.options["NSET"]).numbers.extend(numbers)

    def _element(self, card: Card) -> None:
        type_name = card.need("TYPE").upper()
        match = _TYPE.fullmatch(type_name)
        kind = _KIND[match[1].replace("CPE", "CPS")] if match else type_name
        needed = int(re.sub(r"^CP[SE]|^C3D", "", match[1])) + 1 if match else 0
        numbers: list[int] = []
        for first, fields in _element_rows(card.data, needed):
            found = [first.whole(f, "the number of an element or node") for f in fields if f or needed]
            if (needed and len(found) != needed) or not found:
                first.refuse(f"an element of type {type_name} is: its number, then {needed - 1} nodes")
            element = ElementRecord(kind, tuple(found[1:]), first)
            known = self._scope.elements.setdefault(found[0], element)
            if known is not element and (known.kind, known.nodes) != (element.kind, element.nodes):
                there = "" if known.line.file == first.file else f"{known.line.file}, "
                first.refuse(f"element {found[0]} is already defined in {there}line {known.line.number}")
            numbers.append(found[0])
        self.types[type_name] = self.types.get(type_name, 0) + len(numbers)
        if card.options.get("ELSET"):
            self._named(self._scope.elsets, card, card.options["ELSET"]).numbers.extend(numbers)

    def _set(self, card: Card) -> None:
        kind = card.keyword
        held = self._named(self._scope.nsets if kind == "NSET" else self._scope.elsets, card, card.need(kind))
        held.members.append(Members(card, "GENERATE" in card.options, card.options.get("INSTANCE", "")))

    def _surface(self, card: Card) -> None:
        kind = card.options.get("TYPE", "ELEMENT").upper()
        if kind in ("ELEMENT", "NODE"):  # others are rigid or cut through: no sides of elements
            name = card.need("NAME")
            self._scope.surfaces[name.upper()] = SurfaceCard(name, kind == "NODE", "INTERNAL" in card.options, card)

    def _section(self, card: Card) -> None:
        fields = card.data[0].fields if card.data else []
        thickness = card.data[0].number_of(fields[0], "a thickness") if fields and fields[0] else None
        if thickness is not None and thickness < 0:
            card.data[0].refuse("a thickness must not be negative")
        material = card.options.get("MATERIAL", "")
        if material:
            # Of a solid section in space Abaqus's own files hold a lone comma, or 1: neither is a thickness of nothing.
            self._scope.sections.append(SectionCard(card.need("ELSET"), material, thickness or None, card.line))

    def _transform(self, card: Card) -> None:
        if card.options.get("NSET"):
            self._scope.transforms.append(card)

    def _part(self, card: Card) -> None:
        if self._scope is not self.top:
            card.line.refuse("*PART must stand on its own, after *END PART and outside *ASSEMBLY")
        name = card.need("NAME")
        if name.upper() in self._parts:
            card.line.refuse(f"there is a part {name} already")
        self._scope = self._parts[name.upper()] = Scope(name)

    def _end_part(self, card: Card) -> None:
        if self._scope is self.top or self._instance:
            card.line.refuse("there is no *PART to end")
        self._scope = self.top

    def _begin_instance(self, card: Card) -> None:
        if self._scope is not self.top:
            card.line.refuse("*INSTANCE must stand in *ASSEMBLY, after *END PART and *END INSTANCE")
        name = card.need("NAME")
        if any(i.name.upper() == name.upper() for i in self.instances):
            card.line.refuse(f"there is an instance {name} already")
        part = card.options.get("PART", "")
        if part and part.upper() not in self._parts:
            names = ", ".join(p.name for p in self._parts.values()) or "none"
            card.line.refuse(f"there is no part {part}; there are: {names}")
        self._instance = (card, self._parts[part.upper()] if part else None)
        self._scope = Scope(name)

    def _end_instance(self, card: Card) -> None:
        if self._instance is None:
            card.line.refuse("there is no *INSTANCE to end")
        begun, part = self._instance
        own, base = self._scope, part or Scope()
        nodes = base.nodes | own.nodes
        moved = _moved(begun, np.array(list(nodes.values()), dtype=np.float64).reshape(-1, 3))
        self.instances.append(
            Scope(
                name=own.name,
                nodes={n: (float(p[0]), float(p[1]), float(p[2])) for n, p in zip(nodes, moved, strict=True)},
                elements=base.elements | own.elements,
                nsets=base.nsets | own.nsets,
                elsets=base.elsets | own.elsets,
                surfaces=base.surfaces | own.surfaces,
                sections=base.sections + own.sections,
                transforms=base.transforms + own.transforms,
            )
        )
        self._instance, self._scope = None, self.top

    def _named(self, sets: dict[str, NamedSet], card: Card, name: str) -> NamedSet:
        """The set of that name, which grows each time it is named."""
        return sets.setdefault(name.upper(), NamedSet(name, "INTERNAL" in card.options, card.line))


def _element_rows(data: list[DeckLine], needed: int) -> Iterable[tuple[DeckLine, list[str]]]:
    """First line and fields of each element, which may go over several lines: until it has as many as it needs, or,
    where that is not known (0), while lines end in a comma."""
    at = 0
    while at < len(data):
        first = data[at]
        fields = list(first.fields)
        at += 1
        while at < len(data) and (len(fields) < needed if needed else data[at - 1].text.endswith(",")):
            fields += data[at].fields
            at += 1
        yield first, fields


def _moved(card: Card, points: Array) -> Array:
    """Points (k, 3) of a part where its instance is: moved by the first data line, then turned as the second says."""
    if card.data:
        line = card.data[0]
        fields = line.fields
        if len(fields) > 3:
            line.refuse("the first line of an instance is its translation: x, y, z")
        shift = [line.number_of(f, "a translation") for f in [*fields, "", "", ""][:3]]
        points = points + np.array(shift)
    if len(card.data) < 2:
        return points
    line = card.data[1]
    if len(line.fields) != 7:
        line.refuse("the second line of an instance is its rotation: two points of the axis, x, y, z each, and degrees")
    values = np.array([line.number_of(f, "part of a rotation") for f in line.fields])
    start, axis, angle = values[:3], values[3:6] - values[:3], np.radians(values[6])
    length = float(np.linalg.norm(axis))
    if not 0 < length < np.inf:
        line.refuse("the two points of the axis must be apart")
    axis = axis / length
    arm = points - start
    along = np.outer(arm @ axis, axis)
    across = arm - along
    return start + along + np.cos(angle) * across + np.sin(angle) * np.cross(axis, arm)
