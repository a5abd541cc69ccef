"""Several numbers side by side as one value of compiled code: members of an ensemble, or neighbouring modes of one run.

A sum over modes for eight members at once is eight sums that have nothing to do with each other. Written as loops, the
compiler has to find that out, and it seldom does: what it needs is one loop over the modes whose partial sums stay in
registers. Here a row of ``LANES`` numbers is a value that functions compute with, so each member is added up in the
order that is written, whoever sits beside it and whatever vector registers the processor has. So it is with modes of
one run: one loop over many arrays, which the compiler would have to prove distinct.

Arrays are given by their `address`; ``rows`` are C-contiguous with ``LANES`` numbers in the last axis, ``flat`` ones
are read number by number. Nothing is checked: places must be inside.
"""

from __future__ import annotations

from typing import Any, cast

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, models, register_model

LANES = 16  # two registers of AVX-512, four of AVX2: more members than that leave the first cache

# numba and llvmlite come without types.
_ir, _types, _models = cast("Any", ir), cast("Any", types), cast("Any", models)
_WIDE = _ir.VectorType(_ir.DoubleType(), LANES)
_FUSED = ("contract",)


class _Lanes(_types.Type):
    """The type of ``LANES`` doubles."""

    def __init__(self) -> None:
        super().__init__(name=f"Lanes({LANES})")


@register_model(_Lanes)
class _LanesModel(_models.PrimitiveModel):
    """Kept as a vector of LLVM."""

    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _WIDE)


_lanes = _Lanes()


def _place(builder: Any, arguments: Any, width: int, kind: Any) -> Any:
    """Pointer to number ``width``·arguments[1] of the array that begins at the address arguments[0]."""
    offset = builder.mul(arguments[1], _ir.Constant(arguments[1].type, 8 * width))
    return builder.inttoptr(builder.add(arguments[0], offset), kind.as_pointer())


@intrinsic
def _address(typing_context: Any, array: Any) -> Any:
    """Where an array begins. Whoever computes with it keeps the array alive: the loops would else count owners."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        return builder.ptrtoint(data, _ir.IntType(64))

    return _types.int64(array), codegen


def _spread(builder: Any, number: Any) -> Any:
    """One number in all lanes."""
    undefined = _ir.Constant(_WIDE, _ir.Undefined)
    first = builder.insert_element(undefined, number, _ir.Constant(_ir.IntType(32), 0))
    return builder.shuffle_vector(first, undefined, _ir.Constant(_ir.VectorType(_ir.IntType(32), LANES), [0] * LANES))


@intrinsic
def _load(typing_context: Any, rows: Any, at: Any) -> Any:
    """Row ``at`` of an array."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        value = builder.load(_place(builder, arguments, LANES, _WIDE))
        value.align = 8
        return value

    return _lanes(_types.int64, _types.int64), codegen


@intrinsic
def _store(typing_context: Any, rows: Any, at: Any, value: Any) -> Any:
    """Put a value into row ``at`` of an array."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.store(arguments[2], _place(builder, arguments, LANES, _WIDE), align=8)
        return context.get_dummy_value()

    return _types.void(_types.int64, _types.int64, _lanes), codegen


@intrinsic
def _number(typing_context: Any, flat: Any, at: Any) -> Any:
    """Number ``at`` of an array."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(_place(builder, arguments, 1, _ir.DoubleType()))

    return _types.float64(_types.int64, _types.int64), codegen


@intrinsic
def _zero(typing_context: Any) -> Any:
    """Zero in all lanes."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _ir.Constant(_WIDE, [0.0] * LANES)

    return _lanes(), codegen


@intrinsic
def _plus(typing_context: Any, x: Any, y: Any) -> Any:
    """x + y."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.fadd(arguments[0], arguments[1], flags=_FUSED)

    return _lanes(x, y), codegen


@intrinsic
def _times(typing_context: Any, factor: Any, x: Any) -> Any:
    """factor·x; factor is one number."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.fmul(_spread(builder, arguments[0]), arguments[1], flags=_FUSED)

    return _lanes(factor, x), codegen


@intrinsic
def _plus_times(typing_context: Any, y: Any, factor: Any, x: Any) -> Any:
    """y + factor·x; factor is one number."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        product = builder.fmul(_spread(builder, arguments[1]), arguments[2], flags=_FUSED)
        return builder.fadd(arguments[0], product, flags=_FUSED)

    return _lanes(y, factor, x), codegen


@intrinsic
def _product(typing_context: Any, x: Any, y: Any) -> Any:
    """x·y, lane by lane."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.fmul(arguments[0], arguments[1], flags=_FUSED)

    return _lanes(x, y), codegen


@intrinsic
def _plus_product(typing_context: Any, z: Any, x: Any, y: Any) -> Any:
    """z + x·y, lane by lane."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        product = builder.fmul(arguments[1], arguments[2], flags=_FUSED)
        return builder.fadd(arguments[0], product, flags=_FUSED)

    return _lanes(z, x, y), codegen


@intrinsic
def _minus_product(typing_context: Any, z: Any, x: Any, y: Any) -> Any:
    """z − x·y, lane by lane."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        product = builder.fmul(arguments[1], arguments[2], flags=_FUSED)
        return builder.fsub(arguments[0], product, flags=_FUSED)

    return _lanes(z, x, y), codegen


@intrinsic
def _total(typing_context: Any, x: Any) -> Any:
    """The sum of all lanes, by halves."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        value, width = arguments[0], LANES
        index = _ir.IntType(32)
        while width > 1:
            width //= 2
            undefined = _ir.Constant(value.type, _ir.Undefined)
            low, high = (
                builder.shuffle_vector(
                    value, undefined, _ir.Constant(_ir.VectorType(index, width), [at + k for k in range(width)])
                )
                for at in (0, width)
            )
            value = builder.fadd(low, high, flags=_FUSED)
        return builder.extract_element(value, _ir.Constant(index, 0))

    return _types.float64(x), codegen


# As compiled code calls them: numba gives the typing context itself.
address: Any = _address
load: Any = _load
store: Any = _store
number: Any = _number
zero: Any = _zero
plus: Any = _plus
times: Any = _times
plus_times: Any = _plus_times
product: Any = _product
plus_product: Any = _plus_product
minus_product: Any = _minus_product
total: Any = _total
