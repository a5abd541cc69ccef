"""Reduced models to and from files: one .npz for each, whole or not at all, and nothing in it that could be run.

An archive of NumPy arrays beside a JSON header that says what they are: format number, parameters, terms with their
factors as data, numbers of the model, which case and which version of stridor it comes from, and hashes of all of that:
a model whose sketches were changed would estimate errors of 0 and be believed. Matrices are compressed a
little (a third of the size for a second or two), each array they have in common is written once; the basis is noise to
any compression and goes in as it is.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import zipfile
from collections.abc import Generator, Mapping
from dataclasses import MISSING, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, cast

import numpy as np
import scipy.sparse as sp

from ..case import Case
from ..errors import CaseError
from ..modal.parametric import Parameter, ParametricProblem, ReducedModel, Term
from ..modal.parametric.contacts import ContactsProblem
from ..modal.parametric.contacts_rigid import Elimination
from ..modal.parametric.factors import ParameterFactor, factor_from_json
from ..modal.parametric.problem import POWERS
from ..modal.parametric.states import States
from ..reading import ZIP, bounded, irregular, size_words
from ..study.provenance import versions
from .archive_reader import ArchiveReader, check_unfolded, whole_count
from .atomic import replacing
from .left_out import KEEPS, Keep, LeftOut, kept_in
from .seals import digest, text_digest

FORMAT = "stridor reduced model"
VERSION = 2
SEAL = "sha256"  # of the header without it, which holds the hashes of all arrays
HEADER = "header.json"
MOST_HEADER = 2**28
QUICK = 1  # compression: half the time of the usual 6, a tenth larger

_NUMBERS = ("frequency", "constant", "bound", "solves", "whole")
_ARRAYS = ("vectors", "projected", "right_sketch", "left_sketch")
# A file has no case to look at: of points outside the box its model says that it does not know who touches there.
_OF_CONTACTS = {"terms", "parameters", "elimination", "notes", "elsewhere", "touching", "looked"}
_NAMED = {"problem", "seconds", "states", *_NUMBERS, *_ARRAYS}


def save_reduced(
    model: ReducedModel,
    path: str | Path,
    *,
    case: Case | Mapping[str, Any] | None = None,
    keep: Keep = "all",
) -> Path:
    """Write a reduced model to ``path`` (.npz) by way of a temporary file, as `datasets.save` says."""
    if keep not in KEEPS:
        raise CaseError("keep", keep, f"one of {', '.join(KEEPS)}")
    lost = kept_in(model)
    if KEEPS.index(keep) < KEEPS.index(lost):
        raise CaseError("keep", keep, f"the model holds no more than {lost!r} itself: it was read from such a file")
    _know_every_field(model)
    written = _Arrays()
    header = _header(model, keep, written, case)
    header["contents"] = {name: digest(array) for name, (array, _) in written.arrays.items()}
    header[SEAL] = text_digest(header)
    target = Path(path)
    with replacing(target) as temporary:
        _write(temporary, header, written)
    return target


def load_reduced(path: str | Path) -> ReducedModel:
    """The reduced model in a file written by ``save_reduced``. Raises as `datasets.open`."""
    target = Path(path)
    with _opened(target) as (archive, header):
        return _model(archive, header)


def provenance_of(path: str | Path) -> dict[str, Any]:
    """Where a saved reduced model comes from: title, text and hash of its case (None where it was saved without),
    versions, when. Raises CaseError as `load_reduced`."""
    target = Path(path)
    with _opened(target) as (_, header):
        found = dict(header["provenance"])
        texts = {name: None if found[name] is None else str(found[name]) for name in ("title", "case", "case_sha256")}
        by = {str(name): str(version) for name, version in found["versions"].items()}
        return {"analysis": str(found["analysis"]), **texts, "versions": by, "created": str(found["created"])}


# -- writing ----------------------------------------------------------------------------------------------------------
class _Arrays:
    """Arrays by the name they get in the file, and whether they are compressed; equal ones have one name."""

    def __init__(self) -> None:
        self.arrays: dict[str, tuple[Any, bool]] = {}
        self._known: dict[tuple[str, bytes], str] = {}

    def take(self, name: str, array: Any, *, compressed: bool = False) -> str:
        """The name under which an array is written."""
        plain = np.ascontiguousarray(array)
        if compressed:
            key = str(plain.dtype), hashlib.sha256(plain.data).digest()
            if key in self._known:
                return self._known[key]
            self._known[key] = name
        self.arrays[name] = plain, compressed
        return name


def _write(path: Path, header: Mapping[str, Any], written: _Arrays) -> None:
    """The archive, its header first: a file cut short can still be told for what it was."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=QUICK) as archive:
        archive.writestr(HEADER, json.dumps(header, indent=1, ensure_ascii=False))
        for name, (array, compressed) in written.arrays.items():
            member = f"{name}.npy" if compressed else zipfile.ZipInfo(f"{name}.npy")
            with archive.open(member, "w", force_zip64=True) as stream:
                np.lib.format.write_array(stream, array, allow_pickle=False)


def _origin(case: Case | Mapping[str, Any] | None) -> dict[str, Any]:
    """Where a model comes from, as its file says it."""
    if isinstance(case, Mapping):
        return dict(case)
    text = None if case is None else case.text
    return {
        "analysis": "reduce",
        "title": None if case is None else case.title,
        "case": text,
        "case_sha256": None if text is None else hashlib.sha256(text.encode()).hexdigest(),
        "versions": versions(),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def _header(
    model: ReducedModel, keep: Keep, written: _Arrays, case: Case | Mapping[str, Any] | None
) -> dict[str, Any]:
    for name in _ARRAYS:
        if name != "vectors" or keep != "eigenvalues":
            written.take(name, getattr(model, name))
    if model.states is not None:
        written.take("right_states", model.states.right)
        written.take("left_states", model.states.left)
    problem = model.problem
    return {
        "format": FORMAT,
        "version": VERSION,
        "provenance": _origin(case),
        "keep": keep,
        "freedoms": problem.size,
        "unknowns": model.size,
        "sketch": int(model.right_sketch.shape[1]),
        "states": 0 if model.states is None else model.states.count,
        "parameters": [{"name": p.name, "low": p.low, "high": p.high, "value": p.value} for p in problem.parameters],
        "terms": [_term(k, t, written, matrices=keep == "all") for k, t in enumerate(problem.terms)],
        "contacts": _contacts(problem, written, vectors=keep != "eigenvalues"),
        "model": {name: _plain(getattr(model, name)) for name in _NUMBERS} | {"seconds": dict(model.seconds)},
    }


def _term(number: int, term: Term, written: _Arrays, *, matrices: bool) -> dict[str, Any]:
    factor = _factor(f"terms[{number}].factor", term.factor, term.role)
    found = {"role": term.role, "symmetric": bool(term.symmetric), "factor": factor}
    if matrices:
        return found | {"matrix": _csr(f"term{number}", term.matrix, written)}
    return found | {"matrix": {"nonzeros": int(term.matrix.nnz)}}


def _contacts(problem: ParametricProblem, written: _Arrays, *, vectors: bool) -> dict[str, Any] | None:
    """What a problem with contacts has beside its terms; None for others."""
    if type(problem) is ParametricProblem:
        return None
    if not isinstance(problem, ContactsProblem) or {f.name for f in fields(problem)} != _OF_CONTACTS:
        raise CaseError("model.problem", type(problem).__name__, f"files of format {VERSION} cannot hold it")
    found = problem.elimination
    touching = None if problem.touching is None else [int(one) for one in problem.touching]
    if found is None or not vectors:
        said = {"notes": list(problem.notes), "elsewhere": list(problem.elsewhere)}
        return said | {"touching": touching, "elimination": None}
    changes = [
        {"factor": _factor(f"elimination[{k}].factor", f, "rigid contact"), "matrix": _csr(f"change{k}", v, written)}
        for k, (f, v) in enumerate(found.changes)
    ]
    motion = _csr("motion", found.motion, written)
    return {
        "notes": list(problem.notes),
        "elsewhere": list(problem.elsewhere),
        "touching": touching,
        "elimination": {"displacements": int(found.motion.shape[0]), "motion": motion, "changes": changes},
    }


def _csr(name: str, matrix: Any, written: _Arrays) -> dict[str, Any]:
    csr = sp.csr_array(matrix)
    # The narrowest indices that will do, as they come back.
    csr = sp.csr_array((np.asarray(csr.data, dtype=float), csr.indices, csr.indptr), shape=csr.shape)
    return {"nonzeros": int(csr.nnz)} | {
        part: written.take(f"{name}_{part}", getattr(csr, part), compressed=True)
        for part in ("data", "indices", "indptr")
    }


def _factor(where: str, factor: object, of: str) -> dict[str, Any]:
    """A factor as data. Raises CaseError where it is none."""
    if isinstance(factor, ParameterFactor):
        document = factor.to_json()
        with contextlib.suppress(ValueError):
            if factor_from_json(json.loads(json.dumps(document))) == factor:
                return document
    raise CaseError(
        where, f"{of}, {_called(factor)}",
        "only factors that are data can be saved, not functions of one's own: Product, Formula, Lagrange and others of "
        "stridor.modal.parametric.factors",
    )  # fmt: skip


def _called(function: object) -> str:
    return str(getattr(function, "__name__", type(function).__name__))


def _plain(value: Any) -> Any:
    """A number or a yes or no as Python has it."""
    return value.item() if isinstance(value, np.generic) else value


def _know_every_field(model: ReducedModel) -> None:
    """Raise CaseError for a field that this format does not know and that is not as it would be without it."""
    for one in fields(model):
        if one.name in _NAMED:
            continue
        default = one.default if one.default_factory is MISSING else one.default_factory()
        value = getattr(model, one.name)
        if isinstance(value, np.ndarray) or value != default:
            raise CaseError(f"model.{one.name}", None, f"files of format {VERSION} cannot hold it")


# -- reading ----------------------------------------------------------------------------------------------------------
@contextlib.contextmanager
def _opened(path: Path) -> Generator[tuple[zipfile.ZipFile, dict[str, Any]], None, None]:
    """The archive and its header. Raises CaseError for what is no reduced model that this version can read."""
    foreign = CaseError("file", str(path), "no reduced model; give a file of st.save or stridor reduce --save")
    try:
        if reason := irregular(path):
            raise CaseError("file", str(path), reason)
        with path.open("rb") as stream:
            start = stream.read(200)
    except FileNotFoundError:
        raise CaseError("file", str(path), "no such file") from None
    except (OSError, ValueError) as error:
        raise CaseError("file", str(path), f"cannot be read: {getattr(error, 'strerror', None) or error}") from error
    # A file cut short has lost its table of contents; its beginning says whose it is.
    ours = start.startswith(ZIP) and HEADER.encode() in start
    if not ours:
        raise foreign
    with _damage_told(path), bounded(), zipfile.ZipFile(path) as archive:
        check_unfolded(archive, path.stat().st_size)
        header = json.loads(_header_bytes(archive))
        if not isinstance(header, dict) or cast("dict[str, Any]", header).get("format") != FORMAT:
            raise foreign
        known = cast("dict[str, Any]", header)
        version = known["version"]
        if isinstance(version, int) and version > VERSION:
            by = dict(known.get("provenance", {})).get("versions", {}).get("stridor", "a newer stridor")
            raise CaseError(
                "file", str(path), f"written in format {version} by stridor {by}; this one reads formats up to "
                f"{VERSION}: bring stridor up to date",
            )  # fmt: skip
        if version == 1:
            raise CaseError(
                "file", str(path), "written in format 1, without the hashes by which a changed model is told; make it "
                "again",
            )  # fmt: skip
        if version != VERSION:
            raise ValueError(f"format {version!r}")
        if text_digest({name: value for name, value in known.items() if name != SEAL}) != known[SEAL]:
            raise ValueError("its header changed")
        yield archive, known


def _header_bytes(archive: zipfile.ZipFile) -> bytes:
    """The header, which may be as large as the terms of many bodies make it. Raises ValueError beyond that."""
    size = archive.getinfo(HEADER).file_size
    if size > MOST_HEADER:
        raise ValueError(f"its header claims {size_words(size)}")
    return archive.read(HEADER)


@contextlib.contextmanager
def _damage_told(path: Path) -> Generator[None, None, None]:
    """Whatever goes wrong with what is in a file as one CaseError."""
    try:
        yield
    except CaseError as error:
        # A factor's text or a parameter's range that is none.
        if error.problems[0].where == "file":
            raise
        raise _damaged(path, str(error)) from error
    except MemoryError as error:
        raise _damaged(path, "it claims to hold more than the memory does") from error
    except Exception as error:
        # Readers of archives, arrays and JSON raise whatever bytes make of them that are not what they should be.
        said = str(error) if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"
        raise _damaged(path, said) from error


def _damaged(path: Path, what: str) -> CaseError:
    short = " ".join(what.split())
    short = short if len(short) <= 120 else short[:119] + "…"
    return CaseError("file", str(path), f"a reduced model, but cut short or damaged ({short}); make it again")


def _model(archive: zipfile.ZipFile, header: Mapping[str, Any]) -> ReducedModel:
    keep = header["keep"]
    if keep not in KEEPS:
        raise ValueError(f"keep {keep!r}")
    n, r, s = (whole_count(header[name]) for name in ("freedoms", "unknowns", "sketch"))
    reading = ArchiveReader(archive, header["contents"])
    terms = tuple(_read_term(reading, document, n, keep) for document in header["terms"])
    parameters = tuple(
        Parameter(str(p["name"]), float(p["low"]), float(p["high"]), float(p["value"])) for p in header["parameters"]
    )
    problem = _read_problem(reading, header["contacts"], terms, parameters, n, keep)
    if not (terms and parameters and np.all(np.isfinite(problem.factors(problem.reference)))):
        raise ValueError("no terms or parameters, or factors that are no numbers")
    vectors: Any = LeftOut("its basis was", (n, r), n * r)
    if keep != "eigenvalues":
        vectors = reading.numbers("vectors", (n, r))
    # Files of versions that knew no states say nothing of them.
    count, states = whole_count(header.get("states", 0)), None
    if count:
        states = States(*(reading.numbers(f"{side}_states", (2 * r, count)) for side in ("right", "left")))
    numbers = header["model"]
    frequency, constant, bound = (float(numbers[name]) for name in ("frequency", "constant", "bound"))
    if not (0 < frequency < np.inf and constant > 0 and 0 < bound < np.inf):
        raise ValueError("a frequency, a constant or a bound that is none")
    return ReducedModel(
        problem=problem,
        vectors=vectors,
        projected=reading.numbers("projected", (len(terms), r, r)),
        right_sketch=reading.numbers("right_sketch", (len(terms), s, r)),
        left_sketch=reading.numbers("left_sketch", (len(terms), s, r)),
        frequency=frequency,
        constant=constant,
        bound=bound,
        seconds={str(part): float(value) for part, value in numbers["seconds"].items()},
        solves=int(numbers["solves"]),
        whole=bool(numbers["whole"]),
        states=states,
    )


def _read_term(reading: ArchiveReader, document: Mapping[str, Any], n: int, keep: Keep) -> Term:
    role = document["role"]
    if role not in POWERS:
        raise ValueError(f"a term of role {role!r}")
    matrix: Any = LeftOut("the full matrices were", (n, n), whole_count(document["matrix"]["nonzeros"]))
    if keep == "all":
        matrix = reading.csr(document["matrix"], (n, n))
    return Term(matrix, role, factor_from_json(document["factor"]), bool(document["symmetric"]))


def _read_problem(
    reading: ArchiveReader, contacts: Mapping[str, Any] | None, terms: tuple[Term, ...],
    parameters: tuple[Parameter, ...], n: int, keep: Keep,
) -> ParametricProblem:  # fmt: skip
    if contacts is None:
        return ParametricProblem(terms, parameters)
    notes = tuple(str(note) for note in contacts["notes"])
    # Files of before have neither.
    elsewhere = tuple(str(note) for note in contacts.get("elsewhere", ()))
    held = contacts.get("touching")
    touching = None if held is None else np.array(held, dtype=bool)
    found = contacts["elimination"]
    if found is None or keep == "eigenvalues":
        return ContactsProblem(terms, parameters, None, notes, elsewhere, touching)
    shape = whole_count(found["displacements"]), n
    changes = tuple((factor_from_json(c["factor"]), reading.csr(c["matrix"], shape)) for c in found["changes"])
    elimination = Elimination(reading.csr(found["motion"], shape), changes)
    return ContactsProblem(terms, parameters, elimination, notes, elsewhere, touching)
