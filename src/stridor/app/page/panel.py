"""What panels have in common that start something long by a button: it runs once at a time and ends with the page."""

from __future__ import annotations

import json
from importlib import resources
from typing import Any

from nicegui import context, ui

from .runs import Run, Wish
from .session import Session, started
from .state import PageState


class Panel:
    """The Python side of a panel; ``script`` is the name of its side in the browser, the object of a file of static/.

    run: what was started last, of: the state that it was started with. The event ``stop`` stops it.
    """

    def __init__(self, session: Session, script: str, file: str, *, stop: str) -> None:
        self.session, self.client = session, context.client
        self.run: Run | None = None
        self.of: PageState | None = None
        self._script_name = script
        ui.add_body_html(f"<script>{asset(file)}</script>")
        ui.on(stop, self._stop)

    def script(self, name: str, *given: Any) -> None:
        """Call a function of the script."""
        self.client.run_javascript(f"{self._script_name}.{name}({', '.join(json.dumps(g) for g in given)})")

    def busy(self) -> bool:
        """Whether what was started is under way still, which is said then."""
        under_way = self.run is not None and not self.run.over
        if under_way:
            self.refuse("what is under way has not ended yet")
        return under_way

    def refuse(self, words: object) -> None:
        """Say why nothing is started."""
        self.script("show", "refused", str(words))

    def start(self, wish: Wish) -> None:
        """Start what is wished for; its parts go to `heard`."""
        self.run = started(wish, self.session, self.heard, lambda: self.run)

    def heard(self, part: str, content: Any) -> None:
        """A part of what was started, as `Run` tells them."""
        self.script("show", part, content)

    def stale(self) -> None:
        """Say whether what is shown is of other numbers than those of the page now."""
        of, now = self.of, self.session.state
        if of is not None:
            self.script("stale", (of.model, of.mu) != (now.model, now.mu))

    def _stop(self) -> None:
        if self.run is not None:
            self.run.stop()


def asset(name: str) -> str:
    """A file of the page."""
    return (resources.files("stridor.app.page") / "static" / name).read_text(encoding="utf-8")
