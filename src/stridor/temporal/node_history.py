"""Histories of every slave node of the surface contacts: what stick–slip–separation waves are seen in."""

from __future__ import annotations

from dataclasses import dataclass

from ..typing import Array, IntArray

# Dimensions and units of what is kept of the nodes.
NODE_FIELDS = {
    "owner": (("slave_node",), "1"),
    "position": (("slave_node", "direction"), "m"),
    "area": (("slave_node",), "m2"),
    "tangents": (("slave_node", "tangent", "direction"), "1"),
    "normal_force": (("node_time", "slave_node"), "N"),
    "tangential_force": (("node_time", "slave_node", "tangent"), "N"),
    "slip_velocity": (("node_time", "slave_node", "tangent"), "m/s"),
    "gap": (("node_time", "slave_node"), "m"),
    "status": (("node_time", "slave_node"), "1"),
}


@dataclass(frozen=True)
class NodeHistory:
    """m slave nodes of contacts `names`, r records, d dimensions.

    time (r,) [s]; owner (m,) index into names; position (m, d) [m] in the reference configuration; area (m,) [m²],
    NaN for point contacts. normal_force (r, m) [N] in compression; tangential_force (r, m, d−1) [N] on the slave and
    slip_velocity (r, m, d−1) [m/s] of the slave relative to the master along the node's tangents (m, d−1, d);
    gap (r, m) [m]; status (r, m) 0 separation, 1 stick, 2 slip. Of implicit steps forces are means over the steps
    before and after the record, so that a node which opens or closes there may have one at an open gap.
    """

    names: tuple[str, ...]
    owner: IntArray
    position: Array
    area: Array
    tangents: Array
    time: Array
    normal_force: Array
    tangential_force: Array
    slip_velocity: Array
    gap: Array
    status: IntArray

    @property
    def pressure(self) -> Array:
        """Normal force per area (r, m) [Pa]; NaN for point contacts."""
        return self.normal_force / self.area
