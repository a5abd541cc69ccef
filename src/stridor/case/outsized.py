"""Keys, numbers and nestings that no case needs, found before anything looks at what they mean."""

from __future__ import annotations

from typing import Any, cast

from ..errors import Problem

LONGEST_KEY = 200
DEEPEST = 20
MOST_BITS = 10_000  # of a whole number: about the longest that Python still writes out
MOST_FOUND = 20
_MOST_DOTS = 64


def deep_line(text: str) -> int | None:
    """Number of the first line of a TOML text with a key of so many parts that reading it would take for ever."""
    for number, line in enumerate(text.split("\n"), start=1):
        if line.count(".") <= _MOST_DOTS:
            continue
        head = line.lstrip()
        keys = [part.rpartition(",")[2].rpartition("{")[2] for part in line.split("=")[:-1]]
        if head.startswith("[") and "," not in head:
            keys.append(head)
        if any(key.count(".") > _MOST_DOTS for key in keys):
            return number
    return None


def outsized(data: dict[str, Any]) -> list[Problem]:
    """What in the data of a case is too long, too large or too deep, the first of it."""
    found: list[Problem] = []
    left: list[tuple[str, Any, int]] = [("", data, 0)]
    while left and len(found) < MOST_FOUND:
        path, value, depth = left.pop()
        if isinstance(value, dict | list) and depth > DEEPEST:
            found.append(Problem(path, None, f"nested too deeply; at most {DEEPEST} tables or lists in each other"))
        elif isinstance(value, dict):
            for key, item in cast("dict[str, Any]", value).items():
                key_path = f"{path}.{key}" if path else key
                if len(key) > LONGEST_KEY:
                    found.append(Problem(key_path, None, f"a key of {len(key)} letters; at most {LONGEST_KEY}"))
                else:
                    left.append((key_path, item, depth + 1))
        elif isinstance(value, list):
            left.extend((f"{path}.{k}", item, depth + 1) for k, item in enumerate(cast("list[Any]", value)))
        elif isinstance(value, int) and value.bit_length() > MOST_BITS:
            found.append(Problem(path, value, "too large to be computed with"))
    return found[:MOST_FOUND]
