"""How the complex modes of a case answer to its numbers: dλ/dp, and where such derivatives stop to mean anything."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp

from ..asking import SWITCH_OR_NONE, TABLE, takes
from ..case import Case
from ..case.matrix_checks import MU
from ..case.overrides import number_at as number_of
from ..case.overrides import split_path
from ..case.points import choice
from ..case.usual import is_of_shape, is_place
from ..digits import measured
from ..direct import Nearby
from ..errors import AnalysisError, CaseError
from ..laws.friction import Shared, own_law, share_of
from ..modal.complex_modes import ComplexModes
from ..modal.derivatives import (
    Mode,
    PencilChange,
    by_compliance,
    by_friction,
    hold,
    pencil_of,
    rate_from_zero,
    rate_of,
    solve_mode,
    solve_mode_released,
)
from ..modal.growing import doubt
from ..modal.krylov import Carried
from ..modal.pencil import Pencil
from ..sliding import share_factors, steady_nodes
from ..system import System, build_system
from ..system.bodies import KnownBodies
from ..system.imported import cleaned
from ..typing import Array, ComplexArray, IntArray
from .analyses import modes as modes_at
from .asked import names_of, require_band, require_friction
from .provenance import provenance
from .sensitivity_result import Sensitivities
from .workspace import Problem, Workspace, different_friction, friction_in_sliding, frictions_by_contact

SHAPE_STEP = 1e-5  # of the size of bodies: by how much what says where nodes lie is moved
NEAR = 0.05  # relative change of a number within which an exceptional point is told of
BENT = 2.0  # condition number from which two close modes are on their way to an exceptional point
ILL = 30.0  # condition number that is worth a sentence by itself
REPEATED = 1e-9  # of |λ|: eigenvalues nearer to each other are one

SETTINGS = ("modal", "temporal", "comparison")  # tables of a case that say how something is computed

Choice = Literal["unstable", "all"] | Sequence[int]
_FRICTION = ("mu", "parameters.mu.value")


@takes(damped=SWITCH_OR_NONE, steps=TABLE.or_none())
def sensitivities(
    problem: Problem,
    parameters: str | Sequence[str] = ("mu",),
    *,
    mu: float | None = None,
    modes: Choice = "unstable",
    count: int | None = None,
    max_frequency_hz: float | None = None,
    band_hz: tuple[float, float] | None = None,
    damped: bool | None = None,
    steps: Mapping[str, float] | None = None,
) -> Sensitivities:
    """dλ/dp of complex modes over numbers of the case, each named by the path that overrides it.

    "mu" is the friction coefficient of every contact and in the factors of imported matrices,
    "contacts.NAME.friction.coefficient" that of one contact; "contacts.NAME.compliance" is 1/K_c, which rigid contact
    has too. Every other path is a number of the case, such as "materials.iron.density", "bodies.pad.thickness" or
    "bodies.brake.terms.1.factor", or the name of one of its [parameters]; settings of analyses, such as
    modal.max_frequency_hz, are none of the model.

    mu: the friction coefficient (default: the case's own).

    modes: "unstable", "all" of the band, or numbers of branches; band_hz: of these, what has a frequency between the
    two. count, max_frequency_hz, damped: as in `modes`.
    steps: by how much a number is changed to see what the matrices do, where a thousandth of it will not do.

    The touching nodes and the directions of sliding stay as they are at the case itself: what a number does by opening
    or closing contact is not in the derivative. Numbers of friction laws and speeds change the coefficient, too, where
    mu is the case's own; another mu is held, and a warning says so. Raises CaseError for paths that lead to no number
    and for "mu" where nothing depends on it, AnalysisError where steady sliding does not exist. A mode without
    derivatives is left out, and a warning says so.
    """
    started, parameters = time.perf_counter(), names_of(parameters, "parameters")
    work = Workspace.of(problem)
    linear = Linearised.of(work, mu, count=count, max_frequency_hz=max_frequency_hz, damped=damped)
    parameters = numbers_of(linear.case, parameters)
    values = np.array([linear.value(path) for path in parameters])
    changes = [linear.change(path, (steps or {}).get(path)) for path in parameters]
    linear.warnings += [
        f"{path} has no effect: no matrix of the modes depends on it"
        for path, change in zip(parameters, changes, strict=True)
        if change.nothing
    ]
    require_band(band_hz, max_frequency_hz or work.modal.max_frequency_hz)
    chosen = _inside(linear, linear.columns(modes), band_hz)
    columns = [b for b in chosen if linear.mode(b) is not None]
    found = [linear.known(b) for b in columns]
    derivative = _derivatives(found, changes)
    exceptional = np.full(derivative.shape, np.nan + 0j)
    for column, b in enumerate(columns):
        other = linear.neighbour(b)
        partner = None if other is None else linear.mode(other)
        if partner is not None and min(partner.condition, found[column].condition) > BENT:
            slopes = _derivatives([partner], changes)[:, 0]
            exceptional[:, column] = _meeting(values, found[column], partner, derivative[:, column], slopes)
    result = Sensitivities(
        mu=linear.mu,
        parameters=parameters,
        values=values,
        branch=linear.modes.branch[columns],
        eigenvalues=np.array([m.eigenvalue for m in found], dtype=complex),
        derivative=derivative,
        condition=np.array([m.condition for m in found]),
        nearest=np.array([linear.gap(b) for b in columns]),
        exceptional=exceptional,
        residual=np.array([m.residual for m in found]),
        damped=linear.modes.damped,
        open_contacts=linear.modes.open_contacts,
        provenance=provenance(work, "sensitivities", time.perf_counter() - started, mu=linear.mu),
        band_hz=band_hz,
    )
    told = list(linear.warnings)
    if not chosen and modes == "unstable":
        where = "" if band_hz is None else " from {:g} to {:g} Hz".format(*band_hz)
        told.append(f"no mode{where} is unstable at μ = {linear.mu:g}: name branches to see what stable ones do")
    return replace(result, warnings=(*told, *_divergence(result)))


def _inside(linear: Linearised, columns: list[int], band_hz: tuple[float, float] | None) -> list[int]:
    """Of these columns those with a frequency [Hz] in the band."""
    low, high = band_hz or (0.0, np.inf)
    return [b for b in columns if low <= linear.eigenvalues[b].imag / (2 * np.pi) <= high]


def _derivatives(found: Sequence[Mode], changes: Sequence[PencilChange]) -> ComplexArray:
    """dλ/dp (k, b)."""
    table = [[mode.derivative(change) for mode in found] for change in changes]
    return np.array(table, dtype=complex).reshape(len(changes), len(found))


def _meeting(values: Array, mode: Mode, other: Mode, own: ComplexArray, theirs: ComplexArray) -> ComplexArray:
    """Complex values (k,) of the numbers at which two modes meet.

    b = (λ₁ − λ₂)²/4 is analytic through an exceptional point, unlike λ: its tangent is followed to zero.
    """
    apart, closing = mode.eigenvalue - other.eigenvalue, own - theirs
    with np.errstate(all="ignore"):
        found = values - apart / (2 * closing)
    return np.where(np.isfinite(found), found, np.nan + 0j)


def _divergence(result: Sensitivities) -> list[str]:
    """Sentences about modes whose derivatives hold for next to no change."""
    told: list[str] = []
    distance = result.exceptional_distance
    for b, branch in enumerate(result.branch):
        name = f"mode {branch} ({measured(result.frequency_hz[b], 1)} Hz)"
        condition = f"condition number {result.condition[b]:.3g}"
        near = [k for k in range(len(result.parameters)) if distance[k, b] < NEAR]
        if near:
            where = ", ".join(
                f"{result.parameters[k]} = {result.exceptional[k, b].real:.5g} ({100 * distance[k, b]:.2g} % away)"
                for k in near
            )
            told.append(
                f"{name}, {condition}: near an exceptional point, estimated at {where}. There λ changes with the "
                "square root of the distance and derivatives diverge; first-order predictions hold only for changes "
                "much smaller than that distance"
            )
        elif result.condition[b] > ILL:
            told.append(f"{name}, {condition}: almost a double eigenvalue; its derivatives hold for small changes only")
    return told


class Linearised:
    """A case at one μ with the modes of its band, what each number does to its matrices, and the modes' vectors as
    they are asked for."""

    def __init__(
        self, work: Workspace, mu: float, modes: ComplexModes, *, damped: bool, handed: Carried | None = None
    ) -> None:
        self.work, self.mu, self.modes, self.damped = work, mu, modes, damped
        self.handed = Carried() if handed is None else handed
        self.case, self.options = work.case("a sensitivity"), work.options
        self.system = self._as_asked(work.system(mu))
        self.eigenvalues: ComplexArray = modes.eigenvalues[0]
        self.held = hold(self.system, mu, self.options)
        self.pencil = pencil_of(self.system, mu, self.held, self.options)
        doubtful = doubt(modes.completeness[0]) if modes.completeness else ""
        self.warnings: list[str] = [f"modes at μ = {mu:g}: {doubtful}"] if doubtful else []
        self.warnings += work.one_for_all
        self._solved: dict[int, Mode | None] = {}
        self._released: dict[int, ComplexArray] = {}
        # At the case's own friction a number of its laws, or what slides faster, changes that friction, too.
        self.by_law = any(c.friction.law != "coulomb" for c in self.case.contacts.values())
        own = work.own_friction if self.by_law else None
        self.follows_law = own is not None and bool(np.isclose(mu, own, 1e-9, 0.0))
        # What systems in which one number is another have in common.
        self._bodies, self._factors = KnownBodies(), Nearby()

    @staticmethod
    def of(
        problem: Case | Workspace,
        mu: float | None,
        *,
        count: int | None = None,
        max_frequency_hz: float | None = None,
        damped: bool | None = None,
        hand_on: bool = False,
    ) -> Linearised:
        """At ``mu`` (default: the case's own friction), settings as `sensitivities` takes them. hand_on: keep what the
        modes' basis hands on to that of a system with a small change."""
        work = Workspace.of(problem)
        work.case("a sensitivity")
        require_friction(mu, several=False)
        value = work.own_friction if mu is None else float(mu)
        if value is None:
            accepted = f"one friction coefficient for all contacts, since {different_friction(work.system())}"
            raise CaseError("mu", None, accepted)
        damped = work.modal.damped if damped is None else damped
        handed = Carried()
        work.handed = handed if hand_on else None
        try:
            modes = modes_at(work, value, count=count, max_frequency_hz=max_frequency_hz, damped=damped)
        finally:
            work.handed = None
        return Linearised(work, value, modes, damped=damped, handed=handed)

    def value(self, path: str) -> float:
        """The number at a path. Raises CaseError where there is none."""
        contact = _contact_of(self.case, path)
        if path in _FRICTION or (contact and self._is_friction(path) and not self._without(contact)):
            return self.mu
        if contact and path.endswith(".compliance"):
            stiffness = self.case.contacts[contact].stiffness
            return 0.0 if stiffness == "rigid" else 1.0 / stiffness
        if "." not in path and path not in self.case.parameters:
            known = ("mu", "the path of one such as materials.steel.density")
            raise CaseError(path, None, f"no such number{choice(path, known, 'a number is')}")
        if split_path(path)[0] in SETTINGS:
            number_at(self.case, path)
            raise CaseError(path, None, "a setting of analyses: no matrix depends on it; give a number of the model")
        return number_at(self.case, path)

    def change(self, path: str, step: float | None = None) -> PencilChange:
        """What the number at a path does to the matrices, per unit of it."""
        contact = _contact_of(self.case, path)
        if path in _FRICTION:
            return self._by_friction(path)
        if contact and self._is_friction(path):
            return by_friction(self.system, self.mu, self.held, self.options, contact=contact)
        compliance = contact is not None and path.endswith(".compliance")
        if contact and compliance:
            alone = by_compliance(self.system, self.held, self.options, contact)
            if alone is not None:
                return alone

        moved: list[Array] = []
        apart: list[bool] = []

        def at(value: float) -> Pencil:
            system = self.varied(path, value)
            if self.by_law:
                moved.append(np.array(list(frictions_by_contact(system).values())))
                apart.append(friction_in_sliding(system) is None)
            return pencil_of(system, self.friction(system), self.held, self.options)

        try:
            value, step = self.value(path), step or self._step(path)
            scale = None if value or step else self._yielding() if compliance else self._natural(path)
            if scale:
                found = rate_from_zero(at, scale, base=self.pencil)
            else:
                found, affine = rate_of(at, value, step, base=self.pencil)
                if not (value or step or affine):  # nothing says how far from zero is near
                    found = rate_from_zero(at, 1.0, base=self.pencil)
        except CaseError as error:
            accepted = f"a number that can be varied a little ({error.problems[0].accepted})"
            raise CaseError(path, self.value(path), accepted) from error
        changed = any(not np.array_equal(one, moved[0]) for one in moved[1:])
        if changed and self.follows_law and any(apart):
            # What the laws add is known at a μ that all contacts have; with μ held it is another case's derivative.
            accepted = "mu, or a number that all contacts take their friction from, as modes are those of one μ"
            raise CaseError(path, self.value(path), accepted)
        if changed and not self.follows_law:
            self.warnings.append(
                f"{path}: friction is held at μ = {self.mu:g}, as asked for; what it does to the coefficient of the "
                "law is not in the derivative (it is at the case's own friction, without --mu)"
            )
        return found

    def _step(self, path: str) -> float | None:
        """By how much a number is moved that says where nodes lie; None for others.

        A point of contact on a line of beams is on a curve whose second derivative jumps from element to element, and
        differences about a node are of first order. How far a coordinate is from the origin says nothing.
        """
        steps = split_path(path)
        if is_place(self.case, steps):
            parts = [line.coordinates for line in self.system.lines] + [solid.points for solid in self.system.solids]
            sizes = [np.ptp(points, axis=0).max(initial=0.0) for points in parts]
            # Of point masses, how far they are apart.
            size = max(sizes, default=0.0) or np.ptp([points[0] for points in parts], axis=0).max(initial=0.0)
            return SHAPE_STEP * (float(size) or 1.0)
        shapes = steps[0] == "bodies" and is_of_shape(self.case, steps)
        return SHAPE_STEP * (abs(self.value(path)) or 1.0) if shapes else None

    def _natural(self, path: str) -> float:
        """What is no longer small of a number at zero on which steady sliding depends, δ being how far bodies move in
        that [m]: of a length by which something is pressed δ, of a cubic term that beside a stiffness k, k/δ². 0.0 of
        other numbers, and where nothing moves."""
        steps = split_path(path)
        cubic, length = steps[-1] == "cubic", is_of_shape(self.case, steps)
        if not (cubic or length):
            return 0.0
        moved = float(np.abs(steady_nodes(self.system, self.mu, self.options.solver).displacement).max(initial=0.0))
        if length or not moved:
            return moved
        beside = getattr(getattr(self.case, steps[0])[steps[1]], "stiffness", None)
        return float(beside) / moved**2 if isinstance(beside, float | int) else 0.0

    def _yielding(self) -> float:
        """A compliance of contact [m³/N, m/N of a point] with which bodies come as near as they move in steady
        sliding."""
        steady = steady_nodes(self.system, self.mu, self.options.solver)
        area = self.system.contact_nodes().area
        pressure = np.abs(steady.normal_force) / np.where(np.isnan(area) | (area <= 0), 1.0, area)
        return float(np.abs(steady.displacement).max()) / float(pressure.max())

    def _without(self, contact: str) -> bool:
        """Whether a contact has no friction at any μ."""
        nodes = self.system.contact_nodes()
        return not np.any(nodes.rubs[nodes.owner == nodes.names.index(contact)])

    def _is_friction(self, path: str) -> bool:
        """Whether a number of a contact is its friction coefficient: of a law of speed it is but one of its numbers."""
        return path.endswith(".friction.coefficient") and not self.follows_law

    def friction(self, system: System) -> float:
        """The friction coefficient of this case with another number in it: what its laws give where this one's is that
        of its laws, else the one asked for."""
        own = friction_in_sliding(system) if self.follows_law else None
        return self.mu if own is None else own

    def with_friction(self, path: str, mu: float) -> tuple[System, float] | None:
        """The system whose friction coefficient at a path is ``mu``, and what is to be asked for of all its contacts;
        None where there is none at that path."""
        if path in _FRICTION:
            return self._as_asked(self.work.system(mu)), mu
        contact, nodes = _contact_of(self.case, path), self.system.contact_nodes()
        if not contact or not self._is_friction(path) or self._without(contact):
            return None
        own = [mu if n == contact else self.mu * share_of(w) for n, w in zip(nodes.names, nodes.laws, strict=True)]
        largest = max(own) or 1.0
        laws = [Shared(own_law(law), each / largest) for law, each in zip(nodes.laws, own, strict=True)]
        return self.system.with_laws(laws), max(own)

    def varied(self, path: str, value: float) -> System:
        """The system with another number at a path, with or without damping as this one. Raises CaseError."""
        to: float | str = value
        if _contact_of(self.case, path) and path.endswith(".compliance"):
            path = path.removesuffix("compliance") + "stiffness"
            to = 1.0 / value if value else "rigid"
        steps = split_path(path)
        # The range of a parameter says where onsets are sought; a little beyond its end nothing is amiss.
        beyond = {".".join([*steps[:2], "range"]): None} if steps[0] == "parameters" else {}
        case = self.case.with_({**beyond, path: to})
        mu = self.mu if self.work.varies else None
        system = self._as_asked(build_system(case, mu, known=self._bodies))
        share_factors(system, self._factors)
        return system

    def _as_asked(self, system: System) -> System:
        """The system with damping or without; gyroscopic forces are none."""
        if self.damped or system.symmetric_definite:
            return system if self.damped else system.undamped()
        damping = cleaned(system.damping)  # what rounding leaves of symmetry is no gyroscopic force
        return replace(system, damping=sp.csr_array((damping - damping.T) / 2))

    def _by_friction(self, path: str) -> PencilChange:
        """Change of P per unit of μ, in contacts and in factors of imported matrices."""

        def at(mu: float) -> Pencil:
            return pencil_of(self._as_asked(self.work.system(mu)), mu, self.held, self.options)

        if self.work.varies:
            return rate_of(at, self.mu)[0]
        if not self.held.nodes:
            example = next((f"bodies.{name}.terms.0.factor" for name in self.case.imported), "materials.steel.density")
            accepted = "there are no contacts and no factor of a matrix has mu in it; give another number of the case"
            raise CaseError(path, None, f"nothing depends on it: {accepted}, such as {example} (--parameter)")
        return by_friction(self.system, self.mu, self.held, self.options)

    def columns(self, choice: Choice) -> list[int]:
        """Columns of the modes chosen. Raises CaseError for numbers that no branch has."""
        if choice == "unstable":
            return [int(b) for b in np.flatnonzero(self.modes.unstable[0] & self.modes.in_band[0])]
        if choice == "all":
            return list(range(len(self.eigenvalues)))
        where = {int(number): column for column, number in enumerate(self.modes.branch)}
        given: Any = choice
        listed = isinstance(given, Iterable) and not isinstance(given, str)
        missing = [number for number in choice if number not in where] if listed else [given]
        if missing or not len(choice):
            numbers = f"from 1 to {len(where)}" if where else "(the band has none)"
            accepted = f"numbers of branches {numbers}"
            if not listed:
                raise CaseError("modes", given, f'"unstable", "all" or a list of {accepted}')
            raise CaseError("modes", missing or choice, accepted)
        return [where[number] for number in choice]

    def gap(self, column: int) -> float:
        """Distance [1/s] to the nearest other eigenvalue, the own conjugate included."""
        lam = self.eigenvalues[column]
        others = np.delete(self.eigenvalues, column)
        mirrored = 2 * abs(lam.imag)
        return float(min(np.abs(others - lam).min(initial=np.inf), mirrored if mirrored else np.inf, abs(lam)))

    def neighbour(self, column: int) -> int | None:
        """Column of the nearest other eigenvalue."""
        distance = np.abs(self.eigenvalues - self.eigenvalues[column])
        distance[column] = np.inf
        return int(np.argmin(distance)) if len(distance) > 1 else None

    def mode(self, column: int, groups: Sequence[IntArray] = ()) -> Mode | None:
        """A mode with its vectors; None, and a warning, where it has no derivatives. groups: of touching nodes, which
        `released` is going to be asked of, from the first time on."""
        if column not in self._solved:
            lam = complex(self.eigenvalues[column])
            name = f"mode {self.modes.branch[column]} ({measured(lam.imag / (2 * np.pi), 1)} Hz)"
            try:
                if self.gap(column) <= REPEATED * abs(lam):
                    raise AnalysisError("two eigenvalues are equal, and derivatives belong to neither")
                solver = self.options.solver
                if groups:
                    found = solve_mode_released(self.pencil, lam, self.gap(column), groups, solver=solver)
                    self._solved[column], self._released[column] = found
                else:
                    self._solved[column] = solve_mode(self.pencil, lam, self.gap(column), solver=solver)
            except AnalysisError as error:
                self.warnings.append(f"{name} is left out: {error}")
                self._solved[column] = None
        return self._solved[column]

    def released(self, column: int) -> ComplexArray:
        """What taking contact away from each of the groups that the mode was asked for with does to λ (g,) [1/s]."""
        return self._released[column]

    def known(self, column: int) -> Mode:
        """A mode that is known to have derivatives."""
        found = self.mode(column)
        assert found is not None, "asked for after `mode` said so"
        return found


def numbers_of(case: Case, names: Sequence[str]) -> tuple[str, ...]:
    """Paths of numbers, of which parameters may be called by their names alone."""
    return tuple(f"parameters.{n}.value" if n in case.parameters and n != MU else n for n in names)


def _contact_of(case: Case, path: str) -> str | None:
    """The contact that a path is about, None for other paths."""
    steps = split_path(path)
    return steps[1] if len(steps) > 2 and steps[0] == "contacts" and steps[1] in case.contacts else None


def number_at(case: Case, path: str) -> float:
    """The number at a dotted path of a case, defaults included. Raises CaseError where there is none."""
    return number_of(case.model_dump(mode="json", exclude_none=True), path)
