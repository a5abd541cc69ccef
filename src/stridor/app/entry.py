"""Where the program begins: signals are heard from the first moment on, before the command line is loaded."""

from __future__ import annotations

import sys

from .. import interrupts


def main() -> None:
    """Entry point: `cli.main`, of which not even the import dies of a signal with a traceback."""
    interrupts.install()
    try:
        from .cli import main as program
    except KeyboardInterrupt:
        interrupts.leave()
        print("stridor: interrupted", file=sys.stderr)
        interrupts.gone()
        sys.exit(interrupts.INTERRUPTED)
    program()
