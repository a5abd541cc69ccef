"""Complex modes of an elastic pad on an elastic block, many contact nodes: projection against one solve for each μ.

python benchmarks/krylov_modes.py [--short] [--along CELLS]   (27 cells along the pad: about 50 000 freedoms)
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from stridor.contact.nodes import ContactNodes
from stridor.laws import Coulomb
from stridor.modal.krylov import direct_modes, krylov_modes, krylov_onsets
from stridor.system import System
from stridor.system.model import PrescribedMotion


@dataclass(frozen=True)
class Grid:
    """A block of hex8 cells: points (k, 3), mass and stiffness (3k, 3k)."""

    points: np.ndarray
    mass: Any
    stiffness: Any


def element(size: np.ndarray, modulus: float, ratio: float, density: float) -> tuple[np.ndarray, np.ndarray]:
    """Mass and stiffness (24, 24) of a rectangular hex8, 2 × 2 × 2 Gauss points."""
    corners = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], dtype=float)
    shear = modulus / (2 * (1 + ratio))
    lame = modulus * ratio / ((1 + ratio) * (1 - 2 * ratio))
    law = np.diag([2 * shear] * 3 + [shear] * 3)
    law[:3, :3] += lame
    mass, stiffness = np.zeros((2, 24, 24))
    volume = float(np.prod(size)) / 8
    for point in corners / np.sqrt(3):
        terms = 1 + corners * point
        shape = terms.prod(axis=1) / 8
        slopes = np.stack([corners[:, k] * np.delete(terms, k, axis=1).prod(axis=1) / 8 for k in range(3)])
        gx, gy, gz = slopes * (2 / size)[:, None]
        strain = np.zeros((6, 24))
        strain[0, 0::3], strain[1, 1::3], strain[2, 2::3] = gx, gy, gz
        strain[3, 0::3], strain[3, 1::3] = gy, gx
        strain[4, 1::3], strain[4, 2::3] = gz, gy
        strain[5, 0::3], strain[5, 2::3] = gz, gx
        stiffness += volume * strain.T @ law @ strain
        mass += volume * density * np.kron(np.outer(shape, shape), np.eye(3))
    return mass, stiffness


def grid(cells: tuple[int, int, int], length: tuple[float, float, float], **material: float) -> Grid:
    """A block with a corner at the origin."""
    nx, ny, nz = (c + 1 for c in cells)
    number = np.arange(nx * ny * nz).reshape(nz, ny, nx)
    places = [np.linspace(0, edge, c + 1) for edge, c in zip(length, cells, strict=True)]
    z, y, x = np.meshgrid(places[2], places[1], places[0], indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    corner = [
        number[c : c + nz - 1, b : b + ny - 1, a : a + nx - 1].ravel() for c in (0, 1) for b in (0, 1) for a in (0, 1)
    ]
    freedoms = (np.stack(corner, axis=1)[:, :, None] * 3 + np.arange(3)).reshape(-1, 24)
    size = np.array(length) / np.array(cells)
    mass, stiffness = element(size, **material)
    rows, columns = np.repeat(freedoms, 24, axis=1).ravel(), np.tile(freedoms, (1, 24)).ravel()

    def assembled(block: np.ndarray) -> Any:
        values = np.tile(block.ravel(), len(freedoms))
        return sp.csr_array(sp.coo_array((values, (rows, columns)), shape=(3 * len(points),) * 2).tocsr())

    return Grid(points, assembled(mass), assembled(stiffness))


@dataclass(frozen=True)
class HandMade:
    """As much of a surface contact as the modal approach reads."""

    name: str
    nodes: ContactNodes
    sliding: str = "small"


def pad_on_block(along: int, *, compliance: float = 0.0, damping: tuple[float, float] = (5.0, 1e-8)) -> System:
    """A pad held at its top, sliding along x on a block held at its bottom; nodes match. along: cells of the pad."""
    cell = 0.04 / along
    across, high = max(along // 2, 1), max(along // 3, 1)
    pad = grid((along, across, high), (0.04, across * cell, high * cell), modulus=8e9, ratio=0.3, density=2500.0)
    block = grid(
        (along + along // 2, across + 2, 2 * high), ((along + along // 2) * cell, (across + 2) * cell, 2 * high * cell),
        modulus=120e9, ratio=0.27, density=7200.0,
    )  # fmt: skip
    tall = block.points[:, 2].max()
    pad_points = pad.points + np.array([(along // 4) * cell, cell, tall])
    mass = sp.csr_array(sp.block_diag([block.mass, pad.mass]))
    stiffness = sp.csr_array(sp.block_diag([block.stiffness, pad.stiffness]))
    points = np.vstack([block.points, pad_points])
    held = (points[:, 2] < 1e-9) | (points[:, 2] > pad_points[:, 2].max() - 1e-9)
    free = np.flatnonzero(~np.repeat(held, 3))
    place = np.full(len(points) * 3, -1)
    place[free] = np.arange(len(free))
    slave = len(block.points) + np.flatnonzero(pad.points[:, 2] < 1e-9)
    top = np.flatnonzero(block.points[:, 2] > tall - 1e-9)
    master = top[[int(np.argmin(np.linalg.norm(points[top] - p, axis=1))) for p in points[slave]]]
    m, n = len(slave), len(free)

    def rows(axis: int) -> Any:
        row = np.concatenate([np.arange(m)] * 2)
        column = np.concatenate([place[3 * slave + axis], place[3 * master + axis]])
        return sp.csr_array((np.repeat([1.0, -1.0], m), (row, column)), shape=(m, n))

    order = np.arange(2 * m).reshape(2, m).T.ravel()
    tangent = sp.csr_array(sp.vstack([rows(0), rows(1)]).tocsr()[order])
    slip = np.zeros((2 * m, 1))
    slip[0::2] = 1.0
    nodes = ContactNodes(
        names=("pad",), owner=np.zeros(m, dtype=np.int64), laws=(Coulomb(0.4),), normal=rows(2), tangent=tangent,
        normal_lift=np.zeros((m, 1)), tangent_lift=slip, gap=np.zeros(m), area=np.full(m, cell**2),
        compliance=np.full(m, compliance), position=points[slave], normals=np.tile([0.0, 0.0, 1.0], (m, 1)),
        tangents=np.tile(np.eye(3)[:2], (m, 1, 1)),
    )  # fmt: skip
    mass, stiffness = (sp.csr_array(a[free][:, free]) for a in (mass, stiffness))
    none, one = np.zeros((n, 1)), np.zeros((1, 1))
    return System(
        mass, damping[0] * mass + damping[1] * stiffness, stiffness,
        motion=PrescribedMotion(("belt",), none, none, none, one, one, one),
        surfaces=(HandMade("pad", nodes),), dimension=3,  # type: ignore[arg-type]
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--short", action="store_true", help="a small model, for CI")
    parser.add_argument("--along", type=int, default=27, help="cells along the pad")
    chosen = parser.parse_args()
    system = pad_on_block(5 if chosen.short else chosen.along)
    count, frictions = (8, 4) if chosen.short else (50, 41)
    print(f"{system.size} freedoms, {system.contact_nodes().count} contact nodes")
    for damped in (True,) if chosen.short else (False, True):
        start = time.perf_counter()
        modes = krylov_modes(system, np.linspace(0.0, 1.0, frictions), count=count, damped=damped)
        spent = time.perf_counter() - start
        top = float(modes.frequency_hz.max())
        print(
            f"damped {damped}: {count} modes up to {top:.0f} Hz at {frictions} friction coefficients in {spent:.1f} s, "
            f"worst backward error {modes.residual.max():.1e}, largest growth {modes.growth_rate.max():.6g} 1/s"
        )
        start = time.perf_counter()
        found = krylov_onsets(system, (0.0, 1.0), max_frequency_hz=top, damped=damped)
        spent = time.perf_counter() - start
        worst = max((o.residual for o in found.onsets), default=0.0)
        print(f"  {len(found.onsets)} onsets in {spent:.1f} s, worst backward error {worst:.1e}")
        row = modes.at(0.5)
        mu = float(modes.mu[row])
        start = time.perf_counter()
        single = direct_modes(system, mu, shift_hz=top / 2, count=20, damped=damped)
        spent = time.perf_counter() - start
        far = np.abs(single.eigenvalues[:, None] - modes.eigenvalues[row]).min(axis=1) / np.abs(single.eigenvalues)
        inside = (single.eigenvalues.imag > 0) & (single.eigenvalues.imag < 0.95 * 2 * np.pi * top)
        print(f"  one solve at μ = {mu:.4g} for 20 modes: {spent:.1f} s, eigenvalues differ by {far[inside].max():.1e}")


if __name__ == "__main__":
    main()
