"""Simultaneous iteration for one contact with constant friction on real modes, compiled as a whole.

T is one number there, 1/K_c + H_nn + μ s H_nt, and a branch takes hundreds of steps over μ: what each costs beside its
sums is what a slider waits for. The numbers are those of `roots.polish`, operation by operation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernels import njit
from ..typing import Array, BoolArray, ComplexArray
from .deflation import deflating_sums
from .receptance import real_mode_sums

NO_POLES = np.zeros(0, dtype=complex)


NUDGE = 1e-9  # of λ: a step off a pole


class SingleContact(NamedTuple):
    """T at one μ: damping (n,), stiffness (n,) and products (2, n) of the modes, compliance 1/K_c, and μ s."""

    damping: Array
    stiffness: Array
    products: Array
    compliance: float
    friction: float


@njit(cache=True, error_model="numpy")
def _quotient(a: complex, b: complex) -> complex:  # pragma: no cover - compiled
    """a/b after Smith, as NumPy divides."""
    if abs(b.real) >= abs(b.imag):
        if b.real == 0.0 and b.imag == 0.0:
            return complex(a.real / abs(b.real), a.imag / abs(b.real))
        ratio = b.imag / b.real
        scale = 1.0 / (b.real + b.imag * ratio)
        return complex((a.real + a.imag * ratio) * scale, (a.imag - a.real * ratio) * scale)
    ratio = b.real / b.imag
    scale = 1.0 / (b.imag + b.real * ratio)
    return complex((a.real * ratio + a.imag) * scale, (a.imag * ratio - a.real) * scale)


@njit(cache=True, error_model="numpy")
def _polished(
    roots: ComplexArray, implied: BoolArray, damping: Array, stiffness: Array, products: Array, compliance: float,
    friction: float, pole_stiffness: Array, pole_damping: Array, no_poles: ComplexArray, steps: int, converged: float,
) -> int:  # pragma: no cover - compiled  # fmt: skip
    count = len(roots)
    smallest = np.full(count, np.inf)
    active = np.ones(count, dtype=np.bool_)
    left = count
    for _ in range(steps):
        index = np.flatnonzero(active)
        lam = roots[index]
        sums = np.empty((len(index), products.shape[0], 4))
        real_mode_sums(lam.real.copy(), lam.imag.copy(), damping, stiffness, products, sums)
        others = np.empty(len(index), dtype=np.complex128)
        deflating_sums(roots, implied, index, pole_stiffness, pole_damping, no_poles, others)
        for k in range(len(index)):
            normal, tangential = sums[k, 0], sums[k, 1]
            value = complex(compliance + normal[0] + friction * tangential[0], normal[1] + friction * tangential[1])
            slope = complex(normal[2] + friction * tangential[2], normal[3] + friction * tangential[3])
            own = index[k]
            step = complex(0.0, 0.0)  # where T is zero to the last bit
            if value != 0.0 or not np.isfinite(others[k]):
                step = _quotient(complex(1.0, 0.0), _quotient(slope, value) + others[k])
            if not (np.isfinite(step.real) and np.isfinite(step.imag)):
                # On a pole to the last bit there is no step: a nudge leads off it, which is no sign of convergence.
                roots[own] = roots[own] - NUDGE * lam[k]
                continue
            relative = abs(step) / max(abs(roots[own]), 1e-300)
            roots[own] = roots[own] - step
            # Beside a coalescence the last digits stagnate above that; no step helps further then.
            if relative < converged or (relative < 1e-7 and relative >= 0.5 * smallest[own]):
                active[own] = False
                left -= 1
            smallest[own] = min(smallest[own], relative)
        if left == 0:
            break
    return left


def polish_single(
    roots: ComplexArray, implied: BoolArray, contact: SingleContact, poles: tuple[Array, Array], steps: int,
    converged: float,
) -> int:  # fmt: skip
    """Iterate ``roots`` (k,) in place; how many have not converged. poles: ω² and c of the real modes."""
    return int(_polished(roots, implied, *contact, *poles, NO_POLES, steps, converged))
