"""Large models: sliders work on a certified reduced model, made once; its estimated error is told with every answer."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...case import Case
from ...digits import fixed, measured
from ...modal.complex_modes import ComplexModes
from ...modal.full import ParametricOnset, ParametricOnsets, onsets_along
from ...modal.parametric import ReducedModel
from ...modal.parametric.contacts import ContactsProblem
from ...modal.parametric.line import Numbered, numbers_at
from ...modal.parametric.model import ReducedModes
from ...modal.parametric.restricted import Restricted
from ...stages import heard
from ...study.reduced import reduced_model
from ...study.workspace import Workspace
from ...typing import IntArray
from .levers import friction_range
from .mode_data import tornado_seconds
from .state import PageState, checked

FRICTION, STIFFNESS = "mu", "contact_stiffness"
REACH = (0.1, 10.0)  # times the contact stiffness of the case
POINTS = 21  # of the curves
COARSE = 4  # every so many of them are drawn first
QUICK = 1e-3  # share of directions left out of what the first ones are drawn from: λ to some 1e-5 there
QUICK_POINTS = 5  # of either number, whose modes these directions are of

Tell = Callable[[str], None]


@dataclass(frozen=True)
class _Line:
    """What the last sweep left: the stiffness it was at, the model on its modes, and these with their numbers, by μ."""

    stiffness: float | None
    restricted: Restricted
    numbered: list[Numbered]

    def modes(self, point: Mapping[str, float]) -> tuple[ReducedModes, IntArray] | None:
        """Modes on the basis of the whole model, and their numbers; None off the line, and where there are not as many
        modes as at the points beside: what is none of theirs the span need not have."""
        mu = point[FRICTION]
        if point.get(STIFFNESS) != self.stiffness:
            return None
        above = int(np.searchsorted([one.modes.point[FRICTION] for one in self.numbered], mu))
        beside = self.numbered[max(above - 1, 0) : above + 1]
        if len(beside) < 2:
            return None
        found = self.restricted.modes(point)
        if len(found.values) not in {len(one.modes.values) for one in beside}:
            return None
        nearest = min(beside, key=lambda one: abs(one.modes.point[FRICTION] - mu))
        return self.restricted.outside(found), numbers_at(nearest, found)


@dataclass
class Reduced:
    """A reduced model over μ, and over contact stiffness where one contact has a number for it, with the workspace of
    the case that it is of. words: what the page says of it. quick: the model on the most of what its modes over both
    numbers span, where that is worth it."""

    model: ReducedModel
    work: Workspace
    stiffness_path: str
    words: str
    base: Any
    seconds: float = 0.0  # about, of sensitivities in the full problem
    quick: Restricted | None = None
    _numbered: list[Numbered] = field(default_factory=list[Numbered])
    _line: _Line | None = None

    @staticmethod
    def made(state: PageState, tell: Tell) -> Reduced:
        """The model of a state's case, as it stands but for what the model is over. tell: what is under way. Raises
        AnalysisError where there is none."""
        began = time.perf_counter()
        work = Workspace(base_of(state).case())
        case = work.case("a reduced model")
        work.system()
        build = time.perf_counter() - began
        box = {FRICTION: (0.0, friction_range(case)[1])}
        path = stiffness_path(case)
        if path:
            box[STIFFNESS] = REACH
        with heard(lambda stage: tell("" if stage is None else stage.what)):
            tell("a reduced model is made, once for this case")
            model = reduced_model(work, box, whole=False)
            quick = _quick(model, box) if path else None
        took = time.perf_counter() - began
        over = "μ and contact stiffness" if path else "μ"
        words = f"Reduced model over {over}: {model.size} of {work.system().size} freedoms, made in {took:.0f} s"
        seconds = tornado_seconds(case, state.mu, solve=took, build=build)
        return Reduced(model, work, path, words, base_of(state).model, seconds, quick)

    def holds(self, state: PageState) -> bool:
        """Whether a state differs in nothing but what the model is over, and lies in the ranges of that."""
        return base_of(state).model == self.base and self.model.problem.inside(self._point(state))

    def here(self, state: PageState, *, vectors: bool = False) -> tuple[ComplexModes, Callable[[], float]]:
        """Modes at the μ of a state, and what estimates the largest error of their λ, relative, which takes some of a
        slider's time. Their numbers are those of the nearest point where they are known, until `sweep` has followed
        them from μ = 0."""
        point = self._point(state)
        on_line = None if self._line is None else self._line.modes(point)
        found = self.model.modes(point, judged=False) if on_line is None else on_line[0]
        numbers = self._numbers(found, state) if on_line is None else on_line[1]
        made = self._modes([found], [numbers], vectors=vectors)
        return made, lambda: float(self.model.judged(found).error.max(initial=0.0))

    def sweep(self, state: PageState) -> Iterator[tuple[ComplexModes, float]]:
        """Branches over the range of μ and at the μ of a state, and the largest estimated error: of few points first,
        then of all. Numbers of the first may differ from those of the second, which follow in smaller steps."""
        low, high = friction_range(self.work.case("the page"))
        line = np.linspace(low, high, POINTS)
        own = [state.mu] if low <= state.mu <= high else []
        passes = (np.unique(np.append(line[::COARSE], own)), np.unique(np.append(line, own)))
        known: dict[float, ReducedModes] = {}
        for mus in passes:
            quick = self.quick if mus is passes[0] else None
            model = self.model if quick is None else quick.model
            found = known if quick is None else dict[float, ReducedModes]()
            for mu in np.append(0.0, mus).tolist():
                if mu not in found:
                    found[mu] = model.modes(self._point(replace(state, mu=mu)), judged=quick is None)
            # The first ones take their numbers straight from those of the sweep before: no steps over friction.
            before = self._numbered if quick is not None and len(self._numbered) >= POINTS else []
            if quick is not None:
                before = [Numbered(model, quick.inside(one.modes), one.numbers) for one in before]
            self._numbered = before
            numbered: list[Numbered] = []
            for mu in sorted(found):
                numbered.append(Numbered(model, found[mu], self._numbers(found[mu], state)))
                if not before:
                    self._numbered = numbered
            self._numbered = numbered
            if quick is not None:
                self._numbered = [
                    Numbered(self.model, self.model.judged(quick.outside(one.modes)), one.numbers)
                    for one in self._numbered
                ]
            drawn = [one for one in self._numbered if one.modes.point[FRICTION] in mus]
            rows, numbers = [one.modes for one in drawn], [one.numbers for one in drawn]
            yield self._modes(rows, numbers), max(float(r.error.max(initial=0.0)) for r in rows)

    def prepare(self) -> None:
        """For moves of μ alone after a sweep: what its modes span answers them in a third of the time."""
        known = [one.modes for one in self._numbered]
        restricted = Restricted.of(self.model, known)
        if restricted is None:
            self._line = None
            return
        numbered = [Numbered(restricted.model, restricted.inside(one.modes), one.numbers) for one in self._numbered]
        self._line = _Line(known[0].point.get(STIFFNESS), restricted, numbered)

    def onsets(self, state: PageState) -> dict[str, Any]:
        """Onsets found on the model, each solved in the full problem, as `bench.onsets_of` has them."""
        point = self._point(state)
        found = onsets_along(self.model, FRICTION, {k: v for k, v in point.items() if k != FRICTION})
        low, high = friction_range(self.work.case("the page"))
        start = self.model.modes({**point, FRICTION: low})
        growing = [
            {"frequency_hz": float(f), "growth_rate": float(g)}
            for f, g, u in zip(start.frequency_hz, start.growth_rate, start.unstable, strict=True)
            if u and f >= 0
        ]
        return onsets_on_page(found, (low, high), growing)

    def _point(self, state: PageState) -> dict[str, float]:
        point = {FRICTION: state.mu}
        if self.stiffness_path:
            own = float(_stiffness(self.work.case("the page"), self.stiffness_path))
            point[STIFFNESS] = state.changes.get(self.stiffness_path, own) / own
        return point

    def _numbers(self, found: ReducedModes, state: PageState) -> IntArray:
        """Numbers (k,) by frequency at μ = 0, followed to a point; 0 where that is not known."""
        at = found.point[FRICTION]
        if at == 0.0:
            upper = np.flatnonzero(found.values.imag >= 0)
            numbers = np.zeros(len(found.values), dtype=np.int64)
            numbers[upper[np.argsort(found.values[upper].imag, kind="stable")]] = np.arange(1, len(upper) + 1)
            return numbers
        if not self._numbered:
            start = self.model.modes(self._point(replace(state, mu=0.0)))
            self._numbered = [Numbered(self.model, start, self._numbers(start, state))]
        nearest = min(self._numbered, key=lambda k: self._apart(k.modes.point, found.point))
        return numbers_at(nearest, found)

    def _apart(self, one: Mapping[str, float], other: Mapping[str, float]) -> float:
        """How far two points are from each other, of the ranges; friction counts most, as branches meet over it."""
        spans = {p.name: p.high - p.low for p in self.model.problem.parameters}
        return sum((1.0 if k == FRICTION else 0.1) * abs(one[k] - other[k]) / span for k, span in spans.items())

    def _modes(self, rows: list[ReducedModes], numbers: list[IntArray], *, vectors: bool = False) -> ComplexModes:
        """Rows as modes over μ, a column for each number; those whose number is not known have one above all others."""
        top = max((int(n.max(initial=0)) for n in numbers), default=0)
        extra = max(int(np.sum((n == 0) & (r.values.imag >= 0))) for r, n in zip(rows, numbers, strict=True))
        values = np.full((len(rows), top + extra), complex(np.nan, np.nan))
        size = self.work.system().size
        right = np.zeros((len(rows), top + extra, size), dtype=complex) if vectors else None
        for k, (row, number) in enumerate(zip(rows, numbers, strict=True)):
            upper = np.flatnonzero(row.values.imag >= 0)
            unknown = iter(range(top, top + extra))
            column = [int(number[j]) - 1 if number[j] else next(unknown) for j in upper]
            values[k, column] = row.values[upper]
            if right is not None:
                problem, shapes = self.model.problem, self.model.expand(row)
                moved = problem.displacements(shapes) if isinstance(problem, ContactsProblem) else shapes
                right[k, column] = np.asarray(moved).T[upper]
        kept = np.flatnonzero(np.isfinite(values).any(axis=0))
        return ComplexModes(
            mu=np.array([r.point[FRICTION] for r in rows]), eigenvalues=values[:, kept],
            branch=np.arange(1, top + extra + 1)[kept], residual=np.full((len(rows), len(kept)), np.nan), damped=True,
            right=None if right is None else right[:, kept], source="reduced",
            max_frequency_hz=self.work.modal.max_frequency_hz, notes=tuple(getattr(self.model.problem, "notes", ())),
        )  # fmt: skip


def _quick(model: ReducedModel, box: Mapping[str, tuple[float, float]]) -> Restricted | None:
    """The model on the most of what its modes over friction and contact stiffness span."""
    (low, high), (soft, stiff) = box[FRICTION], box[STIFFNESS]
    stiffnesses = np.geomspace(soft, stiff, QUICK_POINTS).tolist()
    known = [
        model.modes({FRICTION: mu, STIFFNESS: stiffness}, judged=False)
        for mu in np.linspace(low, high, QUICK_POINTS).tolist()
        for stiffness in stiffnesses
    ]
    return Restricted.of(model, known, share=QUICK)


def base_of(state: PageState) -> PageState:
    """The state without what a reduced model is over."""
    path = stiffness_path(checked(state.source))
    return replace(state, changes={k: v for k, v in state.changes.items() if k != path})


def stiffness_path(case: Case) -> str:
    """The path of the contact stiffness where a case has one contact with a number for it, else ""."""
    soft = [name for name, c in case.contacts.items() if c.stiffness != "rigid"]
    return f"contacts.{soft[0]}.stiffness" if len(soft) == 1 else ""


def _stiffness(case: Case, path: str) -> Any:
    return case.contacts[path.split(".")[1]].stiffness


def onsets_on_page(
    found: ParametricOnsets, between: tuple[float, float], growing: list[dict[str, float]]
) -> dict[str, Any]:
    """Onsets along μ as the page takes those of `st.onsets`."""
    each = [{**o.to_json(), "mu": o.value, "branches": [0, 0]} for o in found]
    first = next(({"mu": o.value, "frequency_hz": o.frequency_hz} for o in found if not o.stabilising), None)
    return {
        "onsets": each, "words": [_words(o) for o in found], "first": first, "complete": found.complete,
        "completeness": found.sentence, "growing_at_start": growing, "friction_range": list(between),
        "source": "reduced",
    }  # fmt: skip


def _words(onset: ParametricOnset) -> str:
    ends = ", where growth ends" if onset.stabilising else ""
    return f"μ = {fixed(onset.value, 6)}, {measured(onset.frequency_hz, 1)} Hz, {onset.kind}{ends}"
