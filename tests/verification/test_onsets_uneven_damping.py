"""Onsets of strongly and unevenly damped beams, none of which may be lost to rounding."""

from __future__ import annotations

import numpy as np
import pytest

from stridor.case import loads, template_text
from stridor.modal.complex_modes import complex_modes
from stridor.modal.onsets import onsets
from stridor.system import build_system

pytestmark = pytest.mark.verification


def test_a_slow_onset_of_a_stiff_system_is_found():
    damping = {"bodies.beam1.damping.mass": 0.0, "bodies.beam2.damping.mass": 300.0}
    case = loads(template_text("two-beams")).with_(damping)
    system = build_system(case)
    found = onsets(system, (0.0, 0.2), max_frequency_hz=20e3)
    grid = np.linspace(0.0, 0.2, 41)
    modes = complex_modes(system, grid, max_frequency_hz=20e3)
    growing = modes.unstable.sum(axis=1)
    for low, high, before, after in zip(grid[:-1], grid[1:], growing[:-1], growing[1:], strict=True):
        inside = [o for o in found.onsets if low < o.mu <= high]
        assert sum(1 if o.growth_slope is None or o.growth_slope > 0 else -1 for o in inside) == after - before
    assert found.first is not None
    assert found.first.mu == pytest.approx(0.0600337, abs=1e-6)
    assert found.first.frequency_hz == pytest.approx(492.28, abs=0.01)
