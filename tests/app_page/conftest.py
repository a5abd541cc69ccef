"""A browser and a server for all tests here: while the browser is there, its thread can run no other event loop."""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

import pytest
from browsing import CHROMIUM, begin_again, page_at, serving


@pytest.fixture(scope="package")
def address() -> Generator[str]:
    with serving() as (_, found):
        yield found


@pytest.fixture(scope="package")
def browser() -> Generator[Any]:
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with sync_api.sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=str(CHROMIUM), args=["--no-sandbox", "--enable-unsafe-swiftshader"])
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def opened(browser: Any, address: str) -> Generator[Any]:
    with page_at(browser, address) as page:
        yield page


@pytest.fixture
def page(opened: Any, address: str) -> Generator[Any]:
    """A page as it opens: to load one takes longer than most tests do, and they share it."""
    yield opened
    begin_again(opened, address)
