"""The temporal approach from a system and its phases to a trajectory."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from ..errors import CaseError
from ..interrupts import at_once
from ..stages import passing, stage
from ..system import System
from ..threads import one_thread
from .beta2 import StepLimit, step_limit
from .inputs import check_inputs
from .march import Checkpoint, March, Progress
from .observe import Observer
from .restart import settings_of_restart
from .schedule import PhaseSpec, lay_out
from .settings import ASKED, Settings, choose_step
from .stepper import Disturbance, Stepper
from .steppers.exact import exact_not_begun, exact_stepper, refuse, why_not_exact
from .steppers.implicit import COARSEST, implicit_stepper, whole_steps, why_not_implicit
from .steppers.implicit import refuse as refuse_implicit
from .steppers.modal import choose_path, modal_stepper, refuses
from .steppers.sparse import sparse_stepper, step_limit_assembled
from .steppers.starting import not_begun
from .trajectory import Trajectory

SMALL = 40  # freedoms up to which "auto" goes from event to event: there that is faster than steps, and exact
MANY = 8  # contact nodes from which on it takes implicit steps
COARSE = 0.01  # of the shortest period asked for: a step that is given and smaller is taken to be one of explicit steps

__all__ = ["Checkpoint", "Progress", "Settings", "plan", "simulate"]


@passing()
@one_thread
def simulate(
    system: System,
    phases: Sequence[PhaseSpec],
    settings: Settings | None = None,
    *,
    mu: float | None = None,
    progress: Progress | None = None,
    checkpoint: Checkpoint | None = None,
    checkpoint_seconds: float = 20.0,
    restart: Trajectory | None = None,
    join: bool = True,
    changed: bool = False,
    disturbance: Disturbance | None = None,
    observe: Observer | None = None,
) -> Trajectory:
    """March through the phases.

    mu scales every contact's friction law. progress(done, planned) is called between chunks, checkpoint
    with the trajectory so far at most every checkpoint_seconds. restart goes on from a trajectory of the
    same system and settings, to the last digit as if it had not been cut, with its step where the settings give
    none (``join`` False returns the new part alone; ``changed`` takes another system of the same freedoms and
    contacts as well). disturbance (u, v, a) is added to the initial state, observe looks on between steps. Ctrl-C
    ends the run after the chunk of steps that is under way and keeps what was computed (``interrupted``); so does
    KeyboardInterrupt from progress or checkpoint. Raises CaseError for a step beyond the limit, a system that its
    path does not take and a restart that does not fit, AnalysisError where motion blows up or a slave leaves its
    master; what was computed is then in the error's ``trajectory``.
    """
    stage("time loop; the first one of a version is compiled for up to a minute")
    with at_once():  # nothing is computed yet
        settings = settings_of_restart(settings or Settings(), restart)
        system = settings.system(system)
        check_inputs(
            system,
            phases,
            step=settings.step,
            beta2=settings.beta2,
            record_every=settings.record_every,
            watch=settings.watch,
        )
        settings, why = _chosen(system, settings, phases, restart)
        if settings.stepper == "implicit":
            settings = replace(settings, step=whole_steps(settings, phases))
        with _saying(settings, why):
            stepper = stepper_for(system, settings, mu, why)
        motion = system.motion
        schedule = lay_out(phases, stepper.scheme.step, list(system.loads), list(motion.names), motion.full_distance)
        schedule.require_whole(phases, even=settings.stepper in ("exact", "implicit"))
        if settings.initial == "steady-sliding":
            schedule = schedule.from_steady()
        march = March(stepper, schedule, settings, join=join, observe=observe)
        if restart is None:
            stepper.begin(schedule, settings, disturbance)
        else:
            march.resume(restart, changed=changed)
    return march.run(progress, checkpoint, checkpoint_seconds)


def plan(system: System, settings: Settings, phases: Sequence[PhaseSpec] = ()) -> tuple[str, str, StepLimit]:
    """How a system would be marched, through phases where these are given: path, why it is taken, and the limit of the
    step. Raises CaseError where the stepper that is asked for does not take it."""
    system = settings.system(system)
    settings, why = _chosen(system, settings, phases)
    if settings.stepper == "exact":
        refuse(system, settings.cutoff_hz)
        return "exact", why, step_limit(system, 0.5)
    if settings.stepper == "implicit":
        refuse_implicit(system, settings)
        step = whole_steps(settings, phases)
        return "implicit", why, StepLimit(step, 2 * np.pi / step, "the highest frequency asked for", 1.0)
    if sparse := _why_sparse(system, settings):
        return "assembled", _joined(sparse, why), step_limit_assembled(system, settings.beta2)
    modes, reason = choose_path(system, settings)
    return "modal" if modes else "nodal", _joined(reason, why), step_limit(system, settings.beta2)


def step_of(system: System, settings: Settings, phases: Sequence[PhaseSpec]) -> float:
    """The step [s] that phases would be marched with. Raises CaseError for one that the stepper does not take."""
    path, _, limit = plan(system, settings, phases)
    with _saying(*_chosen(settings.system(system), settings, phases)):
        return choose_step(limit, settings, path)


@contextmanager
def _saying(settings: Settings, why: str) -> Generator[None]:
    """Say with a step that is refused why "auto" has come to explicit ones (`_chosen`)."""
    try:
        yield
    except CaseError as error:
        where, given, accepted = error.args
        if settings.stepper != "explicit" or where != "temporal.step" or not why:
            raise
        accepted += f'; temporal.stepper = "auto" comes to explicit steps: {why}'
        raise CaseError(where, given, accepted) from None


def comes_to(system: System, settings: Settings, phases: Sequence[PhaseSpec] = ()) -> tuple[str, str]:
    """The stepper that settings come to, through phases where these are given, and why: "auto" is another one for each
    system."""
    chosen, why = _chosen(settings.system(system), settings, phases)
    return chosen.stepper, why


def _joined(*reasons: str) -> str:
    return "; ".join(reason for reason in reasons if reason)


def _chosen(
    system: System, settings: Settings, phases: Sequence[PhaseSpec], restart: Trajectory | None = None
) -> tuple[Settings, str]:
    """Settings with the stepper that "auto" comes to, and why: of explicit steps only where phases, if there are any,
    keep it from others. A run that is gone on from keeps its own."""
    if settings.stepper != "auto":
        return settings, ASKED if settings.stepper in ("exact", "implicit") else ""
    if restart is not None:
        before = replace(settings, stepper=restart.path if restart.path in ("exact", "implicit") else "explicit")
        usual, why = _suiting(system, settings)
        return before, why if usual.stepper == before.stepper else "as in the run that it goes on from"
    chosen, why = _suiting(system, settings)
    if not phases or chosen.stepper == "explicit":
        return chosen, why
    if chosen.stepper == "exact":
        not_so = exact_not_begun(system, chosen, phases)
    else:
        not_so = not_begun(system, replace(chosen, step=whole_steps(settings, phases)), phases)
    if not_so:
        return replace(settings, stepper="explicit"), f"{chosen.stepper} steps do not begin so: {not_so}"
    return chosen, why


def _suiting(system: System, settings: Settings) -> tuple[Settings, str]:
    """Settings with the stepper that suits a system, whatever its phases, and why."""
    usual = settings.path == "auto" and settings.beta2 == 0.5
    if usual and system.size <= SMALL and not why_not_exact(system):
        return replace(settings, stepper="exact"), f"{system.size} freedoms, up to {SMALL} are few"
    cutoff = settings.cutoff_hz
    if usual and cutoff is not None and not why_not_exact(system, cutoff):
        return replace(settings, stepper="exact"), f"temporal.cutoff_hz gives modes up to {cutoff:g} Hz, which it takes"
    count, highest = system.contact_nodes().count, settings.max_frequency_hz
    resolved = highest is not None and (settings.step is None or COARSE < settings.step * highest <= COARSEST)
    if usual and resolved and count >= MANY and not why_not_implicit(system, settings):
        why = f"{count} contact nodes, from {MANY} on steps that resolve {settings.max_frequency_hz:g} Hz are cheaper"
        return replace(settings, stepper="implicit"), why
    return replace(settings, stepper="explicit"), ""


def stepper_for(system: System, settings: Settings, mu: float | None, why: str = "") -> Stepper:
    """The method of time stepping that suits a system, or the one that the settings ask for; ``why`` it came to that
    (`_chosen`)."""
    if settings.stepper == "exact":
        return exact_stepper(system, settings, mu, why or ASKED)
    if settings.stepper == "implicit":
        return implicit_stepper(system, settings, mu, why or ASKED)
    if sparse := _why_sparse(system, settings):
        return sparse_stepper(system, settings, mu, _joined(sparse, why))
    modes, reason = choose_path(system, settings)
    if modes is None:
        return sparse_stepper(system, settings, mu, _joined(reason, why), path="nodal")
    return modal_stepper(system, settings, mu, modes, _joined(reason, why))


def _why_sparse(system: System, settings: Settings) -> str:
    """Why a system is marched on assembled matrices, "" where the stepper on few point contacts takes it."""
    if why := refuses(system):
        return f"{why}: assembled matrices with lumped mass"
    return ASKED if settings.path == "assembled" else ""
