"""Random use of the page: does the server, the page's processes or the browser's page grow?

python benchmarks/page_memory.py [--minutes 60] [--kinds] [--short]
Moves, modes, tabs, undo, runs begun, heard and stopped, limit cycles sought, at random. Printed are, after each twelfth
of the time (five minutes of an hour), the memory of the server with its processes, what of it is their own (the rest
are files of libraries, whose share is less the more other programs use them), that of the browser's process that shows
the page, files left out as well, and of this the heap of its script, rubbish collected, with how many nodes and
listeners there are. What a page needs at all is there after five minutes: the ratio at the end is to that.
--kinds: what the heap is made of, too: objects, what of it is script, compiled by the browser ever better the longer it
runs, what the browser holds beside it (nodes, styles, pictures). To look at it the browser writes it all down, and some
25 MB of its process stay taken by that: that process then says nothing of the page.
Needs the extra app, playwright, Linux, and Chromium at /usr/bin/chromium; without them it says so and leaves.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import subprocess
import sys
import time
from collections import Counter
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

CHROMIUM = Path("/usr/bin/chromium")
SAMPLES = 12  # over the time
SCRIPT, BROWSER = "code", "native"  # of the heap, as its browser calls them
FIRST = 300.0  # seconds
START = "typeof stridor !== 'undefined' && stridor.state.onsets !== null && stridorRun.page.ready"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--kinds", action="store_true", help="what the heap of the page is made of, too")
    parser.add_argument("--short", action="store_true", help="seconds: only that it works")
    args = parser.parse_args()
    if not all(map(find_spec, ("nicegui", "playwright"))) or not CHROMIUM.exists() or not Path("/proc").exists():
        print("no measurement: needs nicegui, playwright, Linux and /usr/bin/chromium")
        return
    command = [sys.executable, "-m", "stridor", "app", "--no-browser", "--quiet"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    try:
        lasts = (6.0, 2) if args.short else (60 * args.minutes, SAMPLES)
        use(server.stdout.readline().strip(), server.pid, *lasts, kinds=args.kinds)
    finally:
        server.terminate()
        server.wait(20)
        server.stdout.close()


def use(address: str, server: int, seconds: float, times: int, *, kinds: bool) -> None:
    """Use the page for so long, and say what it takes, so many times."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        failures: list[str] = []
        page.on("pageerror", lambda error: failures.append(str(error)))
        page.goto(address)
        page.wait_for_function(START, timeout=600_000)
        counter = page.context.new_cdp_session(page)
        counter.send("Performance.enable")
        began, chance, acts, samples = time.monotonic(), random.Random(7), 0, list[Sample]()
        while len(samples) < times:
            act(page, chance)
            acts += 1
            if time.monotonic() - began > seconds * (len(samples) + 1) / times:
                samples.append(sample(page, counter, server, time.monotonic() - began, kinds=kinds))
                print(f"{(time.monotonic() - began) / 60:5.1f} min, {acts} acts: {samples[-1].words()}", flush=True)
        last = samples[-1]
        first = next((s for s in samples if s.seconds >= FIRST), samples[0])
        ratios = ", ".join(f"{key} {last.mb[key] / first.mb[key]:.2f}" for key in first.mb)
        print(f"  ratio of {last.seconds / 60:.1f} to {first.seconds / 60:.1f} min: {ratios}")
        print(f"  errors of the page's script: {len(failures)}{': ' + failures[0] if failures else ''}")
        browser.close()


ACTS = {"slide": 60, "mode": 8, "tab": 4, "Undo": 6, "Reset": 1, "go": 3, "stop": 4, "listen": 2, "Light/dark": 1,
        "find": 2, "leave": 4}  # fmt: skip
BUTTONS = {"go": "run-go", "stop": "run-stop", "listen": "run-listen", "find": "cycle-go", "leave": "cycle-stop"}
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
    elif kind in BUTTONS:
        page.evaluate(PRESS, [f"#st-{BUTTONS[kind]}", 0])
    else:
        page.evaluate(NAMED, kind)
    time.sleep(chance.expovariate(1 / 0.4))


@dataclass(frozen=True)
class Sample:
    """Memory [MB] of what, and numbers of things in the page, after so many seconds."""

    seconds: float
    mb: dict[str, float]
    counts: dict[str, int]

    def words(self) -> str:
        """One line of all."""
        memory = ", ".join(f"{key} {value:.1f} MB" for key, value in self.mb.items())
        return f"{memory}; {', '.join(f'{value} {key}' for key, value in self.counts.items())}"


def sample(page: Any, counter: Any, server: int, seconds: float, *, kinds: bool) -> Sample:
    """What the server with its processes and the page take, no run under way."""
    for kind in ("stop", "leave"):
        page.evaluate(PRESS, [f"#st-{BUTTONS[kind]}", 0])
    time.sleep(5)
    memory, own = resident(server)
    for _ in range(2):  # what the first leaves for the second: finalizers, caches that grow old by collections
        counter.send("HeapProfiler.collectGarbage")
        time.sleep(1)
    shown = page_process()
    heap = counter.send("Runtime.getHeapUsage")["usedSize"] / 1e6
    told = {one["name"]: one["value"] for one in counter.send("Performance.getMetrics")["metrics"]}
    counts = {"nodes": int(told["Nodes"]), "listeners": int(told["JSEventListeners"])}
    mb = {"server": memory, "own": own, "page": shown, "heap": heap}
    if kinds:
        sizes = by_type(counter)
        script, browser = sizes[SCRIPT] / 1e6, sizes[BROWSER] / 1e6
        mb |= {"script": script, "objects": sum(sizes.values()) / 1e6 - browser - script, "browser": browser}
    return Sample(seconds, mb, counts)


def by_type(counter: Any) -> Counter[str]:
    """Bytes of the page's heap by the type that the browser gives them, rubbish collected."""
    chunks: list[str] = []

    def heard(event: Any) -> None:
        chunks.append(event["chunk"])

    counter.on("HeapProfiler.addHeapSnapshotChunk", heard)
    counter.send("HeapProfiler.takeHeapSnapshot")
    counter.remove_listener("HeapProfiler.addHeapSnapshotChunk", heard)
    taken = json.loads("".join(chunks))
    fields = taken["snapshot"]["meta"]["node_fields"]
    kinds = taken["snapshot"]["meta"]["node_types"][0]
    nodes, step, size = taken["nodes"], len(fields), fields.index("self_size")
    found: Counter[str] = Counter()
    for start in range(0, len(nodes), step):
        found[kinds[nodes[start]]] += nodes[start + size]
    return found


def page_process() -> float:
    """Memory without files of the process that shows the page [MB]: the largest of its kind, as a browser keeps empty
    ones at hand beside it."""
    mine = [one for one in below(os.getpid()) if "--type=renderer" in read(Path(f"/proc/{one}/cmdline"))]
    return max((resident(one)[1] for one in mine), default=0.0)


def resident(process: int) -> tuple[float, float]:
    """Memory of a process and all below it, what several share divided among them, and that without files [MB]."""
    total, own = 0.0, 0.0
    for one in (process, *below(process)):
        text = read(Path(f"/proc/{one}/smaps_rollup"))
        if text:
            total += int(text.split("Pss:")[1].split()[0]) / 1e3
            own += int(text.split("Pss_Anon:")[1].split()[0]) / 1e3
    return total, own


def below(process: int) -> list[int]:
    """The processes that a process started, and that they did."""
    parents: dict[int, int] = {}
    for place in Path("/proc").glob("[0-9]*/stat"):
        if text := read(place):
            parents[int(place.parent.name)] = int(text.rpartition(")")[2].split()[1])
    found = [process]
    for one in found:
        found += [child for child, parent in parents.items() if parent == one]
    return found[1:]


def read(place: Path) -> str:
    """A file of /proc, empty where its process is gone."""
    try:
        return place.read_text()
    except OSError:
        return ""


if __name__ == "__main__":
    main()
