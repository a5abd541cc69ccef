"""The server of the pages: on this computer only, with a token in its address, until it is stopped."""

from __future__ import annotations

import asyncio
import atexit
import contextlib
import logging
import os
import signal
import socket
import threading
import webbrowser
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field
from typing import Any

from ... import interrupts
from ...errors import AnalysisError, CaseError
from ...studies.processes import prepared
from ...view.mode_page import viewer_script
from .folders import remove_left
from .guard import Guard, new_token
from .session import Session
from .state import Source, template_sources
from .worker import LOADED

HOST = "127.0.0.1"
PATIENCE = 10.0  # seconds that a page may be away, as behind a busy browser, before it counts as closed
START = 30.0  # seconds


@dataclass(eq=False)
class Server:
    """A server of pages: the cases they open with by key, the port (0: any that is free), the token of its address;
    study: samples that the maps show (`study_rows`)."""

    opened: dict[str, Source]
    port: int
    token: str = field(default_factory=new_token)
    framed: bool = False
    study: Mapping[str, Any] | None = None
    sessions: set[Session] = field(default_factory=set[Session])
    _server: Any = None
    _socket: socket.socket | None = None
    _thread: threading.Thread | None = None

    def address(self, key: str = "") -> str:
        """Where the page of a case is, with the token; of the first case where none is named."""
        return f"http://{HOST}:{self.port}/{self.token}/{f'?case={key}' if key else ''}"

    @property
    def serving(self) -> bool:
        """Whether it answers in a thread."""
        return self._thread is not None and self._thread.is_alive()

    def run(self, *, ready: Callable[[str], None] | None = None) -> None:
        """Serve until Ctrl-C, SIGTERM or the end of the terminal. ready is called with the address once it answers."""
        self._prepare(ready)
        with contextlib.suppress(KeyboardInterrupt), _hung_up(self._server):
            self._server.run(sockets=[self._socket])
        with interrupts.held() as block:  # it is how a page is ended, and what it leaves behind is removed
            interrupts.heard()
            self._end()
            block.met = True

    def start(self) -> Server:
        """Serve in a thread, as in a notebook; returns once it answers. Raises AnalysisError where it does not."""
        answering = threading.Event()
        self._prepare(lambda _: answering.set())

        def serving() -> None:
            self._server.run(sockets=[self._socket])
            self._end()

        atexit.register(self.stop)
        self._thread = threading.Thread(target=serving, name="stridor-page", daemon=True)
        self._thread.start()
        if not answering.wait(START):
            raise AnalysisError("the page does not start")
        return self

    def stop(self) -> None:
        """Stop serving; pages that are open end with it. The end of this process does so too."""
        atexit.unregister(self.stop)
        if self._server is not None:
            self._server.should_exit = True
        if self._thread is not None:
            self._thread.join(START)

    def source_of(self, key: str) -> Source:
        """The case that a page opens with."""
        return self.opened.get(key) or next(iter(self.opened.values()))

    def session(self, key: str) -> Session:
        """A new page. Raises CaseError where its case cannot be read any more."""
        loop = asyncio.get_running_loop()

        def call(function: Callable[..., None], *given: Any) -> None:
            with contextlib.suppress(RuntimeError):  # the loop has ended: so has the page
                loop.call_soon_threadsafe(function, *given)

        own = {**template_sources(), **{source.key: source for source in self.opened.values()}}
        session = Session(self.source_of(key), own, call)
        session.study = self.study
        self.sessions.add(session)
        session.on_end(lambda: self.sessions.discard(session))
        return session

    def _prepare(self, ready: Callable[[str], None] | None) -> None:
        nicegui, uvicorn = needed()
        from fastapi import FastAPI

        from .layout import page

        remove_left()
        prepared(LOADED)
        self._socket = bound(self.port)
        self.port = self._socket.getsockname()[1]
        outer = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
        outer.add_route(f"/{self.token}/viewer.js", _viewer)
        page(self)
        # No bar over the page while something is fetched: it has no name, and the page says itself what it does.
        nicegui.app.config.quasar_config["loadingBar"] = {"skipHijack": True}
        nicegui.ui.run_with(
            outer, title="stridor", dark=None, mount_path=f"/{self.token}", show_welcome_message=False,
            reconnect_timeout=PATIENCE, tailwind=False, binding_refresh_interval=None, favicon="〰️",
        )  # fmt: skip
        guard = Guard(outer, self.token, self.port, framed=self.framed)
        logging.getLogger("nicegui").setLevel(logging.ERROR)
        config = uvicorn.Config(
            guard, host=HOST, port=self.port, log_level="error", lifespan="on", timeout_graceful_shutdown=1,
            server_header=False, ws_max_size=LARGEST_MESSAGE,
        )  # fmt: skip
        self._server = _announcing(uvicorn, config, lambda: ready(self.address()) if ready else None, self._close)

    def _close(self) -> None:
        """Let all processes of all pages end, before one by one is waited for."""
        for session in list(self.sessions):
            session.close()

    def _end(self) -> None:
        self._close()
        for session in list(self.sessions):
            session.end()


async def _viewer(_: Any) -> Any:
    """What draws modes of solids with the graphics card, for pages that have one to show."""
    from fastapi import Response

    return Response(viewer_script(), media_type="text/javascript", headers={"cache-control": "max-age=86400"})


LARGEST_MESSAGE = 1_000_000  # bytes that a page may send at once by its socket


@contextlib.contextmanager
def _hung_up(server: Any) -> Generator[None]:
    """The end of the terminal is an end like the others, of which uvicorn knows nothing."""
    number: Any = getattr(signal, "SIGHUP", None)
    if number is None or signal.getsignal(number) is signal.SIG_IGN:  # nohup
        yield
        return

    def end(_: int, __: object) -> None:
        server.should_exit = True

    before = signal.signal(number, end)
    try:
        yield
    finally:
        signal.signal(number, before)


def _announcing(uvicorn: Any, config: Any, ready: Callable[[], None], ending: Callable[[], None]) -> Any:
    """A server that says when it answers, and when it begins to end."""
    server = uvicorn.Server(config)
    before, after = server.startup, server.shutdown

    async def startup(*given: Any, **named: Any) -> None:
        await before(*given, **named)
        if not server.should_exit:
            ready()

    async def shutdown(*given: Any, **named: Any) -> None:
        ending()
        await after(*given, **named)

    server.startup, server.shutdown = startup, shutdown
    return server


def bound(port: int) -> socket.socket:
    """A socket on this computer alone; port 0: any that is free. Raises CaseError where it is taken."""
    made = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    if os.name == "posix":
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        made.bind((HOST, port))
    except OSError as error:
        made.close()
        why = error.strerror or str(error)
        raise CaseError("--port", port, f"cannot be listened on ({why}); give another one, or none for any") from None
    return made


def needed() -> tuple[Any, Any]:
    """NiceGUI and uvicorn. Raises AnalysisError where the extra is not installed."""
    try:
        import nicegui
        import uvicorn
    except ImportError as error:
        need = "the page needs nicegui, which is not installed: pip install 'stridor[app]'"
        raise AnalysisError(need) from error
    return nicegui, uvicorn


def show(address: str) -> None:
    """Open a browser, where there is one; nothing is said where there is none."""
    threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()
