"""The program as a user meets it, without a process of its own: exit code, standard output, standard error.

For what is printed and written. What is about processes (signals, locks, limits, kernels that are compiled or found,
the end of the interpreter) starts real ones.
"""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
import warnings
from collections.abc import Generator
from pathlib import Path
from unittest import mock

from stridor.app import cli


def stridor(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """What ``stridor words…`` in a folder ends with. Warnings of libraries stand in stderr, as in a process."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.chdir(cwd),
        mock.patch.dict(os.environ),
        mock.patch.object(sys, "argv", ["stridor", *words]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        _warnings_shown(),
    ):
        code = cli._guarded(cli._program)
    return subprocess.CompletedProcess(["stridor", *words], code, out.getvalue(), err.getvalue())


@contextlib.contextmanager
def _warnings_shown() -> Generator[None]:
    """Warnings printed as Python does by itself, and each time: others may have met the same one before."""

    def show(message: Warning | str, category: type[Warning], filename: str, lineno: int, *_: object) -> None:
        sys.stderr.write(warnings.formatwarning(message, category, filename, lineno))

    with warnings.catch_warnings():
        warnings.resetwarnings()
        warnings.simplefilter("always")
        for unseen in (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning):
            warnings.simplefilter("ignore", unseen)
        with mock.patch.object(warnings, "showwarning", show):
            yield
