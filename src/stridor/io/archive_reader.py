"""Arrays of an archive of NumPy's, each held against the shape and the hash that it must have before it is believed."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Mapping
from typing import IO, Any

import numpy as np
import scipy.sparse as sp

from ..reading import largest_unfolded, size_words
from ..typing import Array, IntArray, Sparse
from .seals import digest

# Matrices are compressed to a third or so; a file that claims far more was made to fill the memory.
_UNQUESTIONED, _TIMES = 2**30, 50


def check_unfolded(archive: zipfile.ZipFile, packed: int) -> None:
    """Raise ValueError for an archive of so many bytes whose members claim more than it can be meant to hold."""
    claimed = sum(info.file_size for info in archive.infolist())
    if claimed > largest_unfolded(packed, unquestioned=_UNQUESTIONED, times=_TIMES):
        raise ValueError(f"it claims to unfold to {size_words(claimed)}")


def whole_count(value: object) -> int:
    """A number of things. Raises ValueError for what is none."""
    if not isinstance(value, int) or value < 0:
        raise ValueError(f"a count of {value!r}")
    return value


class ArchiveReader:
    """Arrays of an archive, each with the shape and the hash it must have."""

    def __init__(self, archive: zipfile.ZipFile, hashes: Mapping[str, str]) -> None:
        self._archive, self._hashes = archive, hashes

    def numbers(self, name: str, shape: tuple[int, ...]) -> Array:
        """An array of finite floating-point numbers."""
        values: Array = self._read(name, shape, "f").astype(np.float64, copy=False)
        if not np.all(np.isfinite(values)):
            raise ValueError(f"{name} holds values that are not finite")
        return values

    def csr(self, document: Mapping[str, Any], shape: tuple[int, int]) -> Sparse:
        """A sparse matrix, its indices looked through."""
        nonzeros = whole_count(document["nonzeros"])
        data = self.numbers(document["data"], (nonzeros,))
        indices: IntArray = self._read(document["indices"], (nonzeros,), "i")
        starts: IntArray = self._read(document["indptr"], (shape[0] + 1,), "i")
        matrix = sp.csr_array((data, indices, starts), shape=shape)
        matrix.check_format(full_check=True)
        return matrix

    def _read(self, name: str, shape: tuple[int, ...], kind: str) -> Any:
        member = self._archive.getinfo(f"{name}.npy")
        with self._archive.open(member) as stream:
            _check_head(name, stream, shape, kind, member.file_size)
        with self._archive.open(member) as stream:
            array = np.lib.format.read_array(stream, allow_pickle=False)
            # The checksum is compared at the end of what is stored.
            more = stream.read(1)
        if more or digest(array) != self._hashes[name]:
            raise ValueError(f"{name} changed")
        return array


def _check_head(name: str, stream: IO[bytes], shape: tuple[int, ...], kind: str, size: int) -> None:
    """Raise ValueError for an array that is not due, or larger than its member, before anything is allocated."""
    version = np.lib.format.read_magic(stream)
    readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    claimed, _, dtype = readers[version](stream)
    if claimed != shape or dtype.kind != kind:
        raise ValueError(f"{name}: {dtype} of shape {claimed} where {shape} is due")
    if math.prod(shape) * dtype.itemsize > size:
        raise ValueError(f"{name} claims more than its {size} bytes")
