"""What simultaneous iteration takes off the slope of log det T: poles of the receptance, and the other roots."""

from __future__ import annotations

import numpy as np

from ..kernels import njit
from ..typing import Array, BoolArray, ComplexArray, IntArray


@njit(cache=True, error_model="numpy")
def deflating_sums(
    roots: ComplexArray, implied: BoolArray, index: IntArray, stiffness: Array, damping: Array, poles: ComplexArray,
    out: ComplexArray,
) -> None:  # pragma: no cover - compiled  # fmt: skip
    """`deflation` into ``out`` (k,), for kernels."""
    for k in range(index.shape[0]):
        own = index[k]
        a, b = roots[own].real, roots[own].imag
        re = im = 0.0
        for i in range(stiffness.shape[0]):
            dr = a * a - b * b + damping[i] * a + stiffness[i]
            di = 2 * a * b + damping[i] * b
            scale = 1.0 / (dr * dr + di * di)
            er, ei = 2 * a + damping[i], 2 * b
            re += (er * dr + ei * di) * scale
            im += (ei * dr - er * di) * scale
        for i in range(poles.shape[0]):
            dr, di = a - poles[i].real, b - poles[i].imag
            scale = 1.0 / (dr * dr + di * di)
            re += dr * scale
            im -= di * scale
        for j in range(roots.shape[0]):
            if j != own:
                dr, di = a - roots[j].real, b - roots[j].imag
                scale = 1.0 / (dr * dr + di * di)
                re -= dr * scale
                im += di * scale
            if implied[j]:
                dr, di = a - roots[j].real, b + roots[j].imag
                scale = 1.0 / (dr * dr + di * di)
                re -= dr * scale
                im += di * scale
        out[k] = complex(re, im)


def deflation(
    roots: ComplexArray, implied: BoolArray, index: IntArray, poles: tuple[Array, Array], general: ComplexArray
) -> ComplexArray:
    """Σ 1/(λ − poles) − Σ 1/(λ − other roots) (k,) at the roots ``index`` (k,) of all (n,).

    poles: ω² and c of the real modes, two poles each; general: poles of other blocks. Where ``implied``, the root's
    conjugate is one, too. Not a number on a pole to the last bit.
    """
    out = np.empty(len(index), dtype=complex)
    deflating_sums(roots, implied, index, *poles, general, out)
    return out
