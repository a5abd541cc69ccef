"""Shapes at eigenvalues that are poles of the receptance: the mode itself, without a word from NumPy."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

from benches import paper_case
from stridor.modal.backward_error import BackwardError
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
