"""Result files damaged in every variable and attribute: refused with one line, or the answer is the same."""

from __future__ import annotations

import functools
import itertools
import os
import shutil
import socket
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

import stridor as st
from marching import in_chunks
from mode_coupling import mode_coupling
from program import stridor
from rubbing_block import rubbing_block
from stridor.agreement import Perturbation
from stridor.agreement.comparison import Agreement, Comparison
from stridor.io.datasets import load_trajectory
from stridor.io.reduced_models import load_reduced
from stridor.io.result_files import accept, damage_told, open_results
from stridor.io.seals import seal
from stridor.modal.parametric import ModesAtPoints
from stridor.study.boundary_result import Boundary, BoundaryCurve, CountedAt, SolvedAgain
from stridor.study.damping_result import Confirmed, DampingMap
from stridor.temporal.signals import Components

pytestmark = pytest.mark.bad_input

COARSE = {
    "bodies.beam1.elements": 6,
    "bodies.beam2.elements": 18,
    "temporal.step": 4e-7,
    "temporal.record_every": 20,
    "phases.press.duration": 2e-4,
    "phases.slide.duration": 4e-4,
}
# One damage in so many is enough to see a mechanism fail; all of them take minutes.
SAMPLED = pytest.mark.parametrize("every", [pytest.param(1, marks=pytest.mark.slow), 13])
THIRD = pytest.mark.parametrize("every", [pytest.param(1, marks=pytest.mark.slow), 3])
KINDS = ("beams", "solids", "modes", "onsets", "compare", "boundary", "cycles", "along", "map", "changes", "points")


@functools.cache
def case(kind: str) -> st.Case:
    if kind == "solids":
        phases = '[[phases]]\nname = "slide"\nduration = 1e-5\n'
        text = rubbing_block("max_frequency_hz = 20e3", more=phases)
        return st.loads(text, ["temporal.record_every=5", 'temporal.watch=["block.crown"]'])
    from stridor.case import template_text

    return st.loads(template_text("two-beams")).with_(COARSE)


@functools.cache
def result(kind: str):
    if kind == "modes":
        return st.modes(case("beams"), [0.0, 0.1], count=4, vectors=True)
    if kind == "onsets":
        return st.onsets(case("beams"), (0.0, 1.0), max_frequency_hz=20e3)
    if kind == "boundary":
        first, second = np.array([0.1, 0.4, 0.7]), np.array([1, -1, 1])
        curve = BoundaryCurve(
            first, first + 1, 100 * first, first, -first, second, np.abs(second) - 1, "flutter", False,
            ("edge", "band"), 1e-14 * first, np.full(3, np.nan), 1e-4, 1,
        )  # fmt: skip
        places = (CountedAt(0.2, 0.3, 1),), True, "one curve", "reduced", 30, 200, 40, 7, (SolvedAgain(0, 0.4, 1.4, 1e-6, 1e-13),)
        return Boundary("x", "mu", (0.0, 1.0), (0.0, 2.0), 1e3, (curve, curve), (0.0, 1.0), (0.0, 2.0), *places)
    if kind == "along":
        return st.onsets(case("beams"), (0.0, 0.3), along="contacts.A.friction.coefficient", max_frequency_hz=9e3)
    if kind == "map":
        values, found = np.array([1.0, 2.0, 4.0]), np.array([[0.1, 0.2], [0.3, np.nan], [0.15, 0.25]])
        made = (Confirmed(1.0, 5.0, 0.1, 0.1001, 1e-14),)
        return DampingMap(
            "a", "b", values, values[:2] + 4, (0.0, 0.5), 9e3, found, 1e3 * found, found, -found, 1e-14 * found, 0.09,
            ("a warning",), {"case": ""}, "reduced", 1e-9 * found, made, ("a note",),
        )  # fmt: skip
    if kind == "points":
        two, grows = np.array([[100.0, 200.0], [110.0, np.nan]]), np.array([[True, False], [False, False]])
        at, steps = np.array([[0.1, 0.5], [0.2, 0.5]]), np.array([0, 2])
        return ModesAtPoints(
            ("mu", "k"), at, two, two / 7, grows, two / 1e12, ~grows, two / 1e15, grows[:, 0], steps, {"case": ""}
        )
    if kind == "changes":
        return st.rank_countermeasures(case("beams"), mu=0.3, verify=1)
    if kind == "cycles":
        return st.cycles(mode_coupling(0.02, 0.1), [0.9, 1.0, 1.1])
    if kind == "compare":
        part = Perturbation(0.2, 3 + 4e4j, np.zeros(3), 1e-5, Components(np.zeros(0, complex), np.zeros(0)))
        row = Comparison(0.2, 3 + 4e4j, (6e3,), (3.0,), part, 6.1e3, None, 1e-3, 2e-3, 0.97, 0, True, "agrees")
        return Agreement((row, replace(row, mu=0.3)), 0.11, 0.12, (0.1, 0.14), "agrees")

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    if kind == "beams":
        with pytest.MonkeyPatch.context() as patch:
            in_chunks(patch, 700)
            return st.simulate(case(kind), progress=stop)
    with pytest.MonkeyPatch.context() as patch:
        in_chunks(patch, 10)
        return st.simulate(case(kind), progress=stop)


@functools.cache
def whole(kind: str) -> xr.Dataset:
    return seal(st.to_dataset(result(kind)))


def refused(dataset: xr.Dataset, original: xr.Dataset) -> str:
    """What is said of a dataset, "" where it is accepted; then it must be what it was."""
    try:
        with damage_told(Path("run.nc")):
            accept(dataset, Path("run.nc"))
    except st.CaseError as error:
        message = str(error)
        assert message.startswith("file: 'run.nc' – "), message
        assert "\n" not in message
        assert "Error" not in message, message  # a word of Python's
        return message
    assert dataset.drop_attrs().identical(original.drop_attrs()) or dataset.identical(original)
    return ""


def damages(values: np.ndarray) -> dict[str, np.ndarray]:
    """Other arrays in place of one."""
    if values.dtype.kind in "OU":
        renamed = np.array([f"{v}x" for v in values.ravel()], dtype=object).reshape(values.shape)
        return {"renamed": renamed, "turned": values[::-1].copy(), "numbers": np.zeros(values.shape)}
    found = {
        "text": np.full(values.shape, "a", dtype=object),
        "narrow": values.astype(np.float32),
        "zeros": np.zeros_like(values),
        "negative": (-np.abs(values) - 1).astype(values.dtype),
        "huge": np.full_like(values, 2**30 if values.dtype.itemsize > 1 else 100),
        "turned": values.ravel()[::-1].reshape(values.shape).copy(),
        "one": values.copy(),
        "whole" if values.dtype.kind == "f" else "broken": values.astype("i8" if values.dtype.kind == "f" else "f8"),
    }
    if values.size:
        found["one"].flat[values.size // 2] += 1
    if values.dtype.kind == "f":
        found |= {"nan": np.full_like(values, np.nan), "inf": np.full_like(values, np.inf), "1e300": values + 1e300}
    return found


def damaged(kind: str):
    """Name of the damage, dataset, whether the damage is of a kind that no seal can hide."""
    data = whole(kind)
    for name in map(str, data.variables):
        held = data.variables[name]
        yield f"{name} dropped", data.drop_vars(name), True
        for what, values in damages(held.values).items():
            yield f"{name} {what}", data.assign({name: (held.dims, values, held.attrs)}), False
        other = [f"new_{d}" for d in held.dims]
        yield f"{name} other dimensions", data.drop_vars(name).assign({name: (other, held.values, held.attrs)}), False
    names = sorted(map(str, data.data_vars))
    for one, other in itertools.pairwise(names):
        if data[one].dims == data[other].dims:
            swapped = {one: (data[other].dims, data[other].values), other: (data[one].dims, data[one].values)}
            yield f"{one} and {other} swapped", data.assign(swapped), False
    for name in data.attrs:
        left = {k: v for k, v in data.attrs.items() if k != name}
        yield f"attribute {name} dropped", data.drop_attrs(deep=False).assign_attrs(left), False
        for value in ("", "null", "[]", "{}", "{", "[" * 5000, "\x00", 7, np.nan, np.zeros(3)):
            yield f"attribute {name} = {str(value)[:9]!r}", data.assign_attrs({name: value}), False


@SAMPLED
@pytest.mark.parametrize("kind", KINDS)
def test_every_change_is_told(kind, every):
    """By the hash: each variable and attribute, whatever is done to it."""
    original = whole(kind)
    assert refused(original, original) == ""
    found = [(name, refused(dataset, original)) for name, dataset, _ in itertools.islice(damaged(kind), 0, None, every)]
    told = sum(bool(message) for _, message in found)
    assert len(found) > 60 / every
    # What is not told leaves everything as it was: zeros in place of zeros.
    assert told > 0.7 * len(found)


@SAMPLED
@pytest.mark.parametrize("kind", KINDS)
def test_what_no_stridor_can_have_written_is_refused_with_any_hash(kind, every):
    """With hashes made to fit the damage nothing but sense is left: no traceback, and no senseless values accepted."""
    lost: list[str] = []
    for name, dataset, certain in itertools.islice(damaged(kind), 0, None, every):
        if name.startswith("attribute contents"):
            continue
        try:
            sealed = seal(dataset)
        except (TypeError, ValueError, RecursionError):
            continue
        try:
            with damage_told(Path("run.nc")):
                accept(sealed, Path("run.nc"))
        except st.CaseError:
            continue
        if certain or name.split(" ")[-1] in ("nan", "inf", "text") or name.endswith("other dimensions"):
            lost.append(name)
    # NaN stands for what is not there in modes and onsets, the vectors are optional, and a restart looks further.
    free = {"eigenvalue", "frequency", "growth_rate", "damping_ratio", "residual", "square_root_coefficient"}
    free |= {"growth_slope", "exceptional_mu", "modal_eigenvalue", "temporal_eigenvalue", "frequency_error"}
    free |= {"growth_rate_error", "mac", "dominant_frequency", "right_vector", "left_vector", "node_area"}
    free |= {"enters_at", "onset_mu", "slope_x", "slope_y", "error"}
    wrong = [n for n in lost if n.split(" ")[0] not in free and not n.startswith("restart_")]
    assert not [n for n in wrong if not _blows_up(kind, n)], wrong


def _blows_up(kind: str, name: str) -> bool:
    """Records of an interrupted run may end in what is not finite: it may have been stopped because of that."""
    return kind in ("beams", "solids") and name.split(" ")[-1] in ("nan", "inf")


def state_damages(values: np.ndarray) -> dict[str, np.ndarray]:
    found = {k: v for k, v in damages(values).items() if k not in ("whole", "broken", "1e300")}
    found |= {"short": values.ravel()[: values.size // 2].copy(), "deep": values[None]}
    if values.dtype.kind == "i":
        found |= {"1e9": np.full_like(values, 10**9), "broken": values.astype(float), "-1": np.full_like(values, -1)}
    return found


@SAMPLED
@pytest.mark.parametrize("kind", ["beams", "solids"])
def test_a_damaged_state_never_reaches_a_compiled_loop(kind, every):
    """Every array of a saved state damaged in memory: refused, or the march goes on through finite numbers."""
    run = result(kind)
    assert run.interrupted
    states = [(name, {k: v for k, v in run.state.items() if k != name}) for name in run.state]
    for name, values in run.state.items():
        states += [(name, {**run.state, name: other}) for other in state_damages(np.asarray(values)).values()]
    refusals, total = 0, len(states[::every])
    for name, state in states[::every]:
        try:
            on = st.simulate(case(kind), restart=replace(run, state=state))
        except (st.CaseError, st.AnalysisError):  # AnalysisError: what was changed within reason blows up
            refusals += 1
        else:
            assert np.isfinite(on.kinetic).all(), name
            assert on.steps == on.planned_steps
    assert refusals > 0.5 * total
    for name, wrong in (("state_segment", 10**9), ("state_segment", -1), ("state_status", 7), ("contacts_status", 7)):
        if name in run.state:
            state = {**run.state, name: np.full_like(run.state[name], wrong)}
            with pytest.raises(st.CaseError, match=rf"restart: '?{name}.*out of range.*damaged; start the run anew"):
                st.simulate(case(kind), restart=replace(run, state=state))
    counters = np.array(run.state["state_counters"])
    for place, value in ((0, -5), (0, run.steps + 1), (1, -1)):
        wrong = counters.copy()
        wrong[place] = value
        with pytest.raises(st.CaseError, match="state_counters"):
            st.simulate(case(kind), restart=replace(run, state={**run.state, "state_counters": wrong}))
    works = np.full_like(run.state["state_works"], np.nan)
    with pytest.raises(st.CaseError, match="not finite"):
        st.simulate(case(kind), restart=replace(run, state={**run.state, "state_works": works}))


# -- files ------------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def files(tmp_path_factory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("results")
    return {kind: st.save(result(kind), folder / f"{kind}.nc") for kind in KINDS}


def loaded(path: Path):
    """What is said of a file, None where it is read."""
    try:
        found = st.open(path)
    except st.CaseError as error:
        message = str(error)
    else:
        return found, ""
    assert "\n" not in message
    assert message.startswith("file: ")
    return None, message


def _is_length(item: h5py.Dataset) -> bool:
    """Whether a dataset only says how long a dimension is."""
    return b"not a netCDF variable" in item.attrs.get("NAME", b"")


def dealt(kind: str, every: int, kinds_of_damage: tuple) -> tuple:
    """Of the damages those in turn for this kind of result: one in so many; of all kinds together every one."""
    return kinds_of_damage[KINDS.index(kind) % every :: every]


@THIRD
@pytest.mark.parametrize("kind", KINDS)
def test_changes_through_hdf5_are_told(kind, every, files, tmp_path):
    """As one who edits the file would make them, the file's own hash left as it is."""
    path = tmp_path / files[kind].name
    with h5py.File(files[kind], "r") as file:
        names = [n for n in file if file[n].size and file[n].dtype.kind in "iuf" and not _is_length(file[n])][::7]
        attributes = [n for n in file.attrs if not n.startswith("_")][::2]
    told = 0
    for name in names:
        shutil.copyfile(files[kind], path)
        with h5py.File(path, "r+") as file:
            before = file[name][()]
            file[name][...] = before + 1
        assert f"({name} changed)" in loaded(path)[1]
        told += 1
    for name in dealt(kind, every, tuple(attributes)):
        shutil.copyfile(files[kind], path)
        with h5py.File(path, "r+") as file:
            del file.attrs[name]
        assert loaded(path)[1], name
    changes = ("deleted", "grouped", "linked", "outside", "huge", "elsewhere", "virtual")
    for change in dealt(kind, every, changes):
        shutil.copyfile(files[kind], path)
        with h5py.File(path, "r+") as file:
            name = next(known for known in ("time", "mu", "x", "value", "percent") if known in file)
            del file[name]
            if change == "grouped":
                file.create_group(name)
            elif change == "linked":
                file[name] = h5py.SoftLink("/nothing")
            elif change == "outside":
                file[name] = h5py.ExternalLink("/etc/hostname", "/")
            elif change == "huge":
                file.create_dataset(name, (2**40,), "f8", chunks=(1024,))
            elif change == "elsewhere":
                file.create_dataset(name, (100,), "f8", external=[("/dev/zero", 0, 800)])
            elif change == "virtual":
                layout = h5py.VirtualLayout((10,), "f8")
                layout[:] = h5py.VirtualSource("/dev/zero", "data", (10,), "f8")
                file.create_virtual_dataset(name, layout)
        message = loaded(path)[1]
        assert "cut short, damaged or changed since stridor wrote it" in message, change
    assert told > 0


@THIRD
@pytest.mark.parametrize("kind", KINDS)
def test_files_cut_short_or_with_other_bytes(kind, every, files, tmp_path):
    content = files[kind].read_bytes()
    path = tmp_path / files[kind].name
    assert loaded(files[kind])[0] is not None
    for share in dealt(kind, every, (0.0005, 0.2, 0.9, 0.999)):
        path.write_bytes(content[: max(9, int(share * len(content)))])
        assert "cut short" in loaded(path)[1]
    rng = np.random.default_rng(11)
    original = open_results(files[kind])
    for _ in range(8 // every + 1):
        data = bytearray(content)
        place = int(rng.integers(len(data)))
        data[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(bytes(data))
        if not loaded(path)[1]:
            assert open_results(path).identical(original)


def test_no_damaged_byte_reaches_hdf5(files, tmp_path, monkeypatch):
    """Of some, such as those that say how many dimensions a variable has, it makes a loop that not even Ctrl-C ends."""
    content, path = files["modes"].read_bytes(), tmp_path / "modes.nc"
    monkeypatch.setattr(h5py, "File", lambda *_, **__: pytest.fail("opened"))
    for place in range(8, len(content) - 81, 997):
        data = bytearray(content)
        data[place] ^= 1
        path.write_bytes(data)
        assert "its bytes are not those that were written" in loaded(path)[1]


def test_what_another_program_writes_again_is_taken_by_what_it_holds(files, tmp_path):
    path, original = tmp_path / "modes.nc", open_results(files["modes"])
    with h5py.File(files["modes"], "r") as file, h5py.File(path, "w") as copy:
        for name in file.attrs:
            copy.attrs[name] = file.attrs[name]
        for name in file:
            file.copy(name, copy)
    assert path.read_bytes()[-81:] != files["modes"].read_bytes()[-81:]
    cut = tmp_path / "cut.nc"
    cut.write_bytes(files["modes"].read_bytes()[:-81])
    assert open_results(cut).identical(original)


def test_files_that_are_no_files(tmp_path):
    """Folders, pipes, sockets, devices, links in a circle: told at once, by every reader of results."""
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "circle").symlink_to(tmp_path / "circle")
    listening = socket.socket(socket.AF_UNIX)
    where = os.getcwd()
    os.chdir(tmp_path)  # names of sockets are short
    listening.bind("socket")
    os.chdir(where)
    try:
        for read in (st.open, open_results, load_trajectory, load_reduced):
            for name, words in (
                (tmp_path / "folder", "is a folder"),
                (tmp_path / "pipe", "a pipe"),
                (tmp_path / "socket", "a socket"),
                (tmp_path / "circle", "cannot be read: Too many levels of symbolic links"),
                (Path("/dev/zero"), "a device"),
                (tmp_path / "nothing", "no such file"),
                (tmp_path / ("long" * 100), "cannot be read: File name too long"),
                (tmp_path / "a\0b", "cannot be read"),
            ):
                with pytest.raises(st.CaseError, match=words):
                    read(name)
    finally:
        listening.close()


def test_files_of_other_formats(files, tmp_path):
    path = tmp_path / "modes.nc"
    for change, words in (
        ({"format": "stridor results 2"}, "written in format 'stridor results 2'; this one reads 'stridor results 1'"),
        ({"format": "another program's"}, "no results of stridor"),
        ({"contents": None}, "a results file without the hash of its contents"),
    ):
        shutil.copyfile(files["modes"], path)
        with h5py.File(path, "r+") as file:
            for name, value in change.items():
                del file.attrs[name]
                if value is not None:
                    file.attrs[name] = value
        assert words in loaded(path)[1]


def test_the_command_line_tells_a_damaged_file(files, tmp_path):
    path = tmp_path / "beams.nc"
    shutil.copyfile(files["beams"], path)
    with h5py.File(path, "r+") as file:
        file["restart_state_segment"][...] = 10**9
    (tmp_path / "bench.toml").write_text(case("beams").text)
    done = stridor("simulate", "bench.toml", "--restart", str(path), cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert "(restart_state_segment changed); compute it again" in done.stderr
    assert "Traceback" not in done.stderr
