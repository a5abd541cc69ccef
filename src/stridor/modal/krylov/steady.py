"""What the modal approach needs of steady sliding: who touches, which way it slips, what the pressure adds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from ...contact.multipliers import SLIP, STICK
from ...contact.nodes import ContactNodes
from ...errors import AnalysisError, NotSlidingError
from ...sliding import (
    SteadySliding,
    anything_acts,
    friction_damping_matrix,
    full_motion,
    least_force,
    refuse_redundant,
    require_pressed,
    steady_nodes,
    steady_sliding,
    unstressed,
)
from ...sliding.motions import placed
from ...sliding.solution import STILL
from ...sliding.stick_slip import StickRows
from ...system import System
from ...typing import Array, BoolArray, IntArray, Sparse
from ..options import Options


@dataclass(frozen=True)
class TouchingNodes:
    """Nodes in contact: active (m,), and sense (m, d−1), the unit vector against the slip, zero where there is none;
    stuck (m,): touching nodes that do not slip either way. still: whether some slip at their limit without a motion
    that slides them. words: the same for a reader, "" where every node slides. force (m,): normal forces
    [N], None where nothing acts."""

    active: BoolArray
    sense: Array
    stuck: BoolArray
    still: bool = False
    words: str = ""
    force: Array | None = None


@dataclass(frozen=True)
class TouchingRows:
    """Rows of the touching nodes (m, n) csr, then those that hold stuck ones along their tangents: normal N, slip T,
    of unit length against the slip and zero where a node sticks, share (m,) of μ, compliance c (m,) [m/N]."""

    normal: Sparse
    slip: Sparse
    share: Array
    compliance: Array

    @cached_property
    def slide(self) -> Sparse:
        """S (m, n): friction pushes with μ S, each node with its share of μ."""
        return shared(self.slip, self.share)


def contact_rows(nodes: ContactNodes, touching: IntArray, sense: Array, stuck: BoolArray) -> TouchingRows:
    """What the nodes ``touching`` (k,) of all add to small motions: sense (m, d−1) and stuck (m,) are of all nodes.

    Friction gives each node its share of μ, none to those of a frictionless contact. A node that sticks is held along
    its tangents as a rigid contact is along its normal: rows with forces of their own.
    """
    chosen = nodes.select(touching)
    slip = chosen.along(sense[touching])
    if not np.any(stuck[touching]):
        return TouchingRows(chosen.normal, slip, chosen.share, chosen.compliance)
    sticks = StickRows(chosen)
    held = sticks.rows[sticks.held(np.ones(chosen.count, dtype=bool), stuck[touching])]
    return TouchingRows(
        sp.csr_array(sp.vstack([chosen.normal, held])),
        sp.csr_array(sp.vstack([slip, sp.csr_array(held.shape)])),
        np.concatenate([chosen.share, np.zeros(held.shape[0])]),
        np.concatenate([chosen.compliance, np.zeros(held.shape[0])]),
    )


def shared(slip: Sparse, share: Array) -> Sparse:
    """Rows of slip (m, n) times each node's share (m,) of μ."""
    return slip if np.all(share == 1.0) else sp.csr_array(sp.diags_array(share) @ slip)


def refuse_stick(system: System, what: str) -> None:
    """Raise AnalysisError where contacts may stick and ``what`` knows sliding only."""
    if system.load_steps:
        raise AnalysisError(
            f'{what}: knows contacts that slide, and steady.friction = "stick-slip" lets them stick; what takes that '
            "is `stridor steady`, `modes`, `onsets` over μ, `shapes`, `simulate` and `compare`"
        )


def touching_nodes(system: System, nodes: ContactNodes, mu: float | None, solver: str | None) -> TouchingNodes:
    """The nodes that carry load in steady sliding at `System.touching_at`, else at ``mu``, else at the laws' own
    coefficients; all of them where nothing acts on the system.

    Raises AnalysisError where there is no steady sliding, or nothing that presses.
    """
    system = system.in_place()
    mu = mu if system.touching_at is None else system.touching_at
    if anything_acts(system) and nodes.count:
        try:
            steady = steady_nodes(system, mu, solver)
        except NotSlidingError:
            raise  # at any μ
        except AnalysisError as error:
            at = "the case's own friction" if mu is None else f"μ = {mu:.6g}"
            raise AnalysisError(f"{error}; that is at {at}") from error
        require_pressed(system, steady.normal_force)
        if not system.load_steps:
            none = np.zeros(nodes.count, dtype=bool)
            # One that only rounding presses may as well be open, and no friction is in it that could feed a motion.
            active = steady.active & (nodes.kept | (steady.normal_force > least_force(system)))
            return TouchingNodes(active, steady.sense, none, force=steady.normal_force)
        stuck, still = steady.active & (steady.status == STICK), int(steady.slips_still.sum())
        closed, slips = int(steady.active.sum()), int((steady.status == SLIP).sum())
        limit = f" ({still} of them at their limit without a slip velocity, taken as sliding)" if still else ""
        holds, opened = int(np.count_nonzero(stuck)), nodes.count - closed
        words = (
            f"{'1 contact node sticks' if holds == 1 else f'{holds} contact nodes stick'}, {slips} "
            f"slip{'s' if slips == 1 else ''}{limit} and {opened} {'is' if opened == 1 else 'are'} open, as the static "
            f"equilibrium at {'their own friction' if mu is None else f'μ = {mu:g}'} has them"
        )
        return TouchingNodes(steady.active, steady.sense, stuck, still > 0, words, steady.normal_force)
    refuse_redundant(system)
    slip = nodes.slip_velocity(full_motion(system))
    speed = np.linalg.norm(slip, axis=1)
    slides = speed > STILL * float(speed.max(initial=0.0))
    needed = nodes.rubs
    still = [
        name for k, name in enumerate(nodes.names) if np.any(needed[m := nodes.owner == k]) and not np.any(slides[m])
    ]
    if still:
        raise AnalysisError(
            f"contact {', '.join(still)} does not slide: no support moves one of its bodies along the tangent; "
            "give a support a velocity"
        )
    sense = np.where(slides[:, None], -slip / np.where(slides, speed, 1.0)[:, None], 0.0)
    return TouchingNodes(np.ones(nodes.count, dtype=bool), sense, np.zeros(nodes.count, dtype=bool))


@dataclass(frozen=True)
class Steadiness:
    """The touching nodes' steady state as a function of μ, for the terms that depend on it.

    hardens: whether contact stiffness depends on the force; stretches: whether there are cubic springs, whose stiffness
    depends on how far the steady state stretches them. layer: the contact rows of the problem, those that hold nodes
    which stick behind those of the touching ones, with the compliances of some μ.
    """

    system: System
    nodes: ContactNodes
    touching: IntArray
    sloped: bool
    friction_damping: bool
    prestress: bool
    solver: str | None
    hardens: bool
    stretches: bool
    layer: TouchingRows

    @property
    def neutral(self) -> bool:
        """Whether the steady state adds nothing at any μ."""
        return not (self.damps or self.prestress or self.hardens or self.stretches)

    @property
    def reasons(self) -> list[str]:
        """What of the steady state adds terms, in words."""
        found = {
            "friction that changes with speed": self.sloped,
            "friction damping": self.friction_damping,
            "prestress": self.prestress,
            "contact stiffness with a cubic term": self.hardens,
            "cubic springs": self.stretches,
        }
        return [words for words, there in found.items() if there]

    @property
    def rests(self) -> bool:
        """Whether it adds nothing where there is no friction."""
        return not (self.prestress or self.hardens or self.stretches)

    @property
    def damps(self) -> bool:
        """Whether something of it works on velocities."""
        return self.sloped or self.friction_damping

    def terms(self, mu: float) -> tuple[Array | None, Sparse | None, Sparse | None]:
        """Weakening d (m,) [N s/m] along the slip, damping (n, n) and stiffness (n, n) at ``mu``, None where there is
        none.

        d = N dμ/d|v| is of each node's own law, scaled to the coefficient that the node has: the share of μ is in it.
        None of nodes that slip at their limit of friction without a slip velocity, as in `friction_damping_matrix`: the
        law has a corner there, and whichever way they begin to move back they stick.
        """
        if unstressed(self.system):
            return None, None, None
        try:
            steady = self._steady(mu)
        except AnalysisError as error:
            raise AnalysisError(placed(error, mu, ", of the range that was asked for")) from error
        weakening = damping = None
        if self.friction_damping and mu:
            damping = friction_damping_matrix(self.system, steady, slope=False)
        if self.sloped and mu:
            chosen = self.nodes.select(self.touching)
            slopes = chosen.friction_slopes(
                steady.slip_speed[self.touching], steady.friction_coefficient[self.touching]
            )
            # A node at its limit that no motion slides has no slip about which its law could be linearised.
            slopes = np.where(steady.slips_still[self.touching], 0.0, slopes)
            held = len(self.layer.compliance) - len(self.touching)
            pressing = np.abs(steady.normal_force[self.touching])  # a contact kept closed rubs where it pulls, too
            weakening = np.append(pressing * slopes, np.zeros(held))
        stiffness = None
        if self.prestress and self.system.stress_stiffness is not None:
            stiffness = self.system.stress_stiffness(steady.displacement)
        if self.hardens:
            change = self._hardening(mu, steady.normal_force)
            stiffness = change if stiffness is None else sp.csr_array(stiffness + change)
        if self.stretches:
            change = self._stretching(steady)
            stiffness = change if stiffness is None else sp.csr_array(stiffness + change)
        return weakening, damping, stiffness

    def _steady(self, mu: float) -> SteadySliding:
        """Steady sliding at ``mu``: with the nodes held where they are, else kept with the system, and sought from the
        nodes that touch here on."""
        held = self._held
        if held is not None:
            return steady_sliding(self.system, mu=mu, held=held, solver=self.solver)
        guess = np.zeros(self.nodes.count, dtype=bool)
        guess[self.touching] = True
        return steady_nodes(self.system, mu, self.solver, guess=guess)

    @property
    def _held(self) -> BoolArray | None:
        """The nodes (m,) that touch at every μ, where the system says so: of a stretch of μ in which they do."""
        if self.system.touching_at is None or self.system.load_steps:
            return None
        held = np.zeros(self.nodes.count, dtype=bool)
        held[self.touching] = True
        return held

    def _stretching(self, steady: SteadySliding) -> Sparse:
        """The stiffness 3 k₃ s² (n, n) of cubic springs that the steady state has stretched by s."""
        cubic = self.system.cubic
        assert cubic is not None, "asked for where there are some"
        stretch = cubic.rows.free @ steady.displacement + cubic.stretch + cubic.rows.lift @ steady.travel
        rates = sp.diags_array(3 * cubic.coefficient * stretch**2)
        return sp.csr_array(cubic.rows.free.T @ rates @ cubic.rows.free)

    def _hardening(self, mu: float, normal_force: Array) -> Sparse:
        """What contact at ``mu`` is stiffer than the layer, (N + μS)ᵀ Δk N (n, n)."""
        now = self.nodes.at_force(normal_force).compliance[self.touching]
        soft = np.flatnonzero(now > 0)
        normal = self.layer.normal[soft]
        change = sp.diags_array(1.0 / now[soft] - 1.0 / self.layer.compliance[soft])
        return sp.csr_array((normal + mu * self.layer.slide[soft]).T @ change @ normal)


def steadiness(
    system: System, nodes: ContactNodes, touching: IntArray, options: Options, layer: TouchingRows
) -> Steadiness:
    """What of the steady state matters here, beside the contact rows of the problem.

    Raises AnalysisError where something does but no load presses the bodies. Without contacts stresses are known where
    there is no load, too.
    """
    speeds = np.linalg.norm(nodes.slip_velocity(full_motion(system)), axis=1)
    slipping = touching[speeds[touching] > STILL * float(speeds.max(initial=0.0))]
    pairs = {(int(nodes.owner[k]), float(speeds[k])) for k in slipping}
    sloped = any(nodes.laws[owner].slope(speed) != 0.0 for owner, speed in pairs)
    across = options.friction_damping and nodes.directions == 2 and len(touching) > 0
    prestress = options.prestress and system.stress_stiffness is not None
    system = system.in_place()
    hardens = bool(np.any(nodes.cubic[touching] > 0))
    if (sloped or across or (prestress and nodes.count) or hardens) and not anything_acts(system):
        what = (
            "a friction law with a slope" if sloped
            else "friction damping" if across
            else "prestress" if prestress
            else "contact stiffness with a cubic term"
        )  # fmt: skip
        raise AnalysisError(f"{what} needs the normal force: give the case a load that presses the bodies")
    # Where nothing acts nothing stretches them.
    stretches = system.cubic is not None and bool(system.cubic.coefficient.size and anything_acts(system))
    return Steadiness(
        system, nodes, touching, sloped, across, prestress, options.solver, hardens, stretches, layer
    )
