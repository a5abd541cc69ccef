"""Values that are allowed but look like a slip of units or of a digit: said as warnings, never refused.

Sizes of single numbers are in `usual`; here is what takes more than one of them: sound that travels too fast, a
pressure beyond the modulus of what it presses on, damping beyond critical, elements that lock.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from pydantic import BaseModel

from .bodies import (
    AnnulusMesh,
    BeamBody,
    DampingTable,
    DiscMesh,
    MassBody,
    MatrixBody,
    ObstacleBody,
    PadMesh,
    SolidBody,
)
from .checks import signed_distance
from .extent import extent_of
from .points import BoundaryRef, PointRef, parse_location
from .repeating import repeating, repeating_words
from .schema import Load
from .usual import LENGTH, unusual

if TYPE_CHECKING:
    from .model import Case

_SLENDER = 5.0  # length / thickness below which Euler–Bernoulli beams are off by percents
_SOUND = (20.0, 2.5e4)  # √(E/ρ) [m/s]: from soft rubber to beyond diamond
_HEAVY, _SOFT = 4e3, 1e9  # [kg/m³], [Pa]: what is heavier is a metal or an ore, and none of these is softer
_STRAIN = 0.1  # of a load's stress over Young's modulus, beyond which nothing is small any more
_LOCKS = 0.45  # Poisson's ratio above which linear elements with full integration stiffen by tens of per cents
_LOCKS_QUADRATIC = 0.499
_FASTEST_RIM = 250.0  # [m/s]; discs of steel burst at about twice as much
_LINEAR = ("triangle", "quad", "tetra", "hexahedron")
_BAND = 0.1  # of the frequencies looked at: a share that is worth a word where damping is beyond critical


def oddities(case: Case) -> Iterator[str]:
    """One line for each value of a case that is probably not meant.

    Numbers with a unit are looked at in cases in SI units only: those that have a material or a mesh, unless they say
    units = "nondimensional".
    """
    yield from repeating_words(repeating(case.ties))
    scaled = in_si_units(case)
    for table in ("materials", "bodies", "supports", "loads"):
        for name, entry in getattr(case, table).items():
            yield from unusual(entry, f"{table}.{name}", scaled=scaled)
    for name, contact in case.contacts.items():
        area = isinstance(parse_location(contact.slave, case.bodies), BoundaryRef)
        yield from unusual(contact, f"contacts.{name}", scaled=scaled, area=area)
    for table in ("ties", "springs", "dashpots"):
        for name, entry in getattr(case, table).items():
            yield from unusual(entry, f"{table}.{name}", scaled=scaled)
    for number, phase in enumerate(case.phases):
        yield from unusual(phase, f"phases.{number}", scaled=scaled)
    for section in ("steady", "modal", "temporal", "comparison"):
        yield from unusual(getattr(case, section), section, scaled=scaled)
    if scaled:
        yield from _materials(case)
        yield from _loads(case)
        yield from _spins(case)
    yield from _poisson(case)
    yield from _damping(case)
    yield from _angles(case)
    yield from _beams(case)
    yield from _idle_sliding(case)
    yield from _springs(case)


def in_si_units(case: Case) -> bool:
    """Whether numbers of a case have units at all.

    Masses and springs alone, and matrices of which nothing says where their nodes are or how long a metre is, may be
    in any: models of research often have a mass of one.
    """
    if case.units == "nondimensional":
        return False
    return any(
        isinstance(body, BeamBody | SolidBody)
        or (isinstance(body, MatrixBody) and (body.mesh is not None or "scale" in body.model_fields_set))
        for body in case.bodies.values()
    )


def _materials(case: Case) -> Iterator[str]:
    for name, material in case.materials.items():
        where, modulus, density = f"materials.{name}", material.young_modulus, material.density
        if list(unusual(material, where, scaled=True)):
            continue  # said already
        sound = math.sqrt(modulus / density)
        if not _SOUND[0] <= sound <= _SOUND[1]:
            yield (
                f"{where}: sound travels at √(E/ρ) = {sound:.4g} m/s in it, usually {_SOUND[0]:g} to {_SOUND[1]:g} "
                f"m/s; check young_modulus = {modulus:g} Pa and density = {density:g} kg/m³"
            )
        elif density > _HEAVY and modulus < _SOFT:
            yield (
                f"{where}: {modulus:g} Pa is soft as rubber or plastics and {density:g} kg/m³ heavy as metal; check "
                "the unit of young_modulus (Pa) and density (kg/m³)"
            )


def _poisson(case: Case) -> Iterator[str]:
    """Poisson's ratios near their ends, where elements lock, and negative ones."""
    for name, material in case.materials.items():
        ratio = material.poisson_ratio
        solids = [(n, b) for n, b in case.bodies.items() if isinstance(b, SolidBody) and b.material == name]
        where = f"materials.{name}.poisson_ratio: {ratio:g}"
        if ratio < 0.0 and "poisson_ratio" in material.model_fields_set:
            lead = f"{where} is negative, usually 0 to 0.5: the material grows thicker as it is pulled (auxetic)"
            stiff = 0.5 / (1.0 + ratio)
            tail = f"; its shear modulus is {stiff:.3g} E, and elements lock in bending" if stiff > 2.0 else ""
            yield lead + tail
        for body, solid in solids:
            kind = None if solid.mesh is None else solid.mesh.cells
            limit = _LOCKS if kind in _LINEAR else _LOCKS_QUADRATIC
            if solid.model != "plane stress" and ratio > limit:
                cells = "the elements" if kind is None else f"{kind} elements"
                cure = "take quadratic ones or a smaller ratio" if kind in _LINEAR else "take a smaller ratio"
                yield (
                    f"{where} is near 0.5, where the volume cannot change: {cells} of {body} lock, frequencies come "
                    f"out too high; {cure} (at most {limit:g})"
                )


def _loads(case: Case) -> Iterator[str]:
    """Pressures and forces that strain what they act on beyond what is small."""
    for name, load in case.loads.items():
        if load.at is None:
            continue
        location = parse_location(load.at, case.bodies)
        body = case.bodies[location.body]
        if not isinstance(body, BeamBody | SolidBody) or body.material is None:
            continue
        material = case.materials[body.material]
        if list(unusual(material, "", scaled=True)) or list(unusual(load, "", scaled=True)):
            continue  # said of the modulus or the load itself
        modulus = material.young_modulus
        for what, stress in (("pressure", abs(load.pressure)), ("force", _stress(load, body))):
            if stress > _STRAIN * modulus:
                beyond = "beyond" if stress > modulus else f"{100 * stress / modulus:.0f} % of"
                yield (
                    f"loads.{name}.{what}: a stress of {'' if what == 'pressure' else 'at least '}{stress:.4g} Pa is "
                    f"{beyond} Young's modulus of {location.body}, {modulus:g} Pa; linear elasticity holds for small "
                    "strain: check the units of load and modulus"
                )


def _stress(load: Load, body: BeamBody | SolidBody) -> float:
    """Stress [Pa] that a force makes at least, 0 where the size of the body is not known here."""
    force = math.hypot(*load.force)
    if isinstance(body, BeamBody):
        return force / (body.width * body.thickness)
    extent = None if body.mesh is None else extent_of(body.mesh)
    if extent is None or not force:
        return 0.0
    return force / (extent * (body.thickness if body.dimension == 2 else extent))


def _spins(case: Case) -> Iterator[str]:
    for name, body in case.bodies.items():
        sliding = getattr(body, "sliding", None)
        mesh = body.mesh if isinstance(body, SolidBody) else None
        radius = mesh.outer_radius if isinstance(mesh, AnnulusMesh | DiscMesh | PadMesh) else None
        radius = body.radius if isinstance(body, ObstacleBody) else radius
        if sliding is None or radius is None:
            continue
        rim = abs(sliding.spin) * radius
        if rim > _FASTEST_RIM:
            yield (
                f"bodies.{name}.sliding.spin: {sliding.spin:g} rad/s moves the rim at {rim:.4g} m/s, usually at most "
                f"{_FASTEST_RIM:g} m/s; if {sliding.spin:g} turns a minute are meant, write "
                f"{sliding.spin * math.pi / 30:.6g}"
            )


def _damping(case: Case) -> Iterator[str]:
    """Damping that leaves nothing to vibrate over much of the band or at a mass."""
    limit = case.modal.max_frequency_hz
    sound = not list(unusual(case.modal, "", scaled=True))
    for name, body in case.bodies.items() if sound else ():
        damping = getattr(body, "damping", None)
        if isinstance(damping, DampingTable):
            yield from _overdamped(f"bodies.{name}.damping", damping, limit)
    for name, mass, stiffness, damping in _masses(case):
        critical = 2.0 * math.sqrt(stiffness * mass)
        if damping > critical > 0.0:
            yield (
                f"bodies.{name}: its springs and dashpots damp it with {damping:g} N s/m, {damping / critical:.3g} "
                f"times critical ({critical:.4g} N s/m); it cannot vibrate by itself"
            )


def _overdamped(where: str, damping: DampingTable, limit: float) -> Iterator[str]:
    """ζ = α/(2ω) + βω/2 against 1; with αβ ≥ 1 it is nowhere below."""
    alpha, beta, top = damping.mass, damping.stiffness, 2.0 * math.pi * limit
    # ζ = 1 at ω = (1 ± √(1 − αβ))/β: between these a mode vibrates.
    product = alpha * beta
    root = math.sqrt(max(0.0, 1.0 - product))
    low = alpha / (1.0 + root)  # (1 − √)/β, written so that β may be 0
    high = (1.0 + root) / beta if beta > 0.0 else math.inf
    values = f"α₁ = {alpha:g} 1/s, α₂ = {beta:g} s"
    hint = "check the unit of both; loss factors and per cents are not what Rayleigh's factors are"
    if product >= 1.0 or low >= top:
        yield (
            f"{where}: {values} damp beyond critical at every frequency up to {limit:g} Hz, so that nothing vibrates; "
            f"{hint}"
        )
    else:
        if low > _BAND * top:
            yield f"{where}: {values} damp beyond critical below {low / 2 / math.pi:.4g} Hz; {hint}"
        if high < _BAND * top:
            yield f"{where}: {values} damp beyond critical above {high / 2 / math.pi:.4g} Hz; {hint}"


def _masses(case: Case) -> Iterator[tuple[str, float, float, float]]:
    """Each point mass with its mass, and the stiffness and damping of all that is fastened to it, whatever way."""
    for name, body in case.bodies.items():
        if not isinstance(body, MassBody):
            continue

        def at(reference: str, name: str = name) -> bool:
            return reference.partition(".")[0] == name

        springs = [s for s in case.springs.values() if any(map(at, s.between))]
        dashpots = [d for d in case.dashpots.values() if any(map(at, d.between))]
        damping = sum(link.damping for link in (*springs, *dashpots))
        yield name, body.mass, sum(max(s.stiffness, 0.0) for s in springs), damping


def _angles(case: Case) -> Iterator[str]:
    """Angles in degrees that look like a handsome part of a turn in radians: 1.5708 or 0.7854."""
    for name, body in case.bodies.items():
        tables: list[tuple[str, BaseModel]] = [(f"bodies.{name}", body)]
        if isinstance(body, SolidBody) and body.mesh is not None:
            tables.append((f"bodies.{name}.mesh", body.mesh))
        for where, table in tables:
            for key in ("angle_deg", "start_deg", "sweep_deg"):
                degrees = radians_meant(getattr(table, key, None))
                if degrees is not None:
                    value = getattr(table, key)
                    yield f"{where}.{key}: {value:g} degrees looks like radians; if so, write {degrees:g}"


def radians_meant(value: float | None) -> float | None:
    """Degrees of an angle that was probably given in radians, None for all others."""
    if not value or abs(value) > 2.0 * math.pi * 1.001 or (2.0 * value).is_integer():  # ty: ignore[missing-union-attribute]
        return None
    degrees = math.degrees(value)
    # The handsomer the angle, the fewer of its digits need be written: 1.57, but 1.4835.
    for step, digits in ((15.0, 1e-3), (5.0, 1e-4)):
        near = step * round(degrees / step)
        if near and abs(degrees - near) <= digits * abs(near):
            return near
    return None


def _beams(case: Case) -> Iterator[str]:
    for name, body in case.beams.items():
        if body.end is not None and (text := LENGTH.oddity(f"bodies.{name}.end", body.length_m)):
            yield text.replace("m is unusual", "m from start to end is unusual", 1)
        if body.length_m < _SLENDER * body.thickness:
            ratio = body.length_m / body.thickness
            yield f"bodies.{name}: only {ratio:.3g} times as long as thick; shear matters, and is neglected"
    for name, contact in case.contacts.items():
        slave = parse_location(contact.slave, case.bodies)
        body, master = case.bodies[slave.body], case.bodies.get(contact.master)
        if not (isinstance(slave, PointRef) and isinstance(body, BeamBody) and isinstance(master, BeamBody)):
            continue
        _, gap = signed_distance(master, *body.coordinates(slave.distance))
        if abs(gap) > 0.01 * master.length_m:
            yield f"contacts.{name}: {contact.slave} starts {abs(gap):.3g} m off the line of {contact.master}"


def _idle_sliding(case: Case) -> Iterator[str]:
    """Material that slides through its mesh where nothing touches it."""
    touched = {reference.partition(".")[0] for c in case.contacts.values() for reference in (c.slave, c.master)}
    for name, body in case.bodies.items():
        if getattr(body, "sliding", None) is not None and name not in touched:
            yield f"bodies.{name}.sliding: no contact touches {name}, so that it has no effect"


def _springs(case: Case) -> Iterator[str]:
    for name, spring in case.springs.items():
        if spring.stiffness < 0:
            yield f"springs.{name}.stiffness: {spring.stiffness:.6g} N/m is negative: it drives its ends apart"
        elif not (spring.stiffness or spring.cubic or spring.damping):
            yield f"springs.{name}: no stiffness, no cubic part and no damping, so that it has no effect"
