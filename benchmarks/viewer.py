"""Frames a second of modes in motion, by the graphics card and on the plain canvas, in a real browser.

python benchmarks/viewer.py [--short] [--graphics-card] [--fine] [TRIANGLES …]
Without --graphics-card WebGL is computed by the processor (SwiftShader); the script works as long on a frame as it does
with a graphics card. A browser draws at most 60 frames a second.
Needs playwright, and Chromium at /usr/bin/chromium; without them it says so and leaves.
"""

from __future__ import annotations

import argparse
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from stridor.view.mode_motion import page_data
from stridor.view.mode_page import mode_page
from stridor.view.skin import Skin

CHROMIUM = Path("/usr/bin/chromium")
SOFTWARE = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
# How many frames a second while it plays, and how long the script works on one [ms], as a rule.
FRAMES = """(seconds) => new Promise((done) => {
  const drawn = draw, each = [];
  draw = () => { const began = performance.now(); drawn(); each.push(performance.now() - began); };
  setTimeout(() => {
    each.length = 0;
    const began = performance.now();
    setTimeout(() => {
      const rate = 1e3 * each.length / (performance.now() - began), canvas = document.querySelector("canvas");
      done([rate, each.sort((a, b) => a - b)[each.length >> 1], Boolean(card), canvas.width, canvas.height]);
    }, 1e3 * seconds);
  }, 500);
})"""


def ring(triangles: int) -> Skin:
    """A thick ring of about so many triangles, a wave travelling around it."""
    around = max(8, round((2 * triangles) ** 0.5))
    across = max(4, round(triangles / 2 / around))
    a, b = (k.ravel() for k in np.meshgrid(np.arange(around), np.arange(across), indexing="ij"))
    p, q = 2 * np.pi * a / around, 2 * np.pi * b / across
    radius = 0.12 + 0.03 * np.cos(q)
    points = np.column_stack([radius * np.cos(p), radius * np.sin(p), 0.015 * np.sin(q)])
    place = np.arange(around * across).reshape(around, across)
    corners = [place, np.roll(place, -1, 0), np.roll(place, (-1, -1), (0, 1)), np.roll(place, -1, 1)]
    facets = np.stack([corner.ravel() for corner in corners], axis=1)
    motion = np.zeros((len(points), 3), dtype=complex)
    motion[:, 2] = np.exp(3j * p)
    none = np.zeros((0, 2), dtype=np.int64)
    zero = np.zeros(len(points), dtype=np.int64)
    return Skin(
        names=("ring",), points=points, point_body=zero, facets=facets, body=np.zeros(len(facets), dtype=np.int64),
        edges=none, segments=none, segment_body=none[:, 0], motion=motion, closed=True,
    )  # fmt: skip


def page(skin: Skin, *, viewer: bool) -> str:
    """Its page."""
    return mode_page(
        title="ring", growth="", kind="stable", note="", description="ring", data=page_data(skin, scale=None),
        framed=False, viewer=viewer,
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--short", action="store_true", help="one size, one second")
    parser.add_argument("--graphics-card", action="store_true", help="that of this machine, where Chromium finds one")
    parser.add_argument("--fine", action="store_true", help="on a screen with two pixels for one, each way")
    parser.add_argument("triangles", nargs="*", type=int, default=[1_000, 10_000, 100_000])
    args = parser.parse_args()
    if find_spec("playwright") is None or not CHROMIUM.exists():
        print("no measurement: needs playwright and /usr/bin/chromium")
        return
    sizes, seconds = ([1_000], 1.0) if args.short else (args.triangles, 4.0)
    measure(sizes, seconds, card=args.graphics_card, ratio=2 if args.fine else 1)


def measure(sizes: list[int], seconds: float, *, card: bool, ratio: int) -> None:
    """Both of them, size by size."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        options = ["--no-sandbox", *(() if card else SOFTWARE)]
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=options)
        context = browser.new_context(viewport={"width": 1280, "height": 720}, device_scale_factor=ratio)
        for size in sizes:
            skin = ring(size)
            for viewer in (True, False):
                file = Path(folder) / "page.html"
                file.write_text(page(skin, viewer=viewer), encoding="utf-8")
                told = frames(context, file, seconds)
                print(f"{skin.triangles} triangles, page of {file.stat().st_size / 1e6:.2f} MB, {told}", flush=True)
        browser.close()


def frames(context: Any, file: Path, seconds: float) -> str:
    """What one page does."""
    opened = context.new_page()
    opened.goto(file.as_uri())
    rate, work, card, width, height = opened.evaluate(FRAMES, seconds)
    opened.close()
    drawn = f"{'WebGL' if card else 'canvas'}, {width} × {height} pixels"
    return f"{drawn}: {rate:.0f} frames a second, the script works {work:.1f} ms on one"


if __name__ == "__main__":
    main()
