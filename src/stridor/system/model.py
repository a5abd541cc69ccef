"""System: matrices, loads, prescribed motions and contacts. The one object between modelling and analysis.

Nothing after it asks whether the freedoms came from beams, solids or another program's matrices.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from ..contact.interface import Contact, Rows
from ..contact.nodes import ContactNodes, stack
from ..contact.surfaces import SurfaceContact
from ..direct import factorise
from ..errors import AnalysisError
from ..fe.assembly import connected_components
from ..typing import Array, IntArray, Sparse
from .load_steps import LoadStep

COMPLETE_BASIS_LIMIT = 2500


@dataclass(frozen=True)
class Line:
    """A body as a drawing needs it: coordinates (k, 2) [m] and the rows of its nodes' displacements.

    freedoms (n_body,) are the indices of its free freedoms in the system.
    """

    name: str
    coordinates: Array
    rows: Rows
    freedoms: IntArray


@dataclass(frozen=True)
class Solid:
    """A meshed body as drawings and files need it: points (k, d) [m], cells by kind (meshio's names and order),
    rows (k d, n) of its nodes' displacements, its free freedoms (n_body,)."""

    name: str
    points: Array
    cells: Mapping[str, IntArray]
    rows: Rows
    freedoms: IntArray


@dataclass(frozen=True)
class CubicSprings:
    """Springs whose force is coefficient · (elongation)³ beside what the stiffness matrix holds: rows (q, n) of their
    elongations [m] with their lift, coefficient (q,) [N/m³]; stretch (q,) [m]: elongation at zero displacement, by
    supports that are pressed away."""

    rows: Rows
    coefficient: Array
    stretch: Array | float = 0.0


@dataclass(frozen=True)
class PrescribedMotion:
    """Supports that move with a given velocity, condensed on one scalar each.

    With u = w + L x_p, where L (n, p) is the static answer to the support's motion, the equations in
    w are those of the structure at rest loaded by −M_L ẍ_p − C_L ẋ_p. names (p,); lift L (n, p);
    mass M_L = M L + M_fp (n, p), damping C_L likewise; mass_own, damping_own, stiffness_own (p, p)
    are the energies' own parts. Unit factor means the velocity written in the case [m/s, rad/s].

    place (p,): 1 where a column is no velocity but a distance, reached at factor one and kept [m, rad]: a support
    pressed away, the interference of a contact; () where there is none.
    """

    names: tuple[str, ...]
    lift: Array
    mass: Array
    damping: Array
    mass_own: Array
    damping_own: Array
    stiffness_own: Array
    place: tuple[float, ...] = ()

    @property
    def places(self) -> Array:
        """Factors (p,) of the columns where everything is in its place: 1 for distances, 0 for velocities."""
        return np.array(self.place) if self.place else np.zeros(len(self.names))

    @property
    def full(self) -> Array:
        """Factors (p,) of full velocity: 0 for distances."""
        return 1.0 - self.places

    @staticmethod
    def none(size: int) -> PrescribedMotion:
        """No moving support, for a system of ``size`` freedoms."""
        empty, own = np.zeros((size, 0)), np.zeros((0, 0))
        return PrescribedMotion((), empty, empty, empty, own, own, own)


@dataclass(frozen=True)
class System:
    """Free freedoms only: mass, damping, stiffness (n, n) csr, contacts not included.

    contacts: the sliding pairs. loads: name → force vector (n,) at factor one. motion: moving
    supports. points: name → rows (2 or 3, n) of the named points that can be watched. lines: bodies
    as drawn. dof_names (n,) say in words what a freedom is.

    surfaces: contacts with many slave nodes; dimension 2 or 3; solids: meshed bodies as drawn; cubic: springs beyond
    the linear; initial_velocity (n,) [m/s] and initial_displacement (n,) [m] of bodies that start so; stress_stiffness
    gives the geometric stiffness (n, n) csr that the stresses of a displacement (n,) [m] make, None where no body
    has any. contact_cubic: contact → factor of the cube of the approach in its normal force, per area [N/m⁵], of a
    point [N/m³]. general: why its matrices, imported ones, are not all symmetric with a positive definite mass, as all
    others are; "" where they are. holders: contact → paths of the supports and ties at its nodes. load_steps: the way
    to the static equilibrium, with stick and partial slip; empty where all contacts slide as the motions have them.
    placed: whether it is what `in_place` has made of another. touching_at: the μ of the steady sliding whose nodes
    touch in its modes, whichever μ these are of; None where whoever asks for modes says.
    """

    mass: Sparse
    damping: Sparse
    stiffness: Sparse
    contacts: tuple[Contact, ...] = ()
    loads: Mapping[str, Array] = field(default_factory=dict)
    motion: PrescribedMotion = None  # type: ignore[assignment]  # filled in __post_init__
    points: Mapping[str, Rows] = field(default_factory=dict)
    lines: tuple[Line, ...] = ()
    dof_names: tuple[str, ...] = ()
    surfaces: tuple[SurfaceContact, ...] = ()
    dimension: int = 2
    solids: tuple[Solid, ...] = ()
    cubic: CubicSprings | None = None
    initial_velocity: Array | None = None
    initial_displacement: Array | None = None
    stress_stiffness: Callable[..., Sparse] | None = None
    general: str = ""
    holders: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    load_steps: tuple[LoadStep, ...] = ()
    placed: bool = False
    contact_cubic: Mapping[str, float] = field(default_factory=dict)
    touching_at: float | None = None

    def __post_init__(self) -> None:
        for name in ("mass", "damping", "stiffness"):
            object.__setattr__(self, name, sp.csr_array(getattr(self, name)))
        if self.motion is None:  # pyright: ignore[reportUnnecessaryComparison]
            object.__setattr__(self, "motion", PrescribedMotion.none(self.size))

    @property
    def size(self) -> int:
        """Number of free freedoms n."""
        return int(self.mass.shape[0])

    @property
    def components(self) -> list[IntArray]:
        """Freedoms that the structure (contacts aside) leaves uncoupled from the others."""
        return connected_components(self.mass, self.damping, self.stiffness)

    @property
    def beyond_points(self) -> str:
        """Why it is no structure with a few point contacts on a complete basis of modes; "" where it is."""
        if self.general:
            return self.general
        if self.surfaces:
            return "there is contact over surfaces"
        if self.load_steps:
            return "contacts may stick"
        if self.cubic is not None or self.contact_cubic:
            return "there are cubic springs"
        if self.size > COMPLETE_BASIS_LIMIT:
            return f"{self.size} freedoms are too many for a complete basis, which has up to {COMPLETE_BASIS_LIMIT}"
        return ""

    @property
    def assembled(self) -> bool:
        """Whether it is computed with on the assembled sparse matrices."""
        return bool(self.beyond_points)

    def undamped(self) -> System:
        """The same system without structural damping (paper eq. 5)."""
        motion = replace(
            self.motion,
            damping=np.zeros_like(self.motion.damping),
            damping_own=np.zeros_like(self.motion.damping_own),
        )
        return replace(self, damping=sp.csr_array(self.damping.shape), motion=motion)

    def in_place(self, factors: Array | None = None) -> System:
        """The system with everything that a prescribed distance presses away in its place, as the statics and the modes
        take it: supports' distances as loads by name, and the gaps that they and interferences leave.

        factors (p,): of the motions, those of velocities do not count; None: one. The time loop takes the system as it
        is, where distances are motions that end.
        """
        motion = self.motion
        if self.placed or not any(motion.places):
            return self
        place = motion.places if factors is None else motion.places * factors
        moved = motion.lift @ place
        loads = dict(self.loads)
        for k in np.flatnonzero(motion.places):
            loads[motion.names[k]] = self.stiffness @ (motion.lift[:, k] * place[k])
        contacts = tuple(
            replace(c, gap=c.gap + float(c.normal_lift @ place - c.normal_row @ moved)) for c in self.contacts
        )
        surfaces = tuple(
            replace(s, nodes=replace(n, gap=n.gap + n.normal_lift @ place - n.normal @ moved))
            for s, n in ((s, s.nodes) for s in self.surfaces)
        )
        cubic, stresses = self.cubic, self.stress_stiffness
        if cubic is not None:
            cubic = replace(cubic, stretch=cubic.rows.lift @ place - cubic.rows.free @ moved)
        return replace(
            self, loads=loads, contacts=contacts, surfaces=surfaces, cubic=cubic, placed=True,
            stress_stiffness=None if stresses is None else partial(stresses, place=place),
        )  # fmt: skip

    def touching(self, mu: float | None) -> System:
        """The system in whose modes those nodes touch that do so in steady sliding at ``mu`` (None: as it is)."""
        return self if mu is None else replace(self, touching_at=mu)

    def contact_nodes(self) -> ContactNodes:
        """Every contact, point or surface, as one list of slave nodes: points first, then surfaces in order."""
        parts = [_point_nodes(c) for c in self.contacts] + [s.nodes for s in self.surfaces]
        nodes = stack(parts, self.size, len(self.motion.names), self.dimension)
        if not self.contact_cubic:
            return nodes
        factor = np.array([self.contact_cubic.get(name, 0.0) for name in nodes.names])[nodes.owner]
        return replace(nodes, cubic=factor * np.where(np.isnan(nodes.area), 1.0, nodes.area))

    def contact_rows(self) -> Array:
        """G (2m, n): normal and tangential relative displacement of contact 0, of contact 1, …"""
        rows = [row for c in self.contacts for row in (c.normal_row, c.tangent_row)]
        return np.array(rows).reshape(2 * len(self.contacts), self.size)

    def friction_coefficients(self, speeds: Array) -> Array:
        """μ (m,) of the contacts at slip speeds (m,) [m/s]."""
        return np.array([c.law.sliding(float(v)) for c, v in zip(self.contacts, speeds, strict=True)])

    def with_friction(self, mu: float, speeds: Array) -> System:
        """The same system with every contact's law scaled so that it gives ``mu`` at ``speeds`` (m,)."""
        contacts = tuple(replace(c, law=c.law.scaled(mu, float(v))) for c, v in zip(self.contacts, speeds, strict=True))
        return replace(self, contacts=contacts)


def _point_nodes(contact: Contact) -> ContactNodes:
    """A point contact as a list of one node."""
    return ContactNodes(
        names=(contact.name,),
        owner=np.zeros(1, dtype=np.int64),
        laws=(contact.law,),
        normal=sp.csr_array(contact.normal_row[None, :]),
        tangent=sp.csr_array(contact.tangent_row[None, :]),
        normal_lift=np.atleast_2d(contact.normal_lift),
        tangent_lift=np.atleast_2d(contact.tangent_lift),
        gap=np.array([contact.gap]),
        area=np.array([np.nan]),
        compliance=np.array([contact.compliance]),
        position=contact.slave_position[None, :],
        normals=contact.normal[None, :],
        tangents=contact.tangent[None, None, :],
        closed=(contact.closed,),
    )


@dataclass(frozen=True)
class Structure:
    """All freedoms before supports are applied: what bodies give. Matrices (N, N) csr."""

    mass: Sparse
    damping: Sparse
    stiffness: Sparse


@dataclass(frozen=True)
class Constraint:
    """A support: freedoms held (indices in the structure) and their velocity at factor one."""

    name: str
    freedoms: tuple[int, ...]
    velocity: tuple[float, ...]
    displacement: tuple[float, ...] = ()

    @property
    def moves(self) -> bool:
        """Whether a velocity is prescribed."""
        return any(v != 0.0 for v in self.velocity)


@dataclass(frozen=True)
class Column:
    """A prescribed motion of supports: what its held freedoms do at factor one, and whether that is a distance."""

    name: str
    freedoms: tuple[int, ...]
    values: tuple[float, ...]
    place: float


def columns(constraints: list[Constraint]) -> list[Column]:
    """The motions that supports prescribe: velocities, then distances."""
    moving = [Column(c.name, c.freedoms, c.velocity, 0.0) for c in constraints if c.moves]
    away = [c for c in constraints if any(c.displacement)]
    return [*moving, *(Column(place_name("supports", c.name), c.freedoms, c.displacement, 1.0) for c in away)]


def place_name(table: str, name: str) -> str:
    """Name of the motion of a support's displacement or a contact's interference."""
    return f"{table}.{name}.{'displacement' if table == 'supports' else 'interference'}"


def constrain(
    structure: Structure,
    constraints: list[Constraint],
    dropped: IntArray | None = None,
    translations: Array | None = None,
) -> tuple[IntArray, PrescribedMotion]:
    """Free freedoms (n,) and the prescribed motions of a structure held by ``constraints``.

    dropped: freedoms that follow others and are no unknowns of their own. translations (N, d): what all freedoms do as
    everything moves along each axis by one; where a support carries a body along so, no rounding bends it.
    """
    total = structure.mass.shape[0]
    held = np.zeros(total, dtype=bool)
    if dropped is not None:
        held[dropped] = True
    for c in constraints:
        held[list(c.freedoms)] = True
    free = np.flatnonzero(~held)
    moving = columns(constraints)
    if not moving:
        return free, PrescribedMotion.none(len(free))
    selection, rigid = np.zeros((total, len(moving))), np.zeros((total, len(moving)))
    for column, c in enumerate(moving):
        selection[list(c.freedoms), column] = c.values
        if translations is not None:
            velocity = np.linalg.lstsq(translations[list(c.freedoms)], np.array(c.values), rcond=None)[0]
            rigid[:, column] = translations @ velocity
    lift = _static_lift(structure, free, selection, rigid)
    whole = selection.copy()
    whole[free] = lift

    def coupled(matrix: Sparse) -> tuple[Array, Array]:
        product = matrix @ whole
        return product[free], whole.T @ product

    mass, mass_own = coupled(structure.mass)
    damping, damping_own = coupled(structure.damping)
    stiffness_own = whole.T @ (structure.stiffness @ whole)
    # A rigid motion strains nothing; what is left is rounding of entries as large as EA/h.
    scale = np.abs(structure.stiffness).max() * np.abs(whole).max() ** 2
    stiffness_own[np.abs(stiffness_own) < 1e-13 * scale] = 0.0
    names = tuple(c.name for c in moving)
    place = tuple(c.place for c in moving)
    return free, PrescribedMotion(names, lift, mass, damping, mass_own, damping_own, stiffness_own, place)


DENSE_LIFT = 3000


def _answer(block: Sparse, load: Array) -> Array:
    """Least-norm answer of a semidefinite block; large ones are held by faint springs instead."""
    symmetric = float(np.abs(sp.csr_array(block - block.T).data).max(initial=0.0)) <= 1e-12 * np.abs(block).max()
    if block.shape[0] > DENSE_LIFT:
        faint = sp.diags_array(1e-9 * block.diagonal())
        factor = factorise(sp.csr_array(block + faint), symmetric=symmetric)
        answer = factor.solve(load)
        for _ in range(3):
            answer = answer + factor.solve(load - block @ answer)
        return answer
    dense = block.toarray()
    if not symmetric:
        return np.linalg.lstsq(dense, load, rcond=1e-12)[0]
    try:
        held = sl.cho_factor(dense)
        answer = sl.cho_solve(held, load)
        return answer + sl.cho_solve(held, load - dense @ answer)
    except sl.LinAlgError:
        return np.linalg.lstsq(dense, load, rcond=1e-12)[0]


def _static_lift(structure: Structure, free: IntArray, selection: Array, rigid: Array) -> Array:
    """L with K_ff L = −K_fp: the static answer, of least norm where the structure is free to move.

    rigid (N, p): translations that may be it. Where one balances to rounding it is taken, as a solve would only add
    rounding times the condition of K, which for slender solids is enough to open and close a gap.
    """
    stiffness = sp.csr_array(structure.stiffness)
    load = -(stiffness @ selection)[free]
    inner = sp.csr_array(stiffness[free][:, free])
    lift = np.zeros_like(load)
    for part in connected_components(inner):
        block, right, answer = sp.csr_array(inner[part][:, part]), load[part], rigid[free[part]]
        loaded = np.any(right, axis=0)
        unbalanced = np.abs(block @ answer - right).max(axis=0)
        bent = np.flatnonzero(loaded & (unbalanced > 1e-12 * np.abs(right).max(axis=0)))
        if len(bent):
            answer[:, bent] = _answer(block, right[:, bent])
            if np.linalg.norm(block @ answer[:, bent] - right[:, bent]) > 1e-6 * np.linalg.norm(right[:, bent]):
                raise AnalysisError(
                    "a moving support cannot be followed statically: its motion loads a mechanism that "
                    "nothing holds; fix more freedoms of that body"
                )
        lift[part] = np.where(loaded, answer, 0.0)
    return lift
