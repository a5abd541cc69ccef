"""Verbs that ask what a change would do: sensitivities, counter-measures, damping maps, reduced models."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .arguments import CaseFile, Json, Out, Quiet, Set, Solver, folder, load_case
from .damping import damping_map
from .reduce import reduce

if TYPE_CHECKING:
    from ..view.tables import Table

Friction = Annotated[float | None, typer.Option("--mu", help="Friction coefficient [default: the case's own].")]
Branch = Annotated[int | None, typer.Option("--branch", help="One branch only [default: all unstable ones].")]


def register(app: typer.Typer) -> None:
    """Add the verbs to the program."""
    app.command()(sensitivities)
    app.command()(countermeasures)
    app.command(name="damping-map")(damping_map)
    app.command()(reduce)


def sensitivities(
    case: CaseFile,
    parameter: Annotated[
        list[str] | None,
        typer.Option("--parameter", metavar="PATH", help="A number of the case, or mu. Repeatable [default: mu]."),
    ] = None,
    mu: Friction = None,
    branch: Branch = None,
    set_: Set = None,
    solver: Solver = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """What a per cent of any number of the case does to each mode's growth and frequency."""
    from ..study.sensitivities import sensitivities as solve
    from ..view.sensitivity_plots import sensitivity_bars
    from ..view.sensitivity_tables import sensitivity_table

    loaded = load_case(case, set_, quiet=quiet, solver=solver)
    result = solve(loaded, parameter or ["mu"], mu=mu, modes="unstable" if branch is None else (branch,))
    drawn = sensitivity_bars(result) if len(result.branch) else None
    _show(result.to_json(), sensitivity_table(result), result.warnings, json=json)
    _draw(drawn, folder(case, out) / "sensitivities.png", quiet=quiet)


def countermeasures(
    case: CaseFile,
    mu: Friction = None,
    branch: Branch = None,
    percent: Annotated[float, typer.Option("--percent", help="Size of the change that is predicted.")] = 5.0,
    verify: Annotated[int, typer.Option("--verify", help="How many of the best are solved again.")] = 3,
    set_: Set = None,
    solver: Solver = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Changes ranked by the growth rate they take away per per cent, the best ones solved again."""
    from ..study.countermeasures import rank_countermeasures
    from ..view.sensitivity_plots import countermeasure_bars
    from ..view.sensitivity_tables import countermeasure_table

    loaded = load_case(case, set_, quiet=quiet, solver=solver)
    target: Any = "sum" if branch is None else branch
    result = rank_countermeasures(loaded, mu=mu, target=target, percent=percent, verify=verify)
    _show(result.to_json(), countermeasure_table(result), result.warnings, json=json)
    drawn = countermeasure_bars(result) if result.measures else None
    _draw(drawn, folder(case, out) / "countermeasures.png", quiet=quiet)


def _show(document: dict[str, Any], shown: Table, warnings: tuple[str, ...], *, json: bool) -> None:
    from .output import print_json, stdout, table

    if json:
        print_json(document)
        return
    if shown.rows:
        table(shown.title, shown.heads, [row.cells for row in shown.rows])
    for warning in warnings:
        stdout.print(warning, markup=False)


def _draw(figure: Any, path: Path, *, quiet: bool) -> None:
    from .output import say

    if figure is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=150)
        say(f"written: {path}", quiet=quiet)
