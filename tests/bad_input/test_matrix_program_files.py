"""Matrix files of Abaqus and Nastran that will not do, each with the exact message; and files hit at random."""

from __future__ import annotations

import gzip
import struct

import numpy as np
import pytest

from stridor.errors import CaseError
from stridor.matrices import StoredMatrix, read_matrix

pytestmark = pytest.mark.bad_input

READ = (
    ".mtx (Matrix Market, Abaqus; also .mtx.gz), .mat (MATLAB, Ansys), .npz, .npy (NumPy), .pch, .bdf, .op4 (Nastran), "
    ".hb, .rb, .rua, .rsa, .matrix (Harwell-Boeing, Ansys), .sti, .mas (CalculiX)"
)
FIVE = "row node, row freedom, column node, column freedom, value"
PCH = "DMIG    KAAX           0       6       2       0\nDMIG*   KAAX                           1               1\n*                      1               1 1.500000000D+00\n*                      2               0-2.500000000D+00\n"
OP4 = "       2       2       1       2KAA     1P,3E23.16\n       1       0       5\n      327681\n 1.0000000000000000E+00 2.0000000000000000E+00\n       2       0       3\n      196610\n 4.0000000000000000E+00\n       3       1       1\n 1.0000000000000000E+00\n"
ABAQUS = "** made by hand\n1,1, 1,1,  4.0e+00\n2,1, 1,1, -1.0D+00\n2,1, 2,1,  5.0\n-1,1, 2,1, 0.5\n"


def record(body: bytes) -> bytes:
    return struct.pack("<i", len(body)) + body + struct.pack("<i", len(body))


HEADER = record(struct.pack("<4i8s", 2, 2, 1, 2, b"KAA     "))
BINARY = HEADER + record(struct.pack("<3i2d", 1, 1, 4, 1.0, 2.0))
BINARY += record(struct.pack("<3iid", 2, 0, 3, 3 * 65536 + 2, 4.0)) + record(struct.pack("<3id", 3, 1, 2, 1.0))


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def refused(tmp_path):
    """The message that a file with these contents gets."""

    def reader(file, data, name=None) -> str:
        (tmp_path / file).write_bytes(data.encode() if isinstance(data, str) else data)
        with pytest.raises(CaseError) as caught:
            read_matrix(file, name)
        assert "\n" not in str(caught.value)
        return str(caught.value)

    return reader


def test_the_files_used_here_are_good(tmp_path):
    for file, data in (("a.pch", PCH), ("a.op4", OP4), ("a.mtx", ABAQUS)):
        (tmp_path / file).write_text(data)
        read_matrix(file)
    (tmp_path / "b.op4").write_bytes(BINARY)
    assert read_matrix("b.op4").matrix.toarray().tolist() == [[1.0, 0.0], [2.0, 4.0]]


@pytest.mark.parametrize("line", ['INCLUDE "more.bdf"', "  include 'a,b.bdf'", "INCLUDE more.bdf", "Include=/x/more.bdf"])
def test_bulk_data_in_other_files_is_not_left_out_silently(refused, line):
    """Columns may be in there."""
    said = refused("a.bdf", f"SOL 103\nBEGIN BULK\n{PCH}{line}\nENDDATA\n")
    assert said.startswith("a.bdf, line ")
    assert said.endswith("INCLUDE, and files taken in are not read: bring all cards into one file")


def test_what_is_no_file(tmp_path, refused):
    (tmp_path / "folder.mtx").mkdir()
    for file, words in (
        ("folder.mtx", "is a folder; must be a file"),
        ("none.op4", "no such file"),
        ("a\0.pch", "cannot be read: embedded null byte"),
    ):
        with pytest.raises(CaseError) as caught:
            read_matrix(file, where="matrices.mass")
        assert str(caught.value) == f"matrices.mass: {file!r} – {words}"
    for file in ("a.mtx", "a.pch", "a.op4", "a.npz", "a.mtx.gz"):
        assert refused(file, b"") == f"matrices: {file!r} – the file is empty (0 bytes)"
    assert refused("a.mtx.gz", gzip.compress(b"")) == "matrices: 'a.mtx.gz' – the file is empty (0 bytes)"
    assert refused("a.sim", b"1") == f"matrices: 'a.sim' – is no matrix file by its suffix; accepted: {READ}"
    assert refused("a.op4.gz", gzip.compress(b"1")) == "matrices: 'a.op4.gz' – of packed files only .mtx.gz is read; unpack it"
    assert refused("a.mtx.gz", b"1,1,1,1,1") == (
        "matrices: 'a.mtx.gz' – is not packed by gzip, as its name says; give it a name without .gz"
    )
    assert refused("a.mtx.gz", gzip.compress(ABAQUS.encode() * 100)[:-9]).startswith("matrices: 'a.mtx.gz' – cannot be read")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,1, 1,1, 2.\n1,1, 2,1\n", f"a.mtx, line 2: '1,1, 2,1' – has 4 values; must have 5: {FIVE}"),
        ("1,1, 1,1, 2.\n\n1,1, 2,1, 1., 5\n", f"a.mtx, line 3: '1,1, 2,1, 1., 5' – has 6 values; must have 5: {FIVE}"),
        ("1,1, 1,1, nan\n", "a.mtx, line 1: '1,1, 1,1, nan' – 'nan' is no finite number"),
        ("** x\n1,1, 1,1, -Inf\n", "a.mtx, line 2: '1,1, 1,1, -Inf' – '-Inf' is no finite number"),
        ("1,1, 1,1, 1e999\n", "a.mtx, line 1: '1,1, 1,1, 1e999' – '1e999' is no finite number"),
        ("1,1, 1,1, 1_0\n", "a.mtx, line 1: '1,1, 1,1, 1_0' – '1_0' is no finite number"),
        ("1.5,1, 1,1, 1\n", f"a.mtx, line 1: '1.5,1, 1,1, 1' – 1.5 is no node; each line must hold: {FIVE}"),
        ("1,1, 1,-1, 1\n", f"a.mtx, line 1: '1,1, 1,-1, 1' – -1 is no freedom number; each line must hold: {FIVE}"),
        ("9999999999,1, 1,1, 1\n", f"a.mtx, line 1: '9999999999,1, 1,1, 1' – 9999999999 is no node; each line must hold: {FIVE}"),
        ("1 1 1.\n0 1 1.\n", "a.mtx, line 2: '0 1 1.' – 0 is no row or column number, from 1; each line must hold: row, column, value"),
        ("1 1 1.\n2 1 1\n99999999 1 1.\n", "matrices: 'a.mtx' – claims 99999999 rows but holds only 3 entries; it must have broken off"),
        ("1 1 1 2.0\n", "a.mtx, line 1: '1 1 1 2.0' – has 4 values, as element matrices have; write the assembled matrix, without ELEMENT BY ELEMENT"),
        ("hello\n", f"a.mtx, line 1: 'hello' – each line must hold: {FIVE} (or row, column, value)"),
        ("** only\n\n", f"matrices: 'a.mtx' – holds no entries; each line must hold: {FIVE}"),
        ("** Assembled nodal loads\n*CLOAD, REAL\n2,3, 5.\n", "a.mtx, line 2: '*CLOAD, REAL' – the file holds loads, no matrix"),
        ("*USER ELEMENT, NODES=2, LINEAR\n1,2\n", "a.mtx, line 1: '*USER ELEMENT, NODES=2, LINEAR' – matrices of a substructure are not read; write them with *MATRIX GENERATE and *MATRIX OUTPUT"),
        ("1,1,1,1,1\n*STEP\n", "a.mtx, line 2: '*STEP' – only *MATRIX INPUT and comments (**) may stand between lines of a matrix"),
        ("*MATRIX INPUT, NAME=A, TYPE=DIAGONAL\n1,1,1,1,1\n", "matrices: 'a.mtx, A' – TYPE=DIAGONAL is not known; accepted: SYMMETRIC, UNSYMMETRIC"),
        ("*MATRIX INPUT, NAME=A, SCALE FACTOR=0\n1,1,1,1,1\n", "matrices: 'a.mtx, A' – SCALE FACTOR=0 is no finite number other than 0"),
        ("*MATRIX INPUT, NAME=A\n1,1,1,1,1\n1,1,2,1,3\n2,1,1,1,2\n", "matrices: 'a.mtx, A' – says TYPE=SYMMETRIC, but entries (i, j) and (j, i) differ by up to 3.3e-01 of the largest in their rows; for a matrix that is not symmetric it must say TYPE=UNSYMMETRIC"),
        ("*MATRIX INPUT, NAME=A\n1,1,1,1,1\n*MATRIX INPUT, NAME=B\n1,1,2,1,3\n", "matrices: 'a.mtx' – holds several matrices; choose one by its name: A, B"),
        ("1,1,1,1,1.7e308\n1,1,1,1,1.7e308\n", "matrices: 'a.mtx' – entries of the same place add up to more than a double precision number can hold"),
    ],
)  # fmt: skip
def test_abaqus(refused, text, message):
    assert refused("a.mtx", text) == message


def test_abaqus_names_that_will_not_do(refused):
    assert refused("job_DMPS1.mtx", ABAQUS) == (
        "matrices: 'job_DMPS1.mtx' – is structural (hysteretic) damping, which no real matrix of velocities is; give "
        "viscous damping instead: JOB_DMPV1.mtx, or an equivalent C = structural damping matrix / ω at the frequency of "
        "interest"
    )
    assert refused("job_LOAD2.mtx", ABAQUS) == (
        "matrices: 'job_LOAD2.mtx' – holds loads, no matrix; accepted: _STIF1, _MASS1, _DMPV1.mtx"
    )
    assert refused("a.mtx", ABAQUS, "K") == (
        "matrices: 'a.mtx' – holds one matrix only, and it has no name; leave out the name 'K'"
    )
    assert refused("a.mtx", bytes(range(256))).startswith("a.mtx, line 1: ")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("GRID,1,,0.,0.,0.\n", "matrices: 'a.pch' – holds no DMIG card; ask Nastran for them with EXTSEOUT(…,DMIGPCH)"),
        ("DMIG,,0,1,1\n", "a.pch, line 1: 'DMIG,,0,1,1' – DMIG needs a name"),
        ("DMIG,K,0,x,1\n", "a.pch, line 1: 'DMIG,K,0,x,1' – 'x' is not a form (IFO), a whole number"),
        ("DMIG,K,0,1,7\n", "a.pch, line 1: 'DMIG,K,0,1,7' – type 7 is not known; accepted: 1, 2 (real) and 3, 4 (complex)"),
        ("DMIG,K,0,1,1\n", "matrices: 'a.pch, K' – has no columns; is the file complete?"),
        ("DMIG,K,0,9,1,,,,2\n", "matrices: 'a.pch, K' – has form 9 (rectangular); accepted: 1 (square) and 6 (symmetric)"),
        ("DMIG,K,0,1,1\nDMIG,K,0,1,1\n", "a.pch, line 2: 'DMIG,K,0,1,1' – K has a header already; each matrix must have one"),
        ("DMIG,K,1,1,,1,1,2.\n", "a.pch, line 1: 'DMIG,K,1,1,,1,1,2.' – a column of K before its header: DMIG, K, 0, IFO, TIN, TOUT"),
        ("DMIG,K,0,1,1\nDMIG,K,1,1,,2,7,2.\n", "a.pch, line 2: 'DMIG,K,1,1,,2,7,2.' – 7 is no component; must be 1 to 6, or 0 for a scalar point"),
        ("DMIG,K,0,1,1\nDMIG,K,1,1,,2,1,2.\n+,0,1,1.\n", "a.pch, line 3: '+,0,1,1.' – 0 is no grid or scalar point; they are numbered from 1"),
        ("DMIG,K,0,1,1\nDMIG,K,1,1,,-2,1,2.\n", "a.pch, line 2: 'DMIG,K,1,1,,-2,1,2.' – '-2' is not a grid or scalar point, a whole number"),
        ("DMIG,K,0,1,1\nDMIG,K,1,1,,2,1,nan\n", "a.pch, line 2: 'DMIG,K,1,1,,2,1,nan' – 'nan' is no finite number"),
        ("DMIG,K,0,1,1\nDMIG,K,1,1,,2,1\n", "a.pch, line 2: 'DMIG,K,1,1,,2,1' – '' is no finite number"),
        ("DMIG,K,0,1,1\nDMIG,K,1,1,,2,1,1.,,,,,\n", "a.pch, line 2: 'DMIG,K,1,1,,2,1,1.,,,,,' – has more than 8 fields"),
        ("DMIG*,K,0,6,1\nDMIG*,K,1,1\n", "a.pch, line 2: 'DMIG*,K,1,1' – the column has no entries; is a line missing?"),
        ("DMIG,K,0,6,1\nDMIG,K,1,1,,2,1,3.\nDMIG,K,2,1,,1,1,2.\n", "matrices: 'a.pch, K' – says form 6 (symmetric), but entries (i, j) and (j, i) differ by up to 3.3e-01 of the largest in their rows; for a matrix that is not symmetric it must say form 1 (square)"),
    ],
)  # fmt: skip
def test_nastran_punch(refused, text, message):
    assert refused("a.pch", text) == message


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("1P,3E23.16", "hello", "a.op4, line 1: '2       2       1       2KAA     hello' – must end in how numbers are written, as 5E16.9 or 1P,3E23.16"),
        ("       2       2       1", "       2       3       1", "matrices: 'a.op4, KAA' – is a matrix of 3 rows and 2 columns; must be square"),
        ("       1       2KAA", "       3       2KAA", "matrices: 'a.op4, KAA' – has form 3 (diagonal); accepted: 1 (square) and 6 (symmetric)"),
        ("       1       2KAA", "       1       5KAA", "a.op4, line 1: '2       2       1       5KAA     1P,3E23.16' – type 5 is not known; accepted: 1, 2 (real) and 3, 4 (complex)"),
        ("       2       2       1", "9999999999999999       1", "a.op4, line 3: '327681' – must begin a string of entries: its length and first row do not fit"),
        ("       1       0       5", "       4       0       5", "a.op4, line 2: '4       0       5' – must begin a column: its number, 1 to 3, first row, length"),
        ("      327681", "      327682", "a.op4, line 3: '327682' – leaves the matrix: it has 2 rows"),
        ("      327681", "      427682", "a.op4, line 3: '427682' – must begin a string of entries: its length and first row do not fit"),
        ("      327681", "       x", "a.op4, line 3: 'x' – 'x' is no whole number; integers must fill fields of 8"),
        (" 2.0000000000000000E+00", "                    NaN", "a.op4, line 4: '1.0000000000000000E+00                    NaN' – must hold 2 numbers of 23 characters; '                    NaN' is no finite number"),
        ("       3       1       1\n 1.0000000000000000E+00\n", "", "matrices: 'a.op4' – ends in the middle of a matrix, at line 8"),
    ],
)  # fmt: skip
def test_output4_text(refused, old, new, message):
    assert old in OP4
    assert refused("a.op4", OP4.replace(old, new, 1)) == message


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (BINARY[:-1], "matrices: 'a.op4' – ends in the middle of a matrix, after 127 bytes"),
        (BINARY[:32], "matrices: 'a.op4' – ends in the middle of a matrix, after 32 bytes"),
        (b"\0\1\2\3junk", "matrices: 'a.op4' – is binary, but begins with no OUTPUT4 header (a record of 24 or 48 bytes)"),
        (HEADER[:28] + b"\1\0\0\0", "a.op4, byte 0: is no record: the length 24 at its beginning is not repeated at its end"),
        (record(struct.pack("<4i8s", 2, 0, 1, 2, b"K")), "a.op4, byte 4: has 0 rows and 2 columns; must have at least one of each"),
        (HEADER + record(struct.pack("<3i", 5, 1, 0)), "a.op4, byte 36: must begin column 1 to 3; it says 5"),
        (HEADER + record(struct.pack("<3id", 1, 1, 4, 1.0)), "a.op4, byte 36: is of 20 bytes, too short for the 4 words it announces"),
        (HEADER + record(struct.pack("<3i2d", 1, 2, 4, 1.0, 2.0)), "a.op4, byte 36: leaves the matrix: it has 2 rows"),
        (HEADER + record(struct.pack("<4id", 1, 0, 3, 9 * 65536 + 1, 2.0)), "a.op4, byte 36: holds a string of entries whose length does not fit"),
        (HEADER + record(struct.pack("<3id", 2, 1, 2, np.nan)) + BINARY[-28:], "matrices: 'a.op4, KAA' – the value at row 1, column 2 is nan; must be a finite number"),
        (HEADER + HEADER, "a.op4, byte 36: leaves the matrix: it has 2 rows"),
    ],
)  # fmt: skip
def test_output4_binary(refused, data, message):
    assert refused("a.op4", data) == message


def test_output4_sizes_that_no_file_can_have_are_refused_before_memory_is_taken(refused):
    huge = record(struct.pack("<4i8s", 2**30, 2**30, 1, 2, b"K       "))
    assert refused("a.op4", huge) == "matrices: 'a.op4' – ends in the middle of a matrix, after 32 bytes"
    assert refused("a.op4", huge + record(struct.pack("<3id", 2**30 + 1, 1, 2, 1.0))) == (
        "matrices: 'a.op4, K' – claims 1073741824 rows but holds only 0 entries; it must have broken off"
    )
    imaginary = record(struct.pack("<4i8s", 1, 1, 1, 4, b"K       ")) + record(struct.pack("<3i2d", 1, 1, 4, 1.0, 2.0))
    imaginary += record(struct.pack("<3id", 2, 1, 2, 1.0))
    assert refused("a.op4", imaginary) == (
        "matrices: 'a.op4, K' – is complex: 1 entry has an imaginary part; only real matrices are read"
    )


GOOD = {"a_STIF1.mtx": ABAQUS.encode(), "c.mtx": b"1 1 4.0\n2 1 -1.\n2 2 5e0\n", "a.pch": PCH.encode(), "a.op4": OP4.encode(), "b.op4": BINARY}
PIECES = [b"\0", b"\n", b",", b" ", b"-", b"9", b"1e999", b"nan", b"*", b"$", b"%", b"\xff", b"\r\n", b"99999999", b"DMIG", b"*MATRIX INPUT, TYPE=UNSYMMETRIC\n", b"D+400", b"0", b"\t"]


def mutated(data: bytes, random: np.random.Generator) -> bytes:
    """The file with a few bytes changed, put in, taken out, doubled or cut off."""
    for _ in range(int(random.integers(1, 4))):
        at, end = sorted(random.integers(0, len(data) + 1, 2).tolist())
        kind = int(random.integers(0, 6))
        piece = PIECES[int(random.integers(0, len(PIECES)))]
        if kind == 0:
            data = data[:at] + piece + data[at:]
        elif kind == 1:
            data = data[:at] + piece + data[at + len(piece) :]
        elif kind == 2:
            data = data[:at] + bytes([int(random.integers(0, 256))]) + data[at + 1 :]
        elif kind == 3:
            data = data[:at] + data[min(end, at + 40) :]
        elif kind == 4:
            data = data[:at] + data[at:end] + data[at:]
        else:
            data = data[:end]
    return data


def outcome(file: str) -> StoredMatrix | str:
    """What is read, or the message of the refusal."""
    try:
        return read_matrix(file)
    except CaseError as error:
        return str(error)


@pytest.mark.parametrize("file", GOOD)
def test_files_hit_at_random_are_read_or_refused(tmp_path, file):
    random = np.random.default_rng(sum(file.encode()))
    read = 0
    for _ in range(300):
        data = mutated(GOOD[file], random)
        (tmp_path / file).write_bytes(data)
        found = outcome(file)
        if isinstance(found, str):
            assert found.isprintable(), data
            continue
        read += 1
        matrix = found.matrix
        assert matrix.shape[0] == matrix.shape[1] > 0, data
        assert matrix.dtype == np.float64
        assert np.isfinite(matrix.data).all(), data
        if found.form == "symmetric":
            assert (matrix != matrix.T).nnz == 0, data
        if found.labels is not None:
            assert len(found.labels.node) == len(found.labels.direction) == matrix.shape[0]
    assert read > 0
