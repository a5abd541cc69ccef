"""The options of verbs that vary two numbers of a case."""

from __future__ import annotations

from typing import Annotated

import typer

X = Annotated[str, typer.Option("--x", metavar="PATH", help="A number of the case.")]
Y = Annotated[str, typer.Option("--y", metavar="PATH", help="Another one.")]
XRange = Annotated[str, typer.Option("--x-range", metavar="LOW:HIGH", help="Its range.")]
YRange = Annotated[str, typer.Option("--y-range", metavar="LOW:HIGH", help="The other's range.")]
Method = Annotated[
    str,
    typer.Option(
        "--method",
        metavar="auto|full|reduced",
        help="full: the full problem at every point, for curves up to 400 freedoms; reduced: one reduced model for "
        "all, a few points solved again in the full problem; auto: reduced where that is faster and possible.",
    ),
]
