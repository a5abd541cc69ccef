"""What must hold within a body and between bodies: one definite shape, one dimension."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping

from ..errors import Problem
from .bodies import (
    AnnulusMesh,
    AnyBody,
    BeamBody,
    BuiltInMesh,
    DiscMesh,
    MatrixBody,
    ObstacleBody,
    PadMesh,
    SlidingTable,
    SolidBody,
)
from .fields import is_zero
from .points import FULL_TURN, boundary_names

_EDGES = {
    "rectangle": (2, "along x, along y"),
    "quadrilateral": (2, "along bottom and top, along left and right"),
    "annulus": (2, "radial, circumferential"),
    "block": (3, "along x, along y, along z"),
    "disc": (3, "radial, circumferential, axial"),
    "pad": (3, "radial, circumferential, axial"),
}


def shape_problems(bodies: Mapping[str, AnyBody]) -> Iterator[Problem]:
    """Bodies without one definite shape."""
    for name, body in bodies.items():
        where = f"bodies.{name}"
        if isinstance(body, BeamBody):
            yield from _beam_shape(where, body)
        elif isinstance(body, SolidBody):
            yield from _solid_shape(where, body)
        elif isinstance(body, ObstacleBody):
            yield from _obstacle_shape(where, body)


def body_problems(bodies: Mapping[str, AnyBody], *, whole: bool = True) -> Iterator[Problem]:
    """Points off their bodies, vectors of the wrong length, bodies in the plane beside bodies in space.

    whole: whether these are all bodies of the case; where others are broken nothing is said of what lacks.
    """
    for name, body in bodies.items():
        where = f"bodies.{name}"
        if isinstance(body, BeamBody):
            yield from _beam_points(name, body)
        for key, vector in _vectors(body):
            if len(vector) != body.dimension:
                yield Problem(f"{where}.{key}", vector, f"must have {body.dimension} numbers, one for each direction")
        sliding = getattr(body, "sliding", None)
        if sliding is not None:
            yield from _sliding_problems(f"{where}.sliding", sliding, body.dimension)
        if isinstance(body, SolidBody):
            yield from _hidden_boundaries(where, body)
    if whole and bodies and all(isinstance(body, ObstacleBody) for body in bodies.values()):
        yield Problem("bodies", None, "only obstacles, which are rigid; a case needs a beam, a solid or a mass as well")
    plane = [name for name, body in bodies.items() if body.dimension == 2]
    space = [name for name, body in bodies.items() if body.dimension == 3]
    if plane and space:
        accepted = (
            f"bodies in the plane ({', '.join(plane)}) and in space ({', '.join(space)}) cannot meet in one case; "
            "model all of them in 2 or all in 3 dimensions"
        )
        yield Problem("bodies", None, accepted)


def _hidden_boundaries(where: str, body: SolidBody) -> Iterator[Problem]:
    """Points under the name of a boundary: a reference to it would take one node for the whole side."""
    for name in boundary_names(body):
        if name in body.points:
            yield Problem(f"{where}.points.{name}", body.points[name], "a boundary has this name; choose another name")


def _sliding_problems(where: str, sliding: SlidingTable, dimension: int) -> Iterator[Problem]:
    if sliding.velocity is None and "spin" not in sliding.model_fields_set:
        given = ", ".join(sliding.model_fields_set)
        accepted = f"must have velocity = [x, y] [m/s] or spin [rad/s]{f', not only {given}' if given else ''}"
        yield Problem(where, None, accepted)
    if is_zero(sliding.axis):
        yield Problem(f"{where}.axis", sliding.axis, "must not be zero")
    elif dimension == 2 and (any(sliding.axis[:2]) or sliding.axis[2] < 0):
        accepted = "in the plane the axis is z; leave it out, and give a negative spin to turn clockwise"
        yield Problem(f"{where}.axis", sliding.axis, accepted)


def _vectors(body: AnyBody) -> Iterator[tuple[str, tuple[float, ...]]]:
    for key in ("initial_velocity", "initial_displacement", "translation", "normal"):
        if (vector := getattr(body, key, None)) is not None:
            yield key, vector
    if isinstance(body, SolidBody | MatrixBody):
        for point, position in body.points.items():
            if not isinstance(position, int):
                yield f"points.{point}", position
    sliding = getattr(body, "sliding", None)
    if sliding is not None:
        for key in ("velocity", "centre"):
            if (vector := getattr(sliding, key)) is not None:
                yield f"sliding.{key}", vector


def _beam_shape(where: str, body: BeamBody) -> Iterator[Problem]:
    """Beams without one definite axis."""
    if body.end is not None:
        for key in ("angle_deg", "length"):
            if (given := getattr(body, key)) is not None:
                yield Problem(f"{where}.{key}", given, "not used with end; give end, or angle_deg and length")
        if math.dist(body.start, body.end) == 0.0:
            yield Problem(f"{where}.end", body.end, "must not be the start")
        return
    if body.angle_deg is None and body.length is None:
        accepted = "has no direction – give angle_deg [degrees] and length [m], or end = [x, y] [m]"
        yield Problem(where, None, accepted)
        return
    for key, unit in (("angle_deg", "degrees"), ("length", "m")):
        if getattr(body, key) is None:
            accepted = f"missing – give a number [{unit}], or only end = [x, y] [m]"
            yield Problem(f"{where}.{key}", None, accepted)


def _beam_points(name: str, body: BeamBody) -> Iterator[Problem]:
    for point, distance in body.points.items():
        where = f"bodies.{name}.points.{point}"
        if point in ("start", "end"):
            yield Problem(where, distance, "start and end always exist; choose another name")
        elif distance > body.length_m:
            yield Problem(where, distance, f"beyond the body; {name} reaches from 0 to {body.length_m:.9g} m")


def _solid_shape(where: str, body: SolidBody) -> Iterator[Problem]:
    if (body.mesh is None) == (body.file is None):
        both = "" if body.mesh is None else ", not both"
        yield Problem(where, None, f'must have either mesh = {{ shape = …, … }} or file = "….msh"{both}')
        return
    if body.mesh is None:
        return
    for key in ("group", "translation"):
        if (value := getattr(body, key)) is not None:
            yield Problem(f"{where}.{key}", value, "only used with file")
    if body.scale != 1.0:
        yield Problem(f"{where}.scale", body.scale, "only used with file; built-in meshes are in metres")
    flat = body.mesh.cells in ("triangle", "triangle6", "quad", "quad8", "quad9")
    if flat != (body.dimension == 2):
        kind = "lies in the plane" if flat else "lies in space"
        yield Problem(f"{where}.model", body.model, f"the mesh {kind}; take " + (
            '"plane stress" or "plane strain"' if flat else '"3d"'
        ))
    yield from _mesh_problems(f"{where}.mesh", body.mesh)


def _mesh_problems(where: str, mesh: BuiltInMesh) -> Iterator[Problem]:
    if (mesh.divisions is None) == (mesh.element_size is None):
        given = None if mesh.divisions is None else mesh.divisions
        yield Problem(f"{where}.divisions", given, "give either divisions or element_size [m]")
    elif mesh.divisions is not None and len(mesh.divisions) != _EDGES[mesh.shape][0]:
        count, names = _EDGES[mesh.shape]
        yield Problem(f"{where}.divisions", mesh.divisions, f"must have {count} numbers: {names}")
    elif mesh.grading is not None:
        yield from _grading_problems(where, mesh.grading, mesh.divisions, _EDGES[mesh.shape][1])
    if isinstance(mesh, AnnulusMesh | DiscMesh | PadMesh) and mesh.inner_radius >= mesh.outer_radius:
        yield Problem(f"{where}.inner_radius", mesh.inner_radius, f"must be below outer_radius, {mesh.outer_radius:g}")
    if isinstance(mesh, AnnulusMesh) and mesh.sweep_deg > 360.0:
        yield Problem(f"{where}.sweep_deg", mesh.sweep_deg, "must be at most 360")
    if isinstance(mesh, AnnulusMesh) and mesh.inner_radius == 0 and mesh.sweep_deg < FULL_TURN:
        yield Problem(f"{where}.inner_radius", 0.0, "must be > 0 in a sector; only a full disc has no hole")
    if isinstance(mesh, PadMesh) and mesh.sweep_deg >= FULL_TURN:
        yield Problem(f"{where}.sweep_deg", mesh.sweep_deg, 'must be below 360; a full turn is shape = "disc"')


def _grading_problems(
    where: str,
    grading: tuple[float | tuple[float, ...], ...],
    divisions: tuple[int, ...] | None,
    names: str,
) -> Iterator[Problem]:
    """Gradings that do not go with their divisions; ratios are judged as the mesh is made."""
    if divisions is None:
        yield Problem(f"{where}.grading", grading, "goes with divisions, not with element_size")
    elif len(grading) != len(divisions):
        yield Problem(f"{where}.grading", grading, f"must have {len(divisions)} entries: {names}")
    else:
        for k, (entry, count) in enumerate(zip(grading, divisions, strict=True)):
            if not isinstance(entry, tuple):
                continue
            rising = all(a < b for a, b in itertools.pairwise(entry))
            if len(entry) != count + 1 or not rising or entry[0] != 0.0 or entry[-1] != 1.0:
                accepted = f"must be {count + 1} numbers that rise from 0 to 1, the ends of {count} elements"
                yield Problem(f"{where}.grading.{k}", entry, accepted)


def _obstacle_shape(where: str, body: ObstacleBody) -> Iterator[Problem]:
    if body.shape == "flat":
        if body.normal is None:
            yield Problem(f"{where}.normal", None, "missing – give [x, y] or [x, y, z], from the flat to the bodies")
        elif is_zero(body.normal):
            yield Problem(f"{where}.normal", body.normal, "must not be zero")
        for key in ("radius", "axis", "inside"):
            if value := getattr(body, key):
                yield Problem(f"{where}.{key}", value, 'not used by "flat"')
        return
    if body.radius is None:
        yield Problem(f"{where}.radius", None, "missing – give a number > 0 [m], the radius of the cylinder")
    if body.normal is not None:
        yield Problem(f"{where}.normal", body.normal, 'not used by "cylinder"')
    if body.dimension == 3 and (body.axis is None or is_zero(body.axis)):
        yield Problem(f"{where}.axis", body.axis, "missing – give [x, y, z], the axis of the cylinder, not zero")
    if body.dimension == 2 and body.axis is not None:
        yield Problem(f"{where}.axis", body.axis, "not used in the plane")
