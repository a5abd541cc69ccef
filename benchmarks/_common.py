"""What the benchmarks share: the bench itself, and how a ratio is printed."""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from typing import Any

from threadpoolctl import threadpool_info

import stridor as st
from stridor.case import Case, template_text

# The shipped pad on a disc on the coarsest mesh, up to a frequency with one unstable mode: what --short works on.
COARSE = {
    "bodies.disc.mesh.divisions": [4, 32, 1],
    "bodies.lining.mesh.divisions": [4, 8, 1],
    "bodies.plate.mesh.divisions": [3, 7, 1],
    "modal.max_frequency_hz": 3000.0,
}


def bench() -> Case:
    """The two-beam bench as shipped."""
    return st.loads(template_text("two-beams"))


def options(text: str) -> argparse.Namespace:
    """--short: seconds instead of minutes, for CI."""
    parser = argparse.ArgumentParser(description=text)
    parser.add_argument("--short", action="store_true", help="a few repetitions of the slow side only")
    return parser.parse_args()


def best(call: Callable[[], Any], repeats: int = 3) -> tuple[float, Any]:
    """Shortest of some runs [s] and the last answer; the first call compiles and is not counted."""
    answer = call()
    times: list[float] = []
    for _ in range(repeats):
        started = time.perf_counter()
        answer = call()
        times.append(time.perf_counter() - started)
    return min(times), answer


def machine() -> str:
    """Cores, as far as Python tells, and threads of the BLAS."""
    threads = max((int(library["num_threads"]) for library in threadpool_info()), default=1)
    return f"{os.cpu_count()} cores, {threads} BLAS thread{'s' if threads > 1 else ''}"
