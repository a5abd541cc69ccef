"""What would quieten it? Changes ranked by the growth that a per cent of each takes away, the best
ones solved again.

The derivatives of an eigenvalue come from its two eigenvectors, dλ/dp = −yᵀ(dP/dp)x / yᵀ(dP/dλ)x;
here one of them is held against the difference of two solutions, to five digits.
"""

import stridor as st
from stridor.case import template_text

case = st.loads(template_text("two-beams"))
number = "bodies.beam1.thickness"
linear = st.sensitivities(case, ["mu", number], mu=0.1)
(branch,) = linear.branch  # one mode is unstable


def eigenvalue(changed):
    modes = st.modes(changed, 0.1)
    return modes.eigenvalues[0, list(modes.branch).index(branch)]


step = 1e-5 * 0.0015
by_difference = (eigenvalue(case.with_({number: 0.0015 + step})) - eigenvalue(case.with_({number: 0.0015 - step}))) / (
    2 * step
)
assert abs(linear.of(number)[0] / by_difference - 1) < 1e-5

ranked = st.rank_countermeasures(case, mu=0.1, percent=2.0, verify=3)
best = ranked.measures[0]
assert best.verified is not None
assert best.verified.growth_rate < linear.growth_rate[0]
st.plot.countermeasure_bars(ranked).savefig("countermeasures.png", dpi=80)
