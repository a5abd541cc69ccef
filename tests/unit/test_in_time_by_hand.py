"""What stands around the time loop, by hand: spectra of known signals, matrices in bands and blocks, limits of the step,
saved states that are damaged, and the words of what is refused."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp

from stridor.contact.obstacles import Cylinder
from stridor.errors import AnalysisError, CaseError
from stridor.laws import Coulomb, Tabulated, Weakening
from stridor.laws.friction import friction_rows
from stridor.laws.packed import HEAD
from stridor.system import System
from stridor.temporal import attractor, beta2, inputs, restart, saved, settings, signals, sketch
from stridor.temporal.beta2 import StepLimit, scheme
from stridor.temporal.energy import EnergyBalance
from stridor.temporal.growth import growth
from stridor.temporal.schedule import PhaseSpec, lay_out
from stridor.temporal.settings import Settings
from stridor.temporal.sketch import SketchPart
from stridor.temporal.steppers.modal import ModalStepper, start
from stridor.temporal.steppers.sparse import damping, limit, renewal, step_matrix, storage
from stridor.temporal.steppers.sparse import machine as assembled_machine
from stridor.temporal.steppers.sparse.bends import TURN, Turning
from stridor.temporal.steppers.sparse.node_table import sliding_directions

# What NumPy warns of is a fault here, whatever comes of it.
pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")

# -- signals -----------------------------------------------------------------------------------------------------------


def test_a_sine_in_the_middle_of_a_bin_peaks_at_its_amplitude() -> None:
    n, dt = 400, 1e-3
    time = np.arange(n) * dt
    signal = 5.0 + 3.0 * np.cos(2 * np.pi * 50.0 * time + 0.4) + 0.2 * np.cos(2 * np.pi * 120.0 * time)
    for window, width in (("hann", 2.0), ("boxcar", 1.21), ("flattop", 4.59), ("hamming", 2.0)):
        spec = signals.spectrum(signal, dt, window=window)
        assert (spec.window, spec.resolution_hz) == (window, pytest.approx(2.5))
        assert spec.bandwidth_hz == pytest.approx(2.5 * width)
        assert spec.frequency_hz == pytest.approx(2.5 * np.arange(201))
        assert spec.amplitude[[20, 48]] == pytest.approx([3.0, 0.2], rel=2e-2)
        assert spec.amplitude[0] == pytest.approx(0.0, abs=1e-2)
        assert spec.peak() == pytest.approx((50.0, 3.0), rel=2e-2)
        assert spec.peak(above_hz=60.0) == pytest.approx((120.0, 0.2), rel=2e-2)
        assert spec.peak(above_hz=500.0) == (0.0, 0.0)
    silence = signals.spectrum(np.full(n, 2.0), dt)
    assert silence.peak() == (0.0, 0.0)
    assert signals.spectrum(signal, dt).window == "hann"


def test_lines_between_bins_are_found_by_a_parabola_of_logarithms() -> None:
    frequency = 10.0 * np.arange(8)
    bell = np.exp(-0.5 * ((frequency - 33.0) / 12.0) ** 2)  # a parabola, exactly
    assert signals._interpolated(frequency, bell, 3) == pytest.approx(33.0, rel=1e-12)
    assert signals._interpolated(frequency, bell, 4) == pytest.approx(33.0, rel=1e-12)
    # At the ends, beside silence, and where it is no peak, the bin itself.
    for k, given in ((0, bell), (7, bell), (3, bell * (np.arange(8) != 2)), (3, 1 / bell), (3, np.ones(8))):
        assert signals._interpolated(frequency, given, k) == frequency[k]
    assert signals._interpolated(frequency[:3], bell[2:5], 1) == pytest.approx(13.0)


def test_short_spectra_are_told_at_the_middle_of_their_pieces() -> None:
    dt, n = 1e-3, 1000
    time = np.arange(n) * dt
    loud = np.where(time < 0.5, 1.0, 4.0)
    found = signals.spectrogram(7.0 + loud * np.sin(2 * np.pi * 100.0 * time), dt, resolution_hz=10.0)
    assert found.resolution_hz == pytest.approx(10.0)
    assert found.frequency_hz == pytest.approx(10.0 * np.arange(51))
    assert found.time == pytest.approx(0.05 + 0.025 * np.arange(37))  # pieces of 100, three quarters in common
    assert found.amplitude.shape == (51, 37)
    line = found.amplitude[10]
    assert line[found.time < 0.45] == pytest.approx(1.0, rel=1e-6)
    assert line[found.time > 0.55] == pytest.approx(4.0, rel=1e-6)
    assert found.amplitude[0] == pytest.approx(np.zeros(37), abs=1.0)
    # Not finer than sixteen samples, nor coarser than the whole.
    assert signals.spectrogram(loud[:200], dt, resolution_hz=500.0).resolution_hz == pytest.approx(1 / 16e-3)
    assert signals.spectrogram(loud[:200], dt, resolution_hz=1.0).time == pytest.approx([0.1])


def test_an_envelope_has_the_amplitude_at_its_times() -> None:
    dt, f = 1e-4, 500.0
    time = np.arange(20_000) * dt
    at, size = signals.envelope(2.0 + 0.5 * np.exp(-3 * time) * np.cos(2 * np.pi * f * time), dt, f)
    # Twenty periods are 400 samples; a tenth of that from value to value.
    assert at[0] == pytest.approx(0.02, abs=1e-9)
    assert np.diff(at) == pytest.approx(np.full(len(at) - 1, 40 * dt))
    assert at[-1] > 2.0 - 0.02 - 41 * dt
    assert size == pytest.approx(0.5 * np.exp(-3 * at), rel=5e-3)
    at, _ = signals.envelope(np.cos(time[:90] * 2 * np.pi * f), dt, f)
    assert at[0] == pytest.approx(15 * dt)  # a third of a short one
    at, _ = signals.envelope(np.cos(time[:12] * 5e3), dt, 5e3)
    assert at[0] == pytest.approx(4 * dt)  # and eight at least


def test_nothing_grows_where_there_is_no_line_or_no_signal() -> None:
    signal = np.cos(np.arange(1000.0))
    for given, frequency in ((signal, 0.0), (signal, -1.0), (signal[:31], 100.0)):
        found = growth(given, 1e-3, frequency)
        assert (found.rate, found.start, found.spread, found.saturated, found.amplitude) == (0.0, 0.0, 0.0, False, 0.0)
        assert found.end == pytest.approx(1e-3 * len(given))
    assert growth(signal[:32], 1e-3, 100.0).amplitude > 0


def test_a_fall_is_fitted_from_its_highest_point() -> None:
    dt, f = 1e-5, 1000.0
    time = np.arange(40_000) * dt
    size = np.where(time < 0.1, 1.0, np.exp(-20.0 * (time - 0.1)))
    found = growth(size * np.cos(2 * np.pi * f * time), dt, f)
    assert found.end == pytest.approx(0.39, abs=0.003)
    assert not found.saturated
    decay = growth(np.exp(-20 * time) * np.cos(2 * np.pi * f * time), dt, f)
    assert decay.rate == pytest.approx(-20.0, rel=1e-3)
    assert decay.spread < 1e-2
    assert decay.amplitude == pytest.approx(np.exp(-20 * (0.01 + 0.38 * 7 / 8)), rel=0.05)


def test_components_are_those_of_the_band_in_order_of_strength() -> None:
    dt = 1e-5
    time = np.arange(6000) * dt
    parts = [(-30.0, 900.0, 1.0), (20.0, 1700.0, 0.2), (-5.0, 2500.0, 3e-2), (0.0, 2900.0, 2e-4), (0.0, 6000.0, 5.0)]
    signal = sum(a * np.exp(s * time) * np.cos(2 * np.pi * f * time + f) for s, f, a in parts)
    found = signals.components(signal, dt, max_frequency_hz=3000.0)
    expected = [complex(s, 2 * np.pi * f) for s, f, _ in parts[:3]]
    assert found.eigenvalues == pytest.approx(expected, abs=0.5)
    assert found.fastest == pytest.approx(expected[1], abs=0.5)
    for (s, _, a), amplitude in zip(parts, found.amplitudes, strict=False):
        assert amplitude == pytest.approx(0.5 * a * math.exp(s * 0.03), rel=0.1)
    for nothing in (signal[:63], np.zeros(1000)):
        none = signals.components(nothing, dt, max_frequency_hz=3000.0)
        assert len(none.eigenvalues) == len(none.amplitudes) == 0
        assert none.fastest == 0j
    # Sixteen samples of the band, of 68 of which every third is taken behind the filter, are the fewest that tell.
    short = np.cos(2 * np.pi * 0.09 * np.arange(68))
    assert len(signals.components(short, 1.0, max_frequency_hz=0.12).eigenvalues) >= 1
    assert len(signals.components(short[:67], 1.0, max_frequency_hz=0.12).eigenvalues) == 0
    # What turns less than twice in the whole signal is left out.
    slow = np.cos(2 * np.pi * 1.8 / 0.06 * time) + np.cos(2 * np.pi * 1000.0 * time)
    assert signals.components(slow, dt, max_frequency_hz=3000.0).eigenvalues.imag == pytest.approx([2000 * np.pi], rel=1e-3)


def test_peaks_are_those_of_stretches_that_begin_and_end() -> None:
    force = np.array([0, 5, 9, 1, 0, 7, 0, 0, 8, 6, 0.0])  # mean 3.3
    assert attractor._peaks(force).tolist() == [9, 7, 8]
    assert attractor._peaks(force[1:]).tolist() == [7, 8]  # begins above
    assert attractor._peaks(force[:-1]).tolist() == [9, 7]  # ends above
    assert attractor._peaks(np.ones(5)).tolist() == []


# -- operators ---------------------------------------------------------------------------------------------------------


def test_laws_are_rows_of_one_width() -> None:
    laws = [Coulomb(0.3), Tabulated((0.0, 1.0, 2.0), (0.5, 0.3, 0.4)), Weakening(0.2, 0.5, 0.1)]
    table = friction_rows(laws)
    assert table.shape == (3, HEAD + 9)
    for row, law in zip(table, laws, strict=True):
        assert tuple(row[: len(law.numbers)]) == law.numbers
        assert not row[len(law.numbers) :].any()
    assert friction_rows([]).shape == (0, HEAD)


def random_structure(rng, n: int, width: int) -> System:
    def band(positive: float) -> np.ndarray:
        matrix = np.triu(np.tril(rng.normal(size=(n, n)), width), -width)
        return matrix @ matrix.T + positive * np.eye(n)

    return System(band(1.0), 0.3 * band(0.5), 100 * band(0.0))


def lower_of(factor: np.ndarray) -> np.ndarray:
    n, width = factor.shape
    return np.eye(n) + sum((np.diag(factor[: n - k, k], -k) for k in range(1, width)), np.zeros((n, n)))


@pytest.mark.parametrize("n", [1, 5, 12])
def test_the_band_factor_is_that_of_the_matrix(n: int) -> None:
    rng = np.random.default_rng(1)
    system = random_structure(rng, n, min(2, n - 1))
    factor = step_matrix.band_factor(sp.csr_array(system.mass))
    lower = lower_of(factor)
    assert lower @ np.diag(1 / factor[:, 0]) @ lower.T == pytest.approx(system.mass.toarray(), rel=1e-10, abs=1e-12)
    assert factor.shape[1] == 1 + max(abs(i - j) for i, j in zip(*np.nonzero(system.mass.toarray()), strict=True))
    right = rng.normal(size=n)
    solved = right.copy()
    step_matrix.band_solve(factor, solved)
    assert system.mass @ solved == pytest.approx(right, rel=1e-9, abs=1e-12)
    with pytest.raises(AnalysisError, match=r"^the mass matrix is not positive definite: a freedom has stiffness but no mass$"):
        step_matrix.band_factor(sp.csr_array(-system.mass))


@pytest.mark.parametrize("b2", [0.5, 0.8])
@pytest.mark.parametrize("damped", [False, True])
def test_the_step_matrix_is_that_of_the_scheme(b2: float, damped: bool) -> None:
    rng = np.random.default_rng(2)
    n = 7  # of which blocks of two leave one entry without a freedom
    system = random_structure(rng, n, 2)
    system = system if damped else System(system.mass, np.zeros((n, n)), system.stiffness)
    dt = 0.01
    given = scheme(dt, b2)
    assert given == (dt, b2, 1 + 2 * b2, (2 * b2 - 1) / (1 + 2 * b2), 2 / ((1 + 2 * b2) * dt))
    layout = storage.lay_out_freedoms(system, width=2)
    assert (layout.width, layout.size) == (2, 8)
    matrix, answers = step_matrix.step_matrix(system, given, layout)
    M, C = system.mass.toarray(), system.damping.toarray()
    lower = lower_of(matrix.factor)
    whole = lower @ np.diag(1 / matrix.factor[:, 0]) @ lower.T
    assert whole[np.ix_(layout.index, layout.index)] == pytest.approx(M + b2 * dt * C)
    assert len(matrix.drag) == (layout.size if damped else 0)
    rows = rng.normal(size=(3, n))
    moved = answers(layout.rows(sp.csr_array(rows))).toarray()
    assert moved[:, layout.index] == pytest.approx(dt**2 * (1 + 2 * b2) / 2 * np.linalg.solve(M + b2 * dt * C, rows.T).T)
    assert moved[:, np.setdiff1d(np.arange(8), layout.index)] == pytest.approx(0.0)
    assert not step_matrix.is_diagonal(system.mass)
    assert step_matrix.is_diagonal(sp.csr_array(np.diag([1.0, 2.0]) + 1e-15), 1e-14)
    assert not step_matrix.is_diagonal(sp.csr_array(np.diag([1.0, 2.0]) + 1e-15))


# -- limits of the step ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("b2", [0.5, 0.7, 1.0])
@pytest.mark.parametrize("lag", [0.0, 1e-4, 3e-3])
def test_the_limit_with_lagged_damping_is_that_of_its_equation(b2: float, lag: float) -> None:
    """ω²Δt² + rΔt/β2 = 2/β2 of the mode that gives the least Δt; r = β ω² where damping is a share of the stiffness."""
    rng = np.random.default_rng(3)
    for n, alike in itertools.product((1, 6, 61), (False, True)):
        K = rng.normal(size=(n, n))
        K = K @ K.T
        square = float(np.linalg.eigvalsh(K)[-1])
        step, omega, vector = limit._part_limit(sp.csr_array(K), sp.csr_array(lag * K), b2, alike=alike)
        room = 1.01 if n > 60 else 1.0
        assert step**2 * square * room**2 + lag * square * room**2 * step / b2 == pytest.approx(2 / b2, rel=3e-3 if n > 60 else 1e-6)
        assert omega == pytest.approx(math.sqrt(square) * room, rel=2e-3)
        assert np.linalg.norm(K @ vector - square * vector) < (0.2 if n > 60 else 1e-6) * square
    # Lagged damping alone: rΔt = 2. Nothing at all: no limit.
    step, omega, _ = limit._part_limit(sp.csr_array((1, 1)), sp.csr_array(np.array([[4.0]])), b2, alike=False)
    assert (step, omega) == (pytest.approx(0.5), 0.0)
    assert limit._part_limit(sp.csr_array((2, 2)), sp.csr_array((2, 2)), b2, alike=True)[:2] == (math.inf, 0.0)


def test_the_body_that_sets_the_limit_is_named() -> None:
    K = np.diag([1.0, 4.0, 9.0])
    bodies = tuple(SimpleNamespace(name=n, freedoms=np.array([k]), cells={"hexahedron": 0}) for k, n in enumerate(["a", "b"]))
    system = System(np.diag([1.0, 1.0, 0.25]), np.zeros((3, 3)), K, solids=bodies)
    found = limit.step_limit_assembled(system, 0.5)
    assert found == StepLimit(pytest.approx(2 / 6), pytest.approx(6.0), "the system", 0.9, None)
    found = limit.step_limit_assembled(System(np.diag([1.0, 0.1, 1.0]), np.zeros((3, 3)), K, solids=bodies), 0.8)
    assert found.body == "b"
    assert found.step == pytest.approx(math.sqrt(2 / 0.8) / math.sqrt(40.0))
    with pytest.raises(AnalysisError, match="a freedom has stiffness but no mass"):
        limit.step_limit_assembled(System(np.diag([1.0, 0.0, 1.0]), np.zeros((3, 3)), K), 0.5)


@pytest.mark.parametrize(
    ("lines", "cells", "size", "share", "asked"),
    [  # asked: where modes are looked at up to a tenth of the highest
        ((), ({"vertex"}, {"vertex"}), 60, 0.0393, 0.393), ((), ({"vertex"},), 61, 0.9, 0.393), ((), (), 10, 0.0393, 0.393),
        ((1,), ({"vertex"},), 10, 0.9, 0.9), ((), ({"vertex"}, {"vertex", "line"}), 10, 0.9, 0.9),
    ],
)  # fmt: skip
def test_masses_and_matrices_take_a_step_that_resolves_them(lines, cells, size: int, share: float, asked: float) -> None:
    solids = [SimpleNamespace(cells=dict.fromkeys(kinds)) for kinds in cells]
    found = StepLimit(1e-3, 2e3, "m").of(SimpleNamespace(lines=lines, solids=solids, size=size))  # type: ignore[arg-type]
    mesh = asked == 0.9
    steps = [found.usual(highest) for highest in (None, 200 / (2 * math.pi), 1e9, 1e-9)]
    assert steps == pytest.approx([share * 1e-3, asked * 1e-3, 0.9e-3 if mesh else 0.0393e-3, 0.9e-3])


def test_the_courant_limit_is_that_of_the_fastest_part() -> None:
    line = SimpleNamespace(name="beam", freedoms=np.array([2, 3]))
    K = sl.block_diag([[4.0]], [[9.0]], 100 * np.array([[2.0, -1], [-1, 2]]))
    system = System(np.eye(4), np.zeros((4, 4)), K, lines=(line,))
    found = beta2.step_limit(system, 0.8)
    assert found.omega_max == pytest.approx(math.sqrt(300))
    assert found.step == pytest.approx(math.sqrt(2 / 0.8) / math.sqrt(300))
    assert found.body == "beam"
    slower = beta2.step_limit(replace(system, mass=sp.csr_array(np.diag([1.0, 1e-3, 1, 1]))), 0.5)
    assert (slower.body, slower.omega_max) == ("the system", pytest.approx(math.sqrt(9e3)))
    free = beta2.step_limit(System(np.eye(1), np.zeros((1, 1)), np.zeros((1, 1))), 0.5)
    assert (free.step, free.omega_max) == (math.inf, 0.0)


def test_a_step_is_chosen_within_the_limit() -> None:
    found = StepLimit(1e-3, 2e3, "beam", 0.9)
    assert settings.choose_step(found, Settings()) == pytest.approx(0.9e-3)
    assert settings.choose_step(found, Settings(step=1e-3)) == 1e-3
    with pytest.raises(CaseError, match=r"unstable beyond 0\.001 s, set by beam; take a smaller"):
        settings.choose_step(found, Settings(step=1.001e-3))
    with pytest.raises(CaseError, match="nothing in the system oscillates, so no step follows; give one"):
        settings.choose_step(StepLimit(math.inf, 0.0, "x"), Settings())
    assert settings.choose_step(StepLimit(math.inf, 0.0, "x"), Settings(step=3.0)) == 3.0
    said = settings.not_finite(0.25, "press", 1e-6)
    assert said.startswith("the motion is no longer finite at t = 0.25 s (phase press): a negative stiffness")
    assert "the step 1e-06 s is too large" in said


# -- storage -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("width", [1, 2, 3])
def test_blocks_of_consecutive_freedoms_are_the_cheapest_there_are(width: int) -> None:
    rng = np.random.default_rng(4)
    n = 6 * 5
    small = rng.random((n // width, n // width)) < 0.1
    pattern = np.kron(small | small.T | np.eye(n // width, dtype=bool), np.ones((width, width)))
    assert storage._cheapest_width(sp.csr_array(pattern)) == width
    cost = []
    for w in (1, 2, 3):
        size = -(-n // w)
        met = {(i // w, j // w) for i, j in zip(*np.nonzero(pattern), strict=True) if i <= j}
        assert size > 0
        cost.append(len(met) * (8 * w**2 + 4))
    assert int(np.argmin(cost)) + 1 == width


def test_freedoms_are_laid_out_once_each_and_rows_go_with_them() -> None:
    rng = np.random.default_rng(5)
    n = 11
    system = random_structure(rng, n, 2)
    layout = storage.lay_out_freedoms(system)
    assert len(set(layout.index.tolist())) == n
    assert layout.size == layout.stride * layout.blocks
    assert layout.index.max() < layout.size
    assert (layout.index % layout.stride < layout.width).all()
    values, rows = rng.normal(size=(2, n)), rng.normal(size=(3, n))
    spread = layout.spread(values)
    assert spread[:, layout.index] == pytest.approx(values)
    assert np.count_nonzero(spread) == 2 * n
    assert layout.rows(sp.csr_array(rows)).toarray() @ spread[0] == pytest.approx(rows @ values[0])
    stored = storage.upper_blocks(system.stiffness, layout)
    w, full = layout.width, np.zeros((layout.size, layout.size))
    for row in range(layout.blocks):
        columns = stored.col[stored.ptr[row] : stored.ptr[row + 1]]
        assert columns[0] == row
        assert list(columns) == sorted(set(columns.tolist()))
        for at, column in enumerate(columns, start=stored.ptr[row]):
            block = stored.val[at].reshape(w, w)
            i, j = row * layout.stride, column * layout.stride
            full[i : i + w, j : j + w] = block
            full[j : j + w, i : i + w] = block.T
    assert full[np.ix_(layout.index, layout.index)] == pytest.approx(system.stiffness.toarray())
    assert not stored.val[-1].any()
    assert stored.ptr[-1] == len(stored.val) - 1


def test_freedoms_of_a_node_lie_together_where_they_are_its_own_alone() -> None:
    # Node 0 moves by freedoms 4 and 1; node 1 follows 4 in part and 3 at another scale; node 2 is held along x.
    rows = np.zeros((6, 6))
    rows[0, 4] = rows[1, 1] = rows[5, 2] = 1.0
    rows[2, 4], rows[2, 0], rows[3, 3] = 1.0, 0.5, 2.0
    solid = SimpleNamespace(points=np.zeros((3, 2)), rows=SimpleNamespace(free=sp.csr_array(rows)))
    again = SimpleNamespace(points=np.zeros((1, 2)), rows=SimpleNamespace(free=sp.csr_array(np.eye(6)[[1, 5]])))
    system: Any = SimpleNamespace(size=6, solids=(solid, again))
    group, inside, width = storage._groups(system, sp.csr_array((6, 6)))
    assert width == 2
    assert list(zip(group.tolist(), inside.tolist(), strict=True)) == [(3, 0), (0, 1), (1, 1), (3, 1), (0, 0), (2, 1)]
    # Bodies in space beside bodies in the plane make blocks of three, and what no body has comes last.
    block = SimpleNamespace(points=np.zeros((1, 3)), rows=SimpleNamespace(free=sp.csr_array(np.eye(12)[[6, 7, 8]])))
    plane = SimpleNamespace(points=np.zeros((1, 2)), rows=SimpleNamespace(free=sp.csr_array(np.eye(12)[[0, 1]])))
    system = SimpleNamespace(size=12, solids=(block, plane))
    group, inside, width = storage._groups(system, sp.csr_array((12, 12)))
    assert width == 3
    assert group.tolist() == [1, 1, 2, 2, 2, 3, 0, 0, 0, 3, 3, 4]
    assert inside.tolist() == [0, 1, 0, 1, 2, 0, 0, 1, 2, 1, 2, 0]


def test_two_threads_share_the_blocks_of_large_structures_alone() -> None:
    ptr = np.array([0, 3, 5, 6, 8, 10])
    col = np.array([0, 1, 3, 1, 2, 2, 3, 4, 4, 4])
    matrix = storage.Blocks(ptr, col, np.zeros((11, 1)))
    assert list(storage.parts([matrix], 19_999)) == [5, 5]
    assert list(storage.parts([matrix], 20_000)) == [2, 4]  # rows 0 and 1 hold half of what there is, and reach to 3
    further = storage.Blocks(ptr, np.where(col == 3, 4, col), np.zeros((11, 1)))
    assert list(storage.parts([matrix, further], 20_000)) == [2, 5]
    own = storage.Blocks(ptr, np.repeat(np.arange(5), np.diff(ptr)), np.zeros((11, 1)))
    assert list(storage.parts([own], 20_000)) == [2, 2]


@pytest.mark.parametrize("size", [1.0, 1e9])
def test_shares_of_the_stiffness_are_told_from_dashpots_to_ten_digits(size: float) -> None:
    K = size * np.array([[2.0, -1, 0], [-1, 3, -1], [0, -1, 2]])
    for off, shares in ((0.3e-10, True), (3e-10, False)):
        C = 1e-4 * K
        C[0, 1] *= 1 + off
        C[1, 0] = C[0, 1]
        found = damping.split_damping(System(np.eye(3), C, K))
        assert (found.factor is not None) is shares
        assert found.lagged
        assert np.diag(found.diagonal) + found.rest.toarray() == pytest.approx(C, rel=1e-9)
        assert (found.diagonal >= 0).all()


def test_energies_at_the_start_are_those_that_works_are_counted_from(monkeypatch) -> None:
    """Of cubic springs ¼ k₃ l⁴, their length from the freedoms and from the supports."""
    monkeypatch.setattr(assembled_machine, "stored_energies", lambda structure, fields: (7.0, 11.0))
    springs = SimpleNamespace(
        coefficient=np.array([3.0, 5.0]),
        rows=SimpleNamespace(free=sp.csr_array(np.array([[1.0, 0], [1, -1]])), lift=np.array([[0.0], [2.0]])),
    )  # fmt: skip
    for cubic in (None, springs):
        machine: Any = object.__new__(assembled_machine.Machine)
        machine.system = SimpleNamespace(cubic=cubic)
        machine.structure, machine.fields = None, SimpleNamespace(u=np.array([9.0, 0.5, 9.0, 0.25]))
        machine.layout = SimpleNamespace(index=np.array([1, 3]))
        machine.state = SimpleNamespace(
            reference=np.zeros(2), works=np.zeros(assembled_machine.LOOP_WORKS), motion=np.array([[0.1], [4.0]])
        )
        machine.mark_start()
        assert machine.state.reference.tolist() == [11.0, 0.0]
        expected = np.zeros(assembled_machine.LOOP_WORKS)
        if cubic is not None:
            expected[assembled_machine.CUBIC] = 0.25 * (3 * 0.5**4 + 5 * 0.45**4)
        assert machine.state.works == pytest.approx(expected)


# -- sliding far -------------------------------------------------------------------------------------------------------


def surface(position, area=1.0, sliding="finite", master=None) -> Any:
    return SimpleNamespace(
        slave_position=np.array(position, dtype=float), area=np.array([area]), sliding=sliding, master=master
    )


def test_nodes_are_as_far_apart_as_most_of_them() -> None:
    system: Any = SimpleNamespace(surfaces=[
        surface([[0, 0], [1, 0], [3, 0], [6, 0], [10, 0]]), surface([[1, 2]], 0.3), surface([[1, 2, 3]], 0.09),
        surface([[1, 2]], 1.0, master=Cylinder(np.zeros(2), 0.07)),
    ])  # fmt: skip
    assert renewal.node_distances(system) == pytest.approx([2.0, 0.3, 0.3, 0.07])


def test_rows_are_renewed_before_a_node_has_slid_a_thousandth_of_their_distance() -> None:
    # Nodes: one point contact, two of a surface that slides far, one of a surface that does not.
    speeds = np.array([9.0, 0.3, -0.5, 7.0])
    machine: Any = SimpleNamespace(
        nodes=SimpleNamespace(
            tangent=np.diag([1.0, 1, 1, 1]), tangent_lift=np.array([[0.0], [0.1], [0], [0]]), count=4,
            owner=np.array([0, 1, 1, 2]),
        ),
        fields=SimpleNamespace(q=speeds), layout=SimpleNamespace(index=np.arange(4)),
        state=SimpleNamespace(motion=np.array([[5.0], [-4.0]])), scheme=SimpleNamespace(step=1e-4),
        system=SimpleNamespace(contacts=(1,), surfaces=[surface([[0, 0]]), surface([[0, 0]], sliding="small")]),
        turning=Turning(np.zeros((4, 1, 1)), np.zeros((4, 1)), sp.csr_array((4, 4)), np.zeros((4, 1)), np.zeros((4, 1))),
    )  # fmt: skip
    steps = renewal.steps_to_renewal(machine, np.array([4.2, 1e-9]), 150)
    assert steps == int(1e-3 * 4.2 / (0.5 * 1e-4)) == 84
    assert renewal.steps_to_renewal(machine, np.array([4.2, 1.0]), 30) == 60  # twice as many as the last time
    assert renewal.steps_to_renewal(machine, np.array([42.0, 1.0]), 150) == 200
    assert renewal.steps_to_renewal(machine, np.array([1e-9, 1.0]), 150) == 1
    # Nor has its normal turned by more than that on a curve, where an obstacle has no distance between nodes.
    machine.turning.rate[:, 0, 0] = [99.0, 30.0, -8.0, 99.0]
    assert renewal.steps_to_renewal(machine, np.array([42.0, 1.0]), 150) == int(TURN / (8.0 * 0.5 * 1e-4))
    machine.system.surfaces[0].master = Cylinder(np.zeros(2), 1 / 8)
    assert renewal.steps_to_renewal(machine, np.array([1e-9, 1.0]), 150) == int(TURN / (8.0 * 0.5 * 1e-4))
    # As a master turns itself, 2 rad/s with its speeds and 1 against them with its support, and one that only sticks.
    tilt, lift = sp.csr_array(([-4.0], ([2], [2])), shape=(4, 4)), np.zeros((4, 1))
    lift[2, 0] = 0.25
    machine.turning = replace(machine.turning, tilt=tilt, tilt_lift=lift)
    assert renewal.steps_to_renewal(machine, np.array([42.0, 1.0]), 150) == int(TURN / ((4.0 + 2.0 - 1.0) * 1e-4))
    machine.turning = replace(machine.turning, rate=np.zeros((4, 1, 1)), tilt=10 * tilt)
    machine.fields.q, machine.state.motion = np.array([0.0, 0.0, -0.5, 0.0]), np.zeros((2, 1))
    machine.nodes.tangent = np.zeros((4, 4))
    assert renewal.steps_to_renewal(machine, np.array([42.0, 1.0]), 150) == int(TURN / (20.0 * 1e-4))
    machine.fields.q = 0 * speeds
    machine.state.motion = np.zeros((2, 1))
    assert renewal.steps_to_renewal(machine, np.array([1e-9, 1.0]), 90) == 180


def test_directions_of_sliding_are_those_of_the_supports() -> None:
    lift = np.array([[3.0, 0], [4.0, 0], [0, 0], [0, 0], [3.0, 1], [0, 1], [1e-13, 0], [0, 0]])
    nodes: Any = SimpleNamespace(
        count=4, directions=2, area=np.array([1.0, 1.0, np.nan, 1.0]), slip_velocity=lambda f: (lift @ f).reshape(4, 2)
    )
    found = sliding_directions(nodes, np.array([-1.0, 0.0]))
    assert found == pytest.approx(np.array([[-0.6, -0.8], [1, 0], [1, 0], [1, 0]]))
    assert sliding_directions(nodes, np.zeros(2)) == pytest.approx(np.tile([1.0, 0], (4, 1)))


# -- phases ------------------------------------------------------------------------------------------------------------


def test_phases_in_steps() -> None:
    phases = [
        PhaseSpec("press", 1.0, {"P": 2.0}, {}, 0.5), PhaseSpec("slide", 0.26, {}, {"belt": 3.0}),
        PhaseSpec("short", 0.01, {"Q": 0.5}, {}), PhaseSpec("last", 1.0, {"P": 0.0}, {"belt": 0.0}, 0.3),
    ]  # fmt: skip
    schedule = lay_out(phases, 0.1, ["P", "Q"], ["belt"])
    assert [(s.first, s.last) for s in schedule.stretches] == [(0, 10), (10, 13), (13, 14), (14, 23)]
    assert schedule.steps == 23
    assert [s.ramp_steps for s in schedule.stretches] == pytest.approx([5, 0, 0, 3])
    assert [s.loads_after.tolist() for s in schedule.stretches] == [[2, 1], [2, 1], [2, 0.5], [0, 0.5]]
    assert [s.loads_before.tolist() for s in schedule.stretches] == [[0, 0], [2, 1], [2, 1], [2, 0.5]]
    assert [s.velocities_after.tolist() for s in schedule.stretches] == [[1], [3], [3], [0]]
    assert [schedule.stretch_at(k).name for k in (0, 9, 10, 12, 13, 14, 22, 23, 99)] == [
        "press", "press", "slide", "slide", "short", "last", "last", "last", "last",
    ]  # fmt: skip
    x = np.clip(np.arange(10) / 5, 0, 1)
    blend = 10 * x**3 - 15 * x**4 + 6 * x**5
    assert schedule.load_factors(0, 10) == pytest.approx(np.outer(blend, [2.0, 1.0]))
    assert schedule.load_factors(8, 7)[:, 1] == pytest.approx([1, 1, 1, 1, 1, 0.5, 0.5])
    whole = schedule.motion_increments(0, 30)[:, 0]
    assert whole[5:10] == pytest.approx(0.1)
    assert whole[10:14] == pytest.approx(0.3)
    assert whole[17:] == pytest.approx(0.0, abs=1e-15)
    # Half of what a ramp lasts is gone in it.
    assert whole[:5].sum() == pytest.approx(0.25)
    assert whole[14:17].sum() == pytest.approx(0.45)
    assert np.concatenate([schedule.motion_increments(k, 1)[:, 0] for k in range(30)]) == pytest.approx(whole, abs=1e-15)


def balance(error: float, records: int = 2) -> EnergyBalance:
    return EnergyBalance(
        1, 2, 3, 4, 5, 6, 7, 8, error, np.full(records, error), circulatory=9.0, turnover=1.0, vibration=0.5
    )


def test_the_energy_balance_in_words() -> None:
    assert balance(1e-6).closes
    assert balance(1e-6).words(0.5) == "energy balance closes to 1.0e-06 of the energy turned over, 2.0e-06 of that of the vibration"
    assert not balance(1.01e-6).closes
    missing = "energy balance does not close: 2.0e-02 of the energy turned over is missing, 4.0e-02 of that of the vibration"
    assert balance(2e-2).words(0.5) == missing
    assert balance(2e-2).words(0.6) == f"{missing}, the numerical damping of beta2 = 0.6 in it"
    assert balance(0.0, 1).words(0.5) == (
        "energy balance not checked, as there is one record; a smaller temporal.record_every gives more"
    )
    assert "as there is no record;" in balance(0.0, 0).words(0.5)
    assert not balance(0.0, 1).closes
    assert balance(math.nan).words(0.5) == "energy balance does not close: energies are not finite"
    plain = balance(0.5).to_json()
    assert [plain[k] for k in ("kinetic", "elastic", "external", "support", "damping", "friction", "contact", "initial")] == [
        1, 2, 3, 4, 5, 6, 7, 8,
    ]  # fmt: skip
    assert (plain["circulatory"], plain["error"], plain["closes"], plain["checked"]) == (9.0, 0.5, False, True)
    assert "gyroscopic" not in plain


# -- what is refused ---------------------------------------------------------------------------------------------------


def problems(phases, **changes) -> list[str]:
    motion = SimpleNamespace(names=("belt", "supports.jaw.distance"), full_distance=np.array([0.0, 1.0]))
    system: Any = SimpleNamespace(points={"tip": 0, "foot": 0}, loads={"P": 0}, motion=motion)
    given: dict[str, Any] = {"step": None, "beta2": 0.5, "record_every": 1, "watch": ()} | changes
    try:
        inputs.check_inputs(system, phases, **given)
    except CaseError as error:
        return str(error).splitlines()
    return []


def test_inputs_are_refused_each_with_what_is_accepted() -> None:
    good = PhaseSpec("a", 1.0, {"P": 2.0}, {"belt": -1.0}, 0.0, {"jaw": 0.5})
    assert problems([good]) == []
    assert problems([good], step=1e-9, beta2=1.0, watch=("foot", "tip")) == []
    for changes, words in (
        ({"step": 0.0}, "a time step is a number > 0 [s]"), ({"step": math.inf}, "a time step is a number > 0 [s]"),
        ({"beta2": 0.499}, "beta2 lies in [0.5, 1]"), ({"beta2": 1.001}, "beta2 lies in [0.5, 1]"),
        ({"record_every": 0}, "the steps between records are an integer ≥ 1"),
        ({"watch": ("tip", "top")}, "no such point; the system has: tip, foot"),
    ):  # fmt: skip
        assert len(problems([good], **changes)) == 1
        assert words in problems([good], **changes)[0]
    assert "temporal.watch.1" in problems([good], watch=("tip", "top"))[0]
    assert "at least one phase is needed" in problems([])[0]
    for phase, where, words in (
        (replace(good, duration=0.0), "phases.1.duration", "a duration is a number > 0 [s]"),
        (replace(good, duration=math.inf), "phases.1.duration", "a duration is a number > 0 [s]"),
        (replace(good, ramp=-1e-9), "phases.1.ramp", "a ramp is a number ≥ 0 [s]; 0 is sudden"),
        (replace(good, ramp=math.nan), "phases.1.ramp", "a ramp is a number ≥ 0 [s]; 0 is sudden"),
        (replace(good, loads={"R": 1.0}), "phases.1.loads.R", "no such load; there are: P"),
        (replace(good, loads={"P": math.nan}), "phases.1.loads.P", "a factor is a finite number"),
        (replace(good, velocities={"jaw": 1.0}), "phases.1.velocities.jaw", "no such moving support; there are: belt"),
        (replace(good, displacements={"belt": 1.0}), "phases.1.displacements.belt",
         "no such support or contact with a distance; there are: jaw"),
    ):  # fmt: skip
        (said,) = problems([good, phase])
        assert where in said
        assert words in said
    assert len(problems([replace(good, duration=0.0, ramp=-1.0)], beta2=2.0, step=-1.0)) >= 4


def general(**changes) -> Any:
    motion = SimpleNamespace(names=("belt",), lift=np.zeros((3, 1)))
    skew = np.array([[2.0, 1, 0], [-1, 2, 0], [0, 0, 1]])
    given = {
        "mass": np.diag([1.0, 2, 3]), "stiffness": sp.csr_array(skew), "damping": sp.csr_array((3, 3)), "motion": motion,
        "components": [np.array([0, 1]), np.array([2])], "symmetric_definite": False,
    } | changes  # fmt: skip
    return SimpleNamespace(**given)


def test_unsymmetric_matrices_that_time_does_not_take_are_told() -> None:
    assert inputs.unfit_in_time(general()) == ""
    mass = np.diag([1.0, 2, 3])
    mass[0, 1] = mass[1, 0] = 2e-14
    assert inputs.unfit_in_time(general(mass=mass)) == ""
    mass[0, 1] = mass[1, 0] = 4e-14
    assert inputs.unfit_in_time(general(mass=mass)).startswith("the mass matrix is not diagonal, and beside unsymmetric")
    mass[0, 1] = 0.5
    assert inputs.unfit_in_time(general(mass=mass)).startswith("the mass matrix is not symmetric, and the time loop needs")
    assert inputs.unfit_in_time(general(mass=np.diag([1.0, 0, 3]))).startswith("1 freedom has no mass, and the time loop")
    assert inputs.unfit_in_time(general(mass=np.diag([1.0, 0, -3]))).startswith("1 freedom has a negative mass, and")
    for freedom, told in ((0, True), (1, True), (2, False)):
        lift = np.zeros((3, 1))
        lift[freedom] = 1.0
        said = inputs.unfit_in_time(general(motion=SimpleNamespace(names=("belt",), lift=lift)))
        assert said.startswith("support belt moves matrices that are not symmetric") is told


def state_of(**changes) -> dict[str, Any]:
    return {"state_a": np.array([1, 2]), "field_b": np.array([[0.5, -0.5]])} | changes


WANTED = {"state_a": np.zeros(2, dtype=np.int64), "field_b": np.zeros((1, 2))}
BOUNDS = {"state_a": (0, np.array([1, 3])), "field_b": (-0.5, 0.5)}


def test_a_saved_state_is_looked_through() -> None:
    saved.check_arrays(state_of(), WANTED, BOUNDS)
    mend = "the saved state is damaged; start the run anew"
    for changes, words in (
        ({"field_b": np.zeros((2, 1))}, "a state of the same model: this one has other freedoms or contacts"),
        ({"state_a": np.array([1.0, 2.0])}, f"holds float64; must hold whole numbers: {mend}"),
        ({"field_b": np.array([[1, 0]])}, f"holds int64; must hold floating-point numbers: {mend}"),
        ({"field_b": np.array([[0.0, np.nan]])}, f"holds values that are not finite: {mend}"),
        ({"state_a": np.array([2, 2])}, f"holds values from 2 to 2, which is out of range: {mend}"),
        ({"state_a": np.array([-1, 2])}, f"holds values from -1 to 2, which is out of range: {mend}"),
        ({"field_b": np.array([[0.5, -0.51]])}, f"holds values from -0.51 to 0.5, which is out of range: {mend}"),
    ):
        with pytest.raises(CaseError) as caught:
            saved.check_arrays(state_of(**changes), WANTED, BOUNDS)
        assert words in str(caught.value)
    with pytest.raises(CaseError, match=f"missing – {mend}"):
        saved.check_arrays({"state_a": np.array([1, 2])}, WANTED, BOUNDS)
    saved.check_done({"n": np.array([5, 7])}, "n", 1, 7)
    with pytest.raises(CaseError, match="counts 7 steps where the run has 8"):
        saved.check_done({"n": np.array([5, 7])}, "n", 1, 8)
    own = np.array([1.0, 2.0])
    assert saved.agrees({"s": [1.0, 2.0]}, "s", own)
    assert saved.agrees({"s": [1, 2, 9]}, "s", own, first=2)
    assert saved.agrees({"s": [1.0, 2.001]}, "s", own, relative=1e-3)
    for held in ([1.0, 2.0, 3.0], [1.0], [[1.0, 2.0]], [1.0, 2.0 + 1e-12], ["1", "2"], []):
        assert not saved.agrees({"s": held}, "s", own)
    assert not saved.agrees({}, "s", own)


def test_sketches_tell_models_apart_beyond_rounding() -> None:
    rng = np.random.default_rng(6)
    for scale in (1.0, 1e-8, 1e9):
        part = SketchPart("mass", scale * rng.normal(size=3), 4 * scale)
        for off, same in ((3.9e-9, True), (4.1e-9, False)):
            other = part.row.copy()
            other[1] += off * scale
            assert part.same(other) is same
        assert not part.same(part.row * (1 + 1e-6))
    parts = [SketchPart("a", np.array([1.0, 2.0]), 2.0), SketchPart("b", np.array([3.0]), 3.0), SketchPart("c", np.zeros(0), 0.0)]
    saved_as = sketch.packed(parts)
    assert saved_as.tolist() == [1, 2, 2, 3, 3, 0]
    assert sketch.differing(parts, saved_as) == []
    assert sketch.saved_row(parts, saved_as, "a").tolist() == [1, 2]
    assert sketch.saved_row(parts, saved_as, "b").tolist() == [3]
    with pytest.raises(KeyError):
        sketch.saved_row(parts, saved_as, "d")
    for at, name in ((1, "a"), (3, "b"), (5, "c")):
        other = saved_as.copy()
        other[at] += 1e-3
        assert [p.name for p in sketch.differing(parts, other) or ()] == [name]
    for wrong in (saved_as[:-1], saved_as.astype(int), np.where(np.arange(6) == 2, np.nan, saved_as)):
        assert sketch.differing(parts, wrong) is None


# -- going on from a run -----------------------------------------------------------------------------------------------


def run_before(**changes) -> Any:
    state = {"settings": np.array([1e-6, 0.5, 50.0]), "model": np.array([1.0, 2.0]), "counters": np.array([7])}
    given = {"path": "assembled", "state": state, "step": 2e-6, "beta2": 0.6, "record_every": 50, "watch_names": ("tip",), "steps": 7}
    return SimpleNamespace(**(given | changes))


def refused_by(path: str, before: Any, *, step=1e-6, b2=0.5, every=50, watch=("tip",), join=True) -> str:
    """What is said of a state, "" where it is taken; the stepper has no arrays and no parts of its own."""
    stepper: Any = SimpleNamespace(
        scheme=scheme(step, b2), path=path, parts=[SketchPart("mass", np.array([1.0]), 2.0)], check=lambda restart: None,
        state=dict, bounds=dict, counted=("counters", 0),
    )  # fmt: skip
    try:
        restart.check_restart(stepper, before, Settings(record_every=every, watch=watch), join=join, changed=False)
    except CaseError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("march", ["assembled", "modal", "nodal"])
def test_a_state_of_another_scheme_or_record_is_refused(march: str) -> None:
    own = {"path": march}
    assert refused_by(march, run_before(**own)) == ""
    other = "nodal" if march != "nodal" else "modal"
    for before, named in (
        (run_before(path=other), {}), (run_before(**own), {"step": 1.1e-6}), (run_before(**own), {"b2": 0.7}),
        (run_before(**own, state={}), {}),
    ):  # fmt: skip
        said = refused_by(march, before, **named)
        assert f"restart: 'step 2e-06 s, beta2 0.6, path {before.path}' – a state of the same scheme: step " in said
        assert said.endswith(f"{named.get('step', 1e-6):g} s, beta2 {named.get('b2', 0.5):g}, path {march}")
    for before, named, words in (
        (run_before(**own), {"every": 20}, "'a record every 50 steps of tip' – the same records as before (here every 20 steps of tip), or join=False"),
        (run_before(**own, watch_names=()), {}, "'a record every 50 steps of no points' – the same records as before (here every 50 steps of tip), or join=False"),
        (run_before(**own), {"watch": ()}, "'a record every 50 steps of tip' – the same records as before (here every 50 steps of no points), or join=False"),
        (run_before(**own, watch_names=("a", "b")), {"watch": ("a", "c")}, "'a record every 50 steps of a, b' – the same records as before (here every 50 steps of a, c), or join=False"),
    ):  # fmt: skip
        assert words in refused_by(march, before, **named)
        assert refused_by(march, before, join=False, **named) == ""


def test_another_model_is_refused_by_its_parts() -> None:
    parts = [SketchPart("mass", np.array([1.0]), 1.0), SketchPart("load P", np.array([2.0]), 2.0)]
    before: Any = SimpleNamespace(state={"model": sketch.packed(parts)})
    restart._check_model(parts, before, changed=False)
    others = [replace(parts[0], numbers=np.array([1.1])), replace(parts[1], numbers=np.array([2.5]))]
    with pytest.raises(CaseError, match=r"a state of the same model; these differ: mass; load P$"):
        restart._check_model(others, before, changed=False)
    restart._check_model(others, before, changed=True)
    for changed in (False, True):
        with pytest.raises(CaseError, match="a state of the same model: this one has other freedoms, loads or contacts"):
            restart._check_model(parts[:1], before, changed=changed)


def test_supports_may_change_their_speed_and_not_their_direction() -> None:
    def parts_of(*numbers) -> list[SketchPart]:
        return [SketchPart("mass", np.array([1.0]), 1.0)] + [
            SketchPart(f"{sketch.MOTION} {name}", np.array(n), float(np.abs(n).sum()), sketch.SOLVED)
            for name, n in zip(("belt", "jaw"), numbers, strict=True)
        ]

    before: Any = SimpleNamespace(state={"model": sketch.packed(parts_of([3.0, 4.0], [1.0, 0.0]))})
    for now, ratio in (([3.0, 4.0], 1.0), ([6.0, 8.0], 2.0), ([-1.5, -2.0], -0.5), ([3.0, 4.0 + 1e-6], 1.0)):
        assert restart.motion_ratio(parts_of(now, [1.0, 0.0]), before, ("belt", "jaw")) == pytest.approx([ratio, 1.0], rel=1e-6)
    for now in ([4.0, 3.0], [6.0, 8.1]):
        with pytest.raises(CaseError, match=r"^restart: 'supports.belt' – the same direction: the way that it has gone so far"):
            restart.motion_ratio(parts_of(now, [1.0, 0.0]), before, ("belt", "jaw"))


def test_bounds_of_a_state_are_those_of_its_arrays() -> None:
    contacts = SimpleNamespace(kind=np.array([0, 1]), nodes_at=np.array([0, 4, 10]))
    machine: Any = SimpleNamespace(
        table=SimpleNamespace(contacts=contacts), contacts=2, table_values=np.zeros((9, 3)),
        state=SimpleNamespace(segment=np.array([1, 2])),
    )  # fmt: skip
    stepper: Any = SimpleNamespace(machine=machine)
    found = ModalStepper.bounds(stepper)
    # A contact that does not slide far stays in its segment; six nodes make segments 0 to 4.
    assert [list(x) for x in found["state_segment"]] == [[0, 0], [1, 4]]
    assert found["state_active"] == (0, 8)
    assert list(found["state_counters"][1]) == [math.inf, math.inf, math.inf, 1]
    assert found["state_statistics"] == (-1.0, math.inf)
    assert found["state_status"] == (0, 2)


@pytest.mark.parametrize("b2", [0.5, 0.8])
def test_forcing_of_the_first_step_has_the_accelerations_of_the_supports(b2: float) -> None:
    """a = 2 (d/Δt − q)/(Δt s) and v = (q + 2β2 d/Δt)/s of what is prescribed; at a speed that stays no acceleration."""
    phases = [PhaseSpec("slide", 1.0, {"P": 2.0}, {"belt": 3.0}, 0.4)]
    schedule = lay_out(phases, 0.1, ["P"], ["belt"])
    given = scheme(0.1, b2)
    for done, before in ((2, 0.5), (7, 3.0), (7, 3.0 * (1 + 1e-15)), (0, 0.0)):
        state = SimpleNamespace(counters=np.array([done]), motion=np.array([[9.0], [before]]))
        load, minus_a, minus_v = start.coefficients(SimpleNamespace(scheme=given, state=state), schedule)  # type: ignore[arg-type]
        rate = schedule.motion_increments(done, 1)[0, 0] / 0.1
        assert load == pytest.approx(schedule.load_factors(done, 1)[0, 0])
        assert minus_a == pytest.approx(-2 * (rate - before) / (0.1 * given.s) if done < 7 else 0.0, abs=0 if done == 7 else 1e-12)
        assert minus_v == pytest.approx(-(before + 2 * b2 * rate) / given.s)
