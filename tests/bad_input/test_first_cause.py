"""One fault, one line: what follows from a misspelt key or a broken table is not told as a fault of its own."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Iterator
from typing import Any

import pytest

import solid_cases as cases
from stridor.case import Case, template_text
from stridor.errors import CaseError

CASES = {
    "beams": template_text("two-beams").partition("[reference]")[0],
    "pad": template_text("pad-on-disc"),
    "belt": cases.BELT,
    "wall": cases.WALL,
}


def keys(table: dict[str, Any], path: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], str]]:
    for key, value in table.items():
        yield path, key
        if isinstance(value, dict):
            yield from keys(value, (*path, key))
        if isinstance(value, list):
            for number, item in enumerate(value):
                if isinstance(item, dict):
                    yield from keys(item, (*path, key, number))


def told(data: dict[str, Any]) -> list[str]:
    try:
        Case.checked(data)
    except CaseError as error:
        return [str(problem) for problem in error.problems]
    return []


@pytest.mark.parametrize("text", [*CASES.values()], ids=[*CASES])
def test_one_typo_is_told_in_one_line(text: str) -> None:
    """Every key of four cases misspelt and every value replaced: names that others refer to are told at each of these
    places, everything else once."""
    data = tomllib.loads(text)
    for path, key in keys(data):
        for instead in (f"{key}x", key[1:] or "zz", "qqq"):
            other = copy.deepcopy(data)
            table: Any = other
            for step in path:
                table = table[step]
            table[instead] = table.pop(key)
            lines = told(other)
            assert len(lines) <= 1 or all("no such" in line for line in lines), (path, key, instead, lines)
        for value in ("nonsense", -1, []):
            other = copy.deepcopy(data)
            table = other
            for step in path:
                table = table[step]
            table[key] = value
            lines = told(other)
            assert len(lines) <= 1 or all("no such" in line for line in lines), (path, key, value, lines)


def test_the_one_line_says_both() -> None:
    data = tomllib.loads(cases.BELT)
    body = data["bodies"]["m"]
    body["weight"] = body.pop("mass")
    assert told(data) == [
        "bodies.m.weight: unknown key; accepted: type, mass, position, initial_velocity, initial_displacement; mass is "
        "missing"
    ]


def test_two_faults_are_still_two_lines() -> None:
    data = tomllib.loads(cases.BELT)
    data["bodies"]["m"]["mas"] = data["bodies"]["m"].pop("mass")
    data["springs"]["k"]["stiffness"] = "much"
    assert len(told(data)) == 2
    obstacles = tomllib.loads(cases.BELT)
    del obstacles["bodies"]["m"]
    assert "bodies: only obstacles, which are rigid; a case needs a beam, a solid or a mass as well" in told(obstacles)
