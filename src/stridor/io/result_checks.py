"""What a result file must hold: its variables with their dimensions, kinds and ranges, and what fits what.

Beside the hash of its contents this finds what no stridor can have written, such as a status of 7, NaN among works, or
names that are not those of its contacts.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

INFINITY = float("inf")


@dataclass(frozen=True)
class _Rule:
    """A variable: its dimensions; kind of its values, "f", "i" or "O"; lowest and highest; whether NaN may be there."""

    dims: tuple[str, ...]
    kind: str = "f"
    low: float = -INFINITY
    high: float = INFINITY
    missing: bool = False
    needed: bool = True


_PAIRS = ("mu", "branch")
_BY_CONTACT, _BY_POINT = ("time", "contact"), ("time", "point", "direction")
_BY_NODE = ("node_time", "slave_node")
_PART = _Rule(("part",), "O")
_MODES = {
    "mu": _Rule(("mu",)),
    "branch": _Rule(("branch",), "i"),
    "part": _PART,
    "eigenvalue": _Rule((*_PAIRS, "part"), missing=True),
    **{name: _Rule(_PAIRS, missing=True) for name in ("frequency", "growth_rate")},
    "damping_ratio": _Rule(_PAIRS, low=-1.0 - 1e-12, high=1.0 + 1e-12, missing=True),
    "residual": _Rule(_PAIRS, low=0.0, missing=True),
    "unstable": _Rule(_PAIRS, "i", 0, 1),
    "right_vector": _Rule((*_PAIRS, "freedom", "part"), missing=True, needed=False),
    "left_vector": _Rule((*_PAIRS, "freedom", "part"), missing=True, needed=False),
}
_ONSETS = {
    "part": _PART,
    "mu": _Rule(("onset",)),
    "frequency_hz": _Rule(("onset",), low=0.0),
    "residual": _Rule(("onset",), low=0.0, missing=True),
    "square_root_coefficient": _Rule(("onset",), missing=True),
    "growth_slope": _Rule(("onset",), missing=True),
    "kind": _Rule(("onset",), "O"),
    "stabilising": _Rule(("onset",), "i", 0, 1),
    "branches": _Rule(("onset", "pair"), "i"),
    "exceptional_mu": _Rule(("onset", "part"), missing=True),
}
_AGREEMENT = {
    "part": _PART,
    "mu": _Rule(("mu",), low=0.0),
    "modal_eigenvalue": _Rule(("mu", "part"), missing=True),
    "temporal_eigenvalue": _Rule(("mu", "part"), missing=True),
    "frequency_error": _Rule(("mu",), missing=True),
    "growth_rate_error": _Rule(("mu",), missing=True),
    "growth_mac": _Rule(("mu",), low=-1e-12, high=1.0 + 1e-12, missing=True),
    "mac": _Rule(("mu",), low=-1e-12, high=1.0 + 1e-12, missing=True),
    "dominant_frequency": _Rule(("mu",), low=0.0, missing=True),
}
_BOTH = ("parameter", "branch")
_SENSITIVITIES = {
    "parameter": _Rule(("parameter",), "O"),
    "branch": _Rule(("branch",), "i"),
    "value": _Rule(("parameter",)),
    **{name: _Rule(("branch",)) for name in ("growth_rate", "frequency")},
    **{name: _Rule(_BOTH) for name in ("growth_derivative", "angular_frequency_derivative")},
    **{name: _Rule(_BOTH, missing=True) for name in ("growth_per_percent", "frequency_per_percent")},
    **{name: _Rule(_BOTH, missing=True) for name in ("exceptional_real", "exceptional_imag")},
    **{name: _Rule(("branch",), low=0.0, missing=True) for name in ("condition", "nearest", "residual")},
}
_RECORDS = {
    **{name: _Rule(_BY_CONTACT) for name in ("normal_force", "tangential_force", "slip_speed", "gap")},
    **{name: _Rule(_BY_POINT) for name in ("displacement", "velocity", "acceleration")},
    **{name: _Rule(("time",)) for name in ("kinetic", "elastic")},
}
_RUN = {
    "time": _Rule(("time",), low=0.0),
    "contact": _Rule(("contact",), "O"),
    "point": _Rule(("point",), "O"),
    "direction": _Rule(("direction",), "O"),
    "status": _Rule(_BY_CONTACT, "i", 0, 2),
    **_RECORDS,
}
_NODE_RECORDS = {
    "node_normal_force": _Rule(_BY_NODE),
    "node_tangential_force": _Rule((*_BY_NODE, "tangent")),
    "node_slip_velocity": _Rule((*_BY_NODE, "tangent")),
    "node_gap": _Rule(_BY_NODE),
}
_NODES = {
    "node_time": _Rule(("node_time",), low=0.0),
    "node_owner": _Rule(("slave_node",), "i", 0),
    "node_position": _Rule(("slave_node", "direction")),
    "node_area": _Rule(("slave_node",), low=0.0, missing=True),
    "node_tangents": _Rule(("slave_node", "tangent", "direction")),
    "node_status": _Rule(_BY_NODE, "i", 0, 2),
    **_NODE_RECORDS,
}
_GRID = ("sweep", "mu", "load", "speed", "perturbation")


def _ensemble(dims: tuple[str, ...]) -> dict[str, _Rule]:
    """Rules of an ensemble over a grid, or over members one by one."""
    share = _Rule((*dims, "contact"), low=0.0, high=1.0, missing=True)
    positive = _Rule(dims, low=0.0, missing=True)
    return {
        "contact": _Rule(("contact",), "O"),
        **dict.fromkeys(("stick", "slip", "separation"), share),
        **dict.fromkeys(("rms", "peak", "frequency_hz", "slip_speed", "mode_hz"), positive),
        **{name: _Rule(dims, missing=True) for name in ("growth_rate", "mode_deviation")},
        "stronger_below_hz": replace(positive, needed=False),  # files of an earlier version have none
        "mode": _Rule(dims, "i", 0),
        **{name: _Rule(dims, "O") for name in ("regime", "error")},
    }


_BOUNDARY = {
    **{name: _Rule(("point",)) for name in ("x", "y", "tangent_x", "tangent_y")},
    "frequency_hz": _Rule(("point",), low=0.0),
    "curve": _Rule(("point",), "i", 1),
    "kind": _Rule(("point",), "O"),
    "growth_side": _Rule(("point",), "i", -1, 1),
    "modes_beside": _Rule(("point",), "i", 0),
    **{name: _Rule(("point",), low=0.0, missing=True) for name in ("boundary_error", "residual")},
}
_ALONG = {
    "number": _Rule(("number",), "O"),
    **{name: _Rule(("onset",)) for name in ("value", "reduced_value")},
    "frequency_hz": _Rule(("onset",), low=0.0),
    "residual": _Rule(("onset",), low=0.0, missing=True),
    **{name: _Rule(("onset",), missing=True) for name in ("square_root_coefficient", "growth_slope", "enters_at")},
    "kind": _Rule(("onset",), "O"),
    "stabilising": _Rule(("onset",), "i", 0, 1),
    "point": _Rule(("onset", "number")),
}
_MAP = {
    **{name: _Rule((name,)) for name in ("x", "y")},
    **{name: _Rule(("x", "y"), low=0.0, missing=True) for name in ("onset_mu", "frequency", "residual")},
    **{name: _Rule(("x", "y"), missing=True) for name in ("slope_x", "slope_y")},
    "error": _Rule(("x", "y"), low=0.0, missing=True, needed=False),
}
_CHANGES = {
    "part": _PART,
    "branch": _Rule(("branch",), "i"),
    **dict.fromkeys(("kind", "name"), _Rule(("change",), "O")),
    "direction": _Rule(("change",), low=-1.0, high=1.0),
    **dict.fromkeys(("percent", "removed_per_percent", "removed_sum_per_percent", "removed"), _Rule(("change",))),
    "mass": _Rule(("change",), low=0.0, missing=True),
    "value": _Rule(("change",), missing=True, needed=False),
    **{
        f"verified_{name}": _Rule(("change",), missing=True)
        for name in ("growth_rate", "frequency_hz", "removed", "removed_sum")
    },
    "eigenvalue": _Rule(("branch", "part")),
    "predicted": _Rule(("change", "branch", "part")),
}
_AT_POINTS = {
    "number": _Rule(("number",), "O"),
    "value": _Rule(("point", "number")),
    **{name: _Rule(("point", "mode"), missing=True) for name in ("frequency_hz", "growth_rate")},
    **{name: _Rule(("point", "mode"), low=0.0, missing=True) for name in ("error", "residual")},
    **{name: _Rule(("point", "mode"), "i", 0, 1) for name in ("unstable", "passed")},
    "inside": _Rule(("point",), "i", 0, 1),
    "corrections": _Rule(("point",), "i", 0),
    "unlike": _Rule(("point",), "O", needed=False),
}
_CYCLE, _CYCLE_CONTACT = ("cycle", "sample"), ("cycle", "sample", "contact")
_CYCLES = {
    "part": _PART,
    "contact": _Rule(("contact",), "O"),
    "point": _Rule(("point",), "O"),
    "mu": _Rule(("cycle",), low=0.0),
    "period": _Rule(("cycle",), low=0.0),
    "residual": _Rule(("cycle",), low=0.0),
    "grazed": _Rule(("cycle",), low=0.0, missing=True),
    "defect": _Rule(("cycle",), low=0.0, missing=True),
    "own_off": _Rule(("cycle",), low=0.0, missing=True),
    "time": _Rule(_CYCLE, low=0.0),
    "multiplier": _Rule(("cycle", "multiplier_number", "part"), missing=True),
    "status": _Rule(_CYCLE_CONTACT, "i", 0, 2),
    **dict.fromkeys(("normal_force", "tangential_force", "slip_velocity", "gap"), _Rule(_CYCLE_CONTACT)),
    **dict.fromkeys(("displacement", "velocity", "acceleration"), _Rule((*_CYCLE, "point", "direction"))),
    "shares": _Rule(("cycle", "contact", "kind"), low=-1e-12, high=1.0 + 1e-12),
    **dict.fromkeys(("slip_range", "force_range"), _Rule(("cycle", "contact", "end"))),
}
_RULES: dict[str, dict[str, _Rule]] = {
    "modes": _MODES, "onsets": _ONSETS, "sensitivities": _SENSITIVITIES, "compare": _AGREEMENT, "simulate": _RUN,
    "ensemble": _ensemble(_GRID), "boundary": _BOUNDARY, "cycles": _CYCLES, "onsets along": _ALONG,
    "damping map": _MAP, "countermeasures": _CHANGES, "reduced modes": _AT_POINTS,
}  # fmt: skip
_COUNTS = ("record_every", "steps", "planned_steps", "most_sweeps", "unconverged_steps")
_NUMBERS = ("step", "beta2", "step_limit", "wall_seconds")
_PATHS = ("modal", "nodal", "assembled", "exact", "implicit")
_SETTINGS = "restart_settings"


def check_results(dataset: Any) -> None:
    """Raise ValueError, KeyError or TypeError for a dataset that is none of stridor's results."""
    analysis = str(dataset.attrs["analysis"])
    if analysis not in _RULES:
        raise ValueError(f"results of {analysis[:40]!r}, which are not known")
    if not isinstance(json.loads(dataset.attrs["provenance"]), dict):
        raise ValueError("its provenance is no table")
    if analysis == "simulate":
        _check_run(dataset)
    elif analysis == "ensemble" and "member" in dataset.dims:
        _check_rules(dataset, _ensemble(("member",)), {})
    else:
        _check_rules(dataset, _RULES[analysis], {})


def _check_rules(dataset: Any, rules: Mapping[str, _Rule], loose: Mapping[str, int]) -> None:
    """Raise ValueError for a variable that breaks its rule. loose: variables whose last rows may not be finite, from
    which on."""
    for name, rule in rules.items():
        if name not in dataset.variables:
            if rule.needed:
                raise ValueError(f"{name} is missing")
            continue
        held = dataset.variables[name]
        if tuple(held.dims) != rule.dims:
            raise ValueError(f"{name} goes over {', '.join(held.dims) or 'nothing'}, not {', '.join(rule.dims)}")
        values = held.values
        if values.size and values.dtype.kind not in {"f": "f", "i": "iu", "O": "OU"}[rule.kind]:
            raise ValueError(f"{name} holds {values.dtype}")
        if values.size and rule.kind != "O":
            _check_range(name, values[: loose.get(name)], rule)


def _check_range(name: str, values: Any, rule: _Rule) -> None:
    good = np.isfinite(values)
    if not (rule.missing or np.all(good)):
        raise ValueError(f"{name} holds values that are not finite")
    if np.any((values[good] < rule.low) | (values[good] > rule.high)):
        raise ValueError(f"{name} holds values out of range")


def _check_run(dataset: Any) -> None:
    scalars, names = (_table(dataset, key) for key in ("scalars", "names"))
    _check_scalars(scalars)
    works, state = (_texts(names[key], key) for key in ("works", "state"))
    rules = _RUN | {f"work_{name}": _Rule(("time",)) for name in works}
    nodes = any(str(name).startswith("node_") for name in dataset.variables)
    blown = _first_not_finite(dataset, rules if scalars["interrupted"] else {}, "time")
    loose = {name: blown for name, rule in rules.items() if rule.kind == "f" and name != "time"}
    if nodes:
        rules |= _NODES
        last = _first_not_finite(dataset, _NODE_RECORDS if scalars["interrupted"] else {}, "node_time")
        loose |= dict.fromkeys(_NODE_RECORDS, last)
    _check_rules(dataset, rules, loose)
    for name, known in (("contact", "contacts"), ("point", "watch")):
        if [str(v) for v in dataset[name].values] != list(_texts(names[known], known)):
            raise ValueError(f"the names of {known} do not fit their records")
    if nodes and np.any(dataset["node_owner"].values >= len(names["contacts"])):
        raise ValueError("node_owner points beyond the contacts")
    for name in ("time", "node_time") if nodes else ("time",):
        _check_time(name, dataset[name].values, scalars)
    _check_phases(json.loads(dataset.attrs["phases"]), names["contacts"])
    kept = {f"restart_{name}" for name in state}
    if kept != {str(name) for name in dataset.variables if str(name).startswith("restart_")}:
        raise ValueError("its arrays for a restart are not those that it names")
    if _SETTINGS in kept and dataset[_SETTINGS].shape != (3,):
        raise ValueError(f"{_SETTINGS} is no list of 3 numbers")


def _table(dataset: Any, name: str) -> dict[str, Any]:
    found = json.loads(dataset.attrs[name])
    if not isinstance(found, dict):
        raise ValueError(f"its {name} are no table")
    return found


def _texts(found: Any, what: str) -> list[str]:
    if not isinstance(found, list) or not all(isinstance(text, str) for text in found):
        raise ValueError(f"its {what} are no list of names")
    return found


def _check_scalars(scalars: Mapping[str, Any]) -> None:
    for name in _COUNTS:
        value = scalars[name]
        if not isinstance(value, int) or isinstance(value, bool) or value < (name == "record_every"):
            raise ValueError(f"{name} is {str(value)[:20]}")
    for name in _NUMBERS:
        value = scalars[name]
        lowest = 0.0 if name == "wall_seconds" else 1e-300
        finite = isinstance(value, int | float) and (math.isfinite(value) or name == "step_limit")
        if not finite or not value >= lowest:
            raise ValueError(f"{name} is {str(value)[:20]}")
    if not 0.0 < scalars["beta2"] <= 1.0 or scalars["path"] not in _PATHS:
        raise ValueError(f"beta2 is {scalars['beta2']}, path {str(scalars['path'])[:20]}")
    if scalars["steps"] > scalars["planned_steps"] or not isinstance(scalars["interrupted"], bool):
        raise ValueError("its steps are more than were planned")


def _first_not_finite(dataset: Any, rules: Mapping[str, _Rule], along: str) -> int:
    """Record from which on a run that blew up is not finite, which it then is to its end; the number of records where
    it did not."""
    count = int(dataset.sizes[along]) if along in dataset.sizes else 0
    first = count
    for name, rule in rules.items():
        if rule.kind == "f" and name in dataset.variables and rule.dims[:1] == (along,):
            values = np.asarray(dataset.variables[name].values, dtype=float).reshape(count, -1)
            bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
            first = min(first, int(bad[0])) if len(bad) else first
    # A motion is seen not to be finite in the chunk of steps in which it ceases to be.
    return first


def _check_time(name: str, time: Any, scalars: Mapping[str, Any]) -> None:
    """Times of records rise in whole numbers of records, and end with the run."""
    between = scalars["record_every"] * scalars["step"]
    number = time / between
    if len(time) and (np.any(np.diff(time) <= 0) or np.any(np.abs(number - np.round(number)) > 1e-6 * (1 + number))):
        raise ValueError(f"{name} does not rise by records of {between:g} s")
    if len(time) and time[-1] > scalars["steps"] * scalars["step"] * (1 + 1e-9):
        raise ValueError(f"{name} goes beyond the {scalars['steps']} steps of the run")


def _check_phases(phases: Any, contacts: list[str]) -> None:
    for phase in phases:
        start, end = float(phase["start"]), float(phase["end"])
        if not (math.isfinite(start) and math.isfinite(end) and 0.0 <= start <= end and isinstance(phase["name"], str)):
            raise ValueError("a phase without a beginning and an end")
        if list(phase["contacts"]) != list(contacts):
            raise ValueError("statistics of contacts that it does not have")
        for statistics in phase["contacts"].values():
            for name, value in statistics.items():
                if value is None and name.startswith("first_"):
                    continue
                high = 1.0 + 1e-9 if name.endswith("_fraction") else INFINITY
                if not isinstance(value, int | float) or not 0.0 <= value <= high:
                    raise ValueError(f"{name} is {str(value)[:20]}")
