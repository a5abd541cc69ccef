"""A ring on a shaft whose meshes do not match: facets decide what touches, and the user is told what helps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stridor as st
from stridor.agreement import Agreement
from stridor.app import cli
from stridor.study import analyses
from stridor.system import build_system

pytestmark = pytest.mark.verification


def ring(inner: str, around: int, shaft: int, adjust: float = 0.0) -> st.Case:
    """A ring of 30 and 50 mm, pressed on a shaft of its own radius by 1 MPa from outside."""

    def annulus(name: str, radii: tuple[float, float], cells: str, count: int) -> str:
        return f"""
[bodies.{name}]
type = "solid"
model = "plane stress"
thickness = 0.01
material = "steel"
mesh = {{ shape = "annulus", inner_radius = {radii[0]}, outer_radius = {radii[1]}, divisions = [1, {count}], cells = "{cells}" }}
"""

    springs = "".join(
        f"""
[springs.{name}]
between = ["ring.{name}", "ground"]
direction = {direction}
stiffness = 1e7
"""
        for name, direction in (("right", [0, 1]), ("left", [0, 1]), ("top", [1, 0]))
    )
    return st.loads(f"""
materials.steel = {{ young_modulus = 2e11, density = 7800.0, poisson_ratio = 0.3 }}
{annulus("ring", (0.03, 0.05), inner, around)}
points = {{ right = [0.05, 0.0], left = [-0.05, 0.0], top = [0.0, 0.05] }}
{annulus("shaft", (0.01, 0.03), "quad8", shaft)}
sliding = {{ spin = 10.0 }}
[supports.hub]
at = "shaft.inner"
fixed = ["x", "y"]
{springs}
[loads.press]
at = "ring.outer"
pressure = 1e6
[contacts.bore]
slave = "ring.inner"
master = "shaft.outer"
stiffness = 1e13
adjust = {adjust}
friction = {{ law = "coulomb", coefficient = 0.0 }}
""")


def evenness(case: st.Case) -> tuple[float, tuple[str, ...]]:
    """Largest pressure over the mean, and what is warned of."""
    found = st.steady_sliding(case)
    pressure = found.normal_force / build_system(case).contact_nodes().area
    return float(pressure.max() / np.mean(pressure)), found.warnings


@pytest.mark.parametrize(("cells", "around", "shaft"), [("triangle6", 12, 16), ("quad8", 13, 10)])
def test_meshes_that_decide_what_touches_are_told(cells: str, around: int, shaft: int) -> None:
    uneven, warnings = evenness(ring(cells, around, shaft))
    assert uneven > 2.0
    (said,) = warnings
    assert "by no more than facets leave of curved surfaces" in said
    adjust = float(said.rsplit("= ", 1)[1])
    mended, warnings = evenness(ring(cells, around, shaft, adjust))
    assert mended < 1.2
    assert warnings == ()


def test_matching_meshes_are_not() -> None:
    even, warnings = evenness(ring("quad8", 12, 12))
    assert even < 1.2
    assert warnings == ()


def test_every_verb_tells_that_meshes_decide(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    case = ring("quad8", 13, 10).with_({"modal.max_frequency_hz": 3e3, "phases": [{"name": "a", "duration": 1e-6}]})
    told = "so that the meshes decide what touches; let the nodes of both sides match"
    (checked,) = [w for w in st.describe(case).warnings if told in w]
    assert st.modes(case, 0.1).notes.count(checked) == 1
    assert st.onsets(case, (0.0, 0.1)).notes.count(checked) == 1
    monkeypatch.setattr(analyses, "compare_system", lambda *_, **__: Agreement((), None, None, None, "not decided: "))
    assert st.compare(case, [0.0, 0.1]).notes == (checked,)
    path = tmp_path / "ring.toml"
    path.write_text(case.to_toml(), encoding="utf-8")
    monkeypatch.setattr("sys.argv", ["stridor", "simulate", str(path)])
    with pytest.raises(SystemExit):
        cli.main()
    assert capsys.readouterr().err.replace("\n", " ").count("meshes decide what touches") == 1
    assert not st.modes(ring("quad8", 12, 12).with_({"modal.max_frequency_hz": 3e3}), 0.1).notes


@pytest.mark.parametrize("stiffness", [1e13, "rigid"])
def test_gaps_that_facets_leave_everywhere_are_named(stiffness: float | str) -> None:
    """Nodes of linear edges lie on the quadratic ones: between them there are gaps, and no load pulls."""
    changes = {"bodies.shaft.mesh.cells": "quad", "contacts.bore.stiffness": stiffness}
    with pytest.raises(st.AnalysisError) as error:
        st.steady_sliding(ring("quad8", 12, 24).with_(changes), 0.05)
    assert "at μ = 0.05 (contacts: bore): the facets of the curved surfaces of contact bore leave gaps" in str(error.value)
    assert "loads pull" not in str(error.value)
    adjust = float(str(error.value).rsplit("= ", 1)[1])
    assert evenness(ring("quad8", 12, 24, adjust).with_(changes))[0] < 1.05


@pytest.mark.parametrize(
    ("interference", "words"),
    [(2e-6, "an interference of 2e-06 m is pressed out"), (-2e-6, "a negative interference, a gap of 2e-06 m beside")],
)
def test_an_interference_is_described_as_what_it_is(interference: float, words: str) -> None:
    case = ring("quad8", 12, 12).with_({"contacts.bore.interference": interference, "loads.press.pressure": 1e9})
    assert any(words in line for line in st.describe(case).lines)
