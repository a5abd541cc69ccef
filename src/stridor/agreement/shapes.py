"""Shapes of motion in time and of modes, and how alike they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..system import System
from ..temporal.signals import low_passed
from ..typing import Array, ComplexArray, Sparse

BEGINNINGS = (1.0, 0.8, 0.6, 0.45, 0.3)
SLOW = 8  # degree of polynomials for slow parts
TOLD = 0.2  # of a shape: by how much what the fit leaves may change it at most where it is told
SAME = 0.02  # of |λ|: a mode so near to a component is that


@dataclass(frozen=True)
class TimeShape:
    """Complex amplitudes (r,) of one component of a motion in time, and the rows (r, n) csr of what moved so: along
    each axis, nodes of every body."""

    rows: Sparse
    values: ComplexArray

    def likeness(self, vectors: ComplexArray) -> float:
        """MAC with a mode (n,); with what modes (k, n) span, the share of the shape that lies in it."""
        return span_assurance(self.values, np.asarray(self.rows @ np.atleast_2d(vectors).T))


def modal_assurance(first: ComplexArray, second: ComplexArray) -> float:
    """MAC |aᴴb|²/(aᴴa bᴴb) of two complex shapes, 1 for equal up to a factor."""
    a, b = np.ravel(first), np.ravel(second)
    size = float(np.vdot(a, a).real * np.vdot(b, b).real)
    return float(abs(np.vdot(a, b)) ** 2 / size) if size > 0 else 0.0


def span_assurance(shape: ComplexArray, vectors: ComplexArray) -> float:
    """The share of a complex shape (r,) that lies in what shapes (r, k) span: MAC, of one."""
    basis = np.linalg.qr(vectors)[0]
    size = float(np.vdot(shape, shape).real)
    return float(np.sum(np.abs(basis.conj().T @ shape) ** 2)) / size if size > 0.0 else 0.0


def mode_shape(system: System, vector: ComplexArray) -> dict[str, ComplexArray]:
    """Displacements (k, d) of the nodes of each body in an eigenvector (n,)."""
    return {
        body.name: np.asarray(body.rows.free @ vector).reshape(-1, system.dimension)
        for body in (*system.lines, *system.solids)
    }


def node_rows(system: System, most: int) -> Sparse:
    """Rows (r, n) csr of the displacements of at most ``most`` nodes, taken evenly from all bodies."""
    d = system.dimension
    bodies = [sp.csr_array(body.rows.free) for body in (*system.lines, *system.solids)]
    rows = sp.csr_array(sp.vstack([sp.csr_array((0, system.size)), *bodies]))
    nodes = np.arange(rows.shape[0] // d)[:: max(1, -(-rows.shape[0] // d // max(most, 1)))]
    return sp.csr_array(rows[(d * nodes[:, None] + np.arange(d)).ravel()])


def component_shape(
    rows: Sparse, time: Array, values: Array, eigenvalues: ComplexArray, chosen: complex, max_frequency_hz: float,
    started: ComplexArray | None = None,
) -> TimeShape | None:  # fmt: skip
    """Shape of the component that goes as exp(λt) with λ = chosen, one of eigenvalues (k,), in a motion.

    values (s, r) at times (s,) [s], evenly spaced, passes the filter that the signal of the components has passed (what
    grows beyond max_frequency_hz is none of them) and is split into all of them and slow parts by least squares, which
    tells lines apart that no spectrum of so short a signal does. Nodes that hardly press or hardly slide leave the
    linear range before others do, so of several beginnings of the motion the one is taken that the components explain
    best. started: λ (j,) of what the motion was started with: bodies may move in what no contact shows. None where
    there are too few instants for so many components, and where what is left of the motion might change the shape by
    more than `TOLD` of it.
    """
    index = int(np.argmin(np.abs(eigenvalues - chosen))) if len(eigenvalues) else 0
    if started is not None and len(eigenvalues):
        away = np.abs(started[:, None] - eigenvalues).min(axis=1) > SAME * np.abs(started)
        eigenvalues = np.append(eigenvalues, started[away])
    least = 3 * (2 * len(eigenvalues) + SLOW + 1)
    if chosen == 0 or len(time) < least:
        return None
    values = low_passed(values.T, float(time[1] - time[0]), max_frequency_hz).T
    # The filter shifts the motion in time, which changes an exponential by a factor that all nodes share.
    time = time[: len(values)]
    if len(time) < least:
        return None
    best, doubt = np.zeros(0, dtype=complex), np.inf
    for share in BEGINNINGS:
        count = max(least, int(share * len(time)))
        found, off = _split(time[:count], values[:count], eigenvalues, index)
        if off < doubt:
            best, doubt = found, off
    return TimeShape(rows, best) if doubt <= TOLD and np.isfinite(best).all() else None


def _split(time: Array, values: Array, eigenvalues: ComplexArray, index: int) -> tuple[ComplexArray, float]:
    """Factors (r,) of exp(λt), λ one of eigenvalues, in a motion that is split into all of them and slow parts; and
    what is left of it: of the part that goes so, or of these factors were all of it along what tells them, whichever
    is more. What is so near to λ that it turns less than once against it leaves nothing: it must be among them."""
    rate = eigenvalues.real
    # Growth from the end, decay from the beginning: no column outgrows the others.
    grown = (time[:, None] - np.where(rate > 0, time[-1], time[0])) * rate
    waves = np.exp(grown + 1j * (time - time[-1])[:, None] * eigenvalues.imag)
    # What turns less than twice is not among the components (`signals.components`), but moves.
    slow = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, len(time)), SLOW)
    basis = np.column_stack([waves.real, waves.imag, slow])
    parts = np.linalg.lstsq(basis, values, rcond=1e-10)[0]
    pair = [index, len(eigenvalues) + index]
    found = parts[pair[0]] - 1j * parts[pair[1]]
    size, left = float(np.linalg.norm(found)), float(np.linalg.norm(values - basis @ parts))
    telling = float(np.linalg.norm(np.linalg.pinv(basis, rcond=1e-10)[pair], 2))
    part = float(np.linalg.norm(basis[:, pair] @ parts[pair]))
    return found, left * max(telling / size, 1.0 / part) if min(size, part) > 0.0 else np.inf


def by_body(shape: Mapping[str, ComplexArray]) -> ComplexArray:
    """Shapes of all bodies in one row."""
    return np.concatenate([shape[name].ravel() for name in shape])
