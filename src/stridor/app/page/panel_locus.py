"""The middle column: frequency and growth rate over μ, onsets, and the μ of the page as a line that is dragged."""

from __future__ import annotations

from typing import Any

from nicegui import events, ui

from .session import Session

CHARTS = (("frequency", 240), ("growth", 170))  # and their heights in pixels


def build(container: ui.element, session: Session) -> dict[str, int]:
    """Fill the container of a page; returns the numbers of its charts by name, for the page's script."""
    made: dict[str, int] = {}
    with container:
        said = ui.html('<p id="st-said" class="st-said" role="status" aria-live="polite"></p>', sanitize=False)
        said.classes("st-said-box")
        for name, height in CHARTS:
            chart = ui.echart({"series": []}).classes(f"st-chart st-{name}").style(f"height: {height}px")
            made[name] = chart.id
    ui.on("stridor-choose", lambda event: _chosen(session, event))
    return made


def _chosen(session: Session, event: events.GenericEventArguments) -> None:
    given: Any = event.args
    branch = given.get("branch") if isinstance(given, dict) else None
    if branch is None or (isinstance(branch, int) and not isinstance(branch, bool)):
        session.choose(branch)
