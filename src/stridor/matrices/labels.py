"""A text file that names the freedoms of matrices: a line "node direction" for each, in the matrices' order."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .model import Labels
from .numbers import whole_number
from .source import source_at

_WORDS = {
    **{"x": 1, "y": 2, "z": 3, "ux": 1, "uy": 2, "uz": 3, "rotx": 4, "roty": 5, "rotz": 6},
    **{str(k): k for k in range(7)},
}
_LARGEST = 2**53 - 1


def read_labels(path: str | Path, where: str = "labels") -> Labels:
    """Labels (n,) from a file: the number of a node, negative for an internal freedom, and its direction.

    Directions are 1 to 6, or x, y, z, ux … rotz; 0, or nothing, is a scalar or internal freedom. Blanks, commas or
    semicolons separate; # begins a comment. Raises CaseError at `where`, or at "FILE, line N".
    """
    source = source_at(Path(path), where)
    try:
        text = source.text().decode("utf-8")
    except UnicodeDecodeError:
        source.refuse("is no text file")
    nodes: list[int] = []
    directions: list[int] = []
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.partition("#")[0].replace(",", " ").replace(";", " ").split()
        if not words:
            continue
        node = whole_number(words[0], lowest=-_LARGEST)
        direction = _WORDS.get(words[1].lower()) if len(words) > 1 else 0
        if len(words) > 2 or node is None or node > _LARGEST or direction is None:
            accepted = 'must be the number of a node and a direction, 1 to 6 or x, y, z, such as "1201 3"'
            source.refuse_line(number, line, accepted)
        nodes.append(node)
        directions.append(direction)
    if not nodes:
        source.refuse('names no freedoms; write a line "node direction" for each')
    return Labels(np.array(nodes, dtype=np.int64), np.array(directions, dtype=np.int64))
