"""Ctrl-C and SIGTERM: noticed at once, obeyed where nothing is lost by it, never forgotten.

Python raises KeyboardInterrupt wherever it happens to be: between a chunk of steps and the note of its phase, halfway
through writing a file, or inside a callback whose exceptions are printed and dropped. Here a signal is only noted
inside of `held` blocks, which look at it when they can; the second one there interrupts at once. Outside of them the
program's handler raises KeyboardInterrupt, and again until `heard` says that somebody has caught it.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Generator
from dataclasses import dataclass
from types import FrameType
from typing import Any

INTERRUPTED = 130  # exit code: 128 + SIGINT, as shells have it
AGAIN_SECONDS = 1.0
STOPPING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


@dataclass(eq=False)
class HeldSignals:
    """A block that is not to be interrupted in its middle: whether an end was asked for, whether that was met.

    ending: what it has is on its way out and is not to be lost; late: an end was asked for after that.
    """

    asked: bool = False
    met: bool = False
    ending: bool = False
    late: bool = False


@dataclass
class _Program:
    """What this process knows: the blocks it is in, and whether an interrupt is still to be caught by the program."""

    blocks: list[HeldSignals]
    installed: bool = False
    pending: bool = False
    leaving: bool = False
    says: Callable[[sys.UnraisableHookArgs], object] = sys.__unraisablehook__


_program = _Program([])


def install() -> None:
    """Let Ctrl-C, SIGTERM and a lost terminal end this program in good order. For programs, not for libraries."""
    for number in STOPPING:
        # What a parent process has switched off (nohup, a shell's background jobs) stays off.
        if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, _handle)
    insist()


def insist() -> None:
    """Let what `interrupt` raises be raised again until it is `heard`, in a process with a handler of its own.

    Of one that a callback drops there are no words then.
    """
    if hasattr(signal, "SIGALRM"):
        signal.signal(signal.SIGALRM, _again)
        if sys.unraisablehook is not _unraisable:
            _program.says, sys.unraisablehook = sys.unraisablehook, _unraisable
    _program.installed = True


def _unraisable(dropped: sys.UnraisableHookArgs) -> None:
    """What nobody can catch is told, but for an interrupt that will come again."""
    if not (_program.pending and isinstance(dropped.exc_value, KeyboardInterrupt)):
        _program.says(dropped)


def heard() -> None:
    """Say that the interrupt has been caught: it is not raised again."""
    _program.pending = False
    _stop_insisting()


def pending() -> bool:
    """Whether an interrupt was raised that nobody has caught as one."""
    return _program.pending


def check() -> None:
    """Raise KeyboardInterrupt if one was asked for and got lost on its way."""
    if pending():
        raise KeyboardInterrupt


def leave() -> None:
    """From here on a signal ends the process at once, without a word: everything is written."""
    _program.leaving, _program.pending = True, False
    _stop_insisting()


def gone() -> None:
    """From here on a signal changes nothing, as nothing is left but to take the interpreter down.

    It gives signals back to the system on its way, which would end the process by the signal and not with the exit code
    that it has earned. So does Python 3.8 and later at its end where the last text that it has run as code, as for a
    data class amid an import, was left by a KeyboardInterrupt, whoever caught that: what is run here is left by none.
    """
    exec("")
    if _program.installed:
        for number in STOPPING:
            if signal.getsignal(number) is _handle:
                signal.signal(number, signal.SIG_IGN)


@contextlib.contextmanager
def held() -> Generator[HeldSignals]:
    """A block that a first Ctrl-C does not interrupt: it looks at ``asked`` itself and says ``met`` when it ends early.

    What was asked for in the block around this one, and not met there, is asked of this one. What was asked for and not
    met reaches the block around this one, or is raised as KeyboardInterrupt at its end.
    """
    block = HeldSignals(asked=_asked_around())
    before = _take_over()
    _program.blocks.append(block)
    try:
        yield block
    finally:
        _program.blocks.remove(block)
        if before is not None:
            signal.signal(signal.SIGINT, before)
    if block.late or (block.asked and not block.met):
        around = _program.blocks[-1] if _program.blocks else None
        if around is not None and around.ending:
            around.late = True
        elif around is not None and not around.met:
            around.asked = True
        elif block.late:
            _insist()
        else:
            interrupt()


@contextlib.contextmanager
def in_one_piece() -> Generator[None]:
    """A block whose callbacks drop what they raise, and with it what they were called for: an interrupt in there is
    raised at its end, also where a handler that is not ours has raised it inside."""
    with held():
        yield
    check()


@contextlib.contextmanager
def at_once() -> Generator[None]:
    """A part of a `held` block that may be interrupted at any place, also by what was asked for before it: nothing is
    lost by it, and it takes long."""
    if _asked_around():
        interrupt()
    block = HeldSignals(met=True)
    _program.blocks.append(block)
    try:
        yield
    finally:
        _program.blocks.remove(block)


def _asked_around() -> bool:
    """Whether an end was asked for in the block that is under way, and is not met. It is the main thread that ends."""
    if not _program.blocks or threading.current_thread() is not threading.main_thread():
        return False
    around = _program.blocks[-1]
    return around.asked and not around.met


def _take_over() -> Any:
    """The handler of Ctrl-C that is put aside for a block; None where ours is there already or Python's own is not."""
    if threading.current_thread() is not threading.main_thread():
        return None
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler:
        return None
    signal.signal(signal.SIGINT, _handle)
    return before


def _handle(number: int, frame: FrameType | None) -> None:
    del frame
    if _program.leaving:
        os._exit(INTERRUPTED)
    block = _program.blocks[-1] if _program.blocks else None
    if block is not None and not (block.asked or block.met):
        block.asked = True
        return
    if block is not None and block.ending and not block.late:
        block.late = True
        return
    interrupt()


def _again(number: int, frame: FrameType | None) -> None:
    del number, frame
    if _program.pending and (not _program.blocks or _program.blocks[-1].met):
        raise KeyboardInterrupt


def interrupt() -> None:
    """Raise KeyboardInterrupt, and again later should it be dropped by a callback."""
    _insist()
    raise KeyboardInterrupt


def _insist() -> None:
    """KeyboardInterrupt soon, in a program."""
    if _program.installed:
        _program.pending = True
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, AGAIN_SECONDS, AGAIN_SECONDS)


def _stop_insisting() -> None:
    if _program.installed and hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0.0)
