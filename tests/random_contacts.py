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
