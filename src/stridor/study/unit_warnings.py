"""What of meshes and imported matrices is probably in another unit, and meshes too coarse for the frequencies."""

from __future__ import annotations

import numpy as np

from ..case import Case
from ..case.bodies import MatrixBody, SolidBody
from ..case.oddities import in_si_units
from ..case.usual import LENGTH, USUAL, unusual
from ..fe.solid import wave_speeds
from ..laws import Material
from ..matrices.report import guessed_units, negative_mass
from ..matrices.source import Doubt
from ..mesh.model import Mesh
from ..mesh.quality import edge_lengths
from ..system.imported import load_terms
from ..system.meshes import load_mesh
from ..typing import Array

LEAST_PER_WAVE = 4.0  # elements per shear wavelength below which a frequency is not resolved
MOST_PER_WAVE = 1e5  # above it, lengths are hardly in metres
MANY_PER_WAVE, SMALL_BODY = 1e3, 2e-3  # nor are they above this in a body smaller than this [m]


def matrix_warnings(case: Case) -> list[str]:
    """Bodies of imported matrices with negative masses, or from files of which it is not sure that they were read as
    they are meant: cut off, with entries that were added up or mirrored, or with one half of a matrix."""
    found: list[str] = []
    for name, body in case.bodies.items():
        if not isinstance(body, MatrixBody):
            continue
        terms = load_terms(case, name, body)
        found += dict.fromkeys(f"bodies.{name}: {doubt}" for doubt in terms.doubts)
        read = [(s.source, note) for s in terms.stored for note in s.notes if isinstance(note, Doubt)]
        found += dict.fromkeys(f"bodies.{name}: {source}: {note}" for source, note in read)
        if negative := negative_mass(terms.mass):
            found.append(
                f"bodies.{name}: {negative}, and what grows for that is no squeal; is the sign of every factor right, "
                "and is it the mass?"
            )
    return found


def resolution_warnings(case: Case) -> list[str]:
    """Bodies with too few elements per shear wavelength at modal.max_frequency_hz, for what seeks modes up to there."""
    found: list[str] = []
    limit = case.modal.max_frequency_hz
    for name, body in case.bodies.items():
        solid = _solid(case, name)
        if not isinstance(body, SolidBody) or solid is None:
            continue
        mesh, material = solid
        largest, slow = edge_lengths(mesh)[1], wave_speeds(material, body.model)[1]
        if slow / limit / largest < LEAST_PER_WAVE:
            default = "" if "max_frequency_hz" in case.modal.model_fields_set else ", the default"
            found.append(
                f"{_wave(name, mesh, slow, limit)} Hz{default}, the longest edge is {largest:.3g} m; refine the mesh, "
                "lower the frequency, or check the unit of length"
            )
    return found


def unit_warnings(case: Case) -> list[str]:
    """Extents and masses of meshes and matrices that are hardly in metres and kilograms."""
    if not in_si_units(case):
        return []
    found: list[str] = []
    for name, body in case.bodies.items():
        solid = _solid(case, name)
        if isinstance(body, SolidBody) and solid is not None:
            found += _of_solid(case, name, body, *solid)
        elif isinstance(body, MatrixBody) and (body.mesh is not None or "scale" in body.model_fields_set):
            found += _of_matrices(case, name, body)
    return found


def extent_warning(where: str, points: Array, scale: float) -> str:
    """What is odd about the extent [m] of the points (k, d) of a file, "" where nothing is."""
    extent = float(np.ptp(points, axis=0).max(initial=0.0))
    if USUAL["SolidBody.scale"].oddity("", scale) or not LENGTH.oddity("", extent):
        return ""
    usually = f"usually {LENGTH.least:g} to {LENGTH.most:g} m"
    how = f"scale = {scale:g} made metres of the file" if scale != 1.0 else "scale = 0.001 is for one in millimetres"
    return f"{where}: {extent:.3g} m in extent is unusual, {usually}; {how}"


def _solid(case: Case, name: str) -> tuple[Mesh, Material] | None:
    """Mesh and material of a meshed body, None for others and where the file that should gives no material."""
    body = case.bodies[name]
    if not isinstance(body, SolidBody):
        return None
    loaded = load_mesh(name, body)
    own = loaded.material[0] if body.material is None else case.materials[body.material].law_object()
    return None if own is None else (loaded.mesh, own)


def _of_solid(case: Case, name: str, body: SolidBody, mesh: Mesh, material: Material) -> list[str]:
    where = f"bodies.{name}"
    if body.mesh is not None and list(unusual(body.mesh, "", scaled=True)):
        return []  # said of the shape
    if body.mesh is None and (said := extent_warning(where, mesh.points, body.scale)):
        return [said]
    limit = case.modal.max_frequency_hz
    largest, slow = edge_lengths(mesh)[1], wave_speeds(material, body.model)[1]
    per_wave = slow / limit / largest
    tiny = float(np.ptp(mesh.points, axis=0).max()) < SMALL_BODY and per_wave > MANY_PER_WAVE
    if tiny or per_wave > MOST_PER_WAVE:
        return [f"{_wave(name, mesh, slow, limit)} Hz; are the lengths in metres?"]
    return []


def _of_matrices(case: Case, name: str, body: MatrixBody) -> list[str]:
    where = f"bodies.{name}"
    terms = load_terms(case, name, body)
    found: list[str] = []
    if terms.labels is not None:
        masses: list[float] = []
        for direction in (1, 2, 3):
            moved = ((terms.labels.direction == direction) & (terms.labels.node > 0)).astype(float)
            masses.append(float(moved @ (terms.mass @ moved)))
        usual = USUAL["MassBody.mass"]
        if said := usual.oddity(where, max(masses)):
            found.append(said.replace("is unusual for a mass", "of mass in all is unusual", 1))
    guess = guessed_units(terms.mass.diagonal(), terms.stiffness.diagonal(), terms.labels)
    if guess is not None and guess.startswith("tonne"):
        given = f"with scale = {body.scale:g}; scale = 0.001 makes that SI"
        found.append(f"{where}: its matrices look like {guess}, {given}")
    return found


def _wave(name: str, mesh: Mesh, slow: float, limit: float) -> str:
    extent, largest = float(np.ptp(mesh.points, axis=0).max()), edge_lengths(mesh)[1]
    return (
        f"bodies.{name}: {extent:.3g} m in extent, {slow / limit / largest:.2g} elements per shear wavelength "
        f"({slow / limit:.3g} m) at modal.max_frequency_hz = {limit:g}"
    )
