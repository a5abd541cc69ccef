"""The model in words and numbers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..case import Case
from ..case.bodies import BeamBody, MassBody, MatrixBody, ObstacleBody, SolidBody
from ..case.matrix_checks import MU
from ..case.schema import Contact, Friction, Load, Spring, TabulatedTable, Tie
from ..case.usual import USUAL
from ..contact.curve import Curve
from ..contact.facets import FacetSurface
from ..contact.master import CORNER_DEG
from ..contact.rim import steps_between_pieces
from ..errors import AnalysisError
from ..matrices.report import LOST, NO_FRICTION
from ..mesh.hanging import hanging, on_two_triangles
from ..mesh.model import Mesh
from ..mesh.quality import edge_lengths, pieces
from ..notebook import Shown, counted, html_table
from ..sliding import anything_acts, steady_nodes
from ..sliding.result import SteadySliding
from ..system import System
from ..temporal.inputs import unfit_in_time
from ..temporal.schedule import lay_out
from ..temporal.settings import coarse
from ..temporal.simulate import plan, step_of
from ..typing import Array
from .matrix_reports import matrix_reports
from .pressed import unpressed_in_time
from .settings import phases_of, settings_of
from .unit_warnings import matrix_warnings, resolution_warnings, unit_warnings
from .workspace import Problem, Workspace

STEP = 1e-6  # of a slave's facet: what pieces of a flat master below it may be apart in height
MOST_THROUGH = 0.2  # of a sliding velocity through a surface: facets on a curve make little of it

@dataclass(frozen=True, repr=False)
class Description(Shown):
    """The model in words and numbers, as `stridor check` prints it."""

    lines: tuple[str, ...]
    data: dict[str, Any]
    warnings: tuple[str, ...]

    @property
    def _line(self) -> str:
        more = f"; {counted(len(self.warnings), 'warning')}" if self.warnings else ""
        return self.lines[0] + more

    def _repr_html_(self) -> str:
        return html_table(self.lines[0], (), (), (*self.lines[1:], *self.warnings))

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {**self.data, "text": list(self.lines), "warnings": list(self.warnings)}


def describe(problem: Problem) -> Description:
    """Build the model, find its steady sliding and its step limit, and say it in words."""
    work = Workspace.of(problem)
    case, system = work.case("describe"), work.system()
    lines = [f"{case.title or 'case'}: {len(case.bodies)} bodies, {system.size} free degrees of freedom"]
    lines += [_body_words(case, system, name) for name in case.bodies]
    for name, support in case.supports.items():
        moving = (
            ", moves at " + ", ".join(f"{d} {v:g}" for d, v in support.velocity.items()) if support.velocity else ""
        )
        if support.displacement:
            moving += ", pressed away by " + ", ".join(
                f"{d} {v:g} {'rad' if d == 'rotation' else 'm'}" for d, v in support.displacement.items()
            )
        lines.append(f"  support {name} at {support.at} holds {', '.join(support.fixed)}{moving}")
    for name, load in case.loads.items():
        where = f"at {load.at}" if load.at else f"on {', '.join(load.bodies or ['all bodies'])}"
        lines.append(f"  load {name} {where}: {_load_words(load)}")
    lines += [f"  tie {name}: {tie.slave} follows {tie.master}{_way_words(tie)}" for name, tie in case.ties.items()]
    lines += [
        f"  spring {name}: {' to '.join(link.between)}, {link.stiffness:g} N/m{_spring_words(link)}"
        for name, link in case.springs.items()
    ]
    lines += [
        f"  dashpot {name}: {' to '.join(link.between)}, {link.damping:g} N s/m" for name, link in case.dashpots.items()
    ]
    data: dict[str, Any] = {
        "title": case.title,
        "bodies": {body.name: len(body.freedoms) for body in (*system.lines, *system.solids)},
        "degrees_of_freedom": system.size,
        "contacts": {},
    }
    lines += [f"  parameter {name} = {parameter.value:g}" for name, parameter in case.parameters.items()]
    lines += [
        f"  contact {name}: {_interference_words(contact.interference)}"
        for name, contact in case.contacts.items()
        if contact.interference
    ]
    lines += _contact_lines(case, system, data)
    if case.imported and not case.contacts:
        lines.append(_purpose(case))
    beyond = _with_friction(work, system)
    if why := _untimed(case, beyond):
        what = beyond.not_symmetric_definite
        lines.append(f"{what}: `stridor modes` and `stridor onsets` take that, time loops do not: {why}")
    else:
        lines += _time_lines(case, system, data)
    warnings = [*case.warnings, *unit_warnings(case), *matrix_warnings(case)]
    warnings += [*mesh_warnings(case, system), *imported_warnings(case, system), *system.tie_words]
    warnings += data.get("contact_patterns", [])
    if "modal" in case.model_fields_set:
        warnings += resolution_warnings(case)
    for contact in system.contacts:
        if contact.gap < -1e-9:
            warnings.append(f"contact {contact.name}: the bodies overlap by {-contact.gap:g} m; simulate refuses that")
        elif contact.gap > 1e-9:
            lines.append(f"contact {contact.name} is open by {contact.gap:g} m at the start")
    for surface in system.surfaces:
        least = float(surface.nodes.gap.min(initial=np.inf))
        if least > 1e-9 * max(1.0, float(np.ptp(surface.slave_position, axis=0).max())):
            lines.append(f"contact {surface.name} is open by {least:.3g} m or more at the start")
    warnings += _sudden(case)
    if why := unpressed_in_time(work, system):
        warnings.append(
            f"nothing presses the bodies together ({why}): simulate and compare refuse that, modes at most take the "
            "contacts as closed"
        )
    return Description(tuple(lines), data, tuple(warnings))


def _purpose(case: Case) -> str:
    """What can be asked of matrices that stridor makes no contact for."""
    told = "`stridor modes`, `stridor sensitivities` and `stridor countermeasures`"
    if MU in case.factor_names:
        low, high = case.modal.friction_range
        onsets = f"`stridor onsets` (mu from {low:g} to {high:g}, modal.friction_range)"
        return f"mu is in factors of matrices: for {onsets}, {told} (--mu); comparisons take constant matrices only"
    along = [name for name in case.parameters if name in case.factor_names]
    onsets = f", and `stridor onsets --along {along[0]}`" if along else ""
    return f"no contact, and mu in no factor: for {told}{onsets}; there is no critical mu to solve for"


def _with_friction(work: Workspace, system: System) -> System:
    """The system with friction in its matrices where factors depend on μ and nothing gives one: at 0 it is in none."""
    case = work.case("describe")
    unsaid = work.varies and MU not in case.parameters and not case.contacts
    return work.system(case.modal.friction_range[1]) if unsaid else system


def _untimed(case: Case, system: System) -> str:
    """Why matrices that are not symmetric cannot be marched in time, "" where they can."""
    if system.symmetric_definite:
        return ""
    if MU in case.factor_names and MU not in case.parameters and not case.contacts:
        return "factors of imported matrices depend on mu"
    return unfit_in_time(system)


def _sudden(case: Case) -> list[str]:
    """Distances that a run takes in one step, which is a blow."""
    found: list[str] = []
    before = dict.fromkeys(case.placed, 0.0)
    for number, phase in enumerate(case.phases):
        after = {name: phase.displacements.get(name, b if number else 1.0) for name, b in before.items()}
        jumps = [name for name in after if after[name] != before[name]]
        starts_steady = number == 0 and case.temporal.initial == "steady-sliding"
        if phase.ramp == 0 and jumps and not starts_steady:
            found.append(
                f"phase {phase.name}: {', '.join(jumps)} goes all of its distance in one step, a blow in simulate; "
                "give the phase a ramp, or start from steady sliding"
            )
        before = after
    return found


def _spring_words(link: Spring) -> str:
    """The cubic part and the dashpot of a spring, "" where it has none."""
    cubic = f" and {link.cubic:g} N/m³ times the cube" if link.cubic else ""
    return cubic + (f", with a dashpot of {link.damping:g} N s/m" if link.damping else "")


def _law_words(friction: Friction) -> str:
    """How friction changes with slip speed, "" where it does not."""
    law = friction.law_object()
    static = "" if law.sticking == law.sliding(0.0) else f", {law.sticking:g} while sticking"
    if law.constant:
        return static
    if isinstance(friction, TabulatedTable):
        first, last = friction.speeds[0], friction.speeds[-1]
        how = f"by a table of {len(friction.speeds)} speeds from {first:g} to {last:g} m/s, constant beyond"
    else:
        how = {"weakening": "falling exponentially", "hyperbolic": "falling as 1/(1 + delta v)"}[friction.law]
    return f" ({how}{static})"


def _time_lines(case: Case, system: System, data: dict[str, Any]) -> list[str]:
    """The time step against its limit, and how the time loop will go; added to the data."""
    settings = settings_of(case)
    path, reason, limit = plan(system, settings, phases_of(case))
    step = step_of(system, settings, phases_of(case))
    steps = sum(round(p.duration / step) for p in case.phases)
    data |= {"step": step, "step_limit": limit.step, "limiting_body": limit.body, "path": path, "steps": steps}
    share = f"{100 * step / limit.step:.0f} % of the stability limit {limit.step:.4g} s (set by {limit.body})"
    if path == "exact":
        share = "which is that of the records alone"
    elif path == "implicit":
        share = f"{1.0 / (step * case.modal.max_frequency_hz):.3g} to the period of modal.max_frequency_hz"
    few = coarse(step, settings, path, settings.system(system))
    phases, motion = phases_of(case), system.motion
    schedule = lay_out(phases, step, list(system.loads), list(motion.names), motion.full_distance)
    misfit = schedule.uneven(phases) if path in ("exact", "implicit") else schedule.stretched(phases)
    return [
        f"time step {step:.4g} s, {share}; {steps if steps < 1e12 else format(float(steps), '.3g')} steps",
        f"time loop: {path} path ({reason})",
        *((few,) if few else ()),
        *((f"simulate refuses these phases at steps of {step:.4g} s: {misfit}",) if misfit else ()),
    ]


def _body_words(case: Case, system: System, name: str) -> str:
    body = case.bodies[name]
    count = next((len(b.freedoms) for b in (*system.lines, *system.solids) if b.name == name), 0)
    if isinstance(body, BeamBody):
        return (
            f"  {name}: beam of {body.elements} elements, {body.length_m:g} m × {body.width:g} m × "
            f"{body.thickness:g} m, {body.material}, {body.mass} mass, {count} free"
        )
    if isinstance(body, MassBody):
        return f"  {name}: point mass of {body.mass:g} kg at {_vector(body.position)} m, {count} free"
    if isinstance(body, ObstacleBody):
        radius = "" if body.radius is None else f", radius {body.radius:g} m"
        return f"  {name}: rigid {body.shape} at {_vector(body.point)} m{radius}{_sliding_words(body)}"
    if isinstance(body, MatrixBody):
        return _matrix_words(name, body, system)
    solid = next(b for b in system.solids if b.name == name)
    kinds = ", ".join(f"{len(cells)} {kind}" for kind, cells in solid.cells.items())
    source = body.file if body.mesh is None else body.mesh.shape
    return (
        f"  {name}: solid ({body.model}), {source}, {len(solid.points)} nodes, {kinds}, "
        f"{body.material or 'material of the file'}, {body.mass} mass, {count} free{_sliding_words(body)}"
    )


def _matrix_words(name: str, body: MatrixBody, system: System) -> str:
    files = ", ".join(dict.fromkeys(Path(term.file).name for term in body.terms))
    mine = [k for k, said in enumerate(system.dof_names) if said.split(" ", 1)[0] == name]
    nodes = len({said.split(" ")[2] for said in (system.dof_names[k] for k in mine) if said.split(" ")[1] == "node"})
    mesh = f", {nodes} nodes" + (f" of {Path(body.mesh).name}" if body.mesh else "") if nodes else ""
    return f"  {name}: matrices ({files}){mesh}, {len(mine)} free{_sliding_words(body)}"


def imported_warnings(case: Case, system: System) -> list[str]:
    """Nodes of meshes that the matrices know nothing of, which count as held, also where a contact touches them; where
    the case has no contacts of its own, friction terms that got lost on the way here."""
    found: list[str] = []
    if case.imported and not case.contacts:
        for name, report in matrix_reports(case).items():
            lost = [w for w in report.matrices.warnings if w.startswith((LOST, NO_FRICTION))]
            found += [f"bodies.{name}: {w}" for w in lost]
    for solid in system.solids:
        if not isinstance(case.bodies[solid.name], MatrixBody):
            continue
        moves = np.diff(solid.rows.free.indptr).reshape(solid.points.shape).any(axis=1)
        still = int(np.count_nonzero(~moves))
        if still:
            found.append(
                f"bodies.{solid.name}: {still} of {len(moves)} nodes of the mesh have no freedoms and count as held; "
                "right where the other program held them, wrong where it condensed them out"
            )
    return found


def _sliding_words(body: SolidBody | MatrixBody | ObstacleBody) -> str:
    if body.sliding is None:
        return ""
    parts = [] if body.sliding.velocity is None else [f"at {_vector(body.sliding.velocity)} m/s"]
    parts += [f"turning at {body.sliding.spin:g} rad/s"] if body.sliding.spin else []
    return ", its material slides " + " and ".join(parts or ["not"])


def _vector(values: tuple[float, ...]) -> str:
    return "(" + ", ".join(f"{v:g}" for v in values) + ")"


def _way_words(tie: Tie) -> str:
    """How a body that repeats goes on at a tie."""
    if tie.translation is not None:
        return f", moved by {_vector(tie.translation)} m"
    return "" if tie.rotation is None else f", turned by {tie.rotation.angle_deg:g}°"


def _load_words(load: Load) -> str:
    parts = [f"{_vector(load.force)} N"] if any(load.force) else []
    parts += [f"{load.moment:g} N m"] if load.moment else []
    parts += [f"pressure {load.pressure:g} Pa"] if load.pressure else []
    parts += [f"gravity {_vector(load.gravity)} m/s²"] if load.gravity is not None else []
    if (turning := load.centrifugal) is not None:
        about = "" if turning.axis is None else f" about {_vector(turning.axis)}"
        through = "the origin" if turning.centre is None else f"{_vector(turning.centre)} m"
        parts.append(f"centrifugal load of turning at {turning.speed:g} rad/s{about} round {through}")
    return ", ".join(parts or ["nothing"])


def _contact_lines(case: Case, system: System, data: dict[str, Any]) -> list[str]:
    """Every contact in steady sliding: nodes that touch, forces and moments, pressure, the balance."""
    nodes = system.contact_nodes()
    if not nodes.count or not anything_acts(system):
        return []
    try:
        steady = steady_nodes(system)
    except AnalysisError as error:
        # Bodies that fly or swing have no steady sliding, and are a case all the same.
        return [f"  no steady sliding: {error}"]
    lines: list[str] = []
    for k, name in enumerate(nodes.names):
        mine = np.flatnonzero(nodes.owner == k)
        touching = int(steady.active[mine].sum())
        resultant = steady.resultants[name]
        normal, speed = float(steady.normal_force[mine].sum()), float(steady.slip_speed[mine].max(initial=0.0))
        table = case.contacts[name]
        law, point = _law_words(table.friction), bool(np.isnan(nodes.area[mine]).any())
        stiffness = _stiffness_words(table, point=point)
        head, ways = f"  contact {name}: {table.slave} on {table.master}", f"{table.sliding} sliding"
        if point and len(mine) == 1:
            force = f"{normal:.6g} N" if touching else "open"
            text = (
                f"{head}, μ = {steady.friction_coefficient[mine[0]]:g}{law}, {stiffness}, {ways}, "
                f"normal force {force}, slip speed {speed:g} m/s in steady sliding"
            )
        else:
            text = (
                f"{head}, {touching} of {len(mine)} slave nodes touch, {stiffness}{f', friction{law}' if law else ''}, "
                f"{ways}, normal force {normal:.6g} N, resultant on the slave "
                f"{_vector(tuple(float(f) for f in resultant.force))} N, slip speed up to {speed:g} m/s"
            )
        if np.isfinite(resultant.largest_pressure):
            text += f", pressure up to {resultant.largest_pressure:.4g} Pa on {resultant.area:.4g} m²"
        lines.append(text)
        data["contacts"][name] = {
            "normal_force": normal,
            "slip_speed": speed,
            "touches": touching > 0,
            "touching_nodes": touching,
            "nodes": len(mine),
            "force": [float(f) for f in resultant.force],
            "moment": np.atleast_1d(resultant.moment).astype(float).tolist(),
            "gap": float(nodes.gap[mine].min()),
        }
    lines.append(f"  {balance_words(steady)}")
    data["contact_patterns"] = list(steady.warnings)
    return lines


def _stiffness_words(contact: Contact, *, point: bool) -> str:
    text = "rigid" if contact.stiffness == "rigid" else f"{contact.stiffness:g} {'N/m' if point else 'N/m³'}"
    if contact.cubic:
        text += f" and {contact.cubic:g} {'N/m³' if point else 'N/m⁵'} times the cube of the approach"
    return text + (", kept closed" if contact.closed else "")


def _interference_words(interference: float) -> str:
    if interference > 0.0:
        return f"an interference of {interference:g} m is pressed out"
    return f"a negative interference, a gap of {-interference:g} m beside that of the meshes, which loads have to close"


def balance_words(steady: SteadySliding) -> str:
    """How well the equilibrium is solved, and loads balanced by the contacts where nothing else holds a body."""
    text = f"equilibrium of every freedom to {steady.residual:.1e} of the largest force"
    parts = [
        f"{what} to {error:.1e}"
        for what, error in (("forces", steady.balance.force_error), ("moments", steady.balance.moment_error))
        if np.isfinite(error)
    ]
    return text + (f"; in motions that only contact holds, {' and '.join(parts)}" if parts else "")


def mesh_warnings(case: Case, system: System) -> list[str]:
    """What of the meshes is probably not meant: several pieces, midside nodes on one side only, points off their body,
    material that slides out of its surface, overlaps passed over."""
    found: list[str] = []
    for solid in system.solids:
        body = case.bodies[solid.name]
        if not isinstance(body, SolidBody):
            continue
        where, mesh = f"bodies.{solid.name}", Mesh(solid.points, solid.cells)
        largest = edge_lengths(mesh)[1]
        count = pieces(mesh)
        if count > 1:
            found.append(
                f"{where}: {count} pieces that share no node; a tie, a spring or a support must hold each of them, or "
                "merge the nodes where they should be one"
            )
        if len(open_at := hanging(mesh)):
            place = ", ".join(f"{x:.6g}" for x in mesh.points[open_at[0]])
            belong, edges = ("belongs", "its edge") if len(open_at) == 1 else ("belong", "their edges")
            found.append(
                f"{where}: {counted(len(open_at), 'midside node')} {belong} to the cells on one side only, the first "
                f"at ({place}): the mesh is open along {edges}; take linear or quadratic cells on both sides, or "
                "tie two bodies"
            )
        if len(faces := on_two_triangles(mesh)):
            place = ", ".join(f"{x:.6g}" for x in faces[0])
            ends = "its corners" if len(faces) == 1 else "their corners"
            found.append(
                f"{where}: {counted(len(faces), 'face')} of hexahedra on two triangles of tetrahedra, the first at "
                f"({place}): the mesh is open between {ends}, as a face bends where triangles are flat; take cells "
                "of one kind on both sides, or tie two bodies"
            )
        for point, position in body.points.items():
            off = float(np.min(np.linalg.norm(solid.points - np.array(position), axis=1)))
            if off > 0.5 * largest:
                found.append(f"{where}.points.{point}: the nearest node is {off:.3g} m away")
    return found + _surface_warnings(case, system) + edge_warnings(system) + piece_warnings(system)


def piece_warnings(system: System) -> list[str]:
    """Slave facets over pieces of a master that do not lie in one surface."""
    found: list[str] = []
    for surface in system.surfaces:
        if surface.facets is None or not isinstance(surface.master, Curve | FacetSurface):
            continue
        nodes, steps = steps_between_pieces(
            surface.facets.blocks, surface.facets.own, surface.master, surface.location
        )  # fmt: skip
        size = max(
            float(np.linalg.norm(np.ptp(surface.location.point[row[row >= 0]], axis=0)))
            for block in surface.facets.blocks.values() for row in surface.facets.own[block] if (row >= 0).any()
        )  # fmt: skip
        # Normals at the ends of a curve are one-sided, by half of a facet's angle: h²/2R over a facet.
        some = steps > STEP * size + 4.0 * surface.master.chord_height
        if some.any():
            count = counted(int(some.sum()), "slave node")
            found.append(
                f"contact {surface.name}: {count} of facets over two pieces of the master, one up to "
                f"{float(steps.max()):.3g} m higher than the other: each node measures its gap to one of them alone "
                f"(the first at {_place(surface.slave_position[nodes[some][0]])}); let the slave's facets end between "
                "the pieces, or make them small beside what is between"
            )
    return found


def _place(point: Array) -> str:
    return "(" + ", ".join(f"{x:.6g}" for x in point + 0.0) + ") m"


def edge_warnings(system: System) -> list[str]:
    """Edges of masters in space, where slaves are, of which facets do not tell whether they are of a curve."""
    found: list[str] = []
    for surface in system.surfaces:
        if not isinstance(surface.master, FacetSurface) or not len(surface.master.doubtful):
            continue
        edges, places = surface.master.doubtful, surface.location.point
        beside = 0.1 * np.linalg.norm(np.ptp(places, axis=0))
        near = (edges[:, :3] >= places.min(axis=0) - beside) & (edges[:, :3] <= places.max(axis=0) + beside)
        for sharp in (False, True):
            some = edges[near.all(axis=1) & ((np.abs(edges[:, 3]) > np.radians(CORNER_DEG)) == sharp)]
            if not len(some):
                continue
            angle = float(np.degrees(np.abs(some[:, 3]).max()))
            how, what = (
                ("one after the other", "it is taken as edges; divide it into more facets if it is a curve")
                if sharp
                else (
                    "amid what is flat",
                    "a chamfer or flat of one row of facets or a curve, it is taken as a curve; mesh it with two rows "
                    "if it has edges there",
                )
            )
            lead = f"contact {surface.name}: edges of the master turn by {angle:.3g}° {how}"
            found.append(f"{lead}, the first at {_place(some[0, :3])}: {what}")
    return found


def _surface_warnings(case: Case, system: System) -> list[str]:
    """Surfaces that material would slide through, and overlaps that a large adjust passes over."""
    found: list[str] = []
    for surface in system.surfaces:
        drift = surface.drift.sum(axis=2) if surface.drift.shape[2] else np.zeros_like(surface.slave_position)
        # Of all slave nodes: those that a repeating tie makes one are one of the contact's nodes.
        through = float(np.abs(np.sum(drift * surface.location.normal, axis=1)).max(initial=0.0))
        fastest = float(np.linalg.norm(drift, axis=1).max(initial=0.0))
        if through > MOST_THROUGH * fastest:
            found.append(
                f"contacts.{surface.name}: sliding moves material through the surface at {through:.3g} m/s of "
                f"{fastest:.3g} m/s, and only what is along it counts; check velocity, axis and centre of sliding"
            )
        adjust = case.contacts[surface.name].adjust
        spread = float(np.ptp(surface.slave_position, axis=0).max())
        if spread > 0.0 and adjust > 0.1 * spread and not USUAL["Contact.adjust"].oddity("", adjust):
            found.append(
                f"contacts.{surface.name}.adjust: {adjust:g} m moves slave nodes by up to as much, and the slave is "
                f"{spread:.3g} m in extent; it is meant for the small misfit of meshes"
            )
    return found
