"""Derivatives of the eigenvalues of the friction-coupled problem, displacements and contact forces together.

The problem is P(λ) [u; p] = 0 with

    P(λ) = [[λ²M + λC + K, −Bᵀ], [N, c]],      B = N + μS,

N, S the rows of the touching nodes' relative displacement along the normal and against the slip, c their compliances.
With left vectors yᵀP = 0 a simple eigenvalue moves with any number a that P depends on as

    dλ/da = − yᵀ (∂P/∂a) x / yᵀ (∂P/∂λ) x

(Lancaster, Numerische Mathematik 6 (1964) 377–387; Seyranian and Mailybaev, Multiparameter Stability Theory with
Mechanical Applications, World Scientific 2003). Contact forces are unknowns, so rigid contact (c = 0) is no exception.
Each mode costs one factorisation: residual inverse iteration (Neumaier, SIAM J. Numer. Anal. 22 (1985) 914–923) with it
for the right vector and with its transpose for the left one, and the two-sided Rayleigh functional for λ.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np
import scipy.sparse as sp

from ..direct import Factor, SingularMatrix, factorise
from ..errors import AnalysisError, CaseError
from ..sliding import steady_nodes
from ..system import System
from ..typing import Array, BoolArray, ComplexArray, IntArray, Sparse
from .assembled.problem import times, tiny
from .assembled.steady import contact_rows, steadiness, touching_nodes
from .options import Options

STEPS = 14
SETTLED = 1e-14  # relative change of λ at which the iteration ends
BELIEVED = 1e-7  # relative change of λ, or distance from the guess, above which it has gone elsewhere
LEAST_SHIFT, MOST_SHIFT = 1e-10, 1e-6  # of |λ|: how far beside an eigenvalue P is factorised
WIDENED = 30.0
RELATIVE_STEP = 1e-3
AFFINE = 1e-8  # second over first differences below which a matrix is affine in a number


@dataclass(frozen=True)
class Held:
    """What stays as it is while a number changes: the touching nodes (m,) among all contact nodes, the direction
    against the slip (all, d−1) of every node, which stick (all,), and how many freedoms and contact nodes there are."""

    touching: IntArray
    sense: Array
    stuck: BoolArray
    size: int
    nodes: int


@dataclass(frozen=True)
class Terms:
    """What P(λ) is made of, or how that changes per unit of a number: mass, damping, stiffness (n, n) csr, normal N and
    push B (m, n) csr, compliance c (m,). In a change None stands for nothing."""

    mass: Sparse | None = None
    damping: Sparse | None = None
    stiffness: Sparse | None = None
    normal: Sparse | None = None
    push: Sparse | None = None
    compliance: Array | None = None

    def form(self, lam: complex, left: Pair, right: Pair) -> complex:
        """yᵀ P(λ) x, or yᵀ (∂P/∂a) x of a change."""
        total = 0j
        for matrix, factor in ((self.mass, lam**2), (self.damping, lam), (self.stiffness, 1.0)):
            if matrix is not None:
                total += factor * complex(left.motion @ _on(matrix, right.motion))
        if self.push is not None:
            total -= complex(_on(self.push, left.motion) @ right.force)
        if self.normal is not None:
            total += complex(left.force @ _on(self.normal, right.motion))
        if self.compliance is not None:
            total += complex(left.force @ (self.compliance * right.force))
        return total


@dataclass(frozen=True)
class Pair:
    """Displacements (n,) and contact forces (m,) of a right or a left vector."""

    motion: ComplexArray
    force: ComplexArray


@dataclass(frozen=True)
class Mode:
    """A simple eigenvalue λ [1/s] with its vectors, the left one scaled so that yᵀ(2λM + C)u = 1.

    condition: 2|λ| ‖u‖ ‖y‖ in the norm of the mass matrix, over |yᵀ(2λM + C)u|; 1 without friction and damping, and
    beyond all bounds where two eigenvalues meet in an exceptional point. residual: componentwise backward error of the
    right or the left pair, whichever is larger.
    """

    eigenvalue: complex
    right: Pair
    left: Pair
    condition: float
    residual: float

    def derivative(self, change: Terms) -> complex:
        """dλ/da [1/s per unit of a] where P changes so per unit of a."""
        return -change.form(self.eigenvalue, self.left, self.right)


def hold(system: System, mu: float, options: Options) -> Held:
    """The touching nodes and the directions of sliding at ``mu``. Raises AnalysisError without steady sliding."""
    nodes = system.contact_nodes()
    steady = touching_nodes(system, nodes, mu, options.solver)
    return Held(np.flatnonzero(steady.active), steady.sense, steady.stuck, system.size, nodes.count)


def terms_of(system: System, mu: float, held: Held, options: Options) -> Terms:
    """P(λ) of a system at ``mu`` with what is held.

    What the law's slope, friction damping and prestress add follows the steady state of this very system. Raises
    CaseError where it has other freedoms or contact nodes than those held.
    """
    nodes = system.contact_nodes()
    if (system.size, nodes.count) != (held.size, held.nodes):
        raise CaseError("parameter", None, "a number that changes neither the mesh nor who is in contact")
    shown = nodes
    if np.any(nodes.cubic[held.touching] > 0):
        shown = nodes.at_force(steady_nodes(system, mu, options.solver).normal_force)
    rows = contact_rows(shown, held.touching, held.sense, held.stuck)
    slide = rows.slide
    state = steadiness(system, nodes, held.touching, options, rows)
    damping, stiffness = system.damping, system.stiffness
    if not state.neutral and (mu or state.prestress):
        weakening, extra, geometric = state.terms(mu)
        if weakening is not None:
            damping = damping + slide.T @ sp.diags_array(weakening) @ slide
        if extra is not None:
            damping = damping + extra
        if geometric is not None:
            stiffness = stiffness + geometric
    push = sp.csr_array(rows.normal + mu * slide)
    return Terms(system.mass, sp.csr_array(damping), sp.csr_array(stiffness), rows.normal, push, rows.compliance)


def by_friction(
    system: System, mu: float, held: Held, options: Options, *, contact: str | None = None
) -> Terms:
    """Change of P per unit of μ, of every contact or of one by name.

    Raises CaseError for one contact where the steady state adds terms of its own: they know a common μ only.
    """
    nodes = system.contact_nodes()
    chosen = nodes.select(held.touching)
    rows = contact_rows(nodes, held.touching, held.sense, held.stuck)
    if not steadiness(system, nodes, held.touching, options, rows).neutral:
        if contact is not None:
            accepted = "mu, of all contacts together, since the law's slope, friction damping or prestress count"
            raise CaseError(f"contacts.{contact}.friction.coefficient", None, accepted)
        return rate_of(lambda value: terms_of(system, value, held, options), mu)[0]
    slide = rows.slide
    if contact is not None:
        mine = np.zeros(slide.shape[0])
        mine[: chosen.count] = chosen.owner == nodes.names.index(contact)
        slide = sp.csr_array(sp.diags_array(mine) @ slide)
    return Terms(push=slide)


def by_compliance(system: System, held: Held, contact: str) -> Terms:
    """Change of P per unit of the compliance 1/K_c of a contact, per area [m³/N] or of a point [m/N], rigid or not."""
    nodes = system.contact_nodes()
    chosen = nodes.select(held.touching)
    if system.contact_cubic:
        accepted = f"contacts.{contact}.stiffness, since contact stiffness depends on the force with a cubic term"
        raise CaseError(f"contacts.{contact}.compliance", None, accepted)
    area = np.where(np.isnan(chosen.area), 1.0, chosen.area)
    mine = (chosen.owner == nodes.names.index(contact)).astype(float)
    change = np.divide(mine, area, out=np.zeros_like(area), where=area > 0)
    sticking = contact_rows(nodes, held.touching, held.sense, held.stuck).normal.shape[0] - len(change)
    return Terms(compliance=np.append(change, np.zeros(sticking)))


def by_mass_at_node(mode: Mode, rows: Sparse, dimension: int) -> ComplexArray:
    """dλ/dm (k,) [1/(s kg)] of a point mass at each of k nodes, rows (k d, n) of their displacements."""
    product = _on(rows, mode.left.motion) * _on(rows, mode.right.motion)
    return -(mode.eigenvalue**2) * product.reshape(-1, dimension).sum(axis=1)


def by_release(
    terms: Terms, mode: Mode, groups: Sequence[IntArray], gap: float, *, solver: str | None = None
) -> ComplexArray:
    """δλ (g,) [1/s] as contact is taken away from groups of touching nodes, each (r,) of the m.

    Without contact the gaps of the group's nodes open by some g while their forces vanish: P(λ) x = E g, Eᵀp = 0. With
    P(λ)⁻¹ = x yᵀ/(λ − λ₀) + G near λ₀ this has a solution where

        λ − λ₀ = − qᵀ G⁻¹ p,      p, q, G the group's parts,

    which knows how the neighbourhood yields, and holds for rigid contact too. G varies slowly with λ, it is that of λ₀.
    gap: distance [1/s] from λ₀ to the nearest other eigenvalue. Raises AnalysisError where P is singular beside λ₀.
    """
    if not groups:
        return np.zeros(0, dtype=complex)
    problem = _Bordered(terms)
    nodes = np.unique(np.concatenate(groups))
    n, scale = problem.freedoms, problem.scale
    beside = 0.3j * min(gap, 1e-2 * abs(mode.eigenvalue))
    unit = np.zeros((problem.stiffness.shape[0], len(nodes)), dtype=complex)
    unit[n + nodes, np.arange(len(nodes))] = scale
    # On both sides of λ₀, so that what G changes between them cancels.
    regular = np.zeros((len(nodes), len(nodes)), dtype=complex)
    for side in (beside, -beside):
        with factorise(problem.matrix(mode.eigenvalue + side), saddle=True, solver=solver) as factor:
            answer = scale * factor.solve(unit)[n + nodes]
        regular += 0.5 * (answer - np.outer(mode.right.force[nodes], mode.left.force[nodes]) / side)
    found = np.zeros(len(groups), dtype=complex)
    for k, group in enumerate(groups):
        at = np.searchsorted(nodes, group)
        own = regular[np.ix_(at, at)]
        found[k] = -(mode.left.force[group] @ np.linalg.solve(own, mode.right.force[group]))
    return found


def rate_of(at: Callable[[float], Terms], value: float, step: float | None = None) -> tuple[Terms, bool]:
    """Change of P per unit of a number about ``value``, and whether P is affine in it.

    Differences over ± step (a thousandth of the value), exact for what is affine; else of fourth order, exact up to
    the fourth power. Where the number cannot fall below its value (a damping of zero), forwards and of second order.
    """
    h = step if step is not None else RELATIVE_STEP * (abs(value) or 1.0)
    base = at(value)
    high = at(value + h)
    try:
        low = at(value - h)
    except CaseError:
        second = at(value + 2 * h)
        affine = _is_affine(base, high, second)
        weights = ((-1.0, base), (1.0, high)) if affine else ((-1.5, base), (2.0, high), (-0.5, second))
        return _combined(weights, h), affine
    if _is_affine(low, base, high):
        return _combined(((-0.5, low), (0.5, high)), h), True
    farther = ((1 / 12, at(value - 2 * h)), (-1 / 12, at(value + 2 * h)))
    return _combined(((-2 / 3, low), (2 / 3, high), *farther), h), False


def solve_mode(terms: Terms, guess: complex, gap: float, *, solver: str | None = None) -> Mode:
    """The mode whose eigenvalue is near ``guess``, with both vectors; gap: distance [1/s] to the nearest other one.

    Raises AnalysisError where two eigenvalues are one to working precision, or where the iteration goes elsewhere.
    """
    problem = _Bordered(terms)
    size = max(abs(guess), 1e-300)
    shift = float(np.clip(0.02 * gap, LEAST_SHIFT * size, MOST_SHIFT * size))
    widest = max(min(gap / 3, 1e-2 * size), 1.01 * shift)
    while shift <= widest:
        try:
            with factorise(problem.matrix(guess + shift), saddle=True, solver=solver) as factor:
                found = _iterated(problem, factor, guess)
        except SingularMatrix:
            found = None
        if found is not None and abs(found.eigenvalue - guess) <= max(BELIEVED * size, 0.3 * min(gap, 1e-3 * size)):
            return found
        shift *= WIDENED
    raise AnalysisError(
        f"the eigenvalue {guess:.6g} 1/s cannot be told from its neighbour: at an exceptional point, or of two equal "
        "bodies, derivatives do not exist; move μ a little"
    )


class _Bordered:
    """P(λ) as one sparse matrix, contact forces counted in units of a typical stiffness."""

    def __init__(self, terms: Terms) -> None:
        stiffness = terms.stiffness
        assert stiffness is not None, "only changes leave terms out"
        self.terms = terms
        self.freedoms = int(stiffness.shape[0])
        assert terms.normal is not None, "only changes leave terms out"
        assert terms.push is not None, "only changes leave terms out"
        assert terms.compliance is not None, "only changes leave terms out"
        m = len(terms.compliance)
        self.scale = float(np.abs(stiffness.diagonal()).mean()) or 1.0
        edge, corner = sp.csr_array((self.freedoms, m)), sp.csr_array((m, m))
        self.mass, self.damping = (
            sp.csr_array(sp.block_array([[block, edge], [edge.T, corner]])) for block in (terms.mass, terms.damping)
        )
        compliance = sp.diags_array(self.scale**2 * terms.compliance)
        rows = [[stiffness, -self.scale * terms.push.T], [self.scale * terms.normal, compliance]]
        self.stiffness = sp.csr_array(sp.block_array(rows))
        self._sizes = tuple(abs(block) for block in (self.mass, self.damping, self.stiffness))

    def matrix(self, lam: complex) -> Sparse:
        return sp.csr_array(lam**2 * self.mass + lam * self.damping + self.stiffness)

    def times(self, lam: complex, x: ComplexArray, *, left: bool = False) -> ComplexArray:
        """P x, or Pᵀ x."""
        blocks = (self.mass, self.damping, self.stiffness)
        m, c, k = (_on(block.T if left else block, x) for block in blocks)
        return lam**2 * m + lam * c + k

    def slope(self, lam: complex, x: ComplexArray) -> ComplexArray:
        """(∂P/∂λ) x."""
        return 2 * lam * _on(self.mass, x) + _on(self.damping, x)

    def backward_error(self, lam: complex, x: ComplexArray, *, left: bool) -> float:
        mass, damping, stiffness = (size.T if left else size for size in self._sizes)
        size, rate = np.abs(x), abs(lam)
        terms = rate**2 * (mass @ size) + rate * (damping @ size) + stiffness @ size
        rest = np.abs(self.times(lam, x, left=left))
        n = self.freedoms
        parts = [rest[:n].max() / tiny(terms[:n].max())]
        if len(x) > n:
            # As `ContactProblem` judges: a mode that hardly opens gaps leaves nothing but rounding there.
            reach = max(terms[n:].max(), 1e-4 * self.scale * size[:n].max())
            parts.append(rest[n:].max() / reach)
        return float(max(parts))

    def pair(self, x: ComplexArray) -> Pair:
        return Pair(x[: self.freedoms], self.scale * x[self.freedoms :])


def _iterated(problem: _Bordered, factor: Factor, lam: complex) -> Mode | None:
    """Both vectors by residual inverse iteration from arbitrary ones; None where λ does not settle."""
    solve = factor.solve
    rng = np.random.default_rng(0)
    n = problem.freedoms
    start = rng.standard_normal((2, problem.stiffness.shape[0])) + 0j
    start[:, n:] = 0.0
    x, y = solve(start[0]), solve(start[1], transpose=True)
    change, best = np.inf, np.inf
    for step in range(STEPS):
        x, y = x / np.linalg.norm(x[:n]), y / np.linalg.norm(y[:n])
        slope = complex(y @ problem.slope(lam, x))
        if slope == 0 or not (np.all(np.isfinite(x)) and np.all(np.isfinite(y))):
            return None
        change = -complex(y @ problem.times(lam, x)) / slope
        lam = lam + change
        if step > 2 and (abs(change) <= SETTLED * abs(lam) or (abs(change) < 1e-11 * abs(lam) and abs(change) >= best)):
            break
        best = min(best, abs(change))
        x = x - solve(problem.times(lam, x))
        y = y - solve(problem.times(lam, y, left=True), transpose=True)
    if not abs(change) <= BELIEVED * abs(lam):
        return None
    x, y = x / np.linalg.norm(x[:n]), y / np.linalg.norm(y[:n])
    slope = complex(y @ problem.slope(lam, x))
    weight = problem.mass
    size = np.sqrt(np.vdot(x, _on(weight, x)).real * np.vdot(y, _on(weight, y)).real)
    residual = max(problem.backward_error(lam, x, left=False), problem.backward_error(lam, y, left=True))
    return Mode(lam, problem.pair(x), problem.pair(y / slope), float(2 * abs(lam) * size / abs(slope)), residual)


def _on(matrix: Sparse, vector: ComplexArray) -> ComplexArray:
    """matrix @ vector (n,) of a real matrix, in real arithmetic."""
    return times(matrix, vector)


def _combined(parts: tuple[tuple[float, Terms], ...], step: float) -> Terms:
    """Σ weight · terms / step."""
    found = {}
    for field in fields(Terms):
        values = [weight / step * getattr(terms, field.name) for weight, terms in parts]
        total = sum(values[1:], start=values[0])
        if sp.issparse(total):
            total = sp.csr_array(total)
            total.eliminate_zeros()
        found[field.name] = total
    return Terms(**found)


def _is_affine(low: Terms, middle: Terms, high: Terms) -> bool:
    """Whether equally spaced terms lie on a line, to rounding."""
    for field in fields(Terms):
        a, b, c = (getattr(terms, field.name) for terms in (low, middle, high))
        size, first, second = (_largest(v) for v in (b, c - a, a - 2 * b + c))
        if second > AFFINE * first + 1e-14 * size:
            return False
    return True


def _largest(values: Sparse) -> float:
    data: Array = values.data if sp.issparse(values) else values
    return float(np.abs(data).max(initial=0.0))

