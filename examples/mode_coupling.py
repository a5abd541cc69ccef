"""Mode coupling: a mass on a belt, held by two oblique springs, flutters although friction is
constant.

The minimal model of brake squeal of Hoffmann, Fischer, Allgaier and Gaul (2002), Mech. Res. Comm.
29, 197: K = [[2, 1 − 4μ/3], [1, 2]] and M = 1, so that λ² = −2 ± √(1 − 4μ/3). Two frequencies meet
at μ = 3/4, ω = √2; beyond, one mode grows.
"""

import numpy as np
from matplotlib import pyplot as plt

import stridor as st


def oblique(angle_deg, stiffness):
    angle = np.radians(angle_deg)
    return {"between": ("m", "ground"), "direction": (np.cos(angle), np.sin(angle)), "stiffness": stiffness}


case = st.Case(
    units="nondimensional",
    bodies={
        "m": {"type": "mass", "mass": 1.0, "position": (0, 0)},
        "belt": {
            "type": "obstacle",
            "shape": "flat",
            "point": (0, 0),
            "normal": (0, 1),
            "sliding": {"velocity": (-1, 0)},
        },
    },
    springs={"k1": oblique(150, 2 / 3 * (2 - 3**0.5)), "k2": oblique(30, 2 / 3 * (2 + 3**0.5))},
    loads={"press": {"at": "m", "force": (0, -1)}},
    contacts={
        "rub": {"slave": "m", "master": "belt", "stiffness": 4 / 3, "friction": {"law": "coulomb", "coefficient": 0.5}}
    },
    modal={"max_frequency_hz": 1.0},
)
onset = st.onsets(case).first
assert abs(onset.mu - 3 / 4) < 1e-9
assert abs(2 * np.pi * onset.frequency_hz - 2**0.5) < 1e-6

sweep = st.modes(case, np.linspace(0, 1, 201))
beyond = sweep.eigenvalues[-1]  # at μ = 1
assert np.allclose(beyond[np.argmax(beyond.real)], 0.202072 + 1.428577j, atol=1e-6)

figure, (above, below) = plt.subplots(2, sharex=True, figsize=(6, 4.5), layout="constrained")
above.plot(sweep.mu, 2 * np.pi * sweep.frequency_hz, "C0")
above.plot(onset.mu, 2**0.5, "kD", label=f"onset at μ = {onset.mu:.4f}, ω = √2")
below.plot(sweep.mu, sweep.growth_rate, "C3")
above.set(ylabel="angular frequency Im λ", title="Two modes meet, and one of them grows")
below.set(xlabel="friction coefficient μ", ylabel="growth rate Re λ", xlim=(0, 1))
above.legend()
figure.savefig("mode_coupling.png", dpi=80)
