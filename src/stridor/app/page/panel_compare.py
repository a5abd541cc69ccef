"""Both approaches on the case as it is: the verdict of `compare`, and the report that the command line writes."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

from nicegui import context, ui

from ...errors import CaseError
from .panel_run import asset
from .runs import ENDS, Run, What, Wish
from .session import Session, started
from .state import State, file_text

_PARTS = """
<h2 id="st-both-title">Do both approaches agree?</h2>
<div class="st-run-tools">
  <button type="button" id="st-both-go">Compare</button>
  <button type="button" id="st-both-report">Report</button>
  <button type="button" id="st-both-stop" disabled>Stop</button>
</div>
<p id="st-both-said" class="st-note" role="status">Compare lets a small perturbation grow in time and holds it against
the modes; the report computes everything and is saved as a page.</p>
<div id="st-both-tables"></div>
"""


def build(container: ui.element, session: Session) -> None:
    """Fill the container of a page."""
    _Panel(container, session)


class _Panel:
    """What of it is Python; static/compare.js draws."""

    def __init__(self, container: ui.element, session: Session) -> None:
        self.session, self.client = session, context.client
        self.run: Run | None = None
        self.of: State | None = None
        self.what: What = "compare"
        self.reported = ""
        ui.add_body_html(f"<script>{asset('compare.js')}</script>")
        with container:
            ui.html(_PARTS, sanitize=False)
        ui.on("stridor-compare", lambda: self._go("compare"))
        ui.on("stridor-report", lambda: self._go("report"))
        ui.on("stridor-compare-stop", self._stop)
        session.on_change(self._stale)
        session.on_close(self._close)

    def _script(self, name: str, *given: Any) -> None:
        self.client.run_javascript(f"stridorBoth.{name}({', '.join(json.dumps(g) for g in given)})")

    def _go(self, what: What) -> None:
        if self.run is not None and not self.run.over:
            self._script("show", "refused", "what is under way has not ended yet")
            return
        state = self.session.state
        try:
            wish = Wish(_text(state), state.mu, str(_folder(self.session)), what)
        except CaseError as error:
            self._script("show", "refused", str(error))
            return
        self.what = what
        self._script("begin", state.mu, what)
        if what == "report":
            self.reported = state.source.name
        if what == "compare":
            self.of = state
        self.run = started(wish, self.session, self._heard, lambda: self.run)

    def _stop(self) -> None:
        if self.run is not None:
            self.run.stop()

    def _heard(self, part: str, content: Any) -> None:
        if part == "done" and self.what == "report":
            with self.client:
                name = f"{self.reported.removesuffix('.toml')}-report.html"
                ui.download(Path(content["file"]).read_bytes(), name, "text/html")
        if part in ENDS or part in ("waiting", "begun", "log"):
            self._script("show", part, content)

    def _stale(self) -> None:
        of, now = self.of, self.session.state
        if of is not None:
            self._script("stale", (of.model, of.mu) != (now.model, now.mu))

    def _close(self) -> None:
        if self.run is not None:
            self.run.close()


def _text(state: State) -> str:
    """The case as it is, the μ of the page in it and compared at that one alone: the report tells of a case, not of a
    page. Raises CaseError."""
    from ...case import loads

    case = loads(file_text(state), folder=Path(state.source.folder or "."))
    return case.with_({"comparison.mu": [state.mu]}).to_toml()


def _folder(session: Session) -> Path:
    """One for every call: what is of another case is not mixed with it."""
    return Path(tempfile.mkdtemp(prefix="both-", dir=session.folder))
