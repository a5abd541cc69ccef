"""Figures that are made and not drawn, for tests that look at words, names and numbers: most of the time of a report, and
half of that of many a verb, goes into pictures. What is drawn is looked at by tests of figures, of the gallery, and of
documentation that is followed.
"""

from __future__ import annotations

import contextlib
from collections.abc import Generator
from pathlib import Path
from typing import IO
from unittest import mock

from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine


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
