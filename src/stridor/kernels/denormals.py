"""Numbers below 2.2e-308 are zero while compiled loops run.

What is damped and carries no load comes to such numbers within a millisecond of free motion, and a processor takes
thirty times as long for a step that has them. On x86 they are flushed to zero for the thread that asks, as its control
word has it; elsewhere nothing is done.
"""

from __future__ import annotations

import platform
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any, cast

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from .compiled import njit

KNOWN = platform.machine().lower() in ("x86_64", "amd64")
FLUSH = 0x8040  # of the control word: results (bit 15) and operands (bit 6)

# numba and llvmlite come without types.
_ir, _types, _cgutils = cast("Any", ir), cast("Any", types), cast("Any", cgutils)


def _call(builder: Any, name: str, word: Any) -> None:
    """Call an instruction that takes the address of the control word."""
    byte = _ir.IntType(8).as_pointer()
    kind = _ir.FunctionType(_ir.VoidType(), [byte])
    builder.call(_cgutils.get_or_insert_function(builder.module, kind, name), [builder.bitcast(word, byte)])


@intrinsic
def _exchange(typing_context: Any, bits: Any, mask: Any) -> Any:
    """Put ``bits`` in the places of ``mask`` of the control word; the bits that were in these."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        number = _ir.IntType(32)
        word = _cgutils.alloca_once(builder, number)
        _call(builder, "llvm.x86.sse.stmxcsr", word)
        before = builder.load(word)
        bits, mask = (builder.trunc(a, number) for a in arguments)
        kept = builder.and_(before, builder.not_(mask))
        builder.store(builder.or_(kept, builder.and_(bits, mask)), word)
        _call(builder, "llvm.x86.sse.ldmxcsr", word)
        return builder.zext(builder.and_(before, mask), _ir.IntType(64))

    return _types.int64(_types.int64, _types.int64), codegen


@njit(cache=True)
def _nothing(bits: int, mask: int) -> int:  # pragma: no cover - compiled
    return bits


# As compiled code calls it: numba gives the typing context itself.
exchange: Any = _exchange if KNOWN else _nothing


@njit(cache=True)
def flush_denormals(bits: int = FLUSH) -> int:  # pragma: no cover - compiled
    """Let this thread flush, or do as ``bits`` say; what it did before."""
    return exchange(bits, FLUSH)


@contextmanager
def denormals_flushed() -> Generator[None]:
    """Numbers below the smallest normal one are zero inside, for the thread that enters."""
    before = flush_denormals(FLUSH)
    try:
        yield
    finally:
        flush_denormals(before)
