"""Studies end to end: the same rows whoever computes them, nothing lost and nothing done twice whoever is killed."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

import stridor as st
from matrix_cases import matrix_case
from mode_coupling import mode_coupling
from program import stridor
from stridor.case import template_text
from stridor.errors import AnalysisError, CaseError
from stridor.studies import reduced_rows
from stridor.studies.effect import without_effect
from stridor.studies.parts import Part
from stridor.studies.processes import forked
from stridor.studies.rows import Row, failed, full_row, variables
from stridor.studies.sampling import samples
from stridor.studies.store import LATER, PENDING, OpenStore
from stridor.studies.summary import answer, tables
from stridor.studies.tables import Keep
from stridor.studies.task import SampleBatch, Task
from stridor.studies.workers import LOADED, LocalWorkers
from stridor.study.run_summary import slower_is_stronger
from undrawn import nothing_drawn

COARSER = ["bodies.beam1.elements=6", "bodies.beam2.elements=18"]
FEW = ["bodies.beam1.elements=3", "bodies.beam2.elements=6", "modal.max_frequency_hz=3e3"]
MASS = "bodies.beam1.damping.mass"
GRID = {"mu": {"range": (0.0, 0.6), "points": 5}, MASS: {"values": (1.0, 20.0)}}
EXACT = ["frequency_hz", "growth_rate", "branch", "unstable_modes", "status", "number", "mu", MASS]


@pytest.fixture(scope="module")
def case() -> st.Case:
    return st.loads(template_text("two-beams"), FEW)


@pytest.fixture(scope="module")
def grid(case: st.Case) -> st.Study:
    return st.Study(case=case, parameters=GRID, answers={"source": "full"})


@pytest.fixture(scope="module")
def whole(grid: st.Study, tmp_path_factory: pytest.TempPathFactory) -> st.studies.result.StudyResult:  # type: ignore[name-defined]
    return st.run_study(grid, tmp_path_factory.mktemp("whole"), workers=2)


def same(one: xr.Dataset, other: xr.Dataset) -> bool:
    return all(np.array_equal(one[n].values, other[n].values, equal_nan=one[n].dtype.kind == "f") for n in EXACT)


def test_rows_are_what_modes_says(case: st.Case, whole) -> None:
    assert whole.done.all()
    for k in (0, 3, 9):
        mu, mass = float(whole.data["mu"][k]), float(whole.data[MASS][k])
        modes = st.modes(case.with_({MASS: mass}), mu, max_frequency_hz=3e3)
        row = whole.data.isel(row=k)
        held = np.isfinite(row["frequency_hz"].values)
        assert row["frequency_hz"].values[held] == pytest.approx(np.sort(modes.frequency_hz[0]), rel=1e-12)
        assert int(row["unstable_modes"]) == int(modes.unstable.sum())


def test_xarray_opens_a_store_without_stridor(whole) -> None:
    code = (
        "import sys, warnings; warnings.simplefilter('error')\n"
        f"import xarray as xr; d = xr.open_zarr({str(whole.path)!r}, consolidated=False)\n"
        "print(d.sizes['row'], d['growth_rate'].attrs['units'], sorted(d.coords), float(d['mu'].max()), 'stridor' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert done.stdout == f"10 1/s ['{MASS}', 'mu', 'number'] 0.6 False\n"


def test_parts_put_together_are_the_whole(grid: st.Study, whole, tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text("", encoding="utf-8")
    for number in (1, 3):
        st.run_study(grid, tmp_path, workers=1, part=Part(number, 3))
    from stridor.studies.merge import merged

    told = merged(tmp_path, tmp_path / "study.zarr", grid)
    assert told == ["parts missing: 2 of 3; their rows are not computed"]
    assert st.open_study(tmp_path).pending == 3
    shutil.copytree(tmp_path / "part-1-of-3", tmp_path / "part-2-of-3")
    assert merged(tmp_path, tmp_path / "study.zarr", grid) == [*told, "part-2-of-3 holds the rows of part-1-of-3"]
    shutil.rmtree(tmp_path / "part-2-of-3")
    st.run_study(grid, tmp_path, workers=1, part=Part(2, 3))
    assert merged(tmp_path, tmp_path / "study.zarr", grid) == []
    assert same(st.open_study(tmp_path).data, whole.data)
    # Nothing is left to do for the study itself.
    again = st.run_study(grid, tmp_path, workers=1, progress=lambda *_: pytest.fail("something was computed"))
    assert again.done.all()
    # Parts of another study are not those of the one that is given, and leave what is there alone.
    before = st.open_study(tmp_path).data.load()
    other = grid.model_copy(update={"compute": "onsets", "restart_failed": True})
    changed = grid.model_copy(update={"case": grid.base().with_({"modal.damped": False})})
    for given, names in ((other, "compute differs"), (changed, "case differs")):
        with pytest.raises(CaseError, match=f"holds parts of another study than the one given: {names}; give"):
            merged(tmp_path, tmp_path / "study.zarr", given)
    assert same(st.open_study(tmp_path).data, before)
    assert merged(tmp_path, tmp_path / "study.zarr", grid.model_copy(update={"restart_failed": True})) == []


def test_a_part_of_a_study_has_no_sobol_indices(tmp_path: Path) -> None:
    """Not of the blocks that it happens to hold, and no traceback where it cuts through one."""
    parameters = {"mu": {"range": (0.6, 1.0)}, "bodies.m.mass": {"range": (0.9, 1.1)}}
    study = st.Study(case=mode_coupling(0.02), parameters=parameters, sampling={"method": "saltelli", "samples": 4, "seed": 1})
    for number, count in ((1, 2), (2, 3)):
        found = st.run_study(study, tmp_path / str(count), workers=1, part=Part(number, count))
        with pytest.raises(AnalysisError, match=rf"part {number}/{count} of the rows .* \(--merge\)"):
            found.indices()
        (title, _, rows) = tables(found)[-1]
        assert title.startswith("No Sobol indices: these are part")
        assert rows == []
    whole = st.run_study(study, tmp_path / "whole", workers=1)
    assert whole.indices().names == ("mu", "bodies.m.mass")


def test_parts_of_several_versions_are_not_put_together_without_a_word(tmp_path: Path) -> None:
    """Nor is what they say lost: of numbers without effect, of lost workers."""
    from stridor.studies.merge import merged

    study = st.Study(case=mode_coupling(0.02), parameters={"mu": {"values": (0.8, 1.2)}, "temporal.step": {"values": (1e-3,)}})
    for number in (1, 2):
        st.run_study(study, tmp_path, workers=1, part=Part(number, 2))
    OpenStore.opened(tmp_path / "part-2-of-2" / "study.zarr", variables("modes")).note(programs=["9.9.9 of-the-future"])
    with pytest.raises(CaseError, match=r"parts that different versions of stridor computed \(.*, 9\.9\.9 of-the-future\), which may"):
        merged(tmp_path, tmp_path / "study.zarr", study)
    assert not (tmp_path / "study.zarr").exists()
    told = merged(tmp_path, tmp_path / "study.zarr", study, go_on=True)
    assert told[0].startswith("put together from parts that different versions")
    assert told[1].startswith("temporal.step has the one value 0.001 in all samples")
    found = st.open_study(tmp_path)
    assert json.loads(found.data.attrs["provenance"])["programs"][1] == "9.9.9 of-the-future"
    assert json.loads(found.data.attrs["without_effect"]) == told[1:]


def test_parts_take_no_rows_away_that_they_do_not_have(tmp_path: Path) -> None:
    """Of another study, of the same one computed as a whole; nor is what is there touched for a damaged part."""
    from stridor.studies.merge import merged

    grid = st.Study(case=mode_coupling(0.02), parameters={"mu": {"values": (0.8, 0.9, 1.1, 1.2)}})
    other, place = grid.model_copy(update={"compute": "onsets"}), tmp_path / "study.zarr"
    st.run_study(grid, tmp_path, workers=1, part=Part(1, 2))
    st.run_study(other, tmp_path, workers=1)
    with pytest.raises(CaseError, match="is of another study than the parts; move it away, or remove it"):
        merged(tmp_path, place, grid)
    assert st.open_study(tmp_path).done.all()
    shutil.rmtree(place)
    st.run_study(grid, tmp_path, workers=1)
    with pytest.raises(CaseError, match="has 2 rows that are in none of the parts; move it away"):
        merged(tmp_path, place, grid)
    st.run_study(grid, tmp_path, workers=1, part=Part(2, 2))
    assert merged(tmp_path, place, grid) == []
    chunk = tmp_path / "part-2-of-2" / "study.zarr" / "growth_rate" / "c" / "0" / "0"
    chunk.write_bytes(chunk.read_bytes() + b"x")
    with pytest.raises(CaseError, match="a chunk of growth_rate is damaged"):
        merged(tmp_path, place, grid)
    assert st.open_study(tmp_path).done.all()


def test_a_goal_is_not_pursued_in_parts_and_that_is_said(case: st.Case, tmp_path: Path) -> None:
    from stridor.studies.merge import merged

    study = st.Study(
        case=case, parameters=SCATTER, sampling={"method": "sobol", "samples": 4}, goal={"half_width": 0.02},
        answers={"source": "full"},
    )  # fmt: skip
    told: list[str] = []
    for number in (1, 2):
        assert len(st.run_study(study, tmp_path, workers=1, part=Part(number, 2), say=told.append).status) == 2
    said = "[goal] is not pursued in parts: each has the samples of the study; without --part more are added"
    assert told.count(f"warning: {said}") == 2
    assert merged(tmp_path, tmp_path / "study.zarr", study) == [said]


def test_bands_of_low_frequencies_are_told_apart(tmp_path: Path) -> None:
    """Modes at 0.15 Hz: eight bands, each of which begins where the one before ends."""
    study = st.Study(
        case=mode_coupling(0.02), parameters={"mu": {"range": (0.8, 1.2)}, "bodies.m.mass": {"range": (0.8, 1.2)}},
        sampling={"method": "random", "samples": 24},
    )  # fmt: skip
    result = st.run_study(study, tmp_path, workers=1)
    (rows,) = [rows for title, _, rows in tables(result) if title == "How likely a mode grows"]
    told = [tuple(map(float, row[0].split(" to "))) for row in rows]
    wanted = [(low, high) for low, high, _ in result.probability_in_bands()]
    assert all(low < high < 1.0 for low, high in told)
    assert [high for _, high in told[:-1]] == [low for low, _ in told[1:]]
    width = wanted[0][1] - wanted[0][0]
    assert np.abs(np.array(told) - wanted).max() < 0.06 * width


def test_rows_that_fail_say_why_and_stop_no_others(case: st.Case, tmp_path: Path) -> None:
    study = st.Study(case=case, parameters={"materials.steel.poisson_ratio": {"values": (0.2, 0.3, 0.7)}})
    found = st.run_study(study, tmp_path, workers=1)
    assert found.status.tolist() == [1, 1, 2]
    assert "materials.steel.poisson_ratio" in str(found.data["error"].values[2])
    assert any(note.startswith("1 row failed, the first:") for note in found.notes)


def test_parameters_without_effect_are_told(case: st.Case, tmp_path: Path) -> None:
    parameters = {"materials.steel.poisson_ratio": {"values": (0.2, 0.3)}, "mu": {"values": (0.1,)}, "temporal.perturbation": {"values": (1e-9, 1e-8)}}
    lines: list[str] = []
    st.run_study(st.Study(case=case, parameters=parameters), tmp_path, workers=1, say=lines.append)
    told = [line for line in lines if line.startswith("warning:")]
    assert told == [
        "warning: materials.steel.poisson_ratio has no effect on modes: it changes nothing of the model",
        "warning: mu has the one value 0.1 in all samples",
        "warning: temporal.perturbation has no effect on modes: it changes nothing of the model",
    ]


def test_a_number_that_counts_at_samples_alone_is_not_told_to_have_no_effect(tmp_path: Path) -> None:
    """K grows by a · b, and b is 0 in the case: there, a changes nothing. c has a part in nothing."""
    eye = np.eye(2)
    terms = [(eye, "mass", ""), (np.diag([1.0, 4.0]), "stiffness", ""), (eye, "stiffness", "a*b")]
    more = "[parameters]\na = { value = 1.0, range = [0.0, 2.0] }\nb = { value = 0.0, range = [0.0, 2.0] }\nc = { value = 0.0, range = [0.0, 2.0] }"
    case = matrix_case(tmp_path, terms, 0.6, more=more)
    varied = {f"parameters.{name}.value": {"range": (0.0, 2.0)} for name in "abc"}
    study = st.Study(case=case, parameters=varied, sampling={"method": "sobol", "samples": 8})
    told = without_effect(study, case, samples(study))
    assert [line.partition(" ")[0] for line in told] == ["parameters.c.value"]
    alone = st.Study(case=case, parameters={"parameters.a.value": {"values": (0.0, 2.0)}})
    assert [line.partition(" ")[0] for line in without_effect(alone, case, samples(alone))] == ["parameters.a.value"]


# -- who is killed -----------------------------------------------------------------------------------------------------
RUN = """
import sys, stridor as st
st.run_study(sys.argv[1], sys.argv[2], workers=2)
"""
KILLED = f"""
case = "case.toml"
answers.source = "full"
parameters.mu = {{ range = [0.0, 0.6], points = 40 }}
parameters."{MASS}".values = [1.0, 20.0]
"""


def _survives(case: st.Case, folder: Path, moments: Iterator[float], points: int) -> None:
    """Kill a study again and again: rows that were done stay, to the bit and to their time, and are not done twice."""
    (folder / "case.toml").write_text(case.text, encoding="utf-8")
    (folder / "study.toml").write_text(KILLED.replace("points = 40", f"points = {points}"), encoding="utf-8")
    before: xr.Dataset | None = None
    for wait in moments:
        words = [sys.executable, "-c", RUN, "study.toml", "out"]
        with subprocess.Popen(words, cwd=folder, stderr=subprocess.DEVNULL) as process:
            until = time.monotonic() + 60
            while before is None and not (folder / "out/study.zarr/status/c").exists() and time.monotonic() < until:
                time.sleep(0.05)
            time.sleep(wait)
            process.kill()
        if not (folder / "out" / "study.zarr").exists():
            continue
        now = st.open_study(folder / "out").data
        if before is not None:
            done = before["status"].values == 1
            for name in ("growth_rate", "seconds", "frequency_hz"):
                assert np.array_equal(before[name].values[done], now[name].values[done], equal_nan=True)
            assert np.all(now["status"].values[done] == 1)
        before = now
    assert before is not None
    study = st.Study.load(folder / "study.toml")
    last = st.run_study(study, folder / "out", workers=2)
    done = before["status"].values == 1
    assert np.array_equal(before["seconds"].values[done], last.data["seconds"].values[done])
    assert same(last.data, st.run_study(study, folder / "other", workers=2).data)
    assert not list((folder / "out").rglob("*.partial"))


def test_a_study_that_is_killed_goes_on(case: st.Case, tmp_path: Path) -> None:
    _survives(case, tmp_path, iter((0.3, 2.2)), 20)


@pytest.mark.slow
def test_a_study_that_is_killed_thirty_times_goes_on(case: st.Case, tmp_path: Path) -> None:
    rng = np.random.default_rng(int(time.time()))
    _survives(case, tmp_path, iter(rng.uniform(0.0, 5.0, 32).tolist()), 40)


def _deadly(task: Task, batch: SampleBatch) -> Iterator[tuple[int, Row]]:
    """Row 3 kills whoever computes it; row 5 only the first time."""
    for place in batch.places:
        mark = Path(task.model) / f"{place}"
        if place == 3 or (place == 5 and not mark.exists()):
            mark.write_text("", encoding="utf-8")
            os.kill(os.getpid(), signal.SIGKILL)
        yield place, {"status": 1, "seconds": 0.1}


def test_a_row_that_kills_its_workers_fails_and_others_do_not(tmp_path: Path) -> None:
    batches = [SampleBatch(tuple(range(k, k + 4)), ((0.0,),) * 4, (False,) * 4) for k in (0, 4, 8)]
    rows: dict[int, Row] = {}
    with LocalWorkers(Task("", "modes", ("mu",), Keep(), str(tmp_path)), 2, _deadly) as workers:
        for found in workers.answers(iter(batches)):
            assert not rows.keys() & found.keys()
            rows |= found
    assert sorted(rows) == list(range(12))
    assert [k for k, row in sorted(rows.items()) if row["status"] != 1] == [3]
    assert rows[3]["error"] == "the worker process died 3 times at this row: out of memory, or killed"
    assert workers.lost == 4


def test_a_row_writes_no_text_of_its_case(case: st.Case, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> str:
        raise AssertionError("this takes as long as some rows")

    monkeypatch.setattr(st.Case, "to_toml", refuse)
    assert full_row(case, "modes", {"mu": 0.2}, Keep())["status"] == 1


def _own_parent(task: Task, batch: SampleBatch) -> Iterator[tuple[int, Row]]:
    """Who computes a row, and what it came off."""
    for place in batch.places:
        yield place, {"status": 1, "seconds": 0.1, "parent": os.getppid()}


@pytest.mark.skipif(sys.platform != "linux", reason="workers are forked off on Linux only")
def test_workers_come_off_one_process_and_start_without_it_where_it_was_killed() -> None:
    parents: list[int] = []
    for _ in range(3):
        with LocalWorkers(Task("", "modes", ("mu",), Keep()), 1, _own_parent) as workers:
            (rows,) = workers.answers(iter([SampleBatch((0,), ((0.0,),), (False,))]))
        parents.append(rows[0]["parent"])
        if len(parents) == 2:
            assert parents[0] == parents[1] != os.getpid()
            os.kill(parents[1], signal.SIGKILL)
    assert parents[2] != parents[1]


def _surroundings(pipe: Any) -> None:
    pipe.send((os.environ.get("STRIDOR_TOLD"), os.environ["OPENBLAS_NUM_THREADS"], os.getcwd()))


def test_a_process_has_the_folder_and_the_environment_of_the_moment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for told in ("first", "second"):
        (tmp_path / told).mkdir()
        monkeypatch.chdir(tmp_path / told)
        monkeypatch.setenv("STRIDOR_TOLD", told)
        process, pipe = forked(_surroundings, "told", loaded=LOADED)
        assert pipe.recv() == (told, "1", str(tmp_path / told))
        process.join()


def test_workers_end_with_the_process_that_has_them(case: st.Case, tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(case.text, encoding="utf-8")
    (tmp_path / "study.toml").write_text(KILLED.replace("points = 40", "points = 4000"), encoding="utf-8")
    words = [sys.executable, "-c", RUN, "study.toml", "out"]
    with subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.DEVNULL) as process:
        until = time.monotonic() + 60
        while not (tmp_path / "out/study.zarr/status/c").exists() and time.monotonic() < until:
            time.sleep(0.1)  # rows are written only once workers have answered
        children = _children(process.pid)
        process.kill()
    assert len(children) >= 2
    until = time.monotonic() + 20
    while any(map(_runs, children)) and time.monotonic() < until:
        time.sleep(0.1)
    assert not any(map(_runs, children))


def _children(number: int) -> set[int]:
    """Of these as well: workers may be forked off a process that has everything loaded."""
    found = subprocess.run(["ps", "-o", "pid=", "--ppid", str(number)], capture_output=True, text=True, check=False)
    own = {int(word) for word in found.stdout.split()}
    return own.union(*map(_children, own))


def _runs(number: int) -> bool:
    try:
        return Path(f"/proc/{number}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_a_full_disk_loses_nothing_that_was_written(case: st.Case, tmp_path: Path) -> None:
    """Files may have no more than so many bytes, which the chunk of growth rates passes as rows are added."""
    (tmp_path / "case.toml").write_text(case.text, encoding="utf-8")
    (tmp_path / "study.toml").write_text(KILLED, encoding="utf-8")
    limited = (
        "import resource, stridor as st\n"
        "if __name__ == '__main__':\n"
        "    from stridor.studies.store import OpenStore\n"
        "    made = OpenStore.made\n"
        "    def then_full(*a, **k):\n"
        "        found = made(*a, **k)\n"
        "        resource.setrlimit(resource.RLIMIT_FSIZE, (4000, 4000))\n"
        "        return found\n"
        "    OpenStore.made = staticmethod(then_full)\n"
        "    try:\n"
        "        st.run_study('study.toml', 'out', workers=1)\n"
        "    except st.AnalysisError as error:\n"
        "        print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", limited], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "cannot write" in done.stdout, done.stderr
    assert "the same command goes on from there" in done.stdout
    kept = st.open_study(tmp_path / "out")
    assert kept.pending > 0
    last = st.run_study(tmp_path / "study.toml", tmp_path / "out", workers=2)
    assert last.done.all()
    assert np.array_equal(kept.data["seconds"].values[kept.done], last.data["seconds"].values[kept.done])


def test_a_script_needs_no_guard(case: st.Case, tmp_path: Path) -> None:
    """Workers do not import the script that starts them."""
    (tmp_path / "case.toml").write_text(case.text, encoding="utf-8")
    (tmp_path / "study.toml").write_text(KILLED.replace("points = 40", "points = 4"), encoding="utf-8")
    (tmp_path / "script.py").write_text("import stridor as st\nprint(st.run_study('study.toml', workers=2))\n", encoding="utf-8")
    done = subprocess.run([sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.count("modes of 8 samples") == 1


def test_ctrl_c_keeps_what_is_done(case: st.Case, tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(case.text, encoding="utf-8")
    (tmp_path / "study.toml").write_text(KILLED.replace("points = 40", "points = 4000"), encoding="utf-8")
    words = [sys.executable, "-m", "stridor", "study", "study.toml"]
    heed = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # tests in the background of a shell inherit none
    with subprocess.Popen(
        words, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=heed
    ) as process:
        until = time.monotonic() + 60
        while not (tmp_path / "study.out/study.zarr/status/c").exists() and time.monotonic() < until:
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 130, (out, err)
    assert "interrupted; the same command goes on from there" in err
    assert "Traceback" not in err
    assert 0 < int(st.open_study(tmp_path / "study.out").done.sum()) < 8000


# -- the reduced model -------------------------------------------------------------------------------------------------
SCATTER = {"mu": {"range": (0.0, 0.6)}, MASS: {"range": (1.0, 20.0)}, "materials.steel.density": {"range": (7700.0, 7900.0)}}


@pytest.fixture(scope="module")
def scatter(case: st.Case, tmp_path_factory: pytest.TempPathFactory):
    study = st.Study(case=case, parameters=SCATTER, sampling={"method": "sobol", "samples": 128}, answers={"confirm": 0.1})
    return st.run_study(study, tmp_path_factory.mktemp("scatter"), workers=2)


def test_reduced_rows_are_those_of_the_full_problem(case: st.Case, scatter) -> None:
    data = scatter.data
    assert set(data["source"].values) == {"reduced", "full"}
    assert np.count_nonzero(data["confirmed"].values == 1) >= 5
    assert not np.any(data["confirmed"].values == 2)
    for k in np.flatnonzero(data["source"].values == "reduced")[:6].tolist():
        values = {name: float(data[name][k]) for name in scatter.parameters}
        full = full_row(case, "modes", values, Keep())
        held = np.isfinite(data["frequency_hz"].values[k])
        here = data["growth_rate"].values[k, held] + 2j * np.pi * data["frequency_hz"].values[k, held]
        there = full["growth_rate"] + 2j * np.pi * full["frequency_hz"]
        allowed = max(10 * float(data["estimated_error"][k]), 1e-11)
        assert np.abs(here - there).max() <= allowed * np.abs(there).max()
        assert int(data["unstable_modes"][k]) == full["unstable_modes"]
        numbers = data["branch"].values[k, held]
        assert np.count_nonzero(numbers) >= len(numbers) - 1
        assert np.all((numbers == full["branch"]) | (numbers == 0))


def test_branches_scatter_by_their_numbers_from_the_reduced_model_too(scatter) -> None:
    assert scatter.branch_words == "by branch from μ = 0"
    spread = scatter.branches()
    assert [b.number for b in spread] == sorted({b.number for b in spread})
    assert len(spread) >= 4
    assert all(b.samples >= 0.95 * 128 for b in spread)
    places = replace(scatter, data=scatter.data.assign(branch=0 * scatter.data["branch"]))
    assert places.branch_words == "by place in frequency"


def test_rows_near_the_boundary_are_solved_in_full() -> None:
    case = st.loads(template_text("two-beams"), ["modal.max_frequency_hz=12e3", f"{MASS}=10.0"])
    first = st.onsets(case, (0.0, 1.0)).first
    assert first is not None
    study = st.Study(case=case, parameters=SCATTER, sampling={"method": "sobol", "samples": 64})
    model = reduced_rows.FrictionModels(
        (st.reduced_model(case, {"mu": (0.0, 1.0), MASS: (1.0, 20.0)}),), "modes", {}
    )
    at = {"mu": first.mu, MASS: 10.0}
    for mu, near in ((first.mu * (1 + 1e-9), True), (first.mu * (1 - 1e-9), True), (first.mu * 0.9, False)):
        row = model.row(at | {"mu": mu}, study.keep)
        assert row is not None
        assert model.doubtful(row) is near


def test_a_model_that_is_wrong_is_found_out(case: st.Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = reduced_rows.FrictionModels.row
    scale = 1 + 1e-6

    def shifted(self, values, keep):
        row = real(self, values, keep)
        return row if row is None else row | {"frequency_hz": row["frequency_hz"] * scale}

    monkeypatch.setattr(reduced_rows.FrictionModels, "row", shifted)
    lines: list[str] = []
    study = st.Study(case=case, parameters=SCATTER, sampling={"method": "sobol", "samples": 64})
    st.run_study(study, tmp_path, workers=1, say=lines.append)
    assert any("differ by 1.0e-06 at a sample" in line for line in lines)
    assert set(st.open_study(tmp_path).data["source"].values) == {"full"}


def test_a_goal_adds_samples_until_the_interval_is_narrow(case: st.Case, tmp_path: Path) -> None:
    study = st.Study(
        case=case, parameters=SCATTER, sampling={"method": "sobol", "samples": 32}, goal={"half_width": 0.05, "most": 2000}
    )
    found = st.run_study(study, tmp_path, workers=2)
    known = found.probability()
    assert 32 < known.of <= 2000
    assert known.half_width <= 0.05
    assert found.pending == 0


def test_a_goal_that_is_narrower_on_a_restart_adds_samples(case: st.Case, tmp_path: Path) -> None:
    parts = {"case": case, "parameters": SCATTER, "sampling": {"method": "sobol", "samples": 64}, "answers": {"source": "full"}}
    first = st.run_study(st.Study(**parts, goal={"half_width": 0.5}), tmp_path, workers=2)
    assert len(first.status) == 64
    told: list[str] = []
    again = st.run_study(st.Study(**parts, goal={"half_width": 0.02, "most": 128}), tmp_path, workers=2, say=told.append)
    assert (len(again.status), again.pending) == (128, 0)
    (missed,) = (line for line in told if line.startswith("the goal is not reached"))
    assert f"± {100 * again.probability().half_width:.3g} % with the 128 samples" in missed
    assert missed.endswith("not ± 2 %")
    assert np.array_equal(again.data["seconds"].values[:64], first.data["seconds"].values)


def test_a_goal_ends_where_rows_fail(case: st.Case, tmp_path: Path) -> None:
    """Half of the samples are no material: the goal is out of reach of the samples allowed."""
    parameters = {"mu": {"range": (0.0, 0.6)}, "materials.steel.poisson_ratio": {"range": (0.1, 0.9)}}
    study = st.Study(
        case=case, parameters=parameters, sampling={"method": "random", "samples": 16}, answers={"source": "full"},
        goal={"half_width": 0.02, "most": 48},
    )  # fmt: skip
    found = st.run_study(study, tmp_path, workers=2)
    assert (len(found.status), found.pending) == (48, 0)
    assert 10 < len(found.failed) < 40
    assert found.probability().of == 48 - len(found.failed)


def test_a_model_does_not_answer_what_the_full_problem_cannot(
    case: st.Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stridor.studies.run.full_row", lambda *_: failed("nothing slides there"))
    lines: list[str] = []
    study = st.Study(case=case, parameters=SCATTER, sampling={"method": "sobol", "samples": 64})
    st.run_study(study, tmp_path, workers=2, say=lines.append)
    assert any(line.endswith("there is no answer: nothing slides there") for line in lines)
    assert set(st.open_study(tmp_path).data["source"].values) == {"full"}


# -- the program -------------------------------------------------------------------------------------------------------
def test_the_program_prints_the_answer_and_draws(tmp_path: Path) -> None:
    case = st.loads(template_text("two-beams"), [*FEW, "modal.max_frequency_hz=12e3"])
    (tmp_path / "case.toml").write_text(case.text, encoding="utf-8")
    text = 'title = "A <b> study"\ncase = "case.toml"\nsampling = { method = "sobol", samples = 32 }\n'
    text += f'parameters.mu.range = [0.0, 0.6]\nparameters."{MASS}".range = [1.0, 20.0]\n'
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    done = stridor("study", "study.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[-2].startswith("a mode grows with a probability of ") or lines[-1].startswith("a mode grows")
    assert max(map(len, lines)) <= 80
    folder = tmp_path / "study.out"
    drawn = {path.name for path in folder.glob("*.png")}
    assert {"stability-map.png", "root-locus.png", "over-mu.png", "bands.png"} <= drawn
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "A &lt;b&gt; study" in page
    assert page.count("<img ") == page.count("<figcaption>") == len(drawn)
    anchors = set(re.findall(r'href="#([^"]+)"', page))
    assert {"summary", "about", "figure-stability-map"} <= anchors
    assert anchors <= set(re.findall(r' id="([^"]+)"', page))
    assert 'parameters.mu]' in page.replace("&#34;", '"')  # the study as it was asked
    assert st.open_study(folder).data[MASS].attrs["units"] == "1/s"
    heads = (folder / "study.csv").read_text(encoding="utf-8").splitlines()[0].split(",")
    assert heads[:3] == ["number", "mu", MASS]
    for path in folder.glob("*.png"):
        path.unlink()
    (tmp_path / "case.toml").unlink()  # the store is enough
    with nothing_drawn():  # again
        plotted = stridor("plot", "study.out", cwd=tmp_path)
    assert plotted.returncode == 0
    for note in st.open_study(folder).notes:
        assert " ".join(note.split()) in " ".join(plotted.stdout.split())
    assert {path.name for path in folder.glob("*.png")} == drawn
    with nothing_drawn():
        assert stridor("plot", "study.out/study.zarr", "--out", "elsewhere", cwd=tmp_path).returncode == 0
    assert {path.name for path in (tmp_path / "elsewhere").glob("*.png")} == drawn


@pytest.mark.parametrize("words", [("study", "study.toml"), ("plot", "study.out")])
def test_files_that_have_no_room_are_all_named_and_the_others_written(
    case: st.Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, str]
) -> None:
    (tmp_path / "case.toml").write_text(case.text, encoding="utf-8")
    text = 'case = "case.toml"\nsampling = { method = "grid" }\nparameters.mu.values = [0.1, 0.2]\n'
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    st.run_study(st.Study.load(tmp_path / "study.toml"), tmp_path / "study.out", workers=1)
    names = ("first", "second", "third")
    monkeypatch.setattr("stridor.studies.plots.study_figures", lambda _: {name: Figure((0.5, 0.5)) for name in names})
    whole = Path.replace

    def no_room(self: Path, target: Path) -> Path:
        if Path(target).name in ("second.png", "report.html"):
            raise OSError(28, "No space left on device")
        return whole(self, target)

    monkeypatch.setattr(Path, "replace", no_room)
    done = stridor(*words, cwd=tmp_path)
    assert done.returncode == 1
    written = {path.name for path in (tmp_path / "study.out").glob("*.[pch]*")}
    assert written == {"first.png", "third.png"} | ({"study.csv"} if words[0] == "study" else set())
    assert "grow" in done.stdout  # the answer is there all the same
    lost = [line for line in done.stderr.splitlines() if line.endswith(": No space left on device")]
    assert [Path(line.split(": ")[0]).name for line in lost] == ["second.png", "report.html"]
    assert done.stderr.endswith("study.zarr: the same command writes what is missing once there is room\n")


def test_what_is_gone_of_a_store_is_not_taken_for_zeros(case: st.Case, tmp_path: Path) -> None:
    """Without its chunk no mode of any row grew, and the probability was 0."""
    study = st.Study(case=case, parameters=SCATTER, sampling={"method": "sobol", "samples": 16}, answers={"source": "full"})
    whole = st.run_study(study, tmp_path / "whole", workers=2)
    names = [str(n) for n in whole.data.data_vars if n != "status"]
    assert {"unstable_modes", "growth_rate", "note"} <= set(names)

    def spoilt(name: str, what: str) -> Path:
        folder = tmp_path / f"{name}-{what}".replace("/", "-")
        shutil.copytree(tmp_path / "whole", folder)
        gone = folder / "study.zarr" / name / what
        shutil.rmtree(gone) if gone.is_dir() else gone.unlink()
        return folder

    for name in names:
        with pytest.raises(st.CaseError, match=rf"chunk 0 of {name} is gone; remove the folder .*status"):
            st.open_study(spoilt(name, "c"))
    with pytest.raises(st.CaseError, match="chunk 0 of mu is gone; which samples its rows are of is not known"):
        st.open_study(spoilt("mu", "c"))
    with pytest.raises(st.CaseError, match="a damaged store: branch missing"):
        st.open_study(spoilt("branch", "zarr.json"))
    # What the message says helps.
    folder = spoilt("unstable_modes", "c/0")
    shutil.rmtree(folder / "study.zarr" / "status" / "c")
    again = st.run_study(study, folder, workers=2)
    assert again.data["unstable_modes"].values.tolist() == whole.data["unstable_modes"].values.tolist()


def test_a_study_of_one_value_gives_its_answer(tmp_path: Path) -> None:
    text = template_text("two-beams")
    (tmp_path / "case.toml").write_text(st.loads(text, FEW).text, encoding="utf-8")
    (tmp_path / "study.toml").write_text('case = "case.toml"\nparameters.mu.values = [0.3]\n', encoding="utf-8")
    done = stridor("study", "study.toml", "--workers", "1", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "1 row is fewer than a model is worth" in done.stdout + done.stderr
    assert (tmp_path / "study.out" / "root-locus.png").exists()
    again = stridor("plot", "study.out", "--json", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert not any("over-mu" in name for name in json.loads(again.stdout)["files"])


def plotted(folder: Path, *options: str) -> tuple[int, str]:
    with nothing_drawn():
        done = stridor("plot", ".", *options, cwd=folder)
    return done.returncode, " ".join(done.stdout.split())


def test_that_there_is_nothing_to_draw_is_said_last(case: st.Case, tmp_path: Path) -> None:
    st.run_study(st.Study(case=case, compute="steady", parameters={"mu": {"values": (0.1,)}}), tmp_path, workers=1)
    code, said = plotted(tmp_path)
    assert code == 0
    assert said.endswith("1 sample of steady; no figure: no parameter has more than one value; results of the one sample "
                         "are in the table of report.html")  # fmt: skip


def test_what_figures_do_not_show_is_said_last(
    case: st.Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A store of a stridor that took such a study, whose row failed.
    monkeypatch.setattr("stridor.studies.run.negative_friction", lambda study: [])
    study = st.Study(case=case, compute="steady", parameters={"mu": {"values": (0.1, 0.2, -0.3)}})
    st.run_study(study, tmp_path, workers=1)
    code, said = plotted(tmp_path)
    assert code == 3
    assert said.endswith("2 samples of steady; of the other samples 1 failed; the figures do not show these")
    code, said = plotted(tmp_path, "--json")
    told = json.loads(said)
    assert (code, told["failed"], told["pending"], told["undrawn"]) == (3, 1, 0, "the figures do not show these")
    assert told["notes"][0].startswith("1 row failed, the first: mu: -0.3")
    assert [Path(name).name for name in told["files"]] == ["over-mu.png", "report.html"]


def test_the_document_holds_no_more_than_plain_values(case: st.Case, tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(case.text, encoding="utf-8")
    text = 'case = "case.toml"\ncompute = "onsets"\nsampling = { method = "saltelli", samples = 2 }\nset = { "modal.friction_range" = [0.0, 2.0] }\n'
    text += f'parameters."{MASS}".range = [1.0, 20.0]\nparameters."bodies.beam2.damping.mass".range = [1.0, 20.0]\n'
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    done = stridor("study", "study.toml", "--json", "--quiet", "--workers", "2", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert (told["rows"], told["computed"], told["failed"]) == (8, 8, 0)
    assert [item["parameter"] for item in told["sobol"]["indices"]] == [MASS, "bodies.beam2.damping.mass"]


def test_a_part_of_a_grid_has_the_model_of_the_whole(case: st.Case, tmp_path: Path) -> None:
    """In each part the first parameter has one value; a model of its own would be over the other alone."""
    parameters = {"mu": {"values": (0.05, 0.2)}, MASS: {"range": (1.0, 20.0), "points": 60}}
    study = st.Study(case=case, parameters=parameters)
    for number in (1, 2):
        told: list[str] = []
        st.run_study(study, tmp_path, workers=1, part=Part(number, 2), say=told.append)
        assert not any("has the one value" in line for line in told), told
        assert any(line.startswith("samples are answered by a reduced model") for line in told), told


def test_what_grows_at_the_low_end_has_its_critical_friction_there(tmp_path: Path) -> None:
    """At μ = 0.1 a mode grows already; the next onset in the range is another one's."""
    coarse = ["bodies.beam1.elements=10", "bodies.beam2.elements=20", "modal.max_frequency_hz=20e3"]
    late = st.loads(template_text("two-beams"), [*coarse, "modal.friction_range=[0.1, 0.3]"])
    sampling = {"method": "saltelli", "samples": 2}
    parameters = {MASS: {"range": (5.0, 50.0)}, "bodies.beam1.thickness": {"range": (0.00149, 0.00151)}}
    study = st.Study(case=late, compute="onsets", parameters=parameters, sampling=sampling, answers={"source": "full"})
    found = st.run_study(study, tmp_path, workers=2)
    grows = found.data["growing_at_start"].values > 0
    assert grows.all()
    assert found.unstable.all()
    assert np.all(found.data["onset_mu"].values[:, 0] > 0.1)
    assert found.data["critical_mu"].values.tolist() == [0.1] * len(grows)
    assert np.isnan(found.data["critical_frequency_hz"].values).all()
    with pytest.raises(st.AnalysisError):
        found.indices()  # of a number that does not vary


@pytest.mark.parametrize("compute", ["steady", "simulate", pytest.param("compare", marks=pytest.mark.slow)])
def test_other_analyses_have_rows_too(case: st.Case, tmp_path: Path, compute: str) -> None:
    short = case.with_({"phases": [{"name": "go", "duration": 2e-4}], "comparison.critical": False, "temporal.record_every": 1})
    study = st.Study(case=short, compute=compute, parameters={"mu": {"values": (0.1, 0.3)}})
    found = st.run_study(study, tmp_path, workers=2)
    assert found.done.all(), found.data["error"].values
    column = {"steady": "normal_force", "simulate": "steps", "compare": "modal_frequency_hz"}[compute]
    assert np.all(found.data[column].values > 0)
    with nothing_drawn():
        drawn = stridor("plot", ".", cwd=tmp_path)
    assert drawn.returncode == 0, drawn.stderr
    expected = {"over-mu.png"} | ({"agreement.png"} if compute == "compare" else set())
    assert {path.name for path in tmp_path.glob("*.png")} == expected
    assert (tmp_path / "report.html").read_text(encoding="utf-8").count("<img ") == len(expected)
    if compute == "compare":
        agree = found.data["agree"].values
        assert answer(found) == f"both approaches agree in {int(np.sum(agree == 1))} of 2 samples"
        assert all("against the result" not in note for note in found.notes)
        assert any("do not agree" in note for note in found.notes) == bool(np.any(agree == 0))
        assert any("not decided" in note for note in found.notes) == bool(np.any(agree < 0))


def test_a_run_of_a_study_vibrates_as_strongly_as_that_of_an_ensemble(case: st.Case, tmp_path: Path) -> None:
    short = case.with_({"phases": [{"name": "go", "duration": 2e-3}], "temporal.record_every": 5, "temporal.initial": "steady-sliding", "temporal.perturbation": 1e-4})
    found = st.run_study(st.Study(case=short, compute="simulate", parameters={"mu": {"values": (0.1, 0.3)}}), tmp_path, workers=2)
    beside = st.ensemble(short, mu=[0.1, 0.3], modes=False)
    assert np.all(beside.rms > 0)
    assert found.data["velocity_rms"].values == pytest.approx(beside.rms, rel=2e-2)  # windows differ by a record
    assert found.data["velocity_rms"].attrs["units"] == "m/s"


GROWS = {"temporal.initial": "steady-sliding", "temporal.perturbation": 1e-4, "phases.press.velocities.clamp": 1.0}


@pytest.mark.parametrize(("start", "told"), [({}, True), (GROWS, False)])
def test_a_run_of_a_study_carries_what_is_stronger_than_its_line(start: dict[str, Any], told: bool) -> None:
    changes = {"temporal.step": 2e-7, "temporal.record_every": 5, "phases.press.duration": 1e-3, "phases.slide.duration": 2e-3}
    coarser = st.loads(template_text("two-beams"), [*COARSER, "modal.max_frequency_hz=12e3"])
    short = coarser.with_(changes | start)
    summary = st.summarise(short, st.simulate(short, 0.1))
    assert (summary.stronger_below_hz is not None) is told
    row = full_row(short, "simulate", {"mu": 0.1}, Keep())
    said = "" if summary.stronger_below_hz is None else slower_is_stronger(summary.stronger_below_hz)
    assert row["note"] == said
    assert row["stronger_below_hz"] == (summary.stronger_below_hz if told else pytest.approx(np.nan, nan_ok=True))


def test_a_store_that_never_had_a_later_result_is_not_damaged(case: st.Case, tmp_path: Path) -> None:
    short = case.with_({"phases": [{"name": "go", "duration": 2e-4}], "temporal.record_every": 1})
    study = st.Study(case=short, compute="simulate", parameters={"mu": {"values": (0.1, 0.3)}})
    st.run_study(study, tmp_path / "now", workers=1)
    shutil.rmtree(tmp_path / "now" / "study.zarr" / "velocity_rms")
    with pytest.raises(st.CaseError, match="a damaged store: velocity_rms missing"):
        st.open_study(tmp_path / "now")
    head = tmp_path / "now" / "study.zarr" / "zarr.json"
    written = json.loads(head.read_text(encoding="utf-8"))
    del written["attributes"]["columns"]  # as one that was written before
    head.write_text(json.dumps(written), encoding="utf-8")
    older = st.open_study(tmp_path / "now")
    assert "velocity_rms" not in older.data
    assert set(st.study_figures(older)) == {"over-mu"}
    assert "2 samples of simulate" in answer(older)
    assert stridor("plot", "now", cwd=tmp_path).returncode == 0


def as_before(folder: Path, *lacks: str) -> None:
    """Make a store one that an earlier version began, which wrote no such results, and a list of those that it wrote
    unless it lacks all that came before there was one."""
    head = folder / "study.zarr" / "zarr.json"
    for name in lacks:
        shutil.rmtree(folder / "study.zarr" / name)
    written = json.loads(head.read_text(encoding="utf-8"))
    names = json.loads(written["attributes"].pop("columns"))
    if not set(LATER) <= set(lacks):
        written["attributes"]["columns"] = json.dumps([name for name in names if name not in lacks])
    made = json.loads(written["attributes"]["provenance"]) | {"programs": ["0.0.9 abc"]}
    written["attributes"]["provenance"] = json.dumps(made)
    head.write_text(json.dumps(written), encoding="utf-8")


def test_a_store_without_a_later_result_is_gone_on_with(case: st.Case, tmp_path: Path) -> None:
    short = case.with_({"phases": [{"name": "go", "duration": 2e-4}], "temporal.record_every": 1})
    study = st.Study(case=short, compute="simulate", parameters={"mu": {"values": (0.1, 0.3)}})
    st.run_study(study, tmp_path, workers=1)
    as_before(tmp_path, "velocity_rms", "stronger_below_hz")
    store = OpenStore.opened(tmp_path / "study.zarr", variables("simulate"))
    store._put(next(v for v in store.variables if v.name == "status"), np.array([1]), {1: {"status": PENDING}})
    with pytest.raises(st.CaseError, match=r"was begun by another stridor \(0.0.9 abc; .*--go-on"):
        st.run_study(study, tmp_path, workers=1)
    told: list[str] = []
    found = st.run_study(study, tmp_path, workers=1, go_on=True, say=told.append)
    assert np.isfinite(found.data["velocity_rms"].values).tolist() == [False, True]
    line = "stronger_below_hz, velocity_rms: not known of 1 row of an earlier stridor (NaN)"
    assert f"warning: {line}" in told
    assert line in found.notes
    told.clear()
    again = st.run_study(study, tmp_path, workers=1, say=told.append)
    assert not [words for words in told if "velocity_rms" in words]
    assert line in again.notes


def test_a_store_that_does_not_tell_what_is_stronger_opens_and_is_drawn(case: st.Case, tmp_path: Path) -> None:
    short = case.with_({"phases": [{"name": "go", "duration": 2e-4}], "temporal.record_every": 1})
    st.run_study(st.Study(case=short, compute="simulate", parameters={"mu": {"values": (0.1, 0.3)}}), tmp_path, workers=1)
    as_before(tmp_path, "stronger_below_hz")
    older = st.open_study(tmp_path)
    assert "stronger_below_hz" not in older.data
    assert "stronger_below_hz" not in dict(older.data.attrs)["columns"]
    assert set(st.study_figures(older)) == {"over-mu"}
    assert OpenStore.opened(tmp_path / "study.zarr", variables("simulate")).complete() == ["stronger_below_hz"]


def test_a_store_that_cannot_be_completed_is_refused_with_the_reason(case: st.Case, tmp_path: Path) -> None:
    study = st.Study(case=case, compute="modes", parameters={"mu": {"values": (0.1, 0.3)}})
    st.run_study(study, tmp_path, workers=1)
    as_before(tmp_path, "branch")
    with pytest.raises(st.CaseError, match=r"an earlier stridor, which wrote no branch: .*--out"):
        st.run_study(study, tmp_path, workers=1, go_on=True)
