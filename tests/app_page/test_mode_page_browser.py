"""Modes in motion in a real browser: the graphics card draws what the plain canvas draws, or leaves it to that.

There is no graphics card where tests run: WebGL is computed by the processor, coarser. SMOOTH hides that from the page.
"""

from __future__ import annotations

import io
import json
from collections.abc import Generator
from contextlib import contextmanager
from functools import cache
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browsing import WITH_BROWSER, shot
from PIL import Image

from stridor.typing import Array
from stridor.view.mode_motion import page_data
from stridor.view.mode_page import animation_shell, mode_page, viewer_script
from stridor.view.skin import Skin

pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
pytestmark = WITH_BROWSER

SMOOTH = """{ const given = WebGL2RenderingContext.prototype.getExtension;
WebGL2RenderingContext.prototype.getExtension = function (name) { return name === "WEBGL_debug_renderer_info" ? null : given.call(this, name); }; }"""
NO_WEBGL = """{ const given = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) { return kind === "2d" ? given.call(this, kind, ...more) : null; }; }"""
# What is given to the graphics card and what it is told to draw, counted.
COUNTED = """globalThis.counts = { bufferData: 0, bufferSubData: 0, drawElements: 0 };
for (const name of Object.keys(counts)) {
  const given = WebGL2RenderingContext.prototype[name];
  WebGL2RenderingContext.prototype[name] = function (...all) { counts[name]++; return given.apply(this, all); };
}"""
DRAWN = "() => new Promise((done) => { later(); requestAnimationFrame(() => requestAnimationFrame(() => done(counts))); })"

STILL = "play(false); state.phase = 0"  # frames need not be told of reduced motion


def rings(dimension: int = 3) -> Skin:
    """A ring with a wave around it, a smaller one that rises in its middle, and a line; in the plane two flat ones."""
    around, across = 30, 8
    a, b = (k.ravel() for k in np.meshgrid(np.arange(around), np.arange(across), indexing="ij"))
    p, q = 2 * np.pi * a / around, 2 * np.pi * b / across
    place = np.arange(around * across).reshape(around, across)
    corners = [place, np.roll(place, -1, 0), np.roll(place, (-1, -1), (0, 1)), np.roll(place, -1, 1)]
    facets = np.stack([c.ravel() for c in corners], axis=1)
    if dimension == 2:
        facets = np.stack([c[:, :-1].ravel() for c in corners], axis=1)

    def ring(radius: float) -> Array:
        out = radius * (1 + 0.25 * (np.cos(q) if dimension == 3 else b / across))
        return np.column_stack([out * np.cos(p), out * np.sin(p), 0.25 * radius * np.sin(q)])

    line = np.column_stack([0.02 * np.arange(4), 0.01 * np.arange(4), 0.05 * np.ones(4)])
    points = np.concatenate([ring(0.1), ring(0.05), line])[:, :dimension]
    size = around * across
    motion = np.zeros(points.shape, dtype=complex)
    motion[:size, -1], motion[size : 2 * size, -1], motion[2 * size :, 0] = np.exp(2j * p), 0.6, 0.8j
    return Skin(
        names=("outer", "inner", "line"), points=points, point_body=np.repeat([0, 1, 2], [size, size, 4]),
        facets=np.concatenate([facets, facets + size]), body=np.repeat([0, 1], len(facets)),
        edges=np.column_stack([place[:, 0], np.roll(place[:, 0], -1)]),
        segments=2 * size + np.array([[0, 1], [1, 2], [2, 3]]), segment_body=np.full(3, 2), motion=motion, closed=dimension == 3,
    )  # fmt: skip


@cache
def html(dimension: int = 3) -> str:
    data = page_data(rings(dimension), scale=None)
    return mode_page(title="Rings", growth="unstable", kind="unstable", note="", description="Rings: in motion", data=data, framed=False, viewer=True)


@cache
def around(script: str) -> str:
    """A page that has one in a frame, as that of `stridor app` does: it is dark, and told of a model when it is ready.
    script: runs in the frame before its own, which a browser that is busy does not promise of those of a context."""
    shell = animation_shell().replace("<head>", f"<head><script>{script}</script>", 1)
    assert script in shell
    data = json.dumps(page_data(rings(), scale=None))
    return f"""<!doctype html><body style="margin: 0"><script>const heard = [];
      window.addEventListener("message", (event) => {{
        const tell = (told) => event.source.postMessage(told, "*");
        heard.push(event.data);
        if (event.data === "stridor-mode-ready") for (const told of [{{ dark: true }}, {{ geometry: {data}, title: "Rings", growth: "unstable", unstable: true }}]) tell(told);
        if (event.data === "stridor-viewer-wanted") tell({{ viewer: {json.dumps(viewer_script())} }});
      }});</script>
      <iframe sandbox="allow-scripts" srcdoc="{escape(shell)}" style="width: 100%; height: 98vh; border: 0"></iframe>"""


@contextmanager
def opened(browser: Any, text: str, folder: Path, script: str, *, moves: bool = False, width: int = 600) -> Generator[Any]:
    """A page with a script that runs before its own. Nothing may be said on the console, and nothing fetched."""
    context = browser.new_context(viewport={"width": width, "height": 3 * width // 4 + 30}, reduced_motion="no-preference" if moves else "reduce")
    page = context.new_page()
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text) if message.type in ("error", "warning") and "GPU stall" not in message.text else None)
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda asked: said.append(asked.url) if not asked.url.startswith(("file:", "about:")) else None)
    for each in (script, COUNTED):
        page.add_init_script(each)
    file = folder / "page.html"
    file.write_text(text, encoding="utf-8")
    page.goto(file.as_uri())
    yield page
    context.close()
    assert said == []


def picture(page: Any) -> Array:
    """What is seen of the model, red, green and blue (h, w, 3), on a page or in a frame."""
    page.evaluate("document.activeElement.blur()")  # its outline is drawn over the model
    page.evaluate(DRAWN)
    return np.asarray(Image.open(io.BytesIO(page.locator("#stage").screenshot())).convert("RGB"), dtype=int)


def unlike(one: Array, other: Array) -> float:
    """Share of pixels that differ by more than edges do that one draws smooth and the other in steps."""
    return float(np.mean(np.abs(one - other).max(axis=2) > 60))


def assert_alike(drawn: Array, wanted: Array) -> None:
    """Edges are smooth in one of them. Light from the other side, or a tenth of the motion, makes more of a difference."""
    assert unlike(drawn, wanted) < 0.008
    assert float(np.mean(np.abs(drawn - wanted).max(axis=2))) < 2.5  # of 255


@pytest.mark.parametrize("dimension", [3, pytest.param(2, marks=pytest.mark.slow)])
def test_the_graphics_card_draws_what_the_canvas_draws(browser: Any, tmp_path: Path, dimension: int):
    seen: dict[str, list[Array]] = {}
    for card in (True, False):
        # In the plane lines lie closer, and more of the picture is edges.
        with opened(browser, html(dimension), tmp_path, SMOOTH if card else NO_WEBGL, width={3: 600, 2: 800}[dimension]) as page:
            assert page.evaluate("card !== null") is card
            found = seen.setdefault("card" if card else "canvas", [picture(page)])
            page.select_option("#colours", "body")
            found.append(picture(page))
            page.evaluate("control('phase').value = 180; control('phase').dispatchEvent(new Event('input'))")
            page.locator("#view").press("ArrowRight")
            page.locator("#view").press("Shift+ArrowUp")
            page.mouse.move(300, 200)
            page.mouse.wheel(0, -200)
            found.append(picture(page))
            shot(page, f"rings-{dimension}d-{'card' if card else 'canvas'}")
    paper = seen["canvas"][0][0, 0]
    for drawn, wanted in zip(seen["card"], seen["canvas"], strict=True):
        assert float(np.mean(np.abs(wanted - paper).max(axis=2) > 60)) > 0.08  # of the window is the model
        assert_alike(drawn, wanted)
    for one, other in ((0, 1), (1, 2), (0, 2)):
        assert unlike(seen["card"][one], seen["card"][other]) > 0.04


def test_it_moves_by_phase_alone_and_everything_is_sent_once(browser: Any, tmp_path: Path):
    with opened(browser, html(), tmp_path, SMOOTH, moves=True) as page:
        before = page.evaluate(DRAWN)
        page.wait_for_function("before => counts.drawElements >= before + 15", arg=before["drawElements"])
        after = page.evaluate("counts")
        assert (after["bufferData"], after["bufferSubData"]) == (before["bufferData"], before["bufferSubData"])
        assert before["bufferData"] > 0
        view = page.locator("#view")
        view.focus()
        view.press(" ")
        assert page.locator("#play").text_content() == "Play"
        assert page.evaluate("document.activeElement.id") == "view"  # the canvas keeps keys and words
        assert view.get_attribute("aria-label") == "Rings: in motion"

        def at(degrees: int) -> Array:
            page.evaluate("v => { control('phase').value = v; control('phase').dispatchEvent(new Event('input')); }", degrees)
            return picture(page)

        rest, half = at(0), at(180)
        assert unlike(rest, half) > 0.05
        assert np.array_equal(at(360), rest)
        # Another mode: its two parts, those of lines at both ends; points and facets stay.
        before = page.evaluate(DRAWN)
        page.evaluate("change({ real: data.imag, imag: data.real })")
        after = page.evaluate(DRAWN)
        assert after["bufferData"] == before["bufferData"]
        assert after["bufferSubData"] - before["bufferSubData"] == 2 + 4
        assert unlike(picture(page), rest) > 0.02


def test_the_canvas_goes_on_where_the_graphics_card_is_taken_away(browser: Any, tmp_path: Path):
    """In a frame that asks the page around it for what it needs; before it is there, and after it was lost, too."""
    with opened(browser, around(NO_WEBGL), tmp_path, "") as page:
        frame = page.frames[1]
        frame.wait_for_function("cardless")
        frame.evaluate(STILL)
        assert page.evaluate("heard") == ["stridor-mode-ready", "stridor-viewer-wanted"]
        wanted = picture(frame)
        assert wanted[0, 0].tolist() == [27, 29, 34]  # dark
        assert unlike(wanted, np.broadcast_to(wanted[0, 0], wanted.shape)) > 0.08
    with opened(browser, around(SMOOTH), tmp_path, "") as page:
        frame = page.frames[1]
        frame.wait_for_function("card !== null")
        frame.evaluate(STILL)
        assert page.evaluate("heard") == ["stridor-mode-ready", "stridor-viewer-wanted"]
        assert_alike(picture(frame), wanted)
        assert frame.locator("#view").get_attribute("aria-label") == "Rings, in motion; unstable"
        frame.evaluate("card.renderer.getContext().getExtension('WEBGL_lose_context').loseContext()")
        frame.wait_for_function("card === null")
        assert frame.locator("canvas").count() == 1
        assert np.array_equal(picture(frame), wanted)
        page.set_viewport_size({"width": 390, "height": 844})
        frame.wait_for_function("canvas.width === 390 && width === 390")
