"""Onsets against closed forms, the receptance curve computed independently, and growth rates."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg as sl
from scipy.optimize import minimize_scalar

from benches import Slave, bench, by_hand, full_eigenvalues, growing
from stridor.modal.complex_modes import complex_modes
from stridor.modal.onsets import onsets
from stridor.system import System

pytestmark = pytest.mark.verification


def hoffmann(c1: float = 0.0, c2: float = 0.0) -> System:
    """Hoffmann, Fischer, Allgaier, Gaul 2002, Mech. Res. Comm. 29:197; contact spring taken out of K."""
    stiffness = np.array([[2.0, 1.0], [1.0, 2.0 - 4 / 3]])
    first, second = np.array([1.0, 1.0]) / math.sqrt(2), np.array([1.0, -1.0]) / math.sqrt(2)
    damping = c1 * np.outer(first, first) + c2 * np.outer(second, second)
    # Force on the mass in x is +μ k3 y: N = −k3 y, so the push along x is −μ N.
    return by_hand(np.eye(2), damping, stiffness, [[0.0, 1.0]], [[1.0, 0.0]], 4 / 3, slip=1.0)


def test_mode_coupling_of_two_freedoms():
    found = onsets(hoffmann(), (0.0, 2.0), max_frequency_hz=1.0, damped=False).onsets
    assert [(o.kind, o.stabilising, o.branches) for o in found] == [("flutter", False, (1, 2))]
    assert found[0].mu == pytest.approx(0.75, rel=1e-12)
    assert 2 * np.pi * found[0].frequency_hz == pytest.approx(math.sqrt(2), rel=1e-12)
    # λ² = −2 ± √(1 − 4μ/3): growth opens as √((4/3)(μ − μc)) / (2√2).
    assert found[0].square_root_coefficient == pytest.approx(math.sqrt(4 / 3) / (2 * math.sqrt(2)), rel=1e-9)
    modes = complex_modes(hoffmann(), [0.5, 1.0], count=2, damped=False)
    np.testing.assert_allclose(modes.eigenvalues[0], [1.192749j, 1.605413j], atol=5e-7)
    np.testing.assert_allclose(
        modes.eigenvalues[1, np.argsort(-modes.growth_rate[1])],
        [0.202072 + 1.428577j, -0.202072 + 1.428577j],
        atol=1e-6,
    )


@pytest.mark.parametrize(
    ("c1", "c2", "mu"),
    [
        (0.02, 0.02, 0.750600),
        (0.02, 0.01, 0.728213),
        (0.1, 0.02, 0.643834),
        (0.02, 0.002, 0.547672),
        (0.1, 0.002, 0.326320),
    ],
)
def test_uneven_damping_destabilises(c1, c2, mu):
    found = onsets(hoffmann(c1, c2), (0.0, 1.0), max_frequency_hz=1.0).onsets
    assert len(found) == 1
    assert found[0].damped
    assert found[0].mu == pytest.approx(mu, abs=6e-7)


@dataclass(frozen=True)
class Hyperbolic:
    """μ(v) = factor / (1 + 3|v|)."""

    factor: float = 1.0

    @property
    def sticking(self) -> float:
        return self.factor

    def sliding(self, speed: float) -> float:
        return self.factor / (1 + 3 * abs(speed))

    def slope(self, speed: float) -> float:
        return -3 * self.factor / (1 + 3 * abs(speed)) ** 2

    def scaled(self, mu: float, speed: float):
        return Hyperbolic(mu * (1 + 3 * abs(speed)))


def belt(speed: float) -> System:
    """A mass on a belt: x along it, y pressed on it by N = 1."""
    return by_hand(
        np.eye(2), np.diag([0.1, 0.1]), np.diag([1.0, 50.0]), [[0, 1]], [[1, 0]], 1e6, slip=-speed,
        law=Hyperbolic(),
        loads={"weight": np.array([0.0, -1.0 - 50.0 / 1e6])},
    )  # fmt: skip


def test_weakening_friction_makes_sliding_unstable_below_a_speed():
    def growth(speed):
        mu = Hyperbolic().sliding(speed)
        return complex_modes(belt(speed), mu, count=1).growth_rate[0, 0]

    assert growth(1.0) == pytest.approx(0.04375, abs=1e-7)
    assert growth(1.492) > 0 > growth(1.493)
    low, high = 1.4, 1.6
    for _ in range(20):  # to 2e-7
        middle = (low + high) / 2
        low, high = (middle, high) if growth(middle) > 0 else (low, middle)
    assert low == pytest.approx(1.492409, abs=1e-6)


def test_divergence_of_a_known_system():
    """One freedom, contact along it, friction against it: k + K_c (1 − μ a) = 0."""
    k, contact, a = 3.0, 5.0, 2.0
    system = by_hand(np.eye(2), np.zeros((2, 2)), np.diag([k, 40.0]), [[1, 0]], [[-a, 0]], contact, slip=-1.0)
    mu = (1 + k / contact) / a
    for damped in (False, True):
        case = system if not damped else replace(system, damping=system.damping + 0.1 * system.mass)
        found = onsets(case, (0.0, 2.0), max_frequency_hz=2.0, damped=damped).onsets
        assert [o.kind for o in found] == ["divergence"]
        assert found[0].mu == pytest.approx(mu, rel=1e-11)
        assert found[0].frequency_hz == pytest.approx(0.0, abs=1e-9)
        if not damped:
            # λ² = K_c a (μ − μc)
            assert found[0].square_root_coefficient == pytest.approx(math.sqrt(contact * a), rel=1e-8)
    modes = complex_modes(system, [0.2, mu + 0.1], count=1, damped=False)
    assert modes.eigenvalues[1, 0] == pytest.approx(math.sqrt(contact * a * 0.1), rel=1e-9)


# -- the receptance curve, from dense direct solves ----------------------------------------------------------


class Curve:
    """μ(ω) = −s (1/K_c + G_nn)/G_nt of an undamped system with one contact, its local extrema in a band.

    Receptances by dense solves of (K − ω²M) x = n; eigenvalues of the structure only divide the band.
    """

    def __init__(self, system: System) -> None:
        contact = system.contacts[0]
        self.normal, self.tangent = contact.normal_row, contact.tangent_row
        self.sense, self.compliance = -np.sign(contact.tangent_lift.sum()), contact.compliance
        self.mass, self.stiffness = system.mass.toarray(), system.stiffness.toarray()

    def __call__(self, omega: float) -> float:
        dynamic = self.stiffness - omega**2 * self.mass
        factor = sl.lu_factor(dynamic)
        x = sl.lu_solve(factor, self.normal)
        x = x + sl.lu_solve(factor, self.normal - dynamic @ x)
        return float(-self.sense * (self.compliance + self.normal @ x) / (self.tangent @ x))

    def inverse(self, omega: float) -> float:
        return 1.0 / self(omega)

    def extrema(self, limit: float, top: float) -> list[tuple[float, float]]:
        """(μ, ω) of the local extrema of μ(ω) with 0 < μ ≤ top, found on a fine grid and refined."""
        poles = np.sqrt(np.maximum(sl.eigvalsh(self.stiffness, self.mass), 0))
        edges = np.concatenate([[1.0], poles[(poles > 1) & (poles < limit)], [limit]])
        spread = (1 - np.cos(np.linspace(0, np.pi, 300)[1:-1])) / 2
        omega = np.unique(np.concatenate([a + (b - a) * spread for a, b in pairwise(edges)]))
        values = np.array([self(w) for w in omega])
        found = []
        for k in range(1, len(omega) - 1):
            a, b, c = values[k - 1 : k + 2]
            if (b - a) * (b - c) > 0 and 0 < b <= top and abs(c - a) < 0.5 * top and min(a, c) > -0.2:
                sign = 1 if b > a else -1
                best = minimize_scalar(
                    lambda w, sign=sign: -sign * self(w), bounds=(omega[k - 1], omega[k + 1]),
                    method="bounded",
                    options={"xatol": 1e-9 * omega[k]},
                )  # fmt: skip
                # A pole of 1/G_nt looks like an extremum on a grid; the curve is not flat there.
                w = best.x
                h = 1e-5 * w
                if abs(self(w + h) - self(w - h)) < 1e-3 * abs(self(w)):
                    found.append((self(w), w))
        return found


def random_bench(seed: int) -> System:
    rng = np.random.default_rng(seed)
    slave = Slave(
        place=float(rng.uniform(0.3, 0.95)), lean_deg=float(rng.uniform(3, 15)),
        length=float(rng.uniform(0.04, 0.08)),
        elements=4, stiffness=float(10 ** rng.uniform(6, 10)),
    )  # fmt: skip
    return bench(slave, elements=7).undamped()


# Growth that begins and ends again, once within a thousandth of μ.
BUBBLE = Slave(place=0.5032441, lean_deg=10.178183, length=0.07440715, elements=4, stiffness=2.69258829e9)


@pytest.mark.parametrize("system", [
    random_bench(0), *(pytest.param(random_bench(k), marks=pytest.mark.slow) for k in range(1, 5)),
    bench(BUBBLE, elements=7).undamped(),
], ids=[*map(str, range(5)), "bubble"])  # fmt: skip
def test_onsets_are_the_extrema_of_the_receptance_curve(system):
    limit, top = 2 * np.pi * 30e3, 1.5
    reference = [(m, w) for m, w in Curve(system).extrema(limit, top) if m < 0.999 * top]
    found = onsets(replace(system, loads={}), (0.0, top), max_frequency_hz=30e3, damped=False).onsets
    flutter = [o for o in found if o.kind == "flutter"]
    assert all(o.residual < 1e-10 for o in found)
    curve = Curve(system)
    for o in flutter:
        # Each is a point of the curve to 1e-10, and a local extremum.
        omega = 2 * np.pi * o.frequency_hz
        assert curve(omega) == pytest.approx(o.mu, rel=1e-10)
        # λ leaves ω_c as j κ √: the curve bends by (ω − ω_c)²/κ².
        h = 1e-3 * o.square_root_coefficient * math.sqrt(o.mu)
        sides = [curve(omega + k * h) - o.mu for k in (-1, 1)]
        assert np.sign(sides[0]) == np.sign(sides[1]) == (1 if o.stabilising else -1)
        np.testing.assert_allclose(np.abs(sides), (h / o.square_root_coefficient) ** 2, rtol=0.3)
    # And none that the fine grid shows is missing.
    for mu, omega in reference:
        near = [o for o in flutter if 2 * np.pi * o.frequency_hz == pytest.approx(omega, rel=1e-4)]
        assert any(o.mu == pytest.approx(mu, rel=1e-10) for o in near), (mu, omega)
    assert len(reference) > 0


@pytest.mark.parametrize("damped", [False, True])
def test_paper_like_bench_against_counts_of_unstable_modes(damped):
    """Between neighbouring onsets nothing may change; at each, one mode starts or stops to grow."""
    system = bench(Slave(lean_deg=9, damping=(50, 1e-7)), elements=10)
    answer = onsets(system, (0.0, 0.9), max_frequency_hz=30e3, damped=damped)
    assert len(answer.onsets) >= 3
    case = system if damped else system.undamped()
    edges = [0.0, *(o.mu for o in answer.onsets), 0.9]
    expected = 0
    for k, (low, high) in enumerate(pairwise(edges)):
        if high - low > 1e-5:
            for part in (0.02, 0.5, 0.98):
                values = growing(full_eigenvalues(case, low + part * (high - low)), 1e-8)
                # A guard band: an onset just above the band may be for a mode that sinks into it.
                sure = [np.sum(values.imag < 2 * np.pi * f) for f in (28e3, 32e3)]
                assert sure[0] <= expected <= sure[1]
        if k < len(answer.onsets):
            expected += -1 if answer.onsets[k].stabilising else 1


def growth_near(system: System, mu: float, omega: float) -> float:
    dense = full_eigenvalues(system, mu)
    near = dense[np.abs(dense.imag - omega) < 0.05 * omega]
    return float(near.real.max())


def test_growth_opens_with_the_square_root():
    system = bench(Slave(lean_deg=12)).undamped()
    for o in onsets(system, (0.0, 1.0), max_frequency_hz=20e3, damped=False).onsets:
        sign = -1 if o.stabilising else 1
        ratios = []
        for step in (1e-3 * o.mu, 0.25e-3 * o.mu):
            growth = growth_near(system, o.mu + sign * step, 2 * np.pi * o.frequency_hz)
            ratios.append(growth / math.sqrt(step) / o.square_root_coefficient)
        assert ratios[1] == pytest.approx(1, abs=2e-3)
        assert abs(ratios[1] - 1) < abs(ratios[0] - 1) + 1e-3


def test_slope_of_a_damped_onset():
    system = bench(Slave(lean_deg=12, damping=(100.0, 3e-7)))
    found = onsets(system, (0.0, 1.0), max_frequency_hz=20e3).onsets
    assert found
    for o in found:
        omega = 2 * np.pi * o.frequency_hz
        h = 1e-6 * o.mu
        rise = [growth_near(system, o.mu + k * h, omega) for k in (-1, 1)]
        assert (rise[1] - rise[0]) / (2 * h) == pytest.approx(o.growth_slope, rel=2e-2)
        assert min(abs(full_eigenvalues(system, o.mu) - 1j * omega)) < 1e-6 * omega


def test_damping_moves_the_exceptional_point_off_the_real_axis():
    system = bench(Slave(lean_deg=12, damping=(200.0, 5e-7)))
    for o in onsets(system, (0.0, 1.0), max_frequency_hz=20e3).onsets:
        if o.exceptional_mu is None:
            continue
        values = full_eigenvalues(system, o.exceptional_mu)
        near = values[np.argsort(np.abs(values - 2j * np.pi * o.frequency_hz))[:2]]
        # Rounding of a double root: the square root of the machine's, times the condition of the pencil.
        assert abs(near[0] - near[1]) < 1e-3 * abs(near[0])


def test_restabilisation_is_found():
    """Growth of a pair that ends again at a higher μ: just below it grows, just above it does not."""
    case = bench(Slave(place=0.8, lean_deg=25.0, end="clamped", length=0.06)).undamped()
    ended = [o for o in onsets(case, (0.0, 1.5), max_frequency_hz=30e3).onsets if o.stabilising]
    assert len(ended) == 3
    for o in ended:
        omega = 2 * np.pi * o.frequency_hz
        assert growth_near(case, o.mu * (1 - 1e-4), omega) > 1e-5 * omega
        assert growth_near(case, o.mu * (1 + 1e-4), omega) < 1e-6 * omega


def test_a_growing_real_root_that_returns_to_zero_is_a_stabilising_divergence():
    case = bench(Slave(place=0.8, lean_deg=25.0, end="clamped", length=0.06)).undamped()
    found = [o for o in onsets(case, (0.0, 3.0), max_frequency_hz=30e3).onsets if o.kind == "divergence"]
    assert [(o.stabilising, o.frequency_hz) for o in found] == [(True, 0.0)]
    contact = case.contacts[0]
    push = contact.normal_row + found[0].mu * contact.tangent_row  # the sense is +1 here
    tangent = case.stiffness.toarray() + contact.stiffness * np.outer(push, contact.normal_row)
    assert np.linalg.cond(tangent) > 1e14


def test_damped_divergence_lies_where_the_static_curve_says():
    """At λ = 0 damping has no say: μ = −s (1/K_c + nᵀK⁻¹n)/(tᵀK⁻¹n). Real roots are many and close here."""
    slave = Slave(
        place=0.48315768, lean_deg=52.019316, length=0.069784677, thickness=0.56564614e-3, elements=6,
        damping=(1.3155991, 3.5922711e-7), stiffness=1e5, end="clamped", young_modulus=3.8224144e9,
    )  # fmt: skip
    system = replace(bench(slave, angle_deg=-175.10909, elements=5), loads={})
    contact = system.contacts[0]
    answer = np.linalg.solve(system.stiffness.toarray(), contact.normal_row)
    static = -(contact.compliance + contact.normal_row @ answer) / (contact.tangent_row @ answer)
    static *= -np.sign(contact.tangent_lift.sum())
    for damped in (False, True):
        found = onsets(system, (0.0, 3.0), max_frequency_hz=40e3, damped=damped).onsets
        divergence = [o.mu for o in found if o.kind == "divergence"]
        assert divergence == [pytest.approx(static, rel=1e-9)]


def test_two_contacts():
    """No curve here; the determinant's double roots against bisection on dense growth."""
    slaves = Slave(place=0.5, lean_deg=10), Slave(place=0.85, lean_deg=18, length=0.06)
    system = bench(*slaves, elements=8).undamped()
    found = onsets(system, (0.0, 0.6), max_frequency_hz=25e3, damped=False).onsets
    assert found
    for o in found:
        omega = 2 * np.pi * o.frequency_hz
        low, high = o.mu * (1 - 1e-4), o.mu * (1 + 1e-4)
        grows = [growth_near(system, m, omega) > 1e-6 * omega for m in (low, high)]
        assert grows == ([True, False] if o.stabilising else [False, True])
