"""Random systems of few masses that rub on belts, for steppers to be set against one another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from marching import belt_motion, points_of, touch
from stridor.laws import Coulomb, StaticKinetic
from stridor.system import System


def random_system(seed: int) -> tuple[System, np.ndarray]:
    """Three to five masses on springs, rubbing on belts at one or two contacts that open and close; their start."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(3, 6)), int(rng.integers(1, 3))
    shape = np.linalg.qr(rng.normal(size=(n, n)))[0]
    stiffness = shape @ np.diag(rng.uniform(1.0, 60.0, n)) @ shape.T
    damping = (seed % 4 > 0) * (0.02 * np.eye(n) + 0.01 * np.outer(shape[0], shape[0]))
    contacts = []
    for k in range(m):
        friction = float(rng.uniform(0.1, 0.5))
        law = Coulomb(friction) if rng.random() < 0.5 else StaticKinetic(friction, 1.3 * friction)
        rows = np.linalg.qr(rng.normal(size=(n, 2)))[0].T
        contact = touch(*rows, law=law, slip=-float(rng.uniform(0.1, 0.5)), motions=1, name="AB"[k])
        contacts.append(replace(contact, stiffness=300.0) if rng.random() < 0.3 else contact)
    press = -sum(rng.uniform(0.5, 2.0) * c.normal_row for c in contacts)
    start = 0.3 * rng.normal(size=n)
    normals = np.array([c.normal_row for c in contacts])
    start = start + np.linalg.pinv(normals) @ (0.1 + 0.3 * rng.random(m) - normals @ start)  # open at first
    points = {k: replace(r, lift=np.zeros((2, 1))) for k, r in points_of(n, first=0, last=n - 1).items()}
    system = System(
        np.eye(n), damping, stiffness, tuple(contacts), {"press": press}, belt_motion(n), points
    )  # fmt: skip
    return system, start


def pressed_frame(
    seed: int, friction: float, *, nodes: int | None = None, contacts: int | None = None, rigid: bool | None = None,
    damping: float = 0.01,
) -> System:  # fmt: skip
    """Two to seven nodes in the plane, at random as far as not given, held by full matrices; the first up to three are
    pressed on belts, each in a direction of its own. Every freedom is a point: f0, f1, …"""
    rng = np.random.default_rng(seed)
    nodes = nodes or int(rng.integers(2, 8))
    contacts = contacts or int(rng.integers(1, min(3, nodes) + 1))
    n = 2 * nodes
    loose = rng.normal(size=(n, n))
    mass = np.diag(rng.uniform(0.8, 1.6, n)) + 0.15 * loose @ loose.T / n
    omega = np.sort(rng.uniform(0.7, 3.0, n))
    root = np.linalg.cholesky(mass)
    root_shape = root @ np.linalg.qr(rng.normal(size=(n, n)))[0]
    loose = root @ rng.normal(size=(n, n))
    viscous = damping * (root_shape * omega @ root_shape.T + 0.3 * loose @ loose.T / n)
    made, press = [], np.zeros(n)
    for k in range(contacts):
        hard = rng.random() < 0.5 if rigid is None else rigid
        angle = rng.uniform(0.0, 2 * np.pi) if rng.random() < 0.5 else rng.choice([0.0, 0.5, 1.0, 1.5]) * np.pi
        rng.choice(2)  # so that seeds stand for the frames that they are known by
        slip = rng.choice([-1, 1]) * rng.uniform(0.1, 0.6)
        stiffness = np.inf if hard else rng.uniform(2.0, 20.0)
        normal, tangent = np.zeros(n), np.zeros(n)
        normal[2 * k : 2 * k + 2] = np.cos(angle), np.sin(angle)
        tangent[2 * k : 2 * k + 2] = np.sin(angle), -np.cos(angle)
        contact = touch(normal, tangent, law=Coulomb(friction), slip=float(slip), motions=1, name="ABC"[k])
        made.append(replace(contact, stiffness=float(stiffness)))
        press -= rng.uniform(0.5, 1.5) * normal
    points = points_of(n, **{f"f{i}": i for i in range(n)})
    points = {name: replace(rows, lift=np.zeros((2, 1))) for name, rows in points.items()}
    return System(
        mass, 0.5 * (viscous + viscous.T), root_shape * omega**2 @ root_shape.T, tuple(made), {"press": press},
        belt_motion(n), points,
    )  # fmt: skip
