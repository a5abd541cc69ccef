"""The slope that simultaneous iteration takes off, against its sums written out."""

from __future__ import annotations

import numpy as np

from stridor.modal.deflation import deflation


def test_deflation_is_the_sum_over_poles_and_other_roots():
    rng = np.random.default_rng(4)
    roots = -rng.uniform(0, 1, 6) + 1j * rng.uniform(1, 9, 6)
    roots[4] = -3.0
    implied = roots.imag != 0
    stiffness, damping = rng.uniform(0.1, 50, 5), rng.uniform(0, 9, 5)
    general = rng.standard_normal(3) + 1j * rng.standard_normal(3)
    index = np.array([0, 4, 5])
    expected = []
    for k in index:
        lam = roots[k]
        poles = [*np.concatenate([np.roots([1, c, w]) for c, w in zip(damping, stiffness, strict=True)]), *general]
        others = [*np.delete(roots, k), *np.conj(roots[implied])]
        expected.append(sum(1 / (lam - p) for p in poles) - sum(1 / (lam - o) for o in others))
    np.testing.assert_allclose(deflation(roots, implied, index, (stiffness, damping), general), expected, rtol=1e-12)


def test_deflation_on_a_pole_is_no_number():
    roots = np.array([2j, 5j])
    at = deflation(roots, roots.imag != 0, np.array([0]), (np.array([4.0]), np.zeros(1)), np.zeros(0, dtype=complex))
    assert not np.isfinite(at[0])
