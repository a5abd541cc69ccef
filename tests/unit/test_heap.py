"""Memory that a program frees and needs again."""

from __future__ import annotations

import subprocess
import sys

import pytest

FAULTS = """
import resource, sys
import numpy as np
from stridor import heap

if sys.argv[1] == "keep":
    heap.keep()
for turn in range(21):
    if turn == 1:  # the first is new in any case
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    vectors = [np.empty(5_000_000) for _ in range(2)]
    for vector in vectors:
        vector[:] = 1.0
    del vector, vectors
    if sys.argv[1] == "give back":
        heap.give_back()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def faults(how: str) -> int:
    done = subprocess.run([sys.executable, "-c", FAULTS, how], capture_output=True, text=True, check=True, timeout=60)
    return int(done.stdout)


@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux how many pages it had to clear")
def test_what_is_kept_is_not_cleared_again() -> None:
    without = faults("as it is")
    if without < 200:
        pytest.skip("this C library keeps it anyway")
    assert faults("keep") < 0.2 * without
