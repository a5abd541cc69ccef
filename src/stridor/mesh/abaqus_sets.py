"""Sets and surfaces of an Abaqus file by their members: from bodies as written to the contents of a mesh."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from ..errors import CaseError
from ..typing import Array, IntArray
from .abaqus_deck import DeckLine
from .abaqus_parts import ACCEPTED_TYPES, NamedSet, Scope, SurfaceCard
from .boundary import cell_facets, facets_of_faces, match_facets
from .gather import Contents
from .kinds import KINDS
from .model import Blocks

_FACE = re.compile(r"[SE]([1-6])")
_DEEPEST = 50  # sets of sets of sets …


class Collector:
    """Numbers nodes and elements of all bodies through: bodies[0] is what the file itself defines, then instances.

    Names of one body only are as written; of several, instance.name, unless the assembly itself uses that name.
    """

    def __init__(self, bodies: Sequence[Scope]) -> None:
        self._bodies = bodies
        self._instances = {scope.name.upper(): b for b, scope in enumerate(bodies) if b}
        self._node_index: list[dict[int, int]] = []
        self._element_index: list[dict[int, int]] = []
        self._known: dict[tuple[str, int, str], IntArray] = {}
        points: list[tuple[float, float, float]] = []
        elements: list[tuple[str, int]] = []
        cells: dict[str, list[list[int]]] = {}
        for scope in bodies:
            nodes = {number: len(points) + k for k, number in enumerate(scope.nodes)}
            points.extend(scope.nodes.values())
            index: dict[int, int] = {}
            for number, element in scope.elements.items():
                rows = cells.setdefault(element.kind, [])
                index[number] = len(elements)
                elements.append((element.kind, len(rows)))
                if element.kind not in KINDS:  # told of later, if it is to be part of the body
                    rows.append([-1])
                    continue
                try:
                    rows.append([nodes[n] for n in element.nodes])
                except KeyError as missing:
                    element.line.refuse(f"element {number} uses node {missing.args[0]}, which is not defined")
            self._node_index.append(nodes)
            self._element_index.append(index)
        self._points: Array = np.array(points, dtype=np.float64).reshape(-1, 3)
        self._cells: Blocks = {kind: np.array(rows, dtype=np.int64) for kind, rows in cells.items()}
        self._kinds = list(self._cells)
        number_of = {kind: k for k, kind in enumerate(self._kinds)}
        self._kind_of = np.array([number_of[kind] for kind, _ in elements], dtype=np.int64)
        self._row_of = np.array([row for _, row in elements], dtype=np.int64)

    def contents(self) -> Contents:
        """Points, cells, element sets as regions, node sets, surfaces as facets. Raises CaseError with the line."""
        regions: dict[str, Mapping[str, IntArray]] = {}
        node_sets: dict[str, IntArray] = {}
        facets: dict[str, Blocks] = {}
        for b, scope in enumerate(self._bodies):
            for key, found in scope.elsets.items():
                members = self._members("ELSET", b, key, found.line)
                if not found.internal and len(members):
                    regions[self.shown_name("elsets", b, found.name)] = self._by_kind(members)
            for key, found in scope.nsets.items():
                members = self._members("NSET", b, key, found.line)
                if not found.internal and len(members):
                    node_sets[self.shown_name("nsets", b, found.name)] = members
            for surface in scope.surfaces.values():
                name = self.shown_name("surfaces", b, surface.name)
                if surface.of_nodes:
                    parts = [self._listed("NSET", b, line, line.fields[:1], 0) for line in surface.card.data]
                    if parts and not surface.internal:
                        node_sets.setdefault(name, np.unique(np.concatenate(parts)))
                elif sides := self._sides(b, surface):
                    facets[name] = sides
        if len(self._instances) > 1:
            for name, b in self._instances.items():
                every = np.array(sorted(self._element_index[b].values()), dtype=np.int64)
                if len(every) and name not in {r.upper() for r in regions}:
                    regions[self._bodies[b].name] = self._by_kind(every)
        numbers = np.array([n for nodes in self._node_index for n in nodes], dtype=np.int64)
        return Contents(
            self._points, self._cells, regions, facets, node_sets, ACCEPTED_TYPES, numbers, self._turned()
        )

    def shown_name(self, table: str, body: int, name: str) -> str:
        """What a set or surface of a body is called in the mesh."""
        if body == 0:
            return name
        taken = name.upper() in getattr(self._bodies[0], table)
        return f"{self._bodies[body].name}.{name}" if taken or len(self._instances) > 1 else name

    def _turned(self) -> IntArray:
        """Nodes, numbered through, whose freedoms *TRANSFORM puts along axes of their own: all, where the set that it
        names is not known, as a mesh alone needs none of it."""
        cards = [(b, card) for b, scope in enumerate(self._bodies) for card in scope.transforms]
        parts: list[IntArray] = [np.zeros(0, dtype=np.int64)]
        for b, card in cards:
            try:
                parts.append(self._listed("NSET", b, card.line, [card.options["NSET"]], 0))
            except CaseError:
                return np.arange(len(self._points), dtype=np.int64)
        return np.unique(np.concatenate(parts))

    def _by_kind(self, elements: IntArray) -> dict[str, IntArray]:
        """Elements, numbered through, as rows of the cells of each kind."""
        kinds, rows = self._kind_of[elements], self._row_of[elements]
        return {self._kinds[k]: np.sort(rows[kinds == k]) for k in np.unique(kinds)}

    def _members(self, table: str, body: int, key: str, line: DeckLine, depth: int = 0) -> IntArray:
        """Members of a set, numbered through, sorted. Raises CaseError at ``line`` where there is none of the name."""
        if (table, body, key) in self._known:
            return self._known[table, body, key]
        scope = self._bodies[body]
        sets = scope.nsets if table == "NSET" else scope.elsets
        if key not in sets:
            kind = "node" if table == "NSET" else "element"
            names = ", ".join(s.name for s in sets.values()) or "none"
            line.refuse(f"there is no {kind} set {key}; there are: {names}")
        if depth > _DEEPEST:
            line.refuse("sets of sets are nested too deep, or hold themselves")
        found = self._union(table, body, sets[key], depth)
        self._known[table, body, key] = found
        return found

    def _union(self, table: str, body: int, held: NamedSet, depth: int) -> IntArray:
        """Members of a set by all that its definitions list."""
        own = self._node_index[body] if table == "NSET" else self._element_index[body]
        parts: list[IntArray] = [np.array([own[n] for n in held.numbers], dtype=np.int64)]
        for members in held.members:
            card = members.card
            where = self._instance(members.instance, card.line) if members.instance else body
            if table == "NSET" and card.options.get("ELSET"):
                elements = self._members("ELSET", where, card.options["ELSET"].upper(), card.line, depth + 1)
                chosen = self._by_kind(elements).items()
                parts += [self._cells[kind][rows].ravel() for kind, rows in chosen if kind in KINDS]
            for line in card.data:
                if members.generate:
                    parts.append(self._generated(table, where, line))
                else:
                    parts.append(self._listed(table, where, line, line.fields, depth))
        return np.unique(np.concatenate(parts))

    def _instance(self, name: str, line: DeckLine) -> int:
        """The body of an instance's name."""
        if name.upper() not in self._instances:
            names = ", ".join(s.name for s in self._bodies[1:]) or "none"
            line.refuse(f"there is no instance {name}; there are: {names}")
        return self._instances[name.upper()]

    def _generated(self, table: str, body: int, line: DeckLine) -> IntArray:
        """Those that exist of first, last, step."""
        what = "the number of a node" if table == "NSET" else "the number of an element"
        numbers = [line.whole(f, what, largest=10**30) for f in line.fields]  # ranges may go on for ever
        if len(numbers) not in (2, 3):
            line.refuse("with GENERATE a line is: first, last, step")
        chosen = range(numbers[0], numbers[1] + 1, *numbers[2:])
        own = self._node_index[body] if table == "NSET" else self._element_index[body]
        # A range may be far longer than the mesh, and holds more numbers than exist.
        return np.array([index for number, index in own.items() if number in chosen], dtype=np.int64)

    def _listed(self, table: str, body: int, line: DeckLine, fields: Iterable[str], depth: int) -> IntArray:
        """Members listed by number, by the name of another set, or as instance.number or instance.name."""
        own = self._node_index[body] if table == "NSET" else self._element_index[body]
        numbers: list[int] = []
        parts: list[IntArray] = []
        for text in fields:
            if not text:
                continue
            if not text.isdecimal():
                prefix, dot, rest = text.strip('"').partition(".")
                if body == 0 and dot and prefix.upper() in self._instances:
                    parts.append(self._listed(table, self._instances[prefix.upper()], line, [rest], depth))
                else:
                    parts.append(self._members(table, body, text.strip('"').upper(), line, depth + 1))
                continue
            number = line.whole(text, "a number")
            if number not in own:
                line.refuse(f"{'node' if table == 'NSET' else 'element'} {number} is not defined")
            numbers.append(own[number])
        return np.concatenate([np.array(numbers, dtype=np.int64), *parts])

    def _sides(self, body: int, surface: SurfaceCard) -> dict[str, IntArray]:
        """Facets (f, n) by kind of a surface of faces of elements; of elements that are not ours none."""
        faces: list[tuple[str, IntArray, int]] = []
        free: list[tuple[str, IntArray, int]] = []
        for line in surface.card.data:
            name, label, *_ = [*line.fields, "", ""]
            if not name:
                line.refuse("a line of a surface is: element set or element, face (S1, S2, …)")
            elements = np.unique(self._listed("ELSET", body, line, [name], 0))
            for kind, rows in self._by_kind(elements).items():
                if kind not in KINDS:
                    continue
                count = len(KINDS[kind].facets)
                match = _FACE.fullmatch(label.upper())
                if not label:
                    free += [(kind, rows, face) for face in range(count)]
                elif match is None or int(match[1]) > count:
                    line.refuse(f"{label} is no face of a {kind}; accepted: S1 to S{count}, or nothing for all outside")
                else:
                    faces.append((kind, rows, int(match[1]) - 1))
        sides = facets_of_faces(self._cells, faces)
        if free:
            ours = {kind: block for kind, block in self._cells.items() if kind in KINDS}
            outside = match_facets(cell_facets(ours, self._points), facets_of_faces(self._cells, free)).outer
            for kind, block in outside.items():
                sides[kind] = np.concatenate([sides[kind], block]) if kind in sides else block
        return sides
