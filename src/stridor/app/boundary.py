"""`stridor boundary`: the curves over two numbers on which modes begin to grow, as a table, a picture and a file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..notebook import counted
from .arguments import INCOMPLETE, Call, verb
from .closing import Conclusion
from .option_table import MaxFrequency
from .two_numbers import Method, X, XRange, Y, YRange
from .values import range_of

if TYPE_CHECKING:
    from ..case import Case
    from ..study.boundary_result import Boundary, BoundaryCurve


@verb()
def boundary(
    call: Call,
    x: X,
    y: Y,
    x_range: XRange,
    y_range: YRange,
    method: Method = "auto",
    lines: Annotated[
        int, typer.Option("--lines", metavar="N", help="Values of each number at which onsets are sought.")
    ] = 5,
    tolerance: Annotated[
        float,
        typer.Option(
            "--tolerance", metavar="SHARE", help="How far curves may be off between their points, of the ranges."
        ),
    ] = 1e-3,
    max_frequency: MaxFrequency = None,
) -> None:
    """Where modes begin to grow over two numbers, one of which may be mu, traced without a grid."""
    loaded = call.workspace(max_frequency=max_frequency)

    from ..study.boundary import stability_boundary as solve
    from ..view.boundary_plots import stability_boundary as draw
    from .output import progress_bar, stdout

    ranges = range_of(x_range, "--x-range"), range_of(y_range, "--y-range")
    chosen: Any = method
    with progress_bar("boundary", quiet=call.quiet) as progress:
        result = solve(
            loaded, x, y, x_range=ranges[0], y_range=ranges[1], method=chosen, lines=lines, tolerance=tolerance,
            progress=progress,
        )  # fmt: skip
    call.keep(result, "boundary.nc")
    tables = call.folder / "boundary.nc", call.tabulate(result, "boundary.csv")
    files = [*tables, call.draw(draw(result), "boundary.png")]
    call.warn(result.warnings)
    if call.json:
        call.document(result.to_json() | {"files": [str(f) for f in files]})
    else:
        _show(result)
        for line in (result.sentence, *result.notes):
            stdout.print(line)
        call.conclude(_conclusion(result, loaded.case(call.verb)))
    if not result.agree:
        raise typer.Exit(INCOMPLETE)


def _conclusion(result: Boundary, case: Case) -> Conclusion:
    """How many curves bound what nothing grows in; then the modes at the lowest point of these."""
    import numpy as np

    outer = [curve for curve in result.curves if curve.outer.any()]
    if not result.curves:
        counts = {c.unstable_modes for c in result.counted}
        many = counts.pop() if len(counts) == 1 else None
        grow = "" if many is None else f"; {counted(many, 'mode')} {'grows' if many == 1 else 'grow'}"
        growing = f"{grow} wherever that was counted" if grow else ""
        growing += "" if result.agree else ", but see above"
        return Conclusion(f"no curve was found in the rectangle up to {result.max_frequency_hz:g} Hz{growing}", "modes")
    if not outer:
        return Conclusion(f"{len(result.curves)} curves; something grows on both sides of each of them", "modes")
    lowest = [np.where(curve.outer, curve.y, np.inf) for curve in outer]
    k = int(np.argmin([float(y.min()) for y in lowest]))
    j = int(np.argmin(lowest[k]))
    at = f"{result.x} = {outer[k].x[j]:.6g}, {result.y} = {outer[k].y[j]:.6g} ({outer[k].frequency_hz[j]:.6g} Hz)"
    count = f"{len(outer)} of {len(result.curves)} curves" if len(result.curves) > 1 else "one curve"
    said = f"{count} {'bound' if len(outer) > 1 else 'bounds'} where nothing grows, down to {at}"
    options: list[str] = []
    for path, value in ((result.x, outer[k].x[j]), (result.y, outer[k].y[j])):
        if path == "contact_stiffness" and path not in case.parameters:
            return Conclusion(said)  # no verb but `reduce` takes it
        own = f"parameters.{path}.value" if path in case.parameters else path
        options += ["--mu", f"{value:.6g}"] if own == "mu" else ["--set", f"{own}={value:.6g}"]
    return Conclusion(said, "modes", tuple(options))


def _show(result: Boundary) -> None:
    """A row for each curve."""
    from .tables import table

    if not result.curves:
        return
    heads = ["curve", "kind", "frequency [Hz]", "x", "y", "from", "to", "outer", "points"]
    rows = [_row(k, curve) for k, curve in enumerate(result.curves, start=1)]
    title = f"Where modes begin to grow\n  x: {result.x}\n  y: {result.y}"
    table(title, heads, rows, drop=["points", "outer", "kind"], kept_in="boundary.csv")


def _row(number: int, curve: BoundaryCurve) -> list[str]:
    ends = ("closed", "") if curve.closed else curve.ends
    share = f"{100 * float(curve.outer.mean()):.0f} %"
    spans = [f"{v.min():.5g} … {v.max():.5g}" for v in (curve.frequency_hz, curve.x, curve.y)]
    return [f"{number}", curve.kind, *spans, *ends, share, f"{len(curve.x)}"]
