"""`stridor cycles`: the limit cycles behind an onset, one by one or followed over friction."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import AnalysisError, CaseError
from .arguments import INCOMPLETE, Call, verb
from .closing import Conclusion
from .option_table import MaxFrequency, Mu, Range, Source
from .values import numbers

if TYPE_CHECKING:
    from ..periodic import Cycles

SAVED_SECONDS = 5.0  # between two savings of what was found so far
SHOWN = 24  # rows on a screen


@verb()
def cycles(
    call: Call,
    mu: Mu = None,
    friction_range: Range = None,
    method: Annotated[
        str,
        typer.Option(
            "--method",
            metavar="NAME",
            help="shooting on the exact motion, for few contacts; harmonic for harmonic balance, also over surfaces; "
            "auto: shooting where it takes the case.",
        ),
    ] = "auto",
    harmonics: Annotated[
        int | None,
        typer.Option("--harmonics", min=1, help="Of harmonic balance [default: as many as its defect asks for]."),
    ] = None,
    push: Annotated[
        str | None,
        typer.Option(
            "--push",
            metavar="SPEEDS",
            help="By how much slip velocities are pushed off steady sliding [m/s], against the slip below 0: 0.1,-0.5 "
            "[default: one and three times the slip speed, and once against it].",
        ),
    ] = None,
    points: Annotated[int, typer.Option("--most", min=2, help="Most cycles of a branch, each way.")] = 120,
    seconds: Annotated[
        float | None,
        typer.Option(
            "--seconds",
            help="Processor time: by shooting for a motion that comes back to nowhere [default: 60], by harmonic "
            "balance for a branch [default: no limit] and a run [default: 60].",
        ),
    ] = None,
    runs: Annotated[
        int,
        typer.Option(
            "--runs",
            min=0,
            help="Most μ of a range at which runs in time look for cycles where no branch has a stable one; 0: none.",
        ),
    ] = 5,
    max_frequency: MaxFrequency = None,
    source: Source = None,
) -> None:
    """Limit cycles: what it swings in beyond the onset, how loud, from where to where. Ctrl-C keeps what was found."""
    option = "--range"
    if mu is not None and mu.count(":") == 1:
        if friction_range is not None:
            raise CaseError("--mu", mu, "friction coefficients, or the range without --range")
        mu, friction_range, option = None, mu, "--mu"
    values = None if mu is None else numbers(mu, "--mu")
    pushes = None if push is None else numbers(push, "--push", least=-float("inf"))
    work = call.workspace(source, max_frequency, friction_range, range_option=option)
    call.check_friction(values)

    from ..study.cycles import cycles as solve
    from ..view.cycle_parts import loudest
    from ..view.cycle_plots import cycle_branches, cycle_period
    from .output import stdout

    chosen: Any = method
    between = work.modal.friction_range if friction_range is not None else None
    result = solve(
        work, values, between=between, method=chosen, harmonics=harmonics, push=pushes, points=points,
        seconds=seconds, runs=runs, progress=_told(call),
        keep=_kept(call),
    )  # fmt: skip
    call.keep(result, "cycles.nc")
    files = [call.folder / "cycles.nc", call.tabulate(result, "cycles.csv")]
    if result.cycles or result.onsets:
        files.append(call.draw(cycle_branches(result), "cycles.png"))
    else:
        call.withdraw("cycles.png")
    if result.cycles:
        files.append(call.draw(cycle_period(loudest(result)), "cycle_period.png"))
    else:
        call.withdraw("cycle_period.png")
    call.warn(result.warnings)
    if call.json:
        call.document(result.to_json() | {"files": [str(f) for f in files]})
    else:
        _show(result)
        for line in (*result.missing, *result.notes, result.reach):
            stdout.print(line)
        call.conclude(_conclusion(result))
    if result.interrupted:
        raise typer.Exit(130)
    if result.missing:
        raise typer.Exit(INCOMPLETE)


def _told(call: Call) -> Callable[[int, str], None]:
    """Say what is done, each thing once."""
    last = [""]

    def progress(found: int, doing: str) -> None:
        if doing != last[0]:
            last[0] = doing
            call.say(f"{doing} ({found} cycles so far)")

    return progress


def _kept(call: Call) -> Callable[[Cycles], None]:
    """Save what was found so far, every few seconds."""
    saved = [time.monotonic()]

    def keep(result: Cycles) -> None:
        from ..io.datasets import save

        begun = time.monotonic()
        if begun - saved[0] < SAVED_SECONDS:
            return
        try:
            save(result, call.folder / "cycles.nc")
        except AnalysisError as error:  # the search goes on: what it ends with may find a place
            call.warn([str(error)])
        ended = time.monotonic()
        saved[0] = ended + 10.0 * (ended - begun)

    return keep


def _show(result: Cycles) -> None:
    """A row for each single cycle; for each branch its ends, its folds and where something changes."""
    from ..view.cycle_parts import branch_words, worth_a_row
    from .output import stdout
    from .tables import table

    heads = ["branch", "μ", "frequency [Hz]", "stable", "multiplier", "slip [m/s]", "N max [N]", "with"]
    rows: list[list[str]] = []
    for k in worth_a_row(result):
        c, branch = result.cycles[k], result.branch_of(k)
        stable = {True: "yes", False: "no", None: "undecided" if c.multiplied else "unknown"}[c.stable]
        force = float(c.force_range[:, 1].max())
        largest = f"{c.largest_multiplier:.5g}" if c.multiplied else ""
        cells = [f"{c.mu:.6g}", f"{c.frequency_hz:.6g}", stable, largest]
        rows.append(["" if branch is None else f"{branch + 1}", *cells, f"{c.slip_amplitude:.4g}", f"{force:.4g}",
                     ", ".join(c.kinds)])  # fmt: skip
    if rows:
        table("Limit cycles", heads, rows[:SHOWN], drop=["N max [N]", "multiplier", "slip [m/s]"], words=["with"],
              kept_in="cycles.csv")  # fmt: skip
    if len(rows) > SHOWN:
        stdout.print(f"  {len(rows) - SHOWN} more in cycles.csv")
    for line in branch_words(result):
        stdout.print(line)


def _conclusion(result: Cycles) -> Conclusion:
    if not result.cycles:
        return Conclusion(result.sentence, "simulate")
    from ..view.cycle_parts import loudest

    cycle = loudest(result)
    stepper = ("--stepper", "exact") if cycle.method == "shooting" else ()
    return Conclusion(result.sentence, "simulate", (*stepper, "--mu", f"{cycle.mu:.6g}"))


VERBS = {"cycles": cycles}
