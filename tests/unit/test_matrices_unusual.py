"""Matrix files as editors, converters and other people's scripts leave them, which are nevertheless clear."""

from __future__ import annotations

import gzip
import io as streams
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy import io, sparse

from stridor.errors import CaseError
from stridor.matrices import StoredMatrix, common_labels, held_freedoms, read_matrix, report
from stridor.matrices.numbers import fortran_number, whole_number

MARK = "\ufeff".encode()  # which Windows puts before UTF-8
A = np.array([[2.0, -1.0, 0.0], [3.5, 4.0, 0.0], [0.0, -7.25, 5.0]])
Q = [[4.0, -1.0], [-1.0, 5.0]]
MTX = "%%MatrixMarket matrix coordinate real general\n3 3 6\n1 1 2\n1 2 -1\n2 1 3.5\n2 2 4\n3 2 -7.25\n3 3 5\n"
ABAQUS = "1,1, 1,1,  4.0\n2,1, 1,1, -1.0\n2,1, 2,1,  5.0\n"
DMIG = "DMIG,K,0,6,2\nDMIG,K,1,1,,1,1,4.,,+\n+,2,1,-1.\nDMIG,K,2,1,,2,1,5.\n"
OP4 = (
    "       2       2       1       2K       1P,2E22.15\n       1       1       2\n 4.000000000000000E+00-1.000000000000000E+00\n"
    "       2       1       2\n-1.000000000000000E+00 5.000000000000000E+00\n       3       1       1\n 1.000000000000000E+00\n"
)
CCX = "1 1 4.0\n2 1 -1.0\n2 2 5.0\n"


def hb(values: str, layout: str, kind: str = "RUA") -> str:
    """The matrix [[2, -1, 0], [3.5, 4, 0], [0, 0, 5]] with its values laid out by a format."""
    lines = values.count("\n")
    head = f"{'title':72}{'KEY':8}\n{lines + 2:14d}{1:14d}{1:14d}{lines:14d}{0:14d}\n"
    head += f"{kind:14}{3:14d}{3:14d}{5:14d}{0:14d}\n{'(4I5)':16}{'(5I3)':16}{layout:20}\n"
    return head + "    1    3    5    6\n  1  2  1  2  3\n" + values


HB = np.array([[2.0, -1.0, 0.0], [3.5, 4.0, 0.0], [0.0, 0.0, 5.0]])
VALUES = (2.0, 3.5, -1.0, 4.0, 5.0)
FIVE = "".join(f"{v:16.8E}" for v in VALUES) + "\n"
TEXTS = {
    "a.mtx": (MTX, A),
    "b.mtx": (ABAQUS, Q),
    "a.pch": (DMIG, Q),
    "a.op4": (OP4, Q),
    "a.sti": (CCX, Q),
    "a.hb": (hb(FIVE, "(5E16.8)"), HB),
}


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def read(file: str, data: str | bytes, name: str | None = None) -> StoredMatrix:
    with open(file, "wb") as stream:
        stream.write(data.encode() if isinstance(data, str) else data)
    return read_matrix(file, name)


def same(stored: StoredMatrix, wanted) -> bool:
    assert stored.matrix.nnz == np.count_nonzero(stored.matrix.data)
    assert stored.matrix.has_canonical_format
    return stored.matrix.toarray().tolist() == np.asarray(wanted, dtype=float).tolist()


@pytest.mark.parametrize("file", TEXTS)
def test_texts_of_windows_with_blank_lines_at_the_end(file):
    text, wanted = TEXTS[file]
    assert same(read(file, text), wanted)
    assert same(read(file, MARK + text.replace("\n", "\r\n").encode()), wanted)
    assert same(read(file, text + "\n   \n\n"), wanted)
    assert same(read(file.upper(), text), wanted)


@pytest.mark.parametrize("file", TEXTS)
def test_a_last_line_without_an_end_is_noted(file):
    text, wanted = TEXTS[file]
    note = "The last line has no line end: if the file was cut off there, its last number is wrong."
    stored = read(file, text[:-1])
    assert same(stored, wanted)
    assert (note in stored.notes) == (file != "a.op4")  # there a number without meaning stands last
    assert note not in read(file, text).notes


def test_packed_files_are_known_by_their_first_bytes():
    for text, wanted in (TEXTS["a.mtx"], TEXTS["b.mtx"]):
        packed = gzip.compress(MARK + text.encode())
        assert same(read("a.mtx.gz", packed), wanted)
        assert same(read("A.MTX.GZ", packed + b"\0" * 99), wanted)
        assert same(read("a_MASS1.mtx", packed), wanted)
    halves = gzip.compress(MTX[:60].encode()) + gzip.compress(MTX[60:].encode())
    assert same(read("a.mtx.gz", halves), A)


def test_market_comments_before_the_sizes():
    assert same(read("a.mtx", MTX.replace("3 3 6", "  % indented\n\n%" + "x" * 200_000 + "\n3 3 6")), A)
    assert same(read("a.mtx", MTX.replace("3.5", "3.5D0").replace("-7.25", "-.725d+01")), A)
    assert same(read("a.mtx", MTX.upper()), A)
    assert same(read("a.mtx", MTX.replace("real", "double")), A)
    io.mmwrite("u.mtx", np.array([[1, 2], [3, 4]], dtype="u8"))
    assert same(read_matrix("u.mtx"), [[1, 2], [3, 4]])


def test_zeros_are_not_stored():
    head = "%%MatrixMarket matrix coordinate real general\n"
    assert same(read("a.mtx", head + "2 2 4\n1 1 -0.0\n2 2 1\n1 2 3\n1 2 -3\n"), [[0, 0], [0, 1]])
    assert same(read("a.mtx", head + "3 3 0\n"), np.zeros((3, 3)))
    held = sparse.csc_matrix((np.array([-0.0, 1.0]), ([0, 1], [0, 1])))
    sparse.save_npz("a.npz", held.tocsr())
    assert same(read_matrix("a.npz"), [[0, 0], [0, 1]])
    for version in ("4", "5"):
        io.savemat("a.mat", {"K": held, "M": np.array([[-0.0, 1], [1, 0]])}, format=version)
        assert same(read_matrix("a.mat", "K"), [[0, 0], [0, 1]])
        assert same(read_matrix("a.mat", "M"), [[0, 1], [1, 0]])
    assert same(read("b.mtx", "1,1,1,1,-0.\n2,1,2,1,1.\n"), [[0, 0], [0, 1]])
    assert same(read("a.pch", "DMIG,K,0,6,2\nDMIG,K,1,1,,1,1,-0.\nDMIG,K,2,1,,2,1,1.\n"), [[0, 0], [0, 1]])
    assert same(read("a.sti", "1 1 -0.\n2 2 1\n"), [[0, 0], [0, 1]])


# -- Abaqus ------------------------------------------------------------------------------------------------------------
def test_abaqus_keyword_lines_go_on_behind_a_comma():
    header = "** made\n *Matrix  input , name = A ,\r\n   type = unsymmetric,\n SCALE FACTOR=2.D0\n"
    stored = read("a.mtx", header + ABAQUS)
    assert same(stored, [[8, 0], [-2, 10]])
    assert (stored.name, stored.form) == ("A", "general")
    assert read("a.mtx", '*MATRIX INPUT, NAME="K c"\n' + ABAQUS).name == "K c"
    assert same(read("a.mtx", "** ends in a comma,\n" + ABAQUS), Q)


def test_abaqus_exponents_without_a_letter():
    assert same(read("a.mtx", ABAQUS.replace("5.0", "0.5+001")), Q)
    assert same(read("a.mtx", "1,1,1,1,2.5-101\n"), [[2.5e-101]])


def test_abaqus_supports_under_a_factor_are_known():
    stored = read("a_STIF1.mtx", "*MATRIX INPUT, NAME=A, SCALE FACTOR=0.01\n1,1,1,1,1e36\n2,1,2,1,500.\n")
    assert held_freedoms(stored.matrix).tolist() == [0]
    assert stored.notes == ("1 freedom has 1e36 on the diagonal: Abaqus' mark of *BOUNDARY; they are held.",)
    mass = read("a_MASS1.mtx", "1,1,1,1,1.\n2,1,2,1,1.\n")
    (k, m), labels = common_labels([stored, mass])
    assert report(m, None, 0.1 * k, labels=labels).held == 1


# -- Nastran -----------------------------------------------------------------------------------------------------------
def test_numbers_of_punched_cards():
    for text, value in (("1.5+5", 1.5e5), ("2.5-10", 2.5e-10), ("5.000388 D+5", 5.000388e5), (" -1.D2 ", -100.0), ("4.0-101", 4e-101), ("3", 3.0)):
        assert fortran_number(text) == value
    for text in ("1 5", "1.0 2.0", "1.0 -5", "4.00   0E+00", "1_0", "0x10", "", "-", "1.5E", "E5", "1.5.2"):
        assert np.isnan(fortran_number(text))
    assert [whole_number(t) for t in ("12", " 7 ", b"3", "-1", "1.0", "", "²", "9" * 19)] == [12, 7, 3, None, None, None, None, None]
    assert whole_number("-5", lowest=-9) == -5


def test_output4_formats_with_and_without_their_comma():
    for shown in ("1P2E22.15", "1p,2e22.15", "2E22.15", "2D22.15"):
        assert same(read("a.op4", OP4.replace("1P,2E22.15", shown)), Q)


def test_nastran_header_in_large_fields():
    text = f"DMIG*   {'K':16}{0:16d}{6:16d}{2:16d}\n*       {0:16d}\nDMIG*   {'K':16}{1:16d}{1:16d}\n*       {1:16d}{1:16d}{'4.D0':>16}\n"
    assert same(read("a.pch", text), [[4]])
    assert same(read("a.pch", DMIG.lower()), Q)
    assert same(read("a.pch", "$ DMIG\n" + DMIG.replace("+,2,1", "$ between\n\n+,2,1")), Q)


def test_a_line_that_is_no_card_within_a_column_is_refused():
    """What stands behind it would be lost otherwise; behind the last line of a column nothing is."""
    text = "DMIG,K,0,1,2,0\nDMIG,K,3,1,,3,1,4.\n{}{},7,2,-1.\nDMIG,K,7,2,,7,2,5.\n"
    for line in ("# c", "1,2,3", "a remark"):
        for between in ("", ",12,3,1.\n"):
            with pytest.raises(CaseError) as refused:
                read("a.pch", text.format(between, f"{line}\n"))
            assert str(refused.value) == (
                f"a.pch, line {4 if between else 3}: {line!r} – is no card, no comment ($) and no continuation, and a column "
                "goes on behind it; take the line out, or put a $ before it"
            )
    wanted = [[4, 0], [-1, 5]]
    assert same(read("a.pch", text.format("", "$ c\n")), wanted)
    assert same(read("a.pch", text.format("", "") + "# c\n"), wanted)
    assert same(read("a.pch", text.format("", "").replace("DMIG,K,7", "# c\nGRID,1,,0.,0.,0.\n+,1\nDMIG,K,7")), wanted)


def test_bulk_data_end_at_enddata():
    for end in ("ENDDATA\n", " enddata $ of it\n"):
        assert same(read("a.pch", DMIG + end + "DMIG,K,1,1,,2,1,99.\n,3\nINCLUDE 'x'\n"), Q)
    with pytest.raises(CaseError, match="holds no DMIG card before ENDDATA"):
        read("a.pch", "ENDDATA\n" + DMIG)


# -- Harwell–Boeing and CalculiX ---------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "layout",
    ["(1P,4D20.12)", "(4(1PE20.12))", "(1P4E20.12)", "(1p,4(e20.12))", "(4ES20.12)", "(4EN20.12)", "(2D20.12, 2D20.12)", "(4G20.12)", "(4E20.12E2)"],
)
def test_harwell_boeing_formats(layout):
    cells = [f"{v:20.12E}".replace("E", "D") if "D" in layout else f"{v:20.12E}" for v in VALUES]
    values = "".join(cells[:4]) + "\n" + cells[4] + "\n"
    assert same(read("a.rua", hb(values, layout)), HB)
    assert same(read("a.rua", hb(values, layout, "rua")), HB)


def test_harwell_boeing_of_scipy_takes_fewer_columns_than_it_says():
    signed = sparse.random_array((40, 40), density=0.2, rng=np.random.default_rng(6)).tocsc()
    signed.data -= 0.5
    io.hb_write("a.rua", sparse.csc_matrix(signed))
    stored = read_matrix("a.rua")
    assert abs(stored.matrix - signed).max() < 1e-15
    assert stored.notes == ("Its values take 24 columns each, not those of the format (3E25.16).",)
    lines = Path("a.rua").read_text(encoding="ascii").split("\n")
    lines[-3] = lines[-3].replace("E", "", 1)  # then columns differ from line to line
    with pytest.raises(CaseError, match=r"is not a finite number, by the format \(3E25.16\)"):
        read("a.rua", "\n".join(lines))


def test_titles_that_are_not_plain():
    for text in (hb(FIVE, "(5E16.8)").replace("title ", "Sättel").encode("latin-1"), hb(FIVE, "(5E16.8)").replace("title", "Bremß").encode()):
        assert same(read("a.hb", text), HB)


def test_files_beside_a_matrix_may_be_of_windows():
    with open("a.mapping", "wb") as stream:
        stream.write(MARK + b"1 4 UX\r\n2 4 UY\r\n3 5 ROTZ\r\n")
    labels = read("a.matrix", hb(FIVE, "(5E16.8)")).labels
    assert labels is not None
    assert (labels.node.tolist(), labels.direction.tolist()) == ([4, 4, 5], [1, 2, 6])
    with open("b.dof", "wb") as stream:
        stream.write(MARK + b"4.1\r\n\r\n7.3\r\n")
    labels = read("b.sti", CCX).labels
    assert labels is not None
    assert (labels.node.tolist(), labels.direction.tolist()) == ([4, 7], [1, 3])


# -- NumPy and MATLAB --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("kind", ["i1", "i8", "u2", "f2", "f4", ">f8", "c8", "longdouble"])
def test_numpy_numbers_of_all_kinds_are_added_as_doubles(kind):
    np.savez("a.npz", data=np.array([100, 100, 100], dtype=kind), indices=[0, 0, 1], indptr=[0, 2, 3], shape=[2, 2], format=b"csr")
    assert same(read_matrix("a.npz"), [[200, 0], [0, 100]])
    np.save("a.npy", np.array([[100, 1], [2, 127]], dtype=kind))
    assert same(read_matrix("a.npy"), [[100, 1], [2, 127]])


def test_numpy_what_stands_beside_a_matrix_is_not_read():
    np.savez("a.npz", K=A, info=np.array({"made": "by hand"}, dtype=object), when=np.array("2020-01-01", dtype="M8[s]"), note="x")
    assert same(read_matrix("a.npz"), A)
    assert same(read_matrix("a.npz", "K"), A)
    held = sparse.csr_array(A)
    extra = np.array([None], dtype=object)
    np.savez("a.npz", data=held.data, indices=held.indices, indptr=held.indptr, shape=held.shape, format=b"csr", info=extra)
    assert same(read_matrix("a.npz"), A)


@pytest.mark.parametrize("order", ["C", "F"])
def test_full_matrices_are_looked_at_in_blocks(order, monkeypatch):
    from stridor.matrices import entries

    full = np.random.default_rng(4).standard_normal((23, 23))
    full[full < 0.3] = 0.0
    for block in (1, 23, 100, 10_000):
        monkeypatch.setattr(entries, "_BLOCK", block)
        np.save("a.npy", np.asarray(full, order=order))
        assert same(read_matrix("a.npy"), full)
    np.save("a.npy", np.asarray(full, order=order)[::-1, ::2].repeat(2, axis=1)[:, :23])
    assert same(read_matrix("a.npy"), full[::-1, ::2].repeat(2, axis=1)[:, :23])


def test_matlab_7_3_number_of_rows_as_a_list_of_one():
    held = streams.BytesIO()
    wanted = sparse.csc_array(A)
    with h5py.File(held, "w") as file:
        item = file.create_group("K")
        item.attrs["MATLAB_class"], item.attrs["MATLAB_sparse"] = np.bytes_("double"), np.array([3], dtype="u8")
        item["data"], item["ir"], item["jc"] = wanted.data, wanted.indices, wanted.indptr
        empty = file.create_dataset("E", data=np.zeros(2, dtype="u8"))
        empty.attrs["MATLAB_class"], empty.attrs["MATLAB_empty"] = np.bytes_("double"), np.uint8(1)
    assert same(read("a.mat", held.getvalue()), A)
