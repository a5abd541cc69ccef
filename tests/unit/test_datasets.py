"""Result files: named dimensions, units, the case inside, whole or not at all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stridor as st
from stridor.io.atomic import replacing, write_text


@pytest.fixture(scope="module")
def case() -> st.Case:
    from stridor.case import template_text

    return st.loads(template_text("two-beams")).with_(
        {
            "bodies.beam1.elements": 6,
            "bodies.beam2.elements": 18,
            "temporal.step": 4e-7,
            "temporal.record_every": 5,
            "phases.press.duration": 1e-3,
            "phases.slide.duration": 1e-3,
        }
    )


def test_modes_round_trip(case: st.Case, tmp_path: Path) -> None:
    modes = st.modes(case, [0.0, 0.1], count=6, vectors=True)
    data = st.open_dataset(st.save(modes, tmp_path / "modes.nc"))
    assert data["frequency"].dims == ("mu", "branch")
    assert data["frequency"].attrs["units"] == "Hz"
    assert data["growth_rate"].attrs["units"] == "1/s"
    lam = data["eigenvalue"].sel(part="re").values + 1j * data["eigenvalue"].sel(part="im").values
    assert np.array_equal(lam, modes.eigenvalues)
    assert data["right_vector"].dims == ("mu", "branch", "freedom", "part")
    again = st.loads(data.attrs["case"])
    assert again == case


def test_onsets_file_holds_what_is_missing_as_nan(case: st.Case, tmp_path: Path) -> None:
    found = st.onsets(case, (0.0, 1.0), max_frequency_hz=20e3, damped=False)
    data = st.open_dataset(st.save(found, tmp_path / "onsets.nc"))
    assert len(data["mu"]) == len(found.onsets) > 0
    assert np.isnan(data["growth_slope"].values).all()
    assert list(data["kind"].values) == [o.kind for o in found.onsets]


def test_no_onsets_is_a_file_too(case: st.Case, tmp_path: Path) -> None:
    found = st.onsets(case, (0.0, 1e-3), max_frequency_hz=5e3)
    assert found.onsets == ()
    assert len(st.open_dataset(st.save(found, tmp_path / "onsets.nc"))["mu"]) == 0


def test_trajectory_round_trip_is_exact(case: st.Case, tmp_path: Path) -> None:
    run = st.simulate(case)
    back = st.load_trajectory(st.save(run, tmp_path / "run.nc"))
    for name in ("time", "normal_force", "status", "velocity", "kinetic"):
        assert np.array_equal(getattr(back, name), getattr(run, name)), name
    assert back.phases == run.phases
    assert back.step == run.step
    assert all(np.array_equal(back.state[k], run.state[k]) for k in run.state)
    data = st.to_dataset(run)
    assert data["normal_force"].dims == ("time", "contact")
    assert data["velocity"].attrs["units"] == "m/s"
    assert list(data["contact"].values) == ["A"]


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "result.txt"
    write_text(path, "old")

    def fail() -> None:
        with replacing(path) as temporary:
            temporary.write_text("half of the new")
            raise RuntimeError("on purpose")

    with pytest.raises(RuntimeError, match="on purpose"):
        fail()
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["result.txt"]


def test_a_folder_that_cannot_be_made_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(st.AnalysisError, match=r"cannot write .*file/result\.txt"):
        write_text(tmp_path / "file" / "result.txt", "x")


@pytest.mark.parametrize("content", [b"", b"not HDF5 at all"])
def test_other_files_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "other.nc"
    path.write_bytes(content)
    with pytest.raises(st.CaseError, match="a results file written by stridor"):
        st.open_dataset(path)


def test_a_modes_file_is_no_trajectory(case: st.Case, tmp_path: Path) -> None:
    path = st.save(st.modes(case, 0.1, count=3), tmp_path / "modes.nc")
    with pytest.raises(st.CaseError, match="a file of `stridor simulate`"):
        st.load_trajectory(path)
