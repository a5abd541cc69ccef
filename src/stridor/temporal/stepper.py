"""What a method of time stepping offers to the march; a new one is a folder of `steppers` that offers the same."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from ..system import System
from ..typing import Array
from .beta2 import Scheme, StepLimit
from .node_history import NodeHistory
from .saved import Bounds
from .schedule import Schedule
from .settings import Settings
from .sketch import SketchPart
from .trajectory import Trajectory

# Displacement, velocity and acceleration (n,) added to the initial state.
Disturbance = tuple[Array, Array, Array]


class Recorded(Protocol):
    """Decimated output: contacts (r, m, ≥ 5), watch (r, w, 3) of u, v, a, energies (r, ≥ 7), by `columns`."""

    @property
    def contacts(self) -> Array: ...
    @property
    def watch(self) -> Array: ...
    @property
    def energies(self) -> Array: ...


class Stepper(Protocol):
    """A system made ready to march, and its state.

    path names it and reason says why it was chosen; limit is that of the step, parts what tells one model from another.
    """

    path: str
    scheme: Scheme
    limit: StepLimit
    parts: tuple[SketchPart, ...]

    @property
    def reason(self) -> str:
        """Why it is this one, and at the end what it did on the way that is to be known."""
        ...

    @property
    def works(self) -> Mapping[str, int]:
        """Columns of the works [J] behind the energies of a record, by name."""
        ...

    @property
    def system(self) -> System:
        """What is marched."""
        ...

    @property
    def done(self) -> int:
        """Steps done."""
        ...

    @property
    def contact_names(self) -> Sequence[str]:
        """Contacts, m of them."""
        ...

    @property
    def closed(self) -> Sequence[bool]:
        """Which of them are kept closed; () where none is."""
        ...

    @property
    def statistics(self) -> Array:
        """Of every step since the phase began (m, 8), see `columns`."""
        ...

    @property
    def threaded(self) -> bool:
        """Whether a step is long enough for two threads."""
        ...

    def use_threads(self, *, two: bool) -> None:
        """Take one thread or two, which changes no number."""
        ...

    def begin(self, schedule: Schedule, settings: Settings, disturbance: Disturbance | None) -> None:
        """Take the initial state. Raises CaseError for a ramp out of steady sliding."""
        ...

    def state(self) -> dict[str, Array]:
        """All that moves on from step to step, by name: what a restart needs. The arrays themselves."""
        ...

    def bounds(self) -> Bounds:
        """What a state must stay within: what is counted, and what points into arrays."""
        ...

    @property
    def counted(self) -> tuple[str, int]:
        """Array of the state and place in it where the steps done are."""
        ...

    def check(self, restart: Trajectory) -> None:
        """Raise CaseError where a state of the same model and scheme does not fit all the same."""
        ...

    def resume(self, restart: Trajectory, schedule: Schedule, *, changed: bool) -> None:
        """Take up a state that was checked; changed: loads, friction and speeds may differ from those it had."""
        ...

    def make_room(self, schedule: Schedule, settings: Settings) -> None:
        """Room for all records from the present step on; loads the compiled loop."""
        ...

    @property
    def record(self) -> Recorded:
        """What was recorded, and room for more."""
        ...

    @property
    def recorded(self) -> int:
        """How many records are filled."""
        ...

    def advance(self, steps: int, schedule: Schedule, phase: str) -> None:
        """Up to so many steps. Raises AnalysisError where the motion cannot go on, with when and what to do."""
        ...

    def velocity(self) -> Array:
        """Velocity (n,) [m/s, rad/s] of the freedoms, β2 of a step before the present."""
        ...

    def node_history(self, start: int) -> NodeHistory | None:
        """Records of single contact nodes where it keeps them; start: number of the first record."""
        ...

    @property
    def sweeps(self) -> tuple[int, int]:
        """Most sweeps over the contacts in a step, and the steps in which they did not settle."""
        ...
