"""Files of compiled functions in our folder. Built on numba's cache, which knows how to write code and to load it."""

from __future__ import annotations

import contextlib
import hashlib
import os
import pickle
import sys
import uuid
from collections.abc import Generator
from types import FunctionType
from typing import Any, cast

from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile

from ..interrupts import in_one_piece
from .folder import Folder
from .sources import PACKAGE
from .turns import Turn

_Cache: Any = FunctionCache
_Way: Any = CompileResultCacheImpl
_File: Any = IndexDataCacheFile


class _Location:
    """Where the code of one function lies, as numba asks for it."""

    def __init__(self, folder: Folder, function: FunctionType) -> None:
        self._folder = folder
        self._py_file = function.__code__.co_filename

    def ensure_cache_path(self) -> None:
        self._folder.make()

    def get_cache_path(self) -> str:
        return self._folder.path


class _Implementation(_Way):
    """How code becomes a file: numba's way, at our place."""

    def __init__(self, function: FunctionType, folder: Folder, options: dict[str, Any]) -> None:
        self._lineno = function.__code__.co_firstlineno
        self._locator = _Location(folder, function)
        chosen = sorted((key, sorted(v) if isinstance(v, set) else v) for key, v in options.items())
        module = function.__module__.removeprefix(PACKAGE + ".")
        name = f"{module}.{function.__qualname__}".replace("<", "").replace(">", "")
        mark = hashlib.sha256(repr(chosen).encode()).hexdigest()[:8]
        python = f"py{sys.version_info[0]}{sys.version_info[1]}{getattr(sys, 'abiflags', '')}"
        self._filename_base = f"{name}-{self._lineno}-{mark}.{python}"


class _Files(_File):
    """One index of signatures and one file of code for each, which begins with its checksum.

    Two processes that compile the same function for other arguments at the same time cannot take each other's file:
    names are never given twice. What is damaged counts as not there.
    """

    def save(self, key: Any, data: Any) -> None:
        """Keep the code of one signature. Raises OSError."""
        own = cast("Any", self)
        names = own._load_index()
        name = names.get(key) or f"{own._index_name.removesuffix('.nbi')}.{uuid.uuid4().hex[:16]}.nbc"
        own._save_data(name, data)
        names[key] = name
        own._save_index(names)

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except Exception:  # whatever a damaged pickle raises
            return {}

    def _save_data(self, name: str, data: Any) -> None:
        own = cast("Any", self)
        content = own._dump(data)
        with own._open_for_write(own._data_path(name)) as file:
            file.write(hashlib.sha256(content).digest() + content)

    def _load_data(self, name: str) -> Any:
        with open(cast("Any", self)._data_path(name), "rb") as file:
            found = file.read()
        content = found[32:]
        if hashlib.sha256(content).digest() != found[:32]:
            raise FileNotFoundError(name)  # as numba takes one that is missing
        return pickle.loads(content)  # our own folder; code that somebody could write there would run anyway


def _stamp(function: FunctionType) -> str:
    """What makes code of another stamp useless: the folder stands for our sources, other modules for themselves."""
    if function.__module__.partition(".")[0] == PACKAGE:
        return ""
    try:
        with open(function.__code__.co_filename, "rb") as file:
            return hashlib.sha256(file.read()).hexdigest()
    except OSError:
        return uuid.uuid4().hex  # typed in somewhere: never the same


class KernelCache(_Cache):
    """The compiled forms of one function, in the folder for the present sources."""

    def __init__(self, function: FunctionType, folder: Folder, options: dict[str, Any]) -> None:
        self._name = repr(function)
        self._py_func = function
        self._folder = folder
        self._impl = _Implementation(function, folder, options)
        self._cache_path = folder.path
        base = self._impl.filename_base
        self._cache_file = _Files(folder.path, base, _stamp(function))
        self._turn = Turn(os.path.join(folder.path, f"{base}.turn"))
        self.enable()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compiled form for a signature, None where there is none that can be used: then it is this process's turn
        to compile it, until `save_overload`."""
        if not self._folder.valid():
            return None
        found = self._loaded(sig, target_context)
        if found is None:
            self._turn.take()
            found = self._loaded(sig, target_context)  # somebody else may have had the turn before
            if found is not None:
                self._turn.give()
        return found

    def _loaded(self, sig: Any, target_context: Any) -> Any:
        with in_one_piece():  # a callback fetches it
            return super().load_overload(sig, target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a compiled form; where that cannot be done, a note says so."""
        try:
            if self._folder.valid():
                super().save_overload(sig, data)
        finally:
            self._turn.give()

    @contextlib.contextmanager
    def _guard_against_spurious_io_errors(self) -> Generator[None, None, None]:
        # A full disk or a damaged file costs a compilation, not the run.
        try:
            yield
        except OSError as error:
            self._folder.complain(error)
