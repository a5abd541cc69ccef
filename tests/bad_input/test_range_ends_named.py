"""Where the middle of a range is refused and an end is too, the end is named: nobody gave the middle."""

from __future__ import annotations

import pytest

import stridor as st
from stridor.case import template_text
from stridor.errors import CaseError

pytestmark = pytest.mark.bad_input
THICKNESS = "bodies.beam1.thickness"


@pytest.mark.parametrize(("ends", "named"), [((-1.0, 1.0), -1.0), ((-3.0, -1.0), -3.0)])
def test_a_boundary_names_the_end_that_was_given(ends: tuple[float, float], named: float) -> None:
    few = ["bodies.beam1.elements=3", "bodies.beam2.elements=6", "modal.max_frequency_hz=3e3"]
    case = st.loads(template_text("two-beams"), few)
    with pytest.raises(CaseError) as told:
        st.stability_boundary(case, THICKNESS, "mu", x_range=ends, y_range=(0.0, 1.0))
    assert str(told.value).startswith(f"{THICKNESS}: {named} – must be a number > 0")
