"""Shapes and contact fields as VTK files, for ParaView and everything else that reads them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import meshio
import numpy as np

from ..errors import CaseError, Problem
from ..system import System
from ..typing import Array, ComplexArray, IntArray
from .atomic import replacing

SUFFIXES = (".vtu", ".vtk")


@dataclass(frozen=True)
class _Body:
    """A body as the file has it: points (k, d) [m], cells by kind, displacements (k d, n) of the freedoms."""

    points: Array
    cells: Mapping[str, IntArray]
    rows: Any

    @property
    def cell_count(self) -> int:
        return sum(len(c) for c in self.cells.values())


def write_vtk(
    system: System,
    path: Path | str,
    *,
    vectors: Mapping[str, Array | ComplexArray] | None = None,
    point_data: Mapping[str, Array] | None = None,
    cell_data: Mapping[str, Array] | None = None,
    contact_data: Mapping[str, Array | IntArray] | None = None,
) -> tuple[Path, ...]:
    """Write all bodies of a system to one .vtu or .vtk file and its contact nodes to NAME-contact beside it.

    ``vectors`` name → (n,) on the freedoms: a real one becomes point data of three components [m], a complex one three
    fields NAME_real, NAME_imag (3 components) and NAME_magnitude (amplitude √Σ|û|²). ``point_data`` (points, …) and
    ``cell_data`` (cells, …) follow the solids in order, then the lines; where they hold the solids only, lines get NaN.
    Cell data "body" numbers the bodies from 1: solids, then lines. ``contact_data`` name → (m,) or (m, c) in the order
    of ``system.contact_nodes()`` (pressure [Pa], status, energy [J]); with it go the number of the contact from 1, the
    normal and the area [m²]. The second file is written where the system has contact nodes.

    Returns the paths written; each file appears whole or not at all. Raises CaseError, with one line for each problem,
    for a suffix that is not known, for arrays that do not fit and for a system without bodies, AnalysisError where the
    folder cannot be written.
    """
    path = Path(path)
    vectors, point_data, cell_data = vectors or {}, point_data or {}, cell_data or {}
    bodies = [_Body(s.points, s.cells, s.rows.free) for s in system.solids]
    for line in system.lines:
        bodies.append(_Body(line.coordinates, {"line": _chain(len(line.coordinates))}, line.rows.free))
    problems = _problems(system, path, bodies, vectors, point_data, cell_data, contact_data or {})
    if problems:
        raise CaseError.many(problems)
    fields: dict[str, Array] = {}
    for name, vector in vectors.items():
        fields |= _displacements(name, vector, bodies)
    points = sum(len(b.points) for b in bodies)
    fields |= {name: _filled(values, points) for name, values in point_data.items()}
    mesh = meshio.Mesh(
        np.concatenate([_in_space(b.points) for b in bodies]),
        _blocks(bodies),
        point_data=fields,
        cell_data=_cell_fields(bodies, cell_data),
    )
    _write(path, mesh)
    if not system.contact_nodes().count:
        return (path,)
    beside = path.with_name(f"{path.stem}-contact{path.suffix}")
    _write(beside, _contact_mesh(system, contact_data or {}))
    return path, beside


def _problems(
    system: System,
    path: Path,
    bodies: Sequence[_Body],
    vectors: Mapping[str, Array | ComplexArray],
    point_data: Mapping[str, Array],
    cell_data: Mapping[str, Array],
    contact_data: Mapping[str, Array | IntArray],
) -> list[Problem]:
    """Everything wrong with what is to be written."""
    found: list[Problem] = []
    if path.suffix.lower() not in SUFFIXES:
        found.append(Problem("path", path.name, f"not a VTK file; the name must end in {' or '.join(SUFFIXES)}"))
    if not bodies:
        found.append(Problem("system", None, "has neither solids nor lines, so there is nothing to write"))
    for name, vector in vectors.items():
        if np.shape(vector) != (system.size,):
            given = f"an array of shape {np.shape(vector)}"
            found.append(Problem(f"vectors.{name}", given, f"one value for each of {system.size} freedoms"))
    solids = len(system.solids)
    for where, data, counts in (
        ("point_data", point_data, [len(b.points) for b in bodies]),
        ("cell_data", cell_data, [b.cell_count for b in bodies]),
    ):
        allowed = sorted({sum(counts[:solids]), sum(counts)} - {0})
        what = where.removesuffix("_data") + "s"
        found += _unfit(where, data, allowed, f"{what} of the solids" if len(allowed) == 1 else f"{what} (with lines)")
    return found + _unfit("contact_data", contact_data, [system.contact_nodes().count], "contact nodes")


def _unfit(where: str, data: Mapping[str, Any], allowed: Sequence[int], what: str) -> list[Problem]:
    """Arrays whose first length is none of those allowed."""
    return [
        Problem(
            f"{where}.{name}",
            f"an array of shape {np.shape(values)}",
            f"its first length must be {' or '.join(map(str, allowed))}, the number of {what}",
        )
        for name, values in data.items()
        if not np.shape(values) or np.shape(values)[0] not in allowed
    ]


def _chain(count: int) -> IntArray:
    return np.column_stack([np.arange(count - 1), np.arange(1, count)])


def _in_space(values: Array) -> Array:
    """Vectors (k, d) with three components."""
    return np.pad(values, ((0, 0), (0, 3 - values.shape[1])))


def _displacements(name: str, vector: Array | ComplexArray, bodies: Sequence[_Body]) -> dict[str, Array]:
    """Point data of a vector on the freedoms."""
    parts = [_in_space((b.rows @ np.asarray(vector)).reshape(b.points.shape)) for b in bodies]
    moved = np.concatenate(parts)
    if not np.iscomplexobj(moved):
        return {name: moved}
    # Files take contiguous numbers; real and imaginary parts are views with gaps.
    real, imag = np.ascontiguousarray(moved.real), np.ascontiguousarray(moved.imag)
    return {f"{name}_real": real, f"{name}_imag": imag, f"{name}_magnitude": np.linalg.norm(moved, axis=1)}


def _blocks(bodies: Sequence[_Body]) -> list[tuple[str, IntArray]]:
    """Cells of all bodies, numbered on."""
    starts = np.cumsum([0, *(len(b.points) for b in bodies)])
    return [
        (kind, np.asarray(nodes) + start)
        for b, start in zip(bodies, starts[:-1], strict=True)
        for kind, nodes in b.cells.items()
    ]


def _cell_fields(bodies: Sequence[_Body], cell_data: Mapping[str, Array]) -> dict[str, list[Array | IntArray]]:
    """Cell data in the blocks of the file, with the number of the body."""
    sizes = [len(nodes) for b in bodies for nodes in b.cells.values()]
    number = [np.full(len(nodes), k) for k, b in enumerate(bodies, start=1) for nodes in b.cells.values()]
    fields: dict[str, list[Array | IntArray]] = {"body": [n.astype(np.int32) for n in number]}
    for name, values in cell_data.items():
        fields[name] = list(np.split(_filled(values, sum(sizes)), np.cumsum(sizes)[:-1]))
    return fields


def _filled(values: Array, count: int) -> Array:
    """Values with NaN for what follows the solids."""
    given: Any = np.asarray(values)
    if len(given) == count:
        return given
    rest = np.full((count - len(given), *given.shape[1:]), np.nan)
    return np.concatenate([given.astype(float), rest])


def _contact_mesh(system: System, contact_data: Mapping[str, Array | IntArray]) -> Any:
    """The slave nodes as vertices."""
    nodes = system.contact_nodes()
    fields: dict[str, Any] = {
        "contact": nodes.owner.astype(np.int32) + 1,
        "normal": _in_space(nodes.normals),
        "area": nodes.area,
    }
    fields |= {name: np.ascontiguousarray(values) for name, values in contact_data.items()}
    vertices = np.arange(nodes.count)[:, None]
    return meshio.Mesh(_in_space(nodes.position), [("vertex", vertices)], point_data=fields)


def _write(path: Path, mesh: Any) -> None:
    kind = path.suffix.lower()[1:]
    with replacing(path) as temporary:
        mesh.write(temporary, file_format=kind, binary=True)
