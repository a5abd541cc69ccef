"""The pad on a disc by implicit and by explicit steps: growth against the modes, and processor seconds for 0.1 s.

python benchmarks/implicit.py [--short]   (--short: a coarse mesh, for CI)

Both are made ready, marched a few steps each from steady sliding with a push, and what 0.1 s would take follows from
the seconds of a step: while all nodes touch, and as far as the run comes after that.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

import stridor as st
from _common import COARSE, machine, options
from stridor.agreement.perturbation import modes_as_in_time, perturb
from stridor.case import Case, template_text
from stridor.study.settings import phases_of, settings_of
from stridor.temporal.schedule import lay_out
from stridor.temporal.settings import Settings
from stridor.temporal.simulate import stepper_for
from stridor.temporal.steppers.implicit import whole_steps

MU = 0.5
LENGTH = 0.1  # s
PARTS = ((20, 50), (20, 50, 100, 200))  # steps marched at a time, short and whole


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


def main() -> None:
    short = options(__doc__ or "").short
    case = st.loads(template_text("pad-on-disc"))
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
