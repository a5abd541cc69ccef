"""Divergence and flutter in turn: columns whose end load follows in part, damped and not, over any range of the load."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stridor as st
from matrix_cases import matrix_case
from program import stridor
from random_onsets import column
from stridor.modal.full import branches, counted

pytestmark = pytest.mark.verification

TOP = 400.0  # 1/s
# Share of the load that follows and damping of mass → onsets up to a load of 150: load, begins (+) or ends (−).
# Found by halving where the number of growing eigenvalues of the dense state matrix changes.
TURNS = {0.3: "+d +d +d -d +f", 0.45: "+d -d +f +d -d +f", 0.52: "+f +f"}


def matrices(share: float, damping: float) -> list:
    mass, stiffness, load = column(6, share)
    terms = [(mass, "mass", ""), (stiffness, "stiffness", ""), (load, "stiffness", "mu")]
    return [*terms, (damping * mass, "damping", "")] if damping else terms


def growing(terms: list, load: float) -> int:
    """Growing roots of the state matrix."""
    mass, stiffness, geometric = (terms[k][0] for k in range(3))
    damping = terms[3][0] if len(terms) > 3 else np.zeros_like(mass)
    n, inverse = len(mass), np.linalg.inv(mass)
    values = np.linalg.eigvals(
        np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ (stiffness + load * geometric), -inverse @ damping]])
    )
    return int(np.sum((values.real > 1e-7 * np.maximum(np.abs(values), 1.0)) & (np.abs(values) <= TOP)))


def changes(terms: list, high: float) -> list[float]:
    """Loads at which the number of growing roots changes, by halving."""
    found: list[float] = []

    def within(low: float, high: float, before: int, after: int) -> None:
        if before == after and high - low < 0.4:
            return
        if high - low < 1e-7:
            found.append(0.5 * (low + high))
            return
        middle = growing(terms, 0.5 * (low + high))
        within(low, 0.5 * (low + high), before, middle)
        within(0.5 * (low + high), high, middle, after)

    within(0.0, high, growing(terms, 0.0), growing(terms, high))
    return found


SLOW = {"marks": pytest.mark.slow}


@pytest.mark.parametrize(
    ("share", "damping", "high"),
    [
        (0.3, 0.5, 25.0), (0.3, 0.0, 150.0), (0.45, 0.5, 25.0), pytest.param(0.45, 0.5, 60.0, **SLOW),
        pytest.param(0.3, 0.5, 150.0, **SLOW), pytest.param(0.45, 0.0, 60.0, **SLOW),
        pytest.param(0.45, 0.5, 150.0, **SLOW), pytest.param(0.52, 0.5, 150.0, **SLOW),
    ],
)  # fmt: skip
def test_all_onsets_whatever_the_range(tmp_path: Path, share: float, damping: float, high: float) -> None:
    terms = matrices(share, damping)
    found = st.onsets(matrix_case(tmp_path, terms, TOP / (2 * np.pi), (0.0, high)))
    np.testing.assert_allclose([o.mu for o in found.onsets], changes(terms, high), atol=1e-5)
    turns = " ".join(("-" if o.stabilising else "+") + o.kind[0] for o in found.onsets)
    assert TURNS[share].startswith(turns)
    assert found.complete
    assert "smaller range" not in found.completeness


def test_a_pair_that_parts_on_the_real_axis_is_no_onset(tmp_path: Path) -> None:
    """z̈ + cż + (1 − μ ± jq)z = 0 with q² = (1 − μ/2)/400: flutter from q² = c²(1 − μ) on, and from μ = 2 on, where q
    vanishes, two motions that diverge. The growing roots are two before it and after."""
    terms = [
        (np.eye(2), "mass", ""), (0.2 * np.eye(2), "damping", ""), (np.eye(2), "stiffness", ""),
        (-np.eye(2), "stiffness", "mu"), (np.array([[0.0, 0.05], [0.0, 0.0]]), "stiffness", ""),
        (np.array([[0.0, 0.0], [-0.05, 0.0]]), "stiffness", "1-mu/2"),
    ]  # fmt: skip
    begins = (0.04 - 0.0025) / (0.04 - 0.00125)
    found = st.onsets(matrix_case(tmp_path, terms, 1.0, (0.0, 4.0)))
    (onset,) = found.onsets
    assert onset.mu == pytest.approx(begins, rel=1e-11)
    assert (onset.kind, onset.stabilising) == ("flutter", False)
    assert found.complete


def test_what_is_not_complete_has_an_exit_code_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    matrix_case(tmp_path, matrices(0.45, 0.5), TOP / (2 * np.pi), (0.0, 25.0))
    assert stridor("onsets", "case.toml", cwd=tmp_path).returncode == 0
    monkeypatch.setattr(branches, "located", lambda *_: None)
    solve = counted._Search._root

    def forgetful(*given):
        root = solve(*given)
        return None if root is not None and root.slope is not None and root.slope < 0 else root

    monkeypatch.setattr(counted._Search, "_root", forgetful)
    done = stridor("onsets", "case.toml", cwd=tmp_path)
    assert done.returncode == 3
    said = " ".join(done.stdout.split())
    assert "Not complete: 0 modes grow at μ = 0 and 1 at μ = 25" in said
    assert "between μ = 14.0625 and 14.3229 the number of growing roots changes by -1, and by the onsets by 0" in said
    for words in (("reduce", "case.toml", "--onsets", "mu"), ("reduce", "case.toml", "--onsets", "mu", "--json")):
        assert stridor(*words, cwd=tmp_path).returncode == 3
