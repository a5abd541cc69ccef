"""More damping can make a brake squeal: the onset of the minimal model falls where its two modes are
damped unevenly.

Hoffmann's minimal model (see mode_coupling.py) with dampers c1 along (1, 1)/√2 and c2 along (1,
−1)/√2, its frictionless modes. det(λ²M + λC + K) is a quartic in λ, and its Hurwitz determinant
gives the onsets that are asserted below.
"""

import stridor as st

MODEL = """
units = "nondimensional"
bodies.m = { type = "mass", mass = 1.0, position = [0, 0] }
bodies.belt = { type = "obstacle", shape = "flat", point = [0, 0], normal = [0, 1], sliding = { velocity = [-1, 0] } }
springs.k1 = { between = ["m", "ground"], direction = [-0.8660254037844387, 0.5], stiffness = 0.1786327949540818 }
springs.k2 = { between = ["m", "ground"], direction = [0.8660254037844387, 0.5], stiffness = 2.488033871712585 }
dashpots.c1 = { between = ["m", "ground"], direction = [1, 1], damping = 0.02 }
dashpots.c2 = { between = ["m", "ground"], direction = [1, -1], damping = 0.02 }
loads.press = { at = "m", force = [0, -1] }
contacts.rub = { slave = "m", master = "belt", stiffness = 1.3333333333333333, friction = { law = "coulomb", coefficient = 0.5 } }
modal.max_frequency_hz = 1.0
"""  # noqa: E501
case = st.loads(MODEL)
KNOWN = [
    (0.02, 0.02, 0.750600),
    (0.02, 0.01, 0.728213),
    (0.1, 0.02, 0.643834),
    (0.02, 0.002, 0.547672),
    (0.1, 0.002, 0.326320),
]
for c1, c2, mu in KNOWN:
    damped = case.with_({"dashpots.c1.damping": c1, "dashpots.c2.damping": c2})
    assert abs(st.onsets(damped).first.mu - mu) < 1e-6

found = st.damping_map(
    case,
    "dashpots.c1.damping",
    "dashpots.c2.damping",
    x_range=(0.01, 0.4),
    y_range=(0.01, 0.4),
    grid=(7, 7),
)
assert found.below_undamped.any()  # the paradox
assert found.more_x_lowers.any()
st.plot.damping_map(found).savefig("uneven_damping.png", dpi=70)
