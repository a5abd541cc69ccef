"""Pictures and files of shapes: what `stridor shapes` and `stridor steady` write."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..digits import measured
from ..errors import CaseError
from ..io.atomic import replacing, write_text
from ..io.vtk import write_vtk
from ..modal.complex_modes import ComplexModes
from ..modal.options import Options
from ..sliding.result import SteadySliding
from ..stages import passing, stage
from ..study import analyses
from ..study.workspace import Problem, Workspace
from ..system import System
from ..temporal.node_history import NodeHistory
from ..typing import Array, IntArray


def write_shapes(
    problem: Problem,
    folder: Path,
    *,
    mu: float | None = None,
    branches: Sequence[int] | None = None,
    band_hz: tuple[float, float] | None = None,
    gif: bool = False,
) -> list[dict[str, Any]]:
    """PNG, animated page and VTK file of modes (default: all unstable ones, else the one that decays slowest; of those
    with frequencies in a band, where one is given).

    Returns a document for each: branch, frequency, growth and the files. Raises CaseError for branches that are not
    in the list of modes, and, before anything is computed, for matrices without a mesh.
    """
    work = Workspace.of(problem)
    system = work.system(mu)
    _require_places(system)
    if not work.has_shapes:
        raise CaseError("bodies", None, "point masses alone, which have no shape to draw; `stridor modes` and `stridor "
                        "report` do without")
    modes = analyses.modes(work, mu, max_frequency_hz=work.modal.max_frequency_hz, vectors="right")
    if band_hz is not None and branches is None:
        modes = modes.between(*band_hz)
    chosen = _chosen(modes, branches)
    documents: list[dict[str, Any]] = []
    for column in chosen:
        documents.append(_write_one(system, modes, int(column), folder, work.options, gif=gif))
    return documents


def _has_places(system: System) -> bool:
    return bool(system.solids or system.lines)


def _require_places(system: System) -> None:
    if not _has_places(system):
        raise CaseError(
            "bodies", None, "no places of nodes, so there is nothing to draw; bodies.NAME.mesh gives them to matrices, "
            "and `stridor modes` and `stridor report` do without"
        )  # fmt: skip


def _chosen(modes: ComplexModes, branches: Sequence[int] | None) -> IntArray:
    if branches is not None:
        known = [int(b) for b in modes.branch]
        for branch in branches:
            if branch not in known:
                raise CaseError("--branch", branch, f"one of the modes up to modal.max_frequency_hz: 1 to {max(known)}")
        return np.array([known.index(b) for b in branches])
    unstable = np.flatnonzero(modes.unstable[0] & modes.in_band[0])
    if len(unstable):
        return unstable[np.argsort(modes.growth_rate[0][unstable])[::-1]]
    vibrating = np.flatnonzero(modes.frequency_hz[0] > 0)
    if not len(vibrating):
        return np.zeros(0, dtype=np.int64)
    return vibrating[[int(np.argmax(modes.growth_rate[0][vibrating]))]]


@passing()
def _write_one(
    system: System, modes: ComplexModes, column: int, folder: Path, options: Options, *, gif: bool
) -> dict[str, Any]:
    stage(f"drawing mode {modes.branch[column]}")
    from ..view.animation import animation_gif, animation_html
    from ..view.solid_plots import mode_shape

    assert modes.right is not None, "asked for with vectors"
    vector = modes.right[0, column]
    branch, frequency = int(modes.branch[column]), float(modes.frequency_hz[0, column])
    growth = float(modes.growth_rate[0, column])
    stem = f"mode-{branch}-{measured(frequency, 0)}Hz"
    figure = mode_shape(system, vector, frequency_hz=frequency, growth_rate=growth)
    files = [folder / f"{stem}.png", folder / f"{stem}.html"]
    with replacing(files[0]) as temporary:
        figure.savefig(temporary, dpi=180)
    write_text(files[1], animation_html(system, vector, frequency_hz=frequency, growth_rate=growth))
    if gif:
        files.append(folder / f"{stem}.gif")
        with replacing(files[-1]) as temporary:
            temporary.write_bytes(animation_gif(system, vector, frequency_hz=frequency, growth_rate=growth))
    energy = _energy(system, modes, column, options)
    if energy is not None and len(energy) > 1:
        files += _energy_pictures(system, energy, folder / f"{stem}-friction-energy.png")
    files += write_vtk(
        system,
        folder / f"{stem}.vtu",
        vectors={"displacement": vector},
        contact_data=None if energy is None else {"friction_energy": energy},
    )
    return {
        "branch": branch,
        "frequency_hz": frequency,
        "growth_rate": growth,
        "unstable": bool(modes.unstable[0, column]),
        "files": [str(f) for f in files],
    }


def _energy(system: System, modes: ComplexModes, column: int, options: Options) -> Array | None:
    """Friction energy by slave node; of what does not vibrate there is none."""
    if not system.contact_nodes().count or modes.eigenvalues[0, column].imag == 0.0:
        return None
    from ..modal.krylov import friction_energy

    return friction_energy(system, modes, 0, column, options=options).per_cycle


def _energy_pictures(system: System, energy: Array, path: Path) -> list[Path]:
    """One for each contact over several nodes; of several the name is in the file's."""
    from ..view.field_plots import contact_energies

    drawn = contact_energies(system, energy)
    files: list[Path] = []
    for name, figure in drawn.items():
        files.append(path if len(drawn) == 1 else path.with_stem(f"{path.stem}-{name}"))
        with replacing(files[-1]) as temporary:
            figure.savefig(temporary, dpi=180)
    return files


def write_steady(problem: Problem, steady: SteadySliding, folder: Path) -> list[Path]:
    """Pressure of each contact as PNG, and displacement and pressure as VTK files; none without places of nodes."""
    from ..view.field_plots import contact_snapshot

    system = Workspace.of(problem).system()
    nodes = system.contact_nodes()
    if not _has_places(system):
        if nodes.count:
            return []
        raise CaseError(
            "contacts", None, "none, and no places of nodes, so there is no contact force to tell and nothing to draw; "
            "`stridor modes` and `stridor report` do without"
        )  # fmt: skip
    history = NodeHistory(
        names=nodes.names,
        owner=nodes.owner,
        position=nodes.position,
        area=nodes.area,
        tangents=nodes.tangents,
        time=np.zeros(1),
        normal_force=steady.normal_force[None],
        tangential_force=steady.friction_force[None],
        slip_velocity=steady.slip_velocity[None],
        gap=steady.gap[None],
        status=steady.status[None],
    )
    files: list[Path] = []
    for k, name in enumerate(nodes.names):
        if np.count_nonzero(nodes.owner == k) < 2:
            continue
        path = folder / f"steady-{name}.png"
        figure = contact_snapshot(history, 0.0, name, title=f"contact {name} in steady sliding")
        with replacing(path) as temporary:
            figure.savefig(temporary, dpi=180)
        files.append(path)
    contact = {"normal_force": steady.normal_force, "active": steady.active.astype(np.int64), "gap": steady.gap}
    contact |= {"status": steady.status, "friction_force": np.linalg.norm(steady.friction_force, axis=1)}
    if not np.isnan(nodes.area).any():
        contact["pressure"] = steady.normal_force / nodes.area
    files += write_vtk(
        system, folder / "steady.vtu", vectors={"displacement": steady.displacement}, contact_data=contact
    )
    return files


def steady_document(steady: SteadySliding) -> dict[str, Any]:
    """What `stridor steady --json` prints."""
    names = ("open", "stick", "slip")
    counted = {name: int(np.count_nonzero(steady.status == code)) for code, name in enumerate(names)}
    return {
        "contacts": {
            name: {
                "force": [float(f) for f in found.force],
                "moment": np.atleast_1d(found.moment).astype(float).tolist(),
                "area": float(found.area),
                "largest_pressure": float(found.largest_pressure),
            }
            for name, found in steady.resultants.items()
        },
        "touching_nodes": int(steady.active.sum()),
        "nodes": len(steady.active),
        "status": counted,
        "residual": steady.residual,
        "force_error": float(steady.balance.force_error),
        "moment_error": float(steady.balance.moment_error),
        "iterations": steady.iterations,
        **({"others": [other.to_json() for other in steady.others]} if steady.others else {}),
    }
