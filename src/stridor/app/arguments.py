"""What the verbs have in common: their arguments, and how a case is read."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import CaseError

if TYPE_CHECKING:
    from ..case import Case
    from ..io.datasets import Result

CaseFile = Annotated[Path, typer.Argument(metavar="CASE", help="Case file (TOML).", show_default=False)]
Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a value of the case, e.g. contacts.A.friction.coefficient=0.3. Repeatable.",
    ),
]
Out = Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder for results [default: CASE.out].")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document on stdout and nothing else there.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="No log and no progress on stderr.")]
Solver = Annotated[
    str | None,
    typer.Option(
        "--solver",
        metavar="NAME",
        help="Sparse direct solver: mumps, pardiso, superlu; slepc for all processes of mpiexec [default: the case's].",
    ),
]
Undamped = Annotated[bool, typer.Option("--undamped", help="Leave structural damping out.")]


def load_case(path: Path, overrides: list[str] | None, *, quiet: bool, solver: str | None = None) -> Case:
    """The case in a file with overrides, its warnings printed. Raises CaseError.

    solver: the one for everything that the program factorises, whatever case and environment say.
    """
    from ..case import load

    case = load(path, [*(overrides or ()), *([] if solver is None else [f'modal.solver="{solver}"'])])
    if solver is not None and solver != "auto":
        os.environ["STRIDOR_SOLVER"] = solver
    from .output import say

    for warning in case.warnings:
        say(f"warning: {warning}", quiet=quiet)
    return case


def folder(path: Path, out: Path | None) -> Path:
    """Where results go: the folder asked for, else CASE.out beside the case."""
    return out if out is not None else path.with_suffix(".out")


def keep(result: Result, path: Path, *, quiet: bool) -> None:
    """Save a result as a dataset, and say so."""
    from ..io.datasets import save
    from .output import say

    save(result, path)
    say(f"written: {path}", quiet=quiet)


def numbers(text: str, name: str) -> list[float]:
    """Numbers from "0.1", "0.1,0.2" or "start:stop:count". Raises CaseError."""
    accepted = "a number, numbers with commas, or start:stop:count, each number ≥ 0"
    try:
        if ":" in text:
            start, stop, count = text.split(":")
            amount = int(count)
            if amount < 1 or amount > 1_000_000:
                raise ValueError
            low, high = float(start), float(stop)
            step = (high - low) / max(amount - 1, 1)
            values = [low + k * step for k in range(amount)]
        else:
            values = [float(part) for part in text.split(",")]
    except ValueError:
        raise CaseError(name, text, accepted) from None
    if not all(0 <= v < float("inf") for v in values):
        raise CaseError(name, text, accepted)
    return values


def pair(text: str, name: str) -> tuple[float, float]:
    """Two numbers from "low:high". Raises CaseError."""
    parts = text.split(":")
    try:
        low, high = (float(p) for p in parts)
    except ValueError:
        raise CaseError(name, text, "two numbers, low:high") from None
    return low, high
