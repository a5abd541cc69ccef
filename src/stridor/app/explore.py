"""Verbs that ask what a change would do: sensitivities, counter-measures, damping maps, reduced models."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from ..errors import CaseError
from .arguments import CaseFile, Json, Out, Quiet, Set, folder, load_case, numbers, pair

if TYPE_CHECKING:
    from ..modal.parametric import ReducedModel
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
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """What a per cent of any number of the case does to each mode's growth and frequency."""
    from ..study.sensitivities import sensitivities as solve
    from ..view.sensitivity_plots import sensitivity_bars
    from ..view.sensitivity_tables import sensitivity_table

    loaded = load_case(case, set_, quiet=quiet)
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
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Changes ranked by the growth rate they take away per per cent, the best ones solved again."""
    from ..study.countermeasures import rank_countermeasures
    from ..view.sensitivity_plots import countermeasure_bars
    from ..view.sensitivity_tables import countermeasure_table

    loaded = load_case(case, set_, quiet=quiet)
    target: Any = "sum" if branch is None else branch
    result = rank_countermeasures(loaded, mu=mu, target=target, percent=percent, verify=verify)
    _show(result.to_json(), countermeasure_table(result), result.warnings, json=json)
    drawn = countermeasure_bars(result) if result.measures else None
    _draw(drawn, folder(case, out) / "countermeasures.png", quiet=quiet)


def damping_map(
    case: CaseFile,
    x: Annotated[str, typer.Option("--x", metavar="PATH", help="A damping of the case.")],
    y: Annotated[str, typer.Option("--y", metavar="PATH", help="Another one.")],
    x_range: Annotated[str, typer.Option("--x-range", metavar="LOW:HIGH", help="Its range.")],
    y_range: Annotated[str, typer.Option("--y-range", metavar="LOW:HIGH", help="The other's range.")],
    points: Annotated[int, typer.Option("--points", help="Points along each.")] = 9,
    set_: Set = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """The lowest onset over two dampings, and where more damping lowers it."""
    from ..study.damping_map import damping_map as solve
    from ..view.sensitivity_plots import damping_map as draw
    from .output import print_json, say

    loaded = load_case(case, set_, quiet=quiet)
    ranges = pair(x_range, "--x-range"), pair(y_range, "--y-range")
    result = solve(loaded, x, y, x_range=ranges[0], y_range=ranges[1], grid=(points, points))
    if json:
        print_json(result.to_json())
    for warning in result.warnings:
        say(f"warning: {warning}", quiet=quiet)
    _draw(draw(result), folder(case, out) / "damping_map.png", quiet=quiet)


def reduce(
    case: CaseFile,
    box: Annotated[
        list[str] | None,
        typer.Option(
            "--box",
            metavar="NAME=LOW:HIGH",
            help="A range of mu, contact_stiffness, a parameter or a number's path. Repeatable "
            "[default: the ranges of [parameters], else mu over modal.friction_range].",
        ),
    ] = None,
    along: Annotated[str | None, typer.Option("--onsets", metavar="NAME", help="Solve for onsets along it.")] = None,
    at: Annotated[
        list[str] | None,
        typer.Option("--at", metavar="NAME=VALUES", help="Values to solve at: 0.1,0.2 or start:stop:count."),
    ] = None,
    max_frequency: Annotated[float | None, typer.Option("--max-frequency", help="Highest frequency [Hz].")] = None,
    bound: Annotated[float, typer.Option("--bound", help="Relative error of eigenvalues.")] = 1e-8,
    set_: Set = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Reduce the model once over ranges of its numbers, then solve anywhere in them within milliseconds."""
    from ..modal.parametric import onsets_along
    from ..study.reduced import reduced_model
    from .output import print_json, say, table

    loaded = load_case(case, set_, quiet=quiet)
    ranges = {name: pair(text, f"--box {name}") for name, text in (_named(item, "--box") for item in box or ())}
    if not ranges:
        ranges = {name: p.range for name, p in loaded.parameters.items() if p.range is not None}
    if not ranges:
        ranges = {"mu": loaded.modal.friction_range}
    model = reduced_model(loaded, ranges, max_frequency_hz=max_frequency, bound=bound)
    say(f"{model.problem.size} freedoms reduced to {model.size} in {sum(model.seconds.values()):.2f} s", quiet=quiet)
    rows, document = _solved(model, at or [])
    onsets = () if along is None else onsets_along(model, along, _first(at or [], model, along))
    if out is not None:
        _write(out / "reduced.csv", rows)
    if json:
        found = [{"value": o.value, "frequency_hz": o.frequency_hz, "residual": o.residual} for o in onsets]
        seconds = dict(model.seconds)
        print_json({"size": model.size, "seconds": seconds, "modes": document, "onsets": found})
        return
    if rows:
        names = [p.name for p in model.problem.parameters]
        heads = [*names, "frequency [Hz]", "growth [1/s]", "error", "residual", ""]
        table("Modes of the reduced model", heads, rows)
    if along is not None:
        lines = [
            [f"{o.value:.9g}", f"{o.frequency_hz:.3f}", "stable" if o.stabilising else "unstable", f"{o.residual:.1e}"]
            for o in onsets
        ]
        heads = [along, "frequency [Hz]", "turns", "residual"]
        table(f"Onsets along {along}, confirmed in the full model", heads, lines)


def _named(text: str, option: str) -> tuple[str, str]:
    name, equals, rest = text.partition("=")
    if not equals or not name:
        raise CaseError(option, text, "NAME=… such as mu=0:0.6")
    return name.strip(), rest


def _values(at: list[str], model: ReducedModel) -> dict[str, list[float]]:
    given = {name: numbers(text, f"--at {name}") for name, text in (_named(item, "--at") for item in at)}
    model.problem.point({name: values[0] for name, values in given.items()})
    return {p.name: given.get(p.name, [p.value]) for p in model.problem.parameters}


def _first(at: list[str], model: ReducedModel, along: str) -> dict[str, float]:
    return {name: values[0] for name, values in _values(at, model).items() if name != along}


def _solved(model: ReducedModel, at: list[str]) -> tuple[list[list[str]], list[dict[str, Any]]]:
    """Rows of a table and of a document of the modes at all combinations of values."""
    if not at:
        return [], []
    values = _values(at, model)
    rows: list[list[str]] = []
    document: list[dict[str, Any]] = []
    for place in np.ndindex(*(len(v) for v in values.values())):
        point = {name: v[k] for (name, v), k in zip(values.items(), place, strict=True)}
        modes = model.modes(point)
        outside = "" if modes.inside else "outside the box"
        for k in range(len(modes.values)):
            words = "unstable" if modes.unstable[k] else ""
            rows.append(
                [
                    *(f"{v:.6g}" for v in point.values()),
                    f"{modes.frequency_hz[k]:.3f}",
                    f"{modes.growth_rate[k]:.4f}",
                    f"{modes.error[k]:.1e}",
                    f"{modes.residual[k]:.1e}",
                    ", ".join(w for w in (words, outside) if w),
                ]
            )
        document.append(
            {
                "point": point,
                "frequency_hz": modes.frequency_hz.tolist(),
                "growth_rate": modes.growth_rate.tolist(),
                "error": modes.error.tolist(),
                "residual": modes.residual.tolist(),
                "inside": modes.inside,
            }
        )
    return rows, document


def _write(path: Path, rows: list[list[str]]) -> None:
    from ..io.atomic import write_text

    write_text(path, "\n".join(",".join(row) for row in rows) + "\n")


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
