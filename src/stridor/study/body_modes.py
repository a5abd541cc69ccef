"""Natural frequencies of each body by itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from ..direct import factorise
from ..system import System
from ..system.model import Line, Solid
from ..system.uncoupled import uncoupled_modes
from ..typing import Array, Sparse
from .workspace import Problem, Workspace

DENSE = 1500  # freedoms up to which all modes are computed
MOST = 40  # modes of a larger body


@dataclass(frozen=True)
class BodyModes:
    """Undamped modes of one body alone, supports included: frequency_hz (k,) and what they are
    ("rigid", "F1" bending, "T1" traction, "FT3" mixed), by frequency."""

    frequency_hz: Array
    labels: tuple[str, ...]


def body_modes(problem: Problem, *, max_frequency_hz: float | None = None) -> Mapping[str, BodyModes]:
    """Modes of every body by itself (the first columns of the paper's Table II).

    In large models and those with surfaces a body's modes are those with all other bodies held, up to the 40 lowest
    of a large one; point masses have none.
    """
    work = Workspace.of(problem)
    limit = max_frequency_hz or work.modal.max_frequency_hz
    return work.answers.once(("body modes", limit), lambda: _of_bodies(work.system(), limit))


def _of_bodies(system: System, limit: float) -> Mapping[str, BodyModes]:
    result: dict[str, BodyModes] = {}
    if system.assembled or system.solids:
        for body in (*system.lines, *system.solids):
            if len(body.freedoms) > system.dimension:
                result[body.name] = _of_freedoms(system, body, limit)
        return result
    modes = uncoupled_modes(system.undamped())
    for line in system.lines:
        axis = line.coordinates[-1] - line.coordinates[0]
        axis = axis / np.linalg.norm(axis)
        entries: list[tuple[float, float]] = []
        for block in modes.real:
            if not np.isin(block.freedoms[0], line.freedoms):
                continue
            shapes = np.zeros((system.size, len(block.stiffness)))
            shapes[block.freedoms] = block.vectors
            motion = (line.rows.free @ shapes).reshape(-1, 2, len(block.stiffness))
            along = (np.einsum("kdm,d->km", motion, axis) ** 2).sum(axis=0)
            share = along / np.maximum((motion**2).sum(axis=(0, 1)), 1e-300)
            frequency = np.sqrt(np.maximum(block.stiffness, 0.0)) / (2 * np.pi)
            entries += [(float(f), float(a)) for f, a in zip(frequency, share, strict=True) if f <= limit]
        result[line.name] = _labelled(sorted(entries))
    return result


def _labelled(entries: list[tuple[float, float]]) -> BodyModes:
    """Count bending and traction modes separately, from the share of motion along the axis."""
    counts = {"F": 0, "T": 0, "FT": 0}
    labels: list[str] = []
    for frequency, along in entries:
        if frequency == 0.0:
            labels.append("rigid")
            continue
        kind = "T" if along > 0.7 else "F" if along < 0.3 else "FT"
        counts[kind] += 1
        labels.append(f"{kind}{counts[kind]}")
    return BodyModes(np.array([f for f, _ in entries]), tuple(labels))


def _of_freedoms(system: System, body: Line | Solid, limit: float) -> BodyModes:
    """Modes on the freedoms of one body, all others held."""
    part = body.freedoms
    mass = sp.csr_array(system.mass[part][:, part])
    stiffness = sp.csr_array(system.stiffness[part][:, part])
    if len(part) <= DENSE:
        _, vectors = sl.eigh(stiffness.toarray(), mass.toarray())
    else:
        # A shift below zero, as a free body has rigid modes at zero.
        shift = -((2 * np.pi * max(limit, 1.0) / 20) ** 2)
        factor = factorise(sp.csr_array(stiffness - shift * mass), symmetric=True)
        inverse = spl.LinearOperator(stiffness.shape, matvec=factor.solve, dtype=float)
        _, vectors = spl.eigsh(stiffness, MOST, mass, sigma=shift, OPinv=inverse, tol=1e-10)
    frequency = np.sqrt(np.maximum(np.sort(_quotients(stiffness, mass, vectors)), 0.0)) / (2 * np.pi)
    inside = frequency[frequency <= limit]
    names = ["rigid" if f == 0.0 else "" for f in inside]
    elastic = 0
    for k, name in enumerate(names):
        if not name:
            elastic += 1
            names[k] = f"E{elastic}"
    return BodyModes(inside, tuple(names))


def _quotients(stiffness: Sparse, mass: Sparse, vectors: Array) -> Array:
    """ω² (k,) [rad²/s²] of vectors (n, k) by Rayleigh's quotient, zero where it is what rounding leaves of entries
    that cancel: a threshold taken from the highest frequencies would take slow modes of fine meshes for rigid ones."""
    masses = np.einsum("ij,ij->j", vectors, mass @ vectors)
    squares = np.einsum("ij,ij->j", vectors, stiffness @ vectors) / masses
    rounding = np.einsum("ij,ij->j", np.abs(vectors), abs(stiffness) @ np.abs(vectors)) / masses
    return np.where(np.abs(squares) < 100 * np.finfo(float).eps * rounding, 0.0, squares)
