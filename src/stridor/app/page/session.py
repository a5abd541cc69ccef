"""One open page: its state with what came before, what was computed for it, and who wants to know."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ...case import Case
from ...errors import CaseError
from .folders import new_folder
from .levers import Lever, levers
from .runs import Queue, Run, Wish
from .state import History, PageState, Source, checked, file_text, first_state, from_link, to_link
from .worker import BENCH, Program, Worker

LARGEST_MU = 10.0  # friction coefficient of the page: what is beyond takes minutes, and is none
Loop = Callable[..., object]  # calls a function in the thread of the page: loop.call_soon_threadsafe


@dataclass
class Picture:
    """What was computed last, piece by piece, as plain data (`bench.Bench` says which pieces there are).

    number: of the newest question, done: of the newest that is answered in full. problem: why the newest state has no
    picture; the pieces are then of the last that had one.
    """

    parts: dict[str, Any] = field(default_factory=dict[str, Any])
    number: int = 0
    done: int = 0
    problem: str = ""

    @property
    def busy(self) -> bool:
        """Whether something is being computed."""
        return self.done < self.number


class Session:
    """A page that somebody has open. All calls are made in the thread of the page; heard are they there as well.

    own: the sources that links may name, `source`: what the page opens with. folder: a temporary folder that is this
    page's alone and goes with it. Raises CaseError for a source that is no case.
    """

    def __init__(self, source: Source, own: Mapping[str, Source], call: Loop, *, program: Program = BENCH) -> None:
        self._own, self._call = own, call
        self._history = History(first_state(source))
        self._listeners: list[Callable[[], None]] = []
        self._viewers: list[Callable[[str, Any], None]] = []
        self._enders: list[Callable[[], None]] = []
        self._runs: list[Run] = []
        self._ending = threading.Lock()
        self._moving: object = None
        self._opening: tuple[int, PageState] | None = None  # question and state of a case that is not on the page yet
        self._given_up: set[int] = set()  # questions of those that never came to be on it
        self.picture = Picture()
        self.heard = 0  # number of the newest move of the page that has come here
        self.folder = new_folder()
        self._worker = Worker(self._answered, program)
        self.closed = False
        self.study: Mapping[str, Any] | None = None  # samples of a study, for the map

    # -- what a panel reads ---------------------------------------------------------------------------------------

    @property
    def state(self) -> PageState:
        """What the page is at."""
        return self._history.now

    def case(self) -> Case:
        """The case with its changes. Raises CaseError where these do not go together."""
        return self.state.case()

    def levers(self) -> list[Lever]:
        """What can be moved, with the values and ranges of the case as it was opened."""
        return levers(checked(self.state.source))

    @property
    def history(self) -> History:
        """What undo and redo walk along."""
        return self._history

    def file_text(self) -> str:
        """The case file with the changes in it. Raises CaseError."""
        return file_text(self.state)

    def link(self) -> str:
        """The state as letters for the address, "" where it is too large for one."""
        return to_link(self.state, self._own)

    def later(self, function: Callable[..., object], *given: Any) -> None:
        """Call a function in the thread of the page, unless the page is gone by then."""
        self._call(lambda: None if self.closed else function(*given))

    # -- who wants to know ----------------------------------------------------------------------------------------

    def on_change(self, callback: Callable[[], None]) -> None:
        """Call back after every change of the state."""
        self._listeners.append(callback)

    def on_picture(self, callback: Callable[[str, Any], None]) -> None:
        """Call back with every piece of the picture: its name and its content; "declined": why a case that was to be
        opened is not on the page."""
        self._viewers.append(callback)

    def on_end(self, callback: Callable[[], None]) -> None:
        """Call back when nothing is left of the page, in any thread."""
        self._enders.append(callback)

    # -- what a control does --------------------------------------------------------------------------------------

    def go(self, state: PageState, *, moving: object = None) -> None:
        """To another state. moving: what is being moved, of which all moves in a row are one step for undo."""
        together = moving is not None and moving == self._moving
        if state == self.state:
            return
        self._moving = moving
        if state.source != self.state.source:
            self.picture.parts.clear()
        self._history.go(state, together=together)
        self._changed()

    def move(self, path: str, value: float) -> None:
        """A lever to a value; "mu" is the friction coefficient of the page."""
        self.put({path: value}, moving=path)

    def put(self, numbers: Mapping[str, float], *, moving: object = None) -> None:
        """Several levers to values, as one step for undo. moving: as for `go`."""
        state = self.state
        for path, value in numbers.items():
            if path == "mu":
                state = replace(state, mu=min(max(float(value), 0.0), LARGEST_MU))
            else:
                state = state.with_change(path, value)
        self.go(state, moving=moving)

    def choose(self, branch: int | None) -> None:
        """A mode by its number, None for none."""
        self.go(replace(self.state, branch=branch))

    def look(self, tab: str) -> None:
        """At another tab; nothing is computed for that."""
        self._history.now = replace(self.state, tab=tab)
        if self._opening is not None:
            self._opening = self._opening[0], replace(self._opening[1], tab=tab)
        self._listened()

    def reset(self) -> None:
        """All numbers as the case was opened."""
        self.go(replace(first_state(self.state.source), tab=self.state.tab))

    def open(self, source: Source) -> None:
        """Another case in place of this one, once its model is built: until then, and where that is refused, the page
        stays as it is. Raises CaseError where reading it is enough to refuse it."""
        self._try_out(replace(first_state(source), tab=self.state.tab))

    def restore(self, link: str) -> None:
        """The state of a link; one of another case takes the place of this one as with `open`. Raises CaseError, and
        the page stays as it is."""
        state = from_link(link, self._own)
        state.case()
        if state == self.state:
            self._changed()  # a page that has just been opened: nothing is computed yet
        elif state.source != self.state.source:
            self._try_out(state)
        else:
            self.go(state)

    def undo(self) -> None:
        """One step back."""
        self._moving = None
        if self._history.undo():
            self._changed()

    def redo(self) -> None:
        """One step forth."""
        self._moving = None
        if self._history.redo():
            self._changed()

    def compute(self) -> None:
        """Ask for the picture of the state. A case that is being opened is given up for it: the newest wins."""
        self.picture.number = self._worker.ask(self.state)
        if self._opening is not None:
            self._given_up.add(self._opening[0])
            name = self._opened().source.name
            self._tell("declined", f"{name} was not opened: something else was asked for before its model was built")

    def started(self, run: Run) -> None:
        """A run of this page, which ends with it."""
        self._runs = [r for r in self._runs if not r.over or (r.process and r.process.is_alive())] + [run]

    def drop(self, run: Run) -> None:
        """Nobody wants what a run computes."""
        run.close()
        threading.Thread(target=run.end, name="stridor-run-end").start()

    def leave(self) -> None:
        """The page is gone. Returns at once; the rest goes on in a thread."""
        if not self.closed:
            self.close()
            threading.Thread(target=self.end, name="stridor-page-end").start()

    def close(self) -> None:
        """Let its processes end, and hear nothing of them any more. Returns at once; `end` is the rest of it."""
        if self.closed:
            return
        self.closed = True
        self._worker.close()
        for run in reversed(self._runs):  # those that wait first: the place of one under way is not for them
            run.close()

    def end(self) -> None:
        """Wait until its processes are gone, and remove its folder only then: they write into it."""
        with self._ending:
            for process in (self._worker, *self._runs):
                process.end()
            shutil.rmtree(self.folder, ignore_errors=True)
        for callback in self._enders:
            callback()

    # -- inside ---------------------------------------------------------------------------------------------------

    def _try_out(self, state: PageState) -> None:
        """Build the model of another case, and go to it where that is not refused (`_decided`)."""
        if state == self.state:
            if self._opening is not None:
                self.compute()
            return
        if self._opening is not None:
            self._given_up.add(self._opening[0])
        self.picture.number = self._worker.ask(state)
        self._opening = self.picture.number, state
        self._tell("progress", {"what": f"{state.source.name} is being opened"})

    def _opened(self) -> PageState:
        """The state that was being opened, which it is no more."""
        assert self._opening is not None, "asked for where there is one"
        state, self._opening = self._opening[1], None
        self._tell("progress", {"what": ""})
        return state

    def _decided(self, part: str, content: Any) -> bool:
        """With the first that is heard of a case that is being opened: whether it is the page's now. Else the page
        stays at the one before, whose picture is asked for again, as the process has turned to the other meanwhile."""
        state = self._opened()
        if part in ("refused", "failed"):
            name = f"{state.source.name} was not opened: " if part == "failed" else ""
            self._given_up.add(self.picture.number)
            self._changed()
            self._tell("declined", f"{name}{content}")
            return False
        self._moving = None
        self.picture.parts.clear()
        self._history.go(state)
        self._listened()
        return True

    def _tell(self, part: str, content: Any) -> None:
        for viewer in list(self._viewers):
            viewer(part, content)

    def _listened(self) -> None:
        for listener in list(self._listeners):
            listener()

    def _changed(self) -> None:
        self.compute()
        self._listened()

    def _answered(self, number: int, part: str, content: Any) -> None:
        """A piece of an answer, in the thread that listens."""
        self._call(self._heard, number, part, content)

    def _heard(self, number: int, part: str, content: Any) -> None:
        if self.closed:
            return
        if number in self._given_up:
            return
        if self._opening is not None and number == self._opening[0] and not self._decided(part, content):
            return
        picture = self.picture
        if part == "done":
            picture.done = max(picture.done, number)
        elif part in ("refused", "unanswered", "failed"):
            picture.problem = str(content)
            picture.done = max(picture.done, number)
        else:
            picture.parts[part] = content
        if part == "locus":
            picture.problem = ""
            picture.parts.pop("onsets", None)
        self._tell(part, content)


def refused(call: Callable[[], None]) -> str:
    """What is wrong with what was asked, in the words of the command line; "" where nothing is."""
    try:
        call()
    except CaseError as error:
        return str(error)
    return ""


def started(
    wish: Wish, session: Session, heard: Callable[[str, Any], None], newest: Callable[[], Run | None],
    queue: Queue | None = None,
) -> Run:  # fmt: skip
    """A run whose parts are heard in the thread of the page as long as it is the ``newest`` of its panel."""
    made: list[Run] = []

    def told(part: str, content: Any) -> None:
        if not made or newest() is made[0]:
            heard(part, content)

    made.append(Run(wish, lambda part, content: session.later(told, part, content), queue))
    session.started(made[0])
    return made[0]
