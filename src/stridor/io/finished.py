"""Finished parts of a run in files of their own, taken by the next run of the very same case by the same program.

A file is two lines of JSON: whose part it is, with the hash of the second; the part (`plain_values`). It appears whole
or not at all, and what is of another case, of other versions, damaged or changed is computed anew.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from ..reading import irregular
from ..study.provenance import versions
from .atomic import replacing
from .plain_values import of_plain, to_plain

FOLDER = "parts"
FORMAT = "stridor part 1"
_LONGEST = 1 << 16  # bytes of the first line


class FinishedParts:
    """Parts of one case in a folder; key: `study.case_key`. fresh: nothing is taken, all of it is kept anew.
    stale: names of parts that are there, but not of this case and these versions, or damaged."""

    def __init__(self, folder: Path, key: str, *, fresh: bool = False) -> None:
        self.folder, self.key, self.fresh = folder, key, fresh
        self.stale: list[str] = []

    def get(self, name: str) -> Any:
        """The part, None where there is none that belongs to this case."""
        path = self.folder / f"{name}.jsonl"
        if self.fresh or not path.is_file():
            return None
        try:
            if irregular(path):
                return None
            with path.open("rb") as stream:
                head = json.loads(stream.readline(_LONGEST))
                body = stream.read()
            if head != self._head(name, body):
                raise ValueError("of another case, or changed")
            return of_plain(json.loads(body))
        except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
            self.stale.append(name)
            return None

    def put(self, name: str, part: Any) -> None:
        """Keep a part in place of what was there under its name. Raises AnalysisError where it cannot be written."""
        body = json.dumps(to_plain(part)).encode()
        with replacing(self.folder / f"{name}.jsonl") as temporary:
            temporary.write_bytes(json.dumps(self._head(name, body)).encode() + b"\n" + body)

    def _head(self, name: str, body: bytes) -> dict[str, Any]:
        check = hashlib.sha256(body).hexdigest()
        return {"format": FORMAT, "part": name, "case": self.key, "versions": versions(), "check": check}
