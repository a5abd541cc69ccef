"""How errors read."""

from __future__ import annotations

from stridor.errors import CaseError


def test_a_name_as_long_as_a_file_is_cut_in_the_middle() -> None:
    told = str(CaseError("bodies.pad.file", "m.inp", f"there is no element set {'BO{A=' * 500}; it has: TOP"))
    assert len(told) < 400
    assert told.endswith("; it has: TOP")
