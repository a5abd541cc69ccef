"""Numbers of nodes in Gmsh's files, looked through before a reader takes them for places in an array.

Nodes are numbered from 1. A reader that subtracts 1 takes node 0 for the last one, and a number that two nodes have for
the second of them; here the line is named instead (of binary files the element).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from ..errors import CaseError
from ..typing import IntArray
from .paths import shown_path

# Nodes of Gmsh's types of elements, by their numbers; types beyond are refused by the reader.
_NODES = {
    **{1: 2, 2: 3, 3: 4, 4: 4, 5: 8, 6: 6, 7: 5, 8: 3, 9: 6, 10: 9, 11: 10, 12: 27, 13: 18, 14: 14, 15: 1, 16: 8},
    **{17: 20, 18: 15, 19: 13, 20: 9, 21: 10, 22: 12, 23: 15, 24: 15, 25: 21, 26: 4, 27: 5, 28: 6, 29: 20, 30: 35},
    **{31: 56, 36: 16, 37: 25, 92: 64, 93: 125},
}
_SECTION = re.compile(rb"^\$(MeshFormat|Nodes|Elements)[ \t\r]*\n", re.MULTILINE)
# Readers make an array as long as the largest number: so far beyond the count of nodes it is a slip.
_LARGEST = 2**31 - 1
_SPARSE = 1000
_ALWAYS = 10_000_000


def check_numbers(file: Path, where: str) -> None:
    """Raise CaseError for nodes numbered below 1, twice or absurdly high, and for elements with a node that is not
    there: at "FILE, line N" for text, at ``where`` for binary files. What is broken otherwise is left to the reader."""
    data = file.read_bytes()
    sections = {found[1]: found.end() for found in reversed(list(_SECTION.finditer(data)))}
    if not {b"MeshFormat", b"Nodes", b"Elements"} <= set(sections):
        return
    words = data[sections[b"MeshFormat"] : sections[b"MeshFormat"] + 100].split()
    if len(words) < 3:
        return
    version, binary = words[0], words[1] == b"1"
    if version.startswith(b"4.0"):
        raise CaseError(where, shown_path(file), "is of Gmsh's format 4.0; save it from Gmsh as 4.1 or 2.2")
    if binary:
        _check_binary(file, where, data, sections, old=version.startswith(b"2"))
    else:
        _check_text(file, data, sections, old=version.startswith(b"2"))


def _check_text(file: Path, data: bytes, sections: dict[bytes, int], *, old: bool) -> None:
    """Line by line, as the format has it."""
    known: set[int] = set()
    for section, take in ((b"Nodes", _take_node), (b"Elements", _take_element)):
        start = sections[section]
        end = data.find(b"$End" + section, start)
        lines = data[start : end if end >= 0 else len(data)].split(b"\n")
        number = data.count(b"\n", 0, start) + 1

        def refuse(offset: int, accepted: str, number: int = number, lines: list[bytes] = lines) -> NoReturn:
            text = lines[offset].decode("latin-1").strip()
            raise CaseError(f"{file.name}, line {number + offset}", text, accepted)

        try:
            rows = _rows_22(lines) if old else _rows_41(lines, refuse, nodes=section == b"Nodes")
            for offset, words, kind in rows:
                take(offset, words, kind, known, refuse)
        except (ValueError, IndexError):
            return  # the reader says what is no number
        if section == b"Nodes" and known and (highest := max(known)) > max(_ALWAYS, _SPARSE * len(known)):
            for offset, words, kind in _rows_22(lines) if old else _rows_41(lines, refuse, nodes=True):
                if kind is not None and int(words[0]) == highest:
                    refuse(offset, f"node {highest} among {len(known)} nodes: number them closer to one another")


Rows = list[tuple[int, list[bytes], int | None]]
Refuse = Callable[[int, str], NoReturn]


def _rows_22(lines: list[bytes]) -> Rows:
    """Lines of a section of format 2.2 with their offsets; kind: 0 for what is no head."""
    return [(offset, line.split(), 0) for offset, line in enumerate(lines) if offset and line.strip()]


def _rows_41(lines: list[bytes], refuse: Refuse, *, nodes: bool) -> Rows:
    """Lines with numbers of nodes of format 4.1, with their offsets and types of elements."""
    rows: Rows = []
    held = [(offset, words) for offset, line in enumerate(lines) if (words := line.split())]
    at = 1
    while at < len(held):
        count, kind = int(held[at][1][3]), int(held[at][1][2])
        if count < 0:
            refuse(held[at][0], f"a block of {count} {'nodes' if nodes else 'elements'}; there are none or some")
        at += 1
        rows += [(offset, words, 0 if nodes else -kind) for offset, words in held[at : at + count]]
        at += count * (2 if nodes else 1)
    return rows


def _take_node(offset: int, words: list[bytes], kind: int | None, known: set[int], refuse: Refuse) -> None:
    del kind
    number = int(float(words[0])) if b"." in words[0] else int(words[0])
    if not 1 <= number <= _LARGEST:
        refuse(offset, f"nodes are numbered from 1 to {_LARGEST}")
    if number in known:
        refuse(offset, f"node {number} is there twice")
    known.add(number)


def _take_element(offset: int, words: list[bytes], kind: int | None, known: set[int], refuse: Refuse) -> None:
    if kind:  # format 4.1: the element's number, then nodes
        first, needed = 1, _NODES.get(-kind)
    else:
        first, needed = 3 + int(words[2]), _NODES.get(int(words[1]))
    if needed is None:
        return
    if len(words) - first != needed:
        refuse(offset, f"an element of its type has {needed} nodes; here are {len(words) - first} numbers for them")
    for word in words[first:]:
        if int(word) not in known:
            refuse(offset, f"uses node {word.decode('latin-1')[:30]}, which is not defined")


def _check_binary(file: Path, where: str, data: bytes, sections: dict[bytes, int], *, old: bool) -> None:
    try:
        nodes, elements = _binary_22(data, sections) if old else _binary_41(data, sections)
    except (ValueError, IndexError, OverflowError):
        return  # the reader says that it breaks off
    if not len(nodes):
        return
    unique = np.unique(nodes)
    text = ""
    if unique[0] < 1 or unique[-1] > _LARGEST:
        text = f"has a node of number {unique[0] if unique[0] < 1 else unique[-1]}; they are numbered from 1"
    elif len(unique) < len(nodes):
        text = f"has {len(nodes) - len(unique)} nodes whose number another one has"
    elif unique[-1] > max(_ALWAYS, _SPARSE * len(unique)):
        text = f"has node {unique[-1]} among {len(unique)} nodes: number them closer to one another"
    else:
        for block in elements:
            wrong = ~np.isin(block, unique)
            if np.any(wrong):
                text = f"has an element that uses node {block[wrong][0]}, which is not defined"
                break
    if text:
        raise CaseError(where, shown_path(file), text)


def _line_end(data: bytes, start: int) -> int:
    return data.index(b"\n", start) + 1


def _binary_22(data: bytes, sections: dict[bytes, int]) -> tuple[IntArray, list[IntArray]]:
    """Numbers of nodes, and of those of elements by blocks, in format 2.2."""
    start = sections[b"Nodes"]
    at = _line_end(data, start)
    record = np.dtype([("number", "i4"), ("place", "f8", (3,))])
    nodes = np.frombuffer(data, record, int(data[start:at]), at)["number"].astype(np.int64)
    start = sections[b"Elements"]
    at = _line_end(data, start)
    left = int(data[start:at])
    elements: list[IntArray] = []
    while left > 0:
        kind, count, tags = (int(n) for n in np.frombuffer(data, "i4", 3, at))
        width = 1 + tags + _NODES.get(kind, 0)
        if count < 1 or kind not in _NODES:
            break
        block = np.frombuffer(data, "i4", count * width, at + 12).reshape(count, width)
        elements.append(block[:, 1 + tags :].astype(np.int64))
        at += 12 + 4 * count * width
        left -= count
    return nodes, elements


def _binary_41(data: bytes, sections: dict[bytes, int]) -> tuple[IntArray, list[IntArray]]:
    """The same in format 4.1, whose sizes have 8 bytes."""

    def numbers(kind: str, count: int, at: int) -> Any:
        return np.frombuffer(data, kind, count, at)

    at = sections[b"Nodes"]
    blocks = int(numbers("u8", 1, at)[0])
    at += 32
    nodes: list[IntArray] = []
    for _ in range(blocks):
        count = int(numbers("u8", 1, at + 12)[0])
        nodes.append(numbers("u8", count, at + 20).astype(np.int64))
        at += 20 + 32 * count
    at = sections[b"Elements"]
    blocks = int(numbers("u8", 1, at)[0])
    at += 32
    elements: list[IntArray] = []
    for _ in range(blocks):
        kind, count = int(numbers("i4", 3, at)[2]), int(numbers("u8", 1, at + 12)[0])
        width = 1 + _NODES.get(kind, 0)
        if kind not in _NODES:
            break
        elements.append(numbers("u8", count * width, at + 20).reshape(count, width)[:, 1:].astype(np.int64))
        at += 20 + 8 * count * width
    return (np.concatenate(nodes) if nodes else np.zeros(0, dtype=np.int64)), elements
