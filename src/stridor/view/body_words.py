"""Bodies and contacts of a case in words."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import numpy as np

from ..case import Case
from ..case.bodies import (
    AnnulusMesh,
    AnyBody,
    BeamBody,
    BlockMesh,
    DiscMesh,
    MassBody,
    MatrixBody,
    ObstacleBody,
    PadMesh,
    RectangleMesh,
    SlidingTable,
    SolidBody,
)
from ..case.schema import Contact
from .tables import Table, TableRow, significant
from .units import length_unit, modulus_unit


def body_words(case: Case, name: str, body: AnyBody) -> str:
    """One sentence about a body."""
    if isinstance(body, MassBody):
        return f"{name}: a point mass of {body.mass:g} kg."
    if isinstance(body, ObstacleBody):
        return f"{name}: a rigid {body.shape}{_sliding_words(body.sliding)}."
    if isinstance(body, SolidBody):
        source = f"the mesh file {Path(body.file).name}" if body.file else _a(body.mesh.shape) if body.mesh else ""
        made = "" if body.material is None else f", {_material_words(case, body.material)}"
        return f"{name}: a solid ({body.model}), {source}{made}, {body.mass} mass{_sliding_words(body.sliding)}."
    if isinstance(body, MatrixBody):
        files = ", ".join(dict.fromkeys(Path(term.file).name for term in body.terms))
        return f"{name}: matrices of another program ({files}){_sliding_words(body.sliding)}."
    x, y = body.direction
    unit, its_name = length_unit(body.length_m)
    sizes = " × ".join(f"{size / unit:g}" for size in (body.length_m, body.width, body.thickness))
    return (
        f"{name}: a beam of {_material_words(case, body.material)}, {sizes} {its_name}, from "
        f"({body.start[0] / unit:g}, {body.start[1] / unit:g}) {its_name} at "
        f"{np.degrees(np.arctan2(y, x)):.4g}° to the x axis; {body.elements} elements, {body.mass} mass."
    )


def _a(shape: str) -> str:
    return f"{'an' if shape[0] in 'aeiou' else 'a'} {shape}"


def _material_words(case: Case, name: str) -> str:
    material = case.materials[name]
    unit, its_name = modulus_unit(material.young_modulus)
    return f"{material.young_modulus / unit:g} {its_name} and {material.density:g} kg/m³"


def _sliding_words(sliding: SlidingTable | None) -> str:
    if sliding is None:
        return ""
    parts = [] if sliding.velocity is None else [f"at ({', '.join(f'{v:g}' for v in sliding.velocity)}) m/s"]
    parts += [f"turning at {sliding.spin:g} rad/s"] if sliding.spin else []
    return ", whose material slides through it " + " and ".join(parts or ["not"])


def contact_words(name: str, contact: Contact, *, area: bool | None, timed: bool = True) -> str:
    """One sentence about a contact; area: whether its stiffness is one per area or that of a point, None: either;
    timed: whether the time loop has its stiffness as well."""
    friction = contact.friction.model_dump(exclude_none=True)
    law = friction.pop("law")
    settings = ", ".join(f"{key.replace('_', ' ')} {_setting(value)}" for key, value in friction.items())
    unit = {True: "N/m³", False: "N/m", None: "N/m (of a point) or N/m³ (per area)"}[area]
    where = "" if timed or contact.stiffness == "rigid" else " in the modal approach"
    stiffness = "rigid" if contact.stiffness == "rigid" else (
        f"with a stiffness of {significant(contact.stiffness)} {unit}"
    )
    if contact.cubic:
        cube = {True: "N/m⁵", False: "N/m³", None: "N/m³ (of a point) or N/m⁵ (per area)"}[area]
        stiffness += f" and {significant(contact.cubic)} {cube} times the cube of the approach"
    stiffness += ", kept closed" if contact.closed else ""
    return (
        f"{name}: {contact.slave} slides on {contact.master} ({contact.sliding} sliding), {stiffness}{where}; "
        f"friction law {law}, {settings}."
    )


def _setting(value: object) -> str:
    """A number or a word as it is, a list of numbers by its ends."""
    if isinstance(value, tuple):
        numbers = cast("tuple[float, ...]", value)
        shown = numbers if len(numbers) <= 4 else (*numbers[:2], "…", numbers[-1])
        return ", ".join(n if isinstance(n, str) else f"{n:g}" for n in shown)
    return f"{value:g}" if isinstance(value, float) else str(value)


def bodies_table(case: Case) -> Table:
    """What the bodies are made of, one column each."""
    bodies = list(case.bodies.items())
    lines = (
        ("type", [body.type for _, body in bodies]),
        ("size [m]", [_size(body) for _, body in bodies]),
        ("Young's modulus [GPa]", [_of_material(case, body, "young_modulus", 1e-9) for _, body in bodies]),
        ("density [kg/m³]", [_of_material(case, body, "density", 1.0) for _, body in bodies]),
        ("damping α₁ (mass) [1/s]", [_damping(body, "mass") for _, body in bodies]),
        ("damping α₂ (stiffness) [s]", [_damping(body, "stiffness") for _, body in bodies]),
        ("elements", [str(body.elements) if isinstance(body, BeamBody) else "" for _, body in bodies]),
        ("mass matrix", [f"{b.mass:g} kg" if isinstance(b, MassBody) else getattr(b, "mass", "") for _, b in bodies]),
    )
    rows = tuple(TableRow((name, *values)) for name, values in lines if any(values))
    return Table("bodies", "Bodies", ("", *(name for name, _ in bodies)), rows, frozenset({0}))


def _size(body: AnyBody) -> str:
    if isinstance(body, BeamBody):
        return f"{body.length_m:g} × {body.width:g} × {body.thickness:g}"
    if isinstance(body, SolidBody) and body.mesh is not None:
        mesh = body.mesh
        if isinstance(mesh, RectangleMesh | BlockMesh):
            return " × ".join(f"{edge:g}" for edge in mesh.size)
        if isinstance(mesh, AnnulusMesh | DiscMesh | PadMesh):
            return f"r {mesh.inner_radius:g} … {mesh.outer_radius:g}"
    return ""


def _of_material(case: Case, body: AnyBody, name: str, factor: float) -> str:
    material = getattr(body, "material", None)
    return "" if material is None else f"{getattr(case.materials[material], name) * factor:g}"


def _damping(body: AnyBody, name: str) -> str:
    damping = getattr(body, "damping", None)
    return "" if damping is None else significant(getattr(damping, name))
