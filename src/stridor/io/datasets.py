"""Results as xarray datasets with named dimensions and units, one netCDF-4/HDF5 file per analysis."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..agreement import Agreement
from ..case import Case
from ..errors import CaseError
from ..modal.complex_modes import ComplexModes
from ..modal.onsets import Onset, Onsets
from ..modal.parametric import ReducedModel
from ..reading import is_reduced_file, starts_with
from ..study.fingerprint import changes_of
from ..temporal.node_history import NodeHistory
from ..temporal.trajectory import HISTORIES, STATUS, ContactStatistics, PhaseResult, Trajectory
from ..typing import ComplexArray
from .atomic import replacing
from .left_out import Keep
from .reduced_models import load_reduced, save_reduced
from .result_files import FORMAT, HDF5, damage_told, open_results
from .seals import seal
from .streams import NotedErrors

Result = ComplexModes | Onsets | Trajectory | Agreement


def to_dataset(result: Result) -> Any:
    """xarray.Dataset of a result; units in attributes, case and provenance embedded as text. Raises CaseError for what
    is none."""
    kinds: dict[type, Any] = {ComplexModes: _modes, Onsets: _onsets, Trajectory: _trajectory, Agreement: _agreement}
    if type(result) in kinds:
        return kinds[type(result)](result)
    accepted = "complex modes, onsets, a trajectory or an agreement; reduced models are no datasets, but can be saved"
    raise CaseError("result", f"a {type(result).__name__}", accepted)


def save(
    result: Result | ReducedModel,
    path: str | Path,
    *,
    case: Case | Mapping[str, Any] | None = None,
    keep: Keep | None = None,
) -> Path:
    """Write a result (.nc) or a reduced model (.npz) to ``path`` by way of a temporary file; `open` reads it.

    Of reduced models alone, case: what it was made of, for the file to say so, or what `provenance_of` said of the
    file it was read from. keep: "all" (None); "shapes" leaves the full matrices out, and with them what is solved in
    the full problem (`verified`, `Corrector`, backward errors, confirmed onsets); "eigenvalues" leaves the basis out
    too, and with it vectors on the full model.

    Raises CaseError for what is no result, and factors that are plain functions; AnalysisError where the file cannot be
    written.
    """
    if isinstance(result, ReducedModel):
        return save_reduced(result, path, case=case, keep=keep or "all")
    if keep is not None or case is not None:
        name, given = ("case", None) if keep is None else ("keep", keep)
        raise CaseError(name, given, "goes with a reduced model; results are kept whole, and hold their case")
    dataset = seal(to_dataset(result))
    target = Path(path)
    with replacing(target) as temporary:
        stream = NotedErrors(temporary)
        try:
            dataset.to_netcdf(stream, engine="h5netcdf")
        finally:
            stream.finish()
    return target


def open(path: str | Path) -> Any:
    """What is in a file that `save` or a command wrote, by its content: a Trajectory with the state that a restart
    needs, a ReducedModel whose modes are the same to the last bit, or of other results the dataset of `to_dataset`.

    Raises CaseError for files that are none, damaged, changed since, or of a newer format.
    """
    target = Path(path)
    if is_reduced_file(target) and not starts_with(target, HDF5):
        return load_reduced(target)
    data = open_results(target)
    return _trajectory_in(data, target) if data.attrs["analysis"] == "simulate" else data


def load_trajectory(path: str | Path) -> Trajectory:
    """The trajectory in a file written by ``save``. Raises CaseError where it is none."""
    data = open_results(path)
    if data.attrs.get("analysis") != "simulate":
        raise CaseError("file", str(path), "a file of `stridor simulate`")
    return _trajectory_in(data, Path(path))


def _trajectory_in(data: Any, path: Path) -> Trajectory:
    with damage_told(path):
        return _run_of(data)


def _run_of(data: Any) -> Trajectory:
    """The trajectory in a dataset that has been checked."""
    names = json.loads(data.attrs["names"])
    scalars = json.loads(data.attrs["scalars"])
    phases = tuple(
        PhaseResult(p["name"], p["start"], p["end"], {n: ContactStatistics(**c) for n, c in p["contacts"].items()})
        for p in json.loads(data.attrs["phases"])
    )
    return Trajectory(
        contact_names=tuple(names["contacts"]),
        watch_names=tuple(names["watch"]),
        **{name: data[name].values for name in HISTORIES},
        works={name: data[f"work_{name}"].values for name in names["works"]},
        phases=phases,
        state={name: data[f"restart_{name}"].values for name in names["state"]},
        provenance=json.loads(data.attrs["provenance"]),
        nodes=_load_nodes(data, tuple(names["contacts"])),
        **scalars,
    )


_NODE_FIELDS = {
    "owner": (("slave_node",), "1"),
    "position": (("slave_node", "direction"), "m"),
    "area": (("slave_node",), "m2"),
    "tangents": (("slave_node", "tangent", "direction"), "1"),
    "normal_force": (("node_time", "slave_node"), "N"),
    "tangential_force": (("node_time", "slave_node", "tangent"), "N"),
    "slip_velocity": (("node_time", "slave_node", "tangent"), "m/s"),
    "gap": (("node_time", "slave_node"), "m"),
    "status": (("node_time", "slave_node"), "1"),
}


def _load_nodes(data: Any, contacts: tuple[str, ...]) -> NodeHistory | None:
    """Histories of every slave node, None where the run kept none."""
    if "node_status" not in data:
        return None
    fields = {name: data[f"node_{name}"].values for name in _NODE_FIELDS}
    return NodeHistory(names=contacts, time=data["node_time"].values, **fields)


def _dataset(analysis: str, variables: Mapping[str, Any], coords: Mapping[str, Any], result: Result) -> Any:
    import xarray as xr

    if any("part" in v[0] for v in variables.values() if isinstance(v[0], tuple)):
        coords = {**coords, "part": ("part", np.array(["re", "im"], dtype=object))}
    attributes = {
        "format": FORMAT,
        "analysis": analysis,
        "case": str(result.provenance.get("case", "")),
        "provenance": json.dumps(result.provenance),
    }
    return xr.Dataset(dict(variables), dict(coords), attributes)


def _split(dims: tuple[str, ...], values: Any, attributes: Mapping[str, Any]) -> tuple[Any, ...]:
    """Complex values as real ones with a last dimension (re, im): netCDF has no complex numbers."""
    array: ComplexArray = np.asarray(values, dtype=complex)
    return (*dims, "part"), np.stack([np.real(array), np.imag(array)], axis=-1), dict(attributes)


def _modes(result: ComplexModes) -> Any:
    pairs = ("mu", "branch")
    variables: dict[str, Any] = {
        "eigenvalue": _split(
            pairs, result.eigenvalues, {"units": "1/s", "long_name": "growth rate + j angular frequency"}
        ),
        "frequency": (pairs, result.frequency_hz, {"units": "Hz"}),
        "growth_rate": (pairs, result.growth_rate, {"units": "1/s"}),
        "damping_ratio": (pairs, result.damping_ratio, {"units": "1"}),
        "unstable": (pairs, result.unstable.astype(np.int8), {"units": "1"}),
        "residual": (pairs, result.residual, {"units": "1", "long_name": "componentwise backward error"}),
    }
    for name, vectors in (("right_vector", result.right), ("left_vector", result.left)):
        if vectors is not None:
            variables[name] = _split((*pairs, "freedom"), vectors, {"units": "1"})
    coords = {"mu": ("mu", result.mu, {"units": "1"}), "branch": ("branch", result.branch)}
    data = _dataset("modes", variables, coords, result)
    if result.completeness:
        data.attrs["completeness"] = json.dumps(result.completeness)
    if result.contact_state:
        data.attrs["contact_state"] = result.contact_state
    if result.source:
        data.attrs["source"] = result.source
    if result.notes:
        data.attrs["notes"] = json.dumps(result.notes)
    data.attrs["damped"] = int(result.damped)
    data.attrs["modes_in_band"] = json.dumps([int(n) for n in result.total])
    if result.max_frequency_hz is not None:
        data.attrs["max_frequency_hz"] = result.max_frequency_hz
    if result.band_hz is not None:
        data.attrs["band_hz"] = list(result.band_hz)
    return data


def _onsets(result: Onsets) -> Any:
    def column(name: str) -> list[float]:
        return [np.nan if (v := getattr(o, name)) is None else float(v) for o in result.onsets]

    def exceptional(onset: Onset) -> complex:
        return complex(np.nan, np.nan) if onset.exceptional_mu is None else onset.exceptional_mu

    units = {
        "mu": "1",
        "frequency_hz": "Hz",
        "residual": "1",
        "square_root_coefficient": "1/s",
        "growth_slope": "1/s",
    }
    variables: dict[str, Any] = {name: ("onset", column(name), {"units": unit}) for name, unit in units.items()}
    count = len(result.onsets)
    variables["kind"] = ("onset", np.array([o.kind for o in result.onsets], dtype=object).reshape(count))
    variables["stabilising"] = ("onset", np.array([o.stabilising for o in result.onsets], dtype=np.int8))
    branches = np.array([o.branches for o in result.onsets], dtype=np.int64).reshape(-1, 2)
    variables["branches"] = (("onset", "pair"), branches)
    variables["exceptional_mu"] = _split(("onset",), [exceptional(o) for o in result.onsets], {"units": "1"})
    data = _dataset("onsets", variables, {}, result)
    data.attrs.update(damped=int(result.damped), max_frequency_hz=result.max_frequency_hz)
    data.attrs["friction_range"] = list(result.friction_range)
    if result.band_hz is not None:
        data.attrs["band_hz"] = list(result.band_hz)
    for name in ("at_start", "at_end"):
        values = getattr(result, name)
        data.attrs[f"growing_{name}"] = json.dumps([[v.real, v.imag] for v in values])
    data.attrs["growing_above_band_at_start"] = json.dumps([[v.real, v.imag, mu] for v, mu in result.entering])
    data.attrs["enters_band_at"] = json.dumps([o.enters_at for o in result.onsets])
    if result.completeness:
        data.attrs["completeness"] = result.completeness
    if result.contact_state:
        data.attrs["contact_state"] = result.contact_state
    if result.source:
        data.attrs["source"] = result.source
    if result.notes:
        data.attrs["notes"] = json.dumps(result.notes)
    return data


def _trajectory(run: Trajectory) -> Any:
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
        "kinetic": ("time", run.kinetic, {"units": "J", "long_name": "half a step before the record"}),
        "elastic": ("time", run.elastic, {"units": "J", "long_name": "half a step before the record"}),
    }
    for name, work in run.works.items():
        variables[f"work_{name}"] = ("time", work, {"units": "J"})
    for name, array in run.state.items():
        dims = tuple(f"restart_{name}_{k}" for k in range(np.ndim(array)))
        variables[f"restart_{name}"] = (dims, array)
    if run.nodes is not None:
        for name, (dims, units) in _NODE_FIELDS.items():
            values = getattr(run.nodes, name)
            small = np.int8 if name == "status" else values.dtype
            variables[f"node_{name}"] = (dims, values.astype(small), {"units": units})
        variables["node_time"] = ("node_time", run.nodes.time, {"units": "s"})
    axes = np.array(["x", "y", "z"][: run.displacement.shape[2]], dtype=object)
    coords = {
        "time": ("time", run.time, {"units": "s"}),
        "contact": ("contact", np.array(run.contact_names, dtype=object)),
        "point": ("point", np.array(run.watch_names, dtype=object)),
        "direction": ("direction", axes),
    }
    data = _dataset("simulate", variables, coords, run)
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


def _agreement(result: Agreement) -> Any:
    rows = result.comparisons

    def column(values: list[float | None]) -> list[float]:
        return [np.nan if v is None else float(v) for v in values]

    variables: dict[str, Any] = {
        "modal_eigenvalue": _split(("mu",), [c.modal_eigenvalue for c in rows], {"units": "1/s"}),
        "temporal_eigenvalue": _split(("mu",), [c.perturbation.eigenvalue for c in rows], {"units": "1/s"}),
        "frequency_error": ("mu", [c.frequency_error for c in rows], {"units": "1"}),
        "growth_rate_error": ("mu", [c.growth_rate_error for c in rows], {"units": "1"}),
        "growth_mac": ("mu", column([c.growth_mac for c in rows]), {"units": "1"}),
        "mac": ("mu", column([c.mac for c in rows]), {"units": "1"}),
        "dominant_frequency": ("mu", column([c.dominant_frequency_hz for c in rows]), {"units": "Hz"}),
    }
    data = _dataset("compare", variables, {"mu": ("mu", [c.mu for c in rows], {"units": "1"})}, result)
    for name in ("critical_mu_modal", "critical_mu_temporal"):
        value = getattr(result, name)
        data.attrs[name] = np.nan if value is None else value
    data.attrs["verdict"] = result.verdict
    return data
