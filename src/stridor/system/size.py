"""How large a model will be, told before anything is allocated."""

from __future__ import annotations

import math
from pathlib import Path

from ..case import Case
from ..case.bodies import AnnulusMesh, BlockMesh, BuiltInMesh, QuadrilateralMesh, RectangleMesh, SolidBody
from ..case.points import FULL_TURN
from ..errors import CaseError
from ..mesh.paths import shown_path

MOST_FREEDOMS = 5_000_000
_ENTRY_BYTES = 12  # a double and an index
_COPIES = 4  # stiffness and damping, of the bodies and of the structure

# Nodes that share a cell with a node, on average inside a large mesh of the kind.
_NEIGHBOURS = {
    "triangle": 7,
    "triangle6": 12,
    "quad": 9,
    "quad8": 16,
    "quad9": 16,
    "tetra": 15,
    "tetra10": 29,
    "hexahedron": 27,
    "hexahedron20": 58,
    "hexahedron27": 64,
}


def refuse_too_many(case: Case) -> None:
    """Raises CaseError where the built-in meshes of a case have more freedoms than can be computed with."""
    sizes: dict[str, float] = {}
    memory = 0.0
    for name, body in case.bodies.items():
        if isinstance(body, SolidBody) and body.mesh is not None:
            sizes[name] = body.dimension * nodes_of(body.mesh)
            memory += matrix_bytes(sizes[name], body.mesh.cells, body.dimension)
    total = sum(sizes.values())
    if not total > MOST_FREEDOMS:
        return
    largest = max(sizes, key=lambda name: sizes[name])
    body = case.bodies[largest]
    assert isinstance(body, SolidBody), "only solids are counted"
    assert body.mesh is not None, "only built-in meshes are counted"
    key = "element_size" if body.mesh.divisions is None else "divisions"
    who = "" if sizes[largest] >= 0.99 * total else f" of {_million(total)} in all bodies"
    alone = f"about {memory / 1e9:.2g} GB" if memory < 1e18 else "more than any machine has"
    raise CaseError(
        f"bodies.{largest}.mesh.{key}",
        getattr(body.mesh, key),
        f"makes {_million(sizes[largest])} degrees of freedom{who}, whose matrices alone take {alone}; at most "
        f"{_million(MOST_FREEDOMS)} can be computed with: "
        + ("take a larger element_size" if key == "element_size" else "take fewer divisions"),
    )


def refuse_too_many_read(where: str, file: str, own: int, before: int) -> None:
    """Raises CaseError where the freedoms of a mesh from a file, with those before it, are too many."""
    if own + before > MOST_FREEDOMS:
        accepted = (
            f"has {_million(own)} degrees of freedom, {_million(own + before)} with the bodies before it; at most "
            f"{_million(MOST_FREEDOMS)} can be computed with: take a coarser mesh"
        )
        raise CaseError(f"{where}.file", shown_path(Path(file)), accepted)


def matrix_bytes(freedoms: float, cells: str, dimension: int) -> float:
    """Bytes that the matrices of so many freedoms take, before any factorisation."""
    return freedoms * dimension * _NEIGHBOURS[cells] * _ENTRY_BYTES * _COPIES


def nodes_of(mesh: BuiltInMesh) -> float:
    """Number of nodes of a built-in mesh, infinite where it is beyond counting."""
    lengths = _lengths(mesh)
    if mesh.divisions is not None:
        counts = [float(n) for n in mesh.divisions]
    else:
        assert mesh.element_size is not None, "checked: a mesh has divisions or an element size"
        counts = [max(1.0, _ceil(length, mesh.element_size)) for length in lengths]
    closed = [False] * len(counts)
    if len(counts) > 1:
        closed[1] = mesh.shape == "disc" or (isinstance(mesh, AnnulusMesh) and mesh.sweep_deg >= FULL_TURN)
    kind = mesh.cells
    corners = [n + (0.0 if c else 1.0) for n, c in zip(counts, closed, strict=True)]
    if kind in ("triangle", "quad", "tetra", "hexahedron"):
        found = math.prod(corners)
    elif kind in ("quad8", "hexahedron20"):
        # Corners and the middles of edges, along each direction in turn.
        edges = [counts[a] * math.prod(corners[:a] + corners[a + 1 :]) for a in range(len(counts))]
        found = math.prod(corners) + sum(edges)
    else:
        found = math.prod(2.0 * n + (0.0 if c else 1.0) for n, c in zip(counts, closed, strict=True))
    if isinstance(mesh, AnnulusMesh) and mesh.inner_radius == 0.0:
        # The square in the middle adds its (a/4)² cells, each with about as many nodes as one of the rings.
        found += found / math.prod(counts) * (counts[1] / 4.0) ** 2
    return found


def _lengths(mesh: BuiltInMesh) -> tuple[float, ...]:
    """Lengths [m] along which divisions are counted."""
    if isinstance(mesh, RectangleMesh | BlockMesh):
        return tuple(mesh.size)
    if isinstance(mesh, QuadrilateralMesh):
        c = mesh.corners
        sides = [math.dist(c[k], c[(k + 1) % 4]) for k in range(4)]
        return max(sides[0], sides[2]), max(sides[1], sides[3])
    sweep = getattr(mesh, "sweep_deg", 360.0)
    plane = (mesh.outer_radius - mesh.inner_radius, mesh.outer_radius * math.radians(sweep))
    return plane if isinstance(mesh, AnnulusMesh) else (*plane, mesh.thickness)


def _ceil(length: float, size: float) -> float:
    ratio = length / size
    return math.ceil(ratio * (1 - 1e-9)) if ratio < 1e15 else math.inf


def _million(count: float) -> str:
    if count < 1e10:
        return f"{count / 1e6:.4g} million"
    return f"{count:.1e}" if count < 1e20 else "more than 1e+20"
