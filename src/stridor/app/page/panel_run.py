"""The right column: a run in time, started by a button."""

from __future__ import annotations

from nicegui import ui

from .session import Session


def build(container: ui.element, session: Session) -> None:
    """Fill the container of a page."""
    with container:
        ui.label("Run in time: not on this page yet; `stridor simulate` does it.").classes("st-note")
