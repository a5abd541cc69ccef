"""Friction that falls with speed is negative damping: below which belt speed does a mass begin to
swing?

m = k = N = 1 and F = 1/(1 + 3 v) on a belt of speed v, with a damper c = 0.1. Steady sliding loses
its damping where −dF/dv = 3/(1 + 3 v)² = c, at v = (√(3/c) − 1)/3 = 1.492409; small motions grow
with −(c + dF/dv)/2.
"""

import numpy as np
from matplotlib import pyplot as plt

import stridor as st

DAMPING, DELTA = 0.1, 3.0
FLAT = {"type": "obstacle", "shape": "flat", "point": (0, 0), "normal": (0, 1)}


def case(speed):
    return st.Case(
        units="nondimensional",
        bodies={
            "m": {"type": "mass", "mass": 1.0, "position": (0, 0)},
            "belt": FLAT | {"sliding": {"velocity": (speed, 0)}},
        },
        springs={"k": {"between": ("m", "ground"), "direction": (1, 0), "stiffness": 1.0, "damping": DAMPING}},
        loads={"weight": {"at": "m", "force": (0, -1)}},
        contacts={
            "rub": {
                "slave": "m", "master": "belt", "stiffness": "rigid",
                "friction": {"law": "hyperbolic", "coefficient": 0.0, "static_coefficient": 1.0, "delta": DELTA}
            }
        },
        modal={"max_frequency_hz": 1.0}
    )  # fmt: skip


def slope(speed):
    return -DELTA / (1 + DELTA * speed) ** 2


speeds = np.linspace(0.8, 2.4, 5)
growth = np.array([st.modes(case(speed)).growth_rate[0].max() for speed in speeds])
assert np.allclose(growth, -(DAMPING + slope(speeds)) / 2, atol=1e-9)
assert abs(st.modes(case(1.0)).growth_rate[0].max() - 0.043750) < 1e-9
critical = (np.sqrt(DELTA / DAMPING) - 1) / DELTA
assert not st.modes(case(critical + 1e-6)).unstable.any()
assert st.modes(case(critical - 1e-6)).unstable.any()

figure, ax = plt.subplots(figsize=(6, 3.8), layout="constrained")
fine = np.linspace(0.8, 2.4, 200)
ax.plot(fine, -(DAMPING + slope(fine)) / 2, "C0", label="−(c + dF/dv)/2")
ax.plot(speeds, growth, "ko", label="complex modes")
ax.plot(critical, 0, "kD", markerfacecolor="none", label=f"v = {critical:.6f}")
ax.axhline(0, color="0.5", linewidth=0.8)
ax.set(xlabel="belt speed v", ylabel="growth rate", title="Friction that falls with speed feeds slow sliding")
ax.legend()
figure.savefig("falling_friction.png", dpi=80)
