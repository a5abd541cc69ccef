"""Small perturbations of steady sliding, marched in time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import AnalysisError
from ..modal.over_friction import modes_of_band
from ..sliding import full_motion, slip_speeds
from ..system import System
from ..temporal.observe import MOST_INSTANTS
from ..temporal.schedule import PhaseSpec
from ..temporal.signals import components
from ..temporal.simulate import Settings, simulate
from ..threads import one_thread_if_small
from ..typing import Array
from .assembled import perturb_assembled
from .shapes import WATCHED, component_shape, node_rows, watching
from .small_motion import PERTURBATION, PERTURBATION_DURATION, Perturbation, linear_part, whole


@one_thread_if_small
def perturb(
    system: System,
    mu: float,
    *,
    settings: Settings,
    max_frequency_hz: float = 40e3,
    duration: float | None = None,
    shape: bool = False,
) -> Perturbation:
    """March a small perturbation of steady sliding and take its fastest component.

    It starts with every mode, of contact as it is in time, up to ``max_frequency_hz`` in equal measure, 1e-5 of the
    slip speed in all, so that frequencies out of range, which may grow faster, start from nothing; the
    time scheme alone decides what becomes of them. It is used as long as it stays below 2 % of the slip
    speed, where friction is still linear. shape: also how nodes move in the fastest component. Raises AnalysisError
    without steady sliding, KeyboardInterrupt where Ctrl-C cuts the run.
    """
    system = settings.system(system)
    if system.assembled:
        return perturb_assembled(
            system, mu, settings=settings, max_frequency_hz=max_frequency_hz, duration=duration, shape=shape
        )
    steady = slip_speeds(system, full_motion(system))
    if not len(steady) or np.abs(steady).min() == 0:
        raise AnalysisError("a perturbation of steady sliding needs contacts that slide")
    speed = float(np.abs(steady).min())
    # The reference configuration, as the modes have it, whatever the full run does (docs/case-file.md).
    if any(c.sliding != "small" for c in system.contacts):
        system = replace(system, contacts=tuple(replace(c, sliding="small") for c in system.contacts))
    start = replace(
        settings,
        initial="steady-sliding",
        perturbation=0.0,
        watch=(),
        record_every=_every(settings, max_frequency_hz),
    )
    rows = node_rows(system, WATCHED if shape else 0)
    watched, names = watching(system, rows)
    run = whole(
        simulate(
            watched,
            [PhaseSpec("perturbed", duration or PERTURBATION_DURATION, {}, {})],
            replace(start, watch=names if shape else ()),
            mu=mu,
            disturbance=_band_limited(system, mu, PERTURBATION * speed, max_frequency_hz),
        )
    )
    signal = linear_part(run, steady)
    found = components(signal, run.sampling, max_frequency_hz=max_frequency_hz)
    moved = None
    if shape:
        part = slice(0, len(signal), max(1, len(signal) // MOST_INSTANTS))
        motion = run.velocity[part].reshape(len(run.time[part]), -1)
        moved = component_shape(
            rows, run.time[part], motion, found.eigenvalues, found.fastest, max_frequency_hz
        )
    return Perturbation(mu, found.fastest, signal, run.sampling, found, moved)


def _band_limited(system: System, mu: float, slip_speed: float, max_frequency_hz: float) -> tuple[Array, Array, Array]:
    """Displacement, velocity, acceleration (n,) of all modes up to a frequency, equal in slip speed."""
    modes = modes_of_band(system, mu, max_frequency_hz, vectors="right")
    assert modes.right is not None
    tangents = system.contact_rows()[1::2]
    total = np.zeros((3, system.size))
    for number, (lam, vector) in enumerate(zip(modes.eigenvalues[0], modes.right[0], strict=True)):
        slip = lam * (tangents @ vector)
        largest = float(np.abs(slip).max())
        # Modes that do not slip would need a huge amplitude to show in the slip speed; leave them out.
        if largest < 1e-6 * abs(lam) * float(np.abs(vector).max()) or lam.imag == 0:
            continue
        # Phases spread by the golden angle, so that nothing adds up at the start.
        scaled = vector / largest * np.exp(2.399963j * number)
        total += np.real([scaled, lam * scaled, lam**2 * scaled])
    count = max(len(modes.branch), 1)
    return tuple(total * (slip_speed / count))  # type: ignore[return-value]


def _every(settings: Settings, max_frequency_hz: float) -> int:
    """Steps between records that keep six samples per period of the highest frequency."""
    if settings.step is None:
        return settings.record_every
    return max(1, int(1.0 / (12 * max_frequency_hz * settings.step)))
