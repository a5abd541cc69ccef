"""Damping beyond critical: the eigenvalues at a μ do not depend on whether branches can be followed."""

from __future__ import annotations

import json

import numpy as np
import pytest

import stridor as st
from benches import paper_case
from stridor.errors import FollowingError
from stridor.modal import over_friction
from stridor.modal import source as following
from stridor.modal.krylov.problem import problem_of
from stridor.modal.options import Options
from stridor.modal.quadratic import find
from stridor.modal.quadratic.dense import all_modes
from stridor.modal.quadratic.region import Region
from stridor.modal.tracking import Tracker
from stridor.system import build_system

pytestmark = pytest.mark.verification


def bench(damping: float, elements: tuple[int, int] = (6, 9)) -> st.Case:
    """The two-beam bench, damped in proportion to its stiffness [s]."""
    return paper_case().with_(
        {
            "bodies.beam1.damping.stiffness": damping,
            "bodies.beam2.damping.stiffness": damping,
            "bodies.beam1.elements": elements[0],
            "bodies.beam2.elements": elements[1],
        }
    )


def dense(case: st.Case, mu: float) -> np.ndarray:
    """All eigenvalues (k,) with Im λ ≥ 0 up to the band's end, by QZ."""
    problem = problem_of(build_system(case), mu, Options())
    values = all_modes(problem.pencil(mu).condensed())[0]
    return values[(values.imag >= 0) & (values.imag <= 2 * np.pi * case.modal.max_frequency_hz)]


def growing(values: np.ndarray) -> np.ndarray:
    return np.sort_complex(values[values.real > 1e-9 * np.abs(values)])


def lost(self: Tracker, mu: float) -> None:
    raise FollowingError("branches cannot be told apart")


@pytest.mark.parametrize("damping", [1e-6, 1e-5, 1e-4])
def test_modes_without_branches(damping: float, monkeypatch: pytest.MonkeyPatch) -> None:
    case = bench(damping)
    monkeypatch.setattr(Tracker, "advance", lost)
    found = st.modes(case, [0.3, 0.9], max_frequency_hz=case.modal.max_frequency_hz)
    for row, mu in enumerate(found.mu):
        here = found.eigenvalues[row][found.unstable[row]]
        np.testing.assert_allclose(np.sort_complex(here), growing(dense(case, float(mu))), rtol=1e-8)
        assert "branches were not followed: branches cannot be told apart" in found.completeness[row]


UNDAMPED = {"bodies.beam1.damping.stiffness": 0.0}


@pytest.mark.parametrize("case", [bench(5e-7), pytest.param(bench(2e-6, (10, 30)).with_(UNDAMPED), marks=pytest.mark.slow)])
def test_modes_far_above_the_band_are_not_of_it_where_they_are_overdamped(case: st.Case) -> None:
    """Half of the poles that no contact sees have no frequency; their rates are hundreds of thousands a second."""
    true = dense(case, 0.3)
    true = true[np.abs(true) <= 2 * np.pi * case.modal.max_frequency_hz]
    assert np.all(true.imag > 0)
    found = {source: st.modes(case.with_({"modal.source": source}), 0.3) for source in ("receptance", "krylov")}
    for modes in found.values():
        assert modes.total[0] == len(true) < case.modal.modes
        values = modes.eigenvalues[0][modes.in_band[0]]
        np.testing.assert_allclose(values[np.argsort(values.imag)], true[np.argsort(true.imag)], rtol=1e-7)
    assert found["receptance"].branch.tolist() == found["krylov"].branch.tolist()
    at_receptance, at_krylov = (st.onsets(case.with_({"modal.source": s}), (0.0, 0.6)) for s in found)
    assert [o.branches for o in at_receptance.onsets] == [o.branches for o in at_krylov.onsets]


def test_vibrations_are_listed_before_what_only_decays() -> None:
    case = bench(1e-5).with_({"modal.modes": 3})
    listed, every = st.modes(case, 0.3), st.modes(case, 0.3, max_frequency_hz=case.modal.max_frequency_hz)
    true = dense(case, 0.3)
    true = true[np.abs(true) <= 2 * np.pi * case.modal.max_frequency_hz]
    assert every.total.tolist() == listed.total.tolist() == [len(true)]  # of conjugates one
    assert (true.imag == 0).sum() > 3  # without a frequency: below all others
    lowest = every.branch[every.eigenvalues[0].imag > 0][:3]
    assert listed.branch.tolist() == lowest.tolist()


def test_beyond_what_is_affordable_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Tracker, "advance", lost)
    monkeypatch.setattr(following, "WHOLE", 10)
    with pytest.raises(FollowingError, match="told apart"):
        st.modes(bench(1e-6), 0.9, max_frequency_hz=20e3)


def test_small_problems_that_discs_do_not_get_through_are_solved_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    case = bench(1e-5, (10, 20))
    whole = problem_of(build_system(case), 0.9, Options()).pencil(0.9).condensed()
    region = Region.band(0.0, case.modal.max_frequency_hz, above=-1.2e5)
    discs = monkeypatch.context
    with discs() as alone:
        alone.setattr(find, "WHOLE", 0)
        by_discs = find.find_modes(whole, Region.band(0.0, case.modal.max_frequency_hz, above=-9e4))
    monkeypatch.setattr(find, "FEW_SHIFTS", 0)
    by_qz = find.find_modes(whole, region)
    assert by_qz.completeness.sentence.startswith("Complete: QZ")
    assert by_discs.completeness.complete
    light = by_discs.values[by_discs.values.real > -9e4]
    near = np.abs(light[:, None] - by_qz.values).min(axis=1)
    assert np.all(near <= 1e-7 * np.abs(light))
    assert by_qz.residual.max() <= find.CROWDED


@pytest.mark.parametrize(("first", "second", "number"), [(1e-5, 1e-5, 0), (1e-5, 1e-7, 5), pytest.param(1e-4, 1e-7, 6, marks=pytest.mark.slow)])
def test_onsets_without_branches(first: float, second: float, number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """As many modes grow at every μ of a grid as the onsets say."""
    case = bench(first, (6, 12)).with_({"bodies.beam2.damping.stiffness": second})
    monkeypatch.setattr(Tracker, "advance", lost)
    monkeypatch.setattr(over_friction, "SMALL", 0)  # smaller ones are followed in the full problem first
    found = st.onsets(case)
    assert found.complete
    assert "sought along the imaginary axis" in found.completeness
    assert "not followed: branches cannot be told apart." in found.completeness
    assert len(found.onsets) == number
    assert all(o.residual < 1e-12 and o.branches == (0, 0) for o in found.onsets)
    for mu in np.linspace(0.0, 1.0, 12)[1:]:
        said = sum(-1 if o.stabilising else 1 for o in found.onsets if o.mu < mu)
        assert len(growing(dense(case, float(mu)))) == said
    json.dumps(found.to_json())
