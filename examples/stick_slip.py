"""Stick and slip: a mass on a belt whose static friction is higher than its kinetic one, against the
closed form.

m = k = N = 1, μ_s = 0.4, μ_k = 0.3, belt speed v = 0.2. While it slips, the mass swings about μ_k
N/k with the amplitude √(Δ² + v²/ω²), Δ = (μ_s − μ_k) N/k; it slips for (2π − 2 atan(Δω/v))/ω and
sticks for 2Δ/v (Den Hartog's construction).
"""

import numpy as np
from matplotlib import pyplot as plt

import stridor as st

V, DROP = 0.2, 0.1
FLAT = {"type": "obstacle", "shape": "flat", "point": (0, 0), "normal": (0, 1)}
case = st.Case(
    units="nondimensional",
    bodies={
        "m": {"type": "mass", "mass": 1.0, "position": (0, 0)},
        "belt": FLAT | {"sliding": {"velocity": (V, 0)}},
    },
    springs={"k": {"between": ("m", "ground"), "direction": (1, 0), "stiffness": 1.0}},
    loads={"weight": {"at": "m", "force": (0, -1)}},
    contacts={
        "rub": {
            "slave": "m", "master": "belt", "stiffness": "rigid",
            "friction": {"law": "static-kinetic", "coefficient": 0.3, "static_coefficient": 0.4}
        }
    },
    phases=[{"name": "run", "duration": 40.0}],
    temporal={"step": 1e-3, "record_every": 1, "watch": ["m"]}
)  # fmt: skip
run = st.simulate(case)
position, speed, sticks = run.displacement[:, 0, 0], run.velocity[:, 0, 0], run.status[:, 0] == 1

begins = np.flatnonzero(np.diff(sticks.astype(int)) == 1)[1:]  # of sticking, from the second period on
ends = np.flatnonzero(np.diff(sticks.astype(int)) == -1)[1:]
period = np.diff(run.time[begins]).mean()
stick = np.mean([run.time[e] - run.time[b] for b, e in zip(begins, ends, strict=False)])
assert abs(stick - 2 * DROP / V) < 3e-3
assert abs(period - stick - (2 * np.pi - 2 * np.arctan(DROP / V))) < 3e-3
amplitude = np.hypot(DROP, V)
assert np.allclose([position[begins[0] :].min(), position.max()], [0.3 - amplitude, 0.3 + amplitude], atol=1e-3)

figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.6), layout="constrained")
left.plot(run.time, position, "C0")
left.fill_between(run.time, *left.get_ylim(), where=sticks, color="0.85", label="sticks")
left.set(xlabel="time", ylabel="position", title=f"period {period:.3f}, by hand 6.356")
left.legend(loc="lower right")
right.plot(position, speed, "C0")
angle = np.linspace(0, 2 * np.pi, 200)
right.plot(0.3 + amplitude * np.cos(angle), amplitude * np.sin(angle), "k:", label="circle of slipping")
right.axhline(V, color="C3", linewidth=0.8, label="belt speed")
right.set(xlabel="position", ylabel="velocity", title="limit cycle", aspect="equal")
right.legend(loc="center", fontsize=8)
figure.savefig("stick_slip.png", dpi=80)
