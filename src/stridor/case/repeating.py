"""Ties by which bodies repeat, and what is computed of those: motions that every sector makes alike."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .schema import Tie

ALIKE = "motions alike in all sectors"


def repeating(ties: Mapping[str, Tie]) -> tuple[str, ...]:
    """Paths of the ties that say that one side is the other, moved or turned."""
    return tuple(f"ties.{name}" for name, tie in ties.items() if tie.translation or tie.rotation)


def repeating_words(paths: tuple[str, ...]) -> list[str]:
    """What is not computed of bodies that repeat by these ties; nothing where there are none."""
    if not paths:
        return []
    return [
        f"{', '.join(paths)}: bodies repeat, and only {ALIKE} are computed, the zero harmonic of the whole; others of "
        "the whole may grow where these do not"
    ]


def of_alike(claim: str, paths: tuple[str, ...]) -> str:
    """What a claim is of where bodies repeat by these ties; an empty claim stays empty."""
    return f"{claim} All of that is of {ALIKE} alone ({', '.join(paths)})." if claim and paths else claim


def in_alike(sentence: str, paths: tuple[str, ...]) -> str:
    """A sentence, or a headline without its full stop, limited to what is computed where bodies repeat by these ties;
    an empty one stays empty."""
    if not (sentence and paths):
        return sentence
    stop = "." if sentence.endswith(".") else ""
    return f"{sentence.removesuffix('.')}, in {ALIKE}{stop}"


def is_of_alike(claim: str) -> bool:
    """Whether `of_alike` limits a claim."""
    return ALIKE in claim
