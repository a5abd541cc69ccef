"""`stridor onsets CASE --along NAME`: critical values of any number of a case, by the call that μ has."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import stridor as st
from benches import paper_case
from matrix_cases import matrix_case
from program import stridor

pytestmark = pytest.mark.verification

ELEMENTS = {"bodies.beam1.elements": 6, "bodies.beam2.elements": 9}
COARSE = [word for key, value in ELEMENTS.items() for word in ("--set", f"{key}={value}")]


def along(folder: Path, *words: str) -> dict:
    done = stridor("onsets", *words, "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize(
    ("name", "between", "damped"),
    [pytest.param("contacts.A.stiffness", "1e7:1e10", True, marks=pytest.mark.slow),
     ("bodies.beam1.damping.mass", "0:2000", True), ("contacts.A.stiffness", "1e7:1e10", False)],
)  # fmt: skip
def test_the_friction_is_critical_there(tmp_path: Path, name: str, between: str, damped: bool) -> None:
    """With the number as it is at an onset along it, the case's own friction is an onset along μ."""
    stridor("new", "two-beams", cwd=tmp_path)
    none = {f"bodies.beam{k}.damping.{part}": 0.0 for k in (1, 2) for part in ("mass", "stiffness")}
    zero = [] if damped else [word for key in none for word in ("--set", f"{key}=0.0")]
    found = along(tmp_path, "two-beams.toml", "--along", name, "--between", between, "--max-frequency", "20000", *COARSE, *zero)
    assert (found["parameter"], found["complete"]) == (name, True)
    assert found["range"] == [float(v) for v in between.split(":")]
    assert found["onsets"]
    for onset in found["onsets"]:
        case = paper_case().with_({**ELEMENTS, **({} if damped else none), name: onset["value"]})
        critical = min(st.onsets(case, max_frequency_hz=20e3).onsets, key=lambda o: abs(o.mu - 0.1))
        assert critical.mu == pytest.approx(0.1, rel=1e-9)
        assert critical.frequency_hz == pytest.approx(onset["frequency_hz"], rel=1e-9)
        assert onset["residual"] < 1e-12


def test_a_parameter_of_imported_matrices(tmp_path: Path) -> None:
    """Hoffmann's minimal model without damping: p = 3/4, a double root, solved as one; its own range is the default."""
    terms = [
        (np.eye(2), "mass", ""), (np.array([[2.0, 1.0], [1.0, 2.0]]), "stiffness", ""),
        (np.array([[0.0, -4 / 3], [0.0, 0.0]]), "stiffness", "p"),
    ]  # fmt: skip
    matrix_case(tmp_path, terms, 1.0, more="[parameters]\np = { value = 0.2, range = [0.0, 1.5] }")
    found = along(tmp_path, "case.toml", "--along", "p")
    (onset,) = found["onsets"]
    assert onset["value"] == pytest.approx(0.75, rel=1e-12)
    assert onset["growth_slope"] is None
    assert found["completeness"].startswith("Complete as far as both ends tell")
    called = st.onsets(st.load(tmp_path / "case.toml"), along="p")
    assert {**called.to_json(), "warnings": []} == found
    assert (called.parameter, called.between) == ("p", (0.0, 1.5))
    with pytest.raises(st.CaseError, match=r"range of damping\.q: missing – damping\.q has no range in the case"):
        st.onsets(paper_case(), along="damping.q")
    with pytest.raises(st.CaseError, match="along"):
        st.onsets(st.build_system(paper_case()), along="bodies.beam1.length")
    # A case whose parameter is another one is sent to this call, not to another command.
    done = stridor("onsets", "case.toml", cwd=tmp_path)
    assert done.returncode == 1
    assert "`stridor onsets CASE --along NAME`" in done.stderr
    done = stridor("onsets", "case.toml", "--along", "p", "--between", "0.1:1.2", cwd=tmp_path)
    assert done.returncode == 0
    assert "0.75" in done.stdout


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--along", "bodies.beam1.length"), "--between: missing – bodies.beam1.length has no range in the case"),
        (("--along", "bodies.beam1.lenght", "--between", "0.04:0.06"), "bodies.beam1.lenght"),
        (("--along", "contact_stiffness", "--between", "2:1"), "--between: '2:1' – low:high, two finite numbers low < high"),
        (("--along", "contact_stiffness", "--between", "1:2", "--range", "0:1"), "--range: is not for onsets along"),
        (("--along", "contact_stiffness", "--between", "1:2", "--undamped"), "--undamped: is not for onsets along"),
        (("--along", "contact_stiffness", "--between", "1:2", "--undamped"), ": --set bodies.beam1.damping.mass=0 --set "),
        (("--along", "mu", "--between", "0:1", "--range", "0:1"), "--between: '0:1' – is the range of --along"),
    ],
)
def test_what_is_refused(tmp_path: Path, words: tuple[str, ...], said: str) -> None:
    stridor("new", "two-beams", cwd=tmp_path)
    done = stridor("onsets", "two-beams.toml", *words, *COARSE, cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_along_mu_is_the_search_over_friction(tmp_path: Path) -> None:
    stridor("new", "two-beams", cwd=tmp_path)
    one = along(tmp_path, "two-beams.toml", "--along", "mu", "--between", "0:0.2", *COARSE)
    assert [o["mu"] for o in one["onsets"]] == [o["mu"] for o in along(tmp_path, "two-beams.toml", "--range", "0:0.2", *COARSE)["onsets"]]
