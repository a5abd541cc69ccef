"""The pass over modes against the scheme written down, and what is done about numbers too small for a processor."""

from __future__ import annotations

import numpy as np
import pytest

from marching import points_of
from stridor.kernels import denormals_flushed, njit
from stridor.kernels.denormals import KNOWN
from stridor.system import System
from stridor.temporal.aligned import LINE, aligned
from stridor.temporal.beta2 import scheme
from stridor.temporal.schedule import PhaseSpec
from stridor.temporal.simulate import Settings, simulate
from stridor.temporal.steppers.modal.layout import Fields, ModalRows
from stridor.temporal.steppers.modal.modal_path import modal_pass
from stridor.temporal.steppers.modal.operators import ModalArrays

TINY = np.finfo(float).tiny


@njit
def half(x):  # pragma: no cover - compiled
    return 0.5 * x


def passed(fields, modal, by, values, forces):
    """t_{n+1} and the prediction of t_{n+2}, the rows of that, and Σ c v² at t_n."""
    u, q, d, constant = fields
    d = d + modal.drive * (values.T @ forces)
    v = (q + 2 * by.beta2 / by.step * d) / by.s
    u, q = u + d, by.memory * q + by.gain * d
    d = modal.forward * q - modal.restore * u + constant
    return u, q, d, values @ (u + d), float(np.sum(modal.damping * v**2))


@pytest.mark.parametrize("beta2", [0.5, 0.8])
@pytest.mark.parametrize("count", range(7))
def test_every_number_of_rows_on_a_block(count: int, beta2: float) -> None:
    """Blocks of 32 and 16 modes; of the rows that meet the first one some carry no force, the last one has another."""
    rng = np.random.default_rng(count)
    n, by = 48, scheme(0.3, beta2)
    blocks = np.array([0, 32, 48])
    values = np.zeros((count + 2, n))
    values[:count, :32] = rng.standard_normal((count, 32))
    values[count, 32:] = rng.standard_normal(16)
    forces = np.append(rng.standard_normal(count + 1), 0.0)
    forces[1:2] = 0.0
    modal = ModalArrays(*(aligned(rng.uniform(0.1, 1.0, n)) for _ in range(5)), blocks)
    u, q, d, constant = (aligned(rng.standard_normal(n)) for _ in range(4))
    expected = passed((u, q, d, constant), modal, by, values, forces)
    rows = ModalRows(aligned(values), np.append(np.arange(count), count), np.array([0, count, count + 1]))
    predicted = rng.standard_normal(count + 2)
    lost = modal_pass(modal, by, rows, forces, Fields(u, q, d, constant, np.zeros(0), np.zeros(n)), predicted)
    for found, wanted in zip((u, q, d, predicted, lost), expected, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-13)


def test_a_copy_begins_with_a_line_of_the_cache() -> None:
    for size in range(1, 40):
        given = np.arange(3.0 * size).reshape(3, size)[:, ::-1]
        copy = aligned(given)
        assert np.array_equal(copy, given)
        assert copy.ctypes.data % (8 * LINE) == 0
        assert copy.flags.c_contiguous


def test_numbers_below_the_smallest_are_zero_inside_and_come_back_outside() -> None:
    expected = 0.0 if KNOWN else 0.5 * TINY
    assert half(TINY) == 0.5 * TINY
    with denormals_flushed():
        assert half(TINY) == expected
        with denormals_flushed():
            assert half(4 * TINY) == 2 * TINY
        assert half(TINY) == expected  # what was entered twice is left twice
    assert half(TINY) == 0.5 * TINY
    with pytest.raises(ZeroDivisionError), denormals_flushed():
        raise ZeroDivisionError
    assert half(TINY) == 0.5 * TINY


@pytest.mark.skipif(not KNOWN, reason="processors other than x86 are left as they are")
@pytest.mark.parametrize("path", ["modal", "nodal", "assembled"])
def test_a_motion_that_has_died_out_leaves_no_slow_numbers(path: str) -> None:
    """e^(−0.5 t) comes to the smallest number at t = 1416; from there on each step took thirty times as long."""
    system = System(np.eye(1), np.eye(1), np.eye(1), (), {"push": np.ones(1)}, points=points_of(1, mass=0))
    phases = [PhaseSpec("on", 1.0, {"push": 1.0}, {}), PhaseSpec("off", 1600.0, {"push": 0.0}, {})]
    settings = Settings(step=0.1, beta2=0.5, record_every=1, path=path, watch=("mass",))
    moved = simulate(system, phases, settings).displacement[:, 0, 0]
    assert np.abs(moved[:20]).max() > 0.1
    assert not np.any((moved != 0.0) & (np.abs(moved) < TINY))
    assert np.all(np.abs(moved[-100:]) < 1e-300)  # at rest, where what pulls it back is flushed
