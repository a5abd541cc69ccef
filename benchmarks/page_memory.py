"""Random use of the page: does the server, the page's processes or the browser's page grow?

python benchmarks/page_memory.py [--minutes 60] [--short]
Moves, modes, tabs, undo, runs begun, heard and stopped, at random. Printed are the memory of the server with its
processes, what of it is their own (the rest are files of libraries, whose share is less the more other programs use
them), and the heap of the page, rubbish collected, after a twelfth of the time (five minutes of an hour) and at the
end. Needs the extra app, playwright, Linux, and Chromium at /usr/bin/chromium; without them it says so and leaves.
"""

from __future__ import annotations

import argparse
import random
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

CHROMIUM = Path("/usr/bin/chromium")
START = "typeof stridor !== 'undefined' && stridor.state.onsets !== null && stridorRun.page.ready"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--short", action="store_true", help="half a minute: only that it works")
    args = parser.parse_args()
    if not all(map(find_spec, ("nicegui", "playwright"))) or not CHROMIUM.exists() or not Path("/proc").exists():
        print("no measurement: needs nicegui, playwright, Linux and /usr/bin/chromium")
        return
    command = [sys.executable, "-m", "stridor", "app", "--no-browser", "--quiet"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    try:
        use(server.stdout.readline().strip(), server.pid, 60 * (0.5 if args.short else args.minutes))
    finally:
        server.terminate()
        server.wait(20)
        server.stdout.close()


def use(address: str, server: int, seconds: float) -> None:
    """Use the page for so long, and say what it takes."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        failures: list[str] = []
        page.on("pageerror", lambda error: failures.append(str(error)))
        page.goto(address)
        page.wait_for_function(START, timeout=600_000)
        counter = page.context.new_cdp_session(page)
        began, early, chance, acts = time.monotonic(), None, random.Random(7), 0
        while time.monotonic() - began < seconds:
            act(page, chance)
            acts += 1
            if early is None and time.monotonic() - began > seconds / 12:
                early = told(page, counter, server, acts, "after a twelfth")
        late = told(page, counter, server, acts, "at the end")
        if early is not None:
            ratios = [b / a for a, b in zip(early, late, strict=True)]
            server_, own, heap = ratios
            print(f"  ratio of the end to a twelfth of the time: server {server_:.2f} (own {own:.2f}), page {heap:.2f}")
        print(f"  errors of the page's script: {len(failures)}{': ' + failures[0] if failures else ''}")
        browser.close()


ACTS = {"slide": 60, "mode": 8, "tab": 4, "Undo": 6, "Reset": 1, "go": 3, "stop": 4, "listen": 2, "Light/dark": 1}
SLIDE = """([which, share]) => {
  const all = [...document.querySelectorAll("input[type=range][data-path]")], slider = all[which % all.length];
  slider.value = Math.round((0.35 + 0.3 * share) * slider.max);
  slider.dispatchEvent(new Event("input", { bubbles: true }));
}"""
PRESS = "([kind, k]) => { const all = document.querySelectorAll(kind); all[k % Math.max(all.length, 1)]?.click(); }"
NAMED = "(words) => [...document.querySelectorAll('button')].find((b) => b.textContent.trim() === words)?.click()"


def act(page: Any, chance: random.Random) -> None:
    """Something that somebody may do."""
    (kind,) = chance.choices(tuple(ACTS), tuple(ACTS.values()))
    if kind == "slide":
        page.evaluate(SLIDE, [chance.randrange(99), chance.random()])
    elif kind in ("mode", "tab"):
        page.evaluate(PRESS, [{"mode": "#st-modes-list button", "tab": "[role=tab]"}[kind], chance.randrange(99)])
    elif kind in ("go", "stop", "listen"):
        page.evaluate(PRESS, [f"#st-run-{kind}", 0])
    else:
        page.evaluate(NAMED, kind)
    time.sleep(chance.expovariate(1 / 0.4))


def told(page: Any, counter: Any, server: int, acts: int, when: str) -> tuple[float, float, float]:
    """Memory of the server with its processes, no run under way, what of it is their own, and of the page [MB];
    printed."""
    page.evaluate("document.getElementById('st-run-stop').click()")
    time.sleep(5)
    counter.send("HeapProfiler.collectGarbage")
    heap = page.evaluate("performance.memory.usedJSHeapSize") / 1e6
    memory, own = resident(server)
    words = f"server and its processes {memory:.0f} MB (own {own:.0f}), heap of the page {heap:.1f} MB"
    print(f"{when}, {acts} acts: {words}", flush=True)
    return memory, own, heap


def resident(process: int) -> tuple[float, float]:
    """Memory of a process and all below it, what several share divided among them, and that without files [MB]."""
    parents: dict[int, int] = {}
    for place in Path("/proc").glob("[0-9]*/stat"):
        try:
            parents[int(place.parent.name)] = int(place.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
    total, own, below = 0.0, 0.0, [process]
    while below:
        one = below.pop()
        below += [child for child, parent in parents.items() if parent == one]
        try:
            text = Path(f"/proc/{one}/smaps_rollup").read_text()
        except OSError:
            continue
        total += int(text.split("Pss:")[1].split()[0]) / 1e3
        own += int(text.split("Pss_Anon:")[1].split()[0]) / 1e3
    return total, own


if __name__ == "__main__":
    main()
