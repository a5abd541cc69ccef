"""What notebooks show of cases, systems and results: short, escaped, and nothing that would have to be computed."""

from __future__ import annotations

import csv
import sys
import xml.etree.ElementTree as tree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse.linalg

import stridor as st
from stridor.agreement import Agreement, Comparison, Perturbation
from stridor.case import template_text
from stridor.io.csv_files import write_csv
from stridor.modal.complex_modes import ComplexModes
from stridor.modal.onsets import Onset, Onsets
from stridor.notebook import MOST_ROWS, html_table
from stridor.temporal.trajectory import ContactStatistics, PhaseResult, Trajectory

HOSTILE = '<script>alert("μ & \'1\'")</script><b onload=x>'
MODES = ComplexModes(
    mu=np.array([0.1]), eigenvalues=np.array([[-20 + 3000j, 637.25 + 54300j, np.nan]]), branch=np.array([1, 8, 9]),
    residual=np.array([[1e-16, 2e-15, np.nan]]), damped=True, notes=(HOSTILE,), completeness=("Nothing is missing.",),
)  # fmt: skip
ONSETS = Onsets(
    (Onset(0.0766, 8635.4, "flutter", True, False, (8, 10), 1e-15, None, 12e3),), (0.0, 1.0), 40e3, True, notes=(HOSTILE,)
)
STATISTICS = ContactStatistics(0.25, 0.5, 0.25, 40.125, 4.0, 0.3, None, None)


def run() -> Trajectory:
    none = np.zeros((3, 1))
    return Trajectory(
        time=np.arange(3.0), contact_names=(HOSTILE,), normal_force=none, tangential_force=none, slip_speed=none, gap=none,
        status=none.astype(int), watch_names=(), displacement=np.zeros((3, 0, 2)), velocity=np.zeros((3, 0, 2)),
        acceleration=np.zeros((3, 0, 2)), kinetic=none[:, 0], elastic=none[:, 0], works={}, step=1e-6, beta2=0.5,
        phases=(PhaseResult(HOSTILE, 0.0, 1.0, {HOSTILE: STATISTICS}),), record_every=10, steps=20, planned_steps=30,
        path="modal", path_reason="", step_limit=1e-6, limiting_body="", most_sweeps=1, unconverged_steps=0,
        interrupted=True, wall_seconds=0.1,
    )  # fmt: skip


def agreement() -> Agreement:
    seen = Perturbation.__new__(Perturbation)  # of it the eigenvalue alone is shown
    object.__setattr__(seen, "eigenvalue", 600 + 54200j)
    one = Comparison(0.1, 637 + 54300j, (), (), seen, None, None, 0.01, 0.02, None, None, True, HOSTILE)
    return Agreement((one,), None, None, None, "agree: " + HOSTILE, (HOSTILE,))


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    case = st.loads(template_text("two-beams")).with_({"title": HOSTILE, "phases.0.name": HOSTILE})
    system = st.build_system(case.with_({"bodies.beam1.elements": 3, "bodies.beam2.elements": 6}))
    system = replace(system, loads={HOSTILE: np.zeros(system.size)}, not_symmetric_definite=HOSTILE)

    def solved(*_: object, **__: object) -> None:
        raise AssertionError("something was computed")

    for module in (np.linalg, scipy.linalg, scipy.sparse.linalg):
        for name in ("solve", "eig", "eigh", "eigvals", "inv", "splu", "spsolve", "eigs", "eigsh", "lstsq"):
            if hasattr(module, name):
                monkeypatch.setattr(module, name, solved)
    monkeypatch.setattr("stridor.system.build.build_system", solved)
    return {"case": case, "system": system, "modes": MODES, "onsets": ONSETS, "run": run(), "agreement": agreement()}


def test_all_are_escaped_and_short_and_compute_nothing(shown: dict[str, object]) -> None:
    for name, thing in shown.items():
        text = thing._repr_html_()
        assert "<script" not in text, name
        assert "<b " not in text, name
        assert HOSTILE in "".join(tree.fromstring(text).itertext()), name  # whole, as text
        assert len(text) < 4000, name


def cells(thing: object) -> list[list[str]]:
    return [[cell.text or "" for cell in row] for row in tree.fromstring(thing._repr_html_()).iter("tr")]


def test_numbers_are_those_of_the_result(shown: dict[str, object]) -> None:
    assert cells(MODES)[1:] == [
        ["1", "477.465", "-20.00", "0.006667", "", "1e-16"],
        ["8", "8642.11", "637.25", "-0.01173", "unstable", "2e-15"],
    ]
    assert "Nothing is missing." in MODES._repr_html_()
    assert cells(ONSETS)[1] == ["0.076600", "8635.40", "flutter", "8, 10", "begins", "12000.00", "1e-15"]
    assert cells(shown["run"])[1][2:] == ["25.0%", "50.0%", "25.0%", "40.12", "0.3000"]
    assert "interrupted: 20 of 30 steps" in shown["run"]._repr_html_()
    assert cells(shown["agreement"])[1][:5] == ["0.1", "8642.11", "637.000", "8626.20", "600.000"]
    assert ["contact A", "a point, stiffness 1e+10, gap 0 m"] in cells(shown["system"])
    rigid = replace(shown["system"], contacts=(replace(shown["system"].contacts[0], stiffness=np.inf),))
    assert ["contact A", "a point, rigid, gap 0 m"] in cells(rigid)
    assert ["A", "beam1.tip on beam2, stiffness 1e+10, coulomb μ = 0.1"] in cells(shown["case"])


def test_sweeps_have_a_row_for_each_friction_coefficient() -> None:
    sweep = replace(MODES, mu=np.linspace(0, 1, 40), eigenvalues=np.repeat(MODES.eigenvalues, 40, axis=0), planned=50)
    rows = cells(sweep)
    assert len(rows) == MOST_ROWS + 1
    assert rows[1] == ["0", "2", "1", "8642.11", "637.25"]
    assert "and 28 more" in sweep._repr_html_()
    assert "interrupted: 40 of 50 friction coefficients" in sweep._repr_html_()
    nothing = replace(sweep, eigenvalues=np.zeros((40, 0), complex), branch=np.zeros(0, int), residual=np.zeros((40, 0)))
    assert cells(nothing)[1] == ["0", "0", "0", "", ""]


def test_tables_of_nothing_and_of_long_words() -> None:
    assert html_table("a<b", (), ()) == "<div><strong>a&lt;b</strong></div>"
    assert len(html_table("x" * 10_000, ("h",), [["y" * 10_000]])) < 1000
    empty = replace(ONSETS, onsets=(), notes=())
    assert "No onsets for μ from 0 to 1, up to 40000 Hz" in empty._repr_html_()
    assert "<table" not in empty._repr_html_()


def test_modes_are_a_sequence_of_branches() -> None:
    sweep = replace(MODES, mu=np.array([0.1, 0.3]), eigenvalues=np.vstack([MODES.eigenvalues, MODES.eigenvalues - 700]),
                    residual=np.repeat(MODES.residual, 2, axis=0), max_frequency_hz=12e3)  # fmt: skip
    assert len(sweep) == 3
    assert [branch.number for branch in sweep] == [1, 8, 9]
    last = sweep[1]
    assert last.frequency_hz == pytest.approx([54300 / (2 * np.pi)] * 2)
    assert last.growth_rate == pytest.approx([637.25, -62.75])
    assert last.damping_ratio == pytest.approx([-0.011735, 0.0011556], rel=1e-4)
    assert last.unstable.tolist() == [True, False]
    assert repr(last) == "<Branch: mode 8 at 2 μ: 8642.11 Hz to 8642.11 Hz, unstable at 1 of them, from μ = 0.1>"
    assert repr(sweep[-1]) == "<Branch: mode 9, not known at any of these μ>"
    assert repr(MODES[1]) == "<Branch: mode 8 at μ = 0.1: 8642.11 Hz, +637.2 1/s, unstable>"
    assert [b.number for b in sweep[1:]] == [8, 9]
    assert sweep[1:].total.tolist() == sweep.total.tolist()  # of the band, as of `lowest`
    assert repr(sweep) == "<ComplexModes: 3 modes at 2 friction coefficients, 0.1 to 0.3; 1 unstable>"
    with pytest.raises(IndexError):
        sweep[3]
    frame = sweep[1].to_dataframe()
    assert frame["growth_1_s"].tolist() == last.growth_rate.tolist()


def test_onsets_are_a_sequence_of_onsets() -> None:
    assert len(ONSETS) == 1
    assert ONSETS[0] is ONSETS.onsets[0] is next(iter(ONSETS))
    assert ONSETS[:1] == ONSETS.onsets
    assert repr(ONSETS[0]) == "<Onset: μ = 0.076600, 8635.4 Hz, flutter of modes 8 and 10>"
    ends = replace(ONSETS[0], stabilising=True, kind="divergence", branches=(3, 3))
    assert ends.words == "μ = 0.076600, 8635.4 Hz, divergence of mode 3, where growth ends"
    assert not replace(ONSETS, onsets=())
    assert repr(replace(ONSETS, onsets=())) == "<Onsets: none for μ from 0 to 1, up to 40000 Hz>"


def test_data_frames_have_the_columns_of_the_csv_files(tmp_path: Path) -> None:
    for thing in (MODES, ONSETS, agreement()):
        frame = thing.to_dataframe()
        path = write_csv(thing, tmp_path / "table.csv")
        with path.open(encoding="utf-8", newline="") as lines:
            written = list(csv.DictReader(lines))
        assert list(frame.columns) == list(written[0])
        assert len(frame) == len(written)
        assert float(written[0]["mu" if "mu" in frame else "value"]) == frame.iloc[0]["mu" if "mu" in frame else "value"]
    assert np.isnan(ONSETS.to_dataframe()["enters_band_at"][0])


def test_runs_are_columns_over_time() -> None:
    frame = replace(run(), contact_names=("A",), watch_names=("tip",), velocity=np.ones((3, 1, 2)),
                    displacement=np.zeros((3, 1, 2)), acceleration=np.zeros((3, 1, 2))).to_dataframe()  # fmt: skip
    assert frame.index.tolist() == [0.0, 1.0, 2.0]
    assert frame.index.name == "time_s"
    assert frame["A.status"].tolist() == ["separation"] * 3
    assert frame["tip.velocity_y_m_s"].tolist() == [1.0] * 3
    assert "A.normal_force_n" in frame
    assert "kinetic_j" in frame


def test_without_pandas_the_way_out_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(st.AnalysisError, match="needs pandas, which is not installed: pip install pandas"):
        ONSETS.to_dataframe()


def test_datasets_are_those_of_files() -> None:
    for thing in (MODES, ONSETS, agreement(), run()):
        assert thing.to_xarray().identical(st.to_dataset(thing))
        assert thing.to_xarray().attrs["format"] == "stridor results 1"


def test_modes_of_reduced_models_and_of_bodies_are_tables():
    case = st.loads(template_text("two-beams"))
    modes = st.reduced_model(case, {"mu": (0.0, 0.3)}).modes({"mu": 0.1})
    frame = modes.to_dataframe()
    assert list(frame)[:3] == ["mu", "frequency_hz", "growth_1_s"]
    assert frame["frequency_hz"].tolist() == modes.frequency_hz.tolist()
    assert frame["unstable"].sum() == 1
    assert set(frame["mu"]) == {0.1}
    alone = st.body_modes(case)["beam2"]
    assert alone.to_dataframe()["mode"].tolist() == list(alone.labels)
