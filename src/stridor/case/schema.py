"""The tables of a case file. SI units; a name with another unit says it (`angle_deg`, `frequency_hz`).

Each description completes the sentence "must be …" and is what a user reads when a value is refused; that
of a table of values says after ", each " what one of them must be. Rules that take more than one value (a
ramp longer than its phase, a point that does not exist) are in `checks`. Bodies are in `bodies`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field

from ..laws import Coulomb, FrictionLaw, Hyperbolic, Material, StaticKinetic, Tabulated, Weakening
from .bodies import BeamBody, Body, DampingTable, MassBody, MatrixBody, ObstacleBody, SlidingTable, SolidBody
from .fields import (
    NAME_RULE,
    PLACE,
    POINT,
    Direction,
    Label,
    NotNegative,
    Number,
    PlaneOrSpace,
    Positive,
    Space,
    Table,
    Truth,
)

__all__ = [
    "NAME_RULE",
    "POINT",
    "BeamBody",
    "Body",
    "DampingTable",
    "MassBody",
    "MatrixBody",
    "ObstacleBody",
    "SlidingTable",
    "SolidBody",
    "Table",
]


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


class Parameter(Table):
    """[parameters.NAME]: a named number for the factors of matrices."""

    value: Number = Field(description="a number, the value of the parameter")
    range: tuple[Number, Number] | None = Field(
        default=None, description="[a, b] with a < b, where the parameter may be varied"
    )


class Support(Table):
    """[supports.NAME]: degrees of freedom of a point or a boundary held, moved with a prescribed velocity, or pressed
    away by a prescribed distance."""

    at: str = Field(description=PLACE)
    fixed: Annotated[tuple[Direction, ...], Field(min_length=1)] = Field(
        description='a list of "x", "y", "z" and "rotation", at least one: the directions held'
    )
    velocity: Mapping[Direction, Number] = Field(
        default_factory=dict[Direction, float],
        description="a table of prescribed velocities, each a number, x, y, z [m/s], rotation [rad/s]",
    )
    displacement: Mapping[Direction, Number] = Field(
        default_factory=dict[Direction, float],
        description="a table of prescribed displacements, each a number, x, y, z [m], rotation [rad]",
    )


class CentrifugalTable(Table):
    """What drives bodies outwards that turn steadily, in the frame that turns with them."""

    speed: Number = Field(description="a number [rad/s], the speed of turning")
    axis: Space | None = Field(
        default=None, description="[x, y, z], three numbers: the axis of turning (left out: z, as in the plane)"
    )
    centre: PlaneOrSpace | None = Field(
        default=None, description="[x, y] or [x, y, z], numbers [m]: a point of the axis (left out: the origin)"
    )


class Load(Table):
    """[loads.NAME]: a force and a moment on a point, in global directions; a force or a pressure on a boundary; the
    weight or the centrifugal load of whole bodies."""

    at: str | None = Field(default=None, description=PLACE)
    force: PlaneOrSpace = Field(
        default=(0.0, 0.0), description="[x, y] or [x, y, z], numbers [N]: the force, on a boundary spread evenly"
    )
    moment: Number = Field(default=0.0, description="a number [N m], the moment, counter-clockwise, on a beam")
    pressure: Number = Field(default=0.0, description="a number [Pa], the pressure that pushes on a boundary")
    gravity: PlaneOrSpace | None = Field(
        default=None, description="[x, y] or [x, y, z], numbers [m/s²]: the acceleration of free fall, instead of at"
    )
    centrifugal: CentrifugalTable | None = Field(
        default=None, description="a table { speed, axis, centre }: the load of turning steadily, instead of at"
    )
    bodies: Annotated[tuple[str, ...], Field(min_length=1)] | None = Field(
        default=None, description="a list of names of bodies, on which gravity (left out: on all) or centrifugal acts"
    )

    @property
    def acts_on_bodies(self) -> bool:
        """Whether it is a load of whole bodies."""
        return self.gravity is not None or self.centrifugal is not None


MOST_POINTS = 1000
_COEFFICIENT = "a number >= 0, the friction coefficient while sliding"
_STATIC = "a number >= coefficient, the friction coefficient to overcome before sliding"


class CoulombTable(Table):
    """One friction coefficient."""

    law: Literal["coulomb"] = Field(
        description='"coulomb", "static-kinetic", "weakening", "hyperbolic" or "table", the law of friction'
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


class HyperbolicTable(Table):
    """A friction coefficient that falls with slip speed as 1/(1 + delta |v|)."""

    law: Literal["hyperbolic"]
    coefficient: NotNegative = Field(description="a number >= 0, the friction coefficient at high slip speed")
    static_coefficient: NotNegative = Field(description=_STATIC)
    delta: Positive = Field(description="a number > 0 [s/m]: at the slip speed 1/delta half of the drop is done")

    def law_object(self) -> FrictionLaw:
        """The friction as a law."""
        return Hyperbolic(self.coefficient, self.static_coefficient, self.delta)


class TabulatedTable(Table):
    """Friction coefficients at slip speeds, constant beyond the ends of the table."""

    law: Literal["table"]
    speeds: Annotated[tuple[NotNegative, ...], Field(min_length=2, max_length=MOST_POINTS)] = Field(
        description=f"a list of 2 to {MOST_POINTS} rising numbers >= 0 [m/s], slip speeds"
    )
    coefficients: Annotated[tuple[NotNegative, ...], Field(min_length=2, max_length=MOST_POINTS)] = Field(
        description="a list of as many numbers >= 0, the friction coefficients at these speeds"
    )
    interpolation: Literal["linear", "monotone-cubic"] = Field(
        default="linear", description='"linear" or "monotone-cubic", what lies between the points of the table'
    )
    static_coefficient: NotNegative | None = Field(
        default=None,
        description="a number >= the first of coefficients, to overcome before sliding (left out: the first itself)",
    )

    @property
    def coefficient(self) -> float:
        """The friction coefficient at high slip speed."""
        return self.coefficients[-1]

    def law_object(self) -> FrictionLaw:
        """The friction as a law."""
        return Tabulated(self.speeds, self.coefficients, self.interpolation, self.static_coefficient)


Friction = Annotated[
    CoulombTable | StaticKineticTable | WeakeningTable | HyperbolicTable | TabulatedTable, Field(discriminator="law")
]


class Contact(Table):
    """[contacts.NAME]: a point of one body (slave) sliding along the line of another (master), or a boundary
    sliding on a boundary or an obstacle."""

    slave: str = Field(description=PLACE)
    master: str = Field(
        description='the NAME of a beam or an obstacle, or a boundary, "body.boundary": what is touched'
    )
    stiffness: Positive | Literal["rigid"] = Field(
        description='a number > 0 [N/m], between boundaries per area [N/m³], or "rigid", the normal stiffness'
    )
    cubic: NotNegative = Field(
        default=0.0,
        description="a number >= 0 [N/m³], between boundaries per area [N/m⁵], the factor of the cube of the approach",
    )
    sliding: Literal["small", "finite"] = Field(
        default="small", description='"small" (the slave stays where it is on the master) or "finite"'
    )
    side: Literal["left", "right"] | None = Field(
        default=None,
        description='"left" or "right", the side of a beam\'s direction on which the slave lies',
    )
    adjust: NotNegative = Field(
        default=0.0,
        description="a number >= 0 [m], gaps and overlaps of slave nodes up to this count as touching",
    )
    interference: Number = Field(
        default=0.0, description="a number [m], the overlap that is pressed out beside that of the meshes (press fit)"
    )
    closed: Truth = Field(
        default=False, description="true or false, whether the contact is kept closed, pulling where it would open"
    )
    friction: Friction = Field(description='a table such as { law = "coulomb", coefficient = 0.1 }')


class Rotation(Table):
    """A turn about an axis."""

    angle_deg: Number = Field(description="a number [degrees], how far, by the right hand about the axis")
    axis: Space = Field(default=(0.0, 0.0, 1.0), description="[x, y, z], three numbers: the axis of turning")
    centre: PlaneOrSpace | None = Field(
        default=None, description="[x, y] or [x, y, z], numbers [m]: a point of the axis (left out: the origin)"
    )


class Tie(Table):
    """[ties.NAME]: a boundary bonded to a boundary of another body, or to another one of the same body that repeats;
    their meshes need not match."""

    slave: str = Field(description='a boundary, "body.boundary", the one that follows (the finer mesh)')
    master: str = Field(description='a boundary, "body.boundary", the one that leads')
    tolerance: NotNegative | None = Field(
        default=None, description="a number >= 0 [m], the largest distance between them (left out: 5 % of an element)"
    )
    translation: PlaneOrSpace | None = Field(
        default=None, description="[x, y] or [x, y, z], numbers [m]: from the master to the slave, where both repeat"
    )
    rotation: Rotation | None = Field(
        default=None, description="a table { angle_deg, axis, centre }: from the master to the slave, where both repeat"
    )


_END = 'a list of two points, "body.point" or for a mass "body"; the second may be "ground"'
_ALONG = "[x, y] or [x, y, z], numbers: the direction it acts in (left out: the line between its ends)"


class Spring(Table):
    """[springs.NAME]: a massless spring between two points, or from a point to ground; relaxed at the start."""

    between: tuple[str, str] = Field(description=_END)
    stiffness: Number = Field(description="a number [N/m], the stiffness")
    cubic: Number = Field(default=0.0, description="a number [N/m³], the factor of the cube of the elongation")
    damping: NotNegative = Field(default=0.0, description="a number >= 0 [N s/m], a dashpot beside the spring")
    direction: PlaneOrSpace | None = Field(default=None, description=_ALONG)


class Dashpot(Table):
    """[dashpots.NAME]: a viscous damper between two points, or from a point to ground."""

    between: tuple[str, str] = Field(description=_END)
    damping: NotNegative = Field(description="a number >= 0 [N s/m], the damping")
    direction: PlaneOrSpace | None = Field(default=None, description=_ALONG)


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
    displacements: Mapping[str, Number] = Field(
        default_factory=dict[str, float],
        description=(
            "a table of supports and contacts, each a number, the factor of the support's displacement or of the "
            "contact's interference in this phase"
        ),
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
    sweep_points: Annotated[int, Field(strict=True, ge=2)] | None = Field(
        default=None,
        description="a whole number >= 2, how many friction coefficients a sweep takes (left out: 201, or 21 of large "
        "matrices with mu in a factor)",
    )
    damped: Truth = Field(default=True, description="true or false, with or without damping")
    friction_damping: Truth = Field(
        default=False,
        description="true or false, damping μN/v of friction across the direction of sliding (surfaces in space)",
    )
    prestress: Truth = Field(
        default=False, description="true or false, geometric stiffness by the stresses of steady sliding (solids)"
    )
    source: Literal["auto", "receptance", "krylov", "reduced", "full"] = Field(
        default="auto", description='"auto", "receptance", "krylov", "reduced" or "full", where eigenpairs come from'
    )
    solver: Literal["auto", "mumps", "pardiso", "superlu", "slepc"] = Field(
        default="auto", description='"auto", "mumps", "pardiso", "superlu" or "slepc", the sparse direct solver'
    )


class Temporal(Table):
    """[temporal]: settings of the simulation in time."""

    step: Positive | None = Field(
        default=None, description="a number > 0 [s], the time step (left out: a safe part of the stability limit)"
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
    path: Literal["auto", "modal", "nodal", "assembled"] = Field(
        default="auto", description='"auto", "modal", "nodal" or "assembled", the unknowns of the time loop'
    )
    contact: Literal["as given", "rigid"] = Field(
        default="as given", description='"as given" or "rigid", the stiffness of contacts in time'
    )
    stepper: Literal["explicit", "exact", "implicit", "auto"] = Field(
        default="explicit",
        description='"explicit", "exact", "implicit" or "auto": step by step, from one change of contact to the next, '
        "by parts of the shortest period of interest, or by size",
    )
    cutoff_hz: Positive | None = Field(
        default=None,
        description="a number > 0 [Hz], the frequency up to which exact steps, and cycles by shooting, take modes of "
        "the structure, with static answers for the rest (left out: all modes)",
    )
    watch: tuple[str, ...] = Field(default=(), description=f"a list of points, each {POINT[8:]}")


class SteadyStep(Table):
    """[[steady.steps]]: loads and motions that change in equal increments, where friction may stick.

    A factor not given stays as in the step before, in the first step it is 1.
    """

    loads: Mapping[str, Number] = Field(
        default_factory=dict[str, float],
        description="a table of loads, each a number, the factor of the load at the end of the step",
    )
    velocities: Mapping[str, Number] = Field(
        default_factory=dict[str, float],
        description="a table of supports, each a number, the factor of the support's velocity in this step",
    )
    duration: Positive | None = Field(
        default=None,
        description="a number > 0 [s], how long the supports move (left out: until all that they move slides)",
    )
    increments: Annotated[int, Field(strict=True, ge=1)] = Field(
        default=10, description="a whole number >= 1, the equal parts in which the step is solved"
    )


class Steady(Table):
    """[steady]: how the static equilibrium that the analyses start from comes about."""

    friction: Literal["sliding", "stick-slip"] = Field(
        default="sliding",
        description='"sliding" (every contact slides as the supports have it) or "stick-slip" (load steps)',
    )
    steps: tuple[SteadyStep, ...] = Field(default=(), description="a list of tables [[steady.steps]]")


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
    "parameters": Parameter,
    "materials": MaterialTable,
    "bodies": Body,
    "supports": Support,
    "loads": Load,
    "contacts": Contact,
    "ties": Tie,
    "springs": Spring,
    "dashpots": Dashpot,
}
"""Tables of named tables, and what each of their entries is."""
SINGULAR = {
    "parameters": "parameter",
    "materials": "material",
    "bodies": "body",
    "supports": "support",
    "loads": "load",
    "contacts": "contact",
    "ties": "tie",
    "springs": "spring",
    "dashpots": "dashpot",
}
