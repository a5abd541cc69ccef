"""A parameter study in five lines: the critical friction over the lean of the upper beam.

The bench squeals from μ = 0.0766 on with the paper's lean of 5°. The more upright the beam, the
less friction it takes, down to nearly none; leaning the other way it is silent, since only the sign
of V sin β matters.
"""

import numpy as np
from matplotlib import pyplot as plt

import stridor as st
from stridor.case import template_text

case = st.loads(template_text("two-beams")).with_({"modal.max_frequency_hz": 10e3})
leans = np.array([-5.0, 1.0, 2.5, 5.0, 10.0])
onsets = [
    st.onsets(case.with_({"bodies.beam1.angle_deg": 90 - lean}), (0.0, 0.3), damped=False).first for lean in leans
]
critical = np.array([np.nan if onset is None else onset.mu for onset in onsets])

assert np.isnan(critical[leans < 0]).all()
assert np.all(np.diff(critical[leans > 0]) > 0)
assert abs(critical[leans == 5][0] - 0.0766) < 6e-5

figure, ax = plt.subplots(figsize=(6, 3.8), layout="constrained")
ax.plot(leans, critical, "o-")
ax.set(
    xlabel="lean of beam 1 [degrees]",
    ylabel="critical friction coefficient",
    title="The lower beam moves to the right",
)
figure.savefig("parameter_study.png", dpi=80)
