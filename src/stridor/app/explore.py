"""Verbs that ask what a change would do: sensitivities, counter-measures, damping maps, reduced models."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from .arguments import Call, verb
from .damping import damping_map
from .reduce import reduce

if TYPE_CHECKING:
    from ..view.tables import Table

Friction = Annotated[float | None, typer.Option("--mu", help="Friction coefficient [default: the case's own].")]
Branch = Annotated[int | None, typer.Option("--branch", help="One branch only [default: all unstable ones].")]


@verb()
def sensitivities(
    call: Call,
    parameter: Annotated[
        list[str] | None,
        typer.Option("--parameter", metavar="PATH", help="A number of the case, or mu. Repeatable [default: mu]."),
    ] = None,
    mu: Friction = None,
    branch: Branch = None,
) -> None:
    """What a per cent of any number of the case does to each mode's growth and frequency."""
    work = call.workspace()

    from ..study.sensitivities import sensitivities as solve
    from ..view.sensitivity_plots import sensitivity_bars
    from ..view.sensitivity_tables import sensitivity_table

    call.check_friction(mu)
    result = solve(work, parameter or ["mu"], mu=mu, modes="unstable" if branch is None else (branch,))
    call.tabulate(result, "sensitivities.csv")
    drawn = sensitivity_bars(result) if len(result.branch) else None
    _show(call, result, sensitivity_table(result))
    _draw(call, drawn, "sensitivities.png")


@verb()
def countermeasures(
    call: Call,
    mu: Friction = None,
    branch: Branch = None,
    percent: Annotated[float, typer.Option("--percent", help="Size of the change that is predicted.")] = 5.0,
    verify: Annotated[int, typer.Option("--verify", help="How many of the best are solved again.")] = 3,
) -> None:
    """Changes ranked by the growth rate they take away per per cent, the best ones solved again."""
    work = call.workspace()

    from ..study.countermeasures import rank_countermeasures
    from ..view.sensitivity_plots import countermeasure_bars
    from ..view.sensitivity_tables import countermeasure_table

    call.check_friction(mu)
    target: Any = "sum" if branch is None else branch
    result = rank_countermeasures(work, mu=mu, target=target, percent=percent, verify=verify)
    call.tabulate(result, "countermeasures.csv")
    _show(call, result, countermeasure_table(result))
    drawn = countermeasure_bars(result) if result.measures else None
    _draw(call, drawn, "countermeasures.png")


def _show(call: Call, result: Any, shown: Table) -> None:
    from .output import stdout, table

    if call.json:
        call.document(result.to_json())
        return
    if shown.rows:
        table(shown.title, shown.heads, [row.cells for row in shown.rows])
    for warning in result.warnings:
        stdout.print(warning, markup=False)


def _draw(call: Call, figure: Any, name: str) -> None:
    from ..io.atomic import replacing

    if figure is not None:
        path = call.folder / name
        with replacing(path) as temporary:
            figure.savefig(temporary, dpi=150)
        call.say(f"written: {path}")


VERBS = {
    "sensitivities": sensitivities,
    "countermeasures": countermeasures,
    "damping-map": damping_map,
    "reduce": reduce,
}
