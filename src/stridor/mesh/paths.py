"""Files that are to be read: there, regular, not empty, and of a kind that is known."""

from __future__ import annotations

from pathlib import Path

from ..errors import CaseError
from ..reading import irregular, is_utf_16

_LONGEST = 120
_LONGEST_PATH = 56
# Files of other programs that Gmsh opens, by suffix: meshes, and what has still to be meshed.
_MESHES = {
    **dict.fromkeys((".bdf", ".nas"), "a Nastran deck"),
    ".med": "a MED mesh",
    ".mesh": "a Medit mesh",
    ".unv": "an I-deas universal file",
}
_GEOMETRY = {
    **dict.fromkeys((".step", ".stp", ".iges", ".igs", ".brep"), "geometry"),
    ".geo": "a script of Gmsh's",
    ".stl": "a surface of triangles",
}


def check_file(file: Path, where: str, suffixes: tuple[str, ...]) -> str:
    """The suffix, in lower case, of a file that is there and holds something. Raises CaseError otherwise."""
    suffix = file.suffix.lower()
    try:
        if file.is_dir():
            raise CaseError(where, shown_path(file), f"is a folder; must be a mesh file: {', '.join(suffixes)}")
        if suffix not in suffixes:
            raise CaseError(where, shown_path(file), _not_accepted(suffix, suffixes))
        if reason := irregular(file):
            raise CaseError(where, shown_path(file), reason)
        if file.stat().st_size == 0:
            raise CaseError(where, shown_path(file), "the file is empty (0 bytes)")
        with file.open("rb") as stream:
            if is_utf_16(stream.read(2)):
                text = "is text of UTF-16, two bytes a character, as some shells write it; save it as UTF-8 or ASCII"
                raise CaseError(where, shown_path(file), text)
    except FileNotFoundError:
        raise CaseError(where, shown_path(file), "no such file") from None
    except (OSError, ValueError) as error:  # ValueError: a name with a NUL
        raise CaseError(where, shown_path(file), f"cannot be read: {in_one_line(error)}") from error
    return suffix


def _not_accepted(suffix: str, suffixes: tuple[str, ...]) -> str:
    """What a file of another suffix is, and how Gmsh makes a mesh that is read of it."""
    accepted = f"accepted: {', '.join(suffixes)}"
    if ".msh" in suffixes and (what := _MESHES.get(suffix)):
        return f"is {what}, which is not read; {accepted}; open it in Gmsh, name boundaries and body, export it as .msh"
    if ".msh" in suffixes and (what := _GEOMETRY.get(suffix)):
        return f"is {what} and no mesh yet; {accepted}; mesh it in Gmsh, name boundaries and body, export it as .msh"
    return f"is no mesh file by its suffix; {accepted}"


def shown_path(file: Path) -> str:
    """A path for a message: where it is too long its beginning is left out, not the name of the file."""
    text = str(file)
    return text if len(text) <= _LONGEST_PATH else "…" + text[1 - _LONGEST_PATH :]


def in_one_line(error: BaseException) -> str:
    """What an error says, in one line, shortened."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    text = " ".join(str(error).split())
    if isinstance(error, KeyError):
        text = f"unknown entry {text}"
    elif isinstance(error, SystemExit):
        text = ""
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"
