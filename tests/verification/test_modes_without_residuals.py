"""Modes for pictures: without backward errors, and what they are then."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

import stridor as st
from benches import Slave, bench, paper_case
from stridor.modal.complex_modes import complex_modes
from stridor.modal.roots import CONVERGED, polish
from stridor.modal.single_contact import NUDGE, SingleContact, polish_single

MU = np.linspace(0.0, 0.6, 7)


@pytest.mark.parametrize("seed", range(6))
def test_eigenvalues_for_pictures_are_those_of_the_answer(seed):
    rng = np.random.default_rng([seed, 41])
    slaves = [
        Slave(
            place=float(p), lean_deg=float(rng.uniform(-25, 25)), length=float(rng.uniform(0.03, 0.07)), elements=3,
            damping=(float(rng.choice([0.0, 200.0])), 1e-8), end="clamped",
            stiffness="rigid" if rng.random() < 0.3 else float(10 ** rng.uniform(6, 10)),
        )
        for p in np.sort(rng.uniform(0.15, 0.85, int(rng.integers(1, 4))))
    ]  # fmt: skip
    system = bench(*slaves, elements=8)
    judged = complex_modes(system, MU, max_frequency_hz=40e3, source="receptance")
    drawn = complex_modes(system, MU, max_frequency_hz=40e3, source="receptance", residuals=False)
    assert np.isnan(drawn.residual).any()
    assert judged.residual.max() < 1e-9
    assert drawn.branch.tolist() == judged.branch.tolist()
    assert np.max(np.abs(drawn.eigenvalues - judged.eigenvalues) / np.abs(judged.eigenvalues)) < 1e-9


class OneNumber:
    """T = 1/λ² + 1/(λ² + 2w²), as `polish` has it where there are several contacts; its poles are at 0 and √2 jw."""

    modes = SimpleNamespace(poles=np.zeros(0, dtype=complex))
    slow_poles = np.zeros(2, dtype=bool), np.zeros(2)

    def __init__(self, w: float) -> None:
        self.pole_stiffness, self.pole_damping = np.array([0.0, 2.0 * (w * w)]), np.zeros(2)

    def single(self, mu: float) -> None:
        return None

    def evaluate(self, lam, mu):
        parts = [lam * lam + k for k in self.pole_stiffness]
        value, slope = sum(1 / p for p in parts), sum(-2 * lam / p**2 for p in parts)
        return value[:, None, None], slope[:, None, None], np.zeros_like(value)[:, None, None]


def compiled(w: float, start: complex) -> tuple[complex, bool]:
    stiffness, products = np.array([0.0, 2.0 * (w * w)]), np.array([[1.0, 1.0], [0.0, 0.0]])
    contact, roots = SingleContact(np.zeros(2), stiffness, products, 0.0, 0.0), np.array([start])
    left = polish_single(roots, np.zeros(1, dtype=bool), contact, (stiffness, np.zeros(2)), 40, CONVERGED)
    return roots[0], left == 0


def written_out(w: float, start: complex) -> tuple[complex, bool]:
    roots, converged = polish(OneNumber(w), np.array([start]), np.zeros(1, dtype=bool), 0.0)
    return roots[0], converged


@pytest.mark.parametrize("polished", [compiled, written_out])
@pytest.mark.parametrize("begin", ["root", "pole"])
def test_a_step_off_a_pole_is_no_convergence(polished, begin):
    """1/λ² + 1/(λ² + 2w²) is zero at ±jw to the last bit: an iteration ends there wherever it begins, and not where a
    nudge left it. Rounding decides for which w a nudge looks smaller than what counts as convergence: for about 30 of
    20 000."""
    every = np.random.default_rng(5).uniform(1.0, 1e4, 20_000)
    begins = every if begin == "root" else np.sqrt(2.0 * (every * every))
    looks_so = np.abs(NUDGE * 1j * begins) / begins < CONVERGED
    assert looks_so.sum() > 5
    for w, imag in zip(every[looks_so], begins[looks_so], strict=True):
        root, converged = polished(float(w), complex(0.0, float(imag)))
        assert converged
        assert abs(abs(root) - w) <= 1e-14 * w, w


def test_whoever_asks_for_residuals_gets_them_whatever_was_asked_before():
    work = st.Workspace(paper_case())
    drawn = st.modes(work, MU, check=False, residuals=False)
    judged = st.modes(work, MU, check=False)
    again = st.modes(work, MU, check=False, residuals=False)
    assert np.isnan(drawn.residual).any()
    assert np.all(judged.residual < 1e-9)
    assert np.array_equal(again.eigenvalues, drawn.eigenvalues)
    # What is checked is judged, whatever else is said.
    assert np.all(st.modes(work, 0.2, residuals=False).residual < 1e-9)
    # No number that JSON does not have.
    modes = json.loads(json.dumps(drawn.to_json(), allow_nan=False))["modes"][0]
    assert None in [m["residual"] for m in modes]
