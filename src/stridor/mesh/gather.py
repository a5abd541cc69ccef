"""From what a mesh file holds to one body: its cells, the points they use, and the groups that touch them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from ..errors import CaseError
from ..typing import Array, IntArray
from .boundary import cell_facets, closest, listed, match_facets
from .kinds import KINDS
from .model import PLANE_KINDS, SOLID_KINDS, Blocks, Mesh
from .quality import turned_over

# A plane mesh may be written with z that is not quite zero; over its size, less than this is rounding.
_FLAT = 1e-9
# Wedges and pyramids, by names of meshio's and of Abaqus's: they stand between hexahedra and tetrahedra.
_BETWEEN = ("WEDGE", "PYRAMID", "C3D6", "C3D15", "C3D5", "C3D13")


@dataclass(frozen=True)
class Contents:
    """What a file holds. points (k, 2 or 3); cells by kind, also by kinds that cannot be computed with, but no facets;
    regions: name → cells as indices into cells[kind]; facets: name → facets by kind, in any orientation; node_sets:
    name → nodes. accepted: cells that can be computed with, in the words of the file's format. numbers (k,): what the
    file calls its points; turned (s,): points whose freedoms it puts along axes of their own.
    """

    points: Array
    cells: Blocks
    regions: Mapping[str, Mapping[str, IntArray]] = field(default_factory=dict)
    facets: Mapping[str, Blocks] = field(default_factory=dict)
    node_sets: Mapping[str, IntArray] = field(default_factory=dict)
    accepted: str = ", ".join((*PLANE_KINDS, *SOLID_KINDS))
    numbers: IntArray | None = None
    turned: IntArray | None = None


def gather(contents: Contents, *, source: str, where: str, group: str | None = None, scale: float = 1.0) -> Mesh:
    """The body: all cells, or those of the region ``group``, with coordinates times ``scale``.

    Facets are turned to point out of the body. A group of facets of which some lie between two cells of the body is
    no boundary of it, and becomes a node set. Groups that have no part in the body are left out, and so are points
    that no cell uses. Cells in the plane that are numbered clockwise are turned over. Raises CaseError with
    where.file, where.group or where.scale.
    """
    if isinstance(scale, bool) or not math.isfinite(scale) or scale <= 0:
        raise CaseError(f"{where}.scale", scale, "must be a number greater than 0, metres per unit of the file")
    chosen = _chosen(contents, where, group, source)
    cells = {kind: np.asarray(block)[chosen[kind]] for kind, block in contents.cells.items() if len(chosen[kind])}
    _refuse_unsupported(cells, contents.accepted, f"{where}.file", source)
    used = np.zeros(len(contents.points), dtype=bool)
    for block in cells.values():
        if block.min() < 0 or block.max() >= len(used):
            raise CaseError(f"{where}.file", source, "has cells that use points which are not in the file")
        used[block] = True
    named = [*contents.node_sets.values(), *(f for facets in contents.facets.values() for f in facets.values())]
    if any(n.size and (n.min() < 0 or n.max() >= len(used)) for n in named):
        raise CaseError(f"{where}.file", source, "has groups that use points which are not in the file")
    new = np.cumsum(used) - 1
    points = _of_cells_dimension(contents.points[used], cells, f"{where}.file", source) * scale
    mine = turned_over({kind: new[block] for kind, block in cells.items()}, points)
    every = cell_facets(mine, points)
    boundaries: dict[str, Blocks] = {}
    node_sets = {name: new[np.unique(n[used[n]])] for name, n in contents.node_sets.items() if np.any(used[n])}
    for name, facets in contents.facets.items():
        inside = {kind: new[f[used[f].all(axis=1)]] for kind, f in facets.items()}
        matched = match_facets(every, inside)
        stray = matched.stray_count + _count(facets) - _count(inside)
        if stray and group is None:
            raise CaseError(
                f"{where}.file",
                source,
                f"group {name}: {stray} of its facets are a side of no cell; choose the body by group, or take this "
                "group out of the file",
            )
        if matched.inner_count:
            node_sets.setdefault(name, np.unique(np.concatenate([f.ravel() for f in inside.values()])))
        elif matched.outer:
            boundaries[name] = matched.outer
    regions = _regions(contents, chosen)
    numbers = None if contents.numbers is None else contents.numbers[used]
    turned = None if contents.turned is None else new[contents.turned[used[contents.turned]]]
    return Mesh(points, mine, boundaries, node_sets, regions, source, numbers, turned)


def _chosen(contents: Contents, where: str, group: str | None, source: str) -> dict[str, IntArray]:
    """Indices of the body's cells by kind."""
    if group is None:
        if not any(len(block) for block in contents.cells.values()):
            raise CaseError(f"{where}.file", source, f"has no cells; a body needs some of: {contents.accepted}")
        return {kind: np.arange(len(block)) for kind, block in contents.cells.items()}
    if group not in contents.regions:
        names = list(contents.regions)
        if not names:
            raise CaseError(
                f"{where}.group",
                group,
                f"{source} has no named groups of cells; in Gmsh make them with Physical Surface (plane) or Physical "
                "Volume (solid), in Abaqus with *ELSET",
            )
        accepted = f"no such group of cells; {closest(group, names)}{source} has: {listed(names)}"
        raise CaseError(f"{where}.group", group, accepted)
    chosen = contents.regions[group]
    empty = np.zeros(0, dtype=np.int64)
    found = {kind: np.unique(chosen.get(kind, empty)) for kind in contents.cells}
    if not any(len(c) for c in found.values()):
        raise CaseError(f"{where}.group", group, f"this group of {source} has no cells")
    return found


def other_cells(kinds: Iterable[str]) -> str:
    """What to take in place of wedges and pyramids, as an end of a message; "" where there are none of them."""
    between = any(kind.upper().startswith(_BETWEEN) for kind in kinds)
    return "; mesh the body with hexahedra alone, or with tetrahedra" if between else ""


def _refuse_unsupported(cells: Blocks, accepted: str, where: str, source: str) -> None:
    """Refuses kinds that cannot be computed with, and bodies part plane, part solid."""
    odd = {kind: len(block) for kind, block in cells.items() if kind not in KINDS}
    if odd:
        counted = ", ".join(f"{count} {kind}" for kind, count in odd.items())
        text = f"has cells that cannot be computed with: {counted}; accepted: {accepted}{other_cells(odd)}"
        raise CaseError(where, source, text)
    dimensions = {KINDS[kind].dimension for kind in cells}
    if len(dimensions) > 1:
        raise CaseError(where, source, "has cells in the plane and in space; choose those of the body by group")


def _of_cells_dimension(points: Array, cells: Blocks, where: str, source: str) -> Array:
    """Points (k, d) [file's unit] of the dimension of the cells."""
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise CaseError(where, source, f"has {len(bad)} points whose coordinates are not finite numbers")
    dimension = KINDS[next(iter(cells))].dimension
    if dimension == points.shape[1]:
        return points.astype(np.float64)
    if dimension == 3:
        raise CaseError(where, source, "has solid cells, but its points have two coordinates only")
    size = float(np.ptp(points[:, :2], axis=0).max())
    heights = points[:, 2]
    if np.abs(heights).max() > _FLAT * size:
        span = f"z from {heights.min():g} to {heights.max():g}"
        kinds = ", ".join(cells)
        raise CaseError(
            where,
            source,
            f"has only {kinds} cells, and they are not in the plane z = 0 ({span}); a plane body lies at z = 0, a "
            "solid one is of tetrahedra or hexahedra",
        )
    return points[:, :2].astype(np.float64)


def _count(blocks: Blocks) -> int:
    return sum(len(block) for block in blocks.values())


def _regions(contents: Contents, chosen: Mapping[str, IntArray]) -> dict[str, dict[str, IntArray]]:
    """Regions in the numbering of the chosen cells, those without any left out."""
    regions: dict[str, dict[str, IntArray]] = {}
    for name, region in contents.regions.items():
        found: dict[str, IntArray] = {}
        for kind, index in region.items():
            mine = chosen[kind]
            here = np.flatnonzero(np.isin(mine, index))
            if len(here):
                found[kind] = here
        if found:
            regions[name] = found
    return regions
