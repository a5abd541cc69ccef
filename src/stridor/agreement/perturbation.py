"""Small perturbations of steady sliding, marched in time.

The run starts from steady sliding with modes in equal measure: all of the band where one signal can tell them apart;
where there are many, or where contacts have many nodes, of which some hardly press and leave the linear range before
others, the few that the modal approach says grow fastest (or decay slowest). A lining on a disc whose eight modes of
the band all took part showed a growth 17 % off in time, with three 0.06 %. The time scheme knows nothing of
eigenvalues: if they were wrong, the motion would take on other frequencies and rates.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from ..contact.interface import Rows
from ..contact.nodes import ContactNodes
from ..errors import AnalysisError
from ..modal.complex_modes import ComplexModes
from ..modal.options import Options
from ..modal.over_friction import modes_of_band
from ..sliding import full_motion
from ..system import System
from ..temporal.schedule import PhaseSpec
from ..temporal.settings import Settings, choose_step
from ..temporal.signals import low_passed
from ..temporal.simulate import plan, simulate
from ..threads import one_thread
from ..typing import Array, ComplexArray, IntArray, Sparse
from .pairs import second_of, silent_pairs, slip_of
from .shapes import component_shape, node_rows
from .small_motion import DIED, LINEAR, PERTURBATION, SLIPS, Perturbation, linear_parts, small_until, whole
from .told import ABOVE, certain, told

TOLD_APART = 40  # modes, each of two poles, that `components` tells apart in one signal
FASTEST = 3  # modes to start with where these are not all
PERIODS = 40  # of the slowest of them
PERIODS_OF_BAND = 1200  # of its highest frequency, with all modes
SAMPLES = 12  # to each
TURNS = 3.0  # periods of every mode that a march holds
LONGER = 4  # times as long marches the next where one does not tell the fastest apart
MOST_PERIODS = 4 * PERIODS_OF_BAND  # of the highest frequency of the modes in the longest march
MOST_WORK = 2e9  # steps times freedoms: what a march may take to become longer
WATCHED = 100  # nodes of the bodies whose motion gives shapes
MOST_BYTES = 128e6  # of their motion
MOST_INSTANTS = 4096  # of it in a shape
SILENT = "the contacts show nothing of a small motion in time"


def options_in_time(system: System, asked: Options | None = None) -> Options:
    """What makes modes those of the model that the time loop marches: in space Coulomb friction turns with the slip
    velocity, which damps motion across the direction of sliding. Of what is asked for, solver and source count."""
    asked = asked or Options()
    return Options(friction_damping=system.dimension == 3, solver=asked.solver, source=asked.source)


def modes_as_in_time(
    system: System, mu: float, max_frequency_hz: float, options: Options | None = None
) -> ComplexModes:
    """Modes with right vectors, of the very model that the time loop marches."""
    chosen = options_in_time(system, options)
    return modes_of_band(system, mu, max_frequency_hz, vectors="right", options=chosen)


@one_thread
def perturb(
    system: System,
    mu: float,
    *,
    settings: Settings,
    max_frequency_hz: float = 40e3,
    duration: float | None = None,
    modes: ComplexModes | None = None,
    shape: bool = False,
    sign: bool = False,
) -> Perturbation:
    """March a small perturbation of steady sliding and take its fastest component.

    It starts with modes up to ``max_frequency_hz``, of contact as it is in time, in equal measure, 1e-5 of the slip
    speed in all, so that frequencies out of range, which may grow faster, start from nothing; the time scheme alone
    decides what becomes of them. Of two that are one, and in which no contact slips, it starts with what else moves at
    their root (`second_of`). It is used as long as it stays below 2 % of the slip speed, where friction is still
    linear. Where parts of it do not tell the same, a march four times as long follows, unless ``duration`` [s] is given
    and as long as its cost is bounded; what is not told by then is ``untold``. sign: whether it grows is enough. modes:
    `modes_as_in_time`, where they are known. shape: also how nodes move in the fastest component. Raises AnalysisError
    without steady sliding, KeyboardInterrupt where Ctrl-C cuts the run.
    """
    # The reference configuration, as the modes have it, whatever the full run does (docs/case-file.md).
    system = settings.system(system).in_reference()
    nodes = system.contact_nodes()
    slip = nodes.slip_velocity(full_motion(system))
    if not np.any(slip):
        raise AnalysisError("a perturbation of steady sliding needs contacts that slide")
    found = modes_as_in_time(system, mu, max_frequency_hz) if modes is None else modes
    chosen, length = _started(nodes, found, max_frequency_hz)
    if not len(chosen):
        raise AnalysisError(f"no mode vibrates below {max_frequency_hz:g} Hz, so there is nothing to perturb with")
    assert found.right is not None, "asked for with vectors"
    lam, vectors = found.eigenvalues[0, chosen], found.right[0, chosen]
    speed = np.linalg.norm(slip, axis=1)
    pairs = silent_pairs(nodes, lam, vectors)
    single = np.setdiff1d(np.arange(len(lam)), [other for _, other in pairs])
    options = options_in_time(system)
    seconds = {
        int(np.searchsorted(single, one)): second_of(system, mu, complex(lam[one]), vectors[one], options)
        for one, _ in pairs
    }
    start, moved = _in_equal_measure(nodes, lam[single], vectors[single], seconds)
    unshown = _unshown(nodes, lam[single], vectors[single], seconds)
    start *= PERTURBATION * speed[speed > 0.0].min() / len(chosen)
    step = perturbation_step(system, settings)
    top = _top(found, max_frequency_hz)
    length, longest = _lengths(lam, length, top, MOST_WORK * step / system.size)
    if duration is not None:
        length = longest = duration
    # One node of each contact, of those that slide: the one that moves most.
    leaders = _leaders(nodes, speed, moved)
    slips = _along_slip(nodes, slip, leaders)
    while True:
        # As many as of the whole band in the usual length: little of them may be left where motion grows fast.
        recorded = min(max_frequency_hz, max(ABOVE * top, PERIODS_OF_BAND / length))
        every = max(1, int(1.0 / (SAMPLES * recorded * step)))
        most = MOST_BYTES * every * step / (length * 24 * system.dimension)
        bodies = node_rows(system, min(int(most), WATCHED) if shape else 0)
        watched, names = _watching(system, slips, bodies)
        quiet = replace(settings, step=step, initial="steady-sliding", perturbation=0.0, watch=names)
        quiet, disturbance = replace(quiet, record_every=every), (start[0], start[1], start[2])
        run = whole(simulate(watched, [_as_steady(system, length)], quiet, mu=mu, disturbance=disturbance))
        moving = run.velocity[:, : len(leaders), 0]
        signals = linear_parts(moving, speed[leaders])
        if np.abs(moving).max(initial=0.0) <= DIED * PERTURBATION * speed[leaders].min():
            signals = signals[:0]  # rounding of the steady motion, which has any frequency and any rate
        band, limit = told(signals, run.sampling, max_frequency_hz, top)
        sure = certain(signals, run.sampling, limit, band, sign=sign)
        left = small_until(moving, speed[leaders]) < len(moving)
        moved_within = _within(signals, run.sampling, max_frequency_hz)
        grown = left and bool(moved_within > 0.1 * LINEAR * speed[leaders].min())
        sure &= band.fastest.real > 0.0 or not grown
        if sure or left or length >= longest:
            break
        length = min(LONGER * length, longest)
    form = None
    if shape and bodies.shape[0] and len(signals):  # a system of matrices has no bodies whose shapes could be told
        part = slice(0, len(signals), max(1, len(signals) // MOST_INSTANTS))
        motion = run.velocity[part, len(leaders) :].reshape(-1, bodies.shape[0])
        form = component_shape(bodies, run.time[part], motion, band.eigenvalues, band.fastest, limit, lam)
    signal = signals[:, 0] if signals.size else np.zeros(0)
    why = "" if sure else _too_short(len(signal) * run.sampling, lam, left=left)
    if not (len(signal) or left):
        why = SILENT
    return Perturbation(mu, band.fastest, signal, run.sampling, band, form, why, left, grown, unshown)


def _within(signals: Array, sampling: float, max_frequency_hz: float) -> float:
    """The largest of signals (k, c) within the band: what leaves the linear range may lie beyond it."""
    return float(np.abs(low_passed(signals.T, sampling, max_frequency_hz)).max(initial=0.0))


def _too_short(length: float, lam: ComplexArray, *, left: bool) -> str:
    """Why a motion that stays small for a length [s] does not tell modes apart."""
    turns = length * float(lam.imag.min()) / (2 * np.pi)
    how = "leaves the linear range after" if left else "lasts"
    return (
        f"the motion in time {how} {length:.3g} s, {turns:.2g} periods of its slowest mode, too short to tell "
        f"{len(lam)} modes apart" + ("" if left else "; a lower modal.max_frequency_hz leaves fewer of them")
    )


def perturbation_step(system: System, settings: Settings) -> float:
    """Step [s] of the march of a perturbation of a system as it is in time."""
    if settings.step:
        return settings.step
    _, _, limit = plan(settings.system(system).in_reference(), settings)
    return choose_step(limit, settings)


def _started(nodes: ContactNodes, modes: ComplexModes, max_frequency_hz: float) -> tuple[IntArray, float]:
    """Columns of the modes to start with, vibrating and within the limit, and how long to march them [s]."""
    inside = np.flatnonzero((modes.frequency_hz[0] > 0) & (modes.frequency_hz[0] <= max_frequency_hz))
    if len(inside) <= TOLD_APART and nodes.count == len(nodes.names):
        return inside, PERIODS_OF_BAND / max_frequency_hz
    chosen = inside[np.argsort(modes.growth_rate[0][inside])[::-1][:FASTEST]]
    return chosen, PERIODS / float(modes.frequency_hz[0][chosen].min(initial=max_frequency_hz))


def _top(modes: ComplexModes, max_frequency_hz: float) -> float:
    """The highest frequency [Hz] of the modes within the limit."""
    frequency = modes.frequency_hz[0]
    return float(frequency[frequency <= max_frequency_hz].max(initial=0.0))


def _lengths(lam: ComplexArray, usual: float, top: float, affordable: float) -> tuple[float, float]:
    """How long to march [s] first, such that each of the modes (k,) that are heard so long turns `TURNS` times, and how
    long at most; no longer than what is affordable [s], but as long as usual."""
    longest = max(usual, min(MOST_PERIODS / (ABOVE * top), affordable))
    turned = 2 * np.pi * TURNS / lam.imag
    return float(min(max(usual, turned[lam.real * turned > np.log(DIED)].max(initial=0.0)), longest)), longest


def _in_equal_measure(
    nodes: ContactNodes, lam: ComplexArray, vectors: ComplexArray, seconds: Mapping[int, ComplexArray] | None = None
) -> tuple[Array, Array]:
    """Displacement, velocity and acceleration (3, n) of modes, each with a largest slip speed of one, and how fast in
    all each contact node (m,) slips in them at most. seconds: by the number of a mode w (n,) of (w + t v) e^{λt}, which
    starts in its place."""
    total, moved = np.zeros((3, vectors.shape[1])), np.zeros(nodes.count)
    for number, (value, vector) in enumerate(zip(lam, vectors, strict=True)):
        second = None if seconds is None else seconds.get(number)
        speed = _speed(value, vector, second)
        if not _slips(nodes, speed):
            continue
        motion = slip_of(nodes, speed)
        peak = float(motion.max())
        # Phases spread by the golden angle, so that nothing adds up at the start.
        turned = np.exp(2.399963j * number) / peak
        scaled = vector * turned
        if second is None:
            total += np.real([scaled, value * scaled, value**2 * scaled])
        else:
            other = second * turned
            total += np.real([other, value * other + scaled, value**2 * other + 2 * value * scaled])
        moved += motion / peak
    return total, moved


def _speed(value: complex, vector: ComplexArray, second: ComplexArray | None) -> ComplexArray:
    """Velocity (n,) of a mode v e^{λt}, of (w + t v) e^{λt} where w is given, at the start."""
    return value * vector if second is None else value * second + vector


def _slips(nodes: ContactNodes, speed: ComplexArray) -> bool:
    """Whether a mode of this velocity (n,) shows in the slip speed of any contact."""
    return bool(slip_of(nodes, speed).max() >= SLIPS * float(np.abs(speed).max()))


def _unshown(
    nodes: ContactNodes, lam: ComplexArray, vectors: ComplexArray, seconds: Mapping[int, ComplexArray]
) -> ComplexArray:
    """λ of the modes that `_in_equal_measure` leaves out."""
    speeds = (_speed(complex(lam[k]), vector, seconds.get(k)) for k, vector in enumerate(vectors))
    return lam[[not _slips(nodes, speed) for speed in speeds]]


def _leaders(nodes: ContactNodes, speed: Array, moved: Array) -> IntArray:
    """The node of each contact that moves most, of those that slide at least half as fast as the fastest of it."""
    found: list[int] = []
    for contact in range(len(nodes.names)):
        mine = np.flatnonzero((nodes.owner == contact) & (speed > 0.0))
        if len(mine):
            mine = mine[speed[mine] >= 0.5 * speed[mine].max()]
            found.append(int(mine[np.argmax(moved[mine])]))
    return np.array(found, dtype=np.int64)


def _along_slip(nodes: ContactNodes, slip: Array, chosen: IntArray) -> Sparse:
    """Rows (c, n) of the slip of chosen nodes along their steady slip (m, d − 1) [m/s]."""
    direction = np.zeros_like(slip)
    direction[chosen] = slip[chosen] / np.linalg.norm(slip[chosen], axis=1)[:, None]
    return sp.csr_array(nodes.along(direction)[chosen])


def _watching(system: System, slips: Sparse, bodies: Sparse) -> tuple[System, tuple[str, ...]]:
    """The system with slips (c, n) and nodes of bodies (k d, n) as points, and the names of these."""
    d, count = system.dimension, slips.shape[0]
    # A slip takes the place of a point's first direction.
    room = sp.csr_array((np.ones(count), (d * np.arange(count), np.arange(count))), shape=(d * count, count))
    rows = sp.csr_array(sp.vstack([room @ slips, bodies]))
    names = tuple(f"watched {k}" for k in range(rows.shape[0] // d))
    still = np.zeros((d, len(system.motion.names)))
    points = {name: Rows(sp.csr_array(rows[d * k : d * k + d]), still) for k, name in enumerate(names)}
    return replace(system, points=points), names


def _as_steady(system: System, length: float) -> PhaseSpec:
    """A phase [s] under the loads and motions of steady sliding."""
    loads = system.load_steps[-1].loads if system.load_steps else {}
    factors = zip(system.motion.names, full_motion(system).tolist(), system.motion.full_distance, strict=True)
    return PhaseSpec("perturbed", length, loads, {name: factor for name, factor, distance in factors if not distance})
