"""Matrix files of Abaqus and Nastran, written here in each program's own words, against the numbers entry by entry."""

from __future__ import annotations

import struct
import time

import numpy as np
import pytest

from stridor.errors import CaseError
from stridor.matrices import Labels, StoredMatrix, common_labels, read_matrix

# A beam of two nodes whose hybrid element has internal freedoms; supports on node 1. Columns in order, rows below.
HYBRID = """** a comment
-1,1, -1,1,  3.333333333333317e+01
-1,2, -1,1, -8.333333333333492e+00
1,1, -1,1,  2.500000000000002e+01
2,1, -1,1, -2.500000000000002e+01
-1,2, -1,2,  3.333333333333316e+01
1,1, 1,1,  1.000000000000000e+36
2,1, 1,1, -3.000000000000020e+02
2,1, 2,1,  3.000000000000020e+02
"""
# Friction: the tangent (2,1) feels the pressure (-7,1) with μ, not the other way round.
SLIDING = """2,1, 2,1,  5.D+0
3,1, 2,1, -2.0e+00
-7,1, 2,1,  0.0e+00
2,1, 3,1, -2.0e+00
3,1, 3,1,  4.0e+00
3,1, -7,1,  1.0e+00
2,1, -7,1,  0.4e+00
-7,1, 3,1,  1.0e+00
"""
SYMMETRIC = np.array([[4.0, -1.0, 0.0], [-1.0, 5.0, 2.5e-3], [0.0, 2.5e-3, 6.0]])
GENERAL = np.array([[4.0, -1.0, 0.0], [0.5, 5.0, 2.5e-3], [-7.0, 0.0, 6.0]])


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def read(tmp_path):
    """Writes a text or bytes to a file and reads it."""

    def reader(file: str, data: str | bytes, name: str | None = None) -> StoredMatrix:
        (tmp_path / file).write_bytes(data.encode() if isinstance(data, str) else data)
        return read_matrix(file, name)

    return reader


def refused(call) -> str:
    with pytest.raises(CaseError) as caught:
        call()
    assert "\n" not in str(caught.value)
    return str(caught.value)


def labels(stored) -> list[tuple[int, int]]:
    assert stored.labels is not None
    return list(zip(stored.labels.node.tolist(), stored.labels.direction.tolist(), strict=True))


# -- Abaqus ------------------------------------------------------------------------------------------------------------
def test_abaqus_symmetric_with_internal_freedoms_and_supports(read):
    stored = read("beam_STIF1.mtx", HYBRID)
    assert labels(stored) == [(1, 1), (2, 1), (-1, 1), (-1, 2)]
    assert stored.matrix.toarray().tolist() == [
        [1e36, -3.00000000000002e2, 2.500000000000002e1, 0.0],
        [-3.00000000000002e2, 3.00000000000002e2, -2.500000000000002e1, 0.0],
        [2.500000000000002e1, -2.500000000000002e1, 3.333333333333317e1, -8.333333333333492],
        [0.0, 0.0, -8.333333333333492, 3.333333333333316e1],
    ]
    assert (stored.role, stored.form, stored.source) == ("stiffness", "symmetric", "beam_STIF1.mtx")
    assert stored.notes == (
        "No entry has a counterpart across the diagonal: taken as one half of a symmetric matrix and completed.",
        "1 freedom has 1e36 on the diagonal: Abaqus' mark of *BOUNDARY; they are held.",
    )


def test_abaqus_not_symmetric_stays_as_it_is(read):
    stored = read("pad_STIF3.mtx", SLIDING)
    assert labels(stored) == [(2, 1), (3, 1), (-7, 1)]
    assert stored.matrix.toarray().tolist() == [[5.0, -2.0, 0.4], [-2.0, 4.0, 1.0], [0.0, 1.0, 0.0]]
    assert stored.form == "general"
    assert stored.notes == ()
    assert stored.matrix.nnz == 7


@pytest.mark.parametrize(
    ("job", "role"),
    [
        ("a_STIF1", "stiffness"),
        ("a_mass2", "mass"),
        ("a_DMPV1", "damping"),
        ("a", None),
        ("pad_mass_STIF1", "stiffness"),
        ("low_load_STIF1", "stiffness"),
        ("DMPS_MASS1", "mass"),
        ("stif_2_mass_DMPV12", "damping"),
    ],
)
def test_abaqus_roles_are_in_the_names(read, job, role):
    assert read(f"{job}.mtx", SLIDING).role == role


def test_abaqus_labels_and_coordinates_are_columns_between_blanks(read):
    blanks = SLIDING.replace(",", " ").replace("\n", "  \r\n")
    assert (read("pad.mtx", blanks).matrix != read("pad.mtx", SLIDING).matrix).nnz == 0
    lower = read("a_MASS1.mtx", "      1      1   4.\n      2      1  -1.\n 2 2 5.\n\n 3 2 2.5e-3\n 3 3 6.0E+00\n")
    assert lower.labels is None
    assert lower.matrix.toarray().tolist() == SYMMETRIC.tolist()
    upper = read("a_MASS1.mtx", "1 1 4.\n1 2 -1.\n2 2 5.\n2 3 2.5e-3\n3 3 6.\n")
    assert upper.matrix.toarray().tolist() == SYMMETRIC.tolist()
    full = "".join(f"{i + 1} {j + 1} {float(GENERAL[i, j])!r}\n" for i, j in zip(*np.nonzero(GENERAL), strict=True))
    general = read("a_STIF1.mtx", full)
    assert general.form == "general"
    assert general.matrix.toarray().tolist() == GENERAL.tolist()


def test_abaqus_headers_win(read):
    one_sided = "1,1, 1,1, 2.\n2,1, 1,1, 3.\n2,1, 2,1, 4.\n"
    assert read("a.mtx", one_sided).matrix.toarray().tolist() == [[2, 3], [3, 4]]
    header = "*MATRIX INPUT, NAME=Kc, TYPE=UNSYMMETRIC, SCALE FACTOR=2.\n"
    stored = read("a.mtx", header + one_sided)
    assert stored.matrix.toarray().tolist() == [[4, 0], [6, 8]]
    assert (stored.form, stored.name, stored.notes) == ("general", "Kc", ())
    both = "*Matrix input, name=Kc\n" + one_sided + "1,1, 2,1, 3.\n2,2, 1,1, 7.\n"
    assert read("a.mtx", both).matrix.toarray().tolist() == [[2, 3, 7], [3, 4, 0], [7, 0, 0]]
    two = "*MATRIX INPUT, NAME=A\n1,1,1,1, 5.\n** between\n*MATRIX INPUT, NAME=B\n1,1,1,1, 6.\n*MATRIX ASSEMBLE, STIFFNESS=B\n"
    assert read("a.mtx", two, "b").matrix.toarray().tolist() == [[6.0]]


def test_abaqus_what_could_be_meant_otherwise_is_noted(read):
    mixed = read("a_DMPV1.mtx", "1,1, 1,1, 2.\n1,1, 2,1, 3.\n3,1, 2,1, 4.\n3,1, 1,1, 8.\n1,2, 3,1, 4.\n1,2, 1,1, 4.\n 2,1, 1,2, 5.\n")
    assert len(mixed.notes) == 1
    assert mixed.notes[0].startswith("Entries stand on both sides of the diagonal, but none has a counterpart")
    doubled = read("a.mtx", "1,1, 1,1, 2.\n1,1, 1,1, 3.")
    assert doubled.matrix.toarray().tolist() == [[5.0]]
    assert doubled.notes == (
        "Added up: 1 of 2 entries stand at a place that an earlier one has taken.",
        "The last line has no line end: if the file was cut off there, its last number is wrong.",
    )
    diagonal = read("a_MASS1.mtx", "1,1, 1,1, 2.\n2,1, 2,1, 3.\n")
    assert (diagonal.form, diagonal.notes) == ("symmetric", ())


def test_abaqus_many_entries_in_seconds(read):
    n = 100_000
    nodes = np.arange(1, n + 1)
    lines = [f"{i},1, {i},1, {1.0 / i!r}\n{i},2, {i},1, -{i}.5e-3\n{i},2, {i},2, 2.25e+05\n" for i in nodes.tolist()]
    text = "".join(lines)
    start = time.perf_counter()
    stored = read("big_STIF1.mtx", text)
    assert time.perf_counter() - start < 5.0
    assert stored.matrix.shape == (2 * n, 2 * n)
    assert np.array_equal(stored.matrix.diagonal()[::2], 1.0 / nodes)
    off = stored.matrix.diagonal(1)[::2]
    assert np.array_equal(off, [float(f"-{i}.5e-3") for i in nodes.tolist()])
    assert np.array_equal(stored.matrix.diagonal(-1)[::2], off)


# -- Nastran punch -----------------------------------------------------------------------------------------------------
def large(name: str, form: int, matrix, freedoms, half: bool = False, kind: int = 2) -> str:
    """DMIG cards as Nastran punches them, numbers without blanks before."""
    lines = [f"DMIG    {name:8s}{0:8d}{form:8d}{kind:8d}{0:8d}{'':16s}{'' if form < 9 else 1:8}"]
    for j, (grid, component) in enumerate(freedoms[: matrix.shape[1]]):
        rows = [i for i in np.flatnonzero(matrix[:, j]) if not half or i >= j]
        if rows:
            lines.append(f"DMIG*   {name:16s}{grid:16d}{component:16d}")
        for i in rows:
            value = f"{matrix[i, j]:.9E}".replace("E", "D")
            lines.append(f"*       {freedoms[i][0]:16d}{freedoms[i][1]:16d}{value:>16s}")
    return "$TITLE = A BRAKE\n$ punched\n" + "\n".join(lines) + "\n"


FREEDOMS = [(11, 1), (11, 3), (2000, 0)]


def test_nastran_matrices_among_other_bulk_data(read):
    cards = "SOL 111\nBEGIN BULK\nGRID,11,,0.,0.,0.\n" + large("KAAX", 6, SYMMETRIC, FREEDOMS, half=True) + "ENDDATA\n"
    stored = read("a.bdf", cards)
    assert stored.matrix.toarray().tolist() == SYMMETRIC.tolist()
    assert labels(stored) == FREEDOMS


def test_nastran_large_fields_of_both_forms(read):
    stored = read("a.pch", large("KAAX", 6, SYMMETRIC, FREEDOMS, half=True))
    assert stored.matrix.toarray().tolist() == SYMMETRIC.tolist()
    assert labels(stored) == FREEDOMS
    assert (stored.role, stored.form, stored.name) == ("stiffness", "symmetric", "KAAX")
    upper = read("a.pch", large("KAAX", 6, np.triu(SYMMETRIC), FREEDOMS))
    assert upper.matrix.toarray().tolist() == SYMMETRIC.tolist()
    stored = read("a.pch", large("BAAX", 1, GENERAL, FREEDOMS))
    assert stored.matrix.toarray().tolist() == GENERAL.tolist()
    assert (stored.role, stored.form) == ("damping", "general")


@pytest.mark.parametrize(
    ("name", "role", "certain"),
    [
        ("KGG", "stiffness", True),
        ("KDD", "stiffness", True),  # all of the stiffness, of the d-set
        ("K2PP", "stiffness", True),
        ("MAAX", "mass", True),
        ("BRAKE", "damping", False),
        ("K4AAX", None, False),
        ("k4gg", None, False),
        ("K42GG", None, False),
        ("KDGG", None, False),
        ("PAX", None, False),
    ],
)
def test_nastran_roles_are_in_the_names(read, name, role, certain):
    stored = read("a.pch", large(name, 6, SYMMETRIC, FREEDOMS, half=True))
    assert (stored.role, stored.certain) == (role, certain)
    assert bool(stored.unsaid) == (name.upper()[:2] in ("K4", "KD") and role is None)


def test_nastran_small_and_free_fields_and_continuations(read):
    # The example of the reference manual, real: column (27, 1), row (2, 4) with three entries on two lines.
    small = (
        "DMIG    STIF           0       1       1       0\n"
        "DMIG    STIF          27       1               2       3   3.+5\n"
        "               2       4 2.5-10              50             1.0\n"
        "DMIG    STIF           2       3               2       3     1.5            +A\n"
        "+A            27       1    -.25\n"
        "DMIG    STIF           2       4              27       1      1.\n"
        "DMIG    STIF          50                      50              -2\n"
        "ENDDATA\n"
    )
    stored = read("a.pch", small)
    assert labels(stored) == [(2, 3), (2, 4), (27, 1), (50, 0)]
    assert stored.matrix.toarray().tolist() == [
        [1.5, 0.0, 3e5, 0.0],
        [0.0, 0.0, 2.5e-10, 0.0],
        [-0.25, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, -2.0],
    ]
    free = (
        "DMIG,STIF,0,1,1,0\nDMIG,STIF,27,1,,2,3,3.+5,,+1\n+1,2,4,2.5-10,,50,,1.0,\n"
        "DMIG,STIF,2,3,,2,3,1.5\n,27,1,-.25 $ comment\nCONM2,1,2,3,4,5,6,7,8,9,10,11,12\n"
        "DMIG*,STIF,2,4,,*\n*,27,1,1.\ndmig,stif,50,,,50,,-2\n"
    )
    assert (read("a.pch", free).matrix != stored.matrix).nnz == 0


def test_nastran_several_matrices_and_blanks_in_numbers(read):
    text = large("KAAX", 6, SYMMETRIC, FREEDOMS, half=True) + large("MAAX", 1, GENERAL, FREEDOMS)
    text += large("PAX", 9, GENERAL[:, :1], FREEDOMS)
    assert read("a.pch", text, "maax").matrix.toarray().tolist() == GENERAL.tolist()
    assert read("a.pch", text, "KAAX").matrix.toarray().tolist() == SYMMETRIC.tolist()
    assert refused(lambda: read("a.pch", text)) == (
        "matrices: 'a.pch' – holds several matrices; choose one by its name: KAAX, MAAX"
    )
    assert refused(lambda: read("a.pch", text, "PAX")) == (
        "matrices: 'a.pch, PAX' – has form 9 (rectangular); accepted: 1 (square) and 6 (symmetric)"
    )
    one = large("PAX", 9, GENERAL[:, :1], FREEDOMS) + large("MAAX", 1, GENERAL, FREEDOMS)
    assert read("a.pch", one).name == "MAAX"
    blanks = "DMIG    UG      0       6       2\nDMIG*    UG              5               3                              *A\n*A       5               3                5.000388 D+5                  *B\n*B       5               5               -2.500194 D+5\n"
    stored = read("a.pch", blanks)
    assert stored.matrix.toarray().tolist() == [[5.000388e5, -2.500194e5], [-2.500194e5, 0.0]]


def test_nastran_complex_only_without_imaginary_parts(read):
    text = "DMIG,BAAX,0,1,3,0\nDMIG,BAAX,1,1,,1,1,2.5,0.0\n,2,1,1.5,{}\n"
    stored = read("a.pch", text.format("0."))
    assert stored.matrix.toarray().tolist() == [[2.5, 0.0], [1.5, 0.0]]
    assert stored.notes == ("The matrix is stored as complex numbers; all imaginary parts are 0.",)
    assert refused(lambda: read("a.pch", text.format("1.-3"))) == (
        "matrices: 'a.pch, BAAX' – is complex: 1 entry has an imaginary part; only real matrices are read"
    )


# -- Nastran OUTPUT4 ---------------------------------------------------------------------------------------------------
def strings(column) -> list[tuple[int, list[float]]]:
    """Runs of entries other than 0 of a column: first row from 0, values."""
    found: list[tuple[int, list[float]]] = []
    for i, v in enumerate(column.tolist()):
        if v and found and i == found[-1][0] + len(found[-1][1]):
            found[-1][1].append(v)
        elif v:
            found.append((i, [v]))
    return found


def op4_text(name, matrix, form=1, kind=2, mode="dense", layout=(3, 23, 16)) -> str:
    per_line, width, digits = layout
    n = len(matrix)
    rows = -n if mode == "bigmat" else n
    one = "1P," if per_line == 3 else ""
    out = [f"{n:8d}{rows:8d}{form:8d}{kind:8d}{name:8s}{one}{per_line}E{width}.{digits}"]
    words = 2 if kind in (2, 4) else 1

    def numbers(values):
        text = [f"{v:{width}.{digits}E}" for value in values for v in ([value] if kind < 3 else [value, 0.0])]
        return ["".join(text[k : k + per_line]) for k in range(0, len(text), per_line)]

    parts = 1 if kind < 3 else 2
    for j in range(n):
        runs = strings(matrix[:, j])
        if not runs:
            continue
        if mode == "dense":
            first, last = runs[0][0], runs[-1][0] + len(runs[-1][1])
            out.append(f"{j + 1:8d}{first + 1:8d}{parts * (last - first):8d}")
            out += numbers(matrix[first:last, j])
            continue
        extra = 2 if mode == "bigmat" else 1
        out.append(f"{j + 1:8d}{0:8d}{sum(extra + words * parts * len(v) for _, v in runs):8d}")
        for first, values in runs:
            length = words * parts * len(values) + 1
            out.append(f"{length:8d}{first + 1:8d}" if mode == "bigmat" else f"{65536 * length + first + 1:12d}")
            out += numbers(values)
    return "\n".join(out) + f"\n{n + 1:8d}{1:8d}{1:8d}\n{1.0:{width}.{digits}E}\n"


def op4_binary(name, matrix, form=1, kind=2, mode="dense", order="<", wide=False) -> bytes:
    n = len(matrix)
    integer, word = ("q", 8) if wide else ("i", 4)
    real = "d" if wide or kind in (2, 4) else "f"
    words = 2 if kind in (2, 4) and not wide else 1
    parts = 1 if kind < 3 else 2

    def record(body: bytes) -> bytes:
        mark = struct.pack(f"{order}i", len(body))
        return mark + body + mark

    def pack(values) -> bytes:
        flat = [v for value in values for v in ([value] if kind < 3 else [value, 0.0])]
        return struct.pack(f"{order}{len(flat)}{real}", *flat)

    rows = -n if mode == "bigmat" else n
    out = record(struct.pack(f"{order}4{integer}", n, rows, form, kind) + name.encode().ljust(2 * word))
    for j in range(n):
        runs = strings(matrix[:, j])
        if not runs:
            continue
        if mode == "dense":
            first, last = runs[0][0], runs[-1][0] + len(runs[-1][1])
            body = pack(matrix[first:last, j])
            out += record(struct.pack(f"{order}3{integer}", j + 1, first + 1, len(body) // word) + body)
            continue
        body = b""
        for first, values in runs:
            length = words * parts * len(values) + 1
            body += (
                struct.pack(f"{order}2{integer}", length, first + 1)
                if mode == "bigmat"
                else struct.pack(f"{order}{integer}", 65536 * length + first + 1)
            )
            body += pack(values)
        out += record(struct.pack(f"{order}3{integer}", j + 1, 0, len(body) // word) + body)
    return out + record(struct.pack(f"{order}3{integer}{real}", n + 1, 1, words, 1.0))


MODES = ["dense", "sparse", "bigmat"]
EXACT = np.array([[4.0, -1.0, 0.0, 0.0], [0.5, 5.0, 0.0, 3.25], [-7.0, 0.0, 0.0, 1.5], [0.0, 2.0, 0.0, 8.0]])


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("kind", [1, 2, 3, 4])
def test_output4_text(read, mode, kind):
    for layout in ((5, 16, 9), (3, 23, 16)):
        stored = read("a.op4", op4_text("KAA", EXACT, kind=kind, mode=mode, layout=layout))
        assert stored.matrix.toarray().tolist() == EXACT.tolist()
        assert (stored.role, stored.form, stored.name, stored.labels) == ("stiffness", "general", "KAA", None)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("kind", [1, 2, 3, 4])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("wide", [False, True])
def test_output4_binary(read, mode, kind, order, wide):
    stored = read("a.op4", op4_binary("MGG", EXACT, kind=kind, mode=mode, order=order, wide=wide))
    assert stored.matrix.toarray().tolist() == EXACT.tolist()
    assert (stored.role, stored.form, stored.name) == ("mass", "general", "MGG")
    assert (stored.notes != ()) == (kind > 2)


@pytest.mark.parametrize("write", [op4_text, op4_binary])
def test_output4_symmetric_whole_or_half_and_several(read, write):
    join = "" if write is op4_text else b""
    whole, half = SYMMETRIC, np.tril(SYMMETRIC)
    stored = read("a.op4", write("KAA", whole, form=6))
    assert (stored.matrix.toarray().tolist(), stored.form, stored.notes) == (whole.tolist(), "symmetric", ())
    stored = read("a.op4", write("KAA", half, form=6, mode="sparse"))
    assert stored.matrix.toarray().tolist() == whole.tolist()
    assert stored.notes == ("The matrix is marked as symmetric and only one half is there; it has been completed.",)
    both = join.join([write("KAA", whole, form=6), write("MAA", EXACT, mode="bigmat")])
    assert read("a.op4", both, "maa").matrix.toarray().tolist() == EXACT.tolist()
    assert refused(lambda: read("a.op4", both)) == "matrices: 'a.op4' – holds several matrices; choose one by its name: KAA, MAA"
    assert refused(lambda: read("a.op4", both, "K")) == "matrices: 'a.op4' – holds no matrix named 'K'; it holds: KAA, MAA"
    assert refused(lambda: read("a.op4", write("KAA", GENERAL, form=6))) == (
        "matrices: 'a.op4, KAA' – says form 6 (symmetric), but entries (i, j) and (j, i) differ by up to 1.0e+00 of the largest in their "
        "rows; for a matrix that is not symmetric it must say form 1 (square)"
    )


@pytest.mark.parametrize("mode", MODES)
def test_output4_symmetric_with_zeros_within_columns(read, mode):
    matrix = np.array([[1.0, 0.0, 2.0, 0.0], [0.0, 5.0, 0.0, 0.0], [2.0, 0.0, 0.0, 3.0], [0.0, 0.0, 3.0 + 1e-13, 4.0]])
    for write in (op4_text, op4_binary):
        stored = read("a.op4", write("K", matrix, form=6, mode=mode))
        assert (stored.matrix != stored.matrix.T).nnz == 0
        assert stored.matrix.nnz == 7
        assert np.allclose(stored.matrix.toarray(), matrix, rtol=1e-12)


def test_output4_numbers_that_touch_and_exponents_of_three_digits(read):
    text = "       2       2       1       2K       1P,3E23.16\n       1       1       2\n-1.0000000000000000E+00-2.0000000000000000-103\n       3       1       1\n 1.0000000000000000E+00\n"
    assert read("a.op4", text).matrix.toarray().tolist() == [[-1.0, 0.0], [-2e-103, 0.0]]
    empty = "       3       3       6       2NULL    1P,3E22.15\n       4       1       1\n 1.0000000000000000E+00\n"
    assert read("a.op4", empty).matrix.nnz == 0


# -- all ---------------------------------------------------------------------------------------------------------------
def stored_at(matrix, node=None, direction=None, source="a"):
    import scipy.sparse as sp

    names = None if node is None else Labels(np.array(node), np.array(direction))
    return StoredMatrix(sp.csr_array(np.array(matrix, dtype=float)), source, names)


def test_matrices_of_one_model_come_on_one_order():
    stiffness = stored_at([[1, 2, 3], [4, 5, 6], [7, 8, 9]], [-1, 2, 1], [1, 2, 1])
    mass = stored_at([[1, 2], [3, 4]], [1, 2], [1, 2])
    damping = stored_at([[5]], [7], [3])
    (k, m, c), names = common_labels([stiffness, mass, damping])
    assert names is not None
    assert names.node.tolist() == [1, 2, 7, -1]
    assert names.direction.tolist() == [1, 2, 3, 1]
    assert k.toarray().tolist() == [[9, 8, 0, 7], [6, 5, 0, 4], [0, 0, 0, 0], [3, 2, 0, 1]]
    assert m.toarray().tolist() == [[1, 2, 0, 0], [3, 4, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
    assert c.toarray()[2, 2] == 5
    assert c.nnz == 1
    plain = [stored_at([[1, 2], [3, 4]]), stored_at([[5, 6], [7, 8]])]
    same, nothing = common_labels(plain)
    assert nothing is None
    assert same[1].toarray().tolist() == [[5, 6], [7, 8]]


def test_matrices_that_cannot_be_brought_together():
    assert refused(lambda: common_labels([stored_at([[1]]), stored_at([[1, 2], [3, 4]], source="b")])) == (
        "matrices: the matrices differ in size (a 1, b 2), and the files do not name their freedoms; "
        "write all for the same freedoms, or in a format with labels"
    )
    assert refused(lambda: common_labels([stored_at([[1]], [1], [1]), stored_at([[1]], source="b")])) == (
        "matrices: b does not name its freedoms, a does: their order cannot be known to be the same; "
        "write all in formats with labels, or all without"
    )
    assert refused(lambda: common_labels([stored_at([[1, 0], [0, 1]], [1, 1], [2, 2])])) == (
        "matrices: 'a' – names a freedom twice: node 1, direction 2; each must have a name of its own"
    )


def test_mtx_files_are_told_apart_by_what_they_begin_with(read):
    import gzip

    text = "%%MatrixMarket matrix coordinate real symmetric\n2 2 2\n1 1 4.0\n2 1 -1.0\n"
    assert read("a.mtx", text).matrix.toarray().tolist() == [[4, -1], [-1, 0]]
    assert read("a.mtx.gz", gzip.compress(text.encode())).matrix.toarray().tolist() == [[4, -1], [-1, 0]]
    packed = read("a_STIF1.mtx.gz", gzip.compress(SLIDING.encode()))
    assert packed.matrix.toarray()[0, 2] == 0.4
    assert packed.role == "stiffness"
