"""Works and stored energies: each against a closed form, and the balance of all of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from benches import Slave, bench
from marching import block_on_belt, points_of, rod, run
from stridor.laws import Coulomb
from stridor.system import System
from stridor.temporal.energy import energy_balance
from stridor.temporal.schedule import PhaseSpec
from stridor.temporal.simulate import Settings, simulate

pytestmark = pytest.mark.verification

PATHS = ("modal", "nodal")


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize("mass", ["consistent", "lumped"])
@pytest.mark.parametrize("damping", [(50.0, 1e-8), (3e3, 1e-7)])
def test_balance_closes_to_rounding(path, sliding, mass, damping):
    """β2 = 1/2: impacts, stick, slip, separation, supports by ramp and suddenly, loads that change, two
    contacts."""
    system = bench(
        Slave(lean_deg=15.0, damping=damping), Slave(place=0.3, side=-1), mass=mass, damping=damping,
        velocity=1.0,
        angle_deg=0.0,
    )  # fmt: skip
    # Finite sliding finds its gap by itself.
    gap = 1e-6 if sliding == "small" else 0.0
    # A step as long as this follows springs of contacts only where normals stay.
    stiffness = 1e10 if sliding == "small" else np.inf
    contacts = (replace(c, sliding=sliding, gap=c.gap + gap, stiffness=stiffness) for c in system.contacts)
    system = replace(system, contacts=tuple(contacts))
    phases = [
        PhaseSpec("press", 3e-4, {"press1": 0.5}, {"clamp": 0.0}, 1e-4),
        PhaseSpec("slide", 4e-4, {"press0": 2.0}, {"clamp": 1.0}, 2e-4),
        PhaseSpec("back", 4e-4, {}, {"clamp": -1.5}),
    ]
    result = simulate(system, phases, Settings(record_every=7, path=path))
    balance = energy_balance(result)
    assert balance.error < 1e-11
    for name in ("external", "support", "damping", "friction", "contact"):
        assert np.abs(result.works[name]).max() > 1e-9 * max(
            np.abs(w).max() for w in result.works.values()
        ), name
    assert result.works["damping"][-1] > 0
    assert np.all(np.diff(result.works["damping"]) >= 0)
    statuses = set(np.unique(result.status))
    assert statuses == {0, 1, 2}


def test_numerical_damping_shows_in_the_balance():
    """β2 > 1/2 takes energy: the balance says how much."""
    system = bench(Slave())
    losses = [energy_balance(run(system, 1e-3, beta2=beta2)).error for beta2 in (0.5, 0.6, 1.0)]
    assert losses[0] < 1e-11
    assert 1e-4 < losses[1] < losses[2]
    # What is missing was lost, never won.
    missing = energy_balance(run(system, 1e-3, beta2=0.6)).history
    assert missing[-1] > 0


@pytest.mark.parametrize("path", PATHS)
def test_initial_energy(path):
    """½ v·M v + ½ u·K u of the start, up to the half step between them."""
    mass, stiffness = rod(1.0, 2.0, 3.0, 4.0, 5)
    size = 6
    u, v = np.linspace(0.0, 1.0, size) ** 2, np.linspace(1.0, -1.0, size)
    system = System(mass, 0 * mass, stiffness, points=points_of(size, end=5))
    result = run(system, 0.5, step=1e-4, path=path, start=(u, v, -np.linalg.solve(mass, stiffness @ u)))
    energy = 0.5 * v @ mass @ v + 0.5 * u @ stiffness @ u
    balance = energy_balance(result)
    assert balance.initial == pytest.approx(energy, rel=1e-3)
    assert result.kinetic[0] == pytest.approx(0.5 * v @ mass @ v, rel=2e-2)
    total = result.kinetic + result.elastic
    assert np.ptp(total) < 1e-12 * energy
    # Both parts are really exchanged.
    assert np.ptp(result.kinetic) > 0.1 * energy


@pytest.mark.parametrize("path", PATHS)
def test_damping_work(path):
    """A damper alone stops a mass: ½ m v² (1 − e^{−2ct/m})."""
    system = System(2 * np.eye(1), 0.5 * np.eye(1), np.zeros((1, 1)), points=points_of(1, mass=0))
    result = run(system, 4.0, step=1e-3, path=path, start=(0.0, 3.0, -0.75))
    expected = 0.5 * 2 * 9 * (1 - np.exp(-2 * 0.5 / 2 * result.time))
    assert np.abs(result.works["damping"] - expected).max() < 2e-3 * expected[-1]
    assert energy_balance(result).error < 1e-12


@pytest.mark.parametrize("path", PATHS)
def test_external_work(path):
    """A steady force on a free mass: F²t²/2m, all of it kinetic."""
    system = System(2 * np.eye(1), np.zeros((1, 1)), np.zeros((1, 1)), (), {"push": np.full(1, 3.0)})
    result = run(system, 4.0, step=1e-3, path=path)
    expected = 9 * result.time**2 / 4
    assert np.abs(result.works["external"] - expected).max() < 2e-3 * expected[-1]
    assert np.abs(result.kinetic - result.works["external"]).max() < 1e-12 * expected[-1]


@pytest.mark.parametrize("path", PATHS)
def test_impact_takes_the_kinetic_energy_of_a_point_mass(path):
    """A point mass does not rebound: the contact takes ½ m v²."""
    system = block_on_belt(press=0.0, law=Coulomb(0.0), preload=False)
    system = replace(system, contacts=(replace(system.contacts[0], gap=0.35),))
    result = run(system, 1.0, step=1e-3, path=path, start=(0.0, [0.0, -1.0], 0.0))
    assert result.works["contact"][-1] == pytest.approx(0.5, rel=1e-9)
    assert result.works["contact"][200] == 0.0
    assert result.kinetic[-1] == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("path", PATHS)
def test_friction_work_of_a_sliding_block(path):
    """A free block slides to rest: friction takes μN times the way, ½ m v² in all."""
    system = block_on_belt(stiffness=0.0, law=Coulomb(0.25), press=4.0)
    result = run(system, 3.0, step=1e-3, path=path, start=(0.0, [2.0, 0.0], [-1.0, 0.0]), watch=("block",))
    travelled = result.displacement[:, 0, 0]
    assert result.works["friction"][-1] == pytest.approx(0.5 * 4.0, rel=2e-3)
    assert np.abs(result.works["friction"] - travelled).max() < 2e-3 * 2.0  # μN = 1
    assert travelled[-1] == pytest.approx(2.0, rel=2e-3)
    assert result.works["contact"][-1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("path", PATHS)
def test_steady_sliding_power(path):
    """Support power = friction power μ N V, plus what the mass-proportional damping of the moving body
    takes, α m V²."""
    speed, mu = 0.5, 0.2
    system = bench(Slave(), velocity=speed, damping=(50.0, 0.0)).with_friction(mu, np.array([speed]))
    result = run(system, 4e-4, initial="steady-sliding", record_every=10, path=path)
    elapsed = result.time[-1] - result.time[0]
    won = {name: (work[-1] - work[0]) / elapsed for name, work in result.works.items()}
    assert won["friction"] == pytest.approx(mu * 20.0 * speed, rel=1e-6)
    drag = 50.0 * 7800.0 * 0.15 * 0.015 * 3e-3 * speed**2
    assert won["damping"] == pytest.approx(drag, rel=1e-6)
    assert won["support"] == pytest.approx(mu * 20.0 * speed + drag, rel=1e-6)
    assert won["external"] == pytest.approx(0.0, abs=1e-6)
    assert won["contact"] == pytest.approx(0.0, abs=1e-6)
    assert np.all(result.status == 2)


@pytest.mark.parametrize("path", PATHS)
def test_support_work_gives_a_free_body_its_kinetic_energy(path):
    """The clamp of an unloaded, undamped master brings it to speed by a ramp: ½ m V² when the vibration is
    slow to answer."""
    speed = 2.0
    system = bench(Slave(damping=(0.0, 0.0)), velocity=speed, damping=(0.0, 0.0))
    system = replace(system, contacts=())
    result = run(system, 5e-3, ramp=4e-3, loads={"press0": 0.0}, record_every=10, path=path)
    whole = 7800.0 * 0.15 * 0.015 * 3e-3
    assert result.works["support"][-1] == pytest.approx(0.5 * whole * speed**2, rel=2e-3)
    assert result.kinetic[-1] == pytest.approx(0.5 * whole * speed**2, rel=2e-3)
    assert energy_balance(result).error < 1e-11


def test_coulomb_decay_loses_what_friction_takes():
    """SDND100: potential energy lost between extrema is 4 μN × amplitude change."""
    system = block_on_belt(stiffness=1e4, law=Coulomb(0.1), press=10.0)
    result = run(
        system, 0.2, step=2e-6, record_every=10, start=([0.85e-3, 0.0], 0.0, [-7.5, 0.0]), watch=("block",)
    )
    lost = 0.5 * 1e4 * (0.85e-3**2 - 0.05e-3**2)
    assert result.works["friction"][-1] == pytest.approx(lost, rel=1e-3)
    way = (0.85 + 0.65 + 0.65 + 0.45 + 0.45 + 0.25 + 0.25 + 0.05) * 1e-3
    assert result.works["friction"][-1] == pytest.approx(1.0 * way, rel=1e-3)
    assert math.isclose(result.works["contact"][-1], 0.0, abs_tol=1e-15)
