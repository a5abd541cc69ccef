"""The files beside this package that pages are made of."""

from __future__ import annotations

from importlib import resources


def template_text(name: str) -> str:
    """The text of one of them."""
    return (resources.files("stridor.view") / "templates" / name).read_text(encoding="utf-8")
