"""A case and ranges of its numbers in, a reduced model out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from ..asking import NUMBER, SWITCH, TABLE, takes
from ..case import Case
from ..case.expression import parse_expression
from ..case.matrix_checks import MU
from ..case.points import choice
from ..errors import AnalysisError, CaseError
from ..sliding.stretches import (
    HELD,
    HELD_AT_ALL,
    Stretch,
    elsewhere_words,
    instead_of_own,
    stretches,
    stretches_along,
)
from ..system import System, build_system
from ..system.bodies import KnownBodies
from ..system.imported import ImportedTerm
from ..system.shares import system_shares
from ..typing import IntArray
from .workspace import Problem, Workspace

if TYPE_CHECKING:
    from ..modal.parametric import Parameter, ReducedModel
    from ..modal.parametric.contacts import ContactsProblem, ParametricSystems
    from ..modal.parametric.family import FactoredPart
    from ..modal.parametric.problem import Role

SMALL = 60  # unknowns up to which a reduced model saves nothing
MOST = 400  # and up to which all eigenvalues of the full problem are solved for hundreds of times
GRID = 5  # values of each of two numbers at which it is looked which nodes touch, of small models
ENCLOSED = 8000  # freedoms up to which the values from which on other nodes touch are enclosed
CORNERS = 4  # numbers of a box up to which all of its corners are looked at
REMEMBERED = 8  # systems of a case with other numbers
DAMPED = "modal.damped = false does not hold here: a reduced model keeps the damping of the case"


@takes(box=TABLE, bound=NUMBER, whole=SWITCH, held_at=TABLE.or_none())
def reduced_model(
    problem: Problem,
    box: Mapping[str, tuple[float, float]],
    *,
    max_frequency_hz: float | None = None,
    bound: float = 1e-8,
    whole: bool = True,
    held_at: Mapping[str, float] | None = None,
) -> ReducedModel:
    """One factorisation's worth of work, then every mode for all values in the box in milliseconds.

    box: ranges by name: "mu" (of all contacts, and in factors of imported matrices), "contact_stiffness" (a factor of
    all contact stiffnesses), or the path of any number of the case, as in an override
    ("materials.lining.young_modulus", "bodies.disc.damping.stiffness"), or one of [parameters] by its name.
    max_frequency_hz: modes up to there (default: modal.max_frequency_hz). bound: relative error of the eigenvalues. The
    nodes that touch are those of steady sliding in the case as it is; ``problem.notes`` of the model says where others
    would. Rigid contact is eliminated: ``problem.displacements`` gives the system's freedoms back. whole: keep
    matrices of up to 400 freedoms as they are where they cannot be reduced, as with multipliers; a note says so.
    held_at: as of `searched_model`.

    Raises CaseError for ranges and names that are none; AnalysisError where matrices depend on a number in no simple
    way, where friction jams, or the bound is not reached.
    """
    from ..modal.parametric import all_freedoms, reduce

    case = Workspace.of(problem).case("a reduced model")
    found, limit = parametric_problem(case, box, held_at=held_at), _limit(case, max_frequency_hz)
    solver = _solver(case)
    try:
        return reduce(found, limit, bound=bound, solver=solver)
    except AnalysisError as error:
        if not whole or found.size > MOST:
            raise
        why = f"all is solved in the full problem, there is no reduced model: {error}"
        return all_freedoms(replace(found, notes=(*found.notes, why)), limit, bound=bound)


def searched_model(
    case: Case, box: Mapping[str, tuple[float, float]], *, max_frequency_hz: float | None = None,
    held_at: Mapping[str, float] | None = None,
) -> ReducedModel:  # fmt: skip
    """The model on which onsets are sought: all freedoms of what is small, so that no mode can be missing, else what
    `reduced_model` gives. held_at: values whose touching nodes it holds, for a box in which they are the same (the
    caller has seen to that)."""
    from ..modal.parametric import all_freedoms

    if build_system(case).size > SMALL:
        return reduced_model(case, box, max_frequency_hz=max_frequency_hz, held_at=held_at)
    return all_freedoms(parametric_problem(case, box, held_at=held_at), _limit(case, max_frequency_hz))


def stretches_of(case: Case, name: str, between: tuple[float, float]) -> tuple[Stretch, ...]:
    """The stretches of a number of the case, as a box calls it, in which the same nodes touch."""
    _parameters(case, {name: between})  # raises for what is none
    numbers = Numbers(case, {name: between})
    solver = _solver(case)
    if name == MU and not numbers.named_in_factors:
        return stretches(numbers.own, *between, solver=solver)
    return stretches_along(
        lambda value: numbers.pressed({name: value}), numbers.own, *between, rubs=name == MU, solver=solver
    )


def _limit(case: Case, max_frequency_hz: float | None) -> float:
    return case.modal.max_frequency_hz if max_frequency_hz is None else max_frequency_hz


def parametric_problem(
    case: Case, box: Mapping[str, tuple[float, float]], *, held_at: Mapping[str, float] | None = None
) -> ContactsProblem:
    """The matrices of a case as sums of terms in the numbers of a box, as `reduced_model` takes it."""
    from ..modal.options import Options
    from ..modal.parametric.contacts import FRICTION, STIFFNESS, contacts_problem

    parameters = _parameters(case, box)
    numbers = Numbers(case, box)
    if not numbers.own.contact_nodes().count:
        elsewhere = {*case.parameters, *case.factor_names}
        for name in (FRICTION, STIFFNESS):
            if name in box and name not in elsewhere:
                why = "the case has no contacts and no factor that names it, so that nothing depends on it"
                raise CaseError(f"box.{name}", None, f"{why}; take another number")
    settings = case.modal
    family = _family(case, numbers, parameters, numbers.own if held_at is None else numbers.pressed(held_at))
    solver = _solver(case)
    friction = next((p for p in parameters if p.name == FRICTION), None)
    if held_at is not None:
        instead = held_at.get(FRICTION)
    else:
        instead = None if friction is None else instead_of_own(numbers.own, friction.low, friction.high, solver=solver)
    options = Options(settings.friction_damping, settings.prestress, solver)
    problem = contacts_problem(family, touching_at=instead, options=options)
    said, where = problem.notes, problem.elsewhere
    if held_at is not None:
        said = where = ()  # what is held there is right
    elif instead is not None:
        held = f"The nodes that touch at μ = {instead:g} {HELD}: there is no steady sliding at the case's own friction."
        said, where = (*said, held), (*where, held)
    elif numbers.own.contact_nodes().count and not where:
        # Where steady states are solved for, the problem has told of what it holds.
        where = _elsewhere(case, box, numbers, problem)
        said = (*said, *where)
    notes = said if settings.damped else (*said, DAMPED)
    return replace(problem, notes=notes, elsewhere=where, looked=_Looked(case, box, problem))


def _family(
    case: Case, numbers: Numbers, parameters: tuple[Parameter, ...], own: System
) -> ParametricSystems:
    """The systems over parameters, of which own says which nodes touch."""
    from ..modal.parametric.contacts import FRICTION, STIFFNESS, ParametricSystems

    exact = {FRICTION, STIFFNESS, *case.parameters}
    interpolated = tuple(p for p in parameters if p.name not in exact)
    return ParametricSystems(own, numbers.system, numbers.structure, parameters, interpolated)


class _Looked:
    """At which points a problem does not hold, in words, each looked at once. Systems are built when they are asked
    for: a model outlives them."""

    def __init__(self, case: Case, box: Mapping[str, tuple[float, float]], problem: ContactsProblem) -> None:
        self._case, self._box, self._problem = case, dict(box), problem
        self._known: dict[tuple[tuple[str, float], ...], str] = {}

    def __call__(self, points: Sequence[Mapping[str, float]]) -> tuple[str, ...]:
        keys = [_key(point) for point in points]
        new = {key: point for key, point in zip(keys, points, strict=True) if key not in self._known}
        if new:
            self._look(new)
        return tuple(self._known[key] for key in keys)

    def _look(self, new: Mapping[tuple[tuple[str, float], ...], Mapping[str, float]]) -> None:
        from ..modal.parametric.contacts_steady import unlike_at

        numbers, problem = Numbers(self._case, self._box), self._problem
        touching = np.zeros(0, dtype=bool) if problem.touching is None else problem.touching
        held, points = np.flatnonzero(touching), _by_system(new.values())
        same = [at for at in points if numbers.system(at).contact_nodes().count == len(touching)]
        found = unlike_at(numbers.system, held, same, _solver(self._case)) if len(touching) else []
        self._known |= {key: "others can touch" for key in new}
        self._known |= {_key(at): "" for at in same} | {_key(at): words for at, words in found}
        for at in same:
            # In the box the problem was refused for these.
            if not self._known[_key(at)] and not problem.inside(at):
                self._known[_key(at)] = _slides_unlike(numbers, held, at) or self._deviates(numbers, held, at)

    def _deviates(self, numbers: Numbers, held: IntArray, at: Mapping[str, float]) -> str:
        """Words on that the matrices are no longer what they are made of in the box."""
        from ..modal.parametric.contacts import deviates
        from ..modal.parametric.family import EXACT

        family = _family(self._case, numbers, self._problem.parameters, numbers.own)
        if all(p.low <= at[p.name] <= p.high for p in family.interpolated):
            return ""
        off = deviates(family, held, at)
        return f"the model's matrices are off by {off:.1e} there" if off > 10 * EXACT else ""


def _key(point: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
    return tuple(sorted(point.items()))


def _solver(case: Case) -> str | None:
    return None if case.modal.solver == "auto" else case.modal.solver


def _by_system(points: Iterable[Mapping[str, float]]) -> list[Mapping[str, float]]:
    """Points of one system, which differ in friction and contact stiffness alone, one after the other."""
    from ..modal.parametric.contacts_steady import FRICTION, STIFFNESS

    return sorted(points, key=lambda at: [value for name, value in at.items() if name not in (FRICTION, STIFFNESS)])


def _slides_unlike(numbers: Numbers, held: IntArray, at: Mapping[str, float]) -> str:
    """Words on that nodes that touch slide the other way than in the case as it is, or not at all, and on that rigid
    contact does not determine sliding; "" where all is as it is there."""
    from ..modal.options import Options
    from ..modal.painleve import steps_undetermined
    from ..modal.parametric.contacts_steady import contacts_of

    system = numbers.system(at)
    own, there = (contacts_of(one, held).sense[held] for one in (numbers.own, system))
    slides = np.any(own != 0.0, axis=1)
    if turned := int(np.sum(slides & (np.sum(own * there, axis=1) <= 0.0))):
        return f"{turned} of {len(held)} touching nodes do not slide in the direction that they are held with"
    return "rigid contact does not determine the motion" if steps_undetermined(system, at.get(MU), Options()) else ""


def _elsewhere(
    case: Case, box: Mapping[str, tuple[float, float]], numbers: Numbers, problem: ContactsProblem
) -> tuple[str, ...]:
    """Where in a box others than the nodes that a problem holds touch, in words."""
    from ..modal.parametric.contacts_steady import unlike_at

    if problem.touching is None:
        return ()
    # From where on others do takes tens of systems for another number than μ.
    if len(box) == 1 and (MU in box or numbers.own.size <= ENCLOSED):
        ((name, between),) = box.items()
        return elsewhere_words(stretches_of(case, name, between), "μ" if name == MU else name)
    solver = _solver(case)
    points = _by_system(_looked_at(problem, small=numbers.own.size <= MOST))
    held = np.flatnonzero(problem.touching)
    others = unlike_at(numbers.system, held, points, solver)
    if not others:
        return ()
    told = [f"{', '.join(f'{name} = {value:.4g}' for name, value in at.items())} ({words})" for at, words in others[:2]]
    return (
        f"The {len(held)} of {len(problem.touching)} contact nodes that touch in the case as it is {HELD_AT_ALL}; "
        f"steady sliding has others at {len(others)} of {len(points)} values of the box that were looked at, such as "
        f"{'; '.join(told)}. Modes there are other ones: `stridor modes` has them.",
    )


def _looked_at(problem: ContactsProblem, *, small: bool) -> list[dict[str, float]]:
    """Points of a box: its corners and what lies between them, as far as that is cheap."""
    own = problem.reference
    if small and len(own) == 2:
        places: Iterable[tuple[float, ...]] = product(np.linspace(0.0, 1.0, GRID), repeat=2)
    elif small and len(own) <= CORNERS:
        places = product((0.0, 1.0), repeat=len(own))
    else:
        places = (tuple(end for _ in own) for end in (0.0, 1.0))
    points = [
        {p.name: p.low + float(at) * (p.high - p.low) for p, at in zip(problem.parameters, place, strict=True)}
        for place in places
    ]
    # And each number alone, the others as they are.
    alone = [{**own, p.name: end} for p in problem.parameters for end in (p.low, p.high)]
    return points + [point for point in alone if point not in points]


def _parameters(case: Case, box: Mapping[str, tuple[float, float]]) -> tuple[Parameter, ...]:
    """The ranges of a box as parameters. Raises CaseError for what is none."""
    from ..modal.parametric import Parameter
    from ..modal.parametric.contacts import FRICTION, STIFFNESS, friction_range, stiffness_range

    if not box:
        raise CaseError("box", None, 'missing – give at least one range, such as {"mu": (0.0, 0.6)}')
    found: list[Parameter] = []
    for name, between in box.items():
        if len(between) != 2 or not np.all(np.isfinite(between)):
            raise CaseError(f"box.{name}", tuple(between), "a range of two numbers low < high")
        low, high = (float(v) for v in between)
        steps = name.split(".")
        if name == STIFFNESS and name in case.parameters and case.contacts:
            accepted = "is the stiffness of all contacts, and a parameter of the case too; rename the parameter"
            raise CaseError(f"box.{name}", None, accepted)
        if name in case.parameters:
            own = case.parameters[name].value
            found.append(Parameter(name, low, high, value=own if low <= own <= high else (low + high) / 2))
            for end in (low, high):
                case.with_({f"parameters.{name}.value": end})
        elif name == FRICTION:
            found.append(friction_range(between))
        elif name == STIFFNESS:
            found.append(stiffness_range(between))
        elif steps[0] == "parameters" and len(steps) == 3 and steps[1] in case.parameters:
            raise CaseError(f"box.{name}", None, f"call it {steps[1]}")
        elif name.endswith(".friction.coefficient") and (FRICTION in box or FRICTION in case.factor_names):
            raise CaseError(f"box.{name}", None, "give a range of mu, the friction coefficient of all contacts")
        elif len(steps) == 1:
            known = (FRICTION, STIFFNESS, *case.parameters, "the path of a number such as materials.steel.density")
            raise CaseError(f"box.{name}", None, f"no such number{choice(name, known, 'a range is that of')}")
        else:
            found.append(Parameter(name, low, high, value=(low + high) / 2))
    return tuple(found)


class Numbers:
    """The systems of a case with other numbers: own is that of the case as it is."""

    def __init__(self, case: Case, box: Mapping[str, tuple[float, float]]) -> None:
        self._case, self._box, self._bodies = case, box, KnownBodies()
        self.own = build_system(case, known=self._bodies).in_place()
        # In factors of imported matrices, unless that is a parameter of its own.
        self.named_in_factors = MU in case.factor_names and MU not in case.parameters
        self._built: dict[tuple[tuple[str, float], ...], System] = {}

    def system(self, values: Mapping[str, float]) -> System:
        """The system at values of the box; others stay as they are in the case."""
        mu = values.get(MU) if self.named_in_factors else None
        changes = self._changes(values)
        if not changes and mu is None:
            return self.own
        key = tuple(sorted({**changes, **({} if mu is None else {MU: mu})}.items()))
        if key not in self._built:
            while len(self._built) >= REMEMBERED:
                del self._built[next(iter(self._built))]
            self._built[key] = self._checked(build_system(self._varied(changes), mu, known=self._bodies).in_place())
        return self._built[key]

    def _varied(self, changes: dict[str, float]) -> Case:
        """The case with values of the box. Raises CaseError, of the end of a range where that is refused as well: what
        lies between was chosen here, and nobody gave it."""
        try:
            return self._case.with_(changes)
        except CaseError as error:
            of_box = {path: ends for name, ends in self._box.items() for path in self._changes({name: 0.0})}
            for item in error.problems:
                for end in of_box.get(item.where, ()):
                    try:
                        self._case.with_({**changes, item.where: float(end)})
                    except CaseError as at_end:
                        if any(other.where == item.where for other in at_end.problems):
                            raise at_end from None
            raise

    def pressed(self, values: Mapping[str, float]) -> System:
        """`system`, with the contact stiffness of the values: what steady sliding is solved on."""
        factor = values.get("contact_stiffness")
        if factor is None or "contact_stiffness" in self._case.parameters:
            return self.system(values)
        soft = {f"contacts.{name}.stiffness": c.stiffness for name, c in self._case.contacts.items()}
        changes = {path: factor * own for path, own in soft.items() if not isinstance(own, str)}
        mu = values.get(MU) if self.named_in_factors else None
        varied = self._case.with_({**self._changes(values), **changes})
        return self._checked(build_system(varied, mu, known=self._bodies).in_place())

    def structure(self, values: Mapping[str, float]) -> Mapping[str, FactoredPart]:
        """The pieces of mass, damping and stiffness where others than [parameters] and friction have these values."""
        from ..modal.parametric.family import FactoredPart

        if not self._case.imported:
            found = self.system(values)
            roles: tuple[Role, ...] = ("mass", "damping", "stiffness")
            return {role: FactoredPart(getattr(found, role), role) for role in roles}
        varied = self._case.with_(self._changes(values))
        pieces: dict[str, FactoredPart] = {}
        for k, share in enumerate(system_shares(varied)):
            self._checked(share.matrix)
            pieces[f"{share.role} {k}"] = self._piece(varied, share)
        return pieces

    def _piece(self, case: Case, share: ImportedTerm) -> FactoredPart:
        """A term of an imported body with its factor; what of it is not varied is multiplied in."""
        from ..modal.parametric.factors import Formula
        from ..modal.parametric.family import FactoredPart

        if not isinstance(share.factor, str):
            return FactoredPart(sp.csr_array(share.factor * share.matrix), share.role)
        expression = parse_expression(share.factor, (*case.parameters, MU), share.where)
        values = case.factor_values()
        varied = tuple(name for name in expression.names if name in self._box)
        if not varied:
            return FactoredPart(sp.csr_array(expression.value(values, share.where) * share.matrix), share.role)
        fixed = tuple((name, values[name]) for name in expression.names if name not in varied)
        return FactoredPart(share.matrix, share.role, Formula(share.factor, varied, fixed, share.where))

    def _changes(self, values: Mapping[str, float]) -> dict[str, float]:
        """Overrides of the case."""
        named = {k: f"parameters.{k}.value" for k in self._case.parameters}
        return {named.get(k, k): v for k, v in values.items() if k in named or k not in (MU, "contact_stiffness")}

    def _checked(self, found: Any) -> Any:
        """Raises CaseError where a system or a matrix has other freedoms than those of the case."""
        size = found.size if isinstance(found, System) else found.shape[0]
        if size != self.own.size:
            raise CaseError("box", ", ".join(self._box), "changes the number of freedoms; give numbers that do not")
        return found
