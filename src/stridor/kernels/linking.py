"""Machine code that is closed in itself, so that it does the same in every process.

A compiled function carries copies of the functions that it calls, optimised once more in their new place: sums may be
taken in another order there and multiply-adds fused differently. numba marks these copies as weak: the first
definition of that name in the process is taken for all. In a process that compiles, that is the callee's own, which
was there first; in one that loads the finished caller, nobody has asked for the callee, and it is the copy. Both are
right, but they round differently, and which one runs depends on what ran before. Here the copies become private to
the caller's object code, after all optimisation: it is the code that a process with a filled cache would run.
"""

from __future__ import annotations

from typing import Any, cast

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

from ..interrupts import in_one_piece

SHARED = ("linkonce_odr", "weak_odr")  # copies of functions; of what runs on other threads
_Library: Any = JITCodeLibrary
_Compiler: Any = Compiler


class ClosedLibrary(_Library):
    """The code of one function, whose copies of other functions nobody else sees or replaces."""

    def _finalize_final_module(self) -> None:
        own = cast("Any", self)
        # What other functions are compiled with: as numba leaves it, with names that can be met again. Made first,
        # because a private function could not be linked by its name.
        own._finalized = True
        own._get_module_for_linking()
        own._finalized = False
        if own._shared_module is own._final_module:
            own._shared_module = own._final_module.clone()
        for function in own._final_module.functions:
            if not function.is_declaration and function.linkage.name in SHARED:
                function.linkage = "internal"
        # The code comes in a callback of its generator: interrupted there it would be lost, and found missing later.
        with in_one_piece():
            super()._finalize_final_module()


class InnerLibrary(ClosedLibrary):
    """The code of a function that only compiled functions call: it is optimised in them, so that here it is only
    brought down to its size."""

    def _optimize_final_module(self) -> None:
        own = cast("Any", self)
        passes, builder = own._codegen._module_pass_manager(
            loop_vectorize=False, slp_vectorize=False, opt=own._codegen._opt_level, cost="cheap"
        )
        with own._recorded_timings.record("Module passes (cheap optimization for refprune)", builder):
            passes.run(own._final_module, builder)


class Closed(_Compiler):
    """numba's compiler, writing into a ``ClosedLibrary``."""

    library: type[Any] = ClosedLibrary

    def compile_extra(self, func: Any) -> Any:
        """Compile from bytecode."""
        state = cast("Any", self).state
        if state.library is None:
            state.library = self.library(state.targetctx.codegen(), func.__qualname__)
            state.library.enable_object_caching()
        return super().compile_extra(func)


class Inner(Closed):
    """The same, writing into an ``InnerLibrary``."""

    library = InnerLibrary
