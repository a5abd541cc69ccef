"""Limit cycles by harmonic balance over a surface: processor time for a point of a branch, with 45 contact nodes in
space and 7 harmonics; and a block on a slider, whose cycle explicit steps come to as well.

python benchmarks/harmonic_balance.py [--short]   (--short: the branch alone, two points)
"""

from __future__ import annotations

import time

import numpy as np

import stridor as st
from _common import COARSE, machine, options
from stridor.case import template_text
from stridor.periodic import follow
from stridor.periodic.harmonic import Balanced, HarmonicBranch, HarmonicFamily, born, defect

HARMONICS, POINTS, MOST_SECONDS = 7, 8, 5.0
BLOCK = """
title = "a block on a slider"
materials.steel = { young_modulus = 200e9, density = 7800.0, poisson_ratio = 0.3 }
[bodies.block]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.03
mesh = { shape = "rectangle", corner = [-0.05, 0.0], size = [0.1, 0.04], divisions = [10, 4], cells = "quad" }
mass = "lumped"
damping = { mass = 20.0, stiffness = 2e-7 }
points = { held = [0.0, 0.04] }
[bodies.slider]
type = "solid"
material = "steel"
model = "plane stress"
thickness = 0.03
mesh = { shape = "rectangle", corner = [-0.1, -0.03], size = [0.2, 0.03], divisions = [17, 3], cells = "quad" }
mass = "lumped"
damping = { mass = 20.0, stiffness = 2e-7 }
sliding = { velocity = [1.0, 0.0] }
[supports.ground]
at = "slider.bottom"
fixed = ["x", "y"]
[springs.hold]
between = ["block.held", "ground"]
direction = [1.0, 0.0]
stiffness = 1e7
[loads.press]
at = "block.top"
force = [0.0, -1000.0]
[contacts.rub]
slave = "block.bottom"
master = "slider.top"
stiffness = 1e13
friction = { law = "coulomb", coefficient = 0.1 }
[[phases]]
name = "slide"
duration = 0.02
[modal]
friction_range = [0.0, 0.5]
max_frequency_hz = 25000.0
[temporal]
initial = "steady-sliding"
perturbation = 0.01
record_every = 4
watch = ["block.held"]
"""


def pad(points: int) -> float:
    """Seconds of the processor for each of some points of the branch of the coarse pad on a disc."""
    work = st.Workspace(st.loads(template_text("pad-on-disc")).with_(COARSE))
    onset = st.onsets(work, (0.0, 1.0)).onsets[0]
    family = HarmonicFamily(work.system(), onset.frequency_hz)
    branch = HarmonicBranch((0.0, 1.0))
    first, heading = born(family, branch, onset.mu, onset.frequency_hz, HARMONICS)
    met = [first]

    def seen(cycle: Balanced, /, *, fold: bool) -> bool:
        met.append(cycle)
        return True

    started = time.process_time()
    follow(branch, first, heading, seen, points)
    each = (time.process_time() - started) / (len(met) - 1)
    print(
        f"pad on disc: {family.system.size} freedoms, {family.count} contact nodes in space, {HARMONICS} harmonics, "
        f"{first.at.z.size} unknowns: {each:.2f} s of one core a point; μ = {met[0].mu:.5f} to {met[-1].mu:.5f}, "
        f"residual up to {max(c.residual for c in met):.1e}, defect up to {max(defect(c) for c in met):.1e}"
    )
    assert each < MOST_SECONDS
    return each


def block() -> None:
    """The cycle of the block, and what an explicit run ends in."""
    work = st.Workspace(st.loads(BLOCK))
    started = time.process_time()
    (cycle,) = st.cycles(work, 0.1, method="harmonic", harmonics=16).cycles
    balanced = time.process_time() - started
    started = time.process_time()
    run = st.simulate(work, mu=0.1)
    marched = time.process_time() - started
    last = run.time > 0.75 * run.time[-1]
    speed, at = run.velocity[last, 0, 1], run.time[last]
    middle = speed.mean()
    up = np.flatnonzero((speed[:-1] < middle) & (speed[1:] >= middle))
    passed = at[up] + (middle - speed[up]) / (speed[up + 1] - speed[up]) * (at[1] - at[0])
    frequency = (len(passed) - 1) / (passed[-1] - passed[0])
    own = 1e3 * cycle.amplitude("velocity")["block.held"][1]
    print(
        f"block on a slider: {work.system().size} freedoms, {len(cycle.contact_names)} nodes, {cycle.harmonics} "
        f"harmonics, {balanced:.1f} s for the branch: {cycle.frequency_hz:.1f} Hz, {own:.3f} mm/s; explicit steps, "
        f"{marched:.1f} s: {frequency:.1f} Hz, {1e3 * 0.5 * np.ptp(speed):.3f} mm/s"
    )


if __name__ == "__main__":
    asked = options(__doc__ or "")
    print(machine())
    pad(2 if asked.short else POINTS)
    if not asked.short:
        block()
