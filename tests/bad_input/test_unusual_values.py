"""Values that are allowed and probably not meant: each number of a case, alone and against others."""

from __future__ import annotations

import json
import math
import types
import warnings
from collections.abc import Callable
from typing import Annotated, Any, Union, get_args, get_origin

import numpy as np
import pytest
import scipy.sparse as sp
from pydantic import BaseModel

import stridor as st
from stridor.app import cli
from stridor.case import Case, loads, template_text
from stridor.case.oddities import radians_meant
from stridor.case.schema import ENTRIES
from stridor.case.usual import USUAL, WITHOUT, usual_of
from stridor.direct import SingularMatrix, factorise
from stridor.errors import AnalysisError, CaseError
from stridor.sliding import far_apart, steady_sliding
from stridor.sliding.scales import moved_most
from stridor.sliding.solution import _loose
from stridor.system import build_system
from stridor.system.uncoupled import _apart

BENCH = loads(template_text("two-beams"))
DISC = loads(template_text("pad-on-disc"), ["bodies.disc.mesh.divisions=[4,24,1]"])


def tables(annotation: Any) -> list[type[BaseModel]]:
    """The tables that an annotation speaks of."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [t for argument in get_args(annotation) for t in tables(argument)]


def is_number(annotation: Any) -> bool:
    """Whether floats are among what a key holds."""
    if get_origin(annotation) in (Annotated, Union, types.UnionType, tuple) or get_args(annotation):
        return any(is_number(argument) for argument in get_args(annotation))
    return annotation is float


def every_table() -> dict[str, type[BaseModel]]:
    found: dict[str, type[BaseModel]] = {}
    left = [t for annotation in (*ENTRIES.values(), Case) for t in tables(annotation)]
    while left:
        table = left.pop()
        if table.__name__ not in found:
            found[table.__name__] = table
            left += [t for f in table.model_fields.values() for t in tables(f.annotation)]
    return found


def test_every_number_of_the_schema_has_a_usual_size_or_is_said_to_have_none() -> None:
    left: list[str] = []
    for name, table in every_table().items():
        for key, field in table.model_fields.items():
            known = usual_of(table, key) is not None or any(f"{b.__name__}.{key}" in WITHOUT for b in table.__mro__)
            if is_number(field.annotation) and not tables(field.annotation) and not known:
                left.append(f"{name}.{key}")
    assert left == []  # else give it a size in case/usual.py, or put it among those without


def test_every_usual_size_is_of_a_number_of_the_schema() -> None:
    known = every_table()
    named = {f"{b.__name__}.{key}" for t in known.values() for key in t.model_fields for b in t.__mro__}
    assert set(USUAL) <= named
    assert set(WITHOUT) <= named


def test_shipped_cases_have_nothing_odd() -> None:
    assert BENCH.warnings == []
    assert DISC.warnings == []


A_STRESS = "linear elasticity holds for small strain: check the units of load and modulus"
ODD = {
    "modulus in MPa": (
        BENCH,
        {"materials.steel.young_modulus": 2.1e5},
        "materials.steel.young_modulus: 210000 Pa is unusual for Young's modulus, usually 1e+06 to 1.3e+12 Pa; if 210000 MPa is meant, write 2.1e+11",
    ),
    "modulus in kPa": (
        BENCH,
        {"materials.steel.young_modulus": 2.1e8},
        "materials.steel: 2.1e+08 Pa is soft as rubber or plastics and 7800 kg/m³ heavy as metal; check the unit of young_modulus (Pa) and density (kg/m³)",
    ),
    "density in g/cm³": (
        BENCH,
        {"materials.steel.density": 7.8},
        "materials.steel.density: 7.8 kg/m³ is unusual for a density, usually 10 to 25000 kg/m³; if 7.8 g/cm³ is meant, write 7800",
    ),
    "density of tungsten in g/cm³": (
        BENCH,
        {"materials.steel.density": 19.3},
        "materials.steel: sound travels at √(E/ρ) = 1.018e+05 m/s in it, usually 20 to 25000 m/s; check young_modulus = 2e+11 Pa and density = 19.3 kg/m³",
    ),
    "length in mm": (
        BENCH,
        {"bodies.beam2.length": 150.0},
        "bodies.beam2.length: 150 m is unusual for a length, usually 0.0001 to 10 m; if 150 mm is meant, write 0.15",
    ),
    "end in mm": (
        BENCH,
        {"bodies.beam2.length": None, "bodies.beam2.angle_deg": None, "bodies.beam2.end": [90.0, 0.0]},
        "bodies.beam2.end: 90 m from start to end is unusual for a length, usually 0.0001 to 10 m; if 90 mm is meant, write 0.09",
    ),
    "thickness of 10 m": (
        DISC,
        {"bodies.disc.mesh.thickness": 12.0},
        "bodies.disc.mesh.thickness: 12 m is unusual for a thickness, usually 1e-05 to 2 m; if 12 mm is meant, write 0.012",
    ),
    "radius in mm": (
        DISC,
        {"bodies.plate.mesh.outer_radius": 135.0},
        "bodies.plate.mesh.outer_radius: 135 m is unusual for a radius, usually 0.0001 to 10 m; if 135 mm is meant, write 0.135",
    ),
    "place in mm": (
        DISC,
        {"bodies.disc.points.rim": [0.0, 140.0, 12.0]},
        "bodies.disc.points.rim: 140 m is unusual for a coordinate, usually at most 100 m; if 140 mm is meant, write 0.14",
    ),
    "fast support": (
        BENCH,
        {"supports.clamp.velocity.x": 1e6},
        "supports.clamp.velocity.x: 1e+06 m/s is unusual for a velocity, usually 1e-09 to 1000 m/s; if 1e+06 mm/s is meant, write 1000",
    ),
    "fast turning of a support": (
        BENCH,
        {"supports.clamp.velocity": {"rotation": 3e4}},
        "supports.clamp.velocity.rotation: 30000 rad/s is unusual for a speed of turning, usually 1e-06 to 10000 rad/s; if 30000 turns a minute is meant, write 3141.59",
    ),
    "turns a minute": (
        DISC,
        {"bodies.disc.sliding.spin": 3000.0},
        "bodies.disc.sliding.spin: 3000 rad/s moves the rim at 420 m/s, usually at most 250 m/s; if 3000 turns a minute are meant, write 314.159",
    ),
    "pressure beyond the modulus": (
        DISC,
        {"loads.piston.pressure": 5e9, "materials.steel.young_modulus": 2e9, "materials.steel.density": 1e3},
        f"loads.piston.pressure: a stress of 5e+09 Pa is beyond Young's modulus of plate, 2e+09 Pa; {A_STRESS}",
    ),
    "pressure in MPa": (
        DISC,
        {"loads.piston.pressure": 0.5},
        "loads.piston.pressure: 0.5 Pa is unusual for a pressure, usually 1 to 1e+10 Pa; if 0.5 MPa is meant, write 500000",
    ),
    "force beyond the modulus": (
        BENCH,
        {"loads.press.force": [0.0, -4e6]},
        f"loads.press.force: a stress of at least 2.667e+11 Pa is beyond Young's modulus of beam1, 2e+11 Pa; {A_STRESS}",
    ),
    "force on a boundary": (
        DISC,
        {
            "loads.piston": {"at": "plate.top", "force": [0.0, 0.0, -9e7]},
            "materials.steel.young_modulus": 1e9,
            "materials.steel.density": 1e3,
        },
        f"loads.piston.force: a stress of at least 1.251e+08 Pa is 13 % of Young's modulus of plate, 1e+09 Pa; {A_STRESS}",
    ),
    "nearly incompressible linear elements": (
        DISC,
        {"materials.lining.poisson_ratio": 0.495},
        "materials.lining.poisson_ratio: 0.495 is near 0.5, where the volume cannot change: hexahedron elements of lining lock, frequencies come out too high; take quadratic ones or a smaller ratio (at most 0.45)",
    ),
    "incompressible quadratic elements": (
        DISC,
        {"materials.lining.poisson_ratio": 0.4999, "bodies.lining.mesh.cells": "hexahedron20"},
        "materials.lining.poisson_ratio: 0.4999 is near 0.5, where the volume cannot change: hexahedron20 elements of lining lock, frequencies come out too high; take a smaller ratio (at most 0.499)",
    ),
    "auxetic": (
        DISC,
        {"materials.iron.poisson_ratio": -0.99},
        "materials.iron.poisson_ratio: -0.99 is negative, usually 0 to 0.5: the material grows thicker as it is pulled (auxetic); its shear modulus is 50 E, and elements lock in bending",
    ),
    "static friction of 600": (
        BENCH,
        {"contacts.A.friction": {"law": "static-kinetic", "coefficient": 0.3, "static_coefficient": 600.0}},
        "contacts.A.friction.static_coefficient: 600 is unusual for a friction coefficient, usually at most 2; check its unit and its digits",
    ),
    "friction in per cent": (
        BENCH,
        {"modal.friction_range": [0.0, 60.0]},
        "modal.friction_range: 60 is unusual for a friction coefficient, usually at most 10; if 60 % is meant, write 0.6",
    ),
    "damping beyond critical": (
        BENCH,
        {"bodies.beam1.damping": {"mass": 1e4, "stiffness": 1e-3}},
        "bodies.beam1.damping: α₁ = 10000 1/s, α₂ = 0.001 s damp beyond critical at every frequency up to 40000 Hz, so that nothing vibrates; check the unit of both; loss factors and per cents are not what Rayleigh's factors are",
    ),
    "damping by mass alone": (
        BENCH,
        {"bodies.beam1.damping": {"mass": 1e6}},
        "bodies.beam1.damping: α₁ = 1e+06 1/s, α₂ = 0 s damp beyond critical at every frequency up to 40000 Hz, so that nothing vibrates; check the unit of both; loss factors and per cents are not what Rayleigh's factors are",
    ),
    "a loss factor": (
        BENCH,
        {"bodies.beam1.damping": {"stiffness": 0.01}},
        "bodies.beam1.damping: α₁ = 0 1/s, α₂ = 0.01 s damp beyond critical above 31.83 Hz; check the unit of both; loss factors and per cents are not what Rayleigh's factors are",
    ),
    "contact stiffness of a point": (
        BENCH,
        {"contacts.A.stiffness": 0.5},
        "contacts.A.stiffness: 0.5 N/m is unusual for a contact stiffness, usually 1 to 1e+14 N/m; if 0.5 N/mm is meant, write 500",
    ),
    "contact stiffness of a surface": (
        DISC,
        {"contacts.face.stiffness": 2e3},
        "contacts.face.stiffness: 2000 N/m³ is unusual for a contact stiffness per area, usually 10000 to 1e+18 N/m³; if 2000 N/mm³ is meant, write 2e+12",
    ),
    "frequency in kHz": (
        BENCH,
        {"modal.max_frequency_hz": 8.0},
        "modal.max_frequency_hz: 8 Hz is unusual for a highest frequency, usually 10 to 1e+07 Hz; if 8 kHz is meant, write 8000",
    ),
    "time step in µs": (
        BENCH,
        {"temporal.step": 0.02},
        "temporal.step: 0.02 s is unusual for a time step, usually 1e-12 to 0.01 s; if 0.02 µs is meant, write 2e-08",
    ),
    "duration in ms": (
        BENCH,
        {"phases.slide.duration": 5e3},
        "phases.1.duration: 5000 s is unusual for a duration, usually 1e-07 to 1000 s; if 5000 ms is meant, write 5",
    ),
    "angle in rad": (
        DISC,
        {"bodies.plate.mesh.start_deg": 1.1345},
        "bodies.plate.mesh.start_deg: 1.1345 degrees looks like radians; if so, write 65",
    ),
    "sector in rad": (
        DISC,
        {"bodies.plate.mesh.sweep_deg": 0.83},
        "bodies.plate.mesh.sweep_deg: 0.83 degrees is unusual for a sector, usually 1 to 360 degrees; if 0.83 rad is meant, write 47.5555",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("case", "change", "said"), [(o[0], o[1], list(o[2:])) for o in ODD.values()], ids=[*ODD])
def test_what_is_probably_not_meant_is_said_once(case: Case, change: dict[str, Any], said: list[str]) -> None:
    assert case.with_(change).warnings == said


MASSES = """
[bodies.m]
type = "mass"
mass = 1.0
position = [0.0, 0.0]
[bodies.flat]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [0.0, 1.0]
sliding = { velocity = [1.0, 0.0] }
[springs.k]
between = ["m", "ground"]
direction = [0.6, 0.8]
stiffness = 10.0
damping = 0.1
[loads.weight]
at = "m"
force = [0.0, -1.0]
[contacts.rub]
slave = "m"
master = "flat"
stiffness = 0.01
friction = { law = "coulomb", coefficient = 0.3 }
"""


def test_models_without_a_scale_are_left_alone() -> None:
    """Masses of one and stiffnesses of ten are usual in research; friction and damping mean the same in any units."""
    assert loads(MASSES).warnings == []
    heavy = MASSES.replace("mass = 1.0", "mass = 1e9").replace("stiffness = 10.0", "stiffness = 1e-9")
    assert [w.partition(":")[0] for w in loads(heavy).warnings] == []
    assert "30 is unusual for a friction coefficient" in loads(MASSES.replace("= 0.3", "= 30.0")).warnings[0]
    (still,) = loads(MASSES.replace("damping = 0.1", "damping = 63.3")).warnings
    assert still == (
        "bodies.m: its springs and dashpots damp it with 63.3 N s/m, 10 times critical (6.325 N s/m); it cannot vibrate "
        "by itself"
    )


def test_a_case_can_say_that_it_has_no_units() -> None:
    odd = {"materials.steel.young_modulus": 100.0, "materials.steel.density": 1.0, "bodies.beam2.length": 50.0}
    assert len(BENCH.with_(odd).warnings) == 3
    assert BENCH.with_({**odd, "units": "nondimensional"}).warnings == []
    with pytest.raises(CaseError, match='units: \'mm\' – must be "SI" or "nondimensional"'):
        BENCH.with_({"units": "mm"})


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
@pytest.mark.parametrize(
    "path", ["materials.steel.density", "temporal.step", "contacts.A.friction.coefficient", "modal.max_frequency_hz"]
)
def test_what_is_not_finite_is_refused(path: str, value: float) -> None:
    with pytest.raises(CaseError, match=rf"^{path}: {value} – .*; it must be finite$"):
        BENCH.with_({path: value})


@pytest.mark.parametrize(
    ("degrees", "meant"),
    [(1.5708, 90.0), (1.57, 90.0), (-0.7854, -45.0), (1.4835, 85.0), (3.14, 180.0), (85.0, None), (5.5, None),
     (0.0, None), (None, None), (2.5, None), (1.3, None), (90.0, None)],
)  # fmt: skip
def test_angles_in_radians(degrees: float | None, meant: float | None) -> None:
    assert radians_meant(degrees) == meant


SHORT = BENCH.with_({"phases": [{"name": "a", "duration": 1e-6}], "temporal.watch": []})
ASKED = {
    "simulate": lambda value: st.simulate(SHORT, value),
    "steady": lambda value: st.steady_sliding(SHORT, value),
    "modes": lambda value: st.modes(SHORT, value),
    "compare": lambda value: st.compare(SHORT, [value], critical=False),
    "countermeasures": lambda value: st.rank_countermeasures(SHORT, mu=value),
}


@pytest.mark.parametrize("value", [math.inf, math.nan, -0.1])
@pytest.mark.parametrize("call", [*ASKED.values()], ids=[*ASKED])
def test_friction_coefficients_that_are_none(call: Any, value: float) -> None:
    with pytest.raises(CaseError, match=r"^mu: "):
        call(value)


@pytest.mark.parametrize("value", [math.inf, math.nan, 0.0, -1.0])
def test_frequencies_and_changes_that_are_none(value: float) -> None:
    for call in (st.modes, st.onsets):
        with pytest.raises(CaseError, match=r"^max_frequency_hz: "):
            call(SHORT, max_frequency_hz=value)
    with pytest.raises(CaseError, match=r"^percent: "):
        st.rank_countermeasures(SHORT, mu=0.3, percent=value)


def program(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    code = 0
    try:
        code = cli._guarded(lambda: cli.app(arguments, standalone_mode=False))
    except SystemExit as leave:
        code = int(leave.code or 0)
    out = capsys.readouterr()
    return code, out.out, out.err


@pytest.mark.parametrize("verb", ["check", "modes", "onsets", "steady", "simulate"])
def test_verbs_warn_once_and_list_it(verb: str, tmp_path: Any, capsys: pytest.CaptureFixture[str]) -> None:
    odd = SHORT.with_({"materials.steel.density": 7.8, "bodies.beam1.elements": 6, "bodies.beam2.elements": 9})
    (tmp_path / "odd.toml").write_text(odd.text)
    code, out, err = program([verb, str(tmp_path / "odd.toml"), "--json"], capsys)
    assert code == 0
    assert err.count("materials.steel.density: 7.8 kg/m³ is unusual") == 1
    warned = json.loads(out)["warnings"]
    assert [w for w in warned if "7.8 g/cm³" in w] == odd.warnings
    assert len(warned) == len(set(warned))


@pytest.mark.parametrize("verb", ["modes", "steady", "simulate", "compare", "sensitivities", "countermeasures"])
def test_verbs_refuse_an_infinite_friction(verb: str, tmp_path: Any, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "case.toml").write_text(SHORT.text)
    code, _, err = program([verb, str(tmp_path / "case.toml"), "--mu", "inf"], capsys)
    assert code == 2
    assert err.startswith("stridor: --mu: ")
    assert "inf" in err


def test_friction_beyond_all_bounds_ends_in_our_words(tmp_path: Any, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "case.toml").write_text(SHORT.text)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        code, _, err = program(["modes", str(tmp_path / "case.toml"), "--mu", "1e308"], capsys)
        with pytest.raises(AnalysisError, match="no equilibrium"):
            steady_sliding(build_system(SHORT), mu=1e308)
    assert code == 2
    assert "--mu: 1e+308 – a friction coefficient is at most 1e+06, beyond which rounding is left" in err
    assert "Warning" not in err


@pytest.mark.parametrize("call", [
    lambda c: st.steady_sliding(c, 2e6), lambda c: st.modes(c, [0.1, 1e100]), lambda c: st.simulate(c, 1e100),
    lambda c: st.sensitivities(c, mu=1e100), lambda c: st.cycles(c, 1e100), lambda c: st.cycles(c, between=(0.0, 1e9)),
    lambda c: st.onsets(c, (0.0, 1e9)), lambda c: st.compare(c, 1e100), lambda c: st.ensemble(c, mu=[1e100]),
    lambda c: st.stability_boundary(c, "bodies.beam1.damping.mass", "mu", x_range=(0, 1), y_range=(0, 1e9)),
    lambda c: st.damping_map(
        c, "bodies.beam1.damping.mass", "bodies.beam2.damping.mass", x_range=(0, 1), y_range=(0, 1), mu_range=(0, 1e9)
    ),
    lambda c: c.with_({"modal.friction_range": (0.0, 1e9)}), lambda c: c.with_({"comparison.mu": [1e9]}),
    lambda c: st.reduced_model(c, {"mu": (0.0, 1e9)}), lambda c: st.rank_countermeasures(c, mu=1e100),
])  # fmt: skip
def test_friction_that_no_number_resolves_is_refused_at_once(call: Callable[[st.Case], object]) -> None:
    with pytest.raises(CaseError, match="a friction coefficient is at most 1e\\+06"):
        call(SHORT)


@pytest.mark.parametrize("words", [
    ("steady", "--mu", "1e100"), ("simulate", "--mu", "1e100"), ("ensemble", "--mu", "1e100"),
    ("onsets", "--range", "0:1e9"), ("countermeasures", "--mu", "1e100"), ("cycles", "--range", "0:1e9"),
])  # fmt: skip
def test_verbs_say_which_option_asks_for_it(
    words: tuple[str, ...], tmp_path: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "case.toml").write_text(SHORT.text)
    verb, option, value = words
    code, _, err = program([verb, str(tmp_path / "case.toml"), option, value], capsys)
    assert code == 2
    assert f"stridor: {option}: " in err
    assert "a friction coefficient is at most 1e+06" in err


@pytest.mark.parametrize("option", ["--mu", "--range"])
@pytest.mark.parametrize("value", ["0.5:0.1", "a:b"])
def test_a_range_of_cycles_is_refused_by_the_option_it_was_given_with(
    option: str, value: str, tmp_path: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "case.toml").write_text(SHORT.text)
    code, _, err = program(["cycles", str(tmp_path / "case.toml"), option, value], capsys)
    assert code == 2
    assert f"stridor: {option}: '{value}' – " in err


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("stiffness", [1e-150, 1e-300, 1e-320])
def test_a_contact_as_good_as_without_stiffness(stiffness: float) -> None:
    """A beam that nothing else holds is loose, and one that a spring holds is not pressed."""
    loose = SHORT.with_({"contacts.A.stiffness": stiffness})
    spring = {"between": ("beam1.tip", "ground"), "stiffness": 1e4, "direction": (0.0, 1.0)}
    held = loose.with_({"springs.k": spring})
    for analysis in (st.steady_sliding, lambda case: st.modes(case, 0.1), st.onsets):
        with pytest.raises(AnalysisError, match=r"can move freely under (its|the) loads"):
            analysis(loose)
    for analysis in (lambda case: st.modes(case, 0.1), st.onsets):
        with pytest.raises(AnalysisError, match=r"no normal force|no contact carries load"):
            analysis(held)


def test_stiffnesses_too_far_apart_are_not_said_to_leave_a_body_free() -> None:
    """Beam 2 is clamped; what it resists with is rounding beside a beam 1 of a thousand kilometres' width."""
    wide = BENCH.with_({"bodies.beam1.elements": 3, "bodies.beam2.elements": 6, "bodies.beam1.width": 1e6})
    for analysis in (st.steady_sliding, lambda case: st.modes(case, 0.0), st.onsets):
        with pytest.raises(AnalysisError, match="stiffnesses lie too far apart") as told:
            analysis(wide)
        assert "can move freely" not in str(told.value)
        assert "e+16 at beam1 node" in str(told.value)
        assert "what body beam2 resists a motion with is 3e-13 of the terms there" in str(told.value)
    loose = BENCH.with_({"bodies.beam1.elements": 3, "bodies.beam2.elements": 6, "supports.clamp.fixed": ["x"]})
    with pytest.raises(AnalysisError, match="body beam2 can move freely"):
        st.steady_sliding(loose)
    system = build_system(BENCH)
    assert far_apart(system) == ""
    motion = np.zeros(system.size)
    motion[system.lines[1].freedoms] = np.linspace(0.0, 1.0, len(system.lines[1].freedoms))
    assert moved_most(system, motion).resisted
    said = _loose(system, system.contact_nodes(), motion)
    assert "in a motion of body beam2 that its own stiffness resists" in said
    assert "body beam2 can move freely" in _loose(system, system.contact_nodes(), motion, far=True)  # beyond any size


def test_a_spring_stiffer_than_digits_tell_is_named() -> None:
    block = {
        "type": "solid", "model": "3d", "material": "steel",
        "mesh": {"shape": "block", "corner": [0.0, 0.0, 0.0], "size": [0.04, 0.02, 0.01], "divisions": [2, 1, 1],
                 "cells": "hexahedron"}, "points": {"q": [0.0, 0.0, 0.01]},
    }  # fmt: skip
    case = Case(
        materials={"steel": {"young_modulus": 2e11, "density": 7800.0, "poisson_ratio": 0.3}},
        bodies={"up": block, "floor": {"type": "obstacle", "shape": "flat", "point": (0, 0, 0), "normal": (0, 0, 1),
                                       "sliding": {"velocity": (1.0, 0.0, 0.0)}}},
        supports={"guide": {"at": "up.top", "fixed": ["x", "y"]}},
        loads={"press": {"at": "up.top", "force": (0.0, 0.0, -100.0)}},
        springs={"s": {"between": ("up.q", "ground"), "stiffness": 1e24, "direction": (0.0, 0.0, 1.0)}},
        contacts={"rub": {"slave": "up.bottom", "master": "floor", "stiffness": 1e12,
                          "friction": {"law": "coulomb", "coefficient": 0.4}}},
        modal={"max_frequency_hz": 50000.0},
    )  # fmt: skip
    with pytest.raises(AnalysisError, match="stiffnesses lie too far apart for the 16 digits of a number: the stiffness"):
        st.modes(case, 0.1)
    told = far_apart(build_system(case))
    assert "1e+24 at up node " in told
    assert "e+15 times the " in told
    # Rows of unlike size tell nothing of what resists. Whether elimination leaves zero or rounding there is the solver's
    # and the processor's; of powers of two this one leaves zero on all.
    big = 2.0**100
    with pytest.raises(SingularMatrix, match=r"rows have entries up to 1\.27e\+30 and up to 1, too far apart"):
        factorise(sp.csr_array(np.array([[big, big, 0.0], [big, big, 1.0], [0.0, 1.0, 1.0]])), solver="superlu")
    with pytest.raises(SingularMatrix, match="nothing resists a motion of freedom"):
        factorise(sp.csr_array(np.array([[1.0, -1.0], [-1.0, 1.0]])))


def test_verbs_warn_of_friction_that_is_asked_for(tmp_path: Any, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "case.toml").write_text(SHORT.text)
    _, _, err = program(["modes", str(tmp_path / "case.toml"), "--mu", "30"], capsys)
    assert "warning: --mu: 30 is unusual for a friction coefficient, usually at most 10; if 30 % is meant" in " ".join(err.split())


def test_lengths_that_no_number_reaches() -> None:
    """Such a beam has no place for anything; of one that is as long as that rounding joins more poles than it has
    freedoms."""
    with pytest.raises(CaseError, match=r"supports\.guide\.at: 'beam1\.top' – not told where on a beam of 4\.94065646e-324 m"):
        loads(template_text("two-beams"), ["bodies.beam1.length=5e-324"])
    shapes = np.arange(6.0).reshape(2, 3) + 0j
    assert _apart(shapes, -1.0 + 0j, np.eye(2))[0] is shapes
