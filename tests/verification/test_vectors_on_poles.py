"""Shapes at eigenvalues that are poles of the receptance: the mode itself, without a word from NumPy."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benches import by_hand, full_eigenvalues, paper_case
from stridor.modal.backward_error import BackwardError
from stridor.modal.complex_modes import complex_modes
from stridor.modal.onsets import onsets
from stridor.modal.receptance_modes import modes_by_receptance, prepare
from stridor.modal.vectors import closed, expand, modal_coordinates
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


@pytest.mark.parametrize("damping", [0.0, 1.0])
def test_the_shape_beside_a_pole_closes_its_contact(damping: float) -> None:
    """Where a node of a mode all but touches, its root has no digits left against the pole; the vectors still have all."""
    case = paper_case().with_({"bodies.beam1.start": [0.075, 0.0]})
    system = build_system(case)
    system = replace(system, damping=damping * system.damping)
    mus = np.linspace(0.1, 1.0, 10)
    found = modes_by_receptance(
        system, mus, count=40, max_frequency_hz=4e4, damped=True, vectors=True, progress=None
    )
    spectrum, coupling, _ = prepare(system)
    judge, improved = BackwardError(coupling), 0
    for k, mu in enumerate(mus):
        lam = found.eigenvalues[k]
        push, pull = modal_coordinates(spectrum, lam, float(mu))
        friction = np.full((len(lam), 1), mu * coupling.sense[0])
        for left, forces in ((False, push), (True, pull)):
            summed = judge(lam, expand(spectrum, lam, forces), mu, left=left)
            near = summed > 1e-10
            closing = closed(spectrum, lam[near], forces[near], friction[near] if left else None)
            assert np.all(judge(lam[near], closing, mu, left=left) < 1e-12)
            improved += int(near.sum())
    assert improved > 10


def test_left_vectors_beside_a_pole_under_falling_friction() -> None:
    """The left vector's gap is not the right one's: what is judged well on the right may be wrong on the left."""
    friction = {"law": "weakening", "coefficient": 0.3, "static_coefficient": 0.5, "decay_speed": 0.5}
    case = paper_case().with_({
        "bodies.beam1.start": [0.075 + 1e-8, 0.0], "contacts.A.friction": friction, "bodies.beam1.elements": 12,
        "bodies.beam2.elements": 12, "supports.end": {"at": "beam2.end", "fixed": ["y", "rotation"]},
    })  # fmt: skip
    system = build_system(case)
    found = modes_by_receptance(
        system, np.array([0.3]), count=40, max_frequency_hz=4e4, damped=True, vectors=True, progress=None
    )
    coupling = prepare(system, mu=0.3)[1]
    assert found.left is not None
    errors = BackwardError(coupling)(found.eigenvalues[0], found.left[0].T, 0.3, left=True)
    assert np.all(errors < 1e-10)


def test_a_root_that_passes_through_a_pole_keeps_its_slope() -> None:
    """λ = 2j is the first pole, and at μ = 1/2 friction and pressure do no work on its mode."""
    system = by_hand(np.eye(2), np.zeros((2, 2)), np.diag([4.0, 9.0]), [[1.0, 1.0]], [[2.0, -0.5]], 5.0)
    spectrum, _, _ = prepare(system)
    step = 1e-5
    before, after = (np.sort(np.imag(full_eigenvalues(system, 0.5 + way * step)))[2] for way in (-1, 1))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        slope = spectrum.tangents(np.array([2j]), 0.5)
    assert slope[0] == pytest.approx(1j * (after - before) / (2 * step), rel=1e-7)


def test_onsets_where_a_mode_stays_on_its_pole() -> None:
    """A mode of a body whose damping is not proportional, which the contact moves by less than its last digit."""
    damping = np.array([[0.3, 0.1, 0.02], [0.1, 0.1, 0.03], [0.02, 0.03, 0.05]])
    stiffness = np.array([[4.0, 1.0, 0.5], [1.0, 9.0, 1.0], [0.5, 1.0, 25.0]])
    state = np.block([[np.zeros((3, 3)), np.eye(3)], [-stiffness, -damping]])
    eigenpairs: Any = np.linalg.eig(state)
    mode = eigenpairs[1][:3, np.argmax(eigenpairs[0].imag)]
    unmoved = np.cross(mode.real, mode.imag)
    unmoved /= np.abs(unmoved).max()
    normal = unmoved + 1e-9 * mode.real / np.abs(mode).max()
    system = by_hand(np.eye(3), damping, stiffness, [normal], [unmoved + np.array([0.4, -0.3, 0.1])], 5.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = onsets(system, (0.0, 1.0), max_frequency_hz=2.0)
        modes = complex_modes(system, [0.0, 0.5, 1.0], count=3)
    assert (found.source, found.onsets, modes.source) == ("receptance", (), "receptance")
    for mu, row in zip(modes.mu, modes.eigenvalues, strict=True):
        truth = full_eigenvalues(system, float(mu))
        assert np.abs(row[:, None] - truth).min(axis=1).max() < 1e-12
