"""The mesh of a solid body: built in, or from a file, checked before it is computed with."""

from __future__ import annotations

import os
from collections import OrderedDict
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from ..case.bodies import (
    AnnulusMesh,
    BlockMesh,
    BuiltInMesh,
    PadMesh,
    QuadrilateralMesh,
    RectangleMesh,
    SolidBody,
)
from ..case.points import FULL_TURN
from ..errors import CaseError
from ..laws import Material
from ..mesh import shapes
from ..mesh.abaqus import AbaqusModel, read_abaqus
from ..mesh.files import read_mesh
from ..mesh.model import Mesh
from ..mesh.paths import shown_path
from ..mesh.quality import check_mesh

# Products of lengths, moduli and densities stay numbers between these [m].
_LEAST_EXTENT, _MOST_EXTENT = 1e-20, 1e20
_FARTHEST = 1e8  # from the origin, over the extent: half of the digits of a place are left for shape and strain


@dataclass(frozen=True)
class LoadedMesh:
    """A mesh, and the material that its file gave, in the units of the file, or why it gave none."""

    mesh: Mesh
    material: tuple[Material | None, str] = (None, "")


@lru_cache(maxsize=8)
def _read(path: str, scale: float, group: str | None, where: str, stamp: tuple[int, int]) -> LoadedMesh:
    del stamp  # only there so that a changed file is read again
    if not path.lower().endswith(".inp"):
        return LoadedMesh(read_mesh(path, scale=scale, group=group, where=where))
    model = read_abaqus(path, scale=scale, group=group, where=where)
    return LoadedMesh(model.mesh, _material_of(model, group))


def _material_of(model: AbaqusModel, group: str | None) -> tuple[Material | None, str]:
    """The one material of a body from an Abaqus file, or why there is none."""
    own = [section for section in model.sections if group is not None and section.elset.upper() == group.upper()]
    names = list(dict.fromkeys(section.material for section in own or model.sections))
    if not names:
        return None, "the file has no *SOLID SECTION for it"
    if len(names) > 1:
        return None, f"the file gives it several materials ({', '.join(names)}); read each as its own body by group"
    if names[0] in model.materials:
        return model.materials[names[0]], ""
    return None, model.incomplete.get(names[0], f"the file has no *MATERIAL {names[0]}")


_KNOWN: OrderedDict[tuple[str, str, str, tuple[int, int]], LoadedMesh] = OrderedDict()
_KEPT = 4  # meshes: what checks, builds and warns of a case asks for each body's three times
_HELD = Lock()


def load_mesh(name: str, body: SolidBody) -> LoadedMesh:
    """Mesh of a body, the same one as long as neither it nor its file changes. Raises CaseError where a file, a group
    or an element will not do."""
    key = (name, body.model_dump_json(), os.getcwd(), _stamp(body))  # paths may start at the working directory
    with _HELD:
        found = _KNOWN.get(key)
        if found is not None:
            _KNOWN.move_to_end(key)
            return found
    found = _loaded(name, body)
    with _HELD:
        _KNOWN[key] = found
        while len(_KNOWN) > _KEPT:
            _KNOWN.popitem(last=False)
    return found


def _loaded(name: str, body: SolidBody) -> LoadedMesh:
    where = f"bodies.{name}"
    if body.mesh is not None:
        loaded = LoadedMesh(built_in(body.mesh, f"{where}.mesh"))
    else:
        assert body.file is not None, "checked: a solid has a mesh or a file"
        loaded = _from_file(where, body)
    if loaded.mesh.dimension != body.dimension:
        raise CaseError(
            f"{where}.model",
            body.model,
            f"the mesh has {loaded.mesh.dimension} dimensions; take "
            + ('"3d"' if loaded.mesh.dimension == 3 else '"plane stress" or "plane strain"'),
        )
    _refuse_absurd(loaded.mesh, where, body)
    check_mesh(loaded.mesh, where)
    return loaded


def mesh_follows_from(body: SolidBody) -> tuple[object, ...]:
    """All that the mesh of a body depends on, to compare with that of a like body: its tables, and of a file when it
    was written."""
    return body.mesh, body.file, body.group, body.scale, body.translation, body.points, body.model, _stamp(body)


def _stamp(body: SolidBody) -> tuple[int, int]:
    """When the file of a body's mesh was written, and its size: one that changed is read again."""
    try:
        status = Path(body.file).stat() if body.file else None
    except OSError:
        status = None
    return (0, 0) if status is None else (status.st_mtime_ns, status.st_size)


def _refuse_absurd(mesh: Mesh, where: str, body: SolidBody) -> None:
    """Lengths whose cubes no double holds, places beyond rounding, and points that hide a boundary of the file."""
    extent = float(np.ptp(mesh.points, axis=0).max(initial=0.0))
    if len(mesh.points) and not _LEAST_EXTENT < extent < _MOST_EXTENT:
        accepted = f"{extent:.3g} m in extent; must be between {_LEAST_EXTENT:g} and {_MOST_EXTENT:g} m"
        if body.file is not None:
            raise CaseError(f"{where}.file", shown_path(Path(body.file)), accepted)
        raise CaseError(f"{where}.mesh", None, accepted)
    distance = float(np.abs(mesh.points).max(initial=0.0))
    if distance > _FARTHEST * extent:
        accepted = (
            f"lies {distance:.3g} m from the origin, with an extent of {extent:.3g} m: rounding would bend it; move "
            "the bodies of the case nearer to the origin"
        )
        raise CaseError(where, None, accepted)
    for point in body.points:
        if point in mesh.boundaries:
            accepted = f"{mesh.source} has a boundary of this name; choose another name"
            raise CaseError(f"{where}.points.{point}", body.points[point], accepted)


def _from_file(where: str, body: SolidBody) -> LoadedMesh:
    assert body.file is not None
    loaded = _read(str(Path(body.file)), body.scale, body.group, where, _stamp(body))
    if body.translation is not None and len(body.translation) == loaded.mesh.dimension:
        loaded = replace(loaded, mesh=replace(loaded.mesh, points=loaded.mesh.points + np.array(body.translation)))
    return loaded


def built_in(mesh: BuiltInMesh, where: str) -> Mesh:
    """The mesh that a [bodies.NAME] mesh = { shape = … } describes. Raises CaseError below ``where``."""
    common: dict[str, Any] = {
        "element_size": mesh.element_size,
        "grading": mesh.grading,
        "kind": mesh.cells,
        "where": where,
    }
    if isinstance(mesh, RectangleMesh):
        return shapes.rectangle(mesh.corner, mesh.size, mesh.divisions, angle_deg=mesh.angle_deg, **common)
    if isinstance(mesh, QuadrilateralMesh):
        return shapes.quadrilateral(mesh.corners, mesh.divisions, **common)
    if isinstance(mesh, AnnulusMesh):
        return shapes.annulus(
            mesh.centre,
            mesh.inner_radius,
            mesh.outer_radius,
            mesh.divisions,
            start_deg=mesh.start_deg,
            sweep_deg=360.0 if mesh.sweep_deg >= FULL_TURN else mesh.sweep_deg,
            **common,
        )
    if isinstance(mesh, BlockMesh):
        return shapes.block(mesh.corner, mesh.size, mesh.divisions, **common)
    radii = (mesh.centre, mesh.inner_radius, mesh.outer_radius)
    if isinstance(mesh, PadMesh):
        return shapes.pad(*radii, mesh.start_deg, mesh.sweep_deg, mesh.thickness, mesh.divisions, **common)
    return shapes.disc(*radii, mesh.thickness, mesh.divisions, **common)
