"""`mpiexec -n 4 stridor …`: one program and not four. Costs a look at the environment where there is no mpiexec."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from ..errors import CaseError
from ..reading import irregular

# What launchers tell each process: its number, and of how many. Slurm starts programs that know nothing of each other,
# too; its processes are one program only where the solver that needs them is asked for.
LARGEST = 2**24  # bytes of a case file
MPIEXEC = (("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"), ("PMI_RANK", "PMI_SIZE"))
SLURM = ("SLURM_PROCID", "SLURM_STEP_NUM_TASKS")

_WORD = re.compile(r"""(^|=\s*)["']?slepc["']?$""")
_CASE = re.compile(r"""solver\s*=\s*["']slepc["']""")


def meet(words: Sequence[str], environment: Mapping[str, str] = os.environ) -> None:
    """Return in the first process of an MPI run, and in the only one; the others work for it, end with it (SystemExit).

    words: the command line. Processes with different ones, or in different folders, go on side by side, as all do where
    PETSc is not installed and nobody asks for it. Raises CaseError where "slepc" is asked for and the processes
    cannot meet.
    """
    process = _process(environment)
    if process is None:
        return
    number, count, by_slurm = process
    asked = asks(words, environment)
    if by_slurm and not asked:
        return
    from ..direct.backends import installed

    if not installed("slepc"):
        if asked and number > 0:
            raise SystemExit(0)  # the first one says so
        return
    try:
        from ..direct.slepc_backend import join

        team = join((tuple(words), str(Path.cwd())))
    except (ImportError, OSError, CaseError):
        if asked and number > 0:
            raise SystemExit(0) from None
        return  # said by the solver, if it comes to that
    if asked and team.ranks.size == 1 < count and not team.apart:
        if number > 0:
            raise SystemExit(0)
        raise CaseError(
            "solver", "slepc", f"{count} processes were started, but each one's MPI library sees itself alone; start "
            "them with the mpiexec of the MPI library that PETSc and mpi4py use",
        )  # fmt: skip


def asks(words: Sequence[str], environment: Mapping[str, str]) -> bool:
    """Is "slepc" named by the command line, the environment variable or the case file?"""
    if environment.get("STRIDOR_SOLVER") == "slepc" or any(_WORD.search(word) for word in words):
        return True
    return any(_CASE.search(_text(word)) for word in words if word.endswith(".toml"))


def _text(path: str) -> str:
    try:
        if irregular(Path(path), LARGEST):
            return ""
        return Path(path).read_text(encoding="utf-8", errors="replace")
    except (OSError, ValueError):
        return ""  # the first process says what is wrong with it


def _process(environment: Mapping[str, str]) -> tuple[int, int, bool] | None:
    """Number of this process, of how many, and whether it is Slurm that started it; None for a program on its own."""
    slurm = _pair(environment, SLURM)
    for names in (*MPIEXEC, SLURM):
        process = _pair(environment, names)
        if process is not None:
            return (*process, process == slurm and names != MPIEXEC[0]) if process[1] > 1 else None
    return None


def _pair(environment: Mapping[str, str], names: tuple[str, str]) -> tuple[int, int] | None:
    try:
        return int(environment[names[0]]), int(environment[names[1]])
    except (KeyError, ValueError):
        return None
