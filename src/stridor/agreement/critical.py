"""The critical friction coefficient by both approaches: solved by the modes, bisected in time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..digits import measured
from ..errors import AnalysisError
from ..modal.onset import refuted
from ..modal.options import Options
from ..modal.over_friction import modes_of_band, onsets_of_band
from ..system import System
from ..temporal.simulate import Settings
from .kept import PartStore, bool_of, float_of
from .perturbation import options_in_time, perturb
from .result import GOOD_CRITICAL, Critical

Say = Callable[[str], None]
ELSEWHERE = (0.5, 0.25, 0.75)  # of a bracket: where it is divided, the next where the one before tells nothing


class NoChangeError(AnalysisError):
    """Perturbations grow, or decay, at both ends of the bracket: grow says which."""

    def __init__(self, message: str, *, grow: bool) -> None:
        super().__init__(message)
        self.grow = grow


def critical_friction(
    system: System,
    bracket: tuple[float, float],
    *,
    settings: Settings,
    tolerance: float = 5e-4,
    max_frequency_hz: float = 40e3,
    progress: Say | None = None,
    kept: PartStore | None = None,
) -> tuple[float, tuple[float, float]]:
    """Bisect the μ at which small perturbations begin to grow in time; the middle and the last bracket.

    The last bracket is wider than the tolerance where no march within it tells whether it grows. kept: where finished
    steps are put and taken from. Raises AnalysisError where the ends of the bracket do not differ, or are not told.
    """
    whys: dict[float, str] = {}

    def grows(mu: float) -> bool | None:
        known = None if kept is None else bool_of(kept.get("critical step", mu), "grows")
        if known is not None:
            return known
        found = perturb(system, mu, settings=settings, max_frequency_hz=max_frequency_hz, sign=True)
        if found.untold and not found.grown:
            whys[mu] = found.untold
            return None
        # What leaves the linear range has grown, by whatever component.
        does = found.grows or found.grown
        if kept is not None:
            kept.put("critical step", mu, {"grows": does})
        return does

    low, high = bracket
    state = {m: grows(m) for m in (low, high)}
    if whys:
        raise AnalysisError("; ".join(f"no growth is told at μ = {m:g}: {why}" for m, why in whys.items()))
    if state[low] or not state[high]:
        both = "grow" if state[low] else "decay"
        raise NoChangeError(
            f"perturbations {both} at both ends of the bracket {low:g} … {high:g}; widen comparison.bracket"
            if state[low] == state[high]
            else f"perturbations grow at {low:g} and decay at {high:g}, so that growth ends in the bracket instead of "
            "beginning; choose another comparison.bracket",
            grow=bool(state[low]),
        )
    while high - low > tolerance:
        # Close to the onset growth may be too slow to be told: farther from it, it is not.
        for share in ELSEWHERE:
            middle = low + share * (high - low)
            if (does := grows(middle)) is not None:
                break
        else:
            break
        low, high = (low, middle) if does else (middle, high)
        if progress is not None:
            progress(f"critical μ between {measured(low, 5)} and {measured(high, 5)}")
    return (low + high) / 2, (low, high)


def compare_critical(
    system: System,
    *,
    friction_range: tuple[float, float],
    max_frequency_hz: float,
    settings: Settings,
    bracket: tuple[float, float] | None,
    tolerance: float,
    progress: Say,
    kept: PartStore | None,
    options: Options | None = None,
) -> Critical:
    """Both critical friction coefficients, and whether they are one. Raises what the analyses raise."""
    progress("critical friction, modal")
    chosen = options_in_time(system, options)
    modal, told, grown = _modal(system, friction_range, max_frequency_hz, kept, chosen)
    found = _in_time(
        system, modal, friction_range, max_frequency_hz, settings, bracket, tolerance, progress, kept, chosen
    )
    # A first onset that may not be the first agrees with nothing.
    agrees = None if found.agrees and refuted(told) else found.agrees
    why = "; ".join(part for part in (*grown, found.why) if part) if found.why else ""
    return replace(found, agrees=agrees, completeness=told, why=why)


def _in_time(
    system: System,
    modal: float | None,
    friction_range: tuple[float, float],
    max_frequency_hz: float,
    settings: Settings,
    bracket: tuple[float, float] | None,
    tolerance: float,
    progress: Say,
    kept: PartStore | None,
    options: Options,
) -> Critical:
    """The critical friction by bisection in time, held against the modal one."""
    ends = bracket or (None if modal is None else (0.6 * modal, 1.5 * modal))
    if ends is None:
        return Critical(why="no modal onset in range, so no bracket for the temporal critical friction")
    progress("critical friction, temporal")
    try:
        temporal, last = critical_friction(
            system,
            ends,
            settings=settings,
            tolerance=tolerance,
            max_frequency_hz=max_frequency_hz,
            progress=progress,
            kept=kept,
        )
    except NoChangeError as error:
        return _without_change(system, ends, max_frequency_hz, modal, error, options)
    except AnalysisError as error:
        return Critical(modal, why=str(error))
    if modal is None:
        why = f"growth begins at {measured(temporal, 5)} in time, and the modes have no onset in {friction_range}"
        inside = friction_range[0] <= temporal <= friction_range[1]
        return Critical(None, temporal, last, False if inside else None, why)
    return _held(modal, temporal, last, tolerance)


def _held(modal: float, temporal: float, last: tuple[float, float], tolerance: float) -> Critical:
    """The modal onset against a bracket of the bisection, which may have ended early."""
    good = max(tolerance, GOOD_CRITICAL * modal)
    low, high = last
    if high - low <= max(2 * good, tolerance):
        return Critical(modal, temporal, last, abs(modal - temporal) <= good)
    why = (
        f"growth in time begins between {measured(low, 5)} and {measured(high, 5)}, where marches tell no growth apart"
    )
    far = max(low - modal, modal - high) > good
    return Critical(modal, None, last, False if far else None, why)


def _modal(
    system: System, between: tuple[float, float], limit: float, kept: PartStore | None, options: Options
) -> tuple[float | None, str, list[str]]:
    """The first onset, None where there is none, what speaks for that, and what grows before any; taken from what is
    kept if it is there."""
    known = None if kept is None else kept.get("critical modal", None)
    if known is not None and isinstance(known.get("completeness"), str):
        return float_of(known, "mu"), known["completeness"], [str(line) for line in known.get("before", ())]
    found = onsets_of_band(system, between, limit, options=options)
    first, grown = None if found.first is None else found.first.mu, found.at_start_words
    if kept is not None:
        kept.put("critical modal", None, {"mu": first, "completeness": found.completeness, "before": grown})
    return first, found.completeness, grown


def _without_change(
    system: System, ends: tuple[float, float], limit: float, modal: float | None, error: NoChangeError,
    options: Options,
) -> Critical:
    """Ends of a bracket at which the motion in time does the same: do the modes say so too?"""
    found = modes_of_band(system, list(ends), 1.02 * limit, options=options)
    grow = [bool(np.any(row)) for row in found.unstable & (found.frequency_hz <= limit)]
    if modal is not None and found.solved.all() and not grow[0] and grow[1]:
        begins = f"by the modes growth begins at {measured(modal, 5)} between them"
        return Critical(modal, agrees=False, why=f"{error}; {begins}")
    return Critical(modal, why=str(error))
