"""Names, roles and contrast of the page by axe-core, which `.ci/run` fetches where npm is."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from browsing import ROOT, WITH_BROWSER, page_at, slide, wait

pytest.importorskip("nicegui", reason="the extra app is not installed")
pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
AXE = Path(os.environ.get("STRIDOR_AXE", ROOT / "build" / "axe" / "package" / "axe.min.js"))
pytestmark = [
    WITH_BROWSER,
    pytest.mark.skipif(not AXE.exists(), reason=f"axe-core is not at {AXE} (npm pack axe-core, unpacked)"),
]
GRAVE = ("serious", "critical")


@pytest.mark.parametrize("scheme", ["light", pytest.param("dark", marks=pytest.mark.slow)])
def test_axe_finds_nothing_grave(browser: Any, address: str, scheme: str) -> None:
    with page_at(browser, address, color_scheme=scheme) as page:
        page.evaluate(AXE.read_text(encoding="utf-8"))
        page.click("#st-run-go")
        page.locator("#st-modes-list button").nth(8).click()
        wait(page, "stridorRun.page.picture !== null && document.querySelector('#st-tornado table') !== null")
        page.click("#st-run-stop")
        for tab in ("Bench", "Stability map"):
            page.get_by_role("tab", name=tab).click()
            found = page.evaluate("axe.run(document)")["violations"]
            grave = [(v["impact"], v["id"], [n["html"][:200] for n in v["nodes"]]) for v in found if v["impact"] in GRAVE]
            assert grave == [], tab
        page.get_by_role("tab", name="Bench").click()
        slide(page, "loads.press.force.1", 20.0)
        page.locator("#st-problem").wait_for(state="visible")
        found = page.evaluate("axe.run('#st-problem')")["violations"]
        assert [v["id"] for v in found if v["impact"] in GRAVE] == []
