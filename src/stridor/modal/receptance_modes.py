"""Complex modes by receptance: few contact nodes on a complete basis, branches followed from μ = 0."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ..errors import AnalysisError
from ..system import System
from ..system.uncoupled import uncoupled_modes
from ..typing import Array, ComplexArray, IntArray
from .backward_error import BackwardError
from .coupling import PointCoupling, couple
from .krylov.follow import FOLLOWED
from .pencil import Pencil
from .quadratic.inverse_iteration import solved_beside
from .results import ComplexModes, Progress, at_each, require_memory
from .roots import ReceptanceProblem, spectrum_of
from .tolerances import BELIEVED, UNSTABLE_RELATIVE
from .tracking import Tracker
from .unfit import Unfit
from .vectors import closed, expand, fixed_vectors, modal_coordinates

CHUNK = 256
DOUBTFUL = 1e-11  # backward errors above it are refined on the assembled matrices
BESIDE = (1e-10, 1e-9, 1e-8, 1e-7)  # of λ: how far beside it that is, where stiff contacts make P singular nearer to it
NEARBY = 1e-6  # of λ: what is found further away is another one


def prepare(system: System, *, mu: float | None = None) -> tuple[ReceptanceProblem, PointCoupling, tuple[str, ...]]:
    """Spectrum of a system with the contacts that touch in steady sliding at ``mu``, kept with the system."""
    return system.once(("receptance", mu), lambda: _prepared(system, mu))


def _prepared(system: System, mu: float | None) -> tuple[ReceptanceProblem, PointCoupling, tuple[str, ...]]:
    coupling, open_contacts = couple(system, mu=mu)
    modes = uncoupled_modes(coupling.system)
    return spectrum_of(coupling, modes), coupling, open_contacts


def modes_by_receptance(
    system: System,
    values: Array,
    *,
    count: int,
    max_frequency_hz: float | None,
    damped: bool,
    vectors: bool | Literal["right"],
    residuals: bool = True,
    progress: Progress | None,
) -> ComplexModes:
    """Modes at the friction coefficients values (k,), as `complex_modes` gives them.

    Raises Unfit for a structure whose basis is not complete or whose stiffness is not positive, FollowingError where
    branches cannot be told apart, AnalysisError where contacts do not slide or nothing oscillates.
    """
    if not damped:
        system = system.undamped()
    spectrum, coupling, open_contacts = prepare(system, mu=float(values.max()) if len(values) == 1 else None)
    apart = not coupling.contacts and not spectrum.modes.proportional
    if spectrum.modes.no_receptance or apart or (spectrum.unseen and coupling.contacts):
        raise Unfit(unfit_words(spectrum), max_frequency_hz or _limit(spectrum, count, None) / (2 * np.pi))
    limit = _limit(spectrum, count, max_frequency_hz)
    if not limit > 0.0:
        raise AnalysisError("nothing in the system oscillates: it has no stiffness at all")
    tracker = Tracker(spectrum, limit)
    start, fixed = tracker.origin, spectrum.fixed
    require_memory(len(values), len(start) + len(fixed), system.size if vectors else 0)
    values, rows, planned = at_each(values, lambda at: tracker.advance(at).roots[: len(start)], progress)
    followed = np.array(rows)
    every = np.concatenate([start, fixed])
    columns = in_order(every, limit)
    number = np.empty(len(columns), dtype=np.int64)
    number[columns] = np.arange(1, len(columns) + 1)
    if max_frequency_hz is None:
        columns = columns[:count]
    else:
        lowest = np.concatenate([followed.imag.min(axis=0), fixed.imag])
        nearest = np.concatenate([np.minimum(np.abs(followed).min(axis=0), np.abs(start)), np.abs(fixed)])
        inside = ((every.imag <= limit) | (np.abs(lowest) <= limit)) & (nearest <= FOLLOWED * limit)
        columns = columns[inside[columns]]
    moving = np.flatnonzero(columns < len(start))
    still = np.flatnonzero(columns >= len(start))
    eigenvalues: ComplexArray = np.empty((len(values), len(columns)), dtype=complex)
    eigenvalues[:, moving] = followed[:, columns[moving]]
    eigenvalues[:, still] = fixed[columns[still] - len(start)]
    judge = BackwardError(coupling)
    residual = np.zeros((len(values), len(columns)))
    shapes = np.zeros((2, len(values), len(columns), system.size if vectors else 0), dtype=complex)
    constant = fixed_vectors(spectrum)[:, columns[still] - len(start)].astype(complex)
    residual[:, still] = _judge_fixed(judge, eigenvalues[0, still], constant, values)
    if vectors:
        shapes[0][:, still] = constant.T
        for row, m in enumerate(values):
            shapes[1][row, still] = _left_of_fixed(coupling, eigenvalues[0, still], constant, float(m)).T
    if vectors or residuals:
        try:
            part = _pairs(spectrum, judge, eigenvalues[:, moving], values, shapes if vectors else None, moving)
        except Unfit as error:
            raise Unfit(str(error), max_frequency_hz or limit / (2 * np.pi)) from error
        eigenvalues[:, moving], residual[:, moving] = part
        if not np.all(residual <= BELIEVED):
            raise Unfit(
                f"roots leave a backward error of {np.nanmax(residual):.1g} in the full problem",
                max_frequency_hz or limit / (2 * np.pi),
            )
    else:
        residual[:, moving] = np.nan
    # Two real branches that meet become one pair: the one with Im λ ≥ 0 goes on, and the other is there no more.
    partner = eigenvalues.imag < -UNSTABLE_RELATIVE * np.abs(eigenvalues)
    if partner.any():
        eigenvalues[partner], residual[partner], shapes[:, partner] = complex(np.nan, np.nan), np.nan, np.nan
        there = np.flatnonzero(~np.all(partner, axis=0))
        eigenvalues, residual, shapes = eigenvalues[:, there], residual[:, there], shapes[:, :, there]
        columns = columns[there]
    return ComplexModes(
        mu=values,
        eigenvalues=eigenvalues,
        branch=number[columns],
        residual=residual,
        damped=damped,
        right=shapes[0] if vectors else None,
        left=shapes[1] if vectors else None,
        open_contacts=open_contacts,
        max_frequency_hz=max_frequency_hz,
        planned=planned,
    )


def in_order(roots: ComplexArray, top: float) -> IntArray:
    """Places (k,) of roots at μ = 0 in the order in which branches are numbered: by frequency, those whose |λ| is far
    above the band's end top [1/s] last. Such are overdamped ones, too, which have no frequency at all."""
    return np.lexsort((np.abs(roots.imag), np.abs(roots) > FOLLOWED * top))


def _judge_fixed(judge: BackwardError, lam: ComplexArray, vectors: ComplexArray, mu: Array) -> Array:
    """Backward errors (k, b) of the modes that no contact sees: the same at every μ."""
    if not len(lam):
        return np.zeros((len(mu), 0))
    return np.broadcast_to(judge(lam, vectors, 0.0), (len(mu), len(lam)))


def _left_of_fixed(coupling: PointCoupling, lam: ComplexArray, right: ComplexArray, mu: float) -> ComplexArray:
    """Left vectors (n, b) of modes that no contact sees.

    Friction works on the modes' tangential motion, so the left vectors do meet the contacts.
    """
    left, pencil = np.array(right), coupling.pencil(mu)
    for k in range(len(lam)):
        left[:, k] = _refined(pencil, complex(lam[k]), right[:, k], right[:, k])[2]
    return left


def _refined(
    pencil: Pencil, lam: complex, right: ComplexArray, left: ComplexArray
) -> tuple[complex, ComplexArray, ComplexArray]:
    """λ and unit right and left vectors (n,) sharpened on the matrices, where the modal sum has lost digits.

    A root that almost coincides with a pole of the receptance (a mode that hardly feels its contact) makes T the small
    difference of large numbers.
    """
    n = pencil.size
    forces = np.zeros(pencil.nodes)
    # Some of every direction: on a pole the modal sum may lack the very one that is sought.
    spread = np.random.default_rng(0).standard_normal(n) / np.sqrt(n)
    given = [np.append(spread if not np.all(np.isfinite(v)) else v + 1e-3 * spread, forces) for v in (right, left)]
    found = solved_beside(pencil.whole, lam, *given, parts=BESIDE)
    if found is None:
        return lam, right, left
    x, y = found.right[:n], found.left[:n]
    better = found.lam if abs(found.lam - lam) <= NEARBY * abs(lam) else lam
    return better, x / np.linalg.norm(x), y / np.linalg.norm(y)


def _pairs(
    spectrum: ReceptanceProblem,
    judge: BackwardError,
    eigenvalues: ComplexArray,
    mu: Array,
    shapes: ComplexArray | None,
    columns: IntArray,
) -> tuple[ComplexArray, Array]:
    """Eigenvalues and backward errors (k, b); right and left vectors go to ``columns`` of ``shapes``.

    All pairs of the sweep are one list, worked through in pieces that stay in the cache.
    """
    count = eigenvalues.shape[1]
    if not count:
        return eigenvalues, np.zeros(eigenvalues.shape)
    lam, each = eigenvalues.ravel(), np.repeat(mu, count)
    forces = [modal_coordinates(spectrum, row, float(m)) for row, m in zip(eigenvalues, mu, strict=True)]
    push, pull = (np.concatenate([f[side] for f in forces]) for side in (0, 1))
    errors = np.zeros(len(lam))
    for start in range(0, len(lam), CHUNK):
        part = np.arange(start, min(start + CHUNK, len(lam)))
        right = expand(spectrum, lam[part], push[part])
        errors[part] = judge(lam[part], right, each[part])
        doubtful = np.flatnonzero(~(errors[part] < DOUBTFUL))
        chosen = np.arange(len(part)) if shapes is not None else doubtful
        left = np.zeros_like(right)
        if len(chosen):
            left[:, chosen] = expand(spectrum, lam[part[chosen]], pull[part[chosen]])
        if len(doubtful):
            at = part[doubtful]
            better = closed(spectrum, lam[at], push[at])
            error = judge(lam[at], better, each[at])
            sound = ~(errors[at] <= error) & np.isfinite(error)
            right[:, doubtful[sound]], errors[at[sound]] = better[:, sound], error[sound]
            still = ~(errors[at] < DOUBTFUL)
            if shapes is not None:
                of_left = judge(lam[at], left[:, doubtful], each[at], left=True)
                if not spectrum.coupling.sloped:
                    better = closed(spectrum, lam[at], pull[at], np.multiply.outer(each[at], spectrum.coupling.sense))
                    error = judge(lam[at], better, each[at], left=True)
                    sound = ~(of_left <= error) & np.isfinite(error)
                    left[:, doubtful[sound]], of_left[sound] = better[:, sound], error[sound]
                still |= ~(of_left < DOUBTFUL)
            doubtful = doubtful[still]
        for k in doubtful:
            at = part[k]
            pencil = spectrum.coupling.pencil(float(each[at]))
            value, x, y = _refined(pencil, complex(lam[at]), right[:, k], left[:, k])
            error = float(judge(np.array([value]), x[:, None], each[at])[0])
            if error < errors[at] or not np.isfinite(errors[at]):
                errors[at], lam[at], right[:, k] = error, value, x
            if shapes is not None:
                one = lam[at : at + 1]
                before, after = (judge(one, v[:, None], each[at], left=True)[0] for v in (left[:, k], y))
                if after < before or not np.isfinite(before):
                    left[:, k] = y
        if shapes is not None:
            shapes[0, part // count, columns[part % count]] = right.T
            shapes[1, part // count, columns[part % count]] = left.T
    return lam.reshape(eigenvalues.shape), errors.reshape(eigenvalues.shape)


def _limit(spectrum: ReceptanceProblem, count: int, max_frequency_hz: float | None) -> float:
    """|λ| [1/s] up to which roots must be followed."""
    if max_frequency_hz is not None:
        return 2 * np.pi * max_frequency_hz
    # Interlacing: m contacts shift the k-th frequency by at most m places.
    poles = np.sort(np.sqrt(np.abs(spectrum.modes.stiffness)))
    if spectrum.modes.general:
        poles = np.sort(np.concatenate([poles, np.abs(spectrum.modes.poles[spectrum.modes.poles.imag >= 0])]))
    index = count + spectrum.coupling.contacts
    if index < len(poles):
        return float(poles[index]) * (1 + 1e-9)
    # All of them: contact springs raise the highest frequency by no more than they are stiff.
    soft = spectrum.coupling.compliance > 0
    normal = spectrum.receptance.real[0::2][soft]
    added = np.sum((normal**2).sum(axis=1) / spectrum.coupling.compliance[soft])
    return float(np.sqrt(poles[-1] ** 2 + added)) * (1 + 1e-9)


def unfit_words(spectrum: ReceptanceProblem) -> str:
    """Why roots of the receptance are not sought."""
    if spectrum.modes.no_receptance:
        return spectrum.modes.no_receptance
    if not spectrum.coupling.contacts:
        return "nothing is in contact, and damping that is not proportional leaves no real modes"
    return "modes of the structure that no contact sees have no stiffness to tell them by"
