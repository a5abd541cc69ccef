"""Files that hold one triangle of a matrix without saying so: read as it stands, a triangle has the eigenvalues of its
diagonal, and nothing in an analysis could tell."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io as sio
import scipy.sparse as sp

import stridor as st
from matrix_cases import matrix_case
from stridor.errors import CaseError
from stridor.matrices.entries import lone
from stridor.matrices.read import read_matrix
from stridor.study.matrix_reports import matrix_reports
from stridor.study.unit_warnings import matrix_warnings
from stridor.system.imported import load_terms

N = 6
CHAIN = np.diag(2.2 + 0.3 * np.arange(N)) - np.eye(N, k=1) - np.eye(N, k=-1)
GYROSCOPIC = np.kron(np.eye(3), [[0.0, 1.0], [-1.0, 0.0]])
# Friction takes the forces of tangential freedoms from those of normal ones.
FRICTION = np.kron(np.diag([1.0, 0.5, 0.0]), [[0.0, 1.0], [0.0, 0.0]])
MEANT = "say one_sided = true in its term"


def doubts(case: st.Case) -> list[str]:
    """What is doubtful about the only body, which every verb warns of, and the report on the matrices as well."""
    (body,) = case.imported
    found = list(load_terms(case, body, case.imported[body], 0.0).doubts)
    warned = [w for w in matrix_warnings(case) if MEANT in w]
    assert warned == [f"bodies.matrices: {doubt}" for doubt in found]
    assert [w for w in matrix_reports(case)[body].matrices.warnings if MEANT in w] == found
    return found


def terms(**own: np.ndarray) -> list[tuple[object, str, str]]:
    return [(own.get("mass", np.eye(N)), "mass", ""), (own.get("stiffness", CHAIN), "stiffness", "")]


def test_how_many_entries_have_no_counterpart():
    rng = np.random.default_rng(1)
    for _ in range(60):
        n = int(rng.integers(1, 9))
        matrix = sp.csr_array(rng.normal(size=(n, n)) * (rng.random((n, n)) < rng.choice([0.1, 0.3, 0.8])))
        if rng.random() < 0.5:
            matrix = sp.csr_array(sp.tril(matrix) if rng.random() < 0.5 else sp.triu(matrix))
        matrix.eliminate_zeros()
        dense = matrix.toarray() != 0
        off = dense & ~np.eye(n, dtype=bool)
        alone = (int(np.tril(off).sum()), int(np.triu(off).sum())) if off.any() and not (off & off.T).any() else None
        assert lone(matrix) == alone
    # Beyond those that are looked at first: one pair among entries that have none.
    many = sp.lil_array(np.triu(np.ones((30, 30))))
    many[29, 28] = 1.0
    assert lone(sp.csr_array(many)) is None


@pytest.mark.parametrize("half", [np.tril, np.triu])
@pytest.mark.parametrize("suffix", ["mtx", "npy", "npz", "mat"])
def test_half_a_stiffness_is_refused_in_every_format(tmp_path: Path, suffix: str, half):
    path = tmp_path / f"K.{suffix}"
    stiffness = half(CHAIN)
    if suffix == "mtx":
        sio.mmwrite(path, sp.coo_array(stiffness), symmetry="general")
    elif suffix == "npy":
        np.save(path, stiffness)
    elif suffix == "npz":
        sp.save_npz(path, sp.csr_array(stiffness))
    else:
        sio.savemat(path, {"K": stiffness})
    np.save(tmp_path / "M.npy", np.eye(N))
    text = '[[matrices]]\nfile = "M.npy"\nrole = "mass"\n[[matrices]]\nfile = "K.SUFFIX"\nrole = "stiffness"\n'
    (tmp_path / "a.toml").write_text(text.replace("SUFFIX", suffix))
    where = "below the diagonal and none above" if half is np.tril else "above the diagonal and none below"
    mend = ', or, if it is symmetric, say "symmetric" in place of "general" in its first line' if suffix == "mtx" else ""
    with pytest.raises(CaseError) as refused:
        st.modes(st.load(tmp_path / "a.toml"), 0.0)
    assert str(refused.value) == (
        f"bodies.matrices.terms.1.file: 'K.{suffix}' – is the stiffness, and it holds 5 entries {where}: as it stands "
        f"nothing would be coupled; give the whole matrix{mend}. If it is meant so, {MEANT}"
    )
    # Who means it says so, and the eigenvalues are those of the diagonal.
    with (tmp_path / "a.toml").open("a") as file:
        file.write("one_sided = true\n")
    case = st.load(tmp_path / "a.toml")
    assert doubts(case) == []
    assert st.modes(case, 0.0).frequency_hz[0] == pytest.approx(np.sqrt(np.diag(CHAIN)) / (2 * np.pi), rel=1e-6)


def test_a_half_in_another_order_of_the_freedoms_is_one_too(tmp_path: Path):
    order = np.array([3, 0, 5, 1, 4, 2])
    half = np.tril(CHAIN)[np.ix_(order, order)]
    with pytest.raises(CaseError, match="none of its 5 entries off the diagonal has a counterpart across it"):
        doubts(matrix_case(tmp_path, terms(stiffness=half), 1.0))


def test_half_a_mass_is_refused(tmp_path: Path):
    for size in (2, N):  # a mass is symmetric, however small
        mass = np.eye(size) + 0.1 * np.eye(size, k=1)
        with pytest.raises(CaseError, match=r"is a mass, and it holds . entr.* above the diagonal and none below; a mass"):
            doubts(matrix_case(tmp_path, [(mass, "mass", ""), (np.eye(size), "stiffness", "")], 1.0))
    # Two halves are a whole.
    both = [(np.tril(CHAIN), "mass", ""), (np.triu(CHAIN, 1), "mass", ""), (CHAIN, "stiffness", "")]
    assert doubts(matrix_case(tmp_path, both, 1.0)) == []


def test_half_of_each_of_two_stiffnesses_over_friction_is_refused(tmp_path: Path):
    at = [(np.tril(CHAIN), "stiffness", "1 - mu"), (np.tril(CHAIN + FRICTION.T), "stiffness", "mu")]
    with pytest.raises(CaseError, match=r"terms\.1\.file"):
        doubts(matrix_case(tmp_path, [(np.eye(N), "mass", ""), *at], 1.0))


def test_a_half_beside_a_stiffness_with_friction_terms_is_refused(tmp_path: Path):
    halves = [*terms(stiffness=np.tril(CHAIN)), (FRICTION, "stiffness", "mu")]
    with pytest.raises(CaseError, match=r"terms\.1\.file.*5 entries below the diagonal and none above"):
        doubts(matrix_case(tmp_path, halves, 1.0))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ((np.triu(GYROSCOPIC), "damping", ""), "it holds 3 entries above the diagonal and none below"),
        ((np.tril(CHAIN), "stiffness", "mu"), "it holds 5 entries below the diagonal and none above"),
        ((FRICTION, "stiffness", "0.3"), "it holds 2 entries above the diagonal and none below"),
    ],
)
def test_halves_of_terms_are_doubtful(tmp_path: Path, more: tuple[object, str, str], words: str):
    (said,) = doubts(matrix_case(tmp_path, [*terms(), more], 1.0))
    assert said.startswith(f"A2.npz: {words}; if that is one half of a matrix, give the whole matrix; if it is meant")


def test_what_is_one_sided_by_nature_is_left_alone(tmp_path: Path):
    """Friction as a term of its own, whole matrices of any kind, and pairs of freedoms."""
    whole = [*terms(), (GYROSCOPIC, "damping", ""), (FRICTION, "stiffness", "mu")]
    assert doubts(matrix_case(tmp_path, whole, 1.0)) == []
    diagonal = [*terms(stiffness=np.eye(N)), (FRICTION, "stiffness", "mu")]
    assert doubts(matrix_case(tmp_path, diagonal, 1.0)) == []
    pair = [(np.eye(2), "mass", ""), (np.array([[1.0, 0.4], [0.0, 1.0]]), "stiffness", "")]
    assert len(doubts(matrix_case(tmp_path, pair, 1.0))) == 1


def test_what_the_header_of_abaqus_says_is_believed(tmp_path: Path):
    lines = "".join(f"{i + 1},1,{j + 1},1,{CHAIN[i, j]}\n" for i in range(N) for j in range(i + 1) if CHAIN[i, j])
    (tmp_path / "a_STIF1.mtx").write_text(f"*MATRIX INPUT, TYPE=UNSYMMETRIC\n{lines}")
    (tmp_path / "a_MASS1.mtx").write_text("".join(f"{i + 1},1,{i + 1},1,1.0\n" for i in range(N)))
    text = '[matrices]\nterms = [{ file = "a_MASS1.mtx" }, { file = "a_STIF1.mtx" }]\n'
    (tmp_path / "a.toml").write_text(text)
    assert read_matrix(tmp_path / "a_STIF1.mtx").lone == (5, 0)
    assert doubts(st.load(tmp_path / "a.toml")) == []
    # Without it the file is one half of a symmetric matrix.
    (tmp_path / "a_STIF1.mtx").write_text(lines)
    assert read_matrix(tmp_path / "a_STIF1.mtx").lone is None
    assert abs(read_matrix(tmp_path / "a_STIF1.mtx").matrix - CHAIN).max() == 0.0


def test_what_is_exported_is_read_again_where_it_is_one_sided(tmp_path: Path):
    bodies = "".join(
        f'[bodies.m{k}]\ntype = "mass"\nmass = 1.0\nposition = [{float(k)}, 0.0]\n'
        f'[springs.s{k}]\nbetween = ["m{k}", "ground"]\nstiffness = 50.0\ndirection = [1.0, 0.0]\n'
        f'[contacts.c{k}]\nslave = "m{k}"\nmaster = "belt"\nstiffness = {30.0 + k}\n'
        f'[contacts.c{k}.friction]\nlaw = "coulomb"\ncoefficient = 0.3\n'
        f'[loads.p{k}]\nat = "m{k}"\nforce = [0.0, -1.0]\n'
        for k in range(2)
    )
    belt = '[bodies.belt]\ntype = "obstacle"\nshape = "flat"\npoint = [0.0, 0.0]\nnormal = [0.0, 1.0]\n'
    case = st.loads(
        f'units = "nondimensional"\n{bodies}{belt}[bodies.belt.sliding]\nvelocity = [1.0, 0.0]\n'
        "[modal]\nmax_frequency_hz = 5.0\n"
    )
    written = st.export(case, tmp_path, mu=0.3).case
    assert written is not None
    stiffness = read_matrix(tmp_path / "K.mtx")
    assert sorted(stiffness.lone or ()) == [0, 2]
    again = st.load(written)
    assert doubts(again) == []
    assert st.modes(again, 0.3).frequency_hz == pytest.approx(st.modes(case, 0.3).frequency_hz, rel=1e-9)


def test_a_file_by_itself_is_asked_about(tmp_path: Path):
    from stridor.matrices.report import single_lines

    np.save(tmp_path / "K.npy", np.tril(CHAIN))
    words = "5 entries below the diagonal, 0 above, and none has a counterpart across it: is it one half of a matrix?"
    assert words in single_lines(read_matrix(tmp_path / "K.npy"))
    np.save(tmp_path / "K.npy", CHAIN)
    assert not any("half" in line for line in single_lines(read_matrix(tmp_path / "K.npy")))


def test_entries_that_were_added_up_are_warned_of(tmp_path: Path):
    head = "%%MatrixMarket matrix coordinate real general\n"
    (tmp_path / "M.mtx").write_text(f"{head}1 1 1\n1 1 1.0\n")
    (tmp_path / "K.mtx").write_text(f"{head}1 1 2\n1 1 2.0\n1 1 2.0\n")
    terms = '[{ file = "M.mtx", role = "mass" }, { file = "K.mtx", role = "stiffness" }]'
    (tmp_path / "a.toml").write_text(f"[matrices]\nterms = {terms}\n")
    assert matrix_warnings(st.load(tmp_path / "a.toml")) == [
        "bodies.matrices: K.mtx: Added up: 1 of 2 entries stand at a place that an earlier one has taken."
    ]
