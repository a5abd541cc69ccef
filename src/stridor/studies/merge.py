"""The parts of a study put together."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..case.units import unit_at
from ..errors import CaseError
from ..notebook import counted
from .parts import FOLDERS, Part
from .rows import Row, lengths, variables
from .run import NAME, NO_GOAL, differing, digest_of
from .sampling import samples
from .schema import Study
from .store import DONE, Head, OpenStore, dataset, head_of


def merged(folder: Path, path: Path, given: Study, *, go_on: bool = False) -> list[str]:
    """Put the parts of a study in a folder together into one store; says which parts and rows are missing. go_on: also
    parts that different versions of stridor computed. What is at the path stays until the whole is written beside it.
    Raises CaseError where there are no parts, they are of another study than that, of one with another case or of
    several versions, one of them is damaged, or what is at the path holds rows that they do not."""
    places = sorted(p / NAME for p in folder.glob(FOLDERS) if (p / NAME).is_dir())
    if not places:
        raise CaseError(str(folder), None, f"no parts there: folders {FOLDERS} that --part wrote")
    heads = [head_of(location) for location in places]
    for location, head in zip(places, heads, strict=True):
        if head.digest != heads[0].digest:
            raise CaseError(str(location), None, f"is of another study than {places[0]}")
    if heads[0].digest != digest_of(given, given.base()):
        accepted = f"holds parts of another study than the one given: {differing(heads[0].study, given)}"
        raise CaseError(str(folder), None, f"{accepted}; give the study as it was, or run its parts anew")
    study = Study.from_document(heads[0].study)
    count = Part.read(heads[0].part).count
    told = [] if given.goal is None else [NO_GOAL]
    if others := [str(p) for p, h in zip(places, heads, strict=True) if Part.read(h.part).count != count]:
        raise CaseError(others[0], None, f"is one of another number of parts than {places[0]}")
    present = {Part.read(h.part).number for h in heads}
    if missing := [str(k) for k in range(1, count + 1) if k not in present]:
        listed = ", ".join(missing[:20]) + (" …" if len(missing) > 20 else "")
        told.append(f"parts missing: {listed} of {count}; their rows are not computed")
    for location, head in zip(places, heads, strict=True):
        if location.parent.name != (own := Part.read(head.part).folder.name):
            told.append(f"{location.parent.name} holds the rows of {own}")
    rows: dict[int, Row] = {}
    notes: list[Mapping[str, Any]] = []
    for location in places:
        data = dataset(location)
        rows |= {
            int(number): {name: values[k] for name, values in ((str(n), v.values) for n, v in data.items())}
            for k, number in enumerate(data["number"].values.tolist())
            if data["status"].values[k] >= DONE
        }
        notes.append({name: json.loads(data.attrs[name]) for name in KEPT if name in data.attrs})
        if left := int((data["status"].values < DONE).sum()):
            told.append(f"{location.parent.name}: {left} rows not computed yet")
    programs = _programs(heads, notes)
    if len(programs) > 1:
        what = f"parts that different versions of stridor computed ({', '.join(programs)})"
        if not go_on:
            accepted = f"holds {what}, which may give other numbers: compute them anew with one, or put them together"
            raise CaseError(str(folder), None, f"{accepted} all the same (--go-on)")
        told.append(f"put together from {what}")
    _require_all(path, heads[0].digest, rows)
    head = Head(heads[0].study, heads[0].digest, {**heads[0].provenance, "programs": programs})
    told.extend(_together(notes, "without_effect"))
    _replace(path, study, head, rows, notes, count)
    return told


KEPT = ("programs", "without_effect", "completed", "lost_workers", "seconds")  # of the notes of a part


def _programs(heads: Sequence[Head], notes: Sequence[Mapping[str, Any]]) -> list[str]:
    """Versions that computed parts, each once."""
    each = (n.get("programs") or h.provenance.get("programs", []) for h, n in zip(heads, notes, strict=True))
    return list(dict.fromkeys(program for programs in each for program in programs))


def _together(notes: Sequence[Mapping[str, Any]], name: str) -> list[str]:
    """Lines of the notes of all parts, each once."""
    return list(dict.fromkeys(line for note in notes for line in note.get(name) or ()))


def _require_all(path: Path, digest: str, rows: Mapping[int, Row]) -> None:
    """Raises CaseError where a store that would be replaced has rows of another study, or some that no part has."""
    if not path.exists():
        return
    what = "move it away, or remove it"
    if head_of(path).digest != digest:
        raise CaseError(str(path), None, f"is of another study than the parts; {what}")
    before = dataset(path)
    computed = before["number"].values[before["status"].values >= DONE].tolist()
    if lost := [k for k in computed if k not in rows]:
        raise CaseError(str(path), None, f"has {counted(len(lost), 'row')} that are in none of the parts; {what}")


def _replace(
    path: Path, study: Study, head: Head, rows: Mapping[int, Row], notes: Sequence[Mapping[str, Any]], count: int
) -> None:
    """Write the whole beside its place, and put it there."""
    beside, old = path.with_name(f".{path.name}.merged"), path.with_name(f".{path.name}.old")
    for left in (beside, old):
        shutil.rmtree(left, ignore_errors=True)
    units = {name: unit_at(study.base(), name) for name in study.parameters}
    columns, inner = variables(study.compute), lengths(study.compute, study.keep)
    try:
        store = OpenStore.made(beside, head, samples(study), units, columns, inner)
        store.write(rows)
        store.note(
            answers={"source": "parts", "why": f"{count} parts"}, without_effect=_together(notes, "without_effect"),
            completed=_together(notes, "completed"), lost_workers=sum(n.get("lost_workers") or 0 for n in notes),
            seconds=sum(n.get("seconds") or 0.0 for n in notes),
        )  # fmt: skip
    except BaseException:
        shutil.rmtree(beside, ignore_errors=True)
        raise
    if path.exists():
        path.rename(old)
    beside.rename(path)
    shutil.rmtree(old, ignore_errors=True)
