"""Damping that is a sum of mass and stiffness is found, and multiplied as such."""

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose

from stridor.modal.parametric.basis import ReducedBasis
from stridor.modal.parametric.offline import embedding_of
from stridor.modal.parametric.problem import Parameter, ParametricProblem, Term
from stridor.modal.parametric.proportional import proportional

N = 300


def chain(seed):
    rng = np.random.default_rng(seed)
    off = -rng.uniform(1e6, 2e6, N - 1)
    return sp.csr_array(sp.diags_array([off, np.full(N, 5e6), off], offsets=[-1, 0, 1]))


def few(rows, seed, symmetric):
    dense = np.random.default_rng(seed).standard_normal((len(rows), len(rows)))
    dense = dense + dense.T if symmetric else dense
    place = sp.csr_array((np.ones(len(rows)), (rows, np.arange(len(rows)))), shape=(N, len(rows)))
    return sp.csr_array(place @ dense @ place.T)


@pytest.fixture
def mass():
    """Consistent: where stiffness has entries, it has some."""
    return sp.csr_array(abs(chain(3)) * 1e-6)


def terms_of(mass, stiffness, damping, *others):
    return (
        Term(mass, "mass", lambda _: 1.0, symmetric=True),
        Term(damping, "damping", lambda p: p["c"], symmetric=True),
        Term(stiffness, "stiffness", lambda _: 1.0, symmetric=True),
        *others,
    )


def test_rayleigh_damping_is_mass_and_stiffness(mass):
    ((place, (shares, rest)),) = proportional(terms_of(mass, chain(1), 5.0 * mass + 4e-8 * chain(1))).items()
    assert place == 1
    assert shares == {0: pytest.approx(5.0, rel=1e-9), 2: pytest.approx(4e-8, rel=1e-9)}
    assert rest.nnz == 0


def test_what_is_not_proportional_is_kept_entry_by_entry(mass):
    dashpots = few([10, 11, 200], 0, symmetric=True)
    damping = sp.csr_array(5.0 * mass + 4e-8 * chain(1) + dashpots)
    ((_, (shares, rest)),) = proportional(terms_of(mass, chain(1), damping)).items()
    assert set(shares) == {0, 2}
    assert_allclose(rest.toarray(), dashpots.toarray(), atol=1e-12 * abs(damping).max())
    assert rest.nnz == 9


def test_the_share_of_most_rows_is_taken_where_bodies_differ(mass):
    body = sp.diags_array(np.where(np.arange(N) < 60, 3.0, 1.0))
    damping = sp.csr_array(body @ (2e-7 * chain(1)) @ body)
    ((_, (shares, rest)),) = proportional(terms_of(mass, chain(1), damping)).items()
    assert shares == {2: pytest.approx(2e-7, rel=1e-9)}
    assert np.unique(rest.nonzero()[0]).max() == 60


@pytest.mark.parametrize("damping", [chain(2), sp.csr_array((N, N)), few(list(range(0, N, 2)), 4, symmetric=True)])
def test_other_damping_stays_as_it_is(mass, damping):
    assert proportional(terms_of(mass, chain(1), damping)) == {}


def test_without_mass_or_stiffness_that_is_symmetric_nothing_is_found(mass):
    terms = Term(mass, "damping", lambda _: 1.0, symmetric=True), Term(chain(1), "stiffness", lambda _: 1.0)
    assert proportional(terms) == {}


def test_products_are_those_of_the_terms_themselves(mass):
    """Projections, sketches and forces of a basis that grows, against every matrix by itself."""
    dashpots = few([10, 11, 200], 0, symmetric=True)
    terms = terms_of(
        mass, chain(1), sp.csr_array(5.0 * mass + 4e-8 * chain(1) + dashpots),
        Term(few([50, 51, 52, 120], 1, symmetric=False), "stiffness", lambda p: p["c"]),
        Term(sp.csr_array(sp.diags_array(np.linspace(1, 9, N - 1), offsets=1)), "stiffness", lambda _: 1.0),
    )  # fmt: skip
    problem = ParametricProblem(terms, (Parameter("c", 0.0, 1.0, 0.5),))
    metric = sp.csr_array(chain(1) + mass)
    embedding = embedding_of(N, 1.0 / np.sqrt(metric.diagonal()))
    basis = ReducedBasis(problem, metric, embedding)
    rng = np.random.default_rng(0)
    for count in (4, 3, 250):
        basis.add(rng.standard_normal((N, count)), 1e-8)
    v, r = basis.vectors, basis.count
    assert r == 257
    assert basis.shares
    assert_allclose(v.T @ (metric @ v), np.eye(r), atol=1e-9)
    right, left = ([rng.standard_normal((r, 5)) for _ in terms] for _ in range(2))
    expected = sum(t.matrix @ (v @ a) + t.matrix.T @ (v @ b) for t, a, b in zip(terms, right, left, strict=True))
    assert_allclose(basis.forces(right, left), expected, atol=1e-12 * abs(expected).max())
    for j, term in enumerate(terms):
        for found, whole in (
            (basis.projected[j], v.T @ (term.matrix @ v)),
            (basis.right_sketch[j], embedding @ (term.matrix @ v)),
            (basis.left_sketch[j], embedding @ (term.matrix.T @ v)),
        ):
            assert_allclose(found, whole, atol=1e-12 * abs(whole).max())
