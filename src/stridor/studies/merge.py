"""The parts of a study put together."""

from __future__ import annotations

import shutil
from pathlib import Path

from ..case.units import unit_at
from ..errors import CaseError
from .parts import FOLDERS, Part
from .rows import lengths, variables
from .run import NO_GOAL, differing, digest_of
from .sampling import samples
from .schema import Study
from .store import DONE, Head, OpenStore, dataset, head_of


def merged(folder: Path, path: Path, given: Study) -> list[str]:
    """Put the parts of a study in a folder together into one store; says which parts and rows are missing. Raises
    CaseError where there are none, or they are of another study than that, or of one with another case."""
    places = sorted(p / "study.zarr" for p in folder.glob(FOLDERS) if (p / "study.zarr").is_dir())
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
    head = Head(heads[0].study, heads[0].digest, heads[0].provenance)
    values = samples(study)
    columns, inner = variables(study.compute), lengths(study.compute, study.keep)
    if path.exists():
        shutil.rmtree(path)  # put together anew from parts, which stay
    units = {name: unit_at(study.base(), name) for name in study.parameters}
    store = OpenStore.made(path, head, values, units, columns, inner)
    for location in places:
        data = dataset(location)
        rows = {
            int(number): {name: values[k] for name, values in ((str(n), v.values) for n, v in data.items())}
            for k, number in enumerate(data["number"].values.tolist())
            if data["status"].values[k] >= DONE
        }
        store.write(rows)
        if left := int((data["status"].values < DONE).sum()):
            told.append(f"{location.parent.name}: {left} rows not computed yet")
    store.note(answers={"source": "parts", "why": f"{count} parts"}, without_effect=[])
    return told
