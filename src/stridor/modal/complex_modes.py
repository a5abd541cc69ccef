"""Complex modes of the friction-coupled system at one or many μ, as followed branches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from ..errors import CaseError
from ..system import System
from ..typing import Array, ComplexArray, IntArray
from .backward_error import BackwardError
from .coupling import Coupling, couple
from .roots import Spectrum, spectrum_of
from .tracking import Tracker
from .uncoupled import uncoupled_modes
from .vectors import expand, fixed_vectors, modal_coordinates

CHUNK = 256
UNSTABLE_RELATIVE = 1e-9  # of |λ|: below it a real part is rounding


@dataclass(frozen=True)
class ComplexModes:
    """Modes over μ (k,), one column per branch (b,).

    eigenvalues λ (k, b) [1/s]: growth rate + j angular frequency. branch (b,) numbers the modes from
    1 by frequency at μ = 0. residual (k, b): componentwise backward error in the assembled matrices.
    right, left (k, b, n) unit vectors where asked for, else None. damped: whether C was used.
    open_contacts: contacts that carry no load in steady sliding and so take no part.
    """

    mu: Array
    eigenvalues: ComplexArray
    branch: IntArray
    residual: Array
    damped: bool
    right: ComplexArray | None = None
    left: ComplexArray | None = None
    open_contacts: tuple[str, ...] = ()
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
    def unstable(self) -> Array:
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
                ]
            )
        return {
            "mu": [float(m) for m in self.mu],
            "modes": rows,
            "damped": self.damped,
            "open_contacts": list(self.open_contacts),
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


def complex_modes(
    system: System,
    mu: float | Sequence[float] | Array,
    *,
    count: int = 20,
    max_frequency_hz: float | None = None,
    damped: bool = True,
    vectors: bool = False,
) -> ComplexModes:
    """Modes at the friction coefficients ``mu``, branches followed from μ = 0.

    count: how many branches, lowest frequencies at μ = 0 first; max_frequency_hz instead takes all
    that start below it. vectors keeps left and right ones. Raises AnalysisError where contacts do
    not slide, have no equilibrium, or branches cannot be told apart.
    """
    values = np.atleast_1d(np.asarray(mu, dtype=float))
    if values.ndim != 1 or not len(values) or not np.all(np.isfinite(values)) or np.any(values < 0):
        raise CaseError("mu", mu, "friction coefficients are numbers ≥ 0, at least one")
    if not damped:
        system = undamped(system)
    spectrum, coupling, open_contacts = prepare(system, mu=float(values.max()) if len(values) == 1 else None)
    tracker = Tracker(spectrum, _limit(spectrum, count, max_frequency_hz))
    order = np.argsort(values, kind="stable")
    followed = np.zeros((len(values), len(tracker.state.roots)), dtype=complex)
    start = tracker.state.roots
    for k in order:
        followed[k] = tracker.advance(float(values[k])).roots
    fixed = spectrum.fixed
    columns = np.argsort(np.abs(np.concatenate([start, fixed]).imag), kind="stable")
    if max_frequency_hz is None:
        columns = columns[:count]
    else:
        columns = columns[np.concatenate([start, fixed])[columns].imag <= 2 * np.pi * max_frequency_hz]
    everything = np.hstack([followed, np.broadcast_to(fixed, (len(values), len(fixed)))])
    judge = BackwardError(coupling)
    residual = np.zeros((len(values), len(columns)))
    right = left = None
    if vectors:
        right = np.zeros((len(values), len(columns), system.size), dtype=complex)
        left = np.zeros_like(right)
    constant = fixed_vectors(spectrum)
    moving = columns[columns < len(start)]
    place = {int(c): k for k, c in enumerate(columns)}
    at_moving = [place[int(c)] for c in moving]
    for column in columns[columns >= len(start)]:
        k = place[int(column)]
        shape = constant[:, [column - len(start)]].astype(complex)
        residual[:, k] = judge(fixed[[column - len(start)]], shape, 0.0)
        if right is not None and left is not None:
            right[:, k] = shape[:, 0]
            left[:, k] = shape[:, 0]
    # All pairs of the sweep in one list, worked through in pieces that stay in the cache.
    lam = followed[:, moving].ravel()
    each = np.repeat(values, len(moving))
    forces = [modal_coordinates(spectrum, followed[row, moving], float(m)) for row, m in enumerate(values)]
    push, pull = (np.concatenate([f[side] for f in forces]) for side in (0, 1))
    flat = np.zeros(len(lam))
    for start_at in range(0, len(lam), CHUNK):
        part = slice(start_at, start_at + CHUNK)
        u = expand(spectrum, lam[part], push[part])
        flat[part] = judge(lam[part], u, each[part])
        if right is not None and left is not None:
            where = np.arange(len(lam))[part]
            rows, columns_at = where // len(moving), np.array(at_moving)[where % len(moving)]
            right[rows, columns_at] = u.T
            left[rows, columns_at] = expand(spectrum, lam[part], pull[part]).T
    residual[:, at_moving] = flat.reshape(len(values), len(moving))
    return ComplexModes(
        mu=values,
        eigenvalues=everything[:, columns],
        branch=np.arange(1, len(columns) + 1),
        residual=residual,
        damped=damped,
        right=right,
        left=left,
        open_contacts=open_contacts,
    )


def _limit(spectrum: Spectrum, count: int, max_frequency_hz: float | None) -> float:
    """|λ| [1/s] up to which roots must be followed."""
    if max_frequency_hz is not None:
        return 2 * np.pi * max_frequency_hz
    # Interlacing: m contacts shift the k-th frequency by at most m places.
    poles = np.sort(np.sqrt(spectrum.modes.stiffness))
    if spectrum.modes.general:
        poles = np.sort(np.concatenate([poles, np.abs(spectrum.modes.poles[spectrum.modes.poles.imag >= 0])]))
    place = min(count + spectrum.coupling.contacts, len(poles) - 1)
    return float(poles[place]) * (1 + 1e-9)
