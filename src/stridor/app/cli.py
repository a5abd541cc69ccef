"""The `stridor` command. Thin: parse, call the API, show. Heavy imports wait until a verb needs them."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Annotated, Any

import typer

from ..errors import CaseError, StridorError
from . import about, explore, launch, modal, temporal

app = typer.Typer(
    name="stridor",
    help="Will these sliding bodies squeal? Complex modes, solved onsets and explicit dynamics of one model, compared.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


for verbs in (about.VERBS, modal.VERBS, temporal.VERBS, explore.VERBS):
    for name, call in verbs.items():
        app.command(name=name)(call)


@app.callback(invoke_without_command=True)
def _top(
    version: Annotated[bool, typer.Option("--version", help="Print the version and leave.")] = False,
) -> None:
    if version:
        from .. import __version__

        print(f"stridor {__version__}")
        raise typer.Exit


def main() -> None:
    """Entry point: errors as plain lines, no traceback. Exit code 2: bad input, 1: no answer, 130: Ctrl-C."""

    def program() -> None:
        launch.meet(sys.argv[1:])
        app(standalone_mode=True)

    sys.exit(_guarded(program))


def _guarded(call: Callable[[], Any]) -> int:
    try:
        call()
    except StridorError as error:
        print(f"stridor: {error}" if "\n" not in str(error) else f"stridor:\n{error}", file=sys.stderr)
        return 2 if isinstance(error, CaseError) else 1
    except KeyboardInterrupt:
        print("stridor: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        return 0
    except (OverflowError, MemoryError) as error:
        print(f"stridor: a number of the case is out of range for this computation ({error})", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    main()
