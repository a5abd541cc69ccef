"""The right column: a run in time of the page's case, started by a button, drawn while it goes on, and heard."""

from __future__ import annotations

import base64
from dataclasses import replace
from typing import Any

from nicegui import events, ui

from ...errors import CaseError
from ...view.colours import BLUE, STATUS_COLOURS, VERMILION
from .panel import Panel, asset
from .runs import ENDS, SOUNDS, Run, Wish
from .session import Session, started

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


class _Panel(Panel):
    """What of the column is Python; static/run.js draws."""

    def __init__(self, container: ui.element, session: Session) -> None:
        super().__init__(session, "stridorRun", "run.js", stop="stridor-run-stop")
        self.file: str | None = None
        self.picture: Any = None
        self.sound: Run | None = None
        ui.add_css(asset("run.css"))
        charts: dict[str, int] = {}
        with container:
            ui.html(_PARTS, sanitize=False)
            for name, height in CHARTS:
                chart = ui.echart({"series": []}).classes("st-chart st-run-chart").style(f"height: {height}px")
                charts[name] = chart.id
        ui.on("stridor-run-hello", lambda: self._hello(charts))
        ui.on("stridor-run", self._go)
        ui.on("stridor-run-listen", self._listen)
        session.on_change(self.stale)

    def _hello(self, charts: dict[str, int]) -> None:
        self.script("start", charts, COLOURS)
        if self.picture is not None:
            self.script("show", "picture", self.picture)

    # -- what the buttons do --------------------------------------------------------------------------------------

    def _go(self) -> None:
        if self.busy():
            return
        try:
            case = self.session.case()
            wish = Wish(
                case.to_toml(), self.session.state.mu, str(self.session.folder),
                max_frequency_hz=case.modal.max_frequency_hz,
            )  # fmt: skip
        except CaseError as error:
            self.refuse(error)
            return
        self.of, self.file, self.picture = self.session.state, None, None
        self.script("begin", self.session.state.mu, self._growing())
        self.start(wish)

    def _growing(self) -> list[float]:
        """Frequencies [Hz] of the modes that grow at the μ of the page, as far as they are known."""
        at = self.session.picture.parts.get("at") or {}
        if self.session.picture.busy and at.get("mu") != self.session.state.mu:
            return []
        return [m["frequency_hz"] for m in at.get("modes", ()) if m.get("unstable")]

    def _listen(self, event: events.GenericEventArguments) -> None:
        slow = event.args.get("slow") if isinstance(event.args, dict) else None
        if not isinstance(slow, int | float) or not 1.0 <= slow <= SLOWEST:
            return
        run, file = self.run, self.file
        if run is None or (self.sound is not None and not self.sound.over):
            return
        if not run.over:
            run.listen(slow)
        elif file is not None:
            wish = replace(run.wish, what="sound", options={"file": file, "slow": slow})
            self.sound = started(wish, self.session, self._sounded, lambda: self.sound, SOUNDS)

    def _sounded(self, part: str, content: Any) -> None:
        """What the sound of a run that has ended says, if none was begun since."""
        of_this = self.sound is not None and self.sound.wish.options["file"] == self.file
        if of_this and part in ("sound", "silent", "refused", "failed"):
            self.heard("silent" if part in ("refused", "failed") else part, content)

    # -- what the run says ----------------------------------------------------------------------------------------

    def heard(self, part: str, content: Any) -> None:
        """Curves as they grow, sound, and the end of a run."""
        if part == "picture":
            self.picture = content
        if part in ENDS and isinstance(content, dict):
            self.file = content["file"]
        if part == "sound":
            content = {**content, "wav": base64.b64encode(content["wav"]).decode("ascii")}
        super().heard(part, content)
