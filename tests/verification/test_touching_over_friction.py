"""Sweeps and onsets hold the nodes that touch at one μ: said where steady sliding elsewhere has others."""

from __future__ import annotations

import numpy as np
import pytest

import stridor as st
from rubbing_block import rubbing_block

pytestmark = pytest.mark.verification

BAND = "max_frequency_hz = 20e3\nfriction_range = [0.0, {end}]"


def block(end: float, coefficient: float = 0.4) -> st.Case:
    made = st.loads(rubbing_block(BAND.format(end=end)))
    return made.with_({"contacts.face.friction.coefficient": coefficient})


def touching(case: st.Case, mu: float) -> int:
    return int(st.steady_sliding(case, mu).active.sum())


def test_other_nodes_at_another_friction_are_told() -> None:
    case = block(0.4, coefficient=0.0)
    here, there = touching(case, 0.0), touching(case, 0.4)
    assert there < here
    swept, alone = st.modes(case, [0.0, 0.4]), st.modes(case, 0.4)
    # The held nodes are stiffer than those that are left.
    assert swept.frequency_hz[1, 0] > 1.01 * alone.frequency_hz[0, 0]
    (note,) = swept.notes
    assert note.startswith(f"The {here} of 6 contact nodes that touch in steady sliding at the case's own friction")
    assert f"at μ = 0.4 {here - there} of them open" in note
    assert "at μ = 0 " not in note
    assert alone.notes == ()
    assert f"at μ = 0.4 {here - there} of them open" in st.onsets(case).notes[0]


def test_nothing_is_told_where_the_same_nodes_touch() -> None:
    case = block(1e-4, coefficient=0.0)
    values = [0.0, 1e-4]
    assert touching(case, values[0]) == touching(case, values[1])
    found = st.modes(case, values)
    assert found.notes == ()
    np.testing.assert_allclose(found.eigenvalues[1], st.modes(case, values[1]).eigenvalues[0], rtol=1e-8)


def test_a_friction_without_steady_sliding_is_told() -> None:
    # Friction at its foot turns the block, 2 cm wide and held 2 cm above: beyond μ = 1/2 nothing keeps it down.
    case = block(0.4, coefficient=0.2)
    with pytest.raises(st.AnalysisError):
        st.steady_sliding(case, 0.6)
    assert "at μ = 0.6 there is no steady sliding" in st.modes(case, [0.0, 0.6]).notes[0]


def test_where_in_a_range_there_is_no_equilibrium_is_told() -> None:
    """A falling law asks for the equilibrium at each μ; the block tips over from about 0.5 on."""
    case = block(1.0).with_(
        {
            "contacts.face.friction": {
                "law": "hyperbolic", "coefficient": 0.2, "static_coefficient": 0.6, "delta": 2.0,
            },
        }
    )  # fmt: skip
    with pytest.raises(st.AnalysisError, match=r"can move freely .*; that is at μ = \d.*, of the range") as told:
        st.onsets(case)
    named = float(str(told.value).split("μ = ")[-1].split(",")[0])
    with pytest.raises(st.AnalysisError):
        st.steady_sliding(case, named)
