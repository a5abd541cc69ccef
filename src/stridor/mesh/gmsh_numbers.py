"""Numbers of nodes in Gmsh's files, looked through before a reader takes them for places in an array, and how many
there are against what the file says: a reader that stops at the count loses the rest without a word. And the entities
that elements of format 4.1 are of, which the reader looks up for their physical groups.

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
_SECTION = re.compile(rb"^\$(MeshFormat|Entities|Nodes|Elements)[ \t\r]*\n", re.MULTILINE)
# Readers make an array as long as the largest number: so far beyond the count of nodes it is a slip.
_LARGEST = 2**31 - 1
_SPARSE = 1000
_ALWAYS = 10_000_000
_ENTITIES = ("point", "curve", "surface", "volume")
_MEND = "correct the number or the lines, or save the file from Gmsh again"
_CUT = "the file breaks off there; save it from Gmsh again"


def check_numbers(file: Path, where: str) -> None:
    """Raise CaseError for nodes numbered below 1, twice or absurdly high, for elements with a node that is not there,
    for more or fewer of them than the file says, and for elements of an entity that it lacks: at "FILE, line N" for
    text, at ``where`` for binary files; in binary files of format 2.2 for nodes in another order than 1, 2, …. What is
    broken otherwise is left to the reader."""
    data = file.read_bytes()
    sections = {found[1]: found.end() for found in reversed(list(_SECTION.finditer(data)))}
    if b"$MeshFormat" not in data:
        text = "has no $MeshFormat: it is no mesh of Gmsh's, or of a format before 2; export it from Gmsh as 4.1 or 2.2"
        raise CaseError(where, shown_path(file), text)
    if not {b"MeshFormat", b"Nodes"} <= set(sections):
        return
    if b"Elements" not in sections:
        text = "has $Nodes and no $Elements; does it break off? Save it from Gmsh again"
        raise CaseError(where, shown_path(file), text)
    words = data[sections[b"MeshFormat"] : sections[b"MeshFormat"] + 100].split()
    if len(words) < 3:
        return
    version, binary = words[0], words[1] == b"1"
    if version.startswith(b"4.0"):
        raise CaseError(where, shown_path(file), "is of Gmsh's format 4.0; save it from Gmsh as 4.1 or 2.2")
    if binary:
        if words[2] == b"8":  # other sizes are the reader's to refuse
            _check_binary(file, where, data, sections, old=version.startswith(b"2"))
    else:
        _check_text(file, data, sections, old=version.startswith(b"2"))


def _check_text(file: Path, data: bytes, sections: dict[bytes, int], *, old: bool) -> None:
    """Line by line, as the format has it."""
    known: set[int] = set()
    for section, take in ((b"Nodes", _take_node), (b"Elements", _take_element)):
        start = sections[section]
        end = data.find(b"$", start)  # no number has one
        lines = data[start : end if end >= 0 else len(data)].split(b"\n")
        number = data.count(b"\n", 0, start) + 1

        def refuse(offset: int, accepted: str, number: int = number, lines: list[bytes] = lines) -> NoReturn:
            text = lines[offset].decode("latin-1").strip()
            raise CaseError(f"{file.name}, line {number + offset}", text, accepted)

        nodes, closed = section == b"Nodes", end >= 0
        name = section.decode()
        if closed and not data.startswith(b"$End" + section, end):
            lines[-1] += data[end : end + 80].split(b"\n")[0]
            refuse(len(lines) - 1, f"${name} has no $End{name} before this; save the file from Gmsh again")
        if not closed and lines[-1].strip():
            refuse(len(lines) - 1, f"the file breaks off here, without $End{name}; save it from Gmsh again")
        try:
            heads: Heads = []
            if old:
                rows = _rows_22(lines, refuse, nodes, closed)
            else:
                rows, heads = _rows_41(lines, refuse, nodes, closed)
            for offset, words, kind in rows:
                take(offset, words, kind, known, refuse)
        except (ValueError, IndexError):
            return  # the reader says what is no number
        if not nodes and not old and b"Entities" in sections:
            held = _entities(data, sections[b"Entities"], binary=False)
            for offset, dimension, tag in heads:
                if text := _missing_entity(held, dimension, tag):
                    refuse(offset, text)
        if nodes and known and (highest := max(known)) > max(_ALWAYS, _SPARSE * len(known)):
            for offset, words, _ in rows:
                if int(words[0]) == highest:
                    refuse(offset, f"node {highest} among {len(known)} nodes: number them closer to one another")


Rows = list[tuple[int, list[bytes], int]]
Heads = list[tuple[int, int, int]]  # offset of each block, dimension and number of its entity
Refuse = Callable[[int, str], NoReturn]


def _rows_22(lines: list[bytes], refuse: Refuse, nodes: bool, closed: bool) -> Rows:
    """Lines of a section of format 2.2 with their offsets; kind: 0. Refuses more or fewer of them than its first one
    says."""
    said = int(lines[0])
    rows: Rows = [(offset, line.split(), 0) for offset, line in enumerate(lines) if offset and line.strip()]
    if len(rows) != said:
        what = "Nodes" if nodes else "Elements"
        mend = _MEND if closed or len(rows) > said else _CUT
        refuse(0, f"${what} says {said} {what.lower()}, and {len(rows)} lines follow; {mend}")
    return rows


def _rows_41(lines: list[bytes], refuse: Refuse, nodes: bool, closed: bool) -> tuple[Rows, Heads]:
    """Numbers of nodes of format 4.1, or of elements and their nodes, with their offsets and types of elements, and the
    heads of their blocks. Refuses more or fewer of them than the first line of the section says."""
    held = [(offset, words) for offset, line in enumerate(lines) if (words := line.split())]
    (first, head), *follow = held
    blocks, total = int(head[0]), int(head[1])
    expected = blocks + (2 if nodes else 1) * total  # a node has a line for its number and one for its place
    for read in (_by_lines, _by_numbers):
        rows, heads = read(follow, refuse, nodes)
        if heads is not None and len(rows) == total and len(heads) == blocks:
            return rows, heads
    what = "Nodes" if nodes else "Elements"
    if len(follow) != expected:
        ends = f"which are {expected} lines, and {len(follow)} lines follow"
    else:
        ends = "which the counts of its blocks do not make up"
    mend = _MEND if closed or len(follow) >= expected else _CUT
    refuse(first, f"${what} says {total} {what.lower()} in {blocks} blocks, {ends}; {mend}")


def _by_lines(held: list[tuple[int, list[bytes]]], refuse: Refuse, nodes: bool) -> tuple[Rows, Heads | None]:
    """Rows, and the heads of blocks, where a head, a number, a place and an element have a line each; None where the
    lines do not make up whole blocks."""
    rows: Rows = []
    heads: Heads = []
    at = 0
    while at < len(held):
        offset, head = held[at]
        if len(head) != 4:
            return [], None
        kind, count = int(head[2]), int(head[3])
        if count < 0:
            refuse(offset, f"a block of {count} {'nodes' if nodes else 'elements'}; there are none or some")
        heads.append((offset, int(head[0]), int(head[1])))
        at += 1
        rows += [(offset, words, 0 if nodes else -kind) for offset, words in held[at : at + count]]
        at += count * (2 if nodes else 1)
    return rows, (heads if at == len(held) else None)


def _by_numbers(
    held: list[tuple[int, list[bytes]]], refuse: Refuse, nodes: bool
) -> tuple[Rows, Heads | None]:
    """The same where the numbers are spread over lines in any way, as readers take them."""
    del refuse
    words = [(offset, word) for offset, line in held for word in line]
    rows: Rows = []
    heads: Heads = []
    at = 0
    while at < len(words):
        try:
            dimension, tag, kind, count = (int(words[at + n][1]) for n in range(4))
        except (ValueError, IndexError):
            return [], None
        if count < 0 or (not nodes and kind not in _NODES):
            return [], None
        heads.append((words[at][0], dimension, tag))
        at += 4
        width = 1 if nodes else 1 + _NODES[kind]
        for start in range(at, min(at + count * width, len(words)), width):
            rows.append((words[start][0], [word for _, word in words[start : start + width]], 0 if nodes else -kind))
        at += count * (4 if nodes else width)
    return rows, (heads if at == len(words) else None)


def _entities(data: bytes, start: int, *, binary: bool) -> list[set[int]] | None:
    """Numbers of the entities of dimension 0 to 3; None where the section breaks off, which the reader tells."""
    words = iter(() if binary else data[start : max(data.find(b"$", start), start)].split())
    at = start

    def take(kind: str, count: int) -> list[float]:
        nonlocal at
        if not binary:
            return [float(next(words)) for _ in range(count)]
        found = np.frombuffer(data, kind, count, at)
        at += found.nbytes
        return found.tolist()

    held: list[set[int]] = []
    try:
        for dimension, total in enumerate(take("u8", 4)):
            held.append(set())
            for _ in range(int(total)):
                held[dimension].add(int(take("i4", 1)[0]))
                take("f8", 6 if dimension else 3)
                for _ in range(2 if dimension else 1):  # physical groups, and what bounds it
                    take("i4", int(take("u8", 1)[0]))
    except (ValueError, IndexError, OverflowError, StopIteration):
        return None
    return held


def _missing_entity(held: list[set[int]] | None, dimension: int, tag: int) -> str:
    """What is wrong with elements of an entity; "" for nothing."""
    if held is None or not 0 <= dimension < len(_ENTITIES) or tag in held[dimension]:
        return ""
    name = _ENTITIES[dimension]
    return f"elements of {name} {tag}, and $Entities has no {name} of this number; save the file from Gmsh again"


def _take_node(offset: int, words: list[bytes], kind: int, known: set[int], refuse: Refuse) -> None:
    del kind
    number = int(float(words[0])) if b"." in words[0] else int(words[0])
    if not 1 <= number <= _LARGEST:
        refuse(offset, f"nodes are numbered from 1 to {_LARGEST}")
    if number in known:
        refuse(offset, f"node {number} is there twice")
    known.add(number)


def _take_element(offset: int, words: list[bytes], kind: int, known: set[int], refuse: Refuse) -> None:
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
        nodes, elements, text = _binary_22(data, sections) if old else _binary_41(data, sections)
    except (ValueError, IndexError, OverflowError):
        return  # the reader says that it breaks off
    if not len(nodes):
        return
    unique = np.unique(nodes)
    if text:
        pass
    elif unique[0] < 1 or unique[-1] > _LARGEST:
        text = f"has a node of number {unique[0] if unique[0] < 1 else unique[-1]}; they are numbered from 1"
    elif len(unique) < len(nodes):
        again = np.sort(nodes)
        first = again[1:][again[1:] == again[:-1]][0]
        text = f"has {len(nodes) - len(unique)} nodes whose number another one has; the first is node {first}"
    elif unique[-1] > max(_ALWAYS, _SPARSE * len(unique)):
        text = f"has node {unique[-1]} among {len(unique)} nodes: number them closer to one another"
    else:
        for block in elements:
            wrong = ~np.isin(block, unique)
            if np.any(wrong):
                text = f"has an element that uses node {block[wrong][0]}, which is not defined"
                break
        if not text and old and not np.array_equal(nodes, np.arange(1, len(nodes) + 1)):
            text = (
                f"is binary, of format 2.2, and its {len(nodes)} nodes are not numbered from 1 to {len(nodes)} in this "
                "order, as its reader needs them; renumber them in Gmsh, or save it as format 4.1 or as text (ASCII)"
            )
    if text:
        raise CaseError(where, shown_path(file), text)


def _line_end(data: bytes, start: int) -> int:
    return data.index(b"\n", start) + 1


def _binary_count(data: bytes, at: int, what: str, said: int, found: int) -> str:
    """What is wrong with the count of a section whose blocks hold so many and end at ``at``; "" for nothing."""
    mend = "save it from Gmsh again"
    if found != said:
        return f"says {said} {what.lower()} at ${what}, and its blocks hold {found}; {mend}"
    if not data[at:].strip():
        return f"breaks off after its {said} {what.lower()}, before $End{what}; {mend}"
    if not data[at : at + 64].lstrip().startswith(b"$"):
        return f"says {said} {what.lower()} at ${what}, and holds more before the section ends; {mend}"
    return ""


def _binary_22(data: bytes, sections: dict[bytes, int]) -> tuple[IntArray, list[IntArray], str]:
    """Numbers of nodes, and of those of elements by blocks, in format 2.2; what is wrong with their counts."""
    start = sections[b"Nodes"]
    at = _line_end(data, start)
    record = np.dtype([("number", "i4"), ("place", "f8", (3,))])
    nodes = np.frombuffer(data, record, int(data[start:at]), at)["number"].astype(np.int64)  # ty: ignore[invalid-argument-type]
    text = _binary_count(data, at + record.itemsize * len(nodes), "Nodes", len(nodes), len(nodes))
    start = sections[b"Elements"]
    at = _line_end(data, start)
    said = left = int(data[start:at])
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
    else:
        text = text or _binary_count(data, at, "Elements", said, said - left)
    return nodes, elements, text


def _binary_41(data: bytes, sections: dict[bytes, int]) -> tuple[IntArray, list[IntArray], str]:
    """The same in format 4.1, whose sizes have 8 bytes."""

    def numbers(kind: str, count: int, at: int) -> Any:
        return np.frombuffer(data, kind, count, at)

    at = sections[b"Nodes"]
    blocks, said = (int(n) for n in numbers("u8", 2, at))
    at += 32
    nodes: list[IntArray] = []
    for _ in range(blocks):
        count = int(numbers("u8", 1, at + 12)[0])
        nodes.append(numbers("u8", count, at + 20).astype(np.int64))
        at += 20 + 32 * count
    text = _binary_count(data, at, "Nodes", said, sum(map(len, nodes)))
    at = sections[b"Elements"]
    blocks, said = (int(n) for n in numbers("u8", 2, at))
    at += 32
    elements: list[IntArray] = []
    held = _entities(data, sections[b"Entities"], binary=True) if b"Entities" in sections else None
    for _ in range(blocks):
        dimension, tag, kind = (int(n) for n in numbers("i4", 3, at))
        count = int(numbers("u8", 1, at + 12)[0])
        if not text and (missing := _missing_entity(held, dimension, tag)):
            text = f"has {missing}"
        width = 1 + _NODES.get(kind, 0)
        if kind not in _NODES:
            break
        elements.append(numbers("u8", count * width, at + 20).reshape(count, width)[:, 1:].astype(np.int64))
        at += 20 + 8 * count * width
    else:
        text = text or _binary_count(data, at, "Elements", said, sum(map(len, elements)))
    return (np.concatenate(nodes) if nodes else np.zeros(0, dtype=np.int64)), elements, text
