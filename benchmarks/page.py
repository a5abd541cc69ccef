"""From a slider to the picture, in a real browser: how long until the branches of the moved case are on the screen.

python benchmarks/page.py [--short] [--process] [--lever PATH …] [CASE.toml]
With --process no browser: the processor time that a move takes in the process that computes for the page, which says
more where other programs run beside it.
Of a large model, which has a reduced one over μ and the contact stiffness, --lever mu: others make that anew.
Needs the extra app, playwright, and Chromium at /usr/bin/chromium; without them it says so and leaves.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

CHROMIUM = Path("/usr/bin/chromium")
PICTURES = {"at": "modes at μ", "locus": "branches"}
MOVE = """([path, share]) => new Promise((done) => {
  const slider = document.querySelector(`[data-path="${path}"]`), times = {};
  const parts = path === "mu" ? ["at"] : ["at", "locus"], began = performance.now();
  const before = Object.fromEntries(parts.map((part) => [part, stridor.state.drawn[part] ?? 0]));
  const value = Math.round(share * slider.max);
  slider.value = value === Number(slider.value) ? value + 1 : value; // what stays where it is draws nothing
  slider.dispatchEvent(new Event("input", { bubbles: true }));
  const look = () => {
    const now = performance.now() - began;
    for (const part of parts) if ((stridor.state.drawn[part] ?? 0) > before[part]) times[part] ??= now;
    if (parts.every((part) => part in times)) done(times);
    else requestAnimationFrame(look);
  };
  look();
})"""


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--short", action="store_true", help="fewer moves")
    parser.add_argument("--process", action="store_true", help="processor time in the page's process, no browser")
    parser.add_argument("--lever", action="append", default=[], help="its path (default: the first four)")
    parser.add_argument("case", nargs="*", help="a case file (default: the two beams)")
    args = parser.parse_args()
    if args.process:
        compute(args.case, 4 if args.short else 60, args.lever)
        return
    if find_spec("nicegui") is None or find_spec("playwright") is None or not CHROMIUM.exists():
        print("no measurement: needs nicegui, playwright and /usr/bin/chromium")
        return
    command = [sys.executable, "-m", "stridor", "app", "--no-browser", "--quiet", *args.case]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    try:
        measure(server.stdout.readline().strip(), 4 if args.short else 60, args.lever)
    finally:
        server.terminate()
        server.wait(20)
        server.stdout.close()


def measure(address: str, moves: int, levers: list[str]) -> None:
    """Moves of some sliders, one after the other."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 720})
        page.set_default_timeout(900_000)  # large models take minutes to be made
        began = time.perf_counter()
        page.goto(address)
        page.wait_for_function("typeof stridor !== 'undefined' && stridor.state.onsets !== null")
        print(f"the page with its onsets after {time.perf_counter() - began:.1f} s", flush=True)
        paths: list[str] = page.evaluate("stridor.state.levers.map((lever) => lever.path)")
        for path in levers or paths[:4]:
            each = [moved(page, path, k / moves) for k in range(1, moves)]
            for part in (p for p in PICTURES if p in each[0]):
                print(f"{path}: slider to {PICTURES[part]}, {spread([times[part] for times in each])}", flush=True)
        browser.close()


def spread(each: list[float]) -> str:
    """Median and 95th percentile of times [ms]."""
    ordered = sorted(each)
    p95 = ordered[min(len(ordered) - 1, int(0.95 * len(ordered)))]
    return f"median {statistics.median(each):.0f} ms, p95 {p95:.0f} ms ({len(each)} moves)"


class Enough(BaseException):
    """The picture is there; what comes then is for when nothing moves."""


def compute(case: list[str], moves: int, levers: list[str]) -> None:
    """The same moves, asked of what the page's process runs."""
    from stridor.app.page import source_of
    from stridor.app.page.bench import bench
    from stridor.app.page.levers import friction_range
    from stridor.app.page.levers import levers as levers_of
    from stridor.app.page.state import PageState, checked, first_state
    from stridor.app.page.worker import IDLE

    ends = {IDLE}

    def send(part: str, _: object) -> None:
        if part in ends:
            raise Enough

    answer = bench()

    def asked(state: PageState) -> float:
        began = time.process_time()
        with suppress(Enough):
            answer(state, send)
        return 1e3 * (time.process_time() - began)

    first = first_state(source_of(case[0] if case else None))
    known = {lever.path: lever for lever in levers_of(checked(first.source))}
    ends = {"onsets"}  # a hand moves a slider once the curves are there, or when they have to be drawn anew
    asked(first)
    ends = {IDLE}
    for path in levers or list(known)[:3]:
        lever = known.get(path)
        low, high = friction_range(first.case()) if lever is None else (lever.low, lever.high)
        each: list[float] = []
        for k in range(moves):
            share = 0.4 + 0.2 * k / moves
            by_factors = lever is not None and lever.scale == "log"
            value = low * (high / low) ** share if by_factors else low + (high - low) * share
            moved_to = replace(first, mu=value) if lever is None else first.with_change(path, value)
            each.append(asked(moved_to))
        print(f"{path}: processor time of a move, {spread(each[1:])}")


def moved(page: Any, path: str, turn: float) -> dict[str, float]:
    """Milliseconds of one move to somewhere near where the lever stood, with a rest before it as a hand has it, until
    each part of the picture is there."""
    time.sleep(0.1)
    found: dict[str, float] = page.evaluate(MOVE, [path, 0.4 + 0.2 * turn])
    return found


if __name__ == "__main__":
    main()
