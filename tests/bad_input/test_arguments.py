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
        (lambda: st.cycles(CASE, 1.0, push=0.0), "push: 0.0 – finite speeds above or below 0 [m/s]"),
        (lambda: st.cycles(CASE, 1.0, push=[0.1, 0.0]), "push: [0.1, 0.0] – finite speeds above or below 0 [m/s]"),
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
    with pytest.raises(CaseError, match=r"^phases\.0\.ramp: 1e-05 – 0 when starting from steady sliding"):
        loads(template_text("two-beams"), ['temporal.initial="steady-sliding"', "phases.0.ramp=1e-5"])
