"""The names that docs/results.md gives to what stands in documents of verbs, and those that a document has."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).parents[1] / "docs" / "results.md"
# Tables whose keys are names of the case or of the result, not words of the document.
NAMED = {"amplitudes", "contacts", "bodies", "first_regime", "settled", "matrices", "copies", "seconds", "point", "parameters"}


def told_names() -> tuple[set[str], dict[str, set[str]]]:
    """Names in the documentation: in all documents, and by verb."""
    text = RESULTS.read_text(encoding="utf-8")
    part = text.partition("## JSON\n")[2].partition("\n## ")[0]
    general, _, verbs = part.partition("The verbs:")
    items = re.split(r"^- (?=`)", verbs, flags=re.MULTILINE)[1:]
    found: dict[str, set[str]] = {}
    for item in items:
        head, _, rest = item.partition(":")
        for verb in re.findall(r"`([\w-]+)`", head):
            found[verb] = set(re.findall(r"`(\w+)`", rest))
    return set(re.findall(r"`(\w+)`", general)), found


def names(value: Any) -> Iterator[str]:
    if isinstance(value, list):
        for item in value:
            yield from names(item)
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield key
            tables = inner.values() if key in NAMED and isinstance(inner, dict) else [inner]
            for table in tables:
                yield from names(table)


def assert_told(verb: str, printed: str) -> None:
    """Every name in what a verb printed with --json stands in the documentation, at that verb."""
    document = json.loads(printed)
    if verb == "matrices":
        document = list(document.values())  # by names of bodies
    if verb in ("run", "report"):
        # Documents of other verbs, told of at those.
        document = {key: None if isinstance(value, dict) and key != "seconds" else value for key, value in document.items()}
    general, verbs = told_names()
    found = set(names(document))
    assert found
    assert not found - general - verbs[verb]
