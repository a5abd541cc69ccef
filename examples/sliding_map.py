"""A map of sticking, slipping and opening: a soft block rubs on a steel slider and vibrates.

Position along the contact across, time upwards. However wild the motion, two laws of mechanics hold:
the normal forces carry the load in the mean, 4000 N, and no node ever bears more than μ N along it.
"""

import numpy as np

import stridor as st


def solid(material, corner, size, divisions, **more):
    mesh = {"shape": "rectangle", "corner": corner, "size": size, "divisions": divisions, "cells": "quad"}
    damping = {"mass": 20.0, "stiffness": 1e-8}
    return {"type": "solid", "model": "plane strain", "material": material, "mesh": mesh, "damping": damping} | more


MU, SPEED = 0.4, 0.05
case = st.Case(
    materials={
        "steel": {"young_modulus": 200e9, "density": 7800.0},
        "pad": {"young_modulus": 2e9, "density": 2000.0},
    },
    bodies={
        "slider": solid("steel", (-0.05, -0.01), (0.1, 0.01), (20, 2), sliding={"velocity": (SPEED, 0)}),
        "block": solid("pad", (-0.02, 0.0), (0.04, 0.012), (32, 8)),
    },
    supports={"ground": {"at": "slider.bottom", "fixed": ["x", "y"]}, "holder": {"at": "block.top", "fixed": ["x"]}},
    loads={"press": {"at": "block.top", "pressure": 1e5}},
    contacts={
        "face": {
            "slave": "block.bottom", "master": "slider.top", "stiffness": "rigid",
            "friction": {"law": "coulomb", "coefficient": MU},
        }
    },
    phases=[{"name": "slide", "duration": 2e-3}],
    temporal={"record_every": 2},
)  # fmt: skip
run = st.simulate(case)
late = run.time > 5e-4
mean = run.normal_force[late].mean()
assert abs(mean / (1e5 * 0.04) - 1) < 0.02
nodes = run.nodes
assert np.all(np.abs(nodes.tangential_force[..., 0]) <= MU * nodes.normal_force * (1 + 1e-9) + 1e-9)
assert {0, 1, 2} == set(np.unique(nodes.status[nodes.time > 5e-4]))  # all three happen
st.plot.contact_map(nodes, start=6e-4, end=1e-3, quantity="status").savefig("sliding_map.png", dpi=70)
