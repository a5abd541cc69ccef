"""Both approaches on the case as it is: the verdict of `compare`, and the report that the command line writes."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from nicegui import ui

from ...errors import CaseError
from .panel import Panel
from .runs import ENDS, What, Wish
from .session import Session
from .state import PageState, file_text

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


class _Panel(Panel):
    """What of it is Python; static/compare.js draws."""

    def __init__(self, container: ui.element, session: Session) -> None:
        super().__init__(session, "stridorBoth", "compare.js", stop="stridor-compare-stop")
        self.what: What = "compare"
        self.reported = ""
        with container:
            ui.html(_PARTS, sanitize=False)
        ui.on("stridor-compare", lambda: self._go("compare"))
        ui.on("stridor-report", lambda: self._go("report"))
        session.on_change(self.stale)

    def _go(self, what: What) -> None:
        if self.busy():
            return
        state = self.session.state
        try:
            wish = Wish(_text(state), state.mu, str(_folder(self.session)), what)
        except CaseError as error:
            self.refuse(error)
            return
        self.what = what
        self.script("begin", state.mu, what)
        if what == "report":
            self.reported = state.source.name
        if what == "compare":
            self.of = state
        self.start(wish)

    def heard(self, part: str, content: Any) -> None:
        """Tables of a comparison, or the report as a file."""
        if part == "done" and self.what == "report":
            with self.client:
                name = f"{self.reported.removesuffix('.toml')}-report.html"
                ui.download(Path(content["file"]).read_bytes(), name, "text/html")
        if part in ENDS or part in ("waiting", "begun", "log"):
            super().heard(part, content)


def _text(state: PageState) -> str:
    """The case as it is, the μ of the page in it and compared at that one alone: the report tells of a case, not of a
    page. Raises CaseError."""
    from ...case import loads

    case = loads(file_text(state), folder=Path(state.source.folder or "."))
    return case.with_({"comparison.mu": [state.mu]}).to_toml()


def _folder(session: Session) -> Path:
    """One for every call: what is of another case is not mixed with it."""
    return Path(tempfile.mkdtemp(prefix="both-", dir=session.folder))
