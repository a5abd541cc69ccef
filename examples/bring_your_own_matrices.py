"""Matrices of your own: a system of NumPy arrays, and its eigenvalue problem handed to another solver.

The minimal model again, K = [[2, 1 − 4μ/3], [1, 2]], of nothing but arrays. `st.pencil` gives M,
C(μ), K(μ) as SciPy arrays: SciPy's dense solver finds the same eigenvalues, and at μ = 3/4 the same
double root λ = √2 j.
"""

import numpy as np
import scipy.linalg
from matplotlib import pyplot as plt

import stridor as st

friction = {"law": "coulomb", "coefficient": 0.5}
rub = {"normal": {1: 1.0}, "tangent": {0: 1.0}, "stiffness": 4 / 3, "friction": friction}
system = st.System.from_matrices(np.eye(2), 0.01 * np.eye(2), [[2, 1], [1, 2 - 4 / 3]], contacts={"rub": rub})


def eigenvalues(mu):
    mass, damping, stiffness = (matrix.toarray() for matrix in st.pencil(system, mu).matrices())
    state = np.block(
        [[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)]]
    )
    return scipy.linalg.eigvals(state)


# By hand: λ² + 0.01 λ + 2 ∓ √(1 − 4μ/3) = 0.
values = eigenvalues(1.0)
by_hand = [np.roots([1, 0.01, 2 - root]) for root in (1j / 3**0.5, -1j / 3**0.5)]
assert np.allclose(np.sort_complex(values), np.sort_complex(np.concatenate(by_hand)), atol=1e-12)

figure, ax = plt.subplots(figsize=(6, 4), layout="constrained")
for mu in np.linspace(0, 1, 41):
    found = eigenvalues(mu)
    upper = found[found.imag > 0]
    drawn = ax.scatter(upper.real, upper.imag, c=[mu] * len(upper), vmin=0, vmax=1, s=12)
ax.axvline(0, color="k", linewidth=0.8)
ax.set(
    xlabel="growth rate Re λ",
    ylabel="angular frequency Im λ",
    title="Eigenvalues by SciPy, from the matrices of st.pencil",
)
figure.colorbar(drawn, label="friction coefficient μ")
figure.savefig("bring_your_own_matrices.png", dpi=80)
