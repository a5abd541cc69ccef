"""Growth that begins above the band: what ends before the mode comes into the band does not enter it, by any source."""

from __future__ import annotations

import numpy as np
import pytest

import stridor as st
from stridor.modal.histories import Entries, StabilityChange
from stridor.modal.onset import Onset, Onsets
from stridor.modal.options import Options
from stridor.modal.over_friction import onsets_of_band
from stridor.modal.source import SOURCES
from stridor.system import System

pytestmark = pytest.mark.verification
N, T, OWN = np.array([1.0, 1.0]), np.array([1.0, 2.0]), np.diag([3.0, 3.2])
NAMES = [source.name for source in SOURCES]


def bench(rate: float) -> System:
    """Two freedoms on a contact, D = rate M. Without damping they grow together from μ = 0.529 (ω = 1.82) to 0.848 (1.69);
    then one of them sinks, to ω = 1.37 at μ = 1.1, and does not grow."""
    friction = {"law": "coulomb", "coefficient": 0.5}
    contact = {"normal": N.tolist(), "tangent": T.tolist(), "stiffness": 1.0, "friction": friction}
    return st.System.from_matrices(np.eye(2), rate * np.eye(2), OWN, contacts={"c": contact})


def values(mu: float, rate: float) -> np.ndarray:
    """λ² + rate λ + ω² = 0 with the undamped ω²."""
    squares = np.linalg.eigvals(OWN + np.outer(N - mu * T, N)).astype(complex)
    found: np.ndarray = -rate / 2 + np.sqrt(rate**2 / 4 - squares)
    return found


def enters(top: float, rate: float, low: float) -> float:
    """The first μ from ``low`` on at which the growing mode has ω = top."""
    for mu in np.linspace(low, 1.1, 5001):
        growing = [v for v in values(mu, rate) if v.real > 1e-6]
        if growing and abs(growing[0].imag) <= top:
            return float(mu)
    return np.inf


def found(rate: float, top: float, source: str, low: float = 0.0) -> Onsets:
    return onsets_of_band(bench(rate), (low, 1.1), top / (2 * np.pi), options=Options(source=source))


@pytest.mark.parametrize("rate", [0.0, 0.02])
@pytest.mark.parametrize("source", NAMES)
def test_growth_that_has_ended_does_not_come_into_the_band(source: str, rate: float) -> None:
    assert enters(1.65, rate, 0.0) == np.inf
    listed = found(rate, 1.65, source)
    assert (listed.onsets, listed.entering, listed.complete) == ((), (), True)


@pytest.mark.parametrize("rate", [0.0, 0.02])
@pytest.mark.parametrize("source", NAMES)
def test_growth_that_goes_on_does(source: str, rate: float) -> None:
    """To about a step; where the range begins above the onset it is growing already, and told as that."""
    listed = found(rate, 1.72, source)
    at = enters(1.72, rate, 0.0)
    assert [(o.stabilising, o.enters_at is None) for o in listed] == [(False, False), (True, True)]
    assert listed[0].enters_at == pytest.approx(at, abs=0.02)
    assert listed.complete
    grown = found(rate, 1.72, source, low=0.6)
    ((lam, mu),) = grown.entering
    assert mu == pytest.approx(at, abs=0.02)
    assert np.abs(values(0.6, rate) - lam).min() < 1e-6
    assert [o.stabilising for o in grown] == [True]
    assert grown.complete


@pytest.mark.parametrize("source", NAMES)
def test_growth_goes_on_beyond_an_exceptional_point(source: str) -> None:
    """The same bench with one freedom damped twice as the other: next to where modes meet branches exchange growth."""
    friction = {"law": "coulomb", "coefficient": 0.5}
    contact = {"normal": N.tolist(), "tangent": T.tolist(), "stiffness": 1.0, "friction": friction}
    system = st.System.from_matrices(np.eye(2), np.diag([1e-6, 2e-6]), OWN, contacts={"c": contact})
    listed = onsets_of_band(system, (0.0, 1.1), 1.72 / (2 * np.pi), options=Options(source=source))
    assert [(o.stabilising, o.enters_at is None) for o in listed] == [(False, False), (True, True)]
    assert listed.onsets[0].enters_at == pytest.approx(enters(1.72, 0.0, 0.0), abs=0.02)
    assert listed.complete


def end(mu: float, omega: float, branch: int = 1) -> list[StabilityChange]:
    onset = Onset(
        mu, omega / (2 * np.pi), "flutter", damped=True, stabilising=True, branches=(branch, 9), residual=1e-16,
        square_root_coefficient=None, growth_slope=-1.0,
    )  # fmt: skip
    return [StabilityChange(mu, (branch,), onset)]


def test_the_end_of_growth_is_held_against_the_entry() -> None:
    """Of branch 1 at μ = 0.25, between 0.2 and 0.3."""
    grows, decays = Entries(1.0), Entries(1.0)
    grows.watch((0.2, 0.3), np.array([0.1 + 1.1j]), np.array([0.1 + 0.9j]), [1])
    decays.watch((0.2, 0.3), np.array([-0.1 + 1.1j]), np.array([-0.1 + 0.9j]), [1])
    assert grows.after((1,), 0.1) == pytest.approx(0.25)
    assert grows.after((0, 1), 0.28) == 0.28
    assert grows.after((1,), 0.1, end(0.4, 0.5)) == pytest.approx(0.25)
    assert grows.after((1,), 0.1, end(0.15, 1.2)) is None
    # In one step: the frequency at the end says whether it was in the band by then.
    assert grows.after((1,), 0.1, end(0.22, 0.99)) == 0.22
    assert grows.after((1,), 0.1, end(0.27, 1.01)) is None
    assert grows.after((1,), 0.31) is None
    assert grows.after((2,), 0.1) is None
    assert decays.after((1,), 0.1) is None
    assert decays.after((1,), 0.21, end(0.29, 0.95)) == pytest.approx(0.25)  # it begins and ends within the step


def test_growth_that_is_handed_over_enters_on_the_other_branch() -> None:
    """Beside an exceptional point one branch ceases to grow and another of its frequency begins to; the other way round
    it ends there, or where an end was solved."""
    watched = Entries(1.0)
    for between, grows, decays in (((0.2, 0.3), 1.2, 1.3), ((0.3, 0.4), 1.16, 1.2), ((0.4, 0.5), 0.9, 1.1)):
        handed = between[0] >= 0.3  # from branch 1 to branch 2
        before = [-0.1 + 1.2j, 0.1 + 1.2j] if handed and between[0] > 0.3 else [0.1 + 1.2j, -0.1 + 1.2j]
        after = [-0.1 + 1j * decays, 0.1 + 1j * grows] if handed else [0.1 + 1j * grows, -0.1 + 1j * decays]
        watched.watch(between, np.array(before), np.array(after), [1, 2])
    assert watched.after((1,), 0.2) == pytest.approx(0.4667, abs=1e-3)
    assert watched.after((2,), 0.2) == pytest.approx(0.4667, abs=1e-3)
    assert watched.after((1,), 0.2, end(0.45, 0.95, branch=2)) == 0.45
    assert watched.after((1,), 0.2, end(0.42, 1.05, branch=2)) is None
    assert watched.after((1,), 0.2, end(0.35, 1.15, branch=1)) is None
