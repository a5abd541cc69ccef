"""What compiled code depends on: the sources of stridor, the compiler, and the processor it is for."""

from __future__ import annotations

import hashlib
import os
import platform
import sys
import time
import zipfile
import zipimport
from dataclasses import dataclass
from typing import Any

import llvmlite
import llvmlite.binding
import numba
import numpy as np
from numba.core import config

PACKAGE = __name__.partition(".")[0]
SUFFIXES = (".py", ".pyc")  # the latter where a package is installed without its sources
# Layers above all that is compiled, which nothing below may import (the contract of import-linter): no kernel can
# depend on them, and whoever works on them need not wait for the time loop to be compiled again.
ABOVE = ("app", "studies", "io", "view", "study", "agreement")
# Settings of numba that change the code it makes.
_SETTINGS = (
    "OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "ENABLE_AVX", "USING_SVML", "DISABLE_INTEL_SVML", "CPU_NAME",
    "CPU_FEATURES", "BOUNDSCHECK", "LLVM_REFPRUNE_PASS", "LLVM_REFPRUNE_FLAGS", "DEBUGINFO_DEFAULT",
    "EXTEND_VARIABLE_LIFETIMES",
)  # fmt: skip


@dataclass(frozen=True)
class Sources:
    """The package as it lies on the disk. location: its folder or archive; files: what to look at to see it change;
    digest: of the names and contents of all its modules but those above what is compiled."""

    location: str
    files: tuple[str, ...]
    digest: str

    def changed_since(self, moment: int) -> bool:
        """Was any file written or put in place after a moment [ns since 1970]?"""
        now = time.time_ns()
        try:
            for s in map(os.stat, self.files):
                # Archives and copies may date a file ahead, for ever newer than any moment; the change time is kept by
                # the system itself.
                dated = s.st_mtime_ns if s.st_mtime_ns <= now else 0
                if max(dated, s.st_ctime_ns) > moment:
                    return True
            return False
        except OSError:
            return True  # one is gone


def read_sources() -> Sources | None:
    """The sources of the package that runs; None where they are not on the disk (frozen into a program)."""
    package = sys.modules[PACKAGE]
    loader: Any = getattr(package.__spec__, "loader", None)
    folders = list(package.__path__)
    if len(folders) != 1:
        return None
    try:
        if isinstance(loader, zipimport.zipimporter):
            return _from_archive(loader.archive, folders[0])
        return _from_folder(folders[0])
    except (OSError, zipfile.BadZipFile):
        return None


def _from_folder(top: str) -> Sources | None:
    found: list[str] = []
    for folder, inner, names in os.walk(top):
        left_out = ("__pycache__", *ABOVE) if folder == top else ("__pycache__",)
        inner[:] = [name for name in inner if name not in left_out]
        found += [os.path.join(folder, name) for name in names if name.endswith(SUFFIXES)]
    if not found:
        return None
    found.sort()
    total = hashlib.sha256()
    for path in found:
        with open(path, "rb") as file:
            content = file.read()
        total.update(f"{os.path.relpath(path, top)}\0{len(content)}\0".encode(errors="surrogateescape"))
        total.update(content)
    return Sources(os.path.realpath(top), tuple(found), total.hexdigest())


def _from_archive(archive: str, top: str) -> Sources | None:
    inside = os.path.relpath(top, archive).replace(os.sep, "/") + "/"
    with zipfile.ZipFile(archive) as file:
        found = sorted(
            (entry.filename, entry.file_size, entry.CRC)
            for entry in file.infolist()
            if entry.filename.startswith(inside) and entry.filename.endswith(SUFFIXES)
            and entry.filename.removeprefix(inside).partition("/")[0] not in ABOVE
        )
    if not found:
        return None
    return Sources(os.path.realpath(archive), (archive,), hashlib.sha256(repr(found).encode()).hexdigest())


def platform_digest() -> str:
    """Of everything else that machine code depends on: compiler, interpreter, processor, settings."""
    settings = {name: getattr(config, name, None) for name in _SETTINGS}
    binding: Any = llvmlite.binding
    parts = (
        numba.__version__, llvmlite.__version__, np.__version__, platform.python_implementation(), sys.version_info[:3],
        getattr(sys, "abiflags", ""), sys.platform, platform.machine(), binding.get_host_cpu_name(),
        binding.get_host_cpu_features().flatten(), settings,
    )  # fmt: skip
    return hashlib.sha256(repr(parts).encode()).hexdigest()
