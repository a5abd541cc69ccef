"""Meshes from files: Gmsh's .msh, VTK's .vtk and .vtu (both through meshio), Abaqus's and CalculiX's .inp.

Only what a file names becomes a boundary, a node set or a region; a group that has a number and no name is called by
its number.
"""

from __future__ import annotations

import contextlib
import io
import itertools
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import CaseError
from ..reading import bounded
from ..typing import IntArray
from . import readers
from .abaqus import read_abaqus
from .boundary import require_boundary as require_boundary
from .claims import check_claims
from .gather import Contents, gather, other_cells
from .gmsh_numbers import check_numbers
from .kinds import KINDS
from .model import Mesh
from .paths import check_file, in_one_line, shown_path

SUFFIXES = (".msh", ".vtk", ".vtu", ".inp")
_LOOKS = {
    ".msh": "a Gmsh mesh (format 2.2 or 4.1)",
    ".vtk": "a legacy VTK unstructured grid",
    ".vtu": "a VTK XML unstructured grid",
}
# Whole-number data of these names number the groups that facets, points or cells belong to; 0 and below is none.
_NUMBERED = ("boundary", "boundaries", "region", "regions", "gmsh:physical", "cellentityids", "medit:ref", "material")


def read_mesh(
    path: str | Path, *, scale: float = 1.0, group: str | None = None, where: str = "mesh"
) -> Mesh:
    """The body in a mesh file, told apart by its suffix: .msh, .vtk, .vtu or .inp.

    scale [m per unit of the file] multiplies coordinates. group is the one group of cells that is the body, all cells
    if None. Groups of cells become regions, groups of facets boundaries (turned to point out of the body), groups of
    points, and of curves in space, node sets. A plane mesh must lie at z = 0. `check_mesh` is left to the caller.

    In VTK files a group is whole-number data: named boundary or region it holds the groups' numbers; of any other
    name, with ones and zeros, it marks the group of that name.

    Raises CaseError at where.file, where.group or where.scale: no such file, not readable, not of these kinds.
    """
    file = Path(path)
    suffix = check_file(file, f"{where}.file", SUFFIXES)
    try:
        with bounded():
            if suffix == ".inp":
                return read_abaqus(file, scale=scale, group=group, where=where).mesh
            claimed = check_claims(file, suffix, f"{where}.file")
            if suffix == ".msh":
                check_numbers(file, f"{where}.file")
            raw = _through_meshio(file, suffix, f"{where}.file")
            _require_all_cells(raw, claimed, file, f"{where}.file")
            contents = _gmsh_contents(raw) if suffix == ".msh" else _vtk_contents(raw)
            return gather(contents, source=file.name, where=where, group=group, scale=scale)
    except MemoryError as error:
        text = "needs more memory than there is; is it broken, or made to look larger than it is?"
        raise CaseError(f"{where}.file", shown_path(file), text) from error
    except (ValueError, IndexError, KeyError, TypeError, OverflowError, AttributeError) as error:
        text = f"is not readable as {_LOOKS.get(suffix, 'an Abaqus input file')}: {in_one_line(error)}"
        raise CaseError(f"{where}.file", shown_path(file), text) from error


def _through_meshio(file: Path, suffix: str, where: str) -> Any:
    """What meshio makes of a file; whatever it prints, raises or exits with becomes one line."""
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), warnings.catch_warnings():
            # NumPy's way of saying that a file ended before its numbers did.
            warnings.filterwarnings("error", message="string or file could not be read", category=DeprecationWarning)
            # The format's own reader: meshio.read() would exit the interpreter where that raises.
            return readers.read(file, suffix)
    except MemoryError:
        raise
    except (Exception, SystemExit) as error:
        reason = in_one_line(error) or " ".join(said.getvalue().split())
        if "could not be read to its end" in reason:
            reason = "it breaks off, or holds something else where numbers should be"
        elif suffix == ".msh" and "ncompatible cell data" in reason:
            reason = 'only part of its elements is in physical groups; save it from Gmsh without "Save all elements"'
        elif suffix == ".msh" and isinstance(error, KeyError):
            kind = str(error.args[0])
            reason = f"it has elements of type {kind}, which its reader does not know{other_cells([kind])}"
        elif isinstance(error, IndexError | ValueError) and not isinstance(error, UnicodeError):
            # What Python says of a list that is too short is nothing that a user could mend.
            reason = f"it breaks off, or holds something else where numbers should be ({reason})"
        reason = reason or "its reader gives no reason; it is cut short or damaged, or of a kind that is not read"
        raise CaseError(where, shown_path(file), f"is not readable as {_LOOKS[suffix]}: {reason}") from error


def _require_all_cells(raw: Any, claimed: int | None, file: Path, where: str) -> None:
    """Raise CaseError for cells that meshio passed over: a VTK file's of a type that it does not know, or whose nodes
    are not as many as the type has."""
    read = sum(len(block.data) for block in raw.cells)
    if claimed is not None and claimed != read:
        raise CaseError(
            where, shown_path(file),
            f"has {claimed} cells, of which {read} can be read; are the types of the others known, and do they have as "
            "many nodes as their cells?",
        )  # fmt: skip


def _dimension(kind: str) -> int:
    """Dimension of cells of a kind of meshio's, whether it can be computed with or not."""
    if kind in KINDS:
        return KINDS[kind].dimension
    for dimension, prefixes in enumerate((("vertex",), ("line",), ("triangle", "quad", "polygon"))):
        if kind.startswith(prefixes):
            return dimension
    return 3


def _gmsh_contents(raw: Any) -> Contents:
    """Physical groups by name; an element in several groups, which format 2.2 writes several times, once."""
    named = {(int(d), int(tag)): name for name, (tag, d) in raw.field_data.items()}
    tags = raw.cell_data.get("gmsh:physical")
    members: list[dict[str, IntArray]] = []
    for number, block in enumerate(raw.cells):
        found: dict[str, IntArray] = {}
        for name in raw.field_data:
            if name in raw.cell_sets:  # format 4.1 knows every group of an element
                found[name] = np.asarray(raw.cell_sets[name][number], dtype=np.int64)
        if tags is not None:
            mine = np.asarray(tags[number])
            for tag in np.unique(mine[mine != 0]):
                # Gmsh marks a group whose surface it turned with a minus sign.
                name = named.get((_dimension(block.type), abs(int(tag))), str(abs(int(tag))))
                index = np.flatnonzero(mine == tag)
                found[name] = np.union1d(found.get(name, index[:0]), index)
        members.append({name: index for name, index in found.items() if len(index)})
    return _contents(raw, members, {}, unique=True)


def _vtk_contents(raw: Any) -> Contents:
    """Groups by whole-number data of cells and points."""
    members: list[dict[str, IntArray]] = [{} for _ in raw.cells]
    for name, blocks in raw.cell_data.items():
        marks = _marks(name, np.concatenate([np.asarray(b).reshape(len(b), -1) for b in blocks]))
        starts = np.cumsum([0, *(len(b) for b in blocks)])
        for group, index in marks.items():
            for number, (start, end) in enumerate(itertools.pairwise(starts)):
                mine = index[(index >= start) & (index < end)] - start
                if len(mine):
                    members[number][group] = mine
    nodes: dict[str, IntArray] = {}
    for name, values in raw.point_data.items():
        nodes |= _marks(name, np.asarray(values).reshape(len(raw.points), -1))
    for name, index in raw.point_sets.items():
        nodes[name] = np.asarray(index, dtype=np.int64)
    return _contents(raw, members, nodes, unique=False)


def _marks(name: str, values: Any) -> dict[str, IntArray]:
    """Groups that data (k, 1) of a name stand for: members by name."""
    if values.shape[1] != 1 or values.dtype.kind not in "biu" or not len(values):
        return {}
    column = values[:, 0].astype(np.int64)
    if name.lower() in _NUMBERED:
        return {str(tag): np.flatnonzero(column == tag) for tag in np.unique(column[column > 0])}
    if set(np.unique(column)) <= {0, 1} and np.any(column):
        return {name: np.flatnonzero(column == 1)}
    return {}


def _contents(
    raw: Any, members: list[dict[str, IntArray]], nodes: Mapping[str, IntArray], *, unique: bool
) -> Contents:
    """Sorts blocks of cells into those of the body, its facets, and what is smaller. Of cells with the same nodes one
    remains where unique."""
    dimension = max((_dimension(b.type) for b in raw.cells if len(b.data)), default=0)
    if dimension < 2:
        return Contents(points=np.asarray(raw.points), cells={})
    cells: dict[str, list[IntArray]] = {}
    regions: dict[str, dict[str, list[IntArray]]] = {}
    facets: dict[str, dict[str, list[IntArray]]] = {}
    node_sets: dict[str, list[IntArray]] = {name: [index] for name, index in nodes.items()}
    for block, groups in zip(raw.cells, members, strict=True):
        data = np.asarray(block.data)
        own = _dimension(block.type)
        if own == dimension:
            start = sum(len(d) for d in cells.get(block.type, []))
            cells.setdefault(block.type, []).append(data)
        for name, index in groups.items():
            if own == dimension:
                regions.setdefault(name, {}).setdefault(block.type, []).append(start + index)  # pyright: ignore[reportPossiblyUnboundVariable]
            elif own == dimension - 1:
                facets.setdefault(name, {}).setdefault(block.type, []).append(data[index].astype(np.int64))
            else:
                node_sets.setdefault(name, []).append(data[index].ravel().astype(np.int64))
    merged = {kind: np.concatenate(parts) for kind, parts in cells.items()}
    if any(len(block) and block.dtype.kind not in "iu" for block in merged.values()):
        raise ValueError("cells whose nodes are not whole numbers")
    members_of = {name: {k: np.concatenate(p) for k, p in r.items()} for name, r in regions.items()}
    if unique:
        for kind, block in merged.items():
            _, first, inverse = np.unique(np.sort(block, axis=1), axis=0, return_index=True, return_inverse=True)
            if len(first) < len(block):
                kept = np.sort(first)
                new = np.searchsorted(kept, first[inverse.ravel()])
                merged[kind] = block[kept]
                for region in members_of.values():
                    if kind in region:
                        region[kind] = np.unique(new[region[kind]])
    return Contents(
        points=np.asarray(raw.points, dtype=np.float64),
        cells=merged,
        regions=members_of,
        facets={name: {k: np.concatenate(p) for k, p in f.items()} for name, f in facets.items()},
        node_sets={name: np.unique(np.concatenate(p)) for name, p in node_sets.items()},
    )
