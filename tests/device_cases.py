"""Small ensembles for the device path, and how to run them: here on the CPU, or with numba's simulator in a process of
its own (`python device_cases.py FILE`), where no function is compiled."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benches import Slave, bench, paper_case
from stridor.laws import Tabulated
from stridor.system import System, build_system
from stridor.temporal.ensembles import EnsembleOutcome, march_all
from stridor.temporal.legs import Member
from stridor.temporal.schedule import PhaseSpec
from stridor.temporal.settings import Settings
from stridor.temporal.trajectory import Trajectory

NAMES = ("legs", "beta2", "contacts")
ALONE = "alone"  # the last track of the first
SHARED = {"legs": 48 * 1024, "beta2": 1200, "contacts": 0}  # bytes for the member and its modes, for its rows, for none
SIZES = {"bodies.beam1.elements": 2, "bodies.beam2.elements": 3, "temporal.step": None, "temporal.record_every": 3}
PRESS = PhaseSpec("press", 1e-4, {}, {"clamp": 0.0}, 5e-5)
SLIDE = PhaseSpec("slide", 1e-4, {}, {"clamp": 1.0}, 5e-5)


@dataclass(frozen=True)
class DeviceCase:
    """An ensemble: tracks of members of one system."""

    system: System
    settings: Settings
    tracks: Sequence[Sequence[Member]]
    phases: tuple[PhaseSpec, ...] = (PRESS, SLIDE)


def made(name: str) -> DeviceCase:
    """A case by its name."""
    system = build_system(paper_case().with_(SIZES))
    settings = Settings(record_every=3, watch=("beam1.tip", "beam2.end"))
    if name == "beta2":
        law = Tabulated((0.0, 0.02, 0.1), (0.3, 0.25, 0.2), "monotone-cubic")
        system = replace(system, contacts=tuple(replace(c, law=law) for c in system.contacts))
        tracks = [[Member(0.05)], [Member(0.4, 0.7, 3.0)], [Member(0.3, 0.01, 1.0)]]
        return DeviceCase(system, replace(settings, beta2=0.75, contact="as given"), tracks)
    if name == "legs":  # loads and speeds change by a ramp; one member is lost
        tracks = [
            [Member(0.1), Member(0.3, 0.4, 2.0)], [Member(0.1, 1e308), Member(0.2)], [Member(0.4), Member(0.05, 2.0)],
        ]  # fmt: skip
        return DeviceCase(system, settings, tracks)
    assert name == "contacts"  # six contact rows: more than one group of sums; nothing watched
    slaves = [Slave(place=place, stiffness="rigid", elements=2) for place in (0.35, 0.6, 0.8)]
    settings = Settings(record_every=10, watch=())
    phases = (PhaseSpec("press", 6e-5, {}, {"clamp": 0.0}), PhaseSpec("slide", 6e-5, {}, {"clamp": 1.0}, 2e-5))
    return DeviceCase(bench(*slaves, elements=4), settings, [[Member(0.05)], [Member(0.3, 0.5, 4.0)]], phases)


def run_on(device: str, case: DeviceCase) -> tuple[EnsembleOutcome, dict[tuple[int, int], Trajectory | str]]:
    """What is seen of each member."""
    found: dict[tuple[int, int], Trajectory | str] = {}
    outcome = march_all(
        case.system, case.phases, case.settings, case.tracks,
        lambda track, leg, run: found.__setitem__((track, leg), run), window=0.5, device=device,
    )  # fmt: skip
    return outcome, found


def numbers(outcome: EnsembleOutcome, found: dict[tuple[int, int], Trajectory | str]) -> dict[str, np.ndarray]:
    """All that a run left, by name."""
    out: dict[str, np.ndarray] = {"device": np.array(outcome.device)}
    for (track, leg), run in found.items():
        mark = f"{track}.{leg}."
        if isinstance(run, str):
            out[mark + "error"] = np.array(run)
            continue
        for name in ("time", "normal_force", "tangential_force", "slip_speed", "gap", "status", "displacement",
                     "velocity", "acceleration"):  # fmt: skip
            out[mark + name] = getattr(run, name)
        contacts = [c for phase in run.phases for c in phase.contacts.values()]
        out[mark + "shares"] = np.array([[c.stick_fraction, c.slip_fraction, c.separation_fraction] for c in contacts])
        out[mark + "largest"] = np.array([[c.max_normal_force, c.max_tangential_force] for c in contacts])
        out[mark + "sweeps"] = np.array([run.most_sweeps, run.unconverged_steps])
    return out


def simulated(folder: Path) -> dict[str, dict[str, np.ndarray]]:
    """The numbers of all cases from the simulator."""
    there = {**os.environ, "NUMBA_ENABLE_CUDASIM": "1", "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    said = subprocess.run([sys.executable, __file__, folder], env=there, capture_output=True, text=True, check=False)
    assert said.returncode == 0, said.stderr
    return {name: dict(np.load(folder / f"{name}.npz")) for name in (*NAMES, ALONE)}


if __name__ == "__main__":
    from stridor.temporal.steppers.modal import device, device_kernel

    # The simulator walks over the globals of a device function at every call, in every thread. The first warning of a
    # member that is lost would add this one meanwhile: "dictionary changed size during iteration".
    vars(device_kernel).setdefault("__warningregistry__", {})
    sys.setswitchinterval(1e-5)  # threads wait for each other at every turn
    device.THREADS, device.LONGEST = 4, 70  # a thread of Python each; several launches
    for one in NAMES:
        device_kernel.SHARED = SHARED[one]
        np.savez(Path(sys.argv[1]) / f"{one}.npz", **numbers(*run_on("gpu", made(one))))
    device_kernel.SHARED = SHARED[NAMES[0]]
    last = replace(made("legs"), tracks=made("legs").tracks[-1:])
    np.savez(Path(sys.argv[1]) / f"{ALONE}.npz", **numbers(*run_on("gpu", last)))
