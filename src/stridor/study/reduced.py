"""A case and ranges of its numbers in, a reduced model out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..case import Case
from ..errors import CaseError
from ..system import System, build_system
from ..typing import Sparse

if TYPE_CHECKING:
    from ..modal.parametric import ParametricProblem, ReducedModel
    from ..modal.parametric.problem import Role


def reduced_model(
    case: Case,
    box: Mapping[str, tuple[float, float]],
    *,
    max_frequency_hz: float | None = None,
    bound: float = 1e-8,
) -> ReducedModel:
    """One factorisation's worth of work, then every mode for all values in the box in milliseconds.

    box: ranges by name: "mu" (of all contacts), "contact_stiffness" (a factor of all contact stiffnesses), or the path
    of any number of the case, as in an override ("materials.lining.young_modulus", "bodies.disc.damping.stiffness"), or
    one of [parameters] by its name. max_frequency_hz: modes up to there (default: modal.max_frequency_hz). bound:
    relative error of the eigenvalues. The nodes that touch are those of steady sliding in the case as it is.

    Raises CaseError for ranges and names that are none and for rigid contact; AnalysisError where matrices depend on a
    number in no simple way, or the bound is not reached.
    """
    from ..modal.parametric import reduce

    problem = parametric_problem(case, box)
    settings = case.modal
    limit = settings.max_frequency_hz if max_frequency_hz is None else max_frequency_hz
    return reduce(problem, limit, bound=bound, solver=None if settings.solver == "auto" else settings.solver)


def parametric_problem(case: Case, box: Mapping[str, tuple[float, float]]) -> ParametricProblem:
    """The matrices of a case as sums of terms in the numbers of a box, as `reduced_model` takes it."""
    from ..modal.assembled import Options
    from ..modal.parametric import Parameter, ParametricProblem
    from ..modal.parametric.contacts import FRICTION, STIFFNESS, contact_terms, friction_range, stiffness_range
    from ..modal.parametric.family import interpolated_terms

    if not box:
        raise CaseError("box", None, 'missing – give at least one range, such as {"mu": (0.0, 0.6)}')
    of_contacts, of_case = [], []
    for name, between in box.items():
        if len(between) != 2 or not np.all(np.isfinite(between)):
            raise CaseError(f"box.{name}", tuple(between), "a range of two numbers low < high")
        if name == FRICTION:
            of_contacts.append(friction_range(between))
        elif name == STIFFNESS:
            of_contacts.append(stiffness_range(between))
        else:
            low, high = (float(v) for v in between)
            own = case.parameters[name].value if name in case.parameters else (low + high) / 2
            of_case.append(Parameter(name, low, high, value=own if low <= own <= high else (low + high) / 2))
    system = build_system(case)
    if of_contacts and not system.contact_nodes().count:
        raise CaseError(f"box.{of_contacts[0].name}", None, "the case has no contacts; give a range of another number")

    def matrices_at(values: Mapping[str, float]) -> Mapping[Role, Sparse]:
        changes = {f"parameters.{k}.value" if k in case.parameters else k: v for k, v in values.items()}
        found = build_system(case.with_(changes)) if values else system
        if found.size != system.size:
            raise CaseError("box", ", ".join(values), "changes the number of freedoms; give numbers that do not")
        return {"mass": found.mass, "damping": found.damping, "stiffness": found.stiffness}

    terms = interpolated_terms(matrices_at, tuple(of_case))
    options = Options(friction_damping=case.modal.friction_damping, prestress=case.modal.prestress)
    contacts = contact_terms(system, mu=None, options=options) if _touches(system) else ()
    by_name = {p.name: p for p in (*of_contacts, *of_case)}
    return ParametricProblem((*terms, *contacts), tuple(by_name[name] for name in box))


def _touches(system: System) -> bool:
    return bool(system.contact_nodes().count)
