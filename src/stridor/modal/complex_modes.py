"""Complex modes of the friction-coupled system at one or many μ, as followed branches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp

from ..errors import AnalysisError, CaseError
from ..system import System
from ..system.uncoupled import uncoupled_modes
from ..threads import one_thread_if_small
from ..typing import Array, BoolArray, ComplexArray, IntArray
from .backward_error import BackwardError
from .coupling import Coupling, couple
from .refinement import refine
from .roots import Spectrum, spectrum_of
from .tracking import Tracker
from .vectors import expand, fixed_vectors, modal_coordinates

CHUNK = 256
DOUBTFUL = 1e-11  # backward errors above it are refined on the assembled matrices
UNSTABLE_RELATIVE = 1e-9  # of |λ|: below it a real part is rounding


@dataclass(frozen=True)
class ComplexModes:
    """Modes over μ (k,), one column per branch (b,).

    eigenvalues λ (k, b) [1/s]: growth rate + j angular frequency. branch (b,) numbers the modes from
    1 by frequency at μ = 0. residual (k, b): componentwise backward error in the assembled matrices.
    right, left (k, b, n) unit vectors where asked for, else None. damped: whether C was used.
    open_contacts: contacts that carry no load in steady sliding and so take no part. completeness: of matrices without
    structure, for each μ what speaks for no mode of the band being missed, and what the numbers are if branches could
    not be followed; where a branch has left the band there is NaN. contact_state: where contacts may stick, how many
    nodes stick, slip and are open, and at which μ; they do so at every μ of the list.
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
        return self.eigenvalues.real > UNSTABLE_RELATIVE * np.maximum(np.abs(self.eigenvalues), 1.0)

    def at(self, mu: float) -> int:
        """Row of the μ nearest to ``mu``."""
        return int(np.argmin(np.abs(self.mu - mu)))

    def to_json(self) -> dict[str, Any]:
        """The document that `stridor modes --json` prints."""
        rows: list[list[dict[str, Any]]] = []
        for k in range(len(self.mu)):
            order = np.argsort(self.frequency_hz[k], kind="stable")
            rows.append(
                [
                    {
                        "frequency_hz": float(self.frequency_hz[k, b]),
                        "growth_rate": float(self.growth_rate[k, b]),
                        "damping_ratio": float(self.damping_ratio[k, b]),
                        "unstable": bool(self.unstable[k, b]),
                        "residual": float(self.residual[k, b]),
                        "branch": int(self.branch[b]),
                    }
                    for b in order
                    if np.isfinite(self.eigenvalues[k, b])
                ]
            )
        return {
            "mu": [float(m) for m in self.mu],
            "modes": rows,
            "damped": self.damped,
            "open_contacts": list(self.open_contacts),
            **({"completeness": list(self.completeness)} if self.completeness else {}),
            **({"contact_state": self.contact_state} if self.contact_state else {}),
        }


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
) -> ComplexModes:
    """Modes at the friction coefficients ``mu``, branches followed from μ = 0.

    count: how many branches, lowest frequencies at μ = 0 first; max_frequency_hz instead takes all
    that start below it. vectors keeps left and right ones, "right" those alone where that saves time. Large
    systems and contacts over surfaces are solved on the assembled matrices (`modal.assembled`); friction_damping
    (across the direction of sliding), prestress and the direct solver matter there only. Raises AnalysisError where
    contacts do not slide, have no equilibrium, or branches cannot be told apart.
    """
    values = np.atleast_1d(np.asarray(mu, dtype=float))
    if values.ndim != 1 or not len(values) or not np.all(np.isfinite(values)) or np.any(values < 0):
        raise CaseError("mu", mu, "friction coefficients are numbers ≥ 0, at least one")
    if system.general:
        from .assembled import Options
        from .general import general_modes

        if max_frequency_hz is None:
            raise CaseError("max_frequency_hz", None, f"missing – {system.general}: modes are sought in a band")
        return general_modes(
            lambda _: system,
            values,
            count=None,
            max_frequency_hz=max_frequency_hz,
            damped=damped,
            vectors=vectors,
            options=Options(friction_damping=friction_damping, prestress=prestress, solver=solver),
        )
    if system.assembled:
        from .assembled import Options, complex_modes_assembled

        return complex_modes_assembled(
            system,
            values,
            count=count,
            max_frequency_hz=max_frequency_hz,
            damped=damped,
            vectors=vectors,
            options=Options(friction_damping=friction_damping, prestress=prestress, solver=solver),
        )
    if not damped:
        system = undamped(system)
    spectrum, coupling, open_contacts = prepare(system, mu=float(values.max()) if len(values) == 1 else None)
    limit = _limit(spectrum, count, max_frequency_hz)
    if not limit > 0.0:
        raise AnalysisError("nothing in the system oscillates: it has no stiffness at all")
    tracker = Tracker(spectrum, limit)
    order = np.argsort(values, kind="stable")
    start = tracker.origin
    followed = np.zeros((len(values), len(start)), dtype=complex)
    for k in order:
        followed[k] = tracker.advance(float(values[k])).roots[: len(start)]
    fixed = spectrum.fixed
    columns = np.argsort(np.abs(np.concatenate([start, fixed]).imag), kind="stable")
    if max_frequency_hz is None:
        columns = columns[:count]
    else:
        columns = columns[np.concatenate([start, fixed])[columns].imag <= 2 * np.pi * max_frequency_hz]
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
        branch=np.arange(1, len(columns) + 1),
        residual=residual,
        damped=damped,
        right=shapes[0] if vectors else None,
        left=shapes[1] if vectors else None,
        open_contacts=open_contacts,
    )


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
    poles = np.sort(np.sqrt(spectrum.modes.stiffness))
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
