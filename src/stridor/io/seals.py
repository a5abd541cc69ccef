"""The hashes that a result file carries: of everything in it, by which a changed or damaged one is told, and at its end
of its bytes, so that HDF5 never sees damaged ones: of a few it makes a loop that nothing ends."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path
from typing import Any

import numpy as np

CONTENTS = "contents"  # the attribute: JSON, name of a variable → hash, "" → of all other attributes

# What follows the bytes that HDF5 knows of is nothing to it, nor to other programs.
_END = re.compile(rb"\nstridor sha256 ([0-9a-f]{64})\n")
_ENDS_AT = {0: 40, 1: 44, 2: 28, 3: 28}  # where HDF5's first block, by its version, says how long the file is
_PIECE = 2**20


def bytes_end(path: Path) -> bytes:
    """What is to follow the bytes of a file: their SHA-256."""
    return b"\nstridor sha256 %s\n" % _bytes_digest(path, path.stat().st_size).encode()


def bytes_changed(path: Path) -> bool:
    """Whether something else than `bytes_end` of them follows the bytes of an HDF5 file, or some of these are missing.
    Of a file that ends with them, as it is where another program has written it again, nothing is known."""
    with path.open("rb") as stream:
        head = stream.read(64)
        at = _ENDS_AT.get(head[8]) if len(head) == 64 else None
        if at is None:
            return True
        length = int.from_bytes(head[at : at + 8], "little")
        if length == path.stat().st_size:
            return False
        stream.seek(min(length, path.stat().st_size))
        end = _END.fullmatch(stream.read(100))
    return end is None or end[1].decode() != _bytes_digest(path, length)


def _bytes_digest(path: Path, length: int) -> str:
    found = hashlib.sha256()
    with path.open("rb") as stream:
        while length > 0 and (piece := stream.read(min(length, _PIECE))):
            found.update(piece)
            length -= len(piece)
    return found.hexdigest()


def seal(dataset: Any) -> Any:
    """The dataset with the hashes of its variables and attributes as one more attribute."""
    return dataset.assign_attrs({CONTENTS: json.dumps(_hashes(dataset))})


def broken(dataset: Any) -> str | None:
    """What of a sealed dataset is not as it was written, None where all is. Raises ValueError where it has no seal that
    can be read."""
    told = json.loads(str(dataset.attrs[CONTENTS]))
    if not isinstance(told, dict):
        raise ValueError(f"its {CONTENTS} are no table")
    found = _hashes(dataset)
    for name in (*found, *told):
        if found.get(name) != told.get(name):
            return f"{name or 'its attributes'} changed" if name in found and name in told else f"{name} missing or new"
    return None


def digest(array: Any) -> str:
    """SHA-256 of an array: kind, size of a number, shape, and the numbers in their order."""
    plain = np.ascontiguousarray(array)
    if plain.size == 0:  # texts that there are none of come back as numbers
        kind, data = "nothing", b""
    elif plain.dtype.kind in "OUS":
        kind, data = "text", json.dumps([str(text) for text in plain.ravel()]).encode()
    else:
        little = plain.astype(plain.dtype.newbyteorder("<"), copy=False)
        kind, data = f"{plain.dtype.kind}{plain.dtype.itemsize}", little.data
    return hashlib.sha256(f"{kind} {plain.shape} ".encode() + hashlib.sha256(data).digest()).hexdigest()


def text_digest(document: Any) -> str:
    """SHA-256 of what JSON makes of a document, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(document, sort_keys=True, default=_plain).encode()).hexdigest()


def _hashes(dataset: Any) -> dict[str, str]:
    found = {
        str(name): text_digest([list(held.dims), digest(held.values), dict(held.attrs)])
        for name, held in dataset.variables.items()
    }
    others = {name: value for name, value in dataset.attrs.items() if name != CONTENTS}
    return found | {"": text_digest(others)}


def _plain(value: Any) -> Any:
    """NumPy's numbers and arrays as a file gives them back or as they were."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else list(value)
