"""An ensemble of runs in time, side by side in one call, against the same runs one after the other.

Sixteen friction coefficients of the two-beam bench, 361 free freedoms, float64. Both sides use one core and take turns
in the same run, so that other work on the machine slows both alike; the ratio is that of their shortest times. Separate
runs also keep energies, which an ensemble does not. Compared before anything is timed: the slip speed of the contact
over the first 2000 steps.

With --device gpu: 1024 members on a GPU against all cores, or why there is none.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

import stridor as st
from _common import bench, machine
from stridor.study.settings import phases_of, settings_of
from stridor.temporal.devices import gpu
from stridor.temporal.ensembles import march_all
from stridor.temporal.legs import Member
from stridor.temporal.schedule import PhaseSpec
from stridor.temporal.simulate import simulate
from stridor.temporal.trajectory import Trajectory

MUS = np.linspace(0.02, 0.32, 16)


def side_by_side(
    system: st.System, phases, settings, cores: int | None = 1, mus=MUS, device: str = "cpu"
) -> tuple[float, dict[int, Trajectory]]:
    """Seconds for all members, and their runs."""
    runs: dict[int, Trajectory] = {}

    def see(track: int, leg: int, run: Trajectory | str) -> None:
        assert not isinstance(run, str), run
        runs[track] = run

    started = time.perf_counter()
    tracks = [[Member(float(mu))] for mu in mus]
    march_all(system, phases, settings, tracks, see, window=0.5, cores=cores, device=device)
    return time.perf_counter() - started, runs


def separately(system: st.System, phases, settings) -> tuple[float, list[Trajectory]]:
    started = time.perf_counter()
    runs = [simulate(system, phases, settings, mu=float(mu)) for mu in MUS]
    return time.perf_counter() - started, runs


def timed_launches() -> list[tuple[float, int]]:
    """Seconds and steps of every launch on a GPU from now on."""
    from stridor.temporal.steppers.modal.device import DeviceBatch

    launches, advance = list[tuple[float, int]](), DeviceBatch.advance

    def timed(self: DeviceBatch, steps: int, *given: object) -> None:
        began = time.perf_counter()
        advance(self, steps, *given)  # type: ignore[arg-type]
        launches.append((time.perf_counter() - began, steps))

    DeviceBatch.advance = timed  # type: ignore[method-assign]
    return launches


def on_a_gpu(system: st.System, settings, steps: int) -> None:
    """Many members on a GPU and on all cores, in turns."""
    there = gpu()
    if isinstance(there, str):
        print(f"skipped: a run on a GPU needs {there}")
        return
    mus = np.linspace(0.02, 0.32, 1024)
    phases = [PhaseSpec("press", steps * settings.step, {}, {"clamp": 1.0})]
    shorter = [replace(phases[0], duration=1000 * settings.step)]
    ours, theirs = (side_by_side(system, shorter, settings, None, mus, device)[1] for device in ("gpu", "cpu"))
    difference = max(np.abs(ours[k].slip_speed - theirs[k].slip_speed).max() for k in theirs)
    largest = max(np.abs(run.slip_speed).max() for run in theirs.values())
    times, launches = {"gpu": [], "cpu": []}, timed_launches()
    for _ in range(3):
        for device, kept in times.items():
            kept.append(side_by_side(system, phases, settings, None, mus, device)[0] / steps / len(mus))
    print(f"ensemble of {len(mus)} runs, {system.size} free freedoms, {steps} steps each ({machine()}, {there.name})")
    for device, kept in times.items():
        print(f"  {device}  {min(kept) * 1e9:8.1f} ns per member and step ({max(kept) * 1e9:.1f} at most)")
    alone = sum(seconds for seconds, _ in launches) / sum(done * len(mus) for _, done in launches if done > 1)
    print(f"  gpu  {alone * 1e9:8.1f} ns of these for launches, records brought back included")
    print(f"  slip speed of the first 1000 steps, largest relative difference {difference / largest:.1e}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--short", action="store_true")
    parser.add_argument("--device", choices=("cpu", "gpu"), default="cpu")
    args = parser.parse_args()
    case = bench()
    system, settings = st.build_system(case), settings_of(case)
    if args.device == "gpu":
        on_a_gpu(system, settings, 2000 if args.short else 20_000)
        return
    first = [PhaseSpec("press", 2000 * settings.step, {}, {"clamp": 1.0})]
    ours, theirs = side_by_side(system, first, settings)[1], separately(system, first, settings)[1]
    difference = max(
        np.abs(ours[k].slip_speed - run.slip_speed).max() / np.abs(run.slip_speed).max() for k, run in enumerate(theirs)
    )
    share = 0.01 if args.short else 0.1
    phases = [PhaseSpec(p.name, p.duration * share, p.loads, p.velocities, p.ramp) for p in phases_of(case)]
    steps = round(sum(p.duration for p in phases) / settings.step) * len(MUS)
    together, apart = [], []
    for _ in range(3 if args.short else 5):
        together.append(side_by_side(system, phases, settings)[0] / steps)
        apart.append(separately(system, phases, settings)[0] / steps)
    ratios = np.array(apart) / np.array(together)
    print(f"ensemble of {len(MUS)} runs, {system.size} free freedoms, {steps // len(MUS)} steps each ({machine()})")
    print(f"  separate runs            {min(apart) * 1e9:8.0f} ns per member and step, energies included")
    print(f"  side by side, one core   {min(together) * 1e9:8.0f} ns per member and step")
    ratio = min(apart) / min(together)
    print(f"  ratio per core           {ratio:8.2f} (in turns {ratios.min():.2f} to {ratios.max():.2f})")
    both = side_by_side(system, phases, settings, cores=2)[0] / steps
    print(f"  side by side, two cores  {both * 1e9:8.0f} ns per member and step")
    print(f"  slip speed of the first 2000 steps, largest relative difference {difference:.1e}")


if __name__ == "__main__":
    main()
