"""Results as xarray datasets with named dimensions and units, one netCDF-4/HDF5 file per analysis."""

from __future__ import annotations

import contextlib
import json
import os
import sys
from collections.abc import Callable, Generator, Mapping
from pathlib import Path
from typing import Any

from ..agreement import Agreement
from ..asking import PATH, takes
from ..case import Case
from ..errors import CaseError, kind_of
from ..modal.complex_modes import ComplexModes
from ..modal.full import ParametricOnsets
from ..modal.onsets import Onsets
from ..modal.parametric import ModesAtPoints, ReducedModel
from ..periodic import Cycles
from ..reading import is_reduced_file, starts_with
from ..study.boundary_result import Boundary
from ..study.damping_result import DampingMap
from ..study.ensemble_result import Ensemble
from ..study.measures import Countermeasures
from ..study.sensitivity_result import Sensitivities
from ..temporal.node_history import NODE_FIELDS, NodeHistory
from ..temporal.trajectory import HISTORIES, ContactStatistics, PhaseResult, Trajectory
from .atomic import replacing
from .left_out import Keep
from .reduced_models import load_reduced, save_reduced
from .result_files import HDF5, damage_told, open_results
from .seals import bytes_end, seal
from .streams import NotedErrors

Result = (
    ComplexModes | Onsets | ParametricOnsets | Sensitivities | Trajectory | Agreement | Ensemble | Boundary | DampingMap
    | Cycles | Countermeasures | ModesAtPoints
)  # fmt: skip
CLUSTER = "distributed"
STORE = ("zarr.json", ".zgroup", "study.zarr")  # in the folder of a store, and in the folder that a study writes to
# Of the results that a file gives back as they were, by the analysis that it names.
WHOLE: Mapping[str, Callable[[Any], Any]] = {
    "boundary": Boundary.from_xarray, "cycles": Cycles.from_xarray, "onsets along": ParametricOnsets.from_xarray,
    "damping map": DampingMap.from_xarray, "countermeasures": Countermeasures.from_xarray,
}  # fmt: skip


def to_dataset(result: Result) -> Any:
    """xarray.Dataset of a result, its ``to_xarray``; units in attributes, case and provenance embedded as text. Raises
    CaseError for what is none."""
    if isinstance(result, Result):  # pyright: ignore[reportUnnecessaryIsInstance]
        return result.to_xarray()
    accepted = (
        "complex modes, onsets, sensitivities, a trajectory, an ensemble, an agreement, a stability boundary, a "
        "damping map, counter-measures, modes of a reduced model or limit cycles; reduced models are no datasets, but "
        "can be saved"
    )
    raise CaseError("result", kind_of(result), accepted)


@takes(path=PATH)
def save(
    result: Result | ReducedModel,
    path: str | Path,
    *,
    case: Case | Mapping[str, Any] | None = None,
    keep: Keep | None = None,
) -> Path:
    """Write a result (.nc) or a reduced model (.npz) to ``path`` by way of a temporary file; `open` reads it. A name
    without an ending is taken as it is; folders that are missing are made, as the verbs make theirs.

    Of reduced models alone, case: what it was made of, for the file to say so, or what `provenance_of` said of the
    file it was read from. keep: "all" (None); "shapes" leaves the full matrices out, and with them what is solved in
    the full problem (`verified`, `Corrector`, backward errors, confirmed onsets); "eigenvalues" leaves the basis out
    too, and with it vectors on the full model.

    Raises CaseError for what is no result, for another ending of the name, and for factors that are plain functions;
    AnalysisError where the file cannot be written.
    """
    if isinstance(result, ReducedModel):
        _check_ending(path, (".npz", ""), "a name that ends in .npz")
        return save_reduced(result, path, case=case, keep=keep or "all")
    if keep is not None or case is not None:
        name, given = ("case", None) if keep is None else ("keep", keep)
        raise CaseError(name, given, "goes with a reduced model; results are kept whole, and hold their case")
    _check_ending(path, (".nc", ""), "a name that ends in .nc (netCDF); as a table a result is result.to_dataframe()")
    dataset = seal(to_dataset(result))
    target = Path(path)
    with replacing(target) as temporary:
        stream = NotedErrors(temporary)
        try:
            with _no_cluster():
                dataset.to_netcdf(stream, engine="h5netcdf")
        finally:
            stream.finish()
        end = bytes_end(temporary)
        with temporary.open("ab") as file:
            file.write(end)
    return target


@contextlib.contextmanager
def _no_cluster() -> Generator[None]:
    """xarray asks whether it writes on a cluster of Dask, and imports all of ``distributed`` to find out, which takes
    the greater part of a second where it is installed. Where nobody has imported it yet there is no cluster."""
    modules: dict[str, Any] = sys.modules
    if CLUSTER in modules:
        yield
        return
    modules[CLUSTER] = None  # importing it now raises ImportError, which is an answer
    try:
        yield
    finally:
        if modules.get(CLUSTER) is None:
            modules.pop(CLUSTER, None)


@takes(path=PATH)
def open(path: str | Path) -> Any:
    """What is in a file that `save` or a command wrote, by its content: a Trajectory with the state that a restart
    needs, a ReducedModel whose modes are the same to the last bit, a Boundary, a DampingMap, Countermeasures, Cycles,
    ParametricOnsets, or of other results the dataset of `to_dataset`.

    Raises CaseError for files that are none, damaged, changed since, or of a newer format.
    """
    target = Path(path)
    if any(os.path.exists(target / mark) for mark in STORE):  # which takes names of any length
        raise CaseError("file", str(path), "the store of a study, or its folder; st.open_study reads it")
    if is_reduced_file(target) and not starts_with(target, HDF5):
        return load_reduced(target)
    data = open_results(target)
    made = WHOLE.get(data.attrs["analysis"])
    if made is not None:
        with damage_told(target):
            return made(data)
    return _trajectory_in(data, target) if data.attrs["analysis"] == "simulate" else data


def _check_ending(path: str | Path, endings: tuple[str, ...], accepted: str) -> None:
    """Refuse a name by which other programs would take the file for something else. Raises CaseError."""
    if Path(path).suffix.lower() not in endings:
        raise CaseError("path", str(path), accepted)


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
        **scalars | {"remarks": tuple(str(said) for said in scalars.get("remarks", ()))},
    )


def _load_nodes(data: Any, contacts: tuple[str, ...]) -> NodeHistory | None:
    """Histories of every slave node, None where the run kept none."""
    if "node_status" not in data:
        return None
    fields = {name: data[f"node_{name}"].values for name in NODE_FIELDS}
    return NodeHistory(names=contacts, time=data["node_time"].values, **fields)
