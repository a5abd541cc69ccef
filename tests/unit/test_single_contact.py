"""One contact on real modes is iterated by a kernel of its own: what NumPy does for all others, number by number."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from benches import paper_case
from stridor.modal.coupling import PointCoupling
from stridor.modal.receptance_modes import prepare
from stridor.modal.roots import ReceptanceProblem, polish
from stridor.system import build_system


@pytest.fixture(scope="module")
def problem() -> ReceptanceProblem:
    found, *_ = prepare(build_system(paper_case()))
    assert found.single(0.3) is not None
    return found


def none(*_: Any) -> None:
    """No kernel."""


def both(problem: ReceptanceProblem, monkeypatch: pytest.MonkeyPatch, *given: Any, **named: Any) -> tuple[Any, Any]:
    compiled = polish(problem, *given, **named)
    with monkeypatch.context() as patch:
        patch.setattr(ReceptanceProblem, "single", none)
        return compiled, polish(problem, *given, **named)


def starts(problem: ReceptanceProblem, off: float, seed: int) -> Any:
    rng = np.random.default_rng(seed)
    poles = 1j * np.sqrt(problem.pole_stiffness[problem.pole_stiffness > 0][:20])
    return poles * (1.0 + off * (rng.normal(size=20) + 1j * rng.normal(size=20)))


@pytest.mark.parametrize("mu", [0.0, 0.1, 0.3, 0.9])
@pytest.mark.parametrize("steps", [1, 3, 40])
def test_it_is_the_iteration_of_all_others(problem: ReceptanceProblem, monkeypatch: Any, mu: float, steps: int) -> None:
    for seed in range(5):
        given = starts(problem, 1e-3, seed), np.ones(20, dtype=bool), mu
        (roots, converged), (wanted, told) = both(problem, monkeypatch, *given, steps=steps)
        assert converged is told
        np.testing.assert_allclose(roots, wanted, rtol=1e-13)
        if steps == 1:
            assert not converged
        elif converged:  # roots they are, whoever found them
            value, slope, _ = problem.evaluate(roots, mu)
            assert np.abs(value / slope / roots[:, None, None]).max() < 1e-8


def test_a_start_on_a_pole_gets_off_it(problem: ReceptanceProblem, monkeypatch: Any) -> None:
    pole = np.array([1j * np.sqrt(problem.pole_stiffness[problem.pole_stiffness > 0][3])])
    (roots, converged), (wanted, told) = both(problem, monkeypatch, pole, np.ones(1, dtype=bool), 0.3)
    assert converged is told
    np.testing.assert_allclose(roots, wanted, rtol=1e-9)


def test_several_contacts_and_slopes_are_left_to_numpy(problem: ReceptanceProblem) -> None:
    weakening = {"law": "weakening", "coefficient": 0.2, "static_coefficient": 0.4, "decay_speed": 0.5}
    sloped, *_ = prepare(build_system(paper_case().with_({"contacts.A.friction": weakening})))
    assert isinstance(sloped.coupling, PointCoupling)
    assert sloped.coupling.sloped
    assert sloped.single(0.3) is None
