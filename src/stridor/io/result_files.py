"""One way in for result files: what is there is held against what was written and what it must be, or refused.

Nothing is read that a file merely claims: sizes come before numbers, and no link leads out of the file.
"""

from __future__ import annotations

import contextlib
from collections.abc import Generator
from pathlib import Path
from typing import Any

from ..errors import CaseError
from ..reading import bounded, irregular, largest_unfolded, size_words
from ..tabular import FORMAT
from .result_checks import check_results
from .seals import CONTENTS, broken, bytes_changed

_KIND = "stridor results "
HDF5 = b"\x89HDF\r\n\x1a\n"
_FOREIGN = "no results of stridor; give a results file written by stridor (netCDF-4/HDF5)"
# What is written is not packed; a file that another tool has packed may unfold to so much.
_UNQUESTIONED, _TIMES = 2**28, 50
_MOST_VARIABLES = 10_000


def open_results(path: str | Path) -> Any:
    """xarray.Dataset of a file written by `save`, all of it in memory. Raises CaseError where it is none, or where
    anything in it is not as it was written."""
    target = Path(path)
    _look_at(target)
    with damage_told(target), bounded():
        if bytes_changed(target):
            raise ValueError("its bytes are not those that were written")
        _check_sizes(target)
        loaded = _loaded(target)
        accept(loaded, target)
    return loaded


def accept(loaded: Any, path: Path) -> None:
    """Raise CaseError for a dataset that no stridor of this format has written, ValueError and others for one that is
    not as it was written."""
    form = str(loaded.attrs.get("format", ""))
    if not form.startswith(_KIND):
        raise CaseError("file", str(path), _FOREIGN)
    if form != FORMAT:
        raise CaseError(
            "file", str(path), f"written in format {form[:40]!r}; this one reads {FORMAT!r}: bring stridor up to date"
        )
    if CONTENTS not in loaded.attrs:
        raise CaseError(
            "file", str(path), "a results file without the hash of its contents, by which a changed one is told: it "
            "was written by an early stridor, or made over by another program; compute it again",
        )  # fmt: skip
    if what := broken(loaded):
        raise ValueError(what)
    check_results(loaded)


@contextlib.contextmanager
def damage_told(path: Path) -> Generator[None, None, None]:
    """Whatever goes wrong with what is in a result file as one CaseError."""
    try:
        yield
    except CaseError:
        raise
    except MemoryError as error:
        raise _damaged(path, "it claims to hold more than the memory does") from error
    except Exception as error:
        # HDF5, netCDF and JSON raise whatever bytes make of them that are not what they should be.
        raise _damaged(path, _said(error)) from error


def _said(error: Exception) -> str:
    """What an error of a library says, for a user."""
    if isinstance(error, RecursionError):
        return "its texts are nested too deep"
    if isinstance(error, KeyError):
        return f"{error.args[0] if error.args else 'something'} is missing"
    return str(error) or "it cannot be read"


def _damaged(path: Path, what: str) -> CaseError:
    short = "".join(letter if letter.isprintable() else "?" for letter in " ".join(what.split()))
    short = short if len(short) <= 120 else short[:119] + "…"
    return CaseError(
        "file", str(path), f"a results file, but cut short, damaged or changed since stridor wrote it ({short}); "
        "compute it again",
    )  # fmt: skip


def _look_at(path: Path) -> None:
    """Raise CaseError for what is no file, or none of HDF5."""
    try:
        if reason := irregular(path):
            raise CaseError("file", str(path), reason)
        with path.open("rb") as stream:
            start = stream.read(len(HDF5))
    except FileNotFoundError:
        raise CaseError("file", str(path), "no such file") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise CaseError("file", str(path), f"cannot be read: {reason}") from error
    if start != HDF5:
        raise CaseError("file", str(path), _FOREIGN)


def _check_sizes(path: Path) -> None:
    """Raise ValueError for variables that are no plain arrays of this file, or claim more than it can unfold to."""
    import h5py

    held = 0
    limit = largest_unfolded(path.stat().st_size, unquestioned=_UNQUESTIONED, times=_TIMES)
    with h5py.File(path, "r") as file:
        if len(file) > _MOST_VARIABLES:
            raise ValueError(f"it claims {len(file)} variables")
        for name in file:
            if not isinstance(file.get(name, getlink=True), h5py.HardLink):
                raise ValueError(f"{name} is a link")
            item = file[name]
            if not isinstance(item, h5py.Dataset):
                raise ValueError(f"{name} is a group")
            if item.is_virtual or item.external:
                raise ValueError(f"{name} is kept in another file")
            held += (item.size or 0) * max(item.dtype.itemsize, 8)
            if held > limit:
                raise ValueError(f"{name} claims {size_words(held)}, for which the file is too small")


def _loaded(path: Path) -> Any:
    import xarray as xr

    with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as dataset:
        return dataset.load()
