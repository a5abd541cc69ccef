"""The right column, below the run: limit cycles at the μ of the page, found without marching through time."""

from __future__ import annotations

from typing import Any

from nicegui import ui

from ...errors import CaseError
from ...view.colours import BLUE, INK, STATUS_COLOURS, VERMILION
from .panel import Panel
from .runs import ENDS, Wish
from .session import Session

CHARTS = (("portrait", 190), ("force", 160), ("slip", 140))
COLOURS = {"normal": BLUE, "tangential": VERMILION, "slip velocity": INK, **STATUS_COLOURS}

_PARTS = """
<h2 id="st-cycle-title">Limit cycles</h2>
<div class="st-run-tools">
  <button type="button" id="st-cycle-go">Find cycles</button>
  <button type="button" id="st-cycle-stop" disabled>Stop</button>
</div>
<progress id="st-cycle-progress" aria-label="Limit cycles are sought" hidden></progress>
<p id="st-cycle-said" class="st-note" role="status">What it swings in for good at the μ of the page: motions
from every growing mode and from pushes are followed exactly, until they come back to where they were.</p>
<div id="st-cycle-found"></div>
<div id="st-cycle-more"></div>
"""


def build(container: ui.element, session: Session) -> None:
    """Fill the container of a page."""
    _Panel(container, session)


class _Panel(Panel):
    """What of it is Python; static/cycle.js draws."""

    def __init__(self, container: ui.element, session: Session) -> None:
        super().__init__(session, "stridorCycle", "cycle.js", stop="stridor-cycle-stop")
        charts: dict[str, int] = {}
        with container:
            ui.html(_PARTS, sanitize=False)
            for name, height in CHARTS:
                chart = ui.echart({"series": []}).classes("st-chart st-cycle-chart").style(f"height: {height}px")
                charts[name] = chart.id
        ui.on("stridor-cycle-hello", lambda: self.script("start", charts, COLOURS))
        ui.on("stridor-cycle", self._go)
        session.on_change(self.stale)

    def _go(self) -> None:
        if self.busy():
            return
        state = self.session.state
        try:
            wish = Wish(self.session.case().to_toml(), state.mu, str(self.session.folder), "cycles")
        except CaseError as error:
            self.refuse(error)
            return
        self.of = state
        self.script("begin", state.mu)
        self.start(wish)

    def heard(self, part: str, content: Any) -> None:
        """Cycles as they are found, and what is said of them."""
        if part in ENDS or part in ("waiting", "begun", "log", "cycle"):
            super().heard(part, content)
