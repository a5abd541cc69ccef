"""Modes and onsets of a band over the friction coefficient: what says which modes grow takes these lists.

Nodes of a contact open and close as friction grows. Each μ has those that touch in its own steady sliding, so that the
modes at a μ do not depend on which others were asked for, and an onset is solved with the nodes that touch there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from functools import partial
from typing import Literal

import numpy as np

from ..case.repeating import of_alike
from ..errors import AnalysisError, FollowingError
from ..sliding.stretches import Stretch, stretch_words, stretches
from ..system import System
from ..typing import Array, ComplexArray, IntArray
from .checked_modes import checked_modes
from .checked_onsets import checked_onsets, sought_at_end
from .complex_modes import complex_modes
from .from_above import WIDER, Returning, with_origins
from .full import full_onsets
from .full.basis import DENSE as SMALL
from .full.basis import WHOLE
from .full.words import UNFOLLOWED
from .growing import UNCHECKED, affordable, growing_modes
from .joined import TouchingChange, joined_modes, joined_onsets, rows_of
from .krylov import Carried
from .onsets import Onsets, onsets
from .options import Options
from .results import ComplexModes, Progress
from .source import SOURCES


def modes_of_band(
    system: System,
    mu: float | Sequence[float] | Array,
    max_frequency_hz: float,
    *,
    damped: bool = True,
    vectors: bool | Literal["right"] = False,
    own: float | None = None,
    options: Options | None = None,
    progress: Progress | None = None,
    numbered_at: float = 0.0,
    check: bool = True,
    residuals: bool = True,
    carried: Carried | None = None,
) -> ComplexModes:
    """Every mode of a band at the friction coefficients ``mu``, as `complex_modes` follows them and `checked_modes`
    completes them, each with the nodes that touch at its μ. Whatever says something about which modes grow takes this
    list; check=False leaves `checked_modes` out, and nothing else. At a μ where there is no steady sliding among others
    where there is, all is NaN (`ComplexModes.unsolved`). carried: what a basis at one μ hands on, to the same μ of a
    neighbouring system. Raises as `complex_modes`."""
    options = options or Options()
    values = np.atleast_1d(np.asarray(mu, dtype=float))

    def said(found: ComplexModes) -> ComplexModes:
        return replace(found, completeness=tuple(of_alike(each, system.repeating) for each in found.completeness))

    def followed(
        held: System, at: Array, tell: Progress | None, start: float = numbered_at, carried: Carried | None = None
    ) -> ComplexModes:
        return complex_modes(
            held, at, max_frequency_hz=max_frequency_hz, damped=damped, vectors=vectors, residuals=residuals,
            progress=tell, numbered_at=start, carried=carried, **asdict(options),
        )  # fmt: skip

    def checked(held: System, found: ComplexModes) -> ComplexModes:
        # Matrices without structure are solved in full as it is, and say what speaks for that.
        if found.completeness or not check:
            return found
        return checked_modes(held, found, max_frequency_hz, own=own, options=options)

    if len(values) < 2 or not (np.all(np.isfinite(values)) and np.all(values >= 0)):
        return said(checked(system, followed(system, values, progress, carried=carried)))
    over = stretches(system, float(values.min()), float(values.max()), at=values, solver=options.solver)
    parts = _parts(over, values)
    if len(parts) == 1 and not parts[0][0].reason:
        held = parts[0][0].of(system)
        return said(checked(held, followed(held, values, progress)))
    return said(_modes_of_parts(system, values, parts, over, followed, checked, progress))


def _parts(over: tuple[Stretch, ...], values: Array) -> list[tuple[Stretch, IntArray]]:
    """The stretches with friction coefficients in them, and the places of these in ``values`` (k,)."""
    inner = np.array([s.low for s in over[1:]])
    which = np.searchsorted(inner, values, side="right")
    return [(s, indices) for k, s in enumerate(over) if len(indices := np.flatnonzero(which == k))]


def _modes_of_parts(
    system: System,
    values: Array,
    parts: list[tuple[Stretch, IntArray]],
    over: tuple[Stretch, ...],
    followed: Callable[..., ComplexModes],
    checked: Callable[[System, ComplexModes], ComplexModes],
    progress: Progress | None,
) -> ComplexModes:
    """Modes of every stretch with its own touching nodes, joined."""
    solid = [(s, indices) for s, indices in parts if not s.reason]
    if not solid:
        raise AnalysisError(parts[0][0].reason)
    found: list[ComplexModes] = []
    borders: list[TouchingChange] = []
    order: list[int] = []
    left: tuple[IntArray, ComplexArray] | None = None
    stopped, carried = False, Carried()
    for k, (stretch, indices) in enumerate(solid):
        # Both sides of a border are solved at its μ as well, so that branches are known again beyond it.
        ends = [s.low for s, _ in (solid[k : k + 1] if k else []) + solid[k + 1 : k + 2]]
        held, done = stretch.of(system), len(order)
        carried.inner = k > 0, k < len(solid) - 1

        def tell(at: int, of: int, done: int = done) -> None:
            if progress is not None:
                progress(min(done + at, len(values)), len(values))

        try:
            # Branches have the names that they had before a border, and need not be followed up to it again.
            at = np.append(values[indices], ends)
            whole = followed(held, at, tell, stretch.low, carried) if k else followed(held, at, tell, carried=carried)
        except KeyboardInterrupt:
            if not found:
                raise
            break  # before the first μ of this stretch: what the others have stays
        if whole.planned is not None:
            # What follows is missing too; rows of borders are no results.
            rows = [r for r, mu in enumerate(whole.mu) if mu in values[indices]]
            keep = [int(indices[np.flatnonzero(values[indices] == whole.mu[r])[0]]) for r in rows]
            stopped, own = True, rows_of(whole, rows)
        else:
            keep, own = indices.tolist(), rows_of(whole, range(len(indices)))
        sides = [(whole.branch, whole.eigenvalues[len(indices) + e]) for e in range(len(ends))] if not stopped else []
        if k and left is not None:
            if not sides:
                break
            borders.append(TouchingChange(stretch.low, left, sides[0]))
        left = sides[-1] if sides else None
        found.append(checked(held, replace(own, planned=None)))
        order += keep
        if stopped:
            break
    result = joined_modes(found, borders, np.array(order, dtype=np.int64))
    planned = len(values) if stopped or len(order) < sum(len(p) for _, p in solid) else None
    result = replace(result, planned=planned, notes=(*result.notes, *stretch_words(over)))
    return result if planned is not None else _with_empty(result, values, parts)


def _with_empty(modes: ComplexModes, values: Array, parts: list[tuple[Stretch, IntArray]]) -> ComplexModes:
    """With rows of NaN at the μ where there is no steady sliding."""
    empty = {int(k): s.reason for s, indices in parts if s.reason for k in indices}
    if not empty:
        return modes
    solid = [k for k in range(len(values)) if k not in empty]

    def wide(block: ComplexArray) -> ComplexArray:
        result = np.full((len(values), *block.shape[1:]), complex(np.nan, np.nan))
        result[solid] = block
        return result

    told = dict(zip(solid, modes.completeness, strict=False)) | {k: f"{UNCHECKED}: {why}." for k, why in empty.items()}
    unsolved = np.isin(np.arange(len(values)), list(empty))
    notes: list[str] = []
    for why in dict.fromkeys(empty.values()) if not modes.completeness else ():
        if not any(why in note for note in modes.notes):  # `stretch_words` names ranges, not a single μ without any
            where = ", ".join(f"{values[k]:g}" for k in empty if empty[k] == why)
            notes.append(f"At μ = {where} nothing was solved: {why}.")
    return replace(
        modes,
        mu=values,
        eigenvalues=wide(modes.eigenvalues),
        residual=wide(modes.residual + 0j).real,
        right=None if modes.right is None else wide(modes.right),
        left=None if modes.left is None else wide(modes.left),
        completeness=tuple(told[k] for k in range(len(values))) if modes.completeness else (),
        unsolved=unsolved,
        notes=(*modes.notes, *notes),
    )


def onsets_of_band(
    system: System,
    friction_range: tuple[float, float],
    max_frequency_hz: float,
    *,
    damped: bool = True,
    options: Options | None = None,
    check: bool = True,
) -> Onsets:
    """Every onset in a range of μ, as `onsets` solves them and `checked_onsets` completes them, each with the nodes
    that touch at its μ; where these change, growth may set in or end at once (kind "contact"). check=False leaves
    `checked_onsets` out, and nothing else. They are kept with the system. Raises as `onsets`."""
    chosen, (low, high) = options or Options(), (float(v) for v in friction_range)
    asked = ("onsets", low, high, max_frequency_hz, damped, chosen, check)

    def solved() -> Onsets:
        found = _solved_onsets(system, (low, high), max_frequency_hz, damped, chosen, check)
        return replace(found, completeness=of_alike(found.completeness, system.repeating))

    return system.once(asked, solved)


def _shapes_at(
    held: System, mu: float, max_frequency_hz: float, damped: bool, options: Options
) -> ComplexArray | None:
    """Shapes (n, k) of the full problem at μ, which `checked_onsets` looks for; None where it does not."""
    if not affordable(held):
        return None
    try:
        found = growing_modes(held, mu, max_frequency_hz, touching_at=None, damped=damped, options=options)
    except AnalysisError:  # whoever checks the onsets says so
        return None
    return found.shapes


def _solved_onsets(
    system: System, friction_range: tuple[float, float], max_frequency_hz: float, damped: bool, options: Options,
    check: bool,
) -> Onsets:  # fmt: skip
    carried = Carried()

    def solved(held: System, between: tuple[float, float], before: Onsets | None = None) -> Onsets:
        # Behind a border branches have the names that they had before it.
        numbered_at = 0.0 if before is None else between[0]
        carried.inner = before is not None, between[1] < friction_range[1]
        if check:
            carried.at_end = partial(_shapes_at, held, between[1], max_frequency_hz, damped, options)
        try:
            found = onsets(
                held, between, max_frequency_hz=max_frequency_hz, damped=damped, numbered_at=numbered_at,
                carried=carried, **asdict(options),
            )  # fmt: skip
        except FollowingError as error:
            if held.size > WHOLE or options.source is not None:
                raise
            why = str(error).partition(";")[0]
            if held.size <= SMALL:  # followed at once: a count may miss what begins and ends between two values
                with suppress(AnalysisError):
                    found = unfollowed(held, between, None)
                    if found.complete and UNFOLLOWED not in found.completeness:
                        return found
            return unfollowed(held, between, why)
        if not found.completeness:
            if not check:
                return found
            found = checked_onsets(
                held, found, damped=damped, options=options, numbered_at=numbered_at, carried=carried,
                before=sought_at_end(before, between[0]),
            )  # fmt: skip
        if found.complete or held.size > WHOLE or options.source is not None:
            return found
        if UNCHECKED in found.completeness:  # what does not find the ends finds nothing between them
            return found
        for why in ("", None):  # counted, and followed in the full problem: many that begin at once are not counted
            try:
                other = unfollowed(held, between, why)
            except AnalysisError:
                continue
            if other.complete:
                return other
        return found

    def unfollowed(held: System, between: tuple[float, float], why: str | None) -> Onsets:
        found = full_onsets(
            lambda _: held, between, max_frequency_hz=max_frequency_hz, damped=damped, options=options, unfollowed=why
        )
        return replace(found, source=SOURCES[-1].name)

    low, high = friction_range
    if not (0 <= low < high and np.isfinite(high)):
        return solved(system, friction_range)
    over = stretches(system, low, high, solver=options.solver)
    if len(over) == 1 and not over[0].reason:
        return solved(over[0].of(system), (low, high))
    # Where contact slides without friction alone there is no range.
    solid = [s for s in over if not s.reason and s.low < s.high]
    if not solid:
        raise AnalysisError(next(s.reason for s in over if s.reason))
    parts: list[tuple[Stretch, Onsets]] = []
    for s in solid:
        parts.append((s, solved(s.of(system), (s.low, s.high), parts[-1][1] if parts else None)))

    def border(k: int) -> TouchingChange:
        mu = parts[k + 1][0].low
        sides = parts[k][1].followed, parts[k + 1][1].followed
        if sides[0] is not None and sides[1] is not None:
            return TouchingChange(mu, sides[0][1], sides[1][0])
        before, after = (
            complex_modes(
                s.of(system), [mu], max_frequency_hz=max_frequency_hz, damped=damped, **asdict(options)
            )
            for s in (parts[k][0], parts[k + 1][0])
        )
        return TouchingChange(mu, (before.branch, before.eigenvalues[0]), (after.branch, after.eigenvalues[0]))

    def wider(stretch: Stretch, hz: float) -> Onsets:
        return onsets(
            stretch.of(system), (stretch.low, stretch.high), max_frequency_hz=hz, damped=damped,
            numbered_at=0.0 if stretch is solid[0] else stretch.low, **asdict(options),
        )  # fmt: skip

    def residual(stretch: Stretch, mu: float, lam: complex) -> float:
        highest = max(max_frequency_hz, WIDER * abs(lam.imag) / (2 * np.pi))
        try:
            found = growing_modes(stretch.of(system), mu, highest, touching_at=None, damped=damped, options=options)
        except AnalysisError:
            return np.nan
        return float(found.residual[int(np.argmin(np.abs(found.values - lam)))]) if len(found.values) else np.nan

    returning: list[Returning] = []
    parts = with_origins(parts, wider, residual, returning)
    leaving = [(r.before, r.lam) for r in returning if r.jumps]
    found = joined_onsets(parts, (solid[0].low, solid[-1].high), border, residual, leaving, (low, high))
    told = [r.words(solid[r.before].high) for r in returning]
    return replace(found, notes=(*found.notes, *stretch_words(over), *told))
