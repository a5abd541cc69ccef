"""The program: parse, call the API, show."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any


class _Callable(ModuleType):
    """The package is what ``st.app(case)`` calls: it has that name in stridor as soon as any of it is imported."""

    def __call__(self, *given: Any, **named: Any) -> Any:
        from .page import app

        return app(*given, **named)


sys.modules[__name__].__class__ = _Callable
