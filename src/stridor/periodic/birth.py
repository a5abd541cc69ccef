"""Where a branch begins: the mode that steady sliding begins to grow in, as large as contacts first change."""

from __future__ import annotations

import numpy as np

from ..errors import AnalysisError
from ..temporal.steppers.exact.statuses import STICK
from ..typing import Array
from .chart import Chart
from .problem import SlidingProblem
from .returns import excited
from .shooting import ClosedShot, shoot
from .shooting_branch import ShootingBranch

LARGER = (0.02, 0.05, 0.1, 0.2, 0.3)  # of that size: by how much the first cycle is larger
NEAR = 1e-3  # of a frequency: whether a mode is that of the onset


def born(branch: ShootingBranch, mu: float, frequency_hz: float) -> tuple[ClosedShot, Array]:
    """The first cycle of the branch that begins at an onset, and the heading (s + 2,) away from it.

    Up to the size at which its mode first changes a contact, steady sliding at the onset swings freely, at every size;
    the branch begins with that size, so it is the amplitude that is set and μ that is found. Raises AnalysisError where
    the onset has no such mode (a divergence, or two modes that meet in one), or no cycle is near.
    """
    problem = branch.family.at(mu)
    motion = problem.motion()
    motion.status = problem.status
    if STICK in problem.status:
        raise AnalysisError("contacts stick in steady sliding")
    poles = motion.watched().flow.split.poles
    wanted = 2j * np.pi * frequency_hz
    mode = int(np.argmin(np.abs(poles - wanted)))
    if frequency_hz <= 0.0 or abs(poles[mode] - wanted) > NEAR * abs(wanted):
        raise AnalysisError("steady sliding diverges there without swinging")
    chart = Chart.of(problem, problem.status)
    steady = chart.numbers(problem.q, np.zeros_like(problem.q))
    last = ""
    for larger in LARGER:
        try:
            guess = _guess(problem, chart, mode, 1.0 + larger, frequency_hz)
            heading = np.zeros(chart.size + 2)
            heading[: chart.size] = guess.xi - steady
            heading /= np.linalg.norm(heading)
            branch.forget()
            closed = branch.corrected(guess, heading)
            if not closed.shot.words:
                raise AnalysisError("the cycle found changes no contact")
            branch.forget()
            return closed, branch.heading(closed, heading)
        except (AnalysisError, np.linalg.LinAlgError) as error:
            last = str(error)
    raise AnalysisError(last)


def _guess(problem: SlidingProblem, chart: Chart, mode: int, size: float, frequency_hz: float) -> ClosedShot:
    xi = chart.numbers(*excited(problem, mode, size))
    period = 1.0 / frequency_hz
    return ClosedShot(problem, chart, xi, period, shoot(problem, chart, xi, period), np.inf)
