"""A reduced parametric problem: eigenvalues anywhere in the box in milliseconds, each with what it leaves in the full.

Residuals of the full problem are not formed: a random embedding Θ (s, n) with few entries in each column keeps their
lengths to some per cent with overwhelming probability (Balabanov and Nouy, Adv. Comput. Math. 45, 2019), and Θ applied
to every A_jV is small and made once. With both sides' residuals ρ, scaled row by row by the metric's diagonal, the
error of an eigenvalue is of the order of

    ρ_right ρ_left / |yᵀP'(λ)x| ,

second order as in any two-sided projection; the factor in front is measured against the larger basis that the reduced
one was cut from, at points it was not made for, and kept ten times larger than found.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...digits import hertz, readable
from ...notebook import Shown, counted, html_table
from ...tabular import MODE, Rows, Tabular, mode_cells
from ...threads import one_thread
from ...typing import Array, BoolArray, ComplexArray
from ..at_rest import more_slow, moving, rest_limit, slow_words, told_growth
from ..dense_problem import combined, images
from ..quadratic.problem import Quadratic
from ..quadratic.reach import searched_in
from ..tolerances import UNSTABLE_RELATIVE
from .dense import DenseModes, assembled, assembled_each, dense_modes
from .problem import ParametricProblem
from .states import States

REACH = 1.0 + 1e-9


@dataclass(frozen=True, repr=False)
class ReducedModes(Tabular):
    """Modes at one point of the box: λ (k,) [1/s], residual (k,) of the full problem (scaled, both sides' larger one),
    error (k,) estimated of λ, relative, of the problem that the model holds: where other nodes touch, modes are others
    (`ReducedModel.unlike`); passed (k,): whether that is below the bound asked for. point: the values of the
    parameters; inside: whether they lie in the box. right, left (r, k) are the vectors on the basis. still [1/s]: up to
    which |λ| they may be motions as a whole; top [1/s]: up to where they were solved for."""

    point: Mapping[str, float]
    values: ComplexArray
    residual: Array
    error: Array
    passed: BoolArray
    inside: bool
    right: ComplexArray
    left: ComplexArray
    still: float = 0.0
    top: float = 0.0

    def of(self, chosen: BoolArray) -> ReducedModes:
        """Some of them."""
        return replace(
            self, values=self.values[chosen], residual=self.residual[chosen], error=self.error[chosen],
            passed=self.passed[chosen], right=self.right[:, chosen], left=self.left[:, chosen],
        )  # fmt: skip

    @property
    def _line(self) -> str:
        point = ", ".join(f"{name} = {value:g}" for name, value in self.point.items())
        growing = int(self.unstable.sum())
        return f"{counted(len(self.values), 'mode')} at {point}; {growing or 'none'} unstable"

    def _repr_html_(self) -> str:
        heads = ("frequency [Hz]", "growth [1/s]", "", "estimated error")
        rows = [
            (readable(f), readable(g, 4), "unstable" if u else "", f"{e:.0e}")
            for f, g, u, e in zip(self.frequency_hz, self.growth_rate, self.unstable, self.error, strict=True)
        ]
        outside = "" if self.inside else "outside the box of the model"
        return html_table(f"Reduced modes: {self._line}", heads, rows, (outside,))

    def table(self) -> Rows:
        """Heads and rows, as reduced.csv has them for each point."""
        heads = (*self.point, *MODE, "error", "residual", "inside")
        columns = (self.frequency_hz, self.growth_rate, self.unstable, self.error, self.residual)
        rows = zip(*(column.tolist() for column in columns), strict=True)
        cells = ((*mode_cells(f, g, unstable=u), error, residual, self.inside) for f, g, u, error, residual in rows)
        return heads, [(*self.point.values(), *row) for row in cells]

    @property
    def frequency_hz(self) -> Array:
        """Frequencies (k,) [Hz]."""
        return self.values.imag / (2 * np.pi)

    @property
    def growth_rate(self) -> Array:
        """Re λ (k,) [1/s], positive where unstable."""
        return self.values.real

    @property
    def unstable(self) -> BoolArray:
        """Which grow (k,), motions as a whole not among them: their λ is zero but for rounding."""
        return growing(self.values, self.still, self.top)


@dataclass(frozen=True, repr=False)
class ReducedModel(Shown):
    """Basis V (n, r), projected terms (t, r, r), sketches (t, s, r) of the scaled A_jV and A_jᵀV; frequency [1/s]:
    modes up to it are promised. constant: of the error estimate; bound: the relative error promised in the box;
    seconds and solves that making it took, by part; whole: damping is so strong that points take the whole companion
    matrix; states: what has their modes in its place, within the box."""

    problem: ParametricProblem
    vectors: Array
    projected: Array
    right_sketch: Array
    left_sketch: Array
    frequency: float
    constant: float
    bound: float
    seconds: Mapping[str, float]
    solves: int
    whole: bool = False
    states: States | None = None

    @property
    def _line(self) -> str:
        ranges = ", ".join(f"{p.name} from {p.low:g} to {p.high:g}" for p in self.problem.parameters)
        full = f"{self.size} of {self.vectors.shape[0]} unknowns"
        return f"{full} over {ranges}, modes up to {hertz(self.frequency / (2 * np.pi))} within {self.bound:g}"

    def _repr_html_(self) -> str:
        rows = [(p.name, f"{p.low:g}", f"{p.high:g}") for p in self.problem.parameters]
        return html_table(f"Reduced model: {self._line}", ("number", "from", "to"), rows, self.problem.idle_words)

    @property
    def size(self) -> int:
        """Number of unknowns r."""
        return int(self.projected.shape[1])

    @property
    def keeps_all(self) -> bool:
        """Whether it is the problem itself, on all of its freedoms."""
        return self.size == self.problem.size and bool(np.array_equal(self.vectors, np.eye(self.size)))

    @cached_property
    def searched(self) -> float:
        """The frequency [1/s] up to which there may be modes: no higher than the one promised."""
        return searched_in([self._small(point) for point in self.problem.sampled], self.frequency)

    def still(self, values: ComplexArray) -> float:
        """Up to which |λ| [1/s] modes λ (k,) of a point may be motions as a whole; 0 where none of them is slow."""
        return 0.0 if np.all(moving(values, self.searched, lambda: self._rest_limit)) else self._rest_limit

    def hidden(self, modes: ReducedModes) -> str:
        """What is to be said of slow modes at a point that may be motions as a whole; empty for nothing."""
        slow = modes.values[np.abs(modes.values) <= modes.still]
        if not more_slow(self._small(modes.point), slow, self.searched):
            return ""
        return (
            f"there are {slow_words(modes.still)}: whether they grow is not said"
        )

    def hidden_at(self, points: Sequence[Mapping[str, float]]) -> tuple[str, ...]:
        """The same of several points, once."""
        told = (self.hidden(self.modes(point, judged=False)) for point in points)
        return tuple(dict.fromkeys(words for words in told if words))[:1]

    @cached_property
    def _rest_limit(self) -> float:
        return rest_limit([self._small(point) for point in self.problem.sampled], self.searched)

    def _small(self, point: Mapping[str, float]) -> Quadratic:
        """The problem on the basis at a point."""
        return Quadratic(*assembled(self.projected, self.problem.factors(point), self.problem.powers))

    @one_thread
    def modes(self, values: Mapping[str, float] | Sequence[float], *, judged: bool = True) -> ReducedModes:
        """All modes up to the promised frequency at a point of the box. Not judged, their residual and estimated error
        are NaN until `judged` has them. Raises CaseError for unknown parameters."""
        point = self.problem.point(values)
        factors = self.problem.factors(point)
        matrices = self.matrices(factors)
        inside = self.problem.inside(point)
        # Outside the box nothing says that the states are those of its modes.
        found = self.states.modes(matrices, self.searched, REACH) if self.states is not None and inside else None
        if found is None:
            found = dense_modes(*matrices, self.searched, REACH, whole=self.whole)
        unknown = np.full(len(found.values), np.nan)
        made = ReducedModes(
            point, found.values, unknown, unknown, np.zeros(len(unknown), dtype=bool), inside, found.right, found.left,
            self.still(found.values), self.searched,
        )  # fmt: skip
        return self._judged(made, matrices, factors) if judged else made

    @one_thread
    def judged(self, modes: ReducedModes) -> ReducedModes:
        """The same modes with their residual and estimated error."""
        factors = self.problem.factors(self.problem.point(modes.point))
        return self._judged(modes, self.matrices(factors), factors)

    def matrices(self, factors: Array) -> tuple[Array, Array, Array]:
        """M, D and K (r, r) on the basis with these factors (t,) of the terms; those of the last ones are at hand: what
        follows branches to a point asks for them again. Not to be written to."""
        for known, made in tuple(self._latest):
            if np.array_equal(known, factors):
                return made
        made = assembled(self.projected, factors, self.problem.powers)
        self._latest[:] = [(factors.copy(), made)]
        return made

    @cached_property
    def _latest(self) -> list[tuple[Array, tuple[Array, Array, Array]]]:
        return []

    def unlike(self, points: Sequence[Mapping[str, float]]) -> tuple[str, ...]:
        """`ContactsProblem.unlike`; "" of each point of problems without contacts."""
        asked = getattr(self.problem, "unlike", None)
        return ("",) * len(points) if asked is None else asked(points)

    def expand(self, modes: ReducedModes, *, left: bool = False) -> ComplexArray:
        """Right or left vectors (n, k) of unit length."""
        x: ComplexArray = combined(self.vectors, modes.left if left else modes.right).astype(complex)
        return x / np.linalg.norm(x, axis=0)

    def backward_error(self, modes: ReducedModes) -> Array:
        """Componentwise backward errors (k,) in the full problem, formed there."""
        return self.problem.at(modes.point).backward_error(modes.values, self.expand(modes))

    def _judged(self, modes: ReducedModes, matrices: tuple[Array, Array, Array], factors: Array) -> ReducedModes:
        lam, powers = modes.values, self.problem.powers
        right = sketched(self.right_sketch, factors, powers, lam, modes.right)
        left = sketched(self.left_sketch, factors, powers, lam, modes.left)
        error = self.constant * product_over_slope(matrices, modes, right, left)
        return replace(modes, residual=np.maximum(right, left), error=error, passed=error <= self.bound)


def growing(values: ComplexArray, still: float, top: float) -> BoolArray:
    """Which λ (k,) of modes up to top [1/s] grow beyond rounding, those up to still [1/s] being motions as a whole."""
    return (values.real > told_growth(values, UNSTABLE_RELATIVE, top)) & (np.abs(values) > still)


def sketched(sketch: Array, factors: Array, powers: Array, lam: ComplexArray, z: ComplexArray) -> Array:
    """Lengths (k,) of scaled residuals of z (r, k) from sketches (t, s, r)."""
    return np.linalg.norm(sketched_rests(sketch, factors, powers, lam, z), axis=0)


def sketched_rests(
    sketch: Array, factors: Array, powers: Array, lam: ComplexArray, z: ComplexArray
) -> ComplexArray:
    """Sketches (s, k) of scaled residuals of z (r, k): what acts on one power of λ at once."""
    of_mass, of_damping, of_stiffness = images(assembled_each(sketch, (factors,), powers)[0], z)
    total: ComplexArray = (of_mass * lam + of_damping) * lam + of_stiffness
    return total


def product_over_slope(
    matrices: tuple[Array, Array, Array], found: DenseModes | ReducedModes, right: Array, left: Array
) -> Array:
    """ρ_right ρ_left / |λ yᵀP'(λ)x| (k,)."""
    mass, damping, _ = matrices
    lam = found.values
    slope = 2 * lam * combined(mass, found.right) + combined(damping, found.right)
    size = np.abs(lam * np.einsum("ij,ij->j", found.left, slope))
    return right * left / np.maximum(size, 1e-300)
