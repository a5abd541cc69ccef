"""The hash that a result file carries of everything in it, by which a changed or damaged one is told."""

from __future__ import annotations

import hashlib
import json
from typing import Any

import numpy as np

CONTENTS = "contents"  # the attribute: JSON, name of a variable → hash, "" → of all other attributes


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
