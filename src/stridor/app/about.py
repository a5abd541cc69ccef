"""Verbs about a case itself: a new one, what it says, what its matrices are like."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import CaseError
from .arguments import Call, Json, Quiet, Set, verb

CaseOrMatrix = Annotated[
    Path, typer.Argument(metavar="CASE|FILE", help="Case file (TOML), or one matrix file.", show_default=False)
]


def new(
    template: Annotated[str, typer.Argument(metavar="TEMPLATE", help="Name of a template, e.g. two-beams.")],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder to write into [default: here].")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
    set_: Set = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Write a commented case file, ready to edit."""
    from ..case import loads, template_text
    from ..io.atomic import write_text
    from .output import print_json, say

    text = template_text(template)
    if set_:
        # Changed values cannot keep the comments that speak of the old ones.
        text = loads(text, set_, source=template).text
    path = (out or Path()) / f"{template}.toml"
    if path.exists() and not force:
        raise CaseError("TEMPLATE", str(path), "a file that does not exist yet; remove it or add --force")
    write_text(path, text)
    if json:
        print_json({"case": str(path)})
    say(f"written: {path}\nnext: stridor check {path}, then stridor run {path}", quiet=quiet)


@verb(writes=False)
def check(call: Call) -> None:
    """Validate a case and print the model in words: bodies, contacts, time step against its limit."""
    work = call.workspace()

    from ..study.analyses import describe
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
        stdout.print(line, markup=False)


@verb(CaseOrMatrix, writes=False)
def matrices(
    call: Call,
    name: Annotated[str | None, typer.Option("--name", help="Which matrix of a file that holds several.")] = None,
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
            stdout.print("\n".join([f"{call.path}:", *(f"  {line}" for line in lines)]), markup=False)
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
        stdout.print(line, markup=False)


VERBS = {"new": new, "check": check, "matrices": matrices}
