"""Readers of meshio's with what they lack, in copies of our own: meshio itself stays as it is for everyone else.

Of legacy VTK files of version 5.1 `int` is 4 bytes wide, which its reader takes for 8, and the other plain types of C
are those of older versions, which it does not know. A mark of UTF-8 before the first line is passed over. Views of
Gmsh's, data at nodes or elements, are as well: they are no part of a mesh, and may be of some of its nodes only. Where
another version of meshio is made otherwise, its own readers do.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, BinaryIO

MARK = b"\xef\xbb\xbf"  # what some editors put before UTF-8
_GMSH = ("_gmsh22", "_gmsh40", "_gmsh41")  # formats


def read(file: Path, suffix: str) -> Any:
    """meshio's mesh in a file of a suffix: .msh, .vtk or .vtu; raises whatever its reader does."""
    if suffix == ".vtu":
        return importlib.import_module("meshio.vtu").read(str(file))
    with file.open("rb") as stream:
        if suffix == ".msh":
            return _made(_gmsh, "meshio.gmsh.main")(stream)
        if stream.read(len(MARK)) != MARK:
            stream.seek(0)
        return _made(_vtk, "meshio.vtk._main")(stream)


def _made(reader: Callable[[], FunctionType], plain: str) -> FunctionType:
    """The reader that was made of meshio's, or its own of that module."""
    try:
        return reader()
    except (AttributeError, ImportError, KeyError):
        return importlib.import_module(plain).read_buffer


@cache
def _vtk() -> FunctionType:
    main = importlib.import_module("meshio.vtk._main")
    older = importlib.import_module("meshio.vtk._vtk_42").vtk_to_numpy_dtype_name
    newer = _copy("meshio.vtk._vtk_51")
    plain = {name: dtype for name, dtype in older.items() if name != "bit"}  # eight of which share a byte
    vars(newer)["vtk_to_numpy_dtype_name"] = vars(newer)["vtk_to_numpy_dtype_name"] | plain
    return _with(main.read_buffer, _vtk_51=newer)


@cache
def _gmsh() -> FunctionType:
    main = importlib.import_module("meshio.gmsh.main")
    own = {name: _copy(f"meshio.gmsh.{name}") for name in _GMSH}
    for module in own.values():
        vars(module)["_read_data"] = _pass_over
    readers = {version: own[m.__name__.rpartition(".")[2]] for version, m in vars(main)["_readers"].items()}
    return _with(main.read_buffer, _readers=readers)


def _copy(name: str) -> ModuleType:
    """A module run once more, under its name but known to nobody else."""
    spec = importlib.util.find_spec(name)
    if spec is None or spec.loader is None:
        raise ImportError(f"no module {name}")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _with(function: Any, **names: Any) -> FunctionType:
    """A function that finds other things under some names of its module."""
    return FunctionType(function.__code__, {**function.__globals__, **names}, function.__name__, function.__defaults__)


def _pass_over(stream: BinaryIO, section: str, *_: Any) -> None:
    """Go on after the end of a section, of text or binary. Raises ValueError where it does not end."""
    start, end = stream.tell(), f"$End{section}"
    at = stream.read().find(end.encode())
    if at < 0:
        raise ValueError(f"no {end}")
    stream.seek(start + at)
    stream.readline()
