"""What a mesh must be to be computed with, and how fine it is."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from ..errors import CaseError, Problem
from ..typing import Array, BoolArray, IntArray, Sparse
from .boundary import cell_facets, match_facets
from .kinds import FACET_CORNERS, KINDS, corner_jacobians
from .model import FACET_KINDS, Blocks, Mesh

# The sine of a corner, or of the solid angle of one, below which it is flat: far below what any mesher makes, far
# above the rounding of coordinates.
_FLAT = 1e-10


def check_mesh(mesh: Mesh, where: str) -> None:
    """Raises CaseError, with everything that is wrong, unless every cell has a positive Jacobian at its corners.

    Also refused: points that are not finite, cells that index missing points, points of no cell, kinds of cells that
    do not belong in the plane or in space, facets without area in boundaries and facets that are no side of a cell.
    """
    problems = _index_problems(mesh, where)
    if not problems:  # what follows computes with the points
        with np.errstate(over="ignore", invalid="ignore"):  # of coordinates beyond 1e100: told as cells that are flat
            problems = [*_cell_problems(mesh, where), *_facet_problems(mesh, where)]
    if problems:
        raise CaseError.many(problems)


def turned_over(cells: Blocks, points: Array) -> Blocks:
    """Cells in the plane with patches that are numbered clockwise turned over; the same object if there are none."""
    if points.shape[1] != 2 or not any(len(block) for block in cells.values()):
        return cells
    with np.errstate(all="ignore"):
        inverted = {kind: _all_inverted(kind, block, points) for kind, block in cells.items()}
    if not any(np.any(i) for i in inverted.values()):
        return cells
    patch = _patches(cells)
    wrong = np.concatenate([inverted[kind] for kind in cells])
    upright = np.bincount(patch, weights=~wrong) > 0
    turn = ~upright[patch]
    if not np.any(turn):
        return cells
    found: dict[str, IntArray] = {}
    start = 0
    for kind, block in cells.items():
        mine = turn[start : start + len(block)]
        start += len(block)
        found[kind] = np.where(mine[:, None], block[:, KINDS[kind].mirrored], block)
    return found


def pieces(mesh: Mesh) -> int:
    """Number of pieces that share no node with each other; 1 where the body is in one piece."""
    return int(connected_components(_adjacency(mesh), directed=False)[0])


def edge_lengths(mesh: Mesh) -> tuple[float, float]:
    """Least and largest distance [m] between neighbouring corners of a cell; midside nodes do not count."""
    least, largest = np.inf, 0.0
    for kind, block in mesh.cells.items():
        for i, j in KINDS[kind].edges:
            length = np.linalg.norm(mesh.points[block[:, i]] - mesh.points[block[:, j]], axis=1)
            least, largest = min(least, float(length.min(initial=np.inf))), max(largest, float(length.max(initial=0.0)))
    return least, largest


def _index_problems(mesh: Mesh, where: str) -> list[Problem]:
    """Points and indices that no cell can be computed from."""
    problems: list[Problem] = []
    points = mesh.points
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        return [Problem(where, None, f"points of shape {points.shape}; must be (k, 2) or (k, 3)")]
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        first = f"the first is point {bad[0] + 1} at {_coordinates(points[bad[0]])}"
        problems.append(Problem(where, None, f"{len(bad)} of {len(points)} points have no finite place; {first}"))
    if not mesh.cell_count:
        problems.append(Problem(where, None, "no cells; a body needs some"))
    used = np.zeros(len(points), dtype=bool)
    for kind, block in mesh.cells.items():
        dimension = KINDS[kind].dimension if kind in KINDS else None
        if dimension != points.shape[1] or block.ndim != 2 or block.shape[1] != KINDS[kind].nodes:
            accepted = ", ".join(k for k, t in KINDS.items() if t.dimension == points.shape[1])
            problems.append(Problem(where, None, f"cells of kind {kind}; in {points.shape[1]}D accepted: {accepted}"))
            continue
        problems += _missing(block, len(points), where, f"{kind} cells")
        used[block[(block >= 0) & (block < len(points))]] = True
    for name, facets in mesh.boundaries.items():
        for kind, block in facets.items():
            if kind not in FACET_KINDS or (FACET_CORNERS[kind] == 2) != (points.shape[1] == 2):
                problems.append(Problem(where, None, f"boundary {name}: facets of kind {kind} do not belong there"))
            problems += _missing(block, len(points), where, f"facets of boundary {name}")
    if not problems and not np.all(used):
        idle = np.flatnonzero(~used)
        first = f"the first is point {idle[0] + 1} at {_coordinates(points[idle[0]])}"
        problems.append(Problem(where, None, f"{len(idle)} points belong to no cell; {first}"))
    return problems


def _missing(block: IntArray, count: int, where: str, what: str) -> list[Problem]:
    """Indices of points that do not exist."""
    bad = np.flatnonzero(((block < 0) | (block >= count)).any(axis=1))
    if not len(bad):
        return []
    return [Problem(where, None, f"{len(bad)} {what} use points that do not exist; the first is number {bad[0] + 1}")]


def _cell_problems(mesh: Mesh, where: str) -> list[Problem]:
    """Cells with a node twice, inverted and degenerate ones: how many, and the first."""
    if twice := _twice_problems(mesh, where):
        return twice  # which are also inverted or degenerate, as a rule
    inverted, degenerate, whole = 0, 0, 0
    first: dict[str, tuple[str, int, Array]] = {}
    for kind, block in mesh.cells.items():
        relative = corner_jacobians(kind, block, mesh.points)[1]
        least = relative.min(axis=1, initial=np.inf)
        flat = (least <= _FLAT) & (least >= -_FLAT)
        wrong = least < -_FLAT
        whole += int(np.sum(relative.max(axis=1, initial=-np.inf) < -_FLAT))
        inverted, degenerate = inverted + int(wrong.sum()), degenerate + int(flat.sum())
        for name, found in (("inverted", wrong), ("degenerate", flat)):
            if name not in first and np.any(found):
                cell = int(np.argmax(found))
                first[name] = (kind, cell, mesh.points[block[cell, : KINDS[kind].corners]].mean(axis=0))
    problems: list[Problem] = []
    if inverted:
        if whole == mesh.cell_count:
            text = f"all {whole} cells are inverted: the order of their nodes is mirrored; number them the other way"
        else:
            text = f"{inverted} of {mesh.cell_count} cells are inverted (negative Jacobian)"
            text = f"{text}; {_first(*first['inverted'])}"
        problems.append(Problem(where, None, text))
    if degenerate:
        text = f"{degenerate} of {mesh.cell_count} cells are degenerate (zero Jacobian: flat, or nodes at one place)"
        problems.append(Problem(where, None, f"{text}; {_first(*first['degenerate'])}"))
    problems += _duplicate_problems(mesh, where)
    return problems or _overlap_problems(mesh, where)


def _twice_problems(mesh: Mesh, where: str) -> list[Problem]:
    """Cells that name one of their nodes twice: no cell is drawn together to one with fewer corners."""
    count, first = 0, ""
    for kind, block in mesh.cells.items():
        ordered = np.sort(block, axis=1)
        again = ordered[:, 1:] == ordered[:, :-1]
        found = np.flatnonzero(again.any(axis=1))
        count += len(found)
        if len(found) and not first:
            cell = int(found[0])
            node = int(ordered[cell, 1:][again[cell]][0])
            named = "the node" if mesh.numbers is None else f"node {mesh.numbers[node]},"
            centre = mesh.points[block[cell, : KINDS[kind].corners]].mean(axis=0)
            first = f"{_first(kind, cell, centre)}, with {named} at {_coordinates(mesh.points[node])}"
    if not count:
        return []
    text = f"{count} of {mesh.cell_count} cells name a node twice; {first}; every node of a cell is one of its own"
    return [Problem(where, None, text)]


def _duplicate_problems(mesh: Mesh, where: str) -> list[Problem]:
    """Cells of the same nodes as another one: their mass and stiffness would count twice."""
    # Sums of random numbers of the nodes, whatever their order: equal by chance once in 2⁶⁴.
    mark = np.random.default_rng(0).integers(0, 2**63, len(mesh.points), dtype=np.uint64)
    problems: list[Problem] = []
    for kind, block in mesh.cells.items():
        sums = mark[block].sum(axis=1, dtype=np.uint64)
        order = np.argsort(sums, kind="stable")
        again = order[1:][sums[order[1:]] == sums[order[:-1]]]
        if len(again):
            cell = int(again.min())
            centre = mesh.points[block[cell, : KINDS[kind].corners]].mean(axis=0)
            text = f"{len(again)} of {mesh.cell_count} cells have the nodes of another cell"
            problems.append(Problem(where, None, f"{text}; {_first(kind, cell, centre)}; take them out of the file"))
    return problems


def _overlap_problems(mesh: Mesh, where: str) -> list[Problem]:
    """Sides that two cells pass in the same direction, with which both lie on the same side of it: they overlap.

    For cells that are not inverted only: outward sides of neighbours run round in opposite directions.
    """
    mark = np.random.default_rng(1).integers(0, 2**62, len(mesh.points), dtype=np.uint64)
    keys: list[IntArray] = []
    centres: list[Array] = []
    for kind, facets in cell_facets(mesh.cells, mesh.points).nodes.items():
        corners = facets[:, : FACET_CORNERS[kind]]
        lowest, each = corners.argmin(axis=1), np.arange(len(corners))
        count = corners.shape[1]
        if count == 2:
            sense = corners[:, 0] < corners[:, 1]
        else:
            sense = corners[each, (lowest + 1) % count] < corners[each, (lowest - 1) % count]
        keys.append(2 * mark[corners].sum(axis=1, dtype=np.uint64) + sense.astype(np.uint64))
        centres.append(mesh.points[corners].mean(axis=1))
    key = np.concatenate(keys)
    order = np.argsort(key, kind="stable")
    again = order[1:][key[order[1:]] == key[order[:-1]]]
    if not len(again):
        return []
    side = "edges have two cells" if mesh.dimension == 2 else "faces have two cells"
    centre = _coordinates(np.concatenate(centres)[int(again.min())])
    text = f"{len(again)} {side} on the same side of them, which overlap; the first is about {centre}"
    return [Problem(where, None, f"{text}; mesh the body anew, or take one of the cells out of the file")]


def _facet_problems(mesh: Mesh, where: str) -> list[Problem]:
    """Facets of boundaries without area, or that are no side of a cell."""
    problems: list[Problem] = []
    if not mesh.boundaries:
        return problems
    every = cell_facets(mesh.cells, mesh.points)
    for name, facets in mesh.boundaries.items():
        for kind, block in facets.items():
            flat = _without_area(kind, block, mesh.points)
            if np.any(flat):
                centre = _coordinates(mesh.points[block[int(np.argmax(flat))]].mean(axis=0))
                text = f"boundary {name}: {int(flat.sum())} of {len(block)} facets have no area"
                problems.append(Problem(where, None, f"{text}; the first is at {centre}"))
        matched = match_facets(every, facets)
        if matched.stray_count:
            text = f"boundary {name}: {matched.stray_count} facets are a side of no cell"
            problems.append(Problem(where, None, text))
    return problems


def _without_area(kind: str, block: IntArray, points: Array) -> BoolArray:
    """Which facets (f,) have corners in one place or in one line."""
    corners = points[block[:, : FACET_CORNERS[kind]]]
    first, last = corners[:, 1] - corners[:, 0], corners[:, -1] - corners[:, 0]
    if corners.shape[1] == 2:
        size = np.abs(points).max(initial=0.0)
        return np.linalg.norm(first, axis=1) <= 1e-14 * size
    if corners.shape[1] == 4:  # by its diagonals: a triangle given as a quadrilateral still has area
        first, last = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    product = np.linalg.norm(first, axis=1) * np.linalg.norm(last, axis=1)
    return np.linalg.norm(np.cross(first, last), axis=1) <= _FLAT * product


def _first(kind: str, cell: int, centre: Array) -> str:
    return f"the first is {kind} cell number {cell + 1} about {_coordinates(centre)}"


def _coordinates(point: Array) -> str:
    return "(" + ", ".join(f"{v:.6g}" for v in point) + ")"


def _all_inverted(kind: str, block: IntArray, points: Array) -> BoolArray:
    """Which cells (c,) have a negative Jacobian at every corner."""
    return corner_jacobians(kind, block, points)[1].max(axis=1, initial=-np.inf) < -_FLAT


def _patches(cells: Blocks) -> IntArray:
    """Number (c,) of the patch of each cell in the plane: neighbours that run along their common edge in opposite
    directions, as cells numbered in the same sense do, are of one patch."""
    tails: list[IntArray] = []
    heads: list[IntArray] = []
    owners: list[IntArray] = []
    start = 0
    for kind, block in cells.items():
        for facet in KINDS[kind].facets:
            tails.append(block[:, facet[0]])
            heads.append(block[:, facet[1]])
            owners.append(start + np.arange(len(block)))
        start += len(block)
    tail, head, owner = np.concatenate(tails), np.concatenate(heads), np.concatenate(owners)
    nodes = int(max(tail.max(), head.max())) + 1
    forward, backward = tail * nodes + head, head * nodes + tail
    order = np.argsort(forward, kind="stable")
    index = np.minimum(np.searchsorted(forward[order], backward), len(order) - 1)
    opposite = order[index]
    meets = forward[opposite] == backward
    pairs = (owner[meets], owner[opposite[meets]])
    graph = sp.coo_array((np.ones(len(pairs[0])), pairs), shape=(start, start))
    return np.asarray(connected_components(graph.tocsr(), directed=False)[1], dtype=np.int64)


def _adjacency(mesh: Mesh) -> Sparse:
    """Which points share a cell: each cell's nodes with its first."""
    rows = np.concatenate([np.repeat(block[:, 0], block.shape[1]) for block in mesh.cells.values()])
    columns = np.concatenate([block.ravel() for block in mesh.cells.values()])
    count = len(mesh.points)
    return sp.csr_array(sp.coo_array((np.ones(len(rows)), (rows, columns)), shape=(count, count)))
