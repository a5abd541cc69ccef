"""Steady sliding: the equilibrium that both approaches start from, of any number of contact nodes.

K u − Σ (n + μ s·t) N = f − C_L v,   g₀ + n u + N/K_c = 0,   N ≥ 0   (paper 1.3, eqs 2–4)

with s = −w/|w| the direction opposite to a node's slip velocity w, so that friction opposes the slip. Where a system
has load steps, nodes that no motion slides stick or slip as these leave them (`stick_slip`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import scipy.sparse as sp

from ..contact.multipliers import OPEN, SLIP
from ..contact.nodes import ContactNodes
from ..direct import SingularMatrix
from ..errors import AnalysisError, NotSlidingError
from ..mesh.model import Mesh
from ..mesh.quality import pieces
from ..stages import passing, stage
from ..system import System
from ..typing import Array, BoolArray, IntArray, Sparse
from .equilibrium import ContactRows, Equilibrium, NodeEquilibrium, find_touching, of_every_set, sets_near
from .history import STILL, follow
from .motions import external_force, full_motion, words_of_friction
from .pattern import left_by_facets, unexplained_patterns
from .pressing import pulled
from .redundant import closed, nearly_one, redundant
from .result import OtherEquilibrium, SteadySliding
from .resultants import balance, resultants
from .scales import moved_most, owner

ALL_TRIED = 5  # nodes of which it is looked whether other sets are in equilibrium as well
PRESSED = 1e-12  # of the largest force on a freedom: contact forces no larger are rounding of it
MECHANISM = 1e12  # of the largest force over the stiffest entry: what moves so far meets no resistance
ROUNDING = 1e-14  # of the displacement that the largest contact force gives the stiffest freedom
UNLOADED = 1e-9  # of the largest contact force: what is none
SIGN_CHANGES = 30
MOST = 100_000  # unknowns of all sets of nodes that are tried where one of them does not hold the structure
STEADY = "steady sliding of nodes"


@passing()
def steady_sliding(
    system: System,
    *,
    mu: float | None = None,
    load_factors: Mapping[str, float] | None = None,
    motion_factors: Array | None = None,
    guess: BoolArray | None = None,
    held: BoolArray | None = None,
    solver: str | None = None,
) -> SteadySliding:
    """Solve the steady sliding equilibrium of every contact, over points and over surfaces.

    mu replaces the friction coefficient of every contact, at its mean slip speed (`ContactNodes`); load_factors
    default to one for every load, motion_factors (p,) to one for every support. guess (m,): nodes that are likely to
    touch, as `active` of a solution at another coefficient, which saves most of the steps. held (m,): the nodes that
    touch, whichever the signs of their forces and of the others' gaps: what small motions about another μ hold, smooth
    in μ. solver is that of `direct.factorise`.
    A system with load steps is taken through them, and factors can only be those of the last. Raises AnalysisError
    where a contact does not slide or would change its gap, where no contact carries load, and where the structure is
    not held.
    """
    if system.load_steps:
        _require_last(system, load_factors, motion_factors)
        return _after_load_steps(system, mu, solver)
    velocities = full_motion(system)
    factors = velocities if motion_factors is None else np.asarray(motion_factors, dtype=float) * velocities
    system = system.in_place()
    nodes = system.contact_nodes()
    slip = nodes.slip_velocity(factors)
    speed = np.linalg.norm(slip, axis=1)
    _require_constant_gap(nodes, factors, speed)
    coefficient = nodes.friction_coefficients(speed) if mu is None else nodes.coefficients(mu, speed)
    slips = speed > STILL * float(speed.max(initial=0.0))
    if not slips.any():
        try:
            _require_slip(nodes, slips, coefficient, np.ones(nodes.count, dtype=bool))
        except AnalysisError as error:
            raise NotSlidingError(str(error)) from error
    sense = np.where(slips[:, None], -slip / np.where(slips, speed, 1.0)[:, None], 0.0)
    force = external_force(system, load_factors) - system.motion.damping @ factors
    rubs = bool(np.any(coefficient[:, None] * sense))
    symmetric = not rubs and system.symmetric_definite
    stage("steady sliding" if mu is None else f"steady sliding at μ = {mu:.6g}")

    with np.errstate(over="ignore"):
        beyond = float(coefficient.max(initial=0.0)) * float(np.abs(system.stiffness.data).max(initial=0.0)) ** 2
    if not np.isfinite(beyond):
        raise AnalysisError(
            f"steady sliding has no equilibrium in numbers that a computer has at {words_of_friction(coefficient)}; "
            "lower the friction coefficient"
        )

    def opposing(sign: Array) -> Equilibrium:
        rubbing = (sign * coefficient)[:, None] * sense
        push = sp.csr_array(nodes.normal + nodes.along(rubbing)) if rubs else nodes.normal
        return Equilibrium(system, nodes, push, force, symmetric=symmetric, solver=solver, rubbing=rubbing)

    try:
        equilibrium, state, iterations = _with_friction(opposing, nodes, coefficient if rubs else None, guess, held)
    except SingularMatrix as error:
        raise AnalysisError(_loose(system, nodes, error.motion)) from error
    except AnalysisError as error:
        # Forces that no equation tells are rounding: which nodes seem to pull changes from step to step.
        if twice := redundant(system, nodes, nodes.compliance == 0.0):
            raise AnalysisError(twice) from error
        raise
    residual = equilibrium.residual(state)
    _require_held(system, nodes, state, residual, force)
    # Where nothing but rigid contact holds the structure, displacements are rounding of its forces.
    rounding = ROUNDING * float(np.abs(state.normal_force).max(initial=0.0)) / equilibrium.scale
    touches = closed(state.active, state.gap, state.displacement, rounding)
    rigid = nodes.compliance == 0.0
    if twice := nearly_one(system, touches, rigid) or redundant(system, nodes, touches & rigid):
        raise AnalysisError(twice)
    # What presses by rounding of other forces does not press.
    least = PRESSED * float(np.abs(force).max(initial=0.0))
    active = state.active & ((state.normal_force > least) | nodes.kept)
    _require_slip(nodes, slips, coefficient, active)  # a stop beside, which stays open, need not
    if nodes.count and not active.any() and held is None:
        raise AnalysisError(
            f"no contact carries load in steady sliding at {words_of_friction(coefficient)} (contacts: "
            f"{', '.join(nodes.names)}): "
            + (
                "; ".join(left_by_facets(system))
                or "the loads pull the bodies apart, or friction lifts them off at this coefficient; check the "
                "direction of the loads"
            )
        )
    # What pulls by rounding does not pull.
    own = nodes.kept if held is None else np.ones(nodes.count, dtype=bool)
    normal = np.where(own, state.normal_force, np.maximum(state.normal_force, 0.0))
    sign = _signs(nodes, state)
    friction = (sign * coefficient)[:, None] * sense * normal[:, None]
    if rubs:
        sense = sign[:, None] * sense
    return SteadySliding(
        displacement=state.displacement,
        normal_force=normal,
        friction_force=friction,
        slip_velocity=slip,
        sense=sense,
        active=state.active,
        friction_coefficient=coefficient,
        gap=state.gap,
        residual=residual,
        iterations=iterations,
        status=np.where(state.active, SLIP, OPEN),
        travel=np.zeros(len(factors)),
        resultants=resultants(nodes, normal, friction, state.active),
        balance=balance(system, force, equilibrium.push.T @ state.normal_force),
        warnings=tuple(unexplained_patterns(system, normal, state.gap, state.active)),
    )


def _with_friction(
    opposing: Callable[[Array], Equilibrium], nodes: ContactNodes, friction: Array | None, guess: BoolArray | None,
    held: BoolArray | None,
) -> tuple[Equilibrium, NodeEquilibrium, int]:  # fmt: skip
    """The equilibrium in which friction μ|N| opposes the slip, and how many sets of touching nodes were tried: where a
    contact kept closed pulls, friction goes with −N, and ``opposing`` makes the equations of such signs (m,). friction:
    the coefficients (m,), None where nothing rubs. Of few nodes every set and every sign is tried where the search
    does not settle, or meets a set that has no equilibrium. Raises what `find_touching` does."""
    sign, iterations = np.ones(nodes.count), 0
    equilibrium = opposing(sign)
    at = "" if friction is None else f" at {words_of_friction(friction)}"
    try:
        for _ in range(SIGN_CHANGES):
            state, tried = find_touching(equilibrium, guess, at=at) if held is None else (equilibrium.solve(held), 1)
            iterations += tried
            found = _signs(nodes, state)
            if friction is None or np.array_equal(found, sign):
                return equilibrium, state, iterations
            sign = found
            equilibrium = opposing(sign)
        hint = " or give them a finite stiffness" if np.any(nodes.compliance[nodes.kept] == 0.0) else ""
        raise AnalysisError(
            f"steady sliding{at}: where contacts kept closed push and where they pull does not settle in "
            f"{SIGN_CHANGES} steps; with so much friction there may be no equilibrium: lower the friction "
            f"coefficient{hint}"
        )
    except AnalysisError:
        turning = np.flatnonzero(nodes.kept) if friction is not None else np.zeros(0, dtype=np.int64)
        if held is not None or 2**nodes.count * len(equilibrium.force) > MOST:
            raise
        for turned in sets_near(np.zeros(nodes.count, dtype=bool), turning):
            equilibrium = opposing(np.where(turned, -1.0, 1.0))
            for state in of_every_set(equilibrium):
                if friction is None or np.array_equal(_signs(nodes, state) < 0.0, turned):
                    return equilibrium, state, iterations
        raise


def _signs(nodes: ContactNodes, state: NodeEquilibrium) -> Array:
    """Of μ (m,): against the slip where nodes push, with it where those kept closed pull."""
    return np.where(nodes.kept & pulled(state.normal_force), -1.0, 1.0)


def other_equilibria(system: System, found: SteadySliding, mu: float | None = None) -> list[OtherEquilibrium]:
    """The other sets of touching nodes that are in equilibrium at the same friction, where all can be tried: of a few
    nodes, without load steps."""
    nodes = system.contact_nodes()
    free = np.flatnonzero(~nodes.kept)
    if system.load_steps or not 0 < len(free) <= ALL_TRIED:
        return []
    return system.once(("other equilibria", mu), lambda: _others(system, found, mu, free))


def _others(system: System, found: SteadySliding, mu: float | None, free: IntArray) -> list[OtherEquilibrium]:
    others, nodes = list[OtherEquilibrium](), system.contact_nodes()
    stiffest = float(np.abs(system.stiffness.data).max(initial=0.0))
    # One that differs in contacts without force and gap is the same.
    known = {_loaded(found).tobytes()}
    for active in sets_near(found.active, free):
        if np.array_equal(active, found.active):
            continue
        try:
            held = steady_sliding(system, mu=mu, held=active)
        except AnalysisError:
            continue
        largest = float(np.abs(held.normal_force).max(initial=0.0))
        # All gaps may be none but for rounding.
        rounding = ROUNDING * largest / stiffest if stiffest else 0.0
        overlaps = max(1e-9 * float(np.abs(held.gap[free]).max(initial=0.0)), rounding)
        force, gap, own = held.normal_force[free], held.gap[free], active[free]
        if np.any(force[own] < -UNLOADED * largest) or np.any(gap[~own] < -overlaps):
            continue
        loaded = _loaded(held)
        if loaded.tobytes() not in known:
            known.add(loaded.tobytes())
            names = tuple(dict.fromkeys(nodes.names[k] for k in nodes.owner[loaded]))
            others.append(OtherEquilibrium(loaded, held.normal_force, names))
    return others


def _loaded(found: SteadySliding) -> BoolArray:
    """Nodes (m,) that carry more than rounding of the others' forces."""
    force = np.abs(found.normal_force)
    return found.active & (force > UNLOADED * float(force.max(initial=0.0)))


def steady_nodes(
    system: System, mu: float | None = None, solver: str | None = None, *, guess: BoolArray | None = None
) -> SteadySliding:
    """`steady_sliding` under all loads and motions, solved once for each μ and kept with the system; guess: where
    it begins if it is not known."""
    return system.once((STEADY, mu, solver), lambda: steady_sliding(system, mu=mu, guess=guess, solver=solver))


def _after_load_steps(system: System, mu: float | None, solver: str | None) -> SteadySliding:
    nodes = system.contact_nodes()
    last = system.load_steps[-1]
    if last.duration is None:
        slip = nodes.slip_velocity(last.velocities)
        _require_constant_gap(nodes, last.velocities, np.linalg.norm(slip, axis=1))
    found = follow(system, mu=mu, solver=solver)
    state, load = found.state, found.load
    active = state.status != OPEN
    if nodes.count and not np.any(active & (state.normal_force > 0.0)):
        raise AnalysisError(
            f"no contact carries load after the load steps (contacts: {', '.join(nodes.names)}); check the direction "
            "of the loads"
        )
    force = nodes.normal.T @ state.normal_force + nodes.tangent.T @ state.friction.ravel()
    return SteadySliding(
        displacement=state.displacement,
        normal_force=np.maximum(state.normal_force, 0.0),
        friction_force=state.friction,
        slip_velocity=found.slip,
        sense=np.where((state.status == SLIP)[:, None], state.direction, load.driven),
        active=active,
        friction_coefficient=load.mu,
        gap=state.gap,
        residual=found.residual,
        iterations=found.solved,
        status=state.status,
        travel=state.travel,
        resultants=resultants(nodes, state.normal_force, state.friction, active),
        balance=balance(system, load.force, force),
        warnings=tuple(unexplained_patterns(system, np.maximum(state.normal_force, 0.0), state.gap, active)),
    )


def _require_last(system: System, load_factors: Mapping[str, float] | None, motion_factors: Array | None) -> None:
    """Raise AnalysisError where other loads or motions are asked for than those that the load steps end with."""
    last = dict.fromkeys(system.loads, 0.0)
    for step in system.load_steps:
        last.update(step.loads)
    if load_factors is not None:
        for name, factor in last.items():
            if load_factors.get(name, 1.0) != factor:
                raise AnalysisError(
                    f"the static equilibrium ends with {factor:g} times load {name}, and "
                    f"{load_factors.get(name, 1.0):g} times is asked for; give the last of steady.steps and the first "
                    "phase the same factors"
                )
    running = full_motion(system)
    if motion_factors is not None and not np.array_equal(np.asarray(motion_factors), running):
        given, own = (", ".join(f"{v:g}" for v in np.asarray(a)) for a in (motion_factors, running))
        raise AnalysisError(
            f"the static equilibrium ends with {own} times the velocities of {', '.join(system.motion.names)}, and "
            f"{given} times is asked for; give the last of steady.steps and the first phase the same factors"
        )


def force_rates(system: System, steady: SteadySliding, solver: str | None = None) -> Array:
    """dN/dμ (m,) [N] of the normal forces, with the nodes held that touch and every μ_i growing by its share:

    K u' − (n + μ s·t)ᵀ N' = (s·t)ᵀ N,    n u' + c N' = 0,

    the derivative of the equations of steady sliding. Without springs and contact beyond the linear. Raises
    direct.SingularMatrix where the equilibrium is the last of its branch.
    """
    system = system.in_place()
    nodes = system.contact_nodes()
    push = sp.csr_array(nodes.normal + nodes.along(steady.friction_coefficient[:, None] * steady.sense))
    force = nodes.along(nodes.share[:, None] * steady.sense).T @ steady.normal_force
    rows = ContactRows(nodes.normal, np.zeros(nodes.count), nodes.compliance, np.zeros(nodes.count), nodes.kept)
    change = Equilibrium(system, rows, push, force, symmetric=False, solver=solver).solve(steady.active)
    return change.normal_force


def touching(system: System, steady: SteadySliding) -> ContactNodes:
    """The contact nodes that carry load, in the order of the system's."""
    return system.contact_nodes().select(steady.active)


def friction_damping_matrix(system: System, steady: SteadySliding, *, slope: bool = True) -> Sparse:
    """Damping (n, n) csr [N s/m] that friction adds to small motions about steady sliding.

    Friction keeps opposing the slip as its direction turns, which damps motion across it with μ N/|w| (in space
    only); along it the law's slope N dμ/d|w| counts, negative where friction weakens with speed. A node that does
    not slip adds nothing. slope False leaves what acts along it to who has it already.
    """
    nodes = system.contact_nodes()
    speed = steady.slip_speed
    # Where a node is at its limit and no motion slides it, friction has no slip to turn with.
    working = steady.active & np.any(steady.sense != 0.0, axis=1) & ~steady.slips_still
    chosen = nodes.select(working)
    speed, mu = speed[working], steady.friction_coefficient[working]
    normal, sense = steady.normal_force[working], steady.sense[working]
    normal = np.abs(normal)  # a contact kept closed rubs where it pulls, too
    matrix = sp.csr_array((system.size, system.size))
    if slope:
        parallel = chosen.along(sense)
        matrix = parallel.T @ sp.diags_array(normal * chosen.friction_slopes(speed, mu)) @ parallel
    if nodes.directions == 2:
        across = chosen.along(np.stack([-sense[:, 1], sense[:, 0]], axis=1))
        matrix = matrix + across.T @ sp.diags_array(mu * normal / speed) @ across
    return sp.csr_array(matrix)


def _require_constant_gap(nodes: ContactNodes, factors: Array, speed: Array) -> None:
    opening = np.abs(nodes.normal_lift @ factors)
    for k, name in enumerate(nodes.names):
        mine = nodes.owner == k
        fastest, slip = float(opening[mine].max(initial=0.0)), float(speed[mine].max(initial=0.0))
        if fastest > 1e-9 * max(slip, 1e-30) and fastest > 1e-15:
            raise AnalysisError(
                f"contact {name}: the prescribed velocities change its gap at {fastest:g} m/s, "
                "so there is no steady sliding; let the supports move along the master surface"
            )


def _require_slip(nodes: ContactNodes, slips: BoolArray, coefficient: Array, touches: BoolArray) -> None:
    """Raise AnalysisError where a contact touches and does not slide: how its friction acts is then not known."""
    for k, name in enumerate(nodes.names):
        mine = nodes.owner == k
        if touches[mine].any() and not slips[mine].any() and np.any(coefficient[mine] > 0.0):
            raise AnalysisError(
                f"contact {name} does not slide: no support moves one of its bodies along the "
                "tangent; give a support a velocity"
            )


def _loose(system: System, nodes: ContactNodes, motion: Array | None, *, far: bool = False) -> str:
    """What to say of a motion that meets no resistance; far: that it goes beyond any size for that is known."""
    if twice := redundant(system, nodes, nodes.compliance == 0.0):
        return twice
    moved = None if motion is None else moved_most(system, motion[: system.size])
    if moved is not None and moved.resisted and (moved.apart or not far):
        return f"steady sliding cannot be told: {moved.apart or _balanced(moved.who)}"
    who = "the structure" if moved is None else moved.who
    return (
        f"steady sliding has no equilibrium: {who} can move freely under the loads{_parts(system, who)}; fix a "
        "freedom of the loose body, or turn the load so that it presses the bodies together"
    )


def _parts(system: System, who: str) -> str:
    """What to add where a body's mesh does not hang together: one part may be held and another one not."""
    for solid in system.solids:
        if solid.cells and who == f"body {solid.name}" and (count := pieces(Mesh(solid.points, solid.cells))) > 1:
            return (
                f": its mesh has {count} pieces that share no node, each of which a tie, a spring or a support must "
                "hold (of a file with several bodies take one by its group)"
            )
    return ""


def _moved_most(system: System, size: Array) -> str:
    return owner(system, int(np.argmax(size)))[0]


def _balanced(who: str) -> str:
    return (
        f"its equations are singular to working precision, in a motion of {who} that its own stiffness resists; forces "
        "of contact and friction push on as hard there: change the friction coefficient, the contact stiffness or what "
        "holds the body"
    )


def _require_held(
    system: System, nodes: ContactNodes, state: NodeEquilibrium, residual: float, force: Array
) -> None:
    """A mechanism that rounding keeps from being singular shows in displacements beyond any structure's size; so do
    loads that no structure of these stiffnesses carries, but those in proportion to what stiffness makes of them."""
    extents = [float(np.ptp(line.coordinates, axis=0).max()) for line in system.lines]
    extents += [float(np.ptp(solid.points, axis=0).max()) for solid in system.solids]
    # Point masses alone have no size.
    limit = 1e6 * max(extents) if max(extents, default=0.0) > 0 else 1e12
    farthest = float(np.abs(state.displacement).max(initial=0.0))
    if residual <= 1e-8 and farthest <= limit:
        return
    largest = max(float(np.abs(of).max(initial=0.0)) for of in (force, state.normal_force))
    stiffest = float(np.abs(system.stiffness.data).max(initial=0.0))
    if farthest > limit and farthest * stiffest < MECHANISM * largest:
        raise AnalysisError(
            f"steady sliding would move {_moved_most(system, np.abs(state.displacement))} by {farthest:.3g} m under "
            f"forces of up to {largest:.3g} N: loads, interference or gaps are beyond what the stiffness takes in "
            "small displacements; check their units and digits"
        )
    raise AnalysisError(_loose(system, nodes, state.displacement, far=farthest > limit))

