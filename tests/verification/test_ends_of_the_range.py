"""Onsets where a range begins or ends, and a range that is solved in part: what is said of all of them can be counted.

With n⁻ and n⁺ growing eigenvalues of the band at both ends, r of each onset in it and t of each mode that passes its end
upwards growing, n⁺ = n⁻ + Σ r − Σ t.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_between_the_ends import random_system

import stridor as st
from stridor.modal.between_ends import Between
from stridor.modal.checked_onsets import checked_onsets
from stridor.modal.histories import Entries
from stridor.modal.onset import Onset, Onsets
from stridor.modal.onsets import onsets
from stridor.modal.options import Options
from stridor.modal.over_friction import onsets_of_band
from stridor.system import System

pytestmark = pytest.mark.verification
MEETS = 0.55625  # (ω₁² − ω₂²)²/4 = k₁₂ (k₁₂ + μk): 2.5² = 4 (10 μ − 4)
LEFT = "left the band upwards"


@pytest.fixture
def block() -> System:
    """Two freedoms, K = [[20, 4], [4, 15 + 10]] with friction in the first row; undamped they meet at MEETS."""
    belt = {"normal": [0, 1], "tangent": [1, 0], "stiffness": 10.0, "friction": {"law": "coulomb", "coefficient": 0.3}}
    return System.from_matrices(np.eye(2), None, [[20.0, 4.0], [4.0, 15.0]], contacts={"b": belt})


def found(system: System, low: float, high: float, source: str | None = None, *, damped: bool = False) -> Onsets:
    workspace = st.Workspace(system, modal={"source": source or "receptance", "max_frequency_hz": 5.0, "damped": damped})
    return st.onsets(workspace, (low, high))


def brings(onset: Onset) -> tuple[float, bool]:
    return onset.mu, onset.stabilising


@pytest.mark.parametrize("source", ["receptance", "krylov", "reduced", "full"])
def test_growth_that_begins_at_the_low_end_is_listed(block: System, source: str) -> None:
    told = found(block, MEETS, 1.0, source)
    assert [brings(o) for o in told] == [(pytest.approx(MEETS, rel=1e-12), False)]
    assert told[0].mu >= MEETS
    assert (len(told.at_start), len(told.at_end), told.complete) == (0, 1, True)
    assert "As many roots grow at each" in told.completeness


@pytest.mark.parametrize("beyond", [1e-6, 1e-3])
def test_growth_that_began_below_the_low_end_is_not(block: System, beyond: float) -> None:
    told = found(block, MEETS + beyond, 1.0)
    assert (len(told), len(told.at_start), len(told.at_end), told.complete) == (0, 1, 1, True)


@pytest.mark.parametrize(("seed", "ends"), [(103, False), (106, False), (114, False), (117, False), (79, True)])
@pytest.mark.parametrize("beyond", [0.0, 1e-16, 1e-10])
def test_damped_growth_that_begins_or_ends_at_the_low_end(seed: int, ends: bool, beyond: float) -> None:
    system, _, band_hz = random_system(seed)
    options = Options(source="receptance")
    mu = next(o.mu for o in onsets_of_band(system, (0.0, 1.0), 2 * band_hz, options=options) if o.stabilising is ends)
    low = mu * (1 + beyond)
    told = onsets_of_band(system, (low, 1.0), 2 * band_hz, options=options)
    assert (told.complete, told.unbalanced) == (True, 0), told.completeness
    if not ends:
        assert (told[0].stabilising, told[0].mu, len(told.at_start)) == (False, pytest.approx(low, rel=1e-12), 0)


@pytest.mark.parametrize("high", [MEETS, float(np.nextafter(MEETS, 1.0))])
def test_growth_that_begins_at_the_high_end_has_not_left_the_band(block: System, high: float) -> None:
    told = found(block, 0.0, high)
    assert [brings(o) for o in told] == [(pytest.approx(MEETS, rel=1e-12), False)]
    assert (len(told.at_end), told.complete, LEFT in told.completeness) == (0, True, False)
    assert "Growth begins at μ = 0.55625, the end of the range: nothing of it is beyond rounding" in told.completeness


def test_growth_that_ends_at_the_high_end_has_not_left_the_band() -> None:
    """K = 4 I; the mode that grows from 0.5374 on is on the axis at μ = 1."""
    law = {"law": "coulomb", "coefficient": 0.5}
    rows = [
        ([1, 0, 0, 0, -1], [0, 0, 0, 1, -1], 1.0), ([0, 0, 0, 0, 1], [0, 0, 0, 1, 0], 1.0),
        ([0, -1, 0, 0, 1], [1, -1, 0, 0, 0], -1.0),
    ]  # fmt: skip
    contacts = {
        f"c{k}": {"normal": n, "tangent": t, "stiffness": 1.0, "friction": law, "slip": slip}
        for k, (n, t, slip) in enumerate(rows)
    }
    system = System.from_matrices(np.eye(5), np.diag([0.25, 0, 0, 0, 0]), 4 * np.eye(5), contacts=contacts)
    told = st.onsets(system, (0.0, 1.0), max_frequency_hz=30 / (2 * np.pi))
    assert (len(told.at_end), told.complete, LEFT in told.completeness) == (0, True, False)
    ends = [o.mu for o in told if o.stabilising]
    assert ends == [1.0] or "1 of the modes that grew is on the axis at μ = 1, the end of the range." in told.completeness


def test_onsets_that_do_not_account_for_what_grows_are_not_called_complete(block: System) -> None:
    own = onsets(block, (0.0, 1.0), max_frequency_hz=5.0, damped=False)
    assert checked_onsets(block, own, damped=False).complete
    for kept, said in (((), "+0"), (own.onsets * 2, "+4")):
        told = checked_onsets(block, replace(own, onsets=kept), damped=False)
        assert not told.complete
        assert f"+2 eigenvalues grow from one to the other where the onsets say {said}" in told.completeness
        assert LEFT not in told.completeness


def test_nor_are_those_that_do_not_account_for_it_at_a_value_between() -> None:
    assert Between(11, odd=11).amiss
    assert Between(11, odd=1).amiss
    assert not Between(11).amiss
    assert not Between(0).amiss


def test_who_passes_the_end_of_the_band_growing_is_counted() -> None:
    up, down = np.array([0.1 + 0.9j]), np.array([0.1 + 1.1j])
    begins = np.array([-0.1 + 0.9j])
    each = [(up, down, [(2, 2)]), (down, up, [(-2, -2)]), (begins, down, [(0, 2)]), (begins, down - 0.2, [])]
    each.append((0 * up, np.array([1.1j]), []))
    for old, new, counts in each:
        entries = Entries(1.0)
        entries.watch((0.2, 0.3), old, new, [1])
        assert [(p.low, p.high, p.least, p.most) for p in entries.passed] == [(0.2, 0.3, *c) for c in counts]


def test_a_range_solved_in_part_says_where_nothing_is_said() -> None:
    """From μ = 0.9996 on no set of touching nodes is in equilibrium."""
    law = {"law": "coulomb", "coefficient": 0.5}
    rows = {"c0": ([0, 0, -1, 0, 0, 1], [0, 1, 0, 0, 0, 0], "rigid"), "c1": ([0, 0, 0, 0, 0, 1], [0, 0, 0, 1, 0, 0], 16.0)}
    contacts = {
        name: {"normal": n, "tangent": t, "stiffness": k, "friction": law, "slip": 1.0} for name, (n, t, k) in rows.items()
    }
    stiffness = 4 * (np.diag([1.0, 2, 2, 2, 2, 1]) - np.eye(6, k=1) - np.eye(6, k=-1))
    damping = np.diag([0, 0, 0.125, 0.125, 0.125, 0])
    load = {"f": [0.0, 0, 2, 0, 0, -2]}
    system = System.from_matrices(np.eye(6), damping, stiffness, contacts=contacts, loads=load)
    told = st.onsets(system, (0.0, 1.5), max_frequency_hz=25 / (2 * np.pi))
    high = told.friction_range[1]
    assert high == pytest.approx(1.0, abs=1e-3)
    lead = f"Nothing is said of μ = {high:.6g} to 1.5, where nothing was solved. One stretch of μ, with the nodes that"
    assert told.completeness.startswith(lead)
    assert told.complete
    assert "Nothing is said of" not in st.onsets(system, (0.0, 0.9), max_frequency_hz=25 / (2 * np.pi)).completeness
