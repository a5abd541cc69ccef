"""What a case is made of, as another program takes it: matrices, rows of the contacts, loads, and what each freedom is.

At one μ these are M, C and K of small motions as `pencil` has them, contact and friction in K. Without a μ the
structure's own matrices are kept apart from what the contacts add,

    K(μ) = K + Kc + μ Kf ,

which a case of imported matrices takes as terms with the factors 1 and "mu", so that its onsets can be sought.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..errors import AnalysisError, CaseError
from ..matrices.model import Role
from ..modal.krylov.problem import ContactProblem, problem_of
from ..modal.krylov.steady import touching_nodes
from ..modal.options import Options
from ..sliding import anything_acts, full_motion
from ..sliding.pressing import pulled
from ..system import System
from ..typing import Array, BoolArray, IntArray, Sparse
from .asked import require_friction
from .pencil import pencil
from .workspace import Problem, Workspace

FORCE = "normal force"
_DIRECTIONS = {"scalar": 0, "x": 1, "y": 2, "z": 3, "rotation x": 4, "rotation y": 5, "rotation z": 6, "rotation": 6}
_NODE = re.compile(r"(?P<body>\S+) node (?P<node>\d+) (?P<direction>.+)")


@dataclass(frozen=True)
class ExportedTerm:
    """A square matrix (n + r, n + r) csr of the model, the role it has and its factor, 1.0 or "mu"."""

    name: str
    matrix: Sparse
    role: Role
    factor: float | str = 1.0


@dataclass(frozen=True)
class Freedom:
    """What an unknown is: body, number of the node as stridor names it ("" where it belongs to none), direction in
    words, and where the node is, d numbers [m] or none where that is not known.

    label: node and direction as files of labels have them, a negative node where the freedom belongs to none.
    """

    body: str
    node: str
    direction: str
    place: tuple[float, ...]
    label: tuple[int, int]


@dataclass(frozen=True)
class ContactRow:
    """A row of ``normal`` and its rows of ``tangent``: contact, stiffness [N/m] (inf: rigid), own friction coefficient
    at its slip speed, gap [m] of the structure at rest, place (d numbers) [m], and whether the contact, kept closed,
    pulls there: friction, which goes with the size of the force, then turns its sign with respect to the gap."""

    contact: str
    stiffness: float
    coefficient: float
    gap: float
    place: tuple[float, ...]
    pulls: bool


@dataclass(frozen=True)
class ExportedModel:
    """n freedoms, m touching nodes, r of them rigid, whose forces are unknowns behind the displacements.

    terms: M, C and K, without a μ also Kc and Kf where K(μ) is a straight line. normal, tangent (m, n) csr: relative
    displacement slave − master along the normal, which opens, and along the slip. loads (n + r, l) csr, a column at
    factor one for each of load_names. mu: None where friction is in terms of its own. whole: whether the terms say
    all that is to be known of small motions. notes: sentences.
    """

    terms: tuple[ExportedTerm, ...]
    normal: Sparse
    tangent: Sparse
    contacts: tuple[ContactRow, ...]
    loads: Sparse
    load_names: tuple[str, ...]
    freedoms: tuple[Freedom, ...]
    dimension: int
    mu: float | None
    whole: bool
    notes: tuple[str, ...]


def exported_model(problem: Problem, mu: float | None = None) -> ExportedModel:
    """The model at ``mu``, or (None) with friction in a term of its own.

    Raises CaseError for a μ that is none, and without one where the case's own matrices depend on it; AnalysisError
    where there is no steady sliding.
    """
    require_friction(mu, several=False)
    work = Workspace.of(problem)
    if mu is None and work.varies:
        accepted = "missing – factors of the case's matrices depend on it already; give the one to export at (--mu)"
        raise CaseError("mu", None, accepted)
    system, options = work.system(mu), work.options
    contact = problem_of(system, mu, options)
    if mu is None:
        terms, whole, notes = _over_friction(work, system, contact)
    else:
        matrices = pencil(work, mu).matrices()
        roles: tuple[Role, ...] = ("mass", "damping", "stiffness")
        terms = tuple(ExportedTerm(n, m, role) for n, m, role in zip("MCK", matrices, roles, strict=True))
        whole, notes = True, work.one_for_all
    beyond = terms[0].matrix.shape[0] - system.size
    if contact.contact_state:
        notes = (*notes, contact.contact_state)
    loads = [sp.csr_array(force[:, None]) for force in system.loads.values()]
    columns = sp.csr_array(sp.hstack(loads)) if loads else sp.csr_array((system.size, 0))
    sliding, pulls = len(contact.touching), _pulls(system, mu, contact, options)
    return ExportedModel(
        terms=terms,
        normal=contact.normal[:sliding],
        tangent=_tangent(system, contact, pulls),
        contacts=_contact_rows(system, contact, pulls),
        loads=sp.csr_array(sp.vstack([columns, sp.csr_array((beyond, columns.shape[1]))])),
        load_names=tuple(system.loads),
        freedoms=_freedoms(work, system, contact, beyond),
        dimension=system.dimension,
        mu=mu,
        whole=whole,
        notes=notes,
    )


def _over_friction(
    work: Workspace, system: System, contact: ContactProblem
) -> tuple[tuple[ExportedTerm, ...], bool, tuple[str, ...]]:
    """The structure's own matrices, and what the contacts add where that is a straight line over μ; whether it is."""
    own = (
        ExportedTerm("M", system.mass, "mass"),
        ExportedTerm("C", system.damping, "damping"),
        ExportedTerm("K", system.stiffness, "stiffness"),
    )
    why = _bent(system, contact)
    if why:
        note = f"Kc and Kf, what contacts and friction add, are left out: {why}; export at one mu instead (--mu)"
        return own, False, (note,)
    if not contact.nodes:
        return own, True, ()
    rigid = np.flatnonzero(contact.compliance == 0.0)
    own = tuple(ExportedTerm(t.name, _wider(t.matrix, len(rigid)), t.role) for t in own)
    unit = contact.pencil(0.0).unit
    closed, rubbing = _pushes(contact, contact.normal, rigid, unit), _pushes(contact, contact.slide, rigid, unit)
    if len(rigid):
        n, r = contact.size, len(rigid)
        closure = sp.csr_array(unit * contact.normal[rigid])
        closed = closed + sp.block_array([[sp.csr_array((n, n)), None], [closure, sp.csr_array((r, r))]], format="csr")
    added = ExportedTerm("Kc", sp.csr_array(closed), "stiffness"), ExportedTerm("Kf", rubbing, "stiffness", "mu")
    return (*own, *added), True, _other_nodes(work, system, contact)


def _pushes(contact: ContactProblem, push: Sparse, rigid: IntArray, unit: float) -> Sparse:
    """What forces of the contacts along the rows ``push`` (m, n) add to K: of springs k pushᵀN, of rigid contact the
    columns of their forces, in ``unit`` [N/m]."""
    soft = np.flatnonzero(contact.compliance > 0.0)
    springs = sp.diags_array(1.0 / contact.compliance[soft])
    within = sp.csr_array(push[soft].T @ springs @ contact.normal[soft])
    if not len(rigid):
        return within
    empty = sp.csr_array((len(rigid), contact.size)), sp.csr_array((len(rigid), len(rigid)))
    return sp.csr_array(sp.block_array([[within, -unit * push[rigid].T], list(empty)], format="csr"))


def _wider(matrix: Sparse, more: int) -> Sparse:
    """With so many empty rows and columns behind the others."""
    return sp.csr_array(sp.block_diag([matrix, sp.csr_array((more, more))], format="csr")) if more else matrix


def _bent(system: System, contact: ContactProblem) -> str:
    """Why K and C are no straight line over μ, "" where they are."""
    if contact.extras is not None:
        return f"what steady sliding adds ({', '.join(contact.extras.reasons)}) is no straight line over mu"
    if any(system.contact_cubic.values()):
        return f"the stiffness of {', '.join(system.contact_cubic)} depends on its force, and so on mu (cubic)"
    return ""


def _other_nodes(work: Workspace, system: System, contact: ContactProblem) -> tuple[str, ...]:
    """A note where other nodes touch at the ends of the range of μ than at the contacts' own coefficients."""
    if not anything_acts(system):
        return ()
    nodes, solver = system.contact_nodes(), work.options.solver
    stuck = touching_nodes(system, nodes, None, solver).stuck
    for mu in work.modal.friction_range:
        try:
            there = problem_of(system, mu, work.options)
        except AnalysisError as error:
            return (f"at mu = {mu:g} there is no steady sliding ({error}); Kc and Kf are those at the case's own mu",)
        if not np.array_equal(there.touching, contact.touching):
            return (
                f"other contact nodes touch at mu = {mu:g} ({len(there.touching)}) than at the case's own "
                f"({len(contact.touching)}), which Kc and Kf are made of",
            )
        others = touching_nodes(system, nodes, mu, solver).stuck
        if not np.array_equal(others, stuck):
            return (
                f"other contact nodes stick at mu = {mu:g} ({np.count_nonzero(others)}) than at the case's own "
                f"({np.count_nonzero(stuck)}), which Kc and Kf are made of",
            )
        if turned := _turned(contact.slide, there.slide):
            which = "1 contact node kept closed has" if turned == 1 else f"{turned} contact nodes kept closed have"
            return (
                f"at mu = {mu:g} {which} turned from pushing to pulling or back, and friction goes the other way: "
                "Kf has the signs of the case's own mu",
            )
    return ()


def _turned(one: Sparse, other: Sparse) -> int:
    """How many rows (m, n) have the opposite sign in the other matrix."""
    along = np.asarray(sp.csr_array(one * other).sum(axis=1)).ravel()
    return int(np.count_nonzero(along < 0.0))


def _pulls(system: System, mu: float | None, contact: ContactProblem, options: Options) -> BoolArray:
    """Which touching nodes (m,) are kept closed and pull."""
    nodes = system.contact_nodes()
    force = touching_nodes(system, nodes, mu, options.solver).force
    pulling = np.zeros(nodes.count, dtype=bool) if force is None else nodes.kept & pulled(force)
    return pulling[contact.touching]


def _tangent(system: System, contact: ContactProblem, pulls: BoolArray) -> Sparse:
    """Rows (m, n) of the touching nodes along their slip, of those without friction too."""
    nodes = system.contact_nodes().select(contact.touching)
    without = ~nodes.rubs
    # The problem's own rows are those that friction goes along with the force as it is: against the slip where it
    # pushes, with the slip where it pulls.
    sign = np.where(without, 0.0, np.where(pulls, 1.0, -1.0))
    rows = sp.csr_array(sp.diags_array(sign) @ contact.slip[: nodes.count])
    if not without.any():
        return rows
    slip = nodes.slip_velocity(full_motion(system))
    speed = np.linalg.norm(slip, axis=1)
    way = np.where((without & (speed > 0.0))[:, None], slip / np.where(speed > 0.0, speed, 1.0)[:, None], 0.0)
    return sp.csr_array(rows + nodes.along(way))


def _contact_rows(system: System, contact: ContactProblem, pulls: BoolArray) -> tuple[ContactRow, ...]:
    nodes = system.contact_nodes().select(contact.touching)
    if not nodes.count:
        return ()
    coefficients = nodes.friction_coefficients(nodes.speed)
    with np.errstate(divide="ignore"):
        stiffness: Array = 1.0 / contact.compliance[: nodes.count]
    return tuple(
        ContactRow(
            nodes.names[int(nodes.owner[k])], float(stiffness[k]), float(coefficients[k]), float(nodes.gap[k]),
            tuple(nodes.position[k].tolist()), bool(pulls[k]),
        )
        for k in range(nodes.count)
    )  # fmt: skip


def _freedoms(work: Workspace, system: System, contact: ContactProblem, beyond: int) -> tuple[Freedom, ...]:
    """What the n + r unknowns are, in their order."""
    places = _places(work, system)
    case = work.given
    keeps_numbers = case is not None and len(case.bodies) == 1 and len(case.imported) == 1
    known: dict[tuple[str, str], int] = {}
    found: list[Freedom] = []
    loose = 0
    for name in system.dof_names:
        parts = _NODE.fullmatch(name)
        if parts is None:
            loose -= 1
            body, _, rest = name.partition(" ")
            is_body = case is not None and body in case.bodies
            found.append(Freedom(body if is_body else "", "", rest if is_body else name, (), (loose, 0)))
            continue
        body, node, direction = parts["body"], parts["node"], parts["direction"]
        number = int(node) if keeps_numbers else known.setdefault((body, node), len(known) + 1)
        place = places.get((body, node), ())
        found.append(Freedom(body, node, direction, place, (number, _DIRECTIONS.get(direction, 0))))
    rigid = np.flatnonzero(contact.compliance == 0.0)[:beyond] if beyond else np.zeros(0, dtype=np.int64)
    nodes = system.contact_nodes().select(contact.touching)
    for k in rigid.tolist():
        loose -= 1
        if k < nodes.count:
            place = tuple(nodes.position[k].tolist())
            found.append(Freedom(nodes.names[int(nodes.owner[k])], "", FORCE, place, (loose, 0)))
        else:
            found.append(Freedom("", "", "force that sticks", (), (loose, 0)))
    return tuple(found)


def _places(work: Workspace, system: System) -> dict[tuple[str, str], tuple[float, ...]]:
    """Where nodes are, by their body and their number in the names of freedoms."""
    drawn: list[tuple[str, Array, Sparse]] = [
        *((line.name, line.coordinates, line.rows.free) for line in system.lines),
        *((solid.name, solid.points, solid.rows.free) for solid in system.solids),
    ]
    imported = {} if work.given is None else work.given.imported
    named: dict[tuple[str, str], tuple[float, ...]] = {}
    for body, points, rows in drawn:
        at = [tuple(point) for point in points.tolist()]
        if body not in imported:
            named |= {(body, str(k)): place for k, place in enumerate(at)}
            continue
        # Nodes that another program has numbered are told by the freedoms that they move along.
        for row in np.flatnonzero(np.diff(rows.indptr) == 1).tolist():
            parts = _NODE.fullmatch(system.dof_names[int(rows.indices[rows.indptr[row]])])
            if parts is not None and parts["body"] == body and rows.data[rows.indptr[row]] == 1.0:
                named.setdefault((body, parts["node"]), at[row // points.shape[1]])
    return named
