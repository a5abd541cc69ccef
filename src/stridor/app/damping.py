"""`stridor damping-map`: the lowest onset over two dampings as a table, a picture and a file."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..digits import measured
from .arguments import Call, verb
from .closing import Conclusion
from .option_table import MaxFrequency, Range, Source
from .two_numbers import Method, X, XRange, Y, YRange
from .values import range_of

if TYPE_CHECKING:
    from ..study.damping_map import DampingMap

WIDEST = 13  # columns that are still read on a screen


@verb()
def damping_map(
    call: Call,
    x: X,
    y: Y,
    x_range: XRange,
    y_range: YRange,
    points: Annotated[int, typer.Option("--points", metavar="N", help="Points along each.")] = 9,
    method: Method = "auto",
    friction_range: Range = None,
    max_frequency: MaxFrequency = None,
    source: Source = None,
) -> None:
    """The lowest onset over two dampings, or other numbers, and where more of one lowers it."""
    loaded = call.case(source=source, max_frequency=max_frequency, friction_range=friction_range)

    from ..study.damping_map import damping_map as solve
    from ..view.sensitivity_plots import damping_map as draw
    from .output import progress_bar, stdout

    ranges = range_of(x_range, "--x-range"), range_of(y_range, "--y-range")
    chosen: Any = method
    with progress_bar("damping map", quiet=call.quiet) as progress:
        result = solve(
            loaded, x, y, x_range=ranges[0], y_range=ranges[1], grid=(points, points), method=chosen, progress=progress
        )
    call.keep(result, "damping_map.nc")
    tables = call.folder / "damping_map.nc", call.tabulate(result, "damping_map.csv")
    files = [*tables, call.draw(draw(result), "damping_map.png")]
    call.warn(result.warnings)
    if call.json:
        call.document(result.to_json() | {"files": [str(f) for f in files]})
        return
    _show(result)
    for line in (*_words(result), *result.notes):
        stdout.print(line)
    call.conclude(_conclusion(result))


def _conclusion(result: DampingMap) -> Conclusion:
    """Between which values the onset lies; then the onsets where it is lowest."""
    import numpy as np

    if not np.isfinite(result.onset_mu).any():
        return Conclusion("no onset at any point of the map", "onsets")
    i, j = (int(k) for k in np.unravel_index(int(np.nanargmin(result.onset_mu)), result.onset_mu.shape))
    low, high = float(result.onset_mu[i, j]), float(np.nanmax(result.onset_mu))
    said = f"over both numbers the lowest onset goes from μ = {low:.6f} to {high:.6f}"
    point = (f"{result.x}={result.x_values[i]:.6g}", f"{result.y}={result.y_values[j]:.6g}")
    return Conclusion(said, "onsets", ("--set", point[0], "--set", point[1]))


def _show(result: DampingMap) -> None:
    """The onsets over the grid, x downwards, y across, with letters where more of one of them lowers the onset."""
    from .output import stdout
    from .tables import table

    nx, ny = result.onset_mu.shape
    if ny > WIDEST:
        return
    lowers = (("x", result.more_x_lowers), ("y", result.more_y_lowers))
    rows: list[list[str]] = []
    for i in range(nx):
        marks = ["".join(letter if where[i, j] else " " for letter, where in lowers) for j in range(ny)]
        cells = [measured(mu, 6) if math.isfinite(mu) else "–" for mu in result.onset_mu[i]]
        rows.append([f"{result.x_values[i]:.4g}", *(f"{c} {m}" for c, m in zip(cells, marks, strict=True))])
    heads = ["x \\ y", *(f"{y:.4g}   " for y in result.y_values)]
    title = f"Lowest onset μ\n  x: {result.x}\n  y: {result.y}"
    # Every second column, then three of four: what is left is a map still.
    thinned = [heads[2:-1:2], [head for k, head in enumerate(heads[1:-1]) if k % 4], heads[2:-1]]
    table(title, heads, rows, drop=thinned, kept_in="damping_map.csv")
    if any(where.any() for _, where in lowers):
        stdout.print("  x, y: more of it lowers the onset there")


def _words(result: DampingMap) -> list[str]:
    """The lowest and the highest onset, and that without damping."""
    import numpy as np

    low, high = result.mu_range
    known = np.isfinite(result.onset_mu)
    if not known.any():
        return [f"no onset for μ in {low:g} … {high:g} up to {result.max_frequency_hz:g} Hz"]
    lines: list[str] = []
    for word, pick in (("lowest", np.nanargmin), ("highest", np.nanargmax)):
        i, j = (int(k) for k in np.unravel_index(int(pick(result.onset_mu)), result.onset_mu.shape))
        lines.append(
            f"{word}: μ = {result.onset_mu[i, j]:.9g} at {measured(result.frequency_hz[i, j], 2)} Hz, "
            f"x = {result.x_values[i]:.4g}, y = {result.y_values[j]:.4g}"
        )
    if not known.all():
        lines.append(f"none up to μ = {high:g} at {int((~known).sum())} of {known.size} points")
    if result.undamped_mu is not None:
        below = int(result.below_undamped.sum())
        lines.append(f"without damping: μ = {result.undamped_mu:.9g}; {below} of {known.size} points lie below that")
    return lines
