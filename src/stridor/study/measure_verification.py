"""Counter-measures solved again with the change made: what the first order promised, and what became of it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from ..modal.complex_modes import ComplexModes
from ..modal.growing import doubt
from ..modal.krylov.kept_factors import KeptFactors
from ..modal.over_friction import modes_of_band
from ..modal.unfit import Unfit
from ..system import System
from ..typing import ComplexArray
from .contact_edges import edge_rows
from .measure_ranking import Ranking, drawn_bodies
from .measures import Measure, Verified, growth
from .sensitivities import Linearised


def verified(ranking: Ranking, measure: Measure, count: int | None, max_frequency_hz: float | None) -> Measure:
    """The measure with its modes solved again, steady sliding too."""
    linear = ranking.linear
    band = max_frequency_hz or linear.case.modal.max_frequency_hz
    lowest = None if max_frequency_hz is not None else linear.case.modal.modes if count is None else count
    # Which modes are the lowest at μ = 0 matters where not all are looked at.
    numbered = lowest is not None and lowest <= len(linear.modes.branch)
    system, mu = _changed(linear, measure)
    modes = _solved(system, linear, mu, band, 0.0 if numbered else mu)
    if lowest is not None:
        modes = modes.lowest(lowest)
    modes = modes.chosen(np.flatnonzero(modes.in_band[0]))
    actual: ComplexArray = modes.eigenvalues[0]
    unstable = modes.unstable[0]
    aimed = np.flatnonzero(ranking.aimed)
    nearest = [int(np.argmin(np.abs(actual - measure.predicted[k]))) for k in aimed]
    if ranking.target == "sum":
        after = growth(actual)
        shown = int(np.argmax(actual.real))
    else:
        after, shown = growth(actual[nearest]), nearest[0]
    result = Verified(
        growth_rate=float(actual[shown].real),
        frequency_hz=float(actual[shown].imag / (2 * np.pi)),
        removed=growth(ranking.eigenvalues[ranking.aimed]) - after,
        removed_sum=growth(ranking.eigenvalues) - growth(actual),
        unstable_hz=tuple(float(v) for v in np.sort(actual[unstable].imag) / (2 * np.pi)),
        doubt=doubt(modes.completeness[0]),
    )
    return replace(measure, verified=result)


def _solved(system: System, linear: Linearised, mu: float, band: float, numbered_at: float) -> ComplexModes:
    """The modes of the band of a changed system, and what was checked of them."""
    damped, options = linear.damped, linear.options
    if options.source is None and system.symmetric_definite:
        # Sparse matrices for small systems too: a mass at one node leaves their complete basis no proportional damping.
        with suppress(Unfit):
            krylov = replace(options, source="krylov")
            # What is taken of it stays that of no change, and what is not to be handed on need not be exact.
            carried = replace(linear.handed, factors=KeptFactors(), inner=(True, True))
            return modes_of_band(
                system, mu, band, damped=damped, options=krylov, numbered_at=numbered_at, carried=carried
            )
    return modes_of_band(system, mu, band, damped=damped, options=options, numbered_at=numbered_at)


def _changed(linear: Linearised, measure: Measure) -> tuple[System, float]:
    """The system with the change made, and the friction coefficient that is asked for of it."""
    if measure.kind == "number":
        assert measure.changed is not None, "a number has a value"
        rubbing = linear.with_friction(measure.name, measure.changed)
        if rubbing is not None:
            return rubbing
        system = linear.varied(measure.name, measure.changed)
    else:
        system = _heavier(linear.system, measure) if measure.kind == "added mass" else _chamfered(linear, measure)
    return system, linear.friction(system)


def _heavier(system: System, measure: Measure) -> System:
    assert measure.mass is not None, "made so"
    for body, points, d in drawn_bodies(system):
        if body.name == measure.name:
            node = int(np.argmin(np.linalg.norm(points - np.array(measure.position), axis=1)))
            rows = body.rows.free[node * d : node * d + d]
            return replace(system, mass=system.mass + measure.mass * (rows.T @ rows))
    raise AssertionError("a body that was there")


def _chamfered(linear: Linearised, measure: Measure) -> System:
    system, nodes = linear.system, linear.system.contact_nodes()
    name, edge, rows = (part.strip() for part in measure.name.rsplit(",", 2))
    contact = nodes.names.index(name)
    wanted = int(rows.split()[0])
    cuts = edge_rows(nodes, linear.held.touching, linear.held.sense, contact, edge.split()[0], wanted)
    gone = np.zeros(nodes.count, dtype=bool)
    gone[cuts[-1].gone] = True
    # The modal approach reads nodes alone: what they were paired from stays, and facets number nodes that are gone.
    surfaces = [
        replace(surface, nodes=surface.nodes.select(~gone[mine]), facets=None)
        for surface, mine in system.nodes_of_surfaces()
    ]
    speeds = dict(zip(nodes.names, nodes.mean_speed, strict=True))  # at which μ is told, as it was
    return replace(system, surfaces=tuple(surfaces), friction_speeds=speeds)
