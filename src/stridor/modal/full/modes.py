"""Complex modes of systems with matrices of any structure: gyroscopic, circulatory, with friction of another program.

λ²M + λD + K of such a system, the contacts that touch in steady sliding put in, is one quadratic problem per μ:

    penalty contact:  K + (N + μS)ᵀ c⁻¹ N
    rigid contact:    a row N u = 0 and a column −(N + μS)ᵀ, whose unknowns, the normal forces, have no mass

`quadratic.find_modes` finds every eigenvalue of a band at each μ and says what speaks for its being all; which is which
from one μ to the next is found by following branches on a reduced model (`numbers`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from ...errors import CaseError
from ...system import System
from ...typing import Array, ComplexArray
from ..at_rest import more_slow, moving, slow_words
from ..options import Options
from ..painleve import refuse_undetermined
from ..quadratic import band_modes, is_stiff
from ..quadratic.dense import unit
from ..quadratic.reach import searched
from ..results import ComplexModes, Progress, at_each, require_memory
from .basis import DECAY
from .family import SystemFamily, family_of
from .growth import without_rounding
from .numbers import BranchNumbers, numbered


@dataclass(frozen=True)
class ModesAtFriction:
    """Eigenvalues (k,) at one μ by frequency, right and left vectors (n, k), backward errors (k,)."""

    values: ComplexArray
    right: ComplexArray
    left: ComplexArray | None
    residual: Array
    sentence: str


def full_modes(
    system_at: Callable[[float], System],
    mu: float | Sequence[float] | Array,
    *,
    count: int | None = 20,
    max_frequency_hz: float = 40e3,
    damped: bool = True,
    vectors: bool | Literal["right"] = False,
    options: Options | None = None,
    own: float | None = None,
    progress: Progress | None = None,
    unfollowed: str = "",
) -> ComplexModes:
    """Modes at the friction coefficients ``mu`` up to max_frequency_hz, of them the ``count`` lowest (None: all) and
    whatever else is unstable.

    system_at gives the system at a μ, on which its matrices may depend; own is the μ at which the touching nodes of
    contacts are found if several are asked for (None: the lowest). Numbers of modes are those of branches followed from
    μ = 0; where these cannot be told apart, or ``unfollowed`` says why they were not, they count by frequency at each
    μ, and completeness says so. Where a branch is beyond the band there is NaN. Raises CaseError for friction
    coefficients that are none, AnalysisError where contacts do not slide or eigenvalues do not settle.
    """
    values = np.atleast_1d(np.asarray(mu, dtype=float))
    if values.ndim != 1 or not len(values) or not np.all(np.isfinite(values)) or np.any(values < 0):
        raise CaseError("mu", mu, "friction coefficients are numbers ≥ 0, at least one")
    if not (np.isfinite(max_frequency_hz) and max_frequency_hz > 0):
        raise CaseError("max_frequency_hz", max_frequency_hz, "a positive frequency in Hz")
    highest, held = float(values.max()), float(values.min()) if own is None else own
    touching = highest if len(values) == 1 else held
    refuse_undetermined(system_at(highest), highest, options or Options(), touching_at=touching)
    family = family_over(system_at, values, options or Options(), damped=damped, own=own)
    top = searched(family.built(float(values.max())), 2 * np.pi * max_frequency_hz)
    values, found, planned = modes_at_each(
        values, lambda at: _modes(family, at, top, left=vectors is True), family.freedoms, progress, vectors
    )
    numbers = numbered(family, values, [f.values for f in found], top, unfollowed)
    table = table_of(family, values, found, numbers, damped=damped, vectors=vectors)
    table = replace(table, max_frequency_hz=max_frequency_hz, planned=planned)
    return table if count is None else table.lowest(count)


def modes_at_each(
    values: Array, modes: Callable[[float], ModesAtFriction], freedoms: int, progress: Progress | None,
    vectors: bool | Literal["right"],
) -> tuple[Array, list[ModesAtFriction], int | None]:  # fmt: skip
    """What ``modes`` finds `at_each` μ, with the ``vectors`` that are wanted."""

    def solved(mu: float) -> ModesAtFriction:
        found = modes(mu)
        if mu == values.min():
            require_memory(len(values), len(found.values), freedoms if vectors else 0)
        if vectors is not True:
            found = replace(found, left=None)
        return found if vectors else replace(found, right=found.right[:0])

    return at_each(values, solved, progress)


def family_over(
    system_at: Callable[[float], System], values: Array, options: Options, *, damped: bool, own: float | None
) -> SystemFamily:
    """The family up to the largest μ; one alone is also where the touching nodes are found."""
    low, high = float(values.min()), float(values.max())
    if high == 0.0:
        still = system_at(0.0)
        return SystemFamily(lambda _: still, (0.0, 1.0), options, damped=damped, own=0.0, touching_at=0.0)
    if len(values) == 1:
        return family_of(system_at, (high, high), options, damped=damped, own=high, touching_at=high)
    return family_of(system_at, (low, high), options, damped=damped, own=low if own is None else own)


def _modes(family: SystemFamily, mu: float, top: float, *, left: bool) -> ModesAtFriction:
    spectrum = band_modes(
        family.built(mu), top / (2 * np.pi), above=-DECAY * top, left=left, solver=family.options.solver,
        stands=partial(is_stiff, family.built(family.low), solver=family.options.solver),
    )  # fmt: skip
    n = family.freedoms
    told = spectrum.completeness.sentence
    slow = spectrum.values[~moving(spectrum.values, top, lambda: family.rest_limit(top))]
    if more_slow(family.built(mu), slow, top, family.options.solver):
        told = f"NOT COMPLETE: there are {slow_words(family.rest_limit(top))}. Of faster ones: {told}"
    return ModesAtFriction(
        without_rounding(family, spectrum.values, top),
        unit(spectrum.right[:n]),
        None if spectrum.left is None else unit(spectrum.left[:n]),
        spectrum.residual,
        f"Modes up to {top / (2 * np.pi):g} Hz that decay at less than {DECAY * top:.4g} 1/s. {told}",
    )


def table_of(
    family: SystemFamily,
    mu: Array,
    found: list[ModesAtFriction],
    numbers: BranchNumbers,
    *,
    damped: bool,
    vectors: bool | Literal["right"],
) -> ComplexModes:
    """The modes of all μ, a column for each number."""
    used = np.unique(np.concatenate([*numbers.of, np.zeros(0, dtype=np.int64)]))
    used = used[used > 0]
    shape, n = (len(mu), len(used)), family.freedoms
    eigenvalues = np.full(shape, complex(np.nan, np.nan))
    residual = np.full(shape, np.nan)
    right, left = (
        np.full((*shape, n if wanted else 0), complex(np.nan, np.nan)) for wanted in (bool(vectors), vectors is True)
    )
    for row, (f, own) in enumerate(zip(found, numbers.of, strict=True)):
        chosen = np.flatnonzero(np.isin(own, used))
        columns = np.searchsorted(used, own[chosen])
        eigenvalues[row, columns], residual[row, columns] = f.values[chosen], f.residual[chosen]
        if vectors:
            right[row, columns] = f.right[:, chosen].T
        if f.left is not None:
            left[row, columns] = f.left[:, chosen].T
    return ComplexModes(
        mu=mu,
        eigenvalues=eigenvalues,
        branch=used,
        residual=residual,
        damped=damped,
        right=right if vectors else None,
        left=left if vectors is True else None,
        open_contacts=family.open_contacts,
        contact_state=family.contacts.contact_state,
        completeness=tuple(f"{f.sentence}{numbers.sentence}" for f in found),
    )
