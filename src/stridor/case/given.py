"""What is given for a case, from a file or in Python, as tables of plain values with the paths of its files in full."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from pydantic import BaseModel

from ..errors import CaseError
from .outsized import DEEPEST, outsized

_PATHS = ("file", "labels", "mesh")


def as_written(tables: Mapping[str, Any], folder: Path | None = None) -> dict[str, Any]:
    """The tables as a case file would give them, [matrices] as the body that it stands for.

    folder: where relative paths of files start, None for the working directory. Raises CaseError for what no file could
    hold, or no case needs.
    """
    data = cast("dict[str, Any]", plain(dict(tables)))
    if problems := outsized(data):
        raise CaseError.many(problems)
    _spell_out(data)
    _resolve_files(data, folder)
    return data


def plain(value: object, path: str = "", depth: int = 0) -> object:
    """NumPy scalars and arrays, tuples, paths and tables as TOML would give them; None, in a table, is left out.

    Raises CaseError for a key that is no text, and for tables in themselves.
    """
    if depth > DEEPEST and isinstance(value, Mapping | list | tuple):
        raise CaseError(path, None, f"nested too deeply; at most {DEEPEST} tables or lists in each other")
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json", exclude_unset=True, exclude_none=True)
    if isinstance(value, os.PathLike):
        return os.fsdecode(cast("os.PathLike[str]", value))
    if hasattr(value, "tolist"):
        value = cast("Any", value).tolist()
    if isinstance(value, Mapping):
        table: dict[str, object] = {}
        for key, item in cast("Mapping[object, object]", value).items():
            if not isinstance(key, str):
                raise CaseError(path or "case", key, "a key of a table must be a text")
            if item is not None:
                table[key] = plain(item, f"{path}.{key}" if path else key, depth + 1)
        return table
    if isinstance(value, list | tuple):
        return [plain(item, f"{path}.{k}", depth + 1) for k, item in enumerate(cast("list[object]", value))]
    return value


def _spell_out(data: dict[str, Any]) -> None:
    """[matrices], or a list [[matrices]] of its terms, as the body called matrices that it stands for."""
    if "matrices" not in data:
        return
    short = data.pop("matrices")
    bodies = data.setdefault("bodies", {})
    if not isinstance(short, dict | list):
        raise CaseError("matrices", short, "must be a table with a list of terms, or that list, [[matrices]]")
    if not isinstance(bodies, dict) or "matrices" in bodies:
        accepted = "stands for [bodies.matrices], which the case has as well; remove one of them"
        raise CaseError("matrices", None, accepted)
    table: Any = short if isinstance(short, dict) else {"terms": short}
    bodies["matrices"] = {"type": "matrices", **table}


def _resolve_files(data: dict[str, Any], folder: Path | None) -> None:
    """Paths of files made absolute, so that a case means the same wherever it is saved."""
    bodies = data.get("bodies")
    for body in bodies.values() if isinstance(bodies, dict) else ():
        if isinstance(body, dict):
            terms = body.get("terms")
            tables: list[Any] = [body, *(terms if isinstance(terms, list) else [])]
            for table in tables:
                for key in _PATHS:
                    if isinstance(table, dict) and isinstance(table.get(key), str) and table[key]:
                        path = Path(table[key])
                        table[key] = str(path if path.is_absolute() else (folder or Path.cwd()) / path)
