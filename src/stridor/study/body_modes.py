"""Natural frequencies of each body by itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from ..digits import hertz, readable
from ..direct import factorise
from ..fe.assembly import connected_components
from ..notebook import counted, html_table
from ..system import System
from ..system.model import Line, Solid
from ..tabular import Rows, Tabular
from ..typing import Array, Sparse
from .asked import require_frequency
from .workspace import Problem, Workspace

DENSE = 1500  # freedoms up to which all modes are computed
FEW = 3  # modes named in one line
MOST = 40  # modes of a larger body


@dataclass(frozen=True, repr=False)
class BodyModes(Tabular):
    """Undamped modes of one body alone, supports included: frequency_hz (k,) and what they are
    ("rigid", of beams "F1" bending, "T1" traction, "FT3" mixed, of others "E1"), by frequency."""

    frequency_hz: Array
    labels: tuple[str, ...]

    @property
    def _line(self) -> str:
        few = zip(self.labels[:FEW], self.frequency_hz[:FEW], strict=True)
        some = ", ".join(f"{label} {hertz(frequency, 4)}" for label, frequency in few)
        return some + (f", … {len(self.labels)} in all" if len(self.labels) > FEW else "")

    def _repr_html_(self) -> str:
        rows = [(label, readable(f)) for label, f in zip(self.labels, self.frequency_hz, strict=True)]
        return html_table(counted(len(rows), "mode").capitalize(), ("mode", "frequency [Hz]"), rows)

    def table(self) -> Rows:
        """A row for each mode."""
        return ("mode", "frequency_hz"), list(zip(self.labels, self.frequency_hz.tolist(), strict=True))


def body_modes(problem: Problem, *, max_frequency_hz: float | None = None) -> Mapping[str, BodyModes]:
    """Modes of every body by itself (the first columns of the paper's Table II).

    All other bodies are held. Of a large body there are up to the 40 lowest; point masses have none.
    """
    require_frequency(max_frequency_hz)
    work = Workspace.of(problem)
    limit = max_frequency_hz or work.modal.max_frequency_hz
    return work.answers.once(("body modes", limit), lambda: _of_bodies(work.system(), limit))


def _of_bodies(system: System, limit: float) -> Mapping[str, BodyModes]:
    return {
        body.name: _of_body(system, body, limit)
        for body in (*system.lines, *system.solids)
        if len(body.freedoms) > system.dimension
    }


def _of_body(system: System, body: Line | Solid, limit: float) -> BodyModes:
    """Modes on the freedoms of one body, all others held."""
    mass, stiffness = (sp.csr_array(m[body.freedoms][:, body.freedoms]) for m in (system.mass, system.stiffness))
    rows = sp.csr_array(sp.csc_array(body.rows.free)[:, body.freedoms])
    entries: list[tuple[float, float]] = []
    for part in connected_components(mass, stiffness):
        frequency, vectors = _solved(mass[part][:, part], stiffness[part][:, part], limit)
        share = _along(body, rows[:, part] @ vectors) if isinstance(body, Line) else np.zeros(len(frequency))
        entries += [(float(f), float(a)) for f, a in zip(frequency, share, strict=True) if f <= limit]
    entries.sort()
    return _labelled(entries) if isinstance(body, Line) else _counted([f for f, _ in entries])


def _along(line: Line, motion: Array) -> Array:
    """Share (m,) of motions (k d, m) of a line's nodes that goes along its axis."""
    axis = line.coordinates[-1] - line.coordinates[0]
    motion = motion.reshape(len(line.coordinates), -1, motion.shape[1])
    along = (np.einsum("kdm,d->km", motion, axis / np.linalg.norm(axis)) ** 2).sum(axis=0)
    return along / np.maximum((motion**2).sum(axis=(0, 1)), 1e-300)


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


def _counted(frequencies: list[float]) -> BodyModes:
    """Rigid motions and elastic modes in turn."""
    rigid = frequencies.count(0.0)
    names = ["rigid"] * rigid + [f"E{k + 1}" for k in range(len(frequencies) - rigid)]
    return BodyModes(np.array(frequencies), tuple(names))


def _solved(mass: Sparse, stiffness: Sparse, limit: float) -> tuple[Array, Array]:
    """Frequencies (m,) [Hz] and vectors (n, m), all of few freedoms, else the lowest."""
    if mass.shape[0] <= DENSE:
        _, vectors = sl.eigh(stiffness.toarray(), mass.toarray())
    else:
        # A shift below zero, as a free body has rigid modes at zero.
        shift = -((2 * np.pi * max(limit, 1.0) / 20) ** 2)
        factor = factorise(sp.csr_array(stiffness - shift * mass), symmetric=True)
        inverse = spl.LinearOperator(stiffness.shape, matvec=factor.solve, dtype=float)
        _, vectors = spl.eigsh(stiffness, MOST, mass, sigma=shift, OPinv=inverse, tol=1e-10)
    return np.sqrt(np.maximum(_quotients(stiffness, mass, vectors), 0.0)) / (2 * np.pi), vectors


def _quotients(stiffness: Sparse, mass: Sparse, vectors: Array) -> Array:
    """ω² (k,) [rad²/s²] of vectors (n, k) by Rayleigh's quotient, zero where it is what rounding leaves of entries
    that cancel: a threshold taken from the highest frequencies would take slow modes of fine meshes for rigid ones."""
    masses = np.einsum("ij,ij->j", vectors, mass @ vectors)
    squares = np.einsum("ij,ij->j", vectors, stiffness @ vectors) / masses
    rounding = np.einsum("ij,ij->j", np.abs(vectors), abs(stiffness) @ np.abs(vectors)) / masses
    return np.where(np.abs(squares) < 100 * np.finfo(float).eps * rounding, 0.0, squares)
