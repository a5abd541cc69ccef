"""System: matrices, loads, prescribed motions and contacts. The one object between modelling and analysis.

Nothing after it asks whether the freedoms came from beams, solids or another program's matrices.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np
import scipy.sparse as sp

from ..contact.interface import Contact, Rows
from ..contact.nodes import ContactNodes, stack
from ..contact.surfaces import SurfaceContact
from ..fe.assembly import connected_components
from ..laws.friction import FrictionLaw, keeping_frictionless, share_of
from ..notebook import Shown, counted, html_table
from ..typing import Array, IntArray, Sparse
from .given_matrices import contacts_given, not_symmetric_definite, points_given, square_matrices, vectors_given
from .load_steps import LoadStep, running_on
from .motion import PrescribedMotion

T = TypeVar("T")
MOST_ANSWERS = 200  # kept of one system: equilibria of a sweep are vectors of all its freedoms


class AnswerCache:
    """What has been computed of some matrices, or of a whole system, by what was asked."""

    def __init__(self, of: tuple[Sparse, ...] = ()) -> None:
        self.of = of
        self._known: dict[Hashable, Any] = {}

    @property
    def count(self) -> int:
        """How many are known."""
        return len(self._known)

    def once(self, asked: Hashable, answer: Callable[[], T]) -> T:
        """What ``answer`` gives, computed when it is asked for first; what raises is computed again."""
        if asked not in self._known:
            self.keep(asked, answer())
        return self._known[asked]

    def known(self, asked: Hashable) -> Any:
        """What was computed, None where it was not."""
        return self._known.get(asked)

    def keep(self, asked: Hashable, answer: Any) -> None:
        """Know it from now on; of very many answers the oldest is forgotten."""
        while len(self._known) >= MOST_ANSWERS:
            self._known.pop(next(iter(self._known)))
        self._known[asked] = answer



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


@dataclass(frozen=True, repr=False)
class System(Shown):
    """Free freedoms only: mass, damping, stiffness (n, n) csr, contacts not included.

    contacts: the sliding pairs. loads: name → force vector (n,) at factor one. motion: moving
    supports. points: name → rows (2 or 3, n) of the named points that can be watched. lines: bodies
    as drawn. dof_names (n,) say in words what a freedom is.

    surfaces: contacts with many slave nodes; dimension 2 or 3; solids: meshed bodies as drawn; cubic: springs beyond
    the linear; initial_velocity (n,) [m/s] and initial_displacement (n,) [m] of bodies that start so; stress_stiffness
    gives the geometric stiffness (n, n) csr that the stresses of a displacement (n,) [m] make, None where no body
    has any. contact_cubic: contact → factor of the cube of the approach in its normal force, per area [N/m⁵], of a
    point [N/m³]. not_symmetric_definite: why its matrices, imported ones, are not all symmetric with a positive
    definite mass, as all others are; "" where they are. holders: contact → paths of the supports and ties at its nodes.
    tie_words: warnings about ties. repeating: paths of the ties by which bodies repeat. load_steps: the way to the
    static equilibrium, with stick and partial slip; empty where all contacts slide as the motions have them. placed:
    whether it is what `in_place` has made of another. touching_at: the μ of the steady sliding whose nodes touch in its
    modes, whichever μ these are of; None where whoever asks for modes says. friction_speeds: contact → slip speed
    [m/s] at which a μ asked for of all contacts is told, where that is another than its mean one in steady sliding.

    Frozen, so that every question has one answer: `once` keeps what is asked for again and again, in ``answers``;
    ``of_matrices`` has what follows from mass, damping and stiffness alone, which systems with other contacts share.
    """

    mass: Sparse
    damping: Sparse
    stiffness: Sparse
    contacts: tuple[Contact, ...] = ()
    loads: Mapping[str, Array] = field(default_factory=dict)
    motion: PrescribedMotion = None  # type: ignore[assignment]  # ty: ignore[invalid-assignment]  # filled in __post_init__
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
    not_symmetric_definite: str = ""
    holders: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    load_steps: tuple[LoadStep, ...] = ()
    placed: bool = False
    tie_words: tuple[str, ...] = ()
    repeating: tuple[str, ...] = ()
    contact_cubic: Mapping[str, float] = field(default_factory=dict)
    touching_at: float | None = None
    friction_speeds: Mapping[str, float] = field(default_factory=dict)
    of_matrices: AnswerCache = field(default_factory=AnswerCache, repr=False, compare=False)
    answers: AnswerCache = field(default_factory=AnswerCache, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("mass", "damping", "stiffness"):
            matrix = getattr(self, name)
            object.__setattr__(self, name, matrix if isinstance(matrix, sp.csr_array) else sp.csr_array(matrix))
        own = (self.mass, self.damping, self.stiffness)
        if [id(matrix) for matrix in self.of_matrices.of] != [id(matrix) for matrix in own]:
            object.__setattr__(self, "of_matrices", AnswerCache(own))
        if self.motion is None:  # pyright: ignore[reportUnnecessaryComparison]
            object.__setattr__(self, "motion", PrescribedMotion.none(self.size))

    @classmethod
    def from_matrices(
        cls,
        mass: object,
        damping: object,
        stiffness: object,
        *,
        contacts: Mapping[str, Mapping[str, object]] | None = None,
        loads: Mapping[str, object] | None = None,
        points: Mapping[str, object] | None = None,
    ) -> System:
        """The system of matrices M, C (None: zero), K (n, n), NumPy or SciPy sparse, of any structure.

        contacts: NAME → table with normal and tangent, the rows (n,) that give the relative displacement slave − master
        along the contact's normal (positive opens) and its tangent, or their weights by freedom, {3: 1.0, 7: −1.0};
        stiffness [N/m] or "rigid"; friction, a table as in a case file; slip [m/s] of the slave against the master
        along the tangent in steady sliding (default 1; friction opposes its sign); gap [m], cubic [N/m³] and closed as
        in a case. Springs of contacts are no part of K. loads: name → force vector (n,) [N]; without any, every contact
        is taken as closed. points: name → rows (2, n) of displacements along x and y that a run can watch.

        It is all that `modes`, `onsets` and `simulate` of the layers below need:

            block = System.from_matrices(
                np.eye(2), None, [[20.0, 4.0], [4.0, 15.0]],
                contacts={"belt": {"normal": [0, 1], "tangent": [1, 0], "stiffness": 10.0,
                                   "friction": {"law": "coulomb", "coefficient": 0.3}}},
            )
            complex_modes(block, mu=0.3), onsets(block, (0.0, 1.0), max_frequency_hz=10.0)

        In time, [phases].velocities knows the slip of all contacts as "sliding". Raises CaseError with what is wrong
        where.
        """
        m, c, k = square_matrices(mass, damping, stiffness)
        size = m.shape[0]
        built, cubic = contacts_given(contacts, size)
        motion = PrescribedMotion.none(size)
        if built:
            column, own = np.zeros((size, 1)), np.zeros((1, 1))
            motion = PrescribedMotion(("sliding",), column, column, column, own, own, own)
        return cls(
            m, c, k, built, vectors_given("loads", loads, size), motion, points_given(points, size, len(motion.names)),
            dof_names=tuple(f"freedom {k}" for k in range(size)), contact_cubic=cubic,
            not_symmetric_definite=not_symmetric_definite(m, c, k),
        ).keeping_frictionless()  # fmt: skip

    @property
    def _line(self) -> str:
        points, nodes = len(self.contacts), sum(s.nodes.count for s in self.surfaces)
        contacts = [counted(points, "point contact")] if points or not nodes else []
        contacts += [counted(nodes, "contact node")] if nodes else []
        return f"{self.size} freedoms, {', '.join(contacts)}"

    def _repr_html_(self) -> str:
        matrices = (("mass", self.mass), ("damping", self.damping), ("stiffness", self.stiffness))
        rows: list[tuple[str, str]] = [(f"{name} matrix", f"{matrix.nnz} entries") for name, matrix in matrices]
        rows += [
            (f"contact {c.name}", f"a point, {stiffness}, gap {c.gap:g} m")
            for c in self.contacts
            for stiffness in (f"stiffness {c.stiffness:g}" if c.compliance else "rigid",)
        ]
        rows += [(f"contact {s.name}", f"{s.nodes.count} nodes") for s in self.surfaces]
        named = (f"loads: {', '.join(self.loads)}", f"motions: {', '.join(self.motion.names)}")
        lines = (*named, self.not_symmetric_definite)
        return html_table(f"System of {self.size} freedoms", ("", "what it is"), rows, lines)

    def once(self, asked: Hashable, answer: Callable[[], T]) -> T:
        """What ``answer`` gives, computed when it is asked for first and kept with the system.

        asked: the question, with every setting that the answer depends on."""
        return self.answers.once(asked, answer)

    @property
    def size(self) -> int:
        """Number of free freedoms n."""
        return int(self.mass.shape[0])

    @property
    def components(self) -> list[IntArray]:
        """Freedoms that the structure (contacts aside) leaves uncoupled from the others."""
        return connected_components(self.mass, self.damping, self.stiffness)

    @property
    def symmetric_definite(self) -> bool:
        """Whether M, C and K are symmetric and M is positive definite."""
        return not self.not_symmetric_definite

    def undamped(self) -> System:
        """The same system whose small motions have no structural damping (paper eq. 5).

        What its motions drag with stays: that is a force of steady sliding, and small motions are about the
        equilibrium that the damped system has.
        """
        return self.once("undamped", lambda: replace(self, damping=sp.csr_array(self.damping.shape)))

    def in_place(self, factors: Array | None = None) -> System:
        """The system with everything that a prescribed distance presses away in its place, as the statics and the modes
        take it: supports' distances as loads by name, and the gaps that they and interferences leave.

        factors (p,): of the motions, those of velocities do not count; None: one. The time loop takes the system as it
        is, where distances are motions that end.
        """
        if self.placed or not any(self.motion.full_distance):
            return self
        if factors is None:
            return self.once("in place", lambda: self._moved(self.motion.full_distance))
        return self._moved(self.motion.full_distance * factors)

    def _moved(self, distances: Array) -> System:
        """With everything pressed away by ``distances`` (p,), factors of the motions."""
        motion = self.motion
        moved = motion.lift @ distances
        loads = dict(self.loads)
        for k in np.flatnonzero(motion.full_distance):
            loads[motion.names[k]] = self.stiffness @ (motion.lift[:, k] * distances[k])
        contacts = tuple(
            replace(c, gap=c.gap + float(c.normal_lift @ distances - c.normal_row @ moved)) for c in self.contacts
        )
        surfaces = tuple(
            replace(s, nodes=replace(n, gap=n.gap + n.normal_lift @ distances - n.normal @ moved))
            for s, n in ((s, s.nodes) for s in self.surfaces)
        )
        cubic, stresses = self.cubic, self.stress_stiffness
        if cubic is not None:
            cubic = replace(cubic, stretch=cubic.rows.lift @ distances - cubic.rows.free @ moved)
        return replace(
            self, loads=loads, contacts=contacts, surfaces=surfaces, cubic=cubic, placed=True,
            stress_stiffness=None if stresses is None else partial(stresses, distances=distances),
        )  # fmt: skip

    def touching(self, mu: float | None) -> System:
        """The system in whose modes those nodes touch that do so in steady sliding at ``mu`` (None: as it is)."""
        return self if mu is None else self.once(("touching", mu), lambda: replace(self, touching_at=mu))

    def with_rigid_contacts(self) -> System:
        """The same system with every contact rigid, points and surfaces."""
        return self.once("rigid contacts", self._rigid)

    def _rigid(self) -> System:
        contacts = tuple(replace(c, stiffness=np.inf) for c in self.contacts)
        surfaces = tuple(s.rigid() for s in self.surfaces)
        return replace(self, contacts=contacts, surfaces=surfaces, contact_cubic={})

    def keeping_frictionless(self) -> System:
        """The system in which contacts that were given no friction, beside others that have some, have none at any
        coefficient asked for."""
        given = (*(c.law for c in self.contacts), *(s.law for s in self.surfaces))
        laws = keeping_frictionless(given)
        return self if tuple(laws) == given else self.with_laws(laws)

    def with_laws(self, laws: Sequence[FrictionLaw]) -> System:
        """The same system with other friction laws, one for each contact: points first, then surfaces."""
        points, count = zip(self.contacts, laws[: len(self.contacts)], strict=True), len(self.contacts)
        surfaces = zip(self.surfaces, laws[count:], strict=True)
        return replace(
            self, contacts=tuple(replace(c, law=law) for c, law in points),
            surfaces=tuple(replace(s, law=law, nodes=replace(s.nodes, laws=(law,))) for s, law in surfaces),
        )  # fmt: skip

    def at_friction(self, mu: float | None) -> System:
        """The same system with the law of every contact scaled so that it gives ``mu`` at its mean slip speed in steady
        sliding, whatever phases make of that. None: the laws as they are.

        What is solved of the result with no further μ, as steady sliding at another velocity, has the laws that a run
        in time has."""
        return self if mu is None else self.with_laws(self.contact_nodes().laws_at(mu))

    def without_idle_slip(self) -> System:
        """The system in which nothing slides contacts without friction: what knows friction by the slip leaves them
        out."""
        if self.contact_nodes().rubs.all():
            return self
        return self.once("without idle slip", self._without_idle_slip)

    def _without_idle_slip(self) -> System:
        def still(nodes: ContactNodes) -> ContactNodes:
            slid = np.repeat(nodes.rubs, nodes.directions)
            return replace(nodes, tangent_lift=slid[:, None] * nodes.tangent_lift)

        contacts = (replace(c, tangent_lift=float(share_of(c.law) > 0.0) * c.tangent_lift) for c in self.contacts)
        surfaces = (replace(s, nodes=still(s.nodes)) for s in self.surfaces)
        return replace(self, contacts=tuple(contacts), surfaces=tuple(surfaces))

    @property
    def finitely_sliding(self) -> tuple[str, ...]:
        """Contacts whose slave comes to other places of the master in time."""
        return tuple(c.name for c in (*self.contacts, *self.surfaces) if c.sliding == "finite")

    def in_reference(self) -> System:
        """The same system with every contact in the reference configuration for ever, as the modes have it."""
        if not self.finitely_sliding:
            return self
        contacts = tuple(replace(c, sliding="small") for c in self.contacts)
        return replace(self, contacts=contacts, surfaces=tuple(replace(s, sliding="small") for s in self.surfaces))

    def contact_nodes(self) -> ContactNodes:
        """Every contact, point or surface, as one list of slave nodes: points first, then surfaces in order."""
        return self.once("contact nodes", self._contact_nodes)

    def _contact_nodes(self) -> ContactNodes:
        parts = [_point_nodes(c) for c in self.contacts] + [s.nodes for s in self.surfaces]
        nodes = self._with_speeds(stack(parts, self.size, len(self.motion.names), self.dimension))
        if not self.contact_cubic:
            return nodes
        factor = np.array([self.contact_cubic.get(name, 0.0) for name in nodes.names])[nodes.owner]
        return replace(nodes, cubic=factor * np.where(np.isnan(nodes.area), 1.0, nodes.area))

    def _with_speeds(self, nodes: ContactNodes) -> ContactNodes:
        """With their slip speeds in steady sliding, and those at which a μ of all contacts is told: the mean of each
        contact; at full velocities where nothing runs on behind the last load step."""
        running = running_on(self.load_steps, self.motion)
        speed = np.linalg.norm(nodes.slip_velocity(running), axis=1)
        told = speed if np.any(running) else np.linalg.norm(nodes.slip_velocity(self.motion.full), axis=1)
        number = np.bincount(nodes.owner, minlength=len(nodes.names))
        means = np.bincount(nodes.owner, told, minlength=len(nodes.names)) / np.maximum(number, 1)
        given = self.friction_speeds
        at = tuple(given.get(name, float(mean)) for name, mean in zip(nodes.names, means, strict=True))
        return replace(nodes, speed=speed, mean_speed=at)

    def nodes_of_surfaces(self) -> Iterator[tuple[SurfaceContact, slice]]:
        """Each contact over a surface, and where its nodes are among `contact_nodes`."""
        first = len(self.contacts)
        for surface in self.surfaces:
            yield surface, slice(first, first + surface.nodes.count)
            first += surface.nodes.count

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
