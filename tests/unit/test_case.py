"""The case: reading, points and axes of bodies, overrides, copies, text; and the laws it hands on."""

from __future__ import annotations

import copy
import math
import pickle
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import BaseModel
from scipy.interpolate import PchipInterpolator

from stridor.case import Case, PointRef, load, loads, template_text, templates
from stridor.case.schema import BeamBody
from stridor.errors import CaseError, Problem, shown
from stridor.laws import (
    Coulomb,
    FrictionLaw,
    Hyperbolic,
    Material,
    Rayleigh,
    RectangularSection,
    StaticKinetic,
    Tabulated,
    Weakening,
)


def beam(**changes: object) -> BeamBody:
    values: dict[str, object] = {
        "type": "beam",
        "material": "steel",
        "start": [0.0, 0.0],
        "width": 0.01,
        "thickness": 0.002,
        "elements": 10,
    }
    return BeamBody.model_validate({**values, **changes})


@pytest.fixture(scope="module")
def bench() -> Case:
    return loads(template_text("two-beams"))


# -- the template --------------------------------------------------------------------------------------------


def test_template_is_the_bench_of_the_paper(bench: Case):
    assert "two-beams" in templates()
    assert bench.warnings == []
    top = bench.bodies["beam1"].end_point
    assert top == pytest.approx((0.1 + 0.05 * math.sin(math.radians(5)), 0.05 * math.cos(math.radians(5))))
    lean = top[0] - bench.bodies["beam1"].start[0]
    assert lean * bench.supports["clamp"].velocity["x"] > 0  # squeals: beam 1 leans the way beam 2 moves
    assert bench.side("A") == 1
    assert [(body.length_m, body.width, body.thickness, body.elements) for body in bench.bodies.values()] == [
        (0.05, 0.01, 0.0015, 30),
        (0.15, 0.015, 0.003, 90),
    ]
    assert bench.contacts["A"].friction.law_object() == Coulomb(0.1)
    assert bench.bodies["beam2"].damping.law_object() == Rayleigh(50.0, 1e-8)
    assert bench.temporal.step == 2e-8


def test_template_carries_all_of_table_ii_and_marks_its_misprints(bench: Case):
    assert bench.reference is not None
    alone = [frequency for body in bench.reference.bodies.values() for frequency in body]
    assert (len(alone), len(bench.reference.coupled), len(bench.reference.onsets)) == (18, 18, 4)
    assert {frequency.frequency_hz for frequency in alone if frequency.note} == {27898.0, 8840.0, 25533.0}
    assert {onset.mu for onset in bench.reference.onsets if "0.1" in onset.note} == {0.23, 0.13}


def test_traction_modes_marked_as_misprints_contradict_the_closed_form(bench: Case):
    assert bench.reference is not None
    steel, length = bench.materials["steel"], bench.bodies["beam2"].length_m
    quarter_wave = math.sqrt(steel.young_modulus / steel.density) / (4 * length)
    printed = {f.label: f.frequency_hz for f in bench.reference.bodies["beam2"]}
    assert quarter_wave == pytest.approx(8440, rel=1e-3)
    assert abs(printed["T1"] / quarter_wave - 1) > 0.04
    assert abs(printed["T2"] / (3 * quarter_wave) - 1) > 0.008


def test_template_lines_are_commented_and_loadable_from_disk(tmp_path: Path, bench: Case):
    path = tmp_path / "two-beams.toml"
    path.write_bytes(b"\xef\xbb\xbf" + template_text("two-beams").encode())  # with a byte order mark
    assert load(path) == bench
    assert load(str(path), ["contacts.A.stiffness=rigid"]).contacts["A"].stiffness == "rigid"


# -- bodies and points ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("angle", "direction"),
    [
        (0, (1, 0)),
        (90, (0, 1)),
        (180, (-1, 0)),
        (270, (0, -1)),
        (-90, (0, -1)),
        (360.0, (1, 0)),
        (-180, (-1, 0)),
    ],
)
def test_directions_along_the_axes_are_exact(angle: float, direction: tuple[float, float]):
    assert beam(angle_deg=angle, length=0.3).direction == direction


def test_axis_from_an_end_and_from_an_angle_agree():
    by_end = beam(start=[1.0, 2.0], end=[4.0, 6.0])
    angle = math.degrees(math.atan2(4.0, 3.0))
    by_angle = beam(start=[1.0, 2.0], angle_deg=angle, length=5.0)
    assert by_end.length_m == 5.0
    assert by_end.direction == (0.6, 0.8)
    assert by_angle.direction == pytest.approx(by_end.direction, rel=1e-14)
    assert by_angle.end_point == pytest.approx((4.0, 6.0), rel=1e-14)
    assert by_end.coordinates(2.5) == (2.5, 4.0)
    assert beam(start=[0.0, 1.0], end=[0.0, -1.0]).direction == (0.0, -1.0)


def test_points(bench: Case):
    assert bench.bodies["beam1"].point_names == ("start", "tip", "top", "end")
    assert bench.point("beam1.top") == PointRef("beam1", 0.05)
    assert bench.point("beam2.end") == PointRef("beam2", 0.15)
    assert bench.point("beam2@0.1") == PointRef("beam2", 0.1)
    assert bench.point("beam2@1e-1") == PointRef("beam2", 0.1)
    assert bench.point("beam2@0.15000000000000002").distance == 0.15  # one rounding beyond
    with pytest.raises(CaseError, match=r"^here: 'beam1\.tipp' – no such point"):
        bench.point("beam1.tipp", where="here")


def test_distance_suggested_for_a_support_is_accepted(bench: Case):
    with pytest.raises(CaseError) as caught:
        bench.with_({"supports.clamp.at": "beam2@0.033"})
    suggestion = str(caught.value).split("and ")[1].split(" m")[0]
    assert bench.with_({"supports.clamp.at": f"beam2@{suggestion}"}).supports["clamp"].at.startswith("beam2@")


def test_side_of_a_contact(bench: Case):
    assert bench.with_({"bodies.beam2.angle_deg": 180, "bodies.beam2.start": [0.15, 0.0]}).side("A") == -1
    assert bench.with_({"contacts.A.side": "right"}).side("A") == -1
    assert bench.with_({"contacts.A.side": "left"}).side("A") == 1


# -- overrides and copies ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("override", "path", "value"),
    [
        ("contacts.A.friction.coefficient=0.3", ("contacts", "A", "friction", "coefficient"), 0.3),
        (" bodies.beam1.elements = 10 ", ("bodies", "beam1", "elements"), 10),
        ("contacts.A.stiffness=rigid", ("contacts", "A", "stiffness"), "rigid"),
        ('contacts.A.stiffness="rigid"', ("contacts", "A", "stiffness"), "rigid"),
        ("contacts.A.slave=beam1@0.0", ("contacts", "A", "slave"), "beam1@0.0"),
        ("title=two words = one title", ("title",), "two words = one title"),
        ("bodies.beam1.damping.mass=0", ("bodies", "beam1", "damping", "mass"), 0.0),
        ("modal.damped=false", ("modal", "damped"), False),
        ("comparison.mu=[0.1, 0.2]", ("comparison", "mu"), (0.1, 0.2)),
        ("loads.press.force.1=-30", ("loads", "press", "force"), (0.0, -30.0)),
        ("contacts.A.side=left", ("contacts", "A", "side"), "left"),
    ],
)
def test_override(override: str, path: tuple[str, ...], value: object):
    found: object = loads(template_text("two-beams"), [override])
    for step in path:
        found = found[step] if isinstance(found, dict) else getattr(found, step)
    assert found == value
    assert type(found) is type(value)


def test_phases_by_number_and_by_name(bench: Case):
    text = template_text("two-beams")
    assert [phase.duration for phase in loads(text, ["phases.1.duration=0.01"]).phases] == [0.05, 0.01]
    assert loads(text, ["phases.slide.duration=0.01"]) == loads(text, ["phases.1.duration=0.01"])
    assert loads(text, ["phases=[]"]).phases[0].duration == 0.01
    assert loads(text, ["phases=[]", "phases.0.duration=0.02"]).phases[0].duration == 0.02
    assert bench.with_({"phases.0.ramp": 0.05}).phases[0].ramp == 0.05


def test_later_override_wins_and_entries_can_be_added():
    text = template_text("two-beams")
    case = loads(text, ["title=a", "title=b", 'loads.pull={ at = "beam2.end", force = [1, 0] }'])
    assert case.title == "b"
    assert case.loads["pull"].force == (1.0, 0.0)
    assert case.load_factors() == ({"press": 1.0, "pull": 1.0},) * 2


def test_copies(bench: Case):
    copy = bench.with_({"contacts.A.friction.coefficient": 0.3, "phases.0.duration": 1}, title="copy")
    assert copy.contacts["A"].friction.coefficient == 0.3
    assert (copy.title, copy.phases[0].duration) == ("copy", 1.0)
    assert bench.contacts["A"].friction.coefficient == 0.1
    assert bench.with_() == bench
    assert bench.with_({"temporal.step": None}).temporal.step is None
    with pytest.raises(CaseError, match=r"contacts\.A\.friction\.coefficient: -0\.3 – "):
        bench.with_({"contacts.A.friction.coefficient": -0.3})


def test_copies_take_numpy_numbers_and_tables(bench: Case):
    copy = bench.with_(
        {
            "contacts.A.friction.coefficient": np.float64(0.3),
            "bodies.beam1.elements": np.int64(12),
            "comparison.mu": np.array([0.1, 0.2]),
            "loads.press.force": (0.0, -1.0),
            "materials.steel": bench.materials["steel"],
        }
    )
    assert copy.comparison.mu == (0.1, 0.2)
    assert type(copy.contacts["A"].friction.coefficient) is float
    assert loads(copy.text) == copy


def test_cases_are_frozen(bench: Case):
    table: Any = bench
    told = 'a case is frozen; vary it by copy: case.with_({"title": …})'
    for refused in (lambda: setattr(table, "title", "other"), lambda: delattr(table, "title")):
        with pytest.raises(ValueError, match=f"^{re.escape(told)}$"):
            refused()
    told = 'a case is frozen; vary it by copy: case.with_({"contacts.A.friction.coefficient": 0.3})'
    with pytest.raises(TypeError, match=f"^{re.escape(told)}$"):
        table.contacts["A"].stiffness = 2.0
    assert bench.with_({"title": "other"}).title == "other"


@pytest.mark.parametrize("name", templates())
def test_what_a_case_holds_is_frozen_in_copies_too(name: str):
    case = loads(template_text(name))
    for kept in (case, pickle.loads(pickle.dumps(case)), copy.deepcopy(case), case.model_copy()):
        assert kept == case
        table: Any = kept.contacts
        name = next(iter(table))
        changes = {"update": ({"B": table[name]},), "pop": (name,), "__setitem__": (name, None), "__delitem__": (name,),
                   "__ior__": ({},), "setdefault": ("B", None), "clear": (), "popitem": ()}  # fmt: skip
        for method, given in changes.items():
            with pytest.raises(TypeError, match=r"a case is frozen; vary it by copy: case\.with_"):
                getattr(table, method)(*given)
        assert not set(map(type, held(kept))) & {dict, list, set}


def held(value: object) -> Iterator[object]:
    """Everything in a case, tables left to their defaults too."""
    yield value
    parts = vars(value).values() if isinstance(value, BaseModel) else value.values() if isinstance(value, dict) else ()
    for part in parts if not isinstance(value, tuple) else value:
        yield from held(part)


# -- the text ------------------------------------------------------------------------------------------------


def test_text_makes_the_same_case(bench: Case):
    assert loads(bench.text) == bench
    assert loads(bench.to_toml(defaults=True)) == bench
    assert "perturbation" not in bench.text
    assert tomllib.loads(bench.to_toml(defaults=True))["temporal"]["perturbation"] == 0.0
    assert loads(loads(bench.text).text).text == bench.text
    odd = bench.with_(title='quotes " and \\ and \x7f\nand μ')
    assert loads(odd.text) == odd


def test_cases_cross_processes(bench: Case):
    assert pickle.loads(pickle.dumps(bench)) == bench


def test_smallest_case_and_its_defaults():
    case = loads("""
        [materials.steel]
        young_modulus = 200e9
        density = 7800
        [bodies.rod]
        type = "beam"
        material = "steel"
        start = [0, 0]
        end = [1, 0]
        width = 0.01
        thickness = 0.01
        elements = 1
    """)
    assert (case.supports, case.loads, case.contacts) == ({}, {}, {})
    assert [phase.duration for phase in case.phases] == [0.01]
    assert case.materials["steel"].law_object() == Material(200e9, 7800.0, 0.3)
    assert isinstance(case.materials["steel"].density, float)
    assert case.load_factors() == ({},)
    assert (case.modal.modes, case.modal.friction_range, case.temporal.beta2) == (20, (0.0, 1.0), 0.5)


def test_schema_is_published_as_json_schema():
    assert set(Case.model_json_schema()["required"]) == {"bodies"}


# -- phases, warnings ----------------------------------------------------------------------------------------


def test_factors_hold_until_changed(bench: Case):
    phases = [
        {"name": "a", "duration": 1.0, "velocities": {"clamp": 0.0}},
        {"name": "b", "duration": 1.0, "loads": {"press": 2.0}},
        {"name": "c", "duration": 1.0, "velocities": {"clamp": -1.0}},
    ]
    case = bench.with_({"phases": phases})
    assert case.load_factors() == ({"press": 1.0}, {"press": 2.0}, {"press": 2.0})
    assert case.velocity_factors() == ({"clamp": 0.0}, {"clamp": 0.0}, {"clamp": -1.0})


@pytest.mark.parametrize(
    ("change", "warning"),
    [
        (
            {"materials.steel.young_modulus": 200},
            "materials.steel.young_modulus: 200 Pa is unusual for Young's modulus, usually 1e+06 to 1.3e+12 Pa; if 200 GPa is meant, write 2e+11",
        ),
        (
            {"materials.steel.density": 7.8e-9},
            "materials.steel.density: 7.8e-09 kg/m³ is unusual for a density, usually 10 to 25000 kg/m³; if 7.8e-09 t/mm³ is meant, write 7800",
        ),
        (
            {"bodies.beam1.thickness": 0.02},
            "bodies.beam1: only 2.5 times as long as thick; shear matters, and is neglected",
        ),
        ({"bodies.beam1.start": [0.1, 0.01]}, "contacts.A: beam1.tip starts 0.01 m off the line of beam2"),
        (
            {"contacts.A.friction.coefficient": 10},
            "contacts.A.friction.coefficient: 10 is unusual for a friction coefficient, usually at most 2; if 10 % is meant, write 0.1",
        ),
        (
            {"bodies.beam2.width": 1500},
            "bodies.beam2.width: 1500 m is unusual for a width, usually 1e-05 to 2 m; if 1500 mm is meant, write 1.5",
        ),
    ],
)
def test_values_that_are_probably_slips_are_warned_of(bench: Case, change: dict[str, object], warning: str):
    assert bench.with_(change).warnings == [warning]


# -- errors --------------------------------------------------------------------------------------------------


def test_a_case_error_keeps_all_its_problems_across_processes():
    problems = (Problem("a.b", 1, "must be 2"), Problem("c", None, "missing"))
    error = pickle.loads(pickle.dumps(CaseError.many(problems)))
    assert isinstance(error, CaseError)
    assert error.problems == problems
    assert str(error) == "a.b: 1 – must be 2\nc: missing"
    with pytest.raises(ValueError, match="at least one problem"):
        CaseError.many([])


def test_values_are_shown_as_written_in_a_case_file():
    assert shown({"a": [True, 1e-8, "x\ny"]}) == "{ a = [true, 1e-08, 'x\\ny'] }"
    assert len(shown("x" * 1000)) == 60


# -- laws ----------------------------------------------------------------------------------------------------


def test_section_and_damping():
    section = RectangularSection(width=0.01, thickness=0.0015)
    assert section.area == pytest.approx(1.5e-5, rel=1e-14)
    assert section.second_moment == pytest.approx(2.8125e-12, rel=1e-14, abs=0.0)
    # The paper names 0.073 % at 8.7 kHz and 0.104 % at 28.8 kHz.
    damping = Rayleigh(mass=50.0, stiffness=1e-8)
    assert damping.damping_ratio(2 * math.pi * 8700) == pytest.approx(0.00073, abs=5e-6)
    assert damping.damping_ratio(2 * math.pi * 28800) == pytest.approx(0.00104, abs=5e-6)


LAWS = [
    Coulomb(0.3),
    StaticKinetic(0.3, 0.4),
    Weakening(0.2, 0.5, 0.05),
    Hyperbolic(0.2, 0.5, 30.0),
    Tabulated((0.0, 0.01, 0.1), (0.5, 0.4, 0.2)),
    Tabulated((0.0, 0.01, 0.1, 0.4), (0.5, 0.4, 0.2, 0.3), "monotone-cubic", 0.6),
]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("speed", [1e-3, 0.02, 0.3, -0.02])
def test_slope_is_the_derivative(law: FrictionLaw, speed: float):
    step = 1e-7
    difference = (law.sliding(abs(speed) + step) - law.sliding(abs(speed) - step)) / (2 * step)
    assert law.slope(speed) == pytest.approx(difference, rel=1e-6, abs=1e-9)
    assert law.sliding(speed) == law.sliding(-speed)


def test_cubic_pieces_of_a_table_are_those_of_pchip():
    """Values and slopes of SciPy's interpolant at any points, and straight lines of NumPy's; constant beyond the ends."""
    rng = np.random.default_rng(3)
    for _ in range(100):
        n = rng.integers(2, 8)
        speeds = np.cumsum(0.05 + rng.random(n)) - 0.05
        coefficients = rng.random(n)
        cubic = Tabulated(tuple(speeds), tuple(coefficients), "monotone-cubic")
        reference = PchipInterpolator(speeds, coefficients)
        between = np.linspace(speeds[0], speeds[-1], 23)[1:-1]
        assert [cubic.sliding(v) for v in between] == pytest.approx(reference(between), abs=1e-13)
        assert [cubic.slope(v) for v in between] == pytest.approx(reference(between, 1), abs=1e-11)
        anywhere = [0.0, *between, *speeds, speeds[-1] + 1.0]
        straight = Tabulated(tuple(speeds), tuple(coefficients))
        assert [straight.sliding(v) for v in anywhere] == pytest.approx(np.interp(anywhere, speeds, coefficients))
        assert cubic.sliding(speeds[-1] + 1.0) == coefficients[-1]
        assert cubic.slope(speeds[-1] + 1.0) == straight.slope(speeds[-1] + 1.0) == 0.0


def test_slopes_of_a_table_at_its_points():
    """The mean of both sides where pieces meet; at rest that towards higher speeds; half at the ends."""
    law = Tabulated((0.0, 1.0, 2.0), (0.5, 0.3, 0.4))
    assert [law.slope(v) for v in (0.0, 1.0, 2.0)] == pytest.approx([-0.2, -0.05, 0.05])
    late = Tabulated((0.5, 1.0), (0.5, 0.3), "monotone-cubic")
    assert [late.slope(v) for v in (0.2, 0.5, 0.7, 1.0)] == pytest.approx([0.0, -0.2, -0.4, -0.2])
    assert late.sticking == late.sliding(0.0) == 0.5
    assert Tabulated((0.0, 1.0), (0.3, 0.2), static_coefficient=0.4).sticking == 0.4


def test_weakening_runs_from_static_to_sliding():
    law = Weakening(0.2, 0.5, 0.05)
    assert law.sticking == law.sliding(0.0) == 0.5
    assert law.sliding(0.05) == pytest.approx(0.2 + 0.3 / math.e)
    assert law.sliding(1e3) == 0.2
    assert law.slope(0.0) == pytest.approx(-6.0)
    assert (Coulomb(0.3).sticking, StaticKinetic(0.3, 0.4).sticking) == (0.3, 0.4)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("speed", [0.0, 0.02])
@pytest.mark.parametrize("mu", [0.0, 0.1, 1.0])
def test_scaled_laws_have_the_friction_asked_for_and_keep_their_shape(
    law: FrictionLaw, speed: float, mu: float
):
    scaled = law.scaled(mu, speed)
    assert type(scaled) is type(law)
    assert scaled.sliding(speed) == pytest.approx(mu, rel=1e-14)
    assert scaled.sticking * law.sliding(speed) == pytest.approx(law.sticking * mu, rel=1e-14)


def test_scaling_a_law_that_is_zero():
    assert StaticKinetic(0.0, 0.0).scaled(0.2, 0.02) == Coulomb(0.2)
    assert Weakening(0.0, 0.0, 0.05).scaled(0.2, 0.02) == Coulomb(0.2)
    assert StaticKinetic(0.0, 0.1).scaled(0.2, 0.02) == StaticKinetic(0.2, 0.2)
    assert Tabulated((0.0, 1.0), (0.0, 0.0)).scaled(0.2, 0.02) == Coulomb(0.2)
    assert Tabulated((0.0, 1.0), (0.5, 0.0)).scaled(0.2, 2.0) == StaticKinetic(0.2, 0.5)
    assert Weakening(0.0, 0.5, 1e-5).scaled(0.2, 1.0) == Weakening(0.2, 0.5, 1e-5)


# -- made in Python ------------------------------------------------------------------------------------------


def test_case_of_tables_is_that_of_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bench: Case):
    monkeypatch.chdir(tmp_path)
    rod = {"type": "beam", "material": "steel", "start": np.zeros(2), "end": (1, 0), "width": 0.01, "thickness": 0.01}
    steel = {"steel": bench.materials["steel"]}
    case = Case(materials=steel, bodies={"rod": {**rod, "elements": np.int64(4), "angle_deg": None}}, modal=None)
    assert (case.bodies["rod"].elements, case.materials) == (4, steel)
    assert loads(case.to_toml()) == case
    short = Case(matrices=[{"file": Path("m.mtx"), "role": "mass"}])
    assert short == loads('[[matrices]]\nfile = "m.mtx"\nrole = "mass"')
    assert short.with_({"bodies.matrices.terms.0.file": "k.mtx"}).bodies["matrices"].terms[0].file == str(tmp_path / "k.mtx")
    monkeypatch.chdir("/")
    assert loads(short.to_toml()) == short


def test_tables_that_no_file_could_hold():
    within: dict[str, object] = {}
    within["a"] = within
    for tables, told in (
        ({}, "bodies: missing – give tables [bodies.NAME], at least one"),
        ({"bodies": {1: {}}}, "bodies: 1 – a key of a table must be a text"),
        ({"bodies": {"rod": {None: 1}}}, "bodies.rod: a key of a table must be a text"),
        ({"bodies": within}, f"bodies{'.a' * 20}: nested too deeply; at most 20 tables or lists in each other"),
        ({"matrices": 3}, "matrices: 3 – must be a table with a list of terms, or that list, [[matrices]]"),
        ({"bodies": [1]}, "bodies: [1] – must be tables [bodies.NAME], at least one"),
    ):
        with pytest.raises(CaseError) as error:
            Case(**tables)
        assert str(error.value) == told
