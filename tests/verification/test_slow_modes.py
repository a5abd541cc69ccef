"""Modes that are slow beside the band, or beside the other modes, count; motions as a whole do not. The truth is each
block's own companion matrix, whose eigenvalues keep their digits whatever else there is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp

import stridor as st
from matrix_cases import matrix_case
from program import stridor
from stridor.modal.at_rest import more_slow, moving, rest_limit
from stridor.modal.full import onsets_along
from stridor.modal.quadratic import Quadratic
from stridor.typing import Array, ComplexArray

pytestmark = pytest.mark.verification

ONSET = 0.962265  # of the block below; nothing in it depends on the scale of its stiffnesses but its frequency
ENDS = 0.228627  # of spring b, in units of the scale, at μ = 1.1
BLOCK = """
units = "nondimensional"
[bodies.block]
type = "mass"
mass = 1.0
position = [0.0, 0.0]
[bodies.floor]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [0.0, 1.0]
sliding = {{ velocity = [0.5, 0.0] }}
[loads.press]
at = "block"
force = [0.0, -10.0]
[contacts.rub]
slave = "block"
master = "floor"
stiffness = {contact}
friction = {{ law = "coulomb", coefficient = {mu} }}
[springs.a]
between = ["block", "ground"]
stiffness = {a}
damping = {damping}
direction = [1.0, 0.0]
[springs.b]
between = ["block", "ground"]
stiffness = {b}
direction = [0.5, -0.866]
"""


def block(scale: float, mu: float = 0.3) -> st.Case:
    """A unit mass on a moving floor, its squares of frequencies of the order of ten scales, in a band up to 40 kHz."""
    values = {"contact": 9.0 * scale, "a": 11.0 * scale, "b": 20.0 * scale, "damping": 1e-3 * scale**0.5}
    return st.loads(BLOCK.format(mu=mu, **values))


SCALES = pytest.mark.parametrize("scale", [1.0, 1e-2, 1e-8])
FEW_SCALES = pytest.mark.parametrize("scale", [1e-8, *(pytest.param(s, marks=pytest.mark.slow) for s in (1.0, 1e-2))])


@SCALES
def test_a_reduced_model_sees_flutter_far_below_its_band(scale: float) -> None:
    model = st.reduced_model(block(scale), {"mu": (0.0, 2.0)})
    assert [int(model.modes({"mu": mu}).unstable.sum()) for mu in (0.5, 1.5)] == [0, 1]
    (onset,) = onsets_along(model, "mu")
    assert onset.value == pytest.approx(ONSET, abs=1e-6)


@SCALES
def test_onsets_along_a_spring_see_it_too(scale: float) -> None:
    found = st.onsets(block(scale, 1.1), (5.0 * scale, 40.0 * scale), along="springs.b.stiffness")
    (onset,) = found
    assert onset.stabilising
    assert onset.value / scale == pytest.approx(100 * ENDS, rel=1e-4)
    assert found.complete


@FEW_SCALES
def test_a_boundary_goes_from_edge_to_edge_however_slow_it_is(scale: float) -> None:
    between = 9.0 * scale, 13.0 * scale
    found = st.stability_boundary(
        block(scale), "mu", "springs.a.stiffness", x_range=(0.0, 2.0), y_range=between, lines=3
    )
    (curve,) = found.curves
    assert curve.ends == ("edge", "edge")
    assert curve.x.min() == pytest.approx(ONSET, abs=1e-6)
    assert found.agree


@dataclass(frozen=True)
class Apart:
    """A block of frequencies of order one, of which ``free`` motions have no stiffness, and a slow one beside it."""

    blocks: tuple[tuple[Array, Array, Array], ...]
    free: int
    slow: float
    top: float

    def growing(self, q: float) -> tuple[int, int] | None:
        """How many modes and roots grow at q; None where one is near the axis."""
        modes = roots = 0
        for (damping, stiffness, circulatory), size in zip(self.blocks, (1.0, self.slow), strict=True):
            n = len(damping)
            none, one = np.zeros((n, n)), np.eye(n)
            lam: ComplexArray = 0j + np.linalg.eigvals(np.block([[none, one], [-stiffness - q * circulatory, -damping]]))
            share = lam.real[np.abs(lam) > 1e-4 * size] / np.abs(lam[np.abs(lam) > 1e-4 * size])
            if np.any((share > 1e-9) & (share < 1e-5)):
                return None
            grows = lam[(np.abs(lam) > 1e-4 * size) & (lam.real > 1e-5 * np.abs(lam))]
            modes, roots = modes + int((grows.imag >= 0).sum()), roots + len(grows)
        return modes, roots

    def slow_grows(self, q: float) -> bool:
        """Whether the slow block grows at q, by much."""
        damping, stiffness, circulatory = self.blocks[1]
        none, one = np.zeros_like(damping), np.eye(len(damping))
        lam = np.linalg.eigvals(np.block([[none, one], [-stiffness - q * circulatory, -damping]]))
        return bool(np.any(lam.real > 0.05 * np.abs(lam)))

    def case(self, folder: Path) -> st.Case:
        """Its matrices in files, the circulatory part with a factor q."""
        damping, stiffness, circulatory = (sl.block_diag(*parts) for parts in zip(*self.blocks, strict=True))
        terms = [(np.eye(len(stiffness)), "mass", ""), (stiffness, "stiffness", ""), (circulatory, "stiffness", "q")]
        if damping.any():
            terms.append((damping, "damping", ""))
        more = "[parameters]\nq = { value = 0.5, range = [0.0, 1.5] }"
        return matrix_case(folder, terms, self.top / (2 * np.pi), more=more)


def apart(seed: int, slow: float, wide: float) -> Apart:
    rng = np.random.default_rng(seed)
    damped, free = float(rng.choice([0.0, 0.01, 0.05])), int(rng.choice([0, 1, 2]))

    def of(scale: float, at_rest: int, n: int) -> tuple[Array, Array, Array]:
        squares = np.sort(rng.uniform(0.5, 3.0, n)) ** 2 * scale**2
        squares[:at_rest] = 0.0
        turn = np.linalg.qr(rng.standard_normal((n, n)))[0]
        held = turn[:, at_rest:] @ turn[:, at_rest:].T
        odd = rng.standard_normal((n, n)) * 2.0 / np.sqrt(n) * scale**2
        circulatory, stiffness = held @ (odd - odd.T) @ held, turn @ np.diag(squares) @ turn.T
        rates = damped * scale * rng.uniform(0.2, 1.0, n) * (squares > 0.0)
        damping = turn @ np.diag(rates) @ turn.T
        return damping, (stiffness + stiffness.T) / 2, (circulatory - circulatory.T) / 2

    return Apart((of(1.0, free, int(rng.integers(3, 6))), of(slow, 0, int(rng.integers(2, 4)))), free, slow, 6.0 * wide)


@pytest.mark.parametrize("seed", [0, *(pytest.param(s, marks=pytest.mark.slow) for s in range(1, 6))])
@pytest.mark.parametrize(
    ("slow", "wide"), [(1e-3, 1e10), *(pytest.param(*of, marks=pytest.mark.slow) for of in ((1e-2, 1.0), (1e-4, 1e4)))]
)
def test_slow_flutter_is_told_from_motions_as_a_whole(tmp_path: Path, seed: int, slow: float, wide: float) -> None:
    made = apart(seed, slow, wide)
    case = made.case(tmp_path)
    model = st.reduced_model(case, {"q": (0.0, 1.5)})
    for q in (0.0, 0.3, 0.7, 1.1, 1.5):
        if (true := made.growing(q)) is not None:
            assert int(model.modes({"q": q}).unstable.sum()) == true[0]
            modes = st.modes(case.with_({"parameters.q.value": q}))
            assert int(modes.unstable.sum()) == true[0]
    for found in (st.onsets(case, along="q"), onsets_along(model, "q")):
        for q in np.linspace(0.0, 1.5, 30) + 1.2e-5:
            steps = [(1 if o.kind == "divergence" else 2) * (-1 if o.stabilising else 1) for o in found if o.value < q]
            true = made.growing(float(q))
            assert true is None or sum(steps) == true[1] or not found.complete


def test_what_cannot_be_told_from_rest_is_said(tmp_path: Path) -> None:
    """Two free motions, and flutter at a hundred thousandth of the other frequencies."""
    tried = (apart(seed, 1e-5, 1e10) for seed in range(40))
    made = next(m for m in tried if m.free == 2 and m.slow_grows(1.5))
    case = made.case(tmp_path)
    found = st.onsets(case, along="q")
    assert not found.complete
    assert "cannot be told from motions as a whole" in found.sentence
    model = st.reduced_model(case, {"q": (0.0, 1.5)})
    assert "cannot be told from motions as a whole" in model.hidden(model.modes({"q": 1.5}))
    said = stridor("reduce", "case.toml", "--box", "q=0:1.5", "--at", "q=1.5", "--out", "out", cwd=tmp_path)
    assert "cannot be told from motions as a whole" in " ".join((said.stdout + said.stderr).split())


def chain(n: int, held: float) -> Quadratic:
    """Masses in a row, the first of them held by a spring."""
    stiffness = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    stiffness[0, 0], stiffness[-1, -1] = 1.0 + held, 1.0
    return Quadratic(np.eye(n), np.zeros((n, n)), stiffness)


@pytest.mark.parametrize("n", [20, 700])
def test_whether_anything_is_free_is_asked_of_the_stiffness(n: int) -> None:
    """Below and above the size up to which all singular values are looked at."""
    free, held = (Quadratic(*(sp.csr_array(m) for m in chain(n, h).matrices())) for h in (0.0, 1e-6))
    assert rest_limit([free], 2.0) > 0.0
    assert rest_limit([held], 2.0) == 0.0
    assert rest_limit([held, free], 2.0) == rest_limit([free], 2.0)


def test_slow_ones_are_counted_against_free_motions() -> None:
    free, limit = chain(10, 0.0), rest_limit([chain(10, 0.0)], 2.0)
    pair, flutter = np.array([1e-9 + 0j, -1e-9]), np.array([1e-9 + 1e-8j])
    assert not more_slow(free, pair, 2.0)
    assert more_slow(free, np.concatenate([pair, flutter]), 2.0)
    assert moving(flutter, 2.0, lambda: 0.0).all()
    assert not moving(flutter, 2.0, lambda: limit).any()
