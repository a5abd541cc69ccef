"""Charts of onsets and of modes at points: what is drawn is what was found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stridor as st
from mode_coupling import mode_coupling
from stridor.modal.parametric import ModesAtPoints
from stridor.view.modal_plots import root_locus
from stridor.view.onset_plots import modes_at_points, onset_chart


@pytest.fixture(scope="module")
def case() -> st.Case:
    from stridor.case import template_text

    return st.loads(template_text("two-beams")).with_({"bodies.beam1.elements": 6, "bodies.beam2.elements": 18})


def drawn(figure, label: str) -> list[tuple[float, float]]:
    """Points of the lines of a name."""
    lines = [line for line in figure.axes[0].lines if line.get_label() == label]
    return [point for line in lines for point in zip(line.get_xdata(), line.get_ydata(), strict=True)]


def test_onsets_are_drawn_where_growth_begins_and_where_it_ends(case: st.Case) -> None:
    found = st.onsets(case, (0.0, 1.0), max_frequency_hz=20e3)
    figure = onset_chart(found)
    for label, ending in (("growth begins", False), ("growth ends", True)):
        assert drawn(figure, label) == [(o.mu, o.frequency_hz / 1e3) for o in found if o.stabilising is ending]
    at_end = drawn(figure, "grows at the end of the range")
    assert at_end == [(1.0, abs(v.imag) / (2e3 * np.pi)) for v in found.at_end]
    assert len(at_end) > 0
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert texts == [f"{o.mu:.4f}" for o in found]


def test_the_legend_of_all_that_can_be_drawn_stays_in_the_picture(case: st.Case) -> None:
    found = st.onsets(case, (0.0, 1.0), max_frequency_hz=20e3)
    onset = next(iter(found))
    both = (replace(onset, stabilising=False), replace(onset, stabilising=True))
    figure = onset_chart(replace(found, onsets=both, at_start=found.at_end))
    figure.draw_without_rendering()
    legend = figure.axes[0].get_legend()
    assert legend is not None
    assert len(legend.get_texts()) == 4
    box = legend.get_window_extent()
    assert 0.0 <= box.x0 < box.x1 <= figure.bbox.x1
    assert figure.axes[0].get_window_extent().x1 > 0.95 * figure.bbox.x1  # nor does it narrow the frame


def test_a_range_without_onsets_says_so(case: st.Case) -> None:
    figure = onset_chart(st.onsets(case, (0.0, 1e-3), max_frequency_hz=9e3))
    assert [text.get_text() for text in figure.axes[0].texts] == ["no onset found"]


def test_modes_at_points_leave_out_what_a_point_has_not(case: st.Case) -> None:
    two, grows = np.array([[100.0, 200.0], [110.0, np.nan]]), np.array([[True, False], [False, False]])
    found = ModesAtPoints(
        ("k", "mu"), np.array([[1.0, 0.1], [1.0, 0.2]]), two, two - 150, grows, two * 0, ~grows, two * 0,
        np.ones(2, bool), np.zeros(2, int),
    )  # fmt: skip
    figure = modes_at_points(found)
    assert figure.axes[0].get_ylabel() == "frequency [Hz]"
    assert drawn(figure, "unstable") == [(0.1, 100.0)]
    assert drawn(figure, "decays") == [(0.1, 200.0), (0.2, 110.0)]
    assert figure.axes[-1].get_xlabel() == "mu"
    assert found.counts() == [2, 1]


def test_frequencies_of_order_one_are_not_drawn_in_thousands() -> None:
    """Models of masses and springs of one, whose numbers may have no unit."""
    case = mode_coupling()
    found = st.onsets(case)
    (ax,) = onset_chart(found).axes
    assert ax.get_ylabel() == "frequency [Hz]"
    assert ax.get_ylim()[1] == found.max_frequency_hz < 1e3
    assert root_locus(st.modes(case, [0.1, 0.2])).axes[0].get_ylabel() == "frequency [Hz]"
