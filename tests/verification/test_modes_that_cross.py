"""Undamped modes that only cross: no onset, whatever rounding makes of the place where they are one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stridor as st
from stridor.modal import receptance_onsets
from stridor.modal.histories import StabilityChange, beyond_rounding, within_rounding
from stridor.modal.onset import Onset
from stridor.modal.options import Options
from stridor.modal.over_friction import onsets_of_band
from stridor.system import System

pytestmark = pytest.mark.verification
FRICTION = {"law": "coulomb", "coefficient": 0.5}


@pytest.fixture
def crossing() -> System:
    """Two alike bodies of two freedoms with three contacts, one of them rigid: λ² of two modes are equal at μ = 13/33,
    where they cross. With 80 digits Re λ is zero there and all around it."""
    stiffness = [[5.0, 0, -1, 0], [0, 5, 0, -1], [-1, 0, 5, 0], [0, -1, 0, 5]]
    contacts = {
        "between": {"normal": [-1, 0, 1, 0], "tangent": [0, 0, 1, 0], "stiffness": 16.0, "friction": FRICTION},
        "held": {"normal": [1, 0, 0, 0], "tangent": [0, 0, 1, 0], "stiffness": "rigid", "friction": FRICTION},
        "across": {"normal": [0, -1, 0, 1], "tangent": [1, 0, 0, 0], "stiffness": 1.0, "friction": FRICTION},
    }
    return st.System.from_matrices(np.eye(4), None, stiffness, contacts=contacts)


@pytest.mark.parametrize("end", [0.45, 0.5])
def test_they_are_no_onsets_of_receptances(crossing: System, end: float) -> None:
    found = onsets_of_band(crossing, (0.0, end), 5.0)
    assert (found.source, found.onsets, found.first, found.complete) == ("receptance", (), None, True)
    assert not found.damped


def test_growth_that_ends_must_have_begun(crossing: System, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(receptance_onsets, "beyond_rounding", lambda changes, _: range(len(changes)))
    found = onsets_of_band(crossing, (0.0, 0.5), 5.0, options=Options(source="receptance"))
    assert [o.stabilising for o in found.onsets] == [True, False]
    assert "growth of a mode that did not grow is said to end at μ = 0.39393939" in found.completeness
    assert not found.complete


def onset(mu: float, *, stabilising: bool, square_root: float = 8e-5) -> Onset:
    return Onset(
        mu, 0.45, "flutter", damped=False, stabilising=stabilising, branches=(2, 3), residual=1e-16,
        square_root_coefficient=square_root, growth_slope=None,
    )  # fmt: skip


def quiet(mu: float) -> np.ndarray:
    """λ at μ: of undamped modes rounding may make them grow in between."""
    return np.array([1e-6 + 2.827j])


@pytest.mark.parametrize("ends_first", [True, False])
def test_either_may_be_the_first(ends_first: bool) -> None:
    begins, ends = (onset(0.4 + 1.5e-10 * (stops != ends_first), stabilising=stops) for stops in (False, True))
    assert within_rounding([begins, ends], quiet) == {0, 1}
    # Each was found at both branches but the last, which Newton's method found at one.
    changes = [StabilityChange(o.mu, (1, 2), o) for o in (begins, begins, ends)]
    lost = StabilityChange(0.4, (1, 2), None)
    assert beyond_rounding([*changes, lost], quiet) == [3]


def test_what_grows_by_more_stays() -> None:
    """κ√Δμ = 1e-4 1/s at 0.45 Hz is more than rounding, and so is what only begins."""
    begins, ends = onset(0.4, stabilising=False, square_root=10.0), onset(0.4 + 1e-10, stabilising=True)
    assert not within_rounding([begins, ends], quiet)
    assert not within_rounding([begins, replace(ends, branches=(2, 4))], quiet)
    assert not within_rounding([begins], quiet)
