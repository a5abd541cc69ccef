"""Results as plain values that JSON takes, and back: the same to the last bit, and nothing but results."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, cast

import numpy as np

from ..errors import kind_of
from ..modal.complex_modes import ComplexModes
from ..modal.onsets import Onset, Onsets
from ..study.body_modes import BodyModes
from ..study.measures import Countermeasures, Measure, Verified
from ..study.sensitivities import Sensitivities

_RESULTS = (BodyModes, ComplexModes, Countermeasures, Measure, Onset, Onsets, Sensitivities, Verified)
KINDS = {kind.__name__: kind for kind in _RESULTS}
_NUMBERS = ("<f8", "<c16", "<i8", "|b1", "|i1")


def to_plain(value: Any) -> Any:
    """Plain values of a result, or of tables, tuples, lists, arrays and numbers. Raises TypeError for anything else."""
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, np.generic):
        return to_plain(value.item())
    if isinstance(value, float):
        return value
    if isinstance(value, complex):
        return {"complex": [value.real, value.imag]}
    if isinstance(value, np.ndarray):
        return _array(value)
    if is_dataclass(value) and type(value).__name__ in KINDS:
        content = {f.name: to_plain(getattr(value, f.name)) for f in fields(value)}
        return {"kind": type(value).__name__, "fields": content}
    if isinstance(value, Mapping):
        return {"table": [[str(k), to_plain(v)] for k, v in cast("Mapping[Any, Any]", value).items()]}
    if isinstance(value, tuple):
        return {"tuple": [to_plain(v) for v in cast("tuple[Any, ...]", value)]}
    if isinstance(value, list):
        return [to_plain(v) for v in cast("list[Any]", value)]
    raise TypeError(f"{kind_of(value)} is no result")


def of_plain(value: Any) -> Any:
    """What `to_plain` made plain values of. Raises ValueError, TypeError or KeyError for others."""
    if isinstance(value, list):
        return [of_plain(v) for v in cast("list[Any]", value)]
    if not isinstance(value, dict):
        return value
    data = cast("dict[str, Any]", value)
    if "kind" in data:
        return KINDS[data["kind"]](**{name: of_plain(v) for name, v in data["fields"].items()})
    if "array" in data:
        if data["type"] not in _NUMBERS:
            raise ValueError(f"{data['type']} are no numbers")
        content = base64.b64decode(data["array"], validate=True)
        return np.frombuffer(content, dtype=data["type"]).reshape(data["shape"]).copy()
    if "complex" in data:
        return complex(*data["complex"])
    if "tuple" in data:
        return tuple(of_plain(v) for v in data["tuple"])
    return {name: of_plain(v) for name, v in data["table"]}


def _array(value: np.ndarray[Any, Any]) -> dict[str, Any]:
    plain = np.ascontiguousarray(value)
    plain = plain.astype(plain.dtype.newbyteorder("<"), copy=False)
    if plain.dtype.str not in _NUMBERS:
        raise TypeError(f"an array of {plain.dtype} is no result")
    content = base64.b64encode(plain.tobytes()).decode("ascii")
    return {"array": content, "type": plain.dtype.str, "shape": list(value.shape)}
