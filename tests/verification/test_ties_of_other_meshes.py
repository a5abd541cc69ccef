"""Ties whose meshes do not match: constant stress passes through, whichever side is the slave, edges held or not."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse.linalg as spl

import stridor as st
from stridor.case import loads

STEEL = "[materials.steel]\nyoung_modulus = 200e9\ndensity = 8000.0\npoisson_ratio = 0.3\n"
PLANE = ("quad", "triangle", "quad8", "quad9", "triangle6")
SPACE = ("hexahedron", "tetra", "tetra10", "hexahedron20", "hexahedron27")
SIZE = np.array([0.05, 0.04, 0.03])


def body(name: str, start: float, cells: str, divisions: list[int], mass: str = "consistent") -> str:
    d = len(divisions)
    corner, size = [start, 0.0, 0.0][:d], SIZE[:d].tolist()
    shape = "rectangle" if d == 2 else "block"
    model = "plane stress" if d == 2 else "3d"
    thickness = "thickness = 0.01\n" if d == 2 else ""
    return (
        f'[bodies.{name}]\ntype = "solid"\nmaterial = "steel"\nmodel = "{model}"\nmass = "{mass}"\n{thickness}'
        f'mesh = {{ shape = "{shape}", corner = {corner}, size = {size}, divisions = {divisions}, cells = "{cells}" }}\n'
    )


def held(dimension: int, ends: bool = True) -> str:
    """Planes of symmetry: x at the left end, the lowest y and z of both bodies."""
    sides = [("a", "left", "x")] if ends else []
    for name in ("a", "b"):
        sides += [(name, "bottom", "y" if dimension == 2 else "z")] + ([(name, "front", "y")] if dimension == 3 else [])
    return "".join(f'[supports.{n}-{s}]\nat = "{n}.{s}"\nfixed = ["{x}"]\n' for n, s, x in sides)


def tied(slave: str) -> str:
    ends = ("a.right", "b.left") if slave == "a" else ("b.left", "a.right")
    return f'[ties.glue]\nslave = "{ends[0]}"\nmaster = "{ends[1]}"\n'


def of_random_meshes(seed: int, dimension: int) -> tuple[str, tuple[str, str]]:
    rng = np.random.default_rng(seed)
    kinds = PLANE if dimension == 2 else SPACE
    text = STEEL
    for name, start in (("a", 0.0), ("b", float(SIZE[0]))):
        divisions = [1, *(int(n) for n in rng.integers(1, 7 if dimension == 2 else 4, dimension - 1))]
        text += body(name, start, str(rng.choice(kinds)), divisions)
    return text


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("seed", range(12))
def test_constant_stress_passes_through(seed: int, dimension: int) -> None:
    """Stresses along all axes: u_i = (σ_i − ν Σ σ_j) x_i / E everywhere, edges of the slave held as on planes of symmetry."""
    text = of_random_meshes(seed, dimension)
    stress = np.array([1.0, -0.6, 0.4])[:dimension] * 1e6
    sides = [("b", "right", 0)]
    for name in ("a", "b"):
        sides += [(name, "top", dimension - 1)] + ([(name, "back", 1)] if dimension == 3 else [])
    text += "".join(
        f'[loads.{name}-{side}]\nat = "{name}.{side}"\npressure = {-stress[axis]}\n' for name, side, axis in sides
    )
    strain = (1.3 * stress - 0.3 * stress.sum()) / 200e9
    for slave in ("a", "b"):
        system = st.build_system(loads(text + held(dimension) + tied(slave)))
        assert not system.tie_words
        found = np.linalg.solve(system.stiffness.toarray(), sum(system.loads.values()))
        for solid in system.solids:
            moved = (solid.rows.free @ found).reshape(solid.points.shape)
            assert moved == pytest.approx(solid.points * strain, abs=1e-9 * np.abs(strain).max() * SIZE.max())


@pytest.mark.parametrize(("height", "uncovered"), [(0.0, 0), (5e-5, 0), (2e-4, 2), (2e-3, 2)])
def test_slaves_whose_facets_the_master_does_not_cover_are_told(height: float, uncovered: int) -> None:
    """By `check`, with modes and with runs, from one per cent of a facet on."""
    slave = body("b", float(SIZE[0]), PLANE[0], [1, 4], "lumped")
    top = [float(size) for size in SIZE[:2]]
    wide = slave.replace(f"size = [{top[0]}, {top[1]}]", f"size = [{top[0]}, {top[1] + height}]")
    assert (wide == slave) is (height == 0.0)
    text = STEEL + body("a", 0.0, PLANE[0], [1, 3], "lumped") + wide + held(2) + tied("b") + "tolerance = 0.01\n"
    case = loads(f'{text}[loads.pull]\nat = "b.right"\npressure = -1e5\n[[phases]]\nname = "a"\nduration = 1e-5\n')
    said = () if not uncovered else (
        f"ties.glue: {uncovered} of 5 slave nodes belong to facets that the master does not cover; each follows the point "
        "below it, which passes no even stress where meshes differ",
    )  # fmt: skip
    assert st.build_system(case).tie_words == said
    modes, run = st.modes(case, 0.0, max_frequency_hz=1e5), st.simulate(case)
    for notes in (st.describe(case).warnings, modes.notes, run.notes):
        assert [note for note in notes if note.startswith("ties.glue: ")] == list(said)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("seed", range(4))
def test_free_bodies_move_rigidly_without_force(seed: int, dimension: int) -> None:
    for slave in ("a", "b"):
        system = st.build_system(loads(of_random_meshes(seed + 20, dimension) + tied(slave)))
        stiffness = system.stiffness.toarray()
        values = np.abs(np.linalg.eigvalsh(stiffness))
        count = 3 if dimension == 2 else 6
        values.sort()
        assert values[count - 1] < 1e-12 * values[-1]
        assert values[count] > 1e-7 * values[-1]


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
def test_the_mass_stays(mass: str) -> None:
    text = STEEL + body("a", 0.0, "quad8", [2, 3], mass) + body("b", 0.05, "quad", [2, 5], mass)
    for slave in ("a", "b"):
        system = st.build_system(loads(text + tied(slave)))
        for axis in ("x", "y"):
            along = np.array([1.0 if name.endswith(f" {axis}") else 0.0 for name in system.dof_names])
            assert along @ system.mass @ along == pytest.approx(8000.0 * 0.01 * 0.1 * 0.04, rel=1e-12)


def test_frequencies_converge_to_those_of_one_body() -> None:
    """A cantilever cut in two, coarse and fine, against one mesh as fine: the order of neither side spoils it."""
    def omegas(text: str) -> np.ndarray:
        system = st.build_system(loads(STEEL + text + '[supports.wall]\nat = "a.left"\nfixed = ["x", "y"]\n'))
        return np.sqrt(sl.eigh(system.stiffness.toarray(), system.mass.toarray(), eigvals_only=True)[:4])

    whole = body("a", 0.0, "quad8", [20, 8]).replace("size = [0.05", "size = [0.1")
    exact = omegas(whole)
    for slave in ("a", "b"):
        text = body("a", 0.0, "quad8", [6, 4]) + body("b", 0.05, "quad8", [6, 5]) + tied(slave)
        assert omegas(text) == pytest.approx(exact, rel=1.5e-3)


RING = """
[bodies.{0}]
type = "solid"
material = "steel"
model = "plane strain"
mass = "consistent"
mesh = {{ shape = "annulus", inner_radius = {1}, outer_radius = {2}, divisions = {3}, cells = "{4}" }}
"""


@pytest.mark.parametrize("cells", ["quad", pytest.param("quad8", marks=pytest.mark.slow)])
def test_rings_of_other_divisions_are_one_ring(cells: str) -> None:
    """Curved, closed ties: no worse than one ring as coarse as the coarser side, against a fine one."""
    def omegas(text: str) -> np.ndarray:
        system = st.build_system(loads(STEEL + text))
        # Shifted to where nothing is singular: of a free ring the stiffness is.
        found = spl.eigsh(system.stiffness.tocsc(), 11, system.mass.tocsc(), sigma=-1e6, return_eigenvectors=False)
        return np.sqrt(np.abs(np.sort(found)))

    exact = omegas(RING.format("whole", 0.05, 0.1, "[6, 80]", "quad8"))
    coarse = omegas(RING.format("whole", 0.05, 0.1, "[4, 32]", cells))
    assert np.all(coarse[3:] > exact[3:])
    for slave, master in (("a.outer", "b.inner"), ("b.inner", "a.outer")):
        text = RING.format("a", 0.05, 0.075, "[2, 40]", cells) + RING.format("b", 0.075, 0.1, "[2, 32]", cells)
        two = omegas(text + f'[ties.glue]\nslave = "{slave}"\nmaster = "{master}"\n')
        # Turning strains a little what is apart by the heights of chords, 0.2 and 0.4 mm of linear facets.
        assert two[:3].max() < (5e-3 if cells == "quad" else 5e-5) * two[3]
        assert np.all(two[3:] - exact[3:] < 1.02 * (coarse[3:] - exact[3:]))
        assert np.all(two[3:] > exact[3:] * (1.0 - 1e-4))


def test_matching_meshes_are_tied_node_to_node() -> None:
    """Rows of the slave are those of one node of the master, exactly."""
    for cells, divisions in (("quad8", [2, 3]), ("hexahedron20", [1, 2, 2])):
        text = STEEL + body("a", 0.0, cells, divisions) + body("b", 0.05, cells, divisions) + tied("b")
        system = st.build_system(loads(text))
        entries = system.solids[1].rows.free.data
        assert np.all(entries == 1.0)


DISC = """
[bodies.{0}]
type = "solid"
material = "steel"
model = "3d"
mass = "consistent"
mesh = {{ shape = "disc", centre = [0.0, 0.0, 0.0], inner_radius = {1}, outer_radius = {2}, thickness = 0.02, divisions = {3}, cells = "{4}" }}
"""


@pytest.mark.parametrize("cells", ["hexahedron20", "tetra10", pytest.param("hexahedron27", marks=pytest.mark.slow)])
def test_discs_of_other_divisions_are_one_disc(cells: str) -> None:
    """Ties on quadratic faces of 36° and 45°, whose middles lie on each other where no facet between their nodes does:
    no worse than one disc as coarse as the coarser side, against a fine one."""
    def omegas(text: str) -> np.ndarray:
        system = st.build_system(loads(STEEL + text))
        found = spl.eigsh(system.stiffness.tocsc(), 14, system.mass.tocsc(), sigma=-1e6, return_eigenvectors=False)
        return np.sqrt(np.abs(np.sort(found)))

    exact = omegas(DISC.format("whole", 0.03, 0.09, "[4, 24, 1]", "hexahedron20"))[6:]
    coarse = omegas(DISC.format("whole", 0.03, 0.09, "[2, 8, 1]", cells))[6:]
    for slave, master in (("b.inner", "a.outer"), ("a.outer", "b.inner")):
        text = DISC.format("a", 0.03, 0.06, "[1, 10, 1]", cells) + DISC.format("b", 0.06, 0.09, "[1, 8, 1]", cells)
        two = omegas(text + f'[ties.glue]\nslave = "{slave}"\nmaster = "{master}"\n')
        # Turning strains a little what two parabolas through other nodes of a circle are apart.
        assert two[:6].max() < 3e-3 * two[6]
        assert np.all(two[6:] - exact < 1.02 * (coarse - exact))
        assert np.all(two[6:] > exact * (1.0 - 1e-4))
