"""What moves when it squeals, by both approaches (figures 11 and 12 of Meziane, Baillet and Laulagnet
2006).

The velocity of all nodes at the squeal frequency, out of a run in time at μ = 0.1, beside the
complex mode, which is stable at μ = 0.07 and unstable at 0.08. As in the paper both beams bend in
the same orders; the modal assurance criterion says how much alike they are, although the run has
long begun to stick, slip and separate.
"""

import numpy as np

import stridor as st
from stridor.case import template_text

NODES = {"beam1": 21, "beam2": 61}
LENGTH = {"beam1": 0.05, "beam2": 0.15}
points = {name: [f"{name}@{x:.9g}" for x in np.linspace(0, LENGTH[name], count)] for name, count in NODES.items()}
case = st.loads(template_text("two-beams")).with_({
    "bodies.beam1.elements": 20, "bodies.beam2.elements": 60,
    "temporal.step": None, "temporal.record_every": 40,
    "temporal.watch": [point for names in points.values() for point in names]
})  # fmt: skip
system = st.build_system(case)

lumped = case.with_({"bodies.beam1.mass": "lumped", "bodies.beam2.mass": "lumped"})  # which allows larger steps
run = st.simulate(lumped)
slide = run.phase_slice(1)
velocities = run.velocity[slide]  # (instants, points, 2)
lines = np.fft.rfft(velocities * np.hanning(len(velocities))[:, None, None], axis=0)
frequency = np.fft.rfftfreq(len(velocities), run.sampling)
audible = frequency > 1e3  # where contacts separate, a slow swing of the whole can be as strong
loudest = np.argmax(audible * np.sum(np.abs(lines) ** 2, axis=(1, 2)))
squeal, velocity = frequency[loudest], lines[loudest]
in_time = dict(zip(points, np.split(velocity, [NODES["beam1"]]), strict=True))


def shape(mu):
    modes = st.modes(case, mu, vectors="right", max_frequency_hz=12e3)
    column = np.argmin(np.abs(modes.frequency_hz[0] - squeal) - 1e-2 * modes.growth_rate[0])
    nodes = {line.name: (line.rows.free @ modes.right[0, column]).reshape(-1, 2) for line in system.lines}
    return nodes, modes.unstable[0, column]


def assurance(one, other):
    first, second = (np.concatenate([part.ravel() for part in parts.values()]) for parts in (one, other))
    return abs(np.vdot(first, second)) ** 2 / (np.vdot(first, first) * np.vdot(second, second)).real


(before, grows_before), (beyond, grows_beyond) = shape(0.07), shape(0.08)
assert not grows_before
assert grows_beyond
alike = assurance(in_time, beyond)
assert alike > 0.8
assert assurance({"beam2": in_time["beam2"]}, {"beam2": beyond["beam2"]}) > 0.99
shapes = [
    (f"in time, {squeal:.0f} Hz", in_time, True),
    ("mode at μ = 0.07", before, False),
    (f"at 0.08, MAC {alike:.2f}", beyond, False),
]
st.plot.shapes_side_by_side(system, shapes).savefig("paper_shapes.png", dpi=80)
