"""The figures of a report, each with its title, caption and a text for who cannot see it."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from ..digits import measured
from ..modal.complex_modes import ComplexModes
from ..modal.onsets import Onset
from ..notebook import counted
from . import plots
from .inputs import ReportInputs
from .page_parts import ReportFigure
from .units import frequency_words
from .windows import Window, shown_motion


def model_figures(inputs: ReportInputs) -> Iterator[ReportFigure]:
    """The model as it stands."""
    if inputs.system is not None and inputs.system.lines:
        yield ReportFigure(
            "model",
            "The model",
            "Bodies as lines, supports as squares with the directions they hold (φ: rotation), contacts as circles, "
            "loads and prescribed velocities as arrows, watched points as small circles.",
            f"Drawing of {', '.join(line.name for line in inputs.system.lines)} with supports, loads and contacts.",
            partial(plots.model_plot, inputs.system, inputs.case),
        )
    if inputs.system is not None and any(solid.cells.keys() - {"vertex"} for solid in inputs.system.solids):
        yield ReportFigure(
            "mesh",
            "The mesh",
            "Bodies as meshed, each in its colour; dots are the slave nodes of the contacts.",
            f"Drawing of the meshes of {', '.join(solid.name for solid in inputs.system.solids)}.",
            partial(plots.mesh, inputs.system),
        )


def first_onset(inputs: ReportInputs) -> Onset | None:
    """The onset whose pair of modes the report follows: the first one without damping, else with."""
    for onsets in (inputs.undamped_onsets, inputs.damped_onsets):
        if onsets is not None and onsets.first is not None:
            return onsets.first
    return None


def modal_figures(inputs: ReportInputs) -> Iterator[ReportFigure]:
    """Branches over friction, the pair that meets first, the friction curve, the root locus."""
    onset = first_onset(inputs)
    undamped = inputs.undamped_sweep if inputs.undamped_pair is None else inputs.undamped_pair
    damped = inputs.damped_sweep if inputs.damped_pair is None else inputs.damped_pair
    if onset is not None and onset.kind == "flutter":
        if undamped is not None and _holds(undamped, onset):
            yield from _undamped_pair(inputs, undamped, onset)
        if damped is not None and not inputs.nothing_damps and _holds(damped, onset):
            yield from _damped_pair(inputs, damped, onset)
    yield from _all_branches(inputs)
    if inputs.curve is not None and len(inputs.curve.mu) > 1:
        yield ReportFigure(
            "friction-curve",
            "Friction over frequency",
            "μ(ω) = −s (1/Kc + Gnn(ω)) / Gnt(ω), from the receptances of the structure without contact and damping. "
            "A horizontal line cuts the curve at the frequencies of the modes that the contact sees at that friction "
            "coefficient; at a maximum two of them meet and become complex: all onsets of flutter are maxima of one "
            "explicit curve. Diamonds: the onsets, solved on the assembled matrices.",
            "Friction coefficient over frequency with its local maxima marked as onsets of instability.",
            partial(
                plots.friction_curve,
                inputs.curve.mu,
                inputs.curve.frequency_hz,
                onsets=inputs.undamped_onsets,
                case_mu=inputs.mu,
                friction_range=inputs.case.modal.friction_range,
            ),
        )


def _holds(modes: ComplexModes, onset: Onset) -> bool:
    return set(onset.branches) <= {int(b) for b in modes.branch} and len(modes.mu) > 1


def _undamped_pair(inputs: ReportInputs, modes: ComplexModes, onset: Onset) -> Iterator[ReportFigure]:
    a, b = onset.branches
    onsets = inputs.undamped_onsets
    yield ReportFigure(
        "frequency-pair",
        f"Frequencies of modes {a} and {b}, without damping",
        "The two modes come together as friction grows and meet at "
        f"μ = {measured(onset.mu, 5)}, {measured(onset.frequency_hz, 1)} Hz; "
        "beyond it they share one frequency and one of them grows (marked).",
        f"Frequencies of modes {a} and {b} over friction, merging at {measured(onset.mu, 4)}.",
        partial(plots.frequency_branches, modes, onset.branches, onsets=onsets),
    )
    yield ReportFigure(
        "imaginary-pair",
        f"Imaginary part of the frequencies of modes {a} and {b}, without damping",
        "For motion written as exp(jωt), a negative imaginary part of ω grows: Im ω = −Re λ. Below the onset both are "
        "real; beyond it the pair opens as the square root of μ − μc.",
        f"Imaginary parts of modes {a} and {b}, zero up to {measured(onset.mu, 4)}, then opening like a square root.",
        partial(plots.growth_branches, modes, onset.branches, imaginary_frequency=True),
    )


def _damped_pair(inputs: ReportInputs, modes: ComplexModes, onset: Onset) -> Iterator[ReportFigure]:
    a, b = onset.branches
    crossing = next((o for o in _damped(inputs) if set(o.branches) == {a, b}), None)
    where = (
        f" Growth begins at μ = {measured(crossing.mu, 5)}, at {measured(crossing.frequency_hz, 1)} Hz."
        if crossing
        else ""
    )
    yield ReportFigure(
        "damped-frequency-pair",
        f"Frequencies of modes {a} and {b}, with structural damping",
        "Im λ/2π of the damped pair: the frequencies come close without being exactly equal." + where,
        f"Damped frequencies of modes {a} and {b} over friction.",
        partial(plots.frequency_branches, modes, onset.branches, onsets=inputs.damped_onsets),
    )
    yield ReportFigure(
        "damped-growth-pair",
        f"Growth rates of modes {a} and {b}, with structural damping",
        "Re λ of the damped pair; positive grows." + where + _beside_undamped(crossing, _of_pair(inputs, onset)),
        f"Growth rates of modes {a} and {b} over friction, one becoming positive.",
        partial(plots.growth_branches, modes, onset.branches),
    )


def _of_pair(inputs: ReportInputs, onset: Onset) -> Onset | None:
    """Where the modes of an onset meet without damping, None where that was not sought or they do not."""
    known = inputs.undamped_onsets.onsets if inputs.undamped_onsets is not None else ()
    return next((o for o in known if set(o.branches) == set(onset.branches) and not o.stabilising), None)


def _beside_undamped(damped: Onset | None, undamped: Onset | None) -> str:
    """What damping does to an onset, which it may put off or, where it takes more of one mode, bring on; nothing of
    one that was not sought without it."""
    if damped is None or undamped is None:
        return ""
    without = f"without damping the two meet at μ = {measured(undamped.mu, 5)}"
    if measured(damped.mu, 5) == measured(undamped.mu, 5):
        return " That is where they meet without damping, too."
    return f" Damping {'puts it off' if damped.mu > undamped.mu else 'brings it on'}: {without}."


def _damped(inputs: ReportInputs) -> tuple[Onset, ...]:
    return inputs.damped_onsets.onsets if inputs.damped_onsets is not None else ()


def _all_branches(inputs: ReportInputs) -> Iterator[ReportFigure]:
    for modes, onsets, name in (
        (inputs.undamped_sweep, inputs.undamped_onsets, "frequencies"),
        (inputs.damped_sweep, inputs.damped_onsets, "frequencies-damped"),
    ):
        if modes is None or len(modes.mu) < 2 or (name == "frequencies-damped" and inputs.undamped_sweep is not None):
            continue
        # NaN: nothing was solved, or the branch was not followed, as where other nodes touch or beyond the band.
        inside = (modes.frequency_hz <= inputs.max_frequency_hz).any(axis=0)
        shown = int(inside.sum())
        if not shown:
            continue
        parted = bool(np.isnan(modes.frequency_hz[modes.solved][:, inside]).any())
        first = "The first frequency" if shown == 1 else f"The first {shown} frequencies"
        titled = f"Frequencies of {counted(shown, 'mode')}" if parted else first
        yield ReportFigure(
            name,
            f"{titled} over friction, {inputs.damping_of(modes)}",
            "Every line is one mode, followed from μ = 0 through crossings and coalescences. "
            + ("A line that ends was not followed any further, as where other nodes touch. " if parted else "")
            + "Circles: potentially unstable (the mode grows). Diamonds: onsets, solved.",
            f"Frequencies of {counted(shown, 'mode')} over the friction coefficient with unstable stretches marked.",
            partial(plots.frequency_branches, modes, onsets=onsets, max_frequency_hz=inputs.max_frequency_hz),
        )
    if inputs.damped_sweep is not None and len(inputs.damped_sweep.mu) > 1:
        yield ReportFigure(
            "root-locus",
            "Root locus",
            f"Eigenvalues as friction grows, {inputs.damping_of(inputs.damped_sweep)}. The horizontal axis is "
            "linear near zero and logarithmic beyond.",
            "Eigenvalues in the plane of growth rate and frequency, coloured by friction coefficient.",
            partial(plots.root_locus, inputs.damped_sweep, max_frequency_hz=inputs.max_frequency_hz),
        )


def temporal_figures(inputs: ReportInputs, window: Window | None) -> Iterator[ReportFigure]:
    """Histories, spectra, the contact, energies."""
    run = inputs.trajectory
    motion = None if run is None or len(run.time) < 2 else shown_motion(run)
    if run is not None and motion is not None:
        point, along = run.watch_names[motion[0]], motion[1]
        yield ReportFigure(
            "acceleration",
            f"Acceleration of {point}",
            f"Along {along}, over the whole run. The dark band is what lies below "
            f"{frequency_words(inputs.max_frequency_hz)}, the light one everything the time step resolves, impacts "
            "included. Dotted lines: where phases begin.",
            f"Acceleration of {point} along {along} over time with the phases of the run marked.",
            partial(plots.acceleration_history, run, point, direction=along, max_frequency_hz=inputs.max_frequency_hz),
        )
    if run is not None and run.contact_names and len(run.time) > 1:
        for k, name in enumerate(run.contact_names):
            yield ReportFigure(
                f"contact-{name}-history",
                f"Contact {name} over the whole run",
                "Normal force and slip velocity of the slave against the master, extrema of every short piece.",
                f"Normal force and slip velocity of contact {name} over time.",
                partial(plots.contact_history, run, contact=k),
            )
    yield from _spectra(inputs)
    if run is not None and window is not None:
        yield from _contact_window(inputs, window)
    if run is not None and inputs.energy is not None and len(run.time) > 1:
        yield ReportFigure(
            "energy",
            "Energy balance",
            "Above: what was put in, what is stored in the bodies and what was taken out. What goes into contacts is "
            "one sum: what impacts take, and what springs of contacts (of those with a stiffness) store and give back. "
            "Below: what is missing in the balance, "
            "relative to the largest energy that changed hands.",
            "Energies over time, and the imbalance of the energy balance.",
            partial(plots.energy_plot, run, inputs.energy),
        )


def _spectra(inputs: ReportInputs) -> Iterator[ReportFigure]:
    if inputs.spectra:
        spec = next(iter(inputs.spectra.values()))
        yield ReportFigure(
            "spectrum",
            f"Spectrum of {inputs.spectra_of.split(' over ')[0]}",
            f"Of {inputs.spectra_of}; {spec.window} window, bins every {measured(spec.resolution_hz, 1)} Hz, a line is "
            f"{measured(spec.bandwidth_hz, 1)} Hz wide at −6 dB. 0 dB is an amplitude of 1 {inputs.spectra_unit}."
            + (" Dotted: the dominant frequency and its multiples." if inputs.dominant_hz is not None else ""),
            f"Amplitude spectra of {', '.join(inputs.spectra)}.",
            partial(
                plots.spectrum_plot,
                inputs.spectra,
                max_frequency_hz=inputs.max_frequency_hz,
                unit=inputs.spectra_unit,
                marked_hz=inputs.dominant_hz,
            ),
        )
    if inputs.spectrogram is not None and inputs.spectrogram.amplitude.size > 1:
        content = inputs.spectrogram
        yield ReportFigure(
            "spectrogram",
            "Spectrogram",
            f"Of the {inputs.spectrogram_of}; resolution {measured(content.resolution_hz, 0)} Hz. How the tone builds "
            "up, and its multiples with it.",
            "Spectrum over time as a colour map.",
            partial(
                plots.spectrogram_plot,
                content,
                start=inputs.spectrogram_start,
                max_frequency_hz=inputs.max_frequency_hz,
                unit=inputs.spectrogram_unit,
            ),
        )


def _contact_window(inputs: ReportInputs, window: Window) -> Iterator[ReportFigure]:
    run, system = inputs.trajectory, inputs.system
    assert run is not None, "asked for with a run only"
    name = run.contact_names[0]
    slave = inputs.case.contacts[name].slave if name in inputs.case.contacts else ""
    contact = next((c for c in system.contacts if c.name == name), None) if system is not None else None
    steady: float | None = None
    if inputs.steady is not None and system is not None:
        nodes = system.contact_nodes()
        steady = float(inputs.steady.normal_force[nodes.owner == nodes.names.index(name)].sum())
    shares = [f"{100 * window.stick_fraction:.0f} % stick"]
    if window.separation_fraction:
        shares.append(f"{100 * window.separation_fraction:.0f} % separation")
    caption = (
        f"Contact {name} over {window.length}, {window.reason}: normal force up to "
        f"{measured(window.max_normal_force, 1)} N, slip speed up to {measured(window.max_slip_speed, 3)} m/s, "
        f"{', '.join(shares)}."
    )
    if window.stick_fraction:
        caption += " Where it sticks, slave and master move together, though not evenly: both vibrate."
    yield ReportFigure(
        "contact-window",
        f"Normal force and velocities over {window.length}",
        caption,
        f"Normal force and tangential velocities of contact {name} over {window.length}; stick and slip shaded.",
        partial(
            plots.contact_force_and_velocity,
            run,
            window,
            slave=slave if slave in run.watch_names else None,
            tangent=(1.0, 0.0) if contact is None else (float(contact.tangent[0]), float(contact.tangent[1])),
            steady_force=steady,
        ),
    )
    yield ReportFigure(
        "portrait",
        "Normal force over slip velocity",
        f"The same {window.length}. On the vertical line at zero the contact sticks.",
        f"Normal force over slip velocity of contact {name}.",
        partial(plots.phase_portrait, run, window),
    )


def agreement_figures(inputs: ReportInputs) -> Iterator[ReportFigure]:
    """Components in time over the modes, growth of the perturbation, both shapes."""
    comparisons = inputs.agreement.comparisons if inputs.agreement is not None else ()
    chosen = next((c for c in comparisons if inputs.mu is None or abs(c.mu - inputs.mu) < 1e-12), None)
    if chosen is not None:
        top = inputs.max_frequency_hz
        if inputs.modes is not None and len(chosen.perturbation.components.eigenvalues):
            yield ReportFigure(
                "spectrum-map",
                "What the time signal is made of",
                f"Growth rate over frequency at μ = {chosen.mu:g}. Circles: complex modes. Crosses: damped "
                "exponentials found in the slip speed of a small perturbation, marched in time. Every cross inside a "
                "circle is a mode that both approaches see alike.",
                "Complex modes and identified components in the plane of frequency and growth rate.",
                partial(
                    plots.spectrum_map,
                    inputs.modes,
                    chosen.perturbation.components,
                    mu=chosen.mu,
                    max_frequency_hz=top,
                ),
            )
        if len(chosen.perturbation.signal) > 1:
            yield ReportFigure(
                "perturbation",
                "Growth of a small perturbation",
                f"Slip speed minus its steady value at μ = {chosen.mu:g}, up to where friction stays linear. The "
                f"dashed line has the slope of the modal growth rate. Grey: what lies above {frequency_words(top)}, "
                "out of the range compared, may grow as well.",
                "Size of the perturbation over time on a logarithmic scale beside the modal growth rate.",
                partial(
                    plots.perturbation_growth,
                    chosen.perturbation, modal_growth_rate=chosen.modal_eigenvalue.real, max_frequency_hz=top
                ),
            )
    if len(comparisons) > 1:
        yield ReportFigure(
            "growth-comparison",
            "Growth rates by both approaches",
            "Circles: the mode that grows fastest. Crosses: the fastest component of a small perturbation in time.",
            "Growth rates of both approaches over the friction coefficient.",
            partial(plots.growth_comparison, comparisons),
        )
    yield from _shape_figures(inputs)


def _shape_figures(inputs: ReportInputs) -> Iterator[ReportFigure]:
    system, operating, mode = inputs.system, inputs.operating_shape, inputs.unstable_shape
    if system is None:
        return
    if operating is not None:
        yield ReportFigure(
            "operating-shape",
            f"Velocity of the bodies at {measured(operating.frequency_hz, 0)} Hz, in time",
            "The line at the dominant frequency taken out of the velocity of every node. Arrows: velocities; thin "
            "lines: a quarter of a period later; dotted: at rest.",
            f"Velocity shape of the bodies at {measured(operating.frequency_hz, 0)} Hz from the run in time.",
            partial(plots.mode_shape, system, operating.shape, velocity=True),
        )
    if mode is not None and system.lines:
        growth = f", growth rate {measured(mode.growth_rate, 0)} 1/s" if mode.growth_rate is not None else ""
        yield ReportFigure(
            "unstable-mode",
            f"The mode at {measured(mode.frequency_hz, 0)} Hz",
            f"Displacements{growth}, drawn where the motion is largest and, thin, a quarter of a period later: "
            "the mode is complex, the bodies do not move in phase.",
            f"Deformed bodies in the mode at {measured(mode.frequency_hz, 0)} Hz.",
            partial(plots.mode_shape, system, mode.shape),
        )
    if operating is not None and mode is not None:
        by_body = ", ".join(f"{name} {value:.2f}" for name, value in inputs.mac_by_body.items())
        extra = f" Likeness (MAC) by body: {by_body}." if by_body else ""
        yield ReportFigure(
            "shapes",
            "Both shapes side by side",
            "Left the velocities of the run, right the mode, turned to agree in sign." + extra,
            "Operating shape of the run beside the unstable mode.",
            partial(
                plots.shapes_side_by_side,
                system,
                [
                    (f"run, {measured(operating.frequency_hz, 0)} Hz", operating.shape, True),
                    (f"mode, {measured(mode.frequency_hz, 0)} Hz", mode.shape, False),
                ],
            ),
        )
