"""Which nodes touch over a range of friction coefficients: a sweep and onsets hold those of one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..case import Case
from ..errors import AnalysisError
from ..sliding.pattern import BY_MESHES, facet_height
from ..sliding.surfaces import steady_sliding_nodes
from ..system import System, build_system
from ..typing import Array, BoolArray

SMALL = 2000  # freedoms up to which an equilibrium costs next to nothing, and is solved between the ends too
LOOKS = 5


def held_elsewhere(system: System, mus: Sequence[float] | Array, solver: str | None = None) -> tuple[str, ...]:
    """A sentence where steady sliding at some of the friction coefficients ``mus`` (k,) has other nodes in contact than
    at the laws' own, which modes at several of them and onsets hold; () where it has the same.

    Looked at are both ends, and of small systems some between. Nothing is held where only one is asked for; of load
    steps `contact_state` tells.
    """
    values = np.unique(np.asarray(mus, dtype=float))
    nodes = system.contact_nodes()
    if len(values) < 2 or not nodes.count or not system.loads or system.load_steps:
        return ()
    try:
        own = steady_sliding_nodes(system, solver=solver).active
    except AnalysisError:
        return ()
    places = np.linspace(0, len(values) - 1, min(LOOKS, len(values))).round().astype(int)
    looks = values[places] if system.size <= SMALL else values[[0, -1]]
    told = [words for mu in looks if (words := _difference(system, float(mu), own, solver))]
    if not told:
        return ()
    return (
        f"The {int(own.sum())} of {nodes.count} contact nodes that touch in steady sliding at the case's own friction "
        f"are held so at every μ; {'; '.join(told)}. Modes there are other ones: ask for that μ alone.",
    )


def decided_by_meshes(system: System, mu: float | None = None, solver: str | None = None) -> tuple[str, ...]:
    """What steady sliding warns of where the facets of curved surfaces decide what touches; nothing where all is flat,
    and where there is no equilibrium, which the analysis says."""
    if not any(surface.facets is not None and facet_height(surface) for surface in system.surfaces):
        return ()
    try:
        return tuple(said for said in steady_sliding_nodes(system, mu=mu, solver=solver).warnings if BY_MESHES in said)
    except AnalysisError:
        return ()


def case_decided_by_meshes(case: Case, mu: float | None = None) -> tuple[str, ...]:
    """The same of a case, whose model is built only where boundaries of meshes are in contact."""
    if not any("." in contact.master for contact in case.contacts.values()):
        return ()
    return decided_by_meshes(build_system(case, mu), mu)


def _difference(system: System, mu: float, own: BoolArray, solver: str | None) -> str:
    """What is different at ``mu``."""
    try:
        found = steady_sliding_nodes(system, mu=mu, guess=own, solver=solver).active
    except AnalysisError:
        return f"at μ = {mu:g} there is no steady sliding"
    opened, closed = int(np.count_nonzero(own & ~found)), int(np.count_nonzero(found & ~own))
    changes = [f"{count} of them {what}" for count, what in ((opened, "open"),) if count]
    changes += [f"{closed} others touch"] if closed else []
    return f"at μ = {mu:g} {' and '.join(changes)}" if changes else ""
