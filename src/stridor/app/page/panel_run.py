"""The right column: a run in time of the page's case, started by a button, drawn while it goes on, and heard."""

from __future__ import annotations

import asyncio
import base64
import json
from importlib import resources
from typing import Any

from nicegui import context, events, ui

from ...errors import CaseError
from ...view.style import BLUE, STATUS_COLOURS, VERMILION
from .running import sound_of_file
from .runs import ENDS, Run, Wish
from .session import Session, started
from .state import State

CHARTS = (("acceleration", 150), ("force", 150), ("status", 80), ("sonogram", 170), ("portrait", 190))
SLOWEST = 1000.0
COLOURS = {"normal": BLUE, "tangential": VERMILION, **STATUS_COLOURS}

_PARTS = """
<h2 id="st-run-title">Run in time</h2>
<div class="st-run-tools">
  <button type="button" id="st-run-go">Run</button>
  <button type="button" id="st-run-stop" disabled>Stop</button>
  <button type="button" id="st-run-listen" disabled>Listen</button>
  <label for="st-run-slow">slower</label>
  <select id="st-run-slow"><option value="1">1 ×</option><option value="2">2 ×</option><option value="5">5 ×</option>
    <option value="10">10 ×</option><option value="50">50 ×</option></select>
</div>
<progress id="st-run-progress" max="1" value="0" aria-label="Steps done of the run in time" hidden></progress>
<p id="st-run-said" class="st-note" role="status">Marches the case at the μ of the page through its load phases: stick,
slip and separation as they come.</p>
"""


def build(container: ui.element, session: Session) -> None:
    """Fill the container of a page."""
    _Panel(container, session)


class _Panel:
    """What of the column is Python; static/run.js draws."""

    def __init__(self, container: ui.element, session: Session) -> None:
        self.session, self.client = session, context.client
        self.run: Run | None = None
        self.of: State | None = None
        self.file: str | None = None
        self.picture: Any = None
        ui.add_css(asset("run.css"))
        ui.add_body_html(f"<script>{asset('run.js')}</script>")
        charts: dict[str, int] = {}
        with container:
            ui.html(_PARTS, sanitize=False)
            for name, height in CHARTS:
                chart = ui.echart({"series": []}).classes("st-chart st-run-chart").style(f"height: {height}px")
                charts[name] = chart.id
        ui.on("stridor-run-hello", lambda: self._hello(charts))
        ui.on("stridor-run", self._go)
        ui.on("stridor-run-stop", self._stop)
        ui.on("stridor-run-listen", self._listen)
        session.on_change(self._stale)
        session.on_close(self._close)

    def _script(self, name: str, *given: Any) -> None:
        self.client.run_javascript(f"stridorRun.{name}({', '.join(json.dumps(g) for g in given)})")

    def _hello(self, charts: dict[str, int]) -> None:
        self._script("start", charts, COLOURS)
        if self.picture is not None:
            self._script("show", "picture", self.picture)

    # -- what the buttons do --------------------------------------------------------------------------------------

    def _go(self) -> None:
        if self.run is not None and not self.run.over:
            self._script("show", "refused", "what is under way has not ended yet")
            return
        try:
            case = self.session.case()
            wish = Wish(
                case.to_toml(), self.session.state.mu, str(self.session.folder),
                max_frequency_hz=case.modal.max_frequency_hz,
            )  # fmt: skip
        except CaseError as error:
            self._script("show", "refused", str(error))
            return
        self.of, self.file, self.picture = self.session.state, None, None
        self._script("begin", self.session.state.mu, self._growing())
        self.run = started(wish, self.session, self._heard, lambda: self.run)

    def _growing(self) -> list[float]:
        """Frequencies [Hz] of the modes that grow at the μ of the page, as far as they are known."""
        at = self.session.picture.parts.get("at") or {}
        if self.session.picture.busy and at.get("mu") != self.session.state.mu:
            return []
        return [m["frequency_hz"] for m in at.get("modes", ()) if m.get("unstable")]

    def _stop(self) -> None:
        if self.run is not None:
            self.run.stop()

    async def _listen(self, event: events.GenericEventArguments) -> None:
        slow = event.args.get("slow") if isinstance(event.args, dict) else None
        if not isinstance(slow, int | float) or not 1.0 <= slow <= SLOWEST:
            return
        if self.run is not None and not self.run.over:
            self.run.listen(slow)
        elif self.file is not None:
            self._heard(*await asyncio.to_thread(sound_of_file, self.file, slow))

    # -- what the run says ----------------------------------------------------------------------------------------

    def _heard(self, part: str, content: Any) -> None:
        if part == "picture":
            self.picture = content
        if part in ENDS and isinstance(content, dict):
            self.file = content["file"]
        if part == "sound":
            content = {**content, "wav": base64.b64encode(content["wav"]).decode("ascii")}
        self._script("show", part, content)

    def _stale(self) -> None:
        """Say that what is drawn is of other numbers than those of the page now."""
        of, now = self.of, self.session.state
        if of is not None:
            self._script("stale", (of.model, of.mu) != (now.model, now.mu))

    def _close(self) -> None:
        if self.run is not None:
            self.run.close()


def asset(name: str) -> str:
    """A file of the page."""
    return (resources.files("stridor.app.page") / "static" / name).read_text(encoding="utf-8")
