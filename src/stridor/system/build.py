"""A case becomes a System: bodies assembled, bonded, supported, linked and loaded, contacts paired."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from os import PathLike

import numpy as np
import scipy.sparse as sp

from ..asking import NUMBER
from ..case import Case, load
from ..case.bodies import MassBody, SolidBody
from ..case.points import BoundaryRef
from ..case.repeating import repeating
from ..case.schema import Load, SteadyStep
from ..contact.interface import Rows
from ..errors import CaseError, kind_of
from ..fe.assembly import beside
from ..fe.solid import stress_stiffness
from ..mesh.boundary import require_boundary
from ..mesh.facets import facet_areas, pressure_load, traction_load
from ..stages import passing, stage
from ..typing import Array, IntArray, Sparse
from .bodies import BuiltBody, KnownBodies, build_bodies
from .body_loads import body_load
from .given_matrices import not_symmetric_definite
from .holders import holders_of
from .links import Links, links_of
from .load_steps import LoadStep
from .model import CubicSprings, Line, Solid, System
from .motion import FreeStructure, PrescribedMotion, constrain, distance_name
from .pairs import is_held, is_point_on_line, paired_by, point_contact, surface_contact
from .same_place import require_places_of_their_own
from .supports import Tied, constraints_of, tie_matrix, tied_by
from .view import View


@passing()
def build_system(
    case: Case | str | PathLike[str], mu: float | None = None, *, known: KnownBodies | None = None
) -> System:
    """Assemble a case, or that in the file at a path; mu is that in the factors of imported matrices (None: the case's
    own), and nothing else. known: bodies of like cases, taken as they are where nothing of them differs.

    Raises CaseError where a mesh or a matrix will not do or bodies that shall touch do not.
    """
    if isinstance(case, str | PathLike):
        case = load(case)
    if not isinstance(case, Case):  # pyright: ignore[reportUnnecessaryIsInstance]
        accepted = "a case or the path of its file; the system of a workspace is work.system()"
        raise CaseError("case", kind_of(case), accepted)
    NUMBER.or_none().require(mu, "mu")
    stage("matrices of the bodies")
    known = known or KnownBodies()
    bodies = build_bodies(case, mu, known)
    total = sum(body.size for body in bodies.values())
    links = links_of(case, bodies, total)
    constraints = constraints_of(case, bodies)
    tied = known.tied(tied_by(case, bodies, constraints), lambda: tie_matrix(case, bodies, total, constraints))
    tie, followers = (None, np.zeros(0, dtype=np.int64)) if tied is None else (tied.matrix, tied.followers)
    structure = _structure(bodies, links, tied)
    free, motion = constrain(structure, constraints, followers, _translations(bodies, total))
    if not len(free):
        raise CaseError("supports", None, "hold every degree of freedom of the case; leave some of them free")
    motion = _with_sliding(case, motion)
    view = View(bodies, total, free, motion, constraints, tie, () if tied is None else tied.repeats)
    points = {at: view.point_rows(case, at) for at in _references(case)}
    loads = {name: _load(case, view, name, load) for name, load in case.loads.items()}
    contacts, surfaces = [], []
    for name, contact in case.contacts.items():
        if is_point_on_line(case, contact):
            contacts.append(point_contact(case, view, name, contact))
        else:
            make = partial(surface_contact, case, view, name, contact)
            surfaces.append(known.paired(name, paired_by(case, view, name, contact), make))
    require_places_of_their_own(case, bodies, lambda reference: is_held(case, view, reference))
    names = _dof_names(bodies)
    solids = tuple(
        Solid(body.name, body.points, _cells(body), view.node_rows(body), view.freedoms_of(body))
        for body in bodies.values()
        if body.beam is None and body.placed
    )
    mass, damping, stiffness = (
        sp.csr_array(matrix[free][:, free]) for matrix in (structure.mass, structure.damping, structure.stiffness)
    )
    return System(
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        contacts=tuple(contacts),
        loads=loads,
        motion=motion,
        points=points,
        lines=tuple(
            Line(body.name, body.points, view.node_rows(body), view.freedoms_of(body))
            for body in bodies.values()
            if body.beam is not None
        ),
        dof_names=tuple(names[i] for i in free.tolist()),
        surfaces=tuple(surfaces),
        dimension=case.dimension,
        solids=solids,
        cubic=_cubic(view, links),
        initial_velocity=_initial(case, view, "initial_velocity"),
        initial_displacement=_initial(case, view, "initial_displacement"),
        stress_stiffness=_stress_stiffness(case, view),
        not_symmetric_definite=not_symmetric_definite(mass, damping, stiffness) if case.imported else "",
        holders=holders_of(case, view, contacts, surfaces),
        load_steps=_load_steps(case, motion),
        contact_cubic={name: contact.cubic for name, contact in case.contacts.items() if contact.cubic},
        tie_words=() if tied is None else tied.words,
        repeating=repeating(case.ties),
    ).keeping_frictionless()


def _load_steps(case: Case, motion: PrescribedMotion) -> tuple[LoadStep, ...]:
    """The way to the static equilibrium, empty where every contact slides."""
    if case.steady.friction == "sliding":
        return ()
    loads, velocities = dict.fromkeys(case.loads, 1.0), dict.fromkeys(motion.names, 1.0)
    found: list[LoadStep] = []
    for step in case.steady.steps or (SteadyStep(),):
        loads, velocities = {**loads, **step.loads}, {**velocities, **step.velocities}
        factors = np.array([velocities[name] for name in motion.names])
        found.append(LoadStep(dict(loads), factors, step.duration, step.increments))
    return tuple(found)


def _structure(bodies: Mapping[str, BuiltBody], links: Links, tied: Tied | None) -> FreeStructure:
    parts = list(bodies.values())
    mass, damping, stiffness = (beside([getattr(b, kind) for b in parts]) for kind in ("mass", "damping", "stiffness"))
    if links.rows.shape[0]:
        damping = damping + links.rows.T @ sp.diags_array(links.damping) @ links.rows
        stiffness = stiffness + links.rows.T @ sp.diags_array(links.stiffness) @ links.rows
    if tied is not None:
        mass, damping, stiffness = tied.mass(mass), tied.within(damping), tied.within(stiffness)
    return FreeStructure(sp.csr_array(mass), sp.csr_array(damping), sp.csr_array(stiffness))


def _translations(bodies: Mapping[str, BuiltBody], total: int) -> Array:
    """What all freedoms (N, d) do as everything moves by one along each axis."""
    dimension = max((body.dimension for body in bodies.values()), default=2)
    unit = np.zeros((total, dimension))
    for body in bodies.values():
        freedoms = body.displacements(np.arange(len(body.points)))
        for axis in range(body.dimension):
            unit[freedoms[:, axis], axis] = 1.0
    return unit


def _with_sliding(case: Case, motion: PrescribedMotion) -> PrescribedMotion:
    """Bodies that slide through their mesh, and contacts that overlap, as motions that move no freedom."""
    sliding = tuple(name for name in case.moving if name not in motion.names)
    overlapping = tuple(distance_name("contacts", name) for name, c in case.contacts.items() if c.interference)
    names = (*sliding, *overlapping)
    if not names:
        return motion
    extra, before = len(names), len(motion.names)

    def wider(matrix: Array) -> Array:
        return np.hstack([matrix, np.zeros((len(matrix), extra))])

    def own(matrix: Array) -> Array:
        whole = np.zeros((before + extra, before + extra))
        whole[:before, :before] = matrix
        return whole

    return PrescribedMotion(
        (*motion.names, *names),
        wider(motion.lift),
        wider(motion.mass),
        wider(motion.damping),
        own(motion.mass_own),
        own(motion.damping_own),
        own(motion.stiffness_own),
        (*motion.full_distance.tolist(), *(0.0 for _ in sliding), *(1.0 for _ in overlapping)),
    )


def _references(case: Case) -> list[str]:
    """Every named point, and those that are watched."""
    named = [f"{name}.{point}" for name, beam in case.beams.items() for point in beam.point_names]
    for name, body in case.bodies.items():
        if isinstance(body, MassBody):
            named.append(name)
        elif name not in case.beams:
            named += [f"{name}.{point}" for point in getattr(body, "points", ())]
    return list(dict.fromkeys([*named, *case.temporal.watch]))


def _load(case: Case, view: View, name: str, load: Load) -> Array:
    """Force vector (n,) of a load at factor one."""
    if load.acts_on_bodies:
        return body_load(case, view, name, load)
    assert load.at is not None, "checked"
    at = case.location(load.at)
    body = view.bodies[at.body]
    if not isinstance(at, BoundaryRef):
        rows = view.point_rows(case, load.at).free
        if body.beam is not None:
            return rows.T @ np.array([*load.force, load.moment])
        force = np.zeros(body.dimension)
        force[: len(load.force)] = load.force
        return rows.T @ force
    assert body.mesh is not None, "checked: boundaries belong to meshes"
    facets = require_boundary(body.mesh, at.boundary, f"loads.{name}.at")
    thickness = getattr(case.bodies[at.body], "thickness", 1.0) if body.dimension == 2 else 1.0
    nodal = load.pressure * pressure_load(body.points, facets, thickness=thickness)
    if any(load.force):
        area = sum(float(a.sum()) for a in facet_areas(body.points, facets, thickness=thickness).values())
        nodal = nodal + traction_load(body.points, facets, np.array(load.force) / area, thickness=thickness)
    chosen = np.flatnonzero(np.any(nodal != 0.0, axis=1))
    return view.node_rows(body, chosen).free.T @ nodal[chosen].ravel()


def _initial(case: Case, view: View, key: str) -> Array | None:
    """Initial velocity or displacement (n,) of bodies that start so, None where none does."""
    found: Array | None = None
    for name, body in view.bodies.items():
        vector = getattr(case.bodies[name], key, None)
        if vector is None:
            continue
        if found is None:
            found = np.zeros(len(view.free))
        mine = view.freedoms_of(body)
        found[mine] = np.array(vector)[(view.free[mine] - body.offset) % body.stride]
    return found


def _cubic(view: View, links: Links) -> CubicSprings | None:
    chosen = np.flatnonzero(links.cubic)
    if not len(chosen):
        return None
    return CubicSprings(view.rows(links.rows[chosen]), links.cubic[chosen])


def _cells(body: BuiltBody) -> Mapping[str, IntArray]:
    return {"vertex": np.zeros((1, 1), dtype=np.int64)} if body.mesh is None else dict(body.mesh.cells)


def _dof_names(bodies: Mapping[str, BuiltBody]) -> list[str]:
    return [name for body in bodies.values() for name in body.freedom_names]


def _stress_stiffness(case: Case, view: View) -> Callable[..., Sparse] | None:
    """Geometric stiffness on the free freedoms from the stresses of a displacement (n,), None without solids.

    distances (p,): factors of the supports that are pressed away."""
    solids = [body for body in view.bodies.values() if body.mesh is not None and body.material is not None]
    if not solids:
        return None
    rows: dict[str, Rows] = {body.name: view.node_rows(body) for body in solids}

    def stiffness(displacement: Array, distances: Array | None = None) -> Sparse:
        total = sp.csr_array((len(view.free), len(view.free)))
        for body in solids:
            table = case.bodies[body.name]
            assert isinstance(table, SolidBody), "meshed bodies are solids"
            assert body.mesh is not None, "chosen for its mesh"
            assert body.material is not None, "solids have a material"
            own, lift = rows[body.name].free, rows[body.name].lift
            moved = own @ displacement
            if distances is not None:
                moved = moved + (lift - own @ view.motion.lift) @ distances
            matrix = stress_stiffness(
                body.mesh,
                body.material,
                model=table.model,
                thickness=table.thickness,
                displacement=moved,
            )
            total = total + own.T @ matrix @ own
        return sp.csr_array(total)

    return stiffness
