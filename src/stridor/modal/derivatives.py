"""Derivatives of the eigenvalues of the friction-coupled problem, displacements and contact forces together.

The problem is P(λ) [u; p] = 0 with

    P(λ) = [[λ²M + λC + K, −Bᵀ], [N, c]],      B = N + μS,

N, S the rows of the touching nodes' relative displacement along the normal and against the slip, c their compliances.
With left vectors yᵀP = 0 a simple eigenvalue moves with any number a that P depends on as

    dλ/da = − yᵀ (∂P/∂a) x / yᵀ (∂P/∂λ) x

(Lancaster, Numerische Mathematik 6 (1964) 377–387; Seyranian and Mailybaev, Multiparameter Stability Theory with
Mechanical Applications, World Scientific 2003). Contact forces are unknowns, so rigid contact (c = 0) is no exception.
Each mode costs one factorisation (`inverse_iteration`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields

import numpy as np
import scipy.sparse as sp

from ..direct import Factor, SingularMatrix, factorise
from ..errors import AnalysisError, CaseError
from ..sliding import steady_nodes
from ..stages import passing, stage
from ..system import System
from ..typing import Array, BoolArray, ComplexArray, IntArray, Sparse
from .krylov.problem import problem_held
from .krylov.steady import contact_rows, steadiness, touching_nodes
from .options import Options
from .pencil import Pencil
from .quadratic.inverse_iteration import Iterated, iterated, two_sided
from .quadratic.problem import times

BELIEVED = 1e-7  # relative change of λ, or distance from the guess, above which it has gone elsewhere
LEAST_SHIFT, MOST_SHIFT = 1e-10, 1e-6  # of |λ|: how far beside an eigenvalue P is factorised
WIDENED = 30.0
BESIDE = 3e-4  # of the distance to the nearest other eigenvalue: how far from a pole what is regular there is taken
RELATIVE_STEP = 1e-3
AFFINE = 1e-8  # second over first differences below which a matrix is affine in a number
FIRST, FINER, MOST = 1e-4, 1 / 8, 12  # steps from zero: the first of the scale, each of the last, how many
AGREED = 1e-6  # relative difference of two changes per unit that are one


@dataclass(frozen=True)
class HeldContacts:
    """What stays as it is while a number changes: the touching nodes (m,) among all contact nodes, the direction
    against the slip (all, d−1) of every node, which stick (all,), and how many freedoms and contact nodes there are."""

    touching: IntArray
    sense: Array
    stuck: BoolArray
    size: int
    nodes: int


@dataclass(frozen=True)
class PencilChange:
    """How a `Pencil` changes per unit of a number, by the same names: mass, damping, stiffness (n, n) csr, normal N and
    push B (m, n) csr, compliance c (m,); None where it does not."""

    mass: Sparse | None = None
    damping: Sparse | None = None
    stiffness: Sparse | None = None
    normal: Sparse | None = None
    push: Sparse | None = None
    compliance: Array | None = None

    @property
    def nothing(self) -> bool:
        """Whether the number changes no entry at all."""
        matrices = (self.mass, self.damping, self.stiffness, self.normal, self.push)
        none = all(matrix is None or not np.any(matrix.data) for matrix in matrices)
        return none and (self.compliance is None or not np.any(self.compliance))

    def form(self, lam: complex, left: ModeVector, right: ModeVector) -> complex:
        """yᵀ (∂P/∂a) x."""
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
class ModeVector:
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
    right: ModeVector
    left: ModeVector
    condition: float
    residual: float

    def derivative(self, change: PencilChange) -> complex:
        """dλ/da [1/s per unit of a] where P changes so per unit of a."""
        return -change.form(self.eigenvalue, self.left, self.right)


def hold(system: System, mu: float, options: Options) -> HeldContacts:
    """The touching nodes and the directions of sliding at ``mu``. Raises AnalysisError without steady sliding."""
    nodes = system.contact_nodes()
    steady = touching_nodes(system, nodes, mu, options.solver)
    return HeldContacts(np.flatnonzero(steady.active), steady.sense, steady.stuck, system.size, nodes.count)


def pencil_of(system: System, mu: float, held: HeldContacts, options: Options) -> Pencil:
    """P(λ) of a system at ``mu`` with what is held.

    What the law's slope, friction damping and prestress add follows the steady state of this very system. Raises
    CaseError where it has other freedoms or contact nodes than those held.
    """
    shown = system.contact_nodes()
    if (system.size, shown.count) != (held.size, held.nodes):
        raise CaseError("parameter", None, "a number that changes neither the mesh nor who is in contact")
    if np.any(shown.cubic[held.touching] > 0):
        shown = shown.at_force(steady_nodes(system, mu, options.solver).normal_force)
    return problem_held(system, shown, held.touching, held.sense, held.stuck, options).pencil(mu)


def by_friction(
    system: System, mu: float, held: HeldContacts, options: Options, *, contact: str | None = None
) -> PencilChange:
    """Change of P per unit of μ, of every contact or of one by name.

    Raises CaseError for one of several contacts where the steady state adds terms of its own: they know a common μ
    only.
    """
    nodes = system.contact_nodes()
    chosen = nodes.select(held.touching)
    rows = contact_rows(nodes, held.touching, held.sense, held.stuck)
    added = steadiness(system, nodes, held.touching, options, rows).reasons
    if added:
        if contact is not None and len(nodes.names) > 1:
            accepted = f"mu, of all contacts together, since steady sliding counts here: {', '.join(added)}"
            raise CaseError(f"contacts.{contact}.friction.coefficient", None, accepted)
        return rate_of(lambda value: pencil_of(system, value, held, options), mu)[0]
    if contact is None:
        return PencilChange(push=rows.slide)
    # Its own coefficient, whichever share of a common one it gets: one without friction may be given some.
    mine = np.zeros(rows.slip.shape[0])
    mine[: chosen.count] = chosen.relative * (chosen.owner == nodes.names.index(contact))
    return PencilChange(push=sp.csr_array(sp.diags_array(mine) @ rows.slip))


def by_compliance(system: System, held: HeldContacts, options: Options, contact: str) -> PencilChange | None:
    """Change of P per unit of the compliance 1/K_c of a contact, per area [m³/N] or of a point [m/N], rigid or not.

    None where the steady state adds terms of its own, which move with it.
    """
    nodes = system.contact_nodes()
    chosen = nodes.select(held.touching)
    rows = contact_rows(nodes, held.touching, held.sense, held.stuck)
    if not steadiness(system, nodes, held.touching, options, rows).neutral:
        return None
    area = np.where(np.isnan(chosen.area), 1.0, chosen.area)
    mine = (chosen.owner == nodes.names.index(contact)).astype(float)
    change = np.divide(mine, area, out=np.zeros_like(area), where=area > 0)
    sticking = rows.normal.shape[0] - len(change)
    return PencilChange(compliance=np.append(change, np.zeros(sticking)))


def by_mass_at_node(mode: Mode, rows: Sparse, dimension: int) -> ComplexArray:
    """dλ/dm (k,) [1/(s kg)] of a point mass at each of k nodes, rows (k d, n) of their displacements."""
    product = _on(rows, mode.left.motion) * _on(rows, mode.right.motion)
    return -(mode.eigenvalue**2) * product.reshape(-1, dimension).sum(axis=1)


def by_release(
    pencil: Pencil, mode: Mode, groups: Sequence[IntArray], gap: float, *, solver: str | None = None
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
    side = _beside(mode.eigenvalue, gap)
    with factorise(pencil.whole.at(mode.eigenvalue + side), saddle=True, solver=solver) as factor:
        return _released(pencil, mode, groups, factor, side)


def _beside(lam: complex, gap: float) -> complex:
    """Near enough that G does not change, far enough that its digits are left beside those of the pole."""
    return 1j * BESIDE * min(gap, abs(lam))


def _released(
    pencil: Pencil, mode: Mode, groups: Sequence[IntArray], factor: Factor, side: complex, *, refine: bool = True
) -> ComplexArray:
    """`by_release` with factors of P(λ₀ + side), whose answers need not be refined where the mode has come from them:
    what they lack beside the pole was 1e-8 to 2e-4 of G on the coarse pad, most for modes that are close."""
    n, scale = pencil.size, pencil.unit
    nodes = np.unique(np.concatenate(groups))
    unit = np.zeros((pencil.whole.size, len(nodes)), dtype=complex)
    unit[n + nodes, np.arange(len(nodes))] = scale
    answer = scale * factor.solve(unit, refine=refine)[n + nodes]
    regular = answer - np.outer(mode.right.force[nodes], mode.left.force[nodes]) / side
    found = np.zeros(len(groups), dtype=complex)
    for k, group in enumerate(groups):
        at = np.searchsorted(nodes, group)
        own = regular[np.ix_(at, at)]
        found[k] = -(mode.left.force[group] @ np.linalg.solve(own, mode.right.force[group]))
    return found


def rate_of(
    at: Callable[[float], Pencil], value: float, step: float | None = None, *, base: Pencil | None = None
) -> tuple[PencilChange, bool]:
    """Change of P per unit of a number about ``value``, and whether P is affine in it.

    Differences over ± step (a thousandth of the value), exact for what is affine; else of fourth order, exact up to
    the fourth power. Where the number cannot fall below its value (a damping of zero), forwards and of second order.
    base: at(value), where it is known.
    """
    h = step if step is not None else RELATIVE_STEP * (abs(value) or 1.0)
    base = at(value) if base is None else base
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


def rate_from_zero(at: Callable[[float], Pencil], scale: float, *, base: Pencil) -> PencilChange:
    """Change of P per unit of a number at zero on which steady sliding depends.

    scale: values that are no longer small. Steps begin well below it and become smaller until two of them agree, but
    where P is affine over the first. Raises AnalysisError where they do not.
    """
    step = FIRST * scale
    found, affine = rate_of(at, 0.0, step, base=base)
    if affine:
        return found
    for _ in range(MOST):
        step *= FINER
        finer = rate_of(at, 0.0, step, base=base)[0]
        if _agree(found, finer, base, step):
            return finer
        found = finer
    raise AnalysisError("differences from zero do not settle as steps become smaller")


def _agree(coarse: PencilChange, fine: PencilChange, base: Pencil, step: float) -> bool:
    """Whether two changes per unit are the same, beyond what rounding of the terms leaves of differences."""
    for field in fields(PencilChange):
        one, other = getattr(coarse, field.name), getattr(fine, field.name)
        rounding = 1e-13 * _largest(getattr(base, field.name)) / step
        if _largest(one - other) > AGREED * _largest(other) + rounding:
            return False
    return True


@passing()
def solve_mode(pencil: Pencil, guess: complex, gap: float, *, solver: str | None = None) -> Mode:
    """The mode whose eigenvalue is near ``guess``, with both vectors; gap: distance [1/s] to the nearest other one.

    Raises AnalysisError where two eigenvalues are one to working precision, or where the iteration goes elsewhere.
    """
    stage(f"mode at {abs(guess.imag) / 6.283185307179586:.6g} Hz with both vectors")
    size = max(abs(guess), 1e-300)
    shift = float(np.clip(0.02 * gap, LEAST_SHIFT * size, MOST_SHIFT * size))
    widest = max(min(gap / 3, 1e-2 * size), 1.01 * shift)
    while shift <= widest:
        try:
            found = two_sided(pencil.whole, guess, None, None, beside=shift, solver=solver)
        except SingularMatrix:
            found = None
        if found and _believed(found, guess, gap):
            return _mode(pencil, found)
        shift *= WIDENED
    raise AnalysisError(
        f"the eigenvalue {guess:.6g} 1/s cannot be told from its neighbour: at an exceptional point, or of two equal "
        "bodies, derivatives do not exist; move μ a little"
    )


@passing()
def solve_mode_released(
    pencil: Pencil, guess: complex, gap: float, groups: Sequence[IntArray], *, solver: str | None = None
) -> tuple[Mode, ComplexArray]:
    """`solve_mode` and `by_release` of it, with the same factors where they serve both. Raises what these raise."""
    side = _beside(guess, gap)
    if groups and side:
        stage(f"mode at {abs(guess.imag) / 6.283185307179586:.6g} Hz with both vectors, and with less contact")
        x, y = np.random.default_rng(0).standard_normal((2, pencil.whole.size)) + 0j
        with suppress(SingularMatrix), factorise(pencil.whole.at(guess + side), saddle=True, solver=solver) as factor:
            found = iterated(pencil.whole, factor, guess, x, y)
            if found is not None and _believed(found, guess, gap):
                mode = _mode(pencil, found)
                return mode, _released(pencil, mode, groups, factor, guess + side - mode.eigenvalue, refine=False)
    mode = solve_mode(pencil, guess, gap, solver=solver)
    return mode, by_release(pencil, mode, groups, gap, solver=solver)


def _believed(found: Iterated, guess: complex, gap: float) -> bool:
    """Whether an iteration has settled, and at the eigenvalue that it was sent to."""
    size = max(abs(guess), 1e-300)
    settled = found.change <= BELIEVED * abs(found.lam)
    return settled and abs(found.lam - guess) <= max(BELIEVED * size, 0.3 * min(gap, 1e-3 * size))


def _mode(pencil: Pencil, found: Iterated) -> Mode:
    """The pair that was found, judged and scaled."""
    mass, lam = pencil.whole.mass, found.lam
    right, left, at = pencil.parted(found.right), pencil.parted(found.left), np.array([lam])
    length = [float(np.linalg.norm(v[0])) for v in (right, left)]
    right = right[0] / length[0], right[1] / length[0]
    slope = found.slope / length[0]
    size = np.sqrt(np.vdot(found.right, _on(mass, found.right)).real * np.vdot(found.left, _on(mass, found.left)).real)
    residual = max(
        float(judge.backward_error(at, u[:, None], sign * p[:, None])[0])
        for judge, (u, p), sign in ((pencil, right, 1.0), (pencil.transposed, left, -1.0))
    )
    condition = float(2 * abs(lam) * size / abs(found.slope))
    return Mode(lam, ModeVector(*right), ModeVector(left[0] / slope, left[1] / slope), condition, residual)


def _on(matrix: Sparse, vector: ComplexArray) -> ComplexArray:
    """matrix @ vector (n,) of a real matrix, in real arithmetic."""
    return times(matrix, vector)


def _combined(parts: tuple[tuple[float, Pencil], ...], step: float) -> PencilChange:
    """Σ weight · terms / step."""
    found = {}
    for field in fields(PencilChange):
        values = [weight / step * getattr(pencil, field.name) for weight, pencil in parts]
        total = sum(values[1:], start=values[0])
        if sp.issparse(total):
            total = sp.csr_array(total)
            total.eliminate_zeros()
        found[field.name] = total
    return PencilChange(**found)


def _is_affine(low: Pencil, middle: Pencil, high: Pencil) -> bool:
    """Whether equally spaced pencils lie on a line, to rounding."""
    for field in fields(PencilChange):
        a, b, c = (getattr(pencil, field.name) for pencil in (low, middle, high))
        size, first, second = (_largest(v) for v in (b, c - a, a - 2 * b + c))
        if second > AFFINE * first + 1e-14 * size:
            return False
    return True


def _largest(values: Sparse) -> float:
    data: Array = values.data if sp.issparse(values) else values
    return float(np.abs(data).max(initial=0.0))

