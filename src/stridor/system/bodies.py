"""Bodies of a case with their own matrices, and where their freedoms start in the structure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from ..case import Case
from ..case.bodies import BeamBody, MassBody, MatrixBody, SolidBody
from ..errors import CaseError
from ..fe.assembly import assemble_beam
from ..fe.beam import DOF_PER_NODE, BeamElement, BeamMesh
from ..fe.solid import assemble_solid
from ..laws import Material
from ..mesh.model import Mesh
from ..typing import Array, IntArray, Sparse
from .imported import load_matrices
from .meshes import LoadedMesh, load_mesh, mesh_follows_from
from .size import refuse_too_many, refuse_too_many_read

AXES = ("x", "y", "z")
# Squares and ratios of masses and stiffnesses stay numbers between these.
_LEAST, _MOST = 1e-100, 1e100


@dataclass(frozen=True)
class BuiltBody:
    """A body and its matrices (size, size) csr. stride freedoms per node, of which the first ``dimension`` are
    displacements, then freedoms of no node, called ``extra``; points (k, d) [m] are its nodes, NaN where nothing says
    where these are. beam or mesh is what it was built from. numbers (k,): what another program calls the nodes;
    lacking: freedoms, counted within the body, that its matrices do not have; rotations (r, 2): node and freedom,
    counted within the body, of those among ``extra`` that turn a node."""

    name: str
    offset: int
    stride: int
    points: Array
    mass: Sparse
    damping: Sparse
    stiffness: Sparse
    beam: BeamMesh | None = None
    mesh: Mesh | None = None
    material: Material | None = None
    extra: tuple[str, ...] = ()
    numbers: IntArray | None = None
    lacking: IntArray | None = None
    rotations: IntArray | None = None

    @property
    def size(self) -> int:
        """Number of freedoms before supports."""
        return self.stride * len(self.points) + len(self.extra)

    @property
    def placed(self) -> bool:
        """Whether it is known where its nodes are."""
        return len(self.points) > 0 and not bool(np.isnan(self.points).any())

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return int(self.points.shape[1])

    def displacements(self, nodes: IntArray) -> IntArray:
        """Freedoms (s, d) in the structure of the displacements of nodes (s,)."""
        return self.offset + self.stride * nodes[:, None] + np.arange(self.dimension)

    def rotations_of(self, nodes: IntArray) -> IntArray:
        """Freedoms in the structure of all rotations that nodes (s,) have, of a beam one for each."""
        if self.beam is not None:
            return self.offset + self.stride * nodes + self.stride - 1
        if self.rotations is None:
            return np.zeros(0, dtype=np.int64)
        return self.offset + self.rotations[np.isin(self.rotations[:, 0], nodes), 1]

    @cached_property
    def freedom_names(self) -> tuple[str, ...]:
        """What all freedoms (size,) of the body are, in words."""
        return tuple(self.freedom_name(local) for local in range(self.size))

    def freedom_name(self, local: int) -> str:
        """What a freedom of the body is, in words."""
        node, direction = divmod(local, self.stride)
        if node >= len(self.points):
            return self.extra[local - self.stride * len(self.points)]
        if self.numbers is not None:
            node = int(self.numbers[node])
        return f"{self.name} node {node} {'rotation' if direction >= self.dimension else AXES[direction]}"


@dataclass(frozen=True)
class _Known:
    """A solid as it was built, and from what."""

    table: SolidBody
    meshed: tuple[object, ...]
    material: Material
    mesh: LoadedMesh
    built: BuiltBody


class KnownBodies:
    """Solids of cases that differ in a few numbers, by name, what ties them and how their surfaces are paired: what is
    the same in the next case is not built again."""

    def __init__(self) -> None:
        self._last: dict[str, _Known] = {}
        self._tied: tuple[Any, Any] | None = None
        self._paired: dict[str, tuple[Any, Any]] = {}

    def tied(self, of: Any, make: Callable[[], Any]) -> Any:
        """What ties follow from: the first made, where this case's are ``of`` the same."""
        if self._tied is None:
            self._tied = (of, make())
            return self._tied[1]
        return self._tied[1] if self._tied[0] == of else make()

    def paired(self, name: str, of: Any, make: Callable[[], Any]) -> Any:
        """The surfaces of a contact: the first made, where this case's follow from (``of``) the same."""
        if name not in self._paired:
            self._paired[name] = (of, make())
            return self._paired[name][1]
        return self._paired[name][1] if self._paired[name][0] == of else make()

    def mesh(self, name: str, body: SolidBody) -> LoadedMesh | None:
        """The mesh, if the first body of this name had it."""
        last = self._last.get(name)
        return last.mesh if last is not None and last.meshed == mesh_follows_from(body) else None

    def built(self, name: str, body: SolidBody, material: Material, mesh: LoadedMesh, offset: int) -> BuiltBody | None:
        """The body, if all of it is as it was."""
        last = self._last.get(name)
        if last is None or last.mesh is not mesh or (last.table, last.material) != (body, material):
            return None
        return last.built if last.built.offset == offset else None

    def keep(self, name: str, body: SolidBody, material: Material, mesh: LoadedMesh, built: BuiltBody) -> None:
        """The first of a name is known from now on: the others are varied from it and back."""
        self._last.setdefault(name, _Known(body, mesh_follows_from(body), material, mesh, built))


def build_bodies(case: Case, mu: float | None = None, known: KnownBodies | None = None) -> dict[str, BuiltBody]:
    """Every body that deforms or moves, in the order of the case; factors of imported matrices at ``mu``; what is
    ``known`` from like cases is taken from there.

    Raises CaseError for meshes and matrices that will not do.
    """
    refuse_too_many(case)
    bodies: dict[str, BuiltBody] = {}
    offset = 0
    for name, body in case.bodies.items():
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):  # told of below, as numbers out of range
            if isinstance(body, BeamBody):
                built = _beam(case, name, body, offset)
            elif isinstance(body, SolidBody):
                built = _solid(case, name, body, offset, known or KnownBodies())
            elif isinstance(body, MatrixBody):
                built = _imported(case, name, body, offset, mu)
            elif isinstance(body, MassBody):
                built = _mass(name, body, offset)
            else:
                continue
            _refuse_extreme(built)
        bodies[name] = built
        offset += built.size
    return bodies


def _beam(case: Case, name: str, body: BeamBody, offset: int) -> BuiltBody:
    material = case.materials[body.material]
    section = body.section
    element = BeamElement(
        length=body.length_m / body.elements,
        axial_stiffness=material.young_modulus * section.area,
        bending_stiffness=material.young_modulus * section.second_moment,
        line_density=material.density * section.area,
        direction=body.direction,
    )
    mesh = BeamMesh(start=body.start, elements=body.elements, element=element)
    mass, stiffness = assemble_beam(mesh, lumped=body.mass == "lumped")
    damping = body.damping.mass * mass + body.damping.stiffness * stiffness
    return BuiltBody(name, offset, DOF_PER_NODE, mesh.coordinates(), mass, damping, stiffness, beam=mesh)


def _solid(case: Case, name: str, body: SolidBody, offset: int, known: KnownBodies) -> BuiltBody:
    loaded: LoadedMesh = known.mesh(name, body) or load_mesh(name, body)
    if body.file is not None:
        refuse_too_many_read(f"bodies.{name}", body.file, loaded.mesh.points.size, offset)
    material = _material(case, name, body, loaded)
    if (before := known.built(name, body, material, loaded, offset)) is not None:
        return before
    matrices = assemble_solid(
        loaded.mesh, material, model=body.model, thickness=body.thickness, lumped=body.mass == "lumped"
    )
    damping = body.damping.mass * matrices.mass + body.damping.stiffness * matrices.stiffness
    built = BuiltBody(
        name,
        offset,
        body.dimension,
        loaded.mesh.points,
        matrices.mass,
        sp.csr_array(damping),
        matrices.stiffness,
        mesh=loaded.mesh,
        material=material,
    )
    known.keep(name, body, material, loaded, built)
    return built


def _material(case: Case, name: str, body: SolidBody, loaded: LoadedMesh) -> Material:
    if body.material is not None:
        return case.materials[body.material].law_object()
    where = f"bodies.{name}.material"
    material, reason = loaded.material
    if material is None:
        raise CaseError(where, None, f"missing – {reason}; give the NAME of a [materials.NAME]")
    if body.scale != 1.0:
        accepted = (
            f"missing – the file's material is in the units of the file, whose lengths are scaled by {body.scale:g}; "
            "give the NAME of a [materials.NAME] in SI units"
        )
        raise CaseError(where, None, accepted)
    return material


def _imported(case: Case, name: str, body: MatrixBody, offset: int, mu: float | None) -> BuiltBody:
    found = load_matrices(case, name, body, mu)
    refuse_too_many_read(f"bodies.{name}.terms.0", body.terms[0].file, found.mass.shape[0], offset)
    return BuiltBody(
        name,
        offset,
        body.dimension,
        found.points,
        found.mass,
        found.damping,
        found.stiffness,
        mesh=found.mesh,
        extra=found.extra,
        numbers=found.numbers,
        lacking=found.lacking,
        rotations=found.rotations,
    )


def _mass(name: str, body: MassBody, offset: int) -> BuiltBody:
    d = body.dimension
    empty = sp.csr_array((d, d))
    return BuiltBody(name, offset, d, np.array([body.position]), sp.csr_array(body.mass * np.eye(d)), empty, empty)


def _refuse_extreme(built: BuiltBody) -> None:
    """Raises CaseError for matrices whose products no double holds: lengths or moduli that are not meant."""
    mass, stiffness, damping = (
        float(np.abs(m.data).max(initial=0.0)) for m in (built.mass, built.stiffness, built.damping)
    )
    imported = built.lacking is not None
    least = float(np.abs(built.mass.data).max(initial=0.0) if imported else built.mass.diagonal().min())
    sound = least > _LEAST and mass < _MOST and damping < _MOST
    if built.stiffness.nnz:
        sound = sound and _LEAST < stiffness < _MOST
    if not sound:
        accepted = (
            f"its mass, stiffness or damping has entries outside {_LEAST:g} … {_MOST:g}, beyond what can be computed "
            f"with; check {'its matrices' if imported else 'the units of its lengths, its material and its damping'}"
        )
        raise CaseError(f"bodies.{built.name}", None, accepted)
