"""A run as tables: the dataset of its file, and columns over time for a data frame."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from ..tabular import dataset, frame
from .changes import changes_of
from .node_history import NODE_FIELDS

if TYPE_CHECKING:
    from .trajectory import Trajectory

STATUS = ("separation", "stick", "slip")
AT = "at the record"
HALF_BEFORE = {name: "half a step before the record" for name in ("kinetic", "elastic")}
FORCE = "mean over the steps before and after the record; at the very first record over the step after it"
# Implicit steps have impulses, where contact opens or closes within a step as well, and gaps at their ends.
IMPLICIT = {
    "normal_force": FORCE,
    "tangential_force": FORCE,
    "slip_speed": AT,
    "gap": AT,
    "status": "in the step after the record",
    "kinetic": AT,
    "elastic": AT,
}


def run_dataset(run: Trajectory) -> Any:
    """The dataset of a run, all that a restart needs included."""
    by_contact, by_point = ("time", "contact"), ("time", "point", "direction")
    variables: dict[str, Any] = {
        "normal_force": (by_contact, run.normal_force, {"units": "N"}),
        "tangential_force": (by_contact, run.tangential_force, {"units": "N"}),
        "slip_speed": (by_contact, run.slip_speed, {"units": "m/s"}),
        "gap": (by_contact, run.gap, {"units": "m"}),
        "status": (
            by_contact,
            run.status.astype(np.int8),
            {"flag_values": [0, 1, 2], "flag_meanings": " ".join(STATUS)},
        ),
        "displacement": (by_point, run.displacement, {"units": "m"}),
        "velocity": (by_point, run.velocity, {"units": "m/s"}),
        "acceleration": (by_point, run.acceleration, {"units": "m/s2"}),
        "kinetic": ("time", run.kinetic, {"units": "J"}),
        "elastic": ("time", run.elastic, {"units": "J"}),
    }
    when = IMPLICIT if run.path == "implicit" else HALF_BEFORE
    for name, words in when.items():
        variables[name][2]["long_name"] = words
    for name, work in run.works.items():
        variables[f"work_{name}"] = ("time", work, {"units": "J"})
    for name, array in run.state.items():
        dims = tuple(f"restart_{name}_{k}" for k in range(np.ndim(array)))
        variables[f"restart_{name}"] = (dims, array)
    if run.nodes is not None:
        for name, (dims, units) in NODE_FIELDS.items():
            values = getattr(run.nodes, name)
            small = np.int8 if name == "status" else values.dtype
            words = when.get("slip_speed" if name == "slip_velocity" else name)
            told = {"units": units} if words is None else {"units": units, "long_name": words}
            variables[f"node_{name}"] = (dims, values.astype(small), told)
        variables["node_time"] = ("node_time", run.nodes.time, {"units": "s"})
    axes = np.array(["x", "y", "z"][: run.displacement.shape[2]], dtype=object)
    coords = {
        "time": ("time", run.time, {"units": "s"}),
        "contact": ("contact", np.array(run.contact_names, dtype=object)),
        "point": ("point", np.array(run.watch_names, dtype=object)),
        "direction": ("direction", axes),
    }
    data = dataset("simulate", variables, coords, run.provenance)
    scalars = (
        "step",
        "beta2",
        "record_every",
        "steps",
        "planned_steps",
        "path",
        "path_reason",
        "step_limit",
        "limiting_body",
        "most_sweeps",
        "unconverged_steps",
        "interrupted",
        "wall_seconds",
        "remarks",
    )
    changes = changes_of(run)
    if changes:
        data.attrs["changed"] = json.dumps(changes, ensure_ascii=False)
    data.attrs["scalars"] = json.dumps({name: getattr(run, name) for name in scalars})
    data.attrs["names"] = json.dumps(
        {
            "contacts": run.contact_names,
            "watch": run.watch_names,
            "works": list(run.works),
            "state": list(run.state),
        }
    )
    data.attrs["phases"] = json.dumps(
        [
            {
                "name": p.name,
                "start": p.start,
                "end": p.end,
                "contacts": {n: vars(c) for n, c in p.contacts.items()},
            }
            for p in run.phases
        ]
    )
    return data


def run_frame(run: Trajectory) -> Any:
    """pandas.DataFrame over time [s]: of each contact and watched point a column for each quantity, then energies."""
    columns: dict[str, Any] = {"time_s": run.time}
    quantities = (("normal_force_n", run.normal_force), ("tangential_force_n", run.tangential_force),
                  ("slip_speed_m_s", run.slip_speed), ("gap_m", run.gap))  # fmt: skip
    for k, name in enumerate(run.contact_names):
        columns |= {f"{name}.{what}": values[:, k] for what, values in quantities}
        columns[f"{name}.status"] = np.array(STATUS)[run.status[:, k]]
    moved = (("displacement", run.displacement, "m"), ("velocity", run.velocity, "m_s"),
             ("acceleration", run.acceleration, "m_s2"))  # fmt: skip
    for k, name in enumerate(run.watch_names):
        for what, values, unit in moved:
            for d, axis in enumerate("xyz"[: values.shape[2]]):
                columns[f"{name}.{what}_{axis}_{unit}"] = values[:, k, d]
    columns |= {"kinetic_j": run.kinetic, "elastic_j": run.elastic}
    columns |= {f"work_{name}_j": work for name, work in run.works.items()}
    return frame(columns).set_index("time_s")
