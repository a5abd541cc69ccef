"""What the report says of matrices of which it is known: definiteness, couplings, units, and what looks wrong."""

from __future__ import annotations

import time

import numpy as np
import pytest
import scipy.sparse as sp

from stridor.errors import CaseError
from stridor.matrices import Labels, StoredMatrix, common_labels, held_freedoms, read_matrix, report
from stridor.matrices.report import definiteness, single_lines


def chain(n: int, value: float, ends: float = 1.0):
    """Springs or consistent masses in a row, fixed at both ends."""
    return sp.csr_array(value * sp.diags_array([-ends * np.ones(n - 1), 2.0 * np.ones(n), -ends * np.ones(n - 1)], offsets=[-1, 0, 1]))


def said(found) -> str:
    return "\n".join(found.lines())


def test_a_symmetric_pair():
    stiffness, mass = chain(5, 1e8), sp.csr_array(1e-3 * np.eye(5))
    found = report(mass, None, stiffness)
    assert (found.size, found.held, found.entries) == (5, 0, {"mass": 5, "damping": 0, "stiffness": 13})
    assert (found.mass, found.mass_negative, found.massless) == ("positive definite", 0, 0)
    assert (found.damping, found.coupling, found.coupling_exact) == ("zero", 0, True)
    assert found.frequencies == pytest.approx((np.sqrt(2e11) / (2 * np.pi),) * 2)
    assert "single freedoms, all others held, vibrate at 7.118e+04 to 7.118e+04 Hz" in said(found)
    exact = np.sqrt(np.linalg.eigvalsh(stiffness.toarray()) / 1e-3) / (2 * np.pi)
    assert exact[0] < found.frequencies[0]
    assert found.frequencies[1] < exact[-1]
    assert found.units is not None
    assert found.units.startswith("SI")
    assert found.warnings == ("K is symmetric: without friction terms in it, no modes can couple to flutter",)
    assert found.lines()[:3] == ["5 freedoms", "M (mass): 5 entries, symmetric", "C (damping): zero"]


def test_couplings_are_counted_and_rounding_is_not():
    stiffness = chain(400, 1e8).tolil()
    stiffness[3, 4] += 3.0  # rounding of a sum of larger terms would be below 1e-4
    stiffness[100, 7] = 5e6
    stiffness[200, 7] = 5e6
    stiffness[300, 301] *= 1 + 1e-15
    found = report(chain(400, 1e-3, ends=-0.5), None, sp.csr_array(stiffness))
    # (100, 7) and (200, 7) share a column: the antisymmetric part of the two has rank 2.
    assert (found.coupling, found.coupling_exact, found.coupled) == (4, True, 5)
    assert 0 < found.defect["stiffness"] < 1e-2
    assert "K − Kᵀ has rank 4, in 5 rows" in said(found)
    assert found.warnings == ()


@pytest.mark.parametrize(
    ("matrix", "answer"),
    [
        ([[2, -1], [-1, 2]], ("positive definite", 0)),
        ([[1, -1], [-1, 1]], ("positive semidefinite", 0)),
        ([[1, 2], [2, 1]], ("indefinite", 1)),
        ([[0, 2], [2, 0]], ("indefinite", 1)),
        ([[0, 2], [-2, 0]], ("zero", 0)),
        ([[1, 0], [0, -1]], ("indefinite", 1)),
        ([[1, 0], [0, 0]], ("positive definite", 0)),
        ([[0, 0], [0, 0]], ("zero", 0)),
        ([[1e-8, -1e-14], [-1e-14, 1e-12]], ("positive definite", 0)),
        ([[-2, 1, 0], [1, -2, 0], [0, 0, 1]], ("indefinite", 2)),
    ],
)
def test_definiteness(matrix, answer):
    assert definiteness(sp.csr_array(np.array(matrix, dtype=float))) == answer


def test_definiteness_of_random_matrices_is_that_of_their_eigenvalues():
    random = np.random.default_rng(5)
    for _ in range(40):
        n = int(random.integers(2, 30))
        values = np.where(random.random((n, n)) < 0.3, random.standard_normal((n, n)), 0.0)
        matrix = values @ values.T if random.random() < 0.5 else values
        filled = np.flatnonzero((matrix != 0).any(axis=0) | (matrix != 0).any(axis=1))
        kind, negative = definiteness(sp.csr_array(matrix))
        if not len(filled):
            assert kind == "zero"
            continue
        part = 0.5 * (matrix + matrix.T)[np.ix_(filled, filled)]
        exact = np.linalg.eigvalsh(part)
        assert negative == int(np.sum(exact < -1e-9)), exact
        assert (kind == "indefinite") == (exact[0] < -1e-9)


def test_contact_multipliers_without_friction_are_noticed():
    stiffness = np.zeros((5, 5))
    stiffness[:4, :4] = chain(4, 2.0).toarray()
    stiffness[4, :2] = stiffness[:2, 4] = [1.0, -1.0]
    mass = np.diag([1.0, 1.0, 1.0, 1.0, 0.0])
    labels = Labels(np.array([1, 1, 2, 2, -3]), np.array([1, 2, 1, 2, 1]))
    found = report(sp.csr_array(mass), None, sp.csr_array(stiffness), labels=labels)
    assert (found.multipliers, found.massless, found.mass) == (1, 1, "positive semidefinite")
    assert found.warnings == (
        "friction terms seem lost: 1 freedom looks like multipliers of a contact, yet K is symmetric; in Abaqus, ask "
        "for *STEP, UNSYMM=YES and a sliding contact with friction before *MATRIX GENERATE",
    )
    stiffness[0, 4] += 0.4
    found = report(sp.csr_array(mass), None, sp.csr_array(stiffness), labels=labels)
    assert (found.coupling, found.warnings) == (2, ())


@pytest.mark.parametrize(("form", "words"), [("symmetric", "as one half of a symmetric"), ("general", "is stored as not symmetric")])
def test_what_the_file_says_of_itself(form, words):
    stiffness = chain(3, 1.0)
    stored = StoredMatrix(stiffness, "a.mtx", role="stiffness", form=form, program="Abaqus")
    found = report(sp.csr_array(np.eye(3)), None, stiffness, stored=[stored])
    assert words in found.warnings[0]
    assert "UNSYMM=YES" in found.warnings[0]
    half = StoredMatrix(stiffness, "a.sti", role="stiffness", form=form)
    assert "CalculiX stores one half only" in report(stiffness, None, stiffness, stored=[half]).warnings[0]
    internal = Labels(np.array([1, 2, -1]), np.array([1, 1, 1]))
    found = report(sp.csr_array(np.eye(3)), None, stiffness, labels=internal)
    assert found.warnings[0].startswith("friction terms seem lost: 1 freedom is internal, as contact makes them,")


@pytest.mark.parametrize(("form", "by"), [("symmetric", "its file says so"), ("general", "up to rounding")])
def test_abaqus_is_named_for_files_of_abaqus_only(form, by):
    stiffness = chain(3, 1.0)
    stored = StoredMatrix(stiffness, "a.mtx", role="stiffness", form=form)
    said = report(sp.csr_array(np.eye(3)), None, stiffness, stored=[stored]).warnings
    assert said == (
        f"no friction is in K: K is symmetric, {by}, and without friction terms no modes can couple to flutter",
    )
    # What looks like contacts of another program has lost something all the same.
    internal = Labels(np.array([1, 2, -1]), np.array([1, 1, 1]))
    (said,) = report(sp.csr_array(np.eye(3)), None, stiffness, labels=internal, stored=[stored]).warnings
    assert said.startswith("friction terms seem lost: ")
    assert "Abaqus" not in said


def test_negative_masses_are_counted():
    found = report(sp.csr_array(np.diag([1.0, -2.0, 0.0, -1e-9])), None, chain(4, 1.0))
    assert "2 freedoms have a negative mass; is the sign of every factor right?" in found.warnings
    assert not any("mass" in said for said in report(sp.csr_array(np.eye(4)), None, chain(4, 1.0)).warnings)


def test_damping_that_drives_and_turns():
    damping = np.diag([1.0, -2.0, 0.0, 3.0])
    damping[2, 3], damping[3, 2] = 5.0, -5.0
    found = report(sp.csr_array(np.eye(4)), sp.csr_array(damping), chain(4, 9.0))
    assert (found.damping, found.damping_negative) == ("indefinite", 1)
    assert found.warnings[1:] == (
        "the symmetric part of C is indefinite (1 negative eigenvalue): it drives some motions, as falling friction does",
        "C has a gyroscopic (antisymmetric) part, 88% of its norm; right for rotating bodies only",
    )


def test_supports_of_abaqus_are_left_out():
    stiffness = chain(6, 1e5).tolil()
    stiffness[0, 0] = 1e36
    stiffness = sp.csr_array(stiffness)
    assert held_freedoms(stiffness).tolist() == [0]
    found = report(sp.csr_array(1e-7 * np.eye(6)), None, stiffness)
    assert (found.size, found.held, found.entries["stiffness"]) == (6, 1, 13)
    assert found.frequencies is not None
    assert found.frequencies[1] < 1e6
    assert found.lines()[0].startswith("6 freedoms, 1 of them held (1e36")


def test_units_of_a_steel_bar_are_guessed():
    for scale, start in ((1.0, "SI"), (1000.0, "tonne")):
        # A bar of 10 mm, elements of 1 mm: stiffness EA/h, mass ρAh, in m and kg or in mm and t.
        young, density = 2.1e11 / (scale**2 if scale > 1 else 1), 7800.0 / (1e12 if scale > 1 else 1)
        area, h = 1e-6 * scale**2, 1e-3 * scale
        found = report(sp.csr_array(density * area * h * np.eye(9)), None, chain(9, young * area / h))
        assert found.units is not None
        assert found.units.startswith(start), found.units
    unclear = report(sp.csr_array(np.eye(3)), None, chain(3, 1.0))
    assert unclear.units is not None
    assert unclear.units.startswith("not clear")


def test_free_motion_and_loose_freedoms_are_told():
    free = np.zeros((5, 5))
    free[np.ix_([0, 2], [0, 2])] = [[1.0, -1.0], [-1.0, 1.0]]
    free[1, 1] = free[3, 3] = 1.0
    labels = Labels(np.array([1, 1, 2, 2, 3]), np.array([1, 2, 1, 2, 3]))
    found = report(sp.csr_array(np.diag([1.0, 1, 1, 1, 0])), None, sp.csr_array(free), labels=labels)
    assert (found.free, found.loose) == ((1,), 1)
    assert found.warnings[:2] == (
        "1 freedom has neither mass nor stiffness; K has no inverse",
        "nothing in K resists moving the whole model along x; are supports missing?",
    )
    held = report(
        sp.csr_array(np.diag([1.0, 1, 1, 1, 0])), None, sp.csr_array(free), labels=labels, supports=["supports.left"]
    )
    assert held.warnings == (found.warnings[0], *found.warnings[2:])


def test_what_cannot_be_looked_through():
    eye = sp.csr_array(np.eye(2))
    with pytest.raises(CaseError, match=r"^matrices.mass: has the shape \(2, 2\); K has \(3, 3\)$"):
        report(eye, None, chain(3, 1.0))
    with pytest.raises(CaseError, match=r"^matrices.stiffness: 1 entry is no finite number; all must be$"):
        report(eye, None, sp.csr_array(np.array([[1.0, np.nan], [0.0, 1.0]])))


def test_a_large_model_takes_seconds():
    side = 100
    one = chain(side, 1.0)
    eye = sp.eye_array(side)
    stiffness = sp.csr_array(1e8 * (sp.kron(one, eye) + sp.kron(eye, one))).tolil()
    at = np.arange(0, 4000, 3)
    for i in at:
        stiffness[i, i + 5000] = 1e6
    start = time.perf_counter()
    mass = sp.kron(chain(side, 1e-3, ends=-0.5), eye)
    found = report(sp.csr_array(mass), sp.csr_array(mass), sp.csr_array(stiffness))
    assert time.perf_counter() - start < 20.0
    assert (found.mass, found.coupling) == ("positive definite", 2 * len(at))


def test_a_large_damping_matrix_with_one_negative_motion():
    damping = chain(3000, 1.0, ends=-0.5).tolil()
    kind, negative = definiteness(sp.csr_array(damping))
    assert (kind, negative) == ("positive definite", 0)
    damping[1500, 1500] = -3.0
    kind, negative = definiteness(sp.csr_array(damping))
    assert kind == "indefinite"
    assert negative in (1, None)


def test_from_files_to_the_report(tmp_path):
    (tmp_path / "job_STIF1.mtx").write_text(
        "2,1, 2,1, 5.\n3,1, 2,1, -2.\n-7,1, 2,1, 0.\n2,1, 3,1, -2.\n3,1, 3,1, 4.\n-7,1, 3,1, 1.\n2,1, -7,1, 0.4\n3,1, -7,1, 1.\n"
        "9,1, 9,1, 1.e36\n2,1, 9,1, -1.\n9,1, 2,1, -1.\n"
    )
    (tmp_path / "job_MASS1.mtx").write_text("2,1, 2,1, 1.\n9,1, 9,1, 1.\n3,1, 3,1, 2.\n")
    stored = [read_matrix(tmp_path / f"job_{kind}1.mtx") for kind in ("MASS", "STIF")]
    (mass, stiffness), labels = common_labels(stored)
    found = report(mass, None, stiffness, labels=labels, stored=stored)
    assert (found.size, found.held, found.multipliers, found.coupling, found.massless) == (4, 1, 1, 2, 1)
    assert found.mass == "positive semidefinite"
    assert found.warnings == ()
    assert found.lines()[0] == "4 freedoms, 1 of them held (1e36 in K, Abaqus' supports)"
    assert labels is not None
    assert labels.node[held_freedoms(stiffness)].tolist() == [9]


def test_friction_counts_the_same_by_itself_and_beside_a_stiffness(tmp_path):
    """Entries of very different size make a coupling of rank 20: dropped one by one they would leave another rank."""
    rng = np.random.default_rng(8)
    n, pairs = 120, 10
    stiffness = 1e9 * sp.csr_array(sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n)))
    turn = np.zeros((n, n))
    for k in range(pairs):
        at = 10 * k + np.arange(8)
        u, v = np.zeros(n), np.zeros(n)
        u[at], v[at] = rng.standard_normal(8), rng.standard_normal(8) * 10.0 ** rng.uniform(-7, 0, 8)
        turn += np.outer(u, v)
    friction = sp.csr_array(turn)
    rounded = stiffness.copy()
    rounded.data *= 1 + 1e-15 * rng.standard_normal(len(rounded.data))
    alone = StoredMatrix(friction, "f")
    assert single_lines(alone)[3].endswith("rank 20, in 80 rows")
    for first in (stiffness, rounded):
        for factor in (1.0, 0.3, 1e-4):
            total = sp.csr_array(first + factor * friction)
            found = report(sp.eye_array(n), None, total, stiffness_terms=[first, sp.csr_array(factor * friction)])
            assert (found.coupling, found.coupling_exact, found.coupled) == (20, True, 80)
    # In one file the smallest are rounding, and the rest keeps the rank of what it is a part of.
    whole = report(sp.eye_array(n), None, sp.csr_array(stiffness + 1e3 * friction))
    assert whole.coupling == 20
    assert 60 <= whole.coupled <= 80
