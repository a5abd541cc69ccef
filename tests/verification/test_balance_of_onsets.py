"""What begins to grow less what ceases to is what grows at the end more than at the start: a lost onset is noticed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from benches import by_hand
from stridor.modal import receptance_onsets
from stridor.modal.onsets import onsets
from stridor.modal.options import Options
from stridor.modal.over_friction import onsets_of_band
from stridor.system import System

pytestmark = pytest.mark.verification
RANGE, TOP = (0.0, 1.5), 1.0


@pytest.fixture
def system() -> System:
    """λ² = (4μ − 13)/2 ± √((3 − 4μ)² − 4)/2: the two meet at μ = 1/4, where λ² = −6, and part at 5/4, where it is −4."""
    return by_hand(np.eye(2), np.zeros((2, 2)), np.diag([6.0, 5.0]), [[1.0, 1.0]], [[4.0, 0.0]], 1.0)


@pytest.fixture
def unsettled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Newton's method does not settle where growth ends."""
    settles = receptance_onsets.meeting

    def meeting(*given: Any) -> Any:
        root = settles(*given)
        return None if root is None or root.square is None or root.square < 0 else root

    monkeypatch.setattr(receptance_onsets, "meeting", meeting)


def ends(found: Any) -> list[bool]:
    return [o.stabilising for o in found.onsets]


def test_all_onsets_balance(system: System) -> None:
    found = onsets_of_band(system, RANGE, TOP)
    assert (found.source, found.unbalanced, ends(found)) == ("receptance", 0, [False, True])
    assert [o.mu for o in found.onsets] == [pytest.approx(0.25, rel=1e-12), pytest.approx(1.25, rel=1e-12)]
    assert [2 * np.pi * o.frequency_hz for o in found.onsets] == [pytest.approx(math.sqrt(6)), pytest.approx(2.0)]
    assert found.complete


@pytest.mark.usefixtures("unsettled")
def test_a_lost_end_of_growth_is_told(system: System) -> None:
    found = onsets_of_band(system, RANGE, TOP, options=Options(source="receptance"))
    assert (found.unbalanced, ends(found)) == (2, [False])
    assert not found.complete
    assert "the growth of 2 more eigenvalues than the branches followed" in found.completeness


@pytest.mark.usefixtures("unsettled")
def test_a_lost_end_of_growth_is_sought_in_the_full_problem(system: System) -> None:
    found = onsets_of_band(system, RANGE, TOP)
    assert (found.source, ends(found)) == ("full", [False, True])
    assert found.onsets[1].mu == pytest.approx(1.25, rel=1e-9)
    assert found.complete


@pytest.mark.parametrize("stiff", [1e7, 1e8, 1e9])
def test_modes_that_meet_far_below_the_stiffest_are_solved_for(stiff: float) -> None:
    """Both masses of the mode coupling in two halves each, which stiff springs hold together: the meeting at μ = 3/4
    stays, P is singular to working precision all around it, and ω has no more digits than its vectors."""
    stiffness = np.zeros((4, 4))
    stiffness[:2, :2] = [[2.0, 1.0], [1.0, 2.0 - 4 / 3]]
    for tie in ([1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, -1.0]):
        stiffness += stiff * np.outer(tie, tie)
    system = by_hand(
        np.eye(4) / 2, np.zeros((4, 4)), stiffness, [[0.0, 1.0, 0.0, 0.0]], [[1.0, 0.0, 0.0, 0.0]], 4 / 3
    )
    found = onsets(system, (0.0, 1.0), max_frequency_hz=1.0, damped=False)
    assert (found.source, found.unbalanced) == ("receptance", 0)
    assert [o.mu for o in found.onsets] == [pytest.approx(0.75, rel=1e-9)]
    assert 2 * np.pi * found.onsets[0].frequency_hz == pytest.approx(math.sqrt(2), rel=1e-6)
