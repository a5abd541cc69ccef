"""The tab with the map of stability over two numbers."""

from __future__ import annotations

from nicegui import ui

from .session import Session


def build(container: ui.element, session: Session) -> None:
    """Fill the container of a page."""
    with container:
        ui.label("Stability map: not on this page yet; `stridor boundary` draws it.").classes("st-note")
