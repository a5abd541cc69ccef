"""Figures that are made and not drawn, for tests that look at words, names and numbers: most of the time of a report, and
half of that of many a verb, goes into pictures. What is drawn is looked at by tests of figures, of the gallery, and of
documentation that is followed.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Generator
from pathlib import Path
from typing import IO
from unittest import mock

from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from stridor.view import report
from stridor.view.page_parts import ReportFigure


def _written(_: Figure, target: str | Path | IO[bytes], **__: object) -> None:
    if isinstance(target, str | Path):
        Path(target).write_bytes(b"not drawn")
    else:
        target.write(b"not drawn")


@contextlib.contextmanager
def nothing_drawn() -> Generator[None]:
    """Files of figures appear, with nothing in them."""
    with (
        mock.patch.object(Figure, "savefig", _written),
        mock.patch.object(ConstrainedLayoutEngine, "execute"),
    ):
        yield


@contextlib.contextmanager
def drawn_alone(*names: str) -> Generator[None]:
    """Of the figures of a report those with such names; the files of all others appear with nothing in them."""
    sections = report.sections

    def marked(inputs: report.ReportInputs) -> list[report.Chapter]:
        chapters = sections(inputs)
        for part in (p for chapter in chapters for p in chapter.parts):
            if isinstance(part, ReportFigure) and part.name not in names:
                part.figure.set_layout_engine(None)
                part.figure.savefig = functools.partial(_written, part.figure)
        return chapters

    with mock.patch.object(report, "sections", marked):
        yield
