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
THICK = 0.01  # of what stands as a column
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



def column(force: float | None, **more: Any) -> st.Case:
    """A strip held at both ends of its axis, under a force [N] along it; None: without any load."""
    return strip(**more).with_({
        "bodies.strip.mesh.divisions": [20, 2], "bodies.strip.points": {"a": [0.0, 0.0], "b": [LENGTH, 0.0]},
        "bodies.strip.mesh.corner": [0.0, -THICK / 2], "bodies.strip.mesh.size": [LENGTH, THICK], "supports": {
            "left": {"at": "strip.a", "fixed": ["x", "y"]}, "right": {"at": "strip.b", "fixed": ["y"]},
        }, "loads": {} if force is None else {"push": {"at": "strip.right", "force": [force, 0.0]}},
    })  # fmt: skip


def test_a_column_without_load_has_its_plain_modes() -> None:
    plain = st.modes(column(None, prestress=False), 0.0)
    for case in (column(None), column(0.0)):
        assert st.modes(case, 0.0).frequency_hz == pytest.approx(plain.frequency_hz, rel=1e-9)
    # Nothing need hold it for that.
    loose = column(None).with_({"supports": {}})
    free = st.modes(loose.with_({"modal.prestress": False}), 0.0)
    assert st.modes(loose, 0.0).eigenvalues == pytest.approx(free.eigenvalues, rel=1e-9)
    # Where nothing tells the force that presses contacts, its stresses are not known.
    rubbing = column(None).with_({
        "bodies.belt": {"type": "obstacle", "shape": "flat", "point": [0.0, -THICK / 2], "normal": [0.0, 1.0],
                        "sliding": {"velocity": [-1.0, 0.0]}},
        "contacts": {"rub": {"slave": "strip.b", "master": "belt", "stiffness": 1e6,
                             "friction": {"law": "coulomb", "coefficient": 0.3}}},
    })  # fmt: skip
    with pytest.raises(AnalysisError, match="prestress needs the normal force"):
        st.modes(rubbing, 0.1)


def test_reduced_models_of_a_column_follow_its_load_through_zero() -> None:
    euler = np.pi**2 * YOUNG * DEPTH * THICK**3 / 12 / LENGTH**2
    plain = st.modes(column(None, prestress=False), 0.0).frequency_hz[0]
    model = st.reduced_model(column(0.0), {"loads.push.force.0": (-0.9 * euler, 0.9 * euler)})
    for share in (-0.8, 0.0, 0.5):
        found = model.modes({"loads.push.force.0": share * euler}).frequency_hz
        assert found[:2] == pytest.approx(plain[:2] * np.sqrt(1 + share / np.array([1, 4])), rel=1e-3)
    held = st.reduced_model(column(-0.8 * euler), {"materials.steel.density": (7000.0, 8000.0)})
    assert held.modes({"materials.steel.density": DENSITY}).frequency_hz[0] == pytest.approx(
        plain[0] * np.sqrt(0.2), rel=1e-3
    )
