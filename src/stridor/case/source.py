"""Case files read from disk or from text, and the templates they may start from."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Sequence
from importlib import resources
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from ..asking import OVERRIDES, PATH, TEXT, takes
from ..errors import CaseError, kind_of
from ..reading import irregular, is_utf_16
from .outsized import deep_line

if TYPE_CHECKING:
    from .model import Case

LARGEST = 2**24  # bytes of a case file; what is large lies in files of its own
_POSITION = re.compile(r"\s*\(at (?:line (\d+), column (\d+)|end of document)\)\s*$")
_KEYS = re.compile(r"\('[^)]*',?\)")  # how tomllib names a table


@takes(overrides=OVERRIDES)
def load(path: str | PathLike[str], overrides: Sequence[str] = ()) -> Case:
    """The case in a TOML file, with overrides such as "phases.1.duration=0.01" applied. Raises CaseError."""
    if not isinstance(path, str | PathLike):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise CaseError("path", kind_of(path), "the path of a case file")
    source = os.fspath(path)
    try:
        if reason := irregular(Path(path), LARGEST):
            told = reason.replace("is a folder", "is a directory")
            raise CaseError(source, None, told.replace("must be a file", "give the path of a case file"))
        text = Path(path).read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        raise CaseError(source, None, "no such file") from None
    except UnicodeDecodeError as error:
        if source.endswith((".npz", ".nc", ".zarr")):
            told = "no case file but a result; `stridor plot` draws what analyses wrote, `stridor reduce` takes models"
            raise CaseError(source, None, told) from None
        if is_utf_16(error.object):
            told = "text of UTF-16, two bytes a character, as some shells write it; save the file as UTF-8"
            raise CaseError(source, None, told) from None
        raise CaseError(source, None, f"not UTF-8 text (byte {error.start}); save the file as UTF-8") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise CaseError(source, None, f"cannot be read: {reason}") from None
    return loads(text, overrides, source, folder=Path(path).resolve().parent)


@takes(text=TEXT, overrides=OVERRIDES, source=TEXT, folder=PATH.or_none())
def loads(
    text: str, overrides: Sequence[str] = (), source: str = "<text>", *, folder: Path | None = None
) -> Case:
    """The case in a TOML text, with overrides applied; `source` is its name in messages. Raises CaseError.

    Mesh files are sought from `folder` (default: the working directory) and kept with their full path.
    """
    if number := deep_line(text):
        raise CaseError(f"{source}, line {number}", None, "a key of tables that are nested too deeply")
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise _syntax(error, source) from None
    except RecursionError:
        raise CaseError(source, None, "not valid TOML: nested too deeply") from None
    except ValueError as error:  # a whole number of more digits than Python takes, a date that is none
        raise CaseError(source, None, f"not valid TOML: {_readable(error)}") from None
    if not data and not overrides:
        raise CaseError(source, None, "empty; a case needs at least one table [bodies.NAME]")
    from .given import as_written  # half a second, which a file that is none does not wait for
    from .model import Case
    from .overrides import override

    if problems := override(data, overrides):
        raise CaseError.many(problems)
    return Case.checked(as_written(data, folder))


def _readable(error: ValueError) -> str:
    said = str(error)
    return "a whole number has thousands of digits" if "digits" in said else said


def templates() -> list[str]:
    """Names of the case files to start from."""
    folder = resources.files("stridor.case") / "templates"
    return sorted(item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml"))


def template_text(name: str) -> str:
    """The commented text of a template. Raises CaseError for a name that is not one of `templates()`."""
    if name not in templates():
        from .points import choice

        raise CaseError("template", name, f"no such template{choice(name, templates(), 'there are')}")
    return (resources.files("stridor.case") / "templates" / f"{name}.toml").read_text(encoding="utf-8")


def _syntax(error: tomllib.TOMLDecodeError, source: str) -> CaseError:
    message = _KEYS.sub(_bracketed, str(error))
    found = _POSITION.search(message)
    reason = _POSITION.sub("", message)
    if found is None:
        return CaseError(source, None, f"not valid TOML: {reason}")
    where = f"{source}, line {found[1]}, column {found[2]}" if found[1] else f"{source}, at the end"
    return CaseError(where, None, f"not valid TOML: {reason[:1].lower()}{reason[1:]}")


def _bracketed(keys: re.Match[str]) -> str:
    return "[" + ".".join(re.findall(r"'([^']*)'", keys[0])) + "]"
