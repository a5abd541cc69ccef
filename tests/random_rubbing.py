"""Random masses that rub on belts, some of them coupled to no other, and the dense truth of their small motions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stridor.case import Case


@dataclass(frozen=True)
class Rubbing:
    """A case at its friction coefficient, and its small motions M ü + C u̇ + K u = 0 about steady sliding."""

    case: Case
    mu: float
    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    pressed: bool

    def modes(self) -> tuple[np.ndarray, np.ndarray]:
        """λ (k,) of what vibrates, the fastest first, and displacements (k, n)."""
        n = len(self.mass)
        first = np.block([[np.zeros((n, n)), np.eye(n)],
                          [-np.linalg.solve(self.mass, self.stiffness), -np.linalg.solve(self.mass, self.damping)]])  # fmt: skip
        lam, vectors = np.linalg.eig(first)
        kept = np.flatnonzero(lam.imag > 0.0)
        kept = kept[np.argsort(-lam.real[kept])]
        return lam[kept], vectors[:n, kept].T


def random_rubbing(seed: int, *, limit: float = 50.0, step: float = 0.02, mu: float | None = None) -> Rubbing:
    """Two to four masses on springs at random angles, a pair in two coupled, one to three of them pressed on belts
    of different speeds. All frequencies lie below 1 Hz; limit [Hz]: up to where they are looked at."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 5))
    contacts, n = int(rng.integers(1, min(3, count) + 1)), 2 * count
    drawn = round(float(rng.uniform(0.1, 0.7)), 3)
    mu = drawn if mu is None else mu
    mass, damping, stiffness = np.diag(np.repeat(rng.uniform(0.5, 2.0, count), 2)), np.zeros((n, n)), np.zeros((n, n))
    tables: dict[str, dict[str, Any]] = {name: {} for name in ("bodies", "springs", "loads", "contacts")}
    for i in range(count):
        tables["bodies"][f"m{i}"] = {"type": "mass", "mass": mass[2 * i, 2 * i], "position": [2.0 * i, 0.0]}
    ends = [(i, None) for i in range(count) for _ in range(2 + int(rng.integers(2)))]
    ends += [(i, k) for i in range(count) for k in range(i) if rng.random() < 0.5]
    for number, (i, k) in enumerate(ends):
        angle, k_s = rng.uniform(0.0, np.pi), float(rng.uniform(0.3, 3.0))
        c_s = float(10.0 ** rng.uniform(-3.0, -0.8)) if rng.random() < 0.4 else 0.0
        direction, row = [float(np.cos(angle)), float(np.sin(angle))], np.zeros(n)
        row[2 * i : 2 * i + 2] = direction
        if k is not None:
            row[2 * k : 2 * k + 2] = -np.array(direction)
        stiffness += k_s * np.outer(row, row)
        damping += c_s * np.outer(row, row)
        between = [f"m{i}", "ground" if k is None else f"m{k}"]
        tables["springs"][f"s{number}"] = {"between": between, "direction": direction, "stiffness": k_s, "damping": c_s}
    pairs, press = [], np.zeros(n)
    for i in range(contacts):
        angle, speed = rng.uniform(0.0, 2 * np.pi), float(rng.choice([-1, 1]) * 10.0 ** rng.uniform(-0.5, 0.5))
        normal = np.array([np.cos(angle), np.sin(angle)])
        tangent = np.array([normal[1], -normal[0]])
        k_c, force = float(10.0 ** rng.uniform(-0.3, 1.3)), -normal * rng.uniform(1.0, 2.0)
        tables["bodies"][f"belt{i}"] = {
            "type": "obstacle", "shape": "flat", "point": [2.0 * i, 0.0], "normal": normal.tolist(),
            "sliding": {"velocity": (speed * tangent).tolist()},
        }  # fmt: skip
        tables["loads"][f"press{i}"] = {"at": f"m{i}", "force": force.tolist()}
        tables["contacts"][f"rub{i}"] = {
            "slave": f"m{i}", "master": f"belt{i}", "stiffness": k_c, "friction": {"law": "coulomb", "coefficient": mu},
        }  # fmt: skip
        row, along = np.zeros(n), np.zeros(n)
        row[2 * i : 2 * i + 2], along[2 * i : 2 * i + 2] = normal, tangent
        # The mass slips against the belt: friction drags it along with the belt.
        stiffness += k_c * np.outer(row + mu * np.sign(speed) * along, row)
        press[2 * i : 2 * i + 2] = force
        pairs.append(row)
    case = Case.model_validate(
        tables | {
            "units": "nondimensional", "phases": [{"name": "slide", "duration": 400.0}],
            "modal": {"max_frequency_hz": limit, "friction_range": [0.0, 1.2]}, "comparison": {"mu": [mu]},
            "temporal": {"initial": "steady-sliding", "perturbation": 1e-6, "contact": "as given", "step": step},
        }
    )  # fmt: skip
    pressed = bool(np.all(np.array(pairs) @ np.linalg.solve(stiffness, press) < 0.0))
    return Rubbing(case, mu, mass, damping, stiffness, pressed)
