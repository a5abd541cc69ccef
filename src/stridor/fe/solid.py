"""Matrices of solid bodies: plane stress, plane strain and space; isotropic, linear.

Freedom d · node + direction of each body, nodes as its mesh numbers them. The mapping is isoparametric: with quadratic
kinds edges and faces may be curved. Near ν = 1/2 the linear kinds lock in plane strain and in space; the quadratic ones
hardly do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import scipy.sparse as sp

from ..errors import CaseError, Problem
from ..laws import Material
from ..mesh.model import PLANE_KINDS, SOLID_KINDS, Mesh
from ..typing import Array, IntArray, Sparse
from .elements import Element, element

if TYPE_CHECKING:
    from .element_kernel import Cells, Graph

SolidModel = Literal["plane stress", "plane strain", "3d"]
_KINDS = {"plane stress": PLANE_KINDS, "plane strain": PLANE_KINDS, "3d": SOLID_KINDS}


@dataclass(frozen=True)
class SolidMatrices:
    """mass [kg] and stiffness [N/m] (k·d, k·d) csr of a free body of k nodes in d dimensions, exactly symmetric.

    Freedom d · node + direction, nodes of `mesh.points` in its numbering.
    """

    mass: Sparse
    stiffness: Sparse


def assemble_solid(
    mesh: Mesh, material: Material, *, model: SolidModel, thickness: float = 1.0, lumped: bool = False
) -> SolidMatrices:
    """Mass and stiffness of a free body. thickness [m] is that of a plane body; in space it is not used.

    lumped: a diagonal mass, positive for every kind; it keeps the mass of each cell, not its rotational inertia.
    Raises CaseError for a mesh that does not fit the model or has a flat or folded cell, and for a material that cannot
    exist.
    """
    from . import element_kernel as kernel  # numba is slow to import; only who has solids waits for it

    blocks = _blocks(mesh, material, model, thickness)
    depth = 1.0 if model == "3d" else thickness
    lame, shear = (depth * modulus for modulus in _moduli(material, model))
    nodes, d = mesh.points.shape
    size = nodes * d
    masses: list[Sparse] = []
    stiffnesses: list[Sparse] = []
    diagonal = np.zeros(nodes)
    for block in blocks:
        values = np.zeros((len(block.graph.indices), d, d))
        kernel.add_stiffness(block.stiffness, lame, shear, block.graph, values)
        indptr, indices = _narrow(block.graph.indptr, block.graph.indices, values.size)
        stiffnesses.append(sp.bsr_array((values, indices, indptr), shape=(size, size)).tocsr())
        if lumped:
            kernel.add_lumped_mass(block.mass, depth * material.density, diagonal)
        else:
            numbers = np.zeros(len(block.graph.indices))
            kernel.add_mass(block.mass, depth * material.density, block.graph, numbers)
            masses.append(_in_every_direction(block.graph, numbers, d))
    if lumped:
        masses.append(sp.diags_array(np.repeat(diagonal, d)))
    return SolidMatrices(_sum(masses), _sum(stiffnesses))


def stress_stiffness(
    mesh: Mesh, material: Material, *, model: SolidModel, thickness: float = 1.0, displacement: Array
) -> Sparse:
    """Geometric stiffness K_σ (k·d, k·d) csr [N/m], ∫ ∇δu · σ · ∇uᵀ, to be added to the stiffness.

    σ is the Cauchy stress of the displacement (k·d,) [m], which counts as small; tension makes K_σ positive. Symmetric;
    a rigid translation meets no force, a rotation does where there is stress. Raises CaseError as `assemble_solid`, and
    ValueError for a displacement of another size.
    """
    from . import element_kernel as kernel

    blocks = _blocks(mesh, material, model, thickness)
    depth = 1.0 if model == "3d" else thickness
    lame, shear = (depth * modulus for modulus in _moduli(material, model))
    nodes, d = mesh.points.shape
    if displacement.shape != (nodes * d,):
        raise ValueError(f"a displacement of {nodes * d} freedoms is needed, not of shape {displacement.shape}")
    moved = np.ascontiguousarray(displacement, dtype=np.float64).reshape(nodes, d)
    parts: list[Sparse] = []
    for block in blocks:
        numbers = np.zeros(len(block.graph.indices))
        kernel.add_stress_stiffness(block.stiffness, lame, shear, moved, block.graph, numbers)
        parts.append(_in_every_direction(block.graph, numbers, d))
    return _sum(parts)


def wave_speeds(material: Material, model: SolidModel) -> tuple[float, float]:
    """Speeds [m/s] of plane pressure waves and shear waves; in plane stress the former is that of a thin plate.

    Raises CaseError for a material that cannot exist.
    """
    problems = _material_problems(material, model)
    if problems:
        raise CaseError.many(problems)
    lame, shear = _moduli(material, model)
    return float(np.sqrt((lame + 2.0 * shear) / material.density)), float(np.sqrt(shear / material.density))


def _moduli(material: Material, model: SolidModel) -> tuple[float, float]:
    """λ and μ [Pa] of σ = λ tr ε + 2 μ ε. In plane stress λ = E ν / (1 − ν²): the strain across is eliminated."""
    modulus, ratio = material.young_modulus, material.poisson_ratio
    shear = modulus / (2.0 * (1.0 + ratio))
    if model == "plane stress":
        return modulus * ratio / (1.0 - ratio**2), shear
    return modulus * ratio / ((1.0 + ratio) * (1.0 - 2.0 * ratio)), shear


@dataclass(frozen=True)
class _Block:
    """The cells of one kind with the rules of their stiffness and of their mass, and the pairs of nodes they join."""

    stiffness: Cells
    mass: Cells
    graph: Graph


def _blocks(mesh: Mesh, material: Material, model: SolidModel, thickness: float) -> list[_Block]:
    """The blocks of a mesh, after everything given has been looked at."""
    from .element_kernel import Cells, first_folded, node_graph

    problems = [*_material_problems(material, model), *_mesh_problems(mesh, model)]
    if model != "3d" and not (np.isfinite(thickness) and thickness > 0.0):
        problems.append(Problem("thickness", thickness, "the thickness of a plane body is positive [m]"))
    if problems:
        raise CaseError.many(problems)
    points = np.ascontiguousarray(mesh.points, dtype=np.float64)
    blocks: list[_Block] = []
    for kind, cells in mesh.cells.items():
        shape: Element = element(kind)
        nodes = np.ascontiguousarray(cells, dtype=np.int64)
        of_stiffness, of_mass = (
            Cells(points, nodes, rule.weights, rule.values, rule.gradients) for rule in (shape.stiffness, shape.mass)
        )
        for looked_at in (of_stiffness, of_mass):
            folded = int(first_folded(looked_at))
            if folded >= 0:
                raise CaseError(_where(mesh), f"{kind} {folded}", _folded(points[nodes[folded]]))
        blocks.append(_Block(of_stiffness, of_mass, node_graph(nodes, len(points))))
    return blocks


def _material_problems(material: Material, model: SolidModel) -> list[Problem]:
    problems: list[Problem] = []
    if model not in _KINDS:
        problems.append(Problem("model", model, f"no such model; there are: {', '.join(_KINDS)}"))
    for name in ("young_modulus", "density"):
        value = getattr(material, name)
        if not (np.isfinite(value) and value > 0.0):
            problems.append(Problem(f"material.{name}", value, "must be a positive number"))
    ratio = material.poisson_ratio
    if model == "plane stress" and not -1.0 < ratio <= 0.5:
        problems.append(Problem("material.poisson_ratio", ratio, "must be above -1 and at most 0.5"))
    if model != "plane stress" and not -1.0 < ratio < 0.5:
        accepted = "must be above -1 and below 0.5: what cannot be compressed has no stiffness matrix; 0.49 will do"
        problems.append(Problem("material.poisson_ratio", ratio, accepted))
    return problems


def _mesh_problems(mesh: Mesh, model: SolidModel) -> list[Problem]:
    kinds = _KINDS.get(model)
    if kinds is None:
        return []
    where = _where(mesh)
    wanted = 3 if model == "3d" else 2
    if mesh.dimension != wanted:
        return [Problem(where, f"{mesh.dimension} coordinates a point", f"model {model!r} needs {wanted}")]
    problems: list[Problem] = []
    if not np.isfinite(mesh.points).all():
        problems.append(Problem(where, "points", "every coordinate must be a finite number"))
    if not mesh.cells:
        problems.append(Problem(where, "no cells", f"model {model!r} needs some of: {', '.join(kinds)}"))
    for kind, cells in mesh.cells.items():
        if kind not in kinds:
            problems.append(Problem(where, f"cells {kind}", f"model {model!r} takes: {', '.join(kinds)}"))
        elif cells.ndim != 2 or cells.shape[1] != len(element(kind).nodes):
            accepted = f"cells {kind} have {len(element(kind).nodes)} nodes each"
            problems.append(Problem(where, f"an array of shape {cells.shape}", accepted))
        elif cells.size and not (cells.min() >= 0 and cells.max() < len(mesh.points)):
            given = f"cells {kind} with nodes {cells.min()} to {cells.max()}"
            problems.append(Problem(where, given, f"the mesh has nodes 0 to {len(mesh.points) - 1}"))
    return problems


def _where(mesh: Mesh) -> str:
    return mesh.source or "mesh"


def _folded(points: Array) -> str:
    centre = ", ".join(f"{x:.4g}" for x in points.mean(axis=0))
    return (
        f"this cell around ({centre}) m is flat or folds over itself; check the order of its nodes (VTK's), nodes that "
        "coincide, and how far the nodes between corners have moved"
    )


def _in_every_direction(graph: Graph, numbers: Array, d: int) -> Sparse:
    """Matrix (k·d, k·d) csr of a number for each pair of nodes, the same in each of the d directions."""
    from .element_kernel import spread

    indptr, indices, data = spread(graph, numbers, d)
    indptr, indices = _narrow(indptr, indices, data.size)
    size = len(indptr) - 1
    return sp.csr_array((data, indices, indptr), shape=(size, size))


def _narrow(indptr: IntArray, indices: IntArray, entries: int) -> tuple[IntArray, IntArray]:
    """Both with the index width SciPy and the direct solvers prefer: 32 bits wherever the entries can be counted so."""
    width = np.int32 if entries <= np.iinfo(np.int32).max else np.int64
    return indptr.astype(width, copy=False), indices.astype(width, copy=False)


def _sum(parts: Sequence[Sparse]) -> Sparse:
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return sp.csr_array(total)
