"""The text of an Abaqus or CalculiX input file as cards: keyword, parameters, data lines, and where each line is from.

Comments are left out, included files put in their place, keywords and names of parameters in capitals.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from ..errors import CaseError
from ..reading import irregular
from .paths import in_one_line

# A keyword line that ends in a comma goes on in the next line, if that holds parameters: some programs end every line
# in a comma.
_WITHOUT_VALUE = ("GENERATE", "INTERNAL", "UNSORTED")
LARGEST_NUMBER = 2**31 - 1  # of nodes and elements
_DATA_FROM_FILES = ("NODE", "ELEMENT", "NSET", "ELSET")


@dataclass(frozen=True)
class DeckLine:
    """A line of a file: the file's name, the line's number from 1, its text."""

    file: str
    number: int
    text: str

    def refuse(self, accepted: str) -> NoReturn:
        """Raises the CaseError that names the line and what it should be."""
        raise CaseError(f"{self.file}, line {self.number}", self.text.strip(), accepted)

    @property
    def fields(self) -> list[str]:
        """What stands between commas, blanks around it left out; a comma at the end adds nothing."""
        found = [f.strip() for f in self.text.split(",")]
        if found and not found[-1]:
            found.pop()
        return found

    def whole(self, text: str, what: str, largest: int = LARGEST_NUMBER) -> int:
        """A positive whole number. Raises CaseError."""
        try:
            if len(text) < 40 and "_" not in text and 0 < (value := int(text)) <= largest:
                return value
        except ValueError:
            pass
        most = f" to {LARGEST_NUMBER}" if len(text) > 9 and text.isdecimal() else ""
        given = text if len(text) <= 40 else f"{text[:39]}…"
        self.refuse(f"{given!r} is not {what}, a whole number from 1{most}")

    def number_of(self, text: str, what: str) -> float:
        """A finite number, also as Fortran writes it (1.D0); nothing is 0. Raises CaseError."""
        if not text:
            return 0.0
        try:
            value = float(text.upper().replace("D", "E"))
        except ValueError:
            value = math.nan
        if math.isfinite(value) and "_" not in text:
            return value
        self.refuse(f"{text!r} is not {what}, a finite number")


@dataclass
class Card:
    """A keyword, its parameters by name (None: given without a value), and the data lines that follow it."""

    keyword: str
    options: Mapping[str, str]
    line: DeckLine
    data: list[DeckLine] = field(default_factory=list)

    def need(self, option: str) -> str:
        """The value of a parameter. Raises CaseError where it is missing or empty."""
        value = self.options.get(option, "")
        if not value:
            self.line.refuse(f"*{self.keyword} needs {option}=…")
        return value


def read_deck(file: Path) -> list[Card]:
    """Cards of a file, with what it includes in its place. Raises CaseError with file and line."""
    cards: list[Card] = []
    _take(_lines(file, None), file, (), cards)
    return cards


def _take(lines: list[DeckLine], file: Path, above: tuple[Path, ...], cards: list[Card]) -> None:
    """Adds lines to the cards so far; above: the files that include this one.

    *INCLUDE stands for the text of its file: it ends no card. What the file begins with goes on with the card before
    it, and what follows the include with the last card of the file. Raises CaseError, for data that no keyword is
    above, too.
    """
    at = 0
    while at < len(lines):
        line = lines[at]
        at += 1
        if not line.text.startswith("*"):
            if not cards:
                line.refuse("no keyword (*NODE, *ELEMENT, …) is above this line that says what it is")
            cards[-1].data.append(line)
            continue
        text = line.text
        while text.endswith(",") and at < len(lines) and _continues(lines[at].text):
            text += lines[at].text
            at += 1
        card = _card(text, line)
        if card.keyword != "INCLUDE":
            cards.append(card)
        if card.keyword == "INCLUDE" or (card.keyword in _DATA_FROM_FILES and "INPUT" in card.options):
            other = file.parent / card.need("INPUT")
            if other in (file, *above):
                line.refuse("this file is already being read; a file cannot include itself")
            included = _lines(other, line)
            if card.keyword == "INCLUDE":
                _take(included, other, (file, *above), cards)
                continue
            for entry in included:
                if entry.text.startswith("*"):
                    entry.refuse(f"INPUT of *{card.keyword} names a file of its data lines; for keywords: *INCLUDE")
            card.data += included


def _continues(text: str) -> bool:
    """Whether a line can be the rest of a keyword line."""
    return not text.startswith("*") and ("=" in text or text.split(",")[0].strip().upper() in _WITHOUT_VALUE)


def _card(text: str, line: DeckLine) -> Card:
    """A card without data from a keyword line."""
    keyword, *parameters = text[1:].split(",")
    options: dict[str, str] = {}
    for parameter in parameters:
        name, _, value = parameter.partition("=")
        options[" ".join(name.upper().split())] = value.strip().strip('"').strip()
    options.pop("", None)
    return Card(" ".join(keyword.upper().split()), options, line)


def _lines(file: Path, asked: DeckLine | None) -> list[DeckLine]:
    """Lines of a file that are neither empty nor comments. asked: the line that includes it, for the message."""
    content = b""
    try:
        reason = irregular(file) or ""
        if not reason:
            content = file.read_bytes()
            reason = "not a text file" if b"\0" in content else ""
    except FileNotFoundError:
        reason = "no such file"
    except (OSError, ValueError) as error:
        reason = in_one_line(error)
    if reason:
        if asked is not None:
            asked.refuse(f"{file.name} cannot be included: {reason}; paths count from the folder of the file")
        raise CaseError(file.name, None, f"cannot be read: {reason}")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    # Not splitlines(): form feeds and the like are no ends of lines to an editor that shows their numbers.
    found: list[DeckLine] = []
    for number, entry in enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), start=1):
        stripped = entry.strip()
        if stripped and not stripped.startswith("**"):
            found.append(DeckLine(file.name, number, stripped))
    return found
