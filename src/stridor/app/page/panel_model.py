"""The left column: the model to scale, and a slider for every number that is moved."""

from __future__ import annotations

import math
from typing import Any

from nicegui import events, ui

from ...case import Case
from .levers import STEPS, Lever, friction_range
from .session import Session
from .state import PageState, checked, different_frictions


def build(container: ui.element, session: Session) -> None:
    """Fill the container of a page; the page's script draws what `lever_data` and the picture say."""
    with container:
        ui.html('<div id="st-model"></div><div id="st-levers" class="st-levers"></div>', sanitize=False)

    def moved(event: events.GenericEventArguments) -> None:
        given: Any = event.args
        if not isinstance(given, dict) or not {"path", "value"} <= set(given):
            return
        path, value, number = str(given["path"]), given["value"], given.get("number")
        if isinstance(number, int):
            session.heard = max(session.heard, number)
        known = {lever.path for lever in session.levers()} | {"mu"}
        if path in known and isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
            session.move(path, float(value))

    ui.on("stridor-move", moved)


def lever_values(state: PageState, found: list[Lever]) -> dict[str, float]:
    """Where each lever stands, by its path."""
    return {"mu": state.mu, **{lever.path: state.changes.get(lever.path, lever.value) for lever in found}}


def _replaced(case: Case) -> str:
    """What the μ of the page stands in for, where that is not one number."""
    own = different_frictions(case)
    given = ", ".join(f"{name} {value:g}" for name, value in own.items())
    return f"The case gives its contacts different μ ({given}): this one replaces them all." if own else ""


def lever_data(session: Session) -> dict[str, Any]:
    """The levers of a case for the script that draws them, μ first."""
    found = session.levers()
    case = checked(session.state.source)
    low, high = friction_range(case)
    friction = Lever("mu", "friction μ", "", session.state.mu, low, high, "Friction")
    rubs = bool(case.contacts or "mu" in case.factor_names)
    return {
        "levers": [
            {
                "path": lever.path, "label": lever.label, "unit": lever.unit, "low": lever.low, "high": lever.high,
                "log": lever.scale == "log", "group": lever.group, "steps": STEPS,
                "note": _replaced(case) if lever is friction else "",
            }
            for lever in ([friction] if rubs else []) + found
        ],
        "values": lever_values(session.state, found),
    }  # fmt: skip
