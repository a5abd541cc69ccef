"""The pad on a disc by implicit and by explicit steps: growth against the modes, and processor seconds for 0.1 s.

python benchmarks/implicit.py [--short]   (--short: a coarse mesh, for CI)
python benchmarks/implicit.py --parted    (once nodes part: averages over the step and the modes kept; minutes)

Both are made ready, marched a few steps each from steady sliding with a push, and what 0.1 s would take follows from
the seconds of a step: while all nodes touch, and as far as the run comes after that.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

import stridor as st
from _common import COARSE, machine
from stridor.agreement.perturbation import modes_as_in_time, perturb
from stridor.case import Case, template_text
from stridor.contact.multipliers import OPEN, SLIP, STICK
from stridor.study.settings import phases_of, settings_of
from stridor.temporal.schedule import lay_out
from stridor.temporal.settings import Settings
from stridor.temporal.simulate import stepper_for
from stridor.temporal.steppers.implicit import whole_steps

MU = 0.5
LENGTH = 0.1  # s
PARTS = ((20, 50), (20, 50, 100, 200))  # steps marched at a time, short and whole
PARTED = 0.015, 0.04  # s, from when to when averages are taken
MEDIUM = {
    "bodies.disc.mesh.divisions": [8, 72, 2],
    "bodies.lining.mesh.divisions": [8, 16, 2],
    "bodies.plate.mesh.divisions": [7, 14, 1],
}


def growth(case: Case) -> None:
    """The fastest growing mode of the band in a small motion by implicit steps."""
    system, limit = st.build_system(case), case.modal.max_frequency_hz
    modes = modes_as_in_time(system, MU, limit)
    wanted = modes.eigenvalues[0][np.argmax(modes.eigenvalues[0].real)]
    settings = replace(settings_of(case), stepper="implicit", step=1 / (30 * limit))
    found = perturb(system, MU, settings=settings, max_frequency_hz=limit, modes=modes).components.eigenvalues
    seen = found[np.argmin(np.abs(found - wanted))]
    print(
        f"modal {wanted.imag / 2 / np.pi:.2f} Hz, {wanted.real:+.3f} 1/s; 30 steps to the period of {limit:g} Hz: "
        f"{seen.imag / 2 / np.pi:.2f} Hz, {seen.real:+.3f} 1/s, growth off by {abs(seen.real / wanted.real - 1):.2%}"
    )


def cost(case: Case, settings: Settings, parts: tuple[int, ...]) -> float:
    """Processor seconds for 0.1 s, made ready and marched; the last steps stand for all."""
    system, phases = st.build_system(case), phases_of(case)
    started = time.process_time()
    stepper = stepper_for(system, settings, None)
    schedule = lay_out(
        phases, stepper.scheme.step, list(system.loads), list(system.motion.names), system.motion.full_distance
    )
    stepper.begin(schedule, settings, None)
    offline = time.process_time() - started
    stepper.make_room(schedule, settings)
    stepper.use_threads(two=False)
    each = 0.0
    for steps in parts:
        started = time.process_time()
        stepper.advance(steps, schedule, "slide")
        each = (time.process_time() - started) / steps
        print(f"  {1e3 * each:.2f} ms a step up to step {stepper.done}, {stepper.sweeps[0]} sweeps at most")
    whole = offline + each * LENGTH / stepper.scheme.step
    print(
        f"  {settings.stepper}: made ready in {offline:.1f} s; steps of {stepper.scheme.step:.3g} s; {LENGTH} s would "
        f"take {whole:.0f} s of one core"
    )
    return whole


def options() -> argparse.Namespace:
    """What is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--short", action="store_true", help="a coarse mesh, for CI")
    parser.add_argument("--parted", action="store_true", help="averages once nodes part, over the step")
    return parser.parse_args()


def averages(case: Case, what: str, changes: dict[str, object]) -> None:
    """A row: nodes that are open, stick and slip, mean friction and the rms of the normal force once nodes part."""
    started = time.process_time()
    found = st.simulate(case.with_({"phases.slide.duration": PARTED[1]} | changes))
    spent, late = time.process_time() - started, found.time >= PARTED[0]
    nodes = found.nodes
    assert nodes is not None
    status = nodes.status[nodes.time >= PARTED[0]]
    apart, stick, slip = (100 * float((status == code).mean()) for code in (OPEN, STICK, SLIP))
    normal, friction = found.normal_force[late, 0], found.tangential_force[late, 0]
    print(
        f"| {what} | {found.step:.3g} s | {apart:.1f} % | {stick:.2f} % | {slip:.1f} % | {-friction.mean():.0f} N | "
        f"{normal.std():.0f} N | {spent:.0f} s |",
        flush=True,
    )


def parted(case: Case) -> None:
    """The same motion by explicit steps, twice, and by implicit ones."""
    explicit: dict[str, object] = {"temporal.stepper": "explicit"}
    averages(case, "explicit", explicit)
    averages(case, "explicit, pushed 2 % harder", explicit | {"temporal.perturbation": 0.0102})
    highest = case.modal.max_frequency_hz
    for times, parts in ((1, 30), (1, 60), (1, 120), (1, 240), (4, 30), (4, 60), (4, 120)):
        changes: dict[str, object] = {
            "temporal.stepper": "implicit",
            "temporal.step": PARTED[1] / np.ceil(PARTED[1] * parts * highest),
            "temporal.record_every": parts // 15,
            "modal.max_frequency_hz": times * highest,
        }
        averages(case, f"{parts} steps to the period of 7 kHz, modes up to {times * highest / 500:g} kHz", changes)


def main() -> None:
    asked = options()
    short = asked.short
    case = st.loads(template_text("pad-on-disc"))
    if asked.parted:
        return parted(case.with_(MEDIUM))
    case = case.with_(COARSE) if short else case
    system = st.build_system(case)
    print(f"{system.size} freedoms, {system.contact_nodes().count} slave nodes ({machine()})")
    if short:
        growth(case)
    settings = settings_of(case)
    implicit = replace(settings, stepper="implicit")
    implicit = replace(implicit, step=whole_steps(implicit, phases_of(case)))
    parts = PARTS[0] if short else PARTS[1]
    ratio = cost(case, settings, parts) / cost(case, implicit, parts)
    print(f"implicit steps are {ratio:.1f} times cheaper, making ready included")


if __name__ == "__main__":
    main()
