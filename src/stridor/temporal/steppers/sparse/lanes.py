"""Block rows of a symmetric product in vector registers.

A block of d rows is read row by row as vectors of L lanes, L the next power of two, and the vectors on freedoms are
kept at a stride of L, so that every access to them is one whole register. With r_k the k-th row of block A_ij,

    S_k += r_k ∘ x_j  (its lanes summed once, at the end of the row: y_i),    y_j += Σ_k r_k x_ik .

Six multiply-adds do the eighteen of a 3×3 block. What lies after a row of d < L numbers is read along: it meets the
zero in the spare lane of x, and what it leaves in the spare lane of y is not used. The compiler does not find this by
itself in scalar code, so it is written in its own instructions.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

LANES = {1: 1, 2: 2, 3: 4}
DOUBLE, INT = ir.DoubleType(), ir.IntType(64)
DOUBLE_BYTES = 8
BYTE = ir.IntType(8).as_pointer()
READ_SOON = [ir.Constant(ir.IntType(32), v) for v in (0, 3, 1)]  # to be read, kept in all caches, data
AHEAD = 1152  # numbers of the matrix fetched ahead of use: the fastest of 0 to 3456 that were tried on hex8 blocks


def _rows(d: int) -> Any:
    """The intrinsic for blocks of d × d, d = 2 or 3."""

    @intrinsic
    def rows(typing: Any, ptr: Any, col: Any, val: Any, x: Any, y: Any, lo: Any, hi: Any) -> Any:
        """y += rows lo … hi − 1 of the matrix's upper block rows (ptr, col, val) times x, and their transpose's."""
        signature = types.void(ptr, col, val, x, y, types.int64, types.int64)

        def build(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            arrays = [
                context.make_array(kind)(context, builder, value)
                for kind, value in zip(sig.args[:5], args[:5], strict=True)
            ]
            _emit(builder, d, *(a.data for a in arrays), *args[5:])
            return context.get_dummy_value()

        return signature, build

    return rows


def _emit(builder: Any, d: int, ptr: Any, col: Any, val: Any, x: Any, y: Any, lo: Any, hi: Any) -> None:
    """The loops over rows and over their blocks, the diagonal block first."""
    lanes = LANES[d]
    vector = ir.VectorType(DOUBLE, lanes)
    kind = ir.FunctionType(vector, [vector] * 3)
    fetch = ir.FunctionType(ir.VoidType(), [BYTE] + [ir.IntType(32)] * 3)
    prefetch = cgutils.get_or_insert_function(builder.module, fetch, "llvm.prefetch.p0i8")
    multiply_add = cgutils.get_or_insert_function(builder.module, kind, f"llvm.fmuladd.v{lanes}f64")

    def constant(value: int) -> Any:
        return ir.Constant(INT, value)

    def at(base: Any, index: Any) -> Any:
        """Where L numbers from base[index] on lie."""
        return builder.bitcast(builder.gep(base, [index]), vector.as_pointer())

    def load(base: Any, index: Any) -> Any:
        return builder.load(at(base, index), align=DOUBLE_BYTES)

    def everywhere(value: Any) -> Any:
        one = builder.insert_element(ir.Constant(vector, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
        mask = ir.Constant(ir.VectorType(ir.IntType(32), lanes), [0] * lanes)
        return builder.shuffle_vector(one, ir.Constant(vector, ir.Undefined), mask)

    def block_row(p: Any, k: int) -> Any:
        return load(val, builder.add(builder.mul(p, constant(d * d)), constant(k * d)))

    zero = ir.Constant(vector, [0.0] * lanes)
    sums = [cgutils.alloca_once(builder, vector) for _ in range(d)]
    with cgutils.for_range(builder, hi, start=lo, intp=INT) as row:
        row_start = builder.mul(row.index, constant(lanes))
        first = builder.load(builder.gep(ptr, [row.index]))
        last = builder.load(builder.gep(ptr, [builder.add(row.index, constant(1))]))
        own = load(x, row_start)
        spread = [everywhere(builder.extract_element(own, ir.Constant(ir.IntType(32), k))) for k in range(d)]
        for k in range(d):
            builder.store(builder.fmul(block_row(first, k), own), sums[k])
        with cgutils.for_range(builder, last, start=builder.add(first, constant(1)), intp=INT) as block:
            p = block.index
            column_start = builder.mul(builder.sext(builder.load(builder.gep(col, [p])), INT), constant(lanes))
            ahead = builder.gep(val, [builder.add(builder.mul(p, constant(d * d)), constant(AHEAD))])
            builder.call(prefetch, [builder.bitcast(ahead, BYTE), *READ_SOON])
            other, given = load(x, column_start), load(y, column_start)
            for k in range(d):
                part = block_row(p, k)
                builder.store(builder.call(multiply_add, [part, other, builder.load(sums[k])]), sums[k])
                given = builder.call(multiply_add, [part, spread[k], given])
            builder.store(given, at(y, column_start), align=DOUBLE_BYTES)
        total = zero
        for k in range(d):
            lane = builder.load(sums[k])
            value = builder.extract_element(lane, ir.Constant(ir.IntType(32), 0))
            for other_lane in range(1, d):
                value = builder.fadd(value, builder.extract_element(lane, ir.Constant(ir.IntType(32), other_lane)))
            total = builder.insert_element(total, value, ir.Constant(ir.IntType(32), k))
        builder.store(builder.fadd(load(y, row_start), total), at(y, row_start), align=DOUBLE_BYTES)


rows2, rows3 = _rows(2), _rows(3)
