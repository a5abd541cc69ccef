"""Sentences of the report that claim something: said only where it was found."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import stridor as st
from rubbing_block import rubbing_block
from stridor.agreement import Agreement, Comparison, Perturbation
from stridor.app.pipeline import Outcome
from stridor.case import template_text
from stridor.case.schema import Rotation, Tie
from stridor.modal.complex_modes import ComplexModes
from stridor.modal.onsets import Onsets
from stridor.temporal.signals import Components
from stridor.view import surface_figures
from stridor.view.body_words import body_words
from stridor.view.inputs import NamedFrequencies, ReportInputs
from stridor.view.modal_tables import body_table, frequency_tables
from stridor.view.report import sections
from stridor.view.words import _agreement_sentence, _onset_sentence, model_in_words, verdict


def report(**more: Any) -> Any:
    nothing = Onsets((), (0.0, 0.5), 20e3, True)
    fields = {"damped_onsets": nothing, "undamped_onsets": None, "damped_sweep": None, "modes": None}
    values = fields | {"max_frequency_hz": 20e3, "agreement": None} | more
    damped, undamped = values["damped_onsets"], values["undamped_onsets"]
    return SimpleNamespace(**values, onsets=undamped if damped is None else damped)


def sweep(growth: float, frequency_hz: float) -> ComplexModes:
    lam = np.array([[growth + 2j * np.pi * frequency_hz]])
    return ComplexModes(np.array([0.1]), lam, np.array([1]), np.zeros((1, 1)), True)


def test_no_onset_is_not_called_stable_where_modes_grow() -> None:
    stable = "No friction coefficient between 0 and 0.5 makes it unstable up to 20 kHz."
    assert _onset_sentence(report()) == stable
    assert _onset_sentence(report(damped_sweep=sweep(-5.0, 3e3))) == stable
    assert _onset_sentence(report(modes=sweep(50.0, 30e3))) == stable
    for found in ("damped_sweep", "modes"):
        assert "and yet modes grow" in _onset_sentence(report(**{found: sweep(50.0, 3e3)}))


def test_growth_at_two_frequencies_is_not_one() -> None:
    components = Components(np.zeros(0, dtype=complex), np.zeros(0))
    seen = Perturbation(0.1, 100 + 2j * np.pi * 5e3, np.zeros(4), 1e-6, components)

    def compared(agrees: bool | None) -> str:
        one = Comparison(
            0.1, 400 + 2j * np.pi * 9e3, (9e3,), (400.0,), seen, None, None, 0.4, 0.7, None, None, agrees, "v"
        )
        word = {True: "agree: ", False: "disagree: ", None: "not decided: "}[agrees]
        agreement = Agreement((one,), None, None, None, f"{word}v")
        return _agreement_sentence(report(agreement=agreement))

    assert compared(True).startswith("The modal and the temporal approach agree: at μ = 0.1 both find growth at 5000 Hz")
    assert compared(False) == (
        "The modal and the temporal approach do not agree: at μ = 0.1 both find growth, but at 9000 Hz with 400 1/s by "
        "the modes and at 5000 Hz with 100 1/s in time."
    )


def test_a_contacts_stiffness_has_the_unit_of_what_it_is() -> None:
    case = st.loads(rubbing_block("max_frequency_hz = 30e3"))
    surface = model_in_words(ReportInputs(case=case, system=st.build_system(case)))
    assert any("with a stiffness of 10¹² N/m³;" in line for line in surface)
    beams = st.loads(template_text("two-beams"))
    point = model_in_words(ReportInputs(case=beams, system=st.build_system(beams)))
    assert any("with a stiffness of 10¹⁰ N/m in the modal approach;" in line for line in point)
    timed = beams.with_({"temporal.contact": "as given"})
    assert any("10¹⁰ N/m;" in line for line in model_in_words(ReportInputs(case=timed, system=st.build_system(timed))))


def test_letters_of_modes_are_those_that_there_are() -> None:
    beam = body_table("beam", NamedFrequencies(np.array([1.0, 2.0]), ("F1", "T1")), ())
    solid = body_table("disc", NamedFrequencies(np.array([1.0]), ("E1",)), ())
    assert (beam.caption, solid.caption) == ("F: bending, T: traction.", "E: elastic.")
    case = st.loads(rubbing_block("max_frequency_hz = 30e3"))
    inputs = ReportInputs(case=case, body_modes={"stiff": NamedFrequencies(np.zeros(0), ())})
    assert frequency_tables(inputs) == []


def test_of_bodies_that_repeat_the_answer_is_of_motions_alike() -> None:
    case = st.loads(rubbing_block("max_frequency_hz = 20e3"))
    turn = Tie(slave="block.end", master="block.start", rotation=Rotation(angle_deg=30.0))
    sector = case.model_copy(update={"ties": {"turn": turn}})
    nothing = Onsets((), (0.0, 0.5), 20e3, True)

    def answer(of: st.Case, **more: Any) -> Any:
        return verdict(ReportInputs(case=of, mu=0.4, damped_onsets=nothing, **more))

    whole, alike = (answer(of, modes=sweep(-5.0, 3e3)) for of in (case, sector))
    assert whole.headline == "It does not squeal at μ = 0.4 up to 20 kHz"
    assert alike.headline == f"{whole.headline}, in motions alike in all sectors"
    assert "unstable up to 20 kHz." in whole.paragraph
    assert "unstable up to 20 kHz, in motions alike in all sectors." in alike.paragraph
    assert alike.paragraph.endswith("All of that is of motions alike in all sectors alone (ties.turn).")
    assert "alike" not in whole.paragraph
    assert answer(sector).headline == "Not decided: no modes at the friction of the case"
    chapter = next(c for c in sections(ReportInputs(case=sector, damped_onsets=nothing)) if c.name == "modal")
    assert any(line.endswith("≤ μ ≤ 0.5, in motions alike in all sectors.") for line in chapter.paragraphs)
    computed: Any = SimpleNamespace(case=sector, agreement=None, onsets_damped=nothing)
    assert Outcome(None, (), computed).verdict == "no onset in range, in motions alike in all sectors"


def test_a_body_has_the_article_of_its_shape() -> None:
    case = st.loads(
        """[materials.a]
young_modulus = 2e11
density = 7800.0
poisson_ratio = 0.3
[bodies.ring]
type = "solid"
model = "plane stress"
material = "a"
mesh = { shape = "annulus", inner_radius = 0.05, outer_radius = 0.1, divisions = [2, 24] }
[bodies.bar]
type = "solid"
model = "plane stress"
material = "a"
mesh = { shape = "rectangle", corner = [0.0, 0.0], size = [0.1, 0.01], divisions = [2, 2] }
"""
    )
    ring, bar = (body_words(case, name, body) for name, body in case.bodies.items())
    assert ", an annulus, " in ring
    assert ", a rectangle, " in bar


def test_shares_of_bodies_are_plain_per_cents(monkeypatch: pytest.MonkeyPatch) -> None:
    sizes = {"caliper": 4.0, "pin": 1.8244, "disc": 0.0084, "wedge": 4.0e-7, "held": 0.0}
    shapes = {name: np.array([[0.0, 0.0], [size, 0.0]]) for name, size in sizes.items()}
    monkeypatch.setattr(surface_figures, "mode_shape", lambda system, vector: shapes)
    said = surface_figures._shares(SimpleNamespace(), np.zeros(0))  # ty: ignore[invalid-argument-type]
    told = "caliper 100 %, pin 46 %, disc 0.21 %, wedge 1.0 · 10⁻⁵ %, held 0 %"
    assert said == f"Largest amplitude of each body: {told}."
