"""The lowest onset over two damping values of a case, and where more damping lowers it.

Damping may destabilise: where it differs between the two modes that meet, the onset falls below that without damping
(N. Hoffmann, L. Gaul, Effects of damping on mode-coupling instability in friction induced oscillations, ZAMM 83 (2003)
524–534). What damping d does at an onset, where Re λ(μ, d) = 0, needs no second solution:

    dμ_c/dd = − Re(∂λ/∂d) / Re(∂λ/∂μ) .
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Literal, get_args

import numpy as np

from ..asking import FUNCTION, NUMBER, NUMBERS, PAIR, TEXT, takes
from ..case.usual import MOST_FRICTION, TOO_MUCH
from ..errors import AnalysisError, CaseError
from ..modal.source import by_receptance
from ..typing import Array
from .damping_full import FullSearch, LowestOnset
from .damping_reduced import ReducedSearch
from .damping_result import ROUNDING, Confirmed, DampingMap
from .provenance import provenance
from .sensitivities import number_at
from .workspace import Problem, Workspace

MOST_POINTS = 10_000
LARGE = 1000  # freedoms from which a reduced model pays
MANY = 6  # points of the map, too

Method = Literal["auto", "full", "reduced"]
FOLLOWED = (
    "onsets are those of modes followed from mu = 0, not sought anew at each point; `stridor onsets` does that for one"
)


@takes(
    x=TEXT, y=TEXT, x_range=NUMBERS, y_range=NUMBERS, grid=PAIR, mu_range=PAIR.or_none(), bound=NUMBER,
    progress=FUNCTION,
)  # fmt: skip
def damping_map(
    problem: Problem,
    x: str,
    y: str,
    *,
    x_range: tuple[float, float] | Sequence[float],
    y_range: tuple[float, float] | Sequence[float],
    grid: tuple[int, int] = (9, 9),
    mu_range: tuple[float, float] | None = None,
    max_frequency_hz: float | None = None,
    method: Method = "auto",
    bound: float = 1e-8,
    progress: Callable[[int, int], None] | None = None,
) -> DampingMap:
    """The lowest onset in ``mu_range`` over a grid of two numbers of the case, such as "bodies.pad.damping.mass" and
    "bodies.disc.damping.mass", or a body's two Rayleigh factors, or "dashpots.NAME.damping".

    x_range, y_range: two ends, divided evenly into ``grid`` values, or three and more values as they are. Slopes come
    from the eigenvectors at the onset, with the touching nodes held.

    method: "full": every point of the grid is a search for onsets of its own, so that none is missed that `onsets`
    would find. "reduced": one reduced model over μ, x and y, whose eigenvalues are within ``bound`` of the full ones by
    its own estimate, serves all points; the lowest onset, those at the corners and the one estimated worst are solved
    for again in the full problem. It takes dampings only. "auto": the reduced model for large systems where it can be
    made. progress: called with points done and planned.

    Raises CaseError for paths that lead to no number or to the same, and for "reduced" where there is no reduced model.
    """
    started = time.perf_counter()
    work = Workspace.of(problem)
    case = work.case("the map of dampings")
    if method not in get_args(Method):
        raise CaseError("method", method, f"one of {', '.join(get_args(Method))}")
    low, high = case.modal.friction_range if mu_range is None else mu_range
    if high > MOST_FRICTION:
        raise CaseError("mu_range", mu_range, TOO_MUCH)
    top = case.modal.max_frequency_hz if max_frequency_hz is None else max_frequency_hz
    xs, ys = _values(x_range, grid[0], "x_range"), _values(y_range, grid[1], "y_range")
    if len(xs) * len(ys) > MOST_POINTS:
        raise CaseError("grid", f"{len(xs)} × {len(ys)}", f"at most {MOST_POINTS} points in all")
    if x == y:
        raise CaseError("y", y, "the same number as x; give another one")
    for path in (x, y):
        number_at(case, path)
    full = FullSearch(case, (x, y), (low, high), top)
    search, notes = _search(work, full, xs, ys, method, bound)
    table = _Table(search, xs, ys, (x, y))
    table.fill(progress)
    if isinstance(search, ReducedSearch):
        notes = (*notes, table.confirm(search))
    undamped = table.undamped()
    return DampingMap(
        x, y, xs, ys, (low, high), top, table.mu, table.frequency, table.slope_x, table.slope_y, table.residual,
        None if undamped is None else undamped.mu,
        (*table.warnings, *work.one_for_all),
        provenance(work, "damping map", time.perf_counter() - started, method=method, bound=bound),
        "reduced" if isinstance(search, ReducedSearch) else "full",
        table.error if isinstance(search, ReducedSearch) else None,
        tuple(table.confirmed),
        notes,
    )  # fmt: skip


def _search(
    work: Workspace, full: FullSearch, xs: Array, ys: Array, method: Method, bound: float
) -> tuple[FullSearch | ReducedSearch, tuple[str, ...]]:
    """How onsets are searched for, and what is to be said about it."""
    if method == "auto":
        system = work.system()
        # Matrices that depend on μ may be symmetric at one; no receptance is theirs at every other.
        closed = not work.varies and by_receptance(system, work.options)
        if system.size < LARGE or len(xs) * len(ys) < MANY or closed:
            method = "full"
    if method == "full":
        return full, (FOLLOWED,)
    ends = (float(xs[0]), float(xs[-1])), (float(ys[0]), float(ys[-1]))
    try:
        search = ReducedSearch.of(full, ends, bound)
        return search, search.notes
    except (CaseError, AnalysisError) as error:
        if method == "reduced":
            raise
        return full, (f"every point is searched in the full problem, there is no reduced model: {error}", FOLLOWED)


class _Table:
    """The onsets of all points, as they are found."""

    def __init__(self, search: FullSearch | ReducedSearch, xs: Array, ys: Array, paths: tuple[str, str]) -> None:
        self.search, self.xs, self.ys, self.paths = search, xs, ys, paths
        empty = np.full((6, len(xs), len(ys)), np.nan)
        self.mu, self.frequency, self.slope_x, self.slope_y, self.residual, self.error = empty
        self.warnings: list[str] = []
        self.confirmed: list[Confirmed] = []

    def fill(self, progress: Callable[[int, int], None] | None) -> None:
        """Search at every point, neighbours one after the other."""
        order = [(i, j) for i in range(len(self.xs)) for j in range(len(self.ys))[:: -1 if i % 2 else 1]]
        for done, (i, j) in enumerate(order, start=1):
            try:
                found, told = self.search.lowest(float(self.xs[i]), float(self.ys[j]))
            except AnalysisError as error:
                found, told = None, (str(error),)
            self.warnings += [f"{self._place(i, j)}: {words}" for words in told]
            if found is not None:
                self._take(i, j, found)
            if progress is not None:
                progress(done, len(order))

    def confirm(self, search: ReducedSearch) -> str:
        """Solve the lowest onset, those at the corners and the one estimated worst in the full problem; returns a
        sentence about it."""
        for i, j in self._chosen():
            before = self._found(i, j)
            try:
                after = search.confirmed(float(self.xs[i]), float(self.ys[j]), before)
            except AnalysisError as error:
                self.warnings.append(f"{self._place(i, j)}: not confirmed in the full problem: {error}")
                continue
            off = abs(after.mu - before.mu)
            if off > max(before.error, ROUNDING):
                self.warnings.append(
                    f"{self._place(i, j)}: the reduced model's onset is {off:.1e} off, where {before.error:.1e} was "
                    'estimated; take a smaller bound, or method="full"'
                )
            point = float(self.xs[i]), float(self.ys[j])
            self.confirmed.append(Confirmed(*point, after.mu, before.mu, after.residual))
            self._take(i, j, after)
        return self._summary(search)

    def undamped(self) -> LowestOnset | None:
        """The onset without damping."""
        try:
            return self.search.undamped()
        except AnalysisError as error:
            self.warnings.append(f"without damping: {error}")
            return None

    def _summary(self, search: ReducedSearch) -> str:
        onsets = int(np.isfinite(self.mu).sum())
        text = f"{onsets} onsets from a reduced model of {search.model.size} unknowns"
        if not self.confirmed:
            return text
        off, rest = (max(getattr(c, name) for c in self.confirmed) for name in ("difference", "residual"))
        known = np.isfinite(self.error)
        worst = f", estimated within {np.max(self.error[known]):.1e}" if known.any() else ""
        return (
            f"{text}{worst}; {len(self.confirmed)} of them solved again in the full problem: off by {off:.1e} at most, "
            f"backward error {rest:.1e}"
        )

    def _chosen(self) -> list[tuple[int, int]]:
        """Points to be confirmed: where onsets are lowest, at the corners, where the error is estimated to be largest;
        but not what was solved in the full problem already."""
        open_ = np.isfinite(self.mu) & np.isnan(self.residual)
        if not open_.any():
            return []
        lowest, worst = np.where(open_, -self.mu, -np.inf), np.where(open_ & np.isfinite(self.error), self.error, -1.0)
        ends = [(i, j) for i in (0, len(self.xs) - 1) for j in (0, len(self.ys) - 1)]
        chosen = [np.unravel_index(int(np.argmax(table)), table.shape) for table in (lowest, worst)]
        indices = [(int(i), int(j)) for i, j in chosen] + [index for index in ends if open_[index]]
        return list(dict.fromkeys(indices))

    def _found(self, i: int, j: int) -> LowestOnset:
        slopes = float(self.slope_x[i, j]), float(self.slope_y[i, j])
        numbers = (float(table[i, j]) for table in (self.residual, self.error))
        return LowestOnset(float(self.mu[i, j]), float(self.frequency[i, j]), slopes, *numbers)

    def _take(self, i: int, j: int, found: LowestOnset) -> None:
        self.mu[i, j], self.frequency[i, j] = found.mu, found.frequency_hz
        self.slope_x[i, j], self.slope_y[i, j] = found.slopes
        self.residual[i, j], self.error[i, j] = found.residual, found.error

    def _place(self, i: int, j: int) -> str:
        return f"{self.paths[0]} = {self.xs[i]:g}, {self.paths[1]} = {self.ys[j]:g}"


def _values(given: tuple[float, float] | Sequence[float], count: int, name: str) -> Array:
    values = np.asarray(given, dtype=float)
    if values.ndim != 1 or len(values) < 2 or not np.all(np.isfinite(values)) or np.any(np.diff(values) <= 0):
        raise CaseError(name, given, "two ends or more values, rising")
    if len(values) > 2:
        return values
    if count < 2:
        raise CaseError("grid", count, "at least two values along each number")
    return np.linspace(values[0], values[1], count)
