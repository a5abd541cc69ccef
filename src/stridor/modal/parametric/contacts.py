"""A system with contacts as a parametric problem in friction, contact stiffness and whatever else varies.

With p = −κ c⁻¹ N u the forces of contact springs are eliminated:

    λ²M + λC + K + κ Nᵀc⁻¹N + μκ Sᵀc⁻¹N ,

N, S the rows of the gaps and of the slip, c the compliances of the case and κ a factor of all contact stiffnesses. What
steady sliding adds (`contacts_steady`) are further terms, and rigid contact is taken out of all of them
(`contacts_rigid`). The nodes in contact are those of steady sliding at one friction coefficient.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from ...case.usual import MOST_FRICTION, TOO_MUCH
from ...contact.nodes import ContactNodes
from ...errors import CaseError, NotReducibleError
from ...system import System
from ...typing import BoolArray, IntArray, Sparse
from ..krylov.steady import Steadiness, contact_rows, refuse_stick, steadiness, touching_nodes
from ..options import Options
from .contacts_determined import refuse_undetermined_in
from .contacts_rigid import Elimination, eliminate
from .contacts_sampling import Values
from .contacts_steady import FRICTION, STIFFNESS, Contacts, contacts_of, steady_terms
from .factors import ParameterFactor, Product
from .family import FactoredPart, deviation, extrapolated, interpolated_terms
from .problem import NOT_KNOWN, Parameter, ParametricProblem

SAME = 1e-13  # rows of rigid contact, of their largest entry


@dataclass(frozen=True)
class ContactsProblem(ParametricProblem):
    """A parametric problem of a system with contacts.

    elimination: how rigid contact was taken out of it, which leaves fewer freedoms than the system has; None where
    there is none. notes: sentences on what its user should know; elsewhere: those of them on values at which other
    nodes touch, which nothing of the problem holds for. touching (m,): which of the contact nodes it holds. looked:
    says of points why it does not hold there, as `unlike` has it; None where nobody can solve for steady sliding, as
    in a model from a file.
    """

    elimination: Elimination | None = None
    notes: tuple[str, ...] = ()
    elsewhere: tuple[str, ...] = ()
    touching: BoolArray | None = None
    looked: Callable[[Sequence[Values]], tuple[str, ...]] | None = field(default=None, compare=False, repr=False)

    def unlike(self, points: Sequence[Mapping[str, float]]) -> tuple[str, ...]:
        """Of each point, in the box or not, words on why the problem does not hold there: others touch in steady
        sliding than the nodes that are held, they slide in another way, or its matrices are others outside the box; or
        on that this is not known. "" where it holds."""
        full = [self.point(values) for values in points]
        if self.looked is not None:
            return self.looked(full)
        if self.touching is None:
            return ("",) * len(full)
        # Of the box `elsewhere` tells, which was looked at when the model was made.
        return tuple("" if self.inside(values) else NOT_KNOWN for values in full)

    @property
    def idle_words(self) -> tuple[str, ...]:
        """A sentence for each parameter without effect, or with none but on which nodes touch, which are held."""
        if not self.elsewhere:
            return super().idle_words
        return tuple(f"{name} changes at most which nodes touch: no matrix depends on it" for name in self.idle)

    def displacements(self, vectors: Any) -> Any:
        """Right vectors (size, k) of this problem as displacements (n, k) of the system."""
        return vectors if self.elimination is None else self.elimination.motion @ vectors

    def left_displacements(self, vectors: Any, values: Mapping[str, float]) -> Any:
        """Left vectors (size, k) at values of the parameters as left vectors (n, k) of the system."""
        return vectors if self.elimination is None else self.elimination.tests(self.point(values)) @ vectors


@dataclass(frozen=True)
class ParametricSystems:
    """Systems that depend on parameters.

    own: the one whose steady sliding says which nodes touch. system_at: the system at values of the parameters.
    structure_at: the pieces of its mass, damping and stiffness, contacts not included, for values of those parameters
    that are to be ``interpolated`` over.
    """

    own: System
    system_at: Callable[[Values], System]
    structure_at: Callable[[Values], Mapping[str, FactoredPart]]
    parameters: tuple[Parameter, ...]
    interpolated: tuple[Parameter, ...] = ()


def contacts_problem(
    family: ParametricSystems, *, touching_at: float | None = None, options: Options | None = None
) -> ContactsProblem:
    """The problem over all parameters of a family, in its contacts too.

    touching_at: μ of the steady sliding that says which nodes touch (None: the laws' own). Raises CaseError where only
    rigid contact is there to have its stiffness varied, where rigid contacts change their friction by other than μ,
    and where a parameter changes who can touch; AnalysisError where there is no steady sliding, where rigid contact is
    given twice or friction jams, and where something does not depend on a parameter smoothly enough.
    """
    options, given = options or Options(), family
    if any(p.name == FRICTION for p in given.parameters):
        # Contacts that stay without friction are told by that nothing slides them.
        def sliding_at(values: Values) -> System:
            return given.system_at(values).without_idle_slip()

        family = replace(given, system_at=sliding_at)
    nodes = family.own.contact_nodes()
    if not nodes.count:
        return _without_contacts(family, nodes, options)
    refuse_stick(family.own, "reduced models over parameters")
    if nodes.kept.any():
        raise NotReducibleError(
            "reduced models over parameters do not take contacts that are kept closed; leave out closed = true, or "
            "take modes and onsets of the full problem", "contacts that are kept closed (contacts.NAME.closed)",
        )  # fmt: skip
    steady = touching_nodes(family.own, nodes, touching_at, options.solver)
    touching = np.flatnonzero(steady.active)
    if np.any(nodes.cubic[touching] > 0):
        lacks = "contact stiffness that depends on the force (contacts.NAME.cubic)"
        raise NotReducibleError(
            "reduced models over parameters: contact stiffness is taken as constant, and contacts.NAME.cubic makes it "
            "depend on the force; `stridor modes`, `onsets` over μ and `simulate` take that", lacks,
        )  # fmt: skip
    layer = contact_rows(nodes, touching, steady.sense, steady.stuck)
    effects = steadiness(family.own, nodes, touching, options, layer)
    _refuse_stretched(effects)
    names = [p.name for p in family.parameters]
    rigid = nodes.compliance[touching] == 0.0
    if STIFFNESS in names and bool(rigid.all()):
        accepted = "every contact is rigid, and rigid contact has no stiffness to vary; give contacts a stiffness"
        raise CaseError(f"box.{STIFFNESS}", None, accepted)

    def contacts_at(values: Values) -> Contacts:
        system = family.system_at(values)
        if system.contact_nodes().count != nodes.count or system.size != family.own.size:
            changed = ", ".join(p.name for p in family.interpolated)
            raise CaseError("box", changed, "changes who is in contact; give numbers that do not")
        return contacts_of(system, touching)

    def pieces_at(values: Values) -> Mapping[str, FactoredPart]:
        return {**family.structure_at(values), **_springs(contacts_at(values), varied=FRICTION in names)}

    rows = _rigid_rows(family, contacts_at, rigid) if rigid.any() else None
    terms = interpolated_terms(pieces_at, family.interpolated)
    notes: tuple[str, ...] = ()
    if not effects.neutral:
        more, notes = steady_terms(family.system_at, family.parameters, touching, effects)
        terms = (*terms, *more)
    elimination = None
    if rows is not None:
        normal, slide, friction, own = rows
        elimination = eliminate(normal, slide, 1.0 if friction is None else friction)
        refuse_undetermined_in(terms, family.parameters, (normal, slide), friction, own, options.solver)
        terms = elimination.applied(terms)
    return ContactsProblem(terms, family.parameters, elimination, notes, notes, steady.active)


def _without_contacts(family: ParametricSystems, nodes: ContactNodes, options: Options) -> ContactsProblem:
    """The problem of a structure on its own: loads still stress it."""
    nobody = np.zeros(0, dtype=np.int64)
    none = np.zeros(nodes.count, dtype=bool)
    layer = contact_rows(nodes, nobody, np.zeros((nodes.count, nodes.directions)), none)
    effects = steadiness(family.own, nodes, nobody, options, layer)
    _refuse_stretched(effects)
    terms, notes = interpolated_terms(family.structure_at, family.interpolated), tuple[str, ...]()
    if not effects.neutral:
        refuse_stick(family.own, "reduced models over parameters")
        more, notes = steady_terms(family.system_at, family.parameters, nobody, effects)
        terms = (*terms, *more)
    return ContactsProblem(terms, family.parameters, None, notes, notes)


def _refuse_stretched(effects: Steadiness) -> None:
    """Raise NotReducibleError where what the steady state stretches springs by changes their stiffness."""
    if effects.stretches:
        lacks = "springs whose stiffness depends on how far steady sliding stretches them (springs.NAME.cubic)"
        raise NotReducibleError(
            "reduced models over parameters: springs are taken as linear, and springs.NAME.cubic makes their stiffness "
            "depend on how far steady sliding stretches them; `stridor modes`, `onsets` over μ and `simulate` take "
            "that", lacks,
        )  # fmt: skip


def deviates(family: ParametricSystems, touching: IntArray, values: Values) -> float:
    """How far, relative to the largest entry, the matrices that a problem over a family has at values outside its box
    are from those of the system there; what steady sliding adds is not looked at."""
    varied = any(p.name == FRICTION for p in family.parameters)

    def pieces_at(at: Values) -> Mapping[str, FactoredPart]:
        contacts = contacts_of(family.system_at(at), touching)
        return {**family.structure_at(at), **_springs(contacts, varied=varied)}

    return extrapolated(pieces_at, family.interpolated, values)


def _springs(contacts: Contacts, *, varied: bool) -> dict[str, FactoredPart]:
    """Stiffness and friction of contact springs, with factors of contact stiffness and, where it is varied, of μ."""
    soft = contacts.compliance > 0
    if not soft.any():
        return {}
    rows = sp.csr_array(sp.diags_array(1.0 / contacts.compliance[soft]) @ contacts.normal[soft])
    slide = contacts.pushing if varied else _own_slide(contacts)
    friction = sp.csr_array(slide[soft].T @ rows)
    stiffness: ParameterFactor = Product(((STIFFNESS, 1.0),))
    by_friction: ParameterFactor = Product(((STIFFNESS, 1.0), (FRICTION, 1.0)))
    if not varied:
        by_friction = stiffness
    return {
        "contact": FactoredPart(sp.csr_array(contacts.normal[soft].T @ rows), "stiffness", stiffness),
        "friction": FactoredPart(friction, "stiffness", by_friction),
    }


def _own_slide(contacts: Contacts) -> Sparse:
    """μS (m, n) with each node's own coefficient."""
    return sp.csr_array(sp.diags_array(contacts.coefficient[contacts.touching]) @ contacts.slide)


def _rigid_rows(
    family: ParametricSystems, contacts_at: Callable[[Values], Contacts], rigid: BoolArray
) -> tuple[Sparse, Sparse, Parameter | None, float | None]:
    """Rows of gap and slip (m, n) of rigid contacts, the same for all values of the parameters, and the friction
    coefficient as a parameter; where it is none each contact's own is in its slip, and the last is that of all, None
    where they differ. Raises CaseError where rows are not the same."""
    reference = {p.name: p.value for p in family.interpolated}
    own = contacts_at(reference)
    friction = next((p for p in family.parameters if p.name == FRICTION), None)
    for p in family.interpolated:
        for value in (p.low, p.low + 0.37 * (p.high - p.low), p.high):
            other = contacts_at({**reference, p.name: value})
            same = np.array_equal(other.compliance == 0.0, own.compliance == 0.0)
            # Without μ as a parameter what each node has of its contact's coefficient is judged with that, below.
            slides = (own.slide, other.slide) if friction is None else (own.pushing, other.pushing)
            for one, two in ((own.normal, other.normal), slides):
                same = same and deviation(one[rigid], two[rigid]) <= SAME
            if not same:
                accepted = (
                    "moves where rigid contact touches, the direction of its slip, or what its nodes have of μ by "
                    "their slip speeds; give numbers that do not, or give the contact a stiffness"
                )
                raise CaseError(f"box.{p.name}", value, accepted)
            if friction is None and deviation(_own_slide(own)[rigid], _own_slide(other)[rigid]) > SAME:
                accepted = (
                    "friction of rigid contact is varied for all contacts together, by mu; take mu, or give the "
                    "contact a stiffness"
                )
                raise CaseError(f"box.{p.name}", value, accepted)
    if friction is not None:
        return own.normal[rigid], own.pushing[rigid], friction, None
    # Of rigid contacts that friction works on.
    rubs = own.coefficient[own.touching][rigid]
    rubs = rubs[rubs > 0.0]
    alike = float(rubs[0]) if len(rubs) and np.ptp(rubs) <= 1e-12 * rubs.max() else None
    return own.normal[rigid], _own_slide(own)[rigid], None, alike


def contact_parameters(
    system: System,
    friction: tuple[float, float],
    stiffness: tuple[float, float] | None = (0.5, 2.0),
    *,
    touching_at: float | None = None,
    options: Options | None = None,
) -> ContactsProblem:
    """The problem over ranges of μ and of the factor κ of all contact stiffnesses (None: κ = 1); its own values are the
    middle of the range of μ and κ = 1.

    touching_at: μ of the steady sliding that says which nodes touch (None: the laws' own). Raises CaseError for ranges
    that are none, and for a range of κ where contact is rigid; else as `contacts_problem`.
    """
    parameters = [friction_range(friction)]
    if stiffness is not None:
        parameters.append(stiffness_range(stiffness))
    pieces = {
        "mass": FactoredPart(system.mass, "mass"),
        "damping": FactoredPart(system.damping, "damping"),
        "stiffness": FactoredPart(system.stiffness, "stiffness"),
    }
    family = ParametricSystems(system, lambda _: system, lambda _: pieces, tuple(parameters))
    return contacts_problem(family, touching_at=touching_at, options=options)


def friction_range(between: tuple[float, float]) -> Parameter:
    """μ as a parameter. Raises CaseError for negative ones."""
    low, high = (float(v) for v in between)
    if not low >= 0:
        raise CaseError(f"box.{FRICTION}", between, "friction coefficients are ≥ 0")
    if between[1] > MOST_FRICTION:
        raise CaseError(f"box.{FRICTION}", between, TOO_MUCH)
    return Parameter(FRICTION, low, high, value=(low + high) / 2)


def stiffness_range(between: tuple[float, float]) -> Parameter:
    """The factor of all contact stiffnesses as a parameter. Raises CaseError where it is not positive."""
    low, high = (float(v) for v in between)
    if not low > 0:
        raise CaseError(f"box.{STIFFNESS}", between, "factors of the contact stiffness are > 0")
    return Parameter(STIFFNESS, low, high, value=1.0 if low <= 1.0 <= high else float(np.sqrt(low * high)))
