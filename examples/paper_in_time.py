"""The same bench in time: squeal grows until it sticks and slips (figures 8, 9 and 10 of Meziane,
Baillet and Laulagnet 2006).

The beams are pressed together for 0.05 s, then the clamp moves. The paper reports a fundamental of
8.7 kHz, waves of stick and slip in each period, and a contact force that peaks at about 37 N, twice
the load. Here on a coarser mesh with lumped masses, which takes a second instead of ten.
"""

import numpy as np
from matplotlib import pyplot as plt

import stridor as st
from stridor.case import template_text

COARSE = {
    "bodies.beam1.elements": 20,
    "bodies.beam2.elements": 60,
    "bodies.beam1.mass": "lumped",
    "bodies.beam2.mass": "lumped",
}
case = st.loads(template_text("two-beams")).with_(
    COARSE | {"temporal.step": None, "temporal.record_every": 10, "temporal.watch": ("beam1.tip", "beam2.end")}
)
run = st.simulate(case)
summary = st.summarise(case, run)
assert abs(summary.dominant_frequency_hz - 8700) < 0.02 * 8700
assert summary.energy.error < 1e-9  # every joule is accounted for
opened = run.phases[1].contacts["A"].first_separation
sliding = (run.time > 0.05) & (run.time < opened)
assert 33 < run.normal_force[sliding].max() < 45

figure, (top, middle, bottom) = plt.subplots(3, figsize=(6.5, 7), layout="constrained")
top.plot(run.time, run.acceleration[:, 0, 0], "C0", linewidth=0.4)
top.axvline(opened, color="C3", linewidth=0.8, label="first separation")
top.set(xlabel="time [s]", ylabel="acceleration [m/s²]", title="slave node, along x", xlim=(0, 0.1), ylim=(-2e4, 2e4))
top.legend(loc="upper left")
frequency = np.fft.rfftfreq(sliding.sum(), run.sampling)
band = (frequency > 0) & (frequency < 40e3)
for name, signal in (
    ("slave node, along x", run.acceleration[:, 0, 0]),
    ("end of beam 2, along y", run.acceleration[:, 1, 1]),
):
    level = np.abs(np.fft.rfft(signal[sliding] * np.hanning(sliding.sum()))) * 4 / sliding.sum()
    middle.plot(frequency[band] / 1e3, 20 * np.log10(level[band]), linewidth=0.8, label=name)
middle.set(
    xlabel="frequency [kHz]",
    ylabel="dB re 1 m/s²",
    xlim=(0, 40),
    title=f"{summary.dominant_frequency_hz:.0f} Hz and its multiples",
)
middle.legend(fontsize=8)
last = (run.time > opened - 3.2 / summary.dominant_frequency_hz) & (run.time < opened)
milliseconds = 1e3 * run.time[last]
bottom.plot(milliseconds, run.normal_force[last, 0], "k", label="normal force [N]")
bottom.plot(milliseconds, 100 * np.abs(run.slip_speed[last, 0]), "C0", label="slip speed [cm/s]")
bottom.fill_between(milliseconds, 0, 50, where=run.status[last, 0] == 1, color="0.85", label="sticks")
bottom.set(
    xlabel="time [ms]", ylim=(0, 50), xlim=(milliseconds[0], milliseconds[-1]), title="three periods of stick and slip"
)
bottom.legend(ncols=3, loc="upper center", fontsize=8)
figure.savefig("paper_in_time.png", dpi=58)
