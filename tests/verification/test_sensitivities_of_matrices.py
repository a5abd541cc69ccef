"""Sensitivities and counter-measures of imported matrices, symmetric or not, against differences and meshed models."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

import stridor as st
from matrix_cases import TURN, matrix_case
from program import stridor
from stridor.case import template_text
from stridor.study.sensitivities import Sensitivities

pytestmark = pytest.mark.verification

FEW = ["bodies.beam1.elements=6", "bodies.beam2.elements=18"]
ONE = np.eye(2)
OBLIQUE = np.array([[2.0, 1.0], [1.0, 2.0]])
BELT = np.array([[0.0, -4 / 3], [0.0, 0.0]])
DAMPED = np.array([[0.02, 0.005], [0.005, 0.03]])
SPIN = "[parameters]\nOmega = { value = 0.4, range = [0.1, 0.4] }\nmu = { value = 0.8, range = [0.0, 1.0] }\n"


def friction(folder: Path) -> st.Case:
    """Two masses on a belt, K not symmetric, friction in a factor."""
    terms = [(ONE, "mass", ""), (DAMPED, "damping", ""), (OBLIQUE, "stiffness", ""), (BELT, "stiffness", "mu")]
    return matrix_case(folder, terms, 1.0)


def turning(folder: Path) -> st.Case:
    """The same in a frame that turns, μ and the speed parameters with factors that are no straight lines."""
    terms = [
        (ONE, "mass", ""), (DAMPED, "damping", "1 + Omega"), (TURN, "damping", "2*Omega"), (OBLIQUE, "stiffness", ""),
        (-ONE, "stiffness", "Omega**2"), (BELT, "stiffness", "mu + 0.1*mu**2"),
    ]  # fmt: skip
    return matrix_case(folder, terms, 1.0, more=SPIN)


def symmetric(folder: Path) -> st.Case:
    """Negative damping drives a motion; everything is symmetric, and damping is not proportional."""
    driven = np.array([[0.05, 0.02], [0.02, -0.03]])
    return matrix_case(folder, [(ONE, "mass", ""), (driven, "damping", ""), (OBLIQUE, "stiffness", "")], 1.0)


def differences(case: st.Case, path: str, found: Sensitivities, mu: float, damped: bool) -> np.ndarray:
    """dλ/dp of the modes of ``found`` by central differences of fourth order."""
    value = mu if path == "mu" else float(found.values[found.parameters.index(path)])
    h = 1e-3 * abs(value)

    def at(step: float) -> np.ndarray:
        changed, friction = case, mu
        if path == "mu":
            friction = mu + step
        else:
            free = {".".join([*path.split(".")[:2], "range"]): None} if path.startswith("parameters") else {}
            changed = case.with_({**free, path: value + step})
        solved = st.modes(changed, friction, damped=damped).eigenvalues[0]
        return np.array([solved[np.argmin(np.abs(solved - lam))] for lam in found.eigenvalues])

    return (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)


@pytest.mark.parametrize("damped", [True, pytest.param(False, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("make", "paths"),
    [
        (friction, ["mu", *(f"bodies.matrices.terms.{k}.factor" for k in (0, 1, 2))]),
        (turning, ["mu", "parameters.Omega.value", "bodies.matrices.terms.0.factor", "bodies.matrices.terms.3.factor"]),
        (symmetric, [f"bodies.matrices.terms.{k}.factor" for k in (0, 1, 2)]),
    ],
)
def test_derivatives_are_what_differences_say(tmp_path: Path, make: object, paths: list[str], damped: bool) -> None:
    case = make(tmp_path)  # type: ignore[operator]
    mu = 0.0 if make is symmetric else 0.8
    found = st.sensitivities(case, paths, mu=mu, modes="all", damped=damped)
    assert len(found.branch) == 2
    assert found.residual.max() < 1e-13
    for k, path in enumerate(paths):
        expected = differences(case, path, found, mu, damped)
        assert found.derivative[k] == pytest.approx(expected, rel=1e-7, abs=1e-9), path


def test_the_parameter_mu_is_friction(tmp_path: Path) -> None:
    case = turning(tmp_path)
    found = st.sensitivities(case, ["mu", "parameters.mu.value"], modes="all")
    assert found.mu == 0.8
    assert np.all(found.derivative[0] == found.derivative[1])


def test_a_parameter_may_be_called_by_its_name(tmp_path: Path) -> None:
    case = turning(tmp_path)
    short, long = (st.sensitivities(case, [name], modes="all") for name in ("Omega", "parameters.Omega.value"))
    assert short.parameters == long.parameters
    assert np.all(short.derivative == long.derivative)
    (measure,) = st.rank_countermeasures(case, mu=1.0, percent=0.1, verify=0, numbers="Omega").measures
    assert measure.name == "parameters.Omega.value"


def test_the_bench_as_matrices_answers_as_the_bench(tmp_path: Path) -> None:
    case = st.loads(template_text("two-beams"), FEW)
    written = st.export(case, tmp_path, format="npz")
    assert written.case is not None
    imported = st.load(written.case)
    own, found = (st.sensitivities(c, ["mu"], mu=0.2) for c in (case, imported))
    assert list(found.branch) == list(own.branch)
    assert len(own.branch)
    assert found.derivative == pytest.approx(own.derivative, rel=1e-7)
    # 1 + x of the contact's term is that of its stiffness.
    stiffer = st.sensitivities(imported.with_({"bodies.matrices.terms.4.factor": "mu"}), ["mu"], mu=0.2)
    assert stiffer.derivative == pytest.approx(found.derivative, rel=1e-12)


def test_countermeasures_of_matrices_are_solved_again(tmp_path: Path) -> None:
    for make, mu in ((friction, 1.0), (turning, 1.0), (symmetric, None)):
        case = make(tmp_path)
        factors = [f"bodies.matrices.terms.{k}.factor" for k, term in enumerate(case.imported["matrices"].terms) if term.factor == 1.0]
        numbers = [*factors, *(["parameters.Omega.value"] if make is turning else [])]
        found = st.rank_countermeasures(case, mu=mu, percent=0.1, verify=3, numbers=numbers)
        assert found.measures, found.warnings
        for measure in found.measures[:3]:
            assert measure.verified is not None
            assert measure.verified.removed == pytest.approx(measure.removed, rel=0.05)
        names = {measure.name for measure in found.measures}
        assert all(name.endswith(".factor") or name == "parameters.Omega.value" for name in names)


def test_the_program_on_imported_matrices(tmp_path: Path) -> None:
    friction(tmp_path)
    for verb in ("sensitivities", "countermeasures"):
        done = stridor(verb, "case.toml", "--mu", "0.8", "--json", "--quiet", cwd=tmp_path)
        assert (done.returncode, done.stderr) == (0, "")
        assert json.loads(done.stdout)["mu"] == 0.8
    symmetric(tmp_path)
    done = stridor("sensitivities", "case.toml", "--quiet", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr == (
        "stridor: --mu: nothing depends on it: there are no contacts and no factor of a matrix has mu in it; give another "
        "number of the case, such as bodies.matrices.terms.0.factor (--parameter)\n"
    )
    done = stridor("modes", "case.toml", "--quiet", cwd=tmp_path)
    assert done.returncode == 0


def test_whole_matrices_are_no_change_that_can_be_built(tmp_path: Path) -> None:
    """Dampings, springs and parameters are tried; the mass and stiffness of everything where they are asked for."""
    case = friction(tmp_path)
    spring = {"file": str(tmp_path / "spring.npz"), "role": "stiffness", "factor": 0.1}
    sp.save_npz(tmp_path / "spring.npz", sp.csr_array(np.diag([1.0, 0.0])))
    terms = [*[term.model_dump() for term in case.imported["matrices"].terms], spring]
    sprung = case.with_({"bodies.matrices.terms": terms})
    path = "bodies.matrices.terms.{}.factor".format
    found = st.rank_countermeasures(sprung, mu=1.0, verify=0)
    assert {measure.name for measure in found.measures} <= {path(1), path(4)}
    assert found.measures
    assert found.warnings[-1] == (
        f"not tried, for nobody can build it: all of a mass or stiffness matrix ({path(0)}, {path(2)}); --parameter PATH or "
        "numbers= asks for one"
    )
    done = stridor("countermeasures", "case.toml", "--mu", "1", "--parameter", path(2), "--json", "--quiet", cwd=tmp_path)
    document = json.loads(done.stdout)
    assert [measure["name"] for measure in document["measures"]] == [path(2)]
    assert not document["warnings"]
    # A report's sensitivities are of the same numbers.
    notes = st.report(sprung, tmp_path / "out", mu=1.0, skip=["modes", "onsets", "countermeasures"]).everything
    assert notes.sensitivities is not None
    assert notes.sensitivities.parameters == ("mu", path(1), path(4))


def test_where_nothing_can_be_changed(tmp_path: Path) -> None:
    case = friction(tmp_path)
    fixed = {f"bodies.matrices.terms.{k}.factor": "1" for k in range(3)}
    found = st.rank_countermeasures(case.with_(fixed), mu=1.0)
    assert not found.measures
    expected = "there is nothing to change: factors of imported matrices that are numbers, or parameters in them, would be"
    assert found.warnings[-1] == expected
    found = st.rank_countermeasures(case.with_({"bodies.matrices.terms.1.factor": "1"}), mu=1.0)
    assert not found.measures
    assert found.warnings[-2] == (
        "there is nothing to change but whole matrices: no damping, spring, added mass or parameter of the case"
    )
    assert found.warnings[-1].startswith("not tried, for nobody can build it: ")


def meeting(folder: Path) -> st.Case:
    """Two undamped modes that meet at q = √(5² / 4 + 4²) / 4; r is in a factor and changes nothing."""
    turning = np.array([[0.0, -4.0], [4.0, 0.0]])
    stiffness = np.array([[20.0, 4.0], [4.0, 15.0]])
    terms = [(np.eye(2), "mass", ""), (stiffness, "stiffness", ""), (turning, "stiffness", "q + 0 * r")]
    return matrix_case(folder, terms, 3.0, more="[parameters]\nq = { value = 0.5 }\nr = { value = 2.0 }")


def test_what_is_rounding_is_told_as_no_change(tmp_path: Path) -> None:
    """Of a mode that stays on the axis a number changes the frequency alone."""
    case = meeting(tmp_path)
    words = ("sensitivities", "case.toml", "--parameter", "parameters.q.value", "--branch", "1")
    done = stridor(*words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    said = " ".join(done.stdout.split())
    assert "a per cent more of parameters.q.value changes the growth of no mode by more than rounding" in said
    assert "most" not in said
    found = st.sensitivities(case, ["parameters.q.value"], modes="all")
    assert not found.beyond_rounding.any()
    assert np.all(np.abs(found.frequency_per_percent_hz) > 1e-5)
    grown = st.sensitivities(case.with_({"parameters.q.value": 2.0}), ["parameters.q.value"], modes="all")
    assert grown.beyond_rounding.all()
    said = " ".join(stridor(*words[:-2], "--set", "parameters.q.value=2.0", cwd=tmp_path).stdout.split())
    assert "a per cent more of parameters.q.value changes the growth of mode 2 most: +0.0" in said


def test_settings_are_no_numbers_of_the_model(tmp_path: Path) -> None:
    case = meeting(tmp_path).with_({"parameters.q.value": 2.0})
    told = "a setting of analyses: no matrix depends on it; give a number of the model"
    for path in ("modal.max_frequency_hz", "temporal.cutoff_hz", "comparison.tolerance"):
        with pytest.raises(st.CaseError) as error:
            st.sensitivities(case, [path])
        assert str(error.value).startswith(path)
    for analysis in (lambda: st.sensitivities(case, ["modal.max_frequency_hz"]),
                     lambda: st.rank_countermeasures(case, numbers=["modal.max_frequency_hz"])):  # fmt: skip
        with pytest.raises(st.CaseError) as error:
            analysis()
        assert str(error.value) == f"modal.max_frequency_hz: {told}"


def test_a_number_that_changes_nothing_is_told(tmp_path: Path) -> None:
    found = st.sensitivities(meeting(tmp_path), ["parameters.q.value", "parameters.r.value"], modes="all")
    assert found.warnings == ("parameters.r.value has no effect: no matrix of the modes depends on it",)


def test_branches_of_a_band_without_modes(tmp_path: Path) -> None:
    with pytest.raises(st.CaseError) as error:
        st.sensitivities(meeting(tmp_path), ["parameters.q.value"], modes=[1], max_frequency_hz=0.1)
    assert str(error.value) == 'modes: [1] – numbers of branches (the band has none)'
