"""With damping a meeting becomes a crossing of the axis (figures 6 and 7 of Meziane, Baillet and
Laulagnet 2006).

Real and imaginary part of the same two eigenvalues with the bench's Rayleigh damping. The damping
ratio of 0.073 % at 8.7 kHz (the paper's equation 13) shifts the onset by a thousandth; at μ = 0.1
one mode grows, with 8641 Hz and +637 1/s.
"""

import numpy as np
from matplotlib import pyplot as plt

import stridor as st
from stridor.case import template_text

case = st.loads(template_text("two-beams"))
still = st.modes(case, 0.0)
nearest = np.argmin(np.abs(still.frequency_hz[0] - 8700))
omega = 2 * np.pi * still.frequency_hz[0, nearest]
assert np.isclose(still.damping_ratio[0, nearest], (50 / omega + 1e-8 * omega) / 2, rtol=1e-4)
assert abs((50 / (2 * np.pi * 8700) + 1e-8 * 2 * np.pi * 8700) / 2 - 0.00073) < 5e-6

damped, undamped = (st.onsets(case, (0.0, 0.12), damped=choice).first.mu for choice in (True, False))
assert 0 < damped - undamped < 2e-3 * undamped

sweep = st.modes(case, np.linspace(0, 0.12, 121))
at = sweep.at(0.1)
growing = sweep.unstable[at] & sweep.in_band[at]
assert growing.sum() == 1
assert np.allclose([sweep.frequency_hz[at][growing][0], sweep.growth_rate[at][growing][0]], [8641.1, 637.3], rtol=1e-4)
figure, (above, below) = plt.subplots(2, sharex=True, figsize=(6, 5), layout="constrained")
st.plot.frequency_branches(sweep, branches=(8, 10), ax=above)
st.plot.growth_branches(sweep, branches=(8, 10), ax=below)
above.set_xlabel("")
figure.savefig("paper_damping.png", dpi=80)
