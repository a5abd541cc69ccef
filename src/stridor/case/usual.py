"""Usual sizes of the numbers of a case: what lies outside is probably a slip of units or of a digit.

The ranges hold what machines, their materials and benches of a laboratory have, with a margin on both sides: from
foam to diamond, from a tenth of a millimetre to ten metres. They are wide on purpose, since a warning that comes
without need is soon read by nobody. `USUAL` names each number of the schema by table and key; those that have no size
of their own (whole numbers, directions, factors, published values) are in `WITHOUT`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

from pydantic import BaseModel

from .messages import dotted


@dataclass(frozen=True)
class Usual:
    """A quantity in its unit, the least and the most of its size that are usual, and other units that it is often
    written in by mistake, each with what one of it is in the right one. scaled: False for numbers without a unit of
    length, mass or time, which mean the same in any system of units. typical: where several of the other units would
    do, the one that comes nearest to it is named.
    """

    quantity: str
    unit: str
    least: float
    most: float
    slips: Mapping[str, float]
    scaled: bool = True
    typical: float = 1.0

    def oddity(self, where: str, value: float) -> str:
        """What is odd about a value, "" where nothing is. Zero, which says "none", is never odd."""
        size = abs(value)
        if size == 0.0 or self.least <= size <= self.most:
            return ""
        unit = f" {self.unit}" if self.unit else ""
        low = f"{self.least:g} to " if self.least > 0.0 else "at most "
        text = f"{where}: {value:.6g}{unit} is unusual for {self.quantity}, usually {low}{self.most:g}{unit}"
        meant = {unit: one for unit, one in self.slips.items() if self.least <= size * one <= self.most}
        if not meant:
            return f"{text}; check its unit and its digits"
        other = min(meant, key=lambda unit: abs(math.log(size * meant[unit] / self.typical)))
        return f"{text}; if {value:.6g} {other} is meant, write {value * meant[other]:.6g}"


def _usual(quantity: str, unit: str, least: float, most: float, *, typical: float = 0.0, **slips: float) -> Usual:
    named = {_UNITS.get(name, name): one for name, one in slips.items()}
    middle = math.sqrt(max(least, 1e-6 * most) * most)
    return Usual(quantity, unit, least, most, named, unit not in ("", "degrees"), typical or middle)


_UNITS = {
    "g_cm3": "g/cm³", "t_mm3": "t/mm³", "kg_mm3": "kg/mm³", "mm_s": "mm/s", "km_h": "km/h", "rpm": "turns a minute",
    "N_mm": "N/mm", "N_mm3": "N/mm³", "Ns_mm": "N s/mm",
    "mm_s2": "mm/s²", "s_mm": "s/mm", "um": "µm", "us": "µs", "percent": "%",
}  # fmt: skip

LENGTH = _usual("a length", "m", 1e-4, 10.0, typical=0.1, mm=1e-3, um=1e-6)
_THICKNESS = _usual("a thickness", "m", 1e-5, 2.0, typical=0.1, mm=1e-3, um=1e-6)
_RADIUS = _usual("a radius", "m", 1e-4, 10.0, typical=0.1, mm=1e-3)
# A cylinder may stand for a nearly flat or a nearly pointed surface.
_CURVATURE = _usual("a radius", "m", 1e-6, 1e4, typical=0.1, mm=1e-3)
_PLACE = _usual("a coordinate", "m", 0.0, 100.0, mm=1e-3)
_MISFIT = _usual("a misfit of meshes", "m", 0.0, 0.01, mm=1e-3, um=1e-6)
_SPEED = _usual("a velocity", "m/s", 1e-9, 1e3, mm_s=1e-3, km_h=1 / 3.6)
_TURN = _usual("a speed of turning", "rad/s", 1e-6, 1e4, rpm=math.pi / 30)
_FORCE = _usual("a force", "N", 1e-6, 1e8)
_DAMPER = _usual("a dashpot", "N s/m", 1e-9, 1e8)
_MU = _usual("a friction coefficient", "", 0.0, 2.0, percent=1e-2)
_RANGE_OF_MU = _usual("a friction coefficient", "", 0.0, 10.0, percent=1e-2)
_TIME = _usual("a duration", "s", 1e-7, 1e3, ms=1e-3, us=1e-6)
_FACTOR = _usual("a factor", "", 0.0, 1e3)
_ANGLE = _usual("an angle", "degrees", 0.0, 360.0)
_SWEEP = _usual("a sector", "degrees", 1.0, 360.0, rad=180 / math.pi)
_MODULUS = _usual("Young's modulus", "Pa", 1e6, 1.3e12, typical=1e11, MPa=1e6, GPa=1e9, kPa=1e3)
_STIFFNESS = _usual("a stiffness", "N/m", 1e-3, 1e13, N_mm=1e3)
_CONTACT = _usual("a contact stiffness", "N/m", 1.0, 1e14, N_mm=1e3)
_CONTACT_AREA = _usual("a contact stiffness per area", "N/m³", 1e4, 1e18, N_mm3=1e9)

USUAL: Mapping[str, Usual] = {
    "MaterialTable.young_modulus": _MODULUS,
    "MaterialTable.density": _usual("a density", "kg/m³", 10.0, 2.5e4, typical=5e3, g_cm3=1e3, t_mm3=1e12, kg_mm3=1e9),
    "Support.velocity": _SPEED,
    "Support.displacement": _usual("a displacement", "m", 0.0, 0.1, mm=1e-3, um=1e-6),
    "Contact.interference": _MISFIT,
    "Phase.displacements": _FACTOR,
    "Load.force": _FORCE,
    "Load.moment": _usual("a moment", "N m", 1e-9, 1e7),
    "Load.pressure": _usual("a pressure", "Pa", 1.0, 1e10, MPa=1e6, bar=1e5, kPa=1e3),
    "Load.gravity": _usual("an acceleration", "m/s²", 1e-2, 1e4, typical=9.81, mm_s2=1e-3, g=9.80665),
    "CentrifugalTable.speed": _TURN,
    "CentrifugalTable.centre": _PLACE,
    "CoulombTable.coefficient": _MU,
    "StaticKineticTable.coefficient": _MU,
    "StaticKineticTable.static_coefficient": _MU,
    "WeakeningTable.coefficient": _MU,
    "WeakeningTable.static_coefficient": _MU,
    "HyperbolicTable.coefficient": _MU,
    "HyperbolicTable.static_coefficient": _MU,
    "HyperbolicTable.delta": _usual("a fall of friction with speed", "s/m", 1e-2, 1e6, s_mm=1e3),
    "TabulatedTable.speeds": _SPEED,
    "TabulatedTable.coefficients": _MU,
    "TabulatedTable.static_coefficient": _MU,
    "WeakeningTable.decay_speed": _usual("a speed over which friction weakens", "m/s", 1e-6, 100.0, mm_s=1e-3),
    "Contact.adjust": _MISFIT,
    "Contact.stiffness": _CONTACT,
    "Contact.cubic": _usual("a cubic contact stiffness", "N/m³ or N/m⁵", 1e-3, 1e30),
    "Tie.tolerance": _MISFIT,
    "Tie.translation": _PLACE,
    "Rotation.angle_deg": _ANGLE,
    "Rotation.centre": _PLACE,
    "Spring.stiffness": _STIFFNESS,
    "Spring.cubic": _usual("a cubic stiffness", "N/m³", 1e-3, 1e25),
    "Spring.damping": _DAMPER,
    "Dashpot.damping": _DAMPER,
    "Phase.duration": _TIME,
    "Phase.ramp": _TIME,
    "Phase.loads": _FACTOR,
    "Phase.velocities": _FACTOR,
    "SteadyStep.loads": _FACTOR,
    "SteadyStep.velocities": _FACTOR,
    "SteadyStep.duration": _TIME,
    "Modal.friction_range": _RANGE_OF_MU,
    "Modal.max_frequency_hz": _usual("a highest frequency", "Hz", 10.0, 1e7, kHz=1e3),
    "Temporal.step": _usual("a time step", "s", 1e-12, 1e-2, us=1e-6, ns=1e-9),
    "Temporal.cutoff_hz": _usual("a cut-off frequency", "Hz", 10.0, 1e9, kHz=1e3),
    "Temporal.perturbation": _usual("an extra slip speed", "m/s", 1e-15, 10.0, mm_s=1e-3),
    "Comparison.mu": _RANGE_OF_MU,
    "Comparison.bracket": _RANGE_OF_MU,
    "Comparison.tolerance": _usual("a tolerance of a friction coefficient", "", 1e-9, 0.1),
    "BeamBody.start": _PLACE,
    "BeamBody.end": _PLACE,
    "BeamBody.angle_deg": _ANGLE,
    "BeamBody.length": LENGTH,
    "BeamBody.width": _usual("a width", "m", 1e-5, 2.0, typical=0.1, mm=1e-3, um=1e-6),
    "BeamBody.thickness": _THICKNESS,
    "MeshTable.element_size": _usual("an element size", "m", 1e-6, 2.0, mm=1e-3, um=1e-6),
    "RectangleMesh.corner": _PLACE,
    "RectangleMesh.size": LENGTH,
    "RectangleMesh.angle_deg": _ANGLE,
    "QuadrilateralMesh.corners": _PLACE,
    "AnnulusMesh.centre": _PLACE,
    "AnnulusMesh.inner_radius": _RADIUS,
    "AnnulusMesh.outer_radius": _RADIUS,
    "AnnulusMesh.start_deg": _ANGLE,
    "AnnulusMesh.sweep_deg": _SWEEP,
    "BlockMesh.corner": _PLACE,
    "BlockMesh.size": LENGTH,
    "DiscMesh.centre": _PLACE,
    "DiscMesh.inner_radius": _RADIUS,
    "DiscMesh.outer_radius": _RADIUS,
    "DiscMesh.thickness": _THICKNESS,
    "PadMesh.centre": _PLACE,
    "PadMesh.inner_radius": _RADIUS,
    "PadMesh.outer_radius": _RADIUS,
    "PadMesh.start_deg": _ANGLE,
    "PadMesh.sweep_deg": _SWEEP,
    "PadMesh.thickness": _THICKNESS,
    "SlidingTable.velocity": _SPEED,
    "SlidingTable.spin": _TURN,
    "SlidingTable.centre": _PLACE,
    "SolidBody.thickness": _THICKNESS,
    "SolidBody.scale": _usual("a unit of length", "m", 1e-9, 1.0),
    "SolidBody.translation": _PLACE,
    "SolidBody.initial_velocity": _SPEED,
    "SolidBody.initial_displacement": _usual("a displacement", "m", 0.0, 1.0, mm=1e-3, um=1e-6),
    "SolidBody.points": _PLACE,
    "BeamBody.points": _PLACE,
    "MatrixBody.thickness": _THICKNESS,
    "MatrixBody.scale": _usual("a unit of length", "m", 1e-9, 1.0),
    "MatrixBody.translation": _PLACE,
    "MatrixBody.points": _PLACE,
    "MassBody.mass": _usual("a mass", "kg", 1e-6, 1e5, t=1e3, g=1e-3),
    "MassBody.position": _PLACE,
    "MassBody.initial_velocity": _SPEED,
    "MassBody.initial_displacement": _usual("a displacement", "m", 0.0, 1.0, mm=1e-3, um=1e-6),
    "ObstacleBody.point": _PLACE,
    "ObstacleBody.radius": _CURVATURE,
}
"""Usual sizes by table and key of the schema; keys that tables have in common by the table that brings them in."""

# Whole numbers, directions, factors and values of the user's choice, and what is published elsewhere. Poisson's ratio
# counts with the elements, Rayleigh's factors with the frequencies: see `oddities`.
WITHOUT = frozenset({
    "MaterialTable.poisson_ratio", "DampingTable.mass", "DampingTable.stiffness", "Parameter.value", "Parameter.range",
    "Spring.direction", "Dashpot.direction", "Rotation.axis", "Modal.modes", "Modal.sweep_points", "Temporal.beta2",
    "Temporal.record_every", "BeamBody.elements", "MeshTable.divisions", "MeshTable.grading", "SlidingTable.axis",
    "CentrifugalTable.axis", "ObstacleBody.normal", "ObstacleBody.axis", "MatrixTerm.factor", "MatrixBody.dimension",
    "ReferenceFrequency.frequency_hz", "ReferenceOnset.frequency_hz", "ReferenceOnset.mu", "ReferenceValue.value",
})  # fmt: skip

_ROTATION = "rotation"  # the one velocity of a support that is not in m/s


def usual_of(table: type[BaseModel], key: str) -> Usual | None:
    """The usual size of a number of a table, sought in the tables that it extends as well."""
    return next((USUAL[name] for base in table.__mro__ if (name := f"{base.__name__}.{key}") in USUAL), None)


def is_place(case: BaseModel, path: Sequence[str]) -> bool:
    """Whether the number at a path is a coordinate: what it is counted from has no effect on the model."""
    return _usual_along(case, path) is _PLACE


def is_of_shape(case: BaseModel, path: Sequence[str]) -> bool:
    """Whether the number at a path is a length or an angle, by which nodes lie elsewhere."""
    found = _usual_along(case, path)
    return found is not None and found.unit in ("m", "degrees")


def _usual_along(case: BaseModel, path: Sequence[str]) -> Usual | None:
    """The usual size of the number at a path; None where nothing is known of it."""
    node: object = case
    found: Usual | None = None
    for key in path:
        if isinstance(node, BaseModel):
            found, node = usual_of(type(node), key), getattr(node, key, None)
        elif isinstance(node, Mapping):
            node = cast("Mapping[str, object]", node).get(key)
        else:
            break  # a number of a list is what the list is
    return found


def usual_at(table: type[BaseModel], key: str, path: str, *, area: bool = False) -> Usual | None:
    """The usual size of the number at a path, a key of a table. area: whether a contact's stiffness is one per area."""
    usual = usual_of(table, key)
    if usual is _CONTACT and area:
        return _CONTACT_AREA
    return _TURN if usual is _SPEED and path.endswith(_ROTATION) else usual


def unusual(table: BaseModel, where: str, *, scaled: bool, area: bool = False) -> Iterator[str]:
    """One line for each number below a table, at the path ``where``, whose size is unusual.

    scaled: whether the case is in SI units, else only numbers without a unit count. area: whether a contact's
    stiffness is one per area. What the case does not give is not looked at.
    """
    for key in type(table).model_fields:
        if key not in table.model_fields_set:
            continue
        for path, value in _leaves(getattr(table, key), dotted_key(where, key)):
            if isinstance(value, BaseModel):
                yield from unusual(value, path, scaled=scaled)
                continue
            usual = usual_at(type(table), key, path, area=area)
            if usual is not None and (scaled or not usual.scaled) and (text := usual.oddity(path, value)):
                yield text


# The normal n counts in n + μ t by 1/μ: beyond that fewer than ten of its sixteen digits are left.
MOST_FRICTION = 1e6
TOO_MUCH = f"a friction coefficient is at most {MOST_FRICTION:g}, beyond which rounding is left of the normal force"


def friction_oddity(where: str, mu: float) -> str:
    """What is odd about a friction coefficient that was asked for, "" where nothing is."""
    return _RANGE_OF_MU.oddity(where, mu)


def dotted_key(where: str, key: str) -> str:
    """The path of a key below a path."""
    return f"{where}.{dotted((key,))}" if where else dotted((key,))


def _leaves(value: object, where: str) -> Iterator[tuple[str, Any]]:
    """Numbers and tables in a value, with their paths; of a vector the component of the greatest size, at the path of
    the whole."""
    if isinstance(value, BaseModel):
        yield where, value
    elif isinstance(value, Mapping):
        for key, item in cast("Mapping[str, object]", value).items():
            yield from _leaves(item, dotted_key(where, key))
    elif isinstance(value, tuple | list):
        items = list(cast("tuple[object, ...]", value))
        if items and all(isinstance(item, float) for item in items):
            yield where, max(cast("list[float]", items), key=abs)
        else:
            for number, item in enumerate(items):
                yield from _leaves(item, dotted_key(where, str(number)))
    elif isinstance(value, float) and math.isfinite(value):
        yield where, value
