"""Files made to fill the memory, the time or the stack, and paths that are no files: told before anything is read."""

from __future__ import annotations

import io
import os
import resource
import struct
import time
import tracemalloc
import zipfile
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

import stridor as st
from stridor.case import template_text
from stridor.errors import CaseError
from stridor.io.result_files import open_results
from stridor.matrices.labels import read_labels
from stridor.matrices.read import read_matrix
from stridor.mesh.files import read_mesh
from stridor.reading import bounded, largest_file

pytestmark = pytest.mark.bad_input

GMSH = """$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
4
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
$EndNodes
$Elements
2
1 2 2 1 1 1 2 3
2 2 2 1 1 1 3 4
$EndElements
"""
VTK = """# vtk DataFile Version 3.0
a
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 3 double
0 0 0 1 0 0 0 1 0
CELLS 1 4
3 0 1 2
CELL_TYPES 1
5
"""
VTU = """<?xml version="1.0"?>
<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid>
<Piece NumberOfPoints="3" NumberOfCells="1">
<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 0 1 0</DataArray></Points>
<Cells><DataArray type="Int64" Name="connectivity" format="ascii">0 1 2</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">3</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">5</DataArray></Cells>
</Piece></UnstructuredGrid></VTKFile>
"""


@pytest.fixture(autouse=True)
def _quickly_and_with_little_memory():
    """Whatever is claimed: a few seconds, and not a hundred MB."""
    tracemalloc.start()
    begun = time.perf_counter()
    yield
    seconds, peak = time.perf_counter() - begun, tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert seconds < 60  # of a loaded machine
    assert peak < 150e6


def told(read, *given) -> str:
    with pytest.raises(CaseError) as caught:
        read(*given)
    message = str(caught.value)
    assert len(message) < 20_000
    assert "Traceback" not in message
    return message


def mesh(path: Path, content: str | bytes) -> str:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    message = told(read_mesh, path)
    assert "\n" not in message
    return message


READERS = {
    "case": (st.load, ""),
    "gmsh": (read_mesh, ".msh"),
    "abaqus": (read_mesh, ".inp"),
    "vtk": (read_mesh, ".vtk"),
    "vtu": (read_mesh, ".vtu"),
    "labels": (read_labels, ""),
    "results": (open_results, ".nc"),
    "reduced": (st.open, ".npz"),
    **{s: (read_matrix, f".{s}") for s in ("mtx", "mat", "npz", "npy", "pch", "op4", "hb", "sti", "mtx.gz")},
}


@pytest.mark.parametrize("name", READERS)
def test_what_is_no_file(name, tmp_path, monkeypatch):
    """Pipes would be waited for, devices read for ever; links in a circle end nowhere."""
    read, suffix = READERS[name]
    monkeypatch.chdir(tmp_path)
    os.mkfifo(f"pipe{suffix}")
    os.symlink("/dev/zero", f"zero{suffix}")
    os.symlink(f"circle{suffix}", f"circle{suffix}")
    os.mkdir(f"folder{suffix}")
    assert "a pipe" in told(read, Path(f"pipe{suffix}"))
    assert "a device" in told(read, Path(f"zero{suffix}"))
    assert "symbolic links" in told(read, Path(f"circle{suffix}"))
    assert "is a " in told(read, Path(f"folder{suffix}"))
    told(read, Path("a\0b" + suffix))
    told(read, Path("x" * 300 + suffix))
    with open(f"vast{suffix}", "wb") as file:
        file.truncate(2**42)  # takes no room on the disk
    assert "has 4 TiB, and no more than" in told(read, Path(f"vast{suffix}"))


def test_the_limit_of_a_file_follows_the_memory_or_what_is_asked_for(monkeypatch):
    assert largest_file() >= 2**30
    monkeypatch.setenv("STRIDOR_READ_LIMIT", "0.5")
    assert largest_file() == 2**29
    for nonsense in ("", "much", "-1", "nan", "inf"):
        monkeypatch.setenv("STRIDOR_READ_LIMIT", nonsense)
        assert largest_file() >= 2**30


def test_a_reader_that_asks_for_too_much_ends_in_an_error_and_the_limit_is_lifted():
    before = resource.getrlimit(resource.RLIMIT_AS)
    with pytest.raises(MemoryError), bounded(), bounded():
        bytearray(2**42)
    assert resource.getrlimit(resource.RLIMIT_AS) == before


# -- case files -------------------------------------------------------------------------------------------------------
CASE = template_text("two-beams")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("x" * 100_000 + " = 1\n", "a key of 100000 letters; at most 200"),
        ('"' + "x" * 100_000 + '" = 1\n', "a key of 100000 letters; at most 200"),
        ("[bodies." + "x" * 100_000 + "]\nelements = 3\n", "a key of 100000 letters; at most 200"),
        ("[modal]\ncount = " + "9" * 5000 + "\n", "a whole number has thousands of digits"),
        ("[modal]\ncount = 0x" + "f" * 5000 + "\n", "too large to be computed with"),
        ("[modal]\ncount = " + "9" * 4000 + "\n", "too large to be computed with"),
        ("a = " + "[" * 100_000 + "\n", "nested too deeply"),
        ("a = " + "[" * 60 + "]" * 60 + "\n", "nested too deeply; at most 20"),
        ("a = " + "{ b = " * 100_000 + "\n", "nested too deeply"),
        ("a" + ".a" * 30 + " = 1\n", "nested too deeply; at most 20"),
        ("a" + ".a" * 50_000 + " = 1\n", "line 1: a key of tables that are nested too deeply"),
        ("[a" + ".a" * 50_000 + "]\n", "a key of tables that are nested too deeply"),
        ("a = { b" + ".a" * 50_000 + " = 1}\n", "a key of tables that are nested too deeply"),
        ("".join(f"[modal.x{k}]\n" for k in range(3000)), "more problems"),
        ("# " + "x" * 2**24, "no more than 16 MiB are read"),
    ],
)
def test_case_files(more, words, tmp_path):
    path = tmp_path / "case.toml"
    text = CASE[: CASE.index("[modal]")] if "[modal" in more and "[modal]" in CASE else CASE
    path.write_text(more + CASE if more[0] in "ax\"" else text + "\n" + more)
    message = told(st.load, path)
    assert words in message
    assert message.count("\n") <= 101


def test_overrides():
    for text in ("modal.count=" + "9" * 5000, "modal.count=0x" + "f" * 5000, "a" + ".a" * 50_000 + "=1", "x" * 10**6):
        told(st.loads, CASE, [text])
    told(st.loads, CASE, ["modal.count=" + "[" * 100_000])


# -- meshes -----------------------------------------------------------------------------------------------------------
def test_gmsh_heads(tmp_path):
    path = tmp_path / "a.msh"
    for old, new in (("$Nodes\n4", "$Nodes\n1000000000000"), ("$Elements\n2", f"$Elements\n{10**30}")):
        assert "bytes cannot hold" in mesh(path, GMSH.replace(old, new))
    new = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 1000000000000 1 9\n2 1 0 4\n1\n0 0 0\n$EndNodes\n"
    assert "claims 1000000000000 at Nodes" in mesh(path, new)
    head = b"$MeshFormat\n4.1 1 8\n" + struct.pack("<i", 1) + b"\n$EndMeshFormat\n$Nodes\n"
    assert "bytes cannot hold" in mesh(path, head + struct.pack("<4Q", 1, 10**12, 1, 9) + b"\n$EndNodes\n")
    head = b"$MeshFormat\n2.2 1 8\n" + struct.pack("<i", 1) + b"\n$EndMeshFormat\n$Nodes\n1000000000000\n"
    assert "bytes cannot hold" in mesh(path, head)


def test_vtk_heads(tmp_path):
    for old, new in (
        ("POINTS 3", "POINTS 1000000000000"),
        ("CELLS 1 4", "CELLS 1 999999999999"),
        ("CELL_TYPES 1", f"CELL_TYPES {10**18}"),
    ):
        assert "bytes cannot hold" in mesh(tmp_path / "a.vtk", VTK.replace(old, new))


def test_xml(tmp_path):
    path = tmp_path / "a.vtu"
    assert read_mesh_text(path, VTU) == 1
    laughs = "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 12))
    bomb = f'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a0 "0">{laughs}]>' + VTU.split("\n", 1)[1]
    assert "defines XML entities" in mesh(path, bomb.replace("0 0 0 1 0 0 0 1 0", "&a11;"))
    assert "cannot hold" in mesh(path, VTU.replace('NumberOfPoints="3"', f'NumberOfPoints="{10**15}"'))
    mesh(path, "<a>" * 100_000)


def read_mesh_text(path: Path, text: str) -> int:
    path.write_text(text)
    return read_mesh(path).cell_count


# -- matrices ---------------------------------------------------------------------------------------------------------
def mat_5(array_bytes: bytes, flags: int, *, shape=(60_000, 60_000)) -> bytes:
    """A variable K of a version 5 file, its values so many bytes of int8, packed."""
    values = len(array_bytes)
    body = struct.pack("<2I2I", 6, 8, flags, 0) + struct.pack("<2I2i", 5, 8, *shape)
    body += struct.pack("<2I", 1, 1) + b"K" + bytes(7) + struct.pack("<2I", 1, values) + array_bytes
    packed = zlib.compress(struct.pack("<2I", 14, len(body)) + body, 9)
    return b"MATLAB 5.0".ljust(124) + struct.pack("<H", 0x0100) + b"IM" + struct.pack("<2I", 15, len(packed)) + packed


def test_packed_matrices(tmp_path, monkeypatch):
    """What a few kB unfold to is looked at as it becomes numbers, and the limit can be moved."""
    monkeypatch.setenv("STRIDOR_READ_LIMIT", "0.02")
    path = tmp_path / "a.mat"
    path.write_bytes(mat_5(bytes(30_000_000), 6))
    assert path.stat().st_size < 100_000
    assert "unpacks to" in told(read_matrix, path)
    path.write_bytes(mat_5(bytes(9_000_000), 6, shape=(3000, 3000)))  # bytes that become double precision
    assert "K' – unpacks to 68.7 MiB or more" in told(read_matrix, path)
    monkeypatch.setenv("STRIDOR_READ_LIMIT", "0.1")
    assert read_matrix(path).matrix.shape == (3000, 3000)


def test_hdf5_and_npz(tmp_path, monkeypatch):
    monkeypatch.setenv("STRIDOR_READ_LIMIT", "0.02")
    path = tmp_path / "b.mat"
    with h5py.File(path, "w") as file:
        item = file.create_dataset("K", (10**6, 10**6), "f8", chunks=(1000, 1000), compression="gzip")
        item.attrs["MATLAB_class"] = np.bytes_("double")
    assert "claims" in told(read_matrix, path)
    path = tmp_path / "c.npz"
    np.savez_compressed(path, K=np.zeros((2000, 2000), dtype=np.int8))
    assert "K' – unpacks to 30.5 MiB or more" in told(read_matrix, path)
    shape = str({"descr": "<f8", "fortran_order": False, "shape": (10**9, 10**9)}).ljust(117) + "\n"
    for version, length in ((b"\x01\x00", struct.pack("<H", 118)), (b"\x02\x00", struct.pack("<I", 118))):
        head = b"\x93NUMPY" + version + length + shape.encode()
        (tmp_path / "d.npy").write_bytes(head + bytes(80))
        assert "for which its" in told(read_matrix, tmp_path / "d.npy")
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("K.npy", head + bytes(80))
        assert "for which its" in told(read_matrix, path)
    head = b"\x93NUMPY\x02\x00" + struct.pack("<I", 2**32 - 1)
    (tmp_path / "d.npy").write_bytes(head + bytes(80))
    assert "claims a head of 4294967295 bytes" in told(read_matrix, tmp_path / "d.npy")


def test_text_that_claims_much(tmp_path):
    path = tmp_path / "a.mtx"
    for head in ("coordinate real general\n1000000000 1000000000 1", "array real symmetric\n1000000 1000000"):
        path.write_text(f"%%MatrixMarket matrix {head}\n1 1 1.0\n" if "coord" in head else f"%%MatrixMarket matrix {head}\n1\n")
        assert "breaks off" in told(read_matrix, path) or "broken off" in told(read_matrix, path)


def test_files_that_break_off_get_our_words(tmp_path):
    """Truncated files of version 7.3 and .npz: the libraries' words for it are not a user's."""
    path = tmp_path / "a.mat"
    with h5py.File(path, "w") as file:
        item = file.create_dataset("K", data=np.eye(200))
        item.attrs["MATLAB_class"] = np.bytes_("double")
    whole = path.read_bytes()
    for share in (0.3, 0.9):
        path.write_bytes(whole[: int(share * len(whole))])
        assert told(read_matrix, path).endswith("is a file of version 7.3 (HDF5) that breaks off or is damaged")
    stream = io.BytesIO()
    np.savez(stream, K=np.eye(50))
    path = tmp_path / "a.npz"
    for share in (0.3, 0.99):
        path.write_bytes(stream.getvalue()[: int(share * len(stream.getvalue()))])
        assert told(read_matrix, path).endswith("is a .npz file that breaks off: its table of contents is missing")
    scipy.io.savemat(tmp_path / "v5.mat", {"K": np.eye(50)})
    path = tmp_path / "b.mat"
    path.write_bytes((tmp_path / "v5.mat").read_bytes()[:2000])
    assert "breaks off" in told(read_matrix, path)
