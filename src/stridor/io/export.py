"""A case as matrices in a folder, with tables that say what their rows are and a case file that computes with them."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..asking import PATH, SWITCH, takes
from ..case import loads
from ..errors import CaseError
from ..matrices.entries import lone
from ..notebook import Shown, html_table
from ..study.exported import ExportedModel, exported_model
from ..study.workspace import Problem, Workspace
from ..typing import Sparse
from .atomic import write_text
from .claims import claimed
from .matrix_files import FORMATS, HOLDS_ALL, Format, file_of, write_matrices

CASE, LABELS, FREEDOMS, CONTACTS = "matrices.toml", "labels.txt", "freedoms.csv", "contacts.csv"
# Whatever is not a term, by the names of files and of matrices in them.
NORMAL, TANGENT, LOADS = "normal", "tangent", "loads"
_NAMES = ("M", "C", "K", "Kc", "Kf", NORMAL, TANGENT, LOADS)
_MEANING = {
    "M": "mass",
    "C": "damping",
    "K": "stiffness of the structure, without contacts",
    "Kc": "what contacts add to the stiffness without friction",
    "Kf": "what friction adds to it for mu = 1",
    NORMAL: f"rows of {CONTACTS}: relative displacement slave - master along the normal",
    TANGENT: "the same along the slip",
    LOADS: "a column for each load at factor one",
}
_AXES = ("x_m", "y_m", "z_m")


@dataclass(frozen=True, repr=False)
class Export(Shown):
    """What was written: files, the case file among them that computes with the matrices (None where matrices do not say
    all), the matrices by name with shape, meaning and file, names of the loads' columns, and what else is to be known.
    """

    folder: Path
    format: Format
    mu: float | None
    files: tuple[Path, ...]
    case: Path | None
    matrices: Mapping[str, Mapping[str, Any]]
    load_names: tuple[str, ...]
    freedoms: int
    notes: tuple[str, ...]

    @property
    def _line(self) -> str:
        at = "" if self.mu is None else f" at μ = {self.mu:g}"
        return f"{', '.join(self.matrices)}{at} of {self.freedoms} freedoms in {self.folder}"

    def _repr_html_(self) -> str:
        heads = ("matrix", "what it is", "shape", "file")
        rows = [
            (name, said["meaning"], " × ".join(map(str, said["shape"])), said["file"])
            for name, said in self.matrices.items()
        ]
        return html_table(f"Export: {self._line}", heads, rows, self.notes)

    def to_json(self) -> dict[str, Any]:
        """The document that `stridor export --json` prints."""
        return {
            "format": self.format,
            "mu": self.mu,
            "freedoms": self.freedoms,
            "matrices": {name: dict(said) for name, said in self.matrices.items()},
            "loads": list(self.load_names),
            "case": None if self.case is None else str(self.case),
            "notes": list(self.notes),
            "files": [str(path) for path in self.files],
        }


@takes(folder=PATH, force=SWITCH)
def export(
    problem: Problem, folder: str | Path, *, format: str = "mtx", mu: float | None = None, force: bool = False
) -> Export:
    """Write the matrices of a case or a system into ``folder``: M, C and K(μ) at ``mu`` as `pencil` has them, or (None)
    the structure's own, with contacts and friction in terms Kc and Kf of their own, K(μ) = K + Kc + μ Kf.

    format: "mtx" (Matrix Market), "npz" (NumPy), "mat" (MATLAB) or "op4" (Nastran). Beside them rows of the contacts,
    loads, tables of freedoms and contacts, and a case file on these matrices. Each file is whole or not there. force:
    whether files of an earlier export may be replaced. Raises CaseError for what is not accepted and for files that are
    there, AnalysisError where there is no steady sliding or the folder cannot be written.
    """
    if format not in FORMATS:
        raise CaseError("format", format, f"one of {', '.join(FORMATS)}")
    chosen, work, target = format, Workspace.of(problem), Path(folder)
    mine = [target / name for name in dict.fromkeys((*(file_of(n, chosen) for n in _NAMES), *_TABLES))]
    existing = [path for path in mine if path.exists()]
    if existing and not force:
        more = f" and {len(existing) - 1} more files" if len(existing) > 1 else ""
        held = f"{target} holds {existing[0].name}{more} of an earlier export"
        raise CaseError("folder", None, f"{held}; take another folder, or replace them (--force)")
    model = exported_model(work, mu)
    with claimed(target):
        written = _written(work, model, target, chosen)
        for path in set(existing) - set(written.files):
            # Matrices of an earlier export would be taken for those of this one.
            path.unlink()
    return written


_TABLES = (FREEDOMS, LABELS, CONTACTS, CASE)


def _written(work: Workspace, model: ExportedModel, folder: Path, form: Format) -> Export:
    held: dict[str, Sparse] = {term.name: term.matrix for term in model.terms}
    if model.contacts:
        held |= {NORMAL: model.normal, TANGENT: model.tangent}
    if model.load_names:
        held[LOADS] = model.loads
    files = write_matrices(folder, held, form)
    tables = {FREEDOMS: _freedoms(model), LABELS: _labels(model)}
    if model.contacts:
        tables[CONTACTS] = _contacts(model)
    case = folder / CASE if model.whole else None
    if case is not None:
        tables[CASE] = _case(work, model, form)
        loads(tables[CASE], source=CASE, folder=folder.resolve())  # what is written can be read
    for name, text in tables.items():
        write_text(folder / name, text)
        files.append(folder / name)
    matrices = {
        name: {"shape": list(matrix.shape), "meaning": _meaning(name, model), "file": file_of(name, form)}
        for name, matrix in held.items()
    }
    return Export(
        folder, form, model.mu, tuple(files), case, matrices, model.load_names, len(model.freedoms), model.notes
    )


def _meaning(name: str, model: ExportedModel) -> str:
    if model.mu is not None and name in ("C", "K"):
        what = "damping" if name == "C" else "stiffness"
        within = f"contact and friction at mu = {model.mu!r} in it" if model.contacts else f"at mu = {model.mu!r}"
        return f"{what}, {within}"
    return _MEANING[name]


def _table(heads: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(heads)
    lines.writerows(rows)
    return text.getvalue()


def _place(place: tuple[float, ...], dimension: int) -> list[str]:
    return [repr(x) for x in place] if place else [""] * dimension


def _freedoms(model: ExportedModel) -> str:
    axes = _AXES[: model.dimension]
    rows = (
        [k, f.body, f.node, f.direction, *_place(f.place, model.dimension), *f.label]
        for k, f in enumerate(model.freedoms, start=1)
    )
    return _table(["number", "body", "node", "direction", *axes, "label_node", "label_direction"], rows)


def _labels(model: ExportedModel) -> str:
    return "".join(f"{node} {direction}\n" for node, direction in (f.label for f in model.freedoms))


def _contacts(model: ExportedModel) -> str:
    axes = _AXES[: model.dimension]
    rows = (
        [k, c.contact, "rigid" if math.isinf(c.stiffness) else repr(c.stiffness), repr(c.coefficient), repr(c.gap),
         *_place(c.place, model.dimension), -1 if c.pulls else 1]
        for k, c in enumerate(model.contacts, start=1)
    )  # fmt: skip
    return _table(["number", "contact", "stiffness_n_m", "friction_coefficient", "gap_m", *axes, "force_sign"], rows)


def _case(work: Workspace, model: ExportedModel, form: Format) -> str:
    """A case file of the matrices beside it."""
    title = (work.given.title if work.given is not None else "") or "a model"
    friction = "friction at mu = {!r} in K" if model.contacts else "at mu = {!r}"
    at = "" if model.mu is None else f", {friction.format(model.mu)}"
    lines = [
        f"# Matrices that stridor has exported. {FREEDOMS} says what their rows are, {LABELS} as stridor reads it.",
        f"title = {_quoted(f'{title}, as matrices{at}')}",
    ]
    if work.given is not None and work.given.units != "SI":
        lines.append(f"units = {_quoted(work.given.units)}")
    settings = work.modal
    lines += ["", "[modal]", f"max_frequency_hz = {settings.max_frequency_hz!r}", f"modes = {settings.modes}"]
    if model.mu is None:
        low, high = settings.friction_range
        lines += [f"friction_range = [{low!r}, {high!r}]"]
        lines += [f"sweep_points = {settings.sweep_points}"] if settings.sweep_points is not None else []
    if not settings.damped:
        lines.append("damped = false")
    lines += ["", "[matrices]", f"dimension = {model.dimension}", f"labels = {_quoted(LABELS)}", "terms = ["]
    for term in model.terms:
        name = f"name = {_quoted(term.name if form == 'mat' else term.name.upper())}, " if form in HOLDS_ALL else ""
        factor = f', factor = "{term.factor}"' if isinstance(term.factor, str) else ""
        file = _quoted(file_of(term.name, form))
        meant = ", one_sided = true" if _is_one_sided(term.matrix) else ""
        what = f'{name}role = "{term.role}"{factor}{meant}'
        lines.append(f"  {{ file = {file}, {what} }},    # {_meaning(term.name, model)}")
    return "\n".join([*lines, "]"]) + "\n"


def _is_one_sided(matrix: Sparse) -> bool:
    """Whether it looks like one half of a matrix to who reads it, as friction between few freedoms may."""
    held = matrix.copy()
    held.eliminate_zeros()
    return lone(held) is not None


def _quoted(text: str) -> str:
    """A basic string of TOML, which JSON's strings are."""
    return json.dumps(text, ensure_ascii=False)
