"""Numbers of nodes that no node has, elements that overlap, ties that bond nothing: each with the line or the place."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest

import stridor as st
from stridor.contact.curve import Curve
from stridor.contact.ties import check_facing, tie
from stridor.errors import CaseError
from stridor.mesh.files import read_mesh
from stridor.mesh.model import Mesh
from stridor.mesh.quality import check_mesh
from stridor.mesh.shapes import block, rectangle

pytestmark = pytest.mark.bad_input

OLD = """$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
5
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
5 2 0 0
$EndNodes
$Elements
3
1 2 2 1 1 1 2 3
2 2 2 1 1 1 3 4
3 2 2 1 1 2 5 3
$EndElements
"""
NEW = """$MeshFormat
4.1 0 8
$EndMeshFormat
$Nodes
1 5 1 5
2 1 0 5
1
2
3
4
5
0 0 0
1 0 0
1 1 0
0 1 0
2 0 0
$EndNodes
$Elements
1 3 1 3
2 1 2 3
1 1 2 3
2 1 3 4
3 2 5 3
$EndElements
"""
DECK = "*NODE\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n*ELEMENT,TYPE=CPS3\n1,1,2,3\n2,1,3,4\n"
FILES = {"old.msh": (OLD, "1 1 2 5 3", "2 5 3"), "new.msh": (NEW, "\n3 2 5 3\n", "2 5 3")}


def told(path: Path, content: str | bytes) -> str:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(CaseError) as caught:
        check_mesh(read_mesh(path), "mesh")
    return str(caught.value)


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("number", ["0", "-1", "6", "77", "4294967297", "99999999999999999999999"])
def test_an_element_of_a_node_that_is_not_there(name, number, tmp_path):
    """Node 0 was taken for the last one: an array's place −1."""
    text, line, nodes = FILES[name]
    path = tmp_path / name
    path.write_text(text)
    assert read_mesh(path).cell_count == 3
    wrong = text.replace(line, line.replace(nodes, f"2 {number} 3"))
    at = wrong.split("\n").index(next(w for w in wrong.split("\n") if f"2 {number} 3" in w)) + 1
    message = told(path, wrong)
    assert message.startswith(f"{name}, line {at}: ")
    assert f"uses node {number}, which is not defined" in message


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize(
    ("number", "words"),
    [
        ("0", "nodes are numbered from 1 to 2147483647"),
        ("-3", "nodes are numbered from 1"),
        ("4", "node 4 is there twice"),
        ("2147483648", "nodes are numbered from 1 to 2147483647"),
        ("1" + "0" * 30, "nodes are numbered from 1 to 2147483647"),
        ("2000000000", "node 2000000000 among 5 nodes: number them closer to one another"),
    ],
)
def test_nodes_with_numbers_that_cannot_be(name, number, words, tmp_path):
    text = FILES[name][0]
    lines = text.split("\n")
    at = lines.index("5 2 0 0" if name == "old.msh" else "5", 6)
    lines[at] = f"{number}{lines[at][1:]}"
    wrong = "\n".join(lines).replace("2 5 3", f"2 {number} 3")
    message = told(tmp_path / name, wrong)
    assert message.startswith(f"{name}, line {at + 1}: ")
    assert words in message


@pytest.mark.parametrize("section", ["$Nodes", "$Elements"])
def test_a_block_of_less_than_nothing(section, tmp_path):
    """The reader of blocks went back by as many lines as it had come, for ever."""
    lines = NEW.split("\n")
    at = lines.index(section) + 2
    lines[at] = " ".join([*lines[at].split()[:3], "-1"])
    message = told(tmp_path / "new.msh", "\n".join(lines))
    assert message.startswith(f"new.msh, line {at + 1}: ")
    assert "a block of -1" in message


# -- counts -----------------------------------------------------------------------------------------------------------
BLOCKS = """$MeshFormat
4.1 0 8
$EndMeshFormat
$Nodes
2 5 1 5
2 1 0 3
1
2
3
0 0 0
1 0 0
1 1 0
2 2 0 2
4
5
0 1 0
2 0 0
$EndNodes
$Elements
2 4 1 4
1 1 1 1
1 1 2
2 1 2 3
2 1 2 3
3 1 3 4
4 2 5 3
$EndElements
"""
MEND = "correct the number or the lines, or save the file from Gmsh again"


@pytest.mark.parametrize(
    ("text", "line", "head", "said", "lines"),
    [
        (OLD, "5 2 0 0", "$Nodes", "5 nodes, and {} lines follow", 5),
        (OLD, "3 2 2 1 1 2 5 3", "$Elements", "3 elements, and {} lines follow", 3),
        (NEW, "5", "$Nodes", "5 nodes in 1 blocks, which are 11 lines, and {} lines follow", 11),
        (NEW, "2 0 0", "$Nodes", "5 nodes in 1 blocks, which are 11 lines, and {} lines follow", 11),
        (NEW, "3 2 5 3", "$Elements", "3 elements in 1 blocks, which are 4 lines, and {} lines follow", 4),
        (BLOCKS, "3", "$Nodes", "5 nodes in 2 blocks, which are 12 lines, and {} lines follow", 12),
        (BLOCKS, "1 1 2", "$Elements", "4 elements in 2 blocks, which are 6 lines, and {} lines follow", 6),
        (BLOCKS, "3 1 3 4", "$Elements", "4 elements in 2 blocks, which are 6 lines, and {} lines follow", 6),
    ],
)
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_more_or_fewer_lines_than_their_count(text, line, head, said, lines, end, tmp_path):
    """meshio stops at the count: the last elements were lost without a word."""
    whole = text.split("\n")
    at = whole.index(line)
    for found, content in ((lines + 1, [*whole[:at], whole[at], *whole[at:]]), (lines - 1, whole[:at] + whole[at + 1 :])):
        message = told(tmp_path / "a.msh", end.join(content))
        first = content.index(head) + 1
        assert message == f"a.msh, line {first + 1}: '{whole[first]}' – {head} says {said.format(found)}; {MEND}"


@pytest.mark.parametrize(
    ("text", "old", "new"),
    [
        (NEW, "\n1 5 1 5\n", "\n1 4 1 5\n"),  # of too many nodes meshio makes up the rest
        (NEW, "\n1 5 1 5\n", "\n2 3 1 5\n"),
        (BLOCKS, "\n2 1 0 3\n", "\n2 1 0 2\n"),
        (BLOCKS, "\n2 4 1 4\n", "\n1 5 1 4\n"),
        (BLOCKS, "\n2 1 2 3\n2", "\n2 1 2 2\n2"),
        (BLOCKS, "\n1 1 1 1\n", "\n1 1 1 2\n"),
    ],
)
def test_blocks_that_do_not_make_up_the_whole(text, old, new, tmp_path):
    assert text.count(old) == 1
    message = told(tmp_path / "a.msh", text.replace(old, new))
    assert message.startswith("a.msh, line ")
    assert message.endswith(f"; {MEND}")


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("text", [OLD, NEW, BLOCKS])
def test_well_formed_files_are_read_as_before(text, end, tmp_path):
    comments = "$Comments\nof the one\n1 2 3\nwho made it\n$EndComments\n"
    written = {
        "as it is": text,
        "blank lines among nodes": text.replace("\n2 0 0", "\n\n2 0 0").replace("$EndNodes", "\n \n$EndNodes"),
        "blank lines at the end": text.replace("$EndElements", "\n\n$EndElements") + "\n\n",
        "comments before and between": comments + text.replace("$Elements", comments + "$Elements"),
        "more sections": text + '$NodeData\n1\n"u"\n1\n0.0\n3\n0\n1\n5\n1 1\n2 1\n3 1\n4 1\n5 1\n$EndNodeData\n',
        "no end": text.replace("$EndElements\n", ""),
    }
    if text is not OLD:  # numbers may be spread over lines in any way
        written["in one line"] = text.replace("0 0 0\n1 0 0\n", "0 0 0 1 0 0\n").replace("1\n2\n3\n", "1 2 3\n")
        written["blank lines among elements"] = text.replace("\n3 ", "\n\n3 ")
    path = tmp_path / "a.msh"
    expected = None
    for what, content in written.items():
        path.write_bytes(content.replace("\n", end).encode())
        mesh = read_mesh(path)
        expected = expected or mesh
        assert mesh.cell_count == 3, what
        np.testing.assert_array_equal(mesh.points, expected.points, err_msg=what)


@pytest.mark.parametrize("text", [OLD, NEW, BLOCKS])
def test_files_that_break_off(text, tmp_path):
    """A last line without its end may have lost digits of its last number, and name another node."""
    path, cut = tmp_path / "a.msh", text[: text.index("$EndElements")]
    lines = cut.split("\n")[:-1]
    head = lines.index("$Elements") + 1
    for ended in (cut[:-1], cut[:-3], f"{cut}$EndElem"):
        shown = ended.split("\n")[-1]
        assert told(path, ended).startswith(f"a.msh, line {len(ended.splitlines())}: {shown!r} – ")
    assert told(path, cut[:-1]).endswith("the file breaks off here, without $EndElements; save it from Gmsh again")
    assert told(path, f"{cut}$EndElem").endswith("$Elements has no $EndElements before this; save the file from Gmsh again")
    for lost in (1, 2, 3):
        message = told(path, "\n".join(lines[:-lost]) + "\n")
        assert message.startswith(f"a.msh, line {head + 1}: {lines[head]!r} – $Elements says ")
        assert message.endswith(f"and {len(lines) - head - 1 - lost} lines follow; the file breaks off there; save it from Gmsh again")
    assert told(path, text.replace("$EndNodes\n", "")).endswith("$Nodes has no $EndNodes before this; save the file from Gmsh again")
    assert told(path, text[: text.index("$Elements")]).endswith("has $Nodes and no $Elements; does it break off? Save it from Gmsh again")


@pytest.mark.parametrize("form", ["gmsh22", "gmsh"])
@pytest.mark.parametrize("section", ["Nodes", "Elements"])
def test_binary_files_with_other_counts(form, section, tmp_path):
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]])
    mesh = meshio.Mesh(points, [("triangle", np.array([[0, 1, 2], [0, 2, 3]]))])
    if form == "gmsh":
        mesh.point_data["gmsh:dim_tags"] = np.array([[2, 1]] * 5)
        mesh.cell_data |= {f"gmsh:{k}": [np.ones(2, dtype=int)] for k in ("geometrical", "physical")}
    path = tmp_path / "a.msh"
    mesh.write(path, file_format=form, binary=True)
    data = path.read_bytes()
    assert read_mesh(path).cell_count == 2
    count = {"Nodes": 5, "Elements": 2}[section]
    at = data.index(f"${section}\n".encode()) + len(section) + 2
    for other in (count - 1, count + 1):
        wrong = bytearray(data)
        if form == "gmsh":  # blocks, and how many in all
            wrong[at + 8 : at + 16] = np.uint64(other).tobytes()
        else:
            wrong[at : at + 1] = str(other).encode()
        message = told(path, bytes(wrong))
        assert message.startswith("mesh.file: ")
        if form == "gmsh" or other < count:
            assert f"says {other} {section.lower()} at ${section}" in message
            assert message.endswith("save it from Gmsh again")
    message = told(path, data[: data.index(b"$EndElements")])
    assert message.endswith("breaks off after its 2 elements, before $EndElements; save it from Gmsh again")
    if form == "gmsh":
        at = data.index(b"$EndNodes") - 1 - 5 * 32  # numbers, then places
        assert data[at : at + 8] == np.uint64(1).tobytes()
        message = told(path, data[: at + 8] + np.uint64(1).tobytes() + data[at + 16 :])
        assert message.endswith("has 1 nodes whose number another one has; the first is node 1")


@pytest.mark.parametrize("form", ["gmsh22", "gmsh"])
@pytest.mark.parametrize("number", [-1, -5, 7])
def test_binary_files(form, number, tmp_path):
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    path = tmp_path / "a.msh"
    for cells in ([[0, 1, 2], [0, 2, 3]], [[0, 1, 2], [0, 2, number]]):
        data = {"gmsh:dim_tags": np.array([[2, 1]] * 4)} if form == "gmsh" else {}
        mesh = meshio.Mesh(points, [("triangle", np.array(cells))], point_data=data)
        if form == "gmsh":
            mesh.cell_data |= {f"gmsh:{k}": [np.ones(2, dtype=int)] for k in ("geometrical", "physical")}
        mesh.write(path, file_format=form, binary=True)
        if cells[1][2] == 3:
            assert read_mesh(path).cell_count == 2
    assert f"uses node {number + 1}, which is not defined" in told(path, path.read_bytes())


@pytest.mark.parametrize("numbers", [[2, 3, 4, 5], [1, 2, 4, 3], [1, 2, 3, 9]])
def test_binary_files_of_format_2_2_need_their_nodes_in_order(numbers, tmp_path):
    path = tmp_path / "a.msh"
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    meshio.Mesh(points, [("triangle", np.array([[0, 1, 2], [0, 2, 3]]))]).write(path, file_format="gmsh22", binary=True)
    data = bytearray(path.read_bytes())
    record = np.dtype([("number", "i4"), ("place", "f8", (3,))])
    at = data.index(b"\n", data.index(b"$Nodes\n") + len(b"$Nodes\n")) + 1
    nodes = np.frombuffer(bytes(data[at : at + 4 * record.itemsize]), record).copy()
    assert nodes["number"].tolist() == [1, 2, 3, 4]
    nodes["number"] = numbers
    data[at : at + 4 * record.itemsize] = nodes.tobytes()
    first = data.index(b"\n", data.index(b"$Elements\n") + len(b"$Elements\n")) + 1 + 12  # behind the block's head
    end = data.index(b"$EndElements") - 1
    rows = np.frombuffer(bytes(data[first:end]), "i4").reshape(2, -1).copy()
    rows[:, -3:] = np.array(numbers)[rows[:, -3:] - 1]
    data[first:end] = rows.tobytes()
    message = told(path, bytes(data))
    assert "is binary, of format 2.2, and its 4 nodes are not numbered from 1 to 4 in this order" in message
    assert message.endswith("renumber them in Gmsh, or save it as format 4.1 or as text (ASCII)")


def test_format_4_0_is_not_guessed_at(tmp_path):
    message = told(tmp_path / "a.msh", NEW.replace("4.1 0 8", "4.0 0 8"))
    assert "is of Gmsh's format 4.0; save it from Gmsh as 4.1 or 2.2" in message


@pytest.mark.parametrize("number", ["0", "-1", "5", "1" + "0" * 30, "2147483648"])
def test_abaqus(number, tmp_path):
    message = told(tmp_path / "a.inp", DECK.replace("2,1,3,4", f"2,1,3,{number}"))
    assert message.startswith(("a.inp, line 8: ", f"a.inp, line 8: '2,1,3,{number}'"))
    message = told(tmp_path / "a.inp", DECK.replace("4,0,1\n", f"{number},0,1\n"))
    assert message.startswith(("a.inp, line 5: ", "a.inp, line 8: "))


@pytest.mark.parametrize("number", [-1, 3, 2**31])
def test_vtk(number, tmp_path):
    points = "0 0 0 1 0 0 0 1 0"
    text = f"# vtk DataFile Version 3.0\na\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 3 double\n{points}\n"
    told(tmp_path / "a.vtk", f"{text}CELLS 1 4\n3 0 1 {number}\nCELL_TYPES 1\n5\n")


@pytest.mark.parametrize("kind", [-1, 11, 4, 256, 10**20])
def test_vtk_cells_of_a_type_that_is_not_theirs(kind, tmp_path):
    """The reader passes over them, and the body would have a hole."""
    points = " ".join(f"{x} {y} 0" for y in (0, 1) for x in range(5))
    cells = "OFFSETS vtktypeint64\n0 4 8 12 15 18\nCONNECTIVITY vtktypeint64\n0 1 6 5 1 2 7 6 2 3 8 7 3 4 9 3 9 8\n"
    text = "# vtk DataFile Version 5.1\na\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 10 double\n"
    text += f"{points}\nCELLS 6 18\n{cells}"
    path = tmp_path / "good.vtk"
    path.write_text(f"{text}CELL_TYPES 5\n9\n9\n9\n5\n5\n")
    assert sum(len(cells) for cells in read_mesh(path).cells.values()) == 5
    message = told(tmp_path / "a.vtk", f"{text}CELL_TYPES 5\n9\n{kind}\n9\n5\n5\n")
    assert "has 5 cells, of which 4 can be read" in message


# -- overlapping elements ---------------------------------------------------------------------------------------------
def test_two_cells_on_one_side_of_an_edge():
    points = np.array([[0.0, 0], [1, 0], [0.5, 1], [0.4, 0.6], [0.5, -1]])
    good = Mesh(points[[0, 1, 2, 4]], {"triangle": np.array([[0, 1, 2], [1, 0, 3]])})
    check_mesh(good, "mesh")
    wrong = Mesh(points[:4], {"triangle": np.array([[0, 1, 2], [0, 1, 3]])})
    with pytest.raises(CaseError) as caught:
        check_mesh(wrong, "bodies.pad")
    assert str(caught.value) == (
        "bodies.pad: 1 edges have two cells on the same side of them, which overlap; the first is about (0.5, 0); "
        "mesh the body anew, or take one of the cells out of the file"
    )
    # Of different kinds, too: a quadrilateral and a quadratic triangle.
    more = np.vstack([points[:2], [[1.0, 1], [0, 1], [0.5, 0.5], [0.5, 0], [0.8, 0.3], [0.2, 0.3]]])
    mixed = {"quad": np.array([[0, 1, 2, 3]]), "triangle6": np.array([[0, 1, 4, 5, 6, 7]])}
    with pytest.raises(CaseError, match="1 edges have two cells on the same side"):
        check_mesh(Mesh(more, mixed), "mesh")


@pytest.mark.parametrize("kind", ["tetra", "hexahedron", "tetra10", "hexahedron20"])
def test_two_cells_on_one_side_of_a_face(kind):
    base = "tetra" if kind.startswith("tetra") else "hexahedron"
    mesh = block((0, 0, 0), (1, 1, 1), (2, 2, 1), kind=base, order=1 if kind == base else 2)
    check_mesh(mesh, "mesh")
    cells = mesh.cells[kind]
    chosen = cells[0]
    face = chosen[:3] if base == "tetra" else chosen[:4]
    # The same cell once more, other nodes but for one face, pushed a little into itself.
    other = chosen.copy()
    points = [*mesh.points]
    centre = mesh.points[chosen].mean(axis=0)
    middle = mesh.points[face].mean(axis=0)
    for place, node in enumerate(chosen):
        if node not in face:
            other[place] = len(points)
            points.append(middle + 0.8 * (mesh.points[node] - middle) if node not in face else centre)
    wrong = Mesh(np.array(points), {kind: np.vstack([cells, other[None]])})
    with pytest.raises(CaseError, match="faces have two cells on the same side of them, which overlap"):
        check_mesh(wrong, "mesh")


@pytest.mark.parametrize("kind", ["quad", "triangle"])
@pytest.mark.parametrize("order", [1, 2])
def test_sound_meshes_pass(kind, order):
    check_mesh(rectangle((0, 0), (1, 1), (4, 3), kind=kind, order=order), "mesh")


# -- ties -------------------------------------------------------------------------------------------------------------
TIED = """
materials.steel = {{ young_modulus = 200e9, density = 7800.0, poisson_ratio = 0.3 }}
[bodies.lower]
type = "solid"
model = "plane strain"
material = "steel"
mesh = {{ shape = "rectangle", corner = [0.0, 0.0], size = [1.0, 1.0], divisions = [5, 5], cells = "quad" }}
[bodies.upper]
type = "solid"
model = "plane strain"
material = "steel"
mesh = {{ shape = "rectangle", corner = [0.0, {height}], size = [1.0, 1.0], divisions = [4, 4], cells = "quad" }}
[supports.ground]
at = "lower.{held}"
fixed = ["x", "y"]
[ties.bond]
slave = "upper.{slave}"
master = "lower.{master}"
tolerance = {tolerance}
"""


def tied(**given) -> str:
    values = {"height": 1.0, "held": "bottom", "slave": "bottom", "master": "top", "tolerance": 5.0} | given
    case = st.loads(TIED.format(**values))
    try:
        st.build_system(case)
    except CaseError as error:
        return str(error)
    return ""


def test_ties_bond_surfaces_that_touch_and_face_each_other():
    assert tied() == ""
    assert tied(height=1.1) == ""  # within an element
    message = tied(height=1.5)
    assert "ties.bond: the slave node at" in message
    assert "0.5 m from the master, more than an element (0.25 m); a tie bonds surfaces that touch" in message
    assert "3 m from the master, more than an element" in tied(height=3.0, slave="top")
    away = tied(height=0.9, slave="top", master="top", tolerance=1.0)
    assert "more than an element" in away
    same = tied(height=0.1, slave="top", master="top", tolerance=0.2)
    assert "at 5 of 5 slave nodes both surfaces face the same way, first at" in same
    assert "is it the boundary on the other side of a body?" in same


def test_nodes_without_a_normal_are_bonded_by_distance_alone():
    points = np.array([[1.0, 0.0], [0.5, 0.0], [0.0, 0.0]])
    curve = Curve.from_facets(points, {"line": np.array([[0, 1], [1, 2]])}, where="w")
    slaves = np.array([[0.3, 0.01]])
    found = tie(slaves, curve, where="w", tolerance=0.1)
    check_facing(slaves, np.full((1, 2), np.nan), curve, found, where="w", limit=0.5)
    check_facing(slaves, np.array([[0.0, -1.0]]), curve, found, where="w", limit=0.5)
    with pytest.raises(CaseError, match="face the same way"):
        check_facing(slaves, np.array([[0.0, 1.0]]), curve, found, where="w", limit=0.5)
