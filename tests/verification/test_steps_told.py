"""Explicit steps that are few to the period of the highest frequency asked for are told, where they hide what grows."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest

import stridor as st
from mode_coupling import mode_coupling
from random_contacts import pressed_frame
from stridor.app.show import show_run
from stridor.study.description import describe
from stridor.system import build_system
from stridor.temporal.highest import highest_hz
from stridor.temporal.settings import Settings, coarse

pytestmark = pytest.mark.verification

# A pad whose mode at 17 066 Hz flutters, with damping proportional to stiffness.
PAD = """units = "SI"
[materials.a]
young_modulus = 4463251544.160382
density = 2000.0
poisson_ratio = 0.3
[bodies.pad]
type = "solid"
material = "a"
model = "plane strain"
thickness = 0.01
mesh = { shape = "rectangle", corner = [0.03, 0.0], size = [0.04, 0.02], divisions = [3, 1], cells = "quad" }
damping = { mass = 47.659, stiffness = 4.31959e-07 }
points = { c1 = [0.03, 0.02], c2 = [0.07, 0.02] }
[bodies.d]
type = "obstacle"
shape = "flat"
point = [0.0, 0.0]
normal = [0.0, 1.0]
sliding = { velocity = [-1.337016465937202, 0.0] }
[supports.hold]
at = "pad.top"
fixed = ["x"]
[loads.p]
at = "pad.top"
pressure = 576655.022262992
[contacts.c]
slave = "pad.bottom"
master = "d"
stiffness = 293889970946.3031
friction = { law = "coulomb", coefficient = 0.4250961267006048 }
[springs.s1]
between = ["pad.c1", "ground"]
stiffness = 8478738.651027223
direction = [0.0, 1.0]
[springs.s2]
between = ["pad.c2", "ground"]
stiffness = 6648174.115672303
direction = [0.0, 1.0]
[dashpots.q]
between = ["pad.c2", "ground"]
damping = 3.549946072115026
direction = [0.0, 1.0]
[modal]
max_frequency_hz = 30000.0
modes = 100
[temporal]
initial = "steady-sliding"
perturbation = 0.001
watch = ["pad.c1"]
[[phases]]
name = "run"
duration = 0.01
"""


def test_a_step_that_hides_growth_is_told_and_the_one_named_shows_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = st.loads(PAD)
    modes = st.modes(case).eigenvalues[0]
    growing = modes[modes.real > 1.0]
    assert growing.real == pytest.approx([2296.2], rel=1e-3)
    run = st.simulate(case)
    (told,) = (said for said in run.path_reason.split("; ") if "to the period of" in said)
    assert told.startswith(f"steps of {run.step:.3g} s are 4.3 to the period of modal.max_frequency_hz = 30000 Hz: ")
    assert "temporal.step = 4.1e-07 takes 80 or more" in told
    assert run.remarks[0] == told
    assert len(run.remarks) == 2
    assert st.open(st.save(run, tmp_path / "run.nc")).remarks == run.remarks
    speed = np.linalg.norm(run.velocity[:, 0], axis=1)
    assert speed[-10:].max() < 0.1 * speed[:10].max()  # what should have grown by e²² has decayed
    show_run(st.summarise(case, run).to_json())
    shown = " ".join(capsys.readouterr().out.split())
    assert "to the period of modal.max_frequency_hz" in shown
    assert "do not resolve 30000 Hz; " in shown  # of the records
    resolved = case.with_({"temporal.step": 4.1e-7})
    again = st.simulate(resolved)
    assert "to the period of" not in again.path_reason
    assert st.summarise(resolved, again).growth_rate == pytest.approx(growing.real[0], rel=0.01)
    assert told in describe(case).lines
    assert not any("to the period of modal" in said for said in describe(resolved).lines)


def test_only_explicit_steps_that_are_few_are_told() -> None:
    asked = Settings(max_frequency_hz=1000.0)
    assert coarse(1 / 40_000, asked, "nodal") == ""
    assert "temporal.step = 1.2e-05 takes" in coarse(1 / 39_000, asked, "assembled")
    assert "are 39 to the period" in coarse(1 / 39_000, asked, "modal")
    assert coarse(1e-3, asked, "exact") == coarse(1e-3, asked, "implicit") == coarse(1e-3, Settings(), "nodal") == ""
    for highest in np.geomspace(1e-3, 1e6, 40):
        words = coarse(0.1 / highest, Settings(max_frequency_hz=float(highest)), "nodal")
        step = float(words.partition("temporal.step = ")[2].split()[0])
        assert 80.0 * (1 - 1e-9) <= 1.0 / (step * highest) < 90.0


def test_steps_are_not_told_of_modes_that_no_system_of_these_masses_has(capsys: pytest.CaptureFixture[str]) -> None:
    """Modes of the minimal model lie up to 0.28 Hz, and its default step is 80 to the period of the highest one."""
    case = mode_coupling(damping=0.02).with_(
        {"temporal.stepper": "explicit", "temporal.step": None, "temporal.perturbation": 1e-3}
    )
    run = st.simulate(case)
    assert run.step * 1.0 * 40 > 1.0  # few to the period of modal.max_frequency_hz
    assert run.remarks == ()
    assert not any("to the period of modal" in said for said in describe(case).lines)
    system, asked = build_system(case), Settings(max_frequency_hz=1.0)
    top = highest_hz(system)
    assert coarse(1 / (41 * top), asked, "assembled", system) == ""
    assert coarse(1 / (39 * top), asked, "assembled", system)
    # A stiff contact has modes above those of the springs that the step is of.
    stiff = case.with_({"contacts.rub.stiffness": 100.0})
    assert any("to the period of modal" in said for said in st.simulate(stiff).remarks)
    assert highest_hz(build_system(case.with_({"contacts.rub.stiffness": "rigid"}))) == np.inf


@pytest.mark.parametrize("seed", range(12))
def test_no_mode_lies_above_the_highest_there_can_be(seed: int) -> None:
    mu = 0.1 * (1 + seed % 8)
    system = pressed_frame(seed, mu, rigid=False, damping=0.05 * (seed % 3))
    nodes, n = system.contact_nodes(), system.size
    mass, damping, stiffness = (m.toarray() for m in (system.mass, system.damping, system.stiffness))
    top, highest = highest_hz(system), 0.0
    for closed in product((0.0, 1.0), repeat=nodes.count):
        for sense in product((-1.0, 1.0), repeat=nodes.count):
            push = nodes.normal.toarray() + mu * np.array(sense)[:, None] * nodes.tangent.toarray()
            springs = push.T @ np.diag(np.array(closed) / nodes.compliance) @ nodes.normal.toarray()
            a = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(mass, stiffness + springs),
                                                          -np.linalg.solve(mass, damping)]])  # fmt: skip
            highest = max(highest, float(np.abs(np.linalg.eigvals(a)).max()) / (2 * np.pi))
    assert highest <= top < 3 * highest


def test_a_run_without_contacts_shows_no_table_of_contacts(capsys: pytest.CaptureFixture[str]) -> None:
    rod = """
    materials.steel = { young_modulus = 2.0e11, density = 7800.0, poisson_ratio = 0.3 }
    supports.clamp = { at = "a.start", fixed = ["x", "y", "rotation"] }
    loads.push = { at = "a.end", force = [0.0, -1.0] }
    phases = [{ name = "run", duration = 1e-4, loads = { push = 1.0 } }]
    temporal.watch = ["a.end"]
    [bodies.a]
    type = "beam"
    material = "steel"
    start = [0.0, 0.0]
    angle_deg = 0.0
    length = 0.1
    width = 0.01
    thickness = 0.01
    elements = 2
    """
    case = st.loads(rod)
    show_run(st.summarise(case, st.simulate(case)).to_json())
    shown = capsys.readouterr().out
    assert "contact" not in shown
    assert "steps of" in shown
