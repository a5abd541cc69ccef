"""Complex modes of the friction-coupled system at one or many μ, as followed branches."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import scipy.sparse as sp

from ..errors import AnalysisError, CaseError, FollowingError
from ..system import System
from ..system.uncoupled import uncoupled_modes
from ..threads import one_thread_if_small
from ..typing import Array, BoolArray, ComplexArray, IntArray
from .backward_error import BackwardError
from .coupling import Coupling, couple
from .quadratic.find import WHOLE
from .refinement import refine
from .roots import Spectrum, spectrum_of
from .tracking import Tracker
from .vectors import expand, fixed_vectors, modal_coordinates

if TYPE_CHECKING:
    from .assembled import Options

CHUNK = 256
MOST_BYTES = 4e9  # of eigenvalues and vectors held at one time
DOUBTFUL = 1e-11  # backward errors above it are refined on the assembled matrices
UNSTABLE_RELATIVE = 1e-9  # of |λ|: below it a real part is rounding
LEAST = 1e-5  # of the band: what |λ| is taken to be at least for that
BORDER = 1e-12  # of the band: what rounding may put a mode outside by

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class ComplexModes:
    """Modes over μ (k,), one column per branch (b,).

    eigenvalues λ (k, b) [1/s]: growth rate + j angular frequency. branch (b,) numbers the modes from
    1 by frequency at μ = 0. residual (k, b): componentwise backward error in the assembled matrices.
    right, left (k, b, n) unit vectors where asked for, else None. damped: whether C was used.
    open_contacts: contacts that carry no load in steady sliding and so take no part. completeness: of matrices without
    structure, for each μ what speaks for no mode of the band being missed, and what the numbers are if branches could
    not be followed; of all others which of these μ were checked in the full problem. Where a branch is not known there
    is NaN. max_frequency_hz: the end of the band, None where modes were counted; ``held`` (k,): how many modes of the
    band there are at each μ, where not all of them are kept here. notes: what else is to be known. planned: how many μ
    were asked for, where it was interrupted before the last. contact_state: where contacts may stick, how many nodes
    stick, slip and are open, and at which μ; they do so at every μ of the list.
    """

    mu: Array
    eigenvalues: ComplexArray
    branch: IntArray
    residual: Array
    damped: bool
    right: ComplexArray | None = None
    left: ComplexArray | None = None
    open_contacts: tuple[str, ...] = ()
    completeness: tuple[str, ...] = ()
    contact_state: str = ""
    provenance: dict[str, Any] = field(default_factory=dict)
    max_frequency_hz: float | None = None
    held: IntArray | None = None
    notes: tuple[str, ...] = ()
    planned: int | None = None

    @property
    def frequency_hz(self) -> Array:
        """Im λ / 2π (k, b)."""
        return self.eigenvalues.imag / (2 * np.pi)

    @property
    def growth_rate(self) -> Array:
        """Re λ (k, b) [1/s], positive when unstable."""
        return self.eigenvalues.real

    @property
    def damping_ratio(self) -> Array:
        """−Re λ/|λ| (k, b)."""
        size = np.abs(self.eigenvalues)
        return -np.divide(self.eigenvalues.real, size, out=np.zeros_like(size), where=size > 0)

    @property
    def unstable(self) -> BoolArray:
        """Whether Re λ > 0 beyond rounding (k, b)."""
        return grows(self.eigenvalues, self._top)

    @property
    def _top(self) -> float:
        """The highest angular frequency [1/s] that matters, which says what is none."""
        if self.max_frequency_hz is not None:
            return 2 * np.pi * self.max_frequency_hz
        size = np.abs(self.eigenvalues)
        return float(size[np.isfinite(size)].max(initial=0.0))

    @property
    def in_band(self) -> BoolArray:
        """Whether a mode is known at a μ and of a frequency of the band (k, b)."""
        known = np.isfinite(self.eigenvalues)
        if self.max_frequency_hz is None:
            return known
        return known & (self.frequency_hz <= self.max_frequency_hz * (1 + BORDER))

    @property
    def total(self) -> IntArray:
        """How many modes of the band there are at each μ (k,), kept here or not."""
        return self.in_band.sum(axis=1) if self.held is None else self.held

    @property
    def interrupted(self) -> bool:
        """Whether friction coefficients that were asked for are missing."""
        return self.planned is not None

    def chosen(self, columns: IntArray) -> ComplexModes:
        """These columns (c,) alone."""
        return replace(
            self,
            eigenvalues=self.eigenvalues[:, columns],
            branch=self.branch[columns],
            residual=self.residual[:, columns],
            right=None if self.right is None else self.right[:, columns],
            left=None if self.left is None else self.left[:, columns],
        )

    def lowest(self, count: int) -> ComplexModes:
        """The ``count`` branches of lowest number, and every other one that is unstable in the band at some μ."""
        unstable = np.any(self.unstable & self.in_band, axis=0)
        first = np.arange(len(self.branch)) < count
        return replace(self.chosen(np.flatnonzero(first | unstable)), held=self.total)

    def order(self, row: int, sort: Literal["frequency", "growth"] = "frequency") -> IntArray:
        """Columns of the modes of the band at one μ, by frequency, or the fastest growing first."""
        inside = np.flatnonzero(self.in_band[row])
        keys = self.frequency_hz[row, inside] if sort == "frequency" else -self.growth_rate[row, inside]
        return inside[np.argsort(keys, kind="stable")]

    def at(self, mu: float) -> int:
        """Row of the μ nearest to ``mu``."""
        return int(np.argmin(np.abs(self.mu - mu)))

    def to_json(
        self, *, sort: Literal["frequency", "growth"] = "frequency", unstable: bool = False
    ) -> dict[str, Any]:
        """The document that `stridor modes --json` prints; ``unstable``: of these modes alone."""
        rows: list[list[dict[str, Any]]] = []
        marks, ratio = self.unstable, self.damping_ratio
        for k in range(len(self.mu)):
            rows.append(
                [
                    {
                        "frequency_hz": float(self.frequency_hz[k, b]),
                        "growth_rate": float(self.growth_rate[k, b]),
                        "damping_ratio": float(ratio[k, b]),
                        "unstable": bool(marks[k, b]),
                        "residual": float(self.residual[k, b]),
                        "branch": int(self.branch[b]),
                    }
                    for b in self.order(k, sort)
                    if marks[k, b] or not unstable
                ]
            )
        return {
            "mu": [float(m) for m in self.mu],
            "modes": rows,
            "unstable_modes": np.sum(marks & self.in_band, axis=1).tolist(),
            "modes_in_band": self.total.tolist(),
            "max_frequency_hz": self.max_frequency_hz,
            "damped": self.damped,
            "open_contacts": list(self.open_contacts),
            **({"completeness": list(self.completeness)} if self.completeness else {}),
            **({"contact_state": self.contact_state} if self.contact_state else {}),
            **({"notes": list(self.notes)} if self.notes else {}),
            **({"interrupted_of": self.planned} if self.planned is not None else {}),
        }


def grows(values: ComplexArray, top: float) -> BoolArray:
    """Whether Re λ > 0 beyond rounding, of a problem whose highest frequency of interest is top [1/s]."""
    with np.errstate(invalid="ignore"):
        return values.real > UNSTABLE_RELATIVE * np.maximum(np.abs(values), LEAST * top)


def undamped(system: System) -> System:
    """The same system without structural damping (paper eq. 5)."""
    empty = sp.csr_array(system.damping.shape)
    motion = replace(
        system.motion,
        damping=np.zeros_like(system.motion.damping),
        damping_own=np.zeros_like(system.motion.damping_own),
    )
    return replace(system, damping=empty, motion=motion)


def prepare(system: System, *, mu: float | None = None) -> tuple[Spectrum, Coupling, tuple[str, ...]]:
    """Spectrum of a system with the contacts that touch in steady sliding at ``mu``."""
    coupling, open_contacts = couple(system, mu=mu)
    modes = uncoupled_modes(coupling.system)
    return spectrum_of(coupling, modes), coupling, open_contacts


@one_thread_if_small
def complex_modes(
    system: System,
    mu: float | Sequence[float] | Array,
    *,
    count: int = 20,
    max_frequency_hz: float | None = None,
    damped: bool = True,
    vectors: bool | Literal["right"] = False,
    friction_damping: bool = False,
    prestress: bool = False,
    solver: str | None = None,
    progress: Progress | None = None,
) -> ComplexModes:
    """Modes at the friction coefficients ``mu``, branches followed from μ = 0.

    count: how many branches, lowest frequencies at μ = 0 first; max_frequency_hz instead takes all that start below it,
    and those that start a little above and come below it at one of these μ. vectors keeps left and right ones, "right"
    those alone where that saves time. Large systems and contacts over surfaces are solved on the assembled matrices
    (`modal.assembled`), those whose stiffness is not positive as matrices without structure (`modal.general`);
    friction_damping (across the direction of sliding), prestress and the direct solver matter there only. progress is
    called with the number of μ done and of all; on KeyboardInterrupt what is done is returned, ``planned`` tells of how
    many. Raises AnalysisError where contacts do not slide, have no equilibrium, or branches cannot be told apart,
    CaseError for more numbers than memory holds.
    """
    values = np.atleast_1d(np.asarray(mu, dtype=float))
    if values.ndim != 1 or not len(values) or not np.all(np.isfinite(values)) or np.any(values < 0):
        raise CaseError("mu", mu, "friction coefficients are numbers ≥ 0, at least one")
    from .assembled import Options

    options = Options(friction_damping=friction_damping, prestress=prestress, solver=solver)
    if system.general:
        if max_frequency_hz is None:
            raise CaseError("max_frequency_hz", None, f"missing – {system.general}: modes are sought in a band")
        return _as_general(system, values, None, max_frequency_hz, damped, vectors, options, progress)
    if system.assembled:
        from .assembled import NotPositive, complex_modes_assembled

        try:
            return complex_modes_assembled(
                system, values, count=count, max_frequency_hz=max_frequency_hz, damped=damped, vectors=vectors,
                options=options, progress=progress,
            )  # fmt: skip
        except NotPositive:
            if max_frequency_hz is None:
                raise
            return _as_general(system, values, None, max_frequency_hz, damped, vectors, options, progress)
        except FollowingError as error:
            if max_frequency_hz is None or system.size > WHOLE:
                raise
            return _as_general(
                system, values, None, max_frequency_hz, damped, vectors, options, progress, _short(error)
            )
    whole = system
    if not damped:
        system = undamped(system)
    spectrum, coupling, open_contacts = prepare(system, mu=float(values.max()) if len(values) == 1 else None)
    if spectrum.modes.indefinite or (spectrum.unseen and coupling.contacts):
        band = max_frequency_hz or _limit(spectrum, count, None) / (2 * np.pi)
        chosen = count if max_frequency_hz is None else None
        return _as_general(whole, values, chosen, band, damped, vectors, options, progress)
    limit = _limit(spectrum, count, max_frequency_hz)
    if not limit > 0.0:
        raise AnalysisError("nothing in the system oscillates: it has no stiffness at all")
    tracker = Tracker(spectrum, limit)
    start, fixed = tracker.origin, spectrum.fixed
    require_memory(len(values), len(start) + len(fixed), system.size if vectors else 0)
    try:
        values, followed, planned = _followed(tracker, values, progress)
    except FollowingError as error:
        if max_frequency_hz is None or system.size > WHOLE:
            raise
        return _as_general(whole, values, None, max_frequency_hz, damped, vectors, options, progress, _short(error))
    every = np.concatenate([start, fixed])
    columns = np.argsort(np.abs(every.imag), kind="stable")
    number = np.empty(len(columns), dtype=np.int64)
    number[columns] = np.arange(1, len(columns) + 1)
    if max_frequency_hz is None:
        columns = columns[:count]
    else:
        top = 2 * np.pi * max_frequency_hz
        lowest = np.concatenate([followed.imag.min(axis=0), fixed.imag])
        columns = columns[(every.imag[columns] <= top) | (np.abs(lowest[columns]) <= top)]
    moving = np.flatnonzero(columns < len(start))
    still = np.flatnonzero(columns >= len(start))
    eigenvalues = np.empty((len(values), len(columns)), dtype=complex)
    eigenvalues[:, moving] = followed[:, columns[moving]]
    eigenvalues[:, still] = fixed[columns[still] - len(start)]
    judge = BackwardError(coupling)
    residual = np.zeros((len(values), len(columns)))
    shapes = np.zeros((2, len(values), len(columns), system.size if vectors else 0), dtype=complex)
    constant = fixed_vectors(spectrum)[:, columns[still] - len(start)].astype(complex)
    residual[:, still] = _judge_fixed(judge, spectrum, eigenvalues[0, still], constant, values)
    if vectors:
        shapes[0][:, still] = constant.T
        for row, m in enumerate(values):
            shapes[1][row, still] = _left_of_fixed(coupling, eigenvalues[0, still], constant, float(m)).T
    part = _pairs(spectrum, judge, eigenvalues[:, moving], values, shapes if vectors else None, moving)
    eigenvalues[:, moving], residual[:, moving] = part
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


def _short(error: FollowingError) -> str:
    """What is the matter, without the advice, which is for those who get no answer."""
    return str(error).partition(";")[0]


def _as_general(
    system: System,
    values: Array,
    count: int | None,
    max_frequency_hz: float,
    damped: bool,
    vectors: bool | Literal["right"],
    options: Options,
    progress: Progress | None,
    unfollowed: str = "",
) -> ComplexModes:
    """Modes of matrices of any structure; unfollowed: why branches are not followed, where that was tried."""
    from .general import general_modes

    return general_modes(
        lambda _: system,
        values,
        count=count,
        max_frequency_hz=max_frequency_hz,
        damped=damped,
        vectors=vectors,
        options=options,
        progress=progress,
        unfollowed=unfollowed,
    )


def _followed(
    tracker: Tracker, values: Array, progress: Progress | None
) -> tuple[Array, ComplexArray, int | None]:
    """μ (k,), roots (k, b), and how many μ there were to be where it was interrupted."""
    start, asked = tracker.origin, len(values)
    followed = np.zeros((asked, len(start)), dtype=complex)
    done = np.zeros(asked, dtype=bool)
    try:
        for at, k in enumerate(np.argsort(values, kind="stable"), start=1):
            followed[k] = tracker.advance(float(values[k])).roots[: len(start)]
            done[k] = True
            if progress is not None:
                progress(at, asked)
    except KeyboardInterrupt:
        if not done.any():
            raise
    if done.all():
        return values, followed, None
    return values[done], followed[done], asked


def require_memory(rows: int, columns: int, freedoms: int = 0) -> None:
    """Raise CaseError where modes at that many μ, with vectors of so many freedoms, take more memory than there is to
    be had."""
    needed = 64.0 * rows * columns + 32.0 * rows * columns * freedoms
    if needed > MOST_BYTES:
        fits = int(rows * MOST_BYTES / needed)
        raise CaseError(
            "mu", f"{rows} friction coefficients",
            f"at most {fits} of them: with {columns} modes each takes {needed / rows / 1e3:.3g} kB, all of them "
            f"{needed / 1e9:.3g} GB of {MOST_BYTES / 1e9:g} GB; take fewer, or a lower modal.max_frequency_hz",
        )  # fmt: skip


def _judge_fixed(
    judge: BackwardError, spectrum: Spectrum, lam: ComplexArray, vectors: ComplexArray, mu: Array
) -> Array:
    """Backward errors (k, b) of the modes that no contact sees: the same at every μ."""
    if not len(lam):
        return np.zeros((len(mu), 0))
    return np.broadcast_to(judge(lam, vectors, 0.0), (len(mu), len(lam)))


def _left_of_fixed(coupling: Coupling, lam: ComplexArray, right: ComplexArray, mu: float) -> ComplexArray:
    """Left vectors (n, b) of modes that no contact sees.

    Friction works on the modes' tangential motion, so the left vectors do meet the contacts.
    """
    left = np.array(right)
    for k in range(len(lam)):
        left[:, k] = refine(coupling, complex(lam[k]), right[:, k], right[:, k], mu)[2]
    return left


def _pairs(
    spectrum: Spectrum,
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
        for k in doubtful:
            at = part[k]
            value, x, y = refine(
                spectrum.coupling, complex(lam[at]), right[:, k], left[:, k], float(each[at])
            )
            error = float(judge(np.array([value]), x[:, None], each[at])[0])
            if error < errors[at] or not np.isfinite(errors[at]):
                errors[at], lam[at], right[:, k], left[:, k] = error, value, x, y
        if shapes is not None:
            shapes[0, part // count, columns[part % count]] = right.T
            shapes[1, part // count, columns[part % count]] = left.T
    return lam.reshape(eigenvalues.shape), errors.reshape(eigenvalues.shape)


def _limit(spectrum: Spectrum, count: int, max_frequency_hz: float | None) -> float:
    """|λ| [1/s] up to which roots must be followed."""
    if max_frequency_hz is not None:
        return 2 * np.pi * max_frequency_hz
    # Interlacing: m contacts shift the k-th frequency by at most m places.
    poles = np.sort(np.sqrt(np.abs(spectrum.modes.stiffness)))
    if spectrum.modes.general:
        poles = np.sort(np.concatenate([poles, np.abs(spectrum.modes.poles[spectrum.modes.poles.imag >= 0])]))
    place = count + spectrum.coupling.contacts
    if place < len(poles):
        return float(poles[place]) * (1 + 1e-9)
    # All of them: contact springs raise the highest frequency by no more than they are stiff.
    soft = spectrum.coupling.compliance > 0
    normal = spectrum.receptance.real[0::2][soft]
    added = np.sum((normal**2).sum(axis=1) / spectrum.coupling.compliance[soft])
    return float(np.sqrt(poles[-1] ** 2 + added)) * (1 + 1e-9)
