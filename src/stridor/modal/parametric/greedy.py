"""Growing a basis until every point of a box passes, and cutting it down to what passes as well.

Candidates are the points of a grid and some in no relation to it, where errors are measured. A point passes when
residuals of all its modes say so; else answers to what all such points leave join the basis and they are asked again.
The basis is cut by the singular values of the modes at the points that passed, as far as errors stay small where they
are measured and error estimates stay within the bound at further points; those that fail there are enriched in turn.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg as sl

from ...direct import Factor
from ...errors import AnalysisError
from ...stages import passing, stage
from ...typing import Array, ComplexArray, IntArray, Sparse
from ..tolerances import AT_REST
from .basis import ReducedBasis, real_and_imaginary
from .dense import DenseModes, assembled, dense_modes
from .model import ReducedModel, product_over_slope, sketched, sketched_rests
from .problem import ParametricProblem
from .states import spanned

SEED = 20061
GUARD = 1.5  # modes up to this much above the band take part from the start
MARGIN = 1.03  # modes up to this much above the band are made exact
WEAKEST = 3e-2  # of the strongest direction of a block of residuals: what waits for another point
ALONG = 1e-6  # of a unit vector: what of modes of the full problem is on the basis already
LEFT_OUT = 1e-2  # of a unit vector: new directions smaller than this are not worth a column
PASSED = 0.3  # of the bound: what residuals at a point may say
MEASURED = 0.2  # of the bound: what an error may be where it is measured
WATCHFUL = 0.5  # of the bound: what an estimate may be at points that stand for all others
SAFETY = 3.0  # the constant of error estimates over the largest one seen
WATCHED = 6  # points for each parameter whose estimates have to stay within the bound, beside those of the grid
FINE = 3  # parameters up to which the grid has points between the corners
ASKED = 3  # of the points whose estimates fail, the worst ones, that are asked themselves
FIRST_CUT, LESS = 3e-4, 1.6  # of the largest singular value: what is cut away at first, and how it sinks
FINE_CUT = 1e-6  # of it: what is cut away where the whole basis is dear
TOGETHER, FEWER = 64, 40  # answers at most that join the basis at once; fewer where a large basis is dear
ROUNDS = 25
PAIR = 2  # of the points that fail, how many are asked together where each takes the whole companion matrix
STATES = 10.0 ** -np.arange(7.0, 12.5, 0.5)  # of the strongest: states left out, tried in turn
WORTH = 1.4  # states for each unknown, of which the whole companion matrix has two, up to which they pay
SPARED = 0.8  # of the bound: what an estimate may be with them

Point = Mapping[str, float]


@dataclass
class ReductionCost:
    """What making a model takes, by part."""

    seconds: dict[str, float] = field(default_factory=dict[str, float])
    solves: int = 0
    _last: float = field(default_factory=time.perf_counter)

    def lap(self, part: str) -> None:
        """Book the time since the last one."""
        now = time.perf_counter()
        self.seconds[part] = self.seconds.get(part, 0.0) + now - self._last
        self._last = now


@dataclass
class Greedy:
    """One basis on its way to a model. factor: of the static ``operator`` (n, n)."""

    basis: ReducedBasis
    operator: Sparse
    factor: Factor
    frequency: float
    bound: float
    work: ReductionCost
    tried: int = 0  # dense problems solved
    stiff: int = 0  # of these, how many took the whole companion matrix
    passed: list[tuple[Point, DenseModes]] = field(default_factory=list[tuple[Point, DenseModes]])

    @property
    def problem(self) -> ParametricProblem:
        """What is reduced."""
        return self.basis.problem

    @passing()
    def enrich(self, points: list[Point], turn: Array | None = None) -> None:
        """Answers to what the modes at all points leave, together, until every mode at every point passes. turn (r, s):
        what of the basis they are first asked on. Raises AnalysisError where they do not settle."""
        pending = list(points)
        failing: list[tuple[Point, DenseModes, Array]] = []
        for _ in range(ROUNDS):
            failing_before, failing, waiting = failing, [], []
            for point in pending:
                if self.whole and len(failing) == PAIR:
                    waiting.append(point)
                    continue
                # Where damping was too strong, or two modes too close, for the cheap way, it still is.
                known = next((f.whole for other, f, _ in failing_before if other is point), False)
                found, error = self._asked(point, turn, whole=known)
                if np.any(error > PASSED * self.bound):
                    failing.append((point, found, error))
                else:
                    self.passed.append((point, found))
            pending = [point for point, _, _ in failing] + waiting
            open_points = f"{len(pending)} of {len(points)} points to be answered"
            stage(f"reduced model: {open_points}, {self.basis.count} unknowns")
            if not failing:
                return
            self._answer(failing)
            turn = None
        raise AnalysisError(
            "the reduced model does not settle over the box; ask for a smaller box, a lower frequency or a larger bound"
        )

    def known(self, point: Point) -> ComplexArray:
        """The eigenvalues (k,) at a point as it passed, perhaps on the basis as it was then."""
        found = next((modes for other, modes in reversed(self.passed) if other == point), None)
        return self.values(point) if found is None else found.values

    def values(self, point: Point) -> ComplexArray:
        """The eigenvalues (k,) at a point on the basis as it is."""
        return self._solved(self._matrices(point)).values

    def add(self, shapes: Array) -> int:
        """Take vectors (n, k) into the basis; returns how many directions that made."""
        return self.basis.add(shapes, ALONG)

    def cut(self) -> ReducedModel:
        """The basis as small as errors and estimates allow."""
        sides = len(self.problem.parameters)
        measured = random_points(self.problem, 2 * sides + 1)
        watched = random_points(self.problem, (2 + WATCHED) * sides + 1)[len(measured) :]
        self.enrich(measured)
        self.work.lap("enrichment")
        exact = [self._last(point).values for point in measured]
        self.work.lap("points between")
        left, size = self._span()
        share, asked = FIRST_CUT, False
        while True:
            turn = left[:, size > share * size[0]]
            model = self._model(turn)
            constant = _constant(model, measured, exact)
            if constant is not None:
                model = replace(model, constant=constant)
                errors: list[float] = []
                for point in watched:
                    errors.append(float(np.max(model.modes(point).error, initial=0.0)))
                    if asked and errors[-1] > WATCHFUL * self.bound:
                        break
                if max(errors) <= WATCHFUL * self.bound:
                    break
                if not asked:
                    # Once: modes of those that fail join the others.
                    asked = True
                    self.work.lap("cut")
                    worst = [k for k in np.argsort(errors)[-ASKED:] if errors[k] > WATCHFUL * self.bound]
                    self.enrich([watched[k] for k in worst], left[:, size > FINE_CUT * size[0]] if self.whole else None)
                    self.work.lap("enrichment")
                    left, size = self._span()
                    continue
            if turn.shape[1] == left.shape[1]:
                break
            share /= LESS
        if self.whole and constant is not None and any(len(modes.values) for _, modes in self.passed):
            model, constant = self._among_states(replace(model, constant=constant), turn, measured, exact, watched)
        self.work.lap("cut")
        vectors = self.basis.vectors @ turn
        self.work.lap("vectors")
        return replace(
            model, vectors=vectors, constant=constant or SAFETY, seconds=dict(self.work.seconds),
            solves=self.work.solves,
        )  # fmt: skip

    def _among_states(
        self, model: ReducedModel, turn: Array, measured: list[Point], exact: list[ComplexArray], watched: list[Point]
    ) -> tuple[ReducedModel, float]:
        """The model and its constant with the fewest states that do for the whole companion matrix, judged at the same
        points; without any where too many are needed."""
        problem = self.problem
        found = [_on(modes, self.basis.count) for _, modes in self.passed]
        cut = [replace(m, right=turn.T @ m.right, left=turn.T @ m.left) for m in found]
        matrices = assembled(model.projected, problem.factors(problem.reference), problem.powers)
        directions = spanned(cut, matrices, self.frequency)
        # Where the band has no mode, states that never saw the place must not have one either.
        places = [*watched, *(point for point, modes in self.passed if not len(modes.values))]
        for share in STATES:
            states = directions.but(share)
            if states.count > WORTH * model.size:
                break
            tried = replace(model, states=states)
            constant = _constant(tried, measured, exact)
            if constant is not None:
                tried = replace(tried, constant=constant)
                if all(np.all(tried.modes(point).error <= SPARED * self.bound) for point in places):
                    return tried, constant
        return model, model.constant

    @property
    def whole(self) -> bool:
        """Whether damping has been too strong for anything but the whole companion matrix most of the time."""
        return self.tried > 2 and 2 * self.stiff > self.tried

    def _last(self, point: Point) -> DenseModes:
        """The modes at a point that passed, on the basis as it is now."""
        known = next(found for other, found in reversed(self.passed) if other is point)
        return known if len(known.right) == self.basis.count else self._solved(self._matrices(point))

    def _matrices(self, point: Point) -> tuple[Array, Array, Array]:
        return assembled(self.basis.projected, self.problem.factors(point), self.problem.powers)

    def _solved(self, matrices: tuple[Array, Array, Array], *, whole: bool = False) -> DenseModes:
        found = dense_modes(*matrices, self.frequency, MARGIN, whole=whole or self.whole)
        self.tried, self.stiff = self.tried + 1, self.stiff + found.whole
        return found

    def _asked(self, point: Point, turn: Array | None, *, whole: bool = False) -> tuple[DenseModes, Array]:
        """The modes at a point, of the basis or of what is turned out of it, and their errors (k,) by residuals,
        without a constant."""
        mass, damping, stiffness = matrices = self._matrices(point)
        if turn is None:
            found = self._solved(matrices, whole=whole)
        else:
            small = turn.T @ mass @ turn, turn.T @ damping @ turn, turn.T @ stiffness @ turn
            found = self._solved(small, whole=whole)
            found = replace(found, right=turn @ found.right, left=turn @ found.left)
        factors, powers = self.problem.factors(point), self.problem.powers
        sizes = [
            sketched(sketch, factors, powers, found.values, vectors)
            for sketch, vectors in ((self.basis.right_sketch, found.right), (self.basis.left_sketch, found.left))
        ]
        return found, product_over_slope(matrices, found, *sizes)

    def _answer(self, failing: list[tuple[Point, DenseModes, Array]]) -> None:
        """Add the answers to what modes leave unbalanced at several points at once, from both sides."""
        powers = self.problem.powers
        # Which combinations are worth an answer is seen in the sketches; only those are formed.
        seen: list[Array] = []
        weights: list[list[list[Array]]] = [[[], []] for _ in powers]
        for point, found, error in failing:
            factors = self.problem.factors(point)
            # Modes far below the bound leave nothing that another point will not ask for.
            chosen = error > 0.01 * self.bound
            lam = found.values[chosen]
            sketches = self.basis.right_sketch, self.basis.left_sketch
            for side, (sketch, vectors) in enumerate(zip(sketches, (found.right, found.left), strict=True)):
                z = vectors[:, chosen]
                seen.append(real_and_imaginary(sketched_rests(sketch, factors, powers, lam, z)))
                for index, (factor, power) in enumerate(zip(factors, powers, strict=True)):
                    weights[index][side].append(factor * real_and_imaginary(lam**power * z))
                    weights[index][1 - side].append(np.zeros((len(z), 2 * z.shape[1])))
        block = np.hstack(seen)
        squares, turn = sl.eigh(block @ block.T)
        keep = np.flatnonzero(squares > max(WEAKEST**2 * squares[-1], 1e-300))[-(FEWER if self.whole else TOGETHER) :]
        mix = block.T @ (turn[:, keep] / squares[keep])
        right, left = ([np.hstack(sides[side]) @ mix for sides in weights] for side in (0, 1))
        force = self.basis.forces(right, left)
        answer = self.factor.solve(force, refine=False)
        self.work.solves += force.shape[1]
        image = force if self.basis.metric is self.operator else None
        if not self.basis.add(answer, LEFT_OUT, image):
            self.basis.add(answer, 1e-3 * LEFT_OUT, image)

    def _shots(self) -> Array:
        """The modes at all points that passed (r, k), real and imaginary, right and left."""
        count = self.basis.count
        found = [_on(modes, count) for _, modes in self.passed]
        return np.hstack([real_and_imaginary(v) for modes in found for v in (modes.right, modes.left)])

    def _span(self) -> tuple[Array, Array]:
        """Left singular vectors (r, s) and singular values (s,) of the modes at all points that passed; where no point
        has a mode in the band, what the basis began with."""
        shots = self._shots()
        if not shots.shape[1]:
            return np.eye(self.basis.count), np.ones(self.basis.count)
        left, size, _ = sl.svd(shots, full_matrices=False)
        return left, size

    def _model(self, turn: Array) -> ReducedModel:
        """The model on the basis turned and cut, its vectors and constant still to come."""
        basis = self.basis
        projected = np.einsum("ri,jrs,sk->jik", turn, basis.projected, turn, optimize=True)
        return ReducedModel(
            self.problem, basis.vectors, projected, basis.right_sketch @ turn, basis.left_sketch @ turn,
            self.frequency, 1.0, self.bound, {}, 0, self.whole,
        )  # fmt: skip


def _on(found: DenseModes, count: int) -> DenseModes:
    """Modes found before the basis grew, on the basis as it is."""
    more = np.zeros((count - len(found.right), found.right.shape[1]))
    return replace(found, right=np.vstack([found.right, more]), left=np.vstack([found.left, more]))


def _constant(model: ReducedModel, points: list[Point], exact: list[ComplexArray]) -> float | None:
    """The factor of the error estimate: the largest found, kept SAFETY times larger, at least 1 as the inverse of a
    matrix scaled by its diagonal has it; None where errors themselves are too large. Motions as a whole are not judged:
    theirs are zero but for rounding."""
    ratio, still = 0.0, AT_REST * model.frequency
    for point, every in zip(points, exact, strict=True):
        found = model.modes(point)
        found, values = found.of(np.abs(found.values) > still), every[np.abs(every) > still]
        error = np.abs(found.values[:, None] - values).min(axis=1, initial=np.inf) / np.abs(found.values)
        # A mode at the very end of the band may be beyond it in one of the two.
        inner = values[np.abs(values) <= (1 - model.bound) * model.frequency]
        missed = np.abs(inner[:, None] - found.values).min(axis=1, initial=np.inf) / np.abs(inner)
        if np.any(error > MEASURED * model.bound) or np.any(missed > MEASURED * model.bound):
            return None
        ratio = max(ratio, float(np.max(error / np.maximum(found.error, 1e-300), initial=0.0)))
    return max(SAFETY * ratio, 1.0)


def grid_points(problem: ParametricProblem, counts: tuple[int, ...] | None) -> list[Point]:
    """Candidates on a grid, corners first, opposite ones one after the other: they are furthest from the middle, where
    the static operator is exact. By default 5 points of a single parameter, 3 of two or three, 2 of more."""
    sides = len(problem.parameters)
    points = problem.corners(counts or (5 if sides == 1 else 3 if sides <= FINE else 2,) * sides)
    table = np.array([list(p.values()) for p in points])
    span = np.maximum(np.ptp(table, axis=0), 1e-300)
    distance = np.abs((table - table.mean(axis=0)) / span).sum(axis=1)
    order: IntArray = np.argsort(-distance, kind="stable")
    return [points[k] for k in order]


def random_points(problem: ParametricProblem, count: int) -> list[Point]:
    """Points of a box in no relation to its grid, always the same."""
    rng = np.random.default_rng(SEED)
    low, high = (np.array([getattr(p, end) for p in problem.parameters]) for end in ("low", "high"))
    return [problem.point([float(v) for v in low + (high - low) * rng.random(len(low))]) for _ in range(count)]
