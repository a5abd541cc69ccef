"""Matrices of other programs as bodies of a case: beside meshed ones, in contact, with factors, of any structure."""

from __future__ import annotations

import functools
import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
import scipy.io as sio
import scipy.sparse as sp

import program
import stridor as st
from rubbing_block import rubbing_block
from stridor.mesh.model import Mesh
from stridor.study.matrix_reports import matrix_reports
from stridor.system.bodies import BuiltBody, build_bodies

MODAL = "max_frequency_hz = 40e3\nmodes = 8"
COARSE = ("divisions = [10, 2]", "divisions = [10, 1]")
MESHED = rubbing_block(MODAL).replace(*COARSE)
IMPORTED = rubbing_block(MODAL, """
type = "matrices"
dimension = 2
mesh = "block.inp"
labels = "dof.txt"
terms = [
  { file = "M.mtx", role = "mass" },
  { file = "C.mtx", role = "damping" },
  { file = "K.mtx", role = "stiffness" },
MORE]
points = { crown = CROWN }
""").replace(*COARSE)


def write_mesh(path: Path, mesh: Mesh, numbers: np.ndarray, order: np.ndarray, scale: float = 1.0) -> None:
    """An Abaqus file of a mesh of quadrilaterals, its nodes numbered and listed as asked for."""
    rows = ["*NODE"]
    rows += [f"{numbers[k]}, " + ", ".join(repr(float(x / scale)) for x in mesh.points[k]) for k in order]
    rows += ["*ELEMENT, TYPE=CPE4, ELSET=body"]
    rows += [f"{k + 1}, " + ", ".join(str(numbers[n]) for n in cell) for k, cell in enumerate(mesh.cells["quad"])]
    for name in mesh.boundaries:
        inside = set(mesh.boundary_nodes(name).tolist())
        rows.append(f"*SURFACE, NAME={name}")
        for k, cell in enumerate(mesh.cells["quad"]):
            rows += [f"{k + 1}, S{f + 1}" for f in range(4) if {cell[f], cell[(f + 1) % 4]} <= inside]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


class Export:
    """The block of the meshed case as another program might write it: nodes numbered and freedoms ordered at random."""

    def __init__(self, folder: Path, *, keep: np.ndarray | None = None, scale: float = 1.0) -> None:
        self.folder = folder
        self.body: BuiltBody = build_bodies(st.loads(MESHED))["block"]
        rng = np.random.default_rng(7)
        nodes = len(self.body.points)
        self.numbers = rng.choice(np.arange(1, 900), nodes, replace=False)
        freedoms = rng.permutation(2 * nodes)
        self.freedoms = freedoms if keep is None else freedoms[np.isin(freedoms, keep)]
        for name in ("mass", "damping", "stiffness"):
            # mm, N, s, tonnes: N/mm are a thousandth of N/m.
            matrix = scale * getattr(self.body, name)[self.freedoms][:, self.freedoms]
            letter = {"mass": "M", "damping": "C", "stiffness": "K"}[name]
            sio.mmwrite(folder / f"{letter}.mtx", sp.coo_array(matrix), precision=17)
        lines = [f"{self.numbers[f // 2]} {f % 2 + 1}" for f in self.freedoms]
        (folder / "dof.txt").write_text("# node direction\n" + "\n".join(lines), encoding="utf-8")
        assert self.body.mesh is not None
        write_mesh(folder / "block.inp", self.body.mesh, self.numbers, rng.permutation(nodes), scale)
        crown = np.linalg.norm(self.body.points - np.array([0.0, 0.02]), axis=1).argmin()
        self.text = IMPORTED.replace("CROWN", str(self.numbers[crown]))

    def case(self, more: str = "") -> st.Case:
        return st.loads(self.text.replace("MORE", more), folder=self.folder)


@pytest.fixture
def export(tmp_path: Path) -> Export:
    return Export(tmp_path)


def eigenvalues(case: st.Case) -> list[np.ndarray]:
    """At μ = 0 and 0.4."""
    return [np.sort_complex(st.modes(case, mu).eigenvalues[0]) for mu in (0.0, 0.4)]


@functools.cache
def eigenvalues_before(text: str) -> list[np.ndarray]:
    """Of a case that several tests compare with."""
    return eigenvalues(st.loads(text))


def assert_same_modes(meshed: st.Case, other: st.Case, *, rel: float = 1e-10) -> None:
    for first, second in zip(eigenvalues_before(meshed.text), eigenvalues(other), strict=True):
        assert len(first) > 3
        assert second == pytest.approx(first, rel=rel, abs=rel * np.abs(first).max())


def test_a_body_of_matrices_touches_a_meshed_one_as_if_it_were_meshed_itself(export: Export):
    meshed, imported = st.loads(MESHED), export.case()
    assert_same_modes(meshed, imported)
    ours, theirs = st.build_system(meshed), st.build_system(imported)
    assert theirs.symmetric_definite
    watched = [np.abs(s.points["block.crown"].free.toarray()).sum() for s in (ours, theirs)]
    assert watched[0] == watched[1] == 1.0  # x is held by the support
    assert st.steady_sliding(imported).resultants["face"].force == pytest.approx([800.0, 2000.0])
    assert f"block node {export.numbers[0]} y" in theirs.dof_names
    first, second = (st.onsets(c, (0.3, 0.36), max_frequency_hz=30e3).first for c in (meshed, imported))
    assert first is not None
    assert second is not None
    assert second.mu == pytest.approx(first.mu, rel=1e-9)


def test_loads_supports_and_springs_at_nodes_by_number(export: Export):
    changes = {
        "loads.push": {"at": "block.crown", "force": [3.0, -5.0]},
        "springs.s": {"between": ["block.crown", "ground"], "direction": [0.0, 1.0], "stiffness": 1e9},
        "supports.holder.at": "block.crown",
    }
    meshed, imported = st.loads(MESHED).with_(changes), export.case().with_(changes)
    assert_same_modes(meshed, imported)
    forces = [st.build_system(c).loads["push"].sum() for c in (meshed, imported)]
    assert forces == [-5.0, -5.0]


def test_what_the_other_program_held_is_held(tmp_path: Path):
    """Its matrices lack these freedoms; supports on them change nothing, and cannot move them."""
    case = st.loads(MESHED)
    body = build_bodies(case)["block"]
    top = body.mesh.boundary_nodes("top")
    export = Export(tmp_path, keep=np.setdiff1d(np.arange(2 * len(body.points)), 2 * top))
    imported = export.case()
    assert_same_modes(case, imported)
    assert_same_modes(case, imported.with_({"supports.holder": None}))
    with pytest.raises(st.CaseError, match="lack 6 of its freedoms, held by the program that wrote them"):
        st.build_system(imported.with_({"supports.holder.velocity": {"x": 1.0}}))
    without = Export(tmp_path, keep=np.setdiff1d(np.arange(2 * len(body.points)), [2 * top[0], 2 * top[0] + 1]))
    warnings = st.describe(without.case()).warnings
    assert any("1 of 36 nodes of the mesh have no freedoms and count as held" in w for w in warnings)


def test_abaqus_holds_freedoms_by_1e36(export: Export):
    stiffness = sp.lil_array(sio.mmread(export.folder / "K.mtx"))
    top = export.body.mesh.boundary_nodes("top")
    for place in np.flatnonzero(np.isin(export.freedoms, 2 * top)):
        stiffness[place, place] = 1e36
    sio.mmwrite(export.folder / "K.mtx", sp.coo_array(stiffness), precision=17)
    assert_same_modes(st.loads(MESHED), export.case().with_({"supports.holder": None}))


def test_millimetres_become_metres(tmp_path: Path):
    export = Export(tmp_path, scale=0.001)
    assert_same_modes(st.loads(MESHED), export.case().with_({"bodies.block.scale": 0.001}), rel=1e-9)


def test_rotations_stay_as_they_are_where_millimetres_become_metres(tmp_path: Path):
    """[N/mm, N; N, N mm] of a bending stiffness, and its mass in tonnes."""
    sio.mmwrite(tmp_path / "K.mtx", sp.coo_array(np.array([[12.0, -6.0], [-6.0, 4.0]])))
    sio.mmwrite(tmp_path / "M.mtx", sp.coo_array(np.diag([3.0, 2.0])))
    (tmp_path / "dof.txt").write_text("7 z\n7 roty\n", encoding="utf-8")
    text = """
    [matrices]
    labels = "dof.txt"
    scale = 0.001
    terms = [{ file = "M.mtx", role = "mass" }, { file = "K.mtx", role = "stiffness" }]
    points = { tip = 7 }
    """
    case = st.loads(text, folder=tmp_path)
    system = st.build_system(case)
    assert system.dof_names == ("matrices node 7 z", "matrices node 7 rotation y")
    assert system.stiffness.toarray() == pytest.approx(np.array([[12e3, -6.0], [-6.0, 4e-3]]))
    assert system.mass.toarray() == pytest.approx(np.diag([3e3, 2e-3]))
    assert system.points["matrices.tip"].free.toarray().tolist() == [[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]]


def test_moves_of_the_mesh_and_groups(export: Export):
    meshed = st.loads(MESHED).with_({"bodies.block.mesh.corner": [-0.005, 0.0]})
    assert_same_modes(meshed, export.case().with_({"bodies.block.translation": [0.005, 0.0]}))
    assert_same_modes(st.loads(MESHED), export.case().with_({"bodies.block.group": "body"}))


def test_axes_of_nodes_that_the_mesh_turns_are_refused(export: Export):
    """Abaqus writes matrices along the axes of *TRANSFORM: taken as x and y they would be another body's."""
    deck = export.folder / "block.inp"
    plain = deck.read_text(encoding="utf-8")
    one, two = (int(n) for n in export.numbers[:2])
    turn = f"*NSET, NSET=bolts\n{one}, {two}\n*TRANSFORM, NSET=Bolts, TYPE=C\n0., 0., 0., 0., 0., 1.\n"
    deck.write_text(plain + turn, encoding="utf-8")
    with pytest.raises(st.CaseError, match=f"bodies.block.mesh: .*block.inp.* gives node {min(one, two)} and 1 more axes") as told:
        st.build_system(export.case())
    assert "they must be in global axes: write matrices and mesh without *TRANSFORM" in str(told.value)
    # Of nodes that the matrices do not name, and of a meshed body, axes say nothing.
    other = "*NODE, NSET=far\n990, 5., 5.\n*TRANSFORM, NSET=far\n0., 1., 0., -1., 0., 0.\n"
    deck.write_text(plain + other, encoding="utf-8")
    assert_same_modes(st.loads(MESHED), export.case())
    deck.write_text(plain + turn, encoding="utf-8")
    assert_same_modes(st.loads(MESHED), st.loads(MESHED).with_({"bodies.block.mesh": None, "bodies.block.file": str(deck)}))


def test_freedoms_of_no_node_come_last(export: Export):
    """A rotation and an internal freedom that hang on two displacements by springs."""
    n = len(export.freedoms)
    for letter in ("M", "C", "K"):
        old = sp.coo_array(sio.mmread(export.folder / f"{letter}.mtx"))
        extra = {"M": [0.01, 0.02], "C": [0.0, 0.0], "K": [0.0, 0.0]}[letter]
        whole = sp.lil_array(sp.block_diag([old, sp.diags_array(extra)]))
        if letter == "K":
            for k in (0, 1):
                for a, b, sign in ((k, k, 1), (n + k, n + k, 1), (k, n + k, -1), (n + k, k, -1)):
                    whole[a, b] += sign * 1e7
        sio.mmwrite(export.folder / f"{letter}.mtx", sp.coo_array(whole), precision=17)
    with (export.folder / "dof.txt").open("a", encoding="utf-8") as labels:
        labels.write(f"\n{export.numbers[3]} 6\n-1 0\n")
    imported = export.case()
    system = st.build_system(imported)
    assert system.dof_names[-2:] == (f"block node {export.numbers[3]} rotation z", "block internal freedom 1")
    masses = {
        f"bodies.ball{k}": {"type": "mass", "mass": mass, "position": [0.05 + k, 0.05]}
        for k, mass in ((0, 0.01), (1, 0.02))
    }
    # The same with point masses, each free along one direction only.
    free = [export.freedoms[k] for k in (0, 1)]
    rest = {
        **masses,
        **{f"bodies.block.points.end{k}": export.body.points[f // 2].tolist() for k, f in enumerate(free)},
        **{f"supports.rail{k}": {"at": f"ball{k}", "fixed": ["xy"[1 - f % 2]]} for k, f in enumerate(free)},
        **{
            f"springs.s{k}": {
                "between": [f"ball{k}", f"block.end{k}"],
                "stiffness": 1e7,
                "direction": [[1.0, 0.0], [0.0, 1.0]][f % 2],
            }
            for k, f in enumerate(free)
        },
    }
    assert_same_modes(st.loads(MESHED).with_(rest), imported)


def test_files_of_abaqus_name_freedoms_and_say_what_they_are(export: Export):
    for letter, kind in (("M", "MASS2"), ("C", "DMPV1"), ("K", "STIF1")):
        matrix = sp.coo_array(sio.mmread(export.folder / f"{letter}.mtx"))
        names = [f"{export.numbers[f // 2]},{f % 2 + 1}" for f in export.freedoms]
        lines = [
            f"{names[i]}, {names[j]}, {float(x)!r}" for i, j, x in zip(matrix.row, matrix.col, matrix.data, strict=True)
        ]
        (export.folder / f"job_{kind}.mtx").write_text("\n".join(lines) + "\n", encoding="utf-8")
    files = [{"file": str(export.folder / f"job_{kind}.mtx")} for kind in ("STIF1", "MASS2", "DMPV1")]
    case = export.case()
    named = case.with_({"bodies.block.terms": files, "bodies.block.labels": None})
    assert_same_modes(case, named)
    with pytest.raises(st.CaseError, match=r"job_STIF1\.mtx names its freedoms itself; leave labels out"):
        st.build_system(case.with_({"bodies.block.terms": files}))


@pytest.mark.slow
def test_unsymmetric_terms_beside_contact_are_found_by_the_general_solver(export: Export):
    """A skew part too small to matter takes the other way to the same modes, with penalty and rigid contact."""
    n = len(export.freedoms)
    skew = sp.coo_array((np.array([1.0, -1.0]), ([0, 1], [1, 0])), shape=(n, n))
    sio.mmwrite(export.folder / "S.mtx", skew, precision=17)
    general = export.case('{ file = "S.mtx", role = "stiffness", factor = "2e-1*sqrt(4)" },')
    system = st.build_system(general)
    assert system.not_symmetric_definite == "the stiffness matrix is not symmetric"
    for stiffness in (1e12, "rigid"):
        change = {"contacts.face.stiffness": stiffness}
        assert_same_modes(st.loads(MESHED).with_(change), general.with_(change), rel=1e-7)
    undamped = st.modes(general, 0.0, damped=False)
    assert np.abs(undamped.growth_rate).max() < 1e-5
    found = st.modes(general, [0.1, 0.4], vectors=True)
    assert len(found.completeness) == 2
    assert all("Complete" in sentence for sentence in found.completeness)
    assert np.nanmax(found.residual) < 1e-10  # a mode that is in the band at one μ alone has none at the other
    assert found.right is not None
    assert found.left is not None
    assert all(s.endswith("from where branches were followed.") for s in found.completeness)
    short = {"phases": [{"name": "slide", "duration": 1e-4}], "temporal.watch": ["block.crown"]}
    ours, theirs = (st.simulate(case.with_(short)) for case in (st.loads(MESHED), general))
    assert theirs.step < ours.step  # circulatory forces ask for a smaller one
    short["temporal.step"] = ours.step
    theirs = st.simulate(general.with_(short))
    assert theirs.path_reason.startswith("matrices that are not symmetric")
    assert theirs.displacement[-1] == pytest.approx(ours.displacement[-1], rel=1e-7, abs=1e-16)
    assert any("time loop: assembled path" in line for line in st.describe(general.with_(short)).lines)


ROTOR = """
[parameters]
Omega = { value = 10.0, range = [0.0, 500.0] }
[modal]
max_frequency_hz = 200.0
[matrices]
terms = [
  { file = "M.mtx", role = "mass" },
  { file = "G.mtx", role = "damping", factor = "2*Omega" },
  { file = "K.mtx", role = "stiffness" },
  { file = "M.mtx", role = "stiffness", factor = "-Omega**2" },
]
"""


@pytest.fixture
def rotor(tmp_path: Path) -> Path:
    """A mass on springs in a frame that turns at Ω: seen from there it vibrates at ω₀ ± Ω."""
    for name, matrix in (("M", 2.0 * np.eye(2)), ("K", 2.0 * 300.0**2 * np.eye(2)), ("G", [[0.0, -2.0], [2.0, 0.0]])):
        sio.mmwrite(tmp_path / f"{name}.mtx", sp.coo_array(np.array(matrix)))
    (tmp_path / "rotor.toml").write_text(ROTOR, encoding="utf-8")
    return tmp_path / "rotor.toml"


@pytest.mark.parametrize("speed", [0.0, 10.0, 120.0, 290.0])
def test_a_gyroscopic_rotor_whirls_as_in_closed_form(rotor: Path, speed: float):
    case = st.load(rotor).with_({"parameters.Omega.value": speed})
    found = st.modes(case)
    assert found.frequency_hz[0] == pytest.approx(np.array([300.0 - speed, 300.0 + speed]) / (2 * np.pi), rel=1e-12)
    assert np.abs(found.growth_rate).max() < 1e-9
    assert "Complete" in found.completeness[0]
    if speed:
        # Gyroscopic forces are no damping.
        assert st.modes(case, damped=False).eigenvalues == pytest.approx(found.eigenvalues, rel=1e-12)


def test_the_verbs_and_overrides(rotor: Path):
    def stridor(verb: str, *words: str) -> subprocess.CompletedProcess[str]:
        return program.stridor(verb, rotor.name, *words, cwd=rotor.parent)

    done = stridor("modes", "--set", "parameters.Omega.value=100", "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    frequencies = [mode["frequency_hz"] for mode in document["modes"][0]]
    assert frequencies == pytest.approx([200 / (2 * np.pi), 400 / (2 * np.pi)])
    assert document["completeness"][0].startswith("Modes up to 200 Hz that decay at less than 628.3 1/s. Complete: QZ")
    done = stridor("modes", "--set", "parameters.Omga.value=100")
    assert done.returncode == 2
    assert done.stderr == "stridor: parameters.Omga: no such parameter; did you mean 'Omega'? the case has: Omega\n"
    done = stridor("modes", "--set", "parameters.Omega.value=1000.0")
    assert done.stderr == "stridor: parameters.Omega.value: 1000.0 – must be in its range, 0 to 500\n"
    done = stridor("matrices")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("matrices:\n  2 freedoms\n")
    assert "C has a gyroscopic (antisymmetric) part" in done.stdout
    done = stridor("check")
    assert done.returncode == 0, done.stderr
    assert "parameter Omega = 10" in done.stdout
    assert "  matrices: matrices (M.mtx, G.mtx, K.mtx), 2 free" in done.stdout


def test_matrices_that_depend_on_the_friction_coefficient(tmp_path: Path):
    """Two masses coupled by friction in another program: λ⁴ − … flutters beyond the μ at which frequencies meet."""
    sio.mmwrite(tmp_path / "M.mtx", sp.coo_array(np.eye(2)))
    sio.mmwrite(tmp_path / "K.mtx", sp.coo_array(np.diag([1.0e4, 1.2e4])))
    sio.mmwrite(tmp_path / "F.mtx", sp.coo_array(np.array([[0.0, 1.0], [-1.0, 0.0]])))
    text = """
    [modal]
    max_frequency_hz = 50.0
    [[matrices]]
    file = "M.mtx"
    role = "mass"
    [[matrices]]
    file = "K.mtx"
    role = "stiffness"
    [[matrices]]
    file = "F.mtx"
    role = "stiffness"
    factor = "4e3*mu"
    """
    case = st.loads(text, folder=tmp_path)
    mus = [0.0, 0.2, 0.3]
    found = st.modes(case, mus)
    for row, mu in enumerate(mus):
        square = np.emath.sqrt(1e6 - (4e3 * mu) ** 2)
        expected = np.array([1j * np.emath.sqrt(1.1e4 + sign * square) for sign in (-1, 1)])
        away = np.abs(found.eigenvalues[row][:, None] - expected)
        assert away.min(axis=0).max() < 1e-9
        assert away.min(axis=1).max() < 1e-9
    assert found.unstable.any(axis=1).tolist() == [False, False, True]
    assert st.modes(case).growth_rate == pytest.approx(0.0, abs=1e-9)  # nothing gives it a μ
    given = case.with_({"parameters.mu": {"value": 0.3}})
    assert st.modes(given).eigenvalues == pytest.approx(found.eigenvalues[2:], rel=1e-12)
    # (k₂ − k₁)/2 = 4000 μ where the frequencies meet.
    (onset,) = st.onsets(case).onsets
    assert onset.mu == pytest.approx(0.25, rel=1e-12)
    assert st.to_dataset(st.onsets(case)).attrs["completeness"].startswith("Complete")
    dataset = st.to_dataset(found)
    assert "Complete" in dataset.attrs["completeness"]


def test_freedoms_without_mass(tmp_path: Path):
    """A spring in series with a massless freedom between: modes take it, the time loop says that it cannot."""
    sio.mmwrite(tmp_path / "M.mtx", sp.coo_array(np.diag([1.0, 0.0])))
    sio.mmwrite(tmp_path / "K.mtx", sp.coo_array(np.array([[2.0e4, -2.0e4], [-2.0e4, 4.0e4]])))
    terms = [{"file": "M.mtx", "role": "mass"}, {"file": "K.mtx", "role": "stiffness"}]
    (tmp_path / "c.toml").write_text(
        "[modal]\nmax_frequency_hz = 50.0\n[matrices]\nterms = ["
        + ", ".join("{ " + ", ".join(f'{k} = "{v}"' for k, v in t.items()) + " }" for t in terms)
        + "]\n",
        encoding="utf-8",
    )
    case = st.load(tmp_path / "c.toml")
    assert st.modes(case).eigenvalues[0] == pytest.approx([100j], rel=1e-12, abs=1e-9)
    with pytest.raises(st.AnalysisError, match="simulate: 1 freedom has no mass, and the time loop needs one at each"):
        st.simulate(case)


def test_terms_of_one_role_add_up_and_the_case_says_itself_again(export: Export):
    sio.mmwrite(export.folder / "H.mtx", 0.5 * sp.coo_array(sio.mmread(export.folder / "K.mtx")), precision=17)
    more = '{ file = "H.mtx", role = "stiffness" }, { file = "H.mtx", role = "stiffness", factor = -1.0 },'
    case = export.case(more)
    assert_same_modes(export.case(), case)
    assert st.loads(case.text) == case
    lines = st.describe(case).lines
    assert "  block: matrices (M.mtx, C.mtx, K.mtx, H.mtx), 36 nodes of block.inp, 66 free" in lines


def test_everything_of_symmetric_matrices_runs_in_time_too(export: Export):
    case = export.case().with_({"phases": [{"name": "slide", "duration": 2e-4}], "temporal.watch": ["block.crown"]})
    meshed = st.loads(MESHED).with_({"phases": [{"name": "slide", "duration": 2e-4}], "temporal.watch": ["block.crown"]})
    ours, theirs = st.simulate(meshed), st.simulate(case)
    assert theirs.displacement[-1] == pytest.approx(ours.displacement[-1], rel=1e-7, abs=1e-16)


SPACE = """
materials.steel = { young_modulus = 200e9, density = 7800.0, poisson_ratio = 0.3 }
materials.pad = { young_modulus = 2e9, density = 2000.0, poisson_ratio = 0.3 }
[bodies.slider]
type = "solid"
model = "3d"
material = "steel"
mass = "consistent"
mesh = { shape = "block", corner = [-0.02, -0.02, -0.01], size = [0.04, 0.04, 0.01], divisions = [3, 3, 1], cells = "hexahedron" }
sliding = { velocity = [1.0, 0.2, 0.0] }
[bodies.block]
type = "solid"
model = "3d"
material = "pad"
damping = { mass = 20.0, stiffness = 1e-8 }
mesh = { shape = "block", corner = [-0.011, -0.011, 0.0], size = [0.022, 0.022, 0.01], divisions = [2, 2, 1], cells = "hexahedron" }
[bodies.plate]
type = "solid"
model = "3d"
material = "steel"
mesh = { shape = "block", corner = [-0.011, -0.011, 0.01], size = [0.022, 0.022, 0.005], divisions = [2, 2, 1], cells = "hexahedron" }
[ties.glue]
slave = "block.top"
master = "plate.bottom"
[supports.ground]
at = "slider.bottom"
fixed = ["x", "y", "z"]
[supports.holder]
at = "plate.top"
fixed = ["x", "y"]
[loads.press]
at = "plate.top"
pressure = 1e5
[contacts.face]
slave = "block.bottom"
master = "slider.top"
stiffness = 1e13
friction = { law = "coulomb", coefficient = 0.5 }
[modal]
modes = 8
max_frequency_hz = 60e3
"""  # fmt: skip


def export_in_space(folder: Path, name: str, body: BuiltBody) -> dict[str, object]:
    """A body of SPACE as matrices whose files name the freedoms by labels; the new table."""
    rng = np.random.default_rng(len(name))
    assert body.mesh is not None
    numbers = rng.permutation(np.arange(1, len(body.points) + 1))
    freedoms = rng.permutation(body.size)
    for role in ("mass", "damping", "stiffness"):
        matrix = getattr(body, role)[freedoms][:, freedoms]
        sio.mmwrite(folder / f"{name}-{role}.mtx", sp.coo_array(matrix), precision=17)
    labels = "\n".join(f"{numbers[f // 3]}, {'xyz'[f % 3]}" for f in freedoms)
    (folder / f"{name}.txt").write_text(labels, encoding="utf-8")
    rows = ["*NODE"] + [f"{numbers[k]}, " + ", ".join(repr(float(x)) for x in p) for k, p in enumerate(body.points)]
    rows.append("*ELEMENT, TYPE=C3D8, ELSET=all")
    cells = body.mesh.cells["hexahedron"]
    rows += [f"{k + 1}, " + ", ".join(str(numbers[n]) for n in cell) for k, cell in enumerate(cells)]
    faces = ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
    for side in body.mesh.boundaries:
        inside = set(body.mesh.boundary_nodes(side).tolist())
        rows.append(f"*SURFACE, NAME={side}")
        for k, cell in enumerate(cells):
            rows += [f"{k + 1}, S{f + 1}" for f, face in enumerate(faces) if {cell[n] for n in face} <= inside]
    (folder / f"{name}.inp").write_text("\n".join(rows) + "\n", encoding="utf-8")
    files = [{"file": str(folder / f"{name}-{role}.mtx"), "role": role} for role in ("mass", "damping", "stiffness")]
    return {
        "type": "matrices",
        "terms": files,
        "labels": str(folder / f"{name}.txt"),
        "mesh": str(folder / f"{name}.inp"),
    }


@pytest.mark.parametrize(
    "names",
    [
        *(pytest.param(n, marks=pytest.mark.slow) for n in (("slider",), ("plate",), ("slider", "block"))),
        ("slider", "block", "plate"),
    ],
)
def test_masters_slaves_and_bonded_bodies_in_space(tmp_path: Path, names: tuple[str, ...]):
    meshed = st.loads(SPACE)
    bodies = build_bodies(meshed)
    changes: dict[str, object] = {}
    for name in names:
        table = export_in_space(tmp_path, name, bodies[name])
        changes[f"bodies.{name}"] = table | ({"sliding": {"velocity": [1.0, 0.2, 0.0]}} if name == "slider" else {})
    imported = meshed.with_(changes)
    assert st.build_system(imported).symmetric_definite
    assert_same_modes(meshed, imported, rel=1e-9)
    assert st.steady_sliding(imported).normal_force.sum() == pytest.approx(48.4, rel=1e-9)


def one_freedom(folder: Path, terms: str) -> st.Case:
    """M = 1, K = 1e6 and a structural damping of a tenth of it, of Nastran."""
    values = {"MAAX": 1.0, "KAAX": 1e6, "K4AAX": 1e5, "KDGG": -1e4, "KX": 1e6}
    cards = "".join(f"DMIG,{n},0,6,2,0\nDMIG,{n},1,1,,1,1,{v:E}\n" for n, v in values.items())
    (folder / "a.pch").write_text(cards, encoding="utf-8")
    return st.loads(f"[matrices]\nterms = [{terms}]\n[modal]\nmax_frequency_hz = 1e3", folder=folder)


def term(name: str, more: str = "") -> str:
    return f'{{ file = "a.pch", name = "{name}"{more} }}, '


def test_structural_damping_of_nastran_is_no_stiffness(tmp_path: Path):
    """K4 = Σ GE·K: taken as stiffness the frequency is 166.92 Hz, and 159.15 Hz is right."""
    usual = term("MAAX") + term("KAAX")
    both = one_freedom(tmp_path, usual + term("K4AAX"))
    with pytest.raises(st.CaseError, match=r"terms.2.role: missing – a.pch, K4AAX: by its name .* structural damping"):
        st.build_system(both)
    with pytest.raises(st.CaseError, match=r"terms.2.role: missing – a.pch, KDGG: by its name .* differential stiffness"):
        st.build_system(one_freedom(tmp_path, usual + term("KDGG")))
    viscous = one_freedom(tmp_path, usual + term("K4AAX", ', role = "damping", factor = "1/1e3"'))
    root = st.modes(viscous).eigenvalues[0][0]
    assert root == pytest.approx(-50.0 + 1j * np.sqrt(1e6 - 50.0**2), rel=1e-9)
    assert st.describe(viscous).warnings == st.describe(one_freedom(tmp_path, usual)).warnings


def test_roles_that_contradict_the_names_are_warned_of(tmp_path: Path):
    def said(terms: str) -> list[str]:
        warnings = st.describe(one_freedom(tmp_path, terms)).warnings
        return [w for w in warnings if "roles exchanged" in w]

    stiff, mass = ', role = "stiffness"', ', role = "mass"'
    assert said(term("MAAX", stiff) + term("KAAX", mass)) == [
        "bodies.matrices: a.pch: The role given is stiffness, but by its name it is a mass; are roles exchanged?",
        "bodies.matrices: a.pch: The role given is mass, but by its name it is a stiffness; are roles exchanged?",
    ]
    usual = term("MAAX", mass) + term("KAAX", stiff)
    assert said(usual) == []
    # Softening by rotation, damping in proportion, and a first letter that need not mean anything.
    assert said(usual + term("MAAX", stiff + ", factor = -4.0") + term("KAAX", ', role = "damping"')) == []
    assert said(term("KX", mass) + term("KAAX")) == []


@pytest.mark.parametrize(
    ("master", "side"),
    [
        ('type = "obstacle"\nshape = "flat"\npoint = [0.0, -1.0]\nnormal = [0.0, 1.0]', ""),
        (
            'type = "beam"\nmaterial = "steel"\nstart = [-1.0, 0.02]\nend = [1.0, 0.02]\nwidth = 0.1\nthickness = 0.1\n'
            "elements = 4",
            'side = "right"\n',
        ),
    ],
)
def test_matrices_are_reported_beside_a_master_as_a_whole(export: Export, master: str, side: str):
    """An obstacle and a beam have no points by which a contact would name them."""
    text = f"""
    [bodies.under]
    {master}
    [contacts.more]
    slave = "block.crown"
    master = "under"
    {side}stiffness = 1e9
    friction = {{ law = "coulomb", coefficient = 0.2 }}
    """
    case = st.loads(export.text.replace("MORE", "") + text, folder=export.folder)
    (found,) = matrix_reports(case).values()
    assert found.contacts == ("face", "more")
    assert "K is symmetric: friction is that of contacts.face, contacts.more, which the case makes" in found.lines()


def test_supports_hold_rotations_of_nodes(tmp_path: Path):
    """A cantilever of one element, K = EI/l³ [12 −6l; −6l 4l²] with E I = l = 1: with its end held against rotation
    12 N/m, free 3 N/m by condensation."""
    sio.mmwrite(tmp_path / "K.mtx", sp.coo_array(np.array([[12.0, -6.0], [-6.0, 4.0]])))
    sio.mmwrite(tmp_path / "M.mtx", sp.coo_array(np.diag([1.0, 1e-9])))
    (tmp_path / "dof.txt").write_text("7 y\n7 rotz\n", encoding="utf-8")
    text = """
    [matrices]
    dimension = 2
    labels = "dof.txt"
    terms = [{ file = "M.mtx", role = "mass" }, { file = "K.mtx", role = "stiffness" }]
    points = { tip = 7 }
    [modal]
    max_frequency_hz = 10.0
    """
    held = '[supports.s]\nat = "matrices.tip"\nfixed = ["rotation"]\n'
    free, guided = (st.loads(text + more, folder=tmp_path) for more in ("", held))
    assert st.build_system(guided).dof_names == ("matrices node 7 y",)
    assert st.modes(free).frequency_hz[0, 0] == pytest.approx(np.sqrt(3.0) / (2 * np.pi), rel=1e-8)
    assert st.modes(guided).frequency_hz[0, 0] == pytest.approx(np.sqrt(12.0) / (2 * np.pi), rel=1e-12)
    with pytest.raises(st.CaseError, match=r"supports.s.velocity.rotation: 1.0 – rotations of imported matrices can be held"):
        st.loads(text + held + "velocity = { rotation = 1.0 }\n", folder=tmp_path)
    (tmp_path / "dof.txt").write_text("7 y\n-1 0\n", encoding="utf-8")
    with pytest.raises(st.CaseError, match=r"supports.s.fixed: 'rotation' – the matrices of matrices name no rotation there"):
        st.build_system(st.loads(text + held, folder=tmp_path))


def test_supports_hold_rotations_of_a_boundary(export: Export):
    """Of nodes of a boundary only those that have rotations are held against them."""
    top = export.body.mesh.boundary_nodes("top")
    for letter in ("M", "C", "K"):
        old = sp.coo_array(sio.mmread(export.folder / f"{letter}.mtx"))
        extra = {"M": [0.01, 0.02, 0.03], "C": [0.0] * 3, "K": [1e4, 2e4, 3e4]}[letter]
        sio.mmwrite(export.folder / f"{letter}.mtx", sp.coo_array(sp.block_diag([old, sp.diags_array(extra)])), precision=17)
    other = np.setdiff1d(np.arange(len(export.numbers)), top)[0]
    with (export.folder / "dof.txt").open("a", encoding="utf-8") as labels:
        labels.write("".join(f"\n{export.numbers[node]} 6" for node in (top[1], other, top[0])))
    held = export.case().with_({"supports.turn": {"at": "block.top", "fixed": ["rotation"]}})
    names = [name for name in st.build_system(held).dof_names if "rotation" in name]
    assert names == [f"block node {export.numbers[other]} rotation z"]
