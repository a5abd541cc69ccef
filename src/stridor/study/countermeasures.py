"""Which change quietens a squeal best: mass, damping, stiffness, contact, ranked by growth removed, then verified."""

from __future__ import annotations

import time
from collections.abc import Sequence
from operator import index
from typing import Any, Literal, get_args

import numpy as np

from ..asking import NUMBER, SWITCH, SWITCH_OR_NONE, takes
from ..case import Case
from ..case.bodies import BeamBody, SolidBody
from ..case.matrix_checks import MU
from ..errors import AnalysisError, CaseError
from ..modal.krylov.steady import refuse_stick
from ..notebook import counted
from ..system.imported import ImportedTerm, load_terms
from .asked import names_of, require_choice, require_count, require_frequency
from .measure_ranking import Ranking, edges_of
from .measure_verification import verified
from .measures import Countermeasures, Measure, Target, Verified
from .provenance import provenance
from .sensitivities import Linearised, numbers_of
from .workspace import Problem, Workspace

WHOLE = 0.5  # of all freedoms: a matrix that reaches over more is that of the whole model

Watch = Literal["all", "unstable"]

__all__ = ["Countermeasures", "Measure", "Verified", "rank_countermeasures"]


@takes(added_mass=SWITCH, percent=NUMBER, margin=NUMBER, damped=SWITCH_OR_NONE)
def rank_countermeasures(
    problem: Problem,
    *,
    mu: float | None = None,
    target: Target = "sum",
    numbers: str | Sequence[str] | None = None,
    added_mass: bool = True,
    chamfers: int = 2,
    percent: float = 5.0,
    margin: float = 1e-3,
    verify: int = 3,
    count: int | None = None,
    max_frequency_hz: float | None = None,
    damped: bool | None = None,
    watch: Watch = "all",
) -> Countermeasures:
    """Rank changes of a case by the growth rate that they take away per per cent of change.

    target: the number of an unstable branch, or "sum" of all unstable ones. numbers: paths to try (default: moduli and
    densities of all materials, the damping that bodies have, contact stiffnesses, of imported matrices their factors,
    but for whole masses and stiffnesses, and the parameters in them). added_mass: a point mass at the best node of each
    body. chamfers: how many rows of contact nodes are taken away at most, at the leading edge (which meets the other
    body's material first) and at the trailing one. percent: change that consequences are predicted for; margin: damping
    ratio. The best ``verify`` are solved again with that change made; they come first, by what they took per per cent
    then. What took nothing is left out with a sentence, as is what changes growth by rounding only. watch: "unstable"
    does not look after the stable modes, which saves a factorisation for each.

    Predictions are of first order; a pair of modes near its exceptional point is predicted by its mean and squared
    half difference, which go through it smoothly. Touching nodes are held in predictions, solved for anew in
    verifications. Raises CaseError for a target that is not unstable and for a change that is not between 0 and 100 %.
    """
    started = time.perf_counter()
    if not 0.0 < percent < 100.0:
        raise CaseError("percent", percent, "a size of change between 0 and 100 %")
    if not 0.0 <= margin < 1.0:
        raise CaseError("margin", margin, "a damping ratio, at least 0 and below 1")
    require_count(verify, "verify", least=0)
    require_count(chamfers, "chamfers", least=0)
    require_frequency(max_frequency_hz)
    require_choice(watch, "watch", get_args(Watch))
    target = _target(target)
    work = Workspace.of(problem)
    case = work.case("the ranking of countermeasures")
    refuse_stick(work.system(mu), "the ranking of countermeasures")
    linear = Linearised.of(
        work, mu, count=count, max_frequency_hz=max_frequency_hz, damped=damped, hand_on=verify > 0
    )
    unstable = linear.columns("unstable")
    if not unstable:
        told = (*linear.warnings, f"no mode is unstable at μ = {linear.mu:g}: there is nothing to remove")
        empty = np.zeros(0)
        source = provenance(work, "countermeasures", time.perf_counter() - started, mu=linear.mu)
        return Countermeasures(linear.mu, target, empty.astype(np.int64), empty + 0j, (), margin, told, source)
    if target != "sum" and target not in linear.modes.branch[unstable]:
        branches = ", ".join(str(b) for b in linear.modes.branch[unstable])
        raise CaseError("target", target, f"not an unstable branch, {branches}; without one all of these together")
    band = linear.columns("all") if watch == "all" else unstable
    edges = edges_of(linear, chamfers) if chamfers else []
    groups = [edge.nodes for edge in edges]
    ranking = Ranking(linear, [b for b in band if linear.mode(b, groups) is not None], target, percent, margin)
    if not ranking.aimed.any():
        what = "the unstable modes have" if target == "sum" else f"mode {target} has"
        told = (*linear.warnings, f"{what} no derivatives, and changes are ranked by them: nothing is ranked")
        source = provenance(work, "countermeasures", time.perf_counter() - started, mu=linear.mu)
        columns = linear.modes.branch[ranking.columns]
        return Countermeasures(linear.mu, target, columns, ranking.eigenvalues, (), margin, told, source)
    left = whole_matrices(case, linear.mu) if numbers is None else []
    asked = default_numbers(case, left) if numbers is None else names_of(numbers, "numbers", none=True)
    found = ranking.numbers(numbers_of(case, asked))
    if added_mass:
        found += ranking.masses()
    if edges:
        found += ranking.chamfers(edges)
    acting = [m for m in found if abs(m.removed_per_percent) > ranking.rounding]
    helping = sorted((m for m in acting if m.removed_per_percent > 0), key=lambda m: -m.removed_per_percent)
    told = [] if helping else [_none_helps(case, len(found), left)]
    if helping and len(acting) < len(found):
        told.append(f"{counted(len(found) - len(acting), 'change')} tried: no effect on the growth beyond rounding")
    told += [_left_out(left)] if left else []
    checked, left_over, lost = _solved_again(ranking, helping, verify, count, max_frequency_hz)
    told += lost
    worse = [m for m in checked if _taken(m) <= 0]
    if worse:
        names = "; ".join(f"{m.words} ({_taken(m):.4g} 1/s)" for m in worse)
        told.append(
            f"{counted(len(worse), 'change')} that the slopes promise {'does' if len(worse) == 1 else 'do'} not take "
            f"growth away when solved again, and {'is' if len(worse) == 1 else 'are'} left out: {names}"
        )
    checked = sorted((m for m in checked if _taken(m) > 0), key=lambda m: -_taken(m) / m.percent)
    return Countermeasures(
        linear.mu,
        target,
        linear.modes.branch[ranking.columns],
        ranking.eigenvalues,
        (*checked, *left_over),
        margin,
        (*linear.warnings, *told),
        provenance(work, "countermeasures", time.perf_counter() - started, mu=linear.mu),
    )


def _target(given: Any) -> Target:
    """The number of a branch, in digits as well, or "sum". Raises CaseError for anything else."""
    if isinstance(given, str) and given == "sum":
        return "sum"
    try:
        number = int(given) if isinstance(given, str) else index(given)
    except (TypeError, ValueError):
        number = 0
    if number < 1 or isinstance(given, bool):
        raise CaseError("target", given, 'the number of an unstable branch, or "sum" of all of them')
    return number


def _taken(measure: Measure) -> float:
    """Growth rate that a measure took from the target when it was solved again."""
    assert measure.verified is not None, "asked of those solved again"
    return measure.verified.removed


def _solved_again(
    ranking: Ranking, helping: list[Measure], verify: int, count: int | None, max_frequency_hz: float | None
) -> tuple[list[Measure], list[Measure], list[str]]:
    """The first ``verify`` measures with which there is an answer, solved again; the others; sentences about those that
    are left out because there is none."""
    checked: list[Measure] = []
    told: list[str] = []
    rest = list(helping)
    while rest and len(checked) < verify:
        measure = rest.pop(0)
        try:
            checked.append(verified(ranking, measure, count, max_frequency_hz))
        except (AnalysisError, CaseError) as error:
            told.append(f"{measure.words}: left out, since with that change {error}")
    return checked, rest, told


def default_numbers(case: Case, left: Sequence[str]) -> list[str]:
    """Paths of the numbers that changes are tried on: of materials, damping, springs, dashpots, factors but for those
    left out, contact stiffnesses."""
    used = dict.fromkeys(getattr(body, "material", None) for body in case.bodies.values())
    paths = [f"materials.{m}.{n}" for m in used if m in case.materials for n in ("young_modulus", "density")]
    for name, body in case.bodies.items():
        if isinstance(body, BeamBody | SolidBody):
            paths += [f"bodies.{name}.damping.{n}" for n in ("mass", "stiffness") if getattr(body.damping, n) > 0]
    paths += [f"springs.{name}.stiffness" for name, spring in case.springs.items() if spring.stiffness]
    paths += [f"dashpots.{name}.damping" for name in case.dashpots]
    paths += [path for path in _factors(case) if path not in left]
    # Friction is what makes it squeal, and no change of the structure.
    paths += [f"parameters.{name}.value" for name in case.parameters if name in case.factor_names and name != MU]
    return paths + [f"contacts.{name}.stiffness" for name, c in case.contacts.items() if c.stiffness != "rigid"]


def whole_matrices(case: Case, mu: float | None = None) -> list[str]:
    """Paths of factors of imported masses and stiffnesses that reach over most freedoms: nobody builds a brake with all
    its stiffness or mass raised, while dampings, springs and added masses are changed. mu: where factors have it."""
    found: list[str] = []
    for name, body in case.imported.items():
        shares = load_terms(case, name, body, mu).shares
        found += [
            f"bodies.{name}.terms.{k}.factor"
            for k, share in enumerate(shares)
            if share.role != "damping" and _reach(share) > WHOLE
        ]
    return [path for path in _factors(case) if path in found]


def _factors(case: Case) -> list[str]:
    """Paths of the factors of imported matrices that are numbers."""
    return [
        f"bodies.{name}.terms.{k}.factor"
        for name, body in case.imported.items()
        for k, term in enumerate(body.terms)
        if not isinstance(term.factor, str)
    ]


def _reach(share: ImportedTerm) -> float:
    """The fraction of all rows that hold anything."""
    rows = share.matrix.tocoo()
    return len(np.unique(rows.row[rows.data != 0])) / max(share.matrix.shape[0], 1)


def _left_out(paths: Sequence[str]) -> str:
    return (
        f"not tried, for nobody can build it: all of a mass or stiffness matrix ({', '.join(paths)}); --parameter PATH "
        "or numbers= asks for one"
    )


def _none_helps(case: Case, tried: int, left: Sequence[str]) -> str:
    """What is said where something grows and no change takes any of it away."""
    if left and not tried:
        return "there is nothing to change but whole matrices: no damping, spring, added mass or parameter of the case"
    if tried:
        return f"none of {tried} changes tried takes growth away"
    why = ": factors of imported matrices that are numbers, or parameters in them, would be" if case.imported else ""
    return f"there is nothing to change{why}"
