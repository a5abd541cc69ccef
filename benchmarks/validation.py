"""Print the validation table of docs/validation.md: what must come out, and what does, on the shipped bench.

Computes everything anew: about a minute on two cores. --short leaves out the runs that decay and the temporal
critical friction.
"""

from __future__ import annotations

import numpy as np

import stridor as st
from _common import bench, options
from stridor.agreement import perturb
from stridor.study.analyses import first_regime, settings_of

MISPRINTS = {("beam2", 8840.0), ("beam2", 25533.0)}


def row(what: str, must: str, measured: str) -> None:
    """One line of the table."""
    print(f"| {what} | {must} | {measured} |")


def worst_alone(case: st.Case) -> tuple[float, int]:
    """Largest relative difference of the printed frequencies of the beams alone, misprints aside."""
    worst, count = 0.0, 0
    modes = st.body_modes(case)
    assert case.reference is not None
    for name, printed in case.reference.bodies.items():
        for entry in printed:
            if entry.frequency_hz == 0 or (name, entry.frequency_hz) in MISPRINTS:
                continue
            nearest = np.min(np.abs(modes[name].frequency_hz - entry.frequency_hz))
            worst, count = max(worst, nearest / entry.frequency_hz), count + 1
    return worst, count


def worst_coupled(case: st.Case) -> tuple[float, float, int]:
    """Largest relative difference of the printed coupled frequencies at μ = 0: above 200 Hz, and of those
    below it, where half of the last printed digit is more than 0.2 %."""
    coupled = st.modes(case, 0.0, max_frequency_hz=40e3, damped=False).frequency_hz[0]
    assert case.reference is not None
    printed = [entry.frequency_hz for entry in case.reference.coupled]
    errors = {f: float(np.min(np.abs(coupled - f)) / f) for f in printed}
    low = [e for f, e in errors.items() if f < 200]
    return max(e for f, e in errors.items() if f >= 200), max(low, default=0.0), len(printed)


def modal(case: st.Case) -> None:
    """Rows of the modal approach."""
    worst, count = worst_alone(case)
    row(
        f"both beams alone, {count} printed frequencies without the two misprints",
        "0.1 %",
        f"{100 * worst:.3f} %",
    )
    worst, low, count = worst_coupled(case)
    measured = f"{100 * worst:.3f} %; below 200 Hz {100 * low:.2f} %, half the last printed digit being 0.49 %"
    row(f"coupled, μ = 0, {count} printed frequencies", "0.3 %", measured)
    targets = {8635: 0.0766, 16684: 0.1376, 28819: 0.1670, 3620: 0.8079}
    found = st.onsets(case, (0.0, 1.0), damped=False).onsets
    for frequency, mu in targets.items():
        onset = min(found, key=lambda o: abs(o.frequency_hz - frequency))
        row(
            f"onset near {frequency} Hz, μ {mu}",
            "0.05 % / 0.5 %",
            f"{onset.frequency_hz:.2f} Hz, μ = {onset.mu:.8f}, residual {onset.residual:.0e}",
        )
    at = st.modes(case, 0.1, max_frequency_hz=40e3)
    unstable = np.flatnonzero(at.unstable[0])
    listed = ", ".join(f"{at.frequency_hz[0, k]:.2f} Hz, {at.growth_rate[0, k]:+.2f} 1/s" for k in unstable)
    row("damped, μ = 0.1, unstable below 40 kHz", "one: 8641 Hz, +637 1/s", f"{len(unstable)}: {listed}")


def temporal(case: st.Case, *, short: bool) -> None:
    """Rows of the temporal approach and of the comparison."""
    run = st.simulate(case)
    summary = st.summarise(case, run)
    regime = first_regime(run)["A"]
    row(
        "temporal, μ = 0.1: peak force before the first separation",
        "33–45 N",
        f"{regime['max_normal_force']:.1f} N",
    )
    row("… dominant frequency", "8.7 kHz ± 3 %", f"{summary.dominant_frequency_hz:.0f} Hz")
    row("… energy balance", "1e-3", f"{summary.energy.error:.0e}")
    row("… time step against its limit", "2e-8 s < 2.116e-8 s", f"{run.step:.3g} s < {run.step_limit:.4g} s")
    if not short:
        quiet = st.simulate(case, 0.07)
        force = quiet.normal_force[quiet.phase_slice(), 0]
        row("μ = 0.07: spread of the force, first and last tenth of sliding", "decays", spread(force))
        back = case.with_({"supports.clamp.velocity.x": -case.supports["clamp"].velocity["x"]})
        reverse = st.simulate(back)
        row("reversed V, μ = 0.1: the same", "decays", spread(reverse.normal_force[reverse.phase_slice(), 0]))
    rigid = case.with_({"contacts.A.stiffness": "rigid"})
    modes = st.modes(rigid, 0.1, max_frequency_hz=40e3)
    k = int(np.argmax(modes.growth_rate[0]))
    seen = perturb(st.build_system(rigid), 0.1, settings=settings_of(rigid))
    error = abs(seen.growth_rate / modes.growth_rate[0, k] - 1)
    row(
        "growth of a small perturbation, μ = 0.1, against Re λ",
        "0.5 %",
        f"{seen.growth_rate:.3f} against {modes.growth_rate[0, k]:.3f} 1/s ({100 * error:.3f} %)",
    )
    if not short:
        agreement = st.compare(case)
        low, high = agreement.bracket or (float("nan"),) * 2
        row(
            "critical μ in time by bisection",
            "0.075–0.082",
            f"{agreement.critical_mu_temporal:.5f} (in {low:.5f} … {high:.5f}; "
            f"modal {agreement.critical_mu_modal:.5f})",
        )


def spread(force: np.ndarray) -> str:
    """Half the peak-to-peak value in the first and the last tenth."""
    tenth = max(1, len(force) // 10)
    return f"{np.ptp(force[:tenth]) / 2:.2f} N → {np.ptp(force[-tenth:]) / 2:.2f} N"


def main() -> None:
    args = options(__doc__ or "")
    case = bench()
    print("| number | must be | measured |")
    print("|---|---|---|")
    modal(case)
    temporal(case, short=args.short)


if __name__ == "__main__":
    main()
