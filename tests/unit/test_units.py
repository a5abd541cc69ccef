"""Units of the numbers of a case by their paths."""

from __future__ import annotations

import pytest

import stridor as st
from stridor.case import template_text
from stridor.case.units import unit_at


@pytest.mark.parametrize(
    ("path", "unit"),
    [
        ("mu", "1"), ("contacts.A.friction.coefficient", "1"), ("contacts.A.stiffness", "N/m"),
        ("bodies.beam1.damping.mass", "1/s"), ("bodies.beam1.damping.stiffness", "s"), ("bodies.beam1.thickness", "m"),
        ("bodies.beam1.start.0", "m"), ("bodies.beam1.angle_deg", "degrees"), ("loads.no-such.force.1", ""),
        ("materials.steel.young_modulus", "Pa"), ("materials.steel.density", "kg/m³"), ("bodies.no-such.width", ""),
        ("temporal.step", "s"), ("modal.max_frequency_hz", "Hz"), ("phases.0.duration", "s"), ("phases.99.x", ""),
    ],
)  # fmt: skip
def test_of_the_two_beams(path: str, unit: str) -> None:
    case = st.loads(template_text("two-beams"))
    contact = next(iter(case.contacts))
    assert unit_at(case, path.replace("contacts.A", f"contacts.{contact}")) == unit


def test_the_stiffness_of_a_surface_is_one_per_area_and_turning_is_no_velocity() -> None:
    case = st.loads(template_text("pad-on-disc"))
    contact = next(iter(case.contacts))
    assert unit_at(case, f"contacts.{contact}.stiffness") == "N/m³"


def test_without_si_units_only_plain_numbers_have_one() -> None:
    case = st.loads(template_text("two-beams"), ['units="nondimensional"'])
    contact = next(iter(case.contacts))
    assert unit_at(case, f"contacts.{contact}.friction.coefficient") == "1"
    assert unit_at(case, f"contacts.{contact}.stiffness") == unit_at(case, "bodies.beam1.damping.mass") == ""


def test_a_component_has_the_unit_of_its_vector() -> None:
    case = st.loads(template_text("pad-on-disc"))
    assert unit_at(case, "bodies.disc.sliding.velocity.0") == unit_at(case, "bodies.disc.sliding.velocity") == "m/s"
    plain = st.loads(template_text("pad-on-disc"), ['units="nondimensional"'])
    assert unit_at(plain, "bodies.disc.sliding.velocity.0") == ""
