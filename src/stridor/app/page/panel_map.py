"""The tab with the map of stability over two numbers, refined while one looks; a click goes there."""

from __future__ import annotations

import math
from typing import Any

from nicegui import events, ui

from ...errors import CaseError
from ...view.colours import VERMILION
from .levers import Lever, friction_range
from .panel import Panel
from .runs import ENDS, Wish
from .session import Session
from .state import PageState, checked, friction_changes

FRICTION = "mu"
WIDE = (0.3, 3.0)  # times a number that spans decades: the range that is offered

_PARTS = """
<form id="st-map-form" class="st-run-tools" onsubmit="return false">
  <fieldset><legend>across</legend><label for="st-map-x">number</label><select id="st-map-x"></select>
    <label for="st-map-x-low">from</label><input id="st-map-x-low" inputmode="decimal">
    <label for="st-map-x-high">to</label><input id="st-map-x-high" inputmode="decimal"><span id="st-map-x-unit"></span>
  </fieldset>
  <fieldset><legend>up</legend><label for="st-map-y">number</label><select id="st-map-y"></select>
    <label for="st-map-y-low">from</label><input id="st-map-y-low" inputmode="decimal">
    <label for="st-map-y-high">to</label><input id="st-map-y-high" inputmode="decimal"><span id="st-map-y-unit"></span>
  </fieldset>
  <button type="button" id="st-map-go">Draw map</button>
  <button type="button" id="st-map-stop" disabled>Stop</button>
</form>
<p id="st-map-said" class="st-note" role="status">Where modes begin to grow over two numbers: curves are traced, coarse
first and then finer. A click on the map, or Enter on a point of it, moves the bench there.</p>
"""


def build(container: ui.element, session: Session) -> None:
    """Fill the container of a page."""
    _Panel(container, session)


class _Panel(Panel):
    """What of it is Python; static/map.js draws."""

    def __init__(self, container: ui.element, session: Session) -> None:
        super().__init__(session, "stridorMap", "map.js", stop="stridor-map-stop")
        self.axes: tuple[str, str] = ("", "")
        self.source = session.state.source
        self.picture: Any = None
        with container:
            ui.html(_PARTS, sanitize=False)
            self.chart = ui.echart({"series": []}).classes("st-chart st-map-chart").style("height: 520px")
        ui.on("stridor-map-hello", self._hello)
        ui.on("stridor-map", self._go)
        ui.on("stridor-map-to", self._to)
        ui.on("stridor-map-sample", self._sample)
        session.on_change(self._follow)

    def _hello(self) -> None:
        self.script("start", self.chart.id, VERMILION)
        self._offer()
        if self.session.study is not None:
            self.script("samples", self.session.study)
            self.session.look("map")
        if self.picture is not None:
            self.script("show", "map", self.picture)

    def _offer(self) -> None:
        """The numbers that there are, of the case that is open."""
        low, high = friction_range(checked(self.session.state.source))
        numbers = [{"path": FRICTION, "words": "friction μ", "unit": "", "low": low, "high": high}]
        for lever in self.session.levers():
            if lever.path != FRICTION:
                ends = _range(lever)
                numbers.append(
                    {"path": lever.path, "words": lever.label, "unit": lever.unit, "low": ends[0], "high": ends[1]}
                )
        self.script("offer", numbers)

    # -- what is asked --------------------------------------------------------------------------------------------

    def _go(self, event: events.GenericEventArguments) -> None:
        if self.busy():
            return
        state = self.session.state
        try:
            options = _options(event.args)
            changes = friction_changes(state) if FRICTION not in (options["x"], options["y"]) else {}
            wish = Wish(state.case().with_(changes).to_toml(), None, str(self.session.folder), "map", options=options)
        except CaseError as error:
            self.refuse(error)
            return
        self.of, self.axes = state, (options["x"], options["y"])
        self.script("begin")
        self.start(wish)

    def heard(self, part: str, content: Any) -> None:
        """A map, ever finer, and what is said of it."""
        if part == "map":
            self.picture = content
        if part in ENDS or part in ("waiting", "begun", "log", "map"):
            super().heard(part, content)
        if part == "map":
            self._follow()

    def _to(self, event: events.GenericEventArguments) -> None:
        """To a point of the map."""
        given = event.args if isinstance(event.args, dict) else {}
        values = [given.get("x"), given.get("y")]
        if not all(self.axes) or not all(isinstance(v, int | float) and math.isfinite(v) for v in values):
            return
        known = {FRICTION, *(lever.path for lever in self.session.levers())}
        numbers = {path: float(value) for path, value in zip(self.axes, values, strict=True) if path in known}  # type: ignore[arg-type]  # ty: ignore[invalid-argument-type]
        self.session.put(numbers, moving="map" if given.get("held") else None)

    def _sample(self, event: events.GenericEventArguments) -> None:
        """To a sample of the study: all of its numbers."""
        study, row = self.session.study, event.args.get("row") if isinstance(event.args, dict) else None
        if study is None or not isinstance(row, int) or not 0 <= row < len(study["grows"]):
            return
        self.session.put({path: values[row] for path, values in study["numbers"].items()})

    def _follow(self) -> None:
        """Where the page is on the map, and whether the map is of another case by now."""
        of, now = self.of, self.session.state
        if now.source != self.source:
            self.source = now.source
            self.of, self.axes, self.picture = None, ("", ""), None
            if self.run is not None:
                self.session.drop(self.run)
                self.run = None
            self._offer()
            self.script("clear")
            return
        if of is None:
            return
        at = [now.mu if path == FRICTION else now.changes.get(path) for path in self.axes]
        known = {lever.path: lever.value for lever in self.session.levers()}
        at = [known.get(path) if value is None else value for path, value in zip(self.axes, at, strict=True)]
        self.script("here", at, _others(of, self.axes) != _others(now, self.axes))


def _others(state: PageState, axes: tuple[str, str]) -> Any:
    """What of a state is neither of the two numbers."""
    mu = None if FRICTION in axes else state.mu
    return mu, {path: value for path, value in state.changes.items() if path not in axes}


def _range(lever: Lever) -> tuple[float, float]:
    if lever.scale == "log" and lever.value > 0:
        return WIDE[0] * lever.value, WIDE[1] * lever.value
    return lever.low, lever.high


def _options(given: Any) -> dict[str, Any]:
    """What is to be mapped, as the page asks for it. Raises CaseError."""
    given = given if isinstance(given, dict) else {}
    x, y = str(given.get("x", ""))[:200], str(given.get("y", ""))[:200]
    if x == y:
        raise CaseError("the map", x, "two different numbers")
    ranges: dict[str, tuple[float, float]] = {}
    for name in ("x_range", "y_range"):
        ends = given.get(name)
        if not (
            isinstance(ends, list)
            and len(ends) == 2
            and all(isinstance(v, int | float) and math.isfinite(v) for v in ends)
            and ends[0] < ends[1]
        ):
            raise CaseError(f"the range of {x if name == 'x_range' else y}", ends, "two numbers, the smaller one first")
        ranges[name] = (float(ends[0]), float(ends[1]))
    return {"x": x, "y": y, **ranges}
