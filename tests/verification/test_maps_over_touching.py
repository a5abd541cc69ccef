"""The lowest onset over two numbers has the contact state of its own friction, whichever the case's own may be.

Two masses on belts that are kept on them: which contacts pull changes with friction, and with them the onsets. The
truth tries all signs on a fine grid of μ (751 of them) and counts what grows.
"""

from __future__ import annotations

from functools import cache

import pytest

import stridor as st
from stridor.study.damping_full import FullSearch, onset_slopes
from stridor.study.workspace import Workspace

pytestmark = pytest.mark.verification

CASE = """
units = "nondimensional"
bodies.m0 = { type = "mass", mass = 0.9778, position = [0.0, 0.0, 0.0] }
bodies.m1 = { type = "mass", mass = 1.674, position = [1.0, 0.0, 0.0] }
bodies.b0 = { type = "obstacle", shape = "flat", point = [0.002112, -0.02116, 0.006801], normal = [-0.0946, 0.9478, -0.3046], sliding = { velocity = [-0.2017, 0.009529, 0.09231] } }
bodies.b1 = { type = "obstacle", shape = "flat", point = [1.0, 0.0, 0.0], normal = [0.459, 0.8306, 0.3154], sliding = { velocity = [0.2178, -0.1449, 0.06449] } }
loads.p0 = { at = "m0", force = [0.4999, -0.7988, 0.05715] }
loads.p1 = { at = "m1", force = [-0.7191, -2.558, -0.6926] }
contacts.c0 = { slave = "m0", master = "b0", stiffness = 163.4, closed = true, friction = { law = "coulomb", coefficient = 0.276 } }
contacts.c1 = { slave = "m1", master = "b1", stiffness = "rigid", closed = true, friction = { law = "coulomb", coefficient = 0.4557 } }
springs.s0 = { between = ["m0", "ground"], stiffness = 180.4, damping = 0.03855, direction = [-0.7647, 0.06541, 0.6411] }
springs.s1 = { between = ["m0", "ground"], stiffness = 73.67, damping = 0.1214, direction = [-0.6069, -0.4077, -0.6823] }
springs.s2 = { between = ["m0", "ground"], stiffness = 26.39, damping = 0.01, direction = [0.2167, -0.9108, 0.3515] }
springs.s3 = { between = ["m1", "ground"], stiffness = 184.3, damping = 0.01, direction = [-0.8649, 0.1931, 0.4634] }
springs.s4 = { between = ["m1", "ground"], stiffness = 41.66, damping = 0.03037, direction = [-0.493, -0.5009, -0.7114] }
springs.s5 = { between = ["m1", "ground"], stiffness = 63.99, damping = 0.07771, direction = [0.09476, -0.8437, 0.5284] }
springs.s6 = { between = ["m1", "m0"], stiffness = 69.34, direction = [-0.1644, -0.98, 0.112] }
modal = { friction_range = [0.0, 1.5], max_frequency_hz = 20.0, modes = 100, friction_damping = true }
"""
DAMPINGS = ("springs.s0.damping", "springs.s1.damping")
# Between which μ growth begins, by the truth.
TRUTH = {(0.05, 0.05): (0.722, 0.724), (0.05, 0.1): (0.736, 0.738), (0.1, 0.05): (0.555, 0.557)}


@cache
def case(own: float) -> st.Case:
    return st.loads(CASE).with_({f"contacts.c{k}.friction.coefficient": own for k in range(2)})


@pytest.mark.parametrize("own", [0.3, 0.9])
def test_the_lowest_onset_is_the_truth_for_any_own_friction(own: float) -> None:
    search = FullSearch(case(own), DAMPINGS, (0.0, 1.5), 20.0)
    for (x, y), (low, high) in TRUTH.items():
        found, told = search.lowest(x, y)
        assert found is not None, (x, y)
        assert not told
        assert low < found.mu < high, (x, y)


def test_leaving_the_check_out_changes_no_onset() -> None:
    varied = case(0.3).with_({DAMPINGS[0]: 0.1, DAMPINGS[1]: 0.05})
    checked, plain = (st.onsets(varied, check=check) for check in (True, False))
    assert [(o.mu, o.kind) for o in plain] == [(o.mu, o.kind) for o in checked]
    assert checked.completeness
    assert not plain.completeness


def test_slopes_hold_the_contacts_that_touch_at_the_onset() -> None:
    at = {DAMPINGS[0]: 0.05, DAMPINGS[1]: 0.05}

    def onset(more: dict[str, float]) -> st.Onset:
        first = st.onsets(case(0.3).with_(at | more), check=False).first
        assert first is not None
        return first

    slopes = onset_slopes(Workspace(case(0.3).with_(at)), onset({}), DAMPINGS, (0.0, 1.5))
    for path, slope in zip(DAMPINGS, slopes, strict=True):
        after, before = (onset({path: at[path] + step}).mu for step in (1e-5, -1e-5))
        assert slope == pytest.approx((after - before) / 2e-5, rel=1e-5)
