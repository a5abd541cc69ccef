"""Arrays without reference counts, for compiled loops that call many small functions per step.

Each array that compiled code hands on is counted by an atomic instruction; with thirty arrays in a
handful of functions that costs more than the arithmetic of a small model. The caller of the loop owns
the arrays for longer than the loop runs, so the loop may borrow them.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

# numba comes without types.
_types: Any = types


@intrinsic
def _borrow(typing_context: Any, held: Any) -> Any:
    """The same array, sharing its data but not its owner, or the same named tuple with each of its arrays borrowed,
    those of tuples in it too. Valid only while the owners live."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _lent(context, builder, signature.return_type, arguments[0])

    return held(held), codegen


def _lent(context: Any, builder: Any, kind: Any, held: Any) -> Any:
    if isinstance(kind, _types.BaseTuple):
        members = [_lent(context, builder, each, builder.extract_value(held, k)) for k, each in enumerate(kind.types)]
        return context.make_tuple(builder, kind, members)
    if not isinstance(kind, _types.Array):
        return held
    owned = context.make_array(kind)(context, builder, held)
    lent = context.make_array(kind)(context, builder)
    for name in ("nitems", "itemsize", "data", "shape", "strides"):
        setattr(lent, name, getattr(owned, name))
    lent.meminfo = cgutils.get_null_value(lent.meminfo.type)
    lent.parent = cgutils.get_null_value(lent.parent.type)
    return lent._getvalue()


# As compiled code calls it: numba gives the typing context itself.
borrow: Any = _borrow
