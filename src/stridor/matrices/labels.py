"""A text file that names the freedoms of matrices: a line "node direction" for each, in the matrices' order."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import CaseError
from ..mesh.paths import in_one_line, shown_path
from .model import Labels

_WORDS = {
    **{"x": 1, "y": 2, "z": 3, "ux": 1, "uy": 2, "uz": 3, "rotx": 4, "roty": 5, "rotz": 6},
    **{str(k): k for k in range(7)},
}
_LARGEST = 2**53


def read_labels(path: str | Path, where: str = "labels") -> Labels:
    """Labels (n,) from a file: the number of a node, negative for an internal freedom, and its direction.

    Directions are 1 to 6, or x, y, z, ux … rotz; 0, or nothing, is a scalar or internal freedom. Blanks, commas or
    semicolons separate; # begins a comment. Raises CaseError at `where`, or at "FILE, line N".
    """
    file = Path(path)
    try:
        text = file.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        raise CaseError(where, shown_path(file), "no such file") from None
    except UnicodeDecodeError:
        raise CaseError(where, shown_path(file), "is no text file") from None
    except (OSError, ValueError) as error:  # ValueError: a name with a NUL
        raise CaseError(where, shown_path(file), f"cannot be read: {in_one_line(error)}") from error
    nodes: list[int] = []
    directions: list[int] = []
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.partition("#")[0].replace(",", " ").replace(";", " ").split()
        if not words:
            continue
        node = words[0].removeprefix("-")
        direction = _WORDS.get(words[1].lower()) if len(words) > 1 else 0
        whole = node.isascii() and node.isdigit() and len(node) < 17 and int(node) < _LARGEST
        if len(words) > 2 or not whole or direction is None:
            accepted = 'must be the number of a node and a direction, 1 to 6 or x, y, z, such as "1201 3"'
            raise CaseError(f"{file.name}, line {number}", line.strip(), accepted)
        nodes.append(int(words[0]))
        directions.append(direction)
    if not nodes:
        raise CaseError(where, shown_path(file), 'names no freedoms; write a line "node direction" for each')
    return Labels(np.array(nodes, dtype=np.int64), np.array(directions, dtype=np.int64))
