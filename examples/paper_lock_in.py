"""The two-beam bench without damping: two modes lock in (figures 3 and 4 of Meziane, Baillet and
Laulagnet 2006).

The real part of two frequencies over friction, and the imaginary part that opens where they meet.
The paper prints μ = 0.08 and 8636 Hz (table II); solved, the onset lies at μ = 0.0766 and 8635.4
Hz, and growth opens as κ √(μ − μ_c).
"""

import numpy as np
from matplotlib import pyplot as plt

import stridor as st
from stridor.case import template_text

case = st.loads(template_text("two-beams"))
onset = st.onsets(case, (0.0, 0.12), damped=False).first
assert round(onset.mu, 2) == 0.08
assert abs(onset.frequency_hz - 8636) < 1

sweep = st.modes(case, np.linspace(0, 0.12, 121), damped=False)
pair = [list(sweep.branch).index(number) for number in onset.branches]
frequency, growth = sweep.frequency_hz[:, pair], sweep.growth_rate[:, pair]
just_above = np.searchsorted(sweep.mu, onset.mu + 0.001)
kappa = growth[just_above].max() / np.sqrt(sweep.mu[just_above] - onset.mu)
assert abs(kappa / onset.square_root_coefficient - 1) < 0.02

figure, (above, below) = plt.subplots(2, sharex=True, figsize=(6, 4.5), layout="constrained")
above.plot(sweep.mu, frequency, label=[f"mode {number}" for number in onset.branches])
above.plot(onset.mu, onset.frequency_hz, "kD", label=f"μ = {onset.mu:.4f}, {onset.frequency_hz:.1f} Hz")
above.set(ylabel="frequency [Hz]", title="Lock-in of two modes")
above.legend()
below.plot(sweep.mu, growth)
beyond = np.linspace(onset.mu, 0.12, 100)
below.plot(beyond, onset.square_root_coefficient * np.sqrt(beyond - onset.mu), "k:", label="κ √(μ − μ_c)")
below.set(xlabel="friction coefficient μ", ylabel="growth rate [1/s]", xlim=(0, 0.12))
below.legend()
figure.savefig("paper_lock_in.png", dpi=80)
