"""All curves of a rectangle: found on lines across it, held against what is counted between these.

Along every line the search for onsets finds where growth begins and ends. An onset that lies on no curve so far starts
one. Then three things must hold, each of which may fail: every onset of every line lies on a curve, curves cross the
lines nowhere else, and at points between the lines as many roots grow as the curves say. Where modes at such a point
would come to the axis within its mesh if they were straight, it is counted there as well. Wherever curves and counts
differ, further lines are laid. Modes that decay at these points are climbed to the tops of their rates between them
(`climb`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from ...errors import AnalysisError
from ...typing import Array
from ..onset import Onset
from ..tolerances import UNSTABLE_RELATIVE
from .climb import ModesAtPoint, climb, tops
from .curve import Crossing, Drawn, StabilityCurve, carried, crossings
from .march import apart, inside, joined, traced, without_points
from .passing import FINEST, refined
from .plane import Count, Plane
from .spot import CurvePoint, Kind, point_on

LINES = 5  # in both directions
ROUNDS = 4  # of further lines
BESIDE = 1e-9  # how far inside the rectangle lines on its edges are crossed
REACH = 2e-3  # along a line: how far off an onset its point on the curve may be
FORETOLD = 3  # counts at places where modes are expected on the axis, around one point
CLIMBING = 12  # solves on the way to tops of growth, for each point at first; what is begun is finished
EVEN = 8  # places along a line at which it is counted, beside those between curves
ALIKE = 0.02  # of ω: onset and crossing that are one
HALVINGS = 9  # until a difference between counts and curves is placed
ASIDE = 1e-4  # how far beside a curve others are counted
ON_CURVE = 1e-5  # how near to one that counts is taken to be on it
AWAY = 0.07  # of the mesh: how far beside it is counted then
TRIED = 3  # times, as another one may run through there
SLOW = "there are slow modes that cannot be told from motions as a whole"
EDGE = 1e-3  # of a line: crossings so near its ends may lie beyond them


@dataclass(frozen=True)
class OnsetLine:
    """Onsets on the line on which the coordinate ``axis`` has a value: (place, ω, roots) of each. complete: whether the
    search says that there are no others; why: why not. counted: whether roots counted between the curves that cross it
    say so in its place."""

    axis: int
    value: float
    onsets: tuple[tuple[float, float, int], ...]
    complete: bool
    why: str = ""
    counted: bool = False

    @property
    def ends(self) -> tuple[Array, Array]:
        """From where to where (2,) curves are looked for on it."""
        value = min(max(self.value, BESIDE), 1 - BESIDE)
        start, end = np.zeros(2), np.ones(2)
        start[self.axis] = end[self.axis] = value
        return start, end


@dataclass(frozen=True)
class Looked:
    """A point (2,) at which it was counted."""

    p: Array
    count: Count


@dataclass
class Found:
    """Curves, the lines that they were found on, and points at which was counted. wrong: where these do not fit
    together, in words that end before a place. passing: whether growing modes pass the highest frequency somewhere, so
    that their number changes where no curve is."""

    plane: Plane
    curves: list[StabilityCurve] = field(default_factory=list[StabilityCurve])
    lines: list[OnsetLine] = field(default_factory=list[OnsetLine])
    looked: list[Looked] = field(default_factory=list[Looked])
    wrong: list[tuple[str, Array]] = field(default_factory=list[tuple[str, Array]])
    passing: bool = False

    @property
    def drawn(self) -> list[Drawn]:
        """The curves in straight pieces."""
        return [curve.drawn for curve in self.curves]

    def said(self, p: Array, since: Looked | None = None) -> tuple[int, int, bool]:
        """How many modes and roots grow at a point (2,) as the curves say, from the nearest point at which it was
        counted, or another one; and whether modes had to part or meet on the way (`carried`)."""
        if since is None:
            places = np.array([at.p for at in self.looked])
            since = self.looked[int(np.argmin(np.hypot(*(places - p).T)))]
        return carried(since.count.modes, since.count.roots, crossings(self.drawn, since.p, p))

    @property
    def parts(self) -> bool:
        """Whether modes may grow without oscillating anywhere, so that roots alone do not say how many grow."""
        counts = (at.count for at in self.looked)
        return any(curve.kind == "standstill" for curve in self.curves) or any(c.roots != 2 * c.modes for c in counts)

    @property
    def agree(self) -> bool:
        """Whether lines, curves and counts fit together, and every curve could be followed to its end."""
        whole = all("lost" not in curve.ends and not curve.unchecked for curve in self.curves)
        return whole and not self.wrong and all(line.complete for line in self.lines)


def boundaries(
    plane: Plane, tolerance: float = 1e-3, lines: int = LINES, progress: Callable[[int, int], None] | None = None
) -> Found:
    """Every curve that cuts one of so many lines in either direction, or that a count between them betrays.

    tolerance: how far the cubic pieces may be off, in shares of the ranges. Raises AnalysisError where no line can be
    searched.
    """
    return _CurveSearch(plane, tolerance, lines, progress).all()


class _CurveSearch:
    def __init__(
        self, plane: Plane, tolerance: float, lines: int, progress: Callable[[int, int], None] | None
    ) -> None:
        self.plane, self.tolerance, self.number = plane, tolerance, lines
        self.found, self._progress, self._done = Found(plane), progress, 0
        self._failed: list[AnalysisError] = []
        self._modes: list[ModesAtPoint] = []  # at the points at which it was counted

    def all(self) -> Found:
        """Lines, curves and counts, again where they differ."""
        places = np.linspace(0.0, 1.0, self.number)
        for axis in (0, 1):
            for value in places.tolist():
                self._lay(axis, value)
        if len(self._failed) == len(self.found.lines):
            raise self._failed[0]
        middles = 0.5 * (places[1:] + places[:-1])
        # Next to one another along lines, so that a difference lies on one that can be searched.
        cells = [(x, y) for k, x in enumerate(middles.tolist()) for y in middles.tolist()[:: -1 if k % 2 else 1]]
        for cell in cells:
            self._look(np.array(cell))
        self._look_between()
        for _ in range(ROUNDS):
            places = self._contradicted()
            new = [(axis, float(p[axis])) for _, p in places for axis in (0, 1) if not self._laid(axis, float(p[axis]))]
            if not new:
                break
            for axis, value in dict.fromkeys(new):
                if not self._laid(axis, value):
                    self._lay(axis, value)
        self.found.curves = without_points(joined(self.found.curves))
        self.found.lines = [self._borne_out(line) for line in self.found.lines]
        self.found.wrong = [*self._contradicted(), *self._unmatched()]
        if self.found.passing or any("band" in curve.ends for curve in self.found.curves):
            self._look_beside()
        if self.found.parts:
            self._look_where_roots_pass_zero()
        if self.found.passing or self._more_changes():
            self.found.wrong += self._look_for_passages()
        return self.found

    # -- lines and the curves that cut them ---------------------------------------------------------------------------
    def _laid(self, axis: int, value: float) -> bool:
        return any(line.axis == axis and abs(line.value - value) <= 1e-6 for line in self.found.lines)

    def _lay(self, axis: int, value: float) -> None:
        """Search a line, and follow what lies on no curve yet."""
        try:
            answer = self.plane.onsets(axis, value)
        except AnalysisError as error:
            self.found.lines.append(OnsetLine(axis, value, (), complete=False, why=str(error)))
            self._failed.append(error)
            return
        inside = [o for o in answer.onsets if 2 * np.pi * o.frequency_hz <= self.plane.top]
        onsets = tuple((o.mu, 2 * np.pi * o.frequency_hz, o.roots) for o in inside)
        line = OnsetLine(axis, value, onsets, answer.vouched, SLOW if answer.slow else answer.why)
        self.found.lines.append(line)
        for onset in inside:
            if not _pairs(line, crossings(self.found.drawn, *line.ends), self.tolerance, only=onset.mu):
                seed = self._seed(line, onset)
                if seed is not None:
                    self._add(traced(self.plane, seed, self.tolerance))
        self._done += 1
        if self._progress is not None:
            self._progress(self._done, max(2 * self.number, self._done))

    def _add(self, new: StabilityCurve) -> None:
        """Keep a curve; what runs along another one is followed anew with that."""
        for k, old in enumerate(self.found.curves):
            new, self.found.curves[k] = apart(self.plane, new, old, self.tolerance)
        self.found.curves.append(new)

    def _seed(self, line: OnsetLine, onset: Onset) -> CurvePoint | None:
        kind: Kind = "standstill" if onset.kind == "divergence" else "crossing"
        if kind == "crossing" and onset.growth_slope is None:
            kind = "meeting"
        p = np.full(2, onset.mu)
        p[line.axis] = line.value
        omega = 2 * np.pi * onset.frequency_hz
        chord = self.plane.chord(p, np.eye(2)[1 - line.axis], (-REACH, REACH))
        right, left = chord.null_vectors(1j * omega, 0.0)
        spot = point_on(self.plane, kind, chord, omega, right.astype(complex), left.astype(complex))
        # Growth that opens at the end of a line may have begun before it, by less than rounding.
        return spot if spot is not None and inside(spot.p) else None

    # -- counts -------------------------------------------------------------------------------------------------------
    def _look(self, p: Array) -> None:
        """Count at a point (2,), or beside it where a curve runs through it, on which rounding would decide."""
        left = TRIED
        while True:
            left -= 1
            try:
                found = self.plane.modes(p)
            except AnalysisError:
                return
            slopes = self.plane.slopes(p, found)
            rates = slopes.real
            near = ON_CURVE * np.hypot(*rates)
            told = near > UNSTABLE_RELATIVE * np.abs(found.values)  # others are on no curve, or on the axis everywhere
            on = np.flatnonzero(told & (np.abs(found.values.real) <= near))
            if not len(on) or not left:
                break
            moved = p + AWAY / (self.number - 1) * rates[:, on[0]] / np.hypot(*rates[:, on[0]])
            if not np.all((moved > 0.0) & (moved < 1.0)):
                break
            p = moved
        self.found.looked.append(Looked(p, self.plane.count(found)))
        self._modes.append(ModesAtPoint(p, found.values, slopes))

    def _look_between(self) -> None:
        """Count where modes that decay at the points so far may grow: where their rates lead, and up to tops."""
        if self.plane.reversible:
            return
        mesh, seen = 1.0 / (self.number - 1), list(self._modes)
        for here in seen:
            self._look_ahead(here, mesh)
        most = self.plane.solves + CLIMBING * len(seen)
        for here, k in tops(self.plane, seen, mesh):
            if self.plane.solves >= most:
                break
            p = climb(self.plane, here, k, mesh)
            if p is not None:
                self._look(p)

    def _look_ahead(self, here: ModesAtPoint, mesh: float) -> None:
        """Count where modes would come to the axis within the mesh if they were straight, a little beyond that."""
        rates, growth = here.slopes.real, here.values.real
        size = np.sum(rates**2, axis=0)
        with np.errstate(all="ignore"):
            steps = -1.3 * growth / size * rates
        distance = np.hypot(*steps)
        near = np.flatnonzero(np.isfinite(distance) & (distance <= mesh))
        for k in near[np.argsort(distance[near])][:FORETOLD].tolist():
            p = np.clip(here.p + steps[:, k], EDGE, 1.0 - EDGE)
            if all(float(np.hypot(*(p - other.p))) > 0.05 * mesh for other in self.found.looked):
                self._look(p)

    def _borne_out(self, line: OnsetLine) -> OnsetLine:
        """A line whose search does not say that it is whole, or which a curve crosses where nothing was found: whole
        where between every two curves that cross it, and at even distances, as many roots grow as these say."""
        passed = crossings(self.found.drawn, *line.ends)
        pairs = _pairs(line, passed, self.tolerance)
        if line.why == SLOW:
            return line  # counts do not see it either
        if line.complete and len(pairs) == len(passed):
            return line
        places = [0.0, *(c.at for c in passed), 1.0]
        middles = [0.5 * (a + b) for a, b in pairwise(places) if b - a > 10 * BESIDE]
        grid = sorted({*middles, *np.linspace(0.0, 1.0, EVEN + 2)[1:-1].tolist()})
        looked = [at for place in grid if (at := self._at(_place(line, place))) is not None]
        whole = len(looked) > 1 and all(self._difference(one, other) is None for one, other in pairwise(looked))
        return replace(line, complete=whole, counted=whole)

    def _at(self, p: Array) -> Looked | None:
        """What grows at a point (2,); None where its matrices are singular."""
        try:
            return Looked(p, self.plane.count(self.plane.modes(p)))
        except AnalysisError:
            return None

    def _difference(self, one: Looked, other: Looked) -> Array | None:
        """Where (2,) between two points other roots begin or cease to grow than the curves say; None for nowhere, and
        where it is a growing mode that passes the highest frequency."""
        if self._fit(one, other):
            return None
        for _ in range(HALVINGS):
            middle = self._at(0.5 * (one.p + other.p))
            if middle is None:
                break
            if self._fit(one, middle):
                one = middle
            else:
                other = middle
        if one.count.judged and other.count.judged:
            return 0.5 * (one.p + other.p)
        self.found.passing = True
        return None

    def _fit(self, one: Looked, other: Looked) -> bool:
        return self.found.said(other.p, one)[1] == other.count.roots

    def _look_beside(self) -> None:
        """Count beside the points of all curves: where growing modes leave the band numbers from far away are none."""
        self.found.passing = True
        for curve in self.found.curves:
            for spot in curve.spots[::2]:
                calm = spot.p - ASIDE * spot.gradient / np.hypot(*spot.gradient)
                if np.all((calm > 0) & (calm < 1)):
                    self._look(calm)

    def _look_where_roots_pass_zero(self) -> None:
        """Count on both sides of divergence where several roots grow: what passes zero there is either of two that a
        pair parted into, which is told by no count before that, or one that was alone all the way."""
        for curve in self.found.curves:
            for spot in curve.spots[::2] if curve.kind == "standstill" else ():
                aside = ASIDE * spot.gradient / np.hypot(*spot.gradient)
                sides = [spot.p - aside, spot.p + aside]
                if np.all((np.array(sides) > 0) & (np.array(sides) < 1)) and self.found.said(sides[1])[1] > 1:
                    for side in sides:
                        self._look(side)

    def _more_changes(self) -> bool:
        """Whether a growing mode is near the highest frequency somewhere, or modes are not as many as curves say."""
        looked = self.found.looked
        return not all(at.count.judged for at in looked) or any(self._differ(*pair) for pair in pairwise(looked))

    def _differ(self, one: Looked, other: Looked) -> bool:
        modes, _, parted = self.found.said(other.p, one)
        return parted or modes != other.count.modes

    def _look_for_passages(self) -> list[tuple[str, Array]]:
        """Count on a mesh that is fine where no curve says how the number of growing modes changes; and where it does
        other than by modes that pass the highest frequency or meet at rest."""
        seen, pairs = refined(self._clear, self._differ, [(at.p, at) for at in self.found.looked])
        judged = [(one, other) for one, other in pairs if one.count.judged and other.count.judged]
        wrong = [place for one, other in judged if (place := self._difference(one, other)) is not None]
        self.found.passing |= len(judged) < len(pairs)
        self.found.looked += seen
        # Where a curve leaves the band, growth ends at it on one side and at the highest frequency on the other.
        return [("growth begins or ends where no curve is,", place) for place in wrong if not self._leaves_near(place)]

    def _leaves_near(self, p: Array) -> bool:
        """Whether a curve ends at the highest frequency within a cell of the finest mesh."""
        tips = [
            tip for curve in self.found.curves
            for tip, end in zip((curve.points[0], curve.points[-1]), curve.ends, strict=True) if end == "band"
        ]  # fmt: skip
        return any(np.hypot(*(tip - p)) <= FINEST for tip in tips)

    def _clear(self, p: Array) -> Looked | None:
        """What grows at a point (2,); None where a curve is so near that rounding, or its cubic, would decide."""
        try:
            found = self.plane.modes(p)
        except AnalysisError:
            return None
        near = self.tolerance * np.hypot(*self.plane.slopes(p, found).real)
        told = near > UNSTABLE_RELATIVE * np.abs(found.values)
        if np.any(told & (np.abs(found.values.real) <= near)):
            return None
        return Looked(p, self.plane.count(found))

    def _contradicted(self) -> list[tuple[str, Array]]:
        """Points at which the curves say otherwise than what was counted, from one of them to the next."""
        looked, wrong = self.found.looked, list[tuple[str, Array]]()
        for k in range(1, len(looked)):
            at = looked[k]
            since = min(looked[:k], key=lambda other: float(np.hypot(*(other.p - at.p))))
            place = self._difference(since, at)
            if place is not None:
                wrong.append(("growth begins or ends where no curve is,", place))
        return wrong

    def _unmatched(self) -> list[tuple[str, Array]]:
        """Onsets of lines that no curve passes through, and curves that cross a line where no onset is."""
        wrong: list[tuple[str, Array]] = []
        for line in self.found.lines:
            if line.counted:
                continue
            passed = crossings(self.found.drawn, *line.ends)
            pairs = _pairs(line, passed, self.tolerance)
            for k, onset in enumerate(line.onsets):
                if k not in pairs and EDGE < onset[0] < 1 - EDGE:
                    wrong.append(("no curve passes an onset", _place(line, onset[0])))
            for j, crossing in enumerate(passed):
                banded = crossing.omega <= 0.999 * self.plane.top
                if banded and j not in pairs.values() and EDGE < crossing.at < 1 - EDGE and crossing.sine > EDGE:
                    wrong.append(("a curve crosses a line where no onset was found", _place(line, crossing.at)))
        return wrong


def _place(line: OnsetLine, at: float) -> Array:
    p = np.full(2, at)
    p[line.axis] = line.value
    return p


def _pairs(
    line: OnsetLine, passed: list[Crossing], tolerance: float, only: float | None = None
) -> dict[int, int]:
    """Numbers of onsets of a line → numbers of crossings that are the same, each used once; the nearest first. only:
    nothing but what belongs to the onset at that place."""
    near = [
        (abs(crossing.at - at), k, j)
        for k, (at, omega, _) in enumerate(line.onsets)
        for j, crossing in enumerate(passed)
        if abs(crossing.at - at) <= 3 * tolerance / max(crossing.sine, 0.03)
        and abs(crossing.omega - omega) <= ALIKE * max(omega, crossing.omega)
    ]  # fmt: skip
    pairs: dict[int, int] = {}
    for _, k, j in sorted(near):
        if k not in pairs and j not in pairs.values():
            pairs[k] = j
    if only is None:
        return pairs
    return {k: j for k, j in pairs.items() if line.onsets[k][0] == only}
