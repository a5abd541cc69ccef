"""Plane Euler–Bernoulli beam elements with traction, three freedoms per node (x, y, rotation)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..typing import Array, IntArray

DOF_PER_NODE = 3


@dataclass(frozen=True)
class BeamElement:
    """One straight prismatic element: what its matrices need, in SI units.

    length [m], axial_stiffness EA [N], bending_stiffness EI [N m²], line_density ρA [kg/m],
    direction (2,) unit vector of the axis in the plane.
    """

    length: float
    axial_stiffness: float
    bending_stiffness: float
    line_density: float
    direction: tuple[float, float]

    def rotation(self) -> Array:
        """Matrix (6, 6) from global to local freedoms (u axial, v lateral, θ) of both nodes."""
        c, s = self.direction
        node = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(np.kron(np.eye(2), node), dtype=float)

    def stiffness(self) -> Array:
        """Stiffness (6, 6) in global freedoms: linear traction, cubic (Hermite) bending."""
        h = self.length
        axial = self.axial_stiffness / h
        b = self.bending_stiffness / h**3
        local = np.zeros((6, 6))
        local[np.ix_(_AXIAL, _AXIAL)] = axial * np.array([[1.0, -1.0], [-1.0, 1.0]])
        local[np.ix_(_BENDING, _BENDING)] = b * np.array(
            [
                [12.0, 6 * h, -12.0, 6 * h],
                [6 * h, 4 * h * h, -6 * h, 2 * h * h],
                [-12.0, -6 * h, 12.0, -6 * h],
                [6 * h, 2 * h * h, -6 * h, 4 * h * h],
            ]
        )
        return self._to_global(local)

    def mass(self, *, lumped: bool = False) -> Array:
        """Mass (6, 6) in global freedoms, consistent or lumped.

        The lumped one follows Hinton, Rock and Zienkiewicz (1976): the diagonal of the consistent
        matrix, scaled per direction so that the translational mass of the element is kept. It is
        diagonal in any orientation because both translations of a node get the same mass.
        """
        h = self.length
        element_mass = self.line_density * h
        local = np.zeros((6, 6))
        if lumped:
            # HRZ: diagonals 156 and 4 h² over 420, scaled by 420/312 so that two halves make the mass.
            rotary = element_mass * 4 * h * h / 312.0
            np.fill_diagonal(local, np.tile([element_mass / 2, element_mass / 2, rotary], 2))
            return local
        local[np.ix_(_AXIAL, _AXIAL)] = element_mass / 6 * np.array([[2.0, 1.0], [1.0, 2.0]])
        local[np.ix_(_BENDING, _BENDING)] = (
            element_mass
            / 420
            * np.array(
                [
                    [156.0, 22 * h, 54.0, -13 * h],
                    [22 * h, 4 * h * h, 13 * h, -3 * h * h],
                    [54.0, 13 * h, 156.0, -22 * h],
                    [-13 * h, -3 * h * h, -22 * h, 4 * h * h],
                ]
            )
        )
        return self._to_global(local)

    def interpolation(self, xi: float) -> Array:
        """Rows (3, 6): displacement x, y [m] and rotation [rad] at ``xi`` in [0, 1] from nodal freedoms."""
        h = self.length
        c, s = self.direction
        local = np.zeros((3, 6))
        local[0, [0, 3]] = 1 - xi, xi
        local[1, _BENDING] = (
            1 - 3 * xi**2 + 2 * xi**3,
            h * (xi - 2 * xi**2 + xi**3),
            3 * xi**2 - 2 * xi**3,
            h * (xi**3 - xi**2),
        )
        local[2, _BENDING] = (
            (6 * xi**2 - 6 * xi) / h,
            1 - 4 * xi + 3 * xi**2,
            (6 * xi - 6 * xi**2) / h,
            3 * xi**2 - 2 * xi,
        )
        to_global = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return to_global @ local @ self.rotation()

    def _to_global(self, local: Array) -> Array:
        rotation = self.rotation()
        return rotation.T @ local @ rotation


_AXIAL = [0, 3]
_BENDING = [1, 2, 4, 5]


@dataclass(frozen=True)
class BeamMesh:
    """A straight beam cut into equal elements: start (2,) [m], elements ≥ 1, one element repeated."""

    start: tuple[float, float]
    elements: int
    element: BeamElement

    @property
    def length(self) -> float:
        """Length of the beam [m]."""
        return self.elements * self.element.length

    def coordinates(self) -> Array:
        """Node positions (elements + 1, 2) [m]."""
        distance = np.arange(self.elements + 1) * self.element.length
        coordinates = np.asarray(self.start) + distance[:, None] * np.asarray(self.element.direction)
        return np.asarray(coordinates, dtype=float)

    def node_at(self, distance: float) -> int | None:
        """Node whose distance from the start is ``distance`` [m], or None between nodes."""
        number = distance / self.element.length
        nearest = round(number)
        return nearest if abs(number - nearest) < 1e-6 and 0 <= nearest <= self.elements else None

    def interpolation(self, distance: float) -> tuple[IntArray, Array]:
        """Freedoms (6,) of the body and rows (3, 6) that give x, y, rotation at ``distance`` [m]."""
        number = min(max(distance / self.element.length, 0.0), float(self.elements))
        nearest = round(number)
        if abs(number - nearest) < 1e-9:
            number = float(nearest)
        element = min(int(number), self.elements - 1)
        freedoms = DOF_PER_NODE * element + np.arange(6)
        return freedoms, self.element.interpolation(number - element)
