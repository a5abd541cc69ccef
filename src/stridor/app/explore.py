"""Verbs that ask what a change would do: sensitivities, counter-measures, damping maps, boundaries, reduced models."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import CaseError
from .arguments import Call, verb
from .boundary import boundary
from .damping import damping_map
from .option_table import Band, Branch, MaxFrequency, Mu, Parameter, Source, Undamped
from .reduce import reduce
from .values import band_of

if TYPE_CHECKING:
    from ..study.measures import Countermeasures
    from ..view.tables import Table

ONE_SCREEN = 7  # changes, of up to five lines each


@verb()
def sensitivities(
    call: Call,
    parameter: Parameter = None,
    mu: Mu = None,
    branch: Branch = None,
    band: Band = None,
    max_frequency: MaxFrequency = None,
    undamped: Undamped = False,
    source: Source = None,
) -> None:
    """What a per cent of any number of the case does to each mode's growth and frequency."""
    work = call.workspace(source, max_frequency, undamped=undamped)

    from ..study.sensitivities import sensitivities as solve
    from ..view.sensitivity_plots import sensitivity_bars
    from ..view.sensitivity_tables import sensitivity_table
    from .conclusions import of_sensitivities

    friction, chosen = call.one_friction(mu), band_of(band, work.modal.max_frequency_hz, branch)
    result = solve(work, parameter or ["mu"], mu=friction, modes=branch or "unstable", band_hz=chosen)
    call.keep(result, "sensitivities.nc")
    call.tabulate(result, "sensitivities.csv")
    if len(result.branch):
        call.draw(sensitivity_bars(result), "sensitivities.png")
    else:
        call.withdraw("sensitivities.png")
    _show(call, result, sensitivity_table(result), ["condition", "frequency per % [Hz]", "growth rate [1/s]"])
    if not call.json:
        call.conclude(of_sensitivities(result, mu))


@verb()
def countermeasures(
    call: Call,
    mu: Mu = None,
    branch: Branch = None,
    parameter: Parameter = None,
    percent: Annotated[
        float, typer.Option("--percent", metavar="PERCENT", help="Size of the change that is predicted.")
    ] = 5.0,
    verify: Annotated[
        int, typer.Option("--verify", metavar="N", min=0, help="How many of the best are solved again.")
    ] = 3,
    max_frequency: MaxFrequency = None,
    undamped: Undamped = False,
    source: Source = None,
) -> None:
    """Changes ranked by the growth rate they take away per per cent, the best ones solved again."""
    if branch and len(branch) > 1:
        given = ", ".join(map(str, branch))
        raise CaseError("--branch", given, "one mode; without --branch all unstable ones together")
    work = call.workspace(source, max_frequency, undamped=undamped)

    from ..study.countermeasures import rank_countermeasures
    from ..study.sensitivities import number_at
    from ..view.sensitivity_plots import countermeasure_bars
    from .conclusions import of_countermeasures

    target: Any = branch[0] if branch else "sum"
    friction = call.one_friction(mu)
    result = rank_countermeasures(work, mu=friction, target=target, numbers=parameter, percent=percent, verify=verify)
    call.keep(result, "countermeasures.nc")
    call.tabulate(result, "countermeasures.csv")
    if result.measures:
        call.draw(countermeasure_bars(result), "countermeasures.png")
    else:
        call.withdraw("countermeasures.png")
    show_countermeasures(call, result)
    if not call.json:
        case = work.case(call.verb)
        call.conclude(of_countermeasures(result, partial(number_at, case), mu))


def show_countermeasures(call: Call, result: Countermeasures) -> None:
    """The table of those solved again and of the best of the others, no more than fit on a screen."""
    from ..view.sensitivity_tables import countermeasure_table

    less = ["of all, per % [1/s]", "removed, predicted [1/s]"]
    _show(call, result, countermeasure_table(result), less, most=max(ONE_SCREEN, result.solved_again))


def _show(call: Call, result: Any, shown: Table, drop: list[str], most: int | None = None) -> None:
    from .output import stdout
    from .tables import table

    if call.json:
        call.document(result.to_json())
        return
    if shown.rows:
        words = [shown.heads[k] for k in shown.words]
        rows, name = shown.rows[:most], f"{shown.name}.csv"
        cells, bad = [row.cells for row in rows], [k for k, row in enumerate(rows) if row.kind == "bad"]
        table(shown.title, shown.heads, cells, drop=drop, words=words, marked=bad, kept_in=name)
        if left := len(shown.rows) - len(rows):
            stdout.print(f"  {left} more of {len(shown.rows)}, predicted to take less per % away, in {name}")
    for warning in result.warnings:
        stdout.print(warning)


VERBS = {
    "sensitivities": sensitivities,
    "countermeasures": countermeasures,
    "damping-map": damping_map,
    "boundary": boundary,
    "reduce": reduce,
}
