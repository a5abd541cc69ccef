"""One start of small perturbations for all systems, and what serves every system since nobody asks for its kind."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import stridor as st
from benches import paper_case
from rubbing_block import rubbing_block
from solid_cases import BELT
from stridor.agreement import perturbation
from stridor.agreement.perturbation import perturb
from stridor.modal.options import Options
from stridor.study.settings import settings_of
from stridor.study.without_effect import without_effect


def nodes_of(owner: list[int], tangent: np.ndarray | None = None) -> Any:
    names = tuple(f"c{k}" for k in range(max(owner) + 1))
    return SimpleNamespace(count=len(owner), names=names, owner=np.array(owner), tangent=tangent)


def modes_of(frequency: np.ndarray, growth: np.ndarray) -> Any:
    return SimpleNamespace(frequency_hz=frequency[None], growth_rate=growth[None])


def test_points_start_with_the_whole_band_and_many_nodes_with_the_fastest_three() -> None:
    frequency = np.array([0.0, 100.0, 400.0, 300.0, 200.0, 600.0])
    modes = modes_of(frequency, np.array([9.0, -5.0, 2.0, 1.0, 3.0, 8.0]))
    chosen, length = perturbation._started(nodes_of([0, 1]), modes, 500.0)
    assert chosen.tolist() == [1, 2, 3, 4]  # neither what does not vibrate nor what lies beyond
    assert length == pytest.approx(1200 / 500.0)
    chosen, length = perturbation._started(nodes_of([0, 0, 1]), modes, 500.0)
    assert chosen.tolist() == [4, 2, 3]
    assert length == pytest.approx(40 / 200.0)
    for count in (40, 41):  # two poles each: more than 80 are not told apart
        many = modes_of(np.arange(1.0, count + 1.0), np.arange(float(count)))
        assert len(perturbation._started(nodes_of([0]), many, 500.0)[0]) == (40 if count == 40 else 3)


def test_one_node_of_each_contact_is_listened_to_of_those_that_slide() -> None:
    speed, moved = np.array([1.0, 0.6, 0.4, 0.0, 0.3, 0.0]), np.array([0.1, 0.5, 0.9, 2.0, 0.2, 1.0])
    assert perturbation._leaders(nodes_of([0, 0, 0, 0, 1, 2]), speed, moved).tolist() == [1, 4]


def test_modes_start_in_equal_measure_of_their_largest_slip() -> None:
    tangent = np.array([[1.0, 0, 0], [0, 2, 0]])
    lam, vectors = np.array([10j, -1 + 20j, 30j]), np.array([[3.0, 0, 0], [0, 5j, 0], [1e-9, 0, 1]], dtype=complex)
    start, moved = perturbation._in_equal_measure(nodes_of([0, 1], sp.csr_array(tangent)), lam, vectors)
    # The third hardly slips and is left out.
    assert moved == pytest.approx([1.0, 1.0])
    turned = np.exp(2.399963j)
    first, second = 1 / 10, 5j / abs(lam[1] * 10) * turned
    for order, row in enumerate(start):
        assert row == pytest.approx([(lam[0] ** order * first).real, (lam[1] ** order * second).real, 0.0])


def test_perturbations_stay_in_the_reference_configuration_over_surfaces_too() -> None:
    case = st.loads(rubbing_block("max_frequency_hz = 3e4"))
    small, finite = (st.build_system(case.with_({"contacts.face.sliding": way})) for way in ("small", "finite"))
    assert finite.finitely_sliding == ("face",)
    assert small.in_reference() is small
    modes, settings = perturbation.modes_as_in_time(small, 0.3, 3e4), settings_of(case)
    one, two = (
        perturb(s, 0.3, settings=settings, max_frequency_hz=3e4, duration=3e-4, modes=modes) for s in (small, finite)
    )
    assert len(one.signal) > 64
    assert np.array_equal(one.signal, two.signal)
    assert np.any(one.signal)


def test_bodies_move_at_the_start_of_runs_from_rest_alone() -> None:
    case = st.loads(BELT).with_({"bodies.m.initial_velocity": [0.1, 0.0]})
    lines = without_effect(case.with_({"temporal.initial": "steady-sliding"}), "simulate")
    assert [line for line in lines if line.startswith("bodies.m.initial_velocity has no effect")]
    assert without_effect(case, "simulate") == []


def test_each_beam_has_its_own_modes_where_a_spring_joins_it_to_another() -> None:
    case = paper_case()
    joined = case.with_({"springs": {"weak": {"between": ["beam1.tip", "beam2.start"], "stiffness": 1e-3}}})
    alone, both = st.body_modes(case), st.body_modes(joined)
    for name in ("beam1", "beam2"):
        assert both[name].labels == alone[name].labels
        assert both[name].frequency_hz == pytest.approx(alone[name].frequency_hz, rel=1e-6, abs=1e-3)
        assert len(alone[name].labels) > 5


def test_check_tells_steady_sliding_of_points_with_the_residual_of_its_equilibrium() -> None:
    case = paper_case()
    description = st.describe(case)
    (line,) = [x for x in description.lines if x.startswith("  contact A")]
    assert "small sliding, normal force" in line
    assert line.endswith("slip speed 0.02 m/s in steady sliding")
    assert any(x.startswith("  equilibrium of every freedom to ") for x in description.lines)
    told = description.data["contacts"]["A"]
    assert (told["nodes"], told["touching_nodes"], told["touches"]) == (1, 1, True)
    assert abs(told["force"][1]) == pytest.approx(told["normal_force"])
    still = st.describe(case.with_({"supports.clamp.velocity.x": 0.0}))
    assert any(x.startswith("  no steady sliding: ") for x in still.lines)


def test_the_modes_compared_come_from_the_source_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Solver and source of the case act on a comparison's modes; what only modes know (prestress) does not."""
    asked: list[Options] = []

    def recorded(*_: Any, options: Options, **__: Any) -> None:
        asked.append(options)
        raise st.AnalysisError("seen")

    monkeypatch.setattr(perturbation, "modes_of_band", recorded)
    case = paper_case(modal__source="krylov", modal__solver="superlu", modal__prestress=True)
    for critical in (False, None):
        with pytest.raises(st.AnalysisError, match="seen"):
            st.compare(case, [0.2], only=["growth"], critical=critical)
    assert asked == [Options(solver="superlu", source="krylov")] * 2
