"""Growth that begins above the band, comes into it and ends before the range does: of small systems it is listed.

The truth is dense: at any μ no more eigenvalues grow in the band than the onsets below it say.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
import scipy.linalg as sl

import stridor as st
from stridor.errors import AnalysisError
from stridor.modal import checked_onsets
from stridor.modal.between_ends import NOT_LOOKED, Between
from stridor.modal.onset import Onsets
from stridor.modal.onsets import onsets
from stridor.modal.over_friction import onsets_of_band
from stridor.system import System

pytestmark = pytest.mark.verification

GRID = np.linspace(0.0, 1.0, 97)
STEP = 0.02  # μ at which a mode comes into the band are known to about a step


def random_system(seed: int) -> tuple[System, list[np.ndarray], float]:
    """Two slow modes and one or two fast ones with two elastic contacts, normals and pushes at μ = 1 of these, and a
    band [Hz] between the slow modes."""
    rng = np.random.default_rng([seed, 23])
    n = int(rng.integers(3, 5))
    half = np.diag(np.exp(rng.uniform(-0.7, 0.7, n)))
    basis = np.linalg.qr(rng.standard_normal((n, n)))[0]
    omega = np.concatenate([[1.0, rng.uniform(1.1, 1.6)], np.sort(rng.uniform(3.0, 6.0, n - 2))])
    stiffness = half @ basis @ np.diag(omega**2) @ basis.T @ half
    damping = half @ basis @ np.diag(2 * omega * rng.uniform(0.0, 0.02, n)) @ basis.T @ half
    contacts, rows = {}, []
    for k in range(2):
        normal, tangent = rng.standard_normal((2, n))
        stiff = float(10 ** rng.uniform(-0.5, 1.5))
        contacts[f"c{k}"] = {
            "normal": normal, "tangent": tangent, "stiffness": stiff, "slip": -1.0,
            "friction": {"law": "coulomb", "coefficient": 0.3},
        }  # fmt: skip
        rows.append(np.array([normal, tangent, stiff * normal]))
    system = System.from_matrices(half @ half, damping, (stiffness + stiffness.T) / 2, contacts=contacts)
    slow = np.sort(np.abs(eigenvalues(system, rows, 0.0).imag))[[0, 2]]
    return system, rows, float(np.mean(slow)) / (2 * np.pi)


def eigenvalues(system: System, rows: list[np.ndarray], mu: float) -> np.ndarray:
    """All of them, dense."""
    mass, damping, stiffness = (m.toarray() for m in (system.mass, system.damping, system.stiffness))
    for normal, tangent, stiff in rows:
        stiffness = stiffness + np.outer(normal + mu * tangent, stiff)
    n, inverse = len(mass), np.linalg.inv(mass)
    return sl.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ damping]]))


def growing_roots(values: np.ndarray, top: float) -> int:
    """How many surely grow in the band."""
    return int(np.count_nonzero((values.real > 1e-6 * np.abs(values)) & (np.abs(values.imag) < top * (1 - 1e-6))))


def unsaid(found: Onsets, system: System, rows: list[np.ndarray], band_hz: float) -> list[float]:
    """μ at which more eigenvalues grow in the band than the onsets below it say."""
    at = [(o.mu if o.enters_at is None else o.enters_at - STEP, o.roots) for o in found]
    started = growing_roots(eigenvalues(system, rows, 0.0), 2 * np.pi * band_hz)
    amiss: list[float] = []
    for mu in GRID:
        said = started + sum(r for where, r in at if where < mu) + 2 * sum(m - STEP < mu for _, m in found.entering)
        if growing_roots(eigenvalues(system, rows, mu), 2 * np.pi * band_hz) > said:
            amiss.append(float(mu))
    return amiss


def held_against_dense(seed: int) -> None:
    system, rows, band_hz = random_system(seed)
    found = onsets_of_band(system, (0.0, 1.0), band_hz)
    amiss = unsaid(found, system, rows, band_hz)
    # What comes and goes between two of the values looked at may be missing.
    looked = [mu for mu in amiss if any(abs(mu - k / 12) < 1e-9 for k in range(1, 12))]
    assert not looked or not found.complete, (seed, looked, found.completeness)


# Of 2400 seeds those at which what comes and goes was missed when the ends alone were looked at.
MISSED = (66, 412, 466, 474, 1322, 1381, 1395, 1677, 1757, 1873, 2013, 2201, 2341)


@pytest.mark.parametrize("seed", [*MISSED[:2], *MISSED[5:7], *range(6)])
def test_no_more_grow_between_the_ends_than_the_onsets_say(seed):
    held_against_dense(seed)


def test_without_a_look_between_the_ends_they_do(monkeypatch):
    monkeypatch.setattr(checked_onsets, "between_ends", lambda *_, **__: NOT_LOOKED)
    with pytest.raises(AssertionError, match="Checked at both ends"):
        held_against_dense(MISSED[5])


@pytest.mark.slow
def test_nor_of_many_more():
    for seed in (*MISSED, *range(6, 400)):
        held_against_dense(seed)


def test_what_comes_and_goes_has_an_onset_with_where_it_enters_and_an_end():
    system, rows, band_hz = random_system(1757)
    found = st.onsets(system, (0.0, 1.0), max_frequency_hz=band_hz)
    begins = [o for o in found if o.enters_at is not None]
    ends = [o for o in found if o.stabilising]
    assert len(begins) == len(ends) == 1
    assert begins[0].frequency_hz > band_hz > ends[0].frequency_hz
    top = 2 * np.pi * band_hz
    for mu, roots in ((begins[0].enters_at - STEP, 0), (begins[0].enters_at + STEP, 2), (ends[0].mu + 1e-4, 0)):
        assert growing_roots(eigenvalues(system, rows, mu), top) == roots
    assert "As many roots grow at each of 11 further values as the onsets say." in found.completeness


def test_what_is_said_of_it():
    assert NOT_LOOKED.words == ""
    assert Between(11).words == " As many roots grow at each of 11 further values as the onsets say."
    assert not Between(11).amiss
    said = "at {} values looked at between them other numbers of roots grow than the onsets say"
    assert Between(11, odd=2).amiss == [said.format("2 of 11")]
    assert Between(11, odd=11).amiss == [said.format("all 11")]


def left_by_the_end(seed: int) -> int:
    """Whether growing modes have left a band that ends just above the first flutter; said if so, and not otherwise."""
    system, rows, own_hz = random_system(seed)
    flutter = [o for o in onsets(system, (0.0, 1.0), max_frequency_hz=3 * own_hz) if o.kind == "flutter"]
    if not flutter:
        return 0
    band_hz = 1.02 * flutter[0].frequency_hz
    found = st.onsets(system, (0.0, 1.0), max_frequency_hz=band_hz)
    if found.source != "receptance" or not found.complete:
        return 0
    top, values = 2 * np.pi * band_hz, eigenvalues(system, rows, 1.0)
    grown = growing_roots(values, top) - growing_roots(eigenvalues(system, rows, 0.0), top)
    lost = sum(o.roots for o in found) - grown
    named = re.search(r"(\d+) ha(?:s|ve) left the band upwards by then: .* above ([\d.]+) Hz", found.completeness)
    ended = re.search(r"(\d+) ha(?:s|ve) left the band upwards and ceased to grow beyond it", found.completeness)
    assert lost == 2 * sum(int(one[1]) for one in (named, ended) if one), (seed, lost, found.completeness)
    if named:
        assert float(named[2]) == pytest.approx(band_hz, rel=1e-5)
        above = (values.real > 1e-6 * np.abs(values)) & (values.imag > top)
        assert np.count_nonzero(above) >= int(named[1])
    return int(named is not None)


@pytest.mark.parametrize(
    ("seeds", "least"), [(range(11, 17), 2), pytest.param(range(30), 3, marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_modes_that_leave_the_band_growing_are_said_to(seeds: range, least: int):
    assert sum(left_by_the_end(seed) for seed in seeds) >= least


@pytest.mark.slow
def test_many_more_that_leave_the_band_are_said_to():
    assert sum(left_by_the_end(seed) for seed in range(30, 400)) >= 20


def test_a_growing_pair_that_parts_is_said_to():
    system, rows, band_hz = random_system(135)
    found = st.onsets(system, (0.0, 2.0), max_frequency_hz=3 * band_hz)
    assert [o.kind for o in found] == ["flutter"]
    assert len(found.at_end) == 2
    assert not np.any(np.imag(found.at_end))
    assert growing_roots(eigenvalues(system, rows, 2.0), 6 * np.pi * band_hz) == 2
    assert "A growing pair has parted into two motions that grow without oscillating." in found.completeness


def test_a_value_at_an_onset_is_not_held_against_it():
    """A mass between two belts at right angles, K = [[1, −2μ], [−μ, 2]]: it diverges from μ = 1 on, which is the fourth of
    twelve parts of the range, and rounding decides whether something grows there."""
    belts = {
        name: {"normal": normal, "tangent": normal[::-1], "stiffness": k, "slip": 1.0, "friction": {"law": "coulomb", "coefficient": 0.3}}
        for name, normal, k in (("a", [1.0, 0.0], 1.0), ("b", [0.0, 1.0], 2.0))
    }
    found = st.onsets(System.from_matrices(np.eye(2), None, np.zeros((2, 2)), contacts=belts), (0.0, 3.0), max_frequency_hz=1.0)
    assert [(o.kind, o.mu) for o in found] == [("divergence", pytest.approx(1.0, abs=1e-12))]
    assert "As many roots grow at each of 10 further values as the onsets say." in found.completeness


def test_what_could_not_be_checked_is_not_called_complete(monkeypatch):
    def failing(*_: object, **__: object) -> None:
        raise AnalysisError("the quadratic problem is singular for every λ")

    system, _, band_hz = random_system(412)
    monkeypatch.setattr(checked_onsets, "growing_modes", failing)
    found = st.onsets(system, (0.0, 1.0), max_frequency_hz=band_hz)
    assert not found.complete
    assert found.completeness.endswith("Not checked: the quadratic problem is singular for every λ.")
    assert found.to_json()["complete"] is False
