"""Mesh files of solids that will not do, each with the exact message that the author of the case gets."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest

import stridor as st
from program import stridor
from stridor.case import Case, load
from stridor.errors import AnalysisError, CaseError
from stridor.mesh import shapes
from stridor.mesh.model import Mesh
from stridor.mesh.paths import shown_path
from stridor.system import build_system

pytestmark = pytest.mark.bad_input

PLANE = """
[materials.steel]
young_modulus = 200e9
density = 7800.0

[bodies.slider]
type = "solid"
model = "plane stress"
material = "steel"
thickness = 0.01
file = "FILE"

[bodies.rail]
type = "solid"
model = "plane stress"
material = "steel"
thickness = 0.01
mesh = { shape = "rectangle", corner = [0.0, 0.0], size = [0.06, 0.01], divisions = [12, 2], cells = "quad" }

[supports.ground]
at = "rail.bottom"
fixed = ["x", "y"]
velocity = { x = 0.1 }

[supports.guide]
at = "slider.left"
fixed = ["x"]

[loads.press]
at = "slider.top"
pressure = 1e6

[contacts.rub]
slave = "slider.bottom"
master = "rail.top"
stiffness = 1e13
friction = { law = "coulomb", coefficient = 0.2 }
"""
SPACE = """
materials.steel = { young_modulus = 200e9, density = 7800.0 }
[bodies.slider]
type = "solid"
model = "3d"
material = "steel"
file = "FILE"
"""
HOW_TO_NAME = "in Gmsh name them with Physical Curve (plane) or Physical Surface (solid), in Abaqus with *SURFACE or *NSET"
ABAQUS_CELLS = "CPS3, CPE3, CPS4, CPE4, CPS6, CPE6, CPS8, CPE8, C3D4, C3D8, C3D10, C3D20"

SHEET = shapes.rectangle((0.02, 0.01), (0.02, 0.01), (4, 2))
POINTS, QUADS = SHEET.points, SHEET.cells["quad"]
BLOCK = shapes.block((0.0, 0.0, 0.0), (0.01, 0.01, 0.01), (2, 1, 1))
BRICKS = BLOCK.cells["hexahedron"]
UPSIDE_DOWN = [4, 5, 6, 7, 0, 1, 2, 3]


def with_cell(cells: np.ndarray, number: int, order: list[int]) -> np.ndarray:
    """Cells of which one has its nodes in another order."""
    found = cells.copy()
    found[number] = found[number][order]
    return found


def named(mesh: Mesh) -> str:
    """The boundaries of a sheet as surfaces of an input file, and a set of two nodes that are no side."""
    text = "*NSET, NSET=two\n1, 15\n"
    for name in ("left", "bottom", "top"):
        inside = mesh.boundary_nodes(name)
        text += f"*SURFACE, NAME={name}\n"
        for number, cell in enumerate(mesh.cells["quad"]):
            for face in range(4):
                if cell[face] in inside and cell[(face + 1) % 4] in inside:
                    text += f"{number + 1}, S{face + 1}\n"
    return text


def inp(points: np.ndarray, cells: np.ndarray, kind: str = "CPS4", rest: str = "") -> str:
    """An input file for Abaqus."""
    rows = [f"{k + 1}, " + ", ".join(repr(float(x)) for x in point) for k, point in enumerate(points)]
    elements = [f"{k + 1}, " + ", ".join(str(int(n) + 1) for n in cell) for k, cell in enumerate(cells)]
    return "\n".join(["*NODE", *rows, f"*ELEMENT, TYPE={kind}, ELSET=body", *elements, rest])


def msh(path: Path, points: np.ndarray, cells: np.ndarray, kind: str = "quad", *, groups: bool = True) -> None:
    """A Gmsh file with the boundaries of the sheet, or without any group."""
    blocks = [(kind, cells)]
    names = [("body", points.shape[1])]
    if kind == "quad" and groups:
        blocks += [("line", SHEET.boundaries[name]["line"]) for name in ("left", "bottom", "top")]
        names += [(name, 1) for name in ("left", "bottom", "top")]
    tags = [np.full(len(block), k + 1 if groups else 0) for k, (_, block) in enumerate(blocks)]
    mesh = meshio.Mesh(
        np.pad(points, ((0, 0), (0, 3 - points.shape[1]))),
        blocks,
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": [np.full(len(t), 1) for t in tags]},
        field_data={name: np.array([k + 1, d]) for k, (name, d) in enumerate(names)} if groups else {},
    )
    meshio.write(path, mesh, file_format="gmsh22", binary=False)


def material(name: str, modulus: float) -> str:
    return f"*MATERIAL, NAME={name}\n*ELASTIC\n{modulus}, 0.3\n*DENSITY\n7800.0\n"


GOOD = inp(POINTS, QUADS, rest=named(SHEET))
TWO_MATERIALS = (
    f"{GOOD}*ELSET, ELSET=a\n1, 2, 3, 4\n*ELSET, ELSET=b\n5, 6, 7, 8\n{material('ST', 2e11)}{material('AL', 7e10)}"
    "*SOLID SECTION, ELSET=a, MATERIAL=ST\n0.01\n*SOLID SECTION, ELSET=b, MATERIAL=AL\n0.01\n"
)
ONE_MATERIAL = f"{GOOD}{material('ST', 2e11)}*SOLID SECTION, ELSET=body, MATERIAL=ST\n0.01\n"
MERGED = POINTS.copy()
MERGED[SHEET.boundary_nodes("bottom")[1]] = MERGED[SHEET.boundary_nodes("bottom")[0]]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Where case and mesh files lie."""
    return tmp_path


def case_of(folder: Path, name: str, text: str = PLANE, edits: dict[str, str] | None = None) -> Case:
    """The case with a mesh file of that name, with pieces of its text replaced."""
    text = text.replace("FILE", name)
    for there, instead in (edits or {}).items():
        assert text.count(there) == 1
        text = text.replace(there, instead)
    path = folder / "case.toml"
    path.write_text(text)
    return load(path)


def told(make: Callable[[], Case]) -> list[str]:
    """The lines that a case is refused with."""
    with pytest.raises(CaseError) as caught:
        build_system(make())
    return str(caught.value).split("\n")


def test_the_sound_files_are_sound(folder: Path) -> None:
    (folder / "good.inp").write_text(GOOD)
    msh(folder / "good.msh", POINTS, QUADS)
    for name in ("good.inp", "good.msh"):
        assert st.describe(case_of(folder, name)).warnings == ()


# -- files that are none -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["a.msh", "a.vtu", "a.vtk", "a.inp"])
def test_files_that_hold_nothing(folder: Path, name: str) -> None:
    where = f"bodies.slider.file: '{shown_path(folder / name)}'"
    assert told(lambda: case_of(folder, name)) == [f"{where} – no such file"]
    (folder / name).touch()
    assert told(lambda: case_of(folder, name)) == [f"{where} – the file is empty (0 bytes)"]
    (folder / name).unlink()
    (folder / name).mkdir()
    assert told(lambda: case_of(folder, name)) == [
        f"{where} – is a folder; must be a mesh file: {'.inp' if name == 'a.inp' else '.msh, .vtk, .vtu, .inp'}"
    ]


def test_a_file_of_another_kind(folder: Path) -> None:
    (folder / "a.stl").write_text("solid")
    assert told(lambda: case_of(folder, "a.stl")) == [
        f"bodies.slider.file: '{shown_path(folder / 'a.stl')}' – is a surface of triangles and no mesh yet; accepted: .msh, "
        ".vtk, .vtu, .inp; mesh it in Gmsh, name boundaries and body, export it as .msh"
    ]
    (folder / "a.txt").write_text("solid")
    assert told(lambda: case_of(folder, "a.txt")) == [
        f"bodies.slider.file: '{shown_path(folder / 'a.txt')}' – is no mesh file by its suffix; accepted: .msh, .vtk, "
        ".vtu, .inp"
    ]


NOISE = {
    "a.msh": "has no $MeshFormat: it is no mesh of Gmsh's, or of a format before 2; export it from Gmsh as 4.1 or 2.2",
    "a.vtu": "is not readable as a VTK XML unstructured grid",
    "a.vtk": "is not readable as a legacy VTK unstructured grid",
}


@pytest.mark.parametrize("name", NOISE)
def test_files_of_noise(folder: Path, name: str) -> None:
    noise = np.random.default_rng(0).integers(0, 256, 2000, dtype=np.uint8).tobytes()
    (folder / name).write_bytes(b"\xff" + noise)
    (found,) = told(lambda: case_of(folder, name))
    assert found.startswith(f"bodies.slider.file: '{shown_path(folder / name)}' – {NOISE[name]}")


def test_a_reader_that_gives_no_reason(folder: Path) -> None:
    head = '<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid/>'
    (folder / "a.vtu").write_text(f'{head}<AppendedData encoding="base64">x</AppendedData></VTKFile>')
    (found,) = told(lambda: case_of(folder, "a.vtu"))
    assert found.endswith(
        "is not readable as a VTK XML unstructured grid: its reader gives no reason; it is cut short or damaged, or of a "
        "kind that is not read"
    )


def test_an_input_file_of_noise(folder: Path) -> None:
    (folder / "a.inp").write_bytes(np.random.default_rng(0).integers(0, 256, 2000, dtype=np.uint8).tobytes())
    assert told(lambda: case_of(folder, "a.inp")) == ["a.inp: cannot be read: not a text file"]


def test_files_that_break_off(folder: Path) -> None:
    (folder / "a.inp").write_text(GOOD[: GOOD.index("*ELEMENT")])
    assert told(lambda: case_of(folder, "a.inp")) == [
        f"bodies.slider.file: 'a.inp' – has no cells; a body needs some of: {ABAQUS_CELLS}"
    ]
    msh(folder / "a.msh", POINTS, QUADS)
    whole = (folder / "a.msh").read_text()
    for part, words in (
        (0.3, "has $Nodes and no $Elements; does it break off? Save it from Gmsh again"),
        (0.6, "has $Nodes and no $Elements; does it break off? Save it from Gmsh again"),
        (0.95, "the file breaks off here, without $EndElements; save it from Gmsh again"),
    ):
        (folder / "a.msh").write_text(whole[: int(part * len(whole))])
        (found,) = told(lambda: case_of(folder, "a.msh"))
        assert found.endswith(f" – {words}")


def test_numbers_that_are_none(folder: Path) -> None:
    (folder / "a.inp").write_text(GOOD.replace("0.02,", "nan,", 1))
    assert told(lambda: case_of(folder, "a.inp")) == [
        "a.inp, line 2: '1, nan, 0.01' – 'nan' is not a coordinate, a finite number"
    ]


# -- cells that will not do ----------------------------------------------------------------------------------------------

MIRRORED = "bodies.slider: all 2 cells are inverted: the order of their nodes is mirrored; number them the other way"
ONE_INVERTED = (
    "bodies.slider: 1 of 2 cells are inverted (negative Jacobian); the first is hexahedron cell number 2 about (0.0075, "
    "0.005, 0.005)"
)
CELLS = {
    "one folded": (
        inp(POINTS, with_cell(QUADS, 3, [0, 2, 1, 3]), rest="*NSET, NSET=left\n1"),
        ["bodies.slider: 1 of 8 cells are inverted (negative Jacobian); the first is quad cell number 4 about (0.0275, 0.0175)"],
    ),
    "one degenerate": (
        inp(POINTS, with_cell(QUADS, 2, [0, 0, 0, 0])),
        [
            "bodies.slider: 1 of 8 cells name a node twice; the first is quad cell number 3 about (0.025, 0.01), with node 4, at (0.025, 0.01); every node of a cell is one of its own"
        ],
    ),
    "one twice": (
        inp(POINTS, np.vstack([QUADS, QUADS[:1, [1, 2, 3, 0]]])),
        [
            "bodies.slider: 1 of 9 cells have the nodes of another cell; the first is quad cell number 9 about (0.0225, 0.0125); take them out of the file"
        ],
    ),
    "a side without length": (
        inp(MERGED, QUADS, rest=named(SHEET)),
        [
            "bodies.slider: 1 of 8 cells are degenerate (zero Jacobian: flat, or nodes at one place); the first is quad cell number 1 about (0.02125, 0.0125)",
            "bodies.slider: boundary bottom: 1 of 4 facets have no area; the first is at (0.02, 0.01)",
        ],
    ),
}


@pytest.mark.parametrize(("text", "message"), CELLS.values(), ids=CELLS)
def test_cells_that_will_not_do(folder: Path, text: str, message: list[str]) -> None:
    (folder / "a.inp").write_text(text)
    assert told(lambda: case_of(folder, "a.inp")) == message


@pytest.mark.parametrize("name", ["a.inp", "a.msh"])
def test_inverted_cells_in_space(folder: Path, name: str) -> None:
    for cells, message in ((BRICKS[:, UPSIDE_DOWN], MIRRORED), (with_cell(BRICKS, 1, UPSIDE_DOWN), ONE_INVERTED)):
        if name == "a.inp":
            (folder / name).write_text(inp(BLOCK.points, cells, "C3D8"))
        else:
            msh(folder / name, BLOCK.points, cells, "hexahedron")
        assert told(lambda: case_of(folder, name, SPACE)) == [message]


def test_cells_of_another_dimension(folder: Path) -> None:
    msh(folder / "plane.msh", POINTS, QUADS)
    msh(folder / "space.msh", BLOCK.points, BRICKS, "hexahedron")
    assert told(lambda: case_of(folder, "plane.msh", SPACE)) == [
        "bodies.slider.model: '3d' – the mesh has 2 dimensions; take \"plane stress\" or \"plane strain\""
    ]
    assert told(lambda: case_of(folder, "space.msh")) == [
        "bodies.slider.model: 'plane stress' – the mesh has 3 dimensions; take \"3d\""
    ]
    assert told(lambda: case_of(folder, "plane.msh", edits={'"plane.msh"': '"plane.msh"\ntranslation = [0.0, 0.0, 1.0]'})) == [
        "bodies.slider.translation: [0.0, 0.0, 1.0] – must have 2 numbers, one for each direction"
    ]


def test_pieces_that_share_no_node(folder: Path) -> None:
    twice = inp(np.vstack([POINTS, POINTS + np.array([0.05, 0.0])]), np.vstack([QUADS, QUADS + len(POINTS)]), rest=named(SHEET))
    (folder / "a.inp").write_text(twice)
    assert st.describe(case_of(folder, "a.inp")).warnings == (
        "bodies.slider: 2 pieces that share no node; a tie, a spring or a support must hold each of them, or merge the "
        "nodes where they should be one",
    )
    with pytest.raises(AnalysisError) as caught:
        st.steady_sliding(case_of(folder, "a.inp"))
    assert str(caught.value).startswith(
        "steady sliding has no equilibrium: body slider can move freely under the loads: its mesh has 2 pieces that share "
        "no node, each of which a tie, a spring or a support must hold (of a file with several bodies take one by its "
        "group); fix a freedom of the loose body, or turn the load"
    )


@pytest.mark.parametrize("code", ["utf-16", "utf-16-be"])
@pytest.mark.parametrize("name", ["a.msh", "a.inp", "a.vtu", "a.vtk"])
def test_text_of_two_bytes_a_character(folder: Path, name: str, code: str) -> None:
    mark = "" if code == "utf-16" else "\ufeff"
    (folder / name).write_bytes((mark + inp(POINTS, QUADS, rest=named(SHEET))).encode(code))
    (message,) = told(lambda: case_of(folder, name))
    assert message.startswith("bodies.slider.file: ")
    assert message.endswith("is text of UTF-16, two bytes a character, as some shells write it; save it as UTF-8 or ASCII")


def test_cells_that_are_open_along_an_edge(folder: Path) -> None:
    """A square of 8 nodes beside one of 4: its midside node on their common edge belongs to it alone."""
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [2, 0], [2, 1], [1.5, 0], [2, 0.5], [1.5, 1], [1, 0.5]], dtype=float) * 0.01
    text = inp(points, np.array([[0, 1, 2, 3]]), rest="*ELEMENT, TYPE=CPS8, ELSET=body\n 2, 2, 5, 6, 3, 7, 8, 9, 10\n")
    (folder / "a.inp").write_text(text)
    case = st.loads(SPACE.replace('"3d"', '"plane stress"\nthickness = 0.01').replace("FILE", "a.inp"), folder=folder)
    assert st.describe(case).warnings == (
        "bodies.slider: 1 midside node belongs to the cells on one side only, the first at (0.01, 0.005): the mesh is "
        "open along its edge; take linear or quadratic cells on both sides, or tie two bodies",
    )


def test_a_face_on_two_triangles(folder: Path) -> None:
    """Two tetrahedra on a cube, which share all nodes of its face and leave none over."""
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    cube = np.vstack([np.column_stack([square, np.full(4, z)]) for z in (0, 1)])
    points = np.vstack([cube, [[0.5, 0.5, 2.0]]]) * 0.01
    numbers = [f" {k + 1}, {x:.9g}, {y:.9g}, {z:.9g}\n" for k, (x, y, z) in enumerate(points)]
    text = "*NODE\n" + "".join(numbers) + "*ELEMENT, TYPE=C3D8, ELSET=body\n 1, 1, 2, 3, 4, 5, 6, 7, 8\n"
    (folder / "a.inp").write_text(text + "*ELEMENT, TYPE=C3D4, ELSET=body\n 2, 5, 6, 7, 9\n 3, 5, 7, 8, 9\n")
    case = st.loads(SPACE.replace("FILE", "a.inp"), folder=folder)
    assert st.describe(case).warnings == (
        "bodies.slider: 1 face of hexahedra on two triangles of tetrahedra, the first at (0.005, 0.005, 0.01): the mesh "
        "is open between its corners, as a face bends where triangles are flat; take cells of one kind on both sides, "
        "or tie two bodies",
    )


# -- groups --------------------------------------------------------------------------------------------------------------

GROUPS = {
    "boundary": (
        {'slave = "slider.bottom"': 'slave = "slider.botom"'},
        "contacts.rub.slave: 'botom' – no such boundary; did you mean bottom? good.inp has: left, bottom, top, two",
    ),
    "group": (
        {'"good.inp"': '"good.inp"\ngroup = "boddy"'},
        "bodies.slider.group: 'boddy' – no such group of cells; did you mean body? good.inp has: body",
    ),
    "nodes as slave": (
        {'slave = "slider.bottom"': 'slave = "slider.two"'},
        "contacts.rub.slave: 'two' – a set of 2 nodes that holds no whole side of a cell on the surface; a contact or a pressure needs a boundary; good.inp has: left, bottom, top, two",
    ),
    "nodes as master": (
        {'slave = "slider.bottom"\nmaster = "rail.top"': 'slave = "rail.top"\nmaster = "slider.two"'},
        "contacts.rub.master: 'two' – a set of 2 nodes that holds no whole side of a cell on the surface; a contact or a pressure needs a boundary; good.inp has: left, bottom, top, two",
    ),
    "pressure on nodes": (
        {'at = "slider.top"': 'at = "slider.two"'},
        "loads.press.at: 'two' – a set of 2 nodes that holds no whole side of a cell on the surface; a contact or a pressure needs a boundary; good.inp has: left, bottom, top, two",
    ),
    "point that hides a boundary": (
        {'"good.inp"': '"good.inp"\npoints = { left = [0.02, 0.01] }'},
        "bodies.slider.points.left: [0.02, 0.01] – good.inp has a boundary of this name; choose another name",
    ),
}


@pytest.mark.parametrize(("edits", "message"), GROUPS.values(), ids=GROUPS)
def test_groups_that_do_not_serve(folder: Path, edits: dict[str, str], message: str) -> None:
    (folder / "good.inp").write_text(GOOD)
    assert told(lambda: case_of(folder, "good.inp", edits=edits)) == [message]


def test_nodes_of_a_whole_side_serve_as_that_side(folder: Path) -> None:
    nodes = ", ".join(str(n + 1) for n in SHEET.boundary_nodes("bottom"))
    (folder / "a.inp").write_text(GOOD.replace("*NSET", f"*NSET, NSET=low\n{nodes}\n*NSET", 1))
    low, bottom = (
        build_system(case_of(folder, "a.inp", edits={'slave = "slider.bottom"': f'slave = "slider.{name}"'})).surfaces[0]
        for name in ("low", "bottom")
    )
    np.testing.assert_array_equal(low.nodes.area, bottom.nodes.area)
    np.testing.assert_array_equal(low.nodes.position, bottom.nodes.position)


def test_a_mesh_without_groups_says_how_to_name_them(folder: Path) -> None:
    msh(folder / "a.msh", POINTS, QUADS, groups=False)
    assert told(lambda: case_of(folder, "a.msh")) == [
        f"supports.guide.at: 'left' – no such boundary; a.msh has no named groups; {HOW_TO_NAME}"
    ]
    assert told(lambda: case_of(folder, "a.msh", edits={'"a.msh"': '"a.msh"\ngroup = "body"'})) == [
        "bodies.slider.group: 'body' – a.msh has no named groups of cells; in Gmsh make them with Physical Surface "
        "(plane) or Physical Volume (solid), in Abaqus with *ELSET"
    ]


# -- materials and units of files ----------------------------------------------------------------------------------------

GIVE = "give the NAME of a [materials.NAME]"
NO_MATERIAL = {'material = "steel"\nthickness = 0.01\nfile': "thickness = 0.01\nfile"}


def test_materials_of_files(folder: Path) -> None:
    where = "bodies.slider.material: missing –"
    for text, edits, message in (
        (GOOD, {}, f"{where} the file has no *SOLID SECTION for it; {GIVE}"),
        (
            TWO_MATERIALS,
            {},
            f"{where} the file gives it several materials (ST, AL); read each as its own body by group; {GIVE}",
        ),
        (
            ONE_MATERIAL,
            {'"a.inp"': '"a.inp"\nscale = 0.5'},
            f"{where} the file's material is in the units of the file, whose lengths are scaled by 0.5; {GIVE} in SI units",
        ),
    ):
        (folder / "a.inp").write_text(text)
        assert told(lambda edits=edits: case_of(folder, "a.inp", edits={**NO_MATERIAL, **edits})) == [message]
    (folder / "a.inp").write_text(ONE_MATERIAL)
    assert build_system(case_of(folder, "a.inp", edits=NO_MATERIAL)).size > 0
    msh(folder / "a.msh", POINTS, QUADS)
    assert told(lambda: case_of(folder, "a.msh", edits=NO_MATERIAL)) == [
        f"{where} {GIVE} (only an Abaqus file may bring its own)"
    ]


ALONE = """
[bodies.slider]
type = "solid"
model = "plane stress"
file = "a.inp"
SCALE
[supports.guide]
at = "slider.left"
fixed = ["x", "y"]
[loads.press]
at = "slider.top"
pressure = 1e6
"""
STEEL = "materials.steel = { young_modulus = 200e9, density = 7800.0 }\n"


@pytest.mark.parametrize(
    ("factor", "extent", "why"),
    [
        (1e3, "20", "scale = 0.001 is for one in millimetres"),
        (1e-3, "2e-05", "scale = 0.001 is for one in millimetres"),
    ],
)
def test_files_in_another_unit(folder: Path, factor: float, extent: str, why: str) -> None:
    (folder / "a.inp").write_text(inp(POINTS * factor, QUADS, rest=ONE_MATERIAL[ONE_MATERIAL.index("*NSET") :]))
    found = st.describe(case_of(folder, "", ALONE.replace("SCALE", ""))).warnings
    assert found == (f"bodies.slider: {extent} m in extent is unusual, usually 0.0001 to 10 m; {why}",)


@pytest.mark.parametrize(
    ("scale", "message"),
    [
        (1e3, ".scale: 1000 m is unusual for a unit of length, usually 1e-09 to 1 m; check its unit and its digits"),
        (1e-3, ": 2e-05 m in extent is unusual, usually 0.0001 to 10 m; scale = 0.001 made metres of the file"),
    ],
)
def test_scales_that_are_wrong(folder: Path, scale: float, message: str) -> None:
    (folder / "a.inp").write_text(GOOD)
    text = STEEL + ALONE.replace("SCALE", f'material = "steel"\nscale = {scale}')
    assert st.describe(case_of(folder, "", text)).warnings == (f"bodies.slider{message}",)
    # Where nothing has a unit, no size is unusual.
    bare = case_of(folder, "", 'units = "nondimensional"\n' + text)
    assert st.describe(bare).warnings == ()


def test_scales_that_make_no_body(folder: Path) -> None:
    (folder / "a.inp").write_text(GOOD)
    assert told(lambda: case_of(folder, "", STEEL + ALONE.replace("SCALE", 'material = "steel"\nscale = 0.0'))) == [
        "bodies.slider.scale: 0.0 – must be a number > 0, by which coordinates of the file become metres"
    ]
    assert told(lambda: case_of(folder, "", STEEL + ALONE.replace("SCALE", 'material = "steel"\nscale = 1e30'))) == [
        f"bodies.slider.file: '{shown_path(folder / 'a.inp')}' – 2e+28 m in extent; must be between 1e-20 and 1e+20 m"
    ]


def test_a_file_of_too_many_freedoms(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "a.inp").write_text(GOOD)
    monkeypatch.setattr("stridor.system.size.MOST_FREEDOMS", 25)
    text = STEEL + ALONE.replace("SCALE", 'material = "steel"')
    assert told(lambda: case_of(folder, "", text)) == [
        f"bodies.slider.file: '{shown_path(folder / 'a.inp')}' – has 3e-05 million degrees of freedom, 3e-05 million with "
        "the bodies before it; at most 2.5e-05 million can be computed with: take a coarser mesh"
    ]


def test_the_command_line_says_the_same(folder: Path) -> None:
    (folder / "case.toml").write_text(PLANE.replace("FILE", "none.msh"))
    done = stridor("check", "case.toml", cwd=folder)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"stridor: bodies.slider.file: '{shown_path(folder / 'none.msh')}' – no such file\n"
