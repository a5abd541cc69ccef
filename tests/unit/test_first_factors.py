"""The factors of the structure without friction: answers that span a space, and what their pivots tell."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import stridor as st
from rubbing_block import rubbing_block
from stridor.direct import Factor, backends
from stridor.modal import growing
from stridor.modal.growing import growing_modes
from stridor.modal.krylov import krylov_onsets
from stridor.modal.krylov.problem import ContactProblem
from stridor.modal.krylov.shifted import Shifted
from stridor.modal.quadratic import Quadratic, is_stiff
from stridor.system import build_system

TELLS = pytest.mark.skipif(not backends.installed("mumps"), reason="no solver that tells the signs of pivots")


def problem(seed: int, *, rigid: int = 1, lowest: float = 1.0) -> ContactProblem:
    """Random matrices of 12 freedoms, four contacts of which some are rigid; lowest: the least eigenvalue of K."""
    random = np.random.default_rng(seed)
    n, m = 12, 4
    turn, _ = np.linalg.qr(random.standard_normal((n, n)))
    stiffness = turn @ np.diag([lowest, *random.uniform(2.0, 50.0, n - 1)]) @ turn.T
    compliance = np.where(np.arange(m) < rigid, 0.0, random.uniform(0.01, 0.2, m))
    return ContactProblem(
        mass=sp.diags_array(random.uniform(0.5, 2.0, n), format="csr"),
        damping=sp.csr_array((n, n)),
        stiffness=sp.csr_array((stiffness + stiffness.T) / 2),
        normal=sp.csr_array(random.standard_normal((m, n))),
        slip=sp.csr_array(random.standard_normal((m, n))),
        share=np.ones(m),
        compliance=compliance,
        touching=np.arange(m),
        open_contacts=(),
        damped=False,
    )


@pytest.mark.parametrize("rigid", [0, 1, 4])
@pytest.mark.parametrize(("spoil", "times"), [(0.0, [False]), (1e-11, [False, True])])
def test_contacts_are_respected_even_where_elimination_does_not(
    rigid: int, spoil: float, times: list[bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    given, force = problem(2, rigid=rigid), np.random.default_rng(3).standard_normal((12, 5))
    shifted = Shifted(given, 0.3)
    wanted = shifted.solve(force, exact=True)
    solve, refined = Factor.solve, list[bool]()

    def spoilt(self: Factor, right: Any, *, transpose: bool = False, refine: bool = True) -> Any:
        refined.append(refine)
        answer = solve(self, right, transpose=transpose, refine=refine)
        return answer if refine else answer * (1.0 + spoil * np.arange(len(answer))[:, None])

    monkeypatch.setattr(Factor, "solve", spoilt)
    u, p = shifted.solve(force)
    assert refined == times
    assert u == pytest.approx(wanted[0], rel=1e-10, abs=1e-12)
    assert given.normal @ u + given.compliance[:, None] * p == pytest.approx(0.0, abs=1e-12)
    assert (given.stiffness + 0.3 * given.mass) @ u - given.normal.T @ p == pytest.approx(force, abs=1e-9)


@TELLS
@pytest.mark.parametrize("seed", range(20))
def test_pivots_tell_whether_it_stands(seed: int) -> None:
    lowest = float(np.random.default_rng(seed).uniform(-3.0, 1.0))
    for rigid in (0, 2):
        given = problem(seed, rigid=rigid, lowest=lowest)
        for shift in (0.2, 1.0, 4.0):
            # Motions that respect rigid contact, with the springs of the others.
            soft = given.compliance > 0
            normal = given.normal.toarray()
            whole = (given.stiffness + shift * given.mass).toarray()
            whole += normal[soft].T @ np.diag(1.0 / given.compliance[soft]) @ normal[soft]
            free = np.linalg.svd(normal[~soft])[2][(~soft).sum() :].T if not soft.all() else np.eye(12)
            stands = bool(np.linalg.eigvalsh(free.T @ whole @ free)[0] > 0.0)
            assert Shifted(given, shift).positive == stands
            if is_stiff(given.pencil(0.0).condensed(), float(np.sqrt(shift))):
                assert stands  # what it asks of all motions holds of these


@TELLS
def test_it_is_not_asked_again_where_the_first_factors_told(monkeypatch: pytest.MonkeyPatch) -> None:
    case = st.loads(rubbing_block("max_frequency_hz = 7e3"))
    system, asked = build_system(case), list[float]()
    stands = growing.is_stiff

    def counted(quadratic: Quadratic, rate: float, solver: str | None = None) -> bool:
        asked.append(rate)
        return stands(quadratic, rate, solver)

    monkeypatch.setattr(growing, "is_stiff", counted)
    top = 7e3
    alone = growing_modes(build_system(case), 0.3, top, touching_at=None)
    assert len(asked) == 1
    krylov_onsets(system, (0.0, 0.3), max_frequency_hz=top)
    after = growing_modes(system, 0.3, top, touching_at=None)
    assert len(asked) == 1
    assert after.values == pytest.approx(alone.values)
    assert after.sentence == alone.sentence
