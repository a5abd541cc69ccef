"""Below the curves: the modes at the μ of the page, and the chosen one in motion with what feeds and changes it."""

from __future__ import annotations

from html import escape

from nicegui import ui

from ...view.animation import animation_shell
from .session import Session

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
  </div>
</section>
"""


def build(container: ui.element, session: Session) -> None:
    """Fill the container of a page; the page's script draws what the picture says."""
    with container:
        ui.html(_PARTS.format(shell=escape(animation_shell())), sanitize=False).classes("st-below")
