"""What the heads of a mesh file claim, held against how long the file is: before a reader makes room for it."""

from __future__ import annotations

import re
import struct
from pathlib import Path

from ..errors import CaseError
from ..reading import size_words
from .paths import shown_path

# Sections of Gmsh's files, whose next line counts what follows; in binary files of format 4.1 whole numbers do.
_GMSH = re.compile(rb"^\$(\w+)[^\n]*\n(?=([^\n]{0,200}))", re.MULTILINE)
_COUNTED = (b"Nodes", b"Elements", b"PhysicalNames", b"Entities", b"Periodic", b"NodeData", b"ElementData")
_VTK = re.compile(
    rb"^(POINTS|CELLS|CELL_TYPES|POINT_DATA|CELL_DATA|DIMENSIONS|METADATA|OFFSETS|CONNECTIVITY|FIELD \S+)"
    rb"[ \t]+(\d+)(?:[ \t]+(\d+))?(?:[ \t]+(\d+))?",
    re.MULTILINE,
)
_VTU = re.compile(rb"(NumberOfPoints|NumberOfCells|NumberOfComponents)\s*=\s*[\"']\s*(\d+)")
_CELLS = {
    ".vtu": re.compile(rb"NumberOfCells\s*=\s*[\"']\s*(\d+)"),
    ".vtk": re.compile(rb"^CELL_TYPES[ \t]+(\d+)", re.MULTILINE),
}
_LOOKED_AT = 2**26  # bytes at each end, in which the heads are
_TIMES = 2048  # what zlib can make of a byte, and to spare


def check_claims(file: Path, suffix: str, where: str) -> int | None:
    """How many cells a VTK file says it has; None where it does not say, or says it of several pieces, and of others.

    Raises CaseError at ``where`` for a count of nodes, cells or values that a file of its length cannot hold, and for
    XML that defines entities: these can stand for any amount of text.
    """
    size = file.stat().st_size
    with file.open("rb") as stream:
        head = stream.read(_LOOKED_AT)
    if suffix == ".vtu":
        if b"<!" in head.partition(b"<AppendedData")[0].replace(b"<!--", b""):
            raise CaseError(where, shown_path(file), "defines XML entities or a document type; no VTK file needs them")
        claims = [(found[1], int(found[2])) for found in _VTU.finditer(head)]
        most = size * _TIMES
    elif suffix == ".vtk":
        claims = [(found[1], int(count or 0)) for found in _VTK.finditer(head) for count in found.groups()[1:]]
        most = size
    else:
        claims = _gmsh_claims(head)
        most = size
    for what, count in claims:
        if count > most:
            shown = f"{count}" if count < 10**15 else f"{float(min(count, 10**300)):.1e}"
            name = what.decode("latin-1").split()[0]
            told = f"claims {shown} at {name}, which {size_words(size)} cannot hold; is it cut short or broken?"
            raise CaseError(where, shown_path(file), told)
    pattern = _CELLS.get(suffix)
    cells = [] if pattern is None else pattern.findall(head)
    return int(cells[0]) if len(cells) == 1 else None


def _gmsh_claims(head: bytes) -> list[tuple[bytes, int]]:
    """Counts by section, of text and of binary files."""
    claims: list[tuple[bytes, int]] = []
    for found in _GMSH.finditer(head):
        section, line = found[1], found[2]
        if section not in _COUNTED:
            continue
        words = line.split()
        if words and all(word.isdigit() for word in words):
            # Of format 4.1: blocks, nodes, lowest and highest number; numbers need not follow one another.
            counts = words[:2] if section in (b"Nodes", b"Elements") else words
            claims += [(section, int(word[:400])) for word in counts]
        elif len(line) >= 16 and section in (b"Nodes", b"Elements"):
            orders = [struct.unpack(order + "2Q", line[:16]) for order in "<>"]
            claims.append((section, min(max(pair) for pair in orders)))  # whichever byte order says less
    return claims
