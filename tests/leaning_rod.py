"""A rod that leans on a belt and is held by springs at both ends: Painlevé's example, with something to vibrate.

The springs keep steady sliding in equilibrium at any friction, so that only the masses say where rigid contact ends to
determine the motion.
"""

from __future__ import annotations

import numpy as np

import stridor as st


def leaning_rod(mu: float = 0.3, angle_deg: float = 60.0, stiffness: str | float = "rigid") -> st.Case:
    """The rod, pressed and dragged at its foot."""
    springs = {
        f"{end}{axis}": {
            "between": (f"rod.{end}", "ground"), "direction": direction, "stiffness": k, "damping": 2.0,
        }
        for end, axis, direction, k in (
            ("start", "x", (1, 0), 2e5), ("end", "x", (1, 0), 5e4), ("start", "y", (0, 1), 1e5), ("end", "y", (0, 1), 5e4),
        )
    }  # fmt: skip
    return st.Case(
        materials={"steel": {"young_modulus": 200e9, "density": 7800.0}},
        bodies={
            "rod": {
                "type": "beam", "material": "steel", "start": [0.0, 0.0], "angle_deg": angle_deg, "length": 0.1,
                "width": 0.01, "thickness": 0.002, "elements": 1, "damping": {"mass": 5.0, "stiffness": 1e-7},
            },
            "belt": {
                "type": "obstacle", "shape": "flat", "point": (0, 0), "normal": (0, 1), "sliding": {"velocity": (1.0, 0)}
            },
        },
        springs=springs,
        loads={"press": {"at": "rod.start", "force": (0, -20)}},
        contacts={
            "rub": {
                "slave": "rod.start", "master": "belt", "stiffness": stiffness,
                "friction": {"law": "coulomb", "coefficient": mu},
            }
        },
        modal={"max_frequency_hz": 5e4, "friction_range": (0.0, 0.8)},
        phases=[{"name": "slide", "duration": 0.002}],
        temporal={"initial": "rest", "watch": ["rod.start"]},
    )  # fmt: skip


def limit_of(angle_deg: float) -> float:
    """The μ at which a force on the foot, (−μ, 1) of the belt that moves along x, no longer accelerates it upwards: with
    the mass of a beam element by hand, 156/420 m at an end across it, 140/420 m along it."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    length = 0.1
    across = np.array(
        [
            [156, 22 * length, 54, -13 * length],
            [22 * length, 4 * length**2, 13 * length, -3 * length**2],
            [54, 13 * length, 156, -22 * length],
            [-13 * length, -3 * length**2, -22 * length, 4 * length**2],
        ]
    )
    along = np.array([[140.0, 70.0], [70.0, 140.0]])
    w, u = np.linalg.inv(across)[0, 0], np.linalg.inv(along)[0, 0]
    # Accelerations of the foot by forces on it: u along (c, s), w along (−s, c).
    yy, yx = u * s * s + w * c * c, (u - w) * s * c
    return float(-yy / yx) if yx < 0 else np.inf
