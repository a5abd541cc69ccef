"""The same question put to large models: the fastest-growing modes started in time, and what becomes of them.

Thousands of modes below the frequency limit cannot all be told apart in one signal, so the run starts from steady
sliding with the few modes that the modal approach says grow fastest (or decay slowest), in equal measure. The time
scheme knows nothing of eigenvalues: if they were wrong, the motion would take on other frequencies and rates.
In space Coulomb friction turns with the slip velocity, which damps motion across the direction of sliding; the
modes are taken with this friction-induced damping, since the temporal approach has it by nature.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import AnalysisError
from ..modal.complex_modes import ComplexModes
from ..modal.options import Options
from ..modal.over_friction import modes_of_band
from ..sliding import full_motion
from ..system import System
from ..temporal.observe import Snapshots
from ..temporal.schedule import PhaseSpec
from ..temporal.settings import Settings, choose_step
from ..temporal.signals import components
from ..temporal.simulate import simulate
from ..temporal.steppers.sparse import step_limit_assembled
from ..temporal.trajectory import Trajectory
from ..typing import Array, IntArray
from .shapes import component_shape, snapshots_of
from .small_motion import LINEAR, PERTURBATION, Perturbation, whole

STARTED = 3  # modes
PERIODS = 40  # of the slowest of them
SAMPLES = 16  # per period of the fastest of them


def turns(system: System) -> bool:
    """Whether the modes need friction damping to be those of the model that the time loop marches: in space Coulomb
    friction turns with the slip velocity, which damps motion across the direction of sliding."""
    return system.assembled and system.dimension == 3


def modes_as_in_time(system: System, mu: float, max_frequency_hz: float) -> ComplexModes:
    """Modes with right vectors, of the very model that the time loop marches."""
    options = Options(friction_damping=turns(system))
    return modes_of_band(system, mu, max_frequency_hz, vectors="right", options=options)


def perturb_assembled(
    system: System,
    mu: float,
    *,
    settings: Settings,
    max_frequency_hz: float,
    duration: float | None = None,
    modes: ComplexModes | None = None,
    shape: bool = False,
) -> Perturbation:
    """March the modes that should grow fastest from steady sliding; λ of what does. Raises as `perturb` does."""
    nodes = system.contact_nodes()
    slip = nodes.slip_velocity(full_motion(system))
    speed = float(np.linalg.norm(slip, axis=1).max(initial=0.0))
    if speed == 0.0:
        raise AnalysisError("a perturbation of steady sliding needs contacts that slide")
    found = modes_as_in_time(system, mu, max_frequency_hz) if modes is None else modes
    chosen = _fastest(found, max_frequency_hz)
    if not len(chosen):
        raise AnalysisError(f"no mode vibrates below {max_frequency_hz:g} Hz, so there is nothing to perturb with")
    assert found.right is not None, "asked for with vectors"
    lam, vectors = found.eigenvalues[0, chosen], found.right[0, chosen]
    total = np.zeros((3, system.size))
    largest, leader = 0.0, 0
    for number, (value, vector) in enumerate(zip(lam, vectors, strict=True)):
        motion = np.linalg.norm(np.abs(value * (nodes.tangent @ vector)).reshape(slip.shape), axis=1)
        peak = float(motion.max())
        if peak == 0.0:
            continue
        if peak > largest:
            largest, leader = peak, int(np.argmax(motion))
        # Phases spread by the golden angle, so that nothing adds up at the start.
        scaled = vector / peak * np.exp(2.399963j * number)
        total += np.real([scaled, value * scaled, value**2 * scaled])
    total *= PERTURBATION * speed / len(chosen)
    run, seen = _march(system, mu, settings, lam, duration, (total[0], total[1], total[2]), shape)
    signal, sampling, until = _signal(run, leader, slip[leader], speed)
    band = components(signal, sampling, max_frequency_hz=max_frequency_hz)
    moved = None
    if seen is not None:
        time, motion = seen.until(until)
        moved = component_shape(seen.rows, time, motion, band.eigenvalues, band.fastest, max_frequency_hz)
    return Perturbation(mu, band.fastest, signal, sampling, band, moved)


def _fastest(modes: ComplexModes, max_frequency_hz: float) -> IntArray:
    """Columns of the modes that grow fastest, vibrating and within the limit."""
    inside = np.flatnonzero((modes.frequency_hz[0] > 0) & (modes.frequency_hz[0] <= max_frequency_hz))
    order = np.argsort(modes.growth_rate[0][inside])[::-1]
    return inside[order[:STARTED]]


def _march(
    system: System,
    mu: float,
    settings: Settings,
    lam: Array,
    duration: float | None,
    disturbance: tuple[Array, Array, Array],
    shape: bool,
) -> tuple[Trajectory, Snapshots | None]:
    """The run, and where shapes are wanted the motion of nodes."""
    slowest, fastest = float(np.abs(lam.imag).min()), float(np.abs(lam.imag).max())
    step = settings.step
    if step is None:
        step = choose_step(step_limit_assembled(system, settings.beta2), settings)
    every = max(1, int(2 * np.pi / fastest / SAMPLES / step))
    start = replace(
        settings, step=step, initial="steady-sliding", perturbation=0.0, watch=(), record_every=every
    )
    length = duration or PERIODS * 2 * np.pi / slowest
    seen = snapshots_of(system, round(length / step), step, fastest / (2 * np.pi)) if shape else None
    loads = system.load_steps[-1].loads if system.load_steps else {}
    motion = system.motion
    factors = zip(motion.names, full_motion(system).tolist(), motion.places, strict=True)
    velocities = {name: factor for name, factor, place in factors if not place}
    phase = PhaseSpec("perturbed", length, loads, velocities)
    run = simulate(system, [phase], start, mu=mu, disturbance=disturbance, observe=seen)
    return whole(run), seen


def _signal(run: Trajectory, node: int, steady: Array, speed: float) -> tuple[Array, float, float]:
    """Slip of one node along its steady direction, less the steady part, while it is small; its sampling [s], which is
    coarser than that of the run where many nodes are kept, and until when it is small [s]."""
    assert run.nodes is not None, "assembled runs keep node histories"
    size = float(np.linalg.norm(steady))
    direction = steady / size if size > 0 else np.eye(len(steady))[0]
    signal = run.nodes.slip_velocity[:, node] @ direction - size
    over = np.flatnonzero(np.abs(signal) > LINEAR * speed)
    last = int(over[0]) if len(over) else len(signal)
    time = run.nodes.time
    sampling = float(time[1] - time[0]) if len(time) > 1 else run.sampling
    return signal[min(last // 8, 4) : last], sampling, (last - 1) * sampling
