"""What a run is given, checked before it starts: every problem at once, each with what is accepted."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import scipy.sparse as sp

from ..errors import CaseError, Problem
from ..matrices.report import negative_mass, no_mass
from ..system import System
from ..system.imported import is_symmetric
from .schedule import PhaseSpec

DIAGONAL = 1e-14  # of the largest mass: what beside the diagonal is rounding


def unfit_in_time(system: System) -> str:
    """Why the time loop does not take a system for its unsymmetric matrices, "" where it does."""
    if system.symmetric_definite:
        return ""
    mass = sp.csr_array(system.mass)
    diagonal = mass.diagonal()
    off = sp.csr_array(mass - sp.diags_array(diagonal))
    if off.nnz and float(np.abs(off.data).max()) > DIAGONAL * float(np.abs(diagonal).max()):
        if not is_symmetric(mass):
            return "the mass matrix is not symmetric, and the time loop needs a diagonal one"
        return (
            "the mass matrix is not diagonal, and beside unsymmetric matrices the time loop needs that; import a "
            "lumped mass matrix"
        )
    if negative := negative_mass(mass):
        return f"{negative}, and the time loop needs a positive one at each"
    if without := no_mass(mass):
        return f"{without}, and the time loop needs one at each"
    carried = _carried(system)
    if carried:
        return (
            f"support {carried} moves matrices that are not symmetric, and the time loop takes such supports only "
            "under symmetric ones; let the material slide through its mesh instead (sliding)"
        )
    return ""


def _carried(system: System) -> str:
    """A support whose motion or distance moves a part of the structure with unsymmetric matrices, "" for none."""
    for part in system.components:
        moved = np.any(system.motion.lift[part] != 0.0, axis=0)
        own = (sp.csr_array(m)[part][:, part] for m in (system.stiffness, system.damping))
        if np.any(moved) and not all(is_symmetric(matrix) for matrix in own):
            return system.motion.names[int(np.flatnonzero(moved)[0])]
    return ""


def check_inputs(
    system: System,
    phases: Sequence[PhaseSpec],
    *,
    step: float | None,
    beta2: float,
    record_every: int,
    watch: Sequence[str],
) -> None:
    """Raise CaseError with every problem found."""
    problems = [
        *_settings(step, beta2, record_every),
        *_watch(system, watch),
        *_phases(system, phases),
    ]
    if problems:
        raise CaseError.many(problems)


def _settings(step: float | None, beta2: float, record_every: int) -> Iterator[Problem]:
    if step is not None and not (math.isfinite(step) and step > 0):
        yield Problem("temporal.step", step, "a time step is a number > 0 [s]")
    if not 0.5 <= beta2 <= 1.0:
        yield Problem("temporal.beta2", beta2, "beta2 lies in [0.5, 1]")
    if record_every < 1:
        yield Problem("temporal.record_every", record_every, "the steps between records are an integer ≥ 1")


def _watch(system: System, watch: Sequence[str]) -> Iterator[Problem]:
    for number, name in enumerate(watch):
        if name not in system.points:
            known = ", ".join(system.points) or "none"
            yield Problem(f"temporal.watch.{number}", name, f"no such point; the system has: {known}")


def _phases(system: System, phases: Sequence[PhaseSpec]) -> Iterator[Problem]:
    if not phases:
        yield Problem("phases", None, "at least one phase is needed")
    for number, phase in enumerate(phases):
        where = f"phases.{number}"
        if not (math.isfinite(phase.duration) and phase.duration > 0):
            yield Problem(f"{where}.duration", phase.duration, "a duration is a number > 0 [s]")
        if not (math.isfinite(phase.ramp) and phase.ramp >= 0):
            yield Problem(f"{where}.ramp", phase.ramp, "a ramp is a number ≥ 0 [s]; 0 is sudden")
        yield from _factors(f"{where}.loads", phase.loads, list(system.loads), "load")
        motion = system.motion
        distances = [n.split(".")[1] for n, p in zip(motion.names, motion.full_distance, strict=True) if p]
        moving = [n for n, p in zip(motion.names, motion.full_distance, strict=True) if not p]
        yield from _factors(f"{where}.velocities", phase.velocities, moving, "moving support")
        kind = "support or contact with a distance"
        yield from _factors(f"{where}.displacements", phase.displacements, distances, kind)


def _factors(where: str, factors: Mapping[str, float], names: Sequence[str], what: str) -> Iterator[Problem]:
    for name, factor in factors.items():
        if name not in names:
            yield Problem(f"{where}.{name}", factor, f"no such {what}; there are: {', '.join(names) or 'none'}")
        elif not math.isfinite(factor):
            yield Problem(f"{where}.{name}", factor, "a factor is a finite number")
