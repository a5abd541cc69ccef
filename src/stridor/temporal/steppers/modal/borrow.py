"""Arrays without reference counts, for compiled loops that call many small functions per step.

Each array that compiled code hands on is counted by an atomic instruction; with thirty arrays in a
handful of functions that costs more than the arithmetic of a small model. The caller of the loop owns
the arrays for longer than the loop runs, so the loop may borrow them.
"""

from __future__ import annotations

from typing import Any

from numba.core import cgutils
from numba.extending import intrinsic


@intrinsic
def _borrow(typing_context: Any, array: Any) -> Any:
    """The same array, sharing its data but not its owner. Valid only while the owner lives."""
    signature = array(array)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        owned = context.make_array(signature.return_type)(context, builder, arguments[0])
        lent = context.make_array(signature.return_type)(context, builder)
        for name in ("nitems", "itemsize", "data", "shape", "strides"):
            setattr(lent, name, getattr(owned, name))
        lent.meminfo = cgutils.get_null_value(lent.meminfo.type)
        lent.parent = cgutils.get_null_value(lent.parent.type)
        return lent._getvalue()

    return signature, codegen


# As compiled code calls it: numba gives the typing context itself.
borrow: Any = _borrow
