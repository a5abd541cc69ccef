"""What grows in a band at one friction coefficient, sought anew in the full problem; and the check of followed modes.

Branches are followed from μ = 0, and what starts beyond the band may sink into it with friction, or be born on the real
axis. What counts at a μ is every mode of the band there, wherever it began. It is sought with `quadratic.band_modes` on

    λ²M + λ(C + friction's slope) + K + (N + μS)ᵀ c⁻¹ N

(rigid contact as in `full`), which shares with the followed branches nothing but these matrices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial

import numpy as np

from ..errors import AnalysisError
from ..stages import passing, stage
from ..system import System
from ..threads import one_thread
from ..typing import Array, BoolArray, ComplexArray, IntArray
from .complex_modes import complex_modes
from .full.growth import growing_roots
from .joined import matched
from .krylov import Carried
from .krylov.problem import problem_of
from .onset import refuted
from .onsets import Onsets, onsets
from .options import Options
from .quadratic import Quadratic, band_modes, is_stiff
from .quadratic.inverse_iteration import solved_beside
from .quadratic.polish import pairs
from .quadratic.problem import times
from .quadratic.reach import searched
from .results import ComplexModes
from .tolerances import AT_REST, SPLIT_RELATIVE, UNSTABLE_RELATIVE

AFFORDABLE = 60_000  # unknowns up to which the full problem is solved unasked
ROWS = 5  # friction coefficients up to which every one is checked, of more the ends and the case's own
BESIDE = 1e-3  # of the band: how much faster than that modes may decay that are looked at
NEAR = 1e-3  # of the band: eigenvalues further apart are not the same mode
SAME = 1e-6  # of |λ|: what two ways of solving leave of one eigenvalue
CHECKED, UNCHECKED = "Checked at", "Not checked"
SURE = 3.0  # times a correction: growth that is more than what is left to correct
WIDER = (1.4, 2.0)  # times the band: from where branches are followed that are missing in it


@dataclass(frozen=True)
class Growing:
    """Growing modes of a band at one μ: λ (k,) [1/s], right (n, k) of unit norm, backward errors residual (k,).

    beside (l,): eigenvalues within rounding and a little below of the axis. complete: whether the search vouches for
    there being no other; sentence: what speaks for that. top [1/s]: how far the band had to be searched.
    sought: whether it was; else these are branches, which agree with what was found beside them.
    """

    mu: float
    values: ComplexArray
    right: ComplexArray
    residual: Array
    beside: ComplexArray
    complete: bool
    sentence: str
    top: float
    sought: bool = True

    @property
    def words(self) -> str:
        """How many, of which kind."""
        return modes_grow(self.values)


@one_thread
def growing_modes(
    system: System,
    mu: float,
    max_frequency_hz: float,
    *,
    touching_at: float | None,
    damped: bool = True,
    options: Options | None = None,
) -> Growing:
    """Every mode that grows at ``mu`` with a frequency up to max_frequency_hz.

    touching_at: the μ of the steady sliding that says which nodes touch (None: the laws' own). Searched once and kept
    with the system. Raises AnalysisError where contacts do not slide or the search does not settle.
    """
    chosen = options or Options()
    asked = ("growing modes", mu, max_frequency_hz, touching_at, damped, chosen)
    return system.once(asked, lambda: _searched_for(system, mu, max_frequency_hz, touching_at, damped, chosen))


@passing()
def _searched_for(
    system: System, mu: float, max_frequency_hz: float, touching_at: float | None, damped: bool, options: Options
) -> Growing:
    stage(f"growing modes sought anew at μ = {mu:.6g}")
    problem = problem_of(system if damped else system.undamped(), touching_at, options)
    whole = problem.pencil(mu).condensed()
    top = searched(whole, 2 * np.pi * max_frequency_hz)

    def stands(rate: float) -> bool:
        asked = ("stands", rate, touching_at, damped, options)
        return system.once(asked, lambda: is_stiff(problem.pencil(0.0).condensed(), rate, options.solver))

    found = band_modes(whole, top / (2 * np.pi), above=-BESIDE * top, stands=stands, solver=options.solver)
    size = np.abs(found.values)
    rounding = UNSTABLE_RELATIVE if problem.damped else SPLIT_RELATIVE
    grows = (found.values.real > rounding * size) & (size > AT_REST * top)
    # Slow modes of stiff meshes are found to fewer digits: what one more correction would change is no growth.
    grows &= ~(found.values.real <= SURE * _correction(whole, found.values, found.right))
    right = found.right[: problem.size, grows]
    return Growing(
        mu,
        found.values[grows],
        right / np.maximum(np.linalg.norm(right, axis=0), 1e-300),
        found.residual[grows],
        found.values[~grows],
        found.completeness.complete,
        found.completeness.sentence,
        top,
    )


def _correction(problem: Quadratic, values: ComplexArray, right: ComplexArray) -> Array:
    """By how much (k,) [1/s] a step of Newton's method on xᴴ P(λ) x = 0 would still change each λ."""
    if not len(values):
        return np.zeros(0)
    slope = 2 * values * times(problem.mass, right) + times(problem.damping, right)
    rest = problem.residual(values, right)
    with np.errstate(all="ignore"):
        return np.abs(np.sum(right.conj() * rest, axis=0)) / np.abs(np.sum(right.conj() * slope, axis=0))


def affordable(system: System) -> bool:
    """Whether the full problem is solved unasked."""
    return system.size <= AFFORDABLE


def modes_grow(values: ComplexArray) -> str:
    """How many grow: "1 mode grows", or "3 modes grow, 1 of them without oscillating"."""
    still = int(np.count_nonzero(values.imag == 0.0))
    text = "no mode grows" if not len(values) else "1 mode grows" if len(values) == 1 else f"{len(values)} modes grow"
    if not still:
        return text
    return f"{text} without oscillating" if still == len(values) else f"{text}, {still} of them without oscillating"


def missing(found: Growing, listed: ComplexArray, unstable: BoolArray) -> IntArray:
    """Places (k,) of growing modes that are not among the eigenvalues ``listed`` (l,), of which some are unstable."""
    ours, _ = pairs(found.values, listed[unstable], NEAR * found.top)
    rest = np.setdiff1d(np.arange(len(found.values)), ours)
    # Growth so slow that one way of solving sees it and the other does not.
    stable = listed[~unstable & np.isfinite(listed)]
    distance = np.abs(found.values[rest][:, None] - stable).min(axis=1, initial=np.inf)
    return rest[distance > SAME * np.abs(found.values[rest])]


def unconfirmed(found: Growing, listed: ComplexArray, unstable: BoolArray) -> int:
    """How many of the modes listed as unstable are none in the full problem."""
    mine, top = listed[unstable], found.top
    mine = mine[(mine.real > SAME * np.abs(mine)) & (np.abs(mine) > AT_REST * top)]
    # On the very border of the band a mode may count on one side only.
    mine = mine[mine.imag <= top * (1 - SAME)]
    ours, _ = pairs(mine, found.values, NEAR * top)
    return len(mine) - len(ours)


def doubt(completeness: str) -> str:
    """What is said of a list of modes or onsets where it is not known to hold everything; empty where it is."""
    return completeness if UNCHECKED in completeness or refuted(completeness) else ""


def checked_modes(
    system: System,
    modes: ComplexModes,
    max_frequency_hz: float,
    *,
    own: float | None = None,
    options: Options | None = None,
) -> ComplexModes:
    """The modes of a band with those that came into it from elsewhere, and what was checked in ``completeness``.

    modes: all that start in the band at μ = 0, as `complex_modes` gives them with ``max_frequency_hz``. Up to five
    friction coefficients are all checked, of more the ends and ``own``. What lacks is followed from further above;
    what cannot be followed at all gets a column of its own, NaN at other μ.
    """
    options = options or Options()
    if not affordable(system):
        said = f"{UNCHECKED}: {_too_large(system)}."
        return replace(modes, completeness=(said,) * len(modes.mu))
    chosen = _rows(modes.mu, own)
    touching = float(modes.mu.max()) if len(modes.mu) == 1 else None
    found: dict[int, Growing | str] = {}
    for row in chosen:
        try:
            found[row] = growing_modes(
                system, float(modes.mu[row]), max_frequency_hz, touching_at=touching, damped=modes.damped,
                options=options,
            )  # fmt: skip
        except AnalysisError as error:
            found[row] = str(error)
    began = modes.branch
    for wider in WIDER:
        if not _lacking(modes, found):
            break
        further = _followed_from(system, modes, wider, max_frequency_hz, options)
        modes = modes if further is None else further
    modes, alone = _with_columns(system, modes, found, touching, options)
    told = tuple(
        _sentence(modes, row, found.get(row), max_frequency_hz, began, alone.get(row, 0))
        for row in range(len(modes.mu))
    )
    return replace(modes, completeness=told)


def checked_onsets(
    system: System,
    found: Onsets,
    *,
    damped: bool,
    options: Options | None = None,
    follow: Sequence[float] = WIDER,
    numbered_at: float = 0.0,
    carried: Carried | None = None,
    before: Sequence[complex] | None = None,
) -> Onsets:
    """The onsets with what grows at both ends of the range sought anew in the full problem.

    found: as `onsets` gives them; where a mode grows in the band at the high end that branches do not lead to, they are
    solved again with branches from further above, from ``numbered_at`` on and with ``carried`` as in `onsets`. before:
    what the full problem has at the low end with the nodes that touch below it; where the branches say the same of this
    side, nothing is sought there again. ``completeness`` says what came of it, ``at_start`` and ``at_end``
    are what the full problem has.
    """
    options = options or Options()
    if not affordable(system):
        return replace(found, completeness=f"{UNCHECKED}: {_too_large(system)}.")
    try:
        low, high = (
            partial(growing_modes, system, mu, found.max_frequency_hz, touching_at=None, damped=damped, options=options)
            for mu in found.friction_range
        )
        end = high()
        start = _as_before(found, before, end.top) or low()
    except AnalysisError as error:
        return replace(found, completeness=f"{UNCHECKED}: {error}.")
    for wider in follow:
        if not len(_unled(found, start, end)[1]) and not found.unexplained:
            break
        try:
            found = onsets(
                system, found.friction_range, max_frequency_hz=found.max_frequency_hz, damped=damped, follow=wider,
                numbered_at=numbered_at,
                carried=carried, **asdict(options),
            )  # fmt: skip
        except AnalysisError:
            break
    values = (tuple(complex(v) for v in e.values) for e in (start, end))
    return replace(found, at_start=next(values), at_end=next(values), completeness=_ends_sentence(found, start, end))


def _as_before(found: Onsets, before: Sequence[complex] | None, top: float) -> Growing | None:
    """What the branches say of the low end, where it is what grows in the full problem with the nodes that touch below
    it; None where they differ, or where that is not known."""
    values = np.array(found.at_start, dtype=complex)
    known = np.array(before or (), dtype=complex)
    if before is None or len(known) != len(values) or len(matched(known, values)) < len(values):
        return None
    nothing = np.zeros((0, len(values)), dtype=complex)
    low = found.friction_range[0]
    return Growing(low, values, nothing, np.zeros(len(values)), values[:0], True, "", top, sought=False)


def sought_at_end(found: Onsets | None, mu: float) -> tuple[complex, ...] | None:
    """What was found to grow in the full problem where a range with all its onsets ends; None where it does not end at
    ``mu`` or was not checked."""
    if found is None or found.friction_range[1] != mu or not found.completeness.startswith(CHECKED):
        return None
    return found.at_end


def _too_large(system: System) -> str:
    return f"with {system.size} freedoms what grows is not sought anew in the full problem (up to {AFFORDABLE} it is)"


def _not_in(found: Growing, known: tuple[complex, ...]) -> IntArray:
    values = np.array(known, dtype=complex)
    return missing(found, values, np.ones(len(values), dtype=bool))


def _unled(found: Onsets, start: Growing, end: Growing) -> list[ComplexArray]:
    """Growing modes at both ends that no branch leads to. Of a branch that has fallen apart on the real axis the other
    half is led to as well, where as many roots grow as the onsets say."""
    whole = found.followed is not None and not _roots_amiss(found, start, end)
    result: list[ComplexArray] = []
    for k, (growing, known) in enumerate(((start, found.at_start), (end, found.at_end))):
        lacking = growing.values[_not_in(growing, known)]
        if whole and found.followed is not None:
            branches = found.followed[k][1]
            fallen = (branches.imag == 0) & (branches.real > AT_REST * growing.top)
            if np.count_nonzero(lacking.imag == 0) <= np.count_nonzero(fallen):
                lacking = lacking[lacking.imag != 0]
        result.append(lacking)
    return result


def _ends_sentence(found: Onsets, start: Growing, end: Growing) -> str:
    """What the full problem says of both ends, beside the onsets."""
    low, high = found.friction_range
    numbers = f"{start.words} at μ = {low:g} and {end.words} at μ = {high:g}, sought anew in the full problem"
    if not start.sought:
        numbers = (
            f"{end.words} at μ = {high:g}, sought anew in the full problem, and {start.words} at μ = {low:g}, as "
            "below it"
        )
    wrong: list[str] = []
    sides = zip((start, end), (found.at_start, found.at_end), (low, high), _unled(found, start, end), strict=True)
    for growing, known, mu, lacking in sides:
        values = np.array(known, dtype=complex)
        extra = unconfirmed(growing, values, np.ones(len(values), dtype=bool))
        if len(lacking):
            named = ", ".join(f"{v.imag / (2 * np.pi):.6g} Hz (+{v.real:.4g} 1/s)" for v in lacking[:4])
            wrong.append(f"no branch was seen to lead to {named} at μ = {mu:g}")
        if extra:
            wrong.append(f"{extra} of the branches that grow at μ = {mu:g} are not found there")
    if found.unexplained:
        wrong.append(f"{found.unexplained} of those at μ = {high:g} go back to no onset that was solved")
    wrong += _roots_amiss(found, start, end)
    if wrong:
        return f"NOT COMPLETE: {numbers}, but {'; '.join(wrong)}. Take a smaller range of μ."
    if not (start.complete and end.complete):
        sentence = start.sentence if not start.complete else end.sentence
        return f"NOT COMPLETE: {numbers}, as the onsets say, but {sentence}"
    return (
        f"{CHECKED} {'both ends' if start.sought else 'the high end'}: {numbers}, and each of them goes back to an "
        f"onset listed or grew from the start. "
        f"{end.sentence} What grows and ends again between them rests on the branches followed."
    )


def _roots_amiss(found: Onsets, start: Growing, end: Growing) -> list[str]:
    """What onsets and the growing eigenvalues at both ends say otherwise where motions grow without oscillating: a pair
    that has fallen apart on the real axis is two of them, and one may go through zero unseen by any branch."""
    if np.all(start.values.imag) and np.all(end.values.imag):
        return []
    more, said = growing_roots(end.values) - growing_roots(start.values), sum(o.roots for o in found.onsets)
    if more == said:
        return []
    return [
        f"{more:+d} eigenvalues grow from one to the other where the onsets say {said:+d}: a motion that does not "
        "oscillate begins or ceases to grow, or a mode leaves the band"
    ]


def _rows(mu: Array, own: float | None) -> list[int]:
    if len(mu) <= ROWS:
        return list(range(len(mu)))
    ends = {int(np.argmin(mu)), int(np.argmax(mu))}
    if own is not None:
        nearest = int(np.argmin(np.abs(mu - own)))
        if abs(mu[nearest] - own) <= 1e-12 * max(own, 1e-12):
            ends.add(nearest)
    return sorted(ends)


def _lacking(modes: ComplexModes, found: dict[int, Growing | str]) -> bool:
    return any(
        len(missing(f, modes.eigenvalues[row], modes.unstable[row]))
        for row, f in found.items()
        if isinstance(f, Growing)
    )


def _followed_from(
    system: System, modes: ComplexModes, wider: float, max_frequency_hz: float, options: Options
) -> ComplexModes | None:
    """The same modes and those that start up to ``wider`` times the band and are in it somewhere; None where they are
    not to be followed."""
    try:
        more = complex_modes(
            system, modes.mu, max_frequency_hz=wider * max_frequency_hz, damped=modes.damped,
            vectors=False if modes.right is None else True if modes.left is not None else "right",
            **asdict(options),
        )  # fmt: skip
    except AnalysisError:
        return None
    inside = np.any(more.frequency_hz <= max_frequency_hz, axis=0)
    known = np.isin(more.branch, modes.branch)
    return replace(
        more.chosen(np.flatnonzero(inside | known)), max_frequency_hz=max_frequency_hz, planned=modes.planned
    )


def _with_columns(
    system: System, modes: ComplexModes, found: dict[int, Growing | str], touching: float | None, options: Options
) -> tuple[ComplexModes, dict[int, int]]:
    """With a column for each growing mode that no branch leads to, and how many those are by row."""
    alone: dict[int, int] = {}
    for row, growing in found.items():
        if isinstance(growing, str):
            continue
        indices = missing(growing, modes.eigenvalues[row], modes.unstable[row])
        if not len(indices):
            continue
        alone[row] = len(indices)
        problem = problem_of(system if modes.damped else system.undamped(), touching, options)
        whole = problem.pencil(growing.mu).condensed()
        modes = _widened(modes, row, _sharpened(whole, growing, indices, options.solver), indices)
    return modes, alone


def _sharpened(problem: Quadratic, found: Growing, indices: IntArray, solver: str | None) -> Growing:
    """With the modes at these places (k,) as good as those that branches lead to: the search ends where backward errors
    are small, which leaves slow modes of stiff meshes right to eight digits."""
    values, right, residual = found.values.copy(), found.right.copy(), found.residual.copy()
    for k in indices:
        old = complex(values[k])
        solved = solved_beside(problem, old, None, None, solver=solver)
        if solved is None or abs(solved.lam - old) > SAME * abs(old):
            continue
        lam = solved.lam if old.imag else complex(solved.lam.real)
        error = float(problem.backward_error(np.array([lam]), solved.right[:, None])[0])
        if error <= residual[k]:
            x = solved.right[: len(right)]
            values[k], right[:, k], residual[k] = lam, x / max(float(np.linalg.norm(x)), 1e-300), error
    return replace(found, values=values, right=right, residual=residual)


def _widened(modes: ComplexModes, row: int, found: Growing, indices: IntArray) -> ComplexModes:
    """With columns that hold eigenvalues at one μ alone."""
    shape = (len(modes.mu), len(indices))
    values, residual = np.full(shape, complex(np.nan, np.nan)), np.full(shape, np.nan)
    values[row], residual[row] = found.values[indices], found.residual[indices]
    right = left = None
    if modes.right is not None:
        shapes = np.full((*shape, modes.right.shape[2]), complex(np.nan, np.nan))
        shapes[row] = found.right[:, indices].T
        right = np.concatenate([modes.right, shapes], axis=1)
    if modes.left is not None:
        left = np.concatenate([modes.left, np.full((*shape, modes.left.shape[2]), complex(np.nan, np.nan))], axis=1)
    most = int(modes.branch.max(initial=0))
    return replace(
        modes,
        eigenvalues=np.concatenate([modes.eigenvalues, values], axis=1),
        residual=np.concatenate([modes.residual, residual], axis=1),
        branch=np.concatenate([modes.branch, most + 1 + np.arange(len(indices))]),
        right=right,
        left=left,
    )


def _sentence(
    modes: ComplexModes, row: int, found: Growing | str | None, max_frequency_hz: float, began: IntArray, alone: int
) -> str:
    """What was checked at one μ. began: branches that were followed because they start in the band or just above."""
    if found is None:
        return f"{UNCHECKED} at this μ: what branches followed from μ = 0 give."
    if isinstance(found, str):
        return f"{UNCHECKED}: {found}."
    unstable = modes.unstable[row] & modes.in_band[row]
    wrong = unconfirmed(found, modes.eigenvalues[row], unstable)
    said = f"{found.words} up to {max_frequency_hz:g} Hz"
    if wrong:
        return f"NOT CONFIRMED: {said} in the full problem, {wrong} fewer than branches do. {found.sentence}"
    entered = int(np.count_nonzero(unstable & ~np.isin(modes.branch, began))) - alone
    if entered > 0:
        said += f", {entered} of which start{'s' if entered == 1 else ''} above it at μ = 0"
    if alone:
        said += f", {alone} of which no branch from μ = 0 was seen to lead to"
    if slow := int(np.count_nonzero(unstable & (np.abs(modes.eigenvalues[row]) <= AT_REST * found.top))):
        said += f" (beside {slow} of the list below {AT_REST * found.top / (2 * np.pi):.3g} Hz, not sought there)"
    lead = "Checked" if found.complete else "NOT COMPLETE"
    return f"{lead}: {said}, sought anew in the full problem. {found.sentence}"
