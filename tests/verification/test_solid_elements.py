"""Matrices of solid bodies against scikit-fem's own assembly, closed forms, NAFEMS FV32 and convergence orders."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp
import skfem
from scipy.optimize import brentq
from scipy.sparse.linalg import eigsh
from skfem.helpers import dot
from skfem.models.elasticity import lame_parameters, linear_elasticity, plane_stress

from stridor.errors import CaseError
from stridor.fe.elements import element
from stridor.fe.solid import SolidMatrices, assemble_solid, stress_stiffness, wave_speeds
from stridor.laws import Material
from stridor.mesh.model import PLANE_KINDS, SOLID_KINDS, Mesh

pytestmark = pytest.mark.verification

STEEL = Material(young_modulus=200e9, density=8000.0, poisson_ratio=0.3)
KINDS = (*PLANE_KINDS, *SOLID_KINDS)
QUADRATIC = ("triangle6", "quad8", "quad9", "tetra10", "hexahedron20", "hexahedron27")


# -- meshes -----------------------------------------------------------------------------------------------------------
# A box of unit cells, simplices cut from them; every node as a mean of corners, on a lattice of half cells.
SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]
CUBE = [(x, y, z) for z in (0, 1) for x, y in SQUARE]
TRIANGLES = [[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]]
TETRAHEDRA = [  # Kuhn: one for each order of walking along the axes; the odd orders turn the other way, two nodes swap
    [(0, 0, 0), tuple(np.eye(3, dtype=int)[a]), tuple(np.eye(3, dtype=int)[[a, b]].sum(axis=0)), (1, 1, 1)]
    for a, b, _ in itertools.permutations(range(3))
]
TETRAHEDRA = [[t[0], t[1], t[3], t[2]] if np.linalg.det(np.array(t[1:])) < 0 else t for t in TETRAHEDRA]
EDGES = {
    "triangle": [(0, 1), (1, 2), (2, 0)],
    "quad": [(0, 1), (1, 2), (2, 3), (3, 0)],
    "tetra": [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
    "hexahedron": [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)],
}
FACES = [(0, 3, 7, 4), (1, 2, 6, 5), (0, 1, 5, 4), (3, 2, 6, 7), (0, 1, 2, 3), (4, 5, 6, 7)]
CELLS = {
    "triangle": TRIANGLES,
    "quad": [SQUARE],
    "tetra": TETRAHEDRA,
    "hexahedron": [CUBE],
}


def family(kind: str) -> str:
    return kind.rstrip("0123456789")


def doubled_nodes(kind: str, corners: np.ndarray) -> np.ndarray:
    """Nodes of a cell on the lattice of half cells."""
    groups = [(i,) for i in range(len(corners))]
    if kind != family(kind):
        groups += EDGES[family(kind)]
    if kind == "hexahedron27":
        groups += FACES
    if kind in ("quad9", "hexahedron27"):
        groups.append(tuple(range(len(corners))))
    return np.array([2 * corners[list(g)].sum(axis=0) // len(g) for g in groups])


def box(
    kind: str, counts: tuple[int, ...], place: Callable[[np.ndarray], np.ndarray] | None = None, seed: int = 7
) -> Mesh:
    """Unit box of cells of one kind, nodes numbered at random, moved by place: (k, d) in [0, 1] → (k, d)."""
    cells = [
        doubled_nodes(kind, np.array(corners) + np.array(origin))
        for origin in itertools.product(*map(range, counts))
        for corners in CELLS[family(kind)]
    ]
    lattice, numbers = np.unique(np.concatenate(cells), axis=0, return_inverse=True)
    order = np.random.default_rng(seed).permutation(len(lattice))
    points = np.empty(lattice.shape)
    points[order] = lattice / (2.0 * np.array(counts))
    connectivity = order[numbers.reshape(len(cells), -1)]
    return Mesh(points if place is None else place(points), {kind: connectivity})


def dimension(kind: str) -> int:
    return 2 if kind in PLANE_KINDS else 3


def model_of(kind: str) -> str:
    return "plane strain" if kind in PLANE_KINDS else "3d"


def small(kind: str) -> tuple[int, ...]:
    return (2, 3) if dimension(kind) == 2 else (2, 1, 2)


def scaled(*lengths: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda x: x * np.array(lengths)


def distorted(mesh: Mesh, amount: float = 0.08) -> Mesh:
    """Corners moved at random, the other nodes to the means of their corners: straight-edged cells of any shape."""
    ((kind, cells),) = mesh.cells.items()
    corners = len(CELLS[family(kind)][0])
    points = mesh.points.copy()
    vertices = np.unique(cells[:, :corners])
    points[vertices] += amount * np.random.default_rng(3).uniform(-1, 1, (len(vertices), mesh.dimension))
    groups = [] if kind == family(kind) else [*EDGES[family(kind)]]
    groups += FACES if kind == "hexahedron27" else []
    groups += [tuple(range(corners))] if kind in ("quad9", "hexahedron27") else []
    for i, g in enumerate(groups):
        points[cells[:, corners + i]] = points[cells[:, list(g)]].mean(axis=1)
    return replace(mesh, points=points)


def curved(x: np.ndarray) -> np.ndarray:
    """A map that every quadratic kind contains (x y, x y z and squares alone), so that its geometry is exactly this."""
    out = x + 0.15 * np.roll(x, 1, axis=1) ** 2 - 0.1 * x**2
    return out + 0.1 * x[:, [0]] * np.array([0.0, 1.0, 2.0])[: x.shape[1]]


# -- helpers ----------------------------------------------------------------------------------------------------------
def held(matrices: SolidMatrices, freedoms: np.ndarray) -> tuple[sp.csr_array, sp.csr_array]:
    free = np.setdiff1d(np.arange(matrices.mass.shape[0]), freedoms)
    return matrices.mass[free][:, free], matrices.stiffness[free][:, free]


def frequencies(mass: sp.csr_array, stiffness: sp.csr_array, count: int, above: float = 0.0) -> np.ndarray:
    """The lowest frequencies [Hz], those of rigid motions included; the shift is a little below zero."""
    shift = -((2 * math.pi * above) ** 2)
    values = eigsh(stiffness.tocsc(), count, mass.tocsc(), sigma=shift, return_eigenvectors=False)
    return np.sqrt(np.maximum(np.sort(values), 0.0)) / (2 * math.pi)


def where(mesh: Mesh, condition: np.ndarray, *directions: int) -> np.ndarray:
    """Freedoms of the nodes where `condition` holds, in the directions."""
    return (np.flatnonzero(condition)[:, None] * mesh.dimension + np.array(directions)).ravel()


def rigid_motions(points: np.ndarray) -> np.ndarray:
    """Columns (k d, 3 or 6): translations, then rotations about the origin."""
    d = points.shape[1]
    motions = [np.tile(np.eye(d)[i], len(points)) for i in range(d)]
    for i, j in itertools.combinations(range(d), 2):
        turn = np.zeros((d, d))
        turn[i, j], turn[j, i] = -1.0, 1.0
        motions.append((points @ turn.T).ravel())
    return np.array(motions).T


# -- against the library's own assembly --------------------------------------------------------------------------------
LIBRARY = {
    "triangle": (skfem.MeshTri, None, skfem.ElementTriP1),
    "triangle6": (skfem.MeshTri, skfem.MeshTri2, skfem.ElementTriP2),
    "quad": (skfem.MeshQuad, None, skfem.ElementQuad1),
    "quad8": (skfem.MeshQuad, skfem.MeshQuad2, skfem.ElementQuadS2),
    "quad9": (skfem.MeshQuad, skfem.MeshQuad2, skfem.ElementQuad2),
    "tetra": (skfem.MeshTet, None, skfem.ElementTetP1),
    "tetra10": (skfem.MeshTet, skfem.MeshTet2, skfem.ElementTetP2),
    "hexahedron": (skfem.MeshHex, None, skfem.ElementHex1),
    "hexahedron20": (skfem.MeshHex, skfem.MeshHex2, skfem.ElementHexS2),
    "hexahedron27": (skfem.MeshHex, skfem.MeshHex2, skfem.ElementHex2),
}


@skfem.BilinearForm
def mass_form(u, v, _):
    return dot(u, v)


@skfem.BilinearForm
def stress_form(u, v, w):
    """∫ σ_ij ∂_i u_k ∂_j v_k for λ = 2, μ = 3."""
    slope = w["moved"].grad
    stress = 2.0 * np.einsum("kk...,ij->ij...", slope, np.eye(len(slope)))
    stress = stress + 3.0 * (slope + np.swapaxes(slope, 0, 1))
    return np.einsum("ij...,ki...,kj...->...", stress, u.grad, v.grad)


class Library:
    """The library's bases on the geometry of `mesh` (points before `place`), and the way back to its numbering.

    Only corners are handed over; nodes are matched by their places before the library's own mesh is bent.
    """

    def __init__(self, kind: str, mesh: Mesh, place: Callable[[np.ndarray], np.ndarray]) -> None:
        straight, quadratic, shape = LIBRARY[kind]
        corners = mesh.cells[kind][:, : len(CELLS[family(kind)][0])]
        if family(kind) == "hexahedron":  # the library's order of corners
            at = [(1, 1, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)]
            corners = corners[:, [CUBE.index(c) for c in at]]
        vertices, numbers = np.unique(corners, return_inverse=True)
        plain = straight(mesh.points[vertices].T, numbers.reshape(corners.shape).T)
        bent = plain if quadratic is None else quadratic.from_mesh(plain)
        self.bent = replace(bent, doflocs=place(bent.doflocs.T).T)
        self.shape = skfem.ElementVector(shape())
        basis = skfem.Basis(plain, self.shape, intorder=1)
        direction = np.empty(basis.N, dtype=int)
        for local, freedoms in enumerate(basis.element_dofs):
            direction[freedoms] = local % mesh.dimension
        number = {tuple(np.round(4096 * p).astype(int)): i for i, p in enumerate(mesh.points)}
        node = np.array([number[tuple(np.round(4096 * p).astype(int))] for p in basis.doflocs.T])
        self.freedom = mesh.dimension * node + direction

    def basis(self, degree: int) -> skfem.Basis:
        return skfem.Basis(self.bent, self.shape, intorder=degree)

    def ours(self, matrix: sp.csr_array) -> sp.csr_array:
        move = sp.csr_array((np.ones(len(self.freedom)), (self.freedom, np.arange(len(self.freedom)))))
        return move @ matrix @ move.T


def bending_of(kind: str) -> Callable[[np.ndarray], np.ndarray]:
    return curved if kind in QUADRATIC else lambda x: x + 0.1 * np.roll(x, 1, axis=1) * x


MODELS = [(kind, model) for kind in PLANE_KINDS for model in ("plane stress", "plane strain")]
MODELS += [(kind, "3d") for kind in SOLID_KINDS]


@pytest.mark.parametrize(("kind", "model"), MODELS)
def test_matrices_are_those_of_the_library(kind: str, model: str) -> None:
    mesh, bent, rules = box(kind, small(kind)), bending_of(kind), element(kind)
    thickness = 1.0 if model == "3d" else 0.3
    made = assemble_solid(replace(mesh, points=bent(mesh.points)), STEEL, model=model, thickness=thickness)
    young, nu = STEEL.young_modulus, STEEL.poisson_ratio
    lame, shear = plane_stress(young, nu) if model == "plane stress" else lame_parameters(young, nu)
    library = Library(kind, mesh, bent)
    stiffness = library.ours(linear_elasticity(lame, shear).assemble(library.basis(rules.stiffness.degree)))
    mass = library.ours(mass_form.assemble(library.basis(rules.mass.degree)))
    assert abs(made.mass - thickness * STEEL.density * mass).max() < 1e-13 * abs(made.mass).max()
    assert abs(made.stiffness - thickness * stiffness).max() < 1e-12 * abs(made.stiffness).max()
    assert (made.stiffness != made.stiffness.T).nnz == 0
    assert (made.mass != made.mass.T).nnz == 0


@pytest.mark.parametrize("kind", KINDS)
def test_stress_stiffness_is_that_of_the_library(kind: str) -> None:
    mesh, bent, degree = box(kind, small(kind)), bending_of(kind), element(kind).stiffness.degree
    displacement = np.random.default_rng(2).standard_normal(mesh.points.size)
    # λ = 2, μ = 3
    material = Material(young_modulus=3 * (3 * 2 + 2 * 3) / (2 + 3), density=1.0, poisson_ratio=2 / (2 * (2 + 3)))
    bent_mesh = replace(mesh, points=bent(mesh.points))
    made = stress_stiffness(bent_mesh, material, model=model_of(kind), displacement=displacement)
    library = Library(kind, mesh, bent)
    basis = library.basis(degree)
    reference = library.ours(stress_form.assemble(basis, moved=basis.interpolate(displacement[library.freedom])))
    assert abs(made - reference).max() < 1e-12 * abs(made).max()
    assert (made != made.T).nnz == 0
    translations = rigid_motions(mesh.points)[:, : mesh.dimension]
    assert np.abs(made @ translations).max() < 1e-12 * abs(made).max()


# -- states known exactly ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("kind", KINDS)
def test_constant_strain_is_reproduced(kind: str) -> None:
    """The patch test: no force on inner nodes, and the energy of the exact stress, on cells of any shape."""
    d = dimension(kind)
    regular = box(kind, (2,) * d)
    mesh = distorted(regular)
    gradient = np.random.default_rng(4).standard_normal((d, d))
    displacement = (mesh.points @ gradient.T + 0.3).ravel()
    made = assemble_solid(mesh, STEEL, model=model_of(kind), thickness=2.0)
    force = made.stiffness @ displacement
    inside = np.flatnonzero(np.all((regular.points > 0) & (regular.points < 1), axis=1))
    assert len(inside) > 0
    assert np.abs(force.reshape(-1, d)[inside]).max() < 1e-12 * np.abs(force).max()
    strain = 0.5 * (gradient + gradient.T)
    lame, shear = lame_parameters(STEEL.young_modulus, STEEL.poisson_ratio)
    stress = lame * np.trace(strain) * np.eye(d) + 2 * shear * strain
    volume = made.mass.sum() / STEEL.density / d  # thickness included
    assert displacement @ force == pytest.approx(volume * np.sum(stress * strain), rel=1e-12)
    # Second-order strain of another linear field under that stress: V σ : HᵀH.
    other = np.random.default_rng(5).standard_normal((d, d))
    field = (mesh.points @ other.T).ravel()
    geometric = stress_stiffness(mesh, STEEL, model=model_of(kind), thickness=2.0, displacement=displacement)
    assert field @ geometric @ field == pytest.approx(volume * np.sum(stress * (other.T @ other)), rel=1e-11)


def test_plane_stress_has_no_stress_across() -> None:
    """A strip drawn along x is as stiff as E, and narrows by ν."""
    mesh = distorted(box("quad8", (2, 2)))
    made = assemble_solid(mesh, STEEL, model="plane stress")
    strain = np.diag([1.0, -STEEL.poisson_ratio])
    displacement = (mesh.points @ strain).ravel()
    area = made.mass.sum() / STEEL.density / 2
    energy = displacement @ made.stiffness @ displacement
    assert energy == pytest.approx(area * STEEL.young_modulus, rel=1e-12)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("cells", [1, 2])
def test_only_rigid_motions_have_no_energy(kind: str, cells: int) -> None:
    mesh = distorted(box(kind, (cells,) + (1,) * (dimension(kind) - 1)))
    made = assemble_solid(mesh, STEEL, model=model_of(kind))
    values = sl.eigvalsh(made.stiffness.toarray())
    rigid = 3 if mesh.dimension == 2 else 6
    assert np.abs(values[:rigid]).max() < 1e-13 * values[-1]
    assert values[rigid] > 1e-4 * values[-1]
    motions = rigid_motions(mesh.points)
    assert np.abs(made.stiffness @ motions).max() < 1e-13 * abs(made.stiffness).max()
    assert sl.eigvalsh(made.mass.toarray())[0] > 0


@pytest.mark.parametrize("kind", KINDS)
def test_mass_and_inertia_are_those_of_the_body(kind: str) -> None:
    """A sheared box whose inner corners are anywhere: its moments follow from those of the unit box."""
    d = dimension(kind)
    regular = box(kind, (3,) * d)
    inner = np.all((regular.points > 0) & (regular.points < 1), axis=1)
    moved = distorted(regular, 0.06)
    # Outer corners back to their places, then the nodes between them again to the means.
    points = distorted(replace(regular, points=np.where(inner[:, None], moved.points, regular.points)), 0.0).points
    shape = np.eye(d) + 0.4 * np.random.default_rng(6).standard_normal((d, d))
    mesh = Mesh(points @ shape.T, regular.cells)
    made = assemble_solid(mesh, STEEL, model=model_of(kind))
    total = STEEL.density * abs(np.linalg.det(shape))
    second = shape @ (np.eye(d) / 12 + 1 / 4) @ shape.T  # mean of x xᵀ
    for i, j in itertools.product(range(d), range(d)):
        gradient = np.zeros((d, d))
        gradient[i, j] = 1.0
        field = (mesh.points @ gradient.T).ravel()
        assert field @ made.mass @ field == pytest.approx(total * second[j, j], rel=1e-12)
    turning = rigid_motions(mesh.points)[:, d]
    assert turning @ made.mass @ turning == pytest.approx(total * (second[0, 0] + second[1, 1]), rel=1e-12)
    assert made.mass.sum() == pytest.approx(d * total, rel=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_lumped_masses_are_positive_and_keep_the_mass(kind: str) -> None:
    d = dimension(kind)
    mesh = distorted(box(kind, small(kind)))
    consistent = assemble_solid(mesh, STEEL, model=model_of(kind), thickness=0.1)
    lumped = assemble_solid(mesh, STEEL, model=model_of(kind), thickness=0.1, lumped=True)
    assert lumped.mass.nnz == mesh.points.size
    diagonal = lumped.mass.diagonal()
    assert diagonal.min() > 0
    assert diagonal.sum() == pytest.approx(consistent.mass.sum(), rel=1e-13)
    assert np.array_equal(diagonal.reshape(-1, d), np.repeat(diagonal[::d, None], d, axis=1))
    assert abs(lumped.stiffness - consistent.stiffness).max() == 0
    if kind == "quad8":  # the diagonal of a square's consistent mass is 6 : 32 (corner : middle)
        one = assemble_solid(box(kind, (1, 1)), STEEL, model="plane stress", lumped=True).mass.diagonal()[::2]
        assert np.sort(one) / one.sum() == pytest.approx([3 / 76] * 4 + [16 / 76] * 4, rel=1e-12)


def ring(kind: str, count: int) -> Mesh:
    """Half a ring, radii 1 and 2, extruded by 0.5 in space."""

    def place(x: np.ndarray) -> np.ndarray:
        radius, angle = 1 + x[:, 0], math.pi * x[:, 1]
        return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 0.5 * x[:, 2:]])

    return box(kind, (1, count) + (1,) * (dimension(kind) - 2), place)


@pytest.mark.parametrize("kind", QUADRATIC)
def test_curved_edges_follow_a_ring_to_fourth_order(kind: str) -> None:
    volume = 1.5 * math.pi * (1.0 if dimension(kind) == 2 else 0.5)
    errors = []
    for count in (4, 8, 16):
        mass = assemble_solid(ring(kind, count), STEEL, model=model_of(kind)).mass
        errors.append(abs(mass.sum() / STEEL.density / dimension(kind) / volume - 1))
    assert np.diff(np.log2(errors)) == pytest.approx(-4, abs=0.2)
    assert errors[-1] < 1e-4


def test_nodes_in_one_place_stay_apart() -> None:
    """Two bodies whose faces coincide (a contact, a crack) are not joined."""
    one = box("hexahedron20", (1, 1, 1))
    other = Mesh(one.points + np.array([1.0, 0.0, 0.0]), one.cells)
    count = len(one.points)
    both = Mesh(
        np.concatenate([one.points, other.points]),
        {"hexahedron20": np.concatenate([one.cells["hexahedron20"], other.cells["hexahedron20"] + count])},
    )
    made = assemble_solid(both, STEEL, model="3d")
    alone = assemble_solid(one, STEEL, model="3d")
    expected = sp.block_diag([alone.stiffness, alone.stiffness])
    assert abs(made.stiffness - expected).max() < 1e-12 * abs(expected).max()
    assert made.stiffness[: 3 * count][:, 3 * count :].nnz == 0


def test_kinds_may_be_mixed() -> None:
    """The patch test with quad8, quad9 and triangle6 side by side."""
    regular = box("quad9", (3, 2))
    mesh = distorted(regular, 0.06)
    cells = mesh.cells["quad9"]
    split = [(0, 1, 2, 4, 5, 8), (0, 2, 3, 8, 6, 7)]
    bare = np.setdiff1d(np.arange(len(mesh.points)), cells[:2, 8])
    number = np.full(len(mesh.points), -1)
    number[bare] = np.arange(len(bare))
    mixed = Mesh(
        mesh.points[bare],
        {
            "quad8": number[cells[:2, :8]],
            "triangle6": number[np.concatenate([cells[2:4][:, list(t)] for t in split])],
            "quad9": number[cells[4:]],
        },
    )
    displacement = (mixed.points @ np.array([[0.3, -0.2], [0.5, 0.1]])).ravel()
    inside = np.all((regular.points[bare] > 0) & (regular.points[bare] < 1), axis=1)
    made = assemble_solid(mixed, STEEL, model="plane stress")
    whole = assemble_solid(mesh, STEEL, model="plane stress")
    force = made.stiffness @ displacement
    assert np.abs(force.reshape(-1, 2)[inside]).max() < 1e-12 * np.abs(force).max()
    assert made.mass.sum() == pytest.approx(whole.mass.sum(), rel=1e-13)
    values = sl.eigvalsh(made.stiffness.toarray())
    assert (np.abs(values) < 1e-13 * values[-1]).sum() == 3


# -- frequencies -------------------------------------------------------------------------------------------------------
def test_tapered_membrane_of_nafems() -> None:
    """FV32, Abbassian, Dawswell and Knowles 1987, Selected Benchmarks for Natural Frequency Analysis."""

    def place(x: np.ndarray) -> np.ndarray:
        return np.column_stack([10 * x[:, 0], (x[:, 1] - 0.5) * (5 - 4 * x[:, 0])])

    mesh = box("quad8", (16, 8), place)
    made = assemble_solid(mesh, STEEL, model="plane stress", thickness=0.05)
    found = frequencies(*held(made, where(mesh, mesh.points[:, 0] < 1e-9, 0, 1)), 6, above=10.0)
    assert found == pytest.approx([44.62, 130.0, 162.7, 246.0, 379.8, 391.4], rel=2e-3)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("wave", ["shear", "pressure"])
def test_frequencies_converge_at_the_order_of_the_element(kind: str, wave: str) -> None:
    """A square whose edges slide on rigid walls, in space one layer of cells between two more: plane waves.

    Shear: the curl of sin πx sin πy, ω = √2 π c_s. Pressure: u_x = sin πx, ω = π c_p. In plane stress both are the
    lowest of their kind; the mode is found by its shape.
    """
    errors = [wave_frequency_error(kind, wave, count)[0] for count in (4, 8)]
    assert min(errors) > 0  # consistent mass, full integration: from above
    assert math.log2(errors[0] / errors[1]) == pytest.approx(2 if kind == family(kind) else 4, abs=0.25)


def wave_frequency_error(kind: str, wave: str, count: int, tension: float = 0.0) -> tuple[float, float]:
    """Relative error of the frequency, and by how much ω² rises with a stress σ_xx = tension [Pa], times ρ / tension."""
    d = dimension(kind)
    model = "plane stress" if d == 2 else "3d"
    pressure, shear = wave_speeds(STEEL, model)
    mesh = box(kind, (count, count, 1)[:d], scaled(1.0, 1.0, 1.0 / count) if d == 3 else None)
    x, end = mesh.points, mesh.points.max(axis=0)
    walls = np.concatenate([where(mesh, (x[:, i] < 1e-9) | (x[:, i] > end[i] - 1e-9), i) for i in range(d)])
    free = np.setdiff1d(np.arange(x.size), walls)
    made = assemble_solid(mesh, STEEL, model=model)
    field = np.zeros(x.shape)
    field[:, 0] = np.sin(math.pi * x[:, 0]) * (np.cos(math.pi * x[:, 1]) if wave == "shear" else 1.0)
    if wave == "shear":
        field[:, 1] = -np.cos(math.pi * x[:, 0]) * np.sin(math.pi * x[:, 1])
    exact = math.sqrt(2) * math.pi * shear if wave == "shear" else math.pi * pressure
    strain = np.diag([1.0, -STEEL.poisson_ratio, -STEEL.poisson_ratio][:d]) * tension / STEEL.young_modulus
    geometric = stress_stiffness(mesh, STEEL, model=model, displacement=(x @ strain).ravel())

    def squared(stiffness: sp.csr_array) -> float:
        values, modes = eigsh(
            stiffness[free][:, free].tocsc(), 4, made.mass[free][:, free].tocsc(), sigma=(0.99 * exact) ** 2
        )
        return values[np.abs(modes.T @ made.mass[free] @ field.ravel()).argmax()]

    still = squared(made.stiffness)
    risen = squared(made.stiffness + geometric) - still
    return math.sqrt(still) / exact - 1, risen * STEEL.density / tension if tension else 0.0


@pytest.mark.parametrize("kind", KINDS)
def test_tension_raises_the_frequency_of_a_wave(kind: str) -> None:
    """σ_xx adds σ_xx k_x² / ρ to ω² of a wave of number k_x: the string's law in a solid."""
    linear = kind == family(kind)
    _, risen = wave_frequency_error(kind, "shear", 8 if linear else 4, tension=1e9)
    assert risen == pytest.approx(math.pi**2, rel=0.05 if linear else 0.01)


# A bar of the reference cases: length 1, height 0.02, 210 GPa, 7800 kg/m³. Without ν its clamped end is not stiffened by
# the contraction it holds, as in the theory of beams.
HEIGHT = 0.02
WIDTH = 0.01
BAR = Material(young_modulus=210e9, density=7800.0, poisson_ratio=0.0)


def bar(kind: str, counts: tuple[int, ...]) -> tuple[Mesh, SolidMatrices]:
    mesh = box(kind, counts, scaled(*(1.0, HEIGHT, WIDTH)[: len(counts)]))
    model = "plane stress" if mesh.dimension == 2 else "3d"
    return mesh, assemble_solid(mesh, BAR, model=model, thickness=WIDTH)


def timoshenko_cantilever(count: int) -> list[float]:
    """Frequencies [Hz] with shear (coefficient 10 (1 + ν) / (12 + 11 ν), Cowper 1966) and rotary inertia."""
    area, second = WIDTH * HEIGHT, WIDTH * HEIGHT**3 / 12
    shear_stiffness = 10 / 12 * BAR.young_modulus / 2 * area

    def determinant(frequency: float) -> float:
        inertia = (2 * math.pi * frequency) ** 2 * BAR.density
        along = np.zeros((4, 4))  # of deflection, rotation, moment, shear force
        along[0, 1], along[0, 3] = 1.0, 1.0 / shear_stiffness
        along[1, 2] = 1.0 / (BAR.young_modulus * second)
        along[2, 1], along[2, 3] = -inertia * second, -1.0
        along[3, 0] = -inertia * area
        return float(np.linalg.det(sl.expm(along)[2:, 2:]))

    grid = np.linspace(5.0, 320.0, 200)
    signs = [determinant(f) for f in grid]
    roots = [brentq(determinant, *grid[i : i + 2]) for i in range(len(grid) - 1) if signs[i] * signs[i + 1] < 0]
    return roots[:count]


@pytest.mark.parametrize(("kind", "counts"), [("quad8", (60, 2)), ("hexahedron20", (60, 2, 2))])
def test_slender_cantilever(kind: str, counts: tuple[int, ...]) -> None:
    """Euler–Bernoulli: 16.7638, 105.057, 294.163 Hz. At a slenderness of 50 shear and rotary inertia take 0.4 % off the
    third, so that is asked of Timoshenko's beam."""
    mesh, made = bar(kind, counts)
    x = mesh.points
    fixed = where(mesh, x[:, 0] < 1e-9, *range(mesh.dimension))
    if mesh.dimension == 3:  # the middle plane moves in bending across the width only: that is held
        fixed = np.union1d(fixed, where(mesh, np.abs(x[:, 2] - WIDTH / 2) < 1e-9, 2))
    found = frequencies(*held(made, fixed), 3)
    assert found == pytest.approx(timoshenko_cantilever(3), rel=1.5e-4)
    assert found[:2] == pytest.approx([16.7638, 105.057], rel=3e-3)
    assert found[2] == pytest.approx(294.163, rel=4.5e-3)


def test_tension_raises_the_frequencies_of_a_beam() -> None:
    """Simply supported: ω² rises by (n π / L)² N / (ρ A)."""
    mesh, made = bar("quad8", (40, 2))
    x = mesh.points
    stress = 1e8
    displacement = (x @ np.diag([stress / BAR.young_modulus, 0.0])).ravel()
    geometric = stress_stiffness(mesh, BAR, model="plane stress", thickness=WIDTH, displacement=displacement)
    ends = where(mesh, (x[:, 0] < 1e-9) | (x[:, 0] > 1 - 1e-9), 1)
    middle = where(mesh, (np.abs(x[:, 0] - 0.5) < 1e-9) & (np.abs(x[:, 1] - HEIGHT / 2) < 1e-9), 0)
    supports = np.union1d(ends, middle)
    still = frequencies(*held(made, supports), 3)
    risen = frequencies(*held(SolidMatrices(made.mass, made.stiffness + geometric), supports), 3)
    expected = [(n * math.pi) ** 2 * stress / BAR.density for n in (1, 2, 3)]
    assert (2 * math.pi) ** 2 * (risen**2 - still**2) == pytest.approx(expected, rel=4e-3)
    assert (risen[0] / still[0]) ** 2 > 2


def test_a_strut_buckles_under_the_load_of_euler() -> None:
    mesh, made = bar("quad8", (40, 2))
    x = mesh.points
    free = np.setdiff1d(np.arange(x.size), where(mesh, x[:, 0] < 1e-9, 0, 1))
    squeezed = (x @ np.diag([-1.0 / BAR.young_modulus, 0.0])).ravel()  # 1 Pa
    geometric = stress_stiffness(mesh, BAR, model="plane stress", thickness=WIDTH, displacement=squeezed)
    stiffness = made.stiffness[free][:, free].tocsc()
    largest = eigsh(-geometric[free][:, free].tocsc(), 1, stiffness, which="LA", return_eigenvectors=False)[0]
    assert 1 / largest == pytest.approx(math.pi**2 / 4 * BAR.young_modulus * HEIGHT**2 / 12, rel=1e-3)


def test_thick_plate_on_its_lateral_faces() -> None:
    """10 × 10 × 1, u_z = 0 on four faces: three motions in its plane are free, and frequencies come from above."""
    reference = np.array([44.18, 107.33, 107.33, 163.15, 193.66, 203.30])
    errors = []
    for counts in [(6, 6, 1), (12, 12, 2)]:
        mesh = box("hexahedron20", counts, scaled(10.0, 10.0, 1.0))
        sides = np.any((mesh.points[:, :2] < 1e-9) | (mesh.points[:, :2] > 10 - 1e-9), axis=1)
        made = assemble_solid(mesh, STEEL, model="3d")
        found = frequencies(*held(made, where(mesh, sides, 2)), 9, above=5.0)
        assert found[:3].max() < 1e-3
        errors.append(found[3:] / reference - 1)
    assert np.all(errors[1] > 0)
    assert np.all(errors[1] < errors[0])
    assert errors[1].max() < 3e-3


# -- what is refused ---------------------------------------------------------------------------------------------------
def test_cells_turned_the_other_way_round_are_the_same_body() -> None:
    mesh = distorted(box("quad8", (2, 2)))
    back = Mesh(mesh.points, {"quad8": mesh.cells["quad8"][:, [0, 3, 2, 1, 7, 6, 5, 4]]})
    one, other = (assemble_solid(m, STEEL, model="plane stress") for m in (mesh, back))
    assert abs(one.stiffness - other.stiffness).max() < 1e-13 * abs(one.stiffness).max()
    assert abs(one.mass - other.mass).max() < 1e-13 * abs(one.mass).max()


def refusal(mesh: Mesh, material: Material = STEEL, model: str = "plane stress", thickness: float = 1.0) -> str:
    with pytest.raises(CaseError) as caught:
        assemble_solid(mesh, material, model=model, thickness=thickness)
    return str(caught.value)


def test_what_cannot_be_assembled_is_refused() -> None:
    mesh = box("quad", (2, 1), seed=0)
    crossed = replace(mesh, cells={"quad": mesh.cells["quad"][:, [0, 2, 1, 3]]}, source="pad.msh")
    folded = "this cell around (0.25, 0.5) m is flat or folds over itself; check the order of its nodes (VTK's), nodes that coincide, and how far the nodes between corners have moved"
    assert refusal(crossed) == f"pad.msh: 'quad 0' – {folded}"
    assert refusal(replace(mesh, points=mesh.points * [1.0, 0.0])).endswith(
        folded.replace("0.25, 0.5", "0.25, 0")[-100:]
    )
    line = np.array([0.1, 0.3, 0.9])[:, None] * [1.0, 1 / 3]  # its area is 0 but for rounding
    assert "is flat" in refusal(Mesh(line, {"triangle": np.array([[0, 1, 2]])}))
    assert refusal(mesh, model="3d") == "mesh: '2 coordinates a point' – model '3d' needs 3"
    assert (
        refusal(mesh, model="membrane")
        == "model: 'membrane' – no such model; there are: plane stress, plane strain, 3d"
    )
    assert (
        refusal(Mesh(mesh.points, {"line": mesh.cells["quad"][:, :2]}))
        == "mesh: 'cells line' – model 'plane stress' takes: triangle, triangle6, quad, quad8, quad9"
    )
    assert refusal(Mesh(mesh.points, {})).startswith("mesh: 'no cells' – model 'plane stress' needs some of: triangle,")
    short = Mesh(mesh.points, {"quad8": mesh.cells["quad"]})
    assert refusal(short) == "mesh: 'an array of shape (2, 4)' – cells quad8 have 8 nodes each"
    beyond = Mesh(mesh.points[:4], mesh.cells)
    assert refusal(beyond) == "mesh: 'cells quad with nodes 0 to 5' – the mesh has nodes 0 to 3"
    assert refusal(mesh, thickness=0.0) == "thickness: 0.0 – the thickness of a plane body is positive [m]"
    assert "below 0.5" in refusal(mesh, replace(STEEL, poisson_ratio=0.5), model="plane strain")
    assemble_solid(mesh, replace(STEEL, poisson_ratio=0.5), model="plane stress")
    everything = refusal(mesh, Material(young_modulus=0.0, density=math.nan, poisson_ratio=0.6))
    assert [line.split(":")[0] for line in everything.splitlines()] == [
        "material.young_modulus",
        "material.density",
        "material.poisson_ratio",
    ]
    with pytest.raises(CaseError, match=r"material\.density"):
        wave_speeds(replace(STEEL, density=-1.0), "3d")
    with pytest.raises(ValueError, match="12 freedoms"):
        stress_stiffness(mesh, STEEL, model="plane stress", displacement=np.zeros(6))
