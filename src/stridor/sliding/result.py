"""What steady sliding is: displacements, forces and slip of every contact node, and what else is in equilibrium."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..contact.multipliers import SLIP, STICK
from ..digits import readable
from ..notebook import Shown, counted, html_table
from ..typing import Array, BoolArray, IntArray
from .pressing import pulled
from .resultants import Balance, Resultant


@dataclass(frozen=True)
class OtherEquilibrium:
    """What else may be in equilibrium at the same friction: touching (m,), which nodes do, normal_force (m,) [N] in
    compression. contacts: those with a node that touches, in order."""

    touching: BoolArray
    normal_force: Array
    contacts: tuple[str, ...]

    @property
    def words(self) -> str:
        """As in "c touching (3 of 5 nodes, N = 1200 N)"."""
        count, force = int(np.count_nonzero(self.touching)), readable(float(self.normal_force.sum()), 4)
        who = ", ".join(self.contacts) or "none"
        return f"{who} touching ({count} of {counted(len(self.touching), 'node')}, N = {force} N)"

    def to_json(self) -> dict[str, object]:
        """An entry of ``others`` of `stridor steady --json`."""
        return {
            "contacts": list(self.contacts), "touching_nodes": int(np.count_nonzero(self.touching)),
            "normal_force": float(self.normal_force.sum()),
        }  # fmt: skip


@dataclass(frozen=True, repr=False)
class SteadySliding(Shown):
    """Equilibrium under friction of m contact nodes in d = 2 or 3 dimensions.

    displacement (n,) [m] relative to the moving supports. normal_force (m,) [N] in compression; friction_force
    (m, d−1) [N] on the slave along the tangents; slip_velocity (m, d−1) [m/s] of the slave relative to the master;
    sense (m, d−1) = −slip/|slip|, zero where a node does not slip and hence has no friction. active (m,) whether a
    node carries load; friction_coefficient (m,); gap (m,) [m], negative by N/K_c where contact has a stiffness.
    residual: largest imbalance of a freedom over the largest force. iterations: sets of touching nodes tried.
    resultants: contact → Resultant; balance: loads against contact forces. warnings: where nodes open or press in a
    pattern that no pressure explains. others: of a few nodes, the other equilibria at the same friction that
    `st.steady_sliding` found.

    status (m,): OPEN 0, STICK 1 or SLIP 2. With load steps sense is that of the friction force where nodes slip without
    a slip velocity, and zero where they stick; travel (p,) [s] is how far the motions have run, in units of their
    velocities.
    """

    displacement: Array
    normal_force: Array
    friction_force: Array
    slip_velocity: Array
    sense: Array
    active: BoolArray
    friction_coefficient: Array
    gap: Array
    residual: float
    iterations: int
    status: IntArray
    travel: Array
    resultants: Mapping[str, Resultant] = field(default_factory=dict)
    balance: Balance = Balance(np.nan, np.nan)
    warnings: tuple[str, ...] = ()
    others: tuple[OtherEquilibrium, ...] = ()

    @property
    def _line(self) -> str:
        stick, slip = (int(np.count_nonzero(self.status == kind)) for kind in (STICK, SLIP))
        closed = int(np.count_nonzero(self.active))
        return (
            f"{closed} of {counted(len(self.active), 'contact node')} {'carries' if closed == 1 else 'carry'} load "
            f"({stick} stick, {slip} slip), N = {readable(float(self.normal_force.sum()), 4)} N"
        )

    def _repr_html_(self) -> str:
        heads = ("contact", "force on the slave [N]", "pressed area [m²]", "largest pressure [Pa]")
        rows = [
            (
                name, ", ".join(readable(f, 4) for f in r.force),
                *("" if np.isnan(x) else readable(x, 4) for x in (r.area, r.largest_pressure)),
            )
            for name, r in self.resultants.items()
        ]  # fmt: skip
        return html_table(f"Steady sliding: {self._line}", heads, rows, self.warnings)

    @property
    def pulls(self) -> BoolArray:
        """Nodes (m,) of contacts kept closed that pull; friction goes with −N there."""
        return self.active & pulled(self.normal_force)

    @property
    def slip_speed(self) -> Array:
        """Size (m,) [m/s] of the slip velocity."""
        return np.linalg.norm(self.slip_velocity, axis=1)

    @property
    def slips_still(self) -> BoolArray:
        """Nodes (m,) at their limit of friction that no motion slides."""
        return (self.status == SLIP) & np.any(self.sense != 0.0, axis=1) & (self.slip_speed == 0.0)
