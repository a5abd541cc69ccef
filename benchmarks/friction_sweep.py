"""A sweep of 500 friction coefficients, 20 damped modes with residuals, against 500 dense eigensolves.

The alternative is what one writes first: scipy.linalg.eig on the damped state matrix at every μ. In
--short mode 3 of the 500 dense solves are timed and scaled up, and the output says so.
"""

from __future__ import annotations

import time

import numpy as np
import scipy.linalg as sl

import stridor as st
from _common import bench, best, machine, options
from stridor.modal.complex_modes import complex_modes


def dense(system: st.System, mu: float) -> np.ndarray:
    """Eigenvalues of the damped state matrix at μ, with the vectors that a residual needs."""
    contact = system.contacts[0]
    n, t = contact.normal_row, contact.tangent_row
    stiffness = system.stiffness.toarray() + contact.stiffness * np.outer(n + mu * t, n)
    inverse = np.linalg.inv(system.mass.toarray())
    size = system.size
    state = np.block(
        [
            [np.zeros((size, size)), np.eye(size)],
            [-inverse @ stiffness, -inverse @ system.damping.toarray()],
        ]
    )
    return sl.eig(state)[0]


def main() -> None:
    args = options(__doc__ or "")
    system = st.build_system(bench())
    values = np.linspace(0.0, 0.5, 500)
    ours, result = best(lambda: complex_modes(system, values, count=20), repeats=5)
    solved = 3 if args.short else len(values)
    started = time.perf_counter()
    worst = 0.0
    for k in np.linspace(0, len(values) - 1, solved).astype(int):
        reference = dense(system, float(values[k]))
        for lam in result.eigenvalues[k]:
            worst = max(worst, float(np.min(np.abs(reference - lam)) / abs(lam)))
    each = (time.perf_counter() - started) / solved
    scaled = "" if solved == len(values) else f" ({solved} solved, scaled)"
    print(f"sweep of 500 friction coefficients, 20 modes, damped, {system.size} degrees of freedom ({machine()})")
    print(f"  500 dense eigensolves    {each * len(values):8.2f} s, {each:.3f} s each{scaled}")
    print(f"  stridor                  {ours:8.3f} s, largest residual {result.residual.max():.1e} (best of 5)")
    print(f"  ratio                    {each * len(values) / ours:8.0f}")
    print(f"  largest difference in λ  {worst:8.1e} relative (the dense solver's own error included)")


if __name__ == "__main__":
    main()
