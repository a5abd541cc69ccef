"""Onsets along a number over stretches in which other nodes touch, put together to one answer.

Every stretch has a model of its own. At a border both of its neighbours are solved at the same value; a mode that grows
on one side of it only has begun or ended there, as over the friction coefficient (`modal.joined`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...sliding.stretches import Stretch
from ..joined import by_stretch, jumps
from ..parametric import ReducedModel
from .parametric_onsets import ParametricOnset, ParametricOnsets


@dataclass(frozen=True)
class Part:
    """A stretch, the model that holds its touching nodes, and what was found in it."""

    stretch: Stretch
    model: ReducedModel
    found: ParametricOnsets


def joined_along(
    parts: Sequence[Part], name: str, between: tuple[float, float], words: tuple[str, ...]
) -> ParametricOnsets:
    """One list of onsets along a number from those of its stretches, in order; words: what touches where."""
    every = [onset for part in parts for onset in part.found]
    for before, after in pairwise(parts):
        if before.stretch.high == after.stretch.low:
            every += _at_border(before, after, name)
    unlike = any(part.stretch.others for part in parts)
    complete = all(part.found.complete for part in parts) and not unlike
    held = "with the nodes of its middle" if unlike else "with the nodes that touch there"
    told = by_stretch([(part.stretch, part.found.sentence) for part in parts])
    lead = f"{len(parts)} stretches of {name}, each {held}." if len(parts) > 1 else f"One stretch of {name}, {held}."
    lacks = "Not complete: nodes open or close all along the range. " if unlike else ""
    listed = sorted(every, key=lambda o: (o.value, o.frequency_hz))
    made = ParametricOnsets.of(
        listed, parts[0].model, name, complete=complete, sentence=f"{lacks}{lead} {' '.join(told)}"
    )
    made.between = between
    made.notes = (*words, *dict.fromkeys(note for part in parts for note in part.found.notes))
    made.warnings = ()
    if all(part.found.warnings for part in parts):
        made.warnings = (f"{name} changes nothing but which nodes touch: no matrix of the problem depends on it",)
    return made


def _at_border(before: Part, after: Part, name: str) -> Iterator[ParametricOnset]:
    """Growth that begins or ends because other nodes touch."""
    value = before.stretch.high
    sides = [part.model.modes({name: value}, judged=False) for part in (before, after)]
    grow = [side.values[side.unstable].tolist() for side in sides]
    begins, ends = jumps(*grow)
    for found, side, part, stabilising in ((ends, sides[0], before, True), (begins, sides[1], after, False)):
        if not found:
            continue
        residual = part.model.backward_error(side)
        for lam in found:
            at = int(np.argmin(np.abs(side.values - lam)))
            yield ParametricOnset(
                name, value, {name: value}, abs(lam.imag) / (2 * np.pi), None, stabilising, float(residual[at]), value,
                "contact",
            )  # fmt: skip
