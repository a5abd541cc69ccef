"""Perturbed copies of a run: what of its numbers belongs to this trajectory, and what to the motion it settles to."""

from __future__ import annotations

import numpy as np

from ..asking import FUNCTION, SEED, WHOLE, takes
from ..errors import AnalysisError, CaseError
from ..temporal.attractor import Spread, spread
from ..temporal.simulate import Progress
from ..temporal.simulate import simulate as march
from ..temporal.trajectory import RUN, Trajectory
from .asked import require_friction
from .settings import phases_of, settings_of
from .workspace import Problem, Workspace

PERTURBATION = 1e-12


@takes(run=RUN, count=WHOLE, seed=SEED, progress=FUNCTION)
def perturbed_copies(
    problem: Problem,
    run: Trajectory,
    mu: float | None = None,
    *,
    count: int = 4,
    seed: int = 0,
    progress: Progress | None = None,
) -> Spread:
    """Averages of a run and of ``count`` copies whose start differs in the twelfth digit, with their spread.

    run: of the same case and μ, from its start to its end (`st.simulate`). The velocities of a copy differ at t = 0,
    on every freedom, by 1e-12 of the largest slip speed of the run times a normal deviate drawn from ``seed``; each
    costs as much time as the run. Ctrl-C ends with the copies that are finished. Raises CaseError for a count below
    one, AnalysisError for a run that was interrupted or in which nothing slides.
    """
    if count < 1:
        raise CaseError("copies", count, "at least 1")
    require_friction(mu, several=False)
    if run.interrupted:
        raise AnalysisError("copies are compared with a finished run; this one was interrupted")
    speed = max((s.max_slip_speed for p in run.phases for s in p.contacts.values()), default=0.0)
    if not speed > 0.0:
        raise AnalysisError("copies tell how a run with contacts that slide scatters; in this one nothing slides")
    work = Workspace.of(problem)
    system = work.structured("simulate", mu)
    zero = np.zeros(system.size)
    draw = np.random.default_rng(seed)
    runs = [run]
    for k in range(count):
        told = None if progress is None else _after(progress, k, count)
        disturbance = zero, PERTURBATION * speed * draw.standard_normal(system.size), zero
        copy = march(system, phases_of(work), settings_of(work), mu=mu, progress=told, disturbance=disturbance)
        if copy.interrupted:
            break
        runs.append(copy)
    return spread(runs, PERTURBATION, seed)


def _after(progress: Progress, number: int, count: int) -> Progress:
    """Progress of one copy as part of that of all."""

    def told(done: int, planned: int) -> None:
        progress(number * planned + done, count * planned)

    return told
