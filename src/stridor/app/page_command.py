"""The verb that opens a page in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import CaseError
from .option_table import Quiet, Set

CaseFile = Annotated[
    Path | None,
    typer.Argument(
        metavar="CASE", help="Case file (TOML), or store of a study [default: the two beams].", show_default=False
    ),
]


def app(
    case: CaseFile = None,
    port: Annotated[int, typer.Option("--port", help="Port of this computer to serve on; 0 for any.")] = 0,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in the browser, or print its address only.")
    ] = True,
    set_: Set = None,
    quiet: Quiet = False,
) -> None:
    """Move numbers of a case in the browser and see what happens to its modes. Ends with Ctrl-C."""
    if not 0 <= port < 65536:
        raise CaseError("--port", port, "a port from 1 to 65535, or 0 for any that is free")
    from ..case import load, loads, template_text
    from .output import literal, say
    from .page import source_of
    from .page.server import Server, needed, show
    from .page.state import Source
    from .page.study_rows import is_study, study_at

    needed()
    study = None
    if case is not None and is_study(case):
        if set_:
            raise CaseError("--set", ", ".join(set_), "goes with a case file; a study has its own numbers")
        source, study = study_at(case)
    else:
        source = source_of(case)
    if set_:  # changed values cannot keep the comments that speak of the old ones
        changed = load(case, set_) if case else loads(template_text("two-beams"), set_, "two-beams")
        source = Source(source.name, changed.text, source.folder)

    def ready(address: str) -> None:
        literal(address)
        say("The page is for this computer; the address is its key. Ctrl-C ends it.", quiet=quiet)
        if browser:
            show(address)

    Server({"case": source}, port, study=study).run(ready=ready)


VERBS = {"app": app}
