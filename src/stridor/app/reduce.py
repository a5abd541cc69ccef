"""`stridor reduce`: a model reduced once over ranges of its numbers, kept in a file, solved anywhere in them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from ..digits import measured
from ..errors import CaseError
from ..reading import is_reduced_file
from .along import onset_document, show_onsets_along
from .arguments import INCOMPLETE, Call, verb
from .option_table import At, Box, MaxFrequency
from .values import INFINITY, numbers, range_of

if TYPE_CHECKING:
    from ..case import Case
    from ..modal.full import ParametricOnsets
    from ..modal.parametric import ReducedModel

BOUND = 1e-8
CONTACTS = ("mu", "contact_stiffness")  # parameters without a unit; others have that of the number in the case

Model = Annotated[
    Path,
    typer.Argument(
        metavar="CASE|MODEL", help="Case file (TOML), or a model that --save wrote (.npz).", show_default=False
    ),
]


@verb(Model)
def reduce(
    call: Call,
    box: Box = None,
    along: Annotated[str | None, typer.Option("--onsets", metavar="NAME", help="Solve for onsets along it.")] = None,
    at: At = None,
    max_frequency: MaxFrequency = None,
    bound: Annotated[
        float | None, typer.Option("--bound", metavar="SHARE", help="Relative error of eigenvalues [default: 1e-8].")
    ] = None,
    save: Annotated[
        Path | None,
        typer.Option("--save", metavar="FILE.npz", help="Keep the model; give the file in place of the case later."),
    ] = None,
    keep: Annotated[
        str | None,
        typer.Option(
            "--keep",
            metavar="all|shapes|eigenvalues",
            help="What goes into the file: shapes leaves out the full matrices (and with them the confirmation of "
            "onsets), eigenvalues the basis too [default: all].",
        ),
    ] = None,
    corrections: Annotated[
        int,
        typer.Option(
            "--corrections",
            metavar="N",
            min=0,
            max=10,
            help="Correction steps at most where an error is above the bound.",
        ),
    ] = 3,
) -> None:
    """Reduce the model once over ranges of its numbers, then solve anywhere in them within milliseconds."""
    _check_file(save, keep)
    call.asked.extend(("--box", item) for item in box or ())
    call.asked.extend([("--max-frequency", f"{max_frequency}")] if max_frequency else [])
    told: tuple[str, ...] = ()
    if is_reduced_file(call.path):
        given = {"--box": box, "--set": call.set_, "--max-frequency": max_frequency, "--bound": bound}
        call.claim()
        model, origin = _read(call.path, [name for name, value in given.items() if value], quiet=call.quiet)
        asked = _asked(at or [], along, [p.name for p in model.problem.parameters])
    else:
        origin = call.case()
        ranges = _ranges(origin, box or [])
        from ..study.workspace import Workspace

        told = Workspace(origin).one_for_all if CONTACTS[0] in ranges else ()
        asked = _asked(at or [], along, list(ranges))
        model = _made(origin, ranges, max_frequency, BOUND if bound is None else bound)
        seconds = sum(model.seconds.values())
        made = f"{model.problem.size} freedoms reduced to {model.size} in {seconds:.2f} s"
        call.say(f"{model.size} freedoms, all of them kept" if model.keeps_all else made)

    from ..io.left_out import kept_in
    from ..modal.full import onsets_along, unlike_along
    from ..modal.parametric import ModesAtPoints
    from ..sliding.stretches import HELD
    from ..view.onset_plots import modes_at_points, onset_chart
    from .conclusions import of_reduced

    notes = [*getattr(model.problem, "notes", ()), *told]
    for note in notes:
        call.say(f"note: {note}")
    call.warn(model.problem.idle_words)
    files: list[Path] = []
    if save is not None:
        files.append(call.keep_at(save, "the model", lambda path: _saved(model, path, origin, keep)))
    chosen = None if call.solver in (None, "auto") else call.solver
    points: list[dict[str, Any]] = []
    unlike: tuple[str, ...] = ()
    if asked:
        found = ModesAtPoints.of(
            model, asked, corrections=corrections if kept_in(model) == "all" else 0, solver=chosen,
            provenance=_source(origin),
        )  # fmt: skip
        points = found.to_json()
        names = found.parameters
        call.warn(model.hidden_at([dict(zip(names, at, strict=True)) for at in found.values.tolist()]))
        files += [call.keep(found, "reduced.nc"), call.tabulate(found, "reduced.csv")]
        files.append(call.draw(modes_at_points(found), "reduced.png"))
        unlike = found.unlike_words()
        for note in unlike:
            call.say(f"note: {note}")
        notes += unlike
    confirm = kept_in(model) == "all"
    onsets: ParametricOnsets | None = None
    elsewhere, beyond, doubt = bool(getattr(model.problem, "elsewhere", ())), False, ""
    if along is not None:
        fixed = {name: values[0] for name, values in asked.items() if name != along}
        onsets = onsets_along(model, along, fixed, confirm=confirm, solver=chosen)
        onsets.provenance = _source(origin)
        beyond = not model.problem.inside(model.problem.point(fixed))
        doubt = unlike_along(model, along, fixed)
        files += [call.keep(onsets, "reduced-onsets.nc"), call.tabulate(onsets, "reduced-onsets.csv")]
        files.append(call.draw(onset_chart(onsets), "reduced-onsets.png"))
    if call.json:
        document = _about(model) | {"modes": points, "onsets": [onset_document(o) for o in onsets or ()]}
        if unlike:
            document |= {"notes": notes}
        if onsets is not None:
            document |= {"notes": notes, "completeness": onsets.sentence, "complete": onsets.complete}
        call.document(document | {"files": [str(f) for f in files]})
    else:
        if points:
            _show_modes(model, points)
        if along is not None and onsets is not None:
            held = any(HELD in note for note in notes)
            show_onsets_along(onsets, confirmed=confirm, held=held, doubtful=elsewhere or bool(doubt), outside=beyond)
        ranges = {p.name: f"{p.low:g}:{p.high:g}:5" for p in model.problem.parameters}
        call.conclude(of_reduced(points, onsets, ranges, elsewhere=elsewhere, doubtful=bool(doubt or unlike)))
    if onsets is not None and not onsets.complete:
        raise typer.Exit(INCOMPLETE)


def _check_file(save: Path | None, keep: str | None) -> None:
    """Before hours of work: that the model will find its place."""
    if save is not None and save.suffix != ".npz":
        raise CaseError("--save", str(save), "a name that ends in .npz")
    if keep is None:
        return

    from ..io.left_out import KEEPS

    if keep not in KEEPS:
        raise CaseError("--keep", keep, f"one of {', '.join(KEEPS)}")
    if save is None:
        raise CaseError("--keep", keep, "goes with --save FILE.npz")


def _read(path: Path, idle: list[str], *, quiet: bool) -> tuple[ReducedModel, dict[str, Any]]:
    """A saved model and where it comes from."""
    from ..io.reduced_models import load_reduced, provenance_of
    from .output import say

    if idle:
        raise CaseError(
            idle[0], None, f"is for making a model, and {path} holds one that is made; give its case file instead"
        )
    model, origin = load_reduced(path), provenance_of(path)
    title = f" of “{_printable(origin['title'])}”" if origin["title"] else ""
    digest = f", case {_printable(origin['case_sha256'])[:12]}" if origin["case_sha256"] else ""
    made = f"made {_printable(origin['created'])} by stridor {_printable(origin['versions'].get('stridor', '?'))}"
    say(f"{path}: {model.problem.size} freedoms reduced to {model.size}{title}{digest}, {made}", quiet=quiet)
    return model, origin


def _printable(text: str) -> str:
    """A text of a file that somebody else may have written, without what a terminal would obey."""
    return "".join(c for c in text if c.isprintable())


def _saved(model: ReducedModel, path: Path, origin: Case | dict[str, Any], keep: str | None) -> Path:
    from ..io.left_out import Keep, kept_in
    from ..io.reduced_models import save_reduced

    return save_reduced(model, path, case=origin, keep=kept_in(model) if keep is None else cast("Keep", keep))


def _ranges(case: Case, box: list[str]) -> dict[str, tuple[float, float]]:
    """The ranges of --box by name; without one those of [parameters], else that of friction. Raises CaseError."""
    ranges: dict[str, tuple[float, float]] = {}
    for name, text in (_named(item, "--box") for item in box):
        if name in ranges:
            raise CaseError("--box", f"{name}={text}", f"{name} has a range already, {ranges[name]}; give each once")
        ranges[name] = range_of(text, f"--box {name}")
    if not ranges:
        ranges = {name: p.range for name, p in case.parameters.items() if p.range is not None}
    return ranges or {"mu": case.modal.friction_range}


def _asked(at: list[str], along: str | None, names: list[str]) -> dict[str, list[float]]:
    """The values of --at by name, and before minutes of work: that these and --onsets name parameters of the model.
    Raises CaseError."""
    given: dict[str, list[float]] = {}
    for name, text in (_named(item, "--at") for item in at):
        if name in given:
            raise CaseError("--at", f"{name}={text}", f"{name} has values already; give all in one, with commas")
        _check_name(name, "--at", names)
        given[name] = numbers(text, f"--at {name}", least=0.0 if name in CONTACTS else -INFINITY)
    if along is not None:
        _check_name(along, "--onsets", names)
    return given


def _check_name(name: str, option: str, names: list[str]) -> None:
    from ..case.points import choice

    if name not in names:
        raise CaseError(option, name, f"no number of the model{choice(name, names, 'there are')}")


def _made(case: Case, ranges: dict[str, tuple[float, float]], limit: float | None, bound: float) -> ReducedModel:
    from ..study.reduced import reduced_model

    return reduced_model(case, ranges, max_frequency_hz=limit, bound=bound)


def _named(text: str, option: str) -> tuple[str, str]:
    name, equals, rest = text.partition("=")
    if not equals or not name:
        raise CaseError(option, text, "NAME=… such as mu=0:0.6")
    return name.strip(), rest


def _source(origin: Case | dict[str, Any]) -> dict[str, Any]:
    """What a result file says of the case, or of the case of the file that the model was read from."""
    if not isinstance(origin, dict):
        from ..study.provenance import provenance

        return provenance(origin, "reduce", 0.0)
    return origin | {"case": origin["case"] or ""}


def _about(model: ReducedModel) -> dict[str, Any]:
    """What the document says of the model itself."""
    return {
        "freedoms": model.problem.size,
        "size": model.size,
        "max_frequency_hz": model.frequency / (2 * math.pi),
        "bound": model.bound,
        "parameters": [
            {"name": p.name, "low": p.low, "high": p.high, "value": p.value} for p in model.problem.parameters
        ],
        "seconds": dict(model.seconds),
        "solves": model.solves,
    }


def _modes(point: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The modes of a point one by one."""
    names = ("frequency_hz", "growth_rate", "unstable", "error", "passed", "residual")
    return [dict(zip(names, values, strict=True)) for values in zip(*(point[n] for n in names), strict=True)]


def _show_modes(model: ReducedModel, document: list[dict[str, Any]]) -> None:
    from ..modal.parametric.problem import NOT_KNOWN
    from .tables import table

    rows: list[list[str]] = []
    for point in document:
        for mode in _modes(point):
            remarks = {
                "unstable": mode["unstable"],
                "error above the bound": not mode["passed"],
                "outside the box": not point["inside"],
                "does not hold": point.get("unlike", NOT_KNOWN) != NOT_KNOWN,
                "who touches is not known": point.get("unlike") == NOT_KNOWN,
                f"corrected {point['corrections']} ×": point["corrections"],
            }
            rows.append(
                [
                    *(f"{v:.6g}" for v in point["point"].values()),
                    measured(mode["frequency_hz"], 3),
                    measured(mode["growth_rate"], 4),
                    f"{mode['error']:.1e}",
                    f"{mode['residual']:.1e}",
                    ", ".join(words for words, so in remarks.items() if so),
                ]
            )
    heads = [*(p.name for p in model.problem.parameters), "frequency [Hz]", "growth [1/s]", "error", "residual", ""]
    red = [k for k, mode in enumerate(mode for point in document for mode in _modes(point)) if mode["unstable"]]
    gone = ["residual", "error"]
    title = "Modes of the full model" if model.keeps_all else "Modes of the reduced model"
    table(title, heads, rows, drop=gone, words=[""], marked=red, kept_in="reduced.csv")
