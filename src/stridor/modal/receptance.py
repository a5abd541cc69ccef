"""Receptance of the uncoupled structure at the contacts, and the small problem T(λ, μ) δ = 0.

With g = G u (normal and tangential relative displacement of each contact) and H(λ) = G D(λ)⁻¹ Gᵀ,
the friction-coupled system has the eigenvalue λ exactly where T(λ, μ) is singular. For one contact
with constant μ this is 1/K_c + H_nn + μ s H_nt = 0, so that μ(λ) is explicit (docs/theory-modal.md).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..kernels import njit
from ..system.uncoupled import UncoupledModes
from ..typing import Array, ComplexArray, IntArray


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def real_mode_sums(
    lam_re: Array, lam_im: Array, damping: Array, stiffness: Array, products: Array, out: Array
) -> None:  # pragma: no cover - compiled
    """out (k, p, 4): Re and Im of Σ φφ/d with d = λ² + cλ + ω², and of its derivative in λ."""
    for k in range(lam_re.shape[0]):
        a, b = lam_re[k], lam_im[k]
        for p in range(products.shape[0]):
            s0 = s1 = s2 = s3 = 0.0
            for i in range(stiffness.shape[0]):
                dr = a * a - b * b + damping[i] * a + stiffness[i]
                di = 2 * a * b + damping[i] * b
                scale = 1.0 / (dr * dr + di * di)
                fr, fi = dr * scale, -di * scale
                er, ei = 2 * a + damping[i], 2 * b
                qr, qi = fr * fr - fi * fi, 2 * fr * fi
                w = products[p, i]
                s0 += w * fr
                s1 += w * fi
                s2 -= w * (er * qr - ei * qi)
                s3 -= w * (er * qi + ei * qr)
            out[k, p, 0] = s0
            out[k, p, 1] = s1
            out[k, p, 2] = s2
            out[k, p, 3] = s3


@dataclass(frozen=True)
class Receptance:
    """H(λ) = G D(λ)⁻¹ Gᵀ and its derivative from a complete modal basis.

    real (r, n_real), general (r, n_poles): rows of G on the modes. pairs (2, p): which entries of
    the upper triangle are wanted; the others stay zero.
    """

    modes: UncoupledModes
    real: Array
    general: ComplexArray
    pairs: IntArray
    # What every evaluation needs, multiplied out once.
    _products: Array = field(init=False, repr=False, compare=False)
    _gains: ComplexArray = field(init=False, repr=False, compare=False)
    _damping: Array = field(init=False, repr=False, compare=False)
    _stiffness: Array = field(init=False, repr=False, compare=False)
    _poles: ComplexArray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        first, second = self.pairs
        products = self.real[first] * self.real[second]
        # Modes that no wanted entry sees would only divide by zero where a root crosses them.
        seen = np.flatnonzero(np.any(products != 0.0, axis=0))
        object.__setattr__(self, "_products", np.ascontiguousarray(products[:, seen]))
        object.__setattr__(self, "_gains", (self.general[first] * self.general[second]).T)
        object.__setattr__(self, "_damping", self.modes.damping[seen])
        object.__setattr__(self, "_stiffness", self.modes.stiffness[seen])
        object.__setattr__(self, "_poles", self.modes.poles)

    @property
    def sums(self) -> tuple[Array, Array, Array]:
        """Damping c (n,), stiffness ω² (n,) and products of rows (p, n) of the real modes that wanted entries see."""
        return self._damping, self._stiffness, self._products

    def __call__(self, lam: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """H and dH/dλ (k, r, r) at λ (k,)."""
        rows = self.real.shape[0]
        first, second = self.pairs
        value, slope = self.entries(lam)
        full = np.zeros((2, len(lam), rows, rows), dtype=complex)
        full[0][:, first, second] = full[0][:, second, first] = value
        full[1][:, first, second] = full[1][:, second, first] = slope
        return full[0], full[1]

    def entries(self, lam: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """The wanted entries of H and dH/dλ (k, p) at λ (k,)."""
        sums = np.empty((len(lam), self.pairs.shape[1], 4))
        real_mode_sums(
            np.ascontiguousarray(lam.real),
            np.ascontiguousarray(lam.imag),
            self._damping,
            self._stiffness,
            self._products,
            sums,
        )
        both = sums.view(complex)
        value, slope = both[..., 0], both[..., 1]
        if self.general.shape[1]:
            gain = self._gains
            # On a pole to the last bit this is not a number, as the sums over real modes are not; who asks sees it.
            with np.errstate(divide="ignore", invalid="ignore"):
                inverse = 1.0 / (lam[:, None] - self._poles)
                value = value + inverse @ gain
                slope = slope - inverse**2 @ gain
        return value, slope


def wanted_pairs(contacts: int, *, slip: bool) -> IntArray:
    """Entries (2, p) of H's upper triangle that T needs: without ``slip`` none of tangent with tangent."""
    first, second = np.triu_indices(2 * contacts)
    keep = np.ones(len(first), dtype=bool) if slip else ~((first % 2 == 1) & (second % 2 == 1))
    return np.array([first[keep], second[keep]])
