"""Which counter-measures are found, how they are ranked, and what is said about them."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import stridor as st
from benches import paper_case
from matrix_cases import matrix_case
from mode_coupling import mode_coupling
from rubbing_block import RUBBING_MASS
from solid_cases import case, slider
from stridor.app.conclusions import of_countermeasures
from stridor.case import Case, loads, template_text
from stridor.errors import CaseError
from stridor.modal.krylov import Carried
from stridor.study.analyses import modes
from stridor.study.contact_edges import edge_rows
from stridor.study.countermeasures import Countermeasures, Measure, Verified, rank_countermeasures
from stridor.study.damping_map import DampingMap, damping_map
from stridor.study.sensitivities import number_at, sensitivities
from stridor.system import build_system
from stridor.view import sensitivity_plots
from stridor.view.sensitivity_tables import countermeasure_table, sensitivity_table


@pytest.fixture(scope="module")
def beams() -> Case:
    return paper_case(bodies__beam1__elements=6, bodies__beam2__elements=18)


@pytest.fixture(scope="module")
def ranked(beams) -> Countermeasures:
    return rank_countermeasures(beams, mu=0.3, max_frequency_hz=20e3, percent=0.5, verify=20)


def named(result: Countermeasures, name: str) -> Measure:
    return next(m for m in result.measures if m.name == name)


def test_order_is_that_of_what_a_per_cent_removes(ranked):
    removed = [m.removed_per_percent for m in ranked.measures if m.verified is None]
    assert removed == sorted(removed, reverse=True)
    solved = [m.verified.removed / m.percent for m in ranked.measures if m.verified is not None]
    assert solved == sorted(solved, reverse=True)
    assert [m.verified is not None for m in ranked.measures] == [True] * len(solved) + [False] * len(removed)
    assert min(removed + solved + [m.removed_per_percent for m in ranked.measures]) > 0
    assert {m.kind for m in ranked.measures} == {"number", "added mass"}
    # More damping always helps this bench; its material is one, so stiffness and density do the same.
    assert named(ranked, "bodies.beam1.damping.mass").direction == 1
    stiff, dense = (named(ranked, f"materials.steel.{n}") for n in ("young_modulus", "density"))
    assert (stiff.direction, dense.direction) == (-1, 1)


def test_small_changes_do_what_was_predicted(ranked):
    for measure in ranked.measures:
        if measure.kind == "number":
            assert measure.verified is not None
            assert measure.verified.removed == pytest.approx(measure.removed, rel=0.03), measure.words


def test_the_added_mass_is_at_the_best_node(beams, ranked):
    best = next(m for m in ranked.measures if m.kind == "added mass")
    assert best.mass == pytest.approx(0.005 * 7800 * 0.015 * 0.003 * 0.15)
    again = rank_countermeasures(beams, mu=0.3, max_frequency_hz=20e3, percent=0.005, verify=1, numbers=[])
    first = again.measures[0]
    assert first.position == best.position
    assert first.verified is not None
    assert first.verified.removed == pytest.approx(first.removed, rel=0.02)


def test_a_target_of_one_mode(beams):
    modes = sensitivities(beams, ["mu"], mu=0.3, max_frequency_hz=20e3)
    branch = int(modes.branch[0])
    found = rank_countermeasures(
        beams, mu=0.3, target=branch, max_frequency_hz=20e3, verify=0, added_mass=False, watch="unstable"
    )
    alone = sensitivities(beams, ["materials.steel.density"], mu=0.3, max_frequency_hz=20e3)
    density = named(found, "materials.steel.density")
    assert density.removed_per_percent == pytest.approx(abs(alone.growth_per_percent[0, 0]))
    with pytest.raises(CaseError, match=r"target: 1 – not an unstable branch, \d"):
        rank_countermeasures(beams, mu=0.3, target=1, max_frequency_hz=20e3)


def test_nothing_to_remove(beams):
    quiet = rank_countermeasures(beams, mu=0.0, max_frequency_hz=3e3)
    assert quiet.measures == ()
    assert "there is nothing to remove" in quiet.warnings[0]


def test_chamfers_are_named_ranked_and_verified():
    model = case(slider(space=False, stiffness=1e13))
    found = rank_countermeasures(model, mu=0.6, count=4, numbers=[], added_mass=False, chamfers=1, verify=2)
    assert {m.name for m in found.measures} == {"rub, leading edge, 1 row", "rub, trailing edge, 1 row"}
    first = found.measures[0]
    assert first.name == "rub, leading edge, 1 row"
    assert first.verified is not None
    assert first.verified.removed == pytest.approx(first.removed, rel=0.1)
    assert first.words == "take 5.26 % of the contact away: rub, leading edge, 1 row"


def test_a_change_at_a_few_freedoms_is_solved_on_the_basis_of_no_change_to_the_same(monkeypatch):
    model, fit, begun = case(slider(space=False, stiffness=1e13)), Carried.fit, []

    def fits(self: Carried, *given: object) -> bool:
        begun.append(fit(self, *given))
        return begun[-1]

    def ranking(**asked) -> list[Measure]:
        found = rank_countermeasures(model, mu=0.6, max_frequency_hz=60e3, percent=20.0, **asked)
        assert all(m.verified is not None for m in found.measures)
        return sorted(found.measures, key=lambda m: (m.kind, m.name))

    few = {"numbers": [], "chamfers": 1, "verify": 9}
    monkeypatch.setattr(Carried, "fit", fits)
    handed = ranking(**few)
    assert {m.kind for m in handed} == {"added mass", "chamfer"}
    assert begun.count(True) >= 3, "begun with what was handed on"
    begun.clear()
    ranking(numbers=["materials.steel.density"], chamfers=0, added_mass=False)
    assert begun
    assert not any(begun), "a density changes all of them"
    monkeypatch.setattr(Carried, "fit", lambda *_: False)
    for one, other in zip(handed, ranking(**few), strict=True):
        assert one.name == other.name
        assert one.verified.removed == pytest.approx(other.verified.removed, rel=1e-6)
        assert one.verified.removed_sum == pytest.approx(other.verified.removed_sum, rel=1e-6)
        assert one.verified.unstable_hz == pytest.approx(other.verified.unstable_hz, rel=1e-9)


def test_the_leading_edge_is_where_the_other_material_comes_in():
    """The slider's material moves to +x below the block: it enters at the block's left."""
    nodes = build_system(case(slider(space=False))).contact_nodes()
    sense = -np.sign(nodes.slip_velocity(np.ones(1)))
    every = np.arange(nodes.count)
    leading, trailing = (edge_rows(nodes, every, sense, 0, edge, 2) for edge in ("leading", "trailing"))
    assert nodes.position[leading[0].gone, 0] == pytest.approx(nodes.position[:, 0].min())
    assert nodes.position[trailing[0].gone, 0] == pytest.approx(nodes.position[:, 0].max())
    assert [len(cut.gone) for cut in leading] == [1, 2]
    # An open node out at the edge goes with the row that touches next to it.
    inner = np.flatnonzero(nodes.position[:, 0] < nodes.position[:, 0].max() - 1e-9)
    cut = edge_rows(nodes, inner, sense, 0, "trailing", 1)[0]
    assert (len(cut.released), len(cut.gone)) == (1, 2)


def test_rows_of_a_pad_on_a_turning_disc_lie_along_radii():
    model = loads(template_text("pad-on-disc")).with_(
        {
            "bodies.disc.mesh.divisions": [4, 36, 1],
            "bodies.lining.mesh.divisions": [3, 6, 1],
            "bodies.plate.mesh.divisions": [3, 6, 1],
        }
    )
    nodes = build_system(model).contact_nodes()
    slip = nodes.slip_velocity(np.ones(1))
    sense = -slip / np.linalg.norm(slip, axis=1, keepdims=True)
    angle = np.degrees(np.arctan2(nodes.position[:, 1], nodes.position[:, 0]))
    every = np.arange(nodes.count)
    leading, trailing = (edge_rows(nodes, every, sense, 0, edge, 1)[0].gone for edge in ("leading", "trailing"))
    # The disc turns from +x to +y and meets the pad at 65 degrees first.
    assert angle[leading] == pytest.approx(65.0)
    assert angle[trailing] == pytest.approx(115.0)
    assert len(leading) == 4


def test_a_per_cent_more_of_a_negative_number_is_farther_from_zero(tmp_path):
    """A mass on falling friction: a load of −1 drives it, a speed of −0.5 that becomes faster quietens it."""
    model = loads(RUBBING_MASS)
    load, speed = "loads.press.force.1", "bodies.belt.sliding.velocity.0"
    found = rank_countermeasures(model, numbers=[load, speed], percent=2.0, verify=2, added_mass=False)
    assert {m.name: m.direction for m in found.measures} == {load: -1, speed: 1}
    assert named(found, load).words == "move loads.press.force.1 from -1 to -0.98, 2 % less"
    assert named(found, speed).words == "move bodies.belt.sliding.velocity.0 from -0.5 to -0.51, 2 % more"
    before = modes(model).growth_rate[0].max()
    for measure in found.measures:
        assert measure.verified is not None
        assert measure.verified.removed == pytest.approx(measure.removed, rel=0.01)
        again = modes(model.with_({measure.name: measure.changed})).growth_rate[0].max()
        assert measure.verified.removed == pytest.approx(before - again, rel=1e-9)
    slopes = sensitivities(model, [load, speed])
    for k, (path, more) in enumerate(((load, -1.001), (speed, -0.5005))):
        grown = modes(model.with_({path: more})).growth_rate[0].max() - before
        assert slopes.growth_per_percent[k, 0] == pytest.approx(10 * grown, rel=2e-3)
    back = st.open(st.save(found, tmp_path / "changes.nc"))
    assert [m.words for m in back.measures] == [m.words for m in found.measures]
    option = of_countermeasures(found, partial(number_at, model), None).options[-1]
    assert option == f"{found.helpful[0].name}={found.helpful[0].changed:.6g}"


def test_what_was_solved_again_is_ranked_by_that_and_what_did_harm_is_told(monkeypatch):
    from stridor.study import countermeasures as module

    solve, took = module.verified, {"springs.k.stiffness": 0.5, "bodies.m.mass": -0.25, "loads.press.force.1": 0.75}

    def as_said(ranking, measure, *rest):
        found = solve(ranking, measure, *rest)
        return replace(found, verified=replace(found.verified, removed=took[measure.name]))

    monkeypatch.setattr(module, "verified", as_said)
    found = rank_countermeasures(loads(RUBBING_MASS), numbers=list(took), verify=3, added_mass=False)
    assert [m.name for m in found.measures] == ["loads.press.force.1", "springs.k.stiffness"]
    assert found.helpful == found.measures
    (told,) = [line for line in found.warnings if "slopes promise" in line]
    assert told.startswith("1 change that the slopes promise does not take growth away when solved again")
    assert told.endswith("raise bodies.m.mass by 5 % (-0.25 1/s)")


def test_the_next_command_sets_what_the_case_has():
    model = loads(RUBBING_MASS)
    for path, option in (("contacts.rub.compliance", "contacts.rub.stiffness=0.952381"), ("mu", "0.608")):
        found = rank_countermeasures(model, numbers=[path], verify=1, added_mass=False)
        assert of_countermeasures(found, partial(number_at, model), None).options[-1] == option


def test_less_friction_is_solved_again_with_less_friction(beams, tmp_path):
    """Of all contacts, of the one there is by its path, of one of two, and in factors of matrices."""

    def removed(case: Case, path: str, mu: float | None, **asked) -> float:
        found = rank_countermeasures(case, mu=mu, numbers=[path], added_mass=False, chamfers=0, percent=10.0, **asked)
        ((measure,), warnings) = found.measures, found.warnings
        assert not any("left out" in w for w in warnings)
        assert measure.verified is not None
        return measure.verified.removed_sum

    def growth(case: Case, mu: float | None, **asked) -> float:
        found = modes(case, mu, **asked)
        return float(found.growth_rate[0][found.unstable[0] & found.in_band[0]].sum())

    band = {"max_frequency_hz": 20e3}
    less = growth(beams, 0.3, **band) - growth(beams, 0.27, **band)
    assert less > 100.0
    for path in ("mu", "contacts.A.friction.coefficient"):
        assert removed(beams, path, 0.3, **band) == pytest.approx(less, rel=1e-8)
    other = {"type": "mass", "mass": 2.0, "position": (1, 0)}
    rests = {"between": ("n", "m"), "direction": (1.0, 0.5), "stiffness": 0.1}
    rub = mode_coupling().contacts["rub"].model_copy(update={"slave": "n"}).model_dump(exclude_unset=True)
    single = mode_coupling()
    two = single.with_(
        {"bodies.n": other, "springs.x": rests, "contacts.b": rub, "loads.on_n": {"at": "n", "force": (0, -1)}}
    )
    lower = two.with_({"contacts.rub.friction.coefficient": 0.81})
    less = growth(two, None) - growth(lower, None)
    assert removed(two, "contacts.rub.friction.coefficient", None) == pytest.approx(less, rel=1e-8)
    one, skew = np.eye(2), np.array([[0.0, 1.0], [-1.0, 0.0]])
    terms = [(one, "mass", ""), (0.1 * one, "damping", ""), (4.0 * one, "stiffness", ""), (skew, "stiffness", "mu")]
    matrices = matrix_case(tmp_path, terms, 1.0)
    assert removed(matrices, "mu", 0.5) == pytest.approx(growth(matrices, 0.5) - growth(matrices, 0.45), rel=1e-8)


def test_changes_of_rounding_only_help_nothing(monkeypatch):
    """A second mass that is connected to nothing that grows."""
    other = """
bodies.far = { type = "mass", mass = 1.0, position = [3.0, 0.0] }
springs.x = { between = ["far", "ground"], direction = [1.0, 0.0], stiffness = 3.0 }
springs.y = { between = ["far", "ground"], direction = [0.0, 1.0], stiffness = 5.0 }
"""
    paths = ["springs.x.stiffness", "springs.y.stiffness", "springs.k.stiffness"]
    found = rank_countermeasures(loads(RUBBING_MASS + other), numbers=paths, verify=9)
    assert {m.name for m in found.measures} == {"springs.k.stiffness", "m"}
    assert "3 changes tried: no effect on the growth beyond rounding" in found.warnings  # the mass added to it, too


def test_documents_tables_and_figures(beams, ranked):
    assert json.loads(json.dumps(ranked.to_json()))["measures"][0]["verified"]["unstable_hz"]
    table = countermeasure_table(ranked)
    assert len(table.rows) == len(ranked.measures)
    assert table.rows[0].cells[0] == ranked.measures[0].words
    found = sensitivities(beams, ["mu", "materials.steel.density"], mu=0.3, max_frequency_hz=20e3)
    assert len(sensitivity_table(found).rows) == 2 * len(found.branch)
    for figure in (sensitivity_plots.sensitivity_bars(found), sensitivity_plots.countermeasure_bars(ranked)):
        assert figure.axes[0].patches


@pytest.mark.parametrize("removed", [5.0, -5.0])
def test_a_change_that_did_harm_when_solved_again_is_crossed(ranked, removed: float) -> None:
    solved = Verified(10.0, 3e3, removed, removed, (3e3,))
    measures = (replace(ranked.measures[0], verified=solved), *(replace(m, verified=None) for m in ranked.measures[1:]))
    axes = sensitivity_plots.countermeasure_bars(replace(ranked, measures=measures)).axes[0]
    words = [text.get_text() for text in axes.get_legend().get_texts()]
    assert ("solved again" in words) == (removed > 0)
    assert ("made it worse" in words) == (removed < 0)
    (mark,) = [line for line in axes.lines if line.get_marker() in ("D", "X")]
    assert mark.get_marker() == ("D" if removed > 0 else "X")
    if removed > 0:
        low, high = axes.get_xlim()
        assert low < mark.get_xdata()[0] < high


def test_the_figure_of_a_map_hatches_where_damping_harms():
    values = np.array([0.0, 1.0, 2.0])
    mu = 0.3 + 0.1 * np.abs(values[:, None] - values[None, :])
    slope = np.sign(values[:, None] - values[None, :] + 0.0)
    result = DampingMap(
        "a", "b", values, values, (0.0, 1.0), 1e3, mu, 0 * mu, slope, -slope, 0 * mu, 0.35
    )
    figure = sensitivity_plots.damping_map(result)
    words = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert words == ["undamped onset, 0.35", "more a lowers it", "more b lowers it"]
    nothing = DampingMap("a", "b", values, values, (0.0, 1.0), 1e3, *np.full((5, 3, 3), np.nan), None)
    assert sensitivity_plots.damping_map(nothing).axes


def test_a_map_refuses_what_it_cannot_draw(beams):
    with pytest.raises(CaseError, match="two ends or more values, rising"):
        damping_map(beams, "bodies.beam1.damping.mass", "bodies.beam2.damping.mass", x_range=(1, 0), y_range=(0, 1))
    with pytest.raises(CaseError, match="did you mean 'mass'"):
        damping_map(beams, "bodies.beam1.damping.mess", "bodies.beam2.damping.mass", x_range=(0, 1), y_range=(0, 1))
