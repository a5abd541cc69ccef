"""Matrices of other programs as a body: terms summed by role, freedoms put where nodes of a mesh have theirs.

A body made so has the displacements of every node first, as a meshed one has, and then whatever else the matrices have:
rotations, scalars, internal freedoms, nodes outside the mesh. Displacements that the matrices lack are held.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from ..case import Case
from ..case.bodies import MatrixBody, MatrixTerm
from ..case.expression import parse_expression
from ..errors import CaseError, Problem
from ..matrices.labels import read_labels
from ..matrices.model import Labels, Role, StoredMatrix
from ..matrices.read import common_labels, read_matrix
from ..matrices.report import held_freedoms
from ..matrices.source import Doubt
from ..mesh.abaqus import read_abaqus
from ..mesh.model import Mesh
from ..mesh.paths import check_file, shown_path
from ..typing import Array, BoolArray, IntArray, Sparse
from .imported_halves import half_doubts

ROLES: tuple[Role, ...] = ("mass", "damping", "stiffness")
ROUNDING = 1e-12  # of the entries around it: what A − Aᵀ may hold of a matrix that is meant to be symmetric
_DIRECTIONS = ("scalar", "x", "y", "z", "rotation x", "rotation y", "rotation z")
_ROTATIONS = (4, 5, 6)


@dataclass(frozen=True)
class ImportedTerm:
    """One term of a body before its factor: its role, its matrix, and the factor, a number or an expression; where: the
    factor's path in the case."""

    role: Role
    matrix: Sparse
    factor: float | str
    where: str = "factor"


@dataclass(frozen=True)
class Terms:
    """Summed matrices (n, n) of a body by role in the order of the files' freedoms, in SI units; labels of the
    freedoms, None where nothing names them; stored: the files, each with the role it is used in; shares: the terms that
    were summed; values: of their factors; doubts: files that may hold one half of a matrix, a sentence each."""

    mass: Sparse
    damping: Sparse
    stiffness: Sparse
    labels: Labels | None
    stored: tuple[StoredMatrix, ...]
    shares: tuple[ImportedTerm, ...]
    values: tuple[float, ...]
    doubts: tuple[str, ...] = ()


@dataclass(frozen=True)
class Imported:
    """Matrices (N, N) of a body: dimension · nodes displacements, then the extra freedoms.

    points (k, d) [m], NaN where no mesh gives them; numbers (k,) of the nodes, sorted or as in the mesh; lacking: local
    freedoms that the matrices do not have; extra: what each of the freedoms beyond the displacements is called;
    rotations (r, 2): those of them that are a rotation of a node, as node, from 0, and local freedom.
    """

    mass: Sparse
    damping: Sparse
    stiffness: Sparse
    points: Array
    numbers: IntArray
    lacking: IntArray
    extra: tuple[str, ...]
    mesh: Mesh | None
    rotations: IntArray


def load_matrices(case: Case, name: str, body: MatrixBody, mu: float | None = None) -> Imported:
    """The body, with its factors at the case's parameters and the friction coefficient ``mu`` (None: the case's own).

    Raises CaseError for files that will not do, matrices that do not fit together or into the mesh, and points that are
    none.
    """
    return _with_indices(case, name, body, mu)[0]


def load_shares(case: Case, name: str, body: MatrixBody, mu: float | None = None) -> tuple[ImportedTerm, ...]:
    """The terms (N, N) that with their factors add up to the body's matrices, wherever the factors vary.

    Raises CaseError as `load_matrices`, and where a freedom has entries in no other term than those with a factor of
    zero, so that the body lacks it.
    """
    found, terms, index = _with_indices(case, name, body, mu)
    size = found.mass.shape[0]
    moved = [_moved(share.matrix, index, size) for share in terms.shares]
    present = np.ones(size, dtype=bool)
    present[found.lacking] = False
    held = np.zeros(size, dtype=bool)
    held[held_freedoms(_moved(terms.stiffness, index, size))] = True
    lost = _present(moved) & ~present & ~held
    if lost.any():
        accepted = (
            f"{np.count_nonzero(lost)} freedoms have entries only in terms whose factor is zero for the values of the "
            "case, which holds them; give [parameters] values for which it is not"
        )
        raise CaseError(f"bodies.{name}.terms", None, accepted)
    keep = sp.diags_array(present.astype(float))
    moved = [sp.csr_array(keep @ m @ keep) for m in moved]
    for role in ROLES:
        mine = [k for k, share in enumerate(terms.shares) if share.role == role]
        if all(is_symmetric(moved[k]) for k in mine):
            for k in mine:
                moved[k] = cleaned(moved[k])
    return tuple(replace(share, matrix=matrix) for share, matrix in zip(terms.shares, moved, strict=True))


def _with_indices(case: Case, name: str, body: MatrixBody, mu: float | None) -> tuple[Imported, Terms, IntArray]:
    """The body, the terms it is made of, and the local freedom (n,) of each of their rows."""
    where = f"bodies.{name}"
    terms = load_terms(case, name, body, mu)
    mesh = None if body.mesh is None else _mesh(where, body)
    numbers = _node_numbers(where, body, terms.labels, mesh)
    if mesh is not None and terms.labels is not None:
        _check_axes(where, body, mesh, terms.labels)
    index, extra = _indices(where, body, terms.labels, numbers, terms.mass.shape[0], mesh)
    size = body.dimension * len(numbers) + len(extra)
    matrices = [_moved(getattr(terms, role), index, size) for role in ROLES]
    present = _present(matrices)
    held = held_freedoms(matrices[2])
    present[held] = False
    if len(held):
        keep = sp.diags_array(present.astype(float))
        matrices = [sp.csr_array(keep @ m @ keep) for m in matrices]
    if not matrices[0].nnz:
        zero = "the mass is zero" + (" where 1e36 in the stiffness does not hold it" if len(held) else "")
        raise CaseError(f"{where}.terms", None, f"{zero}; without a mass nothing vibrates")
    points = np.full((len(numbers), body.dimension), np.nan) if mesh is None else mesh.points
    mass, damping, stiffness = (cleaned(m) for m in matrices)
    rotations = _rotations(terms.labels, numbers, index)
    lacking = np.flatnonzero(~present)
    found = Imported(mass, damping, stiffness, points, numbers, lacking, tuple(extra), mesh, rotations)
    _check_points(where, body, found, terms.labels, present)
    return found, terms, index


def load_terms(case: Case, name: str, body: MatrixBody, mu: float | None = None) -> Terms:
    """The sums of a body's terms by role. Raises CaseError for files that will not do or do not fit together."""
    where = f"bodies.{name}"
    read = [_read(term, f"{where}.terms.{k}") for k, term in enumerate(body.terms)]
    pairs = enumerate(zip(body.terms, read, strict=True))
    roles: list[Role] = [_role(term, found, f"{where}.terms.{k}") for k, (term, found) in pairs]
    if "mass" not in roles:
        raise CaseError(f"{where}.terms", None, 'none has the role "mass"; without a mass nothing vibrates')
    stored = [_in_role(term, found, role) for term, found, role in zip(body.terms, read, roles, strict=True)]
    if body.labels is not None:
        stored = _with_labels(stored, body.labels, f"{where}.labels")
    matrices, labels = common_labels(stored, where=f"{where}.terms")
    doubts = half_doubts(case, where, body, stored, matrices)
    size = matrices[0].shape[0]
    if body.scale != 1.0:
        matrices = [_in_metres(matrix, labels, body.scale) for matrix in matrices]
    sums = {role: sp.csr_array((size, size)) for role in ROLES}
    shares: list[ImportedTerm] = []
    values: list[float] = []
    for k, (term, role, matrix) in enumerate(zip(body.terms, roles, matrices, strict=True)):
        path = f"{where}.terms.{k}.factor"
        factor = _factor(case, term, mu, path)
        sums[role] = sp.csr_array(sums[role] + factor * matrix)
        shares.append(ImportedTerm(role, matrix, term.factor, path))
        values.append(factor)
    summed = sums["mass"], sums["damping"], sums["stiffness"]
    return Terms(*summed, labels, tuple(stored), tuple(shares), tuple(values), doubts)


def is_symmetric(matrix: Sparse) -> bool:
    """Whether A = Aᵀ up to rounding, each entry judged by the largest ones of its row and column."""
    skew = sp.coo_array(matrix - matrix.T)
    if not skew.nnz:
        return True
    sizes = abs(matrix)
    largest = np.maximum(sizes.max(axis=1).toarray().ravel(), sizes.max(axis=0).toarray().ravel())
    return bool(np.all(np.abs(skew.data) <= ROUNDING * np.sqrt(largest[skew.row] * largest[skew.col])))


def _read(term: MatrixTerm, where: str) -> StoredMatrix:
    path = Path(term.file)
    try:
        status = path.stat()
        stamp = (status.st_mtime_ns, status.st_size)
    except (OSError, ValueError):
        stamp = (0, 0)
    return _read_once(term.file, term.name, f"{where}.file", stamp)


@lru_cache(maxsize=16)
def _read_once(path: str, name: str | None, where: str, stamp: tuple[int, int]) -> StoredMatrix:
    del stamp  # only there so that a changed file is read again
    return read_matrix(path, name, where=where)


def _role(term: MatrixTerm, found: StoredMatrix, where: str) -> Role:
    if term.role is not None:
        return term.role
    if found.role is None:
        accepted = f'missing – {found.source} does not say what it holds; give "mass", "damping" or "stiffness"'
        if found.unsaid:
            accepted = f"missing – {found.source}, {found.name}: {found.unsaid}"
        raise CaseError(f"{where}.role", None, accepted)
    return found.role


def _in_role(term: MatrixTerm, found: StoredMatrix, role: Role) -> StoredMatrix:
    """What a file holds as a matrix of a role, with a doubt where its name tells of another.

    Damping may be made of M and K, and a factor may make one of the other (−Ω² M is a stiffness): of these none.
    """
    if found.role in (None, role) or not found.certain or role == "damping" or term.factor != 1.0:
        return replace(found, role=role)
    doubt = Doubt(f"The role given is {role}, but by its name it is {_named_kind(found.role)}; are roles exchanged?")
    return replace(found, role=role, notes=(*found.notes, doubt))


def _named_kind(role: Role | None) -> str:
    return f"a {role}" if role != "damping" else "damping"


def _factor(case: Case, term: MatrixTerm, mu: float | None, where: str) -> float:
    if not isinstance(term.factor, str):
        return term.factor
    values = case.factor_values(mu)
    return parse_expression(term.factor, (*case.parameters, "mu"), where).value(values, where)


def _with_labels(stored: list[StoredMatrix], path: str, where: str) -> list[StoredMatrix]:
    """The labels of a file of their own for matrices whose files name no freedoms."""
    file = Path(path)
    named = next((s for s in stored if s.labels is not None), None)
    if named is not None:
        raise CaseError(where, shown_path(file), f"{named.source} names its freedoms itself; leave labels out")
    labels = read_labels(file, where)
    for s in stored:
        if s.matrix.shape[0] != len(labels.node):
            accepted = f"names {len(labels.node)} freedoms, {s.source} has {s.matrix.shape[0]}; write a line for each"
            raise CaseError(where, shown_path(file), accepted)
    return [replace(s, labels=labels) for s in stored]


def _in_metres(matrix: Sparse, labels: Labels | None, scale: float) -> Sparse:
    """A matrix of forces in N over lengths in other units, in SI: translations turn into metres, rotations stay."""
    size = matrix.shape[0]
    unit = np.full(size, 1.0 / scale)
    if labels is not None:
        unit[np.isin(labels.direction, _ROTATIONS)] = 1.0
    across = sp.diags_array(unit)
    return sp.csr_array(scale * (across @ matrix @ across))


def _mesh(where: str, body: MatrixBody) -> Mesh:
    assert body.mesh is not None, "asked for where there is one"
    check_file(Path(body.mesh), f"{where}.mesh", (".inp",))  # only these number their nodes
    try:
        mesh = read_abaqus(body.mesh, scale=body.scale, group=body.group, where=f"{where}.mesh").mesh
    except CaseError as error:
        # Its keys are those of a table mesh = { file, group, scale }, which this body has at its own level.
        told: list[Problem] = []
        for problem in error.problems:
            at = problem.where.replace(f"{where}.mesh.file", f"{where}.mesh").replace(f"{where}.mesh.", f"{where}.")
            told.append(replace(problem, where=at))
        raise CaseError.many(told) from None
    if mesh.dimension != body.dimension:
        raise CaseError(f"{where}.dimension", body.dimension, f"the mesh has {mesh.dimension} dimensions")
    assert mesh.numbers is not None, "Abaqus files number their nodes"
    if len(np.unique(mesh.numbers)) < len(mesh.numbers):
        accepted = "has several instances, in which numbers of nodes occur twice; choose one of them by group"
        raise CaseError(f"{where}.mesh", shown_path(Path(body.mesh)), accepted)
    if body.translation is not None:
        mesh = replace(mesh, points=mesh.points + np.array(body.translation))
    return mesh


def _check_axes(where: str, body: MatrixBody, mesh: Mesh, labels: Labels) -> None:
    """Raises CaseError where the mesh's file turns the axes of nodes along which the matrices have displacements.

    *TRANSFORM makes u' = R u the freedoms of a node, so that Abaqus writes R K Rᵀ. Contacts, supports, springs and
    loads along x, y, z would act on u' as if it were u.
    """
    if mesh.turned is None:
        return
    assert mesh.numbers is not None, "read from an Abaqus file"
    moving = labels.node[(labels.direction >= 1) & (labels.direction <= body.dimension)]
    turned = np.intersect1d(mesh.numbers[mesh.turned], moving)
    if len(turned):
        which = f"node {turned[0]}" + (f" and {len(turned) - 1} more" if len(turned) > 1 else "")
        accepted = (
            f"*TRANSFORM gives {which} axes of their own, along which Abaqus writes the matrices; they must be in "
            "global axes: write matrices and mesh without *TRANSFORM (if these matrices are in global axes, delete it "
            "in the mesh's file only)"
        )
        raise CaseError(f"{where}.mesh", shown_path(Path(body.mesh or "")), accepted)


def _node_numbers(where: str, body: MatrixBody, labels: Labels | None, mesh: Mesh | None) -> IntArray:
    """Numbers (k,) of the nodes whose displacements come first."""
    if labels is None:
        if mesh is not None:
            accepted = (
                "missing – the files of the matrices do not say to which nodes their freedoms belong; give a text file "
                'with a line "node direction" for each freedom'
            )
            raise CaseError(f"{where}.labels", None, accepted)
        return np.zeros(0, dtype=np.int64)
    moves = (labels.node > 0) & (labels.direction >= 1) & (labels.direction <= body.dimension)
    named = np.unique(labels.node[moves])
    if mesh is None:
        return named
    assert mesh.numbers is not None, "read from an Abaqus file"
    stray = np.setdiff1d(named, mesh.numbers)
    if len(stray) and body.group is None:
        more = f" and {len(stray) - 1} more" if len(stray) > 1 else ""
        accepted = (
            f"no element of it has node {stray[0]}{more}, which the matrices name; give the mesh of the whole model, "
            "or say by group which part of it you mean"
        )
        raise CaseError(f"{where}.mesh", shown_path(Path(body.mesh or "")), accepted)
    if len(stray) == len(named):
        raise CaseError(f"{where}.group", body.group, "the matrices have no freedom of any node of it")
    return mesh.numbers


def _indices(
    where: str, body: MatrixBody, labels: Labels | None, numbers: IntArray, size: int, mesh: Mesh | None
) -> tuple[IntArray, list[str]]:
    """Local freedom (n,) of each row of the matrices, and the names of those that are no displacement of a node."""
    name, d = where.partition(".")[2], body.dimension
    if labels is None:
        return np.arange(size), [f"{name} freedom {k}" for k in range(1, size + 1)]
    order = np.argsort(numbers, kind="stable")
    at = np.searchsorted(numbers[order], labels.node)
    at = np.minimum(at, len(numbers) - 1)
    node = order[at] if len(numbers) else np.zeros(size, dtype=np.int64)
    known = numbers[node] == labels.node if len(numbers) else np.zeros(size, dtype=bool)
    moves = known & (labels.direction >= 1) & (labels.direction <= d)
    index = np.empty(size, dtype=np.int64)
    index[moves] = d * node[moves] + labels.direction[moves] - 1
    index[~moves] = d * len(numbers) + np.arange(np.count_nonzero(~moves))
    rest = zip(labels.node[~moves].tolist(), labels.direction[~moves].tolist(), strict=True)
    return index, [_extra_name(name, node, direction) for node, direction in rest]


def _rotations(labels: Labels | None, numbers: IntArray, index: IntArray) -> IntArray:
    """Rotations (r, 2) of the nodes of these numbers, as node and local freedom; index (n,): that of each label."""
    if labels is None or not len(numbers):
        return np.zeros((0, 2), dtype=np.int64)
    order = np.argsort(numbers, kind="stable")
    at = order[np.minimum(np.searchsorted(numbers[order], labels.node), len(numbers) - 1)]
    mine = np.isin(labels.direction, _ROTATIONS) & (numbers[at] == labels.node)
    return np.column_stack([at[mine], index[mine]])


def _extra_name(name: str, node: int, direction: int) -> str:
    if node <= 0:
        return f"{name} internal freedom {-node}"
    known = 0 <= direction < len(_DIRECTIONS)
    return f"{name} node {node} {_DIRECTIONS[direction] if known else f'freedom {direction}'}"


def _moved(matrix: Sparse, index: IntArray, size: int) -> Sparse:
    coo = sp.coo_array(matrix)
    return sp.csr_array(sp.coo_array((coo.data, (index[coo.row], index[coo.col])), shape=(size, size)))


def _present(matrices: list[Sparse]) -> BoolArray:
    """Freedoms (N,) with an entry in any of the matrices."""
    found = np.zeros(matrices[0].shape[0], dtype=bool)
    for matrix in matrices:
        matrix.eliminate_zeros()
        coo = sp.coo_array(matrix)
        found[coo.row] = True
        found[coo.col] = True
    return found


def cleaned(matrix: Sparse) -> Sparse:
    """A matrix that is symmetric up to rounding as one that is."""
    return sp.csr_array((matrix + matrix.T) / 2) if is_symmetric(matrix) else matrix


def _check_points(
    where: str, body: MatrixBody, found: Imported, labels: Labels | None, present: BoolArray
) -> None:
    """Raises CaseError for points at nodes that the mesh or the matrices do not have."""
    problems: list[Problem] = []
    for point, at in body.points.items():
        if not isinstance(at, int):
            if found.mesh is not None and point in found.mesh.boundaries:
                accepted = f"{found.mesh.source} has a boundary of this name; choose another name"
                problems.append(Problem(f"{where}.points.{point}", at, accepted))
            continue
        node = np.flatnonzero(found.numbers == at)
        reason = ""
        if labels is None:
            reason = "nothing says which freedoms a node has; give labels"
        elif not len(node):
            reason = "no such node in the matrices" if found.mesh is None else f"no such node in {found.mesh.source}"
            reason += _range_words(found.numbers)
        elif not present[body.dimension * node[0] + np.arange(body.dimension)].any():
            reason = "the matrices have no freedoms of this node: it is held, or was left out of them"
        if reason:
            problems.append(Problem(f"{where}.points.{point}", at, reason))
    if problems:
        raise CaseError.many(problems)


def _range_words(numbers: IntArray) -> str:
    if not len(numbers):
        return ", which have no nodes with displacements"
    return f"; there are {len(numbers)} nodes, numbered from {numbers.min()} to {numbers.max()}"
