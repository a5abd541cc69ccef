"""Matrix files that will not do: Matrix Market, MATLAB, NumPy, Harwell–Boeing and CalculiX, with the exact messages."""

from __future__ import annotations

import gzip
import io as streams
import time
import warnings
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy import io, sparse

from stridor.errors import CaseError
from stridor.matrices import StoredMatrix, calculix, harwell_boeing, market, matlab, numpy_file

pytestmark = pytest.mark.bad_input

READERS = {"market": market, "matlab": matlab, "numpy_file": numpy_file, "harwell_boeing": harwell_boeing, "calculix": calculix}
SUFFIX = {"market": ".mtx", "matlab": ".mat", "numpy_file": ".npz", "harwell_boeing": ".hb", "calculix": ".sti"}
A = np.array([[2.0, -1.0, 0.0], [3.5, 4.0, 0.0], [0.0, -7.25, 5.0]])


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def refused(reader: str, content: bytes | str, name: str | None = None) -> str:
    """What is said of a file with this content, without the place and the file; behind the matrix, where it is named."""
    path = Path("a" + SUFFIX[reader])
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return said(reader, path, name)


def said(reader: str, path: Path, name: str | None = None) -> str:
    with pytest.raises(CaseError) as caught:
        READERS[reader].read(path, name, "study.stiffness.file")
    text = str(caught.value)
    assert "\n" not in text
    head = f"study.stiffness.file: '{path}"
    assert text.startswith(head), text
    matrix, _, told = text.removeprefix(head).partition("' – ")
    return f"{matrix.removeprefix(', ')}: {told}" if matrix else told


@pytest.mark.parametrize("reader", READERS)
def test_what_is_no_file_of_numbers(reader, tmp_path):
    assert said(reader, Path("none" + SUFFIX[reader])) == "no such file"
    Path("folder").mkdir()
    assert said(reader, Path("folder")) == "is a folder; must be a file"
    assert refused(reader, b"") == "the file is empty (0 bytes)"
    assert refused(reader, bytes(np.random.default_rng(1).integers(0, 256, 2000, dtype=np.uint8)))
    assert refused(reader, b"\0" * 4096)
    assert refused(reader, b"\n" * 300)
    assert refused(reader, "x" * 100_000)
    assert refused(reader, "a\0b")


MTX = "%%MatrixMarket matrix "


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("hello\n", "does not begin with %%MatrixMarket; must be a Matrix Market file"),
        (
            MTX + "coordinate real\n",
            "line 1: '%%MatrixMarket matrix coordinate real' must say after %%MatrixMarket: matrix; coordinate or array; "
            "real or double or integer or unsigned-integer or complex or pattern; general or symmetric or skew-symmetric or hermitian",
        ),
        (
            MTX + "coordinate pattern general\n1 1 1\n1 1\n",
            "line 1: a pattern says where entries are and not how large; must be real, integer or complex",
        ),
        (MTX + "coordinate real general\n% only\n", "breaks off before the line with the size of the matrix"),
        (MTX + "coordinate real general\n3 3\n", "line 2: '3 3' is not the number of rows, columns and entries"),
        (MTX + "array real general\n3 -3\n", "line 2: '3 -3' is not the number of rows and columns"),
        (MTX + "coordinate real general\n2 3 1\n1 1 1\n", "is a matrix of 2 rows and 3 columns; must be square"),
        (MTX + "array real symmetric\n2 3\n1\n", "is a matrix of 2 rows and 3 columns; must be square"),
        (MTX + "array real general\n0 0\n", "is a matrix of 0 rows and 0 columns; must be square and not empty"),
        (MTX + "coordinate real general\n2 2 3\n1 1 1\n2 2 1", "breaks off: line 2 promises 3 entries, and there are 2"),
        (MTX + "coordinate real general\n2 2 1\n1 1 1\n2 2 1", "holds more entries than the 1 that its head promises"),
        (MTX + "array real general\n2 2\n1\n2\n3\n", "breaks off: line 2 promises 4 entries, and there are 3"),
        (MTX + "coordinate real general\n2 2 1\n1 3 1\n", "entry 1 (row 1, column 3) lies outside of the matrix of 2 rows and columns, which are counted from 1"),
        (MTX + "coordinate real general\n2 2 1\n0 1 1\n", "entry 1 (row 0, column 1) lies outside of the matrix of 2 rows and columns, which are counted from 1"),
        (MTX + "coordinate real general\n2 2 1\n1.5 1 1\n", "number 1 of its rows is 1.5; must be a whole number, below 2^53"),
        (MTX + "coordinate real general\n2 2 2\n1 1 1\n\n1 2 nan\n", "line 5: '1 2 nan' must be 3 finite numbers"),
        (MTX + "coordinate real general\n2 2 1\n1 1 1e999\n", "line 3: '1e999' is not a finite number"),
        (MTX + "coordinate real general\n2 2 1\n1 1 1-5\n", "line 3: '1-5' is not a finite number"),
        (MTX + "coordinate real general\n2 2 1\n1 1 1e\n", "line 3: '1e' is not a finite number"),
        (MTX + "coordinate real general\n2 2 2\n1 1 1\n1 2 3 4\n", "line 4: '1 2 3 4' must be 3 finite numbers"),
        (MTX + "coordinate real general\n2 2 2\n1 1 1\n1 2\n", "line 4: '1 2' must be 3 finite numbers"),
        (
            MTX + "coordinate real symmetric\n2 2 2\n1 2 1\n2 1 1\n",
            "says that it is stored by one half, but holds entries on both sides of the diagonal; write all of its entries "
            "and call it general",
        ),
        (MTX + "coordinate real skew-symmetric\n2 2 1\n1 1 1\n", "says that it is skew-symmetric, but holds entries on the diagonal"),
        (
            MTX + "coordinate complex general\n1 1 1\n1 1 1 2\n",
            "is complex: 1 entry has an imaginary part; only real matrices are read",
        ),
        (MTX + "coordinate real general\n2 2 1000000000000\n1 1 1\n", "breaks off: line 2 promises 1000000000000 entries, and there are 1"),
        (
            MTX + "coordinate real general\n1000000000 1000000000 1\n1 1 1\n",
            "claims 1000000000 rows but holds only 1 entry; it must have broken off",
        ),
        (
            MTX + "array real symmetric\n1000000000 1000000000\n1\n",
            "breaks off: line 2 promises 500000000500000000 entries, and there are 1",
        ),
        (
            MTX + "coordinate real general\n1 1 2\n1 1 1e308\n1 1 1e308\n",
            "entries of the same place add up to more than a double precision number can hold",
        ),
    ],
)
def test_matrix_market(text, message):
    assert refused("market", text) == message


def test_matrix_market_by_name_and_packed():
    assert (
        refused("market", MTX + "array real general\n1 1\n1\n", "K")
        == "holds one matrix only, and it has no name; leave out the name 'K'"
    )
    packed = gzip.compress((MTX + "array real general\n1 1\n1\n").encode())
    assert refused("market", packed[:-12]).startswith("cannot be read: Compressed file ended before")


def mat(**variables) -> bytes:
    held = streams.BytesIO()
    io.savemat(held, variables)
    return undated(held.getvalue())


def undated(content: bytes) -> bytes:
    """A version 5 file without the hour of its making, so that its mutations are the same every day."""
    return b"MATLAB 5.0 MAT-file".ljust(116) + content[116:] if content.startswith(b"MATLAB") else content


def test_matlab_choices():
    two = mat(K=A, M=A, n=1.0, t="text", c=np.array([[1, "a"]], dtype=object))
    assert refused("matlab", two) == "holds several matrices; choose one by its name: K, M"
    assert refused("matlab", two, "k") == "holds no matrix named 'k'; it holds: K, M, n; besides: t (char), c (cell)"
    assert refused("matlab", two, "c") == (
        "c is of the kind cell; must be a full or sparse matrix of numbers, by itself or as a field of a single struct"
    )
    assert refused("matlab", two, "n.x").startswith("holds no matrix named 'n.x'; it holds: K, M, n; besides: ")
    assert refused("matlab", mat(t="text")) == "holds no matrix of numbers; besides: t (char)"
    struct = mat(S={"K": A, "t": "x"}, K=A)
    assert refused("matlab", struct) == "holds several matrices; choose one by its name: S.K, K"
    assert refused("matlab", struct, "S") == "S is of the kind struct; its fields are: S.K"
    assert refused("matlab", mat(a=A[:2])) == "a: is a matrix of 2 rows and 3 columns; must be square"
    assert refused("matlab", mat(a=A * 1j)) == "a: is complex: 6 entries have an imaginary part; only real matrices are read"
    assert refused("matlab", mat(a=A * np.nan)) == "a: the value at row 1, column 1 is nan; must be a finite number"
    assert refused("matlab", mat(a=A > 0)) == "holds no matrix of numbers; besides: a (logical)"
    assert refused("matlab", "1 2\n3 4\n" * 50) == (
        "is no .mat file: it begins neither as version 4, 5 or 7 nor as version 7.3 (HDF5)"
    )
    assert refused("matlab", two[:200]) == "breaks off: an element of 120 bytes reaches beyond its end"
    assert refused("matlab", two + two[128:184]) == "breaks off: an element of 120 bytes reaches beyond its end"
    assert refused("matlab", two + two[128:256]) == "holds two variables named K"


def hdf5(**variables) -> bytes:
    """As MATLAB 7.3 writes: a sparse matrix as (data, ir, jc, rows), a full one transposed."""
    held = streams.BytesIO()
    with h5py.File(held, "w", userblock_size=512) as file:
        for name, value in variables.items():
            if isinstance(value, tuple):
                item = file.create_group(name)
                item["data"], item["ir"], item["jc"] = value[:3]
                item.attrs["MATLAB_sparse"] = np.uint64(value[3])
            else:
                item = file.create_dataset(name, data=np.asarray(value).T)
            item.attrs["MATLAB_class"] = np.bytes_("double")
    return held.getvalue()


def test_matlab_7_3():
    one = [1.0], [0], [0, 1, 1]
    assert refused("matlab", hdf5(K=A, M=A)) == "holds several matrices; choose one by its name: K, M"
    assert refused("matlab", hdf5(K=(*one, 3))) == "K: is a matrix of 3 rows and 2 columns; must be square"
    assert refused("matlab", hdf5(K=([1.0], [2], [0, 1, 1], 2))) == (
        "K: entry 1 (row 3, column 1) lies outside of the matrix of 2 rows and columns, which are counted from 1"
    )
    assert refused("matlab", hdf5(K=([1.0], [0], [0, 5, 1], 2))) == (
        "K: its pointers do not rise from the first to the last of its 1 entries"
    )
    assert refused("matlab", hdf5(K=([1.0, 2.0], [0], [0, 1, 2], 2))) == "K: has 1 row indices and 2 values; must be as many"
    assert refused("matlab", hdf5(K=([np.inf], [0], [0, 1, 1], 2))) == "K: the value at row 1, column 1 is inf; must be a finite number"
    with h5py.File("h.mat", "w") as file:
        file["K"] = A  # rows or columns first? Only MATLAB's mark tells.
    assert said("matlab", Path("h.mat")) == "is an HDF5 file, but no variable in it is marked as MATLAB's"
    with h5py.File("h.mat", "w") as file:
        huge = file.create_dataset("K", shape=(10**6, 10**6), dtype="f8", chunks=(1000, 1000))
        huge.attrs["MATLAB_class"] = np.bytes_("double")
    assert said("matlab", Path("h.mat")) == "K: claims 1000000000000 values, for which the file is too small"
    assert refused("matlab", b"MATLAB 7.3 MAT-file".ljust(600)) == (
        "is a .mat file of version 7.3 that is broken: what follows its head is no HDF5"
    )


def npz(**arrays) -> bytes:
    held = streams.BytesIO()
    np.savez(held, **arrays)
    return held.getvalue()


CSR = {"data": [1.0, 2.0], "indices": [0, 1], "indptr": [0, 1, 2], "shape": [2, 2]}


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"K": A, "M": A}, "holds several matrices; choose one by its name: K, M"),
        ({"K": A[:2]}, "K: is a matrix of 2 rows and 3 columns; must be square"),
        ({"K": np.array([[{}]])}, "holds no matrix of numbers; besides: K (Python objects, which are never loaded; save sparse matrices by scipy.sparse.save_npz)"),
        ({"K": np.array(["a"])}, "holds no matrix of numbers; besides: K (<U1, 1)"),
        ({"K": np.full((3, 3), np.inf)}, "K: the value at row 1, column 1 is inf; must be a finite number"),
        (CSR | {"shape": [2, 3]}, "is a matrix of 2 rows and 3 columns; must be square"),
        (CSR | {"shape": [2]}, "is an array of 1 dimensions; must be a square matrix of 2"),
        (CSR | {"shape": [10**9, 10**9]}, "has 3 pointers for 1000000000 rows or columns; must be one more than these"),
        (CSR | {"indptr": [0, 2, 1]}, "its pointers do not rise from the first to the last of its 2 entries"),
        (CSR | {"indptr": [0, 1, 3]}, "its pointers do not rise from the first to the last of its 2 entries"),
        (CSR | {"indices": [0, 2]}, "entry 2 (row 1, column 2) lies outside of the matrix of 2 rows and columns, which are counted from 0"),
        (CSR | {"indices": [0, -1]}, "entry 2 (row 1, column -1) lies outside of the matrix of 2 rows and columns, which are counted from 0"),
        (CSR | {"indices": [0]}, "holds 1 indices and 2 values; must be as many"),
        (CSR | {"data": [[1.0, 2.0]]}, "its data have 2 dimensions, which is not how format csr is stored"),
        (CSR | {"format": b"lil"}, "is a sparse matrix of format 'lil'; must be one of: csr, csc, bsr, coo, dia"),
        (CSR | {"format": b"coo"}, "is a sparse matrix of format coo but holds no row and no col"),
        (
            {"data": [1.0], "row": [0], "col": [0], "shape": [10**9, 10**9]},
            "claims 1000000000 rows but holds only 1 entry; it must have broken off",
        ),
        (
            {"data": [[1.0], [2.0]], "offsets": [0, 0], "shape": [2, 2]},
            "holds 2 diagonals for 2 offsets; must be one each, and no offset twice",
        ),
    ],
)
def test_npz(arrays, message):
    content = npz(**arrays) if "K" not in arrays or arrays["K"].dtype != object else None
    if content is None:
        np.savez("o.npz", **arrays, allow_pickle=True)
        content = Path("o.npz").read_bytes()
    assert refused("numpy_file", content) == message


def test_npz_claims_and_names():
    assert refused("numpy_file", npz(**{"K\n": A, "M": A})) == "holds several matrices; choose one by its name: K?, M"
    assert refused("numpy_file", npz(K=A), "M") == "holds no matrix named 'M'; it holds: K"
    assert refused("numpy_file", npz(**CSR), "M") == "holds one matrix only, and it has no name; leave out the name 'M'"
    assert refused("numpy_file", npz(K=A)[:-40]) == "is a .npz file that breaks off: its table of contents is missing"
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 1000000), }".ljust(117) + b"\n"
    with zipfile.ZipFile("z.npz", "w") as archive:
        archive.writestr("K.npy", b"\x93NUMPY\x01\x00\x76\x00" + header)
    assert said("numpy_file", Path("z.npz")) == "K claims 1000000000000 values, for which its 128 bytes are too few"
    pickled = b"\x93NUMPY\x01\x00\x76\x00" + header.replace(b"<f8", b"|O ").replace(b"|O '", b"|O',")
    assert "allow_pickle" not in refused("numpy_file", pickled)


HB = f"""{"title":72}{"KEY":8}
{4:14d}{1:14d}{1:14d}{2:14d}
{"RUA":14}{3:14d}{3:14d}{5:14d}{0:14d}
{"(4I5)":16}{"(5I3)":16}{"(1P,4D12.4)":20}
    1    3    5    6
  1  2  1  2  3
  2.0000D+00  3.5000E+00 -1.0000D+00  4.0000D+00
  5.0000D+00
"""


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("RUA", "PUA", "line 3: PUA is a pattern without values; must be real, such as RUA or RSA"),
        ("RUA", "RUE", "line 3: RUE holds element matrices that are not assembled; must be such as RUA or RSA"),
        ("RUA", "XYZ", "line 3: 'XYZ' is no type of matrix, such as RUA or RSA"),
        ("RUA", "CUA", "line 2 promises 2 lines of values, but 10 by (1P,4D12.4) take 3"),
        (
            "RUA",
            "RSA",
            "says that it is stored by one half, but holds entries on both sides of the diagonal; write all of its entries "
            "and call it general",
        ),
        (f"{3:14d}{3:14d}", f"{4:14d}{3:14d}", "is a matrix of 4 rows and 3 columns; must be square"),
        (f"{5:14d}", f"{10**12:14d}", "line 2 promises 1 lines of row indices, but 1000000000000 by (5I3) take 200000000000"),
        (
            f"{3:14d}{3:14d}",
            f"{10**9:14d}{10**9:14d}",
            "line 2 promises 1 lines of pointers, but 1000000001 by (4I5) take 250000001",
        ),
        (
            "(4I5)",
            "(I5F2)",
            "line 4: the format (I5F2) is not understood; accepted are such as (8I10), (1P,5D16.8), (4(1X,E20.12))",
        ),
        ("(1P,4D12.4)", "           ", "line 4: '(4I5) (5I3)' must hold the Fortran formats of pointers, indices and values"),
        ("    1    3    5    6", "    1    3    5    7", "its pointers do not rise from the first to the last of its 5 entries"),
        ("    1    3    5    6", "    1    3    4    5", "its last pointer is 5; with 5 entries it must be one more"),
        ("    1    3    5    6", "    1    3    5", "line 5: '' stands where number 4 of its pointers should be, by the format (4I5)"),
        ("  1  2  1  2  3", "  1  2  1  2  4", "entry 5 (row 4, column 3) lies outside of the matrix of 3 rows and columns, which are counted from 1"),
        ("3.5000E+00", "       nan", "line 7: 'nan' is not a finite number, by the format (1P,4D12.4)"),
        ("3.5000E+00", "3.500E+999", "line 7: '3.500E+999' is not a finite number, by the format (1P,4D12.4)"),
        ("3.5000E+00", "3.5 00E+00", "line 7: '3.5 00E+00' is not a finite number, by the format (1P,4D12.4)"),
        ("3.5000E+00", "  35000E+0", "line 7: '35000E+0' has no decimal point, which (1P,4D12.4) lets be read two ways"),
        ("3.5000E+00", "    3.5000", "line 7: '3.5000' has no exponent, which (1P,4D12.4) lets be read two ways"),
        ("  5.0000D+00\n", "", "breaks off: its values take lines 7 to 8, and it has 7"),
        ("  5.0000D+00\n", "  5.0000D+00\n 1\n", "line 2 promises 0 lines of right-hand sides, but 1 lines follow the values"),
        ("  5.0000D+00\n", "  5.0000D+00  6.0000D+00\n", "line 8: '6.0000D+00' is one more than the 5 values promised"),
        (
            "4.0000D+00\n",
            "4.0000D+00  6.0000D+00\n",
            "line 7: '2.0000D+00 3.5000E+00 -1.0000D+00 4.0000D+00 6.00…' has more in it than (1P,4D12.4) takes",
        ),
    ],
)
def test_harwell_boeing(old, new, message):
    assert old in HB
    assert refused("harwell_boeing", HB.replace(old, new, 1)) == message


def test_harwell_boeing_format_that_lines_are_too_short_for():
    size = 9999
    text = HB.replace("(4I5)   ", "(I4000) ").replace(f"{3:14d}{3:14d}", f"{size:14d}{size:14d}")
    text = text.replace(f"{4:14d}{1:14d}{1:14d}", f"{4:14d}{size + 1:14d}{1:14d}").replace("    1    3    5    6\n", "1\n" * (size + 1))
    assert refused("harwell_boeing", text) == "lines 5 to 10004 are much shorter than the format (I4000)"


def test_harwell_boeing_mapping_and_names():
    assert refused("harwell_boeing", HB, "K") == "holds one matrix only, and its name is KEY; leave out the name 'K'"
    for text, message in (
        ("1 4 UX\n2 4 UY\n", "does not name equation 3 of the 3 of a.hb; the two are not of the same run"),
        ("Eqn Node Dof\n1 4 UX\n1 4 UY\n", "line 3: equation 1 is named twice or none of the 3 of a.hb"),
        ("1 4 UX\n7 4 UY\n", "line 2: equation 7 is named twice or none of the 3 of a.hb"),
        ("1 4 UX\n2 b UY\n", "line 2: '2 b UY' must be an equation, a node and a label such as UX"),
    ):
        Path("a.mapping").write_text(text)
        Path("a.hb").write_text(HB)
        with pytest.raises(CaseError) as caught:
            harwell_boeing.read(Path("a.hb"), None, "m")
        assert str(caught.value) == f"m: 'a.mapping' – {message}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 1 1\n2 2\n", "line 2: '2 2' must be 3 finite numbers"),
        ("1 1 1\n2 2 inf\n", "line 2: '2 2 inf' must be 3 finite numbers"),
        ("1 1 1\n0 2 1\n", "entry 2 (row 0, column 2) lies outside of the matrix of 2 rows and columns, which are counted from 1"),
        ("1 1 1\n1000000000 2 1\n", "claims 1000000000 rows but holds only 2 entries; it must have broken off"),
        ("\n \n", "holds no entries; each line must be: row column value"),
    ],
)
def test_calculix(text, message):
    assert refused("calculix", text) == message


def test_calculix_dof_file():
    Path("a.dof").write_text("4.1\n")
    assert refused("calculix", "1 1 1\n5 5 1\n") == (
        "has an entry in row or column 5, but a.dof names only 1 freedoms; the two are not of the same run"
    )
    Path("a.dof").write_text("4.1\n4.7\n")
    with pytest.raises(CaseError) as caught:
        calculix.read(Path("a.sti"), None, "m")
    assert str(caught.value) == (
        "m: 'a.dof' – line 2: '4.7' must be a node and a direction from 0 to 6 with a point between, as 12.3"
    )


# -- whatever happens to a file ----------------------------------------------------------------------------------------
def seeds(reader: str) -> list[bytes]:
    """Files of each kind that a reader reads."""
    rng = np.random.default_rng(7)
    big = sparse.random_array((9, 9), density=0.3, rng=rng) + sparse.eye_array(9)
    if reader == "market":
        found: list[bytes] = []
        for value, symmetry in ((big, "general"), (big + big.T, "symmetric"), (big.toarray(), "general")):
            held = streams.BytesIO()
            io.mmwrite(held, value, symmetry=symmetry)
            found.append(held.getvalue())
        return [*found, gzip.compress(found[0])]
    if reader == "matlab":
        found = []
        for version, packed in (("4", False), ("5", False), ("5", True)):
            for value in (sparse.csc_matrix(big), big.toarray()):
                held = streams.BytesIO()
                io.savemat(held, {"K": value}, format=version, do_compression=packed)
                found.append(undated(held.getvalue()))
        held = sparse.csc_array(big)
        return [*found, mat(S={"K": A}), hdf5(K=(held.data, held.indices, held.indptr, 9)), hdf5(K=big.toarray())]
    if reader == "numpy_file":
        found = [npz(K=big.toarray()), npz(K=A, v=np.arange(3))]
        for form in ("csr", "csc", "coo", "dia", "bsr"):
            held = streams.BytesIO()
            sparse.save_npz(held, sparse.csr_matrix(big).asformat(form), compressed=form in "csc bsr")
            found.append(held.getvalue())
        return found
    if reader == "harwell_boeing":
        held = streams.StringIO()
        io.hb_write(held, sparse.csc_matrix(big))
        return [HB.encode(), HB.replace("(1P,4D12.4)", "(4D12.4)   ").encode(), held.getvalue().encode()]
    lower = sparse.tril(big).tocoo()
    return [
        "".join(f"{i + 1} {j + 1} {v:20.13e}\n" for i, j, v in zip(m.row, m.col, m.data, strict=True)).encode()
        for m in (lower, big.tocoo())
    ]


def mutated(content: bytes, rng: np.random.Generator) -> bytes:
    """The content with a few of its bytes, lines or parts changed, lost or doubled."""
    data = bytearray(content)
    for _ in range(int(rng.integers(1, 4))):
        if not data:
            break
        at = int(rng.integers(len(data)))
        kind = rng.integers(7)
        if kind == 0:
            data[at] = int(rng.integers(256))
        elif kind == 1:
            data[at] ^= 1 << int(rng.integers(8))
        elif kind == 2:
            data[at : at + 1] = bytes([int(rng.choice(list(b"0123456789 -+.eED\n\0\xff")))])
        elif kind == 3:
            del data[at:]
        elif kind == 4:
            del data[at : at + int(rng.integers(1, 9))]
        elif kind == 5:
            data[at:at] = data[at : at + int(rng.integers(1, 40))]
        else:
            lines = bytes(data).split(b"\n")
            line = int(rng.integers(len(lines)))
            if rng.integers(2):
                del lines[line]
            else:
                lines.insert(line, lines[line])
            data = bytearray(b"\n".join(lines))
    return bytes(data)


def fuzz(reader: str, folder: Path, start: int, count: int, log: str | None = None) -> tuple[int, int, float]:
    """How many mutations were read, how many refused, and the longest time [s]; anything else fails."""
    contents = seeds(reader)
    path = folder / ("f" + SUFFIX[reader])
    read, longest = 0, 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for seed in range(start, start + count):
            path.write_bytes(mutated(contents[seed % len(contents)], np.random.default_rng(seed)))
            if log:
                Path(log).write_text(str(seed))
            begun = time.perf_counter()
            try:
                stored = READERS[reader].read(path, None, "m")
            except CaseError as error:
                text = str(error)
            else:
                text = ""
                read += 1
                assert isinstance(stored, StoredMatrix)
                assert stored.matrix.shape[0] == stored.matrix.shape[1] > 0
                assert stored.matrix.has_canonical_format
                assert stored.matrix.dtype == np.float64
                assert np.all(np.isfinite(stored.matrix.data))
            assert "\n" not in text
            assert len(text) < 600
            longest = max(longest, time.perf_counter() - begun)
    assert longest < 1.0
    return read, count - read, longest


@pytest.mark.parametrize("reader", READERS)
def test_broken_files_are_read_or_refused(reader, tmp_path):
    read, refused_, _ = fuzz(reader, tmp_path, 0, 300)
    assert read > 0
    assert refused_ > 100
