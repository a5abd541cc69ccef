"""A matrix file that is being read: its bytes, and how it is refused."""

from __future__ import annotations

import gzip
import re
import zlib
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO, NoReturn

from ..errors import CaseError
from ..mesh.paths import in_one_line, shown_path
from ..reading import VARIABLE, irregular, largest_unfolded, size_words

# Text packs to about a tenth; a file that unpacks to far more is broken, or was made to fill the memory.
_TEXT_PACKED = 100
_TEXT_UNQUESTIONED = 1 << 28
# Full matrices of few entries pack to far less, but beyond this they ought to be stored as sparse ones.
_FULL_PACKED = 50
_FULL_UNQUESTIONED = 1 << 30
_GZIP = b"\x1f\x8b"
_MARK = b"\xef\xbb\xbf"  # what Windows puts before UTF-8
_START = 512


@dataclass(frozen=True)
class MatrixFile:
    """A file that is being read, and where the case names it; name: the one of its matrices that is read, if known."""

    path: Path
    where: str
    name: str = ""

    def of(self, name: str) -> MatrixFile:
        """The same for one of the file's matrices."""
        return replace(self, name=name)

    def refuse(self, text: str, cause: BaseException | None = None) -> NoReturn:
        """Raises the CaseError that names the file, the matrix and what is wrong with it."""
        given = Path(f"{self.path}, {_printable(self.name)}") if self.name else self.path
        # Names out of a broken file may hold anything.
        raise CaseError(self.where, shown_path(given), _printable(text)) from cause

    def refuse_line(self, number: int, text: str | bytes, accepted: str) -> NoReturn:
        """Raises the CaseError that names the line, shows it and says what it should be."""
        raise CaseError(f"{self.path.name}, line {number}", printable(text), _printable(accepted))

    def unreadable(self, what: str, cause: BaseException) -> NoReturn:
        """Raises the CaseError for a file that a library could not read as ``what``."""
        if isinstance(cause, CaseError):
            raise cause
        if isinstance(cause, MemoryError):
            self.refuse("does not fit into the memory of this computer", cause)
        said = in_one_line(cause).rstrip(".") or type(cause).__name__
        self.refuse(f"is not readable as {what}: {said}", cause)

    def check_unpacked(self, size: int, packed: int) -> None:
        """Raises CaseError for a full matrix whose bytes are far more than those that they are packed into."""
        if size > largest_unfolded(packed, unquestioned=_FULL_UNQUESTIONED, times=_FULL_PACKED):
            self.refuse(
                f"unpacks to {size_words(size)} or more from {size_words(packed)}; store so large a matrix as a sparse "
                f"one, or allow it by {VARIABLE} in the environment (GiB)"
            )

    def contents(self, most: int = -1) -> bytes:
        """The file's bytes, unpacked: all, or so many from its beginning. Raises CaseError."""
        with self.stream() as stream:
            data = stream.read(most)
        if not data:
            self.refuse("the file is empty (0 bytes)")
        return data

    def start(self) -> bytes:
        """What the file begins with, unpacked. Raises CaseError."""
        return self.contents(_START)

    def text(self) -> bytes:
        """All bytes of a text file, unpacked and without the mark of UTF-8. Raises CaseError for other encodings."""
        return self.as_text(self.contents())

    def as_text(self, data: bytes) -> bytes:
        """The same of bytes that the file begins with. Raises CaseError."""
        start = data[:_START]
        even, odd = start[::2], start[1::2]
        if start.startswith((b"\xff\xfe", b"\xfe\xff")) or (len(odd) > 1 and any(even) != any(odd)):
            self.refuse("is text of two bytes a letter (UTF-16); save it as UTF-8 or plain ASCII")
        if b"\r" in start[:-1] and b"\n" not in start:
            self.refuse("ends its lines with a carriage return alone; save it with line feeds")
        return data.removeprefix(_MARK)

    @contextmanager
    def stream(self) -> Generator[Stream]:
        """The file's bytes in turn, unpacked where gzip has packed them. Raises CaseError where they cannot be read."""
        try:
            with self.path.open("rb") as plain:
                packed = plain.read(2) == _GZIP
                plain.seek(0)
                if not packed:
                    if self.path.suffix.lower() == ".gz" and self.path.stat().st_size:
                        self.refuse("is not packed by gzip, as its name says; give it a name without .gz")
                    yield Stream(plain)
                    return
                packed_size = self.path.stat().st_size
                limit = largest_unfolded(packed_size, unquestioned=_TEXT_UNQUESTIONED, times=_TEXT_PACKED)
                with gzip.GzipFile(fileobj=plain) as stream:
                    yield Stream(stream, self, limit)
        except (OSError, EOFError, zlib.error) as error:
            self.refuse(f"cannot be read: {in_one_line(error)}", error)


class Stream:
    """Bytes of a file in turn, no more than ``limit`` where that is given."""

    def __init__(self, file: BinaryIO | gzip.GzipFile, source: MatrixFile | None = None, limit: int = 0) -> None:
        self._file, self._source, self._left = file, source, limit

    def read(self, size: int = -1) -> bytes:
        """The next bytes, as many as asked for or all. Raises CaseError where they are too many."""
        if self._source is None:
            return self._file.read(size)
        return self._counted(self._file.read(self._left + 1 if size < 0 else size), self._source)

    def readline(self, longest: int) -> bytes:
        """The next line with its end, no more than the longest of it. Raises CaseError where they are too many."""
        line = self._file.readline(longest)
        return line if self._source is None else self._counted(line, self._source)

    def _counted(self, data: bytes, source: MatrixFile) -> bytes:
        self._left -= len(data)
        if self._left < 0:
            source.refuse(
                f"unpacks to far more than its size; unpack it and give the file itself, or allow it by {VARIABLE} in "
                "the environment (GiB)"
            )
        return data


def source_at(path: Path, where: str) -> MatrixFile:
    """The file at a path, found to be there and to hold something. Raises CaseError otherwise."""
    source = MatrixFile(path, where)
    try:
        if path.is_dir():
            source.refuse("is a folder; must be a file")
        if reason := irregular(path):
            source.refuse(reason)
        if path.stat().st_size == 0:
            source.refuse("the file is empty (0 bytes)")
        with path.open("rb"):
            pass
    except FileNotFoundError:
        source.refuse("no such file")
    except (OSError, ValueError) as error:  # ValueError: a name with a NUL
        source.refuse(f"cannot be read: {in_one_line(error)}", error)
    return source


def beside(source: MatrixFile, *names: str) -> MatrixFile | None:
    """The first file of these names in the folder of another that is there."""
    paths = (source.path.with_name(name) for name in names)
    found = next((p for p in paths if p.is_file() and p != source.path), None)
    return None if found is None else source_at(found, source.where)


def printable(raw: str | bytes) -> str:
    """A line or a name out of a file as it can be shown: what is not printable ASCII becomes a question mark."""
    text = raw.decode("latin-1") if isinstance(raw, bytes) else raw
    return re.sub(r"[^\x20-\x7e]", "?", text.strip().expandtabs(1))


def quoted(text: bytes) -> str:
    """A part of a file for a message: quoted, on one line, shortened."""
    shown = " ".join(printable(text[:200].replace(b"\r", b" ")).split())
    return repr(shown if len(shown) <= 50 else shown[:49] + "…")


def counted(count: int, one: str, more: str) -> str:
    """A number and the word for one or for several."""
    return f"{count} {one if count == 1 else more}"


class Doubt(str):
    """A note of reading by which numbers may be others than those that were meant: every verb warns of it."""

    __slots__ = ()


UNENDED = Doubt("The last line has no line end: if the file was cut off there, its last number is wrong.")


def unended(data: bytes) -> tuple[str, ...]:
    """A note where the last line of a text has no end."""
    return () if data.endswith(b"\n") else (UNENDED,)


def _printable(text: str) -> str:
    return "".join(letter if letter.isprintable() else "?" for letter in text)
