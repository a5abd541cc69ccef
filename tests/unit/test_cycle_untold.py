"""What harmonic balance cannot tell of sticks and slips is said beside their shares."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from stridor.periodic.cycle import Change, Cycle
from stridor.periodic.cycles import Cycles


def cycle(method: str, harmonics: int, stick: float) -> Cycle:
    """A cycle of one contact, of which nothing but its method and its shares is known."""
    blank = dict.fromkeys((f.name for f in fields(Cycle)), None)
    given = {
        "mu": 1.0, "period": 1.0, "multipliers": np.array([0.5]), "multiplied": True, "own_off": np.nan, "defect": 0.0, "changes": (),
        "contact_names": ("a",),
        "method": method, "harmonics": harmonics, "shares": np.array([[0.0, stick, 1.0 - stick]]), "status": np.full((2, 1), 2), "slip_velocity": np.ones((2, 1)),
    }  # fmt: skip
    return Cycle(**{**blank, **given})


@pytest.mark.parametrize(
    ("method", "harmonics", "stick", "share", "said"),
    [
        ("harmonic", 16, 0.0, 1 / 16, "; sticks shorter than about 6.2 % of a period are not told (harmonic balance)"),
        ("harmonic", 16, 0.3, 1 / 16, "; reversals of slip shorter than about 6.2 % of a period are not told (harmonic balance)"),
        ("harmonic", 16, 1.0, 1 / 16, "; slips shorter than about 6.2 % of a period are not told (harmonic balance)"),
        ("shooting", 0, 1.0, None, ""),
        ("shooting", 0, 0.0, None, ""),
    ],
)
def test_no_stick_or_slip_by_harmonics_is_none_that_they_tell(method, harmonics, stick, share, said) -> None:
    one = cycle(method, harmonics, stick)
    assert one.untold_share == share
    found = Cycles((one,), (), (), None)
    assert found.sentence.split("stable", 1)[1] == said


def test_what_several_cycles_may_do_is_said_at_once() -> None:
    found = Cycles(tuple(cycle("harmonic", h, stick) for h, stick in ((16, 0.0), (26, 0.45), (20, 1.0))), (), (), None)
    said = "; sticks, slips and reversals of slip shorter than about 6.2 % of a period are not told (harmonic balance)"
    assert found.sentence.endswith(said)
    turns = tuple(Change(t, "a", "slips", (way,)) for t, way in ((0.1, 2), (0.2, 3), (0.3, 1)))
    assert replace(cycle("harmonic", 16, 0.3), changes=turns).untold == ()


def test_which_cycles_are_not_found_is_said_whatever_was() -> None:
    nothing = Cycles((), (), (), (0.1, 0.5))
    assert nothing.to_json()["reach"] == nothing.reach
    assert nothing.reach in nothing._repr_html_()
