"""Verbs about a case itself: a new one, what it says, what its matrices are like, the matrices as files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import CaseError
from .arguments import Call, verb
from .option_table import Force, Json, Mu, Out, Quiet, Set
from .values import one_of

CaseOrMatrix = Annotated[
    Path, typer.Argument(metavar="CASE|FILE", help="Case file (TOML), or one matrix file.", show_default=False)
]


def new(
    template: Annotated[str, typer.Argument(metavar="TEMPLATE", help="Name of a template, e.g. two-beams.")],
    out: Out = None,
    force: Force = False,
    set_: Set = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Write a commented case file, ready to edit."""
    from ..case import loads, template_text
    from ..io.atomic import write_text
    from ..io.claims import make_folder
    from .closing import command
    from .output import literal, print_json, say, stdout

    text = template_text(template)
    if set_:
        # Changed values cannot keep the comments that speak of the old ones.
        text = loads(text, set_, source=template).text
    path = (out or Path()) / f"{template}.toml"
    if path.exists() and not force:
        raise CaseError("TEMPLATE", str(path), "a file that does not exist yet; remove it or add --force")
    make_folder(path.parent)
    write_text(path, text)
    if json:
        print_json({"case": str(path)})
    say(f"written: {path}", quiet=quiet)
    if not (json or quiet):
        literal(f"Next: {command(['stridor', 'check', str(path)], stdout.page - 6)}")


@verb(writes=False)
def check(call: Call) -> None:
    """Validate a case and print the model in words: bodies, contacts, time step against its limit."""
    work = call.workspace()

    from ..study.description import describe
    from .output import stdout

    description = describe(work)
    call.warn(description.warnings)
    if call.out is not None:
        from ..io.atomic import write_text

        write_text(call.out / "check.txt", "\n".join(description.lines) + "\n")
    if call.json:
        call.document(description.to_json())
        return
    for line in description.lines:
        stdout.print(line)
    if work.has_contacts and not work.slides:  # there is nothing that modes and onsets could be about
        if work.given is not None and work.given.phases:
            call.suggest("simulate")
        return
    call.suggest("onsets" if work.has_contacts else "modes")


@verb(CaseOrMatrix, writes=False)
def matrices(
    call: Call,
    name: Annotated[
        str | None, typer.Option("--name", metavar="NAME", help="Which matrix of a file that holds several.")
    ] = None,
) -> None:
    """What imported matrices are like: symmetry, definiteness, units, friction terms that got lost.

    A matrix file by itself tells its size, symmetry, definiteness and the rank of what is not symmetric.
    """
    if call.path.suffix.lower() != ".toml":
        from ..matrices.read import read_matrix
        from ..matrices.report import single_lines
        from .output import print_json, stdout

        lines = single_lines(read_matrix(call.path, name, where="FILE"))
        if call.json:
            print_json({str(call.path): {"text": lines}})
        else:
            stdout.print("\n".join([f"{call.path}:", *(f"  {line}" for line in lines)]))
        return
    case = call.case()

    from ..study.matrix_reports import matrix_reports
    from .output import print_json, stdout

    found = matrix_reports(case)
    text = [line for name, report in found.items() for line in (f"{name}:", *(f"  {x}" for x in report.lines()))]
    if call.out is not None:
        from ..io.atomic import write_text

        write_text(call.out / "matrices.txt", "\n".join(text) + "\n")
    if call.json:
        print_json({name: {"text": r.lines(), "warnings": list(r.matrices.warnings)} for name, r in found.items()})
        return
    for line in text:
        stdout.print(line)


@verb()
def export(
    call: Call,
    format_: Annotated[
        str, typer.Option("--format", metavar="mtx|npz|mat|op4", help="Matrix Market, NumPy, MATLAB, Nastran OUTPUT4.")
    ] = "mtx",
    mu: Mu = None,
    force: Force = False,
) -> None:
    """Write mass, damping and stiffness as files, with loads, rows of contacts, a table of freedoms, and a case file on
    these matrices. With --mu contact and friction are in K, without it in terms of their own."""
    work = call.workspace()

    from ..io.export import export as write
    from ..io.matrix_files import FORMATS
    from .output import stdout
    from .tables import table

    friction = call.one_friction(mu)
    written = write(work, call.folder, format=one_of(format_, "--format", FORMATS), mu=friction, force=force)
    call.warn(written.notes)
    for path in written.files:
        call.say(f"written: {path}")
    if call.json:
        call.document(written.to_json())
        return
    rows = [
        [name, " × ".join(map(str, said["shape"])), said["file"], said["meaning"]]
        for name, said in written.matrices.items()
    ]
    table("matrices", ["name", "shape", "file", "what it is"], rows, words=["what it is"], kept_in="the JSON document")
    if written.load_names:
        stdout.print(f"columns of loads: {', '.join(written.load_names)}")
    if written.case is not None:
        call.suggest("modes" if mu is not None else "onsets", path=Path(written.case))


VERBS = {"new": new, "check": check, "matrices": matrices, "export": export}
