"""Abaqus and CalculiX input files: a body's mesh, and the materials and sections that the file gives it.

What says nothing about the body (steps, loads, outputs, interactions) is passed over; what would change its nodes or
elements and is not understood is refused. Axes of *TRANSFORM move nothing, and are told by the mesh (`Mesh.turned`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ..laws.elasticity import Material
from .abaqus_deck import Card, read_deck
from .abaqus_parts import PartsReader
from .abaqus_sets import Collector
from .gather import gather
from .model import Mesh
from .paths import check_file


@dataclass(frozen=True)
class Section:
    """Which material the cells of a region of the mesh have; thickness [unit of the file] of a plane one, if given."""

    elset: str
    material: str
    thickness: float | None = None


@dataclass(frozen=True)
class AbaqusModel:
    """What a file says of a body.

    mesh: element sets are its regions, node sets its node sets, surfaces its boundaries. materials: by name, in the
    units of the file, which a scale of the mesh does not change. incomplete: name of a material → why it is not one of
    isotropic elasticity with a density. sections in the order of the file. types: number of elements of each type.
    """

    mesh: Mesh
    materials: Mapping[str, Material] = field(default_factory=dict)
    incomplete: Mapping[str, str] = field(default_factory=dict)
    sections: tuple[Section, ...] = ()
    types: Mapping[str, int] = field(default_factory=dict)


def read_abaqus(
    path: str | Path, *, scale: float = 1.0, group: str | None = None, where: str = "mesh"
) -> AbaqusModel:
    """The body in an .inp file: all of its elements, or those of the element set ``group``; see `files.read_mesh`.

    A file with parts is read with its instances where they stand. With several instances, names of their sets are
    instance.set, and the instances' names are groups too. Sets marked INTERNAL are read and not shown. Names of
    files, sets and materials are compared without regard to capitals, and shown as first written.

    Raises CaseError at where.file, where.group or where.scale, or at "FILE, line N" for a line that is wrong.
    """
    file = Path(path)
    check_file(file, f"{where}.file", (".inp",))
    cards = read_deck(file)
    parts, materials = PartsReader(), _Materials()
    for card in cards:
        parts.take(card)
        materials.take(card)
    parts.close(cards[-1] if cards else None)
    collector = Collector(parts.bodies)
    contents = collector.contents()
    mesh = gather(contents, source=file.name, where=where, group=group, scale=scale)
    sections: list[Section] = []
    for body, scope in enumerate(parts.bodies):
        for card in scope.sections:
            held = scope.elsets.get(card.elset.upper())
            if held is None:
                names = ", ".join(s.name for s in scope.elsets.values()) or "none"
                card.line.refuse(f"there is no element set {card.elset}; there are: {names}")
            name = collector.shown_name("elsets", body, held.name)
            sections.append(Section(name, materials.shown_name(card.material), card.thickness))
    complete, incomplete = materials.sorted_out()
    for section in sections:
        if section.material not in complete:
            incomplete.setdefault(section.material, "it is not defined in the file")
    return AbaqusModel(mesh, complete, incomplete, tuple(sections), parts.types)


class _Materials:
    """Takes cards in turn and keeps what they say of materials, by names in capitals."""

    def __init__(self) -> None:
        self._names: dict[str, str] = {}
        self._elastic: dict[str, tuple[float, float]] = {}
        self._density: dict[str, float] = {}
        self._reasons: dict[str, str] = {}
        self._current = ""

    def take(self, card: Card) -> None:
        """Reads *MATERIAL, *ELASTIC and *DENSITY. Raises CaseError with the line."""
        if card.keyword == "MATERIAL":
            name = card.need("NAME")
            self._current = name.upper()
            self._names.setdefault(self._current, name)
        elif card.keyword in ("ELASTIC", "DENSITY") and self._current:
            if not card.data:
                card.line.refuse(f"*{card.keyword} needs a line of data")
            kind = card.options.get("TYPE", "ISOTROPIC").upper() if card.keyword == "ELASTIC" else "ISOTROPIC"
            if not kind.startswith("ISO"):
                reason = f"its *ELASTIC is of TYPE={kind}; only isotropic elasticity is computed with"
                self._reasons[self._current] = reason
            elif len(card.data) > 1:
                self._reasons[self._current] = f"its *{card.keyword} depends on temperature, or has several lines"
            elif card.keyword == "DENSITY":
                line = card.data[0]
                density = line.number_of(line.fields[0], "a density")
                if density <= 0:
                    line.refuse("a density must be greater than 0")
                self._density[self._current] = density
            else:
                self._take_elastic(card)

    def _take_elastic(self, card: Card) -> None:
        line = card.data[0]
        modulus, ratio = (line.number_of(f, "a modulus or ratio") for f in [*line.fields, ""][:2])
        if modulus <= 0 or not -1 < ratio < 0.5:
            line.refuse("elasticity is: Young's modulus, above 0, and Poisson's ratio, above -1 and below 0.5")
        self._elastic[self._current] = (modulus, ratio)

    def shown_name(self, name: str) -> str:
        """A material's name as first written."""
        return self._names.get(name.upper(), name)

    def sorted_out(self) -> tuple[dict[str, Material], dict[str, str]]:
        """Materials by name, and why others are none."""
        complete: dict[str, Material] = {}
        incomplete: dict[str, str] = {}
        for key, name in self._names.items():
            missing = [k for k, held in (("*ELASTIC", self._elastic), ("*DENSITY", self._density)) if key not in held]
            if key in self._reasons:
                incomplete[name] = self._reasons[key]
            elif missing:
                incomplete[name] = f"it has no {' and no '.join(missing)}"
            else:
                modulus, ratio = self._elastic[key]
                complete[name] = Material(modulus, self._density[key], ratio)
        return complete, incomplete
