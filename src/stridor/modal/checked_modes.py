"""The check of followed modes: what grows in the band is sought anew, of small systems what decays as well, and what
branches do not lead to is added."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np

from ..errors import AnalysisError
from ..system import System
from ..typing import Array, ComplexArray, IntArray
from .complex_modes import complex_modes
from .decaying import Decaying, decaying_modes, unlisted
from .growing import SAME, UNCHECKED, WIDER, Growing, affordable, growing_modes, missing, too_large, unconfirmed
from .krylov.problem import problem_of
from .options import Options
from .quadratic import Quadratic
from .quadratic.inverse_iteration import solved_beside
from .results import ComplexModes

MIRRORED = " Nothing dissipates: each motion that diverges has a mirror that decays as fast, which is not listed."
ROWS = 5  # friction coefficients up to which every one is checked, of more the ends and the case's own


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
    what cannot be followed at all gets a column of its own, NaN at other μ. What decays and no branch leads to gets
    one as well where `decaying_modes` can tell, if all are checked.
    """
    options = options or Options()
    if not affordable(system):
        said = f"{UNCHECKED}: {too_large(system)}."
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
    told = [
        _sentence(modes, row, found.get(row), max_frequency_hz, began, alone.get(row, 0))
        for row in range(len(modes.mu))
    ]
    for row in chosen:
        growing = found[row]
        if isinstance(growing, Growing):
            decaying = None
            if len(chosen) == len(modes.mu):
                decaying = decaying_modes(
                    system, growing, max_frequency_hz, touching_at=touching, damped=modes.damped, options=options
                )
            modes, lacked = _with_decaying(modes, row, decaying, growing.top)
            mirrored = decaying is not None and decaying.mirrored
            told[row] += f" {_of_decaying(decaying, lacked, max_frequency_hz)}{MIRRORED if mirrored else ''}"
    return replace(modes, completeness=tuple(told))


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
        sharp = _sharpened(whole, growing, indices, options.solver)
        modes = _widened(modes, row, sharp.values[indices], sharp.right[:, indices], sharp.residual[indices])
    return modes, alone


def _with_decaying(modes: ComplexModes, row: int, found: Decaying | None, top: float) -> tuple[ComplexModes, int]:
    """With a column for each decaying mode that no branch leads to, and how many those are."""
    if found is None:
        return modes, 0
    at = unlisted(found, modes.eigenvalues[row], top)
    if len(at):
        before = modes.frequency_hz[row]
        modes = _widened(modes, row, found.values[at], found.right[:, at], found.residual[at], found.left[:, at])
        # The lowest modes are listed first, whatever their numbers.
        higher = [np.flatnonzero(before > f) for f in found.values[at].imag / (2 * np.pi)]
        place = [h[0] if len(h) else len(before) for h in higher]
        modes = modes.chosen(np.insert(np.arange(len(before)), place, len(before) + np.arange(len(at))))
    return modes, len(at)


def _of_decaying(found: Decaying | None, lacked: int, max_frequency_hz: float) -> str:
    """What is known of the modes of the list that decay."""
    if found is None:
        return (
            f"Of modes that decay those are listed that start up to {max_frequency_hz:g} Hz or a little above at μ = 0;"
            ' source "full" seeks all.'
        )
    led = f"; to {lacked} of them no branch from μ = 0 was seen to lead" if lacked else ""
    return f"Modes that decay at less than {found.slower:.4g} 1/s were sought as well, and all are counted{led}."


def _sharpened(problem: Quadratic, found: Growing, indices: IntArray, solver: str | None) -> Growing:
    """With the modes at these places (k,) as good as those that branches lead to: the search ends where backward errors
    are small, which leaves slow modes of stiff meshes right to eight digits."""
    # What is sharpened has a phase of its own, where all that was found may be real.
    values, right, residual = found.values.copy(), found.right.astype(complex), found.residual.copy()
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


def _widened(
    modes: ComplexModes, row: int, values: ComplexArray, right: ComplexArray, residual: Array,
    left: ComplexArray | None = None,
) -> ComplexModes:  # fmt: skip
    """With columns that hold these eigenvalues (k,) at one μ alone, and nothing at others."""
    shape = (len(modes.mu), len(values))
    eigenvalues, errors = np.full(shape, complex(np.nan, np.nan)), np.full(shape, np.nan)
    eigenvalues[row], errors[row] = values, residual

    def with_shapes(known: ComplexArray | None, vectors: ComplexArray | None) -> ComplexArray | None:
        if known is None:
            return None
        shapes = np.full((*shape, known.shape[2]), complex(np.nan, np.nan))
        if vectors is not None:
            shapes[row] = vectors.T
        return np.concatenate([known, shapes], axis=1)

    most = int(modes.branch.max(initial=0))
    return replace(
        modes,
        eigenvalues=np.concatenate([modes.eigenvalues, eigenvalues], axis=1),
        residual=np.concatenate([modes.residual, errors], axis=1),
        branch=np.concatenate([modes.branch, most + 1 + np.arange(len(values))]),
        right=with_shapes(modes.right, right),
        left=with_shapes(modes.left, left),
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
    if slow := int(np.count_nonzero(unstable & (np.abs(modes.eigenvalues[row]) <= found.still))):
        said += f" (beside {slow} of the list below {found.still / (2 * np.pi):.3g} Hz, not sought there)"
    if fast := int(np.count_nonzero(unstable & (modes.growth_rate[row] > found.fastest))):
        said += f" (beside {fast} of the list with a growth above {found.fastest:.6g} 1/s, not sought there)"
    lead = "Checked" if found.complete else "NOT COMPLETE"
    return f"{lead}: {said}, sought anew in the full problem. {found.sentence}"
