"""Print the tables on solids of docs/validation.md: what must come out, what does, and by how much they differ.

    python benchmarks/validation_solids.py [--short]

Cases and what is put into or taken out of the bench are those of the tests. A few minutes; --short leaves out the
finest meshes and takes half a minute.
"""

from __future__ import annotations

import math
import sys
import tempfile
from pathlib import Path

import numpy as np

import stridor as st
from _common import options
from stridor.modal.onsets import Onset
from stridor.system import System

TESTS = Path(__file__).resolve().parents[1] / "tests"
sys.path[:0] = [str(TESTS), str(TESTS / "validation")]

import test_solid_bench as bench  # noqa: E402
from test_published_solids import HERTZ, timoshenko  # noqa: E402

import solid_cases as cases  # noqa: E402


def row(what: str, expected: float, computed: float, unit: str = "", digits: int = 5) -> None:
    """One line of the first table."""
    unit = f" {unit}" if unit else ""
    difference = 100 * (computed / expected - 1)
    print(f"| {what} | {expected:.{digits}g}{unit} | {computed:.{digits}g}{unit} | {difference:+.3f} % |")


def frequencies(*, fine: bool) -> None:
    """Natural frequencies."""
    found = st.body_modes(cases.case(cases.FV32))["membrane"].frequency_hz
    for k, published in ((0, 44.62), (5, 391.4)):
        row(f"NAFEMS FV32, tapered membrane, frequency {k + 1}", published, found[k], "Hz")
    divisions = (24, 24, 4) if fine else (12, 12, 2)
    found = st.body_modes(cases.case(cases.plate(divisions)), max_frequency_hz=210.0)["plate"].frequency_hz[3:]
    name = " × ".join(map(str, divisions))
    for k, published in ((0, 44.18), (3, 163.15), (4, 193.66), (5, 203.30)):
        row(f"plate 10 × 10 × 1, {name} hexahedron20, frequency {k + 1}", published, found[k], "Hz")
    euler = np.array([16.7638, 105.057, 294.163])
    for model, number in (("beam", 1), ("plane stress", 1), ("3d", 2)):
        found = st.body_modes(cases.case(cases.cantilever(model)))["bar"].frequency_hz[::number]
        for k in (0, 2):
            sheared = timoshenko(float(euler[k]), 0.3)
            theory, value = ("Euler–Bernoulli", euler[k]) if model == "beam" else ("Timoshenko, ν = 0.3", sheared)
            row(f"cantilever 50 : 1, {model}, frequency {k + 1}, {theory}", value, found[k], "Hz", 6)
    found = st.body_modes(cases.case(cases.cantilever("plane stress", 0.0)))["bar"].frequency_hz
    row("cantilever 50 : 1, plane stress, frequency 3, Timoshenko, ν = 0", 292.884, found[2], "Hz", 6)


def contact(folder: Path, *, fine: bool) -> None:
    """Pressure, statics and impacts."""
    for size, ratio, quadratic, stiffness in (
        (1.0, 0.9, False, "rigid"),
        *([(0.5, 0.9, False, "rigid"), (0.25, 0.9, False, "rigid")] if fine else []),
        (1.0, 1.0, True, "rigid"),
        (1.0, 1.0, True, 1e15),
    ):
        text = cases.hertz(folder / "hertz.inp", size, quadratic=quadratic, ratio=ratio, stiffness=stiffness)
        found = cases.hertz_found(cases.case(text))
        kind = "CPE8, matching" if quadratic else "CPE4, not matching"
        name = f"Hertz, {kind}, {size:g} mm, {stiffness if isinstance(stiffness, str) else f'{stiffness:g} N/m³'}"
        row(f"{name}: a", 1e3 * HERTZ[0], 1e3 * found[0], "mm")
        row(f"{name}: p₀", 1e-6 * HERTZ[1], 1e-6 * found[1], "MPa")
    model = cases.case(cases.ring((3, 36)))
    found, system = st.steady_sliding(model), st.build_system(model)
    part = 0.7 / 1.3
    total = 2 * math.pi * 0.03 * 0.01 * 1e6 * 2 / 1.3 / (1 + part * 0.36)
    row("ring on a shaft, sum of normal forces, Lamé", total, found.normal_force.sum(), "N", 7)
    up, down = (system.points[f"ring.{at}"].free[1] @ found.displacement for at in ("right", "left"))
    friction = 0.3 * 0.03 * found.normal_force.sum()
    row("… torque in its springs against μ R ΣN", friction, 1e7 * 0.05 * (up - down), "N m", 9)
    for space in (False, True):
        model = cases.case(cases.slider(space=space))
        nodes, found = st.build_system(model).contact_nodes(), st.steady_sliding(model)
        arm = np.sum(nodes.position[:, 0] * found.normal_force) / found.normal_force.sum()
        row(f"block on a slider, {'3d' if space else 'plane'}, shift of its pressure, −μh", -8.0, 1e3 * arm, "mm", 8)


def impacts() -> None:
    """Bars that strike."""
    for name, text, times, force in (
        ("SDNV100", cases.WALL, (20e-6, 100e-6), 4e9 * 0.02**2),
        ("Doyen et al.", cases.DOYEN, (0.5, 0.5 + 2 / 3), 150.0),
        ("Carpenter et al.", cases.RODS, (0.0, 98.658e-6), 14961.4 * 4.4482216),
    ):
        run = st.simulate(cases.case(text))
        touching = run.time[run.normal_force[:, 0] > 0]
        row(f"{name}, duration of contact", times[1] - times[0], touching[-1] - touching[0], "s")
        edge = 0.1 * (times[1] - times[0])
        during = (run.time > times[0] + edge) & (run.time < times[1] - edge)
        row(f"{name}, mean force", force, run.normal_force[during, 0].mean(), "N")


def evenness() -> None:
    """Two blocks under even pressure with meshes that do not match."""
    print("\n| elements above and below | contact | least nodal pressure | largest |")
    print("|---|---|---|---|")
    for cells, upper, lower, stiffness in (
        ("quad", 10, 10, "rigid"),
        ("quad", 10, 9, "rigid"),
        ("quad", 20, 9, "rigid"),
        ("quad8", 10, 10, "rigid"),
        ("quad8", 10, 9, "rigid"),
        ("quad8", 10, 9, 1e12),
    ):
        least, largest = cases.unevenness(cases.case(cases.two_blocks(cells, upper, lower, stiffness)))
        contact = stiffness if isinstance(stiffness, str) else f"{stiffness:g} N/m³"
        print(f"| {cells}, {upper} and {lower} | {contact} | {least:.3f} | {largest:.3f} |")


def numbers(system: System, *, damped: bool) -> str:
    """Onsets below 10 kHz: of the traction mode, of the squeal, of the pair near 3.6 kHz."""
    found = bench.onsets_of(system, damped=damped)
    squeal, between = bench.squeal(found), bench.window(found)
    traction = "–" if between is None else f"{between[0]:.4f} to {between[1]:.4f}"
    return f"{pair(squeal)} | {traction} | {pair(found[-1])} |"


def pair(onset: Onset) -> str:
    """Where and at which frequency."""
    return f"{onset.mu:.4f}, {onset.frequency_hz:.0f} Hz"


def refinement() -> None:
    """The bench on meshes finer and finer."""
    heads = ("elements across pin and beam, along them", "freedoms", "squeal, damped", "… undamped")
    print(f"\n| {' | '.join(heads)} | traction mode, undamped | 3.6 kHz, undamped |")
    print("|---|---|---|---|---|---|")
    meshes = [
        ("quad8", (2, 4), (30, 90)),
        ("quad8", (2, 4), (60, 180)),
        ("quad8", (4, 8), (60, 180)),
        ("quad8", (4, 8), (120, 360)),
        ("quad", (4, 8), (120, 360)),
        ("quad", (8, 16), (240, 720)),
        ("quad", (8, 16), (480, 1440)),
    ]
    for cells, across, along in meshes:
        system = bench.solids(cells, across, along)
        compared(f"{cells}, {across[0]} and {across[1]}, {along[0]} and {along[1]}", system)
    compared("beams", bench.beams())


def compared(name: str, system: System) -> None:
    """One line of the table of meshes."""
    damped = bench.squeal(bench.onsets_of(system, damped=True))
    print(f"| {name} | {system.size} | {pair(damped)} | {numbers(system, damped=False)}")


def causes() -> None:
    """What is put into the beams and taken out of the solids."""
    solids = bench.solids("quad8", (4, 8), (120, 360))
    beams, soft = bench.beams(), bench.indentation(solids)
    swapped = bench.with_frequencies_of(beams, solids)
    print(f"\nIndentation: {soft:.3e} m/N on {solids.size} freedoms.")
    print("\n| undamped | squeal | traction mode | 3.6 kHz |")
    print("|---|---|---|---|")
    for name, system in (
        ("beams", beams),
        ("… with indentation", bench.with_indentation(beams, soft)),
        ("… with friction on the surface", bench.with_thickness(beams)),
        ("… with thinning", bench.with_thinning(beams)),
        ("… with the solids' frequencies", swapped),
        ("… these and friction on the surface", bench.with_thickness(swapped)),
        ("… these and thinning", bench.with_thinning(swapped)),
        ("… with all four", bench.everything(beams, solids)),
        ("solids", solids),
        ("… touching by their sections", bench.by_sections(solids, thickness=True)),
        ("… by their sections, friction on the axis", bench.by_sections(solids, thickness=False)),
    ):
        print(f"| {name} | {numbers(system, damped=False)}")


def main() -> None:
    fine = not options(__doc__ or "").short
    print("| number | expected | computed | difference |")
    print("|---|---|---|---|")
    frequencies(fine=fine)
    with tempfile.TemporaryDirectory() as folder:
        contact(Path(folder), fine=fine)
    impacts()
    evenness()
    if fine:
        refinement()
        causes()


if __name__ == "__main__":
    main()
