"""`stridor ensemble`: runs in time of one case over friction, loads and speeds, as a table, a map and files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..digits import measured, readable
from ..errors import CaseError
from ..interrupts import INTERRUPTED, heard
from ..notebook import counted
from .arguments import INCOMPLETE, Call, verb
from .closing import Conclusion
from .option_table import Mu, Observable
from .values import numbers, one_of

if TYPE_CHECKING:
    from ..study.ensemble_result import Ensemble

MOST_ROWS = 40  # of the table on the screen


@verb()
def ensemble(
    call: Call,
    mu: Mu = None,
    load: Annotated[
        str | None, typer.Option("--load", metavar="FACTORS", help="Factors on all loads: a,b or start:stop:count.")
    ] = None,
    speed: Annotated[
        str | None, typer.Option("--speed", metavar="FACTORS", help="Factors on all prescribed velocities.")
    ] = None,
    perturbation: Annotated[
        str | None,
        typer.Option("--perturbation", metavar="SPEEDS", help="Perturbations [m/s] of the slip speed at the start."),
    ] = None,
    sweep: Annotated[
        str | None,
        typer.Option(
            "--sweep", metavar="up|down|both", help="Each run begins where the one before ended, with rising values."
        ),
    ] = None,
    swept: Annotated[
        str | None,
        typer.Option("--swept", metavar="mu|load|speed", help="What rises or falls in a sweep [default: mu]."),
    ] = None,
    observable: Observable = None,
    window: Annotated[
        float, typer.Option("--window", metavar="SHARE", help="The end of the last phase that is looked at.")
    ] = 0.5,
    cores: Annotated[int | None, typer.Option("--cores", metavar="N", min=1, help="Threads [default: all]")] = None,
    device: Annotated[
        str,
        typer.Option(
            "--device", metavar="auto|cpu|gpu", help="Where: auto takes a GPU, if there is one, for 64 runs or more."
        ),
    ] = "auto",
) -> None:
    """Many runs in time side by side: where it vibrates, how strongly and at which frequency."""
    values = {
        name: None if text is None else numbers(text, f"--{name}")
        for name, text in (("mu", mu), ("load", load), ("speed", speed), ("perturbation", perturbation))
    }
    if sweep is not None:
        one_of(sweep, "--sweep", ("up", "down", "both"))
    if swept is not None:
        one_of(swept, "--swept", ("mu", "load", "speed"))
        if sweep is None:
            raise CaseError("--swept", swept, "goes with --sweep up|down|both")
    one_of(device, "--device", ("auto", "cpu", "gpu"))
    work = call.workspace()
    call.check_friction(values["mu"])

    from ..study.ensemble import ensemble as solve
    from ..view.ensemble_plots import ensemble_map
    from .output import progress_bar

    given: dict[str, Any] = {**values, "sweep": sweep, "swept": swept, "device": device}
    with progress_bar("ensemble", quiet=call.quiet) as progress:
        result = solve(work, **given, observable=observable, window=window, cores=cores, progress=progress)
    call.keep(result, "ensemble.nc")
    files = [call.folder / "ensemble.nc", call.tabulate(result, "ensemble.csv")]
    files.append(call.draw(ensemble_map(result), "ensemble.png"))
    if call.json:
        call.document(result.to_json() | {"files": [str(f) for f in files]})
    else:
        _show(result)
        call.conclude(_conclusion(result))
    if result.interrupted:
        heard()
        call.say("interrupted; members that were finished are kept")
        raise typer.Exit(INTERRUPTED)
    if "failed" in result.regimes:
        raise typer.Exit(INCOMPLETE)


def _show(result: Ensemble) -> None:
    """A row for each member, with the numbers that vary first."""
    import numpy as np

    from .output import stdout
    from .tables import table

    varying = [name for name in ("mu", "load", "speed", "perturbation") if len(np.unique(getattr(result, name))) > 1]
    varying = varying or ["mu"]
    swept = any(result.sweep)
    slower = np.isfinite(result.stronger_below_hz)
    # Of several contacts the largest share each: a row has no place for all of them.
    shown = [name if result.stick.shape[1] < 2 else f"{name}, most" for name in ("stick", "slip", "separation")]
    heads = [*varying, *(["sweep"] if swept else []), "regime", f"rms [{result.unit}]", "frequency [Hz]",
             *(["stronger below [Hz]"] if slower.any() else []), *shown, "mode"]  # fmt: skip
    rows: list[list[str]] = []
    for k in range(min(len(result), MOST_ROWS)):
        shares = [f"{t[k].max():.1%}" if t.shape[1] and np.isfinite(t[k]).all() else "–" for t in
                  (result.stick, result.slip, result.separation)]  # fmt: skip
        known = np.isfinite(result.rms[k])
        rows.append(
            [
                *(f"{getattr(result, name)[k]:.4g}" for name in varying),
                *([result.sweep[k]] if swept else []),
                result.regime[k],
                readable(float(result.rms[k]), 4) if known else "–",
                measured(float(result.frequency_hz[k]), 1) if np.isfinite(result.frequency_hz[k]) else "–",
                *([measured(float(result.stronger_below_hz[k]), 1) if slower[k] else "–"] if slower.any() else []),
                *shares,
                str(result.mode[k]) if result.mode[k] else "–",
            ]
        )
    title = f"{result.observable} from {result.window[0]:.4g} to {result.window[1]:.4g} s, {result.how}"
    words = ["regime", *(["sweep"] if swept else [])]
    table(title, heads, rows, drop=[shown[1], shown[0], shown[2]], words=words, kept_in="ensemble.csv")
    if len(result) > MOST_ROWS:
        stdout.print(f"  {len(result) - MOST_ROWS} more of {len(result)} in ensemble.csv")
    for note in result.notes:
        stdout.print(note)
    for error in dict.fromkeys(e for e in result.error if e):
        count = sum(e == error for e in result.error)
        stdout.print(f"failed, {count} of {len(result)} members: {error}")


def _conclusion(result: Ensemble) -> Conclusion:
    """How many vibrate and which modes respond; then the run of the strongest one."""
    import numpy as np

    steady = [k for k, regime in enumerate(result.regime) if regime == "steady"]
    said = ", ".join(f"{count} {name}" for name, count in result.regimes.items())
    modes = sorted({int(result.mode[k]) for k in steady if result.mode[k]})
    if modes:
        named = ", ".join(map(str, modes))
        said += f"; modes {named} respond" if len(modes) > 1 else f"; mode {named} responds"
    said = f"{counted(len(result), 'member')}: {said}"
    if not np.isfinite(result.rms).any():
        return Conclusion(said)
    strongest = int(np.nanargmax(result.rms))
    plain = result.load[strongest] == result.speed[strongest] == 1.0 and not result.sweep[strongest]
    own = () if np.isnan(result.mu[strongest]) else ("--mu", f"{result.mu[strongest]:.6g}")
    # Factors and sweeps are options of the ensemble alone: a run without them would be another one.
    plain = plain and np.ptp(result.perturbation) == 0.0
    return Conclusion(said, "simulate" if plain else "modes", own)


VERBS = {"ensemble": ensemble}
