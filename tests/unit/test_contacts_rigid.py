"""Motions that rigid contact allows and tests that its forces do no work on, for rows of every kind."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from stridor.errors import AnalysisError
from stridor.modal.parametric import Parameter, Term
from stridor.modal.parametric.contacts_rigid import eliminate
from stridor.modal.parametric.factors import CONSTANT, Product

MU = Parameter("mu", 0.0, 0.6, 0.3)
Rows = tuple[np.ndarray, np.ndarray]


def frames(rng: np.random.Generator, count: int, d: int) -> Rows:
    """Normals and directions of slip (count, d), at right angles."""
    normal = rng.standard_normal((count, d))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    slip = rng.standard_normal((count, d))
    slip -= np.sum(slip * normal, axis=1)[:, None] * normal
    return normal, slip / np.linalg.norm(slip, axis=1)[:, None]


def rows_of(normal: np.ndarray, slave: np.ndarray, master: np.ndarray, weights: np.ndarray, nodes: int) -> np.ndarray:
    """Rows (m, d · nodes) of slave − Σ w master along directions (m, d)."""
    m, d = normal.shape
    found = np.zeros((m, nodes, d))
    for k in range(m):
        found[k, slave[k]] += normal[k]
        for node, w in zip(master[k], weights[k], strict=True):
            found[k, node] -= w * normal[k]
    return found.reshape(m, -1)


def surface(d: int, *, flat: bool) -> Rows:
    """Seven slave nodes on a surface of six, each over d of them."""
    rng = np.random.default_rng(d)
    normal, slip = frames(rng, 7, d)
    if flat:
        normal, slip = np.tile(np.eye(d)[-1], (7, 1)), np.tile(np.eye(d)[0], (7, 1))
    master = np.array([rng.choice(np.arange(7, 13), d, replace=False) for _ in range(7)])
    weights = rng.random((7, d))
    weights /= weights.sum(axis=1)[:, None]
    slave = np.arange(7)
    return tuple(rows_of(a, slave, master, weights, 13) for a in (normal, slip))


def in_series() -> Rows:
    """A chain of nodes, each the slave of the one before and the master of the one behind it."""
    normal, slip = frames(np.random.default_rng(3), 5, 2)
    master, weights = np.arange(1, 6)[:, None], np.ones((5, 1))
    return tuple(rows_of(a, np.arange(5), master, weights, 7) for a in (normal, slip))


def held() -> Rows:
    """A slanted surface whose slave nodes cannot move along x."""
    normal, slip = surface(2, flat=False)
    keep = np.setdiff1d(np.arange(26), 2 * np.arange(7))
    return normal[:, keep], slip[:, keep]


def in_a_groove() -> Rows:
    """A node between two planes that move along each other's normals a little."""
    normal = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0]])
    return normal, np.array([[0.0, 0.2, 0.9, 0], [0.3, 0, 0.9, 0]])


def alike() -> Rows:
    """Rows whose largest entries are in the same proportion."""
    normal = np.array([[1.0, 1.0, 0.0, 0.3, 0], [1.0, 1.0, 0.2, 0.0, 0], [0, 0, 0, 0.1, 1.0]])
    return normal, np.array([[0.5, -0.5, 0, 0.1, 0], [0.5, -0.5, 0, 0.1, 0.4], [0, 0, 1.0, 0, 0]])


def widest_angle(one: np.ndarray, other: np.ndarray) -> float:
    """Sine of the largest angle between two spaces."""
    q, r = np.linalg.qr(one)[0], np.linalg.qr(other)[0]
    return float(np.linalg.norm(q - r @ (r.T @ q), 2))


@pytest.mark.parametrize(
    ("rows", "affine"),
    [
        (surface(2, flat=True), True),
        (surface(2, flat=False), True),
        (surface(3, flat=True), True),
        (surface(3, flat=False), True),
        (in_series(), True),
        (held(), False),
        (alike(), False),
        (in_a_groove(), False),
    ],
    ids=["2d flat", "2d", "3d flat", "3d", "in series", "held", "alike", "groove"],
)
@pytest.mark.parametrize("friction", [MU, 0.45])
def test_forces_work_on_no_test_vector_at_any_friction(rows: Rows, affine: bool, friction: Parameter | float) -> None:
    normal, slide = rows
    m, n = normal.shape
    found = eliminate(sp.csr_array(normal), sp.csr_array(slide), friction)
    motion = found.motion.toarray()
    assert motion.shape == (n, n - m)
    assert np.abs(normal @ motion).max() < 1e-13 * np.abs(motion).max()
    assert np.linalg.cond(motion) < 1e3
    for mu in (0.0, 0.17, 0.6) if isinstance(friction, Parameter) else (0.45,):
        tests = found.tests({"mu": mu}).toarray()
        assert np.abs((normal + mu * slide) @ tests).max() < 1e-11 * np.abs(tests).max()
        assert np.linalg.cond(tests) < 1e3
        null = np.linalg.svd(normal + mu * slide)[2][m:].T
        assert widest_angle(tests, null) < 1e-10
    if isinstance(friction, Parameter):
        assert (len(found.changes) == 1 and isinstance(found.changes[0][0], Product)) == affine


def test_terms_are_multiplied_from_both_sides() -> None:
    normal, slide = in_series()
    rng = np.random.default_rng(5)
    full = rng.standard_normal((3, 14, 14))
    full[0] += full[0].T
    found = eliminate(sp.csr_array(normal), sp.csr_array(slide), MU)
    factor = Product((("mu", 1.0),))
    terms = (
        Term(sp.csr_array(full[0]), "mass", CONSTANT, symmetric=True),
        Term(sp.csr_array(full[1]), "mass", factor),
        Term(sp.csr_array(full[2]), "stiffness", CONSTANT),
    )
    applied = found.applied(terms)
    assert [t.symmetric for t in applied if t.role == "mass" and t.factor == CONSTANT] == [True]
    assert len(applied) == 5  # μ of the first and of the second are one
    for mu in (0.0, 0.31):
        left = found.tests({"mu": mu}).toarray()
        for role, whole in (("mass", full[0] + mu * full[1]), ("stiffness", full[2])):
            total = sum(t.factor({"mu": mu}) * t.matrix.toarray() for t in applied if t.role == role)
            np.testing.assert_allclose(total, left.T @ whole @ found.motion.toarray(), atol=1e-12)


def test_a_surface_stays_sparse() -> None:
    """Each slave's normal is expressed by its own masters and friction's change is as local."""
    normal, slide = surface(3, flat=False)
    found = eliminate(sp.csr_array(normal), sp.csr_array(slide), MU)
    assert np.diff(found.motion.indptr).max() <= 2 + 3 * 3
    assert np.diff(sp.csr_array(found.changes[0][1]).indptr).max() <= 2 + 3 * 3


def test_contact_given_twice_is_refused() -> None:
    normal, slide = surface(2, flat=False)
    twice = sp.csr_array(np.vstack([normal, normal[:1]])), sp.csr_array(np.vstack([slide, slide[:1]]))
    with pytest.raises(AnalysisError, match="presses on the same freedoms twice"):
        eliminate(*twice, MU)
    with pytest.raises(AnalysisError, match="presses on the same freedoms twice"):
        eliminate(sp.csr_array(np.ones((2, 1))), sp.csr_array(np.zeros((2, 1))), MU)


def test_friction_that_jams_is_refused() -> None:
    """A node on a slope of 3:4 that only moves upwards wedges at μ = 4/3."""
    normal, slide = sp.csr_array(np.array([[0.8, 0.0]])), sp.csr_array(np.array([[-0.6, 0.0]]))
    assert eliminate(normal, slide, MU).motion.toarray().tolist() == [[0.0], [1.0]]
    with pytest.raises(AnalysisError, match=r"friction jams at μ = 1\.33333"):
        eliminate(normal, slide, Parameter("mu", 0.0, 2.0, 1.0))
    with pytest.raises(AnalysisError, match=r"friction jams at μ = 1\.33333"):
        eliminate(normal, slide, 4 / 3)


def test_a_node_that_nothing_moves_is_none() -> None:
    normal, slide = surface(2, flat=False)
    more = sp.csr_array(np.vstack([normal, 0 * normal[:1]])), sp.csr_array(np.vstack([slide, slide[:1]]))
    assert eliminate(*more, MU).motion.shape == (26, 19)
    nothing = eliminate(0 * more[0][:2], more[1][:2], MU)
    assert nothing.motion.shape == (26, 26)
    assert not nothing.changes
