"""Bodies of matrices that will not do, each with the exact message that the author of the case gets."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.io as sio
import scipy.sparse as sp

import stridor as st
from stridor.mesh.paths import shown_path

pytestmark = pytest.mark.bad_input

CASE = """
[parameters]
Omega = { value = 2.0, range = [0.5, 5.0] }
[bodies.brake]
type = "matrices"
dimension = 2
labels = "dof.txt"
mesh = "brake.inp"
terms = [
  { file = "M.mtx", role = "mass" },
  { file = "K.mtx", role = "stiffness", factor = "Omega**2" },
]
points = { tip = 12 }
"""
NODES = {11: (0.0, 0.0), 12: (1.0, 0.0), 13: (1.0, 1.0), 14: (0.0, 1.0), 15: (2.0, 0.0), 16: (2.0, 1.0)}
CELLS = ((11, 12, 13, 14), (12, 15, 16, 13))
INP = "*NODE\n" + "".join(f"{n}, {x}, {y}\n" for n, (x, y) in NODES.items())
INP += "*ELEMENT, TYPE=CPS4, ELSET=left\n1, 11, 12, 13, 14\n*ELEMENT, TYPE=CPS4, ELSET=right\n2, 12, 15, 16, 13\n"
INP += "*SURFACE, NAME=top\n1, S3\n"
LABELS = [(n, d) for n in NODES for d in (1, 2) if n != 14]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write(tmp_path, "M", np.eye(len(LABELS)))
    write(tmp_path, "K", 1e6 * (np.diag(np.full(len(LABELS), 2.0)) - np.eye(len(LABELS), k=1) - np.eye(len(LABELS), k=-1)))
    (tmp_path / "dof.txt").write_text("".join(f"{n} {d}\n" for n, d in LABELS), encoding="utf-8")
    (tmp_path / "brake.inp").write_text(INP, encoding="utf-8")
    return tmp_path


def write(folder: Path, name: str, matrix: object) -> None:
    sio.mmwrite(folder / f"{name}.mtx", sp.coo_array(matrix), symmetry="general")


def refused(folder: Path, text: str) -> str:
    with pytest.raises(st.CaseError) as caught:
        st.build_system(st.loads(text, folder=folder))
    return str(caught.value)


def test_the_case_itself_is_sound(folder: Path):
    system = st.build_system(st.loads(CASE, folder=folder))
    assert system.size == 10
    assert st.modes(st.loads(CASE, folder=folder)).frequency_hz.shape == (1, 10)


WITHIN = [
    ('role = "mass"', 'role = "stiffness"', 'bodies.brake.terms: none has the role "mass"; without a mass nothing vibrates'),
    ("terms = [", "terms = []\nother = [", "bodies.brake.other: unknown key; did you mean 'terms'? accepted: type, terms, labels, mesh, group, "
     "dimension, thickness, scale, translation, sliding, points"),
    ("Omega**2", "Omga**2", "bodies.brake.terms.1.factor: 'Omga**2' – no such parameter as 'Omga'; did you mean 'Omega'? there are: Omega, mu, pi"),
    ("Omega**2", "1/(Omega-2)", "bodies.brake.terms.1.factor: '1/(Omega-2)' – division by zero at Omega = 2"),
    ("Omega**2", "Omega**", "bodies.brake.terms.1.factor: 'Omega**' – breaks off where a number, a name or a bracket should follow"),
    ('"Omega**2"', "true", "bodies.brake.terms.1.factor: true – must be a number, or an expression of [parameters] and mu such as \"Omega**2 - 1\""),
    ("value = 2.0", "value = 7.0", "parameters.Omega.value: 7.0 – must be in its range, 0.5 to 5"),
    ("range = [0.5, 5.0]", "range = [5.0, 0.5]", "parameters.Omega.range: [5.0, 0.5] – the first number must be below the second"),
    ("value = 2.0", 'value = "2.0"', "parameters.Omega.value: '2.0' – must be a number, the value of the parameter; write it without quotes"),
    ("Omega = {", "Omega = 3\nother = {", "parameters.Omega: 3 – must be a table with the keys value, range"),
    ("[parameters]\nOmega =", "other =", "other: unknown key; accepted: title, units, parameters, materials, bodies, supports, loads, contacts, ties, "
     "springs, dashpots, phases, steady, modal, temporal, comparison, reference"),
    ("[parameters]\nOmega =", "parametres =", "parametres: unknown key; did you mean 'parameters'? accepted: title, units, parameters, materials, bodies, "
     "supports, loads, contacts, ties, springs, dashpots, phases, steady, modal, temporal, comparison, reference"),
    ("Omega =", "sin = { value = 1.0 }\nOmega =", "parameters.sin: sin means something else in a factor; choose another name"),
    ("Omega =", "a-b = { value = 1.0 }\nOmega =", "parameters.a-b: a factor would read - as minus; take letters, digits and _"),
    ("tip = 12", "tip = -1", "bodies.brake.points.tip: -1 – must be a node's number, or [x, y] or [x, y, z], numbers [m]: the mesh node nearest is taken"),
    ("tip = 12", "tip = [1.0, 0.0, 0.0]", "bodies.brake.points.tip: [1.0, 0.0, 0.0] – must have 2 numbers, one for each direction"),
    ('mesh = "brake.inp"\n', 'group = "left"\n', "bodies.brake.group: 'left' – only used with a mesh"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "message"), WITHIN)
def test_tables_that_will_not_do(folder: Path, old: str, new: str, message: str):
    assert old in CASE
    with pytest.raises(st.CaseError) as caught:
        st.loads(CASE.replace(old, new), folder=folder)
    assert str(caught.value) == message


MORE = [
    ('[loads.f]\nat = "brake.top"\nmoment = 1.0', 'loads.f.moment: 1.0 – only a beam takes a moment; give a pair of forces'),
    ('[supports.s]\nat = "brake.tip"\nfixed = ["z"]', "supports.s.fixed: 'z' – brake moves along x, y only"),
    ('[supports.s]\nat = "brake"\nfixed = ["x"]', "supports.s.at: 'brake' – must be a point, \"body.point\", or a boundary, \"body.boundary\", such as brake.tip"),
    ('[supports.s]\nat = "brake.bottom"\nfixed = ["x"]', "supports.s.at: 'bottom' – no such boundary; in brake.inp there is: top"),
    ('[springs.s]\nbetween = ["brake.tip", "ground"]\nstiffness = 1.0', "springs.s.direction: missing – its ends give no line to act along; give direction = [x, y]"),
    ('[bodies.m]\ntype = "mass"\nmass = 1.0\nposition = [0.0, 0.0, 0.0]', "bodies: bodies in the plane (brake) and in space (m) cannot meet in one case; model all of them in 2 or all in 3 dimensions"),
    ('[matrices]\ndimension = 2\nterms = []', 'bodies.matrices.terms: none has the role "mass"; without a mass nothing vibrates'),
    ('[parameters.mu]\nvalue = 0.1\n[bodies.o]\ntype = "obstacle"\nshape = "flat"\npoint = [0.0, 1.0]\nnormal = [0.0, -1.0]\n'
     '[contacts.c]\nslave = "brake.top"\nmaster = "o"\nstiffness = 1e9\nfriction = { law = "coulomb", coefficient = 0.2 }',
     "parameters.mu: the contacts have friction coefficients; set contacts.c.friction.coefficient, or give --mu"),
    ('[materials.m]\nyoung_modulus = 2e11\ndensity = 7800.0\n'
     '[bodies.rail]\ntype = "beam"\nmaterial = "m"\nstart = [0.0, -1.0]\nend = [2.0, -1.0]\nwidth = 0.1\nthickness = 0.1\nelements = 4\n'
     '[contacts.c]\nslave = "brake.tip"\nmaster = "rail"\nstiffness = 1e9\nfriction = { law = "coulomb", coefficient = 0.2 }',
     'contacts.c.side: missing – give "left" or "right" of rail'),
]  # fmt: skip


@pytest.mark.parametrize(("text", "message"), MORE)
def test_references_that_will_not_do(folder: Path, text: str, message: str):
    told = refused(folder, CASE + text)
    if "boundary; in" in message:
        assert told.startswith("supports.s.at: ")
        assert "bottom" in told
        return
    assert told == message


def test_without_a_mesh_there_is_no_geometry(folder: Path):
    bare = CASE.replace('mesh = "brake.inp"\n', "")
    assert st.build_system(st.loads(bare, folder=folder)).size == 10
    contact = """
    [bodies.o]
    type = "obstacle"
    shape = "flat"
    point = [0.0, 1.0]
    normal = [0.0, -1.0]
    [contacts.c]
    slave = "brake.AT"
    master = "o"
    stiffness = 1e9
    friction = { law = "coulomb", coefficient = 0.2 }
    """
    assert refused(folder, bare + contact.replace("AT", "tip")) == (
        "contacts.c.slave: 'brake.tip' – brake has no mesh to say where its nodes are; give bodies.brake.mesh"
    )
    assert refused(folder, bare + contact.replace("AT", "top")) == (
        "contacts.c.slave: 'brake.top' – no such point; brake has: brake.tip; boundaries need its "
        "mesh: give bodies.brake.mesh"
    )
    assert refused(folder, bare.replace("tip = 12", "tip = [1.0, 0.0]")) == (
        "bodies.brake.points.tip: [1.0, 0.0] – coordinates need a mesh; give the number of a node, or a mesh"
    )
    spring = '[springs.s]\nbetween = ["brake.tip", "brake.end"]\nstiffness = 1.0'
    assert refused(folder, bare.replace("tip = 12", "tip = 12, end = 16") + spring) == (
        "springs.s.direction: missing – brake has no mesh to give a line to act along; give direction = [x, y]"
    )


def _shown(folder: Path, name: str) -> str:
    return repr(shown_path(folder / name))


FILES: list[tuple[str, Callable[[Path], object], str]] = [
    ("no matrix", lambda f: (f / "K.mtx").unlink(), "bodies.brake.terms.1.file: {K.mtx} – no such file"),
    ("no labels", lambda f: (f / "dof.txt").unlink(), "bodies.brake.labels: {dof.txt} – no such file"),
    ("no mesh", lambda f: (f / "brake.inp").unlink(), "bodies.brake.mesh: {brake.inp} – no such file"),
    (
        "other size",
        lambda f: write(f, "K", np.eye(4)),
        "bodies.brake.labels: {dof.txt} – names 10 freedoms, K.mtx has 4; write a line for each",
    ),
    (
        "too few labels",
        lambda f: (f / "dof.txt").write_text("11 1\n11 2\n"),
        "bodies.brake.labels: {dof.txt} – names 2 freedoms, M.mtx has 10; write a line for each",
    ),
    (
        "no labels in it",
        lambda f: (f / "dof.txt").write_text("# nothing\n\n"),
        'bodies.brake.labels: {dof.txt} – names no freedoms; write a line "node direction" for each',
    ),
    (
        "odd label",
        lambda f: (f / "dof.txt").write_text("11 1\n11 7\n"),
        "dof.txt, line 2: '11 7' – must be the number of a node and a direction, 1 to 6 or x, y, z, such as \"1201 3\"",
    ),
    (
        "label twice",
        lambda f: (f / "dof.txt").write_text("11 1\n" * 10),
        "bodies.brake.terms: 'M.mtx' – names a freedom twice: node 11, direction 1; each must have a name of its own",
    ),
    (
        "label without node",
        lambda f: (f / "dof.txt").write_text((f / "dof.txt").read_text().replace("16 ", "99 ").replace("15 ", "98 ")),
        "bodies.brake.mesh: {brake.inp} – no element of it has node 98 and 1 more, which the matrices name; give the mesh "
        "of the whole model, or say by group which part of it you mean",
    ),
    ("no mass", lambda f: write(f, "M", np.zeros((10, 10))), "bodies.brake.terms: the mass is zero; without a mass nothing vibrates"),
    (
        "huge",
        lambda f: write(f, "M", 1e200 * np.eye(10)),
        "bodies.brake: its mass, stiffness or damping has entries outside 1e-100 … 1e+100, beyond what can be computed with; "
        "check its matrices",
    ),
    (
        "all held",
        lambda f: write(f, "K", 1e36 * np.eye(10)),
        "bodies.brake.terms: the mass is zero where 1e36 in the stiffness does not hold it; without a mass nothing vibrates",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("change", "message"), [f[1:] for f in FILES], ids=[f[0] for f in FILES])
def test_files_that_will_not_do(folder: Path, change: Callable[[Path], object], message: str):
    change(folder)
    for name in ("M.mtx", "K.mtx", "dof.txt", "brake.inp"):
        message = message.replace("{" + name + "}", _shown(folder, name))
    assert refused(folder, CASE) == message


WRITTEN = [
    (', role = "stiffness"', "", 'bodies.brake.terms.1.role: missing – K.mtx does not say what it holds; give "mass", "damping" or "stiffness"'),
    ("tip = 12", "tip = 14", "bodies.brake.points.tip: 14 – the matrices have no freedoms of this node: it is held, or was left out of them"),
    ("tip = 12", "tip = 99", "bodies.brake.points.tip: 99 – no such node in brake.inp; there are 6 nodes, numbered from 11 to 16"),
    ("tip = 12", "top = [1.0, 1.0]", "bodies.brake.points.top: [1.0, 1.0] – brake.inp has a boundary of this name; choose another name"),
    ('labels = "dof.txt"\n', "", "bodies.brake.labels: missing – the files of the matrices do not say to which nodes their freedoms belong; "
     'give a text file with a line "node direction" for each freedom'),
    ('labels = "dof.txt"\nmesh = "brake.inp"\n', "", "bodies.brake.points.tip: 12 – nothing says which freedoms a node has; give labels"),
    ("dimension = 2", 'dimension = 2\ngroup = "middle"', "bodies.brake.group: 'middle' – no such group of cells; brake.inp has: left, right"),
    ("dimension = 2\n", "", "bodies.brake.dimension: 3 – the mesh has 2 dimensions"),
    ('mesh = "brake.inp"', 'mesh = "brake.msh"', "bodies.brake.mesh: {brake.msh} – is no mesh file by its suffix; accepted: .inp"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "message"), WRITTEN)
def test_what_the_files_do_not_bear_out(folder: Path, old: str, new: str, message: str):
    assert old in CASE
    assert refused(folder, CASE.replace(old, new)) == message.replace("{brake.msh}", _shown(folder, "brake.msh"))


def test_matrices_of_two_sizes_without_labels(folder: Path):
    write(folder, "K", np.eye(4))
    text = CASE.replace('labels = "dof.txt"\nmesh = "brake.inp"\n', "").replace("points = { tip = 12 }\n", "")
    assert refused(folder, text) == (
        "bodies.brake.terms: the matrices differ in size (M.mtx 10, K.mtx 4), and the files do not name their freedoms; "
        "write all for the same freedoms, or in a format with labels"
    )


def test_two_short_forms(folder: Path):
    text = '[bodies.matrices]\ntype = "mass"\nmass = 1.0\nposition = [0.0, 0.0]\n[matrices]\nterms = []\n'
    assert refused(folder, text) == "matrices: stands for [bodies.matrices], which the case has as well; remove one of them"
    assert refused(folder, "matrices = 3\n") == (
        "matrices: 3 – must be a table with a list of terms, or that list, [[matrices]]"
    )


def test_contacts_with_other_coefficients_and_factors_of_mu(folder: Path):
    text = CASE.replace("Omega**2", "1 + mu*Omega")
    for name, coefficient in (("a", 0.1), ("b", 0.2)):
        text += f"""
        [bodies.o{name}]
        type = "obstacle"
        shape = "flat"
        point = [0.0, 1.0]
        normal = [0.0, -1.0]
        sliding = {{ velocity = [1.0, 0.0] }}
        [contacts.{name}]
        slave = "brake.top"
        master = "o{name}"
        stiffness = 1e9
        friction = {{ law = "coulomb", coefficient = {coefficient} }}
        """
    assert refused(folder, text) == (
        "mu: factors of matrices use it, and the contacts have different ones: name it (--mu 0.3)"
    )
    assert st.build_system(st.loads(text, folder=folder), mu=0.3).size == 10
