"""A brake pad on a disc: where it presses, and the torque that it brakes with.

Solids in space, contact over a surface with meshes that do not match. For even pressure any
textbook gives the effective radius ⅔ (r_o³ − r_i³)/(r_o² − r_i²) = 114.0 mm. Friction tilts the pad
and the pressure is far from even, yet the torque is within 3 % of μ N r_e. The balance of the pad
is exact: N is the piston's pressure times the area, friction is μ N.
"""

import numpy as np
from matplotlib import pyplot as plt

import stridor as st
from stridor.case import template_text

COARSE = {"disc": (4, 72, 2), "lining": (5, 12, 2), "plate": (5, 12, 1)}
case = st.loads(template_text("pad-on-disc")).with_(
    {f"bodies.{name}.mesh.divisions": divisions for name, divisions in COARSE.items()}
)
mu, inner, outer = 0.5, 0.09, 0.135
steady = st.steady_sliding(case, mu)
nodes = st.build_system(case).contact_nodes()

area = np.radians(50) / 2 * (outer**2 - inner**2)
normal = steady.normal_force.sum()
assert abs(normal / (case.loads["piston"].pressure * area) - 1) < 2e-3  # facets are straight, the sector is round
friction = np.einsum("mk,mkd->md", steady.friction_force, nodes.tangents)
assert np.allclose(np.linalg.norm(friction, axis=1), mu * steady.normal_force)
torque = abs(np.cross(nodes.position, friction)[:, 2].sum())
effective = 2 / 3 * (outer**3 - inner**3) / (outer**2 - inner**2)
assert abs(torque / (mu * normal * effective) - 1) < 0.03

pressure = steady.normal_force / nodes.area / 1e6
figure, ax = plt.subplots(figsize=(6.5, 3.6), layout="constrained")
drawn = ax.tricontourf(1e3 * nodes.position[:, 0], 1e3 * nodes.position[:, 1], pressure, levels=12)
ax.plot(*(1e3 * nodes.position[~steady.active, :2].T), "wx", label="open nodes")
ax.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal", title=f"Pressure at μ = {mu}, {torque:.0f} N m")
figure.colorbar(drawn, label="pressure [MPa]", shrink=0.8)
figure.savefig("pad_on_disc.png", dpi=80)
