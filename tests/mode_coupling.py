"""The minimal model of mode coupling as a case."""

from __future__ import annotations

import math
from typing import Any

import stridor as st


def mode_coupling(damping: float = 0.0, speed: float = 1.0) -> st.Case:
    """A mass between two oblique springs on a belt (Hoffmann et al. 2002): flutter from μ = 3/4 on. damping: of dashpots
    at 45° both ways."""

    def oblique(angle_deg: float, stiffness: float) -> dict[str, Any]:
        angle = math.radians(angle_deg)
        return {"between": ("m", "ground"), "direction": (math.cos(angle), math.sin(angle)), "stiffness": stiffness}

    dashpots = {
        name: {"between": ("m", "ground"), "direction": (0.5**0.5, across * 0.5**0.5), "damping": damping}
        for name, across in (("a", 1), ("b", -1))
    }
    return st.Case(
        units="nondimensional",
        bodies={
            "m": {"type": "mass", "mass": 1.0, "position": (0, 0)},
            "belt": {
                "type": "obstacle", "shape": "flat", "point": (0, 0), "normal": (0, 1), "sliding": {"velocity": (-speed, 0)}
            },
        },
        springs={"k1": oblique(150, 2 / 3 * (2 - 3**0.5)), "k2": oblique(30, 2 / 3 * (2 + 3**0.5))},
        dashpots=dashpots if damping else {},
        loads={"press": {"at": "m", "force": (0, -1)}},
        contacts={
            "rub": {
                "slave": "m", "master": "belt", "stiffness": 4 / 3, "friction": {"law": "coulomb", "coefficient": 0.9}
            }
        },
        modal={"max_frequency_hz": 1.0},
        phases=[{"name": "slide", "duration": 60.0}],
        temporal={
            "initial": "steady-sliding", "perturbation": 1e-4, "step": 0.05, "record_every": 1, "watch": ["m"],
            "stepper": "exact",
        },
    )  # fmt: skip
