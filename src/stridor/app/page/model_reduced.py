"""Large models: sliders work on a certified reduced model, made once; its estimated error is told with every answer."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from ...case import Case
from ...digits import fixed, measured
from ...modal.complex_modes import ComplexModes
from ...modal.full import ParametricOnset, ParametricOnsets, onsets_along
from ...modal.parametric import ReducedModel
from ...modal.parametric.contacts import ContactsProblem
from ...modal.parametric.line import Numbered, matched_numbers, numbers_at
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
SAME = 1e-3  # of λ: how near modes at one point are to those of the model that draws first
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
    _swept: bool = False
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
        return made, partial(self._error, [found], judged=False)

    @property
    def swept(self) -> bool:
        """Whether numbers are known all over the range of μ, from a sweep before, and curves are drawn from few points
        first."""
        return self._swept and self.quick is not None

    def sweep(self, state: PageState) -> Iterator[tuple[ComplexModes, Callable[[], float]]]:
        """Branches over the range of μ and at the μ of a state, and what estimates the largest error: of few points
        first, then of all. Numbers of the first may differ from those of the second, which follow in smaller steps."""
        low, high = friction_range(self.work.case("the page"))
        line = np.linspace(low, high, POINTS)
        own = [state.mu] if low <= state.mu <= high else []
        few, every = (np.unique([0.0, *part.tolist(), *own]) for part in (line[::COARSE], line))
        model, quick = self.model, self.quick
        if quick is not None:
            model = quick.model
            found = {mu: model.modes(self._point(replace(state, mu=mu)), judged=False) for mu in few.tolist()}
            before = [Numbered(model, quick.inside(one.modes), one.numbers) for one in self._numbered]
            # The first ones take their numbers straight from those of the sweep before: no steps over friction.
            numbered = self._straight(found, before) if self._swept else self._followed(model, found)
            self._numbered = [Numbered(self.model, quick.outside(one.modes), one.numbers) for one in numbered]
            self._swept = True
            yield self._drawn(low, judged=False)
        found = {}
        for mus in (few, every) if quick is None else (every,):
            missing = [mu for mu in mus.tolist() if mu not in found]
            found |= {mu: self.model.modes(self._point(replace(state, mu=mu))) for mu in missing}
            # What is given up halfway leaves the numbers that are known.
            self._numbered = self._followed(self.model, found)
            self._swept = True
            yield self._drawn(low, judged=True)

    def _straight(self, found: Mapping[float, ReducedModes], before: Sequence[Numbered]) -> list[Numbered]:
        """Modes by μ with numbers from the nearest of the points before."""
        return [Numbered(before[0].model, modes, self._from(before, modes)) for modes in found.values()]

    def _followed(self, model: ReducedModel, found: Mapping[float, ReducedModes]) -> list[Numbered]:
        """Modes by μ with numbers by frequency at μ = 0, each from the nearest of the points below it."""
        numbered: list[Numbered] = []
        for mu in sorted(found):
            numbered.append(Numbered(model, found[mu], self._from(numbered, found[mu])))
        return numbered

    def _drawn(self, low: float, *, judged: bool) -> tuple[ComplexModes, Callable[[], float]]:
        """The points that are known from the low end of the range on, with what estimates their error."""
        drawn = [one for one in self._numbered if one.modes.point[FRICTION] >= low]
        rows, numbers = [one.modes for one in drawn], [one.numbers for one in drawn]
        return self._modes(rows, numbers), partial(self._error, rows, judged=judged)

    def _error(self, rows: Sequence[ReducedModes], *, judged: bool) -> float:
        """The largest estimated error of λ at some points."""
        known = rows if judged else [self.model.judged(row) for row in rows]
        return max(float(row.error.max(initial=0.0)) for row in known)

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
        if not self._numbered and found.point[FRICTION] != 0.0:
            start = self.model.modes(self._point(replace(state, mu=0.0)))
            self._numbered = [Numbered(self.model, start, self._from((), start))]
        return self._from(self._numbered, found)

    def _from(self, known: Sequence[Numbered], found: ReducedModes) -> IntArray:
        """The same, from the nearest of the points where they are known; at μ = 0 they are counted."""
        if found.point[FRICTION] == 0.0:
            upper = np.flatnonzero(found.values.imag >= 0)
            numbers = np.zeros(len(found.values), dtype=np.int64)
            numbers[upper[np.argsort(found.values[upper].imag, kind="stable")]] = np.arange(1, len(upper) + 1)
            return numbers
        nearest = min(known, key=lambda k: self._apart(k.modes.point, found.point))
        if nearest.modes.point == found.point:  # of a coarser model
            same = matched_numbers(nearest.modes.values, nearest.numbers, found.values, SAME)
            if np.all(same[found.values.imag >= 0]):
                return same
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
