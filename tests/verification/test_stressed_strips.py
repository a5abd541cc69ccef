"""Steady stresses stiffen solids wherever there are any: also without contact, and where contacts are points.

A strip of quad8 stretched between two clamps, against Euler–Bernoulli elements under tension of our own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.linalg as la

import stridor as st
from stridor.case import template_text
from stridor.errors import AnalysisError
from stridor.study.without_effect import without_effect

pytestmark = pytest.mark.verification

LENGTH, HEIGHT, DEPTH = 0.5, 1e-3, 0.01
YOUNG, DENSITY, STRAIN = 2e11, 7800.0, 1e-3


STRIP = f"""
[materials.stretched]
young_modulus = {YOUNG}
density = {DENSITY}
poisson_ratio = 0.0

[bodies.strip]
type = "solid"
material = "stretched"
model = "plane stress"
thickness = {DEPTH}
mesh = {{ shape = "rectangle", corner = [0.0, 1.0], size = [{LENGTH}, {HEIGHT}], divisions = [80, 1], cells = "quad8" }}

[supports.strip_left]
at = "strip.left"
fixed = ["x", "y"]

[supports.strip_right]
at = "strip.right"
fixed = ["x", "y"]
displacement = {{ x = {STRAIN * LENGTH}, y = 0.0 }}
"""


def strip(**more: Any) -> st.Case:
    """Clamped at both ends, the right one pulled away."""
    return st.Case(
        materials={"steel": {"young_modulus": YOUNG, "density": DENSITY, "poisson_ratio": 0.0}},
        bodies={"strip": {
            "type": "solid", "material": "steel", "model": "plane stress", "thickness": DEPTH,
            "mesh": {"shape": "rectangle", "corner": [0.0, 0.0], "size": [LENGTH, HEIGHT], "divisions": [80, 1],
                     "cells": "quad8"},
        }},
        supports={
            "left": {"at": "strip.left", "fixed": ["x", "y"]},
            "right": {"at": "strip.right", "fixed": ["x", "y"], "displacement": {"x": STRAIN * LENGTH, "y": 0.0}},
        },
        modal={"max_frequency_hz": 700.0, "prestress": True, **more},
    )  # fmt: skip


def tensioned(count: int = 120) -> np.ndarray:
    """Frequencies [Hz] of a clamped beam under tension EAε."""
    h, force = LENGTH / count, YOUNG * HEIGHT * DEPTH * STRAIN
    bending, mass = YOUNG * DEPTH * HEIGHT**3 / 12, DENSITY * HEIGHT * DEPTH
    k = bending / h**3 * np.array([
        [12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2],
        [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h**2, -6 * h, 4 * h**2],
    ])  # fmt: skip
    g = force / (30 * h) * np.array([
        [36, 3 * h, -36, 3 * h], [3 * h, 4 * h**2, -3 * h, -h**2],
        [-36, -3 * h, 36, -3 * h], [3 * h, -h**2, -3 * h, 4 * h**2],
    ])  # fmt: skip
    m = mass * h / 420 * np.array([
        [156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2],
        [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2],
    ])  # fmt: skip
    stiffness, inertia = np.zeros((2, 2 * count + 2, 2 * count + 2))
    for e in range(count):
        part = slice(2 * e, 2 * e + 4)
        stiffness[part, part] += k + g
        inertia[part, part] += m
    return np.sqrt(la.eigvalsh(stiffness[2:-2, 2:-2], inertia[2:-2, 2:-2])) / (2 * np.pi)


@pytest.mark.parametrize("source", ["auto", "krylov", "full"])
def test_a_stretched_strip_is_a_beam_under_tension(source: str, recwarn: pytest.WarningsRecorder) -> None:
    found = st.modes(strip(source=source), 0.0).frequency_hz[0]
    assert len(found) == 4
    assert found == pytest.approx(tensioned()[:4], rel=3e-3)
    assert found[0] > 5 * st.modes(strip(prestress=False), 0.0).frequency_hz[0, 0]
    assert not recwarn.list


def test_receptances_do_not_take_it() -> None:
    with pytest.raises(AnalysisError, match=r"^source receptance: stresses of steady sliding stiffen it \(prestress\); "):
        st.modes(strip(source="receptance"), 0.0)


def test_nothing_is_said_to_be_without_effect() -> None:
    assert without_effect(strip(), "modes") == []


def test_beside_beams_in_point_contact_too() -> None:
    beams = st.loads(template_text("two-beams"))
    case = st.loads(beams.with_({"bodies.beam1.elements": 6, "bodies.beam2.elements": 12}).to_toml() + STRIP)
    found = st.modes(case.with_({"modal.max_frequency_hz": 500.0, "modal.prestress": True}), 0.0).frequency_hz[0]
    for one in tensioned()[:2]:
        assert np.abs(found / one - 1).min() < 3e-3
