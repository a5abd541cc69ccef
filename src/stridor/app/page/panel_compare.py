"""The verdict of both approaches on the case as it is."""

from __future__ import annotations

from nicegui import ui

from .session import Session


def build(container: ui.element, session: Session) -> None:
    """Fill the container of a page."""
    with container:
        ui.label("Comparison of both approaches: not on this page yet; `stridor compare` does it.").classes("st-note")
