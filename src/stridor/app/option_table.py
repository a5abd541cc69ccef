"""The options of the verbs: one table from which each verb takes its own, so that a name means one thing everywhere.

docs/commands.md shows it. An option that a verb lacks has there, in a word, why.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

COMPUTING = (
    "steady", "shapes", "modes", "onsets", "simulate", "cycles", "compare", "run", "report", "sensitivities",
    "countermeasures", "damping-map", "boundary", "reduce",
)  # fmt: skip
ABOUT = ("new", "check", "matrices", "export")  # verbs about the case itself
STUDIES = ("study", "plot", "ensemble")  # of many samples of a case
SHOWING = ("sound",)  # what was computed before
EVERY = (*ABOUT, *COMPUTING, *STUDIES, *SHOWING)  # that print or write what they find
PAGES = ("app",)  # in a browser
READING = ("plot", "sound")  # what was computed before: no case is changed for them any more
CHANGING = tuple(verb for verb in EVERY if verb not in READING)


@dataclass(frozen=True)
class Option:
    """One option: its name, what stands for its value, what it says, the verbs that have it, and why others that
    compute do not. described: what typer makes of it."""

    name: str
    metavar: str | None
    help: str
    on: tuple[str, ...]
    lacks: Mapping[str, str]
    described: Any


TABLE: dict[str, Option] = {}


def _option(name: str, help_: str, *, metavar: str | None = None, on: str = "", lacks: str = "", **more: Any) -> Any:
    """Put an option into the table. on: its verbs (all that compute unless given); lacks: "verb=why" for others."""
    described = typer.Option(name, metavar=metavar, help=help_, **more)
    without = dict(word.split("=") for word in lacks.split())
    verbs = tuple(on.split()) or tuple(verb for verb in COMPUTING if verb not in without)
    TABLE[name] = Option(name, metavar, help_, verbs, without, described)
    return described


Mu = Annotated[
    str | None,
    _option(
        "--mu",
        "Friction coefficient of every contact that has friction; where several are taken, a,b or start:stop:count, "
        "where a range is, low:high [default: the case's own; of comparisons comparison.mu].",
        metavar="MU",
        on="steady shapes modes simulate cycles compare report sensitivities countermeasures export ensemble",
        lacks="onsets=sought run=--range damping-map=sought boundary=--set reduce=--at",
    ),
]
Range = Annotated[
    str | None,
    _option(
        "--range",
        "Range of μ in which onsets are sought and cycles followed [default: modal.friction_range].",
        metavar="LOW:HIGH",
        on="onsets cycles compare run report damping-map",
        lacks="steady=--mu shapes=--mu modes=--mu simulate=--mu sensitivities=--mu countermeasures=--mu "
        "boundary=--y-range reduce=--box",
    ),
]
MaxFrequency = Annotated[
    float | None,
    _option(
        "--max-frequency",
        "Highest frequency that is looked at [default: modal.max_frequency_hz].",
        metavar="HZ",
        lacks="steady=static simulate=time",
    ),
]
Band = Annotated[
    str | None,
    _option(
        "--band",
        "Only what has a frequency [Hz] in this band; numbers of modes stay those of the whole list.",
        metavar="LOW:HIGH",
        on="modes shapes onsets sensitivities",
        lacks="steady=static simulate=time cycles=all compare=pairs run=page "
        "report=page countermeasures=sum damping-map=lowest "
        "boundary=curves reduce=unnumbered",
    ),
]
Branch = Annotated[
    list[int] | None,
    _option(
        "--branch",
        "Mode by its number in `modes` at that μ alone. Repeatable [default: the unstable ones].",
        metavar="NUMBER",
        on="shapes sensitivities countermeasures",
        lacks="steady=static modes=--band onsets=--band simulate=time cycles=all "
        "compare=fastest run=fastest report=fastest "
        "damping-map=lowest boundary=curves reduce=unnumbered",
    ),
]
Unstable = Annotated[
    bool,
    _option(
        "--unstable",
        "List unstable modes alone.",
        on="modes",
        lacks="steady=static shapes=default onsets=all simulate=time cycles=all compare=fastest run=page report=page "
        "sensitivities=default countermeasures=default damping-map=lowest boundary=curves reduce=unnumbered",
    ),
]
Sort = Annotated[
    str,
    _option(
        "--sort",
        "What comes first: lowest or fastest growing.",
        metavar="frequency|growth",
        on="modes",
        lacks="steady=static shapes=growth onsets=μ simulate=time cycles=μ "
        "compare=μ run=page report=page sensitivities=growth "
        "countermeasures=effect damping-map=grid boundary=curves reduce=frequency",
    ),
]
Source = Annotated[
    str | None,
    _option(
        "--source",
        "Where eigenpairs come from: receptance, krylov, reduced, full [default: modal.source, what suits].",
        metavar="NAME",
        lacks="steady=static simulate=time boundary=--method reduce=reduced",
    ),
]
Undamped = Annotated[
    bool,
    _option(
        "--undamped",
        "Leave structural damping out of small motions; steady sliding keeps the drag of what moves.",
        on="modes shapes onsets sensitivities countermeasures",
        lacks="steady=static simulate=time cycles=time compare=time run=both "
        "report=both damping-map=damping boundary=kept "
        "reduce=kept",
    ),
]
Box = Annotated[
    list[str] | None,
    _option(
        "--box",
        "A range of mu, contact_stiffness, a parameter or a number's path. Repeatable [default: the ranges of "
        "[parameters], else mu over modal.friction_range].",
        metavar="NAME=LOW:HIGH",
        on="reduce",
        lacks="steady=--mu shapes=--mu modes=--mu onsets=--between simulate=--mu "
        "cycles=--range compare=--range run=--range "
        "report=--mu sensitivities=--mu countermeasures=--mu damping-map=--x-range boundary=--x-range",
    ),
]
At = Annotated[
    list[str] | None,
    _option(
        "--at",
        "Values to solve at: 0.1,0.2 or start:stop:count. Repeatable.",
        metavar="NAME=VALUES",
        on="reduce",
        lacks="steady=--set shapes=--set modes=--set onsets=--set simulate=--set "
        "cycles=--set compare=--set run=--set report=--set "
        "sensitivities=--set countermeasures=--set damping-map=--set boundary=--set",
    ),
]
Parameter = Annotated[
    list[str] | None,
    _option(
        "--parameter",
        "A number of the case, or mu. Repeatable [default: mu; of countermeasures what can be built].",
        metavar="PATH",
        on="sensitivities countermeasures",
        lacks="steady=--set shapes=--set modes=--set onsets=--along simulate=--set "
        "cycles=--set compare=--set run=--set report=page "
        "damping-map=--x boundary=--x reduce=--box",
    ),
]
Force = Annotated[bool, _option("--force", "Replace files that are there already.", on="new export")]
Set = Annotated[
    list[str] | None,
    _option(
        "--set",
        "Change a value of the case, or of the study, e.g. contacts.A.friction.coefficient=0.3. Repeatable.",
        metavar="KEY=VALUE",
        on=" ".join((*CHANGING, *PAGES)),
    ),
]
Solver = Annotated[
    str | None,
    _option(
        "--solver",
        "Sparse direct solver: mumps, pardiso, superlu; slepc for all processes of mpiexec [default: the case's].",
        metavar="NAME",
        on=" ".join(verb for verb in CHANGING[1:] if verb != "study"),  # whose file says it: set."modal.solver"
    ),
]
Out = Annotated[
    Path | None,
    _option(
        "--out",
        "Folder for what is written [default: CASE.out; where no case is read, beside what is read, or here].",
        metavar="DIR",
        on=" ".join(EVERY),
    ),
]
Json = Annotated[
    bool,
    _option("--json", "Print one JSON document on stdout and nothing else there.", on=" ".join(EVERY)),
]
Quiet = Annotated[
    bool,
    _option("--quiet", "No log, no progress, no hint at what comes next.", on=" ".join((*EVERY, *PAGES))),
]
Verbose = Annotated[
    bool,
    _option(
        "--verbose",
        "Say on stderr which methods are chosen and why, and every stage.",
        on=" ".join(EVERY[1:]),
    ),
]


# Of verbs that look at one history of a run; what they take unless told differs, and their pages say what.
Observable = Annotated[
    str | None,
    typer.Option(
        "--observable", metavar="NAME", help="The history that is taken, as beam1.tip.velocity or A.normal_force."
    ),
]


def rows() -> list[str]:
    """The table as lines of Markdown, as docs/commands.md has it."""
    lines = ["| option | what it says | on | not on, and why |", "|---|---|---|---|"]
    everywhere: dict[tuple[str, ...], str] = {
        (*EVERY, *PAGES): "all", EVERY: "all but `app`", EVERY[1:]: "all but `new` and `app`",
        (*CHANGING, *PAGES): "all but `plot` and `sound`",
        TABLE["--solver"].on: "all but `new`, `study`, `plot`, `sound` and `app`",
    }  # fmt: skip
    for option in TABLE.values():
        flag = option.name if option.metavar is None else f"{option.name} {option.metavar}".replace("|", "\\|")
        on = everywhere.get(option.on) or ", ".join(f"`{verb}`" for verb in option.on)
        by_reason: dict[str, list[str]] = {}
        for verb, why in option.lacks.items():
            by_reason.setdefault(why, []).append(f"`{verb}`")
        lacks = "; ".join(f"{', '.join(verbs)}: {_code(why)}" for why, verbs in by_reason.items())
        lines.append(f"| `{flag}` | {option.help} | {on} | {lacks} |")
    return lines


def _code(why: str) -> str:
    return f"`{why}`" if why.startswith("--") else why
