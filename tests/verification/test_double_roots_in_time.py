"""Where two modes have become one the motion in time is (w + t v) e^{λt}: what both approaches say of it, and that what
is left of no motion decides nothing."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import stridor as st
from mode_coupling import mode_coupling
from stridor.agreement import pairs, perturbation
from stridor.agreement.critical import critical_friction
from stridor.agreement.perturbation import modes_as_in_time, options_in_time, perturb
from stridor.case import Case
from stridor.study.settings import settings_of

pytestmark = pytest.mark.verification

MEETING = 0.75  # here both diagonal stiffnesses are 2 and the normal motion alone is the vector of the double root


def marched(damping: float, stepper: str = "explicit", step: float = 0.02) -> Case:
    """With dashpots c at 45° both ways, which damp by c in all directions: Re λ = −c/2 below the meeting."""
    return mode_coupling(damping).with_(
        {"temporal.stepper": stepper, "temporal.step": step, "modal.max_frequency_hz": 2.0}
    )


def growth_at(case: Case, mu: float) -> Any:
    return st.compare(case, [mu], critical=False, only=["growth"]).comparisons[0]


@pytest.mark.parametrize("stepper", ["explicit", "implicit"])
def test_at_a_double_root_whose_vector_does_not_slip_decay_is_told(stepper: str) -> None:
    one = growth_at(marched(0.02, stepper), MEETING)
    assert one.agrees is True, one.verdict
    assert one.perturbation.growth_rate == pytest.approx(-0.01, rel=0.02)
    assert one.perturbation.eigenvalue.imag == pytest.approx(math.sqrt(2.0), rel=0.01)
    assert one.perturbation.components.amplitudes.max() > 1e-12


@pytest.mark.parametrize("seed", [0, 1, pytest.param(2, marks=pytest.mark.slow), pytest.param(3, marks=pytest.mark.slow)])
def test_beside_a_double_root_nothing_is_said_to_disagree(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for away in (-1e-12, 1e-9):
        damping, mu = rng.uniform(0.01, 0.1), MEETING * (1.0 + away * rng.uniform(0.5, 2.0))
        one = growth_at(marched(damping), mu)
        assert one.agrees is True, (damping, mu, one.verdict)
        assert one.perturbation.growth_rate == pytest.approx(-damping / 2, rel=0.1)


def test_what_differs_at_a_double_root_disagrees_still(monkeypatch: pytest.MonkeyPatch) -> None:
    from stridor.agreement import comparison

    def wrong(*given: Any) -> Any:
        found = modes_as_in_time(*given)
        return replace(found, eigenvalues=found.eigenvalues + 0.02)

    monkeypatch.setattr(comparison, "modes_as_in_time", wrong)
    one = growth_at(marched(0.02), MEETING)
    assert one.agrees is False, one.verdict
    assert "modal says unstable, the temporal perturbation does not grow" in one.verdict
    assert one.perturbation.growth_rate == pytest.approx(-0.01, rel=0.1)


def test_rounding_of_steady_sliding_is_no_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(perturbation, "silent_pairs", lambda *_: [])
    case = marched(0.02)
    one = growth_at(case, MEETING)
    assert one.agrees is None
    assert one.verdict == "μ = 0.75: modal says stable, but the contacts show nothing of a small motion in time"
    assert one.perturbation.eigenvalue == 0
    with pytest.raises(st.AnalysisError, match=r"no growth is told at μ = 0\.75: the contacts show nothing"):
        critical_friction(st.build_system(case), (MEETING, 1.0), settings=settings_of(case), max_frequency_hz=1.0)


def test_the_second_vector_of_a_double_root_solves_its_equation() -> None:
    """A 2×2 case by hand: K = [[2, 0], [1, 2]], v = (0, 1), so that w = (−(2λ + c), 0)."""
    system = st.build_system(marched(0.02))
    modes = modes_as_in_time(system, MEETING, 1.0)
    assert modes.right is not None
    lam, vectors = modes.eigenvalues[0], modes.right[0]
    assert pairs.silent_pairs(system.contact_nodes(), lam, vectors) == [(0, 1)]
    w = pairs.second_of(system, MEETING, complex(lam[0]), vectors[0], options_in_time(system))
    # In double precision a double root is known to 1e-8 and its vector to 1e-7, of which w has a share along v.
    assert w == pytest.approx([-(2 * lam[0] + 0.02) * vectors[0][1], 0.0], rel=1e-6, abs=1e-6 * np.linalg.norm(w))
    # Vectors that differ, or slip, are no such pair.
    nodes = system.contact_nodes()
    assert pairs.silent_pairs(nodes, lam, np.eye(2, dtype=complex)) == []
    assert pairs.silent_pairs(nodes, lam, np.ones((2, 2), dtype=complex) / math.sqrt(2.0)) == []
    assert pairs.silent_pairs(nodes, lam * [1.0, 1.001], vectors) == []


def test_a_step_that_moves_the_roots_apart_is_named() -> None:
    """Just above the meeting modes differ in rate; a coarse step has them differ in frequency."""
    one = growth_at(marched(0.02, "implicit"), MEETING * (1.0 + 7e-5))
    assert one.agrees is None
    assert "none of the modes" in one.verdict
    assert "the step parts them, take temporal.step = 0.0025 or less" in one.verdict


def test_a_silent_pair_starts_with_what_slips() -> None:
    case = marched(0.02)
    system = st.build_system(case)
    seen = perturb(system, MEETING, settings=replace(settings_of(case), step=0.02), max_frequency_hz=1.0, duration=60.0)
    assert np.abs(seen.signal).max() == pytest.approx(0.5e-5, rel=0.1)  # of two modes one starts
