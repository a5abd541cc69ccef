"""Random rings in contact as one sector that repeats and as a whole: the whole is the truth of the sector."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Ring:
    """One sector and the whole ring of ``sectors`` of them as texts of cases, at a friction coefficient."""

    sector: str
    whole: str
    sectors: int
    mu: float


HEAD = """units = "SI"
[materials.a]
young_modulus = 2e11
density = 7800.0
poisson_ratio = 0.3
[materials.b]
young_modulus = 7e10
density = 2700.0
poisson_ratio = 0.25
"""


def random_ring(seed: int, *, dimension: int, rigid: bool, offset: float | None = None) -> Ring:
    """Two rings one in the other (in the plane) or one on the other (in space), of cells and divisions of their own, or
    one on a wall; the outer or upper one turns. Sectors begin at any angle, in the plane not always both at the same, or
    the second an offset [degrees] after the first."""
    rng = np.random.default_rng(seed)
    sectors, mu = int(rng.integers(2 if dimension == 2 else 3, 7)), round(float(rng.uniform(0.1, 0.6)), 3)
    kinds = ["quad", "quad8", "triangle", "triangle6", "quad9"]
    kinds = kinds if dimension == 2 else ["hexahedron", "hexahedron20", "tetra10"]
    cells = [str(kind) for kind in rng.choice(kinds, 2)]
    least = -(-10 // sectors)  # facets that turn by more than 40° meet in corners, whose normals are another matter
    around = [int(n) for n in rng.integers(least, least + (3 if dimension == 2 else 2), 2)]
    across = [int(n) for n in rng.integers(1, 3, 2)]
    first = float(rng.choice([0.0, 17.0]))
    starts = [first, first + float(rng.choice([0.0, 0.0, 11.0])) * (dimension == 2)]
    stiffness = '"rigid"' if rigid else f"{10 ** rng.uniform(11, 13):.6g}"
    wall, slave = bool(rng.random() < 0.2), int(rng.integers(2))
    alike = bool(rng.random() < 0.3)  # meshes match over the contact
    if alike:
        cells[1], around[1], starts[1] = cells[0], around[0], starts[0]
    if offset is not None:
        starts[1] = first + offset
    texts = []
    for whole in (False, True):
        text = HEAD
        for k, name in enumerate(["one"] if wall else ["one", "two"]):
            sweep = f"start_deg = {starts[k]}"
            if not whole:
                sweep += f", sweep_deg = {360.0 / sectors!r}"
            count = around[k] * (sectors if whole else 1)
            if dimension == 2:
                radii = ((0.07, 0.1), (0.1, 0.13))[k]
                shape = f'shape = "annulus", inner_radius = {radii[0]}, outer_radius = {radii[1]}'
                shape += f", divisions = [{across[k]}, {count}], {sweep}"
                model = 'model = "plane stress"\nthickness = 0.01'
                hub, held = ("inner", "outer")[k], '["x", "y"]'
            else:
                shape = f'shape = "{"disc" if whole else "pad"}", centre = [0.0, 0.0, {(-0.02, 0.0)[k]}]'
                shape += f", inner_radius = 0.05, outer_radius = 0.1, thickness = 0.02, divisions = [2, {count}, 1]"
                shape += "" if whole else f", {sweep}"
                model = 'model = "3d"'
                hub, held = ("bottom", "inner")[k], ('["x", "y", "z"]', '["x", "y"]')[k]
            text += f'[bodies.{name}]\ntype = "solid"\nmaterial = "{"ab"[k]}"\n{model}\nmass = "lumped"\n'
            text += f'mesh = {{ {shape}, cells = "{cells[k]}" }}\n'
            if k == 1:
                text += f"sliding = {{ spin = 10.0{'' if dimension == 2 else ', axis = [0.0, 0.0, 1.0]'} }}\n"
            text += f'[supports.{name}]\nat = "{name}.{hub}"\nfixed = {held}\n'
            if dimension == 3 and k == 1:
                text += '[loads.press]\nat = "two.top"\npressure = 1e6\n'
            if not whole:
                text += f'[ties.{name}]\nslave = "{name}.end"\nmaster = "{name}.start"\n'
                text += f"rotation = {{ angle_deg = {360.0 / sectors!r} }}\n"
        faces = ("one.outer", "two.inner") if dimension == 2 else ("one.top", "two.bottom")
        master = faces[1 - slave]
        if wall:
            slave, master = 0, "wall"
            text += '[bodies.wall]\ntype = "obstacle"\n'
            if dimension == 2:
                text += 'shape = "cylinder"\npoint = [0.0, 0.0]\nradius = 0.1\ninside = true\nsliding = { spin = 10.0 }\n'
            else:
                text += 'shape = "flat"\npoint = [0.0, 0.0, 0.0]\nnormal = [0.0, 0.0, -1.0]\n'
                text += "sliding = { spin = 10.0, axis = [0.0, 0.0, 1.0] }\n"
        text += f'[contacts.c]\nslave = "{faces[slave]}"\nmaster = "{master}"\nstiffness = {stiffness}\n'
        text += "interference = 5e-4\n" if dimension == 2 or wall else ""
        text += f'friction = {{ law = "coulomb", coefficient = {mu} }}\n'
        texts.append(text + "[modal]\nmax_frequency_hz = 60000.0\n")
    return Ring(*texts, sectors, mu)
