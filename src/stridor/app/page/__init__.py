"""The bench in the browser: a page on this computer on which numbers of a case are moved."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from ...case import Case, load
from ...notebook import Shown
from .server import Server, needed
from .state import Source

HEIGHT = 780  # pixels of a page in a notebook

_running: list[Server] = []


@dataclass(frozen=True, repr=False)
class Page(Shown):
    """A page that is served from this process: its address, and the way to stop it. Notebooks show it."""

    server: Server
    key: str

    @property
    def address(self) -> str:
        """For a browser of this computer; the token in it is the key to the page."""
        return self.server.address(self.key)

    def stop(self) -> None:
        """Stop serving, this page and all others of this process."""
        self.server.stop()

    @property
    def _line(self) -> str:
        return self.address if self.server.serving else "stopped"

    def _repr_html_(self) -> str:
        if not self.server.serving:
            return f"<p>{self._line}</p>"
        style = f"width: 100%; height: {HEIGHT}px; border: 1px solid #ccc"
        frame = f'<iframe title="stridor" src="{self.address}" style="{style}" allow="clipboard-write"></iframe>'
        # Editors that show notebooks under other addresses than those of this computer show no frames of it.
        return f'{frame}<p><a href="{self.address}" target="_blank" rel="noopener">In a window of its own</a></p>'


def app(problem: Case | str | PathLike[str] | None = None, *, port: int = 0) -> Page:
    """A page on which numbers of a case are moved, and what happens to its modes is seen at once.

    problem: a case or the path of its file, None for the two beams. port: 0 for any that is free; pages of one process
    have one server. It serves from a thread, to browsers of this computer alone; a notebook shows the page where the
    result is the last line of a cell, elsewhere its ``address`` is opened in a browser. Raises CaseError for what is no
    case, and AnalysisError where the extra ``app`` is not installed.
    """
    needed()
    source = source_of(problem)
    if not _running or not _running[0].serving:
        _running[:] = [Server({}, port, framed=True)]
    server = _running[0]
    key = f"case-{len(server.opened) + 1}"
    server.opened[key] = source
    if not server.serving:
        server.start()
    return Page(server, key)


def source_of(problem: Case | str | PathLike[str] | None) -> Source:
    """Where the text of a problem comes from. Raises CaseError."""
    if problem is None:
        return Source.template("two-beams")
    if isinstance(problem, Case):
        return Source(problem.title or "case", problem.text, str(Path.cwd()))
    path = Path(problem)
    load(path)  # says what is wrong with the file in its own words
    return Source(path.name, path.read_bytes().decode("utf-8-sig"), str(path.resolve().parent))
