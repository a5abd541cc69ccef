"""A free body and slow sprung masses beside a structure: nothing is called complete that lacks a mode.

The truth: the structure's modes by a dense solve of it alone, the slow masses' by hand, and a double zero for each free
body. Slow modes are 1e-6 to 1e-3 of the fastest, where what rounding makes of zero begins.
"""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp

import stridor as st
from stridor.modal.at_rest import DENSE, more_slow
from stridor.modal.complex_modes import complex_modes
from stridor.modal.full import modes as full_module
from stridor.modal.quadratic import Quadratic
from stridor.system import System

pytestmark = pytest.mark.verification

CONTACT, SAME = 0.2, 1e-6
TIMES = (1.0, 1.5, 3.0, 10.0)  # of the structure's own frequency: the band


class Beside:
    """Three to thirty freedoms: a structure that rubs, one or two slow masses, up to two free ones."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng([seed, 77])
        n = int(rng.integers(3, 31))
        self.free = int(rng.integers(0, 3)) if n > 4 else 1
        slow = int(rng.integers(1, 3)) if n - self.free > 2 else 1
        k = n - self.free - slow
        own = np.exp(rng.uniform(-1, 1, n))
        rates = np.exp(rng.uniform(np.log(0.3), 0, k))
        rates[0] = 1.0
        basis = np.linalg.qr(rng.standard_normal((k, k)))[0]
        stiffness, damping = np.zeros((n, n)), np.zeros((n, n))
        half = np.sqrt(own[:k])
        stiffness[:k, :k] = half[:, None] * (basis @ np.diag(rates**2) @ basis.T) * half
        self.slow = 10 ** rng.uniform(-6, -3, slow)
        at = np.arange(k, k + slow)
        stiffness[at, at] = own[at] * self.slow**2
        if seed % 2:
            damping[:k, :k] = 0.01 * stiffness[:k, :k]
        self.parts = np.diag(own)[:k, :k], damping[:k, :k], stiffness[:k, :k]
        self.rows = np.eye(k)[0], np.eye(k)[min(1, k - 1)]
        contact = {
            "normal": np.eye(n)[0], "tangent": np.eye(n)[min(1, k - 1)], "stiffness": CONTACT, "slip": -1.0,
            "friction": {"law": "coulomb", "coefficient": 0.3},
        }  # fmt: skip
        self.system = System.from_matrices(
            np.diag(own), damping, (stiffness + stiffness.T) / 2, contacts={"c": contact}
        )

    def frequencies(self, mu: float) -> np.ndarray:
        """Of all that swings [1/s]."""
        mass, damping, stiffness = self.parts
        normal, slide = self.rows
        k = len(mass)
        whole = stiffness + CONTACT * np.outer(normal + mu * slide, normal)
        companion = np.block([[np.zeros((k, k)), np.eye(k)], [-np.linalg.solve(mass, m) for m in (whole, damping)]])
        values = sl.eigvals(companion)
        return np.concatenate([values.imag[values.imag > 1e-9], self.slow])


def lacking(case: Beside, mu: float, times: float, source: str | None) -> tuple[int, str]:
    """How many frequencies of the band the list lacks, and what it says."""
    band = 1.3 * times / (2 * np.pi)
    if source is None:
        found = st.modes(case.system, mu, max_frequency_hz=band)
    else:
        found = complex_modes(case.system, mu, count=None, max_frequency_hz=band, source=source)  # type: ignore[arg-type]
    listed = found.eigenvalues[0].imag
    truth = case.frequencies(mu)
    truth = truth[truth <= 2 * np.pi * band]
    off = np.abs(truth[:, None] - listed[np.isfinite(listed)]).min(axis=1, initial=np.inf)
    return int(np.count_nonzero(off > 0.1 * truth)), found.completeness[0]


def looked_at(seeds: range) -> tuple[int, int]:
    """How many lists lack something, each of which says so, and how many are whole and say that."""
    lack = whole = 0
    for seed in seeds:
        case = Beside(seed)
        for times in TIMES:
            for mu in (0.0, 0.3):
                for source in (None, "full"):
                    missed, said = lacking(case, mu, times, source)
                    assert not missed or "NOT COMPLETE: there are modes below" in said, (seed, times, mu, said)
                    lack, whole = lack + bool(missed), whole + (not missed and "NOT" not in said)
    return lack, whole


@pytest.mark.parametrize(
    ("seeds", "least"), [(range(4, 8), (2, 38)), pytest.param(range(4, 20), (5, 150), marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_no_list_that_lacks_a_slow_mode_is_called_complete(seeds: range, least: tuple[int, int]):
    lack, whole = looked_at(seeds)
    assert lack >= least[0], (lack, whole)
    assert whole >= least[1], (lack, whole)


def test_without_the_count_of_free_motions_some_are(monkeypatch):
    monkeypatch.setattr(full_module, "more_slow", lambda *_: False)
    with pytest.raises(AssertionError, match="Complete"):
        looked_at(range(10, 11))


@pytest.mark.slow
def test_nor_of_many_more():
    lack, whole = looked_at(range(20, 160))
    assert lack >= 50, (lack, whole)
    assert whole >= 1000, (lack, whole)


@pytest.mark.parametrize(("share", "free"), [(5e-7, 0), (5e-7, 1), (5e-6, 1)])
def test_a_slow_pair_that_grows_beside_a_free_body_has_its_onset_and_has_not_left_the_band(share, free):
    """The mass between two springs at ±30°, which flutters from μ = 3/4 on, slow beside an oscillator of 1 rad/s."""
    n = 3 + free
    stiffness = np.zeros((n, n))
    stiffness[0, 0] = 1.0
    for degrees, k in ((150, 2 / 3 * (2 - 3**0.5)), (30, 2 / 3 * (2 + 3**0.5))):
        along = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
        stiffness[1:3, 1:3] += share**2 * k * np.outer(along, along)
    contact = {
        "normal": np.eye(n)[2], "tangent": np.eye(n)[1], "stiffness": 4 / 3 * share**2, "slip": 1.0,
        "friction": {"law": "coulomb", "coefficient": 0.9},
    }  # fmt: skip
    system = System.from_matrices(np.eye(n), np.zeros((n, n)), stiffness, contacts={"c": contact})
    found = st.onsets(system, (0.0, 1.0), max_frequency_hz=1.3 / (2 * np.pi))
    assert [o.mu for o in found] == pytest.approx([0.75], rel=1e-9)
    assert "left the band" not in found.completeness
    unsought = "At μ = 1, 1 branch grows below 2.07e-07 Hz, where none was sought beside motions as a whole."
    assert (unsought in found.completeness) == (free == 1 and share == 5e-7)


@pytest.mark.parametrize("skew", [0.0, 0.3])
@pytest.mark.parametrize("slow", [(), (2e-6,), (3e-6, 1e-6)])
@pytest.mark.parametrize("free", [0, 1, 3, 6])
def test_of_large_matrices_free_motions_are_counted_too(free, slow, skew):
    count, rest = DENSE + 40, free + len(slow)
    chain = sp.diags_array([np.full(count - 1, -0.25), np.full(count, 0.5), np.full(count - 1, -0.25)], offsets=[-1, 0, 1])
    rubs = sp.csr_array(([skew], ([1], [0])), shape=(count, count))
    stiffness = sp.csr_array(sp.block_diag([chain + rubs, sp.diags_array(np.r_[np.zeros(free), np.square(slow)])]))
    size = count + rest
    problem = Quadratic(sp.csr_array(sp.eye_array(size)), sp.csr_array((size, size)), stiffness)
    near_zero = 1j * np.r_[np.full(free, 1e-9), slow]
    assert more_slow(problem, near_zero, 1.0) is bool(slow)
