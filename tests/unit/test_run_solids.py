"""Every analysis of a small case of solids, from case file to report, as `stridor run` does it; the other verbs."""

from __future__ import annotations

import functools
import json
from pathlib import Path

import numpy as np
import pytest

import stridor as st
from counted import Counts
from program import stridor
from rubbing_block import rubbing_block
from stridor.view import animation
from undrawn import drawn_alone

BLOCK = rubbing_block(
    "friction_range = [0.0, 0.6]\nmax_frequency_hz = 15e3\nsweep_points = 3",
    title="a block on a moving slider",
    more="""
[[phases]]
name = "slide"
duration = 5e-4
[temporal]
initial = "steady-sliding"
perturbation = 1e-3
watch = ["block.crown"]
[comparison]
critical = false
""",
)

COARSER = {"bodies.block.mesh.divisions": [2, 2], "bodies.slider.mesh.divisions": [6, 1]}


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("solids") / "block.toml"
    path.write_text(st.loads(BLOCK).with_(COARSER).text, encoding="utf-8")
    return path


def test_everything_ends_in_a_report(case: Path, monkeypatch: pytest.MonkeyPatch):
    counts = Counts(monkeypatch)
    looked_at = ("mesh", "mode", "friction-energy", "pressure-face", "status-face")
    with drawn_alone(*looked_at):
        outcome = st.run(st.load(case), case.parent / "out")
    counts.check()
    page = outcome.report.read_text(encoding="utf-8")
    for name in looked_at:
        assert f'id="figure-{name}"' in page, name
        assert (outcome.report.parent / "figures" / f"{name}.png").stat().st_size > 5000
    assert outcome.everything.agreement is not None
    assert outcome.everything.agreement.verdict.startswith("agree")
    assert outcome.everything.summary.energy.error < 1e-9
    again = st.open(outcome.report.parent / "simulate.nc")
    assert again.nodes is not None
    assert (again.nodes.normal_force == outcome.everything.run.nodes.normal_force).all()


def test_steady_and_shapes_write_pictures_and_files(case: Path, monkeypatch: pytest.MonkeyPatch):
    # The frames of a whole cycle are counted where one is made.
    monkeypatch.setattr(animation, "animation_gif", functools.partial(animation.animation_gif, frames=3))
    done = stridor("steady", case.name, "--json", cwd=case.parent)
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    # 0.02 m × 1 m × 1e5 Pa, and 0.4 of it along the slider.
    assert document["contacts"]["face"]["force"] == pytest.approx([800.0, 2000.0], rel=1e-6)
    done = stridor("shapes", case.name, "--branch", "1", "--gif", "--json", cwd=case.parent)
    assert done.returncode == 0, done.stderr
    files = [case.parent / f for f in json.loads(done.stdout)["modes"][0]["files"]]
    assert {f.suffix for f in files} == {".png", ".html", ".gif", ".vtu"}
    assert all(f.stat().st_size > 500 for f in files)
    done = stridor("shapes", case.name, "--branch", "999", cwd=case.parent)
    assert done.returncode == 2
    assert "--branch: 999" in done.stderr


@pytest.mark.slow
def test_a_slider_that_really_moves_carries_the_block_over_its_elements():
    text = BLOCK.replace("sliding = { velocity = [1.0, 0.0] }\n", "")
    text = text.replace('fixed = ["x", "y"]', 'fixed = ["x", "y"]\nvelocity = { x = 2.0 }')
    text = text.replace("friction = {", 'sliding = "finite"\nfriction = {')
    text = text.replace("duration = 5e-4", "duration = 2e-3").replace("perturbation = 1e-3\n", "")
    case = st.loads(text)
    run = st.simulate(case)
    # 4 mm on: the pressure on the slider has moved with the block, its resultant is the load as before.
    assert run.normal_force[:, 0] == pytest.approx(2000.0, rel=0.02)
    assert run.slip_speed[:, 0] == pytest.approx(run.slip_speed[0, 0], rel=0.05)
    assert run.unconverged_steps == 0
    assert st.summarise(case, run).energy.error < 1e-9


IN_SPACE = """
materials.steel = { young_modulus = 200e9, density = 7800.0, poisson_ratio = 0.3 }
materials.pad = { young_modulus = 2e9, density = 2000.0, poisson_ratio = 0.3 }
[bodies.slider]
type = "solid"
model = "3d"
material = "steel"
mesh = { shape = "block", corner = [-0.05, -0.02, -0.01], size = [0.1, 0.04, 0.01], divisions = [10, 4, 1], cells = "hexahedron" }
damping = { mass = 20.0, stiffness = 1e-8 }
[bodies.block]
type = "solid"
model = "3d"
material = "pad"
mesh = { shape = "block", corner = [-0.011, -0.011, 0.0], size = [0.022, 0.022, 0.01], divisions = [4, 4, 2], cells = "hexahedron" }
damping = { mass = 20.0, stiffness = 1e-8 }
[supports.ground]
at = "slider.bottom"
fixed = ["x", "y", "z"]
velocity = { x = 2.0, y = 0.5 }
[supports.holder]
at = "block.top"
fixed = ["x", "y"]
[loads.press]
at = "block.top"
pressure = 1e5
[contacts.face]
slave = "block.bottom"
master = "slider.top"
stiffness = "rigid"
sliding = "finite"
friction = { law = "coulomb", coefficient = 0.2 }
[[phases]]
name = "slide"
duration = 2e-3
[temporal]
initial = "steady-sliding"
[modal]
max_frequency_hz = 15e3
"""


@pytest.mark.slow
def test_a_block_slides_over_facets_in_space():
    case = st.loads(IN_SPACE)
    run = st.simulate(case)
    weight = 1e5 * 0.022**2
    # Rigid contact, 4 mm along and 1 mm across: slave nodes pass from facet to facet and nothing is felt of it.
    assert run.normal_force[:, 0] == pytest.approx(weight, rel=1e-4)
    assert run.tangential_force[:, 0] == pytest.approx(-0.2 * weight, rel=1e-4)
    assert run.slip_speed[:, 0] == pytest.approx(np.hypot(2.0, 0.5), rel=1e-4)
    assert run.unconverged_steps == 0
    assert st.summarise(case, run).energy.error < 1e-9
