"""The store of a study: a Zarr group with a row for each sample, opened by xarray without stridor.

Every chunk is written beside its place and renamed. Of a block of rows the results go first and ``status`` last, so
that a row counts as computed only when all of it is there: a study that is killed at any moment goes on where it was.
Each chunk carries a checksum, and is written whatever is in it: one that is gone is not taken for one of nothing.
"""

from __future__ import annotations

import contextlib
import json
import shutil
import warnings
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import AnalysisError, CaseError
from ..typing import Array, IntArray
from .rows import Row, StoreColumn
from .rows import variables as variables_of

FORMAT = 1  # of the store; one with a larger number was written by a newer stridor
KIND = "stridor study"
MARKS = ("zarr.json", ".zgroup")  # of a folder that zarr has written, or an earlier one
CHUNK = 512  # rows of a chunk at most
WHOLE = "every_chunk_written"  # of the attributes: what of computed rows is not there is lost
COLUMNS = "columns"  # of the attributes: the results that it has
# Results that stores without these attributes may lack: an earlier version wrote none.
LATER = ("velocity_rms", "stronger_below_hz")
PENDING, DONE, FAILED = 0, 1, 2
_FILL: Mapping[str, Any] = {"f8": np.nan, "i8": 0, "i1": 0, "str": ""}


@dataclass(frozen=True)
class Head:
    """What a store is of: the study as data, its digest, provenance, the case's text."""

    study: Mapping[str, Any]
    digest: str
    provenance: Mapping[str, Any]
    part: str = ""


class OpenStore:
    """A store that is open for writing by this process alone."""

    def __init__(self, path: Path, group: Any, variables: Sequence[StoreColumn]) -> None:
        self.path, self._group, self.variables = path, group, tuple(variables)

    @staticmethod
    def made(
        path: Path,
        head: Head,
        samples: Array,
        parameters: Mapping[str, str],
        variables: Sequence[StoreColumn],
        lengths: Mapping[str, int],
        *,
        numbers: IntArray | None = None,
    ) -> OpenStore:
        """A new store of samples (n, p). parameters: their paths and units; numbers (n,): those of the rows in the
        whole study. Raises AnalysisError where it cannot be written."""
        temporary = path.with_name(f".{path.name}.new")
        try:
            shutil.rmtree(temporary, ignore_errors=True)
            with _every_chunk():
                attributes = _attributes(head, parameters) | {COLUMNS: json.dumps([v.name for v in variables])}
                group = _zarr().create_group(temporary, attributes=attributes)
                number = np.arange(len(samples)) if numbers is None else numbers
                _fill_new(group, samples, parameters, variables, lengths, number)
            temporary.rename(path)
        except OSError as error:
            shutil.rmtree(temporary, ignore_errors=True)
            raise AnalysisError(f"cannot write {path}: {error.strerror or error}") from error
        return OpenStore.opened(path, variables)

    @staticmethod
    def opened(path: Path, variables: Sequence[StoreColumn]) -> OpenStore:
        """One that is there. Raises CaseError for what is none, and for one of a newer stridor."""
        group = _group(path, "r+")
        _require(path, group, _written(path, group))
        return OpenStore(path, group, variables)

    def complete(self) -> list[str]:
        """Add the results that the store lacks as an earlier version wrote it; returns their names. Rows that are there
        have NaN. Raises CaseError for a result of which nothing says that it is not known."""
        there = _written(self.path, self._group)
        lacking = [v for v in self.variables if v.name not in there]
        if told := [v.name for v in lacking if v.dtype != "f8" or v.inner]:
            raise CaseError(
                str(self.path), None,
                f"was begun by an earlier stridor, which wrote no {', '.join(told)}: they cannot be completed. Remove "
                "the store, or name another folder (--out), and all is computed anew",
            )  # fmt: skip
        status = self._group["status"]
        with self._disk_told(), _every_chunk():
            for variable in lacking:
                if variable.name in self._group:
                    del self._group[variable.name]  # where an earlier attempt was killed
                _array(self._group, variable, status.shape[0], status.chunks[0], {})[:] = _FILL[variable.dtype]
        if lacking:
            self.note(**{COLUMNS: [v.name for v in self.variables]})
        return [v.name for v in lacking]

    @property
    def head(self) -> Head:
        """What the store is of."""
        return head_of(self.path, self._group)

    @property
    def status(self) -> IntArray:
        """Of every row (n,): `PENDING`, `DONE` or `FAILED`. Raises CaseError where its chunks are damaged."""
        return np.asarray(self._read("status"), dtype=np.int64)

    @property
    def samples(self) -> Array:
        """Values (n, p) of the parameters."""
        return np.stack([self._read(name) for name in json.loads(self._group.attrs["parameters"])], axis=1)

    def write(self, rows: Mapping[int, Row]) -> None:
        """Write rows by their places, ``status`` last. Raises AnalysisError where that fails; what was there stays."""
        if not rows:
            return
        places = np.array(sorted(rows))
        ordered = sorted(self.variables, key=lambda v: v.name == "status")
        with self._disk_told(), _every_chunk():
            for chosen in _by_chunk(places, self._group["status"].chunks[0]):
                for variable in ordered:
                    self._put(variable, chosen, rows)

    @contextlib.contextmanager
    def _disk_told(self) -> Generator[None]:
        """Raises AnalysisError where something within cannot be written."""
        try:
            yield
        except OSError as error:
            raise AnalysisError(
                f"cannot write {self.path}: {error.strerror or error}; rows that were written before are kept, and the "
                "same command goes on from there"
            ) from error

    def _put(self, variable: StoreColumn, places: IntArray, rows: Mapping[int, Row]) -> None:
        array = self._group[variable.name]
        given = [rows[int(k)].get(variable.name) for k in places]
        if variable.dtype == "str":
            block: Any = np.array(["" if value is None else str(value) for value in given], dtype=object)
        else:
            shape = (len(places), *array.shape[1:])
            block = np.full(shape, _FILL[variable.dtype], dtype=array.dtype)
            for k, value in enumerate(given):
                if value is None:
                    continue
                if variable.inner:
                    block[k, : len(value)] = value[: shape[1]]
                else:
                    block[k] = value
        first, last = int(places[0]), int(places[-1]) + 1
        if last - first == len(places):
            array[first:last] = block
        else:
            whole = array[first:last]
            whole[places - first] = block
            array[first:last] = whole

    def extend(self, samples: Array) -> None:
        """More samples (n, p), of which the first are those that are there."""
        have = self._group["status"].shape[0]
        if len(samples) <= have:
            return
        parameters = json.loads(self._group.attrs["parameters"])
        # The status last: a store that was cut off here has a `status` no longer than its parameters.
        with self._disk_told(), _every_chunk():
            for name in sorted(self._group.array_keys(), key=lambda name: name == "status"):
                array = self._group[name]
                array.resize((len(samples), *array.shape[1:]))
                if name in parameters:
                    array[have:] = samples[have:, list(parameters).index(name)]
                elif name == "number":
                    array[have:] = np.arange(have, len(samples))

    def note(self, **attributes: Any) -> None:
        """Keep what is to be known of the store as a whole."""
        with self._disk_told():
            self._group.attrs.update({name: json.dumps(value) for name, value in attributes.items()})

    def told(self, name: str) -> Any:
        """What was kept by `note`, None where there is nothing."""
        text = self._group.attrs.get(name)
        return None if text is None else json.loads(text)

    def _read(self, name: str) -> Any:
        return read(self.path, self._group, name)


def _fill_new(
    group: Any, samples: Array, parameters: Mapping[str, str], variables: Sequence[StoreColumn],
    lengths: Mapping[str, int], number: IntArray,
) -> None:  # fmt: skip
    """The arrays of a new store, those of the parameters and the numbers of the samples written."""
    chunk = max(1, min(CHUNK, len(samples)))
    for k, (name, units) in enumerate(parameters.items()):
        array = _array(group, StoreColumn(name, "f8", units, "parameter of the study"), len(samples), chunk, {})
        array[:] = samples[:, k]
    words = StoreColumn("number", "i8", "", "number of the sample in the study")
    _array(group, words, len(samples), chunk, {})[:] = number
    for variable in variables:
        _array(group, variable, len(samples), chunk, lengths)


def _every_chunk() -> Any:
    """Within, arrays that are opened write chunks of nothing but zeros, too."""
    return _zarr().config.set({"array.write_empty_chunks": True})


def _written(path: Path, group: Any) -> list[str]:
    """Names of the results that the version which wrote a store put into it. Raises CaseError where it does not say."""
    if COLUMNS in group.attrs:
        return list(json.loads(group.attrs[COLUMNS]))
    try:
        names = [v.name for v in variables_of(head_of(path, group).study["compute"])]
    except KeyError:
        raise CaseError(str(path), None, "a damaged store: it does not say what was computed") from None
    return [name for name in names if name not in LATER]


def _require(path: Path, group: Any, names: Sequence[str]) -> None:
    """Raises CaseError where an array is gone, or a chunk: of a row that counts as computed, or of the parameters."""
    wanted = [*json.loads(group.attrs["parameters"]), "number", *names]
    if missing := [name for name in wanted if name not in group]:
        raise CaseError(str(path), None, f"a damaged store: {', '.join(missing)} missing; name another (--out)")
    if not group.attrs.get(WHOLE, False):
        return  # by an earlier version, which left out chunks of nothing but zeros
    status = group["status"]
    rows, size = np.asarray(read(path, group, "status")), status.chunks[0]
    begun = np.unique(np.flatnonzero(rows != PENDING) // size)
    every = np.arange(-(-len(rows) // size))
    for name in wanted:
        own = begun if name in names else every
        inner = "/0" * (len(group[name].shape) - 1)
        if gone := [k for k in own.tolist() if not (path / name / f"c/{k}{inner}").exists()]:
            raise CaseError(str(path), None, f"chunk {gone[0]} of {name} is gone; {_again(path, group, name)}")


def _again(path: Path, group: Any, name: str) -> str:
    """What makes whole what of an array is damaged."""
    if name == "number" or name in json.loads(group.attrs["parameters"]):
        return "which samples its rows are of is not known any more; remove it, or name another (--out)"
    places = dict.fromkeys((path / name / "c", path / "status" / "c"))
    return f"remove the folder {' and '.join(map(str, places))}, and the study computes again what is missing"


def _by_chunk(places: IntArray, chunk: int) -> list[IntArray]:
    """Places parted by the chunk they lie in."""
    return np.split(places, np.flatnonzero(np.diff(places // chunk)) + 1)


def _array(group: Any, variable: StoreColumn, rows: int, chunk: int, lengths: Mapping[str, int]) -> Any:
    codecs = _zarr().codecs
    inner = (lengths[variable.inner],) if variable.inner else ()
    return group.create_array(
        variable.name,
        shape=(rows, *inner),
        chunks=(chunk, *inner),
        dtype=str if variable.dtype == "str" else variable.dtype,
        fill_value=_FILL[variable.dtype],
        compressors=[codecs.ZstdCodec(level=1), codecs.Crc32cCodec()],
        dimension_names=("row", variable.inner) if variable.inner else ("row",),
        attributes={k: v for k, v in (("units", variable.units), ("long_name", variable.words)) if v},
    )


def _attributes(head: Head, parameters: Mapping[str, str]) -> dict[str, Any]:
    return {
        "kind": KIND,
        "format": FORMAT,
        WHOLE: True,
        "digest": head.digest,
        "study": json.dumps(head.study),
        "provenance": json.dumps(head.provenance),
        "parameters": json.dumps(dict(parameters)),
        "part": head.part,
        "coordinates": " ".join(["number", *parameters]) if all(" " not in name for name in parameters) else "number",
    }


def _group(path: Path, mode: str) -> Any:
    """Raises CaseError for what is no store of a study, and for one of a newer stridor."""
    if not path.is_dir():
        raise CaseError(str(path), None, "is a file, not the store of a study" if path.exists() else "no such store")
    if not any((path / mark).exists() for mark in MARKS):
        raise CaseError(str(path), None, "not the store of a study: give study.zarr, or the folder that it is in")
    try:
        group = _zarr().open_group(path, mode=mode)
        kind, number = group.attrs.get("kind"), group.attrs.get("format")
    except Exception as error:  # zarr and its parts raise their own of many kinds
        raise CaseError(str(path), None, f"not the store of a study, or damaged: {_short(error)}") from None
    if kind != KIND or not isinstance(number, int):
        raise CaseError(str(path), None, "not the store of a study")
    if number > FORMAT:
        made = json.loads(group.attrs.get("provenance", "{}")).get("versions", {}).get("stridor", "a newer version")
        raise CaseError(str(path), None, f"was written by a newer stridor ({made}); read it with that one")
    return group


def head_of(path: Path, group: Any | None = None) -> Head:
    """What a store is of. Raises CaseError for what is none."""
    attributes = (_group(path, "r") if group is None else group).attrs
    try:
        return Head(
            json.loads(attributes["study"]),
            str(attributes["digest"]),
            json.loads(attributes["provenance"]),
            str(attributes.get("part", "")),
        )
    except (KeyError, ValueError, TypeError) as error:
        raise CaseError(str(path), None, f"a damaged store: {_short(error)}") from None


def read(path: Path, group: Any, name: str) -> Any:
    """An array of a store. Raises CaseError where a chunk is damaged."""
    try:
        return group[name][:]
    except Exception as error:  # of the file system, of the checksum, of the decompressor
        raise CaseError(
            str(path), None,
            f"a chunk of {name} is damaged ({_short(error)}); {_again(path, group, name)}",
        ) from None  # fmt: skip


def dataset(path: Path) -> Any:
    """xarray.Dataset of a store, every chunk read and its checksum proved. Raises CaseError."""
    import xarray as xr

    group = _group(path, "r")
    _require(path, group, _written(path, group))
    parameters = json.loads(group.attrs["parameters"])
    rows = group["status"].shape[0]  # others are longer where a study was stopped while samples were added
    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    for name in sorted(group.array_keys()):
        array = group[name]
        values = read(path, group, name)[:rows]
        values = values.astype(object) if array.dtype.kind in "OT" else values
        entry = (tuple(array.metadata.dimension_names), values, dict(array.attrs))
        (coordinates if name in parameters or name == "number" else variables)[name] = entry
    return xr.Dataset(variables, coordinates, dict(group.attrs))


def _short(error: BaseException) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__


def _zarr() -> Any:
    """The library. Raises AnalysisError where it is not installed."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import zarr
    except ImportError as error:
        raise AnalysisError("a study needs zarr, which is not installed: pip install 'stridor[study]'") from error
    return zarr
