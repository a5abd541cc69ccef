"""What a report says of where a mode that grows begins to do so: by the sweep, not by numbers of a single μ."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

import stridor as st
from rubbing_block import rubbing_block
from stridor.modal.complex_modes import ComplexModes
from stridor.modal.onsets import Onset, Onsets
from stridor.view.change_parts import mechanism_table
from stridor.view.inputs import ReportInputs
from stridor.view.modal_tables import coupled_table

HZ = 2 * np.pi
MU = np.linspace(0.0, 0.5, 6)


def modes(mu: Sequence[float], growth: Any, hertz: Any, branch: Sequence[int]) -> ComplexModes:
    """Modes at these μ: growth rates and frequencies (k, b)."""
    lam = np.array(growth, dtype=float) + 1j * HZ * np.array(hertz, dtype=float)
    return ComplexModes(np.array(mu, dtype=float), lam, np.array(branch), np.zeros(lam.shape), True)


def onset(mu: float, hertz: float, branches: tuple[int, int], kind: Any = "contact", *, ends: bool = False) -> Onset:
    return Onset(mu, hertz, kind, True, ends, branches, 1e-15, None, None)


def told(onsets: Sequence[Onset], own: ComplexModes, sweep: ComplexModes | None, at_start: Any = ()) -> list[Any]:
    """The last two cells of each row: from which μ on, and how."""
    found = Onsets(tuple(onsets), (0.0, 0.5), 30e3, True, at_start=at_start)
    case = st.loads(rubbing_block("max_frequency_hz = 30e3"))
    table = mechanism_table(ReportInputs(case=case, modes=own, damped_sweep=sweep, damped_onsets=found))
    assert table is not None
    return [row.cells[3:] for row in table.rows]


@pytest.fixture
def sweep() -> ComplexModes:
    """Mode 6 grows from 0.3 to 0.4, where other nodes touch than below: mode 4 is not there any more."""
    nan = np.nan
    growth = [[-9, -20, -30]] * 3 + [[nan, -2000, 2100], [nan, -2200, 2300], [nan, -9, -9]]
    hertz = [[4100, 24600, 25400]] * 3 + [[nan, 23044, 23045], [nan, 22969, 22970], [nan, 22684, 21724]]
    return modes(MU, growth, hertz, (4, 5, 6))


OWN = modes([0.4], [[-10, 2300, -2200]], [[2044, 22970, 22969]], (1, 5, 6))
BEGINS, ENDS = onset(0.2343, 23046, (6, 6)), onset(0.4077, 22960, (6, 6), ends=True)


def test_numbers_of_one_mu_are_not_those_of_the_onsets(sweep) -> None:
    words = "other nodes touch from this μ on; numbered over friction it is mode 6"
    assert told((BEGINS, ENDS), OWN, sweep) == [("0.2343", words)]


def test_without_a_sweep_frequencies_tell(sweep) -> None:
    assert told((BEGINS, ENDS), OWN, None) == [("0.2343", "other nodes touch from this μ on")]
    beyond = modes([0.6], [[2300]], [[22970]], (5,))
    assert told((BEGINS,), beyond, sweep) == [("0.2343", "other nodes touch from this μ on")]
    far = onset(0.2343, 12e3, (5, 5))
    assert told((far,), OWN, None) == [("", "not told: no onset that was found leads to it")]


def test_growth_from_the_lowest_mu_on_is_claimed_where_it_was_found_only(sweep) -> None:
    assert told((), OWN, sweep) == [("", "not told: no onset that was found leads to it")]
    always = modes(MU, [[50]] * 6, [[22970]] * 6, (1,))
    own = modes([0.4], [[50]], [[22970]], (1,))
    assert told((), own, always) == [("", "not told: no onset that was found leads to it")]
    for known in (always, None):
        assert told((), own, known, (50 + 1j * HZ * 22970,)) == [("", "no onset: it grows from the lowest μ, 0, on")]
    # At the start something else grows.
    assert told((), own, always, (50 + 1j * HZ * 900,)) == [("", "not told: no onset that was found leads to it")]


def test_of_several_onsets_at_one_frequency_that_of_the_mode_is_told() -> None:
    growth = [[-9, -9], [-9, 40], [-9, -9], [-9, -9], [30, -9], [40, -9]]
    known = modes(MU, growth, [[9000, 9050]] * 6, (1, 2))
    own = modes([0.45], [[35, -9]], [[9000, 9050]], (1, 2))
    listed = (
        onset(0.08, 9050, (2, 2)),
        onset(0.15, 9050, (2, 2), ends=True),
        onset(0.35, 9001, (1, 1)),
        onset(0.44, 9000, (7, 7)),
    )
    assert told(listed, own, known) == [("0.3500", "other nodes touch from this μ on")]


def test_growth_that_opens_slowly_goes_back_to_the_onset_of_its_mode() -> None:
    known = modes(MU, [[-9], [-1], [-1e-9], [-1e-9], [5], [9]], [[9000]] * 6, (2,))
    own = modes([0.4], [[5]], [[9000]], (2,))
    flutter = onset(0.15, 8.9e3, (2, 3), "flutter")
    words = "flutter: modes 2 and 3 come together at 8900 Hz and exchange energy through friction"
    assert told((flutter,), own, known) == [("0.1500", words)]
    again = onset(0.17, 8.9e3, (2, 3), "flutter", ends=True)
    assert told((flutter, again), own, known) == [("", "not told: no onset that was found leads to it")]
    other = onset(0.15, 5e3, (2, 3), "flutter")
    assert told((other,), own, known) == [("", "not told: no onset that was found leads to it")]


def test_numbers_tell_as_long_as_the_same_nodes_touch() -> None:
    """Growth sets in at another frequency than it has at the next μ of a coarse sweep."""
    known = modes(MU, [[-9]] * 3 + [[5]] * 3, [[9000]] * 3 + [[8000]] * 3, (2,))
    own = modes([0.4], [[5]], [[8000]], (2,))
    flutter = onset(0.25, 9e3, (2, 3), "flutter")
    words = "flutter: modes 2 and 3 come together at 9000 Hz and exchange energy through friction"
    assert told((flutter,), own, known) == [("0.2500", words)]
    touching = onset(0.1, 700, (4, 4))
    assert told((touching, flutter), own, known) == [("", "not told: no onset that was found leads to it")]


def test_what_grows_because_other_nodes_touch_meets_no_other_mode() -> None:
    listed = (onset(0.1, 500, (1, 1)), onset(0.2, 0.0, (2, 2), "divergence"), onset(0.3, 900, (3, 4), "flutter"))
    table = coupled_table(np.array([490.0, 600.0, 850.0, 950.0]), (), Onsets(listed, (0.0, 0.5), 1e3, False))
    assert [row.cells[-1] for row in table.rows] == ["", "", "μ = 0.3000, 900 Hz", "μ = 0.3000, 900 Hz"]
