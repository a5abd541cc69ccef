"""Loads of whole bodies: weight and centrifugal load, consistent with the elements.

f = ∫ ρ φ a dV, with the acceleration a between the nodes by their own shape functions, is the consistent mass matrix
times the accelerations of the nodes, also where the case computes with a lumped mass: rigid accelerations and those of
turning, linear in the place, are taken exactly. Of imported bodies the matrix that was given is taken.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..case import Case
from ..case.bodies import BeamBody, SolidBody
from ..case.schema import CentrifugalTable, Load
from ..errors import CaseError
from ..fe.assembly import assemble_beam
from ..fe.solid import assemble_solid
from ..typing import Array, Sparse
from .bodies import BuiltBody
from .view import View


def body_load(case: Case, view: View, name: str, load: Load) -> Array:
    """Force (n,) [N] on the free freedoms; what acts on held ones is the support's.

    Raises CaseError for imported bodies of which no freedom is known to be a displacement.
    """
    whole = np.zeros(view.total)
    for body in view.bodies.values():
        if load.bodies is not None and body.name not in load.bodies:
            continue
        if not len(body.points):
            accepted = f"nothing says which freedoms of {body.name} move along x and y; give bodies.{body.name}.labels"
            raise CaseError(f"loads.{name}.bodies", load.bodies, accepted)
        acceleration = np.zeros(body.points.shape)
        if load.gravity is not None:
            acceleration += np.array(load.gravity)
        if load.centrifugal is not None:
            acceleration += outwards(body.points, load.centrifugal)
        motion = np.zeros(body.size)
        freedoms = body.displacements(np.arange(len(body.points))) - body.offset
        motion[freedoms.ravel()] = acceleration.ravel()
        whole[body.offset : body.offset + body.size] += _consistent_mass(case, body) @ motion
    return np.asarray(view.rows(sp.csr_array(whole[None])).free.toarray()[0])


def outwards(points: Array, turning: CentrifugalTable) -> Array:
    """ω² times the vectors (k, d) [m/s²] from the axis to points (k, d) [m]."""
    d = points.shape[1]
    arm = points - (np.zeros(d) if turning.centre is None else np.array(turning.centre))
    if d == 3:
        axis = np.array((0.0, 0.0, 1.0) if turning.axis is None else turning.axis)
        axis = axis / np.abs(axis).max()  # so that squares do not underflow
        axis = axis / np.linalg.norm(axis)
        arm = arm - np.outer(arm @ axis, axis)
    return turning.speed**2 * arm


def _consistent_mass(case: Case, body: BuiltBody) -> Sparse:
    table = case.bodies[body.name]
    if not isinstance(table, BeamBody | SolidBody) or table.mass == "consistent":
        return body.mass
    if body.beam is not None:
        return assemble_beam(body.beam)[0]
    assert isinstance(table, SolidBody), "beams are built from a beam"
    assert body.mesh is not None, "solids are meshed"
    assert body.material is not None, "solids have a material"
    return assemble_solid(body.mesh, body.material, model=table.model, thickness=table.thickness).mass
