"""A name for "the same case, computed by the same program": what finished parts are kept under and sought by."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, cast

from ..case import Case
from .fingerprint import contents

# What says where to look, not what is there: a part at some μ is the same whatever else is asked for.
ELSEWHERE = ("title", "comparison", "reference")
FILES = ("file", "labels", "mesh")


def case_key(case: Case) -> str:
    """SHA-256 of all that a case computes from: its values, defaults too, the contents of the files it names and the
    sources of this program, since another version may give other numbers."""
    data = case.model_dump(mode="json", exclude_none=True)
    kept = {name: value for name, value in data.items() if name not in ELSEWHERE}
    files = {path: contents(Path(path)) for path in sorted(set(files_of(kept)))}
    text = json.dumps({"case": kept, "files": files, "sources": sources_key()}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def files_of(value: Any) -> Iterator[str]:
    """Paths of files named anywhere in the tables of a case."""
    if isinstance(value, Mapping):
        for name, item in cast("Mapping[str, Any]", value).items():
            if name in FILES and isinstance(item, str):
                yield item
            else:
                yield from files_of(item)
    elif isinstance(value, list):
        for item in cast("list[Any]", value):
            yield from files_of(item)


@cache
def sources_key() -> str:
    """SHA-256 of the modules of this package."""
    digest = hashlib.sha256()
    package = Path(__file__).parent.parent
    for module in sorted(package.rglob("*.py")):
        digest.update(str(module.relative_to(package)).encode())
        digest.update(module.read_bytes())
    return digest.hexdigest()
