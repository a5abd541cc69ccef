"""What a page's process computes, in the order in which it is wanted: first what moves with a slider, then, while
nobody moves anything, what takes longer and replaces it.

All of it comes from the calls behind the command line: `modes`, `onsets`, `sensitivities`. What has been computed for
a case is kept in its workspace as long as the case is the one on the page.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import CaseError, StridorError
from ...modal.complex_modes import ComplexModes
from ...modal.onsets import Onset, Onsets
from ...study.analyses import modes, onsets
from ...study.workspace import Workspace
from .drawing import drawing
from .levers import friction_range
from .mode_data import energy_of, participation, shape_of, tornado
from .state import State
from .worker import IDLE

POINTS = 41  # of the curves
LARGE = 2000  # freedoms, beyond which an answer takes longer than a slider waits
DIGITS = 6  # of numbers that are drawn only

Send = Callable[[str, Any], None]


@dataclass
class _Model:
    """The workspace of the case on the page and what was told of it."""

    key: Any
    work: Workspace
    idle: Workspace | None = None  # of its own, for what may be given up halfway
    locus: ComplexModes | None = None
    onsets: Onsets | None = None
    geometry: str = ""


class Bench:
    """Answers states (`State`) piece by piece: send(part, content) with plain data.

    Parts: "model" (drawing, freedoms), "refused" (what is wrong with the case), "progress" (of large models), "locus"
    (branches over μ), "at" (modes at the μ of the page), "unanswered" (why there are no modes), "onsets", "shape" (the
    mode chosen), "tornado" (its sensitivities).
    """

    def __init__(self) -> None:
        self._model: _Model | None = None
        self._leisure = False

    def __call__(self, state: State, send: Send) -> None:
        """Answer a state."""
        self._leisure = False
        try:
            model = self._of(state, send)
            self._answer(state, model, send)
        except BaseException as error:
            if isinstance(error, CaseError):
                send("refused", str(error))
            elif isinstance(error, StridorError | ArithmeticError | MemoryError | np.linalg.LinAlgError):
                send("unanswered", str(error) or type(error).__name__)
            else:
                self._given_up()
                raise

    def _given_up(self) -> None:
        """What is half made is not gone on with."""
        if self._model is not None and self._leisure:
            self._model.idle = None
        else:
            self._model = None

    def _of(self, state: State, send: Send) -> _Model:
        """The model of a state, built where it is another one than before."""
        if self._model is None or self._model.key != state.model:
            self._model = None
            case = state.case()
            model = _Model(state.model, Workspace(case))
            if model.work.system().size > LARGE:
                send("model", _described(model.work))  # what follows takes a while
            self._model = model
        return self._model

    def _answer(self, state: State, model: _Model, send: Send) -> None:
        work = model.work
        here = None
        if model.locus is None:
            model.locus = self._swept(model, state.mu, send)
            send("locus", locus_of(model.locus))
            if state.mu in model.locus.mu:
                send("at", modes_at(model.locus, state.mu, checked=False))
            send("model", _described(work))
        else:
            here = self._modes_here(work, state.mu)
            send("at", modes_at(here, state.mu, checked=False))
        if state.branch is not None:
            here = here or self._modes_here(work, state.mu)
            self._shape(model, here, state.branch, send)
        self._leisure = True
        send(IDLE, None)
        model.idle = model.idle or Workspace(work.case("the page"))
        self._at_leisure(state, model, model.idle, send)

    def _at_leisure(self, state: State, model: _Model, work: Workspace, send: Send) -> None:
        """What takes longer than a slider waits."""
        if model.onsets is None:
            model.onsets = onsets(work)
        send("onsets", onsets_of(model.onsets))
        send("at", modes_at(modes(work, state.mu, max_frequency_hz=_band(work)), state.mu, checked=True))
        if state.branch is not None:
            send("tornado", tornado(work, state.mu, state.branch))

    def _swept(self, model: _Model, mu: float, send: Send) -> ComplexModes:
        """Branches over the range of μ and at the μ of the page."""
        work = model.work
        low, high = friction_range(work.case("the page"))
        points = POINTS if work.system().size <= LARGE else 13
        inside = [mu] if low <= mu <= high else []
        mus = np.unique(np.append(np.linspace(low, high, points), inside))

        def told(done: int, planned: int) -> None:
            if work.system().size > LARGE:
                send("progress", {"done": done, "planned": planned})

        return modes(work, mus, max_frequency_hz=_band(work), check=False, progress=told)

    def _modes_here(self, work: Workspace, mu: float) -> ComplexModes:
        return modes(work, mu, max_frequency_hz=_band(work), vectors="right", check=False)

    def _shape(self, model: _Model, here: ComplexModes, branch: int, send: Send) -> None:
        """The chosen mode, if it is one of those at this μ; its geometry only where the page has another one."""
        where = np.flatnonzero(here.branch == branch)
        if not len(where) or not np.isfinite(here.eigenvalues[0, where[0]]):
            send("shape", {"branch": branch, "missing": f"mode {branch} is not in the band at μ = {here.mu[0]:g}"})
            return
        work, column = model.work, int(where[0])
        shape, key = shape_of(work.system(float(here.mu[0])), here, column, known=model.geometry)
        model.geometry = key
        send("shape", {
            "branch": branch, **shape, "bodies": participation(work.system(float(here.mu[0])), here, column),
            "contacts": energy_of(work, here, column),
        })  # fmt: skip


def bench() -> Bench:
    """A bench, as the process of a page has it: what is loaded by now is no garbage, and is not looked through for it
    while a slider moves."""
    gc.collect()
    gc.freeze()
    return Bench()


def _described(work: Workspace) -> dict[str, Any]:
    """The model to scale, and what is to be known of it."""
    case, system = work.case("the page"), work.system()
    return {
        "title": case.title, "freedoms": system.size, "svg": drawing(case, system), "warnings": case.warnings,
        "large": system.size > LARGE,
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
