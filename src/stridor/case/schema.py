"""The tables of a case file. SI units; a name with another unit says it (`angle_deg`, `frequency_hz`).

Each description completes the sentence "must be …" and is what a user reads when a value is refused; that
of a table of values says after ", each " what one of them must be. Rules that take more than one value (a
ramp longer than its phase, a point that does not exist) are in `checks`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from ..laws import Coulomb, FrictionLaw, Material, Rayleigh, RectangularSection, StaticKinetic, Weakening

NAME_RULE = "a letter, then letters, digits, _ or -"

Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]*$")]
Label = Annotated[str, Field(min_length=1)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0)]
NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0)]
Truth = Annotated[bool, Field(strict=True)]
Vector = tuple[Number, Number]
Direction = Literal["x", "y", "rotation"]

POINT = 'a point, "body.point" or "body@distance"'


class Table(BaseModel):
    """A table of the case file: frozen, and without keys it does not know."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class MaterialTable(Table):
    """[materials.NAME]: an isotropic linear elastic material."""

    young_modulus: Positive = Field(description="a number > 0 [Pa], Young's modulus")
    density: Positive = Field(description="a number > 0 [kg/m³], the density")
    poisson_ratio: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=-1, lt=0.5)] = Field(
        default=0.3, description="a number between -1 and 0.5, Poisson's ratio"
    )

    def law_object(self) -> Material:
        """The material as the elements take it."""
        return Material(self.young_modulus, self.density, self.poisson_ratio)


class DampingTable(Table):
    """Rayleigh damping of a body, C = mass · M + stiffness · K."""

    mass: NotNegative = Field(
        default=0.0, description="a number >= 0 [1/s], Rayleigh's factor of the mass matrix"
    )
    stiffness: NotNegative = Field(
        default=0.0, description="a number >= 0 [s], Rayleigh's factor of the stiffness matrix"
    )

    def law_object(self) -> Rayleigh:
        """The damping as a law."""
        return Rayleigh(self.mass, self.stiffness)


class BeamBody(Table):
    """[bodies.NAME] of type "beam": straight, uniform, Euler–Bernoulli with traction, in the x–y plane."""

    type: Literal["beam"] = Field(description='"beam", the type of the body')
    material: str = Field(description="the NAME of a [materials.NAME]")
    start: Vector = Field(description="[x, y], two numbers [m]: where the beam starts")
    angle_deg: Number | None = Field(
        default=None, description="a number [degrees], the direction of the axis counter-clockwise from +x"
    )
    length: Positive | None = Field(default=None, description="a number > 0 [m], the length along the axis")
    end: Vector | None = Field(
        default=None,
        description="[x, y], two numbers [m]: where the beam ends, instead of angle_deg and length",
    )
    width: Positive = Field(description="a number > 0 [m], the width out of the plane")
    thickness: Positive = Field(description="a number > 0 [m], the thickness in the plane of bending")
    elements: Annotated[int, Field(strict=True, ge=1, le=100_000)] = Field(
        description="a whole number from 1 to 100000, the number of elements"
    )
    mass: Literal["consistent", "lumped"] = Field(
        default="consistent", description='"consistent" or "lumped" (HRZ), the mass matrix'
    )
    damping: DampingTable = Field(
        default=DampingTable(),
        description="a table { mass = α₁ [1/s], stiffness = α₂ [s] }, Rayleigh damping",
    )
    points: Mapping[Name, NotNegative] = Field(
        default_factory=dict[str, float],
        description="a table of named points, each a number >= 0 [m], the distance along the axis",
    )

    @property
    def length_m(self) -> float:
        """Length of the axis [m], whichever way it was given."""
        if self.end is not None:
            return math.dist(self.start, self.end)
        assert self.length is not None, "a checked beam has an end or a length"
        return self.length

    @property
    def direction(self) -> tuple[float, float]:
        """Unit vector (2,) along the axis from start to end; exact zeros and ones along x and y."""
        if self.end is not None:
            return (self.end[0] - self.start[0]) / self.length_m, (
                self.end[1] - self.start[1]
            ) / self.length_m
        assert self.angle_deg is not None, "a checked beam has an end or an angle"
        quarters, rest = divmod(self.angle_deg % 360.0, 90.0)
        if rest == 0.0:
            return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarters) % 4]
        angle = math.radians(self.angle_deg)
        return math.cos(angle), math.sin(angle)

    @property
    def end_point(self) -> tuple[float, float]:
        """Coordinates (2,) [m] of the end of the axis."""
        return self.end if self.end is not None else self.coordinates(self.length_m)

    def coordinates(self, distance: float) -> tuple[float, float]:
        """Coordinates (2,) [m] of the point of the axis at a distance [m] from the start."""
        return self.start[0] + distance * self.direction[0], self.start[1] + distance * self.direction[1]

    @property
    def point_names(self) -> tuple[str, ...]:
        """Every named point: start, the user's in their order, end."""
        return ("start", *self.points, "end")

    def point_distance(self, name: str) -> float:
        """Distance [m] of a named point from the start. Raises KeyError where there is none of that name."""
        return {**self.points, "start": 0.0, "end": self.length_m}[name]

    @property
    def section(self) -> RectangularSection:
        """The cross-section."""
        return RectangularSection(self.width, self.thickness)


Body = BeamBody  # later Annotated[BeamBody | SolidBody, Field(discriminator="type")]


class Support(Table):
    """[supports.NAME]: degrees of freedom of a point held, or moved with a prescribed velocity."""

    at: str = Field(description=POINT)
    fixed: Annotated[tuple[Direction, ...], Field(min_length=1)] = Field(
        description='a list of "x", "y" and "rotation", at least one: the directions held'
    )
    velocity: Mapping[Direction, Number] = Field(
        default_factory=dict[Direction, float],
        description="a table of prescribed velocities, each a number, x and y [m/s], rotation [rad/s]",
    )


class Load(Table):
    """[loads.NAME]: a force and a moment on a point, in global directions."""

    at: str = Field(description=POINT)
    force: Vector = Field(default=(0.0, 0.0), description="[x, y], two numbers [N]: the force")
    moment: Number = Field(default=0.0, description="a number [N m], the moment, counter-clockwise")


_COEFFICIENT = "a number >= 0, the friction coefficient while sliding"
_STATIC = "a number >= coefficient, the friction coefficient to overcome before sliding"


class CoulombTable(Table):
    """One friction coefficient."""

    law: Literal["coulomb"] = Field(
        description='"coulomb", "static-kinetic" or "weakening", the law of friction'
    )
    coefficient: NotNegative = Field(description=_COEFFICIENT)

    def law_object(self) -> FrictionLaw:
        """The friction as a law."""
        return Coulomb(self.coefficient)


class StaticKineticTable(Table):
    """One friction coefficient while sliding, another one to overcome before."""

    law: Literal["static-kinetic"]
    coefficient: NotNegative = Field(description=_COEFFICIENT)
    static_coefficient: NotNegative = Field(description=_STATIC)

    def law_object(self) -> FrictionLaw:
        """The friction as a law."""
        return StaticKinetic(self.coefficient, self.static_coefficient)


class WeakeningTable(Table):
    """A friction coefficient that falls exponentially with slip speed."""

    law: Literal["weakening"]
    coefficient: NotNegative = Field(description="a number >= 0, the friction coefficient at high slip speed")
    static_coefficient: NotNegative = Field(description=_STATIC)
    decay_speed: Positive = Field(
        description="a number > 0 [m/s], the slip speed over which friction weakens"
    )

    def law_object(self) -> FrictionLaw:
        """The friction as a law."""
        return Weakening(self.coefficient, self.static_coefficient, self.decay_speed)


Friction = Annotated[CoulombTable | StaticKineticTable | WeakeningTable, Field(discriminator="law")]


class Contact(Table):
    """[contacts.NAME]: a point of one body (slave) sliding along the line of another (master)."""

    slave: str = Field(description=POINT)
    master: str = Field(description="the NAME of a [bodies.NAME], the body whose line is touched")
    stiffness: Positive | Literal["rigid"] = Field(
        description='a number > 0 [N/m] or "rigid", the normal stiffness'
    )
    sliding: Literal["small", "finite"] = Field(
        default="small", description='"small" (the slave stays where it is on the master) or "finite"'
    )
    side: Literal["left", "right"] | None = Field(
        default=None,
        description='"left" or "right", the side of the master\'s direction on which the slave lies',
    )
    friction: Friction = Field(description='a table such as { law = "coulomb", coefficient = 0.1 }')


class Phase(Table):
    """[[phases]]: a stretch of time with its load and velocity factors; before the first, all are 0.

    A factor not given stays as in the phase before, in the first phase it is 1.
    """

    name: Label = Field(description="a text that is not empty, the name of the phase")
    duration: Positive = Field(description="a number > 0 [s], how long the phase lasts")
    loads: Mapping[str, Number] = Field(
        default_factory=dict[str, float],
        description="a table of loads, each a number, the factor of the load in this phase",
    )
    velocities: Mapping[str, Number] = Field(
        default_factory=dict[str, float],
        description="a table of supports, each a number, the factor of the support's velocity in this phase",
    )
    ramp: NotNegative = Field(
        default=0.0, description="a number >= 0 [s], the time in which the factors change (0: suddenly)"
    )


DEFAULT_PHASES = (Phase(name="run", duration=0.01),)


def _at_least_one_phase(phases: tuple[Phase, ...]) -> tuple[Phase, ...]:
    return phases or DEFAULT_PHASES


Phases = Annotated[tuple[Phase, ...], AfterValidator(_at_least_one_phase)]


class Modal(Table):
    """[modal]: settings of complex modes and onsets."""

    friction_range: tuple[NotNegative, NotNegative] = Field(
        default=(0.0, 1.0), description="[a, b] with 0 <= a < b, where onsets are sought"
    )
    max_frequency_hz: Positive = Field(
        default=40e3, description="a number > 0 [Hz], the highest frequency looked at"
    )
    modes: Annotated[int, Field(strict=True, ge=1)] = Field(
        default=20, description="a whole number >= 1, how many branches are listed"
    )
    sweep_points: Annotated[int, Field(strict=True, ge=2)] = Field(
        default=201, description="a whole number >= 2, how many friction coefficients a sweep takes"
    )
    damped: Truth = Field(default=True, description="true or false, with or without damping")


class Temporal(Table):
    """[temporal]: settings of the simulation in time."""

    step: Positive | None = Field(
        default=None, description="a number > 0 [s], the time step (left out: 0.9 of the stability limit)"
    )
    beta2: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.5, le=1)] = Field(
        default=0.5, description="a number from 0.5 to 1, the scheme's numerical damping"
    )
    record_every: Annotated[int, Field(strict=True, ge=1)] = Field(
        default=25, description="a whole number >= 1, the steps from one recorded state to the next"
    )
    initial: Literal["rest", "steady-sliding"] = Field(
        default="rest", description='"rest" or "steady-sliding", the state at the start'
    )
    perturbation: NotNegative = Field(
        default=0.0,
        description="a number >= 0 [m/s], an extra slip speed of the slave points at the start",
    )
    path: Literal["auto", "modal", "nodal"] = Field(
        default="auto", description='"auto", "modal" or "nodal", the unknowns of the time loop'
    )
    watch: tuple[str, ...] = Field(default=(), description=f"a list of points, each {POINT[8:]}")


class Comparison(Table):
    """[comparison]: what modal and temporal approach are compared at."""

    mu: tuple[NotNegative, ...] = Field(
        default=(),
        description="a list of numbers >= 0, friction coefficients (left out or empty: the case's own)",
    )
    critical: Truth = Field(
        default=True, description="true or false, whether to bisect the temporal critical friction"
    )
    bracket: tuple[NotNegative, NotNegative] | None = Field(
        default=None, description="[a, b] with 0 <= a < b, between which the critical friction is sought"
    )
    tolerance: Positive = Field(default=0.0005, description="a number > 0, where the bisection stops")


class ReferenceFrequency(Table):
    """A published or measured natural frequency."""

    label: str = Field(default="", description="a text, the name of the mode")
    frequency_hz: NotNegative = Field(description="a number >= 0 [Hz], the frequency")
    note: str = Field(default="", description="a text")


class ReferenceOnset(Table):
    """A published or measured onset of instability."""

    frequency_hz: NotNegative = Field(description="a number >= 0 [Hz], the frequency")
    mu: NotNegative = Field(description="a number >= 0, the critical friction coefficient")
    note: str = Field(default="", description="a text")


class ReferenceValue(Table):
    """Any other published or measured number, under a name of the user's choice."""

    name: Label = Field(description="a text that is not empty, the name of the value")
    value: Number = Field(description="a number")
    unit: str = Field(default="", description="a text, the unit")
    note: str = Field(default="", description="a text")


class Reference(Table):
    """[reference]: published or measured values shown beside the computed ones; nothing is fitted to them."""

    source: str = Field(default="", description="a text, where the values come from")
    bodies: Mapping[str, tuple[ReferenceFrequency, ...]] = Field(
        default_factory=dict[str, tuple[ReferenceFrequency, ...]],
        description="a table { NAME = [{ label, frequency_hz, note }, …] }, frequencies of each body alone",
    )
    coupled: tuple[ReferenceFrequency, ...] = Field(
        default=(),
        description="a list of { label, frequency_hz, note }, frequencies in contact without friction",
    )
    onsets: tuple[ReferenceOnset, ...] = Field(default=(), description="a list of { frequency_hz, mu, note }")
    values: tuple[ReferenceValue, ...] = Field(
        default=(), description="a list of { name, value, unit, note }"
    )
    notes: tuple[str, ...] = Field(default=(), description="a list of texts, what to know about the source")
    places: Mapping[str, str] = Field(
        default_factory=dict[str, str],
        description="a table { NAME = \"figure 3\" }, where in the source a figure or table of the report is found",
    )


ENTRIES: Mapping[str, Any] = {
    "materials": MaterialTable,
    "bodies": Body,
    "supports": Support,
    "loads": Load,
    "contacts": Contact,
}
"""Tables of named tables, and what each of their entries is."""
SINGULAR = {
    "materials": "material",
    "bodies": "body",
    "supports": "support",
    "loads": "load",
    "contacts": "contact",
}
