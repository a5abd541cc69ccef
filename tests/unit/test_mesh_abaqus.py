"""Abaqus and CalculiX input files: what is read, and the line that each mistake is told with."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stridor.errors import CaseError
from stridor.laws import Material
from stridor.mesh import shapes
from stridor.mesh.abaqus import Section, read_abaqus
from stridor.mesh.boundary import require_boundary
from stridor.mesh.files import read_mesh
from stridor.mesh.quality import check_mesh, pieces

PLANE = """*Heading
 Two elements, 100% by hand
** a comment
*NODE, NSET=Everything
1, 0., 0.
2, 1.D0, 0
3, 2., 0., 0.
 4,0,1
5, 1e0, 1,
6, 2, 1

*Element, type=CPS4R, elset=Left
10, 1, 2, 5, 4
*ELEMENT, TYPE=CPE3,
 ELSET = right
20, 2, 3, 6
21, 2, 6, 5,
*NSET, NSET=ends, GENERATE
1, 4, 3
*NSET, nset=EDGES
ends, 3,
6
*ELSET, ELSET=all
left, RIGHT
*SURFACE, NAME=Bottom, TYPE=ELEMENT
left, S1
20, S1
*Surface, name=free
all,
*SURFACE, NAME=picked, TYPE=NODE
ends
5
*MATERIAL, NAME=Steel
*DENSITY
7.8e-9,
*Elastic
2.1D5, 0.3, 20.
*Material, name=rubber
*ELASTIC, TYPE=ENGINEERING CONSTANTS
1,2,3,4,5,6,7,8
1
*MATERIAL, NAME=hot
*DENSITY
1.
*ELASTIC
1., 0.3, 20
2., 0.3, 30
*SOLID SECTION, ELSET=LEFT, MATERIAL=STEEL
2.5
*SOLID SECTION, ELSET=right, MATERIAL=hot
,
*STEP
*STATIC
1,2,3
*CLOAD
EDGES, 1, 5.
*END STEP
"""


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def read(tmp_path):
    """Reads a text as a file a.inp."""

    def reader(text, **options):
        (tmp_path / "a.inp").write_text(text)
        return read_abaqus("a.inp", **options)

    return reader


def refused(call) -> str:
    with pytest.raises(CaseError) as caught:
        call()
    assert "\n" not in str(caught.value)
    return str(caught.value)


def ends(mesh, name):
    return sorted(tuple(map(tuple, mesh.points[line].tolist())) for line in mesh.boundaries[name]["line"])


def test_a_plane_file_with_sets_surfaces_and_materials(read):
    model = read(PLANE)
    mesh = model.mesh
    check_mesh(mesh, "mesh")
    assert mesh.points.tolist() == [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]]
    assert {k: c.tolist() for k, c in mesh.cells.items()} == {"quad": [[0, 1, 4, 3]], "triangle": [[1, 2, 5], [1, 5, 4]]}
    assert {n: {k: i.tolist() for k, i in r.items()} for n, r in mesh.regions.items()} == {
        "Left": {"quad": [0]},
        "right": {"triangle": [0, 1]},
        "all": {"quad": [0], "triangle": [0, 1]},
    }
    assert {n: (s + 1).tolist() for n, s in mesh.node_sets.items()} == {
        "Everything": [1, 2, 3, 4, 5, 6],
        "ends": [1, 4],
        "EDGES": [1, 3, 4, 6],
        "picked": [1, 4, 5],
    }
    assert ends(mesh, "Bottom") == [((0, 0), (1, 0)), ((1, 0), (2, 0))]
    assert len(mesh.boundaries["free"]["line"]) == 6
    assert require_boundary(mesh, "ends", "x")["line"].tolist() == [[3, 0]]
    assert model.materials == {"Steel": Material(2.1e5, 7.8e-9, 0.3)}
    assert model.incomplete == {
        "rubber": "its *ELASTIC is of TYPE=ENGINEERING CONSTANTS; only isotropic elasticity is computed with",
        "hot": "its *ELASTIC depends on temperature, or has several lines",
    }
    assert model.sections == (Section("Left", "Steel", 2.5), Section("right", "hot", None))
    assert model.types == {"CPS4R": 1, "CPE3": 2}


def test_read_mesh_takes_inp_files_with_group_and_scale(read, tmp_path):
    read(PLANE)
    mesh = read_mesh(tmp_path / "a.inp", group="right", scale=0.001)
    assert mesh.points.max() == 0.002
    assert list(mesh.cells) == ["triangle"]
    assert ends(mesh, "Bottom") == [((0.001, 0), (0.002, 0))]
    # The set is cut to the body, and its surface is what the body shows of it: no face between the two.
    assert list(mesh.regions) == ["right", "all"]
    assert refused(lambda: read_mesh("a.inp", group="rihgt")) == (
        "mesh.group: 'rihgt' – no such group of cells; did you mean right? a.inp has: Left, right, all"
    )


def test_clockwise_elements_are_turned_over_with_their_surfaces(read):
    text = PLANE.replace("10, 1, 2, 5, 4", "10, 1, 4, 5, 2").replace("left, S1", "left, S4")
    mesh = read(text).mesh
    check_mesh(mesh, "mesh")
    assert ends(mesh, "Bottom") == [((0, 0), (1, 0)), ((1, 0), (2, 0))]


def written(mesh, type_name, kind, extra="", per_line=16):
    """A mesh of one kind as the text of a file, its elements continued over lines."""
    lines = ["*NODE"]
    lines += [f"{n + 1}, " + ", ".join(f"{v:.17g}" for v in p) for n, p in enumerate(mesh.points)]
    lines.append(f"*ELEMENT, TYPE={type_name}, ELSET=body")
    for e, cell in enumerate(mesh.cells[kind]):
        numbers = [str(e + 1), *(str(n + 1) for n in cell)]
        rows = [numbers[i : i + per_line] for i in range(0, len(numbers), per_line)]
        lines.append(",\n".join(", ".join(row) for row in rows))
    return "\n".join(lines) + "\n" + extra


# The first element's faces as Abaqus's manual lists their corners.
ABAQUS_FACES = {
    "tetra": ["1 2 3", "1 4 2", "2 4 3", "3 4 1"],
    "hexahedron": ["1 2 3 4", "5 8 7 6", "1 5 6 2", "2 6 7 3", "3 7 8 4", "4 8 5 1"],
}


@pytest.mark.parametrize(
    ("kind", "name", "facet"),
    [
        ("tetra", "C3D4", "triangle"),
        ("tetra10", "C3D10M", "triangle6"),
        ("hexahedron", "C3D8I", "quad"),
        ("hexahedron20", "C3D20R", "quad8"),
    ],
)
def test_solid_elements_and_their_faces(read, kind, name, facet):
    made = shapes.block((0, 0, 0), (1, 2, 3), (1, 1, 1), kind=kind)
    faces = ABAQUS_FACES[kind.rstrip("0123456789")]
    extra = "".join(f"*SURFACE, NAME=face{k}\n1, S{k}\n" for k in range(1, len(faces) + 1))
    mesh = read(written(made, name, kind, extra)).mesh
    np.testing.assert_array_equal(mesh.cells[kind], made.cells[kind])
    np.testing.assert_array_equal(mesh.points, made.points)
    for k, corners in enumerate(faces, start=1):
        expected = {int(made.cells[kind][0][int(c) - 1]) for c in corners.split()}
        if f"face{k}" in mesh.boundaries:
            found = mesh.boundaries[f"face{k}"][facet]
            assert set(found[0][: len(expected)].tolist()) == expected
        else:  # between two of the tetrahedra
            assert expected <= set(mesh.node_sets[f"face{k}"].tolist())


def test_c3d10_midside_nodes_are_those_of_abaqus_manual(read):
    # 5 on edge 1-2, 6 on 2-3, 7 on 3-1, 8 on 1-4, 9 on 2-4, 10 on 3-4: in their places no Jacobian is negative.
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    middles = [(corners[i] + corners[j]) / 2 for i, j in ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))]
    nodes = "".join(f"{n + 1},{p[0]},{p[1]},{p[2]}\n" for n, p in enumerate([*corners, *middles]))
    mesh = read(f"*NODE\n{nodes}*ELEMENT,TYPE=C3D10\n1,1,2,3,4,5,6,7,8,9,10\n").mesh
    check_mesh(mesh, "mesh")
    swapped = read(f"*NODE\n{nodes}*ELEMENT,TYPE=C3D10\n1,1,2,3,4,5,6,7,8,10,9\n").mesh
    with pytest.raises(CaseError, match="inverted"):
        check_mesh(swapped, "mesh")


INSTANCES = """*PART, NAME=Square
*NODE
1, 0, 0
2, 1, 0
3, 1, 1
4, 0, 1
*ELEMENT, TYPE=CPS4
1, 1, 2, 3, 4
*NSET, NSET=low
1, 2
*ELSET, ELSET=body
1
*SURFACE, NAME=up
body, S3
*SOLID SECTION, ELSET=body, MATERIAL=m
1.
*END PART
*ASSEMBLY, NAME=A
*INSTANCE, NAME=one, PART=square
*END INSTANCE
**
*INSTANCE, NAME=two, PART=SQUARE
0., 2.
0., 2., 0., 0., 2., 1., 90.
*END INSTANCE
*NSET, NSET=both, INSTANCE=one
3
*NSET, NSET=both, INSTANCE=two
low
*ELSET, ELSET=_side_S2, INTERNAL, INSTANCE=two
1,
*SURFACE, NAME=side
_side_S2, S2
*ELSET, ELSET=dotted
one.body, two.1
*END ASSEMBLY
"""


def test_instances_stand_where_the_assembly_puts_them(read):
    model = read(INSTANCES)
    mesh = model.mesh
    check_mesh(mesh, "mesh")
    assert pieces(mesh) == 2
    # The second: moved by (0, 2), then turned about (0, 2) by a quarter, towards −x.
    np.testing.assert_allclose(mesh.points[4:], [[0, 2], [0, 3], [-1, 3], [-1, 2]], atol=1e-15)
    assert set(mesh.node_sets) == {"one.low", "two.low", "both"}
    assert mesh.node_sets["both"].tolist() == [2, 4, 5]
    assert {n: r["quad"].tolist() for n, r in mesh.regions.items()} == {
        "one.body": [0], "two.body": [1], "dotted": [0, 1], "one": [0], "two": [1],
    }  # fmt: skip
    assert set(mesh.boundaries) == {"one.up", "two.up", "side"}
    np.testing.assert_allclose(mesh.points[mesh.boundaries["side"]["line"][0]], [[0, 3], [-1, 3]], atol=1e-15)
    assert [s.elset for s in model.sections] == ["one.body", "two.body"]
    assert model.incomplete == {"m": "it is not defined in the file"}
    assert read_mesh("a.inp", group="two").cell_count == 1


def test_one_instance_keeps_the_names_of_its_part(read):
    first, rest = INSTANCES.split("**\n")
    text = first + "*NSET, NSET=low, INSTANCE=one\n3\n*END ASSEMBLY\n"
    mesh = read(text).mesh
    assert set(mesh.boundaries) == {"up"}
    assert mesh.node_sets["low"].tolist() == [2]  # the assembly's own set of that name
    assert mesh.node_sets["one.low"].tolist() == [0, 1]
    assert set(mesh.regions) == {"body"}
    assert rest


def test_includes_are_read_in_their_place(read, tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "nodes.txt").write_text("** nodes\n*NODE\n1,0,0\n2,1,0\n*INCLUDE, INPUT=more.txt\n")
    (tmp_path / "parts" / "more.txt").write_text("*NODE\n3,0,1\n")
    (tmp_path / "cells.txt").write_text("1, 1, 2, 3\n")
    mesh = read("*include, input=parts/nodes.txt\n*ELEMENT, TYPE=CPE3, INPUT=cells.txt\n*NSET, NSET=a\n1\n").mesh
    assert mesh.cells["triangle"].tolist() == [[0, 1, 2]]
    assert mesh.node_sets["a"].tolist() == [0]
    (tmp_path / "parts" / "more.txt").write_text("*NODE\n3,0,one\n")
    assert refused(lambda: read_mesh("a.inp")) == (
        "more.txt, line 2: '3,0,one' – 'one' is not a coordinate, a finite number"
    )
    (tmp_path / "parts" / "more.txt").write_text("\n*INCLUDE, INPUT=nodes.txt")
    assert refused(lambda: read_mesh("a.inp")) == (
        "more.txt, line 2: '*INCLUDE, INPUT=nodes.txt' – this file is already being read; a file cannot include itself"
    )
    (tmp_path / "parts" / "more.txt").unlink()
    assert refused(lambda: read_mesh("a.inp")) == (
        "nodes.txt, line 5: '*INCLUDE, INPUT=more.txt' – more.txt cannot be included: no such file; paths count from the "
        "folder of the file"
    )


def test_an_include_is_read_as_if_its_text_stood_there(read, tmp_path):
    nodes = "*NODE, NSET=n\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n5,2,0\n6,2,1\n"
    cells = "*ELEMENT, TYPE=CPS4, ELSET=e\n1,1,2,3,4\n2,2,5,6,3\n*NSET, NSET=a\n1\n2\n"
    lines = (nodes + cells).splitlines(keepends=True)
    flat = read("".join(lines)).mesh
    assert flat.cell_count == 2
    assert flat.node_sets["a"].tolist() == [0, 1]
    for start in range(len(lines)):
        for end in range(start, len(lines) + 1, 3):
            (tmp_path / "deep.txt").write_text("".join(lines[start:end][1:]))
            (tmp_path / "part.txt").write_text("".join(lines[start:end][:1]) + "*INCLUDE, INPUT=deep.txt\n")
            mesh = read("".join([*lines[:start], "*INCLUDE, INPUT=part.txt\n", *lines[end:]])).mesh
            assert mesh.points.tolist() == flat.points.tolist()
            assert mesh.cells["quad"].tolist() == flat.cells["quad"].tolist()
            assert mesh.regions["e"]["quad"].tolist() == [0, 1]
            assert {name: held.tolist() for name, held in mesh.node_sets.items()} == {"n": [*range(6)], "a": [0, 1]}
    (tmp_path / "part.txt").write_text("** set\n7\n")
    assert refused(lambda: read("".join(lines) + "*INCLUDE, INPUT=part.txt\n")) == (
        "part.txt, line 2: '7' – node 7 is not defined"
    )
    (tmp_path / "part.txt").write_text("1,1,2,6,4\n")
    assert refused(lambda: read(nodes + "*ELEMENT, TYPE=CPS4\n1,1,2,3,4\n*INCLUDE, INPUT=part.txt\n")) == (
        "part.txt, line 1: '1,1,2,6,4' – element 1 is already defined in a.inp, line 9"
    )
    assert refused(lambda: read("*INCLUDE, INPUT=part.txt\n" + nodes)) == (
        "part.txt, line 1: '1,1,2,6,4' – no keyword (*NODE, *ELEMENT, …) is above this line that says what it is"
    )
    (tmp_path / "part.txt").write_text("3,0,1\n*ELEMENT, TYPE=CPS3\n1,1,2,3\n")
    assert refused(lambda: read("*NODE, INPUT=part.txt\n1,0,0\n2,1,0\n")) == (
        "part.txt, line 2: '*ELEMENT, TYPE=CPS3' – INPUT of *NODE names a file of its data lines; for keywords: *INCLUDE"
    )


BASE = "*NODE\n1,0,0\n2,1,0\n3,0,1\n*ELEMENT,TYPE=CPS3,ELSET=e\n1,1,2,3\n"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            "\n1,0,0\n*NODE\n",
            "line 2: '1,0,0' – no keyword (*NODE, *ELEMENT, …) is above this line that says what it is",
        ),
        ("*NODE\n1,0,0\n1,0,1\n", "line 3: '1,0,1' – node 1 is already defined, at another place"),
        ("*NODE\n1.5,0,0\n", "line 2: '1.5,0,0' – '1.5' is not the number of a node, a whole number from 1"),
        ("*NODE\n-1,0,0\n", "line 2: '-1,0,0' – '-1' is not the number of a node, a whole number from 1"),
        ("*NODE\n1,nan,0\n", "line 2: '1,nan,0' – 'nan' is not a coordinate, a finite number"),
        ("*NODE\n1,1e999,0\n", "line 2: '1,1e999,0' – '1e999' is not a coordinate, a finite number"),
        ("*NODE\n1,1,2,3,4,5,6,7\n", "line 2: '1,1,2,3,4,5,6,7' – a node is: number, x, y, z"),
        ("*NODE, SYSTEM=C\n1,1,2\n", "line 1: '*NODE, SYSTEM=C' – only rectangular coordinates are read (SYSTEM=R)"),
        (
            "*NGEN\n1,5\n",
            "line 1: '*NGEN' – *NGEN is not read; write the nodes and elements that it makes to the file",
        ),
        ("*ELEMENT\n1,1,2,3\n", "line 1: '*ELEMENT' – *ELEMENT needs TYPE=…"),
        (BASE + "2,1,2,4\n", "line 7: '2,1,2,4' – element 2 uses node 4, which is not defined"),
        (BASE + "2,1,2\n", "line 7: '2,1,2' – an element of type CPS3 is: its number, then 3 nodes"),
        (BASE + "2,1,2,3,1\n", "line 7: '2,1,2,3,1' – an element of type CPS3 is: its number, then 3 nodes"),
        (BASE + "1,2,3,1\n", "line 7: '1,2,3,1' – element 1 is already defined in line 6"),
        (BASE + "*NSET\n1\n", "line 7: '*NSET' – *NSET needs NSET=…"),
        (BASE + "*NSET,NSET=a\n9\n", "line 8: '9' – node 9 is not defined"),
        (BASE + "*NSET,NSET=a\nb\n", "line 8: 'b' – there is no node set B; there are: a"),
        (BASE + "*ELSET,ELSET=a\n1,f\n", "line 8: '1,f' – there is no element set F; there are: e, a"),
        (BASE + "*NSET,NSET=a\na\n", "line 8: 'a' – sets of sets are nested too deep, or hold themselves"),
        (BASE + "*NSET,NSET=a,GENERATE\n1\n", "line 8: '1' – with GENERATE a line is: first, last, step"),
        (
            BASE + "*NSET,NSET=a,GENERATE\n1,3,0\n",
            "line 8: '1,3,0' – '0' is not the number of a node, a whole number from 1",
        ),
        (BASE + "*NSET,NSET=a,INSTANCE=i\n1\n", "line 7: '*NSET,NSET=a,INSTANCE=i' – there is no instance i; there are: none"),
        (
            BASE + "*SURFACE,NAME=s\ne,S4\n",
            "line 8: 'e,S4' – S4 is no face of a triangle; accepted: S1 to S3, or nothing for all outside",
        ),
        (
            BASE + "*SURFACE,NAME=s\ne,SPOS\n",
            "line 8: 'e,SPOS' – SPOS is no face of a triangle; accepted: S1 to S3, or nothing for all outside",
        ),
        (BASE + "*SURFACE,NAME=s\n,S1\n", "line 8: ',S1' – a line of a surface is: element set or element, face (S1, S2, …)"),
        (BASE + "*SURFACE\ne,S1\n", "line 7: '*SURFACE' – *SURFACE needs NAME=…"),
        (
            BASE + "*MATERIAL,NAME=m\n*ELASTIC\n-1,0.3\n",
            "line 9: '-1,0.3' – elasticity is: Young's modulus, above 0, and Poisson's ratio, above -1 and below 0.5",
        ),
        (BASE + "*MATERIAL,NAME=m\n*DENSITY\n0\n", "line 9: '0' – a density must be greater than 0"),
        (BASE + "*MATERIAL,NAME=m\n*DENSITY\n", "line 8: '*DENSITY' – *DENSITY needs a line of data"),
        (
            BASE + "*SOLID SECTION,ELSET=f,MATERIAL=m\n",
            "line 7: '*SOLID SECTION,ELSET=f,MATERIAL=m' – there is no element set f; there are: e",
        ),
        ("*PART,NAME=p\n" + BASE, "line 6: '*ELEMENT,TYPE=CPS3,ELSET=e' – the file ends before *END PART"),
        ("*PART,NAME=p\n" + BASE + "*END PART\n", "line 8: '*END PART' – the file has parts, but no *INSTANCE of one"),
        ("*END PART\n", "line 1: '*END PART' – there is no *PART to end"),
        ("*END INSTANCE\n", "line 1: '*END INSTANCE' – there is no *INSTANCE to end"),
        ("*INSTANCE,NAME=i,PART=p\n", "line 1: '*INSTANCE,NAME=i,PART=p' – there is no part p; there are: none"),
        (
            INSTANCES.replace("0., 2., 0., 0., 2., 1., 90.", "0., 2., 0., 0., 2., 0., 90."),
            "line 24: '0., 2., 0., 0., 2., 0., 90.' – the two points of the axis must be apart",
        ),
    ],
)
def test_wrong_lines_are_told_with_file_and_number(read, text, told):
    assert refused(lambda: read(text)) == f"a.inp, {told}"


def test_files_without_a_body(read):
    accepted = "CPS3, CPE3, CPS4, CPE4, CPS6, CPE6, CPS8, CPE8, C3D4, C3D8, C3D10, C3D20"
    nodes = "*NODE\n1,0,0\n2,1,0\n3,0,1\n4,1,1\n"
    assert refused(lambda: read("*HEADING\nnothing here\n")) == (
        f"mesh.file: 'a.inp' – has no cells; a body needs some of: {accepted}"
    )
    shells = "*ELEMENT,TYPE=S4R,ELSET=shell\n1,1,2,4,3\n2,2,1,3,4\n*ELEMENT,TYPE=M3D3\n3,1,2,3\n*ELEMENT,TYPE=CAX4\n4,1,2,4,3\n"
    assert refused(lambda: read(nodes + shells)) == (
        f"mesh.file: 'a.inp' – has cells that cannot be computed with: 2 S4R, 1 M3D3, 1 CAX4; accepted: {accepted}"
    )
    # Chosen by its set, the body is read all the same.
    body = nodes + shells + "*ELEMENT,TYPE=CPS4,ELSET=body\n9,1,2,4,3\n*SURFACE,NAME=s\nshell,SPOS\nbody,S1\n"
    assert read(body, group="body").mesh.cell_count == 1
    assert read(body, group="body").mesh.boundaries["s"]["line"].tolist() == [[0, 1]]
    assert refused(lambda: read_mesh("a.inp", group="shell")).startswith(
        "mesh.file: 'a.inp' – has cells that cannot be computed with: 2 S4R; accepted: CPS3,"
    )
    assert refused(lambda: read("*NODE\n1,0,0,1\n2,1,0,1\n3,0,1,1\n*ELEMENT,TYPE=CPS3\n1,1,2,3\n")) == (
        "mesh.file: 'a.inp' – has only triangle cells, and they are not in the plane z = 0 (z from 1 to 1); a plane body "
        "lies at z = 0, a solid one is of tetrahedra or hexahedra"
    )


def test_files_that_are_no_text(tmp_path):
    (tmp_path / "b.inp").write_bytes(b"*NODE\n1,0,0\0")
    assert refused(lambda: read_abaqus("b.inp")) == "b.inp: cannot be read: not a text file"
    (tmp_path / "c.inp").write_bytes(BASE.replace("ELSET=e", "ELSET=Räder").encode("latin-1").replace(b"\n", b"\r\n"))
    assert list(read_abaqus("c.inp").mesh.regions) == ["Räder"]


def test_nodes_of_elements_as_a_node_set_and_huge_ranges(read):
    mesh = read(BASE + "*NSET,NSET=n,ELSET=e\n*ELSET,ELSET=g,GENERATE\n1,999999999999999999999,1\n").mesh
    assert mesh.node_sets["n"].tolist() == [0, 1, 2]
    assert mesh.regions["g"]["triangle"].tolist() == [0]


@settings(max_examples=250, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    source=st.sampled_from([PLANE, INSTANCES]),
    edits=st.lists(
        st.tuples(
            st.integers(0, 1100),
            st.integers(0, 6),
            st.sampled_from(
                ["", ",", "*", "\n", "=", "1", "0", "-", ".", "e", '"', "é", "\t", "9" * 20, "*PART, NAME=x\n", "\n1, 2\n",
                 "*INCLUDE, INPUT=", "GENERATE", "*END PART\n", "*INSTANCE, NAME=z\n", "1e308", "S6", "two."]
            ),
        ),
        min_size=1,
        max_size=4,
    ),
)  # fmt: skip
def test_whatever_is_done_to_a_file_only_case_errors_come_of_it(read, source, edits):
    text = source
    for place, removed, added in edits:
        at = place % (len(text) + 1)
        text = text[:at] + added + text[at + removed :]
    try:
        mesh = read(text).mesh
    except CaseError as error:
        assert all(str(p).count("\n") == 0 for p in error.problems)  # noqa: PT017
    else:
        assert mesh.cell_count > 0
        assert np.isfinite(mesh.points).all()


def test_nodes_with_axes_of_their_own_are_told(tmp_path):
    """*TRANSFORM of a part goes with its instances; nodes outside the body are left out."""
    part = BASE.replace("*NODE", "*PART, NAME=p\n*NODE") + "*NSET,NSET=t,INTERNAL\n2\n*TRANSFORM,NSET=t\n0,1,0,-1,0,0\n*END PART\n"
    instances = "".join(f"*INSTANCE,NAME={n},PART=p\n{k},0,0\n*END INSTANCE\n" for k, n in enumerate("ab"))
    more = "*NSET,NSET=s,INSTANCE=b\n3\n*TRANSFORM,NSET=s\n0,1,0,-1,0,0\n*TRANSFORM,NSET=a.t\n0,1,0,-1,0,0\n"
    file = tmp_path / "m.inp"
    file.write_text(part + instances + more, encoding="utf-8")
    mesh = read_abaqus(file).mesh
    assert mesh.turned is not None
    assert mesh.turned.tolist() == [1, 4, 5]
    assert not mesh.node_sets.keys() & {"t", "a.t", "b.t"}
    alone = read_abaqus(file, group="b").mesh
    assert alone.turned is not None
    assert alone.turned.tolist() == [1, 2]
