"""Verbs of the temporal approach, and of both together."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import AnalysisError, CaseError
from .arguments import Call, numbers, verb


@verb()
def simulate(
    call: Call,
    mu: Annotated[
        float | None,
        typer.Option("--mu", min=0.0, help="Friction coefficient of every contact [default: the case's]."),
    ] = None,
    restart: Annotated[
        Path | None,
        typer.Option("--restart", metavar="FILE", help="Go on from the file of an earlier, unfinished run."),
    ] = None,
) -> None:
    """The temporal approach: explicit dynamics with stick, slip and separation. Ctrl-C keeps what was computed."""
    from ..io.datasets import load_trajectory, save
    from ..study import analyses
    from .output import progress_bar

    loaded = call.case()
    call.check_friction(mu)
    path = call.folder / "simulate.nc"
    if restart is not None and not restart.exists():
        raise CaseError("--restart", str(restart), "no such file")
    before = None if restart is None else load_trajectory(restart)
    try:
        with progress_bar("simulate", quiet=call.quiet) as progress:
            run = analyses.simulate(
                loaded,
                mu,
                progress=progress,
                checkpoint=lambda part: save(part, path) and None,
                restart=before,
            )
    except AnalysisError as error:
        part = getattr(error, "trajectory", None)
        if part is not None:
            save(part, path)
            call.say(f"written up to there: {path}")
        raise
    call.keep(run, "simulate.nc")
    summary = analyses.summarise(loaded, run)
    if run.interrupted:
        call.say(f"interrupted after {run.steps} of {run.planned_steps} steps; go on with --restart {path}")
    if call.json:
        call.document(summary.to_json())
    else:
        from .show import show_run

        show_run(summary.to_json())
    if run.interrupted:
        raise typer.Exit(130)


@verb()
def compare(
    call: Call,
    mu: Annotated[
        str | None,
        typer.Option("--mu", metavar="μ|a,b|start:stop:count", help="Friction coefficients [default: comparison.mu]."),
    ] = None,
    critical: Annotated[
        bool | None,
        typer.Option(
            "--critical/--no-critical",
            help="Bisect the temporal critical friction [default: comparison.critical].",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Agreement of both approaches, as a table and a verdict."""
    from ..study import analyses

    loaded = call.case()
    values = None if mu is None else numbers(mu, "--mu")
    call.check_friction(values)
    result = analyses.compare(loaded, values, critical=critical, progress=lambda text: call.say(text))
    call.keep(result, "compare.nc")
    if call.json:
        call.document(result.to_json())
        return
    from .show import show_agreement

    show_agreement(result.to_json())


@verb()
def run(call: Call) -> None:
    """Everything: modes, onsets, simulate, compare, and the report."""
    from .output import progress_bar, stdout
    from .pipeline import run as run_all

    loaded = call.case()
    with progress_bar("simulate", quiet=call.quiet) as progress:
        outcome = run_all(loaded, call.folder, progress=progress, log=lambda text: call.say(text))
    if call.json:
        call.document(outcome.to_json())
    else:
        stdout.print(outcome.verdict, markup=False)
        stdout.print(f"report: {outcome.report}", markup=False)
    if outcome.interrupted:
        raise typer.Exit(130)


VERBS = {"simulate": simulate, "compare": compare, "run": run}
