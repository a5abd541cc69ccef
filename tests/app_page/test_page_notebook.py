"""The page in a notebook: a frame below a cell, served by the process that goes on with the next cell."""

from __future__ import annotations

import http.server
import subprocess
import sys
import threading
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import pytest
from browsing import PATIENT, SOLVED, WITH_BROWSER, expect, shot

pytest.importorskip("nicegui", reason="the extra app is not installed")

# What a kernel does: cells one after the other, their last value shown, and an end that leaves nothing behind.
CELLS = """
import sys
import urllib.request
import stridor as st

if __name__ == "__main__":
    page = st.app()
    print(page._repr_html_().replace(chr(10), " "))
    print(urllib.request.urlopen(page.address).status, st.onsets(st.loads(st.app().server.source_of(page.key).text)).first.mu, flush=True)
    sys.stdin.readline()
    if "stop" in sys.argv:
        page.stop()
        print(page._repr_html_())
"""


@pytest.fixture
def notebook() -> Generator[Callable[[str], int]]:
    """Serves what a cell shows; the port."""
    servers: list[http.server.HTTPServer] = []

    def serve(html: str) -> int:
        class Cell(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "text/html; charset=utf-8")
                self.end_headers()
                self.wfile.write(f"<!doctype html><h1>notebook</h1>{html}".encode())

            def log_message(self, *_: Any, **__: Any) -> None:
                pass

        servers.append(http.server.ThreadingHTTPServer(("127.0.0.1", 0), Cell))
        threading.Thread(target=servers[0].serve_forever, daemon=True).start()
        return int(servers[0].server_address[1])

    yield serve
    for server in servers:
        server.shutdown()
        server.server_close()


@pytest.fixture
def kernel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Generator[subprocess.Popen[str]]:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    command = [sys.executable, "-c", CELLS, *getattr(request, "param", ())]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    yield process
    process.kill()
    process.communicate()


@WITH_BROWSER
@pytest.mark.parametrize(("kernel", "host"), [pytest.param((), "localhost", marks=pytest.mark.slow), (("stop",), "127.0.0.1")], indirect=["kernel"])
def test_a_frame_below_a_cell_shows_the_page(browser: Any, kernel: Any, notebook: Callable[[str], int], host: str, tmp_path: Path) -> None:
    """localhost, where notebooks are, is another site than 127.0.0.1: a browser may give the frame no storage."""
    html = kernel.stdout.readline()
    assert html.startswith('<iframe title="stridor" src="http://127.0.0.1:')
    assert kernel.stdout.readline().startswith("200 0.0767")  # the kernel goes on beside it
    context = browser.new_context()
    page = context.new_page()
    failed: list[str] = []
    page.on("pageerror", lambda error: failed.append(str(error)))
    page.goto(f"http://{host}:{notebook(html)}/")
    page.frame_locator("iframe").first.locator("#st-modes-list button").first.wait_for(timeout=PATIENT)
    frame = next(frame for frame in page.frames if "127.0.0.1" in frame.url and frame.parent_frame == page.main_frame)
    frame.wait_for_function(SOLVED, timeout=PATIENT)
    expect(frame.locator("#st-said")).to_contain_text("Growth begins at μ = 0.076725")
    assert failed == []
    shot(page, f"notebook-{host}")
    assert list(tmp_path.iterdir())
    out, err = kernel.communicate("\n", timeout=60)
    assert err == ""
    assert out == ("<p>stopped</p>\n" if "stop" in kernel.args else "")
    assert list(tmp_path.iterdir()) == []
    context.close()
