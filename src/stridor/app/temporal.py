"""Verbs of the temporal approach, and of both together."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import AnalysisError, CaseError
from ..interrupts import held
from .arguments import Call, verb
from .option_table import MaxFrequency, Mu, Range, Source
from .values import numbers

if TYPE_CHECKING:
    from ..io.kept_parts import KeptParts
    from ..study.workspace import Workspace
    from ..temporal.trajectory import Trajectory
    from .pipeline import Outcome

Only = Annotated[
    list[str] | None,
    typer.Option(
        "--only",
        metavar="PART,…",
        help="Parts that alone are computed: growth (small perturbations), run (the full run too), critical; where "
        "all is computed also modes, onsets, sensitivities, countermeasures, simulate, compare. Repeatable.",
    ),
]
Skip = Annotated[
    list[str] | None,
    typer.Option("--skip", metavar="PART,…", help="Parts that are not computed. Repeatable."),
]
Fresh = Annotated[
    bool, typer.Option("--fresh", help="Compute anew what the folder holds from earlier calls on the same case.")
]


@verb()
def simulate(
    call: Call,
    mu: Mu = None,
    restart: Annotated[
        Path | None,
        typer.Option("--restart", metavar="FILE", help="Go on from the file of an earlier run of the same model."),
    ] = None,
    changed: Annotated[
        bool,
        typer.Option("--changed", help="With --restart: go on with another model, and record what was changed."),
    ] = False,
    stepper: Annotated[
        str | None,
        typer.Option(
            "--stepper",
            metavar="NAME",
            help="explicit: by steps below the stability limit; exact: from one change of contact to the next; "
            "implicit: by parts of the shortest period of interest; auto: by size [default: temporal.stepper].",
        ),
    ] = None,
    copies: Annotated[
        int,
        typer.Option(
            "--copies", metavar="N", min=0, help="Run this many copies, perturbed by 1e-12: how far results scatter."
        ),
    ] = 0,
) -> None:
    """The temporal approach: explicit dynamics with stick, slip and separation. Ctrl-C keeps what was computed."""
    work = call.workspace(stepper=stepper)

    from ..io.datasets import load_trajectory, save
    from ..study import analyses
    from ..study.touching import decided_by_meshes
    from .output import progress_bar

    friction = call.one_friction(mu)
    path = call.folder / "simulate.nc"
    if copies and restart is not None:
        raise CaseError("--copies", copies, "a run from its start; not with --restart")
    if restart is not None and not restart.exists():
        raise CaseError("--restart", str(restart), "no such file")
    if changed and restart is None:
        raise CaseError("--changed", None, "goes with --restart FILE")
    before = None if restart is None else load_trajectory(restart)
    if restart is not None and before is not None and path.exists() and path.samefile(restart):
        _check_records(work, before, path)

    call.warn(decided_by_meshes(work.system(friction), friction))
    call.warn(() if friction is None else work.one_for_all)
    call.warn(work.system(friction).tie_words)

    def checkpoint(part: Trajectory) -> None:
        try:
            save(part, path)
        except AnalysisError as error:  # the run goes on: what it ends with may find a place
            call.warn([str(error)])

    with held():
        # What has been computed is in its file before another Ctrl-C counts.
        try:
            with progress_bar("simulate", quiet=call.quiet) as progress:
                run = analyses.simulate(
                    work, friction, progress=progress, checkpoint=checkpoint, restart=before, changed=changed
                )
        except AnalysisError as error:
            part = error.trajectory
            if part is not None:
                call.keep(part, "simulate.nc")
            raise
        if run.steps == (0 if before is None else before.steps) and run.interrupted:
            raise KeyboardInterrupt  # nothing that is worth an earlier file
        call.keep(run, "simulate.nc")
    summary = analyses.summarise(work, run)
    if run.interrupted:
        call.say(f"interrupted after {run.steps} of {run.planned_steps} steps; go on with --restart {path}")
    document = summary.to_json()
    if copies and not run.interrupted:
        from ..study.copies import perturbed_copies

        with progress_bar("copies", quiet=call.quiet) as progress:
            document["copies"] = perturbed_copies(work, run, friction, count=copies, progress=progress).to_json()
    if call.json:
        call.document(document)
    else:
        from .closing import Conclusion
        from .conclusions import of_run
        from .show import show_run

        show_run(document)
        done = f"interrupted after {run.steps} of {run.planned_steps} steps"
        told = Conclusion(done, "simulate", ("--restart", str(path)))
        call.conclude(told if run.interrupted else of_run(document, slides=work.slides or not work.has_contacts))
    if run.interrupted:
        raise typer.Exit(130)


def _check_records(work: Workspace, before: Trajectory, path: Path) -> None:
    """Refuse to put a part of a run, which cannot be joined with what was before, over the file of that."""
    from ..study import analyses
    from ..study.settings import settings_of

    if not analyses.same_records(settings_of(work), before):
        raise CaseError(
            "--restart",
            str(path),
            f"records every {before.record_every} steps of {', '.join(before.watch_names) or 'no points'}, as before, "
            "or another folder (--out) for what comes now: other records cannot be joined to those in this file",
        )


@verb()
def compare(
    call: Call,
    mu: Mu = None,
    critical: Annotated[
        bool | None,
        typer.Option(
            "--critical/--no-critical",
            help="Solve the critical friction and bisect it in time [default: comparison.critical].",
            show_default=False,
        ),
    ] = None,
    cycles: Annotated[
        bool, typer.Option("--cycles", help="Limit cycles as well: onset, growth, cycle and run side by side.")
    ] = False,
    only: Only = None,
    friction_range: Range = None,
    max_frequency: MaxFrequency = None,
    source: Source = None,
) -> None:
    """Agreement of both approaches, as a table and a verdict.

    Each part is kept as soon as it is there; a second call on the same case takes what is finished. Ctrl-C prints it.
    """
    work = call.workspace(source, max_frequency, friction_range)

    from ..study.comparison import compare as solve

    values = None if mu is None else numbers(mu, "--mu")
    only = None if only is None else [name.strip() for text in only for name in text.split(",")]
    call.check_friction(values)
    if critical is not None and only and critical != ("critical" in only):
        word = "--critical" if critical else "--no-critical"
        raise CaseError("--only", ", ".join(only), f"says otherwise than {word}; give one of them")
    result = solve(
        work,
        values,
        cycles=cycles,
        critical=critical,
        progress=call.say,
        only=only,
        kept=_kept(call, work),
        finished=lambda c: call.say(c.verdict),
    )
    if result.comparisons or result.critical_mu_modal is not None:
        call.keep(result, "compare.nc")
    if result.answers:
        call.tabulate(result, "compare.csv")
    if result.interrupted:
        call.say("interrupted; what is finished is kept, and the same call goes on from there")
    if call.json:
        call.document(result.to_json())
    else:
        from .show import show_agreement

        call.warn_of_idle()
        show_agreement(result.to_json())
        if not result.interrupted:
            call.suggest("run")
    if result.interrupted:
        raise typer.Exit(130)


def _kept(call: Call, work: Workspace, *, fresh: bool = False) -> KeptParts:
    """Parts of the comparison that earlier calls into the same folder have finished."""
    from ..io.kept_parts import NAME, KeptParts

    kept = KeptParts(call.folder / NAME, work.key, fresh=fresh)
    if kept.others:
        call.say(f"{kept.path} also holds parts of other cases or of another version; they are left alone")
    if kept.damaged:
        call.say(f"{kept.path}: {kept.damaged} damaged lines are passed over")
    return kept


@verb(parts=("figures", "parts"))
def run(
    call: Call,
    only: Only = None,
    skip: Skip = None,
    fresh: Fresh = False,
    friction_range: Range = None,
    max_frequency: MaxFrequency = None,
    source: Source = None,
) -> None:
    """Everything: modes, onsets, simulate, compare, and the report. A second call takes what is there of the same case
    and goes on where the first was cut."""
    work = call.workspace(source, max_frequency, friction_range)

    from .output import progress_bar
    from .pipeline import run as run_all

    with progress_bar("simulate", quiet=call.quiet) as progress:
        kept = _kept(call, work, fresh=fresh)
        outcome = run_all(
            work, call.folder, progress=progress, log=call.say, only=only, skip=skip, fresh=fresh, kept=kept
        )
    _told(call, outcome, work)


@verb(parts=("figures", "parts"))
def report(
    call: Call,
    mu: Mu = None,
    skip: Skip = None,
    fresh: Fresh = False,
    friction_range: Range = None,
    max_frequency: MaxFrequency = None,
    source: Source = None,
) -> None:
    """The page without any run in time: modes, root locus, onsets, shapes, sensitivities, counter-measures. Takes
    models that no time loop takes, too."""
    work = call.workspace(source, max_frequency, friction_range)

    from .pipeline import report as write

    kept, friction = _kept(call, work, fresh=fresh), call.one_friction(mu)
    _told(call, write(work, call.folder, mu=friction, log=call.say, skip=skip, fresh=fresh, kept=kept), work, mu)


def _told(call: Call, outcome: Outcome, work: Workspace, mu: str | None = None) -> None:
    """The verdict and where the page is, or the document of all of it; then what makes sense next at that friction
    coefficient (mu: as it was given): the growing modes drawn, or what quietens them where they have no shape."""
    from .output import stdout

    if call.json:
        call.document(outcome.to_json())
    else:
        for note in outcome.everything.notes:
            if not note.startswith("Taken"):  # which the log has told
                call.say(f"note: {note}")
        if outcome.everything.unsaturated is not None:
            call.say("note: the full run is too short, its vibration still grows; the report says how to go on")
        call.warn_of_idle()
        if outcome.report is not None:
            stdout.print(f"report: {outcome.report}")
        stdout.print(outcome.verdict)
        if not outcome.interrupted:
            own = ("--mu", mu) if mu is not None else ()
            modes = outcome.everything.own
            growing = modes is None or bool((modes.unstable & modes.in_band).any())
            call.suggest("shapes" if work.has_shapes else "countermeasures" if growing else "modes", *own)
    if outcome.interrupted:
        raise typer.Exit(130)


VERBS = {"simulate": simulate, "compare": compare, "run": run, "report": report}
