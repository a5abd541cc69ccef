"""One growth rate, found twice: complex modes and a small perturbation marched in time, on both sides
of the onset.

Nothing is shared but the model. Away from the onset the growth of the perturbation agrees with Re λ
to better than a per cent and its frequency to a tenth of that (the project's own criterion is 5 %
and 1 %: docs/validation.md).
"""

import numpy as np
from matplotlib import pyplot as plt

import stridor as st
from stridor.case import template_text

case = st.loads(template_text("two-beams")).with_(
    {"bodies.beam1.elements": 10, "bodies.beam2.elements": 30, "temporal.step": None, "modal.max_frequency_hz": 20e3}
)
onset = st.onsets(case, (0.0, 0.12)).first
mus = onset.mu + np.array([-0.02, 0.01, 0.02, 0.03])
agreement = st.compare(case, mus, only=("growth",))
assert [row.modal_eigenvalue.real > 0 for row in agreement.comparisons] == [False, True, True, True]
for row in agreement.comparisons[1:]:
    assert row.growth_rate_error < 0.01
    assert row.frequency_error < 0.001
assert agreement.agree

sweep = st.modes(case, np.linspace(mus[0], mus[-1], 60))
fastest = np.where(sweep.in_band, sweep.growth_rate, -np.inf).max(axis=1)
figure, ax = plt.subplots(figsize=(6, 4), layout="constrained")
ax.plot(sweep.mu, fastest, "C0", label="largest Re λ of the complex modes")
ax.plot(mus, [row.perturbation.eigenvalue.real for row in agreement.comparisons], "ko", label="perturbation in time")
ax.plot(onset.mu, 0, "kD", markerfacecolor="none", label=f"onset at μ = {onset.mu:.4f}")
ax.axhline(0, color="0.5", linewidth=0.8)
ax.set(
    xlabel="friction coefficient μ", ylabel="growth rate [1/s]", title="Growth of small vibration, by both approaches"
)
ax.legend()
figure.savefig("growth_both_ways.png", dpi=80)
