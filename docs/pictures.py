"""Draws the pictures with which pages of the documentation open and that no example draws: python docs/pictures.py"""

import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from PIL import Image

import stridor as st
from stridor.agreement.perturbation import modes_as_in_time, perturb
from stridor.study.settings import settings_of
from stridor.temporal.steppers.implicit import warp

STRIDOR = str(Path(sys.executable).parent / "stridor")
IMAGES = Path(__file__).parent / "images"
case = st.loads(st.case.template_text("two-beams"))
pad = st.loads(st.case.template_text("pad-on-disc"))
WRITTEN = 12_000  # rows a second, docs/scaling.md
coarse = {"disc": [4, 48, 1], "lining": [6, 12, 2], "plate": [6, 12, 1]}
pad = pad.with_({f"bodies.{name}.mesh.divisions": value for name, value in coarse.items()})


def save(figure, name: str, size: tuple[float, float]) -> None:
    """A PNG of a figure, which is closed."""
    figure.set_size_inches(*size)
    figure.savefig(IMAGES / f"{name}.png", dpi=80)
    plt.close(figure)


def terminal(name: str, command: str, text: str) -> None:
    """What a command prints, as on a terminal: rows of unstable modes are red there, too."""
    lines = [f"$ {command}", *text.splitlines()]
    figure = plt.figure(facecolor="#1e1e1e")
    for k, line in enumerate(lines):
        colour = "#ff6b6b" if "  unstable  " in line else "#e0e0e0"
        figure.text(0.02, 1 - (k + 1) / (len(lines) + 1), line, family="monospace", size=9, color=colour)
    save(figure, name, (7.8, 0.185 * (len(lines) + 1)))


def imported_branches() -> None:
    """Onsets of matrices, which stridor has exported itself."""
    with tempfile.TemporaryDirectory() as folder:
        st.export(case, folder)
        own = st.load(Path(folder) / "matrices.toml")
        modes = st.modes(own, np.linspace(0, 1, 81), max_frequency_hz=20e3)
        save(st.plot.frequency_branches(modes, onsets=st.onsets(own)), "imported-branches", (7, 3.6))


def steady_pressure() -> None:
    """What `stridor steady` draws of the pad, coarse."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "pad.toml").write_text(pad.to_toml(), encoding="utf-8")
        subprocess.run([STRIDOR, "steady", "pad.toml"], cwd=folder, check=True, capture_output=True)
        with Image.open(Path(folder) / "pad.out" / "steady-face.png") as drawn:
            drawn.convert("RGB").reduce(2).save(IMAGES / "steady.png", optimize=True)


def factors() -> None:
    """Memory of factors by the rule of the page, through what was measured on the pad on the disc."""
    freedoms = np.geomspace(1e4, 1e7, 50)
    figure, ax = plt.subplots(layout="constrained")
    ax.loglog(freedoms, 0.7 * (freedoms / 52e3) ** (4 / 3), label="grows as the power 4/3")
    ax.plot(52e3, 0.7, "o", color="C3", label="pad on disc, measured")
    ax.axhline(64, color="0.5", ls="--", lw=1)
    ax.annotate("64 GB", (1.1e4, 70), color="0.4")
    ax.set(xlabel="degrees of freedom", ylabel="factors [GB]")
    ax.grid(alpha=0.3)
    ax.legend(loc="lower right")
    save(figure, "factors", (6, 3))


def listing() -> None:
    """What `stridor modes` prints."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "two-beams.toml").write_text(st.case.template_text("two-beams"), encoding="utf-8")
        words = ["modes", "two-beams.toml", "--band", "5000:20000"]
        done = subprocess.run([STRIDOR, *words], cwd=folder, check=True, capture_output=True, text=True)
        terminal("terminal", " ".join(["stridor", *words]), done.stdout)


def ensemble() -> None:
    """Which mode responds over friction and speed, from steady sliding on."""
    steady = {
        "temporal.initial": "steady-sliding", "temporal.perturbation": 1e-4, "phases.press.velocities": {"clamp": 1.0},
        "phases.press.duration": 1e-3, "phases.slide.duration": 0.03,
    }  # fmt: skip
    found = st.ensemble(case.with_(steady), mu=np.linspace(0.05, 0.3, 6), speed=np.linspace(0.5, 2.0, 4))
    save(st.plot.ensemble_map(found), "ensemble", (8.4, 7.6))


def study() -> None:
    """Samples over friction and damping, as `stridor study` draws them."""
    normal = {"distribution": "normal", "mean": 5.0, "deviation": 1.0, "low": 0.0}
    parameters = {"mu": {"range": (0.0, 0.3)}, "bodies.beam1.damping.mass": normal}
    made = st.Study(case=case, parameters=parameters, sampling={"method": "sobol", "samples": 512, "seed": 1})
    with tempfile.TemporaryDirectory() as folder:
        save(st.study_figures(st.run_study(made, folder))["stability-map"], "study", (7.6, 4.4))


def study_cost() -> None:
    """Rows a second over workers by the figures of the page: seconds of a row, rows a second that one store takes."""
    workers = np.geomspace(1, 1e4, 60)
    figure, ax = plt.subplots(layout="constrained")
    for seconds, label in ((0.131, "full problem"), (0.0034, "reduced model")):
        (line,) = ax.loglog(workers, workers / seconds, "--", linewidth=1)
        ax.loglog(workers, np.minimum(workers / seconds, WRITTEN), color=line.get_color(), label=label)
    ax.axhline(WRITTEN, color="0.4", linewidth=0.8)
    ax.text(1.2, 1.3 * WRITTEN, "what one store takes", color="0.3")
    ax.set(xlabel="workers", ylabel="rows a second", xlim=(1, 1e4))
    ax.grid(visible=True, color="0.9")
    ax.legend(frameon=False, loc="lower right")
    save(figure, "study-cost", (7, 3.6))


def boundary() -> None:
    """Where modes of the two beams begin to grow over friction and a thickness."""
    found = st.stability_boundary(case, "bodies.beam1.thickness", "mu", x_range=(0.001, 0.002), y_range=(0.0, 0.5))
    save(st.plot.stability_boundary(found), "boundary", (7, 4.2))


def exact_steps() -> None:
    """Explicit runs of the bench from steady sliding, with stick, separation and impacts, beside the exact one."""
    sliding = case.with_(
        {"temporal.initial": "steady-sliding", "temporal.perturbation": 1e-6, "phases.press.ramp": 0.0,
         "phases.press.duration": 1e-6, "phases.press.velocities": {"clamp": 1.0}, "phases.slide.duration": 6.1e-3,
         "contacts.A.friction.coefficient": 0.1}
    )  # fmt: skip
    steps = np.array([2e-8, 1e-8, 5e-9, 2.5e-9, 1.25e-9])
    exact = st.simulate(sliding.with_({"temporal.stepper": "exact", "temporal.step": 5e-7, "temporal.record_every": 1}))
    figure, (left, right) = plt.subplots(1, 2, layout="constrained", width_ratios=(3, 2))
    shown = (exact.time > 5.85e-3) & (exact.time < 6e-3)
    time, force, off = 1e3 * exact.time[shown], exact.normal_force[shown, 0], []
    for step in steps:
        run = st.simulate(sliding.with_({"temporal.step": step, "temporal.record_every": round(5e-7 / step)}))
        off.append(np.abs(run.normal_force[shown, 0] - force).max())
        if step == steps[0]:
            left.plot(time, run.normal_force[shown, 0], color="C1", lw=2, label="explicit, 2e-8 s")
    left.plot(time, force, "k--", lw=1, label="exact")
    left.set(xlabel="time [ms]", ylabel="normal force [N]", ylim=(-2, 52))
    left.legend(loc="upper left", ncols=2)
    right.loglog(steps * 1e9, off, "o-")
    right.loglog(steps * 1e9, off[0] * (steps / steps[0]) ** 2, ":", color="0.5", label="second order")
    right.loglog(steps * 1e9, off[-1] * (steps / steps[-1]) ** -2, "--", color="0.5", label="rounding")
    right.set(xlabel="explicit step [ns]", ylabel="largest difference [N]")
    right.set_xticks([1.25, 2.5, 5, 10, 20], ["1.25", "2.5", "5", "10", "20"])
    right.minorticks_off()
    right.legend()
    save(figure, "exact", (8, 3.2))


def cycles() -> None:
    """The minimal model of mode coupling over friction: the branch from the onset, and the loud one."""
    text = (Path(__file__).parent / "limit-cycles.md").read_text(encoding="utf-8")
    block = text.partition("```python\n")[2].partition("found = ")[0].replace("(-0.1, 0)", "(-1, 0)")
    known: dict = {}
    exec(block, known)  # the case of the page, on a faster belt
    save(st.plot.cycle_branches(st.cycles(known["case"], between=(0.6, 1.8))), "cycles", (7, 4.4))


def implicit_steps() -> None:
    """Growth and frequency of a small motion of two beams over the steps to its period, with and without the warp."""
    small = case.with_({"bodies.beam1.elements": 10, "bodies.beam2.elements": 20})
    system, highest, parts = st.build_system(small), 10.4e3, np.array([12, 20, 30])
    asked = settings_of(small)
    modes = modes_as_in_time(asked.system(system), 0.1, highest)
    wanted = modes.eigenvalues[0][np.argmax(modes.eigenvalues[0].real)]
    figure, axes = plt.subplots(1, 2, layout="constrained")
    for last, mark, name in ((1.0, "o-", "warped"), (1e-9, "s--", "plain midpoint rule")):
        warp.LAST, off = last, []
        for part in parts:
            settings = replace(asked, stepper="implicit", step=2 * np.pi / wanted.imag / part, max_frequency_hz=highest)
            seen = perturb(system, 0.1, settings=settings, max_frequency_hz=highest, modes=modes).components.eigenvalues
            value = seen[np.argmin(np.abs(seen - wanted))]
            off.append([abs(value.real / wanted.real - 1), abs(value.imag / wanted.imag - 1)])
        for ax, column in zip(axes, np.transpose(off), strict=True):
            ax.loglog(parts, column, mark, label=name)
    warp.LAST = 1.0
    for ax, label in zip(axes, ("growth off by", "frequency off by"), strict=True):
        ax.set(xlabel="steps to the period", ylabel=label)
        ax.set_xticks(parts, [str(part) for part in parts])
        ax.minorticks_off()
        ax.legend()
    save(figure, "implicit", (8, 3.2))


if __name__ == "__main__":
    save(st.plot.model(case), "two-beams", (8, 3.4))
    save(st.plot.model(pad), "pad-on-disc", (7, 4.4))
    listed = imported_branches, steady_pressure, factors, listing, ensemble, study, study_cost, boundary, exact_steps
    listed += (cycles, implicit_steps)
    for draw in listed:
        draw()
