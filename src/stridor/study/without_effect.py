"""Settings that a case gives and that change nothing on the path its analyses take: told, one line each.

- modal.solver, --solver: beams in point contacts, whose modes are dense unless modal.source says otherwise
- modal.source: `steady`, `boundary`, `reduce`, `simulate`
- modal.friction_damping: but for contact over nodes in space; `compare`, which has it as the time loop has
- modal.prestress: but for assembled matrices with meshed solids; `compare`, `simulate`
- modal.damped = false: `simulate`, `compare`
- temporal.path: assembled matrices in time; with temporal.beta2: stepper = "exact" or "implicit"
- temporal.cutoff_hz: unless stepper is "exact" or comes to it
- comparison.bracket, comparison.tolerance: without critical friction
- bodies.NAME.initial_velocity, initial_displacement: from steady sliding
- temporal.contact = "rigid": where every contact is rigid; where it acts, contacts.NAME.stiffness on `simulate`
- materials.NAME.poisson_ratio: of beams only

A setting that stays at its default is not told of, nor one of an approach that the verb does not take.
"""

from __future__ import annotations

from collections.abc import Iterator

from ..case import Case
from ..case.bodies import SolidBody
from ..system.pairs import is_point_on_line
from .settings import phases_of, settings_of
from .workspace import Workspace

IN_TIME = ("simulate", "compare", "run")
MODAL = (
    "steady", "modes", "shapes", "onsets", "run", "sensitivities", "countermeasures", "damping-map", "boundary",
    "reduce", "report",
)


def without_effect(problem: Case | Workspace, verb: str, *, solver: str | None = None) -> list[str]:
    """A line for each setting of the case, or ``--solver``, that changes no number of what a verb computes.

    Builds the model only where such a setting is given and the case alone does not tell the path, which is so for small
    models without contact over surfaces. Raises what building it raises.
    """
    if verb not in (*IN_TIME, *MODAL):
        return []
    work = Workspace.of(problem)
    case = work.case(verb)
    # By the case alone where that is enough.
    lines = [*_of_materials(case), *_of_comparison(case, verb), *_of_start(case, verb)]
    if _given(case, solver):
        few = _of_few_points(work, case)
        lines += [*_of_modes(case, verb, solver, few=few), *_of_time(work, case, verb, few=few)]
    return lines


def _of_few_points(work: Workspace, case: Case) -> bool:
    """Whether it is a structure with a few point contacts on a complete basis, in both approaches."""
    # Contact over a surface never is, which the case tells without a model.
    if not case.imported and any(not is_point_on_line(case, contact) for contact in case.contacts.values()):
        return False
    if work.varies:
        return False
    from ..modal.source import by_receptance  # all of the modal approach, which `check` has no need of

    return by_receptance(work.system(), work.options)


def _given(case: Case, solver: str | None) -> bool:
    modal = case.modal
    return (
        solver is not None
        or modal.solver != "auto"
        or modal.source != "auto"
        or modal.friction_damping
        or modal.prestress
        or not modal.damped
        or case.temporal.path != "auto"
        or case.temporal.contact != "as given"
        or case.temporal.stepper != "explicit"
        or case.temporal.cutoff_hz is not None
    )


def _of_materials(case: Case) -> Iterator[str]:
    used = {getattr(body, "material", None) for name, body in case.bodies.items() if name not in case.beams}
    for name, material in case.materials.items():
        if material.poisson_ratio != 0.3 and name not in used:
            yield f"materials.{name}.poisson_ratio has no effect: only beams are made of it, and they do not use it"


def _of_comparison(case: Case, verb: str) -> Iterator[str]:
    if verb in ("compare", "run") and not case.comparison.critical:
        for key in sorted({"bracket", "tolerance"} & case.comparison.model_fields_set):
            yield f"comparison.{key} has no effect while comparison.critical is false"


def _of_start(case: Case, verb: str) -> Iterator[str]:
    if verb in ("simulate", "run") and case.temporal.initial == "steady-sliding":
        for name, body in case.bodies.items():
            for key in ("initial_velocity", "initial_displacement"):
                if getattr(body, key, None) is not None:
                    yield f"bodies.{name}.{key} has no effect: the run starts from steady sliding (temporal.initial)"


def _of_modes(case: Case, verb: str, solver: str | None, *, few: bool) -> Iterator[str]:
    dense = few and case.modal.source in ("auto", "receptance")
    if dense and (solver is not None or case.modal.solver != "auto"):
        what = "modal.solver" if solver is None else "--solver"
        yield f"{what} has no effect: beams in point contacts are solved by dense methods"
    if case.modal.source != "auto" and verb in ("steady", "boundary", "reduce", "simulate"):
        yield f"modal.source has no effect on {verb}: it acts on modes and onsets"
    if case.modal.friction_damping and verb != "simulate":
        if few or case.dimension < 3:
            yield "modal.friction_damping has no effect: friction turns with the slip in space only, over nodes"
        elif verb == "compare":
            yield "modal.friction_damping has no effect here: compare takes the modes as the time loop is, with it"
    if case.modal.prestress:
        if verb in ("compare", "simulate"):
            yield f"modal.prestress has no effect on {verb}: the time loop has no geometric stiffness"
        elif not any(isinstance(body, SolidBody) for body in case.bodies.values()):
            yield "modal.prestress has no effect: only meshed solids have it"
        elif verb == "run":
            yield "modal.prestress acts on modes and onsets only: the time loop and the comparison are without it"
    if not case.modal.damped and verb in ("compare", "simulate"):
        yield f"modal.damped = false has no effect on {verb}: what is marched in time keeps its damping"
    elif not case.modal.damped and verb == "run":
        yield "modal.damped = false acts on modes and onsets only: the time loop and the comparison keep the damping"


def _of_time(work: Workspace, case: Case, verb: str, *, few: bool) -> Iterator[str]:
    if verb not in IN_TIME:
        return
    if case.temporal.cutoff_hz is not None and case.temporal.stepper in ("explicit", "implicit"):
        yield f'temporal.cutoff_hz has no effect: temporal.stepper = "{case.temporal.stepper}" takes no such modes'
    elif case.temporal.cutoff_hz is not None and case.temporal.stepper == "auto":
        from ..temporal.simulate import comes_to

        chosen, why = comes_to(work.system(), settings_of(work), phases_of(work))
        if chosen != "exact":
            said = 'temporal.cutoff_hz has no effect: temporal.stepper = "auto" comes to'
            yield f"{said} {chosen} steps here{f' ({why})' if why else ''}"
    if case.temporal.stepper in ("exact", "implicit"):
        why = "takes no steps" if case.temporal.stepper == "exact" else "has a scheme of its own"
        for key, usual in (("path", "auto"), ("beta2", 0.5)):
            if getattr(case.temporal, key) != usual:
                yield f'temporal.{key} has no effect: temporal.stepper = "{case.temporal.stepper}" {why}'
    elif not few and case.temporal.path not in ("auto", "assembled"):
        yield f"temporal.path = {case.temporal.path!r} has no effect: assembled matrices have one path"
    if case.temporal.contact == "rigid":
        springs = [name for name, contact in case.contacts.items() if contact.stiffness != "rigid"]
        if not springs:
            yield 'temporal.contact = "rigid" has no effect: no contact has a stiffness'
        elif verb == "simulate":
            for name in springs:
                yield f'contacts.{name}.stiffness has no effect in time: temporal.contact = "rigid"'
