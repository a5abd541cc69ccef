"""A reduced model answers for a whole box of parameters: a map of growth over friction and contact
stiffness in a second.

Reduced once, the two-beam bench is a few dozen unknowns instead of 361, with an estimate of the
error of each eigenvalue. The points that are solved again in the full model say that the estimate
holds.
"""

import numpy as np
from matplotlib import pyplot as plt

import stridor as st
from stridor.case import template_text

case = st.loads(template_text("two-beams"))
box = {"mu": (0.0, 0.2), "contact_stiffness": (1e-3, 1.0)}
model = st.reduced_model(case, box, max_frequency_hz=12e3, bound=1e-8)
assert model.size < st.build_system(case).size / 3

frictions, factors = np.linspace(0, 0.2, 41), np.geomspace(1e-3, 1, 31)
growth = np.array(
    [[model.modes({"mu": mu, "contact_stiffness": f}).growth_rate.max() for mu in frictions] for f in factors]
)
for mu, factor in ((0.1, 1.0), (0.15, 0.01), (0.2, 0.001)):
    softer = case.with_({"contacts.A.stiffness": 1e10 * factor})
    full = st.modes(softer, mu, max_frequency_hz=12e3).eigenvalues[0]
    found = model.modes({"mu": mu, "contact_stiffness": factor})
    nearest = full[np.abs(full[:, None] - found.values).argmin(axis=0)]
    assert np.max(np.abs(found.values - nearest) / np.abs(nearest)) < 1e-7

figure, ax = plt.subplots(figsize=(6, 4), layout="constrained")
drawn = ax.contourf(frictions, 1e10 * factors, np.maximum(growth, 0), levels=14, cmap="magma_r")
ax.set(
    yscale="log",
    xlabel="friction coefficient μ",
    ylabel="contact stiffness [N/m]",
    title=f"{frictions.size * factors.size} points by {model.size} unknowns",
)
figure.colorbar(drawn, label="largest growth rate [1/s]")
figure.savefig("reduction.png", dpi=80)
