"""Numbers of a motion in modes at a time, compiled.

A motion is ζ (2, f), real and imaginary parts at its beginning, and ``terms`` (J, S) of what is slow in powers of the
time since then.
"""

from __future__ import annotations

import math

from ....kernels import njit
from ....typing import Array, IntArray
from ...arithmetic import FAST
from ...columns import WORKS
from .forms import FORMS
from .tables import (
    CROSS_IMAG,
    CROSS_REAL,
    FORM_SLOW,
    POLES,
    QUADRATIC,
    STILL,
    WHICH,
    matrix,
)


@njit(cache=True, allocates=False)
def modes_at(zeta: Array, poles: Array, time: float, found: Array) -> None:  # pragma: no cover - compiled
    """[Re z; Im z] (2f,) at a time."""
    f = poles.shape[1]
    for k in range(f):
        grown, angle = math.exp(poles[0, k] * time), poles[1, k] * time
        cosine, sine = grown * math.cos(angle), grown * math.sin(angle)
        found[k] = zeta[0, k] * cosine - zeta[1, k] * sine
        found[f + k] = zeta[0, k] * sine + zeta[1, k] * cosine


@njit(cache=True, allocates=False, fastmath=FAST)
def quadratic_at(packed: Array, number: int, modes: Array) -> float:  # pragma: no cover - compiled
    """A form of modes (2f,), of several (r, ·): the rows of its lower triangle one after the other."""
    at, total = 0, 0.0
    for i in range(modes.shape[0]):
        here = 0.0
        for j in range(i + 1):
            here += packed[number, at + j] * modes[j]
        at += i + 1
        total += here * modes[i]
    return total


@njit(cache=True, allocates=False, fastmath=FAST)
def dot(row: Array, vector: Array) -> float:  # pragma: no cover - compiled
    """A row (n,) on a vector (n,)."""
    total = 0.0
    for j in range(row.shape[0]):
        total += row[j] * vector[j]
    return total


@njit(cache=True, allocates=False, fastmath=FAST)
def row_on(rows: Array, i: int, vector: Array) -> float:  # pragma: no cover - compiled
    """One of some rows (·, n) on a vector (n,)."""
    total = 0.0
    for j in range(rows.shape[1]):
        total += rows[i, j] * vector[j]
    return total


@njit(cache=True, allocates=False, fastmath=FAST)
def product(rows: Array, vector: Array, found: Array) -> None:  # pragma: no cover - compiled
    """Rows (r, n) on a vector (n,): (r,)."""
    for i in range(rows.shape[0]):
        total = 0.0
        for j in range(rows.shape[1]):
            total += rows[i, j] * vector[j]
        found[i] = total


@njit(cache=True, allocates=False)
def slow_at(terms: Array, time: float, found: Array) -> None:  # pragma: no cover - compiled
    """What is slow (S,) at a time."""
    for s in range(terms.shape[1]):
        total = 0.0
        for j in range(terms.shape[0] - 1, -1, -1):
            total = total * time + terms[j, s]
        found[s] = total


@njit(cache=True, allocates=False, fastmath={"contract"})
def followed(
    store: Array, where: IntArray, terms: Array, along_real: Array, along_imag: Array, alone: Array
) -> None:  # pragma: no cover - compiled
    """What forms have in z and what they have of the slow alone, as polynomials: along (7, J, f) and alone (7, 2J), of
    the energies themselves and of the primitives of powers: A' + λA = c where a power has c z."""
    poles = matrix(store, where, POLES)
    cross_real, cross_imag = matrix(store, where, CROSS_REAL), matrix(store, where, CROSS_IMAG)
    slow = matrix(store, where, FORM_SLOW)
    f, (count, size) = poles.shape[1], terms.shape
    for w in range(FORMS):
        for j in range(count - 1, -1, -1):
            real, imag = along_real[w, j], along_imag[w, j]
            real[:] = 0.0
            imag[:] = 0.0
            for s in range(size):
                weight = terms[j, s]
                if weight != 0.0:
                    for k in range(f):
                        real[k] += cross_real[w * size + s, k] * weight
                        imag[k] += cross_imag[w * size + s, k] * weight
            if w >= WORKS:
                continue
            if j + 1 < count:
                for k in range(f):
                    real[k] -= (j + 1) * along_real[w, j + 1, k]
                    imag[k] -= (j + 1) * along_imag[w, j + 1, k]
            for k in range(f):
                one, two = real[k], imag[k]
                real[k] = one * poles[2, k] - two * poles[3, k]
                imag[k] = one * poles[3, k] + two * poles[2, k]
        alone[w] = 0.0
        for i in range(count):
            for j in range(count):
                total = 0.0
                for a in range(size):
                    if terms[i, a] != 0.0:
                        for b in range(size):
                            total += terms[i, a] * slow[w * size + a, b] * terms[j, b]
                if w < WORKS:
                    alone[w, i + j + 1] += total / (i + j + 1)
                else:
                    alone[w, i + j] += total


@njit(cache=True, allocates=False)
def _still(pair: Array, zeta: Array, time: float) -> float:  # pragma: no cover - compiled
    """The work of a pair of modes whose exponents all but cancel."""
    k, i = int(pair[2]), int(pair[3])
    first = complex(zeta[0, k], -zeta[1, k] if pair[1] else zeta[1, k])
    size = complex(pair[4], pair[5]) * first * complex(zeta[0, i], zeta[1, i])
    real, imag = pair[6] * time, pair[7] * time
    if abs(real) + abs(imag) < 1e-8:
        share = 1.0 + 0.5 * complex(real, imag)
    else:
        grown, half = math.exp(real), math.sin(0.5 * imag)
        share = complex(math.expm1(real) - 2.0 * grown * half * half, grown * math.sin(imag)) / complex(real, imag)
    return (size * share).real * time


@njit(cache=True, allocates=False, fastmath=FAST)
def _along(real: Array, imag: Array, w: int, j: int, modes: Array) -> float:  # pragma: no cover - compiled
    f, total = real.shape[2], 0.0
    for k in range(f):
        total += real[w, j, k] * modes[k] - imag[w, j, k] * modes[f + k]
    return total


@njit(cache=True, allocates=False)
def forms_at(
    store: Array, where: IntArray, zeta: Array, modes: Array, time: float, along_real: Array, along_imag: Array,
    alone: Array, last: int, found: Array,
) -> None:  # fmt: skip # pragma: no cover - compiled
    """Energies and primitives of powers (7,) at a time at which modes are (2f,), up to that of number ``last``."""
    which, quadratic, still = matrix(store, where, WHICH), matrix(store, where, QUADRATIC), matrix(store, where, STILL)
    count = along_real.shape[1]
    for w in range(last):
        total = 0.0
        for j in range(2 * count - 1, -1, -1):
            total = total * time + alone[w, j]
        if which[0, w] >= 0.0:
            total += quadratic_at(quadratic, int(which[0, w]), modes)
        power = 1.0
        for j in range(count):
            total += power * _along(along_real, along_imag, w, j, modes)
            power *= time
        found[w] = total
    for i in range(still.shape[0]):
        w = int(still[i, 0])
        if w < last:
            found[w] += _still(still[i], zeta, time)
