"""What a study says of its parameters, its numbers of modes and its probabilities holds for what is shown."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import stridor as st
from matrix_cases import matrix_case
from mode_coupling import mode_coupling
from program import stridor
from stridor.app.conclusions import of_onsets
from stridor.case import template_text
from stridor.studies.effect import without_effect
from stridor.studies.reduced_rows import FrictionModels
from stridor.studies.result import StudyResult
from stridor.studies.sampling import samples

FEW = ["bodies.beam1.elements=3", "bodies.beam2.elements=6", "modal.max_frequency_hz=3e3"]
OWN = "contacts.A.friction.coefficient"
SPEED = "supports.clamp.velocity.x"
DENSITY = "materials.steel.density"


@pytest.fixture(scope="module")
def case() -> st.Case:
    return st.loads(template_text("two-beams"), FEW)


def told(case: st.Case, compute: str, law: dict | None = None, **more: object) -> list[str]:
    parameters = {OWN: {"values": (0.1, 0.2)}, SPEED: {"values": (0.02, 0.03)}, DENSITY: {"values": (7e3, 8e3)}} | more
    if law is not None:
        case = case.with_({"contacts.A.friction": law})
    study = st.Study(case=case, compute=compute, parameters=parameters)
    return [line.split(" ")[0] for line in without_effect(study, study.base(), samples(study))]


def test_parameters_that_leave_the_matrices_of_the_modes_are_told(case: st.Case) -> None:
    assert told(case, "modes") == [SPEED]
    assert told(case, "modes", mu={"values": (0.05, 0.1)}) == [OWN, SPEED]
    assert told(case, "onsets") == [OWN, SPEED]
    assert told(case, "simulate") == []
    assert told(case, "modes", **{"bodies.beam1.damping.mass": {"values": (0.0, 9.0)}}) == [SPEED]
    undamped = case.with_({"modal.damped": False})
    assert "bodies.beam1.damping.mass" in told(undamped, "modes", **{"bodies.beam1.damping.mass": {"values": (0.0, 9.0)}})


def test_speeds_and_numbers_of_a_falling_law_have_an_effect(case: st.Case) -> None:
    law = {"law": "weakening", "coefficient": 0.1, "static_coefficient": 0.3, "decay_speed": 0.02}
    assert told(case, "modes", law) == []
    assert told(case, "modes", law, mu={"values": (0.0, 0.3)}) == []
    assert told(case, "onsets", law) == []


def two_masses(folder: Path, factor: str, names: str, more: str = "") -> st.Case:
    """Two masses with springs, and a stiffness of one to the other whose factor is given; names have the value 2."""
    eye, across = np.eye(2), np.array([[0.0, 1.0], [0.0, 0.0]])
    terms = [(eye, "mass", ""), (np.diag([4.0, 5.0]), "stiffness", ""), (across, "stiffness", factor), (across.T, "stiffness", "0.5")]
    return matrix_case(folder, terms, 2.0, (0.0, 3.0), more + "\n[parameters]\n" + "".join(f"{name} = {{ value = 2.0 }}\n" for name in names))


def idle_of(case: st.Case, compute: str, mu: tuple[float, ...] = (), seed: int = 0, **varied: tuple[float, ...]) -> list[str]:
    """Names of the case's own parameters of which a study says that they have no effect."""
    parameters = {f"parameters.{name}.value": {"values": values} for name, values in varied.items()}
    parameters |= {"mu": {"values": mu}} if mu else {}
    study = st.Study(case=case, compute=compute, parameters=parameters, sampling={"seed": seed})
    return [line.split(".")[1] for line in without_effect(study, case, samples(study))]


@pytest.mark.parametrize(
    ("compute", "mu"),
    [("onsets", ()), ("modes", (0.3, 0.8)), ("modes", (0.0, 0.8)), ("simulate", (0.0, 0.3)), ("compare", (0.0, 0.3))],
)
def test_what_only_friction_brings_into_the_matrices_has_an_effect(
    compute: str, mu: tuple[float, ...], tmp_path: Path
) -> None:
    """Of 0.5 − μf nothing of f is left at μ = 0, which matrices have that nothing gives another friction."""
    case = two_masses(tmp_path, "0.5 - mu*f", "fgh")
    assert idle_of(case, compute, mu, f=(1.0, 3.0)) == []
    assert idle_of(case, compute, mu, f=(1.0, 3.0), g=(1.0, 3.0), h=(1.0, 3.0)) == ["g", "h"]


def test_friction_of_the_case_itself_counts_where_nothing_else_gives_it(tmp_path: Path) -> None:
    case = two_masses(tmp_path, "0.5 - mu*f", "fg")
    assert idle_of(case, "modes", f=(1.0, 3.0), g=(1.0, 3.0)) == ["f", "g"]  # at μ = 0, as its rows are
    rubs = case.with_({"parameters.mu": {"value": 0.3}})
    assert idle_of(rubs, "modes", f=(1.0, 3.0), g=(1.0, 3.0)) == ["g"]
    still = case.with_({"parameters.mu": {"value": 0.0}})
    named = {"parameters.mu.value": {"values": (0.0, 0.8)}, "parameters.f.value": {"values": (1.0, 3.0)}}
    study = st.Study(case=still, parameters=named)
    assert without_effect(study, still, samples(study)) == []


def test_a_number_is_tried_between_its_ends_and_with_others_that_are_not_zero(tmp_path: Path) -> None:
    case = two_masses(tmp_path, "0.5 + (f-1)*(f-3)*g", "fg")
    assert idle_of(case, "modes", f=(1.0, 2.0, 3.0)) == []
    assert idle_of(case, "modes", f=(1.0, 3.0)) == ["f"]  # and no row has another
    still = case.with_({"parameters.g.value": 0.0})
    for seed in range(4):  # of the sample looked at, in which g is 0 or 1
        assert idle_of(still, "modes", seed=seed, f=(1.0, 2.0, 4.0), g=(0.0, 1.0)) == []


def test_modes_keep_their_numbers_in_rows_confirmed_in_full(tmp_path: Path) -> None:
    """Beams of other thickness change the order of frequencies at μ = 0; one study has one numbering all the same."""
    more = ["bodies.beam1.elements=6", "bodies.beam2.elements=12", "modal.max_frequency_hz=18e3"]
    case = st.loads(template_text("two-beams"), more)
    thickness = {"range": (0.00135, 0.00165), "points": 9}
    parameters = {"bodies.beam1.thickness": thickness, "mu": {"range": (0.02, 0.06), "points": 3}}
    numbers = []
    for share in (0.0, 1.0):
        answers = {"source": "reduced", "confirm": share}
        study = st.Study(case=case, parameters=parameters, answers=answers)
        found = st.run_study(study, tmp_path / str(share), workers=1)
        assert found.done.all()
        numbers.append(found.data["branch"].values)
    plain, confirmed = numbers
    both = (plain > 0) & (confirmed > 0)
    assert both.sum() > 0.9 * np.count_nonzero(plain) > 0
    np.testing.assert_array_equal(plain[both], confirmed[both])
    # In some rows a mode has overtaken another since the middle, where `modes` of that sample would count anew.
    overtaken = [np.any(np.diff(row[row > 0]) < 0) for row in confirmed]
    assert 0 < np.count_nonzero(overtaken) < len(overtaken)


def test_full_rows_outside_of_all_models_have_no_numbers() -> None:
    row = FrictionModels.outside({"branch": np.array([1, 2]), "status": 1})
    assert row["branch"].tolist() == [0, 0]
    assert FrictionModels.outside({"status": 2}) == {"status": 2}


def test_samples_in_which_one_number_is_exchanged_have_no_part_in_probabilities(case: st.Case, tmp_path: Path) -> None:
    parameters = {"mu": {"range": (0.0, 0.6)}, "bodies.beam1.damping.mass": {"range": (1.0, 20.0)}}
    sampling = {"method": "saltelli", "samples": 4}
    study = st.Study(case=case, parameters=parameters, sampling=sampling, answers={"source": "full"})
    found = st.run_study(study, tmp_path, workers=1)
    known = found.probability()
    rows = [k for k in range(16) if k % 4 in (0, 3)]
    assert known.of == 8
    assert known.count == int(found.unstable[rows].sum())
    # Each number of a drawn sample is its own; an exchanged one has one of another.
    mu = found.data["mu"].values
    assert len(np.unique(mu[rows])) == 8
    assert len(np.unique(mu)) == 8


def test_several_frictions_of_the_comparison_are_refused_in_place_of_all_but_one(case: st.Case) -> None:
    several = case.with_({"comparison.mu": [0.1, 0.2], "comparison.critical": False})
    with pytest.raises(st.CaseError, match=r"comparison\.mu.*one friction coefficient"):
        st.Study(case=several, compute="compare", parameters={DENSITY: {"values": (7e3, 8e3)}})
    st.Study(case=several, compute="compare", parameters={"mu": {"values": (0.1, 0.2)}})


def test_an_address_without_a_port_is_refused_before_anything_else(case: st.Case, tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(case.text, encoding="utf-8")
    (tmp_path / "study.toml").write_text('case = "case.toml"\nparameters.mu.values = [0.1, 0.2]\n', encoding="utf-8")
    for address in ("foo", "tcp://foo"):
        done = stridor("study", "study.toml", "--scheduler", address, cwd=tmp_path)
        assert done.returncode == 2, done.stderr
        assert done.stderr.strip() == f"stridor: --scheduler: '{address}' – an address with a port, such as tcp://host:8786"
    assert not (tmp_path / "study.out").exists()


def test_of_few_rows_one_at_least_is_confirmed(case: st.Case, tmp_path: Path) -> None:
    parameters = {"mu": {"range": (0.2, 0.4), "points": 5}, "bodies.beam1.damping.mass": {"range": (5.0, 20.0), "points": 2}}
    for share, expected in ((1e-6, 1), (0.0, 0)):
        study = st.Study(case=case, parameters=parameters, answers={"source": "reduced", "confirm": share})
        found = st.run_study(study, tmp_path / str(share), workers=1)
        assert found.done.all()
        assert int(np.count_nonzero(found.data["confirmed"].values > 0)) >= expected
        if not expected:
            assert not np.any(found.data["confirmed"].values[found.data["source"].values == "reduced"] > 0)


def test_estimates_are_told_of_rows_that_stand_on_a_model_alone() -> None:
    def said(source: list[str], error: list[float], confirmed: list[int], off: list[float]) -> str:
        data = xr.Dataset(
            {"status": ("row", np.ones(len(source))), "source": ("row", source), "estimated_error": ("row", error),
             "confirmed": ("row", confirmed), "difference": ("row", off)}, attrs={"study": '{"compute": "modes"}'},
        )  # fmt: skip
        return StudyResult(Path("none"), data)._confirmed()[0]

    limit = "by a reduced model alone, estimated error 1.0e-09 at most; 1 solved in full as well, off by 3.0e-10 at most"
    nan = float("nan")
    told = said(["reduced", "full"], [1e-9, 1e-7], [0, 1], [nan, 3e-10])
    assert told == f"1 rows {limit}, none by more than 10 times the estimate or 1e-09"
    # Of an undamped system's double roots an estimate may say nothing.
    assert said(["full", "full"], [1.6e18, 1e-9], [1, 1], [2e-9, 1e-10]) == (
        "no rows by a reduced model alone; 2 solved in full as well, off by 2.0e-09 at most"
    )
    assert said(["reduced"], [1.6e18], [0], [nan]) == "1 rows by a reduced model alone; 0 solved in full as well"


def test_onsets_of_a_model_that_holds_its_contact_nodes_are_headed_so(capsys: pytest.CaptureFixture[str]) -> None:
    from stridor.app.along import show_onsets_along
    from stridor.app.conclusions import of_onsets_along
    from stridor.modal.full import onsets_along
    from stridor.study.reduced import reduced_model

    few = st.loads(template_text("two-beams"), [*FEW, "modal.max_frequency_hz=9e3"])
    found = onsets_along(reduced_model(few, {"mu": (0.0, 0.9)}), "mu", {})
    assert len(found) > 0
    for whole in (True, False):
        found.complete = whole
        assert of_onsets_along(found).sentence.endswith(", but see above") != whole
    for held in (True, False):
        show_onsets_along(found, confirmed=True, held=held)
        title = " ".join(capsys.readouterr().out.split())
        assert ("confirmed in the full model, with the nodes held that touch at the case's own friction" in title) == held


@pytest.mark.parametrize(("estimate", "off", "confirmed"), [(1e-9, 1e-12, 1), (1e-9, 1e-6, 2), (1.6e18, 1e-12, 0)])
def test_where_an_estimate_allows_for_anything_there_is_nothing_to_confirm(
    estimate: float, off: float, confirmed: int
) -> None:
    lam = 100.0j * np.array([1.0, 2.0])

    def row(values: np.ndarray) -> dict[str, object]:
        return {
            "status": 1, "growth_rate": values.real, "frequency_hz": values.imag / (2 * np.pi),
            "branch": np.array([1, 2]), "modes_of_band": 2, "estimated_error": estimate,
        }  # fmt: skip

    told = FrictionModels((), "modes", {}).confirmed(row(lam * (1 + off)), row(lam))
    assert told["confirmed"] == confirmed
    assert told["difference"] == pytest.approx(off, rel=1e-3)


def test_the_last_line_of_onsets_says_whether_their_list_is_complete() -> None:
    found = st.onsets(mode_coupling(0.02))
    assert len(found) == 1
    assert found.complete
    last = of_onsets(found).sentence
    assert "growth begins at" in last
    assert not last.endswith("see above")
    assert of_onsets(replace(found, completeness="Not complete: one more mode grows")).sentence == f"{last}, but see above"
