"""Ranges of friction that steady sliding does not last to the end of, and cases that jam at their own friction."""

from __future__ import annotations

import numpy as np
import pytest

import stridor as st
from stridor.errors import AnalysisError
from stridor.modal.krylov import krylov_onsets
from stridor.modal.krylov.steady import Steadiness
from stridor.system import build_system

pytestmark = pytest.mark.verification

# A slanted spring at 135°, its level and upright neighbours and the contact: det K(μ) = k₁₁ (k₂₂ + c) − k₁₂² + μ c k₁₂.
JAM = (1.0 * (1.0 + 1.0) - 0.9**2) / (1.0 * 0.9)


def spring(body: str, degrees: float, stiffness: float, **others: float) -> dict[str, object]:
    angle = np.radians(degrees)
    direction = (float(np.cos(angle)), float(np.sin(angle)))
    return {"between": (body, "ground"), "direction": direction, "stiffness": stiffness, **others}


def two_masses(coefficient: float, *, jams: bool = True, damping: float = 0.0) -> st.Case:
    """The minimal model of mode coupling, undamped onset at μ = 3/4, beside a mass on a cubic spring, for which
    equilibria are solved at every μ, and one that jams at μ = JAM."""
    root = 3**0.5
    friction = {"law": "coulomb", "coefficient": coefficient}
    bodies: dict[str, object] = {
        "m": {"type": "mass", "mass": 1.0, "position": (0, 0)},
        "q": {"type": "mass", "mass": 1.0, "position": (5, 0)},
        "belt": {
            "type": "obstacle", "shape": "flat", "point": (0, 0), "normal": (0, 1), "sliding": {"velocity": (-1, 0)},
        },
    }  # fmt: skip
    springs = {
        "k1": spring("m", 150, 2 / 3 * (2 - root), damping=damping),
        "k2": spring("m", 30, 2 / 3 * (2 + root), damping=damping),
        "a": spring("q", 0, 1.3, cubic=1.0), "b": spring("q", 90, 3.1),
    }  # fmt: skip
    loads: dict[str, object] = {
        "press": {"at": "m", "force": (0, -1)}, "pull": {"at": "q", "force": (0.3, 0)},
    }  # fmt: skip
    contacts: dict[str, object] = {"rub": {"slave": "m", "master": "belt", "stiffness": 4 / 3, "friction": friction}}
    if jams:
        bodies["j"] = {"type": "mass", "mass": 1.0, "position": (9, 0)}
        springs |= {"s": spring("j", 135, 1.8), "l": spring("j", 0, 0.1), "u": spring("j", 90, 0.1)}
        loads["push"] = {"at": "j", "force": (0, -1)}
        contacts["jam"] = {"slave": "j", "master": "belt", "stiffness": 1.0, "friction": friction}
    return st.Case(
        units="nondimensional", bodies=bodies, springs=springs, loads=loads, contacts=contacts,
        modal={"max_frequency_hz": 1.0, "friction_range": [0.0, 2.0], "source": "krylov"},
    )  # fmt: skip


def test_onsets_below_the_friction_at_which_something_jams() -> None:
    found = st.onsets(two_masses(0.3))
    assert [o.mu for o in found.onsets] == pytest.approx([0.75], rel=1e-9)
    low, high = found.friction_range
    assert low == 0.0
    assert JAM - 2e-3 < high < JAM
    # What is said of them is said of the range up to there, and that nothing was solved beyond beside it.
    assert "NOT COMPLETE" not in found.completeness
    assert any("nothing was solved" in note and "that is at μ = 1.32" in note for note in found.notes)


@pytest.mark.parametrize("coefficient", [pytest.param(0.3, marks=pytest.mark.slow), 1.5])
def test_what_is_asked_for_does_not_depend_on_a_case_that_jams_at_its_own_friction(coefficient: float) -> None:
    case = two_masses(coefficient)
    found = st.onsets(case, (0.6, 0.9))
    assert [o.mu for o in found.onsets] == pytest.approx([0.75], rel=1e-9)
    assert found.complete
    modes = st.modes(case, [0.5, 0.8])
    assert modes.unstable.sum(axis=1).tolist() == [0, 1]


def test_a_reduced_model_holds_the_nodes_of_its_own_range() -> None:
    linear = {"springs.a.cubic": 0.0}
    usual, jammed = (
        st.reduced_model(two_masses(mu).with_(linear), {"mu": (0.0, 1.0)}, max_frequency_hz=1.0) for mu in (0.3, 1.5)
    )
    told = [str(getattr(model.problem, "notes", ())) for model in (usual, jammed)]
    assert "are held at every μ" not in told[0]
    assert "touch at μ = 0.5 are held at every μ" in told[1]
    values = [np.sort_complex(model.modes({"mu": 0.8}).values) for model in (usual, jammed)]
    np.testing.assert_allclose(values[0], values[1], rtol=1e-8, atol=1e-8)


def test_no_steady_sliding_is_told_with_the_friction() -> None:
    case = two_masses(1.5)
    with pytest.raises(AnalysisError, match=r"that is at μ = 1\.4"):
        st.onsets(case, (1.4, 1.6))
    with pytest.raises(AnalysisError, match=r"that is at μ = 1\.7"):
        st.modes(case, 1.7)


def test_an_onset_needs_nothing_beyond_the_range(monkeypatch: pytest.MonkeyPatch) -> None:
    """The exceptional point beside it is sought where no steady sliding need be: it is left out then."""
    system = build_system(two_masses(0.3, jams=False, damping=0.02))
    (known,) = krylov_onsets(system, (0.0, 1.0), max_frequency_hz=1.0).onsets
    assert known.exceptional_mu is not None
    end = known.mu * (1 + 2e-5)
    steady = Steadiness._steady  # pyright: ignore[reportPrivateUsage]

    def jams(self: Steadiness, mu: float):
        if mu > end:
            raise AnalysisError("steady sliding: it jams")
        return steady(self, mu)

    monkeypatch.setattr(Steadiness, "_steady", jams)
    (found,) = krylov_onsets(system, (0.0, end), max_frequency_hz=1.0).onsets
    assert found.exceptional_mu is None
    assert found.mu == pytest.approx(known.mu, rel=1e-9)
    assert found.growth_slope == pytest.approx(known.growth_slope, rel=1e-4)


def test_a_map_of_dampings_below_the_case_s_own_friction() -> None:
    # The upper spring of the mass that flutters, and the other's, are damped.
    linear = {"springs.a.cubic": 0.0}
    usual, jammed = (
        st.damping_map(
            two_masses(mu).with_(linear), "springs.k1.damping", "springs.k2.damping", x_range=(0.01, 0.05),
            y_range=(0.01, 0.05), grid=(2, 2), mu_range=(0.6, 0.9), method="full",
        )
        for mu in (0.3, 1.5)
    )  # fmt: skip
    assert np.all(np.isfinite(usual.onset_mu))
    np.testing.assert_allclose(jammed.onset_mu, usual.onset_mu, rtol=1e-9)
    np.testing.assert_allclose(jammed.slope_x, usual.slope_x, rtol=1e-6)
