"""A module that takes a while to import, and keeps what it began where it is stopped."""

import time

import page_programs

page_programs.BEGUN = getattr(page_programs, "BEGUN", 0) + 1  # type: ignore[attr-defined]
for _ in range(500):
    time.sleep(0.002)
WHOLE = page_programs.BEGUN  # type: ignore[attr-defined]
