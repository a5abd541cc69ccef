"""Sparse direct solvers, each that is installed: the stiffness of an elastic block of eight-node hexahedra, and the pad
on a disc at a real and at a complex shift.

Factorising, then solving for one vector at a time and for 16 at once. --short: 12 000 instead of 100 000 freedoms, and
a coarse pad.
"""

from __future__ import annotations

import itertools
import time

import numpy as np
import scipy.sparse as sp

import stridor as st
from _common import COARSE, machine, options
from stridor import direct
from stridor.case import template_text


def element_stiffness(size: float, young_modulus: float, poisson_ratio: float) -> np.ndarray:
    """Stiffness (24, 24) [N/m] of a cube by 2 × 2 × 2 Gauss points, nodes in lexicographic order of their places."""
    lame = young_modulus * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio))
    shear = young_modulus / (2 * (1 + poisson_ratio))
    elasticity = np.diag([2 * shear] * 3 + [shear] * 3)
    elasticity[:3, :3] += lame
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    stiffness = np.zeros((24, 24))
    for point in corners / np.sqrt(3.0):
        terms = 1 + corners * point
        slopes = np.stack([corners[:, k] * np.delete(terms, k, axis=1).prod(axis=1) / 8 * (2 / size) for k in range(3)])
        strain = np.zeros((6, 24))
        for k in range(3):
            strain[k, k::3] = slopes[k]
        for row, (a, b) in enumerate(((0, 1), (1, 2), (0, 2)), start=3):
            strain[row, a::3], strain[row, b::3] = slopes[b], slopes[a]
        stiffness += strain.T @ elasticity @ strain * (size / 2) ** 3
    return stiffness


def block(cells: tuple[int, int, int], size: float = 1e-3) -> sp.csr_array:
    """Stiffness (csr) of cells[0] × cells[1] × cells[2] cubes of steel, held on the face z = 0."""
    shape = tuple(c + 1 for c in cells)
    number = np.arange(int(np.prod(shape))).reshape(shape)
    nodes = np.stack(
        [
            number[i : i + cells[0], j : j + cells[1], k : k + cells[2]].ravel()
            for i, j, k in itertools.product((0, 1), repeat=3)
        ],
        axis=1,
    )
    dofs = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 24)
    values = np.tile(element_stiffness(size, 200e9, 0.3).ravel(), len(nodes))
    rows, columns = np.repeat(dofs, 24, axis=1).ravel(), np.tile(dofs, (1, 24)).ravel()
    whole = sp.coo_array((values, (rows, columns)), shape=(3 * number.size,) * 2).tocsr()
    free = (3 * number[:, :, 1:].reshape(-1, 1) + np.arange(3)).ravel()
    free.sort()
    return sp.csr_array(whole[free][:, free])


def compare(title: str, matrix: sp.csr_array) -> None:
    """Factors of a symmetric matrix by each solver, then solutions alone and together."""
    n = matrix.shape[0]
    print(f"{title}, {n} freedoms, {matrix.nnz} entries")
    right = np.random.default_rng(0).standard_normal((n, 16)).astype(matrix.dtype)
    for solver in direct.available():
        started = time.perf_counter()
        with direct.factorise(matrix, symmetric=True, solver=solver) as factor:
            ready = time.perf_counter()
            for column in range(4):
                factor.solve(right[:, column])
            single = (time.perf_counter() - ready) / 4
            begun = time.perf_counter()
            factor.solve(right)
            many = (time.perf_counter() - begun) / 16
            print(
                f"  {solver:8s} factorise {ready - started:7.2f} s (of it {factor.seconds:.2f} s the factors),"
                f" solve {single:7.4f} s alone, {many:7.4f} s each of 16, {factor.memory_bytes / 1e6:6.0f} MB"
            )


def compare_pad(short: bool) -> None:
    """The shipped pad on a disc in contact without friction, at a shift in the middle of its band."""
    case = st.loads(template_text("pad-on-disc"))
    case = case.with_(COARSE) if short else case
    mass, damping, stiffness = st.pencil(case, 0.0).matrices()
    omega = np.pi * case.modal.max_frequency_hz
    real = sp.csr_array(stiffness - omega**2 * mass)
    compare("pad on disc, K − ω²M", real)
    compare("pad on disc, K + iωC − ω²M", sp.csr_array(real + 1j * omega * damping))


def main() -> None:
    short = options(__doc__ or "").short
    print(machine())
    compare("elastic block of hexahedra", block((15, 15, 15) if short else (32, 32, 30)))
    compare_pad(short)


if __name__ == "__main__":
    main()
