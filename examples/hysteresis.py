"""Loud or silent at the same speed: up to which belt speed does stick-slip go on, and what starts it
again?

m = k = N = 1, μ_s = 0.4, μ_k = 0.3, a damper c = 2ζ. Steady sliding is stable at every speed. Stick
ends where the spring is stretched by Δ − 2ζv more than in steady sliding, Δ = (μ_s − μ_k) N/k. From
there the velocity swings back and just reaches that of the belt once more, so that the mass sticks
again, for v < v_c = Δω cos φ/sin(φ + δ), sin δ = ζ, ln(cos δ/cos φ) = tan δ (2π − δ − φ).
"""

import numpy as np
from matplotlib import pyplot as plt
from scipy.optimize import brentq

import stridor as st

ZETA, DROP = 0.05, 0.1
FLAT = {"type": "obstacle", "shape": "flat", "point": (0, 0), "normal": (0, 1)}
case = st.Case(
    units="nondimensional",
    bodies={
        "m": {"type": "mass", "mass": 1.0, "position": (0, 0)},
        "belt": FLAT | {"sliding": {"velocity": (0.1, 0)}},
    },
    springs={"k": {"between": ("m", "ground"), "direction": (1, 0), "stiffness": 1.0, "damping": 2 * ZETA}},
    loads={"weight": {"at": "m", "force": (0, -1)}},
    contacts={
        "rub": {
            "slave": "m", "master": "belt", "stiffness": "rigid",
            "friction": {"law": "static-kinetic", "coefficient": 0.3, "static_coefficient": 0.3 + DROP}
        }
    },
    phases=[{"name": "run", "duration": 120 * np.pi}],
    temporal={"step": 1e-2, "record_every": 10, "watch": ["m"]},
    modal={"max_frequency_hz": 1.0},
)  # fmt: skip
delta = np.arcsin(ZETA)
phi = brentq(lambda p: np.log(np.cos(delta) / np.cos(p)) - np.tan(delta) * (2 * np.pi - delta - p), 0, 1.57)
critical = DROP * np.cos(phi) / np.sin(phi + delta)
assert abs(critical - 0.109809) < 1e-6

# Sixty periods at each speed, the belt faster and faster and then slower again.
sweep = st.ensemble(case, speed=np.arange(0.55, 1.5, 0.1), sweep="both", swept="speed", modes=False)
loud = sweep.stick[:, 0] > 0
upwards = np.array(sweep.sweep) == "up"
assert np.array_equal(loud, upwards & (sweep.slip_speed < critical))

# From steady sliding: a push along with the belt, and as fast, lets the mass stick.
pushed = {"temporal.initial": "steady-sliding", "temporal.stepper": "exact", "phases.run.duration": 30 * np.pi}
factors, pushes = [0.5, 0.7, 0.9, 1.05, 1.15, 1.3], np.arange(0.035, 0.16, 0.03)
starts = st.ensemble(case.with_(pushed), speed=factors, perturbation=pushes, modes=False)
v, push, sticks = starts.slip_speed, starts.perturbation, starts.stick[:, 0] > 0
assert np.array_equal(sticks, (push > v) & (v < critical))

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
for way, mark in (("up", "C3^-"), ("down", "C0v-")):
    of = np.array(sweep.sweep) == way
    left.plot(sweep.slip_speed[of], sweep.rms[of], mark, label=f"belt speed goes {way}")
right.plot(v[sticks], push[sticks], "C3o", label="goes on in stick and slip")
right.plot(v[~sticks], push[~sticks], "C0o", markerfacecolor="none", label="dies out")
right.plot([0.04, critical], [0.04, critical], "k:", label="as fast as the belt")
for ax in (left, right):
    ax.axvline(critical, color="k", linestyle="--", linewidth=0.8, label=f"$v_c$ = {critical:.6f}")
left.set(xlabel="belt speed", ylabel="rms of the velocity", title="Swept up and down")
right.set(xlabel="belt speed", ylabel="velocity of a push", title="From steady sliding", ylim=(0.02, 0.225))
left.legend(loc="center left", bbox_to_anchor=(0, 0.4))
right.legend(ncols=2, fontsize=8)
figure.savefig("hysteresis.png", dpi=80)
