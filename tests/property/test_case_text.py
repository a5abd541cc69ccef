"""A case is the same from a file, from its tables in Python, and from the text it writes of itself."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as some

import solid_cases
import stridor as st
from rubbing_block import rubbing_block
from stridor.case import template_text, templates

pytestmark = pytest.mark.property
ALL_TABLES = """
title = "μ \\" and \\\\"
units = "nondimensional"
[parameters.Omega]
value = 5
range = [1, 10]
[bodies."odd-name_1"]
type = "matrices"
terms = [{ file = "m.mtx", role = "mass" }, { file = "../k.mtx", role = "stiffness", factor = "Omega**2 - 1" }]
labels = "sub folder/labels.txt"
points = { tip = 3 }
[bodies.m]
type = "mass"
mass = 1
position = [0, 0, 1e-3]
[bodies.wall]
type = "obstacle"
shape = "flat"
point = [0, 0, 0]
normal = [0, 0, 1]
[contacts.c]
slave = "m"
master = "wall"
stiffness = 1e6
friction = { law = "table", speeds = [0, 1e-3, 1], coefficients = [0.4, 0.3, 0.3] }
[springs.s]
between = ["m", "ground"]
stiffness = -1e22
direction = [0, 0, 1]
[[phases]]
name = "a = \\"b\\" # [c]"
duration = 1e-300
ramp = 0
[steady]
friction = "stick-slip"
[[steady.steps]]
increments = 2
"""
TEXTS = {
    **{name: template_text(name) for name in templates()},
    **{name: text for name, text in vars(solid_cases).items() if name.isupper() and isinstance(text, str) and "[bodies" in text},
    "blocks": solid_cases.two_blocks("quad8", 3, 2),
    "ring": solid_cases.ring((1, 8)),
    "slider": solid_cases.slider(space=True),
    "rubbing": rubbing_block("max_frequency_hz = 30e3"),
    "all": ALL_TABLES,
}  # fmt: skip


@cache
def tables(name: str) -> dict[str, Any]:
    return tomllib.loads(TEXTS[name])


def leaves(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of all numbers and texts."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path] if not isinstance(value, dict | list) else [leaf for k, v in items for leaf in leaves(v, (*path, k))]


def put(value: Any, path: tuple[Any, ...], new: Any) -> Any:
    if not path:
        return new
    copy = dict(value) if isinstance(value, dict) else list(value)
    copy[path[0]] = put(value[path[0]], path[1:], new)
    return copy


@some.composite
def varied(draw: Any) -> dict[str, Any]:
    """A case with a few of its numbers and texts changed, as far as it stays one."""
    data = tables(draw(some.sampled_from(sorted(TEXTS))))
    for path in draw(some.lists(some.sampled_from(leaves(data)), max_size=4)):
        value = data
        for step in path:
            value = value[step]
        if isinstance(value, bool):
            new: Any = draw(some.booleans())
        elif isinstance(value, int):
            new = draw(some.sampled_from([value, float(value), value + 1]))
        elif isinstance(value, float):
            new = draw(some.one_of(some.floats(-1e100, 1e100), some.floats(0.5, 2.0).map(value.__mul__), some.just(-0.0)))
        elif path[-1] in ("title", "name"):
            new = draw(some.text(some.characters(exclude_categories=["Cs"]), min_size=1, max_size=12))
        else:
            new = value
        data = put(data, path, new)
    return data


def numpy_made(value: Any) -> Any:
    """The same with NumPy's numbers and arrays, tuples and None where a table says nothing."""
    if isinstance(value, dict):
        return {"centre": None} | {key: numpy_made(item) for key, item in value.items()}
    if isinstance(value, list) and value and all(isinstance(item, float) for item in value):
        return np.array(value)
    if isinstance(value, list):
        return tuple(map(numpy_made, value))
    return np.float64(value) if isinstance(value, float) else value


@settings(max_examples=40, deadline=None)
@given(data=varied(), defaults=some.booleans())
def test_text_and_tables_make_the_same_case(data: dict[str, Any], defaults: bool):
    try:
        case = st.Case(**data)
    except st.CaseError:
        assume(False)
        raise
    text = case.to_toml(defaults=defaults)
    text.encode("utf-8")
    assert st.loads(text, folder=Path("/elsewhere")) == case
    assert st.loads(text).to_toml(defaults=defaults) == text
    assert st.Case(**tomllib.loads(text)) == case
    assert st.Case(**{key: numpy_made(value) for key, value in data.items()}) == case


@pytest.mark.parametrize("name", sorted(TEXTS))
def test_every_case_comes_back(name: str, tmp_path: Path):
    case = st.loads(TEXTS[name], folder=tmp_path / "sub")
    (tmp_path / "case.toml").write_text(case.to_toml(), encoding="utf-8")
    assert st.load(tmp_path / "case.toml") == case  # paths of files are those of the folder it was read in


@settings(max_examples=40, deadline=None)
@given(data=varied(), cut=some.data())
def test_messages_are_those_of_a_file(data: dict[str, Any], cut: Any):
    """Whatever is wrong is told at the same places in the same words, from a text or from tables."""
    import tomlkit

    path = cut.draw(some.sampled_from(leaves(data)))
    wrong = put(data, path, cut.draw(some.sampled_from(["nonsense", -1.0, [], 10**400, {"odd": 1}, True])))
    told = []
    for make in (lambda: st.loads(tomlkit.dumps(wrong)), lambda: st.Case(**wrong)):
        try:
            make()
            told.append(())
        except st.CaseError as error:
            told.append([(problem.where, problem.accepted) for problem in error.problems])
    assert told[0] == told[1]
