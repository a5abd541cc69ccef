"""What the modal approach does for a report: modes of the bodies, over friction, at the case's own; onsets; what
a change would do."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np

from ..errors import AnalysisError, CaseError
from ..modal.complex_modes import ComplexModes
from ..modal.krylov import friction_energy
from ..modal.onsets import Onsets
from ..modal.source import by_receptance
from ..typing import Array, ComplexArray
from . import analyses
from .body_modes import BodyModes
from .clock import Clock
from .countermeasures import default_numbers, rank_countermeasures, whole_matrices
from .measures import Countermeasures
from .parts import RunParts
from .sensitivities import Sensitivities, sensitivities
from .workspace import Workspace

T = TypeVar("T")
CURVE_POINTS = 8001
POINTS, FEW_POINTS = 201, 21  # of sweeps over friction, of large matrices that depend on it
SMALL = 100  # freedoms
ZOOM = 2.5  # the sweep around the first onset reaches this many times its μ


@dataclass(frozen=True)
class Squealing:
    """The mode that grows fastest (or decays slowest): vector (n,), λ, energy (m,) that friction feeds in per node."""

    vector: ComplexArray
    eigenvalue: complex
    energy: Array | None


class ModalParts:
    """Sweeps and onsets over friction, and modes at ``mu``. rubs: whether anything depends on friction; cheap: whether
    the source gives modes at any μ for next to nothing, so that the undamped problem, zooms and μ(ω) are there as well;
    else what tells most for its time."""

    def __init__(
        self, work: Workspace, mu: float | None, parts: RunParts, clock: Clock, keep: Callable[[str, object], None],
        notes: list[str],
    ) -> None:  # fmt: skip
        self.work, self.parts, self.clock, self.notes = work, parts, clock, notes
        self.mu = None if mu is None else float(mu)
        self.cheap = not work.varies and by_receptance(work.system(), work.options)
        limit = work.modal.max_frequency_hz
        bodies = self._of("bodies", lambda: dict(analyses.body_modes(work)), "of the bodies alone")
        self.bodies: Mapping[str, BodyModes] = bodies or {}
        self.rubs = work.has_contacts or work.varies
        self.coupled = None
        sweeps: dict[bool, ComplexModes | None] = dict.fromkeys(self._ways)
        if self.rubs:
            self.coupled = self._of("coupled", lambda: _coupled(work), "in contact without friction")
            mus = np.linspace(*work.modal.friction_range, _points(work))
            sweeps = self._each(
                "modes",
                lambda d: analyses.modes(work, mus, max_frequency_hz=limit, damped=d),
                f"{len(mus)} friction coefficients from {mus[0]:g} to {mus[-1]:g}, ",
            )
        # Of an undamped problem the one sweep is both.
        self.bare, self.damped = sweeps.get(False), sweeps[self._ways[-1]]
        if self.damped is not None:
            keep("modes", self.damped)
        onsets = self._onsets()
        self.onsets_bare, self.onsets_damped = onsets.get(False), onsets[self._ways[-1]]
        if self.onsets_damped is not None:
            keep("onsets", self.onsets_damped)
        self.zooms: tuple[ComplexModes | None, ComplexModes | None] = (None, None)
        self.curve: tuple[Array, Array] | None = None
        if self.cheap and self.onsets_bare is not None:
            zooms = self._of("zooms", lambda: _zooms(work, self.onsets_bare), "around the first onset")
            self.zooms = zooms or (None, None)
            self.curve = self._of("curve", lambda: _curve(work), "friction over frequency", part="onsets")
        self.own = self._own(limit)
        self.squealing = self._squealing()
        self.sensitivities = self._sensitivities()
        self.measures = self._measures()

    @property
    def _ways(self) -> tuple[bool, ...]:
        """With damping or without: damped last."""
        return (False, True) if self.cheap else (self.work.modal.damped,)

    def _of(self, label: str, call: Callable[[], T], what: str = "", *, part: str = "modes") -> T | None:
        name = f"{part}-{label}" if label else part
        return self.clock.part(part, name, call, what, wanted=part in self.parts)

    def _each(self, part: str, call: Callable[[bool], T], what: str = "") -> dict[bool, T | None]:
        """The part with damping, without it, or both, as the source allows."""
        words = {d: "damped" if d else "undamped" for d in self._ways}
        return {d: self._of(words[d], partial(call, d), what + words[d], part=part) for d in self._ways}

    def _onsets(self) -> dict[bool, Onsets | None]:
        """None and a note where nothing in the model depends on friction, or they cannot be solved."""
        nothing = dict.fromkeys(self._ways)
        if not self.rubs:
            self._note("no onsets: there are no contacts, and no factor of a matrix has mu in it")
            return nothing
        call = partial(self._each, "onsets", lambda d: analyses.onsets(self.work, damped=d))
        return self._or_note("no onsets", call) or nothing

    def _own(self, limit: float) -> ComplexModes | None:
        """Modes at the friction of the case, None where there is no one such coefficient."""
        mu = self.mu
        if mu is None:
            return None
        call = partial(analyses.modes, self.work, mu, max_frequency_hz=limit, vectors="right")
        return self._of(f"at-{mu!r}", call, f"at μ = {mu:g}")

    def _squealing(self) -> Squealing | None:
        modes = self.own
        if modes is None or modes.right is None:
            return None
        vibrating = np.flatnonzero(modes.frequency_hz[0] > 0)
        if not len(vibrating):
            return None
        system = self.work.system(self.mu)
        fastest = int(vibrating[np.argmax(modes.growth_rate[0][vibrating])])
        energy = None
        if system.contact_nodes().count:
            energy = self._or_note(
                "no energy of friction",
                lambda: friction_energy(system, modes, 0, fastest, options=self.work.options).per_cycle,
            )
        return Squealing(modes.right[0, fastest], complex(modes.eigenvalues[0, fastest]), energy)

    def _sensitivities(self) -> Sensitivities | None:
        """Of all unstable modes, over the numbers that counter-measures try and friction."""
        case = self.work.given
        if case is None or not self._asked("sensitivities"):
            return None
        friction = ["mu"] if self.rubs else []
        numbers = [*friction, *default_numbers(case, whole_matrices(case, self.mu))]
        if not numbers:
            return self._note("there is no number to change")
        return self._changes("sensitivities", lambda: sensitivities(self.work, numbers, mu=self.mu))

    def _measures(self) -> Countermeasures | None:
        if not self._asked("countermeasures"):
            return None
        return self._changes("countermeasures", lambda: rank_countermeasures(self.work, mu=self.mu))

    def _asked(self, part: str) -> bool:
        """Whether a part that needs one friction coefficient can be had; a note where it is wanted and cannot."""
        if self.mu is None and part in self.parts:
            self._note(f"no {part}: there is no one friction coefficient to take them at; name it (--mu)")
        return self.mu is not None

    def _changes(self, part: str, call: Callable[[], T]) -> T | None:
        return self._or_note(f"no {part}", lambda: self._of(f"at-{self.mu!r}", call, part=part))

    def _or_note(self, what: str, call: Callable[[], T]) -> T | None:
        """The result, or None and a note why there is none."""
        try:
            return call()
        except (AnalysisError, CaseError) as error:
            return self._note(f"{what}: {error}")

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)


def _points(work: Workspace) -> int:
    """Friction coefficients of the sweeps. Where matrices depend on them, each is a search of its own: 0.1 s at 360
    freedoms, 0.6 s at 1600."""
    if work.modal.sweep_points is not None:
        return work.modal.sweep_points
    return FEW_POINTS if work.varies and work.system().size > SMALL else POINTS


def _coupled(work: Workspace) -> ComplexModes:
    """In contact without friction, which nothing drives: there is no growth to check."""
    return analyses.modes(work, 0.0, max_frequency_hz=work.modal.max_frequency_hz, damped=False, check=False)


def _zooms(work: Workspace, found: Onsets | None) -> tuple[ComplexModes, ComplexModes] | None:
    """Fine sweeps from 0 past the first onset, without and with damping: for pictures of branches, as they are."""
    if found is None or found.first is None:
        return None
    mus = np.linspace(0.0, ZOOM * found.first.mu, 251)
    limit = work.modal.max_frequency_hz
    bare, damped = (analyses.modes(work, mus, max_frequency_hz=limit, damped=d, check=False) for d in (False, True))
    return bare, damped


def _curve(work: Workspace) -> tuple[Array, Array] | None:
    if len(work.system().contacts) != 1:
        return None
    frequency = np.linspace(0.0, work.modal.max_frequency_hz, CURVE_POINTS)[1:]
    return frequency, analyses.friction_curve(work, frequency)
