"""Figures of a report that only solids and contact over surfaces have."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from ..agreement import mode_shape
from ..digits import measured
from ..system import System
from ..typing import ComplexArray
from . import plots
from .field_plots import contact_energy, contacts_of_several_nodes
from .inputs import ReportInputs
from .page_parts import ReportFigure
from .tables import Table, TableRow, drop_empty, number, quantity, significant
from .units import most, pressure_unit


def shape_figures(inputs: ReportInputs) -> Iterator[ReportFigure]:
    """The mode that grows fastest, and where friction feeds it."""
    system, shape = inputs.system, inputs.unstable_shape
    if system is None or shape is None or inputs.shape_vector is None or not system.solids:
        return
    growth = shape.growth_rate or 0.0
    said = f"grows with {growth:.4g} 1/s" if growth > 0 else f"decays with {-growth:.4g} 1/s, the slowest"
    if any(solid.cells.keys() - {"vertex"} for solid in system.solids):
        yield ReportFigure(
            "mode",
            f"The mode at {measured(shape.frequency_hz, 1)} Hz",
            f"At the friction of the case this mode {said}. Drawn at the instant of largest motion, exaggerated, "
            f"coloured by the displacement. {_shares(system, inputs.shape_vector)}",
            f"Deformed meshes in the mode at {measured(shape.frequency_hz, 0)} Hz.",
            partial(
                plots.solid_mode_shape,
                system,
                inputs.shape_vector,
                frequency_hz=shape.frequency_hz,
                growth_rate=growth,
            ),
        )
    nodes = system.contact_nodes()
    if inputs.friction_energy is None or nodes.count < 2:
        return
    several = contacts_of_several_nodes(system)
    for name in several:
        one = len(several) == 1
        yield ReportFigure(
            "friction-energy" if one else f"friction-energy-{name}",
            "Where the squeal is made" if one else f"Where the squeal is made, contact {name}",
            "Energy that friction feeds into this mode at each slave node in one cycle (red) or takes from it (blue), "
            "relative to the energy of the mode. Arrows: how the material of the other body goes, which meets the "
            "leading edge first.",
            f"Map of the energy that friction feeds in over contact {name}.",
            partial(contact_energy, system, inputs.friction_energy, name),
        )


def _shares(system: System, vector: ComplexArray) -> str:
    """The largest amplitude of each body, relative to that of all."""
    shapes = mode_shape(system, vector)
    sizes = {name: float(np.linalg.norm(shape, axis=1).max(initial=0.0)) for name, shape in shapes.items()}
    most = max(sizes.values(), default=0.0)
    if most == 0.0 or len(sizes) < 2:
        return ""
    shares = ", ".join(f"{name} {quantity(100 * size / most, 0, 2)} %" for name, size in sizes.items())
    return f"Largest amplitude of each body: {shares}."


def contact_figures(inputs: ReportInputs) -> Iterator[ReportFigure]:
    """Pressure and status along the interface over time."""
    history = None if inputs.trajectory is None else inputs.trajectory.nodes
    if history is None or len(history.time) < 2:
        return
    for k, name in enumerate(history.names):
        if np.count_nonzero(history.owner == k) < 2:
            continue
        yield ReportFigure(
            f"pressure-{name}",
            f"Contact pressure of {name} over time",
            "Position along the interface across, time upwards; in space, nodes at the same place along it are one.",
            f"Space-time picture of the contact pressure of {name}.",
            partial(plots.contact_map, history, name, quantity="pressure"),
        )
        yield ReportFigure(
            f"status-{name}",
            f"Separation, stick and slip of {name} over time",
            "The same for the status of the nodes: waves of stick and separation run through the interface as "
            "slanted bands.",
            f"Space-time picture of stick, slip and separation of {name}.",
            partial(plots.contact_map, history, name, quantity="status"),
        )


def surface_table(inputs: ReportInputs) -> Table | None:
    """Resultants of every contact in steady sliding."""
    steady = inputs.steady
    if steady is None or not steady.resultants:
        return None
    unit, its_name = pressure_unit(most(np.array([found.largest_pressure for found in steady.resultants.values()])))
    rows = [
        TableRow(
            (
                name,
                ", ".join(significant(float(f)) for f in found.force),
                ", ".join(significant(float(m)) for m in np.atleast_1d(found.moment)),
                "" if not np.isfinite(found.area) else significant(found.area),
                "" if not np.isfinite(found.largest_pressure) else number(found.largest_pressure / unit, 3),
            )
        )
        for name, found in steady.resultants.items()
    ]
    heads = (
        "contact",
        "force on the slave [N]",
        "moment about the origin [N m]",
        "area [m²]",
        f"largest pressure [{its_name}]",
    )
    caption = f"The equilibrium of every freedom is solved to {steady.residual:.1e} of the largest force."
    return drop_empty(Table("steady-surfaces", "Steady sliding", heads, tuple(rows), frozenset({0, 1, 2}), caption))
