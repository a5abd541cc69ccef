"""Going on from the saved state of another run: what must fit, and the two runs as one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import CaseError
from ..typing import Array
from .saved import agrees, check_arrays, check_done
from .settings import Settings
from .sketch import MOTION, SketchPart, differing, saved_row
from .stepper import Stepper
from .trajectory import HISTORIES, Trajectory

NODE_HISTORIES = ("time", "normal_force", "tangential_force", "slip_velocity", "gap", "status")


def settings_of_restart(settings: Settings, restart: Trajectory | None) -> Settings:
    """Settings with the step of the run that is gone on from, where they leave it open: the limit that it would follow
    from differs in its last digits from machine to machine, and altogether where something was changed."""
    return settings if restart is None or settings.step is not None else replace(settings, step=restart.step)


def settings_row(stepper: Stepper, settings: Settings) -> Array:
    """Step, β2 and steps between records, as a saved state has them."""
    return np.array([stepper.scheme.step, stepper.scheme.beta2, float(settings.record_every)])


def check_restart(stepper: Stepper, restart: Trajectory, settings: Settings, *, join: bool, changed: bool) -> None:
    """Raise CaseError where a saved state belongs to another model (``changed``: to one of other freedoms), scheme or
    record, or holds what no run leaves."""
    scheme, own = stepper.scheme, settings_row(stepper, settings)[:2]
    if restart.path != stepper.path or not agrees(restart.state, "settings", own, first=2):
        raise CaseError(
            "restart",
            f"step {restart.step:g} s, beta2 {restart.beta2:g}, path {restart.path}",
            f"a state of the same scheme: step {scheme.step:g} s, beta2 {scheme.beta2:g}, path {stepper.path}",
        )
    _check_model(stepper.parts, restart, changed=changed)
    stepper.check(restart)
    if join and (restart.record_every != settings.record_every or restart.watch_names != settings.watch):
        raise CaseError(
            "restart",
            f"a record every {restart.record_every} steps of {', '.join(restart.watch_names) or 'no points'}",
            f"the same records as before (here every {settings.record_every} steps of "
            f"{', '.join(settings.watch) or 'no points'}), or join=False",
        )
    check_arrays(restart.state, stepper.state(), stepper.bounds())
    check_done(restart.state, *stepper.counted, restart.steps)


def _check_model(parts: Sequence[SketchPart], restart: Trajectory, *, changed: bool) -> None:
    saved = np.asarray(restart.state.get("model", np.zeros(0)))
    found = differing(parts, saved)
    if found is None:
        raise CaseError("restart", "model", "a state of the same model: this one has other freedoms, loads or contacts")
    if found and not changed:
        names = "; ".join(part.name for part in found)
        raise CaseError("restart", "model", f"a state of the same model; these differ: {names}")


def motion_ratio(parts: Sequence[SketchPart], restart: Trajectory, names: Sequence[str]) -> Array:
    """Velocities (p,) of the moving supports over those that the saved state was computed with. Raises CaseError for
    another direction: the way gone so far would change with it."""
    ratios = np.ones(len(names))
    for p, name in enumerate(names):
        part = next(part for part in parts if part.name == f"{MOTION} {name}")
        now, then = part.numbers, saved_row(parts, restart.state["model"], part.name)
        if part.same(np.append(then, part.scale)):
            continue
        ratios[p] = float(now @ then) / float(then @ then)
        if np.abs(now - ratios[p] * then).max() > part.close * part.scale:
            raise CaseError(
                "restart",
                f"supports.{name}",
                "the same direction: the way that it has gone so far lies along the old one; its speed may change",
            )
    return ratios


def joined(before: Trajectory, after: Trajectory) -> Trajectory:
    """Records of a restarted run, those of its nodes too, behind those of the run it went on from."""
    together = {name: np.concatenate([getattr(before, name), getattr(after, name)]) for name in HISTORIES}
    works = {name: np.concatenate([before.works[name], after.works[name]]) for name in after.works}
    nodes = after.nodes
    if before.nodes is not None and nodes is not None:
        nodes = replace(
            nodes, **{n: np.concatenate([getattr(before.nodes, n), getattr(nodes, n)]) for n in NODE_HISTORIES}
        )
    wall = before.wall_seconds + after.wall_seconds
    return replace(after, **together, works=works, wall_seconds=wall, nodes=nodes)
