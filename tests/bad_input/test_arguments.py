"""Arguments of Python calls that are none: refused by name, with what would be accepted."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import stridor as st
from benches import paper_case
from mode_coupling import mode_coupling
from stridor.case import loads, template_text
from stridor.errors import CaseError

pytestmark = pytest.mark.bad_input
CASE = mode_coupling(0.02, 0.1)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: st.onsets(CASE, (0, 1, 2)), "friction_range: [0, 1, 2] – two finite numbers 0 ≤ low < high"),
        (lambda: st.onsets(CASE, (0.0, float("inf"))), "friction_range: [0.0, inf] – two finite numbers 0 ≤ low < high"),
        (lambda: st.onsets(CASE, (-0.1, 1.0)), "friction_range: [-0.1, 1.0] – two finite numbers 0 ≤ low < high"),
        (lambda: st.onsets(CASE, (0.0, "a")), "friction_range: [0.0, 'a'] – two finite numbers 0 ≤ low < high"),  # type: ignore[arg-type]
        (
            lambda: st.onsets(CASE, (0, 1, 2), along="bodies.m.mass"),  # type: ignore[call-overload]
            "range of bodies.m.mass: [0, 1, 2] – two finite numbers low < high",
        ),
        (lambda: st.ensemble(paper_case(), cores=-1), "cores: -1 – a whole number ≥ 1, or None for all"),
        (lambda: st.ensemble(paper_case(), cores=0), "cores: 0 – a whole number ≥ 1, or None for all"),
        (lambda: st.modes(CASE, 0.5, count=0), "count: 0 – a whole number ≥ 1"),
        (lambda: st.modes(CASE, 0.5, count=-2), "count: -2 – a whole number ≥ 1"),
        (lambda: st.cycles(CASE, 1.0, push=0.0), "push: 0.0 – finite speeds above or below 0 [m/s], up to 1e+100"),
        (
            lambda: st.cycles(CASE, 1.0, push=[0.1, 0.0]),
            "push: [0.1, 0.0] – finite speeds above or below 0 [m/s], up to 1e+100",
        ),
        (lambda: st.rank_countermeasures(CASE, mu=1.2, verify=-1), "verify: -1 – a whole number ≥ 0"),
        (lambda: st.rank_countermeasures(CASE, mu=1.2, chamfers=-1), "chamfers: -1 – a whole number ≥ 0"),
        (
            lambda: st.rank_countermeasures(CASE, mu=1.2, target="foo"),  # type: ignore[arg-type]
            "target: 'foo' – the number of an unstable branch, or \"sum\" of all of them",
        ),
        (
            lambda: st.rank_countermeasures(CASE, mu=0.1, target="foo"),  # type: ignore[arg-type]
            "target: 'foo' – the number of an unstable branch, or \"sum\" of all of them",
        ),
        (lambda: st.rank_countermeasures(CASE, mu=1.2, watch="foo"), "watch: 'foo' – one of all, unstable"),  # type: ignore[arg-type]
        (lambda: st.rank_countermeasures(CASE, mu=1.2, numbers=[1]), "numbers: [1] – a name, or a list of names"),  # type: ignore[list-item]
        (lambda: st.modes(CASE, 0.5, vectors="left"), "vectors: 'left' – one of False, True, right"),  # type: ignore[arg-type]
        (
            lambda: st.ensemble(CASE, mu=0.5, initial="resting"),  # type: ignore[arg-type]
            "initial: 'resting' – one of rest, steady-sliding, None",
        ),
        (
            lambda: st.sensitivities(CASE, "mu", mu=1.2, modes=1),  # type: ignore[arg-type]
            "modes: 1 – \"unstable\", \"all\" or a list of numbers of branches from 1 to 2",
        ),
        (lambda: st.sensitivities(CASE, 3.5, mu=1.2), "parameters: 3.5 – a name, or a list of names"),  # type: ignore[arg-type]
        (
            lambda: st.onsets(CASE, along=3.5),  # type: ignore[call-overload]
            "along: 3.5 – the path of a number of the case, or a parameter of its matrices",
        ),
        (lambda: st.compare(CASE, [0.5], only="foo"), "only: 'foo' – of what is compared: growth, run, critical"),
        (lambda: st.compare(CASE, [0.5], only=3.5), "only: 3.5 – a name, or a list of names"),  # type: ignore[arg-type]
        (lambda: st.compare(CASE, [0.5], only=[]), "only: [] – a name, or a list of names"),
        (lambda: st.sensitivities(CASE, [], mu=1.2), "parameters: [] – a name, or a list of names"),
        (lambda: st.sensitivities(CASE, "mu", mu=1.2, modes=[]), "modes: [] – numbers of branches from 1 to 2"),
        (
            lambda: st.rank_countermeasures(CASE, mu=1.2, margin=float("nan")),
            "margin: nan – a damping ratio, at least 0 and below 1",
        ),
        (lambda: st.rank_countermeasures(CASE, mu=1.2, margin=-1.0), "margin: -1.0 – a damping ratio, at least 0 and below 1"),
        (lambda: st.build_system(CASE, mu="abc"), "mu: 'abc' – a number, or None"),  # type: ignore[arg-type]
        (lambda: st.run(CASE, "never", only=3.5), "only: 3.5 – a name, or a list of names"),  # type: ignore[arg-type]
    ],
)
def test_what_is_none_is_refused_by_its_name(call: Callable[[], Any], said: str) -> None:
    with pytest.raises(st.CaseError) as raised:
        call()
    assert str(raised.value) == said


@pytest.mark.parametrize(
    "draw", [st.plot.root_locus, st.plot.frequency_branches, st.plot.growth_branches, st.plot.damping_branches]
)
def test_figures_of_modes_take_nothing_else(draw: Callable[..., Any]) -> None:
    with pytest.raises(st.CaseError, match=r"^modes: 'an Onsets' – complex modes, of st\.modes\(case, mu\)$"):
        draw(st.onsets(CASE, (0.0, 1.0)))


def test_one_name_may_stand_without_a_list() -> None:
    many = st.sensitivities(CASE, ["mu"], mu=1.2)
    assert st.sensitivities(CASE, "mu", mu=1.2).to_json() == many.to_json()
    with pytest.raises(st.CaseError, match=r"^nu: "):
        st.sensitivities(CASE, "nu", mu=1.2)
    found = st.rank_countermeasures(CASE, mu=1.2, numbers="springs.k1.stiffness", added_mass=False, verify=0)
    assert {m.name for m in found.measures} <= {"springs.k1.stiffness"}


def test_friction_coefficients_that_can_be_gone_through_once() -> None:
    found = st.modes(CASE, (mu for mu in (0.2, 0.4)))
    assert found.mu.tolist() == [0.2, 0.4]
    with pytest.raises(CaseError, match=r"^mu: -1.0 "):
        st.modes(CASE, iter([0.2, -1.0]))
    with pytest.raises(CaseError, match=r"^mu: \[\] – at least one"):
        st.modes(CASE, iter([]))


@pytest.mark.parametrize("verb", [st.modes, st.simulate, st.compare, st.cycles, st.steady_sliding])
@pytest.mark.parametrize("value", ["", "0.5", {}, True, float])
def test_friction_coefficients_of_another_kind(verb: Any, value: Any) -> None:
    with pytest.raises(CaseError, match=r"^mu: .* – a friction coefficient is a finite number ≥ 0$"):
        verb(CASE, value)


@pytest.mark.parametrize("band", ["", {}, "abc", (1.0,), ("1", "2"), 3.0])
def test_bands_of_another_kind(band: Any) -> None:
    with pytest.raises(CaseError, match=r"^band_hz: .* – low:high in Hz"):
        st.modes(CASE, 0.1, band_hz=band)


def test_a_restart_takes_a_run_and_no_path() -> None:
    with pytest.raises(CaseError, match=r"^restart: 'run.nc' – a run, of st.simulate or st.open\(path\)$"):
        st.simulate(CASE, restart="run.nc")
    with pytest.raises(CaseError, match=r"^max_frequency_hz: '' – a highest frequency is a finite number > 0"):
        st.modes(CASE, 0.1, max_frequency_hz="")


def test_a_ramp_from_steady_sliding_is_refused_before_anything_is_computed() -> None:
    with pytest.raises(CaseError, match=r"^phases\.0\.ramp: 1e-05 – must be 0 when starting from steady sliding"):
        loads(template_text("two-beams"), ['temporal.initial="steady-sliding"', "phases.0.ramp=1e-5"])


RUN = st.simulate(CASE.with_({"phases": [{"name": "a", "duration": 1.0}]}))


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: st.load("case.toml", None), "overrides: missing – a list of texts path=value"),
        (lambda: st.loads(None), "text: missing – a text"),
        (lambda: CASE.with_("abc"), "changes: 'abc' – a table of values by their paths"),
        (lambda: CASE.with_({1: 2}), "override: 1 – write an override as path=value"),
        (lambda: st.perturbed_copies(CASE, RUN, count=None), "count: missing – a whole number"),
        (lambda: st.perturbed_copies(CASE, None), "run: missing – a run, of st.simulate or st.open(path)"),
        (lambda: st.perturbed_copies(CASE, RUN, [0.1]), "mu: [0.1] – a friction coefficient is a finite number ≥ 0"),
        (lambda: st.perturbed_copies(CASE, RUN, seed=-1), "seed: -1 – a whole number ≥ 0"),
        (lambda: st.sound(None), "run: missing – a run, of st.simulate or st.open(path)"),
        (lambda: st.sound(RUN, slow="abc"), "slow: 'abc' – a number"),
        (lambda: st.summarise(CASE, []), "run: [] – a run, of st.simulate or st.open(path)"),
        (lambda: st.open(None), "path: missing – a path"),
        (lambda: st.open_study(-1), "path: -1 – a path"),
        (lambda: st.save(RUN, []), "path: [] – a path"),
        (lambda: st.export(CASE, None), "folder: missing – a path"),
        (lambda: st.run_study(None), "study: 'a NoneType' – a study, or the path of its file"),
        (lambda: st.study_figures(RUN), "result: 'a Trajectory' – a study's result"),
        (lambda: st.modes(CASE, damped="abc"), "damped: 'abc' – True or False, or None"),
        (lambda: st.modes(CASE, progress=-1), "progress: -1 – a function, or None"),
        (lambda: st.onsets(CASE, check=None), "check: missing – True or False"),
        (lambda: st.pencil(CASE, [0.1]), "mu: [0.1] – a friction coefficient is a finite number ≥ 0"),
        (lambda: st.simulate(CASE, []), "mu: [] – a friction coefficient is a finite number ≥ 0"),
        (lambda: st.simulate(CASE, checkpoint="abc"), "checkpoint: 'abc' – a function, or None"),
        (lambda: st.sensitivities(CASE, mu="abc"), "mu: 'abc' – a friction coefficient is a finite number ≥ 0"),
        (lambda: st.sensitivities(CASE, steps=3.0), "steps: 3.0 – a table, or None"),
        (lambda: st.rank_countermeasures(CASE, margin="abc"), "margin: 'abc' – a number"),
        (lambda: st.cycles(CASE, between="abc"), "between: 'abc' – two numbers, or None"),
        (lambda: st.cycles(CASE, 0.5, points=None), "points: missing – a number"),
        (lambda: st.damping_map(CASE, None, "y", x_range=(0, 1), y_range=(0, 1)), "x: missing – a text"),
        (lambda: st.ensemble(CASE, mu="abc"), "mu: 'abc' – a number, or a list of numbers"),
        (lambda: st.reduced_model(CASE, "abc"), "box: 'abc' – a table"),
        (lambda: st.compare(CASE, 0.5, kept=3), "kept: 3 – a store of finished parts"),
        (lambda: st.body_modes(CASE, max_frequency_hz=-1), "max_frequency_hz: -1 – a highest frequency"),
    ],
)
def test_what_is_of_another_kind_altogether_is_refused_by_its_name(call: Callable[[], Any], said: str) -> None:
    with pytest.raises(st.CaseError) as raised:
        call()
    assert str(raised.value).startswith(said)


@pytest.mark.parametrize("verb", [st.modes, st.compare, st.cycles])
def test_an_empty_list_of_friction_coefficients_is_none(verb: Any) -> None:
    with pytest.raises(CaseError, match=r"^mu: \[\] – at least one friction coefficient, or None$"):
        verb(CASE, [])


def test_numbers_and_switches_of_numpy_are_taken() -> None:
    import numpy as np

    plain = st.modes(CASE, [0.1], damped=True)
    found = st.modes(CASE, np.array([0.1]), damped=np.bool_(True), check=np.bool_(True))
    assert np.array_equal(found.eigenvalues, plain.eigenvalues)
    assert np.array_equal(st.modes(CASE, np.array(0.1)).eigenvalues, plain.eigenvalues)


def test_an_observable_that_is_none_is_told_before_its_window_and_names_are_said_once() -> None:
    told = r"^observable: 'X' – POINT.QUANTITY .* with a contact among rub and slip_speed"
    with pytest.raises(CaseError, match=told):
        st.ensemble(CASE, mu=[0.1, 0.2], observable="X", window=1e-6)
