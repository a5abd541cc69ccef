"""Result files: named dimensions, units, the case inside, whole or not at all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stridor as st
from stridor.io.atomic import replacing, write_text
from stridor.io.datasets import load_trajectory
from stridor.io.result_files import open_results
from stridor.temporal.trajectory import HISTORIES


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
    data = st.open(st.save(modes, tmp_path / "modes.nc"))
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
    data = st.open(st.save(found, tmp_path / "onsets.nc"))
    assert len(data["mu"]) == len(found.onsets) > 0
    assert np.isnan(data["growth_slope"].values).all()
    assert list(data["kind"].values) == [o.kind for o in found.onsets]


@pytest.mark.parametrize("mu", [0.01, 0.2])  # without and with an unstable mode
def test_sensitivities_round_trip(case: st.Case, tmp_path: Path, mu: float) -> None:
    found = st.sensitivities(case, ["mu", "bodies.beam1.damping.mass"], mu=mu, band_hz=(100.0, 20e3))
    assert (len(found.branch) > 0) == (mu == 0.2)
    data = st.open(st.save(found, tmp_path / "sensitivities.nc"))
    assert list(data["parameter"].values) == list(found.parameters)
    assert np.array_equal(data["branch"].values, found.branch)
    derivative = data["growth_derivative"].values + 1j * data["angular_frequency_derivative"].values
    assert np.array_equal(derivative, found.derivative)
    assert np.array_equal(data["growth_per_percent"].values, found.growth_per_percent, equal_nan=True)
    assert (data.attrs["mu"], list(data.attrs["band_hz"])) == (mu, [100.0, 20e3])
    assert st.loads(data.attrs["case"]) == case


def test_onsets_along_a_number_come_back_as_they_were(case: st.Case, tmp_path: Path) -> None:
    found = st.onsets(case, (0.0, 0.2), along="contacts.A.friction.coefficient", max_frequency_hz=9e3)
    back = st.open(st.save(found, tmp_path / "along.nc"))
    assert len(found) > 0
    assert (list(back), back.to_json(), back.provenance) == (list(found), found.to_json(), found.provenance)
    assert st.loads(back.provenance["case"]) == case
    none = st.onsets(case, (0.0, 1e-3), along="contacts.A.friction.coefficient", max_frequency_hz=9e3)
    assert (len(none), st.open(st.save(none, tmp_path / "none.nc")).to_json()) == (0, none.to_json())


@pytest.mark.parametrize("mu", [0.01, 0.3])  # without and with an unstable mode
def test_countermeasures_come_back_as_they_were(case: st.Case, tmp_path: Path, mu: float) -> None:
    found = st.rank_countermeasures(case, mu=mu, verify=2)
    assert (found.solved_again > 0) == (len(found.measures) > 0) == (mu == 0.3)
    back = st.open(st.save(found, tmp_path / "countermeasures.nc"))
    assert (back.to_json(), back.table()) == (found.to_json(), found.table())
    assert np.array_equal(back.eigenvalues, found.eigenvalues)
    assert {type(m.kind) for m in back.measures} <= {str}
    for ours, theirs in zip(back.measures, found.measures, strict=True):
        assert np.array_equal(ours.predicted, theirs.predicted)
    assert st.loads(back.provenance["case"]) == case


def test_a_damping_map_comes_back_as_it_was(case: st.Case, tmp_path: Path) -> None:
    names = ("bodies.beam1.damping.mass", "bodies.beam2.damping.mass")
    found = st.damping_map(case, *names, x_range=(1.0, 50.0), y_range=(1.0, 50.0), grid=(2, 3), max_frequency_hz=9e3)
    back = st.open(st.save(found, tmp_path / "map.nc"))
    assert (back.to_json(), back.provenance) == (found.to_json(), found.provenance)
    assert np.array_equal(back.slope_x, found.slope_x, equal_nan=True)


def test_no_onsets_is_a_file_too(case: st.Case, tmp_path: Path) -> None:
    found = st.onsets(case, (0.0, 1e-3), max_frequency_hz=5e3)
    assert found.onsets == ()
    assert len(st.open(st.save(found, tmp_path / "onsets.nc"))["mu"]) == 0


def test_trajectory_round_trip_is_exact(case: st.Case, tmp_path: Path) -> None:
    run = st.simulate(case)
    back = st.open(st.save(run, tmp_path / "run.nc"))
    for name in ("time", "normal_force", "status", "velocity", "kinetic"):
        assert np.array_equal(getattr(back, name), getattr(run, name)), name
    for name in HISTORIES:
        assert getattr(back, name).dtype == getattr(run, name).dtype, name
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
        st.open(path)


@pytest.mark.bad_input
def test_names_by_which_a_file_would_be_taken_for_another_are_refused(
    case: st.Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    found = st.onsets(case, (0.0, 1e-3), max_frequency_hz=5e3)
    with pytest.raises(st.CaseError, match=r"^path: 'o.csv' – a name that ends in .nc \(netCDF\); as a table .*to_data"):
        st.save(found, "o.csv")
    model = st.reduced_model(case, {"mu": (0.0, 0.2)}, max_frequency_hz=2e3)
    with pytest.raises(st.CaseError, match=r"^path: 'model.nc' – a name that ends in .npz$"):
        st.save(model, "model.nc")
    assert not list(tmp_path.iterdir())


@pytest.mark.bad_input
@pytest.mark.parametrize("name", ["study.out", "study.out/study.zarr"])
def test_a_study_is_opened_by_another_call(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.out" / "study.zarr").mkdir(parents=True)
    (tmp_path / "study.out" / "study.zarr" / "zarr.json").write_text("{}", encoding="utf-8")
    with pytest.raises(st.CaseError, match=r"^file: '.*' – the store of a study, or its folder; st.open_study reads it$"):
        st.open(name)


def test_a_modes_file_is_no_trajectory(case: st.Case, tmp_path: Path) -> None:
    path = st.save(st.modes(case, 0.1, count=3), tmp_path / "modes.nc")
    with pytest.raises(st.CaseError, match="a file of `stridor simulate`"):
        load_trajectory(path)


def test_one_way_in_tells_by_the_content(case: st.Case, tmp_path: Path) -> None:
    run = st.simulate(case)
    model = st.reduced_model(case, {"mu": (0.0, 0.2)}, max_frequency_hz=2e3)
    saved = [st.save(thing, tmp_path / name) for thing, name in ((run, "plain"), (run, "run.nc"), (model, "model.npz"))]
    names = ("plain", "run.npz", "model.nc")  # no name says what is in a file
    back = [st.open(path.rename(tmp_path / name)) for path, name in zip(saved, names, strict=True)]
    assert [type(thing) for thing in back] == [type(run), type(run), type(model)]
    assert np.array_equal(back[1].normal_force, run.normal_force)
    assert np.array_equal(back[2].vectors, model.vectors)
    modes = st.modes(case, 0.1, count=3)
    assert st.open(st.save(modes, tmp_path / "modes")).identical(open_results(tmp_path / "modes"))


@pytest.mark.bad_input
def test_what_cannot_be_saved_or_opened(case: st.Case, tmp_path: Path) -> None:
    modes = st.modes(case, 0.1, count=3)
    for given, told in (
        ({"keep": "all"}, "keep: 'all' – goes with a reduced model; results are kept whole, and hold their case"),
        ({"case": case}, "case: goes with a reduced model; results are kept whole, and hold their case"),
    ):
        with pytest.raises(st.CaseError) as error:
            st.save(modes, tmp_path / "modes.nc", **given)
        assert str(error.value) == told
    for thing in (case, None, st.to_dataset(modes)):
        with pytest.raises(st.CaseError, match=r"^result: 'a \w+' – complex modes, onsets, sensitivities, a trajectory"):
            st.save(thing, tmp_path / "nothing.nc")
    assert not list(tmp_path.iterdir())
    (tmp_path / "empty.npz").touch()
    with pytest.raises(st.CaseError, match=r"no reduced model; give a file of st\.save"):
        st.open(tmp_path / "empty.npz")


@pytest.mark.parametrize(
    ("stepper", "energies"), [("explicit", "half a step before the record"), ("implicit", "at the record")]
)
def test_runs_say_what_a_record_is(stepper: str, energies: str, tmp_path: Path) -> None:
    """A mass thrown against a rigid stop: with implicit steps the record at which it hits has a force."""
    stop = {
        "normal": [1.0, 0.0], "tangent": [0.0, 1.0], "stiffness": 1e4 if stepper == "explicit" else "rigid", "gap": 0.1,
        "friction": {"law": "coulomb", "coefficient": 0.3},
    }  # fmt: skip
    system = st.System.from_matrices(
        np.eye(2), None, np.eye(2), contacts={"stop": stop}, loads={"down": np.array([-1.0, 0.0])}
    )
    steps = {"stepper": stepper, "step": 0.01, "record_every": 1, "initial": "rest"}
    work = st.Workspace(
        system, temporal=steps, phases=[{"name": "falls", "duration": 2.0}], modal={"max_frequency_hz": 1.0}
    )
    data = open_results(st.save(st.simulate(work), tmp_path / "simulate.nc"))
    assert data["kinetic"].attrs["long_name"] == data["elastic"].attrs["long_name"] == energies
    if stepper == "explicit":
        assert "long_name" not in data["normal_force"].attrs
        return
    for name in ("normal_force", "tangential_force"):
        assert data[name].attrs["long_name"].startswith("mean over the steps before and after the record")
    assert data["gap"].attrs["long_name"] == data["slip_speed"].attrs["long_name"] == "at the record"
    assert data["status"].attrs["long_name"] == "in the step after the record"
    assert data["gap"].attrs["units"] == "m"
    # That is so: the stop is hit within the step after the record, half of whose force is told at an open gap.
    force, gap = data["normal_force"].values[:, 0], data["gap"].values[:, 0]
    hit = int(np.flatnonzero(force > 0)[0])
    assert gap[hit] > 1e-6 * gap[0]
    assert data["status"].values[hit, 0] > 0
