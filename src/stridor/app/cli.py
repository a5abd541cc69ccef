"""The `stridor` command. Thin: parse, call the API, show. Heavy imports wait until a verb needs them."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import CaseError, StridorError
from . import explore, launch
from .arguments import CaseFile, Json, Out, Quiet, Set, Solver, Undamped, folder, keep, load_case, numbers, pair

app = typer.Typer(
    name="stridor",
    help="Will these sliding bodies squeal? Complex modes, solved onsets and explicit dynamics of one model, compared.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


@app.command()
def new(
    template: Annotated[str, typer.Argument(metavar="TEMPLATE", help="Name of a template, e.g. two-beams.")],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder to write into [default: here].")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
    set_: Set = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Write a commented case file, ready to edit."""
    from ..case import loads, template_text
    from ..io.atomic import write_text
    from .output import print_json, say

    text = template_text(template)
    if set_:
        # Changed values cannot keep the comments that speak of the old ones.
        text = loads(text, set_, source=template).text
    path = (out or Path()) / f"{template}.toml"
    if path.exists() and not force:
        raise CaseError("TEMPLATE", str(path), "a file that does not exist yet; remove it or add --force")
    write_text(path, text)
    if json:
        print_json({"case": str(path)})
    say(f"written: {path}\nnext: stridor check {path}, then stridor run {path}", quiet=quiet)


@app.command()
def check(
    case: CaseFile,
    set_: Set = None,
    solver: Solver = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Validate a case and print the model in words: bodies, contacts, time step against its limit."""
    from ..study.analyses import describe
    from .output import print_json, say, stdout

    loaded = load_case(case, set_, quiet=quiet, solver=solver)
    description = describe(loaded)
    for warning in description.warnings:
        if warning not in loaded.warnings:  # those are said already
            say(f"warning: {warning}", quiet=quiet)
    if out is not None:
        from ..io.atomic import write_text

        write_text(out / "check.txt", "\n".join(description.lines) + "\n")
    if json:
        print_json(description.to_json())
        return
    for line in description.lines:
        stdout.print(line, markup=False)


@app.command()
def matrices(
    case: Annotated[
        Path, typer.Argument(metavar="CASE|FILE", help="Case file (TOML), or one matrix file.", show_default=False)
    ],
    name: Annotated[str | None, typer.Option("--name", help="Which matrix of a file that holds several.")] = None,
    set_: Set = None,
    solver: Solver = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """What imported matrices are like: symmetry, definiteness, units, friction terms that got lost.

    A matrix file by itself tells its size, symmetry, definiteness and the rank of what is not symmetric.
    """
    from ..study.matrix_reports import matrix_reports
    from .output import print_json, stdout

    if case.suffix.lower() != ".toml":
        from ..matrices.read import read_matrix
        from ..matrices.report import single_lines

        lines = single_lines(read_matrix(case, name, where="FILE"))
        if json:
            print_json({str(case): {"text": lines}})
        else:
            stdout.print("\n".join([f"{case}:", *(f"  {line}" for line in lines)]), markup=False)
        return
    found = matrix_reports(load_case(case, set_, quiet=quiet, solver=solver))
    text = [line for name, report in found.items() for line in (f"{name}:", *(f"  {x}" for x in report.lines()))]
    if out is not None:
        from ..io.atomic import write_text

        write_text(out / "matrices.txt", "\n".join(text) + "\n")
    if json:
        print_json({name: {"text": r.lines(), "warnings": list(r.matrices.warnings)} for name, r in found.items()})
        return
    for line in text:
        stdout.print(line, markup=False)


@app.command()
def steady(
    case: CaseFile,
    mu: Annotated[
        float | None,
        typer.Option("--mu", min=0.0, help="Friction coefficient of every contact [default: the case's]."),
    ] = None,
    set_: Set = None,
    solver: Solver = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Steady sliding: which nodes touch, resultants of each contact, pressure as pictures and ParaView files."""
    from ..study.analyses import steady_sliding
    from .output import print_json, say
    from .pictures import steady_document, write_steady

    loaded = load_case(case, set_, quiet=quiet, solver=solver)
    found = steady_sliding(loaded, mu)
    files = write_steady(loaded, found, folder(case, out))
    for path in files:
        say(f"written: {path}", quiet=quiet)
    document = steady_document(found) | {"files": [str(f) for f in files]}
    if json:
        print_json(document)
        return
    from .show import show_steady

    show_steady(document)


@app.command()
def shapes(
    case: CaseFile,
    mu: Annotated[
        float | None,
        typer.Option("--mu", min=0.0, help="Friction coefficient of every contact [default: the case's]."),
    ] = None,
    branch: Annotated[
        list[int] | None,
        typer.Option("--branch", metavar="NUMBER", help="Mode by its number. Repeatable [default: the unstable ones]."),
    ] = None,
    gif: Annotated[bool, typer.Option("--gif", help="Also an animated GIF of each.")] = False,
    set_: Set = None,
    solver: Solver = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Shapes of modes: picture, animated page, ParaView file, and where friction feeds them."""
    from .output import print_json, say, table
    from .pictures import write_shapes

    loaded = load_case(case, set_, quiet=quiet, solver=solver)
    documents = write_shapes(loaded, folder(case, out), mu=mu, branches=branch or None, gif=gif)
    for document in documents:
        for path in document["files"]:
            say(f"written: {path}", quiet=quiet)
    if json:
        print_json({"modes": documents})
        return
    rows = [[str(d["branch"]), f"{d['frequency_hz']:.2f}", f"{d['growth_rate']:.3f}"] for d in documents]
    table("shapes", ["branch", "frequency [Hz]", "growth [1/s]"], rows)


@app.command()
def modes(
    case: CaseFile,
    mu: Annotated[
        str | None,
        typer.Option("--mu", metavar="μ|a,b|start:stop:count", help="Friction coefficients [default: the case's]."),
    ] = None,
    count: Annotated[
        int | None, typer.Option("--count", min=1, help="How many branches [default: modal.modes].")
    ] = None,
    undamped: Undamped = False,
    set_: Set = None,
    solver: Solver = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Complex modes at one or many friction coefficients, branches followed from μ = 0."""
    from ..study import analyses
    from .output import print_json, stdout, table

    loaded = load_case(case, set_, quiet=quiet, solver=solver)
    values = None if mu is None else numbers(mu, "--mu")
    result = analyses.modes(loaded, values, count=count, damped=False if undamped else None)
    keep(result, folder(case, out) / "modes.nc", quiet=quiet)
    if json:
        print_json(result.to_json())
        return
    for row, m in enumerate(result.to_json()["modes"]):
        rows = [
            [
                str(x["branch"]),
                f"{x['frequency_hz']:.2f}",
                f"{x['growth_rate']:.3f}",
                f"{100 * x['damping_ratio']:.4f}",
                "unstable" if x["unstable"] else "",
                f"{x['residual']:.1e}",
            ]
            for x in m
        ]
        if len(result.mu) <= 5 or row in (0, len(result.mu) - 1):
            table(
                f"μ = {result.mu[row]:g}",
                ["branch", "frequency [Hz]", "growth [1/s]", "damping [%]", "", "residual"],
                rows,
            )
    for m, sentence in zip(result.mu, result.completeness, strict=bool(result.completeness)):
        stdout.print(f"{f'μ = {m:g}: ' if len(result.mu) > 1 else ''}{sentence}", markup=False)
    if len(result.mu) > 5:
        from .output import say

        say(f"{len(result.mu)} friction coefficients; first and last shown, all in the file", quiet=quiet)


@app.command()
def onsets(
    case: CaseFile,
    friction_range: Annotated[
        str | None,
        typer.Option("--range", metavar="low:high", help="Range of μ [default: modal.friction_range]."),
    ] = None,
    max_frequency: Annotated[
        float | None,
        typer.Option(
            "--max-frequency",
            metavar="HZ",
            min=0.0,
            help="Highest frequency [default: modal.max_frequency_hz].",
        ),
    ] = None,
    undamped: Undamped = False,
    set_: Set = None,
    solver: Solver = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Every critical friction coefficient in range: solved, not bracketed."""
    from ..study import analyses
    from .output import print_json, stdout, table

    loaded = load_case(case, set_, quiet=quiet, solver=solver)
    chosen = None if friction_range is None else pair(friction_range, "--range")
    result = analyses.onsets(loaded, chosen, max_frequency_hz=max_frequency, damped=False if undamped else None)
    keep(result, folder(case, out) / "onsets.nc", quiet=quiet)
    if json:
        print_json(result.to_json())
        return
    if not result.onsets:
        low, high = result.friction_range
        stdout.print(f"no onset for μ in {low:g} … {high:g} up to {result.max_frequency_hz:g} Hz")
        if result.completeness:
            stdout.print(result.completeness, markup=False)
        return
    rows = [
        [
            f"{o.mu:.10f}",
            f"{o.frequency_hz:.3f}",
            o.kind,
            f"{o.branches[0]} + {o.branches[1]}" if o.kind == "flutter" else str(o.branches[0]),
            "ends" if o.stabilising else "begins",
            "" if o.square_root_coefficient is None else f"{o.square_root_coefficient:.1f}",
            "" if o.growth_slope is None else f"{o.growth_slope:.4g}",
            f"{o.residual:.1e}",
        ]
        for o in result.onsets
    ]
    columns = [
        "critical μ",
        "frequency [Hz]",
        "kind",
        "modes",
        "growth",
        "κ [1/s]",
        "slope [1/s]",
        "residual",
    ]
    table("onsets, " + ("damped" if result.damped else "undamped"), columns, rows)
    stdout.print("κ: growth opens as κ √(μ − μ_c) without damping; slope: d growth/dμ at a damped onset")
    if result.completeness:
        stdout.print(result.completeness, markup=False)


@app.command()
def simulate(
    case: CaseFile,
    mu: Annotated[
        float | None,
        typer.Option("--mu", min=0.0, help="Friction coefficient of every contact [default: the case's]."),
    ] = None,
    restart: Annotated[
        Path | None,
        typer.Option("--restart", metavar="FILE", help="Go on from the file of an earlier, unfinished run."),
    ] = None,
    set_: Set = None,
    solver: Solver = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """The temporal approach: explicit dynamics with stick, slip and separation. Ctrl-C keeps what was computed."""
    from ..errors import AnalysisError
    from ..io.datasets import load_trajectory, save
    from ..study import analyses
    from .output import print_json, progress_bar, say

    loaded = load_case(case, set_, quiet=quiet, solver=solver)
    path = folder(case, out) / "simulate.nc"
    if restart is not None and not restart.exists():
        raise CaseError("--restart", str(restart), "no such file")
    before = None if restart is None else load_trajectory(restart)
    try:
        with progress_bar("simulate", quiet=quiet) as progress:
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
            say(f"written up to there: {path}", quiet=quiet)
        raise
    keep(run, path, quiet=quiet)
    summary = analyses.summarise(loaded, run)
    if run.interrupted:
        say(
            f"interrupted after {run.steps} of {run.planned_steps} steps; go on with --restart {path}",
            quiet=quiet,
        )
    if json:
        print_json(summary.to_json())
    else:
        from .show import show_run

        show_run(summary.to_json())
    if run.interrupted:
        raise typer.Exit(130)


@app.command()
def compare(
    case: CaseFile,
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
    set_: Set = None,
    solver: Solver = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Agreement of both approaches, as a table and a verdict."""
    from ..study import analyses
    from .output import print_json, say

    loaded = load_case(case, set_, quiet=quiet, solver=solver)
    values = None if mu is None else numbers(mu, "--mu")
    result = analyses.compare(loaded, values, critical=critical, progress=lambda text: say(text, quiet=quiet))
    keep(result, folder(case, out) / "compare.nc", quiet=quiet)
    if json:
        print_json(result.to_json())
        return
    from .show import show_agreement

    show_agreement(result.to_json())


@app.command()
def run(
    case: CaseFile,
    set_: Set = None,
    solver: Solver = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Everything: modes, onsets, simulate, compare, and the report."""
    from .output import print_json, progress_bar, say, stdout
    from .pipeline import run as run_all

    loaded = load_case(case, set_, quiet=quiet, solver=solver)
    with progress_bar("simulate", quiet=quiet) as progress:
        outcome = run_all(loaded, folder(case, out), progress=progress, log=lambda text: say(text, quiet=quiet))
    if json:
        print_json(outcome.to_json())
    else:
        stdout.print(outcome.verdict, markup=False)
        stdout.print(f"report: {outcome.report}", markup=False)
    if outcome.interrupted:
        raise typer.Exit(130)


explore.register(app)


@app.callback(invoke_without_command=True)
def _top(
    version: Annotated[bool, typer.Option("--version", help="Print the version and leave.")] = False,
) -> None:
    if version:
        from .. import __version__

        print(f"stridor {__version__}")
        raise typer.Exit


def main() -> None:
    """Entry point: errors as plain lines, no traceback. Exit code 2: bad input, 1: no answer, 130: Ctrl-C."""

    def program() -> None:
        launch.meet(sys.argv[1:])
        app(standalone_mode=True)

    sys.exit(_guarded(program))


def _guarded(call: Callable[[], Any]) -> int:
    try:
        call()
    except StridorError as error:
        print(f"stridor: {error}" if "\n" not in str(error) else f"stridor:\n{error}", file=sys.stderr)
        return 2 if isinstance(error, CaseError) else 1
    except KeyboardInterrupt:
        print("stridor: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        return 0
    except (OverflowError, MemoryError) as error:
        print(f"stridor: a number of the case is out of range for this computation ({error})", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    main()
