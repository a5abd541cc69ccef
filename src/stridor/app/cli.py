"""The `stridor` command. Thin: parse, call the API, show. Heavy imports wait until a verb needs them."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Callable
from typing import Annotated

import typer

from .. import interrupts
from ..errors import CaseError, StridorError
from . import about, cycles, ensemble, explore, launch, modal, page_command, sound, study, temporal

app = typer.Typer(
    name="stridor",
    help="Will these sliding bodies squeal? Complex modes, solved onsets and explicit dynamics of one model, compared.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


TOPICS = (about, modal, temporal, cycles, explore, study, ensemble, sound, page_command)
for verbs in (topic.VERBS for topic in TOPICS):
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
    """Entry point: errors as plain lines, no traceback. Exit codes: docs/results.md."""
    interrupts.install()
    for stream in (sys.stdout, sys.stderr):
        # Pipes of Windows know no μ.
        if isinstance(stream, io.TextIOWrapper) and not stream.encoding.lower().startswith("utf"):
            stream.reconfigure(errors="replace")
    try:
        code = _guarded(_program)
    except KeyboardInterrupt:  # a second one, while the first was told
        code = interrupts.INTERRUPTED
    interrupts.leave()
    code = _flushed(code)
    interrupts.gone()
    sys.exit(code)


def _program() -> int:
    launch.meet(sys.argv[1:])
    try:
        app(standalone_mode=True)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 0 if end.code is None else 1
    return 0


def _guarded(call: Callable[[], int | None]) -> int:
    try:
        code = call()
        interrupts.check()
    except StridorError as error:
        _refuse(f"stridor: {error}" if "\n" not in str(error) else f"stridor:\n{error}")
        return 2 if isinstance(error, CaseError) else 1
    except KeyboardInterrupt:
        return _interrupted()
    except BrokenPipeError:
        return 0
    except OSError as error:
        # Files have messages of their own: this is what is printed.
        print(f"stridor: cannot write the output: {error.strerror or error}", file=sys.stderr)
        return 1
    except (OverflowError, MemoryError) as error:
        print(f"stridor: a number of the case is out of range for this computation ({error})", file=sys.stderr)
        return 1
    except Exception:
        # Compiled modules that an interrupt meets amid their import make an error of their own of it (SystemError).
        if not interrupts.pending():
            raise
        return _interrupted()
    return code or 0


def _interrupted() -> int:
    interrupts.heard()
    print("stridor: interrupted", file=sys.stderr)
    return interrupts.INTERRUPTED


def _refuse(text: str) -> None:
    """Say what is wrong: a problem is a line, for other programs to read; on a terminal lines no longer than that."""
    if not sys.stderr.isatty():
        print(text, file=sys.stderr)
        return
    from .output import stderr

    stderr.print(text)


def _flushed(code: int) -> int:
    """The exit code, 1 where what was printed could not be written; the interpreter is left nothing to tell."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError) as error:
            with contextlib.suppress(OSError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
            if not isinstance(error, BrokenPipeError) and stream is sys.stdout:
                with contextlib.suppress(OSError):
                    print(f"stridor: cannot write the output: {error}", file=sys.stderr)
                code = code or 1
    return code
