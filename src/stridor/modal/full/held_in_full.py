"""What grows on a reduced model at a few points, held against the full problem.

Whatever is counted on a model rests on its basis, and a mode that the basis lacks is in none of these counts. So at the
points on which a claim rests the growing modes are sought anew in the full problem (`growing.growing_in`): each of them
must be one of the model's, and each of the model's one of these.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...digits import hertz
from ...errors import AnalysisError
from ...stages import stage
from ...threads import one_thread
from ...typing import BoolArray, ComplexArray
from ..growing import Growing, growing_in, missing, modes_grow, too_many, unconfirmed
from ..parametric import ReducedModel
from ..quadratic import is_stiff
from ..quadratic.reach import searched_in
from ..tolerances import AFFORDABLE

MOST = 3  # modes that are named


@dataclass(frozen=True)
class Listed:
    """A point with the model's eigenvalues (k,) there, and which of them grow."""

    point: Mapping[str, float]
    values: ComplexArray
    grows: BoolArray


@dataclass(frozen=True)
class HeldInFull:
    """amiss: for each point in what the full problem differs, in words to which the place is added, "" for nothing.
    why: why it was not asked, "" where it was."""

    amiss: tuple[str, ...] = ()
    why: str = ""

    @property
    def holds(self) -> bool:
        """Whether it was asked everywhere and has the same modes."""
        return not self.why and not any(self.amiss)


@one_thread
def held_in_full(
    model: ReducedModel, listed: Sequence[Listed], *, damped: bool, solver: str | None = None
) -> HeldInFull:
    """What the full problem says of the growing modes of a reduced model at some points. damped: whether anything
    dissipates, which decides what growth is beyond rounding."""
    problem = model.problem
    if model.keeps_all:
        return HeldInFull(("",) * len(listed))  # it is the full problem
    if problem.size > AFFORDABLE:
        return HeldInFull(why=too_many(problem.size))
    top = searched_in([problem.at(point) for point in problem.sampled], model.frequency)
    amiss: list[str] = []
    for one in listed:
        stage("growing modes sought anew in the full problem")
        whole = problem.at(one.point)
        try:
            found = growing_in(
                whole, 0.0, top, damped=damped, stands=partial(is_stiff, whole, solver=solver), freedoms=problem.size,
                solver=solver,
            )  # fmt: skip
        except AnalysisError as error:
            return HeldInFull(why=f"what grows in the full problem was not found: {error}")
        amiss.append(_words(found, one))
    return HeldInFull(tuple(amiss))


def _words(found: Growing, listed: Listed) -> str:
    """In what the full problem differs at a point."""
    # Motions as a whole are told apart by their size.
    judged = np.abs(listed.values) > found.still
    values, grows = listed.values[judged], listed.grows[judged]
    # What diverges faster than anything of the band turns no model promises: it is held by its number alone.
    inside, within = np.abs(found.values) <= found.top, np.abs(values) <= found.top
    band = replace(found, values=found.values[inside])
    lacks = band.values[missing(band, values[within], grows[within])]
    beyond = int(np.count_nonzero(grows & ~within)) - int(np.count_nonzero(~inside))
    more = unconfirmed(band, values[within], grows[within]) + max(beyond, 0)
    counts = f"in the full problem {modes_grow(found.values)} and in the reduced model {int(np.count_nonzero(grows))}"
    if len(lacks):
        named = ", ".join(f"{hertz(abs(v.imag) / (2 * np.pi))} (+{v.real:.4g} 1/s)" for v in lacks[:MOST])
        return f"{counts}, which lacks {named},"
    if more:
        return f"{counts}, {more} of which the full problem does not have,"
    if not found.complete:
        return f"{counts}, but {found.sentence.rstrip('.')},"
    return ""
