"""Minutes rather than seconds: run weekly."""

from __future__ import annotations

import numpy as np
import pytest

import stridor as st
from stridor.case import template_text

pytestmark = [pytest.mark.validation, pytest.mark.slow]


def test_the_nodal_path_tells_the_story_of_the_modal_one() -> None:
    """A fifth of the published run on freedoms instead of modes: equal to rounding until contact is chaotic."""
    short = {"phases.press.duration": 0.01, "phases.slide.duration": 0.01}
    case = st.loads(template_text("two-beams")).with_(short)
    modal, nodal = (st.simulate(case.with_({"temporal.path": path})) for path in ("modal", "nodal"))
    early = modal.time < 0.005
    assert np.allclose(nodal.normal_force[early], modal.normal_force[early], rtol=1e-5, atol=1e-4)
    assert st.summarise(case, nodal).energy.error < 1e-8
    for name in ("stick_fraction", "slip_fraction", "max_normal_force"):
        pair = [getattr(run.phases[-1].contacts["A"], name) for run in (modal, nodal)]
        assert pair[1] == pytest.approx(pair[0], rel=0.05)
