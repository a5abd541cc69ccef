"""Benches to test on, and an oracle that shares nothing with the modal side: dense eigenvalues."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field

import numpy as np
import scipy.linalg as sl

from stridor.case import Case, loads, template_text
from stridor.contact.interface import Contact, Rows
from stridor.laws import Coulomb
from stridor.sliding import steady_sliding
from stridor.system import System, build_system
from stridor.system.model import PrescribedMotion

STEEL = {"young_modulus": 200e9, "density": 7800.0}


def paper_case(**changes) -> Case:
    """The published two-beam bench."""
    case = loads(template_text("two-beams"))
    return case.with_({key.replace("__", "."): value for key, value in changes.items()}) if changes else case


@dataclass(frozen=True)
class Slave:
    """A beam whose tip rests on the master at `place` of its length, leaning `lean_deg` off the normal.

    end "clamped": top held, tip pressed; "guided": top free along the normal (masters along an axis only)
    and pressed there.
    """

    place: float = 2 / 3
    lean_deg: float = 5.0
    length: float = 0.05
    thickness: float = 1.5e-3
    elements: int = 5
    damping: tuple[float, float] = (50.0, 1e-8)
    stiffness: float | str = 1e10
    end: str = "guided"
    side: int = 1
    friction: dict = field(default_factory=lambda: {"law": "coulomb", "coefficient": 0.1})
    force: float = 20.0
    young_modulus: float = 200e9


def bench(
    *slaves: Slave,
    angle_deg: float = 0.0,
    velocity: float = 0.02,
    length: float = 0.15,
    thickness: float = 3e-3,
    elements: int = 12,
    damping: tuple[float, float] = (50.0, 1e-8),
    mass: str = "consistent",
    modulus_factor: float = 1.0,
) -> System:
    """Slaves on one clamped master, which moves along itself."""
    return build_system(
        bench_case(
            *(slaves or (Slave(),)),
            angle_deg=angle_deg,
            velocity=velocity,
            length=length,
            thickness=thickness,
            elements=elements,
            damping=damping,
            mass=mass,
            modulus_factor=modulus_factor,
        )
    )


def bench_case(
    *slaves, angle_deg, velocity, length, thickness, elements, damping, mass, modulus_factor
) -> Case:
    along = np.array([math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))])
    master = {
        "type": "beam", "material": "base", "start": [0.0, 0.0], "angle_deg": angle_deg, "length": length,
        "width": 0.015, "thickness": thickness, "elements": elements, "mass": mass,
        "damping": {"mass": damping[0], "stiffness": damping[1]},
    }  # fmt: skip
    data: dict = {
        "materials": {"base": STEEL | {"young_modulus": 200e9 * modulus_factor}},
        "bodies": {"base": master},
        "supports": {
            "clamp": {
                "at": "base.start",
                "fixed": ["x", "y", "rotation"],
                "velocity": {"x": float(velocity * along[0]), "y": float(velocity * along[1])},
            }
        },
        "loads": {},
        "contacts": {},
    }
    for number, slave in enumerate(slaves):
        name = f"s{number}"
        normal = slave.side * np.array([-along[1], along[0]])
        up = angle_deg + slave.side * (90.0 - slave.lean_deg)
        data["materials"][name] = STEEL | {"young_modulus": slave.young_modulus * modulus_factor}
        data["bodies"][name] = {
            "type": "beam", "material": name, "start": [float(v) for v in slave.place * length * along],
            "angle_deg": up, "length": slave.length, "width": 0.01, "thickness": slave.thickness,
            "elements": slave.elements, "mass": mass,
            "damping": {"mass": slave.damping[0], "stiffness": slave.damping[1]},
        }  # fmt: skip
        if slave.end == "guided":
            free = "y" if abs(normal[1]) > 0.5 else "x"
            fixed = [d for d in ("x", "y", "rotation") if d != free]
            data["supports"][f"top{number}"] = {"at": f"{name}.end", "fixed": fixed}
            pressed = f"{name}.end"
        else:
            data["supports"][f"top{number}"] = {"at": f"{name}.end", "fixed": ["x", "y", "rotation"]}
            pressed = f"{name}.start"
        data["loads"][f"press{number}"] = {"at": pressed, "force": [float(v) for v in -slave.force * normal]}
        data["contacts"][f"C{number}"] = {
            "slave": f"{name}.start",
            "master": "base",
            "stiffness": slave.stiffness,
            "side": "left" if slave.side > 0 else "right",
            "friction": slave.friction,
        }
    return Case.checked(data)


def by_hand(
    mass, damping, stiffness, normal, tangent, contact_stiffness, *, slip=1.0, law=None, loads=None
) -> System:
    """A System from matrices, one contact per row of normal and tangent. slip: signed slip speed [m/s]."""
    mass, damping, stiffness = (np.asarray(a, dtype=float) for a in (mass, damping, stiffness))
    size = len(mass)
    column = np.zeros((size, 1))
    one = np.zeros((1, 1))
    motion = PrescribedMotion(("belt",), column, column, column, one, one, one)
    contacts = []
    for number, (n, t) in enumerate(zip(np.atleast_2d(normal), np.atleast_2d(tangent), strict=True)):
        nothing = Rows(np.zeros((2, size)), np.zeros((2, 1)))
        contacts.append(
            Contact(
                name=f"C{number}", slave=nothing, slave_position=np.zeros(2), master=nothing,
                master_positions=np.array([[0.0, 0.0], [1.0, 0.0]]), chords=np.ones(1),
                segment=0, xi=0.0, side=1,
                gap=0.0, normal=np.array([0.0, 1.0]), tangent=np.array([1.0, 0.0]),
                normal_row=np.asarray(n, dtype=float), tangent_row=np.asarray(t, dtype=float),
                normal_lift=np.zeros(1), tangent_lift=np.array([float(slip)]),
                stiffness=float(np.broadcast_to(contact_stiffness, len(np.atleast_2d(normal)))[number]),
                law=law or Coulomb(0.1),
            )
        )  # fmt: skip
    return System(mass, damping, stiffness, tuple(contacts), dict(loads or {}), motion)


def full_eigenvalues(system: System, mu: float, *, slopes=None) -> np.ndarray:
    """All finite eigenvalues (2n,) of the coupled problem by scipy.linalg.eig on the state matrix.

    Rigid contacts are eliminated: u moves within nᵀu = 0 and is tested with what the pushes do not work on.
    slopes (m,): N dμ/d|v| of each contact.
    """
    mass, damping, stiffness = (a.toarray() for a in (system.mass, system.damping, system.stiffness))
    normals = np.array([c.normal_row for c in system.contacts]).reshape(-1, system.size)
    tangents = np.array([c.tangent_row for c in system.contacts]).reshape(-1, system.size)
    sense = np.array([-np.sign(c.tangent_lift.sum()) for c in system.contacts])
    pushes = normals + mu * sense[:, None] * tangents
    rigid = np.array([not np.isfinite(c.stiffness) for c in system.contacts], dtype=bool)
    for k in np.flatnonzero(~rigid):
        stiffness = stiffness + system.contacts[k].stiffness * np.outer(pushes[k], normals[k])
    if slopes is not None:
        damping = damping + (tangents.T * slopes) @ tangents
    if rigid.any():
        right, left = sl.null_space(normals[rigid]), sl.null_space(pushes[rigid])
        mass, damping, stiffness = (left.T @ a @ right for a in (mass, damping, stiffness))
    n = len(mass)
    # Time in units of a middle period, for balance.
    tau = math.sqrt(np.linalg.norm(mass) / np.linalg.norm(stiffness))
    state = np.block(
        [
            [np.zeros((n, n)), np.eye(n)],
            [-np.linalg.solve(mass, stiffness) * tau**2, -np.linalg.solve(mass, damping) * tau],
        ]
    )
    return sl.eigvals(state) / tau


def growing(values: np.ndarray, tolerance: float = 1e-7) -> np.ndarray:
    """Upper half plane, real part above `tolerance` of |λ|."""
    return values[(values.imag >= 0) & (values.real > tolerance * np.abs(values))]


def distance_to(found: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Relative distance of each found eigenvalue to the nearest of the reference."""
    return np.abs(found[:, None] - reference).min(axis=1) / np.maximum(np.abs(found), 1.0)


def equilibria_by_hand(system: System, mu: float | None = None) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Displacement (n,), normal forces (m,) and who touches (m,) of every set of contacts that is in equilibrium: N ≥ 0
    on it and no gap below zero elsewhere; contacts kept closed touch, and where they pull friction is μ|N| as well.
    Dense, set by set and sign by sign."""
    n, m, right = system.size, len(system.contacts), []
    stiffness = system.stiffness.toarray()
    scale = np.abs(stiffness).max()
    motion = np.ones(len(system.motion.names))
    force = sum(system.loads.values()) - system.motion.damping @ motion
    slip = np.array([c.tangent_lift @ motion for c in system.contacts])
    friction = np.array([c.law.sliding(abs(v)) for c, v in zip(system.contacts, slip, strict=True)])
    friction = friction if mu is None else np.full(m, mu)
    normal, tangent = (np.array([getattr(c, key) for c in system.contacts]) for key in ("normal_row", "tangent_row"))
    gap, soft, kept = (np.array([getattr(c, key) for c in system.contacts]) for key in ("gap", "compliance", "closed"))
    # Of each contact: open, pushing, or pulling; of those kept closed the last two.
    for kinds in itertools.product(*((1, -1) if k else (0, 1) for k in kept)):
        on, sign = np.array(kinds) != 0, np.where(np.array(kinds) < 0, -1.0, 1.0)
        push = normal - (sign * friction * np.sign(slip))[:, None] * tangent
        whole = np.block([[stiffness, -scale * push[on].T], [scale * normal[on], np.diag(soft[on] * scale * scale)]])
        try:
            answer = np.linalg.solve(whole, np.concatenate([force, -scale * gap[on]]))
        except np.linalg.LinAlgError:
            continue
        forces = np.zeros(m)
        forces[on] = answer[n:] * scale
        gaps = (gap + normal @ answer[:n])[~on]
        if np.abs(answer[:n]).max() < 1e6 and (sign * forces >= 0).all() and (gaps >= 0).all():
            right.append((answer[:n], forces, on))
    return right


def touching(system: System, mu: float) -> np.ndarray:
    return steady_sliding(system, mu=mu).active
