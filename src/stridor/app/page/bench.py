"""What a page's process computes, in the order in which it is wanted: first what moves with a slider, then, while
nobody moves anything, what takes longer and replaces it.

All of it comes from the calls behind the command line: `modes`, `onsets`, `sensitivities`. What has been computed for
a case is kept in its workspace as long as the case is the one on the page.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import AnalysisError, CaseError, StridorError
from ...modal.complex_modes import ComplexModes
from ...modal.onsets import Onset, Onsets
from ...study.analyses import modes, onsets
from ...study.unit_warnings import matrix_warnings
from ...study.workspace import Unsaved, Workspace
from ...system import System
from .drawing import drawing
from .levers import friction_range
from .mode_data import energy_of, participation, shape_of, tornado, tornado_seconds
from .model_reduced import Reduced
from .state import PageState
from .worker import IDLE

POINTS = 41  # of the curves
FEW_POINTS = 13  # of a large model that has no reduced one
LARGE = 600  # freedoms, beyond which an answer takes longer than a slider waits
DIGITS = 6  # of numbers that are drawn only

Send = Callable[[str, Any], None]


@dataclass
class _Model:
    """The workspace of the case on the page and what was told of it. reduced: of a large one, where it has one; why:
    why it has none."""

    key: Any
    stamp: str
    work: Workspace
    reduced: Reduced | None = None
    why: str = ""
    build: float = 0.0  # seconds that its matrices took
    idle: Workspace | None = None  # of its own, for what may be given up halfway
    locus: ComplexModes | None = None
    onsets: dict[str, Any] | None = None
    geometry: str = ""


class Bench:
    """Answers states (`PageState`) piece by piece: send(part, content) with plain data.

    Parts: "model" (drawing, freedoms), "refused" (what is wrong with the case), "progress" (of large models), "locus"
    (branches over μ), "at" (modes at the μ of the page), "unanswered" (why there are no modes), "onsets", "shape" (the
    mode chosen), "tornado" (its sensitivities, or of large models how long they would take).
    """

    def __init__(self) -> None:
        self._model: _Model | None = None
        self._reduced: Reduced | None = None
        self._leisure = False

    def __call__(self, state: PageState, send: Send) -> None:
        """Answer a state."""
        self._leisure = False
        try:
            model = self._of(state, send)
            self._answer(state, model, send)
        except CaseError as error:
            send("refused", str(error))
        except StridorError as error:
            send("unanswered", str(error))
        except Exception as error:  # the page goes on whatever it is
            self._model = self._reduced = None
            send("unanswered", f"this cannot be computed ({type(error).__name__}: {error})")
        except BaseException:
            self._given_up()
            raise

    def _given_up(self) -> None:
        """What is half made is not gone on with."""
        if self._model is not None and self._leisure:
            self._model.idle = None
        else:
            self._model = None

    def _of(self, state: PageState, send: Send) -> _Model:
        """The model of a state, built where it is another one than before."""
        if self._model is None or self._model.key != state.model:
            self._model = None
            case = state.case()
            model = _Model(state.model, state.stamp, Unsaved(case))
            if self._reduced is not None and self._reduced.holds(state):
                model.reduced = self._reduced
            elif _built(model).size > LARGE:
                send("model", _described(model))  # what follows takes a while
                self._reduce(model, state, send)
            self._model = model
        return self._model

    def _reduce(self, model: _Model, state: PageState, send: Send) -> None:
        """A reduced model for a large one, or why there is none."""
        self._reduced = None
        try:
            made = Reduced.made(state, lambda what: send("progress", {"what": what}))
            if made.holds(state):
                model.reduced = self._reduced = made
            else:
                model.why = f"μ = {state.mu:g} is outside of the range of a reduced model"
        except StridorError as error:
            model.why = f"No reduced model ({error}): every answer takes its time."
        send("progress", {"what": ""})

    def _answer(self, state: PageState, model: _Model, send: Send) -> None:
        if model.reduced is not None and model.reduced.holds(state):
            self._answer_reduced(state, model, model.reduced, send)
            return
        work = model.work
        here = None
        if model.locus is None:
            try:
                model.locus = self._swept(work, state.mu, send)
            except AnalysisError:
                _modes_here(work, state.mu)  # without any steady sliding the page says why there is none at its μ
                raise
            send("locus", locus_of(model.locus))
            if not model.locus.solved[model.locus.at(state.mu)]:
                here = _modes_here(work, state.mu)  # which says why there are none
            elif state.mu in model.locus.mu:
                send("at", modes_at(model.locus, state.mu, checked=False))
            send("model", _described(model))
        else:
            here = _modes_here(work, state.mu)
            send("at", modes_at(here, state.mu, checked=False))
        if state.branch is not None:
            here = here or _modes_here(work, state.mu)
            self._shape(model, work.system(state.mu), here, state.branch, send, energy=True)
        self._idle(send)
        model.idle = model.idle or Unsaved(work.case("the page"))
        self._at_leisure(state, model, model.idle, send)

    def _at_leisure(self, state: PageState, model: _Model, work: Workspace, send: Send) -> None:
        """What takes longer than a slider waits."""
        model.onsets = model.onsets or onsets_of(onsets(work))
        send("onsets", model.onsets)
        began = time.perf_counter()
        send("at", modes_at(modes(work, state.mu, max_frequency_hz=_band(work)), state.mu, checked=True))
        if state.branch is None:
            return
        if work.system().size > LARGE:
            solve = time.perf_counter() - began
            case = work.case("the page")
            send("tornado", _asked_for(state, tornado_seconds(case, state.mu, solve=solve, build=model.build)))
        else:
            send("tornado", tornado(work, state.mu, state.branch))

    def _answer_reduced(self, state: PageState, model: _Model, reduced: Reduced, send: Send) -> None:
        """On a reduced model: first a few points of the curves, where their numbers are known, and the modes at the μ
        of the page; then all points."""
        sweep, few_error = reduced.sweep(state), float
        if model.locus is None and reduced.swept:
            few, few_error = next(sweep)
            send("locus", {**locus_of(few), "said": _uncertified(reduced)})
            if state.mu in few.mu:  # as the curves have them, to some 1e-5, until the slider stands still
                send("at", {**modes_at(few, state.mu, checked=False), "said": _uncertified(reduced)})
                self._idle(send)
        here, error_of = reduced.here(state, vectors=state.branch is not None)
        at = modes_at(here, state.mu, checked=False)
        send("at", {**at, "said": _uncertified(reduced)})
        branch, whole = state.branch, reduced.work.system()
        offered = branch is not None and self._shape(model, whole, here, branch, send, energy=False)
        if offered:
            send("tornado", _asked_for(state, reduced.seconds))
        send("at", {**at, "said": _certified(reduced, max(error_of(), few_error()))})
        self._idle(send)
        if model.locus is None:
            found = model.locus
            for found, sweep_error in sweep:
                send("locus", {**locus_of(found), "said": _certified(reduced, sweep_error())})
            reduced.prepare()
            model.locus = found  # of all points: what is given up halfway is drawn anew
            send("model", _described(model))
            here, error_of = reduced.here(state, vectors=state.branch is not None)
            send("at", {**modes_at(here, state.mu, checked=False), "said": _certified(reduced, error_of())})
        model.onsets = model.onsets or reduced.onsets(state)
        send("onsets", model.onsets)
        if state.branch is not None:
            model.idle = model.idle or Unsaved(model.work.case("the page"))
            found = self._shape(model, model.idle.system(), here, state.branch, send, energy=True)
            if found and not offered:  # its number was not known before the curves were
                send("tornado", _asked_for(state, reduced.seconds))

    def _idle(self, send: Send) -> None:
        """From now on a newer question stops what is being answered."""
        if not self._leisure:
            self._leisure = True
            send(IDLE, None)

    def _swept(self, work: Workspace, mu: float, send: Send) -> ComplexModes:
        """Branches over the range of μ and at the μ of the page."""
        low, high = friction_range(work.case("the page"))
        large = work.system().size > LARGE
        inside = [mu] if low <= mu <= high else []
        mus = np.unique(np.append(np.linspace(low, high, FEW_POINTS if large else POINTS), inside))

        def told(done: int, planned: int) -> None:
            if large:
                send("progress", {"what": f"modes at {done} of {planned} friction coefficients"})

        return modes(work, mus, max_frequency_hz=_band(work), check=False, residuals=False, progress=told)

    def _shape(
        self, model: _Model, system: System, here: ComplexModes, branch: int, send: Send, *, energy: bool
    ) -> bool:
        """The chosen mode, if it is one of those at this μ, and whether it is; its geometry only where the page has
        another one."""
        where = np.flatnonzero(here.branch == branch)
        if not len(where) or not np.isfinite(here.eigenvalues[0, where[0]]):
            send("shape", {"branch": branch, "missing": f"mode {branch} is not in the band at μ = {here.mu[0]:g}"})
            return False
        column = int(where[0])
        shape, model.geometry = shape_of(system, here, column, known=model.geometry)
        fed = energy_of(system, model.work.options, here, column) if energy else {"each": [], "why": "being computed"}
        send("shape", {
            "branch": branch, "stamp": model.stamp, **shape,
            "bodies": participation(system, here, column), "contacts": fed,
        })  # fmt: skip
        return True


def bench() -> Bench:
    """A bench, as the process of a page has it: what is loaded by now is no garbage, and is not looked through for it
    while a slider moves."""
    gc.collect()
    gc.freeze()
    return Bench()


def _modes_here(work: Workspace, mu: float) -> ComplexModes:
    return modes(work, mu, max_frequency_hz=_band(work), vectors="right", check=False)


def _built(model: _Model) -> System:
    began = time.perf_counter()
    system = model.work.system()
    model.build = time.perf_counter() - began
    return system


def _asked_for(state: PageState, seconds: float) -> dict[str, Any]:
    """In place of sensitivities that take a while: about how long [s], for whoever wants them all the same."""
    return {"branch": state.branch, "mu": state.mu, "bars": [], "warnings": [], "seconds": seconds}


def _uncertified(reduced: Reduced) -> str:
    return f"{reduced.words}; the error of λ is being estimated."


def _certified(reduced: Reduced, error: float) -> str:
    return f"{reduced.words}; estimated error of λ ≤ {error:.0e}, relative."


def _described(model: _Model) -> dict[str, Any]:
    """The model to scale, and what is to be known of it."""
    work = model.work if model.reduced is None else model.reduced.work
    case, system = model.work.case("the page"), work.system()
    return {
        "title": case.title, "freedoms": system.size, "svg": drawing(case, system),
        "warnings": [*case.warnings, *matrix_warnings(case)], "large": system.size > LARGE, "why": model.why,
    }  # fmt: skip


def _band(work: Workspace) -> float:
    return work.modal.max_frequency_hz


def numbers(values: Any) -> list[float | None]:
    """Numbers to be drawn: rounded, None where there is none."""
    return [float(f"{v:.{DIGITS}g}") if np.isfinite(v) else None for v in np.asarray(values, dtype=float)]


def locus_of(found: ComplexModes) -> dict[str, Any]:
    """Branches over μ: frequency [Hz] and growth rate [1/s] of each at each μ, None where it is not known."""
    return {
        "mu": [float(mu) for mu in found.mu],
        "branches": [
            {
                "branch": int(found.branch[b]), "frequency_hz": numbers(found.frequency_hz[:, b]),
                "growth_rate": numbers(found.growth_rate[:, b]), "unstable": found.unstable[:, b].tolist(),
            }
            for b in range(len(found.branch))
        ],
        "notes": list(found.notes),
    }  # fmt: skip


def modes_at(found: ComplexModes, mu: float, *, checked: bool) -> dict[str, Any]:
    """The modes of the band at one μ, by frequency. checked: whether what grows was sought in the full problem as
    well, with what that search says."""
    row = found.at(mu)
    said = found.completeness[row] if checked and found.completeness else ""
    return {
        "mu": float(found.mu[row]),
        "modes": [
            {
                "branch": int(found.branch[b]), "frequency_hz": float(found.frequency_hz[row, b]),
                "growth_rate": float(found.growth_rate[row, b]), "damping_ratio": float(found.damping_ratio[row, b]),
                "unstable": bool(found.unstable[row, b]),
            }
            for b in found.order(row)
        ],
        "checked": checked,
        "completeness": said,
    }  # fmt: skip


def onsets_of(found: Onsets) -> dict[str, Any]:
    """Solved onsets, with what speaks for there being no others."""
    return {**found.to_json(), "words": [o.words for o in found], "first": _first(found.first)}


def _first(first: Onset | None) -> dict[str, Any] | None:
    return None if first is None else {"mu": first.mu, "frequency_hz": first.frequency_hz}
