"""The program as a user meets it, without a process of its own: exit code, standard output, standard error.

For what is printed and written. What is about processes (signals, locks, limits, kernels that are compiled or found,
the end of the interpreter) starts real ones.
"""

from __future__ import annotations

import contextlib
import fcntl
import io
import os
import pty
import struct
import subprocess
import sys
import termios
import traceback
import warnings
from collections.abc import Generator
from pathlib import Path
from unittest import mock

from stridor.app import cli, output


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


def on_terminal(*words: str, cwd: Path, **environment: str) -> tuple[int, str]:
    """Exit code of ``stridor words…`` on a terminal of 80 columns, and what stands on it.

    In a process forked off this one: loading everything again would take longer than most verbs."""
    child, terminal = pty.fork()
    if child == 0:
        code = 70  # of a program that fails by itself
        try:
            fcntl.ioctl(0, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
            code = _taken_over(words, cwd, environment)
        except BaseException:
            traceback.print_exc(file=sys.__stderr__)
        finally:
            os._exit(code)
    text = b""
    with contextlib.suppress(OSError):  # the other end is closed
        while part := os.read(terminal, 65536):
            text += part
    os.close(terminal)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), text.decode()


def _taken_over(words: tuple[str, ...], cwd: Path, environment: dict[str, str]) -> int:
    """The program in a process that has nothing else to do: its streams, folder and environment are replaced."""
    for name in ("NO_COLOR", "COLUMNS"):
        os.environ.pop(name, None)
    os.environ |= {"TERM": "xterm"} | environment
    os.chdir(cwd)
    sys.argv = ["stridor", *words]
    sys.stdin, sys.stdout, sys.stderr = (os.fdopen(number, mode) for number, mode in enumerate("rww"))
    # Whether there are colours is settled where a console is made.
    output.stdout.__init__(highlight=False, soft_wrap=True)
    output.stderr.__init__(stderr=True, highlight=False, soft_wrap=True)
    with _warnings_shown():
        code = cli._guarded(cli._program)
    sys.stdout.flush()
    sys.stderr.flush()
    return code


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
