"""All modes in a band, against shift-invert written by hand with the same factors: a gyroscopic, circulatory block of
two sizes, and the pad on the disc.

python benchmarks/quadratic_modes.py [--short]   (about 4 500 and 50 000 freedoms; --short: 500 only)
"""

from __future__ import annotations

import resource
import time
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

import stridor as st
from _common import machine, options
from krylov_modes import grid
from stridor.case import template_text
from stridor.direct import factorise
from stridor.modal.parametric import contact_parameters
from stridor.modal.quadratic import Quadratic, Region, RegionModes, find_modes
from stridor.modal.quadratic.krylov import times


def block(cells: tuple[int, int, int], spin: float = 300.0, friction: float = 0.05) -> Quadratic:
    """A steel block held at one end, spinning about z at ``spin`` [rad/s]; its free end is pressed on by springs whose
    force has a part across, which makes the stiffness unsymmetric.
    """
    length = (0.2, 0.1, 0.09)
    part = grid(cells, length, modulus=2.1e11, ratio=0.3, density=7800.0)
    free = np.flatnonzero(~np.repeat(part.points[:, 0] < 1e-9, 3))
    mass, stiffness = (sp.csr_array(a[free][:, free]) for a in (part.mass, part.stiffness))
    points = len(free) // 3
    turn = sp.kron(sp.eye_array(points), np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    end = np.repeat(part.points[:, 0] > length[0] - 1e-9, 3)[free] & (np.arange(len(free)) % 3 == 1)
    rows = np.flatnonzero(end)
    spring = friction * float(stiffness.diagonal().mean())
    across = sp.coo_array((np.full(len(rows), spring), (rows, rows + 1)), shape=mass.shape)
    damping = 2 * spin * (mass @ turn) + 20.0 * mass + 2e-8 * stiffness
    return Quadratic(mass, sp.csr_array(damping), sp.csr_array(stiffness + across))


def by_hand(problem: Quadratic, shift: complex, radius: float, count: int) -> dict[str, Any]:
    """ARPACK on the same linearisation, told how many eigenvalues there are, at the loosest tolerance that does."""
    n = problem.size
    start = time.perf_counter()
    with factorise(problem.at(shift)) as factor:
        built = time.perf_counter() - start
        for tolerance in (1e-5, 1e-7, 1e-9):
            solves = 0

            def apply(pair: np.ndarray) -> np.ndarray:
                nonlocal solves
                solves += 1
                u, w = pair.reshape(2, n, 1)
                force = times(problem.mass, 2 * shift * radius * u + radius**2 * w)
                force = force + radius * times(problem.damping, u)
                return np.concatenate([-factor.solve(force[:, 0], refine=False), u[:, 0]])

            start = time.perf_counter()
            operator = spl.LinearOperator((2 * n, 2 * n), matvec=apply, dtype=complex)
            theta, vectors = spl.eigs(operator, k=count, tol=tolerance, v0=np.ones(2 * n, dtype=complex))
            spent = time.perf_counter() - start
            lam = shift + radius / theta
            error = problem.backward_error(lam, np.asfortranarray(vectors[:n])).max()
            if error <= 1e-10:
                break
        return {"seconds": built + spent, "solves": solves, "error": error, "values": lam, "tolerance": tolerance}


def compare(name: str, problem: Quadratic, region: Region, neighbour: Quadratic) -> None:
    found: RegionModes = find_modes(problem, region)
    disc = found.completeness.discs[0]
    print(
        f"{name}, {problem.size} freedoms, {len(found.values)} modes up to {region.im_max / 2 / np.pi:g} Hz: "
        f"{found.seconds:.2f} s, {found.factorisations} factorisations, {found.solves} solves, factors "
        f"{found.memory_bytes / 1e6:.0f} MB, process {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3:.0f} "
        f"MB, worst backward error {found.residual.max():.1e}"
    )
    print(f"  {found.completeness.sentence}")
    hand = by_hand(problem, disc.centre, disc.radius, disc.count)
    away = np.abs(found.values[:, None] - hand["values"]).min(axis=1).max() / np.abs(found.values).max()
    print(
        f"  eigs for the disc's {disc.count}: {hand['seconds']:.2f} s, {hand['solves']} solves, tol "
        f"{hand['tolerance']:g}, worst backward error {hand['error']:.1e}, eigenvalues differ by {away:.1e}"
    )
    print(f"  ratio find_modes / by hand: {found.seconds / hand['seconds']:.2f}")
    both = find_modes(problem, region, left=True)
    print(f"  with left vectors {both.seconds:.2f} s, worst backward error {both.left_residual.max():.1e}")  # type: ignore[union-attr]
    known = find_modes(neighbour, region)
    guessed = find_modes(problem, region, guess=known.right)
    print(f"  from the shapes of a neighbouring problem: {guessed.seconds:.2f} s, {guessed.solves} solves")


def compare_block(cells: tuple[int, int, int], top_hz: float) -> None:
    region = Region.band(0.0, top_hz, above=-2000.0, below=2000.0)
    compare("block", block(cells), region, block(cells, spin=310.0, friction=0.052))


def compare_pad() -> None:
    case = st.loads(template_text("pad-on-disc"))
    problem = contact_parameters(st.build_system(case), (0.0, 0.6), (0.5, 2.0))
    region = Region.band(1.0, case.modal.max_frequency_hz, above=-500.0)
    compare("pad on disc", problem.at(problem.reference), region, problem.at({"mu": 0.32}))


def main() -> None:
    chosen = options(__doc__ or "")
    print(machine())
    compare_block((6, 5, 4) if chosen.short else (15, 10, 8), 40e3)
    if not chosen.short:
        compare_block((35, 22, 20), 40e3)
        compare_pad()


if __name__ == "__main__":
    main()
