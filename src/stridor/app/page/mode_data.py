"""A chosen mode as data: its motion, what takes part in it, where friction feeds it, and what changes it."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np

from ...case import Case
from ...errors import CaseError, StridorError
from ...modal.complex_modes import ComplexModes
from ...modal.krylov import friction_energy
from ...modal.options import Options
from ...study.analyses import modes as modes_of
from ...study.countermeasures import default_numbers, whole_matrices
from ...study.sensitivities import sensitivities
from ...study.workspace import Workspace
from ...system import System
from ...view.mode_motion import growth_in_words, page_data
from ...view.skin import mode_title, skin_of

SAME = 1e-4  # of λ: how far apart one mode may lie in the full problem and in a reduced one
MOVING = ("real", "imag", "scale", "bent")  # what of a shape differs from mode to mode


def shape_of(system: System, modes: ComplexModes, column: int, *, known: str) -> tuple[dict[str, Any], str]:
    """The motion of a mode for the script that plays it, and a name of the geometry. known: the geometry that the page
    has; that is not sent again."""
    assert modes.right is not None, "asked for with vectors"
    frequency, growth = float(modes.frequency_hz[0, column]), float(modes.growth_rate[0, column])
    document: dict[str, Any] = {
        "mu": float(modes.mu[0]), "frequency_hz": frequency, "growth_rate": growth,
        "damping_ratio": float(modes.damping_ratio[0, column]), "unstable": bool(modes.unstable[0, column]),
        "title": f"Mode {modes.branch[column]}: {mode_title(frequency, None)}", "growth": growth_in_words(growth),
    }  # fmt: skip
    try:
        data = page_data(skin_of(system, modes.right[0, column]), scale=None)
    except CaseError as error:  # matrices without places
        return {**document, "undrawn": str(error)}, known
    still = {k: v for k, v in data.items() if k not in (*MOVING, "half")}
    key = hashlib.sha256(repr(sorted(still.items())).encode()).hexdigest()[:16]
    document["motion"] = {k: data[k] for k in MOVING}
    if key != known:
        document["geometry"] = data
    return {**document, "key": key}, key


def participation(system: System, modes: ComplexModes, column: int) -> list[dict[str, Any]]:
    """Of every body its share of the kinetic energy of a mode, and the phase [degrees] of its largest motion against
    that of the body that moves most."""
    assert modes.right is not None, "asked for with vectors"
    u = modes.right[0, column]
    moved = system.mass @ u
    rows: list[tuple[str, float, complex]] = []
    for body in (*system.solids, *system.lines):
        own = body.freedoms
        motion = np.asarray(body.rows.free @ u)
        largest = complex(motion[int(np.argmax(np.abs(motion)))]) if len(motion) else 0j
        rows.append((body.name, float(np.real(np.vdot(u[own], moved[own]))), largest))
    total = sum(energy for _, energy, _ in rows) or 1.0
    most = max(rows, key=lambda row: abs(row[2]), default=("", 0.0, 1 + 0j))[2] or 1 + 0j
    return [
        {
            "body": name, "share": energy / total,
            "phase_deg": float(np.degrees(np.angle(largest / most))) if largest else None,
        }
        for name, energy, largest in rows
    ]  # fmt: skip


def energy_of(system: System, options: Options, modes: ComplexModes, column: int) -> dict[str, Any]:
    """Energy that friction feeds in at each contact during one period, over the energy of the mode, or why there is
    none."""
    nodes = system.contact_nodes()
    if not nodes.count or modes.eigenvalues[0, column].imag == 0.0:
        return {"each": [], "why": "no contact, or a mode that does not vibrate"}
    try:
        found = friction_energy(system, modes, 0, column, options=options)
    except StridorError as error:
        return {"each": [], "why": str(error)}
    each = found.per_cycle
    period = 2 * np.pi / abs(found.eigenvalue.imag)
    return {
        "each": [{"contact": name, "per_cycle": float(each[nodes.owner == k].sum())}
                 for k, name in enumerate(nodes.names)],
        "damping": -float(found.damping) * period,
        "why": "",
    }  # fmt: skip


def tornado_at(work: Workspace, mu: float, branch: int, eigenvalue: complex) -> dict[str, Any]:
    """The same of the mode of the full problem that has an eigenvalue [1/s], under the number that the page has for
    it."""
    try:
        found = modes_of(work, mu, max_frequency_hz=work.modal.max_frequency_hz)
    except StridorError as error:
        return {"branch": branch, "mu": mu, "bars": [], "warnings": [str(error)]}
    apart = np.abs(found.eigenvalues[0] - eigenvalue)
    if not np.nanmin(apart, initial=np.inf) <= SAME * abs(eigenvalue):
        told = f"no mode of the full problem lies at {eigenvalue.imag / (2 * np.pi):.1f} Hz: choose it again"
        return {"branch": branch, "mu": mu, "bars": [], "warnings": [told]}
    return {**tornado(work, mu, int(found.branch[np.nanargmin(apart)])), "branch": branch, "mu": mu}


def tornado_seconds(case: Case, mu: float, *, solve: float, build: float) -> float:
    """About how long `tornado` takes [s], of what one solve of the modes and one assembly of the matrices take: each
    number is moved both ways, twice as far as well."""
    return solve + 4 * build * len(_numbers_of(case, mu))


def _numbers_of(case: Case, mu: float) -> list[str]:
    return ["mu", *default_numbers(case, whole_matrices(case, mu))]


def tornado(work: Workspace, mu: float, branch: int) -> dict[str, Any]:
    """What a per cent of each number of the case does to a mode, the strongest first: growth [1/s], frequency [Hz]."""
    numbers = _numbers_of(work.case("sensitivities"), mu)
    skipped: list[str] = []
    while True:
        try:
            found = sensitivities(
                work, numbers, mu=mu, modes=[branch], max_frequency_hz=work.modal.max_frequency_hz
            )
            break
        except CaseError as error:
            wrong = [p.where for p in error.problems if p.where in numbers]
            if not wrong:
                return {"branch": branch, "bars": [], "warnings": [str(error)]}
            skipped += wrong
            numbers = [n for n in numbers if n not in wrong]
        except StridorError as error:
            return {"branch": branch, "bars": [], "warnings": [str(error)]}
    if not len(found.branch):
        return {"branch": branch, "bars": [], "warnings": list(found.warnings)}
    bars = [
        {"path": path, "growth": float(found.growth_per_percent[k, 0]),
         "frequency_hz": float(found.frequency_per_percent_hz[k, 0])}
        for k, path in enumerate(numbers)
    ]  # fmt: skip
    bars.sort(key=lambda bar: -abs(float(bar["growth"])))
    told = list(found.warnings) + ([f"left out: {', '.join(skipped)}"] if skipped else [])
    return {"branch": branch, "bars": bars, "warnings": told, "mu": mu, "frequency_hz": float(found.frequency_hz[0])}
