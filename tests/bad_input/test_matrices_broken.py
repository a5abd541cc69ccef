"""Matrix files that somebody has broken, mistaken or blown up: the exact message for each, and no silent other matrix."""

from __future__ import annotations

import gzip
import io as streams
import struct
import time
import warnings
import zipfile
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy import io, sparse

from stridor.errors import CaseError
from stridor.matrices import read_matrix, report

pytestmark = [pytest.mark.bad_input, pytest.mark.filterwarnings("error")]

MARK = "\ufeff".encode()
MTX = "%%MatrixMarket matrix coordinate real general\n2 2 2\n1 1 4\n2 2 5\n"
ABAQUS = "1,1, 1,1, 4.0\n2,1, 2,1, 5.0\n"
DMIG = "DMIG,K,0,6,2\nDMIG,K,1,1,,1,1,4.\nDMIG,K,2,1,,2,1,5.\n"
OP4 = "       1       1       1       2K       1P,2E22.15\n       1       1       1\n 4.000000000000000E+00\n       2       1       1\n 1.000000000000000E+00\n"
CCX = "1 1 4.0\n2 2 5.0\n"
HB = (
    f"{'title':72}{'KEY':8}\n{3:14d}{1:14d}{1:14d}{1:14d}{0:14d}\n{'RUA':14}{2:14d}{2:14d}{2:14d}{0:14d}\n"
    f"{'(4I5)':16}{'(5I3)':16}{'(2E20.12)':20}\n    1    2    3\n  1  2\n  4.000000000000E+00  5.000000000000E+00\n"
)
TEXTS = {"a.mtx": MTX, "b.mtx": ABAQUS, "a.pch": DMIG, "a.op4": OP4, "a.sti": CCX, "a.hb": HB}


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def refused(file: str, data: str | bytes, name: str | None = None) -> str:
    Path(file).write_bytes(data.encode() if isinstance(data, str) else data)
    with pytest.raises(CaseError) as caught:
        read_matrix(file, name)
    assert str(caught.value).isprintable()
    return str(caught.value).removeprefix("matrices: ")


# -- texts -------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("file", TEXTS)
def test_texts_in_other_encodings(file):
    text = TEXTS[file]
    read_matrix_of(file, text)
    for other in ("utf-16", "utf-16-le", "utf-16-be"):
        told = f"{file!r} – is text of two bytes a letter (UTF-16); save it as UTF-8 or plain ASCII"
        assert refused(file, text.encode(other)) == told
    told = f"{file!r} – ends its lines with a carriage return alone; save it with line feeds"
    assert refused(file, text.replace("\n", "\r")) == told


def read_matrix_of(file: str, data: str | bytes) -> None:
    Path(file).write_bytes(data.encode() if isinstance(data, str) else data)
    read_matrix(file)


@pytest.mark.parametrize(
    ("file", "text", "told"),
    [
        ("a.mtx", "%%MatrixMarket matrix coordinate real general\n2 2 2\n0 0 1\n1 1 2\n", "entry 1 (row 0, column 0) lies outside of the matrix of 2 rows and columns, which are counted from 1"),
        ("a.sti", "0 0 4.\n1 1 5.\n", "entry 1 (row 0, column 0) lies outside of the matrix of 1 rows and columns, which are counted from 1"),
        ("a.mtx", "%%MatrixMarket matrix coordinate real general\n0 0 0\n", "is a matrix of 0 rows and 0 columns; must be square and not empty"),
        ("a.mtx", MTX.replace("4\n", "NaN\n"), "line 3: '1 1 NaN' must be 3 finite numbers"),
        ("a.mtx", MTX + "\0\0\0", "line 5: '???' must be 3 finite numbers"),
        ("a.mtx", MTX.replace("4\n", "4 % c\n"), "line 3: '1 1 4 % c' must be 3 finite numbers"),
        ("a.mtx", MTX.replace("2 2 2", "2 2 1000000000000"), "breaks off: line 2 promises 1000000000000 entries, and there are 2"),
        ("a.sti", "1000000000000 1 4.\n", "claims 1000000000000 rows but holds only 1 entry; it must have broken off"),
        ("a.hb", HB.replace("    1    2    3\n", "    0    1    2\n"), "its pointers begin with 0; must count from 1"),
        ("a.hb", HB.replace("  4.000", "\t 4.000"), "line 7 has a tab, but (2E20.12) goes by columns; write blanks instead"),
        ("a.hb", HB.replace("  1  2\n", "\t1\t2\n"), "line 6 has a tab, but (5I3) goes by columns; write blanks instead"),
    ],
)  # fmt: skip
def test_texts(file, text, told):
    assert refused(file, text) == f"{file!r} – {told}"


def test_texts_of_other_programs_under_the_name_of_matlab():
    told = "'a.mat' – is text, as save -ascii and Octave's save -text write it; write it with -v7 or -v7.3"
    assert refused("a.mat", "  1.0000000e+00  2.0000000e+00\n  3.0000000e+00  4.0000000e+00\n") == told
    assert refused("a.mat", "# Created by Octave 8.4.0\n# name: K\n# type: matrix\n") == told
    read_matrix_of("a.mat", HB)  # Ansys calls its own so


def test_packed_files_that_are_broken():
    assert refused("a.mtx.gz", gzip.compress(MTX.encode() * 9)[:-20]).startswith("'a.mtx.gz' – cannot be read: Compressed file ended")
    assert refused("a.mtx.gz", gzip.compress(MTX.encode()) + b"junk").startswith("'a.mtx.gz' – cannot be read: Not a gzipped file")
    assert refused("a.mtx.gz", MTX) == "'a.mtx.gz' – is not packed by gzip, as its name says; give it a name without .gz"


@pytest.mark.parametrize("text", [MTX, ABAQUS])
def test_packed_files_that_would_fill_the_memory(text, monkeypatch):
    from stridor.matrices import source

    monkeypatch.setattr(source, "_TEXT_UNQUESTIONED", 1 << 20)
    start = time.perf_counter()
    told = refused("a.mtx.gz", gzip.compress(text.encode() + b"\n" * 20_000_000, 1))
    assert told == (
        "'a.mtx.gz' – unpacks to far more than its size; unpack it and give the file itself, or allow it by "
        "STRIDOR_READ_LIMIT in the environment (GiB)"
    )
    assert time.perf_counter() - start < 5.0


# -- Abaqus ------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("*MATRIX INPUT, NAME=A,\n" + ABAQUS, "a.mtx, line 1: '*MATRIX INPUT, NAME=A, 1,1, 1,1, 4.0' – a comma at its end makes the line behind it a part of it; take it away"),
        ("*MATRIX INPUT, NAME=A, INPUT=b.mtx\n", "'a.mtx, A' – holds no entries; they are in b.mtx: give that file"),
        ("*MATRIX INPUT, NAME=A\n" + ABAQUS + "*MATRIX INPUT, NAME=a\n" + ABAQUS, "'a.mtx' – holds 2 matrices named A; write each to a file of its own"),
        ("*MATRIX INPUT, NAME=A, SCALE FACTOR=1e300\n1,1,1,1,1e300\n", "'a.mtx, A' – the value at row 1, column 1 is inf; must be a finite number"),
        ("1,1, 1,1, 4.0 5\n", "a.mtx, line 1: '1,1, 1,1, 4.0 5' – has 6 values, as element matrices have; write the assembled matrix, without ELEMENT BY ELEMENT"),
        ("1 1 4.\n1000000000000 1 4.\n", "'a.mtx' – claims 1000000000000 rows but holds only 2 entries; it must have broken off"),
    ],
)  # fmt: skip
def test_abaqus(text, told):
    assert refused("a.mtx", text) == told


# -- Nastran -----------------------------------------------------------------------------------------------------------
def test_an_imaginary_part_in_a_real_matrix():
    assert refused("a.pch", "DMIG,K,0,1,2\nDMIG,K,1,1,,1,1,2.,7.\n") == (
        "a.pch, line 2: 'DMIG,K,1,1,,1,1,2.,7.' – '7.' stands where an imaginary part would, but type 2 is real; do the "
        "fields begin in the right columns?"
    )
    # A number of ten characters in a field of eight.
    small = f"{'DMIG':8}{'K':8}{'0':8}{'1':8}{'2':8}\n{'DMIG':8}{'K':8}{'1':8}{'1':8}{'':8}{'1':8}{'1':8}1.23456789\n"
    assert "'89' stands where an imaginary part would" in refused("a.pch", small)
    Path("a.pch").write_text("DMIG,K,0,1,2\nDMIG,K,1,1,,1,1,2.,0.\n")
    assert read_matrix("a.pch").matrix.toarray().tolist() == [[2.0]]


def test_numbers_with_blanks_within_are_not_joined():
    assert refused("a.pch", "DMIG,K,0,6,2\nDMIG,K,1,1,,1,1,1 5\n") == "a.pch, line 2: 'DMIG,K,1,1,,1,1,1 5' – '1 5' is no finite number"
    assert refused("a.op4", OP4.replace("4.000000000000000E+00", "4.0000000   000000E+00", 1).replace("E+00\n", "\n", 1)) == (
        "a.op4, line 3: '4.0000000   000000' – must hold 1 number of 22 characters; ' 4.0000000   000000' is no finite number"
    )


def test_more_numbers_on_a_line_than_a_column_has():
    more = OP4.replace(" 4.000000000000000E+00", " 4.000000000000000E+00 7.000000000000000E+00", 1)
    assert refused("a.op4", more) == (
        "a.op4, line 3: '4.000000000000000E+00 7.000000000000000E+00' – must hold 1 number of 22 characters; there is more in it"
    )


@pytest.mark.parametrize("name", [None, "K", "k"])
def test_a_name_that_two_matrices_have(name):
    assert refused("a.op4", OP4 + OP4, name) == "'a.op4' – holds 2 matrices named K; write each to a file of its own"


def test_output4_with_a_negative_number_of_columns():
    assert refused("a.op4", OP4.replace("       1       1", "      -1       1", 1)) == (
        "a.op4, line 1: '-1       1       1       2K       1P,2E22.15' – has 1 rows and -1 columns; must have at least one of each"
    )


def test_nastran_messages_name_the_matrix():
    assert refused("a.pch", DMIG.replace("K,0,6", "K,0,9")) == (
        "'a.pch, K' – has form 9 (rectangular); accepted: 1 (square) and 6 (symmetric)"
    )
    assert refused("a.op4", OP4.replace("       1       2K", "       7       2K", 1)) == (
        "'a.op4, K' – has form 7, which is not known; accepted: 1 (square) and 6 (symmetric)"
    )
    body = struct.pack("<4i8s", 1, 1, 1, 2, b"K") + struct.pack("<2i", 24, 20) + struct.pack("<3id", 1, 1, 2, np.inf)
    binary = struct.pack("<i", 24) + body + struct.pack("<2i", 20, 20) + struct.pack("<3id", 2, 1, 2, 1.0) + struct.pack("<i", 20)
    assert refused("a.op4", binary) == "'a.op4, K' – the value at row 1, column 1 is inf; must be a finite number"


# -- freedoms named beside a matrix ------------------------------------------------------------------------------------
def test_files_beside_a_matrix():
    Path("a.dof").write_bytes("4.1\n7.1\n".encode("utf-16"))
    assert refused("a.sti", CCX) == "'a.dof' – is text of two bytes a letter (UTF-16); save it as UTF-8 or plain ASCII"
    Path("a.dof").write_bytes(b"")
    assert refused("a.sti", CCX) == "'a.dof' – the file is empty (0 bytes)"
    Path("b.mapping").write_bytes(b"")
    assert refused("b.hb", HB) == "'b.mapping' – the file is empty (0 bytes)"


# -- NumPy and MATLAB --------------------------------------------------------------------------------------------------
def npz(**arrays) -> bytes:
    held = streams.BytesIO()
    np.savez(held, **arrays)
    return held.getvalue()


COO = {"data": [1.0, 2.0], "shape": [2, 2], "format": b"coo"}
CSR = {"data": [1.0, 2.0], "indices": [0, 1], "indptr": [0, 1, 2], "shape": [2, 2], "format": b"csr"}


@pytest.mark.parametrize(
    ("arrays", "told"),
    [
        (COO | {"row": [1, 2], "col": [1, 2]}, "'a.npz' – entry 2 (row 2, column 2) lies outside of the matrix of 2 rows and columns, which are counted from 0"),
        (CSR | {"indptr": [1, 2, 3]}, "'a.npz' – its pointers begin with 1; must count from 0"),
        (CSR | {"data": [True, True]}, "'a.npz' – holds logical values, true or false; must be real numbers"),
        (CSR | {"data": [1.0, np.nan]}, "'a.npz' – the value at row 1, column 1 is nan; must be a finite number"),
        (CSR | {"indices": [0, 1.5]}, "'a.npz' – number 2 of its indices is 1.5; must be a whole number, below 2^53"),
        ({"K": np.ones((2, 2), dtype=bool)}, "'a.npz' – holds no matrix of numbers; besides: K (bool, 2 × 2)"),
        ({"v": np.arange(3)}, "'a.npz' – holds no matrix of numbers; besides: v (int64, 3)"),
        ({"K": np.zeros((0, 0))}, "'a.npz, K' – is a matrix of 0 rows and 0 columns; must be square and not empty"),
        ({"K": np.eye(2) * 1j}, "'a.npz, K' – is complex: 2 entries have an imaginary part; only real matrices are read"),
        ({"K": np.diag([1.0, 2.0, np.inf])}, "'a.npz, K' – the value at row 3, column 3 is inf; must be a finite number"),
        ({"K": np.array([None])}, "'a.npz' – holds no matrix of numbers; besides: K (Python objects, which are never loaded; save sparse matrices by scipy.sparse.save_npz)"),
    ],
)  # fmt: skip
def test_npz(arrays, told):
    assert refused("a.npz", npz(**arrays)) == told


def test_npz_what_is_named_is_what_is_refused():
    data = npz(K=np.array([[1, None]], dtype=object), v=np.arange(3), b=np.eye(2, dtype=bool), M=np.eye(2))
    assert refused("a.npz", data, "K") == (
        "'a.npz' – K holds Python objects, which are never loaded; save sparse matrices by scipy.sparse.save_npz"
    )
    assert refused("a.npz", data, "v") == "'a.npz, v' – is an array of 1 dimensions; must be a square matrix of 2"
    assert refused("a.npz", data, "b") == "'a.npz, b' – holds logical values, true or false; must be real numbers"
    held = streams.BytesIO()
    with zipfile.ZipFile(held, "w") as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for factor in (1.0, 2.0):
            one = streams.BytesIO()
            np.save(one, factor * np.eye(2))
            archive.writestr("K.npy", one.getvalue())
    assert refused("a.npz", held.getvalue()) == "'a.npz' – holds two arrays named K"


def test_a_place_that_is_told_in_a_large_full_matrix(monkeypatch):
    from stridor.matrices import entries

    monkeypatch.setattr(entries, "_BLOCK", 30)
    for order in "CF":
        full = np.zeros((20, 20), order=order)
        full[13, 4] = np.nan
        np.save("a.npy", full)
        with pytest.raises(CaseError, match="the value at row 14, column 5 is nan; must be a finite number"):
            read_matrix("a.npy")


def test_full_matrices_that_would_fill_the_memory(monkeypatch):
    from stridor.matrices import source

    monkeypatch.setattr(source, "_FULL_UNQUESTIONED", 1 << 20)
    zeros = np.zeros((2000, 2000))
    np.savez_compressed("a.npz", K=zeros)
    told = "K' – unpacks to 30.5 MiB or more from "
    assert refused("a.npz", Path("a.npz").read_bytes()).startswith(f"'a.npz, {told}")
    io.savemat("a.mat", {"K": zeros}, do_compression=True)
    assert refused("a.mat", Path("a.mat").read_bytes()).endswith(
        "; store so large a matrix as a sparse one, or allow it by STRIDOR_READ_LIMIT in the environment (GiB)"
    )
    with h5py.File("b.mat", "w") as file:
        item = file.create_dataset("K", data=zeros, compression="gzip", chunks=(500, 500))
        item.attrs["MATLAB_class"] = np.bytes_("double")
    assert refused("b.mat", Path("b.mat").read_bytes()).startswith(f"'b.mat, {told}")
    monkeypatch.setenv("STRIDOR_READ_LIMIT", "1")
    assert read_matrix("b.mat").matrix.nnz == 0


def test_matlab_variables_that_are_no_matrices():
    def mat(**variables) -> bytes:
        held = streams.BytesIO()
        io.savemat(held, variables)
        return held.getvalue()

    two = np.array([(np.eye(2), 1), (np.eye(2), 2)], dtype=[("K", "O"), ("n", "O")])
    for variables, kind in (
        ({"c": np.array([[np.eye(2), "a"]], dtype=object)}, "cell"),
        ({"c": two}, "array of structs"),
        ({"c": sparse.csc_matrix(np.eye(2, dtype=bool))}, "logical"),
        ({"c": np.zeros((2, 2, 2))}, "double of 3 dimensions"),
    ):
        assert refused("a.mat", mat(**variables)) == f"'a.mat' – holds no matrix of numbers; besides: c ({kind})"
        assert refused("a.mat", mat(**variables), "c") == (
            f"'a.mat' – c is of the kind {kind}; must be a full or sparse matrix of numbers, by itself or as a field of a single struct"
        )
    assert refused("a.mat", mat(K=np.eye(2)[:1], v=1.0), "K") == "'a.mat, K' – is a matrix of 1 rows and 2 columns; must be square"


def test_matlab_5_packed_variables_that_break_off():
    content = zlib.compress(b"\0" * 1000)[:-8]
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM"
    assert refused("a.mat", head + struct.pack("<2I", 15, len(content)) + content) == "'a.mat' – a variable that is packed breaks off"


def test_matlab_7_3_marks_that_are_wrong():
    def hdf5(write) -> bytes:
        held = streams.BytesIO()
        with h5py.File(held, "w") as file:
            write(file)
        return held.getvalue()

    def rows(value):
        def write(file) -> None:
            item = file.create_group("K")
            item.attrs["MATLAB_class"], item.attrs["MATLAB_sparse"] = np.bytes_("double"), value
            item["jc"] = np.array([0, 0])

        return write

    assert refused("a.mat", hdf5(rows("x"))) == "'a.mat, K' – is marked as sparse, but not with its number of rows"
    assert refused("a.mat", hdf5(rows(np.array([1, 2])))) == "'a.mat, K' – is marked as sparse, but not with its number of rows"

    def empty(file) -> None:
        item = file.create_dataset("K", data=np.zeros(2, dtype="u8"))
        item.attrs["MATLAB_class"], item.attrs["MATLAB_empty"] = np.bytes_("double"), np.uint8(1)

    assert refused("a.mat", hdf5(empty)) == "'a.mat' – holds no matrix of numbers; besides: K (empty double)"

    def loops(file) -> None:
        group = file.create_group("S")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        for k in range(50):
            group[f"s{k}"] = group

    assert refused("a.mat", hdf5(loops)) == "'a.mat' – holds more than 10000 variables"


# -- the report --------------------------------------------------------------------------------------------------------
def test_matrices_of_which_nothing_is_left():
    eye = sparse.csr_array(np.eye(2))
    held = report(eye, None, 1e36 * eye)
    assert held.warnings == (
        "all freedoms are held: nothing is left that can vibrate",
    )
    assert held.lines()[0] == "2 freedoms, 2 of them held (1e36 in K, Abaqus' supports)"
    nothing = report(0 * eye, None, 0 * eye)
    assert nothing.warnings == (
        "2 freedoms have neither mass nor stiffness; K has no inverse",
        "the mass is zero; without a mass nothing vibrates",
        "the stiffness is zero; is a term missing, or its factor zero?",
    )


def test_a_stiffness_of_the_wrong_sign():
    eye = sparse.csr_array(np.eye(2))
    found = report(eye, None, -eye)
    assert found.warnings[0] == "2 freedoms have a negative entry on the diagonal of K; is the sign of every factor right?"


def test_frequencies_of_numbers_at_the_ends_of_the_scale():
    eye = sparse.csr_array(np.eye(2))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = report(1e-320 * eye, None, 1e20 * eye)
    assert found.frequencies is not None
    assert np.isfinite(found.frequencies).all()
