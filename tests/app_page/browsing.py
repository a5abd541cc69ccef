"""Pages in a real browser: the program started, pages opened, numbers typed, screenshots taken."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = Path(os.environ.get("STRIDOR_CHROMIUM", "/usr/bin/chromium"))
WITH_BROWSER = pytest.mark.skipif(not CHROMIUM.exists(), reason=f"no browser at {CHROMIUM} (Debian: apt install chromium)")
ROOT = Path(__file__).parents[2]
SHOTS = Path(os.environ.get("STRIDOR_SCREENSHOTS", ROOT / "build" / "screenshots"))
PATIENT = 180_000  # ms
SOLVED = "typeof stridor !== 'undefined' && stridor.state.onsets !== null"
READY = "[stridorRun, stridorCycle, stridorBoth, stridorMap].every((s) => s.page.ready)"


@contextmanager
def serving(*words: str) -> Generator[tuple[subprocess.Popen[str], str]]:
    """The program with its page, and the address."""
    command = [sys.executable, "-m", "stridor", "app", "--no-browser", "--quiet", *words]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stderr is not None
    try:
        address = process.stdout.readline().strip()
        assert address.startswith("http://127.0.0.1:"), process.stderr.read()
        yield process, address
    finally:
        process.terminate()  # with which its folders go, too
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait(20)
        process.stdout.close()
        process.stderr.close()


@contextmanager
def page_at(browser: Any, address: str, *, width: int = 1280, height: int = 720, lost: bool = False, **more: Any) -> Generator[Any]:
    """A page that has drawn its case; nothing may be asked of another computer, and the script may not fail. lost: at
    its end the server only hears nothing of it any more; otherwise it is closed as a tab is."""
    context = browser.new_context(viewport={"width": width, "height": height}, **more)
    page = context.new_page()
    failed: list[str] = []
    page.on("pageerror", lambda error: failed.append(str(error)))
    page.on("request", lambda asked: failed.append(asked.url) if "127.0.0.1" not in asked.url and not asked.url.startswith(("data:", "blob:", "about:")) else None)
    page.goto(address)
    wait(page, f"{SOLVED} && {READY}")
    try:
        yield page
        if not lost:
            with page.expect_event("close", timeout=PATIENT):
                page.close(run_before_unload=True)
    finally:
        context.close()
    assert not failed, failed


def begin_again(page: Any, address: str) -> None:
    """Back to the two beams as they were opened; by loading the page where a test has left it unable to."""
    from playwright.sync_api import Error

    try:
        page.evaluate("Quasar.Dark.set(false)")
        slide(page, "mu", 0.123)  # so that what is told of μ = 0.1 below is not of before
        page.wait_for_function("stridor.state.at?.mu === 0.123", timeout=20_000, polling=100)
        page.get_by_role("button", name="Examples").click(timeout=20_000)
        page.get_by_text("two-beams", exact=True).click(timeout=20_000)
        page.wait_for_function(f"stridor.state.at?.mu === 0.1 && stridor.state.at.checked && {SOLVED}", timeout=20_000, polling=100)
    except Error:
        page.goto("about:blank")
        page.goto(address)
        wait(page, f"{SOLVED} && {READY}")


def shot(page: Any, name: str, **more: Any) -> None:
    SHOTS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=SHOTS / f"{name}.png", **more)


def slide(page: Any, path: str, value: float) -> None:
    """A number field to a value, as it is typed."""
    field = page.locator(f'[data-number="{path}"]')
    field.fill(f"{value:g}")
    field.press("Enter")


def wait(page: Any, condition: str) -> None:
    page.wait_for_function(condition, timeout=PATIENT)


def number(page: Any, path: str, value: float) -> None:
    """A number field shows that value."""
    wait(page, f"Number(document.querySelector('[data-number=\"{path}\"]').value) === {value!r}")


def expect(locator: Any) -> Any:
    """What the page has to show soon: parts of it arrive one after the other."""
    from playwright.sync_api import expect as soon

    soon.set_options(timeout=PATIENT)
    return soon(locator)
