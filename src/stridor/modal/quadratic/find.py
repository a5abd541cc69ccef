"""Every eigenvalue of a large sparse quadratic problem in a region, with as few factorisations as may be."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...direct import Factor, SingularMatrix, factorise
from ...errors import AnalysisError
from ...stages import passing, stage
from ...threads import one_thread
from ...typing import Array, BoolArray, ComplexArray
from .count import undamped_count, unknown
from .dense import all_modes
from .krylov import Krylov
from .polish import ALIKE, SPREAD, biorthogonal, merged, pairs, polished, snapped, tuned
from .problem import Quadratic
from .region import BORDER, MARGIN, PAD, Disc, Region, cells, remaining, uncovered
from .search import BLOCK, DiscModes, Search, TooClose

WHOLE = 600  # freedoms up to which all eigenvalues are found at once where a few discs do not do
# Backward error that does for what lies as dense as overdamped modes do about −1/α₂, or as a mode that passes zero does
# beside a motion as a whole.
CROWDED = 1e-8
FEW_SHIFTS = 4  # discs after which they do not
DENSE = 60  # freedoms up to which all eigenvalues are found at once
COUNTED = 1500  # and up to which the argument principle counts them unasked: it takes about a hundred determinants
BASIS_BYTES = 1.5e9  # of the Krylov basis of one shift
FEWEST, LARGEST = 160, 500  # vectors it may hold at most, whatever their length
SHIFTS = 60  # factorisations at most
MOVES = 5  # tries to find a shift beside an eigenvalue it has hit
POLISHED = 12  # eigenpairs that may need factors of their own
ROUNDS = 2  # times that missing eigenvalues are looked for


@dataclass(frozen=True)
class Completeness:
    """What speaks for no eigenvalue in the region being missed, as data and in one sentence.

    searched: the region, bounded. discs: where all Ritz values have converged; covered: whether together they cover it.
    looks: second looks from independent random blocks, the left vectors' own search being one; later: eigenvalues that
    only these brought. counted: eigenvalues of both half planes within a contour around the region by the argument
    principle, None where that was not afforded or did not settle; missing: how many of them were not found, negative
    where too many were. undamped: frequencies of the undamped symmetric part in the band, a hint only, if asked for.
    """

    complete: bool
    sentence: str
    searched: Region
    discs: tuple[Disc, ...] = ()
    covered: bool = True
    looks: int = 0
    later: int = 0
    counted: int | None = None
    missing: int | None = None
    undamped: int | None = None


@dataclass(frozen=True)
class RegionModes:
    """Eigenvalues (k,) [1/s] sorted by imaginary, then real part; of conjugate pairs the one with Im λ ≥ 0.

    right (n, k): P(λ)x = 0; left (n, k): yᵀP(λ) = 0, transposed and not conjugated; both of unit norm. residual and
    left_residual (k,): componentwise backward errors. beside (n, l): shapes found on the way of eigenvalues outside the
    region, of which nothing is claimed, where they were asked for. factorisations, solves (single right sides), seconds
    and memory_bytes (of the factors held at one time) tell what it cost.
    """

    values: ComplexArray
    right: ComplexArray
    left: ComplexArray | None
    residual: Array
    left_residual: Array | None
    completeness: Completeness
    factorisations: int
    solves: int
    seconds: float
    memory_bytes: int
    beside: ComplexArray | None = None


@one_thread
def find_modes(
    problem: Quadratic, region: Region, *, left: bool = False, tolerance: float = 1e-10, solver: str | None = None,
    guess: Any = None, count: bool | None = None, hint: bool = False, still: float = 0.0, others: bool = False,
) -> RegionModes:  # fmt: skip
    """All eigenvalues of λ²M + λD + K in ``region``, with right and, if asked for, left vectors.

    tolerance: backward error of every pair. guess (n, k): shapes of a neighbouring problem to start from; they decide
    nothing, and save little. count: whether the argument principle is to count; by default up to 1500 freedoms.
    hint: count undamped modes too, at two more factorisations. still [1/s]: eigenvalues no larger are motions as a
    whole, of which the matrices may hold nothing but rounding, and need not reach the tolerance. others: whether shapes
    met on the way are wanted (`RegionModes.beside`). Raises AnalysisError where P(λ) is singular for every λ, the
    region holds too many eigenvalues, or some do not reach the tolerance.
    """
    started = time.perf_counter()
    run = _RegionSearch(problem, region.bounded(), left, tolerance, solver, guess, still, others)
    run.counting = problem.size <= COUNTED if count is None else count
    if problem.size <= DENSE:
        sides, evidence = run.dense(endless=not math.isfinite(region.re_max))
        try:
            values, right, y = run.chosen(sides)
        except UnsettledError:
            run.tolerance = max(tolerance, CROWDED)
            values, right, y = run.chosen(sides)
    else:
        try:
            sides, evidence = run.sparse()
            values, right, y = run.chosen(sides)
        except (_CrowdedError, UnsettledError):
            if problem.size > WHOLE:
                raise
            run.region, run.tolerance = region.bounded(), max(tolerance, CROWDED)
            sides, evidence = run.dense(endless=not math.isfinite(region.re_max))
            values, right, y = run.chosen(sides)
    order = np.lexsort((values.real, values.imag))
    values, right, y = values[order], right[:, order], None if y is None else y[:, order]
    undamped = undamped_count(problem, region, solver=solver) if hint else None
    run.factorisations += 2 * hint
    return RegionModes(
        values, right, y, problem.backward_error(values, right),
        None if y is None else problem.transposed.backward_error(values, y), evidence(undamped),
        run.factorisations, run.solves, time.perf_counter() - started, run.memory, run.beside,
    )  # fmt: skip


class UnsettledError(AnalysisError):
    """Eigenvectors do not reach the tolerance."""


class _CrowdedError(Exception):
    """A small problem that discs take longer for than QZ does: overdamped, or with many modes about the axis."""


@dataclass
class _Site:
    """One shift: its factors and the searches that use them."""

    factor: Factor
    searches: list[Search]

    @property
    def disc(self) -> Disc:
        """The smaller one, where right and left vectors have got differently far."""
        return min((s.disc for s in self.searches), key=_radius)


@dataclass
class _RegionSearch:
    """The state of one call."""

    problem: Quadratic
    region: Region
    left: bool
    tolerance: float
    solver: str | None
    guess: Any
    still: float = 0.0
    others: bool = False
    counting: bool = False
    factorisations: int = 0
    solves: int = 0
    memory: int = 0
    sites: list[_Site] = field(default_factory=list)
    alive: int = 0
    beside: ComplexArray | None = None

    @property
    def padded(self) -> Region:
        """The region and a little around it, in which eigenvectors are kept."""
        return self.region.grown(PAD * max(self.region.height, self.region.width))

    def keep(self, values: ComplexArray) -> BoolArray:
        """Eigenvalues whose vectors are wanted."""
        return self.padded.contains(values)

    def dense(self, *, endless: bool) -> tuple[list[DiscModes], Callable[[int | None], Completeness]]:
        """Everything, by QZ; endless: however fast it grows."""
        lam, x, y = all_modes(self.problem, self.region.scale)
        strip = lam[(lam.imag >= 0) & (lam.imag <= self.region.im_max)]
        if endless and len(strip):
            self.region = replace(self.region, re_max=max(self.region.re_max, 1.1 * float(strip.real.max())))
        inside = self.keep(lam)
        lam, x, y = lam[inside], x[:, inside], y[:, inside]
        sides = [DiscModes(lam, x, self.problem.backward_error(lam, x))]
        if self.left:
            sides.append(DiscModes(lam, y, self.problem.transposed.backward_error(lam, y)))

        def evidence(undamped: int | None) -> Completeness:
            text = f"Complete: QZ computes all eigenvalues of {self.problem.size} freedoms at once."
            return Completeness(True, text + ("" if endless else self._cut()), self.region, undamped=undamped)

        return sides, evidence

    def sparse(self) -> tuple[list[DiscModes], Callable[[int | None], Completeness]]:
        """Disc by disc, and the check that none is missing."""
        self._cover()
        sides = self._sides()
        missing, rounds = self._missing(sides[0]), 0
        while missing is not None and missing > 0 and rounds < ROUNDS:
            for site in self.sites:
                for search in site.searches:
                    search.look(2 * BLOCK, 4 + 2 * rounds)
            if rounds:
                # The same shifts have not shown it twice: another place.
                for cell in cells(self.padded):
                    self._visit(cell, cell.shift() + 0.2 * (0.3 + 1j) * min(cell.width, cell.height))
            sides = self._sides()
            missing, rounds = self._missing(sides[0]), rounds + 1
        self._count_solves()
        discs = tuple(site.disc for site in self.sites)
        covered = not uncovered(self.region, list(discs))
        if not (covered and missing in (None, 0)) and self.problem.size <= WHOLE:
            self._release()
            raise _CrowdedError
        searches = [s for site in self.sites for s in site.searches]
        looks = sum(s.looks for s in searches) + (len(self.sites) if self.left else 0)
        later = sum(s.later for s in searches)
        counted = None if missing is None else missing + self._enclosed(sides[0])

        def evidence(undamped: int | None) -> Completeness:
            complete = covered and missing in (None, 0)
            text = self._sentence(discs, covered, later, counted, missing)
            return Completeness(
                complete, text, self.region, discs, covered, looks, later, counted, missing, undamped
            )  # fmt: skip

        for site in self.sites:
            site.factor.free()
        beside = [s.beside for site in self.sites for s in site.searches if s.beside is not None]
        self.beside = np.hstack(beside) if beside else None
        return sides, evidence

    def chosen(self, sides: list[DiscModes]) -> tuple[ComplexArray, ComplexArray, ComplexArray | None]:
        """What is reported: inside the region, each with its left vector, all to the tolerance."""
        scale = self.padded.scale
        found = self._selected(sides[0], scale)
        found = self._converged(found, self.problem, "right")
        if not self.left:
            return found.values, found.shapes, None
        other = self._with_partners(found, sides[1])
        # Left vectors are those of the very eigenvalues reported.
        transposed = self.problem.transposed
        error = transposed.backward_error(found.values, other)
        for index in np.flatnonzero(error > 0.1 * self.tolerance):
            lam = complex(found.values[index])
            near = max(float(np.abs(sides[1].values - lam).min(initial=np.inf)), SPREAD * scale)
            other[:, index] = tuned(transposed, lam, sides[1], near)
        error = transposed.backward_error(found.values, other)
        y = self._converged(DiscModes(found.values, other, error), transposed, "left").shapes
        dual = biorthogonal(self.problem, found.values, found.shapes, y, scale)
        worse = self.problem.transposed.backward_error(found.values, dual) > self.tolerance
        return found.values, found.shapes, np.where(worse, y, dual)

    def _cover(self) -> None:
        """Shifts until discs cover the padded region."""
        pending = cells(self.padded)
        while pending:
            cell = pending.pop(0)
            if not uncovered(cell, [site.disc for site in self.sites]):
                continue
            if len(self.sites) >= FEW_SHIFTS and self.problem.size <= WHOLE:
                self._release()
                raise _CrowdedError
            if len(self.sites) >= SHIFTS:
                raise AnalysisError(
                    f"{len(self.sites)} factorisations do not get through the region; ask for a narrower one"
                )
            # Where a first disc about a real shift has not got as far as it was to, the next ones are smaller.
            real = None if self.sites else cell.real_shift()
            site = self._visit(cell, cell.shift() if real is None else real)
            if not site.disc.covers(cell):
                pending = remaining(cell, [s.disc for s in self.sites]) + pending

    def _release(self) -> None:
        """Free what the discs hold."""
        self._count_solves()
        for site in self.sites:
            site.factor.free()

    @passing()
    def _visit(self, cell: Region, shift: complex | float) -> _Site:
        """One factorisation, and all it gives."""
        problem, rng = self.problem, np.random.default_rng(3)
        for _ in range(MOVES):
            stage(f"all modes around {abs(shift) / 6.283185307179586:.4g} Hz, {problem.size} unknowns")
            radius = MARGIN * cell.farthest(shift)
            try:
                factor = factorise(problem.at(shift), solver=self.solver)
            except SingularMatrix:
                self.factorisations += 1
                shift = _beside(shift, radius, rng)
                continue
            self.factorisations += 1
            try:
                site = self._searched(factor, shift, radius)
            except (TooClose, SingularMatrix):
                factor.free()
                shift = _beside(shift, radius, rng)
                continue
            self.sites.append(site)
            self.alive += factor.memory_bytes
            self.memory = max(self.memory, self.alive)
            if not self.counting:
                # Nothing will be asked of it again: without its factors and vectors there is room for the next.
                factor.free()
                self.alive -= factor.memory_bytes
                for search in site.searches:
                    self.solves += search.krylov.solves
                    search.release()
            return site
        raise AnalysisError(
            f"P(λ) is singular at λ = {shift:.6g} 1/s and everywhere near it: some motion lacks "
            "mass and stiffness, or a value is so large that the others are lost beside it"
        )

    def _searched(self, factor: Factor, shift: complex | float, radius: float) -> _Site:
        def forward(right: Any) -> Any:
            return factor.solve(right, refine=False)

        def transposed(right: Any) -> Any:
            return factor.solve(right, transpose=True, refine=False)

        n = self.problem.size
        each = 1 if isinstance(shift, complex) else 2  # real vectors take half the room, and modes are two
        most = min(max(int(each * BASIS_BYTES / (16 * n)), each * FEWEST), each * LARGEST, 2 * n)
        searches: list[Search] = []
        sides = [(self.problem, forward)] + ([(self.problem.transposed, transposed)] if self.left else [])
        for problem, solve in sides:
            search = Search(problem, Krylov(problem, solve, shift, radius), self.keep, most, self.tolerance)
            search.seed += 100 * len(searches)
            search.others = self.others and not searches
            search.run(None if self.guess is None or searches else np.asarray(self.guess))
            searches.append(search)
        if not self.left:
            searches[0].look()
        elif not _agree(searches, SPREAD * self.padded.scale):
            for search in searches:
                search.look()
        return _Site(factor, searches)

    def _sides(self) -> list[DiscModes]:
        """Right and left pairs of all discs together."""
        scale = self.padded.scale
        return [
            merged([_collected(site.searches[side]) for site in self.sites], scale) for side in range(1 + self.left)
        ]

    def _missing(self, found: DiscModes) -> int | None:
        if not self.counting:
            return None
        guards = [s.guards for site in self.sites for s in site.searches[:1]]
        others = np.concatenate([*guards, np.zeros(0, dtype=complex)])
        # Those in the lower half plane are known as well, and of no interest inside.
        others = np.concatenate([others, found.values.conj()])
        others = others[~self.padded.contains(others, slack=1e-3)]
        inner = self.region.grown(BORDER * self.region.scale)
        return unknown(self.problem, inner, self.padded, np.concatenate([found.values, others]))

    def _enclosed(self, found: DiscModes) -> int:
        return int(self.padded.contains(found.values).sum())

    def _count_solves(self) -> None:
        if self.counting:
            self.solves += sum(s.krylov.solves for site in self.sites for s in site.searches)

    def _selected(self, found: DiscModes, scale: float) -> DiscModes:
        values = snapped(found.values, scale)
        inside = np.flatnonzero(self.region.contains(values) & (values.imag >= 0))
        x = found.shapes[:, inside]
        return DiscModes(values[inside], x, self.problem.backward_error(values[inside], x))

    def _converged(self, found: DiscModes, problem: Quadratic, which: str) -> DiscModes:
        """With those that miss the tolerance improved one by one."""
        # Of zero but for rounding a sharper one is another rounding, the same for several perhaps.
        bad = np.flatnonzero(~(found.error <= self.tolerance) & ~(np.abs(found.values) <= self.still))
        values, shapes = found.values.astype(complex), found.shapes.astype(complex)  # copies
        error = found.error.copy()
        for index in bad[:POLISHED]:
            better = polished(problem, complex(values[index]), shapes[:, index], solver=self.solver)
            self.factorisations += 1
            if better is None:
                continue
            lam, x, left = better
            if left < error[index] and (which == "right" or abs(lam - values[index]) <= ALIKE * self.padded.scale):
                values[index], shapes[:, index], error[index] = lam, x, left
        bad = np.flatnonzero(~(error <= self.tolerance) & ~(np.abs(values) <= self.still))
        if len(bad):
            shown = ", ".join(f"{v:.6g}" for v in values[bad[:3]])
            raise UnsettledError(
                f"{len(bad)} {which} eigenvectors do not reach a backward error of {self.tolerance:g}: "
                f"λ = {shown} 1/s, the worst leaves {error[bad].max():.1e}"
            )
        return DiscModes(values, shapes, error)

    def _with_partners(self, found: DiscModes, left: DiscModes) -> ComplexArray:
        """Left vectors (n, k) of the right pairs; one that the left search lacks by inverse iteration."""
        y = np.zeros_like(found.shapes)
        ours, theirs = pairs(found.values, left.values, 1e-4 * self.padded.scale)
        y[:, ours] = left.shapes[:, theirs]
        for index in np.setdiff1d(np.arange(len(found.values)), ours):
            self.factorisations += 1
            partner = polished(self.problem.transposed, complex(found.values[index]), None, solver=self.solver)
            if partner is not None:
                y[:, index] = partner[1]
        return y

    def _sentence(
        self, discs: tuple[Disc, ...], covered: bool, later: int, counted: int | None, missing: int | None
    ) -> str:
        number = f"{len(discs)} disc{'s' if len(discs) > 1 else ''}"
        cut = self._cut()
        if missing is not None and missing != 0:
            what = f"{missing} more than were found" if missing > 0 else f"{-missing} fewer than were found"
            return f"INCOMPLETE: the argument principle counts {counted} eigenvalues around the region, {what}.{cut}"
        if not covered:
            return f"INCOMPLETE: {number} in which all have converged do not cover the region.{cut}"
        second = "the search for left vectors" if self.left else "a second look from another random block"
        brought = f"{second} brought {later} more and then no other" if later else f"{second} brought no other"
        if missing == 0:
            return (
                f"Complete: all eigenvalues in {number} that cover the region have converged, {brought}, and the "
                f"argument principle counts the same {counted} around the region.{cut}"
            )
        return (
            f"Complete as far as can be told without a count: all eigenvalues in {number} that cover the region have "
            f"converged, and {brought}.{cut}"
        )

    def _cut(self) -> str:
        return f" Growth rates above {self.region.re_max:.6g} 1/s were not searched."


def _beside(shift: complex | float, radius: float, rng: np.random.Generator) -> complex | float:
    """Another shift nearby, on the real axis where this one is."""
    step = 0.03 * radius * complex(*rng.standard_normal(2))
    return shift + step if isinstance(shift, complex) else shift + step.real


def _collected(search: Search) -> DiscModes:
    """What a search contributes: only what is in its disc."""
    return search.found


def _agree(searches: list[Search], near: float) -> bool:
    """Whether right and left searches hold the same eigenvalues, those close to the edge of the smaller disc aside."""
    radius = min(s.disc.radius for s in searches)
    inside: list[ComplexArray] = []
    for s in searches:
        distance = np.abs(s.found.values - s.disc.centre)
        inside.append(s.found.values[distance <= (1 - 1e-6) * radius])
    return len(inside[0]) == len(inside[1]) == len(pairs(inside[0], inside[1], near)[0])


def _radius(disc: Disc) -> float:
    return disc.radius
