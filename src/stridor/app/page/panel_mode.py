"""Below the curves: the modes at the μ of the page, and the chosen one in motion with what feeds and changes it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape
from typing import Any

from nicegui import ui

from ...errors import CaseError
from ...view.mode_page import animation_shell
from .panel import Panel
from .runs import Wish
from .session import Session
from .state import PageState

_PARTS = """
<section class="st-modes" aria-labelledby="st-modes-title">
  <h2 id="st-modes-title">Modes</h2><p id="st-modes-said" class="st-note"></p>
  <div id="st-modes-list" class="st-scroll" tabindex="0" role="region" aria-label="Modes at this friction"></div>
</section>
<section class="st-mode" aria-labelledby="st-mode-title">
  <h2 id="st-mode-title">Mode</h2>
  <p id="st-mode-none" class="st-note">Choose a mode in the list, or click on its curve: it is shown in motion here.</p>
  <div id="st-mode-shown" hidden>
    <iframe id="st-mode-frame" title="The chosen mode in motion" sandbox="allow-scripts" srcdoc="{shell}"></iframe>
    <p id="st-mode-undrawn" class="st-note" hidden></p>
    <div id="st-mode-facts"></div>
    <h3>What a change of 1 % does to its growth</h3>
    <div id="st-tornado"></div>
    <div id="st-tornado-ask" class="st-run-tools" hidden>
      <button type="button" id="st-tornado-go"></button><button type="button" id="st-tornado-stop" hidden>Stop</button>
      <p id="st-tornado-said" class="st-note" role="status"></p>
    </div>
  </div>
</section>
"""


def build(container: ui.element, session: Session) -> None:
    """Fill the container of a page; the page's script draws what the picture says."""
    with container:
        ui.html(_PARTS.format(shell=escape(animation_shell())), sanitize=False).classes("st-below")
        _Panel(session)


def is_of(shape: Mapping[str, Any], state: PageState) -> bool:
    """Whether a shape is that of the mode, at the μ and of the model that the page is at, and has its eigenvalue."""
    found = tuple(shape.get(name) for name in ("branch", "mu", "stamp"))
    return found == (state.branch, state.mu, state.stamp) and "growth_rate" in shape


class _Panel(Panel):
    """Sensitivities of the chosen mode where they take a while; static/tornado.js asks for them and shows how far they
    are."""

    def __init__(self, session: Session) -> None:
        super().__init__(session, "stridorTornado", "tornado.js", stop="stridor-sensitivities-stop")
        ui.on("stridor-sensitivities", self._go)
        session.on_change(self._follow)

    def _go(self) -> None:
        state, shape = self.session.state, self.session.picture.parts.get("shape") or {}
        if self.busy():
            return
        if not is_of(shape, state):
            self.refuse("the mode is being computed still")
            return
        value = shape["growth_rate"], 2 * math.pi * shape["frequency_hz"]
        options = {"mu": state.mu, "branch": state.branch, "eigenvalue": value}
        try:
            text = self.session.case().to_toml()
        except CaseError as error:
            self.refuse(error)
            return
        self.of = state
        self.start(Wish(text, state.mu, str(self.session.folder), "sensitivities", options=options))

    def _follow(self) -> None:
        """Those of another mode, or of other numbers, nobody asks for any more."""
        of, now = self.of, self.session.state
        if of is not None and (of.model, of.mu, of.branch) != (now.model, now.mu, now.branch):
            self.of, run, self.run = None, self.run, None
            if run is not None and not run.over:
                self.session.drop(run)
