"""The tables [bodies.NAME]: beams, meshed solids, matrices of other programs, point masses and rigid obstacles."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from ..laws import Rayleigh, RectangularSection
from .fields import (
    Count,
    Counts,
    Label,
    Name,
    NodeNumber,
    NotNegative,
    Number,
    PlaneOrSpace,
    Positive,
    Space,
    Table,
    Truth,
    Vector,
)


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

    type: Literal["beam"] = Field(description='"beam", "solid", "matrices", "mass" or "obstacle", the type of the body')
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
    elements: Count = Field(
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
    def dimension(self) -> int:
        """2: beams bend in the plane."""
        return 2

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


_PLANE_CELLS = '"triangle", "triangle6", "quad", "quad8" or "quad9", the kind of the elements of a shape in the plane'
_SOLID_CELLS = (
    '"tetra", "tetra10", "hexahedron", "hexahedron20" or "hexahedron27", the kind of the elements of a shape in space'
)
_DIVISIONS = "whole numbers >= 1, one for each edge: how many elements along it"
_EDGE = "a number > 0 [m], the element size, instead of divisions"
_GRADING = (
    "a list with an entry for each of the divisions: a number > 0, the last element's size over the first's, or a list "
    "of the places of the elements' ends, from 0 to 1"
)
PlaneCells = Literal["triangle", "triangle6", "quad", "quad8", "quad9"]
SolidCells = Literal["tetra", "tetra10", "hexahedron", "hexahedron20", "hexahedron27"]


class MeshTable(Table):
    """What built-in meshes have in common."""

    divisions: Counts | None = Field(default=None, description=_DIVISIONS)
    element_size: Positive | None = Field(default=None, description=_EDGE)
    grading: tuple[Positive | tuple[NotNegative, ...], ...] | None = Field(default=None, description=_GRADING)


class RectangleMesh(MeshTable):
    """A rectangle; boundaries left, right, bottom, top (as they lie before it is turned)."""

    shape: Literal["rectangle"] = Field(
        description='"rectangle", "quadrilateral", "annulus", "block", "disc" or "pad", the shape meshed'
    )
    corner: Vector = Field(description="[x, y], two numbers [m]: the lower left corner")
    size: tuple[Positive, Positive] = Field(description="[length along x, height along y], two numbers > 0 [m]")
    angle_deg: Number = Field(default=0.0, description="a number [degrees], turned about the corner")
    cells: PlaneCells = Field(default="quad8", description=_PLANE_CELLS)


class QuadrilateralMesh(MeshTable):
    """A quadrilateral with straight edges; boundaries bottom (corner 1 to 2), right, top, left."""

    shape: Literal["quadrilateral"]
    corners: tuple[Vector, Vector, Vector, Vector] = Field(
        description="four points [x, y] [m], the corners counter-clockwise from the lower left"
    )
    cells: PlaneCells = Field(default="quad8", description=_PLANE_CELLS)


class AnnulusMesh(MeshTable):
    """A ring, a sector of one, or a full disc in the plane; boundaries inner, outer, of a sector start, end."""

    shape: Literal["annulus"]
    centre: Vector = Field(default=(0.0, 0.0), description="[x, y], two numbers [m]: the centre")
    inner_radius: NotNegative = Field(description="a number >= 0 [m], the inner radius (0: a full disc)")
    outer_radius: Positive = Field(description="a number > inner_radius [m], the outer radius")
    start_deg: Number = Field(default=0.0, description="a number [degrees], where a sector starts")
    sweep_deg: Positive = Field(default=360.0, description="a number > 0, at most 360 [degrees]: how far it reaches")
    cells: PlaneCells = Field(default="quad8", description=_PLANE_CELLS)


class BlockMesh(MeshTable):
    """A cuboid; boundaries left, right (x), front, back (y), bottom, top (z)."""

    shape: Literal["block"]
    corner: Space = Field(description="[x, y, z], three numbers [m]: the corner with the least coordinates")
    size: tuple[Positive, Positive, Positive] = Field(description="three numbers > 0 [m], along x, y, z")
    cells: SolidCells = Field(default="hexahedron20", description=_SOLID_CELLS)


class DiscMesh(MeshTable):
    """An annular disc, its axis along z; boundaries inner, outer, bottom, top."""

    shape: Literal["disc"]
    centre: Space = Field(
        default=(0.0, 0.0, 0.0), description="[x, y, z], three numbers [m]: the centre of the bottom"
    )
    inner_radius: Positive = Field(description="a number > 0 [m], the inner radius")
    outer_radius: Positive = Field(description="a number > inner_radius [m], the outer radius")
    thickness: Positive = Field(description="a number > 0 [m], the thickness along z")
    cells: SolidCells = Field(default="hexahedron20", description=_SOLID_CELLS)


class PadMesh(MeshTable):
    """A sector of an annular disc, its axis along z; boundaries inner, outer, start, end, bottom, top."""

    shape: Literal["pad"]
    centre: Space = Field(
        default=(0.0, 0.0, 0.0), description="[x, y, z], three numbers [m]: the centre of the bottom"
    )
    inner_radius: Positive = Field(description="a number > 0 [m], the inner radius")
    outer_radius: Positive = Field(description="a number > inner_radius [m], the outer radius")
    start_deg: Number = Field(description="a number [degrees], where the sector starts, from +x to +y")
    sweep_deg: Positive = Field(description="a number > 0, below 360 [degrees]: how far it reaches")
    thickness: Positive = Field(description="a number > 0 [m], the thickness along z")
    cells: SolidCells = Field(default="hexahedron20", description=_SOLID_CELLS)


BuiltInMesh = Annotated[
    RectangleMesh | QuadrilateralMesh | AnnulusMesh | BlockMesh | DiscMesh | PadMesh, Field(discriminator="shape")
]


class SlidingTable(Table):
    """Material that slides through its mesh: a turning disc, a belt, a moving wall."""

    velocity: PlaneOrSpace | None = Field(
        default=None, description="[x, y] or [x, y, z], numbers [m/s]: the velocity of the material"
    )
    spin: Number = Field(
        default=0.0, description="a number [rad/s], the speed of turning about axis (in the plane counter-clockwise)"
    )
    axis: Space = Field(default=(0.0, 0.0, 1.0), description="[x, y, z], three numbers: the axis of turning")
    centre: PlaneOrSpace | None = Field(
        default=None, description="[x, y] or [x, y, z], numbers [m]: a point of the axis (left out: the origin)"
    )


_INITIAL_VELOCITY = "[x, y] or [x, y, z], numbers [m/s]: the velocity at the start"
_INITIAL_DISPLACEMENT = "[x, y] or [x, y, z], numbers [m]: the displacement at the start"
_DAMPING = "a table { mass = α₁ [1/s], stiffness = α₂ [s] }, Rayleigh damping"
_SLIDING = "a table { velocity, spin, axis, centre }: the material slides through its mesh"


class SolidBody(Table):
    """[bodies.NAME] of type "solid": linear elastic, in the plane or in space."""

    type: Literal["solid"]
    material: str | None = Field(
        default=None, description="the NAME of a [materials.NAME] (may be left out where an Abaqus file gives it)"
    )
    model: Literal["plane stress", "plane strain", "3d"] = Field(
        description='"plane stress", "plane strain" or "3d", the elasticity'
    )
    thickness: Positive = Field(default=1.0, description="a number > 0 [m], the thickness of a plane body")
    mesh: BuiltInMesh | None = Field(
        default=None, description="a table { shape = …, … }, a built-in mesh, instead of file"
    )
    file: Label | None = Field(
        default=None,
        description="the path of a mesh file (.msh, .vtk, .vtu, .inp), from the folder of the case file",
    )
    group: Label | None = Field(
        default=None, description="the name of a group of elements of the file: only these are the body"
    )
    scale: Positive = Field(default=1.0, description="a number > 0, by which coordinates of the file become metres")
    translation: PlaneOrSpace | None = Field(
        default=None, description="[x, y] or [x, y, z], numbers [m]: moves the mesh of the file"
    )
    mass: Literal["consistent", "lumped"] = Field(
        default="lumped", description='"consistent" or "lumped" (positive for all elements), the mass matrix'
    )
    damping: DampingTable = Field(default=DampingTable(), description=_DAMPING)
    sliding: SlidingTable | None = Field(default=None, description=_SLIDING)
    initial_velocity: PlaneOrSpace | None = Field(default=None, description=_INITIAL_VELOCITY)
    initial_displacement: PlaneOrSpace | None = Field(default=None, description=_INITIAL_DISPLACEMENT)
    points: Mapping[Name, PlaneOrSpace] = Field(
        default_factory=dict[str, tuple[float, ...]],
        description="a table of named points, each [x, y] or [x, y, z], numbers [m]: the mesh node nearest is taken",
    )

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return 3 if self.model == "3d" else 2


class MatrixTerm(Table):
    """One matrix of a file, times a factor."""

    file: Label = Field(description="the path of a matrix file (.mtx, .mat, .pch, .op4, …)")
    name: Label | None = Field(default=None, description="the name of the matrix in the file, where it holds several")
    role: Literal["mass", "damping", "stiffness"] | None = Field(
        default=None, description='"mass", "damping" or "stiffness", what the matrix is (left out: as the file says)'
    )
    factor: Number | Label = Field(
        default=1.0, description='a number, or an expression of [parameters] and mu such as "Omega**2 - 1"'
    )
    one_sided: bool = Field(
        default=False,
        description="true or false, whether entries on one side of the diagonal only are meant so, and are no half of "
        "a symmetric matrix",
    )


class MatrixBody(Table):
    """[bodies.NAME] of type "matrices": mass, damping and stiffness matrices that another program has written.

    Terms of one role add up. The files, or ``labels``, say to which node and direction a freedom belongs.
    """

    type: Literal["matrices"]
    terms: tuple[MatrixTerm, ...] = Field(
        description="a list of tables { file, name, role, factor, one_sided }, at least one"
    )
    labels: Label | None = Field(
        default=None,
        description='the path of a text file with a line "node direction" for each freedom, where the matrices\' files '
        "do not name them",
    )
    mesh: Label | None = Field(
        default=None, description="the path of an Abaqus file (.inp) with the nodes that the freedoms belong to"
    )
    group: Label | None = Field(
        default=None, description="the name of a group of elements of the mesh: only these are drawn and touched"
    )
    dimension: Literal[2, 3] = Field(default=3, description="2 or 3, whether it moves in the plane or in space")
    thickness: Positive = Field(default=1.0, description="a number > 0 [m], the thickness of a plane body")
    scale: Positive = Field(
        default=1.0,
        description="a number > 0 [m], the unit of length of matrices and mesh (0.001: mm, N, s, masses in tonnes)",
    )
    translation: PlaneOrSpace | None = Field(
        default=None, description="[x, y] or [x, y, z], numbers [m]: moves the mesh"
    )
    sliding: SlidingTable | None = Field(default=None, description=_SLIDING)
    points: Mapping[Name, NodeNumber | PlaneOrSpace] = Field(
        default_factory=dict[str, int | tuple[float, ...]],
        description="a table of named points, each a node's number, or [x, y] or [x, y, z], numbers [m]: the mesh node "
        "nearest is taken",
    )


class MassBody(Table):
    """[bodies.NAME] of type "mass": a point mass that moves in the plane or in space."""

    type: Literal["mass"]
    mass: Positive = Field(description="a number > 0 [kg], the mass")
    position: PlaneOrSpace = Field(description="[x, y] or [x, y, z], numbers [m]: where it is")
    initial_velocity: PlaneOrSpace | None = Field(default=None, description=_INITIAL_VELOCITY)
    initial_displacement: PlaneOrSpace | None = Field(default=None, description=_INITIAL_DISPLACEMENT)

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return len(self.position)


class ObstacleBody(Table):
    """[bodies.NAME] of type "obstacle": a rigid flat or cylinder that is only a master."""

    type: Literal["obstacle"]
    shape: Literal["flat", "cylinder"] = Field(description='"flat" or "cylinder", the shape')
    point: PlaneOrSpace = Field(
        description="[x, y] or [x, y, z], numbers [m]: a point of the flat, the centre or a point of the axis"
    )
    normal: PlaneOrSpace | None = Field(
        default=None, description="[x, y] or [x, y, z], numbers: from the flat towards the bodies"
    )
    radius: Positive | None = Field(default=None, description="a number > 0 [m], the radius of the cylinder")
    axis: Space | None = Field(default=None, description="[x, y, z], three numbers: the axis of the cylinder in space")
    inside: Truth = Field(default=False, description="true for a bore, whose inside is touched")
    sliding: SlidingTable | None = Field(default=None, description=_SLIDING)

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return len(self.point)


Body = Annotated[BeamBody | SolidBody | MatrixBody | MassBody | ObstacleBody, Field(discriminator="type")]
AnyBody = BeamBody | SolidBody | MatrixBody | MassBody | ObstacleBody
MASS_POINT = "centre"
