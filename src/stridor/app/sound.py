"""`stridor sound`: a run in time as a WAV file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from .arguments import Call, verb
from .closing import Conclusion
from .option_table import Observable

MOST, HEARABLE = 0.5, 10  # share of the power above hearing from which on a slower sound tells more

RunFile = Annotated[
    Path,
    typer.Argument(metavar="RUN", help="File of a run (simulate.nc), or the folder it is in.", show_default=False),
]


@verb(RunFile)
def sound(
    call: Call,
    observable: Observable = None,
    slow: Annotated[float, typer.Option("--slow", metavar="TIMES", help="How many times slower, and lower.")] = 1.0,
    repeat: Annotated[int, typer.Option("--repeat", metavar="N", help="How many times it is heard.")] = 1,
    phase: Annotated[
        str | None, typer.Option("--phase", metavar="NAME", help="Phase of the run [default: the last].")
    ] = None,
) -> None:
    """What a run in time sounds like: a WAV file at its own pitch, or slowed down."""
    from ..io.atomic import replacing
    from ..io.datasets import load_trajectory
    from ..view.sound import sound as heard

    path = call.path / "simulate.nc" if call.path.is_dir() else call.path
    if call.out is None:
        call = replace(call, out=path.parent)
    run = load_trajectory(path)
    found = heard(run, observable, slow=slow, phase=phase, repeat=repeat)
    call.claim()
    slower = "" if slow == 1.0 else f"-{slow:g}-times-slower"
    target = call.folder / f"{found.observable}{slower}.wav"
    with replacing(target) as temporary:
        temporary.write_bytes(found.wav())
    call.say(f"written: {target}")
    if call.json:
        call.document(
            {
                "observable": found.observable, "unit": found.unit, "seconds": found.seconds, "rate": found.rate,
                "loudest": found.loudest, "slow": found.slow, "unheard": found.unheard, "files": [str(target)],
            }
        )  # fmt: skip
    else:
        call.conclude(Conclusion(found.sentence))
        if found.unheard > MOST:
            call.suggest("sound", "--slow", str(HEARABLE))


VERBS = {"sound": sound}
