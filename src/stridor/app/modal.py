"""Verbs of the modal approach: steady sliding, modes and their shapes, onsets."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from ..digits import readable
from ..errors import AnalysisError, CaseError
from .along import MU, show_onsets_along
from .arguments import INCOMPLETE, Call, verb
from .option_table import Band, Branch, MaxFrequency, Mu, Range, Sort, Source, Undamped, Unstable
from .values import band_of, numbers, one_of, range_of

if TYPE_CHECKING:
    from ..case import Case

NOT_ALONG = {
    "--range": "their range is that of --between",
    "--undamped": "they are sought with the damping of the case; leave it out, and take that damping out of the case",
    "--band": "they are few; --max-frequency is",
    "--source": "they are sought on a reduced model and in the full problem",
}
WORTH_A_BAR = 20  # friction coefficients
INTERRUPTED = 130  # exit code


@verb()
def steady(call: Call, mu: Mu = None) -> None:
    """Steady sliding: which nodes touch, resultants of each contact, pressure as pictures and ParaView files."""
    work = call.workspace()

    from ..study.analyses import steady_sliding
    from .pictures import steady_document, write_steady

    found = steady_sliding(work, call.one_friction(mu))
    call.warn(found.warnings)
    files = list[Path]()
    try:
        files = write_steady(work, found, call.folder)
    except AnalysisError as error:
        call.lost.append(error)
    for path in files:
        call.say(f"written: {path}")
    document = steady_document(found) | {"files": [str(f) for f in files]}
    if call.json:
        call.document(document)
        return
    from .show import show_steady

    call.warn_of_idle()
    show_steady(document)
    call.suggest("modes", *(() if mu is None else ("--mu", mu)))


@verb()
def shapes(
    call: Call,
    mu: Mu = None,
    branch: Branch = None,
    band: Band = None,
    gif: Annotated[bool, typer.Option("--gif", help="Also an animated GIF of each.")] = False,
    max_frequency: MaxFrequency = None,
    undamped: Undamped = False,
    source: Source = None,
) -> None:
    """Shapes of modes: picture, animated page, ParaView file, and where friction feeds them."""
    work = call.workspace(source, max_frequency, undamped=undamped)

    from ..study.unit_warnings import resolution_warnings
    from .conclusions import of_shapes
    from .pictures import write_shapes
    from .tables import table

    friction, chosen = call.one_friction(mu), band_of(band, work.modal.max_frequency_hz, branch)
    call.warn(resolution_warnings(work.case(call.verb)))
    documents = write_shapes(work, call.folder, mu=friction, branches=branch or None, band_hz=chosen, gif=gif)
    for document in documents:
        for path in document["files"]:
            call.say(f"written: {path}")
    if call.json:
        call.document({"modes": documents, **({} if chosen is None else {"band_hz": list(chosen)})})
        return
    rows = [[str(d["branch"]), readable(d["frequency_hz"]), readable(d["growth_rate"])] for d in documents]
    red = [k for k, d in enumerate(documents) if d["unstable"]]
    table("shapes", ["branch", "frequency [Hz]", "growth [1/s]"], rows, marked=red, kept_in="the JSON document")
    call.conclude(of_shapes(documents, mu))


@verb()
def modes(
    call: Call,
    mu: Mu = None,
    count: Annotated[
        int | None,
        typer.Option(
            "--count",
            metavar="N",
            min=1,
            help="How many branches; unstable ones come on top [default: modal.modes, with --band all of it].",
        ),
    ] = None,
    band: Band = None,
    unstable: Unstable = False,
    sort: Sort = "frequency",
    max_frequency: MaxFrequency = None,
    undamped: Undamped = False,
    source: Source = None,
) -> None:
    """Complex modes at one or many friction coefficients, branches followed from μ = 0. Every unstable mode up to
    modal.max_frequency_hz is among them, with --band every mode of the band."""
    work = call.workspace(source, max_frequency, undamped=undamped)

    from ..study import analyses
    from ..study.unit_warnings import resolution_warnings
    from ..view.modal_plots import frequency_branches, root_locus
    from .conclusions import of_modes
    from .output import counting
    from .show_modes import show_modes

    values = None if mu is None else numbers(mu, "--mu")
    call.check_friction(values)
    chosen = band_of(band, work.modal.max_frequency_hz)
    call.warn(resolution_warnings(work.case(call.verb)))
    order: Literal["frequency", "growth"]
    order = "growth" if one_of(sort, "--sort", ("frequency", "growth")) == "growth" else "frequency"
    with counting("modes, friction coefficients", quiet=call.quiet, worth=len(values or ()) > WORTH_A_BAR) as progress:
        result = analyses.modes(work, values, count=count, band_hz=chosen, progress=progress)
    call.keep(result, "modes.nc")
    call.tabulate(result, "modes.csv")
    if len(result.branch):
        call.draw(frequency_branches(result) if len(result.mu) > 1 else root_locus(result), "modes.png")
    else:
        call.withdraw("modes.png")
    if result.interrupted:
        call.say(f"interrupted: {len(result.mu)} of {result.planned} friction coefficients, which are kept")
    if call.json:
        call.document(result.to_json(sort=order, unstable=unstable))
    else:
        show_modes(result, sort=order, unstable=unstable, say=call.say)
        call.conclude(of_modes(result, mu, drawn=work.has_shapes, rubs=work.rubs))
    if result.interrupted:
        raise typer.Exit(INTERRUPTED)


@verb()
def onsets(
    call: Call,
    friction_range: Range = None,
    max_frequency: MaxFrequency = None,
    band: Band = None,
    undamped: Undamped = False,
    along: Annotated[
        str | None,
        typer.Option(
            "--along",
            metavar="NAME",
            help="Along another number than μ: one of [parameters], contact_stiffness, or a number's path.",
        ),
    ] = None,
    between: Annotated[
        str | None,
        typer.Option("--between", metavar="LOW:HIGH", help="Its range [default: that of the parameter in the case]."),
    ] = None,
    source: Source = None,
) -> None:
    """Every critical friction coefficient in range, or critical value of another number: solved, not bracketed."""
    work = call.workspace(source, max_frequency, undamped=undamped)
    loaded = work.case(call.verb)
    if along is not None or between is not None:
        name = MU if along is None else along
        of_friction = name == MU and MU not in loaded.parameters
        if of_friction and friction_range is None:
            friction_range = between
        elif of_friction:
            raise CaseError("--between", between, "is the range of --along; --range has that of μ already")
        else:
            given = {
                "--range": friction_range,
                "--undamped": not loaded.modal.damped,
                "--band": band,
                "--source": source,
            }
            for option in [option for option, value in given.items() if value]:
                where = "modal.damped" if option == "--undamped" and not undamped else option
                how = _without_damping(loaded) if option == "--undamped" else ""
                raise CaseError(where, None, f"is not for onsets along {name}: {NOT_ALONG[option]}{how}")
            _onsets_along(call, loaded, name, None if between is None else range_of(between, "--between"))
            return

    from ..study import analyses
    from ..study.unit_warnings import resolution_warnings
    from ..view.onset_plots import onset_chart
    from .conclusions import of_onsets
    from .show_modes import show_onsets

    said = "--range" if along is None else "--between"
    chosen = None if friction_range is None else call.range_of_friction(friction_range, said)
    asked = band_of(band, loaded.modal.max_frequency_hz)
    call.warn(resolution_warnings(loaded))
    result = analyses.onsets(work, chosen, band_hz=asked)
    call.keep(result, "onsets.nc")
    call.tabulate(result, "onsets.csv")
    call.draw(onset_chart(result), "onsets.png")
    if call.json:
        call.document(result.to_json())
    else:
        show_onsets(result)
        call.conclude(of_onsets(result))
    if not result.complete:
        raise typer.Exit(INCOMPLETE)


def _onsets_along(call: Call, case: Case, name: str, between: tuple[float, float] | None) -> None:
    """Onsets along a number of the case: sought on a model reduced over its range, each solved in the full problem."""
    from ..study.along import onsets_along
    from ..study.unit_warnings import resolution_warnings
    from ..view.onset_plots import onset_chart
    from .conclusions import of_onsets_along

    call.warn(resolution_warnings(case))
    chosen = None if call.solver in (None, "auto") else call.solver
    found = onsets_along(case, name, between, solver=chosen, said="--between")
    call.warn(found.warnings)
    call.keep(found, "onsets-along.nc")
    call.tabulate(found, "onsets-along.csv")
    call.draw(onset_chart(found), "onsets-along.png")
    if call.json:
        call.document(found.to_json())
    else:
        for note in found.notes:
            call.say(f"note: {note}")
        show_onsets_along(found, confirmed=True)
        call.conclude(of_onsets_along(found))
    if not found.complete:
        raise typer.Exit(INCOMPLETE)


VERBS = {"steady": steady, "shapes": shapes, "modes": modes, "onsets": onsets}


def _without_damping(case: Case) -> str:
    """How the damping of a case is taken out of it, to go on a sentence: an option for each number that gives some."""
    found: list[str] = []
    for kind in ("bodies", "springs", "materials"):
        for name, table in getattr(case, kind).items():
            given = getattr(table, "damping", None)
            numbers = {"damping": given} if isinstance(given, float) else vars(given) if given is not None else {}
            for key, value in numbers.items():
                at = f"{kind}.{name}.damping" + ("" if key == "damping" else f".{key}")
                found += [f"--set {at}=0"] if isinstance(value, float) and value > 0.0 else []
    return f": {' '.join(found)}" if found else ""
