"""numba's ``njit``, with our folder and our linking."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from types import FunctionType
from typing import Any

import numba
from numba.core import config, types

from .folder import kernel_folder
from .linking import Closed, Inner
from .quicker import compare_quickly
from .store import KernelCache

_settings: Any = config
_njit: Any = numba.njit

compare_quickly()


def njit(
    function: FunctionType | None = None, *, cache: bool = False, allocates: bool = True, **options: Any
) -> Any:
    """Compile a function at its first call, with the options of numba's ``njit``; ``cache`` keeps the machine code.

    allocates: False for one that makes no arrays, but for views of others: it then counts no references, whose code
    takes a seventh of the time to compile. Used as ``@njit``, ``@njit(cache=True, …)`` or
    ``njit(cache=True)(function)``. Where no folder can be written the function is compiled by every process that calls
    it.
    """

    def made(plain: FunctionType) -> Any:
        # Nobody calls them from C: an entry for that takes a sixth of the time to compile.
        # What cannot be divided is not a number, as in NumPy: an exception would be code beside every division.
        chosen: dict[str, Any] = {"no_cfunc_wrapper": True, "error_model": "numpy", "_nrt": allocates, **options}
        dispatcher: Any = _njit(pipeline_class=Closed, **chosen)(plain)
        if _settings.DISABLE_JIT:  # which gives the plain function back
            return dispatcher
        # Compiled code calls another form, made when it does: without an entry for Python, which takes a third of the
        # time where a hundred arrays are handed over.
        inner: Any = _njit(pipeline_class=Inner, no_cpython_wrapper=True, **chosen)(plain)
        dispatcher.get_call_template = partial(_without_literals, inner.get_call_template)
        dispatcher.get_overload = inner.get_overload
        if cache:
            folder = kernel_folder()
            if folder is not None:
                marked = {**options, "allocates": allocates}
                dispatcher._cache = KernelCache(plain, folder, marked)
                inner._cache = KernelCache(plain, folder, {**marked, "no_cpython_wrapper": True})
        return dispatcher

    return made if function is None else made(function)


def _without_literals(template_of: Callable[..., Any], args: Any, keywords: Any) -> Any:
    """How compiled code calls a function: one form for all whole numbers, where numba makes one for each constant."""

    def kind(of: Any) -> Any:
        return types.int64 if isinstance(of, types.IntegerLiteral) else of

    return template_of(tuple(map(kind, args)), {key: kind(of) for key, of in keywords.items()})
