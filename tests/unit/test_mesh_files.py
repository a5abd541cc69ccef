"""Reading Gmsh and VTK files, and what is said of files that cannot be read."""

import importlib
import shutil
from pathlib import Path
from types import FunctionType

import meshio
import numpy as np
import pytest
from scipy.spatial import cKDTree

from stridor.errors import CaseError
from stridor.mesh import readers, shapes
from stridor.mesh.files import read_mesh, require_boundary
from stridor.mesh.quality import check_mesh

# Two unit quadrilaterals side by side, the right one numbered clockwise as Gmsh does for a surface whose normal points
# away; a third, "other", beside them; a point that no cell uses; curves in any direction.
TWO_QUADS = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
6
0 9 "tip"
1 1 "bottom side"
1 2 "left"
1 3 "middle"
2 4 "body"
2 5 "other"
$EndPhysicalNames
$Entities
1 3 3 0
1 2 1 0 1 9
1 0 0 0 2 0 0 1 1 0
2 0 0 0 0 1 0 1 2 0
3 1 0 0 1 1 0 1 3 0
1 0 0 0 1 1 0 1 4 0
2 1 0 0 2 1 0 1 4 0
3 2 0 0 3 1 0 1 5 0
$EndEntities
$Nodes
1 9 1 9
2 1 0 9
1
2
3
4
5
6
7
8
9
0 0 0
1 0 0
2 0 0
0 1 0
1 1 0
2 1 0
3 0 0
3 1 0
7 7 0
$EndNodes
$Elements
7 8 1 8
0 1 15 1
1 6
1 1 1 2
2 1 2
3 2 3
1 2 1 1
4 1 4
1 3 1 1
5 2 5
2 1 3 1
6 1 2 5 4
2 2 3 1
7 2 5 6 3
2 3 3 1
8 3 7 8 6
$EndElements
"""


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def two_quads(tmp_path):
    path = tmp_path / "two.msh"
    path.write_text(TWO_QUADS)
    return path


def message(call) -> str:
    with pytest.raises(CaseError) as caught:
        call()
    text = str(caught.value)
    assert "\n" not in text
    return text


def refused(path, **options) -> str:
    """The message for a file in the folder."""
    return message(lambda: read_mesh(path.name, **options))


def edges(mesh, name):
    """Lines of a boundary by the places of their ends."""
    return sorted(tuple(map(tuple, mesh.points[line].tolist())) for line in mesh.boundaries[name]["line"])


def test_gmsh_groups_become_boundaries_regions_and_node_sets(two_quads):
    mesh = read_mesh(two_quads)
    check_mesh(mesh, "mesh")  # the clockwise one is turned over
    assert mesh.points.shape == (8, 2)
    assert mesh.cell_count == 3
    assert {name: {k: i.tolist() for k, i in r.items()} for name, r in mesh.regions.items()} == {
        "body": {"quad": [0, 1]},
        "other": {"quad": [2]},
    }
    # Turned so that the body lies on the left.
    assert edges(mesh, "bottom side") == [((0, 0), (1, 0)), ((1, 0), (2, 0))]
    assert edges(mesh, "left") == [((0, 1), (0, 0))]
    assert mesh.points[mesh.node_sets["tip"]].tolist() == [[2, 1]]
    # A curve between two cells is no boundary of the body.
    assert set(mesh.boundaries) == {"bottom side", "left"}
    assert mesh.points[mesh.node_sets["middle"]].tolist() == [[1, 0], [1, 1]]
    assert mesh.source == "two.msh"


def test_group_picks_the_body_and_scale_its_size(two_quads):
    mesh = read_mesh(two_quads, group="body", scale=1e-3)
    assert mesh.cell_count == 2
    assert mesh.points.max(axis=0).tolist() == [2e-3, 1e-3]
    assert len(mesh.points) == 6
    assert list(mesh.regions) == ["body"]
    other = read_mesh(two_quads, group="other")
    assert not other.boundaries
    assert list(other.node_sets) == ["tip"]
    assert refused(two_quads, group="Body") == (
        "mesh.group: 'Body' – no such group of cells; did you mean body? two.msh has: body, other"
    )
    assert refused(two_quads, scale=0.0, where="bodies.pad") == (
        "bodies.pad.scale: 0.0 – must be a number greater than 0, metres per unit of the file"
    )


def test_a_line_between_two_bodies_is_a_boundary_of_the_one_chosen(tmp_path):
    path = tmp_path / "two.msh"
    path.write_text(TWO_QUADS.replace("2 1 0 0 2 1 0 1 4 0", "2 1 0 0 2 1 0 1 5 0"))
    left, right = read_mesh(path, group="body"), read_mesh(path, group="other")
    assert edges(left, "middle") == [((1, 0), (1, 1))]
    assert edges(right, "middle") == [((1, 1), (1, 0))]
    assert edges(right, "bottom side") == [((1, 0), (2, 0))]


def gmsh22(path, *, names=True):
    """A block of two tetrahedra in format 2.2; the first is in two groups, and so written twice."""
    named = '$PhysicalNames\n3\n2 1 "base"\n3 2 "all"\n3 3 "first"\n$EndPhysicalNames\n' if names else ""
    path.write_text(
        f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{named}"
        "$Nodes\n5\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 0 0 -1\n$EndNodes\n"
        "$Elements\n5\n1 2 2 1 1 1 2 4\n2 4 2 2 1 1 2 3 4\n3 4 2 3 1 1 2 3 4\n4 4 2 2 1 1 3 2 5\n"
        "5 15 2 7 1 5\n$EndElements\n"
    )
    return path


def test_a_cell_in_two_groups_counts_once(tmp_path):
    mesh = read_mesh(gmsh22(tmp_path / "a.msh"))
    check_mesh(mesh, "mesh")
    assert mesh.cell_count == 2
    assert {name: r["tetra"].tolist() for name, r in mesh.regions.items()} == {"all": [0, 1], "first": [0]}
    assert mesh.boundaries["base"]["triangle"].tolist() == [[0, 1, 3]]  # outward is −y
    assert mesh.node_sets["7"].tolist() == [4]  # a group without a name goes by its number


def test_groups_without_names_go_by_their_numbers(tmp_path):
    mesh = read_mesh(gmsh22(tmp_path / "a.msh", names=False), group="3")
    assert list(mesh.regions) == ["2", "3"]
    assert list(mesh.boundaries) == ["1"]
    assert len(mesh.points) == 4


@pytest.mark.parametrize("kind", ["quad8", "quad9", "triangle6", "tetra10", "hexahedron20", "hexahedron27"])
@pytest.mark.parametrize("version", ["gmsh", "gmsh22", "vtu", "vtk"])
def test_a_built_in_shape_written_and_read_is_the_same(tmp_path, kind, version):
    if kind in ("quad8", "quad9", "triangle6"):
        made = shapes.annulus((0, 0), 0.5, 1.0, (2, 8), kind=kind)
        points = np.pad(made.points, ((0, 0), (0, 1)))
        named, facet_kind = "outer", "line3"
    else:
        made = shapes.block((0, 0, 0), (1, 2, 3), (2, 1, 2), kind=kind)
        points, named = made.points, "top"
        facet_kind = {"tetra10": "triangle6", "hexahedron20": "quad8", "hexahedron27": "quad9"}[kind]
    facets = made.boundaries[named][facet_kind]
    turned = np.where(np.arange(len(facets))[:, None] % 2 > 0, facets[:, ::-1], facets)
    turned[1::2] = facets[1::2][:, [1, 0, 2]] if facet_kind == "line3" else facets[1::2]
    path = tmp_path / f"mesh.{version.replace('22', '').replace('gmsh', 'msh')}"
    tags = [np.full(len(made.cells[kind]), 1), np.full(len(facets), 2)]
    name = "gmsh:physical" if path.suffix == ".msh" else "boundary"
    data = {name: tags, "gmsh:geometrical": tags} if path.suffix == ".msh" else {name: tags}
    dim_tags = np.full((len(points), 2), [made.dimension, 1])
    dim_tags[facets.ravel()] = [made.dimension - 1, 2]
    raw = meshio.Mesh(
        points,
        [(kind, made.cells[kind]), (facet_kind, turned)],
        cell_data=data,
        point_data={"gmsh:dim_tags": dim_tags} if version == "gmsh" else {},
        field_data={"disc": np.array([1, made.dimension]), named: np.array([2, made.dimension - 1])},
    )
    meshio.write(path, raw, file_format=version)
    mesh = read_mesh(path)
    # Format 4.1 sorts points by what they belong to.
    distance, old = cKDTree(made.points).query(mesh.points)
    assert distance.max() < 1e-15
    np.testing.assert_array_equal(old[mesh.cells[kind]], made.cells[kind])
    read = old[mesh.boundaries[named if path.suffix == ".msh" else "2"][facet_kind]]
    assert sorted(read.tolist()) == sorted(facets.tolist())
    check_mesh(mesh, "mesh")


def vtk(path, version, kind, *, field, mark=b""):
    """Two triangles in a binary legacy file, in the regions 1 and 200, as whole numbers of a type of VTK's."""
    kinds = {"int": ">i4", "vtktypeint64": ">i8", "unsigned_char": ">u1", "short": ">i2", "long": ">i8"}
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=">f8")

    def whole(name, values):
        return np.array(values, dtype=kinds[name]).tobytes() + b"\n"

    data = mark + f"# vtk DataFile Version {version}\nx\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 double\n".encode()
    data += corners.tobytes() + b"\n"
    if version == "5.1":
        data += b"CELLS 3 6\nOFFSETS vtktypeint64\n" + whole("vtktypeint64", [0, 3, 6])
        data += b"CONNECTIVITY vtktypeint64\n" + whole("vtktypeint64", [0, 1, 2, 0, 2, 3])
    else:
        data += b"CELLS 2 8\n" + whole("int", [3, 0, 1, 2, 3, 0, 2, 3])
    data += b"CELL_TYPES 2\n" + whole("int", [5, 5]) + b"CELL_DATA 2\n"
    head = f"FIELD FieldData 1\nregion 1 2 {kind}\n" if field else f"SCALARS region {kind} 1\nLOOKUP_TABLE default\n"
    path.write_bytes(data + head.encode() + whole(kind, [1, 200]))
    return path


@pytest.mark.parametrize("field", [True, False])
@pytest.mark.parametrize(
    ("version", "kind"),
    [("5.1", "int"), ("5.1", "vtktypeint64"), ("5.1", "unsigned_char"), ("5.1", "short"), ("5.1", "long"), ("3.0", "int")],
)
def test_whole_numbers_of_binary_vtk_files_are_as_wide_as_their_type(tmp_path, version, kind, field):
    mesh = read_mesh(vtk(tmp_path / "a.vtk", version, kind, field=field))
    assert {name: r["triangle"].tolist() for name, r in mesh.regions.items()} == {"1": [0], "200": [1]}
    assert importlib.import_module("meshio.vtk._vtk_51").vtk_to_numpy_dtype_name["int"] == "int"  # as it is for others


@pytest.mark.parametrize("version", ["5.1", "4.2"])
def test_a_mark_of_utf8_before_a_vtk_file_is_passed_over(tmp_path, version):
    plain = tmp_path / "plain.vtk"
    made = shapes.rectangle((0, 0), (2, 1), (2, 1))
    raw = meshio.Mesh(np.pad(made.points, ((0, 0), (0, 1))), [("quad", made.cells["quad"])])
    meshio.write(plain, raw, file_format=f"vtk{version.replace('.', '')}", binary=False)
    if version == "5.1":
        meshio.vtk.write(plain, raw, fmt_version="5.1", binary=False)
    text = plain.read_bytes()
    assert text.startswith(f"# vtk DataFile Version {version}\n".encode())
    (tmp_path / "marked.vtk").write_bytes(b"\xef\xbb\xbf" + text)
    for one, other in zip((read_mesh("marked.vtk"), read_mesh(plain)), ("marked.vtk", "plain.vtk"), strict=True):
        assert one.source == other
        assert np.array_equal(one.points, made.points)
        assert np.array_equal(one.cells["quad"], made.cells["quad"])
    assert read_mesh(vtk(tmp_path / "b.vtk", version, "int", field=True, mark=b"\xef\xbb\xbf")).cell_count == 2


def view(section, items, *, binary):
    """A view of Gmsh's on some nodes or elements: number, and a value each (an element's nodes: as many values)."""
    each = 3 if section == "ElementNodeData" else 0
    head = f'${section}\n1\n"a view"\n1\n0.0\n3\n0\n1\n{len(items)}\n'.encode()
    if binary:
        kinds = [("number", "<i4"), *([("nodes", "<i4")] if each else []), ("value", "<f8", (max(each, 1),))]
        rows = np.array([(k, *([each] if each else []), [0.1 * k] * max(each, 1)) for k in items], dtype=kinds)
        body = rows.tobytes() + b"\n"
    else:
        body = "".join(f"{k} {f'{each} ' if each else ''}{' '.join(['1.5'] * max(each, 1))}\n" for k in items).encode()
    return head + body + f"$End{section}\n".encode()


@pytest.mark.parametrize("section", ["NodeData", "ElementData", "ElementNodeData"])
@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("version", ["gmsh", "gmsh22"])
def test_views_of_gmsh_on_some_nodes_or_elements_are_passed_over(tmp_path, section, version, binary):
    """They are no part of the mesh, whatever stands behind them."""
    made = shapes.rectangle((0, 0), (2, 1), (2, 1), kind="triangle")
    points, cells = np.pad(made.points, ((0, 0), (0, 1))), [("triangle", made.cells["triangle"])]
    count = len(made.cells["triangle"])
    tags = {"gmsh:physical": [np.ones(count, dtype=int)], "gmsh:geometrical": [np.ones(count, dtype=int)]}
    entities = {"gmsh:dim_tags": np.full((len(points), 2), [2, 1])} if version == "gmsh" else {}
    path = tmp_path / "a.msh"
    raw = meshio.Mesh(points, cells, cell_data=tags, point_data=entities, field_data={"body": np.array([1, 2])})
    meshio.write(path, raw, file_format=version, binary=binary)
    plain, data = read_mesh(path), path.read_bytes()
    views = view(section, [2], binary=binary) + view(section, [4, 1], binary=binary)
    where = data.index(b"$Nodes")
    for text in (data + views, data[:where] + views + data[where:]):
        path.write_bytes(text)
        mesh = read_mesh(path)
        assert np.array_equal(mesh.points, plain.points)
        assert np.array_equal(mesh.cells["triangle"], plain.cells["triangle"])
        assert list(mesh.regions) == ["body"]
    if section != "ElementNodeData":
        path.write_bytes(data + views[:-6])
        assert "it breaks off, or holds something else where numbers should be (no $End" in refused(path)


def test_vtk_data_of_zeros_and_ones_marks_a_group(tmp_path):
    made = shapes.rectangle((0, 0), (2, 1), (2, 1))
    lines = made.boundaries["top"]["line"]
    low = (made.points[:, 1] == 0).astype(int)
    raw = meshio.Mesh(
        np.pad(made.points, ((0, 0), (0, 1))),
        [("quad", made.cells["quad"]), ("line", lines)],
        cell_data={
            "upper side": [np.zeros(2, int), np.ones(2, int)],
            "material": [np.array([4, 5]), np.zeros(2, int)],
            "pressure": [np.zeros(2), np.ones(2)],
        },
        point_data={"low": low, "count": np.arange(len(low))},
    )
    raw.write(tmp_path / "a.vtu")
    mesh = read_mesh(tmp_path / "a.vtu")
    assert list(mesh.boundaries) == ["upper side"]
    assert list(mesh.node_sets) == ["low"]
    assert {k: v["quad"].tolist() for k, v in mesh.regions.items()} == {"4": [0], "5": [1]}
    # The set of nodes serves as a boundary: facets all of whose nodes it holds.
    assert sorted(require_boundary(mesh, "low", "x")["line"].tolist()) == sorted(
        made.boundaries["bottom"]["line"].tolist()
    )


def test_a_mesh_without_groups_reads_and_says_so_when_one_is_asked_for(tmp_path):
    made = shapes.rectangle((0, 0), (2, 1), (2, 1))
    meshio.Mesh(np.pad(made.points, ((0, 0), (0, 1))), [("quad", made.cells["quad"])]).write(tmp_path / "a.vtk")
    mesh = read_mesh(tmp_path / "a.vtk")
    assert not mesh.boundaries
    assert message(lambda: require_boundary(mesh, "left", "contacts.A.slave")) == (
        "contacts.A.slave: 'left' – no such boundary; a.vtk has no named groups; in Gmsh name them with Physical "
        "Curve (plane) or Physical Surface (solid), in Abaqus with *SURFACE or *NSET"
    )
    assert refused(tmp_path / "a.vtk", group="pad") == (
        "mesh.group: 'pad' – a.vtk has no named groups of cells; in Gmsh make them with Physical Surface (plane) or "
        "Physical Volume (solid), in Abaqus with *ELSET"
    )


def test_unknown_boundaries_are_told_with_those_there_are(two_quads):
    mesh = read_mesh(two_quads)
    assert message(lambda: require_boundary(mesh, "lefft", "supports.a.at")) == (
        "supports.a.at: 'lefft' – no such boundary; did you mean left? two.msh has: bottom side, left, tip, middle"
    )
    assert message(lambda: require_boundary(mesh, "tip", "contacts.A.slave")) == (
        "contacts.A.slave: 'tip' – a set of 1 nodes that holds no whole side of a cell on the surface; a contact or a "
        "pressure needs a boundary; two.msh has: bottom side, left, tip, middle"
    )
    assert mesh.boundary_nodes("tip").tolist() == mesh.node_sets["tip"].tolist()
    assert mesh.boundary_nodes("left").tolist() == [0, 3]


def test_files_that_are_not_there_or_not_files(tmp_path):
    (tmp_path / "empty.msh").touch()
    (tmp_path / "folder.msh").mkdir()
    (tmp_path / "mesh.stl").write_text("solid")
    assert refused(tmp_path / "none.msh", where="bodies.disc") == "bodies.disc.file: 'none.msh' – no such file"
    assert refused(tmp_path / "empty.msh") == "mesh.file: 'empty.msh' – the file is empty (0 bytes)"
    assert refused(tmp_path / "folder.msh") == (
        "mesh.file: 'folder.msh' – is a folder; must be a mesh file: .msh, .vtk, .vtu, .inp"
    )
    assert refused(tmp_path / "mesh.stl") == (
        "mesh.file: 'mesh.stl' – is a surface of triangles and no mesh yet; accepted: .msh, .vtk, .vtu, .inp; mesh it in "
        "Gmsh, name boundaries and body, export it as .msh"
    )


@pytest.mark.parametrize("suffix", ["msh", "vtk", "vtu"])
def test_files_that_hold_something_else_print_nothing(tmp_path, suffix, capfd):
    for content in (b"something else\n", b"\x00\xff\xfe" * 50, b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n", b"<VTKFile>"):
        path = tmp_path / f"a.{suffix}"
        path.write_bytes(content)
        assert refused(path).startswith(f"mesh.file: 'a.{suffix}' – ")
    assert capfd.readouterr() == ("", "")


@pytest.mark.filterwarnings("ignore")
def test_a_file_cut_off_anywhere_is_refused_or_is_a_mesh(tmp_path, capfd):
    path = tmp_path / "cut.msh"
    for end in range(20, len(TWO_QUADS) - 20, 9):
        path.write_text(TWO_QUADS[:end])
        try:
            mesh = read_mesh(path)
        except CaseError:
            continue
        check_mesh(mesh, "mesh")
        assert mesh.cell_count == 3
    assert capfd.readouterr() == ("", "")


def test_known_faults_of_gmsh_files_are_told_with_their_remedy(tmp_path):
    path = tmp_path / "a.msh"
    path.write_text(TWO_QUADS.replace("2 1 0 0 2 1 0 1 4 0", "2 1 0 0 2 1 0 0 0"))
    assert refused(path) == (
        "mesh.file: 'a.msh' – is not readable as a Gmsh mesh (format 2.2 or 4.1): only part of its elements is in "
        'physical groups; save it from Gmsh without "Save all elements"'
    )
    path.write_text(TWO_QUADS[: TWO_QUADS.index("2 1 3 1\n6")] + "2 1\n")
    assert refused(path) == (
        "a.msh, line 46: '7 8 1 8' – $Elements says 8 elements in 7 blocks, which are 15 lines, and 10 lines follow; the file "
        "breaks off there; save it from Gmsh again"
    )


def wrong(tmp_path, cells, points=None, suffix="vtu"):
    """The message for a file with such cells."""
    if points is None:
        points = np.random.default_rng(1).random((30, 3))
    path = tmp_path / f"odd.{suffix}"
    meshio.Mesh(points, [(k, np.array(c)) for k, c in cells]).write(path)
    return refused(path)


def test_elements_of_an_entity_that_is_not_there_are_told_with_its_kind_and_number(tmp_path):
    (tmp_path / "a.msh").write_text(TWO_QUADS.replace("\n2 2 3 1\n", "\n2 9 3 1\n"))
    assert refused(tmp_path / "a.msh") == (
        "a.msh, line 58: '2 9 3 1' – elements of surface 9, and $Entities has no surface of this number; save the file "
        "from Gmsh again"
    )
    (tmp_path / "a.msh").write_text(TWO_QUADS.replace("\n2 2 3 1\n", "\n2 2 137 1\n"))
    assert refused(tmp_path / "a.msh").endswith(": it has elements of type 137, which its reader does not know")
    (tmp_path / "a.msh").write_text("(0 \"Fluent\")\n(2 3)\n")
    assert refused(tmp_path / "a.msh") == (
        "mesh.file: 'a.msh' – has no $MeshFormat: it is no mesh of Gmsh's, or of a format before 2; export it from Gmsh as "
        "4.1 or 2.2"
    )
    places = "".join(f"{number} {number} 0 0\n" for number in range(1, 16))
    wedge = f"$Nodes\n15\n{places}$EndNodes\n$Elements\n1\n1 18 0 {' '.join(map(str, range(1, 16)))}\n$EndElements\n"
    (tmp_path / "a.msh").write_text(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{wedge}")
    assert refused(tmp_path / "a.msh").endswith(
        "has elements of type wedge15, which its reader does not know; mesh the body with hexahedra alone, or with tetrahedra"
    )


@pytest.mark.parametrize(
    ("name", "what"),
    [("a.bdf", "a Nastran deck"), ("a.nas", "a Nastran deck"), ("a.med", "a MED mesh"), ("a.UNV", "an I-deas universal file")],
)
def test_meshes_of_other_programs_are_named(tmp_path, name, what):
    (tmp_path / name).write_text("GRID,1\n")
    assert refused(tmp_path / name).endswith(
        f"{name}' – is {what}, which is not read; accepted: .msh, .vtk, .vtu, .inp; open it in Gmsh, name boundaries and "
        "body, export it as .msh"
    )
    mesh = shapes.rectangle((0, 0), (1, 1), (1, 1))
    raw = meshio.Mesh(np.column_stack([mesh.points, np.zeros(4)]), [("quad", mesh.cells["quad"])])
    raw.cell_data["gmsh:physical"] = [np.array([1])]
    raw.cell_data["gmsh:geometrical"] = [np.array([5])]
    raw.point_data["gmsh:dim_tags"] = np.array([[2, 5]] * 4)
    raw.write("b.msh", file_format="gmsh")
    assert read_mesh("b.msh").cell_count == 1
    data = (tmp_path / "b.msh").read_bytes()
    at = data.index(b"$Elements\n") + len(b"$Elements\n") + 32
    assert data[at : at + 8] == np.array([2, 5], dtype="i4").tobytes()
    (tmp_path / "b.msh").write_bytes(data[:at] + np.array([2, 6], dtype="i4").tobytes() + data[at + 8 :])
    assert refused(tmp_path / "b.msh") == (
        "mesh.file: 'b.msh' – has elements of surface 6, and $Entities has no surface of this number; save the file "
        "from Gmsh again"
    )


def test_cells_that_cannot_be_computed_with_are_named_and_counted(tmp_path):
    accepted = "triangle, triangle6, quad, quad8, quad9, tetra, tetra10, hexahedron, hexahedron20, hexahedron27"
    assert wrong(tmp_path, [("wedge", [range(6), range(6)]), ("pyramid", [range(5)]), ("tetra", [range(4)])]) == (
        f"mesh.file: 'odd.vtu' – has cells that cannot be computed with: 2 wedge, 1 pyramid; accepted: {accepted}; mesh "
        "the body with hexahedra alone, or with tetrahedra"
    )
    assert wrong(tmp_path, [("line", [[0, 1]])]) == (
        f"mesh.file: 'odd.vtu' – has no cells; a body needs some of: {accepted}"
    )
    points = np.array([[0, 0, 0.25], [1, 0, 0], [0, 1, 0.5]])
    assert wrong(tmp_path, [("triangle", [[0, 1, 2]])], points) == (
        "mesh.file: 'odd.vtu' – has only triangle cells, and they are not in the plane z = 0 (z from 0 to 0.5); a plane "
        "body lies at z = 0, a solid one is of tetrahedra or hexahedra"
    )
    points[1, 0] = np.nan
    assert wrong(tmp_path, [("triangle", [[0, 1, 2]])], points) == (
        "mesh.file: 'odd.vtu' – has 1 points whose coordinates are not finite numbers"
    )


def test_facets_that_belong_to_nothing_are_refused_unless_a_group_is_the_body(tmp_path):
    path = tmp_path / "a.msh"
    path.write_text(TWO_QUADS.replace("4 1 4\n", "4 1 6\n"))
    assert refused(path) == (
        "mesh.file: 'a.msh' – group left: 1 of its facets are a side of no cell; choose the body by group, or take this "
        "group out of the file"
    )
    assert "left" not in read_mesh(path, group="body").boundaries


def test_elements_that_use_missing_nodes_are_refused(tmp_path):
    path = tmp_path / "a.msh"
    path.write_text(gmsh22(path).read_text().replace("4 4 2 2 1 1 3 2 5", "4 4 2 2 1 1 3 2 77"))
    assert refused(path) == "a.msh, line 23: '4 4 2 2 1 1 3 2 77' – uses node 77, which is not defined"


def test_names_with_odd_letters_in_odd_places(two_quads, tmp_path):
    folder = tmp_path / "Räder und Bremsen"
    folder.mkdir()
    shutil.copy(two_quads, folder / "größe 1.MSH")
    assert read_mesh(folder / "größe 1.MSH").cell_count == 3
    assert read_mesh(str(folder / "größe 1.MSH")).source == "größe 1.MSH"


def test_a_long_path_is_shown_by_its_end(tmp_path):
    folder = tmp_path / ("a" * 80)
    folder.mkdir()
    text = message(lambda: read_mesh(folder / "pad.msh"))
    assert text.endswith("aaa/pad.msh' – no such file")
    assert text.startswith("mesh.file: '…aaa")
    assert "cannot be read: File name too long" in message(lambda: read_mesh(Path("a" * 300 + ".msh")))


def test_another_meshio_reads_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    def otherwise() -> FunctionType:
        raise AttributeError("a name that this version does not have")

    own = importlib.import_module("meshio.gmsh.main").read_buffer
    assert readers._made(otherwise, "meshio.gmsh.main") is own
    assert readers._made(readers._gmsh, "meshio.gmsh.main") is not own
