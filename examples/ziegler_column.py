"""Ziegler's paradox: the double pendulum under a following load loses stability earlier when it is
damped a little.

Two rods, masses 2m and m at their ends, joints of stiffness k and damping c, the load P always
along the upper rod: the matrices of any textbook (Ziegler 1952; Bolotin 1963), here with m = k = l
= 1, as files of another program would hold them. Without damping the frequencies meet at P = 7/2 −
√2 = 2.0858; with equal dampers the onset is 41/28 + c²/2, 1.4643 as c goes to 0.
"""

import tempfile
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import stridor as st

MATRICES = {
    "M": [[3, 1], [1, 1]],
    "C": [[2, -1], [-1, 1]],
    "K": [[2, -1], [-1, 1]],
    "P": [[-1, 1], [0, 0]],  # of the load: not symmetric, so it may feed energy in
}
folder = Path(tempfile.mkdtemp())
for name, matrix in MATRICES.items():
    np.save(folder / f"{name}.npy", np.array(matrix, dtype=float))


def column(damping):
    roles = {"M": ("mass", 1.0), "C": ("damping", damping), "K": ("stiffness", 1.0), "P": ("stiffness", "P")}
    terms = [
        {"file": folder / f"{name}.npy", "role": role, "factor": factor} for name, (role, factor) in roles.items()
    ]
    return st.Case(matrices=terms, parameters={"P": {"value": 1.0}}, modal={"max_frequency_hz": 1.0})


def critical_load(damping):
    return st.onsets(column(damping), (0.5, 3.0), along="P", max_frequency_hz=1.0)[0].value


bare = critical_load(0.0)
assert abs(bare - (7 / 2 - 2**0.5)) < 1e-9
dampings = np.array([0.01, 0.1, 0.3, 0.6, 0.9])
loads = np.array([critical_load(c) for c in dampings])
assert np.allclose(loads, 41 / 28 + dampings**2 / 2, atol=1e-8)

figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.6), layout="constrained")
model = st.reduced_model(column(0.0), {"P": (0.5, 3.0)}, max_frequency_hz=1.0)
for at in np.linspace(0.5, 3.0, 120):
    values = model.modes({"P": float(at)}).values
    left.plot(np.full(len(values), at), np.abs(values.imag), "C0.", markersize=3)
left.axvline(bare, color="k", linewidth=0.8, label=f"P = {bare:.4f}")
left.set(xlabel="following load P l/k", ylabel="angular frequency", title="undamped: two frequencies meet")
left.legend()
curve = np.linspace(0, 1, 50)
right.plot(curve, 41 / 28 + curve**2 / 2, "C0", label="41/28 + c²/2")
right.plot(dampings, loads, "ko", label="onsets solved")
right.plot(0, bare, "kD", markerfacecolor="none", label="without damping")
right.set(xlabel="damping of both joints c", ylabel="critical load", title="a little damping lowers it by 30 %")
right.legend()
figure.savefig("ziegler_column.png", dpi=80)
