"""What onsets hang on: the number of elements, and the stiffness of the contact.

Three elements on the pin give the first onset of the two-beam bench to 0.7 %, and the second to 31 %. A
contact of 1e9 N/m or more is as good as rigid for the first onset; one of 1e7 N/m has it at 0.50 instead of
0.077. The picture tells what to vary before believing a number.
"""

from matplotlib import pyplot as plt

import stridor as st
from stridor.case import template_text

case = st.loads(template_text("two-beams"))
counts = [3, 4, 5, 6, 8, 10, 15, 20, 30, 60]
stiffnesses = [1e7, 2e7, 3e7, 5e7, 1e8, 2e8, 5e8, 1e9, 3e9, 1e10, 1e11]
fine = [o.mu for o in st.onsets(case).onsets]


def onsets(changes):
    return [o.mu for o in st.onsets(case.with_(changes)).onsets]


by_count = [onsets({"bodies.beam1.elements": n, "bodies.beam2.elements": 3 * n}) for n in counts]
by_stiffness = [onsets({"contacts.A.stiffness": k}) for k in stiffnesses]
rigid = onsets({"contacts.A.stiffness": "rigid"})
assert abs(by_count[0][0] / fine[0] - 1) < 0.007 < 0.3 < by_count[0][1] / fine[1] - 1
assert all(abs(found[0] / rigid[0] - 1) < 0.004 for found in by_stiffness[7:])
assert round(by_stiffness[0][0], 2) == 0.50

figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.4), layout="constrained", sharey=True)
for ax, xs, found in ((left, counts, by_count), (right, stiffnesses, by_stiffness)):
    for x, values in zip(xs, found, strict=True):
        ax.plot([x] * len(values), values, "o", ms=4, color="C0")
        ax.plot(x, values[0], "o", ms=6, color="C3")
    ax.set_xscale("log")
    ax.grid(alpha=0.3)
left.set(xlabel="elements of the pin", ylabel="critical μ", title="Mesh", xticks=[3, 5, 10, 20, 60], ylim=(0, 0.9))
left.set_xticks([], minor=True)
left.set_xticklabels(["3", "5", "10", "20", "60"])
right.set(xlabel="contact stiffness [N/m]", title="Contact")
right.plot([], [], "o", ms=6, color="C3", label="first onset")
right.plot([], [], "o", ms=4, color="C0", label="further ones")
right.legend()
figure.savefig("what_onsets_hang_on.png", dpi=80)
