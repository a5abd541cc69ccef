"""Shapes at eigenvalues that are poles of the receptance: the mode itself, without a word from NumPy."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

from benches import paper_case
from stridor.modal.receptance_modes import prepare
from stridor.modal.vectors import expand
from stridor.system import build_system


@pytest.mark.parametrize("damping", [0.0, 1.0])
def test_the_shape_on_a_pole_is_its_own_mode(damping: float) -> None:
    system = build_system(paper_case())
    spectrum, _, _ = prepare(replace(system, damping=damping * system.damping))
    block = spectrum.modes.real[0]
    square = block.damping[2] ** 2 / 4 - block.stiffness[2]
    lam = np.array([-block.damping[2] / 2 + 1j * np.sqrt(-square)])
    forces = np.zeros((1, 2 * spectrum.coupling.contacts), dtype=complex)
    forces[0, 0] = 1.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        shape = expand(spectrum, lam, forces)[:, 0]
    assert np.all(np.isfinite(shape))
    assert np.linalg.norm(shape) == pytest.approx(1.0)
    own = block.vectors[:, 2] / np.linalg.norm(block.vectors[:, 2])
    assert abs(own @ shape[block.freedoms]) == pytest.approx(1.0, abs=1e-5)
