"""The page as a whole: its head, three columns, tabs; on narrow screens one column. Light and dark."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from nicegui import Client, events, ui

from ...case import templates
from ...errors import CaseError, StridorError
from ...view.colours import BLUE, GREEN, INK, VERMILION
from . import panel_compare, panel_cycle, panel_locus, panel_map, panel_mode, panel_model, panel_run
from .levers import friction_range
from .panel import asset
from .session import Session, refused
from .state import LARGEST_TEXT, Source, checked

if TYPE_CHECKING:
    from .server import Server

TOO_LARGE = f"no case file, which is a text in TOML, named NAME.toml, of at most {LARGEST_TEXT / 1e6:g} MB"
SECTIONS = (
    ("left", "Model and numbers"),
    ("middle", "Modes over friction"),
    ("right", "Run in time, limit cycles, comparison"),
)
TABS = (("bench", "Bench"), ("map", "Stability map"))
# Browsers may give frames of other sites no storage, and 127.0.0.1 is one in a notebook of localhost: without this
# nothing starts there.
STORAGE = """<script>try { window.sessionStorage.length } catch {
  Object.defineProperty(window, "sessionStorage", { value: {}, configurable: true })
}</script>"""
COLOURS = {"stable": BLUE, "unstable": VERMILION, "ink": INK, "speed": GREEN}


def page(server: Server) -> None:
    """Register the page with NiceGUI: every time it is opened it has a session of its own."""

    @ui.page("/")
    async def _bench(client: Client, case: str = "") -> None:
        try:
            session = server.session(case)
        except StridorError as error:
            ui.label(str(error))
            return
        client.on_delete(session.leave)
        Layout(client, session)


class Layout:
    """What of a page is Python; the rest is static/page.js, which is told what to draw."""

    def __init__(self, client: Client, session: Session) -> None:
        self.client, self.session = client, session
        self._source: Source | None = None
        self.dark = ui.dark_mode(None)
        ui.add_head_html(STORAGE)
        ui.add_css(asset("page.css"))
        for file in ("measure.js", "page.js"):
            ui.add_body_html(f"<script>{asset(file)}</script>")
        self._head()
        self.problem = ui.html('<div id="st-problem" class="st-problem" role="alert" hidden></div>', sanitize=False)
        with ui.tabs(on_change=lambda event: self._tab(str(event.value))).classes("st-tabs") as tabs:
            for name, words in TABS:
                ui.tab(name, label=words)
        self.tabs = tabs
        tabs.set_value("bench")
        # Both are always there, one of them unseen: what is told of a picture finds its place whichever tab is open.
        self.panels = {name: _panel(words) for name, words in TABS}
        with self.panels["bench"].classes("st-bench"):
            charts = self._bench()
        panel_map.build(self.panels["map"].classes("st-map"), session)
        self.panels["map"].set_visibility(False)
        ui.on("stridor-hello", lambda event: self._hello(event, charts))
        ui.on("stridor-bye", session.leave)
        session.on_change(self._follow)
        session.on_picture(self._show)

    # -- what is on it --------------------------------------------------------------------------------------------

    def _head(self) -> None:
        session = self.session
        with ui.element("header").classes("st-head"):
            ui.html('<h1>stridor</h1><span id="st-title" class="st-title"></span>', sanitize=False)
            with ui.element("div").classes("st-tools"):
                self.undo = _button("Undo", session.undo)
                self.redo = _button("Redo", session.redo)
                _button("Reset", session.reset).tooltip("All numbers as in the case file")
                with _button("Examples"), ui.menu():
                    for name in templates():
                        ui.menu_item(name, on_click=partial(self._try, partial(_example, session, name)))
                upload = ui.upload(on_upload=self._uploaded, on_rejected=lambda: self._say(TOO_LARGE), auto_upload=True,
                                   max_file_size=LARGEST_TEXT)  # fmt: skip
                upload.props('accept=".toml" aria-hidden="true"').classes("st-upload")
                _button("Open file").on("click", js_handler=f"() => getElement({upload.id}).pickFiles()")
                _button("Save file", self._download)
                _button("Copy link", self._copy_link)
                _button("Light/dark", partial(self._script, "turnDark"))

    def _bench(self) -> dict[str, int]:
        left, middle, right = (_section(name, words) for name, words in SECTIONS)
        panel_model.build(left, self.session)
        charts = panel_locus.build(middle, self.session)
        panel_mode.build(middle, self.session)
        with right:
            run, cycle, compare = (ui.element("div").classes(f"st-{name}") for name in ("run", "cycle", "compare"))
        panel_run.build(run, self.session)
        panel_cycle.build(cycle, self.session)
        panel_compare.build(compare, self.session)
        return charts

    # -- what the page is told ------------------------------------------------------------------------------------

    def _script(self, name: str, *given: Any) -> None:
        self.client.run_javascript(f"stridor.{name}({', '.join(json.dumps(g) for g in given)})")

    def _hello(self, event: events.GenericEventArguments, charts: dict[str, int]) -> None:
        """The script is there: it has the link of its address, if there is one."""
        self._script("start", charts, COLOURS)
        link = str(event.args.get("link") or "") if isinstance(event.args, dict) else ""
        if not link or not self._try(lambda: self.session.restore(link)):
            self._follow()
            self.session.compute()

    def _follow(self) -> None:
        """The controls after a change of the state."""
        session = self.session
        state = session.state
        if state.source != self._source:
            if self._source is not None:
                self._script("forget")
            self._source = state.source
            self._script("levers", panel_model.lever_data(session))
        low, high = friction_range(checked(state.source))
        self._script("follow", {
            "values": panel_model.lever_values(state, session.levers()), "branch": state.branch, "link": session.link(),
            "low": low, "high": high, "name": state.source.name, "heard": session.heard,
        })  # fmt: skip
        self.undo.set_enabled(session.history.can_undo)
        self.redo.set_enabled(session.history.can_redo)
        if self.tabs.value != state.tab:
            self.tabs.set_value(state.tab)
        for name, panel in self.panels.items():
            panel.set_visibility(name == state.tab)

    def _show(self, part: str, content: Any) -> None:
        self._script("show", part, content, self.session.picture.busy)

    def _say(self, problem: str) -> None:
        self._script("problem", problem)

    # -- what the buttons do --------------------------------------------------------------------------------------

    def _try(self, call: Callable[[], None]) -> bool:
        """Whether it went well; what is wrong is said otherwise, and the page stays as it is."""
        problem = refused(call)
        self._say(problem)
        return not problem

    def _tab(self, tab: str) -> None:
        if tab != self.session.state.tab:
            self.session.look(tab)

    async def _uploaded(self, event: events.UploadEventArguments) -> None:
        data = await event.file.read()
        if len(data) > LARGEST_TEXT:
            self._say(f"{event.file.name}: {TOO_LARGE}")
            return
        self._try(lambda: self.session.open(_source_of(event.file.name, data)))

    def _download(self) -> None:
        name = self.session.state.source.name.removesuffix(".toml")
        try:
            text = self.session.file_text()
        except CaseError as error:
            self._say(str(error))
            return
        ui.download(text.encode(), f"{name}.toml", "application/toml")

    def _copy_link(self) -> None:
        if not self.session.link():
            self._say("the case is too large for a link: save the file")
            return
        self._script("copyLink")


def _button(words: str, call: Callable[[], object] | None = None) -> ui.button:
    return ui.button(words, on_click=call, color=None).props("flat dense no-caps")


def _panel(words: str) -> ui.element:
    return ui.element("div").classes("st-panel").props(f'role=tabpanel aria-label="{words}"')


def _section(name: str, words: str) -> ui.element:
    return ui.element("section").classes(f"st-{name}").props(f'aria-label="{words}"')


def _example(session: Session, name: str) -> None:
    session.open(Source.template(name))


def _source_of(name: str, data: bytes) -> Source:
    """An uploaded file as text. Raises CaseError, in the words of `load`."""
    try:
        return Source(name[:200], data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise CaseError(name[:200], None, f"not UTF-8 text (byte {error.start}); save the file as UTF-8") from None
