"""Matrices from Matrix Market, MATLAB, NumPy, Harwell–Boeing and CalculiX files, entry by entry."""

import gzip
import struct
import zlib

import h5py
import numpy as np
import pytest
from scipy import io, sparse

from stridor.errors import CaseError
from stridor.matrices import StoredMatrix, calculix, harwell_boeing, market, matlab, numpy_file, tables

# Not symmetric, with a 0 and a small number; what most of these files are written from.
A = np.array([[2.0, -1.0, 0.0], [3.5, 4.0, 1e-101], [0.0, -7.25, 5.0]])
S = np.array([[2.0, -1.0, 0.0], [-1.0, 4.0, 0.5], [0.0, 0.5, 5.0]])


def check(stored: StoredMatrix, wanted) -> StoredMatrix:
    """What every reader promises of a matrix, and its entries."""
    assert stored.matrix.format == "csr"
    assert stored.matrix.dtype == np.float64
    assert stored.matrix.has_sorted_indices
    assert stored.matrix.has_canonical_format
    assert stored.matrix.toarray().tolist() == np.asarray(wanted, dtype=float).tolist()
    return stored


def text_file(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    return path


# -- Matrix Market -----------------------------------------------------------------------------------------------------
def mtx(tmp_path, text):
    return market.read(text_file(tmp_path, "a.mtx", "%%MatrixMarket matrix " + text), None, "m")


def test_market_general_keeps_both_halves(tmp_path):
    text = "coordinate real general\n% a comment\n\n3 3 7\n1 1 2\n1 2 -1.0\n2 1 3.5\n2 2 .4e1\n2 3 1d-101\n3 2 -7.25\n3 3 5.\n"
    stored = check(mtx(tmp_path, text), A)
    assert (stored.form, stored.source, stored.notes, stored.labels, stored.role) == ("general", "a.mtx", (), None, None)


@pytest.mark.parametrize("entries", ["1 1 2\n2 1 -1\n2 2 4\n3 2 0.5\n3 3 5\n", "1 1 2\n1 2 -1\n2 2 4\n2 3 0.5\n3 3 5"])
def test_market_symmetric_is_completed_from_either_half(tmp_path, entries):
    assert check(mtx(tmp_path, f"coordinate real symmetric\n3 3 5\n{entries}"), S).form == "symmetric"


def test_market_skew_symmetric_integer_complex_and_hermitian(tmp_path):
    skew = check(mtx(tmp_path, "coordinate integer skew-symmetric\n2 2 1\n2 1 3\n"), [[0, -3], [3, 0]])
    assert skew.form == "general"
    check(mtx(tmp_path, "coordinate complex general\n2 2 2\n1 2 3 0\n2 2 1 0.0\n"), [[0, 3], [0, 1]])
    hermitian = mtx(tmp_path, "coordinate complex hermitian\n2 2 2\n2 1 3 0\n2 2 1 0\n")
    assert check(hermitian, [[0, 3], [3, 1]]).form == "symmetric"


def test_market_arrays_go_by_columns(tmp_path):
    check(mtx(tmp_path, "array real general\n2 2\n1\n2\n3\n4\n"), [[1, 3], [2, 4]])
    check(mtx(tmp_path, "array real symmetric\n3 3\n1\n2\n3\n4\n5\n6\n"), [[1, 2, 3], [2, 4, 5], [3, 5, 6]])
    check(mtx(tmp_path, "array real skew-symmetric\n3 3\n1\n2\n3\n"), [[0, -1, -2], [1, 0, -3], [2, 3, 0]])
    check(mtx(tmp_path, "array complex general\n1 1\n1 0\n"), [[1]])


def test_entries_of_one_place_are_added_and_it_is_said(tmp_path):
    stored = check(mtx(tmp_path, "coordinate real symmetric\n2 2 3\n2 1 3\n2 1 4\n1 1 1\n"), [[1, 7], [7, 0]])
    assert stored.notes == ("Added up: 1 of 3 entries stand at a place that an earlier one has taken.",)


def test_market_back_from_scipy_and_packed(tmp_path):
    big = sparse.random_array((200, 200), density=0.05, rng=np.random.default_rng(1))
    io.mmwrite(tmp_path / "b.mtx", big, precision=17)
    check(market.read(tmp_path / "b.mtx", None, "m"), big.toarray())
    (tmp_path / "b.mtx.gz").write_bytes(gzip.compress((tmp_path / "b.mtx").read_bytes()))
    check(market.read(tmp_path / "b.mtx.gz", None, "m"), big.toarray())
    io.mmwrite(tmp_path / "s.mtx", big + big.T, symmetry="symmetric", precision=17)
    check(market.read(tmp_path / "s.mtx", None, "m"), (big + big.T).toarray())


def test_numbers_are_read_across_blocks(tmp_path, monkeypatch):
    big = np.random.default_rng(2).standard_normal((20, 20))
    io.mmwrite(tmp_path / "b.mtx", sparse.coo_array(big), precision=17)
    for block in (1, 7, 64):
        monkeypatch.setattr(tables, "_BLOCK", block)
        check(market.read(tmp_path / "b.mtx", None, "m"), big)


# -- MATLAB ------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("version", ["4", "5"])
@pytest.mark.parametrize("kind", [np.asarray, sparse.csc_array])
def test_matlab_older_versions(tmp_path, version, kind):
    path = tmp_path / "a.mat"
    io.savemat(path, {"K": kind(A), "v": np.arange(3.0), "one": 4.0}, format=version, do_compression=version == "5")
    assert check(matlab.read(path, None, "m"), A).name == "K"
    check(matlab.read(path, "K", "m"), A)
    check(matlab.read(path, "one", "m"), [[4]])


def element(kind, content):
    """A part of a version 5 file, big-endian; up to 4 bytes go into its head."""
    if len(content) <= 4:
        return struct.pack(">HH", len(content), kind) + content.ljust(4, b"\0")
    return struct.pack(">II", kind, len(content)) + content + b"\0" * (-len(content) % 8)


def test_matlab_5_of_a_big_endian_machine_byte_by_byte(tmp_path):
    # By columns; whole numbers in a byte each, as MATLAB saves space.
    flags, shape = element(6, struct.pack(">II", 6, 0)), element(5, struct.pack(">ii", 2, 2))
    full = flags + shape + element(1, b"K") + element(1, struct.pack(">4b", 2, 3, -1, 4))
    flags = element(6, struct.pack(">II", 5, 9))
    indices = element(5, struct.pack(">3i", 0, 1, 0)) + element(5, struct.pack(">3i", 0, 2, 3))
    thin = flags + shape + element(1, b"sparse") + indices + element(9, struct.pack(">3d", 2.5, 3.5, -1.0))
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\1\0MI"
    path = tmp_path / "a.mat"
    path.write_bytes(head + element(14, full) + struct.pack(">II", 15, len(z := zlib.compress(element(14, thin)))) + z)
    check(matlab.read(path, "K", "m"), [[2, -1], [3, 4]])
    check(matlab.read(path, "sparse", "m"), [[2.5, -1], [3.5, 0]])


def test_matlab_4_byte_by_byte(tmp_path):
    path = tmp_path / "a.mat"
    full = struct.pack(">5i2s4d", 1000, 2, 2, 0, 2, b"K\0", 2, 3, -1, 4)
    # Single precision, sparse: row, column, value; the sizes in the last row.
    thin = struct.pack("<5i2s9f", 12, 3, 3, 0, 2, b"M\0", 1, 2, 2, 1, 1, 2, 2.5, 3.5, 0)
    path.write_bytes(full + thin)
    check(matlab.read(path, "K", "m"), [[2, -1], [3, 4]])
    check(matlab.read(path, "M", "m"), [[2.5, 0], [3.5, 0]])


def test_matlab_structs(tmp_path):
    path = tmp_path / "a.mat"
    io.savemat(path, {"S": {"K": A, "M": sparse.csc_array(S), "deep": {"D": A}}})
    check(matlab.read(path, "S.K", "m"), A)
    check(matlab.read(path, "S.M", "m"), S)
    check(matlab.read(path, "S.deep.D", "m"), A)


def hdf5(path, **variables):
    """A file as MATLAB 7.3 writes it: a head of 512 bytes, full matrices transposed, sparse ones as groups."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            put(file, name, value)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def put(group, name, value):
    if isinstance(value, dict):
        item = group.create_group(name)
        item.attrs["MATLAB_class"] = np.bytes_("struct")
        for key, inner in value.items():
            put(item, key, inner)
    elif sparse.issparse(value):
        held = value.tocsc()
        item = group.create_group(name)
        item.attrs["MATLAB_class"] = np.bytes_("double")
        item.attrs["MATLAB_sparse"] = np.uint64(held.shape[0])
        item["data"], item["ir"], item["jc"] = held.data, held.indices.astype("u8"), held.indptr.astype("u8")
    else:
        item = group.create_dataset(name, data=np.asarray(value).T)
        item.attrs["MATLAB_class"] = np.bytes_("double")


def test_matlab_7_3(tmp_path):
    path = tmp_path / "a.mat"
    complex_type = np.dtype([("real", "f8"), ("imag", "f8")])
    pairs = np.zeros((3, 3), dtype=complex_type)
    pairs["real"] = A
    hdf5(path, K=A, M=sparse.csc_array(A), S={"D": A}, Z=pairs, v=np.ones((3, 1)), empty=sparse.csc_array((3, 3)))
    for name in ("K", "M", "S.D", "Z"):
        assert check(matlab.read(path, name, "m"), A).name == name
    check(matlab.read(path, "empty", "m"), np.zeros((3, 3)))
    hdf5(path, K=sparse.csc_array(A), v=np.ones((3, 1)))
    assert check(matlab.read(path, None, "m"), A).name == "K"


# -- NumPy -------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("form", ["csr", "csc", "coo", "dia", "bsr"])
@pytest.mark.parametrize("packed", [True, False])
def test_npz_of_scipy(tmp_path, form, packed):
    wide = np.kron(A, [[1.0, 2.0], [3.0, 0.0]])
    value = sparse.csr_array(wide).asformat(form) if form != "bsr" else sparse.csr_array(wide).tobsr((3, 2))
    sparse.save_npz(tmp_path / "a.npz", value, compressed=packed)
    stored = check(numpy_file.read(tmp_path / "a.npz", None, "m"), wide)
    assert (stored.name, stored.form, stored.notes) == (None, None, ())


def test_npz_of_arrays_and_npy(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, K=A, v=np.arange(3.0))
    assert check(numpy_file.read(path, None, "m"), A).name == "K"
    np.savez(path, K=A, M=np.asfortranarray(A), I=np.eye(2, dtype=int), Z=A + 0j)
    for name, wanted in (("K", A), ("M", A), ("I", np.eye(2)), ("Z", A)):
        check(numpy_file.read(path, name, "m"), wanted)
    np.save(tmp_path / "a.npy", A)
    check(numpy_file.read(tmp_path / "a.npy", None, "m"), A)


def test_npz_without_a_format_goes_by_rows_and_says_so(tmp_path):
    held = sparse.csr_array(A)
    np.savez(tmp_path / "a.npz", data=held.data, indices=held.indices, indptr=held.indptr, shape=held.shape)
    stored = check(numpy_file.read(tmp_path / "a.npz", None, "m"), A)
    assert stored.notes == ("The file does not say whether indptr counts rows or columns; taken by rows (csr).",)


# -- Harwell–Boeing ----------------------------------------------------------------------------------------------------
# By columns 2, 3.5 | -1, 4, -7.25 | 1e-101, 5. Values touch; one exponent has no letter, another a D.
RUA = f"""{"unsymmetric stiffness":72}KEY1{"":4}
{7:14d}{1:14d}{2:14d}{3:14d}{1:14d}
{"RUA":14}{3:14d}{3:14d}{7:14d}{0:14d}
{"(4I5)":16}{"(4I3)":16}{"(1P,3D12.4)":20}{"(1P,3D12.4)":20}
{"F":14}{1:14d}{0:14d}
    1    3    6    8
  1  2  1  2
  3  2  3
  2.0000D+00  3.5000E+00 -1.0000D+00
  4.0000D+00 -7.2500+000 1.00000-101
  5.0000D+00
  9.0000D+00  9.0000D+00  9.0000D+00
"""
# Lower half by columns, numbers on a line each, as HBMAT writes them.
RSA = f"""{"symmetric":72}{"":8}
{14:14d}{4:14d}{5:14d}{5:14d}{0:14d}
{"RSA":14}{3:14d}{3:14d}{5:14d}{0:14d}
{"(I14)":16}{"(I14)":16}{"(D25.15)":20}{"(D25.15)":20}
{1:14d}
{3:14d}
{5:14d}
{6:14d}
{1:14d}
{2:14d}
{2:14d}
{3:14d}
{3:14d}
    0.200000000000000D+01
   -0.100000000000000D+01
    0.400000000000000D+01
    0.500000000000000D+00
    0.500000000000000D+01
"""
MAPPING = """      Matrix Eqn            Node      DOF
               1              12      UX
               2              12      ROTZ
               3               7      TEMP
"""


def hb(tmp_path, text, name="a.matrix"):
    return harwell_boeing.read(text_file(tmp_path, name, text), None, "m")


def test_harwell_boeing_unsymmetric(tmp_path):
    stored = check(hb(tmp_path, RUA), A)
    assert (stored.form, stored.name) == ("general", "KEY1")
    assert stored.notes == ("Its right-hand sides (1 lines) were not read.",)
    check(harwell_boeing.read(tmp_path / "a.matrix", "key1", "m"), A)


def test_harwell_boeing_symmetric_is_completed(tmp_path):
    stored = check(hb(tmp_path, RSA), S)
    assert (stored.form, stored.name, stored.labels, stored.notes) == ("symmetric", None, None, ())
    check(hb(tmp_path, RSA.replace("\n", "\r\n")), S)


def test_harwell_boeing_numbers_that_touch(tmp_path):
    text = RUA.replace("(1P,3D12.4)", "(1P3E10.4) ").replace("(4I5)", "(4I1)").replace("    1    3    6    8", "1368")
    text = text.replace("  2.0000D+00  3.5000E+00 -1.0000D+00", "2.0000D+003.5000E+00-1.000D+00")
    text = text.replace("  4.0000D+00 -7.2500+000 1.00000-101", "4.0000D+00-7.250D+001.0000-101")
    check(hb(tmp_path, text.replace("  5.0000D+00", "5.0000D+00")), A)
    # Columns that a format skips must be blank: a sign in them would be lost.
    text = RUA.replace("(1P,3D12.4)", "(3(1X,E11.4))")
    check(hb(tmp_path, text), A)
    with pytest.raises(CaseError, match=r"line 9: .* has more in it than \(3\(2X,E10.4\)\) takes"):
        hb(tmp_path, RUA.replace("(1P,3D12.4)", "(3(2X,E10.4))"))


def test_harwell_boeing_skew_complex_and_integer(tmp_path):
    skew = RSA.replace("RSA", "RZA").replace("    0.200", "    0.000").replace(".400", ".000").replace(" 0.500000000000000D+01", " 0.000000000000000D+01")
    assert check(hb(tmp_path, skew), np.tril(S, -1) - np.tril(S, -1).T).form == "general"
    zeros = RSA.replace("RSA", "CSA").replace("(D25.15)  ", "(2D25.15) ")
    for value in ("0.2", "-0.1", "0.4", "0.5"):
        zeros = zeros.replace(f"{value}00000000000000D+01\n", f"{value}00000000000000D+01{0.0:25.3f}\n")
    zeros = zeros.replace("0.500000000000000D+00\n", f"0.500000000000000D+00{0.0:25.3f}\n")
    check(hb(tmp_path, zeros), S)


def test_harwell_boeing_labels_from_the_mapping(tmp_path):
    for name in ("a.mapping", "a.matrix.mapping"):
        text_file(tmp_path, name, MAPPING)
        labels = hb(tmp_path, RSA).labels
        assert labels is not None
        assert (labels.node.tolist(), labels.direction.tolist()) == ([12, 12, 7], [1, 6, 0])
        (tmp_path / name).unlink()


def test_harwell_boeing_back_from_scipy(tmp_path):
    big = sparse.random_array((100, 100), density=0.1, rng=np.random.default_rng(3)) + sparse.eye_array(100)
    io.hb_write(tmp_path / "b.rua", sparse.csc_matrix(big))
    read = harwell_boeing.read(tmp_path / "b.rua", None, "m").matrix
    assert abs(read - big).max() < 1e-12
    assert abs(read - big.T).max() > 0.1


# -- CalculiX ----------------------------------------------------------------------------------------------------------
UPPER = "1 1  2.0000000000000e+00\n1 2 -1.0000000000000e+00\n2 2  4.0000000000000e+00\n2 3  5.0000000000000e-01\n3 3  5.0000000000000e+00\n"


def test_calculix_half_is_completed_and_named(tmp_path):
    text_file(tmp_path, "job.dof", "4.1\n4.2\n17.3\n")
    stored = check(calculix.read(text_file(tmp_path, "job.sti", UPPER), None, "m"), S)
    assert (stored.role, stored.form) == ("stiffness", "symmetric")
    assert stored.labels is not None
    assert (stored.labels.node.tolist(), stored.labels.direction.tolist()) == ([4, 4, 17], [1, 2, 3])
    assert len(stored.notes) == 1
    assert "even where frictional contact makes the stiffness unsymmetric" in stored.notes[0]
    mass = check(calculix.read(text_file(tmp_path, "job.mas", UPPER), None, "m"), S)
    assert (mass.role, mass.notes) == ("mass", ())


def test_calculix_both_halves_stand_as_they_are(tmp_path):
    text = "1 1 2\n1 2 -1\n2 1 3.5\n2 2 4\n2 3 1e-101\n3 2 -7.25\n3 3 5\n"
    stored = check(calculix.read(text_file(tmp_path, "job.sti", text), None, "m"), A)
    assert (stored.form, stored.labels, stored.notes) == ("general", None, ())


def test_calculix_size_from_the_dof_file(tmp_path):
    text_file(tmp_path, "job.dof", "4.1\n4.2\n17.3\n")
    check(calculix.read(text_file(tmp_path, "job.mas", "1 1 2.0\n"), None, "m"), np.diag([2, 0, 0]))
    # Of cyclic symmetry each name stands for two rows.
    six = calculix.read(text_file(tmp_path, "job.mas", "1 1 2.0\n6 6 1.0\n"), None, "m")
    assert six.labels is None
    assert six.notes == ("job.dof names half of the freedoms, as for cyclic symmetry; it was not used.",)
