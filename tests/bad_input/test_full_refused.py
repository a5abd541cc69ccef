"""What is refused of imported matrices without structure, each with its one line."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

import stridor as st
from matrix_cases import matrix_case, rubbing
from program import stridor
from stridor.study.workspace import Workspace
from undrawn import nothing_drawn

pytestmark = pytest.mark.bad_input

ONE, SPRINGS = np.eye(2), np.array([[2.0, 1.0], [1.0, 2.0]])
BELT = np.array([[0.0, -4 / 3], [0.0, 0.0]])
WORKS = "what works for these is `stridor report`, `stridor modes` and `stridor onsets`"
ALONG = f"{WORKS[:-1]} --along NAME`"


def model(folder: Path, *more: tuple, factor: str = "mu", extra: str = "") -> st.Case:
    terms = [(ONE, "mass", ""), (SPRINGS, "stiffness", ""), (BELT, "stiffness", factor), *more]
    return matrix_case(folder, terms, 1.0, more=extra)


def message(call, *arguments, **options) -> str:
    with pytest.raises(st.StridorError) as caught:
        call(*arguments, **options)
    return str(caught.value)


def test_nothing_depends_on_friction(tmp_path: Path):
    expected = (
        "nothing here depends on the friction coefficient: no factor of a matrix has mu in it and there are no contacts; "
        "`stridor onsets CASE --along NAME` solves for onsets along other parameters"
    )
    assert message(st.onsets, model(tmp_path, factor="")) == expected
    assert message(st.onsets, model(tmp_path, factor="0*mu")) == expected


def test_a_run_needs_friction_and_a_comparison_contacts(tmp_path: Path):
    """Circulatory forces alone: modes and time answer, a run has no onset to look for."""
    case = model(tmp_path, factor="0.5", extra="[[phases]]\nname = 'free'\nduration = 1.0\n")
    refused = message(Workspace(case).structured, "run")
    assert refused == (
        "run: there are no contacts and no factor of a matrix has mu in it, so there is no onset to solve for; what works "
        "for these is `stridor report`, `stridor modes`, `stridor simulate` and `stridor onsets --along NAME`"
    )
    assert message(st.compare, case) == "a perturbation of steady sliding needs contacts that slide"
    assert st.simulate(case).steps > 0


def test_ranges_and_frequencies_that_are_none(tmp_path: Path):
    case = model(tmp_path)
    assert message(st.onsets, case, (0.5, 0.2)) == "friction_range: [0.5, 0.2] – two finite numbers 0 ≤ low < high"
    assert message(st.onsets, case, (-0.5, 0.2)) == "friction_range: [-0.5, 0.2] – two finite numbers 0 ≤ low < high"
    assert message(st.onsets, case, max_frequency_hz=-1.0) == "max_frequency_hz: -1.0 – a highest frequency is a finite number > 0 [Hz]"
    assert message(st.modes, case, -0.1).startswith("mu: -0.1 – a friction coefficient is a finite number ≥ 0")
    assert message(st.modes, case, 0.1, max_frequency_hz=-1.0) == "max_frequency_hz: -1.0 – a highest frequency is a finite number > 0 [Hz]"


def test_factors_without_a_value(tmp_path: Path):
    expected = "bodies.matrices.terms.2.factor: '0.3/mu' – division by zero at mu = 0"
    assert message(st.onsets, model(tmp_path, factor="0.3/mu")) == expected


@pytest.mark.parametrize("call", [st.simulate, st.compare])
def test_time_loops_take_constant_matrices(tmp_path: Path, call):
    """At μ = 0 these are symmetric; that nothing gives μ does not make a run of them."""
    assert message(call, model(tmp_path)) == (
        f"{call.__name__}: factors of imported matrices depend on mu, and beyond mu = 0 the stiffness matrix is not "
        f"symmetric; the time loop takes constant matrices only; {WORKS}"
    )
    assert message(st.run, model(tmp_path), tmp_path / "out").startswith("run: factors of imported matrices depend on mu")
    gyroscopic = model(tmp_path, (np.array([[0.0, 1.0], [-1.0, 0.0]]), "damping", ""))
    assert "depend on mu, and the damping matrix is not symmetric; the time loop" in message(call, gyroscopic)


@pytest.mark.parametrize("call", [st.simulate, st.compare, st.run])
@pytest.mark.parametrize(
    ("mass", "expected"),
    [
        (np.array([[2.0, 0.5], [0.5, 1.0]]), "the mass matrix is not diagonal, and beside unsymmetric matrices the time loop needs that; import a lumped mass matrix"),
        (np.array([[2.0, 0.5], [0.25, 1.0]]), "the mass matrix is not symmetric, and the time loop needs a diagonal one"),
        (np.diag([1.0, 0.0]), "1 freedom has no mass, and the time loop needs one at each"),
        (np.diag([1.0, -1.0]), "1 freedom has a negative mass, and the time loop needs a positive one at each"),
    ],
)  # fmt: skip
def test_masses_that_the_time_loop_does_not_take(tmp_path: Path, call, mass, expected: str):
    case = matrix_case(tmp_path, [(mass, "mass", ""), (SPRINGS + BELT, "stiffness", "")], 1.0)
    given = (tmp_path / "out",) if call is st.run else ()
    assert message(call, case, *given) == f"{call.__name__}: {expected}; {ALONG}"
    words = " ".join(st.describe(case).lines)
    assert f"time loops do not: {expected}" in words


def test_the_last_lines_of_matrices_without_friction_name_what_takes_them(tmp_path: Path):
    model(tmp_path, factor="0.5")
    assert "Next: stridor report case.toml" in stridor("modes", "case.toml", cwd=tmp_path).stdout


def test_steady_sliding_is_recommended_where_it_can_be_drawn(tmp_path: Path):
    case = rubbing(tmp_path, 1e3)
    assert message(st.compare, case).endswith("`stridor onsets` and `stridor steady`")


@pytest.mark.slow
def test_a_run_of_matrices_that_friction_only_makes_stiffer_is_fine(tmp_path: Path):
    """μ in symmetric matrices is a number like others."""
    terms = [(ONE, "mass", ""), (SPRINGS, "stiffness", ""), (ONE, "stiffness", "mu")]
    case = matrix_case(tmp_path, terms, 1.0).with_({"phases": [{"name": "rest", "duration": 1.0}]})
    assert st.simulate(case).steps > 0


def test_too_large_for_full_solves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for module in ("basis", "search"):
        monkeypatch.setattr(f"stridor.modal.full.{module}.WHOLE", 1)
    monkeypatch.setattr("stridor.modal.full.search.DENSE", 1)
    assert message(st.onsets, model(tmp_path, factor="sqrt(mu)")) == (
        "no reduced model over mu can be made of these matrices (the matrices are no smooth functions of mu), and "
        "following modes by full solves is not tried with 2 unknowns, more than 1; take `stridor modes` at several mu"
    )


def test_the_verbs_say_it_in_one_line(tmp_path: Path):
    model(tmp_path)
    done = stridor("simulate", "case.toml", cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr.startswith("stridor: simulate: factors of imported matrices depend on mu")
    assert done.stderr.count("\n") == 1
    # What is recommended works, and the commands that verbs end with too.
    with nothing_drawn():
        for verb in re.findall("`stridor ([a-z]+)`", done.stderr):
            recommended = stridor(verb, "case.toml", cwd=tmp_path)
            assert recommended.returncode == 0, recommended.stderr
            _, _, following = recommended.stdout.partition("Next: stridor ")
            assert stridor(*shlex.split(following), cwd=tmp_path).returncode == 0, following
    done = stridor("onsets", "case.toml", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["onsets"][0]["mu"] == pytest.approx(0.75, rel=1e-12)
    assert json.loads(done.stdout)["completeness"].startswith("Complete")
    # Nothing of what happens at exactly singular matrices gets through.
    assert "Warning" not in done.stderr


@pytest.mark.parametrize("where", [slice(0, 1), slice(0, 2)])
def test_negative_masses_are_told_before_what_they_make_grow(tmp_path: Path, where: slice):
    mass = np.array([1.0, 1.0])
    mass[where] *= -1
    case = matrix_case(tmp_path, [(np.diag(mass), "mass", ""), (SPRINGS, "stiffness", ""), (BELT, "stiffness", "mu")], 1.0)
    (tmp_path / "negative.toml").write_text(case.to_toml())
    words = "1 freedom has" if where.stop == 1 else "2 freedoms have"
    for verb in ("check", "modes", "sensitivities"):
        shown = stridor(verb, "negative.toml", cwd=tmp_path)
        assert f"bodies.matrices: {words} a negative mass, and what grows" in " ".join(shown.stderr.split()), shown
    assert all("negative mass" not in told for told in st.describe(model(tmp_path)).warnings)


def test_a_text_that_may_be_cut_off_is_told_of_by_all_that_computes(tmp_path: Path):
    (tmp_path / "M.mtx").write_text("%%MatrixMarket matrix array real general\n1 1\n1.0\n")
    (tmp_path / "K.mtx").write_text("%%MatrixMarket matrix array real general\n1 1\n3.0E+05")
    terms = '[{ file = "M.mtx", role = "mass" }, { file = "K.mtx", role = "stiffness" }]'
    (tmp_path / "cut.toml").write_text(f"[matrices]\nterms = {terms}\n")
    for verb in ("check", "modes", "onsets"):
        shown = stridor(verb, "cut.toml", cwd=tmp_path)
        told = " ".join(shown.stderr.split() if verb != "check" else (shown.stdout + shown.stderr).split())
        assert "bodies.matrices: K.mtx: The last line has no line end: if the file was cut off there" in told, shown
    with (tmp_path / "K.mtx").open("a") as file:
        file.write("\n")
    assert "line end" not in stridor("modes", "cut.toml", cwd=tmp_path).stderr


@pytest.mark.parametrize("damping", [0.0, 2.0])
def test_without_any_stiffness_all_motions_stay_or_creep(tmp_path: Path, damping: float):
    system = st.System.from_matrices(np.eye(2), np.diag([damping, 0.0]), np.zeros((2, 2)))
    found = st.modes(st.Workspace(system, modal={"max_frequency_hz": 1.0}), 0.1)
    # A free motion is one mode; with a damper it is one that stays and one that creeps to rest.
    assert sorted(found.eigenvalues[0].real) == pytest.approx([-damping, 0.0, 0.0] if damping else [0.0, 0.0])
    case = matrix_case(tmp_path, [(np.eye(2), "mass", ""), (np.zeros((2, 2)), "stiffness", "")], 1.0)
    (tmp_path / "none.toml").write_text(case.to_toml())
    assert stridor("modes", "none.toml", cwd=tmp_path).returncode == 0
